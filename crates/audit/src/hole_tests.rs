//! What outlasts a hole in a recording, and what does not.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde_json::{Value, json};

use super::result::{AuditResult, SideResult};
use super::*;
use tck_base::verdict::Verdict;
use tck_pack::Role;

/// A vehicle that stands idle and its master control, as a recorder hears them.
struct Heard {
    at: jiff::Timestamp,
    /// The time between two messages.
    pace: Duration,
    counts: BTreeMap<&'static str, u64>,
    messages: Vec<Message>,
}

impl Heard {
    fn new() -> Self {
        Self {
            at: "2026-05-18T12:00:00Z".parse().expect("a time"),
            pace: Duration::from_secs(1),
            counts: BTreeMap::new(),
            messages: Vec::new(),
        }
    }

    /// Puts a message together that comes after the one before.
    fn message(&mut self, topic: &'static str, members: Value, retain: bool) -> Message {
        self.at += self.pace;
        let count = self.counts.entry(topic).or_default();
        let version = tck_testing::library().rules.packs.latest().version.to_string();
        let mut payload = json!({ "headerId": *count, "timestamp": format!("{:.2}", self.at), "version": version,
            "manufacturer": "ACME", "serialNumber": "7" });
        *count += 1;
        let (all, more) = (payload.as_object_mut().expect("an object"), members);
        all.extend(more.as_object().expect("an object").clone());
        Message {
            at: Some(self.at),
            topic: format!("uagv/v2/ACME/7/{topic}"),
            payload: payload.to_string().into(),
            qos: Some(0),
            retain: Some(retain),
            place: SourcePosition::default(),
            after_gap: false,
            carried: None,
        }
    }

    fn says(&mut self, topic: &'static str, members: Value) -> &mut Self {
        let message = self.message(topic, members, false);
        self.messages.push(message);
        self
    }

    fn online(&mut self) -> &mut Self {
        self.says("connection", json!({ "connectionState": "ONLINE" }))
    }

    fn states(&mut self, count: usize) -> &mut Self {
        for _ in 0..count {
            self.says("state", idle());
        }
        self
    }

    /// Commands an action at once.
    fn commands(&mut self, kind: &str, parameters: Value) -> &mut Self {
        let id = format!("a{}", self.counts.entry("instantActions").or_default());
        let action =
            json!({ "actionId": id, "actionType": kind, "blockingType": "NONE", "actionParameters": parameters });
        self.says("instantActions", json!({ "actions": [action] }))
    }

    /// What comes next the recorder loses.
    fn loses(&mut self, topic: &'static str) -> &mut Self {
        self.at += self.pace;
        *self.counts.entry(topic).or_default() += 1;
        self
    }

    fn audited(&self) -> AuditResult {
        let mut audit = Audit::new(&tck_testing::library().rules, Options::default()).expect("options");
        for message in &self.messages {
            audit.observe(message.clone());
        }
        audit.finish(Vec::new())
    }

    /// The requirements that are told to be broken while it is heard, and that nothing takes back.
    fn told(&self) -> BTreeSet<String> {
        let audit = Audit::new(&tck_testing::library().rules, Options::default());
        let mut audit = audit.expect("options").live();
        let mut told = Vec::new();
        for message in &self.messages {
            audit.observe(message.clone());
            told.extend(audit.news());
        }
        let fails = told.into_iter().filter(|found| found.verdict == Verdict::Fail);
        fails.map(|found| found.requirement).collect()
    }
}

fn idle() -> Value {
    json!({ "orderId": "", "orderUpdateId": 0, "lastNodeId": "n0", "lastNodeSequenceId": 0, "nodeStates": [],
        "edgeStates": [], "actionStates": [], "driving": false, "operatingMode": "AUTOMATIC", "errors": [],
        "batteryState": { "batteryCharge": 80.0, "charging": false },
        "safetyState": { "eStop": "NONE", "fieldViolation": false } })
}

