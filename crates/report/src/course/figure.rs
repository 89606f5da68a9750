//! A course on a page: the picture, what its lines mean, and the table that says what the picture shows.

use askama::Template;

use super::picture::{CoursePicture, Found, Stop};
use crate::clean::short;
use crate::statement::many;
use tck_course::picture::{Dot, Line, LineKind, Picture, Stand};

/// Places one after the other, in metres.
type Way = Vec<(f64, f64)>;

/// How long a name beside a node may be, in characters.
const BESIDE: usize = 20;
/// How many nodes a row of the table names.
const NAMES: usize = 40;
/// Nearer than this are findings at one place, in metres.
const ONE_PLACE: f64 = 0.1;
/// How many findings of one message the table tells.
const TOLD: usize = 5;

#[derive(Template)]
#[template(path = "report/course.html")]
struct Figure {
    svg: String,
    rows: Vec<Row>,
}

struct Row {
    name: String,
    text: String,
    /// The message that it is about, and whether the page shows it.
    message: Option<(u64, bool)>,
}

impl Row {
    fn new(name: &str, text: String) -> Self {
        Self {
            name: name.to_owned(),
            text,
            message: None,
        }
    }
}

impl CoursePicture {
    /// The picture and its table, for a page. `id` begins the ids in it: letters, digits and `-`. `shows` tells which messages
    /// the page shows.
    ///
    /// # Errors
    /// When the template cannot be written; it has no reason to.
    pub fn figure(&self, id: &str, title: &str, shows: impl Fn(u64) -> bool) -> Result<String, askama::Error> {
        let mut drawn = self.drawn();
        let too_far = drawn.settle();
        let rows = self.rows(too_far, shows);
        let svg = drawn.svg(id, title, &self.description());
        Figure { svg, rows }.render()
    }

    fn drawn(&self) -> Picture {
        // The base lies above the horizon where both lead over one way.
        let released = [false, true];
        let of_order = released.into_iter().flat_map(|released| {
            let edges = self.edges.iter().filter(move |edge| edge.released == released);
            edges.filter(|edge| edge.line.len() > 1).map(|edge| Line {
                kind: if edge.released {
                    LineKind::Base
                } else {
                    LineKind::Horizon
                },
                points: edge.line.clone(),
                name: format!("{}, {}", edge.id, if edge.released { "base" } else { "horizon" }),
            })
        });
        let (before, after) = self.parted();
        let driven = [
            (LineKind::After, after, "where the vehicle drove after arrow 1"),
            (LineKind::Trail, before, "where the vehicle drove"),
        ];
        let driven = driven.into_iter().filter(|(_, points, _)| points.len() > 1);
        let driven = driven.map(|(kind, points, name)| Line {
            kind,
            points,
            name: name.to_owned(),
        });
        let mut nodes: Vec<Dot> = Vec::new();
        for stop in &self.nodes {
            let Some((x, y)) = stop.place else { continue };
            // A node that the order passes twice is one.
            if nodes.iter().any(|known| known.name == stop.id) {
                continue;
            }
            nodes.push(Dot {
                x,
                y,
                name: stop.id.clone(),
                station: false,
            });
        }
        for node in &mut nodes {
            node.name = short(&node.name, BESIDE).into_owned();
        }
        let mut vehicles: Vec<Stand> = Vec::new();
        for (at, found) in self.found.iter().enumerate() {
            let Some((x, y)) = found.place else { continue };
            let number = at + 1;
            // What was found at one place is one arrow with all numbers: that of the worst.
            let same = vehicles
                .iter_mut()
                .find(|known| (known.x - x).hypot(known.y - y) < ONE_PLACE);
            match same {
                Some(known) => known.name.push_str(&format!(", {number}")),
                None => vehicles.push(Stand {
                    x,
                    y,
                    theta: found.theta,
                    name: number.to_string(),
                }),
            }
        }
        // What comes later lies above, and the worst comes first.
        vehicles.reverse();
        Picture {
            lines: of_order.chain(driven).collect(),
            nodes,
            start: self.trail.first().copied(),
            vehicles,
        }
    }

    /// Where the vehicle drove until the worst finding, and after it; both parts have the place of the finding.
    fn parted(&self) -> (Way, Way) {
        let Some(until) = self.until.filter(|until| *until < self.trail.len()) else {
            return (self.trail.clone(), Vec::new());
        };
        let (before, after) = self.trail.split_at(until);
        let mut before = before.to_vec();
        let here = self.found.first().and_then(|found| found.place);
        before.extend(here.filter(|here| before.last() != Some(here)));
        let last = before.last().copied();
        let after = last.into_iter().chain(after.iter().copied()).collect();
        (before, after)
    }

    fn description(&self) -> String {
        let found = self.found.iter().enumerate().map(|(at, found)| {
            let number = at + 1;
            format!(" Arrow {number}: {}.", place(found.place))
        });
        format!(
            "Base: {}. Horizon: {}. Driven: {}.{} The table below the picture says the same.",
            self.named(true),
            self.named(false),
            self.way(),
            found.collect::<String>()
        )
    }

