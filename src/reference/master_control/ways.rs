//! How a transport becomes a way: where it starts, over which nodes it leads, and what is done on it.

use serde_json::{Map, Value, json};

use super::Site;
use super::actions::is_predefined;
use super::config::SiteNode;
use super::dispatch::Way;
use super::faults::FaultName as F;
use super::layout::distance;
use super::seen::Position;
use super::tolerances::ToleranceName as T;
use super::vehicle::{Leg, Running, Stop, Transport, Vehicle};

/// How far from a node a vehicle may be and stand on it, where the layout does not say; metres.
const REACH: f64 = 0.3;
/// Closer than this it stands on the node without any deviation.
const EXACT: f64 = 0.05;
/// A vehicle this near to an edge is on it.
const BESIDE: f64 = 0.5;
/// How `r4-letters-in-the-temporary-node` begins the id of a temporary node.
const TEMPORARY: &str = "tmp-";

impl Site {
    /// The first node of a new order, and from which node of the layout the way goes on (ORD-03).
    pub(super) fn start(
        &mut self,
        vehicle: &Vehicle,
        goal: &str,
        asked_at: Option<&(String, Option<Position>)>,
    ) -> Option<(Way, String)> {
        let mut state = vehicle.state.clone()?;
        if let Some((node, position)) = asked_at {
            state.last_node_id.clone_from(node);
            state.agv_position.clone_from(position);
        }
        if let Some((node, position)) = &vehicle.r1_before_manual {
            state.last_node_id.clone_from(node);
            state.agv_position.clone_from(position);
        }
        if let Some((node, position)) = &vehicle.r3_before_init
            && self.faults.has(F::R3StartFromBeforeInitPosition)
        {
            state.last_node_id.clone_from(node);
            state.agv_position.clone_from(position);
        }
        if let Some(shown) = &vehicle.r4_shown_at
            && let Some((node, _)) = self.config.nearest(shown.x, shown.y, &shown.map_id)
        {
            state.last_node_id.clone_from(&node.id);
            state.agv_position = Some(shown.clone());
        }
        let last = self.config.node(&state.last_node_id);
        let alone = |node: &SiteNode| {
            let way = Way {
                stops: vec![Stop::from(node)],
                legs: Vec::new(),
            };
            Some((way, node.id.clone()))
        };
        let old = vehicle.last_order.as_ref().and_then(|order| order.stops.first());
        if self.faults.has(F::NextOrderFromOldStart)
            && let Some(node) = old.and_then(|stop| self.config.node(&stop.id))
        {
            return alone(node);
        }
        let ended = vehicle.last_order.as_ref().and_then(|order| order.stops.last());
        if self.faults.has(F::R3GoalTakenForReached)
            && let Some(node) = ended.and_then(|stop| self.config.node(&stop.id))
        {
            return alone(node);
        }
        let called_off = vehicle.last_order.as_ref().filter(|_| vehicle.r1_cancelled);
        let ahead = called_off.and_then(|order| order.stops.get(order.reached(Some(&state)) + 1));
        if self.faults.has(F::R4StartAtTheNodeAheadAfterCancel)
            && let Some(node) = ahead.and_then(|stop| self.config.node(&stop.id))
        {
            return alone(node);
        }
        let base_end = called_off.and_then(|order| order.stops.get(order.released.checked_sub(1)?));
        if self.faults.has(F::R6AfterCancelStartsAtOldBaseEnd)
            && let Some(node) = base_end.and_then(|stop| self.config.node(&stop.id))
        {
            return alone(node);
        }
        let Some(position) = &state.agv_position else {
            let tagged =
                last.filter(|_| vehicle.r1_cancelled && self.faults.has(F::R5NodeBoundVehicleGetsTemporaryNode));
            if let Some(node) = tagged.cloned() {
                let position = Position::of(node.x, node.y, node.map_id);
                return self.between(vehicle, &position, goal);
            }
            let goal = vehicle.last_order.as_ref().and_then(|order| {
                let end = order.released.checked_sub(1)?;
                self.config.node(&order.stops.get(end)?.id)
            });
            let goal = goal.filter(|_| self.faults.has(F::R1LineGuidedFromBaseEnd));
            let ended = vehicle.last_order.as_ref().filter(|_| vehicle.r1_cancelled);
            let next = ended.and_then(|order| {
                let next = order.stops.get(order.reached(Some(&state)) + 1)?;
                self.config.node(&next.id)
            });
            let goal = goal.or(next.filter(|_| self.faults.has(F::R2LineGuidedFromNextNode)));
            return alone(goal.or(last)?);
        };
        let unsure = position.localization_score.is_some_and(|score| score < 0.5);
        if unsure && self.faults.has(F::R3LowScoreStartsBeside) {
            let position = position.clone();
            return self.between(vehicle, &position, goal);
        }
        let away = |node: &SiteNode| distance((node.x, node.y), (position.x, position.y));
        let mapless = self.faults.has(F::R2StartIgnoresMap);
        let stands = |node: &&SiteNode| {
            (node.map_id == position.map_id || mapless) && away(node) <= node.deviation_xy.unwrap_or(REACH).max(EXACT)
        };
        let near = || {
            if mapless {
                return self.config.nodes.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
            }
            self.config
                .nearest(position.x, position.y, &position.map_id)
                .map(|(node, _)| node)
        };
        let wide = |node: &SiteNode, spare: f64| {
            let (mut way, here) = alone(node)?;
            let least = if self.faults.has(F::R2DeviationHalved) {
                away(node) / 2.0
            } else {
                away(node) + spare
            };
            if self.faults.has(F::R2StartNodeMovedToVehicle) {
                (way.stops[0].x, way.stops[0].y) = (position.x, position.y);
            }
            way.stops[0].deviation_xy = Some(way.stops[0].deviation_xy.map_or(least, |known| known.max(least)));
            Some((way, here))
        };
        if let Some(node) = last.filter(stands).or_else(|| near().filter(stands)) {
            return if away(node) <= EXACT {
                alone(node)
            } else if self.takes(T::R1TemporaryStart) {
                let position = position.clone();
                self.between(vehicle, &position, goal)
            } else {
                wide(node, 0.1)
            };
        }
        if self.takes(T::StandsOnLastNode)
            && let Some(node) = last.filter(|node| node.map_id == position.map_id)
        {
            return wide(node, 0.2);
        }
        if let Some(node) = last.filter(|_| self.faults.has(F::R1LastNodeTooNarrow)) {
            return alone(node);
        }
        let position = position.clone();
        self.between(vehicle, &position, goal)
    }

