//! Performs the steps of a test over a link.
//!
//! The engine sends, moves the mark, and waits for exactly as long as the judge says it makes sense. It
//! decides nothing: every occurrence and everything it does itself goes into the journal, and the verdict
//! comes from there. The only async logic of a test is here.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod certificate_files;
mod compose;
mod compose_error;
mod flood;
mod ids;
mod manner;
mod map_file;
mod operator;
mod operator_steps;
mod recorder;
mod route;
mod serving;
pub mod vehicle;

use std::sync::Arc;
use std::time::Duration;

use serde_json::{Map, Value, json};

use certificate_files::CertificateFiles;

pub use compose::Composer;
pub use compose_error::ComposeError;
pub use ids::IdForm;
pub use manner::{Manner, Manners};
pub use operator::{Asks, HookOutcome, Operator};
pub use recorder::{Onlooker, RecordError, Recorder};

use tck_base::clock::Moment;
use tck_base::device::Publication;
use tck_journal::event::{Event, Occurrence, Payload, StepEnd};
use tck_judge::{JudgeError, Progress, Sign, TestJudge};
use tck_net::bench::LinkError;
use tck_net::link::Link;
use tck_pack::HookEffect;
use tck_suite::model::{Purpose, Section, Step, Test, Verb, place_in_body};

/// More time than this is not left between two orders.
const LONGEST_INTERVAL: Duration = Duration::from_secs(10);

/// Why a run cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// The link broke.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The journal cannot be written or judged.
    #[error(transparent)]
    Record(#[from] RecordError),
}

impl From<JudgeError> for EngineError {
    fn from(error: JudgeError) -> Self {
        Self::Record(RecordError::Judge(error))
    }
}

/// Tells what is being waited for; the terminal shows it.
pub trait Watcher {
    /// A step has begun to wait.
    fn waiting(&mut self, step: &Step);

    /// What the step waits for has to come within this time.
    fn awaits(&mut self, left: Duration) {
        let _ = left;
    }

    /// The device has just gone, as far as it shows; the text says how.
    fn gone(&mut self, how: &str) {
        let _ = how;
    }
}

/// Performs tests.
pub struct Engine<L, O> {
    /// The bench.
    pub link: L,
    /// Hooks and people.
    pub operator: O,
    /// Journal and judge.
    pub recorder: Recorder,
    /// Makes messages.
    pub composer: Composer,
    /// Whether the postamble of a test tries to cancel what the test has left. Set to false once the device
    /// is known not to obey and there is another way to get it back.
    pub cancels: bool,
    /// Map files the device can read; without one, ours are served.
    pub map_files: Vec<bytes::Bytes>,
    /// What the device is given as its certificate.
    certificate_files: CertificateFiles,
    /// Which time a test is run, where tests are repeated.
    pub repetition: Option<u32>,
    /// Whether nobody has answered a question of the test that runs, or ran last.
    pub unanswered: bool,
    /// Whether it was waited in vain, at the end of a test, for a device to call off what the test has left.
    cancelled_in_vain: bool,
    /// When the last order was sent.
    last_order: Option<Moment>,
    /// The record since which the device was last said to be gone.
    told_gone: Option<u64>,
    interrupt: tokio::sync::watch::Receiver<bool>,
}

impl<L: Link, O: Operator> Engine<L, O> {
    /// An engine that stops at the next step when `interrupt` turns true.
    pub fn new(
        link: L,
        operator: O,
        recorder: Recorder,
        composer: Composer,
        interrupt: tokio::sync::watch::Receiver<bool>,
    ) -> Self {
        Self {
            link,
            operator,
            recorder,
            composer,
            cancels: true,
            map_files: Vec::new(),
            certificate_files: CertificateFiles::default(),
            repetition: None,
            unanswered: false,
            cancelled_in_vain: false,
            last_order: None,
            told_gone: None,
            interrupt,
        }
    }

    /// Whether the user has asked to stop, or the device floods the harness.
    pub fn interrupted(&self) -> bool {
        *self.interrupt.borrow() || self.recorder.flood().is_some()
    }

