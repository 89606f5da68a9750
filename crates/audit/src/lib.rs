//! Traffic nobody scripted, judged by the monitors: recordings of a site.
//!
//! [`Audit`] is shown message after message and finds vehicles by their topics. Each vehicle, and the master control
//! that commands it, is judged by itself, by the protocol version its messages name. What a recording cannot show is
//! not judged: it may begin in the middle, lack messages, hold them twice, or hold what was retained yesterday. [`scope`]
//! says which monitor is used how, [`continuity`] finds the holes, and [`dedup`] puts messages back into their order.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod arrived;
pub mod baseline;
pub mod bundle;
mod cases;
mod continuity;
mod conversation;
mod courses;
mod covered;
mod cut;
mod dedup;
pub mod export;
mod finding_group;
mod header;
mod hint;
pub mod join;
mod message_check;
pub mod migrate;
mod misnamed;
pub mod mistakes;
mod mqtt_sessions;
mod new_findings;
mod outcome;
mod own_run;
pub mod page;
pub mod pool;
mod redact;
pub mod result;
pub mod saved;
mod side;
pub mod slice;
mod span;
mod stretched;
pub mod time_line;
pub mod time_stretch;
mod topics;
mod turns;
mod vehicle;

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use tck_base::shard::{Shard, dealt};
use tck_capture::{Message, SourcePosition, Told, Wire, WireEvent};
use tck_journal::event::Packet;
use tck_judge::Rules;
use tck_suite::model::Monitor;
use tck_view::Topic;

use cut::{Cutter, Place};
pub use hint::{Hint, Hints};
pub use message_check::{Flaw, single};
use misnamed::Misnamed;
use mqtt_sessions::{MqttSessions, Publisher};
pub use new_findings::{Address, Found};
pub use own_run::{OwnRunError, own_run};
pub use redact::Redactor;
use result::{AuditResult, RESULT_FORMAT, Recording, VehicleResult, Whence};
use topics::{Beside, Named, Topics};
use vehicle::Vehicle;

/// How many vehicles are judged; messages of further ones are counted.
const VEHICLES: usize = 10_000;

/// What is judged.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How topics are built, where a site has renamed them.
    pub topic_template: Option<String>,
    /// Only these vehicles: serial number, or manufacturer and serial number with a slash between.
    pub vehicles: Vec<String>,
    /// Only monitors of these names, or that decide these requirements; a `*` at the end stands for anything.
    pub only: Vec<String>,
    /// The protocol version all are judged by, whatever their messages say.
    pub protocol: Option<String>,
    /// Only this part of the vehicles, or of the stretches of time into which they are cut, where several processes share them.
    pub shard: Option<Shard>,
    /// How long the stretches are at least into which each vehicle is cut where it is at rest; not at all unless said.
    pub cut: Option<Duration>,
}

impl Options {
    fn wants_vehicle(&self, manufacturer: &str, serial_number: &str) -> bool {
        let named = |wanted: &String| {
            wanted == serial_number
                || wanted
                    .split_once('/')
                    .is_some_and(|(one, other)| (one, other) == (manufacturer, serial_number))
        };
        self.vehicles.is_empty() || self.vehicles.iter().any(named)
    }

    /// Whether a vehicle belongs to the part that is judged here. A recording does not say beforehand which vehicles it holds, so
    /// that they are dealt out by their names. Where time is cut, every part has stretches of each.
    #[must_use]
    pub fn does(&self, manufacturer: &str, serial_number: &str) -> bool {
        let dealt = |shard| dealt(&format!("{manufacturer}/{serial_number}"), shard);
        self.cut.is_some() || self.shard.is_none_or(dealt)
    }

    /// Whether a stretch of time of a vehicle belongs to the part that is judged here.
    fn does_stretch(&self, vehicle: &Named, place: &Place) -> bool {
        let Named {
            manufacturer,
            serial_number,
            ..
        } = vehicle;
        let dealt = |shard| {
            dealt(
                &format!("{manufacturer}/{serial_number}/{}", place.stretch.number),
                shard,
            )
        };
        self.shard.is_none_or(dealt)
    }

