//! Every fault is something a vehicle can have, once, and together with others.

use std::collections::BTreeSet;

use super::{BLIND_FAULTS, FAULTS, built, lapse};
use crate::clock::{Moment, Stamp};
use crate::reference::Device;
use crate::reference::agv::AgvConfig;
use serde_json::{Value, json};

fn config() -> AgvConfig {
    AgvConfig {
        version: "7.8.9".into(),
        topics: [("connection".to_owned(), "uagv/v7/Reference/agv-1/connection".to_owned())].into(),
        ..AgvConfig::default()
    }
}

#[test]
fn every_name_is_kebab_case_and_unique_among_all() {
    let all: Vec<&str> = FAULTS
        .iter()
        .chain(BLIND_FAULTS.iter())
        .map(|fault| fault.name)
        .collect();
    let letters = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    assert!(all.iter().all(|name| name.chars().all(letters)));
    let unique: BTreeSet<&str> = all.iter().copied().collect();
    assert_eq!(unique.len(), all.len());
    assert!(super::records().count() > 200 && all.len() > 700);
}

#[test]
fn only_proven_faults_are_lapses() {
    let all = FAULTS.iter().chain(BLIND_FAULTS.iter());
    let lapses: Vec<&str> = all
        .map(|fault| fault.name)
        .filter(|name| lapse(name).is_some())
        .collect();
    assert!(lapses.contains(&"state-qos-1") && lapses.iter().all(|name| !super::is_blind(name)));
}

#[test]
fn faults_of_both_kinds_stand_side_by_side() {
    let now = Stamp {
        moment: Moment::START,
        utc: jiff::Timestamp::UNIX_EPOCH,
    };
    let mut agv = built(config(), &["will-qos-0", "echoes-order", "keep-alive-long"]).unwrap();
    let options = agv.connect_options(now);
    assert_eq!(options.keep_alive.as_secs(), 600);
    assert_eq!(options.will.map(|will| (will.qos, will.retain)), Some((0, true)));
    let good = built(config(), &[]).unwrap().connect_options(now);
    assert_eq!(good.will.map(|will| (will.qos, will.retain)), Some((1, true)));
}

#[test]
fn an_unknown_fault_is_refused_whatever_stands_beside_it() {
    let error = built(config(), &["will-qos-0", "no-such-fault"]).unwrap_err();
    assert_eq!(error.to_string(), "the reference AGV has no fault `no-such-fault`");
}

#[test]
fn each_guesses_its_part_of_an_order() {
    let agv = built(config(), &[]).unwrap();
    let read = |name: &str, message: &Value| {
        let mut read = message.clone();
        (super::find(name).unwrap().make)().reads(&agv, &mut read);
        read
    };
    let message = json!({ "orderUpdateId": "5", "nodes": [{ "sequenceId": -1, "actions": null }] });
    assert_eq!(*agv.read(&message), message);
    assert_eq!(read("text-read-as-number", &message)["orderUpdateId"], json!(5));
    let wrapped = read("numbers-wrapped", &message);
    assert_eq!(wrapped["nodes"][0]["sequenceId"], json!(u32::MAX));
    let empty = read("null-read-as-default", &message);
    assert_eq!(empty["nodes"][0]["actions"], json!([]));
    let released = read("released-assumed", &message);
    assert_eq!(released["nodes"][0]["released"], json!(true));
    assert_eq!(read("missing-list-read-as-empty", &message)["edges"], json!([]));
}
