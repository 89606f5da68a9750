//! Variables: which names there are at a step, and what a use of one of them needs.

use std::collections::BTreeMap;

use super::names::{TIMES, of_profile};
use super::vocabulary::Vocabulary;
use crate::fields::Problems;
use crate::grammar::is_course_name;
use crate::model::{Step, Verb, later};
use tck_base::diagnostic::{Diagnostic, Span, did_you_mean};
use tck_base::pattern::{Term, TermKind};
use tck_course::is_station;

/// Where names of a test come from.
#[derive(Clone, PartialEq, Eq)]
enum Origin {
    /// `save`.
    Saved,
    /// `as`, with the actionType as written.
    Action(String),
}

/// The names that have a value at some point of a test.
pub(super) struct Scope<'a> {
    vocabulary: &'a dyn Vocabulary,
    /// Whether course, run, serve and saved names exist: not in a monitor.
    in_test: bool,
    names: BTreeMap<String, Origin>,
    served: Vec<String>,
    /// Those of them that have no hash.
    unhashed: Vec<String>,
    /// Names that some step of the test defines, to tell "too early" from "never".
    later: Vec<String>,
    /// Whether every step could be read; otherwise a name may come from one that could not.
    pub(super) complete: bool,
}

impl<'a> Scope<'a> {
    /// The scope at the start of a test with these steps.
    pub(super) fn of_test<'s>(
        vocabulary: &'a dyn Vocabulary,
        steps: impl Iterator<Item = &'s Step>,
        complete: bool,
    ) -> Self {
        let mut later = Vec::new();
        for step in steps {
            later.extend(definitions(step).into_iter().map(|(name, _, _)| name));
            if let Verb::Serve(serve) = &*step.verb {
                later.push(format!("serve.{}", serve.name));
            }
        }
        Self {
            vocabulary,
            in_test: true,
            names: BTreeMap::new(),
            served: Vec::new(),
            unhashed: Vec::new(),
            later,
            complete,
        }
    }

    /// The scope of a monitor.
    pub(super) fn of_monitor(vocabulary: &'a dyn Vocabulary) -> Self {
        Self {
            in_test: false,
            ..Self::of_test(vocabulary, std::iter::empty(), true)
        }
    }

    /// The names of actions that have been sent.
    pub(super) fn actions(&self) -> Vec<&str> {
        self.names
            .iter()
            .filter(|(_, origin)| matches!(origin, Origin::Action(_)))
            .map(|(name, _)| name.as_str())
            .collect()
    }

    /// Whether some step defines this name.
    pub(super) fn comes_later(&self, name: &str) -> bool {
        self.later.iter().any(|later| later == name)
    }

    /// Takes over the names a stimulus defines; they are known to the stimulus itself.
    pub(super) fn enter(&mut self, step: &Step, problems: &mut Problems) {
        if let Verb::Serve(serve) = &*step.verb
            && !self.served.contains(&serve.name)
        {
            self.served.push(serve.name.clone());
            if serve.certificate.is_some() {
                self.unhashed.push(serve.name.clone());
            }
        }
        if matches!(*step.verb, Verb::Send(_)) {
            self.define(step, problems);
        }
    }

    /// Takes over the names a step saves; they are known to later steps.
    pub(super) fn leave(&mut self, step: &Step, problems: &mut Problems) {
        if !matches!(*step.verb, Verb::Send(_)) {
            self.define(step, problems);
        }
    }

    fn define(&mut self, step: &Step, problems: &mut Problems) {
        for (name, origin, span) in definitions(step) {
            match (self.names.get(&name), &origin) {
                // An order update repeats the actions of the order.
                (Some(before), now) if before == now => {}
                (Some(_), _) => problems.at(
                    "name-taken",
                    &span,
                    format!("`{name}` already means something else"),
                    "choose another name",
                ),
                (None, _) => {}
            }
            self.names.entry(name).or_insert(origin);
        }
    }

    /// Notes every unknown variable of a term. `packs` are those in which it is used.
    pub(super) fn check(&self, term: &Term, packs: &[usize], problems: &mut Problems) {
        term.visit_variables(&mut |name, span| {
            if let Some(diagnostic) = self.mistake(name, span, packs) {
                problems.add(diagnostic);
            }
        });
    }

    fn mistake(&self, name: &str, span: &Span, packs: &[usize]) -> Option<Diagnostic> {
        let (root, rest) = name.split_once('.').unwrap_or((name, ""));
        let root_name = root.split('[').next().unwrap_or(root);
        let unknown = |hint: String| {
            Some(
                Diagnostic::new(
                    "unknown-variable",
                    span.clone(),
                    format!("unknown variable `${{{name}}}`"),
                    "no such name",
                )
                .hint(hint),
            )
        };
        let only_in_tests = |known: bool, hint: String| match (self.in_test, known) {
            (true, true) => None,
            (true, false) => unknown(hint),
            (false, _) => unknown("a monitor knows `time.`, `device.` and `vda.`".to_owned()),
        };
        let times = TIMES.map(|(name, _)| name);
        match root {
            "time" if times.contains(&rest) => None,
            "time" => unknown(did_you_mean(rest, times)),
            "device" => self.device(rest, packs, unknown),
            "vda" => self.word(name, rest, span, packs),
            "course" => only_in_tests(
                is_course_use(rest),
                "`${course.a}` is a node, `${course.a-b}` an edge, `${course.a.x}` a value of a node".to_owned(),
            ),
            // A test may have an action of that name.
            "vehicle" | "second" | "each" if self.names.contains_key(root) || self.comes_later(root) => {
                self.defined(name, root, rest, span, unknown)
            }
            "vehicle" | "second" if ["manufacturer", "serialNumber"].contains(&rest) => None,
            "vehicle" | "second" => unknown(did_you_mean(rest, ["manufacturer", "serialNumber"])),
            "each" => only_in_tests(
                ["manufacturer", "serialNumber", "next"].contains(&rest),
                "`${each.serialNumber}`, `${each.manufacturer}` and `${each.next}` go with `each: vehicle`".to_owned(),
            ),
            "run" => only_in_tests(!rest.is_empty(), "write such as `${run.order}`".to_owned()),
            "now" if later(name).is_some() => only_in_tests(true, String::new()),
            "now" if !self.names.contains_key(root) => {
                unknown("`${now.in-2s}` is two seconds after the message is made".to_owned())
            }
            "serve" => self.served(name, rest, span),
            // Filled in, or noted, before the steps were read.
            "case" | "with" if self.in_test => None,
            _ if !self.in_test => only_in_tests(false, String::new()),
            _ => self.defined(name, root_name, rest, span, unknown),
        }
    }

    /// A name that a step of the test defines.
    fn defined(
        &self,
        name: &str,
        root: &str,
        rest: &str,
        span: &Span,
        unknown: impl Fn(String) -> Option<Diagnostic>,
    ) -> Option<Diagnostic> {
        match self.names.get(root) {
            Some(Origin::Saved) => None,
            Some(Origin::Action(_)) if rest == "id" => None,
            Some(Origin::Action(_)) => unknown(format!("`${{{root}.id}}` is its actionId")),
            None => self.undefined(name, root, span),
        }
    }

    fn undefined(&self, name: &str, root: &str, span: &Span) -> Option<Diagnostic> {
        if self.comes_later(root) {
            return Some(too_early(name, span));
        }
        if !self.complete {
            return None;
        }
        let known: Vec<&str> = self
            .names
            .keys()
            .map(String::as_str)
            .chain([
                "time", "device", "course", "run", "vda", "serve", "vehicle", "second", "each",
            ])
            .collect();
        Some(
            Diagnostic::new(
                "unknown-variable",
                span.clone(),
                format!("unknown variable `${{{name}}}`"),
                "no step gives it a value",
            )
            .hint(did_you_mean(root, known)),
        )
    }

    fn served(&self, name: &str, rest: &str, span: &Span) -> Option<Diagnostic> {
        let (offer, member) = rest.split_once('.').unwrap_or((rest, ""));
        if self.served.iter().any(|served| served == offer) {
            let hashed = !self.unhashed.iter().any(|unhashed| unhashed == offer);
            if ["", "url"].contains(&member) || (member == "sha256" && hashed) {
                return None;
            }
        } else if self.comes_later(&format!("serve.{offer}")) {
            return Some(too_early(name, span));
        } else if !self.complete {
            return None;
        }
        Some(
            Diagnostic::new(
                "unknown-variable",
                span.clone(),
                format!("unknown variable `${{{name}}}`"),
                "nothing of this name is served",
            )
            .hint("`- serve: NAME` gives `${serve.NAME.url}` and `${serve.NAME.sha256}`"),
        )
    }

    fn device(
        &self,
        rest: &str,
        packs: &[usize],
        unknown: impl Fn(String) -> Option<Diagnostic>,
    ) -> Option<Diagnostic> {
        let (first, below) = rest.split_once('.').unwrap_or((rest, ""));
        match first {
            "manufacturer" | "serialNumber" if below.is_empty() => None,
            "factsheet" => {
                let path: Vec<&str> = below
                    .split(['.', '[', ']'])
                    .filter(|part| !part.is_empty() && !part.bytes().all(|byte| byte.is_ascii_digit()))
                    .collect();
                let known = packs
                    .iter()
                    .any(|pack| self.vocabulary.shape(*pack, "factsheet", &path).is_some());
                if known {
                    return None;
                }
                let parent = path.split_last().map_or(&[][..], |(_, parent)| parent);
                let members: Vec<String> = packs
                    .iter()
                    .flat_map(|pack| self.vocabulary.members(*pack, "factsheet", parent))
                    .collect();
                unknown(did_you_mean(
                    path.last().copied().unwrap_or_default(),
                    members.iter().map(String::as_str),
                ))
            }
            // What a profile tells of a device beyond its factsheet; a test that uses it `needs: [profile …]`.
            _ => {
                let names = of_profile();
                // A parameter of an action is known to the profile only.
                let parameter = |name: &String| name.ends_with(".parameters") && rest.starts_with(&format!("{name}."));
                if names.iter().any(|name| name == rest || parameter(name)) {
                    return None;
                }
                let others = ["manufacturer", "serialNumber", "factsheet"].into_iter();
                unknown(did_you_mean(rest, others.chain(names.iter().map(String::as_str))))
            }
        }
    }

    fn word(&self, name: &str, path: &str, span: &Span, packs: &[usize]) -> Option<Diagnostic> {
        let pack = packs
            .iter()
            .find(|pack| path.is_empty() || self.vocabulary.word(**pack, path).is_none())?;
        let version = self
            .vocabulary
            .versions()
            .get(*pack)
            .map(ToString::to_string)
            .unwrap_or_default();
        let (parent, last) = path.rsplit_once('.').unwrap_or(("", path));
        let siblings: Vec<String> = match self.vocabulary.word(*pack, parent) {
            Some(serde_json::Value::Object(members)) => members.keys().cloned().collect(),
            _ => Vec::new(),
        };
        let elsewhere = self
            .vocabulary
            .versions()
            .into_iter()
            .enumerate()
            .find(|(pack, _)| self.vocabulary.word(*pack, path).is_some());
        Some(
            Diagnostic::new(
                "unknown-variable",
                span.clone(),
                format!("unknown variable `${{{name}}}`"),
                format!("not in the vocabulary of {version}"),
            )
            .hint(match elsewhere {
                Some((_, version)) if !path.is_empty() => {
                    format!("{version} has it: narrow `spec:`, of the test or of this step")
                }
                _ => did_you_mean(last, siblings.iter().map(String::as_str)),
            }),
        )
    }
}

