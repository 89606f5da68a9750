//! What a device breaks, requirement by requirement: the rows that stand directly below the headline.
//!
//! A row joins what tests and monitors found of one requirement, so that one mistake is one row however many tests saw it; what a test
//! and a monitor found in the same message was found once. What follows from another finding (`cause`) stands behind it.
//! A program that ended by itself has a row of its own: no requirement says so, and no device may do it.

use std::collections::BTreeSet;

use super::cause::{Evidence, Sighting, causes};
use super::sources::Sources;
use tck_base::verdict::Verdict;
use tck_result::{MonitorFinding, MonitorResult, RunResult, Sent};

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
    /// The requirement it follows from.
    pub follows: Option<&'a str>,
    sightings: BTreeSet<Sighting>,
    /// The tests in which it was seen, by number.
    episodes: BTreeSet<usize>,
    /// The test from which on it was seen more often than is known.
    more_from: Option<usize>,
}

/// Stands for the time in which no test ran.
const NO_TEST: usize = usize::MAX;

/// The findings of a run: what is broken before what is only remarked on, then by the number of tests that found it.
#[must_use]
pub fn findings<'a>(result: &'a RunResult, sources: &'a Sources) -> Vec<Finding<'a>> {
    let bad = |verdict: Verdict| matches!(verdict, Verdict::Fail | Verdict::Warning);
    let mut all: Vec<Finding<'a>> = Vec::new();
    for (number, test) in result.tests.iter().enumerate() {
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
            finding.sightings.insert(Sighting {
                by: format!("{} {}", test.id, decision.clause),
                message: at,
                text: decision.message.clone(),
            });
            finding.episodes.insert(number);
            if !finding.tests.contains(&test.id.as_str()) {
                finding.tests.push(&test.id);
            }
        }
    }
    for monitor in &result.monitors {
        for found in monitor.findings.iter().filter(|found| bad(found.verdict)) {
            let finding = row(&mut all, &found.requirement, sources);
            let first = found.first.first().copied();
            let again = found.first.iter().filter(|seq| finding.is_seen_in(**seq)).count();
            let others = found.count.saturating_sub(again as u64);
            finding.see(found.verdict, others, first, Seen::of(found.message.clone(), None));
            finding.sightings.insert(Sighting {
                by: monitor.id.clone(),
                message: first,
                text: found.message.clone(),
            });
            finding
                .episodes
                .extend(found.first.iter().map(|seq| test_at(result, *seq)));
            // Of what happened often, only the first places are kept.
            let last = found.first.last().filter(|_| found.count > found.first.len() as u64);
            let more_from = last.map(|seq| test_at(result, *seq));
            finding.more_from = finding.more_from.into_iter().chain(more_from).min();
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
            episodes: BTreeSet::new(),
            more_from: None,
        });
    }
    all.sort_by_key(|finding| std::cmp::Reverse((finding.verdict, finding.tests.len() + finding.monitors.len())));
    let passes = result.tests.iter().flat_map(|test| &test.decisions);
    let passes = passes.filter(|decision| decision.verdict() == Verdict::Pass);
    let kept: BTreeSet<&str> = passes.map(|decision| decision.requirement.as_str()).collect();
    behind_their_causes(all, &kept, sources)
}

/// The number of the test that ran when a message came.
fn test_at(result: &RunResult, seq: u64) -> usize {
    let ran = |range: (u64, u64)| (range.0..=range.1).contains(&seq);
    let at = result.tests.iter().position(|test| test.journal.is_some_and(ran));
    at.unwrap_or(NO_TEST)
}

/// Whether a test that failed shows all that a monitor has failed for: the same requirements, broken in the same messages.
pub(super) fn is_told_by_tests(monitor: &MonitorResult, result: &RunResult) -> bool {
    let decisions = || result.tests.iter().flat_map(|test| &test.decisions);
    let is_told = |requirement: &str, seq: u64| {
        decisions().any(|decision| {
            let nearest = decision.nearest.as_ref().map(|nearest| nearest.seq);
            let at = decision.witness.or(nearest);
            decision.requirement == requirement && decision.verdict() == Verdict::Fail && at == Some(seq)
        })
    };
    let fails = || monitor.findings.iter().filter(|found| found.verdict == Verdict::Fail);
    // Of what happened often, only the first places are kept.
    let is_whole = |found: &MonitorFinding| found.count == found.first.len() as u64;
    let all_told = |found: &MonitorFinding| found.first.iter().all(|seq| is_told(&found.requirement, *seq));
    fails().next().is_some() && fails().all(|found| is_whole(found) && all_told(found))
}

