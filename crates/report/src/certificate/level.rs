//! Levels: the core of the standard, and what a device claims beyond it.
//!
//! A level is reached when everything of it that applies was decided and nothing is broken. The action a requirement is
//! about comes from the catalogue, and whether the device offers that action from its factsheet and profile.

use std::collections::BTreeMap;

use crate::html::view::Badge;
use crate::sources::Sources;
use crate::statement::{self, Gap, many};
use tck_base::verdict::{Accumulated, Verdict};
use tck_result::RunResult;

/// Chapters that are levels of their own: the group of their requirements, and what the level is called.
const CHAPTERS: [(&str, &str); 3] = [("MAP", "Maps"), ("VIS", "Visualization"), ("CORR", "Corridors")];
const CORE: &str = "Core";

/// One row of the table.
pub struct Level {
    /// `Core`, `Maps`, `Action pick`.
    pub name: String,
    /// Who claims it.
    pub claimed: String,
    /// The worst verdict of its requirements.
    pub badge: Badge,
    /// `reached`, `not reached`, `not shown` or `not claimed`.
    pub reached: &'static str,
    /// `12 decided, 2 not decided`.
    pub numbers: String,
}

#[derive(Default)]
struct Sum {
    verdict: Accumulated,
    decided: usize,
    open: usize,
    absent: usize,
}

/// The levels of a run: the core, the chapters that are levels, then each action that has requirements of its own.
pub fn levels(result: &RunResult, sources: &Sources) -> Vec<Level> {
    let mut sums: BTreeMap<(usize, String), Sum> = BTreeMap::new();
    for requirement in &result.requirements {
        let sum = sums.entry(place(&requirement.id, sources)).or_default();
        match (requirement.verdict, statement::gap(requirement)) {
            (Some(verdict), _) => {
                sum.verdict.add(verdict);
                match verdict {
                    Verdict::Pass | Verdict::Warning | Verdict::Fail => sum.decided += 1,
                    Verdict::Inconclusive | Verdict::Error => sum.open += 1,
                }
            }
            (None, Some(Gap::NotDecided)) => sum.open += 1,
            // What no test can decide belongs to no level.
            (None, Some(Gap::NotTestable)) => {}
            (None, Some(Gap::NotApplicable) | None) => sum.absent += 1,
        }
    }
    let rows = sums
        .into_iter()
        .filter(|(_, sum)| sum.decided + sum.open + sum.absent > 0);
    rows.map(|((_, name), sum)| row(name, &sum, result)).collect()
}

/// Where a requirement belongs, and its place in the table.
fn place(id: &str, sources: &Sources) -> (usize, String) {
    let group = id.rsplit_once('-').map_or(id, |(group, _)| group);
    if let Some(at) = CHAPTERS.iter().position(|(chapter, _)| *chapter == group) {
        return (at + 1, CHAPTERS[at].1.to_owned());
    }
    match sources.requirement(id).and_then(|known| known.action.as_deref()) {
        Some(action) => (CHAPTERS.len() + 1, format!("Action {action}")),
        None => (0, CORE.to_owned()),
    }
}

fn row(name: String, sum: &Sum, result: &RunResult) -> Level {
    let verdict = sum.verdict.get();
    let (reached, shown) = match verdict {
        Some(Verdict::Fail) => ("not reached", verdict),
        _ if sum.decided == 0 && sum.open == 0 => ("not claimed", None),
        Some(Verdict::Pass | Verdict::Warning) if sum.open == 0 => ("reached", verdict),
        // What passed of it does not make it green.
        _ => ("not shown", Some(Verdict::Inconclusive)),
    };
    let numbers = [
        (sum.decided, "decided"),
        (sum.open, "not decided"),
        (sum.absent, "not applicable"),
    ];
    let numbers = numbers.iter().filter(|(count, _)| *count > 0);
    let numbers: Vec<String> = numbers.map(|(count, word)| format!("{count} {word}")).collect();
    Level {
        claimed: claimed(&name, result),
        badge: shown.map_or(Badge::NOT_APPLICABLE, |verdict| Badge::of(Some(verdict))),
        reached,
        numbers: numbers.join(", "),
        name,
    }
}

/// Who says that the device has it.
fn claimed(name: &str, result: &RunResult) -> String {
    if name == CORE {
        return "asked of every device".to_owned();
    }
    let wanted = match name.strip_prefix("Action ") {
        Some(action) => action,
        None if name == "Maps" => "downloadMap",
        None => return String::new(),
    };
    let begins = format!("action {wanted} ");
    let offers = result
        .capabilities
        .iter()
        .filter(|capability| capability.name.starts_with(&begins) && capability.value == "yes");
    let offers: Vec<&str> = offers.map(|capability| capability.source.as_str()).collect();
    match offers.first() {
        Some(source) => format!("{source}: {wanted} ({})", many(offers.len(), "scope")),
        None => "nobody".to_owned(),
    }
}
