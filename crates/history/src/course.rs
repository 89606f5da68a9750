//! What became of one requirement from run to run.
//!
//! A failure stays open until each test and monitor that found it has decided the requirement again and found nothing. For a
//! monitor that has to be in a whole run with all the tests there were before, since it sees only what these bring about.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::conditions::Change;
use crate::flaky::{self, Flaky};
use crate::seen::{Kind, SeenRun};
use tck_base::verdict::Verdict;
use tck_report::compare::Standing;

/// How a requirement stands at the end of a series, what is to be looked at first before all else.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// It is broken in the last run.
    Fails,
    /// It was broken, and what found it has not decided it since.
    Unseen,
    /// It is now kept and now broken, and nothing that the runs name has changed.
    Flaky,
    /// It was decided before, and is not in the last run, which was a whole one.
    Lost,
    /// There is a remark on it.
    Warns,
    /// It was broken once, and is kept since.
    Fixed,
    /// It is kept in all runs that decided it.
    Keeps,
    /// No run has decided it.
    Open,
}

impl State {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Self; 8] = [
        Self::Fails,
        Self::Unseen,
        Self::Flaky,
        Self::Lost,
        Self::Warns,
        Self::Fixed,
        Self::Keeps,
        Self::Open,
    ];

    /// The word used in every output.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Fails => "fails",
            Self::Unseen => "unseen",
            Self::Flaky => "flaky",
            Self::Lost => "lost",
            Self::Warns => "warns",
            Self::Fixed => "fixed",
            Self::Keeps => "keeps",
            Self::Open => "open",
        }
    }

    /// Whether something happened that somebody may want to know.
    #[must_use]
    pub fn is_news(self) -> bool {
        !matches!(self, Self::Keeps | Self::Open)
    }
}

/// One requirement over all runs of a series. Runs are named by their numbers, counted from 1.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Course {
    /// Id of the requirement.
    pub id: String,
    /// How it stands at the end.
    pub state: State,
    /// The run in which its last failure, or its last remark, came up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub since: Option<usize>,
    /// The last run before that in which what found it had found nothing; absent when there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept_in: Option<usize>,
    /// The last run in which it was broken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last: Option<usize>,
    /// The run in which all that had found the failure found nothing any more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fixed_in: Option<usize>,
    /// The tests and monitors that found the failure or the remark.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub by: Vec<String>,
    /// What lies between the run in which it was kept and the one in which it came up, or was fixed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<Change>,
    /// Where it shows that it is flaky.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flaky: Option<Flaky>,
    /// What was seen, in the last run that found it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// How it stands in each run.
    pub runs: Vec<Standing>,
}

/// Follows a requirement from run to run.
pub(crate) fn follow(id: &str, runs: &[SeenRun]) -> Course {
    let mut course = Course {
        id: id.to_owned(),
        state: State::Open,
        since: None,
        kept_in: None,
        last: None,
        fixed_in: None,
        by: Vec::new(),
        changes: Vec::new(),
        flaky: flaky::find(id, runs),
        text: None,
        runs: runs.iter().map(|run| standing(id, run)).collect(),
    };
    // What has found the failure that is open, each with the last run in which it did.
    let mut open: BTreeMap<&str, usize> = BTreeMap::new();
    let mut warned: Option<usize> = None;
    for (at, run) in runs.iter().enumerate() {
        let Some(seen) = run.of(id) else { continue };
        let failing = || seen.by.iter().filter(|(_, verdict)| **verdict == Verdict::Fail);
        let was_open = !open.is_empty();
        open.retain(|by, last| !is_taken_back(by, seen.by.get(*by), &runs[*last], run));
        if failing().next().is_some() {
            if !was_open {
                course.since = Some(at + 1);
                course.kept_in = (0..at)
                    .rev()
                    .find(|before| failing().any(|(by, _)| is_kept(id, by, &runs[*before])));
                course.kept_in = course.kept_in.map(|at| at + 1);
                course.by.clear();
            }
            for (by, _) in failing() {
                open.insert(by, at);
                if !course.by.contains(by) {
                    course.by.push(by.clone());
                }
            }
            course.last = Some(at + 1);
            course.fixed_in = None;
            course.text.clone_from(&seen.text);
        } else if was_open && open.is_empty() {
            course.fixed_in = Some(at + 1);
        }
        match course.runs[at] {
            Standing::Decided(Verdict::Warning) if open.is_empty() => {
                warned.get_or_insert(at);
            }
            Standing::Decided(Verdict::Pass) if open.is_empty() => warned = None,
            _ => {}
        }
    }
    conclude(course, runs, !open.is_empty(), warned)
}

