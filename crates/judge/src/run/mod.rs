//! A whole run, judged from its journal.
//!
//! [`RunJudge`] is shown every entry in order, live by the engine or again from a file, and gives the
//! result at any time. Nothing but the journal and the suites enters it, so judging a journal again gives
//! the same result, byte for byte.

mod conclusion;
mod going_on;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value;

pub use conclusion::RESULT_FORMAT;
pub use going_on::{judge, judged};

use super::clients::{Attribution, ClientClassifier};
use super::delivery::DeliveryEvidence;
use super::hidden::Hidden;
use super::message_tally::MessageTally;
use super::monitor_set::MonitorSet;
use super::on_word::Answers;
use super::program;
use super::reactions::Reactions;
use super::repair::mended;
use super::rules::{JudgeError, Rules};
use super::run_contexts::{Ground, RunContexts};
use super::test::TestJudge;
use super::timeline::{Timeline, TopicOwner};
use tck_base::clock::{Moment, Stamp};
use tck_base::verdict::Verdict;
use tck_journal::event::{Event, Occurrence, Plan, Reading, RunHeader, Waiver};
use tck_journal::{Entry, OwnLatency};
use tck_pack::Role;
use tck_result::{Repetition, TestResult};
use tck_suite::model::{Monitor, Test};
use tck_view::{MessageView, StateView, Topic};

/// Why a run without an end is over.
const BREAKS_OFF: &str = "the journal breaks off here";

/// A run being judged.
pub struct RunJudge {
    rules: Rules,
    header: RunHeader,
    role: Role,
    ground: Ground,
    begun: Stamp,
    last: Stamp,
    /// The number of the last record.
    records: u64,
    timeline: Timeline,
    watches: MonitorSet,
    /// Who is on the tap.
    company: ClientClassifier,
    /// What becomes of the program that the run has started.
    program: program::Watched,
    /// Why nothing is held against the device any more: the run was interrupted.
    interrupted: Option<Arc<str>>,
    /// What the device does not show to have heard, where nobody sees what reaches it.
    unheard: Option<DeliveryEvidence>,
    /// Whether the last entry was left out.
    left_out: bool,
    reactions: Reactions,
    /// Which members and words came by, in this run and in those before it.
    messages: MessageTally,
    /// What a person has said.
    answers: Answers,
    /// The instant actions the harness has sent: type by id.
    instants: BTreeMap<String, String>,
    last_order: Option<(Moment, String)>,
    current: Option<TestJudge>,
    done: Vec<TestResult>,
    /// Which repetition of the running test it is, where tests are repeated.
    repetition: Option<u32>,
    /// The run that broke off and that this one goes on with.
    earlier: Option<Box<Self>>,
    plan: Plan,
    end: Option<(bool, Option<String>)>,
    /// How long the harness took itself.
    latency: Option<OwnLatency>,
    /// Another device spoke than the one that was to be judged.
    is_stranger: bool,
}

impl RunJudge {
    /// Begins with the first entry of a journal.
    pub fn begin(rules: &Rules, first: &Entry) -> Result<Self, JudgeError> {
        let Event::RunBegun { header } = first.event() else {
            return Err(JudgeError::NoHeader);
        };
        let header = (**header).clone();
        let RunContexts { role, ground, vehicles } = RunContexts::of(rules, &header)?;
        let tap = header.vantage == "tap";
        let monitors: Vec<&Arc<Monitor>> = rules
            .suites
            .monitors
            .iter()
            .filter(|monitor| monitor.device.is_none_or(|device| device == role))
            .collect();
        let watches = MonitorSet::begin(&monitors, &ground, vehicles, tap);
        let reactions = Reactions::of(&header.vehicles);
        let is_unseen = !tap && role == Role::Agv;
        let unheard = is_unseen.then(|| DeliveryEvidence::of(&ground.topics, &ground.pack));
        let company = ClientClassifier::of(role, &header, &ground.pack);
        let timeline = if header.vehicles.is_empty() {
            Timeline::new(&header.topics, &ground.pack)
        } else {
            Timeline::of_vehicles(&header.vehicles, &ground.pack)
        };
        Ok(Self {
            rules: rules.clone(),
            timeline,
            messages: MessageTally::new(&ground.pack),
            answers: Answers::default(),
            header,
            role,
            ground,
            begun: first.at(),
            last: first.at(),
            records: first.seq(),
            watches,
            company,
            program: program::Watched::default(),
            interrupted: None,
            unheard,
            reactions,
            instants: BTreeMap::new(),
            last_order: None,
            current: None,
            done: Vec::new(),
            repetition: None,
            earlier: None,
            plan: Plan::default(),
            end: None,
            latency: None,
            is_stranger: false,
            left_out: false,
        })
    }

