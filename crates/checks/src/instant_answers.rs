//! `instant/…`: every instant action of a message gets a state, begins, and stands where it may.
//!
//! What an action has to do is left to the tests.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::finding::{broken, quote, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, ErrorView, InstantActionsView, MessageView, Names, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// How many actions are kept in mind, and how many one message may have to be judged.
const ACTIONS: usize = 256;
const IN_ONE: usize = 8;

/// `instant/answered`.
pub(super) const ANSWERED: Check = Check {
    name: "instant/answered",
    decides: &["IACT-03"],
    doc: "Each action of an instantActions message that obeys the schema is in actionStates within time.react, as long as \
          no new order is accepted. A vehicle whose error says that it lacks the list under the name of version 1.1 is told so \
          at once. Not judged while the harness disturbs the link, nor over a restart, nor with more than eight actions in \
          one message. What is sent to a vehicle that says that it hibernates is not judged.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::Delivered(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts, Fact::Instant],
    needs: &[StateView::action_states],
    start: |_| Box::new(Answered::looking_for("IACT-03")),
};

/// `instant/answered-together`.
pub(super) const TOGETHER: Check = Check {
    name: "instant/answered-together",
    decides: &["IACT-07"],
    doc: "When one action of an instantActions message is in actionStates, so are the others: a warning from time.slow after \
          it was sent, and found after time.react. Otherwise as instant/answered.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::Delivered(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts, Fact::Instant],
    needs: &[StateView::action_states],
    start: |_| Box::new(Answered::looking_for("IACT-07")),
};

/// `instant/begins`.
pub(super) const BEGINS: Check = Check {
    name: "instant/begins",
    decides: &["IACT-05"],
    doc: "No instant action stays WAITING for longer than time.slow, which is a warning, or time.react, while the vehicle \
          stands and no other action is under way. cancelOrder and downloadMap may wait for something outside. Otherwise \
          as instant/answered.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::Delivered(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts, Fact::Instant],
    needs: &[StateView::action_states],
    start: |_| Box::new(Answered::looking_for("IACT-05")),
};

/// `instant/scope`.
pub(super) const SCOPE: Check = Check {
    name: "instant/scope",
    decides: &["ACT-10"],
    doc: "A predefined action that is none for instantActions, and that the factsheet does not offer there, is not performed \
          as one. finePositioning, of which the text says two things, is not judged. Otherwise as instant/answered.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::Delivered(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts, Fact::Instant],
    needs: &[StateView::action_states],
    start: |_| Box::new(Answered::looking_for("ACT-10")),
};

struct Asked {
    message: u64,
    at: Moment,
    kind: String,
    /// States since it was sent.
    states: u32,
    listed: bool,
    /// Since when it is WAITING, and nothing is in its way.
    waits: Option<Moment>,
    told: bool,
    late: bool,
}

#[derive(Default)]
struct Answered {
    /// What this one looks for.
    requirement: &'static str,
    /// By actionId.
    asked: BTreeMap<String, Asked>,
    order: Option<(String, u64)>,
    /// It says that it hibernates, and so hears nothing.
    asleep: bool,
    /// actionTypes that the factsheet offers as instant actions.
    offered: Vec<String>,
}

fn active(status: &str) -> bool {
    matches!(status, "INITIALIZING" | "RUNNING" | "PAUSED")
}

impl Answered {
    fn looking_for(requirement: &'static str) -> Self {
        Self {
            requirement,
            ..Self::default()
        }
    }

    /// Whether there is something to judge.
    fn has_subject(&self, context: &CheckContext<'_>) -> bool {
        let mut all = self.asked.values();
        match self.requirement {
            "ACT-10" => all.any(|asked| is_misplaced(&asked.kind, context)),
            "IACT-07" => {
                let several = |asked: &Asked| {
                    self.asked
                        .values()
                        .filter(|other| other.message == asked.message)
                        .count()
                        > 1
                };
                all.any(|asked| asked.listed && several(asked))
            }
            _ => all.any(|asked| asked.listed),
        }
    }

