//! The smallest recording that still shows a finding: what a bug report needs, judged alike by whoever gets it.
//!
//! The messages before the finding are taken back as far as needed, and then left out one after the other as long as the
//! finding stays.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Value, json};

use super::{Audit, AuditError, Options};
use tck_base::clock::{Moment, Stamp};
use tck_base::verdict::Verdict;
use tck_capture::Message;
use tck_journal::Payload;
use tck_journal::event::{Event, Record, RunHeader, Source};
use tck_judge::Rules;
use tck_view::{MessageView, Names, Topic};

use super::arrived::timestamp;
use super::result::{AuditResult, Recording};

/// How often messages are judged again at most, counted in messages.
const EFFORT: usize = 2_000_000;

/// What is to be shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// Manufacturer of the vehicle.
    pub manufacturer: String,
    /// Its serial number.
    pub serial_number: String,
    /// `agv` or `master-control`.
    pub role: String,
    /// Id of the monitor.
    pub monitor: String,
    /// The requirement.
    pub requirement: String,
    /// The verdict.
    pub verdict: Verdict,
    /// Number of the first message that shows it.
    pub message: u64,
}

impl Target {
    /// The first finding of a requirement or of a monitor of that name, the worst ones before others.
    #[must_use]
    pub fn find(result: &AuditResult, wanted: &str) -> Option<Self> {
        let mut all = Vec::new();
        for vehicle in &result.vehicles {
            for side in &vehicle.sides {
                let findings = side.findings.iter().chain(&side.information);
                let named = findings.filter(|finding| finding.requirement == wanted || finding.monitor == wanted);
                all.extend(named.map(|finding| Self {
                    manufacturer: vehicle.manufacturer.clone(),
                    serial_number: vehicle.serial_number.clone(),
                    role: side.role.clone(),
                    monitor: finding.monitor.clone(),
                    requirement: finding.requirement.clone(),
                    verdict: finding.verdict,
                    message: finding.message,
                }));
            }
        }
        all.into_iter()
            .min_by_key(|target| (std::cmp::Reverse(target.verdict), target.message))
    }

    fn is_shown(&self, rules: &Rules, options: &Options, messages: &[Message]) -> Result<bool, AuditError> {
        let options = Options {
            only: vec![self.monitor.clone()],
            vehicles: vec![self.vehicle()],
            ..options.clone()
        };
        let mut audit = Audit::new(rules, options)?;
        for message in messages {
            audit.observe(message.clone());
        }
        let result = audit.finish(Vec::new());
        let sides = result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
        let mut findings = sides
            .filter(|side| side.role == self.role)
            .flat_map(|side| side.findings.iter().chain(&side.information));
        Ok(findings.any(|finding| {
            finding.requirement == self.requirement
                && finding.monitor == self.monitor
                && finding.verdict == self.verdict
        }))
    }

    /// The vehicle as it is named on the command line.
    #[must_use]
    pub fn vehicle(&self) -> String {
        if self.manufacturer.is_empty() {
            return self.serial_number.clone();
        }
        format!("{}/{}", self.manufacturer, self.serial_number)
    }
}

/// The smallest part of these messages of the vehicle that shows the target; `None` when not even all of them do.
///
/// # Errors
/// What is wrong with the options.
pub fn smallest(
    rules: &Rules,
    options: &Options,
    target: &Target,
    all: &[Message],
) -> Result<Option<Vec<Message>>, AuditError> {
    let mut spent = 0;
    let mut shows = |messages: &[Message]| {
        spent += messages.len();
        Ok::<_, AuditError>(spent <= EFFORT && target.is_shown(rules, options, messages)?)
    };
    // What comes before is taken back step by step.
    let mut length = 1;
    let mut kept = loop {
        let part = &all[all.len().saturating_sub(length)..];
        if shows(part)? {
            break part.to_vec();
        }
        if length >= all.len() {
            return Ok(None);
        }
        length *= 2;
    };
    let mut step = kept.len().div_ceil(2);
    loop {
        let (mut at, before) = (0, kept.len());
        while at < kept.len() {
            let end = (at + step).min(kept.len());
            let without: Vec<Message> = kept[..at].iter().chain(&kept[end..]).cloned().collect();
            if !without.is_empty() && shows(&without)? {
                kept = without;
            } else {
                at = end;
            }
        }
        if step == 1 && kept.len() == before {
            return Ok(Some(kept));
        }
        step = if step == 1 { 1 } else { step.div_ceil(2) };
    }
}

/// A message as a journal holds it, so that what is judged is what is written.
#[must_use]
pub fn written(message: Message) -> Message {
    let said = || {
        let view = MessageView::of_slice(Topic::Other, &message.payload, &Names::default()).ok()?;
        timestamp(&view)
    };
    Message {
        at: message.at.or_else(said).or(Some(jiff::Timestamp::UNIX_EPOCH)),
        qos: message.qos.or(Some(0)),
        retain: message.retain.or(Some(false)),
        carried: None,
        ..message
    }
}