    /// Records something the harness itself did or found.
    pub fn note(&mut self, event: Event) -> Result<u64, EngineError> {
        let occurrence = Occurrence::harness(self.link.now(), event);
        Ok(self.recorder.record(occurrence)?.seq())
    }

    /// Records everything that has already happened. A device that talks without end does not hold it up: what comes
    /// meanwhile is left for later.
    pub async fn drain(&mut self) -> Result<(), EngineError> {
        let now = self.link.now().moment;
        while let Some(occurrence) = self.link.next(now).await? {
            let later = occurrence.at.moment > now;
            self.recorder.record(occurrence)?;
            if later {
                break;
            }
        }
        Ok(())
    }

    /// Records what happens until `done` says so, or until `until`. Returns whether `done` said so.
    pub async fn watch(&mut self, until: Moment, mut done: impl FnMut(&Recorder) -> bool) -> Result<bool, EngineError> {
        loop {
            if done(&self.recorder) {
                return Ok(true);
            }
            if self.interrupted() {
                return Ok(false);
            }
            let happened = tokio::select! {
                biased;
                happened = self.link.next(until) => happened?,
                _ = self.interrupt.changed() => continue,
            };
            match happened {
                Some(occurrence) => {
                    let later = occurrence.at.moment > until;
                    self.recorder.record(occurrence)?;
                    if later {
                        return Ok(done(&self.recorder));
                    }
                }
                None => return Ok(done(&self.recorder)),
            }
        }
    }

    /// Runs one test. `own` are the variables of this test: `course`, `run`.
    pub async fn run_test(
        &mut self,
        test: &Arc<Test>,
        own: Map<String, Value>,
        watcher: &mut dyn Watcher,
    ) -> Result<(), EngineError> {
        self.drain().await?;
        self.composer.begin_test();
        self.note(Event::TestBegun {
            test: test.id.clone(),
            bindings: Value::Object(own),
            repetition: self.repetition,
        })?;
        let outcome = self.sections(test, watcher).await;
        self.note(Event::TestEnded { test: test.id.clone() })?;
        outcome
    }

    async fn sections(&mut self, test: &Arc<Test>, watcher: &mut dyn Watcher) -> Result<(), EngineError> {
        let version = self.recorder.judge().ground().pack.version;
        let mut outcome = Ok(());
        let begun = self.last_seq();
        for (section, steps) in test.sections() {
            let mut spared = None;
            let mut goes_on_at = 0;
            for step in steps {
                if place_in_body(&step.path).is_some_and(|at| at < goes_on_at) {
                    continue;
                }
                if step.spec.as_ref().is_some_and(|spec| !spec.contains(version)) {
                    continue;
                }
                let passed_over = match step.purpose.filter(|_| section == Section::Finally) {
                    Some(Purpose::Cancels) => *spared.get_or_insert_with(|| self.spares_cancelling(begun)),
                    Some(Purpose::CallsOff) => *spared.get_or_insert_with(|| self.spares_calling_off(begun)),
                    Some(Purpose::DrivesOn) => self.device_is_gone(),
                    // A master control has to hear that the vehicle is done before somebody moves it.
                    Some(Purpose::Waits | Purpose::Undoes) | None => false,
                };
                if passed_over || (section == Section::Finally && self.is_releasing(step) && self.is_released(begun)) {
                    continue;
                }
                let goes_on = self
                    .recorder
                    .judge()
                    .current()
                    .is_some_and(|judge| judge.goes_on(section));
                let stop = section != Section::Finally && self.interrupted();
                if !goes_on || stop || (outcome.is_err() && section != Section::Finally) {
                    break;
                }
                watcher.waiting(step);
                match self.step(step, section, watcher).await {
                    Ok(StepEnd::Refused(_) | StepEnd::Declined(_)) => {
                        goes_on_at = test.goes_on_at(&step.path).unwrap_or(0);
                    }
                    Ok(_) => {}
                    Err(error) => {
                        // The postamble is still tried: a device must not be left driving.
                        outcome = outcome.and(Err(error));
                        break;
                    }
                }
            }
        }
        outcome
    }

