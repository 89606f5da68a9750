//! Short ways to write a deviation: what it does at one place or another of the seam, and what it remembers.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde_json::{Map, Value};

use crate::ConnectOptions;
use crate::deviations::words::Words;
use crate::master_control::dispatch::Way;
use crate::master_control::order::Window;
use crate::master_control::seam::{
    Deviation, Event, Fate, Field, Heard, Joining, Made, Measure, Outgoing, Permission, Plan, Span,
};
use crate::master_control::seen::State;
use crate::master_control::vehicle::{Leg, Running, Stop, Transport, Vehicle};
use crate::master_control::ways::Pose;
use crate::master_control::{MasterControlConfig, Site};

/// A JSON object of a message.
pub(super) type Object = Map<String, Value>;

/// A change of what a message says.
pub(super) enum Said {
    /// Of every message.
    Every(fn(&mut Object)),
    /// Of orders.
    Order(fn(&mut Object)),
    /// Of updates of orders.
    Update(fn(&mut Object)),
    /// Of messages with instant actions.
    Instant(fn(&mut Object)),
    /// Of each node.
    Node(fn(&mut Object)),
    /// Of the position of each node.
    Position(fn(&mut Object)),
    /// Of each edge.
    Edge(fn(&mut Object)),
    /// Of each action, in a message of this topic name.
    Action(fn(&str, &mut Object)),
    /// Of each parameter, of an action of this type.
    Parameter(fn(&str, &mut Object)),
}

impl Deviation for Said {
    fn publishes(&mut self, _: &mut Site, _: &mut Vehicle, outgoing: &mut Outgoing) -> bool {
        let (order, update) = (outgoing.name == "order", outgoing.is_update());
        let name = outgoing.name;
        let message = &mut outgoing.message;
        match self {
            Self::Every(change) => change(message),
            Self::Order(change) if order => change(message),
            Self::Update(change) if update => change(message),
            Self::Instant(change) if !order => change(message),
            Self::Node(change) => message.each("nodes", change),
            Self::Position(change) => message.each("nodes", |node| node.part("nodePosition", |place| change(place))),
            Self::Edge(change) => message.each("edges", change),
            Self::Action(change) => each_action(message, |action| change(name, action)),
            Self::Parameter(change) => each_action(message, |action| {
                let kind = action.text("actionType").to_owned();
                action.each("actionParameters", |parameter| change(&kind, parameter));
            }),
            _ => {}
        }
        true
    }
}

/// Changes each action of a message.
pub(super) fn each_action(message: &mut Object, mut change: impl FnMut(&mut Object)) {
    for list in ["nodes", "edges"] {
        message.each(list, |element| element.each("actions", &mut change));
    }
    message.each("actions", change);
}

pub(super) fn every(change: fn(&mut Object)) -> Box<Said> {
    Box::new(Said::Every(change))
}

pub(super) fn order(change: fn(&mut Object)) -> Box<Said> {
    Box::new(Said::Order(change))
}

pub(super) fn update(change: fn(&mut Object)) -> Box<Said> {
    Box::new(Said::Update(change))
}

pub(super) fn instant(change: fn(&mut Object)) -> Box<Said> {
    Box::new(Said::Instant(change))
}

pub(super) fn node(change: fn(&mut Object)) -> Box<Said> {
    Box::new(Said::Node(change))
}

pub(super) fn position(change: fn(&mut Object)) -> Box<Said> {
    Box::new(Said::Position(change))
}

pub(super) fn edge(change: fn(&mut Object)) -> Box<Said> {
    Box::new(Said::Edge(change))
}

pub(super) fn action(change: fn(&str, &mut Object)) -> Box<Said> {
    Box::new(Said::Action(change))
}

pub(super) fn parameter(change: fn(&str, &mut Object)) -> Box<Said> {
    Box::new(Said::Parameter(change))
}

/// Changes each action of this type that is made.
pub(super) fn made(change: fn(&Site, &Vehicle, &str, &mut Object)) -> Box<Hooks<()>> {
    keep().made_by(change)
}

