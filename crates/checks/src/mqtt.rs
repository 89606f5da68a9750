//! `mqtt/quality`, `mqtt/connect`: QoS, RETAIN, and how the device opens its connection.
//!
//! What the messages say is left to the other checks.

use std::collections::VecDeque;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::Parsed;
use tck_journal::event::{Event, Packet, Will};
use tck_pack::Role;
use tck_view::{ConnectionView, Field, Header, MessageView, Presence};
use tck_world::{End, Listen, Observation, Topic};

/// How many open connections of a device are kept in mind.
const CONNECTIONS: usize = 32;

/// `mqtt/quality`.
pub(super) const QUALITY: Check = Check {
    name: "mqtt/quality",
    decides: &["MQTT-06", "MQTT-07", "MQTT-08", "CONN-06", "FACT-01"],
    doc: "order, instantActions, zoneSet, responses, state, visualization and factsheet are published with QoS 0 (higher is \
          harmless, a warning), connection with QoS 1 (2 is a warning); connection and factsheet with RETAIN, which only the \
          tap can see here, what a master control sends without it (with it is a warning).",
    arguments: &[],
    listens: &[Listen::AnyDelivered, Listen::AnyPublished],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Quality),
};

/// `mqtt/connect`.
pub(super) const CONNECT: Check = Check {
    name: "mqtt/connect",
    decides: &["MQTT-01", "CONN-01", "CONN-02", "CONN-03", "CONN-04"],
    doc: "The connection on which the device publishes uses MQTT 3.1.1 or newer, registers a retained last will with \
          QoS 1 on the connection topic that says the connection is broken, and keeps alive about every 15 s. Other \
          connections of the device are not held to this. Of a master control only the version of MQTT is judged, on every \
          connection.",
    arguments: &[],
    listens: &[Listen::Connect, Listen::AnyPublished],
    reads: &[],
    needs: &[ConnectionView::connection_state],
    start: |_| Box::new(Connect::default()),
};

/// What the header of the last will has to have.
const HEADER: [Field; 5] = [
    Header::header_id,
    Header::timestamp,
    Header::version,
    Header::manufacturer,
    Header::serial_number,
];

struct Quality;

impl Running for Quality {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(message) = record.published() else {
            return false;
        };
        let seq = record.seq();
        let (name, qos) = (message.name, message.qos);
        let text = format!("{name} is published with QoS {qos}");
        match (name, qos) {
            ("order" | "instantActions" | "zoneSet" | "responses", 1..) => findings.push(remark("MQTT-06", seq, text)),
            ("state" | "visualization" | "factsheet", 1..) => findings.push(remark("MQTT-07", seq, text)),
            // To a subscriber the will looks like any message; its QoS is judged in the CONNECT packet.
            ("connection", 0)
                if record.link.tap || record.connection_message().is_none_or(|message| !message.is_broken()) =>
            {
                findings.push(broken("MQTT-08", seq, text));
            }
            ("connection", 2..) => findings.push(remark("MQTT-08", seq, text)),
            _ => {}
        }
        if message.retain == Some(true) && matches!(name, "order" | "instantActions" | "zoneSet" | "responses") {
            let text = format!("{name} is published with RETAIN: whoever subscribes later gets it, too");
            findings.push(remark("MQTT-06", seq, text));
        }
        if message.retain == Some(false) {
            let id = match name {
                "connection" => Some("CONN-06"),
                "factsheet" => Some("FACT-01"),
                _ => None,
            };
            findings.extend(id.map(|id| broken(id, seq, format!("{name} is published without RETAIN"))));
        }
        true
    }
}

#[derive(Default)]
struct Connect {
    open: VecDeque<Opened>,
    /// Whether any connection ever published on the connection topic.
    announced: bool,
}

struct Opened {
    connection: u64,
    seq: u64,
    level: u8,
    keep_alive: u16,
    will: Option<Will>,
    /// The name of the topic on which the will is.
    will_topic: Option<String>,
    /// Whether it published something else of the protocol.
    publishes: bool,
}

impl Running for Connect {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if let Event::Packet {
            connection,
            packet:
                Packet::Connect {
                    level,
                    keep_alive,
                    will,
                    ..
                },
        } = record.event()
        {
            if context.role == Role::MasterControl {
                findings.extend(too_old(*level, record.seq()));
                return true;
            }
            if self.open.len() == CONNECTIONS {
                self.open.pop_front();
            }
            self.open.push_back(Opened {
                connection: *connection,
                seq: record.seq(),
                level: *level,
                keep_alive: *keep_alive,
                will: will.clone(),
                will_topic: record.will_topic_name().map(str::to_owned),
                publishes: false,
            });
            return false;
        }
        let Some(message) = record.published() else {
            return false;
        };
        let Some(publish) = record.device_publish() else {
            return false;
        };
        let Some(at) = self
            .open
            .iter()
            .position(|opened| opened.connection == publish.connection)
        else {
            return false;
        };
        if message.topic != Topic::Connection {
            if let Some(opened) = self.open.get_mut(at) {
                opened.publishes = true;
            }
            return false;
        }
        self.announced = true;
        let Some(opened) = self.open.remove(at) else {
            return false;
        };
        opened.judge(context, findings);
        true
    }

    fn finish(&mut self, _: &End, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        // A device that never announces itself is judged on what it publishes states with.
        if !self.announced {
            for opened in self.open.iter().filter(|opened| opened.publishes) {
                opened.judge(context, findings);
            }
        }
    }
}

fn too_old(level: u8, seq: u64) -> Option<CheckFinding> {
    let text = format!("protocol level {level} is older than MQTT 3.1.1");
    (level < 4).then(|| broken("MQTT-01", seq, text))
}

