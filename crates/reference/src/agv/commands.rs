//! What people and tests do to the vehicle: buttons, switches, moving it by hand (modes: section 6.10.6; errors:
//! 6.10.5).
//!
//! What resolves itself is a WARNING, and FATAL what somebody has to see to (the ruling of ERR-03).

use serde_json::{Value, json};

use crate::Output;

use super::errors::{ActiveError, Life};
use super::hook_points::{Cause, Event, Permission};
use super::motion::Pose;
use super::order_state::OrderState;
use super::{Agv, Mode};

/// The commands of [`crate::Input::Command`]; unknown ones are ignored.
///
/// The effect and the arguments of each are described in [`tck_profile::VEHICLE_WORDS`].
pub const COMMANDS: &[&str] = &[
    "power-cycle",
    "shutdown",
    "start",
    "trigger",
    "set-mode",
    "place-on",
    "move-to",
    "push-out",
    "shift-position",
    "place-obstacle",
    "remove-obstacle",
    "drive-manually",
    "provoke-error",
    "clear-error",
    "emergency-stop",
    "release-emergency-stop",
    "press-pause",
    "release-pause",
    "block-pause",
    "unblock-pause",
    "lose-position",
    "find-position",
    "block-hibernation",
    "unblock-hibernation",
    "lock-charger",
    "unlock-charger",
    "use-lift",
    "enable-map",
    "enter-field",
    "leave-field",
    "place-load",
    "remove-load",
];

/// More things than this do not stand about.
const MAX_OBSTACLES: usize = 100;

/// How far off a mark on the floor can be read, in metres.
const MARK: f64 = 0.3;

impl Agv {
    pub(crate) fn command(&mut self, name: &str, arguments: &Value) {
        let text = |key: &str| arguments.get(key).and_then(Value::as_str).unwrap_or_default();
        if !self.asked(name, arguments) {
            return;
        }
        match name {
            "power-cycle" => self.power_cycle(),
            "shutdown" => self.shut_down(),
            "start" => self.connection.wanted_at(self.now.moment),
            "trigger" => self.trigger(text("actionId")),
            "set-mode" => self.set_mode(text("mode")),
            "place-on" => self.place_on(text("nodeId")),
            "move-to" if arguments.get("nodeId").is_some() => self.place_on(text("nodeId")),
            "move-to" => self.move_to(arguments),
            // To the vehicle it is the same whether it was moved or only its idea of where it is.
            "push-out" | "shift-position" => self.push_out(arguments.get("by").and_then(Value::as_f64)),
            "place-obstacle" if self.obstacles.len() < MAX_OBSTACLES => {
                self.obstacles.insert(text("edgeId").to_owned());
                self.sees_obstacle(text("edgeId"));
            }
            "remove-obstacle" => {
                self.obstacles.remove(text("edgeId"));
            }
            "drive-manually" => self.drive_manually(),
            "provoke-error" => self.provoke_error(text("errorLevel"), text("errorType")),
            "clear-error" => self.clear_error(),
            "emergency-stop" => self.emergency_stop(),
            "release-emergency-stop" => {
                self.happens(Event::Releasing);
                self.errors.released();
                self.helped();
                self.set_holds(|holds| holds.emergency = false);
            }
            "press-pause" => self.set_holds(|holds| holds.button = true),
            "release-pause" => self.set_holds(|holds| holds.button = false),
            "block-pause" => self.pause_blocked = true,
            "unblock-pause" => self.pause_blocked = false,
            "lose-position" => self.lose_position(),
            "find-position" => self.find_position(),
            "block-hibernation" => self.sleep.blocked = true,
            "unblock-hibernation" => self.sleep.blocked = false,
            "lock-charger" => self.charger_locked = true,
            "unlock-charger" => self.charger_locked = false,
            "enter-field" => self.set_holds(|holds| holds.field = true),
            "leave-field" => {
                self.happens(Event::FieldFreed);
                self.set_holds(|holds| holds.field = false);
            }
            "enable-map" if self.allows(Permission::EnableByHand, true) => {
                // A map that is not on board cannot be chosen on the vehicle's panel.
                let _ = self.maps.enable(text("mapId"), text("mapVersion"));
            }
            "place-load" => self.place_load(text("loadId"), text("loadType")),
            "remove-load" => self.loads.clear(),
            // The vehicle sees nothing of a lift (`use-lift`): it is told where it is by initPosition.
            _ => {}
        }
    }

