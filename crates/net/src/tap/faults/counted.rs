//! `drop` and `duplicate`: the next *n* PUBLISH packets on a topic are swallowed, or sent twice.

use super::applies;
use tck_journal::event::Direction;

/// The rules in force, oldest first.
#[derive(Clone, Debug, Default)]
pub(super) struct Counted {
    rules: Vec<Rule>,
}

#[derive(Clone, Debug)]
struct Rule {
    /// Last level of the topic; any when absent.
    topic: Option<String>,
    direction: Option<Direction>,
    left: u32,
}

impl Counted {
    pub(super) fn add(&mut self, topic: Option<&str>, count: u32, direction: Option<Direction>) {
        if count > 0 {
            self.rules.push(Rule {
                topic: topic.map(str::to_owned),
                direction,
                left: count,
            });
        }
    }

    /// Whether no packet is touched.
    pub(super) fn is_empty(&self) -> bool {
        self.rules.is_empty()
    }

    /// Whether a rule covers this packet; if so, it is counted.
    pub(super) fn take(&mut self, direction: Direction, topic: &str) -> bool {
        let last_level = topic.rsplit('/').next().unwrap_or(topic);
        let Some(index) = self.rules.iter().position(|rule| {
            applies(rule.direction, direction) && rule.topic.as_deref().is_none_or(|wanted| wanted == last_level)
        }) else {
            return false;
        };
        self.rules[index].left -= 1;
        if self.rules[index].left == 0 {
            self.rules.remove(index);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use crate::tap::faults::{Fate, Faults};
    use tck_journal::event::{Direction, LinkFault};

    #[test]
    fn only_the_next_packets_on_the_topic_are_touched() {
        let topic = Some("state".to_owned());
        let direction = Some(Direction::FromDevice);
        let count = 2;
        let drop = LinkFault::Drop {
            topic: topic.clone(),
            count,
            direction,
        };
        let duplicate = LinkFault::Duplicate {
            topic,
            count,
            direction,
        };
        for (fault, fated) in [(drop, Fate::Swallow), (duplicate, Fate::Twice)] {
            let mut faults = Faults::default();
            faults.apply(&fault);
            let mut fate = |direction, topic| faults.fate_of_publish(direction, topic);
            assert_eq!(fate(Direction::FromDevice, "a/b/order"), Fate::Forward);
            assert_eq!(fate(Direction::ToDevice, "a/b/state"), Fate::Forward);
            assert_eq!(fate(Direction::FromDevice, "a/b/state"), fated);
            assert_eq!(fate(Direction::FromDevice, "a/c/state"), fated);
            assert_eq!(fate(Direction::FromDevice, "a/b/state"), Fate::Forward);
        }
    }
}
