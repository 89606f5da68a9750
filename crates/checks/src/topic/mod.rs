//! `topic/names`, `topic/structure`, `topic/own-side`: on which topics the device publishes.
//!
//! QoS and RETAIN are left to `mqtt`.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::header::serial_character;
use crate::finding::{broken, quote, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::Event;
use tck_pack::Role;
use tck_view::{ConnectionView, FactsheetView, Field, Header, MessageView, StateView, Topic};
use tck_world::ordered::short;
use tck_world::{End, Listen, Observation};

/// How many different topics are remembered; a device that invents more is judged on the first ones.
const TOPICS: usize = 64;
/// How many order messages are remembered.
const ORDERS: usize = 1024;

/// `topic/names`.
pub(super) const NAMES: Check = Check {
    name: "topic/names",
    decides: &["TOPIC-01", "TOPIC-02", "TOPIC-03"],
    doc: "The last level of a protocol topic is spelled exactly as defined. Topics whose last level is no variant of \
          a defined name are the vendor's own and not judged, unless what belongs on a defined one is published there \
          and, for thirty seconds, never where it belongs. An order of a master control belongs on its topic by its \
          orderId and orderUpdateId, an instant action by its actionId. Where only the levels before the name differ, that is a warning.",
    arguments: &[],
    listens: &[Listen::Everything],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Names::default()),
};

/// `topic/structure`.
pub(super) const STRUCTURE: Check = Check {
    name: "topic/structure",
    decides: &["TOPIC-02", "TOPIC-03", "TOPIC-05", "TOPIC-07"],
    doc: "Topics have five levels: interface, major version, manufacturer, serial number, name. The structure is only \
          suggested: anything else is a warning, and so is a level that contradicts the version of its message, except characters that a serial number must not hold.",
    arguments: &[],
    listens: &[Listen::AnyDelivered, Listen::AnyPublished, Listen::Elsewhere],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Structure::default()),
};

/// `topic/own-side`.
pub(super) const OWN_SIDE: Check = Check {
    name: "topic/own-side",
    decides: &["TOPIC-15"],
    doc: "The device publishes only on the topics of its own side, and has no last will on one of the other side. Only the \
          tap knows who published.",
    arguments: &[],
    listens: &[Listen::Connect, Listen::AnyPublished],
    reads: &[],
    needs: &[],
    start: |_| Box::new(OwnSide),
};

/// Topics seen before, bounded.
#[derive(Default)]
struct Seen(BTreeSet<String>);

impl Seen {
    /// Whether the topic is new and worth a look.
    fn first(&mut self, topic: &str) -> bool {
        self.0.len() < TOPICS && topic.len() <= 1024 && self.0.insert(topic.to_owned())
    }
}

#[derive(Default)]
struct Names {
    seen: Seen,
    /// Names of topics the device has published on as it must.
    proper: BTreeSet<String>,
    /// What looks like a message of ours on a topic of another name: by name, where, entry, time, and how often.
    astray: BTreeMap<&'static str, (String, u64, Moment, u32)>,
    /// What a master control has published where it belongs.
    orders: BTreeSet<Sent>,
    /// What it has published elsewhere below the levels of the vehicle only: where, entry, time.
    strays: BTreeMap<Sent, (String, u64, Moment)>,
}

/// What tells a message of a master control wherever it is published.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Sent {
    /// orderId and orderUpdateId.
    Order(String, u64),
    /// The actionId of its first instant action.
    Instant(String),
}

impl Sent {
    fn read(record: &Observation<'_>) -> Option<Self> {
        let order = record.message_as(Topic::Order).and_then(MessageView::order)?;
        if order.nodes.is_there() {
            return Some(Self::Order(short(&order.order_id)?, order.order_update_id.whole()?));
        }
        let message = record.message_as(Topic::InstantActions)?.instant_actions()?;
        let action = message.actions.elements().first()?;
        let is_told = action.action_type.is_there() && !message.header.header_id.is_absent();
        Some(Self::Instant(short(&action.action_id)?)).filter(|_| is_told)
    }

