//! The records of a run by their numbers, wherever they are: in memory, or in the file they were written to.

use std::collections::VecDeque;
use std::sync::Arc;

use tck_view::Names;

use super::Entry;
use super::event::{Event, Occurrence, Record};
use super::shelf::{LastRead, LostRecord, Shelf};

/// The records of a run, in order, without a gap, counted from 1.
///
/// All of them are in memory until somebody says that there is a [`Shelf`] to read them back from, and lets them go.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    /// The last ones.
    recent: VecDeque<Arc<Entry>>,
    /// Of those before, what stays in memory.
    kept: Vec<Arc<Entry>>,
    /// The number of the last one.
    last: u64,
    shelf: Option<Arc<Shelf>>,
    has_tap: bool,
    names: Arc<Names>,
}

impl Journal {
    /// So many last records stay in memory where there are more mock AGVs than tests talk about: what a test talks about is in memory
    /// anyway, and all others are read back.
    pub const RECENT: usize = 1_000;

    /// An empty journal.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends what happened, giving it the next number.
    pub fn append(&mut self, occurrence: Occurrence) -> Arc<Entry> {
        let entry = Entry::new(occurrence.numbered(self.last + 1));
        self.push(Arc::clone(&entry));
        entry
    }

    /// Takes over the next record, when reading a journal back.
    pub fn restore(&mut self, record: Record) {
        self.push(Entry::new(record));
    }

    fn push(&mut self, entry: Arc<Entry>) {
        self.last += 1;
        self.has_tap |= matches!(entry.event(), Event::Packet { .. } | Event::Opened { .. });
        self.recent.push_back(entry);
    }

    /// What the version of the run calls the members of messages; what 2.x calls them where nobody has said it.
    #[must_use]
    pub fn names(&self) -> &Names {
        &self.names
    }

    /// Says what the version of the run calls the members of messages.
    pub fn set_names(&mut self, names: &Arc<Names>) {
        self.names = Arc::clone(names);
    }

    /// Says where its records are written to.
    pub fn set_shelf(&mut self, shelf: &Arc<Shelf>) {
        self.shelf = Some(Arc::clone(shelf));
    }

    /// Lets go of messages that are not among so many last records and stand on the shelf: they are read back when somebody asks for
    /// them. Gives about how many bytes of memory that frees.
    pub fn let_go(&mut self, beyond: usize) -> u64 {
        let mut freed = 0;
        while let Some(shelf) = self.shelf.as_ref().filter(|_| self.recent.len() > beyond) {
            let Some(entry) = self.recent.pop_front() else { break };
            if entry.payload().is_none() || !shelf.holds(entry.seq()) {
                self.kept.push(entry);
            } else if Arc::strong_count(&entry) == 1 && entry.read.get().is_some() {
                freed += entry.held();
            }
        }
        freed
    }

    /// All records so far.
    #[must_use]
    pub fn entries(&self) -> Entries<'_> {
        Entries {
            journal: self,
            begin: 1,
            end: self.last + 1,
        }
    }

    /// The records so far that are no messages. None of them is ever let go.
    pub fn beside_messages(&self) -> impl DoubleEndedIterator<Item = &Arc<Entry>> {
        let all = self.kept.iter().chain(&self.recent);
        all.filter(|entry| entry.payload().is_none())
    }

    /// The record with a number.
    #[must_use]
    pub fn get(&self, seq: u64) -> Option<Arc<Entry>> {
        self.find(seq, &mut LastRead::default())
    }

    /// The number of the last record; 0 when there is none.
    #[must_use]
    pub fn last_seq(&self) -> u64 {
        self.last
    }

    /// Whether there is a tap among those who have seen something.
    #[must_use]
    pub fn has_tap(&self) -> bool {
        self.has_tap
    }

    /// The first record that was let go and could not be read back; what was made of these records since lacks it.
    #[must_use]
    pub fn lost(&self) -> Option<&LostRecord> {
        self.shelf.as_ref()?.lost()
    }

    fn find(&self, seq: u64, last_read: &mut LastRead) -> Option<Arc<Entry>> {
        if seq == 0 || seq > self.last {
            return None;
        }
        let back = usize::try_from(self.last - seq).ok()?;
        if let Some(at) = self.recent.len().checked_sub(back + 1) {
            return self.recent.get(at).cloned();
        }
        if let Ok(at) = self.kept.binary_search_by_key(&seq, |entry| entry.seq()) {
            return self.kept.get(at).cloned();
        }
        self.shelf.as_ref()?.read(seq, last_read).map(Entry::new)
    }
}

/// A part of the records of a run, in order.
#[derive(Clone, Copy, Debug)]
pub struct Entries<'a> {
    journal: &'a Journal,
    begin: u64,
    end: u64,
}

impl<'a> Entries<'a> {
    /// Those of them from one number to another one.
    #[must_use]
    pub fn within(self, (first, last): (u64, u64)) -> Self {
        let begin = self.begin.max(first);
        Self {
            begin,
            end: self.end.min(last.saturating_add(1)).max(begin),
            ..self
        }
    }

