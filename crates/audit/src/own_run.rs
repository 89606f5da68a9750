//! The journal of one of our own runs: judged by all monitors, as the run was, since it holds all they need.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::Options;
use super::courses::Courses;
use super::result::{FindingResult, SideResult, VehicleResult};
use super::time_line::TimeLine;
use tck_base::verdict::Verdict;
use tck_capture::{Item, Recorded};
use tck_journal::Entry;
use tck_journal::event::{Event, Record, RunHeader};
use tck_judge::{JudgeError, MessageTally, Observed, Rules, TrafficJudge};
use tck_pack::{Pack, Role};
use tck_view::Topic;

/// Why the journal of a run cannot be judged.
#[derive(Debug, thiserror::Error)]
pub enum OwnRunError {
    /// It is about something else.
    #[error(transparent)]
    Judge(#[from] JudgeError),
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
}

/// Judges the rest of a journal behind its first record.
///
/// # Errors
/// It cannot be read or judged.
pub fn own_run(
    rules: &Rules,
    options: &Options,
    recording: usize,
    first: Record,
    recorded: &mut Recorded,
) -> Result<VehicleResult, OwnRunError> {
    let header = match &first.event {
        Event::RunBegun { header } => (**header).clone(),
        _ => return Err(JudgeError::NoHeader.into()),
    };
    let mut judge =
        TrafficJudge::begin(rules, &header, &|monitor| options.wants_monitor(monitor))?.among_others(&header);
    let mut found: BTreeMap<(String, String, Verdict), FindingResult> = BTreeMap::new();
    let mut messages = BTreeMap::new();
    let pack: Option<&Arc<Pack>> = rules.packs.get(&header.protocol);
    let mut courses = Courses::default();
    let mut last = first.at;
    let mut is_whole = false;
    let mut tally = pack.map(MessageTally::new);
    keep(&mut found, judge.observe(&Entry::new(first)), recording, last.utc);
    while let Some(item) = recorded.read()? {
        let Item::Record(record) = item else { continue };
        last = record.at;
        if let Some(name) = topic(&record.event, &header) {
            *messages.entry(name).or_default() += 1;
        }
        let ended = matches!(record.event, Event::RunEnded { .. });
        let entry = Entry::new(*record);
        let message = of_vehicle(entry.event(), &header)
            .zip(pack)
            .and_then(|(name, pack)| entry.view(Topic::of_name(name), pack.names()));
        if let Some(message) = message {
            courses.note(entry.seq(), message, |span| {
                found.values().any(|known| span.contains(&known.message))
            });
        }
        let name = match entry.event() {
            Event::Message { topic, .. } | Event::Sent { topic, .. } => named(topic, &header),
            _ => None,
        };
        if let (Some(tally), Some(name), Some(message)) = (&mut tally, name, entry.json()) {
            tally.note(&name, message);
        }
        keep(&mut found, judge.observe(&entry), recording, last.utc);
        is_whole |= ended;
        if ended {
            keep(&mut found, judge.finish(last.moment), recording, last.utc);
        }
    }
    let role = if header.role == Role::MasterControl.word() {
        Role::MasterControl
    } else {
        Role::Agv
    };
    let judged = judge.judged().values().filter(|judged| **judged > 0).count();
    let decided: BTreeSet<(String, String)> = judge.decided().into_iter().collect();
    let seen = messages.values().sum();
    let side = SideResult::new(role, seen, judged, found.into_values().collect(), decided, Vec::new());
    // What a run that was cut short would have shown nobody knows.
    let side = side.unless((!is_whole).then_some("the journal ends before its run does"));
    let sides = vec![side];
    Ok(VehicleResult {
        topics: header.topics.get("state").cloned().unwrap_or_default(),
        manufacturer: header.manufacturer,
        serial_number: header.serial_number,
        protocol: Some(header.protocol),
        stretch: None,
        not_judged: None,
        messages,
        holes: 0,
        twice: 0,
        retained: 0,
        vantage: header.vantage,
        hints: Vec::new(),
        time_line: TimeLine::default(),
        message_coverage: tally.map(|tally| tally.result().only_missing()),
        courses: courses.finish(&sides),
        sides,
    })
}

/// The topic name of a message of the device that came.
fn topic(event: &Event, header: &RunHeader) -> Option<String> {
    let Event::Message { topic, .. } = event else {
        return None;
    };
    named(topic, header)
}

/// The topic name of a full topic of the run.
fn named(topic: &str, header: &RunHeader) -> Option<String> {
    let of_vehicles = header.vehicles.iter().map(|vehicle| &vehicle.topics);
    let mut all = std::iter::once(&header.topics).chain(of_vehicles).flatten();
    all.find(|(_, full)| full.as_str() == topic)
        .map(|(name, _)| name.clone())
}

/// The topic name of a message to or from the vehicle that the run is about.
fn of_vehicle<'h>(event: &Event, header: &'h RunHeader) -> Option<&'h str> {
    let (Event::Message { topic, .. } | Event::Sent { topic, .. }) = event else {
        return None;
    };
    let mut topics = header.topics.iter();
    topics.find(|(_, full)| *full == topic).map(|(name, _)| name.as_str())
}

