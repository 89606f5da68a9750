//! What the page shows: kept up to date while the run goes on, and told to each browser as far as that has not seen it.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde_json::{Map, Value, json};
use tokio::sync::watch;

use super::floor::{FleetVehicle, Floor, Spot, Trail, VehicleOnFloor, Whereabouts};
use super::parts::{Asked, Fleet, Head, Line, Message, Phase, Row, Running, Step, from_now, now};
use super::shown::{NAME, RECORD, SENTENCE, shown};
use super::told::{Facts, Finding, Outcome, Planned, Prompt, StepFacts, TestFacts, Way};
use tck_base::verdict::Verdict;
use tck_journal::event::Event;
use tck_journal::{Entry, Journal, Shelf};

/// How many of the last messages are shown each way.
const MESSAGES: usize = 20;
/// How many lines the time line has.
const LINES: usize = 200;
/// How many findings are shown.
const FINDINGS: usize = 200;
/// How many vehicles of a watch are shown.
const VEHICLES: usize = 200;
/// How many tests are listed.
const TESTS: usize = 5_000;

/// What the page shows. Copies are the same page.
#[derive(Clone, Debug)]
pub struct Page(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    model: Mutex<Model>,
    changed: watch::Sender<u64>,
}

/// A part of the page, and the change that it has come by.
#[derive(Debug, Default)]
struct Part<T> {
    value: T,
    changed: u64,
}

impl<T> Part<T> {
    fn set(&mut self, value: T, change: u64) {
        self.value = value;
        self.changed = change;
    }

    fn touch(&mut self, change: u64) -> &mut T {
        self.changed = change;
        &mut self.value
    }
}

#[derive(Debug, Default)]
struct Model {
    change: u64,
    /// The change since which nothing of before is shown any more.
    begun_anew: u64,
    head: Part<Head>,
    test: Part<Option<Running>>,
    question: Part<Option<Asked>>,
    tests: Part<Vec<Row>>,
    findings: Part<Vec<Finding>>,
    /// What a requirement asks, by its id.
    asks: BTreeMap<String, String>,
    floor: Part<Option<Floor>>,
    vehicle: Part<(VehicleOnFloor, Trail)>,
    whereabouts: Whereabouts,
    /// Where the vehicle was at the records that show findings.
    marks: BTreeMap<u64, Option<Spot>>,
    /// How many questions each test asks, by its id, and how many all tests of the plan do.
    prompts: BTreeMap<String, u64>,
    planned_prompts: u64,
    fleet: Part<Fleet>,
    messages: VecDeque<Message>,
    lines: VecDeque<Line>,
    /// The last records of the run; all of them where the journal cannot be read back.
    records: VecDeque<Arc<Entry>>,
    journal: Option<Arc<Shelf>>,
}

impl Default for Page {
    fn default() -> Self {
        let page = Self(Arc::new(Shared {
            model: Mutex::default(),
            changed: watch::channel(0).0,
        }));
        page.change(|model, change| model.head.touch(change).began = now());
        page
    }
}

impl Page {
    /// The run begins.
    pub fn begun(&self, facts: Facts) {
        self.change(|model, change| {
            model.head.touch(change).facts = facts.cut();
            model.line("run", "the run begins".to_owned(), None);
        });
    }

    /// Another run begins on the same page, with records of its own. What was found stays, and leads to no record any more.
    pub fn begins_anew(&self) {
        self.change(|model, change| {
            model.begun_anew = change;
            model.records.clear();
            model.journal = None;
            model.whereabouts.clear();
            model.marks.clear();
            model.messages.clear();
            for line in &mut model.lines {
                line.record = None;
            }
            for finding in model.findings.touch(change) {
                finding.record = None;
            }
            model.head.touch(change).connections = None;
        });
    }

    /// What each requirement asks, by its id: a finding is shown with it.
    pub fn asks(&self, asks: BTreeMap<String, String>) {
        self.change(|model, change| {
            model.asks = asks;
            model.findings.changed = change;
        });
    }

