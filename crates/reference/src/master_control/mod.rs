//! The reference master control: a small fleet manager as a sans-IO state machine.
//!
//! Follow an order: somebody asks for a transport (`commands`); when the vehicle is free and fit, `dispatch` begins it
//! over the way that `ways` has planned from where the vehicle stands; `order` words the message within the limits of
//! the factsheet, and `publish` sends it with its header (section 6.4). `hearing` takes what the vehicle says (6.5,
//! 6.10, 6.14, 6.15) into the picture of `vehicle`; `driving` sees from it that the order was accepted, extends the base
//! before the vehicle has to halt (6.6.2), sends again what was lost, and sees the end. `rerouting` changes the way that
//! is not released yet, `cancel` calls an order off and waits for the end of that (6.6.3). `instant` sends instant
//! actions (6.9), made in `actions` (6.8); `maps` rolls maps out (6.7). `zones` gives vehicles the zones of the floor, and
//! `requests` answers what they ask for there. `connecting` is its link to the broker.
//!
//! `hooks` is where it can be made to behave otherwise; this room knows nothing of how.

pub(crate) mod actions;
mod cancel;
pub(crate) mod commands;
pub(crate) mod config;
mod connecting;
pub(crate) mod dispatch;
pub(crate) mod driving;
mod hearing;
mod hook_points;
pub(crate) mod hooks;
pub(crate) mod instant;
pub(crate) mod layout;
pub(crate) mod maps;
pub(crate) mod order;
mod publish;
pub(crate) mod requests;
pub(crate) mod rerouting;
pub(crate) mod seen;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod vehicle;
pub(crate) mod ways;
pub(crate) mod zones;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use crate::{ConnectOptions, Device, Input, Output};
use tck_base::clock::{Moment, Stamp};

pub use commands::COMMANDS;
pub use config::{MasterControlConfig, SiteEdge, SiteMap, SiteNode, VehicleConfig};

use connecting::Connection;
use hooks::{Event, Hook, Measure, Permission, SwitchedOn};
use requests::Claims;
use vehicle::Vehicle;

/// More messages than this do not lie about unread.
const MAX_INBOX: usize = 10_000;

/// Everything that all vehicles share.
#[derive(Debug)]
pub(crate) struct Site {
    pub(crate) config: MasterControlConfig,
    hooks: SwitchedOn,
    /// The time of what is happening.
    pub(crate) now: Stamp,
    pub(crate) connection: Connection,
    /// Tells the ids of one session from those of another; 0 until the first input.
    pub(crate) session: u64,
    /// Counts ids.
    pub(crate) ids: u64,
    /// What the vehicles ask for.
    pub(crate) claims: Claims,
    /// The sets of zones there are, without header.
    pub(crate) zone_sets: Vec<serde_json::Value>,
    /// Outputs that are still to be handed to the driver.
    pub(crate) pending: Vec<Output>,
}

impl Site {
    /// An id no other order or action of this session, or an earlier one, has (ORD-MSG-02, ORD-MSG-17).
    pub(crate) fn next_id(&mut self, vehicle: &Vehicle, what: &str) -> String {
        self.ids += 1;
        let mut id = self.spelled(vehicle, what, self.ids);
        self.names(vehicle, what, &mut id);
        id
    }

    /// The id of a number, of letters and as long as the vehicle takes it (FACT-12).
    pub(crate) fn spelled(&self, vehicle: &Vehicle, what: &str, count: u64) -> String {
        let number = format!("{}{count:05}", self.session);
        self.fitting(vehicle, what, format!("{what}-{number}"), count)
    }

    /// This id, or the number of it where the vehicle does not take it.
    pub(crate) fn fitting(&self, vehicle: &Vehicle, what: &str, full: String, count: u64) -> String {
        let number = format!("{}{count:05}", self.session);
        let longest = self.longest_id(vehicle);
        if full.len() <= longest && self.takes_letters(vehicle, what) {
            full
        } else if number.len() <= longest {
            number
        } else {
            count.to_string()
        }
    }

    /// Largest number of characters of an id.
    pub(crate) fn longest_id(&self, vehicle: &Vehicle) -> usize {
        let limit = vehicle.factsheet.as_ref().and_then(|sheet| sheet.id_length);
        self.measures(vehicle, Measure::IdLength, limit.unwrap_or(usize::MAX))
    }

