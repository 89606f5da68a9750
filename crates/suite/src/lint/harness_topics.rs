//! What can be seen on the topics of the harness itself, such as `mqtt/connect`: the members of
//! [`Event::picture`](tck_journal::event::Event::picture).

use tck_pack::Shape;

/// Kind `any` is open: whatever the device put there.
type Members = &'static [(&'static str, &'static str)];

const PICTURES: [(&str, Members); 7] = [
    (
        "mqtt/connect",
        &[
            ("type", "string"),
            ("level", "integer"),
            ("clientId", "string"),
            ("keepAlive", "integer"),
            ("cleanSession", "boolean"),
            ("username", "string"),
            ("hasPassword", "boolean"),
            ("will", "object"),
            ("will.topic", "string"),
            ("will.payload", "any"),
            ("will.qos", "integer"),
            ("will.retain", "boolean"),
        ],
    ),
    (
        "mqtt/publish",
        &[
            ("type", "string"),
            ("topic", "string"),
            ("qos", "integer"),
            ("retain", "boolean"),
            ("dup", "boolean"),
            ("packetId", "integer"),
            ("payload", "any"),
        ],
    ),
    (
        "mqtt/subscribe",
        &[
            ("type", "string"),
            ("packetId", "integer"),
            ("filters", "array"),
            ("filters.filter", "string"),
            ("filters.qos", "integer"),
        ],
    ),
    ("mqtt/disconnect", &[("type", "string"), ("code", "integer")]),
    (
        "mqtt/closed",
        &[("kind", "string"), ("connection", "integer"), ("how", "string")],
    ),
    (
        "mqtt/undecodable",
        &[
            ("kind", "string"),
            ("connection", "integer"),
            ("reason", "string"),
            ("bytes", "any"),
        ],
    ),
    (
        "http/fetch",
        &[
            ("kind", "string"),
            ("name", "string"),
            ("request", "string"),
            ("status", "integer"),
            ("phase", "string"),
        ],
    ),
];

/// Members that only take certain words.
const WORDS: [(&str, &str, &[&str]); 2] = [
    (
        "mqtt/closed",
        "how",
        &["device-fin", "device-reset", "broker", "harness"],
    ),
    ("http/fetch", "phase", &["begun", "done", "cut"]),
];

/// The topics of the harness.
pub(super) fn topics() -> impl Iterator<Item = &'static str> {
    PICTURES.iter().map(|(topic, _)| *topic)
}

/// Topic, path, kind and allowed words of everything that can be seen on the topics of the harness.
pub fn harness_topics() -> impl Iterator<Item = (&'static str, &'static str, &'static str, &'static [&'static str])> {
    PICTURES.iter().flat_map(|(topic, members)| {
        members.iter().map(move |(path, kind)| {
            let mut words = WORDS.iter();
            let words = words.find(|(other, place, _)| other == topic && place == path);
            (*topic, *path, *kind, words.map_or(&[][..], |(_, _, words)| *words))
        })
    })
}

fn members_of(topic: &str) -> Option<Members> {
    PICTURES
        .iter()
        .find(|(name, _)| *name == topic)
        .map(|(_, members)| *members)
}

/// Whether this is a topic of the harness.
pub(super) fn has(topic: &str) -> bool {
    members_of(topic).is_some()
}

/// What stands at a path.
pub(super) fn shape(topic: &str, path: &[&str]) -> Option<Shape> {
    let members = members_of(topic)?;
    let open = |kinds: Vec<&'static str>, open, array| Shape {
        kinds,
        literals: None,
        required: false,
        open,
        array,
    };
    if path.is_empty() {
        return Some(open(vec!["object"], false, false));
    }
    let any = || {
        open(
            vec!["array", "boolean", "integer", "null", "number", "object", "string"],
            true,
            false,
        )
    };
    let whole = path.join(".");
    if let Some((_, kind)) = members.iter().find(|(name, _)| *name == whole) {
        let mut shape = match *kind {
            "any" => any(),
            "array" => open(vec!["array"], false, true),
            kind => open(vec![kind], false, false),
        };
        shape.literals = WORDS
            .iter()
            .find(|(name, member, _)| *name == topic && *member == whole)
            .map(|(_, _, words)| words.iter().map(|word| (*word).to_owned()).collect());
        return Some(shape);
    }
    let below_open = (1..path.len()).any(|length| {
        let prefix = path[..length].join(".");
        members.iter().any(|(name, kind)| *kind == "any" && *name == prefix)
    });
    below_open.then(any)
}

