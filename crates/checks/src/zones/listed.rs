//! `zones/actions-listed` and `zones/requests-listed`: what a vehicle that heeds zones has a list of in every state.

use crate::finding::broken;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{FactsheetView, MessageView, StateView, TypeSpecification};
use tck_world::{Listen, Observation, Seen, Topic};

/// `zones/actions-listed`.
pub(crate) const ACTIONS_LISTED: Check = Check {
    name: "zones/actions-listed",
    decides: &["ZACT-STATE-01"],
    doc: "zoneActionStates stands in every state of a vehicle whose supportedZones lists ACTION. Nothing is judged before there \
          is a factsheet.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Factsheet),
        Listen::Stored(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[StateView::zone_action_states, TypeSpecification::supported_zones],
    start: |_| {
        Box::new(Listed {
            requirement: "ZACT-STATE-01",
            zones: &["ACTION"],
            is_there: |state| state.zone_action_states.is_there(),
            text: "zoneActionStates is missing, and the vehicle heeds ACTION zones",
            is_owed: false,
        })
    },
};

/// `zones/requests-listed`.
pub(crate) const REQUESTS_LISTED: Check = Check {
    name: "zones/requests-listed",
    decides: &["STATE-MSG-22"],
    doc: "zoneRequests stands in every state of a vehicle whose supportedZones lists RELEASE or COORDINATED_REPLANNING, empty where \
          it asks for nothing. Nothing is judged before there is a factsheet.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Factsheet),
        Listen::Stored(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[StateView::zone_requests, TypeSpecification::supported_zones],
    start: |_| {
        Box::new(Listed {
            requirement: "STATE-MSG-22",
            zones: &["RELEASE", "COORDINATED_REPLANNING"],
            is_there: |state| state.zone_requests.is_there(),
            text: "zoneRequests is missing, and the vehicle asks for zones",
            is_owed: false,
        })
    },
};

struct Listed {
    requirement: &'static str,
    /// The types of zones of which one has to be listed in supportedZones.
    zones: &'static [&'static str],
    is_there: fn(&StateView) -> bool,
    text: &'static str,
    /// Whether the last factsheet lists one of them.
    is_owed: bool,
}

impl Listed {
    fn lists_one(&self, sheet: &FactsheetView) -> bool {
        let kinds = sheet.type_specification.there().map(|kind| &kind.supported_zones);
        kinds.is_some_and(|kinds| kinds.texts().any(|kind| self.zones.contains(&kind)))
    }
}

impl Running for Listed {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let says = |seen| record.is(seen, Topic::Factsheet);
        if says(Seen::Delivered) || says(Seen::Stored) {
            if let Some(sheet) = record.message().and_then(MessageView::factsheet) {
                self.is_owed = self.lists_one(sheet);
            }
            return false;
        }
        let Some(state) = record.state().filter(|_| self.is_owed) else {
            return false;
        };
        if !(self.is_there)(state) {
            findings.push(broken(self.requirement, record.seq(), self.text));
        }
        true
    }
}
