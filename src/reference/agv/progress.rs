//! Driving the order: setting out, arriving, traversing, and beginning actions (sections 6.10.2 and 6.12).

use std::f64::consts::{FRAC_PI_2, PI};
use std::time::Duration;

use super::action_kinds::Deed;
use super::actions::Origin;
use super::book::Stop;
use super::faults::FaultName as F;
use super::motion::Facing;
use super::order_message::{Blocking, Edge};
use super::tolerances::ToleranceName as T;
use super::{Agv, Mode, motion};
use crate::nurbs::Path;

/// An orientation is right within this, in radians.
const ALIGNED: f64 = 1e-3;

/// No orientation is asked for more exactly than this, in radians.
const EXACT: f64 = 1e-6;

/// How far onto an edge the vehicle rolls out before an action that stops it begins, in metres.
const BRAKING: f64 = 0.3;

/// How long a vehicle stands on a node that may do so.
const LINGERING: Duration = Duration::from_millis(100);

/// How fast the vehicle ends a way it has reported already, in metres per second.
const CREEPING: f64 = 0.5;

/// How far from a node it stops that allows that, in metres.
const SHORT: f64 = 0.08;

impl Agv {
    /// Stands on the first node of a new order for a moment (`first-node-listed` only).
    pub(crate) fn linger_on_first_node(&mut self) {
        if self.takes(T::FirstNodeListed) && self.motion.reached {
            self.lingers_until = Some(self.moment() + LINGERING);
        }
    }

    /// Draws all consequences that need no time.
    pub(crate) fn settle(&mut self) {
        for _ in 0..10_000 {
            let progress = self.watch_corridor()
                | self.begin_deferred()
                | self.begin_triggered()
                | self.drive()
                | self.settle_cancel();
            if !progress {
                break;
            }
        }
        self.book.asked |= self.book.base_runs_low();
    }

    /// Begins actions of the order whose turn it is. A held vehicle begins nothing.
    fn begin_triggered(&mut self) -> bool {
        let offline = !self.connection.online && self.faults.has(F::R1ActionsHeldOffline);
        let offline = offline || self.mode == Mode::Semiautomatic && self.faults.has(F::R3SemiautomaticActionsHeld);
        if self.holds.any() || offline || self.faults.has(F::ActionsIgnored) {
            return false;
        }
        let ids = self.actions.startable(self.faults);
        for id in &ids {
            self.begin_action(id);
        }
        !ids.is_empty()
    }

    /// Whether anything forbids driving now.
    fn may_drive(&self) -> bool {
        let rolling_out = self.faults.has(F::PauseDrivesOn) && self.book.entered;
        let held = self.holds.any() && !((rolling_out || self.book.heedless) && self.holds.pause);
        let stopped = self.holds.button || self.holds.emergency || self.holds.field || self.holds.defect;
        let held = held && !(self.third.braking.is_some() && self.holds.pause && !stopped);
        let cancelled = match &self.book.cancel {
            Some(cancel) => {
                let rolls_on = self.faults.has(F::CancelDrivesOn) || self.faults.has(F::CancelFinishedMoving);
                let rolls_on = rolls_on || self.book.updated && self.faults.has(F::R3CancelAfterUpdateDrivesOn);
                !cancel.to_node && !rolls_on
            }
            None => self.book.cancelled && !self.faults.has(F::CancelFinishedMoving),
        };
        let offline = !self.connection.online && self.faults.has(F::StopsOnLinkLoss);
        let stuck = self.faults.has(F::StuckAfterBlocking) && self.blocking_action_ended();
        let stuck = stuck || self.faults.has(F::StuckAfterEdgeAction) && self.blocking_edge_action_ended();
        let warned = self.faults.has(F::WarningBlocks) && !self.errors.is_empty();
        let by_hand = self.faults.has(F::ManualDrivesOrders)
            || self.faults.has(F::ManualDrivesOn)
            || self.faults.has(F::ManualDrivesUnseen);
        (self.mode.takes_orders() || by_hand)
            && !self.persona.halted
            && !self.persona.lost
            && self.lingers_until.is_none()
            && !held
            && !cancelled
            && !offline
            && !stuck
            && !self.sixth.waits_again()
            && !self.book.stunned
            && !warned
            && (!self.actions.block_driving(self.faults)
                || self.book.unblocked
                || self.book.updated && self.faults.has(F::UpdateBreaksBlocking))
    }

