//! Requests of vehicles, and how they are answered: who has what, who waits for it, and how long it is given (sections 6.4.3,
//! 6.6.10 and 6.9).
//!
//! A zone is given to one vehicle at a time, and to the one that asked first. A grant is lent for a time and prolonged while the
//! vehicle shows it (REQ-11). What was taken back counts as given until the vehicle shows that it has noticed (ZREQ-17). An
//! answer that was lost is said once more.

use std::time::Duration;

use serde_json::{Value, json};

use super::Site;
use super::hooks::{Permission, Span};
use super::seen::RequestSeen;
use super::vehicle::{Presence, Vehicle};
use tck_base::clock::Moment;

/// More requests than this of one vehicle are not answered.
const MAX_ASKED: usize = 100;
/// More requests than this are not kept.
const MAX_CLAIMS: usize = 1_000;

/// What a vehicle asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Wish {
    /// Access to a zone, or a way through it.
    Zone {
        set_id: String,
        zone_id: String,
        kind: String,
        /// It says which way it would take.
        way: bool,
    },
    /// The corridor of an edge of its order.
    Corridor { edge_id: String, sequence: u64 },
}

/// What master control says to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Grant {
    Granted,
    Queued,
    Rejected,
    Revoked,
}

impl Grant {
    fn literal(self) -> &'static str {
        match self {
            Self::Granted => "GRANTED",
            Self::Queued => "QUEUED",
            Self::Rejected => "REJECTED",
            Self::Revoked => "REVOKED",
        }
    }
}

/// A request of a vehicle, and what became of it.
#[derive(Clone, Debug)]
pub(crate) struct Claim {
    /// The vehicle.
    pub(crate) whose: String,
    /// requestId.
    pub(crate) id: String,
    pub(crate) wish: Wish,
    /// requestStatus in the last state.
    pub(crate) shown: String,
    /// What was said last.
    pub(crate) said: Option<Grant>,
    pub(crate) said_at: Moment,
    /// How often it was said once more.
    repeats: u32,
    /// For how long it was given.
    lease: Option<Duration>,
    /// The vehicle has noticed that it has it no more.
    lost: bool,
}

impl Claim {
    /// Whether the vehicle has what it asked for, or may believe so.
    pub(crate) fn holds(&self) -> bool {
        matches!(self.said, Some(Grant::Granted | Grant::Revoked)) && !self.lost
    }

    /// Whether it waits to be given what it asked for.
    fn waits(&self) -> bool {
        self.said == Some(Grant::Queued) && !self.lost
    }

    /// Whether the vehicle does not act as it was answered, as far as that can be seen.
    fn is_unheard(&self) -> bool {
        let asks = matches!(self.shown.as_str(), "REQUESTED" | "QUEUED");
        match self.said {
            Some(Grant::Granted | Grant::Rejected) => asks,
            Some(Grant::Revoked) => self.shown == "GRANTED",
            _ => false,
        }
    }
}

/// How requests are answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Policy {
    /// What is free is given.
    #[default]
    AsUsual,
    /// Everybody waits.
    Queue,
    /// Nobody is given anything.
    Reject,
    /// What is free is given, and never prolonged.
    Once,
}

/// The requests of all vehicles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Claims {
    /// In the order in which they came.
    pub(crate) all: Vec<Claim>,
    pub(crate) policy: Policy,
    /// Something may have become free, so that others have to be looked after.
    pub(super) changed: bool,
}

impl Claims {
    /// Takes down what a vehicle asks for now, and forgets what it asks for no more.
    fn note(&mut self, whose: &str, asked: &[RequestSeen]) {
        let before = self.all.len();
        let kept = |claim: &Claim| claim.whose != whose || asked.iter().any(|one| one.request_id == claim.id);
        self.all.retain(kept);
        self.changed |= self.all.len() < before;
        for one in asked {
            let known = self
                .all
                .iter_mut()
                .find(|claim| claim.whose == whose && claim.id == one.request_id);
            let over = matches!(one.request_status.as_str(), "REVOKED" | "EXPIRED");
            if let Some(claim) = known {
                one.request_status.clone_into(&mut claim.shown);
                self.changed |= over && !claim.lost;
                claim.lost |= over;
            } else if self.all.len() < MAX_CLAIMS {
                // What a vehicle has from before a restart it keeps.
                let had = one.request_status == "GRANTED";
                self.all.push(Claim {
                    whose: whose.to_owned(),
                    id: one.request_id.clone(),
                    wish: one.wish(),
                    shown: one.request_status.clone(),
                    said: had.then_some(Grant::Granted),
                    said_at: Moment::START,
                    repeats: 0,
                    lease: None,
                    lost: over,
                });
            }
        }
    }
}

