//! The schemas of the packs: good messages pass, single mistakes are found where they are.

use serde_json::{Value, json};

use super::FindingKind::Type;
use super::schema::obeys_meta_schema;
use super::{Assets, FindingKind, Pack, Packs, Role};

mod breakages;
mod disputed;
mod mistakes;
mod words;

use mistakes::mistakes;

fn packs() -> Packs {
    Packs::load(&Assets::of_source_tree().unwrap()).unwrap_or_else(|error| panic!("{error}"))
}

/// The good messages of a pack by file name; the topic is the name up to the first hyphen.
fn good_messages(pack: &Pack) -> Vec<(String, String, Value)> {
    let folder = format!(
        "{}/fixtures/messages/{}/good",
        concat!(env!("CARGO_MANIFEST_DIR"), "/../.."),
        pack.id
    );
    let mut messages: Vec<_> = std::fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("{folder}: {error}"))
        .map(|entry| {
            let path = entry.expect("entry").path();
            let name = path.file_stem().expect("name").to_string_lossy().into_owned();
            let topic = name.split('-').next().unwrap_or_default().to_owned();
            let text = std::fs::read_to_string(&path).expect("text");
            (name, topic, serde_json::from_str(&text).expect("JSON"))
        })
        .collect();
    messages.sort_by(|a, b| a.0.cmp(&b.0));
    messages
}

fn good(pack: &Pack, name: &str) -> Value {
    let found = good_messages(pack).into_iter().find(|message| message.0 == name);
    found.unwrap_or_else(|| panic!("no {name} for {}", pack.id)).2
}

fn findings(pack: &Pack, topic: &str, message: &Value) -> Vec<(String, FindingKind)> {
    let schema = pack.schema(topic).expect("schema");
    let found = schema.findings(message);
    found.into_iter().map(|finding| (finding.path, finding.kind)).collect()
}

#[test]
fn every_schema_obeys_the_meta_schema() {
    for pack in packs().all() {
        assert!(pack.topics().len() >= 6);
        for topic in pack.topics() {
            let raw = pack.schema(topic.name.as_str()).expect("schema").raw();
            assert!(obeys_meta_schema(raw), "{} {}", pack.id, topic.name);
        }
    }
}

#[test]
fn good_messages_of_every_topic_pass() {
    for pack in packs().all() {
        let messages = good_messages(pack);
        for topic in pack.topics() {
            let count = messages
                .iter()
                .filter(|message| message.1 == topic.name.as_str())
                .count();
            assert!(count >= 2, "{} {}", pack.id, topic.name);
        }
        for (name, topic, message) in messages {
            assert_eq!(findings(pack, &topic, &message), [], "{} {name}", pack.id);
        }
    }
}

/// Applies a mistake; `false` if the message has no such place.
fn spoil(message: &mut Value, place: &str, value: Option<Value>) -> bool {
    if message.pointer(place).is_none() {
        return false;
    }
    let (parent, name) = place.rsplit_once('/').expect("pointer");
    let parent = message.pointer_mut(parent).expect("parent");
    match (parent, value) {
        (Value::Object(members), Some(value)) => {
            members.insert(name.to_owned(), value);
        }
        (Value::Object(members), None) => {
            members.shift_remove(name);
        }
        (Value::Array(items), Some(value)) => items[name.parse::<usize>().expect("index")] = value,
        _ => return false,
    }
    true
}

#[test]
fn a_single_mistake_is_found_where_it_is() {
    let packs = packs();
    let latest = packs.latest();
    assert!(mistakes().len() >= 100);
    for pack in packs.of_devices() {
        let mut absent = 0;
        for (name, place, value, kind) in mistakes() {
            let mut message = good(pack, name);
            if !spoil(&mut message, place, value.clone()) {
                absent += 1;
                continue;
            }
            let topic = name.split('-').next().expect("topic");
            let found = findings(pack, topic, &message);
            assert_eq!(
                found,
                [(place.to_owned(), kind)],
                "{} {name} {place} {value:?}",
                pack.id
            );
        }
        // Corridors, maps, blocking types and vehicle configuration came with the newest of them.
        assert_eq!(absent, if pack.id == latest.id { 0 } else { 7 }, "{}", pack.id);
    }
}

#[test]
fn a_message_that_is_no_object_is_found_as_a_whole() {
    for pack in packs().all() {
        for topic in pack.topics() {
            for message in [json!(null), json!([]), json!("x"), json!(1)] {
                assert_eq!(findings(pack, topic.name.as_str(), &message), [(String::new(), Type)]);
            }
        }
    }
}

