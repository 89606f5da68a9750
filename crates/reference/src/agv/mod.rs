//! The reference AGV: a complete vehicle as a sans-IO state machine, written from the standard.
//!
//! A message goes through it like this: `connection` receives nothing and sends everything; a driver hands in what came
//! ([`Device::handle`]), and takes out what is to be sent. An order is read by `read` and `order_message`, decided in
//! `acceptance` (figure 8), with `updates` for what continues an order, `ability` for what the vehicle can do and
//! `rejection` for how it says no. `order_state` holds the order, `progress` drives it, leg by leg as `way`, `path` and `planner` plan them,
//! and `cancel` ends it (figure 9); `requests` asks for corridors that have to be released, `zone_requests` for zones, and `replanning` for ways through them. `actions` knows when an action runs, `blocking` what may run beside it, `action_effect`,
//! `stations`, `maps`, `zone_sets` and `downloads` what it does. `instant` takes instant actions, `commands` what people do to the
//! vehicle, `heeding` what it does about zones. `report` says all that in states, `factsheet` what the vehicle is.
//!
//! The vehicle asks at its points of decision whether it may, and says what happens: the words for both stand in `hook_points`
//! and `objections`, and `hooks` is who else is asked. With nobody there the answer is what stands in the vehicle.

mod ability;
mod acceptance;
pub(crate) mod action_effect;
pub(crate) mod action_kinds;
pub(crate) mod actions;
mod blocking;
pub(crate) mod cancel;
pub(crate) mod certificate_set;
mod certificates;
mod commands;
pub(crate) mod config;
pub(crate) mod connection;
pub(crate) mod downloads;
pub(crate) mod errors;
mod factsheet;
pub(crate) mod heeding;
pub(crate) mod hibernation;
pub(crate) mod hook_points;
pub(crate) mod hooks;
pub(crate) mod instant;
mod localization;
pub(crate) mod maps;
pub(crate) mod motion;
pub(crate) mod objections;
pub(crate) mod order_message;
pub(crate) mod order_state;
pub(crate) mod path;
pub(crate) mod paths;
mod planner;
pub(crate) mod progress;
pub(crate) mod read;
pub(crate) mod rejection;
pub(crate) mod replanning;
pub(crate) mod report;
pub(crate) mod requests;
mod stations;
#[cfg(test)]
mod tests;
pub(crate) mod triggers;
pub(crate) mod updates;
pub(crate) mod way;
mod wire;
pub(crate) mod zone_requests;
pub(crate) mod zone_sets;
pub(crate) mod zones;

use std::collections::{BTreeSet, VecDeque};

use crate::{ConnectOptions, Device, Input, Output};
use tck_base::clock::{Moment, Stamp};

pub use commands::COMMANDS;
pub use config::{AgvConfig, ErrorEnd, ErrorNames, ErrorRule, LayoutNode, OnboardMap};

use actions::Actions;
use connection::Connection;
use downloads::Downloads;
use errors::Errors;
use heeding::Heeding;
use hooks::SwitchedOn;
use maps::Maps;
use motion::{Motion, Pose};
use order_state::OrderState;
use report::{Report, Rest};
use requests::Requests;
use zone_sets::ZoneSets;
pub use zones::ZONE_TYPES;

/// Topic names it listens to.
pub(crate) const HEARD: [&str; 4] = ["order", "instantActions", "zoneSet", "responses"];

/// operatingMode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    Automatic,
    Semiautomatic,
    Manual,
    Service,
    Teachin,
    /// From its start on until it is ready.
    Startup,
    /// Somebody steps in, and the order waits.
    Intervened,
}

impl Mode {
    /// Whether master control commands the vehicle (MODE-02).
    pub(crate) fn takes_orders(self) -> bool {
        matches!(self, Self::Automatic | Self::Semiautomatic)
    }

    /// Whether the order goes on when this mode ends.
    pub(crate) fn keeps_orders(self) -> bool {
        self.takes_orders() || self == Self::Intervened
    }
}

/// Reasons for which the vehicle does not move.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Holds {
    /// startPause.
    pub(crate) pause: bool,
    /// The pause button on the vehicle.
    pub(crate) button: bool,
    /// The emergency stop.
    pub(crate) emergency: bool,
    /// Something stands in the protective field.
    pub(crate) field: bool,
    /// It is outside its corridor.
    pub(crate) outside: bool,
    /// It has lost the release of what it drives through.
    pub(crate) release: bool,
    /// It has lost the release of the zone that it is in.
    pub(crate) access: bool,
    /// A defect that keeps it from running.
    pub(crate) defect: bool,
    /// It is in a zone where it must not be, or cannot do what it is asked to do there.
    pub(crate) zone: bool,
}

