//! Live traffic, judged by the monitors as recorded traffic is.
//!
//! [`Watch`] is shown message after message and tells each finding with the message that shows it. [`vehicle_status`] keeps what
//! is worth knowing of every vehicle at present, [`alarm`] is what somebody is told at once, [`metrics`] writes it for a scraper, [`recorder`] keeps a journal that an
//! audit judges alike, and [`listener`] stays connected to a broker. [`session`] brings them together. What is kept is
//! bounded, so a watch may go on for weeks.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod alarm;
mod listener;
mod metrics;
mod recorder;
mod served;
pub mod session;
pub mod vehicle_status;

use std::collections::{BTreeMap, VecDeque};

use bytes::Bytes;

use alarm::{Alarm, Alarmed};
use tck_audit::result::AuditResult;
use tck_audit::{Audit, AuditError, Found, Options};
use tck_base::clock::{Moment, Stamp};
use tck_base::verdict::Verdict;
use tck_capture::{Message, Wire};
use tck_judge::Rules;
use tck_pack::Packs;
use vehicle_status::{Kind, PERIOD, VehicleStatus};

pub use recorder::Rotation;

/// How many bytes of messages are kept beside the findings to come.
const RECENT: usize = 8 << 20;
/// How many vehicles are kept in view.
const IN_VIEW: usize = 10_000;

/// A finding with the message that shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// What was found.
    pub found: Found,
    /// Topic and payload, if they are still known.
    pub message: Option<(String, Bytes)>,
}

impl Notice {
    /// Whether this is worth a line: the first one, and then the tenth, the hundredth and so on.
    #[must_use]
    pub fn is_told(&self) -> bool {
        let digits = |count: u64| count.checked_ilog10();
        self.found.before == 0 || digits(self.found.before) < digits(self.found.count)
    }
}

/// The last messages by number, bounded by their size.
#[derive(Debug, Default)]
struct Recent {
    all: VecDeque<(u64, String, Bytes)>,
    bytes: usize,
}

impl Recent {
    fn keep(&mut self, number: u64, topic: String, payload: Bytes) {
        self.bytes += payload.len() + topic.len();
        self.all.push_back((number, topic, payload));
        while self.bytes > RECENT {
            let Some((_, topic, payload)) = self.all.pop_front() else {
                break;
            };
            self.bytes -= payload.len() + topic.len();
        }
    }

    fn get(&self, number: u64) -> Option<(String, Bytes)> {
        let at = self.all.binary_search_by_key(&number, |(number, ..)| *number).ok()?;
        self.all
            .get(at)
            .map(|(_, topic, payload)| (topic.clone(), payload.clone()))
    }
}

/// Judges live traffic by the monitors, as recorded traffic is judged.
pub struct Watch<'r> {
    audit: Audit<'r>,
    recent: Recent,
    glances: BTreeMap<String, VehicleStatus>,
    /// By manufacturer and serial number: which of them it is.
    names: BTreeMap<(String, String), String>,
    elsewhere: u64,
    alarms: Vec<Alarmed>,
    /// Whether silence is a finding.
    judges_silence: bool,
    packs: &'r Packs,
}

impl<'r> Watch<'r> {
    /// Begins.
    ///
    /// # Errors
    /// What is wrong with the options.
    pub fn new(rules: &'r Rules, options: Options) -> Result<Self, AuditError> {
        let mut monitors = rules.suites.monitors.iter();
        Ok(Self {
            judges_silence: monitors.any(|monitor| monitor.id == PERIOD && options.wants_monitor(monitor)),
            alarms: Vec::new(),
            audit: Audit::new(rules, options)?.live(),
            recent: Recent::default(),
            glances: BTreeMap::new(),
            names: BTreeMap::new(),
            elsewhere: 0,
            packs: &rules.packs,
        })
    }

