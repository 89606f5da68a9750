//! Hooks of the profile, as the engine sees them.

use std::time::Duration;

use serde_json::{Map, Value};

use tck_base::device::Commanded;
use tck_net::link::Link;

/// What became of a hook.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HookOutcome {
    /// It was done; the text is what it said.
    Done(String),
    /// It was tried and did not work.
    Failed(String),
    /// The device has understood what is wanted of it, and does not do it.
    Refused(String),
    /// The operator leaves the test out.
    Skipped(String),
    /// The operator was asked, and nobody has answered.
    Unanswered(String),
    /// There is no such hook, and nobody to ask.
    Missing,
}

/// What a person is asked to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asks {
    /// The words of the profile, values filled in.
    pub text: String,
    /// How long there is for the answer.
    pub within: Duration,
}

/// Runs hooks: a command, an HTTP request, a prompt to a person, or a command to a reference device.
#[expect(async_fn_in_trait, reason = "the engine runs on one thread and needs no Send bound")]
pub trait Operator {
    /// Names of the hooks that can be run.
    fn hooks(&self) -> Vec<String>;

    /// Names of the hooks that only a person could do, and nobody is there who can be asked.
    fn unattended(&self) -> Vec<String> {
        Vec::new()
    }

    /// Runs one and waits for its end.
    async fn run(&mut self, hook: &str, parameters: Map<String, Value>) -> HookOutcome;

    /// What a person is asked when this hook is run, where one is.
    fn asks(&self, hook: &str, parameters: &Map<String, Value>) -> Option<Asks> {
        let _ = (hook, parameters);
        None
    }

    /// Whether nothing is done for this hook but to wait for an order or instant action that comes by itself, and for
    /// how long.
    fn natural_traffic(&self, hook: &str) -> Option<Duration> {
        let _ = hook;
        None
    }

    /// Whether the device was started for the run, and can be started again without a hook.
    fn has_program(&self) -> bool {
        false
    }

    /// Starts the device again that was started for the run; `Err` says why it could not be.
    ///
    /// # Errors
    /// There is no such program, or it cannot be started.
    async fn start_program_again(&mut self) -> Result<(), String> {
        Err("nothing was started for the run".to_owned())
    }

    /// Ends what was started for the run, and waits until nothing of it is left.
    async fn end(&mut self) {}

    /// How long a hook takes when nobody has to be asked, for the estimate before a run.
    fn usual_time(&self) -> Duration {
        Duration::from_secs(1)
    }

    /// Sets a mock AGV; they are counted from 0. `false` when there is none of that number.
    async fn vehicle(&mut self, number: usize, what: &str, with: Value) -> bool {
        let _ = (number, what, with);
        false
    }

    /// Whether hooks are commands to a device that lives on the link, and so are mock AGVs, as in virtual time.
    fn runs_on_the_link(&self) -> bool {
        false
    }
}

/// Gives the command to the device on the link.
pub(super) fn on_link<L: Link>(link: &mut L, hook: &str, parameters: &Map<String, Value>) -> HookOutcome {
    match link.command(hook, Value::Object(parameters.clone())) {
        Commanded::Taken => HookOutcome::Done("done by the simulated device".to_owned()),
        Commanded::Declined(why) => HookOutcome::Refused(why),
        Commanded::Nobody => HookOutcome::Missing,
    }
}
