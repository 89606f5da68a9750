//! What the harness does to the link, as pure state: no socket and no clock, one small file per fault.
//!
//! The TCP tap and the in-memory bus both ask [`Faults`] what to do with a packet, so that a link fault means
//! the same thing on both.

mod counted;
mod cut;
mod delay;
mod refuse;
mod restore;
mod silence;

use std::time::Duration;

use tck_journal::event::{Direction, LinkFault};

use counted::Counted;
pub use cut::abort;

/// What becomes of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It goes on.
    Forward,
    /// It is swallowed.
    Swallow,
    /// It goes on, and once more.
    Twice,
}

/// What a change of faults means for the connections that are open now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// They stay as they are; what is held back for a direction that is not silent any more goes on.
    Keep,
    /// They end.
    Cut {
        /// By RST instead of FIN.
        reset: bool,
    },
}

/// The faults in force.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    refuse: refuse::Refuse,
    silence: silence::Silence,
    delay: delay::Delay,
    drop: Counted,
    duplicate: Counted,
}

impl Faults {
    /// Brings `fault` into force and says what it means for open connections.
    pub fn apply(&mut self, fault: &LinkFault) -> Change {
        match fault {
            LinkFault::Cut { reset } => return cut::begin(&mut self.refuse, *reset),
            LinkFault::Silence { direction } => self.silence.begin(*direction),
            LinkFault::Delay { millis, direction } => self.delay.begin(Duration::from_millis(*millis), *direction),
            LinkFault::Drop {
                topic,
                count,
                direction,
            } => self.drop.add(topic.as_deref(), *count, *direction),
            LinkFault::Duplicate {
                topic,
                count,
                direction,
            } => {
                self.duplicate.add(topic.as_deref(), *count, *direction);
            }
            LinkFault::Refuse => self.refuse.begin(),
            LinkFault::Restore => restore::all(self),
        }
        Change::Keep
    }

    /// Whether a new connection is let in.
    #[must_use]
    pub fn admits(&self) -> bool {
        self.refuse.admits()
    }

    /// Whether nothing is forwarded in `direction`.
    #[must_use]
    pub fn is_silent(&self, direction: Direction) -> bool {
        self.silence.holds(direction)
    }

    /// How long a packet going in `direction` is held back.
    #[must_use]
    pub fn delay(&self, direction: Direction) -> Duration {
        self.delay.of(direction)
    }

    /// Whether everything going in `direction` goes on at once and as it is.
    #[must_use]
    pub fn lets_all_by(&self, direction: Direction) -> bool {
        !self.is_silent(direction)
            && self.delay(direction).is_zero()
            && self.drop.is_empty()
            && self.duplicate.is_empty()
    }

    /// What becomes of a PUBLISH on `topic`. Counts it.
    pub fn fate_of_publish(&mut self, direction: Direction, topic: &str) -> Fate {
        if self.drop.take(direction, topic) {
            Fate::Swallow
        } else if self.duplicate.take(direction, topic) {
            Fate::Twice
        } else {
            Fate::Forward
        }
    }
}

/// Which of the two directions something applies to; both when none is named.
fn applies(named: Option<Direction>, to: Direction) -> bool {
    named.is_none_or(|named| named == to)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_goes_by_until_a_fault_touches_it_and_again_afterwards() {
        let counted = |topic| LinkFault::Drop {
            topic,
            count: 1,
            direction: None,
        };
        for fault in [
            LinkFault::Silence { direction: None },
            LinkFault::Delay {
                millis: 1,
                direction: None,
            },
            counted(Some("state".to_owned())),
        ] {
            let mut faults = Faults::default();
            assert!(faults.lets_all_by(Direction::FromDevice));
            faults.apply(&fault);
            assert!(!faults.lets_all_by(Direction::FromDevice), "{fault:?}");
            faults.apply(&LinkFault::Restore);
            assert!(faults.lets_all_by(Direction::FromDevice), "{fault:?}");
        }
        let mut faults = Faults::default();
        faults.apply(&counted(None));
        assert_eq!(faults.fate_of_publish(Direction::ToDevice, "t"), Fate::Swallow);
        assert!(faults.lets_all_by(Direction::ToDevice));
    }
}
