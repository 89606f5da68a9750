//! `zones/replanning-path` and `zones/replanning-sent`: the ways through COORDINATED_REPLANNING zones.

use std::collections::{BTreeMap, BTreeSet};

use tck_base::nurbs::Path;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::Event;
use tck_pack::HookChange;
use tck_view::{Edge, StateView, ZoneRequest};
use tck_world::ordered::curve;
use tck_world::zones::{EXACT, KnownZone, Place};
use tck_world::{Fact, Listen, Observation, Topic};

use super::drives_by_order;
use super::release::{Answers, Name, REPLANNING, hears_cancel, is_overruled, requests};
use crate::finding::{broken, quote, remark};

/// `zones/replanning-path`.
pub(crate) const REPLANNING_PATH: Check = Check {
    name: "zones/replanning-path",
    decides: &["ZONE-16"],
    doc: "A vehicle that was clear of a COORDINATED_REPLANNING zone in force, and whose kinematic centre is inside, is on one of \
          the trajectories that it was granted for that zone, within 0.3 m; from 0.2 m on it is a warning. Orders with a corridor, \
          within which a trajectory may be left, are not judged, nor is what meets a LINE_GUIDED zone.",
    arguments: &[],
    listens: LISTENS,
    reads: &[Fact::Zones],
    needs: NEEDS,
    start: |_| Box::new(Ways::of(Question::Kept)),
};

/// `zones/replanning-sent`.
pub(crate) const REPLANNING_SENT: Check = Check {
    name: "zones/replanning-sent",
    decides: &["ZREQ-16"],
    doc: "When a vehicle drives an edge with a trajectory in a COORDINATED_REPLANNING zone, the trajectories of its requests for that \
          zone lead where the part of that trajectory inside the zone leads, within 0.3 m. Judged where it was clear of the \
          zone before, where it has sent a trajectory, and where no LINE_GUIDED zone is met.",
    arguments: &[],
    listens: LISTENS,
    reads: &[Fact::Zones],
    needs: NEEDS,
    start: |_| Box::new(Ways::of(Question::Sent)),
};

const LISTENS: &[Listen] = &[
    Listen::ToVehicle(Topic::ZoneSet),
    Listen::ToVehicle(Topic::Order),
    Listen::ToVehicle(Topic::Responses),
    Listen::ToVehicle(Topic::InstantActions),
    Listen::Delivered(Topic::State),
    Listen::Delivered(Topic::Factsheet),
    Listen::Stored(Topic::Factsheet),
    Listen::Hook,
    Listen::Answer,
    Listen::Connect,
];
const NEEDS: &[tck_view::Field] = &[
    StateView::zone_sets,
    StateView::zone_requests,
    StateView::position,
    ZoneRequest::trajectory,
    Edge::trajectory,
];

/// How far from a way a vehicle, or another way, may be, in metres.
const BESIDE: f64 = 0.3;
/// How far a vehicle may be without a word about it.
const NEAR: f64 = 0.2;
/// A trajectory is looked at in steps of so many metres, and so many of them.
const STEP: f64 = 0.2;
const STEPS: u32 = 2_000;
/// How many ways, and edges of an order, are kept in mind.
const WAYS: usize = 64;
const EDGES: usize = 128;

#[derive(Clone, Copy, PartialEq)]
enum Question {
    Kept,
    Sent,
}

/// What is known of a zone.
#[derive(Default)]
struct Access {
    /// The vehicle was clear of it for certain, since nothing was unclear.
    clear: bool,
    /// What it has asked for since then.
    ways: BTreeMap<String, Path>,
    /// What was said of it: nothing, a warning, a breach.
    told: u8,
}

struct Ways {
    question: Question,
    answers: Answers,
    order: String,
    /// The trajectories of the edges of the order, by sequenceId.
    edges: BTreeMap<u64, Path>,
    /// An edge has a corridor.
    loosened: bool,
    zones: BTreeMap<Name, Access>,
}

impl Ways {
    fn of(question: Question) -> Self {
        Self {
            question,
            answers: Answers::default(),
            order: String::new(),
            edges: BTreeMap::new(),
            loosened: false,
            zones: BTreeMap::new(),
        }
    }

    /// Learns what is ordered.
    fn learn(&mut self, record: &Observation<'_>) {
        let Some(order) = record.order_to_vehicle() else { return };
        let id = order.order_id.or_empty();
        if self.order != id {
            id.clone_into(&mut self.order);
            self.edges.clear();
            self.loosened = false;
        }
        for edge in order.edges.iter().take(EDGES) {
            let Some(sequence_id) = edge.sequence_id.whole() else {
                continue;
            };
            self.loosened |= edge.corridor.presence().is_something();
            self.edges.remove(&sequence_id);
            let path = curve(&edge.trajectory).and_then(|(curve, _)| curve);
            if let Some(path) = path.filter(|_| self.edges.len() < EDGES) {
                self.edges.insert(sequence_id, path.path());
            }
        }
    }

