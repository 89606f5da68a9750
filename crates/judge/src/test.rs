//! One test, judged from the journal.
//!
//! A [`TestJudge`] is shown every entry from `TestBegun` to `TestEnded`. It keeps mark, cursor and
//! variables, lets an evaluator decide each step, and turns the clauses into decisions. The engine asks it
//! what to wait for; nothing the engine does can change a decision except by what ends up in the journal.

use std::sync::Arc;

use serde_json::Value;

use super::decide::decide;
use super::declined::{Declined, is_an_answer};
use super::disconnect::Disconnect;
use super::eval_context::EvalContext;
use super::gone::Gone;
use super::hidden::{Hidden, Open, OrderUnderWay, awaited, excuse_busy, hide};
use super::own_errors::{is_refused, reported};
use super::run_contexts::Ground;
use super::sent::sent;
use super::step::{ClauseOutcome, Evaluator, Position, Progress, StepOutcome, Timing};
use super::timeline::Timeline;
use tck_base::clock::Moment;
use tck_base::pattern::Bindings;
use tck_base::verdict::{Accumulated, Verdict};
use tck_journal::event::{Event, StepEnd};
use tck_journal::{Entry, Reason};
use tck_pack::Role;
use tck_result::{Decision, Sent, StepResult, TestResult, Waited};
use tck_suite::model::{Operator, Section, Step, Test, Verb};

/// A test being judged.
pub struct TestJudge {
    test: Arc<Test>,
    bindings: Bindings,
    entries: Vec<Arc<Entry>>,
    begun: (u64, Moment),
    mark: u64,
    cursor: u64,
    base: Moment,
    running: Option<Running>,
    preamble: Result<(), Reason>,
    body: Result<(), String>,
    trouble: Option<String>,
    verdict: Accumulated,
    result: TestResult,
    departure: Disconnect,
    /// How it is gone when the test is over, by its silence or by its own word.
    silent: Option<Gone>,
    /// Why what is found may stem from somebody else.
    interference: Option<Arc<str>>,
    /// The run was interrupted then, and why that says nothing about the device.
    interrupted: Option<(u64, Arc<str>)>,
    hidden: Vec<Hidden>,
    /// Clauses of the steps that have ended. What another finding hides is known when the test is over, and nothing is
    /// decided before.
    open: Vec<Open>,
    /// What was sent last.
    sent: Option<Sent>,
    /// The order that the vehicle still had when the last order was sent to it.
    busy: Option<OrderUnderWay>,
    declined: Declined,
    ended: bool,
}

struct Running {
    section: Section,
    step: Step,
    evaluator: Evaluator,
    begun: (u64, Moment),
    base: Moment,
}

impl TestJudge {
    /// Begins a test with its `TestBegun` entry.
    pub fn begin(test: &Arc<Test>, ground: &Ground, entry: &Entry, own: &Value) -> Self {
        let mut bindings = Bindings::above(vec![ground.pack.words(), Arc::clone(&ground.bindings)]);
        if let Some(own) = own.as_object() {
            bindings.extend(own);
        }
        let (seq, moment) = (entry.seq(), entry.at().moment);
        Self {
            test: Arc::clone(test),
            bindings,
            entries: Vec::new(),
            begun: (seq, moment),
            mark: seq,
            cursor: seq,
            base: moment,
            running: None,
            preamble: Ok(()),
            body: Ok(()),
            trouble: None,
            verdict: Accumulated::default(),
            result: TestResult {
                id: test.id.clone(),
                title: test.title.clone(),
                verdict: None,
                not_applicable: None,
                seconds: 0.0,
                reason: None,
                cause: None,
                maturity: test.maturity.word().to_owned(),
                maturity_note: test.maturity.note().map(str::to_owned),
                journal: Some((seq, seq)),
                decisions: Vec::new(),
                steps: Vec::new(),
                allowances: Vec::new(),
                repetitions: Vec::new(),
            },
            departure: Disconnect::default(),
            silent: None,
            interference: ground.interference.clone(),
            interrupted: None,
            hidden: Vec::new(),
            open: Vec::new(),
            sent: None,
            busy: None,
            declined: Declined::default(),
            ended: false,
        }
    }

    /// What a master control has declined and has to be asked for once more, before this step awaits what comes of it; and why it was
    /// declined.
    pub fn declined_before(&self, step: &Step, ground: &Ground) -> Option<&(Operator, String)> {
        self.declined.before(step, &ground.pack)
    }

