//! An audit on several threads: each vehicle is judged by one of them, so that the order of its messages stays.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use super::result::{AuditResult, Recording};
use super::topics::Named;
use super::{Address, Audit, AuditError, Options};
use tck_capture::{Message, Told, Wire, WireEvent};
use tck_journal::event::Packet;
use tck_judge::Rules;

/// How many messages are handed over at once, and how many times as many wait.
const BATCH: usize = 64;
const WAITING: usize = 16;
/// More threads than this have nothing to do but wait for the reader.
const MOST: usize = 4;

/// What a thread is told.
enum Job {
    Message(u64, Message),
    /// Whether it is a message of a vehicle that another thread judges.
    Wire(u64, Wire, bool),
    Interrupted,
}

/// One of the threads, as the reader sees it.
struct Worker {
    jobs: SyncSender<Vec<Job>>,
    batch: Vec<Job>,
}

impl Worker {
    fn take(&mut self, job: Job) {
        self.batch.push(job);
        if self.batch.len() >= BATCH {
            self.pass();
        }
    }

    fn pass(&mut self) {
        // A thread that is gone has panicked, which shows when it is joined.
        let _ = self
            .jobs
            .send(std::mem::replace(&mut self.batch, Vec::with_capacity(BATCH)));
    }
}

/// Who hands messages out.
pub struct WorkerPool<'r> {
    /// Reads topics, and counts what is of no vehicle.
    desk: Audit<'r>,
    hands: Vec<Worker>,
    /// Packets were recorded, though time is to be cut.
    has_packets: bool,
}

impl WorkerPool<'_> {
    /// How many messages were handed on.
    #[must_use]
    pub fn messages(&self) -> u64 {
        self.desk.messages
    }

    /// Whose topic this is; `None` for one of no vehicle, or of one that is not wanted.
    #[must_use]
    pub fn address(&self, topic: &str) -> Option<Address> {
        self.desk.address(topic)
    }

    /// Hands on what is told next.
    pub fn take(&mut self, told: Told) {
        match told {
            Told::Message(message) => self.message(message),
            Told::Wire(_) if self.desk.shared.options.cut.is_some() => self.has_packets = true,
            Told::Wire(wire) => {
                let number = self.desk.messages + 1;
                let owner = match &wire.event {
                    WireEvent::Packet {
                        packet: Packet::Publish { topic, .. },
                        sent: true,
                    } => self.desk.wanted(topic).map(|named| self.owner(&named)),
                    _ => None,
                };
                for (at, hand) in self.hands.iter_mut().enumerate() {
                    let elsewhere = owner.is_some_and(|owner| owner != at);
                    hand.take(Job::Wire(number, wire.clone(), elsewhere));
                }
            }
        }
    }

    fn message(&mut self, message: Message) {
        if message.after_gap {
            for hand in &mut self.hands {
                hand.take(Job::Interrupted);
            }
        }
        let desk = &mut self.desk;
        desk.messages += 1;
        desk.first = desk.first.or(message.at);
        desk.last = message.at.or(desk.last);
        let Some(named) = desk.wanted(&message.topic) else {
            desk.stray(desk.messages, &message);
            return;
        };
        if !desk.shared.options.does(&named.manufacturer, &named.serial_number) {
            desk.others += 1;
            return;
        }
        let number = desk.messages;
        let owner = self.owner(&named);
        if let Some(hand) = self.hands.get_mut(owner) {
            hand.take(Job::Message(number, message));
        }
    }

    /// Which of the threads judges a vehicle.
    fn owner(&self, named: &Named) -> usize {
        let mut hasher = DefaultHasher::new();
        named.key.hash(&mut hasher);
        usize::try_from(hasher.finish() % self.hands.len().max(1) as u64).unwrap_or_default()
    }
}

