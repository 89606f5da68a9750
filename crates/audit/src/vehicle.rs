//! One vehicle of a recording, with the master control that commands it: what came, in its order, and by which version of
//! the protocol its [`conversation`](super::conversation) is judged.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;

use super::arrived::{Arrived, timestamp, version};
use super::conversation::{Concluded, Conversation};
use super::courses::Courses;
use super::covered::covered;
use super::dedup::Known;
use super::header::header;
use super::hint::{Hint, Hints};
use super::new_findings::Found;
use super::outcome::Outcome;
use super::result::{HintResult, VehicleResult, Whereabouts};
use super::side::Side;
use super::time_line::TimeLine;
use super::time_stretch::TimeStretch;
use super::topics::Named;
use super::turns::Turns;
use super::{AuditContext, is_command};
use tck_base::clock::{Moment, Stamp};
use tck_capture::Message;
use tck_journal::event::{Event, Record, RunHeader, Source};
use tck_journal::{Entry, Payload};
use tck_judge::MessageTally;
use tck_pack::{Pack, Role, VersionClaim};
use tck_view::{MessageView, Names, Topic};

/// How many messages wait until the vehicle has said which version it speaks.
const WAITING: usize = 64;
/// How long a topic is believed to be seen at its sender.
const FIRST_HAND: Duration = Duration::from_secs(60);
/// How often the version of a vehicle may change; a vehicle that changes it more often is judged by the last one.
const STRETCHES: usize = 16;
/// How many different hints are kept of a vehicle.
const HINTS: usize = 64;

/// So long before it is recorded a message was written that comes from its sender and not from the store of the broker.
const FRESH: Duration = Duration::from_secs(5);

/// Whether a message was recorded when it was written.
fn is_fresh(message: &Message) -> bool {
    let said = MessageView::of_slice(Topic::Other, &message.payload, &Names::default());
    let said = said.ok().as_ref().and_then(timestamp);
    let apart = message
        .at
        .zip(said)
        .map(|(at, said)| at.duration_since(said).unsigned_abs());
    apart.is_some_and(|apart| apart <= FRESH)
}

/// One vehicle of a recording, with the master control that commands it: what came, in its order, and by which version
/// of the protocol its [`conversation`](super::conversation) is judged.
pub(super) struct Vehicle {
    named: Named,
    timed: bool,
    stretch: Option<TimeStretch>,
    manufacturer: String,
    serial_number: String,
    origin: Option<jiff::Timestamp>,
    now: Moment,
    known: Known,
    turns: Turns,
    /// Topics of which something came.
    begun: BTreeSet<String>,
    waiting: Vec<Arrived>,
    conversation: Conversation,
    /// The version it names, where there are no rules for it.
    foreign: Option<String>,
    counts: BTreeMap<String, u64>,
    twice: u64,
    stale: u64,
    /// When a message of this topic was seen last on its way from its sender.
    first_hand: BTreeMap<String, Option<jiff::Timestamp>>,
    hints: BTreeMap<(String, String), HintResult>,
    time_line: TimeLine,
    courses: Courses,
    /// Which members and words came by, once its version is known.
    tally: Option<MessageTally>,
    /// Whether its connections were judged.
    wired: bool,
    /// What came out while it spoke another version.
    earlier: Vec<VehicleResult>,
    /// What was found of those.
    news: Vec<Found>,
}

impl Vehicle {
    pub fn new(named: &Named, timed: bool, stretch: Option<TimeStretch>) -> Self {
        Self {
            stretch,
            manufacturer: named.manufacturer.clone(),
            serial_number: named.serial_number.clone(),
            named: named.clone(),
            timed,
            origin: None,
            now: Moment::START,
            known: Known::default(),
            turns: Turns::default(),
            begun: BTreeSet::new(),
            waiting: Vec::new(),
            conversation: Conversation::default(),
            foreign: None,
            counts: BTreeMap::new(),
            twice: 0,
            stale: 0,
            first_hand: BTreeMap::new(),
            hints: BTreeMap::new(),
            time_line: TimeLine::default(),
            courses: Courses::default(),
            tally: None,
            wired: false,
            earlier: Vec::new(),
            news: Vec::new(),
        }
    }

