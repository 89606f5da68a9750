//! The result bundle: one folder per run.
//!
//! `journal.jsonl` is written through while the run goes on, `result.json` after every test, everything
//! else at the end. A run that breaks leaves what it has, marked as partial.

use std::path::{Path, PathBuf};

use super::latest::Latest;
use tck_journal::file::{self, JournalWriter};
use tck_report::json::write_atomically;

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

/// A folder for the evidence of one run.
#[derive(Debug)]
pub struct Bundle {
    folder: PathBuf,
    latest: Option<Latest>,
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
        let latest = Some(Latest::lead_to(reports, &folder));
        Ok(Self { folder, latest })
    }

    /// Whether another run is going on below the same folder of reports, so that `latest` leads to neither.
    #[must_use]
    pub fn is_one_of_several(&self) -> bool {
        self.latest.as_ref().is_some_and(Latest::is_shared)
    }

    /// The run could not begin: `latest` does not lead here, and a folder without evidence goes.
    pub fn abandon(self) {
        if let Some(latest) = &self.latest {
            latest.lead_nowhere();
        }
        let is_empty = |path: &Path| std::fs::metadata(path).is_ok_and(|facts| facts.is_file() && facts.len() == 0);
        let files = std::fs::read_dir(&self.folder).into_iter().flatten().flatten();
        for file in files.map(|entry| entry.path()).filter(|path| is_empty(path)) {
            let _ = std::fs::remove_file(file);
        }
        // Only an empty folder goes, here and above.
        let _ = std::fs::remove_dir(&self.folder);
        if let Some(device) = self.folder.parent() {
            let _ = std::fs::remove_dir(device);
        }
    }

    /// A bundle that is there already.
    #[must_use]
    pub fn open(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            latest: None,
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
        write_whole(&self.folder.join(name), content)
    }
}

/// Writes a file whole, so that nobody ever sees half of it; its folder is made when it is not there.
///
/// # Errors
/// When it cannot be written.
pub fn write_whole(path: &Path, content: &[u8]) -> Result<(), BundleError> {
    let failed = |reason| BundleError::Write {
        path: path.to_owned(),
        reason,
    };
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    write_atomically(path, content).map_err(failed)
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
