//! What the parts of one run have in common: everything but what a bench may have of its own.

use std::collections::BTreeMap;

use super::RunPart;
use tck_journal::event::ShardRecord;
use tck_result::{Part, most_common, others};

/// Settings that may differ from bench to bench: where things are, and which piece of a kind of device it is.
const OF_A_BENCH: [&str; 6] = [
    "bench.",
    "layout.",
    "hooks.",
    "certificate.",
    "device.serial-number",
    "device.command",
];

impl Part for RunPart {
    fn shard(&self) -> Option<&ShardRecord> {
        self.result.shard.as_ref()
    }

    fn evidence(&self) -> &str {
        &self.evidence.sha256
    }

    fn name(&self) -> String {
        format!("the run {} in {}", self.result.run, self.evidence.bundle)
    }

    fn facts(&self) -> BTreeMap<String, String> {
        let result = &self.result;
        let named = [
            ("tool", result.tool.clone()),
            ("role", result.role.clone()),
            ("protocol version", result.protocol.clone()),
            ("command", result.mode.clone().unwrap_or_else(|| "run".to_owned())),
            ("vantage", result.vantage.clone()),
            ("hash of the suites", result.suites_sha256.clone()),
            ("manufacturer", result.device.manufacturer.clone()),
        ];
        let mut all: BTreeMap<String, String> = named
            .into_iter()
            .map(|(name, value)| (name.to_owned(), value))
            .collect();
        let is_shared = |name: &str| !OF_A_BENCH.iter().any(|own| name.starts_with(own));
        for setting in result.settings.iter().filter(|setting| is_shared(&setting.name)) {
            all.insert(format!("setting {}", setting.name), setting.value.clone());
        }
        all
    }

    /// The device is the one that most parts were run on, or of its series. A certificate is about one piece.
    fn stranger(&self, alike: &[&Self]) -> Option<String> {
        let (serial_number, series_name) = device(alike)?;
        let own = &self.result.device;
        let is_of_kind = own.series_name.is_some() && own.series_name == series_name && self.result.mode.is_none();
        if own.serial_number == serial_number || is_of_kind {
            return None;
        }
        let bounded = |text: &str| text.chars().take(80).collect::<String>();
        let of_device: Vec<&Self> = alike
            .iter()
            .copied()
            .filter(|part| part.result.device.serial_number == serial_number)
            .collect();
        Some(format!(
            "its device is `{}`, and that of {} `{}`, of which nothing says that they are of one kind",
            bounded(&own.serial_number),
            others(&of_device),
            bounded(&serial_number)
        ))
    }

    fn unfinished(&self) -> Option<String> {
        let why = self.result.partial_reason.as_deref().unwrap_or("nobody knows why");
        self.result.partial.then(|| why.trim_end_matches('.').to_owned())
    }
}

/// The device that most of these were run on, and its series where one of them knows it.
pub(super) fn device(parts: &[&RunPart]) -> Option<(String, Option<String>)> {
    let serial_number = most_common(parts.iter().map(|part| part.result.device.serial_number.clone()))?;
    let of_device = parts
        .iter()
        .filter(|part| part.result.device.serial_number == serial_number);
    let series_name = most_common(of_device.filter_map(|part| part.result.device.series_name.clone()));
    Some((serial_number, series_name))
}
