//! Who is on the tap besides the device under test.
//!
//! The device is the connection, or the connections, that publish on its topics, carry its will or subscribe to just what is
//! sent to it. While one of these is open, a connection that does none of this belongs to a bystander: an onlooker, a
//! visitor, another tool. What bystanders do is recorded and never judged. One that publishes where only the device may is
//! named in the limits of the report; what it may have caused is undecided.
//!
//! A device may have several clients, and may come back while its former connection seems open. So only a connection that
//! says what an open connection of the device says already, and does not look like that connection, is taken for a
//! stranger. Where the run has started the device, and the system tells whose a connection is, no look is needed: what is of
//! another program is a stranger's from its first byte on, whatever it says.

mod client;
mod disturbance;
mod rivals;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use client::{Client, ClientSignature, ForeignClient, Who};
use disturbance::{AFTER_COMMAND, AFTER_FORGERY, AFTER_TAKEOVER, DisturbanceWindow, ReconnectExcuse};
use rivals::Rivals;
use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_journal::event::{Direction, Event, Occurrence, Origin, Packet, Payload, RunHeader, Will};
use tck_pack::{Pack, Role};

/// How many client ids are kept in mind, and how many strangers are named.
const KEPT: usize = 256;
const NAMED: usize = 8;

/// What an entry is.
#[derive(Debug)]
pub(super) enum Attribution {
    /// It is to be judged.
    Judged,
    /// It is a bystander's, or about one.
    Bystander,
    /// It is to be judged, and so is what was left out before: the connection belongs to the device.
    Joined(Vec<Arc<Entry>>),
}

/// Everybody on the tap.
#[derive(Debug, Default)]
pub(super) struct ClientClassifier {
    /// Whether the device is one vehicle, of which is known how it uses its connections. Of a master control nobody knows how
    /// many it has: only what is known to be of another program is a stranger's.
    is_vehicle: bool,
    /// The full topics on which only the device publishes.
    own: BTreeSet<String>,
    /// The one of them that says whether it is connected; two clients of a device may both say so.
    connection: String,
    /// The full topics on which it is commanded.
    commands: BTreeSet<String>,
    /// Open connections.
    open: BTreeMap<u64, Client>,
    /// How the device looked last, by client id, and what it published.
    device: BTreeMap<String, (ClientSignature, BTreeSet<String>)>,
    /// The client ids of bystanders.
    strangers: BTreeMap<String, ForeignClient>,
    /// Programs that are not what was started, by client id.
    foreign: BTreeMap<String, ForeignClient>,
    /// Others that may have been taken for the device.
    rivals: Rivals,
    /// The peers of connections, until they say who they are.
    peers: BTreeMap<u64, String>,
    /// Whose connections are, where the system tells, until they say who they are.
    origins: BTreeMap<u64, Origin>,
    excuse: ReconnectExcuse,
    influence: DisturbanceWindow,
    /// What of it was done to the device itself.
    harm: DisturbanceWindow,
}

impl ClientClassifier {
    /// Of a device under test in a run with this header.
    pub fn of(role: Role, header: &RunHeader, pack: &Pack) -> Self {
        let of_vehicles = header.vehicles.iter().map(|vehicle| &vehicle.topics);
        let all: Vec<_> = match header.vehicles.is_empty() {
            true => vec![&header.topics],
            false => of_vehicles.collect(),
        };
        let published_by = |publisher: Role| {
            let all = all.iter().copied().flatten();
            all.filter(move |(name, _)| pack.topic(name).is_some_and(|topic| topic.publisher == publisher))
                .map(|(_, full)| full.clone())
                .collect()
        };
        let is_vehicle = role == Role::Agv;
        Self {
            is_vehicle,
            own: published_by(role),
            connection: header.topics.get("connection").cloned().unwrap_or_default(),
            commands: match is_vehicle {
                true => published_by(Role::MasterControl),
                false => BTreeSet::new(),
            },
            ..Self::default()
        }
    }

    /// Sees the next entry.
    pub fn observe(&mut self, entry: &Arc<Entry>) -> Attribution {
        let now = entry.at().moment;
        match entry.event() {
            Event::Fault { fault } => self.excuse.fault(fault, now),
            Event::Hook { .. } => self.excuse.hook(now),
            Event::Opened { connection, peer } => {
                self.peers.insert(*connection, peer.clone());
            }
            Event::Traced { connection, origin } => {
                let peer = self.peers.get(connection).map_or("", String::as_str);
                self.rivals.traced(origin, peer);
                self.origins.insert(*connection, origin.clone());
            }
            // A stranger's, if a stranger has just sent the same.
            Event::Message { topic, payload, .. } if self.influence.is_delivery(topic, payload) => {
                return Attribution::Bystander;
            }
            Event::Packet { connection, packet } => return self.packet(*connection, packet, entry),
            Event::Undecodable { connection, .. } => return self.part_of(*connection, entry),
            Event::Closed { connection, .. } => {
                let part = self.part_of(*connection, entry);
                self.peers.remove(connection);
                self.origins.remove(connection);
                self.open.remove(connection);
                return part;
            }
            _ => {}
        }
        Attribution::Judged
    }

