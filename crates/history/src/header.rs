//! The first record of a journal, read without the rest: what was started how.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read as _};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use tck_journal::Record;
use tck_journal::event::{Event, RunHeader};

/// A first record is no longer than this, whoever wrote it.
const LONGEST: u64 = 16 << 20;

/// What the first record of a journal says of the run, packed or not; nothing when it is not the beginning of a run.
///
/// # Errors
/// When the file cannot be read.
pub(crate) fn read(journal: &Path) -> io::Result<Option<Box<RunHeader>>> {
    let mut file = BufReader::new(File::open(journal)?);
    let mut line = Vec::new();
    if file.fill_buf()?.starts_with(&[0x1f, 0x8b]) {
        let unpacked = BufReader::new(MultiGzDecoder::new(file));
        unpacked.take(LONGEST).read_until(b'\n', &mut line)?;
    } else {
        file.take(LONGEST).read_until(b'\n', &mut line)?;
    }
    let record = serde_json::from_slice::<Record>(&line).ok();
    Ok(record.and_then(|record| match record.event {
        Event::RunBegun { header } => Some(header),
        _ => None,
    }))
}