    /// Whether an id of a kind may have letters.
    pub(crate) fn takes_letters(&self, vehicle: &Vehicle, what: &str) -> bool {
        let numerical = vehicle.factsheet.as_ref().is_some_and(|sheet| sheet.ids_numerical);
        self.allows(vehicle, Permission::Letters(what), !numerical)
    }

    /// Looks what is to be done for a vehicle, and does it.
    fn look_after(&mut self, vehicle: &mut Vehicle) {
        if !self.connection.online {
            return;
        }
        self.happens(vehicle, &mut Event::Looked);
        self.miss_factsheet(vehicle);
        self.watch_instants(vehicle);
        self.watch_lists(vehicle);
        self.watch_sleep(vehicle);
        self.watch_maps(vehicle);
        self.watch_zones(vehicle);
        self.watch_cancel(vehicle);
        self.watch_order(vehicle);
        self.begin_next(vehicle);
        self.watch_requests(vehicle);
        self.send_instants(vehicle);
        let now = self.now.moment;
        if vehicle.wake.is_some_and(|wake| wake <= now) {
            // Never at once again: what is to be done next needs an input or time.
            vehicle.wake = Some(now + Duration::from_millis(1));
        }
    }
}

/// The reference master control.
#[derive(Debug)]
pub struct MasterControl {
    site: Site,
    fleet: Vec<Vehicle>,
    /// Vehicle and topic name by full topic.
    by_topic: BTreeMap<String, (usize, &'static str)>,
    /// What has come and was not looked at yet, and when it will be.
    inbox: VecDeque<(Moment, Input)>,
}

/// What a master control listens to.
const HEARD: [&str; 4] = ["state", "connection", "factsheet", "visualization"];

impl MasterControl {
    /// A master control that keeps to the standard.
    ///
    /// It asks for its connection at the first [`Input::Time`] (a driver may also connect it unasked).
    #[must_use]
    pub fn new(config: MasterControlConfig) -> Self {
        Self::with(config, Vec::new())
    }

    /// A master control that behaves otherwise at its hook points.
    pub(crate) fn with(config: MasterControlConfig, hooks: Vec<Hook>) -> Self {
        let mut site = Site {
            config,
            hooks: SwitchedOn::default(),
            now: Stamp {
                moment: Moment::START,
                utc: jiff::Timestamp::UNIX_EPOCH,
            },
            connection: Connection::default(),
            session: 0,
            ids: 0,
            claims: Claims::default(),
            zone_sets: Vec::new(),
            pending: Vec::new(),
        };
        for hook in hooks {
            site.switch_on(hook);
        }
        let fleet: Vec<Vehicle> = site.config.vehicles.iter().cloned().map(Vehicle::from).collect();
        let mut by_topic = BTreeMap::new();
        for (index, vehicle) in fleet.iter().enumerate() {
            for name in HEARD {
                if let Some(topic) = vehicle.topic(name) {
                    by_topic.insert(topic.to_owned(), (index, name));
                }
            }
        }
        Self {
            site,
            fleet,
            by_topic,
            inbox: VecDeque::new(),
        }
    }

    /// Its configuration.
    #[cfg(test)]
    pub(crate) fn config(&self) -> &MasterControlConfig {
        &self.site.config
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
            // What one state says may be gone from the next.
            self.look_round(now);
        }
        self.site.attempt_connection();
        self.look_round(now);
        if std::mem::take(&mut self.site.claims.changed) {
            for vehicle in &mut self.fleet {
                vehicle.at(now);
            }
            self.look_round(now);
        }
    }
}

impl MasterControl {
    /// Looks after each vehicle that wants it now.
    fn look_round(&mut self, now: Moment) {
        for vehicle in &mut self.fleet {
            if vehicle.wake.is_some_and(|wake| wake <= now) {
                vehicle.wake = None;
                self.site.look_after(vehicle);
            }
        }
    }
}

impl Device for MasterControl {
    fn connect_options(&mut self, now: Stamp) -> ConnectOptions {
        self.advance(now);
        self.joining()
    }

    fn declines(&self, name: &str, arguments: &serde_json::Value) -> Option<String> {
        let vehicle = self.fleet.get(self.meant(arguments)?)?;
        self.site.declines(vehicle, name, arguments)
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
        let connection = &self.site.connection;
        let vehicles = self.fleet.iter().filter_map(|vehicle| vehicle.wake);
        let vehicles = vehicles.min().filter(|_| connection.online);
        let inbox = self.inbox.front().map(|(due, _)| *due);
        let attempt = connection.attempt_at.filter(|_| !connection.online);
        vehicles.into_iter().chain(inbox).chain(attempt).min()
    }
}
