//! The instant actions on their way to the vehicle, and whether they obey the schema.

use std::sync::Arc;

use tck_view::{InstantActionsView, Topic};

use crate::observation::Observation;
use crate::setting::Setting;

/// Which instant actions are well-formed: one pass of the schema for each message.
#[derive(Debug, Default)]
pub struct InstantActionsSent {
    /// The last record with instant actions that obey the schema.
    obeys: Option<u64>,
}

impl InstantActionsSent {
    /// The instant actions that this record is, where they obey the schema.
    #[must_use]
    pub fn well_formed<'e>(&self, record: &Observation<'e>) -> Option<&'e Arc<InstantActionsView>> {
        record
            .instant_actions_to_vehicle()
            .filter(|_| self.obeys == Some(record.seq()))
    }

    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>, setting: &Setting<'_>) {
        let document = record.json().filter(|_| record.is_to_vehicle(Topic::InstantActions));
        let Some(document) = document else { return };
        let schema = setting.pack.schema(Topic::InstantActions.as_str());
        if schema.is_none_or(|schema| schema.findings(document).is_empty()) {
            self.obeys = Some(record.seq());
        }
    }
}
