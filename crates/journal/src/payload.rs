//! A payload as it went over the wire, kept verbatim and bounded.

use base64::Engine as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

/// Payloads above this many bytes are kept by hash and prefix.
pub const PAYLOAD_LIMIT: usize = 1 << 20;
/// How much of an oversized payload is kept.
pub const PAYLOAD_PREFIX: usize = 4096;

/// A payload as it went over the wire, or what is left of it when it was too big.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Payload {
    /// All bytes.
    Whole(bytes::Bytes),
    /// Hash, length and the first bytes of an oversized payload.
    Cut {
        /// SHA-256 in hexadecimal.
        sha256: String,
        /// Length of the whole payload in bytes.
        length: u64,
        /// The first bytes.
        prefix: bytes::Bytes,
    },
}

impl Payload {
    /// Keeps `bytes` whole or cut, by [`PAYLOAD_LIMIT`].
    #[must_use]
    pub fn keep(bytes: bytes::Bytes) -> Self {
        if bytes.len() <= PAYLOAD_LIMIT {
            return Self::Whole(bytes);
        }
        Self::Cut {
            sha256: hex(&Sha256::digest(&bytes)),
            length: bytes.len() as u64,
            prefix: bytes.slice(..PAYLOAD_PREFIX),
        }
    }

    /// The bytes that were kept.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::Whole(bytes) | Self::Cut { prefix: bytes, .. } => bytes,
        }
    }

    /// Length on the wire in bytes.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "an empty payload is just one more length")]
    pub fn len(&self) -> u64 {
        match self {
            Self::Whole(bytes) => bytes.len() as u64,
            Self::Cut { length, .. } => *length,
        }
    }
}

/// Lower-case hexadecimal.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes
        .iter()
        .fold(String::with_capacity(bytes.len() * 2), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        })
}

fn bytes_to_value(bytes: &[u8]) -> Value {
    match std::str::from_utf8(bytes) {
        Ok(text) => Value::from(text),
        Err(_) => json!({ "base64": base64::engine::general_purpose::STANDARD.encode(bytes) }),
    }
}

fn value_to_bytes(value: Value) -> Result<bytes::Bytes, String> {
    if let Value::String(text) = value {
        return Ok(text.into());
    }
    let text = value
        .get("base64")
        .and_then(Value::as_str)
        .ok_or("a payload is a string or { base64 }")?;
    let bytes = base64::engine::general_purpose::STANDARD
        .decode(text)
        .map_err(|error| error.to_string())?;
    Ok(bytes.into())
}

impl Serialize for Payload {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Whole(bytes) => match std::str::from_utf8(bytes) {
                Ok(text) => serializer.serialize_str(text),
                Err(_) => bytes_to_value(bytes).serialize(serializer),
            },
            Self::Cut { sha256, length, prefix } => {
                json!({ "sha256": sha256, "length": length, "prefix": bytes_to_value(prefix) }).serialize(serializer)
            }
        }
    }
}

impl<'de> Deserialize<'de> for Payload {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        use serde::de::Error as _;
        let mut value = Value::deserialize(deserializer)?;
        if let Some(sha256) = value.get("sha256").and_then(Value::as_str) {
            return Ok(Self::Cut {
                sha256: sha256.to_owned(),
                length: value.get("length").and_then(Value::as_u64).unwrap_or_default(),
                prefix: value_to_bytes(value["prefix"].take()).map_err(D::Error::custom)?,
            });
        }
        value_to_bytes(value).map(Self::Whole).map_err(D::Error::custom)
    }
}