impl Opened {
    fn judge(&self, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        let seq = self.seq;
        findings.extend(too_old(self.level, seq));
        if !(10..=20).contains(&self.keep_alive) {
            let text = match self.keep_alive {
                0 => "keep-alive is switched off: a silent loss of the device goes unnoticed".to_owned(),
                seconds => format!("keep-alive is {seconds} s instead of about 15 s"),
            };
            findings.push(remark("CONN-04", seq, text));
        }
        let Some(will) = &self.will else {
            findings.push(broken("CONN-01", seq, "the connection has no last will"));
            return;
        };
        if self.will_topic.as_deref() != Some(Topic::Connection.as_str()) {
            let text = format!(
                "the last will is on {}, not on the connection topic",
                quote(&will.topic)
            );
            findings.push(broken("CONN-01", seq, text));
        }
        if !(will.retain && will.qos == 1) {
            let text = format!("the last will has QoS {} and RETAIN {}", will.qos, will.retain);
            findings.push(broken("CONN-03", seq, text));
        }
        let (parsed, names) = (Parsed::of(&will.payload), context.pack.names());
        let message = parsed
            .value()
            .map(|value| MessageView::of_value(Topic::Connection, value, names));
        let message = message.filter(MessageView::is_object);
        let Some(said) = message.as_ref().and_then(MessageView::connection) else {
            findings.push(broken("CONN-02", seq, "the last will is no connection message"));
            return;
        };
        if !said.is_broken() {
            let state = quote(said.connection_state.or_empty());
            findings.push(broken("CONN-02", seq, format!("the last will says {state}")));
        }
        let lacks = |field: &Field| said.header.presence(*field) == Presence::Absent;
        let missing: Vec<&str> = HEADER
            .into_iter()
            .filter(lacks)
            .filter_map(|field| names.name(field))
            .collect();
        if !missing.is_empty() {
            let text = format!("the last will lacks {}", missing.join(", "));
            findings.push(broken("CONN-02", seq, text));
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;

    #[test]
    fn the_usual_qualities_are_right() {
        let mut trace = Trace::tap();
        trace
            .publish(1, "state", 0, false, &json!({}))
            .publish(1, "connection", 1, true, &json!({}))
            .publish(1, "factsheet", 0, true, &json!({}));
        let outcome = trace.judge("mqtt/quality");
        assert!(outcome.findings.is_empty() && outcome.judged == 3);
    }

    #[test]
    fn wrong_qos_and_retain_are_found() {
        let mut trace = Trace::tap();
        trace
            .publish(1, "state", 1, false, &json!({}))
            .publish(1, "connection", 0, true, &json!({}))
            .publish(1, "connection", 2, false, &json!({}))
            .publish(1, "factsheet", 0, false, &json!({}));
        assert_eq!(
            trace.judge("mqtt/quality").summary(),
            ["MQTT-07 warning", "MQTT-08", "MQTT-08 warning", "CONN-06", "FACT-01"]
        );
    }

    #[test]
    fn a_subscriber_judges_qos_but_not_retain() {
        let mut trace = Trace::subscriber();
        trace.connection("ONLINE").state(&json!({}));
        assert!(trace.judge("mqtt/quality").findings.is_empty());
    }

    fn connect(change: impl Fn(&mut tck_journal::event::Will), keep_alive: u16, level: u8) -> Vec<String> {
        let mut trace = Trace::tap();
        let mut will = trace.will();
        change(&mut will);
        trace.connect(1, Some(will), keep_alive, level);
        trace.publish(1, "connection", 1, true, &json!({ "connectionState": "ONLINE" }));
        trace.judge("mqtt/connect").summary()
    }

    #[test]
    fn a_retained_will_and_fifteen_seconds_are_right() {
        assert!(connect(|_| {}, 15, 4).is_empty());
        assert!(connect(|_| {}, 10, 5).is_empty());
    }

    #[test]
    fn every_departure_of_the_will_is_found() {
        assert_eq!(connect(|will| will.topic.push('x'), 15, 4), ["CONN-01"]);
        assert_eq!(connect(|will| will.retain = false, 15, 4), ["CONN-03"]);
        assert_eq!(connect(|will| will.qos = 0, 15, 4), ["CONN-03"]);
        let payload = |text: &'static str| tck_journal::Payload::keep(bytes::Bytes::from_static(text.as_bytes()));
        assert_eq!(connect(|will| will.payload = payload("gone"), 15, 4), ["CONN-02"]);
        assert_eq!(
            connect(|will| will.payload = payload(r#"{"connectionState":"OFFLINE"}"#), 15, 4),
            ["CONN-02", "CONN-02"]
        );
        assert_eq!(connect(|_| {}, 0, 4), ["CONN-04 warning"]);
        assert_eq!(connect(|_| {}, 60, 4), ["CONN-04 warning"]);
        assert_eq!(connect(|_| {}, 15, 3), ["MQTT-01"]);
    }

    #[test]
    fn a_second_connection_for_other_things_is_not_judged() {
        let mut trace = Trace::tap();
        trace.connected(1).publish(1, "connection", 1, true, &json!({}));
        trace
            .connect(2, None, 0, 4)
            .publish(2, "visualization", 0, false, &json!({}))
            .connect(3, None, 0, 4);
        assert!(trace.judge("mqtt/connect").findings.is_empty());
    }

    #[test]
    fn a_device_that_never_announces_itself_is_judged_on_its_states() {
        let mut trace = Trace::tap();
        trace.connect(1, None, 15, 4).publish(1, "state", 0, false, &json!({}));
        assert_eq!(trace.judge("mqtt/connect").summary(), ["CONN-01"]);
    }
}
