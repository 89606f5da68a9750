//! Personas: how a mock vehicle deviates when a test of a master control tells it to.
//!
//! Each word of [`tck_profile::VEHICLE_WORDS`] that a vehicle does not know by itself is one way to be awkward. A
//! [`Persona`] holds what was told, and takes hold at the hook points of the vehicle; all of it ends together, with
//! `well-behaved` or `reset`.

mod asking;
mod declared;
mod orders;
mod speech;
mod told;
mod words;

use std::time::Duration;

use serde_json::{Map, Value, json};

use crate::agv::action_effect::{Outcome, Problem};
use crate::agv::action_kinds::Effect;
use crate::agv::actions::{Action, Status};
use crate::agv::errors::{ActiveError, Life};
use crate::agv::hooks::{Deviation, Event, Head, Leg, Outgoing, Part, Permission, Span};
use crate::agv::{Agv, AgvConfig};
use tck_base::clock::Moment;

use asking::Asking;
use orders::Rejection;
pub use words::WORDS;

/// No test waits longer than this.
const LONGEST: f64 = 86_400.0;

/// What makes a vehicle listen to such words.
pub(super) fn persona() -> Box<dyn Deviation> {
    Box::new(Persona::default())
}

/// What a test has told the vehicle; nothing by default.
#[derive(Clone, Debug, Default, PartialEq)]
struct Persona {
    /// Messages lie so long before they are looked at.
    answers_after: Option<Duration>,
    /// At least so long between two states.
    state_interval: Duration,
    /// How many states are lost on the way.
    lost_states: u64,
    /// It publishes no state.
    silent: bool,
    /// How many orders are ignored.
    ignored_orders: u64,
    new_orders: Option<Rejection>,
    updates: Option<Rejection>,
    /// cancelOrder stays RUNNING for so long.
    cancel_lasts: Option<Duration>,
    /// cancelOrder stays RUNNING until told otherwise.
    cancel_stuck: bool,
    /// When the cancelOrder under way may end.
    cancel_held_until: Option<Moment>,
    /// actionType, if only one fails, and the errorType.
    failing: Option<(Option<String>, String)>,
    /// What fails is RETRIABLE where that was asked for.
    may_retry: bool,
    /// errorType for every downloadMap.
    map_refusal: Option<String>,
    /// It asks for a longer base.
    wants_base: bool,
    /// batteryCharge.
    charge: Option<f64>,
    /// It stands where it is.
    halted: bool,
    /// It will stand before it reaches this node.
    stop_before: Option<String>,
    /// The headers name this version.
    version: Option<String>,
    /// Its last will is old.
    stale_will: bool,
    /// What it asks the master control for.
    asking: Asking,
    /// What is laid over the states, the visualization and the factsheet.
    state: Option<Value>,
    visualization: Option<Value>,
    factsheet: Option<Value>,
    /// How the vehicle was before it declared something else.
    factory: Option<Box<AgvConfig>>,
    /// A retained message was replaced and has to be put right.
    replaced: bool,
}

impl Persona {
    /// The errorType with which an action fails.
    fn failure_of(&self, action: &Action) -> Option<&String> {
        if is(action, Effect::DownloadMap) && action.status == Status::Waiting && self.map_refusal.is_some() {
            return self.map_refusal.as_ref();
        }
        let (wanted, error_type) = self.failing.as_ref()?;
        let meant = wanted
            .as_ref()
            .map_or(action.of_order(), |wanted| *wanted == action.request.action_type);
        meant.then_some(error_type)
    }

    /// Stands from now on if it was told to do so before the node ahead.
    fn stand_if_told(&mut self, agv: &Agv) {
        let ahead = agv.order.nodes.front();
        if ahead.is_some_and(|stop| self.stop_before.as_ref() == Some(&stop.node.id)) {
            (self.halted, self.stop_before) = (true, None);
        }
    }
}

