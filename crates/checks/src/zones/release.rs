//! `zones/release-…`, `zones/replanning-asked` and `zones/replanning-granted`: whether a zone that has to be asked for is gone into
//! with a grant only.

use std::collections::{BTreeMap, BTreeSet};

use tck_base::verdict::Verdict;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Response, StateView, ZoneRequest};
use tck_world::zones::{KnownZone, Place, ZonesSeen};
use tck_world::{Fact, Listen, Observation, Topic};

use super::drives_by_order;
use crate::finding::quote;

/// `zones/release-asked`.
pub(crate) const RELEASE_ASKED: Check = Check {
    name: "zones/release-asked",
    decides: &["ZREQ-01"],
    doc: "A vehicle that was clear of a RELEASE zone in force and reaches into it has listed a zoneRequest for it, in that state or \
          before. Judged where it has asked or gone in: one that does neither proves nothing. Its outline is that of its factsheet, \
          else its kinematic centre alone is judged; what is nearer to the border than the vehicle says to be exact, or than \
          0.1 m, is not judged.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::about(RELEASE, Question::Asked)),
};

/// `zones/release-granted`.
pub(crate) const RELEASE_GRANTED: Check = Check {
    name: "zones/release-granted",
    decides: &[
        "ZONE-10", "ZREQ-02", "ZREQ-08", "ZREQ-11", "ZREQ-12", "REQ-07", "REQ-08", "REQ-09", "REQ-14", "REQ-17",
    ],
    doc: "A vehicle that was clear of a RELEASE zone in force reaches into it only after a response has granted a request of it \
          for that zone. A grant counts until it is revoked or its lease ends, and a second longer; one that ended while the vehicle was \
          nearer to the border than can be told counts. Judged as soon as it has asked or gone in.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::about(RELEASE, Question::Granted)),
};

/// `zones/release-kept`.
pub(crate) const RELEASE_KEPT: Check = Check {
    name: "zones/release-kept",
    decides: &["ZREQ-10"],
    doc: "As long as a vehicle reaches into a RELEASE zone that it was granted, it lists a zoneRequest for it as GRANTED. One that \
          is still listed when the vehicle is clear of the zone in more than three states is a warning. What follows when the grant \
          is lost, when the order is called off or when the mode changes, is not judged.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::about(RELEASE, Question::Kept)),
};

/// `zones/release-contour`.
pub(crate) const RELEASE_CONTOUR: Check = Check {
    name: "zones/release-contour",
    decides: &["ZONE-03"],
    doc: "A vehicle whose factsheet draws its outline waits before a RELEASE zone with all of it. One that reaches in with a part of \
          its outline and without a grant is a warning, and a failure when its kinematic centre is inside as well. What is \
          nearer to the border than the vehicle says to be exact, or than 0.1 m, is not judged.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::about(RELEASE, Question::Contour)),
};

/// `zones/replanning-asked`.
pub(crate) const REPLANNING_ASKED: Check = Check {
    name: "zones/replanning-asked",
    decides: &["ZREQ-01"],
    doc: "As zones/release-asked, of COORDINATED_REPLANNING zones that meet no LINE_GUIDED one, which would decide in their place.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::about(REPLANNING, Question::Asked)),
};

/// `zones/replanning-granted`.
pub(crate) const REPLANNING_GRANTED: Check = Check {
    name: "zones/replanning-granted",
    decides: &[
        "ZONE-16", "ZREQ-02", "ZREQ-09", "ZREQ-11", "ZREQ-12", "REQ-07", "REQ-08", "REQ-09", "REQ-14", "REQ-17",
    ],
    doc: "As zones/release-granted, of COORDINATED_REPLANNING zones that meet no LINE_GUIDED one. Which way was granted is not looked at.",
    arguments: &[],
    listens: LISTENS,
    reads: READS,
    needs: NEEDS,
    start: |_| Box::new(Releases::about(REPLANNING, Question::Granted)),
};

const RELEASE: &str = "RELEASE";
pub(super) const REPLANNING: &str = "COORDINATED_REPLANNING";

pub(super) const LISTENS: &[Listen] = &[
    Listen::ToVehicle(Topic::ZoneSet),
    Listen::ToVehicle(Topic::Responses),
    Listen::ToVehicle(Topic::InstantActions),
    Listen::Delivered(Topic::State),
    Listen::Delivered(Topic::Factsheet),
    Listen::Stored(Topic::Factsheet),
    Listen::Hook,
    Listen::Answer,
    Listen::Connect,
];
const READS: &[Fact] = &[Fact::Zones];
const NEEDS: &[tck_view::Field] = &[StateView::zone_sets, StateView::zone_requests, StateView::position];