    /// Off and on again: the order is gone, the place, the maps and the load are not.
    fn power_cycle(&mut self) {
        let moment = self.moment();
        self.motion.halt(moment);
        self.motion.reached = false;
        let last_node = std::mem::take(&mut self.order.last_node);
        self.order = OrderState::empty(last_node);
        self.actions.clear();
        self.errors.clear();
        self.downloads.clear();
        self.heeding.begins_anew();
        self.holds = super::Holds::default();
        self.strayed = false;
        self.requests.clear();
        self.mode = Mode::Automatic;
        self.awaited_mode = None;
        self.charging = false;
        self.sleep = self.sleep.ended();
        self.report = super::Report::default();
        if self.connection.online {
            self.pending.push(Output::Drop);
        }
        self.connection.dropped(moment + self.config.reconnect_delay);
        self.connection.count_anew();
        self.happens(Event::PowerCycled);
    }

    /// Master control keeps its order only between the automatic modes (MODE-05).
    fn set_mode(&mut self, name: &str) {
        let mode = match name {
            "AUTOMATIC" => Mode::Automatic,
            "SEMIAUTOMATIC" => Mode::Semiautomatic,
            "MANUAL" => Mode::Manual,
            "SERVICE" => Mode::Service,
            "TEACHIN" | "TEACH_IN" => Mode::Teachin,
            "STARTUP" => Mode::Startup,
            "INTERVENED" => Mode::Intervened,
            _ => return,
        };
        let by_hand = !mode.keeps_orders() || !self.mode.keeps_orders();
        self.happens(Event::ModeChanging(mode));
        let kept = self.allows(Permission::KeepOrder(mode), !by_hand || mode == self.mode);
        if !kept && self.is_occupied() {
            if self.config.has("modesClear") && self.winds_up(mode) {
                return;
            }
            self.give_up_order();
            self.happens(Event::GivenUpForMode(mode));
        }
        self.enter_mode(mode);
    }

    /// What cannot be broken off ends before the mode is told (ORD-CLEAR-05, ORD-CLEAR-09); whether there is anything such.
    fn winds_up(&mut self, mode: Mode) -> bool {
        if !self.allows(Permission::EndActions, true) {
            return false;
        }
        self.stop_actions();
        let is_left = self.actions.order_unfinished();
        self.awaited_mode = is_left.then_some(mode);
        is_left
    }

    /// Goes over to a mode that had to wait, once no action of the order is left.
    pub(crate) fn settle_mode(&mut self) -> bool {
        if self.actions.order_unfinished() {
            return false;
        }
        let Some(mode) = self.awaited_mode.take() else {
            return false;
        };
        self.give_up_order();
        self.happens(Event::GivenUpForMode(mode));
        self.enter_mode(mode);
        true
    }

    /// Tells the mode, and no node any more where it cannot know what is done to it (MODE-15).
    fn enter_mode(&mut self, mode: Mode) {
        if mode.keeps_orders() {
            self.errors.available();
        }
        if self.config.has("modesClear") && matches!(mode, Mode::Service | Mode::Teachin | Mode::Startup) {
            self.order.last_node.clear();
        }
        if mode.takes_orders() && self.order.last_node.is_empty() {
            self.read_the_mark();
        }
        let before = std::mem::replace(&mut self.mode, mode);
        self.happens(Event::ModeChanged(before));
    }

    /// A vehicle that follows a line reads the mark it stands on, and needs nobody to tell it the node.
    fn read_the_mark(&mut self) {
        if self.config.branches.is_none() {
            return;
        }
        let pose = self.motion.pose(self.moment());
        let mark = self
            .config
            .nodes
            .iter()
            .find(|node| pose.distance(node.x, node.y) < MARK);
        if let Some(mark) = mark {
            self.order.last_node.clone_from(&mark.id);
            self.order.last_sequence = 0;
        }
    }