    fn blocking_action_ended(&self) -> bool {
        let here = Origin::Node(self.book.last_sequence);
        let mut actions = self.actions.iter().filter(|action| action.origin == here);
        actions.any(|action| action.request.blocking != Blocking::None && action.status.is_terminal())
    }

    fn blocking_edge_action_ended(&self) -> bool {
        let Some(here) = self.book.edge_ahead().map(|edge| Origin::Edge(edge.sequence_id)) else {
            return false;
        };
        let mut actions = self.actions.iter().filter(|action| action.origin == here);
        actions.any(|action| action.request.blocking != Blocking::None && action.status.is_terminal())
    }

    /// Whether the next node may be driven to (ORD-07).
    fn is_released(&self, stop: &Stop) -> bool {
        let ignored =
            self.faults.has(F::HorizonDriven) || (self.faults.has(F::HorizonDrivenOffline) && !self.connection.online);
        stop.node.released || ignored || self.book.slipped || self.book.unbound
    }

    /// The next thing the vehicle does on its way, if it may; whether it did something.
    fn drive(&mut self) -> bool {
        let moment = self.moment();
        if !self.may_drive() {
            let moving = self.motion.is_moving();
            if moving {
                self.motion.halt(moment);
            }
            return moving;
        }
        if self.motion.is_moving() {
            return false;
        }
        let Some(stop) = self.book.nodes.front().filter(|stop| self.is_released(stop)).cloned() else {
            return self.roll_out();
        };
        if self.motion.reached {
            self.arrive(&stop)
        } else {
            self.set_out(&stop)
        }
    }

    /// Goes on towards the next node.
    fn set_out(&mut self, stop: &Stop) -> bool {
        // Stranded between two nodes, it would be of no use for any further test.
        let early_end = stop.node.sequence_id == self.book.base_end.1
            && self.faults.has(F::StopsBeforeEndOfBase)
            && self.config.node(&self.book.last_node).is_some();
        let alone = self.book.base_end.1 == 0 && self.config.node(&stop.node.id).is_none();
        let unreached = alone && self.faults.has(F::TemporaryNodeNotReached);
        let undriven = self.faults.has(F::ContinuationNotDriven) && self.book.continued;
        let stuck = self.book.stuck_at == Some(self.book.last_sequence);
        let parked = !self.connection.online && !self.book.entered && self.faults.has(F::R2NextEdgeNotEnteredOffline);
        let stuck = stuck || parked && self.book.edge_ahead().is_some();
        if early_end || unreached || undriven || stuck || self.faults.has(F::NeverStarts) {
            return false;
        }
        let moment = self.moment();
        let edge = self.book.edge_ahead().cloned();
        let pose = self.motion.pose(moment);
        if edge.as_ref().is_some_and(|edge| self.is_blocked(edge)) {
            return false;
        }
        let curve = edge.as_ref().and_then(|edge| self.curve_ahead(edge, stop));
        let straight = pose.distance(stop.place.x, stop.place.y);
        let distance = curve.as_ref().map_or(straight, Path::length);
        let (theta, backwards) = self.course(edge.as_ref(), stop, curve.as_ref());
        let aligned = self.turns_late() || distance < 1e-6 || motion::wrapped(theta - pose.theta).abs() <= ALIGNED;
        let turns_before = edge.as_ref().is_some_and(|edge| edge.rotation_allowed == Some(false));
        self.charging = false;
        self.third.charging_at = None;
        if !aligned && turns_before && !self.book.entered {
            self.turn_to(theta, edge.as_ref());
            return true;
        }
        if let Some(edge) = edge.as_ref().filter(|_| !self.book.entered) {
            self.enter(edge, stop);
        }
        if distance < 1e-6 {
            self.motion.reached = true;
        } else if aligned {
            self.roll(edge.as_ref(), stop, (distance, backwards), curve);
        } else {
            self.turn_to(theta, edge.as_ref());
        }
        true
    }

    /// Enters an edge; its actions are triggered, at once if they do not stop the vehicle (NODE-06, NODE-07).
    fn enter(&mut self, edge: &Edge, stop: &Stop) {
        self.book.entered = true;
        if edge.sequence_id == 1 && self.faults.has(F::R2FirstEdgeActionsFail) {
            let of_edge = self
                .actions
                .iter_mut()
                .filter(|action| action.origin == Origin::Edge(1));
            of_edge.for_each(|action| action.end(super::actions::Status::Failed));
        }
        if self.faults.has(F::NoneAborted) {
            self.actions.leave_node(self.book.last_sequence);
        }
        if !self.actions.edge_stops(edge.sequence_id, self.faults) && !self.faults.has(F::EdgeActionsLate) {
            self.actions.trigger(Origin::Edge(edge.sequence_id), self.faults);
        }
        if self.faults.has(F::NodeActionsEarly) {
            self.actions.trigger(Origin::Node(stop.node.sequence_id), self.faults);
        }
    }

