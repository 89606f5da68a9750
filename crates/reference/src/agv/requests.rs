//! Requests: what the vehicle asks fleet control for before it does it, and what becomes of that (sections 6.9 and
//! 6.6.10).
//!
//! A corridor that has to be released is asked for on the edge that comes next, once something stands there. The vehicle
//! waits on its trajectory; what was refused or lost before it was used is asked for anew a little later, under another
//! id. A release that is lost on the way round ends in what the corridor says (CORR-19); one that was lost comes back
//! under another request only (the ruling of REQ-16), and an answer to no request of its own is left aside (that of
//! REQ-17).

use std::f64::consts::PI;
use std::time::Duration;

use serde_json::{Value, json};

use super::Agv;
use super::hook_points::{Part, Permission};
use super::motion::{self, Facing};
use super::order_message::{Edge, Loss};
use super::path::ON_PATH;
use super::progress::ALIGNED;
use super::read::{Defect, Fields};
use super::zone_requests::{LostRelease, ZoneName, ZoneRequest};
use super::zones::ZoneKind;
use tck_base::clock::Moment;
use tck_base::nurbs::Path;

/// At most this many answers of one message are read.
const MAX_ANSWERS: usize = 100;

/// Time from a refusal, or a loss, to the next request.
const RETRY: Duration = Duration::from_millis(500);

/// requestStatus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RequestStatus {
    Requested,
    Queued,
    Granted,
    Revoked,
    Expired,
}

impl RequestStatus {
    /// The word for it.
    pub(crate) fn literal(self) -> &'static str {
        match self {
            Self::Requested => "REQUESTED",
            Self::Queued => "QUEUED",
            Self::Granted => "GRANTED",
            Self::Revoked => "REVOKED",
            Self::Expired => "EXPIRED",
        }
    }

    /// Whether it waits for a decision.
    pub(crate) fn is_open(self) -> bool {
        matches!(self, Self::Requested | Self::Queued)
    }
}

/// grantType.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Grant {
    Granted,
    Queued,
    Revoked,
    Rejected,
}

/// One answer of a responses message.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Answer {
    /// The request it is about.
    pub(crate) request_id: String,
    pub(crate) grant: Grant,
    /// When the grant ends.
    pub(crate) lease: Option<Moment>,
}

/// A corridor that was asked for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EdgeRequest {
    pub(crate) id: String,
    pub(crate) edge: String,
    pub(crate) sequence_id: u32,
    pub(crate) status: RequestStatus,
    /// When the grant ends.
    pub(crate) lease: Option<Moment>,
    /// The way it takes through the corridor, once it does.
    pub(crate) way: Option<Path>,
}

/// A way back to the trajectory.
#[derive(Clone, Debug)]
struct Back {
    path: Path,
    backwards: bool,
}

/// What the vehicle has asked for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Requests {
    pub(crate) edges: Vec<EdgeRequest>,
    /// Counts requests, also over a restart.
    pub(crate) count: u64,
    /// Nothing is asked for before this.
    retry_at: Option<Moment>,
    back: Option<Back>,
    pub(crate) zones: Vec<ZoneRequest>,
    /// The zones before whose border it waits, or stops next.
    pub(crate) awaited: Vec<ZoneName>,
    /// The zones that it is in, and whose release it has lost.
    pub(crate) lost: Vec<LostRelease>,
}

impl Requests {
    /// When something happens to a request by itself.
    pub(crate) fn next_end(&self, now: Moment) -> Option<Moment> {
        let leases = self.edges.iter().filter_map(|request| request.lease);
        let of_zones = self.zones.iter().filter_map(|request| request.lease);
        leases
            .chain(of_zones)
            .chain(self.retry_at)
            .filter(|end| *end > now)
            .min()
    }

    /// Forgets everything but the number of the last request.
    pub(crate) fn clear(&mut self) {
        *self = Self {
            count: self.count,
            ..Self::default()
        };
    }

    /// The requests for a zone.
    pub(crate) fn of_zone(&self, set: &str, zone: &str) -> impl Iterator<Item = &ZoneRequest> {
        self.zones
            .iter()
            .filter(move |request| request.zone.0 == set && request.zone.1 == zone)
    }

    /// The request for the corridor of an edge.
    pub(crate) fn of_edge(&self, sequence_id: u32) -> Option<&EdgeRequest> {
        self.edges.iter().find(|request| request.sequence_id == sequence_id)
    }

    /// The way it takes through the corridor of an edge.
    pub(crate) fn way(&self, sequence_id: u32) -> Option<&Path> {
        self.of_edge(sequence_id)?.way.as_ref()
    }
}

