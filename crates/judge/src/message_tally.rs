//! Counts which members, words and action types of the standard come by: one walk over each message that was parsed already.
//!
//! A walk follows the tree of the schema, so what it costs and what is kept is bounded by the schema and not by the device. What the
//! standard does not have is kept by name, a few of each topic.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde_json::Value;

use tck_pack::{MemberTree, MessageSchema, Pack, Role};
use tck_result::{ActionCoverage, MemberCoverage, MessageCoverage, TopicCoverage, Unseen};
use tck_view::{ActionState, ActionView, Field, OfferedAction, Topic};

/// So many values of one message are looked at.
const VALUES: usize = 65_536;
/// So many members that the standard does not have are kept of a topic.
const OTHERS: usize = 64;
/// So many different action types are kept.
const ACTIONS: usize = 256;
/// So many bytes of a name are kept.
const LENGTH: usize = 120;
/// The members that say which action it is.
const ACTION_TYPES: [Field; 3] = [
    ActionView::action_type,
    ActionState::action_type,
    OfferedAction::action_type,
];
/// Where the vocabulary of a version has the status of an action that was done.
const FINISHED: &str = "actionStatus.finished";

/// Which members, words and action types of the messages of one version came by.
#[derive(Clone, Debug)]
pub struct MessageTally {
    pack: Arc<Pack>,
    /// By topic name, those of which something came.
    topics: BTreeMap<String, TopicTally>,
    actions: BTreeMap<String, ActionCoverage>,
}

/// The messages of one topic.
#[derive(Clone, Debug)]
struct TopicTally {
    schema: MessageSchema,
    /// For each member of the tree.
    members: Vec<Counter>,
    /// For each word of each member, those of the first member first.
    words: Vec<Counter>,
    /// Where the words of each member begin.
    begin: Vec<u32>,
    /// The objects that are an action, with the name of the member that says which it is.
    actions: Vec<(usize, String)>,
    /// The member that says how far an action is, and the word for one that was done.
    finished: Option<(String, String)>,
    messages: u32,
    others: BTreeSet<String>,
}

/// In how many messages something came.
#[derive(Clone, Copy, Debug, Default)]
struct Counter {
    messages: u32,
    /// The last message it was counted in.
    last: u32,
}

impl Counter {
    fn count(&mut self, message: u32) {
        if self.last != message {
            self.last = message;
            self.messages = self.messages.saturating_add(1);
        }
    }
}

impl TopicTally {
    fn of(schema: &MessageSchema, pack: &Pack) -> Self {
        let nodes = schema.tree().nodes();
        let names = ACTION_TYPES.map(|field| pack.names().name(field));
        let actions = nodes.iter().filter(|node| names.contains(&Some(node.name.as_str())));
        let status = pack.names().name(ActionState::action_status);
        let mut begin = Vec::with_capacity(nodes.len());
        let mut words = 0_u32;
        for node in nodes {
            begin.push(words);
            words = words.saturating_add(u32::try_from(node.words.len()).unwrap_or(u32::MAX));
        }
        Self {
            members: vec![Counter::default(); nodes.len()],
            words: vec![Counter::default(); words as usize],
            begin,
            actions: actions
                .filter_map(|node| Some((node.parent?, node.name.clone())))
                .collect(),
            finished: status
                .zip(pack.word(FINISHED))
                .map(|(member, word)| (member.to_owned(), word.to_owned())),
            messages: 0,
            others: BTreeSet::new(),
            schema: schema.clone(),
        }
    }

