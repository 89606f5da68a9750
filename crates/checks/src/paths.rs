//! `state/paths-shared`, `state/paths`, `state/own-paths` and `state/edge-trajectories`: the paths that a vehicle shares with its
//! states, and which of them are its own.
//!
//! The form of their members is left to `message/schema`.

use std::collections::VecDeque;

use crate::finding::{broken, remark};
use tck_base::nurbs::Flaw;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{EdgeState, IntermediatePath, MessageView, PlannedPath, Spot, StateView, Velocity};
use tck_world::ordered::curve;
use tck_world::{Listen, Observation, Topic};

/// How far a path may begin or end beside its place, in metres.
const BESIDE: f64 = 0.5;
/// How old a position may be, in seconds: so much of the way it may be off.
const SAMPLING: f64 = 0.25;
/// Who has gone so far between two messages has moved, in metres.
const MOVED: f64 = 0.5;
/// How many points and nodes of a path are looked at.
const POINTS: usize = 512;
/// How many orders with trajectories are remembered.
const ORDERS: usize = 64;
/// A time so long ago, in seconds, is past.
const PAST: i64 = 10;

/// `state/paths-shared`.
pub(super) const SHARED: Check = Check {
    name: "state/paths-shared",
    decides: &["PATH-01"],
    doc: "A state of a vehicle that drives to a released node has a plannedPath and an intermediatePath; judged when it happens in \
          two states in a row. An order of which any edge was sent with a trajectory is not judged.",
    arguments: &[],
    listens: &[Listen::ToVehicle(Topic::Order), Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::planned_path, StateView::intermediate_path],
    start: |_| Box::new(Shared::default()),
};

/// `state/paths`.
pub(super) const PATHS: Check = Check {
    name: "state/paths",
    decides: &["PATH-02", "PATH-03", "PATH-04", "PATH-06", "PATH-07", "PATH-08"],
    doc: "plannedPath and intermediatePath begin where the same state says that the vehicle is, within half a metre and a quarter of \
          a second of its speed. The curve of plannedPath can be read, passes within half a metre of the last released node, and its \
          traversedNodes are nodes of the state. eta is a time in UTC and never falls from one waypoint to the next; more than ten \
          seconds ago is a warning, and so are fewer than two waypoints while it drives. Of two messages of a vehicle that drives the \
          second has another polyline once it has moved half a metre.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State), Listen::Delivered(Topic::Visualization)],
    reads: &[],
    needs: &[StateView::planned_path, StateView::intermediate_path],
    start: |_| Box::new(Paths::default()),
};

/// `state/own-paths`.
pub(super) const OWN: Check = Check {
    name: "state/own-paths",
    decides: &["PATH-09"],
    doc: "A vehicle whose factsheet names line-guided navigation only shares no plannedPath and no intermediatePath.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Factsheet), Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::planned_path, StateView::intermediate_path],
    start: |_| Box::new(Own::default()),
};

/// `state/edge-trajectories`.
pub(super) const ON_EDGES: Check = Check {
    name: "state/edge-trajectories",
    decides: &["STATE-MSG-21"],
    doc: "A vehicle whose factsheet names free navigation only shows no trajectory in edgeStates of an order of which no edge was \
          sent with one.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Factsheet),
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[EdgeState::trajectory],
    start: |_| Box::new(OnEdges::default()),
};

/// Orders that were sent with a trajectory.
#[derive(Default)]
struct Curved(VecDeque<String>);

impl Curved {
    fn hear(&mut self, record: &Observation<'_>) {
        let Some(order) = record.order_to_vehicle() else { return };
        let mut edges = order.edges.iter().take(POINTS);
        if edges.any(|edge| edge.trajectory.presence().is_something()) {
            if self.0.len() == ORDERS {
                self.0.pop_front();
            }
            self.0.push_back(order.order_id.or_empty().to_owned());
        }
    }

    fn has(&self, order: &str) -> bool {
        self.0.iter().any(|curved| curved == order)
    }
}

/// How a vehicle navigates, by its factsheet; nothing where this message is none.
fn navigation<'r>(record: &Observation<'r>) -> Option<Vec<&'r str>> {
    let sheet = record
        .message()
        .filter(|_| record.is_delivered(Topic::Factsheet))
        .and_then(MessageView::factsheet);
    let specification = sheet?.type_specification.there()?;
    Some(specification.navigation_types.texts().collect())
}

#[derive(Default)]
struct Shared {
    curved: Curved,
    /// States in a row without a path.
    without: u32,
    told: bool,
}