    fn last_seq(&self) -> u64 {
        self.recorder.journal().last_seq()
    }

    /// Whether nothing would come of cancelling: the device is gone, is known not to obey, or has said since the last
    /// message of this test that it has nothing to do. A device that leaves a cancelOrder without an order unanswered
    /// would otherwise cost a time limit after every test.
    fn spares_cancelling(&self, begun: u64) -> bool {
        let judge = self.recorder.judge();
        let entries = self.recorder.journal().entries();
        let sent = entries
            .iter()
            .rev()
            .find(|entry| matches!(entry.event(), Event::Sent { .. }));
        let since = sent.map_or(begun, |entry| entry.seq().max(begun));
        !self.cancels || self.device_is_gone() || vehicle::is_idle_since(judge, since)
    }

    /// Whether the master control has nothing left to call off: the vehicle is idle, was not told to be awkward, which
    /// may have kept it from what the master control still wants, and an order has come since the last thing asked for.
    fn spares_calling_off(&self, begun: u64) -> bool {
        let judge = self.recorder.judge();
        let entries = self.recorder.journal().beside_messages();
        let mut own = entries.rev().take_while(|entry| entry.seq() > begun);
        let answered = judge.timeline().of("order").last().map_or(0, |order| order.seq());
        let open = own.any(|entry| match entry.event() {
            Event::Vehicle { .. } => true,
            Event::Hook { .. } => entry.seq() > answered,
            _ => false,
        });
        !open && vehicle::has_nothing_to_do(judge)
    }

    /// Whether a hook releases a pressed emergency stop.
    fn releases(&self, hook: &str) -> bool {
        let ground = self.recorder.judge().ground();
        let hook = ground.hooks.find(hook, ground.role);
        hook.is_some_and(|hook| hook.has(HookEffect::ReleasesEmergencyStop))
    }

    fn is_releasing(&self, step: &Step) -> bool {
        matches!(&*step.verb, Verb::Operator(operator) if self.releases(&operator.hook))
    }

    /// Whether this test has released the emergency stop already, and the device has shown that since: nobody is asked twice.
    fn is_released(&self, begun: u64) -> bool {
        let entries = self.recorder.journal().beside_messages();
        let mut own = entries.rev().take_while(|entry| entry.seq() > begun);
        let last = own.find_map(|entry| match entry.event() {
            Event::Hook { hook, ok: true, .. } => Some((self.releases(hook), entry.seq())),
            Event::Hook { .. } => Some((false, 0)),
            _ => None,
        });
        let Some((true, asked)) = last else { return false };
        let judge = self.recorder.judge();
        let none = judge.ground().pack.word("emergencyStop.none");
        let state = judge.timeline().since("state", asked).last();
        let stop = state.and_then(|entry| judge.timeline().state(entry)?.emergency_stop());
        stop.is_some() && stop == none
    }

    /// Whether the tap has seen the device go, or it says so itself.
    fn device_is_gone(&self) -> bool {
        let judge = self.recorder.judge();
        let gone = judge.timeline().gone(self.link.now().moment);
        if gone.is_some_and(|gone| matches!(gone.sign, Sign::Said(_))) {
            return true;
        }
        let has_tap = !judge.timeline().of("mqtt/connect").is_empty();
        has_tap && !vehicle::has_open_connection(judge)
    }

    async fn step(&mut self, step: &Step, section: Section, watcher: &mut dyn Watcher) -> Result<StepEnd, EngineError> {
        self.drain().await?;
        tracing::debug!(step = step.path, "begins");
        self.note(Event::StepBegun {
            path: step.path.clone(),
        })?;
        let done = self.perform(step, section, watcher).await;
        let end = match &done {
            // The test is left for it, and the run may go on.
            Ok(StepEnd::Interrupted) if !*self.interrupt.borrow() => match self.recorder.flood() {
                Some(why) => StepEnd::Refused(why.to_owned()),
                None => StepEnd::Interrupted,
            },
            Ok(end) => end.clone(),
            Err(error) => StepEnd::Broken(error.to_string()),
        };
        if let Err(error) = &done {
            self.note(Event::Trouble {
                text: error.to_string(),
            })?;
        }
        self.note(Event::StepEnded {
            path: step.path.clone(),
            end: end.clone(),
        })?;
        done.map(|_| end)
    }

