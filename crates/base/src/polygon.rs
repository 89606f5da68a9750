//! Areas on the floor: polygons as the standard draws zones and outlines of vehicles, told what is wrong with them and
//! measured against points and each other. Knows nothing of zones, vehicles or verdicts.
//!
//! How far something reaches inside is never said to be more than it is: where a place is known within a tolerance, what
//! reaches deeper than that is certainly inside, and what is farther away than that is certainly outside.

use serde_json::Value;

/// Polygons with more corners are not calculated with.
pub const MOST_CORNERS: usize = 1_024;
/// Numbers beyond this are no coordinates on earth.
const FARTHEST: f64 = 1e9;
/// Corners nearer to each other than this are one, in metres.
const SAME: f64 = 1e-9;
/// Smaller areas are none, in square metres.
const NO_AREA: f64 = 1e-12;
/// Points of a border are looked at so far from each other, in metres.
const STEP: f64 = 0.05;
/// At most so many points of one side are looked at.
const MOST_STEPS: u32 = 64;

/// A point on the floor, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// To the right.
    pub x: f64,
    /// Upwards.
    pub y: f64,
}

impl Point {
    /// The point with these coordinates.
    #[must_use]
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// Metres to another point.
    #[must_use]
    pub fn distance(self, other: Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }

    /// The point a part of the way to another one.
    #[must_use]
    pub fn towards(self, other: Self, part: f64) -> Self {
        Self::new(self.x + (other.x - self.x) * part, self.y + (other.y - self.y) * part)
    }
}

/// What is wrong with a polygon (ZSET-22).
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Flaw {
    /// It is no list of points with two numbers; which point.
    #[error("vertex {0} is no point")]
    NoPoint(usize),
    /// It has not enough corners; how many there are.
    #[error("it has {0} vertices, and needs three")]
    TooFew(usize),
    /// It has more corners than anybody draws.
    #[error("it has {0} vertices, which is too many")]
    TooMany(usize),
    /// A corner lies on the one before it.
    #[error("vertex {0} lies on the one before it")]
    Repeated(usize),
    /// Two sides, which begin at these corners, cross or touch each other.
    #[error("the sides that begin at vertex {0} and vertex {1} cross")]
    Crossing(usize, usize),
    /// All corners lie on one line.
    #[error("it has no area")]
    Flat,
}

/// A simple polygon, closed from its last corner to its first.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    corners: Vec<Point>,
}

/// Twice the signed area of a triangle: positive when `c` is to the left of the way from `a` to `b`.
fn turn(a: Point, b: Point, c: Point) -> f64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

/// The distance of a point to a straight way.
fn to_side(point: Point, (from, to): (Point, Point)) -> f64 {
    let length = from.distance(to);
    if length <= SAME {
        return point.distance(from);
    }
    let along = ((point.x - from.x) * (to.x - from.x) + (point.y - from.y) * (to.y - from.y)) / (length * length);
    point.distance(from.towards(to, along.clamp(0.0, 1.0)))
}

/// Whether two straight ways have a point in common.
fn cross(one: (Point, Point), other: (Point, Point)) -> bool {
    let sides = (turn(one.0, one.1, other.0), turn(one.0, one.1, other.1));
    let others = (turn(other.0, other.1, one.0), turn(other.0, other.1, one.1));
    let apart = |(a, b): (f64, f64)| (a > 0.0) != (b > 0.0) && a != 0.0 && b != 0.0;
    if apart(sides) && apart(others) {
        return true;
    }
    let touches = |point: Point, side: (Point, Point)| to_side(point, side) <= SAME;
    touches(other.0, one) || touches(other.1, one) || touches(one.0, other) || touches(one.1, other)
}

