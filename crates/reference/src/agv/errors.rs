//! The active errors of the vehicle and how long each of them is reported (sections 6.6.4 and 6.10.5).
//!
//! What was refused stays until a new order is accepted (the rulings of ORD-REJ-03 and ORD-REJ-08); every other error
//! ends with its cause, or after a while where it has none that lasts.

use serde_json::{Value, json};

use tck_base::clock::Moment;

/// At most this many errors are reported; older ones give way.
pub(crate) const MAX_ERRORS: usize = 20;

/// When an error ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Life {
    /// When a new order is accepted (ORD-REJ-03, ORD-REJ-08).
    UntilNewOrder,
    /// When an instant action is accepted.
    UntilInstantAction,
    /// When an instant action about maps is accepted.
    UntilMapAction,
    /// When the mode allows orders.
    UntilAvailable,
    /// At a time, or when a new order is accepted.
    Until(Moment),
    /// While the emergency stop is active.
    WhileStopped,
    /// While the vehicle is outside its corridor.
    WhileOutside,
    /// While the vehicle is in a zone.
    WhileInZone,
    /// While the vehicle cannot tell where it is.
    WhileLost,
    /// While the vehicle itself has a defect.
    WhileDefective,
    /// Never.
    Always,
}

/// One active error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ActiveError {
    pub(crate) error_type: String,
    pub(crate) fatal: bool,
    pub(crate) references: Vec<(String, String)>,
    pub(crate) description: String,
    pub(crate) life: Life,
}

/// All active errors.
#[derive(Clone, Debug, Default)]
pub(crate) struct Errors {
    pub(crate) active: Vec<ActiveError>,
    /// errorLevel of a defect that is not fatal.
    pub(crate) defect_level: String,
}

impl Errors {
    /// Adds an error; one with the same type and references is replaced.
    pub(crate) fn raise(&mut self, error: ActiveError) {
        self.active
            .retain(|other| other.error_type != error.error_type || other.references != error.references);
        if self.active.len() >= MAX_ERRORS
            && let Some(oldest) = self.active.iter().position(|error| !error.fatal)
        {
            self.active.remove(oldest);
        }
        self.active.push(error);
    }

    /// A new order was accepted.
    pub(crate) fn new_order(&mut self) {
        self.active.retain(|error| {
            matches!(
                error.life,
                Life::WhileStopped
                    | Life::WhileOutside
                    | Life::WhileInZone
                    | Life::WhileDefective
                    | Life::WhileLost
                    | Life::Always
                    | Life::UntilInstantAction
                    | Life::UntilMapAction
                    | Life::UntilAvailable
            )
        });
    }

    /// An instant action was accepted, and whether it is about maps.
    pub(crate) fn instant_action(&mut self, about_maps: bool) {
        self.active.retain(|error| match error.life {
            Life::UntilInstantAction => false,
            Life::UntilMapAction => !about_maps,
            _ => true,
        });
    }

    /// The mode allows orders.
    pub(crate) fn available(&mut self) {
        self.active.retain(|error| error.life != Life::UntilAvailable);
    }

    /// Forgets what was refused.
    pub(crate) fn forget_refusals(&mut self) {
        self.active.retain(|error| error.life != Life::UntilNewOrder);
    }

    /// Whether anything that was refused is still listed.
    pub(crate) fn lists_refusals(&self) -> bool {
        self.active.iter().any(|error| error.life == Life::UntilNewOrder)
    }

    /// The emergency stop was released.
    pub(crate) fn released(&mut self) {
        self.active.retain(|error| error.life != Life::WhileStopped);
    }

    /// The vehicle is where it belongs again.
    pub(crate) fn back_inside(&mut self) {
        self.active.retain(|error| error.life != Life::WhileOutside);
    }

    /// The vehicle does not break the rule of a zone any more.
    pub(crate) fn left_zone(&mut self, error_type: &str, zone_id: &str) {
        self.active.retain(|error| {
            let about = error
                .references
                .iter()
                .any(|(key, value)| key == "zoneId" && value == zone_id);
            error.life != Life::WhileInZone || error.error_type != error_type || !about
        });
    }

    /// The vehicle knows where it is again.
    pub(crate) fn located(&mut self) {
        self.active.retain(|error| error.life != Life::WhileLost);
    }

    /// The defect was put right.
    pub(crate) fn cleared(&mut self) {
        self.active.retain(|error| error.life != Life::WhileDefective);
    }

    /// Drops what has run out.
    pub(crate) fn expire(&mut self, now: Moment) {
        self.active
            .retain(|error| !matches!(error.life, Life::Until(end) if end <= now));
    }

    /// When the next error runs out.
    pub(crate) fn next_end(&self) -> Option<Moment> {
        let ends = self.active.iter().filter_map(|error| match error.life {
            Life::Until(end) => Some(end),
            _ => None,
        });
        ends.min()
    }

    /// Whether the vehicle cannot go on before somebody has helped it.
    pub(crate) fn need_help(&self) -> bool {
        let stands = |life: Life| matches!(life, Life::WhileStopped | Life::WhileLost | Life::WhileDefective);
        self.active.iter().any(|error| error.fatal && stands(error.life))
    }

    /// Whether nothing is wrong.
    pub(crate) fn is_empty(&self) -> bool {
        self.active.is_empty()
    }

    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        self.active.clear();
    }
}

impl ActiveError {
    /// The error as a state lists it.
    pub(crate) fn picture(&self, usual_level: &str) -> Value {
        let references = self.references.iter();
        let references = references.map(|(key, value)| json!({ "referenceKey": key, "referenceValue": value }));
        json!({
            "errorType": self.error_type,
            "errorDescription": self.description,
            "errorLevel": if self.fatal { "FATAL" } else { usual_level },
            "errorReferences": references.collect::<Vec<_>>(),
        })
    }
}
