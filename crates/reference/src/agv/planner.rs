//! Which way a freely navigating vehicle takes from node to node where zones weigh on it (sections 6.4.1.2 and 6.4.4).
//!
//! It goes straight, or in a bow to the left or to the right, whichever is the shortest when a metre inside a zone counts for more
//! or for less than one. How much more a factor means is open: a way against a direction that is SOFT, and one through a PENALTY
//! zone, count up to five times as much, one through a PRIORITY zone down to two fifths. It decides when it sets out,
//! and again when other zones come into force.

use std::f64::consts::PI;

use super::Agv;
use super::motion::Pose;
use super::order_message::Edge;
use super::order_state::Stop;
use super::path::beside;
use super::zones::{Limitation, Zone, ZoneKind};
use tck_base::nurbs::Path;

/// How far a bow leads beside the straight way, in metres.
const ASIDE: f64 = 0.5;

/// A shorter way has no bow, in metres.
const SHORTEST: f64 = 1.0;

/// The way is weighed so far at a time, in metres.
const STEP: f64 = 0.05;

/// So many more metres one counts for in a PENALTY zone, times its factor.
const PENALTY: f64 = 4.0;

/// What one counts for where no way leads but this (ZONE-20).
const LAST_RESORT: f64 = 1_000.0;

/// So much less one counts for in a PRIORITY zone, times its factor.
const PRIORITY: f64 = 0.6;

/// So many more metres one counts for against a direction that should be kept.
const AGAINST: f64 = 4.0;

/// A way is better than another one from this on.
const BETTER: f64 = 1e-6;

/// The way over an edge, as it was chosen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bow {
    /// orderId, and sequenceId of the edge.
    edge: (String, u32),
    /// The zone sets in force.
    applied: Vec<String>,
    /// Where it begins.
    from: (f64, f64),
    /// How far it leads to the left; negative, to the right.
    lateral: f64,
}

impl Agv {
    /// Chooses the way over an edge, if it has not done so yet with these zones.
    pub(crate) fn choose_way(&mut self, edge: &Edge, stop: &Stop) {
        let known = self.order.bow.as_ref().filter(|bow| self.is_about(bow, edge));
        if known.is_some_and(|bow| bow.applied == self.heeding.applied) {
            return;
        }
        let pose = self.motion.pose(self.moment());
        let from = (pose.x, pose.y);
        self.order.bow = Some(Bow {
            edge: (self.order.order_id.clone(), edge.sequence_id),
            applied: self.heeding.applied.clone(),
            from,
            lateral: self.lateral(from, stop, edge),
        });
    }

    /// The way over the edge ahead as it was chosen; `None` where that is the straight one.
    pub(crate) fn way_round(&self, edge: &Edge, stop: &Stop) -> Option<Path> {
        let bow = self.order.bow.as_ref().filter(|bow| self.is_about(bow, edge))?;
        let straight = Path::through([bow.from, (stop.place.x, stop.place.y)]);
        (bow.lateral.abs() > 0.0).then(|| beside(&straight, bow.lateral))
    }

    fn is_about(&self, bow: &Bow, edge: &Edge) -> bool {
        (bow.edge.0.as_str(), bow.edge.1) == (self.order.order_id.as_str(), edge.sequence_id)
    }

    /// The way that it would choose from a place over an edge.
    pub(crate) fn way_from(&self, from: (f64, f64), edge: &Edge, stop: &Stop) -> Path {
        let straight = Path::through([from, (stop.place.x, stop.place.y)]);
        match self.lateral(from, stop, edge) {
            lateral if lateral.abs() > 0.0 => beside(&straight, lateral),
            _ => straight,
        }
    }

    /// How far beside the straight way it goes to the left; negative, to the right.
    fn lateral(&self, from: (f64, f64), stop: &Stop, edge: &Edge) -> f64 {
        let map = &stop.place.map_id;
        let plans = self.config.plans && self.config.heeds_zones();
        if !plans || edge.trajectory.is_some() || edge.corridor.is_some() || self.zones_in_force(map).is_empty() {
            return 0.0;
        }
        let straight = Path::through([from, (stop.place.x, stop.place.y)]);
        if straight.length() < SHORTEST {
            return 0.0;
        }
        let mut best = (0.0, self.weight(&straight, map, edge));
        for lateral in [ASIDE, -ASIDE] {
            let weight = self.weight(&beside(&straight, lateral), map, edge);
            if weight < best.1 - BETTER {
                best = (lateral, weight);
            }
        }
        best.0
    }

    /// How long a way is when the zones on it are counted in; without end where it may not go.
    fn weight(&self, way: &Path, map_id: &str, edge: &Edge) -> f64 {
        let zones = self.zones_in_force(map_id);
        let mut made = 0.0;
        let mut weight = 0.0;
        while let Some(spot) = way.at(made).filter(|_| made < way.length()) {
            let pose = Pose {
                x: spot.x,
                y: spot.y,
                theta: spot.heading,
                map_id: map_id.to_owned(),
            };
            let inside = zones.iter().map(|(_, zone)| *zone);
            let inside: Vec<&Zone> = inside.filter(|zone| self.is_inside(zone, &pose, 0.0)).collect();
            if inside.iter().any(|zone| self.bars(zone, spot.heading, Some(edge))) {
                return f64::INFINITY;
            }
            weight += counts(&inside, spot.heading) * STEP.min(way.length() - made);
            made += STEP;
        }
        weight
    }
}

/// What a metre counts for inside these zones, in a direction: the lowest factor of PRIORITY and the highest of PENALTY zones,
/// and of both the penalty (ZINT-06).
fn counts(zones: &[&Zone], heading: f64) -> f64 {
    let (mut priority, mut penalty, mut against) = (None::<f64>, None::<f64>, 0.0_f64);
    for zone in zones {
        match zone.kind {
            ZoneKind::Priority(factor) => priority = Some(priority.map_or(factor, |lowest| lowest.min(factor))),
            ZoneKind::Penalty(factor) => penalty = Some(penalty.map_or(factor, |highest| highest.max(factor))),
            ZoneKind::Directed(direction, Limitation::Soft) => {
                against = against.max((1.0 - (heading - direction).cos()) / 2.0);
            }
            ZoneKind::Bidirected(direction, Limitation::Soft) => {
                let off = (heading - direction).rem_euclid(PI).sin();
                against = against.max(off * off);
            }
            _ => {}
        }
    }
    let weighed = match (penalty, priority) {
        (Some(factor), _) if factor >= 1.0 => LAST_RESORT,
        (Some(factor), _) => 1.0 + PENALTY * factor,
        (None, Some(factor)) => 1.0 - PRIORITY * factor,
        (None, None) => 1.0,
    };
    weighed + AGAINST * against
}
