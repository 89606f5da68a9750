//! `latest`: the link in the folder of reports that leads to the run of the last call, and to no other one.
//!
//! It is a help for people and scripts: where there are no links, there is none. A call that comes to nothing takes it away, so
//! that nobody reads an earlier run under that name, and where several runs are going on below one folder it leads to none
//! of them. That is known by a lock on the folder, which every run holds; where there are no locks, each takes itself for alone.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

/// The name of the link.
pub const LATEST: &str = "latest";

/// The part of one run in the link.
#[derive(Debug)]
pub(super) struct Latest {
    link: PathBuf,
    folder: PathBuf,
    /// Held for as long as the run goes on.
    lock: Option<File>,
    shared: bool,
}

impl Latest {
    /// Lets the link lead to the folder of a run, if the run is alone.
    pub(super) fn lead_to(reports: &Path, folder: &Path) -> Self {
        let mut latest = Self {
            link: reports.join(LATEST),
            folder: folder.to_owned(),
            lock: File::open(reports).ok(),
            shared: false,
        };
        let taken = latest.lock.as_ref().map(File::try_lock);
        latest.shared = matches!(taken, Some(Err(TryLockError::WouldBlock)));
        if latest.shared {
            remove(&latest.link);
        } else {
            latest.point(reports);
        }
        // From here on others see that this run goes on. Nobody has the lock alone for long.
        if let Some(lock) = &latest.lock {
            let _ = lock.lock_shared();
        }
        // Between the two locks another run may have come.
        if !latest.shared && latest.leads_elsewhere() {
            latest.shared = true;
            remove(&latest.link);
        }
        latest
    }

    /// Whether other runs are going on beside this one.
    pub(super) fn is_shared(&self) -> bool {
        self.shared
    }

    /// Takes the link away, if it leads to this run.
    pub(super) fn lead_nowhere(&self) {
        if !self.leads_elsewhere() {
            remove(&self.link);
        }
    }

    fn leads_elsewhere(&self) -> bool {
        let (Ok(there), Ok(own)) = (self.link.canonicalize(), self.folder.canonicalize()) else {
            return false;
        };
        there != own
    }

    fn point(&self, reports: &Path) {
        let Ok(relative) = self.folder.strip_prefix(reports) else {
            return;
        };
        let draft = reports.join(format!(".latest-{}", std::process::id()));
        let _ = std::fs::remove_file(&draft);
        #[cfg(unix)]
        let linked = std::os::unix::fs::symlink(relative, &draft);
        #[cfg(windows)]
        let linked = std::os::windows::fs::symlink_dir(relative, &draft);
        // A link is replaced in one step; a folder of that name is somebody else's, and stays.
        if linked.is_ok() && std::fs::rename(&draft, &self.link).is_err() {
            let _ = std::fs::remove_file(&draft);
        }
    }
}

/// Takes the link away: the call that would have set it came to nothing.
pub fn forget_latest(reports: &Path) {
    remove(&reports.join(LATEST));
}

/// The folder of the run before this call: where the link leads, or, where a call that came to nothing has taken it away, the
/// newest run that has a result.
#[must_use]
pub fn newest(reports: &Path) -> PathBuf {
    let link = reports.join(LATEST);
    if link.join("result.json").is_file() {
        return link;
    }
    let list = |folder: &Path| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect::<Vec<PathBuf>>()
    };
    let devices = list(reports).into_iter().filter(|path| !path.is_symlink());
    let runs = devices.flat_map(|device| list(&device));
    let runs = runs.filter(|run| run.join("result.json").is_file());
    // Their names begin with the time at which they began.
    let newest = runs.max_by(|one, other| one.file_name().cmp(&other.file_name()));
    newest.unwrap_or(link)
}

/// Removes a link; what else has that name is somebody else's.
fn remove(link: &Path) {
    if link.is_symlink() {
        let _ = std::fs::remove_file(link);
        #[cfg(windows)]
        let _ = std::fs::remove_dir(link);
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use crate::Bundle;

    fn bundle(reports: &Path, run: &str) -> Bundle {
        Bundle::create(reports, "A", "1", jiff::Timestamp::UNIX_EPOCH, run).expect("bundle")
    }

    #[test]
    fn the_latest_run_is_found_under_a_name_that_stays() {
        let root = tempfile::tempdir().expect("folder");
        for run in ["one", "two"] {
            let bundle = bundle(root.path(), run);
            let latest = root.path().join(LATEST).canonicalize().expect("link");
            assert_eq!(latest, bundle.folder().canonicalize().expect("bundle"));
            assert!(!bundle.is_one_of_several());
        }
        let other = tempfile::tempdir().expect("folder");
        let kept = other.path().join(LATEST).join("mine");
        std::fs::create_dir_all(&kept).expect("folder");
        bundle(other.path(), "r");
        assert!(kept.is_dir());
        forget_latest(other.path());
        assert!(kept.is_dir(), "a folder of that name is not ours");
    }

    #[test]
    fn of_runs_that_go_on_at_the_same_time_none_is_the_latest() {
        let root = tempfile::tempdir().expect("folder");
        let first = bundle(root.path(), "one");
        let second = bundle(root.path(), "two");
        assert!(second.is_one_of_several() && !root.path().join(LATEST).exists());
        drop(first);
        let third = bundle(root.path(), "three");
        assert!(third.is_one_of_several() && !root.path().join(LATEST).exists());
        drop((second, third));
        let alone = bundle(root.path(), "four");
        assert!(!alone.is_one_of_several() && root.path().join(LATEST).exists());
    }

    #[test]
    fn a_run_that_could_not_begin_leaves_no_link_and_no_empty_folder() {
        let root = tempfile::tempdir().expect("folder");
        let failed = bundle(root.path(), "one");
        failed.journal().expect("journal");
        let folder = failed.folder().to_owned();
        failed.abandon();
        assert!(!folder.exists() && !root.path().join(LATEST).is_symlink());
        // What it has left stays.
        let failed = bundle(root.path(), "two");
        let folder = failed.folder().to_owned();
        failed.write("device.log", b"no such file").expect("log");
        failed.abandon();
        assert!(folder.join("device.log").exists() && !root.path().join(LATEST).is_symlink());
    }

    #[test]
    fn without_a_link_the_newest_run_with_a_result_is_the_one_before() {
        let root = tempfile::tempdir().expect("folder");
        assert_eq!(newest(root.path()), root.path().join(LATEST));
        for (second, device) in [(2, "A"), (3, "B"), (1, "C")] {
            let begun = jiff::Timestamp::new(second, 0).expect("time");
            let bundle = Bundle::create(root.path(), device, "1", begun, "r").expect("bundle");
            bundle.write("result.json", b"{}").expect("result");
        }
        assert_eq!(newest(root.path()), root.path().join(LATEST));
        forget_latest(root.path());
        assert!(newest(root.path()).starts_with(root.path().join("B-1")));
    }
}
