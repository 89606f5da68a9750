//! The kinds of objects in messages.

use std::fmt;

#[allow(clippy::wildcard_imports, reason = "each view is an object")]
use crate::*;

/// A kind of object: its name in the table `[members]`, and its members.
#[derive(Debug)]
pub struct Shape {
    pub(crate) name: &'static str,
    pub(crate) members: &'static [Entry],
}

/// A member of an object.
#[derive(Debug)]
pub struct Entry {
    /// Its name in 2.x, or the one it has had from its first version on.
    pub(crate) wire: &'static str,
    /// Whether 2.x does not have it.
    pub(crate) later: bool,
    /// Whether it does not count for the essence of the object.
    pub(crate) apart: bool,
    /// The kind of object that it holds, or that its elements are.
    pub(crate) holds: Option<Object>,
}

macro_rules! objects {
    ($($name:ident),* $(,)?) => {
        /// A kind of object that has a view.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Object {
            $(
                #[doc = concat!("See [`", stringify!($name), "`](crate::", stringify!($name), ").")]
                $name,
            )*
        }

        impl Object {
            /// All of them.
            pub const ALL: [Self; [$(Self::$name),*].len()] = [$(Self::$name),*];

            pub(crate) const fn shape(self) -> &'static Shape {
                match self {
                    $( Self::$name => $name::SHAPE, )*
                }
            }
        }
    };
}

objects! {
    Header,
    OrderView, Node, Edge, Corridor, ActionView, Parameter, Trajectory, ControlPoint, NodePosition, Ellipse,
    InstantActionsView,
    StateView, NodeState, EdgeState, ActionState, Position, Velocity, Load, BoundingBox, Dimensions, BatteryState, SafetyState,
    ErrorView, Information, Reference, Translation, MapState, ZoneSetState, PlannedPath, IntermediatePath, Waypoint,
    ZoneRequest, EdgeRequest,
    VisualizationView,
    ConnectionView,
    FactsheetView, TypeSpecification, PhysicalParameters, ProtocolLimits, StringLimits, ArrayLimits, Timing, ProtocolFeatures,
    OptionalParameter, OfferedAction, OfferedParameter, Geometry, WheelDefinition, WheelPosition, Envelope2d, Envelope3d,
    LoadSpecification, LoadSet, VehicleConfig, VersionEntry, Network, BatteryCharging,
    ResponsesView, Response,
    ZoneSetView, ZoneSet, Zone, ZoneAction, Point,
    OtherView,
}

impl Object {
    /// Its name in the table `[members]`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.shape().name
    }

    /// The kind of object with this name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|object| object.name() == name)
    }
}

impl fmt::Display for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
