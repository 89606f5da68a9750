//! How long something may take.
//!
//! The standard sets no reaction time except 30 s for the state. `time.react` is the hard limit for *what*
//! must happen, and slower than `time.slow` is a remark; `time.event` judges only *that a state is
//! published on an event*. Both come from the profile's timing contract.

use std::time::Duration;

use tck_base::pattern::{Bindings, Piece, Term, TermKind};
use tck_suite::model::TimeTerm;

/// A limit with the remark that comes before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    /// Later than this is broken.
    pub hard: Duration,
    /// Later than this is a warning.
    pub soft: Duration,
}

impl Limit {
    /// Resolves a duration of a suite; `None` when a name has no value.
    #[must_use]
    pub fn resolve(time: &TimeTerm, bindings: &Bindings) -> Option<Self> {
        let millis = |name: &str| {
            bindings
                .get(name)
                .and_then(serde_json::Value::as_u64)
                .map(Duration::from_millis)
        };
        match name_of(&time.term) {
            Some("time.react") => {
                let hard = millis("time.react")?;
                Some(Self {
                    hard,
                    soft: millis("time.slow").map_or(hard, |slow| slow.min(hard)),
                })
            }
            Some("time.event") => {
                let soft = millis("time.event")?;
                Some(Self {
                    hard: millis("time.eventWarning").map_or(soft, |limit| limit.max(soft)),
                    soft,
                })
            }
            Some(name) => millis(name).map(Self::exactly),
            None => time.bind(bindings).ok().map(Self::exactly),
        }
    }

    fn exactly(limit: Duration) -> Self {
        Self {
            hard: limit,
            soft: limit,
        }
    }
}

fn name_of(term: &Term) -> Option<&str> {
    match &term.kind {
        TermKind::Variable(name) => Some(name),
        TermKind::Text(pieces) => match pieces.as_slice() {
            [Piece::Variable(name)] => Some(name),
            _ => None,
        },
        _ => None,
    }
}
