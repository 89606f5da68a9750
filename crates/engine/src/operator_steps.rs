//! What is done to the device and to the mock AGVs by other means than messages: hooks of the profile, natural traffic,
//! and the words of `vehicle:`.

use std::time::Duration;

use serde_json::{Map, Value};

use super::vehicle::has_any_open_connection;
use super::{Engine, EngineError, HookOutcome, Operator, operator};
use tck_base::clock::Moment;
use tck_journal::event::{Event, Occurrence, Source, StepEnd};
use tck_net::link::Link;
use tck_pack::{HookEffect, Role};
use tck_profile::show_duration;
use tck_suite::model::{Section, Step, VehicleStep, Which};

/// What the bindings of a run call the serial number of a vehicle.
const SERIAL_NUMBER: &str = "serialNumber";

impl<L: Link, O: Operator> Engine<L, O> {
    pub(super) async fn operate(
        &mut self,
        operator: &tck_suite::model::Operator,
        (section, calls_off): (Section, bool),
    ) -> Result<StepEnd, EngineError> {
        if !operator.each {
            return self.operate_once(operator, (section, calls_off), None).await;
        }
        let fleet = self.recorder.judge().ground().bindings.get("fleet").cloned();
        for vehicle in fleet.iter().filter_map(Value::as_array).flatten() {
            self.bind("each", vehicle.clone())?;
            let serial = vehicle.get(SERIAL_NUMBER).and_then(Value::as_str).map(str::to_owned);
            let end = self.operate_once(operator, (section, calls_off), serial).await?;
            if end != StepEnd::Decided {
                return Ok(end);
            }
        }
        Ok(StepEnd::Decided)
    }

    async fn operate_once(
        &mut self,
        operator: &tck_suite::model::Operator,
        (section, calls_off): (Section, bool),
        each: Option<String>,
    ) -> Result<StepEnd, EngineError> {
        let mut parameters = Map::new();
        if let Some(test) = self.recorder.judge().current() {
            for (name, term) in &operator.with {
                match term.bind(test.bindings()) {
                    Ok(value) => parameters.insert(name.clone(), value),
                    Err(unbound) => return Ok(StepEnd::Broken(unbound.to_string())),
                };
            }
        }
        let within = match (&operator.within, self.recorder.judge().current()) {
            (Some(within), Some(test)) => match within.bind(test.bindings()) {
                Ok(within) => Some(within),
                Err(unbound) => return Ok(StepEnd::Broken(unbound.to_string())),
            },
            _ => None,
        };
        let judge = self.recorder.judge();
        if judge.role() == Role::MasterControl {
            let meant = each.clone().unwrap_or_else(|| judge.ground().identity.1.clone());
            parameters.entry("vehicle").or_insert_with(|| meant.into());
        }
        if let Some(patience) = self.operator.natural_traffic(&operator.hook) {
            let patience = within.map_or(patience, |within| within.min(patience));
            return self.await_traffic(&operator.hook, patience, section).await;
        }
        // What a postamble undoes is undone even when the user has asked to stop.
        let abandons = section != Section::Finally;
        let outcome = self
            .hook_for(&operator.hook, parameters, (abandons, within), each)
            .await?;
        if section != Section::Finally && self.interrupted() {
            return Ok(StepEnd::Interrupted);
        }
        Ok(match outcome {
            HookOutcome::Done(_) => StepEnd::Decided,
            HookOutcome::Failed(why) if self.master_control_is_gone() => StepEnd::Refused(format!(
                "hook `{}` failed, and the master control has no connection any more: {why}",
                operator.hook
            )),
            HookOutcome::Failed(why) => StepEnd::Broken(format!("hook `{}` failed: {why}", operator.hook)),
            // Whoever has nothing to call off refuses with good reason; what follows shows whether that is true.
            HookOutcome::Refused(_) if calls_off => StepEnd::Decided,
            HookOutcome::Refused(why) => StepEnd::Declined(format!(
                "the device refuses what hook `{}` asks for: {why}",
                operator.hook
            )),
            HookOutcome::Skipped(why) | HookOutcome::Unanswered(why) => StepEnd::Skipped(why),
            HookOutcome::Missing => StepEnd::Refused(format!("there is nobody for hook `{}`", operator.hook)),
        })
    }

