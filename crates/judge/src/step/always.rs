//! `always`: every message matches, for a while or until another one comes.

use std::sync::Arc;

use super::answer::Question;
use super::{
    Clause, ClauseOutcome, Near, Position, Progress, Selector, StepOutcome, Timing, backlog, bound_clauses, ids,
    keep_nearest, limit, seconds, shown_path,
};
use crate::eval_context::EvalContext;
use crate::limit::Limit;
use crate::window::{CheckOutcome, CheckWindow};
use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_suite::model::{Always, Extent, From, Step, Until};

pub(crate) struct Holding {
    verb: Always,
    position: Position,
    selector: Selector,
    check: Option<CheckWindow>,
    until: Option<Goal>,
    ends: Moment,
    seen: u64,
    violated: Option<Violation>,
    /// What a check of several requirements has found broken of one: the others are still looked at.
    found: Option<Violation>,
    /// What a check remarked on without ending the step.
    remarked: Option<(u64, ClauseOutcome, String)>,
    /// Whether the check had anything to judge.
    judged: bool,
}

struct Goal {
    until: Until,
    selector: Selector,
    limit: Limit,
    nearest: Option<Near>,
    reached: Option<(u64, Moment)>,
    /// What may be the goal, or something of the vehicle's own: it is watched a little longer.
    doubtful: Option<(u64, Moment)>,
    seen: u64,
}

struct Violation {
    seq: u64,
    holds: ClauseOutcome,
    message: String,
    near: Option<Near>,
}

impl Holding {
    pub(super) fn begin(
        verb: &Always,
        step: &Step,
        position: Position,
        scene: &EvalContext<'_>,
    ) -> Result<Self, String> {
        let mut selector = Selector::bind(&verb.selection, &verb.subject(), &step.verb_span, position, scene)?.lenient(
            &verb.subject(),
            &ids(&verb.checks),
            scene,
        );
        let check = selector.take_check(scene)?.map(|check| check.about(&verb.checks));
        let (until, ends) = match &verb.extent {
            Extent::During(time) => (None, position.begun + limit(time, scene)?.hard),
            Extent::Until(until) => {
                let limit = limit(&until.within, scene)?;
                let goal =
                    Goal {
                        selector: Selector::bind(&until.selection, &until.subject(), &until.at, position, scene)?
                            .lenient(&until.subject(), &ids(&until.checks), scene),
                        until: (**until).clone(),
                        limit,
                        nearest: None,
                        reached: None,
                        doubtful: None,
                        seen: 0,
                    };
                (Some(goal), position.base + limit.hard)
            }
        };
        let mut this = Self {
            verb: verb.clone(),
            position,
            selector,
            check,
            until,
            ends,
            seen: 0,
            violated: None,
            found: None,
            remarked: None,
            judged: false,
        };
        let from = position.start(verb.from, From::Mark);
        let mut past = backlog(scene.timeline, &verb.subject(), from);
        if let Some(goal) = this.until.as_ref().filter(|goal| goal.until.topic != this.verb.topic) {
            past.extend(backlog(scene.timeline, &goal.until.subject(), from));
            past.sort_by_key(|entry| entry.seq());
        }
        for entry in past {
            let subject = scene.timeline.subject_of(&entry);
            this.observe(&entry, subject.as_deref(), scene);
        }
        Ok(this)
    }

    pub(super) fn observe(&mut self, entry: &Arc<Entry>, subject: Option<&str>, scene: &EvalContext<'_>) {
        if self.decided() || entry.at().moment > self.ends {
            return;
        }
        // What cannot be read shows nothing; that it cannot is another requirement, judged by a monitor.
        let readable = entry.subject().is_some();
        if readable && subject == Some(&*self.verb.subject()) {
            self.seen += 1;
            self.judge(entry, scene);
        }
        if self.violated.is_some() {
            return;
        }
        if let Some(goal) = self
            .until
            .as_mut()
            .filter(|goal| subject == Some(&*goal.until.subject()))
        {
            goal.seen += 1;
            if goal.selector.takes(entry, scene) {
                let found = Some((entry.seq(), entry.at().moment));
                let question = Question::of_picking(&goal.until.subject(), self.position);
                if question.is_answered_by(entry, &goal.selector, scene) {
                    goal.reached = found;
                } else {
                    goal.doubtful = goal.doubtful.or(found);
                }
            } else {
                keep_nearest(&mut goal.nearest, goal.selector.closeness(entry));
            }
        }
    }

