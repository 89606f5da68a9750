//! Rules about single steps.

use super::paths::Topic;
use super::scope::Scope;
use super::{Linter, within};
use crate::diagnostic::Span;
use crate::journal::event::LinkFault;
use crate::pack::Role;
use crate::suite::model::{Extent, Path, Section, Send, Step, Verb, Walk};

impl Linter<'_> {
    pub(super) fn step(&mut self, step: &Step, section: Section, packs: &[usize], scope: &Scope<'_>) {
        if section != Section::Steps {
            self.must_not_decide(step, section);
        }
        let at = &step.verb_span;
        match &step.verb {
            Verb::Send(send) => self.send(send, packs, at),
            Verb::Expect(expect) => {
                if self.observed_topic(&expect.topic, packs, at) {
                    self.selection(&expect.selection, &expect.topic, &expect.checks, packs);
                    self.assertions(&expect.assert, &expect.topic, packs);
                    self.assertions(&expect.prefer, &expect.topic, packs);
                    self.saved(&expect.save, &expect.topic, packs, &step.span);
                }
            }
            Verb::Never(never) => {
                if self.observed_topic(&never.topic, packs, at) {
                    self.selection(&never.selection, &never.topic, &never.checks, packs);
                }
            }
            Verb::Always(always) => {
                if self.observed_topic(&always.topic, packs, at) {
                    self.selection(&always.selection, &always.topic, &always.checks, packs);
                }
                if let Extent::Until(until) = &always.extent
                    && self.observed_topic(&until.topic, packs, &until.at)
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
            Verb::Operator(operator) => {
                let parameters: Vec<&str> = operator.with.iter().map(|(name, _)| name.as_str()).collect();
                self.hook(&operator.hook, &parameters, at);
            }
            Verb::Vehicle(_) => {
                if self.role != Some(Role::MasterControl) {
                    self.problems.at(
                        "misplaced-verb",
                        at,
                        "`vehicle` sets the mock vehicle that a master control is tested with",
                        "here the vehicle is the device under test",
                    );
                }
            }
            Verb::Serve(_) => {}
        }
    }

    fn must_not_decide(&mut self, step: &Step, section: Section) {
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
