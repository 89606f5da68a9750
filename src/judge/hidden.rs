//! What a broken report hides.
//!
//! A state that forgets the name of its order, or leaves out actions that are done, cannot show what most tests wait
//! for. The vehicle is guilty of that, once; whether it did what it was told could not be observed. A monitor names
//! the members it speaks for under `hides:`, and what was missed there is inconclusive in the tests it found something
//! in. Which monitors do so is data.

use crate::report::result::{Decision, StepResult};
use crate::verdict::Verdict;

/// A member of the state that shows nothing in a test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Hidden {
    /// The member.
    pub member: String,
    /// Who found it.
    pub monitor: String,
    /// What is broken.
    pub requirement: String,
    /// The requirements of the monitor, which are decided all the same.
    pub decides: Vec<String>,
    /// The entry that showed it first in this test.
    pub seq: u64,
    /// It is known from before this test: where the member shows nothing, it shows nothing in any message.
    pub lasting: bool,
}

impl Hidden {
    /// Whether this was waited for in vain where nothing is shown. A step that is about the member is decided all the
    /// same, and so is what a message shows that did come.
    fn hides(&self, decision: &Decision, about: &[&str], steps: &[StepResult]) -> bool {
        let (Some(nearest), Some(step)) = (&decision.nearest, step_of(decision, steps)) else {
            return false;
        };
        let member = nearest.path.split(['.', '[']).next();
        let shows_nothing = self.lasting && matches!(nearest.found.as_str(), "\"\"" | "0" | "nothing");
        let in_vain = decision.witness.is_none() || step.verb.starts_with("action") || shows_nothing;
        matches!(decision.verdict, Verdict::Fail | Verdict::Warning)
            && in_vain
            && member == Some(self.member.as_str())
            && !self.decides.iter().any(|id| about.contains(&id.as_str()))
            && step.journal.is_some_and(|(_, end)| self.seq <= end)
    }
}

fn step_of<'s>(decision: &Decision, steps: &'s [StepResult]) -> Option<&'s StepResult> {
    let path = decision.clause.split('.').next()?;
    steps.iter().find(|step| step.path == path)
}

/// Takes back what was decided on members that show nothing; says so in one line if there is any.
pub(super) fn take_back(decisions: &mut [Decision], steps: &[StepResult], hidden: &[Hidden]) -> Option<String> {
    if hidden.is_empty() {
        return None;
    }
    let mut told = None;
    let ids: Vec<(String, String)> = decisions
        .iter()
        .map(|decision| (decision.clause.clone(), decision.requirement.clone()))
        .collect();
    for decision in decisions {
        let same = ids.iter().filter(|(clause, _)| *clause == decision.clause);
        let about: Vec<&str> = same.map(|(_, id)| id.as_str()).collect();
        let Some(hidden) = hidden.iter().find(|hidden| hidden.hides(decision, &about, steps)) else {
            continue;
        };
        let why = format!(
            "the states do not show `{}` as they must (#{}: {} is broken, found by {})",
            hidden.member, hidden.seq, hidden.requirement, hidden.monitor
        );
        decision.verdict = Verdict::Inconclusive;
        decision.message = format!("cannot be told, since {why}; {}", decision.message);
        told.get_or_insert(why);
    }
    told
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::result::NearestMiss;

    fn decision(requirement: &str, path: &str) -> Decision {
        Decision {
            requirement: requirement.to_owned(),
            verdict: Verdict::Fail,
            clause: "steps[1].checks".to_owned(),
            place: String::new(),
            witness: None,
            message: "nothing came".to_owned(),
            expected: None,
            nearest: Some(NearestMiss {
                seq: 20,
                path: path.to_owned(),
                found: String::new(),
                expected: String::new(),
            }),
            waited: None,
            explanation: None,
            interpretation: None,
        }
    }

    fn verdict(decision: Decision, found: u64) -> Verdict {
        verdicts(&mut [decision], found)
    }

    fn verdicts(decisions: &mut [Decision], found: u64) -> Verdict {
        let steps = [StepResult {
            path: "steps[1]".to_owned(),
            verb: "expect".to_owned(),
            title: None,
            place: String::new(),
            outcome: "failed".to_owned(),
            journal: Some((10, 30)),
            took: None,
            seconds: 0.0,
        }];
        let hidden = [Hidden {
            member: "orderId".to_owned(),
            monitor: "state/order-kept".to_owned(),
            requirement: "STATE-MSG-02".to_owned(),
            decides: vec!["STATE-MSG-02".to_owned()],
            seq: found,
            lasting: false,
        }];
        take_back(decisions, &steps, &hidden);
        decisions[0].verdict
    }

    #[test]
    fn what_was_missed_where_nothing_is_shown_is_inconclusive() {
        assert_eq!(verdict(decision("ORD-06", "orderId"), 15), Verdict::Inconclusive);
        assert_eq!(verdict(decision("ORD-06", "orderId[0].x"), 15), Verdict::Inconclusive);
    }

    #[test]
    fn anything_else_stays_as_it_was_decided() {
        assert_eq!(verdict(decision("ORD-06", "lastNodeId"), 15), Verdict::Fail);
        assert_eq!(verdict(decision("STATE-MSG-02", "orderId"), 15), Verdict::Fail);
        assert_eq!(verdict(decision("ORD-06", "orderId"), 31), Verdict::Fail);
        let came = Decision {
            witness: Some(20),
            ..decision("ORD-06", "orderId")
        };
        assert_eq!(verdict(came, 15), Verdict::Fail);
    }

    #[test]
    fn a_step_about_the_member_itself_is_decided() {
        let mut step = [decision("MQTT-10", "orderId"), decision("STATE-MSG-02", "orderId")];
        assert_eq!(verdicts(&mut step, 15), Verdict::Fail);
    }
}
