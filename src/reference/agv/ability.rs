//! Whether the vehicle can do what an order asks for: memory, fields, maps, ways and actions.

use super::action_kinds::{self, Scope};
use super::actions::Origin;
use super::book::Place;
use super::faults::FaultName as F;
use super::order_message::{ActionRequest, Edge, Node, Order};
use super::rejection::{Refusal, Rule};
use super::{Agv, motion};

/// How far an edge orientation may be from forwards or backwards, in radians: the vehicle has two driven wheels.
const SIDEWAYS: f64 = 0.1;

/// Slowest controlled speed, in metres or radians per second.
pub(crate) const SLOWEST: f64 = 0.01;

impl Agv {
    /// Where a node is: as the order says, else as the layout knows. A line-guided vehicle only knows its layout.
    pub(crate) fn place(&self, node: &Node) -> Option<Place> {
        if let Some(position) = node.position.as_ref().filter(|_| !self.config.line_guided()) {
            // With its axes mirrored it reads places it does not know as it reports them.
            let mirrored = self.faults.has(F::AxesMirrored) && self.config.node(&node.id).is_none();
            return Some(Place {
                x: position.x,
                y: if mirrored { -position.y } else { position.y },
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
    pub(crate) fn check_ability(&self, order: &mut Order, known: usize) -> Result<(), Refusal> {
        self.check_memory(order, known)?;
        let usable = |path: &&String| path.rsplit('.').next().is_some_and(|field| self.config.uses(field));
        self.check_zone_set(order)?;
        let unread = known > 0 && self.faults.has(F::R3UnsupportedFieldInUpdateIgnored);
        if unread && !self.config.trajectories {
            for edge in &mut order.edges {
                (edge.trajectory, edge.corridor) = (None, None);
            }
        }
        if let Some(path) = order
            .unsupported
            .iter()
            .filter(|path| !(path.ends_with("minHeight") && self.faults.has(F::R2MinHeightIgnored)))
            .find(|path| !usable(path))
            .filter(|_| !unread && !self.faults.has(F::UnsupportedFieldIgnored))
        {
            return Err(Refusal::at_field(
                Rule::Unable,
                &format!("the vehicle has no use for {path}"),
                path,
            ));
        }
        if let Some(defect) = order.defects.first().filter(|_| self.config.trajectories) {
            return Err(defect.clone().into());
        }
        for (index, node) in order.nodes.iter().enumerate() {
            if node.position.is_none() && self.faults.has(F::R3NodePositionDemanded) {
                let path = format!("{}.nodePosition", node.path);
                let refusal = Refusal::at_field(Rule::Unable, "the vehicle needs the position of the node", &path);
                return Err(refusal.naming("nodeId", &node.id));
            }
            let Some(place) = self.place(node) else {
                let path = format!("{}.nodePosition", node.path);
                let refusal = Refusal::at_field(Rule::Unable, "the vehicle does not know where the node is", &path);
                return Err(refusal.naming("nodeId", &node.id));
            };
            let skipped = known > 0 && self.faults.has(F::R4MapCheckSkippedInUpdate);
            if !skipped && (index == 0 || !self.faults.has(F::R3OnlyFirstMapChecked)) {
                self.check_map(node, &place)?;
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
        let Some(wanted) = &order.zone_set else { return Ok(()) };
        let known = self.config.zone_set.as_ref() == Some(wanted);
        if known || self.faults.has(F::ZoneSetUnchecked) {
            return Ok(());
        }
        Err(Refusal::at_field(
            Rule::Unable,
            "the vehicle does not have the zone set",
            "zoneSetId",
        ))
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
        let too_many_actions = too_many_actions && !self.faults.has(F::R1SurplusActionsDropped);
        if self.faults.has(F::R1SurplusActionsDropped) {
            let most = self.config.max_actions;
            order.nodes.iter_mut().for_each(|node| node.actions.truncate(most));
            order.edges.iter_mut().for_each(|edge| edge.actions.truncate(most));
        }
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
        if !node.released && self.faults.has(F::R2MapOfHorizonUnchecked) {
            return Ok(());
        }
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
        if edge.max_speed.is_some_and(|speed| speed < SLOWEST) {
            return unable("maxSpeed", "the vehicle cannot drive so slowly");
        }
        if edge.max_rotation_speed.is_some_and(|speed| speed < SLOWEST) {
            return unable("maxRotationSpeed", "the vehicle cannot turn so slowly");
        }
        if edge.max_height.is_some_and(|height| height < self.config.height) && !self.faults.has(F::MaxHeightIgnored) {
            return unable("maxHeight", "the vehicle is higher");
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
        if possible || self.faults.has(F::OrientationUnchecked) {
            return Ok(());
        }
        unable("orientation", "the vehicle cannot drive sideways")
    }

    fn check_actions(&self, order: &Order, known: usize) -> Result<(), Refusal> {
        if known > 0 && self.faults.has(F::R4UpdateActionsNotChecked) {
            return Ok(());
        }
        let all = !self.faults.has(F::R2HorizonActionsUnchecked);
        let nodes = order.nodes.iter().skip(known).filter(|node| node.released || all);
        let nodes = nodes.flat_map(|node| &node.actions);
        let none = self.faults.has(F::R3EdgeActionsUnchecked);
        let edges = order.edges.iter().filter(|edge| (edge.released || all) && !none);
        let edges = edges.flat_map(|edge| &edge.actions);
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
            let request_taken = self.faults.has(F::R2RequestsOnNodesTaken)
                && matches!(
                    kind.deed,
                    action_kinds::Deed::StateRequest
                        | action_kinds::Deed::FactsheetRequest
                        | action_kinds::Deed::LogReport
                );
            let of_edge = scope == Scope::Edge && self.faults.has(F::R4EdgeScopeNotChecked);
            let charges = scope == Scope::Edge && kind.deed == action_kinds::Deed::StartCharging;
            let of_edge = of_edge || charges && self.faults.has(F::R6ChargingOnEdgeAccepted);
            if listed_refused
                || (!request_taken && !of_edge && !kind.scopes.contains(&scope) && !self.faults.has(F::ScopeUnchecked))
            {
                return unable("the action is not possible here", &request.path);
            }
            let found = action_kinds::refusal(kind, request, &self.config, true)
                .filter(|(_, reason)| !(reason.ends_with("missing") && self.faults.has(F::R1MissingParameterTaken)))
                .filter(|_| !self.faults.has(F::ParametersUnchecked));
            if let Some((key, reason)) = found {
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
}