    /// Counts a message; gives the action types in it, and whether one of the type was done.
    fn note<'m>(&mut self, message: &'m Value) -> BTreeMap<&'m str, bool> {
        self.messages = self.messages.saturating_add(1);
        let schema = self.schema.clone();
        let tree = schema.tree();
        let mut actions = BTreeMap::new();
        let mut waiting: Vec<(usize, &'m Value)> = vec![(0, message)];
        let mut left = VALUES;
        while let Some((at, value)) = waiting.pop() {
            if left == 0 {
                break;
            }
            left -= 1;
            if value.is_null() {
                continue;
            }
            self.members[at].count(self.messages);
            match value {
                Value::Object(members) => {
                    let own = self.actions.iter().find(|(object, _)| *object == at);
                    if let Some(action) = own.and_then(|(_, name)| members.get(name)?.as_str()) {
                        let done = self.finished.as_ref().is_some_and(|(member, word)| {
                            members.get(member).and_then(Value::as_str) == Some(word.as_str())
                        });
                        *actions.entry(action).or_default() |= done;
                    }
                    for (name, member) in members {
                        match tree.child(at, name) {
                            Some(child) => waiting.push((child, member)),
                            None => self.note_other(tree, at, name),
                        }
                    }
                }
                Value::Array(elements) => {
                    if let Some(element) = tree.element(at) {
                        // What is left out of a list that is too long would not have been looked at either.
                        waiting.extend(elements.iter().take(left).map(|one| (element, one)));
                    }
                }
                Value::String(text) => {
                    let words = &tree.nodes()[at].words;
                    if let Some(word) = words.iter().position(|word| word == text) {
                        self.words[self.begin[at] as usize + word].count(self.messages);
                    }
                }
                _ => {}
            }
        }
        actions
    }

    /// Keeps the name of a member that the standard does not have, in an object of which it says what it holds.
    fn note_other(&mut self, tree: &MemberTree, at: usize, name: &str) {
        if self.others.len() < OTHERS && tree.is_object(at) {
            let level = cut(name).replace('~', "~0").replace('/', "~1");
            self.others.insert(format!("{}/{level}", tree.nodes()[at].pointer));
        }
    }

    fn result(&self, name: &str, publisher: Role) -> TopicCoverage {
        let nodes = self.schema.tree().nodes();
        let members = nodes.iter().enumerate().skip(1).map(|(at, node)| MemberCoverage {
            member: node.pointer.clone(),
            mandatory: node.mandatory,
            messages: u64::from(self.members[at].messages),
            words: node
                .words
                .iter()
                .zip(&self.words[self.begin[at] as usize..])
                .map(|(word, counter)| (word.clone(), u64::from(counter.messages)))
                .collect(),
        });
        let members: Vec<MemberCoverage> = members.collect();
        TopicCoverage {
            topic: name.to_owned(),
            publisher: publisher.word().to_owned(),
            messages: u64::from(self.messages),
            shown: members.iter().filter(|member| member.messages > 0).count(),
            of: members.len(),
            members,
            others: self.others.iter().cloned().collect(),
        }
    }
}

impl MessageTally {
    /// Nothing came yet of the messages of this version.
    #[must_use]
    pub fn new(pack: &Arc<Pack>) -> Self {
        Self {
            pack: Arc::clone(pack),
            topics: BTreeMap::new(),
            actions: BTreeMap::new(),
        }
    }

    /// The version by which it counts.
    #[must_use]
    pub fn pack(&self) -> &Arc<Pack> {
        &self.pack
    }

    /// Counts a message of a topic, given by its name; one that the version does not have is left out.
    pub fn note(&mut self, topic: &str, message: &Value) {
        if !self.topics.contains_key(topic) {
            let Some(schema) = self.pack.schema(topic) else { return };
            let new = TopicTally::of(schema, &self.pack);
            self.topics.insert(topic.to_owned(), new);
        }
        let Some(tally) = self.topics.get_mut(topic) else {
            return;
        };
        let kind = Topic::of_name(topic);
        for (action, done) in tally.note(message) {
            let name = cut(action);
            if !self.actions.contains_key(name) {
                if self.actions.len() >= ACTIONS {
                    continue;
                }
                self.actions.insert(name.to_owned(), ActionCoverage::default());
            }
            let Some(known) = self.actions.get_mut(name) else {
                continue;
            };
            *match kind {
                Topic::Factsheet => &mut known.declared,
                kind if kind.is_to_vehicle() => &mut known.sent,
                _ => &mut known.reported,
            } += 1;
            known.finished += u64::from(done);
        }
    }

    /// What came by, and what did not.
    #[must_use]
    pub fn result(&self) -> MessageCoverage {
        let topics = self.pack.topics().iter().map(|rule| {
            let name = rule.name.as_str();
            match (self.topics.get(name), self.pack.schema(name)) {
                (Some(tally), _) => tally.result(name, rule.publisher),
                (None, Some(schema)) => TopicTally::of(schema, &self.pack).result(name, rule.publisher),
                (None, None) => TopicCoverage::default(),
            }
        });
        let predefined = self.pack.vocabulary().get("action").and_then(Value::as_object);
        let predefined = predefined.into_iter().flat_map(|all| all.keys());
        let mut actions = self.actions.clone();
        for name in predefined {
            actions.entry(name.clone()).or_default().predefined = true;
        }
        let actions = actions
            .into_iter()
            .map(|(name, known)| ActionCoverage { action: name, ..known });
        MessageCoverage {
            topics: topics.collect(),
            actions: actions.collect(),
            undecided: Vec::new(),
        }
    }

    /// The members that messages of a topic can have.
    pub(super) fn tree(&self, topic: &str) -> Option<&MemberTree> {
        self.pack.schema(topic).map(MessageSchema::tree)
    }

    /// What it is that never came of a member, and of it as a word: any message, the member, or the word.
    pub(super) fn unseen(&self, topic: &str, at: usize, word: Option<&str>) -> Option<Unseen> {
        let mut unseen = Unseen {
            topic: topic.to_owned(),
            ..Unseen::default()
        };
        let Some(tally) = self.topics.get(topic) else {
            return Some(unseen);
        };
        let node = tally.schema.tree().nodes().get(at)?;
        unseen.member = Some(node.pointer.clone()).filter(|pointer| !pointer.is_empty());
        if tally.members[at].messages == 0 {
            return Some(unseen);
        }
        let word = word?;
        let place = node.words.iter().position(|known| known == word)?;
        let counter = tally.words.get(tally.begin[at] as usize + place)?;
        unseen.word = Some(word.to_owned());
        (counter.messages == 0).then_some(unseen)
    }
}