    /// The topic where it belongs.
    fn topic(&self) -> &'static str {
        match self {
            Self::Order(..) => Topic::Order.as_str(),
            Self::Instant(_) => Topic::InstantActions.as_str(),
        }
    }
}

/// Members that tell a message of a vehicle wherever it is published.
const LOOKS: [(Topic, [Field; 2]); 3] = [
    (Topic::State, [StateView::action_states, StateView::operating_mode]),
    (
        Topic::Factsheet,
        [FactsheetView::type_specification, FactsheetView::protocol_limits],
    ),
    (Topic::Connection, [ConnectionView::connection_state, Header::header_id]),
];
/// How long a device may publish elsewhere before it does on the topic of the name.
const ELSEWHERE: Duration = Duration::from_secs(30);

/// The topic on which such a message belongs.
pub(super) fn looks_like(record: &Observation<'_>) -> Option<Topic> {
    let (message, names) = (record.json()?, record.names());
    let has = |member: Field| names.raw(message, &[member]).is_some();
    let mut looks = LOOKS.into_iter();
    looks
        .find(|(_, members)| members.iter().all(|member| has(*member)))
        .map(|(topic, _)| topic)
}

/// A topic whose last level is spelled almost as that of the visualization, which has no members of its own to be told by.
fn almost(topic: &str) -> Option<&'static str> {
    const NAME: &str = "visualization";
    let last = plain(topic.rsplit('/').next().unwrap_or_default());
    let same = |pairs: &mut dyn Iterator<Item = (char, char)>| pairs.take_while(|(one, other)| one == other).count();
    let front = same(&mut last.chars().zip(NAME.chars()));
    let back = same(&mut last.chars().rev().zip(NAME.chars().rev()));
    (last != NAME && last.len().abs_diff(NAME.len()) <= 2 && front + back + 2 >= NAME.len()).then_some(NAME)
}

impl Names {
    /// Notes where the device publishes what.
    fn note(&mut self, topic: &str, record: &Observation<'_>, context: &CheckContext<'_>) {
        if topic.len() > 1024 {
            return;
        }
        if context.role == Role::MasterControl {
            self.note_order(topic, record, context);
            return;
        }
        if let Some(name) = record.topic_name() {
            self.proper.insert(name.to_owned());
            return;
        }
        let Some(name) = looks_like(record).map(Topic::as_str).or_else(|| almost(topic)) else {
            return;
        };
        let first = || (topic.to_owned(), record.seq(), record.at().moment, 0);
        self.astray.entry(name).or_insert_with(first).3 += 1;
    }

    /// Notes where a master control publishes its orders and instant actions.
    fn note_order(&mut self, topic: &str, record: &Observation<'_>, context: &CheckContext<'_>) {
        let Some(key) = Sent::read(record) else {
            return;
        };
        let belongs = key.topic();
        if record.topic_name() == Some(belongs) {
            self.strays.remove(&key);
            if self.orders.len() == ORDERS {
                self.orders.pop_first();
            }
            self.orders.insert(key);
            return;
        }
        let above = |topic: &str| topic.rsplit_once('/').map(|(above, _)| above.to_owned());
        let beside = context
            .topics
            .get(belongs)
            .is_some_and(|usual| above(usual) == above(topic));
        if beside && record.topic().is_none() && !self.orders.contains(&key) && self.strays.len() < ORDERS {
            let place = (topic.to_owned(), record.seq(), record.at().moment);
            self.strays.entry(key).or_insert(place);
        }
    }

