//! `silence`: nothing is forwarded, the connection stays open.
//!
//! What comes meanwhile is held back and goes on at `restore`, as TCP does when packets get through again.

use super::applies;
use tck_journal::event::Direction;

/// Which directions are silent.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Silence {
    from_device: bool,
    to_device: bool,
}

impl Silence {
    pub(super) fn begin(&mut self, direction: Option<Direction>) {
        self.from_device |= applies(direction, Direction::FromDevice);
        self.to_device |= applies(direction, Direction::ToDevice);
    }

    pub(super) fn holds(self, direction: Direction) -> bool {
        match direction {
            Direction::FromDevice => self.from_device,
            Direction::ToDevice => self.to_device,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::tap::faults::Faults;
    use tck_journal::event::{Direction, LinkFault};

    #[test]
    fn silence_in_one_direction_leaves_the_other_alone() {
        let mut faults = Faults::default();
        faults.apply(&LinkFault::Silence {
            direction: Some(Direction::ToDevice),
        });
        assert!(faults.is_silent(Direction::ToDevice));
        assert!(!faults.is_silent(Direction::FromDevice));
    }

    #[test]
    fn silence_without_a_direction_is_both_ways() {
        let mut faults = Faults::default();
        faults.apply(&LinkFault::Silence { direction: None });
        assert!(faults.is_silent(Direction::ToDevice) && faults.is_silent(Direction::FromDevice));
    }
}
