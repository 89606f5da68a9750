//! Ends a test or a run before a device that floods the harness fills the memory of this machine.
//!
//! Everything a run has seen is kept, since any of it may be evidence. What counts is the memory that takes: a vehicle may talk as
//! much as it likes in a moment, and a long run is no flood. Beside that only the number of messages in a short time is bounded,
//! because each of them is judged. What was found until then stands.

use std::collections::VecDeque;
use std::time::Duration;

use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_journal::event::{Direction, Event};

/// How long is looked back.
const WINDOW: Duration = Duration::from_secs(30);
/// What a device may send in that time. With a tap a message counts twice: on its way to the broker and from there.
const IN_WINDOW: u64 = 10_000;
/// What it may send more for each mock vehicle it commands.
const FOR_EACH_VEHICLE: u64 = 100;
/// How many bytes of memory all records may take: payloads and what they are parsed to. A small machine has as much; the
/// longest run against a vehicle that talks as fast as it may takes a third.
const MEMORY: u64 = 3 << 30;

/// How many records of clients that are not the device are kept within [`WINDOW`]; more are left out of the journal.
const OF_OTHERS: u64 = 2_000;
/// How many records of clients that are not the device may come within [`WINDOW`]: where they cannot be left out, the run
/// ends by more.
const OF_OTHERS_AT_MOST: u64 = 30_000;

/// Counts what comes from the device, and what is held of it.
#[derive(Debug)]
pub struct FloodGuard {
    device: Recent,
    /// What comes from clients that are not the device.
    others: Recent,
    vehicles: u64,
    /// About how many bytes of memory the records take, and how many they may take.
    held: u64,
    memory: u64,
    /// Why it cannot go on like this.
    over: Option<Over>,
}

/// Why a run cannot go on as it does.
#[derive(Debug)]
struct Over {
    why: String,
    /// It is the device that talks too much, and it would do for it to talk less.
    may_pass: bool,
}

impl Default for FloodGuard {
    fn default() -> Self {
        Self::within(MEMORY)
    }
}

impl FloodGuard {
    fn within(memory: u64) -> Self {
        Self {
            device: Recent::default(),
            others: Recent::default(),
            vehicles: 0,
            held: 0,
            memory,
            over: None,
        }
    }

    /// Whether so much came of clients that are not the device that the rest need not be kept.
    #[must_use]
    pub fn is_beset(&self, now: Moment) -> bool {
        self.others.count(now) >= OF_OTHERS
    }

    /// Sees an entry of a client that is not the device.
    pub fn observe_other(&mut self, entry: &Entry) {
        let count = self.others.add(entry.at().moment);
        if count > OF_OTHERS_AT_MOST {
            let why = format!(
                "clients that are not the device under test flood the harness: {count} packets and messages came within 30 s"
            );
            self.ends(why, false);
        }
        self.hold(entry, "from clients that are not the device under test");
    }

    /// Sees one entry.
    pub fn observe(&mut self, entry: &Entry) {
        if let Event::RunBegun { header } = entry.event() {
            self.vehicles = header.vehicles.len() as u64;
        }
        if entry.record.direction == Some(Direction::FromDevice) {
            let count = self.device.add(entry.at().moment);
            if count > IN_WINDOW + FOR_EACH_VEHICLE * self.vehicles {
                let why =
                    format!("the device under test floods the harness: {count} packets and messages came within 30 s");
                self.ends(why, true);
            }
        }
        let of = match entry.record.direction {
            Some(Direction::FromDevice) => "from the device under test",
            _ => "from the harness and its link",
        };
        self.hold(entry, of);
    }

    /// Sees an entry of the part of the run that broke off.
    pub fn observe_earlier(&mut self, entry: &Entry) {
        self.hold(entry, "before the run broke off");
    }

    fn hold(&mut self, entry: &Entry, of: &str) {
        self.held += entry.held();
        if self.held > self.memory {
            let why = format!(
                "the records of this run take {} MB of memory, more than is kept; the last came {of}",
                self.held >> 20
            );
            self.ends(why, false);
        }
    }

    /// So many bytes are not held any more.
    pub fn let_go(&mut self, bytes: u64) {
        self.held = self.held.saturating_sub(bytes);
    }

    fn ends(&mut self, why: String, may_pass: bool) {
        self.over.get_or_insert(Over { why, may_pass });
    }

    /// Why it cannot go on like this, if it cannot.
    #[must_use]
    pub fn over(&self) -> Option<&str> {
        self.over.as_ref().map(|over| over.why.as_str())
    }

    /// Counts anew what the device sends. `false` where something else takes too much, which stays so.
    pub fn begin_anew(&mut self) -> bool {
        if self.over.as_ref().is_some_and(|over| !over.may_pass) {
            return false;
        }
        self.over = None;
        self.device = Recent::default();
        true
    }
}

/// How many came in each second that is looked back at.
#[derive(Debug, Default)]
struct Recent {
    seconds: VecDeque<(u64, u64)>,
}

impl Recent {
    /// One more; gives how many there are.
    fn add(&mut self, now: Moment) -> u64 {
        let second = second_of(now);
        match self.seconds.back_mut() {
            Some((last, count)) if *last == second => *count += 1,
            _ => self.seconds.push_back((second, 1)),
        }
        let is_old = |(at, _): &(u64, u64)| at + WINDOW.as_secs() <= second;
        while self.seconds.front().is_some_and(is_old) {
            self.seconds.pop_front();
        }
        self.count(now)
    }

