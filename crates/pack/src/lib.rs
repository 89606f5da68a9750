//! A protocol version as data, the catalogue of requirements, and the vocabulary of hooks.
//!
//! A [`Pack`] is one folder of `schemas/`: a JSON schema for each topic, `protocol.toml`, `vocabulary.yaml` and, where the
//! published text is disputed, `errata.yaml`. The [`Catalogue`] is `suites/requirements/`, [`Hooks`] are `suites/hooks/`.
//! All come from [`Assets`], the embedded files or a replacement. Versions are data: no code below or above names one.
//! What a message *means* is left to patterns, checks and the judge.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod assets;
mod asyncapi;
mod breakage;
mod catalogue;
mod catalogue_file;
mod changes;
mod errata;
mod fields;
mod hooks;
mod hooks_file;
mod member_tree;
mod participant;
mod protocol;
pub mod reader;
mod schema;
mod shape;
mod validator;
mod version;

#[cfg(test)]
mod tests;

pub use assets::{AssetFile, Assets};
pub use asyncapi::asyncapi;
pub use breakage::{Breakage, BreakageScope, Way};
pub use catalogue::{Catalogue, Decided, Mood, Requirement, RequirementId, Subject, VersionChange, VersionNote};
pub use changes::{ChangeKind, RequirementChange};
pub use errata::KeptReading;
pub use hooks::{HookChange, HookEffect, HookInfo, HookParameter, HookRisk, HookValue, Hooks};
pub use member_tree::{MemberNode, MemberTree};
pub use participant::Participant;
pub use protocol::{NoPack, Pack, PackError, Packs, TopicName, TopicRule, VersionClaim};
pub use schema::{Finding, FindingKind, MessageSchema};
pub use shape::Shape;
pub use version::{Version, VersionRange};

/// The two sides of the interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The vehicle.
    Agv,
    /// The fleet manager.
    MasterControl,
}

impl Role {
    /// The word used in files and outputs.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Agv => "agv",
            Self::MasterControl => "master-control",
        }
    }

    /// The other side.
    #[must_use]
    pub fn opposite(self) -> Self {
        match self {
            Self::Agv => Self::MasterControl,
            Self::MasterControl => Self::Agv,
        }
    }
}

impl std::fmt::Display for Role {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.word())
    }
}
