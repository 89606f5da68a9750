//! The reference AGV: a complete vehicle as a sans-IO state machine, "the best-behaved vehicle there is".
//!
//! Written from the standard. The parts, by idea: `acceptance`, with `ability` and `rejection`, decides about orders
//! (figure 8), `book` holds the order, `progress` drives it, `cancel` ends it (figure 9); `actions` knows when an
//! action runs and `deeds` what it does; `instant` takes instant actions, `commands` what people do to the vehicle;
//! `connection` and `report` speak to the broker. Every deviation from good behaviour is declared in `faults`, every
//! liberty a good vehicle may take in `tolerances`; both are found in the code by name. As a mock vehicle before a
//! master control it also has `personas`: deviations a test switches on and off while it runs.

#[macro_use]
mod blind_faults;
mod ability;
mod acceptance;
pub(crate) mod action_kinds;
pub(crate) mod actions;
pub(crate) mod book;
pub(crate) mod cancel;
mod commands;
pub(crate) mod config;
pub(crate) mod connection;
pub(crate) mod deeds;
pub(crate) mod downloads;
pub(crate) mod errors;
mod factsheet;
pub mod faults;
pub(crate) mod fourth;
pub(crate) mod instant;
pub mod lapses;
pub(crate) mod maps;
pub(crate) mod motion;
pub(crate) mod order_message;
pub(crate) mod path;
mod personas;
pub(crate) mod points;
pub(crate) mod progress;
pub(crate) mod read;
pub(crate) mod rejection;
pub(crate) mod report;
pub(crate) mod seam;
pub(crate) mod sixth;
mod stations;
#[cfg(test)]
mod tests;
pub mod tolerances;
pub(crate) mod updates;

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use crate::clock::{Moment, Stamp};
use crate::reference::{ConnectOptions, Device, Input, Output};

pub use commands::COMMANDS;
pub use config::{AgvConfig, ErrorNames, LayoutNode, OnboardMap};
pub use faults::{BLIND_FAULTS, FAULTS, FaultName, find};
pub use lapses::{LAPSES, lapse};
pub use tolerances::{BLIND_TOLERANCES, TOLERANCES, Tolerance, ToleranceName};

use actions::Actions;
use book::Book;
use connection::Connection;
use downloads::Downloads;
use errors::{ActiveError, Errors, Life};
use faults::Faults;
use fourth::Fourth;
use maps::Maps;
use motion::{Motion, Pose};
use personas::Persona;
use report::Report;
use seam::Seam;
use sixth::Sixth;
use tolerances::ToleranceName as T;

/// A fault that is not in [`FAULTS`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reference AGV has no fault `{0}`")]
pub struct UnknownFault(pub String);

/// operatingMode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    Automatic,
    Semiautomatic,
    Manual,
    Service,
    Teachin,
}

impl Mode {
    /// Whether master control commands the vehicle (MODE-02).
    pub(crate) fn takes_orders(self) -> bool {
        matches!(self, Self::Automatic | Self::Semiautomatic)
    }
}

/// What keeps the vehicle from moving.
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
    /// A defect that keeps it from running.
    pub(crate) defect: bool,
    /// Nothing at all (`pause-not-lifted` only).
    pub(crate) stuck: bool,
}

impl Holds {
    pub(crate) fn any(self) -> bool {
        self.pause || self.button || self.emergency || self.field || self.outside || self.defect || self.stuck
    }
}

/// A load on the vehicle.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Load {
    pub(crate) id: String,
    pub(crate) kind: String,
    pub(crate) position: String,
}

/// What only vehicles with faults or liberties of round three remember.
#[derive(Clone, Debug, Default)]
pub(crate) struct Third {
    /// It was given a pose since the last order (`r3-order-after-init-position-refused` only).
    pub(crate) posed: bool,
    /// It still rolls although it is paused (`r3-pause-finished-before-standing` only).
    pub(crate) braking: Option<Moment>,
    /// When it shows that it charges (`r3-charging-reported-late` only).
    pub(crate) charging_at: Option<Moment>,
    /// Actions that were tried once more (`r3-failed-pick-retried` only).
    pub(crate) retried: Vec<String>,
    /// Nodes and edges of the last order message that was taken over.
    pub(crate) content: Option<serde_json::Value>,
    /// An order that came twice, and is mentioned.
    pub(crate) repeated: Option<String>,
    /// nodeIds of this order that were visited (`r3-loop-second-visit-without-actions` only).
    pub(crate) visited: BTreeSet<String>,
    /// Whether it was busy before.
    pub(crate) busy: bool,
}

