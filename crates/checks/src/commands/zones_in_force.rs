//! Zones that a vehicle shall keep to, as orders take them into account: enabled before, and with trajectories where it keeps to
//! one.

use std::collections::{BTreeMap, BTreeSet};

use super::zone_sets::{area, zone_set};
use super::{Command, ELEMENTS, Found, edges_in_sequence, nodes_in_sequence, place_of, short};
use crate::finding::quote;
use tck_base::polygon::{Point, Polygon};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, StateView, ZoneSetView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `commands/zone-set-enabled`.
pub(crate) const ENABLED: Check = Check {
    name: "commands/zone-set-enabled",
    decides: &["ZSET-08"],
    doc: "A set of zones that was sent to the vehicle for a map is enabled before an order leads over that map: enableZoneSet was \
          sent, or a state shows a set of the map as ENABLED. For tests in which zones are to be used; in other runs nobody knows \
          for when a set is meant.",
    arguments: &[],
    listens: &[
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::ZoneSet),
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[],
    needs: &[
        StateView::zone_sets,
        ZoneSetView::zone_set,
        ActionView::action_parameters,
    ],
    start: |_| Box::new(Enabled::default()),
};

/// `commands/line-guided-zones`.
pub(crate) const LINE_GUIDED: Check = Check {
    name: "commands/line-guided-zones",
    decides: &["ZONE-09"],
    doc: "An edge that enters a LINE_GUIDED zone, or lies in one, comes with a trajectory, once a state shows the set of the zone \
          as ENABLED. Not judged for a vehicle that is bound to lines, that reports trajectories of its own, or that supports none \
          by its factsheet.",
    arguments: &[],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::ZoneSet),
        Listen::Delivered(Topic::Order),
    ],
    reads: &[Fact::Factsheets, Fact::Mock],
    needs: &[StateView::zone_sets, ZoneSetView::zone_set],
    start: |_| Box::new(LineGuided::default()),
};

/// More sets than this are not kept in mind.
const KEPT: usize = 1_024;
/// How deep a way has to lie in a zone to lie in it, in metres.
const MARGIN: f64 = 0.05;

/// Ids of the sets that a state shows as enabled.
fn enabled(state: &StateView) -> BTreeSet<String> {
    let sets = state.zone_sets.iter().take(ELEMENTS);
    let on = sets.filter(|set| set.zone_set_status.is("ENABLED"));
    on.filter_map(|set| short(&set.zone_set_id)).collect()
}

#[derive(Default)]
struct Enabled {
    /// Sets that were sent, by id, with the map of each.
    sent: BTreeMap<String, String>,
    /// Sets that are enabled, or were asked to be.
    used: BTreeSet<String>,
}

impl Running for Enabled {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        if let Some(state) = record.said_state() {
            self.used.extend(enabled(state).into_iter().take(KEPT));
        }
        if let Some(set) = zone_set(record).and_then(|message| message.zone_set.there())
            && let Some((id, map)) = short(&set.zone_set_id).zip(short(&set.map_id))
            && self.sent.len() < KEPT
        {
            self.sent.insert(id, map);
        }
        let Some(command) = Command::read(record) else {
            return false;
        };
        for (_, action) in command.actions() {
            if action.action_type.is("enableZoneSet") && self.used.len() < KEPT {
                let parameters = action.action_parameters.iter().take(ELEMENTS);
                let named = parameters.filter(|parameter| parameter.key.is("zoneSetId"));
                self.used
                    .extend(named.filter_map(|parameter| parameter.value.text().map(str::to_owned)));
            }
        }
        let Some(order) = command.order() else { return false };
        let maps: BTreeSet<&str> = nodes_in_sequence(order)
            .into_iter()
            .filter_map(|node| place_of(node).map(|(_, _, map)| map))
            .collect();
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for map in maps {
            let sets: Vec<&String> = self
                .sent
                .iter()
                .filter(|(_, of)| *of == map)
                .map(|(id, _)| id)
                .collect();
            let Some(last) = sets.last() else { continue };
            judged = true;
            if !sets.iter().any(|id| self.used.contains(*id)) {
                let text = format!(
                    "an order leads over map {}, whose zone set {} is not enabled",
                    quote(map),
                    quote(last)
                );
                found.broken("ZSET-08", text);
            }
        }
        judged
    }
}

