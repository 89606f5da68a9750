//! The points of decision: what may be done, lasts, is said, happens and goes out.
//!
//! What the vehicle does at each stands where it does it; `seam` is who else is asked.

use serde_json::{Map, Value};

use super::actions::Action;
use super::book::Stop;
use super::errors::ActiveError;
use super::order_message::Edge;
use super::rejection::Rule;

/// A part of a message.
#[derive(Clone, Copy)]
pub(crate) enum Part<'a> {
    /// The whole state, without header.
    State,
    /// One of nodeStates.
    Node(&'a Stop),
    /// One of edgeStates.
    Edge(&'a Edge),
    /// One of actionStates.
    Action(&'a Action),
    /// One of errors.
    Error(&'a ActiveError),
    /// agvPosition, of a state and of a visualization.
    Position,
    /// velocity, of a state and of a visualization.
    Velocity,
    /// The whole visualization, without header.
    Visualization,
    /// The whole factsheet, without header.
    Factsheet,
}

/// The header that is written.
#[derive(Clone, Copy)]
pub(crate) struct Head {
    /// Topic name.
    pub(crate) name: &'static str,
    /// It is counted; that of a last will is not.
    pub(crate) counts: bool,
}

/// What is allowed or not.
#[derive(Clone, Copy)]
pub(crate) enum Permission<'a> {
    /// A message of a topic name goes out at all; without header.
    Say(&'static str, &'a Map<String, Value>),
    /// DISCONNECT is sent after OFFLINE (CONN-08).
    Disconnect,
    /// A map is downloaded that is on board already (MAP-23).
    DownloadAgain,
}

/// Why an error is listed.
#[derive(Clone, Copy)]
pub(crate) enum Cause<'a> {
    /// An order was refused, by a rule; the message.
    Refusal(Rule, &'a Value),
    /// A cancelOrder found no order.
    NothingToCancel,
    /// An action has failed.
    Failure(Option<&'a Action>),
}

/// What has a length in time.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Span {
    /// From one state to the next (STATE-02).
    BetweenStates,
    /// From one visualization to the next (VIS-02).
    BetweenVisualizations,
}

/// Something has happened, or is about to.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Event {
    /// The broker has accepted; nothing was said yet.
    Connected,
    /// The first state on a connection is due.
    Reporting,
    /// The link broke.
    ConnectionLost,
    /// OFFLINE is said next.
    Leaving,
    /// OFFLINE was said.
    Left,
    /// Time has passed.
    Woken,
    /// All consequences were drawn.
    Settled,
}

/// A message that goes out.
#[derive(Clone, Debug)]
pub(crate) struct Outgoing {
    /// Topic name.
    pub(crate) name: &'static str,
    /// Full topic.
    pub(crate) topic: String,
    /// Its content with the header.
    pub(crate) message: Map<String, Value>,
    /// QoS.
    pub(crate) qos: u8,
    /// RETAIN.
    pub(crate) retain: bool,
    /// A state that is sent because it is time.
    pub(crate) periodic: bool,
}
