//! Drawings of a layout: as text for a terminal, and as SVG.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::picture::{Dot, Line, LineKind, Picture, Room, escaped, head};
use super::{Edge, Layout, Node};

/// How large a drawing of text is at most, in characters.
const COLUMNS: usize = 76;
const ROWS: usize = 24;
/// A floor with more nodes is not drawn as text: their names would cover each other.
const NAMED: usize = 60;

impl Layout {
    /// Each map as text: nodes by their ids, stations in brackets, edges as dots, and below it what can be driven in one
    /// direction only. Empty where there are no nodes; a count where there are too many.
    #[must_use]
    pub fn as_text(&self) -> String {
        let mut text = String::new();
        for map in self.maps() {
            let nodes: Vec<&Node> = self.nodes().filter(|node| node.map_id == map).collect();
            let _ = writeln!(text, "map {map}");
            if nodes.len() > NAMED {
                let _ = writeln!(text, "  {} nodes, too many to be drawn as text", nodes.len());
            } else {
                text.push_str(&self.plan_of(&nodes));
            }
            let one_way: Vec<String> = self
                .edges()
                .filter(|edge| self.node(&edge.start).is_some_and(|start| start.map_id == map))
                .filter(|edge| self.edge(&edge.end, &edge.start).is_none())
                .map(|edge| format!("{} -> {}", edge.start, edge.end))
                .collect();
            if !one_way.is_empty() && nodes.len() <= NAMED {
                let _ = writeln!(text, "  in one direction only: {}", one_way.join(", "));
            }
        }
        text
    }

    fn maps(&self) -> BTreeSet<&str> {
        self.nodes().map(|node| node.map_id.as_str()).collect()
    }

    fn plan_of(&self, nodes: &[&Node]) -> String {
        let longest = nodes.iter().map(|node| label(node).chars().count()).max().unwrap_or(1);
        let frame = Frame::of(nodes, COLUMNS.saturating_sub(longest).max(1), ROWS);
        let mut cells = vec![vec![' '; COLUMNS + longest]; ROWS + 1];
        let ends = |edge: &Edge| {
            let find = |id: &str| nodes.iter().find(|node| node.id == id);
            Some((frame.cell(find(&edge.start)?), frame.cell(find(&edge.end)?)))
        };
        for ((x1, y1), (x2, y2)) in self.edges().filter_map(ends) {
            let steps = x1.abs_diff(x2).max(y1.abs_diff(y2)).max(1);
            let between = |from: usize, to: usize, step: usize| (from * (steps - step) + to * step + steps / 2) / steps;
            for step in 1..steps {
                cells[between(y1, y2, step)][between(x1, x2, step)] = '.';
            }
        }
        for node in nodes {
            let (x, y) = frame.cell(node);
            for (at, letter) in label(node).chars().enumerate() {
                if let Some(cell) = cells[y].get_mut(x + at) {
                    *cell = letter;
                }
            }
        }
        let lines = cells.iter().map(|line| line.iter().collect::<String>());
        let lines: Vec<String> = lines.map(|line| line.trim_end().to_owned()).collect();
        let used = lines
            .iter()
            .rposition(|line| !line.is_empty())
            .map_or(0, |last| last + 1);
        lines[..used].iter().fold(String::new(), |mut text, line| {
            let _ = writeln!(text, "{}", format!("  {line}").trim_end());
            text
        })
    }

    /// All maps below each other as SVG: nodes with their ids, stations as squares, edges as arrows, curves as curves.
    #[must_use]
    pub fn as_svg(&self) -> String {
        let room = Room::SHEET;
        let mut body = String::new();
        let mut top = 0.0;
        for map in self.maps() {
            let _ = writeln!(
                body,
                "<text x=\"{}\" y=\"{:.0}\" class=\"map\">{}</text>",
                room.border,
                top + 24.0,
                escaped(map)
            );
            let mut picture = self.picture_of(map);
            picture.settle();
            let frame = picture.frame(room, top);
            body.push_str(&picture.body(&frame, "floor"));
            top += frame.height;
        }
        let (width, height) = (room.width + 2.0 * room.border, top.max(1.0));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"course\" viewBox=\"0 0 {width:.0} {height:.0}\">\n{}{body}</svg>\n",
            head("floor")
        )
    }

    /// What lies on one map.
    fn picture_of(&self, map: &str) -> Picture {
        let lies_here = |id: &str| self.node(id).is_some_and(|node| node.map_id == map);
        let lines = self.edges().filter(|edge| lies_here(&edge.start)).map(|edge| Line {
            kind: LineKind::Edge,
            points: self.line(edge),
            name: edge.id.clone(),
        });
        let nodes = self.nodes().filter(|node| node.map_id == map).map(|node| Dot {
            x: node.x,
            y: node.y,
            name: node.id.clone(),
            station: node.station,
        });
        Picture {
            lines: lines.collect(),
            nodes: nodes.collect(),
            ..Picture::default()
        }
    }
}

