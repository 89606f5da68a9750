//! Trajectories as the standard writes them: a NURBS is read, told what is wrong with it, and made into a path that
//! can be driven along and measured against. Knows nothing of orders, vehicles or verdicts.

use serde_json::Value;

/// Curves with more control points are not calculated with.
const MOST_POINTS: usize = 2_048;
/// Nor are curves of a higher degree.
const HIGHEST_DEGREE: usize = 16;
/// Points of a path per stretch between two knots; a straight stretch needs only its ends.
const SAMPLES: usize = 24;
/// Numbers beyond this are no coordinates on earth.
const FARTHEST: f64 = 1e9;
/// How far a knot may leave 0 … 1 by rounding.
const ROUNDING: f64 = 1e-6;

/// What is wrong with a trajectory (ORD-MSG-28, ORD-MSG-29, ORD-MSG-31).
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Flaw {
    /// A member is missing or of a wrong type.
    #[error("{0}")]
    Member(String),
    /// There is no degree; 1 is assumed.
    #[error("degree is missing")]
    DegreeMissing,
    /// There is no knotVector; even knots are assumed, as many of the first and of the last as the degree and one.
    #[error("knotVector is missing")]
    KnotsMissing,
    /// There are fewer control points than a curve of this degree has.
    #[error("{points} control points are too few for degree {degree}, which needs {}", degree + 1)]
    PointCount {
        /// Number of control points.
        points: usize,
        /// degree.
        degree: usize,
    },
    /// knotVector has a wrong length.
    #[error("knotVector has {found} values; {points} control points of degree {degree} need {wanted}")]
    KnotCount {
        /// Its length.
        found: usize,
        /// Number of control points.
        points: usize,
        /// degree.
        degree: usize,
        /// Control points, degree and one.
        wanted: usize,
    },
    /// A knot is not within 0 to 1.
    #[error("knotVector[{at}] is {value}, not within 0 to 1")]
    KnotRange {
        /// Index.
        at: usize,
        /// Value.
        value: f64,
    },
    /// A knot is smaller than the one before.
    #[error("knotVector[{0}] is smaller than the value before it")]
    KnotOrder(usize),
}

impl Flaw {
    /// Whether the member has a usual value, which is taken for it.
    #[must_use]
    pub fn has_default(&self) -> bool {
        matches!(self, Self::DegreeMissing | Self::KnotsMissing)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct ControlPoint {
    x: f64,
    y: f64,
    weight: f64,
}

/// A curve that can be calculated with.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    degree: usize,
    knots: Vec<f64>,
    points: Vec<ControlPoint>,
}

/// A trajectory as it is written, before anybody asks whether it is one.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The degree; `None` where it is missing, not a number where it is none.
    pub degree: Option<f64>,
    /// The control points; `None` where they are no list.
    pub points: Option<Vec<WrittenPoint>>,
    /// The knots; `None` where they are missing, with one that is not a number where they are no list of numbers.
    pub knots: Option<Vec<f64>>,
}

/// A control point as it is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrittenPoint {
    /// `None` where it is missing or no number.
    pub x: Option<f64>,
    /// `None` where it is missing or no number.
    pub y: Option<f64>,
    /// `None` where it is missing, not a number where it is none.
    pub weight: Option<f64>,
}

impl From<&Value> for Written {
    fn from(trajectory: &Value) -> Self {
        let float = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
        let there = |name: &str| trajectory.get(name).filter(|value| !value.is_null());
        let point = |point: &Value| WrittenPoint {
            x: point.get("x").and_then(Value::as_f64),
            y: point.get("y").and_then(Value::as_f64),
            weight: point.get("weight").map(float),
        };
        Self {
            degree: there("degree").map(float),
            points: there("controlPoints")
                .and_then(Value::as_array)
                .map(|points| points.iter().map(point).collect()),
            knots: there("knotVector").map(|knots| match knots.as_array() {
                Some(knots) => knots.iter().map(float).collect(),
                None => vec![f64::NAN],
            }),
        }
    }
}

fn near(number: Option<f64>) -> Option<f64> {
    number.filter(|number| number.abs() < FARTHEST)
}

