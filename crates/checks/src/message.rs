//! `message/schema`, `message/encoding`: every message by itself.
//!
//! Relations between fields and between messages are left to the other checks; so are the fraction digits of
//! a timestamp and the value of a version, which `header` judges by their own rulings.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use serde_json::Value;

use crate::finding::{broken, number, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::json::JsonProblem;
use tck_pack::{Finding, FindingKind, MessageSchema, Pack};
use tck_view::{
    ActionView, BatteryState, Edge, FactsheetView, Field, Header, InstantActionsView, Member, MessageView, Names, Node,
    OrderView, PhysicalParameters, StateView, Topic, VisualizationView,
};
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

/// `message/encoding`.
pub(super) const ENCODING: Check = Check {
    name: "message/encoding",
    decides: &["MQTT-02", "JSON-03", "JSON-08", "JSON-10"],
    doc: "Every payload is one JSON object in UTF-8 without NaN, Infinity or numbers beyond all limits. A byte order \
          mark and a member that occurs twice are warnings. Clearing a retained topic with nothing is no finding.",
    arguments: &[],
    listens: &[Listen::AnyDelivered, Listen::AnyPublished],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Encoding),
};

struct Schema {
    /// The member names of each topic's messages.
    members: BTreeMap<String, Vec<String>>,
    /// The member names of what is inside of messages, by topic and path.
    inner: Vec<Inner>,
    /// What the version calls the members of [`OF_ORDER`].
    of_order: Vec<String>,
    /// An angle beyond pi by what single precision does to it was remarked on.
    rounded: bool,
}

/// Objects inside of the messages of a topic, and the members they have.
struct Inner {
    topic: Topic,
    /// The names on the way to them.
    path: Vec<String>,
    members: Vec<String>,
}

impl Inner {
    /// `None` where the version has no such objects.
    fn of(topic: Topic, path: &[Field], pack: &Pack) -> Option<Self> {
        let names: Option<Vec<&str>> = path.iter().map(|field| pack.names().name(*field)).collect();
        let names: Vec<&str> = names?.into_iter().flat_map(|name| name.split('/')).collect();
        Some(Self {
            topic,
            members: pack.schema(topic.as_str())?.members(&names),
            path: names.into_iter().map(str::to_owned).collect(),
        })
    }
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
        let names = context.topics.keys();
        let members = names.filter_map(|name| Some((name.clone(), context.pack.schema(name)?.members(&[]))));
        let inner = INNER
            .iter()
            .filter_map(|(topic, path)| Inner::of(*topic, path, context.pack));
        let of_order = OF_ORDER.iter().filter_map(|field| context.pack.names().name(*field));
        Self {
            members: members.collect(),
            inner: inner.collect(),
            of_order: of_order.map(str::to_owned).collect(),
            rounded: false,
        }
    }

    /// Optional members that are known ones but for their spelling; those that are missing by it were named with that.
    fn misspelled(&self, topic: &str, value: &Value, seq: u64, findings: &mut Vec<CheckFinding>) {
        let whole = Inside {
            value,
            places: [None; DEEPEST],
        };
        if let Some(known) = self.members.get(topic) {
            odd_members(topic, &[], vec![whole], known, seq, findings);
        }
        for Inner { path, members, .. } in self.inner.iter().filter(|inner| inner.topic.as_str() == topic) {
            let mut inside = vec![whole];
            for (level, name) in path.iter().enumerate() {
                let all = inside.iter().flat_map(|one| one.inner(level, name));
                inside = all.take(INSIDE).collect();
            }
            odd_members(topic, path, inside, members, seq, findings);
        }
    }
}

