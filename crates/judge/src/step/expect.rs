//! `expect`: a matching message arrives in time, and shows what it must.

use std::sync::Arc;

use super::answer::FirstAnswer;
use super::{
    Clause, ClauseOutcome, Near, Position, Progress, Selector, StepOutcome, Timing, assertion_clause, backlog,
    bound_clauses, ids, keep_nearest, limit, seconds,
};
use crate::eval_context::EvalContext;
use crate::limit::Limit;
use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_suite::model::{Expect, From, Step};

pub(crate) struct Expecting {
    verb: Expect,
    position: Position,
    selector: Selector,
    limit: Limit,
    deadline: Moment,
    nearest: Option<Near>,
    seen: u64,
    late: Option<u64>,
    /// When it came, later than it should.
    came: Option<Moment>,
    taken: Option<StepOutcome>,
    answer: FirstAnswer,
}

impl Expecting {
    pub(super) fn begin(
        verb: &Expect,
        step: &Step,
        position: Position,
        scene: &EvalContext<'_>,
    ) -> Result<Self, String> {
        let limit = limit(&verb.within, scene)?;
        let mut this = Self {
            selector: Selector::bind(&verb.selection, &verb.subject(), &step.verb_span, position, scene)?.lenient(
                &verb.subject(),
                &ids(&verb.checks),
                scene,
            ),
            deadline: position.base + limit.hard,
            verb: verb.clone(),
            position,
            limit,
            nearest: None,
            seen: 0,
            late: None,
            came: None,
            taken: None,
            answer: FirstAnswer::of(verb, position, scene),
        };
        if verb.from == From::Latest {
            // What is already known counts, however old it is; after that only what is new.
            this.deadline = position.begun + limit.hard;
            if let Some(entry) = scene.timeline.present(&verb.subject()).cloned() {
                this.look_at(&entry, scene, true);
            }
        } else {
            for entry in backlog(scene.timeline, &verb.subject(), position.start(verb.from, From::Here)) {
                this.look_at(&entry, scene, false);
            }
        }
        Ok(this)
    }

    pub(super) fn observe(&mut self, entry: &Arc<Entry>, subject: Option<&str>, scene: &EvalContext<'_>) {
        if subject == Some(&*self.verb.subject()) {
            self.look_at(entry, scene, false);
        }
    }

    fn look_at(&mut self, entry: &Arc<Entry>, scene: &EvalContext<'_>, whenever: bool) {
        if self.taken.is_some() {
            return;
        }
        self.seen += 1;
        if !self.selector.takes(entry, scene) {
            keep_nearest(&mut self.nearest, self.selector.closeness(entry));
            return;
        }
        let at = entry.at().moment;
        if at > self.deadline && !whenever {
            self.late.get_or_insert(entry.seq());
            return;
        }
        self.take(entry, at, whenever, scene);
    }

    fn take(&mut self, entry: &Arc<Entry>, at: Moment, whenever: bool, scene: &EvalContext<'_>) {
        let took = at.since(self.position.base);
        let late = took > self.limit.soft && !whenever;
        if late {
            self.came = Some(at);
        }
        let (holds, message) = if late {
            let message = format!(
                "#{} came after {}, which is later than {}",
                entry.seq(),
                seconds(took),
                seconds(self.limit.soft)
            );
            (ClauseOutcome::HeldLate, message)
        } else {
            (
                ClauseOutcome::Held,
                format!("#{} came after {}", entry.seq(), seconds(took)),
            )
        };
        let mut clauses = bound_clauses(
            &self.verb.checks,
            "checks",
            &self.selector.span,
            &holds,
            Some(entry.seq()),
            &message,
        );
        for clause in &mut clauses {
            clause.expected = self.selector.expected();
        }
        let judged = [("assert", &self.verb.assert), ("prefer", &self.verb.prefer)];
        for (word, assertions) in judged {
            for assertion in assertions {
                let topic = self.verb.subject();
                clauses.push(assertion_clause(assertion, word, entry, &topic, self.position, scene));
            }
        }
        let message = entry.subject();
        let saves = self.verb.save.iter().filter_map(|(name, path)| {
            let value = path.of(message.as_deref()?, &self.verb.topic, scene.pack.names())?;
            Some((name.clone(), value.clone()))
        });
        let outcome = StepOutcome {
            reached: Some(Ok(())),
            took: Some(entry.seq()),
            saves: saves.collect(),
            clauses,
            seen: self.seen,
            allowances: Vec::new(),
            timing: None,
        };
        self.taken = self.answer.offer(outcome, entry, &self.selector, scene);
    }

