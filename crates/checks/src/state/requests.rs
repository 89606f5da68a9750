//! `state/request-…`: the requests a vehicle lists in its states, and what becomes of them.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{EdgeRequest, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `state/request-ids`.
pub(crate) const REQUEST_IDS: Check = Check {
    name: "state/request-ids",
    decides: &["ZREQ-04"],
    doc: "No two requests of a state, for zones or for edges, have the same requestId, and none comes back once it was \
          gone. One that comes back is a warning; after a restart of the vehicle ids may begin anew.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Connection),
        Listen::Connect,
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::edge_requests],
    start: |_| Box::new(Ids::default()),
};

/// `state/request-status`.
pub(crate) const REQUEST_STATUS: Check = Check {
    name: "state/request-status",
    decides: &["REQ-16", "REQ-06", "CORR-12", "ZREQ-06"],
    doc: "A request is listed as REQUESTED first, unless it was answered already, and is GRANTED only where a response said so. \
          One that was REVOKED or EXPIRED is never GRANTED, REQUESTED or QUEUED again, nor one that was GRANTED asked for \
          again, which is a warning.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::Responses),
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Connection),
        Listen::Connect,
        Listen::Fault,
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::edge_requests],
    start: |_| Box::new(Statuses::default()),
};

/// `state/edge-requests`.
pub(crate) const EDGE_REQUESTS: Check = Check {
    name: "state/edge-requests",
    decides: &["CORR-12", "CORR-13", "CORR-16", "REQ-15"],
    doc: "An edgeRequest that is new names an edge of edgeStates, by edgeId and sequenceId (CORR-12), that is released \
          (CORR-13). One whose edge has been gone for more than three states is a warning (CORR-16, REQ-15); one that is \
          still there in the states of another order is not (REQ-15).",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::edge_requests, StateView::edge_states],
    start: |_| Box::new(OfEdges::default()),
};

/// How many requests are kept in mind.
const KEPT: usize = 512;
/// For how many states a request may stay behind.
const BEHIND: u32 = 3;

/// A request of a state: its id, what it says of itself, and whether it is about a zone.
struct Listed<'s> {
    id: &'s str,
    status: &'s str,
    zone: bool,
}

/// The requests of a state that have an id.
fn listed(state: &StateView) -> Vec<Listed<'_>> {
    let zones = state.zone_requests.iter().filter_map(|request| {
        Some(Listed {
            id: request.request_id.text()?,
            status: request.request_status.or_empty(),
            zone: true,
        })
    });
    let edges = state.edge_requests.iter().filter_map(|request| {
        Some(Listed {
            id: request.request_id.text()?,
            status: request.request_status.or_empty(),
            zone: false,
        })
    });
    zones.chain(edges).collect()
}

#[derive(Default)]
struct Ids {
    /// Ids of the state before.
    active: BTreeSet<String>,
    /// Ids that were listed, and are no longer, the eldest first.
    gone: VecDeque<String>,
    told: BTreeSet<(String, bool)>,
}

impl Running for Ids {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.restarts().now(record) {
            self.gone.clear();
            self.active.clear();
        }
        let Some(state) = record.state() else { return false };
        let mut now = BTreeSet::new();
        for request in listed(state) {
            let again = !now.insert(request.id.to_owned());
            let back = self.gone.iter().any(|gone| gone == request.id);
            if !(again || back) || self.told.len() >= KEPT || !self.told.insert((request.id.to_owned(), again)) {
                continue;
            }
            findings.push(if again {
                let text = format!("two requests have the requestId {}", quote(request.id));
                broken("ZREQ-04", record.seq(), text)
            } else {
                let text = format!("the requestId {} was that of a request before", quote(request.id));
                remark("ZREQ-04", record.seq(), text)
            });
        }
        let judged = !now.is_empty();
        for gone in self.active.difference(&now) {
            if self.gone.len() == KEPT {
                self.gone.pop_front();
            }
            self.gone.push_back(gone.clone());
        }
        self.active = now;
        judged
    }
}

/// How far a status is on its way.
fn rank(status: &str) -> Option<u8> {
    match status {
        "REQUESTED" | "QUEUED" => Some(0),
        "GRANTED" => Some(1),
        "REVOKED" | "EXPIRED" => Some(2),
        _ => None,
    }
}

#[derive(Default)]
struct Statuses {
    known: BTreeMap<String, String>,
    /// Requests that were answered, and whether they were granted.
    answered: BTreeMap<String, bool>,
    /// A state was seen on this connection, so that a request that is new has come up since.
    seen: bool,
    told: BTreeSet<String>,
}

