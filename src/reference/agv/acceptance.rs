//! Acceptance of orders and order updates: the decision table of figure 8, and taking an order over.
//!
//! Whether the vehicle is able to do what it is asked is decided in `ability`, a refusal reported in `rejection`.

use serde_json::Value;

use super::Agv;
use super::action_kinds;
use super::actions::{Action, Origin};
use super::book::Stop;
use super::faults::FaultName as F;
use super::order_message::{ActionRequest, Edge, Node, Order};
use super::read::Defect;
use super::rejection::{Refusal, Rule};
use super::tolerances::ToleranceName as T;
use crate::reference::Output;

/// What to do with an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Decision {
    /// Row 4: a new order.
    Begin,
    /// Rows 8 and 10: an update of the running or completed order.
    Continue,
    /// Row 6: seen before.
    Discard,
}

impl Agv {
    /// Takes an order message.
    pub(crate) fn order_received(&mut self, payload: &[u8]) {
        if self.ignores_order() {
            return;
        }
        if self.loses_order() {
            return;
        }
        self.report.order_received = true;
        if self.faults.has(F::R3HeaderIdCountsOrders) {
            self.connection.skip_header_id();
        }
        let message = if payload.len() > self.config.max_message {
            Err(Refusal::new(Rule::Malformed, "the message is too long"))
        } else {
            serde_json::from_slice::<Value>(payload)
                .map_err(|error| Refusal::new(Rule::Malformed, &format!("the message is not JSON: {error}")))
        };
        let result = match &message {
            Err(refusal) => Err(refusal.clone()),
            Ok(message) => self.order_decided(message),
        };
        if let Err(refusal) = &result
            && refusal.is_malformed()
            && self.faults.has(F::CrashesOnMalformedOrder)
        {
            self.pending.push(Output::Drop);
            self.connection.dropped(self.moment() + self.config.reconnect_delay);
            return;
        }
        if let Err(refusal) = result {
            self.third.posed = false;
            self.refuse(message.as_ref().unwrap_or(&Value::Null), refusal);
        }
    }

    /// `order-after-refusal-lost`: the first one after a refusal.
    fn loses_order(&mut self) -> bool {
        let loses = self.faults.has(F::OrderAfterRefusalLost)
            && !self.is_busy()
            && self.errors.lists_refusals()
            && !self.order_lost;
        self.order_lost = loses;
        loses
    }

    /// `r2-refused-order-queued`: begins the order that came too early.
    pub(crate) fn begin_queued(&mut self) {
        if self.queued.is_none() || self.is_busy() {
            return;
        }
        self.flush();
        if let Some(message) = self.queued.take()
            && self.order_decided(&message).is_ok()
        {
            self.settle();
        }
    }

    fn order_decided(&mut self, message: &Value) -> Result<(), Refusal> {
        let mut order = Order::read(&self.read(message))?;
        if order.nodes.is_empty() && self.faults.has(F::R3EmptyOrderDropped) {
            return Ok(());
        }
        if std::mem::take(&mut self.locked) {
            return Err(Refusal::new(Rule::OtherOrderActive, "another order is active"));
        }
        let tolerated = |defect: &Defect| {
            let unchecked = match defect.path.rsplit('.').next() {
                Some("sequenceId") => self.faults.has(F::SequenceUnchecked),
                Some("startNodeId" | "endNodeId") => self.faults.has(F::EdgeEndsUnchecked),
                _ => false,
            };
            unchecked
                || (self.faults.has(F::GraphUnchecked) && !order.nodes.is_empty())
                || (self.faults.has(F::R6UpdateGraphUnchecked)
                    && order.id == self.book.order_id
                    && !order.nodes.is_empty())
                || (self.faults.has(F::R1SplitBaseTaken) && defect.reason == "is true behind the horizon's begin")
                || (self.faults.has(F::R4CountsCheckedInBaseOnly)
                    && defect.reason.ends_with("one less than the nodes")
                    && super::fourth::base_counts(&order))
        };
        if let Some(defect) = order.graph_defect().filter(|defect| !tolerated(defect)) {
            return Err(defect.into());
        }
        self.check_ids(&order)?;
        if self.rejects_as_told(&order, message) {
            return Ok(());
        }
        match self.decide(&mut order)? {
            Decision::Begin => self.begin(order),
            Decision::Continue => self.continue_with(order),
            Decision::Discard => {
                let changed = self.third.content.as_ref() != Some(&content_of(message));
                if changed && self.faults.has(F::R3ChangedDuplicateReported) {
                    return Err(Refusal::new(
                        Rule::Duplicate,
                        "the order differs from what was received before",
                    ));
                }
                if self.takes(T::R3DuplicateNotedInInformation) {
                    self.third.repeated = Some(self.book.order_id.clone());
                }
                self.seen_again();
                return Ok(());
            }
        }
        self.third.content = Some(content_of(message));
        if self.faults.has(F::EchoesOrder) {
            self.echo_order(message);
        }
        Ok(())
    }

