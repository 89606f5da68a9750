//! What an evaluator may look at, and named checks over a window of it.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::{Map, Value};

use super::timeline::Timeline;
use crate::checks::{self, CheckContext, CheckFinding, Running};
use crate::journal::Entry;
use crate::pack::Pack;
use crate::pattern::Bindings;
use crate::suite::model::CheckUse;

/// Everything around a step.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// The protocol version.
    pub pack: &'a Pack,
    /// Full topic by topic name.
    pub topics: &'a BTreeMap<String, String>,
    /// Manufacturer and serial number.
    pub identity: (&'a str, &'a str),
    /// The run's own bindings: `time`, `device`.
    pub run_bindings: &'a Map<String, Value>,
    /// All variables of the test.
    pub bindings: &'a Bindings,
    /// By subject.
    pub timeline: &'a Timeline,
    /// All entries of the test so far.
    pub entries: &'a [Arc<Entry>],
}

/// A named check running over a window.
pub(super) struct CheckWindow {
    running: Box<dyn Running>,
    with: Map<String, Value>,
    findings: Vec<CheckFinding>,
    /// Whether it judged anything at all.
    pub(super) judged: u64,
}

impl CheckWindow {
    pub(super) fn start(check: &CheckUse, scene: &Scene<'_>) -> Result<Self, String> {
        let definition = checks::find(&check.name).ok_or_else(|| format!("there is no check {}", check.name))?;
        let mut with = Map::new();
        for (name, term) in &check.with {
            let value = term
                .bind(scene.bindings)
                .map_err(|unbound| super::step::unbound_text(&unbound))?;
            with.insert(name.clone(), value);
        }
        let running = (definition.start)(&context(scene, &with));
        Ok(Self {
            running,
            with,
            findings: Vec::new(),
            judged: 0,
        })
    }

    /// Shows it one entry; returns what it found there.
    pub(super) fn observe(&mut self, entry: &Entry, scene: &Scene<'_>) -> Option<String> {
        let before = self.findings.len();
        if self
            .running
            .observe(entry, &context(scene, &self.with), &mut self.findings)
        {
            self.judged += 1;
        }
        self.findings.get(before).map(|finding| finding.message.clone())
    }

    /// Shows it everything of the test up to `seq`; returns what it found at that very entry.
    pub(super) fn run_to(&mut self, seq: u64, scene: &Scene<'_>) -> Option<String> {
        for entry in scene.entries.iter().take_while(|entry| entry.seq() <= seq) {
            self.observe(entry, scene);
        }
        self.findings
            .iter()
            .find(|finding| finding.seq == seq)
            .map(|finding| finding.message.clone())
    }

    /// The window has ended; returns what was found by that.
    pub(super) fn finish(&mut self, end: crate::clock::Moment, scene: &Scene<'_>) -> Option<String> {
        let before = self.findings.len();
        self.running
            .finish(end, &context(scene, &self.with), &mut self.findings);
        self.findings.get(before).map(|finding| finding.message.clone())
    }
}

fn context<'a>(scene: &'a Scene<'_>, with: &'a Map<String, Value>) -> CheckContext<'a> {
    CheckContext {
        pack: scene.pack,
        topics: scene.topics,
        identity: scene.identity,
        with,
        bindings: scene.run_bindings,
    }
}
