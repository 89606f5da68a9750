//! A pattern whose variables have been filled in.

use std::fmt::Write;

use serde_json::Value;

use super::ast::{Compare, Element, Pattern, PatternKind};
use super::bindings::{Bindings, Unbound};
use crate::diagnostic::Span;

/// A pattern with values: owned, without variables, made once per step and matched often.
#[derive(Clone, Debug)]
pub struct Bound {
    pub(super) kind: BoundKind,
    pub(super) span: Span,
}

#[derive(Clone, Debug)]
pub(super) enum BoundKind {
    /// A scalar.
    Equals(Value),
    Object(Vec<(String, Bound)>),
    List(Vec<Bound>),
    All(Vec<Bound>),
    Elements(Element, Box<Bound>),
    Includes(Vec<Bound>),
    /// `$includes`, or a comparison, of a variable that turned out not to be a list or a number: matches nothing.
    Unfit {
        wanted: &'static str,
        value: Value,
    },
    Empty(bool),
    Count(Box<Bound>),
    In(Vec<Bound>),
    Not(Box<Bound>),
    Compare(Compare, serde_json::Number),
    Matches(regex::Regex),
    Present,
    Absent,
}

/// The regular expression of a `$matches`: it has to match the whole text.
pub fn whole_text(pattern: &str) -> Result<regex::Regex, regex::Error> {
    // Compiled alone first, so that `a)(b` is not accepted by way of the group around it.
    regex::Regex::new(pattern)?;
    regex::Regex::new(&format!(r"\A(?:{pattern})\z"))
}

impl Pattern {
    /// Fills in the variables.
    pub fn bind(&self, bindings: &Bindings) -> Result<Bound, Unbound> {
        let all = |patterns: &[Self]| {
            patterns
                .iter()
                .map(|pattern| pattern.bind(bindings))
                .collect::<Result<Vec<_>, _>>()
        };
        let kind = match &self.kind {
            PatternKind::Equals(term) => return Ok(Bound::picture(&term.bind(bindings)?, &self.span)),
            PatternKind::Object(members) => BoundKind::Object(
                members
                    .iter()
                    .map(|(name, pattern)| Ok((name.clone(), pattern.bind(bindings)?)))
                    .collect::<Result<_, Unbound>>()?,
            ),
            PatternKind::List(items) => BoundKind::List(all(items)?),
            PatternKind::All(parts) => BoundKind::All(all(parts)?),
            PatternKind::Elements(elements) => {
                BoundKind::Elements(elements.which, Box::new(elements.pattern.bind(bindings)?))
            }
            PatternKind::Includes(term) => match term.bind(bindings)? {
                Value::Array(items) => {
                    BoundKind::Includes(items.iter().map(|item| Bound::picture(item, &term.span)).collect())
                }
                value => BoundKind::Unfit {
                    wanted: "a list",
                    value,
                },
            },
            PatternKind::Empty(empty) => BoundKind::Empty(*empty),
            PatternKind::Count(pattern) => BoundKind::Count(Box::new(pattern.bind(bindings)?)),
            PatternKind::In(terms) => BoundKind::In(
                terms
                    .iter()
                    .map(|term| Ok(Bound::picture(&term.bind(bindings)?, &term.span)))
                    .collect::<Result<_, Unbound>>()?,
            ),
            PatternKind::Not(pattern) => BoundKind::Not(Box::new(pattern.bind(bindings)?)),
            PatternKind::Compare(comparison) => match comparison.with.bind(bindings)? {
                Value::Number(number) => BoundKind::Compare(comparison.which, number),
                value => BoundKind::Unfit {
                    wanted: "a number",
                    value,
                },
            },
            PatternKind::Matches(regex) => BoundKind::Matches(regex.clone()),
            PatternKind::Present => BoundKind::Present,
            PatternKind::Absent => BoundKind::Absent,
        };
        Ok(Bound {
            kind,
            span: self.span.clone(),
        })
    }
}

