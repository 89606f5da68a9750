use std::collections::{BTreeMap, BTreeSet};

use super::*;
use crate::conditions::{Conditions, What};
use crate::seen::{Seen, Subject, table};

/// The requirement that is followed.
const ID: &str = "A-1";

/// A run in which these tests and monitors (`monitor/…`) decided the requirement.
fn run(firmware: &str, by: &[(&str, Verdict)]) -> SeenRun {
    let is_test = |id: &&str| !id.starts_with("monitor/");
    let tests: BTreeSet<String> = by
        .iter()
        .map(|(id, _)| *id)
        .filter(is_test)
        .map(str::to_owned)
        .collect();
    let worst = by.iter().map(|(_, verdict)| *verdict).reduce(Verdict::join);
    let seen = Seen {
        standing: Some(worst.map_or(Standing::Undecided, Standing::Decided)),
        by: by.iter().map(|(id, verdict)| ((*id).to_owned(), *verdict)).collect(),
        text: None,
    };
    SeenRun {
        subject: Subject {
            manufacturer: "ACME".to_owned(),
            serial_number: "1".to_owned(),
            role: "agv".to_owned(),
            protocol: "x".to_owned(),
            kind: Kind::Run,
        },
        path: String::new(),
        run: None,
        started: String::new(),
        command: Vec::new(),
        verdict: worst,
        partial: None,
        selection: false,
        root: String::new(),
        has_report: false,
        conditions: Conditions::of_audit(firmware, "tap"),
        tables: tests.iter().map(|id| table(id).to_owned()).collect(),
        tests,
        flaky: BTreeSet::new(),
        requirements: BTreeMap::from([(ID.to_owned(), seen)]),
        order: vec![ID.to_owned()],
    }
}

fn state(runs: &[SeenRun]) -> State {
    follow(ID, runs).state
}

use Verdict::{Fail, Inconclusive, Pass, Warning};

#[test]
fn a_failure_has_a_beginning_and_what_lies_before_it() {
    let runs = [
        run("1", &[("t", Pass)]),
        run("1", &[("t", Pass)]),
        run("2", &[("t", Fail)]),
        run("2", &[("t", Inconclusive)]),
        run("3", &[("t", Fail)]),
    ];
    let course = follow(ID, &runs);
    assert_eq!(
        (course.state, course.since, course.kept_in, course.last),
        (State::Fails, Some(3), Some(2), Some(5))
    );
    let changes: Vec<(What, &str)> = course
        .changes
        .iter()
        .map(|change| (change.what, change.after.as_deref().unwrap_or_default()))
        .collect();
    assert_eq!(changes, [(What::Tool, "2")]);
    assert_eq!(course.by, ["t"]);
    let always = follow(ID, &runs[2..]);
    assert_eq!((always.since, always.kept_in, always.changes.len()), (Some(1), None, 0));
}

#[test]
fn only_what_found_a_failure_takes_it_back() {
    // Another test passes: the failure is not mended, only not looked for.
    assert_eq!(
        state(&[run("1", &[("t", Fail)]), run("2", &[("u", Pass)])]),
        State::Unseen
    );
    assert_eq!(state(&[run("1", &[("t", Fail)]), run("2", &[])]), State::Unseen);
    assert_eq!(
        state(&[run("1", &[("t[1]", Fail)]), run("2", &[("t[2]", Pass)])]),
        State::Unseen
    );
    assert_eq!(
        state(&[run("1", &[("t", Fail)]), run("2", &[("t", Warning)])]),
        State::Warns
    );
    let runs = [
        run("1", &[("t", Fail), ("u", Fail)]),
        run("2", &[("t", Pass)]),
        run("3", &[("t", Pass), ("u", Pass)]),
        run("3", &[("u", Pass)]),
    ];
    assert_eq!(state(&runs[..2]), State::Unseen);
    let course = follow(ID, &runs);
    assert_eq!(
        (course.state, course.fixed_in, course.last),
        (State::Fixed, Some(3), Some(1))
    );
}