    /// Takes in a message; says whether it was worth something.
    pub fn observe(&mut self, number: u64, name: &str, message: Message, scene: AuditContext<'_>) -> bool {
        if self.is_copy(name, &message) {
            return false;
        }
        *self.counts.entry(name.to_owned()).or_default() += 1;
        let is_first = self.begun.insert(name.to_owned());
        // Where the recording does not say it, the first message of a topic may be one that was stored, unless it was written when
        // it came.
        let mut rules = scene.rules.packs.all().iter().filter_map(|pack| pack.topic(name));
        let mut is_stored = || rules.any(|rule| rule.retain) || !is_fresh(&message);
        let stale = message.retain.unwrap_or_else(|| is_first && is_stored());
        let payload = Payload::keep(message.payload);
        let mut arrived = Arrived {
            number,
            name: name.to_owned(),
            at: Stamp {
                moment: self.now,
                utc: message.at.unwrap_or_default(),
            },
            stale,
            entry: Entry::new(Record {
                seq: number,
                at: Stamp {
                    moment: self.now,
                    utc: message.at.unwrap_or_default(),
                },
                source: Source::Link,
                direction: None,
                event: Event::Message {
                    topic: message.topic,
                    qos: message.qos.unwrap_or_default(),
                    retain: stale,
                    dup: false,
                    payload,
                },
            }),
        };
        let said = arrived.message(self.names(scene));
        let values = said.map(MessageView::print);
        let bytes = arrived.entry.payload().map(Payload::bytes).unwrap_or_default();
        if !stale && self.known.again(name, bytes, values) {
            self.twice += 1;
            return true;
        }
        self.stale += u64::from(stale);
        let id = said.and_then(|said| said.header().header_id.whole());
        let stamped = (!self.timed).then(|| said.and_then(timestamp)).flatten();
        let at = self.stamp(message.at, stamped);
        arrived.at = at;
        for arrived in self.turns.take(arrived, id, self.timed && !stale) {
            self.pass(arrived, scene);
        }
        true
    }

    /// Whether a broker hands on what is seen at its sender, too.
    fn is_copy(&mut self, name: &str, message: &Message) -> bool {
        let Some(carried) = message.carried else { return false };
        if carried.sent {
            self.first_hand.insert(name.to_owned(), message.at);
            return false;
        }
        let is_recent = |at: &Option<jiff::Timestamp>| match (at, message.at) {
            (Some(at), Some(now)) => now.duration_since(*at).unsigned_abs() <= FIRST_HAND,
            _ => true,
        };
        self.first_hand.get(name).is_some_and(is_recent)
    }

    /// The header of a judge of one of its sides, once its version is known.
    pub fn own_header(&self, role: Role) -> Option<RunHeader> {
        Some(self.header(role, self.conversation.pack()?))
    }

    /// Takes over what was found of a connection.
    pub fn wired(&mut self, role: Role, outcome: Outcome, scene: AuditContext<'_>) {
        if let Some(side) = self.conversation.sides_mut().find(|side| side.role == role) {
            self.wired = true;
            side.wired(outcome, scene);
        }
    }

    /// Nothing was seen for a while.
    pub fn interrupted(&mut self, scene: AuditContext<'_>) {
        for arrived in self.turns.all() {
            self.pass(arrived, scene);
        }
        self.turns.forget();
        self.conversation.interrupted(self.now, scene);
    }

    /// What was found since this was asked last.
    pub fn news(&mut self) -> Vec<Found> {
        let mut news = std::mem::take(&mut self.news);
        for side in self.conversation.sides_mut() {
            news.append(&mut side.news);
        }
        news
    }

    /// When a message came. Without a time of the recorder, what the message says of itself has to do.
    fn stamp(&mut self, recorded: Option<jiff::Timestamp>, said: Option<jiff::Timestamp>) -> Stamp {
        let utc = if self.timed { recorded } else { said };
        let origin = *self.origin.get_or_insert(utc.unwrap_or_default());
        let since = utc.map_or(0, |utc| utc.as_microsecond().saturating_sub(origin.as_microsecond()));
        let since = Moment::from_micros(u64::try_from(since).unwrap_or_default());
        self.now = self.now.max(since);
        Stamp {
            moment: self.now,
            utc: utc.unwrap_or_default(),
        }
    }

    /// A message whose turn it is.
    fn pass(&mut self, arrived: Arrived, scene: AuditContext<'_>) {
        if let Some(message) = arrived.message(self.names(scene)).filter(|_| !arrived.stale) {
            self.time_line.note(message, arrived.at.utc);
            let found = |messages: &RangeInclusive<u64>| self.conversation.found_in(messages);
            self.courses.note(arrived.number, message, found);
        }
        if self.is_updated(&arrived, scene) {
            let concluded = self.conclude(scene);
            self.earlier.push(concluded);
        }
        if self.conversation.pack().is_some() {
            self.show(&arrived, scene);
            return;
        }
        if self.foreign.is_some() {
            return;
        }
        let of_vehicle = !arrived.stale && !is_command(&arrived.name);
        self.waiting.push(arrived);
        if of_vehicle || self.waiting.len() >= WAITING {
            self.settle(scene, self.waiting.len() >= WAITING);
        }
    }