impl Agv {
    /// Takes the answers of fleet control.
    pub(crate) fn responses_received(&mut self, payload: &[u8]) {
        if payload.len() > self.config.max_message {
            return;
        }
        let Ok(message) = serde_json::from_slice::<Value>(payload) else {
            return;
        };
        let message = self.understood("responses", message);
        let Ok(entries) = Fields::open(&message, "").and_then(|fields| fields.objects("responses")) else {
            return;
        };
        for entry in entries.iter().take(MAX_ANSWERS) {
            // What cannot be read grants nothing.
            if let Ok(mut answer) = self.answer(entry) {
                self.hears_answer(&mut answer);
                self.answered(&answer);
                self.zone_answered(&answer);
            }
        }
    }

    fn answer(&self, fields: &Fields<'_>) -> Result<Answer, Defect> {
        let grants = ["GRANTED", "QUEUED", "REVOKED", "REJECTED"];
        let grant = match fields.literal("grantType", &grants)? {
            0 => Grant::Granted,
            1 => Grant::Queued,
            2 => Grant::Revoked,
            _ => Grant::Rejected,
        };
        let lease = fields.optional("leaseExpiry", |fields, key| {
            let defect = |reason| Defect {
                path: fields.at(key),
                reason,
            };
            let text = fields.text(key)?;
            text.parse::<jiff::Timestamp>().map_err(|_| defect("is no time"))
        })?;
        Ok(Answer {
            request_id: fields.id("requestId")?,
            grant,
            lease: lease.filter(|_| grant == Grant::Granted).map(|end| self.moment_of(end)),
        })
    }

    /// The moment at which a clock shows this time; now where that is over.
    fn moment_of(&self, time: jiff::Timestamp) -> Moment {
        let ahead = time.duration_since(self.now.utc);
        self.moment()
            + Duration::try_from(ahead)
                .unwrap_or_default()
                .min(Duration::from_secs(1_000_000))
    }

    fn answered(&mut self, answer: &Answer) {
        let mut asked = self.requests.edges.iter_mut();
        let Some(request) = asked.find(|request| request.id == answer.request_id) else {
            return;
        };
        let status = request.status;
        let grants = status.is_open() || status == RequestStatus::Granted;
        match answer.grant {
            Grant::Granted if grants => {
                request.status = RequestStatus::Granted;
                request.lease = answer.lease;
            }
            Grant::Queued if status.is_open() => request.status = RequestStatus::Queued,
            Grant::Rejected if status.is_open() => self.withdraw(&answer.request_id),
            Grant::Revoked | Grant::Rejected if status == RequestStatus::Granted => {
                self.lose(&answer.request_id, RequestStatus::Revoked);
            }
            _ => {}
        }
    }

    /// Takes a request back; the next one comes a little later.
    fn withdraw(&mut self, id: &str) {
        self.requests.edges.retain(|request| request.id != id);
        self.asks_later();
    }

    /// The next request comes a little later.
    pub(crate) fn asks_later(&mut self) {
        self.requests.retry_at = Some(self.moment() + RETRY);
    }

    /// Whether it asks for anything now.
    pub(crate) fn asks_now(&self) -> bool {
        let waits = self.requests.retry_at.is_some() || self.awaited_mode.is_some();
        let commanded = self.allows(Permission::AskForAnything, self.mode.takes_orders());
        !waits && commanded && self.order.cancel.is_none() && !self.order.cancelled
    }

    /// Looks after its requests; whether anything has changed.
    pub(crate) fn tend_requests(&mut self) -> bool {
        let moment = self.moment();
        self.requests.retry_at = self.requests.retry_at.filter(|at| *at > moment);
        self.end_leases()
            | self.end_requests()
            | self.come_back()
            | self.ask_for_corridors()
            | self.tend_zone_requests()
    }

    /// Leases that have run out.
    fn end_leases(&mut self) -> bool {
        let moment = self.moment();
        let is_over = |request: &&EdgeRequest| {
            let over = request.lease.is_some_and(|end| end <= moment);
            let over = over && request.status == RequestStatus::Granted;
            over && self.allows(Permission::EndLease, true)
        };
        let over: Vec<String> = self
            .requests
            .edges
            .iter()
            .filter(is_over)
            .map(|one| one.id.clone())
            .collect();
        for id in &over {
            self.lose(id, RequestStatus::Expired);
        }
        !over.is_empty()
    }

