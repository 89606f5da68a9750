//! Every fault is something a vehicle can have, once, and together with others.

use std::collections::BTreeSet;

use super::{FAULTS, TOLERANCES, UnknownTolerance, built, lapse};
use crate::Device;
use crate::agv::AgvConfig;
use crate::agv::hooks::Outgoing;
use serde_json::{Value, json};
use tck_base::clock::{Moment, Stamp};

fn config() -> AgvConfig {
    AgvConfig {
        version: "7.8.9".into(),
        topics: [("connection".to_owned(), "uagv/v7/Reference/agv-1/connection".to_owned())].into(),
        ..AgvConfig::default()
    }
}

#[test]
fn every_name_is_kebab_case_and_unique_among_all() {
    let faults = FAULTS.iter().map(|fault| fault.name);
    let all: Vec<&str> = faults
        .chain(TOLERANCES.iter().map(|tolerance| tolerance.name))
        .collect();
    let letters = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    assert!(all.iter().all(|name| name.chars().all(letters)));
    let unique: BTreeSet<&str> = all.iter().copied().collect();
    assert_eq!(unique.len(), all.len());
    assert!(super::RECORDS.iter().count() > 200 && all.len() > 700);
}

#[test]
fn each_lapse_has_a_reason_of_its_own() {
    let all = FAULTS.iter().map(|fault| fault.name);
    let lapses: Vec<&str> = all.filter_map(lapse).collect();
    assert!(lapse("state-qos-1").is_some() && lapse("will-qos-0").is_none());
    assert!(
        lapses.iter().all(|why| why.ends_with('.') && why.len() > 30),
        "{lapses:#?}"
    );
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
        (super::RECORDS.find(name).unwrap().make)().reads(&agv, &mut read);
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

/// A state as a vehicle with these tolerances sends it.
fn sent(names: &[&str]) -> Vec<u8> {
    let mut config = config();
    for name in names {
        config.tolerate(name).unwrap();
    }
    let mut agv = built(config, &[]).unwrap();
    let message = json!({ "headerId": 3, "errors": [], "information": [], "velocity": { "vx": 0.5 },
        "actionStates": [{ "actionId": "1", "actionStatus": "WAITING" }],
        "agvPosition": { "x": 2.5, "y": -1e-9, "theta": 0.0 }, "driving": true });
    let mut outgoing = Outgoing {
        name: "state",
        topic: String::new(),
        message: message.as_object().unwrap().clone(),
        qos: 0,
        retain: false,
        periodic: false,
    };
    assert!(agv.sends(&mut outgoing));
    let mut text = Value::Object(outgoing.message.clone()).to_string().into_bytes();
    agv.writes(&outgoing, &mut text);
    text
}

#[test]
fn whatever_the_liberties_a_message_is_json_and_says_the_same() {
    let names: Vec<&str> = TOLERANCES.iter().map(|tolerance| tolerance.name).collect();
    for name in &names {
        let read: Value = serde_json::from_slice(&sent(&[name])).unwrap();
        assert_eq!(read["driving"], true, "{name}");
        assert_eq!(read["headerId"].as_f64(), Some(3.0), "{name}");
        assert!(read["agvPosition"]["y"].as_f64().unwrap().abs() < 1e-6, "{name}");
    }
    let read: Value = serde_json::from_slice(&sent(&names)).unwrap();
    assert_eq!(read["agvPosition"]["x"], 2.5);
}

#[test]
fn numbers_and_texts_are_written_otherwise() {
    let text = |names: &[&str]| String::from_utf8(sent(names)).unwrap();
    assert!(text(&["exponents"]).contains("\"x\":2.5e0,\"y\":-1e-9"));
    assert!(text(&["many-digits"]).contains("\"x\":2.50000000000000"));
    assert!(text(&["floats-for-integers"]).contains("\"headerId\":3.0"));
    assert!(text(&["text-escaped"]).starts_with("{\"h\\u0065ad\\u0065rId\":3"));
    assert!(text(&["keys-reordered"]).starts_with("{\"driving\""));
    assert!(text(&["vendor-fields"]).contains("\"vx\":0.5,\"x-vendor\""));
    assert!(!text(&["optional-omitted"]).contains("velocity"));
}

#[test]
fn a_slow_vehicle_is_slow_at_its_stations_whichever_tolerance_came_first() {
    let taken = |names: [&str; 2]| {
        let mut config = AgvConfig::default();
        assert!(names.into_iter().all(|name| config.tolerate(name).is_ok()));
        config.action_durations["pick"]
    };
    let names = ["actions-at-once", "states-coalesced"];
    assert_eq!(taken(names), taken([names[1], names[0]]));
}

#[test]
fn an_unknown_tolerance_is_refused_by_name() {
    let mut config = AgvConfig::default();
    let unknown = |name: &str| Err(UnknownTolerance(name.to_owned()));
    assert_eq!(config.tolerate("no-such"), unknown("no-such"));
    assert_eq!(config.tolerate("will-qos-0"), unknown("will-qos-0"));
    assert_eq!(config, AgvConfig::default());
    assert_eq!(config.tolerate("newest-mqtt"), Ok(()));
    let options = built(config, &[]).unwrap().connect_options(Stamp {
        moment: Moment::START,
        utc: jiff::Timestamp::UNIX_EPOCH,
    });
    assert_eq!((options.level, options.clean_session), (5, true));
}
