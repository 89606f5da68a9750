//! Giving the names of a test to nodes of a layout: a bounded search that prefers short ways.

use std::collections::{BTreeMap, BTreeSet};

use super::graph::Graph;
use super::ways::{self, Stop};
use super::{Course, CourseError, CourseNeed, Edge, FAR, HERE, Layout, Node, Standing, is_station};

/// How far from a node the vehicle may stand to be on it, in metres, unless the node allows more.
const TOLERANCE: f64 = 0.5;

/// How many nodes may be tried. Far above what a test of six nodes needs on a floor where they are joined
/// to eight others each, and a fraction of a second.
const BUDGET: u32 = 100_000;

impl Layout {
    /// The node where the vehicle stands.
    ///
    /// # Errors
    /// When it is not in the layout, or none is near enough.
    pub fn standing(&self, standing: &Standing) -> Result<&Node, CourseError> {
        match standing {
            Standing::Node(id) => self.node(id).ok_or_else(|| self.unknown(id)),
            Standing::Pose { map, x, y } => {
                let nearest = self
                    .nodes()
                    .filter(|node| node.map_id == *map)
                    .min_by(|one, other| one.distance(*x, *y).total_cmp(&other.distance(*x, *y)));
                let on = |node: &&Node| node.distance(*x, *y) <= node.deviation_xy.unwrap_or(0.0).max(TOLERANCE);
                nearest.filter(on).ok_or_else(|| CourseError::OnNoNode {
                    map: map.clone(),
                    x: *x,
                    y: *y,
                    nearest: match nearest {
                        Some(node) => format!(
                            "the nearest node, {:?}, is {:.2} m away",
                            node.id,
                            node.distance(*x, *y)
                        ),
                        None => "the layout has no node on that map".to_owned(),
                    },
                })
            }
        }
    }

    /// Gives the names a test asks for to different nodes, joined as it asks; `a` is where the vehicle
    /// stands. Of several ways to do so the shortest found is taken, always the same one, and one from
    /// which the vehicle can come back is preferred.
    ///
    /// # Errors
    /// When the vehicle stands on no node, or the layout cannot give what the test asks.
    pub fn assign(&self, need: &CourseNeed, standing: &Standing) -> Result<Course, CourseError> {
        let start = self.standing(standing)?;
        let names = names_of(need);
        if need.edges.iter().any(|(from, to)| from == to) {
            return Err(unsatisfiable(need, names.len(), start));
        }
        let graph = Graph::of(self, &start.id);
        let stops = self.stops(need, &graph)?;
        let taken: BTreeSet<usize> = stops.values().map(|stop| stop.node).collect();
        let mut budget = BUDGET;
        for returning in [true, false] {
            let mut search = Search::new(&graph, need, &names, &taken, returning, budget);
            search.place(1, 0.0);
            budget = search.budget;
            if let Some((_, places)) = search.best {
                let course = self
                    .course(&graph, need, &names, &places, &stops)?
                    .ok_or_else(|| unsatisfiable(need, names.len() + 1, start));
                return course;
            }
            if budget == 0 {
                return Err(CourseError::GivenUp);
            }
        }
        Err(unsatisfiable(need, names.len(), start))
    }

    /// The shortest way, edge by edge, to a node from which there is a course that `fits`; `None` where there is none.
    #[must_use]
    pub fn way_to_fit(
        &self,
        need: &CourseNeed,
        standing: &Standing,
        fits: impl Fn(&Node, &Course) -> bool,
    ) -> Option<Vec<&Edge>> {
        let start = self.standing(standing).ok()?;
        let graph = Graph::of(self, &start.id);
        let mut ways: Vec<Vec<usize>> = (1..graph.nodes.len())
            .filter_map(|node| ways::way(&graph, 0, Stop { node, before: None }))
            .collect();
        ways.sort_by_key(Vec::len);
        let way = ways.into_iter().find(|way| {
            let Some(end) = way.last().map(|end| graph.nodes[*end]) else {
                return false;
            };
            let course = self.assign(need, &Standing::Node(end.id.clone()));
            course.is_ok_and(|course| fits(end, &course))
        })?;
        let starts = std::iter::once(&0).chain(&way);
        let edges = starts.zip(&way);
        edges
            .map(|(from, to)| self.edge(&graph.nodes[*from].id, &graph.nodes[*to].id))
            .collect()
    }

    /// The course of these places; `None` if there is no node left for `far`.
    fn course(
        &self,
        graph: &Graph<'_>,
        need: &CourseNeed,
        names: &[&str],
        places: &[usize],
        stops: &BTreeMap<String, Stop>,
    ) -> Result<Option<Course>, CourseError> {
        let mut course = Course::default();
        for (name, place) in names.iter().zip(places) {
            course.nodes.insert((*name).to_owned(), graph.nodes[*place].clone());
        }
        for (name, stop) in stops {
            course.nodes.insert(name.clone(), graph.nodes[stop.node].clone());
        }
        if need.nodes.iter().any(|name| name == FAR) && !course.nodes.contains_key(FAR) {
            let Some(far) = graph.far(places) else { return Ok(None) };
            course.nodes.insert(FAR.to_owned(), far.clone());
        }
        add_ways(&mut course, graph, need, stops)?;
        self.add_edges(&mut course);
        Ok(Some(course))
    }

