//! What is allowed in a message and yet worth a word: a member or an action that is nearly one of the protocol, members that
//! lie inside another one, and which reading a device keeps to where the published text and schemas contradict each other.
//! Nothing of it is a mistake by itself.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use tck_pack::{MessageSchema, Pack, Packs};

/// How deep a message is entered.
const DEPTH: usize = 12;
/// How many hints one message is worth.
const MOST: usize = 16;
/// A longer name is none of a person.
const LONGEST: usize = 64;
/// Of so many members that are missing at least, it is asked whether they lie elsewhere.
const WRAPPED: usize = 2;

/// Something that looks like a slip, or is a matter of reading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hint {
    /// Where it stands, as a JSON pointer.
    pub pointer: String,
    /// One line.
    pub text: String,
}

/// What the protocol knows of messages, to compare names with.
#[derive(Debug, Default)]
pub struct Hints {
    /// By version and topic.
    topics: BTreeMap<(String, String), Members>,
    /// Names of actions by version.
    actions: BTreeMap<String, Vec<String>>,
}

/// Members of an object.
#[derive(Debug, Default)]
struct Members {
    inside: BTreeMap<String, Members>,
    required: Vec<String>,
    /// Whether any member may stand there.
    open: bool,
}

impl Members {
    fn of(schema: &MessageSchema, path: &mut Vec<String>) -> Self {
        let of = |path: &[String]| schema.shape(&path.iter().map(String::as_str).collect::<Vec<_>>());
        let open = of(path).is_none_or(|shape| shape.open);
        let mut members = Self {
            open,
            ..Self::default()
        };
        if open || path.len() >= DEPTH {
            return members;
        }
        for name in schema.members(&path.iter().map(String::as_str).collect::<Vec<_>>()) {
            path.push(name.clone());
            if of(path).is_some_and(|shape| shape.required) {
                members.required.push(name.clone());
            }
            let inside = Self::of(schema, path);
            path.pop();
            members.inside.insert(name, inside);
        }
        members
    }
}

/// Whether one name is the other but for a slip of the hand.
fn is_slip(one: &str, other: &str) -> bool {
    one != other && one.len() <= LONGEST && strsim::osa_distance(one, other) <= (other.len() / 4).min(2)
}

impl Hints {
    /// Of all versions.
    #[must_use]
    pub fn of(packs: &Packs) -> Self {
        let mut known = Self::default();
        for pack in packs.all() {
            let actions = pack.vocabulary().get("action").and_then(Value::as_object);
            let names = actions.into_iter().flatten().map(|(name, _)| name.clone());
            known.actions.insert(pack.id.clone(), names.collect());
            for rule in pack.topics() {
                if let Some(schema) = pack.schema(rule.name.as_str()) {
                    let key = (pack.id.clone(), rule.name.as_str().to_owned());
                    known.topics.insert(key, Members::of(schema, &mut Vec::new()));
                }
            }
        }
        known
    }

    /// What looks like a slip in a message of this topic.
    #[must_use]
    pub fn of_message(&self, pack: &Pack, topic: &str, message: &Value) -> Vec<Hint> {
        let Some(members) = self.topics.get(&(pack.id.clone(), topic.to_owned())) else {
            return Vec::new();
        };
        let mut search = Search {
            actions: self.actions.get(&pack.id).map(Vec::as_slice).unwrap_or_default(),
            pointer: String::new(),
            found: Vec::new(),
        };
        search.wrapped(members, topic, message);
        search.value(members, message, 0);
        let kept = pack
            .schema(topic)
            .map(|schema| schema.readings(message))
            .unwrap_or_default();
        search.found.extend(kept.into_iter().map(|kept| Hint {
            text: format!("disputed, and right: {}, as in {}", kept.keeps, kept.source),
            pointer: kept.pointer,
        }));
        search.found
    }
}

struct Search<'k> {
    actions: &'k [String],
    pointer: String,
    found: Vec<Hint>,
}

