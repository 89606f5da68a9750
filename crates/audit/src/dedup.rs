//! Messages in the order in which they were published, each once.
//!
//! Two recorders may have seen the same message, and what they tell may be out of order. A message that runs ahead of
//! the count of its topic is held back for a moment, in which those before it may still come.

use std::collections::{BTreeMap, VecDeque};
use std::hash::BuildHasher as _;
use std::time::Duration;

use tck_base::clock::Moment;
use tck_view::Print;

/// How many messages of a vehicle are remembered to know them again.
const REMEMBERED: usize = 512;
/// How long a message is held back.
const HELD: Duration = Duration::from_millis(100);
/// How many of a topic are held back at most.
const AHEAD: usize = 32;

/// The last messages.
#[derive(Debug, Default)]
pub(super) struct Known {
    prints: VecDeque<u64>,
    hash: foldhash::quality::RandomState,
}

impl Known {
    /// Whether the same came on the same topic before: the same values, however a recorder writes them (`%J` of `mosquitto_sub`
    /// writes numbers anew), or the same bytes of what is no message.
    pub fn again(&mut self, topic: &str, payload: &[u8], values: Option<Print>) -> bool {
        let print = match values {
            Some(values) => self.hash.hash_one((topic, values)),
            None => self.hash.hash_one((topic, payload)),
        };
        if self.prints.contains(&print) {
            return true;
        }
        if self.prints.len() == REMEMBERED {
            self.prints.pop_front();
        }
        self.prints.push_back(print);
        false
    }
}

/// Holds messages of one topic back.
#[derive(Debug)]
pub(super) struct Sorted<T> {
    /// The number that comes next, if the count has begun.
    next: Option<u64>,
    held: BTreeMap<u64, (Moment, T)>,
}

impl<T> Default for Sorted<T> {
    fn default() -> Self {
        Self {
            next: None,
            held: BTreeMap::new(),
        }
    }
}

impl<T> Sorted<T> {
    /// Takes a message with its headerId, if it has one; gives those that are due.
    pub fn take(&mut self, id: Option<u64>, at: Moment, message: T) -> Vec<T> {
        let Some(id) = id else {
            let mut due = self.all();
            due.push(message);
            return due;
        };
        let Some(next) = self.next else {
            self.next = id.checked_add(1);
            return vec![message];
        };
        let is_ahead = id > next && id - next <= AHEAD as u64 && self.held.len() < AHEAD;
        if is_ahead && !self.held.contains_key(&id) {
            self.held.insert(id, (at, message));
            return Vec::new();
        }
        let mut due = Vec::new();
        if id != next {
            // The count goes on elsewhere.
            due = self.all();
        }
        due.push(message);
        self.next = id.checked_add(1);
        self.follow(&mut due);
        due
    }

    /// Those that have been held back for long enough, and what follows them.
    pub fn due(&mut self, now: Moment) -> Vec<T> {
        let mut due = Vec::new();
        while let Some(entry) = self.held.first_entry() {
            let id = *entry.key();
            let oldest = self.held.values().map(|(at, _)| *at).min();
            if oldest.is_none_or(|oldest| now.since(oldest) <= HELD) {
                break;
            }
            if let Some((_, message)) = self.held.remove(&id) {
                due.push(message);
            }
            self.next = id.checked_add(1);
            self.follow(&mut due);
        }
        due
    }

    /// The one that is held back for longest.
    pub fn oldest(&self) -> Option<&T> {
        let oldest = self.held.values().min_by_key(|(at, _)| *at);
        oldest.map(|(_, message)| message)
    }

    /// All that are held back, in their order.
    pub fn all(&mut self) -> Vec<T> {
        if let Some(last) = self.held.keys().next_back() {
            self.next = last.checked_add(1);
        }
        std::mem::take(&mut self.held)
            .into_values()
            .map(|(_, message)| message)
            .collect()
    }

    fn follow(&mut self, due: &mut Vec<T>) {
        while let Some((_, message)) = self.next.and_then(|next| self.held.remove(&next)) {
            due.push(message);
            self.next = self.next.and_then(|next| next.checked_add(1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What comes out for these numbers, ten milliseconds apart.
    fn sorted(ids: &[u64]) -> Vec<u64> {
        let mut sorted = Sorted::default();
        let mut out = Vec::new();
        for (at, id) in ids.iter().enumerate() {
            let now = Moment::from_micros(at as u64 * 10_000);
            out.extend(sorted.due(now));
            out.extend(sorted.take(Some(*id), now, *id));
        }
        out.extend(sorted.all());
        out
    }

    #[test]
    fn what_runs_ahead_waits_for_what_comes_late() {
        assert_eq!(sorted(&[1, 3, 2, 4]), [1, 2, 3, 4]);
        assert_eq!(sorted(&[1, 4, 3, 2, 5, 7, 6]), [1, 2, 3, 4, 5, 6, 7]);
    }

    #[test]
    fn what_never_comes_is_not_waited_for() {
        let ids: Vec<u64> = (0..40).filter(|id| *id != 7).collect();
        assert_eq!(sorted(&ids), ids);
        // A count that begins anew goes on from there.
        assert_eq!(sorted(&[5, 6, 1, 2, 3]), [5, 6, 1, 2, 3]);
    }

    #[test]
    fn the_same_bytes_are_known_again() {
        let mut known = Known::default();
        assert!(!known.again("a", b"{}", None));
        assert!(!known.again("b", b"{}", None));
        assert!(known.again("a", b"{}", None));
        for number in 0..REMEMBERED {
            known.again("a", &number.to_le_bytes(), None);
        }
        assert!(!known.again("a", b"{}", None));
    }

    proptest! {
        #[test]
        fn nothing_is_lost_and_nothing_made(ids in prop::collection::vec(0..60_u64, 0..80)) {
            let mut out = sorted(&ids);
            let mut wanted = ids.clone();
            out.sort_unstable();
            wanted.sort_unstable();
            prop_assert_eq!(out, wanted);
        }
    }
}
