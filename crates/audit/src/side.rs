//! One side of a vehicle's traffic: what the vehicle says, or what is said to it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use super::arrived::{Arrived, as_shown};
use super::continuity::Missing;
use super::new_findings::Found;
use super::outcome::Outcome;
use super::result::{FindingResult, SideResult, Stretch, Undecided, Whereabouts};
use super::span::{self, Span};
use super::{AuditContext, finding_group, is_command};
use tck_base::clock::{Moment, Stamp};
use tck_base::verdict::Verdict;
use tck_journal::Entry;
use tck_journal::event::{Event, Record, RunHeader, Source};
use tck_judge::{Observed, TrafficJudge};
use tck_pack::{Pack, Role};
use tck_report::clean::short;
use tck_result::MonitorFinding;
use tck_suite::model::{Monitor, Recordings};

/// How many findings wait for their confirmation.
const OPEN: usize = 256;
/// How many findings can still be taken back.
const REVOCABLE: usize = 256;
/// How many messages of a side are kept to be shown, and how many characters of each.
const SHOWN: usize = 32;
const LENGTH: usize = 4_000;
/// How many different findings a side keeps.
const DIFFERENT: usize = 512;

/// How many causes are told apart, of one requirement.
const CAUSES: usize = 16;

/// Why what needs packets is not judged.
const PACKETS: &str = "only the packets between device and broker show it";

/// Monitor, requirement and verdict, and the cause.
type Key = ((String, String, Verdict), String);

/// How many stretches that were not compared a side keeps.
const STRETCHES: usize = 32;

/// Why messages are not held against those before them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Apart {
    /// Nothing came yet where judging could begin.
    NotBegun,
    /// Messages are missing.
    Missing,
    /// A command and a state crossed.
    Crossed,
    /// The vehicle was away, or may have been.
    Connection,
}

impl Apart {
    fn why(self) -> &'static str {
        match self {
            Self::NotBegun => {
                "before the first state without an order and an action under way nobody knows what was sent"
            }
            Self::Missing => {
                "messages are missing; it goes on at the next state without an order and an action under way"
            }
            Self::Crossed => {
                "a command and a state crossed; it goes on at the next state without an order and an action under way"
            }
            Self::Connection => {
                "the connection changed; it goes on at the next state without an order and an action under way"
            }
        }
    }
}

/// Monitors that need the same to be unbroken.
struct Duty {
    span: Span,
    /// Nothing before it can begin, and behind a hole.
    judge: Option<TrafficJudge>,
}

/// A finding that holds only if nothing turns out to be missing.
struct Open {
    span: Span,
    at: Moment,
    observed: Observed,
    utc: jiff::Timestamp,
    entry: Arc<Entry>,
}

/// A finding that was counted.
struct Revocable {
    span: Span,
    at: Moment,
    key: Key,
    count: u64,
    /// When the one before it was made.
    before: String,
}

/// One side of a vehicle's traffic: what the vehicle says, or what is said to it.
pub(super) struct Side {
    pub role: Role,
    header: RunHeader,
    /// Whether the recording says when messages came.
    timed: bool,
    begun: Stamp,
    each: TrafficJudge,
    /// Those that need an unbroken record of something, from where it is one.
    duties: Vec<Duty>,
    /// The factsheet that counts, as this side is shown it.
    sheet: Option<Arc<Entry>>,
    /// Whether there was one.
    had_sheet: bool,
    pub kept: BTreeMap<Key, FindingResult>,
    /// What holds only if nothing turns out to be missing.
    open: VecDeque<Open>,
    /// What was found last: what turns out to be missing later may explain it.
    revocable: VecDeque<Revocable>,
    /// How many messages are kept to be shown.
    shown: usize,
    judged: BTreeMap<String, u64>,
    decided: BTreeSet<(String, String)>,
    pub messages: u64,
    /// Whether something came without which nothing can be said of this side.
    spoke: bool,
    /// Why nothing is compared at the moment.
    apart: Apart,
    compared: u64,
    not_compared: u64,
    stretches: Vec<Stretch>,
    /// Whether the last message belongs to the last stretch.
    in_stretch: bool,
    /// What was found since it was taken last, where somebody wants to know at once.
    pub news: Vec<Found>,
}

