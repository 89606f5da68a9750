//! A run that goes on with one that broke off, and whole journals, in which there may be several runs.

use std::borrow::Borrow;
use std::sync::Arc;

use serde_json::Value;

use super::super::merge;
use super::super::monitor_set::MonitorReport;
use super::super::rules::{JudgeError, Rules};
use super::{BREAKS_OFF, RunJudge};
use tck_journal::Entry;
use tck_journal::event::{Event, RunHeader};
use tck_result::{JoinedRun, RunResult};

impl RunJudge {
    /// Goes on after a run that broke off: the first entry is that of the next run.
    ///
    /// # Errors
    /// When the next run is about another device, or was judged by other suites.
    pub fn resumed(mut self, first: &Entry) -> Result<Self, JudgeError> {
        self.break_off_run(BREAKS_OFF);
        let mut next = Self::begin(&self.rules, first)?;
        let facts = |header: &RunHeader| {
            let of_device = (
                header.manufacturer.clone(),
                header.serial_number.clone(),
                header.role.clone(),
            );
            (
                of_device,
                header.protocol.clone(),
                header.suites.clone(),
                header.vantage.clone(),
            )
        };
        if facts(&self.header) != facts(&next.header) {
            return Err(JudgeError::AnotherRun);
        }
        next.messages = self.messages.clone();
        next.earlier = Some(Box::new(self));
        Ok(next)
    }

    /// The factsheet that the device had in the run that this one goes on with, or in one before that.
    pub fn factsheet_before(&self) -> Option<&Value> {
        let earlier = self.earlier.as_deref()?;
        earlier.ground.factsheet_json().or_else(|| earlier.factsheet_before())
    }

    /// The runs before this one.
    pub(super) fn joined(&self) -> Vec<JoinedRun> {
        let Some(earlier) = &self.earlier else {
            return Vec::new();
        };
        let mut all = earlier.joined();
        let before = all.iter().map(|run| run.records).sum::<u64>();
        let reason = earlier.end.as_ref().and_then(|(_, reason)| reason.clone());
        all.push(JoinedRun {
            run: earlier.header.run.clone(),
            started: format!("{:.3}", earlier.begun.utc),
            seconds: earlier.last.moment.since(earlier.begun.moment).as_secs_f64(),
            reason: reason.unwrap_or_else(|| "it ended".to_owned()),
            kept: earlier.done.iter().filter(|test| merge::is_decided(test)).count(),
            records: earlier.records - before,
        });
        all
    }

    /// What is left to do of a run that broke off: the planned tests that were not decided, in their order.
    pub fn left(&self) -> Vec<String> {
        let undecided = self.tests().into_iter().filter(|test| !merge::is_decided(test));
        let undecided: Vec<String> = undecided.map(|test| test.id).collect();
        let mut planned = self.planned();
        planned.retain(|id| undecided.contains(id));
        planned
    }

    fn planned(&self) -> Vec<String> {
        let mut all = self.earlier.as_ref().map_or_else(Vec::new, |earlier| earlier.planned());
        for planned in &self.plan.tests {
            if !all.contains(&planned.test) {
                all.push(planned.test.clone());
            }
        }
        all
    }

    /// What monitors found in this run and in those before it.
    pub(super) fn watched(&self) -> Vec<MonitorReport> {
        let own = if self.is_stranger {
            Vec::new()
        } else {
            self.watches.results()
        };
        match &self.earlier {
            Some(earlier) => merge::watched(earlier.watched(), own),
            None => own,
        }
    }
}

/// Judges a whole journal.
///
/// # Errors
/// When it is none of a run that these suites can judge.
pub fn judge<E: Borrow<Arc<Entry>>>(
    rules: &Rules,
    entries: impl IntoIterator<Item = E>,
) -> Result<RunResult, JudgeError> {
    Ok(judged(rules, entries)?.result())
}

/// The judge who has seen a whole journal. Where a run begins in it, it goes on with the one before.
///
/// # Errors
/// When it is none of a run that these suites can judge.
pub fn judged<E: Borrow<Arc<Entry>>>(
    rules: &Rules,
    entries: impl IntoIterator<Item = E>,
) -> Result<RunJudge, JudgeError> {
    let mut entries = entries.into_iter();
    let first = entries.next().ok_or(JudgeError::NoHeader)?;
    let first = first.borrow();
    let mut run = RunJudge::begin(rules, first)?;
    run.observe(first)?;
    for entry in entries {
        let entry = entry.borrow();
        if matches!(entry.event(), Event::RunBegun { .. }) {
            run = run.resumed(entry)?;
        }
        run.observe(entry)?;
    }
    run.break_off_run(BREAKS_OFF);
    Ok(run)
}
