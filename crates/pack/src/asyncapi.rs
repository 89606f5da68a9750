//! A protocol version as an `AsyncAPI` 3 document: topics as channels, how they are published as MQTT bindings, messages by their schemas.
//!
//! A document speaks for one application, which here is one side of the interface. Relations between fields, which are not in the
//! schemas, and what a message means are not in it.

use serde_json::{Map, Value, json};

use super::{Pack, Role, TopicRule};

/// The version of `AsyncAPI`; it has nothing to do with the protocol.
const SPECIFICATION: [u8; 3] = [3, 0, 0];
/// The version of the bindings for MQTT.
const BINDING: &str = "0.2.0";
/// Where the schemas of the document lie.
const SCHEMAS: &str = "#/components/schemas/";
/// Where a schema of a pack has its definitions.
const DEFINITIONS: &str = "#/$defs/";

/// The document of a version for one side.
#[must_use]
pub fn asyncapi(pack: &Pack, side: Role) -> Value {
    let mut channels = Map::new();
    let mut operations = Map::new();
    let mut messages = Map::new();
    let mut schemas = Map::new();
    for topic in pack.topics() {
        let name = topic.name.as_str();
        channels.insert(name.to_owned(), channel(pack, topic));
        let (operation, described) = operation(topic, side);
        operations.insert(operation, described);
        messages.insert(
            name.to_owned(),
            json!({
                "name": name,
                "contentType": "application/json",
                "payload": { "$ref": format!("{SCHEMAS}{name}") },
            }),
        );
        if let Some(schema) = pack.schema(name) {
            add_schemas(name, schema.raw(), &mut schemas);
        }
    }
    let who = match side {
        Role::Agv => "an AGV",
        Role::MasterControl => "a master control",
    };
    json!({
        "asyncapi": SPECIFICATION.map(|part| part.to_string()).join("."),
        "info": {
            "title": format!("VDA 5050, as {who} speaks it"),
            "version": pack.version.to_string(),
            "description": "Written by vda5050-tck from the field tables of the standard. Names of topics follow its recommendation; \
                a site may have others.",
        },
        "defaultContentType": "application/json",
        "channels": channels,
        "operations": operations,
        "components": { "messages": messages, "schemas": schemas },
    })
}

fn channel(pack: &Pack, topic: &TopicRule) -> Value {
    let name = topic.name.as_str();
    let template = pack.topic_template();
    let address = pack.fill_topic(template, "{manufacturer}", "{serialNumber}", name);
    let known = [
        ("manufacturer", "The manufacturer of the vehicle."),
        ("serialNumber", "The serial number of the vehicle."),
    ];
    let parameters = known
        .into_iter()
        .filter(|(parameter, _)| address.contains(&format!("{{{parameter}}}")))
        .map(|(parameter, what)| {
            let described = json!({ "description": what, "location": format!("$message.payload#/{parameter}") });
            (parameter.to_owned(), described)
        });
    json!({
        "address": address,
        "description": if topic.mandatory { "Every implementation has it." } else { "An implementation may do without it." },
        "parameters": parameters.collect::<Map<String, Value>>(),
        "messages": { name: { "$ref": format!("#/components/messages/{name}") } },
    })
}

/// What the side does with a topic, and what that is called.
fn operation(topic: &TopicRule, side: Role) -> (String, Value) {
    let name = topic.name.as_str();
    let action = if topic.publisher == side { "send" } else { "receive" };
    let mut mqtt = json!({ "qos": topic.qos, "bindingVersion": BINDING });
    // Whether a message is kept is for the one that publishes it to say.
    if topic.publisher == side {
        mqtt["retain"] = topic.retain.into();
    }
    let capital: String = name
        .chars()
        .take(1)
        .flat_map(char::to_uppercase)
        .chain(name.chars().skip(1))
        .collect();
    let described = json!({
        "action": action,
        "channel": { "$ref": format!("#/channels/{name}") },
        "messages": [{ "$ref": format!("#/channels/{name}/messages/{name}") }],
        "bindings": { "mqtt": mqtt },
    });
    (format!("{action}{capital}"), described)
}

/// Lays a schema and its definitions beside each other. `AsyncAPI` has schemas of an older draft, without `$defs`, in which nothing may
/// stand beside a reference.
fn add_schemas(topic: &str, raw: &Value, schemas: &mut Map<String, Value>) {
    let mut whole = raw.clone();
    let definitions = whole.as_object_mut().and_then(|members| {
        members.remove("$schema");
        members.remove("$defs")
    });
    schemas.insert(topic.to_owned(), rewritten(whole, topic));
    if let Some(Value::Object(definitions)) = definitions {
        for (name, definition) in definitions {
            schemas.insert(format!("{topic}.{name}"), rewritten(definition, topic));
        }
    }
}

/// The schema with its references to where its definitions lie now.
fn rewritten(schema: Value, topic: &str) -> Value {
    match schema {
        Value::Array(items) => items.into_iter().map(|item| rewritten(item, topic)).collect(),
        Value::Object(mut members) => {
            let target = members.get("$ref").and_then(Value::as_str);
            let name = target.and_then(|target| target.strip_prefix(DEFINITIONS));
            let reference = name.map(|name| json!({ "$ref": format!("{SCHEMAS}{topic}.{name}") }));
            if reference.is_some() {
                members.remove("$ref");
            }
            let beside: Map<String, Value> = members
                .into_iter()
                .map(|(name, value)| (name, rewritten(value, topic)))
                .collect();
            match reference {
                None => Value::Object(beside),
                Some(reference) if beside.is_empty() => reference,
                Some(reference) => json!({ "allOf": [reference, beside] }),
            }
        }
        other => other,
    }
}
