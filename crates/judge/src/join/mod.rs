//! The parts of a run put together: as if it had never been divided.
//!
//! What parts say is a set: in which order they are given, and which of them were joined before, changes nothing. Verdicts are
//! joined by the lattice, so that no part can lower what another one found. What keeps the parts from being the whole is named,
//! and leaves the whole undecided.

mod fleet;
mod identity;
mod requirements;

use std::collections::BTreeMap;

use super::conversation_coverage;
use super::merge;
use super::rules::Rules;
use tck_base::verdict::{Accumulated, Verdict};
use tck_journal::OwnLatency;
use tck_journal::event::{DIVIDED_TESTS, DIVIDED_VEHICLES};
use tck_pack::Role;
use tck_result::{
    DeviceIdentity, MergeTrouble, MergedPart, MergedRun, MessageCoverage, MonitorResult, Part as _, RunResult,
    TestResult, gathered,
};

/// Where the evidence of a part is, and what it was when it was joined.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Evidence {
    /// The folder of its bundle.
    pub bundle: String,
    /// Length of its journal in bytes.
    pub bytes: u64,
    /// SHA-256 of its journal, in hexadecimal.
    pub sha256: String,
    /// Root hash of its bundle, if it has a manifest.
    pub root: Option<String>,
}

/// A part of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunPart {
    /// What came out of it.
    pub result: RunResult,
    /// What that rests on.
    pub evidence: Evidence,
}

/// Why parts cannot be joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JoinError {
    /// There is no part among them.
    #[error("none of these is a part of a run: they were made without --shard")]
    NoPart,
}

/// Joins parts of a run. One that is given twice counts once.
///
/// # Errors
/// When there is no part of a run among them.
pub fn join(rules: &Rules, parts: &[RunPart]) -> Result<RunResult, JoinError> {
    let parts = gathered(parts).ok_or(JoinError::NoPart)?;
    let own = &parts.own;
    let first = own.first().ok_or(JoinError::NoPart)?;
    let (serial_number, series_name) = identity::device(own).ok_or(JoinError::NoPart)?;
    let role = if first.result.role == Role::MasterControl.word() {
        Role::MasterControl
    } else {
        Role::Agv
    };
    let tests = tests_of(rules, own);
    let monitors = monitors_of(rules, own);
    let requirements = requirements::requirements(rules, role, own, &tests, &parts.troubles);
    let merged = MergedRun {
        of: parts.of,
        parts: parts
            .all
            .iter()
            .map(|(part, counts)| merged_part(part, *counts))
            .collect(),
        troubles: parts.troubles,
    };
    let results = || own.iter().map(|part| &part.result);
    let mut result = RunResult {
        run: run_of(own),
        started: results().map(|one| one.started.clone()).min().unwrap_or_default(),
        seconds: results().map(|one| one.seconds).sum(),
        partial: !merged.troubles.is_empty(),
        partial_reason: reason(&merged.troubles),
        verdict: None,
        program: results()
            .filter_map(|one| one.program.clone())
            .reduce(|one, other| one.and(Some(other))),
        mixed: results().find_map(|one| one.mixed.clone()),
        device: DeviceIdentity {
            manufacturer: first.result.device.manufacturer.clone(),
            serial_number,
            series_name,
        },
        journal: "shards".to_owned(),
        joined: Vec::new(),
        shard: None,
        exploration: conversation_coverage::exploration(&rules.suites.tests, &tests, role),
        message_coverage: results()
            .filter_map(|one| one.message_coverage.clone())
            .reduce(MessageCoverage::and),
        harness_latency: results().filter_map(|one| one.harness_latency).reduce(OwnLatency::and),
        on_word: results().flat_map(|one| one.on_word.clone()).collect(),
        fleet: fleet::fleet(own),
        capabilities: first.result.capabilities.clone(),
        limits: limits(own, &merged),
        deviations: results().flat_map(|one| one.deviations.clone()).collect(),
        settings: settings(own),
        merged: Some(merged),
        tests,
        monitors,
        requirements,
        ..first.result.clone()
    };
    result.verdict = verdict(&result);
    Ok(result)
}

/// The verdict of the whole: monitors alone make no device conform where no test applies, and what is not there is not decided.
fn verdict(result: &RunResult) -> Option<Verdict> {
    let tests = result.tests.iter().filter_map(|test| test.verdict);
    let monitors = result.monitors.iter().filter_map(|monitor| monitor.verdict);
    let decided = tests.chain(monitors).collect::<Accumulated>().get();
    let none_applied = !result.tests.is_empty() && result.tests.iter().all(|test| test.verdict.is_none());
    let decided = decided.filter(|verdict| !none_applied || *verdict > Verdict::Warning);
    let open = result.partial.then_some(Verdict::Inconclusive);
    let all = decided.into_iter().chain(open).chain(result.aside());
    all.collect::<Accumulated>().get()
}

