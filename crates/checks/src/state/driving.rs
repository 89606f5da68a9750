//! `state/driving`, `state/position-moves`: what a state says of movement, against how the vehicle moves.
//!
//! Which way it has to move is left to `motion`.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::Value;

use crate::finding::{broken, quote, show};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionState, Deviation, Member, Number, OrderView, Pose, StateView};
use tck_world::{Fact, Listen, Observation, SentOrder, Topic, last_node};

/// Faster than this in a state without `driving` is no measuring noise, in metres and radians per second.
const MOVING: f64 = 0.2;
/// More than this from one state to the next is no measuring noise, in metres and radians.
const MOVED: f64 = 0.1;
/// Less than this is standing still.
const STILL: f64 = 0.01;
/// States further apart may leave out a stop, or a drive, between them.
const CLOSE: Duration = Duration::from_secs(2);
/// States closer together than this may be of one cycle of the vehicle, and prove as little as one alone.
const ONE_CYCLE: Duration = Duration::from_millis(200);
/// Faster than this no vehicle drives, in metres per second: it has found out that it is elsewhere.
const JUMP: f64 = 20.0;
/// How long a vehicle may say that it drives while it stands and has nowhere to go.
const COMING_TO_REST: Duration = Duration::from_secs(10);
/// Nodes that lie less far apart say nothing of a position, in metres.
const APART: f64 = 1.0;
/// How many positions of nodes are kept in mind.
const NODES: usize = 1024;

/// `state/driving`.
pub(crate) const DRIVING: Check = Check {
    name: "state/driving",
    decides: &["STATE-MSG-08"],
    doc: "A state that reports a velocity well above zero reports driving true; judged only when two states in a row \
          say the same, since velocity and flag may be taken at slightly different times. Whose position or direction \
          changes from state to state, three close states in a row, drives as well; whose does not for ten seconds, with \
          nothing released ahead and nothing under way, does not.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Displaced],
    needs: &[StateView::driving, StateView::position],
    start: |_| Box::new(Driving::default()),
};

/// `state/position-moves`.
pub(crate) const POSITION_MOVES: Check = Check {
    name: "state/position-moves",
    decides: &["MAP-01"],
    doc: "The position of a vehicle that has come from one node to another, more than a metre away by the positions in \
          its orders, is another one. Judged when it did not change twice in a row, and neither for nodes that count as \
          reached from more than a metre away nor for the first node of an order.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Displaced, Fact::Orders],
    needs: &[StateView::position, StateView::last_node_id],
    start: |_| Box::new(PositionMoves::default()),
};

fn has_moved(from: &Pose, to: &Pose) -> bool {
    let (far, turned) = from.apart(to);
    from.map_id == to.map_id && (far > MOVED || turned > MOVED)
}

/// Whether a vehicle that was seen at two poses has stood still.
pub(crate) fn stays(from: &Pose, to: &Pose) -> bool {
    let (far, turned) = from.apart(to);
    from.map_id == to.map_id && far < STILL && turned < STILL
}

/// Whether the vehicle is in command of itself and nothing holds it.
fn is_free(state: &StateView) -> bool {
    let stop = state.safety_state.there().map(|safety| &safety.emergency_stop);
    matches!(state.operating_mode.or_empty(), "AUTOMATIC" | "SEMIAUTOMATIC")
        && !state.paused.is(true)
        && stop.is_none_or(|stop| stop.is_absent() || stop.is("NONE"))
        && state.field_violation() != Some(true)
}

/// Whether nothing is left for it to drive to, and no action may move it.
fn has_nowhere_to_go(state: &StateView) -> bool {
    let nodes = state.node_states.iter();
    nodes.clone().all(|node| node.released.is(false)) && state.action_states.iter().all(ActionState::is_over)
}

#[derive(Default)]
struct Driving {
    /// Since when each state shows a velocity without `driving`.
    suspicious: Option<Moment>,
    /// The last states that said they stand: time and pose, and how often it moved from one to the next.
    standing: Option<(Moment, Pose)>,
    moves: u32,
    /// Since when it says that it drives, stands, and has nowhere to go; and how many states say so.
    resting: Option<(Moment, Pose, u32)>,
}