#[derive(Default)]
struct LineGuided {
    /// Zones by set: map, id, area.
    zones: BTreeMap<String, Vec<(String, String, Polygon)>>,
    enabled: BTreeSet<String>,
    /// Whether the vehicle ever reported a trajectory of its own.
    plans: bool,
    /// Orders in which an edge had a trajectory: the state only shows it again.
    given: bool,
}

impl LineGuided {
    /// The zone that a way lies in or enters.
    fn zone_of(&self, map: &str, from: Point, to: Point) -> Option<&str> {
        let sets = self.zones.iter().filter(|(id, _)| self.enabled.contains(*id));
        let mut zones = sets.flat_map(|(_, zones)| zones).filter(|(of, ..)| of == map);
        let steps = 0..=40_u32;
        let inside = |area: &Polygon| {
            let mut points = steps.clone().map(|step| from.towards(to, f64::from(step) / 40.0));
            points.any(|point| area.depth(point) > MARGIN)
        };
        zones.find(|(_, _, area)| inside(area)).map(|(_, id, _)| id.as_str())
    }
}

impl Running for LineGuided {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.mock().is_lost(record) {
            self.enabled.clear();
        }
        if let Some(state) = record.said_state() {
            self.enabled = enabled(state);
            let curves = state.edge_states.iter().any(|edge| !edge.trajectory.is_absent());
            self.plans |= curves && !self.given;
        }
        if let Some(set) = zone_set(record).and_then(|message| message.zone_set.there())
            && let Some((id, map)) = short(&set.zone_set_id).zip(short(&set.map_id))
            && self.zones.len() < KEPT
        {
            let guided = set.zones.iter().take(ELEMENTS);
            let guided = guided.filter(|zone| zone.zone_type.is("LINE_GUIDED"));
            let areas = guided.filter_map(|zone| Some((map.clone(), short(&zone.zone_id)?, area(zone)?)));
            self.zones.insert(id, areas.collect());
        }
        let Some(order) = Command::read(record).and_then(Command::order) else {
            return false;
        };
        let edges = edges_in_sequence(order);
        self.given |= edges.iter().any(|edge| edge.trajectory.presence().is_something());
        let sheets = context.world.factsheets().valid(record, context);
        let takes = |sheet: &tck_world::Factsheet| {
            let listed = sheet.supported.as_ref();
            !sheet.line_guided && listed.is_none_or(|all| all.iter().any(|name| name == "order.edges.trajectory"))
        };
        let unsettled = context.world.mock().unsettled(record, context);
        if self.plans || unsettled || sheets.is_empty() || !sheets.iter().all(|sheet| takes(sheet)) {
            return false;
        }
        let nodes = nodes_in_sequence(order);
        if nodes.len() != edges.len() + 1 {
            return false;
        }
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for (edge, ends) in edges.iter().zip(nodes.windows(2)) {
            let (Some((ax, ay, map)), Some((bx, by, _))) = (place_of(ends[0]), place_of(ends[1])) else {
                continue;
            };
            let Some(zone) = self.zone_of(map, Point::new(ax, ay), Point::new(bx, by)) else {
                continue;
            };
            judged = true;
            if !edge.trajectory.presence().is_something() {
                let id = quote(edge.edge_id.or_empty());
                let text = format!(
                    "edge {id} leads through LINE_GUIDED zone {} without a trajectory",
                    quote(zone)
                );
                found.broken("ZONE-09", text);
            }
        }
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn set(id: &str) -> Value {
        let corners = [(1.0, -1.0), (3.0, -1.0), (3.0, 1.0), (1.0, 1.0)];
        let vertices: Vec<Value> = corners.iter().map(|(x, y)| json!({ "x": x, "y": y })).collect();
        json!({ "zoneSet": { "mapId": "hall", "zoneSetId": id,
            "zones": [{ "zoneId": "a", "zoneType": "LINE_GUIDED", "vertices": vertices }] } })
    }

