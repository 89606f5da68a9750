//! TCP connections with MQTT on them, as somebody between client and broker sees them.

use std::collections::HashMap;

use jiff::Timestamp;

use super::frames::{End, Segment};
use super::mqtt_stream::{Heard, MqttStream};
use super::tcp_reassembly::{Part, TcpReassembly};
use crate::{Wire, WireEvent};
use tck_journal::event::{Close, Packet};

/// How many connections are kept in view.
const CONNECTIONS: usize = 4096;
/// How many bytes they hold together.
const HELD: usize = 64 << 20;
/// What a client and a broker begin with.
const CONNECT: u8 = 0x10;
const CONNACK: u8 = 0x20;
/// How much of the head of a request is looked at.
const HEAD: usize = 4096;
/// The port of MQTT.
const MQTT: u16 = 1883;

/// One connection.
struct Connection {
    number: u64,
    /// Which end is the client, and whether that is certain.
    client: End,
    broker: End,
    certain: bool,
    up: Direction,
    down: Direction,
    /// When it was heard last, counted in segments.
    heard: u64,
    /// Whether anything of it was MQTT.
    spoke: bool,
    /// What it speaks instead, if that is known.
    other: Option<Other>,
}

/// What carries MQTT and cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Other {
    Tls,
    WebSocket,
}

impl Other {
    /// What the bytes of a segment begin with.
    fn of(bytes: &[u8]) -> Option<Self> {
        match bytes {
            // A record: its kind, the version, and a length.
            [0x14..=0x17, 3, 0..=4, 0..=0x41, _, ..] => Some(Self::Tls),
            [b'G', b'E', b'T', b' ', ..] => {
                let head = String::from_utf8_lossy(&bytes[..bytes.len().min(HEAD)]).to_ascii_lowercase();
                head.contains("upgrade: websocket").then_some(Self::WebSocket)
            }
            _ => None,
        }
    }
}

#[derive(Default)]
struct Direction {
    flow: TcpReassembly,
    talk: MqttStream,
    closed: bool,
}

impl Direction {
    fn held(&self) -> usize {
        self.flow.held() + self.talk.held()
    }
}

/// TCP connections with MQTT on them, as somebody between client and broker sees them.
#[derive(Default)]
pub(super) struct Connections {
    open: HashMap<(End, End), Connection>,
    numbers: u64,
    segments: u64,
    held: usize,
}

impl Connections {
    /// Takes in a segment; gives what is told by it. Says what its connection speaks instead of MQTT.
    pub fn push(&mut self, segment: Segment, told: &mut Vec<Wire>) -> Option<Other> {
        self.segments += 1;
        let key = if segment.from < segment.to {
            (segment.from, segment.to)
        } else {
            (segment.to, segment.from)
        };
        if segment.syn && !segment.ack {
            // The same ends may have been connected before.
            if let Some(before) = self.open.remove(&key) {
                self.forget(before, segment.at, Close::DeviceReset, told);
            }
        }
        if !self.open.contains_key(&key) {
            let is_empty = segment.data.is_empty() && segment.missing == 0 && !segment.syn;
            if is_empty {
                return None;
            }
            if self.open.len() >= CONNECTIONS {
                self.drop_oldest(told);
            }
            self.numbers += 1;
            self.open.insert(key, Connection::new(self.numbers, &segment));
        }
        let connection = self.open.get_mut(&key)?;
        connection.heard = self.segments;
        if connection.other.is_none() && !connection.spoke {
            connection.other = Other::of(&segment.data);
        }
        let other = connection.other;
        let before = connection.held();
        let end = connection.push(segment, told);
        self.held = self.held + connection.held() - before;
        if let Some((at, how)) = end
            && let Some(connection) = self.open.remove(&key)
        {
            self.forget(connection, at, how, told);
        }
        while self.held > HELD && !self.open.is_empty() {
            self.drop_oldest(told);
        }
        other
    }

    /// What is held back at the end of the capture.
    pub fn finish(&mut self, told: &mut Vec<Wire>) {
        let mut rest: Vec<Connection> = std::mem::take(&mut self.open).into_values().collect();
        rest.sort_by_key(|connection| connection.number);
        for mut connection in rest {
            connection.rest(None, told);
        }
    }

    fn drop_oldest(&mut self, told: &mut Vec<Wire>) {
        let oldest = self.open.iter().min_by_key(|(_, connection)| connection.heard);
        if let Some(key) = oldest.map(|(key, _)| *key)
            && let Some(connection) = self.open.remove(&key)
        {
            self.held -= connection.held();
            // What becomes of it is not known.
            told.push(connection.wire(None, WireEvent::Gap { sent: true }));
            told.push(connection.wire(None, WireEvent::Gap { sent: false }));
        }
    }

