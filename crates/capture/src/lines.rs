//! One recording, line by line.
//!
//! Told apart by themselves: records of our journals, JSON objects with `topic` and `payload` as `mosquitto_sub -F %j`
//! and `%J` print them, or with the names of a [`Mapping`], and `topic payload` as `mosquitto_sub -v` prints it. Anything
//! else, such as the lines of a log between them, is counted and left out. A payload may go on over several lines.

use std::io::{self, BufRead, Read as _};

use base64::Engine as _;
use bytes::Bytes;

use super::members::members;
use super::{Item, Mapping, Message, Place, clock_text};
use tck_journal::Record;
use tck_journal::event::PAYLOAD_LIMIT;

/// How long a line may be. A payload that is kept whole fits into it, even where every byte of it is escaped.
const LINE: usize = 8 * PAYLOAD_LIMIT;
/// How long a payload may go on over several lines.
const SPREAD: usize = 4 * PAYLOAD_LIMIT;
const SPREAD_LINES: usize = 20_000;

/// How much was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counted {
    /// Lines in all.
    pub lines: u64,
    /// Lines that hold nothing that could be judged.
    pub skipped: u64,
}

/// A line that was read.
type Line = Option<Vec<u8>>;

/// See the module.
pub struct Lines {
    reader: Box<dyn BufRead>,
    file: usize,
    mapping: Mapping,
    counted: Counted,
    /// Lines that were read ahead in vain.
    ahead: std::collections::VecDeque<Vec<u8>>,
}

/// What comes next of a recording.
pub type Read = io::Result<Option<Item>>;

impl Lines {
    /// Reads the recording of that number.
    #[must_use]
    pub fn new(reader: Box<dyn BufRead>, file: usize, mapping: Mapping) -> Self {
        Self {
            reader,
            file,
            mapping,
            counted: Counted::default(),
            ahead: std::collections::VecDeque::new(),
        }
    }

    /// How much was read so far.
    #[must_use]
    pub fn counted(&self) -> Counted {
        self.counted
    }

    /// Where the last line stands.
    #[must_use]
    pub fn place(&self) -> Place {
        Place {
            file: self.file,
            line: self.counted.lines,
        }
    }

    /// The next message or record; `None` at the end.
    ///
    /// # Errors
    /// What the operating system or the unpacking says.
    pub fn read(&mut self) -> Read {
        while let Some(line) = self.line()? {
            self.counted.lines += 1;
            if let Some(item) = self.item(&line)? {
                return Ok(Some(item));
            }
            self.counted.skipped += u64::from(!line.trim_ascii().is_empty());
        }
        Ok(None)
    }

    fn line(&mut self) -> io::Result<Line> {
        if let Some(line) = self.ahead.pop_front() {
            return Ok(Some(line));
        }
        let mut line = Vec::new();
        let limit = u64::try_from(LINE).unwrap_or(u64::MAX);
        if self.reader.by_ref().take(limit).read_until(b'\n', &mut line)? == 0 {
            return Ok(None);
        }
        if line.len() == LINE && !line.ends_with(b"\n") {
            self.drain()?;
            line.clear();
            // Not blank, so that it counts as skipped.
            line.extend_from_slice(b"...");
        }
        Ok(Some(line))
    }

    /// Leaves out the rest of a line that is too long.
    fn drain(&mut self) -> io::Result<()> {
        loop {
            let buffer = self.reader.fill_buf()?;
            if buffer.is_empty() {
                return Ok(());
            }
            let end = buffer.iter().position(|byte| *byte == b'\n');
            let used = end.map_or(buffer.len(), |end| end + 1);
            self.reader.consume(used);
            if end.is_some() {
                return Ok(());
            }
        }
    }

