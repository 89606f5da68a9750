//! The state message: when it is sent, and the visualization beside it (sections 6.10 and 6.13).
//!
//! A state is due when it differs from the last one in anything but position, speed and battery charge. So no part of
//! the vehicle has to remember to announce what it changed, and changes of one instant share a state (the ruling of
//! STATE-09). What happens before minStateInterval is over is reported at its end (that of FACT-14), an order at once,
//! also a refused one (that of STATE-03).

mod picture;
mod rest;
mod route;

pub(crate) use rest::Rest;

use std::time::Duration;

use serde_json::{Map, Value, json};

use tck_base::clock::Moment;
use tck_view::VisualizationView;

use super::Agv;
use super::hook_points::{Event, Part, Permission, Span};

/// State reporting: what has been reported, and when the next state is due.
#[derive(Clone, Debug, Default)]
pub(crate) struct Report {
    /// An order message arrived (STATE-03).
    pub(crate) order_received: bool,
    /// A state was asked for (ACT-26).
    pub(crate) requested: bool,
    /// The state that is sent now is sent because it is time.
    pub(crate) periodic: bool,
    /// No state before the next periodic one.
    pub(crate) silenced: bool,
    /// The last state, without its header, and when it was sent.
    pub(crate) last: Option<(Moment, Map<String, Value>)>,
    /// A state is due and only waits for the minimum interval.
    pub(crate) delayed: bool,
    pub(crate) next_visualization: Option<Moment>,
    /// No state before this.
    pub(crate) silent_until: Option<Moment>,
}

impl Report {
    /// Whether the last state is all there is to say.
    fn is_complete(&self) -> bool {
        let open = self.order_received || self.requested || self.silenced || self.delayed;
        self.last.is_some() && self.silent_until.is_none() && !open
    }

    /// Whether the state that is sent now answers a request, and is not the first one.
    pub(crate) fn answers_request(&self) -> bool {
        self.requested && self.last.is_some()
    }
}

/// Members that change without being an event.
const SILENT: [&str; 6] = [
    "agvPosition",
    "velocity",
    "batteryState",
    "distanceSinceLastNode",
    "plannedPath",
    "intermediatePath",
];

/// Differences between two states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Changes {
    /// An order came (STATE-03).
    pub(crate) order: bool,
    /// loads (STATE-04).
    pub(crate) load: bool,
    /// errors (STATE-05).
    pub(crate) error: bool,
    /// The last node (STATE-06).
    pub(crate) node: bool,
    /// operatingMode (STATE-07).
    pub(crate) mode: bool,
    /// driving (STATE-08).
    pub(crate) driving: bool,
    /// actionStates (STATE-09).
    pub(crate) actions: bool,
    /// maps (STATE-10).
    pub(crate) maps: bool,
    /// zoneSets (STATE-23).
    pub(crate) zone_sets: bool,
    /// edgeRequests or zoneRequests (STATE-21).
    pub(crate) requests: bool,
    /// Anything else.
    pub(crate) other: bool,
}

/// Whether a change is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Telling {
    /// In a state of its own.
    Now,
    /// Never by itself.
    Never,
    /// Not yet.
    Later,
}