/// What a slice is a part of, and what it shows: which lines of which recordings, with their hashes.
#[must_use]
pub fn origin(target: &Target, messages: &[Message], recordings: &[Recording]) -> Value {
    let mut lines: BTreeMap<usize, Vec<u64>> = BTreeMap::new();
    for message in messages {
        lines.entry(message.place.file).or_default().push(message.place.line);
    }
    let recordings = lines.into_iter().filter_map(|(file, lines)| {
        let recording = recordings.get(file)?;
        Some(json!({ "name": recording.name, "sha256": recording.sha256, "unit": recording.unit, "places": lines }))
    });
    json!({
        "recordings": recordings.collect::<Vec<_>>(),
        "vehicle": target.vehicle(),
        "role": target.role,
        "requirement": target.requirement,
        "monitor": target.monitor,
        "verdict": target.verdict,
        "repeat": format!("vda5050-tck audit SLICE --only {}", target.monitor),
    })
}

/// The records of a journal with these messages; the first one says what they are a part of.
pub fn records(messages: Vec<Message>, origin: Value) -> impl Iterator<Item = Record> {
    let first = messages.first().and_then(|message| message.at).unwrap_or_default();
    let stamp = move |at: Option<jiff::Timestamp>| {
        let utc = at.unwrap_or(first);
        let since = utc.as_microsecond().saturating_sub(first.as_microsecond());
        let since = Duration::from_micros(u64::try_from(since).unwrap_or_default());
        Stamp {
            moment: Moment::START + since,
            utc,
        }
    };
    let header = RunHeader {
        format: "vda5050-tck.journal/1".to_owned(),
        tool: tck_journal::tool(),
        vantage: "subscriber".to_owned(),
        bindings: [("slice".to_owned(), origin)].into_iter().collect(),
        ..RunHeader::default()
    };
    let begun = Record {
        seq: 1,
        at: stamp(Some(first)),
        source: Source::Harness,
        direction: None,
        event: Event::RunBegun {
            header: Box::new(header),
        },
    };
    let heard = messages.into_iter().zip(2..).map(move |(message, seq)| Record {
        seq,
        at: stamp(message.at),
        source: Source::Link,
        direction: None,
        event: Event::Message {
            topic: message.topic,
            qos: message.qos.unwrap_or_default(),
            retain: message.retain.unwrap_or_default(),
            dup: false,
            payload: Payload::keep(message.payload),
        },
    });
    std::iter::once(begun).chain(heard)
}

#[cfg(test)]
mod tests {
    use super::super::tests::traffic;
    use super::*;
    use tck_pack::Role;

    #[test]
    fn as_few_messages_as_show_a_finding_are_left_and_a_journal_of_them_shows_it() {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        for (role, tests, fault, requirement) in [
            (Role::Agv, "order-acceptance/", "horizon-not-reported", "STATE-12"),
            (
                Role::Agv,
                "order-acceptance/base-and-horizon",
                "boolean-as-text",
                "JSON-07",
            ),
            (Role::MasterControl, "dispatch/", "other-serial-number", "HDR-05"),
        ] {
            let messages = traffic(library, pack, role, tests, &[fault]);
            let mut audit = Audit::new(&library.rules, Options::default()).expect("options");
            for message in &messages {
                audit.observe(message.clone());
            }
            let result = audit.finish(Vec::new());
            let target = Target::find(&result, requirement).expect("a finding");
            let all: Vec<Message> = messages.into_iter().map(written).collect();
            let options = Options::default();
            let part = smallest(&library.rules, &options, &target, &all)
                .expect("options")
                .expect("it is shown");
            assert!(
                part.len() * 4 < all.len() || part.len() < 4,
                "{fault}: {} of {}",
                part.len(),
                all.len()
            );
            for left_out in 0..part.len() {
                let mut less = part.clone();
                less.remove(left_out);
                let shown = !less.is_empty() && target.is_shown(&library.rules, &options, &less).expect("options");
                assert!(!shown, "{fault}: {left_out} is not needed");
            }
            let text: Vec<String> = records(part.clone(), origin(&target, &part, &[]))
                .map(|record| serde_json::to_string(&record).expect("JSON"))
                .collect();
            let lines = tck_capture::Lines::new(
                Box::new(std::io::Cursor::new(text.join("\n"))),
                0,
                tck_capture::Mapping::default(),
            );
            let mut merged =
                tck_capture::merge::Merged::new(vec![("slice".to_owned(), lines.into())]).expect("readable");
            let mut audit = Audit::new(&library.rules, Options::default()).expect("options");
            while let Some(told) = merged.read().expect("readable") {
                audit.take(told);
            }
            let again = Target::find(&audit.finish(Vec::new()), requirement);
            assert_eq!(again.map(|target| target.monitor), Some(target.monitor), "{fault}");
        }
        assert_eq!(
            Target::find(
                &Audit::new(&library.rules, Options::default())
                    .expect("options")
                    .finish(Vec::new()),
                "X"
            ),
            None
        );
    }
}
