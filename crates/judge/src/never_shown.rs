//! What is undecided because something never came: the members and words that a monitor, or the step where a test stopped, waits
//! for and that no message had.
//!
//! Only what the suites say is named: the pictures of a monitor and of a step, and the members a named check cannot do without. Where
//! those came and still nothing was decided, nothing is said here.

use std::collections::BTreeSet;

use serde_json::Value;

use super::decide::mood;
use super::message_tally::MessageTally;
use super::rules::Rules;
use tck_base::pattern::{Bindings, Element, Pattern, PatternKind};
use tck_base::verdict::Verdict;
use tck_check::find;
use tck_pack::{MemberTree, Role};
use tck_result::{NeverShown, TestResult, Unseen};
use tck_suite::model::{Extent, Monitor, Rule, Test, Verb};
use tck_view::{Field, Names};

/// The outcome of a step that did not reach what it waited for.
const FAILED: &str = "failed";

/// What monitors do not decide because something never came. `is_open` says which requirements are undecided.
pub fn of_monitors(
    rules: &Rules,
    role: Role,
    tally: &MessageTally,
    bindings: &Bindings,
    is_open: &dyn Fn(&Monitor, &str) -> bool,
) -> Vec<NeverShown> {
    let mut all: Vec<NeverShown> = Vec::new();
    let pack = tally.pack();
    let monitors = rules.suites.monitors.iter();
    let on_duty =
        monitors.filter(|one| one.device.is_none_or(|device| device == role) && one.spec.contains(pack.version));
    for monitor in on_duty {
        for binding in &monitor.checks {
            let id = binding.requirement.as_str();
            if !is_open(monitor, id) || mood(&rules.catalogue, pack, id).is_none() {
                continue;
            }
            let missing = of_monitor(monitor, id, rules, tally, bindings);
            if missing.is_empty() {
                continue;
            }
            let same = |known: &&mut NeverShown| known.by == monitor.id && known.missing == missing;
            match all.iter_mut().find(same) {
                Some(known) => known.requirements.push(id.to_owned()),
                None => all.push(NeverShown {
                    by: monitor.id.clone(),
                    requirements: vec![id.to_owned()],
                    missing,
                }),
            }
        }
    }
    all
}

/// What never came of that which a monitor needs for a requirement.
fn of_monitor(monitor: &Monitor, id: &str, rules: &Rules, tally: &MessageTally, bindings: &Bindings) -> Vec<Unseen> {
    let mut search = Search::new(tally, bindings);
    for about in monitor
        .about
        .iter()
        .filter(|one| one.requirement.requirement.as_str() == id)
    {
        search.message(&about.topic, Some(&about.pattern));
    }
    match &monitor.rule {
        Rule::Always { topic, when, .. } => search.message(topic, when.as_ref()),
        Rule::Never { topic, .. } => search.message(topic, None),
        Rule::Check(check) => {
            let needs = find(rules.checks, &check.name).map_or(&[][..], |check| check.needs);
            for field in needs {
                search.field(*field);
            }
        }
    }
    search.done()
}

/// What the step never saw at which an undecided test stopped.
pub(super) fn of_test(
    test: &Test,
    result: &TestResult,
    tally: &MessageTally,
    bindings: &Bindings,
) -> Option<NeverShown> {
    if result.verdict != Some(Verdict::Inconclusive) {
        return None;
    }
    let stopped = result.steps.iter().find(|step| step.outcome == FAILED)?;
    let mut steps = test.sections().into_iter().flat_map(|(_, steps)| steps);
    let step = steps.find(|step| step.path == stopped.path)?;
    let mut search = Search::new(tally, bindings);
    match &*step.verb {
        Verb::Expect(expect) => search.message(&expect.topic, expect.selection.pattern.as_ref()),
        Verb::Always(always) => {
            if let Extent::Until(until) = &always.extent {
                search.message(&until.topic, until.selection.pattern.as_ref());
            }
        }
        _ => {}
    }
    let missing = search.done();
    let undecided = result
        .decisions
        .iter()
        .filter(|one| one.verdict() == Verdict::Inconclusive);
    let requirements: BTreeSet<&str> = undecided.map(|one| one.requirement.as_str()).collect();
    (!missing.is_empty()).then(|| NeverShown {
        by: test.id.clone(),
        requirements: requirements.into_iter().map(str::to_owned).collect(),
        missing,
    })
}