    /// Whether this monitor is to judge.
    #[must_use]
    pub fn wants_monitor(&self, monitor: &Monitor) -> bool {
        let fits = |wanted: &str, name: &str| match wanted.strip_suffix('*') {
            Some(begin) => name.starts_with(begin),
            None => name == wanted,
        };
        let named = |wanted: &String| {
            let mut checks = monitor.checks.iter();
            fits(wanted, &monitor.id) || checks.any(|binding| fits(wanted, binding.requirement.as_str()))
        };
        self.only.is_empty() || self.only.iter().any(named)
    }
}

/// Why nothing can be audited.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum AuditError {
    /// The template does not name the topic.
    #[error("the topic template `{0}` has no {{topic}} and no {{serialNumber}}: vehicles cannot be told apart")]
    Template(String),
    /// No monitor is left.
    #[error("no monitor is called `{0}`, and none decides a requirement of that name")]
    NoMonitor(String),
    /// Connections go on over a cut in time.
    #[error("a recording of packets is not cut in time: its connections are judged as they are, from their beginning")]
    Packets,
    /// There are no rules for the version.
    #[error("version {version} is not known to this program ({known})")]
    Protocol {
        /// What was asked for.
        version: String,
        /// Those that are known.
        known: String,
    },
}

/// Whether a topic of this name is the master control's.
fn is_command(name: &str) -> bool {
    Topic::of_name(name).is_to_vehicle()
}

/// What all vehicles share.
struct Shared<'r> {
    rules: &'r Rules,
    options: Options,
    places: Whence,
    hints: OnceLock<Hints>,
    live: bool,
}

impl Shared<'_> {
    fn context(&self) -> AuditContext<'_> {
        AuditContext {
            rules: self.rules,
            options: &self.options,
            places: &self.places,
            hints: &self.hints,
            live: self.live,
        }
    }
}

/// What all vehicles share, for one of them.
#[derive(Clone, Copy)]
struct AuditContext<'a> {
    rules: &'a Rules,
    options: &'a Options,
    places: &'a Whence,
    /// Names to compare those in messages with, once one is looked at.
    hints: &'a OnceLock<Hints>,
    /// Whether each finding is told at once.
    live: bool,
}

/// Judges traffic nobody scripted by the monitors, message after message.
pub struct Audit<'r> {
    shared: Shared<'r>,
    topics: Topics,
    vehicles: BTreeMap<String, Vehicle>,
    /// Cuts the time of each vehicle, where that is asked for.
    cutter: Option<Cutter>,
    /// What came out of stretches that are over.
    ended: Vec<VehicleResult>,
    wires: MqttSessions,
    messages: u64,
    elsewhere: u64,
    beyond: u64,
    /// Messages of vehicles that another part judges.
    others: u64,
    misnamed: Misnamed,
    news: Vec<Found>,
    first: Option<jiff::Timestamp>,
    last: Option<jiff::Timestamp>,
}

impl<'r> Audit<'r> {
    /// Begins.
    ///
    /// # Errors
    /// What is wrong with the options.
    pub fn new(rules: &'r Rules, options: Options) -> Result<Self, AuditError> {
        for wanted in &options.only {
            let alone = Options {
                only: vec![wanted.clone()],
                ..Options::default()
            };
            let monitors = &rules.suites.monitors;
            if !monitors.iter().any(|monitor| alone.wants_monitor(monitor)) {
                return Err(AuditError::NoMonitor(wanted.clone()));
            }
        }
        if let Some(version) = options
            .protocol
            .as_ref()
            .filter(|version| rules.packs.get(version).is_none())
        {
            let known = rules.packs.all().iter().map(|pack| pack.version.to_string());
            return Err(AuditError::Protocol {
                version: version.clone(),
                known: known.collect::<Vec<_>>().join(", "),
            });
        }
        Ok(Self {
            topics: Topics::new(&rules.packs, options.topic_template.as_deref())?,
            cutter: options.cut.map(Cutter::new),
            ended: Vec::new(),
            shared: Shared {
                rules,
                options,
                places: Whence::default(),
                hints: OnceLock::new(),
                live: false,
            },
            vehicles: BTreeMap::new(),
            wires: MqttSessions::default(),
            messages: 0,
            elsewhere: 0,
            beyond: 0,
            others: 0,
            misnamed: Misnamed::default(),
            news: Vec::new(),
            first: None,
            last: None,
        })
    }

    /// From now on what is found is told at once, see [`Audit::news`].
    #[must_use]
    pub fn live(mut self) -> Self {
        self.shared.live = true;
        self
    }

