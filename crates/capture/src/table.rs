//! Tables in CSV: a first line that names the columns, and a message in each row.

use csv::{ByteRecord, ReaderBuilder};

use super::names::{self, Part};
use super::payload::bytes_of_text;
use super::{Mapping, Message, SourcePosition, clock_text};

/// What stands between columns.
const DELIMITERS: [u8; 3] = *b",;\t";

/// Tables in CSV: a first line that names the columns, and a message in each row.
pub(super) struct Table {
    delimiter: u8,
    columns: usize,
    topic: usize,
    payload: usize,
    time: Option<usize>,
    qos: Option<usize>,
    retain: Option<usize>,
}

impl Table {
    /// The table whose columns a line names; `None` when it names no topic and no payload.
    pub fn named(line: &[u8], mapping: &Mapping) -> Option<Self> {
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
        DELIMITERS.into_iter().find_map(|delimiter| {
            let names = fields(line, delimiter)?;
            let column = |part: Part| {
                let is = |wanted: &str| {
                    let mut all = names.iter();
                    all.position(|name| name.trim_ascii().eq_ignore_ascii_case(wanted.as_bytes()))
                };
                match part.mapped(mapping) {
                    Some(name) => is(name),
                    None => part.usual().iter().find_map(|usual| is(usual)),
                }
            };
            Some(Self {
                delimiter,
                columns: names.len(),
                topic: column(Part::Topic)?,
                payload: column(Part::Payload)?,
                time: column(Part::Time),
                qos: column(Part::Qos),
                retain: column(Part::Retain),
            })
        })
    }

    /// Whether no field in quotes is open at the end.
    pub fn is_whole(row: &[u8]) -> bool {
        // Every quote begins a piece; the first piece begins without one.
        row.split(|byte| *byte == b'"').count() % 2 == 1
    }

    /// The message in a row.
    pub fn message(&self, row: &[u8], place: SourcePosition) -> Option<Message> {
        let fields = fields(row, self.delimiter)?;
        let text = |column: usize| std::str::from_utf8(fields.get(column)?).ok();
        let topic = text(self.topic)?.trim();
        // Some tools write the payload as it is, whatever stands in it.
        let unquoted = || {
            let begin = row.iter().position(|byte| *byte == b'{')?;
            std::str::from_utf8(&row[begin..]).ok().map(str::trim_end)
        };
        let is_split = self.payload + 1 == self.columns && fields.len() > self.columns;
        let payload = if is_split { unquoted()? } else { text(self.payload)? };
        let of = |column: Option<usize>| column.and_then(text);
        (!topic.is_empty()).then(|| Message {
            at: of(self.time).and_then(clock_text::read),
            topic: topic.to_owned(),
            payload: bytes_of_text(payload.to_owned()),
            qos: of(self.qos).and_then(names::qos),
            retain: of(self.retain).and_then(names::retain),
            place,
            after_gap: false,
            carried: None,
        })
    }
}

fn fields(row: &[u8], delimiter: u8) -> Option<ByteRecord> {
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(delimiter)
        .from_reader(row);
    let mut record = ByteRecord::new();
    reader.read_byte_record(&mut record).ok().filter(|read| *read)?;
    Some(record)
}
