//! `drop`: the next PUBLISH packets on a topic are swallowed.

use super::counted::Counted;
use tck_journal::event::Direction;

/// Which packets are swallowed.
#[derive(Clone, Debug, Default)]
pub(super) struct Drop {
    rules: Counted,
}

impl Drop {
    pub(super) fn begin(&mut self, topic: Option<&str>, count: u32, direction: Option<Direction>) {
        self.rules.add(topic, count, direction);
    }

    pub(super) fn takes(&mut self, direction: Direction, topic: &str) -> bool {
        self.rules.take(direction, topic)
    }
}

#[cfg(test)]
mod tests {
    use crate::tap::faults::{Fate, Faults};
    use tck_journal::event::{Direction, LinkFault};

    #[test]
    fn only_the_next_packets_on_the_topic_are_touched() {
        let mut faults = Faults::default();
        faults.apply(&LinkFault::Drop {
            topic: Some("state".to_owned()),
            count: 2,
            direction: Some(Direction::FromDevice),
        });
        let mut fate = |direction, topic| faults.fate_of_publish(direction, topic);
        assert_eq!(fate(Direction::FromDevice, "a/b/order"), Fate::Forward);
        assert_eq!(fate(Direction::ToDevice, "a/b/state"), Fate::Forward);
        assert_eq!(fate(Direction::FromDevice, "a/b/state"), Fate::Swallow);
        assert_eq!(fate(Direction::FromDevice, "a/c/state"), Fate::Swallow);
        assert_eq!(fate(Direction::FromDevice, "a/b/state"), Fate::Forward);
    }
}
