//! Acceptance of orders and order updates (figure 8), and how a refusal is reported.

use serde_json::Value;

use super::action_kinds::{self, Scope};
use super::actions::{Action, Origin};
use super::book::{Place, Stop};
use super::errors::{ActiveError, Life};
use super::faults::FaultName as F;
use super::order_message::{ActionRequest, Edge, Node, Order};
use super::read::Defect;
use super::{Agv, motion};

/// How far an edge orientation may be from forwards or backwards, in radians: the vehicle has two driven wheels.
const SIDEWAYS: f64 = 0.1;

/// Which rule refused an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rule {
    Malformed,
    Unable,
    Memory,
    UnknownMap,
    OtherOrderActive,
    StartOutOfRange,
    Outdated,
    BrokenUpdate,
    /// Never raised by a faultless vehicle.
    Duplicate,
}

/// An order that is not taken over.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Refusal {
    rule: Rule,
    reason: String,
    /// What in the message is wrong.
    culprits: Vec<(String, String)>,
}

impl Refusal {
    fn new(rule: Rule, reason: &str) -> Self {
        Self {
            rule,
            reason: reason.to_owned(),
            culprits: Vec::new(),
        }
    }

    fn naming(mut self, key: &str, value: impl Into<String>) -> Self {
        self.culprits.push((key.to_owned(), value.into()));
        self
    }

    fn at_field(rule: Rule, reason: &str, path: &str) -> Self {
        Self::new(rule, reason).naming("field", path)
    }
}

