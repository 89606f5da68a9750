//! The tree of a file, and the states that files may use.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use super::fields::Problems;
use super::model::{Purpose, Verb};
use tck_base::diagnostic::{Diagnostic, Source, Span};
use tck_base::yaml::{self, Node};

/// What a file of a state says.
pub(super) struct State {
    /// What it is for, where it says so.
    pub(super) purpose: Option<Purpose>,
    /// The list of its steps.
    pub(super) steps: Node,
}

/// The states of `suites/states/`, by name. A state whose file is broken is known without what it says.
#[derive(Default)]
pub(super) struct States {
    known: BTreeMap<String, Option<State>>,
    /// What their steps do, by the node of each: most tests use the same few states, and read their steps once.
    read: RefCell<HashMap<*const Node, Arc<Verb>>>,
}

impl States {
    pub(super) fn get(&self, name: &str) -> Option<&State> {
        self.known.get(name)?.as_ref()
    }

    pub(super) fn is_known(&self, name: &str) -> bool {
        self.known.contains_key(name)
    }

    pub(super) fn names(&self) -> Vec<&str> {
        self.known.keys().map(String::as_str).collect()
    }

    /// Knows a state; without what it says when its file is broken.
    pub(super) fn insert(&mut self, name: &str, state: Option<State>) {
        self.known.insert(name.to_owned(), state);
        self.read.get_mut().clear();
    }

    /// What a step of a state does, where it was read before.
    pub(super) fn verb(&self, step: &Node) -> Option<Arc<Verb>> {
        self.read.borrow().get(&std::ptr::from_ref(step)).cloned()
    }

    /// Keeps what a step of a state does, for the next test that uses it.
    pub(super) fn keep(&self, step: &Node, verb: &Arc<Verb>) {
        self.read
            .borrow_mut()
            .insert(std::ptr::from_ref(step), Arc::clone(verb));
    }
}

/// The tree of a file; its mistakes are noted.
pub(super) fn parse(source: &Arc<Source>, problems: &mut Problems) -> Option<Node> {
    match yaml::tree(source) {
        Ok(root) => Some(root),
        Err(found) => {
            for diagnostic in found {
                problems.add(unquoted_variable(&diagnostic).unwrap_or(diagnostic));
            }
            None
        }
    }
}

/// A syntax error that comes from `${…}` without quotes inside `{ }` or `[ ]`.
fn unquoted_variable(diagnostic: &Diagnostic) -> Option<Diagnostic> {
    let span = diagnostic.span.as_ref().filter(|_| diagnostic.code == "yaml-syntax")?;
    let text = &span.source.text;
    let line_start = text[..span.start].rfind('\n').map_or(0, |at| at + 1);
    let line_end = text[span.start..].find('\n').map_or(text.len(), |at| span.start + at);
    // The reader may notice only on the next line.
    let from = text[..line_start.saturating_sub(1)].rfind('\n').map_or(0, |at| at + 1);
    let mut quote = None;
    let mut found = None;
    for (at, c) in text[from..line_end].char_indices() {
        match (quote, c) {
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), c) if open == c => quote = None,
            (None, '$') if text[from + at..].starts_with("${") => found = Some(from + at),
            (_, '\n') => quote = None,
            _ => {}
        }
    }
    let start = found?;
    let end = text[start..line_end].find('}').map_or(line_end, |at| start + at + 1);
    let span = Span::new(&span.source, start, end);
    Some(
        Diagnostic::new(
            "unquoted-variable",
            span.clone(),
            "a variable without quotes inside `{ }` or `[ ]`",
            "YAML reads these braces as its own",
        )
        .hint(format!("write \"{}\"", span.text())),
    )
}
