//! A record in a few words: its topic and what an engineer looks for first.
//!
//! Only for people; nothing is decided by it. Every value may come from a device and is cleaned and bounded
//! here.

use super::clean::{line, short};
use tck_journal::{Entry, Event, Journal, Packet};
use tck_view::{
    ActionState, InstantActionsView, Json, Member, MessageView, Names, Number, OrderView, StateView, Text, Topic,
};

/// Longest single value in a headline, in characters.
const VALUE: usize = 36;
/// Most list members named in a headline.
const MEMBERS: usize = 3;

/// The last level of the topic of a message, such as `state`.
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

/// What kind of record it is, in one word or two, such as `state`, `CONNECT` or `link`.
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

/// A record as a message of the topic it was seen on.
#[must_use]
pub fn view<'e>(entry: &'e Entry, names: &Names) -> Option<&'e MessageView> {
    let topic = topic(entry)?;
    entry.view(Topic::of_name(&topic), names)
}

/// What a message says, in a few words; `before` is the state before it, so that only what changed among the actions is
/// named.
#[must_use]
pub fn headline(entry: &Entry, before: Option<&StateView>, names: &Names) -> String {
    let Some(payload) = entry.payload() else {
        return String::new();
    };
    let Some(message) = view(entry, names) else {
        let problem = entry
            .parsed()
            .and_then(|parsed| parsed.problems().first().map(ToString::to_string));
        let problem = problem.unwrap_or_else(|| "not JSON".to_owned());
        return short(&line(&format!("{} bytes: {problem}", payload.len())), 90).into_owned();
    };
    let parts = match message {
        MessageView::Order(message) => order(message),
        MessageView::InstantActions(message) => instant_actions(message),
        MessageView::State(message) => state(message, before),
        MessageView::Connection(message) => vec![text(&message.connection_state)],
        MessageView::Visualization(_) => vec!["position and velocity".to_owned()],
        MessageView::Factsheet(message) => {
            let kind = message.type_specification.there();
            vec![kind.map_or_else(String::new, |kind| text(&kind.series_name))]
        }
        _ => vec![format!("{} bytes", payload.len())],
    };
    parts
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" · ")
}

/// A text as it stands there; nothing for `null` and for what is absent.
fn text(member: &Member<Text>) -> String {
    member
        .text()
        .map_or_else(|| odd(member.other()), |text| short(&line(text), VALUE).into_owned())
}

/// A number as it stands there.
fn number(member: &Member<Number>) -> String {
    let number = member.number();
    number.map_or_else(
        || odd(member.other()),
        |number| short(&number.to_string(), VALUE).into_owned(),
    )
}

/// What stands there instead of what should.
fn odd(value: Option<&Json>) -> String {
    match value {
        None | Some(Json::Null) => String::new(),
        Some(Json::Text(text)) => short(&line(text), VALUE).into_owned(),
        Some(other @ (Json::Flag(_) | Json::Number(_))) => short(&other.to_string(), VALUE).into_owned(),
        Some(Json::List(_)) => "[…]".to_owned(),
        Some(Json::Object(_)) => "{…}".to_owned(),
    }
}

fn order_name(order_id: &Member<Text>, update: &Member<Number>) -> String {
    match text(order_id).as_str() {
        "" => "no order".to_owned(),
        id => match number(update).as_str() {
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

fn order(message: &OrderView) -> Vec<String> {
    let released = message.nodes.iter().filter(|node| node.released.is(true)).count();
    let horizon = message.nodes.total() - released;
    let ahead = if horizon > 0 {
        format!(", {horizon} in the horizon")
    } else {
        String::new()
    };
    vec![
        order_name(&message.order_id, &message.order_update_id),
        format!("{released} nodes released{ahead}"),
    ]
}

fn instant_actions(message: &InstantActionsView) -> Vec<String> {
    let lists = [&message.actions, &message.misnamed_actions];
    let actions = lists.into_iter().find(|list| !list.is_empty());
    let actions = actions.map_or(&[][..], Member::elements);
    vec![named(actions.iter().map(|action| text(&action.action_type)))]
}

fn state(message: &StateView, before: Option<&StateView>) -> Vec<String> {
    let flag = |member: &Member<bool>, word: &str| {
        if member.is(true) {
            word.to_owned()
        } else {
            String::new()
        }
    };
    let node = match text(&message.last_node_id).as_str() {
        "" => String::new(),
        node => format!("at {node} ({})", number(&message.last_node_sequence_id)),
    };
    let mode = match text(&message.operating_mode).as_str() {
        "AUTOMATIC" => String::new(),
        other => other.to_owned(),
    };
    let kinds = message.errors.iter().map(|error| text(&error.error_type));
    let errors = match message.errors.total() {
        0 => String::new(),
        1 => format!("1 error: {}", named(kinds)),
        many => format!("{many} errors: {}", named(kinds)),
    };
    vec![
        order_name(&message.order_id, &message.order_update_id),
        node,
        flag(&message.driving, "driving"),
        flag(&message.paused, "paused"),
        mode,
        errors,
        actions(message, before),
    ]
}

/// Actions whose status is not what it was in the state before.
fn actions(message: &StateView, before: Option<&StateView>) -> String {
    let is_new = |action: &&ActionState| {
        let mut known = before.into_iter().flat_map(StateView::all_action_states);
        let known = known.find(|known| known.action_id == action.action_id);
        known.map_or(!action.action_status.is_absent(), |known| {
            known.action_status != action.action_status
        })
    };
    let changed: Vec<String> = message
        .all_action_states()
        .filter(is_new)
        .map(|action| {
            let name = match text(&action.action_type).as_str() {
                "" => text(&action.action_id),
                name => name.to_owned(),
            };
            format!("{name} {}", text(&action.action_status))
        })
        .collect();
    named(changed.into_iter())
}

/// `#121 state (order-7 / 1 · at n3 (4))`, or only the number when the journal does not have it.
#[must_use]
pub fn reference(journal: Option<&Journal>, seq: u64) -> String {
    let Some((journal, entry)) = journal.and_then(|journal| Some((journal, journal.get(seq)?))) else {
        return format!("#{seq}");
    };
    match headline(&entry, None, journal.names()) {
        text if text.is_empty() => format!("#{seq} {}", kind(&entry)),
        text => format!("#{seq} {} ({text})", kind(&entry)),
    }
}