    /// Learns what is asked for in a zone.
    fn learn_ways(&mut self, state: &StateView, zone: &KnownZone, reach: Option<f64>) {
        let name = (zone.set.clone(), zone.name().to_owned());
        let access = self.zones.entry(name).or_default();
        let listed = requests(state, zone);
        if reach.is_some_and(|reach| reach <= 0.0) {
            let is_listed = |id: &String| listed.iter().any(|request| request.request_id.is(id));
            access.ways.retain(|id, _| is_listed(id));
            access.clear = true;
        }
        for request in listed {
            let Some(id) = request.request_id.text() else { continue };
            if access.ways.contains_key(id) || access.ways.len() >= WAYS {
                continue;
            }
            if let Some(curve) = curve(&request.trajectory).and_then(|(curve, _)| curve) {
                access.ways.insert(id.to_owned(), curve.path());
            }
        }
    }

    /// What is wrong where the vehicle is in a zone, with how many metres it is off; `None` where nothing can be told.
    fn look(&self, state: &StateView, zone: &KnownZone, place: &Place) -> Option<(f64, String)> {
        let access = self.zones.get(&(zone.set.clone(), zone.name().to_owned()))?;
        if !access.clear || self.loosened && self.question == Question::Kept {
            return None;
        }
        let (x, y) = (place.pose.x, place.pose.y);
        let name = quote(zone.name());
        match self.question {
            Question::Kept => {
                let granted = access.ways.iter().filter(|(id, _)| self.is_granted(id));
                let off = beside(granted.map(|(_, way)| way), x, y)? - place.off;
                let text = format!(
                    "in the {REPLANNING} zone {name} the vehicle is {off:.2} m beside the ways that it was granted"
                );
                Some((off, text))
            }
            Question::Sent => {
                let edge = state.last_node_sequence_id.whole()?.checked_add(1)?;
                let way = self.edges.get(&edge)?;
                let on_it = beside(std::iter::once(way), x, y)? - place.off <= BESIDE;
                if !on_it || access.ways.is_empty() || !state.driving.is(true) {
                    return None;
                }
                let steps = (0..STEPS).map(|step| STEP * f64::from(step));
                let spots = steps
                    .take_while(|made| *made <= way.length())
                    .filter_map(|made| way.at(made));
                let inside =
                    spots.filter(|spot| zone.area.depth(tck_base::polygon::Point::new(spot.x, spot.y)) > EXACT);
                let off = inside.filter_map(|spot| beside(access.ways.values(), spot.x, spot.y));
                let off = off.fold(0.0, f64::max);
                let text = format!(
                    "the trajectory of the edge with the sequenceId {edge} leads up to {off:.2} m beside what was asked for in the \
                     {REPLANNING} zone {name}"
                );
                Some((off, text))
            }
        }
    }

    fn is_granted(&self, id: &str) -> bool {
        self.answers.0.get(id).is_some_and(|given| given.granted)
    }
}

/// How far a place is beside the nearest of some ways.
fn beside<'a>(ways: impl Iterator<Item = &'a Path>, x: f64, y: f64) -> Option<f64> {
    let all = ways.filter_map(|way| way.beside(x, y)).map(|beside| beside.distance);
    all.min_by(f64::total_cmp)
}

/// Whether somebody may have moved the vehicle, or started it anew.
fn may_be_moved(record: &Observation<'_>, context: &CheckContext<'_>) -> bool {
    match record.event() {
        Event::Hook { hook, .. } => context
            .hook(hook)
            .is_none_or(|hook| hook.may_restart() || hook.changes().contains(&HookChange::Position)),
        _ => record.outside_influence(),
    }
}

impl Running for Ways {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.answers.learn(record);
        self.learn(record);
        if may_be_moved(record, context) || record.connects() || hears_cancel(record) {
            self.zones.clear();
        }
        let Some(state) = record.state() else { return false };
        let zones = context.world.zones();
        let Some(place) = zones.places().1.filter(|_| drives_by_order(state)) else {
            self.zones.clear();
            return false;
        };
        let mut judged = false;
        let mut in_force = BTreeSet::new();
        let here = zones.in_force(place.pose.map_id.as_str());
        for zone in here.filter(|zone| zone.is(REPLANNING) && !is_overruled(zones, zone, place)) {
            let name = (zone.set.clone(), zone.name().to_owned());
            self.learn_ways(state, zone, zones.reach(zone, place));
            let inside = zones.centre(zone, place).is_some_and(|depth| depth > 0.0);
            let of_order = state.order_id.is(&self.order);
            if inside
                && of_order
                && let Some((off, text)) = self.look(state, zone, place)
            {
                judged = true;
                let access = self.zones.entry(name.clone()).or_default();
                let finding = match self.question {
                    Question::Kept if off > BESIDE => Some(broken("ZONE-16", record.seq(), text)),
                    Question::Kept if off > NEAR => Some(remark("ZONE-16", record.seq(), text)),
                    Question::Sent if off > BESIDE => Some(broken("ZREQ-16", record.seq(), text)),
                    _ => None,
                };
                // The worse one is said even where the other one was.
                let weight = finding
                    .as_ref()
                    .map_or(0, |finding| if finding.verdict.is_some() { 1 } else { 2 });
                if weight > access.told {
                    access.told = weight;
                    findings.extend(finding);
                }
            }
            in_force.insert(name);
        }
        self.zones.retain(|name, _| in_force.contains(name));
        judged
    }
}
