//! Shows a run on the terminal.

use std::io;
use std::time::Duration;

use crate::ui::{Heartbeat, Progress as _, Prompter, RunTitle, Terminal, TerminalOptions, TestLine};
use tck_base::verdict::{Outcome, Verdict};
use tck_engine::Watcher;
use tck_journal::event::{Gate, Plan};
use tck_net::link::mqtt::BenchInfo;
use tck_result::TestResult;
use tck_run as run;
use tck_suite::model::{Step, Test, Verb};

/// The progress of a run, for a person.
pub struct Screen {
    terminal: Terminal<io::Stdout, io::Stderr>,
    title: RunTitle,
    show: Show,
    desk: Prompter,
    /// Where no bar shows that it goes on.
    heartbeat: Option<Heartbeat>,
}

/// Which tests a person wants to see while a run goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Show {
    /// Every test.
    All,
    /// Those that failed or broke.
    Failures,
    /// None; standard output is for the verdict, or for data.
    Nothing,
}

impl Screen {
    /// A screen for a device, beside the desk of a person.
    #[must_use]
    pub fn new(device: String, protocol: String, show: Show, desk: Prompter) -> Self {
        let options = TerminalOptions {
            results: show != Show::Nothing,
            ..TerminalOptions::of_process()
        };
        Self {
            heartbeat: (!options.bar).then(Heartbeat::start),
            terminal: Terminal::stdout(options),
            title: RunTitle {
                device,
                protocol,
                tests: 0,
                not_applicable: 0,
            },
            show,
            desk,
        }
    }

    /// Draws no bar, since the log is written to standard error.
    #[must_use]
    pub fn beside_log(mut self) -> Self {
        self.terminal.without_bar();
        self.heartbeat = None;
        self
    }

    fn beat(&self, tell: impl FnOnce(&Heartbeat)) {
        if let Some(heartbeat) = &self.heartbeat {
            tell(heartbeat);
        }
    }

    /// Takes the bar away.
    pub fn finish(&mut self) {
        self.heartbeat = None;
        self.desk.at_rest();
        self.terminal.clear();
    }
}

impl Watcher for Screen {
    fn waiting(&mut self, step: &Step) {
        self.desk.performs(step.title.as_deref());
        let what = match &*step.verb {
            Verb::Expect(_) | Verb::Never(_) | Verb::Always(_) | Verb::Action(_) | Verb::Retained(_) => {
                step.verb_span.text()
            }
            _ => return,
        };
        let what = step.title.as_deref().unwrap_or(what);
        self.terminal.waiting(what, Duration::ZERO);
        self.beat(|heartbeat| heartbeat.awaits(what));
    }
}

impl run::Progress for Screen {
    fn planned(&mut self, plan: &Plan) {
        self.title.tests = plan.tests.iter().filter(|test| test.gate == Gate::Runs).count();
        self.title.not_applicable = plan
            .tests
            .iter()
            .filter(|test| matches!(test.gate, Gate::NotApplicable(_)))
            .count();
        self.terminal.run_begun(&self.title);
        self.desk.draws(self.terminal.bar());
    }

    fn test_begun(&mut self, test: &Test, _number: usize, _of: usize) {
        self.desk.runs(&test.id);
        self.terminal.test_begun(&test.id, &test.title);
        self.beat(|heartbeat| heartbeat.begins(&test.id));
    }

    fn test_ended(&mut self, result: &TestResult) {
        self.beat(Heartbeat::ended);
        let verdict = result.verdict.unwrap_or(Verdict::Error);
        if self.show == Show::Failures && verdict < Verdict::Error {
            return;
        }
        self.terminal.test_ended(&TestLine {
            id: match result.repetitions.last() {
                Some(repetition) => format!("{} (time {})", result.id, repetition.number),
                None => result.id.clone(),
            },
            outcome: Outcome::Judged(verdict),
            elapsed: Duration::from_secs_f64(result.seconds.clamp(0.0, 1e6)),
            reason: result.reason.clone(),
        });
    }

    fn note(&mut self, text: &str) {
        self.terminal.note(text);
        self.beat(Heartbeat::told);
    }

    fn left(&mut self, left: Duration) {
        let left = run::in_words(left);
        self.terminal.left(&left);
        self.beat(|heartbeat| heartbeat.left(left));
    }

    fn expects_device(&mut self, bench: &BenchInfo) {
        eprintln!("the device is expected at {}", bench.device_url);
        let listens_everywhere = bench.device_address.parse::<std::net::SocketAddr>();
        if listens_everywhere.is_ok_and(|address| address.ip().is_unspecified()) {
            eprintln!("(or at any other address of this machine)");
        }
    }
}
