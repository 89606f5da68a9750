//! The words of the hook points: what may be allowed, lasts, is counted, happens, is worded, comes in and goes out.
//!
//! What the master control does at each stands where it does it; `hooks` is who else is asked.

use serde_json::{Map, Value};

use super::config::SiteMap;
use super::dispatch::Way;
use super::order::Window;
use super::requests::Claim;
use super::rerouting::Reroute;
use super::seen::State;
use super::vehicle::{Leg, MapJob, Presence, Running, Stop, Transport};

/// Something that is allowed or not.
#[derive(Clone, Copy)]
pub(crate) enum Permission<'a> {
    /// Anything is sent to the vehicle (CONN-12).
    Reach,
    /// The vehicle is commanded (MODE-04).
    Command,
    /// A waiting instant action of this type is sent now.
    Tell(&'a str),
    /// An instant action of this type goes together with the order that is driven (IACT-02).
    Beside(&'a str),
    /// An instant action, which was lost, is sent again.
    TellAgain,
    /// An action of this type is used in this scope (FACT-15).
    Offer(&'a str, &'a str),
    /// An id of this kind has letters (FACT-12).
    Letters(&'a str),
    /// An id is one the vehicle takes.
    Name(&'a str),
    /// An order is taken for gone, which the state shows no more.
    Gone,
    /// The vehicle is well enough for new work.
    Fit,
    /// A transport has to wait because the battery is too low for it (FACT-17).
    Starve,
    /// A sleeping vehicle is woken (HIB-13).
    Wake,
    /// A list of actions is emptied by this action (IACT-STATE-07).
    Clear(&'a str),
    /// A new order is begun.
    Begin,
    /// A new order is begun although the way of the last one is not driven to its end.
    Interrupt,
    /// The running order is looked after.
    Follow,
    /// The base of an order is extended.
    Extend(&'a Running),
    /// newBaseRequest is heeded.
    Heed,
    /// The base grows now: so many nodes are left, and more was asked for or not.
    Grow(&'a Running, usize, bool),
    /// A lost order message is sent again.
    Resend(&'a Running),
    /// A waitForTrigger that runs is given only its time.
    Supervise(&'a Running),
    /// A map is used by an order (MAP-09).
    UseMap(&'a str, &'a Running),
    /// The next edge is released by an order of which so many nodes are released (ORD-12).
    Drive(usize),
    /// cancelOrder has ended.
    CancelEnded,
    /// The order called off is not driven any more.
    OrderGone,
    /// The vehicle is given zones at all (ZSET-25).
    GiveZones,
    /// A set is sent on its topic, and not fetched (ZSET-02).
    SendZones,
    /// It is given zones of this type (ZSET-25).
    ZoneType,
    /// A set that is known has this content, and is used for it (ZSET-06).
    SameSet(&'a Value, &'a Value),
    /// A set that is on board is enabled (ZSET-08).
    EnableZones,
    /// Orders may rely on the zones of the vehicle (ZSET-08).
    ZonesReady,
    /// A claim of another vehicle keeps a zone from being given (ZREQ-17, ZREQ-18).
    Occupied(&'a Claim),
    /// A grant is prolonged (REQ-11).
    Prolong,
    /// An order is called off because the vehicle cannot come to a node of it (ZERR-03).
    GiveUp,
}

/// Something that has a length in time.
#[derive(Clone, Copy)]
pub(crate) enum Span {
    /// From one order message to the next (FACT-13).
    Interval(Occasion),
    /// Until something is taken for lost.
    Lost,
    /// For which something is given that a vehicle asks for; for good if it is nothing.
    Lease,
}

/// Why an order message is sent.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Occasion {
    /// A new order.
    New,
    /// It was lost.
    Again,
    /// An update: the way has changed, or the vehicle asks for more.
    Update { changed: bool, asked: bool },
}

/// Something that is counted or limited.
#[derive(Clone, Copy)]
pub(crate) enum Measure<'a> {
    /// Nodes a message may have; it is an update or not (FACT-12).
    Nodes(bool),
    /// Nodes a state may list.
    NodeStates,
    /// Index behind the last node that is shown, of so many that are asked for.
    Shown(usize),
    /// Bytes of a message; it is an update or not.
    Message(bool),
    /// Letters of an id.
    IdLength,
    /// Actions of one node, or one edge.
    Actions,
    /// Parameters of one action.
    Parameters,
    /// Instant actions of one message.
    Instants,
    /// Index behind the last node to be released by the next update, of so many that are free; it was asked for or not.
    Base(&'a Running, usize, bool),
    /// Index behind the last node that can be released.
    Free,
    /// Zones of one set (ZSET-27).
    Zones,
}

/// Something has happened, or is about to; what is mutable can be changed.
pub(crate) enum Event<'a> {
    /// The broker has accepted, for the first time or again.
    Connected(bool),
    /// The vehicle says that it is ONLINE; and what it was before.
    Online(Presence),
    /// The vehicle is OFFLINE, or its connection is broken (true); and what it was before.
    Away(bool, Presence),
    /// A state was taken; this was the one before.
    State(Option<&'a State>),
    /// A factsheet was taken.
    Factsheet,
    /// It is looked what is to be done for a vehicle.
    Looked,
    /// A new order is planned.
    Planned(&'a mut Running),
    /// It is sent next.
    Begins(&'a mut Running),
    /// It was sent.
    Begun,
    /// The base may be extended.
    Extending(&'a mut Running),
    /// An update has to wait for minOrderInterval: nodes to be released, and nodes free.
    Waits(&'a mut Running, usize, usize),
    /// An update has its number and is worded next.
    Updating(&'a mut Running),
    /// It was sent, because the vehicle asked for it or not.
    Updated(&'a mut Running, bool),
    /// A lost message is sent again.
    Resending(&'a mut Running),
    /// An order is over; it was called off or not.
    Ended(&'a Running, bool),
    /// A transport gets another destination.
    Rerouting(&'a mut Running, &'a mut Reroute),
    /// The way behind the base was replaced.
    Led(&'a mut Running),
    /// The way behind the base cannot be replaced by this one; set to true when it was done otherwise.
    NotLed(&'a mut Running, &'a mut Way, &'a Transport, &'a mut bool),
    /// The leg of this index is closed; set to false when nothing has to be done.
    Closed(usize, &'a mut bool),
    /// The order is to be called off, with what is done instead; set to false when nothing is to be sent.
    CallingOff(&'a mut Option<Transport>, &'a mut bool),
    /// cancelOrder waits to be sent.
    CalledOff,
    /// Nothing is called off any more.
    CancelOver,
    /// The instant action of this actionId was lost and waits to be sent again.
    InstantLost(&'a str),
    /// A map is to be rolled out; set to true when it was done otherwise.
    RollOut(&'a SiteMap, &'a mut bool),
    /// A step of a roll-out has ended, well or not; the actionId of the next; set to true when it was done otherwise.
    RolledOut(&'a mut MapJob, bool, &'a mut Option<String>, &'a mut bool),
    /// enableMap has ended for a map, well or not.
    Enabled(&'a str, bool),
    /// The vehicle is to be set to a place; set to true when it was done otherwise.
    Placing(&'a mut Value, &'a mut bool),
}

/// Origin of an order message: its order, and the part of the way it shows.
pub(crate) struct Worded<'a> {
    pub(crate) running: &'a Running,
    pub(crate) window: Window,
    /// The way is longer than the vehicle takes in one message.
    pub(crate) cut: bool,
}

impl Worded<'_> {
    /// Whether it is an update of an order.
    pub(crate) fn is_update(&self) -> bool {
        self.window.first > 0
    }

    /// Changes each node, knowing its place in the whole way.
    pub(crate) fn nodes(
        &self,
        message: &mut Map<String, Value>,
        mut change: impl FnMut(usize, &Stop, &mut Map<String, Value>),
    ) {
        let known = self.running.stops.iter().enumerate().skip(self.window.first);
        for (node, (index, stop)) in entries(message, "nodes").zip(known) {
            change(index, stop, node);
        }
    }

    /// Changes each edge, knowing the place of the node before it in the whole way.
    pub(crate) fn edges(
        &self,
        message: &mut Map<String, Value>,
        mut change: impl FnMut(usize, &Leg, &mut Map<String, Value>),
    ) {
        let known = self.running.legs.iter().enumerate().skip(self.window.first);
        for (edge, (index, leg)) in entries(message, "edges").zip(known) {
            change(index, leg, edge);
        }
    }
}

/// The objects in a list of a message.
fn entries<'a>(message: &'a mut Map<String, Value>, list: &str) -> impl Iterator<Item = &'a mut Map<String, Value>> {
    let entries = message.get_mut(list).and_then(Value::as_array_mut);
    entries.into_iter().flatten().filter_map(Value::as_object_mut)
}

/// An optional field of a node or an edge.
pub(crate) struct Field<'a> {
    /// Its name in the factsheet, such as `order.edges.maxSpeed`.
    pub(crate) name: &'a str,
    /// Value in the layout.
    pub(crate) layout: Option<Value>,
    /// Value that is sent where the vehicle demands it and the layout says nothing.
    pub(crate) default: Value,
    /// Support the factsheet states for it.
    pub(crate) support: Option<&'a str>,
    /// The vehicle has no factsheet, and the field does no harm.
    pub(crate) harmless: bool,
    /// Index of the node, or of the node before the edge.
    pub(crate) index: usize,
    /// The message it stands in.
    pub(crate) window: Window,
}

/// A message that was delivered.
pub(crate) struct Heard<'a> {
    /// Topic name.
    pub(crate) name: &'static str,
    /// Full topic.
    pub(crate) topic: &'a str,
    /// Its bytes.
    pub(crate) payload: &'a [u8],
    /// Its content; null if it is not JSON.
    pub(crate) message: Value,
}

/// A message that goes out.
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
    /// An order that was lost is sent again.
    pub(crate) again: bool,
}

impl Outgoing {
    /// Whether it is an update of an order.
    pub(crate) fn is_update(&self) -> bool {
        let first = self
            .message
            .get("nodes")
            .and_then(|nodes| nodes.pointer("/0/sequenceId"));
        self.name == "order" && first.and_then(Value::as_u64).is_some_and(|sequence| sequence > 0)
    }

    /// Whether it is an order that was not sent before.
    pub(crate) fn is_new_order(&self) -> bool {
        self.name == "order" && !self.is_update() && !self.again
    }

    /// Whether it holds an instant action of one of these types.
    pub(crate) fn tells(&self, kinds: &[&str]) -> bool {
        let actions = self.message.get("actions").and_then(Value::as_array);
        let mut types = actions
            .into_iter()
            .flatten()
            .filter_map(|action| action["actionType"].as_str());
        types.any(|kind| kinds.contains(&kind))
    }
}

/// Fate of the running order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fate {
    /// It goes on.
    Runs,
    /// It is done, or given up.
    Over,
    /// The vehicle does not have it any more, or refused it for where it stands.
    Again,
    /// The rest has to be called off.
    CalledOff,
    /// The rest has to be called off because a trigger did not come in time.
    TooLate,
}
