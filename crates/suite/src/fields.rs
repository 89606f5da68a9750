//! Reading the members of a mapping: each by name and type, every mistake noted, reading goes on.

use tck_base::diagnostic::{Diagnostic, Span, did_you_mean};
use tck_base::yaml::{Kind, Node};

/// The mistakes found so far.
#[derive(Default)]
pub(super) struct Problems {
    found: Vec<Diagnostic>,
}

impl Problems {
    /// Notes a mistake.
    pub(super) fn add(&mut self, diagnostic: Diagnostic) {
        self.found.push(diagnostic);
    }

    /// Notes a mistake at a place.
    pub(super) fn at(&mut self, code: &'static str, span: &Span, title: impl Into<String>, label: impl Into<String>) {
        self.add(Diagnostic::new(code, span.clone(), title, label));
    }

    /// Notes a word that is none of the allowed ones.
    pub(super) fn unknown<'a>(
        &mut self,
        code: &'static str,
        span: &Span,
        what: &str,
        word: &str,
        allowed: impl IntoIterator<Item = &'a str> + Clone,
    ) {
        self.add(
            Diagnostic::new(
                code,
                span.clone(),
                format!("unknown {what} `{}`", short(word)),
                "not known",
            )
            .hint(did_you_mean(word, allowed)),
        );
    }

    /// Notes a value of the wrong type.
    pub(super) fn wrong_type(&mut self, node: &Node, wanted: &str) {
        // A variable that could not be filled in has been noted, and might have had the right type.
        if node
            .text()
            .is_some_and(|text| text.starts_with("${case.") || text.starts_with("${with."))
        {
            return;
        }
        self.at(
            "wrong-type",
            &node.span,
            format!("expected {wanted}, found {}", node.kind_word()),
            format!("this is {}", node.kind_word()),
        );
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.found.len()
    }

    /// All of them, each once, by file and place.
    pub(super) fn into_sorted(self) -> Vec<Diagnostic> {
        let mut sorted: Vec<Diagnostic> = Vec::new();
        for diagnostic in self.found {
            // An inlined state or a row of a table repeats the mistake of the one place, maybe for another version.
            let repeated = sorted.iter().any(|other| {
                other.code == diagnostic.code
                    && other.span == diagnostic.span
                    && (other.span.is_some() || other == &diagnostic)
            });
            if !repeated {
                sorted.push(diagnostic);
            }
        }
        sorted.sort_by(|left, right| place(left).cmp(&place(right)));
        sorted
    }
}

fn place(diagnostic: &Diagnostic) -> Option<(&str, usize)> {
    diagnostic
        .span
        .as_ref()
        .map(|span| (span.source.name.as_str(), span.start))
}

/// At most 60 characters, for a title.
pub(super) fn short(text: &str) -> String {
    if text.chars().nth(60).is_none() {
        text.to_owned()
    } else {
        text.chars().take(59).chain(['…']).collect()
    }
}

/// A mapping whose members are asked for by name.
#[derive(Clone, Copy)]
pub(super) struct Fields<'a> {
    entries: &'a [(Node, Node)],
}

impl<'a> Fields<'a> {
    /// The members of `node`, which has to be a mapping.
    pub(super) fn of(node: &'a Node, problems: &mut Problems) -> Option<Self> {
        let Some(entries) = node.map() else {
            problems.wrong_type(node, "a mapping");
            return None;
        };
        Some(Self { entries })
    }

