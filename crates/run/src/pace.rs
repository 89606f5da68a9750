//! How slowly a test asks the vehicle to drive, so that it can be seen on its way: limits taken from what the
//! vehicle itself says it can do, which it must notice and a slow vehicle can still keep.

use serde_json::{Map, Value};
use tck_view::{FactsheetView, Member, Number, PhysicalParameters};

/// The share of the highest speed that is asked for. Far enough below it to be told from a vehicle that ignores the
/// limit, and no crawling.
const SHARE: f64 = 1.0 / 3.0;

/// The share of the slow speed that is asked for where the vehicle comes from an edge with the slow one.
const SLOWER: f64 = 0.6;

/// What is asked for of a vehicle that does not say how fast it is, in metres or radians per second.
const UNSAID: f64 = 0.5;

/// How many times a test looks at the vehicle while it drives the first edge of its course.
const LOOKS: f64 = 8.0;

/// Between two looks at least and at most, in milliseconds.
const BETWEEN: (f64, f64) = (20.0, 3_000.0);

/// The edges of a course, and members of each.
const MAX_SPEED: &str = "maxSpeed";
const LENGTH: &str = "length";
const EDGES: &str = "edges";

/// The edge whose length sets the pace.
const FIRST_EDGE: &str = "a-b";

/// What a vehicle can do, by its factsheet.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    speed: (Option<f64>, Option<f64>),
    turning: (Option<f64>, Option<f64>),
}

/// A share of the highest value, but not below the lowest one.
fn share(least: Option<f64>, most: Option<f64>) -> f64 {
    most.map_or(UNSAID, |most| (most * SHARE).max(least.unwrap_or(0.0)).min(most))
}

impl Pace {
    /// Reads the physical parameters.
    pub(super) fn of(factsheet: Option<&FactsheetView>) -> Self {
        let physical = factsheet.and_then(|sheet| sheet.physical_parameters.there());
        let number = |of: fn(&PhysicalParameters) -> &Member<Number>| {
            let value = of(physical?).float()?;
            (value > 0.0).then_some(value)
        };
        Self {
            speed: (number(|all| &all.speed_min), number(|all| &all.speed_max)),
            turning: (
                number(|all| &all.angular_speed_min),
                number(|all| &all.angular_speed_max),
            ),
        }
    }

    /// The highest speed, in metres per second.
    pub(super) fn fastest(self) -> Option<f64> {
        self.speed.1
    }

    /// The speed to ask for on an edge where `cap` is permitted anyhow, in metres per second.
    fn speed(self, cap: Option<f64>) -> f64 {
        let (least, most) = self.speed;
        let most = match (most, cap) {
            (Some(most), Some(cap)) => Some(most.min(cap)),
            (most, cap) => most.or(cap),
        };
        share(least, most)
    }

    /// Adds `slowSpeed`, `slowerSpeed` and `slowRotation` to every edge of the course.
    pub(super) fn set(self, course: &mut Value) {
        let edges = course.get_mut(EDGES).and_then(Value::as_object_mut);
        for members in edges
            .into_iter()
            .flat_map(Map::values_mut)
            .filter_map(Value::as_object_mut)
        {
            let cap = members.get(MAX_SPEED).and_then(Value::as_f64);
            let slow = self.speed(cap);
            let slower = (slow * SLOWER).max(self.speed.0.unwrap_or(0.0)).min(slow);
            members.insert("slowSpeed".to_owned(), slow.into());
            members.insert("slowerSpeed".to_owned(), slower.into());
            members.insert("slowRotation".to_owned(), share(self.turning.0, self.turning.1).into());
        }
    }
}

/// `time.look` in milliseconds: some looks fit into a slow drive over the first edge of the course.
pub(super) fn between_looks(course: &Value) -> Option<u64> {
    let edge = course.get(EDGES)?.get(FIRST_EDGE)?;
    let length = edge.get(LENGTH)?.as_f64()?;
    let speed = edge.get("slowSpeed")?.as_f64()?;
    let millis = (length / speed / LOOKS * 1_000.0).clamp(BETWEEN.0, BETWEEN.1);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped above")]
    Some(millis as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use tck_view::Names;

    fn course(sheet: Option<&Value>, edge: Value) -> Value {
        let mut course = json!({ "edges": { "a-b": edge } });
        let sheet = sheet.map(|sheet| crate::Sheet::read(sheet, &Names::default()));
        Pace::of(sheet.as_deref()).set(&mut course);
        course
    }

    fn slow(course: &Value) -> f64 {
        course["edges"]["a-b"]["slowSpeed"].as_f64().expect("a speed")
    }

    #[test]
    fn a_third_of_what_the_vehicle_can_do_is_asked_for() {
        let sheet = json!({ "physicalParameters": { "speedMax": 1.5, "speedMin": 0.1, "angularSpeedMax": 0.9 } });
        let course = course(Some(&sheet), json!({ "length": 2.0 }));
        assert!((slow(&course) - 0.5).abs() < 1e-9);
        assert!((course["edges"]["a-b"]["slowRotation"].as_f64().expect("a speed") - 0.3).abs() < 1e-9);
        assert!((course["edges"]["a-b"]["slowerSpeed"].as_f64().expect("a speed") - 0.3).abs() < 1e-9);
        assert_eq!(between_looks(&course), Some(500));
    }

    #[test]
    fn no_vehicle_is_asked_for_less_than_it_can_or_for_more_than_the_floor_permits() {
        let sheet = json!({ "physicalParameters": { "speedMax": 1.5, "speedMin": 0.8 } });
        assert!((slow(&course(Some(&sheet), json!({}))) - 0.8).abs() < 1e-9);
        assert!((slow(&course(Some(&sheet), json!({ "maxSpeed": 0.6 }))) - 0.6).abs() < 1e-9);
        let hostile = json!({ "physicalParameters": { "speedMax": -1.0, "speedMin": "fast" } });
        assert!((slow(&course(Some(&hostile), json!({}))) - UNSAID).abs() < 1e-9);
        assert!((slow(&course(None, json!({ "maxSpeed": 0.3 }))) - 0.1).abs() < 1e-9);
    }
}