    /// Whether the last entry was left out, because it is of somebody who is not the device.
    pub fn has_left_out(&self) -> bool {
        self.left_out
    }

    /// Whether nothing would be judged otherwise without this: somebody who is not the device does something that has
    /// nothing to do with it.
    pub fn can_do_without(&self, occurrence: &Occurrence) -> bool {
        self.company.is_dispensable(occurrence)
    }

    /// Shows it the next entry.
    pub fn observe(&mut self, entry: &Arc<Entry>) -> Result<(), JudgeError> {
        self.last = entry.at();
        self.records = entry.seq();
        self.left_out = self.is_of_bystander(entry);
        if self.left_out {
            return Ok(());
        }
        let subject = self.timeline.add(entry);
        if let Some(place) = self.timeline.place(entry) {
            self.reactions.observe(entry, place);
            if let (true, Some(message)) = (self.is_counted(entry, place), entry.json()) {
                self.messages.note(&place.name, message);
            }
        }
        self.watches
            .observe(entry, subject.as_deref(), &self.timeline, &self.ground);
        if self.role == Role::Agv {
            self.note_instants(entry);
        }
        if let Some(unheard) = &mut self.unheard {
            unheard.observe(entry);
        }
        match entry.event() {
            Event::Waived { waiver } => self.ground.waivers.push(waiver.clone()),
            Event::Planned { plan } => self.plan = (**plan).clone(),
            // Outside a test, a variable gets its value for the whole run.
            Event::Bound { name, value } if self.current.is_none() => self.ground.set(name, value.clone()),
            Event::TestBegun {
                test,
                bindings,
                repetition,
            } => {
                self.break_off("the run went on without ending this test");
                let found = self.test(test).ok_or_else(|| JudgeError::UnknownTest(test.clone()))?;
                self.repetition = *repetition;
                self.current = Some(TestJudge::begin(&found, &self.ground, entry, bindings));
            }
            Event::RunEnded {
                partial,
                reason,
                stranger,
                latency,
            } => {
                self.is_stranger = *stranger;
                self.latency = *latency;
                self.break_off(reason.as_deref().unwrap_or("the run ended before the test did"));
                self.end = Some((*partial, reason.clone()));
                self.watches.finish(entry.at().moment, &self.ground);
            }
            _ => {}
        }
        if let Some(test) = self.current.as_ref().map(|current| current.result().id.as_str()) {
            self.answers.observe(entry, test);
        }
        if let Some(current) = &mut self.current {
            if matches!(entry.event(), Event::TestEnded { .. }) {
                current.hide(hidden(&self.watches, &self.ground.waivers));
                if let Some(why) = self.unheard.as_ref().and_then(DeliveryEvidence::why) {
                    current.interfered(&why);
                }
            }
            current.observe(entry, subject.as_deref(), &self.timeline, &self.ground);
        }
        if matches!(entry.event(), Event::TestEnded { .. })
            && let Some(current) = self.current.take()
        {
            self.ended(current.result().clone());
        }
        Ok(())
    }