impl Running for Shared {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.curved.hear(record);
        let Some(state) = record.state() else { return false };
        let ahead = state.node_states.iter().any(|node| node.released.is(true));
        let commanded = matches!(state.operating_mode.text(), Some("AUTOMATIC" | "SEMIAUTOMATIC"));
        let order = state.order_id.or_empty();
        if !(ahead && commanded && state.driving.is(true)) || self.curved.has(order) {
            return false;
        }
        let lacks: Vec<&str> = [
            ("plannedPath", state.planned_path.is_absent()),
            ("intermediatePath", state.intermediate_path.is_absent()),
        ]
        .into_iter()
        .filter_map(|(name, absent)| absent.then_some(name))
        .collect();
        self.without = if lacks.is_empty() { 0 } else { self.without + 1 };
        if self.without >= 2 && !self.told {
            self.told = true;
            let text = format!(
                "the vehicle drives its order, and its states have no {}",
                lacks.join(" and no ")
            );
            findings.push(broken("PATH-01", record.seq(), text));
        }
        true
    }
}

/// x, y and mapId of a point of a path.
type Point = (f64, f64, String);

#[derive(Default)]
struct Paths {
    /// What was complained about: one complaint of a kind is enough.
    told: Vec<&'static str>,
    /// The last polyline of a vehicle that drives, and where it was then.
    before: Option<(Vec<Point>, Spot)>,
}

impl Paths {
    /// A complaint that was not made before.
    fn complain(&mut self, kind: &'static str, finding: CheckFinding, findings: &mut Vec<CheckFinding>) {
        if !self.told.contains(&kind) {
            self.told.push(kind);
            findings.push(finding);
        }
    }

    fn planned(&mut self, path: &PlannedPath, state: &StateView, seq: u64, findings: &mut Vec<CheckFinding>) {
        let Some((curve, flaws)) = curve_of(path) else { return };
        for flaw in flaws {
            let text = format!("the trajectory of plannedPath: {flaw}");
            match flaw {
                Flaw::DegreeMissing | Flaw::KnotsMissing | Flaw::KnotOrder(_) => {}
                _ => self.complain("flaw", broken("PATH-03", seq, text), findings),
            }
        }
        let ids: Vec<&str> = path
            .traversed_nodes
            .iter()
            .take(POINTS)
            .filter_map(|id| id.text())
            .collect();
        let known = |id: &&str| state.last_node_id.is(id) || state.node_states.iter().any(|node| node.node_id.is(id));
        if let Some(unknown) = ids.iter().find(|id| !known(id)) {
            let text = format!("plannedPath traverses {unknown:?}, which is no node that the state has ahead");
            self.complain("node", broken("PATH-03", seq, text), findings);
        }
        let Some(curve) = curve else { return };
        if let Some(far) = curve.ends().and_then(|(begin, _)| off(state, begin)) {
            let text = format!("plannedPath begins {far:.1} m from where the state says that the vehicle is");
            self.complain("begin", broken("PATH-02", seq, text), findings);
        }
        let last = state.node_states.iter().rfind(|node| node.released.is(true));
        let place = last.and_then(|node| node.node_position.there()?.spot());
        if let Some(place) = place
            && let Some(beside) = curve.path().beside(place.x, place.y)
            && beside.distance > BESIDE
        {
            let text = format!(
                "plannedPath passes {:.1} m beside the last released node",
                beside.distance
            );
            self.complain("end", broken("PATH-04", seq, text), findings);
        }
    }

    fn next_metres(&mut self, path: &IntermediatePath, state: &StateView, seq: u64, findings: &mut Vec<CheckFinding>) {
        let points: Vec<_> = path.polyline.iter().take(POINTS).collect();
        if points.len() < 2 && state.driving.is(true) {
            let text = format!(
                "intermediatePath has {} waypoints while the vehicle drives",
                points.len()
            );
            self.complain("few", remark("PATH-06", seq, text), findings);
        }
        let first = points
            .first()
            .and_then(|point| Some((point.x.float()?, point.y.float()?)));
        if let Some(far) = first.and_then(|begin| off(state, begin)) {
            let text = format!("intermediatePath begins {far:.1} m from where the state says that the vehicle is");
            self.complain("first", broken("PATH-02", seq, text), findings);
        }
        let now = state
            .header
            .timestamp
            .text()
            .and_then(|text| text.parse::<jiff::Timestamp>().ok());
        let mut before: Option<jiff::Timestamp> = None;
        for eta in points.iter().filter_map(|point| point.eta.text()) {
            let Some(time) = eta
                .ends_with('Z')
                .then(|| eta.parse::<jiff::Timestamp>().ok())
                .flatten()
            else {
                let eta: String = eta.chars().take(40).collect();
                let text = format!("eta {eta:?} of a waypoint is no time in UTC");
                self.complain("form", broken("PATH-07", seq, text), findings);
                return;
            };
            if before.is_some_and(|before| time < before) {
                let text = "the eta of a waypoint is before that of the one before it";
                self.complain("falls", broken("PATH-07", seq, text), findings);
            }
            if now.is_some_and(|now| time.as_second() + PAST < now.as_second()) {
                let text = "the eta of a waypoint is more than ten seconds before the state";
                self.complain("past", remark("PATH-07", seq, text), findings);
            }
            before = Some(time);
        }
    }