impl Statuses {
    fn answers(&mut self, record: &Observation<'_>) {
        let message = record
            .to_vehicle(Topic::Responses)
            .and_then(|message| message.responses());
        for answer in message.into_iter().flat_map(|message| message.responses.iter()) {
            if let Some(id) = answer.request_id.text()
                && (self.answered.len() < KEPT || self.answered.contains_key(id))
            {
                *self.answered.entry(id.to_owned()).or_default() |= answer.grant_type.is("GRANTED");
            }
        }
    }

    fn finding(&self, request: &Listed<'_>, seq: u64) -> Option<CheckFinding> {
        let before = self.known.get(request.id).map(String::as_str);
        let (id, status) = (quote(request.id), request.status);
        let answered = self.answered.get(request.id).copied();
        match before {
            None if self.seen && answered.is_none() && status != "REQUESTED" && rank(status).is_some() => {
                let requirement = if request.zone { "ZREQ-06" } else { "CORR-12" };
                let text =
                    format!("the request {id} is {status} in the first state that lists it, and nobody answered it");
                Some(broken(requirement, seq, text))
            }
            Some(before) if status == "GRANTED" && before != "GRANTED" && answered != Some(true) => {
                let text = format!("the request {id} is GRANTED, and no response said so");
                Some(broken("REQ-06", seq, text))
            }
            Some(before) if rank(before).zip(rank(status)).is_some_and(|(before, now)| now < before) => {
                let text = format!("the request {id} is {status}, and was {before} before");
                Some(remark("REQ-16", seq, text))
            }
            _ => None,
        }
    }
}

impl Running for Statuses {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.answers(record);
        if context.world.restarts().now(record) || context.world.restarts().connects(record) || record.link.disturbed {
            self.seen = false;
        }
        if context.world.restarts().now(record) {
            self.known.clear();
            self.answered.clear();
        }
        let Some(state) = record.state() else { return false };
        let requests = listed(state);
        for request in &requests {
            let found = self.finding(request, record.seq());
            if let Some(found) = found.filter(|_| self.told.len() < KEPT && self.told.insert(request.id.to_owned())) {
                findings.push(found);
            }
            if self.known.len() < KEPT || self.known.contains_key(request.id) {
                self.known.insert(request.id.to_owned(), request.status.to_owned());
            }
        }
        self.known
            .retain(|id, _| requests.iter().any(|request| request.id == id));
        self.seen = !record.link.disturbed;
        !requests.is_empty()
    }
}

/// A request for an edge, as it was first seen.
struct OfEdge {
    order: String,
    behind: u32,
    told: bool,
}

#[derive(Default)]
struct OfEdges {
    known: BTreeMap<String, OfEdge>,
}

/// Whether a state lists the edge of a request, and whether that is released.
fn edge(state: &StateView, request: &EdgeRequest) -> Option<bool> {
    let sequence = request.sequence_id.whole()?;
    let mut edges = state.edge_states.iter();
    let found =
        edges.find(|edge| edge.sequence_id.whole() == Some(sequence) && edge.edge_id.text() == request.edge_id.text());
    found.and_then(|edge| edge.released.flag())
}

impl Running for OfEdges {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(state) = record.state() else { return false };
        let seq = record.seq();
        let order = state.order_id.or_empty();
        let mut now = BTreeSet::new();
        for request in state.edge_requests.iter().take(KEPT) {
            let Some(id) = request.request_id.text() else { continue };
            now.insert(id.to_owned());
            let on = edge(state, request);
            let is_new = !self.known.contains_key(id);
            let known = self.known.entry(id.to_owned()).or_insert_with(|| OfEdge {
                order: order.to_owned(),
                behind: 0,
                told: false,
            });
            known.behind = if on.is_none() { known.behind + 1 } else { 0 };
            if known.told {
                continue;
            }
            let name = quote(id);
            let before = findings.len();
            if is_new && on.is_none() {
                findings.push(broken(
                    "CORR-12",
                    seq,
                    format!("the edge of the request {name} is not in edgeStates"),
                ));
            } else if is_new && on == Some(false) {
                findings.push(broken(
                    "CORR-13",
                    seq,
                    format!("the edge of the request {name} is not released"),
                ));
            } else if !is_new && known.order != order && on.is_none() {
                findings.push(broken(
                    "REQ-15",
                    seq,
                    format!("the request {name} is of an order before"),
                ));
            } else if known.behind > BEHIND {
                for requirement in ["CORR-16", "REQ-15"] {
                    findings.push(remark(
                        requirement,
                        seq,
                        format!("the edge of the request {name} was left long ago"),
                    ));
                }
            }
            // What was only a remark may become worse.
            if findings.len() > before {
                known.told = !findings[before..].iter().all(|finding| finding.verdict.is_some());
                known.behind = 0;
            }
        }
        self.known.retain(|id, _| now.contains(id));
        !now.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn request(id: &str, status: &str) -> Value {
        json!({ "requestId": id, "requestType": "CORRIDOR", "edgeId": "e1", "sequenceId": 1, "requestStatus": status })
    }