    /// Begins at a temporary node where the vehicle stands (ORD-CANCEL-17).
    pub(super) fn between(&mut self, vehicle: &Vehicle, position: &Position, goal: &str) -> Option<(Way, String)> {
        let seen = vehicle.r2_seen_at.as_ref();
        let seen = seen.filter(|_| self.faults.has(F::R2TemporaryStartFromVisualization));
        let position = seen.unwrap_or(position);
        let before = vehicle.r3_cancelled_at.as_ref().filter(|_| vehicle.r1_cancelled);
        let before = before.filter(|_| self.faults.has(F::R3TemporaryNodeWhereCancelled));
        let position = before.unwrap_or(position);
        let here = (position.x, position.y);
        let place = |id: &str| self.config.node(id).map(|node| (node.x, node.y));
        let beside = self.config.edges.iter().filter(|edge| {
            let (Some(a), Some(b)) = (self.config.node(&edge.from), self.config.node(&edge.to)) else {
                return false;
            };
            let free = !vehicle.blocked.contains(&(edge.from.clone(), edge.to.clone()));
            let here_too = a.map_id == position.map_id && b.map_id == position.map_id;
            free && here_too && off_line((a.x, a.y), (b.x, b.y), here) <= BESIDE
        });
        let nearest = self
            .config
            .nearest(here.0, here.1, &position.map_id)
            .map(|(node, _)| node.id.as_str());
        let mut candidates: Vec<(&str, f64)> = beside.map(|edge| (edge.to.as_str(), 0.0)).collect();
        if candidates.is_empty() {
            candidates.extend(nearest.map(|id| (id, 0.0)));
        }
        for candidate in &mut candidates {
            let ahead = place(candidate.0).map_or(f64::MAX, |place| distance(here, place));
            let way = self.config.any_way(candidate.0, goal, &vehicle.blocked);
            let rest = way.map_or(f64::MAX, |way| {
                let ends = way
                    .iter()
                    .filter_map(|edge| Some((place(&edge.from)?, place(&edge.to)?)));
                ends.map(|(a, b)| distance(a, b)).sum()
            });
            candidate.1 = ahead + rest;
        }
        let best = candidates.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let next = self.config.node(best?.0)?.clone();
        if self.faults.has(F::NextOrderAhead) {
            let way = Way {
                stops: vec![Stop::from(&next)],
                legs: Vec::new(),
            };
            return Some((way, next.id));
        }
        let last = vehicle
            .state
            .as_ref()
            .map(|state| state.last_node_id.clone())
            .unwrap_or_default();
        let id = if self.faults.has(F::OneIdTwoPlaces) && !last.is_empty() {
            last
        } else if self.faults.has(F::R1TemporaryNodeIdFixed) {
            "temporary".to_owned()
        } else if self.faults.has(F::R3TemporaryIdWithCoordinates) {
            format!("({:.2}, {:.2})", position.x, position.y)
        } else if self.faults.has(F::R4LettersInTheTemporaryNode) {
            self.ids += 1;
            format!("{TEMPORARY}{}", self.ids)
        } else {
            self.next_id(vehicle, "place")
        };
        let turned = self.takes(T::R3TemporaryNodeWithTheta);
        let first = Stop {
            id: id.clone(),
            x: position.x,
            y: position.y,
            map_id: position.map_id.clone(),
            deviation_xy: Some(if self.takes(T::R3TemporaryNodeWide) { 1.0 } else { REACH }),
            theta: turned.then(|| position.theta.sin().atan2(position.theta.cos())),
            deviation_theta: turned.then_some(std::f64::consts::PI),
            ..Stop::default()
        };
        let leg = Leg {
            id: self.next_id(vehicle, "way"),
            from: id,
            to: next.id.clone(),
            max_speed: Some(1.0),
            ..Leg::default()
        };
        let way = Way {
            stops: vec![first, Stop::from(&next)],
            legs: vec![leg],
        };
        Some((way, next.id))
    }

