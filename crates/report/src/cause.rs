//! One mistake, one finding: which finding follows from which other one. Runs and audits ask here, and nowhere else.
//!
//! A finding follows from another one when it was seen of the same thing (by the same clause or monitor, in the same message, in the
//! same words; or at the same place of the same message, whoever saw it), or when its requirement rests on one that is broken: what a
//! vehicle never took over it can neither drive nor end. On what a requirement rests stands with it in the catalogue (`rests-on`).
//! No verdict changes by it: it says what to mend first.

use std::collections::BTreeSet;

use tck_base::verdict::Verdict;

/// A sighting of something wrong.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Sighting {
    /// The clause of a test, or the monitor.
    pub by: String,
    /// The message that shows it, by its number.
    pub message: Option<u64>,
    /// In which words.
    pub text: String,
}

impl Sighting {
    /// The place of a message that it is about.
    fn spot(&self) -> Option<(u64, &str)> {
        Some((self.message?, place(&self.text)))
    }
}

/// A finding, as far as its cause is asked for.
#[derive(Clone, Debug, Default)]
pub struct Evidence<'a> {
    /// The requirement.
    pub requirement: &'a str,
    /// How bad.
    pub verdict: Option<Verdict>,
    /// How often it was seen.
    pub count: u64,
    /// What is known of that.
    pub sightings: BTreeSet<Sighting>,
    /// The tests in which it is known to have been seen, by number; a recording is one.
    pub episodes: BTreeSet<usize>,
    /// The test from which on it was seen more often than is known.
    pub more_from: Option<usize>,
    /// The first message that shows it, where messages alone say what belongs together.
    pub first: Option<u64>,
    /// Whether tests have decided the requirement, and it was kept in none.
    pub never_kept: bool,
    /// The requirements that have to be kept for this one to be decided.
    pub rests_on: Vec<&'a str>,
}

/// In which way a finding follows from another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tie {
    /// It is the same thing, seen as a breach of another requirement.
    Same,
    /// Its requirement rests on the one that is broken.
    Rests,
}

/// The finding that another one follows from, and in which way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cause {
    /// Its number in the list.
    pub finding: usize,
    /// In which way.
    pub tie: Tie,
}

