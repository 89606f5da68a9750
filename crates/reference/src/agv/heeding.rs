//! What the vehicle does about the zones that are in force (sections 6.4.1, 6.4.4 and 6.4.5).
//!
//! Its way is cut where its outline or its kinematic centre goes into a zone or out of it, so that it looks anew there: at
//! its speed, at the actions of the zone, at whether it may go on. What it may not go into it stops before, and then it says that
//! the node is out of reach, and waits (ZERR-01, ZERR-02). What is open is done so: a set that is enabled while the vehicle stands
//! in one of its zones holds at once, but that is no entry and starts no action; a direction that has to be kept is missed by
//! more than a tenth of a turn.

use std::f64::consts::{FRAC_PI_2, PI};

use super::Agv;
use super::action_kinds::{self, Effect};
use super::actions::{Action, Origin};
use super::errors::{ActiveError, Life};
use super::hook_points::{Cause, Passage, Permission};
use super::motion::{Facing, Pose, wrapped};
use super::order_message::{ActionRequest, Edge};
use super::order_state::Stop;
use super::path::{HALF_LENGTH, HALF_WIDTH};
use super::zones::{Limitation, Zone, ZoneKind};
use tck_base::nurbs::Path;
use tck_base::polygon::{Point, Polygon};

/// The way is looked at so far ahead at a time, in metres.
const STEP: f64 = 0.05;

/// Where a zone begins is found as exactly as this, in metres.
const EXACT: f64 = 1e-4;

/// So far before a zone that it may not go into the vehicle stops, in metres.
const BEFORE: f64 = 0.03;

/// So far before a zone its speed limit is kept already, in metres.
const SLOWS: f64 = 0.05;

/// A direction that has to be kept is kept within this, in radians.
const KEPT: f64 = PI / 10.0;

/// At most so many metres are looked at ahead.
const FARTHEST: f64 = 200.0;

/// A zone with the id of its set.
pub(crate) type OfSet = (String, Zone);

/// Where the vehicle is in zones, and what comes of that.
#[derive(Clone, Debug, Default)]
pub(crate) struct Heeding {
    /// The sets in force when it looked last.
    pub(crate) applied: Vec<String>,
    /// The zones it is in.
    pub(crate) inside: Vec<OfSet>,
    /// Zones whose actions would break the rule of another one.
    conflicts: Vec<String>,
    /// errorType and zoneId of what it has reported.
    violations: Vec<(String, String)>,
    /// Counts what it goes into and out of.
    passages: u32,
    /// Counts actions of zones.
    pub(crate) actions: u32,
    /// The zone whose actions were listed last, and which of its lists that was.
    pub(crate) acting: Option<(String, Passage)>,
}

impl Heeding {
    /// It was switched off and on.
    pub(crate) fn begins_anew(&mut self) {
        *self = Self {
            passages: self.passages,
            actions: self.actions,
            ..Self::default()
        };
    }
}

/// A place on the way where the vehicle goes into a zone or out of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change<'a> {
    /// Metres from the begin of the way.
    pub(crate) at: f64,
    /// zoneSetId.
    pub(crate) set: &'a str,
    pub(crate) zone: &'a Zone,
    /// Into it, not out of it.
    pub(crate) enters: bool,
    /// Direction of the way there, in radians.
    pub(crate) heading: f64,
}

/// The outline of the vehicle about its kinematic centre. What it carries is not larger.
fn outline() -> Option<Polygon> {
    Polygon::between(
        Point::new(-HALF_LENGTH, -HALF_WIDTH),
        Point::new(HALF_LENGTH, HALF_WIDTH),
    )
    .ok()
}

