//! The map server: offers files to a device over HTTP, well or badly, and reports who fetched what.

mod server;

use std::fmt::Write as _;
use std::time::Duration;

use bytes::Bytes;

pub use server::MapServer;

/// How long a `slow` transfer takes.
pub const SLOW_TRANSFER: Duration = Duration::from_secs(1);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_bytes_have_the_length_of_the_right_ones_where_that_is_possible() {
        for body in [&b"map"[..], b"x", b"\x00\x01"] {
            let body = Bytes::copy_from_slice(body);
            let wrong = wrong_bytes(&body);
            assert_eq!(wrong.len(), body.len());
            assert_ne!(wrong, body);
        }
        assert_ne!(wrong_bytes(&Bytes::new()), Bytes::new());
    }

    #[test]
    fn a_path_has_plain_characters_only() {
        assert_eq!(path_of("hall-1.lif"), "/hall-1.lif");
        assert_eq!(path_of("hall 1/ä"), "/hall%201%2F%C3%A4");
    }
}