impl Driving {
    fn by_position(&mut self, state: &StateView, record: &Observation<'_>, findings: &mut Vec<CheckFinding>) {
        let now = record.at().moment;
        let driving = state.driving.flag();
        let Some(pose) = state.pose().filter(|_| is_free(state) && driving.is_some()) else {
            self.forget();
            return;
        };
        if driving == Some(true) {
            self.standing = None;
            self.moves = 0;
            self.at_rest(pose, state, record, findings);
            return;
        }
        self.resting = None;
        let before = self.standing.replace((now, pose.clone()));
        let moved = before.is_some_and(|(at, before)| {
            let apart = now.since(at);
            let jumped = before.apart(&pose).0 > JUMP * apart.as_secs_f64().max(ONE_CYCLE.as_secs_f64());
            apart <= CLOSE && !jumped && has_moved(&before, &pose)
        });
        self.moves = if moved { self.moves + 1 } else { 0 };
        if self.moves >= 2 {
            self.moves = 0;
            let text = "driving is false, while the position changes from state to state";
            findings.push(broken("STATE-MSG-08", record.seq(), text));
        }
    }

    fn at_rest(&mut self, pose: Pose, state: &StateView, record: &Observation<'_>, findings: &mut Vec<CheckFinding>) {
        let now = record.at().moment;
        let nowhere = has_nowhere_to_go(state);
        match &mut self.resting {
            Some((since, at, count)) if nowhere && stays(at, &pose) => {
                *count += 1;
                if now.since(*since) > COMING_TO_REST && *count > 2 {
                    let text = "driving is true, while the vehicle stands and has nowhere to go";
                    findings.push(broken("STATE-MSG-08", record.seq(), text));
                    self.resting = None;
                }
            }
            resting => *resting = nowhere.then_some((now, pose, 1)),
        }
    }

    fn forget(&mut self) {
        self.standing = None;
        self.moves = 0;
        self.resting = None;
    }
}

impl Running for Driving {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let now = record.at().moment;
        if context.world.displaced().now(record) {
            self.forget();
        }
        let Some(state) = record.state() else {
            return false;
        };
        // A vehicle may be slow to take a new place over.
        let patience = context.time.react;
        if context
            .world
            .displaced()
            .last()
            .is_some_and(|since| now.since(since) < patience)
        {
            self.forget();
            return false;
        }
        self.by_position(state, record, findings);
        if state.velocity.is_absent() {
            return state.pose().is_some();
        }
        let moving = state.velocity.there().is_some_and(|velocity| {
            let speeds = [&velocity.vx, &velocity.vy, &velocity.omega];
            let mut speeds = speeds.into_iter().filter_map(Member::<Number>::float);
            speeds.any(|speed| speed.abs() > MOVING)
        });
        let suspicious = moving && state.driving.is(false);
        match self.suspicious {
            Some(since) if suspicious && now.since(since) >= ONE_CYCLE => {
                let message = record.json();
                let velocity = message.and_then(|message| record.names().raw(message, &[StateView::velocity]));
                let text = format!(
                    "driving is false at velocity {}",
                    show(velocity.unwrap_or(&Value::Null))
                );
                findings.push(broken("STATE-MSG-08", record.seq(), text));
            }
            Some(_) if suspicious => {}
            _ => self.suspicious = suspicious.then_some(now),
        }
        true
    }
}

#[derive(Default)]
struct PositionMoves {
    /// Where orders say their nodes are: map, x and y.
    nodes: BTreeMap<String, (String, f64, f64)>,
    /// The last node, and the pose when it was reached, if that was seen.
    before: Option<(String, Option<Pose>)>,
    stuck: u32,
}

impl PositionMoves {
    fn learn(&mut self, order: &OrderView) {
        for node in order.nodes.iter().take(NODES) {
            let Some(position) = node.node_position.there() else {
                continue;
            };
            let (Some(x), Some(y)) = (position.x.float(), position.y.float()) else {
                continue;
            };
            let Some(id) = node.node_id.text().filter(|id| !id.is_empty()) else {
                continue;
            };
            let range = position.allowed_deviation_xy.there().and_then(Deviation::farthest);
            // Who is counted as on a node from afar need not come to it.
            if range.is_some_and(|range| range > APART) {
                self.nodes.remove(id);
            } else if self.nodes.len() < NODES {
                let place = (position.map_id.or_empty().to_owned(), x, y);
                self.nodes.insert(id.to_owned(), place);
            }
        }
    }
}

