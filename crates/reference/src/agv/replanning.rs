//! Ways through COORDINATED_REPLANNING zones: planned and asked for before such a zone is gone into, and kept to inside
//! (sections 6.4.1.1, 6.4.3 and 6.4.4).
//!
//! The vehicle plans as far as its base leads through the zone, and waits where it is until that way is granted. What edges
//! prescribe is the way. On an edge without a trajectory it offers a bow beside the straight line as well, and drives what is
//! granted first. What stands on such an edge is driven round in the bow, once that is granted. A base that grows leads on by another way, which is asked for anew; so is the way on when a grant is lost
//! inside. How requests come and go stands in `zone_requests`.

use serde_json::Value;

use super::Agv;
use super::hook_points::Permission;
use super::motion::Pose;
use super::order_message::Edge;
use super::order_state::Stop;
use super::path::beside;
use super::paths::line;
use super::requests::RequestStatus;
use super::zone_requests::ZoneName;
use super::zones::{Zone, ZoneKind};
use tck_base::nurbs::Path;

/// So far beside a way that was granted it still is that way, in metres.
const NEAR: f64 = 0.1;

/// A way is looked at in steps of so many metres.
const STEP: f64 = 0.1;

/// How far the bow that it offers leaves the straight line, in metres, and as a share of the way at most.
const ASIDE: f64 = 0.5;
const SHARE: f64 = 0.25;

/// A bow over a shorter way is none, in metres.
const SHORTEST: f64 = 0.6;

/// A way through a zone that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Through {
    pub(crate) path: Path,
    /// As it is sent.
    pub(crate) sent: Value,
    /// The sequenceId of the edge beside whose straight line it leads.
    pub(crate) bow_of: Option<u32>,
}

impl Agv {
    /// Whether it may go through a zone on a way: a granted one leads there as well (ZONE-16).
    pub(crate) fn has_way(&self, set: &str, zone: &Zone, way: &Path, map_id: &str) -> bool {
        let requests = self.requests.of_zone(set, &zone.id);
        let granted = requests.filter(|request| request.status == RequestStatus::Granted);
        let mut ways = granted.filter_map(|request| request.way.as_ref());
        ways.any(|through| self.leads_beside(zone, way, &through.path, map_id))
    }

    /// Whether a way is nowhere in a zone far from another one.
    fn leads_beside(&self, zone: &Zone, way: &Path, other: &Path, map_id: &str) -> bool {
        self.inside_of(zone, way, map_id).iter().all(|pose| {
            let beside = other.beside(pose.x, pose.y);
            beside.is_some_and(|beside| beside.distance <= NEAR)
        })
    }

    /// Where a way is in a zone.
    fn inside_of(&self, zone: &Zone, way: &Path, map_id: &str) -> Vec<Pose> {
        let mut inside = Vec::new();
        let mut made = 0.0;
        while let Some(spot) = way.at(made) {
            let pose = Pose {
                x: spot.x,
                y: spot.y,
                theta: spot.heading,
                map_id: map_id.to_owned(),
            };
            if self.is_inside(zone, &pose, 0.0) {
                inside.push(pose);
            }
            if made >= way.length() {
                break;
            }
            made = (made + STEP).min(way.length());
        }
        inside
    }

    /// The ways that are to be asked for through a zone: none where one is asked for, or granted (ZREQ-07).
    pub(crate) fn ways_to_ask_for(&self, name: &ZoneName, zone: &Zone) -> Vec<Through> {
        let mut asked = self.requests.of_zone(&name.0, &name.1);
        if zone.kind != ZoneKind::CoordinatedReplanning || asked.any(|request| request.status.is_open()) {
            return Vec::new();
        }
        let map_id = self.motion.pose(self.moment()).map_id;
        let ways = self.ways_through(zone, &map_id);
        let has_one = |way: &Through| self.has_way(&name.0, zone, &way.path, &map_id);
        if ways.first().is_some_and(has_one) {
            return Vec::new();
        }
        ways
    }

