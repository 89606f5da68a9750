//! How connections end: keep-alive, cuts, refusals, impatience; and what happens to held packets at `restore`.

use super::packets::Up;
use super::{MemoryLink, Task};
use tck_base::device::Input;
use tck_journal::event::{Close, Direction, Event, Payload, Source};

impl MemoryLink {
    /// The broker lets a connection go. The last will of a peer of the harness is one of its messages, like any other.
    pub(super) fn leave(&mut self, id: u64, orderly: bool) {
        let plug = self
            .connections
            .get(&id)
            .and_then(|connection| self.plugs.get(connection.peer));
        let will = self
            .broker
            .will_of(id)
            .filter(|_| !orderly && plug.is_some_and(|plug| plug.own));
        if let Some(will) = will {
            let event = Event::Sent {
                topic: will.topic.clone(),
                qos: will.qos,
                retain: will.retain,
                payload: Payload::keep(will.payload.clone()),
            };
            self.report(Source::Harness, Some(Direction::ToDevice), event);
        }
        let deliveries = self.broker.leave(id, orderly);
        self.distribute(deliveries);
    }

    pub(super) fn lose(&mut self, peer: usize, id: u64) {
        if let Some(plug) = self.plugs.get_mut(peer)
            && plug.connection == Some(id)
        {
            plug.connection = None;
            self.drive(peer, Input::ConnectionLost);
        }
    }

    pub(super) fn refuse(&mut self, peer: usize, id: u64) {
        self.note(Direction::FromDevice, "a connection attempt was refused".to_owned());
        if let Some(plug) = self.plugs.get_mut(peer)
            && plug.connection == Some(id)
        {
            plug.connection = None;
            let latency = self.options.latency;
            self.after(latency, Task::Lost(peer));
        }
    }

    /// The broker's watch over a connection.
    pub(super) fn keep_alive(&mut self, id: u64) {
        let now = self.moment();
        let Some(connection) = self.connections.get(&id).filter(|connection| connection.broker_open) else {
            return;
        };
        let expires = connection.heard + connection.keep_alive + connection.keep_alive / 2;
        if expires > now {
            self.at(expires, Task::KeepAlive(id));
        } else {
            self.broker_closes(id);
        }
    }

    /// The device's own watch: a ping that is not answered before the next one is due ends the connection.
    pub(super) fn ping(&mut self, id: u64) {
        let Some(connection) = self
            .connections
            .get_mut(&id)
            .filter(|connection| connection.device_open)
        else {
            return;
        };
        if connection.unanswered_ping {
            self.abandon(id);
            return;
        }
        connection.unanswered_ping = true;
        let keep_alive = connection.keep_alive;
        self.send(id, Up::Ping);
        self.after(keep_alive, Task::Ping(id));
    }

    pub(super) fn give_up(&mut self, id: u64) {
        if self
            .connections
            .get(&id)
            .is_some_and(|connection| connection.device_open && !connection.established)
        {
            self.abandon(id);
        }
    }

    pub(super) fn abandon(&mut self, id: u64) {
        self.send(id, Up::Close);
        if let Some(connection) = self.connections.get_mut(&id) {
            connection.device_open = false;
            let peer = connection.peer;
            self.lose(peer, id);
        }
    }

    pub(super) fn cut(&mut self) {
        let ids: Vec<u64> = (self.connections.iter())
            .filter(|(_, connection)| connection.tapped && connection.admitted)
            .map(|(id, _)| *id)
            .collect();
        for id in ids {
            self.report_end(id, Close::Harness);
            self.leave(id, false);
            if let Some(connection) = self.connections.remove(&id)
                && connection.device_open
                && let Some(plug) = self.plugs.get_mut(connection.peer)
                && plug.connection == Some(id)
            {
                plug.connection = None;
                let latency = self.options.latency;
                self.after(latency, Task::Lost(connection.peer));
            }
        }
    }

    /// After a change of faults: what is held back goes on where it may.
    pub(super) fn release(&mut self, at_once: bool) {
        let now = self.moment();
        let ids: Vec<u64> = self.connections.keys().copied().collect();
        for id in ids {
            if at_once && let Some(connection) = self.connections.get_mut(&id) {
                connection.up.iter_mut().for_each(|(due, _)| *due = now);
                connection.down.iter_mut().for_each(|(due, _)| *due = now);
            }
            self.pump(id, Direction::FromDevice);
            self.pump(id, Direction::ToDevice);
        }
    }

    pub(super) fn forget(&mut self, id: u64) {
        if self
            .connections
            .get(&id)
            .is_some_and(|connection| !connection.device_open && !connection.broker_open)
        {
            self.connections.remove(&id);
        }
    }
}