    fn item(&mut self, line: &[u8]) -> io::Result<Option<Item>> {
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line).trim_ascii();
        let place = self.place();
        if line.starts_with(b"{") {
            return Ok(self.object(line, place));
        }
        let Some((topic, payload)) = topic_and_payload(line) else {
            return Ok(None);
        };
        let (topic, payload) = (topic.to_owned(), payload.to_vec());
        let payload = self.spread(payload)?;
        Ok(Some(Item::Message(Message {
            at: None,
            topic,
            payload,
            qos: None,
            retain: None,
            place,
            after_gap: false,
            carried: None,
        })))
    }

    fn object(&self, line: &[u8], place: Place) -> Option<Item> {
        let text = std::str::from_utf8(line).ok()?;
        let all = members(text)?;
        let has = |name: &str| all.iter().any(|(known, _)| known == name);
        if self.mapping == Mapping::default() && has("seq") && has("event") {
            return serde_json::from_str::<Record>(text)
                .ok()
                .map(|record| Item::Record(Box::new(record)));
        }
        let own = |named: &Option<String>, usual: &[&'static str]| match named {
            Some(path) => at_path(text, path),
            None => usual.iter().find_map(|usual| {
                all.iter()
                    .rev()
                    .find(|(name, _)| name == usual)
                    .map(|(_, value)| *value)
            }),
        };
        let topic = serde_json::from_str(own(&self.mapping.topic, &["topic"])?).ok()?;
        let payload = bytes_of(own(&self.mapping.payload, &["payload"])?)?;
        let number = |name: &'static str| own(&None, &[name])?.parse::<u8>().ok();
        let retain = match own(&None, &["retain"]) {
            Some("1" | "true") => Some(true),
            Some("0" | "false") => Some(false),
            _ => None,
        };
        Some(Item::Message(Message {
            at: own(&self.mapping.time, &["tst", "timestamp", "time"]).and_then(clock_text::read),
            topic,
            payload,
            qos: number("qos").filter(|qos| *qos <= 2),
            retain,
            place,
            after_gap: false,
            carried: None,
        }))
    }

    /// A payload that is not closed on its line is read on, as long as that may become JSON.
    fn spread(&mut self, mut payload: Vec<u8>) -> io::Result<Bytes> {
        if !is_cut(&payload) {
            return Ok(payload.into());
        }
        let own = payload.len();
        let mut taken = Vec::new();
        while taken.len() < SPREAD_LINES && payload.len() < SPREAD {
            let Some(line) = self.line()? else { break };
            // A new message begins: the one before was cut off.
            let begins = topic_and_payload(line.trim_ascii()).is_some();
            payload.push(b'\n');
            payload.extend_from_slice(line.strip_suffix(b"\n").unwrap_or(&line));
            taken.push(line);
            if begins {
                break;
            }
            // Only a line with a closing bracket can be the last one.
            let closes = taken.last().is_some_and(|line| line.contains(&b'}'));
            if closes && !is_cut(&payload) {
                if serde_json::from_slice::<serde::de::IgnoredAny>(&payload).is_err() {
                    break;
                }
                self.counted.lines += u64::try_from(taken.len()).unwrap_or_default();
                return Ok(payload.into());
            }
        }
        payload.truncate(own);
        for line in taken.into_iter().rev() {
            self.ahead.push_front(line);
        }
        Ok(payload.into())
    }
}

/// Whether a JSON text ends before it is complete.
fn is_cut(payload: &[u8]) -> bool {
    payload.starts_with(b"{")
        && serde_json::from_slice::<serde::de::IgnoredAny>(payload).is_err_and(|error| error.is_eof())
}

/// `topic payload`: a topic of several levels without blanks, and what begins like a JSON object.
fn topic_and_payload(line: &[u8]) -> Option<(&str, &[u8])> {
    let blank = line.iter().position(|byte| *byte == b' ')?;
    let (topic, payload) = (
        std::str::from_utf8(&line[..blank]).ok()?,
        line[blank..].trim_ascii_start(),
    );
    let levels = topic.split('/').count();
    let is_topic = levels > 1 && !topic.contains(['#', '+', '{', '"']) && !topic.contains("://");
    (is_topic && payload.starts_with(b"{")).then_some((topic, payload))
}

/// The value at a path of members with dots between them.
fn at_path<'t>(text: &'t str, path: &str) -> Option<&'t str> {
    let whole = members(text)?;
    if let Some((_, value)) = whole.iter().rev().find(|(name, _)| name == path) {
        return Some(value);
    }
    let (first, rest) = path.split_once('.')?;
    let (_, value) = whole.iter().rev().find(|(name, _)| name == first)?;
    at_path(value, rest)
}

/// The bytes of a payload that is written as an object, as a text, or in base64.
fn bytes_of(written: &str) -> Option<Bytes> {
    if written == "null" {
        return Some(Bytes::new());
    }
    if !written.starts_with('"') {
        return Some(Bytes::copy_from_slice(written.as_bytes()));
    }
    let text: String = serde_json::from_str(written).ok()?;
    let is_json = text.trim_start().starts_with(['{', '[']);
    let decoded = || base64::engine::general_purpose::STANDARD.decode(text.trim()).ok();
    if let Some(bytes) = (!is_json && text.len() > 4).then(decoded).flatten()
        && bytes.trim_ascii_start().starts_with(b"{")
    {
        return Some(bytes.into());
    }
    Some(text.into_bytes().into())
}

#[cfg(test)]
#[path = "lines_tests.rs"]
mod tests;
