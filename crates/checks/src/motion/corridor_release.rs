//! `motion/corridor-…`: whether a corridor that has to be released is used with a release only.

use std::collections::BTreeMap;

use super::{found, softly};
use crate::finding::show;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Corridor, Edge, EdgeRequest, Response, StateView};
use tck_world::{Fact, Listen, Observation, Topic, View};

/// `motion/corridor-asked`.
pub(crate) const CORRIDOR_ASKED: Check = Check {
    name: "motion/corridor-asked",
    decides: &["CORR-11"],
    doc: "A vehicle that is more than 0.3 m beside the trajectory of an edge whose corridor has releaseRequired has listed an \
          edgeRequest for that edge. Judged where it has asked or left its trajectory: one that does neither proves nothing.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::of(Question::Asked)),
};

/// `motion/corridor-granted`.
pub(crate) const CORRIDOR_GRANTED: Check = Check {
    name: "motion/corridor-granted",
    decides: &["CORR-14", "REQ-07", "REQ-08", "REQ-14", "REQ-17"],
    doc: "A vehicle that has asked for a corridor stays within 0.3 m of the trajectory until a response grants what it has \
          asked for. Judged as soon as it has asked.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::of(Question::Granted)),
};

/// `motion/corridor-shown`.
pub(crate) const CORRIDOR_SHOWN: Check = Check {
    name: "motion/corridor-shown",
    decides: &["CORR-15"],
    doc: "A vehicle that has left its trajectory in a corridor that was granted has shown GRANTED, in that state or before.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::of(Question::Shown)),
};

/// `motion/corridor-kept`.
pub(crate) const CORRIDOR_KEPT: Check = Check {
    name: "motion/corridor-kept",
    decides: &["CORR-16", "CORR-17"],
    doc: "While a vehicle is more than 0.3 m beside the trajectory of an edge whose corridor has releaseRequired, and has \
          asked for it, it lists an edgeRequest for the edge.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::of(Question::Kept)),
};

/// `motion/corridor-lease`.
pub(crate) const CORRIDOR_LEASE: Check = Check {
    name: "motion/corridor-lease",
    decides: &["REQ-09"],
    doc: "A vehicle that was on its trajectory a second after the lease of its corridor had ended stays within 0.3 m of it, \
          unless it is granted another one. Judged where a lease ended before it was used.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::of(Question::Leased)),
};

/// `motion/corridor-returned`.
pub(crate) const CORRIDOR_RETURNED: Check = Check {
    name: "motion/corridor-returned",
    decides: &["CORR-19", "CORR-20"],
    doc: "A vehicle that lists a request for a corridor as REVOKED or EXPIRED does not go on with its way round: it comes no \
          more than 0.5 m farther along the trajectory. When it lists the request no longer it is within 0.3 m of the \
          trajectory. A way back that is more than 0.5 m beside the way out is a warning (CORR-20).",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Returned::default()),
};

const LISTENS: &[Listen] = &[
    Listen::ToVehicle(Topic::Responses),
    Listen::Hook,
    Listen::Answer,
    Listen::Delivered(Topic::State),
];
const READS: &[Fact] = &[Fact::Way, Fact::Displaced];
const NEEDS: &[tck_view::Field] = &[
    Edge::trajectory,
    Corridor::release_required,
    StateView::edge_requests,
    StateView::position,
];

/// Nearer to its trajectory than this the vehicle has not left it, in metres.
const LEFT: f64 = 0.3;
/// How far it may go on, or be beside the way it came, in metres.
const ON: f64 = 0.5;
/// How much later than its lease it is late, in seconds.
const LATE: f64 = 1.0;
/// How many answers are kept in mind.
const ANSWERS: usize = 256;

/// What the last answer to a request said.
#[derive(Clone, Copy, Debug, Default)]
struct Given {
    granted: bool,
    lease: Option<jiff::Timestamp>,
}

/// Answers to requests.
#[derive(Default)]
struct Answers(BTreeMap<String, Given>);

impl Answers {
    /// Reads the answers of a message.
    fn learn(&mut self, record: &Observation<'_>) {
        let Some(message) = record
            .to_vehicle(Topic::Responses)
            .and_then(|message| message.responses())
        else {
            return;
        };
        for answer in &message.responses {
            self.note(answer);
        }
    }

