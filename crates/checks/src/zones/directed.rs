//! `zones/directed`: which way a vehicle travels in DIRECTED and BIDIRECTED zones.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{StateView, Zone};
use tck_world::zones::{KnownZone, Place, tells_place};
use tck_world::{Fact, Listen, Observation, Topic, apart};

/// `zones/directed`.
pub(crate) const DIRECTED: Check = Check {
    name: "zones/directed",
    decides: &["ZONE-21", "ZONE-23"],
    doc: "Between two places inside a DIRECTED zone a vehicle travels in its direction: RESTRICTED, never opposite to it; \
          STRICT, along it. In a BIDIRECTED zone that is RESTRICTED it travels along its direction or the opposite one. What is less \
          than clearly wrong is a warning; whether there was another way than against a SOFT direction is not known. Ways shorter than 0.3 m, ways on an edge \
          with a trajectory, and what is near the border, are not judged.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::ZoneSet),
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Visualization),
        Listen::Delivered(Topic::Factsheet),
        Listen::Stored(Topic::Factsheet),
        Listen::Hook,
        Listen::Answer,
        Listen::Connect,
    ],
    reads: &[Fact::Zones],
    needs: &[StateView::zone_sets, StateView::position, Zone::direction],
    start: |_| Box::new(Directed::default()),
};

/// Shorter ways say nothing of a direction, in metres.
const SHORTEST: f64 = 0.3;

#[derive(Default)]
struct Directed {
    /// Whether an order that was sent has a trajectory on some edge, which comes before directions.
    curved: bool,
    /// Where a way begins that is long enough to have a direction.
    anchor: Option<Place>,
    said: BTreeSet<(String, &'static str)>,
}

/// How wrong a direction of travel is.
enum Wrong {
    Clearly(&'static str),
    Slightly(&'static str),
}

/// What is wrong with travelling that way in a zone.
fn wrong(zone: &KnownZone, heading: f64) -> Option<Wrong> {
    let direction = zone.zone.direction.float()?;
    let off = apart(heading, direction).to_degrees();
    if zone.is("DIRECTED") {
        let limitation = zone.zone.directed_limitation.or_empty();
        return match limitation {
            "RESTRICTED" if off >= 170.0 => Some(Wrong::Clearly("ZONE-21")),
            "RESTRICTED" if off > 100.0 => Some(Wrong::Slightly("ZONE-21")),
            "STRICT" if off > 45.0 => Some(Wrong::Clearly("ZONE-21")),
            "STRICT" if off > 25.0 => Some(Wrong::Slightly("ZONE-21")),
            _ => None,
        };
    }
    if zone.is("BIDIRECTED") {
        let off = off.min(apart(heading, direction + PI).to_degrees());
        let limitation = zone.zone.bidirected_limitation.or_empty();
        return match limitation {
            "RESTRICTED" if off > 45.0 => Some(Wrong::Clearly("ZONE-23")),
            "RESTRICTED" if off > 25.0 => Some(Wrong::Slightly("ZONE-23")),
            _ => None,
        };
    }
    None
}

impl Running for Directed {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if let Some(order) = record.order_to_vehicle() {
            self.curved = order.edges.iter().any(|edge| edge.trajectory.presence().is_something());
        }
        if record.outside_influence() || record.connects() {
            self.anchor = None;
        }
        if !tells_place(record) || self.curved {
            return false;
        }
        let zones = context.world.zones();
        let Some(now) = zones.places().1 else {
            self.anchor = None;
            return false;
        };
        let before = self.anchor.get_or_insert_with(|| now.clone()).clone();
        let (x, y) = (now.pose.x - before.pose.x, now.pose.y - before.pose.y);
        if x.hypot(y) < SHORTEST.max(2.0 * before.off.max(now.off)) || before.pose.map_id != now.pose.map_id {
            return false;
        }
        self.anchor = Some(now.clone());
        let mut judged = false;
        for zone in zones.in_force(now.pose.map_id.as_str()) {
            let inside = |place| zones.centre(zone, place).is_some_and(|depth| depth > 0.0);
            if !(zone.is("DIRECTED") || zone.is("BIDIRECTED")) || !inside(&before) || !inside(now) {
                continue;
            }
            judged = true;
            let heading = y.atan2(x);
            let message = || {
                format!(
                    "the vehicle travels at {heading:.2} rad in the zone {}, whose direction is {} rad",
                    quote(zone.name()),
                    zone.zone.direction.float().unwrap_or_default()
                )
            };
            let found = match wrong(zone, heading) {
                Some(Wrong::Clearly(id)) => (id, broken(id, record.seq(), message())),
                Some(Wrong::Slightly(id)) => (id, remark(id, record.seq(), message())),
                None => continue,
            };
            if self.said.insert((zone.name().to_owned(), found.0)) {
                findings.push(found.1);
            }
        }
        judged
    }
}