#[test]
fn extension_fields_pass_everywhere() {
    fn extend(value: &mut Value) {
        match value {
            Value::Object(members) => {
                members.values_mut().for_each(extend);
                members.insert("vendorField".to_owned(), json!({ "any": [1, null] }));
            }
            Value::Array(items) => items.iter_mut().for_each(extend),
            _ => {}
        }
    }
    for pack in packs().all() {
        for (name, topic, mut message) in good_messages(pack) {
            extend(&mut message);
            assert_eq!(findings(pack, &topic, &message), [], "{} {name}", pack.id);
        }
    }
}

#[test]
fn what_is_only_worth_a_warning_is_no_finding() {
    for pack in packs().of_devices() {
        for (name, place, value) in [
            ("state-driving", "/batteryState/batteryCharge", Some(json!(130))),
            ("state-driving", "/actionStates/0/actionStatus", Some(json!("PAUSED"))),
            (
                "state-driving",
                "/agvPosition/theta",
                Some(json!(std::f64::consts::PI + 5e-10)),
            ),
            ("state-driving", "/headerId", Some(json!(5.0))),
            ("order-full", "/orderId", Some(json!(""))),
            ("order-full", "/nodes", Some(json!([]))),
            ("order-full", "/edges/0/orientation", Some(json!(10))),
            ("order-full", "/edges/0/trajectory/degree", None),
            ("order-full", "/edges/0/trajectory/knotVector", Some(json!([1, 0]))),
            (
                "order-full",
                "/timestamp",
                Some(json!("2026-03-02T08:15:30.123456789Z")),
            ),
            ("factsheet-full", "/physicalParameters/heightMin", None),
            (
                "factsheet-full",
                "/typeSpecification/localizationTypes",
                Some(json!(["VENDOR"])),
            ),
            (
                "factsheet-full",
                "/typeSpecification/navigationTypes",
                Some(json!(["VENDOR"])),
            ),
        ] {
            let mut message = good(pack, name);
            assert!(spoil(&mut message, place, value));
            let topic = name.split('-').next().expect("topic");
            assert_eq!(findings(pack, topic, &message), [], "{} {name} {place}", pack.id);
        }
    }
}

#[test]
fn only_older_versions_leave_the_value_of_an_action_parameter_open() {
    for pack in packs().all() {
        let mut message = good(pack, "order-full");
        assert!(spoil(
            &mut message,
            "/nodes/1/actions/0/actionParameters/0/value",
            Some(json!(null))
        ));
        assert_eq!(
            findings(pack, "order", &message).is_empty(),
            !pack.has("actionParameterObjects")
        );
    }
}

#[test]
fn shapes_tell_what_a_path_may_hold() {
    for pack in packs().of_devices() {
        let state = pack.schema("state").expect("state");
        let level = state.shape(&["errors", "errorLevel"]).expect("path");
        assert_eq!(level.literals, Some(vec!["WARNING".to_owned(), "FATAL".to_owned()]));
        assert!(level.required && !level.open && level.kinds == ["string"]);
        let nodes = state.shape(&["nodeStates"]).expect("path");
        assert!(nodes.array && nodes.required && nodes.kinds == ["array"]);
        let status = state.shape(&["actionStates", "actionStatus"]).expect("path");
        assert!(status.literals.expect("words").contains(&"PAUSED".to_owned()));
        let x = state.shape(&["agvPosition", "x"]).expect("path");
        assert!(x.required && x.kinds == ["number"] && x.literals.is_none());
        assert_eq!(state.shape(&["headerId"]).expect("path").kinds, ["integer"]);
        assert!(!state.shape(&["agvPosition"]).expect("path").required);
        assert_eq!(state.shape(&["errors", "errorLevle"]), None);
        assert_eq!(state.shape(&["errors", "errorHint"]).is_some(), pack.has("errorHint"));
        assert!(state.members(&["errors"]).contains(&"errorReferences".to_owned()));

        for topic in ["order", "instantActions"] {
            let path: &[&str] = match topic {
                "order" => &["nodes", "actions", "actionParameters", "value"],
                _ => &["actions", "actionParameters", "value"],
            };
            let schema = pack.schema(topic).expect("schema");
            assert!(schema.shape(path).expect("path").open, "{topic}");
            let deeper: Vec<_> = path.iter().copied().chain(["any", "thing"]).collect();
            assert!(schema.shape(&deeper).is_some());
        }
        let factsheet = pack.schema("factsheet").expect("factsheet");
        assert!(
            factsheet
                .shape(&["protocolLimits", "maxArrayLens", "order.nodes"])
                .is_some()
        );
        assert!(factsheet.shape(&["agvGeometry"]).expect("path").required);
    }
}