    fn enable(id: &str) -> Value {
        json!({ "actions": [{ "actionType": "enableZoneSet", "actionId": "x", "blockingType": "NONE",
            "actionParameters": [{ "key": "zoneSetId", "value": id }] }] })
    }

    fn order(curve: bool) -> Value {
        let node = |at: u32| {
            json!({ "nodeId": format!("n{at}"), "sequenceId": 2 * at, "released": true, "actions": [],
                "nodePosition": { "x": 2.0 * f64::from(at), "y": 0.0, "mapId": "hall" } })
        };
        let mut edge = json!({ "edgeId": "e", "sequenceId": 1, "released": true, "actions": [] });
        if curve {
            edge["trajectory"] = json!({ "degree": 1, "knotVector": [0, 0, 1, 1],
                "controlPoints": [{ "x": 0, "y": 0 }, { "x": 2, "y": 0 }] });
        }
        json!({ "orderId": "o1", "orderUpdateId": 0, "nodes": [node(0), node(1)], "edges": [edge] })
    }

    fn shows(status: &str) -> Value {
        json!({ "zoneSets": [{ "zoneSetId": "z1", "mapId": "hall", "zoneSetStatus": status }] })
    }

    #[test]
    fn a_set_is_enabled_before_an_order_relies_on_it() {
        let mut trace = Trace::master_control_of("3.0");
        trace.commands("order", &order(false)).wait(1.0);
        trace.commands("zoneSet", &set("z1")).wait(1.0);
        trace.shows(&shows("DISABLED")).wait(1.0);
        assert!(trace.judge("commands/zone-set-enabled").summary().is_empty());
        let mut early = Trace::master_control_of("3.0");
        early.commands("zoneSet", &set("z1")).wait(1.0);
        early.shows(&shows("DISABLED")).wait(1.0);
        early.commands("order", &order(false));
        assert_eq!(early.judge("commands/zone-set-enabled").summary(), ["ZSET-08"]);
        trace.commands("instantActions", &enable("z1")).wait(1.0);
        trace.commands("order", &order(false));
        let outcome = trace.judge("commands/zone-set-enabled");
        assert!(outcome.summary().is_empty() && outcome.judged > 0);
    }

    fn guided(navigation: &str, supported: &Value, status: &str, curve: bool) -> Vec<String> {
        let mut trace = Trace::master_control_of("3.0");
        let sheet = json!({ "typeSpecification": { "navigationTypes": [navigation] },
            "protocolFeatures": { "optionalParameters": supported } });
        trace.sent("factsheet", &sheet).wait(10.0);
        trace.commands("zoneSet", &set("z1")).wait(1.0);
        trace.shows(&shows(status)).wait(10.0);
        trace.commands("order", &order(curve));
        trace.judge("commands/line-guided-zones").summary()
    }

    #[test]
    fn an_edge_into_a_line_guided_zone_has_a_trajectory() {
        let curves = json!([{ "parameter": "order.edges.trajectory", "support": "SUPPORTED" }]);
        assert_eq!(guided("FREELY_NAVIGATING", &curves, "ENABLED", false), ["ZONE-09"]);
        assert!(guided("FREELY_NAVIGATING", &curves, "ENABLED", true).is_empty());
        assert!(guided("FREELY_NAVIGATING", &curves, "DISABLED", false).is_empty());
        assert!(guided("FREELY_NAVIGATING", &json!([]), "ENABLED", false).is_empty());
        assert!(guided("VIRTUAL_LINE_GUIDED", &curves, "ENABLED", false).is_empty());
    }
}