impl Side {
    /// Begins; `None` when the rules have no such side.
    pub fn begin(role: Role, header: RunHeader, begun: Stamp, timed: bool, scene: AuditContext<'_>) -> Option<Self> {
        let mut each = start(&header, scene, &judges_each_message)?;
        each.observe(&first(&header, begun));
        let has = |span: Span| {
            let mut monitors = of_side(scene, role, &header);
            span == Span::Conversation
                || monitors.any(|monitor| Span::of(monitor, role, timed, scene.rules) == Some(span))
        };
        let duties = Span::ALL.into_iter().filter(|span| has(*span));
        let duties: Vec<Duty> = duties.map(|span| Duty { span, judge: None }).collect();
        let mut side = Self {
            role,
            header,
            timed,
            begun,
            each,
            duties,
            sheet: None,
            had_sheet: false,
            kept: BTreeMap::new(),
            open: VecDeque::new(),
            revocable: VecDeque::new(),
            shown: 0,
            judged: BTreeMap::new(),
            decided: BTreeSet::new(),
            messages: 0,
            spoke: false,
            apart: Apart::NotBegun,
            compared: 0,
            not_compared: 0,
            stretches: Vec::new(),
            in_stretch: false,
            news: Vec::new(),
        };
        side.mended(scene, |span| span == Span::Factsheet);
        Some(side)
    }

    /// Whether the monitors that hold messages of both sides against each other are on duty.
    pub fn watches(&self) -> bool {
        let mut duties = self.duties.iter();
        duties.any(|duty| duty.span == Span::Conversation && duty.judge.is_some())
    }

    /// Whether all are on duty that begin where nothing is under way.
    pub fn is_complete(&self) -> bool {
        let mut duties = self.duties.iter().filter(|duty| duty.span.begins_at_rest());
        duties.all(|duty| duty.judge.is_some())
    }

    /// Something is not known since then, for this reason.
    pub fn broken(&mut self, since: Moment, missing: Missing, why: Apart) {
        self.open
            .retain(|open| open.at < since || !open.span.is_touched(missing));
        self.take_back(since, missing);
        if matches!(missing, Missing::Factsheet | Missing::Anything) {
            self.sheet = None;
        }
        if self.watches() && Span::Conversation.is_touched(missing) {
            self.apart = why;
        }
        self.end(|span| span.is_touched(missing));
    }

    /// Ends what the monitors of these spans remember.
    pub fn end(&mut self, wanted: impl Fn(Span) -> bool) {
        let duties = self.duties.iter_mut().filter(|duty| wanted(duty.span));
        let ended: Vec<TrafficJudge> = duties.filter_map(|duty| duty.judge.take()).collect();
        for judge in ended {
            self.absorb(&judge);
        }
    }

    /// Takes back what was found since then and what is missing may explain.
    fn take_back(&mut self, since: Moment, missing: Missing) {
        let mut kept = VecDeque::new();
        while let Some(last) = self.revocable.pop_back() {
            if last.at < since {
                kept.push_front(last);
                break;
            }
            if !last.span.is_touched(missing) {
                kept.push_front(last);
                continue;
            }
            if let Some(known) = self.kept.get_mut(&last.key) {
                known.count = known.count.saturating_sub(last.count);
                known.last = last.before;
                if known.count == 0 {
                    self.kept.remove(&last.key);
                }
            }
        }
        self.revocable.append(&mut kept);
    }

