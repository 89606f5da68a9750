//! JSON Lines in and out.
//!
//! Every record is handed to the operating system as soon as it happens, so that a killed process leaves a
//! readable journal; a last line that is cut off is reported and everything before it is used.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use super::{Journal, Record};

/// Writes records through to a file.
#[derive(Debug)]
pub struct JournalWriter {
    file: File,
    line: Vec<u8>,
    written: u64,
}

impl JournalWriter {
    /// Creates the file; it must not exist yet.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(Self {
            file: File::options().write(true).create_new(true).open(path)?,
            line: Vec::new(),
            written: 0,
        })
    }

    /// Writes one record as one line, in one call to the operating system.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn write(&mut self, record: &Record) -> io::Result<()> {
        self.line.clear();
        serde_json::to_writer(&mut self.line, record)?;
        self.line.push(b'\n');
        self.written += self.line.len() as u64;
        self.file.write_all(&self.line)
    }

    /// How many bytes were written.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Waits until the records are on the disk.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn sync(&self) -> io::Result<()> {
        self.file.sync_all()
    }
}

/// Why a journal could not be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file could not be opened or read.
    #[error("cannot read the journal {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// A line is not a record.
    #[error("{}:{line}: not a journal record: {reason}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
}

/// A journal read back.
#[derive(Debug)]
pub struct Recording {
    /// The records.
    pub journal: Journal,
    /// Whether the last line was cut off, as after a crash.
    pub torn: bool,
}

/// Reads a journal.
///
/// # Errors
/// When the file cannot be read, or a line that is not the last one is not a record.
pub fn read(path: &Path) -> Result<Recording, ReadError> {
    let io = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let mut journal = Journal::new();
    let mut reader = BufReader::new(File::open(path).map_err(io)?);
    let mut text = Vec::new();
    let mut line = 0;
    let mut last = 0;
    loop {
        text.clear();
        if reader.read_until(b'\n', &mut text).map_err(io)? == 0 {
            return Ok(Recording { journal, torn: false });
        }
        line += 1;
        let bad = |reason: String| ReadError::Line {
            path: path.to_owned(),
            line,
            reason,
        };
        match serde_json::from_slice::<Record>(&text) {
            Ok(record) if record.seq <= last => {
                return Err(bad(format!("number {} does not rise from {last}", record.seq)));
            }
            Ok(record) => {
                last = record.seq;
                journal.restore(record);
            }
            Err(_) if !text.ends_with(b"\n") => return Ok(Recording { journal, torn: true }),
            Err(error) => return Err(bad(error.to_string())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::{Moment, Stamp};
    use crate::journal::event::{Event, Occurrence, Packet, Payload, Will};

    fn stamp(micros: u64) -> Stamp {
        Stamp {
            moment: Moment::from_micros(micros),
            utc: jiff::Timestamp::UNIX_EPOCH,
        }
    }

    fn some_records() -> Vec<Record> {
        let will = Will {
            topic: "a/connection".into(),
            payload: Payload::Whole(bytes::Bytes::from_static(b"{\"connectionState\":\"X\"}")),
            qos: 1,
            retain: true,
        };
        let connect = Packet::Connect {
            level: 4,
            client_id: "x/y".into(),
            keep_alive: 15,
            clean_session: true,
            username: None,
            has_password: true,
            will: Some(will),
        };
        let events = [
            Event::Note {
                text: "ü \u{7} ]]>".into(),
            },
            Event::Packet {
                connection: 1,
                packet: connect,
            },
            Event::Message {
                topic: "a/state".into(),
                qos: 0,
                retain: false,
                dup: false,
                payload: Payload::Whole(bytes::Bytes::from_static(b"\xff\x00{")),
            },
            Event::Message {
                topic: "a/state".into(),
                qos: 0,
                retain: false,
                dup: false,
                payload: Payload::keep(vec![7; 2 << 20].into()),
            },
        ];
        let mut journal = Journal::new();
        for (at, event) in events.into_iter().enumerate() {
            journal.append(Occurrence::harness(stamp(at as u64), event));
        }
        journal.entries().iter().map(|entry| entry.record.clone()).collect()
    }

    #[test]
    fn what_is_written_is_read_back_unchanged() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("journal.jsonl");
        let records = some_records();
        let mut writer = JournalWriter::create(&path).expect("create");
        for record in &records {
            writer.write(record).expect("write");
        }
        let back = read(&path).expect("read");
        assert!(!back.torn);
        let back: Vec<_> = back
            .journal
            .entries()
            .iter()
            .map(|entry| entry.record.clone())
            .collect();
        assert_eq!(back, records);
    }

    #[test]
    fn a_torn_last_line_loses_nothing_before_it() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("journal.jsonl");
        let records = some_records();
        let mut writer = JournalWriter::create(&path).expect("create");
        for record in &records {
            writer.write(record).expect("write");
        }
        let bytes = std::fs::read(&path).expect("bytes");
        std::fs::write(&path, &bytes[..bytes.len() - 10]).expect("tear");
        let back = read(&path).expect("read");
        assert!(back.torn);
        assert_eq!(back.journal.entries().len(), records.len() - 1);
    }

    #[test]
    fn a_broken_line_in_the_middle_is_named() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("journal.jsonl");
        std::fs::write(&path, "{}\n{}\n").expect("write");
        let error = read(&path).expect_err("broken").to_string();
        assert!(error.contains("journal.jsonl:1:"), "{error}");
    }
}
