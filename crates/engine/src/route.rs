//! From course names to the nodes and edges of an order, with sequenceIds that run on through updates.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::compose_error::ComposeError;
use tck_course::{demanded_in_order, is_station, told_in_order};
use tck_profile::{Place, SampleKind};
use tck_suite::model::{Route, RoutePlace};

/// The ways sent in this test, latest last.
#[derive(Debug, Default)]
pub(super) struct SentOrders {
    ways: Vec<(String, Vec<Visited>)>,
    /// The actionIds of what the layout demands: an update that has a node again has its actions again. By orderId,
    /// sequenceId and place in the list.
    demanded: BTreeMap<(String, u32, usize), String>,
}

/// One node of an order that was sent.
#[derive(Clone, Debug)]
struct Visited {
    name: String,
    sequence_id: u32,
    released: bool,
}

impl SentOrders {
    /// The sequenceId an update that begins at `name` continues with: that of the last base node of this
    /// name in the latest message of the order, then in older ones; 0 for a new order.
    fn continues_at(&self, order: &str, name: &str) -> u32 {
        let ways = self.ways.iter().rev().filter(|(id, _)| id == order);
        let mut found =
            ways.filter_map(|(_, nodes)| nodes.iter().rev().find(|node| node.released && node.name == name));
        found.next().map_or(0, |node| node.sequence_id)
    }

    /// What the layout demands on a node or an edge, before the actions of the test.
    fn demanded(
        &mut self,
        place: &Value,
        order: &str,
        sequence_id: u32,
        fresh: &mut dyn FnMut() -> String,
    ) -> Vec<Value> {
        let mut at = 0;
        demanded_in_order(place, || {
            at += 1;
            let known = self.demanded.entry((order.to_owned(), sequence_id, at));
            known.or_insert_with(&mut *fresh).clone()
        })
    }
}

/// One node of a route, under all the names it has there.
struct Stop {
    /// The name of the node before.
    before: Option<String>,
    names: Vec<String>,
    released: bool,
}

impl Stop {
    fn new(before: Option<&str>, name: &str, released: bool) -> Self {
        Self {
            before: before.map(str::to_owned),
            names: vec![name.to_owned()],
            released,
        }
    }
}

/// Builds nodes and edges.
pub(super) struct RouteBuilder<'a> {
    /// The variable `course`.
    pub(super) course: Option<&'a Value>,
    /// The way.
    pub(super) route: &'a Route,
    /// Finished actions by place.
    pub(super) actions: Vec<(RoutePlace, Vec<Value>)>,
}

