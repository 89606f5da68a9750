//! What is put together: the repetitions of a test, and a run with the one that it goes on with.

use std::collections::BTreeMap;

use super::monitor_set::MonitorReport;
use tck_base::verdict::Verdict;
use tck_journal::Reason;
use tck_result::{Repetition, TestResult};

/// One result for each test. Of several repetitions the worst stands for the test; what any of them decided beside counts,
/// too: a fail is not taken back by a pass that comes later.
pub(super) fn repetitions(done: &[TestResult]) -> Vec<TestResult> {
    let mut all: Vec<TestResult> = Vec::new();
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    for result in done {
        match places.get(result.id.as_str()) {
            Some(place) => both(&mut all[*place], result),
            None => {
                places.insert(&result.id, all.len());
                all.push(result.clone());
            }
        }
    }
    all
}

/// Puts another run of a test into its result.
pub(super) fn both(one: &mut TestResult, other: &TestResult) {
    let mut repetitions: Vec<Repetition> = std::mem::take(&mut one.repetitions);
    repetitions.extend(other.repetitions.iter().cloned());
    let mut rest = other;
    let better;
    if other.verdict > one.verdict {
        better = std::mem::replace(one, other.clone());
        rest = &better;
    }
    for decision in &rest.decisions {
        let same = |known: &&mut tck_result::Decision| {
            known.requirement == decision.requirement && known.clause == decision.clause
        };
        match one.decisions.iter_mut().find(same) {
            Some(known) if known.verdict() < decision.verdict() => *known = decision.clone(),
            Some(_) => {}
            None => one.decisions.push(decision.clone()),
        }
    }
    one.repetitions = repetitions;
}

/// Adds the repetitions of a test that were asked for and not done: each is inconclusive, and with it the test.
pub(super) fn left_out(test: &mut TestResult, asked: u32, cause: Option<&Reason>) {
    let why = cause.map_or_else(|| "the run ended before".to_owned(), ToString::to_string);
    let done = test.repetitions.len();
    let missing: Vec<u32> = (1..=asked)
        .filter(|number| test.repetitions.iter().all(|one| one.number != *number))
        .collect();
    if missing.is_empty() {
        return;
    }
    test.repetitions.extend(missing.into_iter().map(|number| Repetition {
        number,
        verdict: Some(Verdict::Inconclusive),
        seconds: 0.0,
        reason: Some(why.clone()),
        journal: None,
    }));
    test.repetitions.sort_by_key(|one| one.number);
    let verdict = test
        .verdict
        .map_or(Verdict::Inconclusive, |verdict| verdict.join(Verdict::Inconclusive));
    if test.verdict != Some(verdict) {
        test.verdict = Some(verdict);
        test.reason = Some(format!("run {done} of {asked} times: {why}"));
        test.cause = cause.cloned();
    }
}

/// Whether a run that goes on with another one need not run a test again. A fail stands on its evidence, though the test
/// may have been broken off.
pub(super) fn is_decided(test: &TestResult) -> bool {
    matches!(test.verdict, Some(Verdict::Pass | Verdict::Warning | Verdict::Fail))
}

/// The tests of a run and of the one that it goes on with: what was decided is kept, everything else is as it is now.
pub(super) fn tests(before: Vec<TestResult>, now: Vec<TestResult>) -> Vec<TestResult> {
    let mut all: Vec<TestResult> = Vec::new();
    for test in before {
        match now.iter().find(|other| other.id == test.id) {
            Some(again) if is_decided(&test) => {
                let mut joined = test;
                both(&mut joined, again);
                all.push(joined);
            }
            Some(_) => {}
            None => all.push(test),
        }
    }
    let known: Vec<String> = all.iter().map(|test| test.id.clone()).collect();
    all.extend(now.into_iter().filter(|test| !known.contains(&test.id)));
    all
}