    /// How many questions a person is asked in each test, by its id.
    pub fn prompts(&self, prompts: BTreeMap<String, u64>) {
        self.change(|model, _| model.prompts = prompts);
    }

    /// Where older records are read back from.
    pub fn reads_back(&self, journal: &Arc<Shelf>) {
        self.change(|model, _| model.journal = Some(Arc::clone(journal)));
    }

    /// The bench stands, and a device is expected there.
    pub fn expects(&self, address: &str) {
        self.change(|model, change| {
            let head = model.head.touch(change);
            head.address = Some(shown(address, NAME));
            head.phase = Phase::ExpectsDevice;
            let text = format!("the device is expected at {}", shown(address, NAME));
            model.line("run", text, None);
        });
    }

    /// The tests of the run are known.
    pub fn planned(&self, tests: Vec<Planned>) {
        self.change(|model, change| {
            let asking = tests.iter().filter(|planned| planned.left_out.is_none());
            model.planned_prompts = asking.filter_map(|planned| model.prompts.get(&planned.test)).sum();
            let rows = tests.into_iter().take(TESTS).map(|planned| Row {
                test: shown(&planned.test, NAME),
                state: if planned.left_out.is_some() { "left-out" } else { "left" },
                why: planned.left_out.map(|why| shown(&why, SENTENCE)),
            });
            let rows: Vec<Row> = rows.collect();
            let runs = rows.iter().filter(|row| row.state == "left").count();
            let text = format!("{runs} tests are planned, {} are left out", rows.len() - runs);
            model.tests.set(rows, change);
            model.begin_to_run(change);
            model.line("run", text, None);
        });
    }

    /// A test begins.
    pub fn test_begun(&self, facts: &TestFacts) {
        self.change(|model, change| {
            let test = shown(&facts.test, NAME);
            model.begin_to_run(change);
            model.begin_trail(change);
            model.row(&test, "runs", None, change);
            model.line("test", format!("{test} begins"), None);
            let running = Running {
                test,
                title: shown(&facts.title, SENTENCE),
                why: shown(&facts.why, SENTENCE),
                number: facts.number,
                of: facts.of,
                since: now(),
                step: None,
            };
            model.test.set(Some(running), change);
        });
    }

    /// The test has come to a step.
    pub fn step(&self, facts: &StepFacts) {
        self.change(|model, change| {
            if let Some(running) = model.test.touch(change) {
                running.step = Some(Step {
                    path: shown(&facts.path, NAME),
                    title: facts.title.as_deref().map(|title| shown(title, SENTENCE)),
                    does: shown(&facts.does, NAME),
                    since: now(),
                    until: None,
                });
            }
        });
    }

    /// What the step waits for has to come within this time.
    pub fn awaits(&self, left: Duration) {
        self.change(|model, change| {
            if let Some(step) = model.test.touch(change).as_mut().and_then(|test| test.step.as_mut()) {
                step.until = Some(from_now(left));
            }
        });
    }

    /// A test has ended.
    pub fn test_ended(&self, test: &str, verdict: Verdict, reason: Option<&str>) {
        self.change(|model, change| {
            let test = shown(test, NAME);
            let reason = reason.map(|reason| shown(reason, SENTENCE));
            let text = match &reason {
                Some(reason) => format!("{test}: {verdict}: {reason}"),
                None => format!("{test}: {verdict}"),
            };
            model.row(&test, verdict.word(), reason, change);
            model.line(verdict.word(), text, None);
            model.test.set(None, change);
        });
    }

    /// Something was found, beside what is known already.
    pub fn found(&self, findings: Vec<Finding>) {
        if findings.is_empty() {
            return;
        }
        self.change(|model, change| {
            let mut all = std::mem::take(model.findings.touch(change));
            for finding in findings {
                let is_same =
                    |known: &&mut Finding| (&known.requirement, &known.by) == (&finding.requirement, &finding.by);
                match all.iter_mut().find(is_same) {
                    // The first record stays: it shows where it began.
                    Some(known) => {
                        known.count = known.count.max(finding.count);
                        known.verdict = known.verdict.max(finding.verdict);
                    }
                    None => {
                        let text = format!("{}: {}", finding.requirement, finding.message);
                        model.line("finding", text, finding.record);
                        all.push(finding);
                    }
                }
            }
            model.findings.set(worst_first(all), change);
            model.mark();
        });
    }

