//! A vehicle that cannot tell where it is: it says so, stands, and begins nothing (section 6.10.6; an error in 3.0).

use super::Agv;
use super::errors::{ActiveError, Life};
use super::hook_points::Cause;

impl Agv {
    /// It cannot tell where it is any more (STATE-MSG-19). Versions that name no error for that ask for none.
    pub(crate) fn lose_position(&mut self) {
        self.lost = true;
        self.report.requested = true;
        if !self.config.error_rules.contains_key(&self.config.errors.lost) {
            return;
        }
        let error = ActiveError {
            error_type: self.config.errors.lost.clone(),
            fatal: true,
            references: Vec::new(),
            description: "the vehicle cannot tell where it is".into(),
            life: Life::WhileLost,
        };
        self.raise(Cause::Lost, error);
    }

    /// It knows again where it is.
    pub(crate) fn find_position(&mut self) {
        if std::mem::take(&mut self.lost) {
            self.report.requested = true;
            self.errors.located();
            self.helped();
        }
    }
}