    fn learn(&mut self, record: &Observation<'_>, context: &CheckContext<'_>) {
        if record.is_delivered(Topic::Factsheet) {
            let sheet = record.message().and_then(MessageView::factsheet);
            let listed = sheet.into_iter().flat_map(|sheet| sheet.offered_actions());
            let instant = listed
                .take(ACTIONS)
                .filter(|action| action.action_scopes.texts().any(|scope| scope == "INSTANT"));
            self.offered = instant.map(|action| action.action_type.or_empty().to_owned()).collect();
        }
        if let Some(said) = record
            .connection_message()
            .filter(|_| record.is_delivered(Topic::Connection))
        {
            self.asleep = said.is_hibernating();
        }
        let heard = context.world.instant().well_formed(record).filter(|_| !self.asleep);
        let Some(message) = heard else {
            return;
        };
        let all: Vec<&ActionView> = message.all_actions().collect();
        let id = |action: &ActionView| action.action_id.or_empty().to_owned();
        let fresh = |at: usize| {
            let own = id(all[at]);
            !own.is_empty() && !self.asked.contains_key(&own) && all[..at].iter().all(|other| id(other) != own)
        };
        if record.link.disturbed || all.len() > IN_ONE || !(0..all.len()).all(fresh) {
            return;
        }
        if self.asked.len() > ACTIONS {
            self.asked.clear();
        }
        // What has ended may be cleared before a state shows it.
        if all.iter().any(|action| action.action_type.is("clearInstantActions")) {
            self.asked.retain(|_, asked| asked.listed);
        }
        for action in &all {
            let asked = Asked {
                message: record.seq(),
                at: record.at().moment,
                kind: action.action_type.or_empty().to_owned(),
                states: 0,
                listed: false,
                waits: None,
                told: false,
                late: false,
            };
            self.asked.insert(id(action), asked);
        }
    }

    /// An action that is in no state yet.
    fn missing(
        &mut self,
        now: Moment,
        seq: u64,
        renewed: bool,
        limits: (Duration, Duration),
        findings: &mut Vec<CheckFinding>,
    ) {
        let (slow, react) = limits;
        let known: Vec<u64> = self
            .asked
            .values()
            .filter(|asked| asked.listed)
            .map(|asked| asked.message)
            .collect();
        for (id, asked) in self.asked.iter_mut().filter(|(_, asked)| !asked.listed && !asked.told) {
            let took = now.since(asked.at);
            let beside = known.contains(&asked.message);
            if asked.states < 2 || (renewed && !beside) {
                continue;
            }
            let text = format!(
                "instant action {} ({}) of #{} is in no state {:.0} s after it was sent",
                quote(id),
                quote(&asked.kind),
                asked.message,
                took.as_secs_f64()
            );
            if took > react {
                asked.told = true;
                if beside {
                    findings.push(broken(
                        "IACT-07",
                        seq,
                        format!("{text}, while another one of the message is"),
                    ));
                }
                findings.push(broken("IACT-03", seq, text));
            } else if took > slow && beside && !asked.late {
                asked.late = true;
                findings.push(remark(
                    "IACT-07",
                    seq,
                    format!("{text}, while another one of the message is"),
                ));
            }
        }
    }

    /// A vehicle that says by an error that it looks for the actions under the name that 1.1 had for their list.
    fn misnamed(&mut self, state: &StateView, names: &Names, seq: u64, findings: &mut Vec<CheckFinding>) {
        let open = |asked: &&mut Asked| !asked.listed && !asked.told;
        let (Some(old), Some(new)) = (
            names.name(InstantActionsView::misnamed_actions),
            names.name(InstantActionsView::actions),
        ) else {
            return;
        };
        let mut errors = state.errors.iter().take(ACTIONS);
        if self.requirement != "IACT-03" || !errors.any(|error| asks_for(error, old, new)) {
            return;
        }
        let mut told = self.asked.values_mut().filter(open).peekable();
        if told.peek().is_none() {
            return;
        }
        told.for_each(|asked| asked.told = true);
        let text = format!(
            "the vehicle listens to {}, the name that version 1.1 had for {}: its own error says that it misses it, and no instant \
             action reaches it",
            quote(old),
            quote(new)
        );
        findings.push(broken("IACT-03", seq, text));
    }