    /// Why the device itself may have been harmed now: thrown out, or commanded by somebody else.
    pub fn harm(&self, now: Moment) -> Option<&Arc<str>> {
        self.harm.at(now)
    }

    /// Why what is found now may stem from somebody else.
    pub fn interference(&self, now: Moment) -> Option<&Arc<str>> {
        self.influence.at(now)
    }

    /// Whether nothing would be judged otherwise without an occurrence: it is of a client that is not the device, and tells
    /// neither who that is nor what it does in the name of the device.
    pub fn is_dispensable(&self, occurrence: &Occurrence) -> bool {
        let is_sent = occurrence.direction != Some(Direction::ToDevice);
        let connection = match &occurrence.event {
            Event::Packet {
                packet: Packet::Connect { .. } | Packet::Subscribe { .. } | Packet::Disconnect { .. },
                ..
            } => return false,
            Event::Packet {
                packet: Packet::Publish { topic, .. },
                ..
            } if is_sent && (self.own.contains(topic) || self.commands.contains(topic)) => return false,
            Event::Packet { connection, .. } | Event::Undecodable { connection, .. } => *connection,
            _ => return false,
        };
        match self.open.get(&connection) {
            Some(client) => client.who != Who::Device,
            None if !self.is_vehicle => self.is_foreign(connection),
            None => self.device_beside(connection).any(|client| self.is_known(client)),
        }
    }

    /// What restricts the statement.
    pub fn limits(&self) -> Vec<String> {
        let strangers = self.foreign.iter().chain(&self.strangers);
        let busy = strangers.filter(|(_, stranger)| stranger.is_busy());
        let mut all: Vec<String> = busy
            .clone()
            .take(NAMED)
            .map(|(id, stranger)| stranger.in_words(id))
            .collect();
        let more = busy.count().saturating_sub(NAMED);
        if more > 0 {
            all.push(format!("{more} more clients did the like."));
        }
        all.extend(self.rivals.limits());
        all
    }

    /// Why it is not certain that it was the device that was judged; nothing as long as nothing speaks against it.
    pub fn mixed(&self) -> Option<String> {
        let strangers = self.foreign.iter().chain(&self.strangers);
        let rival = strangers.filter(|(_, stranger)| stranger.is_rival()).map(|(id, _)| id);
        let named = rival.map(|id| format!("the client {id:?}, which is not the device, may have been taken for it"));
        named.chain(self.rivals.mixed()).next()
    }

    /// Whether a connection is known to be of another program than what was started.
    fn is_foreign(&self, connection: u64) -> bool {
        let origin = self.origins.get(&connection);
        origin.is_some_and(Origin::is_foreign) || self.open.get(&connection).is_some_and(Client::is_foreign)
    }

    /// A connection of the device other than this one.
    fn device_beside(&self, connection: u64) -> impl Iterator<Item = &Client> {
        let others = self.open.iter().filter(move |(number, _)| **number != connection);
        others
            .map(|(_, client)| client)
            .filter(|client| client.who == Who::Device)
    }

    /// Whether something of a connection is to be judged. One that has not said who it is yet is the device as long as
    /// nobody else is.
    fn part_of(&mut self, connection: u64, entry: &Arc<Entry>) -> Attribution {
        let somebody = self.is_vehicle && self.device_beside(connection).any(|client| self.is_known(client));
        let known = somebody || self.is_foreign(connection);
        match self.open.get_mut(&connection) {
            Some(client) if client.who == Who::Device => Attribution::Judged,
            Some(client) => {
                client.hold(entry);
                Attribution::Bystander
            }
            None if known => Attribution::Bystander,
            None => Attribution::Judged,
        }
    }

    /// Whether a connection has shown that it is the device's.
    fn is_known(&self, client: &Client) -> bool {
        client.listens
            || !client.publishes.is_empty()
            || client.look.will.as_ref().is_some_and(|on| self.own.contains(on))
    }

