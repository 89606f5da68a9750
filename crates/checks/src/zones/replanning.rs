//! `zones/replanning-path` and `zones/replanning-sent`: the ways through COORDINATED_REPLANNING zones.

use std::collections::{BTreeMap, BTreeSet};

use tck_base::nurbs::Path;
use tck_base::polygon::Point;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::Event;
use tck_pack::HookChange;
use tck_view::{Edge, StateView, ZoneRequest};
use tck_world::ordered::{allowed_deviation, curve};
use tck_world::zones::{EXACT, KnownZone, Place};
use tck_world::{Fact, Listen, Observation, Topic};

use super::drives_by_order;
use super::release::{Answers, Name, REPLANNING, hears_cancel, is_overruled, requests};
use crate::finding::{broken, quote, remark};

/// `zones/replanning-path`.
pub(crate) const REPLANNING_PATH: Check = Check {
    name: "zones/replanning-path",
    decides: &["ZONE-16"],
    doc: "A vehicle that was clear of a COORDINATED_REPLANNING zone in force, and reaches into it, is on one of the trajectories \
          that it was granted for that zone, within 0.3 m and what its position may be off; up to twice that is a warning. Where \
          its kinematic centre is outside the trajectory may begin or end elsewhere. A vehicle that drives along another \
          trajectory, which it has asked for or which its order has, is not on a granted one as soon as the two can be told from \
          each other. Orders with a corridor, within which a trajectory may be left, are not judged, nor is what meets a \
          LINE_GUIDED zone.",
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
          zone lead where the part of that trajectory inside the zone leads, within 0.3 m. Judged once it has driven 0.2 m there, \
          where it was clear of the zone before, where it has sent a trajectory, where no LINE_GUIDED zone is met, and where \
          the order lets it leave its trajectories neither in a corridor nor at a node.",
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

/// How far from a way a vehicle, or another way, may be, in metres. Twice as far a vehicle is on none of its ways.
const BESIDE: f64 = 0.3;
/// How far a vehicle goes on along a way until it is said to drive it, in metres.
const ALONG: f64 = 0.2;
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

/// What is said of what is seen.
#[derive(Clone, Copy, Default, PartialEq, PartialOrd)]
enum Weight {
    #[default]
    Nothing,
    Warning,
    Breach,
}

/// What is known of a zone.
#[derive(Default)]
struct Access {
    /// The vehicle was clear of it for certain, since nothing was unclear.
    clear: bool,
    /// What it has asked for since then, by requestId. A request that changes its way asks for both.
    ways: Vec<(String, Path)>,
    /// Where it was first seen on a way that it was not granted, since it was on one that it was.
    elsewhere: Option<(f64, f64)>,
    /// The edge on which it is, and where it was first seen on it.
    begun: Option<(u64, (f64, f64))>,
    /// With which edge its ways were compared, and how many there were.
    compared: Option<(u64, usize)>,
    /// The worst that was said of it.
    told: Weight,
}

struct Ways {
    question: Question,
    answers: Answers,
    order: String,
    /// The trajectories of the edges of the order, by sequenceId.
    edges: BTreeMap<u64, Path>,
    /// An edge has a corridor.
    loosened: bool,
    /// A node allows to leave the way to it.
    cuts: bool,
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
            cuts: false,
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
            self.cuts = false;
        }
        for access in self.zones.values_mut() {
            access.compared = None;
        }
        let allowed = order.nodes.iter().filter_map(allowed_deviation);
        self.cuts |= allowed.fold(0.0, f64::max) > BESIDE;
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
            access.ways.retain(|(id, _)| is_listed(id));
            access.elsewhere = None;
            access.begun = None;
            access.compared = None;
            access.clear = true;
        }
        for request in listed {
            let Some(id) = request.request_id.text() else { continue };
            if access.ways.len() >= WAYS {
                break;
            }
            if let Some(curve) = curve(&request.trajectory).and_then(|(curve, _)| curve) {
                let way = (id.to_owned(), curve.path());
                if !access.ways.contains(&way) {
                    access.ways.push(way);
                }
            }
        }
    }

    /// What is wrong where the vehicle is in a zone, with its kinematic centre or not, and how much; `None` where nothing can be told.
    fn look(
        &mut self,
        state: &StateView,
        zone: &KnownZone,
        place: &Place,
        is_inside: bool,
    ) -> Option<(Weight, String)> {
        let name = (zone.set.clone(), zone.name().to_owned());
        let access = self.zones.get(&name).filter(|access| access.clear && !self.loosened)?;
        match self.question {
            Question::Kept => {
                let (off, elsewhere) = self.off_its_way(access, place, is_inside)?;
                let text = format!(
                    "in the {REPLANNING} zone {} the vehicle is {off:.2} m beside the ways that it was granted",
                    quote(zone.name())
                );
                let drives = elsewhere.is_some_and(|begin| has_gone(begin, place));
                self.zones.get_mut(&name)?.elsewhere = elsewhere;
                Some(match off - place.off {
                    _ if drives => (Weight::Breach, format!("{text}, and drives another one")),
                    off if off > 2.0 * BESIDE => (Weight::Breach, text),
                    off if off > BESIDE => (Weight::Warning, text),
                    _ => (Weight::Nothing, text),
                })
            }
            Question::Sent => {
                let edge = state.last_node_sequence_id.whole()?.checked_add(1)?;
                let begun = access.begun.filter(|(last, _)| *last == edge);
                let (_, begin) = begun.unwrap_or((edge, (place.pose.x, place.pose.y)));
                let compared = Some((edge, access.ways.len()));
                if access.compared == compared {
                    return Some((Weight::Nothing, String::new()));
                }
                // One that says that it drives may still be about to ask.
                let off = match has_gone(begin, place) {
                    true => self.off_its_edge(access, edge, state, zone, place),
                    false => None,
                };
                let access = self.zones.get_mut(&name)?;
                access.begun = Some((edge, begin));
                let off = off?;
                access.compared = compared;
                let text = format!(
                    "the trajectory of the edge with the sequenceId {edge} leads up to {off:.2} m beside what was asked for in the \
                     {REPLANNING} zone {}",
                    quote(zone.name())
                );
                Some(match off > BESIDE {
                    true => (Weight::Breach, text),
                    false => (Weight::Nothing, text),
                })
            }
        }
    }

    /// How far the vehicle is from the ways that it was granted, and since where it is on another one instead.
    fn off_its_way(&self, access: &Access, place: &Place, is_inside: bool) -> Option<(f64, Option<(f64, f64)>)> {
        let (x, y) = (place.pose.x, place.pose.y);
        let granted = access.ways.iter().filter(|(id, _)| self.is_granted(id));
        let (off, at_end) = nearest(granted.map(|(_, way)| way), x, y)?;
        if at_end && !is_inside {
            return None;
        }
        let others = access.ways.iter().filter(|(id, _)| !self.is_granted(id));
        let other = beside(others.map(|(_, way)| way).chain(self.edges.values()), x, y);
        let is_there = |other: f64| other <= place.off && off - other > BESIDE.max(2.0 * place.off);
        let elsewhere = match other.is_some_and(is_there) {
            true => access.elsewhere.or(Some((x, y))),
            false => None,
        };
        Some((off, elsewhere))
    }

    /// How far the trajectory of the edge on which the vehicle drives leads beside what it has asked for.
    fn off_its_edge(
        &self,
        access: &Access,
        edge: u64,
        state: &StateView,
        zone: &KnownZone,
        place: &Place,
    ) -> Option<f64> {
        let way = self.edges.get(&edge)?;
        let on_it = beside(std::iter::once(way), place.pose.x, place.pose.y)? - place.off <= BESIDE;
        if !on_it || self.cuts || access.ways.is_empty() || !state.driving.is(true) {
            return None;
        }
        let steps = (0..STEPS).map(|step| STEP * f64::from(step));
        let spots = steps
            .take_while(|made| *made <= way.length())
            .filter_map(|made| way.at(made));
        let inside = spots.filter(|spot| zone.area.depth(Point::new(spot.x, spot.y)) > EXACT);
        let off = inside.filter_map(|spot| beside(access.ways.iter().map(|(_, way)| way), spot.x, spot.y));
        Some(off.fold(0.0, f64::max))
    }

    fn is_granted(&self, id: &str) -> bool {
        self.answers.0.get(id).is_some_and(|given| given.granted)
    }
}

