//! Recordings without what only their owner should know: names of makers, vehicles, maps, nodes, orders and loads, free texts, and
//! where on the floor something is. What is equal stays equal, so nearly everything is judged as before.

use std::collections::{BTreeSet, HashMap};

use serde_json::{Map, Value};

use super::topics::Topics;
use super::{AuditError, Options};
use tck_capture::Message;
use tck_judge::Rules;
use tck_view::{
    ControlPoint, Field, IntermediatePath, Names, Node, NodePosition, NodeState, Parameter, Point, Position, Reference,
    StateView, Trajectory, VisualizationView, Waypoint, Zone,
};

/// How deep a message is entered; what is deeper is left out.
const DEPTH: usize = 64;

/// Members that hold a name or a free text, by their usual name, and what it is the name of.
const NAMES: [(&str, &str); 30] = [
    ("manufacturer", "maker"),
    ("serialNumber", "vehicle"),
    ("orderId", "order"),
    ("nodeId", "node"),
    ("startNodeId", "node"),
    ("endNodeId", "node"),
    ("lastNodeId", "node"),
    ("traversedNodes", "node"),
    ("edgeId", "edge"),
    ("actionId", "action"),
    ("mapId", "map"),
    ("zoneSetId", "zones"),
    ("zoneId", "zone"),
    ("loadId", "load"),
    ("loadPosition", "place"),
    ("description", "text"),
    ("seriesDescription", "text"),
    ("orderDescription", "text"),
    ("errorDescription", "text"),
    ("errorHint", "text"),
    ("translationValue", "text"),
    ("infoDescription", "text"),
    ("nodeDescription", "text"),
    ("edgeDescription", "text"),
    ("actionDescription", "text"),
    ("actionDescriptor", "text"),
    ("mapDescription", "text"),
    ("zoneSetDescriptor", "text"),
    ("zoneDescriptor", "text"),
    ("resultDescription", "text"),
];

/// Parameters of actions that hold a name and are called like no member.
const PARAMETERS: [(&str, &str); 2] = [("stationName", "station"), ("mapDownloadLink", "link")];

/// Members that hold a point of the floor, or several.
const POINTS: [Field; 7] = [
    StateView::position,
    VisualizationView::position,
    Node::node_position,
    NodeState::node_position,
    Trajectory::control_points,
    IntermediatePath::polyline,
    Zone::vertices,
];

/// The coordinates of a point of the floor.
const COORDINATES: [(Field, Field); 5] = [
    (Position::x, Position::y),
    (NodePosition::x, NodePosition::y),
    (ControlPoint::x, ControlPoint::y),
    (Waypoint::x, Waypoint::y),
    (Point::x, Point::y),
];

/// Members beside each other of which the first says what the second holds.
const PAIRS: [(Field, Field); 2] = [(Reference::key, Reference::value), (Parameter::key, Parameter::value)];

/// What is sought in messages, by every name that a version has for it.
struct Members {
    /// What a member, or a parameter of an action, is the name of.
    names: HashMap<String, &'static str>,
    points: BTreeSet<String>,
    coordinates: BTreeSet<(String, String)>,
    pairs: BTreeSet<(String, String)>,
}

impl Members {
    fn of<'n>(versions: impl Iterator<Item = &'n Names> + Clone) -> Self {
        let names_of = |field: Field| {
            let names = versions.clone().filter_map(move |names| names.name(field));
            // What was moved into another object is found there by the last part.
            names.map(|name| name.rsplit('/').next().unwrap_or(name).to_owned())
        };
        let both = |(one, other): (Field, Field)| names_of(one).zip(names_of(other));
        let mut names: HashMap<String, &'static str> = HashMap::new();
        for (name, kind) in PARAMETERS.into_iter().chain(NAMES) {
            names.insert(name.to_owned(), kind);
            let fields = Field::all().filter(|field| field.usual_name() == name);
            names.extend(fields.flat_map(&names_of).map(|name| (name, kind)));
        }
        Self {
            names,
            points: POINTS.into_iter().flat_map(&names_of).collect(),
            coordinates: COORDINATES.into_iter().flat_map(both).collect(),
            pairs: PAIRS.into_iter().flat_map(both).collect(),
        }
    }

    fn kind_of(&self, member: &str) -> Option<&'static str> {
        self.names.get(member).copied()
    }

    /// How far the floor moves along the axis that a member of this name measures; `None` for a member that is no coordinate.
    fn offset(&self, name: &str, origin: (f64, f64)) -> Option<f64> {
        self.coordinates.iter().find_map(|(x, y)| match name {
            _ if name == x => Some(origin.0),
            _ if name == y => Some(origin.1),
            _ => None,
        })
    }
}

