//! From a stream of bytes to MQTT packets: framing by us, decoding by `mqtt5_protocol`.
//!
//! Whatever a peer sends is cut into [`Piece`]s that together are exactly the bytes received, so that the tap
//! can forward them untouched. A piece that is not an MQTT packet says what is wrong with it.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

use std::collections::HashMap;

use bytes::{Buf, Bytes, BytesMut};
use mqtt5_protocol::packet::{FixedHeader, Packet as Decoded, PacketType};
use mqtt5_protocol::{PropertyId, PropertyValue};

use tck_journal::event::{Filter, Packet, Payload, Will};

/// Longest packet that is held until it is complete. Longer ones are forwarded as they come and not decoded.
pub const LONGEST_PACKET: usize = 64 << 20;

/// Packet type of CONNECT.
const CONNECT: u8 = 1;
/// Fixed header, protocol name and level, flags and keep-alive of a CONNECT have at least this many bytes.
const HARMLESS: usize = 12;

/// What the body of a CONNECT begins with.
const PROTOCOLS: [&[u8]; 2] = [b"\x00\x04MQTT", b"\x00\x06MQIsdp"];

/// A part of the stream.
#[derive(Clone, Debug)]
pub struct Piece {
    /// The bytes as they came.
    pub raw: Bytes,
    /// The packet in them, or what is wrong with them.
    pub content: Result<Packet, String>,
    /// How many of the first bytes cannot hold a password, should they have to be shown.
    harmless: usize,
}

impl Piece {
    /// The bytes as they may be recorded: those of what may be a CONNECT only as far as no password can be among them.
    #[must_use]
    pub fn evidence(&self) -> Bytes {
        self.raw.slice(..self.raw.len().min(self.harmless))
    }
}

/// Cuts one direction of a connection into pieces.
#[derive(Debug, Default)]
pub struct Reader {
    buffer: BytesMut,
    /// Protocol level of the connection, as the CONNECT packet has it.
    level: Option<u8>,
    /// Why the stream cannot be cut into packets any more.
    lost: Option<String>,
    /// Whether that happened in a CONNECT.
    lost_in_connect: bool,
    /// Whether a CONNECT has to come first and has not come, or could not be read: what cannot be read either may be a part of it.
    doubtful: bool,
    /// Whether a piece was cut already.
    begun: bool,
    aliases: HashMap<u16, String>,
}

impl Reader {
    /// Of what a client says from the beginning of its connection: what comes in the place of its CONNECT and cannot be read may
    /// be a CONNECT.
    #[must_use]
    pub fn of_client() -> Self {
        Self {
            doubtful: true,
            ..Self::default()
        }
    }

    /// Tells the direction towards the device which protocol level its CONNECT asked for.
    pub fn set_level(&mut self, level: u8) {
        self.level = Some(level);
    }

    /// Protocol level of the connection, once a CONNECT was read.
    #[must_use]
    pub fn level(&self) -> Option<u8> {
        self.level
    }

    /// Whether all that was taken was given out as packets, so that what comes next begins one.
    #[must_use]
    pub fn is_between_packets(&self) -> bool {
        self.buffer.is_empty() && self.lost.is_none()
    }

    /// Takes what was received.
    pub fn push(&mut self, bytes: &[u8]) {
        self.buffer.extend_from_slice(bytes);
    }

    /// The next complete piece; `None` while more bytes are needed.
    pub fn next_piece(&mut self) -> Option<Piece> {
        if self.buffer.is_empty() {
            return None;
        }
        if let Some(reason) = &self.lost {
            let reason = reason.clone();
            let raw = self.buffer.split().freeze();
            return Some(self.piece(raw, Err(reason), self.lost_in_connect));
        }
        let (head, body) = match frame(&self.buffer) {
            Frame::Partial => return None,
            Frame::Whole { head, body } => (head, body),
            Frame::Broken(reason) => {
                self.lost_in_connect = self.doubtful || self.buffer[0] >> 4 == CONNECT;
                self.lost = Some(reason);
                return self.next_piece();
            }
        };
        if self.buffer.len() < head + body {
            self.buffer.reserve(head + body - self.buffer.len());
            return None;
        }
        let raw = self.buffer.split_to(head + body).freeze();
        let is_connect = raw[0] >> 4 == CONNECT;
        let body = raw.slice(head..);
        if self.doubtful && !is_connect && PROTOCOLS.iter().any(|name| body.starts_with(name)) {
            let reason = format!("packet type {} with the content of a CONNECT", raw[0] >> 4);
            return Some(self.piece(raw, Err(reason), true));
        }
        let content = self.decode(raw[0], &body);
        if is_connect {
            self.doubtful = content.is_err();
        }
        let secret = self.doubtful && content.is_err();
        Some(self.piece(raw, content, secret))
    }

