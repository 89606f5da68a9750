//! The frames of a pcap or pcapng file, and the TCP segment in each.

use std::io::{self, BufRead, Read as _};
use std::net::IpAddr;

use etherparse::{EtherType, LaxNetSlice, LaxSlicedPacket, TransportSlice};
use jiff::Timestamp;
use pcap_parser::traits::{PcapNGPacketBlock as _, PcapReaderIterator};
use pcap_parser::{Block, LegacyPcapReader, PcapBlockOwned, PcapError, PcapNGReader};

/// What a pcap file begins with: seconds with micro- or nanoseconds, in either order of bytes.
const PCAP: [[u8; 4]; 4] = [
    [0xa1, 0xb2, 0xc3, 0xd4],
    [0xd4, 0xc3, 0xb2, 0xa1],
    [0xa1, 0xb2, 0x3c, 0x4d],
    [0x4d, 0x3c, 0xb2, 0xa1],
];
/// What a pcapng file begins with.
const PCAPNG: [u8; 4] = [0x0a, 0x0d, 0x0d, 0x0a];
/// How much is held of a file at first, and at most: a frame has to fit in.
const BUFFER: usize = 1 << 16;
const LARGEST: usize = 16 << 20;
/// How many interfaces of a pcapng file are known.
const INTERFACES: usize = 1024;

/// One end of a connection.
pub(super) type End = (IpAddr, u16);

/// A TCP segment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Segment {
    /// When it was seen.
    pub at: Option<Timestamp>,
    /// From where.
    pub from: End,
    /// To where.
    pub to: End,
    /// Sequence number of the first byte.
    pub seq: u32,
    /// SYN.
    pub syn: bool,
    /// ACK.
    pub ack: bool,
    /// FIN.
    pub fin: bool,
    /// RST.
    pub rst: bool,
    /// The bytes that were recorded.
    pub data: Vec<u8>,
    /// How many more there were.
    pub missing: u32,
}

/// A frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Frame {
    /// With a TCP segment.
    Segment(Segment),
    /// With something else.
    Other,
}

impl From<Option<Segment>> for Frame {
    fn from(segment: Option<Segment>) -> Self {
        segment.map_or(Self::Other, Self::Segment)
    }
}

/// How the frames of an interface are to be read.
#[derive(Clone, Copy)]
struct Interface {
    link: i32,
    /// Ticks per second.
    resolution: u64,
    /// Seconds to be added.
    offset: i64,
}

/// The frames of a pcap or pcapng file, and the TCP segment in each.
pub(super) struct Frames {
    reader: Box<dyn PcapReaderIterator>,
    interfaces: Vec<Interface>,
    buffer: usize,
    ended: bool,
}

/// Whether a file begins like a pcap or pcapng file.
pub(crate) fn begins(first: &[u8]) -> bool {
    first
        .get(..4)
        .is_some_and(|first| first == PCAPNG || PCAP.iter().any(|magic| first == magic))
}

impl Frames {
    /// Begins to read.
    pub fn new(mut reader: Box<dyn BufRead>) -> io::Result<Self> {
        // The header has to come in one piece.
        let mut begin = Vec::new();
        reader.by_ref().take(BUFFER as u64).read_to_end(&mut begin)?;
        let is_pcapng = begin.starts_with(&PCAPNG);
        let reader = io::Cursor::new(begin).chain(reader);
        let reader: Result<Box<dyn PcapReaderIterator>, _> = if is_pcapng {
            PcapNGReader::new(BUFFER, reader).map(|reader| Box::new(reader) as _)
        } else {
            LegacyPcapReader::new(BUFFER, reader).map(|reader| Box::new(reader) as _)
        };
        Ok(Self {
            reader: reader.map_err(|error| broken(&error))?,
            interfaces: Vec::new(),
            buffer: BUFFER,
            ended: false,
        })
    }

    /// The next frame; `None` at the end. A file may end in the middle of a frame.
    pub fn read(&mut self) -> io::Result<Option<Frame>> {
        while !self.ended {
            let before = self.reader.data().len();
            match self.reader.next() {
                Ok((length, block)) => {
                    let frame = taken(&block, &mut self.interfaces);
                    self.reader.consume(length);
                    if let Some(frame) = frame {
                        return Ok(Some(frame));
                    }
                }
                Err(PcapError::Eof) => self.ended = true,
                Err(PcapError::Incomplete(_)) => self.more(before)?,
                Err(error) => return Err(broken(&error)),
            }
        }
        Ok(None)
    }

    fn more(&mut self, before: usize) -> io::Result<()> {
        self.reader.refill().map_err(|error| broken(&error))?;
        if self.reader.data().len() > before {
            return Ok(());
        }
        if self.reader.reader_exhausted() {
            self.ended = true;
        } else if self.buffer >= LARGEST || !self.reader.grow(self.buffer * 2) {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "a frame is too long"));
        } else {
            self.buffer *= 2;
        }
        Ok(())
    }
}

fn broken<I: std::fmt::Debug>(error: &PcapError<I>) -> io::Error {
    let text = match error {
        PcapError::Eof | PcapError::UnexpectedEof | PcapError::Incomplete(_) => "the capture ends within its header",
        PcapError::ReadError => "the capture cannot be read any further",
        _ => "this is no capture from here on",
    };
    io::Error::new(io::ErrorKind::InvalidData, text)
}