    /// Leads a way on from a node of the layout over all places of a transport.
    pub(super) fn lead(
        &mut self,
        vehicle: &mut Vehicle,
        way: &mut Way,
        here: &str,
        transport: &Transport,
    ) -> Option<()> {
        let mut here = here.to_owned();
        if let Some(from) = transport.from.as_ref().filter(|_| !transport.loaded) {
            self.extend(vehicle, way, &here, from)?;
            here.clone_from(from);
            self.load(vehicle, way, "pick", transport);
        }
        self.extend(vehicle, way, &here, &transport.to)?;
        let carries = vehicle.state.as_ref().and_then(|state| state.loads.as_ref());
        let carries = carries.is_some_and(|loads| !loads.is_empty());
        if transport.from.is_some() {
            self.load(vehicle, way, "drop", transport);
        } else if transport.load_type.is_some() && transport.action.is_none() {
            self.load(vehicle, way, if carries { "drop" } else { "pick" }, transport);
        }
        if let Some(kind) = &transport.action {
            let mut given = transport.parameters.as_object().cloned().unwrap_or_default();
            if matches!(kind.as_str(), "pick" | "drop")
                && let Some(load_type) = &transport.load_type
            {
                given.entry("loadType").or_insert(json!(load_type));
            }
            self.perform(vehicle, way, kind, &Value::Object(given));
        }
        if self.faults.has(F::R1PickAndDropShareId) {
            share_id(way);
        }
        if self.faults.has(F::R2StateRequestAtGoal) {
            let action = self.action(vehicle, "stateRequest", &Value::Null);
            way.stops.last_mut()?.actions.push(action);
        }
        if self.faults.has(F::CancelOnNode) {
            let action = self.action(vehicle, "startPause", &Value::Null);
            way.stops.last_mut()?.actions.push(action);
        }
        Some(())
    }

