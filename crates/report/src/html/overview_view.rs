//! The first screen of the page: what is broken, and what to do so that more is decided.

use super::Anchors;
use super::view::Badge;
use crate::clean::{line, short};
use crate::findings::findings;
use crate::sources::Sources;
use crate::undecided::groups;
use tck_result::RunResult;

/// Most tests and monitors of a finding that are named.
const NAMED: usize = 4;

/// A row of the findings.
pub struct FindingView {
    pub badge: Badge,
    pub requirement: String,
    pub link: Option<String>,
    pub origin: String,
    pub asks: String,
    pub seen: String,
    pub count: u64,
    /// The first message, and whether the page shows it.
    pub first: Option<(u64, bool)>,
    /// Tests and monitors that found it, with their places in the page.
    pub by: Vec<(String, Option<String>)>,
    pub more: usize,
}

/// A row of what can be done.
pub struct AdviceView {
    pub count: String,
    pub advice: String,
    pub named: String,
}

/// The findings, the worst first. `shows` says whether the page shows a message.
pub fn finding_views(
    result: &RunResult,
    sources: &Sources,
    anchors: &Anchors,
    shows: impl Fn(u64) -> bool,
) -> Vec<FindingView> {
    let rows = findings(result, sources).into_iter().map(|finding| {
        let by: Vec<&str> = finding.tests.iter().chain(&finding.monitors).copied().collect();
        FindingView {
            badge: Badge::of(Some(finding.verdict)),
            requirement: finding.requirement.to_owned(),
            link: anchors.requirement(finding.requirement),
            origin: finding.origin.clone().unwrap_or_default(),
            asks: finding.asks.unwrap_or_default().to_owned(),
            seen: short(&line(&finding.seen), 400).into_owned(),
            count: finding.count,
            first: finding.first.map(|seq| (seq, shows(seq))),
            more: by.len().saturating_sub(NAMED),
            by: by
                .into_iter()
                .take(NAMED)
                .map(|id| (id.to_owned(), anchors.decider(id)))
                .collect(),
        }
    });
    rows.collect()
}

/// What can be done so that more is decided, the most helpful first.
pub fn advice_views(result: &RunResult) -> Vec<AdviceView> {
    let rows = groups(result).into_iter().map(|group| AdviceView {
        count: group.count(),
        advice: short(&line(&group.advice()), 400).into_owned(),
        named: group.named(),
    });
    rows.collect()
}
