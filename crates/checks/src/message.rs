//! `message/schema`: every message by itself, as the schema of its topic has it.
//!
//! Relations between fields and between messages are left to the other checks; so are the fraction digits of
//! a timestamp and the value of a version, which `header` judges by their own rulings.

use std::fmt::Write as _;

use serde_json::Value;

use super::message_spelling::{Spelling, plain, standing_instead};
use crate::finding::{broken, number, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_pack::{Finding, FindingKind, Pack};
use tck_view::{BatteryState, FactsheetView, Field, Header, Member, MessageView, Names, PhysicalParameters, StateView};
use tck_world::{Fact, Listen, Observation};

/// `message/schema`.
pub(super) const SCHEMA: Check = Check {
    name: "message/schema",
    decides: &[
        "JSON-10",
        "JSON-01",
        "JSON-02",
        "JSON-06",
        "JSON-07",
        "JSON-08",
        "JSON-09",
        "HDR-01",
        "CONN-10",
        "STATE-01",
        "STATE-MSG-01",
        "STATE-MSG-05",
        "STATE-MSG-13",
        "STATE-MSG-14",
        "STATE-MSG-15",
        "MODE-01",
        "ERR-02",
        "ERR-05",
        "INFO-01",
        "MAP-12",
        "FACT-02",
        "FACT-03",
        "FACT-04",
        "FACT-05",
        "FACT-06",
        "FACT-07",
        "FACT-08",
        "FACT-09",
        "FACT-10",
        "VIS-01",
        "ORD-MSG-01",
        "ORD-MSG-03",
        "ORD-MSG-05",
        "ORD-MSG-15",
        "ORD-MSG-16",
        "ORD-MSG-18",
        "IACT-01",
        "BP-05",
        "CORR-09",
        "CORR-12",
        "IACT-08",
        "IACT-STATE-08",
        "ORD-02",
        "ORD-MSG-06",
        "ORD-MSG-09",
        "ORD-MSG-28",
        "ORD-MSG-29",
        "ORD-MSG-31",
        "ORD-MSG-35",
        "PATH-03",
        "PATH-06",
        "PATH-07",
        "REQ-02",
        "REQ-04",
        "REQ-05",
        "STATE-MSG-17",
        "ZONE-01",
        "ZREQ-06",
        "ZREQ-07",
        "ZSET-04",
        "ZSET-14",
        "ZSET-19",
        "ZSET-20",
        "ZSET-21",
        "ZSET-22",
    ],
    doc: "Every message obeys the schema of its topic, written from the field tables of the document. A finding counts \
          for JSON-10, for the rule on JSON types or literals it breaks, and for the requirement of the field. A \
          charge outside 0 to 100 is a warning. What single precision makes of pi is a warning, once. What a state \
          repeats of a malformed message of the harness, or still lists of it under a later order, is not judged: that it was \
          taken over is the mistake.",
    arguments: &[],
    listens: &[Listen::AnyDelivered],
    reads: &[Fact::Malformed],
    needs: &[],
    start: |context| Box::new(Schema::new(context)),
};

struct Schema {
    spelling: Spelling,
    /// What the version calls the members of [`OF_ORDER`].
    of_order: Vec<String>,
    /// An angle beyond pi by what single precision does to it was remarked on.
    rounded: bool,
}

/// Members of a state that repeat what an order said.
const OF_ORDER: [Field; 8] = [
    StateView::order_id,
    StateView::order_update_id,
    StateView::node_states,
    StateView::edge_states,
    StateView::action_states,
    StateView::last_node_id,
    StateView::last_node_sequence_id,
    StateView::zone_set_id,
];

/// What rounding adds to a percentage.
const ROUNDED: f64 = 0.001;
/// Pi and what single precision, or seven digits, make of it.
const PI_IN_SINGLE_PRECISION: f64 = std::f64::consts::PI + 5.0e-7;

/// Whether a number is out of range by no more than single precision explains, or is pi as far as it is written: 3.142,
/// 3.1416.
fn is_rounded_pi(finding: &Finding, value: &Value) -> bool {
    let number = value.pointer(&finding.path).and_then(Value::as_f64);
    finding.kind == FindingKind::Range
        && number.is_some_and(|number| {
            let shown = number.abs().to_string();
            let digits = shown.split_once('.').map_or(0, |(_, digits)| digits.len());
            let is_written_so = digits >= 3 && format!("{:.digits$}", std::f64::consts::PI) == shown;
            is_written_so || (3.0..=PI_IN_SINGLE_PRECISION).contains(&number.abs())
        })
}

impl Schema {
    fn new(context: &CheckContext<'_>) -> Self {
        let of_order = OF_ORDER.iter().filter_map(|field| context.pack.names().name(*field));
        Self {
            spelling: Spelling::new(context),
            of_order: of_order.map(str::to_owned).collect(),
            rounded: false,
        }
    }
}

impl Running for Schema {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(message) = record.delivered() else {
            return false;
        };
        let (Some(schema), Some(value)) = (context.pack.schema(message.name), record.json()) else {
            return false;
        };
        if !value.is_object() {
            return false;
        }
        let (topic, seq) = (message.name, record.seq());
        let of_order = topic == "state" && context.world.malformed().is_shown(record);
        for finding in schema.findings(value) {
            let first = finding.path.split('/').nth(1).unwrap_or_default();
            let repeats = topic == "state" && self.of_order.iter().any(|name| name == first);
            if repeats && (of_order || context.world.malformed().is_echo(value, &finding.path)) {
                continue;
            }
            if is_rounded_pi(&finding, value) {
                if !std::mem::replace(&mut self.rounded, true) {
                    let text = format!("{topic}{}: {}, by rounding", finding.path, finding.message);
                    findings.push(remark("JSON-10", seq, text));
                }
                continue;
            }
            let mut text = format!("{topic}{}: {}", finding.path, finding.message);
            let instead = Some(&finding).filter(|finding| finding.kind == FindingKind::Missing);
            let instead = instead.and_then(|finding| standing_instead(finding, schema, value));
            if let Some(other) = instead {
                let _ = write!(text, ", and {} stands there", quote(other));
            }
            for id in requirements(context.pack, topic, &finding, value) {
                findings.push(broken(id, seq, text.clone()));
            }
            let name = finding.path.rsplit('/').next().unwrap_or_default();
            if instead.is_some_and(|other| plain(other) == plain(name)) {
                findings.push(broken("JSON-01", seq, text));
            }
        }
        self.spelling.misspelled(topic, value, seq, findings);
        let view = record.message();
        let charge = view
            .and_then(MessageView::state)
            .and_then(|state| beyond_full(state, record.names(), seq));
        findings.extend(charge);
        let sheet = view.and_then(MessageView::factsheet);
        findings.extend(sheet.and_then(|sheet| without_height(sheet, record.names(), seq)));
        true
    }
}

