//! Transports: where a vehicle stands, the way it takes, what it does there, and when an order is begun.

use std::time::Duration;

use serde_json::{Map, Value, json};

use super::Site;
use super::config::{SiteEdge, SiteNode};
use super::faults::FaultName as F;
use super::layout::distance;
use super::order::Window;
use super::seen::Position;
use super::tolerances::ToleranceName as T;
use super::vehicle::{Leg, Running, Stop, Transport, Vehicle};

/// How far from a node a vehicle may be and stand on it, where the layout does not say; metres.
const REACH: f64 = 0.3;
/// Closer than this it stands on the node without any deviation.
const EXACT: f64 = 0.05;
/// A vehicle this near to an edge is on it.
const BESIDE: f64 = 0.5;

impl From<&SiteNode> for Stop {
    fn from(node: &SiteNode) -> Self {
        Self {
            id: node.id.clone(),
            x: node.x,
            y: node.y,
            theta: node.theta,
            map_id: node.map_id.clone(),
            deviation_xy: node.deviation_xy,
            deviation_theta: node.deviation_theta,
            actions: Vec::new(),
        }
    }
}

impl From<&SiteEdge> for Leg {
    fn from(edge: &SiteEdge) -> Self {
        Self {
            id: edge.id.clone(),
            from: edge.from.clone(),
            to: edge.to.clone(),
            max_speed: edge.max_speed,
            max_height: edge.max_height,
            min_height: edge.min_height,
            direction: edge.direction.clone(),
            corridor: edge.corridor,
            actions: Vec::new(),
        }
    }
}

/// A way as far as it is planned.
#[derive(Clone, Debug, Default)]
pub(super) struct Way {
    pub(super) stops: Vec<Stop>,
    pub(super) legs: Vec<Leg>,
}

impl Site {
    /// Begins the next transport of a vehicle that is free, fit and known.
    pub(super) fn begin_next(&mut self, vehicle: &mut Vehicle) {
        let idle = vehicle.running.is_none() && vehicle.cancel.is_none();
        if !idle || vehicle.queue.is_empty() || !self.commandable(vehicle) || !self.may_begin(vehicle) {
            return;
        }
        if let Some(due) = self.next_order_at(vehicle) {
            vehicle.at(due);
            return;
        }
        let Some(transport) = vehicle.queue.front().cloned() else {
            return;
        };
        let Some(way) = self.planned(vehicle, &transport) else {
            // There is no way, or the vehicle cannot be told it.
            vehicle.queue.pop_front();
            vehicle.at(self.now.moment);
            return;
        };
        let mut running = Running {
            id: self.next_id(vehicle, "order"),
            update_id: if self.takes(T::UpdateIdFromSeven) { 7 } else { 0 },
            stops: way.stops,
            legs: way.legs,
            transport,
            ..Running::default()
        };
        if self.faults.has(F::R1SequenceContinuesOverOrders) {
            running.r1_offset = vehicle.r1_sequence;
        }
        if self.faults.has(F::R1OrderIdKeptAfterCancel)
            && let Some((id, update)) = &vehicle.r1_kept
        {
            running.id.clone_from(id);
            running.update_id = update + 1;
        }
        let end = self.free_until(vehicle, &running, 0);
        let released = end.min(self.config.base_length.max(1).saturating_add(1));
        if released < 2 && running.stops.len() > 1 {
            return;
        }
        let maps: Vec<String> = running.stops[..released]
            .iter()
            .map(|stop| stop.map_id.clone())
            .collect();
        if !self.maps_ready(vehicle, maps.iter().map(String::as_str)) {
            return;
        }
        let window = Window {
            first: 0,
            released,
            end: end.min(released.saturating_add(self.config.horizon_length)),
        };
        vehicle.queue.pop_front();
        let Some((message, window)) = self.order_message(vehicle, &running, window) else {
            return;
        };
        running.transport.begun += 1;
        running.released = window.released;
        vehicle.r1_sequence += 2 * running.stops.len();
        vehicle.r1_stale = false;
        vehicle.r1_hasty = false;
        vehicle.r1_cancelled = false;
        vehicle.r1_kept = None;
        vehicle.r1_before_manual = None;
        self.send_order(vehicle, &mut running, message);
        vehicle.running = Some(running);
        if self.takes(T::AsksForStates) {
            self.instant(vehicle, "stateRequest", &Value::Null);
        }
        if self.takes(T::AsksForFactsheet) {
            self.instant(vehicle, "factsheetRequest", &Value::Null);
        }
    }

    /// Publishes an order message and watches for it.
    pub(super) fn send_order(&mut self, vehicle: &mut Vehicle, running: &mut Running, message: Value) {
        let now = self.now.moment;
        running.message = message;
        running.sent_at = now;
        running.resends = 0;
        running.confirmed = false;
        running.changed = false;
        vehicle.last_order_at = Some(now);
        vehicle.at(self.lost_after(now));
        if !self.faults.has(F::OrdersNotSent) {
            self.publish(vehicle, "order", &running.message);
        }
    }

