//! Deviations of access to RELEASE zones: what is asked for, what is done with and without it, and what follows when it is lost
//! (sections 6.4.1.1, 6.4.3 and 6.6.6).

use crate::agv::Mode;
use crate::agv::requests::{Grant, RequestStatus};
use crate::agv::zone_requests::ZoneRequest;
use crate::agv::zones::{ReleaseLoss, Zone, ZoneKind};

use super::prelude::*;

records! {
    fault "release-zone-entered-unasked" ["ZREQ-01", "ZONE-10", "REQ-18"] "It drives into RELEASE zones, and asks nobody."
        => allowing(|_, what, usual| match what {
            Permission::EnterZone(_) => true,
            Permission::AskForZone => false,
            _ => usual,
        });
    fault "release-zone-waited-for-unasked" ["REQ-18", "ZREQ-01"] "It stops before a RELEASE zone, and waits for fleet control to say something without having asked."
        => forbidding(|_, what| matches!(what, Permission::AskForZone));
    fault "release-answer-not-awaited" ["ZREQ-02", "ZONE-10", "REQ-14"] "It asks for a RELEASE zone, and drives into it without waiting for an answer."
        => letting(|_, what| matches!(what, Permission::EnterZone(_)));
    fault "release-zone-entered-when-queued" ["ZONE-10", "REQ-07"] "It takes QUEUED for access to a RELEASE zone."
        => letting(|agv, what| match what {
            Permission::EnterZone(zone) => shows(agv, zone, RequestStatus::Queued),
            _ => false,
        });
    fault "release-zone-entered-when-rejected" ["ZONE-10", "REQ-08"] "It goes into a RELEASE zone when its request was rejected."
        => keep::<bool>()
            .hears_answer(|rejected, _, answer| *rejected |= answer.grant == Grant::Rejected)
            .happens(|rejected, _, event| *rejected &= event != Event::Begun)
            .allows(|rejected, _, what, usual| usual || *rejected && matches!(what, Permission::EnterZone(_)));
    fault "release-zone-by-centre" ["ZONE-10", "ZONE-03"] "Counts as outside a RELEASE zone until its kinematic centre is inside."
        => forbidding(|_, what| matches!(what, Permission::GoByContour(zone) if is_release(zone)));
    fault "release-zones-unseen" ["ZONE-10", "ZREQ-01"] "Takes no notice of RELEASE zones."
        => forbidding(|_, what| matches!(what, Permission::HeedZone(zone) if is_release(zone)));
    fault "release-of-a-zone-for-its-neighbour" ["ZREQ-08", "ZONE-10"] "Where RELEASE zones overlap it waits for one of them only."
        => letting(|agv, what| match what {
            Permission::EnterZone(_) => agv.requests.zones.iter().any(|request| request.status == RequestStatus::Granted),
            _ => false,
        });
    fault "release-lease-over-before-entry-ignored" ["ZREQ-12", "REQ-09"] "It goes into a RELEASE zone on a lease that has run out."
        => forbidding(|_, what| matches!(what, Permission::HeedZoneLoss(request, RequestStatus::Expired) if !request.inside));
    fault "release-revoked-before-entry-ignored" ["ZREQ-11", "REQ-06"] "It keeps access to a RELEASE zone that was revoked before it has gone in."
        => forbidding(|_, what| matches!(what, Permission::HeedZoneLoss(request, RequestStatus::Revoked) if !request.inside));
    fault "release-revoked-entered-silently" ["ZREQ-11", "ZONE-10"] "It takes back a request for a RELEASE zone that was revoked, and goes in all the same."
        => keep::<bool>()
            .hears_answer(|revoked, _, answer| *revoked |= answer.grant == Grant::Revoked)
            .happens(|revoked, _, event| *revoked &= event != Event::Begun)
            .allows(|revoked, _, what, usual| usual || *revoked && matches!(what, Permission::EnterZone(_)));

    fault "release-lease-over-entered-silently" ["ZREQ-12", "REQ-09"] "It says that a lease has run out, and goes into the RELEASE zone all the same."
        => keep::<bool>()
            .hears_answer(|leased, _, answer| *leased |= answer.lease.is_some())
            .happens(|leased, _, event| *leased &= event != Event::Begun)
            .allows(|leased, _, what, usual| usual || *leased && matches!(what, Permission::EnterZone(_)));
    fault "release-revoked-request-kept" ["ZREQ-11"] "It goes on listing a request that was revoked before it went in, as REVOKED."
        => plain().hears_answer(|_, agv, answer| {
            let mut asked = agv.requests.zones.iter_mut();
            let outside = asked.find(|request| request.id == answer.request_id && !request.inside);
            if let Some(request) = outside.filter(|request| answer.grant == Grant::Revoked && request.status == RequestStatus::Granted) {
                request.status = RequestStatus::Revoked;
                agv.asks_later();
            }
        });

    fault "release-request-typed-replanning" ["ZREQ-05"] "The requestType of its request for a RELEASE zone is REPLANNING."
        => wording(|_, _, m| {
            m.set("requestType", "REPLANNING");
            true
        });
    fault "release-request-of-no-zone" ["ZREQ-06"] "The zoneId of its request is none of the zone set."
        => wording(|_, _, m| {
            m.change("zoneId", |id| *id = json!("no-such-zone"));
            true
        });
    fault "release-request-without-zone-set" ["ZREQ-06"] "Its request for a zone does not say of which zone set that is."
        => wording(|_, _, m| {
            m.unset("zoneSetId");
            true
        });
    fault "release-request-begins-granted" ["ZREQ-06", "ZONE-10"] "It says GRANTED of a request for a zone before anybody has answered it."
        => wording(|_, request, m| {
            if request.status == RequestStatus::Requested {
                m.set("requestStatus", "GRANTED");
            }
            true
        });
    fault "release-of-disabled-set-asked" ["ZREQ-03"] "It asks for RELEASE zones of sets that are not enabled."
        => letting(|_, what| matches!(what, Permission::ApplyZoneSet(set) if set.zones.iter().any(is_release)));
    fault "release-request-ids-shared" ["ZREQ-04"] "All its requests for zones have one requestId."
        => wording(|_, _, m| {
            m.set("requestId", "request");
            true
        });
    fault "release-request-hidden-inside" ["ZREQ-10"] "It lists its request for a RELEASE zone no more as soon as it is inside."
        => wording(|_, request, _| !request.inside);
    fault "release-request-not-granted-inside" ["ZREQ-10"] "It says REQUESTED of its request as long as it is in the RELEASE zone."
        => wording(|_, request, m| {
            if request.inside && request.status == RequestStatus::Granted {
                m.set("requestStatus", "REQUESTED");
            }
            true
        });
    fault "release-request-left-behind" ["ZREQ-10", "REQ-15"] "It goes on listing a request for a RELEASE zone that it has left."
        because "A request that stays in the list after the zone is a warning (ZREQ-10)."
        => keep::<Vec<(String, String)>>()
            .allows(|_, agv, what, usual| match what {
                Permission::KeepZoneRequest(request) => usual || agv.mode.takes_orders() && !agv.order.cancelled && request.inside,
                _ => usual,
            });
    fault "release-requests-survive-cancel" ["ORD-CLEAR-08"] "It keeps its requests for zones when its order is cancelled."
        => letting(|agv, what| matches!(what, Permission::KeepZoneRequest(_)) && agv.order.cancelled && agv.mode.takes_orders());
    fault "release-requests-kept-by-hand" ["MODE-16"] "It keeps its requests for zones in MANUAL, SERVICE and TEACH_IN."
        => letting(|agv, what| matches!(what, Permission::KeepZoneRequest(_)) && !agv.mode.keeps_orders());
    fault "release-requests-kept-in-intervened" ["MODE-08"] "It keeps its requests for zones when somebody steps in."
        => letting(|agv, what| matches!(what, Permission::KeepZoneRequest(_)) && agv.mode == Mode::Intervened);
    fault "release-asked-for-in-intervened" ["MODE-08"] "It asks anew for the zones it needs while somebody steps in."
        => letting(|agv, what| match what {
            Permission::AskForAnything => agv.mode == Mode::Intervened,
            Permission::KeepZoneRequest(request) => agv.mode == Mode::Intervened && request.status == RequestStatus::Requested,
            _ => false,
        });
    fault "release-requests-gone-in-semiautomatic" ["MODE-17", "ZREQ-10"] "It removes its requests for zones in SEMIAUTOMATIC."
        => forbidding(|agv, what| matches!(what, Permission::KeepZoneRequest(_)) && agv.mode == Mode::Semiautomatic);
    fault "release-lost-drives-on" ["ZONE-11", "ZREQ-13"] "It drives on in a RELEASE zone that says STOP when its release is lost, and reports the error."
        => forbidding(|_, what| matches!(what, Permission::StayWithoutRelease(ReleaseLoss::Stop)));
    fault "release-revoked-inside-unheeded" ["ZONE-11", "ZREQ-13", "REQ-12"] "It does not heed that a release is revoked when it is inside."
        => forbidding(|_, what| matches!(what, Permission::HeedZoneLoss(request, RequestStatus::Revoked) if request.inside));
    fault "release-lease-over-inside-unheeded" ["ZONE-11", "ZREQ-13", "REQ-12"] "It does not heed that a lease runs out when it is inside."
        => forbidding(|_, what| matches!(what, Permission::HeedZoneLoss(request, RequestStatus::Expired) if request.inside));
    fault "release-lost-silent" ["ZONE-11", "ZREQ-13"] "It stops when its release is lost, and reports no error."
        => raising(|agv, _, error| !is_lost(agv, error));
    fault "release-lost-warning" ["ZONE-11"] "Reports a WARNING when it stops because its release is lost."
        => error(|agv, error, words| if is_lost(agv, error) {
            words.set("errorLevel", "WARNING");
        });
    fault "release-lost-unnamed" ["ZONE-11"] "Does not say of which zone it has lost the release."
        => raising(|agv, _, error| {
            if is_lost(agv, error) {
                error.references.clear();
            }
            true
        });
    fault "release-lost-named-otherwise" ["ZONE-11"] "Calls the error of a lost release by a name of its own."
        => error(|agv, error, words| if is_lost(agv, error) {
            words.set("errorType", "accessError");
        });
    fault "release-lost-brief" ["ZONE-12"] "Takes the error of a lost release back while it is still inside."
        => raising(|agv, _, error| {
            if is_lost(agv, error) {
                error.life = Life::Until(agv.moment() + brief(agv));
            }
            true
        });
    fault "release-lost-stays" ["ZONE-12"] "Never takes the error of a lost release back."
        => raising(|agv, _, error| {
            if is_lost(agv, error) {
                error.life = Life::Always;
            }
            true
        });
    fault "release-lost-stays-when-granted" ["ZONE-12"] "Takes the error of a lost release back when it has left the zone, not when it is granted again."
        => keep::<Option<ActiveError>>()
            .raises(|kept, agv, _, error| {
                if is_lost(agv, error) {
                    *kept = Some(error.clone());
                }
                true
            })
            .happens(|kept, agv, event| if event == Event::Settled && agv.heeding.inside.iter().any(|(_, zone)| is_release(zone)) {
                let listed = kept.as_ref().is_some_and(|kept| agv.errors.active.contains(kept));
                if let Some(error) = kept.clone().filter(|_| !listed) {
                    agv.errors.raise(error);
                }
            } else if event == Event::Settled && let Some(error) = kept.take() {
                agv.errors.active.retain(|other| *other != error);
            });
    fault "release-lost-forgotten-by-hand" ["ZONE-12"] "Takes the error of a lost release back when somebody takes it over by hand, although it is still inside."
        => plain().happens(|_, agv, event| if matches!(event, Event::ModeChanged(_)) && !agv.mode.takes_orders() {
            let name = agv.config.errors.release_lost.clone();
            agv.errors.active.retain(|error| error.error_type != name);
        });
    fault "release-loss-unsaid-continues" ["ZONE-13"] "It drives on when its release is lost in a zone that does not say what follows."
        => forbidding(|_, what| matches!(what, Permission::StopUnsaid));
    fault "release-evacuates-never" ["ZONE-14"] "It stops where a zone says EVACUATE."
        => letting(|_, what| matches!(what, Permission::StayWithoutRelease(ReleaseLoss::Evacuate)));
    fault "release-continues-never" ["ZONE-15"] "It stops where a zone says CONTINUE."
        because "The ruling of ZONE-15 warns, for a vehicle may have another reason to stop."
        => letting(|_, what| matches!(what, Permission::StayWithoutRelease(ReleaseLoss::Continue)));
    fault "release-request-gone-evacuating" ["ZONE-14", "REQ-12"] "It removes its request as soon as its release is lost in a zone that says EVACUATE."
        => wording(|agv, request, _| lost_as(agv, request) != Some(ReleaseLoss::Evacuate));
    fault "release-request-gone-continuing" ["ZONE-15", "REQ-12"] "It removes its request as soon as its release is lost in a zone that says CONTINUE."
        => wording(|agv, request, _| lost_as(agv, request) != Some(ReleaseLoss::Continue));
    fault "release-request-gone-at-the-end" ["ZONE-15"] "It removes its request when its order has ended in a zone that says CONTINUE and whose release is lost."
        => wording(|agv, request, _| lost_as(agv, request) != Some(ReleaseLoss::Continue) || !agv.order.nodes.is_empty());
    fault "release-request-gone-stopped" ["REQ-12"] "It removes its request as soon as its release is lost in a zone that says STOP."
        => wording(|agv, request, _| lost_as(agv, request) != Some(ReleaseLoss::Stop));
    fault "release-loss-shown-granted" ["REQ-12", "REQ-06"] "It stops when its release is lost, and still says GRANTED."
        => wording(|agv, request, m| {
            if lost_as(agv, request) == Some(ReleaseLoss::Stop) {
                m.set("requestStatus", "GRANTED");
            }
            true
        });
    fault "release-loss-unreported" ["ZREQ-13"] "It says nothing when its release is lost in a zone that says EVACUATE or CONTINUE."
        because "No error is named for that; the ruling of ZREQ-13 warns."
        => raising(|agv, _, error| error.error_type != agv.config.errors.release_loss);
    fault "release-requests-kept-when-cancelled-inside" ["ORD-CLEAR-08", "ZREQ-10"] "It keeps its request for the RELEASE zone that it is in when its order is cancelled."
        because "The two rules contradict each other; the ruling of ORD-CLEAR-08 warns."
        => letting(|agv, what| match what {
            Permission::KeepZoneRequest(request) => agv.order.cancelled && agv.mode.takes_orders() && is_in(agv, request),
            _ => false,
        });

    tolerance "release-zones-asked-ahead" ["ZREQ-01"] "It asks for the RELEASE zones of its map as soon as it has an order."
        => plain().happens(|_, agv, event| if event == Event::Begun {
            let map = agv.motion.pose(agv.moment()).map_id;
            let zones = agv.zones_in_force(&map).into_iter().filter(|(_, zone)| is_release(zone));
            let names = zones.map(|(set, zone)| (set.to_owned(), zone.id.clone())).collect();
            agv.awaits_zones(names);
        });
    tolerance "release-without-behaviour-refused" ["ZONE-13"] "It refuses a zone set with a RELEASE zone that does not say what follows when its release is lost."
        => forbidding(|_, what| matches!(what, Permission::TakeReleaseUnsaid));
    tolerance "release-expiry-unshown" ["ZREQ-12", "REQ-12"] "It removes a request whose lease ends before it went in without saying EXPIRED, and asks anew."
        => forbidding(|_, what| matches!(what, Permission::ShowExpired));
    tolerance "release-revoked-shown" ["ZREQ-11"] "It says REVOKED in one state of a request that was revoked before it went in."
        => plain().hears_answer(|_, agv, answer| {
            let mut asked = agv.requests.zones.iter_mut();
            let outside = asked.find(|request| request.id == answer.request_id && !request.inside);
            if let Some(request) = outside.filter(|request| answer.grant == Grant::Revoked && request.status == RequestStatus::Granted) {
                request.status = RequestStatus::Revoked;
                agv.flush();
                if let Some(request) = agv.requests.zones.iter_mut().find(|request| request.id == answer.request_id) {
                    request.status = RequestStatus::Granted;
                }
            }
        });
    tolerance "release-loss-shown-granted-on-the-way-out" ["ZONE-14", "ZONE-15", "REQ-12"] "It goes on saying GRANTED of a request that was lost in a zone that says EVACUATE or CONTINUE."
        => wording(|agv, request, m| {
            if matches!(lost_as(agv, request), Some(ReleaseLoss::Evacuate | ReleaseLoss::Continue)) {
                m.set("requestStatus", "GRANTED");
            }
            true
        });
    tolerance "release-loss-reported-as-lost" ["ZREQ-13"] "It reports the same error in zones that say EVACUATE or CONTINUE as in those that say STOP."
        => raising(|agv, _, error| {
            if error.error_type == agv.config.errors.release_loss {
                error.error_type.clone_from(&agv.config.errors.release_lost);
            }
            true
        });
}

