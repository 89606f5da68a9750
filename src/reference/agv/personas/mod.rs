//! Personas: how a mock vehicle deviates when a test of a master control tells it to.
//!
//! A [`Persona`] holds what was told. The vehicle asks for it at its points of decision, in words of its own (such as
//! `is_told_to_stand`). All of it ends together, with `well-behaved` or `reset`.

mod declared;
mod orders;
mod speech;

use std::time::Duration;

use serde_json::{Value, json};

use crate::clock::Moment;
use crate::reference::Output;

use super::actions::{Action, Status};
use super::deeds::Problem;
use super::errors::{ActiveError, Life};
use super::{Agv, AgvConfig};

pub(super) use orders::Rejection;

/// No test waits longer than this.
const LONGEST: f64 = 86_400.0;

/// What a test has told the vehicle; nothing by default.
#[derive(Clone, Debug, Default)]
pub(super) struct Persona {
    /// Messages lie so long before they are looked at.
    pub(super) answers_after: Option<Duration>,
    /// At least so long between two states.
    pub(super) state_interval: Option<Duration>,
    /// So many states are lost on the way.
    lost_states: u64,
    /// It publishes no state.
    silent: bool,
    /// So many orders are ignored.
    ignored_orders: u64,
    new_orders: Option<Rejection>,
    updates: Option<Rejection>,
    /// cancelOrder stays RUNNING for so long.
    cancel_lasts: Option<Duration>,
    /// cancelOrder stays RUNNING until told otherwise.
    cancel_stuck: bool,
    /// When the cancelOrder under way may end.
    pub(super) cancel_held_until: Option<Moment>,
    /// actionType, if only one fails, and the errorType.
    failing: Option<(Option<String>, String)>,
    /// errorType for every downloadMap.
    pub(super) map_refusal: Option<String>,
    /// It asks for a longer base.
    pub(super) wants_base: bool,
    /// batteryCharge.
    pub(super) charge: Option<f64>,
    /// It does not know where it is.
    pub(super) lost: bool,
    /// It stands where it is.
    pub(super) halted: bool,
    /// It will stand before it reaches this node.
    pub(super) stop_before: Option<String>,
    /// The headers name this version.
    pub(super) version: Option<String>,
    /// Its last will is old.
    pub(super) stale_will: bool,
    /// What is laid over the states, the visualization and the factsheet.
    state: Option<Value>,
    visualization: Option<Value>,
    factsheet: Option<Value>,
    /// How the vehicle was before it declared something else.
    factory: Option<Box<AgvConfig>>,
    /// What the factsheet says about ids.
    ids: declared::Ids,
    /// A retained message was replaced and has to be put right.
    replaced: bool,
}

impl Persona {
    /// When something it was told runs out.
    pub(super) fn next_end(&self) -> Option<Moment> {
        self.cancel_held_until
    }

    /// Forgets what has run out.
    pub(super) fn expire(&mut self, now: Moment) {
        self.cancel_held_until = self.cancel_held_until.filter(|until| *until > now);
    }

    /// A cancelOrder begins.
    pub(super) fn cancel_begins(&mut self, now: Moment) {
        self.cancel_held_until = self.cancel_lasts.map(|lasts| now + lasts);
    }

    /// Whether the cancelOrder under way must not end yet.
    pub(super) fn holds_cancel(&self) -> bool {
        self.cancel_held_until.is_some() || self.cancel_stuck
    }

    /// The errorType with which an action fails.
    pub(super) fn failure_of(&self, action_type: &str, of_order: bool) -> Option<String> {
        let (wanted, error_type) = self.failing.as_ref()?;
        let meant = wanted.as_ref().map_or(of_order, |wanted| wanted == action_type);
        meant.then(|| error_type.clone())
    }
}

/// What a word says, read leniently: a test was linted before.
struct Told<'a>(&'a Value);