impl Changes {
    pub(crate) fn between(old: &Map<String, Value>, new: &Map<String, Value>) -> Self {
        let mut changes = Self::default();
        let keys = new.keys().chain(old.keys().filter(|key| !new.contains_key(*key)));
        for key in keys.filter(|key| !SILENT.contains(&key.as_str()) && old.get(*key) != new.get(*key)) {
            match key.as_str() {
                "loads" => changes.load = true,
                "errors" => changes.error = true,
                "lastNodeId" | "lastNodeSequenceId" => changes.node = true,
                "operatingMode" => changes.mode = true,
                "driving" => changes.driving = true,
                "actionStates" | "instantActionStates" | "zoneActionStates" => changes.actions = true,
                "maps" => changes.maps = true,
                "zoneSets" => changes.zone_sets = true,
                "edgeRequests" | "zoneRequests" => changes.requests = true,
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

    pub(crate) fn any(self) -> bool {
        self != Self::default()
    }
}

impl Agv {
    /// Begins to report on a new connection.
    pub(crate) fn start_reporting(&mut self) {
        self.report.last = None;
        self.report.requested = true;
        self.report.silent_until = None;
        self.happens(Event::Reporting);
        self.report.next_visualization = self.visualization_interval().map(|_| self.moment());
    }

    /// The shortest time between two states.
    pub(crate) fn min_state_interval(&self) -> Duration {
        self.lasts(Span::LeastBetweenStates, self.config.min_state_interval)
    }

    fn state_interval(&self) -> Duration {
        self.lasts(Span::BetweenStates, self.stated_interval())
    }

    /// The interval the factsheet promises (FACT-14).
    pub(crate) fn stated_interval(&self) -> Duration {
        self.lasts(Span::StatedBetweenStates, self.config.state_interval)
    }

    fn visualization_interval(&self) -> Option<Duration> {
        let stated = self.config.visualization_interval;
        stated.map(|interval| self.lasts(Span::BetweenVisualizations, interval))
    }

    /// When the next message goes out by the clock.
    pub(crate) fn next_report(&self) -> Option<Moment> {
        if !self.connection.online || self.is_mute() {
            return None;
        }
        if self.report.silent_until.is_some() {
            return self.report.silent_until;
        }
        if !self.allows(Permission::Report, true) {
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

    /// Publishes what is due.
    pub(crate) fn flush(&mut self) {
        if !self.connection.online || self.is_mute() {
            self.report.order_received = false;
            self.report.requested = false;
            return;
        }
        self.flush_state();
        if self.takes_visualization() {
            self.publish_visualization();
        }
    }

    /// Whether a visualization is due now; the next one is then later.
    fn takes_visualization(&mut self) -> bool {
        let moment = self.moment();
        let due = self.report.next_visualization.filter(|next| *next <= moment);
        let (Some(due), Some(interval)) = (due, self.visualization_interval()) else {
            return false;
        };
        let next = due + interval;
        self.report.next_visualization = Some(if next > moment { next } else { moment + interval });
        true
    }

    fn flush_state(&mut self) {
        let moment = self.moment();
        if self.report.silent_until.is_some_and(|until| until > moment) || !self.allows(Permission::Report, true) {
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
        } else if (changes.any() || requested) && self.is_told(changes, requested, &body) {
            if too_soon {
                self.report.delayed = true;
            } else {
                self.send_state(body, false);
            }
        }
    }

    /// Whether a change is told in a state. One that never is counts as told.
    fn is_told(&mut self, changes: Changes, requested: bool, body: &Map<String, Value>) -> bool {
        let telling = match self.report.silenced {
            true => Telling::Later,
            false => self.tells(changes, requested),
        };
        if telling == Telling::Never
            && let Some((_, last)) = &mut self.report.last
        {
            last.clone_from(body);
        }
        telling == Telling::Now
    }

    fn send_state(&mut self, body: Map<String, Value>, periodic: bool) {
        let kept = body.clone();
        self.report.periodic = periodic;
        self.publish("state", body);
        let next_visualization = self.report.next_visualization;
        self.report = Report {
            last: Some((self.moment(), kept)),
            next_visualization,
            ..Report::default()
        };
        self.states_sent += 1;
        self.happens(Event::StateSent);
    }

    fn publish_visualization(&mut self) {
        let mut body = Map::new();
        if !self.config.line_guided() {
            body.insert("agvPosition".into(), self.position_picture());
        }
        body.insert("velocity".into(), self.velocity_picture());
        if !self.config.names.lacks(VisualizationView::reference_state_header_id) {
            body.insert(
                "referenceStateHeaderId".into(),
                json!(self.connection.last_header_id("state")),
            );
        }
        self.share_paths(&mut body);
        self.says(Part::Visualization, &mut body);
        self.publish("visualization", body);
    }
}