    /// What a faulty vehicle does with an order it knows already.
    fn seen_again(&mut self) {
        if self.faults.has(F::R1DuplicateClearsErrors) {
            self.errors.new_order();
        }
        if self.waits_at_decision_point() && self.faults.has(F::R2DuplicateReleasesHorizon) {
            self.book.unbound = true;
        }
        self.book.stunned |= self.is_busy() && self.faults.has(F::DuplicateHaltsDriving);
        if self.is_busy() && self.faults.has(F::R1DuplicateRepeatsActions) {
            self.repeat_actions(self.book.last_sequence);
        }
    }

    /// Does the ended actions of a node once more.
    pub(crate) fn repeat_actions(&mut self, sequence_id: u32) {
        let origin = Origin::Node(sequence_id);
        let mut repeated = false;
        for action in self.actions.iter_mut().filter(|action| action.origin == origin) {
            if action.status == super::actions::Status::Finished {
                action.status = super::actions::Status::Waiting;
                action.result = None;
                repeated = true;
            }
        }
        if repeated {
            self.actions.trigger(origin, self.faults);
        }
    }

    /// The decision table of figure 8, with the gates it leaves out.
    fn decide(&self, order: &mut Order) -> Result<Decision, Refusal> {
        let new = order.id != self.book.order_id;
        if !new && order.update_id == self.book.update_id {
            let done =
                !self.is_busy() && !self.book.cancelled && self.faults.has(F::R4ResendAfterCompletionRaisesError);
            if done || self.faults.has(F::DuplicateReported) {
                return Err(Refusal::new(Rule::Duplicate, "the order was received before"));
            }
            let again = self.faults.has(F::DuplicateExecuted) && !self.is_busy();
            let again = again || self.book.cancelled && self.faults.has(F::R3DuplicateAfterCancelExecuted);
            return Ok(if again { Decision::Begin } else { Decision::Discard });
        }
        let late = self.faults.has(F::R1OutdatedContinuesCompleted) && !self.is_busy();
        let compared = (!new && !late) || (new && self.faults.has(F::UpdateIdsComparedAcrossOrders));
        if compared && order.update_id < self.book.update_id && !self.faults.has(F::OutdatedUpdateTakenOver) {
            return Err(Refusal::new(
                Rule::Outdated,
                "the order update is older than the current one",
            ));
        }
        let takes_orders = match self.mode {
            super::Mode::Semiautomatic => !self.faults.has(F::SemiautomaticRefused),
            mode => {
                let takes = self.faults.has(F::ManualTakesOrders) || self.faults.has(F::ManualDrivesOrders);
                mode.takes_orders() || takes
            }
        };
        if !takes_orders {
            return Err(Refusal::new(
                Rule::OtherOrderActive,
                "the vehicle is not in an automatic mode",
            ));
        }
        if self.undocking.is_some_and(|until| until > self.moment()) {
            return Err(Refusal::new(
                Rule::OtherOrderActive,
                "the vehicle is still at the charger",
            ));
        }
        if new {
            self.check_new(order)?;
            Ok(Decision::Begin)
        } else {
            self.check_update(order)?;
            Ok(Decision::Continue)
        }
    }

    fn check_new(&self, order: &mut Order) -> Result<(), Refusal> {
        if self.third.posed && self.faults.has(F::R3OrderAfterInitPositionRefused) {
            let refusal = Refusal::new(Rule::StartOutOfRange, "the first node is out of reach");
            return Err(refusal.naming("nodeId", &order.nodes[0].id));
        }
        let replaced = self.holds.pause && self.faults.has(F::R1NewOrderTakenInPause);
        if self.is_busy() && !replaced {
            return Err(Refusal::new(Rule::OtherOrderActive, "another order is active"));
        }
        if self.faults.has(F::R6FailedActionBlocksNextOrder) && self.order_has_failed_action() {
            return Err(Refusal::new(
                Rule::OtherOrderActive,
                "an action of the order before is not finished",
            ));
        }
        if self.faults.has(F::DeadAfterCancel) && self.book.cancelled {
            return Err(Refusal::new(
                Rule::OtherOrderActive,
                "the cancelled order is still there",
            ));
        }
        if order.nodes[0].sequence_id != 0 && !self.faults.has(F::GraphUnchecked) {
            let path = format!("{}.sequenceId", order.nodes[0].path);
            return Err(Refusal::at_field(
                Rule::Malformed,
                "a new order begins with sequenceId 0",
                &path,
            ));
        }
        if order.update_id != 0 && self.takes(T::R4NonzeroFirstUpdateIdRefused) {
            let reason = "a new order begins with orderUpdateId 0";
            return Err(Refusal::at_field(Rule::Unable, reason, "orderUpdateId"));
        }
        let demanded = self.faults.has(F::HorizonDemanded) && order.nodes.iter().all(|node| node.released);
        if demanded || (self.faults.has(F::SingleNodeRefused) && order.nodes.len() == 1) {
            return Err(Refusal::new(Rule::Unable, "the order is too short"));
        }
        self.check_ability(order, 0)?;
        let stranded = self.book.cancelled && self.faults.has(F::R1FarOrderTakenAfterCancel);
        if self.near(&order.nodes[0]) || stranded || self.faults.has(F::FarOrderAccepted) {
            return Ok(());
        }
        Err(Refusal::new(Rule::StartOutOfRange, "the first node is out of reach").naming("nodeId", &order.nodes[0].id))
    }

