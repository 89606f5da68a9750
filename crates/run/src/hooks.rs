//! Runs the hooks of a profile: a program, an HTTP request, a prompt to a person, or the restart of the
//! device the harness itself has started.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Map, Value};

use super::device::{DeviceProcess, GOODBYE_LIMIT};
use super::person::{Answer, Person, Reply, ask};
use super::program::program;
use tck_engine::{Asks, HookOutcome, Operator};
use tck_net::bench::web;
use tck_pack::HookInfo;
use tck_profile::{Hook, HookAction, Secrets, show_duration};

/// Answers of a device that has understood what is wanted, and does not do it: in conflict with what it does now, not
/// to be processed, not implemented.
pub const REFUSALS: [u16; 3] = [409, 422, 501];

/// The hooks of a profile.
#[derive(Debug)]
pub struct ProfileHooks {
    hooks: BTreeMap<String, Hook>,
    common: BTreeMap<String, String>,
    folder: PathBuf,
    device: Option<DeviceProcess>,
    /// Who may be asked.
    person: Option<Arc<dyn Person>>,
    means: Means,
}

/// What requests need, and what is kept out of everything that is told.
#[derive(Clone, Debug, Default)]
pub struct Means {
    /// PEM file with an authority that is trusted beside those of the system.
    pub authority: Option<PathBuf>,
    /// What nobody may read.
    pub secrets: Secrets,
}

impl ProfileHooks {
    /// Hooks with the values of the placeholders every hook may use.
    #[must_use]
    pub fn new(
        hooks: BTreeMap<String, Hook>,
        common: BTreeMap<String, String>,
        folder: PathBuf,
        device: Option<DeviceProcess>,
        person: Option<Arc<dyn Person>>,
        means: Means,
    ) -> Self {
        Self {
            hooks,
            common,
            folder,
            device,
            person,
            means,
        }
    }

    /// What the placeholders of a hook stand for.
    fn values(&self, hook: &Hook, parameters: &Map<String, Value>) -> BTreeMap<String, String> {
        let mut values = self.common.clone();
        values.extend(parameters.iter().map(|(name, value)| match value {
            Value::String(text) => (name.clone(), text.clone()),
            other => (name.clone(), other.to_string()),
        }));
        if matches!(hook.action, HookAction::Prompt(_)) {
            in_words(&hook.info, &mut values);
        }
        values
    }

    async fn carry_out(&mut self, hook: &Hook, values: &BTreeMap<String, String>) -> HookOutcome {
        let action = hook.action.filled(values);
        let outcome = match action {
            HookAction::Run(arguments) => tokio::time::timeout(hook.timeout, program(&arguments, &self.folder)).await,
            HookAction::Http {
                method,
                url,
                body,
                headers,
            } => {
                let headers = headers.into_iter().map(|(name, value)| (name, value.reveal()));
                let request = Asked {
                    method,
                    url,
                    body,
                    headers: headers.collect(),
                    authority: self.means.authority.clone(),
                    within: hook.timeout,
                };
                let asked = tokio::task::spawn_blocking(move || request.send());
                let answer = async {
                    asked
                        .await
                        .unwrap_or_else(|error| HookOutcome::Failed(error.to_string()))
                };
                tokio::time::timeout(hook.timeout, answer).await
            }
            HookAction::Prompt(text) => {
                let Some(person) = &self.person else {
                    return HookOutcome::Missing;
                };
                return answered(ask(person, text, hook.timeout).await, hook.timeout);
            }
            // The engine waits for it itself.
            HookAction::NaturalTraffic => Ok(HookOutcome::Done("left to natural traffic".to_owned())),
            HookAction::RestartDevice | HookAction::StopDevice | HookAction::StartDevice => {
                let Some(device) = &mut self.device else {
                    return HookOutcome::Failed("the profile has no `device.command` that could be started".to_owned());
                };
                return match action {
                    HookAction::StopDevice if device.end().await => {
                        HookOutcome::Done("the device has ended".to_owned())
                    }
                    HookAction::StopDevice => HookOutcome::Failed(format!(
                        "the device did not end within {} of SIGTERM, and was killed",
                        show_duration(GOODBYE_LIMIT)
                    )),
                    HookAction::StartDevice if device.is_running() => HookOutcome::Done("the device runs".to_owned()),
                    _ => match device.restart().await {
                        Ok(()) => HookOutcome::Done("the device was started".to_owned()),
                        Err(error) => HookOutcome::Failed(error.to_string()),
                    },
                };
            }
        };
        outcome.unwrap_or_else(|_| HookOutcome::Failed(format!("not done within {}", show_duration(hook.timeout))))
    }
}

