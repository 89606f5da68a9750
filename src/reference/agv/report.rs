//! The state message: when it is sent, and the visualization beside it (sections 6.10 and 6.13).
//!
//! A state is due when it differs from the last one in anything but position, speed and battery charge. So no
//! part of the vehicle has to remember to announce what it changed, and changes of one instant share a state.

mod picture;
mod route;

use std::time::Duration;

use serde_json::{Map, Value};

use crate::clock::Moment;

use super::Agv;
use super::faults::FaultName as F;
use super::points::{Event, Part, Span};
use super::tolerances::ToleranceName as T;

/// What has been reported.
#[derive(Clone, Debug, Default)]
pub(crate) struct Report {
    /// An order message arrived (STATE-03).
    pub(crate) order_received: bool,
    /// It was an update, and it was taken over (`update-without-state` only).
    pub(crate) update_received: bool,
    /// A state was asked for (ACT-26).
    pub(crate) requested: bool,
    /// The state that is sent now is sent because it is time.
    pub(crate) periodic: bool,
    /// No state before the next periodic one (`state-request-unanswered`).
    pub(crate) silenced: bool,
    /// The last state, without its header, and when it was sent.
    pub(crate) last: Option<(Moment, Map<String, Value>)>,
    /// A state is due and only waits for the minimum interval.
    pub(crate) delayed: bool,
    pub(crate) next_visualization: Option<Moment>,
    /// No state before this (`silent-after-reconnect` only).
    pub(crate) silent_until: Option<Moment>,
}

impl Report {
    /// Whether the state that is sent now answers a request, and is not the first one.
    pub(crate) fn answers_request(&self) -> bool {
        self.requested && self.last.is_some()
    }
}

/// Members that change without being an event.
const SILENT: [&str; 4] = ["agvPosition", "velocity", "batteryState", "distanceSinceLastNode"];

/// Faults that keep events from the state.
const KEPT_EVENTS: [F; 10] = [
    F::StatesByClock,
    F::OrderWithoutState,
    F::UpdateWithoutState,
    F::LoadWithoutState,
    F::ErrorWithoutState,
    F::ModeWithoutState,
    F::MapsWithoutState,
    F::NodeWithoutState,
    F::DrivingWithoutState,
    F::ActionsWithoutState,
];

/// The longest interval the standard allows, with some room.
const LONGEST: Duration = Duration::from_secs(28);

/// What differs between two states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Changes {
    order: bool,
    load: bool,
    error: bool,
    node: bool,
    mode: bool,
    driving: bool,
    actions: bool,
    maps: bool,
    other: bool,
}

impl Changes {
    fn between(old: &Map<String, Value>, new: &Map<String, Value>) -> Self {
        let mut changes = Self::default();
        let keys = new.keys().chain(old.keys().filter(|key| !new.contains_key(*key)));
        for key in keys.filter(|key| !SILENT.contains(&key.as_str()) && old.get(*key) != new.get(*key)) {
            match key.as_str() {
                "loads" => changes.load = true,
                "errors" => changes.error = true,
                "lastNodeId" | "lastNodeSequenceId" => changes.node = true,
                "operatingMode" => changes.mode = true,
                "driving" => changes.driving = true,
                "actionStates" => changes.actions = true,
                "maps" => changes.maps = true,
                _ => changes.other = true,
            }
        }
        let charging = |state: &Map<String, Value>| {
            state
                .get("batteryState")
                .and_then(|state| state.get("charging"))
                .cloned()
        };
        let map = |state: &Map<String, Value>| state.get("agvPosition").and_then(|pose| pose.get("mapId")).cloned();
        changes.other |= charging(old) != charging(new) || map(old) != map(new);
        changes
    }

    fn any(self) -> bool {
        self != Self::default()
    }
}

impl Agv {
    /// Begins to report on a new connection.
    pub(crate) fn start_reporting(&mut self) {
        self.report.last = None;
        self.report.requested = true;
        let late = self.takes(T::R2FirstStateLate);
        self.report.silent_until = late.then(|| self.moment() + Duration::from_millis(1_200));
        self.happens(Event::Reporting);
        self.report.next_visualization = self.visualization_interval().map(|_| self.moment());
    }

    /// The shortest time between two states.
    fn min_state_interval(&self) -> Duration {
        let told = self.persona.state_interval;
        told.unwrap_or_default().max(self.config.min_state_interval)
    }

    fn state_interval(&self) -> Duration {
        self.lasts(Span::BetweenStates, self.stated_interval())
            .max(self.persona.state_interval.unwrap_or_default())
    }

    /// The interval the factsheet promises. A faulty vehicle that keeps events to itself has a long one, so that
    /// its periodic states do not make up for them.
    pub(crate) fn stated_interval(&self) -> Duration {
        if KEPT_EVENTS.iter().any(|fault| self.faults.has(*fault)) {
            LONGEST
        } else {
            self.config.state_interval
        }
    }

    fn visualization_interval(&self) -> Option<Duration> {
        let stated = self.config.visualization_interval;
        stated.map(|interval| self.lasts(Span::BetweenVisualizations, interval))
    }

    /// When the next message goes out by the clock.
    pub(crate) fn next_report(&self) -> Option<Moment> {
        if !self.connection.online {
            return None;
        }
        if self.report.silent_until.is_some() {
            return self.report.silent_until;
        }
        if self.silent_in_manual() {
            return self.report.next_visualization;
        }
        let last = self.report.last.as_ref().map(|(sent, _)| *sent)?;
        let state = if self.report.delayed {
            self.min_state_interval()
        } else {
            self.state_interval()
        };
        Some((last + state).min(self.report.next_visualization.unwrap_or(last + state)))
    }

