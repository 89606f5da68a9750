//! A journal of what was heard, in parts that each can be judged by themselves.

use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tck_base::clock::Stamp;
use tck_journal::event::{Close, Direction, Event, Record, RunHeader, Source};
use tck_journal::file::JournalWriter;

/// When a part is closed and the next one begun.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rotation {
    /// At this size in bytes.
    pub size: Option<u64>,
    /// After this time.
    pub every: Option<Duration>,
    /// How many closed parts are kept; older ones are removed.
    pub keep: Option<usize>,
}

/// A journal of what was heard, in parts that each can be judged by themselves.
pub(super) struct Recorder {
    path: PathBuf,
    rotation: Rotation,
    header: RunHeader,
    writer: JournalWriter,
    begun: Stamp,
    seq: u64,
    /// Closed parts, the oldest first.
    closed: VecDeque<PathBuf>,
}

impl Recorder {
    /// Begins. A file that is there keeps what it holds, under another name; what is no file is refused, since its parts could not
    /// be closed under names of their own.
    pub fn create(path: &Path, rotation: Rotation, header: RunHeader, at: Stamp) -> io::Result<Self> {
        if let Ok(found) = path.metadata() {
            if !found.is_file() {
                return Err(io::Error::new(io::ErrorKind::InvalidInput, "this is no file"));
            }
            let modified = found.modified().ok().and_then(|time| time.try_into().ok());
            std::fs::rename(path, aside(path, modified.unwrap_or(at.utc)))?;
        }
        let mut this = Self {
            writer: JournalWriter::create(path)?,
            path: path.to_owned(),
            rotation,
            header,
            begun: at,
            seq: 0,
            closed: VecDeque::new(),
        };
        this.begin(at)?;
        Ok(this)
    }

    /// Records a message that was heard.
    pub fn message(&mut self, at: Stamp, event: Event) -> io::Result<()> {
        self.record(at, Source::Link, None, event)
    }

    /// Records something that was heard or seen.
    pub fn record(&mut self, at: Stamp, source: Source, direction: Option<Direction>, event: Event) -> io::Result<()> {
        let is_full = self.rotation.size.is_some_and(|size| self.writer.written() >= size);
        let is_old = self
            .rotation
            .every
            .is_some_and(|every| at.moment.since(self.begun.moment) >= every);
        if is_full || is_old {
            self.rotate(at)?;
        }
        self.write_of(at, source, direction, event)
    }

    /// Records that nothing is heard from here on.
    pub fn cut_off(&mut self, at: Stamp, why: &str) -> io::Result<()> {
        let text = format!("nothing is heard: {why}");
        self.write(at, Source::Harness, Event::Note { text })?;
        let gone = Event::Closed {
            connection: 0,
            how: Close::Broker,
        };
        self.write(at, Source::Link, gone)
    }

    /// Closes the last part.
    pub fn finish(&self) -> io::Result<()> {
        self.writer.sync()
    }

    fn begin(&mut self, at: Stamp) -> io::Result<()> {
        let header = Box::new(self.header.clone());
        self.write(at, Source::Harness, Event::RunBegun { header })
    }

    fn rotate(&mut self, at: Stamp) -> io::Result<()> {
        self.writer.sync()?;
        let closed = aside(&self.path, self.begun.utc);
        std::fs::rename(&self.path, &closed)?;
        self.closed.push_back(closed);
        while self.rotation.keep.is_some_and(|keep| self.closed.len() > keep) {
            if let Some(oldest) = self.closed.pop_front() {
                // Somebody may have taken it away already.
                let _ = std::fs::remove_file(oldest);
            }
        }
        self.writer = JournalWriter::create(&self.path)?;
        self.begun = at;
        self.begin(at)
    }

    fn write(&mut self, at: Stamp, source: Source, event: Event) -> io::Result<()> {
        self.write_of(at, source, None, event)
    }

    fn write_of(&mut self, at: Stamp, source: Source, direction: Option<Direction>, event: Event) -> io::Result<()> {
        self.seq += 1;
        self.writer.write(&Record {
            seq: self.seq,
            at,
            source,
            direction,
            event,
        })
    }
}

