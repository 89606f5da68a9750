//! What a CONNECT packet must become before the embedded broker accepts it.
//!
//! The embedded broker refuses client identifiers that could be a path, and does not speak MQTT 3.1. Neither is
//! the device's fault, so the tap translates. The journal keeps what the device sent.

use bytes::Bytes;
use sha2::{Digest, Sha256};

use tck_journal::event::hex;

/// Longest client identifier the embedded broker takes.
const LONGEST_ID: usize = 128;

/// The CONNECT packet in `raw` as the embedded broker must get it; unchanged when it can take it, or when it
/// is not understood.
pub(super) fn for_embedded_broker(raw: &Bytes) -> Bytes {
    rewrite(raw).unwrap_or_else(|| raw.clone())
}

fn rewrite(raw: &[u8]) -> Option<Bytes> {
    let length_bytes = raw.get(1..)?.iter().position(|byte| byte & 0x80 == 0)? + 1;
    let body = raw.get(1 + length_bytes..)?;
    let (name, rest) = field(body)?;
    let (&level, after_level) = rest.split_first()?;
    let old = name == b"MQIsdp" && level == 3;
    let flags_and_keep_alive = after_level.get(..3)?;
    let mut rest = after_level.get(3..)?;
    let mut properties: &[u8] = &[];
    if level == 5 {
        let (length, size) = variable_int(rest)?;
        properties = rest.get(..size + length)?;
        rest = rest.get(size + length..)?;
    }
    let (id, rest) = field(rest)?;
    let renamed = (!is_accepted(id)).then(|| format!("tck-{}", &hex(&Sha256::digest(id))[..40]));
    if renamed.is_none() && !old {
        return None;
    }
    let (name, level): (&[u8], u8) = if old { (b"MQTT", 4) } else { (name, level) };
    let id = renamed.as_deref().map_or(id, str::as_bytes);
    let mut body = Vec::with_capacity(raw.len() + 64);
    put_field(&mut body, name)?;
    body.push(level);
    body.extend_from_slice(flags_and_keep_alive);
    body.extend_from_slice(properties);
    put_field(&mut body, id)?;
    body.extend_from_slice(rest);
    let mut packet = vec![raw[0]];
    let mut length = body.len();
    loop {
        let low = u8::try_from(length % 128).ok()?;
        length /= 128;
        packet.push(if length > 0 { low | 0x80 } else { low });
        if length == 0 {
            break;
        }
    }
    packet.extend_from_slice(&body);
    Some(packet.into())
}

fn is_accepted(id: &[u8]) -> bool {
    id.len() <= LONGEST_ID
        && id != b"."
        && !id
            .iter()
            .any(|byte| matches!(byte, b'/' | b'\\') || *byte < 0x20 || *byte == 0x7f)
        && !id.windows(2).any(|pair| pair == b"..")
}

fn field(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<2>()?;
    rest.split_at_checked(u16::from_be_bytes(*length).into())
}

fn put_field(to: &mut Vec<u8>, bytes: &[u8]) -> Option<()> {
    to.extend_from_slice(&u16::try_from(bytes.len()).ok()?.to_be_bytes());
    to.extend_from_slice(bytes);
    Some(())
}

fn variable_int(bytes: &[u8]) -> Option<(usize, usize)> {
    let mut value = 0;
    for (index, byte) in bytes.iter().take(4).enumerate() {
        value |= usize::from(byte & 0x7f) << (7 * index);
        if byte & 0x80 == 0 {
            return Some((value, index + 1));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_journal::event::Packet;
    use tck_wire::Reader;

    fn connect(name: &[u8], level: u8, id: &[u8]) -> Bytes {
        let mut body = Vec::new();
        put_field(&mut body, name).unwrap();
        body.extend_from_slice(&[level, 2, 0, 15]);
        if level == 5 {
            body.extend_from_slice(&[5, 0x11, 0, 0, 0, 9]);
        }
        put_field(&mut body, id).unwrap();
        let mut packet = vec![0x10];
        assert!(body.len() < 128 * 128);
        packet.extend_from_slice(&[
            u8::try_from(body.len() % 128).unwrap() | 0x80,
            u8::try_from(body.len() / 128).unwrap(),
        ]);
        packet.extend_from_slice(&body);
        packet.into()
    }

    fn read(raw: &Bytes) -> (u8, String, u16) {
        let mut reader = Reader::default();
        reader.push(raw);
        match reader.next_piece().unwrap().content.unwrap() {
            Packet::Connect {
                level,
                client_id,
                keep_alive,
                ..
            } => (level, client_id, keep_alive),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_harmless_client_id_is_left_byte_for_byte() {
        let raw = connect(b"MQTT", 4, b"AGV-0001 (left)");
        assert_eq!(for_embedded_broker(&raw), raw);
    }

    #[test]
    fn client_ids_the_embedded_broker_refuses_get_another_name_that_stays_the_same() {
        for level in [4, 5] {
            for id in [&b"KIT/0001"[..], b"a\\b", b"a..b", &[b'x'; 200]] {
                let raw = connect(b"MQTT", level, id);
                let (got_level, renamed, keep_alive) = read(&for_embedded_broker(&raw));
                assert_eq!((got_level, keep_alive), (level, 15));
                assert!(
                    renamed.starts_with("tck-") && is_accepted(renamed.as_bytes()),
                    "{renamed}"
                );
                assert_eq!(for_embedded_broker(&raw), for_embedded_broker(&raw.clone()));
            }
        }
    }

    #[test]
    fn mqtt_3_1_becomes_3_1_1_and_is_still_read_as_3() {
        let raw = connect(b"MQIsdp", 3, b"old");
        assert_eq!(read(&raw).0, 3);
        assert_eq!(read(&for_embedded_broker(&raw)), (4, "old".to_owned(), 15));
    }

    #[test]
    fn what_is_not_understood_is_left_alone() {
        for bytes in [&b"\x10"[..], b"\x10\x02\x00\x09", b"\x10\x04\xff\xff\xff\xff", b""] {
            let raw = Bytes::copy_from_slice(bytes);
            assert_eq!(for_embedded_broker(&raw), raw);
        }
    }
}