impl Deviation for Persona {
    fn asked(&mut self, agv: &mut Agv, name: &str, arguments: &Value) -> bool {
        !self.told(agv, name, arguments)
    }

    fn heads(&mut self, agv: &mut Agv, head: Head, header: &mut Map<String, Value>) {
        if let Some(version) = &self.version {
            header.insert("version".into(), json!(version));
        }
        if self.stale_will && !head.counts {
            let utc = agv.now.utc;
            let long_ago = utc.checked_sub(jiff::SignedDuration::from_hours(24)).unwrap_or(utc);
            header.insert("headerId".into(), json!(0));
            header.insert("timestamp".into(), json!(format!("{long_ago:.2}")));
        }
    }

    fn says(&self, _: &Agv, part: Part<'_>, words: &mut Map<String, Value>) -> bool {
        if matches!(part, Part::State) {
            self.says_in_state(words);
            self.asking.says(words);
        }
        true
    }

    fn sends(&mut self, _: &mut Agv, outgoing: &mut Outgoing) -> bool {
        if outgoing.name == "state" && self.lost_states > 0 {
            self.lost_states -= 1;
            return false;
        }
        let patch = match outgoing.name {
            "state" => &self.state,
            "visualization" => &self.visualization,
            "factsheet" => &self.factsheet,
            _ => &None,
        };
        speech::lay_over(patch.as_ref(), &mut outgoing.message);
        true
    }

    fn allows(&self, _: &Agv, what: Permission<'_>, usual: bool) -> bool {
        match what {
            Permission::Say("state", _) => usual && !self.silent,
            Permission::Drive => usual && !self.halted,
            Permission::EndCancel => usual && self.cancel_held_until.is_none() && !self.cancel_stuck,
            _ => usual,
        }
    }

    fn lasts(&self, _: &Agv, what: Span<'_>, usual: Duration) -> Duration {
        match what {
            Span::Answer => self.answers_after.unwrap_or(usual),
            Span::BetweenStates | Span::LeastBetweenStates => usual.max(self.state_interval),
            _ => usual,
        }
    }

    fn hears(&mut self, agv: &mut Agv, name: &str, payload: &[u8]) -> bool {
        if name == "responses" {
            self.asking.answered(agv, payload);
        }
        name != "order" || !(self.ignores_order() || self.rejects(agv, payload))
    }

    fn plans(&self, _: &Agv, leg: &mut Leg<'_>) {
        if leg.to_node && self.stop_before.as_ref() == Some(&leg.stop.node.id) {
            (leg.way, leg.to_node) = (leg.distance / 2.0, false);
        }
    }

    fn does(&mut self, agv: &mut Agv, action: &Action) -> Option<Outcome> {
        let error_type = self.failure_of(action)?.clone();
        let problem = Problem::unable(action, "the action did not succeed");
        if self.may_retry && action.request.retriable {
            agv.waits_for_retry(&action.request.id);
        } else {
            agv.end_failed(&action.request.id);
        }
        agv.errors.raise(ActiveError {
            error_type,
            fatal: false,
            references: problem.references,
            description: problem.reason,
            life: Life::Until(agv.moment() + agv.config.error_duration),
        });
        Some(Outcome::Open)
    }

    fn due(&self, _: &Agv) -> Option<Moment> {
        self.cancel_held_until.into_iter().chain(self.asking.due()).min()
    }

    fn stirs(&self, _: &Agv) -> bool {
        *self != Self::default()
    }

    fn happens(&mut self, agv: &mut Agv, event: Event) {
        match event {
            Event::LegEnded => self.stand_if_told(agv),
            Event::CancelBegun => self.cancel_held_until = self.cancel_lasts.map(|lasts| agv.moment() + lasts),
            Event::Woken => {
                self.cancel_held_until = self.cancel_held_until.filter(|until| *until > agv.moment());
                self.asking.expire(agv);
            }
            _ => {}
        }
    }
}

fn is(action: &Action, effect: Effect) -> bool {
    action.kind.is_some_and(|kind| kind.effect == effect)
}
