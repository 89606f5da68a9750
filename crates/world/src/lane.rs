//! Nodes and edges as they were ordered, and where on a straight edge a position is.

use std::f64::consts::PI;

use tck_base::nurbs::{Beside, Path};
use tck_view::{Deviation, Edge, Member, Node, NodePosition, Number, Pose, Text};

use crate::ordered::curve;

/// Whether a number can be calculated with.
fn is_sane(number: f64) -> bool {
    number.abs() < 1e9
}

/// A number that can be calculated with.
pub(crate) fn sane(member: &Member<Number>) -> Option<f64> {
    member.float().filter(|number| is_sane(*number))
}

/// An angle brought into -π … π.
#[must_use]
pub fn wrapped(angle: f64) -> f64 {
    let turned = angle.rem_euclid(2.0 * PI);
    if turned > PI { turned - 2.0 * PI } else { turned }
}

/// How far two orientations are apart, the short way, in radians.
#[must_use]
pub fn apart(one: f64, other: f64) -> f64 {
    wrapped(one - other).abs()
}

/// nodePosition of an ordered node.
#[derive(Clone, Debug, PartialEq)]
pub struct OrderedPlace {
    /// mapId; empty where the order names none.
    pub map: Text,
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Radians.
    pub theta: Option<f64>,
    /// allowedDeviationXY in metres.
    pub deviation: Option<f64>,
    /// allowedDeviationTheta in radians.
    pub deviation_theta: Option<f64>,
}

/// An ordered node.
#[derive(Clone, Debug, PartialEq)]
pub struct OrderedNode {
    /// sequenceId.
    pub sequence: u64,
    /// nodeId.
    pub id: String,
    /// `None` where the order gives no position, or one that cannot be calculated with.
    pub place: Option<OrderedPlace>,
    /// Whether it has actions, which may move the vehicle.
    pub acts: bool,
}

impl OrderedNode {
    /// Reads a node of an order.
    #[must_use]
    pub fn read(node: &Node) -> Option<Self> {
        Some(Self {
            sequence: node.sequence_id.whole()?,
            id: node.node_id.or_empty().to_owned(),
            place: node
                .node_position
                .there()
                .and_then(|position| OrderedPlace::read(position)),
            acts: !node.actions.is_empty(),
        })
    }
}

impl OrderedPlace {
    fn read(position: &NodePosition) -> Option<Self> {
        let deviation = position.allowed_deviation_xy.there();
        Some(Self {
            map: position.map_id.there().cloned().unwrap_or_default(),
            x: sane(&position.x)?,
            y: sane(&position.y)?,
            theta: sane(&position.theta),
            deviation: deviation
                .and_then(Deviation::farthest)
                .filter(|radius| is_sane(*radius)),
            deviation_theta: sane(&position.allowed_deviation_theta),
        })
    }

    /// Metres to a point.
    #[must_use]
    pub fn distance(&self, x: f64, y: f64) -> f64 {
        (self.x - x).hypot(self.y - y)
    }

    /// Closer than this to the node, a vehicle may be on the node as well as on the edge, in metres.
    fn reach(&self) -> f64 {
        self.deviation.unwrap_or(0.0).max(0.3)
    }
}

/// What an edge demands.
#[derive(Clone, Debug, PartialEq)]
pub struct Demands {
    /// sequenceId.
    pub sequence: u64,
    /// Metres per second.
    pub max_speed: Option<f64>,
    /// Radians per second.
    pub max_rotation_speed: Option<f64>,
    /// Radians; against the map if `global`, else against the way.
    pub orientation: Option<f64>,
    /// Whether the orientation is against the map.
    pub global: bool,
    /// Whether the vehicle may turn on it: rotationAllowed, or that reachOrientationBeforeEntering does not ask for the turn
    /// before it.
    pub rotation_allowed: Option<bool>,
    /// Whether the way may be no straight line.
    pub curved: bool,
    /// Its trajectory, if it has one that can be calculated with.
    pub path: Option<Path>,
    /// How far it may be left.
    pub corridor: Option<Corridor>,
}

/// How far the vehicle may leave the trajectory of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corridor {
    /// Metres.
    pub left: f64,
    /// Metres.
    pub right: f64,
    /// Whether the contour is meant, not the kinematic centre.
    pub contour: bool,
    /// Whether it has to be released first.
    pub release_required: bool,
}

impl Corridor {
    fn read(corridor: &tck_view::Corridor) -> Option<Self> {
        let width = |member| sane(member).filter(|width| *width >= 0.0);
        Some(Self {
            left: width(&corridor.left_width)?,
            right: width(&corridor.right_width)?,
            contour: corridor.reference_point.is("CONTOUR"),
            release_required: corridor.release_required.is(true),
        })
    }
}