    /// Whether an entry is about somebody on the tap who is not the device. What was left out of a client that turns out to be
    /// the device is made up for.
    fn is_of_bystander(&mut self, entry: &Arc<Entry>) -> bool {
        let part = self.company.observe(entry);
        let present = self.company.interference(entry.at().moment).cloned();
        if let (Some(why), Some(current)) = (&present, &mut self.current) {
            current.interfered(why);
        }
        if *entry.event() == Event::Interrupted && self.interrupted.is_none() {
            let why = interrupted(entry);
            if let Some(current) = &mut self.current {
                current.interrupted(entry.seq(), &why);
            }
            self.interrupted = Some(why);
        }
        let is_interrupted = self.interrupted.is_some();
        let harm = self.company.harm(entry.at().moment);
        self.program.observe(entry, harm.map(AsRef::as_ref), is_interrupted);
        self.ground.interference = self.interrupted.clone().or(present);
        self.ground.is_interrupted = is_interrupted;
        match part {
            Attribution::Judged => false,
            Attribution::Bystander => true,
            Attribution::Joined(before) => {
                for entry in &before {
                    let subject = self.timeline.restore(entry);
                    self.watches
                        .observe(entry, subject.as_deref(), &self.timeline, &self.ground);
                }
                false
            }
        }
    }

    /// Whether a record is a message that counts for the message coverage: once where it came or was sent, and not once more
    /// as a packet, and of a vehicle that speaks the version of the run.
    fn is_counted(&self, entry: &Entry, place: &TopicOwner) -> bool {
        let vehicle = self.header.vehicles.get(place.vehicle);
        let version = vehicle.and_then(|vehicle| vehicle.protocol.as_ref());
        matches!(entry.event(), Event::Message { .. } | Event::Sent { .. })
            && version.is_none_or(|version| *version == self.header.protocol)
    }

    fn note_instants(&mut self, entry: &Entry) {
        let Event::Sent { topic, .. } = entry.event() else {
            return;
        };
        let topics = &self.ground.topics;
        let name = topics.iter().find_map(|(name, full)| (full == topic).then_some(name));
        let topic = name.map_or(Topic::Other, |name| Topic::of_name(name));
        let message = self.timeline.view(entry, topic);
        if topic == Topic::Order {
            let id = message.and_then(|message| message.order()?.order_id.text());
            self.last_order = id.map(|id| (entry.at().moment, id.to_owned()));
        }
        for action in message
            .and_then(MessageView::instant_actions)
            .iter()
            .flat_map(|all| &all.actions)
        {
            if let (Some(id), Some(kind)) = (action.action_id.text(), action.action_type.text()) {
                self.instants.insert(id.to_owned(), kind.to_owned());
            }
        }
    }

    /// Keeps the result of a test. One that was tried before and decided nothing is replaced.
    fn ended(&mut self, mut result: TestResult) {
        let decided = |result: &TestResult| {
            let mut decisions = result.decisions.iter();
            decisions.any(|decision| decision.verdict() != Verdict::Inconclusive)
        };
        self.number(&mut result);
        let number = |result: &TestResult| result.repetitions.first().map(|one| one.number);
        let same = |done: &TestResult| done.id == result.id && number(done) == number(&result);
        let before = self.done.iter().position(|done| same(done) && !decided(done));
        if let Some(before) = before {
            let before = self.done.remove(before);
            let why = before.reason.unwrap_or_else(|| "it decided nothing".to_owned());
            result.allowances.push(format!("tried again, since at first: {why}"));
        }
        self.done.push(result);
    }

    /// Notes which repetition a result is of.
    fn number(&self, result: &mut TestResult) {
        result.repetitions = self
            .repetition
            .map(|number| Repetition {
                number,
                verdict: result.verdict,
                seconds: result.seconds,
                reason: result.reason.clone(),
                journal: result.journal,
            })
            .into_iter()
            .collect();
    }