    fn forget(&mut self, mut connection: Connection, at: Option<Timestamp>, how: Close, told: &mut Vec<Wire>) {
        self.held -= connection.held();
        connection.rest(at, told);
        if connection.spoke {
            told.push(connection.wire(at, WireEvent::Closed { how }));
        }
    }
}

impl Connection {
    fn new(number: u64, segment: &Segment) -> Self {
        let (from, to) = (segment.from, segment.to);
        let (from_client, certain) = match (segment.syn, segment.ack) {
            (true, ack) => (!ack, true),
            _ if to.1 == MQTT => (true, from.1 != MQTT),
            _ if from.1 == MQTT => (false, true),
            // Clients are given high numbers.
            _ => (from.1 >= to.1, false),
        };
        let (client, broker) = if from_client { (from, to) } else { (to, from) };
        Self {
            number,
            client,
            broker,
            certain,
            up: Direction::default(),
            down: Direction::default(),
            heard: 0,
            spoke: false,
            other: None,
        }
    }

    fn held(&self) -> usize {
        self.up.held() + self.down.held()
    }

    fn wire(&self, at: Option<Timestamp>, event: WireEvent) -> Wire {
        Wire {
            at,
            connection: self.number,
            certain: self.certain,
            event,
        }
    }

    /// Takes in a segment; says how the connection ends with it.
    fn push(&mut self, segment: Segment, told: &mut Vec<Wire>) -> Option<(Option<Timestamp>, Close)> {
        let sent = segment.from == self.client;
        let at = segment.at;
        let direction = if sent { &mut self.up } else { &mut self.down };
        let mut seq = segment.seq;
        if segment.syn {
            seq = seq.wrapping_add(1);
            direction.flow.begin(seq);
            direction.talk.begin(if sent { CONNECT } else { CONNACK });
        }
        let mut due = Vec::new();
        direction.flow.push(seq, at, segment.data, segment.missing, &mut due);
        if segment.fin || segment.rst {
            direction.flow.rest(&mut due);
            direction.closed = true;
        }
        self.hear(sent, at, due, told);
        let how = match (segment.rst, sent) {
            (true, true) => Close::DeviceReset,
            (false, true) => Close::DeviceFin,
            (_, false) => Close::Broker,
        };
        (segment.rst || self.up.closed && self.down.closed).then_some((at, how))
    }

    /// What is held back of both directions.
    fn rest(&mut self, at: Option<Timestamp>, told: &mut Vec<Wire>) {
        for sent in [true, false] {
            let direction = if sent { &mut self.up } else { &mut self.down };
            let mut due = Vec::new();
            direction.flow.rest(&mut due);
            self.hear(sent, at, due, told);
        }
    }

    fn hear(&mut self, sent: bool, at: Option<Timestamp>, due: Vec<Part>, told: &mut Vec<Wire>) {
        let mut heard = Vec::new();
        for part in due {
            let direction = if sent { &mut self.up } else { &mut self.down };
            match part {
                Part::Bytes(bytes) => direction.talk.push(&bytes, &mut heard),
                Part::Gap => {
                    direction.talk.gap();
                    if self.spoke {
                        told.push(self.wire(at, WireEvent::Gap { sent }));
                    }
                }
            }
            for heard in heard.drain(..) {
                match heard {
                    Heard::Packet(packet) => self.packet(sent, at, packet, told),
                    Heard::Lost if self.spoke => told.push(self.wire(at, WireEvent::Gap { sent })),
                    // A CONNECT that is none, as bridges between brokers send it.
                    Heard::Lost | Heard::Foreign => {
                        self.up.talk.give_up();
                        self.down.talk.give_up();
                    }
                }
            }
        }
    }

    fn packet(&mut self, sent: bool, at: Option<Timestamp>, packet: Packet, told: &mut Vec<Wire>) {
        let said_by_client = match packet {
            Packet::Connect { .. } | Packet::Subscribe { .. } | Packet::Unsubscribe { .. } | Packet::Pingreq => {
                Some(true)
            }
            Packet::Connack { .. } | Packet::Suback { .. } | Packet::Pingresp => Some(false),
            _ => None,
        };
        let mut sent = sent;
        if let Some(by_client) = said_by_client {
            if by_client != sent && !self.certain {
                std::mem::swap(&mut self.up, &mut self.down);
                std::mem::swap(&mut self.client, &mut self.broker);
                sent = by_client;
            }
            self.certain |= by_client == sent;
        }
        let (own, other) = if sent {
            (&self.up, &mut self.down)
        } else {
            (&self.down, &mut self.up)
        };
        if let Some(level) = own.talk.level()
            && other.talk.level().is_none()
        {
            other.talk.set_level(level);
        }
        self.spoke = true;
        told.push(self.wire(at, WireEvent::Packet { packet, sent }));
    }
}
