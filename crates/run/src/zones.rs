//! Where the zones of a test lie: round a node of its course, or along an edge of it, as large as the vehicle and the nodes beside
//! it leave room for; or on the middle of an edge, and beside it, where the kinematic centre alone counts.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use serde_json::{Value, json};

use tck_base::polygon::{Point, Polygon};
use tck_journal::Reason;
use tck_view::FactsheetView;
use tck_world::outline::radius;

/// What the nodes, the edges and the places of a course are called in the words of a test.
const NODES: &str = "nodes";
const EDGES: &str = "edges";
const X: &str = "x";
const Y: &str = "y";

/// A zone reaches so far beyond its node or its edge, in metres, where there is room.
const REACH: f64 = 0.5;

/// A zone that reaches less far is too small to be seen on the way.
const LEAST: f64 = 0.2;

/// A vehicle on another node stays so far from a zone, in metres.
const APART: f64 = 0.15;

/// The size of a vehicle that does not say how large it is, from its centre, in metres.
const UNSAID: f64 = 1.0;

/// What the zones on and beside an edge are called: on its middle, and to the left and to the right of that.
pub(super) const PARTS: [&str; 3] = ["middle", "left", "right"];

/// Half the width of the zone on the middle of an edge, in metres.
const MIDDLE: f64 = 0.2;

/// How far the zones beside an edge reach, in metres: as far as `room-beside-edges` of a profile promises.
const BESIDE: f64 = 1.0;

/// The shares of the length of an edge where the zone on its middle begins and ends, and those beside it.
const MIDDLE_PART: (f64, f64) = (0.25, 0.75);
const BESIDE_PART: (f64, f64) = (0.2, 0.8);

/// An edge that is shorter is too short for that, in metres.
const SHORTEST: f64 = 1.5;

/// Corners of a zone round a node.
const CORNERS: u32 = 8;

fn round(number: f64) -> f64 {
    (number * 1_000.0).round() / 1_000.0
}

fn place(course: &Value, name: &str) -> Option<Point> {
    let node = course.get(NODES)?.get(name)?;
    Some(Point::new(node.get(X)?.as_f64()?, node.get(Y)?.as_f64()?))
}

/// The corners about a node, or about the way between two, counter-clockwise.
fn corners(from: Point, to: Point, reach: f64) -> Vec<Point> {
    let length = from.distance(to);
    if length < 1e-6 {
        let corner = |index: u32| {
            let angle = 2.0 * PI * (f64::from(index) + 0.5) / f64::from(CORNERS);
            Point::new(from.x + reach * angle.cos(), from.y + reach * angle.sin())
        };
        return (0..CORNERS).map(corner).collect();
    }
    let (along, aside) = (
        ((to.x - from.x) / length * reach, (to.y - from.y) / length * reach),
        ((to.y - from.y) / length * reach, -(to.x - from.x) / length * reach),
    );
    let corner = |at: Point, sign: f64, side: f64| {
        Point::new(
            at.x + sign * along.0 + side * aside.0,
            at.y + sign * along.1 + side * aside.1,
        )
    };
    vec![
        corner(from, -1.0, 1.0),
        corner(to, 1.0, 1.0),
        corner(to, 1.0, -1.0),
        corner(from, -1.0, -1.0),
    ]
}

/// The largest zone about a node or an edge that a vehicle on another node of the course is clear of.
fn area(course: &Value, name: &str, size: f64) -> Option<Vec<Point>> {
    let (from, to) = name.split_once('-').unwrap_or((name, name));
    let (begin, end) = (place(course, from)?, place(course, to)?);
    let nodes = course.get(NODES)?.as_object()?;
    let others = nodes.keys().filter(|other| *other != from && *other != to);
    let others: Vec<Point> = others
        .filter_map(|other| place(course, other))
        .filter(|other| other.distance(begin).min(other.distance(end)) > 1e-3)
        .collect();
    let mut reach = REACH;
    while reach >= LEAST {
        let corners = corners(begin, end, reach);
        let polygon = Polygon::new(corners.clone()).ok()?;
        let clear = |other: &Point| -polygon.depth(*other) >= size + APART;
        if others.iter().all(clear) {
            return Some(corners);
        }
        reach -= 0.05;
    }
    None
}

/// Gives these nodes and edges of a course the corners of a zone, as `zone`.
///
/// # Errors
/// Why there is no room for one.
pub(super) fn put(
    course: &mut Value,
    names: &BTreeSet<String>,
    factsheet: Option<&FactsheetView>,
) -> Result<(), Reason> {
    let size = factsheet.and_then(radius).unwrap_or(UNSAID);
    for name in names {
        let Some(corners) = area(course, name, size) else {
            let why =
                format!("the nodes of the course are too near to each other for a zone and a vehicle of {size:.1} m");
            return Err(Reason::observed(why));
        };
        let group = if name.contains('-') { EDGES } else { NODES };
        let corners = corners
            .iter()
            .map(|corner| json!({ "x": round(corner.x), "y": round(corner.y) }));
        if let Some(Value::Object(members)) = course.get_mut(group).and_then(|group| group.get_mut(name)) {
            members.insert("zone".to_owned(), corners.collect());
        }
    }
    Ok(())
}