    fn note(&mut self, answer: &Response) {
        let Some(id) = answer.request_id.text() else { return };
        if self.0.len() >= ANSWERS && !self.0.contains_key(id) {
            self.0.pop_first();
        }
        let given = self.0.entry(id.to_owned()).or_default();
        let granted = answer.grant_type.is("GRANTED");
        given.lease = answer
            .lease_expiry
            .text()
            .and_then(|end| end.parse().ok())
            .filter(|_| granted);
        given.granted |= granted;
    }
}

/// The requests of a state for the edge the vehicle is on.
fn requests<'s>(state: &'s StateView, now: &View) -> Vec<&'s EdgeRequest> {
    let Some(lane) = &now.lane else { return Vec::new() };
    let all = state.edge_requests.iter();
    all.filter(|request| request.sequence_id.whole() == Some(lane.demands.sequence))
        .collect()
}

/// How far the vehicle is beside the trajectory, and how far along it, where the corridor has to be released.
fn beside(now: &View) -> Option<(f64, f64)> {
    let (lane, pose) = now.lane.as_ref().zip(now.pose.as_ref())?;
    lane.demands.corridor.filter(|corridor| corridor.release_required)?;
    let beside = lane.bend(pose)?.beside;
    Some((beside.distance, beside.made))
}

#[derive(Clone, Copy, PartialEq)]
enum Question {
    Asked,
    Granted,
    Shown,
    Kept,
    Leased,
}

/// What is known of the edge the vehicle is on.
#[derive(Default)]
struct OnEdge {
    key: (String, u64),
    asked: bool,
    granted: bool,
    shown: bool,
    /// The ids of the requests for it.
    ids: Vec<String>,
    /// A lease has ended, and the vehicle was still on its trajectory a while later.
    unused: bool,
    told: bool,
    /// Somebody has moved the vehicle.
    moved: bool,
}

struct Releases {
    question: Question,
    answers: Answers,
    on: OnEdge,
}

impl Releases {
    fn of(question: Question) -> Self {
        Self {
            question,
            answers: Answers::default(),
            on: OnEdge::default(),
        }
    }

    fn note(&mut self, listed: &[&EdgeRequest], off: f64, now: jiff::Timestamp) {
        let on = &mut self.on;
        on.asked |= !listed.is_empty();
        on.shown |= listed.iter().any(|request| request.request_status.is("GRANTED"));
        for id in listed.iter().filter_map(|request| request.request_id.text()) {
            if on.ids.len() < ANSWERS && !on.ids.iter().any(|known| known == id) {
                on.ids.push(id.to_owned());
            }
        }
        let given = on.ids.iter().filter_map(|id| self.answers.0.get(id));
        let given: Vec<&Given> = given.filter(|given| given.granted).collect();
        on.granted |= !given.is_empty();
        let is_over = |given: &&&Given| {
            let over = given.lease.map(|end| now.duration_since(end).as_secs_f64());
            over.is_some_and(|over| over > LATE)
        };
        let over = given.iter().filter(is_over).count();
        if off <= LEFT {
            on.unused = over > 0 && over == given.len();
        } else if over < given.len() {
            on.unused = false;
        }
    }
}

impl Running for Releases {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.answers.learn(record);
        self.on.moved |= context.world.displaced().now(record);
        let Some((step, state)) = context.world.way().step(record).zip(record.state()) else {
            return false;
        };
        let now = &step.now;
        let key = (now.order.clone(), now.node.sequence);
        if key != self.on.key {
            self.on = OnEdge {
                key,
                ..OnEdge::default()
            };
        }
        let Some((off, _)) = beside(now).filter(|_| !self.on.moved) else {
            return false;
        };
        let listed = requests(state, now);
        let utc = record.at().utc;
        self.note(&listed, off, utc);
        let on = &mut self.on;
        let (judged, wrong, text) = match self.question {
            Question::Asked => (off > LEFT || on.asked, !on.asked, "has not asked for its corridor"),
            Question::Granted => (on.asked, off > LEFT && !on.granted, "was not granted its corridor"),
            Question::Shown => (
                off > LEFT && on.granted,
                !on.shown,
                "has not shown GRANTED for its corridor",
            ),
            Question::Kept => (
                off > LEFT && on.asked,
                listed.is_empty(),
                "does not list its request any more",
            ),
            Question::Leased => (on.unused, off > LEFT, "had a lease that ended before that"),
        };
        if judged && wrong && !on.told {
            on.told = true;
            let text = format!("the vehicle is {off:.2} m beside the trajectory of its edge, and {text}");
            findings.push(found(now.seq, text));
        }
        judged
    }
}