    fn judge(&mut self, entry: &Arc<Entry>, scene: &EvalContext<'_>) {
        let said = self.check.as_mut().map(|check| check.observe(entry, scene));
        self.judged |= said.as_ref().is_some_and(|said| *said != CheckOutcome::Nothing);
        if let Some(CheckOutcome::Wrong(holds, found)) = said {
            let message = format!("#{}: {found}", entry.seq());
            self.remark(entry.seq(), holds, message);
        }
        if self.violated.is_none() && !self.selector.takes(entry, scene) {
            let near = self.selector.closeness(entry);
            let message = match near.as_ref().and_then(|near| near.miss.as_ref()) {
                Some(miss) => {
                    format!(
                        "#{}: {} is {}, expected {}",
                        entry.seq(),
                        shown_path(&miss.path),
                        miss.found,
                        miss.expected
                    )
                }
                None => format!("#{} does not match", entry.seq()),
            };
            self.violated = Some(Violation {
                seq: entry.seq(),
                holds: ClauseOutcome::Violated,
                message,
                near,
            });
        }
    }

    /// Keeps what the check found: a violation ends the step, unless it names the one of several requirements that it is
    /// about; anything softer waits for the end.
    fn remark(&mut self, seq: u64, holds: ClauseOutcome, message: String) {
        if holds == ClauseOutcome::Violated {
            let check = self.check.as_ref();
            let is_sorted = check.is_some_and(|check| check.sorted(&self.verb.checks).is_some());
            let kept = match is_sorted && self.verb.checks.len() > 1 {
                true => &mut self.found,
                false => &mut self.violated,
            };
            kept.get_or_insert(Violation {
                seq,
                holds,
                message,
                near: None,
            });
        } else if self.remarked.is_none() || matches!(holds, ClauseOutcome::Unobservable(_)) {
            self.remarked = Some((seq, holds, message));
        }
    }

    fn decided(&self) -> bool {
        self.violated.is_some() || self.until.as_ref().is_some_and(|goal| goal.reached.is_some())
    }

    pub(super) fn timing(&self) -> Option<Timing> {
        let goal = self.until.as_ref()?;
        let (since, limit) = (self.position.base, goal.limit.soft);
        Some(match goal.reached.or(goal.doubtful) {
            Some((_, at)) => Timing::Late { since, at, limit },
            None => Timing::Missed(self.ends),
        })
    }

    pub(super) fn allowances(&self) -> Vec<String> {
        let mut all = self.selector.allowances();
        all.extend(self.until.iter().flat_map(|goal| goal.selector.allowances()));
        all
    }

    pub(super) fn progress(&self) -> Progress {
        let doubtful = self.until.as_ref().filter(|goal| goal.doubtful.is_some());
        match doubtful {
            _ if self.decided() => Progress::Decided,
            Some(goal) => Progress::Pending(self.ends.min(self.position.base + goal.limit.soft)),
            None => Progress::Pending(self.ends),
        }
    }

    pub(super) fn end(mut self, at: Moment, cut_short: Option<&str>, scene: &EvalContext<'_>) -> StepOutcome {
        if let Some((holds, found)) = self.check.as_mut().and_then(|check| check.finish(at, scene)) {
            self.judged = true;
            self.remark(0, holds, found);
        }
        let mut clauses = Vec::new();
        let (holds, message, witness) = self.held(cut_short);
        let mut reached = if matches!(holds, ClauseOutcome::Held | ClauseOutcome::Warning) {
            Ok(())
        } else {
            Err(message.clone())
        };
        let span = self
            .violated
            .as_ref()
            .and_then(|violation| violation.near.as_ref()?.span.clone());
        let span = span.unwrap_or_else(|| self.selector.span.clone());
        let mut bound = bound_clauses(&self.verb.checks, "checks", &span, &holds, witness, &message);
        self.sort_out(&mut bound, cut_short);
        for mut clause in bound {
            clause.expected = self.selector.expected();
            clause.nearest = self
                .violated
                .as_ref()
                .and_then(|violation| violation.near.as_ref()?.miss.clone());
            if let Some(miss) = &clause.nearest {
                clause.label = format!("{} is {}", shown_path(&miss.path), miss.found);
            }
            clauses.push(clause);
        }
        let mut took = witness;
        if let Some(goal) = self.until {
            let (goal_clauses, goal_reached, goal_took) =
                goal.end(at, cut_short, self.position, self.violated.is_some());
            clauses.extend(goal_clauses);
            took = took.or(goal_took);
            reached = reached.and(goal_reached);
        }
        StepOutcome {
            reached: Some(reached),
            took,
            clauses,
            saves: Vec::new(),
            seen: self.seen,
            allowances: Vec::new(),
            timing: None,
        }
    }

