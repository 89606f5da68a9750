//! The connection of a master control itself: whether it outlives what its vehicles say, and how it listens.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::finding::{broken, quote, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::{Close, Event, Packet};
use tck_pack::{HookInfo, Role};
use tck_view::ConnectionView;
use tck_world::{End, Listen, Observation, Topic, takes};

/// `commands/alive`.
pub(crate) const ALIVE: Check = Check {
    name: "commands/alive",
    decides: &["TOPIC-14"],
    doc: "A master control stays connected, or comes back: its last connection does not end within a second of a message \
          of a vehicle for good. ShownState by the tap, while nobody plays with the link and no hook has stopped it.",
    arguments: &[],
    listens: &[Listen::Everything],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Alive::default()),
};

/// `commands/listens`.
pub(crate) const LISTENS: Check = Check {
    name: "commands/listens",
    decides: &["TOPIC-14"],
    doc: "The connection topic, which is published with QoS 1, is not subscribed with QoS 0 only: then a last will may be \
          lost. A warning; seen by the tap.",
    arguments: &[],
    listens: &[Listen::Subscribe, Listen::Closed, Listen::Sent(Topic::Connection)],
    reads: &[],
    needs: &[ConnectionView::connection_state],
    start: |_| Box::new(Listens::default()),
};

/// What ends so soon after a message ends because of it.
const AT_ONCE: Duration = Duration::from_secs(1);
/// How many connections are remembered, and how many filters of each.
const KEPT: usize = 256;

/// The connections are gone.
struct Gone {
    at: Moment,
    how: Close,
    /// The message that came before: its entry and its topic.
    after: (u64, String, Moment),
}

#[derive(Default)]
struct Alive {
    open: BTreeSet<u64>,
    last: Option<(u64, String, Moment)>,
    gone: Option<Gone>,
    /// When the harness last played with the link.
    played: Option<Moment>,
}

impl Alive {
    fn report(&mut self, why: &str, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(gone) = self.gone.take() else { return false };
        let how = match gone.how {
            Close::DeviceFin => "was closed by the master control",
            Close::DeviceReset => "was reset by the master control",
            Close::Broker => "was closed by the broker",
            Close::Harness => "was cut",
        };
        let (seq, topic, at) = gone.after;
        let later = gone.at.since(at).as_millis();
        let text = format!("its connection {how} {later} ms after #{seq} on topic {topic}, and {why}");
        findings.push(broken("TOPIC-14", seq, text));
        true
    }

    fn overdue(&self, now: Moment, context: &CheckContext<'_>) -> bool {
        let patience = context.time.reconnect;
        self.gone.as_ref().is_some_and(|gone| now.since(gone.at) >= patience)
    }
}

impl Running for Alive {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.role != Role::MasterControl {
            return false;
        }
        let now = record.at().moment;
        match record.event() {
            Event::Packet {
                connection,
                packet: Packet::Connect { .. },
            } => {
                self.gone = None;
                if self.open.len() < KEPT {
                    self.open.insert(*connection);
                }
            }
            Event::Fault { .. } => {
                self.gone = None;
                self.played = Some(now);
            }
            Event::Hook { hook, .. } if context.hook(hook).is_some_and(HookInfo::may_restart) => self.gone = None,
            Event::Hook {
                ok: false,
                hook,
                detail,
                ..
            } if self.gone.is_some() => {
                let why = format!("its hook {} failed then: {detail}", quote(hook));
                return self.report(&why, findings);
            }
            Event::Closed { connection, how } => {
                let known = self.open.remove(connection);
                let played = self.played.is_some_and(|at| now.since(at) < AT_ONCE * 5);
                let ours = played || record.link.disturbed || *how == Close::Harness;
                let recent = self.last.clone().filter(|(.., at)| now.since(*at) <= AT_ONCE);
                if let Some(after) = recent.filter(|_| known && self.open.is_empty() && !ours) {
                    self.gone = Some(Gone {
                        at: now,
                        how: *how,
                        after,
                    });
                }
            }
            Event::Sent { .. } if self.gone.is_none() => {
                if let Some(name) = record.topic_name() {
                    self.last = Some((record.seq(), name.to_owned(), now));
                }
            }
            _ => {}
        }
        self.overdue(now, context) && self.report("it did not come back", findings)
    }

    fn finish(&mut self, end: &End, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        if self.overdue(end.moment, context) {
            self.report("it did not come back", findings);
        }
    }
}

#[derive(Default)]
struct Listens {
    filters: BTreeMap<u64, Vec<(String, u8)>>,
    told: bool,
}

impl Running for Listens {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        match record.event() {
            Event::Packet {
                connection,
                packet: Packet::Subscribe { filters, .. },
            } if self.filters.len() < KEPT => {
                let known = self.filters.entry(*connection).or_default();
                known.extend(
                    filters
                        .iter()
                        .take(KEPT)
                        .map(|filter| (filter.filter.clone(), filter.qos)),
                );
                known.truncate(KEPT * 16);
            }
            Event::Closed { connection, .. } => {
                self.filters.remove(connection);
            }
            _ => {}
        }
        let Some(said) = record.said_connection().filter(|_| context.role == Role::MasterControl) else {
            return false;
        };
        let Event::Sent { topic, .. } = record.event() else {
            return false;
        };
        let all = self.filters.values().flatten();
        let best = all
            .filter(|(filter, _)| takes(filter, topic))
            .map(|(_, qos)| *qos)
            .max();
        if best == Some(0)
            && !self.told
            && Some(said.connection_state.or_empty()) == context.pack.word("connection.online")
        {
            self.told = true;
            let text = "the connection topic is subscribed with QoS 0, so that a last will may be lost";
            findings.push(remark("TOPIC-14", record.seq(), text));
        }
        best.is_some()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;
    use tck_journal::event::{Direction, Filter, Packet};

    fn listening(qos: &[u8]) -> Vec<String> {
        let mut trace = Trace::master_control_at_tap();
        trace.connect(1, None, 15, 4);
        let topic = trace.topic("connection");
        for qos in qos {
            let filters = vec![Filter {
                filter: topic.clone(),
                qos: *qos,
            }];
            trace.packet(1, Direction::FromDevice, Packet::Subscribe { packet_id: 1, filters });
        }
        trace.sent("connection", &json!({ "connectionState": "ONLINE" }));
        trace.judge("commands/listens").summary()
    }

    #[test]
    fn a_last_will_must_not_get_lost() {
        assert_eq!(listening(&[0]), ["TOPIC-14 warning"]);
        assert_eq!(listening(&[1]), Vec::<String>::new());
        assert_eq!(listening(&[0, 1]), Vec::<String>::new());
    }

    #[test]
    fn a_master_control_that_ends_with_a_state_has_died() {
        let ended = |later: f64, back: bool| {
            let mut trace = Trace::master_control_at_tap();
            trace.connect(1, None, 15, 4);
            trace.shows(&json!({})).wait(later).closed(1);
            if back {
                trace.wait(5.0).connect(2, None, 15, 4);
            }
            trace.wait(100.0).shows(&json!({}));
            trace.judge("commands/alive").summary()
        };
        assert_eq!(ended(0.2, false), ["TOPIC-14"]);
        assert_eq!(ended(0.2, true), Vec::<String>::new());
        assert_eq!(ended(3.0, false), Vec::<String>::new());
    }
}