/// The reference AGV.
#[derive(Debug)]
pub struct Agv {
    /// Who else is asked.
    pub(crate) seam: Seam,
    pub(crate) third: Third,
    pub(crate) fourth: Fourth,
    pub(crate) sixth: Sixth,
    pub(crate) config: AgvConfig,
    pub(crate) faults: Faults,
    /// The time of what is happening.
    pub(crate) now: Stamp,
    pub(crate) book: Book,
    pub(crate) motion: Motion,
    pub(crate) actions: Actions,
    pub(crate) maps: Maps,
    pub(crate) downloads: Downloads,
    pub(crate) errors: Errors,
    pub(crate) holds: Holds,
    pub(crate) mode: Mode,
    pub(crate) loads: Vec<Load>,
    /// Edges on which something stands.
    pub(crate) obstacles: BTreeSet<String>,
    /// It refuses the next order (`order-error-locks`, `manual-locks` only).
    pub(crate) locked: bool,
    /// When the last order came (`orders-spaced` only).
    pub(crate) ordered: Option<Moment>,
    /// `malformed-instant-deafens`: no instant action is heard any more.
    pub(crate) deaf: bool,
    /// It has left its corridor and was not put back yet.
    pub(crate) strayed: bool,
    /// Where loads are handed over, and whether one stands there.
    pub(crate) stations: std::collections::BTreeMap<String, bool>,
    /// A load it does not carry any more, and until when it is shown (`drop-reported-late` only).
    pub(crate) shadow: Option<(Moment, Load)>,
    pub(crate) charging: bool,
    /// It takes no orders until then (`charging-ends-early` only).
    pub(crate) undocking: Option<Moment>,
    /// A switch keeps it from pausing and from going on.
    pub(crate) pause_blocked: bool,
    /// How often it was paused (`pauses-counted` only).
    pub(crate) pauses: u32,
    /// Nothing ends the pause any more (`pause-stuck-…` only).
    pub(crate) pause_outlives: bool,
    /// Something keeps it from ending its charging.
    pub(crate) charger_locked: bool,
    /// The order it gave up in a mode for people (`order-taken-up-again` only).
    pub(crate) remembered: Option<Book>,
    /// It has not found its pose (`init-position-uninitialized` only).
    pub(crate) lost: bool,
    /// The map it says it is on (`init-position-taken-anyway` only).
    pub(crate) claimed_map: Option<String>,
    pub(crate) connection: Connection,
    pub(crate) report: Report,
    /// What has come and was not looked at yet, and when it will be: messages, and what people do.
    pub(crate) inbox: VecDeque<(Moment, Input)>,
    /// It stands still on a node until then (`stops-on-nodes`, `first-node-listed` only).
    pub(crate) lingers_until: Option<Moment>,
    /// When what was held goes on (`resumes-in-a-moment` only).
    pub(crate) resumes_at: Option<Moment>,
    /// Counts states.
    pub(crate) states_sent: u64,
    /// Counts logs.
    pub(crate) logs: u32,
    /// A load that was picked is not shown before (`r1-pick-reported-late` only).
    pub(crate) hidden_load: Option<Moment>,
    /// The e-stop is shown until the next order (`r1-e-stop-latched` only).
    pub(crate) latched: bool,
    /// The field is shown violated until the next order (`r2-field-violation-latched` only).
    pub(crate) field_latched: bool,
    /// actionId and name of the last log (`r2-log-name-in-information` only).
    pub(crate) last_log: Option<(String, String)>,
    /// An order that was refused and waits all the same (`r2-refused-order-queued` only).
    pub(crate) queued: Option<serde_json::Value>,
    /// The last order was lost (`order-after-refusal-lost` only).
    pub(crate) order_lost: bool,
    /// The pause is not shown before this (`r2-paused-flag-late` only).
    pub(crate) pause_hidden_until: Option<Moment>,
    /// What was decided and is still to be handed to the driver.
    pub(crate) pending: Vec<Output>,
    /// How a test told it to behave.
    persona: Persona,
}

