//! Runs the hooks of a profile: a program, an HTTP request, a prompt to a person, or the restart of the
//! device the harness itself has started.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Stdio;
use std::time::Duration;

use serde_json::{Map, Value};
use tokio::process::{Child, Command};

use crate::engine::{HookOutcome, Operator};
use crate::profile::{Hook, HookAction, show_duration};

/// Answers of a device that has understood what is wanted, and does not do it: in conflict with what it does now, not
/// to be processed, not implemented.
const REFUSALS: [u16; 3] = [409, 422, 501];

/// A device that the harness starts itself (`device.command`).
#[derive(Debug)]
pub struct DeviceProcess {
    command: Vec<String>,
    folder: PathBuf,
    log: Option<PathBuf>,
    child: Option<Child>,
}

impl DeviceProcess {
    /// A device to be started with this program and these arguments in this folder. What it prints goes
    /// into `log`.
    #[must_use]
    pub fn new(command: Vec<String>, folder: PathBuf, log: Option<PathBuf>) -> Self {
        Self {
            command,
            folder,
            log,
            child: None,
        }
    }

    /// Starts it.
    ///
    /// # Errors
    /// What the operating system says, with the command.
    pub fn start(&mut self) -> std::io::Result<()> {
        let Some((program, arguments)) = self.command.split_first() else {
            return Err(std::io::Error::other("device.command is empty"));
        };
        let output = |log: &Option<PathBuf>| -> std::io::Result<Stdio> {
            let Some(path) = log else { return Ok(Stdio::null()) };
            Ok(std::fs::File::options().create(true).append(true).open(path)?.into())
        };
        let child = Command::new(program)
            .args(arguments)
            .current_dir(if self.folder.as_os_str().is_empty() {
                ".".into()
            } else {
                self.folder.clone()
            })
            .stdin(Stdio::null())
            .stdout(output(&self.log)?)
            .stderr(output(&self.log)?)
            .kill_on_drop(true)
            .spawn()
            .map_err(|error| std::io::Error::other(format!("cannot start the device with `{program}`: {error}")))?;
        self.child = Some(child);
        Ok(())
    }

    /// Kills it, if it still runs, and starts it again.
    ///
    /// # Errors
    /// What the operating system says.
    pub async fn restart(&mut self) -> std::io::Result<()> {
        self.stop().await;
        self.start()
    }

    /// Kills it.
    pub async fn stop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill().await;
        }
    }
}

/// The hooks of a profile.
#[derive(Debug)]
pub struct ProfileHooks {
    hooks: BTreeMap<String, Hook>,
    common: BTreeMap<String, String>,
    folder: PathBuf,
    device: Option<DeviceProcess>,
    /// Whether a person may be asked.
    attended: bool,
}

impl ProfileHooks {
    /// Hooks with the values of the placeholders every hook may use.
    #[must_use]
    pub fn new(
        hooks: BTreeMap<String, Hook>,
        common: BTreeMap<String, String>,
        folder: PathBuf,
        device: Option<DeviceProcess>,
        attended: bool,
    ) -> Self {
        Self {
            hooks,
            common,
            folder,
            device,
            attended,
        }
    }

