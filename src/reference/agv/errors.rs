//! The active errors of the vehicle and how long each of them is reported.

use std::time::Duration;

use serde_json::{Value, json};

use crate::clock::Moment;

use super::faults::{FaultName as F, Faults};

/// At most this many errors are reported; older ones give way.
pub(crate) const MAX_ERRORS: usize = 20;

/// When an error ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Life {
    /// When a new order is accepted (ORD-REJ-03, ORD-REJ-08).
    UntilNewOrder,
    /// At a time, or when a new order is accepted.
    Until(Moment),
    /// While the emergency stop is active.
    WhileStopped,
    /// While the vehicle is outside its corridor.
    WhileOutside,
    /// While the vehicle itself has a defect.
    WhileDefective,
    /// Never (`r6-action-errors-never-clear` only).
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
    /// What a faulty vehicle says instead of an error, from a moment on.
    pub(crate) corrected: Option<(Moment, ActiveError, ActiveError)>,
}

/// How long a faulty vehicle stands by a wrong report.
const CORRECTION: Duration = Duration::from_millis(800);

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

    /// Reports that something was refused. A faulty vehicle does it wrong at first.
    pub(crate) fn refused(&mut self, right: ActiveError, now: Moment, faults: Faults) {
        let mut wrong = right.clone();
        if faults.has(F::RefusalLevelCorrected) {
            wrong.fatal = !right.fatal;
        } else if faults.has(F::RefusalTypeCorrected) {
            "internalError".clone_into(&mut wrong.error_type);
        } else if faults.has(F::RefusalReferencesCorrected) {
            wrong.references.clear();
        } else {
            self.raise(right);
            return;
        }
        wrong.life = Life::UntilNewOrder;
        self.raise(wrong.clone());
        self.corrected = Some((now + CORRECTION, wrong, right));
    }

    /// A new order was accepted.
    pub(crate) fn new_order(&mut self) {
        self.corrected = None;
        self.active.retain(|error| {
            matches!(
                error.life,
                Life::WhileStopped | Life::WhileOutside | Life::WhileDefective | Life::Always
            )
        });
    }

    /// `r2-rejection-cleared-by-instant-action`: forgets what was refused.
    pub(crate) fn forget_refusals(&mut self) {
        self.active.retain(|error| error.life != Life::UntilNewOrder);
    }

    /// `r4-new-rejection-replaces-old-warning`: forgets the orders that were refused.
    pub(crate) fn forget_refused_orders(&mut self) {
        let of_order = |error: &ActiveError| {
            let mut references = error.references.iter();
            references.any(|(key, value)| key == "topic" && value == "order")
        };
        self.active.retain(|error| !of_order(error));
    }

    /// What the error of that type references, if there is one (`r6-no-order-to-cancel-keeps-first-id` only).
    pub(crate) fn references_of(&self, error_type: &str) -> Option<Vec<(String, String)>> {
        let mut listed = self.active.iter();
        let found = listed.find(|error| error.error_type == error_type)?;
        Some(found.references.clone())
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

    /// The defect was put right.
    pub(crate) fn cleared(&mut self) {
        self.active.retain(|error| error.life != Life::WhileDefective);
    }

    /// Drops what has run out.
    pub(crate) fn expire(&mut self, now: Moment) {
        if let Some((_, wrong, right)) = self.corrected.take_if(|(due, _, _)| *due <= now) {
            self.active.retain(|error| *error != wrong);
            self.raise(right);
        }
        self.active
            .retain(|error| !matches!(error.life, Life::Until(end) if end <= now));
    }

    /// When the next error runs out.
    pub(crate) fn next_end(&self) -> Option<Moment> {
        let ends = self.active.iter().filter_map(|error| match error.life {
            Life::Until(end) => Some(end),
            _ => None,
        });
        ends.chain(self.corrected.as_ref().map(|(due, _, _)| *due)).min()
    }

    /// Whether nothing is wrong.
    pub(crate) fn is_empty(&self) -> bool {
        self.active.is_empty()
    }

    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        self.active.clear();
        self.corrected = None;
    }
}

impl ActiveError {
    /// The error as a state lists it.
    pub(crate) fn picture(&self) -> Value {
        let references = self.references.iter();
        let references = references.map(|(key, value)| json!({ "referenceKey": key, "referenceValue": value }));
        json!({
            "errorType": self.error_type,
            "errorDescription": self.description,
            "errorLevel": if self.fatal { "FATAL" } else { "WARNING" },
            "errorReferences": references.collect::<Vec<_>>(),
        })
    }
}
