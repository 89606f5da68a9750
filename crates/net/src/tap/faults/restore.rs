//! `restore`: all faults end.

use super::Faults;

pub(super) fn all(faults: &mut Faults) {
    *faults = Faults::default();
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use crate::tap::faults::{Fate, Faults};
    use tck_journal::event::{Direction, LinkFault};

    #[test]
    fn restore_ends_every_fault() {
        let mut faults = Faults::default();
        for fault in [
            LinkFault::Refuse,
            LinkFault::Silence { direction: None },
            LinkFault::Delay {
                millis: 5,
                direction: None,
            },
            LinkFault::Drop {
                topic: None,
                count: 9,
                direction: None,
            },
            LinkFault::Duplicate {
                topic: None,
                count: 9,
                direction: None,
            },
        ] {
            faults.apply(&fault);
        }
        faults.apply(&LinkFault::Restore);
        assert!(faults.admits());
        for direction in [Direction::FromDevice, Direction::ToDevice] {
            assert!(!faults.is_silent(direction));
            assert_eq!(faults.delay(direction), Duration::ZERO);
            assert_eq!(faults.fate_of_publish(direction, "state"), Fate::Forward);
        }
    }
}
