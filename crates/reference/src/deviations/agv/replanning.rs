//! Deviations of ways through COORDINATED_REPLANNING zones: which are asked for, which is driven, and what follows when a grant is
//! lost (sections 6.4.1.1, 6.4.3 and 6.4.4).

use crate::agv::requests::RequestStatus;
use crate::agv::zone_requests::ZoneRequest;
use crate::agv::zones::{ReleaseLoss, Zone, ZoneKind};

use super::prelude::*;

records! {
    fault "replanning-zone-entered-unasked" ["ZREQ-01", "ZONE-16"] "It drives into COORDINATED_REPLANNING zones, and asks nobody."
        => allowing(|_, what, usual| match what {
            Permission::EnterZone(zone) => usual || is_replanning(zone),
            Permission::AskForZone => false,
            _ => usual,
        });
    fault "replanning-answer-not-awaited" ["ZREQ-02", "ZONE-16"] "It asks for a way through a COORDINATED_REPLANNING zone, and drives it without waiting for an answer."
        => letting(|_, what| matches!(what, Permission::EnterZone(zone) if is_replanning(zone)));
    fault "replanning-zone-entered-when-queued" ["REQ-07", "ZONE-16"] "It takes QUEUED for leave to drive its way through a COORDINATED_REPLANNING zone."
        => letting(|agv, what| matches!(what, Permission::EnterZone(zone) if is_replanning(zone) && shows(agv, zone, RequestStatus::Queued)));
    fault "replanning-of-a-zone-for-its-neighbour" ["ZREQ-09"] "Where COORDINATED_REPLANNING zones overlap it waits for one of them only."
        => letting(|agv, what| match what {
            Permission::EnterZone(zone) => is_replanning(zone) && agv.requests.zones.iter().any(|request| request.status == RequestStatus::Granted),
            _ => false,
        });
    fault "replanning-asked-of-one-zone" ["ZREQ-09"] "Where COORDINATED_REPLANNING zones overlap it asks for its way through the first of them only."
        => wording(|agv, request, _| agv.requests.zones.first().is_none_or(|first| first.zone == request.zone));
    fault "replanning-requests-typed-access" ["ZREQ-05"] "The requestType of its request for a way is ACCESS."
        => wording(|_, _, m| {
            m.set("requestType", "ACCESS");
            true
        });
    fault "replanning-without-trajectory" ["ZREQ-07"] "Its request for a way through a zone does not say which way."
        => wording(|_, _, m| {
            m.unset("trajectory");
            true
        });
    fault "replanning-alternatives-alike" ["ZREQ-07"] "It asks for the same way twice." because "A robot may ask again before it is answered; a remark."
        => wording(|agv, request, m| {
            let mut others = agv.requests.zones.iter();
            let first = others.find(|other| other.zone == request.zone && other.status.is_open());
            if let Some(way) = first.and_then(|first| first.way.as_ref()).filter(|_| request.status.is_open()) {
                m.set("trajectory", way.sent.clone());
            }
            true
        });
    fault "replanning-alternatives-kept" ["ZREQ-14"] "It goes on listing the other ways when it was granted one."
        => letting(|_, what| matches!(what, Permission::KeepAlternative));
    fault "replanning-prescribed-way-unsent" ["ZREQ-16"] "It asks for the straight line where its edge has a trajectory, and drives the trajectory."
        => wording(|agv, request, m| {
            let prescribed = agv.order.edges.iter().any(|edge| edge.trajectory.is_some());
            if let Some(way) = request.way.as_ref().filter(|_| prescribed) {
                let ends = [way.path.at(0.0), way.path.at(way.path.length())];
                let points: Vec<Value> = ends.iter().flatten().map(|spot| json!({ "x": spot.x, "y": spot.y })).collect();
                m.set("trajectory", json!({ "degree": 1, "knotVector": [0.0, 0.0, 1.0, 1.0], "controlPoints": points }));
            }
            true
        });
    fault "replanning-way-changed-inside" ["ZONE-16"] "Inside a COORDINATED_REPLANNING zone it asks for another way, and drives it without waiting for an answer."
        => letting(|agv, what| matches!(what, Permission::EnterZone(zone) if is_replanning(zone) && is_in(agv, zone)));
    fault "replanning-new-way-unasked" ["ZONE-16", "ZREQ-15"] "Inside a COORDINATED_REPLANNING zone it drives another way, and asks nobody."
        => allowing(|agv, what, usual| match what {
            Permission::EnterZone(zone) => usual || is_replanning(zone) && is_in(agv, zone),
            Permission::AskForZone => usual && !agv.heeding.inside.iter().any(|(_, zone)| is_replanning(zone)),
            _ => usual,
        });
    fault "replanning-granted-way-cut" ["ZONE-16"] "It asks for the trajectory of its edge, and drives straight on in the zone."
        => letting(|agv, what| matches!(what, Permission::EnterZone(zone) if is_replanning(zone) && shows(agv, zone, RequestStatus::Granted))).bends(|_, agv, _, path| {
            let granted = agv.requests.zones.iter().any(|request| request.way.is_some() && request.status == RequestStatus::Granted);
            (!granted).then_some(path)
        });
    fault "replanning-rounds-unasked" ["ZONE-16"] "In a COORDINATED_REPLANNING zone it drives round what stands in its way without waiting for an answer."
        => letting(|agv, what| match what {
            Permission::DriveWay(request) => request.way.as_ref().is_some_and(|way| way.bow_of.is_some()) && !agv.obstacles.is_empty(),
            Permission::EnterZone(zone) => is_replanning(zone) && is_in(agv, zone) && !agv.obstacles.is_empty(),
            _ => false,
        });
    fault "replanning-lost-drives-on" ["ZREQ-15"] "It drives on in a COORDINATED_REPLANNING zone when its grant is lost, and reports it."
        => allowing(|agv, what, usual| match what {
            Permission::StayWithoutRelease(ReleaseLoss::Anew) => false,
            Permission::EnterZone(zone) => usual || is_replanning(zone) && is_in(agv, zone) && agv.requests.zones.iter().any(ZoneRequest::is_lost),
            _ => usual,
        });
    fault "replanning-lost-silent" ["ZREQ-15"] "It stops when its grant is lost in a COORDINATED_REPLANNING zone, and reports nothing."
        => raising(|agv, _, error| error.error_type != agv.config.errors.release_loss);
    fault "replanning-lost-unheeded" ["ZREQ-15"] "It does not heed that its grant is revoked, or its lease runs out, in a COORDINATED_REPLANNING zone."
        => forbidding(|_, what| matches!(what, Permission::HeedZoneLoss(request, _) if request.inside && request.way.is_some()));
    fault "drives-on-after-lost-replanning-grant" ["ZREQ-15"] "It shows that its grant is lost in a COORDINATED_REPLANNING zone, and drives on by its way, without an error and without another request."
        => allowing(|agv, what, usual| match what {
            Permission::StayWithoutRelease(ReleaseLoss::Anew) => false,
            Permission::EnterZone(zone) => usual || is_replanning(zone) && is_in(agv, zone) && agv.requests.zones.iter().any(ZoneRequest::is_lost),
            Permission::AskForZone => usual && !agv.requests.lost.iter().any(|lost| lost.loss == ReleaseLoss::Anew),
            _ => usual,
        })
        .raises(|_, agv, _, error| error.error_type != agv.config.errors.release_loss);
    fault "replanning-lost-waits" ["ZREQ-15"] "It waits for its lost grant to come back, and asks for no other one."
        => forbidding(|agv, what| matches!(what, Permission::AskForZone) && agv.requests.lost.iter().any(|lost| lost.loss == ReleaseLoss::Anew));
    fault "replanning-request-left-behind" ["REQ-15"] "It goes on listing the request for a way through a zone that it has left." because "How soon it goes is not said; a remark."
        => letting(|agv, what| match what {
            Permission::KeepZoneRequest(request) => agv.mode.takes_orders() && !agv.order.cancelled && request.inside,
            _ => false,
        });

    tolerance "replanning-one-way-only" ["ZREQ-07", "ZREQ-14"] "It asks for one way through a COORDINATED_REPLANNING zone, and offers no other one."
        => forbidding(|_, what| matches!(what, Permission::OfferAlternative));
    tolerance "replanning-lost-removed" ["ZREQ-15", "REQ-12"] "It removes the request whose grant is lost in a COORDINATED_REPLANNING zone at once."
        => wording(|_, request, _| !request.is_lost());
    tolerance "replanning-way-from-the-border" ["ZREQ-07", "ZREQ-16"] "Of its way it sends the part in the zone only."
        => wording(|agv, request, m| {
            if let Some(sent) = agv.zone_of(&request.zone).and_then(|zone| part_inside(request, zone)) {
                m.set("trajectory", sent);
            }
            true
        });
}