    /// What came on a topic beside its own, and on its own never.
    fn strayed(&mut self, now: Moment, patience: Duration, findings: &mut Vec<CheckFinding>) {
        let due = |since: &Moment| now.since(*since) >= patience;
        let late: Vec<_> = self.strays.iter().filter(|(_, (.., since))| due(since)).collect();
        let late: Vec<_> = late.into_iter().map(|(key, _)| key.clone()).collect();
        for key in late {
            let Some((topic, seq, _)) = self.strays.remove(&key) else {
                continue;
            };
            if self.seen.first(&topic) {
                let what = match &key {
                    Sent::Order(id, update) => format!("order {}, orderUpdateId {update},", quote(id)),
                    Sent::Instant(id) => format!("the instant action {}", quote(id)),
                };
                let (topic, belongs) = (quote(&topic), key.topic());
                let text = format!("{what} is published on {topic}, which is no topic name, and not as {belongs}");
                findings.push(broken("TOPIC-01", seq, text));
            }
        }
    }

    /// Messages that come on another topic, and never on their own.
    fn astray(&mut self, now: Moment, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        let due: Vec<&'static str> = self
            .astray
            .iter()
            .filter(|(name, (_, _, since, _))| !self.proper.contains(**name) && now.since(*since) > ELSEWHERE)
            .map(|(name, _)| *name)
            .collect();
        for name in due {
            let Some((topic, seq, _, times)) = self.astray.remove(name) else {
                continue;
            };
            let Some(usual) = context
                .topics
                .get(name)
                .filter(|_| times > 0 && self.seen.first(&topic))
            else {
                continue;
            };
            let text = format!("{name} is published on {} and never on {}", quote(&topic), quote(usual));
            let level = |of: &str, at: usize| of.split('/').nth(at).map(str::to_owned);
            findings.push(if topic.rsplit('/').next() != Some(name) {
                broken("TOPIC-01", seq, text)
            } else if level(&topic, 1) != level(usual, 1) {
                remark("TOPIC-03", seq, text)
            } else {
                remark("TOPIC-02", seq, text)
            });
        }
    }
}

impl Running for Names {
    fn finish(&mut self, end: &End, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        self.astray(end.moment, context, findings);
        // What came at the very last may still be on its way to the other topic.
        self.strayed(end.moment, Duration::from_secs(2), findings);
    }

    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.astray(record.at().moment, context, findings);
        self.strayed(record.at().moment, ELSEWHERE, findings);
        let topic = match record.event() {
            Event::Message {
                topic, retain: false, ..
            } if !record.link.tap => topic,
            _ => match record.device_publish() {
                Some(publish) => publish.topic,
                None => return false,
            },
        };
        self.note(topic, record, context);
        if record.topic().is_some() {
            return true;
        }
        let last = topic.rsplit('/').next().unwrap_or_default();
        let Some(name) = context.topics.keys().find(|name| plain(name) == plain(last)) else {
            return false;
        };
        // A master control has topics of its own for other things than vehicles.
        if context.role == Role::MasterControl && !names_vehicle(topic, context) {
            return false;
        }
        if last != name && self.seen.first(topic) {
            let text = format!("the last level of {} is no topic name; meant is {name:?}", quote(topic));
            findings.push(broken("TOPIC-01", record.seq(), text));
        }
        last != name
    }
}

/// Whether a topic is about the vehicle, or about one of the same manufacturer.
fn names_vehicle(topic: &str, context: &CheckContext<'_>) -> bool {
    let (manufacturer, serial) = context.identity;
    topic.split('/').any(|level| {
        let level = level.trim_matches('$');
        level == manufacturer || level == serial
    })
}

/// A name without what people vary: case, underscores, hyphens.
fn plain(name: &str) -> String {
    name.chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|character| character.to_ascii_lowercase())
        .collect()
}

#[derive(Default)]
struct Structure {
    seen: Seen,
}

