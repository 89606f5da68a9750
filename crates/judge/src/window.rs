//! Named checks over a window of what an evaluator may look at.

use serde_json::{Map, Value};

use super::clause_outcome::{ClauseOutcome, unbound_text};
use super::eval_context::EvalContext;
use super::repair::StateRepair;
use tck_base::time::TimeLimits;
use tck_base::verdict::Verdict;
use tck_check::{CheckContext, CheckFinding, Running, Shared, find};
use tck_journal::Entry;
use tck_pack::RequirementId;
use tck_suite::model::{Binding, CheckUse};
use tck_world::{Listens, Observer, World};

/// A named check running over a window.
pub(super) struct CheckWindow {
    running: Box<dyn Running>,
    listens: Listens,
    observer: Observer,
    world: World,
    shared: Shared,
    with: Map<String, Value>,
    /// The limits, where the clause has some of its own.
    time: Option<Box<TimeLimits>>,
    findings: Vec<CheckFinding>,
    /// The requirements the check names, and those of them that count here.
    decides: &'static [&'static str],
    about: Vec<RequirementId>,
    /// How the states are read.
    mends: StateRepair,
    /// Those of them that are about the window.
    told: Vec<CheckFinding>,
    /// How many entries of the test it has seen.
    seen: usize,
}

/// What a named check says about an entry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum CheckOutcome {
    /// It had nothing to judge there.
    Nothing,
    /// It found nothing wrong.
    Right,
    /// What it found: how the clause comes out, and why.
    Wrong(ClauseOutcome, String),
}

impl CheckOutcome {
    fn of(finding: &CheckFinding) -> Self {
        let holds = match finding.verdict {
            Some(Verdict::Warning) => ClauseOutcome::Warning,
            Some(Verdict::Inconclusive) => ClauseOutcome::Unobservable(finding.message.clone()),
            _ => ClauseOutcome::Violated,
        };
        Self::Wrong(holds, finding.message.clone())
    }
}

impl CheckWindow {
    pub(super) fn start(check: &CheckUse, scene: &EvalContext<'_>) -> Result<Self, String> {
        let definition = find(scene.checks, &check.name).ok_or_else(|| format!("there is no check {}", check.name))?;
        let mut with = Map::new();
        for (name, term) in &check.with {
            let value = term.bind(scene.bindings).map_err(|unbound| unbound_text(&unbound))?;
            with.insert(name.clone(), value);
        }
        let shared = Shared::default();
        let mut world = World::default();
        world.reads(definition.reads);
        let time = scene.setting().time.with_own(&with).map(Box::new);
        let running = (definition.start)(&context(scene, (&with, time.as_deref()), &world, &shared));
        Ok(Self {
            running,
            listens: Listens::to(definition.listens),
            observer: Observer::new(scene.topics, scene.pack, scene.role),
            world,
            shared,
            with,
            time,
            findings: Vec::new(),
            decides: definition.decides,
            about: Vec::new(),
            mends: StateRepair::default(),
            told: Vec::new(),
            seen: 0,
        })
    }

    /// Of what the check finds, what names another requirement than the clause does is no business of the clause: the
    /// monitor finds it by its right name. A clause about something the check never names takes everything.
    pub(super) fn about(mut self, bindings: &[Binding]) -> Self {
        let ids = bindings.iter().map(|binding| &binding.requirement);
        let named = ids.filter(|id| self.decides.contains(&id.as_str()));
        self.about = named.cloned().collect();
        self
    }

    fn counts(&self, finding: &CheckFinding) -> bool {
        let named = finding.requirement.as_ref();
        self.about.is_empty() || named.is_none_or(|id| self.about.contains(id))
    }

    /// From now on the states are read as they are meant.
    pub(super) fn lenient(mut self, mends: StateRepair) -> Self {
        self.mends = mends;
        self
    }

    /// Shows it everything of the test up to and including this entry, which may be of any topic: a check of the
    /// states has to know the orders. Returns what it says about this very entry.
    pub(super) fn observe(&mut self, entry: &Entry, scene: &EvalContext<'_>) -> CheckOutcome {
        let mut said = CheckOutcome::Nothing;
        while let Some(next) = scene.entries.get(self.seen).filter(|next| next.seq() <= entry.seq()) {
            self.seen += 1;
            let before = self.findings.len();
            let meant = self.mends.read(next, scene);
            let shown = meant.as_deref().unwrap_or(next);
            let record = self.observer.see(shown);
            self.world.learn(&record, &scene.setting());
            let context = context(scene, (&self.with, self.time.as_deref()), &self.world, &self.shared);
            let judged =
                self.listens.hears(record.kind()) && self.running.observe(&record, &context, &mut self.findings);
            if next.seq() == entry.seq() {
                let here = self.findings.iter().skip(before);
                let here = here.filter(|finding| finding.seq == next.seq() && self.counts(finding));
                let here: Vec<CheckFinding> = here.cloned().collect();
                self.told.extend(here);
                said = match self.worst(before, Some(entry.seq())) {
                    Some(found) => found,
                    None if judged => CheckOutcome::Right,
                    None => CheckOutcome::Nothing,
                };
            }
        }
        said
    }

    /// The worst finding from `first` on, about one entry or about any.
    fn worst(&self, first: usize, seq: Option<u64>) -> Option<CheckOutcome> {
        let severity = |finding: &&CheckFinding| match finding.verdict {
            Some(Verdict::Warning) => 0,
            Some(Verdict::Inconclusive) => 1,
            _ => 2,
        };
        let found = self.findings.get(first..)?.iter();
        let found = found.filter(|finding| seq.is_none_or(|seq| finding.seq == seq) && self.counts(finding));
        found.max_by_key(severity).map(CheckOutcome::of)
    }

