//! Where everything the bench sees comes together, in order, stamped on arrival.
//!
//! The inbox is bounded by bytes: who wants to put more in waits, and stops reading from its socket while it
//! waits. A flooding device is thus slowed down by TCP; nothing is lost and memory stays bounded.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::{Semaphore, SemaphorePermit, mpsc};

use super::LinkError;
use super::heard::Heard;
use tck_base::clock::{Stamp, WallClock};
use tck_journal::event::{Direction, Event, Occurrence, Packet, Source};
use tck_journal::{Histogram, Spread};

/// How many bytes of payload may wait to be read.
const ROOM: u32 = 64 << 20;
/// What an occurrence costs besides its payload.
const OVERHEAD: u32 = 512;

/// One thing in the inbox.
enum Item {
    Seen(Box<Occurrence>),
    Broken(LinkError),
}

/// The reading end.
pub struct Inbox {
    items: mpsc::UnboundedReceiver<(u32, Item)>,
    room: Arc<Semaphore>,
}

/// The writing end; as many clones as there are sources.
#[derive(Clone)]
pub struct Reporter {
    clock: WallClock,
    items: mpsc::UnboundedSender<(u32, Item)>,
    room: Arc<Semaphore>,
    /// Held while an occurrence is stamped and put in, so that the order of stamps is the order of the inbox.
    turn: Arc<Mutex<()>>,
    heard: Arc<Heard>,
    /// How long the tap took to hand messages on.
    passed_on: Arc<Mutex<Histogram>>,
}

/// Room in the inbox for what is about to be done.
pub struct Room<'a>(SemaphorePermit<'a>);

/// An inbox and the way into it.
pub fn inbox(clock: WallClock) -> (Reporter, Inbox) {
    let (sender, items) = mpsc::unbounded_channel();
    let room = Arc::new(Semaphore::new(ROOM as usize));
    let reporter = Reporter {
        clock,
        items: sender,
        room: room.clone(),
        turn: Arc::default(),
        heard: Arc::default(),
        passed_on: Arc::default(),
    };
    (reporter, Inbox { items, room })
}

impl Reporter {
    /// The clock that stamps.
    #[must_use]
    pub fn clock(&self) -> WallClock {
        self.clock
    }

    /// Reports something that happened. Waits while the inbox is full. When nobody reads any more, the bench
    /// is being taken down and the report is dropped.
    pub async fn report(&self, source: Source, direction: Option<Direction>, event: Event) {
        let cost = cost(&event).min(ROOM);
        let Ok(permit) = self.room.acquire_many(cost).await else {
            return;
        };
        permit.forget();
        let _turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        self.put(cost, self.clock.now(), source, direction, event);
    }

    /// Room for the events of so many packets with so many bytes. Waits while the inbox is full.
    pub async fn room(&self, packets: u32, bytes: usize) -> Option<Room<'_>> {
        let bytes = u32::try_from(bytes).unwrap_or(ROOM);
        let cost = packets.saturating_mul(OVERHEAD).saturating_add(bytes).min(ROOM);
        self.room.acquire_many(cost).await.ok().map(Room)
    }

    /// Does something quick, and reports it with the time before it. What others report stands before or behind all of it: what
    /// comes of it cannot stand before it in the journal.
    pub fn report_behind<T>(
        &self,
        room: Room<'_>,
        source: Source,
        direction: Option<Direction>,
        act: impl FnOnce() -> (T, Vec<Event>),
    ) -> T {
        let mut left = u32::try_from(room.0.num_permits()).unwrap_or(ROOM);
        room.0.forget();
        let turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        let at = self.clock.now();
        let (done, events) = act();
        for event in events {
            let cost = cost(&event).min(left);
            left -= cost;
            self.put(cost, at, source, direction, event);
        }
        drop(turn);
        self.room.add_permits(left as usize);
        done
    }

    /// Puts an event in; who calls this has the turn.
    fn put(&self, cost: u32, at: Stamp, source: Source, direction: Option<Direction>, event: Event) {
        if let Event::Message { topic, payload, .. } = &event {
            self.heard.note(topic, payload.bytes());
        }
        let occurrence = Occurrence {
            at,
            source,
            direction,
            event,
        };
        let _ = self.items.send((cost, Item::Seen(Box::new(occurrence))));
    }

    /// Waits until this message, which a device of the harness got, has been reported.
    pub async fn has_heard(&self, topic: &str, payload: &[u8]) {
        self.heard.wait(topic, payload).await;
    }

    /// So many messages were handed on so long after they had been read.
    pub fn passed_on(&self, took: Duration, messages: u64) {
        let mut passed_on = self.passed_on.lock().unwrap_or_else(PoisonError::into_inner);
        passed_on.note(took, messages);
    }

    /// How long it took to hand messages on; `None` where none was.
    #[must_use]
    pub fn time_to_pass_on(&self) -> Option<Spread> {
        self.passed_on.lock().unwrap_or_else(PoisonError::into_inner).spread()
    }

    /// Reports that the link is broken. Never waits.
    pub fn broken(&self, error: LinkError) {
        let _ = self.items.send((0, Item::Broken(error)));
    }
}

