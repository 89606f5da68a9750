//! Responses to what vehicles ask for, in the light of what they ask.

use std::collections::{BTreeMap, BTreeSet};

use super::{Command, ELEMENTS, Found, short};
use crate::finding::{quote, show};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{EdgeRequest, ResponsesView, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `commands/responses`.
pub(crate) const RESPONSES: Check = Check {
    name: "commands/responses",
    decides: &["REQ-04", "REQ-05", "REQ-11", "REQ-18"],
    doc: "Each response is about one request that a state has shown before; about another one it is a warning, and a longer lease \
          that comes under an id nobody asked with is wrong. One message says one thing about a request. A lease that has ended \
          before it comes is a warning.",
    arguments: &[],
    listens: &[Listen::Sent(Topic::State), Listen::Delivered(Topic::Responses)],
    reads: &[Fact::Mock],
    needs: &[
        StateView::zone_requests,
        StateView::edge_requests,
        ResponsesView::responses,
    ],
    start: |_| Box::new(Responses::default()),
};

/// `commands/corridor-grants`.
pub(crate) const CORRIDORS: Check = Check {
    name: "commands/corridor-grants",
    decides: &["CORR-22"],
    doc: "A corridor is granted only for an edge that the last order releases. Not judged where an order may have been lost on \
          the way.",
    arguments: &[],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::Responses),
    ],
    reads: &[Fact::Mock],
    needs: &[
        StateView::edge_requests,
        EdgeRequest::sequence_id,
        ResponsesView::responses,
    ],
    start: |_| Box::new(Corridors::default()),
};

/// More requests than this are not kept in mind.
const KEPT: usize = 4_096;
/// A lease may end so much earlier by the clock of somebody else, in seconds.
const CLOCKS: f64 = 2.0;

/// The message of a record that answers requests.
fn responses<'e>(record: &Observation<'e>) -> Option<&'e ResponsesView> {
    record
        .delivered_on(Topic::Responses)?
        .responses()
        .map(|message| &**message)
}

/// The ids of what a state asks for, with the status of each.
fn asked(state: &StateView) -> impl Iterator<Item = (String, &str)> {
    let zones = state.zone_requests.iter().take(ELEMENTS);
    let zones = zones.map(|request| (&request.request_id, request.request_status.or_empty()));
    let edges = state.edge_requests.iter().take(ELEMENTS);
    let edges = edges.map(|request| (&request.request_id, request.request_status.or_empty()));
    zones.chain(edges).filter_map(|(id, status)| Some((short(id)?, status)))
}

#[derive(Default)]
struct Responses {
    /// Every id that was asked with.
    known: BTreeSet<String>,
    /// Those that a state shows as granted now.
    granted: BTreeSet<String>,
}

impl Running for Responses {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        if let Some(state) = record.said_state() {
            for (id, _) in asked(state) {
                if self.known.len() == KEPT {
                    self.known.pop_first();
                }
                self.known.insert(id);
            }
            let granted = asked(state).filter(|(_, status)| *status == "GRANTED");
            self.granted = granted.map(|(id, _)| id).collect();
        }
        let Some(message) = responses(record) else {
            return false;
        };
        let mut found = Found::new(record, findings);
        let mut said: BTreeMap<String, &str> = BTreeMap::new();
        let mut judged = false;
        for response in message.responses.iter().take(ELEMENTS) {
            let Some(id) = short(&response.request_id) else {
                continue;
            };
            judged = true;
            let grant = response.grant_type.or_empty();
            if said.insert(id.clone(), grant).is_some_and(|before| before != grant) {
                found.broken(
                    "REQ-04",
                    format!("one message says two things about request {}", quote(&id)),
                );
            }
            let lease = response.lease_expiry.text();
            if !self.known.contains(&id) {
                if grant == "GRANTED" && lease.is_some() && !self.granted.is_empty() {
                    let text = format!(
                        "a grant comes under {}, while what is granted has another id",
                        quote(&id)
                    );
                    found.remark("REQ-11", text);
                } else {
                    found.remark("REQ-18", format!("nobody has asked with the id {}", quote(&id)));
                }
            }
            let ends = lease.and_then(|text| text.parse::<jiff::Timestamp>().ok());
            let left = ends.map(|ends| ends.duration_since(record.at().utc).as_secs_f64());
            if left.is_some_and(|left| left < -CLOCKS) {
                let text = format!(
                    "the lease of {} ended before it came: {}",
                    quote(&id),
                    show(&response.lease_expiry)
                );
                found.remark("REQ-05", text);
            }
        }
        judged
    }
}

/// Which edge is meant: edgeId and sequenceId.
type EdgeName = (String, u64);

#[derive(Default)]
struct Corridors {
    /// The edges requests are about.
    asked: BTreeMap<String, EdgeName>,
    /// Edges of the last order, and whether each is released.
    edges: BTreeMap<EdgeName, bool>,
    order: Option<String>,
    since: Option<Moment>,
}