    /// What is left when the stream ends: the beginning of a packet that never became whole.
    pub fn rest(&mut self) -> Option<Piece> {
        if self.buffer.is_empty() {
            return None;
        }
        let reason = "the connection ended in the middle of a packet".to_owned();
        let secret = self.doubtful || self.lost_in_connect;
        let raw = self.buffer.split().freeze();
        Some(self.piece(raw, Err(reason), secret))
    }

    /// A piece of the stream; a secret one may hold a password.
    fn piece(&mut self, raw: Bytes, content: Result<Packet, String>, secret: bool) -> Piece {
        let is_first = !std::mem::replace(&mut self.begun, true);
        let is_connect = raw.first().is_some_and(|first| first >> 4 == CONNECT);
        let harmless = if is_connect || (secret && is_first) {
            HARMLESS
        } else if secret {
            0
        } else {
            usize::MAX
        };
        Piece { raw, content, harmless }
    }

    fn decode(&mut self, first: u8, body: &Bytes) -> Result<Packet, String> {
        let kind = PacketType::from_u8(first >> 4).ok_or_else(|| format!("packet type {} is reserved", first >> 4))?;
        let length = u32::try_from(body.len()).unwrap_or(u32::MAX);
        let header = FixedHeader::new(kind, first & 0x0f, length);
        if kind == PacketType::Connect {
            let (level, body) = connect_level(body);
            if level.is_some() {
                self.level = level;
            }
            return convert(whole(kind, header, body, 4)?, level);
        }
        // 3.1 has the packets of 3.1.1; anything a CONNECT did not announce is read as 3.1.1 too.
        let version = if self.level == Some(5) { 5 } else { 4 };
        if kind == PacketType::ConnAck {
            whole(kind, header, body.clone(), version)?;
            let [flags, code, ..] = body[..] else {
                return Err("CONNACK is too short".to_owned());
            };
            return Ok(Packet::Connack {
                code,
                session_present: flags & 1 == 1,
            });
        }
        let decoded = whole(kind, header, body.clone(), version)?;
        let alias = match &decoded {
            Decoded::Publish(publish) => match publish.properties.get(PropertyId::TopicAlias) {
                Some(PropertyValue::TwoByteInteger(alias)) => Some(*alias),
                _ => None,
            },
            _ => None,
        };
        let mut packet = convert(decoded, None)?;
        if let (Some(alias), Packet::Publish { topic, .. }) = (alias, &mut packet) {
            if topic.is_empty() {
                let known = self.aliases.get(&alias);
                topic.clone_from(known.ok_or_else(|| format!("topic alias {alias} was never given a topic"))?);
            } else {
                self.aliases.insert(alias, topic.clone());
            }
        }
        Ok(packet)
    }
}

enum Frame {
    Partial,
    Whole { head: usize, body: usize },
    Broken(String),
}

/// Reads the fixed header.
fn frame(bytes: &[u8]) -> Frame {
    let mut body = 0;
    for (index, byte) in bytes.iter().skip(1).take(4).enumerate() {
        body |= usize::from(byte & 0x7f) << (7 * index);
        if byte & 0x80 == 0 {
            if body > LONGEST_PACKET {
                return Frame::Broken(format!(
                    "a packet of {body} bytes is longer than the {LONGEST_PACKET} that are decoded"
                ));
            }
            return Frame::Whole { head: index + 2, body };
        }
    }
    if bytes.len() > 4 {
        Frame::Broken("the remaining length has more than four bytes; the stream cannot be cut into packets".to_owned())
    } else {
        Frame::Partial
    }
}

