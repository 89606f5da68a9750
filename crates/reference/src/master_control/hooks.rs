//! The hook points of a master control: what a deviation can do otherwise, and who asks it.
//!
//! The master control asks here at its points of decision and says here what happens (`hook_points` has the words for both).
//! With nothing switched on there is nobody to be asked.

use std::collections::BTreeSet;
use std::time::Duration;

use serde_json::{Map, Value};

use super::Site;
use super::config::MasterControlConfig;
use super::dispatch::Way;
use super::order::Window;
use super::requests::{Claim, Grant};
use super::seen::State;
use super::vehicle::{Running, Transport, Vehicle};
use super::ways::Pose;
use crate::ConnectOptions;
use crate::hooks::Memory;

pub(crate) use super::hook_points::{Event, Fate, Field, Heard, Measure, Occasion, Outgoing, Permission, Span, Worded};

/// A JSON object of a message.
pub(crate) type Object = Map<String, Value>;

hooks! {
    Site configured by MasterControlConfig;

    /// The connection is to be made.
    mut connects(fleet: &[Vehicle], options: &mut ConnectOptions) = each;
    /// How long it waits after a lost link; `None` for ever.
    mut retries(delay: Option<Duration>) -> Option<Duration> = fold(delay);
    /// Somebody asks for something; false when it is done for the whole fleet.
    mut commanded(fleet: &mut [Vehicle], command: &str, arguments: &Value) -> bool = all;
    /// Somebody asks for something, of a vehicle; false when it is done.
    mut asked of vehicle (vehicle: &mut Vehicle, command: &str, arguments: &Value) -> bool = all;
    /// Why it does not do what somebody asks for, of a vehicle; it says so, and keeps nothing in mind.
    ref declines of vehicle (vehicle: &Vehicle, command: &str, arguments: &Value) -> Option<String> = first;
    /// A message came in; false to drop it.
    mut hears of vehicle (vehicle: &mut Vehicle, heard: &mut Heard<'_>) -> bool = all;
    /// Something has happened, or is about to.
    mut happens of vehicle (vehicle: &mut Vehicle, event: &mut Event<'_>) = each;
    /// Whether something is allowed.
    ref allows of vehicle (vehicle: &Vehicle, what: Permission<'_>, usual: bool) -> bool = fold(usual);
    /// How long something lasts.
    ref lasts of vehicle (vehicle: &Vehicle, what: Span, usual: Duration) -> Duration = fold(usual);
    /// How much something is.
    ref measures of vehicle (vehicle: &Vehicle, what: Measure<'_>, usual: usize) -> usize = fold(usual);
    /// Where the vehicle is, as the new order of a transport sees it.
    mut stands of vehicle (vehicle: &mut Vehicle, pose: &mut Pose, transport: &Transport) = each;
    /// The edges that are not used between two nodes.
    mut avoids of vehicle (vehicle: &mut Vehicle, from: &str, to: &str, closed: &mut BTreeSet<(String, String)>) = each;
    /// A whole way is planned, of a new order (`fresh`) or behind the base of a running one.
    mut plans of vehicle (vehicle: &mut Vehicle, way: &mut Way, transport: &Transport, fresh: bool) = each;
    /// What part of a way the next message holds, of so many nodes that are free.
    mut shows of vehicle (vehicle: &mut Vehicle, running: &Running, window: &mut Window, free: usize) = each;
    /// What has become of the running order.
    mut judges of vehicle (vehicle: &mut Vehicle, running: &mut Running, state: &State, fate: Fate) -> Fate = fold(fate);
    /// What is said to a request of the vehicle that has no final answer yet; `None` if nothing.
    mut decides of vehicle (vehicle: &mut Vehicle, claim: &Claim, usual: Option<Grant>) -> Option<Grant> = fold(usual);
    /// An id is given, of a kind: order, action, place, way, zones.
    mut names of vehicle (vehicle: &Vehicle, what: &str, id: &mut String) = each;
    /// An action is made with the parameters that were handed over: an instant action, or one of an order.
    mut makes of vehicle (vehicle: &Vehicle, action: &mut Object, given: &Value, instant: bool) = each;
    /// An optional field of a node or an edge.
    ref fills of vehicle (vehicle: &Vehicle, field: &Field<'_>, value: &mut Option<Value>) = each;
    /// An order message is worded, without header.
    mut words of vehicle (vehicle: &Vehicle, worded: &Worded<'_>, message: &mut Object) = each;
    /// A message goes out; false to hold it back.
    mut sends of vehicle (vehicle: &mut Vehicle, outgoing: &mut Outgoing) -> bool = all;
    /// The text of a message.
    ref writes(name: &str, message: &Value, text: &mut Vec<u8>) = each;
}

impl Site {
    /// Switches a deviation on.
    pub(crate) fn switch_on(&mut self, deviation: Hook) {
        deviation.configures(&mut self.config);
        self.hooks.push(deviation);
    }

    /// The text of a message.
    pub(crate) fn text(&self, name: &str, message: &Value) -> Vec<u8> {
        let mut text = message.to_string().into_bytes();
        self.writes(name, message, &mut text);
        text
    }
}