impl RouteBuilder<'_> {
    /// The arrays `nodes` and `edges`; `fresh` makes actionIds for what the layout demands.
    pub(super) fn build(
        self,
        order: &str,
        sent: &mut SentOrders,
        fresh: &mut dyn FnMut() -> String,
    ) -> Result<(Value, Value), ComposeError> {
        let route = self.route;
        let names: Vec<(&str, bool)> = route
            .base
            .iter()
            .map(|name| (name.as_str(), true))
            .chain(route.horizon.iter().map(|name| (name.as_str(), false)))
            .collect();
        let first = names.first().map_or(0, |(name, _)| sent.continues_at(order, name));
        let first = route.from.unwrap_or(first);
        let mut nodes = Vec::new();
        let mut edges = Vec::new();
        let mut visited = Vec::new();
        let mut used = vec![false; self.actions.len()];
        for (at, stop) in self.stops(&names)?.iter().enumerate() {
            let sequence_id = first.saturating_add(u32::try_from(at).unwrap_or(u32::MAX).saturating_mul(2));
            let mut actions = Vec::new();
            let last = stop.names.first().map_or("", String::as_str);
            for name in &stop.names {
                let place = RoutePlace::Node(name.clone());
                actions.extend(self.take(&place, &mut used));
                visited.push(Visited {
                    name: name.clone(),
                    sequence_id,
                    released: stop.released,
                });
            }
            if let Some(before) = &stop.before {
                let mut on_edge = self.take(&RoutePlace::Edge(before.clone(), last.to_owned()), &mut used);
                if stop.names.iter().any(|name| is_on_edge(name)) {
                    on_edge.append(&mut actions);
                }
                let sequence_id = sequence_id.saturating_sub(1);
                let place = self.edge_value(before, last)?;
                let mut all = sent.demanded(place, order, sequence_id, fresh);
                all.append(&mut on_edge);
                edges.push(self.edge(before, last, sequence_id, stop.released, all)?);
            }
            let mut all = sent.demanded(self.node_value(last)?, order, sequence_id, fresh);
            all.append(&mut actions);
            nodes.push(self.node(last, sequence_id, stop.released, all)?);
        }
        sent.ways.push((order.to_owned(), visited));
        Ok((Value::Array(nodes), Value::Array(edges)))
    }

    /// The nodes of the order: those of the route, and those of the ways to and from its stations.
    fn stops(&self, names: &[(&str, bool)]) -> Result<Vec<Stop>, ComposeError> {
        let mut stops: Vec<Stop> = Vec::new();
        for (at, (name, released)) in names.iter().enumerate() {
            let Some(before) = at.checked_sub(1).map(|before| names[before].0) else {
                stops.push(Stop::new(None, name, *released));
                continue;
            };
            if !is_station(name) && !is_station(before) {
                stops.push(Stop::new(Some(before), name, *released));
                continue;
            }
            let way = self
                .member("ways", &format!("{before}-{name}"))
                .and_then(Value::as_array)
                .ok_or_else(|| ComposeError::Course(format!("way `{before}-{name}`")))?;
            let mut last = before;
            for next in way.iter().filter_map(Value::as_str) {
                stops.push(Stop::new(Some(last), next, *released));
                last = next;
            }
            // The vehicle is there already.
            if let Some(here) = stops.last_mut().filter(|_| way.is_empty()) {
                here.names.push((*name).to_owned());
            }
        }
        Ok(stops)
    }

    fn take(&self, place: &RoutePlace, used: &mut [bool]) -> Vec<Value> {
        for (at, (other, actions)) in self.actions.iter().enumerate() {
            if other == place && !used[at] {
                used[at] = true;
                return actions.clone();
            }
        }
        Vec::new()
    }

    fn member(&self, group: &str, name: &str) -> Option<&Value> {
        self.course?.get(group)?.get(name)
    }

    fn node_value(&self, name: &str) -> Result<&Value, ComposeError> {
        let missing = || ComposeError::Course(format!("node `{name}`"));
        self.member("nodes", name).ok_or_else(missing)
    }

    fn edge_value(&self, from: &str, to: &str) -> Result<&Value, ComposeError> {
        let missing = || ComposeError::Course(format!("edge `{from}-{to}`"));
        self.member("edges", &format!("{from}-{to}")).ok_or_else(missing)
    }

    fn node(&self, name: &str, sequence_id: u32, released: bool, actions: Vec<Value>) -> Result<Value, ComposeError> {
        let place = self.node_value(name)?;
        let mut node = json!({
            "nodeId": place.get("id"),
            "sequenceId": sequence_id,
            "released": released,
            "actions": actions,
        });
        let position = members(
            place,
            &[
                "x",
                "y",
                "mapId",
                "theta",
                "allowedDeviationXY",
                "allowedDeviationTheta",
            ],
        );
        if position.contains_key("x") {
            node["nodePosition"] = Value::Object(position);
        }
        Ok(node)
    }

    fn edge(
        &self,
        from: &str,
        to: &str,
        sequence_id: u32,
        released: bool,
        actions: Vec<Value>,
    ) -> Result<Value, ComposeError> {
        let edge = self.edge_value(from, to)?;
        let end = |name: &str| {
            self.member("nodes", name)
                .and_then(|node| node.get("id"))
                .cloned()
                .unwrap_or_default()
        };
        let mut built = json!({
            "edgeId": edge.get("id"),
            "sequenceId": sequence_id,
            "released": released,
            "startNodeId": end(from),
            "endNodeId": end(to),
            "actions": actions,
        });
        if let Value::Object(built) = &mut built {
            built.extend(told_in_order(edge));
        }
        Ok(built)
    }
}

/// Whether the actions of a station are for the edge that leads to it.
fn is_on_edge(name: &str) -> bool {
    SampleKind::of_variable(name).is_some_and(|kind| kind.place == Place::Edge)
}