impl Told<'_> {
    fn text(&self, key: &str) -> Option<String> {
        let text = self.0.get(key)?.as_str()?;
        Some(text.to_owned()).filter(|text| !text.is_empty())
    }

    fn time(&self, key: &str) -> Option<Duration> {
        let seconds = self.0.get(key)?.as_f64()?;
        Some(Duration::from_secs_f64(seconds.clamp(0.0, LONGEST)))
    }

    fn count(&self, usual: u64) -> u64 {
        self.0.get("count").and_then(Value::as_u64).unwrap_or(usual)
    }

    fn flag(&self, key: &str) -> Option<bool> {
        self.0.get(key)?.as_bool()
    }

    /// A merge patch; `None` when it says nothing.
    fn patch(&self, key: &str) -> Option<Value> {
        let patch = self.0.get(key)?;
        patch
            .as_object()
            .is_some_and(|members| !members.is_empty())
            .then(|| patch.clone())
    }
}

impl Agv {
    /// Whether it was told to stand where it is.
    pub(super) fn is_told_to_stand(&self) -> bool {
        self.persona.halted || self.persona.lost
    }

    /// Stands from now on if it was told to do so before the node ahead.
    pub(super) fn stand_as_told(&mut self) {
        let ahead = self.book.nodes.front();
        if ahead.is_some_and(|stop| self.stops_before(&stop.node.id)) {
            (self.persona.halted, self.persona.stop_before) = (true, None);
        }
    }

    /// Whether it was told that it does not know where it is.
    pub(super) fn is_told_to_be_lost(&self) -> bool {
        self.persona.lost
    }

    /// It knows where it is.
    pub(super) fn find_position(&mut self) {
        self.persona.lost = false;
    }

    /// Whether it was told to ask for a longer base.
    pub(super) fn is_told_to_want_base(&self) -> bool {
        self.persona.wants_base
    }

    /// The batteryCharge it was told.
    pub(super) fn told_charge(&self) -> Option<f64> {
        self.persona.charge
    }

    /// The least time between two states it was told.
    pub(super) fn told_state_interval(&self) -> Duration {
        self.persona.state_interval.unwrap_or_default()
    }

    /// How long it was told to let messages lie.
    pub(super) fn told_delay(&self) -> Option<Duration> {
        self.persona.answers_after
    }

    /// The version it was told to name.
    pub(super) fn told_version(&self) -> Option<&String> {
        self.persona.version.as_ref()
    }

    /// When something it was told runs out.
    pub(super) fn told_until(&self) -> Option<Moment> {
        self.persona.next_end()
    }

    /// Forgets what has run out.
    pub(super) fn forget_what_was_told_until(&mut self, now: Moment) {
        self.persona.expire(now);
    }

    /// A cancelOrder begins, and lasts as long as it was told.
    pub(super) fn hold_cancel_as_told(&mut self) {
        let now = self.moment();
        self.persona.cancel_begins(now);
    }

    /// Whether the cancelOrder under way must not end yet.
    pub(super) fn holds_cancel_as_told(&self) -> bool {
        self.persona.holds_cancel()
    }

    /// Fails an action it was told to fail; whether it was one.
    pub(super) fn fails_as_told(&mut self, action: &Action) -> bool {
        let told = self.persona.failure_of(&action.request.action_type, action.of_order());
        self.fail_with(action, told)
    }

    /// Fails a download it was told to refuse; whether it was.
    pub(super) fn refuses_map_as_told(&mut self, action: &Action) -> bool {
        self.fail_with(action, self.persona.map_refusal.clone())
    }

    fn fail_with(&mut self, action: &Action, error_type: Option<String>) -> bool {
        let Some(error_type) = error_type else { return false };
        let problem = Problem::unable(action, "the action did not succeed");
        if let Some(action) = self.actions.get_mut(&action.request.id) {
            action.end(Status::Failed);
        }
        self.errors.raise(ActiveError {
            error_type,
            fatal: false,
            references: problem.references,
            description: problem.reason,
            life: Life::Until(self.moment() + self.config.error_duration),
        });
        true
    }

    /// Gives a last will the date it was told.
    pub(super) fn date_back_as_told(&self, message: &mut serde_json::Map<String, Value>) {
        if self.persona.stale_will {
            let utc = self.now.utc;
            let long_ago = utc.checked_sub(jiff::SignedDuration::from_hours(24)).unwrap_or(utc);
            message.insert("headerId".into(), json!(0));
            message.insert("timestamp".into(), json!(format!("{long_ago:.2}")));
        }
    }

