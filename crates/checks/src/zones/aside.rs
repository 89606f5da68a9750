//! `zones/around`: a vehicle that plans its way itself goes by another zone than the one it should not use.

use serde_json::Value;

use crate::finding::quote;
use crate::paths::curve_of;
use tck_base::verdict::Verdict;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{PlannedPath, StateView};
use tck_world::zones::{KnownZone, Place, tells_place};
use tck_world::{Fact, Listen, Observation, Topic};

/// `zones/around`.
pub(crate) const AROUND: Check = Check {
    name: "zones/around",
    decides: &["ZONE-19", "ZONE-20", "ZONE-22", "ZINT-06"],
    doc: "The kinematic centre of the vehicle is not seen inside the zone `around` in two places, 0.1 m apart. Its way \
          through one of the zones `by` shows that there was another one. Always a warning: the vehicle weighs \
          its ways itself.",
    arguments: &["around", "by"],
    listens: LISTENS,
    reads: &[Fact::Zones],
    needs: &[StateView::zone_sets, StateView::position],
    start: |context| Box::new(Around(Zones::of(context), None)),
};

/// `zones/path-around`.
pub(crate) const PATH_AROUND: Check = Check {
    name: "zones/path-around",
    decides: &["PATH-05"],
    doc: "When the kinematic centre of the vehicle is inside one of the zones `by`, past the zone `around`, its plannedPath \
          leads through `around` no more. A path that does in two states in a row is a warning. A vehicle that does not go by `by` is not judged.",
    arguments: &["around", "by"],
    listens: LISTENS,
    reads: &[Fact::Zones],
    needs: &[StateView::zone_sets, StateView::position, StateView::planned_path],
    start: |context| Box::new(PathAround(Zones::of(context), 0)),
};

const LISTENS: &[Listen] = &[
    Listen::ToVehicle(Topic::ZoneSet),
    Listen::Delivered(Topic::State),
    Listen::Delivered(Topic::Visualization),
    Listen::Delivered(Topic::Factsheet),
    Listen::Stored(Topic::Factsheet),
    Listen::Hook,
    Listen::Answer,
    Listen::Connect,
];

/// Two places so far apart are two, in metres.
const APART: f64 = 0.1;

/// A path is looked at so far at a time, and reaches into a zone by more than this, in metres.
const STEP: f64 = 0.1;
const DEEP: f64 = 0.1;

/// At most so many steps of a path are looked at.
const STEPS: u32 = 2_000;

/// The zones that a test names.
struct Zones {
    around: String,
    by: Vec<String>,
}

impl Zones {
    fn of(context: &CheckContext<'_>) -> Self {
        let by = context.with.get("by");
        let by = by.and_then(Value::as_array).into_iter().flatten().chain(by);
        let around = context.with.get("around").and_then(Value::as_str);
        Self {
            around: around.unwrap_or_default().to_owned(),
            by: by.filter_map(Value::as_str).map(str::to_owned).collect(),
        }
    }

    fn is_by(&self, zone: &KnownZone) -> bool {
        self.by.iter().any(|name| name == zone.name())
    }
}

fn warning(seq: u64, message: String) -> CheckFinding {
    CheckFinding {
        requirement: None,
        verdict: Some(Verdict::Warning),
        seq,
        message,
        element: None,
    }
}

/// And where it was seen in the zone that it should not use first.
struct Around(Zones, Option<Place>);

impl Running for Around {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let zones = context.world.zones();
        let Some(place) = zones.places().1.filter(|_| tells_place(record)) else {
            return false;
        };
        let mut by = false;
        for zone in zones.in_force(place.pose.map_id.as_str()) {
            if zones.centre(zone, place).is_none_or(|depth| depth <= 0.0) {
                continue;
            }
            by |= self.0.is_by(zone);
            if zone.name() != self.0.around {
                continue;
            }
            let first = self.1.get_or_insert_with(|| place.clone());
            let apart = (first.pose.x - place.pose.x).hypot(first.pose.y - place.pose.y);
            if apart < APART {
                continue;
            }
            let message = format!(
                "the vehicle goes through the zone {}, at x {:.2}, y {:.2}",
                quote(zone.name()),
                place.pose.x,
                place.pose.y
            );
            findings.push(warning(record.seq(), message));
            return true;
        }
        by && self.1.is_none()
    }
}

/// And how many states in a row have shown a path that is not driven any more.
struct PathAround(Zones, u32);

/// Whether a path leads through a zone.
fn leads_through(path: &PlannedPath, zone: &KnownZone) -> bool {
    let Some((Some(curve), _)) = curve_of(path) else {
        return false;
    };
    let path = curve.path();
    let spots = (0..STEPS).map(|step| f64::from(step) * STEP);
    let mut spots = spots
        .take_while(|made| *made <= path.length())
        .filter_map(|made| path.at(made));
    spots.any(|spot| zone.area.depth(tck_base::polygon::Point::new(spot.x, spot.y)) > DEEP)
}

impl Running for PathAround {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(state) = record.state() else { return false };
        let zones = context.world.zones();
        let Some((place, path)) = zones.places().1.zip(state.planned_path.there()) else {
            return false;
        };
        let in_force = || zones.in_force(place.pose.map_id.as_str());
        let is_in = |zone: &KnownZone| zones.centre(zone, place).is_some_and(|depth| depth > 0.0);
        let passes = in_force().any(|zone| self.0.is_by(zone) && is_in(zone));
        if !passes || !state.driving.is(true) {
            return false;
        }
        let mut avoided = in_force().filter(|zone| zone.name() == self.0.around);
        let Some(zone) = avoided.find(|zone| leads_through(path, zone)) else {
            self.1 = 0;
            return true;
        };
        self.1 += 1;
        if self.1 == 2 {
            let message = format!(
                "the vehicle goes round the zone {}, and its plannedPath leads through it",
                quote(zone.name())
            );
            findings.push(warning(record.seq(), message));
        }
        self.1 >= 2
    }
}
