//! The bundle of a qualification or an exploration: a result, its cases as JUnit, and a manifest.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_report::junit::{self, Plain};
use tck_report::manifest::Manifest;
use tck_run::write_whole;

/// Name of the result inside its bundle.
const NAME: &str = "result.json";

/// Reads the result of a bundle.
pub(super) fn read<R: DeserializeOwned>(folder: &Path) -> Result<R, Problem> {
    let path = folder.join(NAME);
    let wrong = |why: String| Problem::from(Diagnostic::whole("result", format!("{}: {why}", path.display())));
    let text = std::fs::read(&path).map_err(|error| wrong(error.to_string()))?;
    serde_json::from_slice(&text).map_err(|error| wrong(error.to_string()))
}

/// Writes a bundle with these cases, and with more files by name and text; gives its root hash.
pub(super) fn write<R: Serialize>(
    result: &R,
    cases: &[Plain],
    more: Vec<(String, String)>,
    folder: &Path,
) -> Result<String, Problem> {
    let broken = |error: &dyn std::fmt::Display| Problem::Environment(error.to_string());
    let text = serde_json::to_string_pretty(result).map_err(|error| broken(&error))? + "\n";
    let xml = junit::plain(cases).map_err(|error| broken(&error))?;
    let files = [(NAME.to_owned(), text), ("junit.xml".to_owned(), xml)];
    for (name, text) in files.into_iter().chain(more) {
        write_whole(&folder.join(name), text.as_bytes()).map_err(|error| broken(&error))?;
    }
    Ok(Manifest::write(folder).map_err(|error| broken(&error))?.root)
}
