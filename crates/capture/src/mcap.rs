//! MCAP files, the container that robotics people record into: channels with JSON, in chunks that are packed with zstd, lz4
//! or not at all.
//!
//! The file is read from its beginning to its end, one chunk at a time, and needs no index. The topic of a channel is the
//! topic of the message, with or without a slash in front. A message is the JSON itself, or a ROS string with the JSON in
//! its `data`.

use std::collections::HashMap;
use std::io::{self, BufRead, Cursor, Read as _};

use bytes::Bytes;

use super::members::members;
use super::{Counted, Item, Message, Read, SourcePosition};

/// What a file begins with.
const MAGIC: &[u8] = b"\x89MCAP0\r\n";
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const DATA_END: u8 = 0x0f;
/// How long a record may be, and what is packed in a chunk.
const LARGEST: u64 = 256 << 20;
/// How many channels are known.
const CHANNELS: usize = 1 << 16;

/// MCAP files, the container that robotics people record into: channels with JSON, in chunks that are packed with zstd,
/// lz4 or not at all.
pub struct Mcap {
    reader: Box<dyn BufRead>,
    file: usize,
    /// The open chunk.
    chunk: Option<Cursor<Vec<u8>>>,
    /// By number: the topic of a channel, if it holds JSON.
    channels: HashMap<u16, Option<String>>,
    counted: Counted,
    ended: bool,
}

/// Whether a file begins like an MCAP file.
pub(super) fn begins(first: &[u8]) -> bool {
    first.starts_with(&MAGIC[..4])
}

impl Mcap {
    /// Reads the file of that number.
    ///
    /// # Errors
    /// It does not begin like an MCAP file.
    pub fn new(mut reader: Box<dyn BufRead>, file: usize) -> io::Result<Self> {
        let mut magic = [0; 8];
        reader.read_exact(&mut magic)?;
        if magic != MAGIC {
            return Err(broken("this is no MCAP file that is known"));
        }
        Ok(Self {
            reader,
            file,
            chunk: None,
            channels: HashMap::new(),
            counted: Counted::default(),
            ended: false,
        })
    }

    /// How much was read so far, in messages.
    #[must_use]
    pub fn counted(&self) -> Counted {
        self.counted
    }

    /// Which message was read last.
    #[must_use]
    pub fn place(&self) -> SourcePosition {
        SourcePosition {
            file: self.file,
            line: self.counted.lines,
        }
    }

    /// The next message; `None` at the end.
    ///
    /// # Errors
    /// What the operating system says, or what is wrong with the file.
    pub fn read(&mut self) -> Read {
        while !self.ended {
            let Some((kind, record)) = self.record()? else {
                self.ended = self.chunk.take().is_none();
                continue;
            };
            match kind {
                CHANNEL => self.channel(&record),
                CHUNK => self.chunk = Some(Cursor::new(unpacked(&record)?)),
                DATA_END => self.ended = true,
                MESSAGE => {
                    self.counted.lines += 1;
                    match self.message(&record) {
                        Some(message) => return Ok(Some(Item::Message(message))),
                        None => self.counted.skipped += 1,
                    }
                }
                _ => {}
            }
        }
        Ok(None)
    }