    /// Whether the vehicle speaks another version from this message on: it is back with other software. Where its count
    /// goes on as if nothing had been, the version of the message is wrong instead.
    fn is_updated(&self, arrived: &Arrived, scene: AuditContext<'_>) -> bool {
        let is_told = scene.options.protocol.is_some();
        if arrived.stale || is_command(&arrived.name) || is_told || self.earlier.len() >= STRETCHES {
            return false;
        }
        let Some(message) = arrived.message(self.names(scene)) else {
            return false;
        };
        let Some(said) = version(message) else { return false };
        let is_other = match (self.conversation.pack(), &self.foreign) {
            (Some(pack), _) => match scene.rules.packs.said(&said) {
                VersionClaim::Known(said) => said.version != pack.version,
                VersionClaim::Unknown(_) => true,
                VersionClaim::NoVersion => false,
            },
            (None, Some(foreign)) => {
                said != *foreign && !matches!(scene.rules.packs.said(&said), VersionClaim::NoVersion)
            }
            (None, None) => false,
        };
        is_other && !self.conversation.goes_on(&arrived.name, message)
    }

    /// Finds the version, and judges what waited for it.
    fn settle(&mut self, scene: AuditContext<'_>, at_last: bool) {
        let names = self.names(scene);
        let commands = |arrived: &&Arrived| is_command(&arrived.name);
        let (sent, said): (Vec<&Arrived>, Vec<&Arrived>) = self.waiting.iter().partition(commands);
        // What was stored may be from before a change of the vehicle's software.
        let lately = said.iter().filter(|arrived| at_last || !arrived.stale);
        let versions = lately.chain(sent.iter().filter(|_| at_last));
        let versions: Vec<String> = versions
            .filter_map(|arrived| version(arrived.message(names)?))
            .collect();
        let Some(begun) = self.waiting.first().map(|first| first.at) else {
            return;
        };
        let packs = &scene.rules.packs;
        let worth = |text: &&String| !matches!(packs.said(text), VersionClaim::NoVersion);
        let told = scene.options.protocol.as_ref().and_then(|version| packs.get(version));
        if let (Some(told), Some(spoken)) = (told, versions.iter().find(&worth))
            && self.is_of_another_major(told, packs.get(spoken).map(AsRef::as_ref))
        {
            self.foreign = Some(spoken.clone());
            self.waiting.clear();
            return;
        }
        let pack = match (told, versions.iter().find(worth), versions.first()) {
            (Some(pack), ..) => pack,
            (None, Some(version), _) => {
                let Some(pack) = packs.get(version) else {
                    self.foreign = Some(version.clone());
                    self.waiting.clear();
                    return;
                };
                pack
            }
            // What is no version is a mistake like others: the rest is judged.
            (None, None, Some(text)) => packs.nearest(text, self.named.major),
            (None, None, None) => return,
        };
        let pack = Arc::clone(pack);
        self.identify(pack.names());
        let roles = [Role::Agv, Role::MasterControl];
        let sides = roles.map(|role| Side::begin(role, self.header(role, &pack), begun, self.timed, scene));
        self.tally = Some(MessageTally::new(&pack));
        self.conversation.begin(pack, sides.into_iter().flatten().collect());
        for arrived in std::mem::take(&mut self.waiting) {
            self.show(&arrived, scene);
        }
    }

    /// Whether the vehicle speaks a version whose messages have other members than those of the version that was asked for: it
    /// would be one mistake, found in every message. Where its topics are of the version that was asked for, its header is wrong.
    fn is_of_another_major(&self, told: &Pack, spoken: Option<&Pack>) -> bool {
        let major = told.version.major;
        spoken.is_some_and(|spoken| spoken.version.major != major) && self.named.major != Some(major)
    }

    fn show(&mut self, arrived: &Arrived, scene: AuditContext<'_>) {
        self.look(arrived, scene);
        if let (Some(tally), Some(message)) = (&mut self.tally, arrived.entry.json()) {
            tally.note(&arrived.name, message);
        }
        self.conversation.show(arrived, scene);
    }

