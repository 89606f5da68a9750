//! Ends a run before a device that floods the harness fills the memory of this machine.
//!
//! Everything a run has seen is kept, since any of it may be evidence. That is no matter with a device that talks, and
//! gigabytes with one that sends thousands of messages in every second. What was found until then stands.

use std::collections::VecDeque;
use std::time::Duration;

use crate::clock::Moment;
use crate::journal::Entry;
use crate::journal::event::{Direction, Event};

/// How long is looked back.
const WINDOW: Duration = Duration::from_secs(30);
/// What a device may do in that time. With a tap a message counts twice: on its way to the broker and from there.
const IN_WINDOW: Amount = Amount {
    events: 10_000,
    bytes: 400 << 20,
};
/// What it may do more for each mock vehicle it commands.
const FOR_EACH_VEHICLE: u64 = 100;
/// What it may do in the whole run. Bytes are those that are held in memory: a parsed message can take sixteen times as many
/// as it has on the wire.
const IN_RUN: Amount = Amount {
    events: 1_000_000,
    bytes: 6144 << 20,
};

/// What clients that are not the device may do in the same time before what they do is left out of the journal …
const OF_OTHERS: u64 = 2_000;
/// … and before the run ends, because it cannot be left out.
const OF_OTHERS_AT_MOST: u64 = 30_000;

/// Something is counted.
#[derive(Clone, Copy, Debug, Default)]
struct Amount {
    events: u64,
    bytes: u64,
}

impl Amount {
    fn add(&mut self, other: Self) {
        self.events += other.events;
        self.bytes += other.bytes;
    }

    fn exceeds(self, limit: Self) -> bool {
        self.events > limit.events || self.bytes > limit.bytes
    }
}

/// Counts what comes from the device.
#[derive(Debug, Default)]
pub struct FloodGuard {
    /// What came in each second, the last [`WINDOW`] only.
    seconds: VecDeque<(u64, Amount)>,
    run: Amount,
    vehicles: u64,
    /// The same of clients that are not the device.
    others: VecDeque<(u64, Amount)>,
    /// Why the run has to end.
    over: Option<String>,
}

impl FloodGuard {
    /// Whether so much came of clients that are not the device that the rest need not be kept.
    #[must_use]
    pub fn is_beset(&self, now: Moment) -> bool {
        let second = now.since(Moment::START).as_secs();
        let recent = self.others.iter().filter(|(at, _)| at + WINDOW.as_secs() > second);
        recent.map(|(_, amount)| amount.events).sum::<u64>() >= OF_OTHERS
    }

    /// Sees an entry of a client that is not the device.
    pub fn observe_other(&mut self, entry: &Entry) {
        if self.over.is_some() {
            return;
        }
        let bytes = entry.payload().map_or(0, |payload| payload.bytes().len() as u64);
        let amount = Amount { events: 1, bytes };
        let window = count(&mut self.others, entry.at().moment, amount);
        if window.events > OF_OTHERS_AT_MOST || window.bytes > IN_WINDOW.bytes {
            self.over = Some(format!(
                "clients that are not the device under test flood the harness: {} packets and messages with {} MB came within \
                 30 s; the run was ended before this machine runs out of memory, and what was found until then stands",
                window.events,
                window.bytes >> 20
            ));
        }
    }

    /// Sees one entry.
    pub fn observe(&mut self, entry: &Entry) {
        if let Event::RunBegun { header } = entry.event() {
            self.vehicles = header.vehicles.len() as u64;
        }
        if entry.record.direction != Some(Direction::FromDevice) || self.over.is_some() {
            return;
        }
        let bytes = entry.payload().map_or(0, |payload| payload.bytes().len() as u64);
        let amount = Amount { events: 1, bytes };
        self.run.add(Amount {
            events: 1,
            bytes: entry.held(),
        });
        let window = count(&mut self.seconds, entry.at().moment, amount);
        let in_window = Amount {
            events: IN_WINDOW.events + FOR_EACH_VEHICLE * self.vehicles,
            ..IN_WINDOW
        };
        let (seen, when) = if window.exceeds(in_window) {
            (window, "within 30 s")
        } else if self.run.exceeds(IN_RUN) {
            (self.run, "in this run")
        } else {
            return;
        };
        self.over = Some(format!(
            "the device under test floods the harness: {} packets and messages with {} MB came {when}; the run was ended \
             before this machine runs out of memory, and what was found until then stands",
            seen.events,
            seen.bytes >> 20
        ));
    }

    /// Why the run has to end, if it has to.
    #[must_use]
    pub fn over(&self) -> Option<&str> {
        self.over.as_deref()
    }
}

/// Adds an amount to the seconds that are looked back at; gives their sum.
fn count(seconds: &mut VecDeque<(u64, Amount)>, now: Moment, amount: Amount) -> Amount {
    let second = now.since(Moment::START).as_secs();
    match seconds.back_mut() {
        Some((last, sum)) if *last == second => sum.add(amount),
        _ => seconds.push_back((second, amount)),
    }
    while seconds
        .front()
        .is_some_and(|(first, _)| first + WINDOW.as_secs() <= second)
    {
        seconds.pop_front();
    }
    let mut window = Amount::default();
    for (_, sum) in seconds {
        window.add(*sum);
    }
    window
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::Stamp;
    use crate::journal::Journal;
    use crate::journal::event::{Occurrence, Payload, Source};

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
        let held = guard.run.bytes;
        assert!(held > 10 * zeros.len() as u64, "{held}");
        // The same message on its other way has no value of its own.
        guard.observe(&crate::journal::Entry::beside(&entry, entry.record.clone()));
        assert_eq!(guard.run.bytes - held, zeros.len() as u64);
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
    fn a_few_huge_messages_end_it_as_well() {
        let mut guard = FloodGuard::default();
        after(&mut guard, 200, Duration::from_millis(1), 1 << 20);
        assert!(guard.over().is_some());
    }
}
