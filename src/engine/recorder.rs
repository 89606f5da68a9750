//! Journal, file and judge as one: what is recorded is judged.

use std::sync::Arc;

use super::flood::FloodGuard;
use crate::journal::event::Occurrence;
use crate::journal::file::JournalWriter;
use crate::journal::{Entry, Journal};
use crate::judge::{JudgeError, Rules, RunJudge, judged};

/// Why something could not be recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be written.
    #[error("cannot write the journal: {0}")]
    Write(#[from] std::io::Error),
    /// The judge refuses the journal.
    #[error(transparent)]
    Judge(#[from] JudgeError),
}

/// Records and judges.
pub struct Recorder {
    journal: Journal,
    writer: Option<JournalWriter>,
    judge: RunJudge,
    guard: FloodGuard,
}

impl Recorder {
    /// Begins with `RunBegun`; after the records of a run that broke off, where there is one.
    pub fn begin(
        rules: &Rules,
        mut writer: Option<JournalWriter>,
        earlier: Option<Journal>,
        first: Occurrence,
    ) -> Result<Self, RecordError> {
        let mut journal = earlier.unwrap_or_default();
        let before = match journal.entries() {
            [] => None,
            entries => Some(judged(rules, entries)?),
        };
        let entry = journal.append(first);
        if let Some(writer) = &mut writer {
            writer.write(&entry.record)?;
        }
        let mut judge = match before {
            Some(before) => before.resumed(&entry)?,
            None => RunJudge::begin(rules, &entry)?,
        };
        judge.observe(&entry)?;
        let mut guard = FloodGuard::default();
        guard.observe(&entry);
        Ok(Self {
            journal,
            writer,
            judge,
            guard,
        })
    }

    /// Records one occurrence: file first, then the judge.
    pub fn record(&mut self, occurrence: Occurrence) -> Result<Arc<Entry>, RecordError> {
        let entry = self.journal.append(occurrence);
        if let Some(writer) = &mut self.writer {
            writer.write(&entry.record)?;
        }
        self.judge.observe(&entry)?;
        self.guard.observe(&entry);
        Ok(entry)
    }

    /// Why the run has to end, when the device sends more than can be kept.
    pub fn flood(&self) -> Option<&str> {
        self.guard.over()
    }

    /// The judge of this run.
    pub fn judge(&self) -> &RunJudge {
        &self.judge
    }

    /// The judge of this run, to break it off.
    pub fn judge_mut(&mut self) -> &mut RunJudge {
        &mut self.judge
    }

    /// The records so far.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }

    /// Makes sure the file is on the disk.
    pub fn sync(&self) -> Result<(), RecordError> {
        self.writer
            .as_ref()
            .map_or(Ok(()), JournalWriter::sync)
            .map_err(RecordError::Write)
    }
}