impl Running for Corridors {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.mock().is_lost(record) || record.link.disturbed {
            self.order = None;
            self.edges.clear();
        }
        if let Some(state) = record.said_state() {
            for request in state.edge_requests.iter().take(ELEMENTS) {
                let name = short(&request.edge_id).zip(request.sequence_id.whole());
                if let (Some(id), Some(name)) = (short(&request.request_id), name)
                    && self.asked.len() < KEPT
                {
                    self.asked.insert(id, name);
                }
            }
        }
        if let Some(order) = Command::read(record).and_then(Command::order) {
            let id = order.order_id.or_empty();
            if self.order.as_deref() != Some(id) {
                self.edges.clear();
                self.order = Some(id.to_owned());
            }
            // An update replaces the horizon.
            self.edges.retain(|_, released| *released);
            for edge in order.edges.iter().take(ELEMENTS) {
                if let Some(name) = short(&edge.edge_id).zip(edge.sequence_id.whole()) {
                    self.edges.insert(name, edge.released.is(true));
                }
            }
            self.since = Some(record.at().moment);
        }
        let Some(message) = responses(record).filter(|_| self.order.is_some()) else {
            return false;
        };
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for response in message.responses.iter().take(ELEMENTS) {
            let Some(edge) = short(&response.request_id).and_then(|id| self.asked.get(&id)) else {
                continue;
            };
            judged = true;
            if response.grant_type.is("GRANTED") && self.edges.get(edge) != Some(&true) {
                let text = format!(
                    "the corridor of edge {} is granted, which is not released",
                    quote(&edge.0)
                );
                found.broken("CORR-22", text);
            }
        }
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn asks(id: &str, status: &str) -> Value {
        json!({ "zoneRequests": [
            { "requestId": id, "requestType": "ACCESS", "zoneId": "a", "zoneSetId": "z1", "requestStatus": status },
        ] })
    }

    fn answer(id: &str, grant: &str) -> Value {
        json!({ "responses": [{ "requestId": id, "grantType": grant }] })
    }

    fn lease(id: &str, until: &str) -> Value {
        json!({ "responses": [{ "requestId": id, "grantType": "GRANTED", "leaseExpiry": until }] })
    }

    #[test]
    fn answers_to_requests_pass() {
        let mut trace = Trace::master_control_of("3.0");
        trace.shows(&asks("r1", "REQUESTED")).wait(1.0);
        trace.commands("responses", &answer("r1", "QUEUED")).wait(1.0);
        trace
            .commands("responses", &lease("r1", "2026-01-01T12:00:30.000Z"))
            .wait(1.0);
        trace.shows(&asks("r1", "GRANTED")).wait(1.0);
        trace
            .commands("responses", &lease("r1", "2026-01-01T12:01:00.000Z"))
            .wait(1.0);
        // A request that was taken back a moment ago.
        trace.shows(&json!({ "zoneRequests": [] })).wait(0.1);
        trace.commands("responses", &answer("r1", "REVOKED"));
        let outcome = trace.judge("commands/responses");
        assert!(
            outcome.summary().is_empty() && outcome.judged > 0,
            "{:?}",
            outcome.summary()
        );
    }

    #[test]
    fn each_mistake_of_an_answer_is_found() {
        let mut trace = Trace::master_control_of("3.0");
        trace.commands("responses", &answer("r1", "GRANTED"));
        assert_eq!(trace.judge("commands/responses").summary(), ["REQ-18 warning"]);
        let mut trace = Trace::master_control_of("3.0");
        trace.shows(&asks("r1", "REQUESTED")).wait(1.0);
        trace.commands("responses", &lease("r1", "2026-01-01T11:00:00.000Z"));
        assert_eq!(trace.judge("commands/responses").summary(), ["REQ-05 warning"]);
        let mut trace = Trace::master_control_of("3.0");
        trace.shows(&asks("r1", "GRANTED")).wait(1.0);
        trace.commands("responses", &lease("r2", "2026-01-01T12:30:00.000Z"));
        assert_eq!(trace.judge("commands/responses").summary(), ["REQ-11 warning"]);
        let mut trace = Trace::master_control_of("3.0");
        trace.shows(&asks("r1", "REQUESTED")).wait(1.0);
        let both = json!({ "responses": [
            { "requestId": "r1", "grantType": "GRANTED" }, { "requestId": "r1", "grantType": "QUEUED" },
        ] });
        trace.commands("responses", &both);
        assert_eq!(trace.judge("commands/responses").summary(), ["REQ-04"]);
    }

    fn corridor(sequence: u64) -> Value {
        json!({ "edgeRequests": [{ "requestId": format!("r{sequence}"), "requestType": "CORRIDOR", "edgeId": "e",
            "sequenceId": sequence, "requestStatus": "REQUESTED" }] })
    }

    fn order(update: u64, first: u64, released: u64) -> Value {
        let edges: Vec<Value> = (0..3)
            .map(|at| 2 * at + 1)
            .filter(|at| *at > first)
            .map(|at| json!({ "edgeId": "e", "sequenceId": at, "released": at < released, "actions": [] }))
            .collect();
        json!({ "orderId": "o1", "orderUpdateId": update, "nodes": [], "edges": edges })
    }

    #[test]
    fn only_corridors_of_the_base_are_granted() {
        let mut trace = Trace::master_control_of("3.0");
        trace.commands("order", &order(0, 0, 2)).wait(1.0);
        trace.shows(&corridor(3)).wait(1.0);
        trace.commands("responses", &answer("r3", "QUEUED")).wait(1.0);
        trace.commands("order", &order(1, 2, 4)).wait(1.0);
        trace.commands("responses", &answer("r3", "GRANTED")).wait(1.0);
        let outcome = trace.judge("commands/corridor-grants");
        assert!(
            outcome.summary().is_empty() && outcome.judged > 0,
            "{:?}",
            outcome.summary()
        );
        trace.shows(&corridor(5)).wait(1.0);
        trace.commands("responses", &answer("r5", "GRANTED"));
        assert_eq!(trace.judge("commands/corridor-grants").summary(), ["CORR-22"]);
    }
}