/// The corners of one of [`PARTS`] of an edge, counter-clockwise.
fn part(course: &Value, name: &str, part: &str) -> Option<Vec<Point>> {
    let (from, to) = name.split_once('-')?;
    let (from, to) = (place(course, from)?, place(course, to)?);
    let length = from.distance(to);
    if length < SHORTEST {
        return None;
    }
    let ((begin, end), (right, left)) = match part {
        "middle" => (MIDDLE_PART, (-MIDDLE, MIDDLE)),
        "left" => (BESIDE_PART, (MIDDLE, BESIDE)),
        _ => (BESIDE_PART, (-BESIDE, -MIDDLE)),
    };
    let (along, aside) = (
        (to.x - from.x, to.y - from.y),
        ((from.y - to.y) / length, (to.x - from.x) / length),
    );
    let corner = |made: f64, off: f64| {
        Point::new(
            from.x + along.0 * made + aside.0 * off,
            from.y + along.1 * made + aside.1 * off,
        )
    };
    Some(vec![
        corner(begin, right),
        corner(end, right),
        corner(end, left),
        corner(begin, left),
    ])
}

/// Gives these edges of a course the corners of a zone on or beside them, under the name of the part.
///
/// # Errors
/// When an edge is too short.
pub(super) fn put_part(course: &mut Value, names: &BTreeSet<String>, name_of_part: &str) -> Result<(), Reason> {
    for name in names {
        let Some(corners) = part(course, name, name_of_part) else {
            let why =
                format!("an edge of the course is shorter than {SHORTEST} m, which is too short to lead round a zone");
            return Err(Reason::observed(why));
        };
        let corners = corners
            .iter()
            .map(|corner| json!({ "x": round(corner.x), "y": round(corner.y) }));
        if let Some(Value::Object(members)) = course.get_mut(EDGES).and_then(|edges| edges.get_mut(name)) {
            members.insert(name_of_part.to_owned(), corners.collect());
        }
    }
    Ok(())
}

/// Gives these edges of a course the direction across them, to the left, in radians.
pub(super) fn put_across(course: &mut Value, names: &BTreeSet<String>) {
    for name in names {
        let ends = name.split_once('-');
        let ends = ends.and_then(|(from, to)| place(course, from).zip(place(course, to)));
        let Some((from, to)) = ends else { continue };
        let heading = (to.y - from.y).atan2(to.x - from.x);
        let across = (heading + PI / 2.0 + PI).rem_euclid(2.0 * PI) - PI;
        if let Some(Value::Object(members)) = course.get_mut(EDGES).and_then(|edges| edges.get_mut(name)) {
            members.insert("across".to_owned(), across.into());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course() -> Value {
        json!({
            "nodes": { "a": { "x": 0.0, "y": 0.0 }, "b": { "x": 2.0, "y": 0.0 }, "c": { "x": 4.0, "y": 0.0 } },
            "edges": { "a-b": {}, "b-c": {} },
        })
    }

    fn zone(names: &[&str], size: f64) -> Result<Value, Reason> {
        let mut course = course();
        for name in names {
            let corners = area(&course, name, size).ok_or_else(|| Reason::observed("no room"))?;
            let polygon = Polygon::new(corners).unwrap();
            assert!(polygon.is_counter_clockwise());
        }
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        put(&mut course, &names, None)?;
        Ok(course)
    }

    #[test]
    fn a_zone_lies_about_its_node_or_its_edge_and_leaves_the_others_free() {
        let course = zone(&["b", "b-c"], 0.72).unwrap();
        let about = Polygon::read(&course["nodes"]["b"]["zone"]).unwrap();
        assert!(about.contains(Point::new(2.0, 0.0)) && !about.contains(Point::new(1.4, 0.0)));
        let along = Polygon::read(&course["edges"]["b-c"]["zone"]).unwrap();
        assert!(along.contains(Point::new(4.2, 0.1)) && !along.contains(Point::new(1.4, 0.0)));
    }

    #[test]
    fn the_middle_of_an_edge_and_what_lies_beside_it_do_not_overlap() {
        let areas = PARTS.map(|name| {
            let mut course = course();
            put_part(&mut course, &BTreeSet::from(["a-b".to_owned()]), name).unwrap();
            Polygon::read(&course["edges"]["a-b"][name]).unwrap()
        });
        let holds = |point: Point| areas.iter().map(|area| area.contains(point)).collect::<Vec<bool>>();
        assert_eq!(holds(Point::new(1.0, 0.0)), [true, false, false]);
        assert_eq!(holds(Point::new(1.0, 0.5)), [false, true, false]);
        assert_eq!(holds(Point::new(1.0, -0.5)), [false, false, true]);
        assert_eq!(holds(Point::new(0.1, 0.0)), [false, false, false]);
        assert!(areas.iter().all(Polygon::is_counter_clockwise));
    }

    #[test]
    fn a_large_vehicle_among_near_nodes_gets_none() {
        assert!(area(&course(), "b", 1.7).is_none());
        assert!(area(&course(), "x", 0.5).is_none());
    }
}