    /// Counts a message of this side, and whether it is held against those before it.
    pub fn note(&mut self, arrived: &Arrived, scene: AuditContext<'_>) {
        self.spoke |= arrived.name == "state" || is_command(&arrived.name);
        if arrived.stale {
            return;
        }
        if self.watches() {
            self.compared += 1;
            self.in_stretch = false;
            return;
        }
        self.not_compared += 1;
        let why = self.apart.why();
        let place = scene.places.of(arrived.number);
        let at = format!("{:.3}", arrived.at.utc);
        let whence = Whereabouts {
            message: arrived.number,
            recording: place.map(|place| place.file),
            line: place.map(|place| place.line),
            at,
        };
        let is_full = self.stretches.len() >= STRETCHES;
        match self.stretches.last_mut() {
            Some(last) if self.in_stretch && last.why == why => {
                last.messages += 1;
                last.to = whence;
            }
            _ if is_full => self.in_stretch = false,
            _ => {
                self.in_stretch = true;
                self.stretches.push(Stretch {
                    messages: 1,
                    from: whence.clone(),
                    to: whence,
                    why: why.to_owned(),
                });
            }
        }
    }

    /// From here on nothing is missing of these spans, as far as can be told.
    pub fn mended(&mut self, scene: AuditContext<'_>, wanted: impl Fn(Span) -> bool) {
        let (role, timed) = (self.role, self.timed);
        for duty in &mut self.duties {
            if duty.judge.is_some() || !wanted(duty.span) {
                continue;
            }
            let span = Some(duty.span);
            let used = |monitor: &Monitor| Span::of(monitor, role, timed, scene.rules) == span;
            let Some(mut judge) = start(&self.header, scene, &used) else {
                continue;
            };
            judge.observe(&first(&self.header, self.begun));
            // What it finds in a message from before was found before.
            let is_counted = role == Role::Agv && duty.span == Span::Factsheet;
            if let Some(sheet) = self.sheet.as_ref().filter(|_| !is_counted) {
                judge.observe(sheet);
            }
            duty.judge = Some(judge);
        }
    }

    /// Nothing was missing up to a message on this topic. What the states alone show waits for the next state: only that one tells
    /// whether another one was lost.
    pub fn confirmed(&mut self, by: &str, scene: AuditContext<'_>) {
        let mut waiting = VecDeque::new();
        while let Some(open) = self.open.pop_front() {
            if open.span == Span::States && by != "state" {
                waiting.push_back(open);
            } else {
                self.count(open, scene);
            }
        }
        self.open = waiting;
    }

    /// Counts a finding that can still be taken back.
    fn count(&mut self, open: Open, scene: AuditContext<'_>) {
        let Open {
            span,
            at,
            observed,
            utc,
            entry,
        } = open;
        let key = self.key(&observed.monitor, &observed.finding);
        let count = observed.finding.count;
        let before = self.kept.get(&key).map(|known| known.last.clone()).unwrap_or_default();
        self.keep(observed, utc, Some(&entry), scene);
        if self.revocable.len() == REVOCABLE {
            self.revocable.pop_front();
        }
        self.revocable.push_back(Revocable {
            span,
            at,
            key,
            count,
            before,
        });
    }

    /// Shows it a message, whose clock is that far from the recorder's.
    pub fn observe(&mut self, arrived: &Arrived, own: bool, apart: i64, scene: AuditContext<'_>) {
        let is_sheet = arrived.name == "factsheet";
        if arrived.stale && !own && !is_sheet {
            return;
        }
        let entry = as_shown(arrived, own, apart, arrived.stale);
        for observed in self.each.observe(&entry) {
            self.keep(observed, arrived.at.utc, Some(&entry), scene);
        }
        // A factsheet that was stored counts like one that comes, and is no evidence.
        let live = if is_sheet && arrived.stale {
            as_shown(arrived, own, apart, false)
        } else {
            entry
        };
        if is_sheet {
            self.sheet = Some(Arc::clone(&live));
            self.had_sheet = true;
        }
        let mut found = Vec::new();
        for duty in &mut self.duties {
            let is_counted = own && is_sheet && arrived.stale && duty.span == Span::Factsheet;
            let Some(judge) = duty
                .judge
                .as_mut()
                .filter(|_| duty.span.hears(&arrived.name) && !is_counted)
            else {
                continue;
            };
            let observed = judge.observe(&live).into_iter().map(|observed| (duty.span, observed));
            found.extend(observed.filter(|_| !(is_sheet && arrived.stale)));
        }
        for (span, observed) in found {
            let open = Open {
                span,
                at: live.at().moment,
                observed,
                utc: arrived.at.utc,
                entry: Arc::clone(&live),
            };
            if !span.waits() {
                self.count(open, scene);
                continue;
            }
            if self.open.len() == OPEN {
                self.open.pop_front();
            }
            self.open.push_back(open);
        }
    }

