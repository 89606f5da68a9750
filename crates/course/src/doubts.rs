//! What looks wrong in a layout and does not keep a vehicle from driving on it: curves that lie beside their nodes. They go into
//! no order.

use super::layout::{Edge, Layout, Node};
use tck_base::nurbs::{Curve, Flaw};

/// How far the end of a curve may be from its node, in metres.
const END: f64 = 0.5;

/// What a curve has to be like.
const HINT: &str = "a curve begins at startNodeId and ends at endNodeId, in metres from the same origin";

/// A curve that does not lead from node to node.
pub(super) struct Miss {
    /// edgeId.
    pub(super) id: String,
    /// What is wrong with it.
    what: String,
}

impl Edge {
    /// Its curve, where it has one that can be calculated with, and what is wrong with it.
    pub(super) fn curve(&self) -> Option<(Option<Curve>, Vec<Flaw>)> {
        self.trajectory.as_ref().map(Curve::read)
    }
}

impl Layout {
    /// What looks wrong in it, one sentence each.
    #[must_use]
    pub fn doubts(&self) -> Vec<String> {
        let all = self.misses();
        all.map(|Miss { id, what }| format!("the curve of edge `{id}` {what}"))
            .collect()
    }

    /// The curves that do not lead from node to node.
    pub(super) fn misses(&self) -> impl Iterator<Item = Miss> {
        self.edges().flat_map(move |edge| {
            let all = self.wrong_with(edge).into_iter();
            all.map(move |what| Miss {
                id: edge.id.clone(),
                what,
            })
        })
    }

    /// What is wrong with the curve of an edge.
    fn wrong_with(&self, edge: &Edge) -> Vec<String> {
        let Some((curve, flaws)) = edge.curve() else {
            return Vec::new();
        };
        let mut all: Vec<String> = flaws.iter().map(|flaw| format!("is none: {flaw}")).collect();
        let ends = curve.as_ref().and_then(Curve::ends);
        let nodes = self.node(&edge.start).zip(self.node(&edge.end));
        let Some(((first, last), (start, end))) = ends.zip(nodes) else {
            return all;
        };
        let apart = |node: &Node, point: (f64, f64)| (node.x - point.0).hypot(node.y - point.1);
        let off = [("begins", start, apart(start, first)), ("ends", end, apart(end, last))];
        let is_turned = off.iter().all(|(.., apart)| *apart > END);
        if is_turned && apart(start, last) <= END && apart(end, first) <= END {
            all.push(format!(
                "runs the other way: it begins {:.1} m from node `{}`; turn its control points round",
                apart(start, first),
                edge.start
            ));
            return all;
        }
        let off = off.into_iter().filter(|(.., apart)| *apart > END);
        all.extend(off.map(|(verb, node, apart)| format!("{verb} {apart:.1} m from node `{}`; {HINT}", node.id)));
        all
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;
    use tck_base::diagnostic::Source;

    use super::Layout;

    /// A layout with one edge from (5, 0) to (15, 0) and this curve.
    fn one_edge(trajectory: &serde_json::Value) -> Layout {
        let node = |id: &str, x: f64| {
            json!({ "nodeId": id, "mapId": "m", "nodePosition": { "x": x, "y": 0.0 },
                "vehicleTypeNodeProperties": [{ "vehicleTypeId": "T", "theta": 0.0 }] })
        };
        let edge = json!({ "edgeId": "e", "startNodeId": "a", "endNodeId": "b",
            "vehicleTypeEdgeProperties": [{ "vehicleTypeId": "T", "trajectory": trajectory }] });
        let layout = json!({ "layoutId": "l", "nodes": [node("a", 5.0), node("b", 15.0)], "edges": [edge] });
        let file = json!({ "metaInformation": { "lifVersion": "1.0.0" }, "layouts": [layout] });
        let layout = Layout::from_lif(&Source::new("hall.lif.json", file.to_string()), None).expect("a layout");
        let has_curve = layout.edges().any(|edge| edge.trajectory.is_some());
        assert_eq!(has_curve, !trajectory.is_null());
        layout
    }

    fn doubts(trajectory: &serde_json::Value) -> Vec<String> {
        one_edge(trajectory).doubts()
    }

    fn curve(from: f64, to: f64) -> serde_json::Value {
        json!({ "degree": 1, "knotVector": [0.0, 0.0, 1.0, 1.0],
            "controlPoints": [{ "x": from, "y": 0.0 }, { "x": to, "y": 0.0 }] })
    }

    #[test]
    fn a_curve_beside_its_nodes_is_named_and_a_right_one_is_not() {
        assert!(doubts(&serde_json::Value::Null).is_empty());
        assert!(doubts(&curve(5.0, 15.4)).is_empty());
        let begins = doubts(&curve(0.0, 15.0));
        assert!(
            begins[0].starts_with("the curve of edge `e` begins 5.0 m from node `a`; ") && begins.len() == 1,
            "{begins:?}"
        );
        let both = doubts(&curve(10.0, 30.0));
        assert!(
            both[0].contains("begins 5.0 m from node `a`") && both[1].contains("ends 15.0 m from node `b`"),
            "{both:?}"
        );
        let turned = doubts(&curve(15.0, 5.0));
        assert!(
            turned.len() == 1 && turned[0].contains("runs the other way"),
            "{turned:?}"
        );
        assert!(!doubts(&json!({ "degree": 3, "knotVector": [0.0], "controlPoints": [] })).is_empty());
    }

    #[test]
    fn the_way_over_an_edge_is_its_curve_or_the_straight_line_between_its_nodes() {
        let line = |trajectory: &serde_json::Value| {
            let layout = one_edge(trajectory);
            let edge = layout.edges().next().expect("an edge").clone();
            layout.line(&edge)
        };
        let straight = [(5.0, 0.0), (15.0, 0.0)];
        assert_eq!(line(&serde_json::Value::Null), straight);
        let unreadable = json!({ "degree": 3, "knotVector": [0.0], "controlPoints": [] });
        assert_eq!(line(&unreadable), straight);
        let bow = json!({ "degree": 2, "knotVector": [0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
            "controlPoints": [{ "x": 5.0, "y": 0.0 }, { "x": 10.0, "y": 4.0 }, { "x": 15.0, "y": 0.0 }] });
        let points = line(&bow);
        assert!(points.len() > 2 && points.iter().any(|(_, y)| *y > 1.5), "{points:?}");
    }
}