/// What is inside of messages and has members of its own.
const INNER: [(Topic, &[Field]); 16] = [
    (Topic::State, &[StateView::safety_state]),
    (Topic::State, &[StateView::battery_state]),
    (Topic::State, &[StateView::position]),
    (Topic::State, &[StateView::velocity]),
    (Topic::State, &[StateView::errors]),
    (Topic::Visualization, &[VisualizationView::position]),
    (Topic::Visualization, &[VisualizationView::velocity]),
    (Topic::Order, &[OrderView::nodes]),
    (Topic::Order, &[OrderView::nodes, Node::node_position]),
    (Topic::Order, &[OrderView::nodes, Node::actions]),
    (
        Topic::Order,
        &[OrderView::nodes, Node::actions, ActionView::action_parameters],
    ),
    (Topic::Order, &[OrderView::edges]),
    (Topic::Order, &[OrderView::edges, Edge::actions]),
    (Topic::Order, &[OrderView::edges, Edge::corridor]),
    (Topic::Order, &[OrderView::edges, Edge::trajectory]),
    (Topic::InstantActions, &[InstantActionsView::actions]),
];
/// How many of them are looked at.
const INSIDE: usize = 512;

/// How many names lead to the deepest of them, at most.
const DEEPEST: usize = 6;

/// What is inside of a message, and its place in each list on the way to it.
#[derive(Clone, Copy)]
struct Inside<'v> {
    value: &'v Value,
    places: [Option<usize>; DEEPEST],
}

impl<'v> Inside<'v> {
    /// What goes by a name inside of this: the elements of a list, or the one that stands there.
    fn inner(&self, level: usize, name: &str) -> impl Iterator<Item = Self> + use<'v> {
        let mut places = self.places;
        let found = self.value.get(name);
        let (list, one) = match found {
            Some(Value::Array(list)) => (list.as_slice(), None),
            one => (&[][..], one),
        };
        let elements = list.iter().take(INSIDE).enumerate();
        let elements = elements.map(move |(at, value)| {
            if let Some(place) = places.get_mut(level) {
                *place = Some(at);
            }
            Self { value, places }
        });
        elements.chain(one.map(|value| Self { value, places }))
    }

    /// Where it stands.
    fn place(&self, topic: &str, path: &[String]) -> String {
        let mut place = topic.to_owned();
        for (name, at) in path.iter().zip(self.places) {
            let _ = write!(place, "/{name}");
            if let Some(at) = at {
                let _ = write!(place, "/{at}");
            }
        }
        place
    }
}

/// Members of these objects that are known ones but for their spelling. Where the right one stands beside it, it is one of the
/// vendor's own.
fn odd_members(
    topic: &str,
    path: &[String],
    objects: Vec<Inside<'_>>,
    known: &[String],
    seq: u64,
    findings: &mut Vec<CheckFinding>,
) {
    // The same mistake is made everywhere; once is enough.
    let mut said = BTreeSet::new();
    for inside in objects {
        let value = inside.value;
        let odd = value.as_object().into_iter().flatten().map(|(name, _)| name);
        for name in odd.filter(|name| name.len() < 64 && !known.contains(name)).take(16) {
            let meant = known.iter().find(|known| plain(known) == plain(name));
            let Some(meant) = meant.filter(|meant| value.get(meant.as_str()).is_none()) else {
                continue;
            };
            let place = inside.place(topic, path);
            let is_said = |finding: &CheckFinding| {
                finding.seq == seq && finding.message.starts_with(&format!("{place}/{meant}: "))
            };
            if !findings.iter().any(is_said) && said.insert(name.clone()) {
                let text = format!("{place}/{name}: this member is spelled {meant:?}");
                findings.push(broken("JSON-01", seq, text));
            }
        }
    }
}

/// The member that stands there instead of one that is missing: the same but for its spelling, or nearly the same.
fn standing_instead<'v>(finding: &Finding, schema: &MessageSchema, value: &'v Value) -> Option<&'v str> {
    let (holder, name) = finding.path.rsplit_once('/')?;
    let members = value.pointer(holder)?.as_object()?;
    let path: Vec<&str> = holder
        .split('/')
        .skip(1)
        .filter(|part| part.parse::<u32>().is_err())
        .collect();
    let known = schema.members(&path);
    let odd = || {
        let names = members.keys().map(String::as_str);
        names.filter(|other| other.len() < 64 && !known.iter().any(|known| known == other))
    };
    odd()
        .find(|other| plain(other) == plain(name))
        .or_else(|| odd().find(|other| is_slip(other, name)))
}

