//! `zones/blocked`: no vehicle goes into a BLOCKED zone.

use std::collections::BTreeSet;

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Topic};

use super::drives_by_order;

/// `zones/blocked`.
pub(crate) const BLOCKED: Check = Check {
    name: "zones/blocked",
    decides: &["ZONE-05"],
    doc: "A vehicle that was clear of a BLOCKED zone while that was in force does not reach into it in the next state. Its \
          outline is that of its factsheet, else its kinematic centre alone is judged. What is nearer to the border than the \
          vehicle says to be exact, or than 0.1 m, is not judged.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::ZoneSet),
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Factsheet),
        Listen::Stored(Topic::Factsheet),
        Listen::Hook,
        Listen::Answer,
        Listen::Connect,
    ],
    reads: &[Fact::Zones],
    needs: &[StateView::zone_sets, StateView::position],
    start: |_| Box::new(Blocked::default()),
};

#[derive(Default)]
struct Blocked {
    /// Zones that the vehicle was clear of, by their ids.
    clear: BTreeSet<String>,
    /// Zones that it was found in, so that each is said once.
    said: BTreeSet<String>,
}

impl Running for Blocked {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if record.outside_influence() || record.connects() {
            self.clear.clear();
            return false;
        }
        let Some(state) = record.state() else { return false };
        let zones = context.world.zones();
        let Some(place) = zones.places().1.filter(|_| drives_by_order(state)) else {
            self.clear.clear();
            return false;
        };
        let blocked: Vec<_> = zones
            .in_force(place.pose.map_id.as_str())
            .filter(|zone| zone.is("BLOCKED"))
            .collect();
        self.clear.retain(|id| blocked.iter().any(|zone| zone.name() == id));
        for zone in &blocked {
            match zones.reach(zone, place) {
                Some(reach) if reach > 0.0 => {
                    let crossed = self.clear.remove(zone.name()) && self.said.insert(zone.name().to_owned());
                    if crossed {
                        let message = format!(
                            "the vehicle is at x {:.2}, y {:.2}, which is {reach:.2} m inside the BLOCKED zone {}",
                            place.pose.x,
                            place.pose.y,
                            quote(zone.name())
                        );
                        findings.push(broken("ZONE-05", record.seq(), message));
                    }
                }
                Some(_) => {
                    self.clear.insert(zone.name().to_owned());
                }
                None => {}
            }
        }
        !blocked.is_empty()
    }
}