    /// When the next order message may be sent; `None` if now (FACT-13).
    pub(super) fn next_order_at(&self, vehicle: &Vehicle) -> Option<crate::clock::Moment> {
        let interval = vehicle.factsheet.as_ref().map_or(0.0, |sheet| sheet.order_interval);
        let interval = if self.faults.has(F::R1IntervalInMilliseconds) {
            interval / 1000.0
        } else {
            interval
        };
        if vehicle.r1_cancelled && self.faults.has(F::R1IntervalNotAfterCancel) {
            return None;
        }
        // A little more, since both sides measure.
        let interval = Duration::from_secs_f64(interval * 1.02);
        let due = vehicle.last_order_at? + interval;
        (due > self.now.moment && !self.faults.has(F::OrderIntervalIgnored)).then_some(due)
    }

    /// Whether a new order may be begun: nothing is wrong with the vehicle, and nothing is under way.
    fn may_begin(&mut self, vehicle: &mut Vehicle) -> bool {
        let Some(state) = &vehicle.state else { return false };
        let hasty = [F::OrderInsteadOfCancel, F::CancelNotAwaited, F::BrokenIsDead];
        let hasty = hasty.iter().any(|fault| self.faults.has(*fault));
        let busy = !state.route_empty() && !hasty && !vehicle.r1_hasty;
        if vehicle.shunned {
            return false;
        }
        if vehicle.r1_moving || (state.informs() && self.faults.has(F::R1InformationHoldsDispatch)) {
            return false;
        }
        let fit = state.is_fit(self.config.low_battery) || vehicle.absolved || self.takes(T::OrdersToFaulted);
        let manual = !state.takes_orders();
        let fit = fit || (manual && self.faults.has(F::OrdersInManual));
        if !fit || busy || self.localization_shunned(vehicle) {
            return false;
        }
        let waits = |kind: &str| matches!(kind, "initPosition" | "stopCharging");
        if vehicle.instants.iter().any(|instant| waits(instant.kind())) {
            return false;
        }
        if let Some((since, _)) = vehicle.missed
            && vehicle.factsheet.is_none()
        {
            let due = since + Duration::from_secs(4);
            if due > self.now.moment {
                vehicle.at(due);
                return false;
            }
        }
        true
    }

    /// `localization-obeyed`: whether the vehicle is thought to be badly localized.
    pub(super) fn localization_shunned(&self, vehicle: &Vehicle) -> bool {
        let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
        let score = position.and_then(|position| position.localization_score);
        let range = position.and_then(|position| position.deviation_range);
        let low = score.is_some_and(|score| score < 0.5) || range.is_some_and(|range| range > 1.0);
        low && self.faults.has(F::LocalizationObeyed)
    }

    /// Index behind the last node that can be reached without a blocked edge, from `base` nodes on (ORD-12).
    pub(super) fn free_until(&self, vehicle: &Vehicle, running: &Running, base: usize) -> usize {
        let first = base.saturating_sub(1);
        let blocked = running.legs.iter().enumerate().skip(first).find(|(_, leg)| {
            let used = self.faults.has(F::BlockedEdgeUsed) || vehicle.r1_blind;
            vehicle.blocked.contains(&(leg.from.clone(), leg.to.clone())) && !used
        });
        blocked.map_or(running.stops.len(), |(index, _)| index + 1)
    }

    /// The whole way of a transport; `None` if there is none the vehicle can be told.
    fn planned(&mut self, vehicle: &mut Vehicle, transport: &Transport) -> Option<Way> {
        let goal = transport
            .from
            .as_ref()
            .filter(|_| !transport.loaded)
            .unwrap_or(&transport.to);
        let (mut way, here) = self.start(vehicle, goal)?;
        self.lead(vehicle, &mut way, &here, transport)?;
        if self.takes(T::R1GenerousDeviations) {
            for stop in way.stops.iter_mut().filter(|stop| stop.actions.is_empty()) {
                stop.deviation_xy.get_or_insert(0.8);
            }
        }
        let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
        if let Some(range) = position.and_then(|position| position.deviation_range)
            && self.faults.has(F::R1DeviationRangeAtStart)
            && let Some(first) = way.stops.first_mut()
        {
            first.deviation_xy = Some(first.deviation_xy.unwrap_or(0.0) + range.abs());
        }
        if self.faults.has(F::StartsElsewhere) && way.legs.len() > 1 {
            way.stops.remove(0);
            way.legs.remove(0);
        }
        (self.names_fit(vehicle, &way) && self.actions_fit(vehicle, &way)).then_some(way)
    }

