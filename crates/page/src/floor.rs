//! The course as a picture: the floor, the order in hand, and where the vehicle is.

use std::collections::VecDeque;

use serde::Serialize;

use super::shown::{EXCERPT, NAME, shown};
use tck_base::verdict::Verdict;
use tck_course::GivesUp;

/// How many places of the vehicle its trail has at most.
const TRAIL: usize = 400;
/// How many places of the vehicle are remembered with the record that told of them.
const PLACES: usize = 4_096;
/// How many errors of a vehicle are shown.
const ERRORS: usize = 5;
/// How many nodes and edges of an order are shown.
const PARTS: usize = 500;

/// A floor.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Floor {
    /// Its nodes.
    pub nodes: Vec<FloorNode>,
    /// Its edges.
    pub edges: Vec<FloorEdge>,
}

/// A node of a floor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FloorNode {
    /// Its id.
    pub id: String,
    /// To the right, in metres.
    pub x: f64,
    /// Upwards, in metres.
    pub y: f64,
    /// Its map.
    pub map: String,
    /// Whether it is a station.
    pub station: bool,
}

/// An edge of a floor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FloorEdge {
    /// Its id.
    pub id: String,
    /// The node where it begins.
    pub start: String,
    /// The node where it ends.
    pub end: String,
    /// The way between them, both ends included.
    pub line: Vec<(f64, f64)>,
}

/// A node or edge that is left of the order in hand.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RoutePart {
    /// Id of the node or edge.
    pub id: String,
    /// Whether it belongs to the base.
    pub released: bool,
}

/// What a vehicle says of itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct VehicleOnFloor {
    /// To the right, in metres.
    pub x: Option<f64>,
    /// Upwards, in metres.
    pub y: Option<f64>,
    /// Its heading, in radians.
    pub theta: Option<f64>,
    /// The map it is on.
    pub map: Option<String>,
    /// The node it was at last.
    pub last_node: Option<String>,
    /// The order in hand; empty where there is none.
    pub order: Option<String>,
    /// Whether it drives.
    pub driving: Option<bool>,
    /// What is left of the nodes of the order.
    pub nodes: Vec<RoutePart>,
    /// What is left of its edges.
    pub edges: Vec<RoutePart>,
}

/// A vehicle of a fleet that is watched.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct FleetVehicle {
    /// Manufacturer and serial number.
    pub name: String,
    /// What it says of its connection.
    pub connection: Option<String>,
    /// Its operating mode.
    pub mode: Option<String>,
    /// The order in hand.
    pub order: Option<String>,
    /// The node it was at last.
    pub last_node: Option<String>,
    /// Whether it drives.
    pub driving: bool,
    /// What it reports of errors.
    pub errors: Vec<String>,
    /// When it was heard last, in milliseconds since 1970.
    pub heard: Option<i64>,
    /// The worst that was found of it, and the last of that.
    pub finding: Option<(Verdict, String)>,
    /// To the right, in metres.
    pub x: Option<f64>,
    /// Upwards, in metres.
    pub y: Option<f64>,
    /// Its heading, in radians.
    pub theta: Option<f64>,
    /// The map it is on.
    pub map: Option<String>,
}

impl FleetVehicle {
    pub(crate) fn cut(mut self) -> Self {
        self.name = shown(&self.name, NAME);
        let texts = [
            &mut self.connection,
            &mut self.mode,
            &mut self.order,
            &mut self.last_node,
            &mut self.map,
        ];
        for text in texts {
            *text = text.take().map(|text| shown(&text, NAME));
        }
        self.errors.truncate(ERRORS);
        for error in &mut self.errors {
            *error = shown(error, NAME);
        }
        self.finding = self
            .finding
            .take()
            .map(|(verdict, text)| (verdict, shown(&text, EXCERPT)));
        self
    }
}

impl VehicleOnFloor {
    pub(crate) fn cut(mut self) -> Self {
        for text in [&mut self.map, &mut self.last_node, &mut self.order] {
            *text = text.take().map(|text| shown(&text, NAME));
        }
        for parts in [&mut self.nodes, &mut self.edges] {
            parts.truncate(PARTS);
            for part in parts {
                part.id = shown(&part.id, NAME);
            }
        }
        self
    }
}

/// A place on a floor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Spot {
    pub x: f64,
    pub y: f64,
    pub map: Option<String>,
}

impl Spot {
    fn of(vehicle: &VehicleOnFloor) -> Option<Self> {
        Some(Self {
            x: vehicle.x.filter(|x| x.is_finite())?,
            y: vehicle.y.filter(|y| y.is_finite())?,
            map: vehicle.map.clone(),
        })
    }
}

/// From which record on the vehicle was where, as far back as it is remembered.
#[derive(Debug, Default)]
pub(crate) struct Whereabouts(VecDeque<(u64, Spot)>);

impl Whereabouts {
    /// Where the vehicle says that it is.
    pub fn note(&mut self, record: u64, vehicle: &VehicleOnFloor) {
        let Some(spot) = Spot::of(vehicle) else { return };
        if self.0.back().is_some_and(|(_, last)| *last == spot) {
            return;
        }
        if self.0.len() == PLACES {
            self.0.pop_front();
        }
        self.0.push_back((record, spot));
    }

    /// Where it was at a record. `None` when it had said nothing of it, or that is too long ago.
    pub fn at(&self, record: u64) -> Option<&Spot> {
        let later = self.0.partition_point(|(since, _)| *since <= record);
        self.0.get(later.checked_sub(1)?).map(|(_, spot)| spot)
    }

    /// Records begin anew.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

/// Where the vehicle was lately, the oldest place first.
#[derive(Clone, Debug)]
pub(crate) struct Trail(tck_course::Trail<()>);

impl Default for Trail {
    fn default() -> Self {
        Self(tck_course::Trail::new(TRAIL, GivesUp::Oldest))
    }
}

impl Trail {
    /// Goes on with where the vehicle is now.
    pub fn goes_on(&mut self, vehicle: &VehicleOnFloor) {
        if let (Some(x), Some(y)) = (vehicle.x, vehicle.y) {
            self.0.goes_on(x, y, ());
        }
    }

    /// All places.
    pub fn places(&self) -> Vec<(f64, f64)> {
        self.0.places()
    }
}