    /// Looks for slips that are allowed. Who asks for certain monitors knows what he wants to see.
    fn look(&mut self, arrived: &Arrived, scene: AuditContext<'_>) {
        let (Some(pack), Some(message), true) = (
            self.conversation.pack(),
            arrived.entry.json(),
            scene.options.only.is_empty(),
        ) else {
            return;
        };
        let hints = scene.hints.get_or_init(|| Hints::of(&scene.rules.packs));
        for Hint { pointer, text } in hints.of_message(pack, &arrived.name, message) {
            let key = (arrived.name.clone(), text.clone());
            if let Some(known) = self.hints.get_mut(&key) {
                known.count += 1;
            } else if self.hints.len() < HINTS {
                let place = scene.places.of(arrived.number);
                let first = Whereabouts {
                    message: arrived.number,
                    recording: place.map(|place| place.file),
                    line: place.map(|place| place.line),
                    at: format!("{:.3}", arrived.at.utc),
                };
                let hint = HintResult {
                    topic: arrived.name.clone(),
                    pointer,
                    text,
                    count: 1,
                    first,
                };
                self.hints.insert(key, hint);
            }
        }
    }

    /// Where the topics do not say who the vehicle is, its messages do.
    fn identify(&mut self, names: &Names) {
        let said = self.waiting.iter().filter_map(|arrived| arrived.message(names));
        for header in said.map(MessageView::header) {
            for (own, said) in [
                (&mut self.manufacturer, &header.manufacturer),
                (&mut self.serial_number, &header.serial_number),
            ] {
                if own.is_empty() {
                    said.or_empty().clone_into(own);
                }
            }
        }
    }

    /// What members of its messages are called: by the version it speaks, as far as that is known.
    fn names<'s>(&'s self, scene: AuditContext<'s>) -> &'s Names {
        let pack = self.conversation.pack();
        pack.unwrap_or_else(|| scene.rules.packs.latest()).names()
    }

    fn header(&self, role: Role, pack: &Pack) -> RunHeader {
        let topics = self.named.all(pack.topics().iter().map(|rule| rule.name.as_str()));
        header(role, pack, &self.manufacturer, &self.serial_number, topics)
    }

    /// Nothing comes any more that would say which version it speaks.
    pub fn ready(&mut self, scene: AuditContext<'_>) {
        for arrived in self.turns.all() {
            self.pass(arrived, scene);
        }
        if self.conversation.pack().is_none() && self.foreign.is_none() {
            self.settle(scene, true);
        }
    }

    /// What came out, version by version.
    pub fn finish(mut self, scene: AuditContext<'_>) -> Vec<VehicleResult> {
        self.ready(scene);
        let last = self.conclude(scene);
        self.earlier.push(last);
        self.earlier
    }

    /// What came out since the vehicle speaks this version.
    fn conclude(&mut self, scene: AuditContext<'_>) -> VehicleResult {
        if self.conversation.pack().is_none() && self.foreign.is_none() {
            self.settle(scene, true);
        }
        self.news = self.news();
        let foreign = self.foreign.take();
        let Concluded { protocol, sides, holes } = self.conversation.conclude(scene);
        let told = scene.options.protocol.as_ref();
        let spoken = foreign.as_ref().and_then(|version| scene.rules.packs.get(version));
        let not_judged = protocol.is_none().then(|| match (&foreign, spoken.zip(told)) {
            (Some(_), Some((spoken, told))) => format!(
                "it speaks version {} and was to be judged by {told}, whose messages have other members; `migrate` says which",
                spoken.version
            ),
            (Some(version), None) => {
                let known = scene.rules.packs.all().iter().map(|pack| pack.version.to_string());
                let known: Vec<String> = known.collect();
                format!("version {version} is not known to this program ({})", known.join(", "))
            }
            (None, _) => "no message names a protocol version".to_owned(),
        });
        VehicleResult {
            manufacturer: self.manufacturer.clone(),
            serial_number: self.serial_number.clone(),
            topics: self
                .named
                .all(["{topic}"].into_iter())
                .into_values()
                .next()
                .unwrap_or_default(),
            protocol,
            stretch: self.stretch.clone(),
            not_judged,
            messages: std::mem::take(&mut self.counts),
            holes,
            twice: std::mem::take(&mut self.twice),
            retained: std::mem::take(&mut self.stale),
            vantage: if self.wired { "tap" } else { "subscriber" }.to_owned(),
            hints: std::mem::take(&mut self.hints).into_values().collect(),
            time_line: std::mem::take(&mut self.time_line),
            courses: std::mem::take(&mut self.courses).finish(&sides),
            message_coverage: self.tally.take().map(|tally| covered(&tally, &sides, scene)),
            sides,
        }
    }
}