    /// How many there are.
    #[must_use]
    pub fn len(self) -> usize {
        usize::try_from(self.end - self.begin).unwrap_or(usize::MAX)
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.begin == self.end
    }

    /// The first one.
    #[must_use]
    pub fn first(self) -> Option<Arc<Entry>> {
        self.iter().next()
    }

    /// The last one.
    #[must_use]
    pub fn last(self) -> Option<Arc<Entry>> {
        self.iter().next_back()
    }

    /// Each of them.
    #[must_use]
    pub fn iter(self) -> Iter<'a> {
        Iter {
            journal: self.journal,
            begin: self.begin,
            end: self.end,
            last_read: LastRead::default(),
        }
    }
}

impl<'a> IntoIterator for Entries<'a> {
    type Item = Arc<Entry>;
    type IntoIter = Iter<'a>;

    fn into_iter(self) -> Iter<'a> {
        self.iter()
    }
}

/// Goes through records in order. What cannot be read back is left out, and [`Journal::lost`] says so.
#[derive(Clone, Debug)]
pub struct Iter<'a> {
    journal: &'a Journal,
    begin: u64,
    end: u64,
    last_read: LastRead,
}

impl Iterator for Iter<'_> {
    type Item = Arc<Entry>;

    fn next(&mut self) -> Option<Arc<Entry>> {
        while self.begin < self.end {
            let seq = self.begin;
            self.begin += 1;
            if let Some(entry) = self.journal.find(seq, &mut self.last_read) {
                return Some(entry);
            }
        }
        None
    }
}