mod hostile {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn no_spoilt_message_makes_a_schema_panic(which in 0_usize..1000, what in 0_usize..8) {
            let packs = packs_once();
            let odd = [json!(null), json!([]), json!({}), json!(-1e308), json!(u64::MAX), json!(""), json!([[[]]]), json!({"":{"~/":0}})];
            for pack in packs.all() {
                for topic in pack.topics() {
                    let name = format!("{}-", topic.name);
                    let messages = good_messages(pack);
                    let Some((_, _, message)) = messages.into_iter().rev().find(|message| message.0.starts_with(&name)) else {
                        continue;
                    };
                    let mut places = Vec::new();
                    collect(&message, String::new(), &mut places);
                    let mut spoilt = message.clone();
                    *spoilt.pointer_mut(&places[which % places.len()]).expect("place") = odd[what].clone();
                    let _ = pack.schema(topic.name.as_str()).expect("schema").findings(&spoilt);
                }
            }
        }
    }

    fn packs_once() -> &'static Packs {
        static PACKS: std::sync::OnceLock<Packs> = std::sync::OnceLock::new();
        PACKS.get_or_init(packs)
    }

    fn collect(value: &Value, place: String, places: &mut Vec<String>) {
        match value {
            Value::Object(members) => {
                for (name, member) in members {
                    collect(member, format!("{place}/{name}"), places);
                }
            }
            Value::Array(items) => {
                for (at, item) in items.iter().enumerate() {
                    collect(item, format!("{place}/{at}"), places);
                }
            }
            _ => {}
        }
        places.push(place);
    }
}

#[test]
fn only_the_newest_versions_may_be_for_messages_alone() {
    let packs = packs();
    let last = packs.all().last().expect("a pack");
    assert!(packs.latest().judges_devices() && packs.of_devices().count() >= 2);
    for (pack, role) in packs
        .all()
        .iter()
        .flat_map(|pack| [(pack, Role::Agv), (pack, Role::MasterControl)])
    {
        let found = packs.for_devices(&pack.id, role);
        assert_eq!(found.is_ok(), pack.judges(role));
        assert!(
            pack.judges_devices() || pack.id == last.id,
            "{} has newer ones",
            pack.id
        );
        if let Err(none) = found {
            let code = if pack.judges(Role::Agv) {
                "other-side-only"
            } else {
                "messages-only"
            };
            assert_eq!(none.code(), code);
            let (said, hint) = (none.to_string(), none.hint());
            assert!(said.contains(&pack.version.to_string()) && hint.contains(&packs.latest().version.to_string()));
        }
    }
    assert_eq!(
        packs.for_devices("9.9", Role::Agv).expect_err("none").code(),
        "unknown-version"
    );
}

#[test]
fn a_side_that_a_version_does_not_judge_is_refused_by_its_own_sentence() {
    let files = Assets::of_source_tree().unwrap();
    let latest = packs().all().last().expect("a version").version;
    let (latest, rules) = (
        latest.to_string(),
        format!("{}.{}/protocol.toml", latest.major, latest.minor),
    );
    let of_schemas = files.under("schemas/").map(|file| {
        let mut file = file.clone();
        if file.path.ends_with(&rules) {
            file.text = file.text.replace(", \"master-control\"]", "]");
        }
        file
    });
    let packs = Packs::load(&Assets::built_in(of_schemas)).unwrap_or_else(|error| panic!("{error}"));
    assert!(packs.for_devices(&latest, Role::Agv).is_ok());
    let none = packs
        .for_devices(&latest, Role::MasterControl)
        .expect_err("messages and vehicles only");
    assert_eq!(none.code(), "other-side-only");
}

#[test]
fn good_messages_are_read_by_the_names_of_their_version() {
    use tck_view::{MessageView, StateView, Topic};

    for pack in packs().all() {
        assert_eq!(pack.names().lacks(StateView::maps), !pack.has("maps"), "{}", pack.id);
        for (name, topic, message) in good_messages(pack) {
            let view = MessageView::of_value(Topic::of_name(&topic), &message, pack.names());
            let header = view.header();
            assert!(header.header_id.whole().is_some(), "{} {name}", pack.id);
            assert!(header.serial_number.text().is_some(), "{} {name}", pack.id);
            assert!(!format!("{view:?}").contains("Other("), "{} {name}: {view:?}", pack.id);
        }
    }
}
