//! Makes captures for tests: MQTT packets, TCP segments around them, and a file.
#![forbid(unsafe_code)]
#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::must_use_candidate,
    clippy::missing_panics_doc,
    reason = "only tests use it"
)]

use etherparse::PacketBuilder;

use tck_journal::Payload;
use tck_journal::event::Packet;

/// What lies below IP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    Ethernet,
    Vlan,
    Cooked,
    Cooked2,
    Raw,
    Loopback,
}

/// One direction of a connection in the making.
#[derive(Clone, Debug)]
pub struct Stream {
    pub link: Link,
    pub six: bool,
    pub from: (u8, u16),
    pub to: (u8, u16),
    pub seq: u32,
}

impl Stream {
    /// A client and its broker.
    pub fn pair(link: Link, six: bool, port: u16) -> (Self, Self) {
        let up = Self {
            link,
            six,
            from: (1, port),
            to: (2, 1883),
            seq: 4_294_967_000,
        };
        let down = Self {
            from: up.to,
            to: up.from,
            seq: 77,
            ..up.clone()
        };
        (up, down)
    }

    /// The next segment as a frame.
    pub fn segment(&mut self, data: &[u8]) -> Vec<u8> {
        let frame = self.frame(data, "");
        self.seq = self.seq.wrapping_add(u32::try_from(data.len()).expect("short"));
        frame
    }

    /// A segment with SYN, FIN or RST (`S`, `F`, `R`), each of which counts one.
    pub fn flagged(&mut self, flag: &str) -> Vec<u8> {
        let frame = self.frame(&[], flag);
        self.seq = self.seq.wrapping_add(1);
        frame
    }

    fn frame(&self, data: &[u8], flag: &str) -> Vec<u8> {
        let ((from, from_port), (to, to_port)) = (self.from, self.to);
        let v6 = |last: u8| {
            let mut address = [0; 16];
            (address[0], address[15]) = (0xfd, last);
            address
        };
        let (six, v4) = (self.six, |last: u8| [10, 0, 0, last]);
        let builder = match self.link {
            Link::Ethernet => {
                let step = PacketBuilder::ethernet2([1; 6], [2; 6]);
                if six {
                    step.ipv6(v6(from), v6(to), 9)
                } else {
                    step.ipv4(v4(from), v4(to), 9)
                }
            }
            Link::Vlan => {
                let step = PacketBuilder::ethernet2([1; 6], [2; 6]).single_vlan(7.try_into().expect("small"));
                if six {
                    step.ipv6(v6(from), v6(to), 9)
                } else {
                    step.ipv4(v4(from), v4(to), 9)
                }
            }
            _ if six => PacketBuilder::ipv6(v6(from), v6(to), 9),
            _ => PacketBuilder::ipv4(v4(from), v4(to), 9),
        };
        let tcp = builder.tcp(from_port, to_port, self.seq, 1024);
        let tcp = match flag {
            "S" => tcp.syn(),
            "F" => tcp.fin().ack(1),
            "R" => tcp.rst(),
            _ => tcp.psh().ack(1),
        };
        let mut bytes = match self.link {
            Link::Cooked => [[0; 14].as_slice(), if six { &[0x86, 0xdd] } else { &[8, 0] }].concat(),
            Link::Cooked2 => [if six { &[0x86, 0xdd] } else { &[8, 0] }, [0; 18].as_slice()].concat(),
            Link::Loopback => vec![2, 0, 0, 0],
            _ => Vec::new(),
        };
        tcp.write(&mut bytes, data).expect("a frame");
        bytes
    }
}

/// A pcap file with these frames: microseconds since 2026, and bytes of which so many are recorded.
pub fn pcap(link: Link, frames: &[(u64, Vec<u8>)], snap: usize) -> Vec<u8> {
    let kind: u32 = match link {
        Link::Ethernet | Link::Vlan => 1,
        Link::Cooked => 113,
        Link::Cooked2 => 276,
        Link::Raw => 101,
        Link::Loopback => 0,
    };
    let mut file = Vec::new();
    for word in [0xa1b2_c3d4_u32, 0x0004_0002, 0, 0, 65_535, kind] {
        file.extend(word.to_le_bytes());
    }
    for (micros, frame) in frames {
        let recorded = frame.len().min(snap);
        let time = 1_767_225_600_000_000 + micros;
        for word in [time / 1_000_000, time % 1_000_000, recorded as u64, frame.len() as u64] {
            file.extend(u32::try_from(word).expect("small").to_le_bytes());
        }
        file.extend(&frame[..recorded]);
    }
    file
}

