//! Requests for RELEASE and COORDINATED_REPLANNING zones: made before their border, kept while inside, and what follows when
//! what was granted is lost (sections 6.4.1.1, 6.4.3 and 6.9).
//!
//! The vehicle asks for the zones on the leg ahead when it sets out, and waits before the border of the first one until
//! that and all that overlap it are granted. In one in which it is without a grant, such as after somebody has stepped in,
//! it asks before it drives. A release that is lost inside ends in what the zone says: STOP holds the vehicle until another
//! request is granted (the ruling of ZONE-12); EVACUATE and CONTINUE let it drive on by its way until it is out, with a
//! word of its own about that (the ruling of ZREQ-13). A way that is lost in a COORDINATED_REPLANNING zone holds it as well, and is
//! told by that word, since the standard has no other (the ruling of ZREQ-15); which ways it asks for stands in `replanning`. Where its order ends inside it waits for another one. With its
//! order, and in a mode in which fleet control does not command it, its requests are gone (ORD-CLEAR-08, MODE-08, MODE-16).

use serde_json::{Value, json};

use super::Agv;
use super::errors::{ActiveError, Life};
use super::hook_points::{Cause, Part, Permission};
use super::motion::{Facing, Pose};
use super::replanning::Through;
use super::requests::{Answer, Grant, RequestStatus};
use super::zones::{ReleaseLoss, Zone, ZoneKind};
use tck_base::clock::Moment;
use tck_base::nurbs::Path;

/// So far before a zone that it may not go into the vehicle stops, in metres.
const BEFORE: f64 = 0.03;

/// A zone, by the id of its set and its own.
pub(crate) type ZoneName = (String, String);

/// A zone that was asked for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ZoneRequest {
    pub(crate) id: String,
    pub(crate) zone: ZoneName,
    pub(crate) status: RequestStatus,
    /// When the grant ends.
    pub(crate) lease: Option<Moment>,
    /// It is in the zone, and was granted it.
    pub(crate) inside: bool,
    /// The way through the zone, of a request for one.
    pub(crate) way: Option<Through>,
}

impl ZoneRequest {
    /// Whether its release was lost.
    pub(crate) fn is_lost(&self) -> bool {
        matches!(self.status, RequestStatus::Revoked | RequestStatus::Expired)
    }
}

/// A zone whose release was lost while the vehicle was inside.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LostRelease {
    pub(crate) zone: ZoneName,
    pub(crate) loss: ReleaseLoss,
}

impl Agv {
    /// The zones on a way that it has no access to yet, and how far it may go before the first of them.
    pub(crate) fn releases_ahead(&self, way: &Path, facing: Facing, map_id: &str) -> (Vec<ZoneName>, Option<f64>) {
        let Some(begin) = way.at(0.0).filter(|_| self.config.asks_for_zones()) else {
            return (Vec::new(), None);
        };
        let pose = Pose {
            x: begin.x,
            y: begin.y,
            theta: facing.at(begin.heading),
            map_id: map_id.to_owned(),
        };
        let within = self.zones_at(&pose);
        let within = within.into_iter().map(|(set, zone)| (0.0, set, zone));
        let changes = self.changes_ahead(way, facing, map_id);
        let changes = changes.into_iter().filter(|change| change.enters);
        let met: Vec<(f64, &str, &Zone)> = within
            .chain(changes.map(|change| (change.at, change.set, change.zone)))
            .filter(|(_, _, zone)| matches!(zone.kind, ZoneKind::Release(_) | ZoneKind::CoordinatedReplanning))
            .collect();
        let has_access = |set: &str, zone: &Zone| match zone.kind {
            ZoneKind::CoordinatedReplanning => self.has_way(set, zone, way, map_id),
            _ => self.has_access(set, zone),
        };
        let closed: Vec<&(f64, &str, &Zone)> = met
            .iter()
            .filter(|(_, set, zone)| !self.allows(Permission::EnterZone(zone), has_access(set, zone)))
            .collect();
        let is_barred = |one: &&(f64, &str, &Zone)| closed.iter().any(|other| one.2.area.touches(&other.2.area));
        let free = met.iter().find(is_barred).map(|(at, _, zone)| match zone.kind {
            // It may be granted another way from where it is.
            ZoneKind::CoordinatedReplanning => 0.0,
            _ => (at - BEFORE).max(0.0),
        });
        let mut wanted: Vec<ZoneName> = Vec::new();
        for (_, set, zone) in met.iter().filter(|(_, set, zone)| !has_access(set, zone)) {
            let name = ((*set).to_owned(), zone.id.clone());
            if !wanted.contains(&name) {
                wanted.push(name);
            }
        }
        (wanted, free)
    }

    /// Whether a RELEASE zone may be gone into, or through (ZONE-10). What was lost inside is left as the zone says.
    fn has_access(&self, set: &str, zone: &Zone) -> bool {
        let mut requests = self.requests.of_zone(set, &zone.id);
        requests.any(|request| request.status == RequestStatus::Granted || request.inside && request.is_lost())
    }