/// How many packets these bytes are: nothing when they are not whole packets from the first byte to the last, or a CONNECT is
/// among them. Looks at the lengths only.
#[must_use]
pub fn whole_packets(bytes: &[u8]) -> Option<u32> {
    let mut rest = bytes;
    let mut count = 0;
    while let Some(first) = rest.first() {
        if first >> 4 == CONNECT {
            return None;
        }
        let Frame::Whole { head, body } = frame(rest) else {
            return None;
        };
        rest = rest.get(head + body..)?;
        count += 1;
    }
    Some(count).filter(|count| *count > 0)
}

/// Decodes one packet and insists that nothing is left over.
fn whole(kind: PacketType, header: FixedHeader, mut body: Bytes, version: u8) -> Result<Decoded, String> {
    let decoded =
        Decoded::decode_from_body_with_version(kind, &header, &mut body, version).map_err(|error| error.to_string())?;
    if body.has_remaining() {
        return Err(format!(
            "{} bytes are left over after {}",
            body.remaining(),
            decoded.packet_type_name()
        ));
    }
    Ok(decoded)
}

/// The protocol level of a CONNECT, and its body in a form the decoder reads: MQTT 3.1 differs from 3.1.1 in
/// the protocol's name and level only.
fn connect_level(body: &Bytes) -> (Option<u8>, Bytes) {
    const OLD: &[u8] = b"\x00\x06MQIsdp\x03";
    const NEW: &[u8] = b"\x00\x04MQTT\x04";
    if let Some(rest) = body.strip_prefix(OLD) {
        return (Some(3), [NEW, rest].concat().into());
    }
    (
        body.starts_with(&NEW[..6]).then(|| body.get(6).copied()).flatten(),
        body.clone(),
    )
}

