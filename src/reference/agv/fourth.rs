//! What only vehicles with faults or liberties of the fourth blind round remember and do.

use std::collections::VecDeque;
use std::time::Duration;

use serde_json::{Map, Value};

use super::Agv;
use super::action_kinds::Deed;
use super::actions::{Action, Origin, Status};
use super::book::Stop;
use super::faults::FaultName as F;
use super::motion;
use super::order_message::{Node, Order};
use super::tolerances::ToleranceName as T;
use crate::clock::Moment;
use crate::nurbs::Path;

/// How long a vehicle brakes that needs long for it.
pub(crate) const BRAKING: Duration = Duration::from_secs(2);

/// How long the only receive buffer is occupied by an order.
const OCCUPIED: Duration = Duration::from_millis(100);

/// So many states are kept while there is no link.
pub(crate) const BUFFER: usize = 50;

/// What is remembered.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fourth {
    /// sequenceId of the decision point of the first message of the order.
    first_base: u32,
    /// Behind these sequenceIds everything comes from updates, and from the last update.
    pub(crate) joints: Option<(u32, u32)>,
    /// When the last order message came.
    pub(crate) order_at: Option<Moment>,
    /// actionIds whose result was told.
    pub(crate) results_told: Vec<String>,
    /// When it shows that it does not charge any more.
    pub(crate) uncharged_at: Option<Moment>,
    /// States that could not be sent, and the timestamp of each.
    pub(crate) buffered: Vec<(String, Map<String, Value>)>,
    /// What was still to be traversed when the link broke.
    pub(crate) before_cut: VecDeque<Stop>,
    /// Nodes that were traversed without a link and are listed all the same.
    pub(crate) relisted: Vec<Stop>,
    /// sequenceIds of edges whose actions run on.
    edges_left: Vec<u32>,
    /// It brakes for a pause.
    pub(crate) braking: bool,
    /// actionIds of further cancelOrder actions that end with the first.
    cancels: Vec<String>,
}

impl Fourth {
    /// A new order was taken over.
    pub(crate) fn new_order(&mut self, base_end: u32) {
        self.first_base = base_end;
        self.joints = None;
        self.results_told.clear();
        self.before_cut.clear();
        self.relisted.clear();
        self.edges_left.clear();
        self.cancels.clear();
    }
}

/// Whether the edges of the base are one less than its nodes, and a horizon follows.
pub(crate) fn base_counts(order: &Order) -> bool {
    let nodes = order.nodes.iter().filter(|node| node.released).count();
    let edges = order.edges.iter().filter(|edge| edge.released).count();
    nodes < order.nodes.len() && edges + 1 == nodes
}

/// The way from control point to control point of a trajectory.
pub(crate) fn control_polygon(trajectory: &Value) -> Path {
    let points = trajectory.get("controlPoints").and_then(Value::as_array);
    let number = |point: &Value, key: &str| point.get(key).and_then(Value::as_f64);
    Path::through(
        points
            .into_iter()
            .flatten()
            .filter_map(|point| number(point, "x").zip(number(point, "y"))),
    )
}

impl Agv {
    /// Whether the order came just before, and is still in the only receive buffer.
    pub(crate) fn receive_buffer_is_full(&self) -> bool {
        let occupied = |at: Moment| self.moment().since(at) < OCCUPIED;
        self.faults.has(F::R4DropsMessageRightAfterAnother) && self.fourth.order_at.is_some_and(occupied)
    }

    /// Whether it has been updated once and is still on its way to the decision point it had first.
    pub(crate) fn waits_for_first_base(&self) -> bool {
        let mut nodes = self.book.nodes.iter();
        self.book.updated && nodes.any(|stop| stop.node.sequence_id == self.fourth.first_base)
    }

    /// An update is taken over: remembers where it joins.
    pub(crate) fn note_joint(&mut self) {
        let joint = self.book.base_end.1;
        let first = self.fourth.joints.map_or(joint, |(first, _)| first);
        self.fourth.joints = Some((first, joint));
        self.fourth.relisted.clear();
    }

    /// Forgets the base behind the next node.
    pub(crate) fn shorten_base(&mut self) {
        let Some(next) = self.book.nodes.front().filter(|stop| stop.node.released) else {
            return;
        };
        let (end, old) = ((next.node.id.clone(), next.node.sequence_id), self.book.base_end.1);
        let gone = |sequence_id: u32| sequence_id > end.1 && sequence_id <= old;
        self.book.nodes.retain(|stop| !gone(stop.node.sequence_id));
        self.book.edges.retain(|edge| !gone(edge.sequence_id));
        self.actions.retain(|action| match action.origin {
            Origin::Node(sequence_id) | Origin::Edge(sequence_id) => !gone(sequence_id),
            Origin::Instant => true,
        });
        self.book.base_end = end;
    }

