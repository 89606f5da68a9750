//! Why tests decided nothing, cause by cause: many undecided tests often have one reason.
//!
//! A group is found in the reasons the tests give. What differs from run to run in them, such as numbers of messages
//! and ids, does not tell causes apart; the error that the vehicle itself reports, or the step where they stopped, does.

use std::collections::BTreeMap;

use super::advice::remedy;
use super::clean::{line, short};
use super::statement::{self, many};
use tck_base::verdict::Verdict;
use tck_journal::Reason;
use tck_result::{RunResult, TestResult};

/// How many tests of a group are named.
const NAMED: usize = 4;

/// Undecided tests with one cause.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group<'a> {
    /// The reason as the first of them gives it.
    pub reason: &'a str,
    /// Of which kind that is, where more than the text tells.
    pub cause: Option<&'a Reason>,
    /// The ids of the tests, in the order they ran.
    pub tests: Vec<&'a str>,
}

impl Group<'_> {
    /// The first tests by name, and how many more there are. Clean, but not escaped for a format.
    #[must_use]
    pub fn named(&self) -> String {
        let first: Vec<&str> = self.tests.iter().take(NAMED).copied().collect();
        let more = self.tests.len().saturating_sub(NAMED);
        let first = line(&first.join(", ")).into_owned();
        match more {
            0 => first,
            _ => format!("{first} and {more} more"),
        }
    }

    /// What to do about it; the reason itself when only looking at the device helps.
    #[must_use]
    pub fn advice(&self) -> String {
        self.cause.and_then(remedy).unwrap_or_else(|| self.reason.to_owned())
    }

    /// The reason in one line. Clean, but not escaped for a format.
    #[must_use]
    pub fn cause(&self) -> String {
        short(&line(self.reason), 240).into_owned()
    }

    /// How many tests there are, in words.
    #[must_use]
    pub fn count(&self) -> String {
        many(self.tests.len(), "test")
    }
}

/// The undecided tests by their causes, the largest group first.
#[must_use]
pub fn groups(result: &RunResult) -> Vec<Group<'_>> {
    of_tests(&result.tests)
}

fn of_tests(tests: &[TestResult]) -> Vec<Group<'_>> {
    let mut groups: Vec<(Key<'_>, Group<'_>)> = Vec::new();
    // What stopped the first test whose precondition stands at a place.
    let mut missed: BTreeMap<&str, Key<'_>> = BTreeMap::new();
    for test in tests {
        if statement::test_verdict(test) != Some(Verdict::Inconclusive) {
            continue;
        }
        let Some(reason) = reason(test) else { continue };
        let cause = test.cause.as_ref();
        let key = match cause {
            Some(Reason::SetAside { place, .. }) => missed.get(place.as_str()).cloned().unwrap_or(Key::Place(place)),
            Some(cause) => Key::of(cause),
            None => Key::of_words(reason),
        };
        if let Some(Reason::PreconditionMissed { place, .. }) = cause {
            missed.entry(place).or_insert_with(|| key.clone());
        }
        match groups.iter_mut().find(|(known, _)| *known == key) {
            Some((_, group)) => group.tests.push(&test.id),
            None => groups.push((
                key,
                Group {
                    reason,
                    cause,
                    tests: vec![&test.id],
                },
            )),
        }
    }
    let mut groups: Vec<Group<'_>> = groups.into_iter().map(|(_, group)| group).collect();
    groups.sort_by_key(|group| std::cmp::Reverse(group.tests.len()));
    groups
}

fn reason(test: &TestResult) -> Option<&str> {
    let undecided = || {
        let mut decisions = test.decisions.iter();
        let first = decisions.find(|decision| decision.verdict() == Verdict::Inconclusive);
        first.map(|decision| decision.message.as_str())
    };
    test.reason.as_deref().or_else(undecided)
}