    fn listed(
        &mut self,
        state: &StateView,
        now: Moment,
        seq: u64,
        context: &CheckContext<'_>,
        limits: (Duration, Duration),
        findings: &mut Vec<CheckFinding>,
    ) {
        let (slow, react) = limits;
        let busy = state
            .all_action_states()
            .take(ACTIONS)
            .any(|action| active(action.action_status.or_empty()))
            || !state.driving.is(false);
        for action in state.all_action_states().take(ACTIONS) {
            let Some(asked) = self.asked.get_mut(action.action_id.or_empty()) else {
                continue;
            };
            asked.listed = true;
            let status = action.action_status.or_empty();
            let id = quote(action.action_id.or_empty());
            let performed = active(status) || status == "FINISHED";
            if performed && !asked.told && is_misplaced(&asked.kind, context) && !self.offered.contains(&asked.kind) {
                asked.told = true;
                let text = format!("action {id} ({}) is {status} as an instant action", quote(&asked.kind));
                findings.push(broken("ACT-10", seq, text));
            }
            // A cancellation and a download may have to wait for something outside.
            let patient = matches!(asked.kind.as_str(), "cancelOrder" | "downloadMap");
            if status != "WAITING" || busy || patient {
                asked.waits = None;
                continue;
            }
            let since = *asked.waits.get_or_insert(now);
            let took = now.since(since);
            let text = format!(
                "instant action {id} ({}) is WAITING for {:.0} s, and nothing else is under way",
                quote(&asked.kind),
                took.as_secs_f64()
            );
            if took > react && !asked.told {
                asked.told = true;
                findings.push(broken("IACT-05", seq, text));
            } else if took > slow && !asked.late {
                asked.late = true;
                findings.push(remark("IACT-05", seq, text));
            }
        }
    }
}

/// Whether an error says that a message lacks a member of the old name, and not one of the new name. As a member it stands in
/// quotes or as a JSON pointer; a topic stands behind other levels.
fn asks_for(error: &ErrorView, old: &str, new: &str) -> bool {
    let names = |text: &str, name: &str| {
        let marks = [("'", "'"), ("\"", "\""), ("`", "`")];
        let quoted = marks
            .iter()
            .any(|(open, close)| text.contains(&format!("{open}{name}{close}")));
        let pointer = |begin: &str| {
            let end = |rest: &str| !rest.starts_with(|next: char| next.is_ascii_alphanumeric());
            text.split(&format!("{begin}/{name}")).skip(1).any(end)
        };
        quoted || pointer("#") || pointer(" ")
    };
    let texts = [&error.error_description, &error.error_hint];
    texts.into_iter().filter_map(|text| text.text()).any(|text| {
        let low = text.to_ascii_lowercase();
        let lacks = low.contains("required") || low.contains("missing");
        lacks && !low.contains("topic") && names(text, old) && !names(text, new)
    })
}

/// Whether the table of predefined actions has this one, and not for instantActions. What is written about
/// finePositioning contradicts itself.
fn is_misplaced(kind: &str, context: &CheckContext<'_>) -> bool {
    let known = context.pack.vocabulary().get("action").and_then(|all| all.get(kind));
    let scopes = known.and_then(|action| action.get("scopes")?.as_array());
    kind != "finePositioning"
        && scopes.is_some_and(|scopes| !scopes.iter().any(|scope| scope.as_str() == Some("INSTANT")))
}

impl Running for Answered {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.learn(record, context);
        let restarted = context.world.restarts().now(record);
        if restarted || record.link.disturbed || record.outside_influence() || self.asleep {
            self.asked.clear();
        }
        let Some(state) = record.state() else {
            return false;
        };
        if !state.action_states.is_there() || self.asked.is_empty() {
            return false;
        }
        let order = state.order_id.or_empty().to_owned();
        let order = (order, state.order_update_id.whole().unwrap_or_default());
        let before = self.order.replace(order.clone());
        let renewed = before.is_some_and(|before| before.0 != order.0);
        let slow = context.time.slow;
        let limits = (slow, context.time.react);
        let now = record.at().moment;
        for asked in self.asked.values_mut() {
            asked.states += 1;
        }
        let mut found = Vec::new();
        self.listed(state, now, record.seq(), context, limits, &mut found);
        self.misnamed(state, record.names(), record.seq(), &mut found);
        self.missing(now, record.seq(), renewed, limits, &mut found);
        let mine = |finding: &CheckFinding| {
            finding
                .requirement
                .as_ref()
                .is_some_and(|id| id.as_str() == self.requirement)
        };
        findings.extend(found.into_iter().filter(mine));
        let judged = self.has_subject(context);
        if renewed {
            // What has ended may go with the old order, listed ever or not.
            self.asked.retain(|_, asked| asked.listed);
        }
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::{Trace, merged};

