//! Pictures of the part of a message that matters: match, witness, nearest miss.
//!
//! A [`Term`] is a value with variables in it, a [`Pattern`] a picture with variables; binding both gives a
//! [`Bound`] pattern that is matched without further look-ups. Which message is looked at, and when, is
//! left to the judge.

mod ast;
mod bindings;
mod bound;
mod examine;
mod matches;
mod number;
#[cfg(test)]
mod properties;
mod words;

pub use ast::{Compare, Comparison, Element, Elements, Pattern, PatternKind, Piece, Term, TermKind};
pub use bindings::{Bindings, Unbound};
pub use bound::{Bound, whole_text};
pub use examine::{Examination, Miss};
pub use number::{compare_numbers, same_value, whole};