impl From<Defect> for Refusal {
    fn from(defect: Defect) -> Self {
        let reason = format!("{} {}", defect.path, defect.reason);
        Self::at_field(Rule::Malformed, &reason, &defect.path)
    }
}

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
    pub(super) fn order_received(&mut self, payload: &[u8]) {
        self.report.order_received = true;
        let message = if payload.len() > self.config.max_message {
            Err(Refusal::new(Rule::Malformed, "the message is too long"))
        } else {
            serde_json::from_slice::<Value>(payload)
                .map_err(|_| Refusal::new(Rule::Malformed, "the message is not JSON"))
        };
        let result = match &message {
            Err(refusal) => Err(refusal.clone()),
            Ok(message) => self.order_decided(message),
        };
        if let Err(refusal) = result {
            self.refuse(message.as_ref().unwrap_or(&Value::Null), refusal);
        }
    }

    fn order_decided(&mut self, message: &Value) -> Result<(), Refusal> {
        let mut order = Order::read(message)?;
        let tolerated = |_: &Defect| self.faults.has(F::GraphUnchecked) && !order.nodes.is_empty();
        if let Some(defect) = order.graph_defect().filter(|defect| !tolerated(defect)) {
            return Err(defect.into());
        }
        match self.decide(&mut order)? {
            Decision::Begin => self.begin(order),
            Decision::Continue => self.continue_with(order),
            Decision::Discard => return Ok(()),
        }
        if self.faults.has(F::EchoesOrder) {
            self.echo_order(message);
        }
        Ok(())
    }

    /// The decision table of figure 8, with the gates it leaves out.
    fn decide(&self, order: &mut Order) -> Result<Decision, Refusal> {
        let new = order.id != self.book.order_id;
        if !new && order.update_id == self.book.update_id {
            if self.faults.has(F::DuplicateReported) {
                return Err(Refusal::new(Rule::Duplicate, "the order was received before"));
            }
            let again = self.faults.has(F::DuplicateExecuted) && !self.is_busy();
            return Ok(if again { Decision::Begin } else { Decision::Discard });
        }
        if !new && order.update_id < self.book.update_id && !self.faults.has(F::OutdatedUpdateTakenOver) {
            return Err(Refusal::new(
                Rule::Outdated,
                "the order update is older than the current one",
            ));
        }
        let takes_orders = match self.mode {
            super::Mode::Semiautomatic => !self.faults.has(F::SemiautomaticRefused),
            mode => mode.takes_orders(),
        };
        if !takes_orders {
            return Err(Refusal::new(
                Rule::OtherOrderActive,
                "the vehicle is not in an automatic mode",
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
        if self.is_busy() {
            return Err(Refusal::new(Rule::OtherOrderActive, "another order is active"));
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
        let demanded = self.faults.has(F::HorizonDemanded) && order.nodes.iter().all(|node| node.released);
        if demanded || (self.faults.has(F::SingleNodeRefused) && order.nodes.len() == 1) {
            return Err(Refusal::new(Rule::Unable, "the order is too short"));
        }
        self.check_ability(order, 0)?;
        if self.near(&order.nodes[0]) || self.faults.has(F::FarOrderAccepted) {
            return Ok(());
        }
        Err(Refusal::new(Rule::StartOutOfRange, "the first node is out of reach").naming("nodeId", &order.nodes[0].id))
    }

    fn check_update(&self, order: &mut Order) -> Result<(), Refusal> {
        let busy = self.is_busy();
        if self.book.cancel.is_some() || self.book.cancelled {
            return Err(Refusal::new(Rule::BrokenUpdate, "the order was cancelled"));
        }
        if self.faults.has(F::CompletedNotContinued) && !busy {
            return Err(Refusal::new(Rule::BrokenUpdate, "the order is complete"));
        }
        let first = &order.nodes[0];
        let joins = if busy {
            (&first.id, first.sequence_id) == (&self.book.base_end.0, self.book.base_end.1)
                || self.faults.has(F::ErrorlessGapUpdate)
                || self.faults.has(F::OutdatedUpdateTakenOver)
        } else {
            (&first.id, first.sequence_id) == (&self.book.last_node, self.book.last_sequence)
                || self.faults.has(F::CompletedUpdateGapAccepted)
        };
        if !joins {
            let refusal = Refusal::new(Rule::BrokenUpdate, "the update does not continue the order");
            return Err(refusal.naming("nodeId", &first.id));
        }
        self.check_ability(order, 1)
    }

    /// Nodes left, an order action not ended, or a cancellation under way; a horizon keeps it busy.
    pub(super) fn is_busy(&self) -> bool {
        let actions = self.actions.order_unfinished() && !self.faults.has(F::RunningActionIgnored);
        let only_horizon = self.book.nodes.iter().all(|stop| !stop.node.released);
        let nodes = !self.book.nodes.is_empty() && !(only_horizon && self.faults.has(F::HorizonNotBusy));
        (nodes || actions || self.book.cancel.is_some()) && !self.faults.has(F::BusyIgnored)
    }

    /// Whether the vehicle stands on the node, or inside its deviation range (ORD-04, ORD-05).
    fn near(&self, node: &Node) -> bool {
        let Some(place) = self.place(node) else { return false };
        let pose = self.motion.pose(self.moment());
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
        } else {
            allowed
        };
        let lenient = self.faults.has(F::UnknownMapAccepted) || self.faults.has(F::DisabledMapUsed);
        (pose.map_id == place.map_id || lenient)
            && pose.distance(place.x, place.y) <= allowed.max(self.config.tolerance)
    }

    /// Where a node is: as the order says, else as the layout knows.
    fn place(&self, node: &Node) -> Option<Place> {
        if let Some(position) = &node.position {
            return Some(Place {
                x: position.x,
                y: position.y,
                map_id: position.map_id.clone(),
            });
        }
        self.config.node(&node.id).map(|known| Place {
            x: known.x,
            y: known.y,
            map_id: known.map_id.clone(),
        })
    }

    /// Whether the vehicle can do all this; the first `known` nodes are only the joint.
    fn check_ability(&self, order: &mut Order, known: usize) -> Result<(), Refusal> {
        self.check_memory(order, known)?;
        if let Some(path) = order
            .unsupported
            .first()
            .filter(|_| !self.faults.has(F::UnsupportedFieldIgnored))
        {
            return Err(Refusal::at_field(
                Rule::Unable,
                &format!("the vehicle has no use for {path}"),
                path,
            ));
        }
        for node in &order.nodes {
            let Some(place) = self.place(node) else {
                let path = format!("{}.nodePosition", node.path);
                let refusal = Refusal::at_field(Rule::Unable, "the vehicle does not know where the node is", &path);
                return Err(refusal.naming("nodeId", &node.id));
            };
            self.check_map(node, &place)?;
        }
        for (index, edge) in order.edges.iter().enumerate() {
            let ends = order.nodes.get(index).zip(order.nodes.get(index + 1));
            self.check_edge(edge, ends)?;
        }
        self.check_actions(order, known)
    }

    fn check_memory(&self, order: &mut Order, known: usize) -> Result<(), Refusal> {
        let limit = self.config.max_nodes;
        let actions = |actions: &Vec<ActionRequest>| actions.len() > self.config.max_actions;
        let too_many_actions = order.nodes.iter().any(|node| actions(&node.actions))
            || order.edges.iter().any(|edge| actions(&edge.actions));
        let left = if known == 0 {
            0
        } else {
            self.book.nodes.iter().filter(|stop| stop.node.released).count()
        };
        let too_many_nodes = left + order.nodes.len() > limit;
        if self.faults.has(F::MemoryUnchecked) {
            order.nodes.truncate(limit);
            order.edges.truncate(limit.saturating_sub(1));
            return Ok(());
        }
        if too_many_nodes {
            return Err(Refusal::at_field(Rule::Memory, "the order has too many nodes", "nodes"));
        }
        if too_many_actions {
            return Err(Refusal::at_field(
                Rule::Memory,
                "a node or edge has too many actions",
                "actions",
            ));
        }
        Ok(())
    }

    fn check_map(&self, node: &Node, place: &Place) -> Result<(), Refusal> {
        let refusal = |reason| {
            Err(Refusal::new(Rule::UnknownMap, reason)
                .naming("mapId", &place.map_id)
                .naming("nodeId", &node.id))
        };
        if self.faults.has(F::UnknownMapAccepted) {
            return Ok(());
        }
        if !self.maps.on_board(&place.map_id) {
            return refusal("the map is not on board");
        }
        if !self.maps.enabled(&place.map_id) && !self.faults.has(F::DisabledMapUsed) {
            return refusal("the map is not enabled");
        }
        Ok(())
    }

    fn check_edge(&self, edge: &Edge, ends: Option<(&Node, &Node)>) -> Result<(), Refusal> {
        let unable = |field: &str, reason: &str| {
            let path = format!("{}.{field}", edge.path);
            Err(Refusal::at_field(Rule::Unable, reason, &path).naming("edgeId", &edge.id))
        };
        if edge.max_speed == Some(0.0) {
            return unable("maxSpeed", "the vehicle cannot drive with speed zero");
        }
        if edge.max_height.is_some_and(|height| height < self.config.height) {
            return unable("maxHeight", "the vehicle is higher");
        }
        let Some(orientation) = edge.orientation else {
            return Ok(());
        };
        let places = ends.and_then(|(from, to)| self.place(from).zip(self.place(to)));
        let Some((from, to)) = places.filter(|(from, to)| (to.x - from.x).hypot(to.y - from.y) > 1e-6) else {
            return Ok(());
        };
        let heading = (to.y - from.y).atan2(to.x - from.x);
        let relative = motion::wrapped(if edge.global {
            orientation - heading
        } else {
            orientation
        })
        .abs();
        let possible = relative <= SIDEWAYS || relative >= std::f64::consts::PI - SIDEWAYS;
        if possible || self.faults.has(F::OrientationUnchecked) {
            return Ok(());
        }
        unable("orientation", "the vehicle cannot drive sideways")
    }

    fn check_actions(&self, order: &Order, known: usize) -> Result<(), Refusal> {
        let nodes = order.nodes.iter().skip(known).flat_map(|node| &node.actions);
        let edges = order.edges.iter().flat_map(|edge| &edge.actions);
        let scoped = nodes
            .map(|action| (action, Scope::Node))
            .chain(edges.map(|action| (action, Scope::Edge)));
        let mut seen: Vec<&str> = Vec::new();
        for (request, scope) in scoped {
            let unable = |reason: &str, field: &str| {
                let refusal = Refusal::at_field(Rule::Unable, reason, field).naming("actionId", &request.id);
                Err(refusal.naming("actionType", &request.action_type))
            };
            if seen.contains(&request.id.as_str()) || self.id_taken(&request.id, known) {
                return unable("the actionId is not unique", &request.path);
            }
            seen.push(&request.id);
            let Some(kind) = action_kinds::find(&self.config, &request.action_type) else {
                if self.faults.has(F::UnknownActionAccepted) {
                    continue;
                }
                return unable("the vehicle does not know the action", &request.path);
            };
            let listed_refused = self.faults.has(F::ListedActionRefused)
                && matches!(
                    kind.deed,
                    action_kinds::Deed::FinePositioning | action_kinds::Deed::DetectObject
                );
            if listed_refused || (!kind.scopes.contains(&scope) && !self.faults.has(F::ScopeUnchecked)) {
                return unable("the action is not possible here", &request.path);
            }
            if let Some((key, reason)) = action_kinds::refusal(kind, request, true) {
                let refusal = Refusal::at_field(Rule::Unable, reason, &request.path).naming("actionParameter", key);
                return Err(refusal.naming("actionId", &request.id));
            }
        }
        Ok(())
    }

    /// Whether an action of that id stays when the order is taken over.
    fn id_taken(&self, id: &str, known: usize) -> bool {
        self.actions.get(id).is_some_and(|action| match action.origin {
            Origin::Instant => known > 0 || !action.status.is_terminal(),
            Origin::Node(sequence_id) | Origin::Edge(sequence_id) => {
                known > 0 && sequence_id <= self.book.base_end.1 && !self.faults.has(F::OutdatedUpdateTakenOver)
            }
        })
    }

    /// Row 4: takes over a new order.
    fn begin(&mut self, order: Order) {
        if !self.faults.has(F::ValidationErrorLingers) {
            self.errors.new_order();
        }
        self.actions.drop_lists();
        if self.faults.has(F::OldActionStatesKept) {
            let ids: Vec<&str> = order.actions().map(|action| action.id.as_str()).collect();
            self.actions.retain(|action| !ids.contains(&action.request.id.as_str()));
        } else {
            let dropped = self.faults.has(F::RunningInstantDropped);
            self.actions
                .retain(|action| !action.of_order() && !action.status.is_terminal() && !dropped);
        }
        let moment = self.moment();
        self.motion.halt(moment);
        self.motion.reached = self.near(&order.nodes[0]);
        let last = (std::mem::take(&mut self.book.last_node), self.book.last_sequence);
        self.book = super::book::Book::empty(last.0);
        self.book.last_sequence = last.1;
        self.book.order_id.clone_from(&order.id);
        self.book.update_id = order.update_id;
        self.append(order.nodes, order.edges);
    }

    /// Rows 8 and 10: takes over an update.
    fn continue_with(&mut self, order: Order) {
        let keep = if order.nodes.iter().any(|node| !node.released) {
            self.faults.has(F::HorizonAppended)
        } else {
            self.faults.has(F::HorizonKept)
        };
        if !keep {
            let gone = self.book.drop_horizon();
            if !self.faults.has(F::HorizonActionsStay) {
                self.actions.retain(|action| match action.origin {
                    Origin::Node(sequence_id) | Origin::Edge(sequence_id) => !gone.contains(&sequence_id),
                    Origin::Instant => true,
                });
            }
        }
        if self.faults.has(F::UpdateReplacesBase) {
            while self.book.nodes.len() > 1 {
                self.book.nodes.pop_front();
                self.book.edges.pop_front();
            }
        }
        if !self.faults.has(F::UpdateIdKept) {
            self.book.update_id = order.update_id;
        }
        let mut nodes = order.nodes.into_iter();
        let joint = nodes.next();
        if let Some(joint) = joint.filter(|_| self.faults.has(F::StitchingNodeOverwritten)) {
            self.overwrite_joint(joint);
        }
        self.append(nodes.collect(), order.edges);
    }

    /// `stitching-node-overwritten`: what the first transmission said is forgotten.
    fn overwrite_joint(&mut self, joint: Node) {
        let origin = Origin::Node(joint.sequence_id);
        let open = self
            .book
            .nodes
            .iter()
            .any(|stop| stop.node.sequence_id == joint.sequence_id);
        self.actions
            .retain(|action| action.origin != origin || action.status.is_terminal());
        self.push_actions(joint.actions, origin);
        if !open {
            self.actions.trigger(origin, self.faults);
        }
    }

    fn append(&mut self, nodes: Vec<Node>, edges: Vec<Edge>) {
        let mut edges = edges.into_iter().peekable();
        for node in nodes {
            while let Some(edge) = edges.next_if(|edge| edge.sequence_id < node.sequence_id) {
                self.push_edge(edge);
            }
            if node.released {
                self.book.base_end = (node.id.clone(), node.sequence_id);
            }
            self.push_actions(node.actions.clone(), Origin::Node(node.sequence_id));
            if let Some(place) = self.place(&node) {
                self.book.nodes.push_back(Stop { node, place });
            }
        }
        edges.for_each(|edge| self.push_edge(edge));
    }

    fn push_edge(&mut self, edge: Edge) {
        self.push_actions(edge.actions.clone(), Origin::Edge(edge.sequence_id));
        self.book.edges.push_back(edge);
    }

    fn push_actions(&mut self, requests: Vec<ActionRequest>, origin: Origin) {
        for request in requests {
            let kind = action_kinds::find(&self.config, &request.action_type);
            self.actions.retain(|action| action.request.id != request.id);
            self.actions.push(Action::waiting(request, kind, origin));
        }
    }

    /// Reports a refusal; nothing else changes (ORD-FLOW-12).
    fn refuse(&mut self, message: &Value, refusal: Refusal) {
        self.refusal_side_effects(message, refusal.rule);
        if self.faults.has(F::RejectionSilent) {
            return;
        }
        let names = &self.config.errors;
        let name = match refusal.rule {
            Rule::Malformed if self.faults.has(F::ValidationErrorMisspelled) => "validationOrder",
            Rule::Malformed => &names.validation,
            Rule::Unable if self.faults.has(F::OrderErrorAsValidation) => &names.validation,
            Rule::Unable => &names.order,
            Rule::Memory => &names.memory,
            Rule::UnknownMap => &names.unknown_map,
            Rule::OtherOrderActive => &names.other_order_active,
            Rule::StartOutOfRange => &names.start_out_of_range,
            Rule::Outdated if self.faults.has(F::OutdatedUpdateMisnamed) => &names.validation,
            Rule::Outdated | Rule::Duplicate => &names.outdated_update,
            Rule::BrokenUpdate => &names.broken_update,
        };
        let fatal = match refusal.rule {
            Rule::Malformed => self.faults.has(F::ValidationErrorFatal),
            Rule::Unable => self.faults.has(F::OrderErrorFatal),
            Rule::Outdated => self.faults.has(F::OutdatedUpdateFatal),
            _ => false,
        };
        let (early, short) = match refusal.rule {
            Rule::Malformed => (self.faults.has(F::ValidationErrorDroppedEarly), false),
            Rule::Unable => (self.faults.has(F::OrderErrorDroppedEarly), false),
            Rule::Outdated | Rule::BrokenUpdate | Rule::Duplicate => (false, true),
            _ => (false, false),
        };
        let life = match (early, short) {
            (true, _) => Life::Until(self.moment() + std::time::Duration::from_secs(1)),
            (_, true) => Life::Until(self.moment() + self.config.error_duration),
            _ => Life::UntilNewOrder,
        };
        let mut references = message_references(message);
        references.extend(refusal.culprits);
        if self.faults.has(F::UpdateIdUnreferenced) {
            references.retain(|(key, _)| key != "orderUpdateId");
        }
        if refusal.rule == Rule::Unable && self.faults.has(F::OrderErrorUnreferenced) {
            references.clear();
        }
        let error = ActiveError {
            error_type: name.to_owned(),
            fatal,
            references,
            description: refusal.reason,
            life,
        };
        self.errors.raise(error);
    }

    /// What a faulty vehicle changes when it refuses an order.
    fn refusal_side_effects(&mut self, message: &Value, rule: Rule) {
        let taken = rule == Rule::Malformed && self.faults.has(F::MalformedTakenOver)
            || rule != Rule::Outdated && self.faults.has(F::RejectedIdReported);
        if let Some(id) = message.get("orderId").and_then(Value::as_str).filter(|_| taken) {
            id.clone_into(&mut self.book.order_id);
        }
        if self.faults.has(F::RejectionStopsOrder)
            || (rule == Rule::Outdated && self.faults.has(F::OutdatedUpdateDropsOrder))
        {
            self.give_up_order();
        }
    }
}

/// References that identify the message, as far as it can be read (BP-02).
fn message_references(message: &Value) -> Vec<(String, String)> {
    let mut references = vec![("topic".to_owned(), "order".to_owned())];
    for key in ["headerId", "orderId", "orderUpdateId"] {
        match message.get(key) {
            Some(Value::String(text)) => references.push((key.to_owned(), text.chars().take(256).collect())),
            Some(Value::Number(number)) => references.push((key.to_owned(), number.to_string())),
            _ => {}
        }
    }
    references
}