    async fn carry_out(&mut self, hook: &Hook, values: &BTreeMap<String, String>) -> HookOutcome {
        let action = hook.action.filled(values);
        let outcome = match action {
            HookAction::Run(arguments) => tokio::time::timeout(hook.timeout, program(&arguments, &self.folder)).await,
            HookAction::Http { method, url, body } => {
                let asked = tokio::task::spawn_blocking(move || request(&method, &url, body.as_deref()));
                let answer = async {
                    asked
                        .await
                        .unwrap_or_else(|error| HookOutcome::Failed(error.to_string()))
                };
                tokio::time::timeout(hook.timeout, answer).await
            }
            HookAction::Prompt(text) if self.attended => {
                let asked = tokio::task::spawn_blocking(move || ask(&text));
                let answer = async {
                    asked
                        .await
                        .unwrap_or_else(|error| HookOutcome::Failed(error.to_string()))
                };
                tokio::time::timeout(hook.timeout, answer).await
            }
            HookAction::Prompt(_) => Ok(HookOutcome::Missing),
            // The engine waits for it itself.
            HookAction::NaturalTraffic => Ok(HookOutcome::Done("left to natural traffic".to_owned())),
            HookAction::RestartDevice => match &mut self.device {
                Some(device) => Ok(match device.restart().await {
                    Ok(()) => HookOutcome::Done("the device was started again".to_owned()),
                    Err(error) => HookOutcome::Failed(error.to_string()),
                }),
                None => Ok(HookOutcome::Failed(
                    "the profile has no `device.command` that could be started".to_owned(),
                )),
            },
        };
        outcome.unwrap_or_else(|_| HookOutcome::Failed(format!("not done within {}", show_duration(hook.timeout))))
    }
}

impl Operator for ProfileHooks {
    fn hooks(&self) -> Vec<String> {
        let usable = self
            .hooks
            .values()
            .filter(|hook| self.attended || hook.action.is_unattended());
        usable.map(|hook| hook.name.clone()).collect()
    }

    fn natural_traffic(&self, hook: &str) -> Option<Duration> {
        let hook = self.hooks.get(hook)?;
        (hook.action == HookAction::NaturalTraffic).then_some(hook.timeout)
    }

    async fn run(&mut self, name: &str, parameters: Map<String, Value>) -> HookOutcome {
        let Some(hook) = self.hooks.get(name).cloned() else {
            return HookOutcome::Missing;
        };
        let mut values = self.common.clone();
        values.extend(parameters.into_iter().map(|(name, value)| match value {
            Value::String(text) => (name, text),
            other => (name, other.to_string()),
        }));
        self.carry_out(&hook, &values).await
    }
}

async fn program(arguments: &[String], folder: &std::path::Path) -> HookOutcome {
    let Some((program, arguments)) = arguments.split_first() else {
        return HookOutcome::Failed("the command is empty".to_owned());
    };
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null()).kill_on_drop(true);
    if !folder.as_os_str().is_empty() {
        command.current_dir(folder);
    }
    match command.output().await {
        Err(error) => HookOutcome::Failed(format!("cannot start `{program}`: {error}")),
        Ok(output) => {
            let said = shown(if output.status.success() {
                &output.stdout
            } else {
                &output.stderr
            });
            if output.status.success() {
                HookOutcome::Done(said)
            } else {
                HookOutcome::Failed(format!("`{program}` ended with {}: {said}", output.status))
            }
        }
    }
}

fn request(method: &str, url: &str, body: Option<&str>) -> HookOutcome {
    let made = ureq::http::Request::builder().method(method).uri(url);
    let made = match body {
        Some(body) => made.header("content-type", "application/json").body(body.to_owned()),
        None => made.body(String::new()),
    };
    let made = match made {
        Ok(made) => made,
        Err(error) => return HookOutcome::Failed(error.to_string()),
    };
    match ureq::run(made) {
        Ok(answer) => HookOutcome::Done(format!("{method} {url}: {}", answer.status())),
        Err(ureq::Error::StatusCode(code)) if REFUSALS.contains(&code) => {
            HookOutcome::Refused(format!("{method} {url}: {code}"))
        }
        Err(error) => HookOutcome::Failed(format!("{method} {url}: {error}")),
    }
}

fn ask(text: &str) -> HookOutcome {
    match inquire::Confirm::new(text).with_default(true).prompt() {
        Ok(true) => HookOutcome::Done("the operator answered: done".to_owned()),
        Ok(false) => HookOutcome::Failed("the operator answered: not done".to_owned()),
        Err(error) => HookOutcome::Failed(error.to_string()),
    }
}

/// The first lines of what a program printed, bounded.
fn shown(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).trim().chars().take(500).collect()
}