    /// What was found since this was asked last; nothing unless it is [`Audit::live`].
    pub fn news(&mut self) -> Vec<Found> {
        std::mem::take(&mut self.news)
    }

    /// How many messages it was shown.
    #[must_use]
    pub fn messages(&self) -> u64 {
        self.messages
    }

    /// A topic of a vehicle that is wanted.
    fn wanted(&mut self, topic: &str) -> Option<Arc<Named>> {
        let named = self.topics.know(topic)?;
        let wanted = self
            .shared
            .options
            .wants_vehicle(&named.manufacturer, &named.serial_number);
        wanted.then_some(named)
    }

    /// Whose topic this is; `None` for one of no vehicle, or of one that is not wanted.
    #[must_use]
    pub fn address(&self, topic: &str) -> Option<Address> {
        let named = self.topics.read(topic)?;
        let wanted = self
            .shared
            .options
            .wants_vehicle(&named.manufacturer, &named.serial_number)
            && self.shared.options.does(&named.manufacturer, &named.serial_number);
        wanted.then_some(Address {
            vehicle: named.key,
            manufacturer: named.manufacturer,
            serial_number: named.serial_number,
            name: named.name,
        })
    }

    /// Shows it the next message.
    pub fn observe(&mut self, message: Message) {
        if message.after_gap {
            self.interrupted();
        }
        self.numbered(self.messages + 1, message);
    }

    /// Shows it the message of that number.
    fn numbered(&mut self, number: u64, message: Message) {
        self.messages = number;
        self.first = self.first.or(message.at);
        self.last = message.at.or(self.last);
        let Some(named) = self.topics.know(&message.topic) else {
            self.stray(number, &message);
            return;
        };
        if !self
            .shared
            .options
            .wants_vehicle(&named.manufacturer, &named.serial_number)
        {
            self.elsewhere += 1;
            return;
        }
        if !self.shared.options.does(&named.manufacturer, &named.serial_number) {
            self.others += 1;
            return;
        }
        let cutter = self.cutter.as_mut();
        let cut = cutter.map(|cutter| cutter.place(&named, number, &message, self.shared.rules));
        if let Some(place) = &cut {
            if place.begins {
                self.end_stretch(&named.key);
            }
            if !self.shared.options.does_stretch(&named, place) {
                self.others += 1;
                return;
            }
        }
        let place: SourcePosition = message.place;
        self.shared.places.note(self.messages, place);
        if !self.vehicles.contains_key(&named.key) {
            if self.vehicles.len() >= VEHICLES {
                self.beyond += 1;
                return;
            }
            let is_behind_a_cut = cut.as_ref().is_some_and(|place| place.begins);
            let stretch = cut.map(|place| place.stretch);
            let vehicle = Vehicle::new(&named, message.at.is_some(), stretch);
            self.vehicles.insert(named.key.clone(), vehicle);
            if is_behind_a_cut {
                self.show_stored(&named.key, message.at);
            }
        }
        if let Some(vehicle) = self.vehicles.get_mut(&named.key) {
            let scene = self.shared.context();
            let carried = message.carried;
            let counts = vehicle.observe(self.messages, &named.name, message, scene);
            if let Some(carried) = carried.filter(|_| counts) {
                self.wires.carried(carried, &named.key);
            }
            if self.shared.live {
                self.news.append(&mut vehicle.news());
            }
        }
    }

    /// The stretch of a vehicle is over.
    fn end_stretch(&mut self, key: &str) {
        let Some(vehicle) = self.vehicles.remove(key) else {
            return;
        };
        let scene = self.shared.context();
        let ended = vehicle.finish(scene);
        self.ended.extend(ended);
    }

    /// Shows the stretch of a vehicle that begins now what a broker has stored of it.
    fn show_stored(&mut self, key: &str, now: Option<jiff::Timestamp>) {
        let stored = self.cutter.iter().flat_map(|cutter| cutter.stored(key, now));
        let Some(vehicle) = self.vehicles.get_mut(key) else {
            return;
        };
        let scene = self.shared.context();
        for (number, name, message) in stored {
            vehicle.observe(number, &name, message, scene);
        }
    }

    /// Whether a topic is of a vehicle that is wanted, or meant to be.
    #[must_use]
    pub fn concerns(&self, topic: &str) -> bool {
        let beside = || {
            let beside = self.topics.beside(topic)?;
            Some(
                self.shared
                    .options
                    .wants_vehicle(&beside.manufacturer, &beside.serial_number),
            )
        };
        self.address(topic).is_some() || beside().unwrap_or_default()
    }