/// How much longer than its end a grant may still be taken for one, in seconds.
const LATE: f64 = 1.0;
/// How many answers are kept in mind.
const ANSWERS: usize = 256;
/// For how many states a request may stay behind.
const BEHIND: u32 = 3;

/// What the answers to a request said.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Given {
    pub(super) granted: bool,
    /// When the grant ends, or has ended.
    end: Option<jiff::Timestamp>,
}

/// Answers to requests.
#[derive(Default)]
pub(super) struct Answers(pub(super) BTreeMap<String, Given>);

impl Answers {
    pub(super) fn learn(&mut self, record: &Observation<'_>) {
        let message = record
            .to_vehicle(Topic::Responses)
            .and_then(|message| message.responses());
        for answer in message.into_iter().flat_map(|message| message.responses.iter()) {
            self.note(answer, record.at().utc);
        }
    }

    fn note(&mut self, answer: &Response, now: jiff::Timestamp) {
        let Some(id) = answer.request_id.text() else { return };
        if self.0.len() >= ANSWERS && !self.0.contains_key(id) {
            self.0.pop_first();
        }
        let given = self.0.entry(id.to_owned()).or_default();
        if answer.grant_type.is("GRANTED") {
            let lease = answer.lease_expiry.text();
            *given = Given {
                granted: true,
                end: lease.and_then(|end| end.parse().ok()),
            };
        } else if given.granted && (answer.grant_type.is("REVOKED") || answer.grant_type.is("REJECTED")) {
            given.end = Some(given.end.map_or(now, |end| end.min(now)));
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Question {
    Asked,
    Granted,
    Kept,
    Contour,
}

/// A zone, by the id of its set and its own.
pub(super) type Name = (String, String);

/// What is known of the access to a zone.
#[derive(Default)]
struct Access {
    /// When the vehicle was clear of it for certain, since nothing was unclear.
    clear: Option<jiff::Timestamp>,
    /// The ids of its requests for it.
    ids: BTreeSet<String>,
    /// The ids of those that were listed while it was inside.
    used: BTreeSet<String>,
    /// It has gone in with a grant, and nothing has ended that since.
    holds: bool,
    /// In how many states a request was listed that it has no use for.
    behind: u32,
    told: bool,
}

impl Access {
    /// Whether it goes in with a grant: one that had not ended long before it was last seen outside.
    fn is_granted(&self, answers: &Answers) -> bool {
        let given = self.ids.iter().filter_map(|id| answers.0.get(id));
        let mut granted = given.filter(|given| given.granted);
        granted.any(|given| {
            let outside = self.clear.zip(given.end);
            outside.is_none_or(|(clear, end)| clear.duration_since(end).as_secs_f64() <= LATE)
        })
    }

    /// Whether a request is one with which it was inside.
    fn is_used(&self, request: &ZoneRequest) -> bool {
        request.request_id.text().is_some_and(|id| self.used.contains(id))
    }

    /// Whether one of its grants has ended, or ends within a while.
    fn may_have_ended(&self, answers: &Answers, now: jiff::Timestamp) -> bool {
        let given = self.ids.iter().filter_map(|id| answers.0.get(id));
        let mut ends = given.filter_map(|given| given.end);
        ends.any(|end| end.duration_since(now).as_secs_f64() <= LATE)
    }
}

struct Releases {
    /// zoneType.
    zone_type: &'static str,
    question: Question,
    answers: Answers,
    zones: BTreeMap<Name, Access>,
}

/// The requests of a state for a zone.
pub(super) fn requests<'s>(state: &'s StateView, zone: &KnownZone) -> Vec<&'s ZoneRequest> {
    let all = state.zone_requests.iter().take(ANSWERS);
    all.filter(|request| request.zone_id.is(zone.name()) && request.zone_set_id.is(&zone.set))
        .collect()
}

/// Whether another zone decides in its place: a LINE_GUIDED one over one of COORDINATED_REPLANNING (ZINT-02).
pub(super) fn is_overruled(zones: &ZonesSeen, zone: &KnownZone, place: &Place) -> bool {
    let mut here = zones.in_force(place.pose.map_id.as_str());
    zone.is(REPLANNING) && here.any(|other| other.is("LINE_GUIDED") && other.area.touches(&zone.area))
}

/// Whether the order is called off, and the requests with it.
pub(super) fn hears_cancel(record: &Observation<'_>) -> bool {
    let message = record.instant_actions_to_vehicle();
    message.is_some_and(|message| message.all_actions().any(|action| action.action_type.is("cancelOrder")))
}

impl Releases {
    fn about(zone_type: &'static str, question: Question) -> Self {
        Self {
            zone_type,
            question,
            answers: Answers::default(),
            zones: BTreeMap::new(),
        }
    }

    /// What was known of where the vehicle is counts no longer.
    fn forget_places(&mut self) {
        for access in self.zones.values_mut() {
            access.clear = None;
            access.holds = false;
            access.behind = 0;
        }
    }

