//! What tools call the parts of a message: `mosquitto_sub`, MQTTX, Node-RED, Telegraf, data bases of time series, and logs.

use super::Mapping;

/// A part of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Time,
    Topic,
    Payload,
    Qos,
    Retain,
}

impl Part {
    /// The name that the user gave.
    pub fn mapped(self, mapping: &Mapping) -> Option<&str> {
        match self {
            Self::Time => mapping.time.as_deref(),
            Self::Topic => mapping.topic.as_deref(),
            Self::Payload => mapping.payload.as_deref(),
            Self::Qos | Self::Retain => None,
        }
    }

    /// The names that tools give, the most certain first; capitals do not matter.
    pub fn usual(self) -> &'static [&'static str] {
        match self {
            Self::Time => &[
                "tst",
                "timestamp",
                "time",
                "ts",
                "createAt",
                "createdAt",
                "created_at",
                "receivedAt",
                "received_at",
                "@timestamp",
                "_time",
                "date",
            ],
            Self::Topic => &["topic", "topicName", "topic_name", "mqtt_topic"],
            Self::Payload => &[
                "payload",
                "message",
                "msg",
                "data",
                "value",
                "payloadString",
                "content",
                "body",
            ],
            Self::Qos => &["qos"],
            Self::Retain => &["retain", "retained"],
        }
    }
}

/// The QoS that is written.
pub(super) fn qos(written: &str) -> Option<u8> {
    written.trim_matches('"').parse().ok().filter(|qos| *qos <= 2)
}

/// The RETAIN that is written.
pub(super) fn retain(written: &str) -> Option<bool> {
    match written.trim_matches('"').to_ascii_lowercase().as_str() {
        "1" | "true" => Some(true),
        "0" | "false" => Some(false),
        _ => None,
    }
}