    pub(super) fn timing(&self) -> Option<Timing> {
        match &self.taken {
            Some(_) => {
                let (since, limit) = (self.position.base, self.limit.soft);
                self.came.map(|at| Timing::Late { since, at, limit })
            }
            None => Some(Timing::Missed(self.deadline)),
        }
    }

    pub(super) fn allowances(&self) -> Vec<String> {
        self.selector.allowances()
    }

    pub(super) fn progress(&self) -> Progress {
        match self.taken {
            Some(_) => Progress::Decided,
            None if self.answer.is_settled() => {
                Progress::Pending(self.deadline.min(self.position.base + self.limit.soft))
            }
            None => Progress::Pending(self.deadline),
        }
    }

    pub(super) fn end(mut self, at: Moment, cut_short: Option<&str>) -> StepOutcome {
        if let Some(taken) = self.taken {
            return taken;
        }
        if let Some(otherwise) = self.answer.otherwise(self.seen, cut_short) {
            return otherwise;
        }
        let waited = at.since(self.position.base);
        let (holds, message) = match cut_short {
            Some(why) => (ClauseOutcome::Unobservable(why.to_owned()), why.to_owned()),
            None => (ClauseOutcome::Violated, self.missed(waited)),
        };
        let span = self
            .nearest
            .as_ref()
            .and_then(|near| near.span.clone())
            .unwrap_or_else(|| self.selector.span.clone());
        let nearest = self.nearest.and_then(|near| near.miss);
        let label = nearest.as_ref().map_or_else(
            || "no such message".to_owned(),
            |miss| format!("closest: {} is {}", super::shown_path(&miss.path), miss.found),
        );
        let mut clauses = bound_clauses(&self.verb.checks, "checks", &span, &holds, None, &message);
        // Whoever reads only that it was not reached wants to know what was in the way.
        let reached = match &nearest {
            Some(miss) if cut_short.is_none() => format!(
                "{message}; closest #{}: {} is {}, expected {}",
                miss.seq,
                super::shown_path(&miss.path),
                miss.found,
                miss.expected
            ),
            _ => message.clone(),
        };
        for clause in &mut clauses {
            clause.label.clone_from(&label);
            clause.nearest.clone_from(&nearest);
            clause.expected = self.selector.expected();
        }
        let unseen = "the message to be judged was not received";
        for (word, assertions) in [("assert", &self.verb.assert), ("prefer", &self.verb.prefer)] {
            clauses.extend(assertions.iter().map(|assertion| Clause {
                requirement: assertion.requirement.clone(),
                word,
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
            reached: Some(Err(reached)),
            took: None,
            clauses,
            saves: Vec::new(),
            seen: self.seen,
            allowances: Vec::new(),
            timing: None,
        }
    }

    fn missed(&self, waited: std::time::Duration) -> String {
        let topic = &self.verb.topic;
        if let Some(late) = self.late {
            return format!("the {topic} message came too late, in #{late}");
        }
        match self.seen {
            0 if topic == "order" => format!("no order came within {}: the vehicle is not served", seconds(waited)),
            0 => format!("no {topic} message came within {}", seconds(waited)),
            1 => format!(
                "1 {topic} message came within {}, and it does not match",
                seconds(waited)
            ),
            n => format!("{n} {topic} messages came within {}, and none matches", seconds(waited)),
        }
    }
}
