//! `state/last-node-place`: a vehicle that was stopped does not name a node it has not come to as its last one.
//!
//! How exactly a node is reached is left to `motion/node-tolerance`.

use std::collections::HashMap;

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Deviation, NodePosition, OrderView, Position, StateView};
use tck_world::{Fact, Listen, Observation, Topic, sets_position};

/// A vehicle that was stopped does not name a node it has not come to as its last one.
pub(crate) const LAST_NODE_PLACE: Check = Check {
    name: "state/last-node-place",
    decides: &["STATE-MSG-04"],
    doc: "A vehicle that stands after a cancelOrder or a startPause has come nearer to the node that has just become its \
          last one than to the one before, or stands within 1 m or the allowedDeviationXY of it. Judged where orders \
          gave both nodes one position each, and a pose is reported.",
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
    needs: &[StateView::last_node_id, StateView::position],
    start: |_| Box::new(LastNodePlace::default()),
};

/// How many nodes are kept in mind.
const NODES: usize = 1024;

/// So near is there, in metres.
const NEAR: f64 = 1.0;

/// Where orders put a node; `None` once they contradict each other.
type Placed = Option<Place>;

#[derive(Clone, Debug, PartialEq)]
struct Place {
    map: String,
    x: f64,
    y: f64,
    deviation: f64,
}

impl Place {
    fn of_node(position: &NodePosition) -> Option<Self> {
        Some(Self {
            map: position.map_id.or_empty().to_owned(),
            x: position.x.float()?,
            y: position.y.float()?,
            deviation: position
                .allowed_deviation_xy
                .there()
                .and_then(Deviation::farthest)
                .unwrap_or_default(),
        })
    }

    fn of_vehicle(position: &Position) -> Option<Self> {
        Some(Self {
            map: position.map_id.or_empty().to_owned(),
            x: position.x.float()?,
            y: position.y.float()?,
            deviation: 0.0,
        })
    }

    fn distance(&self, other: &Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }
}

#[derive(Default)]
struct LastNodePlace {
    places: HashMap<String, Placed>,
    /// The last node of the state before.
    last: Option<String>,
    /// The vehicle was told to stop, and got no order since.
    stopped: bool,
}

impl LastNodePlace {
    fn learn(&mut self, order: &OrderView) {
        for node in order.nodes.iter().take(NODES) {
            let id = node.node_id.or_empty().to_owned();
            let Some(place) = node.node_position.there().and_then(|position| Place::of_node(position)) else {
                continue;
            };
            if self.places.len() >= NODES && !self.places.contains_key(&id) {
                self.places.clear();
            }
            let known = self.places.entry(id).or_insert_with(|| Some(place.clone()));
            *known = known
                .take()
                .filter(|known| known.map == place.map && known.distance(&place) < 0.01);
            if let Some(known) = known {
                known.deviation = known.deviation.max(place.deviation);
            }
        }
    }

    fn place(&self, node: &str) -> Option<&Place> {
        self.places.get(node)?.as_ref()
    }

    /// What is wrong about a last node that was another one before.
    fn contradiction(&self, state: &StateView, before: &str, now: &str) -> Option<String> {
        let position = state.position.there().filter(|position| position.initialized.is(true));
        let pose = Place::of_vehicle(position?)?;
        let (old, new) = (self.place(before)?, self.place(now)?);
        let (from_old, from_new) = (pose.distance(old), pose.distance(new));
        let there = pose.map != old.map || pose.map != new.map || from_new <= NEAR.max(new.deviation);
        let back = state.node_states.iter().any(|node| node.node_id.or_empty() == before);
        (!there && !back && from_old < from_new).then(|| {
            format!(
                "the last node is {}, but the vehicle stands {from_new:.1} m away from it, and {from_old:.1} m from {}, \
                 which was the last node before",
                quote(now),
                quote(before)
            )
        })
    }
}

impl Running for LastNodePlace {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if record.outside_influence() || context.world.restarts().now(record) {
            self.last = None;
        }
        if let Some(order) = record.order_to_vehicle() {
            self.learn(order);
            self.stopped = false;
        }
        if let Some(message) = record.instant_actions_to_vehicle() {
            for action in message.all_actions() {
                match action.action_type.or_empty() {
                    "cancelOrder" | "startHibernation" | "startPause" => self.stopped = true,
                    "stopPause" => self.stopped = false,
                    other if sets_position(other) => self.last = None,
                    _ => {}
                }
            }
        }
        let Some(state) = record.state() else {
            return false;
        };
        let now = state.last_node_id.or_empty().to_owned();
        let before = self.last.replace(now.clone());
        let stands = self.stopped && state.driving.is(false);
        let Some(before) = before.filter(|before| stands && *before != now && !now.is_empty()) else {
            return false;
        };
        if let Some(text) = self.contradiction(state, &before, &now) {
            findings.push(broken("STATE-MSG-04", record.seq(), text));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn at(x: f64, node: &str) -> Value {
        json!({
            "orderId": "o", "lastNodeId": node, "driving": false,
            "agvPosition": { "positionInitialized": true, "x": x, "y": 0.0, "theta": 0.0, "mapId": "m" },
        })
    }

    fn node(id: &str, x: f64, deviation: f64) -> Value {
        let position = json!({ "x": x, "y": 0.0, "mapId": "m", "allowedDeviationXY": deviation });
        json!({ "nodeId": id, "sequenceId": 0, "released": true, "nodePosition": position, "actions": [] })
    }

    fn judge(stop: bool, deviation: f64, states: &[Value]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        let order = json!({ "orderId": "o", "nodes": [node("a", 0.0, 0.0), node("b", 10.0, deviation)], "edges": [] });
        trace.sent("order", &order);
        trace.state(&at(0.0, "a"));
        if stop {
            let cancel =
                json!({ "actions": [{ "actionId": "c", "actionType": "cancelOrder", "actionParameters": [] }] });
            trace.sent("instantActions", &cancel);
        }
        for state in states {
            trace.state(state);
        }
        trace.judge("state/last-node-place").summary()
    }

    #[test]
    fn a_vehicle_that_stands_at_its_last_node_or_passed_it_is_right() {
        assert!(judge(true, 0.0, &[at(9.5, "b")]).is_empty());
        assert!(judge(true, 0.0, &[at(14.0, "b")]).is_empty());
        assert!(judge(true, 0.0, &[at(3.0, "a")]).is_empty());
    }

    #[test]
    fn a_node_may_allow_more_and_nobody_judges_a_vehicle_that_was_not_stopped() {
        assert!(judge(true, 8.0, &[at(3.0, "b")]).is_empty());
        assert!(judge(false, 0.0, &[at(3.0, "b")]).is_empty());
    }

    #[test]
    fn the_node_ahead_is_not_the_last_one() {
        assert_eq!(judge(true, 0.0, &[at(3.0, "b")]), ["STATE-MSG-04"]);
    }
}
