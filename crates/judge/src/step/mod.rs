//! Deciding one step, entry by entry.
//!
//! An [`Evaluator`] is a pure state machine: it is shown the journal entries of its step and the time at
//! which the step was ended, and knows at any moment whether it is decided, and if not, until when it makes
//! sense to wait. The engine asks it live; re-judging shows it the same entries again.

mod action;
mod always;
mod answer;
mod expect;
mod never;
mod retained;

use std::sync::Arc;
use std::time::Duration;

use serde_json::Value;

pub use super::clause_outcome::ClauseOutcome;
use super::clause_outcome::unbound_text;
use super::eval_context::EvalContext;
use super::limit::Limit;
use super::repair::StateRepair;
use super::timeline::Timeline;
use super::window::{CheckOutcome, CheckWindow};
use tck_base::clock::Moment;
use tck_base::diagnostic::Span;
use tck_base::pattern::{Bound, Pattern};
use tck_journal::Entry;
use tck_pack::RequirementId;
use tck_result::NearestMiss;
use tck_suite::model::{Assertion, Binding, From, Selection, Step, Verb};
use tck_suite::spelled;

/// Where the test stands when a step begins.
#[derive(Clone, Copy, Debug)]
pub struct Position {
    /// First journal number of the test.
    pub test: u64,
    /// The last stimulus.
    pub mark: u64,
    /// The message the last `expect` took, or the mark if that is later.
    pub cursor: u64,
    /// Deadlines count from here: the last stimulus, or the message that was taken since.
    pub base: Moment,
    /// When this step began.
    pub begun: Moment,
    /// Journal number at which this step began.
    pub step: u64,
}

impl Position {
    fn start(&self, from: From, usual: From) -> u64 {
        match if from == From::Usual { usual } else { from } {
            From::Mark => self.mark,
            From::Test => self.test,
            From::Now => self.step,
            From::Usual | From::Here | From::Latest => self.cursor,
        }
    }
}

/// One requirement bound to one clause, decided.
#[derive(Clone, Debug)]
pub struct Clause {
    /// The requirement.
    pub requirement: RequirementId,
    /// `checks`, `assert`, `prefer` or `until`.
    pub word: &'static str,
    /// Where the caret points.
    pub span: Span,
    /// What stands at the caret.
    pub label: String,
    /// How it came out.
    pub holds: ClauseOutcome,
    /// The entry that decided it.
    pub witness: Option<u64>,
    /// One line.
    pub message: String,
    /// What was expected, values filled in.
    pub expected: Option<String>,
    /// The nearest miss.
    pub nearest: Option<NearestMiss>,
}

/// What became of a step.
#[derive(Clone, Debug, Default)]
pub struct StepOutcome {
    /// Whether what it selects was there; `Err` says why not, in one line.
    pub reached: Option<Result<(), String>>,
    /// The entry it took.
    pub took: Option<u64>,
    /// Its clauses.
    pub clauses: Vec<Clause>,
    /// Values it keeps.
    pub saves: Vec<(String, Value)>,
    /// How many entries of its subject it looked at.
    pub seen: u64,
    /// Lasting mistakes of the vehicle that would have stood in the way.
    pub allowances: Vec<String>,
    /// What came too late, or did not come in time.
    pub timing: Option<Timing>,
}

/// A finding about time.
#[derive(Clone, Copy, Debug)]
pub enum Timing {
    /// It came later than it should.
    Late {
        /// From when it counts.
        since: Moment,
        /// When it came.
        at: Moment,
        /// How long it may take.
        limit: Duration,
    },
    /// It had not come by then.
    Missed(Moment),
}

impl Timing {
    /// How long the harness was held up itself, if that can explain it.
    pub(super) fn explained(self, timeline: &Timeline) -> Option<Duration> {
        let lag = match self {
            Self::Late { since, at, limit } => {
                let lag = timeline.lag(since, at);
                return (at.since(since).saturating_sub(lag) <= limit && !lag.is_zero()).then_some(lag);
            }
            Self::Missed(deadline) => timeline.lag(deadline, deadline + AFTERWARDS),
        };
        (!lag.is_zero()).then_some(lag)
    }
}

/// A harness that was held up at the end of a step has not read yet what came before.
const AFTERWARDS: Duration = Duration::from_millis(500);

/// What the engine should do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Nothing more to wait for.
    Decided,
    /// Wait for entries, at most until then.
    Pending(Moment),
    /// Prove that the observer is alive, and wait at most until then.
    NeedsProbe(Moment),
}