    /// Keeps in mind for which zones it waits, or will; whether these are others than before.
    pub(crate) fn awaits_zones(&mut self, zones: Vec<ZoneName>) -> bool {
        let is_new = !zones.is_empty() && self.requests.awaited != zones;
        self.requests.awaited = zones;
        is_new
    }

    /// A zone of this name, as long as it is in force.
    pub(crate) fn zone_of(&self, name: &ZoneName) -> Option<&Zone> {
        let set = self.zone_sets.get(&name.0)?;
        let applies = self.allows(Permission::ApplyZoneSet(set), set.enabled);
        set.zones.iter().find(|zone| applies && zone.id == name.1)
    }

    /// Takes an answer to a request for a zone.
    pub(crate) fn zone_answered(&mut self, answer: &Answer) {
        let mut asked = self.requests.zones.iter_mut();
        let Some(request) = asked.find(|request| request.id == answer.request_id) else {
            return;
        };
        let status = request.status;
        let grants = status.is_open() || status == RequestStatus::Granted;
        match answer.grant {
            Grant::Granted if grants => {
                request.status = RequestStatus::Granted;
                request.lease = answer.lease;
                let (id, zone) = (request.id.clone(), request.zone.clone());
                let mut requests = std::mem::take(&mut self.requests.zones);
                requests.retain(|other| {
                    let stays = other.id == id || other.zone != zone;
                    self.allows(Permission::KeepAlternative, stays)
                });
                self.requests.zones = requests;
            }
            Grant::Queued if status.is_open() => request.status = RequestStatus::Queued,
            Grant::Rejected if status.is_open() => self.withdraw_zone(&answer.request_id),
            Grant::Revoked | Grant::Rejected if status == RequestStatus::Granted => {
                self.lose_zone(&answer.request_id, RequestStatus::Revoked);
            }
            _ => {}
        }
    }

    fn withdraw_zone(&mut self, id: &str) {
        self.requests.zones.retain(|request| request.id != id);
        self.asks_later();
    }

    /// What was granted is lost: before the zone the request ends (ZREQ-11, ZREQ-12), inside it stays (ZREQ-13).
    fn lose_zone(&mut self, id: &str, status: RequestStatus) {
        let Some(at) = self.requests.zones.iter().position(|request| request.id == id) else {
            return;
        };
        if !self.allows(Permission::HeedZoneLoss(&self.requests.zones[at], status), true) {
            return;
        }
        let request = &mut self.requests.zones[at];
        request.status = status;
        request.lease = None;
        let (inside, zone) = (request.inside, request.zone.clone());
        if !inside {
            let moment = self.moment();
            if self.motion.is_moving() {
                self.motion.halt(moment);
            }
            if status == RequestStatus::Expired && self.allows(Permission::ShowExpired, true) {
                self.flush();
            }
            self.withdraw_zone(id);
            return;
        }
        let loss = self.loss_of(&zone);
        let error = ActiveError {
            error_type: self.loss_name(loss),
            fatal: false,
            references: vec![("zoneId".into(), zone.1.clone())],
            description: "what was granted for the zone it is in is lost".into(),
            life: Life::WhileInZone,
        };
        self.raise(Cause::Zone, error);
        self.requests.lost.retain(|lost| lost.zone != zone);
        self.requests.lost.push(LostRelease { zone, loss });
        self.asks_later();
    }

    /// The errorType of a loss that ends so.
    fn loss_name(&self, loss: ReleaseLoss) -> String {
        let names = &self.config.errors;
        match loss {
            ReleaseLoss::Stop => names.release_lost.clone(),
            _ => names.release_loss.clone(),
        }
    }

    /// What follows when the release of a zone is lost: STOP where it does not say (ZONE-13). A way is asked for anew.
    fn loss_of(&self, name: &ZoneName) -> ReleaseLoss {
        let zone = self.zone_of(name);
        match zone.map(|zone| &zone.kind) {
            Some(ZoneKind::Release(Some(loss))) => *loss,
            Some(ZoneKind::CoordinatedReplanning) => ReleaseLoss::Anew,
            _ if self.allows(Permission::StopUnsaid, true) => ReleaseLoss::Stop,
            _ => ReleaseLoss::Continue,
        }
    }

    /// Looks after its requests for zones; whether anything has changed.
    pub(crate) fn tend_zone_requests(&mut self) -> bool {
        let requests = &self.requests;
        let has_any = !(requests.zones.is_empty() && requests.awaited.is_empty() && requests.lost.is_empty());
        if !has_any && !self.holds.access {
            return false;
        }
        let before = self.requests.zones.clone();
        self.end_zone_requests();
        self.end_zone_leases();
        let settled = self.settle_lost_releases();
        self.ask_for_zones();
        settled || before != self.requests.zones
    }

