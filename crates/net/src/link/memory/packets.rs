//! The packets of the in-memory bus, and how they look in the journal.

use bytes::Bytes;

use super::broker::Delivery;
use tck_base::device::{ConnectOptions, Publication};
use tck_journal::event::{Filter, Packet, Payload, Will};

/// From the device.
#[derive(Clone, Debug)]
pub(super) enum Up {
    Connect(ConnectOptions),
    Subscribe(u16, Vec<(String, u8)>),
    Publish(Publication, u16, bool),
    Ack(&'static str, u16),
    Ping,
    Disconnect,
    Raw(Bytes),
    /// Bytes the broker cannot read.
    Garbage,
    Close,
}

/// To the device.
#[derive(Clone, Debug)]
pub(super) enum Down {
    Connack(bool),
    Suback(u16, Vec<u8>),
    Publish(Delivery, u16, bool),
    Ack(&'static str, u16),
    Pong,
    Close,
}

pub(super) fn connect_packet(connect: &ConnectOptions) -> Packet {
    Packet::Connect {
        level: connect.level,
        client_id: connect.client_id.clone(),
        keep_alive: u16::try_from(connect.keep_alive.as_secs()).unwrap_or(u16::MAX),
        clean_session: connect.clean_session,
        username: None,
        has_password: false,
        will: connect.will.as_ref().map(|will| Will {
            topic: will.topic.clone(),
            payload: Payload::keep(will.payload.clone()),
            qos: will.qos,
            retain: will.retain,
        }),
    }
}

fn publish_packet(message: &Publication, packet_id: u16, dup: bool) -> Packet {
    Packet::Publish {
        topic: message.topic.clone(),
        qos: message.qos,
        retain: message.retain,
        dup,
        packet_id: (message.qos > 0).then_some(packet_id),
        payload: Payload::keep(message.payload.clone()),
    }
}

fn ack_packet(name: &str, packet_id: u16) -> Packet {
    Packet::Ack {
        name: name.to_owned(),
        packet_id,
    }
}

pub(super) fn up_packet(up: &Up) -> Option<Packet> {
    Some(match up {
        Up::Connect(connect) => connect_packet(connect),
        Up::Subscribe(packet_id, filters) => Packet::Subscribe {
            packet_id: *packet_id,
            filters: filters
                .iter()
                .map(|(filter, qos)| Filter {
                    filter: filter.clone(),
                    qos: *qos,
                })
                .collect(),
        },
        Up::Publish(message, packet_id, dup) => publish_packet(message, *packet_id, *dup),
        Up::Ack(name, packet_id) => ack_packet(name, *packet_id),
        Up::Ping => Packet::Pingreq,
        Up::Disconnect => Packet::Disconnect { code: 0 },
        Up::Raw(_) | Up::Garbage | Up::Close => return None,
    })
}

pub(super) fn down_packet(down: &Down) -> Option<Packet> {
    Some(match down {
        Down::Connack(session_present) => Packet::Connack {
            code: 0,
            session_present: *session_present,
        },
        Down::Suback(packet_id, codes) => Packet::Suback {
            packet_id: *packet_id,
            codes: codes.clone(),
        },
        Down::Publish(delivery, packet_id, dup) => {
            let Delivery {
                topic,
                payload,
                qos,
                retain,
            } = delivery.clone();
            publish_packet(
                &Publication {
                    topic,
                    payload,
                    qos,
                    retain,
                },
                *packet_id,
                *dup,
            )
        }
        Down::Ack(name, packet_id) => ack_packet(name, *packet_id),
        Down::Pong => Packet::Pingresp,
        Down::Close => return None,
    })
}
