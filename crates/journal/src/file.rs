//! JSON Lines in and out.
//!
//! Every record is handed to the operating system as soon as it happens, so that a killed process leaves a
//! readable journal; a last line that is cut off is reported and everything before it is used.
//!
//! Every line but the first names the one before it by a hash, so that what is changed, added or taken out shows. A journal
//! that ends too early shows by its last record, which is not the end of a run.

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use flate2::Compression;
use flate2::bufread::MultiGzDecoder;
use flate2::write::GzEncoder;
use sha2::{Digest as _, Sha256};

use super::event::{Event, hex};
use super::shelf::Shelf;
use super::{Journal, Record};

/// The name of a journal in a bundle.
pub const NAME: &str = "journal.jsonl";

/// The name of a journal in a bundle that was packed.
pub const PACKED: &str = "journal.jsonl.gz";

/// The journal in a bundle: as it is, or packed.
#[must_use]
pub fn find(folder: &Path) -> PathBuf {
    let packed = folder.join(PACKED);
    if packed.exists() && !folder.join(NAME).exists() {
        return packed;
    }
    folder.join(NAME)
}

/// How a journal is called in its bundle.
#[must_use]
pub fn name_of(path: &Path) -> String {
    let name = path.file_name();
    name.map_or_else(|| NAME.to_owned(), |name| name.to_string_lossy().into_owned())
}

/// Packs the journal of a bundle with gzip.
///
/// # Errors
/// What the operating system says.
pub fn pack(folder: &Path) -> io::Result<()> {
    let draft = folder.join(format!(".{PACKED}.draft"));
    let mut packed = GzEncoder::new(File::create(&draft)?, Compression::default());
    io::copy(&mut File::open(folder.join(NAME))?, &mut packed)?;
    packed.finish()?.sync_all()?;
    std::fs::rename(&draft, folder.join(PACKED))?;
    std::fs::remove_file(folder.join(NAME))
}

/// Writes records through to a file.
#[derive(Debug)]
pub struct JournalWriter {
    shelf: Arc<Shelf>,
    line: Vec<u8>,
    /// The hash of the line that was written last.
    last: Option<String>,
}

impl JournalWriter {
    /// Creates the file; it must not exist yet.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = File::options().read(true).write(true).create_new(true).open(path)?;
        Ok(Self::to(Shelf::new(file)))
    }

    /// Writes to a file that nobody else sees, and that is gone with this process.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn temporary() -> io::Result<Self> {
        Ok(Self::to(Shelf::temporary()?))
    }

    fn to(shelf: Shelf) -> Self {
        Self {
            shelf: Arc::new(shelf),
            line: Vec::new(),
            last: None,
        }
    }

    /// Creates the file with the records of another one in it, byte for byte, to go on with them. A last line that is cut
    /// off is left out.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn going_on(path: &Path, before: &Path) -> io::Result<Self> {
        let mut writer = Self::create(path)?;
        let (mut reader, _) = open(before)?;
        let mut line = Vec::new();
        while reader.read_until(b'\n', &mut line)? > 0 {
            if line.ends_with(b"\n") {
                writer.shelf.append(&line)?;
                writer.last = Some(hash(&line));
            }
            line.clear();
        }
        Ok(writer)
    }

    /// Writes one record as one line, in one call to the operating system.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn write(&mut self, record: &Record) -> io::Result<()> {
        self.line.clear();
        let chained = Chained {
            record,
            after: self.last.as_deref(),
        };
        serde_json::to_writer(&mut self.line, &chained)?;
        self.line.push(b'\n');
        self.shelf.append(&self.line)?;
        self.last = Some(hash(&self.line));
        Ok(())
    }

    /// How many bytes were written.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.shelf.written()
    }

    /// Where records are read back from.
    #[must_use]
    pub fn shelf(&self) -> &Arc<Shelf> {
        &self.shelf
    }

    /// Waits until the records are on the disk.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn sync(&self) -> io::Result<()> {
        self.shelf.sync()
    }
}

/// A record on its line.
#[derive(serde::Serialize)]
struct Chained<'a> {
    #[serde(flatten)]
    record: &'a Record,
    /// The hash of the line before it.
    #[serde(skip_serializing_if = "Option::is_none")]
    after: Option<&'a str>,
}

/// What a line says of the one before it. It is the last member, and no text inside of another one can look like it.
fn link(line: &[u8]) -> Option<&str> {
    let line = std::str::from_utf8(line).ok()?.trim_end().strip_suffix("\"}")?;
    let (rest, hash) = line.rsplit_once('"')?;
    rest.ends_with(",\"after\":").then_some(hash)
}