/// Words one of its requests for ways otherwise, or leaves it out.
fn wording(change: fn(&Agv, &ZoneRequest, &mut Object) -> bool) -> Box<dyn Deviation> {
    holding(change).says(|change, agv, part, words| match part {
        Part::ZoneRequest(request) if request.way.is_some() => change(agv, request, words),
        _ => true,
    })
}

fn is_replanning(zone: &Zone) -> bool {
    zone.kind == ZoneKind::CoordinatedReplanning
}

/// Whether it is in a zone.
fn is_in(agv: &Agv, zone: &Zone) -> bool {
    agv.heeding.inside.iter().any(|(_, inside)| inside.id == zone.id)
}

/// Whether a request for a zone has this status.
fn shows(agv: &Agv, zone: &Zone, status: RequestStatus) -> bool {
    let mut requests = agv.requests.zones.iter();
    requests.any(|request| request.zone.1 == zone.id && request.status == status)
}

/// The part of a way that lies in its zone, as it is sent.
fn part_inside(request: &ZoneRequest, zone: &Zone) -> Option<Value> {
    let path = &request.way.as_ref()?.path;
    let steps = (0..400_u32).map(|step| 0.05 * f64::from(step));
    let spots = steps
        .take_while(|made| *made <= path.length())
        .chain([path.length()])
        .filter_map(|made| path.at(made));
    let near = |spot: &tck_base::nurbs::Spot| zone.area.depth(tck_base::polygon::Point::new(spot.x, spot.y)) > -0.8;
    let points: Vec<(f64, f64)> = spots.filter(near).map(|spot| (spot.x, spot.y)).collect();
    (points.len() > 1).then(|| crate::agv::paths::line(&points))
}
