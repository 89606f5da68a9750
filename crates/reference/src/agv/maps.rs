//! The maps on board: stored, enabled, deleted (sections 6.7.3 to 6.7.5).
//!
//! To enable one version disables the others of its mapId; the map that is in use is not deleted.

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::config::OnboardMap;

/// Why something with a map did not work.
pub(crate) type Refusal = &'static str;

/// All maps on board.
#[derive(Clone, Debug)]
pub(crate) struct Maps {
    pub(crate) all: Vec<OnboardMap>,
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

    /// Whether another map can be stored (MAP-30).
    pub(crate) fn is_full(&self) -> bool {
        self.all.len() >= self.capacity
    }

    /// Stores a map that was downloaded: disabled (MAP-20).
    pub(crate) fn store(&mut self, map_id: &str, version: &str) {
        if self.position(map_id, version).is_none() {
            self.all.push(OnboardMap {
                map_id: map_id.to_owned(),
                map_version: version.to_owned(),
                enabled: false,
            });
        }
    }

    /// Enables a version, and disables the others of that mapId (MAP-24).
    pub(crate) fn enable(&mut self, map_id: &str, version: &str) -> Result<(), Refusal> {
        if self.position(map_id, version).is_none() {
            return Err("the map is not on board");
        }
        for map in self.all.iter_mut().filter(|map| map.map_id == map_id) {
            map.enabled = map.map_version == version;
        }
        Ok(())
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

    /// Enables some version of a mapId if none is (for a new pose on it).
    pub(crate) fn enable_any(&mut self, map_id: &str) {
        if !self.enabled(map_id)
            && let Some(map) = self.all.iter_mut().rev().find(|map| map.map_id == map_id)
        {
            map.enabled = true;
        }
    }

    /// Removes a map; `used` says which mapIds are needed now (MAP-29, MAP-32, MAP-33).
    pub(crate) fn delete(&mut self, map_id: &str, version: &str, used: impl Fn(&str) -> bool) -> Result<(), Refusal> {
        let Some(index) = self.position(map_id, version) else {
            return Err("the map is not on board");
        };
        if self.all[index].enabled && used(map_id) {
            return Err("the map is in use");
        }
        self.all.remove(index);
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
        assert_eq!(maps.enable("a", "2"), Ok(()));
        let statuses: Vec<_> = maps.all.iter().map(|map| map.enabled).collect();
        assert_eq!(statuses, [false, true, true]);
    }

    #[test]
    fn a_full_store_refuses_and_a_known_map_is_refused() {
        let mut maps = maps(&[("a", "1", true), ("a", "2", false)]);
        assert!(maps.has_version("a", "2") && !maps.is_full());
        maps.store("a", "3");
        assert!(maps.is_full());
        assert_eq!(maps.all.len(), 3);
        assert!(!maps.all[2].enabled);
    }

    #[test]
    fn a_used_map_is_not_deleted_but_its_disabled_version_is() {
        let mut maps = maps(&[("a", "1", true), ("a", "2", false)]);
        assert!(maps.delete("a", "1", |id| id == "a").is_err());
        assert!(maps.delete("a", "2", |id| id == "a").is_ok());
        assert!(maps.delete("a", "2", |id| id == "a").is_err());
    }

    #[test]
    fn the_hash_is_compared_without_regard_to_case() {
        let empty = "E3B0C44298FC1C149AFBF4C8996FB92427AE41E4649B934CA495991B7852B855";
        assert!(hash_fits(b"", empty) && hash_fits(b"x", ""));
        assert!(!hash_fits(b"x", empty));
    }
}
