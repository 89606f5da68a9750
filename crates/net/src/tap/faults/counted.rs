//! A rule for the next so many PUBLISH packets on a topic; `drop` and `duplicate` are made of these.

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