/// A factsheet that lists pick and drop.
fn factsheet() -> Value {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../fixtures/messages/2.1/good/factsheet-full.json"
    );
    let text = std::fs::read_to_string(path).expect("fixture");
    let mut sheet: Value = serde_json::from_str(&text).expect("JSON");
    let all = sheet.as_object_mut().expect("an object");
    for member in ["headerId", "timestamp", "version", "manufacturer", "serialNumber"] {
        all.shift_remove(member);
    }
    sheet
}

fn side(result: &AuditResult, role: Role) -> &SideResult {
    let mut sides = result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
    sides.find(|side| side.role == role.word()).expect("a side")
}

fn broken(result: &AuditResult, role: Role) -> BTreeSet<&str> {
    let findings = side(result, role).findings.iter();
    let fails = findings.filter(|finding| finding.verdict == Verdict::Fail);
    fails.map(|finding| finding.requirement.as_str()).collect()
}

#[test]
fn a_factsheet_outlasts_what_cannot_have_changed_it() {
    let judged = |between: fn(&mut Heard)| {
        let mut heard = Heard::new();
        heard.online().says("factsheet", factsheet()).states(10);
        between(&mut heard);
        heard.states(3).commands("polishFloor", json!([]));
        broken(&heard.audited(), Role::MasterControl).contains("FACT-15")
    };
    assert!(judged(|_| {}));
    assert!(judged(|heard| {
        heard.loses("state");
    }));
    assert!(judged(|heard| {
        heard.online();
    }));
    assert!(judged(|heard| {
        heard
            .says("visualization", json!({}))
            .loses("visualization")
            .says("visualization", json!({}));
    }));
    // It may have been given other software while nobody was looking, or have said something else.
    assert!(!judged(|heard| {
        heard.counts.insert("state", 0);
    }));
    assert!(!judged(|heard| {
        heard.loses("factsheet").says("factsheet", json!({}));
    }));
}

#[test]
fn a_factsheet_that_was_stored_counts_for_both_sides_and_is_no_evidence() {
    let mut heard = Heard::new();
    let stored = heard.message("factsheet", factsheet(), true);
    heard.messages.push(stored);
    let errors: Vec<Value> = (0..201)
        .map(|number| json!({ "actionId": format!("x{number}"), "actionStatus": "FINISHED" }))
        .collect();
    heard.states(10).commands("polishFloor", json!([]));
    let mut crowded = idle();
    crowded["actionStates"] = errors.into();
    heard.states(2).says("state", crowded).states(3);
    let result = heard.audited();
    assert!(broken(&result, Role::MasterControl).contains("FACT-15"));
    let vehicle = side(&result, Role::Agv);
    assert!(
        broken(&result, Role::Agv).contains("FACT-11"),
        "{:#?}",
        vehicle.findings
    );
    let decided = vehicle.requirements.iter().map(|known| known.id.as_str());
    assert!(!decided.collect::<BTreeSet<_>>().contains("FACT-10"));
}

#[test]
fn what_a_command_may_explain_that_was_lost_is_taken_back() {
    let maps = |versions: &[&str]| {
        let all = versions.iter().map(|version| {
            json!({ "mapId": "hall", "mapVersion": version,
            "mapStatus": if *version == "2" { "ENABLED" } else { "DISABLED" } })
        });
        let mut state = idle();
        state["maps"] = all.collect();
        state
    };
    let judged = |lost: bool| {
        let mut heard = Heard::new();
        heard
            .online()
            .states(2)
            .says("state", maps(&["1", "2"]))
            .says("state", maps(&["1", "2"]));
        heard
            .commands("stateRequest", json!([]))
            .says("state", maps(&["1", "2"]));
        if lost {
            heard.loses("instantActions");
        }
        for _ in 0..3 {
            heard.says("state", maps(&["2"]));
        }
        heard.commands("stateRequest", json!([])).says("state", maps(&["2"]));
        broken(&heard.audited(), Role::Agv).contains("MAP-31")
    };
    assert!(judged(false));
    assert!(!judged(true));
}

