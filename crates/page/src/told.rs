//! What a run tells the page, in the page's own words.

use serde::Serialize;
use tck_base::verdict::Verdict;

use super::shown::{NAME, SENTENCE, shown};

/// What a run is about.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Facts {
    /// `run` or `certify`.
    pub command: String,
    /// Which side is tested, in words.
    pub role: String,
    /// The version it is judged by.
    pub protocol: String,
    /// Manufacturer of the device.
    pub manufacturer: String,
    /// Its serial number.
    pub serial_number: String,
    /// Identifier of the run.
    pub run: String,
    /// The broker that is used, in words.
    pub broker: String,
}

impl Facts {
    pub(crate) fn cut(mut self) -> Self {
        let all = [
            &mut self.command,
            &mut self.role,
            &mut self.protocol,
            &mut self.manufacturer,
            &mut self.serial_number,
            &mut self.run,
            &mut self.broker,
        ];
        for text in all {
            *text = shown(text, NAME);
        }
        self
    }
}

/// A test of the plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Planned {
    /// Its id.
    pub test: String,
    /// Why it is not run; `None` where it is.
    pub left_out: Option<String>,
}

/// The test that runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TestFacts {
    /// Its id.
    pub test: String,
    /// Its title.
    pub title: String,
    /// Why anybody cares.
    pub why: String,
    /// Its number in the run.
    pub number: usize,
    /// Of how many.
    pub of: usize,
}

/// The step that the test has come to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StepFacts {
    /// Where it stands.
    pub path: String,
    /// Its title, where it has one.
    pub title: Option<String>,
    /// What it does, in the words of the suite.
    pub does: String,
}

/// What a person is to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Prompt {
    /// Which question of the run.
    pub number: u64,
    /// The title of the step that asks.
    pub step: Option<String>,
    /// What is to be done.
    pub text: String,
    /// How many seconds there are for the answer.
    pub seconds: u64,
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Finding {
    /// The requirement.
    pub requirement: String,
    /// How bad.
    pub verdict: Verdict,
    /// The test or monitor.
    pub by: String,
    /// One line.
    pub message: String,
    /// The record that shows it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record: Option<u64>,
    /// How often.
    pub count: u64,
}

impl Finding {
    pub(crate) fn cut(mut self) -> Self {
        self.message = shown(&self.message, SENTENCE);
        self.by = shown(&self.by, NAME);
        self
    }
}

/// How a run has ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Outcome {
    /// The verdict, or `none` when nothing was decided.
    pub verdict: String,
    /// The statement of the report.
    pub statement: String,
    /// Where the report is.
    pub report: String,
}

/// Which way a message goes, as the device under test sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Way {
    /// The device has sent it.
    FromDevice,
    /// It was sent to the device.
    ToDevice,
}