    pub(super) fn extend(&mut self, vehicle: &Vehicle, way: &mut Way, from: &str, to: &str) -> Option<()> {
        let blind = std::collections::BTreeSet::new();
        let blocked = if self.faults.has(F::BlockedEdgeUsed) || vehicle.r1_blind {
            &blind
        } else {
            &vehicle.blocked
        };
        let mut edges = self.config.any_way(from, to, blocked)?;
        if let Some(first) = edges.first().filter(|_| self.takes(T::R1TakesTheLongWay)) {
            let mut closed = blocked.clone();
            closed.insert((first.from.clone(), first.to.clone()));
            edges = self.config.way(from, to, &closed).unwrap_or(edges);
        }
        for edge in edges {
            way.legs.push(Leg::from(edge));
            way.stops.push(Stop::from(self.config.node(&edge.to)?));
        }
        Some(())
    }

    /// pick or drop at the end of a way.
    pub(super) fn load(&mut self, vehicle: &mut Vehicle, way: &mut Way, kind: &str, transport: &Transport) {
        let mut given = Map::new();
        given.insert("stationType".into(), json!(self.config.station_type));
        if let Some(load_type) = &transport.load_type {
            given.insert("loadType".into(), json!(load_type));
        }
        let there = way.legs.is_empty() && way.stops.first().is_some_and(|stop| !stop.id.is_empty());
        let there = there && way.stops[0].actions.is_empty();
        if kind == "pick" && self.faults.has(F::PickAtOnce)
            || kind == "drop" && there && self.faults.has(F::R1DropAtOnceWhenThere)
        {
            let action = self.action(vehicle, kind, &Value::Object(given));
            self.queue(vehicle, action);
            return;
        }
        let sheet = vehicle.factsheet.as_ref();
        let roomy = sheet.is_some_and(|sheet| {
            let actions = sheet.limit(&["node.actions"]);
            let taken = way.stops.last().map_or(0, |stop| stop.actions.len());
            sheet.limit(&["actions.actionsParameters"]) == usize::MAX && actions >= taken + 2
        });
        let lists = |kind: &str| sheet.and_then(|sheet| sheet.actions.as_ref()?.get(kind));
        let named = lists(kind).and_then(|offer| offer.action_parameters.as_ref());
        let named = named.is_some_and(|list| list.iter().any(|parameter| parameter.key == "loadId"));
        let fine = lists("finePositioning").is_some() && self.offers(sheet, "finePositioning", "NODE");
        let fine = fine && kind == "pick" && self.offers(sheet, kind, "NODE");
        if kind == "pick" && named && roomy && self.takes(T::R3LoadIdGiven) {
            given.insert("loadId".into(), json!(self.next_id(vehicle, "load")));
        }
        if fine && roomy && self.takes(T::R3FinePositioningBeforePick) {
            self.perform(vehicle, way, "finePositioning", &Value::Null);
        }
        self.perform(vehicle, way, kind, &Value::Object(given));
    }

    /// An action at the end of a way, in a scope the vehicle offers it in.
    pub(super) fn perform(&mut self, vehicle: &Vehicle, way: &mut Way, kind: &str, given: &Value) {
        let sheet = vehicle.factsheet.as_ref();
        let heedless = self.faults.has(F::NodeActionsIgnored);
        let room =
            |name: &str, taken: usize| heedless || taken < sheet.map_or(usize::MAX, |sheet| sheet.limit(&[name]));
        let on_node = self.offers(sheet, kind, "NODE");
        let on_edge = self.offers(sheet, kind, "EDGE");
        let on_node = on_node || (on_edge && self.faults.has(F::R2EdgeActionOnNode));
        let led = kind == "waitForTrigger" && self.faults.has(F::R1TriggerOnEdge);
        if let Some(leg) = way.legs.last_mut().filter(|leg| {
            let rather = on_edge && self.takes(T::R1ActionsOnEdges) && room("edge.actions", leg.actions.len());
            led || rather
        }) {
            leg.actions.push(self.r4_hard(vehicle, kind, given));
            return;
        }
        if let Some(stop) = way
            .stops
            .last_mut()
            .filter(|stop| on_node && room("node.actions", stop.actions.len()))
        {
            let mut action = self.r4_hard(vehicle, kind, given);
            let listed = sheet.and_then(|sheet| sheet.actions.as_ref()?.get(kind)?.blocking_types.as_ref());
            let nothing = listed.is_none_or(|listed| listed.iter().any(|blocking| blocking == "NONE"));
            if nothing && !is_predefined(kind) && self.takes(T::R3VendorActionsBlockNothing) {
                action["blockingType"] = json!("NONE");
            }
            if self.faults.has(F::R2ActionIdOfStation) {
                action["actionId"] = json!(format!("{kind}-{}", stop.id));
            }
            stop.actions.push(action);
        } else if let Some(leg) = way
            .legs
            .last_mut()
            .filter(|leg| on_edge && room("edge.actions", leg.actions.len()))
        {
            leg.actions.push(self.r4_hard(vehicle, kind, given));
        }
    }

