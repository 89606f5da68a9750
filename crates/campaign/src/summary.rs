//! What came of a campaign: as text, Markdown, JUnit XML and JSON.

use std::fmt::Write as _;

use serde::Serialize;

use crate::place::Settled;
use tck_base::verdict::Verdict;
use tck_report::clean::{line, short};
use tck_report::junit::{self, JunitError, Plain};
use tck_report::markdown_table::{Column, cell, table};

/// The format of a summary.
pub const FORMAT: &str = "vda5050-tck.campaign/1";

/// What came of a campaign so far.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Summary {
    /// [`FORMAT`].
    pub format: String,
    /// Name and version of the tool.
    pub tool: String,
    /// The file of the campaign.
    pub campaign: String,
    /// The worst exit code of all; that of a breakdown as long as an entry is not carried out.
    pub exit: u8,
    /// Each device with each suite, in the order of the file.
    pub entries: Vec<Line>,
}

/// What came of one entry.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Line {
    /// Name of the device.
    pub device: String,
    /// Name of the suite.
    pub suite: String,
    /// The exit code of its run; absent as long as it is not carried out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exit: Option<u8>,
    /// What that code means.
    pub meaning: String,
    /// The verdict of the run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verdict: Option<String>,
    /// What the run says in one sentence.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub said: String,
    /// Its bundle, below the folder of the campaign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bundle: Option<String>,
    /// The root hash of the bundle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub root: Option<String>,
    /// How many runs it took.
    pub attempts: u64,
}

/// Exit codes from the best to the worst: of a failure and a breakdown the failure is what counts.
const RANKS: [u8; 7] = [0, 3, 4, 130, 2, 5, 1];
/// The exit code of what is not carried out.
const NOT_CARRIED_OUT: u8 = 5;

impl Summary {
    /// Of these entries.
    #[must_use]
    pub fn of(campaign: String, entries: Vec<Line>) -> Self {
        let rank = |exit: u8| RANKS.iter().position(|known| *known == exit).unwrap_or(RANKS.len() - 2);
        let exits = entries.iter().map(|line| line.exit.unwrap_or(NOT_CARRIED_OUT));
        Self {
            format: FORMAT.to_owned(),
            tool: tck_journal::tool(),
            campaign,
            exit: exits.max_by_key(|exit| rank(*exit)).unwrap_or(NOT_CARRIED_OUT),
            entries,
        }
    }

    /// How many entries are carried out.
    #[must_use]
    pub fn done(&self) -> usize {
        self.entries.iter().filter(|line| line.exit.is_some()).count()
    }

    /// The summary for the terminal.
    #[must_use]
    pub fn text(&self) -> String {
        let width = self
            .entries
            .iter()
            .map(|line| line.name().chars().count())
            .max()
            .unwrap_or_default();
        let mut text = String::new();
        for one in &self.entries {
            let _ = write!(text, "{:<12}  {:<width$}", one.word(), one.name());
            if let Some(bundle) = &one.bundle {
                let _ = write!(text, "  {}", line(bundle));
            }
            text.push('\n');
            if one.exit != Some(0) && !one.said.is_empty() {
                let _ = writeln!(text, "              {}", short(&line(&one.said), 300));
            }
        }
        let _ = writeln!(
            text,
            "\n{} of {} carried out; exit code {}",
            self.done(),
            self.entries.len(),
            self.exit
        );
        text
    }

    /// The summary in Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let rows = self.entries.iter().map(|one| {
            let bundle = one.bundle.as_deref().unwrap_or_default();
            [
                cell(&one.device),
                cell(&one.suite),
                one.word().to_owned(),
                cell(&one.said),
                cell(bundle),
            ]
        });
        let columns = ["Device", "Suite", "Outcome", "What", "Bundle"].map(Column::Text);
        format!(
            "## Campaign {}\n\n{} of {} carried out; exit code {}.\n\n{}",
            cell(&self.campaign),
            self.done(),
            self.entries.len(),
            self.exit,
            table(columns, rows)
        )
    }

    /// The summary as JUnit XML: a suite for each device, a case for each of its runs.
    ///
    /// # Errors
    /// When the XML writer refuses; it has no reason to.
    pub fn junit(&self) -> Result<String, JunitError> {
        let cases = self.entries.iter().map(|one| Plain {
            suite: one.device.clone(),
            name: one.suite.clone(),
            verdict: match one.exit {
                Some(0) => Verdict::Pass,
                Some(1) => Verdict::Fail,
                Some(3) => Verdict::Inconclusive,
                _ => Verdict::Error,
            },
            elsewhere: None,
            text: match one.said.as_str() {
                "" => one.meaning.clone(),
                said => format!("{}: {}", one.meaning, short(said, 600)),
            },
        });
        junit::plain(&cases.collect::<Vec<Plain>>())
    }
}

impl Line {
    /// An entry that ended so, or is not carried out; `meaning` is what its exit code means.
    #[must_use]
    pub fn of(device: &str, suite: &str, settled: Option<Settled>, meaning: &str) -> Self {
        let mut one = Self {
            device: device.to_owned(),
            suite: suite.to_owned(),
            exit: None,
            meaning: meaning.to_owned(),
            verdict: None,
            said: String::new(),
            bundle: None,
            root: None,
            attempts: 0,
        };
        if let Some(settled) = settled {
            one.exit = Some(settled.exit);
            one.verdict = settled.verdict;
            one.said = settled.said;
            one.bundle = settled.bundle;
            one.root = settled.root;
            one.attempts = settled.attempts;
        }
        one
    }

    fn name(&self) -> String {
        format!("{}/{}", self.device, self.suite)
    }

    /// One word for how it ended.
    fn word(&self) -> &'static str {
        match self.exit {
            Some(0) => "PASS",
            Some(1) => "FAIL",
            Some(3) => "UNDECIDED",
            Some(2) => "REFUSED",
            Some(4) => "NOTHING",
            Some(_) => "BROKEN",
            None => "not run",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(exit: Option<u8>) -> Line {
        let settled = exit.map(|exit| Settled {
            exit,
            bundle: None,
            root: None,
            verdict: None,
            said: "<said>".to_owned(),
            attempts: 1,
        });
        Line::of("a", "b", settled, "meaning")
    }

    #[test]
    fn the_worst_counts_and_what_is_not_carried_out_is_never_green() {
        let exit =
            |exits: &[Option<u8>]| Summary::of(String::new(), exits.iter().map(|exit| line(*exit)).collect()).exit;
        assert_eq!(exit(&[Some(0), Some(0)]), 0);
        assert_eq!(exit(&[Some(0), None]), 5);
        assert_eq!(exit(&[Some(5), Some(1), None]), 1);
        assert_eq!(exit(&[Some(3), Some(0)]), 3);
        assert_eq!(exit(&[Some(2), Some(4), Some(3)]), 2);
        assert_ne!(exit(&[]), 0);
    }

    #[test]
    fn every_rendering_has_every_entry() {
        let summary = Summary::of("c.toml".to_owned(), vec![line(Some(0)), line(Some(1)), line(None)]);
        assert!(summary.text().contains("2 of 3 carried out; exit code 1"));
        assert!(summary.markdown().matches("| a | b |").count() == 3 && summary.markdown().contains("&lt;said&gt;"));
        let junit = summary.junit().expect("XML");
        assert_eq!(
            (junit.matches("<testcase").count(), junit.matches("<failure").count()),
            (3, 1),
            "{junit}"
        );
        assert_eq!(junit.matches("<error").count(), 1, "{junit}");
    }
}
