//! `state/trajectory`, `state/trajectory-ends` and `state/planned-path`: the trajectories a vehicle reports.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::finding::{broken, remark};
use tck_base::nurbs::{Curve, Flaw, Path};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{EdgeState, Node, OrderView, StateView};
use tck_world::ordered::{allowed_deviation, curve, place_of};
use tck_world::{Listen, Observation, Topic};

/// `state/trajectory`.
pub(super) const TRAJECTORY: Check = Check {
    name: "state/trajectory",
    decides: &["ORD-MSG-28", "ORD-MSG-29", "ORD-MSG-31"],
    doc: "Every trajectory in edgeStates has a whole degree of at least 1, control points with x and y and with weights \
          not below 0, more of them than the degree, and as many knots within 0 to 1 as control points, degree and one \
          together. A missing degree and knots out of order are warnings.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::edge_states, EdgeState::trajectory],
    start: |_| Box::new(Shape::default()),
};

/// `state/trajectory-ends`.
pub(super) const TRAJECTORY_ENDS: Check = Check {
    name: "state/trajectory-ends",
    decides: &["ORD-MSG-30"],
    doc: "The first and the last control point of a trajectory in edgeStates are where the nodes of the edge are, within \
          their allowedDeviationXY and 0.5 m at the end or 1 m at the start. The start of the edge the vehicle is on is \
          not judged, for it is where the vehicle entered the edge.",
    arguments: &[],
    listens: &[Listen::ToVehicle(Topic::Order), Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[EdgeState::trajectory, Node::node_position],
    start: |_| Box::new(Ends::default()),
};

/// `state/planned-path`.
pub(super) const PLANNED_PATH: Check = Check {
    name: "state/planned-path",
    decides: &["STATE-15"],
    doc: "The trajectory of a released edge stays on the one that was reported for it first, within 0.2 m; it may be \
          written differently, and be cut off where it was driven already. An edge with a corridor is not judged, for \
          there the vehicle may drive round something.",
    arguments: &[],
    listens: &[Listen::ToVehicle(Topic::Order), Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[EdgeState::trajectory],
    start: |_| Box::new(Planned::default()),
};

/// How many edges are remembered, and of how many elements of an order the places.
const EDGES: usize = 512;
/// How many orders are remembered.
const ORDERS: usize = 32;
/// How far a path may be beside the one before, in metres.
const SAME: f64 = 0.2;
/// How far the end of a curve may be from its node, in metres.
const END: f64 = 0.5;
/// How far the start of a curve may be from its node, in metres.
const START: f64 = 1.0;

/// The edges of a state for which a trajectory is reported, with their sequenceIds.
fn reported(state: &StateView) -> impl Iterator<Item = (u64, &EdgeState)> {
    let edges = state.edge_states.iter().take(EDGES);
    let reported = edges.filter(|edge| edge.trajectory.presence().is_something());
    reported.filter_map(|edge| Some((edge.sequence_id.whole()?, edge)))
}

/// Whether a flaw is one in this version: a member that is missing is none where the version says what is meant then.
pub(crate) fn counts(flaw: &Flaw, context: &CheckContext<'_>) -> bool {
    !(flaw.has_default() && context.pack.has("trajectoryDefaults"))
}

#[derive(Default)]
struct Shape {
    /// What was complained about: one complaint per kind and edge is enough.
    said: BTreeSet<(String, u64, String)>,
}

impl Running for Shape {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(state) = record.state() else {
            return false;
        };
        let mut judged = false;
        for (sequence, edge) in reported(state) {
            judged = true;
            let flaws = curve(&edge.trajectory).map(|(_, flaws)| flaws).unwrap_or_default();
            for flaw in flaws.into_iter().filter(|flaw| counts(flaw, context)) {
                let key = (state.order_id.or_empty().to_owned(), sequence, flaw.to_string());
                if self.said.len() >= EDGES || !self.said.insert(key) {
                    continue;
                }
                let message = format!("the trajectory of edge {sequence}: {flaw}");
                findings.push(match flaw {
                    Flaw::Member(_) | Flaw::KnotsMissing => broken("ORD-MSG-28", record.seq(), message),
                    Flaw::DegreeMissing => remark("ORD-MSG-28", record.seq(), message),
                    Flaw::PointCount { .. } => broken("ORD-MSG-31", record.seq(), message),
                    Flaw::KnotCount { .. } | Flaw::KnotRange { .. } => broken("ORD-MSG-29", record.seq(), message),
                    Flaw::KnotOrder(_) => remark("ORD-MSG-29", record.seq(), message),
                });
            }
        }
        judged
    }
}

/// Where a node is, and how far from there the vehicle may be, in metres.
type Place = (f64, f64, f64);

/// Places of nodes by order and sequenceId; `None` where two messages say different things.
#[derive(Default)]
struct Places {
    orders: VecDeque<(String, BTreeMap<u64, Option<Place>>)>,
}

impl Places {
    fn note(&mut self, order: &OrderView) {
        let id = order.order_id.or_empty().to_owned();
        let at = self
            .orders
            .iter()
            .position(|(other, _)| *other == id)
            .unwrap_or_else(|| {
                if self.orders.len() == ORDERS {
                    self.orders.pop_front();
                }
                self.orders.push_back((id, BTreeMap::new()));
                self.orders.len() - 1
            });
        let places = &mut self.orders[at].1;
        for node in order.nodes.iter().take(EDGES) {
            let Some(sequence) = node.sequence_id.whole() else {
                continue;
            };
            let allowed = allowed_deviation(node).unwrap_or_default();
            let place = place_of(node).map(|(x, y, _)| (x, y, allowed));
            let known = places.entry(sequence).or_insert(place);
            if *known != place {
                *known = None;
            }
        }
    }

    fn of(&self, order: &str, sequence: u64) -> Option<Place> {
        let (_, places) = self.orders.iter().find(|(other, _)| other == order)?;
        *places.get(&sequence)?
    }
}

#[derive(Default)]
struct Ends {
    places: Places,
    said: BTreeSet<(String, u64)>,
}

impl Running for Ends {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        if let Some(order) = record.order_to_vehicle() {
            self.places.note(order);
        }
        let Some(state) = record.state() else {
            return false;
        };
        let order = state.order_id.or_empty();
        let last = state.last_node_sequence_id.whole();
        let mut judged = false;
        for (sequence, edge) in reported(state) {
            let curve = curve(&edge.trajectory).and_then(|(curve, _)| curve);
            let Some((start, end)) = curve.as_ref().and_then(Curve::ends) else {
                continue;
            };
            let ends = [
                (
                    sequence.checked_sub(1).filter(|from| Some(*from) != last),
                    start,
                    START,
                    "begins",
                ),
                (Some(sequence + 1), end, END, "ends"),
            ];
            for (node, point, reach, verb) in ends {
                let Some((x, y, allowed)) = node.and_then(|node| self.places.of(order, node)) else {
                    continue;
                };
                judged = true;
                let distance = (x - point.0).hypot(y - point.1);
                if distance > reach + allowed
                    && self.said.len() < EDGES
                    && self.said.insert((order.to_owned(), sequence))
                {
                    let message = format!("the trajectory of edge {sequence} {verb} {distance:.2} m from its node");
                    findings.push(broken("ORD-MSG-30", record.seq(), message));
                }
            }
        }
        judged
    }
}