impl Operator for ProfileHooks {
    fn hooks(&self) -> Vec<String> {
        let usable = self
            .hooks
            .values()
            .filter(|hook| self.person.is_some() || hook.action.is_unattended());
        usable.map(|hook| hook.name.clone()).collect()
    }

    fn unattended(&self) -> Vec<String> {
        let prompts = self.hooks.values().filter(|hook| !hook.action.is_unattended());
        let unattended = prompts.filter(|_| self.person.is_none());
        unattended.map(|hook| hook.name.clone()).collect()
    }

    fn asks(&self, hook: &str, parameters: &Map<String, Value>) -> Option<Asks> {
        let hook = self.hooks.get(hook).filter(|_| self.person.is_some())?;
        match hook.action.filled(&self.values(hook, parameters)) {
            HookAction::Prompt(text) => Some(Asks {
                text: self.means.secrets.out_of(&text),
                within: hook.timeout,
            }),
            _ => None,
        }
    }

    fn natural_traffic(&self, hook: &str) -> Option<Duration> {
        let hook = self.hooks.get(hook)?;
        (hook.action == HookAction::NaturalTraffic).then_some(hook.timeout)
    }

    fn has_program(&self) -> bool {
        self.device.is_some()
    }

    async fn start_program_again(&mut self) -> Result<(), String> {
        match &mut self.device {
            Some(device) => device.restart().await.map_err(|error| error.to_string()),
            None => Err("the profile has no `device.command` that could be started".to_owned()),
        }
    }

    async fn end(&mut self) {
        if let Some(device) = &mut self.device {
            device.stop("the end of the run").await;
        }
    }

    async fn run(&mut self, name: &str, parameters: Map<String, Value>) -> HookOutcome {
        let Some(hook) = self.hooks.get(name).cloned() else {
            return HookOutcome::Missing;
        };
        let values = self.values(&hook, &parameters);
        // However it is done: a device that a hook ends does not end by itself.
        let ends = hook.info.may_end_the_device();
        if let (true, Some(device)) = (ends, &mut self.device) {
            device.is_asked(&format!("hook `{name}`"), hook.timeout).await;
        }
        let outcome = self.carry_out(&hook, &values).await;
        if let (true, Some(device)) = (ends, &mut self.device) {
            device.was_asked();
        }
        let shown = |text: String| self.means.secrets.out_of(&text);
        match outcome {
            HookOutcome::Done(text) => HookOutcome::Done(shown(text)),
            HookOutcome::Failed(text) => HookOutcome::Failed(shown(text)),
            HookOutcome::Refused(text) => HookOutcome::Refused(shown(text)),
            HookOutcome::Skipped(text) => HookOutcome::Skipped(shown(text)),
            HookOutcome::Unanswered(text) => HookOutcome::Unanswered(shown(text)),
            HookOutcome::Missing => HookOutcome::Missing,
        }
    }
}

/// A person is told what a value means; programs are given the identifier.
fn in_words(hook: &HookInfo, values: &mut BTreeMap<String, String>) {
    for parameter in &hook.parameters {
        let Some(given) = values.get_mut(&parameter.name) else {
            continue;
        };
        let meant = parameter.values.iter().find(|value| value.id == *given);
        if let Some(text) = meant.and_then(|value| value.text.as_ref()) {
            given.clone_from(text);
        }
    }
}

/// A request of a hook.
struct Asked {
    method: String,
    url: String,
    body: Option<String>,
    headers: Vec<(String, String)>,
    authority: Option<PathBuf>,
    within: Duration,
}

