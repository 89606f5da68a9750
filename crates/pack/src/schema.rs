//! One message schema, compiled once: what is wrong with a message, and what the schema says about a path.
//!
//! Relations between fields are left to named checks.

use std::collections::HashSet;
use std::fmt;
use std::sync::{Arc, OnceLock};

use jsonschema::ValidationError;
use jsonschema::error::{TypeKind, ValidationErrorKind};
use serde_json::Value;

use super::Shape;
use super::errata::{Disputed, KeptReading};
use super::member_tree::MemberTree;
use super::validator::{Validator, bounded};

/// At most this many findings per message.
const MAX_FINDINGS: usize = 50;

/// The schema of one topic. Clones share the compiled form.
#[derive(Clone)]
pub struct MessageSchema(Arc<Compiled>);

struct Compiled {
    raw: Value,
    validator: Validator,
    errata: Vec<Disputed>,
    tree: OnceLock<MemberTree>,
}

/// One place where a message breaks its schema.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// JSON pointer; of a missing member, where it should be.
    pub path: String,
    /// What is broken there.
    pub kind: FindingKind,
    /// In one line, with the value, both bounded.
    pub message: String,
}

/// What a [`Finding`] is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FindingKind {
    /// A required member is absent.
    Missing,
    /// Another JSON type.
    Type,
    /// None of the words allowed.
    Enumeration,
    /// Below or above the limits.
    Range,
    /// Another form of text.
    Pattern,
    /// Anything else.
    Other,
}

impl MessageSchema {
    /// Compiles a schema, formats asserted.
    pub(super) fn compile(raw: Value) -> Result<Self, String> {
        let validator = Validator::of(&raw)?;
        Ok(Self(Arc::new(Compiled {
            raw,
            validator,
            errata: Vec::new(),
            tree: OnceLock::new(),
        })))
    }

    /// This schema, where the messages of its topic are disputed.
    pub(super) fn with_errata(self, errata: Vec<Disputed>) -> Self {
        match Arc::try_unwrap(self.0) {
            Ok(compiled) => Self(Arc::new(Compiled { errata, ..compiled })),
            Err(shared) => Self(shared),
        }
    }

    /// What is wrong with `message`: one finding per path, at most 50. None means the message obeys.
    #[must_use]
    pub fn findings(&self, message: &Value) -> Vec<Finding> {
        if self.0.validator.is_valid(message) {
            return Vec::new();
        }
        let mut seen = HashSet::new();
        self.0
            .validator
            .errors(message)
            .map(|error| finding(&error))
            .filter(|finding| {
                !self
                    .0
                    .errata
                    .iter()
                    .any(|one| one.excuses(&finding.path, finding.kind == FindingKind::Missing, message))
            })
            // A number where a word is due is neither of the type nor of the enumeration; the first says it all.
            .filter(|finding| seen.insert(finding.path.clone()))
            .take(MAX_FINDINGS)
            .collect()
    }

    /// Where the published text and schemas contradict each other, and the message keeps to another reading than the usual one.
    #[must_use]
    pub fn readings(&self, message: &Value) -> Vec<KeptReading> {
        self.0.errata.iter().filter_map(|one| one.kept(message)).collect()
    }

    /// The schema as it was read.
    #[must_use]
    pub fn raw(&self) -> &Value {
        &self.0.raw
    }

    /// What the schema says about a path of member names, array elements being entered without an index:
    /// `["errors", "errorLevel"]`. `None` if there is no such path.
    #[must_use]
    pub fn shape(&self, path: &[&str]) -> Option<Shape> {
        super::shape::shape(&self.0.raw, path)
    }

    /// The member names the schema knows below a path, in its order.
    #[must_use]
    pub fn members(&self, path: &[&str]) -> Vec<String> {
        super::shape::members(&self.0.raw, path)
    }

    /// The members that a message can have, as a tree that is made once.
    #[must_use]
    pub fn tree(&self) -> &MemberTree {
        self.0.tree.get_or_init(|| MemberTree::of(&self.0.raw))
    }

    /// Every way to break one member of a message that is right.
    #[must_use]
    pub fn breakages(&self, ground: &super::BreakageScope) -> Vec<super::Breakage> {
        super::breakage::breakages(&self.0.raw, ground)
    }
}

impl fmt::Debug for MessageSchema {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let title = self.0.raw.get("title").and_then(Value::as_str).unwrap_or_default();
        f.debug_tuple("MessageSchema").field(&title).finish()
    }
}

