//! Whether the device shows that it gets what the harness sends, where no tap sees it go there.
//!
//! A broker with access rules may keep orders from the device without a word. Behind one a device that shows nothing of any order
//! is not accused of what it does not do: nobody can tell whether it knows of them. A device that answers with a new error has
//! read what came just before, or what the error names.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_journal::event::Event;
use tck_pack::{Pack, Role};
use tck_view::{ErrorView, Header, Member, MessageView, Names, StateView, Topic};

/// How many ids of a topic are looked for.
const KEPT: usize = 64;

/// A new error so soon after a message is about it.
const SOON: Duration = Duration::from_secs(1);

/// What was sent to a topic, as long as nothing of it was seen again.
#[derive(Debug)]
struct Commands {
    /// How the topic is named in the standard.
    name: String,
    /// What the messages are known by.
    ids: VecDeque<String>,
    /// The last message: when, and its headerId.
    last: Option<(Moment, Option<String>)>,
}

impl Commands {
    /// Whether this new error is about what was sent here: it names it, or is of a kind that was not there and comes soon.
    fn is_answered_by(&self, error: &ErrorView, soon: Option<Moment>, names: &Names) -> bool {
        let Some((sent, header)) = &self.last else { return false };
        let by_header = names.name(Header::header_id);
        let named = error.error_references.iter().any(|reference| {
            let key = reference.key.text();
            if key == Some("topic") {
                let topic = reference.value.text();
                topic.is_some_and(|topic| topic.rsplit('/').next() == Some(&self.name))
            } else {
                key.is_some() && key == by_header && header.is_some() && reference.value.text() == header.as_deref()
            }
        });
        named || soon.is_some_and(|at| at.since(*sent) <= SOON)
    }
}

/// What was sent, and whether anything of it was seen again.
#[derive(Debug, Default)]
pub(super) struct DeliveryEvidence {
    /// By full topic on which the device is commanded, as long as it has shown nothing.
    sent: BTreeMap<String, Commands>,
    /// The topic of the states, and the last one.
    state: Option<String>,
    last: Option<Arc<StateView>>,
    names: Arc<Names>,
    /// On which topics that is, of those on which the running test has sent something.
    of_test: Vec<String>,
}

impl DeliveryEvidence {
    /// Of an AGV under test with these topics by name.
    pub fn of(topics: &BTreeMap<String, String>, pack: &Pack) -> Self {
        let commands = topics.iter().filter(|(name, _)| {
            let topic = pack.topic(name);
            topic.is_some_and(|topic| topic.publisher == Role::MasterControl)
        });
        Self {
            sent: commands
                .map(|(name, full)| {
                    let (name, ids, last) = (name.clone(), VecDeque::new(), None);
                    (full.clone(), Commands { name, ids, last })
                })
                .collect(),
            state: topics.get("state").cloned(),
            last: None,
            names: Arc::clone(pack.names()),
            of_test: Vec::new(),
        }
    }

    /// Sees the next entry.
    pub fn observe(&mut self, entry: &Entry) {
        match entry.event() {
            Event::TestBegun { .. } => self.of_test.clear(),
            Event::Sent { topic, .. } => {
                if let Some(sent) = self.sent.get_mut(topic) {
                    let message = entry.view(Topic::of_name(&sent.name), &self.names);
                    sent.ids.extend(message.map(ids).into_iter().flatten());
                    let old = sent.ids.len().saturating_sub(KEPT);
                    sent.ids.drain(..old);
                    let header = message.map(|message| &message.header().header_id);
                    let header = header.filter(|header| !header.is_absent());
                    sent.last = Some((entry.at().moment, header.map(Member::to_string)));
                    if !self.of_test.contains(topic) {
                        self.of_test.push(topic.clone());
                    }
                }
            }
            Event::Message {
                topic, payload, retain, ..
            } if self.sent.values().any(|sent| sent.last.is_some()) || self.state.as_ref() == Some(topic) => {
                let text = String::from_utf8_lossy(payload.bytes());
                self.sent
                    .retain(|_, sent| !sent.ids.iter().any(|id| text.contains(id.as_str())));
                if self.state.as_ref() == Some(topic) {
                    self.errors_of(entry, *retain);
                }
            }
            _ => {}
        }
    }