    /// An action for an order; HARD whatever the vehicle lists (`r4-hard-although-not-listed`).
    fn r4_hard(&mut self, vehicle: &Vehicle, kind: &str, given: &Value) -> Value {
        let mut action = self.action(vehicle, kind, given);
        if self.faults.has(F::R4HardAlthoughNotListed) {
            action["blockingType"] = json!("HARD");
        }
        action
    }

    /// Whether the vehicle takes the ids of a way (FACT-12).
    pub(super) fn names_fit(&self, vehicle: &Vehicle, way: &Way) -> bool {
        let Some(sheet) = &vehicle.factsheet else { return true };
        let longest = sheet
            .id_length
            .filter(|_| !self.faults.has(F::IdLimitIgnored))
            .unwrap_or(usize::MAX);
        let digits = sheet.ids_numerical && !self.faults.has(F::NumericalIdsIgnored);
        let heedless = |id: &str| self.faults.has(F::R4LettersInTheTemporaryNode) && id.starts_with(TEMPORARY);
        let digits = |id: &str| digits && !heedless(id);
        let fits = |id: &str| {
            id.chars().count() <= longest && (!digits(id) || id.chars().all(|letter| letter.is_ascii_digit()))
        };
        let nodes = way.stops.iter().map(|stop| stop.id.as_str());
        nodes.chain(way.legs.iter().map(|leg| leg.id.as_str())).all(fits)
    }

    /// Whether the vehicle takes as many actions on one node, and as many parameters of one action, as the way has.
    pub(super) fn actions_fit(&self, vehicle: &Vehicle, way: &Way) -> bool {
        let Some(sheet) = &vehicle.factsheet else { return true };
        let limit = |name: &str, ignored: F| {
            let limit = sheet.limit(&[name]);
            if self.faults.has(ignored) { usize::MAX } else { limit }
        };
        let on_nodes = way.stops.iter().flat_map(|stop| &stop.actions);
        let actions = on_nodes.chain(way.legs.iter().flat_map(|leg| &leg.actions));
        let parameters = |action: &Value| action["actionParameters"].as_array().map_or(0, Vec::len);
        let most = actions.map(parameters).max().unwrap_or_default();
        let busiest = way.legs.iter().map(|leg| leg.actions.len()).max().unwrap_or_default();
        let zero = sheet.has_zeros && self.faults.has(F::ZeroIsALimit);
        !zero
            && Running::busiest(&way.stops) <= limit("node.actions", F::NodeActionsIgnored)
            && busiest <= limit("edge.actions", F::NodeActionsIgnored)
            && most <= limit("actions.actionsParameters", F::ParametersIgnored)
    }
}

/// `r1-pick-and-drop-share-id`: gives a drop the id of the pick before it.
fn share_id(way: &mut Way) {
    let mut picked = None;
    for action in way.stops.iter_mut().flat_map(|stop| &mut stop.actions) {
        if action["actionType"] == "pick" {
            picked = Some(action["actionId"].clone());
        } else if action["actionType"] == "drop"
            && let Some(id) = &picked
        {
            action["actionId"] = id.clone();
        }
    }
}

/// How far a point is from the line between two others.
fn off_line(a: (f64, f64), b: (f64, f64), point: (f64, f64)) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let square = dx * dx + dy * dy;
    let share = if square > 0.0 {
        (((point.0 - a.0) * dx + (point.1 - a.1) * dy) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    distance((a.0 + share * dx, a.1 + share * dy), point)
}
