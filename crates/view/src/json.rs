//! A value of any type: parameters of actions, and what stands where something else belongs.

use std::fmt;

use crate::{List, Number, Text};

/// The types of JSON.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// `null`.
    Null,
    /// `true` or `false`.
    Flag,
    /// A number.
    Number,
    /// A text.
    Text,
    /// An array.
    List,
    /// An object.
    Object,
}

/// A JSON value, bounded as everything in a view.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Json {
    /// `null`.
    #[default]
    Null,
    /// `true` or `false`.
    Flag(bool),
    /// A number.
    Number(Number),
    /// A text.
    Text(Text),
    /// An array.
    List(List<Json>),
    /// An object: its members in the order of the message.
    Object(List<(Text, Json)>),
}

impl Json {
    /// Its type.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        match self {
            Self::Null => Kind::Null,
            Self::Flag(_) => Kind::Flag,
            Self::Number(_) => Kind::Number,
            Self::Text(_) => Kind::Text,
            Self::List(_) => Kind::List,
            Self::Object(_) => Kind::Object,
        }
    }

    /// The text, if it is one.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text.as_str()),
            _ => None,
        }
    }

    /// `true` or `false`, if it is one.
    #[must_use]
    pub const fn flag(&self) -> Option<bool> {
        match self {
            Self::Flag(flag) => Some(*flag),
            _ => None,
        }
    }

    /// The number, if it is one.
    #[must_use]
    pub const fn number(&self) -> Option<Number> {
        match self {
            Self::Number(number) => Some(*number),
            _ => None,
        }
    }

    /// The elements, if it is an array.
    #[must_use]
    pub fn list(&self) -> Option<&[Self]> {
        match self {
            Self::List(list) => Some(list),
            _ => None,
        }
    }

    /// The members, if it is an object.
    #[must_use]
    pub fn members(&self) -> Option<&[(Text, Self)]> {
        match self {
            Self::Object(members) => Some(members),
            _ => None,
        }
    }

    /// A member of an object that carries no fixed names, such as the value of an action parameter.
    #[must_use]
    pub fn member(&self, name: &str) -> Option<&Self> {
        let of = |(known, value)| (known == name).then_some(value);
        self.members()?
            .iter()
            .map(|(known, value)| (known.as_str(), value))
            .find_map(of)
    }
}

/// Compact JSON, with `…` where something is cut.
impl fmt::Display for Json {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Null => f.write_str("null"),
            Self::Flag(flag) => flag.fmt(f),
            Self::Number(number) => number.fmt(f),
            Self::Text(text) => quoted(text, f),
            Self::List(list) => {
                f.write_str("[")?;
                separated(f, list, Self::fmt)?;
                f.write_str("]")
            }
            Self::Object(members) => {
                f.write_str("{")?;
                separated(f, members, |(name, value), f| {
                    quoted(name, f)?;
                    write!(f, ":{value}")
                })?;
                f.write_str("}")
            }
        }
    }
}

fn quoted(text: &Text, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let shown = serde_json::to_string(text.as_str()).map_err(|_| fmt::Error)?;
    match shown.strip_suffix('"').filter(|_| text.is_cut()) {
        Some(open) => write!(f, "{open}…\""),
        None => f.write_str(&shown),
    }
}

fn separated<T>(
    f: &mut fmt::Formatter<'_>,
    list: &List<T>,
    show: impl Fn(&T, &mut fmt::Formatter<'_>) -> fmt::Result,
) -> fmt::Result {
    for (at, element) in list.iter().enumerate() {
        if at > 0 {
            f.write_str(",")?;
        }
        show(element, f)?;
    }
    if list.is_cut() { f.write_str("…") } else { Ok(()) }
}