impl Polygon {
    /// The polygon with these corners, whichever way round they are given.
    ///
    /// # Errors
    ///
    /// What keeps it from being a simple polygon with an area.
    pub fn new(corners: Vec<Point>) -> Result<Self, Flaw> {
        match corners.len() {
            few @ 0..3 => return Err(Flaw::TooFew(few)),
            many if many > MOST_CORNERS => return Err(Flaw::TooMany(many)),
            _ => {}
        }
        let wild = |point: &Point| !(point.x.abs() <= FARTHEST && point.y.abs() <= FARTHEST);
        if let Some(index) = corners.iter().position(wild) {
            return Err(Flaw::NoPoint(index));
        }
        let polygon = Self { corners };
        let sides: Vec<(Point, Point)> = polygon.sides().collect();
        if let Some(index) = sides.iter().position(|(from, to)| from.distance(*to) <= SAME) {
            return Err(Flaw::Repeated((index + 1) % sides.len()));
        }
        if polygon.signed_area().abs() <= NO_AREA {
            return Err(Flaw::Flat);
        }
        for (first, one) in sides.iter().enumerate() {
            for (second, other) in sides.iter().enumerate().skip(first + 1) {
                if polygon.is_crossed(first, *one, second, *other) {
                    return Err(Flaw::Crossing(first, second));
                }
            }
        }
        Ok(polygon)
    }

    /// Whether two sides have more in common than the corner where they meet.
    fn is_crossed(&self, first: usize, one: (Point, Point), second: usize, other: (Point, Point)) -> bool {
        let count = self.corners.len();
        if second == first + 1 || (first == 0 && second + 1 == count) {
            // Neighbours share a corner; they may not lie on each other.
            let (before, corner, after) = if second == first + 1 {
                (one.0, one.1, other.1)
            } else {
                (other.0, one.0, one.1)
            };
            let back =
                (after.x - corner.x) * (before.x - corner.x) + (after.y - corner.y) * (before.y - corner.y) > 0.0;
            return back && to_side(after, (before, corner)).min(to_side(before, (corner, after))) <= SAME;
        }
        cross(one, other)
    }

    /// Reads the vertices of a message: objects with `x` and `y`.
    ///
    /// # Errors
    ///
    /// What keeps them from being a simple polygon with an area.
    pub fn read(vertices: &Value) -> Result<Self, Flaw> {
        let vertices = vertices.as_array().ok_or(Flaw::NoPoint(0))?;
        let number = |vertex: &Value, axis: &str| vertex.get(axis).and_then(Value::as_f64);
        let mut corners = Vec::new();
        for (index, vertex) in vertices.iter().take(MOST_CORNERS + 1).enumerate() {
            match (number(vertex, "x"), number(vertex, "y")) {
                (Some(x), Some(y)) => corners.push(Point::new(x, y)),
                _ => return Err(Flaw::NoPoint(index)),
            }
        }
        Self::new(corners)
    }

    /// The rectangle between two opposite corners.
    ///
    /// # Errors
    ///
    /// As it has no area when they lie above or beside each other.
    pub fn between(one: Point, other: Point) -> Result<Self, Flaw> {
        let (left, right) = (one.x.min(other.x), one.x.max(other.x));
        let (below, above) = (one.y.min(other.y), one.y.max(other.y));
        let corners = [(left, below), (right, below), (right, above), (left, above)];
        Self::new(corners.map(|(x, y)| Point::new(x, y)).to_vec())
    }

    /// The corners.
    #[must_use]
    pub fn corners(&self) -> &[Point] {
        &self.corners
    }

