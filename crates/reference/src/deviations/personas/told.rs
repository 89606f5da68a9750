//! What a word of a test says to a mock vehicle, member by member.

use std::time::Duration;

use serde_json::Value;

use super::LONGEST;

/// What a word says, read leniently: a test was linted before.
pub(super) struct Told<'a>(pub(super) &'a Value);

impl Told<'_> {
    pub(super) fn text(&self, key: &str) -> Option<String> {
        let text = self.0.get(key)?.as_str()?;
        Some(text.to_owned()).filter(|text| !text.is_empty())
    }

    pub(super) fn time(&self, key: &str) -> Option<Duration> {
        let seconds = self.0.get(key)?.as_f64()?;
        Some(Duration::from_secs_f64(seconds.clamp(0.0, LONGEST)))
    }

    pub(super) fn count(&self, usual: u64) -> u64 {
        self.0.get("count").and_then(Value::as_u64).unwrap_or(usual)
    }

    pub(super) fn number(&self, key: &str) -> Option<f64> {
        self.0.get(key)?.as_f64()
    }

    pub(super) fn whole(&self, key: &str) -> Option<u64> {
        let told = self.0.get(key)?;
        told.as_u64().or_else(|| told.as_str()?.parse().ok())
    }

    pub(super) fn flag(&self, key: &str) -> Option<bool> {
        self.0.get(key)?.as_bool()
    }

    /// A merge patch; `None` when it says nothing.
    pub(super) fn patch(&self, key: &str) -> Option<Value> {
        let patch = self.0.get(key)?;
        patch
            .as_object()
            .is_some_and(|members| !members.is_empty())
            .then(|| patch.clone())
    }
}