/// The frame of a block, if it holds one.
fn taken(block: &PcapBlockOwned<'_>, interfaces: &mut Vec<Interface>) -> Option<Frame> {
    match block {
        PcapBlockOwned::LegacyHeader(header) => {
            interfaces.push(Interface {
                link: header.network.0,
                resolution: if header.is_nanosecond_precision() {
                    1_000_000_000
                } else {
                    1_000_000
                },
                offset: i64::from(header.thiszone),
            });
            None
        }
        PcapBlockOwned::Legacy(frame) => {
            let interface = *interfaces.first()?;
            let at = time(u64::from(frame.ts_sec), u64::from(frame.ts_usec), interface);
            let length = usize::try_from(frame.caplen).unwrap_or(usize::MAX);
            let recorded = frame.data.get(..length).unwrap_or(frame.data);
            Some(segment(interface.link, recorded, at).into())
        }
        PcapBlockOwned::NG(Block::SectionHeader(_)) => {
            interfaces.clear();
            None
        }
        PcapBlockOwned::NG(Block::InterfaceDescription(described)) => {
            if interfaces.len() < INTERFACES {
                interfaces.push(Interface {
                    link: described.linktype.0,
                    resolution: described
                        .ts_resolution()
                        .filter(|ticks| *ticks > 0)
                        .unwrap_or(1_000_000),
                    offset: described.ts_offset(),
                });
            }
            None
        }
        PcapBlockOwned::NG(Block::EnhancedPacket(frame)) => {
            let interface = usize::try_from(frame.if_id)
                .ok()
                .and_then(|id| interfaces.get(id).copied());
            let ticks = u64::from(frame.ts_high) << 32 | u64::from(frame.ts_low);
            let segment = interface.and_then(|interface| {
                let (seconds, rest) = (ticks / interface.resolution, ticks % interface.resolution);
                segment(interface.link, frame.packet_data(), time(seconds, rest, interface))
            });
            Some(segment.into())
        }
        PcapBlockOwned::NG(Block::SimplePacket(frame)) => {
            let link = interfaces.first().map(|interface| interface.link);
            Some(link.and_then(|link| segment(link, frame.packet_data(), None)).into())
        }
        PcapBlockOwned::NG(_) => None,
    }
}

fn time(seconds: u64, ticks: u64, interface: Interface) -> Option<Timestamp> {
    let nanos = u128::from(ticks) * 1_000_000_000 / u128::from(interface.resolution.max(1));
    let seconds = i64::try_from(seconds).ok()?.checked_add(interface.offset)?;
    Timestamp::new(seconds, i32::try_from(nanos).ok()?).ok()
}

/// The TCP segment of a frame.
fn segment(link: i32, frame: &[u8], at: Option<Timestamp>) -> Option<Segment> {
    let from_ether_type = |at: usize, rest: usize| {
        let kind = frame.get(at..at + 2)?;
        let kind = EtherType(u16::from_be_bytes([kind[0], kind[1]]));
        Some(LaxSlicedPacket::from_ether_type(kind, frame.get(rest..)?))
    };
    let packet = match link {
        // Ethernet.
        1 => LaxSlicedPacket::from_ethernet(frame).ok()?,
        // Loopback of BSD: the family of addresses stands in front.
        0 | 108 => LaxSlicedPacket::from_ip(frame.get(4..)?).ok()?,
        // Bare IP.
        12 | 14 | 101 | 228 | 229 => LaxSlicedPacket::from_ip(frame).ok()?,
        // Linux cooked, the first and the second form.
        113 => from_ether_type(14, 16)?,
        276 => from_ether_type(0, 20)?,
        _ => return None,
    };
    let (from, to, claimed) = match packet.net.as_ref()? {
        LaxNetSlice::Ipv4(ip) => {
            let header = ip.header();
            let own = header.slice().len();
            let (from, to) = (header.source_addr(), header.destination_addr());
            (
                from.into(),
                to.into(),
                usize::from(header.total_len()).saturating_sub(own),
            )
        }
        LaxNetSlice::Ipv6(ip) => {
            let header = ip.header();
            let own = ip.extensions().slice().len();
            let (from, to) = (header.source_addr(), header.destination_addr());
            (
                from.into(),
                to.into(),
                usize::from(header.payload_length()).saturating_sub(own),
            )
        }
        LaxNetSlice::Arp(_) => return None,
    };
    let payload = packet.net.as_ref()?.ip_payload_ref()?;
    let TransportSlice::Tcp(tcp) = packet.transport.as_ref()? else {
        return None;
    };
    let missing = if payload.incomplete {
        claimed.saturating_sub(payload.payload.len())
    } else {
        0
    };
    Some(Segment {
        at,
        from: (from, tcp.source_port()),
        to: (to, tcp.destination_port()),
        seq: tcp.sequence_number(),
        syn: tcp.syn(),
        ack: tcp.ack(),
        fin: tcp.fin(),
        rst: tcp.rst(),
        data: tcp.payload().to_vec(),
        missing: u32::try_from(missing).unwrap_or_default(),
    })
}