    fn rows(&self, too_far: usize, shows: impl Fn(u64) -> bool) -> Vec<Row> {
        let update = self.update.map_or(String::new(), |update| format!(", update {update}"));
        let mut order = match self.message {
            None => Row::new("Order", "none was sent".to_owned()),
            Some(_) => Row::new("Order", format!("{}{update}", or(&self.order, "without an id"))),
        };
        order.message = self.message.map(|number| (number, shows(number)));
        let mut rows = vec![
            order,
            Row::new("Map", or(&self.map, "not named").to_owned()),
            Row::new("Base", self.named(true)),
            Row::new("Horizon", self.named(false)),
            Row::new("Driven", self.way()),
        ];
        let unplaced = self.nodes.iter().filter(|node| node.place.is_none()).count();
        let unknown = self.edges.iter().filter(|edge| edge.line.len() < 2).count();
        let left_out = [
            (unplaced, "node", "that the order gives no place for on this map"),
            (unknown, "edge", "whose way is not known"),
            (too_far, "place", "that no floor is large enough for"),
        ];
        let left_out = left_out.iter().filter(|(count, ..)| *count > 0);
        let left_out: Vec<String> = left_out
            .map(|(count, what, why)| format!("{} {why}", many(*count, what)))
            .collect();
        if !left_out.is_empty() {
            rows.push(Row::new("Not drawn", left_out.join(", ")));
        }
        rows.extend(self.found.iter().enumerate().map(|(at, found)| Row {
            name: format!("Arrow {}", at + 1),
            text: told(found),
            message: Some((found.number, shows(found.number))),
        }));
        if self.further > 0 {
            rows.push(Row::new(
                "More",
                format!("{}, not drawn", many(self.further, "finding")),
            ));
        }
        rows
    }

    /// The nodes of the base, or of the horizon, by name.
    fn named(&self, released: bool) -> String {
        let all: Vec<&Stop> = self.nodes.iter().filter(|node| node.released == released).collect();
        let names: Vec<&str> = all.iter().take(NAMES).map(|node| or(&node.id, "?")).collect();
        match (all.len(), all.len().saturating_sub(NAMES)) {
            (0, _) => "none".to_owned(),
            (_, 0) => names.join(", "),
            (_, more) => format!("{} and {more} more", names.join(", ")),
        }
    }

    /// Where the vehicle drove, in words.
    fn way(&self) -> String {
        let length = |way: &[(f64, f64)]| -> f64 {
            let steps = way.windows(2);
            steps
                .map(|pair| (pair[1].0 - pair[0].0).hypot(pair[1].1 - pair[0].1))
                .sum()
        };
        let mut text = match (self.trail.first(), self.trail.last()) {
            (Some(first), Some(last)) => format!(
                "{} m, from {} to {}",
                metres(length(&self.trail)),
                place(Some(*first)),
                place(Some(*last))
            ),
            _ => "nobody knows where".to_owned(),
        };
        let (_, after) = self.parted();
        if after.len() > 1 {
            text.push_str(&format!("; {} m of it after arrow 1", metres(length(&after))));
        }
        if self.by_nodes {
            text.push_str("; the vehicle does not say where it is, its last nodes are drawn");
        }
        if self.elsewhere > 0 {
            text.push_str("; it was on other maps, too");
        }
        text
    }
}

/// What was known of the vehicle at a finding, in words.
fn told(found: &Found) -> String {
    let mut parts = vec![place(found.place)];
    parts.extend(found.theta.map(|theta| format!("heading {theta:.2} rad")));
    parts.extend(
        found
            .beside
            .map(|beside| format!("{} m from the nearest edge of the base", metres(beside))),
    );
    if !found.node.is_empty() {
        parts.push(format!("last node {}", found.node));
    }
    let moving = found
        .driving
        .map(|driving| if driving { "driving" } else { "not driving" });
    parts.extend(moving.map(str::to_owned));
    let mut what: Vec<String> = found.what.iter().take(TOLD).cloned().collect();
    let more = found.what.len().saturating_sub(TOLD);
    if more > 0 {
        what.push(format!("and {more} more"));
    }
    format!("{}. {}", parts.join(", "), what.join("; "))
}

fn place(place: Option<(f64, f64)>) -> String {
    match place {
        Some((x, y)) => format!("x {} m, y {} m", metres(x), metres(y)),
        None => "not known on this map".to_owned(),
    }
}

/// A length to a hundredth; a number that is no length on earth as a power of ten.
fn metres(value: f64) -> String {
    if value.abs() < 1e7 {
        format!("{value:.2}")
    } else {
        format!("{value:.2e}")
    }
}

fn or<'t>(text: &'t str, otherwise: &'t str) -> &'t str {
    if text.is_empty() { otherwise } else { text }
}