fn keep(
    found: &mut BTreeMap<(String, String, Verdict), FindingResult>,
    all: Vec<Observed>,
    recording: usize,
    at: jiff::Timestamp,
) {
    for observed in all {
        keep_one(found, observed, recording, at);
    }
}

fn keep_one(
    found: &mut BTreeMap<(String, String, Verdict), FindingResult>,
    observed: Observed,
    recording: usize,
    at: jiff::Timestamp,
) {
    let Observed { monitor, finding } = observed;
    let key = (monitor.clone(), finding.requirement.clone(), finding.verdict);
    let at = format!("{at:.3}");
    let known = found.entry(key).or_insert_with(|| FindingResult {
        monitor,
        requirement: finding.requirement,
        verdict: finding.verdict,
        count: 0,
        message: finding.first.first().copied().unwrap_or_default(),
        recording: Some(recording),
        line: finding.first.first().copied(),
        first: at.clone(),
        last: at.clone(),
        text: finding.message,
        shown: None,
        interpretation: finding.interpretation,
    });
    known.count += finding.count;
    known.last = at;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A journal that is kept, as far as its first lines go.
    fn vehicle(journal: &str, lines: usize) -> VehicleResult {
        let journals = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/journals");
        let text = std::fs::read_to_string(format!("{journals}/{journal}/journal.jsonl")).expect("fixture");
        let some: Vec<&str> = text.lines().take(lines).collect();
        let reader = Box::new(std::io::Cursor::new(some.join("\n")));
        let mut recorded: Recorded = tck_capture::Lines::new(reader, 0, tck_capture::Mapping::default()).into();
        let Some(Item::Record(first)) = recorded.read().expect("readable") else {
            panic!("no journal");
        };
        let rules = &tck_testing::library().rules;
        own_run(rules, &Options::default(), 0, *first, &mut recorded).expect("judged")
    }

    fn judged(lines: usize) -> SideResult {
        let vehicle = vehicle("refusal-corrected-level", lines);
        vehicle.sides.into_iter().next().expect("a side")
    }

    #[test]
    fn the_order_is_drawn_that_the_vehicle_has_and_not_the_one_that_it_refused() {
        let courses = vehicle("refusal-corrected-references", usize::MAX).courses;
        let [course] = courses.as_slice() else {
            panic!("{courses:#?}");
        };
        assert_eq!((course.message, course.update), (Some(33), Some(1)));
        let nodes: Vec<(&str, bool)> = course
            .nodes
            .iter()
            .map(|node| (node.id.as_str(), node.released))
            .collect();
        assert_eq!(nodes, [("A1", true), ("A2", true), ("A3", true), ("A4", false)]);
        assert_eq!(course.trail, [(0.0, 0.0), (0.0, 2.0), (0.0, 4.0)]);
        assert_eq!((course.found[0].number, course.found[0].place), (47, Some((0.0, 0.0))));
    }

    #[test]
    fn a_run_that_was_cut_short_keeps_nothing() {
        let kept = |side: &SideResult| {
            let mut requirements = side.requirements.iter();
            requirements.any(|known| known.verdict == Verdict::Pass)
        };
        let whole = judged(usize::MAX);
        assert!(kept(&whole) && whole.not_judged.is_none(), "{whole:#?}");
        for lines in [1, 3, 30] {
            let cut = judged(lines);
            assert!(!kept(&cut) && cut.verdict != Some(Verdict::Pass), "{lines}: {cut:#?}");
            assert!(cut.not_judged.is_some(), "{lines}");
        }
    }
}
