//! `retained`: a fresh subscriber receives it with RETAIN set.

use std::sync::Arc;

use super::{
    Clause, ClauseOutcome, Near, Position, Progress, Selector, StepOutcome, assertion_clause, bound_clauses,
    keep_nearest, limit,
};
use crate::eval_context::EvalContext;
use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_journal::event::Event;
use tck_suite::model::{Retained, Step};

pub(crate) struct Fetching {
    verb: Retained,
    topic: Option<String>,
    selector: Selector,
    deadline: Moment,
    seen: u64,
    unflagged: Option<u64>,
    nearest: Option<Near>,
    taken: Option<u64>,
    ended: bool,
    asserted: Vec<Clause>,
    position: Position,
}

impl Fetching {
    pub(super) fn begin(
        verb: &Retained,
        step: &Step,
        position: Position,
        scene: &EvalContext<'_>,
    ) -> Result<Self, String> {
        let selector = Selector::bind(&verb.selection, &verb.topic, &step.verb_span, position, scene)?;
        Ok(Self {
            topic: scene.topics.get(&verb.topic).cloned(),
            deadline: position.begun + limit(&verb.within, scene)?.hard,
            verb: verb.clone(),
            selector,
            seen: 0,
            unflagged: None,
            nearest: None,
            taken: None,
            ended: false,
            asserted: Vec::new(),
            position,
        })
    }

    pub(super) fn observe(&mut self, entry: &Arc<Entry>, scene: &EvalContext<'_>) {
        match entry.event() {
            Event::Retained { topic, retain, .. } if Some(topic) == self.topic.as_ref() && self.taken.is_none() => {
                self.seen += 1;
                if !self.selector.takes(entry, scene) {
                    keep_nearest(&mut self.nearest, self.selector.closeness(entry));
                } else if *retain {
                    self.taken = Some(entry.seq());
                    let judged = self.verb.assert.iter();
                    self.asserted = judged
                        .map(|assertion| {
                            assertion_clause(assertion, "assert", entry, &self.verb.topic, self.position, scene)
                        })
                        .collect();
                } else {
                    self.unflagged = Some(entry.seq());
                }
            }
            Event::RetainedEnd { .. } => self.ended = true,
            _ => {}
        }
    }

    pub(super) fn progress(&self) -> Progress {
        if self.taken.is_some() || self.ended {
            Progress::Decided
        } else {
            Progress::Pending(self.deadline)
        }
    }

    pub(super) fn end(self, _at: Moment, cut_short: Option<&str>) -> StepOutcome {
        let topic = &self.verb.topic;
        let (holds, message, witness) = match (self.taken, cut_short) {
            (Some(seq), _) => (
                ClauseOutcome::Held,
                format!("a fresh subscriber received #{seq} with RETAIN set"),
                Some(seq),
            ),
            (None, _) if self.ended => match (self.unflagged, self.seen) {
                (Some(seq), _) => (
                    ClauseOutcome::Violated,
                    format!("#{seq} came without RETAIN"),
                    Some(seq),
                ),
                (None, 0) => (
                    ClauseOutcome::Violated,
                    format!("the broker has no retained {topic} message"),
                    None,
                ),
                (None, _) => (
                    ClauseOutcome::Violated,
                    format!("the retained {topic} message does not match"),
                    None,
                ),
            },
            (None, Some(why)) => (ClauseOutcome::Unobservable(why.to_owned()), why.to_owned(), None),
            (None, None) => {
                let why = "the broker did not answer a fresh subscriber in time";
                (ClauseOutcome::Unobservable(why.to_owned()), why.to_owned(), None)
            }
        };
        let nearest = self
            .nearest
            .and_then(|near| near.miss)
            .filter(|_| holds == ClauseOutcome::Violated);
        let mut clauses = bound_clauses(
            &self.verb.checks,
            "checks",
            &self.selector.span,
            &holds,
            witness,
            &message,
        );
        for clause in &mut clauses {
            clause.label.clone_from(&message);
            clause.nearest.clone_from(&nearest);
            clause.expected = self.selector.expected();
        }
        if self.taken.is_some() {
            clauses.extend(self.asserted);
        } else {
            let unseen = "the message to be judged was not received";
            clauses.extend(self.verb.assert.iter().map(|assertion| Clause {
                requirement: assertion.requirement.clone(),
                word: "assert",
                span: assertion.span.clone(),
                label: String::new(),
                holds: ClauseOutcome::Unobservable(unseen.to_owned()),
                witness: None,
                message: unseen.to_owned(),
                expected: None,
                nearest: None,
            }));
        }
        StepOutcome {
            reached: Some(if holds == ClauseOutcome::Held {
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