    /// Its sides, from corner to corner.
    fn sides(&self) -> impl Iterator<Item = (Point, Point)> + '_ {
        let ends = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(ends).map(|(from, to)| (*from, *to))
    }

    fn signed_area(&self) -> f64 {
        let origin = self.corners[0];
        self.sides().map(|(from, to)| turn(origin, from, to)).sum::<f64>() / 2.0
    }

    /// Its area in square metres.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.signed_area().abs()
    }

    /// Whether the corners are given counter-clockwise, as the standard wants it (ZSET-22).
    #[must_use]
    pub fn is_counter_clockwise(&self) -> bool {
        self.signed_area() > 0.0
    }

    /// Turned about the origin and then moved: the outline of a vehicle at a pose.
    #[must_use]
    pub fn at(&self, x: f64, y: f64, theta: f64) -> Self {
        let (sin, cos) = theta.sin_cos();
        let corners = self.corners.iter();
        let corners =
            corners.map(|corner| Point::new(x + corner.x * cos - corner.y * sin, y + corner.x * sin + corner.y * cos));
        Self {
            corners: corners.collect(),
        }
    }

    /// Whether a point lies inside or on the border.
    #[must_use]
    pub fn contains(&self, point: Point) -> bool {
        self.winds_round(point) || self.to_border(point) <= SAME
    }

    fn winds_round(&self, point: Point) -> bool {
        let crosses = |(from, to): &(Point, Point)| {
            (from.y > point.y) != (to.y > point.y)
                && point.x < (to.x - from.x) * (point.y - from.y) / (to.y - from.y) + from.x
        };
        self.sides().filter(crosses).count() % 2 == 1
    }

    /// The distance of a point to the border, from inside or outside.
    #[must_use]
    pub fn to_border(&self, point: Point) -> f64 {
        self.sides()
            .map(|side| to_side(point, side))
            .fold(f64::INFINITY, f64::min)
    }

    /// How far a point lies inside the border; negative outside.
    #[must_use]
    pub fn depth(&self, point: Point) -> f64 {
        let distance = self.to_border(point);
        if self.winds_round(point) { distance } else { -distance }
    }

    /// The box around it: its least and its greatest coordinates.
    fn bounds(&self) -> (Point, Point) {
        let corners = self.corners.iter();
        corners.fold(
            (
                Point::new(f64::INFINITY, f64::INFINITY),
                Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY),
            ),
            |(low, high), corner| {
                (
                    Point::new(low.x.min(corner.x), low.y.min(corner.y)),
                    Point::new(high.x.max(corner.x), high.y.max(corner.y)),
                )
            },
        )
    }

    /// Whether the boxes around two polygons are farther from each other than this.
    #[must_use]
    pub fn is_far_from(&self, other: &Self, metres: f64) -> bool {
        let ((low, high), (others_low, others_high)) = (self.bounds(), other.bounds());
        low.x - others_high.x > metres
            || others_low.x - high.x > metres
            || low.y - others_high.y > metres
            || others_low.y - high.y > metres
    }

    /// Whether two polygons have a point in common.
    #[must_use]
    pub fn touches(&self, other: &Self) -> bool {
        if self.is_far_from(other, 0.0) {
            return false;
        }
        self.contains(other.corners[0])
            || other.contains(self.corners[0])
            || self.sides().any(|side| other.sides().any(|others| cross(side, others)))
    }

    /// How far two polygons reach into each other, in metres: moved by less than that, they still have a point in common.
    /// Negative, it is the distance between them.
    #[must_use]
    pub fn overlap(&self, other: &Self) -> f64 {
        if self.touches(other) {
            return self.deepest(other).max(other.deepest(self)).max(0.0);
        }
        let to = |one: &Self, other: &Self| {
            let corners = one.corners.iter();
            corners
                .map(|corner| other.to_border(*corner))
                .fold(f64::INFINITY, f64::min)
        };
        -to(self, other).min(to(other, self))
    }

    /// How deep the border of another polygon lies inside.
    fn deepest(&self, other: &Self) -> f64 {
        let points = other.sides().flat_map(|(from, to)| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let steps = (from.distance(to) / STEP).ceil().clamp(1.0, f64::from(MOST_STEPS)) as u32;
            (0..steps).map(move |step| from.towards(to, f64::from(step) / f64::from(steps)))
        });
        points.map(|point| self.depth(point)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Whether the other one lies inside with all of it.
    #[must_use]
    pub fn surrounds(&self, other: &Self) -> bool {
        let inside = other.corners.iter().all(|corner| self.contains(*corner));
        inside && !self.corners.iter().any(|corner| other.depth(*corner) > SAME)
    }

    /// The parts of a straight way, between 0 and 1, at which it meets the border.
    #[must_use]
    pub fn meets(&self, from: Point, to: Point) -> Vec<f64> {
        let mut parts: Vec<f64> = self
            .sides()
            .filter_map(|(start, end)| {
                let across = (to.x - from.x) * (end.y - start.y) - (to.y - from.y) * (end.x - start.x);
                if across.abs() <= f64::EPSILON {
                    return None;
                }
                let part = ((start.x - from.x) * (end.y - start.y) - (start.y - from.y) * (end.x - start.x)) / across;
                let along = ((start.x - from.x) * (to.y - from.y) - (start.y - from.y) * (to.x - from.x)) / across;
                ((0.0..=1.0).contains(&part) && (0.0..=1.0).contains(&along)).then_some(part)
            })
            .collect();
        parts.sort_by(f64::total_cmp);
        parts.dedup_by(|one, other| (*one - *other).abs() <= SAME);
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;
    use std::f64::consts::PI;

    fn square() -> Polygon {
        Polygon::between(Point::new(0.0, 0.0), Point::new(2.0, 2.0)).unwrap()
    }

    fn of(corners: &[(f64, f64)]) -> Result<Polygon, Flaw> {
        Polygon::new(corners.iter().map(|(x, y)| Point::new(*x, *y)).collect())
    }

    #[test]
    fn what_is_no_simple_polygon_is_told_so() {
        assert_eq!(of(&[(0.0, 0.0), (1.0, 0.0)]), Err(Flaw::TooFew(2)));
        assert_eq!(of(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]), Err(Flaw::Flat));
        assert_eq!(of(&[(0.0, 0.0), (0.0, 0.0), (2.0, 1.0)]), Err(Flaw::Repeated(1)));
        let bow = of(&[(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 1.0)]);
        assert_eq!(bow, Err(Flaw::Crossing(0, 2)));
        let spike = of(&[(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (2.0, 1.0), (0.0, 1.0)]);
        assert!(matches!(spike, Err(Flaw::Crossing(..))), "{spike:?}");
        assert_eq!(Polygon::read(&json!([{ "x": 0.0 }])), Err(Flaw::NoPoint(0)));
        assert_eq!(Polygon::read(&json!({})), Err(Flaw::NoPoint(0)));
        assert_eq!(of(&[(0.0, 0.0), (f64::NAN, 0.0), (1.0, 1.0)]), Err(Flaw::NoPoint(1)));
        assert_eq!(
            Polygon::new(vec![Point::new(0.0, 0.0); 5_000]),
            Err(Flaw::TooMany(5_000))
        );
    }

    #[test]
    fn either_direction_is_read_and_told() {
        let left = of(&[(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (0.0, 1.0)]).unwrap();
        let right = of(&[(0.0, 0.0), (0.0, 1.0), (3.0, 1.0), (3.0, 0.0)]).unwrap();
        assert!(left.is_counter_clockwise() && !right.is_counter_clockwise());
        assert!((left.area() - 3.0).abs() < 1e-9 && (right.area() - 3.0).abs() < 1e-9);
    }

    #[test]
    fn depth_is_the_distance_to_the_border_and_its_sign_the_side() {
        let square = square();
        for (x, y, depth) in [
            (1.0, 1.0, 1.0),
            (0.5, 1.0, 0.5),
            (-1.0, 1.0, -1.0),
            (5.0, 6.0, -5.0),
            (2.0, 1.0, 0.0),
        ] {
            assert!((square.depth(Point::new(x, y)) - depth).abs() < 1e-9, "{x} {y}");
        }
        assert!(square.contains(Point::new(2.0, 1.0)) && square.contains(Point::new(0.0, 0.0)));
        let notched = of(&[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 1.0), (0.0, 4.0)]).unwrap();
        assert!(!notched.contains(Point::new(2.0, 2.0)) && notched.contains(Point::new(0.5, 2.0)));
    }

    #[test]
    fn an_outline_reaches_in_before_its_centre_does() {
        let outline = Polygon::between(Point::new(-0.6, -0.4), Point::new(0.6, 0.4)).unwrap();
        let zone = square();
        assert!((outline.at(-1.0, 1.0, 0.0).overlap(&zone) + 0.4).abs() < 1e-9);
        let inside = outline.at(-0.4, 1.0, 0.0).overlap(&zone);
        assert!((inside - 0.2).abs() < 1e-6, "{inside}");
        assert!((outline.at(-0.5, 1.0, PI / 2.0).overlap(&zone) + 0.1).abs() < 1e-9);
        assert!(zone.surrounds(&outline.at(1.0, 1.0, 0.3)) && !zone.surrounds(&outline.at(0.2, 1.0, 0.0)));
    }

    #[test]
    fn a_strip_below_an_outline_is_found() {
        let outline = Polygon::between(Point::new(-0.6, -0.4), Point::new(0.6, 0.4)).unwrap();
        let strip = Polygon::between(Point::new(-0.1, -5.0), Point::new(0.1, 5.0)).unwrap();
        let small = Polygon::between(Point::new(-0.1, -0.1), Point::new(0.1, 0.1)).unwrap();
        assert!(outline.touches(&strip) && outline.overlap(&strip) > 0.04);
        assert!(outline.overlap(&small) > 0.29);
    }

    #[test]
    fn a_way_meets_the_border_where_it_goes_in_and_out() {
        let parts = square().meets(Point::new(-2.0, 1.0), Point::new(6.0, 1.0));
        assert_eq!(parts, [0.25, 0.5]);
        assert!(square().meets(Point::new(-2.0, 3.0), Point::new(6.0, 3.0)).is_empty());
        assert_eq!(square().meets(Point::new(1.0, 1.0), Point::new(1.0, 3.0)), [0.5]);
    }

    /// A star-shaped polygon about a centre, which is simple whatever its radii.
    fn star() -> impl Strategy<Value = Polygon> {
        let radii = prop::collection::vec(0.3_f64..4.0, 3..12);
        (radii, -5.0_f64..5.0, -5.0_f64..5.0, any::<bool>()).prop_filter_map("flat", |(radii, x, y, back)| {
            let count = u32::try_from(radii.len()).unwrap();
            let mut corners: Vec<Point> = (0..count)
                .zip(&radii)
                .map(|(index, radius)| {
                    let angle = 2.0 * PI * f64::from(index) / f64::from(count);
                    Point::new(x + radius * angle.cos(), y + radius * angle.sin())
                })
                .collect();
            if back {
                corners.reverse();
            }
            Polygon::new(corners).ok()
        })
    }

    proptest! {
        #[test]
        fn a_star_is_simple_and_its_depth_agrees_with_its_inside(
            polygon in star(), x in -10.0_f64..10.0, y in -10.0_f64..10.0,
        ) {
            let point = Point::new(x, y);
            let depth = polygon.depth(point);
            prop_assert!((depth.abs() - polygon.to_border(point)).abs() < 1e-12);
            if depth.abs() > 1e-6 {
                prop_assert_eq!(polygon.contains(point), depth > 0.0);
            }
        }

        #[test]
        fn moving_and_turning_changes_neither_area_nor_depth(
            polygon in star(), x in -9.0_f64..9.0, y in -9.0_f64..9.0, theta in -3.2_f64..3.2,
            px in -6.0_f64..6.0, py in -6.0_f64..6.0,
        ) {
            let moved = polygon.at(x, y, theta);
            prop_assert!((moved.area() - polygon.area()).abs() < 1e-6);
            let (sin, cos) = theta.sin_cos();
            let there = Point::new(x + px * cos - py * sin, y + px * sin + py * cos);
            prop_assert!((moved.depth(there) - polygon.depth(Point::new(px, py))).abs() < 1e-6);
        }

        #[test]
        fn overlap_is_symmetric_and_its_sign_is_whether_they_touch(one in star(), other in star()) {
            let overlap = one.overlap(&other);
            prop_assert!((overlap - other.overlap(&one)).abs() < 1e-9);
            prop_assert_eq!(one.touches(&other), overlap >= 0.0);
        }

        #[test]
        fn what_reaches_in_still_does_when_it_is_moved_by_less(
            one in star(), other in star(), angle in 0.0_f64..6.3, share in 0.0_f64..0.99,
        ) {
            let overlap = one.overlap(&other);
            let by = overlap.abs() * share;
            let moved = one.at(by * angle.cos(), by * angle.sin(), 0.0);
            if overlap.abs() > 1e-6 {
                prop_assert_eq!(moved.touches(&other), overlap > 0.0);
            }
        }

        #[test]
        fn a_way_from_inside_to_outside_meets_the_border(
            polygon in star(), x in -10.0_f64..10.0, y in -10.0_f64..10.0, far in 0.0_f64..6.3,
        ) {
            let from = Point::new(x, y);
            let to = Point::new(100.0 * far.cos(), 100.0 * far.sin());
            if polygon.depth(from) > 1e-6 {
                prop_assert!(polygon.meets(from, to).len() % 2 == 1 || !polygon.meets(from, to).is_empty());
            }
        }
    }
}