/// Whether a decision takes back what the same test or monitor has found before.
fn is_taken_back(by: &str, verdict: Option<&Verdict>, found_in: &SeenRun, run: &SeenRun) -> bool {
    if !matches!(verdict, Some(Verdict::Pass | Verdict::Warning)) {
        return false;
    }
    if found_in.tests.contains(by) || found_in.subject.kind == Kind::Audit {
        return true;
    }
    run.partial.is_none() && found_in.tables.is_subset(&run.tables)
}

/// Whether this test or monitor has decided in a run that the requirement is kept.
fn is_kept(id: &str, by: &str, run: &SeenRun) -> bool {
    let verdict = run.of(id).and_then(|seen| seen.by.get(by));
    matches!(verdict, Some(Verdict::Pass | Verdict::Warning))
}

fn standing(id: &str, run: &SeenRun) -> Standing {
    run.of(id).and_then(|seen| seen.standing).unwrap_or(Standing::Absent)
}

fn is_decided(standing: Standing) -> bool {
    matches!(
        standing,
        Standing::Decided(Verdict::Pass | Verdict::Warning | Verdict::Fail)
    )
}

/// Says how it stands, and what lies between.
fn conclude(mut course: Course, runs: &[SeenRun], is_open: bool, warned: Option<usize>) -> Course {
    let end = course.runs.len();
    let whole = runs
        .last()
        .is_some_and(|run| run.partial.is_none() && !run.selection && run.subject.kind == Kind::Run);
    let decided = course.runs.iter().any(|standing| is_decided(*standing));
    let is_flaky = course.flaky.as_ref().is_some_and(|flaky| {
        let shown = flaky.runs.last().and_then(|run| runs.get(run.wrapping_sub(1)));
        let alike = |run: &SeenRun| shown.is_some_and(|shown| shown.conditions.changes(&run.conditions).is_empty());
        is_open || runs.last().is_some_and(alike)
    });
    course.state = if is_flaky {
        State::Flaky
    } else if is_open && course.last == Some(end) {
        State::Fails
    } else if is_open {
        State::Unseen
    } else if decided && whole && !course.runs.last().is_some_and(|last| is_decided(*last)) {
        State::Lost
    } else if let Some(at) = warned {
        // Only if it came up after the last failure; what is behind that failure is told by the runs.
        course.since = Some(at + 1);
        course.kept_in = (0..at)
            .rev()
            .find(|at| course.runs[*at] == Standing::Decided(Verdict::Pass))
            .map(|at| at + 1);
        let warning = |(_, verdict): &(&String, &Verdict)| **verdict == Verdict::Warning;
        let mut seen = runs.iter().rev().filter_map(|run| run.of(&course.id));
        let last = seen.find(|seen| seen.by.iter().any(|one| warning(&one)));
        course.text = last.and_then(|seen| seen.text.clone());
        course.by = last.map_or_else(Vec::new, |seen| {
            seen.by.iter().filter(warning).map(|(by, _)| by.clone()).collect()
        });
        State::Warns
    } else if course.fixed_in.is_some() {
        State::Fixed
    } else if decided {
        State::Keeps
    } else {
        State::Open
    };
    let between = match course.state {
        State::Fixed => course.last.zip(course.fixed_in),
        _ => course.kept_in.zip(course.since),
    };
    if let Some((before, after)) = between {
        course.changes = runs[before - 1].conditions.changes(&runs[after - 1].conditions);
    }
    course
}

#[cfg(test)]
mod tests;