/// A charge that is no percentage.
fn beyond_full(state: &StateView, names: &Names, seq: u64) -> Option<CheckFinding> {
    let charge = state.battery_state.there()?.battery_charge.float()?;
    let (object, member) = (
        names.name(StateView::battery_state)?,
        names.name(BatteryState::battery_charge)?,
    );
    let text = format!(
        "state/{object}/{member}: {} is not between 0 and 100 percent",
        number(charge)
    );
    let is_one = (-ROUNDED..=100.0 + ROUNDED).contains(&charge);
    (!is_one).then(|| remark("STATE-MSG-15", seq, text))
}

/// The lowest height of a vehicle, which the document asks for and the schema does not.
fn without_height(sheet: &FactsheetView, names: &Names, seq: u64) -> Option<CheckFinding> {
    let has_height = |physical: &PhysicalParameters| !physical.height_min.is_absent();
    let has_it = match &sheet.physical_parameters {
        Member::Absent => true,
        physical => physical.there().is_some_and(has_height),
    };
    let (object, member) = (
        names.name(FactsheetView::physical_parameters)?,
        names.name(PhysicalParameters::height_min)?,
    );
    let text = format!("factsheet/{object}: `{member}` is missing, which the document asks for");
    (!has_it).then(|| remark("FACT-04", seq, text))
}