    /// A grant is lost: the corridor says what follows where it is in use (CORR-19), else the request ends.
    fn lose(&mut self, id: &str, status: RequestStatus) {
        let Some(at) = self.requests.edges.iter().position(|request| request.id == id) else {
            return;
        };
        if !self.allows(Permission::HeedLoss(&self.requests.edges[at]), true) {
            return;
        }
        let request = &mut self.requests.edges[at];
        request.status = status;
        request.lease = None;
        let way = request.way.clone();
        let sequence_id = request.sequence_id;
        let Some(way) = way else {
            if status == RequestStatus::Expired && self.allows(Permission::ShowExpired, true) {
                self.flush();
            }
            self.withdraw(id);
            return;
        };
        let edge = self.order.edges.iter().find(|edge| edge.sequence_id == sequence_id);
        let loss = edge
            .and_then(|edge| self.corridor(edge))
            .map_or(Loss::Stop, |corridor| corridor.loss);
        let moment = self.moment();
        match loss {
            Loss::Stop => self.set_holds(|holds| holds.release = true),
            Loss::Return => {
                self.motion.halt(moment);
                let pose = self.motion.pose(moment);
                let made = way.beside(pose.x, pose.y).map_or(0.0, |beside| beside.made);
                let mut points: Vec<(f64, f64)> = way.first(made).points().collect();
                points.reverse();
                if !self.allows(Permission::ReturnAsItCame, true) {
                    points = around(&points);
                }
                let back = Back {
                    path: Path::through(points),
                    backwards: true,
                };
                self.requests.back = Some(back);
            }
        }
    }

    /// Requests that are of no use any more: their edge is left, or gone, or nothing stands there.
    fn end_requests(&mut self) -> bool {
        let is_of_use = |request: &&EdgeRequest| {
            let edge = self
                .order
                .edges
                .iter()
                .find(|edge| edge.sequence_id == request.sequence_id);
            let needed = edge.is_some_and(|edge| {
                let used = request.way.is_some() || self.obstacles.contains(&edge.id);
                edge.id == request.edge && edge.released && used
            });
            self.allows(Permission::KeepRequest, needed)
        };
        let gone = |request: &&EdgeRequest| !is_of_use(request);
        let gone: Vec<String> = self
            .requests
            .edges
            .iter()
            .filter(gone)
            .map(|one| one.id.clone())
            .collect();
        self.requests.edges.retain(|request| !gone.contains(&request.id));
        let is_lost = |request: &EdgeRequest| request.way.is_some() && request.status != RequestStatus::Granted;
        if !self.requests.edges.iter().any(is_lost) && self.holds.release {
            self.set_holds(|holds| holds.release = false);
        }
        if self.requests.edges.iter().all(|request| request.way.is_none()) {
            self.requests.back = None;
        }
        !gone.is_empty()
    }

    /// Nothing stands on the edge any more: the vehicle goes back to its trajectory.
    fn come_back(&mut self) -> bool {
        let Some(edge) = self.order.edge_ahead() else {
            return false;
        };
        let granted = |request: &EdgeRequest| request.way.is_some() && request.status == RequestStatus::Granted;
        let uses = self.requests.of_edge(edge.sequence_id).is_some_and(granted);
        if !uses || self.obstacles.contains(&edge.id) || self.requests.back.is_some() {
            return false;
        }
        let Some(path) = edge.trajectory.as_ref().map(|trajectory| trajectory.path.clone()) else {
            return false;
        };
        let moment = self.moment();
        let pose = self.motion.pose(moment);
        let Some(beside) = path.beside(pose.x, pose.y) else {
            return false;
        };
        let onto = path.at((beside.made + 2.0 * beside.distance).min(path.length()));
        self.motion.halt(moment);
        let points = onto.map(|spot| (spot.x, spot.y));
        self.requests.back = Some(Back {
            path: Path::through([(pose.x, pose.y)].into_iter().chain(points)),
            backwards: false,
        });
        true
    }

    /// Drives back to its trajectory, if it is to; whether it does something for that.
    pub(crate) fn drive_back(&mut self) -> bool {
        let Some(back) = self.requests.back.clone() else {
            return false;
        };
        let moment = self.moment();
        let pose = self.motion.pose(moment);
        let made = back.path.beside(pose.x, pose.y).map_or(0.0, |beside| beside.made);
        let rest = back.path.rest(made);
        let Some(begin) = rest.at(0.0).filter(|_| rest.length() > ON_PATH / 4.0) else {
            self.requests.back = None;
            let sequence_id = self.order.edge_ahead().map(|edge| edge.sequence_id);
            self.requests
                .edges
                .retain(|request| Some(request.sequence_id) != sequence_id);
            self.requests.retry_at = Some(moment + RETRY);
            return true;
        };
        let turned = if back.backwards { PI } else { 0.0 };
        let theta = motion::wrapped(begin.heading + turned);
        let edge = self.order.edge_ahead().cloned();
        if motion::wrapped(theta - pose.theta).abs() > ALIGNED {
            self.turn_to(theta, edge.as_ref());
            return true;
        }
        let permitted = edge.and_then(|edge| edge.max_speed).unwrap_or(self.config.speed);
        let speed = permitted.min(self.config.speed);
        self.motion.follow(moment, rest, speed, Facing::Along(turned), false);
        true
    }

