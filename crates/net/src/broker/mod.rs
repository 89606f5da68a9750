//! The embedded MQTT broker, and a self-test for whatever broker is used.
//!
//! The broker sits on loopback behind the tap, keeps everything in memory and lets anybody in. Its known
//! peculiarities are absorbed by the tap (`tap::rewrite`).

#[cfg(not(feature = "broker"))]
mod absent;
mod difference;
#[cfg(feature = "broker")]
mod embedded;
mod self_test;

#[cfg(not(feature = "broker"))]
pub use absent::EmbeddedBroker;
pub use difference::Difference;
#[cfg(feature = "broker")]
pub use embedded::EmbeddedBroker;
pub use self_test::{Tested, self_test};
