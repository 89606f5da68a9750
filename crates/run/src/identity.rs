//! Whether the device that speaks is the one that the profile names.

use tck_journal::Entry;
use tck_journal::event::{Event, Packet, Payload};
use tck_journal::json::Parsed;
use tck_judge::RunJudge;
use tck_pack::Role;
use tck_view::{MessageView, Topic};

/// Who speaks instead of the device of the profile, as long as that one says nothing; only the tap can see it.
pub(super) fn somebody_else(judge: &RunJudge) -> Option<String> {
    let ground = judge.ground();
    if judge.role() != Role::Agv {
        return None;
    }
    let rules = ground.pack.topics().iter().filter(|rule| rule.publisher == Role::Agv);
    let names: Vec<&str> = rules.map(|rule| rule.name.as_str()).collect();
    let mut found = None;
    let timeline = judge.timeline();
    for entry in timeline.of("mqtt/connect").iter().chain(timeline.of("mqtt/publish")) {
        let Some((topic, payload)) = said(entry) else { continue };
        if ground.topics.values().any(|own| own == topic) {
            return None;
        }
        let levels: Vec<&str> = topic.split('/').collect();
        let [.., manufacturer, serial, name] = levels[..] else {
            continue;
        };
        let Some(name) = names.iter().find(|known| **known == name) else {
            continue;
        };
        if found.is_none() {
            found = Some(text(judge, topic, payload, (manufacturer, serial), name));
        }
    }
    found
}

/// Where an entry of the tap says something, and what: as last will, or as message.
fn said(entry: &Entry) -> Option<(&str, &Payload)> {
    let Event::Packet { packet, .. } = entry.event() else {
        return None;
    };
    match packet {
        Packet::Connect { will: Some(will), .. } => Some((&will.topic, &will.payload)),
        Packet::Publish { topic, payload, .. } => Some((topic, payload)),
        _ => None,
    }
}

fn text(judge: &RunJudge, topic: &str, payload: &Payload, levels: (&str, &str), name: &str) -> String {
    let ground = judge.ground();
    let parsed = Parsed::of(payload);
    let read = |value| MessageView::of_value(Topic::Other, value, ground.pack.names());
    let message = parsed.value().map(read);
    let header = message.as_ref().map(MessageView::header);
    let speaks = (
        header.and_then(|header| header.manufacturer.text()).unwrap_or(levels.0),
        header
            .and_then(|header| header.serial_number.text())
            .unwrap_or(levels.1),
    );
    let (manufacturer, serial) = &ground.identity;
    let expected = ground.topics.get(name).map_or("", String::as_str);
    let short = |text: &str| text.chars().take(200).collect::<String>();
    let (speaks, topic) = (short(&format!("{}/{}", speaks.0, speaks.1)), short(topic));
    format!(
        "a device speaks as {speaks} on {topic}; the profile says {manufacturer}/{serial}, who publishes on {expected}"
    )
}
