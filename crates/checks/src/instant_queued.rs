//! `instant/not-queued`: what is only asked for does not wait until something else is done.
//!
//! What waits although nothing else is under way is found by `instant/begins`.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::finding::{broken, quote, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Topic};

/// How many actions are kept in mind, and how many of a state are looked at.
const ACTIONS: usize = 256;
/// Who waited less may just have been slow.
const WAITED: Duration = Duration::from_millis(500);

/// What is only asked for does not wait until something else is done.
pub(super) const NOT_QUEUED: Check = Check {
    name: "instant/not-queued",
    decides: &["IACT-05"],
    doc: "A stateRequest, factsheetRequest or logReport waits for no other action: found when two of them, of two messages, \
          are WAITING until the very state that ends an action which was under way all the while, and one of them had been \
          WAITING in several states for half a second and more; one alone is a warning.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::action_states],
    start: |_| Box::new(NotQueued::default()),
};

struct Asked {
    message: u64,
    kind: String,
    /// Since when it is WAITING, in how many states, and what was under way in all of them.
    since: Option<Moment>,
    states: u32,
    others: BTreeSet<String>,
}

#[derive(Default)]
struct NotQueued {
    /// By actionId.
    asked: BTreeMap<String, Asked>,
    told: bool,
}

impl NotQueued {
    fn learn(&mut self, record: &Observation<'_>) {
        let Some(message) = record.instant_actions_to_vehicle() else {
            return;
        };
        for action in message.all_actions().take(ACTIONS) {
            let kind = action.action_type.or_empty();
            if !matches!(kind, "stateRequest" | "factsheetRequest" | "logReport") {
                continue;
            }
            if self.asked.len() >= ACTIONS {
                self.asked.pop_first();
            }
            let asked = Asked {
                message: record.seq(),
                kind: kind.to_owned(),
                since: None,
                states: 0,
                others: BTreeSet::new(),
            };
            self.asked.insert(action.action_id.or_empty().to_owned(), asked);
        }
    }
}

impl Running for NotQueued {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.learn(record);
        let restarted = context.world.restarts().now(record);
        if restarted || record.link.disturbed || record.outside_influence() {
            self.asked.clear();
        }
        if self.asked.is_empty() {
            return false;
        }
        let Some(state) = record.state() else {
            return false;
        };
        let now = record.at().moment;
        let statuses: BTreeMap<&str, &str> = state
            .all_action_states()
            .take(ACTIONS)
            .map(|action| (action.action_id.or_empty(), action.action_status.or_empty()))
            .collect();
        let active = |status: &str| matches!(status, "INITIALIZING" | "RUNNING" | "PAUSED");
        let mut judged = false;
        // What has ended, with those that waited so long: message, how long, and in how many states.
        let mut ended: BTreeMap<String, Vec<(u64, Duration, u32, String)>> = BTreeMap::new();
        let mut over = Vec::new();
        for (id, asked) in &mut self.asked {
            let Some(status) = statuses.get(id.as_str()) else {
                continue;
            };
            judged = true;
            if *status == "WAITING" {
                let others = statuses.iter().filter(|(_, status)| active(status));
                let others: BTreeSet<String> = others.map(|(id, _)| (*id).to_owned()).collect();
                asked.since.get_or_insert(now);
                asked.states += 1;
                if asked.states == 1 {
                    asked.others = others;
                } else {
                    asked.others.retain(|other| others.contains(other));
                }
                continue;
            }
            over.push(id.clone());
            let Some(since) = asked.since else {
                continue;
            };
            let done = |other: &&String| matches!(statuses.get(other.as_str()), Some(&("FINISHED" | "FAILED")));
            for other in asked.others.iter().filter(done) {
                let all = ended.entry(other.clone()).or_default();
                all.push((asked.message, now.since(since), asked.states, asked.kind.clone()));
            }
        }
        for id in over {
            self.asked.remove(&id);
        }
        for (other, waited) in ended {
            let Some((_, took, _, kind)) = waited
                .iter()
                .find(|(_, took, states, _)| *states > 1 && *took >= WAITED)
                .filter(|_| !self.told)
            else {
                continue;
            };
            let messages: BTreeSet<u64> = waited.iter().map(|(message, ..)| *message).collect();
            let text = format!(
                "the instant action {} was WAITING for {:.1} s, until action {} had ended",
                quote(kind),
                took.as_secs_f64(),
                quote(&other)
            );
            self.told = messages.len() > 1;
            findings.push(if self.told {
                broken("IACT-05", record.seq(), text)
            } else {
                remark("IACT-05", record.seq(), text)
            });
        }
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

    /// States show the download and two requests, one letter each, half a second apart.
    fn judge(states: &[&str]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.state(&json!({}));
        trace.instant("downloadMap", "d", &json!([]));
        trace.instant("stateRequest", "a", &json!([]));
        trace.instant("stateRequest", "b", &json!([]));
        for letters in states {
            let status = |(id, letter): (&str, char)| {
                let status = match letter {
                    'W' => "WAITING",
                    'R' => "RUNNING",
                    _ => "FINISHED",
                };
                json!({ "actionId": id, "actionType": "x", "actionStatus": status })
            };
            let all: Vec<Value> = ["d", "a", "b"].into_iter().zip(letters.chars()).map(status).collect();
            trace.wait(0.5).state(&json!({ "actionStates": all }));
        }
        trace.judge("instant/not-queued").summary()
    }

    #[test]
    fn what_is_answered_at_once_or_at_the_next_cycle_is_right() {
        assert!(judge(&["RFF", "FFF"]).is_empty());
        assert!(judge(&["RWW", "FFF"]).is_empty());
        assert!(judge(&["RWW", "RFF", "FFF"]).is_empty());
    }

    #[test]
    fn what_waits_for_a_download_is_found() {
        assert_eq!(judge(&["RWW", "RWW", "FFF"]), ["IACT-05"]);
        assert_eq!(judge(&["RWF", "RWF", "FFF"]), ["IACT-05 warning"]);
    }
}