    /// Whether the next metres are those of an earlier message of a vehicle that has moved meanwhile.
    fn renewed(&mut self, path: &IntermediatePath, spot: Option<Spot>, seq: u64, findings: &mut Vec<CheckFinding>) {
        let Some(spot) = spot else { return };
        let points: Vec<_> = path
            .polyline
            .iter()
            .take(POINTS)
            .map(|point| {
                let number = |member: &tck_view::Member<tck_view::Number>| member.float().unwrap_or_default();
                (number(&point.x), number(&point.y), point.eta.or_empty().to_owned())
            })
            .collect();
        if let Some((before, place)) = &self.before
            && *before == points
        {
            if place.distance(&spot) > MOVED {
                let text = "intermediatePath is the same as in a message before, and the vehicle has moved since";
                self.complain("kept", broken("PATH-08", seq, text), findings);
            }
            return;
        }
        self.before = Some((points, spot));
    }
}

/// The curve of a plannedPath; `None` where it has none.
pub(crate) fn curve_of(path: &PlannedPath) -> Option<(Option<tck_base::nurbs::Curve>, Vec<Flaw>)> {
    let trajectory = path.trajectory.there()?;
    curve(&tck_view::Member::There(Box::new(trajectory.clone())))
}

/// How far a place is from where the state says that the vehicle is, where that is too far.
fn off(state: &StateView, (x, y): (f64, f64)) -> Option<f64> {
    let pose = state.pose()?;
    let velocity = state.velocity.there();
    let axis = |member: fn(&Velocity) -> &tck_view::Member<tck_view::Number>| {
        velocity
            .and_then(|velocity| member(velocity).float())
            .unwrap_or_default()
    };
    let speed = axis(|velocity| &velocity.vx).hypot(axis(|velocity| &velocity.vy));
    let far = (pose.x - x).hypot(pose.y - y);
    (far > BESIDE + SAMPLING * speed.min(20.0)).then_some(far)
}

impl Running for Paths {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let seq = record.seq();
        if let Some(shown) = record.visualization() {
            if let Some(path) = shown.intermediate_path.there() {
                self.renewed(path, shown.pose().map(|pose| pose.spot()), seq, findings);
            }
            return false;
        }
        let Some(state) = record.state() else { return false };
        if let Some(path) = state.planned_path.there() {
            self.planned(path, state, seq, findings);
        }
        let Some(path) = state.intermediate_path.there() else {
            self.before = None;
            return state.planned_path.there().is_some();
        };
        self.next_metres(path, state, seq, findings);
        if state.driving.is(true) {
            self.renewed(path, state.pose().map(|pose| pose.spot()), seq, findings);
        } else {
            self.before = None;
        }
        true
    }
}

#[derive(Default)]
struct Own {
    /// Whether the factsheet names navigation along lines, and no other.
    on_lines: bool,
    told: bool,
}

impl Running for Own {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        if let Some(kinds) = navigation(record) {
            self.on_lines = !kinds.is_empty() && kinds.iter().all(|kind| kind.ends_with("LINE_GUIDED"));
        }
        let Some(state) = record.state().filter(|_| self.on_lines) else {
            return false;
        };
        let shares = !state.planned_path.is_absent() || !state.intermediate_path.is_absent();
        if shares && !self.told {
            self.told = true;
            let text = "a vehicle that navigates along lines shares a path of its own";
            findings.push(remark("PATH-09", record.seq(), text));
        }
        true
    }
}

#[derive(Default)]
struct OnEdges {
    /// Whether the factsheet names free navigation, and no other.
    free: bool,
    curved: Curved,
    /// The order that the harness has sent last.
    sent: Option<String>,
    told: bool,
}

impl Running for OnEdges {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        if let Some(kinds) = navigation(record) {
            self.free = !kinds.is_empty()
                && kinds
                    .iter()
                    .all(|kind| matches!(*kind, "AUTONOMOUS" | "FREELY_NAVIGATING"));
        }
        self.curved.hear(record);
        if let Some(order) = record.order_to_vehicle() {
            self.sent = Some(order.order_id.or_empty().to_owned());
        }
        let Some(state) = record.state().filter(|_| self.free) else {
            return false;
        };
        let order = state.order_id.or_empty();
        // Of an order that nobody has seen sent, it is not known what its edges have.
        if self.sent.as_deref() != Some(order) || self.curved.has(order) || !state.edge_states.is_there() {
            return false;
        }
        let mut edges = state.edge_states.iter().take(POINTS);
        let own = edges.find(|edge| edge.trajectory.presence().is_something());
        if let Some(edge) = own.filter(|_| !self.told) {
            self.told = true;
            let id = edge.edge_id.or_empty();
            let text = format!("edge {id:?} has a trajectory in the state, and none was sent");
            findings.push(broken("STATE-MSG-21", record.seq(), text));
        }
        !state.edge_states.elements().is_empty()
    }
}