    /// A check that names the requirement it found broken decides the clause of that requirement; of the others
    /// nothing was wrong until then.
    fn sort_out(&self, clauses: &mut [Clause], cut_short: Option<&str>) {
        let Some(sorted) = self.check.as_ref().and_then(|check| check.sorted(&self.verb.checks)) else {
            return;
        };
        let ended = self.violated.is_some();
        for (clause, found) in clauses.iter_mut().zip(sorted) {
            match found {
                Some((seq, CheckOutcome::Wrong(holds, message))) => {
                    clause.holds = holds;
                    clause.witness = Some(seq).filter(|seq| *seq > 0);
                    clause.message = format!("#{seq}: {message}");
                }
                _ if ended || cut_short.is_some() => {
                    let why = cut_short.unwrap_or("the step ended with what was found about another requirement");
                    clause.holds = ClauseOutcome::Unobservable(why.to_owned());
                    why.clone_into(&mut clause.message);
                }
                _ => {
                    clause.holds = ClauseOutcome::Held;
                    clause.message = all_match(self.seen, &self.verb.topic);
                }
            }
        }
    }

    fn held(&self, cut_short: Option<&str>) -> (ClauseOutcome, String, Option<u64>) {
        if let Some(violation) = self.violated.as_ref().or(self.found.as_ref()) {
            return (
                violation.holds.clone(),
                violation.message.clone(),
                Some(violation.seq).filter(|seq| *seq > 0),
            );
        }
        if let Some(why) = cut_short {
            return (ClauseOutcome::Unobservable(why.to_owned()), why.to_owned(), None);
        }
        if let Some((seq, holds, message)) = &self.remarked {
            return (holds.clone(), message.clone(), Some(*seq).filter(|seq| *seq > 0));
        }
        match self.seen {
            n if n > 0 && self.check.is_some() && !self.judged => {
                let topic = &self.verb.topic;
                let why = match n {
                    1 => format!("the only {topic} message does not show what is to be judged"),
                    _ => format!("none of {n} {topic} messages shows what is to be judged"),
                };
                (ClauseOutcome::Unobservable(why.clone()), why, None)
            }
            0 => {
                let why = format!("no {} message came that could have been judged", self.verb.topic);
                (ClauseOutcome::Unobservable(why.clone()), why, None)
            }
            n => (ClauseOutcome::Held, all_match(n, &self.verb.topic), None),
        }
    }
}

impl Goal {
    fn end(
        self,
        at: Moment,
        cut_short: Option<&str>,
        position: Position,
        violated: bool,
    ) -> (Vec<Clause>, Result<(), String>, Option<u64>) {
        let waited = at.since(position.base);
        let (holds, message, witness) = match (self.reached.or(self.doubtful), cut_short) {
            (Some((seq, moment)), _) => {
                let took = moment.since(position.base);
                let holds = if took > self.limit.soft {
                    ClauseOutcome::HeldLate
                } else {
                    ClauseOutcome::Held
                };
                (holds, format!("#{seq} came after {}", seconds(took)), Some(seq))
            }
            (None, Some(why)) => (ClauseOutcome::Unobservable(why.to_owned()), why.to_owned(), None),
            (None, None) if violated => {
                let why = "not judged: the condition before it failed";
                (ClauseOutcome::Unobservable(why.to_owned()), why.to_owned(), None)
            }
            (None, None) => {
                let (topic, waited) = (&self.until.topic, seconds(waited));
                let message = match self.seen {
                    1 => format!("1 {topic} message came within {waited}, and it does not match"),
                    n => format!("{n} {topic} messages came within {waited}, and none matches"),
                };
                (ClauseOutcome::Violated, message, None)
            }
        };
        let span = self
            .nearest
            .as_ref()
            .and_then(|near| near.span.clone())
            .unwrap_or_else(|| self.selector.span.clone());
        let nearest = self
            .nearest
            .and_then(|near| near.miss)
            .filter(|_| holds == ClauseOutcome::Violated);
        let mut clauses = bound_clauses(&self.until.checks, "until", &span, &holds, witness, &message);
        for clause in &mut clauses {
            clause.expected = self.selector.expected();
            clause.nearest.clone_from(&nearest);
            if let Some(miss) = &nearest {
                clause.label = format!("closest: {} is {}", shown_path(&miss.path), miss.found);
            }
        }
        let reached = if witness.is_some() { Ok(()) } else { Err(message) };
        (clauses, reached, witness)
    }
}

/// That so many messages of a topic match, in words.
fn all_match(seen: u64, topic: &str) -> String {
    match seen {
        1 => format!("the only {topic} message matches"),
        _ => format!("all {seen} {topic} messages match"),
    }
}