/// What names a line.
fn hash(line: &[u8]) -> String {
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    hex(&Sha256::digest(line)[..8])
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

/// The lines of a journal, and whether it is packed.
fn open(path: &Path) -> io::Result<(Box<dyn BufRead>, bool)> {
    let mut file = BufReader::new(File::open(path)?);
    let is_packed = file.fill_buf()?.starts_with(&[0x1f, 0x8b]);
    let lines: Box<dyn BufRead> = if is_packed {
        Box::new(BufReader::new(MultiGzDecoder::new(file)))
    } else {
        Box::new(file)
    };
    Ok((lines, is_packed))
}

/// Where the records of a journal are read back from that is too long for memory.
struct ReadBack {
    shelf: Arc<Shelf>,
    /// The lines stand in the journal itself; of a packed one they are written to a temporary file.
    are_there: bool,
}

impl ReadBack {
    fn of(path: &Path, is_packed: bool) -> io::Result<Self> {
        let shelf = if is_packed {
            Shelf::temporary()?
        } else {
            Shelf::new(File::open(path)?)
        };
        Ok(Self {
            shelf: Arc::new(shelf),
            are_there: !is_packed,
        })
    }

    fn add(&self, line: &[u8]) -> io::Result<()> {
        if self.are_there {
            self.shelf.has(line.len());
            return Ok(());
        }
        self.shelf.append(line)
    }
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
    let (mut reader, is_packed) = open(path).map_err(io)?;
    let mut read_back: Option<ReadBack> = None;
    let mut text = Vec::new();
    let mut line = 0;
    let mut last = 0;
    let mut before: Option<String> = None;
    let mut chained = false;
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
            Ok(record) if record.seq != last + 1 => {
                return Err(bad(format!(
                    "number {} follows {last}: records are missing",
                    record.seq
                )));
            }
            Ok(record) => {
                // Journals of earlier versions are not chained.
                let after = link(&text);
                chained |= after.is_some();
                if chained && line > 1 && after != before.as_deref() {
                    return Err(bad(format!(
                        "number {} does not follow the line before it, as it was written: the journal was changed",
                        record.seq
                    )));
                }
                before = Some(hash(&text));
                last = record.seq;
                if line == 1 && matches!(&record.event, Event::RunBegun { header } if header.has_crowd()) {
                    let made = ReadBack::of(path, is_packed).map_err(io)?;
                    journal.set_shelf(&made.shelf);
                    read_back = Some(made);
                }
                if let Some(read_back) = &read_back {
                    read_back.add(&text).map_err(io)?;
                }
                journal.restore(record);
                if read_back.is_some() {
                    journal.let_go(Journal::RECENT);
                }
            }
            Err(_) if !text.ends_with(b"\n") => return Ok(Recording { journal, torn: true }),
            Err(error) => return Err(bad(error.to_string())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{Event, Occurrence, Packet, Payload, Will};
    use tck_base::clock::{Moment, Stamp};

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
    fn a_packed_journal_reads_alike_and_can_be_gone_on_with() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join(NAME);
        let records = some_records();
        let mut writer = JournalWriter::create(&path).expect("create");
        for record in &records[..2] {
            writer.write(record).expect("write");
        }
        let plain = std::fs::read(&path).expect("bytes");
        pack(folder.path()).expect("pack");
        let packed = find(folder.path());
        assert!(packed.ends_with(PACKED) && !path.exists());
        assert_eq!(read(&packed).expect("read").journal.entries().len(), 2);
        let other = folder.path().join("other.jsonl");
        let mut writer = JournalWriter::going_on(&other, &packed).expect("go on");
        for record in &records[2..] {
            writer.write(record).expect("write");
        }
        let whole = std::fs::read(&other).expect("bytes");
        assert!(whole.starts_with(&plain), "what was there is not what it was");
        let back = read(&other).expect("a chain").journal;
        assert_eq!(back.entries().len(), records.len());
    }

    #[test]
    fn a_record_that_is_missing_is_noticed() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("journal.jsonl");
        let mut records = some_records();
        records.remove(1);
        let mut writer = JournalWriter::create(&path).expect("create");
        for record in &records {
            writer.write(record).expect("write");
        }
        let error = read(&path).expect_err("a gap").to_string();
        assert!(error.contains("records are missing"), "{error}");
    }

    #[test]
    fn a_record_that_was_changed_is_noticed() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("journal.jsonl");
        let mut writer = JournalWriter::create(&path).expect("create");
        for record in &some_records() {
            writer.write(record).expect("write");
        }
        let text = std::fs::read_to_string(&path).expect("text");
        assert!(!text.lines().next().expect("a line").contains("\"after\""));
        std::fs::write(&path, text.replace("x/y", "y/x")).expect("change");
        let error = read(&path).expect_err("changed").to_string();
        assert!(
            error.contains(":3:") && error.contains("the journal was changed"),
            "{error}"
        );
    }

    #[test]
    fn a_journal_without_hashes_is_read() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("journal.jsonl");
        let lines = some_records().into_iter().map(|record| {
            let mut line = serde_json::to_vec(&record).expect("JSON");
            line.push(b'\n');
            line
        });
        std::fs::write(&path, lines.collect::<Vec<_>>().concat()).expect("write");
        assert_eq!(read(&path).expect("read").journal.entries().len(), some_records().len());
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
