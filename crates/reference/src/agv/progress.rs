//! Driving the order: setting out, arriving, traversing, and beginning actions (sections 6.10.2 and 6.12).
//!
//! Which way a leg leads, and how fast, stands in `way`. A node counts as traversed inside its deviation range, and
//! what that is without one the vehicle decides (the ruling of NODE-01). What stops the vehicle on an edge stops it on
//! the edge, not on the node before (that of NODE-07); behind it the condition is as before (that of ACT-03).

use std::f64::consts::PI;

use super::Agv;
use super::action_kinds::Effect;
use super::actions::Origin;
use super::hook_points::{Event, Hindrance, Permission};
use super::order_message::Edge;
use super::order_state::Stop;
use super::way::Course;
use super::{motion, way};
use tck_base::nurbs::Path;

/// An orientation is right within this, in radians.
pub(crate) const ALIGNED: f64 = 1e-3;

/// No orientation is asked for more exactly than this, in radians.
const EXACT: f64 = 1e-6;

/// Shorter ways are none, in metres.
pub(crate) const NOWHERE: f64 = 1e-6;

impl Agv {
    /// Draws all consequences that need no time.
    pub(crate) fn settle(&mut self) {
        for _ in 0..10_000 {
            let progress = self.watch_zones()
                | self.watch_corridor()
                | self.tend_requests()
                | self.begin_waiting_instants()
                | self.begin_triggered()
                | self.drive()
                | self.settle_cancel()
                | self.settle_mode()
                | self.settle_sleep();
            if !progress {
                break;
            }
        }
    }

    /// Begins actions of the order whose turn it is. A held vehicle begins nothing.
    fn begin_triggered(&mut self) -> bool {
        if !self.allows(Permission::Act, !self.holds.any()) {
            return false;
        }
        let ids = self.next_actions();
        for id in &ids {
            self.begin_action(id);
        }
        !ids.is_empty()
    }

    /// Whether nothing forbids driving now.
    pub(crate) fn may_drive(&self) -> bool {
        let cancelled = match &self.order.cancel {
            Some(cancel) => !cancel.to_node,
            None => self.order.cancelled,
        };
        let hindrances = [
            (
                Hindrance::Mode,
                !self.mode.takes_orders() || self.awaited_mode.is_some() || self.sleep.awaited.is_some(),
            ),
            (Hindrance::Hold, self.holds.any()),
            (Hindrance::Lost, self.lost),
            (Hindrance::Cancellation, cancelled),
            (Hindrance::Action, self.actions_forbid_driving()),
        ];
        let stops = |(what, there): (Hindrance, bool)| there && !self.allows(Permission::DriveAgainst(what), false);
        !hindrances.into_iter().any(stops) && self.lingers_until.is_none() && self.allows(Permission::Drive, true)
    }

    /// The next node, if it may be driven to (ORD-07).
    pub(crate) fn next_stop(&self) -> Option<&Stop> {
        let next = self.order.nodes.front();
        next.filter(|stop| self.allows(Permission::Enter, stop.node.released))
    }

    /// The next thing the vehicle does on its way, if it may; whether it did something.
    fn drive(&mut self) -> bool {
        if !self.may_drive() {
            let (moment, moving) = (self.moment(), self.motion.is_moving());
            if moving {
                self.motion.halt(moment);
            }
            return moving;
        }
        if self.motion.is_moving() {
            return false;
        }
        match self.next_stop().cloned() {
            Some(stop) if self.motion.reached => self.arrive(&stop),
            Some(stop) => self.set_out(&stop),
            None => false,
        }
    }

    /// Goes on towards the next node.
    fn set_out(&mut self, stop: &Stop) -> bool {
        if self.drive_back() {
            return true;
        }
        let edge = self.order.edge_ahead().cloned();
        let blocked = edge.as_ref().is_some_and(|edge| self.is_blocked(edge));
        let given_up = self.order.unreachable && !self.allows(Permission::TryAgain, false);
        if blocked || given_up || !self.allows(Permission::SetOut(stop), true) {
            return edge.is_some_and(|edge| blocked && self.replans(&edge, stop));
        }
        if let Some(edge) = &edge {
            self.choose_way(edge, stop);
        }
        let pose = self.motion.pose(self.moment());
        let curve = edge.as_ref().and_then(|edge| self.curve_ahead(edge, stop));
        let straight = pose.distance(stop.place.x, stop.place.y);
        let distance = curve.as_ref().map_or(straight, Path::length);
        let course = self.course(edge.as_ref(), stop, curve.as_ref());
        let theta = motion::wrapped(course.heading + if course.backwards { PI } else { 0.0 });
        let aligned = distance < NOWHERE || motion::wrapped(theta - pose.theta).abs() <= ALIGNED;
        let aligned = self.allows(Permission::RollAsTurned, aligned);
        let turns_before = edge.as_ref().is_some_and(|edge| edge.rotation_allowed == Some(false));
        let backwards = course.backwards;
        self.charging = false;
        if !aligned && turns_before && !self.order.entered {
            self.turn_to(theta, edge.as_ref());
            return true;
        }
        if let Some(edge) = edge.as_ref().filter(|_| !self.order.entered) {
            self.enter(edge);
        }
        if distance < NOWHERE {
            self.motion.reached = true;
        } else if aligned {
            if let Some((edge, way)) = edge.as_ref().zip(curve.as_ref()) {
                self.takes_way(edge, way);
            }
            return self.roll(edge.as_ref(), stop, (distance, backwards), curve);
        } else {
            self.turn_to(theta, edge.as_ref());
        }
        true
    }

