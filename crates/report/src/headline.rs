//! A record in a few words: its topic and what an engineer looks for first.
//!
//! Only for people; nothing is decided by it. Every value may come from a device and is cleaned and bounded
//! here.

use serde_json::Value;

use super::clean::{line, short};
use tck_journal::{Entry, Event, Packet};

/// Longest single value in a headline, in characters.
const VALUE: usize = 36;
/// Most list members named in a headline.
const MEMBERS: usize = 3;

/// The last level of the topic of a message: `state`, `order`, …
#[must_use]
pub fn topic(entry: &Entry) -> Option<String> {
    let (Event::Message { topic, .. }
    | Event::Sent { topic, .. }
    | Event::Retained { topic, .. }
    | Event::Packet {
        packet: Packet::Publish { topic, .. },
        ..
    }) = entry.event()
    else {
        return None;
    };
    Some(short(&line(topic.rsplit('/').next().unwrap_or(topic)), VALUE).into_owned())
}

/// `state`, `CONNECT`, `link` …: what kind of record it is, in one word or two.
#[must_use]
pub fn kind(entry: &Entry) -> String {
    if let Some(topic) = topic(entry) {
        return topic;
    }
    match entry.event() {
        Event::Packet { packet, .. } => packet_name(packet).to_owned(),
        Event::Undecodable { .. } => "undecodable bytes".to_owned(),
        Event::Opened { .. } | Event::Traced { .. } | Event::Closed { .. } => "connection to the tap".to_owned(),
        Event::Fault { .. } => "link".to_owned(),
        Event::Served { .. } | Event::Fetched { .. } => "map server".to_owned(),
        Event::Hook { hook, .. } => format!("hook {}", short(&line(hook), VALUE)),
        Event::Vehicle { .. } => "mock AGV".to_owned(),
        Event::Question { .. } | Event::Answer { .. } => "operator".to_owned(),
        Event::StepBegun { .. } | Event::StepEnded { .. } | Event::Mark { .. } => "step".to_owned(),
        Event::Program { .. } => "program".to_owned(),
        Event::Interrupted => "interruption".to_owned(),
        Event::Note { .. } => "note".to_owned(),
        Event::Trouble { .. } => "trouble".to_owned(),
        _ => "record".to_owned(),
    }
}

/// The name MQTT gives a packet.
#[must_use]
pub fn packet_name(packet: &Packet) -> &str {
    match packet {
        Packet::Connect { .. } => "CONNECT",
        Packet::Connack { .. } => "CONNACK",
        Packet::Publish { .. } => "PUBLISH",
        Packet::Subscribe { .. } => "SUBSCRIBE",
        Packet::Suback { .. } => "SUBACK",
        Packet::Unsubscribe { .. } => "UNSUBSCRIBE",
        Packet::Disconnect { .. } => "DISCONNECT",
        Packet::Ack { .. } => "ACK",
        Packet::Pingreq => "PINGREQ",
        Packet::Pingresp => "PINGRESP",
        Packet::Auth => "AUTH",
    }
}

/// What a message says, in a few words; `before` is the message before it on the same topic, so that only
/// what changed among the actions is named.
#[must_use]
pub fn headline(entry: &Entry, before: Option<&Value>) -> String {
    let Some(payload) = entry.payload() else {
        return String::new();
    };
    let Some(message) = entry.json() else {
        let problem = entry
            .parsed()
            .and_then(|parsed| parsed.problems().first().map(ToString::to_string));
        let problem = problem.unwrap_or_else(|| "not JSON".to_owned());
        return short(&line(&format!("{} bytes: {problem}", payload.len())), 90).into_owned();
    };
    let parts = match topic(entry).as_deref() {
        Some("order") => order(message),
        Some("instantActions") => instant_actions(message),
        Some("state") => state(message, before),
        Some("connection") => vec![value(message.get("connectionState"))],
        Some("visualization") => vec!["position and velocity".to_owned()],
        Some("factsheet") => vec![value(message.pointer("/typeSpecification/seriesName"))],
        _ => vec![format!("{} bytes", payload.len())],
    };
    parts
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" · ")
}