    /// Counts a finding, made at this entry.
    fn keep(&mut self, observed: Observed, utc: jiff::Timestamp, entry: Option<&Arc<Entry>>, scene: AuditContext<'_>) {
        let Observed { monitor, finding } = observed;
        let key = self.key(&monitor, &finding);
        let last = format!("{utc:.3}");
        let message = finding.first.first().copied().unwrap_or_default();
        if scene.live {
            let known = self.kept.get(&key).map_or(0, |known| known.count);
            self.news.push(Found {
                manufacturer: self.header.manufacturer.clone(),
                serial_number: self.header.serial_number.clone(),
                role: self.role.word().to_owned(),
                monitor: monitor.clone(),
                requirement: finding.requirement.clone(),
                verdict: finding.verdict,
                count: known + finding.count,
                before: known,
                message,
                at: last.clone(),
                text: finding.message.clone(),
                interpretation: finding.interpretation.clone(),
            });
        }
        if let Some(known) = self.kept.get_mut(&key) {
            known.count += finding.count;
            known.last = last;
            return;
        }
        if self.kept.len() >= DIFFERENT {
            return;
        }
        let place = scene.places.of(message);
        let finding = FindingResult {
            monitor,
            requirement: finding.requirement,
            verdict: finding.verdict,
            count: finding.count,
            message,
            recording: place.map(|place| place.file),
            line: place.map(|place| place.line),
            first: last.clone(),
            last,
            text: finding.message,
            shown: self.show(message, entry),
            interpretation: finding.interpretation,
        };
        self.kept.insert(key, finding);
    }

    /// The message of that number, where it is the one at which something was found.
    fn show(&mut self, message: u64, entry: Option<&Arc<Entry>>) -> Option<String> {
        let json = entry.filter(|entry| entry.seq() == message)?.json()?;
        if self.shown >= SHOWN {
            return None;
        }
        self.shown += 1;
        let text = serde_json::to_string_pretty(json).ok()?;
        Some(short(&text, LENGTH).into_owned())
    }

    /// Takes over what was found of its connections.
    pub fn wired(&mut self, outcome: Outcome, scene: AuditContext<'_>) {
        for (id, judged) in outcome.judged {
            *self.judged.entry(id).or_default() += judged;
        }
        self.decided.extend(outcome.decided);
        for (observed, utc) in outcome.found {
            self.keep(observed, utc, None, scene);
        }
    }

    /// What a finding is counted with: others of the same cause, or all others where there are too many causes.
    fn key(&self, monitor: &str, finding: &MonitorFinding) -> Key {
        let group = (monitor.to_owned(), finding.requirement.clone(), finding.verdict);
        let key = (group, finding_group::of(&finding.message));
        let causes = self.kept.range((key.0.clone(), String::new())..);
        let causes = causes.take_while(|(known, _)| known.0 == key.0).count();
        if self.kept.contains_key(&key) || causes < CAUSES {
            return key;
        }
        (key.0, String::new())
    }

    fn absorb(&mut self, judge: &TrafficJudge) {
        for (id, judged) in judge.judged() {
            *self.judged.entry(id).or_default() += judged;
        }
        self.decided.extend(judge.decided());
    }

    /// Why a monitor judged nothing, and for which stretch that holds.
    fn why_undecided(&self, monitor: &Monitor, scene: AuditContext<'_>) -> (String, Option<Stretch>) {
        let is_without_sheet = !self.had_sheet && span::needs_factsheet(monitor, scene.rules);
        let span = Span::of(monitor, self.role, self.timed, scene.rules);
        let why = match &monitor.recordings {
            Recordings::Never(why) => why,
            Recordings::UnbrokenInTime if !self.timed => "the recording does not say when messages came",
            Recordings::Packets => PACKETS,
            _ if is_without_sheet => "no factsheet of the vehicle was recorded",
            _ if self.not_compared > 0 && span.is_some_and(Span::begins_at_rest) => {
                return match (self.compared, self.not_compared_stretch()) {
                    (0, stretch) => (self.apart.why().to_owned(), stretch),
                    (_, stretch) => (
                        "nothing came that it could judge where messages were held against earlier ones".to_owned(),
                        stretch,
                    ),
                };
            }
            _ => "nothing came that it could judge",
        };
        (why.to_owned(), None)
    }

