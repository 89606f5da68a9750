//! `header/id-rises`: headerId counts every message of a topic.
//!
//! The form of the other header fields is left to `header`.

use std::collections::BTreeMap;

use crate::finding::{broken, remark, show, unclear};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::{Event, Packet, Program};
use tck_pack::{HookEffect, HookInfo, Role};
use tck_view::{Header, Member, Number};
use tck_world::{Listen, Observation, Topic};

/// `headerId` counts every message of a topic.
pub(super) const ID_RISES: Check = Check {
    name: "header/id-rises",
    decides: &["HDR-02"],
    doc: "headerId is a whole number from 0 to 4294967295 that rises by one with each message of a topic. Any start \
          value and a restart of the count after a new connection are accepted, but one after a link that only the \
          harness has broken is a warning, and so is one count for the topics of all vehicles; the last will is exempt. At the tap \
          the PUBLISH packets count; a subscriber cannot tell a gap from a lost message, nor the first number again from a restart \
          that it did not see, which is inconclusive.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Fault,
        Listen::Hook,
        Listen::Answer,
        Listen::Undecodable,
        Listen::Program,
        Listen::AnyDelivered,
        Listen::AnyPublished,
    ],
    reads: &[],
    needs: &[Header::header_id],
    start: |_| Box::new(IdRises::default()),
};

/// At most so many messages of a topic are lost in a cut.
const FEW: u32 = 10_000;

#[derive(Default)]
struct IdRises {
    /// The last id per topic name; there are only a handful of names.
    last: BTreeMap<String, u32>,
    /// The last ids before a link that only the harness has broken.
    before_cut: BTreeMap<String, u32>,
    /// How often in a row the last id of a topic came again.
    repeated: BTreeMap<String, u32>,
    /// Messages on `connection` are seen, so that a restart is.
    hears_connection: bool,
}

impl Running for IdRises {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        match record.event() {
            // A device may count anew after a restart, and nobody can tell a restart from a new connection.
            Event::Packet {
                packet: Packet::Connect { .. },
                ..
            } => self.last.clear(),
            // The process goes on when the harness breaks its link, and so may its count.
            Event::Fault { .. } => self.before_cut.append(&mut self.last),
            // What makes a master control act does not restart it.
            Event::Hook { hook, .. }
                if context.role == Role::MasterControl && !context.hook(hook).is_some_and(HookInfo::may_restart) => {}
            // Its farewell belongs to the count, and at the tap nothing is lost on the way.
            Event::Hook { hook, .. }
                if record.link.tap && context.hook(hook).is_some_and(|hook| hook.has(HookEffect::ShutsDown)) => {}
            // Messages may be lost on the way while the harness plays with the link or somebody with the device, and another
            // process counts anew.
            Event::Program {
                program: Program::Ended { .. },
            }
            | Event::Hook { .. }
            | Event::Answer { .. }
            | Event::Undecodable { .. } => {
                self.last.clear();
                self.before_cut.clear();
            }
            _ => {}
        }
        // The id before this one on the topics of that name, whatever vehicle they are for.
        let shared = context.world.fleet().borrow().before(record.seq());
        let Some(message) = record.published() else {
            return false;
        };
        if record.link.disturbed {
            return false;
        }
        let Some(said) = record.message().filter(|said| said.is_object()) else {
            self.last.remove(message.name);
            return false;
        };
        if !record.link.tap && message.topic == Topic::Connection {
            // Either the will, or the sign of a new connection: the count may begin anew on every topic.
            if said.connection().is_some_and(|said| said.is_broken()) {
                return false;
            }
            self.last.clear();
            self.hears_connection = true;
        }
        let Some(id) = Self::read(&said.header().header_id, message.name, record, findings) else {
            self.last.remove(message.name);
            return true;
        };
        // A count that was near its end goes on with 0.
        let begins_anew = |before: &u32| id < *before && id.wrapping_sub(*before) > FEW;
        if let Some(before) = self.before_cut.remove(message.name).filter(begins_anew) {
            let text = format!(
                "headerId {id} on {} follows {before}: a link that was only broken lets the count begin anew",
                message.name
            );
            findings.push(remark("HDR-02", record.seq(), text));
        }
        let before = self.last.insert(message.name.to_owned(), id);
        let Some(before) = before else {
            self.repeated.remove(message.name);
            return true;
        };
        let expected = before.wrapping_add(1);
        let again = id == before;
        let repeated = self.repeated.entry(message.name.to_owned()).or_default();
        *repeated = if again { *repeated + 1 } else { 0 };
        // A count that begins anew with each start may show its first number twice, but nobody starts three times unseen.
        let stands_still = again && (id > 1 || (*repeated > 1 && self.hears_connection));
        if id == expected || (again && message.dup) {
            return true;
        }
        let text = format!("headerId {id} follows {before} on {}", message.name);
        if shared.is_some_and(|last| last != before && id == last.wrapping_add(1)) {
            let text = format!("{text}: the topics of all vehicles are counted together");
            findings.push(remark("HDR-02", record.seq(), text));
        } else if record.link.tap || stands_still {
            findings.push(broken("HDR-02", record.seq(), text));
        } else if again || id < before {
            findings.push(unclear(
                "HDR-02",
                record.seq(),
                format!("{text}; whether the device was restarted cannot be seen without the tap"),
            ));
        } else {
            findings.push(unclear(
                "HDR-02",
                record.seq(),
                format!("{text}; whether messages were lost cannot be seen without the tap"),
            ));
        }
        true
    }
}

