//! MQTT control packets, decoded as far as a verdict can need them.

use serde::{Deserialize, Serialize};

use super::payload::Payload;

/// The last will of a CONNECT packet.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Will {
    /// Topic of the will.
    pub topic: String,
    /// Payload of the will.
    pub payload: Payload,
    /// QoS of the will.
    pub qos: u8,
    /// RETAIN of the will.
    pub retain: bool,
}

/// An MQTT control packet, decoded as far as a verdict can need it. Passwords are never kept.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", rename_all_fields = "camelCase")]
pub enum Packet {
    /// CONNECT.
    Connect {
        /// Protocol level byte: 3, 4 or 5.
        level: u8,
        /// Client identifier as the device sent it.
        client_id: String,
        /// Keep-alive in seconds; 0 is off.
        keep_alive: u16,
        /// Clean session (clean start in MQTT 5).
        clean_session: bool,
        /// User name, if one was sent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        username: Option<String>,
        /// Whether a password was sent.
        has_password: bool,
        /// The last will, if one was registered.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        will: Option<Will>,
    },
    /// CONNACK.
    Connack {
        /// Return or reason code; 0 accepts.
        code: u8,
        /// Whether the broker resumed a session.
        session_present: bool,
    },
    /// PUBLISH.
    Publish {
        /// Topic name.
        topic: String,
        /// QoS.
        qos: u8,
        /// RETAIN.
        retain: bool,
        /// DUP.
        dup: bool,
        /// Packet identifier, for QoS 1 and 2.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        packet_id: Option<u16>,
        /// The application message.
        payload: Payload,
    },
    /// SUBSCRIBE.
    Subscribe {
        /// Packet identifier.
        packet_id: u16,
        /// Topic filters.
        filters: Vec<Filter>,
    },
    /// SUBACK.
    Suback {
        /// Packet identifier.
        packet_id: u16,
        /// One code per filter.
        codes: Vec<u8>,
    },
    /// UNSUBSCRIBE.
    Unsubscribe {
        /// Packet identifier.
        packet_id: u16,
        /// Topic filters.
        filters: Vec<String>,
    },
    /// DISCONNECT.
    Disconnect {
        /// Reason code; 0 in MQTT 3.1.1.
        code: u8,
    },
    /// PUBACK, PUBREC, PUBREL, PUBCOMP or UNSUBACK.
    Ack {
        /// Name of the packet in lower case.
        name: String,
        /// Packet identifier.
        packet_id: u16,
    },
    /// PINGREQ.
    Pingreq,
    /// PINGRESP.
    Pingresp,
    /// AUTH (MQTT 5).
    Auth,
}

/// One topic filter of a SUBSCRIBE packet.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Filter {
    /// The filter.
    pub filter: String,
    /// The QoS asked for.
    pub qos: u8,
}

/// How a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Close {
    /// The device closed its side in order.
    DeviceFin,
    /// The device reset the connection.
    DeviceReset,
    /// The broker closed its side.
    Broker,
    /// The harness cut it.
    Harness,
}
