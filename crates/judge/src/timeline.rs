//! Everything that can be waited for, in the order of the journal, by subject.
//!
//! A subject is a topic name of the pack (`state`), a packet of the device (`mqtt/connect`), a map
//! download (`http/fetch`) or a delivery to a fresh subscriber. The judge looks only into this index.
//!
//! When a master control is tested, the topics of the first mock AGV have their plain names, those of the second end
//! in [`OF_SECOND`], and those of further ones are left to the monitors. What the mock AGVs themselves say is filed as
//! well, so that a test can wait for it.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::Duration;

use serde_json::Value;

use super::gone::{Gone, Mark, Pulse};
use tck_base::clock::{Moment, Stamp};
use tck_journal::Entry;
use tck_journal::event::{Direction, Event, MockVehicle, NAMED_VEHICLES, Packet};
use tck_pack::Pack;
use tck_view::{MessageView, Names, StateView, Topic};

/// How the subjects of the second mock AGV end: `order@second`.
pub const OF_SECOND: &str = "@second";

/// Whose topic it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopicOwner {
    /// Number of the vehicle, counted from 0.
    pub vehicle: usize,
    /// Topic name.
    pub name: String,
}

/// The index.
#[derive(Debug, Default)]
pub struct Timeline {
    topics: HashMap<String, TopicOwner>,
    /// Whether what the harness sends is filed, too.
    own: bool,
    subjects: BTreeMap<String, Vec<Arc<Entry>>>,
    /// When the harness itself was late: from when until when.
    lags: Vec<(Moment, Moment)>,
    last: Option<Stamp>,
    /// Of a vehicle under test.
    pulse: Pulse,
    /// What the version calls the members of messages.
    names: Arc<Names>,
}

impl Timeline {
    /// An empty index for these full topics by topic name, of an AGV under test.
    #[must_use]
    pub fn new(topics: &BTreeMap<String, String>, pack: &Pack) -> Self {
        Self {
            topics: places(topics, 0).collect(),
            names: Arc::clone(pack.names()),
            ..Self::default()
        }
    }

    /// An empty index for the mock AGVs that a master control is tested with.
    #[must_use]
    pub fn of_vehicles(vehicles: &[MockVehicle], pack: &Pack) -> Self {
        let all = vehicles.iter().enumerate();
        Self {
            topics: all
                .flat_map(|(number, vehicle)| places(&vehicle.topics, number))
                .collect(),
            own: true,
            names: Arc::clone(pack.names()),
            ..Self::default()
        }
    }

    /// Takes in one entry and returns its subject, if it has one.
    pub fn add(&mut self, entry: &Arc<Entry>) -> Option<String> {
        self.last = Some(entry.at());
        if let Event::Lag { micros, .. } = entry.event() {
            let end = entry.at().moment;
            let begun = Moment::from_micros(end.micros().saturating_sub(*micros));
            self.lags.push((begun, end));
        }
        let subject = self.subject_of(entry).map(Cow::into_owned);
        if !self.own {
            self.pulse.observe(entry, subject.as_deref(), &self.names);
        }
        let subject = subject?;
        self.subjects
            .entry(subject.clone())
            .or_default()
            .push(Arc::clone(entry));
        Some(subject)
    }

    /// Takes in one entry later than it happened, and returns its subject, if it has one.
    pub fn restore(&mut self, entry: &Arc<Entry>) -> Option<String> {
        let subject = self.subject_of(entry)?.into_owned();
        let all = self.subjects.entry(subject.clone()).or_default();
        let at = all.partition_point(|known| known.seq() < entry.seq());
        all.insert(at, Arc::clone(entry));
        Some(subject)
    }

    /// How the vehicle under test is gone at this moment, if it shows that without a tap.
    #[must_use]
    pub fn gone(&self, now: Moment) -> Option<Gone> {
        self.pulse.gone(now)
    }

    /// The first message the device was sent since its last word, and when its silence about that is longer than it ever should be.
    #[must_use]
    pub fn unanswered(&self) -> Option<(Mark, Moment)> {
        self.pulse.unanswered()
    }

    /// When the vehicle under test is silent for too long, if nothing comes before.
    #[must_use]
    pub fn falls_silent(&self) -> Option<Moment> {
        self.pulse.falls_silent()
    }

