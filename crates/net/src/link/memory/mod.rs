//! An in-process bus in virtual time: the whole bench without a network.
//!
//! Its peers are devices without sockets and clock ([`Device`]). The bus moves time from one thing that is due to the next, so that a run of
//! minutes takes milliseconds and is the same every time. MQTT's rules are in `broker`, the way of a packet
//! from device to broker and back, with link faults, in `traffic` and `endings`, map files in `downloads`.

mod broker;
mod connection;
mod downloads;
mod endings;
mod packets;
mod random;
#[cfg(test)]
mod tests;
mod traffic;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};
use std::time::Duration;

use crate::bench::{LinkError, Offer};
use crate::link::Link;
use crate::tap::faults::{Change, Faults};
use tck_base::clock::{Moment, Stamp};
use tck_base::device::{Commanded, Device, Download, Input, Output, Publication};
use tck_journal::Vantage;
use tck_journal::event::{Direction, Event, LinkFault, Occurrence, Payload, Source};

use connection::Connection;
use packets::{Down, Up};

/// From the broker to the harness; far below what a device can notice.
const TO_HARNESS: Duration = Duration::from_micros(100);
/// A peer that wants to be woken again and again at the same moment gets on in steps of this.
const LEAST_WAKE: Duration = Duration::from_millis(1);
/// The broker's name for the harness's standing subscription.
const HARNESS: broker::Client = 0;

/// How the bus behaves.
#[derive(Clone, Debug)]
pub struct MemoryOptions {
    /// Topic filters of the harness's standing subscription.
    pub device_topics: Vec<String>,
    /// From the device to the tap, and back.
    pub latency: Duration,
    /// Up to this much is added to each latency, by `seed`. The order of packets stays.
    pub jitter: Duration,
    /// What the jitter is drawn from.
    pub seed: u64,
    /// Packets arrive only at multiples of this, several at once; zero is off.
    pub coalesce: Duration,
    /// Whether there is a tap between the peers and the broker.
    pub vantage: Vantage,
}

impl Default for MemoryOptions {
    fn default() -> Self {
        Self {
            device_topics: Vec::new(),
            latency: Duration::from_millis(1),
            jitter: Duration::ZERO,
            seed: 1,
            coalesce: Duration::ZERO,
            vantage: Vantage::Tap,
        }
    }
}

/// What is due at some moment.
#[derive(Debug)]
enum Task {
    Report(Source, Option<Direction>, Event),
    AtTap(u64, Up),
    Pump(u64, Direction),
    AtDevice(u64, Down),
    KeepAlive(u64),
    Ping(u64),
    GiveUp(u64),
    Lost(usize),
    Download(usize, u64, Download),
}

struct Due {
    at: Moment,
    order: u64,
    task: Task,
}

impl PartialEq for Due {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Due {}

impl PartialOrd for Due {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Due {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (self.at, self.order).cmp(&(other.at, other.order))
    }
}

/// A peer plugged into the bus.
struct Plug {
    peer: Box<dyn Device>,
    /// Whether it belongs to the harness: no tap, no link faults, and what it publishes is reported as sent.
    own: bool,
    /// When it is to be given the time next.
    wake_up: Option<Moment>,
    connection: Option<u64>,
}

/// The in-memory bench.
pub struct MemoryLink {
    now: Stamp,
    options: MemoryOptions,
    random: random::XorShift,
    broker: broker::Broker,
    faults: Faults,
    plugs: Vec<Plug>,
    connections: BTreeMap<u64, Connection>,
    agenda: BinaryHeap<Reverse<Due>>,
    ready: VecDeque<Occurrence>,
    offers: BTreeMap<String, Offer>,
    /// Numbers of tasks, connections, requests and probes.
    order: u64,
    opened: u64,
    requests: u64,
    probes: u64,
    broken: Option<String>,
}

impl MemoryLink {
    /// A bench at `start` with the devices under test already switched on: each is given the time once,
    /// before anything else happens.
    #[must_use]
    pub fn new(start: Stamp, peers: Vec<Box<dyn Device>>, options: MemoryOptions) -> Self {
        let mut broker = broker::Broker::default();
        broker.accept(HARNESS, "", true, None);
        let filters: Vec<_> = options.device_topics.iter().map(|topic| (topic.clone(), 2)).collect();
        broker.subscribe(HARNESS, &filters);
        let mut link = Self {
            now: start,
            random: random::XorShift::new(options.seed),
            options,
            broker,
            faults: Faults::default(),
            plugs: Vec::new(),
            connections: BTreeMap::new(),
            agenda: BinaryHeap::new(),
            ready: VecDeque::new(),
            offers: BTreeMap::new(),
            order: 0,
            opened: 0,
            requests: 0,
            probes: 0,
            broken: None,
        };
        for peer in peers {
            link.plug(peer, false);
        }
        link
    }

