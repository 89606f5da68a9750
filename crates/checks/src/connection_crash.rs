//! `connection/stays`: a vehicle does not fall over what it is sent.
//!
//! What it should have answered is left to the tests. A broken link is nobody's fault; a connection that ends, again
//! and again, right behind a message is no broken link.

use std::time::Duration;

use crate::finding::{broken, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::{Close, Event, Packet};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Topic};

/// A connection that ends within this time of a message ends right behind it.
const BEHIND: Duration = Duration::from_secs(2);
/// What a person or a hook has done may end a connection for so long.
const INFLUENCE: Duration = Duration::from_secs(120);

/// A vehicle does not fall over what it is sent.
pub(super) const STAYS: Check = Check {
    name: "connection/stays",
    decides: &["ORD-REJ-02", "ORD-FLOW-06", "IACT-03"],
    doc: "At the tap: the connection does not end, by the vehicle and without a DISCONNECT, right behind a message that \
          was sent to it and that no state has answered. Once is a warning, since links break; twice is none. It counts for \
          what was owed on the message: the report of a malformed order, the adoption of an order, the state of an \
          instant action. What the harness cuts and what hooks do is left out, and a vehicle whose link also breaks while \
          nothing is sent is not failed.",
    arguments: &[],
    listens: &[
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::Connect,
        Listen::Disconnect,
        Listen::Closed,
        Listen::Sent(Topic::Order),
        Listen::Sent(Topic::InstantActions),
        Listen::Published(Topic::State),
        Listen::Received(Topic::State),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Malformed],
    needs: &[StateView::order_id, StateView::action_states],
    start: |_| Box::new(Stays::default()),
};

#[derive(Default)]
struct Stays {
    /// The message sent last, if no state has come since that answers it.
    sent: Option<Sent>,
    influenced: Option<Moment>,
    announced: bool,
    /// Whether a state was published on a connection, so that it is the vehicle that leaves with it.
    speaks_on: Option<u64>,
    /// Which message each crash followed.
    crashes: Vec<u64>,
    unrelated: bool,
}

struct Sent {
    seq: u64,
    at: Moment,
    what: &'static str,
    requirement: &'static str,
    ids: Vec<String>,
}

impl Stays {
    fn note_sent(&mut self, record: &Observation<'_>, context: &CheckContext<'_>) {
        let is_sent = matches!(record.event(), Event::Sent { .. });
        if !is_sent {
            return;
        }
        let (what, requirement) = if record.is_to_vehicle(Topic::Order) {
            if context.world.malformed().is_malformed(record) {
                ("a malformed order", "ORD-REJ-02")
            } else {
                ("an order", "ORD-FLOW-06")
            }
        } else if record.is_to_vehicle(Topic::InstantActions) {
            ("instantActions", "IACT-03")
        } else {
            return;
        };
        let ids = record
            .order_to_vehicle()
            .map(|order| order.order_id.or_empty().to_owned());
        let actions = record.instant_actions_to_vehicle().into_iter();
        let actions = actions.flat_map(|message| message.actions.iter().take(50));
        let ids = ids
            .into_iter()
            .chain(actions.map(|action| action.action_id.or_empty().to_owned()));
        self.sent = Some(Sent {
            seq: record.seq(),
            at: record.at().moment,
            what,
            requirement,
            ids: ids.collect(),
        });
    }

    fn closed(&mut self, record: &Observation<'_>, findings: &mut Vec<CheckFinding>) {
        let now = record.at().moment;
        let influenced = self.influenced.is_some_and(|at| now.since(at) < INFLUENCE);
        if record.link.disturbed || self.announced || influenced {
            return;
        }
        let behind = self.sent.take().filter(|sent| now.since(sent.at) <= BEHIND);
        let Some(sent) = behind else {
            self.unrelated = true;
            return;
        };
        self.crashes.push(sent.seq);
        let times = self.crashes.len();
        let text = format!(
            "the vehicle closed its connection without DISCONNECT right after it was sent {} (#{}), for the {} time",
            sent.what,
            sent.seq,
            match times {
                1 => "first".to_owned(),
                2 => "second".to_owned(),
                3 => "third".to_owned(),
                times => format!("{times}th"),
            }
        );
        findings.push(if times > 1 && !self.unrelated {
            broken(sent.requirement, record.seq(), text)
        } else {
            remark(sent.requirement, record.seq(), text)
        });
        if times > 64 {
            self.crashes.truncate(2);
        }
    }
}

impl Running for Stays {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if record.outside_influence() || matches!(record.event(), Event::Fault { .. }) {
            self.influenced = Some(record.at().moment);
        }
        self.note_sent(record, context);
        match record.event() {
            Event::Packet {
                packet: Packet::Connect { .. },
                ..
            } => self.announced = false,
            Event::Packet {
                packet: Packet::Disconnect { .. },
                ..
            } => self.announced = true,
            Event::Packet {
                connection,
                packet: Packet::Publish { .. },
            } if record.topic() == Some(Topic::State) => {
                self.speaks_on = Some(*connection);
            }
            Event::Closed {
                connection,
                how: Close::DeviceFin | Close::DeviceReset,
                ..
            } if self.speaks_on == Some(*connection) => {
                self.closed(record, findings);
            }
            _ => {}
        }
        let Some(state) = record.state() else {
            return false;
        };
        let named = |id: &str| {
            let mut actions = state.all_action_states();
            id == state.order_id.or_empty() || actions.any(|action| action.action_id.or_empty() == id)
        };
        let answered = self
            .sent
            .as_ref()
            .is_some_and(|sent| sent.ids.iter().any(|id| named(id)));
        if answered {
            self.sent = None;
        }
        // It was sent something and is still there. What the answer is worth is the business of the tests.
        false
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;

    fn crash(trace: &mut Trace, connection: u64, seconds: f64) {
        trace
            .connected(connection)
            .publish(connection, "state", 0, false, &json!({}))
            .wait(5.0)
            .sent("order", &json!({ "orderId": 7 }))
            .wait(seconds)
            .closed(connection);
    }

    #[test]
    fn a_connection_that_ends_right_behind_a_message_again_and_again_is_found() {
        let mut trace = Trace::tap();
        crash(&mut trace, 1, 0.1);
        assert_eq!(trace.judge("connection/stays").summary(), ["ORD-REJ-02 warning"]);
        crash(&mut trace, 2, 0.1);
        assert_eq!(
            trace.judge("connection/stays").summary(),
            ["ORD-REJ-02 warning", "ORD-REJ-02"]
        );
    }

    #[test]
    fn a_link_that_breaks_at_other_times_and_a_cut_are_nobodys_fault() {
        let mut trace = Trace::tap();
        crash(&mut trace, 1, 30.0);
        assert!(trace.judge("connection/stays").findings.is_empty());
        crash(&mut trace, 2, 0.1);
        crash(&mut trace, 3, 0.1);
        assert_eq!(
            trace.judge("connection/stays").summary(),
            ["ORD-REJ-02 warning", "ORD-REJ-02 warning"]
        );
        let mut trace = Trace::tap();
        for connection in [1, 2] {
            trace.hook();
            crash(&mut trace, connection, 0.1);
        }
        assert!(trace.judge("connection/stays").findings.is_empty());
    }
}