    /// A message on a topic of no vehicle.
    fn stray(&mut self, number: u64, message: &Message) {
        self.elsewhere += 1;
        // It belongs to no stretch, and each part would find it.
        if self.shared.options.cut.is_some() {
            return;
        }
        let wanted = |beside: &Beside| {
            let (maker, number) = (&beside.manufacturer, &beside.serial_number);
            self.shared.options.wants_vehicle(maker, number) && self.shared.options.does(maker, number)
        };
        if let Some(beside) = self.topics.beside(&message.topic).filter(wanted) {
            self.misnamed.note(&self.shared.rules.packs, number, beside, message);
        }
    }

    /// Shows it what is told next.
    pub fn take(&mut self, told: Told) {
        match told {
            Told::Message(message) => self.observe(message),
            Told::Wire(wire) => self.wire(wire),
        }
    }

    /// Shows it something of a connection.
    pub fn wire(&mut self, wire: Wire) {
        self.wire_at(self.messages + 1, wire, false);
    }

    /// Shows it something of a connection before the message of that number; `elsewhere` says that it is a message of a
    /// vehicle that another thread judges.
    fn wire_at(&mut self, number: u64, wire: Wire, elsewhere: bool) {
        let named = match &wire.event {
            WireEvent::Packet {
                packet: Packet::Publish { topic, .. },
                sent: true,
            } => self.topics.know(topic),
            _ => None,
        };
        let wanted = |named: &&Arc<Named>| {
            self.shared
                .options
                .wants_vehicle(&named.manufacturer, &named.serial_number)
        };
        let publisher = named.as_ref().filter(wanted).map(|named| Publisher {
            vehicle: named.key.clone(),
            topic: &named.name,
            elsewhere: elsewhere || !self.shared.options.does(&named.manufacturer, &named.serial_number),
        });
        let scene = self.shared.context();
        let missing = self.wires.take(wire, number, publisher, &mut self.vehicles, scene);
        for key in missing {
            if let Some(vehicle) = self.vehicles.get_mut(&key) {
                vehicle.interrupted(scene);
            }
        }
        if self.shared.live {
            for vehicle in self.vehicles.values_mut() {
                self.news.append(&mut vehicle.news());
            }
        }
    }

    /// Nothing was seen for a while: nobody knows what every vehicle did meanwhile.
    fn interrupted(&mut self) {
        let scene = self.shared.context();
        for vehicle in self.vehicles.values_mut() {
            vehicle.interrupted(scene);
            if self.shared.live {
                self.news.append(&mut vehicle.news());
            }
        }
    }

    /// The result; the recording is at its end.
    #[must_use]
    pub fn finish(mut self, recordings: Vec<Recording>) -> AuditResult {
        let scene = AuditContext {
            live: false,
            ..self.shared.context()
        };
        for vehicle in self.vehicles.values_mut() {
            vehicle.ready(scene);
        }
        self.wires.finish(&mut self.vehicles, scene);
        let last = self.vehicles.into_values().flat_map(|vehicle| vehicle.finish(scene));
        let mut vehicles: Vec<VehicleResult> = self.ended.into_iter().chain(last).collect();
        if self.shared.options.cut.is_some() {
            vehicles.sort_by(|one, other| one.in_order().cmp(&other.in_order()));
        }
        let mut result = AuditResult {
            format: RESULT_FORMAT.to_owned(),
            tool: tck_journal::tool(),
            verdict: None,
            recordings,
            messages: self.messages,
            first: self.first.map(|at| format!("{at:.3}")),
            last: self.last.map(|at| format!("{at:.3}")),
            elsewhere: self.elsewhere,
            beyond: self.beyond,
            others: self.others,
            shard: None,
            merged: None,
            master_control: None,
            vehicles,
        };
        self.misnamed.tell(&mut result, self.shared.rules, &self.shared.options);
        result.trace(&self.shared.rules.catalogue);
        result.conclude();
        result
    }
}

#[cfg(test)]
mod hole_tests;
#[cfg(test)]
mod mqtt_sessions_tests;
#[cfg(test)]
mod result_tests;
#[cfg(test)]
mod site_tests;
#[cfg(test)]
mod tests;