    /// All that was found so far.
    pub fn findings(&self, findings: Vec<Finding>) {
        let findings = worst_first(findings);
        self.change(|model, change| {
            if model.findings.value != findings {
                model.findings.set(findings, change);
                model.mark();
            }
        });
    }

    /// Something is worth knowing.
    pub fn note(&self, text: &str) {
        self.change(|model, _| model.line("note", text.to_owned(), None));
    }

    /// How much of the run is left, as far as can be told.
    pub fn left(&self, left: Duration) {
        self.change(|model, change| model.head.touch(change).ends = Some(from_now(left)));
    }

    /// A person is asked to do something.
    pub fn asked(&self, prompt: &Prompt) {
        self.change(|model, change| {
            let running = model.test.value.as_ref();
            let text = shown(&prompt.text, SENTENCE);
            let asked = Asked {
                number: prompt.number,
                // More are asked than planned when something has to be tried again.
                of: Some(model.planned_prompts).filter(|of| prompt.number <= *of),
                test: running.map(|test| test.test.clone()),
                title: running.map(|test| test.title.clone()),
                why: running.map(|test| test.why.clone()),
                step: prompt.step.as_deref().map(|step| shown(step, SENTENCE)),
                text: text.clone(),
                until: from_now(Duration::from_secs(prompt.seconds)),
            };
            model.question.set(Some(asked), change);
            model.line("question", text, None);
        });
    }

    /// The question of this number is over.
    pub fn answered(&self, number: u64, how: &str) {
        self.change(|model, change| {
            if model.question.value.as_ref().is_some_and(|open| open.number == number) {
                model.question.set(None, change);
            }
            model.line("question", format!("question {number}: {how}"), None);
        });
    }

    /// A record was written; `topic` and `way` are of the message that it carries, if that is one between the device and the
    /// other side.
    pub fn saw(&self, entry: &Arc<Entry>, message: Option<(&str, Way)>) {
        self.change(|model, change| {
            model.records.push_back(Arc::clone(entry));
            if model.journal.is_some() && model.records.len() > Journal::RECENT {
                model.records.pop_front();
            }
            model.count_connections(entry, change);
            if let Some((topic, way)) = message {
                model.keep(Message {
                    change,
                    way,
                    topic: shown(topic, NAME),
                    entry: Arc::clone(entry),
                });
            }
        });
    }

    /// What the device says of its connection.
    pub fn connection(&self, state: &str) {
        self.change(|model, change| model.head.touch(change).connection = Some(shown(state, NAME)));
    }

    /// Where the vehicle may drive.
    pub fn floor(&self, floor: Floor) {
        self.change(|model, change| model.floor.set(Some(floor), change));
    }

    /// What the vehicle says of itself.
    pub fn vehicle(&self, vehicle: VehicleOnFloor) {
        let vehicle = vehicle.cut();
        self.change(|model, change| {
            let (now, trail) = &mut model.vehicle.value;
            if *now != vehicle {
                trail.goes_on(&vehicle);
                let record = model.records.back().map_or(0, |entry| entry.seq());
                model.whereabouts.note(record, &vehicle);
                *now = vehicle;
                model.vehicle.changed = change;
            }
        });
    }

    /// The vehicles of a watch, the worst first; of many, only the first are shown.
    pub fn fleet(&self, vehicles: Vec<FleetVehicle>) {
        let fleet = Fleet {
            heard: vehicles.len(),
            vehicles: vehicles.into_iter().take(VEHICLES).map(FleetVehicle::cut).collect(),
        };
        self.change(|model, change| {
            if model.fleet.value != fleet {
                model.fleet.set(fleet, change);
            }
        });
    }

