//! One reading of a message: typed, lenient, and the only place where names of members stand.
//!
//! A message is read once, from its parsed JSON or from its bytes, into the view of its topic. Every member is a
//! [`Member`]: there, absent, null, or of another type. Nothing is repaired: `"3"` is no number, and a required member that is
//! missing is [`Member::Absent`]. The bytes of the message stay the evidence; a view is what checks calculate with.
//!
//! ```
//! use serde_json::json;
//! use tck_view::{MessageView, Names, Topic};
//!
//! let message = json!({
//!     "headerId": 7, "orderId": "transport-1", "driving": "no",
//!     "nodeStates": [{ "nodeId": "n2", "sequenceId": 2, "released": true }],
//!     "agvPosition": { "x": 1.0, "y": 2.5, "theta": 0.0, "mapId": "hall", "positionInitialized": true },
//! });
//! let view = MessageView::of_value(Topic::State, &message, &Names::default());
//! let state = view.state().unwrap();
//!
//! assert_eq!(state.header.header_id.whole(), Some(7));
//! assert_eq!(state.order_id.text(), Some("transport-1"));
//! assert!(state.errors.is_absent());
//! assert!(state.driving.is_other(), "a text where true or false belongs");
//! assert_eq!(state.driving.flag(), None);
//! for node in state.node_states.iter() {
//!     assert_eq!(node.sequence_id.whole(), Some(2));
//!     assert!(node.released.is(true));
//! }
//! assert_eq!(state.pose().unwrap().map_id.as_str(), "hall");
//! ```
//!
//! # Names
//!
//! What a member is called differs by version of the protocol. [`Names`] says it: its default is the names of the
//! versions 2.x, and the table `[members]` of a pack's `protocol.toml` holds what is different. Each member that can be read is a
//! [`Field`], an associated constant of its view with the name of the Rust field: `StateView::maps`. A check lists the
//! fields it cannot do without; [`Names::lacks`] tells whether a version has them.
//!
//! # Comparing
//!
//! Every object has a [`Print`], a fingerprint of its whole content, members nobody knows included, whatever
//! their order: `now.print == before.print` asks whether an error, an action or a node is the one of before. `essence` leaves out
//! descriptions for people, and of a state what changes all the time; `content` of a message leaves out `headerId` and
//! `timestamp`.
//!
//! # Bounds
//!
//! A list keeps [`ELEMENTS`] elements, a text [`CHARACTERS`] characters, a message [`TOTAL`] elements in all; what is cut
//! says so. Fingerprints are taken of the whole.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[macro_use]
mod table;

mod action;
mod connection;
mod factsheet;
mod header;
mod instant_actions;
mod json;
mod list;
mod member;
mod message;
mod names;
mod number;
mod order;
mod position;
mod print;
mod read;
mod responses;
mod state;
mod text;
mod topic;
mod trajectory;
mod visualization;
mod zone_set;

pub use action::{ActionView, Parameter};
pub use connection::ConnectionView;
pub use factsheet::{
    ArrayLimits, BatteryCharging, Envelope2d, Envelope3d, FactsheetView, Geometry, LoadSet, LoadSpecification, Network,
    OfferedAction, OfferedParameter, OptionalParameter, PhysicalParameters, ProtocolFeatures, ProtocolLimits,
    StringLimits, Timing, TypeSpecification, VehicleConfig, VersionEntry, WheelDefinition, WheelPosition,
};
pub use header::Header;
pub use instant_actions::InstantActionsView;
pub use json::{Json, Kind};
pub use list::List;
pub use member::{Member, Presence, Shown};
pub use message::{MessageView, OtherView};
pub use names::{Field, Names, NamesError, Object, Spelling};
pub use number::Number;
pub use order::{Corridor, Edge, Element, Node, OrderView, Scope};
pub use position::{Deviation, Ellipse, NodePosition, Pose, Position, Spot, Velocity};
pub use print::Print;
pub use responses::{Response, ResponsesView};
pub use state::{
    ActionState, BatteryState, BoundingBox, Dimensions, EdgeRequest, EdgeState, ErrorView, Information,
    IntermediatePath, Load, MapState, NodeState, PlannedPath, Reference, SafetyState, StateView, Translation, Waypoint,
    ZoneRequest, ZoneSetState,
};
pub use text::Text;
pub use topic::Topic;
pub use trajectory::{ControlPoint, Trajectory};
pub use visualization::VisualizationView;
pub use zone_set::{Point, Zone, ZoneAction, ZoneSet, ZoneSetView};

/// How many elements of one list are kept.
pub const ELEMENTS: usize = 4096;
/// How many characters of one text are kept.
pub const CHARACTERS: usize = 512;
/// How many elements, and members of free objects, a view keeps in all.
pub const TOTAL: usize = 65_536;