impl Demands {
    /// Reads an edge of an order.
    #[must_use]
    pub fn read(edge: &Edge) -> Option<Self> {
        let kind = edge.orientation_type.or_empty();
        let curve = curve(&edge.trajectory);
        let before = edge.reach_orientation_before_entering.flag();
        let before = before.filter(|_| !edge.orientation.is_absent());
        Some(Self {
            sequence: edge.sequence_id.whole()?,
            max_speed: sane(&edge.max_speed).filter(|speed| *speed > 0.0),
            max_rotation_speed: sane(&edge.max_rotation_speed).filter(|speed| *speed > 0.0),
            // What another word than these asks for is not known.
            orientation: sane(&edge.orientation).filter(|_| matches!(kind, "" | "GLOBAL" | "TANGENTIAL")),
            global: kind == "GLOBAL",
            rotation_allowed: edge.rotation_allowed.flag().or(before.map(|before| !before)),
            curved: curve.is_some(),
            path: curve.and_then(|(curve, _)| curve).map(|curve| curve.path()),
            corridor: edge.corridor.there().and_then(|corridor| Corridor::read(corridor)),
        })
    }
}

/// The edge a vehicle is on, with its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Lane {
    /// What the edge demands.
    pub demands: Demands,
    /// The node it begins at.
    pub from: OrderedNode,
    /// The node it ends at.
    pub to: OrderedNode,
}

/// Where a position is beside the straight line between two nodes, in metres.
#[derive(Clone, Copy, Debug)]
pub struct Along {
    /// Way made from the start node on; negative before it.
    pub made: f64,
    /// Length of the line.
    pub length: f64,
    /// Distance from the line.
    pub off: f64,
    /// How far from each end the edge alone is meant.
    reach: (f64, f64),
}

impl Along {
    /// Whether the position is on the edge and on neither node, and on the straight line.
    #[must_use]
    pub fn is_mid_edge(&self) -> bool {
        let near_line = self.off <= (0.05 * self.length).clamp(0.15, 0.3);
        near_line && self.made > self.reach.0 && self.length - self.made > self.reach.1
    }

    /// Whether the position may still be on the start node.
    #[must_use]
    pub fn is_at_start(&self) -> bool {
        self.made.hypot(self.off) <= self.reach.0
    }

    /// The way made on the edge alone.
    #[must_use]
    pub fn made_on_edge(&self) -> f64 {
        let half = self.length / 2.0;
        self.made
            .clamp(self.reach.0.min(half), (self.length - self.reach.1).max(half))
    }
}

/// Where a position is beside the trajectory of an edge.
#[derive(Clone, Copy, Debug)]
pub struct Bend {
    /// The nearest place of the trajectory.
    pub beside: Beside,
    /// Length of the trajectory in metres.
    pub length: f64,
    /// How far that place is from the straight line between the nodes, in metres.
    pub aside: f64,
    /// Whether that place is on the edge and on neither node.
    pub is_mid_edge: bool,
}

impl Lane {
    /// Where a position is beside the trajectory.
    #[must_use]
    pub fn bend(&self, pose: &Pose) -> Option<Bend> {
        let (from, to) = (self.from.place.as_ref()?, self.to.place.as_ref()?);
        let path = self
            .demands
            .path
            .as_ref()
            .filter(|_| pose.map_id == from.map && pose.map_id == to.map)?;
        let beside = path.beside(pose.x, pose.y)?;
        let spot = path.at(beside.made)?;
        let straight = Path::through([(from.x, from.y), (to.x, to.y)]);
        let length = path.length();
        Some(Bend {
            beside,
            length,
            aside: straight.beside(spot.x, spot.y).map_or(0.0, |line| line.distance),
            is_mid_edge: beside.made > from.reach() && length - beside.made > to.reach(),
        })
    }

    /// The direction of the straight line from node to node, in radians.
    #[must_use]
    pub fn heading(&self) -> Option<f64> {
        let (from, to) = (self.from.place.as_ref()?, self.to.place.as_ref()?);
        (from.map == to.map && from.distance(to.x, to.y) > 0.2).then(|| (to.y - from.y).atan2(to.x - from.x))
    }

    /// Where a position is along the line.
    #[must_use]
    pub fn along(&self, pose: &Pose) -> Option<Along> {
        let (from, to) = (self.from.place.as_ref()?, self.to.place.as_ref()?);
        let heading = self.heading()?;
        if pose.map_id != from.map {
            return None;
        }
        let (x, y) = (pose.x - from.x, pose.y - from.y);
        Some(Along {
            made: x * heading.cos() + y * heading.sin(),
            off: (y * heading.cos() - x * heading.sin()).abs(),
            length: from.distance(to.x, to.y),
            reach: (from.reach(), to.reach()),
        })
    }

    /// Whether the pose is on the straight edge alone.
    #[must_use]
    pub fn is_mid_edge(&self, pose: &Pose) -> bool {
        !self.demands.curved && self.along(pose).is_some_and(|along| along.is_mid_edge())
    }

    /// The orientation the vehicle has to have on the straight line, in radians.
    #[must_use]
    pub fn wanted_orientation(&self) -> Option<f64> {
        let orientation = self.demands.orientation?;
        if self.demands.global {
            return Some(orientation);
        }
        self.heading().map(|heading| wrapped(heading + orientation))
    }
}