    /// Somebody wants the run to end.
    pub fn stops(&self) {
        self.change(|model, change| {
            let head = model.head.touch(change);
            if matches!(head.phase, Phase::Stops | Phase::Ended) {
                return;
            }
            head.phase = Phase::Stops;
            let text = "the run is to end: what the device was given is called off".to_owned();
            model.line("run", text, None);
        });
    }

    /// The run has ended.
    pub fn ended(&self, outcome: Outcome) {
        self.change(|model, change| {
            let text = format!("the run has ended: {}", shown(&outcome.statement, SENTENCE));
            let head = model.head.touch(change);
            if head.phase == Phase::Ended {
                return;
            }
            head.phase = Phase::Ended;
            head.ends = None;
            head.outcome = Some(Outcome {
                verdict: outcome.verdict,
                statement: shown(&outcome.statement, SENTENCE),
                report: shown(&outcome.report, SENTENCE),
            });
            model.test.set(None, change);
            model.question.set(None, change);
            model.line("run", text, None);
        });
    }

    /// The run could not be carried out to its end.
    pub fn breaks_off(&self) {
        self.ended(Outcome {
            verdict: "none".to_owned(),
            statement: "The run could not be carried out; the terminal says why.".to_owned(),
            report: "none".to_owned(),
        });
    }

