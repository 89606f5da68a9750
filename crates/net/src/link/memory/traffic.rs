//! The way of a packet: device, tap, broker, and back; with keep-alive and link faults.
//!
//! A packet *from* the device is reported when it reaches the tap, whatever becomes of it then; a packet *to*
//! the device when it leaves the tap, because only then does the device get it. The TCP tap does the same.

use std::collections::BTreeSet;
use std::time::Duration;

use bytes::Bytes;

use super::broker::{Client, Delivery};
use super::connection::{Connection, Lane, next_id, take_due};
use super::packets::{Down, Up, connect_packet, down_packet, up_packet};
use super::{HARNESS, MemoryLink, TO_HARNESS, Task};
use crate::tap::faults::Fate;
use tck_base::clock::Moment;
use tck_base::device::{Input, Publication};
use tck_journal::Vantage;
use tck_journal::event::{Close, Direction, Event, Packet, Payload, Source};
use tck_wire::Reader;

/// How long a client waits for a connection to be accepted.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

impl MemoryLink {
    pub(super) fn open(&mut self, peer: usize) {
        self.close(peer, false);
        let now = self.now;
        let Some(plug) = self.plugs.get_mut(peer) else { return };
        let connect = plug.peer.connect_options(now);
        self.opened += 1;
        let id = self.opened;
        plug.connection = Some(id);
        let connection = Connection {
            peer,
            tapped: self.options.vantage == Vantage::Tap && !plug.own,
            subscriptions: connect.subscriptions.clone(),
            keep_alive: connect.keep_alive,
            admitted: false,
            known: false,
            established: false,
            device_open: true,
            broker_open: true,
            end_reported: false,
            heard: now.moment,
            unanswered_ping: false,
            up: Lane::new(),
            down: Lane::new(),
            last_at_tap: now.moment,
            last_at_device: now.moment,
            device_ids: 0,
            broker_ids: 0,
            broker_has: BTreeSet::new(),
            device_has: BTreeSet::new(),
            reader: Reader::default(),
        };
        self.connections.insert(id, connection);
        self.send(id, Up::Connect(connect));
        self.after(CONNECT_TIMEOUT, Task::GiveUp(id));
    }

    /// The device closes its connection, in order or not.
    pub(super) fn close(&mut self, peer: usize, orderly: bool) {
        let Some(id) = self.plugs.get_mut(peer).and_then(|plug| plug.connection.take()) else {
            return;
        };
        if orderly {
            self.send(id, Up::Disconnect);
        }
        self.send(id, Up::Close);
        if let Some(connection) = self.connections.get_mut(&id) {
            connection.device_open = false;
        }
    }

    pub(super) fn publish_of(&mut self, peer: usize, message: Publication) {
        let Some(plug) = self.plugs.get(peer) else { return };
        let own = plug.own;
        let Some((id, connection)) = (plug.connection).and_then(|id| Some((id, self.connections.get_mut(&id)?))) else {
            return;
        };
        if !connection.established {
            return;
        }
        let packet_id = if message.qos == 0 {
            0
        } else {
            next_id(&mut connection.device_ids)
        };
        if own {
            let event = Event::Sent {
                topic: message.topic.clone(),
                qos: message.qos,
                retain: message.retain,
                payload: Payload::keep(message.payload.clone()),
            };
            self.report(Source::Harness, Some(Direction::ToDevice), event);
        }
        self.send(id, Up::Publish(message, packet_id, false));
    }

    pub(super) fn raw(&mut self, peer: usize, bytes: Vec<u8>) {
        if let Some(id) = self.plugs.get(peer).and_then(|plug| plug.connection) {
            self.send(id, Up::Raw(bytes.into()));
        }
    }

    pub(super) fn send(&mut self, id: u64, up: Up) {
        let at = self.arrival();
        let Some(connection) = self.connections.get_mut(&id) else {
            return;
        };
        connection.last_at_tap = connection.last_at_tap.max(at);
        let at = connection.last_at_tap;
        self.at(at, Task::AtTap(id, up));
    }

    /// When something that sets out now arrives.
    fn arrival(&mut self) -> Moment {
        let at = self.moment() + self.options.latency + self.random.up_to(self.options.jitter);
        let grid = u64::try_from(self.options.coalesce.as_micros()).unwrap_or(u64::MAX);
        if grid == 0 {
            return at;
        }
        Moment::from_micros(at.micros().div_ceil(grid).saturating_mul(grid))
    }