    /// The first member: key and value.
    pub(super) fn first(&self) -> Option<&'a (Node, Node)> {
        self.entries.first()
    }

    /// Every member.
    pub(super) fn entries(&self) -> &'a [(Node, Node)] {
        self.entries
    }

    /// Notes every member that is none of `allowed`.
    pub(super) fn only(&self, allowed: &[&[&str]], problems: &mut Problems) {
        for (key, _) in self.entries {
            let name = key.text().unwrap_or_default();
            if !allowed.iter().any(|names| names.contains(&name)) {
                problems.unknown("unknown-key", &key.span, "key", name, allowed.concat());
            }
        }
    }

    /// The value under `key`; one that is empty is a mistake.
    pub(super) fn get(&self, key: &str, problems: &mut Problems) -> Option<&'a Node> {
        let (name, node) = self.entries.iter().find(|(name, _)| name.text() == Some(key))?;
        if node.kind == Kind::Null {
            problems.at(
                "missing-value",
                &name.span,
                format!("`{key}` has no value"),
                "write a value, or leave the key out",
            );
            return None;
        }
        Some(node)
    }

    /// Whether the member is written, with or without a value.
    pub(super) fn has(&self, key: &str) -> bool {
        self.entries.iter().any(|(name, _)| name.text() == Some(key))
    }

    /// The key itself.
    pub(super) fn key(&self, key: &str) -> Option<&'a Node> {
        self.entries
            .iter()
            .find(|(name, _)| name.text() == Some(key))
            .map(|(name, _)| name)
    }

    /// The value under `key`, which has to be there. `at` is where its absence is shown.
    pub(super) fn need(&self, key: &str, at: &Span, problems: &mut Problems) -> Option<&'a Node> {
        if !self.has(key) {
            problems.at(
                "missing-key",
                at,
                format!("`{key}` is missing"),
                format!("needs `{key}:`"),
            );
        }
        self.get(key, problems)
    }

    /// A text under `key`.
    pub(super) fn text(&self, key: &str, problems: &mut Problems) -> Option<&'a str> {
        let node = self.get(key, problems)?;
        text_of(node, problems)
    }

    /// A text under `key` that has to be there and to say something.
    pub(super) fn need_text(&self, key: &str, at: &Span, problems: &mut Problems) -> Option<&'a str> {
        let node = self.need(key, at, problems)?;
        let text = text_of(node, problems)?;
        if text.trim().is_empty() {
            problems.at(
                "missing-value",
                &node.span,
                format!("`{key}` is empty"),
                "write something",
            );
            return None;
        }
        Some(text)
    }

    /// `true` or `false` under `key`; `false` unless said.
    pub(super) fn flag(&self, key: &str, problems: &mut Problems) -> bool {
        let Some(node) = self.get(key, problems) else {
            return false;
        };
        if let Kind::Bool(flag) = node.kind {
            return flag;
        }
        problems.wrong_type(node, "`true` or `false`");
        false
    }

    /// A whole number from `0` to `limit` under `key`.
    pub(super) fn whole_number(&self, key: &str, limit: u32, problems: &mut Problems) -> Option<u32> {
        let node = self.get(key, problems)?;
        let Kind::Number(number) = &node.kind else {
            problems.wrong_type(node, "a whole number");
            return None;
        };
        let fitting = number
            .as_u64()
            .and_then(|number| u32::try_from(number).ok())
            .filter(|number| *number <= limit);
        if fitting.is_none() {
            problems.at(
                "bad-number",
                &node.span,
                format!("`{key}` is a whole number from 0 to {limit}"),
                "out of range",
            );
        }
        fitting
    }

    /// One of the words of a table under `key`.
    pub(super) fn word<T: Copy>(
        &self,
        key: &str,
        code: &'static str,
        words: &[(&'static str, T)],
        problems: &mut Problems,
    ) -> Option<T> {
        let node = self.get(key, problems)?;
        let text = text_of(node, problems)?;
        word_of(text, &node.span, key, code, words, problems)
    }

    /// A list under `key`; empty when there is none.
    pub(super) fn list(&self, key: &str, problems: &mut Problems) -> &'a [Node] {
        let Some(node) = self.get(key, problems) else {
            return &[];
        };
        node.list().unwrap_or_else(|| {
            problems.wrong_type(node, "a list");
            &[]
        })
    }
}

/// The text of a node that has to be one.
pub(super) fn text_of<'a>(node: &'a Node, problems: &mut Problems) -> Option<&'a str> {
    if node.text().is_none() {
        problems.wrong_type(node, "a text");
    }
    node.text()
}

/// The meaning of a word out of a table.
pub(super) fn word_of<T: Copy>(
    text: &str,
    span: &Span,
    what: &str,
    code: &'static str,
    words: &[(&'static str, T)],
    problems: &mut Problems,
) -> Option<T> {
    let found = words
        .iter()
        .find(|(word, _)| *word == text)
        .map(|(_, meaning)| *meaning);
    if found.is_none() {
        let allowed: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
        problems.unknown(code, span, what, text, allowed);
    }
    found
}
