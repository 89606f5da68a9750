//! What the catalogue and the suites say, as far as a report shows it.
//!
//! Plain data, so that a rendering needs neither the catalogue nor a loader of suites. Collecting it is left
//! to the caller; [`TestSource::of`] and [`MonitorSource::of`] do it for the suites' own types.

use std::collections::BTreeMap;

use tck_base::diagnostic::Span;
use tck_pack::Role;
use tck_suite::model::{Monitor, Step, Test, Verb};

/// Everything a report may quote.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sources {
    /// Requirements of the version, in catalogue order, of both roles or of one.
    pub requirements: Vec<RequirementText>,
    /// Tests.
    pub tests: Vec<TestSource>,
    /// Monitors.
    pub monitors: Vec<MonitorSource>,
    /// Files of somebody's own: their paths among the suites, and as they were given.
    pub given: BTreeMap<String, String>,
}

impl Sources {
    /// The requirement with an id.
    #[must_use]
    pub fn requirement(&self, id: &str) -> Option<&RequirementText> {
        self.requirements.iter().find(|requirement| requirement.id == id)
    }

    /// The requirements that have to be kept for this one to be decided.
    #[must_use]
    pub fn rests_on(&self, id: &str) -> Vec<&str> {
        let known = self.requirement(id).into_iter();
        known
            .flat_map(|known| known.rests_on.iter().map(String::as_str))
            .collect()
    }

    /// The path of a file of the suites where whoever gave it finds it.
    #[must_use]
    pub fn as_given<'a>(&'a self, path: &'a str) -> &'a str {
        self.given.get(path).map_or(path, String::as_str)
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
    /// Where that can be read.
    pub link: Option<String>,
    /// The ruling where the standard is silent or contradicts itself.
    pub interpretation: Option<String>,
    /// How it can be decided.
    pub decided: HowDecided,
    /// The action it is about, when it binds only a vehicle that offers that action.
    pub action: Option<String>,
    /// The requirements that have to be kept for it to be decided.
    pub rests_on: Vec<String>,
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
                operator |= matches!(*step.verb, Verb::Operator(_));
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
        let spans: Vec<&Span> = match &*step.verb {
            Verb::Expect(expect) => {
                let checks = expect.checks.iter().map(|binding| &binding.span);
                let asserts = expect.assert.iter().chain(&expect.prefer);
                checks.chain(asserts.map(|assertion| &assertion.span)).collect()
            }
            Verb::Never(never) => never.checks.iter().map(|binding| &binding.span).collect(),
            Verb::Always(always) => {
                let until = match &always.extent {
                    tck_suite::model::Extent::Until(until) => until.checks.as_slice(),
                    tck_suite::model::Extent::During(_) => &[],
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use tck_base::diagnostic::Source;
    use tck_base::pattern::{Term, TermKind};
    use tck_pack::RequirementId;
    use tck_suite::model::{Assertion, Binding, CourseNeed, Expect, From, Maturity, Operator, Selection, TimeTerm};

    const TEXT: &str = "steps:\n  - expect: state\n    checks: [B-1]\n    assert:\n      A-1:\n        x: 1\n";

    fn span(source: &Arc<Source>, text: &str) -> Span {
        let start = source.text.find(text).expect("text");
        Span::new(source, start, start + text.len())
    }

    fn step(span: Span, verb: Verb) -> Step {
        Step {
            path: "steps[0]".to_owned(),
            title: None,
            spec: None,
            purpose: None,
            verb: Arc::new(verb),
            owes: false,
            prefers: false,
            verb_span: span.clone(),
            span,
        }
    }

    fn test(source: &Arc<Source>, steps: Vec<Step>) -> Test {
        Test {
            id: "group/name".to_owned(),
            group: "group".to_owned(),
            title: "Title".to_owned(),
            device: Role::Agv,
            spec: ">=1".parse().expect("range"),
            needs: Vec::new(),
            moves: false,
            tags: Vec::new(),
            conversation: Vec::new(),
            begins: None,
            maturity: Maturity::Open,
            why: "because".to_owned(),
            given: Vec::new(),
            steps,
            finally: Vec::new(),
            source: Arc::clone(source),
            course: CourseNeed::default(),
            drawn: None,
        }
    }

    fn expect(source: &Arc<Source>) -> Step {
        let id = |id: &str| RequirementId::from(id);
        let verb = Verb::Expect(Box::new(Expect {
            topic: "state".to_owned(),
            of: tck_suite::model::Which::First,
            checks: vec![Binding {
                requirement: id("B-1"),
                span: span(source, "B-1"),
            }],
            selection: Selection::default(),
            within: TimeTerm {
                term: Term {
                    kind: TermKind::Variable("time.react".to_owned()),
                    span: span(source, "state"),
                },
            },
            from: From::Usual,
            assert: vec![Assertion {
                requirement: id("A-1"),
                selection: Selection::default(),
                span: span(source, "A-1:\n        x: 1\n"),
            }],
            prefer: Vec::new(),
            save: Vec::new(),
        }));
        step(span(source, &TEXT[TEXT.find("expect").expect("step")..]), verb)
    }

    #[test]
    fn every_clause_of_a_test_knows_its_lines_and_those_of_its_step() {
        let source = Source::new("x.yaml", TEXT);
        let found = TestSource::of(&test(&source, vec![expect(&source)]));
        let clauses: Vec<_> = found
            .clauses
            .iter()
            .map(|clause| {
                (
                    clause.requirement.as_str(),
                    clause.path.as_str(),
                    clause.lines,
                    clause.step,
                )
            })
            .collect();
        let expected = [
            ("B-1", "steps[0].checks", (3, 3), (2, 6)),
            ("A-1", "steps[0].assert", (5, 6), (2, 6)),
        ];
        assert_eq!(clauses, expected);
        assert!(!found.operator);
    }

    #[test]
    fn a_hook_makes_it_a_test_with_operator_and_a_step_of_another_file_decides_nothing_here() {
        let (source, other) = (Source::new("x.yaml", TEXT), Source::new("state.yaml", TEXT));
        let hook = Verb::Operator(Operator {
            hook: "power-cycle".to_owned(),
            with: Vec::new(),
            within: None,
            each: false,
        });
        let hook = step(span(&source, "steps"), hook);
        let found = TestSource::of(&test(&source, vec![hook, expect(&other)]));
        assert!(found.operator);
        assert!(found.clauses.is_empty());
    }
}
