//! The reference master control: a small fleet manager as a sans-IO state machine.
//!
//! Written from the standard. The parts, by idea: `hearing` takes what the vehicles say into the picture of `vehicle`,
//! read by `seen`; `dispatch` plans transports over the `layout`, `order` words their messages, `driving` extends
//! the base, sends again what was lost and sees the end, `cancel` calls orders off; `instant` sends instant actions,
//! made in `actions`, and `maps` rolls maps out; `commands` is what people ask for; `publish` and `wording` speak to
//! the broker; `habits` holds what some do besides. Every deviation from good behaviour is declared in `faults`, every
//! liberty in `tolerances`.

#[macro_use]
mod blind_faults;
mod actions;
mod cancel;
mod commands;
mod config;
mod connecting;
mod dispatch;
mod driving;
pub mod faults;
mod habits;
mod hearing;
mod instant;
pub mod lapses;
mod layout;
mod maps;
mod odd;
mod order;
mod publish;
mod repeating;
mod rerouting;
mod seen;
mod sixth;
mod slips;
#[cfg(test)]
mod tests;
pub mod tolerances;
mod vehicle;
mod ways;
mod wording;
mod wording_of_actions;

use std::collections::{BTreeMap, VecDeque};

use crate::clock::{Moment, Stamp};
use crate::reference::{ConnectOptions, Device, Input, Output};

pub use commands::COMMANDS;
pub use config::{MasterControlConfig, SiteEdge, SiteMap, SiteNode, VehicleConfig};
pub use faults::{BLIND_FAULTS, FAULTS, FaultName, find};
pub use lapses::{LAPSES, lapse};
pub use tolerances::{BLIND_TOLERANCES, TOLERANCES, ToleranceName};

use connecting::Connection;
use faults::Faults;
use vehicle::Vehicle;

/// More messages than this do not lie about unread.
const MAX_INBOX: usize = 10_000;

/// A fault that is not in [`FAULTS`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reference master control has no fault `{0}`")]
pub struct UnknownFault(pub String);

/// What all vehicles share.
#[derive(Clone, Debug)]
struct Site {
    config: MasterControlConfig,
    faults: Faults,
    /// The time of what is happening.
    now: Stamp,
    online: bool,
    /// Tells the ids of one session from those of another; 0 until the first input.
    session: u64,
    /// It has ended because of what a vehicle said (`dies-of-…`).
    dead: bool,
    /// Counts ids.
    ids: u64,
    /// What was decided and is still to be handed to the driver.
    pending: Vec<Output>,
    /// Whether the order published now is one that was lost.
    r1_resending: bool,
    /// headerId by topic name for the whole fleet (`r1-header-id-counts-fleet`).
    r1_fleet_ids: BTreeMap<&'static str, u32>,
    /// Counts actionIds since the last connection (`r1-action-ids-restart-on-reconnect`).
    r1_actions: u64,
    /// How often the connection was lost.
    r1_losses: u32,
    /// The order topic of the vehicle that was given an order last (`r3-update-to-vehicle-served-last`).
    r3_last_topic: Option<String>,
    /// The serial number of the vehicle addressed last (`r4-header-of-the-other-vehicle-in-updates`).
    r4_addressed: Option<String>,
    /// Counts orders since the last connection (`r4-order-ids-from-the-start-after-reconnect`).
    r4_orders: u64,
    /// The vehicle whose factsheet came first, and that factsheet (`r4-optional-fields-by-the-first-factsheet`).
    r4_first_sheet: Option<(usize, seen::Factsheet)>,
    /// When the next heartbeat is due (`r4-heartbeat-outside-the-protocol`).
    r4_beat_at: Option<Moment>,
    /// The serial number of the vehicle that got the last order (`r5-header-of-other-vehicle`).
    r5_ordered: Option<String>,
    /// What a forgetful master control keeps of its fleet.
    slips: slips::FleetSlips,
}

impl Site {
    fn takes(&self, tolerance: ToleranceName) -> bool {
        self.config.tolerances.has(tolerance)
    }