/// Judges what `feed` hands out.
///
/// # Errors
/// What is wrong with the options, and what `feed` says.
pub fn judged<E: From<AuditError>>(
    rules: &Rules,
    options: &Options,
    feed: impl FnOnce(&mut WorkerPool<'_>) -> Result<Vec<Recording>, E>,
) -> Result<AuditResult, E> {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(MOST);
    let desk = Audit::new(rules, options.clone())?;
    thread::scope(|scope| {
        let mut hands = Vec::new();
        let mut working = Vec::new();
        for _ in 0..threads {
            let (jobs, inbox) = sync_channel(WAITING);
            let batch = Vec::with_capacity(BATCH);
            hands.push(Worker { jobs, batch });
            working.push(scope.spawn(move || work(rules, options, &inbox)));
        }
        let mut crew = WorkerPool {
            desk,
            hands,
            has_packets: false,
        };
        let recordings = feed(&mut crew);
        for hand in &mut crew.hands {
            hand.pass();
        }
        let WorkerPool {
            mut desk,
            hands,
            has_packets,
        } = crew;
        drop(hands);
        if has_packets {
            return Err(AuditError::Packets.into());
        }
        let misnamed = std::mem::take(&mut desk.misnamed);
        let mut result = desk.finish(Vec::new());
        for hand in working {
            match hand.join() {
                Ok(part) => {
                    let part = part?;
                    result.beyond += part.beyond;
                    result.others += part.others;
                    result.vehicles.extend(part.vehicles);
                }
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        result.recordings = recordings?;
        // The versions of a vehicle stay in their order.
        result
            .vehicles
            .sort_by(|one, other| one.in_order().cmp(&other.in_order()));
        misnamed.tell(&mut result, rules, options);
        result.conclude();
        Ok(result)
    })
}

fn work(rules: &Rules, options: &Options, inbox: &Receiver<Vec<Job>>) -> Result<AuditResult, AuditError> {
    let mut audit = Audit::new(rules, options.clone())?;
    while let Ok(jobs) = inbox.recv() {
        for job in jobs {
            match job {
                Job::Message(number, message) => audit.numbered(number, message),
                Job::Wire(number, wire, elsewhere) => audit.wire_at(number, wire, elsewhere),
                Job::Interrupted => audit.interrupted(),
            }
        }
    }
    Ok(audit.finish(Vec::new()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::traffic;
    use tck_pack::Role;

    #[test]
    fn many_threads_find_what_one_finds() {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let one = traffic(library, pack, Role::Agv, "order-acceptance/", &["horizon-not-reported"]);
        let mut all = Vec::new();
        for (number, message) in one.iter().enumerate() {
            for vehicle in 0..7 {
                let topic = message.topic.replacen("v2/", &format!("v2/{vehicle}"), 1);
                let after_gap = number == 100 && vehicle == 0;
                all.push(Message {
                    topic,
                    after_gap,
                    ..message.clone()
                });
            }
        }
        let mut single = Audit::new(&library.rules, Options::default()).expect("options");
        for message in &all {
            single.observe(message.clone());
        }
        let single = single.finish(Vec::new());
        let crew = judged::<AuditError>(&library.rules, &Options::default(), |crew| {
            for message in all {
                crew.take(Told::Message(message));
            }
            Ok(Vec::new())
        });
        let crew = crew.expect("judged");
        assert!(crew.vehicles.len() >= 7 && crew.verdict == single.verdict);
        let mut wanted = single;
        wanted.vehicles.sort_by(|one, other| one.topics.cmp(&other.topics));
        assert_eq!(crew, wanted);
    }

    #[test]
    fn a_recording_of_packets_is_not_cut_in_time() {
        let library = tck_testing::library();
        let options = Options {
            cut: Some(std::time::Duration::from_secs(60)),
            ..Options::default()
        };
        let wire = Wire {
            at: None,
            connection: 1,
            certain: true,
            event: WireEvent::Gap { sent: true },
        };
        let judged = judged::<AuditError>(&library.rules, &options, |crew| {
            crew.take(Told::Wire(wire));
            Ok(Vec::new())
        });
        assert_eq!(judged, Err(AuditError::Packets));
    }
}