    /// Takes in a message; tells what is found by now.
    pub fn take(&mut self, at: Stamp, message: Message) -> Vec<Notice> {
        let number = self.audit.messages() + 1;
        match self.audit.address(&message.topic) {
            Some(address) => {
                self.recent.keep(number, message.topic.clone(), message.payload.clone());
                let is_known = self.glances.contains_key(&address.vehicle);
                if is_known || self.glances.len() < IN_VIEW {
                    let name = (address.manufacturer.clone(), address.serial_number.clone());
                    self.names.entry(name).or_insert_with(|| address.vehicle.clone());
                    let glance = self
                        .glances
                        .entry(address.vehicle.clone())
                        .or_insert_with(|| VehicleStatus::new(&address));
                    let stored = message.retain == Some(true);
                    let alarms = glance.take(&address.name, at, stored, &message.payload, self.packs);
                    self.alarms
                        .extend(alarms.into_iter().map(|alarm| glance.alarmed(at.utc, alarm)));
                }
            }
            None => self.elsewhere += 1,
        }
        self.audit.observe(message);
        self.notices()
    }

    /// Takes in what was seen of a connection; tells what is found by now.
    pub fn take_wire(&mut self, wire: Wire) -> Vec<Notice> {
        self.audit.wire(wire);
        self.notices()
    }

    fn notices(&mut self) -> Vec<Notice> {
        let news = self.audit.news();
        let notices: Vec<Notice> = news
            .into_iter()
            .map(|found| Notice {
                message: self.recent.get(found.message),
                found,
            })
            .collect();
        for notice in &notices {
            let name = (notice.found.manufacturer.clone(), notice.found.serial_number.clone());
            let glance = self.names.get(&name).and_then(|key| self.glances.get_mut(key));
            if let Some(glance) = glance {
                glance.note(notice);
            }
        }
        notices
    }

    /// Time goes by: tells who has fallen silent by now.
    pub fn pass(&mut self, now: Stamp) -> Vec<Notice> {
        let mut notices = Vec::new();
        for glance in self.glances.values_mut() {
            let Some(alarm) = glance.alarms.pass(now.moment) else {
                continue;
            };
            if let Alarm::Silent(silent) = alarm
                && self.judges_silence
                && let Some(found) = glance.silence(now.utc, silent)
            {
                notices.push(Notice { found, message: None });
            }
            self.alarms.push(glance.alarmed(now.utc, alarm));
        }
        notices
    }

    /// Nothing could be seen until now: nobody has fallen silent meanwhile.
    pub fn unseen(&mut self, now: Moment) {
        for glance in self.glances.values_mut() {
            glance.alarms.unseen(now);
        }
    }

    /// What somebody has to be told since this was asked last.
    pub fn alarms(&mut self) -> Vec<Alarmed> {
        std::mem::take(&mut self.alarms)
    }

    /// The vehicles with the worst findings first, by name where they are alike.
    #[must_use]
    pub fn worst_first(&self) -> Vec<&VehicleStatus> {
        let mut all: Vec<&VehicleStatus> = self.glances.values().collect();
        all.sort_by_cached_key(|glance| {
            let kinds = |verdict| std::cmp::Reverse(glance.found(verdict));
            let name = (glance.manufacturer.clone(), glance.serial_number.clone());
            (kinds(Verdict::Fail), kinds(Verdict::Warning), name)
        });
        all
    }

    /// The vehicles that were heard.
    pub fn glances(&self) -> impl ExactSizeIterator<Item = &VehicleStatus> {
        self.glances.values()
    }

    /// Messages on topics of no vehicle, or of one that is not wanted.
    #[must_use]
    pub fn elsewhere(&self) -> u64 {
        self.elsewhere
    }

    /// What came out of all.
    #[must_use]
    pub fn finish(self) -> AuditResult {
        let silent = self.glances.values().filter(|glance| glance.is_silent());
        let found: Vec<(&VehicleStatus, &Kind)> =
            silent.filter_map(|glance| Some((glance, glance.silences()?))).collect();
        let mut result = self.audit.finish(Vec::new());
        for (glance, kind) in found {
            // What is still going on no message has shown yet.
            result.add((&glance.manufacturer, &glance.serial_number), kind.as_result());
        }
        result
    }
}

#[cfg(test)]
mod tests;
