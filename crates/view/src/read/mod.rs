//! The walk over a message, from a tree or from bytes: what stands there goes to its member, and everything into the
//! fingerprints.

mod free;
mod list;
mod object;
mod slot;
mod walk;

pub(crate) use free::skip;
pub(crate) use object::{View, boxed, message, plain};
pub(crate) use slot::{Readable, member};
pub(crate) use walk::Reader;
