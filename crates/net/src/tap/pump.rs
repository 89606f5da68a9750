//! One direction of a connection through the tap: read, cut into packets, report, hold back, forward.
//!
//! A packet from the device is reported when it arrives, whatever becomes of it; a packet to the device when it
//! goes on, because only then does the device get it.
//!
//! Where no fault is in force, whole packets are forwarded first, and decoded and reported behind that: nobody waits for the
//! journal, and nobody's report of what comes of them can stand before theirs.

use std::collections::VecDeque;
use std::io;
use std::pin::Pin;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering::Relaxed};
use std::task::Poll;
use std::time::Duration;

use bytes::{Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::sync::{Notify, watch};
use tokio::time::Instant;

use super::faults::Fate;
use super::{Control, Shared, rewrite};
use tck_journal::event::{Close, Direction, Event, Packet, Payload, Source};
use tck_wire::{Piece, Reader};

/// How much is held back before the tap stops reading, which lets TCP slow the sender down.
const HELD_LIMIT: usize = 64 << 20;
/// How many bytes are read at once. An empty buffer without room would be read 64 bytes at a time.
const READ_SIZE: usize = 64 << 10;
/// How many bytes go into one write.
const WRITE_SIZE: usize = 64 << 10;
/// How many pieces of garbage of one connection are reported; the rest is only forwarded.
const GARBAGE_LIMIT: u32 = 64;

/// What both directions of a connection know of each other.
#[derive(Default)]
pub(super) struct Both {
    /// How the device's side ended.
    pub(super) device_gone: AtomicBool,
    pub(super) broker_gone: AtomicBool,
    /// Whether the end of the connection was reported.
    pub(super) end_reported: AtomicBool,
    /// Whether the broker got the CONNECT.
    connect_forwarded: AtomicBool,
    /// Protocol level; zero before the CONNECT.
    level: AtomicU8,
    pub(super) changed: Notify,
}

impl Both {
    /// Whether the device has sent a CONNECT.
    pub(super) fn has_begun(&self) -> bool {
        self.level.load(Relaxed) > 0
    }
}

struct Held {
    due: Instant,
    raw: Bytes,
    /// Reported when it goes on.
    report: Option<Event>,
    is_connect: bool,
    /// When it was read, of a message that nothing but the harness holds back.
    read_at: Option<Instant>,
}

/// One direction.
pub(super) struct Pump<'a> {
    pub(super) shared: &'a Shared,
    pub(super) both: &'a Both,
    pub(super) connection: u64,
    pub(super) direction: Direction,
    reader: Reader,
    held: VecDeque<Held>,
    held_bytes: usize,
    garbage: u32,
    restores: u64,
}

impl<'a> Pump<'a> {
    pub(super) fn new(shared: &'a Shared, both: &'a Both, connection: u64, direction: Direction) -> Self {
        Self {
            shared,
            both,
            connection,
            direction,
            reader: match direction {
                Direction::FromDevice => Reader::of_client(),
                Direction::ToDevice => Reader::default(),
            },
            held: VecDeque::new(),
            held_bytes: 0,
            garbage: 0,
            restores: 0,
        }
    }

    /// Runs until its source has ended and what was held back is forwarded.
    pub(super) async fn run<R, W>(&mut self, mut from: R, mut to: W, mut control: watch::Receiver<Control>)
    where
        R: AsyncRead + Unpin,
        W: AsyncWrite + Unpin,
    {
        self.restores = control.borrow_and_update().restores;
        let mut ended = false;
        let mut bytes = BytesMut::with_capacity(READ_SIZE);
        loop {
            if self.forward(&mut to).await.is_err() {
                // The other side is gone; its own direction says how.
                self.held.clear();
                self.held_bytes = 0;
                if ended {
                    return;
                }
            }
            let silent = self.faults(|faults| faults.is_silent(self.direction));
            // A silent link keeps the end of a connection to itself, too.
            if ended && (self.nobody_waits() || self.held.is_empty() && !silent) {
                return;
            }
            let due = self.held.front().map(|held| held.due).filter(|_| !silent);
            tokio::select! {
                biased;
                changed = control.changed() => {
                    if changed.is_err() {
                        return;
                    }
                    let restores = control.borrow_and_update().restores;
                    if restores != self.restores {
                        self.restores = restores;
                        let now = Instant::now();
                        for held in &mut self.held {
                            held.due = now;
                            held.read_at = None;
                        }
                    }
                }
                () = self.both.changed.notified(), if ended => {}
                () = sleep_until(due), if due.is_some() => {}
                read = from.read_buf(&mut bytes), if !ended && self.held_bytes < HELD_LIMIT => {
                    match read {
                        Ok(0) => {
                            ended = true;
                            self.end(Ok(())).await;
                        }
                        Ok(_) => {
                            let read_at = Instant::now();
                            if !self.run_ahead(&bytes, read_at, &mut to).await {
                                self.reader.push(&bytes);
                                self.take_pieces(read_at).await;
                            }
                            bytes.clear();
                        }
                        Err(error) => {
                            ended = true;
                            self.end(Err(error)).await;
                        }
                    }
                }
            }
        }
    }