impl DoubleEndedIterator for Iter<'_> {
    fn next_back(&mut self) -> Option<Arc<Entry>> {
        while self.begin < self.end {
            self.end -= 1;
            if let Some(entry) = self.journal.find(self.end, &mut self.last_read) {
                return Some(entry);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Payload;
    use crate::file::{self, JournalWriter};
    use std::path::Path;
    use tck_base::clock::{Moment, Stamp};

    /// What clients may send: JSON, no UTF-8, nothing, a line that looks like the end of another one.
    const HOSTILE: [&[u8]; 5] = [
        br#"{ "nodeStates": [1, 2, 3] }"#,
        b"\xff\x00{\n}",
        b"",
        b"\"},\"after\":\"0\"}\n{\"seq\":1}\n",
        "\u{2028}\u{feff}\r\n".as_bytes(),
    ];

    fn happened(event: Event) -> Occurrence {
        let at = Stamp {
            moment: Moment::START,
            utc: jiff::Timestamp::UNIX_EPOCH,
        };
        Occurrence::harness(at, event)
    }

    fn sent(payload: &[u8]) -> Occurrence {
        happened(Event::Sent {
            topic: "state".to_owned(),
            qos: 0,
            retain: false,
            payload: Payload::keep(payload.to_vec().into()),
        })
    }

    /// A journal of so many records, of which each seventh is no message, and the same one with the last five in memory.
    fn both(count: usize, mut writer: JournalWriter) -> (Journal, Journal) {
        let (mut whole, mut light) = (Journal::new(), Journal::new());
        light.set_shelf(writer.shelf());
        for number in 0..count {
            let occurrence = if number % 7 == 3 {
                happened(Event::Note {
                    text: number.to_string(),
                })
            } else {
                sent(HOSTILE[number % HOSTILE.len()])
            };
            whole.append(occurrence.clone());
            let entry = light.append(occurrence);
            writer.write(&entry.record).unwrap();
            drop(entry);
            light.let_go(5);
        }
        (whole, light)
    }

    fn records(all: impl IntoIterator<Item = Arc<Entry>>) -> Vec<Record> {
        all.into_iter().map(|entry| entry.record.clone()).collect()
    }

    #[test]
    fn what_was_let_go_is_read_back_as_it_was() {
        let (whole, light) = both(100, JournalWriter::temporary().unwrap());
        assert!(light.recent.len() + light.kept.len() < 25);
        assert_eq!(records(light.entries()), records(whole.entries()));
        assert_eq!(
            records(light.entries().iter().rev()),
            records(whole.entries().iter().rev())
        );
        for part in [(1, 1), (10, 40), (15, 18), (90, 200), (200, 300), (7, 3), (0, 2)] {
            let (of_light, of_whole) = (light.entries().within(part), whole.entries().within(part));
            assert_eq!(records(of_light), records(of_whole), "{part:?}");
            assert_eq!(of_light.len(), of_whole.iter().count(), "{part:?}");
        }
        for seq in 0..=101 {
            let found = light.get(seq).map(|entry| entry.record.clone());
            assert_eq!(found, whole.get(seq).map(|entry| entry.record.clone()), "#{seq}");
        }
        assert_eq!(light.entries().first().unwrap().seq(), 1);
        assert_eq!(light.entries().last().unwrap().seq(), light.last_seq());
        assert_eq!(light.beside_messages().count(), 14);
        assert_eq!(light.lost(), None);
    }

    #[test]
    fn what_is_written_later_stands_behind_what_was_read_back() {
        let mut writer = JournalWriter::temporary().unwrap();
        let mut journal = Journal::new();
        journal.set_shelf(writer.shelf());
        for number in 0..50_u8 {
            let entry = journal.append(sent(&[number]));
            writer.write(&entry.record).unwrap();
            drop(entry);
            journal.let_go(1);
            let back = journal
                .entries()
                .iter()
                .map(|entry| entry.payload().unwrap().bytes()[0]);
            assert!(back.eq(0..=number));
        }
    }

    #[test]
    fn nothing_is_let_go_that_stands_nowhere_else() {
        let mut writer = JournalWriter::temporary().unwrap();
        let mut journal = Journal::new();
        let first = journal.append(sent(b"{}"));
        assert_eq!(journal.let_go(0), 0, "there is no shelf");
        journal.set_shelf(writer.shelf());
        writer.write(&first.record).unwrap();
        let second = journal.append(sent(b"{}"));
        assert_eq!(
            journal.let_go(0),
            0,
            "somebody holds the first, and the second is not written"
        );
        assert!(Arc::ptr_eq(&journal.get(2).unwrap(), &second));
        assert_eq!(
            records(journal.entries()),
            [first.record.clone(), second.record.clone()]
        );
    }

    #[test]
    fn what_is_let_go_frees_what_it_took() {
        let mut writer = JournalWriter::temporary().unwrap();
        let mut journal = Journal::new();
        journal.set_shelf(writer.shelf());
        let entry = journal.append(sent(HOSTILE[0]));
        writer.write(&entry.record).unwrap();
        let took = entry.held();
        drop(entry);
        assert!(took > HOSTILE[0].len() as u64);
        assert_eq!(journal.let_go(1), 0, "it is the last one");
        assert_eq!(journal.let_go(0), took);
    }

    /// A journal that was written to a file and let go, of which then only the beginning is left.
    fn cut(path: &Path, part: u64) -> Journal {
        let (_, light) = both(100, JournalWriter::create(path).unwrap());
        let file = std::fs::File::options().write(true).open(path).unwrap();
        let length = file.metadata().unwrap().len();
        file.set_len(length * part / 100).unwrap();
        light
    }

    #[test]
    fn a_file_that_was_cut_off_is_told_and_what_is_left_of_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let journal = cut(&folder.path().join("half.jsonl"), 50);
        assert!(journal.get(1).is_some() && journal.lost().is_none());
        assert!(journal.entries().iter().count() < 100);
        let told = journal.lost().unwrap().to_string();
        assert!(
            told.starts_with("record #") && told.ends_with("the file is shorter than what was written"),
            "{told}"
        );
        let journal = cut(&folder.path().join("nothing.jsonl"), 0);
        assert_eq!(journal.get(2).map(|entry| entry.seq()), None);
        assert_eq!(journal.lost().unwrap().seq, 2);
        assert!(journal.get(100).is_some(), "the last ones are in memory");
    }

    #[test]
    fn a_file_in_which_something_else_stands_now_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(file::NAME);
        let (_, journal) = both(100, JournalWriter::create(&path).unwrap());
        let text = std::fs::read_to_string(&path).unwrap();
        let changed = text
            .replace("\"seq\":2,", "\"seq\":3,")
            .replace("\"seq\":20,", "\"squ\":20,");
        std::fs::write(&path, changed).unwrap();
        assert!(journal.get(2).is_none());
        let told = journal.lost().unwrap().to_string();
        assert_eq!(
            told,
            "record #2 cannot be read back from the journal: #3 stands in its place"
        );
        assert!(journal.get(20).is_none());
        assert_eq!(journal.lost().unwrap().seq, 2, "the first one is told");
    }

    #[test]
    fn a_long_journal_of_a_fleet_is_read_from_the_disk_packed_or_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(file::NAME);
        let mut writer = JournalWriter::create(&path).unwrap();
        let mut whole = Journal::new();
        let mut header = crate::event::RunHeader::default();
        header.vehicles.resize(3, crate::event::MockVehicle::default());
        whole.append(happened(Event::RunBegun {
            header: Box::new(header),
        }));
        for number in 0..Journal::RECENT + 100 {
            whole.append(sent(HOSTILE[number % HOSTILE.len()]));
        }
        for entry in whole.entries() {
            writer.write(&entry.record).unwrap();
        }
        let plain = file::read(&path).unwrap().journal;
        file::pack(folder.path()).unwrap();
        let packed = file::read(&folder.path().join(file::PACKED)).unwrap().journal;
        for journal in [plain, packed] {
            assert_eq!(journal.recent.len() + journal.kept.len(), Journal::RECENT + 1);
            assert!(records(journal.entries()) == records(whole.entries()));
            assert_eq!(journal.lost(), None);
        }
    }
}