/// A coordinate, measured from another origin, to the tenth of a millimetre, so that no digit tells where it was.
fn moved(at: f64, from: f64) -> Value {
    Value::from(((at - from) * 10_000.0).round() / 10_000.0)
}

/// Replaces names and places, always alike.
pub struct Redactor {
    topics: Topics,
    members: Members,
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
            members: Members::of(rules.packs.all().iter().map(|pack| pack.names().as_ref())),
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
        let key_of =
            |object: &Map<String, Value>, key: &str| object.get(key).and_then(Value::as_str).map(str::to_owned);
        let pairs = self.members.pairs.iter();
        let beside = pairs.filter_map(|(key, value)| Some((key_of(object, key)?, value.clone())));
        for (key, value) in beside.collect::<Vec<_>>() {
            let kind = self.members.kind_of(&key).unwrap_or("value");
            let offset = self.members.offset(&key, self.origin.unwrap_or_default());
            match (object.get_mut(&value), offset) {
                (Some(Value::String(text)), _) => *text = self.name(kind, text),
                // Before any place is known there is nothing to measure from.
                (Some(number @ Value::Number(_)), Some(from)) => {
                    *number = match number.as_f64().filter(|_| self.origin.is_some()) {
                        Some(at) => moved(at, from),
                        None => Value::from(0),
                    };
                }
                _ => {}
            }
        }
        for (name, value) in object.iter_mut() {
            if let Some(kind) = self.members.kind_of(name) {
                self.named(kind, value);
            }
            if self.members.points.contains(name) {
                self.point(value, depth + 1);
            }
            self.value(value, depth + 1);
        }
    }

    /// Replaces a name, or each one of a list.
    fn named(&mut self, kind: &'static str, value: &mut Value) {
        match value {
            Value::String(text) => *text = self.name(kind, text),
            Value::Array(all) => {
                for one in all {
                    if let Value::String(text) = one {
                        *text = self.name(kind, text);
                    }
                }
            }
            _ => {}
        }
    }

    /// Moves the points of the floor in a value by as much as all others.
    fn point(&mut self, value: &mut Value, depth: usize) {
        let object = match value {
            _ if depth > DEPTH => return,
            Value::Array(all) => return all.iter_mut().for_each(|point| self.point(point, depth + 1)),
            Value::Object(object) => object,
            _ => return,
        };
        let number = |name: &String| object.get(name).and_then(Value::as_f64);
        let names = self.members.coordinates.iter();
        let mut found = names.filter_map(|names| Some((names.clone(), (number(&names.0)?, number(&names.1)?))));
        if let Some(((x, y), at)) = found.next() {
            let from = *self.origin.get_or_insert(at);
            object.insert(x, moved(at.0, from.0));
            object.insert(y, moved(at.1, from.1));
        }
        object.values_mut().for_each(|inside| self.point(inside, depth + 1));
    }
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
    fn what_a_version_calls_otherwise_is_redacted_by_that_name() {
        for (name, _) in NAMES {
            assert!(Field::all().any(|field| field.usual_name() == name), "{name}");
        }
        let library = tck_testing::library();
        let mut redactor = Redactor::new(&library.rules, &Options::default()).expect("a template");
        let names: Names = serde_json::from_value(json!({
            "state": { "agvPosition": "mobileRobotPosition", "lastNodeId": "lastPassed" },
            "position": { "x": "place/east", "y": "place/north" },
            "reference": { "referenceKey": "about", "referenceValue": "which" },
        }))
        .expect("names");
        redactor.members = Members::of([&Names::default(), &names].into_iter());
        let mut state = json!({ "lastPassed": "SECRET", "errors": [{ "errorReferences": [{ "about": "nodeId", "which": "SECRET" }] }],
            "mobileRobotPosition": { "theta": 1.5, "place": { "east": 47.0, "north": 11.0 } } });
        redactor.value(&mut state, 0);
        let expected = json!({ "lastPassed": "node-1", "errors": [{ "errorReferences": [{ "about": "nodeId", "which": "node-1" }] }],
            "mobileRobotPosition": { "theta": 1.5, "place": { "east": 0.0, "north": 0.0 } } });
        assert_eq!(state, expected);
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