/// A search for what never came.
struct Search<'a> {
    tally: &'a MessageTally,
    bindings: &'a Bindings,
    found: BTreeSet<Unseen>,
}

impl<'a> Search<'a> {
    fn new(tally: &'a MessageTally, bindings: &'a Bindings) -> Self {
        Self {
            tally,
            bindings,
            found: BTreeSet::new(),
        }
    }

    fn done(self) -> Vec<Unseen> {
        self.found.into_iter().collect()
    }

    /// Looks for what a message like this needs.
    fn message(&mut self, topic: &str, pattern: Option<&Pattern>) {
        let Some(tree) = self.tally.tree(topic) else { return };
        if let Some(nothing) = self.tally.unseen(topic, 0, None) {
            self.found.insert(nothing);
        } else if let Some(pattern) = pattern {
            self.pattern(topic, tree, 0, pattern);
        }
    }

    /// Looks for what a picture of a member that came needs.
    fn pattern(&mut self, topic: &str, tree: &MemberTree, at: usize, pattern: &Pattern) {
        match &pattern.kind {
            PatternKind::Object(members) => {
                for (name, inner) in members.iter().filter(|(_, inner)| wants(inner)) {
                    let Some(child) = tree.child(at, name) else { continue };
                    if !self.is_missing(topic, child) {
                        self.pattern(topic, tree, child, inner);
                    }
                }
            }
            PatternKind::All(parts) => parts.iter().for_each(|part| self.pattern(topic, tree, at, part)),
            PatternKind::List(parts) => self.elements(topic, tree, at, parts.iter()),
            PatternKind::Elements(elements) if wants(pattern) => {
                self.elements(topic, tree, at, std::iter::once(&*elements.pattern));
            }
            PatternKind::Equals(term) => {
                if let Ok(value) = term.bind(self.bindings) {
                    self.value(topic, tree, at, &value);
                }
            }
            PatternKind::In(terms) => {
                let words = terms.iter().filter_map(|term| term.bind(self.bindings).ok());
                let unseen: Vec<Option<Unseen>> =
                    words.map(|word| self.tally.unseen(topic, at, word.as_str())).collect();
                // One of them would do.
                if unseen.len() == terms.len() && unseen.iter().all(Option::is_some) {
                    self.found.extend(unseen.into_iter().flatten());
                }
            }
            _ => {}
        }
    }

    fn elements<'p>(&mut self, topic: &str, tree: &MemberTree, at: usize, parts: impl Iterator<Item = &'p Pattern>) {
        let Some(element) = tree.element(at) else { return };
        if !self.is_missing(topic, element) {
            parts.for_each(|part| self.pattern(topic, tree, element, part));
        }
    }

    /// Looks for a value, of which an object is a picture, too.
    fn value(&mut self, topic: &str, tree: &MemberTree, at: usize, value: &Value) {
        match value {
            Value::String(word) => self.found.extend(self.tally.unseen(topic, at, Some(word))),
            Value::Object(members) => {
                for (name, inner) in members {
                    let Some(child) = tree.child(at, name) else { continue };
                    if !self.is_missing(topic, child) {
                        self.value(topic, tree, child, inner);
                    }
                }
            }
            _ => {}
        }
    }

    /// Whether a member never came, which is kept then.
    fn is_missing(&mut self, topic: &str, at: usize) -> bool {
        let unseen = self.tally.unseen(topic, at, None);
        let is_missing = unseen.is_some();
        self.found.extend(unseen);
        is_missing
    }

    /// Looks for a member that a named check needs, where only messages of one topic have one of that name.
    fn field(&mut self, field: Field) {
        let pack = self.tally.pack();
        let Some(name) = last_name(pack.names(), field) else {
            return;
        };
        let mut places = Vec::new();
        for rule in pack.topics() {
            let topic = rule.name.as_str();
            let nodes = self.tally.tree(topic).map_or(&[][..], MemberTree::nodes);
            let named = (0..nodes.len()).filter(|at| nodes[*at].name == name);
            places.extend(named.map(|at| (topic, at)));
        }
        let unseen = places.iter().map(|(topic, at)| self.tally.unseen(topic, *at, None));
        let unseen: Vec<Option<Unseen>> = unseen.collect();
        let is_of_one = places.windows(2).all(|pair| pair[0].0 == pair[1].0);
        if is_of_one && unseen.iter().all(Option::is_some) {
            self.found.extend(unseen.into_iter().flatten().next());
        }
    }
}

