//! `action/linked-state`: what the table of predefined actions links to an action is so in the state that reports its end.
//!
//! That the action ends, and well, is left to the tests.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde_json::Value;

use crate::finding::{broken, quote, show};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::Event;
use tck_pack::HookChange;
use tck_view::{ActionState, ActionView, Json, Member, Number, Pose, StateView, Text};
use tck_world::{Fact, Listen, Observation, Topic, sets_position};

/// How many actions are kept in mind.
const ACTIONS: usize = 1024;
/// How far a vehicle may be from the pose it was given: metres, and radians.
const BESIDE: (f64, f64) = (0.5, 0.35);
/// What a person or a hook has done may hold for so long.
const INFLUENCE: Duration = Duration::from_secs(120);

/// What the table of predefined actions links to an action is so in the state that reports its end.
pub(super) const LINKED_STATE: Check = Check {
    name: "action/linked-state",
    decides: &[
        "ACT-13",
        "ACT-15",
        "ACT-19",
        "ACT-23",
        "ACT-24",
        "MAP-24",
        "ORD-CANCEL-06",
        "ORD-CANCEL-07",
        "ORD-CANCEL-11",
        "STATE-MSG-08",
    ],
    doc: "The state that reports an action FINISHED for the first time shows what is linked to it: paused of startPause and \
          stopPause, batteryState.charging of startCharging and stopCharging, the pose (within half a metre and 20 degrees), \
          map and last node of initPosition, the one ENABLED version of enableMap; of startPause and cancelOrder also that \
          the vehicle stands, and of cancelOrder that no node or edge is left and every action of the order is over. Not \
          judged where another action on the same may have come in between, while the vehicle drives, after a restart, \
          while an emergency stop, the protective field, a mode or an error may hold it, and for two minutes after what \
          a person or a hook did to what is linked.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::action_states, StateView::driving, StateView::safety_state],
    start: |_| Box::new(Linked::default()),
};

/// An action that was sent.
#[derive(Clone)]
struct Known {
    kind: String,
    action: ActionView,
    /// The entry it was sent with.
    seq: u64,
}

#[derive(Default)]
struct Linked {
    known: BTreeMap<String, Known>,
    /// Actions of nodes and edges, and the entry with the last order.
    placed: BTreeSet<String>,
    ordered: u64,
    /// Seen FINISHED or FAILED.
    ended: BTreeSet<String>,
    /// When a person or a hook last had a hand in something.
    touched: BTreeMap<HookChange, Moment>,
    /// orderId of the last state, if there was one since the start or a restart.
    order: Option<String>,
}

/// What two actions may both change.
fn topic(kind: &str) -> Option<HookChange> {
    match kind {
        "startPause" | "stopPause" => Some(HookChange::Pause),
        "startCharging" | "stopCharging" => Some(HookChange::Charging),
        "enableMap" | "deleteMap" => Some(HookChange::Maps),
        "cancelOrder" => Some(HookChange::Order),
        kind if sets_position(kind) => Some(HookChange::Position),
        _ => None,
    }
}

/// What a hook may have changed beside the protocol, or a person.
fn touched<'c>(record: &Observation<'_>, context: &CheckContext<'c>) -> &'c [HookChange] {
    match record.event() {
        Event::Hook { hook, .. } => match context.hook(hook) {
            Some(hook) => hook.changes(),
            None => &HookChange::ALL,
        },
        Event::Answer { .. } => &HookChange::ALL,
        _ => &[],
    }
}

/// Whether the state shows nothing that may hold the vehicle, or let somebody else act on it.
fn nothing_holds(state: &StateView) -> bool {
    matches!(state.operating_mode.or_empty(), "AUTOMATIC" | "SEMIAUTOMATIC")
        && state.emergency_stop() == Some("NONE")
        && state.field_violation() == Some(false)
        && state.errors.iter().all(|error| error.error_level.is("WARNING"))
}

impl Linked {
    fn learn(&mut self, record: &Observation<'_>) {
        let instant = record.instant_actions_to_vehicle().into_iter();
        let instant = instant.flat_map(|message| message.all_actions());
        let order = record.order_to_vehicle();
        if order.is_some() {
            self.ordered = record.seq();
        }
        let placed = order.into_iter().flat_map(|order| order.actions());
        let placed: Vec<&ActionView> = placed.map(|(_, action)| action).take(ACTIONS).collect();
        for action in &placed {
            if self.placed.len() >= ACTIONS {
                self.placed.clear();
            }
            self.placed.insert(action.action_id.or_empty().to_owned());
        }
        // A cancelOrder in an order is none: whoever took such an order over did not cancel by it.
        let placed = placed
            .into_iter()
            .filter(|action| topic(action.action_type.or_empty()) != Some(HookChange::Order));
        for action in instant.chain(placed).take(ACTIONS) {
            let kind = action.action_type.or_empty();
            let id = action.action_id.or_empty().to_owned();
            if topic(kind).is_none() || id.is_empty() {
                continue;
            }
            if self.known.len() >= ACTIONS {
                self.known.clear();
                self.ended.clear();
            }
            let known = Known {
                kind: kind.to_owned(),
                action: action.clone(),
                seq: record.seq(),
            };
            self.known.insert(id, known);
        }
    }

