//! What is known of a vehicle from its records: one fact in each file, learned once and read by all checks.
//!
//! A record becomes one [`Observation`] for each vehicle it concerns: whose message it is, on which topic, how it was seen, and
//! what the link was like. The [`World`] of the vehicle learns from it, and then those are asked who listen to its kind.
//!
//! Whether anything of it is right is left to the checks. The memory of a fact is bounded, whatever a device sends. What one
//! check has to forget by itself, it keeps by itself: a fact is the same for everybody who reads it.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod displaced;
mod factsheets;
mod fleet;
mod instant;
mod lane;
mod listen;
mod malformed;
mod mock;
mod observation;
pub mod ordered;
mod orders;
pub mod outline;
pub mod rest;
mod restarts;
mod setting;
mod shown;
mod starts;
mod topics;
mod way;
mod world;
pub mod zones;

pub use displaced::Displaced;
pub use factsheets::{Factsheet, Factsheets, Offered};
pub use fleet::{FleetSeen, takes};
pub use instant::InstantActionsSent;
pub use lane::{Along, Bend, Corridor, Demands, Lane, OrderedNode, OrderedPlace, apart, wrapped};
pub use listen::{Kind, Listen, Listens, Seen};
pub use malformed::MalformedOrders;
pub use mock::{MockVehicle, Outside, ShownState};
pub use observation::{Delivered, DevicePublish, End, Link, Observation, Observer};
pub use orders::{Blocking, Element, OrdersSent, Placed, SentOrder, edges_left, nodes_left, sets_position};
pub use restarts::Restarts;
pub use setting::Setting;
pub use shown::{ShownOrder, fatal_errors, last_node, may_abandon};
pub use starts::Starts;
pub use tck_view::Topic;
pub use way::{AT_REST, Step, Velocity, View, Way};
pub use world::{Fact, World};
