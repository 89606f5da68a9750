//! The file of a test with the deciding lines marked.

use std::collections::{BTreeMap, BTreeSet};

use super::view::Badge;
use crate::clean;
use crate::sources::TestSource;
use tck_result::TestResult;

/// Longest source shown, in lines.
const SOURCE_LINES: usize = 600;

/// The file of a test.
pub struct SourceView {
    pub file: String,
    pub lines: Vec<SourceLine>,
    pub cut: bool,
}

/// One line of it.
pub struct SourceLine {
    pub number: usize,
    pub text: String,
    /// `deciding`, `step` or nothing.
    pub class: &'static str,
    /// What stands beside a deciding line.
    pub notes: Vec<(Badge, String)>,
}

pub fn source_view(source: &TestSource, test: &TestResult) -> SourceView {
    let mut notes: BTreeMap<usize, Vec<(Badge, String)>> = BTreeMap::new();
    let mut deciding = BTreeSet::new();
    let mut around = BTreeSet::new();
    for decision in test.findings() {
        let clause = source
            .clauses
            .iter()
            .find(|clause| clause.path == decision.clause && clause.requirement == decision.requirement);
        let lines = match clause {
            Some(clause) => {
                around.extend(clause.step.0..=clause.step.1.min(clause.step.0 + SOURCE_LINES));
                clause.lines
            }
            None => match place_line(&decision.place, &source.file) {
                Some(line) => (line, line),
                None => continue,
            },
        };
        deciding.extend(lines.0..=lines.1.min(lines.0 + SOURCE_LINES));
        notes
            .entry(lines.0)
            .or_default()
            .push((Badge::of(Some(decision.verdict())), decision.requirement.clone()));
    }
    let lines = source
        .text
        .lines()
        .take(SOURCE_LINES)
        .enumerate()
        .map(|(at, text)| {
            let number = at + 1;
            SourceLine {
                number,
                text: clean::line(text).into_owned(),
                class: match (deciding.contains(&number), around.contains(&number)) {
                    (true, _) => "deciding",
                    (false, true) => "step",
                    (false, false) => "",
                },
                notes: notes.remove(&number).unwrap_or_default(),
            }
        })
        .collect();
    SourceView {
        file: source.file.clone(),
        lines,
        cut: source.text.lines().count() > SOURCE_LINES,
    }
}

/// The line of `file:line`, when it is that file.
fn place_line(place: &str, file: &str) -> Option<usize> {
    let (name, line) = place.rsplit_once(':')?;
    (name == file).then(|| line.parse().ok()).flatten()
}