fn convert(packet: Decoded, level: Option<u8>) -> Result<Packet, String> {
    let ack = |name: &str, packet_id| Packet::Ack {
        name: name.to_owned(),
        packet_id,
    };
    Ok(match packet {
        Decoded::Connect(connect) => {
            let level = level.unwrap_or(connect.protocol_version);
            if !(3..=5).contains(&level) {
                return Err(format!("CONNECT has protocol level {level}"));
            }
            Packet::Connect {
                level,
                client_id: connect.client_id,
                keep_alive: connect.keep_alive,
                clean_session: connect.clean_start,
                username: connect.username,
                has_password: connect.password.is_some(),
                will: connect.will.map(|will| Will {
                    topic: will.topic,
                    payload: Payload::keep(will.payload.into()),
                    qos: will.qos.into(),
                    retain: will.retain,
                }),
            }
        }
        Decoded::ConnAck(connack) => Packet::Connack {
            code: connack.reason_code.into(),
            session_present: connack.session_present,
        },
        Decoded::Publish(publish) => Packet::Publish {
            topic: publish.topic_name,
            qos: publish.qos.into(),
            retain: publish.retain,
            dup: publish.dup,
            packet_id: publish.packet_id,
            payload: Payload::keep(publish.payload),
        },
        Decoded::Subscribe(subscribe) => Packet::Subscribe {
            packet_id: subscribe.packet_id,
            filters: subscribe
                .filters
                .into_iter()
                .map(|filter| Filter {
                    filter: filter.filter,
                    qos: filter.options.qos.into(),
                })
                .collect(),
        },
        Decoded::SubAck(suback) => Packet::Suback {
            packet_id: suback.packet_id,
            codes: suback.reason_codes.into_iter().map(|code| code as u8).collect(),
        },
        Decoded::Unsubscribe(unsubscribe) => Packet::Unsubscribe {
            packet_id: unsubscribe.packet_id,
            filters: unsubscribe.filters,
        },
        Decoded::Disconnect(disconnect) => Packet::Disconnect {
            code: disconnect.reason_code.into(),
        },
        Decoded::PubAck(packet) => ack("puback", packet.packet_id),
        Decoded::PubRec(packet) => ack("pubrec", packet.packet_id),
        Decoded::PubRel(packet) => ack("pubrel", packet.packet_id),
        Decoded::PubComp(packet) => ack("pubcomp", packet.packet_id),
        Decoded::UnsubAck(packet) => ack("unsuback", packet.packet_id),
        Decoded::PingReq => Packet::Pingreq,
        Decoded::PingResp => Packet::Pingresp,
        Decoded::Auth(_) => Packet::Auth,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn pieces(reader: &mut Reader) -> Vec<Piece> {
        std::iter::from_fn(|| reader.next_piece()).collect()
    }

    fn one(bytes: &[u8]) -> Result<Packet, String> {
        let mut reader = Reader::default();
        reader.push(bytes);
        let mut all = pieces(&mut reader);
        assert_eq!(all.len(), 1, "{all:?}");
        all.remove(0).content
    }

    #[test]
    fn a_connect_with_everything_in_it_is_read_and_its_password_is_not_kept() {
        let raw = b"\x10\x27\x00\x04MQTT\x04\xee\x00\x0f\x00\x02id\x00\x03d/c\x00\x06broken\x00\x02me\x00\x06\xffsecre";
        let packet = one(raw).unwrap();
        let Packet::Connect {
            level,
            client_id,
            keep_alive,
            clean_session,
            username,
            has_password,
            will,
        } = &packet
        else {
            panic!("{packet:?}");
        };
        assert_eq!(
            (*level, client_id.as_str(), *keep_alive, *clean_session),
            (4, "id", 15, true)
        );
        assert_eq!((username.as_deref(), *has_password), (Some("me"), true));
        let will = will.as_ref().unwrap();
        assert_eq!(
            (will.topic.as_str(), will.payload.bytes(), will.qos, will.retain),
            ("d/c", &b"broken"[..], 1, true)
        );
        assert!(!serde_json::to_string(&packet).unwrap().contains("secre"));
    }

    #[test]
    fn a_password_is_not_kept_from_a_connect_that_cannot_be_read() {
        for raw in [
            &b"\x10\x17\x00\x04MQTT\x04\xc3\x00\x0f\x00\x02id\x00\x01u\x00\x04s3cr"[..],
            b"\x10\xff\xff\xff\xff\x04MQTT\x04\xc3\x00\x0f\x00\x02id\x00\x01u\x00\x04s3cr",
            b"\x10\x70\x00\x04MQTT\x04\xc2\x00\x0f\x00\x02id\x00\x01u\x00\x04s3cr",
        ] {
            let mut reader = Reader::default();
            reader.push(raw);
            let piece = reader.next_piece().or_else(|| reader.rest()).unwrap();
            assert!(piece.content.is_err());
            assert!(!piece.evidence().windows(4).any(|part| part == b"s3cr"), "{piece:?}");
            assert_eq!(piece.raw, raw, "it is forwarded untouched");
        }
    }

    #[test]
    fn a_password_is_not_kept_from_what_may_be_a_connect() {
        let connect = b"\x10\x17\x00\x04MQTT\x04\xc2\x00\x0f\x00\x02id\x00\x01u\x00\x04s3cr";
        let mut damaged: Vec<Vec<u8>> = (0..=15_u8)
            .map(|kind| [&[kind << 4][..], &connect[1..]].concat())
            .collect();
        // A second one whose length is too short: what is left over looks like packets of its own.
        damaged.extend((8..0x17).map(|length| [&connect[..], &[0x10, length], &connect[2..]].concat()));
        damaged.extend((8..0x17).map(|length| [&[0x10, length], &connect[2..]].concat()));
        for bytes in damaged {
            let mut reader = Reader::of_client();
            reader.push(&bytes);
            let mut all = pieces(&mut reader);
            all.extend(reader.rest());
            let raw: Vec<u8> = all.iter().flat_map(|piece| piece.raw.to_vec()).collect();
            assert_eq!(raw, bytes, "it is forwarded untouched");
            for piece in all {
                let kept = match &piece.content {
                    Ok(packet) => serde_json::to_vec(packet).expect("JSON"),
                    Err(_) => piece.evidence().to_vec(),
                };
                assert!(!kept.windows(4).any(|part| part == b"s3cr"), "{bytes:x?}: {piece:?}");
            }
        }
    }

    #[test]
    fn packets_are_counted_when_they_are_whole_and_no_connect() {
        let two = b"\xc0\x00\x30\x05\x00\x01tok";
        assert_eq!(whole_packets(two), Some(2));
        assert_eq!(whole_packets(b""), None);
        for end in [1, 3, two.len() - 1] {
            assert_eq!(whole_packets(&two[..end]), None, "{end}");
        }
        assert_eq!(
            whole_packets(b"\xc0\x00\x10\x02ab"),
            None,
            "a CONNECT may have to be changed"
        );
        assert_eq!(whole_packets(b"\x30\xff\xff\xff\xff\x01"), None);
    }

    #[test]
    fn an_unknown_protocol_level_is_named() {
        let error = one(b"\x10\x0e\x00\x04MQTT\x06\x02\x00\x00\x00\x02id").unwrap_err();
        assert!(error.contains("level 6"), "{error}");
    }

    #[test]
    fn what_is_left_over_after_a_packet_is_named() {
        let error = one(b"\xc0\x01x").unwrap_err();
        assert!(error.contains("1 bytes are left over after PINGREQ"), "{error}");
    }

    #[test]
    fn a_broken_packet_does_not_end_the_stream() {
        let mut reader = Reader::default();
        reader.push(b"\x30\x05\x00\x03\xff\xfe\xfd\xc0\x00");
        let all = pieces(&mut reader);
        assert!(all[0].content.is_err());
        assert_eq!(all[1].content, Ok(Packet::Pingreq));
    }

    #[test]
    fn a_length_that_cannot_be_turns_the_rest_into_garbage() {
        let mut reader = Reader::default();
        reader.push(b"\xc0\x00\x30\xff\xff\xff\xff\xff\xc0\x00");
        let all = pieces(&mut reader);
        assert_eq!(all.len(), 2);
        assert!(all[0].content.is_ok() && all[1].content.is_err());
    }

    #[test]
    fn a_topic_alias_of_mqtt_5_is_given_back_its_topic() {
        let mut reader = Reader::default();
        reader.set_level(5);
        reader.push(b"\x30\x09\x00\x01t\x03\x23\x00\x01hi\x30\x08\x00\x00\x03\x23\x00\x01ho");
        let topics: Vec<_> = (pieces(&mut reader).into_iter())
            .map(|piece| match piece.content.unwrap() {
                Packet::Publish { topic, .. } => topic,
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!(topics, ["t", "t"]);
    }

    proptest! {
        #[test]
        fn what_is_counted_is_what_is_cut(packets in proptest::collection::vec((2_u8..16, 0_usize..300), 1..6)) {
            let mut bytes = Vec::new();
            for (kind, length) in &packets {
                bytes.push(kind << 4);
                if *length > 127 {
                    bytes.push(u8::try_from(length % 128).unwrap() | 0x80);
                    bytes.push(u8::try_from(length / 128).unwrap());
                } else {
                    bytes.push(u8::try_from(*length).unwrap());
                }
                bytes.resize(bytes.len() + length, 0);
            }
            let mut reader = Reader::default();
            reader.push(&bytes);
            prop_assert_eq!(whole_packets(&bytes).map(|count| count as usize), Some(pieces(&mut reader).len()));
            prop_assert!(reader.is_between_packets());
        }

        #[test]
        fn pieces_are_the_bytes_received_whatever_they_are(
            bytes in proptest::collection::vec(any::<u8>(), 0..400),
            cut in 0_usize..400,
            level in 0_u8..6,
        ) {
            let cut = cut.min(bytes.len());
            let mut reader = Reader::default();
            if level > 2 {
                reader.set_level(level);
            }
            let mut raw = Vec::new();
            for part in [&bytes[..cut], &bytes[cut..]] {
                reader.push(part);
                raw.extend(pieces(&mut reader).into_iter().flat_map(|piece| piece.raw));
            }
            raw.extend(reader.rest().into_iter().flat_map(|piece| piece.raw));
            prop_assert_eq!(raw, bytes);
        }

        #[test]
        fn almost_valid_packets_never_panic(kind in 1_u8..16, flags in 0_u8..16, body in proptest::collection::vec(any::<u8>(), 0..120), level in 3_u8..6) {
            let mut reader = Reader::default();
            reader.set_level(level);
            let mut packet = vec![kind << 4 | flags, u8::try_from(body.len()).unwrap()];
            packet.extend(body);
            reader.push(&packet);
            prop_assert_eq!(pieces(&mut reader).len(), 1);
        }
    }
}
