//! One message, judged by itself: what it breaks whatever came before and comes after.

use bytes::Bytes;

use super::header::header;
use tck_base::clock::{Moment, Stamp};
use tck_base::verdict::Verdict;
use tck_journal::event::{Direction, Event, Record, Source};
use tck_journal::{Entry, Payload};
use tck_judge::{Rules, TrafficJudge};
use tck_pack::Pack;
use tck_report::cause;
use tck_suite::model::Recordings;
use tck_view::Topic;

/// What is wrong with a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flaw {
    /// Every requirement that is broken by this.
    pub requirements: Vec<String>,
    /// Fail or warning.
    pub verdict: Verdict,
    /// Id of the monitor.
    pub monitor: String,
    /// One line.
    pub text: String,
    /// The ruling it rests on.
    pub interpretation: Option<String>,
}

/// Judges a message of a topic of this name by all monitors that need nothing else; the worst flaws come first.
#[must_use]
pub fn single(rules: &Rules, pack: &Pack, name: &str, payload: &Bytes) -> Vec<Flaw> {
    let Some(publisher) = pack.topic(name).map(|rule| rule.publisher) else {
        return Vec::new();
    };
    let event = Event::Message {
        topic: topic(name),
        qos: 0,
        retain: false,
        dup: false,
        payload: Payload::keep(payload.clone()),
    };
    let draft = record(
        1,
        Stamp {
            moment: Moment::START,
            utc: jiff::Timestamp::UNIX_EPOCH,
        },
        event,
    );
    let message = Entry::new(draft.clone());
    let view = message.view(Topic::of_name(name), pack.names());
    let said = view.map(|view| view.header().clone()).unwrap_or_default();
    // What its clock says cannot be held against anything.
    let at = Stamp {
        moment: Moment::START,
        utc: said.timestamp.or_empty().parse().unwrap_or_default(),
    };
    let names = pack.topics().iter().map(|rule| rule.name.as_str());
    let topics = names.map(|name| (name.to_owned(), topic(name))).collect();
    let (manufacturer, serial_number) = (said.manufacturer.or_empty(), said.serial_number.or_empty());
    let header = header(publisher, pack, manufacturer, serial_number, topics);
    let Ok(mut judge) = TrafficJudge::begin(rules, &header, &|monitor| monitor.recordings == Recordings::Message)
    else {
        return Vec::new();
    };
    let begun = Event::RunBegun {
        header: Box::new(header),
    };
    let mut found = judge.observe(&Entry::new(record(0, at, begun)));
    found.extend(judge.observe(&Entry::beside(&message, Record { at, ..draft })));
    let mut flaws: Vec<Flaw> = Vec::new();
    for observed in found {
        let finding = observed.finding;
        if !matches!(finding.verdict, Verdict::Fail | Verdict::Warning) {
            continue;
        }
        let place = cause::place(&finding.message);
        match flaws.iter_mut().find(|flaw| cause::place(&flaw.text) == place) {
            // One mistake breaks several requirements, and the worst of it is said.
            Some(flaw) => {
                let is_more = finding.message.len() > flaw.text.len();
                if finding.verdict > flaw.verdict || (finding.verdict == flaw.verdict && is_more) {
                    flaw.verdict = finding.verdict;
                    flaw.text = finding.message;
                    flaw.monitor = observed.monitor;
                    flaw.interpretation = finding.interpretation;
                }
                if !flaw.requirements.contains(&finding.requirement) {
                    flaw.requirements.push(finding.requirement);
                }
            }
            None => flaws.push(Flaw {
                requirements: vec![finding.requirement],
                verdict: finding.verdict,
                monitor: observed.monitor,
                text: finding.message,
                interpretation: finding.interpretation,
            }),
        }
    }
    flaws.sort_by_key(|flaw| std::cmp::Reverse(flaw.verdict));
    flaws
}

fn topic(name: &str) -> String {
    format!("interface/v2/manufacturer/serial/{name}")
}

