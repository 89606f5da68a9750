//! A fleet with faults whose places are known: each is found, and nothing else is.

use std::collections::{BTreeMap, BTreeSet};

use super::tests::spoiled;
use super::*;
use crate::run::Library;
use crate::simulate::{Injected, KINDS, Site};
use crate::verdict::Verdict;

fn messages(site: Site) -> (Vec<Message>, Vec<Injected>) {
    let mut key = Vec::new();
    let messages = site.messages().map(|told| {
        key.extend(told.injected.clone());
        Message {
            at: Some(told.at),
            topic: told.topic,
            payload: told.payload.into(),
            qos: Some(told.qos),
            retain: Some(false),
            place: Place::default(),
            after_gap: false,
            carried: None,
        }
    });
    (messages.collect(), key)
}

/// Message, requirement and verdict of everything that is found.
fn found(library: &Library, messages: Vec<Message>) -> Vec<(u64, String, String)> {
    let mut audit = Audit::new(&library.rules, Options::default()).expect("options").live();
    let mut all = Vec::new();
    for message in messages {
        audit.observe(message);
        all.extend(audit.news());
    }
    let counts = |found: &Found| matches!(found.verdict, Verdict::Fail | Verdict::Warning);
    let found = all.into_iter().filter(counts);
    found
        .map(|found| {
            let Found {
                message,
                requirement,
                verdict,
                text,
                ..
            } = found;
            (message, format!("{requirement} {}", verdict.word()), text)
        })
        .collect()
}

#[test]
fn every_fault_of_a_fleet_is_found_in_its_message_and_nothing_else_is() {
    let library = Library::load(None).expect("library");
    let site = Site {
        seed: 5,
        vehicles: 40,
        messages: 16_000,
        faults: 1_000,
    };
    let (messages, key) = messages(site);
    assert!(key.len() > 990, "{}", key.len());
    let places: BTreeMap<u64, &Injected> = key.iter().map(|injected| (injected.message, injected)).collect();
    let mut kinds: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    let mut seen = BTreeSet::new();
    let mut wrong = Vec::new();
    for (message, what, text) in found(&library, messages) {
        match places.get(&message) {
            Some(injected) => {
                seen.insert(message);
                kinds.entry(injected.kind).or_default().insert(what);
            }
            None => wrong.push(format!("{message} {what}: {text}")),
        }
    }
    assert!(
        wrong.is_empty(),
        "{} more: {:#?}",
        wrong.len(),
        &wrong[..wrong.len().min(30)]
    );
    let missed: Vec<&&Injected> = places
        .iter()
        .filter(|(at, _)| !seen.contains(at))
        .map(|(_, one)| one)
        .collect();
    assert!(
        missed.is_empty(),
        "{} missed: {:#?}",
        missed.len(),
        &missed[..missed.len().min(30)]
    );
    assert_eq!(kinds.len(), KINDS.len());
    let list: Vec<String> = kinds
        .into_iter()
        .map(|(kind, what)| format!("{kind}: {}", what.into_iter().collect::<Vec<_>>().join(", ")))
        .collect();
    insta::assert_snapshot!(list.join("\n"));
}

#[test]
fn a_faultless_fleet_is_accused_of_nothing_however_bad_the_recording() {
    let library = Library::load(None).expect("library");
    for seed in 0..3 {
        let site = Site {
            seed,
            vehicles: 12,
            messages: 3_000,
            faults: 0,
        };
        let (messages, key) = messages(site);
        assert!(key.is_empty());
        let bad = spoiled(&messages, seed);
        for recording in [messages, bad] {
            let found = found(&library, recording);
            assert!(found.is_empty(), "{:#?}", &found[..found.len().min(20)]);
        }
    }
}
