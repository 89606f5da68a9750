//! `topic/names`, `topic/structure`, `topic/own-side`: on which topics the device publishes.
//!
//! QoS and RETAIN are left to `mqtt`.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde_json::Value;

use super::header::serial_character;
use super::traffic::{Traffic, broken, device_publish, quote, remark};
use super::{Check, CheckContext, CheckFinding, Running};
use crate::clock::Moment;
use crate::journal::Entry;
use crate::journal::event::Event;
use crate::pack::Role;

/// How many different topics are remembered; a device that invents more is judged on the first ones.
const TOPICS: usize = 64;

/// `topic/names`.
pub(super) const NAMES: Check = Check {
    name: "topic/names",
    decides: &["TOPIC-01", "TOPIC-02", "TOPIC-03"],
    doc: "The last level of a protocol topic is spelled exactly as defined. Topics whose last level is no variant of \
          a defined name are the vendor's own and not judged, unless what belongs on a defined one is published there \
          and, for thirty seconds, never where it belongs. Where only the levels before the name differ, that is a warning.",
    arguments: &[],
    start: |_| Box::new(Names::default()),
};

/// `topic/structure`.
pub(super) const STRUCTURE: Check = Check {
    name: "topic/structure",
    decides: &["TOPIC-02", "TOPIC-03", "TOPIC-05", "TOPIC-07"],
    doc: "Topics have five levels: interface, major version, manufacturer, serial number, name. The structure is only \
          suggested: anything else is a warning, and so is a level that contradicts the version of its message, except characters that a serial number must not hold.",
    arguments: &[],
    start: |_| Box::new(Structure::default()),
};

/// `topic/own-side`.
pub(super) const OWN_SIDE: Check = Check {
    name: "topic/own-side",
    decides: &["TOPIC-15"],
    doc: "The device publishes only on the topics of its own side. Only the tap knows who published.",
    arguments: &[],
    start: |_| Box::new(OwnSide::default()),
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
    traffic: Traffic,
    seen: Seen,
    /// Names of topics the device has published on as it must.
    proper: BTreeSet<String>,
    /// What looks like a message of ours on a topic of another name: by name, where, entry, time, and how often.
    astray: BTreeMap<&'static str, (String, u64, Moment, u32)>,
}

/// Members that tell a message of a vehicle wherever it is published.
const LOOKS: [(&str, [&str; 2]); 3] = [
    ("state", ["actionStates", "operatingMode"]),
    ("factsheet", ["typeSpecification", "protocolLimits"]),
    ("connection", ["connectionState", "headerId"]),
];
/// So long a device may publish elsewhere before it does on the topic of the name.
const ELSEWHERE: Duration = Duration::from_secs(30);

/// The name of the topic on which such a message belongs.
pub(super) fn looks_like(message: &Value) -> Option<&'static str> {
    let mut looks = LOOKS.into_iter();
    looks
        .find(|(_, members)| members.iter().all(|member| message.get(member).is_some()))
        .map(|(name, _)| name)
}