/// The beginning of a name that a device chose.
fn cut(name: &str) -> &str {
    let ends = name.char_indices().map(|(at, letter)| at + letter.len_utf8());
    let end = ends.take_while(|end| *end <= LENGTH).last();
    &name[..end.unwrap_or(0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn tally(messages: &[(&str, Value)]) -> MessageTally {
        let mut tally = MessageTally::new(tck_testing::library().rules.packs.latest());
        for (topic, message) in messages {
            tally.note(topic, message);
        }
        tally
    }

    fn count(coverage: &MessageCoverage, topic: &str, member: &str) -> u64 {
        let topic = coverage.topic(topic).expect("a topic");
        let found = topic.members.iter().find(|known| known.member == member);
        found.unwrap_or_else(|| panic!("no member {member}")).messages
    }

    #[test]
    fn members_are_counted_by_message_and_lists_are_folded() {
        let nodes = json!([{ "nodeId": "a", "sequenceId": 0 }, { "nodeId": "b", "nodeDescription": null }]);
        let coverage = tally(&[
            ("state", json!({ "nodeStates": nodes, "driving": true })),
            ("state", json!({ "nodeStates": [], "driving": false })),
        ])
        .result();
        assert_eq!(count(&coverage, "state", "/driving"), 2);
        assert_eq!(count(&coverage, "state", "/nodeStates"), 2);
        assert_eq!(count(&coverage, "state", "/nodeStates/*"), 1);
        assert_eq!(count(&coverage, "state", "/nodeStates/*/nodeId"), 1);
        assert_eq!(count(&coverage, "state", "/nodeStates/*/nodeDescription"), 0);
        let state = coverage.topic("state").expect("a topic");
        assert_eq!((state.messages, state.shown, state.publisher.as_str()), (2, 5, "agv"));
        assert_eq!(state.of, state.members.len());
        let released = state
            .members
            .iter()
            .find(|known| known.member == "/nodeStates/*/released");
        assert!(released.expect("a member").mandatory);
        assert_eq!(coverage.topic("order").expect("a topic").messages, 0);
    }

    #[test]
    fn words_are_counted_and_one_that_never_came_is_named() {
        let coverage = tally(&[
            ("state", json!({ "operatingMode": "AUTOMATIC" })),
            ("state", json!({ "operatingMode": "FLYING" })),
        ])
        .result();
        let state = coverage.topic("state").expect("a topic");
        let never: Vec<(&str, &str)> = state.unseen_words().collect();
        assert!(never.contains(&("/operatingMode", "MANUAL")), "{never:?}");
        assert!(!never.contains(&("/operatingMode", "AUTOMATIC")), "{never:?}");
    }

    #[test]
    fn action_types_are_told_by_where_they_stand() {
        let pick = json!([{ "actionId": "1", "actionType": "pick" }]);
        let own = json!([{ "actionType": "x".repeat(10_000) }]);
        let coverage = tally(&[
            ("order", json!({ "nodes": [{ "actions": pick }] })),
            ("state", json!({ "actionStates": pick })),
            (
                "state",
                json!({ "actionStates": [{ "actionType": "pick", "actionStatus": "FINISHED" }] }),
            ),
            ("factsheet", json!({ "protocolFeatures": { "agvActions": own } })),
        ])
        .result();
        let of = |name: &str| coverage.actions.iter().find(|known| known.action == name);
        let pick = of("pick").expect("an action");
        assert_eq!(
            (pick.predefined, pick.declared, pick.sent, pick.reported),
            (true, 0, 1, 2)
        );
        let own = of(&"x".repeat(LENGTH)).expect("an action");
        assert_eq!((own.predefined, own.declared), (false, 1));
        assert!(of("startPause").is_some_and(|known| known.predefined && known.sent == 0));
    }

    #[test]
    fn what_a_device_makes_up_is_bounded() {
        let mut message = serde_json::Map::new();
        for number in 0..1_000 {
            message.insert(format!("own/{number}{}", "é".repeat(500)), json!({ "deep": number }));
        }
        let actions: Vec<Value> = (0..1_000)
            .map(|number| json!({ "actionType": format!("a{number}") }))
            .collect();
        message.insert("actionStates".to_owned(), Value::Array(actions));
        let coverage = tally(&[
            ("state", Value::Object(message)),
            ("nothing", json!({})),
            ("state", json!([1])),
        ])
        .result();
        let state = coverage.topic("state").expect("a topic");
        assert_eq!(state.others.len(), OTHERS);
        assert!(
            state
                .others
                .iter()
                .all(|name| name.starts_with("/own~1") && name.len() < 200)
        );
        let made_up = coverage.actions.iter().filter(|known| !known.predefined).count();
        assert_eq!(made_up, ACTIONS);
    }
}
