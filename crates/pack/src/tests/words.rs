//! What the packs say besides schemas: topics, features, vocabulary.

use serde_json::json;

use tck_view::{Field, ProtocolFeatures, SafetyState, StateView};

use super::super::{Pack, Role};
use super::packs;

#[test]
fn a_pack_is_found_by_any_patch_level() {
    let packs = packs();
    assert!(packs.all().len() >= 2);
    for pack in packs.all() {
        for version in [pack.id.clone(), pack.version.to_string(), format!("{}.7", pack.id)] {
            assert_eq!(packs.get(&version).expect("pack").id, pack.id);
        }
    }
    assert_eq!(packs.latest().id, packs.of_devices().last().expect("pack").id);
    assert!(packs.get("9.9").is_none() && packs.get("latest").is_none());
}

#[test]
fn topics_know_their_publisher_and_their_transport() {
    for pack in packs().all() {
        let names: Vec<_> = pack.topics().iter().map(|topic| topic.name.as_str()).collect();
        let expected = [
            "order",
            "instantActions",
            "state",
            "visualization",
            "connection",
            "factsheet",
        ];
        assert_eq!(names[..6], expected);
        let more: &[&str] = if pack.names().lacks(StateView::zone_requests) {
            &[]
        } else {
            &["zoneSet", "responses"]
        };
        assert_eq!(&names[6..], more, "{}", pack.id);
        for topic in pack.topics() {
            let name = topic.name.as_str();
            let commands = ["order", "instantActions", "zoneSet", "responses"].contains(&name);
            assert_eq!(
                topic.publisher,
                if commands { Role::MasterControl } else { Role::Agv },
                "{name}"
            );
            assert_eq!(topic.qos, u8::from(name == "connection"), "{name}");
            assert_eq!(topic.retain, ["connection", "factsheet"].contains(&name), "{name}");
            let optional = ["visualization", "zoneSet", "responses"].contains(&name);
            assert_eq!(topic.mandatory, !optional, "{name}");
        }
        assert!(pack.topic("instant_actions").is_none());
    }
}

#[test]
fn a_topic_template_is_filled_once() {
    let packs = packs();
    let pack = packs.latest();
    let major = pack.version.major;
    assert_eq!(
        pack.fill_topic(pack.topic_template(), "Maker", "0001", "state"),
        format!("uagv/v{major}/Maker/0001/state")
    );
    assert_eq!(
        pack.fill_topic("{x}/{manufacturer}/{topic", "{topic}", "0001", "state"),
        "{x}/{topic}/{topic"
    );
}

#[test]
fn the_vocabulary_has_a_word_for_every_topic_and_status() {
    for pack in packs().all() {
        for topic in pack.topics() {
            assert_eq!(pack.word(&format!("topic.{}", topic.name)), Some(topic.name.as_str()));
        }
        let name = |field: Field| pack.names().name(field).expect("a name");
        for (path, schema_path) in [
            ("connection", ("connection", &["connectionState"][..])),
            ("actionStatus", ("state", &["actionStates", "actionStatus"])),
            ("operatingMode", ("state", &["operatingMode"])),
            ("errorLevel", ("state", &["errors", "errorLevel"])),
            ("infoLevel", ("state", &["information", "infoLevel"])),
            (
                "emergencyStop",
                ("state", &["safetyState", name(SafetyState::emergency_stop)]),
            ),
            ("blockingType", ("order", &["nodes", "actions", "blockingType"])),
            ("orientationType", ("order", &["edges", "orientationType"])),
            (
                "scope",
                (
                    "factsheet",
                    &["protocolFeatures", name(ProtocolFeatures::actions), "actionScopes"],
                ),
            ),
        ] {
            let schema = pack.schema(schema_path.0).expect("schema");
            let shape = schema.shape(schema_path.1).expect("path");
            let mut allowed = shape.literals.unwrap_or_else(|| panic!("{path} is closed"));
            let words = pack.vocabulary()[path].as_object().expect("mapping");
            let mut said: Vec<_> = words
                .values()
                .map(|word| word.as_str().expect("word").to_owned())
                .collect();
            allowed.sort();
            said.sort();
            assert_eq!(said, allowed, "{} {path}", pack.id);
        }
        assert!(pack.word("error.outdatedUpdate").is_some() && pack.word("connection.broken").is_some());
        assert_eq!(pack.word("error.badContinuation"), None);
        assert!(pack.vocabulary()["error"]["badContinuation"].is_object());
        assert_eq!(pack.word("error.nonsense"), None);
    }
}

#[test]
fn predefined_actions_use_the_words_of_their_version() {
    let declared = |pack: &Pack, path: &[&str]| -> Vec<String> {
        let words = pack
            .vocabulary()
            .pointer(&format!("/{}", path.join("/")))
            .expect("path");
        words
            .as_object()
            .expect("mapping")
            .values()
            .filter_map(|word| Some(word.as_str()?.to_owned()))
            .collect()
    };
    for pack in packs().all() {
        let (scopes, statuses) = (declared(pack, &["scope"]), declared(pack, &["actionStatus"]));
        let actions = pack.vocabulary()["action"].as_object().expect("actions");
        assert_eq!(actions.contains_key("downloadMap"), pack.has("mapActions"));
        assert!(actions.contains_key("cancelOrder") && actions.len() >= 14);
        for (name, action) in actions {
            let texts = |key: &str| -> Vec<String> {
                let list = action[key].as_array().unwrap_or_else(|| panic!("{name} {key}"));
                list.iter()
                    .map(|item| item.as_str().expect("text").to_owned())
                    .collect()
            };
            assert!(texts("scopes").iter().all(|scope| scopes.contains(scope)), "{name}");
            assert!(
                texts("statuses").iter().all(|status| statuses.contains(status)),
                "{name}"
            );
            assert!(action["parameters"].is_object(), "{name}");
            if let Some(counter) = action["counter"].as_str() {
                assert_eq!(actions[counter]["counter"], json!(name));
            }
            for path in action["linked"].as_array().into_iter().flatten() {
                let path: Vec<_> = path.as_str().expect("path").split('.').collect();
                assert!(
                    pack.schema("state").expect("state").shape(&path).is_some(),
                    "{name} {path:?}"
                );
            }
        }
        for (from, to) in pack.vocabulary()["transition"]["legal"].as_object().expect("mapping") {
            assert!(from == "START" || statuses.contains(from), "{from}");
            for status in to.as_array().expect("list") {
                assert!(statuses.contains(&status.as_str().expect("text").to_owned()));
            }
        }
    }
}

#[test]
fn predefined_errors_have_a_level_and_are_words_of_the_version() {
    for pack in packs().all() {
        let levels = pack.vocabulary()["errorLevel"].as_object().expect("levels");
        let words = pack.vocabulary()["error"].as_object().expect("errors");
        let Some(errors) = pack.vocabulary().get("predefinedError") else {
            continue;
        };
        let errors = errors.as_object().expect("errors");
        assert_eq!(errors.len(), words.values().filter(|word| word.is_string()).count());
        for (name, error) in errors {
            assert!(words.values().any(|word| word == name.as_str()), "{name}");
            assert!(levels.values().any(|level| *level == error["level"]), "{name}");
            assert!(error["references"].is_array() && error["until"].is_string(), "{name}");
        }
    }
}
