//! Payloads as recorders write them.

use base64::Engine as _;
use bytes::Bytes;

/// The bytes of a payload that is written as an object, as a text, or in base64.
pub(super) fn bytes_of(written: &str) -> Option<Bytes> {
    if written == "null" {
        return Some(Bytes::new());
    }
    if !written.starts_with('"') {
        return Some(Bytes::copy_from_slice(written.as_bytes()));
    }
    serde_json::from_str(written).ok().map(bytes_of_text)
}

/// The bytes of a payload that is written as a text, or in base64.
pub(super) fn bytes_of_text(text: String) -> Bytes {
    let is_json = text.trim_start().starts_with(['{', '[']);
    let decoded = || base64::engine::general_purpose::STANDARD.decode(text.trim()).ok();
    if let Some(bytes) = (!is_json && text.len() > 4).then(decoded).flatten()
        && bytes.trim_ascii_start().starts_with(b"{")
    {
        return bytes.into();
    }
    text.into_bytes().into()
}