/// A step being decided. There is one at a time, so its size does not matter.
#[expect(clippy::large_enum_variant, reason = "one value at a time")]
pub(super) enum Evaluator {
    /// Decides nothing; ends when the engine says so.
    Plain,
    Expect(expect::Expecting),
    Never(never::Forbidding),
    Always(always::Holding),
    Action(action::Walking),
    Retained(retained::Fetching),
    /// A variable it needs has no value.
    Unbound(StepOutcome),
}

impl Evaluator {
    /// Begins a step. Entries that are already in the timeline are looked at right away.
    pub(super) fn begin(step: &Step, position: Position, scene: &EvalContext<'_>) -> Self {
        let begun = match &*step.verb {
            Verb::Expect(verb) => expect::Expecting::begin(verb, step, position, scene).map(Self::Expect),
            Verb::Never(verb) => never::Forbidding::begin(verb, step, position, scene).map(Self::Never),
            Verb::Always(verb) => always::Holding::begin(verb, step, position, scene).map(Self::Always),
            Verb::Action(verb) => action::Walking::begin(verb, step, position, scene).map(Self::Action),
            Verb::Retained(verb) => retained::Fetching::begin(verb, step, position, scene).map(Self::Retained),
            Verb::Send(_) | Verb::Link(_) | Verb::Serve(_) | Verb::Operator(_) | Verb::Vehicle(_) => Ok(Self::Plain),
        };
        begun.unwrap_or_else(|why| {
            let clauses = step.clauses().into_iter().map(|(requirement, path)| Clause {
                requirement,
                word: word_of(&path),
                span: step.verb_span.clone(),
                label: String::new(),
                holds: ClauseOutcome::Unobservable(why.clone()),
                witness: None,
                message: why.clone(),
                expected: None,
                nearest: None,
            });
            Self::Unbound(StepOutcome {
                clauses: clauses.collect(),
                reached: Some(Err(why.clone())),
                ..StepOutcome::default()
            })
        })
    }

    /// Looks at one more entry of the step.
    pub(super) fn observe(&mut self, entry: &Arc<Entry>, subject: Option<&str>, scene: &EvalContext<'_>) {
        match self {
            Self::Plain | Self::Unbound(_) => {}
            Self::Expect(step) => step.observe(entry, subject, scene),
            Self::Never(step) => step.observe(entry, subject, scene),
            Self::Always(step) => step.observe(entry, subject, scene),
            Self::Action(step) => step.observe(entry, subject),
            Self::Retained(step) => step.observe(entry, scene),
        }
    }

    pub(super) fn progress(&self) -> Progress {
        match self {
            Self::Plain | Self::Unbound(_) => Progress::Decided,
            Self::Expect(step) => step.progress(),
            Self::Never(step) => step.progress(),
            Self::Always(step) => step.progress(),
            Self::Action(step) => step.progress(),
            Self::Retained(step) => step.progress(),
        }
    }

    /// The step has ended at `at`; `cut_short` when it was not the deadline that ended it.
    pub(super) fn end(self, at: Moment, cut_short: Option<&str>, scene: &EvalContext<'_>) -> StepOutcome {
        let allowances = self.allowances();
        let timing = self.timing();
        let mut outcome = match self {
            Self::Plain => StepOutcome::default(),
            Self::Unbound(outcome) => outcome,
            Self::Expect(step) => step.end(at, cut_short),
            Self::Never(step) => step.end(at, cut_short, scene),
            Self::Always(step) => step.end(at, cut_short, scene),
            Self::Action(step) => step.end(at, cut_short),
            Self::Retained(step) => step.end(at, cut_short),
        };
        outcome.allowances.extend(allowances);
        outcome.timing = timing;
        outcome
    }

    fn timing(&self) -> Option<Timing> {
        match self {
            Self::Expect(step) => step.timing(),
            Self::Always(step) => step.timing(),
            Self::Action(step) => step.timing(),
            _ => None,
        }
    }

    /// Lasting mistakes of the vehicle that would have stood in the way.
    fn allowances(&self) -> Vec<String> {
        match self {
            Self::Expect(step) => step.allowances(),
            Self::Never(step) => step.allowances(),
            Self::Always(step) => step.allowances(),
            Self::Action(step) => step.allowances(),
            _ => Vec::new(),
        }
    }
}

fn word_of(path: &str) -> &'static str {
    match path.rsplit('.').next() {
        Some("assert") => "assert",
        Some("prefer") => "prefer",
        Some("until") => "until",
        _ => "checks",
    }
}