    /// Looks for errors that were not there before.
    fn errors_of(&mut self, entry: &Entry, stored: bool) {
        let state = entry.view(Topic::State, &self.names).and_then(MessageView::state);
        let at = entry.at().moment;
        let known = || self.last.iter().flat_map(|state| &state.errors);
        let now = state.into_iter().flat_map(|state| &state.errors);
        for new in now.filter(|error| !stored && !known().any(|old| old.print == error.print)) {
            let is_known = known().any(|old| old.error_type == new.error_type);
            let soon = (!is_known).then_some(at);
            self.sent.retain(|_, sent| !sent.is_answered_by(new, soon, &self.names));
        }
        self.last = state.map(Arc::clone);
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
fn ids(message: &MessageView) -> Vec<String> {
    let order = message.order().and_then(|order| order.order_id.text());
    let actions = message.instant_actions().into_iter().flat_map(|all| &all.actions);
    let all = order
        .into_iter()
        .chain(actions.filter_map(|action| action.action_id.text()));
    // A short one may stand anywhere.
    all.filter(|id| id.len() >= 6).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::clock::Stamp;
    use tck_journal::Journal;
    use tck_journal::event::{Occurrence, Payload, Source};
    use tck_pack::{Assets, Packs};

    /// Whether it is said that nothing shows that the device reads its instant actions, when it has answered so, so many
    /// milliseconds after the first was sent.
    fn is_unheard(before: &str, answer: &str, millis: u64) -> bool {
        let topics = ["instantActions", "order", "state"].map(|name| (name.to_owned(), format!("v2/{name}")));
        let packs = Packs::load(&Assets::of_source_tree().unwrap()).unwrap();
        let mut unheard = DeliveryEvidence::of(&topics.into(), packs.latest());
        let mut journal = Journal::new();
        let mut happens = |millis: u64, event: Event| {
            let at = Stamp {
                moment: Moment::from_micros(millis * 1_000),
                utc: jiff::Timestamp::UNIX_EPOCH,
            };
            unheard.observe(&journal.append(Occurrence {
                at,
                source: Source::Link,
                direction: None,
                event,
            }));
        };
        let payload = |text: &str| Payload::keep(bytes::Bytes::from(text.to_owned()));
        let state = |text: &str| Event::Message {
            topic: "v2/state".to_owned(),
            qos: 0,
            retain: false,
            dup: false,
            payload: payload(text),
        };
        happens(0, state(before));
        happens(
            1_000,
            Event::Sent {
                topic: "v2/instantActions".to_owned(),
                qos: 0,
                retain: false,
                payload: payload(r#"{"headerId":7,"actions":[{"actionId":"run-action-1"}]}"#),
            },
        );
        happens(1_000 + millis, state(answer));
        unheard.why().is_some()
    }

    const NONE: &str = r#"{"errors":[]}"#;
    const BARE: &str = r#"{"errors":[{"errorType":"validationError"}]}"#;

    #[test]
    fn a_new_error_right_after_what_was_sent_shows_that_it_was_read() {
        assert!(!is_unheard(NONE, BARE, 2));
        assert!(is_unheard(NONE, NONE, 2));
        assert!(is_unheard(BARE, BARE, 2), "an old error answers nothing");
        assert!(is_unheard(NONE, BARE, 20_000), "it may be about anything");
    }

    #[test]
    fn an_error_that_names_topic_or_header_shows_it_later_too() {
        let about = |key: &str, value: &str| {
            format!(r#"{{"errors":[{{"errorReferences":[{{"referenceKey":"{key}","referenceValue":"{value}"}}]}}]}}"#)
        };
        assert!(!is_unheard(NONE, &about("topic", "instantActions"), 20_000));
        assert!(!is_unheard(NONE, &about("headerId", "7"), 20_000));
        assert!(is_unheard(NONE, &about("headerId", "8"), 20_000));
        assert!(is_unheard(NONE, &about("topic", "order"), 20_000));
    }
}