/// A name of the whole that follows from its evidence.
fn run_of(own: &[&RunPart]) -> String {
    let prefix = |part: &&RunPart| {
        let digits = part.evidence.sha256.get(..8);
        digits
            .and_then(|digits| u32::from_str_radix(digits, 16).ok())
            .unwrap_or(0)
    };
    let sum = own.iter().map(prefix).fold(0, u32::wrapping_add);
    format!("merged-{sum:08x}")
}

fn reason(troubles: &[MergeTrouble]) -> Option<String> {
    let texts: Vec<String> = troubles.iter().map(ToString::to_string).collect();
    (!texts.is_empty()).then(|| texts.join("; "))
}

fn merged_part(part: &RunPart, counts: bool) -> MergedPart {
    let RunPart { result, evidence } = part;
    MergedPart {
        index: part.index(),
        run: result.run.clone(),
        started: result.started.clone(),
        seconds: result.seconds,
        serial_number: result.device.serial_number.clone(),
        verdict: result.verdict,
        counts,
        tests: result.tests.iter().map(|test| test.id.clone()).collect(),
        bundle: evidence.bundle.clone(),
        journal: result.journal.clone(),
        journal_bytes: evidence.bytes,
        journal_sha256: evidence.sha256.clone(),
        root: evidence.root.clone(),
    }
}

/// The tests of all parts, in the order of the suites, and then what was not run.
fn tests_of(rules: &Rules, own: &[&RunPart]) -> Vec<TestResult> {
    let mut all: Vec<TestResult> = Vec::new();
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    for test in own.iter().flat_map(|part| &part.result.tests) {
        match places.get(test.id.as_str()) {
            Some(place) => merge::both(&mut all[*place], test),
            None => {
                places.insert(&test.id, all.len());
                all.push(test.clone());
            }
        }
    }
    let suites = rules.suites.tests.iter().enumerate();
    let suites: BTreeMap<&str, usize> = suites.map(|(at, test)| (test.id.as_str(), at)).collect();
    all.sort_by_key(|test| {
        let place = suites.get(test.id.as_str()).copied().unwrap_or(usize::MAX);
        (test.journal.is_none(), place, test.id.clone())
    });
    all
}

/// What monitors found in all parts. The records that a finding names are those of the journal of its part.
fn monitors_of(rules: &Rules, own: &[&RunPart]) -> Vec<MonitorResult> {
    let mut all: Vec<MonitorResult> = Vec::new();
    for part in own {
        for monitor in &part.result.monitors {
            let mut monitor = monitor.clone();
            for finding in &mut monitor.findings {
                finding.message = format!("part {}: {}", part.index(), finding.message);
            }
            match all.iter_mut().find(|known| known.id == monitor.id) {
                Some(known) => {
                    known.verdict = known
                        .verdict
                        .into_iter()
                        .chain(monitor.verdict)
                        .collect::<Accumulated>()
                        .get();
                    known.judged += monitor.judged;
                    known.findings.extend(monitor.findings);
                }
                None => all.push(monitor),
            }
        }
    }
    let place = |id: &str| rules.suites.monitors.iter().position(|known| known.id == id);
    all.sort_by_key(|monitor| (place(&monitor.id).unwrap_or(usize::MAX), monitor.id.clone()));
    all
}

/// What restricts the whole: what keeps it from being the whole, and what restricts a part beside being one.
fn limits(own: &[&RunPart], merged: &MergedRun) -> Vec<String> {
    let mut all: Vec<String> = merged
        .troubles
        .iter()
        .map(|trouble| format!("{}.", sentence(&trouble.text)))
        .collect();
    let mut devices: Vec<&str> = own
        .iter()
        .map(|part| part.result.device.serial_number.as_str())
        .collect();
    devices.sort_unstable();
    devices.dedup();
    if devices.len() > 1 {
        all.push(format!(
            "Its parts were run on {} devices of one kind: {}.",
            devices.len(),
            devices.join(", ")
        ));
    }
    for part in own {
        let divided = [DIVIDED_TESTS, DIVIDED_VEHICLES];
        let shard = part.result.shard.as_ref();
        let is_one = |limit: &String| shard.is_some_and(|shard| divided.iter().any(|what| shard.limit(what) == *limit));
        for limit in part.result.limits.iter().filter(|limit| !is_one(limit)) {
            if !all.contains(limit) {
                all.push(limit.clone());
            }
        }
    }
    all
}

fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// The settings that all parts share.
fn settings(own: &[&RunPart]) -> Vec<tck_journal::event::Setting> {
    let Some((first, rest)) = own.split_first() else {
        return Vec::new();
    };
    let is_shared = |setting: &&tck_journal::event::Setting| {
        rest.iter()
            .all(|part| part.result.setting(&setting.name) == Some(setting.value.as_str()))
    };
    first.result.settings.iter().filter(is_shared).cloned().collect()
}