/// Every requirement that a schema finding breaks; none for what another check judges by a milder ruling.
fn requirements<'p>(pack: &'p Pack, topic: &str, finding: &Finding, value: &Value) -> Vec<&'p str> {
    let path: Vec<&str> = finding.path.split('/').skip(1).collect();
    let milder = [Header::timestamp, Header::version].map(|field| pack.names().name(field));
    if finding.kind == FindingKind::Pattern && path.len() == 1 && milder.contains(&path.first().copied()) {
        return Vec::new();
    }
    let mut all = vec!["JSON-10"];
    let found = value.pointer(&finding.path);
    all.extend(match finding.kind {
        FindingKind::Enumeration => Some("JSON-02"),
        FindingKind::Range => Some("JSON-09"),
        FindingKind::Type if finding.message.ends_with("boolean") || found.is_some_and(Value::is_boolean) => {
            Some("JSON-07")
        }
        FindingKind::Type if found.and_then(Value::as_str).is_some_and(special) => Some("JSON-08"),
        FindingKind::Type => Some("JSON-06"),
        FindingKind::Missing | FindingKind::Pattern | FindingKind::Other => None,
    });
    all.extend(pack.requirement_of(topic, &path, finding.kind));
    if topic == "visualization" && !all.contains(&"VIS-01") {
        all.push("VIS-01");
    }
    if topic == "instantActions" && all.ends_with(&["ORD-MSG-15"]) {
        all.push("IACT-01");
    }
    if all.ends_with(&["STATE-MSG-01"]) && finding.kind == FindingKind::Missing {
        all.push("STATE-01");
    }
    all
}