    fn roll(&mut self, edge: Option<&Edge>, stop: &Stop, (distance, backwards): (f64, bool), curve: Option<Path>) {
        let moment = self.moment();
        let pose = self.motion.pose(moment);
        let stops = edge.is_some_and(|edge| self.actions.edge_stops(edge.sequence_id, self.faults));
        let (way, to_node) = match stops && !self.faults.has(F::EdgeActionsLate) {
            true => (BRAKING.min(distance / 4.0), false),
            false if self.stops_before(&stop.node.id) => (distance / 2.0, false),
            false if self.turns_late() => (distance / 3.0, false),
            false if self.stops_short(stop) && distance > 1.0 => {
                (distance - SHORT.min(self.config.tolerance * 0.8), true)
            }
            false if let Some(allowed) = self.early_by(stop) => ((distance - allowed).max(distance / 2.0), true),
            false if self.ends_early(stop) => ((distance - 0.5).max(distance / 2.0), true),
            false if self.faults.has(F::TraversedEarly) => ((distance - 0.5).max(distance / 2.0), true),
            false => (distance, true),
        };
        let part = way / distance;
        let to = (
            pose.x + (stop.place.x - pose.x) * part,
            pose.y + (stop.place.y - pose.y) * part,
        );
        let to = if part < 1.0 { to } else { (stop.place.x, stop.place.y) };
        let permitted = edge
            .and_then(|edge| edge.max_speed)
            .filter(|_| !self.faults.has(F::MaxSpeedIgnored) && !self.book.hurried)
            .filter(|_| !(backwards && self.faults.has(F::R3MaxSpeedIgnoredBackwards)));
        let permitted = if self.faults.has(F::R1MaxSpeedOfEdgeBefore) {
            self.book.left.1.as_ref().and_then(|left| left.max_speed)
        } else {
            permitted
        };
        let own = match self.mode {
            Mode::Semiautomatic if self.faults.has(F::SemiautomaticFaster) => self.config.speed * 2.0,
            Mode::Semiautomatic if self.takes(T::R1SemiautomaticAtFullSpeed) => self.config.speed,
            Mode::Semiautomatic => self.config.speed / 2.0,
            _ if self.book.slipped && self.faults.has(F::HorizonCreptInto) => self.config.speed / 40.0,
            _ if self.book.slipped => self.config.speed * 4.0,
            _ => self.config.speed,
        };
        let own = if self.fourth.braking { own / 20.0 } else { own };
        let share = if self.takes(T::R3KeepsBelowMaxSpeed) { 0.8 } else { 1.0 };
        let speed = permitted.map_or(own, |permitted| (permitted * share).min(own));
        let Some(curve) = curve else {
            self.motion.roll(moment, to, speed, backwards, to_node);
            return;
        };
        let facing = match () {
            () if self.faults.has(F::TangentIgnored) => Facing::Fixed(pose.theta),
            () if backwards => Facing::Along(PI),
            () => Facing::Along(0.0),
        };
        self.motion.follow(moment, curve.first(way), speed, facing, to_node);
    }

    /// `r3-zero-deviation-unlimited`: takes an allowed deviation of 0 for none given.
    fn ends_early(&self, stop: &Stop) -> bool {
        let position = stop.node.position.as_ref();
        let allowed = position.and_then(|position| position.allowed_deviation);
        allowed == Some(0.0) && self.faults.has(F::R3ZeroDeviationUnlimited)
    }

    /// Whether it may stand a little beside the node, and does so.
    fn stops_short(&self, stop: &Stop) -> bool {
        let position = stop.node.position.as_ref();
        let allowed = position.and_then(|position| position.allowed_deviation);
        self.takes(T::R1StopsShortOfNode) && allowed.is_some_and(|allowed| allowed > 2.0 * SHORT)
    }

