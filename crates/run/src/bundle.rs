//! The result bundle: one folder per run.
//!
//! `journal.jsonl` is written through while the run goes on, `result.json` after every test, everything
//! else at the end. A run that breaks leaves what it has, marked as partial.

use std::path::{Path, PathBuf};

use tck_journal::file::{self, JournalWriter};

/// Why a bundle cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    /// A file or folder cannot be written.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// What the system said.
        reason: std::io::Error,
    },
}

/// A journal of more bytes is packed at the end of the run. What is smaller is more easily read as it is.
const LARGE: u64 = 1 << 20;

/// The evidence of a run.
pub const JOURNAL: &str = tck_journal::file::NAME;

/// The link in the folder of reports that leads to the run that was begun last.
pub const LATEST: &str = "latest";

/// A folder for the evidence of one run.
#[derive(Debug)]
pub struct Bundle {
    folder: PathBuf,
}

impl Bundle {
    /// Makes `reports/<manufacturer>-<serial>/<utc>-<id>/`, or a numbered one beside it: no run writes into the folder of
    /// another one that began in the same second.
    pub fn create(
        reports: &Path,
        manufacturer: &str,
        serial_number: &str,
        utc: jiff::Timestamp,
        run: &str,
    ) -> Result<Self, BundleError> {
        let device = safe(&format!("{manufacturer}-{serial_number}"));
        let begun = utc.strftime("%Y%m%dT%H%M%SZ").to_string();
        let device = reports.join(device);
        let folder = fresh(&device, &format!("{begun}-{}", safe(run)))
            .map_err(|reason| BundleError::Write { path: device, reason })?;
        point_at_latest(reports, &folder);
        Ok(Self { folder })
    }

    /// A bundle that is there already.
    #[must_use]
    pub fn open(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
        }
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Opens `journal.jsonl`.
    pub fn journal(&self) -> Result<JournalWriter, BundleError> {
        let path = self.folder.join(JOURNAL);
        JournalWriter::create(&path).map_err(|reason| BundleError::Write { path, reason })
    }

    /// Opens the journal with the records of another one in it, to go on with them.
    pub fn journal_after(&self, before: &Path) -> Result<JournalWriter, BundleError> {
        let path = self.folder.join(JOURNAL);
        JournalWriter::going_on(&path, before).map_err(|reason| BundleError::Write { path, reason })
    }

    /// Packs a large journal, and gives the name that it has then.
    pub fn pack_journal(&self) -> Result<&'static str, BundleError> {
        let path = self.folder.join(JOURNAL);
        let failed = |reason| BundleError::Write {
            path: path.clone(),
            reason,
        };
        if std::fs::metadata(&path).map_err(failed)?.len() <= LARGE {
            return Ok(JOURNAL);
        }
        file::pack(&self.folder).map_err(failed)?;
        Ok(file::PACKED)
    }

    /// Writes one file whole, so that nobody ever sees half of it.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<(), BundleError> {
        let path = self.folder.join(name);
        let draft = self.folder.join(format!(".{name}.draft"));
        let written = std::fs::write(&draft, content).and_then(|()| std::fs::rename(&draft, &path));
        written.map_err(|reason| {
            let _ = std::fs::remove_file(&draft);
            BundleError::Write { path, reason }
        })
    }
}

/// Makes a folder that was not there.
fn fresh(device: &Path, name: &str) -> std::io::Result<PathBuf> {
    std::fs::create_dir_all(device)?;
    let mut number = 1_u32;
    loop {
        let folder = match number {
            1 => device.join(name),
            _ => device.join(format!("{name}-{number}")),
        };
        match std::fs::create_dir(&folder) {
            Err(reason) if reason.kind() == std::io::ErrorKind::AlreadyExists => number += 1,
            made => return made.map(|()| folder),
        }
    }
}

/// Lets `reports/latest` lead to this run. It is a help for people and scripts: where there are no links, there is none.
fn point_at_latest(reports: &Path, folder: &Path) {
    let Ok(relative) = folder.strip_prefix(reports) else {
        return;
    };
    let draft = reports.join(format!(".latest-{}", std::process::id()));
    let _ = std::fs::remove_file(&draft);
    #[cfg(unix)]
    let linked = std::os::unix::fs::symlink(relative, &draft);
    #[cfg(windows)]
    let linked = std::os::windows::fs::symlink_dir(relative, &draft);
    // A link is replaced in one step; a folder of that name is somebody else's, and stays.
    if linked.is_ok() && std::fs::rename(&draft, reports.join(LATEST)).is_err() {
        let _ = std::fs::remove_file(&draft);
    }
}

/// A name of a device as part of a path: whatever it holds, it stays one folder.
fn safe(name: &str) -> String {
    let kept = name.chars().map(|c| {
        if c.is_ascii_alphanumeric() || "-_".contains(c) {
            c
        } else {
            '_'
        }
    });
    let kept: String = kept.take(100).collect();
    if kept.is_empty() { "device".to_owned() } else { kept }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn the_latest_run_is_found_under_a_name_that_stays() {
        let root = tempfile::tempdir().expect("folder");
        for run in ["one", "two"] {
            let bundle = Bundle::create(root.path(), "A", "1", jiff::Timestamp::UNIX_EPOCH, run).expect("bundle");
            let latest = root.path().join(LATEST).canonicalize().expect("link");
            assert_eq!(latest, bundle.folder().canonicalize().expect("bundle"));
        }
        let other = tempfile::tempdir().expect("folder");
        let kept = other.path().join(LATEST).join("mine");
        std::fs::create_dir_all(&kept).expect("folder");
        Bundle::create(other.path(), "A", "1", jiff::Timestamp::UNIX_EPOCH, "r").expect("bundle");
        assert!(kept.is_dir());
    }

    #[test]
    fn two_runs_that_begin_in_one_second_have_a_folder_each() {
        let root = tempfile::tempdir().expect("folder");
        let create = || Bundle::create(root.path(), "A", "1", jiff::Timestamp::UNIX_EPOCH, "r").expect("bundle");
        let all = [create(), create(), create()];
        for bundle in &all {
            bundle.journal().expect("journal");
        }
        assert!(all[2].folder().ends_with("19700101T000000Z-r-3"));
    }

    #[test]
    fn a_hostile_name_stays_one_folder() {
        let root = tempfile::tempdir().expect("folder");
        let bundle =
            Bundle::create(root.path(), "../../x", "/etc\0", jiff::Timestamp::UNIX_EPOCH, "r").expect("bundle");
        assert!(bundle.folder().starts_with(root.path()));
        assert_eq!(
            bundle.folder().components().count(),
            root.path().components().count() + 2
        );
    }
}
