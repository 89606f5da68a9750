//! What the linter asks the packs, the catalogue and the vocabulary of hooks.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use serde_json::Value;

use tck_pack::{Breakage, BreakageScope, Catalogue, Hooks, Mood, Pack, Packs, Role, Shape, Version};
use tck_view::{Field, Object, Topic};

/// What the catalogue says about one requirement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RequirementFacts {
    /// The sides it obliges.
    pub roles: Vec<Role>,
    /// The packs that have it, as indices into [`Vocabulary::versions`].
    pub packs: Vec<usize>,
    /// Those of them in which it is a permission, which nothing breaks.
    pub permitting: Vec<usize>,
}

/// The names a suite may use. A pack is meant by its index into [`Vocabulary::versions`].
pub trait Vocabulary {
    /// The version of every pack.
    fn versions(&self) -> Vec<Version>;
    /// The topics of a pack and who publishes them.
    fn topics(&self, pack: usize) -> Vec<(String, Role)>;
    /// What the schema of a topic says about a path of member names; lists are entered without an index.
    fn shape(&self, pack: usize, topic: &str, path: &[&str]) -> Option<Rc<Shape>>;
    /// The members below a path.
    fn members(&self, pack: usize, topic: &str, path: &[&str]) -> Vec<String>;
    /// Every way to break a message of a topic; `None` if there is no such topic.
    fn breakages(&self, pack: usize, topic: &str, ground: &BreakageScope) -> Option<Vec<Breakage>>;
    /// Whether messages of a pack do not have a member.
    fn lacks(&self, pack: usize, member: Field) -> bool;
    /// Whether messages of a topic do not have a member of earlier versions.
    fn lost(&self, pack: usize, topic: &str, path: &[&str]) -> bool;
    /// A word of the vocabulary: `error.outdatedUpdate`.
    fn word(&self, pack: usize, path: &str) -> Option<Value>;
    /// Whether a pack has a predefined action, told by its usual name or as the version writes it.
    fn has_action(&self, pack: usize, name: &str) -> bool {
        self.word(pack, &format!("action.{name}")).is_some()
    }
    /// A requirement.
    fn requirement(&self, id: &str) -> Option<RequirementFacts>;
    /// Every requirement id.
    fn requirements(&self) -> Vec<String>;
    /// What `operator:` can name.
    fn hooks(&self) -> &Hooks;
}

/// The names of the real packs and catalogue.
pub struct PackVocabulary<'a> {
    packs: &'a Packs,
    catalogue: &'a Catalogue,
    hooks: &'a Hooks,
    /// Suites ask for the same few paths over and over, and a schema takes its time to answer.
    shapes: RefCell<HashMap<String, Option<Rc<Shape>>>>,
}

impl<'a> PackVocabulary<'a> {
    /// The names of these packs, this catalogue and the hooks a profile can have.
    #[must_use]
    pub fn new(packs: &'a Packs, catalogue: &'a Catalogue, hooks: &'a Hooks) -> Self {
        Self {
            packs,
            catalogue,
            hooks,
            shapes: RefCell::default(),
        }
    }
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

    fn shape(&self, pack: usize, topic: &str, path: &[&str]) -> Option<Rc<Shape>> {
        let of_pack = self.packs.all().get(pack)?;
        let schema = of_pack.schema(topic)?;
        let own = of_pack.names().spelled_names(Topic::of_name(topic).object(), path)?;
        let path = own.as_slice();
        // Member names of our schemas have no line breaks; those of a suite may, and then only miss the memory.
        let mut key = format!("{pack}\n{topic}");
        for name in path {
            key.push('\n');
            key.push_str(name);
        }
        if path.iter().any(|name| name.contains('\n')) {
            return schema.shape(path).map(Rc::new);
        }
        self.shapes
            .borrow_mut()
            .entry(key)
            .or_insert_with(|| schema.shape(path).map(Rc::new))
            .clone()
    }

    fn members(&self, pack: usize, topic: &str, path: &[&str]) -> Vec<String> {
        let Some(of_pack) = self.packs.all().get(pack) else {
            return Vec::new();
        };
        let path = of_pack.names().spelled_names(Topic::of_name(topic).object(), path);
        let members = of_pack
            .schema(topic)
            .zip(path)
            .map(|(schema, path)| schema.members(&path));
        members.unwrap_or_default()
    }

    fn breakages(&self, pack: usize, topic: &str, ground: &BreakageScope) -> Option<Vec<Breakage>> {
        let schema = self.packs.all().get(pack)?.schema(topic)?;
        Some(schema.breakages(ground))
    }

    fn lacks(&self, pack: usize, member: Field) -> bool {
        let pack = self.packs.all().get(pack);
        pack.is_some_and(|pack| pack.names().lacks(member))
    }

    fn lost(&self, pack: usize, topic: &str, path: &[&str]) -> bool {
        let object = Topic::of_name(topic).object();
        let pack = self.packs.all().get(pack);
        pack.is_some_and(|pack| pack.names().spelled_names(object, path).is_none())
    }

    fn word(&self, pack: usize, path: &str) -> Option<Value> {
        path.split('.')
            .filter(|part| !part.is_empty())
            .try_fold(self.packs.all().get(pack)?.vocabulary(), |value, part| value.get(part))
            .cloned()
    }

    fn has_action(&self, pack: usize, name: &str) -> bool {
        let spelled = |pack: &Pack| {
            let kind = pack.names().spelling(Object::OfferedAction, "actionType");
            kind.map_or(name, |kind| kind.word(name)).to_owned()
        };
        let own = self.packs.all().get(pack).map(|pack| spelled(pack));
        let written = [Some(name.to_owned()), own];
        let mut written = written.into_iter().flatten();
        written.any(|name| self.word(pack, &format!("action.{name}")).is_some())
    }

    fn requirement(&self, id: &str) -> Option<RequirementFacts> {
        let requirement = self.catalogue.get(id)?;
        let mood = |pack: usize| Some(requirement.in_version(self.packs.all().get(pack)?)?.mood);
        let all = 0..self.packs.all().len();
        Some(RequirementFacts {
            roles: [Role::Agv, Role::MasterControl]
                .into_iter()
                .filter(|role| requirement.role.concerns(*role))
                .collect(),
            packs: all.clone().filter(|pack| mood(*pack).is_some()).collect(),
            permitting: all.filter(|pack| mood(*pack) == Some(Mood::May)).collect(),
        })
    }

    fn requirements(&self) -> Vec<String> {
        self.catalogue
            .all()
            .map(|requirement| requirement.id.to_string())
            .collect()
    }

    fn hooks(&self) -> &Hooks {
        self.hooks
    }
}