/// A scalar as it stands there; nothing for `null` and for what is absent.
fn value(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(text)) => short(&line(text), VALUE).into_owned(),
        Some(other @ (Value::Bool(_) | Value::Number(_))) => short(&other.to_string(), VALUE).into_owned(),
        Some(Value::Array(_)) => "[…]".to_owned(),
        Some(Value::Object(_)) => "{…}".to_owned(),
    }
}

fn list<'a>(message: &'a Value, name: &str) -> &'a [Value] {
    message.get(name).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

fn order_name(message: &Value) -> String {
    match value(message.get("orderId")).as_str() {
        "" => "no order".to_owned(),
        id => match value(message.get("orderUpdateId")).as_str() {
            "" => id.to_owned(),
            update => format!("{id} / {update}"),
        },
    }
}

/// `a, b, c +2`.
fn named(names: impl ExactSizeIterator<Item = String>) -> String {
    let total = names.len();
    let shown: Vec<String> = names.take(MEMBERS).collect();
    let more = if total > MEMBERS {
        format!(" +{}", total - MEMBERS)
    } else {
        String::new()
    };
    shown.join(", ") + &more
}

fn order(message: &Value) -> Vec<String> {
    let nodes = list(message, "nodes");
    let released = nodes
        .iter()
        .filter(|node| node.get("released") == Some(&Value::Bool(true)))
        .count();
    let horizon = nodes.len() - released;
    let ahead = if horizon > 0 {
        format!(", {horizon} in the horizon")
    } else {
        String::new()
    };
    vec![order_name(message), format!("{released} nodes released{ahead}")]
}

fn instant_actions(message: &Value) -> Vec<String> {
    // The member has had two names.
    let actions = [list(message, "actions"), list(message, "instantActions")];
    let actions = actions.into_iter().find(|list| !list.is_empty()).unwrap_or_default();
    vec![named(actions.iter().map(|action| value(action.get("actionType"))))]
}

fn state(message: &Value, before: Option<&Value>) -> Vec<String> {
    let flag = |name: &str, word: &str| {
        if message.get(name) == Some(&Value::Bool(true)) {
            word.to_owned()
        } else {
            String::new()
        }
    };
    let node = match value(message.get("lastNodeId")).as_str() {
        "" => String::new(),
        node => format!("at {node} ({})", value(message.get("lastNodeSequenceId"))),
    };
    let mode = match value(message.get("operatingMode")).as_str() {
        "AUTOMATIC" => String::new(),
        other => other.to_owned(),
    };
    let errors = list(message, "errors");
    let errors = match errors.len() {
        0 => String::new(),
        1 => format!("1 error: {}", value(errors[0].get("errorType"))),
        many => format!(
            "{many} errors: {}",
            named(errors.iter().map(|error| value(error.get("errorType"))))
        ),
    };
    vec![
        order_name(message),
        node,
        flag("driving", "driving"),
        flag("paused", "paused"),
        mode,
        errors,
        actions(message, before),
    ]
}

/// Actions whose status is not what it was in the state before.
fn actions(message: &Value, before: Option<&Value>) -> String {
    let status_before = |id: Option<&Value>| {
        let states = before.map(|before| list(before, "actionStates")).unwrap_or_default();
        states
            .iter()
            .find(|action| action.get("actionId") == id)
            .and_then(|action| action.get("actionStatus"))
    };
    let changed: Vec<String> = list(message, "actionStates")
        .iter()
        .filter(|action| status_before(action.get("actionId")) != action.get("actionStatus"))
        .map(|action| {
            let name = match value(action.get("actionType")).as_str() {
                "" => value(action.get("actionId")),
                name => name.to_owned(),
            };
            format!("{name} {}", value(action.get("actionStatus")))
        })
        .collect();
    named(changed.into_iter())
}

/// `#121 state (order-7 / 1 · at n3 (4))`, or only the number when the journal does not have it.
#[must_use]
pub fn reference(entry: Option<&Entry>, seq: u64) -> String {
    let Some(entry) = entry else { return format!("#{seq}") };
    match headline(entry, None) {
        text if text.is_empty() => format!("#{seq} {}", kind(entry)),
        text => format!("#{seq} {} ({text})", kind(entry)),
    }
}
