//! Recordings without what only their owner should know: names of makers, vehicles, maps, nodes, orders and loads, free texts, and
//! where on the floor something is. What is equal stays equal, so nearly everything is judged as before.

use std::collections::HashMap;

use serde_json::{Map, Value};

use super::topics::Topics;
use super::{AuditError, Options};
use tck_capture::Message;
use tck_judge::Rules;

/// How deep a message is entered; what is deeper is left out.
const DEPTH: usize = 64;

/// Members that hold a name, and what it is the name of.
const NAMES: [(&str, &str); 24] = [
    ("manufacturer", "maker"),
    ("serialNumber", "vehicle"),
    ("orderId", "order"),
    ("nodeId", "node"),
    ("startNodeId", "node"),
    ("endNodeId", "node"),
    ("lastNodeId", "node"),
    ("edgeId", "edge"),
    ("actionId", "action"),
    ("mapId", "map"),
    ("zoneSetId", "zones"),
    ("zoneId", "zone"),
    ("loadId", "load"),
    ("loadPosition", "place"),
    ("stationName", "station"),
    ("mapDownloadLink", "link"),
    ("errorDescription", "text"),
    ("errorHint", "text"),
    ("infoDescription", "text"),
    ("nodeDescription", "text"),
    ("edgeDescription", "text"),
    ("actionDescription", "text"),
    ("mapDescription", "text"),
    ("resultDescription", "text"),
];

/// Members that hold a point of the floor, or several.
const POINTS: [&str; 3] = ["agvPosition", "nodePosition", "controlPoints"];

/// Replaces names and places, always alike.
pub struct Redactor {
    topics: Topics,
    /// What stands for a name, by what it is the name of.
    names: HashMap<(&'static str, String), String>,
    counts: HashMap<&'static str, u64>,
    /// The first place that came, which becomes the origin.
    origin: Option<(f64, f64)>,
}

impl Redactor {
    /// For topics that are built like this.
    ///
    /// # Errors
    /// What is wrong with the template.
    pub fn new(rules: &Rules, options: &Options) -> Result<Self, AuditError> {
        Ok(Self {
            topics: Topics::new(&rules.packs, options.topic_template.as_deref())?,
            names: HashMap::new(),
            counts: HashMap::new(),
            origin: None,
        })
    }

    /// The message without them. Of a topic of no vehicle, and of what is not JSON, nothing is left.
    #[must_use]
    pub fn message(&mut self, message: Message) -> Message {
        let Some(levels) = self.topics.levels(&message.topic) else {
            return Message {
                topic: "elsewhere".to_owned(),
                payload: "{}".into(),
                ..message
            };
        };
        let mut topic = String::new();
        let mut at = 0;
        for (range, kind) in levels {
            let name = self.name(kind, &message.topic[range.clone()]);
            topic.push_str(&message.topic[at..range.start]);
            topic.push_str(&name);
            at = range.end;
        }
        topic.push_str(&message.topic[at..]);
        let payload = match serde_json::from_slice::<Value>(&message.payload) {
            Ok(mut value) => {
                self.value(&mut value, 0);
                value.to_string()
            }
            Err(_) if message.payload.is_empty() => String::new(),
            Err(_) => "what was no JSON".to_owned(),
        };
        Message {
            topic,
            payload: payload.into(),
            ..message
        }
    }

    /// What stands for a name; nothing stands for nothing.
    fn name(&mut self, kind: &'static str, name: &str) -> String {
        if name.is_empty() {
            return String::new();
        }
        let key = (kind, name.to_owned());
        if let Some(known) = self.names.get(&key) {
            return known.clone();
        }
        let count = self.counts.entry(kind).or_default();
        *count += 1;
        let made = format!("{kind}-{count}");
        self.names.insert(key, made.clone());
        made
    }

    fn value(&mut self, value: &mut Value, depth: usize) {
        if depth > DEPTH {
            *value = Value::Null;
            return;
        }
        match value {
            Value::Array(all) => all.iter_mut().for_each(|one| self.value(one, depth + 1)),
            Value::Object(object) => self.object(object, depth),
            _ => {}
        }
    }

    fn object(&mut self, object: &mut Map<String, Value>, depth: usize) {
        // A reference or a parameter has the name of its value beside it.
        for (key, member) in [("referenceKey", "referenceValue"), ("key", "value")] {
            let kind = object
                .get(key)
                .and_then(Value::as_str)
                .map(|key| kind_of(key).unwrap_or("value"));
            if let (Some(kind), Some(Value::String(text))) = (kind, object.get_mut(member)) {
                *text = self.name(kind, text);
            }
        }
        let is_position = matches!(object.get("key").and_then(Value::as_str), Some("x" | "y"));
        if is_position && object.get("value").is_some_and(Value::is_number) {
            object.insert("value".to_owned(), Value::from(0));
        }
        for (name, value) in object.iter_mut() {
            if let (Some(kind), Value::String(text)) = (kind_of(name), &mut *value) {
                *text = self.name(kind, text);
                continue;
            }
            if POINTS.contains(&name.as_str()) {
                match &mut *value {
                    Value::Array(all) => all.iter_mut().for_each(|point| self.point(point)),
                    point => self.point(point),
                }
            }
            self.value(value, depth + 1);
        }
    }