    /// The next record of the chunk or of the file; `None` at the end of either. A file may end in the middle.
    fn record(&mut self) -> io::Result<Option<(u8, Vec<u8>)>> {
        let source: &mut dyn io::Read = match &mut self.chunk {
            Some(chunk) => chunk,
            None => &mut self.reader,
        };
        let mut head = [0; 9];
        if !filled(source, &mut head)? {
            return Ok(None);
        }
        let [kind, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        if length > LARGEST {
            return Err(broken("a record is too long"));
        }
        let mut record = Vec::new();
        let read = source.take(length).read_to_end(&mut record)?;
        Ok((read as u64 == length).then_some((kind, record)))
    }

    fn channel(&mut self, record: &[u8]) {
        let mut fields = Fields(record);
        let known = (|| {
            let id = fields.number::<2>()?;
            fields.number::<2>()?;
            Some((id, fields.text()?, fields.text()?))
        })();
        if let Some((id, topic, encoding)) = known
            && self.channels.len() < CHANNELS
        {
            let topic = topic.strip_prefix('/').unwrap_or(topic).to_owned();
            let id = u16::try_from(id).unwrap_or_default();
            self.channels.insert(id, (encoding == "json").then_some(topic));
        }
    }

    fn message(&self, record: &[u8]) -> Option<Message> {
        let mut fields = Fields(record);
        let channel = u16::try_from(fields.number::<2>()?).ok()?;
        fields.number::<4>()?;
        let at = fields.number::<8>()?;
        fields.number::<8>()?;
        let topic = self.channels.get(&channel)?.clone()?;
        Some(Message {
            at: jiff::Timestamp::from_nanosecond(i128::from(at)).ok(),
            topic,
            payload: payload(fields.0),
            qos: None,
            retain: None,
            place: self.place(),
            after_gap: false,
            carried: None,
        })
    }
}

/// The JSON itself, or what a ROS string holds.
fn payload(bytes: &[u8]) -> Bytes {
    let string = || {
        let members = members(std::str::from_utf8(bytes).ok()?)?;
        match members.as_slice() {
            [(name, value)] if name == "data" => serde_json::from_str::<String>(value).ok(),
            _ => None,
        }
    };
    string().map_or_else(|| Bytes::copy_from_slice(bytes), Bytes::from)
}

/// The records in a chunk.
fn unpacked(chunk: &[u8]) -> io::Result<Vec<u8>> {
    let mut fields = Fields(chunk);
    let head = (|| {
        fields.number::<8>()?;
        fields.number::<8>()?;
        let length = fields.number::<8>()?;
        fields.number::<4>()?;
        let packing = fields.text()?;
        fields.number::<8>()?;
        Some((length, packing))
    })();
    let (length, packing) = head.ok_or_else(|| broken("a chunk is cut off"))?;
    if length > LARGEST {
        return Err(broken("a chunk is too long"));
    }
    let packed = fields.0;
    let mut records = Vec::new();
    match packing {
        "" => records.extend_from_slice(packed),
        "zstd" => {
            let frame = ruzstd::decoding::StreamingDecoder::new(packed).map_err(|error| broken(&error.to_string()))?;
            frame.take(length).read_to_end(&mut records)?;
        }
        "lz4" => {
            lz4_flex::frame::FrameDecoder::new(packed)
                .take(length)
                .read_to_end(&mut records)?;
        }
        other => return Err(broken(&format!("chunks packed with {other:?} cannot be read"))),
    }
    Ok(records)
}

/// Fills a buffer; `false` where the source ends before.
fn filled(source: &mut dyn io::Read, buffer: &mut [u8]) -> io::Result<bool> {
    match source.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

fn broken(text: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, text.to_owned())
}

/// What is left of a record.
struct Fields<'r>(&'r [u8]);

impl<'r> Fields<'r> {
    fn number<const LENGTH: usize>(&mut self) -> Option<u64> {
        let (bytes, rest) = self.0.split_at_checked(LENGTH)?;
        self.0 = rest;
        Some(
            bytes
                .iter()
                .rev()
                .fold(0, |number, byte| number << 8 | u64::from(*byte)),
        )
    }

