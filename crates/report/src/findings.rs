//! What a device breaks, requirement by requirement: the rows that stand directly below the headline.
//!
//! A row joins what tests and monitors found of one requirement, so that one mistake is one row however many tests saw it. A
//! requirement of which nothing else was seen than what was seen of another one follows from that, and stands behind it.
//! A program that ended by itself has a row of its own: no requirement says so, and no device may do it.

use std::collections::BTreeSet;

use super::sources::Sources;
use tck_base::verdict::Verdict;
use tck_result::{RunResult, Sent};

/// How a program that ended by itself is called where requirements have their ids.
pub const PROGRAM: &str = "device.command";
/// What is asked of it.
const STAYS: &str = "The program of `device.command` runs until a hook, a person or the end of the run ends it.";

/// A requirement that is broken, or about which there is a remark.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding<'a> {
    /// Its id.
    pub requirement: &'a str,
    /// Fail or warning.
    pub verdict: Verdict,
    /// What it asks, in the words of the catalogue; nothing when the catalogue is not there.
    pub asks: Option<&'a str>,
    /// Whom it binds how, and where: `shall, §6.6.4`.
    pub origin: Option<String>,
    /// What was sent before it was seen the first time.
    pub sent: Option<&'a Sent>,
    /// What was seen the first time.
    pub seen: String,
    /// How often it was seen.
    pub count: u64,
    /// The first message it was seen in, by journal number.
    pub first: Option<u64>,
    /// The tests that found it.
    pub tests: Vec<&'a str>,
    /// The monitors that found it.
    pub monitors: Vec<&'a str>,
    /// The requirement it follows from: all that was seen of it was seen of that one, by the same clauses in the same messages.
    pub follows: Option<&'a str>,
    sightings: BTreeSet<Sighting>,
}

/// A sighting: the clause of a test or the monitor, the message, and in which words.
type Sighting = (String, Option<u64>, String);

/// The findings of a run: what is broken before what is only remarked on, then by the number of tests that found it.
#[must_use]
pub fn findings<'a>(result: &'a RunResult, sources: &'a Sources) -> Vec<Finding<'a>> {
    let bad = |verdict: Verdict| matches!(verdict, Verdict::Fail | Verdict::Warning);
    let mut all: Vec<Finding<'a>> = Vec::new();
    for test in &result.tests {
        for decision in test.decisions.iter().filter(|decision| bad(decision.verdict())) {
            let finding = row(&mut all, &decision.requirement, sources);
            let seen = match &decision.nearest {
                Some(nearest) => format!(
                    "{} is {}, expected {}",
                    nearest.place(),
                    nearest.found,
                    nearest.expected
                ),
                None => decision.message.clone(),
            };
            let at = decision
                .witness
                .or(decision.nearest.as_ref().map(|nearest| nearest.seq));
            finding.see(decision.verdict(), 1, at, Seen::of(seen, decision.sent.as_ref()));
            let clause = format!("{} {}", test.id, decision.clause);
            finding.sightings.insert((clause, at, decision.message.clone()));
            if !finding.tests.contains(&test.id.as_str()) {
                finding.tests.push(&test.id);
            }
        }
    }
    for monitor in &result.monitors {
        for found in monitor.findings.iter().filter(|found| bad(found.verdict)) {
            let finding = row(&mut all, &found.requirement, sources);
            finding.see(
                found.verdict,
                found.count,
                found.first.first().copied(),
                Seen::of(found.message.clone(), None),
            );
            let first = found.first.first().copied();
            finding
                .sightings
                .insert((monitor.id.clone(), first, found.message.clone()));
            if !finding.monitors.contains(&monitor.id.as_str()) {
                finding.monitors.push(&monitor.id);
            }
        }
    }
    if let Some(program) = result
        .program
        .as_ref()
        .filter(|program| program.verdict() == Some(Verdict::Fail))
    {
        all.push(Finding {
            requirement: PROGRAM,
            verdict: Verdict::Fail,
            asks: Some(STAYS),
            origin: Some("by the profile".to_owned()),
            sent: None,
            seen: program.story().unwrap_or_default(),
            count: program.ends - program.excused,
            first: program.first().map(|end| end.seq),
            tests: Vec::new(),
            monitors: Vec::new(),
            follows: None,
            sightings: BTreeSet::new(),
        });
    }
    all.sort_by_key(|finding| std::cmp::Reverse((finding.verdict, finding.tests.len() + finding.monitors.len())));
    behind_their_causes(all)
}

