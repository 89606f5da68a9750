//! A JSON Schema, compiled. Here and in `schema` alone the schema crate is named.

use std::fmt;

use jsonschema::{Draft, ValidationError};
use serde_json::Value;

/// At most this many characters of what somebody else wrote in a message of ours.
const MAX_SHOWN: usize = 80;

/// A compiled schema, formats asserted.
pub(super) struct Validator(jsonschema::Validator);

impl fmt::Debug for Validator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Validator")
    }
}

impl Validator {
    /// Compiles a schema.
    ///
    /// # Errors
    /// It is none; in one line.
    pub(super) fn of(raw: &Value) -> Result<Self, String> {
        jsonschema::options()
            .with_draft(Draft::Draft202012)
            .should_validate_formats(true)
            .build(raw)
            .map(Self)
            .map_err(|error| bounded(&error.to_string()))
    }

    /// Whether a value obeys.
    pub(super) fn is_valid(&self, value: &Value) -> bool {
        self.0.is_valid(value)
    }

    /// Where a value does not obey.
    pub(super) fn errors<'v>(&'v self, value: &'v Value) -> impl Iterator<Item = ValidationError<'v>> {
        self.0.iter_errors(value)
    }
}

/// A text, cut where it is long.
pub(super) fn bounded(text: &str) -> String {
    match text.char_indices().nth(MAX_SHOWN) {
        Some((at, _)) => format!("{}…", &text[..at]),
        None => text.to_owned(),
    }
}