    /// `traversed-early`: the rest of the way to the last node, which is reported already.
    fn roll_out(&mut self) -> bool {
        let Some(left) = self
            .book
            .left
            .0
            .as_ref()
            .filter(|left| self.faults.has(F::TraversedEarly) || self.ends_early(left))
        else {
            return false;
        };
        let to = (left.place.x, left.place.y);
        let moment = self.moment();
        let rolls = self.motion.pose(moment).distance(to.0, to.1) > 1e-6;
        if rolls {
            self.motion.roll(moment, to, CREEPING, false, false);
        }
        rolls
    }

    /// `turns-on-edge`: rolls on as it stands, until the node it left is well behind.
    fn turns_late(&self) -> bool {
        let pose = self.motion.pose(self.moment());
        let behind = |left: &Stop| pose.distance(left.place.x, left.place.y) > 0.2;
        self.faults.has(F::TurnsOnEdge) && !self.book.left.0.as_ref().is_some_and(behind)
    }

    /// Begins to turn. Which way round is the vehicle's own affair.
    fn turn_to(&mut self, theta: f64, edge: Option<&Edge>) {
        let (moment, speed) = (self.moment(), self.rotation_speed(edge));
        let far = motion::wrapped(theta - self.motion.pose(moment).theta).abs() > 0.5;
        if far && self.takes(T::R2TurnsTheLongWay) {
            self.motion.turn_round(moment, theta, speed);
        } else {
            self.motion.turn(moment, theta, speed);
        }
    }

    fn rotation_speed(&self, edge: Option<&Edge>) -> f64 {
        let permitted = edge.and_then(|edge| edge.max_rotation_speed);
        let permitted = permitted.filter(|_| !self.faults.has(F::MaxRotationSpeedIgnored));
        permitted.map_or(self.config.rotation_speed, |permitted| {
            permitted.min(self.config.rotation_speed)
        })
    }

    /// The orientation on the way to a node, and whether it drives backwards (ORD-MSG-22).
    fn course(&self, edge: Option<&Edge>, stop: &Stop, curve: Option<&Path>) -> (f64, bool) {
        let pose = self.motion.pose(self.moment());
        let straight = (stop.place.y - pose.y).atan2(stop.place.x - pose.x);
        let begin = curve
            .filter(|_| !self.faults.has(F::TangentIgnored))
            .and_then(|curve| curve.at(0.0));
        let heading = begin.map_or(straight, |begin| begin.heading);
        let wanted = edge.filter(|_| !self.faults.has(F::EdgeOrientationIgnored));
        let tangential = self.faults.has(F::R1GlobalAsTangential);
        let forwards = |edge: &&Edge| {
            let turned = edge
                .orientation
                .is_some_and(|angle| motion::wrapped(angle).abs() > FRAC_PI_2);
            turned && !edge.global && self.faults.has(F::R6BackwardsEdgeDrivenForwards)
        };
        let wanted = wanted.filter(|edge| !forwards(edge));
        let relative = wanted.and_then(|edge| {
            edge.orientation.map(|orientation| {
                if edge.global && !tangential {
                    orientation - heading
                } else {
                    orientation
                }
            })
        });
        let behind = motion::wrapped(heading - pose.theta).abs() > FRAC_PI_2 + 0.1;
        let backs_up = behind && edge.is_some() && curve.is_none() && self.takes(T::R2BacksUp);
        let backwards = relative.map_or(backs_up, |relative| motion::wrapped(relative).abs() > FRAC_PI_2);
        let theta = if backwards { heading + PI } else { heading };
        (motion::wrapped(theta), backwards)
    }

    /// A leg has ended: on an edge with actions that stop the vehicle, they begin now.
    pub(crate) fn leg_finished(&mut self, rolled: bool) {
        if !rolled || self.motion.reached || !self.book.entered {
            return;
        }
        let ahead = self.book.nodes.front();
        if ahead.is_some_and(|stop| self.stops_before(&stop.node.id)) {
            (self.persona.halted, self.persona.stop_before) = (true, None);
        }
        let Some(sequence_id) = self.book.edge_ahead().map(|edge| edge.sequence_id) else {
            return;
        };
        if self.actions.edge_stops(sequence_id, self.faults) {
            self.actions.trigger(Origin::Edge(sequence_id), self.faults);
        }
    }

