//! What the linter asks the packs, the catalogue and the list of hooks.

use serde_json::Value;

use crate::pack::{Catalogue, Packs, Role, Shape, Version};

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
    /// The side it is for.
    pub role: Role,
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
    fn shape(&self, pack: usize, topic: &str, path: &[&str]) -> Option<Shape>;
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

/// The names of the real packs and catalogue.
pub struct PackVocabulary<'a> {
    /// The protocol versions.
    pub packs: &'a Packs,
    /// The requirements.
    pub catalogue: &'a Catalogue,
    /// The hooks a profile can have.
    pub hooks: &'a [HookFacts],
}

impl Vocabulary for PackVocabulary<'_> {
    fn versions(&self) -> Vec<Version> {
        self.packs.all().iter().map(|pack| pack.version).collect()
    }

    fn topics(&self, pack: usize) -> Vec<(String, Role)> {
        let pack = self.packs.all().get(pack);
        pack.map(|pack| pack.topics())
            .unwrap_or_default()
            .iter()
            .map(|topic| (topic.name.as_str().to_owned(), topic.publisher))
            .collect()
    }

    fn shape(&self, pack: usize, topic: &str, path: &[&str]) -> Option<Shape> {
        self.packs.all().get(pack)?.schema(topic)?.shape(path)
    }

    fn members(&self, pack: usize, topic: &str, path: &[&str]) -> Vec<String> {
        let schema = self.packs.all().get(pack).and_then(|pack| pack.schema(topic));
        schema.map(|schema| schema.members(path)).unwrap_or_default()
    }

    fn word(&self, pack: usize, path: &str) -> Option<Value> {
        path.split('.')
            .filter(|part| !part.is_empty())
            .try_fold(self.packs.all().get(pack)?.vocabulary(), |value, part| value.get(part))
            .cloned()
    }

    fn requirement(&self, id: &str) -> Option<RequirementFacts> {
        let requirement = self.catalogue.get(id)?;
        let has = |pack: &usize| {
            let pack = self.packs.all().get(*pack);
            pack.is_some_and(|pack| requirement.in_version(pack).is_some())
        };
        Some(RequirementFacts {
            roles: [Role::Agv, Role::MasterControl]
                .into_iter()
                .filter(|role| requirement.role.concerns(*role))
                .collect(),
            packs: (0..self.packs.all().len()).filter(has).collect(),
        })
    }

    fn requirements(&self) -> Vec<String> {
        self.catalogue
            .all()
            .map(|requirement| requirement.id.to_string())
            .collect()
    }

    fn hooks(&self, role: Role) -> Vec<HookFacts> {
        self.hooks.iter().copied().filter(|hook| hook.role == role).collect()
    }
}
