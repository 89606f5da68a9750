//! The bundles below a folder: what is evidence, and what is none and why.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::header;
use crate::seen::{SeenRun, Subject};
use tck_audit::saved;
use tck_journal::file;
use tck_report::clean::{line, short};
use tck_report::json;
use tck_report::manifest::{Manifest, NAME as MANIFEST};

/// The name of a result in its bundle.
const RESULT: &str = "result.json";
/// The name of the page for people in a bundle.
pub(crate) const REPORT: &str = "report.html";
/// How deep bundles may lie below the folder.
const DEEPEST: usize = 16;

/// Something that looks like a bundle and is no evidence, or not by itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct LeftOut {
    /// The folder, below the one that was read.
    pub path: String,
    /// Of which kind the reason is.
    pub why: Why,
    /// The reason, in one line.
    pub text: String,
}

/// Why a bundle is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Why {
    /// Its files are not what its manifest says.
    Damaged,
    /// It has no manifest: the run was killed, or somebody has kept only a part of it.
    NoManifest,
    /// There is a journal, and no result of it.
    NoResult,
    /// Its result cannot be read, or is one of another program or of another version of this one.
    Unreadable,
    /// It is not certain that it was the device that was judged.
    Doubtful,
    /// A later run has gone on with it, and holds what it has decided.
    GoneOnWith,
    /// It is there already.
    Twice,
    /// Nothing of it was judged.
    NothingJudged,
}

impl Why {
    /// The word used in every output.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Damaged => "damaged",
            Self::NoManifest => "no manifest",
            Self::NoResult => "no result",
            Self::Unreadable => "unreadable",
            Self::Doubtful => "doubtful",
            Self::GoneOnWith => "gone on with",
            Self::Twice => "twice",
            Self::NothingJudged => "nothing judged",
        }
    }
}

/// What lies below a folder.
#[derive(Debug, Default)]
pub(crate) struct Found {
    pub runs: Vec<SeenRun>,
    pub left_out: Vec<LeftOut>,
    /// How many bundles are evidence: an audit of many vehicles is one.
    pub bundles: usize,
}

/// Reads every bundle below a folder. Links are not followed, so that `latest` counts no run twice.
///
/// # Errors
/// When a folder cannot be listed.
pub(crate) fn find(folder: &Path) -> Result<Found, (PathBuf, io::Error)> {
    let mut folders = Vec::new();
    walk(folder, 0, &mut folders)?;
    folders.sort();
    let mut reading = Reading::default();
    for bundle in folders {
        let name = bundle.strip_prefix(folder).unwrap_or(&bundle);
        let parts: Vec<String> = name.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        let path = if parts.is_empty() {
            ".".to_owned()
        } else {
            parts.join("/")
        };
        reading.take(&bundle, path);
    }
    Ok(reading.end())
}

/// Folders that hold the result or the journal of a run.
fn walk(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<(), (PathBuf, io::Error)> {
    let failed = |error| (folder.to_owned(), error);
    let is_bundle = |name: &str| folder.join(name).is_file();
    if is_bundle(RESULT) || is_bundle(file::NAME) || is_bundle(file::PACKED) {
        found.push(folder.to_owned());
        return Ok(());
    }
    if depth == DEEPEST {
        return Ok(());
    }
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if entry.file_type().map_err(failed)?.is_dir() {
            walk(&entry.path(), depth + 1, found)?;
        }
    }
    Ok(())
}

#[derive(Default)]
struct Reading {
    found: Found,
    /// Bundles by their root hash.
    roots: BTreeMap<String, String>,
    /// Runs that a later one has gone on with: subject, identifier and start, and the path of the later one.
    joined: BTreeMap<(Subject, String, String), String>,
}

impl Reading {
    fn leave_out(&mut self, path: String, why: Why, text: &str) {
        let text = short(&line(text.trim()), 600).into_owned();
        self.found.left_out.push(LeftOut { path, why, text });
    }