impl Vehicle {
    /// Its name among the vehicles of the fleet.
    pub(crate) fn name(&self) -> String {
        format!("{}/{}", self.config.manufacturer, self.config.serial_number)
    }
}

impl Site {
    /// Answers what a vehicle asks for.
    pub(super) fn watch_requests(&mut self, vehicle: &mut Vehicle) {
        let Some(state) = vehicle.state.as_ref().filter(|_| vehicle.config.has("requests")) else {
            return;
        };
        let asked: Vec<RequestSeen> = state.requests().take(MAX_ASKED).cloned().collect();
        let name = vehicle.name();
        self.claims.note(&name, &asked);
        if vehicle.presence == Presence::Away {
            // Nobody waits for the turn of one who is gone.
            for claim in self
                .claims
                .all
                .iter_mut()
                .filter(|claim| claim.whose == name && claim.waits())
            {
                claim.said = None;
            }
            return;
        }
        if !self.reachable(vehicle) {
            return;
        }
        let own = |claims: &[Claim]| -> Vec<String> {
            let own = claims.iter().filter(|claim| claim.whose == name);
            own.map(|claim| claim.id.clone()).collect()
        };
        let mut answers = Vec::new();
        for id in own(&self.claims.all) {
            let place = |claims: &[Claim]| claims.iter().position(|claim| claim.whose == name && claim.id == id);
            let Some(index) = place(&self.claims.all) else { continue };
            if let Some(grant) = self.due(vehicle, index) {
                answers.extend(self.said(vehicle, index, grant));
            }
        }
        self.answer(vehicle, answers);
    }

    /// Publishes answers, each to one request (REQ-04).
    fn answer(&mut self, vehicle: &mut Vehicle, answers: Vec<Value>) {
        if !answers.is_empty() {
            self.publish(vehicle, "responses", &json!({ "responses": answers }));
        }
    }

    /// What is to be said to a request now, if anything.
    fn due(&mut self, vehicle: &mut Vehicle, index: usize) -> Option<Grant> {
        let claim = self.claims.all[index].clone();
        if claim.lost {
            return None;
        }
        let usual = Some(self.decided(vehicle, &claim, index));
        let decision = self.decides(vehicle, &claim, usual);
        match claim.said {
            None => decision,
            Some(Grant::Queued) => decision.filter(|grant| *grant != Grant::Queued),
            Some(said) => {
                if said == Grant::Granted && self.is_prolonged(vehicle, &claim) {
                    return Some(Grant::Granted);
                }
                if !claim.is_unheard() || claim.repeats >= self.config.resend_limit {
                    return None;
                }
                let due = self.lost_after(vehicle, claim.said_at);
                if due > self.now.moment {
                    vehicle.at(due);
                    return None;
                }
                self.claims.all[index].repeats += 1;
                Some(said)
            }
        }
    }

    /// Whether a grant that is lent is lent for longer now: half of its time is over.
    fn is_prolonged(&self, vehicle: &mut Vehicle, claim: &Claim) -> bool {
        let usual = self.claims.policy != Policy::Once && claim.shown == "GRANTED";
        if !self.allows(vehicle, Permission::Prolong, usual) {
            return false;
        }
        let due = claim.said_at + claim.lease.unwrap_or_default() / 2;
        if due > self.now.moment {
            vehicle.at(due);
        }
        due <= self.now.moment && self.lease(vehicle).is_some()
    }

    /// For how long something is given.
    fn lease(&self, vehicle: &Vehicle) -> Option<Duration> {
        let usual = self.config.lease.unwrap_or_default();
        Some(self.lasts(vehicle, Span::Lease, usual)).filter(|lease| !lease.is_zero())
    }

    /// What this master control makes of a request that has no final answer yet.
    fn decided(&self, vehicle: &Vehicle, claim: &Claim, index: usize) -> Grant {
        let usual = match &claim.wish {
            Wish::Corridor { edge_id, sequence } => corridor_of(vehicle, edge_id, *sequence),
            Wish::Zone { .. } => self.zone_given(vehicle, claim, index),
        };
        match self.claims.policy {
            Policy::Queue if usual == Grant::Granted => Grant::Queued,
            Policy::Reject => Grant::Rejected,
            _ => usual,
        }
    }