    /// Nodes left, an order action not ended, or a cancellation under way; a horizon keeps it busy.
    pub(crate) fn is_busy(&self) -> bool {
        let free = |action: &Action| {
            let left = self.book.cancelled && action.status == super::actions::Status::Waiting;
            let trigger = action
                .kind
                .is_some_and(|kind| kind.deed == action_kinds::Deed::WaitForTrigger);
            self.faults.has(F::FreeActionIgnored) && action.request.blocking == super::order_message::Blocking::None
                || left && self.faults.has(F::R3CancelLeavesHorizonWaiting)
                || left && self.faults.has(F::R6ManualLeavesActionsWaiting)
                || trigger && self.faults.has(F::R3TriggerNotCounted)
        };
        let open = |action: &Action| action.of_order() && !action.status.is_terminal() && !free(action);
        let actions = self.actions.iter().any(open) && !self.faults.has(F::RunningActionIgnored);
        let counts = |released: bool| released || !self.faults.has(F::HorizonNotBusy);
        let nodes = !self.book.cancelled && self.book.nodes.iter().any(|stop| counts(stop.node.released));
        (nodes || actions || self.book.cancel.is_some()) && !self.faults.has(F::BusyIgnored)
    }

    /// Whether the vehicle stands on the node, or inside its deviation range (ORD-04, ORD-05).
    fn near(&self, node: &Node) -> bool {
        let Some(place) = self.place(node) else { return false };
        let pose = self.motion.pose(self.moment());
        if self.persona.lost {
            return false;
        }
        if node.id == self.book.last_node && self.faults.has(F::R2LastNodeTrusted) {
            return true;
        }
        let temporary = self.faults.has(F::TemporaryNodeRefused)
            && self.config.node(&node.id).is_none()
            && node.id != self.book.last_node;
        if temporary || self.faults.has(F::FirstNodeRefused) {
            return false;
        }
        let allowed = node
            .position
            .as_ref()
            .and_then(|position| position.allowed_deviation)
            .unwrap_or(0.0);
        let allowed = if self.faults.has(F::DeviationIgnored) {
            0.0
        } else if self.faults.has(F::R1DeviationAsDiameter) {
            allowed / 2.0
        } else {
            allowed
        };
        if self.faults.has(F::R4ThetaDifferenceNotWrapped) && self.turned_by_plain_difference(node, pose.theta) {
            return false;
        }
        let lenient = self.faults.has(F::UnknownMapAccepted) || self.faults.has(F::DisabledMapUsed);
        let lenient = lenient || self.faults.has(F::R4StartCheckIgnoresMap);
        (pose.map_id == place.map_id || lenient)
            && pose.distance(place.x, place.y) <= allowed.max(self.config.tolerance)
    }