/// The members of these names that are there.
fn members(value: &Value, names: &[&str]) -> Map<String, Value> {
    names
        .iter()
        .filter_map(|name| Some(((*name).to_owned(), value.get(name)?.clone())))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::diagnostic::{Source, Span};

    /// n1, n2 and n3 in a row; the places are on n3, and on the edge from n2 to it.
    fn course() -> Value {
        let node = |id: &str| json!({ "id": id, "mapId": "m", "x": 0.0, "y": 0.0 });
        let edge = |id: &str| json!({ "id": id });
        json!({
            "nodes": { "a": node("n1"), "a>pick.1": node("n2"), "pick": node("n3"), "drop": node("n3"), "edgePick": node("n3"),
                       "a>edgePick.1": node("n2") },
            "edges": { "a-a>pick.1": edge("e1"), "a>pick.1-pick": edge("e2"),
                       "a-a>edgePick.1": edge("e1"), "a>edgePick.1-edgePick": edge("e2") },
            "ways": { "a-pick": ["a>pick.1", "pick"], "pick-drop": [], "a-edgePick": ["a>edgePick.1", "edgePick"] },
        })
    }

    fn built(base: &[&str], horizon: &[&str], place: &str) -> (Value, Value) {
        let own = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let route = Route {
            base: own(base),
            horizon: own(horizon),
            from: None,
            actions: Vec::new(),
            span: Span::new(&Source::new("test", ""), 0, 0),
        };
        let builder = RouteBuilder {
            course: Some(&course()),
            route: &route,
            actions: vec![(RoutePlace::Node(place.to_owned()), vec![json!("work")])],
        };
        let mut count = 0;
        let mut fresh = || {
            count += 1;
            format!("demanded-{count}")
        };
        builder
            .build("o", &mut SentOrders::default(), &mut fresh)
            .expect("a way")
    }

    fn of(list: &Value, member: &str) -> Vec<Value> {
        list.as_array()
            .expect("a list")
            .iter()
            .map(|one| one[member].clone())
            .collect()
    }

    #[test]
    fn a_way_to_a_station_has_all_its_nodes_and_the_action_at_its_end() {
        let (nodes, edges) = built(&["a", "pick"], &[], "pick");
        assert_eq!(of(&nodes, "nodeId"), ["n1", "n2", "n3"]);
        assert_eq!(of(&nodes, "sequenceId"), [0, 2, 4]);
        assert_eq!(of(&edges, "edgeId"), ["e1", "e2"]);
        assert_eq!(of(&nodes, "actions"), [json!([]), json!([]), json!(["work"])]);
        let (nodes, _) = built(&["a"], &["pick"], "pick");
        assert_eq!(of(&nodes, "released"), [true, false, false]);
    }

    #[test]
    fn the_action_of_a_station_on_an_edge_stands_there() {
        let (nodes, edges) = built(&["a", "edgePick"], &[], "edgePick");
        assert_eq!(of(&edges, "actions"), [json!([]), json!(["work"])]);
        assert_eq!(of(&nodes, "actions"), [json!([]), json!([]), json!([])]);
    }

    #[test]
    fn a_vehicle_that_is_there_already_gets_one_node_with_the_action() {
        let (nodes, edges) = built(&["pick", "drop"], &[], "drop");
        assert_eq!(of(&nodes, "nodeId"), ["n3"]);
        assert_eq!(of(&nodes, "actions"), [json!(["work"])]);
        assert_eq!(edges, json!([]));
    }

    #[test]
    fn what_a_layout_says_and_demands_is_in_every_order_under_the_same_ids() {
        let mut course = course();
        let beep = json!({ "actionType": "beep", "blockingType": "NONE", "actionParameters": [] });
        course["nodes"]["b"] = json!({ "id": "n9", "x": 0.0, "demands": [beep, beep] });
        course["edges"]["a-b"] = json!({ "id": "e9", "maxSpeed": 1.0, "orientation": 0.5, "rotationAllowed": false,
            "demands": [beep], "told": ["orientation"] });
        let route = Route {
            base: vec!["a".to_owned(), "b".to_owned()],
            horizon: Vec::new(),
            from: None,
            actions: Vec::new(),
            span: Span::new(&Source::new("test", ""), 0, 0),
        };
        let (mut count, mut sent) = (0, SentOrders::default());
        let mut fresh = || {
            count += 1;
            format!("demanded-{count}")
        };
        let mut order = |id: &str| {
            let builder = RouteBuilder {
                course: Some(&course),
                route: &route,
                actions: vec![(RoutePlace::Node("b".to_owned()), vec![json!({ "actionId": "work" })])],
            };
            builder.build(id, &mut sent, &mut fresh).expect("a way")
        };
        let (nodes, edges) = order("o");
        assert_eq!(
            of(&nodes[1]["actions"], "actionId"),
            ["demanded-2", "demanded-3", "work"]
        );
        assert_eq!(edges[0]["orientation"], 0.5);
        assert_eq!(edges[0]["maxSpeed"], 1.0);
        assert_eq!(edges[0].get("rotationAllowed"), None);
        assert_eq!(edges[0]["actions"][0]["actionType"], "beep");
        assert_eq!(edges[0]["actions"][0]["actionId"], "demanded-1");
        assert_eq!(order("o"), (nodes, edges), "the same order once more");
        assert_eq!(
            of(&order("p").0[1]["actions"], "actionId"),
            ["demanded-5", "demanded-6", "work"]
        );
    }
}
