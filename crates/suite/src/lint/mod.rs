//! Rules that need more than one file to check: the packs, the catalogue, the named checks, the hooks.
//!
//! A misspelled path under `never` would be a silent pass, so every name is looked up in every protocol version
//! the test claims. A clause is held against those versions that have one of its requirements; a clause without
//! requirements has to make sense in at least one.

mod checks;
mod harness_topics;
mod names;
mod paths;
mod requirements;
mod scope;
mod steps;
mod vocabulary;

use std::collections::BTreeSet;

use serde_json::Value;

pub use harness_topics::harness_topics;
pub use names::{Variable, variables};
pub use vocabulary::{PackVocabulary, RequirementFacts, Vocabulary};

use self::paths::Topic;
use self::scope::Scope;
use super::CheckInfo;
use super::fields::Problems;
use super::model::{About, Assertion, Binding, Monitor, Need, Operator, Rule, Selection, Test, Verb};
use tck_base::diagnostic::{Diagnostic, Span, closest, did_you_mean};
use tck_base::pattern::{Pattern, TermKind};
use tck_course::is_station;
use tck_pack::{HookInfo, RequirementId, Role, Version, VersionRange};
use tck_profile::{FOUND, SAMPLE_ACTIONS, STATEMENTS};

/// Where the header keys of a file are written.
pub(super) struct HeaderPlaces {
    /// The first key: where what is missing is shown.
    pub(super) start: Span,
    /// `spec`.
    pub(super) spec: Option<Span>,
    /// `moves`.
    pub(super) moves: Option<Span>,
    /// The entries of `needs`, as many as the model has.
    pub(super) needs: Vec<Span>,
    /// The entries of `hides` of a monitor.
    pub(super) hides: Vec<Span>,
    /// Whether all of the file could be read. Otherwise nothing is said about what seems to be missing.
    pub(super) complete: bool,
}

/// What all rules about one file share.
struct Linter<'a> {
    vocabulary: &'a dyn Vocabulary,
    known: &'a [CheckInfo],
    /// The side under test; `None` is both.
    role: Option<Role>,
    /// The packs the file claims.
    packs: Vec<usize>,
    problems: &'a mut Problems,
}

/// Checks a test.
pub(super) fn test(
    test: &Test,
    places: &HeaderPlaces,
    vocabulary: &dyn Vocabulary,
    known: &[CheckInfo],
    problems: &mut Problems,
) {
    let mut linter = Linter {
        packs: packs_in(vocabulary, &test.spec, None),
        vocabulary,
        known,
        role: Some(test.device),
        problems,
    };
    linter.header(&test.spec, &test.needs, places);
    if linter.packs.is_empty() {
        return;
    }
    let all = || test.sections().into_iter().flat_map(|(_, steps)| steps);
    let mut scope = Scope::of_test(vocabulary, all(), places.complete);
    for (section, steps) in test.sections() {
        for step in steps {
            let packs = packs_in(vocabulary, &test.spec, step.spec.as_ref());
            if packs.is_empty() {
                linter.no_version(&step.verb_span, "no version of this test has this step");
                continue;
            }
            scope.enter(step, linter.problems);
            step.visit_terms(&mut |term| scope.check(term, &packs, linter.problems));
            linter.step(step, section, &packs, &scope);
            scope.leave(step, linter.problems);
        }
    }
    if !places.complete {
        return;
    }
    if !test.steps.is_empty() && test.requirements().is_empty() {
        linter.problems.add(
            Diagnostic::new(
                "decides-nothing",
                places.start.clone(),
                "a test that decides nothing",
                "no step under `steps` is bound to a requirement",
            )
            .hint("name requirements under `checks:` or `assert:`"),
        );
    }
    linter.moves(test, places);
}