    /// The test.
    pub fn test(&self) -> &Arc<Test> {
        &self.test
    }

    /// The variables as they stand.
    pub fn bindings(&self) -> &Bindings {
        &self.bindings
    }

    /// What the running step is waiting for.
    pub fn progress(&self) -> Progress {
        self.running
            .as_ref()
            .map_or(Progress::Decided, |running| running.evaluator.progress())
    }

    /// Until when the running `never` may wait for its probe.
    pub fn probe_until(&self) -> Option<Moment> {
        match &self.running.as_ref()?.evaluator {
            Evaluator::Never(step) => Some(step.probe_until()),
            _ => None,
        }
    }

    /// Whether another step of this section still makes sense.
    pub fn goes_on(&self, section: Section) -> bool {
        match section {
            Section::Given => self.preamble.is_ok() && self.trouble.is_none(),
            Section::Steps => self.preamble.is_ok() && self.body.is_ok() && self.trouble.is_none(),
            Section::Finally => true,
        }
    }

    /// Whether the postamble brought the device back; the text says what did not work.
    pub fn left_behind(&self) -> Option<&str> {
        let failed = self
            .result
            .steps
            .iter()
            .find(|step| step.path.starts_with("finally") && step.outcome == "failed");
        failed.map(|step| step.path.as_str())
    }

    /// Shows it one entry. The timeline already holds it.
    pub fn observe(&mut self, entry: &Arc<Entry>, subject: Option<&str>, timeline: &Timeline, ground: &Ground) {
        if !timeline.is_of_crowd(entry) {
            self.entries.push(Arc::clone(entry));
        }
        self.departure.observe(entry, subject, ground.pack.names());
        if let Some(span) = &mut self.result.journal {
            span.1 = entry.seq();
        }
        if let (Event::Hook { hook, ok: true, .. }, Some(running)) = (entry.event(), &self.running) {
            self.declined.does(hook, &running.step);
        }
        match entry.event() {
            Event::StepBegun { path } => self.step_begun(path, entry, timeline, ground),
            Event::StepEnded { end, .. } => self.step_ended(entry, end, timeline, ground),
            Event::Mark { .. } => {
                self.mark = entry.seq();
                self.cursor = entry.seq();
                self.base = entry.at().moment;
            }
            Event::Bound { name, value } => self.bindings.set(name, value.clone()),
            Event::TestEnded { .. } => {
                self.allow_for_lag(timeline);
                self.allow_for_others();
                self.silent = timeline
                    .gone(entry.at().moment)
                    .filter(|gone| gone.sent.is_some_and(|(sent, _)| sent > self.begun.0));
                self.finish(entry.at().moment, ground);
            }
            _ => {
                if let Some(mut running) = self.running.take() {
                    running.evaluator.observe(entry, subject, &self.scene(timeline, ground));
                    self.running = Some(running);
                }
            }
        }
    }

