//! What is seen of the connections themselves, where packets were captured: the CONNECT with its last will, QoS and RETAIN
//! as they were published, and how a connection ends.
//!
//! A connection is held against a vehicle only if the vehicle alone speaks on it: a bridge or a gateway may change what it
//! passes on. So what is found waits until the connection ends, or for a while where traffic is live.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use super::outcome::Outcome;
use super::side::{first, start};
use super::vehicle::Vehicle;
use super::{AuditContext, is_command};
use tck_base::clock::{Moment, Stamp};
use tck_capture::{Carried, Wire, WireEvent};
use tck_journal::Entry;
use tck_journal::event::{Direction, Event, Packet, Record, Source};
use tck_judge::TrafficJudge;
use tck_pack::Role;
use tck_suite::model::Recordings;

/// How many connections are kept in mind.
const CONNECTIONS: usize = 16_384;
/// How many vehicles a master control commands on one connection, as far as they are judged.
const VEHICLES: usize = 1_024;
/// How many packets wait until the version of a vehicle is known.
const WAITING: usize = 64;
/// How long a connection has to be of one vehicle alone before that is believed while traffic is live.
const PROBATION: Duration = Duration::from_secs(60);

/// One connection.
#[derive(Default)]
struct Connection {
    begun: Moment,
    /// Its CONNECT, if that was seen and nothing is missing since.
    connect: Option<Arc<Entry>>,
    /// Whether several vehicles, or both sides, speak on it.
    shared: bool,
    sides: BTreeMap<(String, Role), Judged>,
    /// Whose messages the client sent, and got.
    sent: BTreeSet<String>,
    got: BTreeSet<String>,
}

/// One side of one vehicle on a connection.
#[derive(Default)]
struct Judged {
    /// Whether another thread judges the vehicle: here it only matters that the vehicle speaks on the connection.
    elsewhere: bool,
    judge: Option<TrafficJudge>,
    waiting: Vec<Arc<Entry>>,
    outcome: Outcome,
}

/// What is seen of the connections themselves, where packets were captured: the CONNECT with its last will, QoS and
/// RETAIN as they were published, and how a connection ends.
#[derive(Default)]
pub(super) struct MqttSessions {
    open: BTreeMap<u64, Connection>,
    /// Connections that ended before it was known which version a vehicle speaks.
    ended: Vec<Connection>,
    origin: Option<jiff::Timestamp>,
    now: Moment,
}

type Vehicles = BTreeMap<String, Vehicle>;

/// Whose message a PUBLISH is.
pub(super) struct Publisher<'a> {
    pub vehicle: String,
    /// Name of the topic.
    pub topic: &'a str,
    /// Whether another thread judges the vehicle.
    pub elsewhere: bool,
}

impl MqttSessions {
    /// A message came this way.
    pub fn carried(&mut self, carried: Carried, key: &str) {
        if let Some(connection) = self.open.get_mut(&carried.connection) {
            let keys = if carried.sent {
                &mut connection.sent
            } else {
                &mut connection.got
            };
            if keys.len() < VEHICLES && !keys.contains(key) {
                keys.insert(key.to_owned());
            }
        }
    }

    /// Takes in what was seen; `publisher` says whose message a PUBLISH of the client is. Gives the vehicles of whose
    /// messages something is missing.
    pub fn take(
        &mut self,
        wire: Wire,
        number: u64,
        publisher: Option<Publisher<'_>>,
        vehicles: &mut Vehicles,
        scene: AuditContext<'_>,
    ) -> BTreeSet<String> {
        let at = self.stamp(wire.at);
        if !self.open.contains_key(&wire.connection) && self.open.len() >= CONNECTIONS {
            self.open.pop_first();
        }
        let now = self.now;
        let connection = self.open.entry(wire.connection).or_insert_with(|| Connection {
            begun: now,
            ..Connection::default()
        });
        let entry = |packet: Packet| {
            Entry::new(Record {
                seq: number,
                at,
                source: Source::Tap,
                direction: Some(Direction::FromDevice),
                event: Event::Packet {
                    connection: wire.connection,
                    packet,
                },
            })
        };
        match wire.event {
            WireEvent::Packet { packet, sent: true } => match packet {
                Packet::Connect { .. } => connection.connect = Some(entry(packet)),
                Packet::Publish { .. } if wire.certain => {
                    if let Some(publisher) = publisher {
                        connection.publish(publisher, &entry(packet), vehicles, scene);
                        if scene.live && now.since(connection.begun) > PROBATION {
                            connection.tell(vehicles, scene);
                        }
                    }
                }
                Packet::Disconnect { .. } => connection.show(&entry(packet), vehicles, scene),
                _ => {}
            },
            WireEvent::Packet { .. } => {}
            WireEvent::Gap { sent: true } => {
                connection.broken(vehicles, scene);
                return connection.sent.clone();
            }
            WireEvent::Gap { sent: false } => return connection.got.clone(),
            WireEvent::Closed { .. } => {
                if let Some(mut connection) = self.open.remove(&wire.connection) {
                    if connection.is_known(vehicles) {
                        connection.broken(vehicles, scene);
                        connection.tell(vehicles, scene);
                    } else if self.ended.len() < CONNECTIONS {
                        self.ended.push(connection);
                    }
                }
            }
        }
        BTreeSet::new()
    }

