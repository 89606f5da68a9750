//! `topic/heard`: what is sent to the vehicle gets to it.
//!
//! What the vehicle makes of it is left to the tests: an order that is refused has arrived, and so has a message
//! whose members the vehicle cannot read.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::finding::broken;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::{Direction, Event, Packet};
use tck_view::{Member, OrderView, StateView, Text};
use tck_world::{End, Listen, Observation, Seen, takes};

/// The topics a vehicle has to listen to.
const TOPICS: [&str; 2] = ["order", "instantActions"];
/// How long a message may take from the harness through the broker to the tap.
const DELIVERY: Duration = Duration::from_secs(5);
/// How many identifiers of each topic, and how many connections are kept in mind.
const KEPT: usize = 64;

/// `topic/heard`.
pub(super) const HEARD: Check = Check {
    name: "topic/heard",
    decides: &["TOPIC-10"],
    doc: "The vehicle subscribes to order and instantActions. At the tap its SUBSCRIBE packets and what is delivered to \
          it show that; a message that is delivered on no connection, without any subscription that covers its topic, \
          was not listened to. Without the tap only a reaction shows something: an order or an action that a state \
          names.",
    arguments: &[],
    listens: &[Listen::Everything],
    reads: &[],
    needs: &[OrderView::order_id, StateView::order_id, StateView::action_states],
    start: |_| Box::new(Heard::default()),
};

