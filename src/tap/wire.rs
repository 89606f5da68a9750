//! From a stream of bytes to MQTT packets: framing by us, decoding by `mqtt5_protocol`.
//!
//! Whatever a peer sends is cut into [`Piece`]s that together are exactly the bytes received, so that the tap
//! can forward them untouched. A piece that is not an MQTT packet says what is wrong with it.

use std::collections::HashMap;

use bytes::{Buf, Bytes, BytesMut};
use mqtt5_protocol::packet::{FixedHeader, Packet as Decoded, PacketType};
use mqtt5_protocol::{PropertyId, PropertyValue};

use crate::journal::event::{Filter, Packet, Payload, Will};

/// Longest packet that is held until it is complete. Longer ones are forwarded as they come and not decoded.
pub const LONGEST_PACKET: usize = 64 << 20;

/// A part of the stream.
#[derive(Clone, Debug)]
pub struct Piece {
    /// The bytes as they came.
    pub raw: Bytes,
    /// The packet in them, or what is wrong with them.
    pub content: Result<Packet, String>,
}

/// Cuts one direction of a connection into pieces.
#[derive(Debug, Default)]
pub struct Reader {
    buffer: BytesMut,
    /// Protocol level of the connection, as the CONNECT packet has it.
    level: Option<u8>,
    /// Why the stream cannot be cut into packets any more.
    lost: Option<String>,
    aliases: HashMap<u16, String>,
}

impl Reader {
    /// Tells the direction towards the device which protocol level its CONNECT asked for.
    pub fn set_level(&mut self, level: u8) {
        self.level = Some(level);
    }

    /// Protocol level of the connection, once a CONNECT was read.
    #[must_use]
    pub fn level(&self) -> Option<u8> {
        self.level
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
            return Some(Piece {
                raw: self.buffer.split().freeze(),
                content: Err(reason),
            });
        }
        let (head, body) = match frame(&self.buffer) {
            Frame::Partial => return None,
            Frame::Whole { head, body } => (head, body),
            Frame::Broken(reason) => {
                self.lost = Some(reason);
                return self.next_piece();
            }
        };
        if self.buffer.len() < head + body {
            self.buffer.reserve(head + body - self.buffer.len());
            return None;
        }
        let raw = self.buffer.split_to(head + body).freeze();
        let content = self.decode(raw[0], &raw.slice(head..));
        Some(Piece { raw, content })
    }

    /// What is left when the stream ends: the beginning of a packet that never became whole.
    pub fn rest(&mut self) -> Option<Piece> {
        if self.buffer.is_empty() {
            return None;
        }
        Some(Piece {
            raw: self.buffer.split().freeze(),
            content: Err("the connection ended in the middle of a packet".to_owned()),
        })
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