    /// Whether it is in a zone of this name.
    fn is_in_zone(&self, name: &ZoneName) -> bool {
        let mut inside = self.heeding.inside.iter();
        inside.any(|(set, zone)| *set == name.0 && zone.id == name.1)
    }

    /// Takes back what is of no use any more: the zone is left, or not in force, or there is no order that leads there.
    fn end_zone_requests(&mut self) {
        let under_way = !self.order.cancelled && self.order.nodes.iter().any(|stop| stop.node.released);
        if !under_way {
            self.requests.awaited.clear();
        }
        let kept = self.requests.zones.iter().cloned().filter_map(|mut request| {
            let is_in = self.is_in_zone(&request.zone);
            let left = request.inside && !is_in;
            request.inside |= is_in && request.status == RequestStatus::Granted;
            let in_force = self.zone_of(&request.zone).is_some();
            let commanded = self.mode.takes_orders() && !self.order.cancelled;
            let lost = self.requests.lost.iter().any(|lost| lost.zone == request.zone);
            let needed = in_force && commanded && !left && (request.inside || under_way || lost && is_in);
            self.allows(Permission::KeepZoneRequest(&request), needed)
                .then_some(request)
        });
        self.requests.zones = kept.collect();
    }

    /// Leases that have run out.
    fn end_zone_leases(&mut self) {
        let moment = self.moment();
        let over = self.requests.zones.iter().filter(|request| {
            let over = request.lease.is_some_and(|end| end <= moment) && request.status == RequestStatus::Granted;
            over && self.allows(Permission::EndLease, true)
        });
        let over: Vec<String> = over.map(|request| request.id.clone()).collect();
        for id in &over {
            self.lose_zone(id, RequestStatus::Expired);
        }
    }

    /// Holds the vehicle where it has lost a release that it must not go on without, until it is out or granted again
    /// (ZONE-11, ZONE-12); whether something has changed.
    fn settle_lost_releases(&mut self) -> bool {
        let is_over = |lost: &LostRelease| {
            let mut requests = self.requests.of_zone(&lost.zone.0, &lost.zone.1);
            !self.is_in_zone(&lost.zone) || requests.any(|request| request.status == RequestStatus::Granted)
        };
        let (over, lost): (Vec<LostRelease>, Vec<LostRelease>) = self.requests.lost.iter().cloned().partition(is_over);
        for one in &over {
            let names = &self.config.errors;
            for name in [&names.release_lost, &names.release_loss] {
                self.errors.left_zone(name, &one.zone.1);
            }
        }
        let stops = |lost: &LostRelease| self.allows(Permission::StayWithoutRelease(lost.loss), lost.loss.stops());
        let holds = lost.iter().any(stops);
        self.requests.lost = lost;
        let changed = holds != self.holds.access;
        if changed {
            self.set_holds(|now| now.access = holds);
        }
        changed || !over.is_empty()
    }

    /// Asks for the zones it waits for, and for those in which it has lost its release or its way (ZREQ-01, ZREQ-04).
    fn ask_for_zones(&mut self) {
        if !self.asks_now() {
            return;
        }
        let stopped = self.requests.lost.iter().filter(|lost| lost.loss.stops());
        let wanted: Vec<ZoneName> = stopped
            .map(|lost| lost.zone.clone())
            .chain(self.requests.awaited.iter().cloned())
            .collect();
        for name in wanted {
            let ways = self.wanted_of(&name);
            if ways.is_empty() || !self.allows(Permission::AskForZone, true) {
                continue;
            }
            for way in ways {
                let id = self.new_request_id();
                self.requests.zones.push(ZoneRequest {
                    id,
                    zone: name.clone(),
                    status: RequestStatus::Requested,
                    lease: None,
                    inside: false,
                    way,
                });
            }
        }
    }

    /// What it asks for about a zone: a way each, or access.
    fn wanted_of(&self, name: &ZoneName) -> Vec<Option<Through>> {
        let Some(zone) = self.zone_of(name) else {
            return Vec::new();
        };
        if zone.kind == ZoneKind::CoordinatedReplanning {
            let ways = self.ways_to_ask_for(name, zone);
            return ways.into_iter().map(Some).collect();
        }
        let mut requests = self.requests.of_zone(&name.0, &name.1);
        match requests.any(|request| !request.is_lost()) {
            true => Vec::new(),
            false => vec![None],
        }
    }

    /// zoneRequests (ZREQ-06, ZREQ-07).
    pub(crate) fn zone_requests(&self) -> Value {
        let all = self.requests.zones.iter();
        all.filter_map(|request| {
            let mut picture = json!({
                "requestId": request.id,
                "requestType": if request.way.is_some() { "REPLANNING" } else { "ACCESS" },
                "zoneId": request.zone.1,
                "zoneSetId": request.zone.0,
                "requestStatus": request.status.literal(),
            });
            if let Some(way) = &request.way {
                picture["trajectory"] = way.sent.clone();
            }
            self.said(Part::ZoneRequest(request), picture)
        })
        .collect()
    }
}
