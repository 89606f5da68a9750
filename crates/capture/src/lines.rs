//! One recording, line by line.
//!
//! Told apart by themselves: records of our journals; JSON objects with a topic and a payload, whatever usual names those
//! have, or with the names of a [`Mapping`], one a line, over several lines, in an array, or in a member `messages`;
//! `topic payload` as `mosquitto_sub -v` prints it, with a time before it or not; and tables in CSV whose first line names
//! topic and payload. Anything else, such as the lines of a log between them, is counted and left out. A payload may go on
//! over several lines.

use std::collections::VecDeque;
use std::io::{self, BufRead, Read as _};

use bytes::Bytes;

use super::members::{Depth, elements, members};
use super::names::{self, Part};
use super::payload::bytes_of;
use super::table::Table;
use super::{Item, Mapping, Message, SourcePosition, clock_text};
use tck_journal::Record;
use tck_journal::event::PAYLOAD_LIMIT;

/// How long a line may be. A payload that is kept whole fits into it, even where every byte of it is escaped.
const LINE: usize = 8 * PAYLOAD_LIMIT;
/// How long a payload may go on over several lines.
const SPREAD: usize = 4 * PAYLOAD_LIMIT;
const SPREAD_LINES: usize = 20_000;
/// How long a topic with a time before it may be.
const HEAD: usize = 4096;
/// A number before a topic is no time before this one.
const EARLIEST: jiff::Timestamp = jiff::Timestamp::constant(946_684_800, 0);

/// How much was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counted {
    /// Lines in all.
    pub lines: u64,
    /// Lines that hold nothing that could be judged.
    pub skipped: u64,
    /// Frames of connections that are encrypted.
    pub encrypted: u64,
    /// Frames of connections that speak WebSocket.
    pub web_socket: u64,
}

/// How messages follow each other.
enum Form {
    /// Nothing was read yet.
    Unread,
    /// Line by line.
    Lines,
    /// As elements of an array.
    Array,
    /// As rows of a table.
    Table(Table),
}

/// A line that was read.
type Line = Option<Vec<u8>>;