impl Agv {
    /// The zones that hold on a map, with their sets.
    pub(crate) fn zones_in_force(&self, map_id: &str) -> Vec<(&str, &Zone)> {
        let sets = self.zone_sets.all.iter();
        let applied =
            sets.filter(|set| set.map_id == map_id && self.allows(Permission::ApplyZoneSet(set), set.enabled));
        let zones = applied.flat_map(|set| set.zones.iter().map(|zone| (set.id.as_str(), zone)));
        let heeded =
            |zone: &Zone| self.config.heeds(zone.kind.literal()) && self.allows(Permission::HeedZone(zone), true);
        zones.filter(|(_, zone)| heeded(zone)).collect()
    }

    /// The zones the vehicle is in at a pose.
    pub(crate) fn zones_at(&self, pose: &Pose) -> Vec<(&str, &Zone)> {
        let zones = self.zones_in_force(&pose.map_id);
        zones
            .into_iter()
            .filter(|(_, zone)| self.is_inside(zone, pose, 0.0))
            .collect()
    }

    /// Whether it is in a zone at a pose, or nearer to it than this (ZONE-03, ZONE-04).
    pub(crate) fn is_inside(&self, zone: &Zone, pose: &Pose, near: f64) -> bool {
        if !self.allows(Permission::GoByContour(zone), zone.kind.is_of_contour()) {
            return zone.area.contains(Point::new(pose.x, pose.y));
        }
        let outline = outline().map(|outline| outline.at(pose.x, pose.y, pose.theta));
        outline.is_some_and(|outline| {
            !outline.is_far_from(&zone.area, near)
                && (outline.touches(&zone.area) || near > 0.0 && -outline.overlap(&zone.area) <= near)
        })
    }