/// Says of each finding from which one before it follows, and puts it behind that one.
fn behind_their_causes(mut all: Vec<Finding<'_>>) -> Vec<Finding<'_>> {
    for at in 1..all.len() {
        let (before, rest) = all.split_at(at);
        let explains = |cause: &&Finding<'_>, finding: &Finding<'_>| {
            let known = !finding.sightings.is_empty() && finding.sightings.is_subset(&cause.sightings);
            known && cause.follows.is_none() && finding.count <= cause.count
        };
        let cause = rest
            .first()
            .and_then(|finding| before.iter().find(|cause| explains(cause, finding)));
        let Some(cause) = cause.map(|cause| cause.requirement) else {
            continue;
        };
        let finding = &mut all[at];
        finding.follows = Some(cause);
        finding.seen = format!("follows from {cause}: {}", finding.seen);
    }
    let (causes, mut others): (Vec<_>, Vec<_>) = all.into_iter().partition(|finding| finding.follows.is_none());
    let mut ordered = Vec::new();
    for cause in causes {
        let own = others.extract_if(.., |finding| finding.follows == Some(cause.requirement));
        let own: Vec<_> = own.collect();
        ordered.push(cause);
        ordered.extend(own);
    }
    ordered
}

/// A sighting, and what was sent before it.
struct Seen<'a> {
    text: String,
    sent: Option<&'a Sent>,
}

impl<'a> Seen<'a> {
    fn of(text: String, sent: Option<&'a Sent>) -> Self {
        Self { text, sent }
    }
}

impl<'a> Finding<'a> {
    /// Takes one more sighting in. The worst of them is shown, and of equals the first.
    fn see(&mut self, verdict: Verdict, times: u64, at: Option<u64>, seen: Seen<'a>) {
        let is_new = self.count == 0;
        let is_earlier = match (at, self.first) {
            (Some(at), Some(first)) => at < first,
            (Some(_), None) => true,
            (None, _) => false,
        };
        if is_new || verdict > self.verdict || (verdict == self.verdict && is_earlier) {
            self.seen = seen.text;
            self.sent = seen.sent;
            self.first = at;
        }
        self.verdict = self.verdict.join(verdict);
        self.count = self.count.saturating_add(times);
    }
}

fn row<'a, 'r>(all: &'r mut Vec<Finding<'a>>, id: &'a str, sources: &'a Sources) -> &'r mut Finding<'a> {
    let at = all.iter().position(|finding| finding.requirement == id);
    let at = at.unwrap_or_else(|| {
        let known = sources.requirement(id);
        all.push(Finding {
            requirement: id,
            verdict: Verdict::Warning,
            asks: known.map(|known| known.text.as_str()),
            origin: known.map(|known| format!("{}, §{}", known.mood, known.section)),
            sent: None,
            seen: String::new(),
            count: 0,
            first: None,
            tests: Vec::new(),
            monitors: Vec::new(),
            follows: None,
            sightings: BTreeSet::new(),
        });
        all.len() - 1
    });
    &mut all[at]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn empty() -> Finding<'static> {
        Finding {
            requirement: "A-1",
            verdict: Verdict::Warning,
            asks: None,
            origin: None,
            sent: None,
            seen: String::new(),
            count: 0,
            first: None,
            tests: Vec::new(),
            monitors: Vec::new(),
            follows: None,
            sightings: BTreeSet::new(),
        }
    }

    fn seen(requirement: &'static str, sightings: &[(&str, u64)]) -> Finding<'static> {
        let mut finding = Finding { requirement, ..empty() };
        for (clause, message) in sightings {
            let text = format!("wrong in {message}");
            finding.see(Verdict::Fail, 1, Some(*message), Seen::of(text.clone(), None));
            finding.sightings.insert(((*clause).to_owned(), Some(*message), text));
        }
        finding
    }

    #[test]
    fn what_is_seen_of_another_requirement_alone_stands_behind_it() {
        let all = vec![
            seen("A-1", &[("monitor", 3), ("test", 9)]),
            seen("B-1", &[("other", 4)]),
            seen("A-2", &[("monitor", 3)]),
            seen("B-2", &[("other", 4), ("test", 12)]),
            seen("A-3", &[("elsewhere", 3)]),
            seen("A-4", &[("monitor", 3)]),
        ];
        let rows = behind_their_causes(all);
        let rows: Vec<_> = rows.iter().map(|one| (one.requirement, one.follows)).collect();
        let expected = [
            ("A-1", None),
            ("A-2", Some("A-1")),
            ("A-4", Some("A-1")),
            ("B-1", None),
            ("B-2", None),
            ("A-3", None),
        ];
        assert_eq!(rows, expected);
        let one = behind_their_causes(vec![seen("A-1", &[("test", 3)]), seen("A-2", &[("test", 3)])]);
        assert_eq!(one[1].seen, "follows from A-1: wrong in 3");
    }

    #[test]
    fn the_worst_sighting_is_shown_and_of_equals_the_first() {
        let mut finding = empty();
        finding.see(Verdict::Warning, 1, Some(3), Seen::of("slow".to_owned(), None));
        finding.see(Verdict::Fail, 2, Some(20), Seen::of("wrong, later".to_owned(), None));
        finding.see(Verdict::Fail, 1, Some(9), Seen::of("wrong".to_owned(), None));
        finding.see(
            Verdict::Fail,
            1,
            None,
            Seen::of("wrong, nobody knows when".to_owned(), None),
        );
        assert_eq!(
            (finding.verdict, finding.count, finding.first, finding.seen.as_str()),
            (Verdict::Fail, 5, Some(9), "wrong")
        );
    }
}
