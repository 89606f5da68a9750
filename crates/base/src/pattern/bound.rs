//! A pattern whose variables have been filled in.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

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
    Consecutive(Vec<Bound>),
    /// `$includes`, `$consecutive`, or a comparison, of a variable that turned out not to be a list or a number: matches nothing.
    Unfit {
        wanted: &'static str,
        value: Value,
    },
    Empty(bool),
    Count(Box<Bound>),
    In(Vec<Bound>),
    Not(Box<Bound>),
    Compare(Compare, serde_json::Number),
    Matches(Arc<regex::Regex>),
    Present,
    Absent,
}

/// The expressions of all suites that were read, by the text of the pattern.
static COMPILED: LazyLock<Mutex<HashMap<String, Arc<regex::Regex>>>> = LazyLock::new(Mutex::default);

/// The regular expression of a `$matches`: it has to match the whole text.
///
/// Rows of tables and states that many tests use bring few expressions many times, so each is compiled once. It is shared and not
/// cloned, since every clone of an expression has a cache of its own, which is larger than a message.
///
/// # Errors
/// What is wrong with the expression.
pub fn whole_text(pattern: &str) -> Result<Arc<regex::Regex>, regex::Error> {
    let mut compiled = COMPILED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = compiled.get(pattern) {
        return Ok(Arc::clone(known));
    }
    // Compiled alone first, so that `a)(b` is not accepted by way of the group around it.
    regex::Regex::new(pattern)?;
    let whole = Arc::new(regex::Regex::new(&format!(r"\A(?:{pattern})\z"))?);
    compiled.insert(pattern.to_owned(), Arc::clone(&whole));
    Ok(whole)
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
            PatternKind::Includes(term) | PatternKind::Consecutive(term) => match term.bind(bindings)? {
                Value::Array(items) => {
                    let items = items.iter().map(|item| Bound::picture(item, &term.span)).collect();
                    match &self.kind {
                        PatternKind::Includes(_) => BoundKind::Includes(items),
                        _ => BoundKind::Consecutive(items),
                    }
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
            PatternKind::Matches(regex) => BoundKind::Matches(Arc::clone(regex)),
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
}