    /// Ends when something has changed since it was asked for.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.0.changed.subscribe()
    }

    /// What has changed since a change, with the number of the last one, and whether nothing will change any more. All of it
    /// since change 0.
    pub(crate) fn since(&self, seen: u64) -> (u64, Value, bool) {
        let model = self.model();
        (model.change, model.since(seen), model.head.value.phase == Phase::Ended)
    }

    /// A record as JSON, bounded.
    pub(crate) fn record(&self, number: u64) -> Option<String> {
        let entry = {
            let model = self.model();
            let at = model.records.binary_search_by_key(&number, |entry| entry.seq());
            match (at, &model.journal) {
                (Ok(at), _) => Arc::clone(&model.records[at]),
                (Err(_), Some(journal)) => journal.get(number)?,
                (Err(_), None) => return None,
            }
        };
        let record = serde_json::to_value(&entry.record).ok()?;
        let payload = entry.json().and_then(|json| serde_json::to_string_pretty(json).ok());
        let payload = payload.map(|payload| shown(&payload, RECORD));
        let whole = serde_json::to_string_pretty(&record).ok()?;
        Some(json!({ "record": number, "payload": payload, "whole": shown(&whole, RECORD) }).to_string())
    }

    fn change(&self, what: impl FnOnce(&mut Model, u64)) {
        let change = {
            let mut model = self.model();
            model.change += 1;
            let change = model.change;
            what(&mut model, change);
            change
        };
        self.0.changed.send_replace(change);
    }

    fn model(&self) -> MutexGuard<'_, Model> {
        self.0.model.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Model {
    /// The way of the vehicle is shown from here on.
    fn begin_trail(&mut self, change: u64) {
        let (now, trail) = self.vehicle.touch(change);
        *trail = Trail::default();
        trail.goes_on(now);
    }

    /// Keeps in mind where the vehicle was at the records of all findings that are shown.
    fn mark(&mut self) {
        let records = self.findings.value.iter().filter_map(|finding| finding.record);
        let marks = records.map(|record| {
            let known = self.marks.get(&record).cloned().flatten();
            (record, known.or_else(|| self.whereabouts.at(record).cloned()))
        });
        self.marks = marks.collect();
    }

    fn begin_to_run(&mut self, change: u64) {
        if matches!(self.head.value.phase, Phase::Begins | Phase::ExpectsDevice) {
            self.head.touch(change).phase = Phase::Runs;
        }
    }

    fn row(&mut self, test: &str, state: &'static str, why: Option<String>, change: u64) {
        let rows = self.tests.touch(change);
        if let Some(row) = rows.iter_mut().find(|row| row.test == test) {
            row.state = state;
            row.why = why;
        } else if rows.len() < TESTS {
            rows.push(Row {
                test: test.to_owned(),
                state,
                why,
            });
        }
    }

    fn line(&mut self, kind: &'static str, text: String, record: Option<u64>) {
        if self.lines.len() == LINES {
            self.lines.pop_front();
        }
        self.lines.push_back(Line {
            change: self.change,
            at: now(),
            kind,
            text: shown(&text, SENTENCE),
            record,
        });
    }

    fn keep(&mut self, message: Message) {
        let way = message.way;
        self.messages.push_back(message);
        let of_way = self.messages.iter().filter(|kept| kept.way == way).count();
        if of_way > MESSAGES
            && let Some(oldest) = self.messages.iter().position(|kept| kept.way == way)
        {
            self.messages.remove(oldest);
        }
    }

    /// A finding as it is told, with where the vehicle was when it was at fault. One of several requirements, which says why they are undecided, goes without their sentences.
    fn with_what_is_asked(&self, finding: &Finding) -> Value {
        let mut told = json!(finding);
        if let Some(asks) = self.asks.get(&finding.requirement) {
            told["asks"] = shown(asks, SENTENCE).into();
        }
        let spot = finding.record.and_then(|record| self.marks.get(&record)?.as_ref());
        if let Some(spot) = spot.filter(|_| matches!(finding.verdict, Verdict::Fail | Verdict::Warning)) {
            told["spot"] = json!(spot);
        }
        told
    }

    fn count_connections(&mut self, entry: &Entry, change: u64) {
        let open = self.head.value.connections.unwrap_or(0);
        let (open, text) = match entry.event() {
            Event::Opened { .. } => (open + 1, "a connection is opened at the tap".to_owned()),
            Event::Closed { .. } => (open.saturating_sub(1), "a connection at the tap ends".to_owned()),
            Event::Fault { fault } => {
                let fault = serde_json::to_string(fault).unwrap_or_default();
                self.line(
                    "link",
                    format!("the harness changes what the link does: {fault}"),
                    Some(entry.seq()),
                );
                return;
            }
            _ => return,
        };
        self.head.touch(change).connections = Some(open);
        self.line("link", text, Some(entry.seq()));
    }

    fn since(&self, seen: u64) -> Value {
        let seen = if seen < self.begun_anew { 0 } else { seen };
        let mut all = Map::new();
        all.insert("now".to_owned(), now().into());
        all.insert("reset".to_owned(), (seen == 0).into());
        let mut add = |name: &str, changed: u64, value: &dyn Fn() -> Value| {
            if changed > seen || seen == 0 {
                all.insert(name.to_owned(), value());
            }
        };
        add("head", self.head.changed, &|| json!(self.head.value));
        add("test", self.test.changed, &|| json!(self.test.value));
        add("question", self.question.changed, &|| json!(self.question.value));
        add("tests", self.tests.changed, &|| json!(self.tests.value));
        add("findings", self.findings.changed, &|| {
            let findings = self.findings.value.iter();
            findings.map(|finding| self.with_what_is_asked(finding)).collect()
        });
        add("floor", self.floor.changed, &|| json!(self.floor.value));
        add("vehicle", self.vehicle.changed, &|| {
            let (vehicle, trail) = &self.vehicle.value;
            let mut value = json!(vehicle);
            value["trail"] = json!(trail.places());
            value
        });
        add("fleet", self.fleet.changed, &|| json!(self.fleet.value));
        let messages = self.messages.iter().filter(|message| message.change > seen);
        all.insert("messages".to_owned(), messages.map(Message::shown).collect());
        let lines = self.lines.iter().filter(|line| line.change > seen);
        all.insert("lines".to_owned(), lines.map(Line::shown).collect());
        Value::Object(all)
    }
}

fn worst_first(findings: Vec<Finding>) -> Vec<Finding> {
    let mut all: Vec<Finding> = findings.into_iter().map(Finding::cut).collect();
    all.sort_by_key(|finding| std::cmp::Reverse(finding.verdict));
    all.truncate(FINDINGS);
    all
}