impl Agv {
    /// A vehicle with some of [`FAULTS`], by name; without any it is faultless.
    ///
    /// It stands on its start node, is switched on, and asks for its connection at the first [`Input::Time`]
    /// (a driver may also connect it unasked).
    pub fn new(config: AgvConfig, faults: &[&str]) -> Result<Self, UnknownFault> {
        let faults = Faults::named(faults).map_err(UnknownFault)?;
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
        Ok(Self {
            seam: Seam::default(),
            third: Third::default(),
            fourth: Fourth::default(),
            sixth: Sixth::default(),
            faults,
            now: Stamp {
                moment: Moment::START,
                utc: jiff::Timestamp::UNIX_EPOCH,
            },
            book: Book::empty(start),
            motion: Motion::at(pose),
            actions: Actions::default(),
            maps,
            downloads: Downloads::default(),
            errors: Errors::default(),
            holds: Holds::default(),
            mode: Mode::Automatic,
            loads: Vec::new(),
            obstacles: BTreeSet::new(),
            locked: false,
            deaf: false,
            strayed: false,
            stations: config.stations.clone(),
            shadow: None,
            charging: false,
            undocking: None,
            pause_blocked: false,
            pauses: 0,
            pause_outlives: false,
            charger_locked: false,
            remembered: None,
            lost: false,
            claimed_map: None,
            ordered: None,
            connection: Connection::new(),
            report: Report::default(),
            inbox: VecDeque::new(),
            lingers_until: None,
            resumes_at: None,
            states_sent: 0,
            logs: 0,
            hidden_load: None,
            latched: false,
            field_latched: false,
            last_log: None,
            queued: None,
            order_lost: false,
            pause_hidden_until: None,
            pending: Vec::new(),
            persona: Persona::default(),
            config,
        })
    }

    /// The present moment.
    pub(crate) fn moment(&self) -> Moment {
        self.now.moment
    }

    /// Reports a warning that has no rule for its end.
    pub(crate) fn warn(&mut self, error_type: String, references: Vec<(String, String)>, description: String) {
        let warning = self.warning(error_type, references, description);
        self.errors.raise(warning);
    }

    fn warning(&self, error_type: String, references: Vec<(String, String)>, description: String) -> ActiveError {
        let life = match () {
            () if self.faults.has(FaultName::R6ActionErrorsNeverClear) => Life::Always,
            () if self.takes(T::R3ActionErrorsUntilNewOrder) => Life::UntilNewOrder,
            () if self.takes(T::R3ActionErrorsBrief) => Life::Until(self.moment() + self.brief()),
            () => Life::Until(self.moment() + self.config.error_duration),
        };
        ActiveError {
            error_type,
            fatal: false,
            references,
            description,
            life,
        }
    }

