//! Two results side by side: what got worse, what got better.
//!
//! Order matters: `a` is the earlier run. Whether two runs may be compared at all is for the reader to say;
//! whatever makes them different in kind (device, version, suites) is stated first.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Serialize;

use super::clean::line;
use super::statement::many;
use tck_base::verdict::Verdict;
use tck_result::RunResult;

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
}

/// How something stood in one run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Standing {
    /// Not part of the run.
    Absent,
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

    fn word(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::Undecided => "undecided",
            Self::Decided(verdict) => verdict.word(),
        }
    }
}

/// Which way a change goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trend {
    /// A worse verdict.
    Worse,
    /// A better verdict.
    Better,
    /// Decided in one run only.
    Other,
}

impl Change {
    /// Which way it goes.
    #[must_use]
    pub fn trend(&self) -> Trend {
        match (self.before, self.after) {
            (Standing::Decided(before), Standing::Decided(after)) if after > before => Trend::Worse,
            (Standing::Decided(_), Standing::Decided(_)) => Trend::Better,
            // A fail that was not there before is bad news wherever it comes from.
            (_, Standing::Decided(Verdict::Fail)) => Trend::Worse,
            _ => Trend::Other,
        }
    }
}

/// Compares an earlier run with a later one.
#[must_use]
pub fn compare(before: &RunResult, after: &RunResult) -> Comparison {
    Comparison {
        notes: notes(before, after),
        verdict: (before.verdict != after.verdict).then_some((before.verdict, after.verdict)),
        requirements: changes(
            before
                .requirements
                .iter()
                .map(|entry| (entry.id.as_str(), entry.verdict)),
            after
                .requirements
                .iter()
                .map(|entry| (entry.id.as_str(), entry.verdict)),
        ),
        tests: changes(
            before.tests.iter().map(|entry| (entry.id.as_str(), entry.verdict)),
            after.tests.iter().map(|entry| (entry.id.as_str(), entry.verdict)),
        ),
        monitors: changes(
            before.monitors.iter().map(|entry| (entry.id.as_str(), entry.verdict)),
            after.monitors.iter().map(|entry| (entry.id.as_str(), entry.verdict)),
        ),
    }
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

fn changes<'a>(
    before: impl Iterator<Item = (&'a str, Option<Verdict>)>,
    after: impl Iterator<Item = (&'a str, Option<Verdict>)>,
) -> Vec<Change> {
    let order: Vec<(&str, Option<Verdict>)> = before.collect();
    let mut earlier: BTreeMap<&str, Standing> = order.iter().map(|(id, v)| (*id, Standing::of(*v))).collect();
    let mut all = Vec::new();
    for (id, verdict) in after {
        let before = earlier.remove(id).unwrap_or(Standing::Absent);
        let after = Standing::of(verdict);
        if before != after {
            all.push(Change {
                id: id.to_owned(),
                before,
                after,
            });
        }
    }
    for (id, _) in order {
        if let Some(before) = earlier.remove(id) {
            all.push(Change {
                id: id.to_owned(),
                before,
                after: Standing::Absent,
            });
        }
    }
    all
}

impl Comparison {
    /// Whether nothing changed.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.verdict.is_none() && self.requirements.is_empty() && self.tests.is_empty() && self.monitors.is_empty()
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
            for (trend, word) in [
                (Trend::Worse, "worse"),
                (Trend::Better, "better"),
                (Trend::Other, "other"),
            ] {
                for change in changes.iter().filter(|change| change.trend() == trend) {
                    let steps = format!("{} -> {}", change.before.word(), change.after.word());
                    let _ = writeln!(text, "  {word:<7} {steps:<28} {}", line(&change.id));
                }
            }
        }
        text
    }
}