impl Running for PositionMoves {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.displaced().now(record) {
            self.before = None;
            self.stuck = 0;
        }
        if let Some(order) = record.order_to_vehicle() {
            self.learn(order);
        }
        let Some(state) = record.state() else {
            return false;
        };
        let last = last_node(state).filter(|(node, _)| !node.is_empty());
        let (Some(pose), Some((node, sequence))) = (state.pose(), last) else {
            self.before = None;
            return false;
        };
        // A vehicle may be slow to take a new place over.
        let patience = context.time.react;
        if context
            .world
            .displaced()
            .last()
            .is_some_and(|since| record.at().moment.since(since) < patience)
        {
            self.before = None;
            return false;
        }
        // Under way it is not any more where it reached its last node.
        let rests = state.driving.is(false) && state.node_states.is_empty();
        if let Some((_, was)) = self.before.as_mut().filter(|(last, _)| *last == node) {
            if rests {
                was.get_or_insert(pose);
            }
            return false;
        }
        let reached = (self.before.is_some() || rests).then(|| pose.clone());
        let Some((last, Some(was))) = self.before.replace((node.clone(), reached)) else {
            return false;
        };
        let (Some(from), Some(to)) = (self.nodes.get(&last), self.nodes.get(&node)) else {
            return false;
        };
        // Where an order begins, its first node is put under a vehicle that stands.
        let update = state.order_update_id.whole().unwrap_or_default();
        let begins = |sent: &SentOrder| sent.first() == sequence;
        let orders = context.world.orders();
        if orders.candidates(state.order_id.or_empty(), update).any(begins) {
            return false;
        }
        if from.0 != to.0 || pose.map_id != was.map_id || (from.1 - to.1).hypot(from.2 - to.2) < APART {
            return false;
        }
        self.stuck = if was.apart(&pose).0 < STILL { self.stuck + 1 } else { 0 };
        if self.stuck == 2 {
            let text = format!(
                "the vehicle has come from {} to {}, and its position has not changed",
                quote(&last),
                quote(&node)
            );
            findings.push(broken("MAP-01", record.seq(), text));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn at(x: f64, theta: f64, driving: bool) -> Value {
        json!({ "driving": driving, "agvPosition": { "x": x, "y": 0.0, "theta": theta, "mapId": "m", "positionInitialized": true } })
    }

    fn driving(states: &[Value], every: f64) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for state in states {
            trace.wait(every).state(state);
        }
        let outcome = trace.judge("state/driving");
        assert!(outcome.judged > 0);
        outcome.summary()
    }

    #[test]
    fn moving_without_driving_is_found_when_it_lasts() {
        let moving = json!({ "velocity": { "vx": 0.8, "vy": 0.0, "omega": 0.0 } });
        let drives = json!({ "driving": true, "velocity": { "vx": 0.8, "vy": 0.0, "omega": 0.0 } });
        let creeping = json!({ "velocity": { "vx": 0.01, "vy": 0.0, "omega": 0.0 } });
        assert!(driving(&[moving.clone(), drives, moving.clone(), creeping], 1.0).is_empty());
        assert_eq!(driving(&[moving.clone(), moving], 1.0), ["STATE-MSG-08"]);
    }

    #[test]
    fn turning_without_driving_is_found_when_it_lasts() {
        let turning = [at(1.0, 0.0, false), at(1.0, 0.5, false), at(1.0, 1.0, false)];
        assert_eq!(driving(&turning, 0.5), ["STATE-MSG-08"]);
        assert!(
            driving(&turning, 5.0).is_empty(),
            "it may have driven and stopped between them"
        );
        assert!(driving(&turning[..2], 0.5).is_empty(), "once may be a matter of timing");
        assert!(driving(&[at(1.0, 3.1, false), at(1.0, -3.1, false), at(1.0, 3.1, false)], 0.5).is_empty());
    }

