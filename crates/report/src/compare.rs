//! Two results side by side: what got worse, what got better.
//!
//! Order matters: the first is the earlier run. Whether two runs may be compared at all is for the reader to say;
//! whatever makes them different in kind (device, version, suites) is stated first. What was decided once and is not decided
//! any more is lost, and a failure that nobody could see again is no gain: a run that decides less never looks better.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use serde::Serialize;

use super::clean::line;
use super::statement::{self, Gap, many};
use tck_base::verdict::Verdict;
use tck_result::{RequirementResult, RunResult, TestResult};

/// What changed from one run to another.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Comparison {
    /// What makes the two runs different in kind, one sentence each.
    pub notes: Vec<String>,
    /// Verdict of the runs as a whole, when it changed.
    pub verdict: Option<(Option<Verdict>, Option<Verdict>)>,
    /// Requirements whose verdict changed, in the order of the second run.
    pub requirements: Vec<Change>,
    /// Tests.
    pub tests: Vec<Change>,
    /// Monitors.
    pub monitors: Vec<Change>,
}

/// One change.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Change {
    /// Id.
    pub id: String,
    /// What it was.
    pub before: Standing,
    /// What it is.
    pub after: Standing,
    /// Which way it goes.
    pub trend: Trend,
}

/// How something stood in one run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Standing {
    /// Not part of the run.
    Absent,
    /// The device declares that it does not have what this is about.
    NotApplicable,
    /// Part of the run, without a verdict.
    Undecided,
    /// With this verdict.
    #[serde(untagged)]
    Decided(Verdict),
}

impl Standing {
    fn of(verdict: Option<Verdict>) -> Self {
        verdict.map_or(Self::Undecided, Self::Decided)
    }

    /// How a requirement stands in a run; one that the run knows nothing of is absent.
    #[must_use]
    pub fn of_requirement(requirement: Option<&RequirementResult>) -> Self {
        let Some(requirement) = requirement else {
            return Self::Absent;
        };
        match statement::gap(requirement) {
            Some(Gap::NotApplicable) => Self::NotApplicable,
            _ => Self::of(requirement.verdict),
        }
    }

    fn of_test(test: &TestResult) -> Self {
        match statement::test_verdict(test) {
            None => Self::NotApplicable,
            verdict => Self::of(verdict),
        }
    }

    /// Of several cases the worst stands for them; what does not apply, or decided nothing, stands behind what was decided.
    #[must_use]
    pub fn join(self, other: Self) -> Self {
        match (self, other) {
            (Self::Decided(one), Self::Decided(other)) => Self::Decided(one.join(other)),
            (one @ Self::Decided(_), _) | (_, one @ Self::Decided(_)) => one,
            (Self::Undecided, _) | (_, Self::Undecided) => Self::Undecided,
            (Self::NotApplicable, _) | (_, Self::NotApplicable) => Self::NotApplicable,
            (Self::Absent, Self::Absent) => Self::Absent,
        }
    }

    /// Whether it was decided one way or the other.
    fn is_decided(self) -> bool {
        matches!(self, Self::Decided(Verdict::Pass | Verdict::Warning | Verdict::Fail))
    }

    fn word(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::NotApplicable => "not applicable",
            Self::Undecided => "undecided",
            Self::Decided(verdict) => verdict.word(),
        }
    }
}

/// Which way a change goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Trend {
    /// A worse verdict, or a failure that was not there before.
    Worse,
    /// It passed before, and is not decided any more.
    Lost,
    /// It failed before, and is not decided any more: nobody knows whether it is mended.
    Unclear,
    /// A better verdict, or decided and not broken where it was open before.
    Better,
    /// Anything else: open before and after, or new.
    Other,
}

impl Trend {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Self; 5] = [Self::Worse, Self::Lost, Self::Unclear, Self::Better, Self::Other];

    /// From one standing to another.
    #[must_use]
    pub fn of(before: Standing, after: Standing) -> Self {
        use Standing::{Absent, Decided};
        match (before, after) {
            // A failure that was not there before is bad news wherever it comes from.
            (before, Decided(Verdict::Fail)) if before != after => Self::Worse,
            (Decided(Verdict::Fail), after) if !after.is_decided() => Self::Unclear,
            (before, after) if before.is_decided() && !after.is_decided() => Self::Lost,
            (Decided(one), Decided(other)) if one > other && after.is_decided() => Self::Better,
            (Decided(_), Decided(Verdict::Warning | Verdict::Error)) => Self::Worse,
            (Absent, _) => Self::Other,
            (_, after) if after.is_decided() => Self::Better,
            _ => Self::Other,
        }
    }

    /// Whether a pipeline that wants nothing to get worse is red.
    #[must_use]
    pub fn is_bad(self) -> bool {
        matches!(self, Self::Worse | Self::Lost)
    }

    /// The word used in every output.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Worse => "worse",
            Self::Lost => "lost",
            Self::Unclear => "unclear",
            Self::Better => "better",
            Self::Other => "other",
        }
    }
}