fn read_degree(degree: Option<f64>, flaws: &mut Vec<Flaw>) -> usize {
    let Some(degree) = degree else {
        flaws.push(Flaw::DegreeMissing);
        return 1;
    };
    if degree.fract() != 0.0 || !(1.0..1e6).contains(&degree) {
        flaws.push(Flaw::Member("degree is not a whole number of at least 1".to_owned()));
        return 0;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
    let degree = degree as usize;
    degree
}

fn read_points(points: Option<Vec<WrittenPoint>>, flaws: &mut Vec<Flaw>) -> Vec<ControlPoint> {
    let Some(list) = points else {
        flaws.push(Flaw::Member("controlPoints is not a list".to_owned()));
        return Vec::new();
    };
    let mut points = Vec::with_capacity(list.len());
    for (at, point) in list.into_iter().enumerate() {
        let weight = near(point.weight.or(Some(1.0))).filter(|weight| *weight >= 0.0);
        let is_far = point.x.is_some() && point.y.is_some();
        match (near(point.x), near(point.y), weight) {
            (Some(x), Some(y), Some(weight)) => points.push(ControlPoint { x, y, weight }),
            (Some(_), Some(_), None) => {
                flaws.push(Flaw::Member(format!(
                    "controlPoints[{at}].weight is no number of at least 0"
                )));
            }
            _ if is_far => flaws.push(Flaw::Member(format!(
                "controlPoints[{at}] lies further away than any place"
            ))),
            _ => flaws.push(Flaw::Member(format!("controlPoints[{at}] has no x and y"))),
        }
    }
    points
}

/// Knots at even distances from 0 to 1, the first and the last one as often as a curve needs that joins its ends.
fn even_knots(degree: usize, points: usize) -> Vec<f64> {
    let spans = points.saturating_sub(degree).clamp(1, MOST_POINTS);
    #[expect(clippy::cast_precision_loss, reason = "a few thousand at most")]
    let inner = (1..spans).map(|knot| knot as f64 / spans as f64);
    let end = |knot: f64| std::iter::repeat_n(knot, degree.min(MOST_POINTS) + 1);
    end(0.0).chain(inner).chain(end(1.0)).collect()
}

impl Curve {
    /// Reads a trajectory: what is wrong with it, and the curve if it can be calculated with all the same.
    #[must_use]
    pub fn read(trajectory: impl Into<Written>) -> (Option<Self>, Vec<Flaw>) {
        let Written { degree, points, knots } = trajectory.into();
        let mut flaws = Vec::new();
        let degree = read_degree(degree, &mut flaws);
        let points = read_points(points, &mut flaws);
        if knots.iter().flatten().any(|knot| knot.is_nan()) {
            flaws.push(Flaw::Member("knotVector is not a list of numbers".to_owned()));
        }
        if knots.is_none() {
            flaws.push(Flaw::KnotsMissing);
        }
        if !flaws.iter().all(Flaw::has_default) {
            return (None, flaws);
        }
        if points.len() <= degree {
            flaws.push(Flaw::PointCount {
                points: points.len(),
                degree,
            });
            if knots.is_none() {
                return (None, flaws);
            }
        }
        let knots = knots.unwrap_or_else(|| even_knots(degree, points.len()));
        let wanted = points.len() + degree + 1;
        if knots.len() != wanted {
            flaws.push(Flaw::KnotCount {
                found: knots.len(),
                points: points.len(),
                degree,
                wanted,
            });
        }
        let outside = |knot: &f64| !(-ROUNDING..=1.0 + ROUNDING).contains(knot);
        if let Some(at) = knots.iter().position(outside) {
            flaws.push(Flaw::KnotRange { at, value: knots[at] });
        }
        if let Some(at) = knots.windows(2).position(|pair| pair[1] < pair[0]) {
            flaws.push(Flaw::KnotOrder(at + 1));
        }
        let curve = Self { degree, knots, points };
        let sound = flaws.iter().all(Flaw::has_default) && curve.is_calculable();
        (sound.then_some(curve), flaws)
    }

    fn is_calculable(&self) -> bool {
        let (first, last) = (self.degree, self.points.len());
        let domain = self.knots.get(first).zip(self.knots.get(last));
        self.degree <= HIGHEST_DEGREE
            && self.points.len() <= MOST_POINTS
            && self.points.len() > self.degree
            && self.points.iter().any(|point| point.weight > 0.0)
            && domain.is_some_and(|(begin, end)| begin < end)
    }

    /// First and last control point.
    #[must_use]
    pub fn ends(&self) -> Option<((f64, f64), (f64, f64))> {
        let (first, last) = (self.points.first()?, self.points.last()?);
        Some(((first.x, first.y), (last.x, last.y)))
    }

    /// The point at a parameter of the span that begins at knot `span` (de Boor, in homogeneous coordinates).
    fn point(&self, span: usize, parameter: f64) -> Option<(f64, f64)> {
        let mut work: Vec<[f64; 3]> = self.points[span - self.degree..=span]
            .iter()
            .map(|point| [point.x * point.weight, point.y * point.weight, point.weight])
            .collect();
        for round in 1..=self.degree {
            for at in (round..=self.degree).rev() {
                let low = self.knots[at + span - self.degree];
                let high = self.knots[at + 1 + span - round];
                let part = if high > low {
                    (parameter - low) / (high - low)
                } else {
                    0.0
                };
                let before = work[at - 1];
                for (value, before) in work[at].iter_mut().zip(before) {
                    *value = (1.0 - part) * before + part * *value;
                }
            }
        }
        let [x, y, weight] = work[self.degree];
        (weight > 0.0).then(|| (x / weight, y / weight))
    }

    /// The curve as a path.
    #[must_use]
    pub fn path(&self) -> Path {
        let spans = (self.degree..self.points.len()).filter(|at| self.knots[*at] < self.knots[*at + 1]);
        let samples = if self.degree == 1 { 1 } else { SAMPLES };
        let mut points = Vec::new();
        for span in spans {
            let (begin, end) = (self.knots[span], self.knots[span + 1]);
            let first = usize::from(!points.is_empty());
            for step in first..=samples {
                #[expect(clippy::cast_precision_loss, reason = "a few dozen")]
                let part = step as f64 / samples as f64;
                points.extend(self.point(span, begin + (end - begin) * part));
            }
        }
        Path::through(points)
    }
}

/// A way as a chain of short straight lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    points: Vec<(f64, f64)>,
    /// Metres from the start, for each point.
    made: Vec<f64>,
}