impl Bound {
    /// The picture of a value: objects match partially, lists exactly, scalars by equality.
    #[must_use]
    pub fn picture(value: &Value, span: &Span) -> Self {
        let kind = match value {
            Value::Object(members) => BoundKind::Object(
                members
                    .iter()
                    .map(|(name, value)| (name.clone(), Self::picture(value, span)))
                    .collect(),
            ),
            Value::Array(items) => BoundKind::List(items.iter().map(|item| Self::picture(item, span)).collect()),
            scalar => BoundKind::Equals(scalar.clone()),
        };
        Self {
            kind,
            span: span.clone(),
        }
    }

    /// Where the pattern is written.
    #[must_use]
    pub fn span(&self) -> &Span {
        &self.span
    }

    /// The pattern with its values, on one line.
    #[must_use]
    pub fn describe(&self) -> String {
        let mut text = String::new();
        self.write(&mut text);
        text
    }

    fn write(&self, into: &mut String) {
        match &self.kind {
            BoundKind::Equals(value) => {
                let _ = write!(into, "{value}");
            }
            BoundKind::Object(members) if members.is_empty() => into.push_str("{}"),
            BoundKind::Object(members) => {
                into.push_str("{ ");
                for (at, (name, pattern)) in members.iter().enumerate() {
                    into.push_str(if at == 0 { "" } else { ", " });
                    let _ = write!(into, "{name}: ");
                    pattern.write(into);
                }
                into.push_str(" }");
            }
            BoundKind::List(items) => write_list(items, into),
            BoundKind::All(parts) => {
                into.push_str("{ ");
                for (at, part) in parts.iter().enumerate() {
                    into.push_str(if at == 0 { "" } else { ", " });
                    part.write_operator(into);
                }
                into.push_str(" }");
            }
            _ => {
                into.push_str("{ ");
                self.write_operator(into);
                into.push_str(" }");
            }
        }
    }

    fn write_operator(&self, into: &mut String) {
        match &self.kind {
            BoundKind::Elements(which, pattern) => {
                let _ = write!(into, "{}: ", which.word());
                pattern.write(into);
            }
            BoundKind::Includes(items) => {
                into.push_str("$includes: ");
                write_list(items, into);
            }
            BoundKind::Unfit { wanted, value } => {
                let _ = write!(into, "{wanted} instead of {value}");
            }
            BoundKind::Empty(empty) => {
                let _ = write!(into, "$empty: {empty}");
            }
            BoundKind::Count(pattern) => {
                into.push_str("$count: ");
                pattern.write(into);
            }
            BoundKind::In(items) => {
                into.push_str("$in: ");
                write_list(items, into);
            }
            BoundKind::Not(pattern) => {
                into.push_str("$not: ");
                pattern.write(into);
            }
            BoundKind::Compare(which, number) => {
                let _ = write!(into, "{}: {number}", which.word());
            }
            BoundKind::Matches(regex) => {
                let written = regex.as_str();
                let written = written
                    .strip_prefix(r"\A(?:")
                    .and_then(|rest| rest.strip_suffix(r")\z"))
                    .unwrap_or(written);
                let _ = write!(into, "$matches: {written:?}");
            }
            BoundKind::Present => into.push_str("$present: true"),
            BoundKind::Absent => into.push_str("$absent: true"),
            BoundKind::Equals(_) | BoundKind::Object(_) | BoundKind::List(_) | BoundKind::All(_) => self.write(into),
        }
    }
}

fn write_list(items: &[Bound], into: &mut String) {
    into.push('[');
    for (at, item) in items.iter().enumerate() {
        into.push_str(if at == 0 { "" } else { ", " });
        item.write(into);
    }
    into.push(']');
}

impl Element {
    /// The operator as written.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Has => "$has",
            Self::HasNew => "$hasNew",
            Self::None => "$none",
            Self::One => "$one",
            Self::AtMostOne => "$atMostOne",
            Self::Each => "$each",
        }
    }
}

impl Compare {
    /// The operator as written.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Lt => "$lt",
            Self::Le => "$le",
            Self::Gt => "$gt",
            Self::Ge => "$ge",
        }
    }
}
