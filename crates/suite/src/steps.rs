//! Reading a list of steps: the verbs that look, and the inlining of states.

use std::borrow::Cow;
use std::sync::Arc;

use super::expand::Fill;
use super::fields::{Fields, Problems, text_of, word_of};
use super::grammar::{time, walk};
use super::model::{
    ActionWalk, Always, Assertion, Binding, CheckUse, Expect, Extent, From, Never, Path, Purpose, Retained, Selection,
    Step, TimeTerm, Until, Verb,
};
use super::source::States;
use super::stimuli::{
    OPERATOR_KEYS, SEND_KEYS, SERVE_KEYS, VEHICLE_KEYS, check_name, link, link_keys, operator, send, serve, vehicle,
    which,
};
use super::terms::{named_terms, pattern};
use tck_base::diagnostic::{Diagnostic, Span, did_you_mean};
use tck_base::pattern::Pattern;
use tck_base::yaml::Node;
use tck_pack::{RequirementId, VersionRange};

/// Every verb, and the keys a step of it takes besides `title` and `spec`.
const VERBS: [(&str, &[&str]); 11] = [
    ("send", SEND_KEYS),
    (
        "expect",
        &[
            "checks", "owes", "prefers", "where", "check", "with", "within", "from", "assert", "prefer", "save", "of",
        ],
    ),
    (
        "never",
        &[
            "checks", "owes", "prefers", "where", "check", "with", "during", "from", "of",
        ],
    ),
    (
        "always",
        &[
            "checks", "owes", "prefers", "where", "check", "with", "from", "during", "until", "of",
        ],
    ),
    ("action", &["checks", "owes", "through", "tolerated", "within", "save"]),
    ("retained", &["checks", "where", "check", "with", "assert", "within"]),
    ("link", &[]),
    ("serve", SERVE_KEYS),
    ("operator", OPERATOR_KEYS),
    ("vehicle", VEHICLE_KEYS),
    ("use", &["with"]),
];

const FROM: [(&str, From); 6] = [
    ("cursor", From::Here),
    ("mark", From::Mark),
    ("here", From::Here),
    ("now", From::Now),
    ("latest", From::Latest),
    ("test", From::Test),
];

/// Reads a list of steps. `section` is their path, such as `steps` or `given[0]/idle`.
pub(super) struct StepReader<'a> {
    /// The states that `use` can name.
    pub(super) states: &'a States,
    /// The states being inlined at the moment.
    pub(super) inside: Vec<String>,
    /// What the innermost of them that says so is for.
    pub(super) purpose: Option<Purpose>,
    /// Whether the innermost of them stands there as it is in its file, without values of its user.
    pub(super) is_plain: bool,
    pub(super) problems: &'a mut Problems,
}

