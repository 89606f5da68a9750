//! Where something is: positions of vehicles and nodes, and the one pose that checks calculate with.

use crate::{Member, Number, Text};

view! {
    /// Where a vehicle says it is.
    Position as "position" {
        /// Whether it knows where it is.
        initialized: bool = "positionInitialized",
        /// How good its localization is, from 0 to 1.
        localization_score: Number = "localizationScore",
        /// How far off it may be, in metres.
        deviation_range: Number = "deviationRange",
        /// In metres.
        x: Number = "x",
        /// In metres.
        y: Number = "y",
        /// In radians.
        theta: Number = "theta",
        /// The map that x and y are of.
        map_id: Text = "mapId",
        /// For people.
        map_description: Text = "mapDescription" apart,
    }
}

view! {
    /// Where a node is, and how far off it a vehicle may be.
    NodePosition as "nodePosition" {
        /// In metres.
        x: Number = "x",
        /// In metres.
        y: Number = "y",
        /// In radians.
        theta: Number = "theta",
        /// How far off a vehicle may be and has still reached it.
        allowed_deviation_xy: Deviation = "allowedDeviationXY",
        /// How far it may be turned away from theta, in radians.
        allowed_deviation_theta: Number = "allowedDeviationTheta",
        /// The map that x and y are of.
        map_id: Text = "mapId",
        /// For people.
        map_description: Text = "mapDescription" apart,
    }
}

/// How far off a node a vehicle may be: a radius in 2.x, an ellipse from 3.0 on.
#[derive(Clone, Debug, PartialEq)]
pub enum Deviation {
    /// In metres.
    Radius(Number),
    /// Half axes and their direction.
    Ellipse(Box<Ellipse>),
}

impl Deviation {
    /// Metres by which a vehicle may be off in the direction in which it may be off most: the radius, or the long half axis.
    #[must_use]
    pub fn farthest(&self) -> Option<f64> {
        match self {
            Self::Radius(radius) => Some(radius.float()),
            Self::Ellipse(ellipse) => Some(ellipse.a.float()?.max(ellipse.b.float()?)),
        }
    }

    /// Metres by which a vehicle may be off in whatever direction: the radius, or the short half axis.
    #[must_use]
    pub fn nearest(&self) -> Option<f64> {
        match self {
            Self::Radius(radius) => Some(radius.float()),
            Self::Ellipse(ellipse) => Some(ellipse.a.float()?.min(ellipse.b.float()?)),
        }
    }

    /// Whether a vehicle may be off by so much along x and y, with a margin, in metres.
    #[must_use]
    pub fn allows(&self, (x, y): (f64, f64), margin: f64) -> bool {
        let (a, b, theta) = match self {
            Self::Radius(radius) => (radius.float(), radius.float(), 0.0),
            Self::Ellipse(ellipse) => (
                ellipse.a.float().unwrap_or_default(),
                ellipse.b.float().unwrap_or_default(),
                ellipse.theta.float().unwrap_or_default(),
            ),
        };
        let (along, across) = (x * theta.cos() + y * theta.sin(), y * theta.cos() - x * theta.sin());
        (along / (a.max(0.0) + margin)).hypot(across / (b.max(0.0) + margin)) <= 1.0
    }
}

view! {
    /// An ellipse around a node.
    Ellipse as "ellipse" {
        /// The long half axis, in metres.
        a: Number = "a",
        /// The short half axis, in metres.
        b: Number = "b",
        /// Direction of the long half axis, in radians.
        theta: Number = "theta",
    }
}

view! {
    /// How fast a vehicle says it is.
    Velocity as "velocity" {
        /// Ahead, in metres a second.
        vx: Number = "vx",
        /// To the left, in metres a second.
        vy: Number = "vy",
        /// Turning, in radians a second.
        omega: Number = "omega",
    }
}

/// A point on a map.
#[derive(Clone, Debug, PartialEq)]
pub struct Spot {
    /// In metres.
    pub x: f64,
    /// In metres.
    pub y: f64,
    /// The map; empty where the message names none.
    pub map_id: Text,
}

/// Where a vehicle that knows its position stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// In metres.
    pub x: f64,
    /// In metres.
    pub y: f64,
    /// In radians.
    pub theta: f64,
    /// The map; empty where the message names none.
    pub map_id: Text,
}

/// Beyond this a coordinate is a mistake that nothing is calculated with.
const FARTHEST: f64 = 1e9;

fn coordinate(member: &Member<Number>) -> Option<f64> {
    member.float().filter(|number| number.abs() < FARTHEST)
}

impl Position {
    /// The pose of a vehicle that says that it knows its position.
    ///
    /// `positionInitialized` is a required member in every version, so a position without it is one that nobody
    /// vouches for: an absent `positionInitialized` counts as false here, and nothing is calculated from such a position and
    /// nobody is accused by it. That the member is missing is a finding of its own (STATE-MSG-05).
    #[must_use]
    pub fn pose(&self) -> Option<Pose> {
        self.initialized.is(true).then(|| self.pose_as_written()).flatten()
    }

    /// The pose of a vehicle that does not say that it does not know its position: an absent `positionInitialized` is enough.
    ///
    /// Some checks took it so before there was one meaning; [`Position::pose`] is the one that counts.
    #[must_use]
    pub fn pose_unless_denied(&self) -> Option<Pose> {
        (!self.initialized.is(false)).then(|| self.pose_as_written()).flatten()
    }

    fn pose_as_written(&self) -> Option<Pose> {
        Some(Pose {
            x: coordinate(&self.x)?,
            y: coordinate(&self.y)?,
            theta: coordinate(&self.theta)?,
            map_id: self.map_id.there().cloned().unwrap_or_default(),
        })
    }

    /// x, y and the map as they are written, whether the vehicle vouches for them or not: to look for a vehicle, not to
    /// judge it.
    #[must_use]
    pub fn spot(&self) -> Option<Spot> {
        Some(Spot {
            x: coordinate(&self.x)?,
            y: coordinate(&self.y)?,
            map_id: self.map_id.there().cloned().unwrap_or_default(),
        })
    }
}

impl NodePosition {
    /// x, y and the map, where x and y are numbers.
    #[must_use]
    pub fn spot(&self) -> Option<Spot> {
        Some(Spot {
            x: coordinate(&self.x)?,
            y: coordinate(&self.y)?,
            map_id: self.map_id.there().cloned().unwrap_or_default(),
        })
    }
}

impl Spot {
    /// How far apart two points are, in metres, whatever their maps.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }
}

impl Pose {
    /// How far apart two poses are, in metres and in radians, whatever their maps.
    #[must_use]
    pub fn apart(&self, other: &Self) -> (f64, f64) {
        let turned = (self.theta - other.theta).rem_euclid(std::f64::consts::TAU);
        let turned = turned.min(std::f64::consts::TAU - turned);
        ((self.x - other.x).hypot(self.y - other.y), turned)
    }

    /// The point without the angle.
    #[must_use]
    pub fn spot(&self) -> Spot {
        Spot {
            x: self.x,
            y: self.y,
            map_id: self.map_id.clone(),
        }
    }
}