    fn count(&self, now: Moment) -> u64 {
        let recent = self
            .seconds
            .iter()
            .filter(|(at, _)| at + WINDOW.as_secs() > second_of(now));
        recent.map(|(_, count)| count).sum()
    }
}

fn second_of(moment: Moment) -> u64 {
    moment.since(Moment::START).as_secs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::clock::Stamp;
    use tck_journal::Journal;
    use tck_journal::event::{Occurrence, Payload, Source};

    fn after(guard: &mut FloodGuard, count: u64, each: Duration, size: usize) {
        let mut journal = Journal::new();
        for number in 0..count {
            let entry = journal.append(Occurrence {
                at: Stamp {
                    moment: Moment::START + each * u32::try_from(number).unwrap(),
                    utc: jiff::Timestamp::UNIX_EPOCH,
                },
                source: Source::Link,
                direction: Some(Direction::FromDevice),
                event: Event::Message {
                    topic: "order".into(),
                    qos: 0,
                    retain: false,
                    dup: false,
                    payload: Payload::keep(vec![b' '; size].into()),
                },
            });
            guard.observe(&entry);
        }
    }

    #[test]
    fn a_busy_device_is_left_alone() {
        let mut guard = FloodGuard::default();
        after(&mut guard, 60_000, Duration::from_millis(10), 4000);
        assert_eq!(guard.over(), None);
    }

    #[test]
    fn thousands_of_messages_in_every_second_end_the_run() {
        let mut guard = FloodGuard::default();
        after(&mut guard, 9_000, Duration::from_millis(1), 10);
        assert_eq!(guard.over(), None);
        after(&mut guard, 2_000, Duration::from_millis(1), 10);
        assert!(guard.over().unwrap().contains("floods"));
        assert!(guard.begin_anew() && guard.over().is_none());
        after(&mut guard, 9_000, Duration::from_millis(1), 10);
        assert_eq!(guard.over(), None, "what came before counts no more");
    }

    #[test]
    fn a_message_counts_by_what_is_held_of_it() {
        let mut guard = FloodGuard::default();
        let zeros = format!("[{}0]", "0,".repeat(999));
        let entry = Journal::new().append(Occurrence {
            at: Stamp {
                moment: Moment::START,
                utc: jiff::Timestamp::UNIX_EPOCH,
            },
            source: Source::Link,
            direction: Some(Direction::FromDevice),
            event: Event::Message {
                topic: "state".into(),
                qos: 0,
                retain: false,
                dup: false,
                payload: Payload::keep(zeros.clone().into()),
            },
        });
        guard.observe(&entry);
        let held = guard.held;
        assert!(held > 10 * zeros.len() as u64, "{held}");
        // The same message on its other way has no value of its own.
        guard.observe(&tck_journal::Entry::beside(&entry, entry.record.clone()));
        assert_eq!(guard.held - held, zeros.len() as u64);
    }

    #[test]
    fn what_others_do_is_no_flood_of_the_device() {
        let mut guard = FloodGuard::default();
        let mut journal = Journal::new();
        let mut come = |guard: &mut FloodGuard, count: u64| {
            for _ in 0..count {
                guard.observe_other(&journal.append(Occurrence {
                    at: Stamp {
                        moment: Moment::START,
                        utc: jiff::Timestamp::UNIX_EPOCH,
                    },
                    source: Source::Tap,
                    direction: Some(Direction::FromDevice),
                    event: Event::Opened {
                        connection: 1,
                        peer: String::new(),
                    },
                }));
            }
        };
        come(&mut guard, OF_OTHERS - 1);
        assert!(!guard.is_beset(Moment::START));
        come(&mut guard, 1);
        assert!(guard.is_beset(Moment::START) && !guard.is_beset(Moment::START + WINDOW));
        assert_eq!(guard.over(), None);
        come(&mut guard, OF_OTHERS_AT_MOST);
        assert!(guard.over().unwrap().contains("not the device"));
    }

    #[test]
    fn huge_messages_end_it_by_the_memory_they_take_and_not_by_how_fast_they_come() {
        for each in [Duration::from_millis(1), Duration::from_secs(1)] {
            let mut guard = FloodGuard::within(100 << 20);
            after(&mut guard, 99, each, 1 << 20);
            assert_eq!(guard.over(), None);
            after(&mut guard, 2, each, 1 << 20);
            let why = guard.over().unwrap();
            assert!(
                why.contains("101 MB of memory") && why.contains("the device under test"),
                "{why}"
            );
            assert!(!guard.begin_anew(), "memory that is taken stays taken");
        }
    }

    #[test]
    fn what_the_harness_sends_takes_memory_as_well_and_is_no_message_of_the_device() {
        let mut guard = FloodGuard::within(1 << 20);
        let mut journal = Journal::new();
        for _ in 0..=IN_WINDOW {
            guard.observe(&journal.append(Occurrence::harness(
                Stamp {
                    moment: Moment::START,
                    utc: jiff::Timestamp::UNIX_EPOCH,
                },
                Event::Sent {
                    topic: "order".into(),
                    qos: 0,
                    retain: false,
                    payload: Payload::keep(vec![b' '; 10].into()),
                },
            )));
        }
        assert_eq!(guard.over(), None);
        assert_eq!(guard.held, 10 * (IN_WINDOW + 1));
    }
}
