//! `--events`: what happens in a run as JSON lines, for programs that follow it. docs/events.md has every kind.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde_json::{Map, Value, json};

use super::problem::Problem;
use super::screen::Screen;
use crate::ui::{Follower, Output};
use tck_engine::Watcher;
use tck_journal::event::{Gate, Plan};
use tck_net::link::mqtt::BenchInfo;
use tck_result::{RunResult, TestResult};
use tck_run as run;
use tck_suite::model::{Step, Test};

/// Format of the stream.
pub const FORMAT: &str = "vda5050-tck.events/1";

/// The screen of a run, and the stream of its events beside it.
pub struct Followed {
    /// What a person sees.
    pub screen: Screen,
    stream: Option<Stream>,
    test: String,
}

/// The stream, which is written to from where a person is asked as well.
#[derive(Clone)]
struct Stream(Arc<Mutex<Output<Box<dyn Write + Send>>>>);

impl Stream {
    fn tell(&self, event: &str, members: Value) {
        let mut line = Map::new();
        line.insert("event".to_owned(), event.into());
        line.insert("at".to_owned(), format!("{:.3}", jiff::Timestamp::now()).into());
        if let Value::Object(members) = members {
            line.extend(members.into_iter().filter(|(_, value)| !value.is_null()));
        }
        let mut stream = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // A follower that has gone away, or a full disk, does not end the run: the bundle has it all.
        let _ = stream.line(&Value::Object(line).to_string());
    }
}

impl Followed {
    /// Nobody follows unless a file is given; `-` is standard output.
    pub fn new(screen: Screen, events: Option<&Path>) -> Result<Self, Problem> {
        let stream: Option<Box<dyn Write + Send>> = match events {
            None => None,
            Some(path) if path.as_os_str() == "-" => Some(Box::new(io::stdout())),
            Some(path) => {
                let file = File::create(path);
                let file = file.map_err(|error| {
                    Problem::Environment(format!("cannot write events to {}: {error}", path.display()))
                })?;
                Some(Box::new(file))
            }
        };
        Ok(Self {
            screen,
            stream: stream.map(|stream| Stream(Arc::new(Mutex::new(Output::to(stream))))),
            test: String::new(),
        })
    }

    fn tell(&self, event: &str, members: Value) {
        if let Some(stream) = &self.stream {
            stream.tell(event, members);
        }
    }

    /// Tells of questions to a person, and of their answers.
    pub fn follower(&self) -> Option<Follower> {
        let (asked, answered) = (self.stream.clone()?, self.stream.clone()?);
        Some(Follower {
            asked: Box::new(move |question| asked.tell("question", json!(question))),
            answered: Box::new(move |number, answer| {
                answered.tell("answered", json!({ "number": number, "answer": answer.word() }));
            }),
        })
    }

    /// The run begins.
    pub fn begun(&mut self, about: &About<'_>) {
        self.tell(
            "run-begun",
            json!({ "format": FORMAT, "run": about.run, "role": about.role, "protocol": about.protocol,
                "manufacturer": about.manufacturer, "serialNumber": about.serial_number,
                "bundle": about.bundle.display().to_string() }),
        );
    }

    /// The run has ended, and its bundle is written.
    pub fn ended(&mut self, result: &RunResult, root: Option<&str>, exit: u8) {
        for requirement in &result.requirements {
            if let Some(verdict) = requirement
                .verdict
                .filter(|verdict| *verdict != tck_base::verdict::Verdict::Pass)
            {
                self.tell(
                    "requirement",
                    json!({ "requirement": requirement.id, "verdict": verdict, "by": requirement.decided_by }),
                );
            }
        }
        self.tell(
            "run-ended",
            json!({ "verdict": result.verdict.map_or("none", tck_base::verdict::Verdict::word),
                "statement": tck_report::statement::statement(result), "partial": result.partial,
                "reason": result.partial_reason, "seconds": result.seconds, "root": root.map(|root| format!("sha256:{root}")),
                "exit": exit }),
        );
    }
}

/// What a run is about.
#[derive(Clone, Copy, Debug)]
pub struct About<'a> {
    /// Its identifier.
    pub run: &'a str,
    /// Which side is tested.
    pub role: &'a str,
    /// The version it is judged by.
    pub protocol: &'a str,
    /// Manufacturer of the device.
    pub manufacturer: &'a str,
    /// Its serial number.
    pub serial_number: &'a str,
    /// Where the bundle is going to be.
    pub bundle: &'a Path,
}

impl Watcher for Followed {
    fn waiting(&mut self, step: &Step) {
        self.screen.waiting(step);
        let members = json!({ "test": self.test, "path": step.path, "title": step.title,
            "does": step.verb_span.text() });
        self.tell("step-begun", members);
    }
}

impl run::Progress for Followed {
    fn planned(&mut self, plan: &Plan) {
        self.screen.planned(plan);
        let tests = plan.tests.iter().map(|test| match &test.gate {
            Gate::Runs => json!({ "test": test.test, "gate": "runs" }),
            Gate::NotApplicable(why) => json!({ "test": test.test, "gate": "not-applicable", "why": why.to_string() }),
            Gate::Unobservable(why) => json!({ "test": test.test, "gate": "inconclusive", "why": why.to_string() }),
        });
        let tests: Vec<Value> = tests.collect();
        self.tell("planned", json!({ "tests": tests }));
    }

    fn test_begun(&mut self, test: &Test, number: usize, of: usize) {
        self.screen.test_begun(test, number, of);
        self.test.clone_from(&test.id);
        let members = json!({ "test": test.id, "title": test.title, "number": number, "of": of });
        self.tell("test-begun", members);
    }

    fn test_ended(&mut self, result: &TestResult) {
        self.screen.test_ended(result);
        let decisions = result.decisions.iter().map(|decision| {
            json!({ "requirement": decision.requirement, "verdict": decision.verdict(), "clause": decision.clause,
                "place": decision.place, "message": decision.message, "witness": decision.witness })
        });
        let decisions: Vec<Value> = decisions.collect();
        let verdict = result.verdict.unwrap_or(tck_base::verdict::Verdict::Error);
        let members = json!({ "test": result.id, "verdict": verdict, "seconds": result.seconds,
            "reason": result.reason, "decisions": decisions,
            "repetition": result.repetitions.last().map(|repetition| repetition.number) });
        self.tell("test-ended", members);
    }

    fn note(&mut self, text: &str) {
        self.screen.note(text);
        self.tell("note", json!({ "text": text }));
    }

    fn left(&mut self, left: Duration) {
        self.screen.left(left);
    }

    fn expects_device(&mut self, bench: &BenchInfo) {
        self.screen.expects_device(bench);
        self.tell("device-expected", json!({ "address": bench.device_url }));
    }
}