#[test]
fn a_lost_visualization_does_not_end_the_judging_of_orders() {
    let mut heard = Heard::new();
    heard
        .online()
        .states(3)
        .says("visualization", json!({}))
        .loses("visualization");
    heard.says("visualization", json!({})).states(3);
    let result = heard.audited();
    let vehicle = side(&result, Role::Agv);
    assert_eq!(vehicle.stretches.len(), 1, "{:#?}", vehicle.stretches);
}

#[test]
fn every_monitor_that_did_not_judge_says_why_and_for_which_messages() {
    let why = |result: &AuditResult, role: Role, monitor: &str| {
        let open = side(result, role).undecided.iter().find(|open| open.monitor == monitor);
        let open = open.unwrap_or_else(|| panic!("{monitor} has judged"));
        let stretch = open.stretch.as_ref();
        (
            open.why.clone(),
            stretch.map(|stretch| (stretch.from.message, stretch.to.message)),
        )
    };
    let mut heard = Heard::new();
    heard.online().states(3).commands("stateRequest", json!([]));
    let result = heard.audited();
    let no_sheet = ("no factsheet of the vehicle was recorded".to_owned(), None);
    assert_eq!(
        why(&result, Role::MasterControl, "commands/actions-of-factsheet"),
        no_sheet
    );
    // An order is under way from the beginning to the end.
    let mut busy = idle();
    busy["orderId"] = "o1".into();
    busy["nodeStates"] = json!([{ "nodeId": "n1", "sequenceId": 2, "released": true }]);
    let mut heard = Heard::new();
    for _ in 0..4 {
        heard.says("state", busy.clone());
    }
    let (text, stretch) = why(&heard.audited(), Role::Agv, "state/remaining-route");
    assert!(text.starts_with("before the first state without an order"), "{text}");
    assert_eq!(stretch, Some((1, 4)));
}

#[test]
fn a_restart_of_which_a_message_was_lost_is_known_before_the_states_behind_it() {
    let told = |signs_off: bool| {
        let mut done = idle();
        done["orderId"] = "o1".into();
        let mut heard = Heard::new();
        heard.online().states(3);
        let node = json!({ "nodeId": "n0", "sequenceId": 0, "released": true, "actions": [] });
        heard.says(
            "order",
            json!({ "orderId": "o1", "orderUpdateId": 0, "nodes": [node], "edges": [] }),
        );
        heard.says("state", done.clone()).says("state", done);
        if signs_off {
            // OFFLINE does not reach the recorder, and ONLINE waits for it.
            heard.loses("connection");
            heard.pace = Duration::from_millis(1);
            heard.online();
        }
        heard.states(2);
        heard.pace = Duration::from_secs(1);
        heard.states(3);
        heard.told().contains("STATE-MSG-02")
    };
    assert!(told(false), "it forgot its order");
    assert!(!told(true), "it may have been started anew");
}

#[test]
fn a_factsheet_behind_one_that_was_lost_counts_for_the_command_after_it() {
    let told = |knows: bool| {
        let mut heard = Heard::new();
        heard.online().says("factsheet", factsheet()).states(10);
        if knows {
            let mut sheet = factsheet();
            let all = sheet["protocolFeatures"]["agvActions"].as_array_mut().expect("actions");
            all.push(json!({ "actionType": "polishFloor", "actionScopes": ["INSTANT"] }));
            // A factsheet does not reach the recorder, and the next one waits for it.
            heard.loses("factsheet");
            heard.pace = Duration::from_millis(1);
            heard.says("factsheet", sheet);
        }
        heard.commands("polishFloor", json!([]));
        heard.pace = Duration::from_secs(1);
        heard.states(3).told().contains("FACT-15")
    };
    assert!(told(false), "its factsheet does not list it");
    assert!(!told(true), "the one before the command lists it");
}