/// Checks a monitor. `topic` is where its topic is written.
pub(super) fn monitor(
    monitor: &Monitor,
    places: &HeaderPlaces,
    topic: Option<&Span>,
    vocabulary: &dyn Vocabulary,
    known: &[CheckInfo],
    problems: &mut Problems,
) {
    let mut linter = Linter {
        packs: packs_in(vocabulary, &monitor.spec, None),
        vocabulary,
        known,
        role: monitor.device,
        problems,
    };
    linter.header(&monitor.spec, &monitor.needs, places);
    for (_, at) in monitor
        .needs
        .iter()
        .zip(&places.needs)
        .filter(|(need, _)| **need != Need::Tap)
    {
        linter.problems.at(
            "monitor-need",
            at,
            "a monitor can only need the vantage `tap`",
            "what the device offers is for the check of the monitor to find out",
        );
    }
    let packs = linter.packs.clone();
    if packs.is_empty() {
        return;
    }
    let judged = match &monitor.rule {
        Rule::Never { topic, .. } | Rule::Always { topic, .. } => topic.as_str(),
        Rule::Check(_) => "state",
    };
    for (member, at) in monitor.hides.iter().zip(&places.hides) {
        linter.exists_somewhere(judged, &[member.as_str()], member, at);
    }
    let required = linter.requirements(&monitor.checks, &packs);
    let scope = Scope::of_monitor(vocabulary);
    for about in &monitor.about {
        linter.about(about, monitor, &scope, &packs);
    }
    let (name, patterns) = match &monitor.rule {
        Rule::Check(check) => {
            check.visit_terms(&mut |term| scope.check(term, &packs, linter.problems));
            let ids: Vec<&RequirementId> = match &monitor.instead_of {
                Some(instead_of) => {
                    linter.instead_of(instead_of, monitor, check);
                    vec![&instead_of.requirement]
                }
                None => monitor.checks.iter().map(|binding| &binding.requirement).collect(),
            };
            linter.check_use(check, &ids, &packs);
            return;
        }
        Rule::Never { topic, pattern } => (topic, vec![pattern]),
        Rule::Always { topic, when, pattern } => (topic, when.iter().chain([pattern]).collect()),
    };
    for Binding { requirement, span } in &monitor.checks {
        linter.not_permitted(requirement, span, &packs);
    }
    let at = topic.unwrap_or(&places.start);
    if !linter.observed_topic(name, &packs, at) {
        return;
    }
    for pattern in patterns {
        pattern.visit_terms(&mut |term| scope.check(term, &packs, linter.problems));
        linter.pattern(pattern, name, &packs, required.as_deref());
    }
}

/// The packs in a range, and in a second one.
fn packs_in(vocabulary: &dyn Vocabulary, range: &VersionRange, narrower: Option<&VersionRange>) -> Vec<usize> {
    vocabulary
        .versions()
        .into_iter()
        .enumerate()
        .filter(|(_, version)| range.contains(*version) && narrower.is_none_or(|range| range.contains(*version)))
        .map(|(pack, _)| pack)
        .collect()
}

/// The first place of `text` within `span`, or all of it.
fn within(span: &Span, text: &str) -> Span {
    let inside = span.text();
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let found = inside
        .match_indices(text)
        .find(|(at, _)| !inside[..*at].ends_with(is_word) && !inside[at + text.len()..].starts_with(is_word));
    match found {
        Some((at, _)) => Span::new(&span.source, span.start + at, span.start + at + text.len()),
        None => span.clone(),
    }
}

impl<'a> Linter<'a> {
    fn no_version(&mut self, at: &Span, label: &str) {
        let known: Vec<String> = self.vocabulary.versions().iter().map(ToString::to_string).collect();
        self.problems.add(
            Diagnostic::new("no-version", at.clone(), "no protocol version is meant", label)
                .hint(format!("known versions: {}", known.join(", "))),
        );
    }

    fn header(&mut self, spec: &VersionRange, needs: &[Need], places: &HeaderPlaces) {
        if self.packs.is_empty() {
            let at = places.spec.as_ref().unwrap_or(&places.start).clone();
            self.no_version(&at, "no known version lies in this range");
            return;
        }
        self.claims_no_more(spec, places);
        for (need, at) in needs.iter().zip(&places.needs) {
            self.need(need, at);
        }
    }