/// Whether one name is the other but for a slip of the hand.
fn is_slip(one: &str, other: &str) -> bool {
    strsim::osa_distance(one, other) <= (other.len() / 4).min(2)
}

fn plain(name: &str) -> String {
    name.chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|character| character.to_ascii_lowercase())
        .collect()
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
        self.misspelled(topic, value, seq, findings);
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

struct Encoding;

impl Running for Encoding {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(message) = record.published() else {
            return false;
        };
        let (Some(parsed), Some(payload)) = (record.parsed(), record.payload()) else {
            return false;
        };
        let (topic, seq) = (message.name, record.seq());
        let mut judged = true;
        for problem in parsed.problems().iter().take(8) {
            let text = format!("{topic}: {}", quote(&problem.to_string()));
            match problem {
                // Too big to be kept and too deep to be parsed are limits of ours.
                JsonProblem::TooBig { .. } | JsonProblem::TooDeep => judged = false,
                // Nothing, retained, clears a topic; a subscriber does not see which it was.
                JsonProblem::Empty if message.retain.unwrap_or(matches!(topic, "connection" | "factsheet")) => {
                    judged = false;
                }
                JsonProblem::Empty | JsonProblem::NotAnObject => findings.push(broken("MQTT-02", seq, text)),
                JsonProblem::NotUtf8 { .. } => {
                    findings.push(broken("JSON-03", seq, text.clone()));
                    findings.push(broken("MQTT-02", seq, text));
                }
                JsonProblem::ByteOrderMark => findings.push(remark("JSON-03", seq, text)),
                JsonProblem::DuplicateMember(_) => findings.push(remark("JSON-10", seq, text)),
                JsonProblem::Syntax(reason) => {
                    if reason.contains("number out of range") || names_no_number(payload.bytes()) {
                        findings.push(broken("JSON-08", seq, text.clone()));
                    }
                    findings.push(broken("MQTT-02", seq, text));
                }
            }
        }
        judged
    }
}

/// Whether NaN or Infinity stands somewhere outside of a string.
fn names_no_number(bytes: &[u8]) -> bool {
    let (mut quoted, mut escaped) = (false, false);
    for (at, byte) in bytes.iter().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if quoted => escaped = true,
            b'"' => quoted = !quoted,
            b'N' | b'I' if !quoted => {
                let rest = &bytes[at..];
                if rest.starts_with(b"NaN") || rest.starts_with(b"Infinity") {
                    return true;
                }
            }
            _ => {}
        }
    }
    false
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

    fn encoded(bytes: &[u8]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.bytes("state", bytes);
        trace.judge("message/encoding").summary()
    }

    #[test]
    fn one_object_in_utf8_is_right() {
        assert!(encoded("{\"x\":\"Nürnberg NaN\"}".as_bytes()).is_empty());
    }

    #[test]
    fn what_is_no_json_object_in_utf8_is_found() {
        assert_eq!(encoded(b""), ["MQTT-02"]);
        assert_eq!(encoded(b"[1]"), ["MQTT-02"]);
        assert_eq!(encoded(b"{\"a\":1} {}"), ["MQTT-02"]);
        assert_eq!(encoded(b"{\"a\":\"\xff\"}"), ["JSON-03", "MQTT-02"]);
        assert_eq!(encoded(b"\xef\xbb\xbf{}"), ["JSON-03 warning"]);
        assert_eq!(encoded(b"{\"a\":1,\"a\":2}"), ["JSON-10 warning"]);
        assert_eq!(encoded(b"{\"a\":NaN}"), ["JSON-08", "MQTT-02"]);
        assert_eq!(encoded(b"{\"a\":-Infinity}"), ["JSON-08", "MQTT-02"]);
        assert_eq!(encoded(b"{\"a\":1e999}"), ["JSON-08", "MQTT-02"]);
    }

    #[test]
    fn clearing_a_retained_topic_is_no_finding() {
        let mut trace = Trace::subscriber();
        trace.bytes("connection", b"");
        let outcome = trace.judge("message/encoding");
        assert!(outcome.findings.is_empty() && outcome.judged == 0);
    }
}