    /// A word about how to behave; whether it is one. A state tells what it changed.
    pub(super) fn told_how_to_behave(&mut self, name: &str, arguments: &Value) -> bool {
        let told = Told(arguments);
        let persona = &mut self.persona;
        match name {
            "answer-after" => persona.answers_after = told.time("seconds"),
            "state-interval" => persona.state_interval = told.time("seconds"),
            "lose-states" => {
                persona.lost_states = told.count(1);
                return true;
            }
            "stay-silent" => persona.silent = true,
            "ignore-orders" => persona.ignored_orders = told.count(u64::MAX),
            "reject-orders" => persona.new_orders = Rejection::told(&told),
            "reject-updates" => persona.updates = Rejection::told(&told),
            "hold-cancel" => {
                persona.cancel_lasts = told.time("seconds");
                persona.cancel_stuck = persona.cancel_lasts.is_none();
            }
            "fail-actions" => {
                let error_type = told.text("errorType").unwrap_or_else(|| "actionFailed".to_owned());
                persona.failing = Some((told.text("actionType"), error_type));
            }
            "refuse-map" => {
                let usual = || self.config.errors.map.clone();
                persona.map_refusal = Some(told.text("errorType").unwrap_or_else(usual));
            }
            "request-new-base" => persona.wants_base = told.flag("on").unwrap_or(true),
            "set-battery" => {
                let charge = arguments.get("charge").and_then(Value::as_f64);
                persona.charge = charge.map(|charge| charge.clamp(0.0, 100.0)).or(persona.charge);
                self.charging = told.flag("charging").unwrap_or(self.charging);
            }
            "lose-position" => persona.lost = true,
            "find-position" => persona.lost = false,
            "halt" => persona.halted = true,
            "go-on" => (persona.halted, persona.stop_before) = (false, None),
            "stop-before" => self.stop_before(told.text("nodeId")),
            "speak-version" => persona.version = told.text("version"),
            "stale-will" => persona.stale_will = true,
            "break-off" => self.break_off(),
            "declare" => self.declare(told.patch("factsheet")),
            "show" => persona.state = told.patch("state"),
            "show-visualization" => {
                persona.visualization = told.patch("visualization");
                return true;
            }
            "publish" => {
                self.publish_as_told(arguments);
                return true;
            }
            "well-behaved" => self.behave_well(),
            "reset" => self.reset(told.text("nodeId").as_deref()),
            _ => return false,
        }
        self.report.requested = true;
        true
    }

    /// A leg that is under way is planned anew.
    fn stop_before(&mut self, node: Option<String>) {
        self.persona.stop_before = node;
        let moment = self.moment();
        if self.motion.is_moving() {
            self.motion.halt(moment);
        }
    }

    /// Whether the leg ahead ends before its node, because of `stop-before`.
    pub(super) fn stops_before(&self, node_id: &str) -> bool {
        self.persona.stop_before.as_deref() == Some(node_id)
    }

    /// The connection is gone, and nobody restores it.
    fn break_off(&mut self) {
        if self.connection.online {
            self.pending.push(Output::Drop);
        }
        self.connection.stays_away();
    }

    /// All deviations end.
    fn behave_well(&mut self) {
        self.declare_nothing();
        let persona = std::mem::take(&mut self.persona);
        if persona.replaced {
            self.republish();
        }
    }

    /// As new from the factory, but connected as it is.
    fn reset(&mut self, node: Option<&str>) {
        self.declare_nothing();
        let mut config = self.config.clone();
        if let Some(node) = node.filter(|node| config.node(node).is_some()) {
            node.clone_into(&mut config.start_node);
        }
        let mut fresh = Self::new(config);
        self.downloads.clear();
        std::mem::swap(&mut fresh.config.start_node, &mut self.config.start_node);
        std::mem::swap(&mut fresh.seam, &mut self.seam);
        fresh.now = self.now;
        fresh.states_sent = self.states_sent;
        fresh.logs = self.logs;
        std::mem::swap(&mut fresh.connection, &mut self.connection);
        std::mem::swap(&mut fresh.report, &mut self.report);
        std::mem::swap(&mut fresh.pending, &mut self.pending);
        std::mem::swap(&mut fresh.downloads, &mut self.downloads);
        let replaced = self.persona.replaced;
        *self = fresh;
        if self.connection.online {
            if replaced {
                self.republish();
            }
        } else {
            self.connection.wanted_at(self.now.moment);
        }
    }
}