/// The members below a path.
pub(super) fn members(topic: &str, path: &[&str]) -> Vec<String> {
    let mut prefix = path.join(".");
    if !path.is_empty() {
        prefix.push('.');
    }
    members_of(topic)
        .unwrap_or_default()
        .iter()
        .filter_map(|(name, _)| name.strip_prefix(prefix.as_str()))
        .filter(|rest| !rest.contains('.'))
        .map(str::to_owned)
        .collect()
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use tck_journal::event::{Close, Event, Filter, Packet, Payload, Will};

    fn whole(bytes: &'static [u8]) -> Payload {
        Payload::Whole(bytes::Bytes::from_static(bytes))
    }

    fn packet(packet: Packet) -> Value {
        Event::Packet { connection: 1, packet }.picture()
    }

    fn check(topic: &str, value: &Value, path: &mut Vec<String>) {
        let names: Vec<&str> = path.iter().map(String::as_str).collect();
        let shape = shape(topic, &names).unwrap_or_else(|| panic!("{topic}: {path:?} is not in the table"));
        if shape.open {
            return;
        }
        match value {
            Value::Object(members) => {
                let mut seen: Vec<_> = members.keys().cloned().collect();
                let mut listed = super::members(topic, &names);
                seen.sort();
                listed.sort();
                assert_eq!(seen, listed, "{topic}: {path:?}");
                for (name, value) in members {
                    path.push(name.clone());
                    check(topic, value, path);
                    path.pop();
                }
            }
            Value::Array(items) => {
                assert!(shape.array);
                items
                    .iter()
                    .flat_map(|item| item.as_object().into_iter().flatten())
                    .for_each(|(name, value)| {
                        path.push(name.clone());
                        check(topic, value, path);
                        path.pop();
                    });
            }
            Value::String(_) => assert_eq!(shape.kinds, ["string"], "{topic}: {path:?}"),
            Value::Bool(_) => assert_eq!(shape.kinds, ["boolean"], "{topic}: {path:?}"),
            _ => assert_eq!(shape.kinds, ["integer"], "{topic}: {path:?}"),
        }
    }

    #[test]
    fn the_table_agrees_with_the_pictures_of_events() {
        let connect = Packet::Connect {
            level: 4,
            client_id: "c".into(),
            keep_alive: 15,
            clean_session: true,
            username: Some("u".into()),
            has_password: true,
            will: Some(Will {
                topic: "t".into(),
                payload: whole(b"{\"x\": 1}"),
                qos: 1,
                retain: true,
            }),
        };
        let publish = Packet::Publish {
            topic: "t".into(),
            qos: 0,
            retain: false,
            dup: false,
            packet_id: Some(1),
            payload: whole(b"{}"),
        };
        let subscribe = Packet::Subscribe {
            packet_id: 1,
            filters: vec![Filter {
                filter: "f".into(),
                qos: 0,
            }],
        };
        let closed = Event::Closed {
            connection: 1,
            how: Close::DeviceReset,
        };
        let undecodable = Event::Undecodable {
            connection: 1,
            reason: "r".into(),
            bytes: whole(b"x"),
        };
        let fetched = Event::Fetched {
            name: "m".into(),
            request: "GET /".into(),
            status: Some(200),
            phase: "done".into(),
        };
        for (topic, picture) in [
            ("mqtt/connect", packet(connect)),
            ("mqtt/publish", packet(publish)),
            ("mqtt/subscribe", packet(subscribe)),
            ("mqtt/disconnect", packet(Packet::Disconnect { code: 0 })),
            ("mqtt/closed", closed.picture()),
            ("mqtt/undecodable", undecodable.picture()),
            ("http/fetch", fetched.picture()),
        ] {
            check(topic, &picture, &mut Vec::new());
        }
        assert!(shape("mqtt/connect", &["will", "payload", "connectionState"]).is_some());
        assert!(shape("mqtt/connect", &["will", "payloda"]).is_none());
    }
}