    /// A major version without a pack cannot have been looked at: nothing of it is checked here, and nothing is proven.
    fn claims_no_more(&mut self, spec: &VersionRange, places: &HeaderPlaces) {
        let newest = self
            .vocabulary
            .versions()
            .into_iter()
            .map(|version| version.major)
            .max();
        let Some(next) = newest.map(|major| major + 1) else {
            return;
        };
        let unknown = Version {
            major: next,
            minor: 0,
            patch: None,
        };
        // A state claims nothing by itself; the test that uses it does.
        let Some(at) = &places.spec else { return };
        if spec.contains(unknown) {
            self.problems.add(
                Diagnostic::new(
                    "version-unknown-yet",
                    at.clone(),
                    "this claims versions that are not known yet",
                    format!("there is no pack for {next}.0"),
                )
                .hint(format!("end the range with `<{next}`")),
            );
        }
    }

    fn need(&mut self, need: &Need, at: &Span) {
        let vocabulary = self.vocabulary;
        match need {
            Need::Action { name, .. } | Need::NoAction(name) => {
                if !self.packs.iter().any(|pack| vocabulary.has_action(*pack, name)) {
                    let names: BTreeSet<String> = self
                        .packs
                        .iter()
                        .filter_map(|pack| Some(vocabulary.word(*pack, "action")?.as_object()?.clone()))
                        .flat_map(|actions| actions.into_iter().map(|(name, _)| name))
                        .collect();
                    let names: Vec<&str> = names.iter().map(String::as_str).collect();
                    // A vehicle may have actions of its own, which its factsheet lists; what looks like a slip is one.
                    if closest(name, names.iter().copied()).is_some() {
                        self.problems.unknown("unknown-action", at, "action", name, names);
                    }
                }
            }
            Need::Hook(name) => {
                self.hook(name, at);
            }
            Need::Optional(path) | Need::NoOptional(path) | Need::NotRequired(path) => {
                let names: Vec<&str> = path.split('.').collect();
                if let Some((topic, below)) = names.split_first() {
                    self.exists_somewhere(topic, below, path, at);
                }
            }
            Need::Limit(path) => {
                // Members of `maxArrayLens` and the like have dots in their names.
                let mut names = vec!["protocolLimits"];
                names.extend(path.splitn(2, '.'));
                self.exists_somewhere("factsheet", &names, path, at);
            }
            Need::Profile(name) => {
                let samples = || {
                    SAMPLE_ACTIONS
                        .iter()
                        .map(|sample| sample.name)
                        .chain(FOUND.iter().copied())
                };
                let known = || STATEMENTS.iter().map(|statement| statement.name).chain(samples());
                if !known().any(|other| other == name) {
                    self.problems
                        .unknown("unknown-statement", at, "statement of a profile", name, known());
                }
            }
            Need::Zone(Some(name)) | Need::NoZone(name) => {
                let words = self.packs.iter().filter_map(|pack| vocabulary.word(*pack, "zoneType"));
                let words = words.filter_map(|words| Some(words.as_object()?.values().cloned().collect::<Vec<_>>()));
                let names: BTreeSet<String> = words
                    .flatten()
                    .filter_map(|name| name.as_str().map(str::to_owned))
                    .collect();
                if !names.contains(name) {
                    let known = names.iter().map(String::as_str);
                    self.problems.unknown("unknown-zone", at, "type of zones", name, known);
                }
            }
            Need::Zone(None) | Need::Tap | Need::MapServer | Need::SecuredFiles => {}
        }
    }

