//! How a transport becomes a way: where it starts, over which nodes it leads, and what is done on it (sections 6.6.1 and
//! 6.8).
//!
//! A vehicle that stands a little off a node begins there with an allowedDeviationXY that covers it; one between nodes
//! begins at a temporary node (the ruling of ORD-CANCEL-17).

use serde_json::{Map, Value, json};

use super::Site;
use super::config::SiteNode;
use super::dispatch::Way;
use super::hooks::{Measure, Permission};
use super::layout::distance;
use super::seen::Position;
use super::vehicle::{Leg, Stop, Transport, Vehicle};

/// How far from a node a vehicle may be and stand on it, where the layout does not say; metres.
const REACH: f64 = 0.3;
/// Closer than this it stands on the node exactly.
const EXACT: f64 = 0.05;
/// A vehicle this near to an edge is on it.
const BESIDE: f64 = 0.5;

/// Pose of a vehicle, as a new order sees it.
#[derive(Clone, Debug)]
pub(crate) struct Pose {
    /// The last node.
    pub(crate) node: String,
    /// The reported position, if there is one.
    pub(crate) position: Option<Position>,
    /// How the vehicle is taken to stand there.
    pub(crate) standing: Standing,
}

/// Relation of a vehicle to the node it stands at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Standing {
    /// On the node it is near, or else between nodes.
    Near,
    /// On the node it is exactly on, or else between nodes.
    Exactly,
    /// Between nodes in any case.
    Between,
    /// On the node it is near, or else on the last one: which covers it by allowedDeviationXY, or not.
    OnLast { covered: bool },
}

