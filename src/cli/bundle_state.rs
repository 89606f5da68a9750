//! Whether a bundle is still what its manifest says, before something is written over it.

use std::path::Path;

use super::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_journal::file::{self, NAME, PACKED};
use tck_report::manifest;

/// The folder of a joined bundle that holds the results of its parts.
pub(super) const PARTS: &str = "shards";

/// Refuses to write over a bundle that was changed: it would come out intact. What is missing is made again; a run that was
/// killed has no manifest.
pub(super) fn unchanged(folder: &Path) -> Result<(), Problem> {
    if !folder.join(manifest::NAME).exists() {
        return Ok(());
    }
    let found = manifest::Manifest::verify(folder)
        .map_err(|error| Problem::from(Diagnostic::whole("manifest", error.to_string())))?;
    let name = file::name_of(&file::find(folder));
    let is_there = !found
        .missing
        .iter()
        .any(|file| [NAME, PACKED].contains(&file.as_str()) || file.starts_with(PARTS));
    if found.root_holds && found.changed.is_empty() && found.extra.is_empty() && is_there {
        return Ok(());
    }
    let title = format!(
        "{} is not what its manifest says, and nothing is written over it\n{}",
        folder.display(),
        found.text().trim_end()
    );
    let hint = format!("copy `{name}` alone into another folder, and give that one; `--rejudge` writes nothing");
    Err(Diagnostic::whole("manifest", title).hint(hint).into())
}