    /// At the position of a node: turns to its orientation, then counts it as traversed (NODE-01).
    fn arrive(&mut self, stop: &Stop) -> bool {
        let position = stop.node.position.as_ref();
        let ends = stop.node.sequence_id > 0 && stop.node.sequence_id == self.book.base_end.1;
        let own = (ends && self.takes(T::R2OwnOrientationAtEnd)).then_some(0.0);
        if let Some(theta) = position
            .and_then(|position| position.theta.or(own))
            .filter(|_| !self.faults.has(F::ThetaIgnored))
            .filter(|_| {
                let fixed = self.book.edge_ahead().and_then(|edge| edge.rotation_allowed) == Some(false);
                !(fixed && self.faults.has(F::R2NoTurnAfterFixedEdge))
            })
            .filter(|_| stop.node.sequence_id == self.book.base_end.1 || !self.faults.has(F::R1ThetaAtEndOnly))
        {
            let allowed = position
                .and_then(|position| position.allowed_deviation_theta)
                .unwrap_or(0.0);
            let allowed = if allowed > 0.0 {
                allowed.max(EXACT)
            } else {
                self.config.tolerance_theta
            };
            let off = motion::wrapped(theta - self.motion.pose(self.moment()).theta).abs();
            let off = match self.faults.has(F::R3ThetaTakenAsAxis) {
                true => off.min(PI - off),
                false => off,
            };
            if off > allowed {
                let edge = self.book.edge_ahead().cloned();
                self.turn_to(theta, edge.as_ref());
                return true;
            }
        }
        self.traverse();
        true
    }

    /// Reports a node traversed, leaves the edge, and triggers the node's actions (NODE-03, NODE-04, NODE-05).
    fn traverse(&mut self) {
        let Some(stop) = self.book.nodes.pop_front() else {
            return;
        };
        let sequence_id = stop.node.sequence_id;
        if self.takes(T::StopsOnNodes) {
            self.lingers_until = Some(self.moment() + LINGERING);
        }
        self.motion.reached = false;
        self.book.entered = false;
        self.book.hurried = false;
        self.book.unblocked = false;
        let behind = |edge: &Edge| edge.sequence_id < sequence_id;
        while self.book.edges.front().is_some_and(behind) {
            let Some(edge) = self.book.edges.pop_front() else { break };
            if self.faults.has(F::EdgeActionsLate) {
                self.actions.trigger(Origin::Edge(edge.sequence_id), self.faults);
            } else if self.lets_edge_actions_run_on(edge.sequence_id) {
                // They end where it stops.
            } else if !self.faults.has(F::EdgeActionOutlivesEdge) {
                let cut = if self.takes(T::R1CutEdgeActionsFail) {
                    super::actions::Status::Failed
                } else {
                    super::actions::Status::Finished
                };
                self.actions.leave_edge(edge.sequence_id, self.faults, cut);
            }
            if self.faults.has(F::R2EdgeActionsForgottenWithEdge) {
                let origin = Origin::Edge(edge.sequence_id);
                self.actions.retain(|action| action.origin != origin);
            }
            self.book.left.1 = Some(edge);
        }
        self.end_edge_actions_where_it_stops();
        if self.maps.on_board(&stop.place.map_id) || !self.faults.has(F::R3OnlyFirstMapChecked) {
            self.motion.set_map(stop.place.map_id.clone());
        }
        if self.faults.has(F::TraversalSplit) {
            self.flush();
        }
        self.update_last_node(&stop);
        self.hide_later_visits(&stop);
        let again = !self.third.visited.insert(stop.node.id.clone());
        let skipped = again && self.faults.has(F::R3LoopSecondVisitWithoutActions)
            || !self.connection.online && self.faults.has(F::R3NodeActionsSkippedOffline);
        self.fail_actions_here(sequence_id);
        if self.takes(T::R3NodeActionsInNextState) && self.actions.waiting_at(Origin::Node(sequence_id)) {
            // It stands on the node, and says so.
            self.lingers_until = Some(self.moment() + LINGERING);
            self.flush();
        }
        if self.book.cancel.is_none() {
            let first =
                sequence_id == 0 && !self.book.nodes.is_empty() && self.faults.has(F::R1FirstNodeActionsSkipped);
            let continuation = self.book.continued && self.faults.has(F::R1ContinuationActionsSkipped);
            let of_update = sequence_id > self.book.first_end && self.faults.has(F::UpdateActionsNotPerformed);
            let alone =
                sequence_id == 0 && self.book.nodes.is_empty() && self.faults.has(F::R4OneNodeOrderActionsNotStarted);
            if !(first || continuation || of_update || skipped || alone) {
                self.actions.trigger(Origin::Node(sequence_id), self.faults);
            }
            let again = self.book.nodes.iter().filter(|ahead| ahead.node.id == stop.node.id);
            for ahead in again.filter(|_| self.faults.has(F::LoopActionsEarly)) {
                self.actions.trigger(Origin::Node(ahead.node.sequence_id), self.faults);
            }
            let ahead = self.book.edge_ahead().map(|edge| edge.sequence_id);
            let early = self.faults.has(F::EdgeActionsOnNode) || self.begins_edge_actions_on_node();
            if let Some(ahead) = ahead.filter(|_| early) {
                self.actions.trigger(Origin::Edge(ahead), self.faults);
            }
            self.stop_at_decision_point();
        }
        let again = self.book.base_end.0 == stop.node.id && self.book.base_end.1 > sequence_id;
        if again && self.book.cancel.is_none() && self.faults.has(F::R2LoopCutShort) {
            self.book.drop_route();
            for action in self.actions.iter_mut() {
                let behind = match action.origin {
                    Origin::Node(id) | Origin::Edge(id) => id > sequence_id,
                    Origin::Instant => false,
                };
                if behind {
                    action.end(super::actions::Status::Failed);
                }
            }
        }
        self.book.left.0 = Some(stop);
    }

