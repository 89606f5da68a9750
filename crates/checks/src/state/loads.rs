//! `state/loads`: a vehicle that knows its load says so in every state, and names the places of its factsheet.
//!
//! What a pick or drop has to do is left to the tests.

use std::collections::BTreeSet;

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionState, MessageView, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// How many loads, places and actions are looked at.
const MANY: usize = 256;

/// A vehicle that knows its load says so in every state, and names the places of its factsheet.
pub(crate) const LOADS: Check = Check {
    name: "state/loads",
    decides: &["STATE-MSG-06", "FACT-09"],
    doc: "A vehicle that lists a load does not leave loads out as soon as it is rid of it: found when loads goes with a \
          FINISHED action, or when it comes and goes twice, and was never seen empty. loadPosition is one of the \
          loadPositions of the factsheet, where that has any. What a person or a hook did, a FATAL error and a restart are \
          forgiven.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Delivered(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::loads],
    start: |_| Box::new(Loads::default()),
};

#[derive(Default)]
struct Loads {
    /// Whether the last state listed a load.
    loaded: bool,
    /// How often the member has gone, and whether it was ever empty.
    gone: u32,
    empty: bool,
    /// actionIds that were not FINISHED in the last state.
    open: BTreeSet<String>,
    /// loadPositions of the factsheet.
    places: Vec<String>,
    told: BTreeSet<String>,
}

impl Loads {
    fn place(&mut self, state: &StateView, seq: u64, findings: &mut Vec<CheckFinding>) {
        for load in state.loads.iter().take(MANY) {
            let Some(place) = load.load_position.text() else {
                continue;
            };
            let known = self.places.is_empty() || self.places.iter().any(|known| known == place);
            let short: String = place.chars().take(128).collect();
            if !place.is_empty() && !known && self.told.len() < MANY && self.told.insert(short) {
                let text = format!(
                    "loadPosition {} is none of the loadPositions in the factsheet",
                    quote(place)
                );
                findings.push(broken("FACT-09", seq, text));
            }
        }
    }
}

impl Running for Loads {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if record.is_delivered(Topic::Factsheet)
            && let Some(sheet) = record.message().and_then(MessageView::factsheet)
        {
            let specification = sheet.load_specification.there().into_iter();
            let places = specification.flat_map(|loads| loads.load_positions.texts()).take(MANY);
            self.places = places.map(str::to_owned).collect();
        }
        if context.world.restarts().now(record) || record.outside_influence() {
            self.loaded = false;
            self.open.clear();
        }
        let Some(state) = record.state() else {
            return false;
        };
        self.place(state, record.seq(), findings);
        let fatal = state.errors.iter().any(|error| !error.error_level.is("WARNING"));
        let status = |action: &ActionState| action.action_status.is("FINISHED");
        let all = || state.all_action_states().take(MANY);
        let ended = all().any(|action| status(action) && self.open.contains(action.action_id.or_empty()));
        let open = all().filter(|action| !status(action));
        self.open = open.map(|action| action.action_id.or_empty().to_owned()).collect();
        let loads = state.loads.there();
        self.empty |= loads.is_some_and(|loads| loads.total() == 0);
        let was_loaded = std::mem::replace(&mut self.loaded, loads.is_some_and(|loads| loads.total() > 0));
        if was_loaded && state.loads.is_absent() && !fatal {
            self.gone += 1;
            if !self.empty && (ended || self.gone == 2) {
                let text = "loads listed a load and is left out now that there is none; it was never seen empty";
                findings.push(broken("STATE-MSG-06", record.seq(), text));
            }
        }
        loads.is_some()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn state(load: Option<&[&str]>, drop: &str) -> Value {
        let mut state = json!({ "actionStates": [{ "actionId": "d", "actionStatus": drop }] });
        if let Some(loads) = load {
            state["loads"] = loads.iter().map(|place| json!({ "loadPosition": place })).collect();
        }
        state
    }

    fn judge(states: &[Value]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.message(
            "factsheet",
            &json!({ "loadSpecification": { "loadPositions": ["left"] } }),
        );
        for state in states {
            trace.state(state);
        }
        trace.judge("state/loads").summary()
    }

    #[test]
    fn loads_that_are_there_and_then_empty_or_never_there_are_right() {
        assert!(judge(&[state(Some(&["left"]), "RUNNING"), state(Some(&[]), "FINISHED")]).is_empty());
        assert!(judge(&[state(None, "RUNNING"), state(None, "FINISHED")]).is_empty());
    }

    #[test]
    fn loads_that_are_left_out_when_empty_are_found() {
        assert_eq!(
            judge(&[state(Some(&["left"]), "RUNNING"), state(None, "FINISHED")]),
            ["STATE-MSG-06"]
        );
        // A sensor that has just failed.
        assert!(judge(&[state(Some(&["left"]), "RUNNING"), state(None, "RUNNING")]).is_empty());
    }

    #[test]
    fn a_place_that_the_factsheet_does_not_list_is_found_once() {
        let odd = state(Some(&["right"]), "FINISHED");
        assert_eq!(judge(&[odd.clone(), odd]), ["FACT-09"]);
    }
}
