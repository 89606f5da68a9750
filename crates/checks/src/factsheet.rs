//! `factsheet/consistency`: what a schema cannot say about a factsheet.
//!
//! Types and required parts are left to `message/schema`; whether the vehicle does what the factsheet promises
//! is left to the tests.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::finding::{broken, quote, remark, show};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_world::members::{elements, text};
use tck_world::{Listen, Observation, Topic};

/// `factsheet/limits`.
pub(super) const LIMITS: Check = Check {
    name: "factsheet/limits",
    decides: &["FACT-05"],
    doc: "Each member of maxStringLens and maxArrayLens is a number under its literal name, which for arrays has a dot: what \
          comes before the dot is no object that holds the numbers. Members of other names are not judged.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Factsheet)],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Limits),
};

/// How many elements of a list are looked at.
const ELEMENTS: usize = 256;

/// What a schema cannot say about a factsheet.
pub(super) const CONSISTENCY: Check = Check {
    name: "factsheet/consistency",
    decides: &["FACT-04", "FACT-08", "FACT-09"],
    doc: "Load sets have different names, the polygons of the 2D envelopes do not cross themselves, and no minimum of \
          the physical parameters is above its maximum, which is a warning.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Factsheet)],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Consistency),
};

struct Consistency;

impl Running for Consistency {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let message = record.delivered();
        if message.is_none_or(|message| message.name != "factsheet") {
            return false;
        }
        let Some(factsheet) = record.json().filter(|value| value.is_object()) else {
            return false;
        };
        let seq = record.seq();
        let mut names = BTreeSet::new();
        for set in factsheet
            .get("loadSpecification")
            .into_iter()
            .flat_map(|loads| elements(loads, "loadSets"))
            .take(ELEMENTS)
        {
            let name = text(set, "setName");
            if !names.insert(name) {
                findings.push(broken(
                    "FACT-09",
                    seq,
                    format!("two load sets are named {}", quote(name)),
                ));
            }
        }
        let geometry = factsheet.get("agvGeometry");
        for envelope in geometry
            .into_iter()
            .flat_map(|geometry| elements(geometry, "envelopes2d"))
            .take(ELEMENTS)
        {
            let point = |point: &Value| Some((point.get("x")?.as_f64()?, point.get("y")?.as_f64()?));
            let points: Option<Vec<_>> = elements(envelope, "polygonPoints").take(ELEMENTS).map(point).collect();
            if points.is_some_and(|points| crosses_itself(&points)) {
                let text = format!(
                    "the polygon of envelope {} crosses itself",
                    quote(text(envelope, "set"))
                );
                findings.push(broken("FACT-08", seq, text));
            }
        }
        let physical = |name: &str| factsheet.get("physicalParameters")?.get(name)?.as_f64();
        for (least, most) in [
            ("speedMin", "speedMax"),
            ("heightMin", "heightMax"),
            ("angularSpeedMin", "angularSpeedMax"),
        ] {
            if let (Some(low), Some(high)) = (physical(least), physical(most))
                && low > high
            {
                findings.push(remark("FACT-04", seq, format!("{least} {low} is above {most} {high}")));
            }
        }
        true
    }
}

/// What the literal names with a dot begin with.
const FIRST_PARTS: [&str; 13] = [
    "order",
    "node",
    "edge",
    "actions",
    "instantActions",
    "trajectory",
    "state",
    "error",
    "errors",
    "information",
    "topic",
    "msg",
    "id",
];

struct Limits;

impl Running for Limits {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let message = record.delivered();
        if message.is_none_or(|message| message.name != "factsheet") {
            return false;
        }
        let limits = record.json().and_then(|sheet| sheet.get("protocolLimits"));
        let mut judged = false;
        for name in ["maxStringLens", "maxArrayLens"] {
            let members = limits.and_then(|limits| limits.get(name)?.as_object());
            for (key, value) in members.into_iter().flatten().take(ELEMENTS) {
                judged = true;
                // A manufacturer may add members of any kind.
                if (value.is_object() || value.is_array()) && FIRST_PARTS.contains(&key.as_str()) {
                    let text = format!("{name}.{} holds {}, which is no number", quote(key), show(value));
                    findings.push(broken("FACT-05", record.seq(), text));
                }
            }
        }
        judged
    }
}

type Point = (f64, f64);

/// Whether two sides that are no neighbours cross. The last point is joined to the first, repeated or not.
fn crosses_itself(points: &[Point]) -> bool {
    let closed = points.len() > 1 && points.first() == points.last();
    let corners = if closed { &points[..points.len() - 1] } else { points };
    let count = corners.len();
    let side = |at: usize| (corners[at], corners[(at + 1) % count]);
    (0..count).any(|one| {
        (one + 2..count)
            .filter(|other| (other + 1) % count != one)
            .any(|other| cross(side(one), side(other)))
    })
}

/// Whether two lines properly cross, each having its ends on different sides of the other.
fn cross((a, b): (Point, Point), (c, d): (Point, Point)) -> bool {
    let turn = |p: Point, q: Point, r: Point| (q.0 - p.0) * (r.1 - p.1) - (q.1 - p.1) * (r.0 - p.0);
    turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

    fn judged(factsheet: &Value) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.message("factsheet", factsheet);
        let outcome = trace.judge("factsheet/consistency");
        assert_eq!(outcome.judged, 1);
        outcome.summary()
    }

    fn polygon(points: &[(f64, f64)]) -> Value {
        let points: Vec<Value> = points.iter().map(|(x, y)| json!({ "x": x, "y": y })).collect();
        json!({ "agvGeometry": { "envelopes2d": [{ "set": "body", "polygonPoints": points }] } })
    }

    #[test]
    fn plain_outlines_closed_or_open_are_right() {
        let square = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)];
        assert!(judged(&polygon(&square)).is_empty());
        assert!(judged(&polygon(&[&square[..], &square[..1]].concat())).is_empty());
        assert!(judged(&polygon(&square[..1])).is_empty());
        assert!(judged(&json!({})).is_empty());
    }

    #[test]
    fn a_polygon_that_crosses_itself_is_found() {
        assert_eq!(
            judged(&polygon(&[(0.0, 0.0), (2.0, 1.0), (2.0, 0.0), (0.0, 1.0)])),
            ["FACT-08"]
        );
    }

    #[test]
    fn load_sets_of_one_name_and_limits_upside_down_are_found() {
        let twice = json!({ "loadSpecification": { "loadSets": [{ "setName": "a" }, { "setName": "b" }, { "setName": "a" }] } });
        assert_eq!(judged(&twice), ["FACT-09"]);
        assert_eq!(
            judged(&json!({ "physicalParameters": { "speedMin": 2.0, "speedMax": 1.0 } })),
            ["FACT-04 warning"]
        );
    }

    #[test]
    fn limits_are_numbers_under_names_with_a_dot() {
        let judge = |arrays: serde_json::Value| {
            let mut trace = Trace::subscriber();
            trace.message("factsheet", &json!({ "protocolLimits": { "maxArrayLens": arrays } }));
            trace.judge("factsheet/limits").summary()
        };
        assert!(judge(json!({ "order.nodes": 100 })).is_empty());
        assert_eq!(judge(json!({ "order": { "nodes": 100 } })), ["FACT-05"]);
    }
}