/// The way out of the trajectory and back.
#[derive(Default)]
struct Returned {
    key: (String, u64),
    /// Where it was while its request was GRANTED.
    out: Vec<(f64, f64)>,
    /// How far along the trajectory it was when the release was lost.
    lost: Option<f64>,
    told: [bool; 3],
}

/// How far a point is from a chain of points, in metres.
fn from_way(way: &[(f64, f64)], x: f64, y: f64) -> Option<f64> {
    let path = tck_base::nurbs::Path::through(way.iter().copied());
    path.beside(x, y).map(|beside| beside.distance)
}

impl Running for Returned {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let moved = context.world.displaced().now(record);
        let Some((step, state)) = context.world.way().step(record).zip(record.state()) else {
            if moved {
                *self = Self::default();
            }
            return false;
        };
        let now = &step.now;
        let key = (now.order.clone(), now.node.sequence);
        if key != self.key {
            *self = Self { key, ..Self::default() };
        }
        let Some(((off, made), pose)) = beside(now).zip(now.pose.as_ref()) else {
            return false;
        };
        let listed = requests(state, now);
        let shows = |word: &str| listed.iter().any(|request| request.request_status.is(word));
        let is_lost = shows("REVOKED") || shows("EXPIRED");
        let Some(lost) = self.lost else {
            self.out.push((pose.x, pose.y));
            self.out.truncate(ANSWERS);
            if is_lost && off > LEFT {
                self.lost = Some(made);
            }
            return false;
        };
        let mut tell = |at: usize, finding: CheckFinding| {
            if !std::mem::replace(&mut self.told[at], true) {
                findings.push(finding);
            }
        };
        let goes_on = is_lost && made > lost + ON;
        if goes_on {
            let text = format!(
                "the vehicle has gone on by {:.2} m since it lost its release",
                made - lost
            );
            tell(0, found(now.seq, text));
        }
        let aside = from_way(&self.out, pose.x, pose.y).filter(|_| is_lost && !goes_on && self.out.len() > 3);
        if let Some(aside) = aside.filter(|aside| *aside > ON) {
            let text = format!("the way back is {} m beside the way out", show(&format!("{aside:.2}")));
            let mut finding = softly(now.seq, text);
            finding.requirement = Some("CORR-20".into());
            tell(1, finding);
        }
        if !is_lost {
            if off > LEFT {
                let text = format!("the request is gone, and the vehicle is {off:.2} m beside its trajectory");
                tell(2, found(now.seq, text));
            }
            self.lost = None;
            self.out.clear();
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    /// A drive from n1 (0, 0) to n2 (4, 0) through a corridor that has to be released.
    fn drive() -> Trace {
        let node = |id: &str, sequence: u32, x: f64| {
            json!({
                "nodeId": id, "sequenceId": sequence, "released": true, "actions": [],
                "nodePosition": { "x": x, "y": 0.0, "mapId": "hall" },
            })
        };
        let line = json!({ "degree": 1, "knotVector": [0, 0, 1, 1], "controlPoints": [{ "x": 0, "y": 0 }, { "x": 4, "y": 0 }] });
        let mut trace = Trace::subscriber_of("3.0");
        trace.sent(
            "order",
            &json!({
                "orderId": "o", "orderUpdateId": 0, "nodes": [node("n1", 0, 0.0), node("n2", 2, 4.0)],
                "edges": [{
                    "edgeId": "e1", "sequenceId": 1, "released": true, "actions": [], "trajectory": line,
                    "corridor": { "leftWidth": 1.0, "rightWidth": 1.0, "releaseRequired": true },
                }],
            }),
        );
        trace
    }

    fn seen(trace: &mut Trace, (x, y): (f64, f64), status: Option<&str>) {
        let requests: Vec<Value> = status
            .iter()
            .map(|status| json!({ "requestId": "a", "requestType": "CORRIDOR", "edgeId": "e1", "sequenceId": 1, "requestStatus": status }))
            .collect();
        trace.wait(0.5).state(&json!({
            "orderId": "o", "lastNodeId": "n1", "lastNodeSequenceId": 0, "edgeRequests": requests, "driving": true,
            "nodeStates": [{ "nodeId": "n2", "sequenceId": 2, "released": true }],
            "edgeStates": [{ "edgeId": "e1", "sequenceId": 1, "released": true }],
            "mobileRobotPosition": { "localized": true, "x": x, "y": y, "theta": 0.0, "mapId": "hall" },
        }));
    }

    fn answer(trace: &mut Trace, kind: &str, lease: Option<&str>) {
        let mut answer = json!({ "requestId": "a", "grantType": kind });
        if let Some(lease) = lease {
            answer["leaseExpiry"] = json!(lease);
        }
        trace.sent("responses", &json!({ "responses": [answer] }));
    }

    fn found(trace: &Trace) -> Vec<String> {
        let names = ["asked", "granted", "shown", "kept", "lease"];
        let wrong = names
            .iter()
            .filter(|name| !trace.judge(&format!("motion/corridor-{name}")).findings.is_empty());
        wrong.map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn a_granted_way_round_is_right() {
        let mut trace = drive();
        seen(&mut trace, (0.0, 0.0), Some("REQUESTED"));
        answer(&mut trace, "GRANTED", None);
        seen(&mut trace, (0.2, 0.1), Some("GRANTED"));
        seen(&mut trace, (2.0, 0.9), Some("GRANTED"));
        seen(&mut trace, (3.9, 0.1), None);
        assert!(found(&trace).is_empty());
        assert!(trace.judge("motion/corridor-asked").judged > 0);
        assert_eq!(trace.judge("motion/corridor-lease").judged, 0);
    }

    #[test]
    fn what_was_not_asked_granted_shown_or_kept_is_found() {
        let mut trace = drive();
        seen(&mut trace, (2.0, 0.9), None);
        assert_eq!(found(&trace), ["asked"]);
        let mut trace = drive();
        seen(&mut trace, (0.0, 0.0), Some("REQUESTED"));
        answer(&mut trace, "QUEUED", None);
        seen(&mut trace, (2.0, 0.9), Some("REQUESTED"));
        assert_eq!(found(&trace), ["granted"]);
        let mut trace = drive();
        seen(&mut trace, (0.0, 0.0), Some("REQUESTED"));
        answer(&mut trace, "GRANTED", None);
        seen(&mut trace, (2.0, 0.9), Some("REQUESTED"));
        assert_eq!(found(&trace), ["shown"]);
        seen(&mut trace, (2.5, 0.9), None);
        assert_eq!(found(&trace), ["shown", "kept"]);
    }

    #[test]
    fn a_lease_that_is_over_allows_nothing() {
        let mut trace = drive();
        seen(&mut trace, (0.0, 0.0), Some("REQUESTED"));
        answer(&mut trace, "GRANTED", Some("2026-01-01T12:00:01.000Z"));
        trace.wait(5.0);
        seen(&mut trace, (0.0, 0.0), None);
        seen(&mut trace, (2.0, 0.9), Some("GRANTED"));
        assert_eq!(found(&trace), ["lease"]);
        // Who has left his trajectory before may be on his way.
        let mut trace = drive();
        seen(&mut trace, (0.0, 0.0), Some("REQUESTED"));
        answer(&mut trace, "GRANTED", Some("2026-01-01T12:00:02.000Z"));
        seen(&mut trace, (2.0, 0.9), Some("GRANTED"));
        trace.wait(5.0);
        seen(&mut trace, (2.0, 0.9), Some("EXPIRED"));
        assert!(found(&trace).is_empty());
    }

    #[test]
    fn a_way_back_is_the_way_out_or_at_least_none_on() {
        let way = |back: &[(f64, f64)], end: (f64, f64)| {
            let mut trace = drive();
            for out in [(0.0, 0.0), (0.5, 0.3), (1.0, 0.6), (1.5, 0.8), (2.0, 0.9)] {
                seen(&mut trace, out, Some("GRANTED"));
            }
            for place in back {
                seen(&mut trace, *place, Some("REVOKED"));
            }
            seen(&mut trace, end, None);
            trace.judge("motion/corridor-returned").summary()
        };
        assert!(way(&[(2.0, 0.9), (1.0, 0.6), (0.2, 0.1)], (0.0, 0.0)).is_empty());
        assert_eq!(way(&[(2.0, 0.9), (3.0, 0.6)], (4.0, 0.0)), ["-"]);
        assert_eq!(way(&[(2.0, 0.9), (1.0, 0.6)], (1.0, 0.6)), ["-"]);
        assert_eq!(way(&[(2.0, 0.9), (1.5, -0.2)], (0.0, 0.0)), ["CORR-20 warning"]);
    }
}