    fn sends(trace: &mut Trace, all: &[(&str, &str)]) {
        let all: Vec<Value> = all
            .iter()
            .map(|(id, kind)| json!({ "actionId": id, "actionType": kind, "blockingType": "NONE" }))
            .collect();
        let message = merged(trace.header(), &json!({ "actions": all }));
        trace.sent("instantActions", &message);
    }

    fn lists(all: &[(&str, &str)]) -> Value {
        let all: Vec<Value> = all
            .iter()
            .map(|(id, status)| json!({ "actionId": id, "actionStatus": status }))
            .collect();
        json!({ "actionStates": all })
    }

    const ALL: [&str; 4] = [
        "instant/answered-together",
        "instant/answered",
        "instant/begins",
        "instant/scope",
    ];

    fn judge(kinds: &[(&str, &str)], shown: &[(&str, &str)], seconds: f64) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.state(&json!({}));
        sends(&mut trace, kinds);
        trace.wait(0.2).state(&lists(shown));
        trace.wait(seconds).state(&lists(shown));
        ALL.iter().flat_map(|check| trace.judge(check).summary()).collect()
    }

    #[test]
    fn actions_that_get_a_state_are_right_and_slow_ones_have_time() {
        let both = [("a", "stateRequest"), ("b", "dance")];
        assert!(judge(&both, &[("a", "FINISHED"), ("b", "FAILED")], 60.0).is_empty());
        assert!(judge(&both, &[], 20.0).is_empty());
        assert!(judge(&both, &[("a", "RUNNING"), ("b", "WAITING")], 60.0).is_empty());
    }

    #[test]
    fn actions_without_a_state_are_found() {
        let both = [("a", "stateRequest"), ("b", "dance")];
        assert_eq!(judge(&both, &[("b", "FAILED")], 10.0), ["IACT-07 warning"]);
        assert_eq!(judge(&both, &[("b", "FAILED")], 40.0), ["IACT-07", "IACT-03"]);
        assert_eq!(judge(&both[..1], &[], 40.0), ["IACT-03"]);
    }

    #[test]
    fn a_vehicle_that_listens_to_the_name_of_1_1_is_told_so_once() {
        let judge = |description: &str| {
            let mut trace = Trace::subscriber();
            trace.state(&json!({}));
            sends(&mut trace, &[("a", "stateRequest"), ("b", "dance")]);
            let error =
                json!({ "errorType": "validationError", "errorLevel": "WARNING", "errorDescription": description });
            trace.wait(0.2).state(&json!({ "errors": [error] }));
            trace.wait(40.0).state(&json!({ "errors": [error] }));
            trace.judge("instant/answered")
        };
        for own in [
            "must have required property 'instantActions'",
            "Invalid VDA 5050 InstantActions at #/allOf/1/required, #/instantActions",
            "missing field `instantActions` at line 1",
        ] {
            let found = judge(own);
            assert_eq!(found.summary(), ["IACT-03"], "{own}");
        }
        // A topic, or the right name, says nothing of the kind: two actions get no state.
        for other in [
            "'actions' is a required property of 'instantActions'",
            "uagv/v2/KIT/0001/instantActions: a required member is missing",
            "topic 'instantActions': required member missing",
            "",
        ] {
            assert_eq!(judge(other).summary(), ["IACT-03", "IACT-03"], "{other}");
        }
    }

    #[test]
    fn an_action_that_waits_for_nothing_is_found() {
        let one = [("a", "stateRequest")];
        assert_eq!(judge(&one, &[("a", "WAITING")], 10.0), ["IACT-05 warning"]);
        assert_eq!(judge(&one, &[("a", "WAITING")], 40.0), ["IACT-05"]);
    }

    #[test]
    fn a_pick_as_an_instant_action_is_found_unless_it_is_offered() {
        let pick = [("a", "pick")];
        assert_eq!(judge(&pick, &[("a", "RUNNING")], 1.0), ["ACT-10"]);
        assert!(judge(&pick, &[("a", "FAILED")], 1.0).is_empty());
        let mut trace = Trace::subscriber();
        let offered = json!([{ "actionType": "pick", "actionScopes": ["INSTANT"] }]);
        trace.message("factsheet", &json!({ "protocolFeatures": { "agvActions": offered } }));
        trace.state(&json!({}));
        sends(&mut trace, &pick);
        trace.state(&lists(&[("a", "RUNNING")]));
        assert!(trace.judge("instant/scope").findings.is_empty());
    }
}