    fn text(&mut self) -> Option<&'r str> {
        let length = usize::try_from(self.number::<4>()?).ok()?;
        let (text, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        std::str::from_utf8(text).ok()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn record(kind: u8, parts: &[&[u8]]) -> Vec<u8> {
        let body = parts.concat();
        [&[kind], (body.len() as u64).to_le_bytes().as_slice(), &body].concat()
    }

    fn text(text: &str) -> Vec<u8> {
        [
            &u32::try_from(text.len()).expect("short").to_le_bytes(),
            text.as_bytes(),
        ]
        .concat()
    }

    fn channel(id: u16, topic: &str, encoding: &str) -> Vec<u8> {
        let id = id.to_le_bytes();
        record(CHANNEL, &[&id, &[0, 0], &text(topic), &text(encoding), &[0; 4]])
    }

    fn message(channel: u16, data: &str) -> Vec<u8> {
        let at = 1_767_225_600_250_000_000_u64.to_le_bytes();
        record(
            MESSAGE,
            &[&channel.to_le_bytes(), &[1, 0, 0, 0], &at, &at, data.as_bytes()],
        )
    }

    fn chunk(packing: &str, records: &[u8], packed: &[u8]) -> Vec<u8> {
        let length = (records.len() as u64).to_le_bytes();
        let own = (packed.len() as u64).to_le_bytes();
        record(CHUNK, &[&[0; 16], &length, &[0; 4], &text(packing), &own, packed])
    }

    fn read(file: Vec<u8>) -> io::Result<Vec<(String, String)>> {
        let mut mcap = Mcap::new(Box::new(Cursor::new(file)), 0)?;
        let mut all = Vec::new();
        while let Some(Item::Message(message)) = mcap.read()? {
            assert_eq!(
                message.at.map(|at| format!("{at:.3}")).as_deref(),
                Some("2026-01-01T00:00:00.250Z")
            );
            all.push((message.topic, String::from_utf8_lossy(&message.payload).into_owned()));
        }
        Ok(all)
    }

    fn whole() -> Vec<u8> {
        let inner = [channel(2, "/a/order", "json"), message(2, "{\"b\":2}")].concat();
        let zstd = ruzstd::encoding::compress_to_vec(inner.as_slice(), ruzstd::encoding::CompressionLevel::Fastest);
        [
            MAGIC,
            &record(1, &[&text(""), &text("")]),
            &channel(1, "a/state", "json"),
            &channel(3, "camera", "cdr"),
            &message(1, "{\"a\":1}"),
            &chunk("zstd", &inner, &zstd),
            &message(3, "\0\0"),
            &chunk("", &message(1, "x"), &message(1, "{\"data\":\"{\\\"c\\\":3}\"}")),
            &record(DATA_END, &[&[0; 4]]),
            &message(1, "never read"),
        ]
        .concat()
    }

    #[test]
    fn messages_of_json_channels_are_read_packed_or_not() {
        let wanted = [
            ("a/state", "{\"a\":1}"),
            ("a/order", "{\"b\":2}"),
            ("a/state", "{\"c\":3}"),
        ];
        let wanted = wanted.map(|(topic, payload)| (topic.to_owned(), payload.to_owned()));
        assert_eq!(read(whole()).expect("readable"), wanted);
    }

    #[test]
    fn a_file_may_end_in_the_middle_and_nonsense_is_an_error() {
        let whole = whole();
        for length in [9, 60, whole.len() / 2] {
            assert!(read(whole[..length].to_vec()).is_ok());
        }
        assert!(read(b"\x89MCAP9\r\n".to_vec()).is_err());
        assert!(read([MAGIC, &[CHUNK, 255, 255, 255, 255, 255, 255, 255, 255]].concat()).is_err());
        assert!(read([MAGIC, &chunk("zip", &[], &[])].concat()).is_err());
    }

    proptest! {
        #[test]
        fn no_file_makes_it_panic(
            spoiled in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..30),
            length in any::<prop::sample::Index>(),
        ) {
            let mut file = whole();
            file.truncate(length.index(file.len()) + 1);
            for (at, byte) in spoiled {
                let at = at.index(file.len());
                file[at] = byte;
            }
            if let Ok(mut mcap) = Mcap::new(Box::new(Cursor::new(file)), 0) {
                while let Ok(Some(_)) = mcap.read() {}
            }
        }
    }
}
