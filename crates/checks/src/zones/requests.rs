//! `zones/requests`: what the requests for zones in the states are about.

use std::collections::BTreeSet;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{StateView, ZoneRequest};
use tck_world::{Fact, Listen, Observation, Topic};

/// `zones/requests`.
pub(crate) const ZONE_REQUESTS: Check = Check {
    name: "zones/requests",
    decides: &["ZREQ-03", "ZREQ-05", "ZREQ-06", "ZREQ-07"],
    doc: "A zoneRequest that is new is for a zone set that the same state lists as ENABLED (ZREQ-03), and for a zone of that \
          set, where it is known what is in it (ZREQ-06). Its requestType is ACCESS for a zone of type RELEASE, and REPLANNING for \
          one of type COORDINATED_REPLANNING (ZREQ-05). One for a zone of the latter type has a trajectory; the same one as an \
          undecided request for the same zone is a warning, since it may be asked again (ZREQ-07).",
    arguments: &[],
    listens: &[Listen::ToVehicle(Topic::ZoneSet), Listen::Delivered(Topic::State)],
    reads: &[Fact::Zones],
    needs: &[StateView::zone_requests, StateView::zone_sets],
    start: |_| Box::new(Requests::default()),
};

/// How many requests of a state are looked at.
const LOOKED_AT: usize = 256;

#[derive(Default)]
struct Requests {
    /// The ids of the state before.
    known: BTreeSet<String>,
}

/// What fleet control is asked for about a zone of a type.
fn wanted(zone_type: &str) -> Option<&'static str> {
    match zone_type {
        "RELEASE" => Some("ACCESS"),
        "COORDINATED_REPLANNING" => Some("REPLANNING"),
        _ => None,
    }
}

/// What is wrong with a new request.
fn wrong(request: &ZoneRequest, state: &StateView, context: &CheckContext<'_>) -> Vec<(&'static str, String)> {
    let id = quote(request.request_id.or_empty());
    let Some(set) = request.zone_set_id.text() else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let mut sets = state.zone_sets.iter();
    let is_enabled = |listed: &tck_view::ZoneSetState| {
        listed.zone_set_id.text() == Some(set) && listed.zone_set_status.is("ENABLED")
    };
    if state.zone_sets.is_there() && !sets.any(is_enabled) {
        let text = format!(
            "the request {id} is for the zone set {}, which is not ENABLED",
            quote(set)
        );
        found.push(("ZREQ-03", text));
    }
    let (Some(zones), Some(name)) = (context.world.zones().of_set(set), request.zone_id.text()) else {
        return found;
    };
    let Some(zone) = zones.iter().find(|zone| zone.name() == name) else {
        let text = format!(
            "the request {id} is for the zone {}, which is not in the zone set {}",
            quote(name),
            quote(set)
        );
        found.push(("ZREQ-06", text));
        return found;
    };
    let zone_type = zone.zone.zone_type.or_empty();
    let said = request.request_type.text();
    if let (Some(wanted), Some(said)) = (wanted(zone_type), said)
        && wanted != said
    {
        let text = format!(
            "the request {id} for a zone of type {zone_type} is of type {}",
            quote(said)
        );
        found.push(("ZREQ-05", text));
    }
    if zone_type == "COORDINATED_REPLANNING"
        && said == Some("REPLANNING")
        && !request.trajectory.presence().is_something()
    {
        found.push((
            "ZREQ-07",
            format!("the request {id} for a way through a zone has no trajectory"),
        ));
    }
    found
}

/// Says where a new request is for the same way as one before it that is not decided yet.
fn same_way(request: &ZoneRequest, state: &StateView) -> Option<String> {
    let is_open = |one: &ZoneRequest| one.request_status.is("REQUESTED") || one.request_status.is("QUEUED");
    if !request.trajectory.is_there() || !is_open(request) {
        return None;
    }
    let before = state.zone_requests.iter().take(LOOKED_AT);
    let mut before = before.take_while(|other| !std::ptr::eq(*other, request));
    let same = before.find(|other| {
        let of_zone = other.zone_id == request.zone_id && other.zone_set_id == request.zone_set_id;
        of_zone && is_open(other) && other.trajectory == request.trajectory
    })?;
    let (other, id) = (quote(same.request_id.or_empty()), quote(request.request_id.or_empty()));
    Some(format!(
        "the requests {other} and {id} are for the same way through a zone"
    ))
}

impl Running for Requests {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(state) = record.state() else { return false };
        let mut now = BTreeSet::new();
        for request in state.zone_requests.iter().take(LOOKED_AT) {
            let Some(id) = request.request_id.text() else { continue };
            if now.insert(id.to_owned()) && !self.known.contains(id) {
                let found = wrong(request, state, context);
                findings.extend(found.into_iter().map(|(id, text)| broken(id, record.seq(), text)));
                findings.extend(same_way(request, state).map(|text| remark("ZREQ-07", record.seq(), text)));
            }
        }
        self.known = now;
        !self.known.is_empty()
    }
}
