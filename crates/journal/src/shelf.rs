//! The file of a journal: records are written to its end, and read back by their numbers.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use super::Entry;
use super::event::Record;

/// Of so many records the first one's place in the file is known; they are read together.
const BLOCK: u64 = 16;

/// A record that stands in the file and cannot be read back.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("record #{seq} cannot be read back from the journal: {reason}")]
pub struct LostRecord {
    /// Its number.
    pub seq: u64,
    /// Why.
    pub reason: String,
}

/// A file with a record on each line, the first of which has the number 1.
#[derive(Debug)]
pub struct Shelf {
    lines: Mutex<Lines>,
    lost: OnceLock<LostRecord>,
}

#[derive(Debug)]
struct Lines {
    file: File,
    /// Whether the next byte that is written comes behind the last one.
    is_at_end: bool,
    /// Where each block of records begins.
    places: Vec<u64>,
    records: u64,
    /// How many bytes there are.
    end: u64,
}

impl Lines {
    fn add(&mut self, length: usize) {
        if self.records.is_multiple_of(BLOCK) {
            self.places.push(self.end);
        }
        self.records += 1;
        self.end += length as u64;
    }

    /// The lines of a block.
    fn block(&mut self, number: u64) -> io::Result<Vec<u8>> {
        let at = usize::try_from(number).unwrap_or(usize::MAX);
        let missing = || io::Error::from(io::ErrorKind::NotFound);
        let begin = *self.places.get(at).ok_or_else(missing)?;
        let end = self.places.get(at + 1).copied().unwrap_or(self.end);
        let length = usize::try_from(end - begin).map_err(io::Error::other)?;
        let mut bytes = vec![0; length];
        self.is_at_end = false;
        self.file.seek(SeekFrom::Start(begin))?;
        self.file.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}

/// Lines that were read together last, so that whoever goes through all records reads each of them once.
#[derive(Clone, Debug, Default)]
pub struct LastRead {
    block: Option<u64>,
    bytes: Vec<u8>,
}

impl Shelf {
    /// An empty file, open for reading and writing.
    #[must_use]
    pub fn new(file: File) -> Self {
        let lines = Lines {
            file,
            is_at_end: true,
            places: Vec::new(),
            records: 0,
            end: 0,
        };
        Self {
            lines: Mutex::new(lines),
            lost: OnceLock::new(),
        }
    }

    /// An empty file without a name, which is gone with this process, however that ends.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn temporary() -> io::Result<Self> {
        tempfile::tempfile().map(Self::new)
    }

    /// Writes a line in one call to the operating system.
    pub(super) fn append(&self, line: &[u8]) -> io::Result<()> {
        let mut lines = self.lines();
        if !lines.is_at_end {
            let end = lines.end;
            lines.file.seek(SeekFrom::Start(end))?;
            lines.is_at_end = true;
        }
        lines.file.write_all(line)?;
        lines.add(line.len());
        Ok(())
    }

    /// A line of so many bytes stands there already, behind those that are known.
    pub(super) fn has(&self, length: usize) {
        let mut lines = self.lines();
        lines.is_at_end = false;
        lines.add(length);
    }

    pub(super) fn written(&self) -> u64 {
        self.lines().end
    }

    pub(super) fn sync(&self) -> io::Result<()> {
        self.lines().file.sync_all()
    }

    /// The record with this number. `None` when it does not stand there, or cannot be read back.
    #[must_use]
    pub fn get(&self, seq: u64) -> Option<Arc<Entry>> {
        self.holds(seq)
            .then(|| self.read(seq, &mut LastRead::default()))?
            .map(Entry::new)
    }

    /// Whether the record with this number stands there.
    pub(super) fn holds(&self, seq: u64) -> bool {
        seq > 0 && seq <= self.lines().records
    }

    /// Reads the record with this number back. `None` when it cannot be read, which is kept in mind.
    pub(super) fn read(&self, seq: u64, last: &mut LastRead) -> Option<Record> {
        match self.try_read(seq, last) {
            Ok(record) => Some(record),
            Err(reason) => {
                self.lost.get_or_init(|| LostRecord { seq, reason });
                None
            }
        }
    }

    fn try_read(&self, seq: u64, last: &mut LastRead) -> Result<Record, String> {
        let at = seq.checked_sub(1).ok_or("there is none with this number")?;
        let (block, within) = (at / BLOCK, usize::try_from(at % BLOCK).unwrap_or_default());
        // The last block may have grown since.
        if last.block != Some(block) || nth_line(&last.bytes, within).is_none() {
            last.block = None;
            last.bytes = self.lines().block(block).map_err(|error| match error.kind() {
                io::ErrorKind::UnexpectedEof => "the file is shorter than what was written".to_owned(),
                _ => error.to_string(),
            })?;
            last.block = Some(block);
        }
        let line = nth_line(&last.bytes, within).ok_or("its line is not there")?;
        let record: Record = serde_json::from_slice(line).map_err(|error| error.to_string())?;
        if record.seq == seq {
            Ok(record)
        } else {
            Err(format!("#{} stands in its place", record.seq))
        }
    }

    /// The first record that could not be read back.
    pub(super) fn lost(&self) -> Option<&LostRecord> {
        self.lost.get()
    }

    fn lines(&self) -> MutexGuard<'_, Lines> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn nth_line(bytes: &[u8], number: usize) -> Option<&[u8]> {
    let mut lines = bytes.split_inclusive(|byte| *byte == b'\n');
    lines.nth(number).filter(|line| line.ends_with(b"\n"))
}
