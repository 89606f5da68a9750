//! The history of a folder: series of runs that can be held against each other.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::bundles::{self, LeftOut};
use crate::conditions::Change;
use crate::course::{self, Course};
use crate::seen::{Kind, SeenRun, Subject};
use tck_base::verdict::Verdict;

/// The format of a history.
pub const FORMAT: &str = "vda5050-tck.history/1";

/// What became of every requirement over all runs below a folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct History {
    /// [`FORMAT`].
    pub format: String,
    /// Name and version of the tool.
    pub tool: String,
    /// The folder that was read.
    pub folder: String,
    /// How many bundles are evidence.
    pub bundles: usize,
    /// Runs of one device, role, protocol version and kind, the earliest first; what is broken stands in front.
    pub series: Vec<Series>,
    /// What looks like a bundle and is no evidence.
    pub left_out: Vec<LeftOut>,
}

/// Runs that can be held against each other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Series {
    /// Of which kind they are.
    pub kind: Kind,
    /// Manufacturer of the device.
    pub manufacturer: String,
    /// Its serial number.
    pub serial_number: String,
    /// `agv` or `master-control`.
    pub role: String,
    /// Protocol version judged by.
    pub protocol: String,
    /// The runs, the earliest first.
    pub runs: Vec<Run>,
    /// Every requirement that a run knows of, in the order of the catalogue as far as the runs tell.
    pub requirements: Vec<Course>,
}

/// One run of a series.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Run {
    /// Its number in the series, counted from 1.
    pub number: usize,
    /// The folder of its bundle, below the folder that was read.
    pub path: String,
    /// Its identifier; absent for an audit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// When it began, or when the first message was recorded; empty where that is not known.
    pub started: String,
    /// Its verdict; absent when nothing was decided.
    pub verdict: Option<Verdict>,
    /// Why it is partial.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub partial: Option<String>,
    /// Whether only some of the tests were selected.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub selection: bool,
    /// How many requirements it has decided.
    pub decided: usize,
    /// The firmware that the profile names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub firmware: Option<String>,
    /// Root hash of its bundle.
    pub root: String,
    /// Its page for people, below the folder that was read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report: Option<String>,
    /// What differs from the run before it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<Change>,
}

/// Why there is no history.
#[derive(Debug, thiserror::Error)]
pub enum GatherError {
    /// A folder cannot be listed.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The folder.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
}

/// Reads all bundles below a folder, and follows every requirement.
///
/// # Errors
/// When a folder cannot be read. What is wrong with a bundle stands in the history.
pub fn gather(folder: &Path) -> Result<History, GatherError> {
    let found = bundles::find(folder).map_err(|(path, source)| GatherError::Io { path, source })?;
    let mut subjects: BTreeMap<Subject, Vec<SeenRun>> = BTreeMap::new();
    for run in found.runs {
        subjects.entry(run.subject.clone()).or_default().push(run);
    }
    let mut series: Vec<Series> = subjects
        .into_iter()
        .map(|(subject, runs)| Series::of(subject, runs))
        .collect();
    series.sort_by_key(Series::first_state);
    Ok(History {
        format: FORMAT.to_owned(),
        tool: tck_journal::tool(),
        folder: folder.display().to_string(),
        bundles: found.bundles,
        series,
        left_out: found.left_out,
    })
}

impl Series {
    fn of(subject: Subject, mut runs: Vec<SeenRun>) -> Self {
        // What does not say when it began stands first, and what began at the same time in the order of the names.
        let begun = |run: &SeenRun| run.started.parse::<jiff::Timestamp>().ok();
        runs.sort_by(|one, other| (begun(one), &one.path).cmp(&(begun(other), &other.path)));
        let mut ids: Vec<&str> = Vec::new();
        let mut known = std::collections::BTreeSet::new();
        for id in runs.iter().rev().flat_map(|run| &run.order) {
            if known.insert(id.as_str()) {
                ids.push(id);
            }
        }
        let requirements = ids.into_iter().map(|id| course::follow(id, &runs)).collect();
        let shown = runs.iter().enumerate().map(|(at, run)| Run {
            number: at + 1,
            path: run.path.clone(),
            run: run.run.clone(),
            started: run.started.clone(),
            verdict: run.verdict,
            partial: run.partial.clone(),
            selection: run.selection,
            decided: run.decided(),
            firmware: run.conditions.firmware().map(str::to_owned),
            root: run.root.clone(),
            report: run.has_report.then(|| format!("{}/{}", run.path, bundles::REPORT)),
            changes: at
                .checked_sub(1)
                .map_or_else(Vec::new, |before| runs[before].conditions.changes(&run.conditions)),
        });
        Self {
            kind: subject.kind,
            manufacturer: subject.manufacturer,
            serial_number: subject.serial_number,
            role: subject.role,
            protocol: subject.protocol,
            runs: shown.collect(),
            requirements,
        }
    }

    /// How its worst requirement stands; nothing when nothing happened.
    fn first_state(&self) -> (bool, Option<course::State>) {
        let first = self
            .requirements
            .iter()
            .map(|course| course.state)
            .filter(|state| state.is_news())
            .min();
        (first.is_none(), first)
    }

    /// The requirements in which something happened: what is to be looked at first before all else, and what came up last first.
    #[must_use]
    pub fn news(&self) -> Vec<&Course> {
        let mut news: Vec<&Course> = self
            .requirements
            .iter()
            .filter(|course| course.state.is_news())
            .collect();
        news.sort_by_key(|course| (course.state, std::cmp::Reverse(course.fixed_in.or(course.since))));
        news
    }

    /// How many requirements stand so at the end.
    #[must_use]
    pub fn count(&self, state: course::State) -> usize {
        self.requirements.iter().filter(|course| course.state == state).count()
    }
}