/// How an order message came about.
pub(super) struct Worded<'a> {
    pub(super) running: &'a Running,
    pub(super) window: Window,
    /// The way is longer than the vehicle takes in one message.
    pub(super) cut: bool,
}

impl Worded<'_> {
    pub(super) fn is_update(&self) -> bool {
        self.window.first > 0
    }

    /// Changes each node, knowing its place in the whole way.
    pub(super) fn nodes(&self, message: &mut Object, mut change: impl FnMut(usize, &Stop, &mut Object)) {
        let mut index = self.window.first;
        message.each("nodes", |node| {
            if let Some(stop) = self.running.stops.get(index) {
                change(index, stop, node);
            }
            index += 1;
        });
    }

    /// The same for edges: the place is that of the node before.
    pub(super) fn edges(&self, message: &mut Object, mut change: impl FnMut(usize, &Leg, &mut Object)) {
        let mut index = self.window.first;
        message.each("edges", |edge| {
            if let Some(leg) = self.running.legs.get(index) {
                change(index, leg, edge);
            }
            index += 1;
        });
    }
}

/// A deviation with a memory of its own for each vehicle, or one for the fleet.
pub(super) struct Hooks<M> {
    memories: BTreeMap<String, M>,
    shared: bool,
    configures: Option<fn(&mut MasterControlConfig)>,
    joins: Option<fn(&Site, &[Vehicle], &mut ConnectOptions)>,
    retries: Option<fn(&Site, Option<Duration>) -> Option<Duration>>,
    asked: Option<fn(&mut M, &mut Site, &mut Vehicle, &str, &Value) -> bool>,
    hears: Option<fn(&mut M, &mut Site, &mut Vehicle, &mut Heard<'_>) -> bool>,
    lasts: Option<fn(&M, &Site, &Vehicle, Span, Duration) -> Duration>,
    pose: Option<fn(&mut M, &Site, &Vehicle, &mut Pose, &Transport)>,
    route: Option<fn(&mut M, &Site, &Vehicle, &str, &str, &mut BTreeSet<(String, String)>)>,
    way: Option<fn(&mut M, &mut Site, &mut Vehicle, &mut Way, &Transport, bool)>,
    window: Option<fn(&mut M, &Site, &Vehicle, &Running, &mut Window, usize)>,
    judges: Option<fn(&mut M, &mut Site, &mut Vehicle, &mut Running, &State, Fate) -> Fate>,
    happens: Option<fn(&mut M, &mut Site, &mut Vehicle, &mut Event<'_>)>,
    allows: Option<fn(&M, &Site, &Vehicle, Permission<'_>, bool) -> bool>,
    measures: Option<fn(&M, &Site, &Vehicle, Measure<'_>, usize) -> usize>,
    id: Option<fn(&mut M, &Site, &Vehicle, &str, &mut String)>,
    action: Option<fn(&mut M, &Site, &Vehicle, &mut Object, &Value, bool)>,
    made: Option<fn(&Site, &Vehicle, &str, &mut Object)>,
    field: Option<fn(&M, &Vehicle, &Field<'_>, &mut Option<Value>)>,
    words: Option<fn(&mut M, &Site, &Vehicle, &Worded<'_>, &mut Object)>,
    sends: Option<fn(&mut M, &mut Site, &mut Vehicle, &mut Outgoing) -> bool>,
    writes: Option<fn(&str, &Value, &mut Vec<u8>)>,
}

/// One that remembers something of each vehicle.
pub(super) fn keep<M: Default + Send>() -> Box<Hooks<M>> {
    Box::new(Hooks {
        memories: BTreeMap::new(),
        shared: false,
        configures: None,
        joins: None,
        retries: None,
        asked: None,
        hears: None,
        lasts: None,
        pose: None,
        route: None,
        way: None,
        window: None,
        judges: None,
        happens: None,
        allows: None,
        measures: None,
        id: None,
        action: None,
        made: None,
        field: None,
        words: None,
        sends: None,
        writes: None,
    })
}

/// One that remembers something of the whole fleet.
pub(super) fn fleet<M: Default + Send>() -> Box<Hooks<M>> {
    let mut hooks = keep();
    hooks.shared = true;
    hooks
}

/// One that remembers nothing.
pub(super) fn plain() -> Box<Hooks<()>> {
    keep()
}

macro_rules! setters {
    ($($name:ident: $type:ty,)+) => {
        $(pub(super) fn $name(mut self: Box<Self>, hook: $type) -> Box<Self> {
            self.$name = Some(hook);
            self
        })+
    };
}

impl<M: Default + Send> Hooks<M> {
    setters! {
        configures: fn(&mut MasterControlConfig),
        joins: fn(&Site, &[Vehicle], &mut ConnectOptions),
        retries: fn(&Site, Option<Duration>) -> Option<Duration>,
        asked: fn(&mut M, &mut Site, &mut Vehicle, &str, &Value) -> bool,
        hears: fn(&mut M, &mut Site, &mut Vehicle, &mut Heard<'_>) -> bool,
        lasts: fn(&M, &Site, &Vehicle, Span, Duration) -> Duration,
        pose: fn(&mut M, &Site, &Vehicle, &mut Pose, &Transport),
        route: fn(&mut M, &Site, &Vehicle, &str, &str, &mut BTreeSet<(String, String)>),
        way: fn(&mut M, &mut Site, &mut Vehicle, &mut Way, &Transport, bool),
        window: fn(&mut M, &Site, &Vehicle, &Running, &mut Window, usize),
        judges: fn(&mut M, &mut Site, &mut Vehicle, &mut Running, &State, Fate) -> Fate,
        happens: fn(&mut M, &mut Site, &mut Vehicle, &mut Event<'_>),
        allows: fn(&M, &Site, &Vehicle, Permission<'_>, bool) -> bool,
        measures: fn(&M, &Site, &Vehicle, Measure<'_>, usize) -> usize,
        id: fn(&mut M, &Site, &Vehicle, &str, &mut String),
        action: fn(&mut M, &Site, &Vehicle, &mut Object, &Value, bool),
        field: fn(&M, &Vehicle, &Field<'_>, &mut Option<Value>),
        words: fn(&mut M, &Site, &Vehicle, &Worded<'_>, &mut Object),
        sends: fn(&mut M, &mut Site, &mut Vehicle, &mut Outgoing) -> bool,
        writes: fn(&str, &Value, &mut Vec<u8>),
    }

    fn made_by(mut self: Box<Self>, hook: fn(&Site, &Vehicle, &str, &mut Object)) -> Box<Self> {
        self.made = Some(hook);
        self
    }

    fn memory(&mut self, vehicle: &Vehicle) -> &mut M {
        let name = if self.shared { "" } else { &vehicle.config.serial_number };
        self.memories.entry(name.to_owned()).or_default()
    }

    fn known<T>(&self, vehicle: &Vehicle, with: impl FnOnce(&M) -> T) -> T {
        let name = if self.shared { "" } else { &vehicle.config.serial_number };
        match self.memories.get(name) {
            Some(memory) => with(memory),
            None => with(&M::default()),
        }
    }
}

impl<M: Default + Send> Deviation for Hooks<M> {
    fn configures(&mut self, config: &mut MasterControlConfig) {
        if let Some(configure) = self.configures {
            configure(config);
        }
    }

    fn joins(&mut self, site: &Site, fleet: &[Vehicle], joining: &mut Joining) {
        if let Some(join) = self.joins {
            join(site, fleet, &mut joining.options);
        }
        if let Some(retry) = self.retries {
            joining.retry = retry(site, joining.retry);
        }
    }

    fn asked(
        &mut self,
        site: &mut Site,
        fleet: &mut [Vehicle],
        index: Option<usize>,
        command: &str,
        arguments: &Value,
    ) -> bool {
        match (self.asked, index.and_then(|index| fleet.get_mut(index))) {
            (Some(answer), Some(vehicle)) => answer(self.memory(vehicle), site, vehicle, command, arguments),
            _ => true,
        }
    }

    fn hears(&mut self, site: &mut Site, vehicle: &mut Vehicle, heard: &mut Heard<'_>) -> bool {
        let Some(hear) = self.hears else { return true };
        hear(self.memory(vehicle), site, vehicle, heard)
    }

    fn lasts(&self, site: &Site, vehicle: &Vehicle, what: Span, usual: Duration) -> Duration {
        let Some(last) = self.lasts else { return usual };
        self.known(vehicle, |memory| last(memory, site, vehicle, what, usual))
    }

    fn plans(&mut self, site: &mut Site, vehicle: &mut Vehicle, plan: &mut Plan<'_>) {
        match plan {
            Plan::Pose(pose, transport) => {
                if let Some(change) = self.pose {
                    change(self.memory(vehicle), site, vehicle, pose, transport);
                }
            }
            Plan::Route(from, to, closed) => {
                if let Some(change) = self.route {
                    change(self.memory(vehicle), site, vehicle, from, to, closed);
                }
            }
            Plan::Way(way, transport, fresh) => {
                if let Some(change) = self.way {
                    change(self.memory(vehicle), site, vehicle, way, transport, *fresh);
                }
            }
            Plan::Window(running, window, free) => {
                if let Some(change) = self.window {
                    change(self.memory(vehicle), site, vehicle, running, window, *free);
                }
            }
        }
    }

    fn judges(
        &mut self,
        site: &mut Site,
        vehicle: &mut Vehicle,
        running: &mut Running,
        state: &State,
        fate: Fate,
    ) -> Fate {
        let Some(judge) = self.judges else { return fate };
        judge(self.memory(vehicle), site, vehicle, running, state, fate)
    }

    fn happens(&mut self, site: &mut Site, vehicle: &mut Vehicle, event: &mut Event<'_>) {
        if let Some(happen) = self.happens {
            happen(self.memory(vehicle), site, vehicle, event);
        }
    }

    fn allows(&self, site: &Site, vehicle: &Vehicle, what: Permission<'_>, usual: bool) -> bool {
        let Some(allow) = self.allows else { return usual };
        self.known(vehicle, |memory| allow(memory, site, vehicle, what, usual))
    }

    fn measures(&self, site: &Site, vehicle: &Vehicle, what: Measure<'_>, usual: usize) -> usize {
        let Some(measure) = self.measures else { return usual };
        self.known(vehicle, |memory| measure(memory, site, vehicle, what, usual))
    }

    fn makes(&mut self, site: &Site, vehicle: &Vehicle, made: &mut Made<'_>) {
        match made {
            Made::Id(what, id) => {
                if let Some(name) = self.id {
                    name(self.memory(vehicle), site, vehicle, what, id);
                }
            }
            Made::Action(Value::Object(action), given, instant) => {
                if let Some(change) = self.action {
                    change(self.memory(vehicle), site, vehicle, action, given, *instant);
                }
                if let Some(change) = self.made {
                    let kind = action.text("actionType").to_owned();
                    change(site, vehicle, &kind, action);
                }
            }
            Made::Field(field, value) => {
                if let Some(change) = self.field {
                    self.known(vehicle, |memory| change(memory, vehicle, field, value));
                }
            }
            Made::Order(running, window, cut, Value::Object(message)) => {
                if let Some(change) = self.words {
                    let worded = Worded {
                        running,
                        window: *window,
                        cut: *cut,
                    };
                    change(self.memory(vehicle), site, vehicle, &worded, message);
                }
            }
            _ => {}
        }
    }

    fn publishes(&mut self, site: &mut Site, vehicle: &mut Vehicle, outgoing: &mut Outgoing) -> bool {
        let Some(send) = self.sends else { return true };
        send(self.memory(vehicle), site, vehicle, outgoing)
    }

    fn writes(&self, name: &str, message: &Value, text: &mut Vec<u8>) {
        if let Some(write) = self.writes {
            write(name, message, text);
        }
    }
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
pub(super) fn describing() -> Box<Hooks<()>> {
    plain().field(|(), _, field, value| describe(field, value))
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