    /// From the first message to the last one that was not held against those before it.
    fn not_compared_stretch(&self) -> Option<Stretch> {
        let (first, last) = (self.stretches.first()?, self.stretches.last()?);
        Some(Stretch {
            messages: self.not_compared,
            from: first.from.clone(),
            to: last.to.clone(),
            why: first.why.clone(),
        })
    }

    /// What came out.
    pub fn finish(mut self, scene: AuditContext<'_>) -> SideResult {
        // What is found at the very end may be explained by what comes next.
        self.open.clear();
        let ended: Vec<TrafficJudge> = self.duties.iter_mut().filter_map(|duty| duty.judge.take()).collect();
        for judge in &ended {
            self.absorb(judge);
        }
        for (id, judged) in self.each.judged() {
            *self.judged.entry(id).or_default() += judged;
        }
        self.decided.extend(self.each.decided());
        let mut undecided = Vec::new();
        for monitor in of_side(scene, self.role, &self.header) {
            if self.judged.get(&monitor.id).is_some_and(|judged| *judged > 0) && !is_never(monitor) {
                continue;
            }
            let (why, stretch) = self.why_undecided(monitor, scene);
            undecided.push(Undecided {
                monitor: monitor.id.clone(),
                why,
                stretch,
            });
        }
        let findings = self.kept.into_values().collect();
        let judged = self.judged.values().filter(|judged| **judged > 0).count();
        // Who asks for certain monitors knows what he wants to see.
        let not_judged = (!self.spoke && scene.options.only.is_empty()).then_some(match self.role {
            Role::Agv => "no state of it was recorded",
            Role::MasterControl => "no command of it was recorded",
        });
        let (compared, not_compared, stretches) = (self.compared, self.not_compared, self.stretches);
        SideResult {
            compared,
            not_compared,
            stretches,
            ..SideResult::new(self.role, self.messages, judged, findings, self.decided, undecided)
        }
        .unless(not_judged)
    }
}

/// Whether no recording can be judged by a monitor, whatever came.
fn is_never(monitor: &Monitor) -> bool {
    matches!(monitor.recordings, Recordings::Never(_))
}

/// Whether a monitor judges each message, whatever else is missing.
fn judges_each_message(monitor: &Monitor) -> bool {
    matches!(monitor.recordings, Recordings::Message | Recordings::MessageOnTopic)
}

pub(super) fn start(
    header: &RunHeader,
    scene: AuditContext<'_>,
    used: &dyn Fn(&Monitor) -> bool,
) -> Option<TrafficJudge> {
    let wanted = |monitor: &Monitor| used(monitor) && scene.options.wants_monitor(monitor);
    TrafficJudge::begin(scene.rules, header, &wanted).ok()
}

/// The record that every journal begins with.
pub(super) fn first(header: &RunHeader, at: Stamp) -> Arc<Entry> {
    Entry::new(Record {
        seq: 0,
        at,
        source: Source::Harness,
        direction: None,
        event: Event::RunBegun {
            header: Box::new(header.clone()),
        },
    })
}

/// The monitors that are meant for this side and version, and wanted.
fn of_side<'s>(scene: AuditContext<'s>, role: Role, header: &RunHeader) -> impl Iterator<Item = &'s Arc<Monitor>> {
    let pack: Option<&Arc<Pack>> = scene.rules.packs.get(&header.protocol);
    let version = pack.map(|pack| pack.version);
    let monitors = scene.rules.suites.monitors.iter();
    monitors.filter(move |monitor| {
        monitor.device.is_none_or(|device| device == role)
            && version.is_some_and(|version| monitor.spec.contains(version))
            && scene.options.wants_monitor(monitor)
    })
}
