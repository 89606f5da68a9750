//! What connects the harness with the device: publish, and see what happens.
//!
//! [`Link`] is the whole bench as the engine sees it. `mqtt` is the real one (broker, tap, map server and a connection of
//! the harness), `memory` an in-process bus with MQTT's retain, will and QoS rules in virtual time. A link
//! reports everything as journal occurrences and judges nothing.

mod filter;
pub mod memory;
pub mod mqtt;

use crate::bench::{LinkError, Offer};
use tck_base::clock::{Moment, Stamp};
use tck_base::device::{Commanded, Publication};
use tck_journal::event::{LinkFault, Occurrence};
use tck_journal::{Spread, Vantage};

/// The bench as the engine sees it. Not used as a trait object; the engine is generic over it.
#[expect(async_fn_in_trait, reason = "the engine runs on one thread and needs no Send bound")]
pub trait Link {
    /// The present moment.
    fn now(&self) -> Stamp;

    /// From where it can see.
    fn vantage(&self) -> Vantage;

    /// Publishes a message. Returns when it is on its way; the engine journals it before calling.
    async fn publish(&mut self, message: Publication) -> Result<(), LinkError>;

    /// The next thing that happens, or `None` when `until` has come. With `until` in the past it only
    /// returns what has already happened. Cancel-safe.
    async fn next(&mut self, until: Moment) -> Result<Option<Occurrence>, LinkError>;

    /// Changes what the tap does. Takes effect before it returns.
    async fn fault(&mut self, fault: LinkFault) -> Result<(), LinkError>;

    /// Starts a fresh subscriber; what it receives comes as `Retained` and then `RetainedEnd` occurrences
    /// with the number returned.
    async fn fresh_subscriber(&mut self, topic: &str) -> Result<u64, LinkError>;

    /// Sends the harness a message through the broker; its return comes as `ProbeReceived` with the number
    /// returned.
    async fn probe(&mut self) -> Result<u64, LinkError>;

    /// Offers a file; returns its address as the device must use it.
    async fn serve(&mut self, offer: Offer) -> Result<String, LinkError>;

    /// PEM files with the certificates that a device has to trust if it is to find back to this bench.
    fn trusted(&self) -> Vec<std::path::PathBuf> {
        Vec::new()
    }

    /// How long messages took through the tap, as far as that was the harness's own time; `None` without a tap.
    fn time_to_pass_on(&self) -> Option<Spread> {
        None
    }

    /// Gives a command to a simulated device that lives on this link, if there is one.
    fn command(&mut self, name: &str, parameters: serde_json::Value) -> Commanded {
        let _ = (name, parameters);
        Commanded::Nobody
    }

    /// Sets a mock AGV of the harness that lives on this link; they are counted from 0. `false` when there is none
    /// of that number.
    fn vehicle(&mut self, number: usize, what: &str, with: serde_json::Value) -> bool {
        let _ = (number, what, with);
        false
    }
}