fn record(seq: u64, at: Stamp, event: Event) -> Record {
    Record {
        seq,
        at,
        source: Source::Link,
        direction: Some(Direction::FromDevice),
        event,
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;

    fn flaws(name: &str, text: &str) -> Vec<(String, Verdict)> {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let found = single(&library.rules, pack, name, &Bytes::from(text.to_owned()));
        found
            .into_iter()
            .flat_map(|flaw| {
                let verdict = flaw.verdict;
                flaw.requirements.into_iter().map(move |id| (id, verdict))
            })
            .collect()
    }

    fn good(name: &str) -> String {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        std::fs::read_to_string(format!("{folder}/fixtures/messages/2.1/good/{name}.json")).expect("fixture")
    }

    #[test]
    fn every_built_in_monitor_says_whether_recordings_can_be_judged_by_it() {
        let monitors = &tck_testing::library().rules.suites.monitors;
        let silent: Vec<&str> = monitors
            .iter()
            .filter(|monitor| !monitor.source.text.contains("\nrecordings: "))
            .map(|monitor| monitor.id.as_str())
            .collect();
        assert!(monitors.len() > 100 && silent.is_empty(), "{silent:?}");
    }

    #[test]
    fn good_messages_have_no_flaw() {
        let folder = format!("{}/fixtures/messages", concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        let library = tck_testing::library();
        let mut seen = 0;
        for pack in library.rules.packs.all() {
            let version = format!("{}.{}", pack.version.major, pack.version.minor);
            for entry in std::fs::read_dir(format!("{folder}/{version}/good")).expect("folder") {
                let path = entry.expect("entry").path();
                let file = path.file_name().expect("name").to_string_lossy().into_owned();
                let name = pack
                    .topics()
                    .iter()
                    .map(|rule| rule.name.as_str())
                    .find(|name| file.starts_with(name));
                let text = Bytes::from(std::fs::read(&path).expect("message"));
                let found = single(&library.rules, pack, name.expect("topic"), &text);
                // Some of them have other digits in their times, which the schema allows.
                let more: Vec<&Flaw> = found.iter().filter(|flaw| flaw.requirements != ["HDR-03"]).collect();
                assert!(more.is_empty(), "{}: {more:?}", path.display());
                seen += 1;
            }
        }
        assert!(seen > 10);
    }

    /// Every member of a message, as a JSON pointer.
    fn members(value: &Value, pointer: &str, all: &mut Vec<String>) {
        match value {
            Value::Object(object) => {
                for (name, inner) in object {
                    let inside = format!("{pointer}/{name}");
                    members(inner, &inside, all);
                    all.push(inside);
                }
            }
            Value::Array(list) => {
                for (at, inner) in list.iter().enumerate().take(1) {
                    members(inner, &format!("{pointer}/{at}"), all);
                }
            }
            _ => {}
        }
    }

    /// What other members are held against: without it, more is wrong than itself.
    const HELD_AGAINST: [&str; 10] = [
        "/trajectory",
        "/actionParameters",
        "/errorReferences",
        "/maxArrayLens",
        "/maps",
        "/nodeStates",
        "/edgeStates",
        "/nodes",
        "/edges",
        "/actions",
    ];

    #[test]
    fn one_mistake_is_one_finding() {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let mut found = 0;
        for (topic, name) in [
            ("state", "state-driving"),
            ("order", "order-full"),
            ("instantActions", "instantActions-several"),
            ("connection", "connection-online"),
            ("factsheet", "factsheet-full"),
            ("visualization", "visualization-full"),
        ] {
            let whole: Value = serde_json::from_str(&good(name)).expect("JSON");
            let mut pointers = Vec::new();
            members(&whole, "", &mut pointers);
            let is_held_against = |pointer: &String| {
                let ends = |part: &&str| pointer.ends_with(*part) || pointer.contains(&format!("{part}/"));
                HELD_AGAINST[..5].iter().any(ends) || HELD_AGAINST[5..].iter().any(|part| pointer == part)
            };
            pointers.retain(|pointer| !is_held_against(pointer));
            for pointer in pointers {
                let (holder, member) = pointer.rsplit_once('/').expect("a member");
                let mut without = whole.clone();
                let inside = without.pointer_mut(holder).and_then(Value::as_object_mut);
                inside.expect("an object").shift_remove(member);
                let mut odd = whole.clone();
                if let Some(value) = odd.pointer_mut(&pointer) {
                    *value = if value.is_object() {
                        Value::from(7)
                    } else {
                        serde_json::json!({ "odd": 7 })
                    };
                }
                for broken in [without, odd] {
                    let text = Bytes::from(broken.to_string());
                    let flaws = single(&library.rules, pack, topic, &text);
                    let fails: Vec<&Flaw> = flaws.iter().filter(|flaw| flaw.verdict == Verdict::Fail).collect();
                    assert!(fails.len() < 2, "{topic}{pointer}: {fails:#?}");
                    found += fails.len();
                }
            }
        }
        assert!(found > 200, "{found}");
    }

    #[test]
    fn everything_that_is_missing_is_named() {
        let whole: Value = serde_json::from_str(&good("state-idle")).expect("JSON");
        let library = tck_testing::library();
        let names = [
            "version",
            "manufacturer",
            "orderUpdateId",
            "nodeStates",
            "edgeStates",
            "safetyState",
        ];
        let mut state = whole;
        for name in names {
            state.as_object_mut().expect("object").shift_remove(name);
        }
        let text = Bytes::from(state.to_string());
        let flaws = single(&library.rules, library.rules.packs.latest(), "state", &text);
        for name in names {
            let text = format!("state/{name}: `{name}` is missing");
            assert_eq!(
                flaws.iter().filter(|flaw| flaw.text == text).count(),
                1,
                "{name}: {flaws:#?}"
            );
        }
        // However much is wrong, nothing that is broken goes without a word.
        let mut order: Value = serde_json::from_str(&good("order-full")).expect("JSON");
        order["nodes"] = (0..200).map(|_| serde_json::json!({})).collect();
        order["orderId"] = 7.into();
        let text = Bytes::from(order.to_string());
        let flaws = single(&library.rules, library.rules.packs.latest(), "order", &text);
        assert!(
            flaws.iter().any(|flaw| flaw.text.starts_with("order/nodes/")),
            "{flaws:#?}"
        );
        assert!(
            flaws.iter().any(|flaw| flaw.text.starts_with("order/orderId: 7")),
            "{flaws:#?}"
        );
    }

    #[test]
    fn what_the_schema_cannot_say_is_found_in_a_message_alone() {
        let state = good("state-idle").replace(":30Z", ":30.00Z");
        let twice = state.replacen('{', "{\"driving\": false,", 1);
        assert_eq!(flaws("state", &twice), [("JSON-10".to_owned(), Verdict::Warning)]);
        let wrong: Vec<String> = flaws("state", &state.replace("AUTOMATIC", "AUTOMATISCH"))
            .into_iter()
            .map(|(id, _)| id)
            .collect();
        assert!(
            wrong.contains(&"JSON-02".to_owned()) && wrong.contains(&"MODE-01".to_owned()),
            "{wrong:?}"
        );
        let local = serde_json::from_str::<Value>(&state).map(|mut value| {
            value["timestamp"] = "2026-01-01T12:00:00+01:00".into();
            value.to_string()
        });
        let found = flaws("state", &local.expect("JSON"));
        assert!(
            found
                .iter()
                .any(|(id, verdict)| id == "HDR-03" && *verdict == Verdict::Fail),
            "{found:?}"
        );
        let order = serde_json::from_str::<Value>(&good("order-full")).map(|mut order| {
            order["edges"][0]["startNodeId"] = "nowhere".into();
            order.to_string()
        });
        assert!(!flaws("order", &order.expect("JSON")).is_empty());
        assert!(flaws("state", "{\"a\": NaN}").iter().any(|(id, _)| id == "JSON-08"));
        assert!(flaws("no-topic", "{}").is_empty());
    }
}
