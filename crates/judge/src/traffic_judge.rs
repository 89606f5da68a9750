//! One side of recorded traffic, judged by monitors alone.
//!
//! Nothing is kept of what was seen but what the monitors remember, which is bounded, so traffic may go on for weeks.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::clients::{Attribution, ClientClassifier};
use super::monitor_set::{MonitorSet, Observed};
use super::rules::{JudgeError, Rules};
use super::run::interrupted;
use super::run_contexts::{Ground, RunContexts};
use super::timeline::Timeline;
use tck_journal::Entry;
use tck_journal::event::{Event, RunHeader};
use tck_suite::model::Monitor;

/// One side of recorded traffic, judged by monitors alone.
pub struct TrafficJudge {
    ground: Ground,
    timeline: Timeline,
    watches: MonitorSet,
    /// Who is on the tap besides the device, where a journal tells.
    company: Option<ClientClassifier>,
    /// Why nothing is held against the device any more: the run was interrupted.
    interrupted: Option<Arc<str>>,
}

impl TrafficJudge {
    /// Puts the wanted monitors on duty.
    pub fn begin(rules: &Rules, header: &RunHeader, wanted: &dyn Fn(&Monitor) -> bool) -> Result<Self, JudgeError> {
        let RunContexts { role, ground, vehicles } = RunContexts::of(rules, header)?;
        let monitors: Vec<&Arc<Monitor>> = rules
            .suites
            .monitors
            .iter()
            .filter(|monitor| monitor.device.is_none_or(|device| device == role) && wanted(monitor))
            .collect();
        let timeline = if header.vehicles.is_empty() {
            Timeline::new(&header.topics, &ground.pack)
        } else {
            Timeline::of_vehicles(&header.vehicles, &ground.pack)
        };
        Ok(Self {
            watches: MonitorSet::begin(&monitors, &ground, vehicles, header.vantage == "tap").apart(),
            timeline,
            ground,
            company: None,
            interrupted: None,
        })
    }

    /// Leaves unjudged what bystanders do: the journal of a run tells who is on the tap besides the device.
    #[must_use]
    pub fn among_others(mut self, header: &RunHeader) -> Self {
        self.company = Some(ClientClassifier::of(self.ground.role, header, &self.ground.pack));
        self
    }

    /// Shows it the next entry and takes what was found since.
    pub fn observe(&mut self, entry: &Arc<Entry>) -> Vec<Observed> {
        let mut part = Attribution::Judged;
        if let Some(company) = &mut self.company {
            part = company.observe(entry);
            if *entry.event() == Event::Interrupted {
                self.interrupted.get_or_insert_with(|| interrupted(entry));
            }
            let present = company.interference(entry.at().moment);
            self.ground.interference = self.interrupted.as_ref().or(present).cloned();
            self.ground.is_interrupted = self.interrupted.is_some();
        }
        match part {
            Attribution::Judged => self.judge(entry),
            Attribution::Bystander => {}
            Attribution::Joined(before) => {
                for entry in &before {
                    self.judge(entry);
                }
                self.judge(entry);
            }
        }
        self.watches.take()
    }

    fn judge(&mut self, entry: &Arc<Entry>) {
        let subject = self.timeline.subject_of(entry);
        self.watches
            .observe(entry, subject.as_deref(), &self.timeline, &self.ground);
    }

    /// The traffic is known to end here: takes what is found by that.
    pub fn finish(&mut self, end: tck_base::clock::Moment) -> Vec<Observed> {
        self.watches.finish(end, &self.ground);
        self.watches.take()
    }

    /// How many entries each monitor has judged, by its id.
    pub fn judged(&self) -> BTreeMap<String, u64> {
        self.watches.judged()
    }

    /// The requirements of which something was judged, with the monitor.
    pub fn decided(&self) -> Vec<(String, String)> {
        self.watches.decided()
    }
}
