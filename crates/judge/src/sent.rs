//! What a test has sent last: the message, and of it the members that the test is about.

use std::sync::Arc;

use serde_json::Value;

use tck_base::pattern::Bindings;
use tck_journal::event::Event;
use tck_journal::{Entry, Payload};
use tck_result::{Sent, SentMember};
use tck_suite::model::{Patch, Send};

/// Most members that are shown.
const MEMBERS: usize = 4;
/// Longest value that is shown, in characters.
const VALUE: usize = 80;

/// What the step has sent; `entries` are the records since it began.
pub(super) fn sent<'a>(
    send: &Send,
    mut entries: impl Iterator<Item = &'a Arc<Entry>>,
    bindings: &Bindings,
) -> Option<Sent> {
    let (entry, payload) = entries.find_map(|entry| match entry.event() {
        Event::Sent { payload, .. } => Some((entry, payload)),
        _ => None,
    })?;
    let mut sent = Sent {
        seq: entry.seq(),
        topic: send.topic.clone(),
        members: Vec::new(),
        more: 0,
        raw: None,
    };
    if send.raw.is_some() {
        sent.raw = Some(beginning(payload));
        return Some(sent);
    }
    let message = entry.json()?;
    let mut paths = Vec::new();
    let changed = match &send.patch {
        Some(Patch::Merge(term) | Patch::Operations(term)) => Some(term),
        None => send.payload.as_ref(),
    };
    match changed.and_then(|term| term.bind(bindings).ok()) {
        Some(Value::Array(operations)) => {
            let named = operations.iter().filter_map(|one| one.get("path")?.as_str());
            paths.extend(named.map(str::to_owned));
        }
        Some(members @ Value::Object(_)) => leaves(&members, message, "", &mut paths),
        _ => {}
    }
    paths.dedup();
    sent.more = paths.len().saturating_sub(MEMBERS);
    sent.members = paths.iter().take(MEMBERS).map(|path| member(path, message)).collect();
    Some(sent)
}

/// The places, as JSON Pointers, that a merge changes.
fn leaves(changed: &Value, message: &Value, path: &str, into: &mut Vec<String>) {
    let Value::Object(members) = changed else { return };
    for (name, value) in members {
        let below = format!("{path}/{}", name.replace('~', "~0").replace('/', "~1"));
        match (value, message.get(name)) {
            (Value::Object(inside), Some(there @ Value::Object(_))) if !inside.is_empty() => {
                leaves(value, there, &below, into);
            }
            _ => into.push(below),
        }
    }
}

fn member(pointer: &str, message: &Value) -> SentMember {
    let mut path = String::new();
    for part in pointer.split('/').skip(1) {
        let part = part.replace("~1", "/").replace("~0", "~");
        if part == "-" || (!part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit())) {
            path.push_str(&format!("[{part}]"));
        } else {
            path.push_str(if path.is_empty() { "" } else { "." });
            path.push_str(&part);
        }
    }
    let place = match pointer.strip_suffix("/-") {
        Some(list) => message.pointer(list).and_then(|list| list.as_array()?.last()),
        None => message.pointer(pointer),
    };
    SentMember {
        path: if path.is_empty() {
            "the message".to_owned()
        } else {
            path
        },
        value: place.map_or_else(|| "left out".to_owned(), shown),
    }
}

/// A value and of which kind it is.
fn shown(value: &Value) -> String {
    let kind = match value {
        Value::Null | Value::Bool(_) => return value.to_string(),
        Value::Number(_) => "a number",
        Value::String(text) if text.is_empty() => "an empty text",
        Value::String(_) => "a text",
        Value::Array(items) if items.is_empty() => "an empty list",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    };
    format!("{} ({kind})", bounded(&value.to_string()))
}

fn beginning(payload: &Payload) -> String {
    bounded(&format!("{:?}", String::from_utf8_lossy(payload.bytes())))
}

fn bounded(text: &str) -> String {
    match text.char_indices().nth(VALUE) {
        None => text.to_owned(),
        Some((at, _)) => format!("{}…", &text[..at]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn of(pointer: &str, message: &Value) -> (String, String) {
        let SentMember { path, value } = member(pointer, message);
        (path, value)
    }

    #[test]
    fn a_member_is_shown_with_its_value_and_kind() {
        let message = json!({ "orderUpdateId": "first", "nodes": [{ "x": 3 }], "edges": [], "a/b": null });
        let is = |pointer: &str, path: &str, value: &str| {
            assert_eq!(of(pointer, &message), (path.to_owned(), value.to_owned()));
        };
        is("/orderUpdateId", "orderUpdateId", r#""first" (a text)"#);
        is("/nodes/0/x", "nodes[0].x", "3 (a number)");
        is("/nodes/0/nodeId", "nodes[0].nodeId", "left out");
        is("/nodes/-", "nodes[-]", r#"{"x":3} (an object)"#);
        is("/edges", "edges", "[] (an empty list)");
        is("/a~1b", "a/b", "null");
    }

    #[test]
    fn a_merge_is_about_its_leaves_and_long_values_are_cut() {
        let message = json!({ "a": { "b": { "c": 1 }, "d": "x".repeat(200) }, "e": 7 });
        let mut paths = Vec::new();
        leaves(
            &json!({ "a": { "b": { "c": 1 }, "d": null }, "e": {} }),
            &message,
            "",
            &mut paths,
        );
        assert_eq!(paths, ["/a/b/c", "/a/d", "/e"]);
        assert_eq!(
            of("/a/d", &message).1.chars().count(),
            VALUE + "… (a text)".chars().count()
        );
    }
}