    async fn perform(
        &mut self,
        step: &Step,
        section: Section,
        watcher: &mut dyn Watcher,
    ) -> Result<StepEnd, EngineError> {
        if let Some(declined) = self.ask_again(step, section).await? {
            return Ok(declined);
        }
        match &*step.verb {
            Verb::Send(send) => {
                if send.topic == "order" {
                    self.space_orders().await?;
                }
                let version = self.recorder.judge().ground();
                let composed = match self.recorder.judge().current() {
                    Some(test) => self.composer.compose(send, test.bindings(), version, self.link.now()),
                    None => return Ok(StepEnd::Broken("no test is running".to_owned())),
                };
                let composed = match composed {
                    Ok(composed) => composed,
                    Err(error) => return Ok(StepEnd::Broken(error.to_string())),
                };
                let mark = self.mark(step)?;
                for (name, id) in composed.actions {
                    self.bind(&name, json!({ "id": id, "sent": mark }))?;
                }
                self.publish(composed.message).await?;
                Ok(StepEnd::Decided)
            }
            Verb::Link(link) => {
                self.mark(step)?;
                self.note(Event::Fault {
                    fault: link.fault.clone(),
                })?;
                self.link.fault(link.fault.clone()).await?;
                Ok(StepEnd::Decided)
            }
            Verb::Serve(serve) => self.serve(serve).await,
            Verb::Operator(operator) => {
                self.mark(step)?;
                let calls_off = step.purpose == Some(Purpose::CallsOff);
                self.operate(operator, (section, calls_off)).await
            }
            Verb::Vehicle(vehicle) => self.vehicle_step(vehicle, step).await,
            Verb::Retained(retained) => {
                let topic = self.recorder.judge().ground().topics.get(&retained.topic).cloned();
                let Some(topic) = topic else {
                    return Ok(StepEnd::Broken(format!("there is no topic {}", retained.topic)));
                };
                self.link.fresh_subscriber(&topic).await?;
                self.wait(section, None, watcher).await
            }
            Verb::Expect(_) | Verb::Never(_) | Verb::Always(_) | Verb::Action(_) => {
                let cancels = section == Section::Finally && step.purpose == Some(Purpose::Cancels);
                let at_most = (cancels && self.cancelled_in_vain).then(|| self.link.now().moment + self.react());
                let end = self.wait(section, at_most, watcher).await?;
                // In virtual time nobody waits.
                if cancels && end == StepEnd::Deadline && at_most.is_none() && !self.operator.runs_on_the_link() {
                    self.cancelled_in_vain = true;
                    let text =
                        "it was waited in vain for the device to call off what a test had left; from here on it is \
                                waited for no longer than `time.react`"
                            .to_owned();
                    self.note(Event::Note { text })?;
                }
                Ok(end)
            }
        }
    }

    pub(crate) fn mark(&mut self, step: &Step) -> Result<u64, EngineError> {
        self.note(Event::Mark {
            path: step.path.clone(),
        })
    }

    pub(crate) fn bind(&mut self, name: &str, value: Value) -> Result<(), EngineError> {
        self.note(Event::Bound {
            name: name.to_owned(),
            value,
        })?;
        Ok(())
    }

    /// Waits until the vehicle may be sent another order: its factsheet says how much time it needs between two
    /// (`minOrderInterval`, FACT-13). One that asks for more than [`LONGEST_INTERVAL`] is not given more.
    async fn space_orders(&mut self) -> Result<(), EngineError> {
        let factsheet = self.recorder.judge().ground().factsheet();
        let stated = factsheet.and_then(|sheet| {
            let seconds = sheet.timing()?.min_order_interval.float()?;
            Duration::try_from_secs_f64(seconds).ok()
        });
        let (Some(interval), Some(last)) = (stated, self.last_order) else {
            return Ok(());
        };
        let until = last + interval.min(LONGEST_INTERVAL);
        if until > self.link.now().moment {
            self.watch(until, |_| false).await?;
        }
        Ok(())
    }

