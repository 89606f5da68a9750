//! Courses for a master control under test: it plans its own ways, so its tests name nodes by how far they are.
//!
//! `b`, `c`, `d` … are the first, second, third … node on one of the shortest ways from `a`, where the vehicle stands.
//! A transport to `d` thus leads over three edges, whatever way is taken, unless a longer one is. `far` is another node
//! that is not on this way.

use super::assign::add_ways;
use super::graph::Graph;
use super::ways::{Stop, way};
use super::{Course, CourseError, CourseNeed, FAR, HERE, Layout, Standing, is_station};

impl Layout {
    /// Gives the names a test of a master control asks for to nodes.
    ///
    /// # Errors
    /// When the vehicle stands on no node, or no node is as far away as the test asks.
    pub fn outward(&self, need: &CourseNeed, standing: &Standing) -> Result<Course, CourseError> {
        let start = self.standing(standing)?;
        let graph = Graph::of(self, &start.id);
        let stops = self.stops(need, &graph)?;
        let letters = need.nodes.iter().filter(|name| *name != FAR && !is_station(name));
        let steps = letters.filter_map(|name| place_of(name)).max().unwrap_or(0);
        let path = path(&graph, steps, true).ok_or_else(|| {
            let start = start.id.clone();
            match path(&graph, steps, false) {
                Some(_) => CourseError::NoWayBack { start, steps },
                None => CourseError::TooNear { start, steps },
            }
        })?;
        let mut course = Course::default();
        course.nodes.insert(HERE.to_owned(), graph.nodes[0].clone());
        for (number, node) in path.iter().enumerate() {
            course.nodes.insert(name_of(number + 1), graph.nodes[*node].clone());
        }
        for (name, stop) in &stops {
            course.nodes.insert(name.clone(), graph.nodes[stop.node].clone());
        }
        let taken: Vec<usize> = std::iter::once(0).chain(path).collect();
        if need.nodes.iter().any(|name| name == FAR)
            && let Some(far) = graph.far(&taken)
        {
            course.nodes.insert(FAR.to_owned(), far.clone());
        }
        add_ways(&mut course, &graph, need, &stops)?;
        self.add_edges(&mut course);
        Ok(course)
    }
}

/// A shortest way of exactly so many edges that avoids stations, and from whose end the vehicle can come back if it is to
/// return; of several the shortest in metres, always the same.
fn path(graph: &Graph<'_>, steps: usize, returning: bool) -> Option<Vec<usize>> {
    if steps == 0 {
        return Some(Vec::new());
    }
    let mut best: Option<(f64, Vec<usize>)> = None;
    for (at, node) in graph.nodes.iter().enumerate().skip(1) {
        if node.station || (returning && !graph.returns(at)) {
            continue;
        }
        let stop = Stop { node: at, before: None };
        let found = way(graph, 0, stop).filter(|way| way.len() == steps);
        let Some(way) = found.filter(|way| way.iter().all(|inner| !graph.nodes[*inner].station)) else {
            continue;
        };
        let starts = std::iter::once(&0).chain(&way);
        let metres: f64 = starts
            .zip(&way)
            .filter_map(|(from, to)| graph.ways[*from].get(to))
            .sum();
        // Of equals the first one by id.
        if best.as_ref().is_none_or(|(shortest, _)| metres < shortest - 0.001) {
            best = Some((metres, way));
        }
    }
    best.map(|(_, way)| way)
}

/// `b` is the first node on the way, and so on.
fn place_of(name: &str) -> Option<usize> {
    let mut letters = name.bytes();
    match (letters.next(), letters.next()) {
        (Some(letter @ b'a'..=b'z'), None) => Some(usize::from(letter - b'a')),
        _ => None,
    }
}

fn name_of(place: usize) -> String {
    let letter = u8::try_from(place).ok().and_then(|place| b'a'.checked_add(place));
    char::from(letter.unwrap_or(b'z')).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Edge, Node};
    use tck_profile::SampleActions;

    fn need(names: &[&str]) -> CourseNeed {
        CourseNeed {
            nodes: names.iter().map(|name| (*name).to_owned()).collect(),
            ..CourseNeed::default()
        }
    }

    #[test]
    fn names_lie_on_one_shortest_way() {
        let layout = Layout::built_in().with_stations(&SampleActions::default());
        let first = layout.nodes().next().unwrap().id.clone();
        let course = layout
            .outward(&need(&["d", "far"]), &Standing::Node(first.clone()))
            .unwrap();
        assert_eq!(course.node("a").unwrap().id, first);
        for (from, to) in [("a", "b"), ("b", "c"), ("c", "d")] {
            assert!(course.edge(from, to).is_some(), "{from}-{to}");
        }
        let far = &course.node("far").unwrap().id;
        assert!(
            ["a", "b", "c", "d"]
                .iter()
                .all(|name| course.node(name).unwrap().id != *far)
        );
    }

    #[test]
    fn a_floor_of_one_way_edges_is_told_from_one_that_is_too_small() {
        let node = |number: usize| Node {
            id: format!("n{number}"),
            map_id: "hall".to_owned(),
            x: number as f64,
            y: 0.0,
            theta: None,
            deviation_xy: None,
            deviation_theta: None,
            station: false,
            demands: Vec::new(),
        };
        let edge = |number: usize| Edge {
            id: format!("e{number}"),
            start: format!("n{number}"),
            end: format!("n{}", number + 1),
            ..Edge::default()
        };
        let line = Layout::assemble((1..=7).map(node).collect(), (1..7).map(edge).collect(), Vec::new());
        let why = |names: &[&str]| {
            let found = line.outward(&need(names), &Standing::Node("n1".to_owned()));
            found.unwrap_err().to_string()
        };
        let three = why(&["d"]);
        assert!(three.contains("3 edges away from \"n1\" a way leads back"), "{three}");
        assert!(why(&["j"]).starts_with("no node of the layout is 9 edges away"));
    }

    #[test]
    fn a_layout_that_is_too_small_is_said_so() {
        let layout = Layout::built_in();
        let first = layout.nodes().next().unwrap().id.clone();
        let error = layout.outward(&need(&["z"]), &Standing::Node(first)).unwrap_err();
        assert!(matches!(error, CourseError::TooNear { steps: 25, .. }), "{error}");
    }
}
