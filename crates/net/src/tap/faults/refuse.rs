//! `refuse`: no new connection is let in; the present one is left alone.

/// Whether the door is shut.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Refuse {
    shut: bool,
}

impl Refuse {
    pub(super) fn begin(&mut self) {
        self.shut = true;
    }

    pub(super) fn admits(self) -> bool {
        !self.shut
    }
}

#[cfg(test)]
mod tests {
    use crate::tap::faults::{Change, Faults};
    use tck_journal::event::LinkFault;

    #[test]
    fn refuse_shuts_the_door_and_leaves_the_present_connection_alone() {
        let mut faults = Faults::default();
        assert!(faults.admits());
        assert_eq!(faults.apply(&LinkFault::Refuse), Change::Keep);
        assert!(!faults.admits());
    }
}
