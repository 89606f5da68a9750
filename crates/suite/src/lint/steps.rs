//! Rules about single steps.

use super::paths::Topic;
use super::scope::Scope;
use super::{Linter, within};
use crate::model::{Binding, Extent, Patch, Path, Section, Send, Step, VehicleStep, Verb, Walk, Which};
use tck_base::diagnostic::{Diagnostic, Span};
use tck_base::pattern::{Term, TermKind};
use tck_journal::event::LinkFault;
use tck_pack::Role;
use tck_profile::{VEHICLE_WORDS, find_vehicle_word};

/// Where the first requirement of a clause is written.
fn first_bound(bindings: &[Binding]) -> Option<&Span> {
    bindings.first().map(|binding| &binding.span)
}

impl Linter<'_> {
    pub(super) fn step(&mut self, step: &Step, section: Section, packs: &[usize], scope: &Scope<'_>) {
        if section != Section::Steps {
            self.must_not_decide(step, section);
        }
        self.can_be_broken(step, packs);
        let at = &step.verb_span;
        match &*step.verb {
            Verb::Send(send) => self.send(send, packs, at),
            Verb::Expect(expect) => {
                let judged = expect.assert.iter().chain(&expect.prefer).map(|one| &one.span);
                let bound = first_bound(&expect.checks).or_else(|| judged.into_iter().next());
                if self.whose(expect.of, &expect.topic, step) && self.watched_topic(&expect.topic, packs, at, bound) {
                    self.selection(&expect.selection, &expect.topic, &expect.checks, packs);
                    self.assertions(&expect.assert, &expect.topic, packs);
                    self.assertions(&expect.prefer, &expect.topic, packs);
                    self.saved(&expect.save, &expect.topic, packs, &step.span);
                }
            }
            Verb::Never(never) => {
                let bound = first_bound(&never.checks);
                if self.whose(never.of, &never.topic, step) && self.watched_topic(&never.topic, packs, at, bound) {
                    self.selection(&never.selection, &never.topic, &never.checks, packs);
                }
            }
            Verb::Always(always) => {
                let bound = first_bound(&always.checks);
                if self.whose(always.of, &always.topic, step) && self.watched_topic(&always.topic, packs, at, bound) {
                    self.selection(&always.selection, &always.topic, &always.checks, packs);
                }
                if let Extent::Until(until) = &always.extent
                    && self.watched_topic(&until.topic, packs, &until.at, first_bound(&until.checks))
                {
                    self.selection(&until.selection, &until.topic, &until.checks, packs);
                }
            }
            Verb::Action(action) => {
                if !scope.actions().contains(&action.name.as_str()) {
                    if scope.comes_later(&action.name) {
                        self.problems.at(
                            "used-too-early",
                            at,
                            format!("the action `{}` has not been sent yet", action.name),
                            "a later step sends it",
                        );
                    } else if scope.complete {
                        self.problems
                            .unknown("unknown-action-name", at, "action", &action.name, scope.actions());
                    }
                }
                self.requirements(&action.checks, packs);
                if self.role == Some(Role::MasterControl)
                    && let Some(at) = first_bound(&action.checks)
                {
                    self.own_vehicle("state", at);
                }
                self.walk(&action.through, packs, &step.span);
                if let Some(tolerated) = &action.tolerated {
                    self.walk(tolerated, packs, &step.span);
                }
                self.saved(&action.save, "state", packs, &step.span);
            }
            Verb::Retained(retained) => {
                if let Some(publisher) = self.topic(&retained.topic, packs, at, Vec::new()) {
                    if Some(publisher) == self.role {
                        self.selection(&retained.selection, &retained.topic, &retained.checks, packs);
                        self.assertions(&retained.assert, &retained.topic, packs);
                    } else {
                        self.observed_topic(&retained.topic, packs, at);
                    }
                }
            }
            Verb::Link(link) => {
                if let LinkFault::Drop { topic, .. } | LinkFault::Duplicate { topic, .. } = &link.fault
                    && let Some(topic) = topic
                {
                    self.topic(topic, packs, &within(&step.span, topic), Vec::new());
                }
            }
            Verb::Operator(operator) => self.operator(operator, at),
            Verb::Vehicle(vehicle) => self.vehicle(vehicle, step),
            Verb::Serve(_) => {}
        }
    }

    fn vehicle(&mut self, vehicle: &VehicleStep, step: &Step) {
        let at = &step.verb_span;
        if self.role != Some(Role::MasterControl) {
            self.problems.at(
                "misplaced-verb",
                at,
                "`vehicle` is about the mock vehicle that a master control is tested with",
                "here the vehicle is the device under test",
            );
            return;
        }
        let Some(word) = find_vehicle_word(&vehicle.what) else {
            let names: Vec<&str> = VEHICLE_WORDS.iter().map(|word| word.name).collect();
            self.problems
                .unknown("unknown-vehicle-word", at, "word for a vehicle", &vehicle.what, names);
            return;
        };
        for (parameter, _) in &vehicle.with {
            if !word.parameters.contains(&parameter.as_str()) {
                let at = within(&step.span, parameter);
                let known = word.parameters.iter().copied();
                self.problems
                    .unknown("unknown-argument", &at, "parameter of the word", parameter, known);
            }
        }
    }

    /// Whether there can be such a vehicle here.
    fn whose(&mut self, of: Which, topic: &str, step: &Step) -> bool {
        let (title, label) = match of {
            Which::Second if self.role != Some(Role::MasterControl) => (
                "`of` names one of the mock vehicles that a master control is tested with",
                "here the vehicle is the device under test",
            ),
            Which::Second if super::harness_topics::has(topic) => (
                "`of` goes with the topics of a vehicle",
                "this belongs to the master control",
            ),
            Which::First | Which::Second => return true,
        };
        self.problems
            .at("misplaced-key", &within(&step.span, of.word()), title, label);
        false
    }

    /// A topic on which something is awaited: from the device, or, to keep in step, from the mock vehicle.
    fn watched_topic(&mut self, name: &str, packs: &[usize], at: &Span, bound: Option<&Span>) -> bool {
        let own = self.role == Some(Role::MasterControl)
            && packs
                .iter()
                .flat_map(|pack| self.vocabulary.topics(*pack))
                .any(|(topic, publisher)| topic == name && publisher == Role::Agv);
        if !own {
            return self.observed_topic(name, packs, at);
        }
        if let Some(at) = bound {
            self.own_vehicle(name, at);
        }
        bound.is_none()
    }

    fn own_vehicle(&mut self, topic: &str, at: &Span) {
        self.problems.add(
            Diagnostic::new(
                "own-vehicle",
                at.clone(),
                format!("`{topic}` comes from the harness's own vehicle and decides nothing"),
                "bound to a requirement all the same",
            )
            .hint("wait for it without `checks:` and `assert:`, and judge what the master control sends"),
        );
    }

    fn must_not_decide(&mut self, step: &Step, section: Section) {
        if step.owes {
            return;
        }
        let word = if section == Section::Given { "given" } else { "finally" };
        for (id, _) in step.clauses() {
            self.problems.at(
                "must-not-decide",
                &within(&step.span, id.as_str()),
                format!("`{word}` decides nothing"),
                "bound to a requirement all the same",
            );
        }
    }

    fn send(&mut self, send: &Send, packs: &[usize], at: &Span) {
        self.topic(&send.topic, packs, at, Vec::new());
        if let Some(payload) = &send.payload {
            self.written(payload, &send.topic, &mut Vec::new(), packs);
        }
        match &send.patch {
            Some(Patch::Merge(term)) => self.written(term, &send.topic, &mut Vec::new(), packs),
            Some(Patch::Operations(term)) => self.patched(term, &send.topic, packs),
            None => {}
        }
    }

    /// A patch is about members that a version has. One that only keeps the message in one piece, beside others, is left out where
    /// there is nothing to be kept.
    fn patched(&mut self, term: &Term, topic: &str, packs: &[usize]) {
        let TermKind::List(operations) = &term.kind else { return };
        let said = |operation: &Term, key: &str| match &operation.kind {
            TermKind::Map(members) => members.iter().find_map(|(name, value)| match &value.kind {
                TermKind::Literal(value) if name == key => value.as_str().map(str::to_owned),
                _ => None,
            }),
            _ => None,
        };
        for pack in packs {
            let is_lost = |operation: &&Term| {
                let path = said(operation, "path").unwrap_or_default();
                let names: Vec<&str> = path
                    .split('/')
                    .skip(1)
                    .filter(|part| part.parse::<u32>().is_err())
                    .collect();
                self.vocabulary.lost(*pack, topic, &names)
            };
            let lost: Vec<&Term> = operations.iter().filter(is_lost).collect();
            let all = lost.len() == operations.len();
            let needed = lost
                .into_iter()
                .find(|one| all || said(one, "op").as_deref() != Some("replace"));
            if let Some(operation) = needed {
                let path = said(operation, "path").unwrap_or_default();
                self.lost(*pack, topic, &[path.as_str()], &operation.span);
                return;
            }
        }
    }

    /// What a payload says of a member that a version does not have any more would be left out without a word.
    fn written<'t>(&mut self, term: &'t Term, topic: &str, path: &mut Vec<&'t str>, packs: &[usize]) {
        match &term.kind {
            TermKind::List(items) => {
                for item in items {
                    self.written(item, topic, path, packs);
                }
            }
            TermKind::Map(members) => {
                for (name, value) in members {
                    path.push(name);
                    match packs.iter().find(|pack| self.vocabulary.lost(**pack, topic, path)) {
                        Some(pack) => self.lost(*pack, topic, path, &value.span),
                        None => self.written(value, topic, path, packs),
                    }
                    path.pop();
                }
            }
            _ => {}
        }
    }

    fn lost(&mut self, pack: usize, topic: &str, path: &[&str], at: &Span) {
        let version = self.vocabulary.versions().get(pack).map(ToString::to_string);
        let title = format!(
            "`{}` of {topic} is not in {}",
            path.join("."),
            version.unwrap_or_default()
        );
        let diagnostic = Diagnostic::new("unknown-path", at.clone(), title, "it would not be sent");
        let hint = "narrow `spec:`, of the test or of this step";
        self.problems.add(diagnostic.hint(hint));
    }

    fn saved(&mut self, save: &[(String, Path)], topic: &str, packs: &[usize], step: &Span) {
        let vocabulary = self.vocabulary;
        for (_, path) in save {
            let at = within(step, &path.text);
            self.in_packs(packs, None, |pack| {
                let topic = Topic {
                    vocabulary,
                    pack,
                    name: topic,
                };
                topic.check_path(&path.text, &at)
            });
        }
    }

    /// Every status of a walk has to be one of the versions the step runs in.
    fn walk(&mut self, walk: &Walk, packs: &[usize], step: &Span) {
        let vocabulary = self.vocabulary;
        for status in walk.stations.iter().flat_map(|station| &station.statuses) {
            let odd = packs.iter().find_map(|pack| {
                let shape = vocabulary.shape(*pack, "state", &["actionStates", "actionStatus"])?;
                shape.literals.clone().filter(|literals| !literals.contains(status))
            });
            if let Some(literals) = odd {
                let names = literals.iter().map(String::as_str);
                self.problems
                    .unknown("unknown-status", &within(step, status), "action status", status, names);
            }
        }
    }
}