impl StepReader<'_> {
    /// Every step of a list, in order, states inlined.
    pub(super) fn steps(&mut self, node: &Node, section: &str, spec: Option<&VersionRange>) -> Vec<Step> {
        let Some(items) = node.list() else {
            self.problems.wrong_type(node, "a list of steps");
            return Vec::new();
        };
        let mut steps = Vec::new();
        for (at, item) in items.iter().enumerate() {
            self.step(item, format!("{section}[{at}]"), spec, &mut steps);
        }
        steps
    }

    fn step(&mut self, node: &Node, path: String, outer: Option<&VersionRange>, steps: &mut Vec<Step>) {
        let Some(fields) = Fields::of(node, self.problems) else {
            return;
        };
        let Some((key, value)) = fields.first() else {
            self.problems
                .at("missing-key", &node.span, "a step without a verb", "says nothing");
            return;
        };
        let word = key.text().unwrap_or_default();
        let Some((_, keys)) = VERBS.iter().find(|(verb, _)| *verb == word) else {
            self.no_verb(&fields, key, word);
            return;
        };
        let keys = if word == "link" {
            link_keys(value.text().unwrap_or_default())
        } else {
            keys
        };
        fields.only(&[&[word, "title", "spec"], keys], self.problems);
        // An empty value has been noted by `get`.
        if fields.get(word, self.problems).is_none() {
            return;
        }
        let verb_span = if key.span.source == value.span.source && value.span.start >= key.span.end {
            Span::new(&key.span.source, key.span.start, value.span.end)
        } else {
            key.span.clone()
        };
        let title = fields.text("title", self.problems).map(str::to_owned);
        let own = fields
            .get("spec", self.problems)
            .and_then(|node| version_range(node, self.problems));
        let spec = both(own, outer);
        if word == "use" {
            self.inline(value, &fields, &path, spec.as_ref(), steps);
            return;
        }
        let Some(verb) = self.shared_verb(node, word, value, &fields, &verb_span) else {
            return;
        };
        let owes = fields.key("owes");
        if let Some(owes) = owes
            && (!path.starts_with("given[") || fields.has("checks"))
        {
            self.problems.add(
                Diagnostic::new(
                    "owes-elsewhere",
                    owes.span.clone(),
                    "only a precondition is owed",
                    "not in `given`, or beside `checks`",
                )
                .hint("what a step of `steps` decides stands under `checks:`"),
            );
        }
        let prefers = fields.key("prefers");
        if let Some(prefers) = prefers
            && (path.starts_with("given[") || fields.has("checks"))
        {
            self.problems.add(
                Diagnostic::new(
                    "prefers-elsewhere",
                    prefers.span.clone(),
                    "a clause is either decided or preferred",
                    "in `given`, or beside `checks`",
                )
                .hint("`prefers:` stands in the place of `checks:` where a ruling asks for a warning only"),
            );
        }
        steps.push(Step {
            path,
            title,
            spec,
            verb,
            purpose: self.purpose,
            owes: owes.is_some(),
            prefers: prefers.is_some(),
            span: node.span.clone(),
            verb_span,
        });
    }

    fn no_verb(&mut self, fields: &Fields<'_>, key: &Node, word: &str) {
        let verbs: Vec<&str> = VERBS.iter().map(|(verb, _)| *verb).collect();
        let later = fields
            .entries()
            .iter()
            .filter_map(|(key, _)| Some((key, key.text()?)))
            // `with` and `action` are keys as well; a step of `send` is no step of `action`.
            .find(|(_, name)| verbs.contains(name));
        match later {
            Some((verb, name)) if word == "title" || VERBS.iter().any(|(_, keys)| keys.contains(&word)) => {
                self.problems.add(
                    Diagnostic::new(
                        "verb-first",
                        verb.span.clone(),
                        "the verb of a step comes first",
                        "too late",
                    )
                    .hint(format!("begin the step with `- {name}:`")),
                );
            }
            _ => self.problems.add(
                Diagnostic::new(
                    "unknown-verb",
                    key.span.clone(),
                    format!("unknown verb `{}`", super::fields::short(word)),
                    "a step begins with its verb",
                )
                .hint(did_you_mean(word, verbs)),
            ),
        }
    }

    fn inline(
        &mut self,
        state: &Node,
        fields: &Fields<'_>,
        path: &str,
        spec: Option<&VersionRange>,
        steps: &mut Vec<Step>,
    ) {
        let Some(name) = text_of(state, self.problems) else {
            return;
        };
        let states = self.states;
        let Some(found) = states.get(name) else {
            // A state whose file is broken has been noted there.
            if !states.is_known(name) {
                self.problems
                    .unknown("unknown-state", &state.span, "state", name, states.names());
            }
            return;
        };
        if self.inside.iter().any(|outer| outer == name) {
            let round = self.inside.join(" -> ");
            self.problems.at(
                "state-cycle",
                &state.span,
                "a state that uses itself",
                format!("{round} -> {name}"),
            );
            return;
        }
        let nothing: &[(Node, Node)] = &[];
        let values = fields.get("with", self.problems).map_or(nothing, |node| {
            node.map().unwrap_or_else(|| {
                self.problems.wrong_type(node, "a mapping");
                nothing
            })
        });
        let mut fill = Fill::new("with", values);
        let filled = fill.apply_to(&found.steps, self.problems);
        for ((key, _), used) in values.iter().zip(&fill.used) {
            if !used {
                let name = key.text().unwrap_or_default();
                self.problems.at(
                    "unused-value",
                    &key.span,
                    format!("`{name}` is not used by the state"),
                    format!("no `${{with.{name}}}` there"),
                );
            }
        }
        let purpose = found.purpose.or(self.purpose);
        if purpose.is_none() && path.starts_with("finally[") {
            self.without_purpose(name, &state.span);
        }
        self.inside.push(name.to_owned());
        let outer = std::mem::replace(&mut self.purpose, purpose);
        let is_plain = matches!(filled, Cow::Borrowed(_));
        let was_plain = std::mem::replace(&mut self.is_plain, is_plain);
        steps.extend(self.steps(&filled, &format!("{path}/{name}"), spec));
        self.is_plain = was_plain;
        self.purpose = outer;
        self.inside.pop();
    }

    fn without_purpose(&mut self, name: &str, span: &Span) {
        let words: Vec<&str> = Purpose::WORDS.iter().map(|(word, _)| *word).collect();
        self.problems.add(
            Diagnostic::new(
                "state-without-purpose",
                span.clone(),
                format!("the state `{name}` does not say what it is for"),
                "in `finally`, that decides when it is passed over",
            )
            .hint(format!("give the state `purpose:`, one of {}", words.join(", "))),
        );
    }

    /// What a step does; of a state that stands there as it is in its file, read once for all tests that use it.
    fn shared_verb(
        &mut self,
        step: &Node,
        word: &str,
        value: &Node,
        fields: &Fields<'_>,
        at: &Span,
    ) -> Option<Arc<Verb>> {
        if let Some(known) = self.is_plain.then(|| self.states.verb(step)).flatten() {
            return Some(known);
        }
        let before = self.problems.len();
        let verb = Arc::new(self.verb(word, value, fields, at)?);
        // A mistake is one of each test that uses the state.
        if self.is_plain && self.problems.len() == before {
            self.states.keep(step, &verb);
        }
        Some(verb)
    }

    fn verb(&mut self, word: &str, value: &Node, fields: &Fields<'_>, at: &Span) -> Option<Verb> {
        let problems = &mut *self.problems;
        let text = text_of(value, problems)?;
        Some(match word {
            "send" => Verb::Send(Box::new(send(text, fields, at, problems))),
            "expect" => Verb::Expect(Box::new(Expect {
                topic: text.to_owned(),
                of: which(fields, problems),
                checks: checks(fields, problems),
                selection: selection(fields, problems),
                within: needed_time(fields, "within", at, problems)?,
                from: from(fields, problems),
                assert: assertions(fields, "assert", problems),
                prefer: assertions(fields, "prefer", problems),
                save: save(fields, problems),
            })),
            "never" => {
                if !fields.has("where") && !fields.has("check") {
                    problems.add(
                        Diagnostic::new(
                            "never-anything",
                            at.clone(),
                            "this forbids every message",
                            "needs `where:` or `check:`",
                        )
                        .hint("write `where: {}` if that is meant"),
                    );
                }
                Verb::Never(Box::new(Never {
                    topic: text.to_owned(),
                    of: which(fields, problems),
                    checks: checks(fields, problems),
                    selection: selection(fields, problems),
                    during: needed_time(fields, "during", at, problems)?,
                    from: from(fields, problems),
                }))
            }
            "always" => {
                if !fields.has("where") && !fields.has("check") {
                    problems.at(
                        "missing-key",
                        at,
                        "`always` without a picture of what always holds",
                        "needs `where:` or `check:`",
                    );
                }
                let always = Always {
                    topic: text.to_owned(),
                    of: which(fields, problems),
                    checks: checks(fields, problems),
                    selection: selection(fields, problems),
                    from: from(fields, problems),
                    extent: extent(text, fields, at, problems)?,
                };
                Verb::Always(Box::new(always))
            }
            "action" => {
                let through = fields
                    .need("through", at, problems)
                    .and_then(|node| walk(node, problems));
                Verb::Action(Box::new(ActionWalk {
                    name: text.to_owned(),
                    checks: checks(fields, problems),
                    tolerated: fields.get("tolerated", problems).and_then(|node| walk(node, problems)),
                    within: needed_time(fields, "within", at, problems)?,
                    save: save(fields, problems),
                    through: through?,
                }))
            }
            "retained" => Verb::Retained(Box::new(Retained {
                topic: text.to_owned(),
                checks: checks(fields, problems),
                selection: selection(fields, problems),
                within: needed_time(fields, "within", at, problems)?,
                assert: assertions(fields, "assert", problems),
            })),
            "link" => Verb::Link(link(text, fields, at, problems)?),
            "serve" => Verb::Serve(serve(value, fields, problems)?),
            "vehicle" => Verb::Vehicle(vehicle(text, fields, problems)),
            _ => Verb::Operator(operator(text, fields, problems)),
        })
    }
}

