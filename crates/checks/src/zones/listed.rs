//! `zones/actions-listed`: a vehicle that heeds ACTION zones has a list of their actions in every state.

use crate::finding::broken;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{StateView, TypeSpecification};
use tck_world::{Fact, Factsheet, Listen, Observation, Topic};

/// `zones/actions-listed`.
pub(crate) const ACTIONS_LISTED: Check = Check {
    name: "zones/actions-listed",
    decides: &["ZACT-STATE-01"],
    doc: "zoneActionStates stands in every state of a vehicle whose supportedZones lists ACTION. Nothing is judged before there \
          is a factsheet.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Factsheet), Listen::Delivered(Topic::State)],
    reads: &[Fact::Factsheets],
    needs: &[StateView::zone_action_states, TypeSpecification::supported_zones],
    start: |_| Box::new(ActionsListed),
};

struct ActionsListed;

fn heeds_actions(sheet: &Factsheet) -> bool {
    let kinds = sheet.view.type_specification.there().map(|kind| &kind.supported_zones);
    kinds.is_some_and(|kinds| kinds.texts().any(|kind| kind == "ACTION"))
}

impl Running for ActionsListed {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(state) = record.state() else { return false };
        let sheets = context.world.factsheets().valid(record, context);
        if sheets.is_empty() || !sheets.iter().all(|sheet| heeds_actions(sheet)) {
            return false;
        }
        if !state.zone_action_states.is_there() {
            let text = "zoneActionStates is missing, and the vehicle heeds ACTION zones";
            findings.push(broken("ZACT-STATE-01", record.seq(), text));
        }
        true
    }
}
