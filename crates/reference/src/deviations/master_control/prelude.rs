//! What records of the master control are made of: the words of its hook points, and the shapes that most deviations have.

pub(super) use std::collections::{BTreeMap, BTreeSet};
pub(super) use std::time::Duration;

pub(super) use serde_json::{Value, json};

pub(super) use crate::deviations::json_edit::JsonEdit;
pub(super) use crate::deviations::record::Record;
pub(super) use crate::master_control::Site;
pub(super) use crate::master_control::dispatch::Way;
pub(super) use crate::master_control::hooks::{
    Deviation, Event, Fate, Field, Heard, Hooks, Measure, Object, Occasion, Outgoing, Permission, Span, Worded,
};
pub(super) use crate::master_control::order::Window;
pub(super) use crate::master_control::requests::{Claim, Grant, Wish};
pub(super) use crate::master_control::seen::{Factsheet, Position, State};
pub(super) use crate::master_control::vehicle::{Leg, Presence, Running, Stop, Transport, Vehicle};
pub(super) use crate::master_control::ways::{Pose, Standing};
pub(super) use tck_base::clock::Moment;

use crate::ConnectOptions;
use crate::hooks::Memory;
use crate::master_control::actions::is_predefined;

/// One that remembers this of the whole fleet, or for good.
pub(super) fn holding<M>(memory: M) -> Box<Hooks<M>> {
    Hooks::new(Memory::One(memory))
}

/// One that remembers something of the whole fleet.
pub(super) fn fleet<M: Default>() -> Box<Hooks<M>> {
    holding(M::default())
}

/// One that remembers something of each vehicle, and this at first.
pub(super) fn each<M>(first: M) -> Box<Hooks<M>> {
    Hooks::new(Memory::Each(BTreeMap::new(), first))
}

/// One that remembers something of each vehicle.
pub(super) fn keep<M: Default>() -> Box<Hooks<M>> {
    each(M::default())
}

/// One that remembers nothing.
pub(super) fn plain() -> Box<Hooks<()>> {
    holding(())
}

type Sending = fn(&mut Site, &mut Vehicle, &mut Outgoing);

/// Sends messages otherwise.
pub(super) fn sending(change: Sending) -> Box<Hooks<Sending>> {
    holding(change).sends(|change, site, vehicle, outgoing| {
        change(site, vehicle, outgoing);
        true
    })
}

type Wording = fn(&mut Object);

