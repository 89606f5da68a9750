//! The maps on board: stored, enabled, deleted (section 6.7).

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::config::OnboardMap;
use super::faults::{FaultName as F, Faults};

/// Why something with a map did not work.
pub(crate) type Refusal = &'static str;

/// All maps on board.
#[derive(Clone, Debug)]
pub(crate) struct Maps {
    all: Vec<OnboardMap>,
    capacity: usize,
}

impl Maps {
    pub(crate) fn new(all: Vec<OnboardMap>, capacity: usize) -> Self {
        Self { all, capacity }
    }

    fn position(&self, map_id: &str, version: &str) -> Option<usize> {
        self.all
            .iter()
            .position(|map| map.map_id == map_id && map.map_version == version)
    }

    /// Whether any version is on board.
    pub(crate) fn on_board(&self, map_id: &str) -> bool {
        self.all.iter().any(|map| map.map_id == map_id)
    }

    /// Whether a version is enabled.
    pub(crate) fn enabled(&self, map_id: &str) -> bool {
        self.all.iter().any(|map| map.map_id == map_id && map.enabled)
    }

    /// Whether a map can be stored (MAP-23, MAP-30).
    pub(crate) fn room_for(&mut self, map_id: &str, version: &str, faults: Faults) -> Result<(), Refusal> {
        if self.position(map_id, version).is_some() && !faults.has(F::DuplicateMapAccepted) {
            return Err("the map is on board already");
        }
        if self.on_board(map_id) && faults.has(F::R1OtherVersionRefused) {
            return Err("the map is on board already");
        }
        if self.all.len() < self.capacity {
            return Ok(());
        }
        if faults.has(F::StorageFullDeletes) {
            if let Some(oldest) = self.all.iter().position(|map| !map.enabled) {
                self.all.remove(oldest);
            }
            return Ok(());
        }
        Err("there is no room for another map")
    }

    /// Stores a map that was downloaded: disabled (MAP-20).
    pub(crate) fn store(&mut self, map_id: &str, version: &str, faults: Faults) {
        if faults.has(F::DownloadDisablesOthers) {
            self.all.iter_mut().for_each(|map| map.enabled = false);
        }
        if self.position(map_id, version).is_some() {
            return;
        }
        if faults.has(F::DownloadDropsVersion) {
            self.all.retain(|map| map.map_id != map_id);
        }
        if faults.has(F::DownloadReplacesVersion) {
            let others = self.all.iter_mut().filter(|map| map.map_id == map_id);
            others.for_each(|map| map.enabled = false);
        }
        let only = !self.on_board(map_id) && faults.has(F::R6FirstVersionEnabledAtOnce);
        self.all.push(OnboardMap {
            map_id: map_id.to_owned(),
            map_version: version.to_owned(),
            enabled: only || faults.has(F::DownloadEnables),
        });
    }

    /// `r6-reconnect-loses-downloaded-maps`: forgets what was not there from the beginning.
    pub(crate) fn keep_only(&mut self, factory: &[OnboardMap]) {
        let same =
            |map: &OnboardMap, other: &OnboardMap| map.map_id == other.map_id && map.map_version == other.map_version;
        self.all.retain(|map| factory.iter().any(|other| same(map, other)));
    }

    /// `download-renumbers`, `failed-download-renumbers`: all versions change.
    pub(crate) fn renumber(&mut self) {
        self.all.iter_mut().for_each(|map| map.map_version.push_str(".1"));
    }

    /// Enables a version, and disables the others of that mapId (MAP-24).
    pub(crate) fn enable(&mut self, map_id: &str, version: &str, faults: Faults) -> Result<(), Refusal> {
        let latest = self.all.iter().rev().find(|map| map.map_id == map_id);
        let latest = latest.filter(|_| faults.has(F::R4EnableUnknownVersionTakesLatest));
        let latest = latest.map(|map| map.map_version.clone());
        let version = match latest.as_deref() {
            Some(latest) if self.position(map_id, version).is_none() => latest,
            _ => version,
        };
        if self.position(map_id, version).is_none() {
            if faults.has(F::EnableUnknownDisables) {
                self.all.iter_mut().for_each(|map| map.enabled = false);
            }
            return if faults.has(F::EnableUnknownFinished) {
                Ok(())
            } else {
                Err("the map is not on board")
            };
        }
        let newer = |map: &OnboardMap| map.map_id == map_id && map.enabled && map.map_version.as_str() > version;
        let kept = faults.has(F::EnableOnlyUpwards) && self.all.iter().any(newer);
        if kept || faults.has(F::EnableWithoutEffect) {
            return Ok(());
        }
        if faults.has(F::EnableBringsOther) && !self.on_board("depot") {
            self.all.push(OnboardMap {
                map_id: "depot".to_owned(),
                map_version: "1".to_owned(),
                enabled: false,
            });
        }
        for map in &mut self.all {
            if map.map_id == map_id {
                map.enabled = map.map_version == version || (faults.has(F::TwoMapsEnabled) && map.enabled);
            } else if faults.has(F::EnableDisablesOtherMaps) {
                map.enabled = false;
            }
        }
        if faults.has(F::R2EnableRemovesOldVersion) {
            self.purge(map_id);
        }
        Ok(())
    }

    /// `r1-init-position-enables-all`: enables all versions of a mapId.
    pub(crate) fn enable_all(&mut self, map_id: &str) {
        for map in self.all.iter_mut().filter(|map| map.map_id == map_id) {
            map.enabled = true;
        }
    }

    /// `r1-enable-in-two-states`: disables all versions of a mapId.
    pub(crate) fn disable_all(&mut self, map_id: &str) {
        for map in self.all.iter_mut().filter(|map| map.map_id == map_id) {
            map.enabled = false;
        }
    }

