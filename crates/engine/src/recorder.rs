//! Journal, file and judge as one: what is recorded is judged.

use std::sync::Arc;

use super::flood::FloodGuard;
use tck_base::clock::{Moment, WallClock};
use tck_journal::event::{Event, Occurrence, Packet};
use tck_journal::file::JournalWriter;
use tck_journal::{Entry, Histogram, Journal, LostRecord, Spread};
use tck_judge::{JudgeError, Rules, RunJudge, judged};

/// Why something could not be recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be written.
    #[error("cannot write the journal: {0}")]
    Write(#[from] std::io::Error),
    /// What was written is not there any more.
    #[error(transparent)]
    Lost(#[from] LostRecord),
    /// The judge refuses the journal.
    #[error(transparent)]
    Judge(#[from] JudgeError),
}

/// Is shown every record once it is written and judged.
pub type Onlooker = Box<dyn FnMut(&Arc<Entry>) + Send>;

/// Measures how long messages wait until they are recorded and judged.
struct Stopwatch {
    clock: WallClock,
    /// What came before waited for the harness to begin.
    since: Moment,
    taken: Histogram,
}

impl Stopwatch {
    fn note(&mut self, entry: &Entry) {
        let came = entry.at().moment;
        let is_message = matches!(
            entry.event(),
            Event::Message { .. }
                | Event::Packet {
                    packet: Packet::Publish { .. },
                    ..
                }
        );
        if is_message && came >= self.since {
            self.taken.note(self.clock.now().moment.since(came), 1);
        }
    }
}

/// Records and judges.
pub struct Recorder {
    journal: Journal,
    writer: Option<JournalWriter>,
    judge: RunJudge,
    guard: FloodGuard,
    /// Whether what others do was left out once; it is said once.
    leaves_out: bool,
    onlooker: Option<Onlooker>,
    /// None in virtual time.
    stopwatch: Option<Stopwatch>,
    /// Whether there are more mock AGVs than tests talk about.
    has_crowd: bool,
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
            none if none.is_empty() => None,
            entries => Some(judged(rules, entries)?),
        };
        let mut guard = FloodGuard::default();
        for entry in journal.entries() {
            guard.observe_earlier(&entry);
        }
        let entry = journal.append(first);
        let has_crowd = matches!(entry.event(), Event::RunBegun { header } if header.has_crowd());
        if has_crowd && writer.is_none() {
            let mut temporary = JournalWriter::temporary()?;
            for entry in journal.entries().within((1, entry.seq() - 1)) {
                temporary.write(&entry.record)?;
            }
            writer = Some(temporary);
        }
        if let Some(writer) = &mut writer {
            writer.write(&entry.record)?;
            journal.set_shelf(writer.shelf());
        }
        let mut judge = match before {
            Some(before) => before.resumed(&entry)?,
            None => RunJudge::begin(rules, &entry)?,
        };
        judge.observe(&entry)?;
        guard.observe(&entry);
        journal.set_names(judge.timeline().names());
        Ok(Self {
            journal,
            writer,
            judge,
            guard,
            leaves_out: false,
            onlooker: None,
            stopwatch: None,
            has_crowd,
        })
    }

    /// Shows every record from now on to somebody who looks on.
    pub fn is_watched_by(&mut self, onlooker: Onlooker) {
        self.onlooker = Some(onlooker);
    }

    /// Measures from now on how long messages wait until they are recorded and judged, by the clock that stamps them.
    pub fn is_timed_by(&mut self, clock: WallClock) {
        self.stopwatch = Some(Stopwatch {
            clock,
            since: clock.now().moment,
            taken: Histogram::default(),
        });
    }

    /// How long messages have waited until they were recorded and judged; `None` where it was not measured.
    pub fn time_to_judge(&self) -> Option<Spread> {
        self.stopwatch.as_ref()?.taken.spread()
    }

    /// Records one occurrence: file first, then the judge. Of clients that are not the device only so much is recorded; what
    /// is left out comes back with the number of the last record.
    pub fn record(&mut self, occurrence: Occurrence) -> Result<Arc<Entry>, RecordError> {
        if self.guard.is_beset(occurrence.at.moment) && self.judge.can_do_without(&occurrence) {
            let last = self.journal.last_seq();
            if !std::mem::replace(&mut self.leaves_out, true) {
                let text = "clients that are not the device do more than is recorded; until they do less, what has nothing to do \
                            with the device is left out"
                    .to_owned();
                self.append(Occurrence::harness(occurrence.at, Event::Note { text }))?;
            }
            return Ok(Entry::new(occurrence.numbered(last)));
        }
        self.append(occurrence)
    }

    fn append(&mut self, occurrence: Occurrence) -> Result<Arc<Entry>, RecordError> {
        let entry = self.journal.append(occurrence);
        if let Some(writer) = &mut self.writer {
            writer.write(&entry.record)?;
        }
        self.judge.observe(&entry)?;
        if self.judge.has_left_out() {
            self.guard.observe_other(&entry);
        } else {
            self.guard.observe(&entry);
        }
        if let Some(stopwatch) = &mut self.stopwatch {
            stopwatch.note(&entry);
        }
        if self.has_crowd {
            self.guard.let_go(self.journal.let_go(Journal::RECENT));
        }
        if let Some(onlooker) = &mut self.onlooker {
            onlooker(&entry);
        }
        Ok(entry)
    }

    /// Why the run cannot go on as it does, when the device sends more than can be kept.
    pub fn flood(&self) -> Option<&str> {
        self.guard.over()
    }

    /// Counts anew what the device sends. `false` where that is not what takes too much.
    pub fn begin_count_anew(&mut self) -> bool {
        self.guard.begin_anew()
    }

    /// The judge of this run.
    pub fn judge(&self) -> &RunJudge {
        &self.judge
    }

    /// The records so far.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }

    /// Makes sure the file is on the disk, and that what was asked for of it came back.
    pub fn sync(&self) -> Result<(), RecordError> {
        if let Some(writer) = &self.writer {
            writer.sync()?;
        }
        self.journal.lost().map_or(Ok(()), |lost| Err(lost.clone().into()))
    }
}