    /// Row 4: takes over a new order.
    fn begin(&mut self, order: Order) {
        if self.faults.has(F::R1OwnErrorGoneByOrder) {
            self.errors.clear();
        } else if !self.faults.has(F::ValidationErrorLingers) {
            self.errors.new_order();
        }
        self.latched = false;
        self.field_latched = false;
        self.third.visited.clear();
        self.third.retried.clear();
        self.third.repeated = None;
        self.third.posed = false;
        self.actions.drop_lists();
        if self.faults.has(F::OldActionStatesKept) {
            let ids: Vec<&str> = order.actions().map(|action| action.id.as_str()).collect();
            self.actions.retain(|action| !ids.contains(&action.request.id.as_str()));
        } else {
            let dropped = self.faults.has(F::RunningInstantDropped);
            let cancel_stays = self.faults.has(F::R1CancelOutlivesOrder);
            let failed_stay = self.faults.has(F::R2FailedActionsOutliveOrder);
            self.actions.retain(|action| {
                let stays = cancel_stays && action.request.action_type == "cancelOrder";
                let failed = action.of_order() && action.status == super::actions::Status::Failed;
                failed && failed_stay || !action.of_order() && (stays || !action.status.is_terminal()) && !dropped
            });
        }
        let moment = self.moment();
        self.motion.halt(moment);
        let unknown = self.config.node(&order.nodes[0].id).is_none();
        let uncounted = self.faults.has(F::RangeNotCounted) || (unknown && self.faults.has(F::TemporaryNodeNotReached));
        self.motion.reached = self.near(&order.nodes[0]) && !uncounted;
        self.lost = false;
        self.claimed_map = None;
        if self.holds.stuck {
            self.set_holds(|holds| holds.stuck = false);
        }
        let last = (std::mem::take(&mut self.book.last_node), self.book.last_sequence);
        let last_update = self.book.has_order().then_some(self.book.update_id);
        let after_cancel = self.book.cancelled && self.faults.has(F::R2OrderAfterCancelNotDriven);
        self.book = super::book::Book::empty(last.0);
        let in_pause = (self.holds.pause || self.holds.button) && self.faults.has(F::R2OrderInPauseNeverStarts);
        self.book.stunned = after_cancel || in_pause;
        self.book.heedless = self.holds.pause && self.faults.has(F::R4PausedVehicleStartsNewOrder);
        self.book.last_sequence = last.1;
        self.book.order_id.clone_from(&order.id);
        let carried = last_update.filter(|_| self.faults.has(F::UpdateIdCarriedOver));
        self.book.update_id = if self.faults.has(F::R1FirstUpdateIdZeroed) {
            0
        } else {
            carried.unwrap_or(order.update_id)
        };
        self.book.zoned = order.zone_set.is_some();
        self.append(order.nodes, order.edges);
        self.book.first_end = self.book.nodes.back().map_or(0, |stop| stop.node.sequence_id);
        self.fourth.new_order(self.book.base_end.1);
        self.sixth.new_order();
        if self.faults.has(F::R4HeaderIdRestartsWithOrder) {
            self.connection.restart_header_id();
        }
        let pose = self.motion.pose(self.moment());
        self.book.begun_at = Some((pose.x, pose.y));
        if self.faults.has(F::LoadForgottenWithOrder) {
            self.loads.clear();
        }
        if self.faults.has(F::OwnErrorClearedByOrder) {
            self.errors.cleared();
        }
        if self.faults.has(F::OrderEndsPause) {
            self.set_holds(|holds| holds.pause = false);
        }
        self.linger_on_first_node();
        if self.takes(T::R1SetsOutLate) {
            self.lingers_until = Some(self.moment() + std::time::Duration::from_millis(700));
        }
        if self.takes(T::R6LibThinksBeforeDriving) {
            self.lingers_until = Some(self.moment() + super::sixth::PLANNING);
        }
        if self.takes(T::R2AdoptsBeforeDriving) {
            self.flush();
        }
    }

    pub(crate) fn append(&mut self, nodes: Vec<Node>, edges: Vec<Edge>) {
        let mut edges = edges.into_iter().peekable();
        for node in nodes {
            while let Some(edge) = edges.next_if(|edge| edge.sequence_id < node.sequence_id) {
                self.push_edge(edge);
            }
            if !node.released {
                self.book.planned.insert(node.sequence_id);
            }
            if node.released {
                self.book.base_end = (node.id.clone(), node.sequence_id);
            }
            self.push_actions(node.actions.clone(), Origin::Node(node.sequence_id));
            let edge = self
                .book
                .edges
                .back()
                .filter(|edge| edge.sequence_id + 1 == node.sequence_id);
            if let Some(place) = self.arrives_at(edge, &node) {
                self.book.nodes.push_back(Stop { node, place });
            }
        }
        edges.for_each(|edge| self.push_edge(edge));
    }

    fn push_edge(&mut self, edge: Edge) {
        self.push_actions(edge.actions.clone(), Origin::Edge(edge.sequence_id));
        if !edge.released {
            self.book.planned.insert(edge.sequence_id);
        }
        self.book.edges.push_back(edge);
    }

    pub(crate) fn push_actions(&mut self, requests: Vec<ActionRequest>, origin: Origin) {
        for request in requests {
            let again = self.book.dropped.contains(&request.id);
            if again && self.faults.has(F::ReleasedActionsLost) {
                continue;
            }
            let kind = action_kinds::find(&self.config, &request.action_type);
            let doubled = again && self.faults.has(F::ReleasedActionsDoubled);
            self.actions.retain(|action| action.request.id != request.id || doubled);
            self.actions.push(Action::waiting(request, kind, origin));
        }
    }
}

/// Nodes and edges of an order message.
fn content_of(message: &Value) -> Value {
    let part = |key: &str| message.get(key).cloned().unwrap_or_default();
    Value::Array(vec![part("nodes"), part("edges")])
}
