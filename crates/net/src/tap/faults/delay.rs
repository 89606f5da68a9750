//! `delay`: every packet is held back for a while; the order stays.

use std::time::Duration;

use super::applies;
use tck_journal::event::Direction;

/// How long packets are held back, per direction.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Delay {
    from_device: Duration,
    to_device: Duration,
}

impl Delay {
    pub(super) fn begin(&mut self, delay: Duration, direction: Option<Direction>) {
        if applies(direction, Direction::FromDevice) {
            self.from_device = delay;
        }
        if applies(direction, Direction::ToDevice) {
            self.to_device = delay;
        }
    }

    pub(super) fn of(self, direction: Direction) -> Duration {
        match direction {
            Direction::FromDevice => self.from_device,
            Direction::ToDevice => self.to_device,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use crate::tap::faults::Faults;
    use tck_journal::event::{Direction, LinkFault};

    #[test]
    fn delay_holds_for_the_direction_it_names() {
        let mut faults = Faults::default();
        faults.apply(&LinkFault::Delay {
            millis: 250,
            direction: Some(Direction::FromDevice),
        });
        assert_eq!(faults.delay(Direction::FromDevice), Duration::from_millis(250));
        assert_eq!(faults.delay(Direction::ToDevice), Duration::ZERO);
    }
}