/// `where` and `check`, ready to look at messages.
pub(super) struct Selector {
    pub(super) pattern: Option<Bound>,
    pub(super) check: Option<tck_suite::model::CheckUse>,
    pub(super) baseline: Option<Value>,
    pub(super) span: Span,
    mends: StateRepair,
}

impl Selector {
    pub(super) fn bind(
        selection: &Selection,
        subject: &str,
        fallback: &Span,
        position: Position,
        scene: &EvalContext<'_>,
    ) -> Result<Self, String> {
        let pattern = bind_pattern(selection.pattern.as_ref(), subject, scene)?;
        let span = match (&selection.pattern, &selection.check) {
            (Some(pattern), _) => pattern.span.clone(),
            (None, Some(check)) => check.span.clone(),
            (None, None) => fallback.clone(),
        };
        Ok(Self {
            pattern,
            check: selection.check.clone(),
            baseline: scene.timeline.baseline(subject, position.mark),
            span,
            mends: StateRepair::default(),
        })
    }

    /// From now on the states are read as they are meant, except for what is about a mistake of the vehicle itself.
    pub(super) fn lenient(mut self, subject: &str, decides: &[&RequirementId], scene: &EvalContext<'_>) -> Self {
        self.mends = StateRepair::of(scene.waivers, subject, decides);
        self
    }

    /// Its named check, to be shown every message.
    pub(super) fn take_check(&mut self, scene: &EvalContext<'_>) -> Result<Option<CheckWindow>, String> {
        let Some(check) = self.check.take() else {
            return Ok(None);
        };
        let window = CheckWindow::start(&check, scene)?;
        Ok(Some(window.lenient(self.mends.clone())))
    }

    /// The mistakes of the vehicle that would have stood in the way.
    pub(super) fn allowances(&self) -> Vec<String> {
        self.mends.used()
    }

    /// Whether a message is what is looked for. A named check looks at everything since the test began.
    pub(super) fn takes(&self, entry: &Entry, scene: &EvalContext<'_>) -> bool {
        let matches = match &self.pattern {
            None => entry.subject().is_some(),
            Some(pattern) => entry.subject().is_some_and(|message| {
                let takes = |message: &Value| pattern.matches(message, self.baseline.as_ref());
                takes(&message) || self.mends.make_up_for(entry, scene, takes)
            }),
        };
        matches && !matches!(self.check_says(entry, scene), CheckOutcome::Wrong(..))
    }

    /// Whether a message is what is looked for only for a lasting mistake of the vehicle.
    pub(super) fn is_excused(&self, entry: &Entry, scene: &EvalContext<'_>) -> bool {
        let Some(pattern) = &self.pattern else { return false };
        let takes = |message: &Value| pattern.matches(message, self.baseline.as_ref());
        self.mends.make_up_for(entry, scene, |message: &Value| !takes(message))
    }

    /// What the named check says about this entry; right where there is no check.
    fn check_says(&self, entry: &Entry, scene: &EvalContext<'_>) -> CheckOutcome {
        let Some(check) = &self.check else {
            return CheckOutcome::Right;
        };
        match CheckWindow::start(check, scene) {
            Err(why) => CheckOutcome::Wrong(ClauseOutcome::Unobservable(why.clone()), why),
            Ok(window) => window.lenient(self.mends.clone()).observe(entry, scene),
        }
    }

    pub(super) fn expected(&self) -> Option<String> {
        match (&self.pattern, &self.check) {
            (Some(pattern), Some(check)) => Some(format!(
                "{}, and what the check {} asks for",
                pattern.conditions(),
                check.name
            )),
            (Some(pattern), None) => Some(pattern.conditions()),
            (None, Some(check)) => Some(format!("what the check {} asks for", check.name)),
            (None, None) => None,
        }
    }

    /// How close a message came; `None` when there is nothing to compare.
    pub(super) fn closeness(&self, entry: &Entry) -> Option<Near> {
        let pattern = self.pattern.as_ref()?;
        let message = entry.subject()?;
        let examination = pattern.examine(&message, self.baseline.as_ref());
        let (agreeing, total) = examination.score;
        let miss = examination.misses.into_iter().next();
        Some(Near {
            share: if total == 0 {
                0.0
            } else {
                agreeing as f64 / total as f64
            },
            span: miss.as_ref().map(|miss| miss.span.clone()),
            miss: miss.map(|miss| NearestMiss {
                seq: entry.seq(),
                path: miss.path,
                found: miss.found,
                expected: miss.expected,
            }),
        })
    }
}

/// A message that came close.
pub(super) struct Near {
    share: f64,
    pub(super) span: Option<Span>,
    pub(super) miss: Option<NearestMiss>,
}

