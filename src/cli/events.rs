//! What happens in a run, for whoever follows it: the terminal, `--events` with JSON lines for programs (docs/events.md has
//! every kind), and `--page` for people (docs/page.md).

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde_json::{Map, Value, json};

use super::page::{OnPage, findings_of, follower};
use super::problem::Problem;
use super::screen::Screen;
use crate::ui::{Follower, Output};
use tck_engine::Watcher;
use tck_journal::event::{Gate, Plan};
use tck_net::link::mqtt::BenchInfo;
use tck_page::{Facts, Outcome, Page};
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
    page: Option<OnPage>,
    test: String,
    /// Where the bundle is.
    bundle: String,
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
    /// No program follows unless a file is given, where `-` is standard output, and no person elsewhere without a page.
    pub fn new(screen: Screen, events: Option<&Path>, page: Option<Page>) -> Result<Self, Problem> {
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
            page: page.map(OnPage),
            test: String::new(),
            bundle: String::new(),
        })
    }

    fn tell(&self, event: &str, members: Value) {
        if let Some(stream) = &self.stream {
            stream.tell(event, members);
        }
    }

    /// Tells of questions to a person, and of their answers.
    pub fn follower(&self) -> Option<Follower> {
        let shown = self.page.as_ref().map(|page| follower(page.0.clone()));
        let Some(stream) = self.stream.clone() else {
            return shown;
        };
        let told = stream.clone();
        let (asked, answered) = shown.map(|shown| (shown.asked, shown.answered)).unzip();
        Some(Follower {
            asked: Box::new(move |question| {
                stream.tell("question", json!(question));
                if let Some(asked) = &asked {
                    asked(question);
                }
            }),
            answered: Box::new(move |number, reply| {
                let from = reply.from.map(run::Place::word);
                told.tell(
                    "answered",
                    json!({ "number": number, "answer": reply.answer.word(), "from": from }),
                );
                if let Some(answered) = &answered {
                    answered(number, reply);
                }
            }),
        })
    }

    /// The run begins.
    pub fn begun(&mut self, about: &About<'_>) {
        self.bundle = about.bundle.display().to_string();
        if let Some(OnPage(page)) = &self.page {
            page.begun(Facts {
                command: about.command.to_owned(),
                role: about.role.to_owned(),
                protocol: about.protocol.to_owned(),
                manufacturer: about.manufacturer.to_owned(),
                serial_number: about.serial_number.to_owned(),
                run: about.run.to_owned(),
                broker: about.broker.to_owned(),
            });
        }
        self.tell(
            "run-begun",
            json!({ "format": FORMAT, "run": about.run, "role": about.role, "protocol": about.protocol,
                "manufacturer": about.manufacturer, "serialNumber": about.serial_number,
                "bundle": about.bundle.display().to_string() }),
        );
    }

    /// The run has ended, and its bundle is written.
    pub fn ended(&mut self, result: &RunResult, root: Option<&str>, exit: u8) {
        if let Some(OnPage(page)) = &self.page {
            page.findings(findings_of(result));
            page.ended(Outcome {
                verdict: result
                    .verdict
                    .map_or("none", tck_base::verdict::Verdict::word)
                    .to_owned(),
                statement: tck_report::statement::statement(result),
                report: format!("{}/report.html", self.bundle),
            });
        }
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
    /// `run` or `certify`.
    pub command: &'a str,
    /// The broker that is used, in words.
    pub broker: &'a str,
}

impl Watcher for Followed {
    fn waiting(&mut self, step: &Step) {
        self.screen.waiting(step);
        let members = json!({ "test": self.test, "path": step.path, "title": step.title,
            "does": step.verb_span.text() });
        self.tell("step-begun", members);
        if let Some(page) = &mut self.page {
            page.waiting(step);
        }
    }

    fn awaits(&mut self, left: Duration) {
        if let Some(page) = &mut self.page {
            page.awaits(left);
        }
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
        if let Some(page) = &mut self.page {
            page.planned(plan);
        }
    }

    fn test_begun(&mut self, test: &Test, number: usize, of: usize) {
        self.screen.test_begun(test, number, of);
        self.test.clone_from(&test.id);
        let members = json!({ "test": test.id, "title": test.title, "number": number, "of": of });
        self.tell("test-begun", members);
        if let Some(page) = &mut self.page {
            page.test_begun(test, number, of);
        }
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
        if let Some(page) = &mut self.page {
            page.test_ended(result);
        }
    }

    fn note(&mut self, text: &str) {
        self.screen.note(text);
        self.tell("note", json!({ "text": text }));
        if let Some(page) = &mut self.page {
            page.note(text);
        }
    }

    fn left(&mut self, left: Duration) {
        self.screen.left(left);
        if let Some(page) = &mut self.page {
            page.left(left);
        }
    }

    fn expects_device(&mut self, bench: &BenchInfo) {
        self.screen.expects_device(bench);
        self.tell("device-expected", json!({ "address": bench.device_url }));
        if let Some(page) = &mut self.page {
            page.expects_device(bench);
        }
    }
}
