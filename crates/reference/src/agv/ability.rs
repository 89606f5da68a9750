//! Whether the vehicle can do what an order asks for: memory (section 6.1.2), optional fields (6.1.1), maps (6.7.1),
//! ways and actions (6.6.4.2 and 6.8.1).
//!
//! How an order is refused that exceeds the memory or leads over a map that is not on board, is left open: as an order
//! error (the rulings of ORD-REJ-15 and MAP-08). Of a mapId any enabled version will do (the ruling of MAP-13).

use super::action_kinds::{self, Scope};
use super::actions::Origin;
use super::objections::{Asked, Lack, Objection};
use super::order_message::{Edge, Node, Order};
use super::order_state::Place;
use super::read::Defect;
use super::rejection::{Detail, Refusal, Rule};
use super::{Agv, motion};

/// How far an edge orientation may be from forwards or backwards, in radians: the vehicle has two driven wheels.
const SIDEWAYS: f64 = 0.1;

/// No floor of a layout reaches so far beyond its nodes, in metres.
const OFF_THE_FLOOR: f64 = 1_000.0;

/// Slowest controlled speed, in metres or radians per second.
pub(crate) const SLOWEST: f64 = 0.01;

impl Agv {
    /// Place of a node: as the order says, else as the layout knows. A line-guided vehicle only knows its layout.
    pub(crate) fn place(&self, node: &Node) -> Option<Place> {
        if let Some(position) = node.position.as_ref().filter(|_| !self.config.line_guided()) {
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
    pub(crate) fn check_ability(&self, order: &Order, known: usize) -> Result<(), Refusal> {
        let update = known > 0;
        self.check_memory(order, known)?;
        self.check_zone_set(order)?;
        let usable = |path: &String| path.rsplit('.').next().is_some_and(|field| self.config.uses(field));
        for path in order.unsupported.iter().filter(|path| !usable(path)) {
            let refusal = Refusal::at_field(
                Rule::Unable,
                &format!("the vehicle has no use for {}", self.spelled_path(path)),
                path,
            );
            self.object(Objection::Unused(path, update), refusal.because(Detail::UnusedField))?;
        }
        if let Some(defect) = order.defects.first().filter(|_| self.config.trajectories) {
            return Err(defect.clone().into());
        }
        let needs_knots = self.config.trajectories && !self.config.has("trajectoryDefaults");
        let mut edges = order.edges.iter().filter(|_| needs_knots);
        if let Some(edge) = edges.find(|edge| edge.trajectory.as_ref().is_some_and(|curve| curve.lacks_knots)) {
            return Err(Defect::no_curve(&format!("{}.trajectory", edge.path)).into());
        }
        for (index, node) in order.nodes.iter().enumerate() {
            let Some(place) = self.place(node) else {
                let path = format!("{}.nodePosition", node.path);
                let refusal = Refusal::at_field(Rule::Unable, "the vehicle does not know where the node is", &path);
                let refusal = refusal.naming("nodeId", &node.id);
                return Err(match self.config.has("unreachableRefused") {
                    true => refusal.because(Detail::NoRoute),
                    false => refusal,
                });
            };
            self.check_map(node, &place, (index, update))?;
            if index > 0 {
                self.check_reach(node, &place)?;
            }
        }
        for (index, edge) in order.edges.iter().enumerate() {
            let ends = order.nodes.get(index).zip(order.nodes.get(index + 1));
            self.check_edge(edge, ends)?;
        }
        self.check_actions(order, known)
    }

    /// It plans with the zone set it has, or not at all.
    fn check_zone_set(&self, order: &Order) -> Result<(), Refusal> {
        if order.zone_set.is_none() || order.zone_set == self.config.zone_set {
            return Ok(());
        }
        let refusal = Refusal::at_field(Rule::Unable, "the vehicle does not have the zone set", "zoneSetId");
        self.object(Objection::ZoneSet, refusal)
    }

    /// An order that does not fit into the memory is refused as a whole (ORD-REJ-15).
    fn check_memory(&self, order: &Order, known: usize) -> Result<(), Refusal> {
        let released = self.order.nodes.iter().filter(|stop| stop.node.released);
        let left = if known == 0 { 0 } else { released.count() };
        if left + order.nodes.len() > self.config.max_nodes {
            let refusal = Refusal::at_field(Rule::Memory, "the order has too many nodes", "nodes");
            self.object(Objection::Nodes, refusal)?;
        }
        let of_nodes = order.nodes.iter().map(|node| node.actions.len());
        let of_edges = order.edges.iter().map(|edge| edge.actions.len());
        if of_nodes
            .chain(of_edges)
            .any(|actions| actions > self.config.max_actions)
        {
            let refusal = Refusal::at_field(Rule::Memory, "a node or edge has too many actions", "actions");
            self.object(Objection::Actions, refusal)?;
        }
        Ok(())
    }

    /// A node is on a map that is on board and enabled (MAP-08, MAP-13).
    fn check_map(&self, node: &Node, place: &Place, (index, update): (usize, bool)) -> Result<(), Refusal> {
        let refusal = |reason| {
            let refusal = Refusal::new(Rule::UnknownMap, reason).naming("mapId", &place.map_id);
            refusal.naming("nodeId", &node.id)
        };
        if !self.maps.on_board(&place.map_id) {
            self.object(Objection::Map(node, index, update), refusal("the map is not on board"))?;
        } else if !self.maps.enabled(&place.map_id) {
            self.object(
                Objection::DisabledMap(node, index, update),
                refusal("the map is not enabled"),
            )?;
        }
        Ok(())
    }

    /// A node that lies far off the floor that the vehicle knows cannot be reached (ORD-REJ-22).
    fn check_reach(&self, node: &Node, place: &Place) -> Result<(), Refusal> {
        if !self.config.has("unreachableRefused") {
            return Ok(());
        }
        let known = self.config.nodes.iter().filter(|known| known.map_id == place.map_id);
        let mut distances = known
            .map(|known| (known.x - place.x).hypot(known.y - place.y))
            .peekable();
        if distances.peek().is_none() || distances.any(|distance| distance < OFF_THE_FLOOR) {
            return Ok(());
        }
        let refusal = Refusal::new(Rule::Unable, "a node is out of reach").naming("nodeId", &node.id);
        self.object(Objection::Unreachable, refusal.because(Detail::NoRoute))
    }

    fn check_edge(&self, edge: &Edge, ends: Option<(&Node, &Node)>) -> Result<(), Refusal> {
        let unable = |field: &str, reason: &str| {
            let path = format!("{}.{field}", edge.path);
            Refusal::at_field(Rule::Unable, reason, &path)
                .naming("edgeId", &edge.id)
                .because(Detail::UnusedField)
        };
        if edge.max_speed.is_some_and(|speed| speed < SLOWEST) {
            return Err(unable("maxSpeed", "the vehicle cannot drive so slowly"));
        }
        if edge.max_rotation_speed.is_some_and(|speed| speed < SLOWEST) {
            return Err(unable("maxRotationSpeed", "the vehicle cannot turn so slowly"));
        }
        if edge.max_height.is_some_and(|height| height < self.config.height) {
            self.object(Objection::Height, unable("maxHeight", "the vehicle is higher"))?;
        }
        self.check_way(edge, ends)?;
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
        if possible {
            return Ok(());
        }
        let refusal = unable("orientation", "the vehicle cannot drive sideways");
        self.object(Objection::Orientation, refusal)
    }

    /// Every action is known, possible where it is asked for, and has its parameters (ORD-REJ-04, ACT-10).
    fn check_actions(&self, order: &Order, known: usize) -> Result<(), Refusal> {
        let asked = |(of_edge, released): (bool, bool)| {
            move |request| Asked {
                request,
                released,
                of_edge,
                update: known > 0,
            }
        };
        let nodes = order.nodes.iter().skip(known);
        let of_nodes = nodes.flat_map(|node| node.actions.iter().map(asked((false, node.released))));
        let edges = order.edges.iter();
        let of_edges = edges.flat_map(|edge| edge.actions.iter().map(asked((true, edge.released))));
        let mut seen: Vec<&str> = Vec::new();
        for asked in of_nodes.chain(of_edges) {
            let taken = seen.contains(&asked.request.id.as_str()) || self.id_taken(&asked.request.id, known);
            self.check_action(asked, taken)?;
            seen.push(&asked.request.id);
        }
        Ok(())
    }

    fn check_action(&self, asked: Asked<'_>, id_taken: bool) -> Result<(), Refusal> {
        let request = asked.request;
        let unable = |reason: &str| {
            let refusal = Refusal::at_field(Rule::Unable, reason, &request.path).naming("actionId", &request.id);
            refusal.naming("actionType", &request.action_type)
        };
        let object = |lack: Lack<'_>, refusal: Refusal| self.object(Objection::Action(asked, lack), refusal);
        if id_taken {
            object(Lack::Id, unable("the actionId is not unique"))?;
        }
        let Some(kind) = action_kinds::find(&self.config, &request.action_type) else {
            return object(Lack::Kind, unable("the vehicle does not know the action"));
        };
        let scope = if asked.of_edge { Scope::Edge } else { Scope::Node };
        if !kind.scopes.contains(&scope) {
            object(Lack::Scope(kind), unable("the action is not possible here"))?;
        }
        if let Some((key, reason)) = action_kinds::refusal(kind, request, &self.config, true) {
            let refusal = Refusal::at_field(Rule::Unable, reason, &request.path).naming("actionParameter", key);
            object(Lack::Parameter(reason), refusal.naming("actionId", &request.id))?;
        }
        Ok(())
    }

    /// Whether an action of that id stays when the order is taken over.
    fn id_taken(&self, id: &str, known: usize) -> bool {
        self.actions.get(id).is_some_and(|action| match action.origin {
            Origin::Instant => known > 0 || !action.status.is_terminal(),
            Origin::Zone(_) => true,
            Origin::Node(sequence_id) | Origin::Edge(sequence_id) => known > 0 && sequence_id <= self.order.base_end.1,
        })
    }
}