impl Inbox {
    /// The next thing in the inbox; waits for it. Cancel-safe.
    pub async fn next(&mut self) -> Result<Occurrence, LinkError> {
        match self.items.recv().await {
            Some((cost, item)) => self.take(cost, item),
            None => Err(LinkError::Setup("the bench has been stopped".to_owned())),
        }
    }

    /// What is in the inbox already.
    pub fn ready(&mut self) -> Result<Option<Occurrence>, LinkError> {
        match self.items.try_recv() {
            Ok((cost, item)) => self.take(cost, item).map(Some),
            Err(_) => Ok(None),
        }
    }

    fn take(&self, cost: u32, item: Item) -> Result<Occurrence, LinkError> {
        self.room.add_permits(cost as usize);
        match item {
            Item::Seen(occurrence) => Ok(*occurrence),
            Item::Broken(error) => Err(error),
        }
    }
}

/// What keeping an event costs. Oversized payloads were cut already.
fn cost(event: &Event) -> u32 {
    let payload = match event {
        Event::Message { payload, .. }
        | Event::Retained { payload, .. }
        | Event::Sent { payload, .. }
        | Event::Undecodable { bytes: payload, .. }
        | Event::Packet {
            packet: Packet::Publish { payload, .. },
            ..
        } => payload.bytes().len(),
        _ => 0,
    };
    u32::try_from(payload).unwrap_or(ROOM).saturating_add(OVERHEAD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_journal::event::Payload;

    fn big() -> Event {
        Event::Message {
            topic: "t".to_owned(),
            qos: 0,
            retain: false,
            dup: false,
            payload: Payload::Whole(vec![0; 1 << 20].into()),
        }
    }

    #[tokio::test]
    async fn a_full_inbox_makes_the_writer_wait_and_loses_nothing() {
        let (reporter, mut inbox) = inbox(WallClock::start());
        let writer = tokio::spawn(async move {
            for _ in 0..100 {
                reporter.report(Source::Link, None, big()).await;
            }
        });
        tokio::time::sleep(Duration::from_millis(50)).await;
        assert!(!writer.is_finished());
        let mut last = None;
        for _ in 0..100 {
            let at = inbox.next().await.unwrap().at;
            assert!(last <= Some(at));
            last = Some(at);
        }
        writer.await.unwrap();
        assert!(
            matches!(inbox.next().await, Err(LinkError::Setup(_))),
            "the writers are gone"
        );
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn what_follows_from_an_act_stands_behind_it_though_it_is_reported_first() {
        let (reporter, mut inbox) = inbox(WallClock::start());
        let note = |text: &str| Event::Note { text: text.to_owned() };
        for _ in 0..50 {
            let (told, tell) = std::sync::mpsc::channel::<()>();
            let other = reporter.clone();
            let follows = std::thread::spawn(move || {
                tell.recv().unwrap();
                let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
                runtime.block_on(other.report(
                    Source::Link,
                    None,
                    Event::Note {
                        text: "heard".to_owned(),
                    },
                ));
            });
            let room = reporter.room(2, 10).await.unwrap();
            let acted = reporter.report_behind(room, Source::Tap, None, || {
                told.send(()).unwrap();
                std::thread::sleep(Duration::from_millis(1));
                (7, vec![note("sent"), note("and more")])
            });
            assert_eq!(acted, 7);
            follows.join().unwrap();
            let mut texts = Vec::new();
            while let Some(occurrence) = inbox.ready().unwrap() {
                texts.push(occurrence.event);
            }
            assert_eq!(texts, [note("sent"), note("and more"), note("heard")]);
        }
    }

    #[tokio::test]
    async fn room_that_is_not_needed_is_given_back() {
        let (reporter, mut inbox) = inbox(WallClock::start());
        for _ in 0..10 {
            let room = reporter.room(1, ROOM as usize).await.unwrap();
            reporter.report_behind(room, Source::Tap, None, || ((), vec![big()]));
            assert!(inbox.next().await.is_ok());
        }
        drop(reporter.room(1, ROOM as usize).await);
        assert!(reporter.room(1, ROOM as usize).await.is_some());
    }

    #[tokio::test]
    async fn a_broken_link_is_told_even_when_the_inbox_is_full() {
        let (reporter, mut inbox) = inbox(WallClock::start());
        for _ in 0..63 {
            reporter.report(Source::Link, None, big()).await;
        }
        reporter.broken(LinkError::Setup("broken".to_owned()));
        for _ in 0..63 {
            assert!(inbox.next().await.is_ok());
        }
        assert!(inbox.next().await.is_err());
    }
}