    pub(super) fn at_tap(&mut self, id: u64, up: Up) {
        let Some(connection) = self.connections.get_mut(&id) else {
            return;
        };
        if !connection.tapped {
            match up {
                Up::Raw(bytes) => self.read_raw(id, &bytes),
                up => self.at_broker(id, up),
            }
            return;
        }
        if let Up::Connect(_) = up
            && !self.faults.admits()
        {
            let peer = connection.peer;
            self.connections.remove(&id);
            self.refuse(peer, id);
            return;
        }
        match &up {
            Up::Connect(connect) => {
                connection.admitted = true;
                let peer = format!("peer {}", connection.peer);
                let packet = connect_packet(connect);
                self.report(
                    Source::Tap,
                    Some(Direction::FromDevice),
                    Event::Opened { connection: id, peer },
                );
                self.saw_packet(id, packet);
            }
            Up::Raw(bytes) => {
                let bytes = bytes.clone();
                return self.read_raw(id, &bytes);
            }
            Up::Garbage => {}
            Up::Close => {
                let known = connection.known;
                self.report_end(id, Close::DeviceFin);
                if !known && self.faults.is_silent(Direction::FromDevice) {
                    // The broker never heard of it, and shall not hear of a connection that is over.
                    self.connections.remove(&id);
                    return;
                }
            }
            up => {
                if let Some(packet) = up_packet(up) {
                    self.saw_packet(id, packet);
                }
            }
        }
        let mut copies = vec![up];
        if let [Up::Publish(message, packet_id, _)] = &copies[..] {
            match self.faults.fate_of_publish(Direction::FromDevice, &message.topic) {
                Fate::Forward => {}
                Fate::Swallow => {
                    self.note(
                        Direction::FromDevice,
                        format!("a PUBLISH on {} was swallowed", message.topic),
                    );
                    copies.clear();
                }
                Fate::Twice => {
                    self.note(
                        Direction::FromDevice,
                        format!("a PUBLISH on {} was sent on twice", message.topic),
                    );
                    copies.push(Up::Publish(message.clone(), *packet_id, message.qos > 0));
                }
            }
        }
        let due = self.moment() + self.faults.delay(Direction::FromDevice);
        if let Some(connection) = self.connections.get_mut(&id) {
            connection.up.extend(copies.into_iter().map(|up| (due, up)));
        }
        self.at(due, Task::Pump(id, Direction::FromDevice));
    }

    /// Bytes of a defect that no client library can produce: packets are taken as such, the rest is garbage.
    fn read_raw(&mut self, id: u64, bytes: &[u8]) {
        let Some(connection) = self.connections.get_mut(&id) else {
            return;
        };
        connection.reader.push(bytes);
        let tapped = connection.tapped;
        let mut pieces = Vec::new();
        while let Some(piece) = connection.reader.next_piece() {
            pieces.push(piece);
        }
        for piece in pieces {
            let evidence = piece.evidence();
            match piece.content {
                Ok(Packet::Publish {
                    topic,
                    qos,
                    retain,
                    dup,
                    packet_id,
                    payload,
                }) => {
                    let payload = Bytes::copy_from_slice(payload.bytes());
                    let message = Publication {
                        topic,
                        payload,
                        qos,
                        retain,
                    };
                    self.at_tap(id, Up::Publish(message, packet_id.unwrap_or(0), dup));
                }
                Ok(Packet::Subscribe { packet_id, filters }) => {
                    let filters = filters.into_iter().map(|filter| (filter.filter, filter.qos)).collect();
                    self.at_tap(id, Up::Subscribe(packet_id, filters));
                }
                Ok(Packet::Pingreq) => self.at_tap(id, Up::Ping),
                Ok(Packet::Disconnect { .. }) => self.at_tap(id, Up::Disconnect),
                content => {
                    if tapped {
                        let event = match content {
                            Ok(packet) => Event::Packet { connection: id, packet },
                            Err(reason) => Event::Undecodable {
                                connection: id,
                                reason,
                                bytes: Payload::keep(evidence),
                            },
                        };
                        self.report(Source::Tap, Some(Direction::FromDevice), event);
                    }
                    self.at_tap(id, Up::Garbage);
                }
            }
        }
    }