impl Holds {
    pub(crate) fn any(self) -> bool {
        let outside = self.outside || self.zone || self.release || self.access;
        self.pause || self.button || self.emergency || self.field || outside || self.defect
    }
}

/// A load on the vehicle.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Load {
    pub(crate) id: String,
    pub(crate) kind: String,
    pub(crate) position: String,
}

/// The reference AGV.
#[derive(Debug)]
pub struct Agv {
    /// Hooks that are switched on.
    pub(crate) hooks: SwitchedOn,
    pub(crate) config: AgvConfig,
    /// The time of what is happening.
    pub(crate) now: Stamp,
    pub(crate) order: OrderState,
    pub(crate) motion: Motion,
    pub(crate) actions: Actions,
    pub(crate) maps: Maps,
    pub(crate) zone_sets: ZoneSets,
    pub(crate) heeding: Heeding,
    pub(crate) downloads: Downloads,
    pub(crate) errors: Errors,
    pub(crate) holds: Holds,
    pub(crate) mode: Mode,
    /// The mode that it goes over to when the actions of its order have ended.
    pub(crate) awaited_mode: Option<Mode>,
    pub(crate) loads: Vec<Load>,
    /// Edges on which something stands.
    pub(crate) obstacles: BTreeSet<String>,
    /// It has left its corridor and was not put back yet.
    pub(crate) strayed: bool,
    /// It cannot tell where it is.
    pub(crate) lost: bool,
    /// Nodes where loads are handed over, and whether one stands there.
    pub(crate) stations: std::collections::BTreeMap<String, bool>,
    pub(crate) charging: bool,
    /// How far it is on its way to sleep.
    pub(crate) sleep: hibernation::Hibernation,
    /// A switch keeps it from pausing and from going on.
    pub(crate) pause_blocked: bool,
    /// Something keeps it from ending its charging.
    pub(crate) charger_locked: bool,
    pub(crate) requests: Requests,
    pub(crate) connection: Connection,
    pub(crate) report: Report,
    /// What it repeats while nothing can change.
    pub(crate) rest: Rest,
    /// Messages and commands that were not looked at yet, and when they will be.
    pub(crate) inbox: VecDeque<(Moment, Input)>,
    /// It stands still until then.
    pub(crate) lingers_until: Option<Moment>,
    /// Counts states.
    pub(crate) states_sent: u64,
    /// Counts logs.
    pub(crate) logs: u32,
    /// Outputs that are still to be handed to the driver.
    pub(crate) pending: Vec<Output>,
}

impl Agv {
    /// A vehicle of this configuration.
    ///
    /// It stands on its start node, is switched on, and asks for its connection at the first [`Input::Time`]
    /// (a driver may also connect it unasked).
    #[must_use]
    pub fn new(config: AgvConfig) -> Self {
        let pose = config.node(&config.start_node).map_or_else(
            || Pose {
                x: 0.0,
                y: 0.0,
                theta: 0.0,
                map_id: config.maps.first().map_or_else(String::new, |map| map.map_id.clone()),
            },
            |node| Pose {
                x: node.x,
                y: node.y,
                theta: node.theta.unwrap_or(0.0),
                map_id: node.map_id.clone(),
            },
        );
        let start = if config.node(&config.start_node).is_some() {
            config.start_node.clone()
        } else {
            String::new()
        };
        let maps = Maps::new(config.maps.clone(), config.map_capacity);
        Self {
            hooks: SwitchedOn::default(),
            now: Stamp {
                moment: Moment::START,
                utc: jiff::Timestamp::UNIX_EPOCH,
            },
            order: OrderState::empty(start),
            motion: Motion::at(pose),
            actions: Actions::default(),
            maps,
            zone_sets: ZoneSets::default(),
            heeding: Heeding::default(),
            downloads: Downloads::default(),
            errors: Errors::default(),
            holds: Holds::default(),
            mode: Mode::Automatic,
            awaited_mode: None,
            loads: Vec::new(),
            obstacles: BTreeSet::new(),
            strayed: false,
            lost: false,
            stations: config.stations.clone(),
            charging: false,
            sleep: hibernation::Hibernation::default(),
            pause_blocked: false,
            charger_locked: false,
            requests: Requests::default(),
            connection: Connection::new(),
            report: Report::default(),
            rest: Rest::default(),
            inbox: VecDeque::new(),
            lingers_until: None,
            states_sent: 0,
            logs: 0,
            pending: Vec::new(),
            config,
        }
    }