    /// Which way leads to the next node (ORD-MSG-22).
    fn course<'a>(&self, edge: Option<&'a Edge>, stop: &Stop, curve: Option<&Path>) -> Course<'a> {
        let pose = self.motion.pose(self.moment());
        let straight = (stop.place.y - pose.y).atan2(stop.place.x - pose.x);
        let begin = curve.and_then(|curve| curve.at(0.0));
        let heading = begin.map_or(straight, |begin| begin.heading);
        let mut course = Course {
            edge,
            curved: curve.is_some(),
            straight,
            heading,
            backwards: edge.is_some_and(|edge| way::is_backwards(edge, heading)),
        };
        self.steers(&mut course);
        course
    }

    /// Enters an edge; its actions are triggered, at once if they do not stop the vehicle (NODE-06, NODE-07).
    fn enter(&mut self, edge: &Edge) {
        self.order.entered = true;
        self.happens(Event::EdgeEntered(edge.sequence_id));
        if !self.stops_on_edge(edge.sequence_id) {
            self.trigger_actions(Origin::Edge(edge.sequence_id));
        }
        self.happens(Event::OnEdge);
    }

    /// A leg has ended: on an edge with actions that stop the vehicle, they begin now.
    pub(crate) fn leg_finished(&mut self, rolled: bool) {
        if !rolled || self.motion.reached || !self.order.entered {
            return;
        }
        self.happens(Event::LegEnded);
        let Some(sequence_id) = self.order.edge_ahead().map(|edge| edge.sequence_id) else {
            return;
        };
        if self.stops_on_edge(sequence_id) {
            self.trigger_actions(Origin::Edge(sequence_id));
        }
    }

    /// At the position of a node: turns to its orientation, then counts it as traversed (NODE-01).
    fn arrive(&mut self, stop: &Stop) -> bool {
        let position = stop.node.position.as_ref();
        let wanted = position.and_then(|position| position.theta);
        if let Some(theta) = self.faces(stop, wanted) {
            let allowed = position.and_then(|position| position.allowed_deviation_theta);
            let allowed = match allowed.filter(|allowed| *allowed > 0.0) {
                Some(allowed) => allowed.max(EXACT),
                None => self.config.reach_theta,
            };
            if motion::wrapped(theta - self.motion.pose(self.moment()).theta).abs() > allowed {
                let edge = self.order.edge_ahead().cloned();
                self.turn_to(theta, edge.as_ref());
                return true;
            }
        }
        self.traverse();
        true
    }

    /// Reports a node traversed, leaves the edge, and triggers the node's actions (NODE-03, NODE-04, NODE-05).
    fn traverse(&mut self) {
        let Some(stop) = self.order.nodes.pop_front() else {
            return;
        };
        let sequence_id = stop.node.sequence_id;
        self.motion.reached = false;
        self.order.entered = false;
        let behind = |edge: &Edge| edge.sequence_id < sequence_id;
        while self.order.edges.front().is_some_and(behind) {
            if let Some(edge) = self.order.edges.pop_front() {
                self.leave(edge);
            }
        }
        self.motion.set_map(stop.place.map_id.clone());
        self.happens(Event::NodeReached(sequence_id));
        if self.allows(Permission::Note(&stop), true) {
            self.order.previous = (self.order.last_node.clone(), self.order.last_sequence);
            self.order.last_node = self.mark_below().unwrap_or_else(|| stop.node.id.clone());
            self.order.last_sequence = sequence_id;
        }
        self.order.left.0 = Some(stop);
        self.happens(Event::NodeNoted(sequence_id));
        if self.order.cancel.is_none() {
            self.trigger_actions(Origin::Node(sequence_id));
        }
        self.happens(Event::NodePassed(sequence_id));
    }

    /// Leaves an edge: what is not done of its actions ends (NODE-05).
    fn leave(&mut self, edge: Edge) {
        let sequence_id = edge.sequence_id;
        if self.allows(Permission::LeaveEdge, true) {
            self.end_edge_actions(sequence_id);
        }
        self.order.left.1 = Some(edge);
        self.happens(Event::EdgeLeft(sequence_id));
    }

    /// Whether the warning lights are on: as long as it is on the edge (ACT-03).
    pub(crate) fn is_flashing(&self) -> bool {
        self.is_at(&[Effect::WarningLights])
    }

    /// Whether the vehicle is lifting.
    pub(crate) fn is_lifting(&self) -> bool {
        self.is_at(&[Effect::Pick, Effect::Drop])
    }

    fn is_at(&self, effects: &[Effect]) -> bool {
        let mut active = self.actions.iter().filter(|action| action.status.is_active());
        active.any(|action| action.kind.is_some_and(|kind| effects.contains(&kind.effect)))
    }
}