/// A node as it is named in a drawing of text.
fn label(node: &Node) -> String {
    if node.station {
        format!("[{}]", node.id)
    } else {
        node.id.clone()
    }
}

/// What nodes take up, in metres.
struct Bounds {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Bounds {
    fn of(nodes: &[&Node]) -> Self {
        let mut bounds = Self {
            left: f64::INFINITY,
            right: f64::NEG_INFINITY,
            top: f64::NEG_INFINITY,
            bottom: f64::INFINITY,
        };
        for node in nodes {
            bounds.left = bounds.left.min(node.x);
            bounds.right = bounds.right.max(node.x);
            bounds.top = bounds.top.max(node.y);
            bounds.bottom = bounds.bottom.min(node.y);
        }
        bounds
    }

    /// A floor that is only a line has a width, too.
    fn width(&self) -> f64 {
        (self.right - self.left).max(1.0)
    }

    fn height(&self) -> f64 {
        (self.top - self.bottom).max(1.0)
    }
}

/// Where nodes stand in a drawing of text.
struct Frame {
    bounds: Bounds,
    columns: usize,
    rows: usize,
}

impl Frame {
    fn of(nodes: &[&Node], columns: usize, rows: usize) -> Self {
        Self {
            bounds: Bounds::of(nodes),
            columns,
            rows,
        }
    }

    fn cell(&self, node: &Node) -> (usize, usize) {
        // A character is about twice as high as it is wide.
        let scale = (self.columns as f64 / self.bounds.width()).min(2.0 * self.rows as f64 / self.bounds.height());
        let x = (node.x - self.bounds.left) * scale;
        let y = (self.bounds.top - node.y) * scale / 2.0;
        (whole(x, self.columns), whole(y, self.rows))
    }
}

/// The cell at a place, which lies in the frame.
fn whole(place: f64, most: usize) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to the size of the frame"
    )]
    let at = place.round().max(0.0) as usize;
    at.min(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(nodes: &[(&str, f64, f64)], edges: &[(&str, &str)]) -> Layout {
        let node = |(id, x, y): &(&str, f64, f64)| Node {
            id: (*id).to_owned(),
            map_id: "hall".to_owned(),
            x: *x,
            y: *y,
            theta: None,
            deviation_xy: None,
            deviation_theta: None,
            station: false,
            demands: Vec::new(),
        };
        let edge = |(start, end): &(&str, &str)| Edge {
            id: format!("{start}-{end}"),
            start: (*start).to_owned(),
            end: (*end).to_owned(),
            ..Edge::default()
        };
        Layout::assemble(
            nodes.iter().map(node).collect(),
            edges.iter().map(edge).collect(),
            Vec::new(),
        )
    }

    #[test]
    fn nodes_lie_where_they_are_and_one_way_edges_are_named() {
        let corner = layout(
            &[("a", 0.0, 0.0), ("b", 10.0, 0.0), ("c", 10.0, 5.0)],
            &[("a", "b"), ("b", "a"), ("b", "c")],
        );
        let text = corner.as_text();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "map hall");
        let row = |id: &str| lines.iter().position(|line| line.ends_with(id)).unwrap();
        assert!(row("c") < row("b"), "{text}");
        assert!(lines[row("b")].starts_with("  a...."), "{text}");
        assert!(text.contains("in one direction only: b -> c\n"), "{text}");
    }

    #[test]
    fn a_drawing_has_every_node_and_edge_and_hostile_names_stay_names() {
        let floor = layout(&[("<b>", 0.0, 0.0), ("b&", 3.0, 0.0)], &[("<b>", "b&")]);
        let svg = floor.as_svg();
        let drawn = roxmltree::Document::parse(&svg).expect("XML");
        let count = |name: &str| drawn.descendants().filter(|one| one.tag_name().name() == name).count();
        assert_eq!((count("circle"), count("polyline")), (2, 1));
        assert!(svg.contains("&lt;b&gt;"));
    }

    #[test]
    fn any_floor_can_be_drawn() {
        assert_eq!(Layout::default().as_text(), "");
        let built_in = Layout::built_in();
        assert!(built_in.as_text().contains("[E3]"));
        assert!(built_in.as_svg().contains("<rect"));
        let many: Vec<(String, f64)> = (0..200).map(|at| (format!("n{at}"), f64::from(at))).collect();
        let many: Vec<(&str, f64, f64)> = many.iter().map(|(id, x)| (id.as_str(), *x, 0.0)).collect();
        assert!(layout(&many, &[]).as_text().contains("200 nodes"));
    }
}