    /// The first node of a new order, and from which node of the layout the way goes on (ORD-03).
    fn start(&mut self, vehicle: &Vehicle, goal: &str) -> Option<(Way, String)> {
        let mut state = vehicle.state.clone()?;
        if let Some((node, position)) = &vehicle.r1_before_manual {
            state.last_node_id.clone_from(node);
            state.agv_position.clone_from(position);
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
        let Some(position) = &state.agv_position else {
            let goal = vehicle.last_order.as_ref().and_then(|order| {
                let end = order.released.checked_sub(1)?;
                self.config.node(&order.stops.get(end)?.id)
            });
            let goal = goal.filter(|_| self.faults.has(F::R1LineGuidedFromBaseEnd));
            return alone(goal.or(last)?);
        };
        let away = |node: &SiteNode| distance((node.x, node.y), (position.x, position.y));
        let stands = |node: &&SiteNode| {
            node.map_id == position.map_id && away(node) <= node.deviation_xy.unwrap_or(REACH).max(EXACT)
        };
        let near = || {
            self.config
                .nearest(position.x, position.y, &position.map_id)
                .map(|(node, _)| node)
        };
        let wide = |node: &SiteNode, spare: f64| {
            let (mut way, here) = alone(node)?;
            let least = away(node) + spare;
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
    fn between(&mut self, vehicle: &Vehicle, position: &Position, goal: &str) -> Option<(Way, String)> {
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
        } else {
            self.next_id(vehicle, "place")
        };
        let first = Stop {
            id: id.clone(),
            x: position.x,
            y: position.y,
            map_id: position.map_id.clone(),
            deviation_xy: Some(REACH),
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
        if self.faults.has(F::CancelOnNode) {
            let action = self.action(vehicle, "startPause", &Value::Null);
            way.stops.last_mut()?.actions.push(action);
        }
        Some(())
    }

    fn extend(&mut self, vehicle: &Vehicle, way: &mut Way, from: &str, to: &str) -> Option<()> {
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
    fn load(&mut self, vehicle: &mut Vehicle, way: &mut Way, kind: &str, transport: &Transport) {
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
        self.perform(vehicle, way, kind, &Value::Object(given));
    }

    /// An action at the end of a way, in a scope the vehicle offers it in.
    fn perform(&mut self, vehicle: &Vehicle, way: &mut Way, kind: &str, given: &Value) {
        let sheet = vehicle.factsheet.as_ref();
        let heedless = self.faults.has(F::NodeActionsIgnored);
        let room =
            |name: &str, taken: usize| heedless || taken < sheet.map_or(usize::MAX, |sheet| sheet.limit(&[name]));
        let on_node = self.offers(sheet, kind, "NODE");
        let on_edge = self.offers(sheet, kind, "EDGE");
        let led = kind == "waitForTrigger" && self.faults.has(F::R1TriggerOnEdge);
        if let Some(leg) = way.legs.last_mut().filter(|leg| {
            let rather = on_edge && self.takes(T::R1ActionsOnEdges) && room("edge.actions", leg.actions.len());
            led || rather
        }) {
            leg.actions.push(self.action(vehicle, kind, given));
            return;
        }
        if let Some(stop) = way
            .stops
            .last_mut()
            .filter(|stop| on_node && room("node.actions", stop.actions.len()))
        {
            stop.actions.push(self.action(vehicle, kind, given));
        } else if let Some(leg) = way
            .legs
            .last_mut()
            .filter(|leg| on_edge && room("edge.actions", leg.actions.len()))
        {
            leg.actions.push(self.action(vehicle, kind, given));
        }
    }

    /// Whether the vehicle takes the ids of a way (FACT-12).
    pub(super) fn names_fit(&self, vehicle: &Vehicle, way: &Way) -> bool {
        let Some(sheet) = &vehicle.factsheet else { return true };
        let longest = sheet
            .id_length
            .filter(|_| !self.faults.has(F::IdLimitIgnored))
            .unwrap_or(usize::MAX);
        let digits = sheet.ids_numerical && !self.faults.has(F::NumericalIdsIgnored);
        let fits =
            |id: &str| id.chars().count() <= longest && (!digits || id.chars().all(|letter| letter.is_ascii_digit()));
        let nodes = way.stops.iter().map(|stop| stop.id.as_str());
        nodes.chain(way.legs.iter().map(|leg| leg.id.as_str())).all(fits)
    }

    /// Whether the vehicle takes as many actions on one node, and as many parameters of one action, as the way has.
    fn actions_fit(&self, vehicle: &Vehicle, way: &Way) -> bool {
        let Some(sheet) = &vehicle.factsheet else { return true };
        let limit = |name: &str, ignored: F| {
            let limit = sheet.limit(&[name]);
            if self.faults.has(ignored) { usize::MAX } else { limit }
        };
        let actions = || way.stops.iter().flat_map(|stop| &stop.actions);
        let parameters = |action: &Value| action["actionParameters"].as_array().map_or(0, Vec::len);
        let most = actions().map(parameters).max().unwrap_or_default();
        let zero = sheet.has_zeros && self.faults.has(F::ZeroIsALimit);
        !zero
            && Running::busiest(&way.stops) <= limit("node.actions", F::NodeActionsIgnored)
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