/// What monitors found in a run and in the one that it goes on with.
pub(super) fn watched(mut before: Vec<MonitorReport>, now: Vec<MonitorReport>) -> Vec<MonitorReport> {
    for watched in now {
        match before.iter_mut().find(|known| known.result.id == watched.result.id) {
            Some(known) => known.go_on(watched),
            None => before.push(watched),
        }
    }
    before
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_result::Decision;

    fn run(number: u32, verdict: Verdict, decisions: &[(&str, Verdict)]) -> TestResult {
        let decisions = decisions.iter().map(|(requirement, verdict)| {
            let clause = format!("steps[0].{requirement}");
            Decision::new(requirement, *verdict, clause, "file:1".to_owned(), number.to_string())
        });
        TestResult {
            id: "a/b".to_owned(),
            title: "Title".to_owned(),
            verdict: Some(verdict),
            not_applicable: None,
            seconds: 1.0,
            reason: None,
            cause: None,
            maturity: "reviewed".to_owned(),
            maturity_note: None,
            journal: Some((u64::from(number), u64::from(number))),
            decisions: decisions.collect(),
            steps: Vec::new(),
            allowances: Vec::new(),
            repetitions: vec![Repetition {
                number,
                verdict: Some(verdict),
                seconds: 1.0,
                reason: None,
                journal: Some((u64::from(number), u64::from(number))),
            }],
        }
    }

    fn verdicts(test: &TestResult) -> Vec<(&str, Verdict)> {
        let decisions = test.decisions.iter();
        decisions.map(|one| (one.requirement.as_str(), one.verdict())).collect()
    }

    #[test]
    fn the_worst_repetition_stands_for_the_test_and_nothing_that_was_found_is_lost() {
        let pass = run(1, Verdict::Pass, &[("A", Verdict::Pass), ("B", Verdict::Pass)]);
        let fail = run(2, Verdict::Fail, &[("A", Verdict::Fail)]);
        let warned = run(3, Verdict::Warning, &[("A", Verdict::Pass), ("B", Verdict::Warning)]);
        let expected = [("A", Verdict::Fail), ("B", Verdict::Warning)];
        for order in [
            [&pass, &fail, &warned],
            [&fail, &warned, &pass],
            [&warned, &pass, &fail],
        ] {
            let joined = repetitions(&order.map(Clone::clone));
            assert_eq!(joined.len(), 1);
            assert_eq!(
                (joined[0].verdict, joined[0].journal),
                (Some(Verdict::Fail), Some((2, 2)))
            );
            assert_eq!(verdicts(&joined[0]), expected);
            assert!(joined[0].is_flaky() && joined[0].repetitions.len() == 3);
        }
        assert!(!repetitions(&[pass.clone(), run(2, Verdict::Pass, &[])])[0].is_flaky());
    }

    #[test]
    fn a_repetition_that_was_not_done_leaves_the_test_undecided_and_takes_no_failure_back() {
        let mut passed = run(1, Verdict::Pass, &[("A", Verdict::Pass)]);
        left_out(&mut passed, 3, Some(&Reason::NoTap));
        assert_eq!(passed.verdict, Some(Verdict::Inconclusive));
        assert_eq!(
            passed.reason.as_deref(),
            Some("run 1 of 3 times: it needs the device to connect through the tap")
        );
        let done: Vec<bool> = passed.repetitions.iter().map(Repetition::was_done).collect();
        assert_eq!(
            (done, passed.left_out(), passed.is_flaky()),
            (vec![true, false, false], 2, false)
        );
        assert!(!is_decided(&passed), "a run that goes on with this one does them");
        let mut failed = run(2, Verdict::Fail, &[("A", Verdict::Fail)]);
        left_out(&mut failed, 2, None);
        assert_eq!((failed.verdict, failed.repetitions[0].number), (Some(Verdict::Fail), 1));
        left_out(&mut failed, 2, None);
        assert_eq!(failed.left_out(), 1);
    }

    #[test]
    fn what_was_decided_before_is_kept_and_everything_else_is_as_it_is_now() {
        let before = run(1, Verdict::Inconclusive, &[("A", Verdict::Inconclusive)]);
        let now = run(2, Verdict::Pass, &[("A", Verdict::Pass)]);
        assert_eq!(tests(vec![before], vec![now.clone()])[0].verdict, Some(Verdict::Pass));
        let failed = run(1, Verdict::Fail, &[("A", Verdict::Fail)]);
        assert_eq!(tests(vec![failed.clone()], vec![now])[0].verdict, Some(Verdict::Fail));
        assert_eq!(tests(vec![failed], Vec::new()).len(), 1);
    }
}