    /// An id no other order or action of this session, or an earlier one, has.
    fn next_id(&mut self, vehicle: &Vehicle, what: &str) -> String {
        self.ids += 1;
        if self.faults.has(FaultName::ActionIdsRepeat) && what == "action" {
            return (self.ids % 3).to_string();
        }
        if self.faults.has(FaultName::OrderIdWithSpace) && what == "order" {
            return format!("Order {}-{}", self.session, self.ids);
        }
        if self.faults.has(FaultName::R3OrderIdOfTheMinute) && what == "order" {
            return self.now.utc.as_second().div_euclid(60).to_string();
        }
        if self.faults.has(FaultName::R6OrderIdWithBlankAndSlash) && what == "order" {
            return format!("Transport {}/{}", self.session, self.ids);
        }
        if self.faults.has(FaultName::IdLimitIgnored) {
            return format!("{what}-{}-{:064}", self.session, self.ids);
        }
        let mut count = self.ids;
        let restarts = self.faults.has(FaultName::R1ActionIdsRestartOnReconnect)
            || self.faults.has(FaultName::R5ActionIdsRestartAfterReconnect);
        if restarts && what == "action" {
            self.r1_actions += 1;
            count = self.r1_actions;
        }
        if self.faults.has(FaultName::InstantsCountedApart) && what == "action" {
            count = self.number_apart();
        }
        if self.faults.has(FaultName::R4OrderIdsFromTheStartAfterReconnect) && what == "order" {
            self.r4_orders += 1;
            count = self.r4_orders;
        }
        let number = format!("{}{count:05}", self.session);
        let sheet = vehicle.factsheet.as_ref();
        let numerical =
            sheet.is_some_and(|sheet| sheet.ids_numerical) && !self.faults.has(FaultName::NumericalIdsIgnored);
        let lettered = what == "action" && self.faults.has(FaultName::R6NumericalIdsForOrdersOnly);
        let numerical = numerical && !lettered;
        let heedless = what == "action" && self.faults.has(FaultName::R2ActionIdLimitIgnored);
        let longest = sheet
            .and_then(|sheet| sheet.id_length)
            .filter(|_| !heedless)
            .unwrap_or(usize::MAX);
        let full = match () {
            () if what == "action" && self.faults.has(FaultName::R2ActionIdInBraces) => format!("{{{what}-{number}}}"),
            // Where the clock begins at 0 an id is short anyway.
            () if heedless => format!("{what}-{number:0>15}"),
            () if self.takes(ToleranceName::R2PlainNumberIds) => number.clone(),
            () if self.takes(ToleranceName::R1UuidIds) => {
                let kind = match what {
                    "order" => 1,
                    "action" => 2,
                    "place" => 3,
                    _ => 4,
                };
                let (high, low) = (self.session >> 16 & 0xffff_ffff, self.session & 0xffff);
                format!("{high:08x}-{low:04x}-4a{kind:02x}-9c3e-{count:012x}")
            }
            () if self.takes(ToleranceName::R1IdsWithPunctuation) => format!("{what}:{number}_a.-"),
            () => format!("{what}-{number}"),
        };
        let cuts = what == "action" && self.faults.has(FaultName::R5ActionIdsCutToIdLength);
        match () {
            () if cuts => if numerical { number } else { full }.chars().take(longest).collect(),
            () if !numerical && full.len() <= longest => full,
            () if number.len() <= longest => number,
            () => count.to_string(),
        }
    }
}

/// The reference master control.
#[derive(Clone, Debug)]
pub struct MasterControl {
    site: Site,
    fleet: Vec<Vehicle>,
    /// Vehicle and topic name by full topic.
    by_topic: BTreeMap<String, (usize, &'static str)>,
    connection: Connection,
    /// What has come and was not looked at yet, and when it will be.
    inbox: VecDeque<(Moment, Input)>,
}

/// What a master control listens to.
const HEARD: [&str; 4] = ["state", "connection", "factsheet", "visualization"];

impl MasterControl {
    /// A master control with some of [`FAULTS`], by name; without any it is faultless.
    ///
    /// It asks for its connection at the first [`Input::Time`] (a driver may also connect it unasked).
    ///
    /// # Errors
    /// When there is no fault of a name.
    pub fn new(config: MasterControlConfig, faults: &[&str]) -> Result<Self, UnknownFault> {
        let faults = Faults::named(faults).map_err(UnknownFault)?;
        let served = if faults.has(FaultName::FleetOfOne) {
            1
        } else {
            usize::MAX
        };
        let fleet: Vec<Vehicle> = config
            .vehicles
            .iter()
            .take(served)
            .map(|vehicle| Vehicle {
                config: vehicle.clone(),
                ..Vehicle::default()
            })
            .collect();
        let mut by_topic = BTreeMap::new();
        for (index, vehicle) in fleet.iter().enumerate() {
            for name in HEARD {
                if let Some(topic) = vehicle.topic(name) {
                    by_topic.insert(topic.to_owned(), (index, name));
                }
            }
        }
        Ok(Self {
            site: Site {
                config,
                faults,
                now: Stamp {
                    moment: Moment::START,
                    utc: jiff::Timestamp::UNIX_EPOCH,
                },
                online: false,
                session: 0,
                dead: false,
                ids: 0,
                pending: Vec::new(),
                r1_resending: false,
                r1_fleet_ids: BTreeMap::new(),
                r1_actions: 0,
                r1_losses: 0,
                r3_last_topic: None,
                r4_addressed: None,
                r4_orders: 0,
                r4_first_sheet: None,
                r4_beat_at: None,
                r5_ordered: None,
                slips: slips::FleetSlips::default(),
            },
            fleet,
            by_topic,
            connection: Connection::new(),
            inbox: VecDeque::new(),
        })
    }