/// For each finding of a list, the worst first, the one it follows from; that one follows from none.
#[must_use]
pub fn causes(all: &[Evidence<'_>]) -> Vec<Option<Cause>> {
    let direct: Vec<Option<Cause>> = all
        .iter()
        .enumerate()
        .map(|(at, finding)| {
            // What rests on this one is no cause of it.
            let same = |other: &usize| is_same(finding, &all[*other]) && !rests(&all[*other], finding);
            let below = |other: &usize| *other != at && rests(finding, &all[*other]);
            let tied = |finding, tie| Cause { finding, tie };
            let same = (0..at).find(same).map(|finding| tied(finding, Tie::Same));
            same.or_else(|| (0..all.len()).find(below).map(|finding| tied(finding, Tie::Rests)))
        })
        .collect();
    (0..all.len()).map(|at| root(&direct, at)).collect()
}

/// The end of the way from a finding to its cause. Those that lie in a circle have none.
fn root(direct: &[Option<Cause>], at: usize) -> Option<Cause> {
    let mut cause = direct[at]?;
    for _ in 0..direct.len() {
        match direct[cause.finding] {
            None => return Some(cause),
            Some(next) => {
                let tie = if next.tie == Tie::Same { cause.tie } else { Tie::Rests };
                cause = Cause { tie, ..next };
            }
        }
    }
    None
}

/// Whether all that is known of a finding was seen of the other one.
fn is_same(finding: &Evidence<'_>, other: &Evidence<'_>) -> bool {
    let spots = || other.sightings.iter().filter_map(Sighting::spot);
    let is_seen = |one: &Sighting| {
        other.sightings.contains(one) || one.spot().is_some_and(|spot| spots().any(|known| known == spot))
    };
    !finding.sightings.is_empty() && finding.count <= other.count && finding.sightings.iter().all(is_seen)
}

/// Whether the requirement of a finding rests on that of the other one, and that was broken wherever the finding was seen.
fn rests(finding: &Evidence<'_>, other: &Evidence<'_>) -> bool {
    let may_be_in = |test: &usize| other.episodes.contains(test) || other.more_from.is_some_and(|from| from <= *test);
    let is_there = || other.never_kept || finding.episodes.iter().all(may_be_in);
    // What comes later in a recording may be a mistake of its own.
    let at_once = |(own, first): (u64, u64)| own == first && finding.count <= other.count;
    let is_at_once = finding.first.zip(other.first).is_none_or(at_once);
    finding.rests_on.contains(&other.requirement) && other.verdict >= finding.verdict && is_at_once && is_there()
}

/// The place in a message that a sentence begins with, such as `state/orderId`; the whole sentence where it begins otherwise. Two
/// sentences about one place of one message are about one mistake.
#[must_use]
pub fn place(text: &str) -> &str {
    match text.split_once(": ") {
        Some((place, _)) if place.contains('/') && !place.contains([' ', '"']) => place,
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen<'a>(requirement: &'a str, count: u64, sightings: &[(&str, u64, &str)]) -> Evidence<'a> {
        let sightings = sightings.iter().map(|(by, message, text)| Sighting {
            by: (*by).to_owned(),
            message: Some(*message),
            text: (*text).to_owned(),
        });
        Evidence {
            requirement,
            verdict: Some(Verdict::Fail),
            count,
            sightings: sightings.collect(),
            ..Evidence::default()
        }
    }

    fn numbers(all: &[Evidence<'_>]) -> Vec<Option<usize>> {
        causes(all)
            .into_iter()
            .map(|cause| cause.map(|one| one.finding))
            .collect()
    }

    #[test]
    fn a_place_is_told_from_a_sentence() {
        assert_eq!(place("state/orderId: 7 is not of type string"), "state/orderId");
        for whole in [
            "state: \"not JSON\"",
            "the way a/b: none",
            "\"a/b\": odd",
            "state/orderId",
        ] {
            assert_eq!(place(whole), whole);
        }
    }

    #[test]
    fn one_place_of_one_message_is_one_mistake_whoever_saw_it() {
        let all = [
            seen("A-1", 2, &[("schema", 3, "state/orderId: 7 is no text")]),
            seen("A-2", 2, &[("names", 3, "state/orderId: 7 is odd")]),
            seen("A-3", 3, &[("names", 3, "state/orderId: 7 is seldom")]),
            seen("A-4", 1, &[("names", 4, "state/orderId: 7 is odd")]),
            seen("A-5", 1, &[("names", 3, "state/driving: 7 is odd")]),
            seen("A-6", 1, &[("names", 3, "it is odd")]),
        ];
        assert_eq!(numbers(&all), [None, Some(0), None, None, None, None]);
    }

    #[test]
    fn what_rests_on_a_broken_requirement_follows_from_it_only_where_that_is_broken() {
        let in_tests = |requirement, tests: &[usize], rests_on: &[&'static str]| Evidence {
            episodes: tests.iter().copied().collect(),
            rests_on: rests_on.to_vec(),
            ..seen(requirement, 1, &[(requirement, 9, requirement)])
        };
        let driven = in_tests("ORD-06", &[1, 2], &["ORD-04"]);
        let ends = in_tests("NODE-05", &[1], &["ORD-06"]);
        let taken = in_tests("ORD-04", &[1, 2, 3], &[]);
        let all = [driven.clone(), ends.clone(), taken.clone()];
        // What rests on something that rests on a third thing follows from the third.
        assert_eq!(numbers(&all), [Some(2), Some(2), None]);
        assert_eq!(causes(&all)[1].map(|cause| cause.tie), Some(Tie::Rests));
        // It was broken in a test in which the order was taken.
        let elsewhere = in_tests("ORD-06", &[1, 4], &["ORD-04"]);
        let never_kept = Evidence {
            never_kept: true,
            ..taken.clone()
        };
        let often = Evidence {
            more_from: Some(3),
            ..taken.clone()
        };
        assert_eq!(numbers(&[elsewhere.clone(), taken.clone()]), [None, None]);
        assert_eq!(numbers(&[elsewhere.clone(), never_kept]), [Some(1), None]);
        assert_eq!(numbers(&[elsewhere, often]), [Some(1), None]);
        // A remark is the cause of no failure, and what comes later of nothing before it.
        let remark = Evidence {
            verdict: Some(Verdict::Warning),
            ..taken.clone()
        };
        assert_eq!(numbers(&[driven.clone(), remark]), [None, None]);
        let (early, late) = (
            Evidence {
                first: Some(3),
                ..driven
            },
            Evidence {
                first: Some(8),
                ..taken
            },
        );
        assert_eq!(numbers(&[early, late]), [None, None]);
        // Seen in the same words, too: what is rested on stays the cause.
        let words = |requirement, rests_on: &[&'static str]| Evidence {
            rests_on: rests_on.to_vec(),
            ..seen(requirement, 1, &[("a/b", 9, "wrong")])
        };
        assert_eq!(
            numbers(&[words("ORD-06", &["ORD-04"]), words("ORD-04", &[])]),
            [Some(1), None]
        );
    }

    #[test]
    fn requirements_that_rest_on_one_another_are_all_told() {
        let circle = [
            Evidence {
                rests_on: vec!["B"],
                ..seen("A", 1, &[])
            },
            Evidence {
                rests_on: vec!["A"],
                ..seen("B", 1, &[])
            },
        ];
        assert_eq!(numbers(&circle), [None, None]);
    }
}
