//! What the harness has heard of its device under test.
//!
//! A mock AGV has a connection of its own, and may get a command a moment before the harness does. Its answer would then
//! stand in the journal before the command. So it takes a command only when the harness has it, too.

use std::collections::VecDeque;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::Notify;

/// How many messages are remembered that no vehicle has taken yet.
const REMEMBERED: usize = 4_096;
/// A vehicle does not wait longer than this: the message may never come to the harness.
const PATIENCE: Duration = Duration::from_millis(250);

/// Messages the harness has, and the vehicles have not.
#[derive(Debug, Default)]
pub(super) struct Heard {
    messages: Mutex<VecDeque<u64>>,
    more: Notify,
}

impl Heard {
    /// The harness has this message.
    pub(super) fn note(&self, topic: &str, payload: &[u8]) {
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.len() == REMEMBERED {
            messages.pop_front();
        }
        messages.push_back(print(topic, payload));
        drop(messages);
        self.more.notify_waiters();
    }

    /// Waits until the harness has this message, for as long as makes sense.
    pub(super) async fn wait(&self, topic: &str, payload: &[u8]) {
        let print = print(topic, payload);
        let heard = async {
            loop {
                let more = self.more.notified();
                tokio::pin!(more);
                more.as_mut().enable();
                if self.take(print) {
                    return;
                }
                more.await;
            }
        };
        if tokio::time::timeout(PATIENCE, heard).await.is_err() {
            tracing::debug!(topic, "the harness did not hear what its vehicle heard");
        }
    }

    fn take(&self, print: u64) -> bool {
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        let found = messages.iter().position(|known| *known == print);
        found.is_some_and(|at| messages.remove(at).is_some())
    }
}

fn print(topic: &str, payload: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    (topic, payload).hash(&mut hasher);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;

    #[tokio::test]
    async fn a_vehicle_waits_for_the_harness_and_each_message_counts_once() {
        let heard = Arc::new(Heard::default());
        heard.note("order", b"one");
        heard.wait("order", b"one").await;
        assert!(!heard.take(print("order", b"one")));
        let (later, told) = (Arc::clone(&heard), Arc::new(AtomicBool::new(false)));
        let teller = Arc::clone(&told);
        tokio::spawn(async move {
            teller.store(true, Ordering::SeqCst);
            later.note("order", b"one");
        });
        heard.wait("order", b"one").await;
        assert!(told.load(Ordering::SeqCst));
    }

    #[tokio::test]
    async fn it_does_not_wait_for_ever() {
        let heard = Heard::default();
        heard.note("order", b"another one");
        heard.wait("order", b"lost").await;
        assert!(heard.take(print("order", b"another one")));
    }
}