fn both(own: Option<VersionRange>, outer: Option<&VersionRange>) -> Option<VersionRange> {
    match (own, outer) {
        (Some(own), Some(outer)) => format!("{outer}, {own}").parse().ok(),
        (own, outer) => own.or_else(|| outer.cloned()),
    }
}

/// A range such as `>=1.0, <3`.
pub(super) fn version_range(node: &Node, problems: &mut Problems) -> Option<VersionRange> {
    match text_of(node, problems)?.parse() {
        Ok(range) => Some(range),
        Err(reason) => {
            problems.at("bad-version-range", &node.span, "not a range of versions", reason);
            None
        }
    }
}

/// The requirements under `checks`, under `owes` of a precondition, or under `prefers`.
pub(super) fn checks(fields: &Fields<'_>, problems: &mut Problems) -> Vec<Binding> {
    let mut bindings: Vec<Binding> = Vec::new();
    let key = ["owes", "prefers"]
        .into_iter()
        .find(|key| fields.has(key))
        .unwrap_or("checks");
    for node in fields.list(key, problems) {
        let Some(text) = text_of(node, problems) else { continue };
        let requirement = RequirementId::from(text);
        if bindings.iter().any(|other| other.requirement == requirement) {
            problems.at(
                "bound-twice",
                &node.span,
                format!("`{text}` is bound twice"),
                "once is enough",
            );
            continue;
        }
        bindings.push(Binding {
            requirement,
            span: node.span.clone(),
        });
    }
    bindings
}