    /// Adds a peer that belongs to the harness, such as a mock AGV for a master control under test. It is not
    /// behind the tap, link faults do not touch it, and what it publishes is reported as [`Event::Sent`].
    /// Returns its number for [`MemoryLink::command`].
    pub fn add_own_peer(&mut self, peer: Box<dyn Device>) -> usize {
        self.plug(peer, true)
    }

    /// Does something to the peer with number `peer`, counted from 0 in the order of [`MemoryLink::new`].
    /// A number nobody has is ignored.
    pub fn command(&mut self, peer: usize, name: &str, value: serde_json::Value) {
        self.drive(peer, Input::Command(name.to_owned(), value));
    }

    /// Breaks the broker: from now on the link only returns [`LinkError::Broker`].
    pub fn break_broker(&mut self, reason: &str) {
        self.broken = Some(reason.to_owned());
    }

    fn plug(&mut self, peer: Box<dyn Device>, own: bool) -> usize {
        self.plugs.push(Plug {
            peer,
            own,
            wake_up: Some(self.now.moment),
            connection: None,
        });
        self.plugs.len() - 1
    }

    fn moment(&self) -> Moment {
        self.now.moment
    }

    fn at(&mut self, at: Moment, task: Task) {
        self.order += 1;
        let at = at.max(self.moment());
        self.agenda.push(Reverse(Due {
            at,
            order: self.order,
            task,
        }));
    }

    fn after(&mut self, delay: Duration, task: Task) {
        self.at(self.moment() + delay, task);
    }

    fn report(&mut self, source: Source, direction: Option<Direction>, event: Event) {
        self.ready.push_back(Occurrence {
            at: self.now,
            source,
            direction,
            event,
        });
    }

    /// Gives a peer an input and does what it wants.
    fn drive(&mut self, index: usize, input: Input) {
        let now = self.now;
        let Some(plug) = self.plugs.get_mut(index) else { return };
        let mut wanted = Vec::new();
        let timed = input == Input::Time;
        plug.peer.handle(now, input, &mut wanted);
        let earliest = if timed { now.moment + LEAST_WAKE } else { now.moment };
        plug.wake_up = plug.peer.wake_up().map(|wake_up| wake_up.max(earliest));
        for output in wanted {
            self.perform(index, output);
        }
    }

    fn perform(&mut self, index: usize, output: Output) {
        match output {
            Output::Publish(message) => self.publish_of(index, message),
            Output::Fetch { token, url } => self.fetch(index, token, &url),
            Output::Connect => self.open(index),
            Output::Disconnect => self.close(index, true),
            Output::Drop => self.close(index, false),
            Output::Raw(bytes) => self.raw(index, bytes),
        }
    }

    /// Does the one thing that is due next, unless that is after `until`.
    fn step(&mut self, until: Moment) -> bool {
        let until = until.max(self.moment());
        let task = self.agenda.peek().map(|Reverse(due)| due.at);
        let wake = (self.plugs.iter().enumerate())
            .filter_map(|(index, plug)| Some((plug.wake_up?, index)))
            .min();
        let task_first = match (task, wake) {
            (Some(task), Some((wake, _))) => task <= wake,
            (task, _) => task.is_some(),
        };
        let next = if task_first { task } else { wake.map(|(wake, _)| wake) };
        let Some(next) = next.filter(|next| *next <= until) else {
            self.now = self.now.at(until);
            return false;
        };
        self.now = self.now.at(next.max(self.moment()));
        if !task_first {
            if let Some((_, index)) = wake {
                self.drive(index, Input::Time);
            }
        } else if let Some(Reverse(due)) = self.agenda.pop() {
            self.run(due.task);
        }
        true
    }