    fn scene<'a>(&'a self, timeline: &'a Timeline, ground: &'a Ground) -> EvalContext<'a> {
        EvalContext {
            checks: ground.checks,
            pack: &ground.pack,
            topics: &ground.topics,
            role: ground.role,
            identity: (&ground.identity.0, &ground.identity.1),
            run_bindings: &ground.bindings,
            time: &ground.time,
            hooks: &ground.hooks,
            bindings: &self.bindings,
            timeline,
            entries: &self.entries,
            waivers: &ground.waivers,
        }
    }

    fn step_begun(&mut self, path: &str, entry: &Entry, timeline: &Timeline, ground: &Ground) {
        let found = self.test.sections().into_iter().find_map(|(section, steps)| {
            let step = steps.iter().find(|step| step.path == path)?;
            Some((section, step.clone()))
        });
        let Some((section, step)) = found else {
            self.trouble = Some(format!("the journal names a step {path} that the test does not have"));
            return;
        };
        let begun = (entry.seq(), entry.at().moment);
        let position = Position {
            test: self.begun.0,
            mark: self.mark,
            cursor: self.cursor,
            base: self.base,
            begun: begun.1,
            step: begun.0,
        };
        let evaluator = Evaluator::begin(&step, position, &self.scene(timeline, ground));
        self.running = Some(Running {
            section,
            step,
            evaluator,
            begun,
            base: self.base,
        });
    }

    fn step_ended(&mut self, entry: &Entry, end: &StepEnd, timeline: &Timeline, ground: &Ground) {
        let Some(Running {
            section,
            step,
            evaluator,
            begun,
            base,
        }) = self.running.take()
        else {
            return;
        };
        let is_answer = section == Section::Steps && is_an_answer(&step, &self.test, &ground.pack);
        let cut_short = match end {
            StepEnd::Decided | StepEnd::Deadline => None,
            StepEnd::Declined(_) if is_answer => None,
            StepEnd::Interrupted => Some("the run was interrupted".to_owned()),
            StepEnd::Broken(why) | StepEnd::Refused(why) | StepEnd::Declined(why) | StepEnd::Skipped(why) => {
                Some(why.clone())
            }
        };
        let at = entry.at().moment;
        let outcome = evaluator.end(at, cut_short.as_deref(), &self.scene(timeline, ground));
        self.record_step(&step, &outcome, end, begun, entry);
        for allowance in &outcome.allowances {
            if !self.result.allowances.contains(allowance) {
                self.result.allowances.push(allowance.clone());
            }
        }
        match end {
            StepEnd::Broken(why) => self.broken(section, &step, why),
            StepEnd::Declined(why) if is_answer => self.declined.says(&step, why),
            StepEnd::Refused(why) | StepEnd::Declined(why) | StepEnd::Skipped(why) => {
                self.refused(section, &step, why);
            }
            _ => {}
        }
        if let Verb::Send(send) = &*step.verb {
            let since = self.entries.partition_point(|entry| entry.seq() < begun.0);
            self.sent = sent(send, self.entries[since..].iter(), &self.bindings);
            let order = self.entries[since..].iter().find(|entry| {
                ground.role == Role::Agv && send.topic == "order" && matches!(entry.event(), Event::Sent { .. })
            });
            if let Some(order) = order {
                self.busy = OrderUnderWay::before(timeline, order);
            }
        }
        for (name, value) in &outcome.saves {
            self.bindings.set(name, value.clone());
        }
        if let Some(took) = outcome.took.filter(|took| *took >= self.cursor) {
            self.cursor = took;
            if let Some(taken) = self.entries.iter().find(|entry| entry.seq() == took) {
                self.base = self.base.max(taken.at().moment);
            }
        }
        if matches!(*step.verb, Verb::Send(_) | Verb::Link(_) | Verb::Operator(_)) {
            // A stimulus that takes time (a person, a hook) must not eat the time of the reaction.
            self.base = at;
        }
        if let Some(Err(why)) = &outcome.reached {
            let (name, place) = (step.title.as_ref().unwrap_or(&step.path), step.span.place());
            match section {
                Section::Given => {
                    self.preamble = Err(Reason::PreconditionMissed {
                        step: name.clone(),
                        place,
                        shared: step.span.source.name != self.test.source.name,
                        seen: why.clone(),
                        errors: reported(timeline, self.mark),
                    });
                }
                Section::Steps => self.body = Err(format!("{name} ({place}): {why}")),
                Section::Finally => {}
            }
        }
        let owed = section == Section::Given && step.owes;
        if owed || section == Section::Steps {
            let waited = Waited {
                seconds: at.since(base).as_secs_f64(),
                since: self.mark,
                messages: outcome.seen,
            };
            let is_missed = outcome.clauses.iter().any(|clause| clause.nearest.is_some());
            let awaits = is_missed.then(|| awaited(&step, &self.bindings, &self.entries, timeline));
            for mut clause in outcome.clauses {
                if owed {
                    clause.word = "owes";
                    clause.holds = clause.holds.of_precondition(outcome.seen);
                }
                // A walk that went wrong, or a message that shows what it must not, is no matter of time.
                let of_time = match (&clause.holds, &outcome.timing) {
                    (ClauseOutcome::HeldLate, timing) => *timing,
                    (ClauseOutcome::Violated, Some(timing @ Timing::Missed(_)))
                        if clause.witness.is_none() || matches!(*step.verb, Verb::Action(_)) =>
                    {
                        Some(*timing)
                    }
                    _ => None,
                };
                if step.prefers && clause.word == "checks" {
                    clause.word = "prefers";
                    clause.holds = clause.holds.of_preference();
                }
                let waited = (clause.witness.is_none()).then(|| waited.clone());
                self.open.push(Open {
                    clause,
                    path: step.path.clone(),
                    walks: matches!(*step.verb, Verb::Action(_)),
                    ended: entry.seq(),
                    waited,
                    sent: self.sent.clone(),
                    of_time,
                    refused: ground.role == Role::Agv && is_refused(timeline, self.mark),
                    busy: self.busy.clone(),
                    awaits: awaits.clone().unwrap_or_default(),
                });
            }
        }
    }

    /// A device that does not do what it is asked for, or an operator who skips the test, leaves the test undecided; it is nobody's breakdown.
    fn refused(&mut self, section: Section, step: &Step, why: &str) {
        match section {
            Section::Given => {
                self.preamble = Err(Reason::PreconditionRefused {
                    step: step.path.clone(),
                    seen: why.to_owned(),
                });
            }
            // Another stimulus of the conversation may still be answered.
            Section::Steps if self.test.goes_on_at(&step.path).is_some() => {}
            Section::Steps => self.body = Err(format!("{}: {why}", step.path)),
            Section::Finally => {}
        }
    }

    fn broken(&mut self, section: Section, step: &Step, why: &str) {
        if section != Section::Finally {
            self.trouble.get_or_insert_with(|| format!("{}: {why}", step.path));
        }
    }

    fn record_step(&mut self, step: &Step, outcome: &StepOutcome, end: &StepEnd, begun: (u64, Moment), entry: &Entry) {
        let word = match (end, &outcome.reached) {
            (StepEnd::Broken(_), _) => "broken",
            (StepEnd::Interrupted, _) => "interrupted",
            (StepEnd::Skipped(_), _) => "skipped",
            (StepEnd::Refused(_) | StepEnd::Declined(_), _) | (_, Some(Err(_))) => "failed",
            _ => StepResult::DONE,
        };
        self.result.steps.push(StepResult {
            path: step.path.clone(),
            verb: step.verb_span.text().to_owned(),
            title: step.title.clone(),
            place: step.span.place(),
            outcome: word.to_owned(),
            journal: Some((begun.0, entry.seq())),
            took: outcome.took,
            seconds: entry.at().moment.since(begun.1).as_secs_f64(),
        });
    }

    fn push(&mut self, decision: Option<Decision>) {
        if let Some(decision) = decision {
            self.verdict.add(decision.verdict());
            self.result.decisions.push(decision);
        }
    }

    /// Tells it what shows nothing in this test, before it ends.
    pub(super) fn hide(&mut self, hidden: Vec<Hidden>) {
        self.hidden = hidden;
    }

    /// What the harness's own lag can explain is not held against the device.
    fn allow_for_lag(&mut self, timeline: &Timeline) {
        for open in &mut self.open {
            let Some(lag) = open.of_time.and_then(|timing| timing.explained(timeline)) else {
                continue;
            };
            let why = format!(
                "the harness itself was held up for {:.1} s meanwhile",
                lag.as_secs_f64()
            );
            open.clause.message = format!("cannot be told, since {why}; {}", open.clause.message);
            open.clause.holds = ClauseOutcome::Unobservable(why);
        }
    }

    /// Somebody else on the tap may be the cause of what is found.
    pub(super) fn interfered(&mut self, why: &Arc<str>) {
        self.interference.get_or_insert_with(|| Arc::clone(why));
    }

    /// The run was interrupted: what is found from now on is not held against the device. What was found before stands.
    pub(super) fn interrupted(&mut self, seq: u64, why: &Arc<str>) {
        self.interrupted.get_or_insert_with(|| (seq, Arc::clone(why)));
    }

    /// What somebody else may have caused is not held against the device.
    fn allow_for_others(&mut self) {
        if let Some((since, why)) = &self.interrupted {
            for open in self.open.iter_mut().filter(|open| open.ended > *since) {
                if matches!(
                    open.clause.holds,
                    ClauseOutcome::Violated | ClauseOutcome::HeldLate | ClauseOutcome::Warning
                ) {
                    open.clause.message = format!("cannot be told, since {why}; {}", open.clause.message);
                    open.clause.holds = ClauseOutcome::Unobservable(why.to_string());
                }
            }
        }
        let Some(why) = &self.interference else { return };
        for open in &mut self.open {
            if matches!(open.clause.holds, ClauseOutcome::Violated | ClauseOutcome::HeldLate) {
                open.clause.message = format!("cannot be told, since {why}; {}", open.clause.message);
                open.clause.holds = ClauseOutcome::Unobservable(why.to_string());
            }
        }
    }

    /// Clauses that were never reached are inconclusive, and a test that decided nothing is an error.
    fn finish(&mut self, at: Moment, ground: &Ground) {
        if std::mem::replace(&mut self.ended, true) {
            return;
        }
        self.result.seconds = at.since(self.begun.1).as_secs_f64();
        let mut open = std::mem::take(&mut self.open);
        let hidden = hide(&mut open, &self.hidden);
        excuse_busy(&mut open);
        for open in open {
            let decision = decide(open, &ground.catalogue, &ground.pack);
            self.push(decision);
        }
        let why = match (&self.trouble, &self.preamble, &self.body) {
            (Some(trouble), _, _) => Reason::observed(trouble),
            (None, Ok(()), _) if hidden.is_some() => Reason::observed(hidden.unwrap_or_default()),
            (None, Err(why), _) => why.clone(),
            (None, Ok(()), Err(why)) => {
                let other = self.interference.as_ref().map(|other| format!("{other}; "));
                Reason::observed(format!("{}an earlier step failed: {why}", other.unwrap_or_default()))
            }
            (None, Ok(()), Ok(())) => Reason::observed("the test ended before this was judged"),
        };
        let sentence = why.to_string();
        let run: Vec<String> = self.result.steps.iter().map(|step| step.path.clone()).collect();
        let test = Arc::clone(&self.test);
        for step in test.steps.iter().filter(|step| !run.contains(&step.path)) {
            if step
                .spec
                .as_ref()
                .is_some_and(|spec| !spec.contains(ground.pack.version))
            {
                continue;
            }
            self.result.steps.push(StepResult {
                path: step.path.clone(),
                verb: step.verb_span.text().to_owned(),
                title: step.title.clone(),
                place: step.span.place(),
                outcome: StepResult::NOT_RUN.to_owned(),
                journal: None,
                took: None,
                seconds: 0.0,
            });
            for (requirement, clause) in step.clauses() {
                if super::decide::mood(&ground.catalogue, &ground.pack, requirement.as_str()).is_none() {
                    continue;
                }
                let place = step.verb_span.place();
                let decision = Decision::new(
                    requirement.as_str(),
                    Verdict::Inconclusive,
                    clause,
                    place,
                    sentence.clone(),
                );
                self.push(Some(decision));
            }
        }
        if self.trouble.is_some() || self.result.decisions.is_empty() {
            self.verdict.add(Verdict::Error);
        }
        self.result.verdict = self.verdict.get();
        let (reason, cause) = self.reason(why).unzip();
        self.result.cause = cause.flatten();
        self.result.reason = match (reason, self.gone().map(Gone::to_string)) {
            (Some(reason), Some(story)) => Some(format!("{reason}; {story}")),
            (reason, story) => reason.or(story),
        };
    }

    /// How the device left, of its own accord, in this test. That a device which passes is quiet at the end is no matter.
    fn gone(&self) -> Option<&Gone> {
        let passes = self.verdict.get() == Some(Verdict::Pass);
        let silent = self.silent.as_ref().filter(|_| !passes);
        self.departure.story().or(silent)
    }

    /// Why the verdict is not a pass, and of which kind that is where more than the text tells.
    fn reason(&self, why: Reason) -> Option<(String, Option<Reason>)> {
        let verdict = self.verdict.get()?;
        if verdict == Verdict::Pass {
            return None;
        }
        let decisive = self
            .result
            .decisions
            .iter()
            .find(|decision| decision.verdict() == verdict);
        Some(match decisive {
            Some(decision) if verdict != Verdict::Inconclusive => {
                (format!("{}: {}", decision.requirement, decision.message), None)
            }
            _ => (why.to_string(), why.typed()),
        })
    }

    /// The result so far; complete after `TestEnded`.
    pub fn result(&self) -> &TestResult {
        &self.result
    }

    /// Ends the test where the journal breaks off, and gives its result.
    pub fn break_off(mut self, at: Moment, why: &str, ground: &Ground) -> TestResult {
        if !self.ended {
            if self.preamble.is_ok() && self.body.is_ok() {
                self.body = Err(why.to_owned());
            }
            self.allow_for_others();
            self.finish(at, ground);
        }
        self.result
    }
}