impl Search<'_> {
    fn tell(&mut self, name: &str, text: String) {
        if self.found.len() < MOST {
            let name = name.replace('~', "~0").replace('/', "~1");
            let pointer = format!("{}/{name}", self.pointer);
            self.found.push(Hint { pointer, text });
        }
    }

    /// What belongs into the message itself may lie inside one of its members.
    fn wrapped(&mut self, members: &Members, topic: &str, message: &Value) {
        let Some(object) = message.as_object() else { return };
        let missing = members.required.iter().filter(|name| !object.contains_key(*name));
        let missing: Vec<&String> = missing.collect();
        let holds = |inner: &Map<String, Value>| missing.iter().filter(|name| inner.contains_key(**name)).count();
        let wrapping = object.iter().find(|(name, inner)| {
            let inside = inner.as_object().map_or(0, holds);
            !members.inside.contains_key(*name) && inside >= WRAPPED && inside * 2 >= missing.len()
        });
        if let Some((name, _)) = wrapping {
            let shown = shown(name);
            self.tell(
                name,
                format!("members of the {topic} lie inside `{shown}`, and belong beside it"),
            );
        }
    }

    fn value(&mut self, members: &Members, value: &Value, depth: usize) {
        if members.open || depth > DEPTH {
            return;
        }
        match value {
            Value::Array(all) => {
                for (at, one) in all.iter().enumerate() {
                    self.enter(&at.to_string(), |inside| inside.value(members, one, depth + 1));
                }
            }
            Value::Object(object) => self.object(members, object, depth),
            _ => {}
        }
    }

    fn object(&mut self, members: &Members, object: &Map<String, Value>, depth: usize) {
        for (name, value) in object {
            if let Some(inside) = members.inside.get(name) {
                if name == "actionType" {
                    self.action(value);
                }
                self.enter(name, |search| search.value(inside, value, depth + 1));
                continue;
            }
            // What is missing, or written with other letters, is a mistake, and named as one.
            let meant = members.inside.keys().find(|known| {
                is_slip(name, known)
                    && !object.contains_key(*known)
                    && !members.required.contains(known)
                    && plain(name) != plain(known)
            });
            if let Some(meant) = meant {
                let shown = shown(name);
                self.tell(
                    name,
                    format!("`{shown}` is no member of the protocol: did you mean `{meant}`?"),
                );
            }
        }
    }

    fn action(&mut self, kind: &Value) {
        let Some(kind) = kind.as_str() else { return };
        if self.actions.iter().any(|known| known == kind) {
            return;
        }
        let same = |known: &&String| plain(known) == plain(kind);
        let meant = self.actions.iter().find(same);
        let meant = meant.or_else(|| self.actions.iter().find(|known| is_slip(kind, known)));
        if let Some(meant) = meant {
            let shown = shown(kind);
            self.tell(
                "actionType",
                format!("`{shown}` is no action of the protocol: did you mean `{meant}`?"),
            );
        }
    }

    fn enter(&mut self, name: &str, inside: impl FnOnce(&mut Self)) {
        let before = self.pointer.len();
        self.pointer.push('/');
        self.pointer.push_str(&name.replace('~', "~0").replace('/', "~1"));
        inside(self);
        self.pointer.truncate(before);
    }
}

/// A name without what people vary: case, underscores, hyphens.
fn plain(name: &str) -> String {
    let letters = name.chars().filter(char::is_ascii_alphanumeric);
    letters.map(|letter| letter.to_ascii_lowercase()).collect()
}

fn shown(name: &str) -> String {
    name.chars()
        .take(LONGEST)
        .collect::<String>()
        .escape_debug()
        .to_string()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn texts(topic: &str, message: &Value) -> Vec<String> {
        let packs = &tck_testing::library().rules.packs;
        let found = Hints::of(packs).of_message(packs.latest(), topic, message);
        found
            .into_iter()
            .map(|hint| format!("{} {}", hint.pointer, hint.text))
            .collect()
    }

    fn good(name: &str) -> Value {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let text = std::fs::read_to_string(format!("{folder}/fixtures/messages/2.1/good/{name}.json"));
        serde_json::from_str(&text.expect("fixture")).expect("JSON")
    }

    #[test]
    fn slips_that_are_allowed_are_named_with_what_was_meant() {
        let actions = json!({ "actions": [{ "actionId": "0", "actionType": "canceOrder", "blockingType": "HARD" },
            { "actionId": "1", "actionType": "START_PAUSE", "blockingType": "HARD" }] });
        assert_eq!(
            texts("instantActions", &actions),
            [
                "/actions/0/actionType `canceOrder` is no action of the protocol: did you mean `cancelOrder`?",
                "/actions/1/actionType `START_PAUSE` is no action of the protocol: did you mean `startPause`?",
            ]
        );
        let mut state = good("state-idle");
        state.as_object_mut().expect("object").remove("information");
        state["batteryState"]
            .as_object_mut()
            .expect("object")
            .remove("batteryVoltage");
        state["informations"] = json!([]);
        state["batteryState"]["batteryVoltag"] = json!(48.0);
        assert_eq!(
            texts("state", &state),
            [
                "/batteryState/batteryVoltag `batteryVoltag` is no member of the protocol: did you mean `batteryVoltage`?",
                "/informations `informations` is no member of the protocol: did you mean `information`?",
            ]
        );
        let factsheet = json!({ "protocolFeatures": { "agvActions": [
            { "actionType": "pick", "actionScopes": ["NODE"], "blockingType": ["HARD"] }] } });
        assert_eq!(
            texts("factsheet", &factsheet),
            [
                "/protocolFeatures/agvActions/0/blockingType `blockingType` is no member of the protocol: did you mean \
              `blockingTypes`?"
            ]
        );
    }

    #[test]
    fn members_that_lie_inside_another_one_are_named() {
        let wrapped = json!({ "headerId": 1, "factsheet": good("factsheet-full") });
        assert_eq!(
            texts("factsheet", &wrapped),
            ["/factsheet members of the factsheet lie inside `factsheet`, and belong beside it"]
        );
    }

    #[test]
    fn what_a_maker_adds_and_what_is_right_is_no_slip() {
        for (topic, name) in [
            ("state", "state-idle"),
            ("order", "order-full"),
            ("factsheet", "factsheet-full"),
        ] {
            let mut message = good(name);
            message["vendorExtra"] = json!({ "Driving": 1, "errors": [] });
            message["headerIds"] = json!([1]);
            assert!(texts(topic, &message).is_empty(), "{:?}", texts(topic, &message));
        }
    }

    #[test]
    fn a_message_gives_only_so_many() {
        let actions = vec![json!({ "actionType": "canceOrder" }); 500];
        assert_eq!(texts("instantActions", &json!({ "actions": actions })).len(), MOST);
        let mut deep = json!({ "informations": 1 });
        for _ in 0..100 {
            deep = json!({ "nodePosition": deep });
        }
        assert!(texts("state", &json!({ "nodeStates": [deep] })).is_empty());
    }
}