    /// The ways it would take through a zone, the best one first.
    fn ways_through(&self, zone: &Zone, map_id: &str) -> Vec<Through> {
        let mut legs: Vec<(Option<&Edge>, Path)> = Vec::new();
        let mut met = false;
        for (edge, way) in self.base_ahead(map_id) {
            let inside = self.inside_of(zone, &way, map_id);
            let end = way.at(way.length());
            let stays = inside
                .last()
                .zip(end)
                .is_some_and(|(last, end)| (last.x - end.x).hypot(last.y - end.y) < STEP / 2.0);
            met |= !inside.is_empty();
            legs.push((edge, way));
            if met && !stays {
                break;
            }
        }
        if !met {
            return Vec::new();
        }
        let path = Path::through(legs.iter().flat_map(|(_, way)| way.points()));
        let only = legs.first().filter(|_| legs.len() == 1).and_then(|(edge, _)| *edge);
        let prescribed = only.and_then(|edge| edge.trajectory.as_ref());
        let prescribed = prescribed.filter(|trajectory| self.leads_beside(zone, &path, &trajectory.path, map_id));
        let points: Vec<(f64, f64)> = path.points().collect();
        let plain = only.filter(|edge| edge.trajectory.is_none());
        let bow_of = plain
            .filter(|edge| self.granted_bow(edge).is_some())
            .map(|edge| edge.sequence_id);
        let mut ways = vec![Through {
            sent: prescribed.map_or_else(|| line(&points), |trajectory| trajectory.sent.clone()),
            path: prescribed.map_or(path.clone(), |trajectory| trajectory.path.clone()),
            bow_of,
        }];
        let room = self.config.plans && bow_of.is_none() && path.length() >= SHORTEST;
        let is_blocked = |edge: &Edge| self.obstacles.contains(&edge.id);
        let offers = |edge: &&Edge| room && (is_blocked(edge) || self.allows(Permission::OfferAlternative, true));
        if let Some(edge) = plain.filter(offers) {
            if is_blocked(edge) {
                ways.clear();
            }
            let bow = beside(&path, ASIDE.min(SHARE * path.length()));
            let points: Vec<(f64, f64)> = bow.points().collect();
            ways.push(Through {
                sent: line(&points),
                path: bow,
                bow_of: Some(edge.sequence_id),
            });
        }
        ways
    }

    /// Where something stands on its edge, awaits the zones in which it may drive round it; whether these are new.
    pub(crate) fn replans(&mut self, edge: &Edge, stop: &Stop) -> bool {
        if !self.config.plans || edge.trajectory.is_some() || !self.config.asks_for_zones() {
            return false;
        }
        let pose = self.motion.pose(self.moment());
        let way = Path::through([(pose.x, pose.y), (stop.place.x, stop.place.y)]);
        let here = self.zones_in_force(&pose.map_id).into_iter();
        let met = here.filter(|(_, zone)| {
            let replanned = zone.kind == ZoneKind::CoordinatedReplanning;
            replanned && !self.inside_of(zone, &way, &pose.map_id).is_empty()
        });
        let names = met.map(|(set, zone)| (set.to_owned(), zone.id.clone())).collect();
        self.awaits_zones(names)
    }

    /// What is left of its base on a map: the ways from node to node, with their edges.
    fn base_ahead(&self, map_id: &str) -> Vec<(Option<&Edge>, Path)> {
        let pose = self.motion.pose(self.moment());
        let mut from = (pose.x, pose.y);
        let mut legs = Vec::new();
        let base = self
            .order
            .nodes
            .iter()
            .take_while(|stop| stop.node.released && stop.place.map_id == map_id);
        for (index, stop) in base.enumerate() {
            let to = (stop.place.x, stop.place.y);
            let mut edges = self.order.edges.iter();
            let edge = edges.find(|edge| edge.sequence_id + 1 == stop.node.sequence_id);
            let curve = edge.and_then(|edge| match index {
                0 => self.curve_ahead(edge, stop),
                _ => edge.trajectory.as_ref().map(|trajectory| trajectory.path.clone()),
            });
            legs.push((edge, curve.unwrap_or_else(|| Path::through([from, to]))));
            from = to;
        }
        legs
    }

    /// The bow beside an edge that it was granted.
    pub(crate) fn granted_bow(&self, edge: &Edge) -> Option<&Path> {
        let requests = self.requests.zones.iter();
        let granted = requests.filter(|request| {
            let granted = request.status == RequestStatus::Granted;
            self.allows(Permission::DriveWay(request), granted)
        });
        let mut ways = granted.filter_map(|request| request.way.as_ref());
        let bow = ways.find(|way| way.bow_of == Some(edge.sequence_id))?;
        Some(&bow.path)
    }

    /// The rest of such a bow to the node at its end, from where the vehicle is.
    pub(crate) fn bow_ahead(&self, edge: &Edge, stop: &Stop) -> Option<Path> {
        let bow = self.granted_bow(edge)?;
        let pose = self.motion.pose(self.moment());
        let made = bow.beside(pose.x, pose.y)?.made;
        let rest = bow.rest(made);
        let points = std::iter::once((pose.x, pose.y)).chain(rest.points());
        Some(Path::through(points.chain([(stop.place.x, stop.place.y)])))
    }
}