impl Names {
    /// Notes where the device publishes what.
    fn note(&mut self, topic: &str, entry: &Entry, context: &CheckContext<'_>) {
        if context.role != Role::Agv || topic.len() > 1024 {
            return;
        }
        if let Some(name) = context.topic_name(topic) {
            self.proper.insert(name.to_owned());
            return;
        }
        let Some(name) = entry.json().and_then(looks_like) else {
            return;
        };
        let first = || (topic.to_owned(), entry.seq(), entry.at().moment, 0);
        self.astray.entry(name).or_insert_with(first).3 += 1;
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
    fn finish(&mut self, end: Moment, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        self.astray(end, context, findings);
    }

    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.traffic.note(entry);
        self.astray(entry.at().moment, context, findings);
        let topic = match entry.event() {
            Event::Message {
                topic, retain: false, ..
            } if !self.traffic.tap => topic,
            _ => match device_publish(entry) {
                Some((_, topic, ..)) => topic,
                None => return false,
            },
        };
        self.note(topic, entry, context);
        if context.topic_name(topic).is_some() {
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
            findings.push(broken("TOPIC-01", entry.seq(), text));
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
    traffic: Traffic,
    seen: Seen,
}

impl Running for Structure {
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.traffic.note(entry);
        if let Some((_, topic, ..)) = device_publish(entry) {
            return self.elsewhere(topic, entry, context, findings);
        }
        if self.traffic.delivered(entry, context).is_none() {
            return false;
        }
        let Event::Message { topic, .. } = entry.event() else {
            return false;
        };
        if !self.seen.first(topic) {
            return false;
        }
        let seq = entry.seq();
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
        entry: &Entry,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let levels: Vec<&str> = topic.split('/').collect();
        if context.role == Role::MasterControl {
            return self.command_elsewhere(topic, &levels, entry, context, findings);
        }
        let [_, level, manufacturer, serial, name] = levels[..] else {
            return false;
        };
        let own = (manufacturer, serial) == context.identity && context.topics.contains_key(name);
        let spoken = entry.json().and_then(|value| value.get("version")?.as_str());
        let (Some(major), Some(spoken)) = (level.strip_prefix('v'), spoken.and_then(|text| text.split('.').next()))
        else {
            return false;
        };
        let judged = own && context.topic_name(topic).is_none() && major.bytes().all(|byte| byte.is_ascii_digit());
        if judged && major != spoken && self.seen.first(topic) {
            let text = format!("{} carries messages of version {}", quote(topic), quote(spoken));
            findings.push(remark("TOPIC-03", entry.seq(), text));
        }
        judged
    }

    /// An order or instant action for the vehicle on another topic than its own, which nobody listens to.
    fn command_elsewhere(
        &mut self,
        topic: &str,
        levels: &[&str],
        entry: &Entry,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let name = levels.last().copied().unwrap_or_default().trim_matches('$');
        let commands = context
            .pack
            .topic(name)
            .is_some_and(|rule| rule.publisher == Role::MasterControl);
        let known = context.topic_name(topic).is_some();
        if known || !commands || !names_vehicle(topic, context) || !self.seen.first(topic) {
            return false;
        }
        let (shown, seq) = (quote(topic), entry.seq());
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

#[derive(Default)]
struct OwnSide {
    traffic: Traffic,
}

impl Running for OwnSide {
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.traffic.note(entry);
        let Some((_, topic, ..)) = device_publish(entry) else {
            return false;
        };
        let Some(name) = context.topic_name(topic) else {
            return false;
        };
        if self.traffic.published(entry, context).is_none() {
            let owner = match context.role {
                Role::Agv => "master control",
                Role::MasterControl => "the vehicle",
            };
            let text = format!("the device publishes on {name}, which belongs to {owner}");
            findings.push(broken("TOPIC-15", entry.seq(), text));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;
    use crate::journal::event::{Direction, Event, Packet, Source};

    fn at_tap(topic: &str) -> Trace {
        said_at_tap(topic, "{}")
    }

    fn said_at_tap(topic: &str, text: &str) -> Trace {
        let mut trace = Trace::tap();
        let packet = Packet::Publish {
            topic: topic.to_owned(),
            qos: 0,
            retain: false,
            dup: false,
            packet_id: None,
            payload: crate::journal::Payload::keep(bytes::Bytes::from(text.to_owned())),
        };
        trace.packet(1, Direction::FromDevice, packet);
        trace
    }

    #[test]
    fn defined_names_and_the_vendors_own_topics_are_right() {
        let mut trace = Trace::tap();
        trace.publish(1, "state", 0, false, &json!({}));
        assert!(trace.judge("topic/names").findings.is_empty());
        let own = at_tap("acme/diagnostics").judge("topic/names");
        assert!(own.findings.is_empty() && own.judged == 0);
    }

    #[test]
    fn messages_on_another_topic_are_found_when_they_never_come_on_their_own() {
        let state = json!({ "actionStates": [], "operatingMode": "AUTOMATIC" });
        let mut trace = Trace::tap();
        trace
            .publish(1, "states", 0, false, &state)
            .wait(40.0)
            .publish(1, "states", 0, false, &state);
        assert_eq!(trace.judge("topic/names").summary(), ["TOPIC-01"]);
        assert!(trace.judge("state/period").findings.is_empty(), "states do come");
        trace.publish(1, "state", 0, false, &state);
        let mut copied = Trace::tap();
        copied
            .publish(1, "state", 0, false, &state)
            .publish(1, "states", 0, false, &state)
            .wait(40.0);
        assert!(copied.judge("topic/names").findings.is_empty(), "a copy for others");
        let mut other = Trace::tap();
        let (own, minor) = (other.prefix.clone(), other.prefix.replacen("/v", "/v1.", 1));
        other.prefix = minor;
        let topic = other.topic("state");
        other.prefix = own;
        let payload = crate::journal::Payload::keep(bytes::Bytes::from(state.to_string().into_bytes()));
        let packet = Packet::Publish {
            topic,
            qos: 0,
            retain: false,
            dup: false,
            packet_id: None,
            payload,
        };
        other
            .add(
                Source::Tap,
                Some(Direction::FromDevice),
                Event::Packet { connection: 1, packet },
            )
            .wait(40.0);
        assert_eq!(other.judge("topic/names").summary(), ["TOPIC-03 warning"]);
    }

    #[test]
    fn variants_of_a_name_are_found_once() {
        for name in ["State", "instant_actions", "FactSheet"] {
            assert_eq!(
                at_tap(&format!("x/{name}")).judge("topic/names").summary(),
                ["TOPIC-01"],
                "{name}"
            );
        }
        let mut trace = Trace::subscriber();
        trace
            .message("Connection", &json!({}))
            .message("Connection", &json!({}));
        assert_eq!(trace.judge("topic/names").summary(), ["TOPIC-01"]);
    }

    fn structure(prefix: &str) -> Vec<String> {
        let mut trace = Trace::subscriber();
        prefix.clone_into(&mut trace.prefix);
        trace.state(&json!({})).state(&json!({}));
        trace.judge("topic/structure").summary()
    }

    #[test]
    fn five_levels_with_the_major_version_are_right() {
        let trace = Trace::subscriber();
        assert!(structure(&trace.prefix).is_empty());
    }

    #[test]
    fn other_structures_are_remarked_on_once_per_topic() {
        assert_eq!(structure("site/hall/agv7"), ["TOPIC-02 warning"]);
        assert_eq!(structure("uagv/2/acme/7"), ["TOPIC-03 warning"]);
        assert_eq!(structure("uagv/v2/ac$me/7"), ["TOPIC-07 warning"]);
    }

    #[test]
    fn a_serial_number_of_other_characters_is_found() {
        let mut trace = Trace::subscriber();
        trace.prefix.push_str(" b");
        trace.serial.push_str(" b");
        trace.state(&json!({}));
        assert_eq!(trace.judge("topic/structure").summary(), ["TOPIC-05"]);
    }

    #[test]
    fn a_level_that_contradicts_the_version_of_its_message_is_remarked_on() {
        let said = |topic: &str, version: &str| {
            let text = json!({ "version": version }).to_string();
            said_at_tap(topic, &text).judge("topic/structure").summary()
        };
        assert_eq!(said("uagv/v7/acme/7/visualization", "8.1.0"), ["TOPIC-03 warning"]);
        assert!(
            said("uagv/v7/acme/7/visualization", "7.1.0").is_empty(),
            "two versions side by side"
        );
        assert!(
            said("uagv/v7/acme/7/diagnostics", "8.1.0").is_empty(),
            "a topic of its own"
        );
        assert!(
            said("uagv/v7/acme/9/visualization", "8.1.0").is_empty(),
            "another vehicle"
        );
    }

    #[test]
    fn publishing_on_the_other_sides_topics_is_found() {
        let mut trace = Trace::tap();
        trace
            .publish(1, "state", 0, false, &json!({}))
            .sent("order", &json!({}));
        assert!(trace.judge("topic/own-side").findings.is_empty());
        trace.publish(1, "order", 0, false, &json!({}));
        assert_eq!(trace.judge("topic/own-side").summary(), ["TOPIC-15"]);
    }

    #[test]
    fn what_the_broker_delivers_to_the_device_is_not_published_by_it() {
        let mut trace = Trace::tap();
        let topic = trace.topic("order");
        let packet = Packet::Publish {
            topic,
            qos: 0,
            retain: false,
            dup: false,
            packet_id: None,
            payload: crate::journal::Payload::keep(bytes::Bytes::from_static(b"{}")),
        };
        trace.add(
            Source::Tap,
            Some(Direction::ToDevice),
            Event::Packet { connection: 1, packet },
        );
        let outcome = trace.judge("topic/own-side");
        assert!(outcome.findings.is_empty() && outcome.judged == 0);
    }
}