/// One recording, line by line.
pub struct Lines {
    reader: Box<dyn BufRead>,
    file: usize,
    mapping: Mapping,
    counted: Counted,
    form: Form,
    /// Lines that were read ahead in vain.
    ahead: VecDeque<Vec<u8>>,
    /// What the last piece held beside what was given.
    ready: VecDeque<Item>,
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
            form: Form::Unread,
            ahead: VecDeque::new(),
            ready: VecDeque::new(),
        }
    }

    /// How much was read so far.
    #[must_use]
    pub fn counted(&self) -> Counted {
        self.counted
    }

    /// Where the last line stands.
    #[must_use]
    pub fn place(&self) -> SourcePosition {
        SourcePosition {
            file: self.file,
            line: self.counted.lines,
        }
    }

    /// The next message or record; `None` at the end.
    ///
    /// # Errors
    /// What the operating system or the unpacking says.
    pub fn read(&mut self) -> Read {
        if matches!(self.form, Form::Unread) {
            self.form = Form::Lines;
            self.begin()?;
        }
        loop {
            if let Some(item) = self.ready.pop_front() {
                return Ok(Some(item));
            }
            if matches!(self.form, Form::Array) {
                self.element()?;
                continue;
            }
            let Some(line) = self.line()? else { return Ok(None) };
            self.counted.lines += 1;
            let found = if matches!(self.form, Form::Table(_)) {
                self.row(&line)?
            } else {
                self.item(&line)?
            };
            if found.is_some() {
                return Ok(found);
            }
            self.counted.skipped += u64::from(self.ready.is_empty() && !line.trim_ascii().is_empty());
        }
    }

    /// Finds out how messages follow each other.
    fn begin(&mut self) -> io::Result<()> {
        let begin = self.reader.fill_buf()?;
        let blank = |byte: &u8| byte.is_ascii_whitespace();
        let mark = usize::from(begin.starts_with(b"\xef\xbb\xbf")) * 3;
        let before = mark + begin[mark..].iter().take_while(|byte| blank(byte)).count();
        let rest = begin[before..].strip_prefix(b"[").map(<[u8]>::trim_ascii_start);
        if rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(b"{")) {
            let lines = begin[..before].split(|byte| *byte == b'\n').skip(1).count();
            self.reader.consume(before + 1);
            self.counted.lines += u64::try_from(lines).unwrap_or_default();
            self.form = Form::Array;
            return Ok(());
        }
        let Some(line) = self.line()? else { return Ok(()) };
        match Table::named(&line, &self.mapping) {
            Some(table) => {
                self.counted.lines += 1;
                self.form = Form::Table(table);
            }
            None => self.ahead.push_front(line),
        }
        Ok(())
    }

    /// Reads the next element of an array, or finds its end.
    fn element(&mut self) -> io::Result<()> {
        let mut element = Vec::new();
        let mut length = 0;
        let mut depth = Depth::default();
        let mut place = self.place();
        loop {
            let buffer = self.reader.fill_buf()?;
            if buffer.is_empty() {
                // The array was cut off.
                self.counted.lines += 1;
                self.counted.skipped += u64::from(length > 0);
                self.form = Form::Lines;
                return Ok(());
            }
            let mut used = 0;
            let mut closed = false;
            let mut ended = false;
            for byte in buffer {
                if length == 0 && *byte != b'{' {
                    if !byte.is_ascii_whitespace() && *byte != b',' {
                        ended = true;
                        break;
                    }
                } else {
                    if length == 0 {
                        place.line = self.counted.lines + 1;
                    }
                    length += 1;
                    if length <= LINE {
                        element.push(*byte);
                    }
                    closed = depth.closes(*byte);
                }
                used += 1;
                self.counted.lines += u64::from(*byte == b'\n');
                if closed {
                    break;
                }
            }
            self.reader.consume(used);
            if ended {
                // What stands behind the array is read line by line.
                self.form = Form::Lines;
                if self.reader.fill_buf()?.starts_with(b"]") {
                    self.drain()?;
                    self.counted.lines += 1;
                }
                return Ok(());
            }
            if closed {
                let text = std::str::from_utf8(&element).ok().filter(|_| length <= LINE);
                let found = text.map(|text| self.objects(text, place)).unwrap_or_default();
                self.counted.skipped += u64::from(found.is_empty());
                self.ready.extend(found);
                return Ok(());
            }
        }
    }

    /// A row of a table, over several lines where a field is not closed.
    fn row(&mut self, line: &[u8]) -> io::Result<Option<Item>> {
        let place = self.place();
        let mut row = line.to_vec();
        let mut lines = 0;
        while !Table::is_whole(&row) && lines < SPREAD_LINES && row.len() < SPREAD {
            let Some(more) = self.line()? else { break };
            row.extend_from_slice(&more);
            lines += 1;
        }
        self.counted.lines += u64::try_from(lines).unwrap_or_default();
        let Form::Table(table) = &self.form else {
            return Ok(None);
        };
        Ok(table.message(&row, place).map(Item::Message))
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
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
        let may_go_on = line.starts_with(b"{");
        let line = line.trim_ascii();
        let place = self.place();
        if line.starts_with(b"{") {
            let joined = if may_go_on { self.joined(line)? } else { None };
            let text = std::str::from_utf8(joined.as_deref().unwrap_or(line));
            let found = text.map(|text| self.objects(text, place)).unwrap_or_default();
            self.ready.extend(found);
            return Ok(self.ready.pop_front());
        }
        let Some((at, topic, payload)) = timed(line) else {
            return Ok(None);
        };
        let (topic, payload) = (topic.to_owned(), payload.to_vec());
        let payload = self.spread(payload)?;
        Ok(Some(Item::Message(Message {
            at,
            topic,
            payload,
            qos: None,
            retain: None,
            place,
            after_gap: false,
            carried: None,
        })))
    }

    /// An object that goes on over the next lines, as a whole; `None` when it is closed on its line, or never.
    fn joined(&mut self, line: &[u8]) -> io::Result<Option<Vec<u8>>> {
        let mut depth = Depth::default();
        if line.iter().any(|byte| depth.closes(*byte)) {
            return Ok(None);
        }
        let mut whole = line.to_vec();
        let mut taken = Vec::new();
        while !depth.in_text() && taken.len() < SPREAD_LINES && whole.len() < SPREAD {
            let Some(line) = self.line()? else { break };
            // Another one begins: the one before was cut off.
            let begins = line.starts_with(b"{") || timed(line.trim_ascii()).is_some();
            whole.push(b'\n');
            whole.extend_from_slice(line.strip_suffix(b"\n").unwrap_or(&line));
            let closed = !begins && line.iter().any(|byte| depth.closes(*byte));
            taken.push(line);
            if closed {
                self.counted.lines += u64::try_from(taken.len()).unwrap_or_default();
                return Ok(Some(whole));
            }
            if begins {
                break;
            }
        }
        for line in taken.into_iter().rev() {
            self.ahead.push_front(line);
        }
        Ok(None)
    }

    /// What an object holds: a record, a message, or a list of messages.
    fn objects(&self, text: &str, place: SourcePosition) -> Vec<Item> {
        let Some(all) = members(text) else { return Vec::new() };
        let has = |name: &str| all.iter().any(|(known, _)| known == name);
        if self.mapping == Mapping::default() && has("seq") && has("event") {
            let record = serde_json::from_str::<Record>(text);
            return record
                .map(|record| Item::Record(Box::new(record)))
                .into_iter()
                .collect();
        }
        if let Some(message) = self.message(text, &all, place) {
            return vec![Item::Message(message)];
        }
        // Clients that keep the messages of each of their connections.
        let list = all.iter().find(|(name, _)| name == "messages");
        let list = list.and_then(|(_, value)| elements(value)).unwrap_or_default();
        let messages = list.into_iter().filter_map(|element| {
            let all = members(element)?;
            self.message(element, &all, place).map(Item::Message)
        });
        messages.collect()
    }

    fn message(&self, text: &str, all: &[(String, &str)], place: SourcePosition) -> Option<Message> {
        let named = |part: Part| match part.mapped(&self.mapping) {
            Some(path) => at_path(text, path).map(|value| (path, value)),
            None => part.usual().iter().find_map(|usual| {
                let found = all.iter().rev().find(|(name, _)| name.eq_ignore_ascii_case(usual));
                found.map(|(_, value)| (*usual, *value))
            }),
        };
        let own = |part: Part| named(part).map(|(_, value)| value);
        let topic: String = serde_json::from_str(own(Part::Topic)?).ok()?;
        let (name, written) = named(Part::Payload)?;
        let payload = bytes_of(written)?;
        let is_certain = self.mapping.payload.is_some() || name == "payload";
        if !is_certain && !payload.trim_ascii_start().starts_with(b"{") {
            return None;
        }
        Some(Message {
            at: own(Part::Time).and_then(clock_text::read),
            topic,
            payload,
            qos: own(Part::Qos).and_then(names::qos),
            retain: own(Part::Retain).and_then(names::retain),
            place,
            after_gap: false,
            carried: None,
        })
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
            let begins = timed(line.trim_ascii()).is_some();
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
    (is_topic(topic) && payload.starts_with(b"{")).then_some((topic, payload))
}

