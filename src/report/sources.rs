//! What the catalogue and the suites say, as far as a report shows it.
//!
//! Plain data, so that a rendering needs neither the catalogue nor a loader of suites. Collecting it is left
//! to the caller; [`TestSource::of`] and [`MonitorSource::of`] do it for the suites' own types.

use crate::diagnostic::Span;
use crate::pack::Role;
use crate::suite::model::{Monitor, Step, Test, Verb};

/// Everything a report may quote.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sources {
    /// Requirements of the version, in catalogue order, of both roles or of one.
    pub requirements: Vec<RequirementText>,
    /// Tests.
    pub tests: Vec<TestSource>,
    /// Monitors.
    pub monitors: Vec<MonitorSource>,
}

impl Sources {
    /// The requirement with an id.
    #[must_use]
    pub fn requirement(&self, id: &str) -> Option<&RequirementText> {
        self.requirements.iter().find(|requirement| requirement.id == id)
    }

    /// The test with an id.
    #[must_use]
    pub fn test(&self, id: &str) -> Option<&TestSource> {
        self.tests.iter().find(|test| test.id == id)
    }

    /// The monitor with an id.
    #[must_use]
    pub fn monitor(&self, id: &str) -> Option<&MonitorSource> {
        self.monitors.iter().find(|monitor| monitor.id == id)
    }
}

/// One requirement of the catalogue, for one protocol version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RequirementText {
    /// Id, such as `ORD-REJ-12`.
    pub id: String,
    /// Title of its chapter.
    pub chapter: String,
    /// Our sentence.
    pub text: String,
    /// Whom it binds: `agv`, `master-control`, `both`, `integrator` or `broker`.
    pub role: String,
    /// `shall`, `should` or `may`.
    pub mood: String,
    /// Section of the standard.
    pub section: String,
    /// The ruling where the standard is silent or contradicts itself.
    pub interpretation: Option<String>,
    /// How it can be decided.
    pub decided: HowDecided,
}

/// How a requirement can be decided.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HowDecided {
    /// By a stimulus and what follows.
    Active,
    /// By looking at the traffic.
    Passive,
    /// With the help of a person or a hook.
    Operator,
    /// Not at all; the text says why.
    NotTestable(String),
}

/// A test as written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TestSource {
    /// Id.
    pub id: String,
    /// Which side it tests.
    pub role: Role,
    /// Title.
    pub title: String,
    /// Why anybody cares.
    pub why: String,
    /// Whether a hook of the profile or a person takes part.
    pub operator: bool,
    /// File.
    pub file: String,
    /// The whole file.
    pub text: String,
    /// Where each requirement is decided.
    pub clauses: Vec<ClauseSource>,
}

/// Where a requirement is decided in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClauseSource {
    /// Requirement id.
    pub requirement: String,
    /// Path, such as `steps[6].assert`.
    pub path: String,
    /// First and last line of the binding, counted from 1.
    pub lines: (usize, usize),
    /// First and last line of the step it belongs to.
    pub step: (usize, usize),
}

/// A monitor, as far as a report shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MonitorSource {
    /// Id.
    pub id: String,
    /// Which side it judges; both when absent.
    pub role: Option<Role>,
    /// Title.
    pub title: String,
    /// Why anybody cares.
    pub why: String,
    /// What it decides.
    pub requirements: Vec<String>,
}

fn lines(span: &Span) -> (usize, usize) {
    let first = span.line();
    let text = span.text().trim_end();
    (first, first + text.matches('\n').count())
}

impl TestSource {
    /// What a report needs of a test.
    #[must_use]
    pub fn of(test: &Test) -> Self {
        let mut operator = false;
        let mut clauses = Vec::new();
        for (_, steps) in test.sections() {
            for step in steps {
                operator |= matches!(step.verb, Verb::Operator(_));
                // Steps inlined from a state stand in another file, and decide nothing there.
                if step.span.source == test.source {
                    clauses.extend(ClauseSource::of(step));
                }
            }
        }
        Self {
            id: test.id.clone(),
            role: test.device,
            title: test.title.clone(),
            why: test.why.clone(),
            operator,
            file: test.source.name.clone(),
            text: test.source.text.clone(),
            clauses,
        }
    }
}

impl ClauseSource {
    fn of(step: &Step) -> Vec<Self> {
        let spans: Vec<&Span> = match &step.verb {
            Verb::Expect(expect) => {
                let checks = expect.checks.iter().map(|binding| &binding.span);
                let asserts = expect.assert.iter().chain(&expect.prefer);
                checks.chain(asserts.map(|assertion| &assertion.span)).collect()
            }
            Verb::Never(never) => never.checks.iter().map(|binding| &binding.span).collect(),
            Verb::Always(always) => {
                let until = match &always.extent {
                    crate::suite::model::Extent::Until(until) => until.checks.as_slice(),
                    crate::suite::model::Extent::During(_) => &[],
                };
                always.checks.iter().chain(until).map(|binding| &binding.span).collect()
            }
            Verb::Action(walk) => walk.checks.iter().map(|binding| &binding.span).collect(),
            Verb::Retained(retained) => {
                let checks = retained.checks.iter().map(|binding| &binding.span);
                checks
                    .chain(retained.assert.iter().map(|assertion| &assertion.span))
                    .collect()
            }
            Verb::Send(_) | Verb::Link(_) | Verb::Serve(_) | Verb::Operator(_) | Verb::Vehicle(_) => Vec::new(),
        };
        // `Step::clauses` lists in the same order as the spans above.
        step.clauses()
            .into_iter()
            .zip(spans)
            .map(|((requirement, path), span)| Self {
                requirement: requirement.to_string(),
                path,
                lines: lines(span),
                step: lines(&step.span),
            })
            .collect()
    }
}

impl MonitorSource {
    /// What a report needs of a monitor.
    #[must_use]
    pub fn of(monitor: &Monitor) -> Self {
        Self {
            id: monitor.id.clone(),
            role: monitor.device,
            title: monitor.title.clone(),
            why: monitor.why.clone(),
            requirements: monitor.checks.iter().map(|b| b.requirement.to_string()).collect(),
        }
    }
}