    /// `r1-silent-in-manual`: it has reported the mode, and says no more.
    fn silent_in_manual(&self) -> bool {
        let told = self
            .report
            .last
            .as_ref()
            .and_then(|(_, last)| last.get("operatingMode"));
        self.mode == super::Mode::Manual
            && self.faults.has(F::R1SilentInManual)
            && told.is_some_and(|told| told == "MANUAL")
    }

    /// As short as an event can be that has to be in a state.
    pub(crate) fn brief(&self) -> Duration {
        super::cancel::MOMENT.max(self.min_state_interval() * 2)
    }

    /// Publishes what is due.
    pub(crate) fn flush(&mut self) {
        if !self.connection.online {
            self.report.order_received = false;
            self.report.requested = false;
            if self.faults.has(F::R4ReconnectReplaysBufferedStates) {
                self.buffer_state();
            }
            return;
        }
        self.flush_state();
        let moment = self.moment();
        if let Some(interval) = self.visualization_interval()
            && self.report.next_visualization.is_some_and(|next| next <= moment)
        {
            let next = self.report.next_visualization.map_or(moment, |next| next + interval);
            self.report.next_visualization = Some(if next > moment { next } else { moment + interval });
            self.publish_visualization();
        }
    }

    /// `r4-reconnect-replays-buffered-states`: keeps what it would have sent, with the time of now.
    fn buffer_state(&mut self) {
        let body = self.state_picture();
        let buffered = &mut self.fourth.buffered;
        let changed = buffered
            .last()
            .is_none_or(|(_, last)| Changes::between(last, &body).any());
        if self.connection.was_online() && changed && buffered.len() < super::fourth::BUFFER {
            buffered.push((format!("{:.2}", self.now.utc), body));
        }
    }

    fn flush_state(&mut self) {
        let moment = self.moment();
        if self.report.silent_until.is_some_and(|until| until > moment) || self.silent_in_manual() {
            return;
        }
        let body = self.state_picture();
        let Some((sent, last)) = &self.report.last else {
            self.send_state(body, false);
            return;
        };
        let periodic = *sent + self.state_interval() <= moment;
        let mut changes = Changes::between(last, &body);
        changes.order = self.report.order_received;
        let requested = self.report.requested;
        let too_soon = *sent + self.min_state_interval() > moment;
        self.report.delayed = false;
        if periodic {
            self.send_state(body, true);
        } else if (changes.any() || requested) && !self.suppressed(changes, requested, &body) {
            if too_soon {
                self.report.delayed = true;
            } else {
                self.send_state(body, false);
            }
        }
    }

    /// Whether a faulty vehicle keeps an event to itself. What it swallows is never told on its own.
    fn suppressed(&mut self, changes: Changes, requested: bool, body: &Map<String, Value>) -> bool {
        if std::mem::take(&mut self.report.update_received) && self.faults.has(F::UpdateWithoutState) {
            self.report.order_received = false;
            if let Some((_, last)) = &mut self.report.last {
                last.clone_from(body);
            }
            return true;
        }
        let event = |change: bool, fault: F| change && self.faults.has(fault);
        let held = self.report.silenced
            || (self.faults.has(F::StatesByClock) && !requested)
            || event(changes.order, F::OrderWithoutState)
            || event(changes.load, F::LoadWithoutState)
            || event(changes.error, F::ErrorWithoutState)
            || event(changes.mode, F::ModeWithoutState)
            || event(changes.maps, F::MapsWithoutState);
        let left = self.book.left.0.as_ref();
        let plain = left.is_some_and(|stop| stop.node.actions.is_empty());
        let passes = changes.node && plain && !changes.driving && !changes.actions;
        let swallowed = !changes.order
            && (event(changes.node, F::NodeWithoutState)
                || event(passes, F::R4NoStateOnPlainNodes)
                || event(changes.driving, F::DrivingWithoutState)
                || event(changes.actions && !changes.node, F::ActionsWithoutState));
        if swallowed
            && !held
            && let Some((_, last)) = &mut self.report.last
        {
            last.clone_from(body);
        }
        held || swallowed
    }

    fn send_state(&mut self, body: Map<String, Value>, periodic: bool) {
        let mut kept = body.clone();
        if self.faults.has(F::R4ResultDescriptionOnlyInFirstState) {
            self.note_results(&mut kept);
        }
        self.report.periodic = periodic;
        let times = match () {
            () if self.faults.has(F::StateBursts) => 5,
            () if self.takes(T::EveryStateTwice) => 2,
            () => 1,
        };
        if !self.swallows_state() {
            let body = self.shown_state(body);
            for _ in 0..times {
                self.publish("state", body.clone());
            }
        }
        let next_visualization = self.report.next_visualization;
        self.report = Report {
            last: Some((self.moment(), kept)),
            next_visualization,
            ..Report::default()
        };
        self.states_sent += 1;
        if self.takes(T::R2OnlineAgain) && self.states_sent.is_multiple_of(10) {
            self.publish_connection("ONLINE");
        }
        if self.takes(T::FactsheetAgain) && self.states_sent.is_multiple_of(10) {
            self.publish_factsheet();
        }
    }

    fn publish_visualization(&mut self) {
        let mut body = Map::new();
        if !self.config.line_guided() {
            body.insert("agvPosition".into(), self.position_picture());
        }
        body.insert("velocity".into(), self.velocity_picture());
        self.says(Part::Visualization, &mut body);
        let body = self.shown_visualization(body);
        self.publish("visualization", body);
    }
}