    fn exists_somewhere(&mut self, topic: &str, path: &[&str], written: &str, at: &Span) {
        let vocabulary = self.vocabulary;
        if !self
            .packs
            .iter()
            .any(|pack| vocabulary.shape(*pack, topic, path).is_some())
        {
            let mut deepest = path;
            while let Some((_, parent)) = deepest.split_last() {
                deepest = parent;
                if self
                    .packs
                    .iter()
                    .any(|pack| vocabulary.shape(*pack, topic, parent).is_some())
                {
                    break;
                }
            }
            let members: BTreeSet<String> = self
                .packs
                .iter()
                .flat_map(|pack| vocabulary.members(*pack, topic, deepest))
                .collect();
            let name = path.get(deepest.len()).copied().unwrap_or(written);
            self.problems.add(
                Diagnostic::new(
                    "unknown-path",
                    at.clone(),
                    format!("`{}` is not in the schema", super::fields::short(written)),
                    "no claimed version has it",
                )
                .hint(did_you_mean(name, members.iter().map(String::as_str))),
            );
        }
    }

    fn hook(&mut self, name: &str, at: &Span) -> Option<&'a HookInfo> {
        let role = self.role?;
        let hooks = self.vocabulary.hooks();
        let found = hooks.find(name, role);
        if found.is_none() {
            let names: Vec<&str> = hooks.of(role).map(|hook| hook.name.as_str()).collect();
            self.problems.unknown("unknown-hook", at, "hook", name, names);
        }
        found
    }

    fn operator(&mut self, operator: &Operator, at: &Span) {
        let Some(hook) = self.hook(&operator.hook, at) else {
            return;
        };
        for (name, term) in &operator.with {
            let Some(parameter) = hook.parameter(name) else {
                let known = hook.parameters.iter().map(|parameter| parameter.name.as_str());
                self.problems
                    .unknown("unknown-argument", at, "parameter of the hook", name, known);
                continue;
            };
            let mut ids = parameter.values.iter().map(|value| value.id.as_str()).peekable();
            if let TermKind::Literal(Value::String(given)) = &term.kind
                && ids.peek().is_some()
                && !ids.clone().any(|id| id == given)
            {
                let what = format!("value of `{name}` of the hook");
                self.problems
                    .unknown("unknown-hook-value", &term.span, &what, given, ids);
            }
        }
    }

    /// Checks what a requirement of a monitor is about.
    fn about(&mut self, about: &About, monitor: &Monitor, scope: &Scope<'_>, packs: &[usize]) {
        let Binding { requirement, span } = &about.requirement;
        if !monitor.checks.iter().any(|binding| binding.requirement == *requirement) {
            let title = format!("the monitor does not decide `{requirement}`");
            self.problems.at("about-undecided", span, title, "not under `checks:`");
            return;
        }
        let having = self.requirement(requirement, span, packs);
        if self.observed_topic(&about.topic, packs, span) {
            about
                .pattern
                .visit_terms(&mut |term| scope.check(term, packs, self.problems));
            self.pattern(&about.pattern, &about.topic, packs, Some(&having));
        }
    }

    /// Checks a selection and its requirements.
    fn selection(&mut self, selection: &Selection, topic: &str, bindings: &[Binding], packs: &[usize]) {
        let required = self.requirements(bindings, packs);
        if let Some(pattern) = &selection.pattern {
            self.pattern(pattern, topic, packs, required.as_deref());
        }
        if let Some(check) = &selection.check {
            // Beside a picture the check may be about something else than the requirement.
            let ids: Vec<&RequirementId> = match selection.pattern {
                None => bindings.iter().map(|binding| &binding.requirement).collect(),
                Some(_) => Vec::new(),
            };
            self.check_use(check, &ids, packs);
        }
    }

    fn assertions(&mut self, assertions: &[Assertion], topic: &str, packs: &[usize]) {
        for assertion in assertions {
            let having = self.requirement(&assertion.requirement, &assertion.span, packs);
            if let Some(pattern) = &assertion.selection.pattern {
                self.pattern(pattern, topic, packs, Some(&having));
            }
            if let Some(check) = &assertion.selection.check {
                self.check_use(check, &[&assertion.requirement], packs);
            }
        }
    }

    /// Holds a pattern against the schemas: all of `required`, or one of `packs` where nothing is required.
    fn pattern(&mut self, pattern: &Pattern, topic: &str, packs: &[usize], required: Option<&[usize]>) {
        let vocabulary = self.vocabulary;
        self.in_packs(packs, required, |pack| {
            let topic = Topic {
                vocabulary,
                pack,
                name: topic,
            };
            topic.check(pattern)
        });
    }

    /// Notes what `check` finds in every required pack, or, without any, what it finds when all packs object.
    fn in_packs(&mut self, packs: &[usize], required: Option<&[usize]>, check: impl Fn(usize) -> Vec<Diagnostic>) {
        let objections = required.unwrap_or(packs).iter().map(|pack| check(*pack));
        let objection =
            match required {
                Some(_) => objections.into_iter().find(|found| !found.is_empty()),
                None => objections.into_iter().try_fold(Vec::new(), |first, found| {
                    match (found.is_empty(), first.is_empty()) {
                        (true, _) => None,
                        (false, true) => Some(found),
                        (false, false) => Some(first),
                    }
                }),
            };
        for diagnostic in objection.into_iter().flatten() {
            self.problems.add(diagnostic);
        }
    }

    /// A topic on which something is awaited from the device.
    fn observed_topic(&mut self, name: &str, packs: &[usize], at: &Span) -> bool {
        if harness_topics::has(name) {
            return true;
        }
        let Some(publisher) = self.topic(name, packs, at, harness_topics::topics().collect()) else {
            return false;
        };
        if let Some(role) = self.role
            && publisher != role
        {
            self.problems.at(
                "wrong-direction",
                at,
                format!("`{name}` never comes from the {role}"),
                format!("the {publisher} publishes it"),
            );
            return false;
        }
        true
    }

    /// The publisher of a protocol topic.
    fn topic(&mut self, name: &str, packs: &[usize], at: &Span, others: Vec<&str>) -> Option<Role> {
        let topics: Vec<(String, Role)> = packs.iter().flat_map(|pack| self.vocabulary.topics(*pack)).collect();
        if let Some((_, publisher)) = topics.iter().find(|(topic, _)| topic == name) {
            return Some(*publisher);
        }
        let mut names: Vec<&str> = topics.iter().map(|(topic, _)| topic.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        names.extend(others);
        self.problems.unknown("unknown-topic", at, "topic", name, names);
        None
    }

    fn moves(&mut self, test: &Test, places: &HeaderPlaces) {
        if test.device != Role::Agv {
            return;
        }
        let steps = || test.sections().into_iter().flat_map(|(_, steps)| steps);
        let sends = || {
            steps().filter_map(|step| match &*step.verb {
                Verb::Send(send) => Some((step, send)),
                _ => None,
            })
        };
        // `far` is never driven to by a good vehicle; a bad one may try.
        let leaves = |base: &[String]| base.len() > 1 || base.iter().any(|name| name == "far" || is_station(name));
        let driving = sends().find(|(_, send)| send.route.as_ref().is_some_and(|route| leaves(&route.base)));
        if !test.moves
            && let Some((step, send)) = driving
        {
            let at = send.route.as_ref().map_or(&step.span, |route| &route.span);
            self.problems.add(
                Diagnostic::new(
                    "moves-unsaid",
                    at.clone(),
                    "a test that drives has to say so",
                    "a base of more than one node",
                )
                .hint("write `moves: true` at the top of the test"),
            );
        }
        // A message made by hand, or a person, can move the vehicle without a route.
        let by_hand = sends().any(|(_, send)| send.route.is_none() && send.topic == "order")
            || steps().any(|step| matches!(*step.verb, Verb::Operator(_)));
        if test.moves && driving.is_none() && !by_hand {
            self.problems.at(
                "moves-nowhere",
                places.moves.as_ref().unwrap_or(&places.start),
                "nothing in this test makes the vehicle drive",
                "no route has a base of more than one node",
            );
        }
    }
}
