//! One recording, whatever its form.

use std::io::{self, BufRead};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::{CaptureError, Counted, Item, Lines, Mapping, Mcap, Packets, Read, SourcePosition, input, mcap, packets};

/// One recording, whatever its form.
pub struct Recorded {
    form: Form,
    /// What was read and given back.
    back: Option<Item>,
}

enum Form {
    Lines(Box<Lines>),
    Packets(Box<Packets>),
    Mcap(Box<Mcap>),
}

impl Recorded {
    /// Opens the recording of that number; `-` is standard input.
    ///
    /// # Errors
    /// What the operating system says, or what is wrong with the recording.
    pub fn open(path: &Path, number: usize, mapping: Mapping) -> Result<Self, CaptureError> {
        let fail = |source: io::Error| CaptureError {
            name: path.display().to_string(),
            source,
        };
        let reader = input::open(path)?;
        Self::of(reader, number, mapping).map_err(fail)
    }

    /// Opens a recording that grows; it ends when `stop` becomes true.
    ///
    /// # Errors
    /// What the operating system says, or what is wrong with the recording.
    pub fn follow(path: &Path, mapping: Mapping, stop: Arc<AtomicBool>) -> Result<Self, CaptureError> {
        let fail = |source: io::Error| CaptureError {
            name: path.display().to_string(),
            source,
        };
        let reader = input::follow(path, stop).map_err(fail)?;
        Self::of(reader, 0, mapping).map_err(fail)
    }

    fn of(mut reader: Box<dyn BufRead>, number: usize, mapping: Mapping) -> io::Result<Self> {
        let begin = reader.fill_buf()?;
        let form = if packets::begins(begin) {
            Form::Packets(Box::new(Packets::new(reader, number)?))
        } else if mcap::begins(begin) {
            Form::Mcap(Box::new(Mcap::new(reader, number)?))
        } else {
            Form::Lines(Box::new(Lines::new(reader, number, mapping)))
        };
        Ok(Self { form, back: None })
    }

    /// Gives back what was read last, to be read again.
    #[must_use]
    pub fn again(mut self, item: Option<Item>) -> Self {
        self.back = item;
        self
    }

    /// What comes next; `None` at the end.
    ///
    /// # Errors
    /// What the operating system says, or what is wrong with the recording.
    pub fn read(&mut self) -> Read {
        if let Some(item) = self.back.take() {
            return Ok(Some(item));
        }
        match &mut self.form {
            Form::Lines(lines) => lines.read(),
            Form::Packets(packets) => packets.read(),
            Form::Mcap(mcap) => mcap.read(),
        }
    }

    /// How much was read so far.
    #[must_use]
    pub fn counted(&self) -> Counted {
        match &self.form {
            Form::Lines(lines) => lines.counted(),
            Form::Packets(packets) => packets.counted(),
            Form::Mcap(mcap) => mcap.counted(),
        }
    }

    /// What is counted, one of it.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        match &self.form {
            Form::Lines(_) => "line",
            Form::Packets(_) => "frame",
            Form::Mcap(_) => "message",
        }
    }

    /// Where the last of it stands.
    #[must_use]
    pub fn place(&self) -> SourcePosition {
        match &self.form {
            Form::Lines(lines) => lines.place(),
            Form::Packets(packets) => packets.place(),
            Form::Mcap(mcap) => mcap.place(),
        }
    }
}

impl From<Lines> for Recorded {
    fn from(lines: Lines) -> Self {
        Self {
            form: Form::Lines(Box::new(lines)),
            back: None,
        }
    }
}
