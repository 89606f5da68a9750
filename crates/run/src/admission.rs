//! Before the first test: the device is there, and has said what it can do.

use std::time::Duration;

use serde_json::{Value, json};

use super::identity::{other_version, somebody_else};
use super::presence::{Presence, is_stale};
use super::session::Session;
use super::sheet::Sheet;
use tck_engine::{EngineError, Operator, Recorder};
use tck_journal::event::Event;
use tck_net::link::Link;
use tck_pack::Role;
use tck_profile::show_duration;
use tck_view::{Field, Header, MapState, Position, StateView};

/// How often a person is told what is waited for.
const TOLD_EVERY: Duration = Duration::from_secs(10);

impl<L: Link, O: Operator> Session<'_, L, O> {
    /// Waits for the device, its first state and its factsheet. `Err` says why it cannot be judged.
    pub(super) async fn admit(&mut self) -> Result<Result<(), String>, EngineError> {
        let vantage = self.setup.capabilities.vantage;
        let patience = self.time("connect");
        // A program that has ended connects no more.
        let there = |recorder: &Recorder| {
            recorder.judge().program_is_down().is_some() || Presence::of(recorder.judge(), vantage).is_there()
        };
        let came = self.wait_for(patience, there).await?;
        if let Some(why) = self.program_is_down() {
            return Ok(Err(why));
        }
        if !came {
            return Ok(Err(format!("no device connected within {}", show_duration(patience))));
        }
        if let Err(why) = self.after_start().await? {
            return Ok(Err(why));
        }
        if self.engine.recorder.judge().role() == Role::MasterControl {
            return self.settle_in().await;
        }
        let begun = self.engine.recorder.journal().last_seq();
        let is_virtual = self.engine.operator.runs_on_the_link();
        let has_state = |recorder: &Recorder| {
            let states = recorder.judge().timeline().of("state");
            states.iter().any(|entry| !is_stale(entry))
        };
        let speaks = |recorder: &Recorder| {
            let judge = recorder.judge();
            let is_over = judge.program_is_down().is_some() || (!is_virtual && somebody_else(judge).is_some());
            is_over || has_state(recorder)
        };
        let patience = self.time("statePeriod");
        self.wait_for(patience, speaks).await?;
        if let Some(why) = self.program_is_down() {
            return Ok(Err(why));
        }
        if !has_state(&self.engine.recorder) {
            let why = format!(
                "the device connected (see #{begun}) but sent no state within {} on {}",
                show_duration(patience),
                self.topic("state")
            );
            return Ok(Err(why));
        }
        if let Some(why) = self.somebody_else() {
            return Ok(Err(why));
        }
        self.factsheet().await?;
        if let Some(why) = self.is_another() {
            return Ok(Err(why));
        }
        self.setup.fit_layout();
        self.active_map()?;
        self.home.first = self.engine.recorder.judge().state();
        self.home.before.clone_from(&self.home.first);
        self.read_over(self.engine.link.now().moment).await?;
        Ok(Ok(()))
    }

    /// How the program that the run has started has ended by itself, as long as it was not started again.
    pub(super) fn program_is_down(&self) -> Option<String> {
        self.engine.recorder.judge().program_is_down().map(str::to_owned)
    }

    /// What the device says otherwise of itself than in the run that this one goes on with.
    pub(super) fn is_another(&self) -> Option<String> {
        let judge = self.engine.recorder.judge();
        self.setup.capabilities.factsheet.as_ref()?;
        let now = judge.ground().factsheet_json()?;
        let (place, before, now) = difference(judge.factsheet_before()?, now)?;
        Some(format!(
            "the run cannot be resumed: `{place}` of the factsheet was {before}, and is {now} now"
        ))
    }

    /// Who speaks instead of the device of the profile, or which other version it speaks. A built-in device in virtual time is
    /// wrong on purpose.
    pub(super) fn somebody_else(&self) -> Option<String> {
        let judge = self.engine.recorder.judge();
        if self.engine.operator.runs_on_the_link() {
            return None;
        }
        somebody_else(judge).or_else(|| other_version(judge))
    }

    /// Waits so long, and says from time to time what for.
    async fn wait_for(
        &mut self,
        patience: Duration,
        mut done: impl FnMut(&Recorder) -> bool,
    ) -> Result<bool, EngineError> {
        let begun = self.engine.link.now().moment;
        let end = begun + patience;
        loop {
            let now = self.engine.link.now().moment;
            let until = (now + TOLD_EVERY).min(end);
            if self.engine.watch(until, &mut done).await? {
                return Ok(true);
            }
            if until == end || self.engine.interrupted() || self.engine.recorder.flood().is_some() {
                return Ok(false);
            }
            let opened = self.engine.recorder.journal().beside_messages();
            let opened = opened
                .filter(|entry| matches!(entry.event(), Event::Opened { .. }))
                .count();
            self.progress.note(&format!(
                "waiting for the device: {} s of {} s; connections seen: {opened}; awaited: {}",
                until.since(begun).as_secs(),
                patience.as_secs(),
                self.awaited()
            ));
        }
    }

    /// The topics on which the device has to speak.
    fn awaited(&self) -> String {
        let ground = self.engine.recorder.judge().ground();
        let rules = ground.pack.topics().iter();
        let own = rules.filter(|rule| rule.publisher == ground.role);
        let topics = own.filter_map(|rule| ground.topics.get(rule.name.as_str()).map(String::as_str));
        topics.collect::<Vec<_>>().join(", ")
    }

    fn topic(&self, name: &str) -> String {
        let ground = self.engine.recorder.judge().ground();
        ground.topics.get(name).cloned().unwrap_or_default()
    }

    async fn factsheet(&mut self) -> Result<(), EngineError> {
        let has_sheet = |recorder: &Recorder| {
            recorder
                .judge()
                .timeline()
                .of("factsheet")
                .iter()
                .any(|entry| entry.json().is_some())
        };
        let until = self.engine.link.now().moment + self.time("settle");
        let mut found = self.engine.watch(until, has_sheet).await?;
        let ground = self.engine.recorder.judge().ground();
        let is_known = ground.pack.vocabulary().pointer("/action/factsheetRequest").is_some();
        // Who says that the device has no such action knows that it would only find a mistake in it.
        let is_denied = self.setup.capabilities.claims.get("action factsheetRequest") == Some(&false);
        if !found && is_known && !is_denied {
            self.instant_action("factsheetRequest", json!([])).await?;
            let until = self.engine.link.now().moment + self.time("react");
            found = self.engine.watch(until, has_sheet).await?;
        }
        if !found {
            self.setup.limits.push(
                "The device published no factsheet, so what it can do is only known from the profile.".to_owned(),
            );
            if self.engine.recorder.judge().factsheet_before().is_some() {
                let limit = "Before the interruption it published one, so nobody knows whether it is what it was then.";
                self.setup.limits.push(limit.to_owned());
            }
            return Ok(());
        }
        let sheet = self
            .engine
            .recorder
            .judge()
            .timeline()
            .of("factsheet")
            .iter()
            .rev()
            .find_map(|entry| entry.json().cloned());
        if let Some(sheet) = sheet {
            self.engine.note(Event::Bound {
                name: "device.factsheet".to_owned(),
                value: sheet.clone(),
            })?;
            let names = self.engine.recorder.judge().timeline().names();
            self.setup.capabilities.factsheet = Some(Sheet::read(&sheet, names));
            let contradictions = self.setup.capabilities.contradictions();
            self.setup.limits.extend(contradictions);
        }
        Ok(())
    }

    /// The map the vehicle stands on, if it says so: `device.activeMap`.
    fn active_map(&mut self) -> Result<(), EngineError> {
        let judge = self.engine.recorder.judge();
        let (timeline, names) = (judge.timeline(), judge.timeline().names());
        let state = timeline.of("state").last().and_then(|entry| entry.json());
        let found = state.and_then(|state| {
            let id = names.raw(state, &[StateView::position, Position::map_id])?;
            let enabled = judge.ground().pack.word("mapStatus.enabled")?;
            let mut maps = names.raw_elements(state, StateView::maps).iter();
            let active = maps.find(|map| {
                let status = names.raw(map, &[MapState::map_status]).and_then(Value::as_str);
                names.raw(map, &[MapState::map_id]) == Some(id) && status == Some(enabled)
            })?;
            let version = names.raw(active, &[MapState::map_version])?;
            Some(json!({ "mapId": id, "mapVersion": version }))
        });
        if let Some(value) = found {
            let statements = &mut self.setup.capabilities.statements;
            statements.insert("active-map".to_owned(), true);
            self.engine.note(Event::Bound {
                name: "device.activeMap".to_owned(),
                value,
            })?;
        }
        Ok(())
    }

    /// Sends one instant action outside any test, and gives its id.
    pub(super) async fn instant_action(&mut self, action_type: &str, parameters: Value) -> Result<String, EngineError> {
        let id = self.engine.composer.action_id();
        let pack = &self.engine.recorder.judge().ground().pack;
        let blocking = if pack.has("instantActionsNeverBlock") {
            "NONE"
        } else {
            "HARD"
        };
        let members = json!({ "actions": [{
            "actionType": action_type, "actionId": id, "blockingType": blocking, "actionParameters": parameters,
        }] });
        let now = self.engine.link.now();
        let message = self
            .engine
            .composer
            .plain("instantActions", members, self.engine.recorder.judge().ground(), now);
        match message {
            Ok(message) => self.engine.publish(message).await?,
            Err(error) => {
                self.engine.note(Event::Trouble {
                    text: error.to_string(),
                })?;
            }
        }
        Ok(id)
    }

    /// A time limit of the profile.
    pub(super) fn time(&self, name: &str) -> Duration {
        let times = self.engine.recorder.judge().ground().bindings.get("time");
        let millis = times
            .and_then(|times| times.get(name))
            .and_then(serde_json::Value::as_u64);
        Duration::from_millis(millis.unwrap_or(31_000))
    }
}