    /// What a faulty vehicle does not do on a node that it has just traversed.
    fn fail_actions_here(&mut self, sequence_id: u32) {
        let alone = sequence_id == 0 && self.book.nodes.is_empty() && self.faults.has(F::R3SingleNodeActionsFail);
        let passes = self.book.nodes.front().is_some_and(|next| next.node.released);
        let here = Origin::Node(sequence_id);
        let free = |action: &super::actions::Action| action.request.blocking == Blocking::None;
        let all_free = self.actions.iter().filter(|action| action.origin == here).all(free);
        let passing = sequence_id > 0 && passes && all_free && self.faults.has(F::R3PassingActionsFail);
        if !(alone || passing) || self.book.cancel.is_some() {
            return;
        }
        let of_node = self.actions.iter_mut().filter(|action| action.origin == here);
        of_node
            .filter(|action| !action.status.is_terminal())
            .for_each(|action| action.end(super::actions::Status::Failed));
    }

    /// What a faulty vehicle does at the decision point.
    fn stop_at_decision_point(&mut self) {
        let Some(planned) = self.book.nodes.front().filter(|stop| !stop.node.released) else {
            return;
        };
        if self.faults.has(F::HorizonActionsBegun) {
            self.actions
                .trigger(Origin::Node(planned.node.sequence_id), self.faults);
        }
        if self.faults.has(F::HorizonSlippedInto) || self.faults.has(F::HorizonCreptInto) {
            self.book.soon = Some(self.now.moment + super::cancel::MOMENT);
        }
    }

    fn update_last_node(&mut self, stop: &Stop) {
        let plain = stop.node.actions.is_empty() && stop.node.sequence_id > 0;
        let between = self.book.nodes.front().is_some_and(|next| next.node.released);
        let stale = self.book.cancel.is_some() && self.faults.has(F::CancelLastNodeStale);
        if stale || (self.faults.has(F::NodeSkipped) && plain && between) {
            return;
        }
        self.book.previous = (self.book.last_node.clone(), self.book.last_sequence);
        self.book.last_node = self.mark_below().unwrap_or_else(|| stop.node.id.clone());
        if self.faults.has(F::LoopConfused) {
            let first = self
                .book
                .visits
                .entry(stop.node.id.clone())
                .or_insert(stop.node.sequence_id);
            self.book.last_sequence = *first;
        } else if !self.faults.has(F::LastNodeStale) && !self.keeps_sequence(stop) {
            self.book.last_sequence = stop.node.sequence_id;
        }
    }

    /// Whether the warning lights are on: as long as it is on the edge (ACT-03).
    pub(crate) fn is_flashing(&self) -> bool {
        self.actions
            .iter()
            .filter(|action| action.kind.is_some_and(|kind| kind.deed == Deed::WarningLights))
            .any(|action| {
                action.status.is_active() || (action.status.is_terminal() && self.faults.has(F::EdgeConditionStays))
            })
    }

    /// Whether the vehicle is lifting.
    pub(crate) fn is_lifting(&self) -> bool {
        let lifts = |deed| matches!(deed, Deed::Pick | Deed::Drop);
        self.actions
            .iter()
            .any(|action| action.status.is_active() && action.kind.is_some_and(|kind| lifts(kind.deed)))
    }
}