    /// Whether the vehicle may enter a zone: one at a time.
    fn zone_given(&self, vehicle: &Vehicle, claim: &Claim, index: usize) -> Grant {
        let Wish::Zone {
            set_id,
            zone_id,
            kind,
            way,
        } = &claim.wish
        else {
            return Grant::Rejected;
        };
        let fits = match self.zone_type(set_id, zone_id) {
            Some("RELEASE") => kind == "ACCESS",
            Some("COORDINATED_REPLANNING") => kind == "REPLANNING" && *way,
            _ => false,
        };
        if !fits {
            return Grant::Rejected;
        }
        let others = self.claims.all.iter().enumerate();
        let mut others = others.filter(|(_, other)| other.whose != claim.whose && self.same_zone(claim, other));
        let taken = others.any(|(at, other)| {
            let first = other.waits() && at < index;
            first || self.allows(vehicle, Permission::Occupied(other), other.holds())
        });
        if taken { Grant::Queued } else { Grant::Granted }
    }

    /// Whether two requests are about the same zone of the floor, whatever set it stands in.
    pub(crate) fn same_zone(&self, one: &Claim, other: &Claim) -> bool {
        let (
            Wish::Zone { set_id, zone_id, .. },
            Wish::Zone {
                set_id: other_set,
                zone_id: other_zone,
                ..
            },
        ) = (&one.wish, &other.wish)
        else {
            return false;
        };
        zone_id == other_zone && self.map_of(set_id) == self.map_of(other_set)
    }

    /// Notes that something was said, and words it.
    fn said(&mut self, vehicle: &mut Vehicle, index: usize, grant: Grant) -> Option<Value> {
        let lease = self.lease(vehicle).filter(|_| grant == Grant::Granted);
        let now = self.now;
        let claim = self.claims.all.get_mut(index)?;
        claim.repeats = if claim.said == Some(grant) { claim.repeats } else { 0 };
        claim.said = Some(grant);
        claim.said_at = now.moment;
        claim.lease = lease;
        let mut answer = json!({ "requestId": claim.id, "grantType": grant.literal() });
        if let Some(lease) = lease {
            let until = now.utc.checked_add(lease).unwrap_or(now.utc);
            answer["leaseExpiry"] = json!(format!("{until:.3}"));
            vehicle.at(now.moment + lease / 2);
        }
        vehicle.at(self.lost_after(vehicle, now.moment));
        Some(answer)
    }

    /// Takes back what a vehicle was granted: that of a requestId, or all of it.
    pub(super) fn revoke(&mut self, vehicle: &mut Vehicle, request_id: Option<&str>) {
        let name = vehicle.name();
        let meant = |claim: &Claim| {
            let wanted = request_id.is_none_or(|id| id == claim.id);
            claim.whose == name && wanted && claim.said == Some(Grant::Granted) && !claim.lost
        };
        let all = self.claims.all.iter().enumerate();
        let meant: Vec<usize> = all.filter(|(_, claim)| meant(claim)).map(|(index, _)| index).collect();
        let mut answers = Vec::new();
        for index in meant {
            answers.extend(self.said(vehicle, index, Grant::Revoked));
        }
        self.answer(vehicle, answers);
    }

    /// Answers requests otherwise from now on.
    pub(super) fn answer_otherwise(&mut self, how: &str) {
        self.claims.policy = match how {
            "queue" => Policy::Queue,
            "reject" => Policy::Reject,
            "once" => Policy::Once,
            _ => Policy::AsUsual,
        };
        self.claims.changed = true;
    }
}

/// Whether the vehicle may use the corridor of an edge: only in its base (CORR-22).
fn corridor_of(vehicle: &Vehicle, edge_id: &str, sequence: u64) -> Grant {
    let Some(running) = vehicle.running.as_ref().filter(|_| vehicle.cancel.is_none()) else {
        return Grant::Rejected;
    };
    let place = usize::try_from(sequence / 2).unwrap_or(usize::MAX);
    match running.legs.get(place).filter(|leg| leg.id == edge_id) {
        Some(_) if place + 1 < running.released => Grant::Granted,
        Some(_) => Grant::Queued,
        None => Grant::Rejected,
    }
}