    /// Asks a master control once more for what it has declined, before a step awaits what comes of it. What it still declines ends
    /// the step.
    pub(super) async fn ask_again(&mut self, step: &Step, section: Section) -> Result<Option<StepEnd>, EngineError> {
        let judge = self.recorder.judge();
        let test = judge.current().filter(|_| section == Section::Steps);
        let Some((operator, why)) = test.and_then(|test| test.declined_before(step, judge.ground()).cloned()) else {
            return Ok(None);
        };
        // What has changed since has to be seen first.
        let settled = self.link.now().moment + judge.ground().time.settle;
        self.watch(settled, |_| false).await?;
        let end = self.operate(&operator, (section, false)).await?;
        Ok((end != StepEnd::Decided).then_some(StepEnd::Refused(why)))
    }

    /// Whether a master control has had connections, and now has none, though nobody keeps it away.
    fn master_control_is_gone(&self) -> bool {
        let judge = self.recorder.judge();
        let connected = !judge.timeline().of("mqtt/connect").is_empty();
        judge.role() == Role::MasterControl && connected && !has_any_open_connection(judge)
    }

    pub(super) async fn vehicle_step(&mut self, vehicle: &VehicleStep, step: &Step) -> Result<StepEnd, EngineError> {
        let mut with = Map::new();
        if let Some(test) = self.recorder.judge().current() {
            for (name, term) in &vehicle.with {
                match term.bind(test.bindings()) {
                    Ok(value) => with.insert(name.clone(), value),
                    Err(unbound) => return Ok(StepEnd::Broken(unbound.to_string())),
                };
            }
        }
        self.mark(step)?;
        let number = match vehicle.of {
            Which::First => 0,
            Which::Second => 1,
        };
        if self.set_vehicle(number, &vehicle.what, with.into()).await? {
            return Ok(StepEnd::Decided);
        }
        Ok(StepEnd::Broken(format!("there is no mock AGV number {}", number + 1)))
    }

    /// Waits for the next order or instant action for the vehicle the tests are about. The mark is moved to just before
    /// it, as if it had been asked for at that moment.
    async fn await_traffic(
        &mut self,
        hook: &str,
        patience: Duration,
        section: Section,
    ) -> Result<StepEnd, EngineError> {
        let judge = self.recorder.judge();
        let commands = judge.ground().pack.topics().iter();
        let commands = commands.filter(|rule| rule.publisher == Role::MasterControl);
        let topics: Vec<String> = commands
            .filter_map(|rule| judge.ground().topics.get(rule.name.as_str()).cloned())
            .collect();
        let until = self.link.now().moment + patience;
        let detail = loop {
            if section != Section::Finally && self.interrupted() {
                return Ok(StepEnd::Interrupted);
            }
            let happened = tokio::select! {
                biased;
                happened = self.link.next(until) => happened?,
                _ = self.interrupt.wait_for(|interrupted| *interrupted), if section != Section::Finally => continue,
            };
            let Some(occurrence) = happened else { break None };
            let came =
                matches!(&occurrence.event, Event::Message { topic, retain: false, .. } if topics.contains(topic));
            if came {
                self.note(Event::Mark {
                    path: format!("natural traffic instead of hook `{hook}`"),
                })?;
            }
            let later = occurrence.at.moment > until;
            let seq = self.recorder.record(occurrence)?.seq();
            if came {
                break Some(format!("#{seq} came by itself"));
            }
            if later {
                break None;
            }
        };
        let ok = detail.is_some();
        let detail =
            detail.unwrap_or_else(|| format!("no order and no instant action came within {}", show_duration(patience)));
        let event = Event::Hook {
            hook: hook.to_owned(),
            ok,
            detail: detail.clone(),
            vehicle: None,
        };
        self.note(event)?;
        Ok(if ok { StepEnd::Decided } else { StepEnd::Broken(detail) })
    }

