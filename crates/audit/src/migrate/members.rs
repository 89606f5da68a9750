//! Which members and words of messages a later version writes otherwise, or does not have: both schemas are walked together, along
//! the names that each version gives.

use std::collections::BTreeMap;

use serde_json::Value;

use super::model::{MemberChange, MemberChangeKind, WordChange};
use tck_pack::{MemberTree, MessageSchema, Pack, Role};
use tck_result::{MemberCoverage, MessageCoverage, TopicCoverage};
use tck_view::{ActionState, ActionView, ErrorView, Field, Names, Object, Spelling, StateView, Topic};

/// Members and words that a later version writes otherwise.
#[derive(Debug, Default)]
pub struct Compared {
    /// Members.
    pub members: Vec<MemberChange>,
    /// Words.
    pub words: Vec<WordChange>,
}

/// Compares the messages that a side sends in both versions; `seen` says what came of the earlier one, `errors` how many messages
/// had an error of a type.
pub fn compared(
    from: &Pack,
    to: &Pack,
    role: Role,
    seen: &MessageCoverage,
    errors: &BTreeMap<String, u64>,
) -> Compared {
    let mut all = Compared::default();
    for rule in from.topics().iter().filter(|rule| rule.publisher == role) {
        let topic = rule.name.as_str();
        let (Some(old), Some(new)) = (from.schema(topic), to.schema(topic)) else {
            continue;
        };
        let coverage = seen.topics.iter().find(|known| known.topic == topic);
        let mut walk = Walk {
            from: from.names(),
            to: to.names(),
            topic,
            old,
            new,
            seen: coverage.map(by_pointer).unwrap_or_default(),
            found: &mut all,
        };
        walk.below(0, 0, Some(Topic::of_name(topic).object()), None);
    }
    all.words.extend(actions(from, to, role, seen));
    if role == Role::Agv {
        all.words.extend(error_types(from, to, errors));
    }
    all.members
        .sort_by_key(|member| (std::cmp::Reverse(member.messages), member.kind));
    all.words.sort_by_key(|word| std::cmp::Reverse(word.messages));
    all
}

fn by_pointer(topic: &TopicCoverage) -> BTreeMap<&str, &MemberCoverage> {
    let members = topic.members.iter();
    members.map(|member| (member.member.as_str(), member)).collect()
}

/// Both schemas of a topic.
struct Walk<'a> {
    from: &'a Names,
    to: &'a Names,
    topic: &'a str,
    old: &'a MessageSchema,
    new: &'a MessageSchema,
    /// What came, by the place in the earlier version.
    seen: BTreeMap<&'a str, &'a MemberCoverage>,
    found: &'a mut Compared,
}

impl<'a> Walk<'a> {
    /// Compares what stands in a member, or in the message, with what stands in that which is meant by it.
    fn below(&mut self, here: usize, there: usize, object: Option<Object>, spelling: Option<Spelling<'a>>) {
        let (old, new, from, to) = (self.old.tree(), self.new.tree(), self.from, self.to);
        let element = old.element(here);
        if let (Some(here), Some(there)) = (element, new.element(there)) {
            self.words(here, there, spelling);
            self.below(here, there, object, spelling);
        }
        for (at, node) in old.nodes().iter().enumerate() {
            if node.parent != Some(here) || Some(at) == element {
                continue;
            }
            let own = object.and_then(|object| to.spelling(object, usual_name(from, object, &node.name)?));
            let name = match own {
                Some(own) => own.name,
                None => Some(node.name.as_str()),
            };
            match name.and_then(|name| inside(new, there, name)) {
                Some(meant) => {
                    self.member(at, meant);
                    self.words(at, meant, own);
                    self.below(at, meant, own.and_then(|own| own.holds), own);
                }
                None => self.note(MemberChangeKind::Gone, at, None, None),
            }
        }
        if let Some(object) = object {
            self.apart(here, there, object);
        }
    }

    /// A member, and the one that is meant by it.
    fn member(&mut self, at: usize, meant: usize) {
        let (old, new) = (&self.old.tree().nodes()[at], &self.new.tree().nodes()[meant]);
        let types = self.types(&old.pointer, &new.pointer);
        let is_renamed = old.name != new.name;
        let kind = match (&types, is_renamed) {
            (_, true) => MemberChangeKind::Renamed,
            (Some(_), false) => MemberChangeKind::Retyped,
            (None, false) => return,
        };
        let after = plain(&new.pointer);
        self.note(kind, at, Some(after), types);
    }

    /// The types of a member in both versions, where a value of the earlier one may be none of the later one.
    fn types(&self, before: &str, after: &str) -> Option<[String; 2]> {
        fn names(pointer: &str) -> Vec<&str> {
            pointer.split('/').skip(1).filter(|name| *name != "*").collect()
        }
        let (old, new) = (self.old.shape(&names(before))?, self.new.shape(&names(after))?);
        let bears = |kind: &str| new.kinds.contains(&kind) || kind == "integer" && new.kinds.contains(&"number");
        if old.open || new.open || old.kinds.iter().all(|kind| bears(kind)) {
            return None;
        }
        Some([old.kinds.join(" or "), new.kinds.join(" or ")])
    }

