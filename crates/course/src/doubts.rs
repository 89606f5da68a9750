//! What looks wrong in a layout and does not keep a vehicle from driving by it: curves that lie beside their nodes.

use super::layout::{Layout, Node};
use tck_base::nurbs::Curve;

/// How far the end of a curve may be from its node, in metres.
const END: f64 = 0.5;

impl Layout {
    /// What looks wrong in it, one sentence each.
    #[must_use]
    pub fn doubts(&self) -> Vec<String> {
        let mut all = Vec::new();
        for edge in self.edges() {
            let Some(trajectory) = &edge.trajectory else { continue };
            let id = &edge.id;
            let (curve, flaws) = Curve::read(trajectory);
            all.extend(flaws.iter().map(|flaw| format!("the curve of edge `{id}`: {flaw}")));
            let Some((start, end)) = curve.as_ref().and_then(Curve::ends) else {
                continue;
            };
            let ends = [(&edge.start, start, "begins"), (&edge.end, end, "ends")];
            for (node, point, verb) in ends {
                let apart = |node: &Node| (node.x - point.0).hypot(node.y - point.1);
                if let Some(apart) = self.node(node).map(apart).filter(|apart| *apart > END) {
                    all.push(format!(
                        "the curve of edge `{id}` {verb} {apart:.1} m from node `{node}`"
                    ));
                }
            }
        }
        all
    }

    /// How many edges have a curve of their own.
    #[must_use]
    pub fn curves(&self) -> usize {
        self.edges().filter(|edge| edge.trajectory.is_some()).count()
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
        assert_eq!(layout.curves(), usize::from(!trajectory.is_null()));
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
        assert_eq!(
            doubts(&curve(0.0, 15.0)),
            ["the curve of edge `e` begins 5.0 m from node `a`"]
        );
        assert_eq!(
            doubts(&curve(15.0, 5.0)),
            [
                "the curve of edge `e` begins 10.0 m from node `a`",
                "the curve of edge `e` ends 10.0 m from node `b`"
            ]
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