    /// Which actions of the order are not over although its cancellation is.
    fn outlive(&self, cancel: &Known, state: &StateView) -> Vec<(&'static str, String)> {
        // Those of an order that was sent since may wait already.
        if self.ordered > cancel.seq {
            return Vec::new();
        }
        let placed = |action: &&ActionState| self.placed.contains(action.action_id.or_empty());
        let open = |action: &&ActionState| !action.is_over();
        let waits = |action: &&ActionState| action.action_status.is("WAITING");
        let left = state.all_action_states().take(ACTIONS).filter(placed).filter(open);
        // One that runs rather than one that waits.
        let Some(action) = left.min_by_key(waits) else {
            return Vec::new();
        };
        let what = format!(
            "action {} of the order is {}",
            quote(action.action_id.or_empty()),
            action.action_status.or_empty()
        );
        let still_running = (!waits(&action)).then(|| ("ORD-CANCEL-06", what.clone()));
        still_running.into_iter().chain([("ORD-CANCEL-07", what)]).collect()
    }

    /// What is wrong in the state that shows the end of an action.
    fn contradiction(known: &Known, state: &StateView, record: &Observation<'_>) -> Vec<(&'static str, String)> {
        let wants = |requirement, what: &str, shown: Option<bool>, wanted: bool| {
            let wrong = shown.is_some_and(|shown| shown != wanted);
            wrong.then(|| (requirement, format!("{what} is {}", !wanted)))
        };
        let paused = |wanted| wants("ACT-13", "paused", state.paused.flag(), wanted);
        let charging = |wanted| wants("ACT-19", "batteryState.charging", state.charging(), wanted);
        // Who shows a velocity of nothing stands, whatever the flag says; then it is the flag that is wrong.
        let stands = state.velocity.there().is_some_and(|velocity| {
            let mut others = [&velocity.vy, &velocity.omega]
                .into_iter()
                .filter_map(Member::<Number>::float);
            velocity.vx.float() == Some(0.0) && others.all(|speed| speed == 0.0)
        });
        let drives = |requirement| {
            let requirement = if stands { "STATE-MSG-08" } else { requirement };
            state
                .driving
                .is(true)
                .then(|| (requirement, "driving is true".to_owned()))
        };
        let left = || {
            let count = state.node_states.total() + state.edge_states.total();
            (count > 0).then(|| ("ORD-CANCEL-11", format!("{count} node and edge states are left")))
        };
        let found = match known.kind.as_str() {
            "startPause" if state.driving.is(true) => drives("ACT-15"),
            "cancelOrder" => return left().into_iter().chain(drives("ORD-CANCEL-07")).collect(),
            "startPause" => paused(true),
            "stopPause" => paused(false),
            "startCharging" => charging(true),
            "stopCharging" => charging(false),
            "enableMap" => Self::maps(&known.action, state),
            _ => return Self::pose(&known.action, state, record),
        };
        found.into_iter().collect()
    }

    fn maps(action: &ActionView, state: &StateView) -> Option<(&'static str, String)> {
        let maps = state.maps.there()?;
        let word = |key: &str| action.parameter(key).and_then(Json::text);
        let (map, version) = (word("mapId")?, word("mapVersion")?);
        let of_map = maps.iter().filter(|listed| listed.map_id.or_empty() == map);
        let enabled: Vec<&str> = of_map
            .filter(|listed| listed.map_status.is("ENABLED"))
            .map(|listed| listed.map_version.or_empty())
            .collect();
        (enabled != [version]).then(|| {
            let what = match enabled.first() {
                Some(other) => format!("version {} of map {} is ENABLED", quote(other), quote(map)),
                None => format!("no version of map {} is ENABLED", quote(map)),
            };
            ("MAP-24", what)
        })
    }