    /// Publishes a message of the harness, journal first.
    pub async fn publish(&mut self, message: Publication) -> Result<(), EngineError> {
        let is_order = self.recorder.judge().ground().topics.get("order") == Some(&message.topic);
        if is_order {
            self.space_orders().await?;
            self.last_order = Some(self.link.now().moment);
        }
        self.note(Event::Sent {
            topic: message.topic.clone(),
            qos: message.qos,
            retain: message.retain,
            payload: Payload::keep(message.payload.clone()),
        })?;
        self.link.publish(message).await?;
        Ok(())
    }

    /// How long a device may take to react.
    fn react(&self) -> Duration {
        let times = self.recorder.judge().ground().bindings.get("time");
        let react = times.and_then(|times| times.get("react")).and_then(Value::as_u64);
        react.map_or(LONGEST_INTERVAL, Duration::from_millis)
    }

    /// Waits for what the judge says, and no longer; `at_most` ends it before.
    async fn wait(
        &mut self,
        section: Section,
        at_most: Option<Moment>,
        watcher: &mut dyn Watcher,
    ) -> Result<StepEnd, EngineError> {
        let mut probed = false;
        let mut told = None;
        loop {
            self.tell_gone(watcher);
            let Some(test) = self.recorder.judge().current() else {
                return Ok(StepEnd::Broken("no test is running".to_owned()));
            };
            let Some(until) = time_for(test, probed) else {
                return Ok(StepEnd::Decided);
            };
            let until = at_most.map_or(until, |end| end.min(until));
            let probing = matches!(test.progress(), Progress::NeedsProbe(_)) && !probed;
            // The postamble runs even when the user has asked to stop: a device must not be left driving.
            if self.recorder.flood().is_some() || (section != Section::Finally && self.interrupted()) {
                return Ok(StepEnd::Interrupted);
            }
            let now = self.link.now().moment;
            if told != Some(until) {
                told = Some(until);
                watcher.awaits(until.since(now));
            }
            let silence = self.recorder.judge().timeline().falls_silent();
            let silence = silence.filter(|silence| *silence > now && *silence < until);
            let happened = tokio::select! {
                biased;
                happened = self.link.next(silence.unwrap_or(until)) => happened?,
                changed = self.interrupt.changed(), if section != Section::Finally => {
                    if changed.is_err() {
                        return Ok(StepEnd::Interrupted);
                    }
                    continue;
                }
            };
            if let Some(occurrence) = happened {
                let now = occurrence.at.moment;
                self.recorder.record(occurrence)?;
                // The time is up even if a device never stops talking.
                let test = self.recorder.judge().current();
                let is_in_time = |until: Moment| now <= at_most.map_or(until, |end| end.min(until));
                if test.is_some_and(|test| time_for(test, probed).is_none_or(is_in_time)) {
                    continue;
                }
            } else if silence.is_some() {
                continue;
            }
            if !probing {
                return Ok(StepEnd::Deadline);
            }
            probed = true;
            let probe = self.link.probe().await?;
            self.note(Event::ProbeSent { probe })?;
        }
    }

    /// Says that the device is gone, once for each time.
    fn tell_gone(&mut self, watcher: &mut dyn Watcher) {
        let gone = self.recorder.judge().timeline().gone(self.link.now().moment);
        let since = gone.as_ref().map(|gone| gone.since.0);
        if let Some(gone) = gone.filter(|_| since != self.told_gone) {
            self.told_gone = since;
            watcher.gone(&gone.to_string());
        }
    }
}

/// Until when a step has to be waited for; `None` when it is decided.
fn time_for(test: &TestJudge, probed: bool) -> Option<Moment> {
    match test.progress() {
        Progress::Decided => None,
        Progress::Pending(until) => Some(until),
        Progress::NeedsProbe(ends) if !probed => Some(ends),
        Progress::NeedsProbe(ends) => Some(test.probe_until().unwrap_or(ends)),
    }
}