    /// When something happens next by itself.
    fn next_event(&self) -> Option<Moment> {
        let events = [
            self.motion.end(),
            self.actions.next_end(),
            self.errors.next_end(),
            self.connection.next_attempt(),
            self.connection.online_at,
            self.book.soon,
            self.lingers_until,
            self.resumes_at,
            self.inbox.front().map(|(due, _)| *due),
            self.shadow.as_ref().map(|(end, _)| *end),
            self.hidden_load,
            self.pause_hidden_until,
            self.third.braking,
            self.third.charging_at,
            self.fourth.uncharged_at,
            self.sixth.next_event(),
            self.due(),
            self.persona.next_end(),
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
        let moment = self.moment();
        if let Some(rolled) = self.motion.finish(moment) {
            self.leg_finished(rolled);
        }
        while let Some(id) = self.actions.due(moment) {
            self.stage_finished(&id);
        }
        self.errors.expire(moment);
        self.happens(seam::Event::Woken);
        self.persona.expire(moment);
        self.lingers_until = self.lingers_until.filter(|until| *until > moment);
        while self.inbox.front().is_some_and(|(due, _)| *due <= moment) {
            match self.inbox.pop_front() {
                Some((_, Input::Message { topic, payload })) => self.message(&topic, &payload),
                Some((_, Input::Command(name, arguments))) => self.command(&name, &arguments),
                _ => {}
            }
        }
        self.shadow.take_if(|(end, _)| *end <= moment);
        self.hidden_load = self.hidden_load.filter(|end| *end > moment);
        self.pause_hidden_until = self.pause_hidden_until.filter(|end| *end > moment);
        self.third.braking = self.third.braking.filter(|end| *end > moment);
        if self.third.charging_at.take_if(|at| *at <= moment).is_some() {
            self.charging = true;
        }
        if self.fourth.uncharged_at.take_if(|at| *at <= moment).is_some() {
            self.charging = false;
        }
        self.a_moment_later();
        self.begin_what_waits_again();
        self.fetch_what_waited();
        self.resume_if_due();
        self.attempt_connection();
        self.settle();
        self.notice_end_of_order();
        self.happens(seam::Event::Settled);
        self.begin_queued();
        self.flush();
    }
}

impl Device for Agv {
    fn connect_options(&mut self, now: Stamp) -> ConnectOptions {
        self.options(now)
    }

    fn handle(&mut self, now: Stamp, input: Input, out: &mut Vec<Output>) {
        self.advance(now);
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
    /// `r3-rejection-gone-when-order-done`: forgets what was refused once the order is done.
    fn notice_end_of_order(&mut self) {
        let busy = self.is_busy();
        let before = std::mem::replace(&mut self.third.busy, busy);
        let done = before && !busy && !self.book.cancelled;
        if done && self.faults.has(FaultName::R3RejectionGoneWhenOrderDone) {
            self.errors.forget_refusals();
        }
    }

    /// Puts something into the inbox. What people do does not wait behind messages that are taken late.
    fn lay_down(&mut self, input: Input) {
        let is_message = |input: &Input| matches!(input, Input::Message { .. });
        let mut due = self.moment() + self.config.answers_after;
        if is_message(&input) {
            due = self.moment() + self.persona.answers_after.unwrap_or(self.config.answers_after);
            let before = self.inbox.iter().filter(|(_, other)| is_message(other));
            due = before.map(|(other, _)| *other).fold(due, Moment::max);
        }
        let at = self.inbox.partition_point(|(other, _)| *other <= due);
        self.inbox.insert(at, (due, input));
    }

    fn message(&mut self, topic: &str, payload: &[u8]) {
        if self.config.topic("order") == Some(topic) {
            self.fourth.order_at = Some(self.moment());
            if !self.overlooks_order() {
                self.order_received(payload);
            }
        } else if self.config.topic("instantActions") == Some(topic) && !self.receive_buffer_is_full() {
            self.instant_actions_received(payload);
        }
    }

    /// `orders-spaced`: an order that comes earlier than its factsheet allows, and not just by the way of a message.
    fn overlooks_order(&mut self) -> bool {
        let now = self.moment();
        let before = self.ordered.replace(now);
        let early = before.is_some_and(|before| now.since(before) < Duration::from_millis(150));
        early && self.takes(T::OrdersSpaced)
    }

    /// How long an action runs.
    fn duration_of(&self, action: &actions::Action) -> Duration {
        let of_edge = matches!(action.origin, actions::Origin::Edge(_));
        let all = self.faults.has(FaultName::EdgeActionOutlivesEdge);
        if of_edge && (all || self.faults.has(FaultName::LastEdgeActionOutlivesEdge)) {
            return Duration::from_secs(60);
        }
        let asked = action
            .number("duration")
            .filter(|seconds| (0.0..=86_400.0).contains(seconds));
        if let Some(seconds) = asked {
            return Duration::from_secs_f64(seconds);
        }
        if self.brakes_long(action) {
            return fourth::BRAKING;
        }
        let by_type = self.config.action_durations.get(&action.request.action_type);
        let duration = by_type.copied().unwrap_or(self.config.action_duration);
        if self.takes(ToleranceName::ActionsLast) {
            return duration.max(Duration::from_secs(1));
        }
        duration
    }
}
