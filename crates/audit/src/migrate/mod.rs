//! What one device has to change to speak a later version: its messages are held against both, each by itself.
//!
//! [`Migrating`] is shown the messages of a recording. Each is judged by the version it names, and once more by the later one, after
//! its members and words were given the names of that. What then is still wrong is no matter of names. All of it is derived from
//! the catalogue, the schemas and the names of members of both versions.

pub mod markdown;
mod members;
mod migrating;
mod model;
pub mod page;
mod requirements;
pub mod text;
mod words;

#[cfg(test)]
mod tests;

pub use migrating::{MigrateError, MigrateOptions, Migrating};
pub use model::{
    Breach, MemberChange, MemberChangeKind, Migration, RequirementRow, Said, TopicChange, TopicTerms, WordChange,
};