/// Words one of its requests for zones otherwise, or leaves it out.
fn wording(change: fn(&Agv, &ZoneRequest, &mut Object) -> bool) -> Box<dyn Deviation> {
    holding(change).says(|change, agv, part, words| match part {
        Part::ZoneRequest(request) => change(agv, request, words),
        _ => true,
    })
}

fn is_release(zone: &Zone) -> bool {
    matches!(zone.kind, ZoneKind::Release(_))
}

/// Whether an error is that of a release that is lost where the vehicle has to stop.
fn is_lost(agv: &Agv, error: &ActiveError) -> bool {
    error.error_type == agv.config.errors.release_lost
}

/// Whether a request for a zone has this status.
fn shows(agv: &Agv, zone: &Zone, status: RequestStatus) -> bool {
    let mut requests = agv.requests.zones.iter();
    requests.any(|request| request.zone.1 == zone.id && request.status == status)
}

/// What the zone of a request asks for, where its release is lost.
fn lost_as(agv: &Agv, request: &ZoneRequest) -> Option<ReleaseLoss> {
    let lost = agv.requests.lost.iter().find(|lost| lost.zone == request.zone)?;
    request.is_lost().then_some(lost.loss)
}

/// Whether it is in the zone of a request.
fn is_in(agv: &Agv, request: &ZoneRequest) -> bool {
    let mut inside = agv.heeding.inside.iter();
    inside.any(|(set, zone)| *set == request.zone.0 && zone.id == request.zone.1)
}
