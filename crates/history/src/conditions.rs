//! Under which conditions a run was made, and what differs from one to another.

use std::collections::BTreeMap;

use serde::Serialize;

use tck_journal::event::RunHeader;
use tck_result::RunResult;

/// What can lie between two runs, in the order in which it is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    /// The firmware that the profile names.
    Firmware,
    /// The hardware that the profile names.
    Hardware,
    /// A file of the program that the run has started.
    Program,
    /// What the device declares of itself.
    Factsheet,
    /// A setting.
    Profile,
    /// A file of the floor: a layout or a map.
    Floor,
    /// The suites.
    Suites,
    /// The tool.
    Tool,
    /// From where was observed.
    Vantage,
    /// The command line, without what only says where results go.
    Command,
}

impl What {
    /// The word used in every output.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Firmware => "firmware",
            Self::Hardware => "hardware",
            Self::Program => "program",
            Self::Factsheet => "factsheet",
            Self::Profile => "profile",
            Self::Floor => "floor",
            Self::Suites => "suites",
            Self::Tool => "tool",
            Self::Vantage => "vantage",
            Self::Command => "command",
        }
    }

    /// Whether only the first record of the journal says it.
    fn is_of_header(self) -> bool {
        matches!(self, Self::Program | Self::Floor | Self::Command)
    }
}

/// One thing that differs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Change {
    /// Of which kind it is.
    pub what: What,
    /// Which of its kind: a setting, a capability, a file; empty where there is only one.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// What it was; absent when it was not there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub before: Option<String>,
    /// What it is; absent when it is not there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after: Option<String>,
}

/// Everything that a run says of how it was made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Conditions {
    facts: BTreeMap<(What, String), String>,
    /// Whether the first record of the journal could be read.
    has_header: bool,
}

/// Settings that change no verdict: where devices connect, and what a certificate says beside the device.
fn is_aside(setting: &str) -> bool {
    setting == "bench.listen" || setting.starts_with("certificate.")
}

impl Conditions {
    /// Of a run; the header is the first record of its journal.
    pub fn of_run(result: &RunResult, header: Option<&RunHeader>) -> Self {
        let mut all = Self {
            has_header: header.is_some(),
            ..Self::default()
        };
        all.note(What::Tool, "", &result.tool);
        all.note(
            What::Suites,
            "",
            result.suites_sha256.get(..12).unwrap_or(&result.suites_sha256),
        );
        all.note(What::Vantage, "", &result.vantage);
        for (what, name) in [
            (What::Firmware, "certificate.firmware-version"),
            (What::Hardware, "certificate.hardware-version"),
        ] {
            if let Some(value) = result.setting(name) {
                all.note(what, "", value);
            }
        }
        for setting in result.settings.iter().filter(|setting| !is_aside(&setting.name)) {
            all.note(What::Profile, &setting.name, &setting.value);
        }
        for capability in &result.capabilities {
            all.note(What::Factsheet, &capability.name, &capability.value);
        }
        if let Some(header) = header {
            all.note(What::Command, "", &meant(&header.command));
            for (name, hash) in &header.files {
                let hash = hash.get(..12).unwrap_or(hash);
                match name.split_once(' ') {
                    Some(("program", file)) => all.note(What::Program, file, hash),
                    // What its settings say is told setting by setting.
                    Some(("profile", _)) | None => {}
                    Some((_, file)) => all.note(What::Floor, file, hash),
                }
            }
        }
        all
    }

    /// Of an audit of recordings.
    pub fn of_audit(tool: &str, vantage: &str) -> Self {
        let mut all = Self::default();
        all.note(What::Tool, "", tool);
        all.note(What::Vantage, "", vantage);
        all
    }

    fn note(&mut self, what: What, name: &str, value: &str) {
        self.facts.insert((what, name.to_owned()), value.to_owned());
    }

    /// The firmware, if it is named.
    pub fn firmware(&self) -> Option<&str> {
        self.facts.get(&(What::Firmware, String::new())).map(String::as_str)
    }

    /// What differs in a later run. What one of the two runs cannot say is left aside.
    pub fn changes(&self, later: &Self) -> Vec<Change> {
        let told = |what: What| !what.is_of_header() || (self.has_header && later.has_header);
        let keys: std::collections::BTreeSet<&(What, String)> = self
            .facts
            .keys()
            .chain(later.facts.keys())
            .filter(|(what, _)| told(*what))
            .collect();
        let changes = keys.into_iter().filter_map(|key| {
            let (before, after) = (self.facts.get(key), later.facts.get(key));
            (before != after).then(|| Change {
                what: key.0,
                name: key.1.clone(),
                before: before.cloned(),
                after: after.cloned(),
            })
        });
        changes.collect()
    }
}

/// Flags that say where results go and how they are shown, without a value behind them.
const ALONE: [&str; 10] = [
    "-q",
    "--quiet",
    "-v",
    "-vv",
    "--verbose",
    "--failures",
    "--open",
    "--allow-motion",
    "--no-motion",
    "--questions",
];
/// Flags of that kind with a value; the seed draws cases, and each case stands by its name.
const WITH_VALUE: [&str; 10] = [
    "--out",
    "--as",
    "--events",
    "--format",
    "--log-file",
    "--resume",
    "--slowest",
    "--inconclusive",
    "--seed",
    "--listen",
];

/// A command line without the program, and without what changes no test.
fn meant(command: &[String]) -> String {
    let mut kept: Vec<&str> = Vec::new();
    let mut words = command.iter().skip(1).map(String::as_str);
    while let Some(word) = words.next() {
        let name = word.split_once('=').map_or(word, |(name, _)| name);
        if WITH_VALUE.contains(&word) {
            words.next();
        } else if !WITH_VALUE.contains(&name) && !ALONE.contains(&name) {
            kept.push(word);
        }
    }
    kept.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_line_is_what_changes_a_test() {
        let words = "tck run --virtual -q --seed 3 --out x --as=junit=y --fault z order-rejection --listen 127.0.0.1:0";
        let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
        assert_eq!(meant(&words), "run --virtual --fault z order-rejection");
        assert_eq!(meant(&[]), "");
    }

    #[test]
    fn what_differs_is_named_and_what_cannot_be_known_is_no_change() {
        let mut one = Conditions::of_audit("tck 1", "tap");
        let mut other = Conditions::of_audit("tck 2", "tap");
        one.note(What::Command, "", "run");
        other.note(What::Firmware, "", "4.2");
        let changes = one.changes(&other);
        let told: Vec<(What, Option<&str>, Option<&str>)> = changes
            .iter()
            .map(|change| (change.what, change.before.as_deref(), change.after.as_deref()))
            .collect();
        assert_eq!(
            told,
            [
                (What::Firmware, None, Some("4.2")),
                (What::Tool, Some("tck 1"), Some("tck 2"))
            ]
        );
        assert!(one.changes(&one).is_empty());
    }
}