    /// Something has come onto an edge: where its corridor has to be released, or its way was, the vehicle stops and plans anew.
    pub(crate) fn sees_obstacle(&mut self, edge_id: &str) {
        let on_edge = self.order.entered && !self.motion.reached && self.requests.back.is_none();
        let edge = self.order.edge_ahead().filter(|edge| on_edge && edge.id == edge_id);
        let new = edge.is_some_and(|edge| self.has_to_ask(edge) && self.requests.way(edge.sequence_id).is_none());
        // It goes on only by a way that was granted, which is looked for where it stands.
        let in_zone = edge.is_some_and(|edge| self.config.plans && self.is_blocked(edge))
            && self
                .heeding
                .inside
                .iter()
                .any(|(_, zone)| zone.kind == ZoneKind::CoordinatedReplanning);
        if new || in_zone {
            let moment = self.moment();
            self.motion.halt(moment);
        }
    }

    /// Whether the corridor of an edge has to be released before it is used.
    pub(crate) fn has_to_ask(&self, edge: &Edge) -> bool {
        let corridor = self.corridor(edge).filter(|_| self.config.uses("releaseRequired"));
        corridor.is_some_and(|corridor| corridor.release_required)
    }

    /// Whether the corridor of an edge may be used (CORR-10, CORR-15).
    pub(crate) fn may_leave(&self, edge: &Edge) -> bool {
        let request = self.requests.of_edge(edge.sequence_id);
        let granted = request.is_some_and(|request| request.status == RequestStatus::Granted);
        self.allows(Permission::UseCorridor(edge), granted || !self.has_to_ask(edge))
    }

    /// Asks for corridors in which it could drive round something (CORR-11, CORR-12).
    fn ask_for_corridors(&mut self) -> bool {
        if !self.asks_now() {
            return false;
        }
        let ahead = self.order.edge_ahead().map(|edge| edge.sequence_id);
        let wanted = |edge: &&Edge| {
            let blocks = self.obstacles.contains(&edge.id) && edge.trajectory.is_some();
            let new = self.requests.of_edge(edge.sequence_id).is_none();
            let usual = edge.released && Some(edge.sequence_id) == ahead && self.has_to_ask(edge);
            let can = blocks && self.room_beside(edge).is_some();
            new && can && self.allows(Permission::Ask(edge), usual)
        };
        let wanted = self.order.edges.iter().filter(wanted);
        let wanted: Vec<(String, u32)> = wanted.map(|edge| (edge.id.clone(), edge.sequence_id)).collect();
        for (edge, sequence_id) in &wanted {
            let id = self.new_request_id();
            self.requests.edges.push(EdgeRequest {
                id,
                edge: edge.clone(),
                sequence_id: *sequence_id,
                status: RequestStatus::Requested,
                lease: None,
                way: None,
            });
        }
        !wanted.is_empty()
    }

    /// An id no request of this vehicle had before (ZREQ-04).
    pub(crate) fn new_request_id(&mut self) -> String {
        if self.allows(Permission::CountRequest, true) {
            self.requests.count += 1;
        }
        format!("request-{}", self.requests.count)
    }

    /// Sets out on a way through a corridor that it was granted.
    pub(crate) fn takes_way(&mut self, edge: &Edge, way: &Path) {
        let uses = self.obstacles.contains(&edge.id);
        let mut asked = self.requests.edges.iter_mut();
        let request = asked.find(|request| request.sequence_id == edge.sequence_id && request.way.is_none());
        if let Some(request) = request.filter(|request| uses && request.status == RequestStatus::Granted) {
            request.way = Some(way.clone());
        }
    }

    /// edgeRequests (CORR-12).
    pub(crate) fn edge_requests(&self) -> Value {
        let all = self.requests.edges.iter();
        all.filter_map(|request| {
            let picture = json!({
                "requestId": request.id,
                "requestType": "CORRIDOR",
                "edgeId": request.edge,
                "sequenceId": request.sequence_id,
                "requestStatus": request.status.literal(),
            });
            self.said(Part::EdgeRequest(request), picture)
        })
        .collect()
    }
}

/// Another way between the ends of one: a metre to the left of the straight line.
fn around(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let (Some(from), Some(to)) = (points.first(), points.last()) else {
        return Vec::new();
    };
    let heading = (to.1 - from.1).atan2(to.0 - from.0);
    let middle = (f64::midpoint(from.0, to.0), f64::midpoint(from.1, to.1));
    vec![*from, (middle.0 - heading.sin(), middle.1 + heading.cos()), *to]
}
