//! The messages of a vehicle one after the other, whatever their topics.
//!
//! A message that runs ahead of the count of its topic is held back, and what came behind it waits with it: a connection message after
//! one that was lost says that the vehicle may have been started anew, and the state behind it is read by that.

use std::collections::BTreeMap;

use super::arrived::Arrived;
use super::dedup::Sorted;
use tck_base::clock::Moment;

/// How many messages wait at most behind one that is held back.
const BEHIND: usize = 256;

/// When a message has its turn: its time, and its number among those of one time.
type Turn = (Moment, u64);

/// The messages of a vehicle that wait for their turn.
#[derive(Default)]
pub(super) struct Turns {
    sorted: BTreeMap<String, Sorted<Arrived>>,
    /// What came behind a message that is held back.
    behind: Vec<(Turn, Arrived)>,
}

impl Turns {
    /// Takes a message with its headerId, by which it is `counted` or not. Gives those whose turn it is.
    pub fn take(&mut self, arrived: Arrived, id: Option<u64>, counted: bool) -> Vec<Arrived> {
        let now = arrived.at.moment;
        let mut due = std::mem::take(&mut self.behind);
        for sorted in self.sorted.values_mut() {
            due.extend(one_after_the_other(sorted.due(now)));
        }
        let taken = if counted {
            let sorted = self.sorted.entry(arrived.name.clone()).or_default();
            sorted.take(id, now, arrived)
        } else {
            vec![arrived]
        };
        due.extend(one_after_the_other(taken));
        if due.len() > BEHIND {
            due.extend(
                self.sorted
                    .values_mut()
                    .flat_map(|sorted| one_after_the_other(sorted.all())),
            );
        }
        due.sort_by_key(|(turn, _)| *turn);
        let held = self.sorted.values().filter_map(Sorted::oldest).map(turn).min();
        if let Some(held) = held {
            self.behind = due.split_off(due.partition_point(|(turn, _)| *turn < held));
        }
        due.into_iter().map(|(_, arrived)| arrived).collect()
    }

    /// All that wait, in their order.
    pub fn all(&mut self) -> Vec<Arrived> {
        let mut rest = std::mem::take(&mut self.behind);
        rest.extend(
            self.sorted
                .values_mut()
                .flat_map(|sorted| one_after_the_other(sorted.all())),
        );
        rest.sort_by_key(|(turn, _)| *turn);
        rest.into_iter().map(|(_, arrived)| arrived).collect()
    }

    /// The counts begin anew.
    pub fn forget(&mut self) {
        self.sorted.clear();
    }
}

fn turn(arrived: &Arrived) -> Turn {
    (arrived.at.moment, arrived.number)
}

/// The messages of one topic in the order of their count: none has its turn before the one that it follows.
fn one_after_the_other(messages: Vec<Arrived>) -> Vec<(Turn, Arrived)> {
    let mut last = Turn::default();
    let in_turn = |mut arrived: Arrived| {
        last = last.max(turn(&arrived));
        arrived.at.moment = last.0;
        (last, arrived)
    };
    messages.into_iter().map(in_turn).collect()
}
