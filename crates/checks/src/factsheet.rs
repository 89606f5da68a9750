//! `factsheet/consistency`: what a schema cannot say about a factsheet.
//!
//! Types and required parts are left to `message/schema`; whether the vehicle does what the factsheet promises
//! is left to the tests.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::finding::{broken, number, quote, remark, show};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{
    Envelope2d, FactsheetView, Field, LoadSet, Member, Number, PhysicalParameters, Point as Corner, ProtocolLimits,
};
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
    needs: &[ProtocolLimits::max_string_lens, ProtocolLimits::max_array_lens],
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
    needs: &[
        LoadSet::set_name,
        Envelope2d::polygon_points,
        FactsheetView::physical_parameters,
    ],
    start: |_| Box::new(Consistency),
};

struct Consistency;

impl Running for Consistency {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(factsheet) = record.factsheet() else {
            return false;
        };
        let seq = record.seq();
        let mut names = BTreeSet::new();
        let loads = factsheet.load_specification.there().into_iter();
        for set in loads.flat_map(|loads| loads.load_sets.iter()).take(ELEMENTS) {
            let name = set.set_name.or_empty();
            if !names.insert(name) {
                findings.push(broken(
                    "FACT-09",
                    seq,
                    format!("two load sets are named {}", quote(name)),
                ));
            }
        }
        let geometry = factsheet.geometry.there().into_iter();
        for envelope in geometry
            .flat_map(|geometry| geometry.envelopes_2d.iter())
            .take(ELEMENTS)
        {
            let point = |corner: &Corner| Some((corner.x.float()?, corner.y.float()?));
            let points: Option<Vec<_>> = envelope.polygon_points.iter().take(ELEMENTS).map(point).collect();
            if points.is_some_and(|points| crosses_itself(&points)) {
                let name = quote(envelope.set.or_empty());
                let text = format!("the polygon of envelope {name} crosses itself");
                findings.push(broken("FACT-08", seq, text));
            }
        }
        let physical = factsheet.physical_parameters.there();
        for [(least, low), (most, high)] in physical.into_iter().flat_map(ranges) {
            if let (Some(low), Some(high)) = (low.float(), high.float())
                && low > high
            {
                let name = |field| record.names().name(field).unwrap_or_default();
                let text = format!(
                    "{} {} is above {} {}",
                    name(least),
                    number(low),
                    name(most),
                    number(high)
                );
                findings.push(remark("FACT-04", seq, text));
            }
        }
        true
    }
}

/// A limit of the vehicle: the member, and what stands there.
type Bound<'v> = (Field, &'v Member<Number>);

/// The limits of the vehicle that go from a minimum to a maximum.
fn ranges(physical: &PhysicalParameters) -> [[Bound<'_>; 2]; 3] {
    [
        [
            (PhysicalParameters::speed_min, &physical.speed_min),
            (PhysicalParameters::speed_max, &physical.speed_max),
        ],
        [
            (PhysicalParameters::height_min, &physical.height_min),
            (PhysicalParameters::height_max, &physical.height_max),
        ],
        [
            (PhysicalParameters::angular_speed_min, &physical.angular_speed_min),
            (PhysicalParameters::angular_speed_max, &physical.angular_speed_max),
        ],
    ]
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
        let sheet = record.json().filter(|_| record.is_delivered(Topic::Factsheet));
        let Some(sheet) = sheet else { return false };
        let mut judged = false;
        for list in [ProtocolLimits::max_string_lens, ProtocolLimits::max_array_lens] {
            // Members that no version knows are looked for, too.
            let members = record.names().raw(sheet, &[FactsheetView::protocol_limits, list]);
            let name = record.names().name(list).unwrap_or_default();
            let members = members.and_then(Value::as_object).into_iter().flatten();
            for (key, value) in members.take(ELEMENTS) {
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
