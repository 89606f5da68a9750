//! What a run tells while it goes on.

use std::time::Duration;

use tck_base::verdict::Outcome;

/// What a run is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunTitle {
    /// The device, in words.
    pub device: String,
    /// Protocol version it is judged by.
    pub protocol: String,
    /// How many tests will run.
    pub tests: usize,
    /// How many do not apply.
    pub not_applicable: usize,
}

/// How a test ended, on one line.
#[derive(Clone, Debug, PartialEq)]
pub struct TestLine {
    /// Its id.
    pub id: String,
    /// What became of it.
    pub outcome: Outcome,
    /// How long it took, in the time of the run.
    pub elapsed: Duration,
    /// Why it is not a pass, in one line.
    pub reason: Option<String>,
}

/// Receives what happens in a run. Implementations swallow errors of input and output, since telling never fails a run.
pub trait Progress {
    /// The run begins.
    fn run_begun(&mut self, title: &RunTitle);

    /// A test begins.
    fn test_begun(&mut self, id: &str, title: &str);

    /// The run waits for something, and has been doing so for a while.
    fn waiting(&mut self, what: &str, since: Duration);

    /// A test has ended, or does not apply.
    fn test_ended(&mut self, line: &TestLine);

    /// Something worth knowing.
    fn note(&mut self, text: &str);
}