    /// What it found in the window about one of these requirements, sorted out: for each the worst, if any. `None`
    /// while everything it found concerns whatever the clause is bound to.
    pub(super) fn sorted(&self, bindings: &[Binding]) -> Option<Vec<Option<(u64, CheckOutcome)>>> {
        let about =
            |finding: &&CheckFinding, binding: &Binding| finding.requirement.as_ref() == Some(&binding.requirement);
        let severity = |finding: &&CheckFinding| match finding.verdict {
            Some(Verdict::Warning) => 0,
            Some(Verdict::Inconclusive) => 1,
            _ => 2,
        };
        let named = |finding: &CheckFinding| bindings.iter().any(|binding| about(&finding, binding));
        if self.told.is_empty() || !self.told.iter().all(named) {
            return None;
        }
        let worst = |binding: &Binding| {
            let own = self.told.iter().filter(|finding| about(finding, binding));
            own.max_by_key(severity)
                .map(|finding| (finding.seq, CheckOutcome::of(finding)))
        };
        Some(bindings.iter().map(worst).collect())
    }

    /// The window has ended; returns what was found by that.
    pub(super) fn finish(
        &mut self,
        end: tck_base::clock::Moment,
        scene: &EvalContext<'_>,
    ) -> Option<(ClauseOutcome, String)> {
        let before = self.findings.len();
        let context = context(scene, (&self.with, self.time.as_deref()), &self.world, &self.shared);
        self.running
            .finish(&self.observer.end(end), &context, &mut self.findings);
        let here = self.findings.iter().skip(before);
        let here: Vec<CheckFinding> = here.filter(|finding| self.counts(finding)).cloned().collect();
        self.told.extend(here);
        match self.worst(before, None)? {
            CheckOutcome::Wrong(holds, message) => Some((holds, message)),
            CheckOutcome::Nothing | CheckOutcome::Right => None,
        }
    }
}

fn context<'a>(
    scene: &'a EvalContext<'_>,
    (with, time): (&'a Map<String, Value>, Option<&'a TimeLimits>),
    world: &'a World,
    shared: &'a Shared,
) -> CheckContext<'a> {
    let mut setting = scene.setting();
    setting.time = time.unwrap_or(setting.time);
    CheckContext {
        setting,
        with,
        world,
        shared,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use tck_base::diagnostic::{Source, Span};
    use tck_pack::{Assets, Packs, RequirementId, Role};
    use tck_world::Observation;

    struct Silent;

    impl Running for Silent {
        fn observe(&mut self, _: &Observation<'_>, _: &CheckContext<'_>, _: &mut Vec<CheckFinding>) -> bool {
            false
        }
    }

    fn finding(requirement: Option<&str>, verdict: Option<Verdict>, seq: u64) -> CheckFinding {
        CheckFinding {
            requirement: requirement.map(RequirementId::from),
            verdict,
            seq,
            message: format!("found at {seq}"),
            element: None,
        }
    }

    fn window(told: Vec<CheckFinding>) -> CheckWindow {
        let packs = Packs::load(&Assets::of_source_tree().unwrap()).unwrap();
        CheckWindow {
            running: Box::new(Silent),
            listens: Listens::default(),
            observer: Observer::new(&BTreeMap::new(), packs.latest(), Role::Agv),
            world: World::default(),
            shared: Shared::default(),
            with: Map::new(),
            time: None,
            findings: Vec::new(),
            decides: &[],
            about: Vec::new(),
            mends: StateRepair::default(),
            told,
            seen: 0,
        }
    }

    fn sorted(told: Vec<CheckFinding>) -> Option<Vec<Option<(u64, CheckOutcome)>>> {
        let source = Source::new("test", "");
        let bindings = ["BLOCK-01", "BLOCK-05"].map(|id| Binding {
            requirement: RequirementId::from(id),
            span: Span::new(&source, 0, 0),
        });
        window(told).sorted(&bindings)
    }

    #[test]
    fn what_names_another_requirement_than_the_clause_does_not_count_there() {
        let clause = |decides: &'static [&'static str]| {
            let source = Source::new("test", "");
            let binding = Binding {
                requirement: RequirementId::from("BLOCK-01"),
                span: Span::new(&source, 0, 0),
            };
            let window = CheckWindow {
                decides,
                ..window(Vec::new())
            };
            window.about(&[binding])
        };
        let named = clause(&["BLOCK-01", "BLOCK-05"]);
        assert!(named.counts(&finding(Some("BLOCK-01"), None, 3)));
        assert!(named.counts(&finding(None, None, 3)));
        assert!(!named.counts(&finding(Some("BLOCK-05"), None, 3)));
        // A check that never names what the clause is about is used for all that it finds.
        assert!(clause(&["BLOCK-05"]).counts(&finding(Some("BLOCK-05"), None, 3)));
    }

    #[test]
    fn each_requirement_gets_the_worst_that_was_found_about_it() {
        let told = vec![
            finding(Some("BLOCK-05"), Some(Verdict::Warning), 3),
            finding(Some("BLOCK-05"), None, 5),
        ];
        let expected = CheckOutcome::Wrong(ClauseOutcome::Violated, "found at 5".to_owned());
        assert_eq!(sorted(told), Some(vec![None, Some((5, expected))]));
    }

    #[test]
    fn a_finding_on_whatever_the_clause_is_bound_to_is_not_sorted() {
        assert_eq!(sorted(vec![finding(None, None, 3)]), None);
        assert_eq!(sorted(vec![finding(Some("BLOCK-07"), None, 3)]), None);
        assert_eq!(sorted(Vec::new()), None);
    }
}