fn is_topic(text: &str) -> bool {
    text.split('/').count() > 1 && !text.contains(['#', '+', '{', '"']) && !text.contains("://")
}

/// `topic payload`, before which a time may stand.
fn timed(line: &[u8]) -> Option<(Option<jiff::Timestamp>, &str, &[u8])> {
    if let Some((topic, payload)) = topic_and_payload(line) {
        return Some((None, topic, payload));
    }
    let begin = line.iter().take(HEAD).position(|byte| *byte == b'{')?;
    let head = std::str::from_utf8(&line[..begin]).ok()?;
    let (before, topic) = head.strip_suffix([' ', '\t'])?.trim_end().rsplit_once([' ', '\t'])?;
    let before = before.trim().trim_matches(['[', ']', '(', ')', ',', ':']);
    if !is_topic(topic) || before.is_empty() {
        return None;
    }
    let at = clock_text::read(before).filter(|at| *at >= EARLIEST);
    let is_time_of_day = || {
        let part = |byte: u8| byte.is_ascii_digit() || matches!(byte, b':' | b'.' | b',');
        before.matches(':').count() == 2 && before.bytes().all(part)
    };
    (at.is_some() || is_time_of_day()).then_some((at, topic, &line[begin..]))
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

#[cfg(test)]
#[path = "lines_tests.rs"]
mod tests;