/// What tells a cause from others.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Key<'a> {
    /// The vehicle itself reports this error.
    Error(&'a str),
    /// A precondition that several tests share was not reached.
    Place(&'a str),
    /// These words of the reason, without those that differ from run to run.
    Words(String),
}

impl<'a> Key<'a> {
    fn of(cause: &'a Reason) -> Self {
        match cause {
            Reason::PreconditionMissed {
                place, shared, errors, ..
            } => match errors.first() {
                Some(own) => Self::Error(&own.error),
                None if *shared => Self::Place(place),
                None => Self::of_words(&cause.to_string()),
            },
            Reason::SetAside { place, .. } => Self::Place(place),
            _ => Self::of_words(&cause.to_string()),
        }
    }

    /// Numbers of messages and ids do not tell causes apart.
    fn of_words(reason: &str) -> Self {
        let words = reason.split_whitespace();
        let steady = words.filter(|word| !word.contains(|character: char| character.is_ascii_digit()));
        Self::Words(steady.collect::<Vec<_>>().join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_journal::OwnError;

    fn missed(place: &str, shared: bool, seen: &str, errors: &[&str]) -> Reason {
        let errors = errors.iter().map(|error| OwnError {
            error: (*error).to_owned(),
            references: vec![format!("nodeId {seen}")],
        });
        Reason::PreconditionMissed {
            step: "It rests".to_owned(),
            place: place.to_owned(),
            shared,
            seen: seen.to_owned(),
            errors: errors.collect(),
        }
    }

    /// The tests of each group, by the number of their cause.
    fn grouped(causes: &[Reason]) -> Vec<Vec<usize>> {
        let test = |(at, cause): (usize, &Reason)| {
            let reason = cause.to_string();
            serde_json::json!({ "id": at.to_string(), "title": "", "verdict": "inconclusive", "seconds": 0.0, "reason": reason,
                "cause": cause, "maturity": "reviewed", "journal": null, "decisions": [], "steps": [] })
        };
        let tests: Vec<TestResult> = causes
            .iter()
            .enumerate()
            .map(|one| serde_json::from_value(test(one)).unwrap())
            .collect();
        let numbers = |group: Group<'_>| group.tests.iter().map(|id| id.parse().unwrap()).collect();
        of_tests(&tests).into_iter().map(numbers).collect()
    }

    #[test]
    fn numbers_of_messages_do_not_tell_causes_apart() {
        let no_state = |mark: u64, order: &str| {
            Reason::observed(format!("no state after #{mark} within 4.0 s names the order {order}"))
        };
        let both = [no_state(12, "51df465c-112-order"), no_state(130, "51df465c-9-order")];
        assert_eq!(grouped(&both), [[0, 1]]);
    }

    #[test]
    fn the_error_of_the_vehicle_is_the_cause_wherever_the_test_stopped() {
        let both = [
            missed("suites/agv/x.yaml:4", false, "no", &["WARNING noRouteError"]),
            missed(
                "suites/agv/y.yaml:9",
                true,
                "never",
                &["WARNING noRouteError", "FATAL x"],
            ),
        ];
        assert_eq!(grouped(&both), [[0, 1]]);
    }

    #[test]
    fn a_shared_precondition_is_one_cause_and_different_ones_are_two() {
        let three = [
            missed("suites/states/carrying.yaml:12", true, "walked FAILED", &[]),
            missed("suites/states/carrying.yaml:12", true, "three states", &[]),
            missed("suites/states/idle.yaml:12", true, "walked FAILED", &[]),
        ];
        assert_eq!(grouped(&three), [vec![0, 1], vec![2]]);
    }

    #[test]
    fn what_was_set_aside_belongs_to_what_stopped_the_others() {
        let place = "suites/agv/a.yaml:7";
        let aside = Reason::SetAside {
            place: place.to_owned(),
            tests: vec!["a".to_owned()],
        };
        let three = [
            missed(place, false, "none matches", &["WARNING blocked"]),
            missed("suites/agv/b.yaml:7", false, "nothing", &[]),
            aside,
        ];
        assert_eq!(grouped(&three), [vec![0, 2], vec![1]]);
    }

    #[test]
    fn each_thing_that_a_factsheet_would_say_is_a_cause() {
        let without = |capability: &str| Reason::NoFactsheet {
            capability: capability.to_owned(),
        };
        let hook = |hook: &str| Reason::NoHook { hook: hook.to_owned() };
        let four = [
            without("action pick"),
            hook("a"),
            without("optional x"),
            without("action pick"),
        ];
        assert_eq!(grouped(&four), [vec![0, 3], vec![1], vec![2]]);
    }

    #[test]
    fn a_group_names_its_first_tests_and_counts_the_others() {
        let group = Group {
            reason: "x",
            cause: None,
            tests: vec!["a", "b", "c", "d", "e", "f"],
        };
        assert_eq!(group.named(), "a, b, c, d and 2 more");
    }
}