    /// The subject of an entry.
    #[must_use]
    pub fn subject_of(&self, entry: &Entry) -> Option<Cow<'_, str>> {
        match entry.event() {
            Event::Message { topic, .. } => self.named(topic),
            Event::Sent { topic, .. } if self.own => self.named(topic),
            Event::Packet { packet, .. } if entry.record.direction == Some(Direction::FromDevice) => {
                let subject = match packet {
                    Packet::Connect { .. } => "mqtt/connect",
                    Packet::Publish { .. } => "mqtt/publish",
                    Packet::Subscribe { .. } => "mqtt/subscribe",
                    Packet::Unsubscribe { .. } => "mqtt/unsubscribe",
                    Packet::Disconnect { .. } => "mqtt/disconnect",
                    Packet::Pingreq => "mqtt/pingreq",
                    _ => return None,
                };
                Some(subject.into())
            }
            Event::Closed { .. } => Some("mqtt/closed".into()),
            Event::Undecodable { .. } => Some("mqtt/undecodable".into()),
            Event::Fetched { .. } => Some("http/fetch".into()),
            _ => None,
        }
    }

    fn named(&self, full: &str) -> Option<Cow<'_, str>> {
        let place = self.topics.get(full)?;
        match place.vehicle {
            0 => Some(place.name.as_str().into()),
            1 => Some(format!("{}{OF_SECOND}", place.name).into()),
            _ => None,
        }
    }

    /// Whose topic an entry is about.
    #[must_use]
    pub fn place(&self, entry: &Entry) -> Option<&TopicOwner> {
        let (Event::Message { topic, .. }
        | Event::Sent { topic, .. }
        | Event::Retained { topic, .. }
        | Event::Packet {
            packet: Packet::Publish { topic, .. },
            ..
        }) = entry.event()
        else {
            return None;
        };
        self.topics.get(topic)
    }

    /// Whether it is what one of the mock AGVs has said that no test talks about.
    #[must_use]
    pub fn is_of_crowd(&self, entry: &Entry) -> bool {
        let is_own = match entry.event() {
            Event::Sent { .. } => self.own,
            Event::Packet { .. } => entry.record.direction == Some(Direction::ToDevice),
            _ => false,
        };
        is_own && self.place(entry).is_some_and(|place| place.vehicle >= NAMED_VEHICLES)
    }

    /// What the version calls the members of messages.
    #[must_use]
    pub fn names(&self) -> &Arc<Names> {
        &self.names
    }

    /// An entry as a message of a topic, if it is one.
    #[must_use]
    pub fn view<'e>(&self, entry: &'e Entry, topic: Topic) -> Option<&'e MessageView> {
        entry.view(topic, &self.names)
    }

    /// An entry as a state, if it is a message that can be read as one.
    #[must_use]
    pub fn state<'e>(&self, entry: &'e Entry) -> Option<&'e Arc<StateView>> {
        self.view(entry, Topic::State)?.state()
    }

    /// The states, from the last one back to the first, with the entry of each.
    pub fn states_back(&self) -> impl Iterator<Item = (&Arc<Entry>, &Arc<StateView>)> {
        let all = self.of("state").iter().rev();
        all.filter_map(|entry| Some((entry, self.state(entry)?)))
    }

    /// All entries of a subject.
    #[must_use]
    pub fn of(&self, subject: &str) -> &[Arc<Entry>] {
        self.subjects.get(subject).map_or(&[], Vec::as_slice)
    }

    /// The entries of a subject from a journal number on.
    #[must_use]
    pub fn since(&self, subject: &str, seq: u64) -> &[Arc<Entry>] {
        let all = self.of(subject);
        &all[all.partition_point(|entry| entry.seq() < seq)..]
    }

    /// The last entry of a subject before a journal number.
    #[must_use]
    pub fn before(&self, subject: &str, seq: u64) -> Option<&Arc<Entry>> {
        let all = self.of(subject);
        all[..all.partition_point(|entry| entry.seq() < seq)].last()
    }

    /// The last entry of a subject that counts. A state counts from the present connection of the client that
    /// publishes: what a vehicle said before it went away is not what it says now.
    #[must_use]
    pub fn present(&self, subject: &str) -> Option<&Arc<Entry>> {
        let last = self.of(subject).last()?;
        let is_past = !self.own && subject == "state" && self.connected().is_some_and(|since| last.seq() < since);
        (!is_past).then_some(last)
    }

    /// When the client that publishes the states connected last, as the tap has seen it.
    fn connected(&self) -> Option<u64> {
        let publishing = self.publishing()?;
        let mut later = self
            .of("mqtt/connect")
            .iter()
            .rev()
            .take_while(|entry| number_of(entry) != Some(publishing));
        let client = self
            .of("mqtt/connect")
            .iter()
            .rev()
            .find(|entry| number_of(entry) == Some(publishing))?;
        let again = later.find(|entry| client_of(entry) == client_of(client));
        Some(again.unwrap_or(client).seq())
    }

    /// The connection of the client that published the last state, as the tap has seen it.
    #[must_use]
    pub fn publishing(&self) -> Option<u64> {
        let published = self.of("mqtt/publish").iter().rev();
        let mut states = published.filter(|entry| self.place(entry).is_some_and(|place| place.name == "state"));
        number_of(states.next()?)
    }

    /// What the last message of a subject before a journal number said.
    #[must_use]
    pub fn baseline(&self, subject: &str, seq: u64) -> Option<Value> {
        self.before(subject, seq)?.json().cloned()
    }

    /// How long the harness itself was held up between two moments.
    #[must_use]
    pub fn lag(&self, from: Moment, to: Moment) -> Duration {
        let mut all: Vec<(Moment, Moment)> = self
            .lags
            .iter()
            .map(|(begun, end)| ((*begun).max(from), (*end).min(to)))
            .filter(|(begun, end)| begun < end)
            .collect();
        all.sort_unstable();
        let mut total = Duration::ZERO;
        let mut until = from;
        for (begun, end) in all {
            total += end.since(begun.max(until));
            until = until.max(end);
        }
        total
    }

    /// The longest time for which the harness was held up.
    #[must_use]
    pub fn longest_lag(&self) -> Duration {
        let all = self.lags.iter().map(|(begun, end)| end.since(*begun));
        all.max().unwrap_or_default()
    }

    /// When the last entry happened.
    #[must_use]
    pub fn last(&self) -> Option<Stamp> {
        self.last
    }
}

