//! Terms and patterns as written, before variables have values.

use std::sync::Arc;

use serde_json::Value;

use crate::diagnostic::Span;

/// A value that may hold variables.
#[derive(Clone, Debug)]
pub struct Term {
    /// What it is.
    pub kind: TermKind,
    /// Where it is written.
    pub span: Span,
}

/// The kinds of terms.
#[derive(Clone, Debug)]
pub enum TermKind {
    /// A value without variables.
    Literal(Value),
    /// One variable and nothing else: keeps its JSON type.
    Variable(String),
    /// Text with variables in it.
    Text(Vec<Piece>),
    /// A list.
    List(Vec<Term>),
    /// A mapping.
    Map(Vec<(String, Term)>),
}

/// A part of a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece {
    /// Verbatim.
    Text(String),
    /// The value of a variable.
    Variable(String),
}

/// A picture of a message or of a part of one.
#[derive(Clone, Debug)]
pub struct Pattern {
    /// What it is.
    pub kind: PatternKind,
    /// Where it is written; the caret of a miss.
    pub span: Span,
}

/// The kinds of patterns.
#[derive(Clone, Debug)]
pub enum PatternKind {
    /// Equal to this value. A variable that holds an object matches partially, like a written object.
    Equals(Term),
    /// An object with at least these members. Keys may be literal only.
    Object(Vec<(String, Pattern)>),
    /// A list of exactly these elements.
    List(Vec<Pattern>),
    /// All of these, on the same value: `{ $ge: 0, $le: 1 }`.
    All(Vec<Pattern>),
    /// `$has $hasNew $none $one $atMostOne $each`.
    Elements(Elements),
    /// `$includes`: every element of this list matches some element.
    Includes(Term),
    /// `$consecutive`: the elements of this list match elements that follow one another directly.
    Consecutive(Term),
    /// `$empty: true` or `false`.
    Empty(bool),
    /// `$count`: the number of elements matches.
    Count(Box<Pattern>),
    /// `$in`: equal to one of these.
    In(Vec<Term>),
    /// `$not`.
    Not(Box<Pattern>),
    /// `$lt $le $gt $ge`.
    Compare(Comparison),
    /// `$matches`: a regular expression that must match the whole text.
    Matches(Arc<regex::Regex>),
    /// `$present: true`, or `$absent: false`.
    Present,
    /// `$absent: true`, or `$present: false`.
    Absent,
}

/// A quantifier over the elements of an array.
#[derive(Clone, Debug)]
pub struct Elements {
    /// Which.
    pub which: Element,
    /// What an element must show.
    pub pattern: Box<Pattern>,
}

/// The quantifiers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// At least one element matches.
    Has,
    /// At least one element matches that was not in the last message before the stimulus.
    HasNew,
    /// No element matches.
    None,
    /// Exactly one element matches.
    One,
    /// At most one element matches.
    AtMostOne,
    /// Every element matches.
    Each,
}

/// A comparison of numbers.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Which.
    pub which: Compare,
    /// With what.
    pub with: Term,
}

/// The comparisons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compare {
    /// Less.
    Lt,
    /// Less or equal.
    Le,
    /// Greater.
    Gt,
    /// Greater or equal.
    Ge,
}

impl Pattern {
    /// Calls `visit` with every term of this pattern.
    pub fn visit_terms<'a>(&'a self, visit: &mut dyn FnMut(&'a Term)) {
        match &self.kind {
            PatternKind::Equals(term) | PatternKind::Includes(term) | PatternKind::Consecutive(term) => visit(term),
            PatternKind::Object(members) => members.iter().for_each(|(_, member)| member.visit_terms(visit)),
            PatternKind::List(parts) | PatternKind::All(parts) => parts.iter().for_each(|part| part.visit_terms(visit)),
            PatternKind::Elements(elements) => elements.pattern.visit_terms(visit),
            PatternKind::Count(inner) | PatternKind::Not(inner) => inner.visit_terms(visit),
            PatternKind::In(terms) => terms.iter().for_each(visit),
            PatternKind::Compare(comparison) => visit(&comparison.with),
            PatternKind::Empty(_) | PatternKind::Matches(_) | PatternKind::Present | PatternKind::Absent => {}
        }
    }
}
