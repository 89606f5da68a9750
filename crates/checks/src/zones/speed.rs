//! `zones/speed`: no vehicle is faster in a zone of type `SPEED_LIMIT` than that permits.

use std::collections::BTreeSet;

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{StateView, Zone};
use tck_world::zones::{speed, tells_place};
use tck_world::{Fact, Listen, Observation, Topic};

/// `zones/speed`.
pub(crate) const SPEED: Check = Check {
    name: "zones/speed",
    decides: &["ZONE-17", "ZINT-04", "ZINT-08", "ZINT-09"],
    doc: "The velocity of a vehicle whose outline reaches into a SPEED_LIMIT zone is not above its maximumSpeed, by more \
          than a tenth and 0.05 m/s; of several zones the lowest counts, and one counts inside a RELEASE zone as well. What is nearer to the border than the vehicle says \
          to be exact, or than 0.1 m, is not judged.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::ZoneSet),
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Visualization),
        Listen::Delivered(Topic::Factsheet),
        Listen::Stored(Topic::Factsheet),
        Listen::Hook,
        Listen::Answer,
        Listen::Connect,
    ],
    reads: &[Fact::Zones],
    needs: &[StateView::zone_sets, StateView::position, Zone::maximum_speed],
    start: |_| Box::new(Speed::default()),
};

#[derive(Default)]
struct Speed {
    said: BTreeSet<String>,
}

impl Running for Speed {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if !tells_place(record) {
            return false;
        }
        let zones = context.world.zones();
        let (Some(place), Some(speed)) = (zones.places().1, speed(record)) else {
            return false;
        };
        let inside = zones
            .in_force(place.pose.map_id.as_str())
            .filter(|zone| zone.is("SPEED_LIMIT"));
        let inside = inside.filter(|zone| zones.reach(zone, place).is_some_and(|reach| reach > 0.0));
        let mut limits: Vec<(f64, &str)> = inside
            .filter_map(|zone| Some((zone.zone.maximum_speed.float()?, zone.name())))
            .collect();
        limits.sort_by(|one, other| one.0.total_cmp(&other.0));
        let Some((lowest, name)) = limits.first().copied() else {
            return false;
        };
        if speed > lowest * 1.1 + 0.05 && self.said.insert(name.to_owned()) {
            let message = format!(
                "the vehicle drives at {speed:.2} m/s in the zone {}, where {lowest} m/s are permitted",
                quote(name)
            );
            findings.push(broken("ZONE-17", record.seq(), message.clone()));
            let partly = zones
                .in_force(place.pose.map_id.as_str())
                .filter(|zone| zone.name() == name);
            if partly
                .into_iter()
                .any(|zone| zones.centre(zone, place).is_some_and(|depth| depth < 0.0))
            {
                findings.push(broken("ZINT-08", record.seq(), message.clone()));
            }
            let released = zones
                .in_force(place.pose.map_id.as_str())
                .filter(|zone| zone.is("RELEASE"));
            let mut released = released.filter_map(|zone| zones.reach(zone, place));
            if released.any(|reach| reach > 0.0) {
                findings.push(broken("ZINT-09", record.seq(), message.clone()));
            }
            if limits.len() > 1 {
                findings.push(broken("ZINT-04", record.seq(), message));
            }
        }
        true
    }
}