/// The names IEEE 754 gives to what is no number.
fn special(text: &str) -> bool {
    let text = text.trim_start_matches(['+', '-']);
    ["nan", "inf", "infinity"]
        .iter()
        .any(|name| text.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

    fn state(over: &Value) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.state(over);
        trace.judge("message/schema").summary()
    }

    #[test]
    fn what_is_left_of_a_malformed_message_is_not_judged_under_a_later_order() {
        let shown = |kind: &Value, sequence: i64| {
            let mut trace = Trace::subscriber();
            let header = trace.header();
            let action = json!({ "actionId": "x", "actionType": 7, "blockingType": "HARD", "actionParameters": [] });
            let mut instant = header.clone();
            instant["actions"] = json!([action]);
            trace.sent("instantActions", &instant);
            let node =
                |sequence: i64| json!({ "nodeId": "a", "sequenceId": sequence, "released": true, "actions": [] });
            for (id, sequence) in [("bad", -1), ("good", 0)] {
                let mut order = header.clone();
                order["orderId"] = json!(id);
                order["orderUpdateId"] = json!(0);
                order["nodes"] = json!([node(sequence)]);
                order["edges"] = json!([]);
                trace.sent("order", &order);
            }
            let action = json!({ "actionId": "y", "actionType": kind, "actionStatus": "FINISHED" });
            trace.state(&json!({ "orderId": "good", "lastNodeSequenceId": sequence, "actionStates": [action] }));
            trace.judge("message/schema").summary()
        };
        assert_eq!(shown(&json!(7), -1), Vec::<String>::new());
        assert!(!shown(&json!(8), 0).is_empty(), "that was never sent");
        assert!(!shown(&json!("pick"), -2).is_empty(), "nor was that");
    }

    #[test]
    fn a_complete_state_with_extra_members_is_right() {
        assert_eq!(
            state(&json!({ "vendorExtra": { "anything": 1 } })),
            Vec::<String>::new()
        );
    }

    #[test]
    fn each_kind_of_violation_names_its_requirements() {
        let cases = [
            (json!({ "headerId": null }), vec!["JSON-10", "HDR-01"]),
            (
                json!({ "nodeStates": null }),
                vec!["JSON-10", "STATE-MSG-01", "STATE-01"],
            ),
            (
                json!({ "operatingMode": "automatic" }),
                vec!["JSON-10", "JSON-02", "MODE-01"],
            ),
            (
                json!({ "driving": "false" }),
                vec!["JSON-10", "JSON-07", "STATE-MSG-01"],
            ),
            (
                json!({ "orderUpdateId": -1 }),
                vec!["JSON-10", "JSON-09", "STATE-MSG-01"],
            ),
            (
                json!({ "agvPosition": { "x": "1" } }),
                vec!["JSON-10", "JSON-06", "STATE-MSG-05"],
            ),
            (
                json!({ "agvPosition": { "x": "NaN" } }),
                vec!["JSON-10", "JSON-08", "STATE-MSG-05"],
            ),
            (json!({ "errors": [{ "errorType": "x" }] }), vec!["JSON-10", "ERR-02"]),
            (
                json!({ "errors": [{ "errorType": "x", "errorLevel": "WARNING",
                    "errorReferences": [{ "referenceKey": "nodeId", "referenceValue": 5 }] }] }),
                vec!["JSON-10", "JSON-06", "ERR-05"],
            ),
            (
                json!({ "actionStates": [{ "actionId": "a", "actionStatus": "DONE" }] }),
                vec!["JSON-10", "JSON-02", "STATE-MSG-14"],
            ),
            (
                json!({ "maps": [{ "mapId": "a", "mapStatus": "ENABLED" }] }),
                vec!["JSON-10", "MAP-12"],
            ),
        ];
        for (over, expected) in cases {
            assert_eq!(state(&over), expected, "{over}");
        }
    }

    #[test]
    fn a_known_member_in_other_spelling_is_found() {
        let found = state(&json!({ "driving": null, "Driving": false }));
        assert_eq!(found, ["JSON-10", "STATE-MSG-01", "STATE-01", "JSON-01"]);
    }

    #[test]
    fn a_member_of_ones_own_beside_the_right_one_is_no_slip() {
        assert!(state(&json!({ "Driving": false, "charging_": true })).is_empty());
        assert_eq!(state(&json!({ "Paused": true })), ["JSON-01"]);
        assert_eq!(state(&json!({ "paused": true, "Paused": true })), Vec::<String>::new());
    }

    #[test]
    fn a_charge_that_is_no_percentage_is_a_warning() {
        let charged = |charge: f64| state(&json!({ "batteryState": { "batteryCharge": charge, "charging": false } }));
        for right in [0.0, -0.0, 0.5, 80.0, 100.0, 100.000_007] {
            assert!(charged(right).is_empty(), "{right}");
        }
        for wrong in [-1.0, 100.1, 105.3, 255.0, 1.0e300] {
            assert_eq!(charged(wrong), ["STATE-MSG-15 warning"], "{wrong}");
        }
    }

    #[test]
    fn what_stands_instead_of_a_missing_member_is_named_with_it() {
        let mut trace = Trace::subscriber();
        trace.state(&json!({ "driving": null, "Driving": false, "errors": null, "error": [] }));
        let found = trace.judge("message/schema").findings;
        let texts: std::collections::BTreeSet<&str> = found.iter().map(|finding| finding.message.as_str()).collect();
        let wanted = [
            "state/driving: `driving` is missing, and \"Driving\" stands there",
            "state/errors: `errors` is missing, and \"error\" stands there",
        ];
        assert_eq!(texts.into_iter().collect::<Vec<_>>(), wanted);
    }

    #[test]
    fn forms_that_other_checks_judge_are_left_to_them() {
        assert!(state(&json!({ "timestamp": "yesterday", "version": "two" })).is_empty());
    }

    #[test]
    fn other_topics_have_their_own_requirements() {
        let mut trace = Trace::subscriber();
        trace.connection("connected");
        assert_eq!(
            trace.judge("message/schema").summary(),
            ["JSON-10", "JSON-02", "CONN-10"]
        );
        let mut trace = Trace::subscriber();
        let header = trace.header();
        trace.message("factsheet", &header);
        let found = trace.judge("message/schema").summary();
        assert_eq!(found.iter().filter(|id| *id == "FACT-02").count(), 6);
    }
}