/// A recording of these frames as pcapng, with nanoseconds.
pub fn pcapng(link: Link, frames: &[(u64, Vec<u8>)]) -> Vec<u8> {
    let kind: u16 = match link {
        Link::Ethernet | Link::Vlan => 1,
        Link::Cooked => 113,
        Link::Cooked2 => 276,
        Link::Raw => 101,
        Link::Loopback => 0,
    };
    let block = |kind: u32, body: &[u8]| {
        let padded = body.len().next_multiple_of(4);
        let length = u32::try_from(padded + 12).expect("short").to_le_bytes();
        let mut all = [kind.to_le_bytes(), length].concat();
        all.extend(body);
        all.resize(padded + 8, 0);
        all.extend(length);
        all
    };
    let mut file = block(
        0x0a0d_0d0a,
        &[
            0x4d, 0x3c, 0x2b, 0x1a, 1, 0, 0, 0, 255, 255, 255, 255, 255, 255, 255, 255,
        ],
    );
    let mut described = kind.to_le_bytes().to_vec();
    described.extend([0, 0, 0, 0, 4, 0]);
    described.extend([9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0]);
    file.extend(block(1, &described));
    for (micros, frame) in frames {
        let time = (1_767_225_600_000_000 + micros) * 1000;
        let length = u32::try_from(frame.len()).expect("short").to_le_bytes();
        let high = u32::try_from(time >> 32).expect("half").to_le_bytes();
        let low = u32::try_from(time & 0xffff_ffff).expect("half").to_le_bytes();
        let mut body = [[0; 4], high, low, length, length].concat();
        body.extend(frame);
        file.extend(block(6, &body));
    }
    file
}

/// An MQTT packet as 3.1.1 or 3.1 has it; `None` for those that tests do not need.
pub fn mqtt(packet: &Packet) -> Option<Vec<u8>> {
    let text = |text: &str| text_of(text.as_bytes());
    let bytes = |payload: &Payload| match payload {
        Payload::Whole(bytes) => bytes.to_vec(),
        Payload::Cut { .. } => Vec::new(),
    };
    let (first, body) = match packet {
        Packet::Connect {
            level,
            client_id,
            keep_alive,
            clean_session,
            will,
            ..
        } => {
            let mut body = text(if *level == 3 { "MQIsdp" } else { "MQTT" });
            let mut flags = u8::from(*clean_session) << 1;
            if let Some(will) = will {
                flags |= 4 | will.qos << 3 | u8::from(will.retain) << 5;
            }
            body.extend([*level, flags]);
            body.extend(keep_alive.to_be_bytes());
            body.extend(text(client_id));
            if let Some(will) = will {
                body.extend(text(&will.topic));
                body.extend(text_of(&bytes(&will.payload)));
            }
            (0x10, body)
        }
        Packet::Publish {
            topic,
            qos,
            retain,
            dup,
            packet_id,
            payload,
        } => {
            let mut body = text(topic);
            body.extend(packet_id.iter().flat_map(|id| id.to_be_bytes()));
            body.extend(bytes(payload));
            (0x30 | u8::from(*dup) << 3 | qos << 1 | u8::from(*retain), body)
        }
        Packet::Pingreq => (0xc0, Vec::new()),
        Packet::Disconnect { .. } => (0xe0, Vec::new()),
        _ => return None,
    };
    let mut all = vec![first];
    let mut rest = body.len();
    loop {
        let byte = u8::try_from(rest % 128).expect("small");
        rest /= 128;
        all.push(if rest > 0 { byte | 128 } else { byte });
        if rest == 0 {
            break;
        }
    }
    all.extend(body);
    Some(all)
}

fn text_of(bytes: &[u8]) -> Vec<u8> {
    let mut all = u16::try_from(bytes.len()).expect("short").to_be_bytes().to_vec();
    all.extend(bytes);
    all
}