    /// Moves a point of the floor by as much as all others.
    fn point(&mut self, point: &mut Value) {
        let (Some(x), Some(y)) = (
            point.get("x").and_then(Value::as_f64),
            point.get("y").and_then(Value::as_f64),
        ) else {
            return;
        };
        let (from_x, from_y) = *self.origin.get_or_insert((x, y));
        // To the tenth of a millimetre, so that no digit tells where it was.
        let moved = |at: f64, from: f64| Value::from(((at - from) * 10_000.0).round() / 10_000.0);
        point["x"] = moved(x, from_x);
        point["y"] = moved(y, from_y);
    }
}

fn kind_of(member: &str) -> Option<&'static str> {
    NAMES.iter().find(|(name, _)| *name == member).map(|(_, kind)| *kind)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::Audit;
    use super::super::tests::traffic;
    use super::*;
    use tck_pack::Role;

    #[test]
    fn names_texts_and_places_are_gone_and_what_is_equal_stays_equal() {
        let library = tck_testing::library();
        let mut redactor = Redactor::new(&library.rules, &Options::default()).expect("a template");
        let of = |topic: &str, payload: &Value| Message {
            at: None,
            topic: topic.to_owned(),
            payload: payload.to_string().into(),
            qos: None,
            retain: None,
            place: tck_capture::SourcePosition::default(),
            after_gap: false,
            carried: None,
        };
        let order = json!({ "manufacturer": "SECRET", "serialNumber": "SECRET-7", "orderId": "SECRET-o", "headerId": 7,
            "nodes": [{ "nodeId": "SECRET-n", "nodePosition": { "x": 100.5, "y": 7.25, "theta": 1.0, "mapId": "SECRET-m" },
                "actions": [{ "actionId": "SECRET-a", "actionType": "pick",
                    "actionParameters": [{ "key": "loadId", "value": "SECRET-l" }, { "key": "x", "value": 4711 }] }] }] });
        let state = json!({ "serialNumber": "SECRET-7", "lastNodeId": "SECRET-n", "agvPosition": { "x": 102.5, "y": 7.25 },
            "loads": [{ "loadId": "SECRET-l" }], "errors": [{ "errorType": "orderError", "errorDescription": "SECRET text",
                "errorReferences": [{ "referenceKey": "nodeId", "referenceValue": "SECRET-n" }] }] });
        let order = redactor.message(of("SECRET/v2/SECRET/SECRET-7/order", &order));
        let state = redactor.message(of("SECRET/v2/SECRET/SECRET-7/state", &state));
        assert_eq!(order.topic, "site-1/v2/maker-1/vehicle-1/order");
        assert_eq!(state.topic, "site-1/v2/maker-1/vehicle-1/state");
        let read = |message: &Message| serde_json::from_slice::<Value>(&message.payload).expect("JSON");
        let (order, state) = (read(&order), read(&state));
        for text in [order.to_string(), state.to_string()] {
            assert!(
                !text.contains("SECRET") && !text.contains("4711") && !text.contains("102.5"),
                "{text}"
            );
        }
        assert_eq!(order["nodes"][0]["nodeId"], state["lastNodeId"]);
        assert_eq!(
            order["nodes"][0]["nodeId"],
            state["errors"][0]["errorReferences"][0]["referenceValue"]
        );
        assert_eq!(
            order["nodes"][0]["actions"][0]["actionParameters"][0]["value"],
            state["loads"][0]["loadId"]
        );
        assert_eq!(state["agvPosition"], json!({ "x": 2.0, "y": 0.0 }));
        assert_eq!(order["nodes"][0]["nodePosition"]["theta"], 1.0);
        assert_eq!(
            redactor.message(of("SECRET/log", &json!({ "a": "SECRET" }))).payload,
            "{}"
        );
    }

    #[test]
    fn what_is_redacted_is_judged_alike() {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        for faults in [&[][..], &["horizon-not-reported"]] {
            let messages = traffic(library, pack, Role::Agv, "order-acceptance/", faults);
            let mut redactor = Redactor::new(&library.rules, &Options::default()).expect("a template");
            let decided = |messages: Vec<Message>| {
                let mut audit = Audit::new(&library.rules, Options::default()).expect("options");
                for message in messages {
                    audit.observe(message);
                }
                let result = audit.finish(Vec::new());
                let sides = result.vehicles.into_iter().flat_map(|vehicle| vehicle.sides);
                sides.map(|side| side.requirements).collect::<Vec<_>>()
            };
            let redacted = messages.iter().map(|message| redactor.message(message.clone()));
            let redacted: Vec<Message> = redacted.collect();
            assert_eq!(decided(redacted), decided(messages));
        }
    }
}