/// Says of each finding from which other one it follows, and puts it behind that one.
fn behind_their_causes<'a>(mut all: Vec<Finding<'a>>, kept: &BTreeSet<&str>, sources: &'a Sources) -> Vec<Finding<'a>> {
    let evidence: Vec<Evidence<'_>> = all
        .iter()
        .map(|finding| Evidence {
            requirement: finding.requirement,
            verdict: Some(finding.verdict),
            count: finding.count,
            sightings: finding.sightings.clone(),
            episodes: finding.episodes.clone(),
            first: None,
            more_from: finding.more_from,
            never_kept: !finding.tests.is_empty() && !kept.contains(finding.requirement),
            rests_on: sources.rests_on(finding.requirement),
        })
        .collect();
    let found = causes(&evidence);
    let named: Vec<Option<&str>> = found
        .into_iter()
        .map(|cause| cause.map(|cause| all[cause.finding].requirement))
        .collect();
    for (finding, cause) in all.iter_mut().zip(named) {
        let Some(cause) = cause else { continue };
        finding.follows = Some(cause);
        finding.seen = format!("follows from {cause}: {}", finding.seen);
    }
    let (roots, mut others): (Vec<_>, Vec<_>) = all.into_iter().partition(|finding| finding.follows.is_none());
    let mut ordered = Vec::new();
    for cause in roots {
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
    /// Whether a test or a monitor has seen it in a message.
    fn is_seen_in(&self, seq: u64) -> bool {
        self.sightings.iter().any(|known| known.message == Some(seq))
    }

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
            episodes: BTreeSet::new(),
            more_from: None,
        });
        all.len() - 1
    });
    &mut all[at]
}

#[cfg(test)]
pub(crate) mod tests {
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
            episodes: BTreeSet::new(),
            more_from: None,
        }
    }

    /// A catalogue that knows nothing.
    fn none() -> &'static Sources {
        static NONE: std::sync::LazyLock<Sources> = std::sync::LazyLock::new(Sources::default);
        &NONE
    }

    fn seen(requirement: &'static str, sightings: &[(&str, u64)]) -> Finding<'static> {
        let mut finding = Finding { requirement, ..empty() };
        for (clause, message) in sightings {
            let text = format!("wrong in {message}");
            finding.see(Verdict::Fail, 1, Some(*message), Seen::of(text.clone(), None));
            finding.sightings.insert(Sighting {
                by: (*clause).to_owned(),
                message: Some(*message),
                text,
            });
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
        let rows = behind_their_causes(all, &BTreeSet::new(), none());
        let rows: Vec<_> = rows.iter().map(|one| (one.requirement, one.follows)).collect();
        let expected = [
            ("A-1", None),
            ("A-2", Some("A-1")),
            ("A-3", Some("A-1")),
            ("A-4", Some("A-1")),
            ("B-1", None),
            ("B-2", None),
        ];
        assert_eq!(rows, expected);
        let one = behind_their_causes(
            vec![seen("A-1", &[("test", 3)]), seen("A-2", &[("test", 3)])],
            &BTreeSet::new(),
            none(),
        );
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

    /// A run in which a test and a monitor have found things, by message.
    pub(crate) fn run(decided: &[(&str, &str, u64)], monitor: &[(&str, &[u64])]) -> RunResult {
        let decisions: Vec<serde_json::Value> = decided
            .iter()
            .map(|(requirement, verdict, witness)| {
                serde_json::json!({
                    "requirement": requirement, "verdict": verdict, "clause": "steps[0]", "place": "a/b.yaml:1",
                    "witness": witness, "message": "not as it should be",
                })
            })
            .collect();
        let findings: Vec<serde_json::Value> = monitor
            .iter()
            .map(|(requirement, first)| {
                serde_json::json!({
                    "requirement": requirement, "verdict": "fail", "count": first.len(), "first": first, "message": "wrong",
                })
            })
            .collect();
        serde_json::from_value(serde_json::json!({
            "format": "", "tool": "", "run": "", "started": "", "seconds": 0.0, "role": "agv", "protocol": "2.1.0",
            "partial": false, "verdict": "fail", "device": { "manufacturer": "", "serialNumber": "" }, "vantage": "tap",
            "suites_sha256": "", "suites_modified": false, "journal": "", "requirements": [], "capabilities": [],
            "limits": [], "deviations": {}, "settings": [],
            "tests": [{
                "id": "a/b", "title": "", "verdict": "fail", "seconds": 0.0, "maturity": "reviewed", "journal": [1, 20],
                "decisions": decisions, "steps": [],
            }],
            "monitors": [{ "id": "a/m", "title": "", "verdict": "fail", "judged": 9, "findings": findings }],
        }))
        .expect("a result")
    }

    #[test]
    fn what_a_test_and_a_monitor_find_in_one_message_is_found_once() {
        let same = run(&[("STATE-12", "fail", 5)], &[("STATE-12", &[5])]);
        let rows = findings(&same, none());
        assert_eq!(
            rows.iter().map(|row| (row.requirement, row.count)).collect::<Vec<_>>(),
            [("STATE-12", 1)]
        );
        assert_eq!((rows[0].tests.len(), rows[0].monitors.len()), (1, 1));
        assert!(is_told_by_tests(&same.monitors[0], &same));
        // The monitor saw it once more, or something else, or the test only remarked on it.
        let more = run(&[("STATE-12", "fail", 5)], &[("STATE-12", &[5, 9])]);
        assert_eq!(findings(&more, none())[0].count, 2);
        assert!(!is_told_by_tests(&more.monitors[0], &more));
        let other = run(&[("STATE-12", "fail", 5)], &[("STATE-12", &[5]), ("NODE-03", &[5])]);
        assert!(!is_told_by_tests(&other.monitors[0], &other));
        let remark = run(&[("STATE-12", "warning", 5)], &[("STATE-12", &[5])]);
        assert!(!is_told_by_tests(&remark.monitors[0], &remark));
        let nothing = run(&[("STATE-12", "fail", 5)], &[]);
        assert!(!is_told_by_tests(&nothing.monitors[0], &nothing));
    }
}
