//! One parse of a payload, with what `serde_json` alone would hide.
//!
//! Duplicate member names, a byte order mark and bytes that are not UTF-8 are findings of their own; the
//! value is still given where one can be had, so that one mistake does not mask the next.

use serde::de::{DeserializeSeed, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};

use super::Payload;

/// So deep objects and lists may lie in one another.
const DEPTH: usize = 127;
/// How `serde_json` says that they lie deeper.
const TOO_DEEP: &str = "recursion limit exceeded";

/// The outcome of parsing one payload.
#[derive(Clone, Debug, PartialEq)]
pub struct Parsed {
    value: Option<Value>,
    problems: Vec<JsonProblem>,
}

/// What is wrong with the bytes of a payload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JsonProblem {
    /// Too big to be kept, and so not parsed.
    TooBig {
        /// Length in bytes.
        length: u64,
    },
    /// Deeper than it is parsed.
    TooDeep,
    /// Nothing at all.
    Empty,
    /// Not UTF-8.
    NotUtf8 {
        /// Offset of the first bad byte.
        at: usize,
    },
    /// Starts with a byte order mark.
    ByteOrderMark,
    /// Not JSON.
    Syntax(String),
    /// A member name occurs twice in one object; the last one counts.
    DuplicateMember(String),
    /// JSON, but not an object.
    NotAnObject,
}

impl std::fmt::Display for JsonProblem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::TooBig { length } => write!(f, "{length} bytes are too many to parse"),
            Self::TooDeep => write!(
                f,
                "objects and lists lie in one another more than {DEPTH} deep, which is not parsed"
            ),
            Self::Empty => f.write_str("the payload is empty"),
            Self::NotUtf8 { at } => write!(f, "not UTF-8 from byte {at}"),
            Self::ByteOrderMark => f.write_str("starts with a byte order mark"),
            Self::Syntax(text) => write!(f, "not JSON: {text}"),
            Self::DuplicateMember(name) => write!(f, "member {name:?} occurs twice"),
            Self::NotAnObject => f.write_str("the root is not an object"),
        }
    }
}

impl Parsed {
    /// Parses a payload.
    #[must_use]
    pub fn of(payload: &Payload) -> Self {
        match payload {
            Payload::Cut { length, .. } => Self {
                value: None,
                problems: vec![JsonProblem::TooBig { length: *length }],
            },
            Payload::Whole(bytes) => Self::of_bytes(bytes),
        }
    }

    /// Parses bytes.
    #[must_use]
    pub fn of_bytes(bytes: &[u8]) -> Self {
        let mut problems = Vec::new();
        if bytes.is_empty() {
            return Self {
                value: None,
                problems: vec![JsonProblem::Empty],
            };
        }
        let bytes = bytes
            .strip_prefix(b"\xef\xbb\xbf")
            .inspect(|_| problems.push(JsonProblem::ByteOrderMark))
            .unwrap_or(bytes);
        if let Err(error) = std::str::from_utf8(bytes) {
            problems.push(JsonProblem::NotUtf8 {
                at: error.valid_up_to(),
            });
            return Self { value: None, problems };
        }
        let mut duplicates = Vec::new();
        let mut deserializer = serde_json::Deserializer::from_slice(bytes);
        let read = Strict {
            duplicates: &mut duplicates,
        }
        .deserialize(&mut deserializer)
        .and_then(|value| deserializer.end().map(|()| value));
        problems.extend(duplicates.into_iter().map(JsonProblem::DuplicateMember));
        match read {
            Ok(value) => {
                if !value.is_object() {
                    problems.push(JsonProblem::NotAnObject);
                }
                Self {
                    value: Some(value),
                    problems,
                }
            }
            Err(error) => {
                let text = error.to_string();
                problems.push(if text.starts_with(TOO_DEEP) {
                    JsonProblem::TooDeep
                } else {
                    JsonProblem::Syntax(text)
                });
                Self { value: None, problems }
            }
        }
    }

    /// The value, if there is one.
    #[must_use]
    pub fn value(&self) -> Option<&Value> {
        self.value.as_ref()
    }

    /// About how many bytes of memory the value takes.
    #[must_use]
    pub fn weight(&self) -> u64 {
        self.value.as_ref().map_or(0, weight)
    }

    /// What is wrong with the bytes.
    #[must_use]
    pub fn problems(&self) -> &[JsonProblem] {
        &self.problems
    }
}

