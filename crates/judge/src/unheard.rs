//! Whether the device shows that it gets what the harness sends, where no tap sees it go there.
//!
//! A broker with access rules may keep orders from the device without a word. Behind one a device that shows nothing of any order
//! is not accused of what it does not do: nobody can tell whether it knows of them.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use serde_json::Value;

use tck_journal::Entry;
use tck_journal::event::Event;
use tck_pack::{Pack, Role};

/// So many ids of a topic are looked for.
const KEPT: usize = 64;

/// What was sent, and whether anything of it was seen again.
#[derive(Debug, Default)]
pub(super) struct Unheard {
    /// By full topic on which the device is commanded, as long as it has shown nothing.
    sent: BTreeMap<String, VecDeque<String>>,
    /// On which topics that is, of those on which the running test has sent something.
    of_test: Vec<String>,
}

impl Unheard {
    /// Of an AGV under test with these topics by name.
    pub fn of(topics: &BTreeMap<String, String>, pack: &Pack) -> Self {
        let commands = topics.iter().filter(|(name, _)| {
            let topic = pack.topic(name);
            topic.is_some_and(|topic| topic.publisher == Role::MasterControl)
        });
        Self {
            sent: commands.map(|(_, full)| (full.clone(), VecDeque::new())).collect(),
            of_test: Vec::new(),
        }
    }

    /// Sees the next entry.
    pub fn observe(&mut self, entry: &Entry) {
        match entry.event() {
            Event::TestBegun { .. } => self.of_test.clear(),
            Event::Sent { topic, .. } => {
                if let Some(sent) = self.sent.get_mut(topic) {
                    sent.extend(ids(entry.json()));
                    let old = sent.len().saturating_sub(KEPT);
                    sent.drain(..old);
                    if !self.of_test.contains(topic) {
                        self.of_test.push(topic.clone());
                    }
                }
            }
            Event::Message { payload, .. } if self.sent.values().any(|sent| !sent.is_empty()) => {
                let text = String::from_utf8_lossy(payload.bytes());
                self.sent
                    .retain(|_, sent| !sent.iter().any(|id| text.contains(id.as_str())));
            }
            _ => {}
        }
    }

    /// Why nothing can be said of what the device did not do in the running test.
    pub fn why(&self) -> Option<Arc<str>> {
        let topic = self.of_test.iter().find(|topic| self.sent.contains_key(*topic))?;
        let why = format!(
            "without a tap nobody can tell whether the broker lets the device read {topic}, and it has shown nothing so far of \
             what came there"
        );
        Some(why.into())
    }
}

/// What a message is known by: the id of an order, or those of instant actions.
fn ids(message: Option<&Value>) -> Vec<String> {
    let id = |value: &Value, name: &str| value.get(name).and_then(Value::as_str).map(str::to_owned);
    let Some(message) = message else { return Vec::new() };
    let actions = message.get("actions").and_then(Value::as_array);
    let actions = actions
        .into_iter()
        .flatten()
        .filter_map(|action| id(action, "actionId"));
    let all = id(message, "orderId").into_iter().chain(actions);
    // A short one may stand anywhere.
    all.filter(|id| id.len() >= 6).collect()
}