#[test]
fn a_monitor_takes_back_only_what_it_could_have_seen() {
    let broken = run("1", &[("a", Pass), ("b[1]", Pass), ("monitor/m", Fail)]);
    assert_eq!(
        state(&[broken.clone(), run("2", &[("a", Pass), ("monitor/m", Pass)])]),
        State::Unseen
    );
    let mut mended = run("2", &[("a", Pass), ("b[2]", Pass), ("monitor/m", Pass)]);
    assert_eq!(state(&[broken.clone(), mended.clone()]), State::Fixed);
    mended.partial = Some("interrupted".to_owned());
    assert_eq!(state(&[broken.clone(), mended]), State::Unseen);
    // A recording has no tests, and is what it is.
    let mut audits = [broken, run("1", &[("monitor/m", Pass)])];
    for audit in &mut audits {
        audit.subject.kind = Kind::Audit;
        audit.tests.clear();
        audit.tables.clear();
    }
    assert_eq!(state(&audits), State::Fixed);
}

#[test]
fn a_verdict_that_turns_twice_under_the_same_conditions_is_flaky() {
    let turns = |firmware: [&str; 3], verdicts: [Verdict; 3]| {
        let runs: Vec<SeenRun> = firmware
            .into_iter()
            .zip(verdicts)
            .map(|(firmware, verdict)| run(firmware, &[("t", verdict)]))
            .collect();
        follow(ID, &runs)
    };
    let course = turns(["1", "1", "1"], [Pass, Fail, Pass]);
    assert_eq!(course.state, State::Flaky);
    assert_eq!(course.flaky.map(|flaky| flaky.runs), Some(vec![1, 2, 3]));
    // Somebody may have forgotten to name the new firmware, once.
    assert_eq!(turns(["1", "1", "1"], [Pass, Pass, Fail]).state, State::Fails);
    assert_eq!(turns(["1", "2", "2"], [Pass, Fail, Pass]).state, State::Fixed);
    assert_eq!(turns(["1", "1", "1"], [Fail, Pass, Fail]).state, State::Flaky);
    // What was flaky, and does not turn any more with a new firmware, is fixed.
    let mut runs = vec![
        run("1", &[("t", Pass)]),
        run("1", &[("t", Fail)]),
        run("1", &[("t", Pass)]),
    ];
    runs.push(run("2", &[("t", Pass)]));
    assert_eq!(state(&runs), State::Fixed);
    // Repetitions of one run that differ need no second run.
    let mut repeated = run("1", &[("t", Fail)]);
    repeated.flaky.insert("t".to_owned());
    assert_eq!(state(&[repeated]), State::Flaky);
    // Where other tests ran, a monitor has seen something else.
    let with = |others: &str, verdict: Verdict| run("1", &[(others, Pass), ("monitor/m", verdict)]);
    let runs = [with("a", Pass), with("b", Fail), with("a", Pass), with("a", Fail)];
    assert_eq!(state(&runs), State::Fails);
}

#[test]
fn what_is_decided_no_more_is_lost_and_a_run_of_less_loses_nothing() {
    let mut runs = [run("1", &[("t", Pass)]), run("1", &[])];
    assert_eq!(state(&runs), State::Lost);
    runs[1].selection = true;
    assert_eq!(state(&runs), State::Keeps);
    runs[1].selection = false;
    runs[1].partial = Some("interrupted".to_owned());
    assert_eq!(state(&runs), State::Keeps);
    assert_eq!(state(&[run("1", &[])]), State::Open);
    let warns = follow(
        ID,
        &[
            run("1", &[("t", Pass)]),
            run("2", &[("t", Warning)]),
            run("2", &[("t", Warning)]),
        ],
    );
    assert_eq!(
        (warns.state, warns.since, warns.changes.len()),
        (State::Warns, Some(2), 1)
    );
}