#[derive(Default)]
struct Planned {
    /// Edges with a corridor, by order and sequenceId.
    free: BTreeSet<(String, u64)>,
    order: String,
    /// What was reported first for the released edges of the present order.
    first: BTreeMap<u64, Path>,
    said: BTreeSet<u64>,
}

impl Running for Planned {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        if let Some(order) = record.order_to_vehicle() {
            let edges = order
                .edges
                .iter()
                .filter(|edge| edge.corridor.presence().is_something());
            for sequence in edges.filter_map(|edge| edge.sequence_id.whole()) {
                if self.free.len() < EDGES {
                    self.free.insert((order.order_id.or_empty().to_owned(), sequence));
                }
            }
        }
        let Some(state) = record.state() else {
            return false;
        };
        let order = state.order_id.or_empty();
        if self.order != order {
            order.clone_into(&mut self.order);
            self.first.clear();
            self.said.clear();
        }
        let mut judged = false;
        for (sequence, edge) in reported(state) {
            if !edge.released.is(true) || self.free.contains(&(self.order.clone(), sequence)) {
                continue;
            }
            let Some(path) = curve(&edge.trajectory).and_then(|(curve, _)| Some(curve?.path())) else {
                continue;
            };
            let Some(first) = self.first.get(&sequence) else {
                if self.first.len() < EDGES {
                    self.first.insert(sequence, path);
                }
                continue;
            };
            judged = true;
            // Corners lie on the ends of straight stretches; between them nothing is farther away.
            let off = |(x, y)| first.beside(x, y).map_or(0.0, |beside| beside.distance);
            let farthest = path.points().map(off).fold(0.0, f64::max);
            if farthest > SAME && self.said.insert(sequence) {
                let message =
                    format!("the trajectory of edge {sequence} is {farthest:.2} m beside the one reported first");
                findings.push(broken("STATE-15", record.seq(), message));
            }
        }
        judged
    }
}

#[cfg(test)]
mod tests {
    use crate::trace::Trace;
    use serde_json::{Value, json};

    fn line(points: &[(f64, f64)]) -> Value {
        let last = points.len() - 1;
        let inner = (1..last).map(|at| at as f64 / last as f64);
        let knots: Vec<f64> = [0.0, 0.0].into_iter().chain(inner).chain([1.0, 1.0]).collect();
        let points: Vec<Value> = points.iter().map(|(x, y)| json!({ "x": x, "y": y })).collect();
        json!({ "degree": 1, "knotVector": knots, "controlPoints": points })
    }