fn finding(error: &ValidationError<'_>) -> Finding {
    let mut path = error.instance_path().to_string();
    let value = error.instance();
    let (kind, message) = match error.kind() {
        ValidationErrorKind::Required { property } => {
            let name = property.as_str().unwrap_or_default();
            path.push('/');
            path.push_str(&name.replace('~', "~0").replace('/', "~1"));
            (FindingKind::Missing, format!("`{name}` is missing"))
        }
        ValidationErrorKind::Type { kind } => {
            let due = match kind {
                TypeKind::Single(one) => one.to_string(),
                TypeKind::Multiple(several) => {
                    let words: Vec<_> = several.iter().map(|one| one.to_string()).collect();
                    words.join(" or ")
                }
            };
            (FindingKind::Type, format!("{} is not of type {due}", shown(value)))
        }
        ValidationErrorKind::Enum { options } => {
            let words: Vec<_> = options.as_array().into_iter().flatten().map(word).collect();
            let message = format!("{} is none of {}", shown(value), words.join(", "));
            (FindingKind::Enumeration, message)
        }
        ValidationErrorKind::Constant { expected_value } => (
            FindingKind::Enumeration,
            format!("{} is not {}", shown(value), word(expected_value)),
        ),
        ValidationErrorKind::Minimum { limit } => (FindingKind::Range, format!("{} is below {limit}", shown(value))),
        ValidationErrorKind::Maximum { limit } => (FindingKind::Range, format!("{} is above {limit}", shown(value))),
        ValidationErrorKind::ExclusiveMinimum { limit } => {
            (FindingKind::Range, format!("{} is not above {limit}", shown(value)))
        }
        ValidationErrorKind::ExclusiveMaximum { limit } => {
            (FindingKind::Range, format!("{} is not below {limit}", shown(value)))
        }
        ValidationErrorKind::MinItems { limit } => (FindingKind::Range, format!("fewer than {limit} elements")),
        ValidationErrorKind::MaxItems { limit } => (FindingKind::Range, format!("more than {limit} elements")),
        ValidationErrorKind::MinLength { limit } => (FindingKind::Range, format!("shorter than {limit} characters")),
        ValidationErrorKind::MaxLength { limit } => (FindingKind::Range, format!("longer than {limit} characters")),
        ValidationErrorKind::Pattern { pattern } => (
            FindingKind::Pattern,
            format!("{} does not have the form {pattern}", shown(value)),
        ),
        ValidationErrorKind::Format { format } => (FindingKind::Pattern, format!("{} is not a {format}", shown(value))),
        ValidationErrorKind::FalseSchema => (FindingKind::Other, format!("{} must not stand here", shown(value))),
        _ => (FindingKind::Other, bounded(&error.masked().to_string())),
    };
    Finding { path, kind, message }
}

fn word(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// A value of a device for a message: containers by their kind, everything else cut.
fn shown(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("an array of {}", items.len()),
        Value::Object(_) => "an object".to_owned(),
        // Cut first: the text may be megabytes long.
        Value::String(text) => Value::String(bounded(text)).to_string(),
        other => bounded(&other.to_string()),
    }
}

/// Whether `raw` is a schema of the draft we use.
#[cfg(test)]
pub(super) fn obeys_meta_schema(raw: &Value) -> bool {
    jsonschema::draft202012::meta::is_valid(raw)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    fn schema() -> MessageSchema {
        MessageSchema::compile(json!({
            "type": "object",
            "required": ["a/b", "n"],
            "properties": {
                "n": { "type": "integer", "minimum": 0 },
                "w": { "type": "string", "enum": ["ONE", "TWO"] },
                "list": { "type": "array", "items": { "type": "object", "required": ["x"] } }
            }
        }))
        .expect("schema")
    }

    #[test]
    fn a_missing_member_is_found_where_it_should_be() {
        let found = schema().findings(&json!({ "n": 1, "a/b": 0, "list": [{ "x": 1 }, {}] }));
        assert_eq!(found.len(), 1);
        assert_eq!(
            (found[0].path.as_str(), found[0].kind),
            ("/list/1/x", FindingKind::Missing)
        );
        assert_eq!(schema().findings(&json!({ "n": 1 }))[0].path, "/a~1b");
    }

    #[test]
    fn a_place_is_found_once_and_the_type_comes_first() {
        let found = schema().findings(&json!({ "a/b": 0, "n": 1, "w": 5 }));
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].kind, FindingKind::Type);
    }

    #[test]
    fn findings_are_bounded_in_number_and_length() {
        let many = json!({ "a/b": 0, "n": "x".repeat(100_000), "list": vec![json!({}); 500] });
        let found = schema().findings(&many);
        assert_eq!(found.len(), MAX_FINDINGS);
        assert!(found.iter().all(|finding| finding.message.len() < 200));
    }

    #[test]
    fn a_value_from_a_device_is_escaped() {
        let found = schema().findings(&json!({ "a/b": 0, "n": 0, "w": "A\u{1b}[31m\n" }));
        assert!(
            !found[0].message.chars().any(char::is_control),
            "{:?}",
            found[0].message
        );
    }

    fn any_json() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<f64>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            ".{0,12}".prop_map(Value::from),
        ];
        let name = prop_oneof![
            Just("n".to_owned()),
            Just("w".to_owned()),
            Just("list".to_owned()),
            ".{0,4}"
        ];
        leaf.prop_recursive(4, 32, 6, move |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..6).prop_map(Value::from),
                prop::collection::vec((name.clone(), inner), 0..6).prop_map(|members| members.into_iter().collect()),
            ]
        })
    }

    proptest! {
        #[test]
        fn no_message_makes_it_panic(message in any_json()) {
            let found = schema().findings(&message);
            prop_assert!(found.len() <= MAX_FINDINGS);
        }
    }
}