    /// Nothing comes any more.
    pub fn finish(&mut self, vehicles: &mut Vehicles, scene: AuditContext<'_>) {
        let ended = std::mem::take(&mut self.ended).into_iter();
        for mut connection in ended.chain(std::mem::take(&mut self.open).into_values()) {
            connection.broken(vehicles, scene);
            connection.tell(vehicles, scene);
        }
    }

    fn stamp(&mut self, at: Option<jiff::Timestamp>) -> Stamp {
        let utc = at.or(self.origin).unwrap_or_default();
        let origin = *self.origin.get_or_insert(utc);
        let since = utc.as_microsecond().saturating_sub(origin.as_microsecond());
        self.now = self
            .now
            .max(Moment::from_micros(u64::try_from(since).unwrap_or_default()));
        Stamp { moment: self.now, utc }
    }
}

impl Connection {
    fn publish(&mut self, publisher: Publisher<'_>, entry: &Arc<Entry>, vehicles: &Vehicles, scene: AuditContext<'_>) {
        let role = if is_command(publisher.topic) {
            Role::MasterControl
        } else {
            Role::Agv
        };
        let side = (publisher.vehicle, role);
        if self.shared {
            return;
        }
        if !self.sides.contains_key(&side) {
            let other = self.sides.keys().next();
            let is_alone = other.is_none_or(|(_, other)| *other == role && role == Role::MasterControl);
            if !is_alone {
                self.shared = true;
                self.sides.clear();
                return;
            }
            if self.sides.len() >= VEHICLES {
                return;
            }
            let waiting = self.connect.iter().cloned().collect();
            self.sides.insert(
                side.clone(),
                Judged {
                    elsewhere: publisher.elsewhere,
                    waiting,
                    ..Judged::default()
                },
            );
        }
        if let Some(judged) = self.sides.get_mut(&side) {
            judged.show(entry, &side, vehicles, scene);
        }
    }

    fn show(&mut self, entry: &Arc<Entry>, vehicles: &Vehicles, scene: AuditContext<'_>) {
        for (side, judged) in &mut self.sides {
            judged.show(entry, side, vehicles, scene);
        }
    }

    /// Whether it is known which version each of its vehicles speaks.
    fn is_known(&self, vehicles: &Vehicles) -> bool {
        let has_version = |key: &String, role: Role| {
            let vehicle = vehicles.get(key);
            vehicle.is_some_and(|vehicle| vehicle.own_header(role).is_some())
        };
        let mut sides = self.sides.iter();
        sides.all(|((key, role), judged)| judged.elsewhere || has_version(key, *role))
    }

    /// Something is missing: what was said before holds, and what follows begins anew.
    fn broken(&mut self, vehicles: &Vehicles, scene: AuditContext<'_>) {
        self.connect = None;
        for (side, judged) in &mut self.sides {
            judged.begin(side, vehicles, scene);
            judged.waiting.clear();
            if let Some(judge) = judged.judge.take() {
                for (id, count) in judge.judged() {
                    *judged.outcome.judged.entry(id).or_default() += count;
                }
                judged.outcome.decided.extend(judge.decided());
            }
        }
    }

    /// Tells what was found so far, if it is the vehicle's own.
    fn tell(&mut self, vehicles: &mut Vehicles, scene: AuditContext<'_>) {
        for ((key, role), judged) in &mut self.sides {
            if let Some(vehicle) = vehicles.get_mut(key) {
                vehicle.wired(*role, std::mem::take(&mut judged.outcome), scene);
            }
        }
    }
}

impl Judged {
    fn show(&mut self, entry: &Arc<Entry>, side: &(String, Role), vehicles: &Vehicles, scene: AuditContext<'_>) {
        if self.elsewhere {
            return;
        }
        self.begin(side, vehicles, scene);
        match &mut self.judge {
            Some(judge) => self.outcome.keep(judge.observe(entry), entry),
            None if self.waiting.len() < WAITING => self.waiting.push(Arc::clone(entry)),
            None => {}
        }
    }

    /// Begins to judge, as soon as it is known by which version.
    fn begin(&mut self, (key, role): &(String, Role), vehicles: &Vehicles, scene: AuditContext<'_>) {
        if self.judge.is_some() || self.elsewhere {
            return;
        }
        let Some(mut header) = vehicles.get(key).and_then(|vehicle| vehicle.own_header(*role)) else {
            return;
        };
        "tap".clone_into(&mut header.vantage);
        let Some(mut judge) = start(&header, scene, &|monitor| monitor.recordings == Recordings::Packets) else {
            return;
        };
        let at = Stamp {
            moment: Moment::START,
            utc: jiff::Timestamp::UNIX_EPOCH,
        };
        judge.observe(&first(&header, at));
        for entry in self.waiting.drain(..) {
            self.outcome.keep(judge.observe(&entry), &entry);
        }
        self.judge = Some(judge);
    }
}
