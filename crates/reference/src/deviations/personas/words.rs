//! The words themselves, and what each changes.

use serde_json::Value;

use super::Persona;
use super::orders::Rejection;
use super::speech::republish;
use super::told::Told;
use crate::Output;
use crate::agv::Agv;

/// The words that a mock vehicle knows beyond the commands of every vehicle.
pub const WORDS: &[&str] = &[
    "reset",
    "well-behaved",
    "break-off",
    "stale-will",
    "halt",
    "stop-before",
    "go-on",
    "set-battery",
    "request-new-base",
    "answer-after",
    "state-interval",
    "lose-states",
    "stay-silent",
    "ignore-orders",
    "reject-orders",
    "reject-updates",
    "hold-cancel",
    "fail-actions",
    "refuse-map",
    "fall-asleep",
    "wake-up",
    "ask-for-zone",
    "ask-for-corridor",
    "withdraw-requests",
    "hold-requests",
    "declare",
    "show",
    "show-visualization",
    "publish",
    "speak-version",
];

impl Persona {
    /// A word about how to behave; whether it is one. A state tells what it changed.
    pub(super) fn told(&mut self, agv: &mut Agv, name: &str, arguments: &Value) -> bool {
        let told = Told(arguments);
        match name {
            "answer-after" => self.answers_after = told.time("seconds"),
            "state-interval" => self.state_interval = told.time("seconds").unwrap_or_default(),
            "lose-states" => {
                self.lost_states = told.count(1);
                return true;
            }
            "stay-silent" => self.silent = true,
            "ignore-orders" => self.ignored_orders = told.count(u64::MAX),
            "reject-orders" => self.new_orders = Rejection::told(&told),
            "reject-updates" => self.updates = Rejection::told(&told),
            "hold-cancel" => {
                self.cancel_lasts = told.time("seconds");
                self.cancel_stuck = self.cancel_lasts.is_none();
            }
            "fail-actions" => {
                let error_type = told.text("errorType").unwrap_or_else(|| "actionFailed".to_owned());
                self.failing = Some((told.text("actionType"), error_type));
                self.may_retry = told.flag("retriable") == Some(true);
            }
            "refuse-map" => {
                let usual = || agv.config.errors.map.clone();
                self.map_refusal = Some(told.text("errorType").unwrap_or_else(usual));
            }
            "fall-asleep" => agv.falls_asleep(),
            "wake-up" if agv.sleep.asleep => agv.wakes_up(),
            "wake-up" => {}
            "ask-for-zone" => self.asking.for_zone(agv, &told),
            "ask-for-corridor" => self.asking.for_corridor(agv, &told),
            "withdraw-requests" => self.asking.withdraw(told.text("requestId").as_deref()),
            "hold-requests" => self.asking.hold(told.text("status").as_deref()),
            "request-new-base" => self.wants_base = told.flag("on").unwrap_or(true),
            "set-battery" => {
                let charge = arguments.get("charge").and_then(Value::as_f64);
                self.charge = charge.map(|charge| charge.clamp(0.0, 100.0)).or(self.charge);
                agv.charging = told.flag("charging").unwrap_or(agv.charging);
            }
            "halt" => self.halted = true,
            "go-on" => (self.halted, self.stop_before) = (false, None),
            "stop-before" => self.stop_before(agv, told.text("nodeId")),
            "speak-version" => self.version = told.text("version"),
            "stale-will" => self.stale_will = true,
            "break-off" => break_off(agv),
            "declare" => self.declare(agv, told.patch("factsheet")),
            "show" => self.state = told.patch("state"),
            "show-visualization" => {
                self.visualization = told.patch("visualization");
                return true;
            }
            "publish" => {
                self.publish(agv, arguments);
                return true;
            }
            "well-behaved" => self.behave_well(agv),
            "reset" => self.reset(agv, told.text("nodeId").as_deref()),
            _ => return false,
        }
        agv.report.requested = true;
        true
    }

    /// A leg that is under way is planned anew.
    fn stop_before(&mut self, agv: &mut Agv, node: Option<String>) {
        self.stop_before = node;
        let moment = agv.moment();
        if agv.motion.is_moving() {
            agv.motion.halt(moment);
        }
    }

    /// All that was told ends, and what the vehicle has brought away stands where it stood before.
    fn behave_well(&mut self, agv: &mut Agv) {
        if agv.loads.is_empty() {
            agv.stations.clone_from(&agv.config.stations);
        }
        agv.find_position();
        self.declare_nothing(agv);
        if std::mem::take(self).replaced {
            republish(agv);
        }
    }

    /// As new from the factory, but connected as it is.
    fn reset(&mut self, agv: &mut Agv, node: Option<&str>) {
        self.declare_nothing(agv);
        renew(agv, node);
        let replaced = std::mem::take(self).replaced;
        if agv.connection.online {
            if replaced {
                republish(agv);
            }
        } else {
            agv.connection.wanted_at(agv.now.moment);
        }
    }
}

/// As new from the factory, but connected as it is.
fn renew(agv: &mut Agv, node: Option<&str>) {
    let mut config = agv.config.clone();
    if let Some(node) = node.filter(|node| config.node(node).is_some()) {
        node.clone_into(&mut config.start_node);
    }
    let mut fresh = Agv::new(config);
    agv.downloads.clear();
    std::mem::swap(&mut fresh.config.start_node, &mut agv.config.start_node);
    std::mem::swap(&mut fresh.hooks, &mut agv.hooks);
    fresh.now = agv.now;
    fresh.states_sent = agv.states_sent;
    fresh.logs = agv.logs;
    std::mem::swap(&mut fresh.connection, &mut agv.connection);
    std::mem::swap(&mut fresh.report, &mut agv.report);
    std::mem::swap(&mut fresh.pending, &mut agv.pending);
    std::mem::swap(&mut fresh.downloads, &mut agv.downloads);
    *agv = fresh;
}

/// The connection is gone, and nobody restores it.
fn break_off(agv: &mut Agv) {
    if agv.connection.online {
        agv.pending.push(Output::Drop);
    }
    agv.connection.stays_away();
}