/// The number of the connection an entry is about.
#[must_use]
pub fn number_of(entry: &Entry) -> Option<u64> {
    match entry.event() {
        Event::Packet { connection, .. } | Event::Closed { connection, .. } => Some(*connection),
        _ => None,
    }
}

/// The client id of a CONNECT.
#[must_use]
pub fn client_of(entry: &Entry) -> Option<&str> {
    match entry.event() {
        Event::Packet {
            packet: Packet::Connect { client_id, .. },
            ..
        } => Some(client_id),
        _ => None,
    }
}

fn places(topics: &BTreeMap<String, String>, vehicle: usize) -> impl Iterator<Item = (String, TopicOwner)> {
    topics.iter().map(move |(name, full)| {
        let name = name.clone();
        (full.clone(), TopicOwner { vehicle, name })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::step::Timing;
    use tck_journal::Journal;
    use tck_journal::event::{Occurrence, Payload, Source};
    use tck_pack::{Assets, Packs};

    fn at(millis: u64) -> Moment {
        Moment::from_micros(millis * 1_000)
    }

    /// A timeline in which the harness was held up so long until then, in milliseconds.
    fn held_up(all: &[(u64, u64)]) -> Timeline {
        let mut journal = Journal::new();
        let mut timeline = Timeline::default();
        for (until, long) in all {
            let occurrence = Occurrence {
                at: Stamp {
                    moment: at(*until),
                    utc: jiff::Timestamp::UNIX_EPOCH,
                },
                source: Source::Harness,
                direction: None,
                event: Event::Lag {
                    micros: long * 1_000,
                    of: "timer".to_owned(),
                },
            };
            timeline.add(&journal.append(occurrence));
        }
        timeline
    }

    #[test]
    fn lags_that_overlap_count_once() {
        let timeline = held_up(&[(2_000, 1_000), (2_100, 500), (9_000, 300)]);
        assert_eq!(timeline.lag(at(0), at(10_000)), Duration::from_millis(1_400));
        assert_eq!(timeline.lag(at(1_500), at(1_800)), Duration::from_millis(300));
        assert_eq!(timeline.longest_lag(), Duration::from_secs(1));
    }

    #[test]
    fn what_the_lag_can_explain_is_explained_and_nothing_more() {
        let timeline = held_up(&[(5_500, 1_000)]);
        let late = |came: u64| Timing::Late {
            since: at(0),
            at: at(came),
            limit: Duration::from_secs(5),
        };
        assert!(late(5_900).explained(&timeline).is_some());
        assert!(late(6_100).explained(&timeline).is_none());
        assert!(Timing::Missed(at(5_000)).explained(&timeline).is_some());
        assert!(Timing::Missed(at(6_000)).explained(&timeline).is_none());
        assert!(late(5_900).explained(&held_up(&[])).is_none());
    }

    fn of_device(event: Event) -> Occurrence {
        Occurrence {
            at: Stamp {
                moment: at(0),
                utc: jiff::Timestamp::UNIX_EPOCH,
            },
            source: Source::Tap,
            direction: Some(Direction::FromDevice),
            event,
        }
    }

    fn connect(connection: u64, client_id: &str) -> Occurrence {
        of_device(Event::Packet {
            connection,
            packet: Packet::Connect {
                level: 4,
                client_id: client_id.to_owned(),
                keep_alive: 15,
                clean_session: true,
                username: None,
                has_password: false,
                will: None,
            },
        })
    }

    fn state(connection: u64) -> [Occurrence; 2] {
        let payload = || Payload::keep(bytes::Bytes::from_static(b"{}"));
        let packet = Packet::Publish {
            topic: "state".to_owned(),
            qos: 0,
            retain: false,
            dup: false,
            packet_id: None,
            payload: payload(),
        };
        let message = Event::Message {
            topic: "state".to_owned(),
            qos: 0,
            retain: false,
            dup: false,
            payload: payload(),
        };
        [of_device(Event::Packet { connection, packet }), of_device(message)]
    }

    #[test]
    fn what_further_vehicles_say_is_of_the_crowd_and_what_they_are_told_is_not() {
        let vehicle = |number: usize| MockVehicle {
            topics: ["state", "order"]
                .map(|name| (name.to_owned(), format!("{number}/{name}")))
                .into(),
            ..MockVehicle::default()
        };
        let vehicles: Vec<MockVehicle> = (0..4).map(vehicle).collect();
        let packs = Packs::load(&Assets::of_source_tree().unwrap()).unwrap();
        let timeline = Timeline::of_vehicles(&vehicles, packs.latest());
        let payload = || Payload::keep(bytes::Bytes::from_static(b"{}"));
        let is_of_crowd = |occurrence: Occurrence| timeline.is_of_crowd(&Journal::new().append(occurrence));
        let sent = |topic: &str| {
            let topic = topic.to_owned();
            let (qos, retain, payload) = (0, false, payload());
            let event = Event::Sent {
                topic,
                qos,
                retain,
                payload,
            };
            Occurrence::harness(of_device(Event::Interrupted).at, event)
        };
        let packet = |topic: &str, direction| Occurrence {
            direction: Some(direction),
            ..of_device(Event::Packet {
                connection: 1,
                packet: Packet::Publish {
                    topic: topic.to_owned(),
                    qos: 0,
                    retain: false,
                    dup: false,
                    packet_id: None,
                    payload: payload(),
                },
            })
        };
        assert!(!is_of_crowd(sent("0/state")) && !is_of_crowd(sent("1/state")) && is_of_crowd(sent("2/state")));
        assert!(
            is_of_crowd(packet("3/state", Direction::ToDevice)) && !is_of_crowd(packet("1/state", Direction::ToDevice))
        );
        assert!(!is_of_crowd(packet("3/order", Direction::FromDevice)) && !is_of_crowd(sent("unknown")));
    }

    #[test]
    fn a_state_counts_from_the_present_connection_of_the_client_that_publishes() {
        let mut journal = Journal::new();
        let mut timeline = Timeline::new(
            &BTreeMap::from([("state".to_owned(), "state".to_owned())]),
            Packs::load(&Assets::of_source_tree().unwrap()).unwrap().latest(),
        );
        let mut show = |timeline: &mut Timeline, all: &[Occurrence]| {
            for occurrence in all {
                timeline.add(&journal.append(occurrence.clone()));
            }
        };
        show(&mut timeline, &[connect(1, "vehicle"), connect(2, "panel")]);
        show(&mut timeline, &state(1));
        assert_eq!(timeline.publishing(), Some(1));
        assert!(timeline.present("state").is_some());
        show(&mut timeline, &[connect(3, "panel")]);
        assert!(timeline.present("state").is_some(), "another client has come back");
        show(&mut timeline, &[connect(4, "vehicle")]);
        assert!(
            timeline.present("state").is_none(),
            "it has said nothing since it came back"
        );
        show(&mut timeline, &state(4));
        assert!(timeline.present("state").is_some());
    }
}
