//! A curve between two nodes, for tests that want one where the layout has a straight line.

use serde_json::{Value, json};

/// How far the curve leaves the straight line at most, in metres: enough to be told from it, and within what
/// `room-beside-edges` of a profile promises.
const ASIDE: f64 = 0.5;

/// The share of the length it leaves the line by, on short edges.
const SHARE: f64 = 0.25;

/// About how long one bow is, in metres. With [`ASIDE`] it has a radius of two metres.
const BOW: f64 = 2.8;

/// A trajectory from one point to another, in bows to the left and right of the straight line that join smoothly.
/// Every bow is a parabola.
pub(super) fn waves(from: (f64, f64), to: (f64, f64)) -> Option<Value> {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let length = dx.hypot(dy);
    if length < 0.1 {
        return None;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few bows, clamped"
    )]
    let bows = (length / BOW).round().clamp(1.0, 500.0) as u32;
    let count = f64::from(bows);
    let aside = ASIDE.min(SHARE * length / count);
    let place = |made: f64, off: f64| {
        let (along, beside) = (made / count, off / length);
        json!({ "x": from.0 + dx * along - dy * beside, "y": from.1 + dy * along + dx * beside, "weight": 1.0 })
    };
    let mut points = vec![place(0.0, 0.0)];
    let mut knots = vec![0.0; 3];
    for bow in 0..bows {
        let begin = f64::from(bow);
        // The tip of the triangle round a parabola is twice as far away as its own.
        let side = if bow % 2 == 0 { 2.0 } else { -2.0 };
        points.push(place(begin + 0.5, side * aside));
        points.push(place(begin + 1.0, 0.0));
        let behind = (begin + 1.0) / count;
        knots.extend([behind, behind]);
    }
    // The last point is the node itself, not what calculating makes of it.
    if let Some(last) = points.last_mut() {
        *last = json!({ "x": to.0, "y": to.1, "weight": 1.0 });
    }
    knots.push(1.0);
    Some(json!({ "degree": 2, "knotVector": knots, "controlPoints": points }))
}

/// The straight line as a trajectory.
pub(super) fn line(from: (f64, f64), to: (f64, f64)) -> Value {
    let point = |(x, y): (f64, f64)| json!({ "x": x, "y": y, "weight": 1.0 });
    json!({ "degree": 1, "knotVector": [0.0, 0.0, 1.0, 1.0], "controlPoints": [point(from), point(to)] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;
    use tck_base::nurbs::Curve;

    #[test]
    fn the_curve_is_sound_joins_the_nodes_smoothly_and_stays_within_half_a_metre() {
        for (to, aside) in [
            ((2.0, 0.0), 0.5),
            ((0.0, 1.0), 0.25),
            ((9.0, 0.0), 0.5),
            ((-3.0, 4.0), 0.5),
        ] {
            let (curve, flaws) = Curve::read(&waves((0.0, 0.0), to).expect("a curve"));
            assert_eq!(flaws, []);
            let path = curve.expect("a curve").path();
            let straight = tck_base::nurbs::Path::through([(0.0, 0.0), to]);
            let off = path
                .points()
                .filter_map(|(x, y)| straight.beside(x, y))
                .map(|beside| beside.distance);
            assert!((off.fold(0.0, f64::max) - aside).abs() < 0.01, "{to:?}");
            let end = path.at(path.length()).expect("an end");
            assert!((end.x - to.0).hypot(end.y - to.1) < 1e-9);
            let step = path.length() / 200.0;
            let headings: Vec<f64> = (0..=200)
                .filter_map(|at| Some(path.at(step * f64::from(at))?.heading))
                .collect();
            assert!(
                headings
                    .windows(2)
                    .all(|pair| ((pair[1] - pair[0] + PI).rem_euclid(2.0 * PI) - PI).abs() < 0.3),
                "{to:?}"
            );
        }
        assert_eq!(waves((1.0, 1.0), (1.0, 1.0)), None);
        assert_eq!(Curve::read(&line((0.0, 0.0), (2.0, 1.0))).1, []);
    }
}