    fn take(&mut self, bundle: &Path, path: String) {
        if !bundle.join(RESULT).is_file() {
            let text = "there is a journal, and no result: `report` makes one of it";
            return self.leave_out(path, Why::NoResult, text);
        }
        if !bundle.join(MANIFEST).is_file() {
            let text =
                "there is no manifest: the run was killed (`report` makes one), or a part of the bundle is missing";
            return self.leave_out(path, Why::NoManifest, text);
        }
        let root = match Manifest::verify(bundle) {
            Ok(found) if found.holds() => found.root,
            Ok(found) => {
                let text = found.text();
                let text: Vec<&str> = text.lines().take(5).map(str::trim).collect();
                return self.leave_out(path, Why::Damaged, &text.join("; "));
            }
            Err(error) => return self.leave_out(path, Why::Damaged, &error.to_string()),
        };
        if let Some(other) = self.roots.get(&root) {
            let text = format!("it is the bundle in {other} once more");
            return self.leave_out(path, Why::Twice, &text);
        }
        self.roots.insert(root.clone(), path.clone());
        let before = self.found.runs.len();
        if saved::is_audit(bundle) {
            self.audit(bundle, path, &root);
        } else {
            self.run(bundle, path, root);
        }
        let has_report = bundle.join(REPORT).is_file();
        for run in &mut self.found.runs[before..] {
            run.has_report = has_report;
        }
    }

    fn audit(&mut self, bundle: &Path, path: String, root: &str) {
        match saved::read(bundle) {
            Err(error) => self.leave_out(path, Why::Unreadable, &error.to_string()),
            Ok(result) => {
                let all = SeenRun::of_audit(&result, &path, root);
                if all.is_empty() {
                    return self.leave_out(path, Why::NothingJudged, "the audit has decided nothing of anybody");
                }
                self.found.bundles += 1;
                self.found.runs.extend(all);
            }
        }
    }

    fn run(&mut self, bundle: &Path, path: String, root: String) {
        let result = match json::read(&bundle.join(RESULT)) {
            Ok(result) => result,
            Err(error) => return self.leave_out(path, Why::Unreadable, &error.to_string()),
        };
        if let Some(doubt) = &result.mixed {
            return self.leave_out(path, Why::Doubtful, doubt);
        }
        // Without its first record it is not known what was started how, and nothing else is lost.
        let header = header::read(&file::find(bundle)).ok().flatten();
        self.found.bundles += 1;
        let run = SeenRun::of_run(&result, header.as_deref(), path.clone(), root);
        for before in &result.joined {
            self.joined.insert(
                (run.subject.clone(), before.run.clone(), before.started.clone()),
                path.clone(),
            );
        }
        self.found.runs.push(run);
    }

    fn end(mut self) -> Found {
        // Two runs may begin in the same millisecond, with the same seed and of devices with the same name: a
        // campaign begins several at once. Their command lines tell them apart.
        let mut same: BTreeMap<_, String> = BTreeMap::new();
        let runs = std::mem::take(&mut self.found.runs);
        for run in runs {
            let key = (run.run.clone()).map(|id| ((run.subject.clone(), id, run.started.clone()), run.command.clone()));
            let reason = key.as_ref().and_then(|key| {
                let later = self
                    .joined
                    .get(&key.0)
                    .filter(|later| **later != run.path && run.partial.is_some());
                let later = later.map(|later| (Why::GoneOnWith, format!("the run in {later} has gone on with it")));
                let twice = || {
                    let other = same.get(key)?;
                    Some((Why::Twice, format!("it is the run in {other}, rendered again")))
                };
                later.or_else(twice)
            });
            match reason {
                Some((why, text)) => {
                    self.found.bundles -= 1;
                    self.leave_out(run.path, why, &text);
                }
                None => {
                    if let Some(key) = key {
                        same.insert(key, run.path.clone());
                    }
                    self.found.runs.push(run);
                }
            }
        }
        self.found
            .left_out
            .sort_by(|one, other| (one.why, &one.path).cmp(&(other.why, &other.path)));
        self.found
    }
}