impl Site {
    /// The first node of a new order, and from which node of the layout the way goes on (ORD-03).
    pub(super) fn begin_at(
        &mut self,
        vehicle: &mut Vehicle,
        goal: &str,
        transport: &Transport,
    ) -> Option<(Way, String)> {
        let state = vehicle.state.as_ref()?;
        let mut pose = Pose {
            node: state.last_node_id.clone(),
            position: state.agv_position.clone(),
            standing: Standing::Near,
        };
        self.stands(vehicle, &mut pose, transport);
        let last = self.config.node(&pose.node);
        let on = |node: &SiteNode, covers: Option<f64>| {
            let mut stop = Stop::from(node);
            if let Some(least) = covers {
                stop.deviation_xy = Some(stop.deviation_xy.map_or(least, |known| known.max(least)));
            }
            let way = Way {
                stops: vec![stop],
                legs: Vec::new(),
            };
            Some((way, node.id.clone()))
        };
        let Some(position) = &pose.position else {
            return on(last?, None);
        };
        let away = |node: &SiteNode| distance((node.x, node.y), (position.x, position.y));
        let stands = |node: &&SiteNode| {
            node.map_id == position.map_id && away(node) <= node.deviation_xy.unwrap_or(REACH).max(EXACT)
        };
        let nearest = || self.config.nearest(position.x, position.y, &position.map_id);
        let near = last
            .filter(stands)
            .or_else(|| nearest().map(|(node, _)| node).filter(stands));
        match (pose.standing, near) {
            (Standing::Between, _) => {}
            (_, Some(node)) if away(node) <= EXACT => return on(node, None),
            (Standing::Exactly, _) => {}
            (_, Some(node)) => return on(node, Some(away(node) + 0.1)),
            (Standing::OnLast { covered: false }, None) if last.is_some() => return on(last?, None),
            (Standing::OnLast { covered: true }, None) => {
                if let Some(node) = last.filter(|node| node.map_id == position.map_id) {
                    return on(node, Some(away(node) + 0.2));
                }
            }
            _ => {}
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
        let mut candidates: Vec<(&str, f64)> = beside.map(|edge| (edge.to.as_str(), 0.0)).collect();
        if candidates.is_empty() {
            let nearest = self.config.nearest(here.0, here.1, &position.map_id);
            candidates.extend(nearest.map(|(node, _)| (node.id.as_str(), 0.0)));
        }
        for candidate in &mut candidates {
            let ahead = place(candidate.0).map_or(f64::MAX, |place| distance(here, place));
            let way = self.config.any_way(candidate.0, goal, &vehicle.blocked);
            let rest = way.map_or(f64::MAX, |way| {
                let ends = way.iter();
                let ends = ends.filter_map(|edge| Some((place(&edge.from)?, place(&edge.to)?)));
                ends.map(|(a, b)| distance(a, b)).sum()
            });
            candidate.1 = ahead + rest;
        }
        let best = candidates.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let next = self.config.node(best?.0)?.clone();
        let first = Stop {
            id: self.next_id(vehicle, "place"),
            x: position.x,
            y: position.y,
            map_id: position.map_id.clone(),
            deviation_xy: Some(REACH),
            ..Stop::default()
        };
        let leg = Leg {
            id: self.next_id(vehicle, "way"),
            from: first.id.clone(),
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
        Some(())
    }

    fn extend(&mut self, vehicle: &mut Vehicle, way: &mut Way, from: &str, to: &str) -> Option<()> {
        let mut closed = vehicle.blocked.clone();
        self.avoids(vehicle, from, to, &mut closed);
        for edge in self.config.any_way(from, to, &closed)? {
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
        self.perform(vehicle, way, kind, &Value::Object(given));
    }

    /// An action at the end of a way, in a scope the vehicle offers it in.
    pub(crate) fn perform(&mut self, vehicle: &Vehicle, way: &mut Way, kind: &str, given: &Value) {
        let limit = |name: &str| self.most(vehicle, Measure::Actions, name);
        let (on_node, on_edge) = (self.offers(vehicle, kind, "NODE"), self.offers(vehicle, kind, "EDGE"));
        let (of_node, of_edge) = (limit("node.actions"), limit("edge.actions"));
        let stop = way
            .stops
            .last_mut()
            .filter(|stop| on_node && stop.actions.len() < of_node);
        let leg = way.legs.last_mut().filter(|leg| on_edge && leg.actions.len() < of_edge);
        let on_a_node = stop.is_some();
        let place = stop.map(|stop| &mut stop.actions).or(leg.map(|leg| &mut leg.actions));
        if let Some(actions) = place {
            let mut action = self.action(vehicle, kind, given);
            if on_a_node && matches!(kind, "pick" | "drop") && may_retry(vehicle) {
                action["retriable"] = json!(true);
            }
            actions.push(action);
        }
    }

    /// The limit of an array in the factsheet.
    pub(crate) fn most(&self, vehicle: &Vehicle, what: Measure, name: &str) -> usize {
        let limit = vehicle
            .factsheet
            .as_ref()
            .map_or(usize::MAX, |sheet| sheet.limit(&[name]));
        self.measures(vehicle, what, limit)
    }

    /// Whether the vehicle takes the ids of a way (FACT-12).
    pub(super) fn names_fit(&self, vehicle: &Vehicle, way: &Way) -> bool {
        let longest = self.longest_id(vehicle);
        let letters = self.takes_letters(vehicle, "place");
        let fits = |id: &str| {
            let fits = id.chars().count() <= longest && (letters || id.chars().all(|letter| letter.is_ascii_digit()));
            self.allows(vehicle, Permission::Name(id), fits)
        };
        let nodes = way.stops.iter().map(|stop| stop.id.as_str());
        nodes.chain(way.legs.iter().map(|leg| leg.id.as_str())).all(fits)
    }

    /// Whether the vehicle takes as many actions on one node, and as many parameters of one action, as the way has.
    pub(super) fn actions_fit(&self, vehicle: &Vehicle, way: &Way) -> bool {
        let on_nodes = way.stops.iter().map(|stop| &stop.actions);
        let on_edges = way.legs.iter().map(|leg| &leg.actions);
        let actions = on_nodes.clone().chain(on_edges.clone()).flatten();
        let parameters = actions.map(|action| action["actionParameters"].as_array().map_or(0, Vec::len));
        on_nodes.map(Vec::len).max() <= Some(self.most(vehicle, Measure::Actions, "node.actions"))
            && on_edges.map(Vec::len).max() <= Some(self.most(vehicle, Measure::Actions, "edge.actions"))
            && parameters.max() <= Some(self.most(vehicle, Measure::Parameters, "actions.actionsParameters"))
    }
}

/// Whether the vehicle tries an action on a node again when it is told to (ORD-MSG-35).
fn may_retry(vehicle: &Vehicle) -> bool {
    let support = vehicle
        .factsheet
        .as_ref()
        .and_then(|sheet| sheet.support("order.nodes.actions.retriable"));
    vehicle.config.has("retry") && support.is_some()
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