    fn advance(&mut self, now: Stamp) {
        if now.moment >= self.site.now.moment {
            self.site.now = now;
        }
        if self.site.session == 0 {
            self.site.session = u64::try_from(now.utc.as_second()).unwrap_or(1).max(1);
        }
    }

    /// Does everything that is due now.
    fn step(&mut self) {
        let now = self.site.now.moment;
        while self.inbox.front().is_some_and(|(due, _)| *due <= now) {
            match self.inbox.pop_front() {
                Some((_, Input::Message { topic, payload })) => self.message(&topic, &payload),
                Some((_, Input::Command(name, arguments))) => self.command(&name, &arguments),
                _ => {}
            }
        }
        self.attempt_connection();
        for vehicle in &mut self.fleet {
            if vehicle.wake.is_some_and(|wake| wake <= now) {
                vehicle.wake = None;
                self.site.look_after(vehicle);
            }
        }
    }
}

impl Site {
    /// Looks what is to be done for a vehicle, and does it.
    fn look_after(&mut self, vehicle: &mut Vehicle) {
        if !self.online {
            return;
        }
        self.r4_beat(vehicle);
        self.r4_call_off(vehicle);
        self.r5_declare_silent(vehicle);
        self.r5_repeat(vehicle);
        self.r6_send_late(vehicle);
        self.miss_factsheet(vehicle);
        self.watch_instants(vehicle);
        self.watch_maps(vehicle);
        cancel::watch_cancel(vehicle, self.faults);
        if vehicle.cancel.is_none() && std::mem::take(&mut vehicle.r2_resume) {
            self.instant(vehicle, "stopPause", &serde_json::Value::Null);
        }
        self.r3_watch(vehicle);
        self.watch_order(vehicle);
        self.repeat_for_ever(vehicle);
        self.ask_when_quiet(vehicle);
        self.preload_maps(vehicle);
        self.begin_next(vehicle);
        self.send_instants(vehicle);
        let now = self.now.moment;
        if vehicle.wake.is_some_and(|wake| wake <= now) {
            // Never at once again: what is to be done next needs an input or time.
            vehicle.wake = Some(now + std::time::Duration::from_millis(1));
        }
    }
}

impl Device for MasterControl {
    fn connect_options(&mut self, now: Stamp) -> ConnectOptions {
        self.options(now)
    }

    fn handle(&mut self, now: Stamp, input: Input, out: &mut Vec<Output>) {
        self.advance(now);
        match input {
            Input::Connected => self.connected(),
            Input::ConnectionLost => self.connection_lost(),
            Input::Message { .. } | Input::Command(..) => {
                if self.inbox.len() < MAX_INBOX {
                    let due = now.moment + self.site.config.answers_after;
                    self.inbox.push_back((due, input));
                }
            }
            Input::Time | Input::Download { .. } => {}
        }
        self.step();
        out.append(&mut self.site.pending);
    }

    fn wake_up(&self) -> Option<Moment> {
        let vehicles = self.fleet.iter().filter_map(|vehicle| vehicle.wake);
        let vehicles = vehicles.min().filter(|_| self.site.online);
        let inbox = self.inbox.front().map(|(due, _)| *due);
        let attempt = self.connection.attempt_at.filter(|_| !self.connection.online);
        vehicles.into_iter().chain(inbox).chain(attempt).min()
    }
}