/// Members of the header: they differ from message to message.
const HEADER: [Field; 2] = [Header::header_id, Header::timestamp];

/// Where two factsheets differ first, and what stands there in each.
fn difference(before: &Value, now: &Value) -> Option<(String, String, String)> {
    fn first(path: &str, before: Option<&Value>, now: Option<&Value>) -> Option<(String, String, String)> {
        if before == now {
            return None;
        }
        let inside = match (before, now) {
            (Some(Value::Object(before)), Some(Value::Object(now))) => {
                let names = before.keys().chain(now.keys());
                let mut names =
                    names.filter(|name| !path.is_empty() || !HEADER.iter().any(|field| field.usual_name() == *name));
                return names.find_map(|name| {
                    let path = if path.is_empty() {
                        name.clone()
                    } else {
                        format!("{path}.{name}")
                    };
                    first(&path, before.get(name), now.get(name))
                });
            }
            (Some(Value::Array(before)), Some(Value::Array(now))) if before.len() == now.len() => {
                let mut pairs = before.iter().zip(now).enumerate();
                pairs.find_map(|(at, (before, now))| first(&format!("{path}[{at}]"), Some(before), Some(now)))
            }
            _ => None,
        };
        let shown = |value: Option<&Value>| {
            let text = value.map_or_else(|| "absent".to_owned(), Value::to_string);
            text.chars().take(80).collect::<String>()
        };
        inside.or_else(|| Some((path.to_owned(), shown(before), shown(now))))
    }
    first("", Some(before), Some(now))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factsheet_that_differs_is_named_by_the_place_and_its_header_does_not_count() {
        let before = json!({ "headerId": 1, "timestamp": "a", "x": { "y": [1, 2], "z": null } });
        let differs = |now: Value| difference(&before, &now);
        assert_eq!(
            differs(json!({ "headerId": 7, "timestamp": "b", "x": { "y": [1, 2], "z": null } })),
            None
        );
        let found = |place: &str, before: &str, now: &str| Some((place.to_owned(), before.to_owned(), now.to_owned()));
        let now = json!({ "headerId": 1, "timestamp": "a", "x": { "y": [1, 3], "z": null } });
        assert_eq!(differs(now), found("x.y[1]", "2", "3"));
        let now = json!({ "headerId": 1, "timestamp": "a", "x": { "y": [1, 2] } });
        assert_eq!(differs(now), found("x.z", "null", "absent"));
        let now = json!({ "headerId": 1, "timestamp": "a", "x": { "y": [1], "z": null } });
        assert_eq!(differs(now), found("x.y", "[1,2]", "[1]"));
    }
}