    /// Whether what is held back has nobody any more who would get it.
    fn nobody_waits(&self) -> bool {
        match self.direction {
            Direction::FromDevice => {
                self.both.broker_gone.load(Relaxed)
                    || !self.both.connect_forwarded.load(Relaxed) && self.faults(|f| f.is_silent(Direction::FromDevice))
            }
            Direction::ToDevice => self.both.device_gone.load(Relaxed),
        }
    }

    fn faults<T>(&self, ask: impl FnOnce(&mut super::faults::Faults) -> T) -> T {
        ask(&mut self.shared.faults.lock().unwrap_or_else(PoisonError::into_inner))
    }

    async fn report(&self, event: Event) {
        self.shared
            .reporter
            .report(Source::Tap, Some(self.direction), event)
            .await;
    }

    async fn end(&mut self, how: io::Result<()>) {
        if let Some(piece) = self.reader.rest() {
            self.take(piece, Instant::now()).await;
        }
        match self.direction {
            Direction::FromDevice => {
                self.both.device_gone.store(true, Relaxed);
                let how = if how.is_ok() {
                    Close::DeviceFin
                } else {
                    Close::DeviceReset
                };
                if !self.both.end_reported.swap(true, Relaxed) {
                    self.report(Event::Closed {
                        connection: self.connection,
                        how,
                    })
                    .await;
                }
            }
            Direction::ToDevice => self.both.broker_gone.store(true, Relaxed),
        }
        self.both.changed.notify_waiters();
        self.both.changed.notify_one();
    }

    /// Forwards what was read before it is decoded and reported, where nothing stands before it and nothing may become of it but
    /// that. What the other side does not take at once is put in line. False when it has to be looked at first.
    async fn run_ahead<W: AsyncWrite + Unpin>(&mut self, bytes: &[u8], read_at: Instant, to: &mut W) -> bool {
        let shared = self.shared;
        let begun = self.both.has_begun() && self.both.connect_forwarded.load(Relaxed);
        if !begun || !self.held.is_empty() || !self.reader.is_between_packets() {
            return false;
        }
        let Some(packets) = tck_wire::whole_packets(bytes) else {
            return false;
        };
        let mut room = shared.reporter.room(packets, bytes.len()).await;
        if !self.faults(|faults| faults.lets_all_by(self.direction)) {
            return false;
        }
        let taken = std::future::poll_fn(|context| {
            let Some(room) = room.take() else {
                return Poll::Ready(None);
            };
            let taken = shared
                .reporter
                .report_behind(room, Source::Tap, Some(self.direction), || {
                    let taken = Pin::new(&mut *to).poll_write(context, bytes);
                    let took = read_at.elapsed();
                    let events = self.decoded(bytes);
                    shared.reporter.passed_on(took, messages(&events));
                    (taken, events)
                });
            Poll::Ready(Some(taken))
        });
        let taken = match taken.await {
            None => return false,
            Some(Poll::Pending) => 0,
            Some(Poll::Ready(Ok(taken))) => taken,
            // The other side is gone; its own direction says how.
            Some(Poll::Ready(Err(_))) => return true,
        };
        if let Some(rest @ [_, ..]) = bytes.get(taken..) {
            self.hold(Held {
                due: Instant::now(),
                raw: Bytes::copy_from_slice(rest),
                report: None,
                is_connect: false,
                read_at: None,
            });
        }
        true
    }

    /// Whole packets as the journal has them.
    fn decoded(&mut self, bytes: &[u8]) -> Vec<Event> {
        self.learn_level();
        self.reader.push(bytes);
        let mut events = Vec::new();
        while let Some(piece) = self.reader.next_piece() {
            let evidence = piece.evidence();
            events.extend(self.told(piece.content, evidence));
        }
        events
    }

    /// A piece as the journal has it; nothing of too much garbage.
    fn told(&mut self, content: Result<Packet, String>, evidence: Bytes) -> Option<Event> {
        let connection = self.connection;
        match content {
            Ok(packet) => Some(Event::Packet { connection, packet }),
            Err(reason) => {
                self.garbage += 1;
                let bytes = Payload::keep(evidence);
                (self.garbage <= GARBAGE_LIMIT).then_some(Event::Undecodable {
                    connection,
                    reason,
                    bytes,
                })
            }
        }
    }

    /// The direction towards the device is read as the CONNECT of the device has it.
    fn learn_level(&mut self) {
        if self.direction == Direction::ToDevice
            && let level @ 1.. = self.both.level.load(Relaxed)
        {
            self.reader.set_level(level);
        }
    }

    async fn take_pieces(&mut self, read_at: Instant) {
        self.learn_level();
        while let Some(piece) = self.reader.next_piece() {
            self.take(piece, read_at).await;
        }
    }