    fn pose(action: &ActionView, state: &StateView, record: &Observation<'_>) -> Vec<(&'static str, String)> {
        let mut found = Vec::new();
        let coordinate = |key: &str| action.parameter(key).and_then(Json::number).map(Number::float);
        let word = |key: &str| action.parameter(key).and_then(Json::text);
        let given = (coordinate("x"), coordinate("y"), coordinate("theta"), word("mapId"));
        if let ((Some(x), Some(y), Some(theta), Some(map)), Some(shown)) = (given, state.pose()) {
            let given = Pose {
                x,
                y,
                theta,
                map_id: Text::from(map),
            };
            let (far, turned) = shown.apart(&given);
            if shown.map_id != given.map_id || far > BESIDE.0 || turned > BESIDE.1 {
                let names = record.names();
                let message = record.json();
                let position = message.and_then(|message| names.raw(message, &[StateView::position]));
                let text = format!(
                    "{} is {} and not x {x}, y {y}, theta {theta} on {}",
                    names.name(StateView::position).unwrap_or_default(),
                    show(position.unwrap_or(&Value::Null)),
                    quote(map)
                );
                found.push(("ACT-23", text));
            }
        }
        let last = state.last_node_id.or_empty();
        if let Some(node) = word("lastNodeId").filter(|node| !node.is_empty() && last != *node) {
            let shown = quote(last);
            found.push(("ACT-24", format!("lastNodeId is {shown} and not {}", quote(node))));
        }
        found
    }
}

impl Running for Linked {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.learn(record);
        for topic in touched(record, context) {
            self.touched.insert(*topic, record.at().moment);
        }
        if context.world.restarts().now(record) {
            self.order = None;
        }
        let Some(state) = record.state() else {
            return false;
        };
        let order = state.order_id.or_empty().to_owned();
        let same_order = self.order.as_ref() == Some(&order);
        let begun = self.order.replace(order).is_some();
        let now = record.at().moment;
        let left_alone = |topic| self.touched.get(&topic).is_none_or(|at| now.since(*at) > INFLUENCE);
        let still = state.driving.is(false);
        let listed: Vec<(&str, &str)> = state
            .all_action_states()
            .take(ACTIONS)
            .map(|action| (action.action_id.or_empty(), action.action_status.or_empty()))
            .filter(|(id, _)| self.known.contains_key(*id))
            .collect();
        // What has ended before, or only waits, changes nothing now.
        let moves = |id: &str, status: &str| status != "WAITING" && !self.ended.contains(id);
        let changing: Vec<&str> = listed
            .iter()
            .filter(|(id, status)| moves(id, status))
            .map(|(id, _)| *id)
            .collect();
        let mut judged = false;
        for (id, status) in &listed {
            let Some(known) = self
                .known
                .get(*id)
                .filter(|_| *status == "FINISHED" && changing.contains(id))
            else {
                continue;
            };
            let rivals = changing.iter().filter(|other| {
                let other = self.known.get(**other);
                other.is_some_and(|other| topic(&other.kind) == topic(&known.kind))
            });
            let fits = match topic(&known.kind) {
                Some(HookChange::Pause) => true,
                // Another order may have come in between.
                Some(HookChange::Order) => same_order,
                _ => still,
            };
            let free = topic(&known.kind).is_some_and(left_alone);
            if rivals.count() != 1 || !begun || !free || !fits || !nothing_holds(state) {
                continue;
            }
            judged = true;
            let outlive = match known.kind.as_str() {
                "cancelOrder" => self.outlive(known, state),
                _ => Vec::new(),
            };
            for (requirement, text) in Self::contradiction(known, state, record).into_iter().chain(outlive) {
                let text = format!("{} {} is FINISHED, and {text}", known.kind, quote(id));
                findings.push(broken(requirement, record.seq(), text));
            }
        }
        let over = listed
            .iter()
            .filter(|(_, status)| matches!(*status, "FINISHED" | "FAILED"));
        self.ended.extend(over.map(|(id, _)| (*id).to_owned()));
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::{Trace, merged};
    use tck_journal::event::{Event, Source};