    /// From n1 (0, 0) to n2 (4, 0) and n3 (4, 4), of which the last is planned; states with these trajectories.
    fn run(check: &str, corridor: bool, trajectories: &[(Value, Value)]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        let node = |number: u64, x: f64, y: f64| {
            json!({
                "nodeId": format!("n{number}"), "sequenceId": 2 * (number - 1), "released": number < 3, "actions": [],
                "nodePosition": { "x": x, "y": y, "mapId": "hall" },
            })
        };
        let mut edges = json!([{ "edgeId": "e1", "sequenceId": 1 }, { "edgeId": "e2", "sequenceId": 3 }]);
        if corridor {
            edges[0]["corridor"] = json!({ "leftWidth": 1.0, "rightWidth": 1.0 });
        }
        let nodes = [node(1, 0.0, 0.0), node(2, 4.0, 0.0), node(3, 4.0, 4.0)];
        trace.sent(
            "order",
            &json!({ "orderId": "o", "orderUpdateId": 0, "nodes": nodes, "edges": edges }),
        );
        for (first, second) in trajectories {
            trace.wait(1.0).state(
                &json!({ "orderId": "o", "lastNodeId": "n1", "lastNodeSequenceId": 0, "edgeStates": [
                { "edgeId": "e1", "sequenceId": 1, "released": true, "trajectory": first },
                { "edgeId": "e2", "sequenceId": 3, "released": false, "trajectory": second },
            ] }),
            );
        }
        let outcome = trace.judge(check);
        let judged = if outcome.judged > 0 { "judged" } else { "nothing" };
        outcome.summary().into_iter().chain([judged.to_owned()]).collect()
    }

    fn good() -> (Value, Value) {
        (line(&[(0.0, 0.0), (4.0, 0.0)]), line(&[(4.0, 0.0), (4.0, 4.0)]))
    }

    #[test]
    fn a_sound_trajectory_passes_and_none_decides_nothing() {
        for check in ["state/trajectory", "state/trajectory-ends"] {
            assert_eq!(run(check, false, &[good()]), ["judged"]);
            assert_eq!(run(check, false, &[(Value::Null, Value::Null)]), ["nothing"]);
        }
        assert_eq!(run("state/planned-path", false, &[good()]), ["nothing"]);
        assert_eq!(run("state/planned-path", false, &[good(), good()]), ["judged"]);
    }

    #[test]
    fn every_mistake_in_the_shape_is_found_once() {
        let with = |patch: Value| {
            let (mut first, second) = good();
            json_patch::merge(&mut first, &patch);
            run(
                "state/trajectory",
                false,
                &[(first.clone(), second.clone()), (first, second)],
            )
        };
        assert_eq!(with(json!({ "controlPoints": null })), ["ORD-MSG-28", "judged"]);
        assert_eq!(with(json!({ "degree": null })), ["ORD-MSG-28 warning", "judged"]);
        assert_eq!(with(json!({ "knotVector": [0, 0, 1] })), ["ORD-MSG-29", "judged"]);
        assert_eq!(
            with(json!({ "knotVector": [0, 0.5, 0.2, 1] })),
            ["ORD-MSG-29 warning", "judged"]
        );
    }

    #[test]
    fn a_curve_that_ends_elsewhere_is_found_but_not_where_the_vehicle_entered_the_edge() {
        let ends = |first: &[(f64, f64)], second: &[(f64, f64)]| {
            run("state/trajectory-ends", false, &[(line(first), line(second))])
        };
        assert_eq!(
            ends(&[(0.0, 0.0), (3.0, 0.0)], &[(4.0, 0.0), (4.0, 4.0)]),
            ["ORD-MSG-30", "judged"]
        );
        assert_eq!(
            ends(&[(0.0, 0.0), (4.0, 0.0)], &[(4.0, 1.5), (4.0, 4.0)]),
            ["ORD-MSG-30", "judged"]
        );
        assert_eq!(ends(&[(2.0, 0.0), (4.0, 0.2)], &[(4.0, 0.5), (4.0, 4.0)]), ["judged"]);
    }

    #[test]
    fn a_path_may_be_cut_off_and_written_anew_but_not_lead_elsewhere() {
        let then =
            |again: &[(f64, f64)], corridor| run("state/planned-path", corridor, &[good(), (line(again), good().1)]);
        assert_eq!(then(&[(1.0, 0.0), (2.0, 0.1), (4.0, 0.0)], false), ["judged"]);
        assert_eq!(
            then(&[(0.0, 0.0), (2.0, 1.0), (4.0, 0.0)], false),
            ["STATE-15", "judged"]
        );
        assert_eq!(then(&[(0.0, 0.0), (2.0, 1.0), (4.0, 0.0)], true), ["nothing"]);
        // The horizon may be planned anew.
        let other = (good().0, line(&[(4.0, 0.0), (6.0, 2.0), (4.0, 4.0)]));
        assert_eq!(run("state/planned-path", false, &[good(), other]), ["judged"]);
    }
}
