//! Downloads of maps: one request to the server for each downloadMap action (section 6.7.3).

use std::collections::BTreeMap;

use crate::reference::Download;

use super::Agv;
use super::actions::Status;
use super::deeds::Problem;
use super::faults::FaultName as F;
use super::maps;
use super::tolerances::ToleranceName as T;

/// Downloads under way: actionId by token.
#[derive(Clone, Debug, Default)]
pub(crate) struct Downloads {
    under_way: BTreeMap<u64, String>,
    next: u64,
}

impl Downloads {
    /// Forgets the download of an action.
    pub(crate) fn forget(&mut self, action_id: &str) {
        self.under_way.retain(|_, id| id != action_id);
    }

    /// Whether none is under way.
    pub(crate) fn is_idle(&self) -> bool {
        self.under_way.is_empty()
    }

    /// Forgets all downloads.
    pub(crate) fn clear(&mut self) {
        self.under_way.clear();
    }
}

impl Agv {
    /// A downloadMap action begins: asks for the file, if the map is new and there is room.
    pub(crate) fn begin_download(&mut self, action_id: &str) {
        let Some(action) = self.actions.get(action_id).cloned() else {
            return;
        };
        if let Some(error_type) = self.persona.map_refusal.clone() {
            self.fail_as_told(&action, error_type);
            return;
        }
        let (map_id, version, url) = (
            action.text("mapId"),
            action.text("mapVersion"),
            action.text("mapDownloadLink"),
        );
        let under_way = self.downloads.under_way.values().filter_map(|id| self.actions.get(id));
        let twice = under_way
            .into_iter()
            .any(|other| other.text("mapId") == map_id && other.text("mapVersion") == version);
        let failed = (map_id.to_owned(), version.to_owned());
        let twice = twice || self.third.failed_downloads.contains(&failed);
        let refusal = match self.maps.room_for(map_id, version, self.faults) {
            Err(reason) => Some(reason),
            Ok(()) if twice => Some("the map is being downloaded already"),
            Ok(()) if map_id.is_empty() || version.is_empty() => Some("mapId or mapVersion is empty"),
            Ok(()) if !(url.starts_with("http://") || url.starts_with("https://")) => Some("the link is not HTTP"),
            Ok(()) => None,
        };
        if let Some(reason) = refusal {
            let silent = self.faults.has(F::DuplicateMapSilent) && reason.contains("already")
                || self.faults.has(F::StorageFullSilent) && reason.contains("room");
            self.fail(action_id, &Problem::map(&action, reason).silent_if(silent));
            self.renumber_if(F::FailedDownloadRenumbers);
            return;
        }
        if self.faults.has(F::MapNotFetched) {
            self.maps.store(map_id, version, self.faults);
            self.finish(action_id, None);
            return;
        }
        let token = self.downloads.next;
        self.downloads.next += 1;
        self.downloads.under_way.insert(token, action_id.to_owned());
        let url = url.to_owned();
        let queued = self.takes(T::R6LibDownloadQueued);
        self.fetch(token, url, queued);
        if self.faults.has(F::MapListedWhileLoading) {
            self.maps.store(map_id, version, self.faults);
        }
        let due = self.moment() + self.config.download_timeout;
        let due = if queued { due + super::sixth::QUEUING } else { due };
        let at_once = self.takes(T::R1DownloadRunsAtOnce);
        if let Some(action) = self.actions.get_mut(action_id) {
            action.status = if at_once { Status::Running } else { Status::Initializing };
            action.due = Some(due);
        }
    }

    /// The server was heard of.
    pub(crate) fn download_progress(&mut self, token: u64, progress: Download) {
        let Some(action_id) = self.downloads.under_way.get(&token).cloned() else {
            return;
        };
        match progress {
            Download::Begun => {
                let finished = self.faults.has(F::DownloadFinishedEarly);
                let running = !self.faults.has(F::DownloadNeverRunning);
                if let Some(action) = self.actions.get_mut(&action_id).filter(|_| running) {
                    action.status = if finished { Status::Finished } else { Status::Running };
                }
            }
            Download::Done(file) => self.download_done(&action_id, &file),
            Download::Failed(reason) => {
                let reason: String = reason.chars().take(200).collect();
                self.download_failed(&action_id, &reason);
            }
        }
    }

    fn download_done(&mut self, action_id: &str, file: &[u8]) {
        let Some(action) = self.actions.get(action_id).cloned() else {
            return;
        };
        if file.is_empty() {
            self.download_failed(action_id, "the file is empty");
        } else if !maps::hash_fits(file, action.text("mapHash")) && !self.faults.has(F::HashIgnored) {
            self.download_failed(action_id, "the file does not have the announced hash");
        } else {
            self.downloads.forget(action_id);
            self.renumber_if(F::DownloadRenumbers);
            if self.takes(T::R1MapListedNext) {
                self.finish(action_id, None);
                self.flush();
            }
            self.maps
                .store(action.text("mapId"), action.text("mapVersion"), self.faults);
            if self.faults.has(F::DownloadNeverEnds) {
                return;
            }
            self.finish(action_id, None);
        }
    }

    /// The map did not arrive; all else stays as it was (MAP-19, MAP-22).
    pub(crate) fn download_failed(&mut self, action_id: &str, reason: &str) {
        self.downloads.forget(action_id);
        if self.faults.has(F::R1DownloadFailureHangs) {
            if let Some(action) = self.actions.get_mut(action_id) {
                action.due = None;
            }
            return;
        }
        let Some(action) = self.actions.get(action_id).cloned() else {
            return;
        };
        if self.faults.has(F::DownloadFailureFinished) {
            self.finish(action_id, None);
            return;
        }
        if self.faults.has(F::R2BrokenDownloadListed) {
            let (id, version) = (action.text("mapId"), action.text("mapVersion"));
            self.maps.store(id, version, self.faults);
        }
        if self.faults.has(F::R1FailedDownloadPurges) {
            self.maps.purge(action.text("mapId"));
        }
        if self.faults.has(F::R3FailedDownloadBlocksRetry) {
            let failed = (action.text("mapId").to_owned(), action.text("mapVersion").to_owned());
            self.third.failed_downloads.push(failed);
        }
        let silent = self.faults.has(F::DownloadFailureSilent);
        self.fail(action_id, &Problem::map(&action, reason).silent_if(silent));
        self.renumber_if(F::FailedDownloadRenumbers);
    }

    fn renumber_if(&mut self, fault: F) {
        if self.faults.has(fault) {
            self.maps.renumber();
        }
    }
}
