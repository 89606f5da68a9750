//! `never`: no matching message arrives, and the observer was alive to see it.

use std::sync::Arc;

use super::{ClauseOutcome, Position, Progress, Selector, StepOutcome, backlog, bound_clauses, ids, limit, seconds};
use crate::eval_context::EvalContext;
use crate::window::{CheckOutcome, CheckWindow};
use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_journal::event::Event;
use tck_suite::model::{From, Never, Step};

pub(crate) struct Forbidding {
    verb: Never,
    position: Position,
    selector: Selector,
    check: Option<CheckWindow>,
    ends: Moment,
    probe_until: Moment,
    seen: u64,
    violated: Option<(u64, String)>,
    /// What a check remarked on, or could not judge, without ending the step.
    remarked: Option<(u64, ClauseOutcome, String)>,
    alive: bool,
}

impl Forbidding {
    pub(super) fn begin(
        verb: &Never,
        step: &Step,
        position: Position,
        scene: &EvalContext<'_>,
    ) -> Result<Self, String> {
        let during = limit(&verb.during, scene)?.hard;
        let ends = position.begun + during;
        let patience = scene
            .bindings
            .get("time.broker")
            .and_then(serde_json::Value::as_u64)
            .unwrap_or(5_000);
        let mut selector = Selector::bind(&verb.selection, &verb.subject(), &step.verb_span, position, scene)?.lenient(
            &verb.subject(),
            &ids(&verb.checks),
            scene,
        );
        let check = selector.take_check(scene)?.map(|check| check.about(&verb.checks));
        let mut this = Self {
            verb: verb.clone(),
            position,
            selector,
            check,
            ends,
            probe_until: ends + std::time::Duration::from_millis(patience),
            seen: 0,
            violated: None,
            remarked: None,
            alive: false,
        };
        for entry in backlog(scene.timeline, &verb.subject(), position.start(verb.from, From::Mark)) {
            this.look_at(&entry, scene);
        }
        Ok(this)
    }

    pub(super) fn observe(&mut self, entry: &Arc<Entry>, subject: Option<&str>, scene: &EvalContext<'_>) {
        if matches!(entry.event(), Event::ProbeReceived { .. }) && entry.at().moment >= self.ends {
            self.alive = true;
        }
        if subject == Some(&*self.verb.subject()) && !self.alive {
            self.look_at(entry, scene);
        }
    }

    fn look_at(&mut self, entry: &Arc<Entry>, scene: &EvalContext<'_>) {
        if self.violated.is_some() {
            return;
        }
        self.seen += 1;
        if let Some(check) = &mut self.check {
            // The check has to see everything; what it says counts where the message is one of those meant.
            let said = check.observe(entry, scene);
            if let CheckOutcome::Wrong(holds, found) = said
                && self.selector.takes(entry, scene)
            {
                self.found(entry.seq(), holds, found);
            }
        } else if self.selector.takes(entry, scene) && !self.selector.is_excused(entry, scene) {
            let what = match &self.selector.pattern {
                Some(pattern) => pattern.conditions(),
                None => format!("no {} message may come", self.verb.topic),
            };
            self.violated = Some((entry.seq(), format!("#{} must not have come: {what}", entry.seq())));
        }
    }

    pub(super) fn allowances(&self) -> Vec<String> {
        self.selector.allowances()
    }

    /// Keeps what the check found: a violation ends the step, anything softer waits for the end.
    fn found(&mut self, seq: u64, holds: ClauseOutcome, found: String) {
        match holds {
            ClauseOutcome::Violated => self.violated = Some((seq, found)),
            ClauseOutcome::Held => {}
            // What could not be judged weighs more than a remark, as everywhere.
            softer => {
                let weightier = matches!(softer, ClauseOutcome::Unobservable(_));
                if self
                    .remarked
                    .as_ref()
                    .is_none_or(|(_, before, _)| weightier && !matches!(before, ClauseOutcome::Unobservable(_)))
                {
                    self.remarked = Some((seq, softer, found));
                }
            }
        }
    }

    pub(super) fn progress(&self) -> Progress {
        if self.violated.is_some() || self.alive {
            Progress::Decided
        } else {
            Progress::NeedsProbe(self.ends)
        }
    }

    /// How long the proof that the observer is alive may take.
    pub(crate) fn probe_until(&self) -> Moment {
        self.probe_until
    }

    pub(super) fn end(mut self, at: Moment, cut_short: Option<&str>, scene: &EvalContext<'_>) -> StepOutcome {
        let last = self.check.as_mut().and_then(|check| check.finish(at, scene));
        if let Some((holds, found)) = last.filter(|_| self.violated.is_none()) {
            self.found(0, holds, found);
        }
        let (holds, message, witness) = match (self.violated, cut_short) {
            (Some((seq, message)), _) => (ClauseOutcome::Violated, message, Some(seq).filter(|seq| *seq > 0)),
            (None, None) if self.alive && self.remarked.is_some() => {
                let (seq, holds, message) = self.remarked.unwrap_or((0, ClauseOutcome::Held, String::new()));
                (holds, message, Some(seq).filter(|seq| *seq > 0))
            }
            (None, Some(why)) => (ClauseOutcome::Unobservable(why.to_owned()), why.to_owned(), None),
            (None, None) if self.alive => {
                let message = format!(
                    "nothing of the kind came for {}",
                    seconds(at.since(self.position.begun))
                );
                (ClauseOutcome::Held, message, None)
            }
            (None, None) => {
                let why = "the harness could not prove that it was listening: its own probe did not come back";
                (ClauseOutcome::Unobservable(why.to_owned()), why.to_owned(), None)
            }
        };
        let mut clauses = bound_clauses(
            &self.verb.checks,
            "checks",
            &self.selector.span,
            &holds,
            witness,
            &message,
        );
        for clause in &mut clauses {
            clause.label = witness.map_or_else(String::new, |seq| format!("#{seq} matches this"));
            clause.expected = self
                .selector
                .expected()
                .map(|conditions| format!("no message where {conditions}"));
        }
        StepOutcome {
            reached: Some(if matches!(holds, ClauseOutcome::Held | ClauseOutcome::Warning) {
                Ok(())
            } else {
                Err(message)
            }),
            took: witness,
            clauses,
            saves: Vec::new(),
            seen: self.seen,
            allowances: Vec::new(),
            timing: None,
        }
    }
}