/// Keeps the closest message; of two equally close ones the later.
pub(super) fn keep_nearest(best: &mut Option<Near>, candidate: Option<Near>) {
    let Some(candidate) = candidate else { return };
    if best.as_ref().is_none_or(|best| candidate.share >= best.share) {
        *best = Some(candidate);
    }
}

/// A picture with its variables filled in, and with the names of the version.
pub(super) fn bind_pattern(
    pattern: Option<&Pattern>,
    subject: &str,
    scene: &EvalContext<'_>,
) -> Result<Option<Bound>, String> {
    pattern
        .map(|pattern| spelled(pattern, scene.pack.names(), subject).bind(scene.bindings))
        .transpose()
        .map_err(|unbound| unbound_text(&unbound))
}

pub(super) fn limit(time: &tck_suite::model::TimeTerm, scene: &EvalContext<'_>) -> Result<Limit, String> {
    Limit::resolve(time, scene.bindings).ok_or_else(|| "a time limit has no value".to_owned())
}

/// The requirements of `checks:`.
fn ids(bindings: &[Binding]) -> Vec<&RequirementId> {
    bindings.iter().map(|binding| &binding.requirement).collect()
}

/// The clauses of `checks:`, all with the same outcome.
pub(super) fn bound_clauses(
    bindings: &[Binding],
    word: &'static str,
    span: &Span,
    holds: &ClauseOutcome,
    witness: Option<u64>,
    message: &str,
) -> Vec<Clause> {
    bindings
        .iter()
        .map(|binding| Clause {
            requirement: binding.requirement.clone(),
            word,
            span: span.clone(),
            label: String::new(),
            holds: holds.clone(),
            witness,
            message: message.to_owned(),
            expected: None,
            nearest: None,
        })
        .collect()
}

/// An assertion judged on the message that was picked.
pub(super) fn assertion_clause(
    assertion: &Assertion,
    word: &'static str,
    entry: &Entry,
    subject: &str,
    position: Position,
    scene: &EvalContext<'_>,
) -> Clause {
    let mut clause = Clause {
        requirement: assertion.requirement.clone(),
        word,
        span: assertion.span.clone(),
        label: String::new(),
        holds: ClauseOutcome::Held,
        witness: Some(entry.seq()),
        message: format!("#{} shows it", entry.seq()),
        expected: None,
        nearest: None,
    };
    let selector = match Selector::bind(&assertion.selection, subject, &assertion.span, position, scene) {
        Ok(selector) => selector.lenient(subject, &[&assertion.requirement], scene),
        Err(why) => {
            clause.holds = ClauseOutcome::Unobservable(why.clone());
            clause.message = why;
            return clause;
        }
    };
    clause.expected = selector.expected();
    let said = selector.check_says(entry, scene);
    if selector.takes(entry, scene) {
        if said == CheckOutcome::Nothing {
            let why = "the message does not show what is to be judged".to_owned();
            clause.holds = ClauseOutcome::Unobservable(why.clone());
            clause.message = why;
        }
        return clause;
    }
    clause.holds = if word == "prefer" {
        ClauseOutcome::Warning
    } else {
        ClauseOutcome::Violated
    };
    match selector.closeness(entry).filter(|near| near.miss.is_some()) {
        Some(near) => {
            if let Some(span) = near.span {
                clause.span = span;
            }
            if let Some(miss) = &near.miss {
                clause.label = format!("{} is {}", shown_path(&miss.path), miss.found);
                clause.message = format!(
                    "#{}: {} is {}, expected {}",
                    miss.seq,
                    shown_path(&miss.path),
                    miss.found,
                    miss.expected
                );
            }
            clause.nearest = near.miss;
        }
        None => {
            let mut found = "does not hold".to_owned();
            if let CheckOutcome::Wrong(holds, why) = said {
                if clause.holds == ClauseOutcome::Violated {
                    clause.holds = holds;
                }
                found = why;
            }
            clause.label.clone_from(&found);
            clause.message = format!("#{}: {found}", entry.seq());
        }
    }
    clause
}

pub(super) fn shown_path(path: &str) -> &str {
    if path.is_empty() { "the message" } else { path }
}

/// `1.25 s`.
pub(super) fn seconds(duration: Duration) -> String {
    if duration < Duration::from_secs(1) {
        format!("{} ms", duration.as_millis())
    } else {
        format!("{:.1} s", duration.as_secs_f64())
    }
}

/// The timeline entries a step has to look at when it begins.
pub(super) fn backlog(timeline: &Timeline, subject: &str, from: u64) -> Vec<Arc<Entry>> {
    timeline.since(subject, from).to_vec()
}
