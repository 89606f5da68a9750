//! The map server: offers files to a device over HTTP, well or badly.

use std::time::Duration;

use bytes::Bytes;

/// How long a `slow` transfer takes.
pub const SLOW_TRANSFER: Duration = Duration::from_secs(6);
/// How long a device of ours waits for a server that says nothing.
pub const FETCH_TIMEOUT: Duration = Duration::from_secs(10);

/// Bytes of the same length as `body` that are not `body`: what `wrong-bytes` serves.
#[must_use]
pub fn wrong_bytes(body: &Bytes) -> Bytes {
    let mut wrong = body.to_vec();
    match wrong.last_mut() {
        Some(last) => *last ^= 1,
        None => wrong.push(0),
    }
    wrong.into()
}

/// The path an offer of this name has on the server. Names come from suites; what is not a plain character is
/// percent-encoded.
#[must_use]
pub fn path_of(name: &str) -> String {
    use std::fmt::Write as _;
    let mut path = String::from("/");
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            path.push(char::from(byte));
        } else {
            let _ = write!(path, "%{byte:02X}");
        }
    }
    path
}
