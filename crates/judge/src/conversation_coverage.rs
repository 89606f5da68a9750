//! What came of every stimulus of the conversations in a run.
//!
//! Of each conversation the first failure counts, because what comes behind may follow from it.

use std::collections::BTreeMap;
use std::sync::Arc;

use tck_base::verdict::Verdict;
use tck_pack::Role;
use tck_result::{Answers, Decision, ExplorationResult, MemberResult, SaidResult, StepResult, TestResult};
use tck_suite::model::{ConversationPart, Test, place_in_body};

/// What came of one stimulus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    AsDemanded,
    Broken,
    Undecided,
}

/// The conversations among these tests, counted; `None` when there is none.
pub(super) fn exploration(tests: &[Arc<Test>], results: &[TestResult], role: Role) -> Option<ExplorationResult> {
    let conversations: BTreeMap<&str, &Test> = tests
        .iter()
        .filter(|test| test.device == role && !test.conversation.is_empty())
        .map(|test| (test.id.as_str(), test.as_ref()))
        .collect();
    let mut said: BTreeMap<(&str, &str), Answers> = BTreeMap::new();
    let mut members: BTreeMap<(&str, &str, &str), Answers> = BTreeMap::new();
    for result in results {
        let Some(test) = conversations.get(result.id.as_str()) else {
            continue;
        };
        for (one, answer) in answers(&test.conversation, result) {
            count(
                said.entry((one.situation.as_str(), one.stimulus.as_str())).or_default(),
                answer,
            );
            if let Some(broken) = &one.broken {
                let key = (one.stimulus.as_str(), broken.member.as_str(), broken.way.as_str());
                count(members.entry(key).or_default(), answer);
            }
        }
    }
    let said = said.into_iter().map(|((situation, stimulus), answers)| SaidResult {
        situation: situation.to_owned(),
        stimulus: stimulus.to_owned(),
        answers,
    });
    let members = members
        .into_iter()
        .map(|((stimulus, member, way), answers)| MemberResult {
            stimulus: stimulus.to_owned(),
            member: member.to_owned(),
            way: way.to_owned(),
            answers,
        });
    let result = ExplorationResult {
        said: said.collect(),
        members: members.collect(),
    };
    (!result.said.is_empty()).then_some(result)
}

fn count(answers: &mut Answers, answer: Answer) {
    match answer {
        Answer::AsDemanded => answers.as_demanded += 1,
        Answer::Broken => answers.broken += 1,
        Answer::Undecided => answers.undecided += 1,
    }
}

/// What came of the stimuli that were said, up to the first that was not answered as demanded.
fn answers<'a>(conversation: &'a [ConversationPart], result: &TestResult) -> Vec<(&'a ConversationPart, Answer)> {
    let mut all = Vec::new();
    let mut first = 0;
    for one in conversation {
        let own = first..first + one.steps;
        first = own.end;
        let is_own = |path: &str| place_in_body(path).is_some_and(|at| own.contains(&at));
        let decisions = result.decisions.iter().filter(|one| is_own(&one.clause));
        let verdicts: Vec<Verdict> = decisions.map(Decision::verdict).collect();
        let mut steps = result.steps.iter().filter(|step| is_own(&step.path)).peekable();
        match steps.peek() {
            // This protocol version has none of its steps.
            None => continue,
            Some(step) if step.outcome == StepResult::NOT_RUN => break,
            Some(_) => {}
        }
        let is_done = steps.all(|step| step.outcome == StepResult::DONE);
        let answer = if verdicts.contains(&Verdict::Fail) || verdicts.contains(&Verdict::Warning) {
            Answer::Broken
        } else if is_done && verdicts.iter().all(|verdict| *verdict == Verdict::Pass) {
            Answer::AsDemanded
        } else {
            Answer::Undecided
        };
        all.push((one, answer));
        let is_over = answer == Answer::Broken || (answer == Answer::Undecided && !one.stays);
        if is_over {
            break;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(stimulus: &str, steps: usize) -> ConversationPart {
        ConversationPart {
            situation: "rest".to_owned(),
            stimulus: stimulus.to_owned(),
            broken: None,
            steps,
            stays: false,
        }
    }

    fn step(at: usize, outcome: &str) -> StepResult {
        StepResult {
            path: format!("steps[{at}]"),
            verb: "expect state".to_owned(),
            title: None,
            place: format!("conversation.yaml:{at}"),
            outcome: outcome.to_owned(),
            journal: None,
            took: None,
            seconds: 0.0,
        }
    }

    fn result(steps: Vec<StepResult>, decisions: &[(usize, Verdict)]) -> TestResult {
        let decisions = decisions.iter().map(|(at, verdict)| {
            let clause = format!("steps[{at}].checks");
            Decision::new("ORD-04", *verdict, clause, String::new(), String::new())
        });
        TestResult {
            id: "explore/one".to_owned(),
            title: String::new(),
            verdict: None,
            not_applicable: None,
            seconds: 0.0,
            reason: None,
            cause: None,
            maturity: String::new(),
            maturity_note: None,
            journal: Some((1, 2)),
            decisions: decisions.collect(),
            steps,
            allowances: Vec::new(),
            repetitions: Vec::new(),
        }
    }

    fn words(conversation: &[ConversationPart], result: &TestResult) -> Vec<(String, Answer)> {
        let all = answers(conversation, result).into_iter();
        all.map(|(said, answer)| (said.stimulus.clone(), answer)).collect()
    }

    #[test]
    fn what_comes_behind_the_first_failure_is_not_counted() {
        let conversation = [said("order", 2), said("cancel", 1), said("ask", 1)];
        let steps = (0..4).map(|at| step(at, StepResult::DONE)).collect();
        let failed = result(steps, &[(1, Verdict::Pass), (2, Verdict::Fail), (3, Verdict::Pass)]);
        let expected = [
            ("order".to_owned(), Answer::AsDemanded),
            ("cancel".to_owned(), Answer::Broken),
        ];
        assert_eq!(words(&conversation, &failed), expected);
    }

    #[test]
    fn what_broke_off_is_undecided_and_what_was_not_reached_is_not_counted() {
        let conversation = [said("order", 2), said("cancel", 1)];
        let steps = vec![
            step(0, StepResult::DONE),
            step(1, "failed"),
            step(2, StepResult::NOT_RUN),
        ];
        let broken_off = result(steps, &[(2, Verdict::Inconclusive)]);
        assert_eq!(
            words(&conversation, &broken_off),
            [("order".to_owned(), Answer::Undecided)]
        );
    }

    #[test]
    fn a_refused_stimulus_that_changes_nothing_does_not_end_the_conversation() {
        let mut conversation = [said("cancel", 2), said("ask", 1)];
        conversation[0].stays = true;
        let steps = vec![
            step(0, "failed"),
            step(1, StepResult::NOT_RUN),
            step(2, StepResult::DONE),
        ];
        let refused = result(steps, &[(2, Verdict::Pass)]);
        let expected = [
            ("cancel".to_owned(), Answer::Undecided),
            ("ask".to_owned(), Answer::AsDemanded),
        ];
        assert_eq!(words(&conversation, &refused), expected);
    }

    #[test]
    fn a_stimulus_whose_steps_this_version_does_not_have_is_passed_over() {
        let conversation = [said("map", 1), said("order", 1)];
        let rest = result(vec![step(1, StepResult::DONE)], &[(1, Verdict::Pass)]);
        assert_eq!(words(&conversation, &rest), [("order".to_owned(), Answer::AsDemanded)]);
    }
}