fn selection(fields: &Fields<'_>, problems: &mut Problems) -> Selection {
    Selection {
        pattern: where_of(fields, problems),
        check: check_use(fields, problems),
    }
}

fn where_of(fields: &Fields<'_>, problems: &mut Problems) -> Option<Pattern> {
    pattern(fields.get("where", problems)?, problems)
}

/// `check:` and its `with:`.
pub(super) fn check_use(fields: &Fields<'_>, problems: &mut Problems) -> Option<CheckUse> {
    let Some(node) = fields.get("check", problems) else {
        if let Some(with) = fields.key("with") {
            problems.at(
                "missing-key",
                &with.span,
                "`with` without `check`",
                "there is nothing to hand it to",
            );
        }
        return None;
    };
    Some(CheckUse {
        name: text_of(node, problems)?.to_owned(),
        with: fields
            .get("with", problems)
            .map(|node| named_terms(node, problems))
            .unwrap_or_default(),
        span: node.span.clone(),
    })
}

fn needed_time(fields: &Fields<'_>, key: &str, at: &Span, problems: &mut Problems) -> Option<TimeTerm> {
    fields.need(key, at, problems).and_then(|node| time(node, problems))
}

fn from(fields: &Fields<'_>, problems: &mut Problems) -> From {
    let Some(node) = fields.get("from", problems) else {
        return From::Usual;
    };
    text_of(node, problems)
        .and_then(|text| word_of(text, &node.span, "`from`", "unknown-word", &FROM, problems))
        .unwrap_or_default()
}

fn assertions(fields: &Fields<'_>, key: &str, problems: &mut Problems) -> Vec<Assertion> {
    let Some(node) = fields.get(key, problems) else {
        return Vec::new();
    };
    let Some(entries) = Fields::of(node, problems) else {
        return Vec::new();
    };
    let mut assertions = Vec::new();
    for (name, value) in entries.entries() {
        let Some(text) = name.text() else { continue };
        let is_check = value.map().is_some_and(|members| {
            members.first().is_some_and(|(key, _)| key.text() == Some("check"))
                && members
                    .iter()
                    .all(|(key, _)| matches!(key.text(), Some("check" | "with")))
        });
        let selection = if is_check {
            Fields::of(value, problems).map(|fields| Selection {
                pattern: None,
                check: check_use(&fields, problems),
            })
        } else {
            pattern(value, problems).map(|pattern| Selection {
                pattern: Some(pattern),
                check: None,
            })
        };
        if let Some(selection) = selection {
            assertions.push(Assertion {
                requirement: RequirementId::from(text),
                selection,
                span: name.span.clone(),
            });
        }
    }
    assertions
}

fn save(fields: &Fields<'_>, problems: &mut Problems) -> Vec<(String, Path)> {
    let Some(node) = fields.get("save", problems) else {
        return Vec::new();
    };
    let Some(entries) = Fields::of(node, problems) else {
        return Vec::new();
    };
    let mut saved = Vec::new();
    for (name, path) in entries.entries() {
        let Some(text) = text_of(path, problems) else { continue };
        if check_name(name.text().unwrap_or_default(), &name.span, problems) {
            saved.push((
                name.text().unwrap_or_default().to_owned(),
                Path { text: text.to_owned() },
            ));
        }
    }
    saved
}

fn extent(topic: &str, fields: &Fields<'_>, at: &Span, problems: &mut Problems) -> Option<Extent> {
    match (fields.key("during"), fields.key("until")) {
        (Some(_), None) => needed_time(fields, "during", at, problems).map(Extent::During),
        (None, Some(_)) => {
            let node = fields.get("until", problems)?;
            let inner = Fields::of(node, problems)?;
            inner.only(&[&["topic", "checks", "where", "check", "with", "within"]], problems);
            Some(Extent::Until(Box::new(Until {
                topic: inner.text("topic", problems).unwrap_or(topic).to_owned(),
                of: which(fields, problems),
                checks: checks(&inner, problems),
                selection: selection(&inner, problems),
                within: needed_time(&inner, "within", &node.span, problems)?,
                at: node.span.clone(),
            })))
        }
        (during, _) => {
            let (at, title) = match during {
                Some(key) => (&key.span, "`during` and `until` in one step"),
                None => (at, "`always` without an end"),
            };
            problems.at(
                "always-without-extent",
                at,
                title,
                "needs one of `during:` and `until:`",
            );
            None
        }
    }
}
