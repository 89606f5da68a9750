//! A fleet with faults whose places are known: each is found, and nothing else is.

use std::collections::{BTreeMap, BTreeSet};

use super::tests::spoiled;
use super::*;
use tck_base::verdict::Verdict;
use tck_judge::Library;
use tck_simulate::{Impairment, Injected, Recorded, Site, SiteMessage};

fn message(told: SiteMessage) -> Message {
    Message {
        at: Some(told.at),
        topic: told.topic,
        payload: told.payload.into(),
        qos: Some(told.qos),
        retain: Some(false),
        place: SourcePosition::default(),
        after_gap: false,
        carried: None,
    }
}

fn recorded(one: Recorded) -> Message {
    Message {
        retain: Some(one.retain),
        ..message(one.message)
    }
}

/// Message, requirement and text of everything that is found.
fn found(library: &Library, messages: impl Iterator<Item = Message>) -> Vec<(u64, String, String)> {
    let mut audit = Audit::new(&library.rules, Options::default()).expect("options").live();
    let mut all = Vec::new();
    for message in messages {
        audit.observe(message);
        all.extend(audit.news());
    }
    let counts = |found: &Found| matches!(found.verdict, Verdict::Fail | Verdict::Warning);
    let found = all.into_iter().filter(counts);
    found
        .map(|found| (found.message, found.requirement, found.text))
        .collect()
}

/// Holds that each fault is found in its message as broken what its kind breaks, and nothing is found elsewhere. Gives the
/// kinds that there were.
fn proven(site: Site) -> BTreeSet<&'static str> {
    let library = tck_testing::library();
    let mut key: BTreeMap<u64, Injected> = BTreeMap::new();
    let told = site.messages().inspect(|told| {
        let injected = told.injected.clone();
        key.extend(injected.map(|injected| (injected.message, injected)));
    });
    let found = found(library, told.map(message));
    assert!(key.len() as u64 > site.faults * 99 / 100, "{}", key.len());
    let mut seen: BTreeMap<u64, BTreeSet<String>> = BTreeMap::new();
    let mut wrong = Vec::new();
    for (message, requirement, text) in found {
        if key.contains_key(&message) {
            seen.entry(message).or_default().insert(requirement);
        } else {
            wrong.push(format!("{message} {requirement}: {text}"));
        }
    }
    wrong.sort();
    let some = &wrong[..wrong.len().min(30)];
    assert!(wrong.is_empty(), "{} more: {some:#?}", wrong.len());
    let kinds = key.values().map(|injected| injected.kind).collect();
    let mut missed = BTreeSet::new();
    for (message, injected) in &key {
        let found = seen.remove(message).unwrap_or_default();
        if !found.contains(injected.requirement) {
            missed.insert(format!(
                "{}: {}, found is {found:?}",
                injected.kind, injected.requirement
            ));
        }
    }
    assert!(missed.is_empty(), "{} missed: {missed:#?}", missed.len());
    kinds
}

#[test]
fn every_fault_of_a_fleet_is_found_in_its_message_and_nothing_else_is() {
    let kinds = proven(Site {
        seed: 5,
        vehicles: 40,
        messages: 16_000,
        faults: 1_000,
    });
    assert!(kinds.len() >= 60, "{} kinds: {kinds:#?}", kinds.len());
}

#[test]
#[ignore = "minutes; BENCHMARKS.md says how it is run"]
fn every_fault_among_a_million_messages_is_found_and_nothing_else_is() {
    proven(Site {
        seed: 6,
        vehicles: 500,
        messages: 1_000_000,
        faults: 1_000,
    });
}

fn accuses_nobody_however_bad_the_recording(seed: u64, vehicles: usize, messages: u64) {
    let library = tck_testing::library();
    let site = Site {
        seed,
        vehicles,
        messages,
        faults: 0,
    };
    let whole: Vec<Message> = site.messages().map(message).collect();
    let bad = spoiled(&whole, seed);
    for recording in [whole, bad] {
        let found = found(library, recording.into_iter());
        assert!(found.is_empty(), "{:#?}", &found[..found.len().min(20)]);
    }
}

#[test]
fn a_faultless_fleet_is_accused_of_nothing_however_bad_the_recording() {
    for seed in 0..3 {
        accuses_nobody_however_bad_the_recording(seed, 12, 3_000);
    }
}

#[test]
fn a_faultless_fleet_is_accused_of_nothing_whatever_became_of_the_recording() {
    let library = tck_testing::library();
    for seed in 0..3 {
        let site = Site {
            seed,
            vehicles: 12,
            messages: 3_000,
            faults: 0,
        };
        let told: Vec<SiteMessage> = site.messages().collect();
        for impairment in Impairment::ALL {
            let found = found(library, impairment.of(&told, seed).into_iter().map(recorded));
            assert!(
                found.is_empty(),
                "{}: {:#?}",
                impairment.name(),
                &found[..found.len().min(20)]
            );
        }
    }
}

#[test]
#[ignore = "minutes; BENCHMARKS.md says how it is run"]
fn a_large_faultless_fleet_is_accused_of_nothing_however_bad_the_recording() {
    accuses_nobody_however_bad_the_recording(7, 200, 200_000);
}