/// A place on a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Direction of the path here, in radians.
    pub heading: f64,
}

/// Where a position is beside a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beside {
    /// Metres along the path to the nearest place of it.
    pub made: f64,
    /// Metres from that place.
    pub distance: f64,
    /// Whether the position is on the left of the path.
    pub left: bool,
    /// Direction of the path there, in radians.
    pub heading: f64,
}

impl Path {
    /// The path through these points; equal neighbours are one.
    #[must_use]
    pub fn through(points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut path = Self::default();
        for (x, y) in points {
            let made = match path.points.last().zip(path.made.last()) {
                None => 0.0,
                Some(((px, py), made)) => {
                    let step = (x - px).hypot(y - py);
                    if step < 1e-9 {
                        continue;
                    }
                    made + step
                }
            };
            path.points.push((x, y));
            path.made.push(made);
        }
        path
    }

    /// Metres.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.made.last().copied().unwrap_or_default()
    }

    /// The points it leads through.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        self.points.iter().copied()
    }

    /// The place after so many metres; the ends beyond the ends. `None` for a path that leads nowhere.
    #[must_use]
    pub fn at(&self, made: f64) -> Option<Spot> {
        let last = self.points.len().checked_sub(2)?;
        let at = self
            .made
            .partition_point(|there| *there <= made)
            .saturating_sub(1)
            .min(last);
        let ((ax, ay), (bx, by)) = (self.points[at], self.points[at + 1]);
        let part = ((made - self.made[at]) / (self.made[at + 1] - self.made[at])).clamp(0.0, 1.0);
        Some(Spot {
            x: ax + (bx - ax) * part,
            y: ay + (by - ay) * part,
            heading: (by - ay).atan2(bx - ax),
        })
    }

    /// The nearest place of the path to a position. `None` for a path that leads nowhere.
    #[must_use]
    pub fn beside(&self, x: f64, y: f64) -> Option<Beside> {
        let lines = self.points.windows(2).zip(self.made.windows(2));
        let all = lines.map(|(ends, made)| {
            let ((ax, ay), (bx, by)) = (ends[0], ends[1]);
            let length = made[1] - made[0];
            let (dx, dy) = ((bx - ax) / length, (by - ay) / length);
            let along = ((x - ax) * dx + (y - ay) * dy).clamp(0.0, length);
            Beside {
                made: made[0] + along,
                distance: (x - ax - dx * along).hypot(y - ay - dy * along),
                left: dx * (y - ay) - dy * (x - ax) > 0.0,
                heading: dy.atan2(dx),
            }
        });
        all.min_by(|one, other| one.distance.total_cmp(&other.distance))
    }

    /// The rest of the path after so many metres.
    #[must_use]
    pub fn rest(&self, made: f64) -> Self {
        let begin = self.at(made).map(|spot| (spot.x, spot.y));
        let behind = self.points.iter().zip(&self.made).filter(|(_, there)| **there > made);
        Self::through(begin.into_iter().chain(behind.map(|(point, _)| *point)))
    }

    /// The first so many metres of the path.
    #[must_use]
    pub fn first(&self, made: f64) -> Self {
        let before = self.points.iter().zip(&self.made).filter(|(_, there)| **there < made);
        let end = self.at(made).map(|spot| (spot.x, spot.y));
        Self::through(before.map(|(point, _)| *point).chain(end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn quarter() -> Value {
        // A quarter of a circle of radius 1 round the origin, exactly.
        json!({ "degree": 2, "knotVector": [0, 0, 0, 1, 1, 1], "controlPoints": [
            { "x": 1, "y": 0 }, { "x": 1, "y": 1, "weight": std::f64::consts::FRAC_1_SQRT_2 }, { "x": 0, "y": 1 },
        ] })
    }

    fn path(trajectory: &Value) -> Path {
        let (curve, flaws) = Curve::read(trajectory);
        assert_eq!(flaws, []);
        curve.expect("a curve").path()
    }

    #[test]
    fn weights_make_a_circle_of_a_parabola() {
        let path = path(&quarter());
        assert!(path.points().all(|(x, y)| (x.hypot(y) - 1.0).abs() < 1e-9));
        assert!((path.length() - std::f64::consts::FRAC_PI_2).abs() < 1e-2);
        let middle = path.at(path.length() / 2.0).expect("a place");
        assert!((middle.x - middle.y).abs() < 1e-6);
        assert!((middle.heading - 0.75 * std::f64::consts::PI).abs() < 0.1);
    }

    #[test]
    fn a_polygon_is_a_curve_of_degree_one() {
        let path = path(
            &json!({ "degree": 1, "knotVector": [0, 0, 0.5, 1, 1], "controlPoints": [
            { "x": 0, "y": 0 }, { "x": 2, "y": 0 }, { "x": 2, "y": 1 },
        ] }),
        );
        assert_eq!(path.points().collect::<Vec<_>>(), [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)]);
        let beside = path.beside(1.0, 0.5).expect("a place");
        assert!(beside.left && (beside.distance - 0.5).abs() < 1e-9 && (beside.made - 1.0).abs() < 1e-9);
        assert!(!path.beside(1.0, -0.5).expect("a place").left);
        assert_eq!(path.rest(1.0).points().next(), Some((1.0, 0.0)));
        assert!((path.first(2.5).length() - 2.5).abs() < 1e-9);
        assert!((path.rest(2.5).length() - 0.5).abs() < 1e-9);
    }

    #[test]
    fn every_flaw_is_told() {
        let broken = |patch: Value| {
            let mut trajectory = quarter();
            json_patch::merge(&mut trajectory, &patch);
            Curve::read(&trajectory)
        };
        for (patch, wanted) in [
            (json!({ "degree": 0 }), "degree is not"),
            (json!({ "degree": 1.5 }), "degree is not"),
            (json!({ "controlPoints": [{ "x": 0 }] }), "has no x and y"),
            (
                json!({ "controlPoints": [{ "x": 1e300, "y": 0 }] }),
                "lies further away than any place",
            ),
            (json!({ "controlPoints": null }), "controlPoints is not"),
            (json!({ "knotVector": [0, "1"] }), "knotVector is not"),
            (
                json!({ "knotVector": [0, 0, 1, 1] }),
                "3 control points of degree 2 need 6",
            ),
            (json!({ "knotVector": [0, 0, 0, 2, 2, 2] }), "not within 0 to 1"),
            (json!({ "knotVector": [0, 0, 1, 0.5, 1, 1] }), "smaller than"),
        ] {
            let (curve, flaws) = broken(patch.clone());
            assert!(curve.is_none(), "{patch}");
            assert!(
                flaws.iter().any(|flaw| flaw.to_string().contains(wanted)),
                "{patch}: {flaws:?}"
            );
        }
        let (curve, flaws) = broken(json!({ "degree": null, "knotVector": [0, 0, 0.5, 1, 1] }));
        assert!(curve.is_some());
        assert_eq!(flaws, [Flaw::DegreeMissing]);
        let (curve, flaws) = broken(json!({ "knotVector": null }));
        assert_eq!((curve, flaws), (Curve::read(&quarter()).0, vec![Flaw::KnotsMissing]));
        assert_eq!(even_knots(1, 4), [0.0, 0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 1.0]);
    }

    #[test]
    fn what_cannot_be_calculated_with_is_no_curve_and_does_no_harm() {
        for (degree, knots, points) in [
            (1, json!([0, 0, 0]), json!([{ "x": 1, "y": 1 }])),
            (1, json!([1, 1, 1, 1]), json!([{ "x": 1, "y": 1 }, { "x": 2, "y": 1 }])),
            (
                1,
                json!([0, 0, 1, 1]),
                json!([{ "x": 1, "y": 1, "weight": 0 }, { "x": 2, "y": 1, "weight": 0 }]),
            ),
            (
                1,
                json!([0, 0, 1, 1]),
                json!([{ "x": 1e300, "y": 1 }, { "x": 2, "y": 1 }]),
            ),
        ] {
            let trajectory = json!({ "degree": degree, "knotVector": knots, "controlPoints": points });
            assert_eq!(Curve::read(&trajectory).0, None, "{trajectory}");
        }
        assert_eq!(Curve::read(&Value::Null).0, None);
        assert_eq!(Path::default().at(1.0), None);
        assert_eq!(Path::through([(1.0, 1.0), (1.0, 1.0)]).beside(0.0, 0.0), None);
    }
}