fn too_early(name: &str, span: &Span) -> Diagnostic {
    Diagnostic::new(
        "used-too-early",
        span.clone(),
        format!("`${{{name}}}` is used before it has a value"),
        "a later step gives it one",
    )
}

fn is_course_use(rest: &str) -> bool {
    let name = rest.split(['.', '[']).next().unwrap_or(rest);
    match name.split_once('-') {
        Some((from, to)) => [from, to].iter().all(|name| is_course_name(name) && !is_station(name)),
        None => is_course_name(name),
    }
}

/// The names a step defines, what they mean, and where.
fn definitions(step: &Step) -> Vec<(String, Origin, Span)> {
    match &*step.verb {
        Verb::Send(send) => send
            .route
            .iter()
            .flat_map(|route| route.actions.iter().flat_map(|(_, actions)| actions))
            .chain(&send.actions)
            .filter_map(|action| {
                let kind = match &action.action.kind {
                    TermKind::Literal(value) => value.to_string(),
                    other => format!("{other:?}"),
                };
                Some((action.name.clone()?, Origin::Action(kind), action.span.clone()))
            })
            .collect(),
        Verb::Expect(expect) => saved(&expect.save, step),
        Verb::Action(action) => saved(&action.save, step),
        _ => Vec::new(),
    }
}

fn saved(save: &[(String, crate::model::Path)], step: &Step) -> Vec<(String, Origin, Span)> {
    save.iter()
        .map(|(name, _)| (name.clone(), Origin::Saved, super::within(&step.span, name)))
        .collect()
}