    /// The hook with this effect that can be run, if there is one.
    pub fn hook_that(&self, effect: HookEffect) -> Option<String> {
        let can_be_run = self.operator.hooks();
        let ground = self.recorder.judge().ground();
        let mut known = ground.hooks.with(effect, ground.role);
        let found = known.find(|name| can_be_run.iter().any(|hook| hook == name))?;
        Some(found.to_owned())
    }

    /// Sets a mock AGV of the harness, journal first. `false` when there is none of that number.
    pub async fn set_vehicle(&mut self, number: usize, what: &str, with: Value) -> Result<bool, EngineError> {
        self.note(Event::Vehicle {
            vehicle: number,
            what: what.to_owned(),
            with: with.clone(),
        })?;
        if self.operator.runs_on_the_link() {
            return Ok(self.link.vehicle(number, what, with));
        }
        Ok(self.operator.vehicle(number, what, with).await)
    }

    /// Runs a hook of the profile while everything that happens goes on being recorded. One that `abandons` is given
    /// up when the user asks to stop.
    pub async fn hook(
        &mut self,
        name: &str,
        parameters: Map<String, Value>,
        abandons: bool,
    ) -> Result<HookOutcome, EngineError> {
        self.hook_for(name, parameters, (abandons, None), None).await
    }

    /// Runs a hook of the profile as [`Self::hook`] does, for one of all mock AGVs, and gives it up after a time if one is
    /// named.
    async fn hook_for(
        &mut self,
        name: &str,
        parameters: Map<String, Value>,
        (abandons, within): (bool, Option<Duration>),
        each: Option<String>,
    ) -> Result<HookOutcome, EngineError> {
        let begun = self.link.now().moment;
        let until = within.map_or(Moment::from_micros(u64::MAX), |within| begun + within);
        let outcome = if self.operator.runs_on_the_link() {
            operator::on_link(&mut self.link, name, &parameters)
        } else {
            if let Some(asks) = self.operator.asks(name, &parameters) {
                let question = Occurrence {
                    at: self.link.now(),
                    source: Source::Operator,
                    direction: None,
                    event: Event::Question {
                        hook: name.to_owned(),
                        text: asks.text,
                        seconds: asks.within.as_secs(),
                    },
                };
                self.recorder.record(question)?;
            }
            let running = self.operator.run(name, parameters);
            tokio::pin!(running);
            loop {
                tokio::select! {
                    outcome = &mut running => break outcome,
                    _ = self.interrupt.wait_for(|interrupted| *interrupted), if abandons => {
                        break HookOutcome::Failed("given up: the user has interrupted the run".to_owned());
                    }
                    happened = self.link.next(until) => match (happened?, within) {
                        (Some(occurrence), _) => drop(self.recorder.record(occurrence)?),
                        (None, Some(within)) if self.link.now().moment >= until => {
                            break HookOutcome::Failed(format!("not done within {}", show_duration(within)));
                        }
                        (None, _) => {}
                    },
                }
            }
        };
        let (ok, detail) = match &outcome {
            HookOutcome::Done(detail) => (true, detail.clone()),
            HookOutcome::Failed(detail)
            | HookOutcome::Refused(detail)
            | HookOutcome::Skipped(detail)
            | HookOutcome::Unanswered(detail) => (false, detail.clone()),
            HookOutcome::Missing => (false, "no such hook".to_owned()),
        };
        self.unanswered |= matches!(outcome, HookOutcome::Unanswered(_));
        tracing::debug!(hook = name, ok, detail, "was run");
        let occurrence = Occurrence {
            at: self.link.now(),
            source: Source::Operator,
            direction: None,
            event: Event::Hook {
                hook: name.to_owned(),
                ok,
                detail,
                vehicle: each,
            },
        };
        self.recorder.record(occurrence)?;
        Ok(outcome)
    }
}
