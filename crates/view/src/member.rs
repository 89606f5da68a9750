//! A member of a message: there, absent, null, or of another type.

use std::slice;

use crate::{Json, Kind, List, Number, Text};

/// A member that should be a `T`.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Member<T> {
    /// The object has no such member, or the version of the protocol has none.
    #[default]
    Absent,
    /// The member is `null`.
    Null,
    /// The member is of another type: what stands there.
    Other(Box<Json>),
    /// The member is there and can be read.
    There(T),
}

/// How a member is there, whatever its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Presence {
    /// The object has no such member, or the version of the protocol has none.
    Absent,
    /// The member is `null`.
    Null,
    /// The member is of another type than it should be.
    Other,
    /// The member is there and can be read.
    There,
}

impl Presence {
    /// Whether something is there that is not `null`, of whatever type.
    #[must_use]
    pub const fn is_something(self) -> bool {
        matches!(self, Self::Other | Self::There)
    }
}

impl<T> Member<T> {
    /// How the member is there.
    #[must_use]
    pub const fn presence(&self) -> Presence {
        match self {
            Self::Absent => Presence::Absent,
            Self::Null => Presence::Null,
            Self::Other(_) => Presence::Other,
            Self::There(_) => Presence::There,
        }
    }

    /// The value where the member is there.
    #[must_use]
    pub const fn there(&self) -> Option<&T> {
        match self {
            Self::There(value) => Some(value),
            _ => None,
        }
    }

    /// Whether the member is there and can be read.
    #[must_use]
    pub const fn is_there(&self) -> bool {
        matches!(self, Self::There(_))
    }

    /// Whether the object has no such member.
    #[must_use]
    pub const fn is_absent(&self) -> bool {
        matches!(self, Self::Absent)
    }

    /// Whether the member is `null`.
    #[must_use]
    pub const fn is_null(&self) -> bool {
        matches!(self, Self::Null)
    }

    /// Whether the member is of another type than it should be; `null` is not meant.
    #[must_use]
    pub const fn is_other(&self) -> bool {
        matches!(self, Self::Other(_))
    }

    /// What stands there instead, where the member is of another type; `null` is not meant.
    #[must_use]
    pub fn other(&self) -> Option<&Json> {
        match self {
            Self::Other(other) => Some(other),
            _ => None,
        }
    }

    /// The type of what stands there instead.
    #[must_use]
    pub fn other_kind(&self) -> Option<Kind> {
        match self {
            Self::Null => Some(Kind::Null),
            Self::Other(other) => Some(other.kind()),
            Self::Absent | Self::There(_) => None,
        }
    }
}

impl Member<Text> {
    /// The text where the member is one.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        self.there().map(Text::as_str)
    }

    /// The text; empty where the member is none.
    #[must_use]
    pub fn or_empty(&self) -> &str {
        self.text().unwrap_or_default()
    }

    /// Whether the member is this text.
    #[must_use]
    pub fn is(&self, text: &str) -> bool {
        self.text() == Some(text)
    }
}

impl Member<bool> {
    /// `true` or `false` where the member is one of them.
    #[must_use]
    pub fn flag(&self) -> Option<bool> {
        self.there().copied()
    }

    /// Whether the member is this.
    #[must_use]
    pub fn is(&self, flag: bool) -> bool {
        self.flag() == Some(flag)
    }
}

impl Member<Number> {
    /// The number where the member is one.
    #[must_use]
    pub fn number(&self) -> Option<Number> {
        self.there().copied()
    }

    /// The number as a floating-point number.
    #[must_use]
    pub fn float(&self) -> Option<f64> {
        self.number().map(Number::float)
    }

    /// The number where it is a whole one that is not negative; `2.0` is one, too.
    #[must_use]
    pub fn whole(&self) -> Option<u64> {
        self.number().and_then(Number::whole)
    }
}

impl<T> Member<List<T>> {
    /// The elements; none where the member is no list.
    pub fn iter(&self) -> slice::Iter<'_, T> {
        self.elements().iter()
    }

    /// The elements; none where the member is no list.
    #[must_use]
    pub fn elements(&self) -> &[T] {
        self.there().map_or(&[], |list| list)
    }

    /// The elements where the member is a list and all of it is kept.
    #[must_use]
    pub fn complete(&self) -> Option<&[T]> {
        self.there().and_then(List::complete)
    }

    /// How many elements there are, kept or not; 0 where the member is no list.
    #[must_use]
    pub fn total(&self) -> usize {
        self.there().map_or(0, List::total)
    }

    /// Whether there are no elements: the list is empty, or there is no list.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.total() == 0
    }
}

impl<'m, T> IntoIterator for &'m Member<List<T>> {
    type Item = &'m T;
    type IntoIter = slice::Iter<'m, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl Member<List<Member<Text>>> {
    /// The texts in the list.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        self.iter().filter_map(Member::<Text>::text)
    }
}

impl Member<List<Member<Number>>> {
    /// The numbers; `None` where the member is no list, is cut, or holds something else.
    #[must_use]
    pub fn floats(&self) -> Option<Vec<f64>> {
        self.complete()?.iter().map(Member::<Number>::float).collect()
    }
}

impl Member<Json> {
    /// The text where the value is one.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        self.there().and_then(Json::text)
    }

    /// The number where the value is one, as a floating-point number.
    #[must_use]
    pub fn float(&self) -> Option<f64> {
        self.there().and_then(Json::number).map(Number::float)
    }

    /// `true` or `false` where the value is one of them.
    #[must_use]
    pub fn flag(&self) -> Option<bool> {
        self.there().and_then(Json::flag)
    }
}
