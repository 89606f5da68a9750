//! Deviations of requests: what is asked for, and what is done with and without an answer (sections 6.6.10 and 6.9).

use crate::agv::order_message::{Corridor, Loss};
use crate::agv::requests::{Answer, EdgeRequest, Grant, RequestStatus};

use super::prelude::*;

records! {
    fault "corridor-used-unasked" ["CORR-11"] "It drives round an obstacle in a corridor that has to be released, and does not ask for it."
        => allowing(|_, what, usual| match what {
            Permission::UseCorridor(_) => true,
            Permission::Ask(_) => false,
            _ => usual,
        });
    fault "corridor-answer-not-awaited" ["CORR-14", "REQ-14"] "It asks for a corridor and drives into it without waiting for an answer."
        => letting(|_, what| matches!(what, Permission::UseCorridor(_)));
    fault "corridor-used-when-queued" ["REQ-07", "CORR-14"] "It takes QUEUED for a permission to use the corridor."
        => letting(|agv, what| match what {
            Permission::UseCorridor(edge) => status(agv, edge) == Some(RequestStatus::Queued),
            _ => false,
        });
    fault "corridor-used-when-rejected" ["REQ-08", "CORR-14"] "It uses a corridor that was rejected."
        => keep::<bool>()
            .hears_answer(|rejected, _, answer| *rejected |= answer.grant == Grant::Rejected)
            .happens(|rejected, _, event| *rejected &= event != Event::Begun)
            .allows(|rejected, _, what, usual| usual || *rejected && matches!(what, Permission::UseCorridor(_)));
    fault "corridor-grant-unshown" ["CORR-15", "REQ-06"] "It uses a corridor that was granted, and still says REQUESTED."
        => wording(|request, m| {
            if request.status == RequestStatus::Granted {
                m.set("requestStatus", "REQUESTED");
            }
            true
        });
    fault "grant-unheard" ["REQ-06"] "It does not react to a response that grants what it has asked for."
        => hearing(|_, answer| if answer.grant == Grant::Granted {
            answer.request_id.clear();
        });
    fault "corridor-request-gone-early" ["CORR-16"] "It removes the request for a corridor as soon as it has left its trajectory."
        => wording(|request, _| request.way.is_none());
    fault "corridor-request-left-behind" ["REQ-15", "CORR-16", "ORD-CLEAR-08"] "It never removes a request for a corridor."
        => letting(|_, what| matches!(what, Permission::KeepRequest));
    fault "corridor-of-horizon-asked" ["CORR-13"] "It asks for the corridor of an edge that is not released yet."
        => letting(|agv, what| matches!(what, Permission::Ask(edge) if agv.has_to_ask(edge)));
    fault "corridor-request-of-no-edge" ["CORR-12"] "The edgeId of its request for a corridor is none of the order."
        => wording(|_, m| {
            m.change("edgeId", |id| *id = json!("no-such-edge"));
            true
        });
    fault "corridor-request-without-sequence" ["CORR-12"] "Its request for a corridor has no sequenceId."
        => wording(|_, m| {
            m.unset("sequenceId");
            true
        });
    fault "corridor-request-begins-queued" ["CORR-12"] "It says QUEUED of a request before anybody has answered it."
        => wording(|request, m| {
            if request.status == RequestStatus::Requested {
                m.set("requestStatus", "QUEUED");
            }
            true
        });
    fault "corridor-request-typed-access" ["CORR-12"] "The requestType of its request for a corridor is ACCESS."
        => wording(|_, m| {
            m.set("requestType", "ACCESS");
            true
        });
    fault "corridor-status-invented" ["REQ-02"] "It says WAITING of a request that was not answered yet."
        => wording(|request, m| {
            if request.status == RequestStatus::Requested {
                m.set("requestStatus", "WAITING");
            }
            true
        });
    fault "request-goes-back" ["REQ-16", "REQ-12"] "It says REQUESTED again of a request whose lease has ended on the way."
        => wording(|request, m| {
            if request.status == RequestStatus::Expired {
                m.set("requestStatus", "REQUESTED");
            }
            true
        });
    fault "request-ids-shared" ["ZREQ-04"] "All requests of an order have one requestId."
        => allowing(|agv, what, usual| match what {
            Permission::CountRequest => agv.requests.count == 0,
            Permission::Ask(edge) => usual || edge.released && agv.has_to_ask(edge),
            _ => usual,
        });
    fault "request-ids-repeated" ["ZREQ-04"] "The next request has the requestId of the one before."
        because "Another sentence asks for ids that are unique among active requests only; the ruling of ZREQ-04 warns."
        => allowing(|agv, what, usual| match what {
            Permission::CountRequest => {
                let requests = &agv.requests;
                requests.count == 0 || !requests.edges.is_empty() || !requests.zones.is_empty()
            }
            _ => usual,
        });
    fault "corridor-lease-ignored" ["REQ-09", "CORR-19", "REQ-12"] "It does not heed the end of a lease."
        => forbidding(|_, what| matches!(what, Permission::EndLease));
    fault "corridor-loss-ignored" ["CORR-19", "REQ-12"] "It drives on through a corridor whose release was revoked or has expired."
        => forbidding(|_, what| matches!(what, Permission::HeedLoss(request) if request.way.is_some()));
    fault "corridor-revocation-before-use-ignored" ["REQ-12", "REQ-06"] "It keeps a grant that was revoked before it has used it."
        => forbidding(|_, what| matches!(what, Permission::HeedLoss(request) if request.way.is_none()));
    fault "corridor-loss-returns-always" ["CORR-19"] "It goes back to its trajectory when a release is lost, also where the corridor says STOP or nothing."
        => keeping(|corridor| corridor.loss = Loss::Return);
    fault "corridor-loss-stops-always" ["CORR-19"] "It stops when a release is lost, also where the corridor says RETURN."
        => keeping(|corridor| corridor.loss = Loss::Stop);
    fault "corridor-loss-shown-granted" ["REQ-12"] "It stops when a release is lost, and still says GRANTED."
        => wording(|request, m| {
            if matches!(request.status, RequestStatus::Revoked | RequestStatus::Expired) {
                m.set("requestStatus", "GRANTED");
            }
            true
        });
    fault "corridor-loss-request-gone" ["REQ-12"] "It removes a request whose release is lost before it is back on its trajectory."
        => wording(|request, _| !matches!(request.status, RequestStatus::Revoked | RequestStatus::Expired));
    fault "corridor-returns-straight" ["CORR-20"] "It goes back to where it left its trajectory by another way than it came."
        because "The way back is named as a strategy, without shall."
        => forbidding(|_, what| matches!(what, Permission::ReturnAsItCame));
    fault "lease-not-prolonged" ["REQ-10"] "It keeps to the first lease of a request, whatever a further response says."
        => keep::<BTreeMap<String, Option<Moment>>>().hears_answer(|leases, _, answer| {
            if answer.grant == Grant::Granted {
                let first = *leases.entry(answer.request_id.clone()).or_insert(answer.lease);
                answer.lease = first.or(answer.lease);
                leases.insert(answer.request_id.clone(), answer.lease);
            }
        });
    fault "rejected-request-kept" ["REQ-08"] "It lists a request that was rejected for good."
        because "The ruling of REQ-08 warns, for the text lets the vehicle keep a request as long as it is of use."
        => hearing(|_, answer| if answer.grant == Grant::Rejected {
            answer.request_id.clear();
        });
    fault "response-to-another-taken" ["REQ-17", "CORR-14"] "It takes any response for an answer to its own request."
        => hearing(|agv, answer| {
            let edges = agv.requests.edges.iter().map(|request| &request.id);
            let mut asked = edges.chain(agv.requests.zones.iter().map(|request| &request.id));
            if let Some(id) = asked.next() {
                answer.request_id.clone_from(id);
            }
        });
    fault "responses-to-neighbours-taken" ["ZREQ-02", "ZONE-10", "REQ-14"] "It subscribes to the responses to all vehicles, and takes those that name a requestId of its own."
        => joining(|agv, options| for (filter, _) in &mut options.subscriptions {
            if agv.config.topic("responses") == Some(filter.as_str()) {
                let mut levels: Vec<&str> = filter.split('/').collect();
                levels.iter_mut().rev().skip(1).take(2).for_each(|level| *level = "+");
                *filter = levels.join("/");
            }
        })
        .allows(|_, _, what, usual| {
            usual || matches!(what, Permission::HearAnother("responses", topic) if topic.ends_with("/responses"))
        });
    fault "corridor-grant-kept-for-later" ["CORR-17", "CORR-16"] "It leaves its trajectory once more on an edge for which it was granted a corridor before, and does not ask again."
        => keep::<BTreeSet<u32>>()
            .hears_answer(|granted, agv, answer| {
                let request = agv.requests.edges.iter().find(|request| request.id == answer.request_id);
                if answer.grant == Grant::Granted {
                    granted.extend(request.map(|request| request.sequence_id));
                }
            })
            .happens(|granted, _, event| if event == Event::Begun {
                granted.clear();
            })
            .allows(|granted, agv, what, usual| match what {
                Permission::UseCorridor(edge) => usual || granted.contains(&edge.sequence_id) && !lost(agv, edge),
                Permission::Ask(edge) => usual && !granted.contains(&edge.sequence_id),
                _ => usual,
            });
    fault "corridor-grant-taken-for-the-next" ["CORR-18", "CORR-11"] "It takes the release of a corridor for that of the corridors behind it as well."
        => keep::<bool>()
            .hears_answer(|granted, _, answer| *granted |= answer.grant == Grant::Granted)
            .happens(|granted, _, event| *granted &= event != Event::Begun)
            .allows(|granted, _, what, usual| match what {
                Permission::UseCorridor(edge) => usual || *granted && edge.sequence_id > 1,
                Permission::Ask(edge) => usual && !(*granted && edge.sequence_id > 1),
                _ => usual,
            });
    fault "corridor-asked-without-need" ["CORR-10"] "It asks for a corridor that need not be released, and waits for the answer."
        because "The text allows the use of such a corridor and does not oblige to it; the ruling of CORR-10 warns."
        => keeping(|corridor| corridor.release_required = true);
    tolerance "requests-ahead" ["CORR-13"] "It asks for the corridors of its whole base at once."
        => letting(|agv, what| matches!(what, Permission::Ask(edge) if edge.released && agv.has_to_ask(edge)));
    tolerance "revocation-shown-once" ["REQ-12", "ZREQ-11"] "It shows a request that is revoked before it is used as REVOKED in one state before it removes it."
        => plain().hears_answer(|(), agv, answer| {
            let unused = |request: &&mut EdgeRequest| request.id == answer.request_id && request.status == RequestStatus::Granted && request.way.is_none();
            if answer.grant == Grant::Revoked && let Some(request) = agv.requests.edges.iter_mut().find(unused) {
                request.status = RequestStatus::Revoked;
                agv.flush();
                if let Some(request) = agv.requests.edges.iter_mut().find(|request| request.id == answer.request_id) {
                    request.status = RequestStatus::Granted;
                }
            }
        });
    tolerance "queued-shown-as-requested" ["REQ-02", "REQ-06"] "It says REQUESTED of a request that was queued."
        => wording(|request, m| {
            if request.status == RequestStatus::Queued {
                m.set("requestStatus", "REQUESTED");
            }
            true
        });
}

/// Words one of its requests for corridors otherwise, or leaves it out.
fn wording(change: fn(&EdgeRequest, &mut Object) -> bool) -> Box<dyn Deviation> {
    holding(change).says(|change, _, part, words| match part {
        Part::EdgeRequest(request) => change(request, words),
        _ => true,
    })
}

/// Takes an answer otherwise.
fn hearing(change: fn(&Agv, &mut Answer)) -> Box<dyn Deviation> {
    holding(change).hears_answer(|change, agv, answer| change(agv, answer))
}

/// Understands corridors otherwise.
fn keeping(change: fn(&mut Corridor)) -> Box<dyn Deviation> {
    holding(change).keeps_to(|change, _, corridor| change(corridor))
}

/// The status of its request for an edge.
fn status(agv: &Agv, edge: &Edge) -> Option<RequestStatus> {
    agv.requests.of_edge(edge.sequence_id).map(|request| request.status)
}

/// Whether it has lost what it was granted for an edge.
fn lost(agv: &Agv, edge: &Edge) -> bool {
    status(agv, edge).is_some_and(|status| matches!(status, RequestStatus::Revoked | RequestStatus::Expired))
}