impl Running for Structure {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if let Some(publish) = record.device_publish() {
            return self.elsewhere(publish.topic, record, context, findings);
        }
        if record.delivered().is_none() {
            return false;
        }
        let Event::Message { topic, .. } = record.event() else {
            return false;
        };
        if !self.seen.first(topic) {
            return false;
        }
        let seq = record.seq();
        if topic.contains('$') {
            findings.push(remark("TOPIC-07", seq, format!("{} holds a dollar sign", quote(topic))));
        }
        let levels: Vec<&str> = topic.split('/').collect();
        let [_, version, _, serial, _] = levels[..] else {
            let text = format!("{} has {} levels instead of five", quote(topic), levels.len());
            findings.push(remark("TOPIC-02", seq, text));
            return true;
        };
        let expected = format!("v{}", context.pack.version.major);
        if version != expected {
            let text = format!("the second level of {} is not {expected:?}", quote(topic));
            findings.push(remark("TOPIC-03", seq, text));
        }
        if serial == context.identity.1 && !serial.bytes().all(serial_character) {
            let text = format!(
                "the serial number in {} holds characters that are not allowed",
                quote(topic)
            );
            findings.push(broken("TOPIC-05", seq, text));
        }
        true
    }
}

impl Structure {
    /// A topic of the device that is not the configured one, but names the device: below a major version that the
    /// message itself does not speak. A device may well speak two versions side by side.
    fn elsewhere(
        &mut self,
        topic: &str,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let levels: Vec<&str> = topic.split('/').collect();
        if context.role == Role::MasterControl {
            return self.command_elsewhere(topic, &levels, record, context, findings);
        }
        let [_, level, manufacturer, serial, name] = levels[..] else {
            return false;
        };
        let own = (manufacturer, serial) == context.identity && context.topics.contains_key(name);
        let spoken = record.header().and_then(|header| header.version.text());
        let (Some(major), Some(spoken)) = (level.strip_prefix('v'), spoken.and_then(|text| text.split('.').next()))
        else {
            return false;
        };
        let judged = own && record.topic().is_none() && major.bytes().all(|byte| byte.is_ascii_digit());
        if judged && major != spoken && self.seen.first(topic) {
            let text = format!("{} carries messages of version {}", quote(topic), quote(spoken));
            findings.push(remark("TOPIC-03", record.seq(), text));
        }
        judged
    }

    /// An order or instant action for the vehicle on another topic than its own, which nobody listens to.
    fn command_elsewhere(
        &mut self,
        topic: &str,
        levels: &[&str],
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let name = levels.last().copied().unwrap_or_default().trim_matches('$');
        let commands = context
            .pack
            .topic(name)
            .is_some_and(|rule| rule.publisher == Role::MasterControl);
        let known = record.topic().is_some();
        if known || !commands || !names_vehicle(topic, context) || !self.seen.first(topic) {
            return false;
        }
        let (shown, seq) = (quote(topic), record.seq());
        if topic.contains('$') {
            findings.push(remark("TOPIC-07", seq, format!("{shown} holds a dollar sign")));
        }
        let usual = context
            .topics
            .get(name)
            .map(|usual| usual.split('/').collect::<Vec<_>>());
        let Some(usual) = usual.filter(|usual| usual.len() == 5) else {
            return true;
        };
        if levels.len() != usual.len() {
            let text = format!("{shown} has {} levels instead of five", levels.len());
            findings.push(remark("TOPIC-02", seq, text));
        } else if levels[1] != usual[1] && levels[2..4] == usual[2..4] {
            let text = format!("the second level of {shown} is not {:?}", usual[1]);
            findings.push(remark("TOPIC-03", seq, text));
        }
        true
    }
}

struct OwnSide;

impl Running for OwnSide {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let owner = match context.role {
            Role::Agv => "master control",
            Role::MasterControl => "the vehicle",
        };
        if let Some(name) = record.will_topic_name() {
            let rule = context.pack.topic(name);
            if rule.is_some_and(|rule| rule.publisher != context.role) {
                let text = format!("the device has a last will on {name}, which belongs to {owner}");
                findings.push(broken("TOPIC-15", record.seq(), text));
            }
            return true;
        }
        let Some(name) = record.device_publish().and(record.topic_name()) else {
            return false;
        };
        if record.published().is_none() {
            let text = format!("the device publishes on {name}, which belongs to {owner}");
            findings.push(broken("TOPIC-15", record.seq(), text));
        }
        true
    }
}

#[cfg(test)]
mod tests;