    /// Looks at a zone in a state: whether something was judged, and what is wrong.
    fn look(
        &mut self,
        zone: &KnownZone,
        (reach, centre): (Option<f64>, Option<f64>),
        seen: &Seen<'_>,
    ) -> (bool, Option<CheckFinding>) {
        let listed = requests(seen.state, zone);
        let name = (zone.set.clone(), zone.name().to_owned());
        let access = self.zones.entry(name).or_default();
        let ids = listed.iter().filter_map(|request| request.request_id.text());
        access.ids.extend(ids.map(str::to_owned).take(ANSWERS));
        let entered = reach.is_some_and(|reach| reach > 0.0) && access.clear.is_some();
        let granted = access.is_granted(&self.answers);
        if reach.is_some_and(|reach| reach > 0.0) {
            access.used.clone_from(&access.ids);
        }
        let finding = |text: &str, verdict: Option<Verdict>| {
            let reach = reach.unwrap_or_default();
            CheckFinding {
                requirement: None,
                verdict,
                seq: seen.seq,
                message: format!(
                    "the vehicle is at x {:.2}, y {:.2}, which is {:.2} m {} the {} zone {}, and {text}",
                    seen.place.pose.x,
                    seen.place.pose.y,
                    reach.abs(),
                    if reach > 0.0 { "inside" } else { "outside" },
                    zone.zone.zone_type.or_empty(),
                    quote(zone.name())
                ),
                element: None,
            }
        };
        let mut found = None;
        let mut judged = entered || !access.ids.is_empty();
        match self.question {
            Question::Asked if entered && access.ids.is_empty() => {
                found = Some(finding("has not asked for it", None));
            }
            Question::Granted if entered && !granted => {
                found = Some(finding("no response gives it access", None));
            }
            Question::Contour => {
                let waits = !granted && !access.ids.is_empty() && seen.state.driving.is(false);
                judged = seen.outlined && (access.clear.is_some() && reach.is_none() && waits || entered && !granted);
                if judged && entered {
                    let all = centre.is_some_and(|depth| depth > 0.0);
                    let softer = (!all).then_some(Verdict::Warning);
                    found = Some(finding("its outline counts where no response gives it access", softer));
                }
            }
            Question::Kept => {
                access.holds |= entered && granted;
                access.holds &=
                    reach.is_none_or(|reach| reach > 0.0) && !access.may_have_ended(&self.answers, seen.now);
                judged = access.holds && reach.is_some();
                let shows = listed.iter().any(|request| request.request_status.is("GRANTED"));
                if judged && !shows {
                    found = Some(finding("does not list a request for it as GRANTED", None));
                }
                let left = access.clear.is_some() && !listed.is_empty() && reach.is_some_and(|reach| reach <= 0.0);
                let used = left && listed.iter().any(|request| access.is_used(request));
                access.behind = if used { access.behind + 1 } else { 0 };
                if access.behind > BEHIND {
                    judged = true;
                    found = Some(finding(
                        "still lists the request with which it went in",
                        Some(Verdict::Warning),
                    ));
                }
            }
            _ => {}
        }
        match reach {
            Some(reach) if reach > 0.0 => access.clear = None,
            Some(_) => access.clear = Some(seen.now),
            None => {}
        }
        let told = access.told;
        access.told |= found.is_some();
        (judged, found.filter(|_| !told))
    }
}

/// What a state shows, and when.
struct Seen<'s> {
    state: &'s StateView,
    place: &'s Place,
    seq: u64,
    now: jiff::Timestamp,
    /// The outline of the vehicle is known.
    outlined: bool,
}

impl Running for Releases {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.answers.learn(record);
        if record.outside_influence() || record.connects() || hears_cancel(record) {
            self.forget_places();
        }
        let Some(state) = record.state() else { return false };
        let zones = context.world.zones();
        let Some(place) = zones.places().1.filter(|_| drives_by_order(state)) else {
            self.forget_places();
            return false;
        };
        let seen = Seen {
            state,
            place,
            seq: record.seq(),
            now: record.at().utc,
            outlined: zones.knows_outline(),
        };
        let mut judged = false;
        let mut in_force = BTreeSet::new();
        let zone_type = self.zone_type;
        let here = zones.in_force(place.pose.map_id.as_str());
        for zone in here.filter(|zone| zone.is(zone_type) && !is_overruled(zones, zone, place)) {
            in_force.insert((zone.set.clone(), zone.name().to_owned()));
            let depths = (zones.reach(zone, place), zones.centre(zone, place));
            let (looked, found) = self.look(zone, depths, &seen);
            judged |= looked;
            findings.extend(found);
        }
        self.zones.retain(|name, _| in_force.contains(name));
        judged
    }
}