    /// Adds every edge between two named nodes.
    pub(super) fn add_edges(&self, course: &mut Course) {
        let ids: Vec<(String, String)> = course
            .nodes
            .iter()
            .map(|(name, node)| (name.clone(), node.id.clone()))
            .collect();
        for (from, start) in &ids {
            for (to, end) in &ids {
                if let Some(edge) = self.edge(start, end) {
                    course.edges.insert((from.clone(), to.clone()), edge.clone());
                }
            }
        }
    }
}

/// Adds the ways to and from stations, with a name for every node on them.
pub(super) fn add_ways(
    course: &mut Course,
    graph: &Graph<'_>,
    need: &CourseNeed,
    stops: &BTreeMap<String, Stop>,
) -> Result<(), CourseError> {
    let place = |course: &Course, name: &str| graph.place(&course.nodes.get(name)?.id);
    for (from, to) in &need.ways {
        let (Some(start), Some(end)) = (place(course, from), place(course, to)) else {
            continue;
        };
        let stop = stops.get(to).copied().unwrap_or(Stop {
            node: end,
            before: None,
        });
        let way =
            ways::way(graph, start, stop).ok_or_else(|| ways::no_way(graph.nodes[start], graph.nodes[stop.node]))?;
        let mut names = Vec::with_capacity(way.len());
        for (at, inner) in way.iter().enumerate() {
            let name = if at + 1 == way.len() {
                to.clone()
            } else {
                ways::inner_name(from, to, at + 1)
            };
            course
                .nodes
                .entry(name.clone())
                .or_insert_with(|| graph.nodes[*inner].clone());
            names.push(name);
        }
        course.ways.insert((from.clone(), to.clone()), names);
    }
    Ok(())
}

/// The names to be searched for: `a` first, then as the test uses them. Stations are known, and `far` is found
/// afterwards, unless the test wants edges to it.
fn names_of(need: &CourseNeed) -> Vec<&str> {
    let in_edges = need.edges.iter().flat_map(|(from, to)| [from.as_str(), to.as_str()]);
    let mut names = vec![HERE];
    for name in need
        .nodes
        .iter()
        .map(String::as_str)
        .filter(|name| *name != FAR && !is_station(name))
        .chain(in_edges)
    {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

fn unsatisfiable(need: &CourseNeed, nodes: usize, start: &Node) -> CourseError {
    let edges: Vec<String> = need.edges.iter().map(|(from, to)| format!("{from}-{to}")).collect();
    CourseError::Unsatisfiable {
        nodes,
        start: start.id.clone(),
        edges: match edges[..] {
            [] => String::new(),
            _ => format!(" ({})", edges.join(", ")),
        },
    }
}

/// Depth-first over the names, cutting off what is already longer than the best found.
struct Search<'g, 'a> {
    graph: &'g Graph<'a>,
    /// For each name: earlier names it must be joined to, and whether the edge leads from (true) or to them.
    joins: Vec<Vec<(usize, bool)>>,
    /// Stations of the test, which get no other name. Where the vehicle stands may be one.
    taken: &'g BTreeSet<usize>,
    returning: bool,
    budget: u32,
    places: Vec<usize>,
    best: Option<(f64, Vec<usize>)>,
}

impl<'g, 'a> Search<'g, 'a> {
    fn new(
        graph: &'g Graph<'a>,
        need: &CourseNeed,
        names: &[&str],
        taken: &'g BTreeSet<usize>,
        returning: bool,
        budget: u32,
    ) -> Self {
        let number = |name: &str| names.iter().position(|other| *other == name);
        let mut joins = vec![Vec::new(); names.len()];
        for (from, to) in &need.edges {
            let (Some(from), Some(to)) = (number(from), number(to)) else {
                continue;
            };
            let join = if from < to {
                (to, (from, true))
            } else {
                (from, (to, false))
            };
            if !joins[join.0].contains(&join.1) {
                joins[join.0].push(join.1);
            }
        }
        Self {
            graph,
            joins,
            taken,
            returning,
            budget,
            places: vec![0],
            best: None,
        }
    }

    /// The length of the edges that joining `place` to the earlier names takes; `None` if one is missing.
    fn length(&self, name: usize, place: usize) -> Option<f64> {
        self.joins[name]
            .iter()
            .map(|(other, forth)| {
                let other = self.places[*other];
                let (from, to) = if *forth { (other, place) } else { (place, other) };
                self.graph.ways[from].get(&to).copied()
            })
            .sum()
    }

    fn place(&mut self, name: usize, length: f64) {
        if name == self.joins.len() {
            if self.best.as_ref().is_none_or(|(best, _)| length < *best) {
                self.best = Some((length, self.places.clone()));
            }
            return;
        }
        let mut candidates: Vec<(f64, usize)> = match self.joins[name].iter().find(|(_, forth)| *forth) {
            Some((earlier, _)) => self.graph.ways[self.places[*earlier]]
                .keys()
                .copied()
                .collect::<Vec<_>>(),
            None => (0..self.graph.nodes.len()).collect(),
        }
        .into_iter()
        .filter(|place| !self.places.contains(place) && !self.taken.contains(place))
        .filter(|place| !self.returning || self.graph.returning.contains(place))
        .filter_map(|place| Some((self.length(name, place)?, place)))
        .collect();
        candidates.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        for (more, place) in candidates {
            if self.budget == 0 {
                return;
            }
            self.budget -= 1;
            if self.best.as_ref().is_some_and(|(best, _)| length + more >= *best) {
                continue;
            }
            self.places.push(place);
            self.place(name + 1, length + more);
            self.places.pop();
        }
    }
}