/// What a pipeline that wants nothing to get worse may conclude from runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Nothing became worse, and nothing was lost.
    Holds,
    /// Something became worse, or is not decided any more.
    Worse,
    /// Nothing became worse, but one of the runs is partial or undecided, or a failure cannot be seen any more: nobody knows.
    Undecided,
}

/// Why two runs cannot be compared, where one of them is a part: what the other one lacks or has more would look like a loss or
/// a gain.
#[must_use]
pub fn parts_differ(before: &RunResult, after: &RunResult) -> Option<String> {
    let name = |run: &RunResult| match &run.shard {
        Some(shard) => format!("part {} of {}", shard.index, shard.of),
        None => "all of a run".to_owned(),
    };
    let selection = |run: &RunResult| run.shard.as_ref().map(|shard| shard.selection.clone());
    let (one, other) = (name(before), name(after));
    if one != other {
        return Some(format!("one is {one}, and the other {other}"));
    }
    (selection(before) != selection(after)).then(|| format!("both are {one}, and of other selections of tests"))
}

/// What the last of several runs means beside the one before it, and beside the first. What became worse in between and was
/// mended since does not count.
#[must_use]
pub fn outcome(runs: &[RunResult]) -> Outcome {
    let (Some(first), Some((last, earlier))) = (runs.first(), runs.split_last()) else {
        return Outcome::Undecided;
    };
    let Some(before) = earlier.last() else {
        return Outcome::Undecided;
    };
    let steps = [compare(before, last), compare(first, last)];
    if steps.iter().any(|step| step.has(Trend::is_bad)) {
        return Outcome::Worse;
    }
    let unclear = steps.iter().any(|step| step.has(|trend| trend == Trend::Unclear));
    if unclear || [first, before, last].into_iter().any(is_open) {
        return Outcome::Undecided;
    }
    Outcome::Holds
}

/// Whether a run is partial, or undecided as a whole.
fn is_open(run: &RunResult) -> bool {
    run.partial || !Standing::of(run.verdict).is_decided() || statement::trouble(run).is_some()
}

/// Compares an earlier run with a later one.
#[must_use]
pub fn compare(before: &RunResult, after: &RunResult) -> Comparison {
    let requirements = |run: &RunResult| {
        let all = run.requirements.iter();
        all.map(|one| (one.id.clone(), Standing::of_requirement(Some(one))))
            .collect()
    };
    let monitors = |run: &RunResult| {
        let all = run.monitors.iter();
        all.map(|one| (one.id.clone(), Standing::of(one.verdict))).collect()
    };
    Comparison {
        notes: notes(before, after),
        verdict: (before.verdict != after.verdict).then_some((before.verdict, after.verdict)),
        requirements: changes(requirements(before), requirements(after)),
        tests: changes(tests(before, after), tests(after, before)),
        monitors: changes(monitors(before), monitors(after)),
    }
}

/// The tests of a run, to be compared with another one. Which cases of a table are drawn differs from run to run: a case that
/// only one of the two runs has stands for its table, and its table for it.
fn tests(run: &RunResult, other: &RunResult) -> Vec<(String, Standing)> {
    let mut all: Vec<(String, Standing)> = Vec::new();
    let mut add = |id: &str, standing: Standing| match all.iter_mut().find(|(known, _)| known == id) {
        Some((_, known)) => *known = known.join(standing),
        None => all.push((id.to_owned(), standing)),
    };
    let ids = |run: &RunResult| {
        run.tests
            .iter()
            .map(|test| test.id.clone())
            .collect::<BTreeSet<String>>()
    };
    let (own, others) = (ids(run), ids(other));
    let drawn: BTreeSet<&str> = own.symmetric_difference(&others).filter_map(|id| table(id)).collect();
    for test in &run.tests {
        let standing = Standing::of_test(test);
        match table(&test.id).filter(|table| drawn.contains(table)) {
            Some(table) => add(&format!("{table}[…]"), standing),
            None => add(&test.id, standing),
        }
    }
    all
}

/// The table that a case is of.
fn table(id: &str) -> Option<&str> {
    Some(id.strip_suffix(']')?.split_once('[')?.0)
}

fn notes(before: &RunResult, after: &RunResult) -> Vec<String> {
    let device = |result: &RunResult| format!("{} {}", result.device.manufacturer, result.device.serial_number);
    let differing = [
        ("device", device(before), device(after)),
        ("role", before.role.clone(), after.role.clone()),
        ("protocol", before.protocol.clone(), after.protocol.clone()),
        ("vantage", before.vantage.clone(), after.vantage.clone()),
        ("tool", before.tool.clone(), after.tool.clone()),
        ("suites", before.suites_sha256.clone(), after.suites_sha256.clone()),
    ];
    let mut notes: Vec<String> = differing
        .into_iter()
        .filter(|(_, before, after)| before != after)
        .map(|(what, before, after)| format!("{what} differs: {} -> {}", line(&before), line(&after)))
        .collect();
    for (which, result) in [("first", before), ("second", after)] {
        if result.partial {
            notes.push(format!("the {which} run is partial"));
        }
    }
    notes
}