    fn packet(&mut self, connection: u64, packet: &Packet, entry: &Arc<Entry>) -> Attribution {
        if entry.record.direction == Some(Direction::ToDevice) {
            return self.part_of(connection, entry);
        }
        match packet {
            Packet::Connect { client_id, will, .. } => {
                let look = ClientSignature::of(packet);
                self.connects(connection, client_id, look, will.as_ref(), entry)
            }
            Packet::Subscribe { filters, .. }
                if filters.iter().any(|filter| self.commands.contains(&filter.filter)) =>
            {
                self.joins(connection, entry, |client| client.listens = true)
            }
            Packet::Publish {
                topic, payload, retain, ..
            } if self.own.contains(topic) => self.publishes(connection, topic, payload, *retain, entry),
            Packet::Publish { topic, payload, .. } if self.commands.contains(topic) => {
                self.commands(connection, topic, payload, entry)
            }
            _ => self.part_of(connection, entry),
        }
    }

    fn connects(
        &mut self,
        connection: u64,
        id: &str,
        look: ClientSignature,
        will: Option<&Will>,
        entry: &Arc<Entry>,
    ) -> Attribution {
        let now = entry.at().moment;
        let is_like = self.device.get(id).map(|(known, _)| *known == look);
        let before = self
            .device_beside(connection)
            .find(|client| client.id == id && self.is_known(client))
            .map(|client| client.peer.clone());
        let taken = before.is_some() && self.is_vehicle;
        let is_excused = self.excuse.holds(now);
        let carries_will = will.is_some_and(|will| self.own.contains(&will.topic));
        let somebody = self.device_beside(connection).any(|client| self.is_known(client));
        let origin = self.origins.remove(&connection);
        let is_foreign = origin.as_ref().is_some_and(Origin::is_foreign);
        let is_own = matches!(origin, Some(Origin::Started { .. }));
        let who = match is_like {
            _ if is_foreign => Who::Bystander,
            _ if is_own || !self.is_vehicle => Who::Device,
            Some(true) => Who::Device,
            Some(false) if taken && !is_excused => Who::Bystander,
            _ if self.strangers.contains_key(id) => Who::Bystander,
            None if somebody && !carries_will => Who::Bystander,
            Some(false) | None => Who::Device,
        };
        let peer = self.peers.remove(&connection).unwrap_or_default();
        let mut client = Client::new(id, peer.clone(), look, who, entry.seq());
        client.origin = origin;
        if who == Who::Bystander {
            let goes_by_its_name = taken || self.device.contains_key(id);
            let stranger = self.stranger(&client);
            stranger.takeovers += u64::from(taken);
            if is_foreign && (carries_will || goes_by_its_name) {
                stranger.poses();
            }
        }
        if is_foreign && let Some(will) = will.filter(|_| carries_will) {
            // The broker may say so in its place.
            self.influence.await_delivery(&will.topic, &will.payload);
        }
        if is_own && let Some(rival) = self.foreign.get_mut(id) {
            rival.poses();
        }
        if taken && who == Who::Bystander {
            let why = format!("a client at {peer} took the client id of the device, {id:?}, which was thrown out");
            self.harm.lasts(now + AFTER_TAKEOVER, why.clone());
            self.influence.lasts(now + AFTER_TAKEOVER, why);
        }
        if let (Some(former), Who::Device, false, false, true) = (&before, who, is_own, is_excused, taken) {
            let why = self.rivals.connects(id, (former, &peer), entry.seq(), now);
            self.harm.lasts(now + AFTER_TAKEOVER, why.clone());
            self.influence.lasts(now + AFTER_TAKEOVER, why);
        }
        if let Some((_, published)) = self.device.get(id).filter(|_| who == Who::Device) {
            client.publishes.clone_from(published);
        }
        let is_known = who == Who::Device && self.is_known(&client);
        self.open.insert(connection, client);
        if is_known {
            self.establish(connection);
        }
        self.part_of(connection, entry)
    }

    /// A client is not the device.
    fn stranger(&mut self, client: &Client) -> &mut ForeignClient {
        let strangers = match client.is_foreign() {
            true => &mut self.foreign,
            false => &mut self.strangers,
        };
        if !strangers.contains_key(&client.id) && strangers.len() >= KEPT {
            // Those that did nothing are forgotten first.
            let idle = strangers.iter().find(|(_, stranger)| !stranger.is_busy());
            let forgotten = idle.or(strangers.iter().next()).map(|(id, _)| id.clone());
            forgotten.map(|id| strangers.remove(&id));
        }
        let new = || {
            let mut stranger = ForeignClient::new(&client.peer, client.seq);
            if let Some(origin) = &client.origin {
                stranger.is_of(origin);
            }
            stranger
        };
        strangers.entry(client.id.clone()).or_insert_with(new)
    }