    /// The present moment.
    pub(crate) fn moment(&self) -> Moment {
        self.now.moment
    }

    /// When something happens next by itself.
    fn next_event(&self) -> Option<Moment> {
        let events = [
            self.motion.end(),
            self.actions.next_end(),
            self.errors.next_end(),
            self.requests.next_end(self.now.moment),
            self.connection.next_attempt(),
            self.lingers_until,
            self.sleep.wakes_at,
            self.inbox.front().map(|(due, _)| *due),
            self.due(),
            self.next_report(),
        ];
        events.into_iter().flatten().min()
    }

    /// Lives through everything that happens by itself up to `now`, each at its own time.
    fn advance(&mut self, now: Stamp) {
        // A driver that was away for hours gets a bounded number of events, then the rest at once.
        for _ in 0..10_000 {
            let Some(event) = self.next_event().filter(|event| *event <= now.moment) else {
                break;
            };
            self.now = now.at(event.max(self.now.moment));
            self.step();
        }
        self.now = now;
    }

    /// What is due at the present moment.
    fn step(&mut self) {
        if self.rest.lasts {
            self.repeat();
            return;
        }
        let moment = self.moment();
        if let Some(rolled) = self.motion.finish(moment) {
            self.leg_finished(rolled);
        }
        while let Some(id) = self.actions.due(moment) {
            self.stage_finished(&id);
        }
        self.errors.expire(moment);
        self.wakes_in_time();
        self.happens(hooks::Event::Woken);
        self.lingers_until = self.lingers_until.filter(|until| *until > moment);
        while self.inbox.front().is_some_and(|(due, _)| *due <= moment) {
            match self.inbox.pop_front() {
                Some((_, Input::Message { topic, payload })) => self.message(&topic, &payload),
                Some((_, Input::Command(name, arguments))) => self.command(&name, &arguments),
                _ => {}
            }
        }
        self.attempt_connection();
        self.settle();
        self.happens(hooks::Event::Settled);
        self.flush();
        self.settle_farewell();
        self.rest = Rest::begins(self.comes_to_rest());
    }
}

impl Device for Agv {
    fn connect_options(&mut self, now: Stamp) -> ConnectOptions {
        self.options(now)
    }

    fn handle(&mut self, now: Stamp, input: Input, out: &mut Vec<Output>) {
        self.advance(now);
        if !matches!(input, Input::Time) {
            self.wake();
        }
        match input {
            Input::Connected => self.connected(),
            Input::ConnectionLost => self.connection_lost(),
            Input::Message { .. } | Input::Command(..) => self.lay_down(input),
            Input::Time => {}
            Input::Download { token, progress } => self.download_progress(token, progress),
        }
        self.step();
        out.append(&mut self.pending);
    }

    fn wake_up(&self) -> Option<Moment> {
        self.next_event()
    }
}

impl Agv {
    /// Puts something into the inbox. What people do does not wait behind messages that are taken late.
    fn lay_down(&mut self, input: Input) {
        let is_message = |input: &Input| matches!(input, Input::Message { .. });
        let mut due = self.moment() + self.config.answers_after;
        if is_message(&input) {
            due = self.moment() + self.lasts(hooks::Span::Answer, self.config.answers_after);
            let before = self.inbox.iter().filter(|(_, other)| is_message(other));
            due = before.map(|(other, _)| *other).fold(due, Moment::max);
        }
        let at = self.inbox.partition_point(|(other, _)| *other <= due);
        self.inbox.insert(at, (due, input));
    }

    fn message(&mut self, topic: &str, payload: &[u8]) {
        for name in HEARD {
            let own = self.config.topic(name) == Some(topic);
            let meant = own || self.allows(hooks::Permission::HearAnother(name, topic), false);
            if !meant || !self.hears(name, payload) {
                continue;
            }
            let Some(heard) = self.heard_asleep(name, payload) else {
                continue;
            };
            match name {
                "order" => self.order_received(&heard),
                "instantActions" => self.instant_actions_received(&heard),
                "zoneSet" if self.config.listens(name) => self.zone_set_received(&heard),
                "responses" if self.config.listens(name) => self.responses_received(&heard),
                _ => {}
            }
        }
    }
}