fn changes(before: Vec<(String, Standing)>, after: Vec<(String, Standing)>) -> Vec<Change> {
    let mut earlier: BTreeMap<String, Standing> = before.iter().cloned().collect();
    let change = |id: String, before: Standing, after: Standing| Change {
        id,
        before,
        after,
        trend: Trend::of(before, after),
    };
    let mut all = Vec::new();
    for (id, after) in after {
        let before = earlier.remove(&id).unwrap_or(Standing::Absent);
        if before != after {
            all.push(change(id, before, after));
        }
    }
    for (id, _) in before {
        if let Some(before) = earlier.remove(&id) {
            all.push(change(id, before, Standing::Absent));
        }
    }
    all
}

impl Comparison {
    /// Of requirements alone, each by its name.
    #[must_use]
    pub fn of_requirements(before: Vec<(String, Standing)>, after: Vec<(String, Standing)>) -> Self {
        Self {
            requirements: changes(before, after),
            ..Self::default()
        }
    }

    /// Whether nothing changed.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.verdict.is_none() && self.requirements.is_empty() && self.tests.is_empty() && self.monitors.is_empty()
    }

    /// Whether a requirement or a test went such a way. What a monitor found is in the requirement that it decides.
    #[must_use]
    pub fn has(&self, way: impl Fn(Trend) -> bool) -> bool {
        let mut all = self.requirements.iter().chain(&self.tests);
        all.any(|change| way(change.trend))
    }

    /// The comparison for people: what got worse first.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        for note in &self.notes {
            let _ = writeln!(text, "note: {note}");
        }
        if let Some((before, after)) = self.verdict {
            let (before, after) = (Standing::of(before).word(), Standing::of(after).word());
            let _ = writeln!(text, "verdict: {before} -> {after}");
        }
        if self.is_empty() {
            text.push_str("no verdict changed\n");
        }
        for (title, changes) in [
            ("requirement", &self.requirements),
            ("test", &self.tests),
            ("monitor", &self.monitors),
        ] {
            if changes.is_empty() {
                continue;
            }
            let _ = writeln!(text, "\n{} changed", many(changes.len(), title));
            for trend in Trend::ALL {
                for change in changes.iter().filter(|change| change.trend == trend) {
                    let steps = format!("{} -> {}", change.before.word(), change.after.word());
                    let _ = writeln!(text, "  {:<7} {steps:<28} {}", trend.word(), line(&change.id));
                }
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Everything that something can stand like.
    fn standings() -> Vec<Standing> {
        let open = [Standing::Absent, Standing::NotApplicable, Standing::Undecided];
        let decided = Verdict::ALL.into_iter().map(Standing::Decided);
        open.into_iter().chain(decided).collect()
    }

    #[test]
    fn what_decides_less_is_never_better_and_what_passed_is_lost() {
        let passes = |standing| matches!(standing, Standing::Decided(Verdict::Pass | Verdict::Warning));
        let fail = Standing::Decided(Verdict::Fail);
        for before in standings() {
            for after in standings().into_iter().filter(|after| *after != before) {
                let trend = Trend::of(before, after);
                let shown = format!("{} -> {}: {}", before.word(), after.word(), trend.word());
                assert!(trend != Trend::Better || after.is_decided(), "{shown}");
                assert_eq!(trend == Trend::Lost, passes(before) && !after.is_decided(), "{shown}");
                assert_eq!(
                    trend == Trend::Unclear,
                    before == fail && !after.is_decided(),
                    "{shown}"
                );
                assert!(after != fail || trend == Trend::Worse, "{shown}");
                // Nothing is good news both ways.
                let back = Trend::of(after, before);
                assert!(trend != Trend::Better || back != Trend::Better, "{shown}");
            }
        }
    }

    #[test]
    fn of_several_cases_the_worst_stands_for_the_table() {
        let all = standings();
        for one in &all {
            assert_eq!(one.join(*one), *one);
            for other in &all {
                assert_eq!(one.join(*other), other.join(*one));
            }
        }
        let (pass, fail) = (Standing::Decided(Verdict::Pass), Standing::Decided(Verdict::Fail));
        assert_eq!(pass.join(fail), fail);
        assert_eq!(pass.join(Standing::NotApplicable), pass);
        assert_eq!(table("a/b[c]"), Some("a/b"));
        assert_eq!(table("a/b"), None);
    }
}