    /// Reports a piece where that is due, asks what becomes of it, and puts it in line.
    async fn take(&mut self, piece: Piece, read_at: Instant) {
        let mut fate = Fate::Forward;
        let mut is_connect = false;
        let is_timed = matches!(piece.content, Ok(Packet::Publish { .. }))
            && self.faults(|faults| faults.lets_all_by(self.direction));
        let evidence = piece.evidence();
        match &piece.content {
            Ok(Packet::Publish { topic, .. }) => {
                fate = self.faults(|faults| faults.fate_of_publish(self.direction, topic));
                if fate != Fate::Forward {
                    let what = if fate == Fate::Swallow {
                        "swallowed"
                    } else {
                        "sent on twice"
                    };
                    self.report(Event::Note {
                        text: format!("a PUBLISH on {topic} was {what}"),
                    })
                    .await;
                }
            }
            Ok(Packet::Connect { level, .. }) => {
                is_connect = true;
                self.both.level.store(*level, Relaxed);
            }
            Ok(_) => {}
            Err(_) => is_connect = piece.raw.first().is_some_and(|first| first >> 4 == 1),
        }
        let event = self.told(piece.content, evidence);
        let report = match self.direction {
            Direction::ToDevice => event,
            Direction::FromDevice => {
                if let Some(event) = event {
                    self.report(event).await;
                }
                None
            }
        };
        let mut raw = piece.raw;
        if is_connect && self.direction == Direction::FromDevice && self.shared.upstream.embedded {
            raw = rewrite::for_embedded_broker(&raw);
        }
        let due = Instant::now() + self.faults(|faults| faults.delay(self.direction));
        if fate == Fate::Twice {
            self.hold(Held {
                due,
                raw: raw.clone(),
                report: report.clone(),
                is_connect,
                read_at: None,
            });
            let (raw, report) = again(&raw, report);
            self.hold(Held {
                due,
                raw,
                report,
                is_connect,
                read_at: None,
            });
        } else if fate == Fate::Forward {
            self.hold(Held {
                due,
                raw,
                report,
                is_connect,
                read_at: is_timed.then_some(read_at),
            });
        }
    }

    fn hold(&mut self, held: Held) {
        self.held_bytes += held.raw.len();
        self.held.push_back(held);
    }

    /// Whether the packet in front may go on now.
    fn may_go(&self) -> bool {
        self.held.front().is_some_and(|held| held.due <= Instant::now())
            && !self.faults(|faults| faults.is_silent(self.direction))
    }

    /// Forwards everything that may go on now, in as few writes as makes sense.
    async fn forward<W: AsyncWrite + Unpin>(&mut self, to: &mut W) -> io::Result<()> {
        while self.may_go() {
            let mut batch = BytesMut::new();
            let mut timed = Vec::new();
            while batch.len() < WRITE_SIZE
                && self.may_go()
                && let Some(held) = self.held.pop_front()
            {
                self.held_bytes -= held.raw.len();
                if let Some(event) = held.report {
                    self.report(event).await;
                }
                if held.is_connect {
                    self.both.connect_forwarded.store(true, Relaxed);
                }
                batch.extend_from_slice(&held.raw);
                timed.extend(held.read_at);
            }
            // How long the other side lets it wait is not the harness's own time.
            for read_at in timed {
                self.shared.reporter.passed_on(read_at.elapsed(), 1);
            }
            to.write_all(&batch).await?;
        }
        to.flush().await
    }
}

/// How many of these are messages.
fn messages(events: &[Event]) -> u64 {
    let is_message = |event: &&Event| {
        matches!(
            event,
            Event::Packet {
                packet: Packet::Publish { .. },
                ..
            }
        )
    };
    events.iter().filter(is_message).count() as u64
}

/// The copy of a PUBLISH that is sent twice: DUP is set where the standard of MQTT allows it.
fn again(raw: &Bytes, report: Option<Event>) -> (Bytes, Option<Event>) {
    let mut copy = raw.to_vec();
    let with_dup = copy.first().is_some_and(|first| first & 0x06 != 0);
    if with_dup && let Some(first) = copy.first_mut() {
        *first |= 0x08;
    }
    let report = report.map(|event| match event {
        Event::Packet {
            connection,
            packet:
                Packet::Publish {
                    topic,
                    qos,
                    retain,
                    packet_id,
                    payload,
                    dup,
                },
        } => {
            let dup = dup || with_dup;
            Event::Packet {
                connection,
                packet: Packet::Publish {
                    topic,
                    qos,
                    retain,
                    dup,
                    packet_id,
                    payload,
                },
            }
        }
        other => other,
    });
    (copy.into(), report)
}

async fn sleep_until(due: Option<Instant>) {
    tokio::time::sleep_until(due.unwrap_or_else(|| Instant::now() + Duration::from_secs(3600))).await;
}

#[cfg(test)]
mod tests;
