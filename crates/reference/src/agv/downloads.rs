//! Downloads of maps and zone sets: one request to the server for each action that fetches one (section 6.7.3).
//!
//! A download without mapVersion is refused: one table asks for it, the text does not (the ruling of MAP-16). A hash is
//! compared as the parties have agreed (that of MAP-34).

use std::collections::BTreeMap;

use crate::{Download, Output};

use super::Agv;
use super::action_effect::{Outcome, Problem};
use super::action_kinds::Effect;
use super::actions::{Action, Status};
use super::hook_points::{Event, Permission};
use super::maps;

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
    pub(crate) fn begin_download(&mut self, action_id: &str) -> Outcome {
        let Some(action) = self.actions.get(action_id).cloned() else {
            return Outcome::Open;
        };
        let (map_id, version, url) = (
            action.text("mapId"),
            action.text("mapVersion"),
            action.text("mapDownloadLink"),
        );
        let twice = self.is_downloading(|other| other.text("mapId") == map_id && other.text("mapVersion") == version);
        let known = self.maps.has_version(map_id, version) && !self.allows(Permission::DownloadAgain, false);
        let hindrances = [
            (known, "the map is on board already"),
            (self.maps.is_full(), "there is no room for another map"),
            (twice, "the map is being downloaded already"),
            (map_id.is_empty() || version.is_empty(), "mapId or mapVersion is empty"),
            (
                !(url.starts_with("http://") || url.starts_with("https://")),
                "the link is not HTTP",
            ),
        ];
        if known {
            return Outcome::Failed(Problem::duplicate_map(&action, hindrances[0].1));
        }
        if let Some((_, reason)) = hindrances.iter().find(|(hinders, _)| *hinders) {
            return Outcome::Failed(Problem::map(&action, reason));
        }
        self.fetch(action_id, url)
    }

    /// Whether such an action is downloading something.
    pub(crate) fn is_downloading(&self, which: impl Fn(&Action) -> bool) -> bool {
        let under_way = self.downloads.under_way.values();
        under_way.filter_map(|id| self.actions.get(id)).any(which)
    }

    /// Asks the server for the file of an action, which is INITIALIZING until it is heard of.
    pub(crate) fn fetch(&mut self, action_id: &str, url: &str) -> Outcome {
        self.ask_for_file(action_id, url);
        let due = self.moment() + self.config.download_timeout;
        if let Some(action) = self.actions.get_mut(action_id) {
            action.status = Status::Initializing;
            action.due = Some(due);
        }
        Outcome::Open
    }

    /// Asks a server for a file that an action needs.
    pub(crate) fn ask_for_file(&mut self, action_id: &str, url: &str) {
        let token = self.downloads.next;
        self.downloads.next += 1;
        self.downloads.under_way.insert(token, action_id.to_owned());
        let url = url.to_owned();
        self.pending.push(Output::Fetch { token, url });
    }

    /// The server was heard of.
    pub(crate) fn download_progress(&mut self, token: u64, progress: Download) {
        let Some(action_id) = self.downloads.under_way.get(&token).cloned() else {
            return;
        };
        match progress {
            Download::Begun => {
                if let Some(action) = self.actions.get_mut(&action_id) {
                    action.status = Status::Running;
                }
                self.happens(Event::DownloadRunning);
            }
            Download::Done(file) => self.download_done(&action_id, &file),
            Download::Failed(reason) => {
                let reason: String = reason.chars().take(200).collect();
                self.download_failed(&action_id, &reason);
            }
        }
    }

    fn download_done(&mut self, action_id: &str, file: &bytes::Bytes) {
        let Some(action) = self.actions.get(action_id).cloned() else {
            return;
        };
        let is_certificate = action.kind.is_some_and(|kind| kind.effect == Effect::UpdateCertificate);
        if file.is_empty() {
            self.download_failed(action_id, "the file is empty");
        } else if is_certificate {
            self.downloads.forget(action_id);
            self.certificate_file_done(action_id, file);
        } else if !maps::hash_fits(file, action.text(hash_of(&action))) && self.allows(Permission::CheckHash, true) {
            self.download_failed(action_id, "the file does not have the announced hash");
        } else {
            self.downloads.forget(action_id);
            self.happens(Event::Downloaded);
            let stored = match is_of_zones(&action) {
                true => self.zone_set_downloaded(&action, file),
                false => {
                    self.maps.store(action.text("mapId"), action.text("mapVersion"));
                    Ok(())
                }
            };
            let outcome = self.ends(&action, stored.into());
            self.conclude(action_id, outcome);
        }
    }

    /// The map did not arrive; all else stays as it was (MAP-19, MAP-22).
    pub(crate) fn download_failed(&mut self, action_id: &str, reason: &str) {
        self.downloads.forget(action_id);
        let Some(action) = self.actions.get(action_id).cloned() else {
            return;
        };
        let problem = match is_of_zones(&action) {
            true => Problem::zone_set(&action, reason),
            false => Problem::map(&action, reason),
        };
        let outcome = self.ends(&action, Outcome::Failed(problem));
        self.conclude(action_id, outcome);
    }
}

/// Whether an action fetches a zone set.
fn is_of_zones(action: &Action) -> bool {
    action.kind.is_some_and(|kind| kind.effect == Effect::DownloadZoneSet)
}

/// The parameter with the hash of the file that an action fetches.
fn hash_of(action: &Action) -> &'static str {
    if is_of_zones(action) { "zoneSetHash" } else { "mapHash" }
}