    /// What the vehicle says of itself: the last state of its present connection, read as it is meant.
    pub fn state(&self) -> Option<Arc<StateView>> {
        let entry = self.timeline.present("state")?;
        let Some((meant, _)) = mended(entry, &self.timeline, &self.ground.waivers) else {
            return self.timeline.state(entry).map(Arc::clone);
        };
        let meant = MessageView::of_value(Topic::State, &meant, self.timeline.names());
        meant.state().map(Arc::clone)
    }

    /// The JSON of what [`RunJudge::state`] shows, to quote it.
    pub fn state_json(&self) -> Option<Cow<'_, Value>> {
        let entry = self.timeline.present("state")?;
        Some(match mended(entry, &self.timeline, &self.ground.waivers) {
            Some((meant, _)) => Cow::Owned(meant),
            None => Cow::Borrowed(entry.json()?),
        })
    }

    /// The order the harness has sent last: when, and its id.
    pub fn last_order(&self) -> Option<&(Moment, String)> {
        self.last_order.as_ref()
    }

    /// The type of an instant action of the harness, by its id.
    pub fn sent_instant(&self, id: &str) -> Option<String> {
        self.instants.get(id).cloned()
    }

    /// The members of the state that show nothing, by what monitors have found in this run: member and requirement.
    pub fn accused(&self) -> Vec<(String, String)> {
        self.watches.accused()
    }

    /// The journal is at its end without `RunEnded`, as after a crash.
    pub fn break_off_run(&mut self, why: &str) {
        if self.end.is_none() {
            self.break_off(why);
            self.end = Some((true, Some(why.to_owned())));
            self.watches.finish(self.last.moment, &self.ground);
        }
    }

    fn break_off(&mut self, why: &str) {
        if let Some(mut current) = self.current.take() {
            current.hide(hidden(&self.watches, &self.ground.waivers));
            if let Some(why) = self.unheard.as_ref().and_then(DeliveryEvidence::why) {
                current.interfered(&why);
            }
            let mut result = current.break_off(self.last.moment, why, &self.ground);
            self.number(&mut result);
            self.done.push(result);
        }
    }

    fn test(&self, id: &str) -> Option<Arc<Test>> {
        self.rules
            .suites
            .tests
            .iter()
            .find(|test| test.id == id && test.device == self.role)
            .cloned()
    }

    /// Whether the journal says that the run was interrupted.
    pub fn is_interrupted(&self) -> bool {
        self.interrupted.is_some()
    }

    /// How the program that the run has started has ended by itself, as long as it was not started again.
    pub fn program_is_down(&self) -> Option<&str> {
        self.program.is_down()
    }

    /// The test that is running.
    pub fn current(&self) -> Option<&TestJudge> {
        self.current.as_ref()
    }

    /// The side under test.
    pub fn role(&self) -> Role {
        self.role
    }

    /// The tests that have ended.
    pub fn done(&self) -> &[TestResult] {
        &self.done
    }

    /// Everything by subject.
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// What does not change during the run.
    pub fn ground(&self) -> &Ground {
        &self.ground
    }
}

/// Why nothing is held against the device after this entry.
pub(super) fn interrupted(entry: &Entry) -> Arc<str> {
    format!("the run was interrupted (#{})", entry.seq()).into()
}

/// Members of the states that monitors found unreliable in a test, or that are known to be so from before: what is
/// asserted on them is inconclusive.
fn hidden(watches: &MonitorSet, waivers: &[Waiver]) -> Vec<Hidden> {
    let mut all = watches.hidden();
    let kept = waivers.iter().filter(|waiver| waiver.reading == Reading::Kept);
    all.extend(kept.map(|waiver| Hidden {
        member: waiver.member.clone(),
        monitor: "a monitor, earlier in this run".to_owned(),
        requirement: waiver.about.first().cloned().unwrap_or_default(),
        decides: waiver.about.clone(),
        seq: 0,
        lasting: true,
        elements: None,
    }));
    all
}
