//! The generic breakages over every schema of every version: each is found at the member it breaks.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::super::{BreakageScope, FindingKind, Way};
use super::{good, packs};

/// Everything of a message that can be entered: the first element of each list, and optional objects as they stand there.
fn scope(message: &Value) -> BreakageScope {
    let mut scope = BreakageScope::default();
    let Value::Object(members) = message else {
        return scope;
    };
    for (name, value) in members {
        enter(name, value, &mut scope);
    }
    scope
}

fn enter(path: &str, value: &Value, scope: &mut BreakageScope) {
    scope.holding.insert(path.to_owned(), value.clone());
    let inside = match value {
        Value::Array(items) if items.first().is_some_and(Value::is_object) => {
            scope.elements.insert(path.to_owned(), 0);
            &items[0]
        }
        other => other,
    };
    for (name, value) in inside.as_object().into_iter().flatten() {
        enter(&format!("{path}.{name}"), value, scope);
    }
}

/// Carries out a patch of a breakage, and says where its last operation was.
fn broken(message: &Value, patch: &Value) -> Option<(Value, String)> {
    let mut message = message.clone();
    let mut place = String::new();
    for operation in patch.as_array()? {
        place = operation["path"].as_str()?.to_owned();
        let (holder, name) = place.rsplit_once('/')?;
        let members = message.pointer_mut(holder)?.as_object_mut()?;
        match operation["op"].as_str()? {
            "remove" => {
                members.shift_remove(name)?;
            }
            "as-text" => {
                let text = members.get(name)?.to_string();
                members.insert(name.to_owned(), json!(text));
            }
            _ => {
                members.insert(name.to_owned(), operation["value"].clone());
            }
        }
    }
    Some((message, place))
}

#[test]
fn every_breakage_of_a_full_message_is_found_where_it_is() {
    let full = BTreeMap::from([
        ("order", "order-full"),
        ("instantActions", "instantActions-several"),
        ("state", "state-driving"),
        ("visualization", "visualization-full"),
        ("connection", "connection-online"),
        ("factsheet", "factsheet-full"),
        ("zoneSet", "zoneSet-full"),
        ("responses", "responses-granted"),
    ]);
    for pack in packs().all() {
        let (mut found, mut excused) = (0, 0);
        for topic in pack.topics() {
            let name = topic.name.as_str();
            let schema = pack.schema(name).expect("schema");
            let message = good(pack, full[name]);
            for breakage in schema.breakages(&scope(&message)) {
                let shown = format!("{} {name} {} {}", pack.id, breakage.member, breakage.way.word());
                // Of what stands in other places of a list only, nothing can be broken here.
                let Some((spoilt, place)) = broken(&message, &breakage.patch) else {
                    continue;
                };
                let findings = schema.findings(&spoilt);
                // Another reading of what is disputed may have it.
                let disputed = schema.readings(&spoilt) != schema.readings(&message);
                if findings.is_empty() && disputed {
                    excused += 1;
                    continue;
                }
                let inside = |finding: &&super::super::Finding| finding.path.starts_with(&place);
                let first = findings.iter().find(inside);
                let first = first.unwrap_or_else(|| panic!("{shown}: nothing at {place}: {findings:?}"));
                let due = match breakage.way {
                    Way::Missing => FindingKind::Missing,
                    Way::Word => FindingKind::Enumeration,
                    Way::Below | Way::Above | Way::Empty => FindingKind::Range,
                    Way::Null | Way::Type | Way::Text | Way::Fraction => FindingKind::Type,
                };
                assert_eq!(first.kind, due, "{shown}");
                found += 1;
            }
        }
        assert!(
            excused * 20 < found,
            "VDA 5050 {}: {excused} of {found} are disputed",
            pack.id
        );
        assert!(found > 300, "VDA 5050 {}: {found}", pack.id);
    }
}