impl Asked {
    fn send(self) -> HookOutcome {
        let Self { method, url, .. } = &self;
        let agent = web::agent(url, self.authority.as_ref(), |limits| {
            limits.timeout_global(Some(self.within))
        });
        let agent = match agent {
            Ok(agent) => agent,
            Err(error) => return HookOutcome::Failed(format!("{method} {url}: {error}")),
        };
        let mut made = ureq::http::Request::builder().method(method.as_str()).uri(url);
        let has_type = self
            .headers
            .iter()
            .any(|(name, _)| name.eq_ignore_ascii_case("content-type"));
        if self.body.is_some() && !has_type {
            made = made.header("content-type", "application/json");
        }
        for (name, value) in &self.headers {
            made = made.header(name, value);
        }
        let made = match made.body(self.body.clone().unwrap_or_default()) {
            Ok(made) => made,
            Err(error) => return HookOutcome::Failed(format!("{method} {url}: {error}")),
        };
        match agent.run(made) {
            Ok(answer) => HookOutcome::Done(format!("{method} {url}: {}", answer.status())),
            Err(ureq::Error::StatusCode(code)) if REFUSALS.contains(&code) => {
                HookOutcome::Refused(format!("{method} {url}: {code}"))
            }
            Err(error) => HookOutcome::Failed(format!("{method} {url}: {error}")),
        }
    }
}

fn answered(reply: Reply, within: Duration) -> HookOutcome {
    let place = reply.from.map_or_else(String::new, |place| format!(", {place}"));
    match reply.answer {
        Answer::Done => HookOutcome::Done(format!("the operator answered: done{place}")),
        Answer::Skip => HookOutcome::Skipped(format!("the operator skipped the test{place}")),
        Answer::End => HookOutcome::Failed(format!("the operator ended the run{place}")),
        // Nobody has broken anything: the test is undecided.
        Answer::Silence => HookOutcome::Unanswered(format!("nobody answered within {}", show_duration(within))),
        Answer::GivenUp => HookOutcome::Failed("given up: the run ends".to_owned()),
        Answer::Unasked(why) => HookOutcome::Failed(format!("the operator could not be asked: {why}")),
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use crate::device::Surroundings;
    use tck_base::diagnostic::{Source, Span};
    use tck_pack::Role;

    fn known(name: &str, role: Role) -> HookInfo {
        tck_testing::library().rules.hooks.find(name, role).unwrap().clone()
    }

    #[test]
    fn a_person_is_told_what_a_value_means() {
        let configure = known("configure", Role::MasterControl);
        let mut values = BTreeMap::from([("what".to_owned(), "trigger-timeout".to_owned())]);
        in_words(&configure, &mut values);
        assert_eq!(values["what"], "waitForTrigger is called off after 30 s");
    }

    fn hook(action: HookAction) -> Hook {
        Hook {
            name: "shutdown".to_owned(),
            info: known("shutdown", Role::Agv),
            action,
            timeout: Duration::from_secs(30),
            span: Span::new(&Source::new("device.toml", ""), 0, 0),
        }
    }

    async fn outcomes(
        script: &str,
        folder: &std::path::Path,
        actions: &[HookAction],
    ) -> (Vec<HookOutcome>, ProfileHooks) {
        let command = ["sh", "-c", script].map(str::to_owned).to_vec();
        let mut device = DeviceProcess::new(command, folder.to_owned(), None, Surroundings::default());
        device.start().await.unwrap();
        let mut hooks = ProfileHooks::new(
            BTreeMap::new(),
            BTreeMap::new(),
            folder.to_owned(),
            Some(device),
            None,
            Means::default(),
        );
        let mut all = Vec::new();
        for action in actions {
            while !folder.join("ready").exists() {
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
            all.push(hooks.carry_out(&hook(action.clone()), &BTreeMap::new()).await);
        }
        (all, hooks)
    }

    #[tokio::test]
    async fn the_device_of_the_profile_is_asked_to_end_in_good_order_and_started_again() {
        let folder = tempfile::tempdir().unwrap();
        let script = "trap 'echo goodbye >> said; exit 0' TERM; echo hello >> said; touch ready; \
                      while true; do sleep 0.05; done";
        let actions = [HookAction::StopDevice, HookAction::StopDevice, HookAction::StartDevice];
        // The device ends with its hooks.
        let (all, _hooks) = outcomes(script, folder.path(), &actions).await;
        assert!(
            all.iter().all(|outcome| matches!(outcome, HookOutcome::Done(_))),
            "{all:?}"
        );
        while std::fs::read_to_string(folder.path().join("said"))
            .unwrap()
            .lines()
            .count()
            < 3
        {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        let said = std::fs::read_to_string(folder.path().join("said")).unwrap();
        assert_eq!(said, "hello\ngoodbye\nhello\n");
    }
}