/// Whether a vehicle has driven on since it was at a place.
fn has_gone((x, y): (f64, f64), place: &Place) -> bool {
    (place.pose.x - x).hypot(place.pose.y - y) >= ALONG
}

/// How far a place is beside the nearest of some ways, and whether it is one of its ends that is so near.
fn nearest<'a>(ways: impl Iterator<Item = &'a Path>, x: f64, y: f64) -> Option<(f64, bool)> {
    let all = ways.filter_map(|way| {
        let beside = way.beside(x, y)?;
        let at_end = beside.made < EXACT || beside.made > way.length() - EXACT;
        Some((beside.distance, at_end))
    });
    all.min_by(|one, other| one.0.total_cmp(&other.0))
}

/// How far a place is beside the nearest of some ways.
fn beside<'a>(ways: impl Iterator<Item = &'a Path>, x: f64, y: f64) -> Option<f64> {
    nearest(ways, x, y).map(|(distance, _)| distance)
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
            let reach = zones.reach(zone, place);
            self.learn_ways(state, zone, reach);
            let is_inside = zones.centre(zone, place).is_some_and(|depth| depth > 0.0);
            let reaches = is_inside || reach.is_some_and(|reach| reach > 0.0);
            let of_order = state.order_id.is(&self.order);
            if reaches
                && of_order
                && let Some((weight, text)) = self.look(state, zone, place, is_inside)
            {
                judged = true;
                let access = self.zones.entry(name.clone()).or_default();
                // The worse one is said even where the other one was.
                if weight > access.told {
                    access.told = weight;
                    findings.push(match (self.question, weight) {
                        (Question::Sent, _) => broken("ZREQ-16", record.seq(), text),
                        (Question::Kept, Weight::Breach) => broken("ZONE-16", record.seq(), text),
                        (Question::Kept, _) => remark("ZONE-16", record.seq(), text),
                    });
                }
            }
            in_force.insert(name);
        }
        self.zones.retain(|name, _| in_force.contains(name));
        judged
    }
}
