//! Whether the device that speaks is the one that the profile names, and speaks the version that it names.

use super::presence::is_stale;
use tck_journal::Entry;
use tck_journal::event::{Event, Packet, Payload};
use tck_journal::json::Parsed;
use tck_judge::RunJudge;
use tck_pack::{FindingKind, Role, Version};
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

/// That the vehicle speaks a version whose messages have other members than those of the version that it is to be judged by: it
/// would be one mistake, found in every message. Its first live state shows it, by what it names and by what it lacks.
pub(super) fn other_version(judge: &RunJudge) -> Option<String> {
    let pack = &judge.ground().pack;
    if judge.role() != Role::Agv {
        return None;
    }
    let states = judge.timeline().of(Topic::State.as_str());
    let state = states.iter().find(|entry| !is_stale(entry))?;
    let message = state.json()?;
    let view = MessageView::of_value(Topic::Other, message, pack.names());
    let spoken = another_major(view.header().version.text()?, pack.version)?;
    let findings = pack.schema(Topic::State.as_str())?.findings(message);
    let lacks = findings.iter().any(|finding| finding.kind == FindingKind::Missing);
    lacks.then(|| {
        format!(
            "the device speaks VDA 5050 {spoken} (see #{}) and was to be judged by {}, whose messages have other members; \
             `migrate` says which",
            state.seq(),
            pack.version
        )
    })
}

/// The version that a header names, where it is of another major version.
fn another_major(said: &str, own: Version) -> Option<Version> {
    let spoken: Version = said.parse().ok()?;
    (spoken.major != own.major).then_some(spoken)
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
    let version = header.and_then(|header| another_major(header.version.text()?, ground.pack.version));
    let version = version.map_or_else(String::new, |spoken| {
        format!(
            "; it speaks VDA 5050 {spoken}, and was to be judged by {}",
            ground.pack.version
        )
    });
    format!(
        "a device speaks as {speaks} on {topic}; the profile says {manufacturer}/{serial}, who publishes on {expected}{version}"
    )
}