macro_rules! messages {
    ($($(#[$doc:meta])* $name:ident: $outgoing:ident $when:expr;)+) => {
        $($(#[$doc])* pub(super) fn $name(change: Wording) -> Box<Hooks<Wording>> {
            holding(change).sends(|change, _, _, $outgoing| {
                if $when {
                    change(&mut $outgoing.message);
                }
                true
            })
        })+
    };
}

messages! {
    /// Words every message otherwise.
    every: outgoing true;
    /// Words orders and their updates otherwise.
    order: outgoing outgoing.name == "order";
    /// Words orders otherwise that are no updates.
    new_order: outgoing outgoing.name == "order" && !outgoing.is_update();
    /// Words updates of orders otherwise.
    update: outgoing outgoing.is_update();
    /// Words messages with instant actions otherwise.
    instant: outgoing outgoing.name == "instantActions";
    /// Words sets of zones otherwise.
    zone_set: outgoing outgoing.name == "zoneSet";
    /// Words answers to requests otherwise.
    responses: outgoing outgoing.name == "responses";
    /// Words the message with cancelOrder otherwise.
    cancel: outgoing outgoing.tells(&["cancelOrder"]);
    /// Words an order otherwise that is sent again because it was lost.
    resent: outgoing outgoing.again;
}

macro_rules! entries {
    ($($(#[$doc:meta])* $name:ident: $message:ident, $change:ident $does:expr;)+) => {
        $($(#[$doc])* pub(super) fn $name(change: Wording) -> Box<Hooks<Wording>> {
            holding(change).sends(|$change, _, _, outgoing| {
                let $message = &mut outgoing.message;
                $does;
                true
            })
        })+
    };
}

entries! {
    /// Words each node otherwise.
    node: message, change message.each("nodes", change);
    /// Words the position of each node otherwise.
    position: message, change message.each("nodes", |node| node.part("nodePosition", |place| change(place)));
    /// Words each edge otherwise.
    edge: message, change message.each("edges", change);
    /// Words each node and each edge otherwise.
    element: message, change each_element(message, change);
    /// Words each node and each edge of the horizon otherwise.
    horizon: message, change each_element(message, |element| if element.says("released", false) { change(element) });
    /// Words each action otherwise.
    action: message, change each_action(message, change);
    /// Words each zone of a set otherwise.
    zone: message, change message.part("zoneSet", |set| set.each("zones", change));
    /// Words each answer to a request otherwise.
    response: message, change message.each("responses", change);
}

type WordingAction = fn(&str, &mut Object);

/// Words each action otherwise, in a message of this topic name.
pub(super) fn action_in(change: WordingAction) -> Box<Hooks<WordingAction>> {
    holding(change).sends(|change, _, _, outgoing| {
        let name = outgoing.name;
        each_action(&mut outgoing.message, |action| change(name, action));
        true
    })
}

type Named = (&'static str, Wording);

/// Words each action in messages of one topic otherwise.
pub(super) fn action_of(name: &'static str, change: Wording) -> Box<Hooks<Named>> {
    holding((name, change)).sends(|(name, change), _, _, outgoing| {
        if outgoing.name == *name {
            each_action(&mut outgoing.message, change);
        }
        true
    })
}

/// Words each action of one type otherwise.
pub(super) fn typed(kind: &'static str, change: Wording) -> Box<Hooks<Named>> {
    holding((kind, change)).sends(|(kind, change), _, _, outgoing| {
        each_action(&mut outgoing.message, |action| {
            if action.text("actionType") == *kind {
                change(action);
            }
        });
        true
    })
}

/// Words each parameter otherwise, of an action of this type.
pub(super) fn parameter(change: WordingAction) -> Box<Hooks<WordingAction>> {
    holding(change).sends(|change, _, _, outgoing| {
        each_action(&mut outgoing.message, |action| {
            let kind = action.text("actionType").to_owned();
            action.each("actionParameters", |parameter| change(&kind, parameter));
        });
        true
    })
}

/// Words each parameter of one key otherwise.
pub(super) fn parameter_of(key: &'static str, change: Wording) -> Box<Hooks<Named>> {
    holding((key, change)).sends(|(key, change), _, _, outgoing| {
        each_action(&mut outgoing.message, |action| {
            action.each("actionParameters", |parameter| {
                if parameter.text("key") == *key {
                    change(parameter);
                }
            });
        });
        true
    })
}

/// Changes each node and each edge of a message.
pub(super) fn each_element(message: &mut Object, mut change: impl FnMut(&mut Object)) {
    for list in ["nodes", "edges"] {
        message.each(list, &mut change);
    }
}

/// Changes each action of a message.
pub(super) fn each_action(message: &mut Object, mut change: impl FnMut(&mut Object)) {
    each_element(message, |element| element.each("actions", &mut change));
    message.each("actions", change);
}

type Writing = (&'static str, fn(&mut Vec<u8>));

/// Writes the text of messages of one topic otherwise.
pub(super) fn writing(name: &'static str, change: fn(&mut Vec<u8>)) -> Box<Hooks<Writing>> {
    holding((name, change)).writes(|(wanted, change), _, name, _, text| {
        if name == *wanted {
            change(text);
        }
    })
}

type Making = fn(&mut Site, &Vehicle, &mut Object, &Value, bool);

/// Makes actions otherwise, knowing the parameters that were handed over and whether it is an instant action.
pub(super) fn making(change: Making) -> Box<Hooks<Making>> {
    holding(change).makes(|change, site, vehicle, action, given, instant| change(site, vehicle, action, given, instant))
}

type Made = (fn(&str) -> bool, fn(&Site, &Vehicle, &str, &mut Object));

/// Makes actions of some types otherwise.
fn made_where(which: fn(&str) -> bool, change: fn(&Site, &Vehicle, &str, &mut Object)) -> Box<Hooks<Made>> {
    holding((which, change)).makes(|(which, change), site, vehicle, action, _, _| {
        let kind = action.text("actionType").to_owned();
        if which(&kind) {
            change(site, vehicle, &kind, action);
        }
    })
}

/// Makes each action otherwise, of this type.
pub(super) fn made(change: fn(&Site, &Vehicle, &str, &mut Object)) -> Box<Hooks<Made>> {
    made_where(|_| true, change)
}

/// Makes actions of the manufacturer otherwise.
pub(super) fn made_by_vendor(change: fn(&Site, &Vehicle, &str, &mut Object)) -> Box<Hooks<Made>> {
    made_where(|kind| !is_predefined(kind), change)
}

type MadeOf = (&'static str, fn(&Vehicle, &mut Object));

/// Makes actions of one type otherwise.
pub(super) fn made_of(kind: &'static str, change: fn(&Vehicle, &mut Object)) -> Box<Hooks<MadeOf>> {
    holding((kind, change)).makes(|(kind, change), _, vehicle, action, _, _| {
        if action.text("actionType") == *kind {
            change(vehicle, action);
        }
    })
}

type Naming = (&'static str, fn(&Site, &Vehicle) -> String);

/// Gives other ids of one kind: order, action, place or way.
pub(super) fn naming(kind: &'static str, id: fn(&Site, &Vehicle) -> String) -> Box<Hooks<Naming>> {
    holding((kind, id)).names(|(kind, name), site, vehicle, what, id| {
        if what == *kind {
            *id = name(site, vehicle);
        }
    })
}

/// Counts ids of one kind from 1, for the whole fleet, and anew when something happens.
pub(super) fn counting(kind: &'static str, anew: fn(&Event<'_>) -> bool) -> Box<dyn Deviation> {
    holding((kind, anew, 0))
        .names(|(kind, _, count), site, vehicle, what, id| {
            if what == *kind {
                *count += 1;
                *id = site.spelled(vehicle, what, *count);
            }
        })
        .happens(|(_, anew, count), _, _, event| {
            if anew(event) {
                *count = 0;
            }
        })
}

type Filling = fn(&Vehicle, &Field<'_>, &mut Option<Value>);

/// Fills optional fields otherwise.
pub(super) fn filling(change: Filling) -> Box<Hooks<Filling>> {
    holding(change).fills(|change, _, vehicle, field, value| change(vehicle, field, value))
}

type Composing = fn(&Site, &Vehicle, &Worded<'_>, &mut Object);

/// Words order messages otherwise, knowing how they came about.
pub(super) fn composing(change: Composing) -> Box<Hooks<Composing>> {
    holding(change).words(|change, site, vehicle, worded, message| change(site, vehicle, worded, message))
}

type ComposingNode = fn(&Vehicle, &Worded<'_>, usize, &Stop, &mut Object);

/// Words each node otherwise, knowing its place in the whole way.
pub(super) fn nodes(change: ComposingNode) -> Box<Hooks<ComposingNode>> {
    holding(change).words(|change, _, vehicle, worded, message| {
        worded.nodes(message, |index, stop, node| change(vehicle, worded, index, stop, node));
    })
}

type ComposingEdge = fn(&Vehicle, &Worded<'_>, usize, &Leg, &mut Object);

/// Words each edge otherwise, knowing the place of the node before it in the whole way.
pub(super) fn edges(change: ComposingEdge) -> Box<Hooks<ComposingEdge>> {
    holding(change).words(|change, _, vehicle, worded, message| {
        worded.edges(message, |index, leg, edge| change(vehicle, worded, index, leg, edge));
    })
}

type Connecting = fn(&Site, &[Vehicle], &mut ConnectOptions);

/// Connects otherwise.
pub(super) fn connecting(change: Connecting) -> Box<Hooks<Connecting>> {
    holding(change).connects(|change, site, fleet, options| change(site, fleet, options))
}

type Letting = fn(&Site, &Vehicle, Permission<'_>) -> bool;

/// Allows what is not allowed.
pub(super) fn letting(which: Letting) -> Box<Hooks<Letting>> {
    holding(which).allows(|which, site, vehicle, what, usual| usual || which(site, vehicle, what))
}

/// Does not allow what is allowed.
pub(super) fn forbidding(which: Letting) -> Box<Hooks<Letting>> {
    holding(which).allows(|which, site, vehicle, what, usual| usual && !which(site, vehicle, what))
}

type Allowing = fn(&Vehicle, Permission<'_>, bool) -> bool;

/// Allows something else.
pub(super) fn allowing(change: Allowing) -> Box<Hooks<Allowing>> {
    holding(change).allows(|change, _, vehicle, what, usual| change(vehicle, what, usual))
}

type Measuring = fn(&Vehicle, Measure<'_>, usize) -> usize;

/// Takes something for more or less than it is.
pub(super) fn measuring(change: Measuring) -> Box<Hooks<Measuring>> {
    holding(change).measures(|change, _, vehicle, what, usual| change(vehicle, what, usual))
}

/// Knows no limit of something.
pub(super) fn unlimited(which: fn(Measure<'_>) -> bool) -> Box<Hooks<fn(Measure<'_>) -> bool>> {
    holding(which).measures(|which, _, _, what, usual| if which(what) { usize::MAX } else { usual })
}

type Planning = fn(&mut Site, &mut Vehicle, &mut Way);

/// Plans whole ways otherwise, of new orders and behind the base of running ones.
pub(super) fn planning(change: Planning) -> Box<Hooks<Planning>> {
    holding(change).plans(|change, site, vehicle, way, _, _| change(site, vehicle, way))
}

/// Plans the ways of new orders otherwise.
pub(super) fn planning_new(change: Planning) -> Box<Hooks<Planning>> {
    holding(change).plans(|change, site, vehicle, way, _, fresh| {
        if fresh {
            change(site, vehicle, way);
        }
    })
}

type Placing = fn(&mut Site, &Vehicle, &mut Pose);

/// Takes the vehicle for standing elsewhere when a new order begins.
pub(super) fn standing(change: Placing) -> Box<Hooks<Placing>> {
    holding(change).stands(|change, site, vehicle, pose, _| change(site, vehicle, pose))
}

type Showing = fn(&Vehicle, &Running, &mut Window, usize);

/// Shows another part of the way in a message, of so many nodes that are free.
pub(super) fn showing(change: Showing) -> Box<Hooks<Showing>> {
    holding(change).shows(|change, _, vehicle, running, window, free| change(vehicle, running, window, free))
}

type Judging = fn(&mut Vehicle, &mut Running, &State, Fate) -> Fate;

/// Sees something else in what has become of the running order.
pub(super) fn judging(change: Judging) -> Box<Hooks<Judging>> {
    holding(change).judges(|change, _, vehicle, running, state, fate| change(vehicle, running, state, fate))
}

type Happening = fn(&mut Site, &mut Vehicle, &mut Event<'_>);

/// Does something when things happen.
pub(super) fn happening(then: Happening) -> Box<Hooks<Happening>> {
    holding(then).happens(|then, site, vehicle, event| then(site, vehicle, event))
}

type When = (fn(&Event<'_>) -> bool, fn(&mut Site, &mut Vehicle));

/// Does something when something happens.
pub(super) fn when(event: fn(&Event<'_>) -> bool, then: fn(&mut Site, &mut Vehicle)) -> Box<Hooks<When>> {
    holding((event, then)).happens(|(wanted, then), site, vehicle, event| {
        if wanted(event) {
            then(site, vehicle);
        }
    })
}

macro_rules! events {
    ($($(#[$doc:meta])* $name:ident $event:pat => ($($arg:ident: $type:ty),*);)+) => {
        $($(#[$doc])* pub(super) fn $name(
            then: fn(&mut Site, &mut Vehicle, $($type),*),
        ) -> Box<Hooks<fn(&mut Site, &mut Vehicle, $($type),*)>> {
            holding(then).happens(|then, site, vehicle, event| {
                if let $event = event {
                    then(site, vehicle, $($arg),*);
                }
            })
        })+
    };
}

events! {
    /// Does something when the vehicle is looked after.
    looked Event::Looked => ();
    /// Does something when a state was taken.
    state_taken Event::State(_) => ();
    /// Does something when the broker has accepted again.
    reconnected Event::Connected(true) => ();
    /// Does something when a new order was sent.
    begun Event::Begun => ();
    /// Plans a new order otherwise.
    planned Event::Planned(running) => (running: &mut Running);
    /// Changes an update before it is worded.
    updating Event::Updating(running) => (running: &mut Running);
    /// Changes a lost message before it is sent again.
    resending Event::Resending(running) => (running: &mut Running);
    /// Does something else than calling an order off: what is done instead, and whether cancelOrder is sent.
    calling_off Event::CallingOff(then, sends) => (then: &mut Option<Transport>, sends: &mut bool);
}

type Asked = (&'static str, fn(&mut Site, &mut Vehicle, &Value) -> bool);

/// Does something when a command is given for a vehicle; false when that is all.
pub(super) fn asked(command: &'static str, then: fn(&mut Site, &mut Vehicle, &Value) -> bool) -> Box<Hooks<Asked>> {
    holding((command, then))
        .asked(|(wanted, then), site, vehicle, command, arguments| command != *wanted || then(site, vehicle, arguments))
}

/// Hears messages otherwise; false to drop one.
pub(super) fn hearing(which: fn(&Site, &Vehicle, &Heard<'_>) -> bool) -> Box<dyn Deviation> {
    holding(which).hears(|which, site, vehicle, heard| which(site, vehicle, heard))
}

/// A number that is a member.
pub(super) fn number(object: &Object, key: &str) -> Option<f64> {
    object.get(key).and_then(Value::as_f64)
}

/// Multiplies a number that is there.
pub(super) fn scale(object: &mut Object, key: &str, factor: f64) {
    if let Some(number) = number(object, key) {
        object.set(key, number * factor);
    }
}

/// Adds to a number that is there.
pub(super) fn shift(object: &mut Object, key: &str, by: f64) {
    if let Some(number) = number(object, key) {
        object.set(key, number + by);
    }
}

pub(super) fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

pub(super) fn is_loaded(vehicle: &Vehicle) -> bool {
    let loads = vehicle.state.as_ref().and_then(|state| state.loads.as_ref());
    loads.is_some_and(|loads| !loads.is_empty())
}

/// Whether the localizationScore is low.
pub(super) fn is_unsure(vehicle: &Vehicle) -> bool {
    let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
    let score = position.and_then(|position| position.localization_score);
    score.is_some_and(|score| score < 0.5)
}

/// Remembers that the way of the running order was changed.
pub(super) fn rerouted(changed: &mut bool, _: &mut Site, _: &mut Vehicle, event: &mut Event<'_>) {
    match event {
        Event::Led(_) => *changed = true,
        Event::Begun => *changed = false,
        _ => {}
    }
}

/// Describes every node and edge, whether the vehicle takes that or not.
pub(super) fn describing() -> Box<Hooks<Filling>> {
    filling(|_, field, value| describe(field, value))
}

/// Writes a description.
pub(super) fn describe(field: &Field<'_>, value: &mut Option<Value>) {
    let what = field
        .name
        .rsplit('.')
        .next()
        .and_then(|name| name.strip_suffix("Description"));
    if let Some(what) = what.filter(|what| matches!(*what, "node" | "edge")) {
        let id = field.default.as_str().unwrap_or_default();
        *value = Some(Value::from(format!("{what} {id} in allée 1")));
    }
}

/// The operating mode of the last state.
pub(super) fn mode(vehicle: &Vehicle) -> &str {
    let mode = vehicle.state.as_ref().map(|state| state.operating_mode.as_str());
    mode.unwrap_or_default()
}

pub(super) fn takes_orders(vehicle: &Vehicle) -> bool {
    vehicle.state.as_ref().is_some_and(State::takes_orders)
}

/// Whether the last state gives information.
pub(super) fn informs(vehicle: &Vehicle) -> bool {
    vehicle.state.as_ref().is_some_and(State::informs)
}

pub(super) fn has_low_battery(site: &Site, vehicle: &Vehicle) -> bool {
    let charge = vehicle
        .state
        .as_ref()
        .and_then(|state| state.battery_state.battery_charge);
    charge.is_some_and(|charge| charge < site.config.low_battery)
}

/// The temporary node where a way begins, if it does.
pub(super) fn temporary<'a>(site: &Site, way: &'a mut Way) -> Option<&'a mut Stop> {
    let first = way.stops.first_mut().filter(|first| !first.id.is_empty());
    first.filter(|first| site.config.node(&first.id).is_none())
}

/// Does not wait for the end of the last order.
pub(super) fn hasty(hasty: &bool, _: &Site, _: &Vehicle, what: Permission<'_>, usual: bool) -> bool {
    usual || (*hasty && matches!(what, Permission::Interrupt))
}
