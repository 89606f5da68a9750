//! What a run of conversations found: one finding for each requirement and place, and the conversations that show it.

use std::collections::BTreeMap;
use std::fmt;

use super::broken::family;
use super::chain::Chain;
use super::writing::ConversationFile;
use tck_base::verdict::Verdict;
use tck_result::{RunResult, TestResult};

/// What saw it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Source {
    /// What was to be heard after a stimulus.
    Stimulus(String),
    /// A monitor.
    Monitor(String),
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stimulus(name) => write!(f, "what must be heard after {name}"),
            Self::Monitor(name) => write!(f, "the monitor {name}"),
        }
    }
}

/// A requirement that is broken in one way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The requirement.
    pub requirement: String,
    /// How bad.
    pub verdict: Verdict,
    /// What saw it.
    pub source: Source,
    /// One line about its first occurrence.
    pub message: String,
    /// The conversation of its first occurrence, cut behind the stimulus that showed it.
    pub chain: Chain,
    /// The id of the conversation of its first occurrence.
    pub test: String,
    /// The node on which that conversation began, where it is known.
    pub began: Option<String>,
    /// In how many conversations it was seen.
    pub count: usize,
}

impl Finding {
    /// Whether another one is of the same kind: the same requirement, seen by the same.
    #[must_use]
    pub fn is_of(&self, other: &Self) -> bool {
        self.requirement == other.requirement && self.source == other.source
    }
}

/// The findings of a run of these conversations, the worst first. Of each conversation the first failure counts, because
/// what comes behind may follow from it; of each monitor every requirement.
#[must_use]
pub fn findings(result: &RunResult, conversations: &[(Chain, ConversationFile)]) -> Vec<Finding> {
    let mut all: BTreeMap<(String, Source), Finding> = BTreeMap::new();
    let mut note = |requirement: &str, verdict, source: Source, message: &str, chain: Chain, test: &str| {
        let key = (requirement.to_owned(), source.clone());
        let found = all.entry(key).or_insert_with(|| Finding {
            requirement: requirement.to_owned(),
            verdict,
            source,
            message: message.to_owned(),
            chain: chain.clone(),
            test: test.to_owned(),
            began: None,
            count: 0,
        });
        found.count += 1;
        if chain.stimuli().len() < found.chain.stimuli().len() {
            found.chain = chain;
            test.clone_into(&mut found.test);
            message.clone_into(&mut found.message);
        }
    };
    for test in &result.tests {
        let Some((chain, file)) = conversations.iter().find(|(_, file)| file.id == test.id) else {
            continue;
        };
        let bad = test
            .decisions
            .iter()
            .filter(|one| matches!(one.verdict(), Verdict::Fail | Verdict::Warning));
        let placed = bad.filter_map(|one| Some((file.stimulus_at(line(&one.place)?)?, one)));
        let Some((at, first)) = placed.min_by_key(|(at, one)| (*at, line(&one.place))) else {
            continue;
        };
        note(
            &first.requirement,
            first.verdict(),
            Source::Stimulus(family(&chain.stimuli()[at]).to_owned()),
            &first.message,
            chain.until(at),
            &test.id,
        );
    }
    for monitor in &result.monitors {
        let bad = monitor
            .findings
            .iter()
            .filter(|one| matches!(one.verdict, Verdict::Fail | Verdict::Warning));
        for finding in bad {
            let within = |test: &TestResult, seq: u64| {
                let range = test.journal;
                range.is_some_and(|(first, last)| (first..=last).contains(&seq))
            };
            let placed = finding.first.iter().find_map(|seq| {
                let test = result.tests.iter().find(|test| within(test, *seq))?;
                Some((*seq, test))
            });
            // What shows before the first conversation shows in each, whatever is said.
            let placed = placed.or_else(|| Some((*finding.first.first()?, result.tests.first()?)));
            let Some((seq, test)) = placed else { continue };
            let Some((chain, file)) = conversations.iter().find(|(_, file)| file.id == test.id) else {
                continue;
            };
            // Steps of a shared state name its file, and belong to the stimulus before them.
            let mut own = test.steps.iter().filter(|step| step.place.contains(&file.id));
            let step = own.rfind(|step| step.journal.is_some_and(|(first, _)| first <= seq));
            let at = step.and_then(|step| file.stimulus_at(line(&step.place)?));
            let cut = chain.until(at.unwrap_or(0));
            note(
                &finding.requirement,
                finding.verdict,
                Source::Monitor(monitor.id.clone()),
                &finding.message,
                cut,
                &test.id,
            );
        }
    }
    let mut all: Vec<Finding> = all.into_values().collect();
    all.sort_by_key(|finding| (std::cmp::Reverse(finding.verdict), finding.requirement.clone()));
    all
}

/// The findings by what they are about: a requirement that is broken in several places is one mistake until somebody has
/// looked. Of each, the one with the shortest conversation comes first.
#[must_use]
pub fn by_cause(all: Vec<Finding>) -> Vec<Vec<Finding>> {
    let mut causes: Vec<Vec<Finding>> = Vec::new();
    for finding in all {
        let same = causes
            .iter_mut()
            .find(|cause| cause.iter().any(|one| one.requirement == finding.requirement));
        match same {
            Some(cause) => cause.push(finding),
            None => causes.push(vec![finding]),
        }
    }
    for cause in &mut causes {
        cause.sort_by_key(|one| (std::cmp::Reverse(one.verdict), one.chain.stimuli().len()));
    }
    causes
}

/// The line of a place such as `explore/3.yaml:14`, or with a column behind it.
fn line(place: &str) -> Option<u32> {
    let mut parts = place.rsplit(':');
    let last: u32 = parts.next()?.parse().ok()?;
    Some(parts.next().and_then(|before| before.parse().ok()).unwrap_or(last))
}