    /// Where it would go into zones and out of them on a way, in the order in which it comes to them.
    pub(crate) fn changes_ahead(&self, way: &Path, facing: Facing, map_id: &str) -> Vec<Change<'_>> {
        let length = way.length().min(FARTHEST);
        let pose = |made: f64| {
            let spot = way.at(made)?;
            Some(Pose {
                x: spot.x,
                y: spot.y,
                theta: facing.at(spot.heading),
                map_id: map_id.to_owned(),
            })
        };
        let mut changes = Vec::new();
        for (set, zone) in self.zones_in_force(map_id) {
            let near = if matches!(zone.kind, ZoneKind::SpeedLimit(_)) {
                SLOWS
            } else {
                0.0
            };
            let inside = |made: f64| pose(made).is_some_and(|pose| self.is_inside(zone, &pose, near));
            let mut made = 0.0;
            let mut was = inside(made);
            while made < length {
                let next = (made + STEP).min(length);
                if inside(next) != was {
                    let (mut low, mut high) = (made, next);
                    while high - low > EXACT {
                        let middle = f64::midpoint(low, high);
                        if inside(middle) == was {
                            low = middle;
                        } else {
                            high = middle;
                        }
                    }
                    was = !was;
                    changes.push(Change {
                        at: high,
                        set,
                        zone,
                        enters: was,
                        heading: way.at(high).map_or(0.0, |spot| spot.heading),
                    });
                }
                made = next;
            }
        }
        changes.sort_by(|one, other| one.at.total_cmp(&other.at));
        changes
    }

    /// Whether a zone may not be gone into, or through, in a direction on an edge.
    pub(crate) fn bars(&self, zone: &Zone, heading: f64, edge: Option<&Edge>) -> bool {
        let curved = edge.is_some_and(|edge| edge.trajectory.is_some());
        let off = |direction: f64| wrapped(heading - direction).abs();
        let barred = match &zone.kind {
            ZoneKind::Blocked => true,
            ZoneKind::SpeedLimit(speed) => *speed < super::ability::SLOWEST,
            // Other vehicles have a line for every edge.
            ZoneKind::LineGuided => self.config.plans && !curved,
            ZoneKind::Directed(direction, Limitation::Restricted) => off(*direction) > FRAC_PI_2 && !curved,
            ZoneKind::Directed(direction, Limitation::Strict) => off(*direction) > KEPT && !curved,
            ZoneKind::Bidirected(direction, Limitation::Restricted) => {
                off(*direction).min(off(*direction + PI)) > KEPT && !curved
            }
            _ => false,
        };
        self.allows(Permission::StayOut(zone), barred)
    }

    /// How far it may go on its way before it has to look again, and how fast; `None` if it may not go at all.
    pub(crate) fn way_in_zones(
        &self,
        edge: Option<&Edge>,
        way: &Path,
        facing: Facing,
        map_id: &str,
    ) -> Option<(f64, f64)> {
        let begin = way.at(0.0)?;
        let pose = Pose {
            x: begin.x,
            y: begin.y,
            theta: facing.at(begin.heading),
            map_id: map_id.to_owned(),
        };
        // What blocks where it is already holds it (ZONE-06).
        let turns_back = |zone: &Zone| !matches!(zone.kind, ZoneKind::Blocked) && self.bars(zone, begin.heading, edge);
        if self.zones_at(&pose).iter().any(|(_, zone)| turns_back(zone)) {
            return None;
        }
        let limits = self.zones_in_force(map_id);
        let limits = limits.iter().filter_map(|(_, zone)| match zone.kind {
            ZoneKind::SpeedLimit(speed) if self.is_inside(zone, &pose, SLOWS) => Some(speed),
            _ => None,
        });
        let speed = limits.fold(f64::INFINITY, f64::min);
        let mut way_there = way.length();
        for change in self.changes_ahead(way, facing, map_id) {
            if change.enters && self.bars(change.zone, change.heading, edge) {
                let free = change.at - BEFORE;
                return (free > EXACT).then(|| (way_there.min(free), speed));
            }
            if change.at > EXACT {
                way_there = way_there.min(change.at);
            }
        }
        Some((way_there, speed))
    }

    /// Says that the next node is out of reach, and waits for what it is told (ZERR-01, ZERR-02).
    /// Whether it has not said so before.
    pub(crate) fn give_up_node(&mut self, stop: &Stop) -> bool {
        if std::mem::replace(&mut self.order.unreachable, true) {
            return false;
        }
        let error = ActiveError {
            error_type: self.config.errors.node_unreachable.clone(),
            fatal: false,
            references: vec![("nodeId".into(), stop.node.id.clone())],
            description: "the way to the node is closed".into(),
            life: Life::UntilNewOrder,
        };
        self.raise(Cause::Zone, error);
        true
    }

    /// Looks at the zones it is in; whether something has changed.
    pub(crate) fn watch_zones(&mut self) -> bool {
        if !self.config.heeds_zones() || self.zone_sets.all.is_empty() && self.heeding.inside.is_empty() {
            return false;
        }
        let moment = self.moment();
        let pose = self.motion.pose(moment);
        let sets = self.zone_sets.all.iter().filter(|set| set.map_id == pose.map_id);
        let applied = sets.filter(|set| self.allows(Permission::ApplyZoneSet(set), set.enabled));
        let applied: Vec<String> = applied.map(|set| set.id.clone()).collect();
        let zones = self.zones_at(&pose);
        let now: Vec<OfSet> = zones
            .into_iter()
            .map(|(set, zone)| (set.to_owned(), zone.clone()))
            .collect();
        let is_new = applied != self.heeding.applied;
        if is_new {
            self.heeding.applied = applied;
            if self.motion.is_moving() {
                self.motion.halt(moment);
            }
        }
        let before = std::mem::replace(&mut self.heeding.inside, now.clone());
        let in_force = |set: &String| self.heeding.applied.contains(set);
        let left = before.iter().filter(|zone| in_force(&zone.0) && !now.contains(zone));
        let left: Vec<Zone> = left.map(|(_, zone)| zone.clone()).collect();
        let entered = now.iter().filter(|zone| !is_new && !before.contains(zone));
        let entered: Vec<Zone> = entered.map(|(_, zone)| zone.clone()).collect();
        let acts = self.mode.takes_orders();
        for zone in left.iter().filter(|_| acts) {
            self.act_in_zone(zone, Passage::Exit);
        }
        for zone in entered.iter().filter(|_| acts) {
            self.act_in_zone(zone, Passage::Entry);
            self.act_in_zone(zone, Passage::During);
        }
        let told = self.settle_violations(&now);
        is_new || told || !left.is_empty() || !entered.is_empty()
    }

    /// Lists and triggers the actions of a zone (ZONE-18, ZACT-STATE-02, ZACT-STATE-03).
    fn act_in_zone(&mut self, zone: &Zone, passage: Passage) {
        let ZoneKind::Action { entry, during, exit } = &zone.kind else {
            return;
        };
        let requests: &[ActionRequest] = match passage {
            Passage::Entry => entry,
            Passage::During => during,
            Passage::Exit => exit,
        };
        if requests.is_empty() || !self.allows(Permission::ActInZone(zone, passage), true) {
            return;
        }
        if requests.iter().any(|request| self.conflicts(request)) {
            self.heeding.conflicts.push(zone.id.clone());
            return;
        }
        self.heeding.passages = self.heeding.passages.wrapping_add(1);
        self.heeding.acting = Some((zone.id.clone(), passage));
        let origin = Origin::Zone(self.heeding.passages);
        for request in requests {
            self.heeding.actions = self.heeding.actions.wrapping_add(1);
            let id = format!("zone-action-{}", self.heeding.actions);
            let kind = action_kinds::find(&self.config, &request.action_type);
            let request = ActionRequest { id, ..request.clone() };
            self.actions.push(Action::waiting(request, kind, origin));
        }
        self.trigger_actions(origin);
    }

    /// Whether an action would break the rule of a zone the vehicle is in: it leaves its line (ZINT-03).
    fn conflicts(&self, request: &ActionRequest) -> bool {
        let kind = action_kinds::find(&self.config, &request.action_type);
        let leaves = kind.is_some_and(|kind| kind.effect == Effect::FinePositioning);
        let binds = |zone: &Zone| matches!(zone.kind, ZoneKind::LineGuided | ZoneKind::CoordinatedReplanning);
        let conflicts = leaves && self.heeding.inside.iter().any(|(_, zone)| binds(zone));
        conflicts && self.allows(Permission::SeeConflict, true)
    }

    /// Stops and reports while it is where it must not be, or what it should do there cannot be done (ZONE-06, ZINT-03).
    fn settle_violations(&mut self, now: &[OfSet]) -> bool {
        self.heeding
            .conflicts
            .retain(|id| now.iter().any(|(_, zone)| zone.id == *id));
        let names = &self.config.errors;
        let blocked = now.iter().filter(|(_, zone)| zone.kind == ZoneKind::Blocked);
        let blocked = blocked.map(|(_, zone)| (names.blocked_zone.clone(), zone.id.clone()));
        let conflicts = self.heeding.conflicts.iter();
        let conflicts = conflicts.map(|id| (names.zone_action_conflict.clone(), id.clone()));
        let wanted: Vec<(String, String)> = blocked.chain(conflicts).collect();
        if wanted == self.heeding.violations {
            return false;
        }
        let before = std::mem::replace(&mut self.heeding.violations, wanted.clone());
        for (name, zone) in before.iter().filter(|violation| !wanted.contains(violation)) {
            self.errors.left_zone(name, zone);
        }
        for (name, zone) in wanted.iter().filter(|violation| !before.contains(violation)) {
            let error = ActiveError {
                error_type: name.clone(),
                fatal: false,
                references: vec![("zoneId".into(), zone.clone())],
                description: "the vehicle must not be here, or do what it is asked to do here".into(),
                life: Life::WhileInZone,
            };
            self.raise(Cause::Zone, error);
        }
        let holds = !wanted.is_empty() && self.allows(Permission::StopInZone, true);
        self.set_holds(|now| now.zone = holds);
        true
    }
}