    #[test]
    fn a_vehicle_that_stands_and_drives_all_the_time_is_found() {
        let states = vec![at(1.0, 0.0, true); 8];
        assert_eq!(driving(&states, 2.0), ["STATE-MSG-08"]);
        assert!(driving(&states[..4], 2.0).is_empty());
        let mut waits = at(1.0, 0.0, true);
        waits["nodeStates"] = json!([{ "nodeId": "b", "sequenceId": 2, "released": true }]);
        assert!(driving(&vec![waits; 8], 2.0).is_empty(), "something may be in its way");
    }

    fn moves(positions: &[f64]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        let node = |id: &str, x: f64| json!({ "nodeId": id, "nodePosition": { "x": x, "y": 0.0, "mapId": "m" } });
        let nodes = [node("a", 0.0), node("b", 2.0), node("c", 4.0)];
        trace.sent("order", &json!({ "orderId": "o", "nodes": nodes }));
        for (id, x) in ["a", "b", "c"].into_iter().zip(positions) {
            let mut state = at(*x, 0.0, id != "a");
            state["lastNodeId"] = json!(id);
            state["lastNodeSequenceId"] = json!(0);
            trace.wait(3.0).state(&state);
        }
        trace.judge("state/position-moves").summary()
    }

    #[test]
    fn a_position_that_never_moves_is_found() {
        assert!(moves(&[0.0, 2.0, 4.0]).is_empty());
        assert!(moves(&[0.0, 0.0, 4.0]).is_empty());
        assert_eq!(moves(&[0.0, 0.0, 0.0]), ["MAP-01"]);
    }

    /// A vehicle that stands at 0 throughout, and names these nodes as its last ones, each the first one of an order of its own.
    fn stands(nodes: &[(&str, f64)]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for (number, (id, x)) in nodes.iter().enumerate() {
            let place = json!({ "x": x, "y": 0.0, "mapId": "m" });
            let node = json!({ "nodeId": id, "sequenceId": 0, "released": true, "nodePosition": place, "actions": [] });
            let order = json!({ "orderId": number.to_string(), "orderUpdateId": 0, "nodes": [node], "edges": [] });
            trace.sent("order", &order);
            let mut state = at(0.0, 0.0, false);
            state["orderId"] = order["orderId"].clone();
            state["orderUpdateId"] = json!(0);
            state["lastNodeId"] = json!(id);
            state["lastNodeSequenceId"] = json!(0);
            trace.wait(3.0).state(&state);
        }
        trace.judge("state/position-moves").summary()
    }

    #[test]
    fn where_an_order_begins_nobody_has_driven() {
        assert!(stands(&[("a", 0.0), ("b", 2.0), ("c", 4.0)]).is_empty());
    }

    #[test]
    fn no_last_node_is_none() {
        let mut trace = Trace::subscriber();
        let node = |id: &str, x: f64| json!({ "nodeId": id, "nodePosition": { "x": x, "y": 0.0, "mapId": "m" } });
        trace.sent(
            "order",
            &json!({ "orderId": "o", "nodes": [node("a", 0.0), node("", 4.0)] }),
        );
        for id in ["a", "", "a", ""] {
            let mut state = at(0.0, 0.0, false);
            state["lastNodeId"] = json!(id);
            state["lastNodeSequenceId"] = json!(2);
            trace.wait(3.0).state(&state);
        }
        assert!(trace.judge("state/position-moves").summary().is_empty());
    }

    #[test]
    fn where_a_node_was_reached_is_not_known_of_a_vehicle_that_is_under_way_already() {
        let mut trace = Trace::subscriber();
        let node = |id: &str, x: f64| json!({ "nodeId": id, "nodePosition": { "x": x, "y": 0.0, "mapId": "m" } });
        let nodes = [node("a", 0.0), node("b", 2.0)];
        trace.sent("order", &json!({ "orderId": "o", "nodes": nodes }));
        for _ in 0..3 {
            trace.hook().wait(40.0);
            for (id, ahead) in [("a", json!([{ "nodeId": "b", "sequenceId": 2 }])), ("b", json!([]))] {
                let mut state = at(2.0, 0.0, false);
                state["lastNodeId"] = json!(id);
                state["nodeStates"] = ahead;
                trace.wait(1.0).state(&state);
            }
        }
        assert!(trace.judge("state/position-moves").summary().is_empty());
    }
}