    /// Lets go on what may go on in one direction.
    pub(super) fn pump(&mut self, id: u64, direction: Direction) {
        while !self.faults.is_silent(direction) {
            let now = self.moment();
            let Some(connection) = self.connections.get_mut(&id) else {
                return;
            };
            match direction {
                Direction::FromDevice => match take_due(&mut connection.up, now) {
                    Some(up) => self.at_broker(id, up),
                    None => return,
                },
                Direction::ToDevice => match take_due(&mut connection.down, now) {
                    Some(down) => self.leave_tap(id, down),
                    None => return,
                },
            }
        }
    }

    fn at_broker(&mut self, id: u64, up: Up) {
        let now = self.moment();
        let Some(connection) = self
            .connections
            .get_mut(&id)
            .filter(|connection| connection.broker_open)
        else {
            return;
        };
        connection.heard = now;
        match up {
            Up::Connect(connect) => {
                connection.known = true;
                let keep_alive = connect.keep_alive;
                let accepted = self
                    .broker
                    .accept(id, &connect.client_id, connect.clean_session, connect.will);
                if let Some(displaced) = accepted.displaced {
                    self.broker_closes(displaced);
                }
                self.down(id, Down::Connack(accepted.session_present));
                let waiting = accepted.waiting.into_iter().map(|delivery| (id, delivery)).collect();
                self.distribute(waiting);
                if !keep_alive.is_zero() {
                    self.after(keep_alive + keep_alive / 2, Task::KeepAlive(id));
                }
            }
            Up::Subscribe(packet_id, filters) => {
                let stored = self.broker.subscribe(id, &filters);
                self.down(
                    id,
                    Down::Suback(packet_id, filters.iter().map(|(_, qos)| *qos).collect()),
                );
                self.distribute(stored.into_iter().map(|delivery| (id, delivery)).collect());
            }
            Up::Publish(message, packet_id, _) => {
                let known = message.qos == 2 && !connection.broker_has.insert(packet_id);
                match message.qos {
                    0 => {}
                    1 => self.down(id, Down::Ack("puback", packet_id)),
                    _ => self.down(id, Down::Ack("pubrec", packet_id)),
                }
                if !known {
                    let deliveries = self.broker.publish(message);
                    self.distribute(deliveries);
                }
            }
            Up::Ack("pubrel", packet_id) => {
                connection.broker_has.remove(&packet_id);
                self.down(id, Down::Ack("pubcomp", packet_id));
            }
            Up::Ack("pubrec", packet_id) => self.down(id, Down::Ack("pubrel", packet_id)),
            Up::Ack(..) | Up::Raw(_) => {}
            Up::Ping => self.down(id, Down::Pong),
            Up::Disconnect => {
                self.leave(id, true);
            }
            Up::Garbage => self.broker_closes(id),
            Up::Close => {
                connection.broker_open = false;
                self.leave(id, false);
                self.forget(id);
            }
        }
    }

    pub(super) fn broker_closes(&mut self, id: u64) {
        self.leave(id, false);
        if let Some(connection) = self.connections.get_mut(&id) {
            connection.broker_open = false;
        }
        self.down(id, Down::Close);
        self.forget(id);
    }

    /// Sends what the broker delivers on its way.
    pub(super) fn distribute(&mut self, deliveries: Vec<(Client, Delivery)>) {
        for (client, delivery) in deliveries {
            if client == HARNESS {
                let event = Event::Message {
                    topic: delivery.topic,
                    qos: delivery.qos,
                    retain: delivery.retain,
                    dup: false,
                    payload: Payload::keep(delivery.payload),
                };
                self.after(
                    TO_HARNESS,
                    Task::Report(Source::Link, Some(Direction::FromDevice), event),
                );
                continue;
            }
            let Some(connection) = self.connections.get_mut(&client) else {
                continue;
            };
            let packet_id = if delivery.qos == 0 {
                0
            } else {
                next_id(&mut connection.broker_ids)
            };
            self.down(client, Down::Publish(delivery, packet_id, false));
        }
    }

