//! `zones/contour`: the outline of the vehicle decides that it is in a zone, and not its kinematic centre.

use std::collections::BTreeSet;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::zones::{KnownZone, Place, ZonesSeen, speed, tells_place};
use tck_world::{Fact, Listen, Observation, Topic};

use super::drives_by_order;

/// `zones/contour`.
pub(crate) const CONTOUR: Check = Check {
    name: "zones/contour",
    decides: &["ZONE-03"],
    doc: "A vehicle whose factsheet draws its outline stays before a BLOCKED zone with all of it, and keeps the speed of a \
          SPEED_LIMIT zone as long as a part of it is inside. One that does not while its kinematic centre is \
          outside is a warning; with its centre inside it is a failure. What is nearer to the border than the vehicle \
          says to be exact, or than 0.1 m, is not judged; a velocity is judged from a tenth and 0.05 m/s above on.",
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
    needs: &[StateView::zone_sets, StateView::position],
    start: |_| Box::new(Contour::default()),
};

#[derive(Default)]
struct Contour {
    /// BLOCKED zones that the vehicle was clear of, by the ids of their sets and their own.
    clear: BTreeSet<(String, String)>,
    /// Zones that something was said about, and whether that was a failure.
    said: BTreeSet<(String, bool)>,
}

/// Where a vehicle with an outline is in a zone.
#[derive(Clone, Copy, PartialEq)]
enum Inside {
    Clear,
    /// With a part of its outline, and not with its centre.
    Part,
    Centre,
}

/// How much of the vehicle is inside for certain; `None` where it is near the border.
fn inside(zones: &ZonesSeen, zone: &KnownZone, place: &Place) -> Option<Inside> {
    let (reach, centre) = (zones.reach(zone, place)?, zones.centre(zone, place));
    match centre {
        _ if reach <= 0.0 => Some(Inside::Clear),
        Some(depth) if depth > 0.0 => Some(Inside::Centre),
        Some(_) => Some(Inside::Part),
        None => None,
    }
}

/// A zone, by the id of its set and its own.
fn name_of(zone: &KnownZone) -> (String, String) {
    (zone.set.clone(), zone.name().to_owned())
}

impl Contour {
    /// Whether a place before a BLOCKED zone or in it says something, and whether it is wrong.
    fn blocked(&mut self, zone: &KnownZone, there: Option<Inside>, stands: bool) -> (bool, bool) {
        let name = name_of(zone);
        let known = self.clear.contains(&name);
        match there {
            Some(Inside::Clear) => {
                self.clear.insert(name);
                (false, false)
            }
            // At its border, and not over it.
            None => (known && stands, false),
            Some(Inside::Part) => (known, known),
            Some(Inside::Centre) => (known, self.clear.remove(&name)),
        }
    }
}

impl Running for Contour {
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
        let zones = context.world.zones();
        if !tells_place(record) || !zones.knows_outline() {
            return false;
        }
        let Some(place) = zones.places().1 else {
            self.clear.clear();
            return false;
        };
        let state = record.state();
        if state.is_some_and(|state| !drives_by_order(state)) {
            self.clear.clear();
            return false;
        }
        let stands = state.is_some_and(|state| state.driving.is(false));
        let speed = speed(record);
        let mut judged = false;
        let in_force: BTreeSet<_> = zones.in_force(place.pose.map_id.as_str()).map(name_of).collect();
        self.clear.retain(|name| in_force.contains(name));
        for zone in zones.in_force(place.pose.map_id.as_str()) {
            let there = inside(zones, zone, place);
            let (looked, wrong, what) = if zone.is("BLOCKED") && state.is_some() {
                let (looked, wrong) = self.blocked(zone, there, stands);
                (looked, wrong, "has gone into".to_owned())
            } else if zone.is("SPEED_LIMIT") {
                let limit = zone.zone.maximum_speed.float();
                let Some((limit, speed)) = limit.zip(speed) else {
                    continue;
                };
                let partly = there == Some(Inside::Part);
                let fast = speed > limit * 1.1 + 0.05 && matches!(there, Some(Inside::Part | Inside::Centre));
                (partly || fast, fast, format!("drives at {speed:.2} m/s in"))
            } else {
                continue;
            };
            judged |= looked;
            let centre = there == Some(Inside::Centre);
            if !wrong || !self.said.insert((zone.name().to_owned(), centre)) {
                continue;
            }
            let part = if centre {
                "its kinematic centre"
            } else {
                "a part of its outline"
            };
            let message = format!("the vehicle {what} the zone {} with {part}", quote(zone.name()));
            findings.push(match centre {
                true => broken("ZONE-03", record.seq(), message),
                false => remark("ZONE-03", record.seq(), message),
            });
        }
        judged
    }
}
