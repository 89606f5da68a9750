//! Acceptance of orders and order updates: the decision table of figure 8 (section 6.6.2), and taking an order over.
//!
//! Whether the vehicle is able to do what it is asked is decided in `ability`, a refusal reported in `rejection`; what
//! an update is about stands in `updates`. Instant actions that run keep no order from being begun (the ruling of
//! ORD-FLOW-02); an order in a mode that takes none is refused (that of MODE-02); a duplicate is ignored whatever it
//! says (that of ORD-REJ-13); actions of the horizon are represented, too (that of ASTATE-01).

use serde_json::Value;

use super::Agv;
use super::action_kinds;
use super::actions::{Action, Origin, Status};
use super::hook_points::{Event, Permission};
use super::objections::{Adoption, Objection, Relation};
use super::order_message::{ActionRequest, Blocking, Edge, Node, Order};
use super::order_state::{OrderState, Stop};
use super::read::Defect;
use super::rejection::{Detail, Refusal, Rule};

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
        self.report.order_received = true;
        let message = if payload.len() > self.config.max_message {
            Err(Refusal::new(Rule::Malformed, "the message is too long"))
        } else {
            serde_json::from_slice::<Value>(payload)
                .map(|message| self.understood("order", message))
                .map_err(|error| Refusal::new(Rule::Malformed, &format!("the message is not JSON: {error}")))
        };
        let result = match &message {
            Err(refusal) => Err(refusal.clone()),
            Ok(message) => self.order_decided(message),
        };
        if let Err(refusal) = result {
            self.refuse(message.as_ref().unwrap_or(&Value::Null), refusal);
        }
    }

    /// Takes an order over, or says why not.
    pub(crate) fn order_decided(&mut self, message: &Value) -> Result<(), Refusal> {
        let mut order = Order::read(&self.read(message))?;
        self.check_blocking(&order)?;
        if let Some(defect) = order.graph_defect() {
            let objection = Objection::Graph(&order, &defect);
            self.object(objection, defect.clone().into())?;
        }
        self.check_ids(&order)?;
        let decision = self.decide(&order)?;
        let update = decision == Decision::Continue;
        if decision == Decision::Discard {
            self.happens(Event::SeenAgain);
            return Ok(());
        }
        let mut adoption = Adoption {
            order: &mut order,
            message,
            update,
        };
        match self.adopts(&mut adoption) {
            true if update => self.continue_with(order),
            true => self.begin(order),
            false => {}
        }
        Ok(())
    }

    /// Whether all ids have the form that the factsheet states (FACT-12).
    pub(crate) fn check_ids(&self, order: &Order) -> Result<(), Refusal> {
        let nodes = order.nodes.iter().map(|node| &node.id);
        let edges = order.edges.iter().map(|edge| &edge.id);
        let actions = order.actions().map(|action| &action.id);
        for id in std::iter::once(&order.id).chain(nodes).chain(edges).chain(actions) {
            if id.chars().count() > self.config.max_id {
                return Err(Refusal::at_field(Rule::Malformed, "an id is too long", id));
            }
            if self.config.numerical_ids && !id.bytes().all(|digit| digit.is_ascii_digit()) {
                return Err(Refusal::at_field(Rule::Malformed, "an id is no number", id));
            }
        }
        Ok(())
    }

    /// The decision table of figure 8, with the gates it leaves out.
    fn decide(&self, order: &Order) -> Result<Decision, Refusal> {
        let new = order.id != self.order.order_id;
        if !new && order.update_id == self.order.update_id {
            self.objected(order, Relation::Known)?;
            self.check_repetition(order)?;
            let again = self.allows(Permission::BeginAgain, false);
            return Ok(if again { Decision::Begin } else { Decision::Discard });
        }
        if !new && order.update_id < self.order.update_id {
            let refusal = Refusal::new(Rule::Outdated, "the order update is older than the current one");
            self.object(Objection::Outdated, refusal)?;
        }
        if !self.mode.keeps_orders() {
            let refusal = Refusal::new(Rule::OtherOrderActive, "the vehicle is not in an automatic mode");
            self.object(Objection::Mode, refusal.because(Detail::Mode))?;
        }
        if self.config.has("fatalRefuses") && self.allows(Permission::RefuseHelpless, self.errors.need_help()) {
            let refusal = Refusal::new(Rule::OtherOrderActive, "the vehicle waits for somebody to help it");
            return Err(refusal.because(Detail::Mode));
        }
        if new {
            self.check_new(order)?;
            Ok(Decision::Begin)
        } else {
            self.check_update(order)?;
            Ok(Decision::Continue)
        }
    }

    /// What of an order is kept to tell a repetition from another content.
    pub(crate) fn kept(&self, order: &Order) -> (Vec<Node>, Vec<Edge>) {
        match self.config.has("strictUpdates") {
            true => order.content(),
            false => (Vec::new(), Vec::new()),
        }
    }

    /// SINGLE is a word of some versions only.
    fn check_blocking(&self, order: &Order) -> Result<(), Defect> {
        let mut actions = order.actions().filter(|action| action.blocking == Blocking::Single);
        match actions.next().filter(|_| !self.config.has("singleBlocking")) {
            None => Ok(()),
            Some(action) => Err(Defect {
                path: action.path.replace("actionType", "blockingType"),
                reason: "is not a value of the enumeration",
            }),
        }
    }

    /// Whether an order that has the ids of the one there is says the same, and is no update of one that was cancelled; where the
    /// version says anything of that.
    fn check_repetition(&self, order: &Order) -> Result<(), Refusal> {
        if !self.config.has("strictUpdates") {
            return Ok(());
        }
        if self.order.cancel.is_some() || self.order.cancelled {
            let refusal = Refusal::new(Rule::BrokenUpdate, "the order was cancelled");
            self.object(Objection::Cancelled, refusal.because(Detail::Cancelled))?;
        }
        if self.order.content != order.content() {
            let refusal = Refusal::new(Rule::Duplicate, "the order there is has these ids and another content");
            self.object(Objection::OtherContent, refusal)?;
        }
        Ok(())
    }

    /// Whether the vehicle may begin a new order: it has none, can do it, and stands where the order begins (ORD-04,
    /// ORD-FLOW-01 to ORD-FLOW-04).
    fn check_new(&self, order: &Order) -> Result<(), Refusal> {
        let first = &order.nodes[0];
        if self.is_busy() {
            let refusal = Refusal::new(Rule::OtherOrderActive, "another order is active");
            self.object(Objection::Busy, refusal)?;
        }
        self.objected(order, Relation::New)?;
        if order.update_id != 0 && self.config.has("strictUpdates") {
            let refusal = Refusal::at_field(Rule::Malformed, "a new order has orderUpdateId 0", "orderUpdateId");
            self.object(Objection::UpdateId, refusal)?;
        }
        if first.sequence_id != 0 {
            let path = format!("{}.sequenceId", first.path);
            let refusal = Refusal::at_field(Rule::Malformed, "a new order begins with sequenceId 0", &path);
            self.object(Objection::Begin, refusal)?;
        }
        self.check_ability(order, 0)?;
        if self.is_near(first) {
            return Ok(());
        }
        let refusal = Refusal::new(Rule::StartOutOfRange, "the first node is out of reach");
        self.object(Objection::Far, refusal.naming("nodeId", &first.id))
    }

    /// Nodes left, an order action not ended, or a cancellation under way; a horizon keeps it busy.
    pub(crate) fn is_busy(&self) -> bool {
        let open = |action: &Action| action.of_order() && !action.status.is_terminal();
        let counts = |action: &Action| open(action) && self.allows(Permission::Count(action), true);
        let left = |stop: &Stop| self.allows(Permission::CountNode(stop), true);
        let nodes = !self.order.cancelled && self.order.nodes.iter().any(left);
        let busy = nodes || self.actions.iter().any(counts) || self.order.cancel.is_some();
        self.allows(Permission::BeBusy, busy)
    }

    /// Whether the vehicle stands on the node, or inside its deviation range (ORD-04, ORD-05).
    fn is_near(&self, node: &Node) -> bool {
        let position = node.position.as_ref();
        let allowed = position.and_then(|position| position.allowed_deviation);
        let near = self.is_within(node, allowed.unwrap_or(0.0), true);
        self.allows(Permission::BeginAt(node), near && !self.lost)
    }

    /// Whether it stands so far from a node at most, on the map of the node if that counts.
    pub(crate) fn is_within(&self, node: &Node, range: f64, map_counts: bool) -> bool {
        let pose = self.motion.pose(self.moment());
        self.place(node).is_some_and(|place| {
            let same_map = pose.map_id == place.map_id || !map_counts;
            same_map && pose.distance(place.x, place.y) <= range.max(self.config.reach)
        })
    }

    /// Row 4: takes over a new order.
    pub(crate) fn begin(&mut self, order: Order) {
        self.errors.new_order();
        self.forget_actions();
        let moment = self.moment();
        self.motion.halt(moment);
        self.motion.reached = self.is_near(&order.nodes[0]);
        self.requests.awaited.clear();
        let last = (std::mem::take(&mut self.order.last_node), self.order.last_sequence);
        self.order = OrderState::empty(last.0);
        self.order.last_sequence = last.1;
        self.order.order_id.clone_from(&order.id);
        self.order.update_id = order.update_id;
        self.order.zoned = order.zone_set.is_some();
        self.order.content = self.kept(&order);
        self.append(order.nodes, order.edges);
        self.happens(Event::Begun);
    }

    /// Forgets the actions of the order before, and the instant actions that have ended (ORD-FLOW-05).
    fn forget_actions(&mut self) {
        self.actions.drop_lists();
        let old = |action: &&Action| {
            let usual = action.of_order() || action.status.is_terminal() && !self.config.has("instantActionStates");
            self.allows(Permission::Forget(action), usual)
        };
        let old: Vec<String> = self.actions.iter().filter(old).map(Action::id).collect();
        self.actions.retain(|action| !old.contains(&action.request.id));
    }

    /// Puts nodes, edges and their actions at the end of the order.
    pub(crate) fn append(&mut self, nodes: Vec<Node>, edges: Vec<Edge>) {
        let mut edges = edges.into_iter().peekable();
        for node in nodes {
            while let Some(edge) = edges.next_if(|edge| edge.sequence_id < node.sequence_id) {
                self.push_edge(edge);
            }
            if node.released {
                self.order.base_end = (node.id.clone(), node.sequence_id);
            }
            self.push_actions(node.actions.clone(), Origin::Node(node.sequence_id));
            let before = self.order.edges.back();
            let edge = before.filter(|edge| edge.sequence_id + 1 == node.sequence_id);
            if let Some(place) = self.arrives_at(edge, &node) {
                self.order.nodes.push_back(Stop { node, place });
            }
        }
        edges.for_each(|edge| self.push_edge(edge));
    }

    fn push_edge(&mut self, edge: Edge) {
        self.push_actions(edge.actions.clone(), Origin::Edge(edge.sequence_id));
        self.order.edges.push_back(edge);
    }

    /// Lists actions as WAITING (ASTATE-01).
    pub(crate) fn push_actions(&mut self, requests: Vec<ActionRequest>, origin: Origin) {
        for request in requests {
            let kind = action_kinds::find(&self.config, &request.action_type);
            self.actions.retain(|action| action.request.id != request.id);
            self.actions.push(Action::waiting(request, kind, origin));
        }
    }

    /// Does the ended actions of a node once more.
    pub(crate) fn repeat_actions(&mut self, sequence_id: u32) {
        let origin = Origin::Node(sequence_id);
        let finished = |action: &&mut Action| action.origin == origin && action.status == Status::Finished;
        let mut repeated = false;
        for action in self.actions.iter_mut().filter(finished) {
            action.status = Status::Waiting;
            action.result = None;
            repeated = true;
        }
        if repeated {
            self.trigger_actions(origin);
        }
    }
}
