//! `state/pause-stands`: a vehicle that is paused comes to rest and stays there.

use std::time::Duration;

use crate::finding::broken;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Topic};

/// How long a vehicle may take to come to rest.
const COMING_TO_REST: Duration = Duration::from_secs(10);

/// A vehicle that is paused comes to rest and stays there.
pub(crate) const PAUSE_STANDS: Check = Check {
    name: "state/pause-stands",
    decides: &["ACT-12"],
    doc: "A vehicle that reports paused reports driving false at the latest ten seconds later, and from then on until the \
          pause ends. Judged in modes in which master control is in command, and not after what a person or a hook did \
          during the pause.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Displaced],
    needs: &[StateView::paused, StateView::driving, StateView::operating_mode],
    start: |_| Box::new(PauseStands::default()),
};

#[derive(Default)]
struct PauseStands {
    /// Since when states say that it is paused.
    since: Option<Moment>,
    /// Whether it drove in the last state after it had time to come to rest.
    drove: bool,
    told: bool,
}

impl Running for PauseStands {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.displaced().now(record) {
            self.since = None;
        }
        let Some(state) = record.state() else {
            return false;
        };
        let in_command = matches!(state.operating_mode.or_empty(), "AUTOMATIC" | "SEMIAUTOMATIC");
        if !state.paused.is(true) || !in_command {
            self.since = None;
            self.drove = false;
            self.told = false;
            return false;
        }
        let now = record.at().moment;
        let since = *self.since.get_or_insert(now);
        let drives = state.driving.is(true) && now.since(since) > COMING_TO_REST;
        // One state alone may have been on its way when the pause began anew.
        if drives && self.drove && !self.told {
            self.told = true;
            let text = format!(
                "driving is true, and paused has been true for {:.0} s",
                now.since(since).as_secs_f64()
            );
            findings.push(broken("ACT-12", record.seq(), text));
        }
        self.drove = drives;
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;

    fn judge(driving: [bool; 4]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for driving in driving {
            trace.state(&json!({ "paused": true, "driving": driving })).wait(6.0);
        }
        trace.judge("state/pause-stands").summary()
    }

    #[test]
    fn a_vehicle_that_comes_to_rest_is_right_and_one_that_drives_on_is_found() {
        assert!(judge([true, true, false, false]).is_empty());
        assert!(judge([false, false, true, false]).is_empty());
        assert_eq!(judge([true, true, true, true]), ["ACT-12"]);
        assert_eq!(judge([false, false, true, true]), ["ACT-12"]);
    }
}