/// A value with all that lies in it, as it is held in memory.
fn weight(value: &Value) -> u64 {
    const ONE: u64 = size_of::<Value>() as u64;
    /// Hash, index and room to grow of a member.
    const MEMBER: u64 = 3 * size_of::<String>() as u64;
    ONE + match value {
        Value::String(text) => text.len() as u64,
        Value::Array(items) => items.iter().map(weight).sum(),
        Value::Object(members) => members
            .iter()
            .map(|(name, value)| MEMBER + name.len() as u64 + weight(value))
            .sum(),
        Value::Null | Value::Bool(_) | Value::Number(_) => 0,
    }
}

struct Strict<'a> {
    duplicates: &'a mut Vec<String>,
}

impl<'de> DeserializeSeed<'de> for Strict<'_> {
    type Value = Value;

    fn deserialize<D: serde::Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Strict<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(Number::from_f64(value).map_or(Value::Null, Value::Number))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_string<E>(self, value: String) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut all = Vec::new();
        while let Some(item) = items.next_element_seed(Strict {
            duplicates: self.duplicates,
        })? {
            all.push(item);
        }
        Ok(Value::Array(all))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Value, A::Error> {
        let mut all = Map::new();
        while let Some(name) = members.next_key::<String>()? {
            let value = members.next_value_seed(Strict {
                duplicates: self.duplicates,
            })?;
            if all.insert(name.clone(), value).is_some() {
                self.duplicates.push(name);
            }
        }
        Ok(Value::Object(all))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_duplicate_member_is_named_and_the_last_one_counts() {
        let parsed = Parsed::of_bytes(br#"{"a":1,"b":{"a":1,"a":2}}"#);
        assert_eq!(parsed.problems(), [JsonProblem::DuplicateMember("a".into())]);
        assert_eq!(parsed.value().and_then(|v| v.pointer("/b/a")), Some(&Value::from(2)));
    }

    #[test]
    fn what_is_not_json_is_said_so() {
        assert_eq!(Parsed::of_bytes(b"").problems(), [JsonProblem::Empty]);
        assert_eq!(
            Parsed::of_bytes(b"{\"a\":\"\xff\"}").problems(),
            [JsonProblem::NotUtf8 { at: 6 }]
        );
        assert!(matches!(
            Parsed::of_bytes(b"{\"a\":NaN}").problems(),
            [JsonProblem::Syntax(_)]
        ));
        assert!(matches!(
            Parsed::of_bytes(b"{} {}").problems(),
            [JsonProblem::Syntax(_)]
        ));
        assert_eq!(Parsed::of_bytes(b"[]").problems(), [JsonProblem::NotAnObject]);
        assert_eq!(
            Parsed::of_bytes(b"\xef\xbb\xbf{}").problems(),
            [JsonProblem::ByteOrderMark]
        );
    }

    #[test]
    fn deep_nesting_is_an_error_and_not_a_crash() {
        let deep = vec![b'['; 200_000];
        assert_eq!(Parsed::of_bytes(&deep).problems(), [JsonProblem::TooDeep]);
    }

    #[test]
    fn what_is_too_deep_is_not_called_something_else_than_json() {
        let nested = |levels: usize| format!("{{\"x\":{}{}}}", "[".repeat(levels), "]".repeat(levels));
        assert_eq!(Parsed::of_bytes(nested(DEPTH - 1).as_bytes()).problems(), []);
        assert_eq!(
            Parsed::of_bytes(nested(DEPTH).as_bytes()).problems(),
            [JsonProblem::TooDeep]
        );
    }

    #[test]
    fn a_value_weighs_what_it_holds_and_not_what_it_was_written_with() {
        let short = format!("[{}0]", "0,".repeat(9_999));
        let weight = Parsed::of_bytes(short.as_bytes()).weight();
        assert!(weight > 10_000 * size_of::<Value>() as u64, "{weight}");
        assert!(Parsed::of_bytes(b"").weight() == 0);
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let _ = Parsed::of_bytes(&bytes);
        }

        #[test]
        fn agrees_with_serde_json_on_what_it_writes(text in "[a-z]{0,5}", number in any::<i64>(), flag in any::<bool>()) {
            let value = serde_json::json!({ "text": text, "list": [number, flag, null] });
            let parsed = Parsed::of_bytes(value.to_string().as_bytes());
            prop_assert_eq!(parsed.value(), Some(&value));
        }
    }
}