    /// The lists of an object that only the later version has, for what stood among other things.
    fn apart(&mut self, here: usize, there: usize, object: Object) {
        let (old, new) = (self.old.tree(), self.new.tree());
        for field in Field::all().filter(|field| field.object() == object && self.from.lacks(*field)) {
            let among = self.from.spelling(object, field.usual_name());
            let (Some(among), Some(own)) = (among.and_then(|among| among.name), self.to.name(field)) else {
                continue;
            };
            if let (Some(at), Some(own)) = (inside(old, here, among), inside(new, there, own)) {
                let own = plain(&new.nodes()[own].pointer);
                self.note(MemberChangeKind::Apart, at, Some(own), None);
            }
        }
    }

    fn note(&mut self, kind: MemberChangeKind, at: usize, after: Option<String>, types: Option<[String; 2]>) {
        let old = self.old.tree();
        let pointer = old.nodes()[at].pointer.as_str();
        // A list counts where something stands in it.
        let counted = match (kind, old.element(at)) {
            (MemberChangeKind::Apart, Some(element)) => old.nodes()[element].pointer.as_str(),
            _ => pointer,
        };
        let change = MemberChange {
            topic: self.topic.to_owned(),
            kind,
            before: plain(pointer),
            after,
            types,
            messages: self.seen.get(counted).map_or(0, |member| member.messages),
        };
        self.found.members.push(change);
    }

    /// The words of a member, and those of the one that is meant by it.
    fn words(&mut self, at: usize, meant: usize, spelling: Option<Spelling<'a>>) {
        let (old, new) = (&self.old.tree().nodes()[at], &self.new.tree().nodes()[meant]);
        let seen = self.seen.get(old.pointer.as_str()).map(|member| &member.words);
        for word in &old.words {
            let now = spelling.map_or(word.as_str(), |spelling| spelling.word(word));
            let is_known = new.words.is_empty() || new.words.iter().any(|known| known == now);
            if is_known && now == word {
                continue;
            }
            let change = WordChange {
                member: format!("{}/{}", self.topic, plain(&old.pointer)),
                before: word.clone(),
                after: is_known.then(|| now.to_owned()),
                messages: seen.and_then(|words| words.get(word)).copied().unwrap_or_default(),
            };
            self.found.words.push(change);
        }
    }
}

/// The usual name of a member that a version calls so.
fn usual_name(names: &Names, object: Object, name: &str) -> Option<&'static str> {
    let mut fields = Field::all().filter(|field| field.object() == object);
    let found = fields.find(|field| names.name(*field) == Some(name));
    found.map(Field::usual_name)
}

/// The member of that name, with a slash where it stands inside another one.
fn inside(tree: &MemberTree, at: usize, name: &str) -> Option<usize> {
    name.split('/').try_fold(at, |at, part| tree.child(at, part))
}

/// A pointer without the slash at its beginning.
fn plain(pointer: &str) -> String {
    pointer.strip_prefix('/').unwrap_or(pointer).to_owned()
}

/// The predefined actions that the later version calls otherwise, or does not have.
fn actions(from: &Pack, to: &Pack, role: Role, seen: &MessageCoverage) -> Vec<WordChange> {
    let field = match role {
        Role::Agv => ActionState::action_type,
        Role::MasterControl => ActionView::action_type,
    };
    let spelling = to.names().spelling(field.object(), field.usual_name());
    let known = to.vocabulary().get("action");
    let predefined = from.vocabulary().get("action").and_then(Value::as_object);
    let names = predefined.into_iter().flat_map(|all| all.keys());
    let change = |name: &String| {
        let now = spelling.map_or(name.as_str(), |spelling| spelling.word(name));
        let is_known = known.is_some_and(|known| known.get(now).is_some());
        let came = seen.actions.iter().find(|action| action.action == *name);
        let messages = came.map_or(0, |came| match role {
            Role::Agv => came.reported + came.declared,
            Role::MasterControl => came.sent,
        });
        (!is_known || now != name).then(|| WordChange {
            member: "action".to_owned(),
            before: name.clone(),
            after: is_known.then(|| now.to_owned()),
            messages,
        })
    };
    names.filter_map(change).collect()
}

/// The names of errors that the later version writes otherwise.
fn error_types(from: &Pack, to: &Pack, seen: &BTreeMap<String, u64>) -> Vec<WordChange> {
    let own = |name: &str| to.vocabulary().get("error")?.get(name)?.as_str();
    let errors = from.vocabulary().get("error").and_then(Value::as_object);
    let names = from.names();
    let member = format!(
        "{}/{}/*/{}",
        Topic::State.as_str(),
        names.name(StateView::errors).unwrap_or_default(),
        names.name(ErrorView::error_type).unwrap_or_default()
    );
    let change = |(name, word): (&String, &Value)| {
        let (before, after) = (word.as_str()?, own(name)?);
        (before != after).then(|| WordChange {
            member: member.clone(),
            before: before.to_owned(),
            after: Some(after.to_owned()),
            messages: seen.get(before).copied().unwrap_or_default(),
        })
    };
    errors.into_iter().flatten().filter_map(change).collect()
}