    /// States with these requests, one after the other, on a vehicle with edge e1 ahead.
    fn states(trace: &mut Trace, lists: &[Value]) {
        for list in lists {
            trace.wait(1.0).state(&json!({
                "orderId": "o", "edgeRequests": list,
                "edgeStates": [{ "edgeId": "e1", "sequenceId": 1, "released": true }],
            }));
        }
    }

    fn judged(check: &str, lists: &[Value]) -> Vec<String> {
        let mut trace = Trace::subscriber_of("3.0");
        states(&mut trace, lists);
        trace.judge(check).summary()
    }

    #[test]
    fn ids_are_those_of_one_request_each() {
        let (a, b) = (request("a", "REQUESTED"), request("b", "REQUESTED"));
        let ids = "state/request-ids";
        assert!(judged(ids, &[json!([a]), json!([a, b]), json!([]), json!([])]).is_empty());
        assert_eq!(judged(ids, &[json!([a, a])]), ["ZREQ-04"]);
        assert_eq!(judged(ids, &[json!([a]), json!([]), json!([a])]), ["ZREQ-04 warning"]);
        let mut trace = Trace::subscriber_of("3.0");
        trace.state(&json!({ "edgeRequests": [a], "zoneRequests": [a] }));
        assert_eq!(trace.judge(ids).summary(), ["ZREQ-04"], "zones and edges share ids");
    }

    fn answered(kinds: &[&str], statuses: &[&str]) -> Vec<String> {
        let mut trace = Trace::subscriber_of("3.0");
        states(&mut trace, &[json!([])]);
        if kinds.is_empty() {
            states(&mut trace, &[json!([request("a", statuses[0])])]);
        } else {
            states(&mut trace, &[json!([request("a", "REQUESTED")])]);
        }
        for kind in kinds {
            trace.sent(
                "responses",
                &json!({ "responses": [{ "requestId": "a", "grantType": kind }] }),
            );
        }
        for status in statuses {
            states(&mut trace, &[json!([request("a", status)])]);
        }
        trace.judge("state/request-status").summary()
    }

    #[test]
    fn a_request_goes_the_way_that_answers_show() {
        assert!(answered(&["QUEUED", "GRANTED", "REVOKED"], &["QUEUED", "GRANTED", "REVOKED"]).is_empty());
        assert!(answered(&["QUEUED"], &["REQUESTED"]).is_empty());
        assert_eq!(answered(&["QUEUED"], &["GRANTED"]), ["REQ-06"]);
        assert_eq!(answered(&[], &["QUEUED"]), ["CORR-12"]);
        assert_eq!(
            answered(&["GRANTED", "REVOKED"], &["GRANTED", "REVOKED", "GRANTED"]),
            ["REQ-16 warning"]
        );
        // Where it is asked for first, a state may have been lost.
        assert!(judged("state/request-status", &[json!([request("a", "QUEUED")])]).is_empty());
    }

    #[test]
    fn a_request_is_of_an_edge_ahead() {
        let edges = "state/edge-requests";
        let a = request("a", "REQUESTED");
        assert!(judged(edges, &[json!([a]), json!([])]).is_empty());
        let mut of_no_edge = a.clone();
        of_no_edge["edgeId"] = json!("e7");
        assert_eq!(judged(edges, &[json!([of_no_edge])]), ["CORR-12"]);
        let mut trace = Trace::subscriber_of("3.0");
        let edge = |released: bool| json!([{ "edgeId": "e1", "sequenceId": 1, "released": released }]);
        trace.state(&json!({ "orderId": "o", "edgeRequests": [a], "edgeStates": edge(false) }));
        assert_eq!(trace.judge(edges).summary(), ["CORR-13"]);
        let mut trace = Trace::subscriber_of("3.0");
        trace.state(&json!({ "orderId": "o", "edgeRequests": [a], "edgeStates": edge(true) }));
        for _ in 0..4 {
            trace
                .wait(1.0)
                .state(&json!({ "orderId": "o", "edgeRequests": [a], "edgeStates": [] }));
        }
        assert_eq!(trace.judge(edges).summary(), ["CORR-16 warning", "REQ-15 warning"]);
        trace.state(&json!({ "orderId": "o2", "edgeRequests": [a], "edgeStates": [] }));
        assert_eq!(
            trace.judge(edges).summary(),
            ["CORR-16 warning", "REQ-15 warning", "REQ-15"]
        );
    }
}
