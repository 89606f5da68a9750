//! `layout.nodes` and `layout.edges`.

use toml::Spanned;
use toml::de::DeValue;

use super::Reader;
use crate::{LayoutEdge, LayoutList, LayoutNode};
use tck_base::diagnostic::{self, Diagnostic};

impl Reader<'_> {
    pub(super) fn node(&mut self, item: &Spanned<DeValue<'_>>) -> Option<LayoutNode> {
        const KNOWN: [&str; 7] = ["id", "x", "y", "theta", "map", "deviation-xy", "deviation-theta"];
        const METRES: (f64, f64) = (-10_000.0, 10_000.0);
        const TURN: (f64, f64) = (-std::f64::consts::PI, std::f64::consts::PI);
        let members = self.members("a node", item, &KNOWN, &["id", "x", "y", "map"])?;
        let id = self.text("the id of a node", members.get("id")?);
        let map_id = self.text("the map of a node", members.get("map")?);
        let x = self.number(
            "x of a node",
            members.get("x")?,
            METRES,
            "metres, at most 10 km from the origin",
        );
        let y = self.number(
            "y of a node",
            members.get("y")?,
            METRES,
            "metres, at most 10 km from the origin",
        );
        let mut optional = |name: &str, limits, expected: &str| match members.get(name) {
            Some(value) => self
                .number(&format!("{name} of a node"), value, limits, expected)
                .map(Some),
            None => Some(None),
        };
        let theta = optional("theta", TURN, "radians from -π to π");
        let deviation_xy = optional("deviation-xy", (0.0, METRES.1), "metres, 0 or more");
        let deviation_theta = optional("deviation-theta", (0.0, TURN.1), "radians from 0 to π");
        Some(LayoutNode {
            id: id?,
            map_id: map_id?,
            x: x?,
            y: y?,
            theta: theta?,
            deviation_xy: deviation_xy?,
            deviation_theta: deviation_theta?,
            span: self.span(item.span()),
        })
    }

    pub(super) fn edge(&mut self, item: &Spanned<DeValue<'_>>) -> Option<LayoutEdge> {
        let members = self.members(
            "an edge",
            item,
            &["id", "from", "to", "direction"],
            &["id", "from", "to"],
        )?;
        let id = self.text("the id of an edge", members.get("id")?);
        let start = self.text("the start of an edge", members.get("from")?);
        let end = self.text("the end of an edge", members.get("to")?);
        let direction = match members.get("direction") {
            Some(value) => self.text("the direction of an edge", value).map(Some),
            None => Some(None),
        };
        Some(LayoutEdge {
            id: id?,
            start: start?,
            end: end?,
            direction: direction?,
            span: self.span(item.span()),
        })
    }

    pub(super) fn check_list(&mut self, list: &LayoutList) {
        let ids: Vec<&str> = list.nodes.iter().map(|node| node.id.as_str()).collect();
        let mut wrong = Vec::new();
        for (at, node) in list.nodes.iter().enumerate() {
            if ids[..at].contains(&node.id.as_str()) {
                let title = format!("there are two nodes `{}`", node.id);
                wrong.push(Diagnostic::new(
                    "duplicate-node",
                    node.span.clone(),
                    title,
                    "the second one",
                ));
            }
        }
        for (at, edge) in list.edges.iter().enumerate() {
            if list.edges[..at].iter().any(|other| other.id == edge.id) {
                let title = format!("there are two edges `{}`", edge.id);
                wrong.push(Diagnostic::new(
                    "duplicate-edge",
                    edge.span.clone(),
                    title,
                    "the second one",
                ));
            }
            for end in [&edge.start, &edge.end] {
                if !ids.contains(&end.as_str()) {
                    let title = format!("edge `{}` ends at the unknown node `{end}`", edge.id);
                    let hint = diagnostic::did_you_mean(end, ids.iter().copied());
                    wrong.push(Diagnostic::new("unknown-node", edge.span.clone(), title, "this edge").hint(hint));
                }
            }
            if edge.start == edge.end {
                let title = format!("edge `{}` ends where it begins", edge.id);
                wrong.push(Diagnostic::new("bad-value", edge.span.clone(), title, "this edge"));
            }
        }
        self.wrong.extend(wrong);
    }
}