/// The name of a member, without that of an object in which the version has put it.
fn last_name(names: &Names, field: Field) -> Option<&str> {
    names.name(field)?.rsplit('/').next()
}

/// Whether a picture asks for something that has to come.
fn wants(pattern: &Pattern) -> bool {
    match &pattern.kind {
        PatternKind::Absent | PatternKind::Not(_) | PatternKind::Empty(true) => false,
        PatternKind::Elements(elements) => matches!(elements.which, Element::Has | Element::HasNew | Element::One),
        PatternKind::All(parts) => parts.iter().all(wants),
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use serde_json::json;

    /// What came by, and what the version calls things.
    fn tally(messages: &[(&str, Value)]) -> (MessageTally, Bindings) {
        let pack = tck_testing::library().rules.packs.latest();
        let mut tally = MessageTally::new(pack);
        for (topic, message) in messages {
            tally.note(topic, message);
        }
        let bindings = Bindings::above(vec![pack.words()]);
        (tally, bindings)
    }

    /// The rules of this crate, from those of the crate that the library is made with.
    fn rules() -> Rules {
        let all = &tck_testing::library().rules;
        Rules {
            checks: all.checks,
            packs: Arc::clone(&all.packs),
            catalogue: Arc::clone(&all.catalogue),
            hooks: Arc::clone(&all.hooks),
            suites: Arc::clone(&all.suites),
            sha256: all.sha256.clone(),
        }
    }

    /// What never came, by requirement.
    fn missing(requirement: &str, messages: &[(&str, Value)]) -> BTreeSet<String> {
        let (tally, bindings) = tally(messages);
        let is_open = |_: &Monitor, id: &str| id == requirement;
        let rules = rules();
        let all = of_monitors(&rules, Role::Agv, &tally, &bindings, &is_open);
        assert!(all.iter().all(|one| one.requirements == [requirement]));
        all.iter()
            .flat_map(|one| one.missing.iter().map(ToString::to_string))
            .collect()
    }

    #[test]
    fn a_monitor_says_what_never_came_from_the_topic_down_to_the_member() {
        let about = "FACT-10";
        assert_eq!(
            missing(about, &[]),
            BTreeSet::from(["any message on factsheet".to_owned()])
        );
        let bare = missing(about, &[("factsheet", json!({ "headerId": 1 }))]);
        assert!(bare.contains("/vehicleConfig of factsheet"), "{bare:?}");
        let whole = json!({ "vehicleConfig": { "network": { "localIpAddress": "10.0.0.1" } } });
        assert_eq!(missing(about, &[("factsheet", whole)]), BTreeSet::new());
    }

    #[test]
    fn a_test_that_stopped_says_which_word_its_step_never_saw() {
        let mode = "modes/reported[teach-in]";
        let tests = &tck_testing::library().rules.suites.tests;
        let test = tests.iter().find(|test| test.id == mode).expect("the test");
        let stopped = |outcome: &str, messages: &[(&str, Value)]| {
            let result = json!({ "id": mode, "title": "", "verdict": "inconclusive", "seconds": 0.0, "maturity": "reviewed",
                "journal": null,
                "decisions": [{ "requirement": "MODE-01", "verdict": "inconclusive", "clause": "steps[2].checks", "place": "",
                    "message": "" }],
                "steps": [{ "path": "steps[2]", "verb": "expect: state", "place": "", "outcome": outcome, "seconds": 0.0 }] });
            let result: TestResult = serde_json::from_value(result).expect("a result");
            let (tally, bindings) = tally(messages);
            of_test(test, &result, &tally, &bindings).map(|one| (one.requirements.join(" "), one.missing()))
        };
        let automatic = || ("state", json!({ "operatingMode": "AUTOMATIC" }));
        let said = stopped("failed", &[automatic()]);
        let expected = ("MODE-01".to_owned(), "TEACHIN as /operatingMode of state".to_owned());
        assert_eq!(said, Some(expected));
        assert_eq!(stopped("done", &[automatic()]), None);
        let taught = ("state", json!({ "operatingMode": "TEACHIN" }));
        assert_eq!(
            stopped("failed", &[automatic(), taught]),
            None,
            "it came, and the test stopped for another reason"
        );
    }
}