    /// Whether exactly this version is on board.
    pub(crate) fn has_version(&self, map_id: &str, version: &str) -> bool {
        self.position(map_id, version).is_some()
    }

    /// Whether exactly this version is on board and enabled.
    pub(crate) fn is_enabled(&self, map_id: &str, version: &str) -> bool {
        self.position(map_id, version)
            .is_some_and(|index| self.all[index].enabled)
    }

    /// `r1-failed-download-purges`: removes what is not enabled of a mapId.
    pub(crate) fn purge(&mut self, map_id: &str) {
        self.all.retain(|map| map.map_id != map_id || map.enabled);
    }

    /// Enables some version of a mapId if none is (for a new pose on it).
    pub(crate) fn enable_any(&mut self, map_id: &str) {
        if !self.enabled(map_id)
            && let Some(map) = self.all.iter_mut().rev().find(|map| map.map_id == map_id)
        {
            map.enabled = true;
        }
    }

    /// Removes a map; `used` says which mapIds are needed now (MAP-29, MAP-32, MAP-33).
    pub(crate) fn delete(
        &mut self,
        map_id: &str,
        version: &str,
        used: impl Fn(&str) -> bool,
        faults: Faults,
    ) -> Result<(), Refusal> {
        // A version that does not exist stands for the newest one.
        let newest = self.all.iter().rev().find(|map| map.map_id == map_id && !map.enabled);
        let newest = newest.map(|map| map.map_version.clone());
        let version = match newest.as_deref() {
            Some(newest) if !self.has_version(map_id, version) && faults.has(F::R1DeleteTakesNewest) => newest,
            _ => version,
        };
        let Some(index) = self.position(map_id, version) else {
            return if faults.has(F::DeleteUnknownFinished) {
                Ok(())
            } else {
                Err("the map is not on board")
            };
        };
        if self.all[index].enabled && used(map_id) && !faults.has(F::UsedMapDeleted) {
            self.all[index].enabled = !faults.has(F::UsedMapDisabled);
            return Err("the map is in use");
        }
        if !faults.has(F::DeleteKeepsEntry) {
            self.all.remove(index);
        }
        if faults.has(F::R1DeleteTakesAllVersions) {
            self.purge(map_id);
        }
        if faults.has(F::DeleteTakesAllVersions) {
            self.all.retain(|map| map.map_id != map_id);
        }
        Ok(())
    }

    /// The array of the state.
    pub(crate) fn picture(&self) -> Value {
        let all = self.all.iter();
        all.map(|map| {
            let status = if map.enabled { "ENABLED" } else { "DISABLED" };
            json!({ "mapId": map.map_id, "mapVersion": map.map_version, "mapStatus": status })
        })
        .collect()
    }
}

/// Whether the file has the announced SHA-256, in hexadecimal; no announcement fits every file (MAP-34).
pub(crate) fn hash_fits(file: &[u8], announced: &str) -> bool {
    let digest = Sha256::digest(file);
    let mut pairs = announced.as_bytes().chunks(2);
    let byte = |pair: &[u8]| {
        std::str::from_utf8(pair)
            .ok()
            .and_then(|pair| u8::from_str_radix(pair, 16).ok())
    };
    let fits = announced.len() == 2 * digest.len()
        && announced.bytes().all(|digit| digit.is_ascii_hexdigit())
        && digest
            .iter()
            .all(|expected| pairs.next().and_then(byte) == Some(*expected));
    announced.is_empty() || fits
}

#[cfg(test)]
mod tests {
    use super::*;

    fn maps(entries: &[(&str, &str, bool)]) -> Maps {
        let all = entries
            .iter()
            .map(|(id, version, enabled)| OnboardMap {
                map_id: (*id).into(),
                map_version: (*version).into(),
                enabled: *enabled,
            })
            .collect();
        Maps::new(all, 3)
    }

    #[test]
    fn enabling_disables_other_versions_and_no_other_map() {
        let mut maps = maps(&[("a", "1", true), ("a", "2", false), ("b", "1", true)]);
        assert_eq!(maps.enable("a", "2", Faults::default()), Ok(()));
        let statuses: Vec<_> = maps.all.iter().map(|map| map.enabled).collect();
        assert_eq!(statuses, [false, true, true]);
    }

    #[test]
    fn a_full_store_refuses_and_a_known_map_is_refused() {
        let mut maps = maps(&[("a", "1", true), ("a", "2", false)]);
        assert!(maps.room_for("a", "2", Faults::default()).is_err());
        assert!(maps.room_for("a", "3", Faults::default()).is_ok());
        maps.store("a", "3", Faults::default());
        assert!(maps.room_for("a", "4", Faults::default()).is_err());
        assert_eq!(maps.all.len(), 3);
        assert!(!maps.all[2].enabled);
    }

    #[test]
    fn a_used_map_is_not_deleted_but_its_disabled_version_is() {
        let mut maps = maps(&[("a", "1", true), ("a", "2", false)]);
        assert!(maps.delete("a", "1", |id| id == "a", Faults::default()).is_err());
        assert!(maps.delete("a", "2", |id| id == "a", Faults::default()).is_ok());
        assert!(maps.delete("a", "2", |id| id == "a", Faults::default()).is_err());
    }

    #[test]
    fn the_hash_is_compared_without_regard_to_case() {
        let empty = "E3B0C44298FC1C149AFBF4C8996FB92427AE41E4649B934CA495991B7852B855";
        assert!(hash_fits(b"", empty) && hash_fits(b"x", ""));
        assert!(!hash_fits(b"x", empty));
    }
}