#[derive(Default)]
struct Heard {
    /// Since when each connection is open, and the topics it subscribed to.
    open: BTreeMap<u64, (Moment, BTreeSet<&'static str>)>,
    /// Topics on which something has arrived, or is sure to.
    arrived: BTreeSet<&'static str>,
    /// What was sent and has not been delivered yet: topic, entry and time.
    pending: BTreeMap<&'static str, (u64, Moment)>,
    /// Identifiers that were sent, by topic.
    sent: Vec<(&'static str, String)>,
    accused: BTreeSet<&'static str>,
}

impl Heard {
    fn packet(&mut self, record: &Observation<'_>, context: &CheckContext<'_>) {
        let down = record.entry.record.direction == Some(Direction::ToDevice);
        let Event::Packet { connection, packet } = record.event() else {
            return;
        };
        match packet {
            Packet::Connack { code: 0, .. } => {
                if self.open.len() == KEPT {
                    self.open.pop_first();
                }
                self.open
                    .entry(*connection)
                    .or_insert((record.at().moment, BTreeSet::new()));
                self.pending.clear();
            }
            Packet::Disconnect { .. } if !down => {
                self.open.remove(connection);
                self.pending.clear();
            }
            Packet::Subscribe { filters, .. } => {
                for name in TOPICS {
                    let Some(topic) = context.topics.get(name) else {
                        continue;
                    };
                    if filters.iter().any(|filter| takes(&filter.filter, topic)) {
                        let opened = (record.at().moment, BTreeSet::new());
                        self.open.entry(*connection).or_insert(opened).1.insert(name);
                        self.arrived.insert(name);
                        self.pending.remove(name);
                    }
                }
            }
            Packet::Publish { .. } if down => {
                if let Some(name) = TOPICS.into_iter().find(|name| record.topic_name() == Some(*name)) {
                    self.arrived.insert(name);
                    self.pending.remove(name);
                }
            }
            _ => {}
        }
    }

    /// Notes what the harness sends while the vehicle is there and has had the time to subscribe.
    fn sent(&mut self, record: &Observation<'_>, context: &CheckContext<'_>) {
        let mut keep = |name: &'static str, id: &Member<Text>| {
            let whole = id
                .there()
                .filter(|id| !id.is_empty() && !id.is_cut() && id.len() <= 512);
            self.sent.extend(whole.map(|id| (name, id.as_str().to_owned())));
        };
        let [orders, instant] = TOPICS;
        if let Some(order) = record.order_to_vehicle() {
            keep(orders, &order.order_id);
        }
        if let Some(message) = record.instant_actions_to_vehicle() {
            let actions = message.all_actions().take(KEPT);
            actions.for_each(|action| keep(instant, &action.action_id));
        }
        let excess = self.sent.len().saturating_sub(2 * KEPT);
        self.sent.drain(..excess);
        if record.seen != Some(Seen::Sent) {
            return;
        }
        let Some(name) = TOPICS.into_iter().find(|name| record.topic_name() == Some(*name)) else {
            return;
        };
        let now = record.at().moment;
        let settled = context.time.settle;
        let there = self.open.values().any(|(since, _)| now.since(*since) >= settled);
        let subscribed = self.open.values().any(|(_, topics)| topics.contains(name));
        if record.link.tap && !record.link.disturbed && there && !subscribed {
            self.pending.entry(name).or_insert((record.seq(), now));
        }
    }

    fn overdue(&mut self, now: Moment, findings: &mut Vec<CheckFinding>) {
        let lost = self
            .pending
            .iter()
            .filter(|(_, (_, since))| now.since(*since) > DELIVERY);
        let lost: Vec<(&'static str, u64)> = lost.map(|(name, (seq, _))| (*name, *seq)).collect();
        for (name, seq) in lost {
            self.pending.remove(name);
            if self.accused.insert(name) {
                let text = format!("{name} reaches the vehicle on no connection: it has not subscribed to the topic");
                findings.push(broken("TOPIC-10", seq, text));
            }
        }
    }

    /// Without the tap: whether a state names what was sent.
    fn reaction(&mut self, state: &StateView) {
        let order = state.order_id.or_empty();
        let listed: BTreeSet<&str> = state
            .all_action_states()
            .take(512)
            .map(|action| action.action_id.or_empty())
            .collect();
        let [orders, instant] = TOPICS;
        for (name, id) in &self.sent {
            if (*name == orders && id == order) || (*name == instant && listed.contains(id.as_str())) {
                self.arrived.insert(name);
            }
        }
    }
}

impl Running for Heard {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let before = self.arrived.len();
        match record.event() {
            Event::Closed { connection, .. } => {
                self.open.remove(connection);
                self.pending.clear();
            }
            // What the harness drops on the way, or a hook interrupts, the vehicle cannot hear.
            Event::Fault { .. } | Event::Hook { .. } => self.pending.clear(),
            _ => {}
        }
        self.packet(record, context);
        self.sent(record, context);
        self.overdue(record.at().moment, findings);
        if !record.link.tap
            && let Some(state) = record.state()
        {
            self.reaction(state);
        }
        // Both, or nothing is shown: the one without the other is half of it.
        self.arrived.len() > before && self.arrived.len() == TOPICS.len()
    }

    fn finish(&mut self, end: &End, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        self.overdue(end.moment, findings);
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;
    use tck_journal::event::{Direction, Event, Filter, Packet, Source};

    const CHECK: &str = "topic/heard";

    fn subscribed(names: &[&str]) -> Trace {
        let mut trace = Trace::tap();
        trace.connected(1);
        let filters = names
            .iter()
            .map(|name| Filter {
                filter: trace.topic(name),
                qos: 0,
            })
            .collect();
        let packet = Packet::Subscribe { packet_id: 1, filters };
        let event = Event::Packet { connection: 1, packet };
        trace.add(Source::Tap, Some(Direction::FromDevice), event);
        trace.wait(30.0);
        trace
    }

    #[test]
    fn a_vehicle_that_subscribes_to_both_hears_whatever_it_makes_of_it() {
        let mut trace = subscribed(&["order", "instantActions"]);
        trace
            .sent("order", &json!({ "orderId": "o" }))
            .wait(60.0)
            .state(&json!({}));
        let outcome = trace.judge(CHECK);
        assert!(outcome.findings.is_empty());
        assert_eq!(outcome.judged, 1);
    }

    #[test]
    fn a_topic_nobody_subscribed_to_is_found_once() {
        let mut trace = subscribed(&["order"]);
        for _ in 0..3 {
            trace
                .instant("stateRequest", "x", &json!([]))
                .wait(10.0)
                .state(&json!({}));
        }
        let outcome = trace.judge(CHECK);
        assert_eq!(outcome.summary(), ["TOPIC-10"]);
        assert_eq!(outcome.judged, 0);
    }

    #[test]
    fn a_vehicle_that_is_away_hears_nothing_and_is_not_accused() {
        let mut trace = subscribed(&["order"]);
        trace.closed(1).instant("stateRequest", "x", &json!([])).wait(60.0);
        assert!(trace.judge(CHECK).findings.is_empty());
    }

    #[test]
    fn without_the_tap_only_reactions_count() {
        let mut trace = Trace::subscriber();
        trace
            .sent("order", &json!({ "orderId": "o" }))
            .wait(60.0)
            .state(&json!({ "orderId": "o" }));
        trace
            .instant("stateRequest", "x", &json!([]))
            .wait(60.0)
            .state(&json!({}));
        let outcome = trace.judge(CHECK);
        assert!(outcome.findings.is_empty());
        assert_eq!(outcome.judged, 0);
        trace.state(&json!({ "actionStates": [{ "actionId": "x", "actionStatus": "FINISHED" }] }));
        assert_eq!(trace.judge(CHECK).judged, 1);
    }
}