    /// Whether there is an order to be given up.
    pub(crate) fn is_occupied(&self) -> bool {
        !self.order.nodes.is_empty() || self.actions.order_unfinished() || self.order.cancel.is_some()
    }

    fn place_on(&mut self, node_id: &str) {
        let Some(node) = self.config.node(node_id).cloned() else {
            return;
        };
        if self.is_occupied() {
            self.give_up_order();
        }
        let theta = node.theta.unwrap_or(self.motion.pose(self.moment()).theta);
        self.motion.place(Pose {
            x: node.x,
            y: node.y,
            theta,
            map_id: node.map_id,
        });
        self.order.last_node = node.id;
        self.order.last_sequence = 0;
        self.is_back();
    }

    /// Pushed or steered by hand, which is only possible outside the automatic modes (MODE-06).
    fn move_to(&mut self, arguments: &Value) {
        if !self.allows(Permission::MoveByHand, !self.mode.takes_orders()) {
            return;
        }
        if let Some(node) = arguments.get("nodeId").and_then(Value::as_str) {
            self.place_on(node);
            return;
        }
        let mut pose = self.motion.pose(self.moment());
        let number = |key: &str| arguments.get(key).and_then(Value::as_f64);
        pose.x = number("x").unwrap_or(pose.x);
        pose.y = number("y").unwrap_or(pose.y);
        pose.theta = super::motion::wrapped(number("theta").unwrap_or(pose.theta));
        self.motion.place(pose);
        self.forgets_node();
        self.report.requested = true;
    }

    /// It is no more on its last node, where the version wants that to be noticed (MODE-14).
    fn forgets_node(&mut self) {
        let pose = self.motion.pose(self.moment());
        let node = self.config.node(&self.order.last_node);
        let far = node.is_some_and(|node| pose.distance(node.x, node.y) > self.config.reach);
        if far && self.config.has("modesClear") && self.allows(Permission::ForgetNode, true) {
            self.order.last_node.clear();
        }
    }

    /// A short way ahead, by hand.
    fn drive_manually(&mut self) {
        self.happens(Event::DrivenByHand);
        let pose = self.motion.pose(self.moment());
        let (x, y) = (pose.x + pose.theta.cos() / 2.0, pose.y + pose.theta.sin() / 2.0);
        self.move_to(&json!({ "x": x, "y": y }));
    }

    /// A defect of the vehicle: with a FATAL one it does not run (ERR-03, ERR-04, ERR-06).
    fn provoke_error(&mut self, level: &str, error_type: &str) {
        let fatal = level == "FATAL";
        level.clone_into(&mut self.errors.defect_level);
        let name = match error_type {
            "" if fatal => "scannerContaminated",
            "" => "maintenanceDue",
            named => named,
        };
        let error = ActiveError {
            error_type: name.to_owned(),
            fatal,
            references: Vec::new(),
            description: "a part of the vehicle is not in order".into(),
            life: Life::WhileDefective,
        };
        self.raise(Cause::Defect, error);
        let stops = self.allows(Permission::StopForDefect, fatal);
        self.set_holds(|holds| holds.defect |= stops);
    }

    fn clear_error(&mut self) {
        self.errors.cleared();
        self.helped();
        self.set_holds(|holds| holds.defect = false);
    }

    /// Somebody has seen to it: what was refused because of it may be sent again.
    pub(crate) fn helped(&mut self) {
        if self.mode.keeps_orders() && !self.errors.need_help() {
            self.errors.available();
        }
    }

    fn emergency_stop(&mut self) {
        self.set_holds(|holds| holds.emergency = true);
        let error = ActiveError {
            error_type: self.config.errors.emergency_stop.clone(),
            fatal: true,
            references: Vec::new(),
            description: "the emergency stop is pressed".into(),
            life: Life::WhileStopped,
        };
        self.raise(Cause::EmergencyStop, error);
    }

    fn place_load(&mut self, id: &str, load_type: &str) {
        if self.loads.is_empty() {
            let position = super::config::LOAD_POSITIONS[0].to_owned();
            self.loads.push(super::Load {
                id: id.to_owned(),
                kind: load_type.to_owned(),
                position,
            });
        }
    }
}