    fn down(&mut self, id: u64, down: Down) {
        let Some(connection) = self.connections.get(&id) else {
            return;
        };
        if !connection.tapped {
            self.leave_tap(id, down);
            return;
        }
        let mut copies = vec![down];
        if let [Down::Publish(delivery, packet_id, _)] = &copies[..] {
            match self.faults.fate_of_publish(Direction::ToDevice, &delivery.topic) {
                Fate::Forward => {}
                Fate::Swallow => {
                    self.note(
                        Direction::ToDevice,
                        format!("a PUBLISH on {} was swallowed", delivery.topic),
                    );
                    copies.clear();
                }
                Fate::Twice => copies.push(Down::Publish(delivery.clone(), *packet_id, delivery.qos > 0)),
            }
        }
        let delay = self.faults.delay(Direction::ToDevice);
        let due = self.moment() + delay;
        if let Some(connection) = self.connections.get_mut(&id) {
            connection.down.extend(copies.into_iter().map(|down| (due, down)));
        }
        if delay.is_zero() {
            self.pump(id, Direction::ToDevice);
        } else {
            self.at(due, Task::Pump(id, Direction::ToDevice));
        }
    }

    fn leave_tap(&mut self, id: u64, down: Down) {
        let at = self.arrival();
        let Some(connection) = self.connections.get_mut(&id) else {
            return;
        };
        connection.last_at_device = connection.last_at_device.max(at);
        let (at, tapped) = (connection.last_at_device, connection.tapped);
        if tapped && connection.device_open {
            match down_packet(&down) {
                Some(packet) => {
                    let event = Event::Packet { connection: id, packet };
                    self.report(Source::Tap, Some(Direction::ToDevice), event);
                }
                None => self.report_end(id, Close::Broker),
            }
        }
        self.at(at, Task::AtDevice(id, down));
    }

    pub(super) fn at_device(&mut self, id: u64, down: Down) {
        let Some(connection) = self
            .connections
            .get_mut(&id)
            .filter(|connection| connection.device_open)
        else {
            return;
        };
        let peer = connection.peer;
        match down {
            Down::Connack(_) => {
                let (keep_alive, filters) = (connection.keep_alive, connection.subscriptions.clone());
                if !keep_alive.is_zero() {
                    self.after(keep_alive, Task::Ping(id));
                }
                if filters.is_empty() {
                    self.established(id);
                } else if let Some(connection) = self.connections.get_mut(&id) {
                    let packet_id = next_id(&mut connection.device_ids);
                    self.send(id, Up::Subscribe(packet_id, filters));
                }
            }
            Down::Suback(..) => self.established(id),
            Down::Publish(delivery, packet_id, _) => {
                let known = delivery.qos == 2 && !connection.device_has.insert(packet_id);
                match delivery.qos {
                    0 => {}
                    1 => self.send(id, Up::Ack("puback", packet_id)),
                    _ => self.send(id, Up::Ack("pubrec", packet_id)),
                }
                if !known {
                    self.drive(
                        peer,
                        Input::Message {
                            topic: delivery.topic,
                            payload: delivery.payload,
                        },
                    );
                }
            }
            Down::Ack("pubrel", packet_id) => {
                connection.device_has.remove(&packet_id);
                self.send(id, Up::Ack("pubcomp", packet_id));
            }
            Down::Ack("pubrec", packet_id) => self.send(id, Up::Ack("pubrel", packet_id)),
            Down::Ack(..) => {}
            Down::Pong => connection.unanswered_ping = false,
            Down::Close => {
                connection.device_open = false;
                self.lose(peer, id);
                self.forget(id);
            }
        }
    }

    fn established(&mut self, id: u64) {
        if let Some(connection) = self.connections.get_mut(&id)
            && !connection.established
        {
            connection.established = true;
            let peer = connection.peer;
            self.drive(peer, Input::Connected);
        }
    }

    fn saw_packet(&mut self, connection: u64, packet: Packet) {
        self.report(
            Source::Tap,
            Some(Direction::FromDevice),
            Event::Packet { connection, packet },
        );
    }

    pub(super) fn report_end(&mut self, id: u64, how: Close) {
        if let Some(connection) = self.connections.get_mut(&id)
            && !std::mem::replace(&mut connection.end_reported, true)
        {
            let direction = match how {
                Close::DeviceFin | Close::DeviceReset => Some(Direction::FromDevice),
                Close::Broker => Some(Direction::ToDevice),
                Close::Harness => None,
            };
            self.report(Source::Tap, direction, Event::Closed { connection: id, how });
        }
    }

    pub(super) fn note(&mut self, direction: Direction, text: String) {
        self.report(Source::Tap, Some(direction), Event::Note { text });
    }
}