/// Another name for a file, which nobody has: with a time before the extension, so that names stand in order.
fn aside(path: &Path, time: jiff::Timestamp) -> PathBuf {
    let part = |part: Option<&std::ffi::OsStr>| part.map(|part| part.to_string_lossy().into_owned());
    let stem = part(path.file_stem()).unwrap_or_default();
    let extension = part(path.extension())
        .map(|extension| format!(".{extension}"))
        .unwrap_or_default();
    let time: String = format!("{time:.3}")
        .chars()
        .filter(|c| !matches!(c, ':' | '-'))
        .collect();
    let names = std::iter::once(String::new()).chain((2..).map(|number| format!("-{number}")));
    let mut paths = names.map(|more| path.with_file_name(format!("{stem}-{time}{more}{extension}")));
    paths.find(|path| !path.exists()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::clock::Moment;
    use tck_capture::merge::Merged;
    use tck_capture::{Lines, Mapping, Told, input};
    use tck_journal::Payload;

    fn at(seconds: u64) -> Stamp {
        let start = Stamp {
            moment: Moment::START,
            utc: jiff::Timestamp::from_second(1_700_000_000).expect("time"),
        };
        start.after(Duration::from_secs(seconds))
    }

    fn heard(number: u64) -> Event {
        Event::Message {
            topic: "a/v2/m/s/state".to_owned(),
            qos: 0,
            retain: false,
            dup: false,
            payload: Payload::keep(number.to_string().into_bytes().into()),
        }
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).expect("folder");
        let mut names: Vec<String> = entries
            .map(|entry| entry.expect("entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Payload, and whether there was a gap before.
    fn read(folder: &Path) -> Vec<(String, bool)> {
        let files = names(folder).into_iter().enumerate().map(|(number, name)| {
            let reader = input::open(&folder.join(&name)).expect("readable");
            (name, Lines::new(reader, number, Mapping::default()).into())
        });
        let mut merged = Merged::new(files.collect()).expect("readable");
        let mut all = Vec::new();
        while let Some(Told::Message(message)) = merged.read().expect("readable") {
            let payload = String::from_utf8_lossy(&message.payload).into_owned();
            all.push((payload, message.after_gap));
        }
        all
    }

    #[test]
    fn parts_are_closed_by_time_and_size_and_the_oldest_ones_go() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("site.jsonl");
        std::fs::write(&path, "kept\n").expect("write");
        let rotation = Rotation {
            size: Some(1200),
            every: Some(Duration::from_secs(10)),
            keep: Some(2),
        };
        let mut recorder = Recorder::create(&path, rotation, RunHeader::default(), at(0)).expect("create");
        for number in 0..40 {
            recorder.message(at(number), heard(number)).expect("write");
        }
        recorder.finish().expect("finish");
        let names = names(folder.path());
        assert_eq!(names.len(), 4, "{names:?}");
        let kept = names
            .iter()
            .filter(|name| std::fs::read_to_string(folder.path().join(name)).is_ok_and(|text| text == "kept\n"));
        assert_eq!(kept.count(), 1);
        let all = read(folder.path());
        assert_eq!(all.last().map(|(payload, _)| payload.as_str()), Some("39"));
        assert!(all.len() < 40 && all.len() > 4, "{}", all.len());
        let sizes = names
            .iter()
            .map(|name| folder.path().join(name).metadata().expect("size").len());
        assert!(sizes.max() < Some(2000));
    }

    #[test]
    fn a_time_without_connection_is_kept() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("site.jsonl");
        let mut recorder = Recorder::create(&path, Rotation::default(), RunHeader::default(), at(0)).expect("create");
        recorder.message(at(1), heard(1)).expect("write");
        recorder.cut_off(at(2), "reset").expect("write");
        recorder.message(at(5), heard(2)).expect("write");
        recorder.message(at(6), heard(3)).expect("write");
        let wanted = [("1", false), ("2", true), ("3", false)];
        assert_eq!(
            read(folder.path()),
            wanted.map(|(payload, gap)| (payload.to_owned(), gap))
        );
    }

    #[test]
    fn what_was_not_heard_at_the_end_of_a_part_is_known_in_the_next_one() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("site.jsonl");
        let rotation = Rotation {
            every: Some(Duration::from_secs(4)),
            ..Rotation::default()
        };
        let mut recorder = Recorder::create(&path, rotation, RunHeader::default(), at(0)).expect("file");
        recorder.message(at(1), heard(1)).expect("write");
        recorder.cut_off(at(2), "reset").expect("write");
        recorder.message(at(5), heard(2)).expect("write");
        recorder.message(at(6), heard(3)).expect("write");
        let wanted = [("1", false), ("2", true), ("3", false)];
        assert_eq!(
            read(folder.path()),
            wanted.map(|(payload, gap)| (payload.to_owned(), gap))
        );
    }
}
