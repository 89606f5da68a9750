//! Paths into a message.

use serde_json::Value;

use tck_view::{Names, Topic};

/// A path into a message: member names and array indices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Path {
    /// As written: `maps`, `agvPosition.x`, `errors[0].errorType`.
    pub text: String,
}

impl Path {
    /// The value at this path in a message of a topic, whose members have these names.
    #[must_use]
    pub fn of<'a>(&self, message: &'a Value, topic: &str, names: &Names) -> Option<&'a Value> {
        names
            .spelled_path(Topic::of_name(topic).object(), &self.text)
            .split(['.', '[', ']'])
            .filter(|part| !part.is_empty())
            .try_fold(message, |value, part| match value {
                Value::Array(items) => items.get(part.parse::<usize>().ok()?),
                other => other.get(part),
            })
    }
}
