//! Where everything the bench sees comes together, in order, stamped on arrival.
//!
//! The inbox is bounded by bytes: who wants to put more in waits, and stops reading from its socket while it
//! waits. A flooding device is thus slowed down by TCP; nothing is lost and memory stays bounded.

use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::{Semaphore, mpsc};

use super::LinkError;
use super::heard::Heard;
use tck_base::clock::WallClock;
use tck_journal::event::{Direction, Event, Occurrence, Packet, Source};

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
}

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
        if let Event::Message { topic, payload, .. } = &event {
            self.heard.note(topic, payload.bytes());
        }
        let occurrence = Occurrence {
            at: self.clock.now(),
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
    use std::time::Duration;

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