    /// This connection is the device's: open ones that have not shown to be so are not.
    fn establish(&mut self, connection: u64) {
        let Some(client) = self.open.get(&connection) else {
            return;
        };
        if self.device.len() >= KEPT && !self.device.contains_key(&client.id) {
            self.device.pop_first();
        }
        let shape = (client.look.clone(), client.publishes.clone());
        self.device.insert(client.id.clone(), shape);
        let idle: Vec<u64> = self
            .open
            .iter()
            .filter(|(number, client)| **number != connection && client.who == Who::Device && !self.is_known(client))
            .map(|(number, _)| *number)
            .collect();
        for number in idle {
            let Some(client) = self.open.get_mut(&number) else {
                continue;
            };
            client.who = Who::Bystander;
            let named = client.named();
            self.stranger(&named);
        }
    }

    /// A connection does what only the device does.
    fn joins(&mut self, connection: u64, entry: &Arc<Entry>, note: impl FnOnce(&mut Client)) -> Attribution {
        let Some(client) = self.open.get_mut(&connection) else {
            return self.part_of(connection, entry);
        };
        if client.who == Who::Stranger || client.is_foreign() {
            return Attribution::Bystander;
        }
        if !self.is_vehicle {
            return Attribution::Judged;
        }
        let before = std::mem::take(&mut client.held);
        let came = std::mem::replace(&mut client.who, Who::Device);
        note(client);
        let id = client.id.clone();
        self.establish(connection);
        if came == Who::Device {
            return Attribution::Judged;
        }
        self.strangers.remove(&id);
        Attribution::Joined(before)
    }

    fn publishes(
        &mut self,
        connection: u64,
        topic: &str,
        payload: &Payload,
        retain: bool,
        entry: &Arc<Entry>,
    ) -> Attribution {
        let Some(client) = self.open.get(&connection) else {
            return self.part_of(connection, entry);
        };
        if client.who == Who::Stranger || client.is_foreign() {
            return self.forges(connection, topic, payload, retain, entry);
        }
        if !self.is_vehicle {
            return Attribution::Judged;
        }
        // Two connections with one client id follow each other; the broker ends the first.
        let says_so = |other: &&Client| other.publishes.contains(topic) && other.id != client.id;
        let is_new = client.who == Who::Bystander || !client.publishes.contains(topic);
        let beside = self.device_beside(connection).find(says_so).map(|other| {
            let is_stronger = client.look.will.is_some() && other.look.will.is_none();
            let is_alike = client.look == other.look || is_stronger;
            let why = format!("two clients publish on {topic}: {:?} and {:?}", other.id, client.id);
            (is_alike || client.is_own(), client.is_own() && other.is_own(), why)
        });
        if let Some((is_alike, false, why)) = beside {
            let now = entry.at().moment;
            if is_new && !is_alike && !self.excuse.holds(now) {
                return self.forges(connection, topic, payload, retain, entry);
            }
            if topic != self.connection {
                if !self.excuse.holds(now) {
                    self.rivals.publish(topic, connection, &why, entry.seq());
                }
                self.influence.lasts(now + AFTER_TAKEOVER, why);
            }
        }
        self.joins(connection, entry, |client| {
            client.publishes.insert(topic.to_owned());
        })
    }

    /// Somebody else speaks in the name of the device.
    fn forges(
        &mut self,
        connection: u64,
        topic: &str,
        payload: &Payload,
        retain: bool,
        entry: &Arc<Entry>,
    ) -> Attribution {
        let now = entry.at().moment;
        self.influence.await_delivery(topic, payload);
        if let Some(who) = self.disown(connection, topic) {
            let why = format!("{who} published on {topic}, where only the device may");
            // What is stored in its name comes to every later subscriber.
            let long = if retain {
                Duration::from_secs(365 * 86_400)
            } else {
                AFTER_FORGERY
            };
            self.influence.lasts(now + long, why);
        }
        Attribution::Bystander
    }

    /// Somebody publishes where the device is commanded. The device itself may not do so either, and that is judged.
    fn commands(&mut self, connection: u64, topic: &str, payload: &Payload, entry: &Arc<Entry>) -> Attribution {
        let is_device = self.open.get(&connection).is_none_or(|client| {
            client.who == Who::Device && (self.is_known(client) || self.device_beside(connection).next().is_none())
        });
        if is_device {
            return self.part_of(connection, entry);
        }
        self.influence.await_delivery(topic, payload);
        if let Some(who) = self.disown(connection, topic) {
            let why = format!("{who} published on {topic}, where the device is commanded");
            self.harm.lasts(entry.at().moment + AFTER_COMMAND, why.clone());
            self.influence.lasts(entry.at().moment + AFTER_COMMAND, why);
        }
        Attribution::Bystander
    }

    /// A connection is a stranger's that has published on a topic: who it is.
    fn disown(&mut self, connection: u64, topic: &str) -> Option<String> {
        let client = self.open.get_mut(&connection)?;
        client.who = Who::Stranger;
        client.held.clear();
        let named = client.named();
        self.stranger(&named).publishes(topic);
        Some(format!("the client {:?} at {}", named.id, named.peer))
    }
}
