//! `state/idle-empty`, `state/position-range`, `state/identifiers`: values of a single state.
//!
//! Types and enumerations are left to `message/schema`.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use crate::finding::{broken, number, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{MapState, Position, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// Beyond this many metres a coordinate is taken for another unit.
const FAR: f64 = 1.0e6;
/// What rounding may add to pi.
const ROUNDING: f64 = 1.0e-3;
/// How many odd identifiers are remembered.
const IDENTIFIERS_KEPT: usize = 256;

/// `state/idle-empty`.
pub(crate) const IDLE_EMPTY: Check = Check {
    name: "state/idle-empty",
    decides: &["STATE-13", "STATE-MSG-02"],
    doc: "While there never was an order, nodeStates and edgeStates are empty and orderUpdateId is 0; without \
          nodeStates there are no edgeStates. What a malformed order of the harness left in a vehicle is not judged.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Malformed],
    needs: &[StateView::order_id, StateView::node_states, StateView::edge_states],
    start: |_| Box::new(IdleEmpty),
};

/// `state/position-range`.
pub(crate) const POSITION_RANGE: Check = Check {
    name: "state/position-range",
    decides: &["MAP-02"],
    doc: "theta lies between minus pi and pi, and coordinates have the magnitude of metres, which is a warning.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State), Listen::Delivered(Topic::Visualization)],
    reads: &[],
    needs: &[StateView::position, Position::theta],
    start: |_| Box::new(PositionRange),
};

/// `state/identifiers`.
pub(crate) const IDENTIFIERS: Check = Check {
    name: "state/identifiers",
    decides: &["JSON-04"],
    doc: "Identifiers that the vehicle chooses itself or takes from its maps keep to the recommended characters.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::last_node_id, Position::map_id],
    start: |_| Box::new(Identifiers::default()),
};

struct IdleEmpty;

impl Running for IdleEmpty {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(state) = record
            .state()
            .filter(|_state| !context.world.malformed().is_shown(record))
        else {
            return false;
        };
        let (nodes, edges) = (state.node_states.total(), state.edge_states.total());
        let never = state.order_id.is("");
        let seq = record.seq();
        if never && nodes + edges > 0 {
            let text = format!("{nodes} nodeStates and {edges} edgeStates without any order");
            findings.push(broken("STATE-13", seq, text));
        } else if nodes == 0 && edges > 0 {
            findings.push(broken(
                "STATE-13",
                seq,
                format!("{edges} edgeStates are left without any nodeState"),
            ));
        }
        if never && state.order_update_id.float().is_some_and(|update| update != 0.0) {
            findings.push(broken(
                "STATE-MSG-02",
                seq,
                "orderUpdateId is not 0 although there is no orderId",
            ));
        }
        true
    }
}

struct PositionRange;

impl Running for PositionRange {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let of_state = record.state().and_then(|state| state.position.there());
        let shown = of_state.or_else(|| record.visualization()?.position.there());
        let Some(position) = shown.filter(|position| position.initialized.is(true)) else {
            return false;
        };
        if let Some(theta) = position.theta.float().filter(|theta| theta.abs() > PI + ROUNDING) {
            let text = format!("theta {} is not between minus pi and pi", number(theta));
            findings.push(broken("MAP-02", record.seq(), text));
        }
        for (name, coordinate) in [("x", &position.x), ("y", &position.y)] {
            if let Some(value) = coordinate.float().filter(|value| value.abs() > FAR) {
                findings.push(remark(
                    "MAP-02",
                    record.seq(),
                    format!("{name} {} can hardly be metres", number(value)),
                ));
            }
        }
        true
    }
}

#[derive(Default)]
struct Identifiers {
    reported: BTreeSet<String>,
}

impl Running for Identifiers {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(state) = record.state() else {
            return false;
        };
        let own = [
            (StateView::last_node_id, &state.last_node_id),
            (StateView::zone_set_id, &state.zone_set_id),
        ];
        let position = state.position.there().into_iter();
        let position = position.map(|position| (Position::map_id, &position.map_id));
        let maps = state.maps.iter().map(|map| (MapState::map_id, &map.map_id));
        for (field, id) in own.into_iter().chain(position).chain(maps) {
            let (name, id) = (record.names().name(field).unwrap_or_default(), id.or_empty());
            let odd = id
                .chars()
                .any(|character| !(character.is_ascii_alphanumeric() || "_-.:".contains(character)));
            let short: String = id.chars().take(128).collect();
            if odd && self.reported.len() < IDENTIFIERS_KEPT && self.reported.insert(short) {
                let text = format!("{name} {} holds characters that are not recommended", quote(id));
                findings.push(remark("JSON-04", record.seq(), text));
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn judged(check: &str, states: &[Value]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for state in states {
            trace.state(state);
        }
        let outcome = trace.judge(check);
        assert!(outcome.judged > 0);
        outcome.summary()
    }

    #[test]
    fn an_idle_vehicle_with_empty_lists_is_right_and_so_is_a_horizon() {
        let horizon = json!({ "orderId": "o", "nodeStates": [{}], "edgeStates": [{}] });
        assert!(judged("state/idle-empty", &[json!({}), horizon]).is_empty());
    }

    #[test]
    fn left_over_elements_are_found() {
        assert_eq!(
            judged("state/idle-empty", &[json!({ "nodeStates": [{}] })]),
            ["STATE-13"]
        );
        let edges = json!({ "orderId": "o", "edgeStates": [{}] });
        assert_eq!(judged("state/idle-empty", &[edges]), ["STATE-13"]);
        assert_eq!(
            judged("state/idle-empty", &[json!({ "orderUpdateId": 3 })]),
            ["STATE-MSG-02"]
        );
    }

    #[test]
    fn what_a_malformed_order_left_is_not_judged() {
        let mut trace = Trace::subscriber();
        let left = json!({ "nodeStates": [{}], "orderUpdateId": 3 });
        trace
            .state(&json!({}))
            .sent("order", &json!({ "orderUpdateId": 3, "nodes": [{}], "edges": [] }));
        trace.state(&left);
        assert!(trace.judge("state/idle-empty").findings.is_empty());
        let mut trace = Trace::subscriber();
        trace
            .state(&json!({}))
            .sent("order", &json!({ "orderId": "bad", "orderUpdateId": 0, "nodes": [] }));
        trace.state(&left);
        assert_eq!(trace.judge("state/idle-empty").summary(), ["STATE-13", "STATE-MSG-02"]);
    }

    #[test]
    fn radians_and_metres_are_told_from_degrees_and_millimetres() {
        let position = |x: f64, theta: f64| json!({ "agvPosition": { "x": x, "theta": theta } });
        assert!(judged("state/position-range", &[position(-350.0, -std::f64::consts::PI)]).is_empty());
        assert_eq!(judged("state/position-range", &[position(1.0, 90.0)]), ["MAP-02"]);
        assert_eq!(
            judged("state/position-range", &[position(4.0e6, 0.0)]),
            ["MAP-02 warning"]
        );
    }

    #[test]
    fn an_odd_identifier_is_remarked_on_once() {
        let odd = json!({ "lastNodeId": "knoten 1", "maps": [{ "mapId": "hall-1.b:2_x" }] });
        assert_eq!(judged("state/identifiers", &[odd.clone(), odd]), ["JSON-04 warning"]);
        assert!(judged("state/identifiers", &[json!({})]).is_empty());
    }
}