    fn run(&mut self, task: Task) {
        match task {
            Task::Report(source, direction, event) => self.report(source, direction, event),
            Task::AtTap(connection, up) => self.at_tap(connection, up),
            Task::Pump(connection, direction) => self.pump(connection, direction),
            Task::AtDevice(connection, down) => self.at_device(connection, down),
            Task::KeepAlive(connection) => self.keep_alive(connection),
            Task::Ping(connection) => self.ping(connection),
            Task::GiveUp(connection) => self.give_up(connection),
            Task::Lost(peer) => self.drive(peer, Input::ConnectionLost),
            Task::Download(peer, token, progress) => self.drive(peer, Input::Download { token, progress }),
        }
    }

    fn check(&self) -> Result<(), LinkError> {
        match &self.broken {
            None => Ok(()),
            Some(reason) => Err(LinkError::Broker {
                broker: "memory".to_owned(),
                reason: reason.clone(),
            }),
        }
    }
}

impl Link for MemoryLink {
    fn now(&self) -> Stamp {
        self.now
    }

    fn vantage(&self) -> Vantage {
        self.options.vantage
    }

    async fn publish(&mut self, message: Publication) -> Result<(), LinkError> {
        self.check()?;
        let deliveries = self.broker.publish(message);
        self.distribute(deliveries);
        Ok(())
    }

    async fn next(&mut self, until: Moment) -> Result<Option<Occurrence>, LinkError> {
        loop {
            if let Some(occurrence) = self.ready.pop_front() {
                return Ok(Some(occurrence));
            }
            self.check()?;
            if !self.step(until) {
                return Ok(None);
            }
        }
    }

    async fn fault(&mut self, fault: LinkFault) -> Result<(), LinkError> {
        if self.options.vantage != Vantage::Tap {
            return Err(LinkError::NeedsTap {
                what: "a link fault".to_owned(),
            });
        }
        match self.faults.apply(&fault) {
            Change::Cut { .. } => self.cut(),
            Change::Keep => self.release(fault == LinkFault::Restore),
        }
        Ok(())
    }

    fn command(&mut self, name: &str, parameters: serde_json::Value) -> Commanded {
        let Some(plug) = self.plugs.first() else {
            return Commanded::Nobody;
        };
        if let Some(why) = plug.peer.declines(name, &parameters) {
            return Commanded::Declined(why);
        }
        MemoryLink::command(self, 0, name, parameters);
        Commanded::Taken
    }

    fn vehicle(&mut self, number: usize, what: &str, with: serde_json::Value) -> bool {
        let mut own = self.plugs.iter().enumerate().filter(|(_, plug)| plug.own);
        let Some((peer, _)) = own.nth(number) else { return false };
        MemoryLink::command(self, peer, what, with);
        true
    }

    async fn fresh_subscriber(&mut self, topic: &str) -> Result<u64, LinkError> {
        self.check()?;
        self.requests += 1;
        let request = self.requests;
        for stored in self.broker.stored(topic) {
            let event = Event::Retained {
                request,
                topic: stored.topic,
                qos: stored.qos,
                retain: stored.retain,
                payload: Payload::keep(stored.payload),
            };
            self.after(
                2 * TO_HARNESS,
                Task::Report(Source::Link, Some(Direction::FromDevice), event),
            );
        }
        self.after(
            2 * TO_HARNESS,
            Task::Report(Source::Link, None, Event::RetainedEnd { request }),
        );
        Ok(request)
    }

    async fn probe(&mut self) -> Result<u64, LinkError> {
        self.check()?;
        self.probes += 1;
        let probe = self.probes;
        self.after(
            2 * TO_HARNESS,
            Task::Report(Source::Link, None, Event::ProbeReceived { probe }),
        );
        Ok(probe)
    }

    async fn serve(&mut self, offer: Offer) -> Result<String, LinkError> {
        Ok(self.offer(offer))
    }
}
