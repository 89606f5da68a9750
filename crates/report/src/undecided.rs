//! Why tests decided nothing, cause by cause: many undecided tests often have one reason.
//!
//! A group is found in the reasons the tests give. What differs from run to run in them, such as numbers of messages
//! and ids, does not tell causes apart; the error that the vehicle itself reports, or the step where they stopped, does.

use super::clean::{line, short};
use super::statement::{self, many};
use tck_base::verdict::Verdict;
use tck_result::{RunResult, TestResult};

/// Shared preconditions stand in this folder of the suites.
const SHARED: &str = "suites/states/";
/// What the judge writes before the vehicle's own error.
const OWN: &str = "the vehicle itself reports ";
/// How many tests of a group are named.
const NAMED: usize = 4;

/// Undecided tests with one cause.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group<'a> {
    /// The reason as the first of them gives it.
    pub reason: &'a str,
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
    let mut groups: Vec<(String, Group<'_>)> = Vec::new();
    for test in &result.tests {
        if statement::test_verdict(test) != Some(Verdict::Inconclusive) {
            continue;
        }
        let Some(reason) = reason(test) else { continue };
        let cause = cause(reason, &groups);
        match groups.iter_mut().find(|(known, _)| *known == cause) {
            Some((_, group)) => group.tests.push(&test.id),
            None => groups.push((
                cause,
                Group {
                    reason,
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

/// What tells this reason from others.
fn cause(reason: &str, known: &[(String, Group<'_>)]) -> String {
    if let Some(aside) = reason.strip_prefix("set aside: the precondition at ") {
        let place = aside.split(' ').next().unwrap_or(aside);
        let same = known.iter().find(|(_, group)| group.reason.contains(place));
        return same.map_or_else(|| place.to_owned(), |(cause, _)| cause.clone());
    }
    if let Some((_, own)) = reason.rsplit_once(OWN) {
        return own.split(" (").next().unwrap_or(own).to_owned();
    }
    if let Some((_, shared)) = reason.split_once(SHARED) {
        return shared.split([')', ' ']).next().unwrap_or(shared).to_owned();
    }
    let words = reason.split_whitespace();
    let steady = words.filter(|word| !word.contains(|character: char| character.is_ascii_digit()));
    steady.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn causes(reasons: &[&str]) -> Vec<String> {
        reasons.iter().map(|reason| cause(reason, &[])).collect()
    }

    #[test]
    fn numbers_of_messages_do_not_tell_causes_apart() {
        let both = causes(&[
            "no state after #12 within 4.0 s names the order 51df465c-112-order",
            "no state after #130 within 31.0 s names the order 51df465c-9-order",
        ]);
        assert_eq!(both[0], both[1]);
    }

    #[test]
    fn the_error_of_the_vehicle_is_the_cause_wherever_the_test_stopped() {
        let both = causes(&[
            "the precondition was not reached: a (suites/agv/x.yaml:4): no; the vehicle itself reports WARNING noRouteError (mapId x)",
            "the precondition was not reached: b (suites/agv/y.yaml:9): no; the vehicle itself reports WARNING noRouteError (mapId y)",
        ]);
        assert_eq!(both[0], both[1]);
    }

    #[test]
    fn a_shared_precondition_is_one_cause_and_different_ones_are_two() {
        let three = causes(&[
            "the precondition was not reached: given[0]/carrying[2] (suites/states/carrying.yaml:12): walked FAILED",
            "the precondition was not reached: given[1]/carrying[2] (suites/states/carrying.yaml:12): 3 states",
            "the precondition was not reached: given[0]/idle[1] (suites/states/idle.yaml:12): walked FAILED",
        ]);
        assert_eq!(three[0], three[1]);
        assert_ne!(three[0], three[2]);
    }

    #[test]
    fn each_thing_that_a_factsheet_would_say_is_a_cause() {
        let two = causes(&[
            "there is no factsheet that could say whether it has: action pick NODE",
            "there is no factsheet that could say whether it has: action stateRequest INSTANT",
        ]);
        assert_ne!(two[0], two[1]);
    }

    #[test]
    fn what_was_set_aside_belongs_to_what_stopped_the_others() {
        let first = Group {
            reason: "the precondition was not reached: It rests (suites/agv/a.yaml:7): none matches",
            tests: vec!["a"],
        };
        let known = [("key".to_owned(), first)];
        let aside = "set aside: the precondition at suites/agv/a.yaml:7 was not reached in a, b, c";
        assert_eq!(cause(aside, &known), "key");
    }

    #[test]
    fn a_group_names_its_first_tests_and_counts_the_others() {
        let group = Group {
            reason: "x",
            tests: vec!["a", "b", "c", "d", "e", "f"],
        };
        assert_eq!(group.named(), "a, b, c, d and 2 more");
    }
}