    fn judge(action: &str, parameters: &Value, shown: &Value) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.state(&json!({})).instant(action, "x", parameters);
        let ended = json!({ "actionStates": [{ "actionId": "x", "actionStatus": "FINISHED" }] });
        trace.state(&merged(ended, shown));
        trace.judge("action/linked-state").summary()
    }

    #[test]
    fn pause_and_charging_are_shown_with_the_end_of_their_action() {
        assert!(judge("startPause", &json!([]), &json!({ "paused": true })).is_empty());
        assert!(judge("startPause", &json!([]), &json!({})).is_empty());
        assert_eq!(judge("startPause", &json!([]), &json!({ "paused": false })), ["ACT-13"]);
        assert_eq!(judge("stopPause", &json!([]), &json!({ "paused": true })), ["ACT-13"]);
        let charging = json!({ "batteryState": { "charging": true } });
        assert!(judge("startCharging", &json!([]), &charging).is_empty());
        assert_eq!(judge("stopCharging", &json!([]), &charging), ["ACT-19"]);
    }

    #[test]
    fn a_pose_that_was_given_is_shown() {
        let given = |theta: f64, node: &str| {
            json!([{ "key": "x", "value": 1.0 }, { "key": "y", "value": 2.0 }, { "key": "theta", "value": theta },
                { "key": "mapId", "value": "hall" }, { "key": "lastNodeId", "value": node }])
        };
        assert!(judge("initPosition", &given(0.5, "n1"), &json!({})).is_empty());
        assert_eq!(judge("initPosition", &given(1.5, "n1"), &json!({})), ["ACT-23"]);
        assert_eq!(judge("initPosition", &given(0.4, "n2"), &json!({})), ["ACT-24"]);
    }

    #[test]
    fn the_version_that_was_asked_for_is_enabled() {
        let asked = json!([{ "key": "mapId", "value": "hall" }, { "key": "mapVersion", "value": "2" }]);
        let version =
            |version: &str| json!({ "maps": [{ "mapId": "hall", "mapVersion": version, "mapStatus": "ENABLED" }] });
        assert!(judge("enableMap", &asked, &version("2")).is_empty());
        assert_eq!(judge("enableMap", &asked, &version("1")), ["MAP-24"]);
    }

    #[test]
    fn a_cancel_that_stands_in_an_order_cancels_nothing() {
        let mut trace = Trace::subscriber();
        let actions = json!([{ "actionId": "x", "actionType": "cancelOrder" }]);
        let node = json!({ "nodeId": "a", "sequenceId": 0, "released": true, "actions": actions });
        trace.sent("order", &json!({ "orderId": "o", "nodes": [node], "edges": [] }));
        trace.state(&json!({ "orderId": "o" }));
        let ended = json!([{ "actionId": "x", "actionStatus": "FINISHED" }]);
        let left = json!([{ "nodeId": "b", "sequenceId": 2, "released": true }]);
        trace.state(&json!({ "orderId": "o", "actionStates": ended, "nodeStates": left }));
        assert!(trace.judge("action/linked-state").findings.is_empty());
    }

    #[test]
    fn two_actions_that_end_together_leave_it_open() {
        let mut trace = Trace::subscriber();
        trace
            .state(&json!({}))
            .instant("startPause", "x", &json!([]))
            .instant("stopPause", "y", &json!([]));
        let both =
            json!([{ "actionId": "x", "actionStatus": "FINISHED" }, { "actionId": "y", "actionStatus": "FINISHED" }]);
        trace.state(&json!({ "actionStates": both, "paused": false }));
        assert!(trace.judge("action/linked-state").findings.is_empty());
    }

    /// What is found when a cancellation ends beside an action of the order with this status.
    fn cancel_beside(status: &str, ordered_since: bool) -> Vec<String> {
        let order = |update: u64| {
            json!({ "orderId": "o", "orderUpdateId": update,
                "nodes": [{ "nodeId": "a", "sequenceId": 0, "released": true, "actions": [] }],
                "edges": [{ "edgeId": "a-b", "sequenceId": 1, "released": true, "actions": [{ "actionId": "w" }] }] })
        };
        let shown = |cancel: &str| {
            json!({ "orderId": "o", "driving": false, "nodeStates": [], "edgeStates": [], "actionStates": [
                { "actionId": "x", "actionStatus": cancel }, { "actionId": "w", "actionStatus": status }] })
        };
        let mut trace = Trace::subscriber();
        trace.sent("order", &order(0));
        trace.state(&shown("WAITING")).instant("cancelOrder", "x", &json!([]));
        trace.state(&shown("RUNNING"));
        if ordered_since {
            trace.sent("order", &order(0));
        }
        trace.state(&shown("FINISHED"));
        trace.judge("action/linked-state").summary()
    }

    #[test]
    fn an_action_that_outlives_its_cancellation_is_found() {
        assert!(cancel_beside("FAILED", false).is_empty());
        assert!(cancel_beside("FINISHED", false).is_empty());
        for status in ["RUNNING", "PAUSED", "INITIALIZING"] {
            assert_eq!(cancel_beside(status, false), ["ORD-CANCEL-06", "ORD-CANCEL-07"]);
        }
        assert_eq!(cancel_beside("WAITING", false), ["ORD-CANCEL-07"]);
        assert!(cancel_beside("WAITING", true).is_empty());
    }

    #[test]
    fn a_button_at_the_vehicle_leaves_it_open() {
        let mut trace = Trace::subscriber();
        let pressed = Event::Answer {
            prompt: "Press the button".into(),
            answer: "done".into(),
            ok: true,
        };
        trace.state(&json!({})).add(Source::Operator, None, pressed);
        trace.instant("stopPause", "x", &json!([]));
        trace.state(&json!({ "actionStates": [{ "actionId": "x", "actionStatus": "FINISHED" }], "paused": true }));
        assert!(trace.judge("action/linked-state").findings.is_empty());
    }
}