impl IdRises {
    fn read(
        id: &Member<Number>,
        topic: &str,
        record: &Observation<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> Option<u32> {
        // A missing headerId is another requirement's business.
        if id.is_absent() {
            return None;
        }
        if let Some(Number::Whole(id)) = id.number()
            && let Ok(id) = u32::try_from(id)
        {
            return Some(id);
        }
        let whole = id
            .float()
            .filter(|number| number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(number));
        if let Some(whole) = whole {
            let text = format!("headerId {} on {topic} is written as a fraction", show(id));
            findings.push(remark("HDR-02", record.seq(), text));
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
            return Some(whole as u32);
        }
        let text = format!("{topic}/headerId: {} is no whole number from 0 to 4294967295", show(id));
        findings.push(broken("HDR-02", record.seq(), text));
        None
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;
    use tck_journal::Payload;
    use tck_journal::event::{Direction, LinkFault, Packet};

    const CHECK: &str = "header/id-rises";

    #[test]
    fn ids_that_rise_per_topic_and_restart_with_the_connection_are_right() {
        let mut trace = Trace::tap();
        trace.connected(1);
        for id in [4_294_967_295_u32, 0, 1] {
            trace.publish(1, "state", 0, false, &json!({ "headerId": id }));
        }
        trace.publish(
            1,
            "connection",
            1,
            true,
            &json!({ "headerId": 9, "connectionState": "ONLINE" }),
        );
        trace
            .closed(1)
            .connected(2)
            .publish(2, "state", 0, false, &json!({ "headerId": 0 }));
        let outcome = trace.judge(CHECK);
        assert!(outcome.findings.is_empty());
        assert_eq!(outcome.judged, 5);
    }

    #[test]
    fn repeats_jumps_and_other_values_are_found_at_the_tap() {
        let mut trace = Trace::tap();
        trace.connected(1);
        for id in [
            json!(5),
            json!(5),
            json!(7),
            json!(6),
            json!(-1),
            json!("8"),
            json!(1),
            json!(2.0),
        ] {
            trace.publish(1, "state", 0, false, &json!({ "headerId": id }));
        }
        let expected = ["HDR-02", "HDR-02", "HDR-02", "HDR-02", "HDR-02", "HDR-02 warning"];
        assert_eq!(trace.judge(CHECK).summary(), expected);
    }

    #[test]
    fn a_subscriber_cannot_tell_a_gap_from_a_loss_but_sees_a_repeat() {
        let mut trace = Trace::subscriber();
        for id in [5, 6, 9, 9, 3] {
            trace.message("state", &json!({ "headerId": id }));
        }
        assert_eq!(
            trace.judge(CHECK).summary(),
            ["HDR-02 inconclusive", "HDR-02", "HDR-02 inconclusive"]
        );
    }

    #[test]
    fn the_will_is_exempt_and_a_new_connection_restarts_the_count() {
        let mut trace = Trace::subscriber();
        trace.message("state", &json!({ "headerId": 5 })).message(
            "connection",
            &json!({ "headerId": 1, "connectionState": "CONNECTIONBROKEN" }),
        );
        trace
            .message("connection", &json!({ "headerId": 1, "connectionState": "ONLINE" }))
            .message("state", &json!({ "headerId": 1 }));
        assert!(trace.judge(CHECK).findings.is_empty());
    }

    #[test]
    fn a_gap_while_the_harness_disturbs_the_link_is_nobodys_fault() {
        let mut trace = Trace::tap();
        trace
            .connected(1)
            .publish(1, "state", 0, false, &json!({ "headerId": 5 }));
        trace.fault(LinkFault::Silence { direction: None });
        trace.publish(1, "state", 0, false, &json!({ "headerId": 8 }));
        trace.fault(LinkFault::Restore);
        trace.publish(1, "state", 0, false, &json!({ "headerId": 11 }));
        assert!(trace.judge(CHECK).findings.is_empty());
    }

    #[test]
    fn a_count_that_begins_anew_behind_a_cut_is_remarked_unless_the_program_was_started_anew() {
        let judged = |ends: bool| {
            let mut trace = Trace::tap();
            trace
                .connected(1)
                .publish(1, "state", 0, false, &json!({ "headerId": 5 }));
            trace.fault(LinkFault::Silence { direction: None });
            trace.fault(LinkFault::Restore);
            if ends {
                trace.program_ends();
            }
            trace
                .closed(1)
                .connected(2)
                .publish(2, "state", 0, false, &json!({ "headerId": 0 }));
            trace.judge(CHECK).summary()
        };
        assert_eq!(judged(false), ["HDR-02 warning"]);
        assert!(judged(true).is_empty());
    }

    #[test]
    fn a_count_that_stands_still_is_found_by_a_subscriber() {
        let judged = |ids: [u32; 3]| {
            let mut trace = Trace::subscriber();
            trace.connection("ONLINE");
            for id in ids {
                trace.message("state", &json!({ "headerId": id }));
            }
            trace.judge(CHECK).summary()
        };
        // Twice may be a restart that was not seen, three times is none.
        assert_eq!(judged([0, 0, 1]), ["HDR-02 inconclusive"]);
        assert_eq!(judged([0, 0, 0]), ["HDR-02 inconclusive", "HDR-02"]);
        assert_eq!(judged([7, 7, 8]), ["HDR-02"]);
    }

    #[test]
    fn each_topic_has_a_count_of_its_own() {
        let judged = |ids: [u32; 4]| {
            let mut trace = Trace::master_control_at_tap();
            trace.connect(1, None, 15, 4);
            for (at, id) in ids.into_iter().enumerate() {
                let own = trace.topic("order");
                let mut levels: Vec<&str> = own.split('/').collect();
                if at % 2 == 1 {
                    levels[3] = "another";
                }
                let packet = Packet::Publish {
                    topic: levels.join("/"),
                    qos: 0,
                    retain: false,
                    dup: false,
                    packet_id: None,
                    payload: Payload::keep(bytes::Bytes::from(json!({ "headerId": id }).to_string())),
                };
                trace.packet(1, Direction::FromDevice, packet);
            }
            trace.judge(CHECK).summary()
        };
        assert!(judged([0, 0, 1, 1]).is_empty());
        assert_eq!(judged([0, 1, 3, 4]), ["HDR-02"]);
        // Counted over all vehicles: not wrong in itself, but no count of the topic.
        assert_eq!(judged([0, 1, 2, 3]), ["HDR-02 warning"]);
    }
}
