//! What the linter asks the packs, the catalogue and the list of hooks.

use serde_json::Value;

use crate::pack::{Role, Version};

/// What a schema says about one path.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PathShape {
    /// JSON type names allowed there.
    pub kinds: Vec<&'static str>,
    /// The words allowed, where only these are; of a list, those of its elements.
    pub literals: Option<Vec<String>>,
    /// Whether any member may stand below.
    pub open: bool,
    /// Whether it is a list.
    pub array: bool,
}

/// What the catalogue says about one requirement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RequirementFacts {
    /// The sides it obliges.
    pub roles: Vec<Role>,
    /// The packs that have it, as indices into [`Vocabulary::versions`].
    pub packs: Vec<usize>,
}

/// A hook that `operator:` can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HookFacts {
    /// Its name.
    pub name: &'static str,
    /// The parameters it takes.
    pub parameters: &'static [&'static str],
}

/// The names a suite may use. A pack is meant by its index into [`Vocabulary::versions`].
pub trait Vocabulary {
    /// The version of every pack.
    fn versions(&self) -> Vec<Version>;
    /// The topics of a pack and who publishes them.
    fn topics(&self, pack: usize) -> Vec<(String, Role)>;
    /// What the schema of a topic says about a path of member names; lists are entered without an index.
    fn shape(&self, pack: usize, topic: &str, path: &[&str]) -> Option<PathShape>;
    /// The members below a path.
    fn members(&self, pack: usize, topic: &str, path: &[&str]) -> Vec<String>;
    /// A word of the vocabulary: `error.outdatedUpdate`.
    fn word(&self, pack: usize, path: &str) -> Option<Value>;
    /// A requirement.
    fn requirement(&self, id: &str) -> Option<RequirementFacts>;
    /// Every requirement id.
    fn requirements(&self) -> Vec<String>;
    /// The hooks of one side.
    fn hooks(&self, role: Role) -> Vec<HookFacts>;
}