    /// Whether theta is out of reach for somebody who forgets that angles repeat themselves.
    pub(crate) fn turned_by_plain_difference(&self, node: &Node, theta: f64) -> bool {
        let Some(position) = &node.position else { return false };
        let Some(wanted) = position.theta else { return false };
        let allowed = position.allowed_deviation_theta.unwrap_or(0.0);
        let allowed = allowed.max(self.config.tolerance_theta);
        let plain = (wanted - theta).abs();
        plain > allowed && motion::wrapped(wanted - theta).abs() <= allowed
    }

    /// Whether a new order begins where the last one ended, and the old number is kept for it.
    pub(crate) fn keeps_sequence(&self, stop: &Stop) -> bool {
        let stays = stop.node.sequence_id == 0 && self.book.previous.0 == stop.node.id;
        stays && self.faults.has(F::R4LastSequenceOfOldOrderKept)
    }

    /// Whether the actions of an edge that is left go on because the vehicle does.
    pub(crate) fn lets_edge_actions_run_on(&mut self, sequence_id: u32) -> bool {
        let passes = self.book.nodes.front().is_some_and(|next| next.node.released);
        let runs_on = passes && self.faults.has(F::R4EdgeActionEndsWithTheOrderOnly);
        if runs_on {
            self.fourth.edges_left.push(sequence_id);
        }
        runs_on
    }

    /// At the end of the base also the actions of edges left before end.
    pub(crate) fn end_edge_actions_where_it_stops(&mut self) {
        if self.book.nodes.front().is_some_and(|next| next.node.released) {
            return;
        }
        for sequence_id in std::mem::take(&mut self.fourth.edges_left) {
            self.actions.leave_edge(sequence_id, self.faults, Status::Finished);
        }
    }

    /// The results in a state that is sent will not be told again. They are not missed in the next state either.
    pub(crate) fn note_results(&mut self, kept: &mut Map<String, Value>) {
        let told = self.actions.iter().filter(|action| action.result.is_some());
        let told: Vec<String> = told.map(|action| action.request.id.clone()).collect();
        self.fourth.results_told = told;
        let states = kept.get_mut("actionStates").and_then(Value::as_array_mut);
        for state in states.into_iter().flatten().filter_map(Value::as_object_mut) {
            state.remove("resultDescription");
        }
    }

    /// Whether it does not pause because it has no order.
    pub(crate) fn has_nothing_to_pause(&self) -> bool {
        let idle = self.book.nodes.is_empty() && !self.actions.order_unfinished();
        idle && self.faults.has(F::R4PauseFailsWithoutOrder)
    }

    /// An action ends during a pause: it drives on as if it had stood for the action only.
    pub(crate) fn forget_pause_after(&mut self, id: &str) {
        let of_node = |action: &Action| matches!(action.origin, Origin::Node(_));
        let ended = self.holds.pause && self.actions.get(id).is_some_and(of_node);
        self.book.heedless |= ended && self.faults.has(F::R4PauseForgottenAfterNodeAction);
    }

    /// The link is back: sends what could not be sent.
    pub(crate) fn replay_buffer(&mut self) {
        for (timestamp, mut body) in std::mem::take(&mut self.fourth.buffered) {
            // What the body says goes before the header.
            body.insert("timestamp".into(), Value::from(timestamp));
            self.publish("state", body);
        }
    }

    /// The link is back: what was traversed without it is listed again.
    pub(crate) fn relist_nodes(&mut self, first: bool) {
        if first || !self.faults.has(F::R4ReconnectRelistsTraversedNodes) {
            return;
        }
        let ahead = |stop: &Stop| {
            let mut nodes = self.book.nodes.iter();
            nodes.any(|other| other.node.sequence_id == stop.node.sequence_id)
        };
        let before = self.fourth.before_cut.iter();
        self.fourth.relisted = before.filter(|stop| !ahead(stop)).cloned().collect();
    }

    /// Whether the action is a pause that begins with braking.
    pub(crate) fn brakes_long(&self, action: &Action) -> bool {
        let pause = action.kind.is_some_and(|kind| kind.deed == Deed::StartPause);
        pause && self.takes(T::R4BrakesLongOnPause)
    }

    /// Begins to brake; the rest of the leg is planned anew.
    pub(crate) fn brake_if_slow(&mut self, id: &str) {
        let brakes = self.actions.get(id).is_some_and(|action| self.brakes_long(action));
        if brakes && self.motion.is_moving() {
            let moment = self.moment();
            self.motion.halt(moment);
            self.fourth.braking = true;
        }
    }

    /// It has braked, or need not any more.
    pub(crate) fn end_braking(&mut self) {
        if std::mem::take(&mut self.fourth.braking) {
            let moment = self.moment();
            self.motion.halt(moment);
        }
    }

    /// A further cancelOrder while one is under way.
    pub(crate) fn cancels_together(&mut self, action_id: &str) {
        if let Some(action) = self.actions.get_mut(action_id) {
            action.status = Status::Running;
            self.fourth.cancels.push(action_id.to_owned());
        }
    }

    /// The cancellation has ended for all who asked for it.
    pub(crate) fn end_further_cancels(&mut self) {
        for id in std::mem::take(&mut self.fourth.cancels) {
            if let Some(action) = self.actions.get_mut(&id) {
                action.end(Status::Finished);
            }
        }
    }
}
