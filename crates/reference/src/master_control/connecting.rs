//! Its connection to the broker: how it connects, what it subscribes to, and what a lost link does (sections 6.1 to 6.3).
//!
//! The QoS of subscriptions follows the ruling of TOPIC-14. Everything is kept over a lost link (MQTT-10).

use crate::{ConnectOptions, Output};
use tck_base::clock::Moment;

use super::hooks::Event;
use super::vehicle::Vehicle;
use super::{HEARD, MasterControl, Site};

/// The link to the broker.
#[derive(Clone, Debug)]
pub(crate) struct Connection {
    pub(crate) online: bool,
    /// When the next attempt is due.
    pub(crate) attempt_at: Option<Moment>,
    /// It was ended in good order.
    shut_down: bool,
    /// It has stood before.
    pub(crate) returning: bool,
    /// Number of times it was lost.
    pub(crate) losses: u32,
}

impl Default for Connection {
    /// Not connected yet, and eager to be.
    fn default() -> Self {
        Self {
            online: false,
            attempt_at: Some(Moment::START),
            shut_down: false,
            returning: false,
            losses: 0,
        }
    }
}

impl MasterControl {
    /// How to connect now.
    pub(super) fn joining(&mut self) -> ConnectOptions {
        let config = &self.site.config;
        // Only where a vehicle says that it is gone, a message must not be lost.
        let subscription = |vehicle: &Vehicle, name: &str| {
            let topic = vehicle.topic(name)?;
            Some((topic.to_owned(), u8::from(name == "connection")))
        };
        let vehicles = self.fleet.iter();
        let subscriptions = vehicles.flat_map(|vehicle| HEARD.iter().filter_map(|name| subscription(vehicle, name)));
        let mut options = ConnectOptions {
            level: 4,
            client_id: config.name.clone(),
            keep_alive: config.keep_alive,
            clean_session: true,
            will: None,
            subscriptions: subscriptions.collect(),
        };
        self.site.connects(&self.fleet, &mut options);
        options
    }

    /// The broker accepted. What was sent and not seen is given its time again.
    pub(super) fn connected(&mut self) {
        let returning = self.site.connection.returning;
        self.site.connection.online = true;
        self.site.connection.attempt_at = None;
        self.site.connection.shut_down = false;
        self.site.connection.returning = true;
        let now = self.site.now.moment;
        for vehicle in &mut self.fleet {
            vehicle.give_time(now);
            vehicle.at(now);
            self.site.happens(vehicle, &mut Event::Connected(returning));
        }
    }

    /// The link broke. Everything is kept, and goes on after the next connection.
    pub(super) fn connection_lost(&mut self) {
        self.site.connection.online = false;
        if self.site.connection.shut_down {
            return;
        }
        self.site.connection.losses += 1;
        if self.site.connection.attempt_at.is_none() {
            let retry = self.site.retries(Some(self.site.config.reconnect_delay));
            self.site.connection.attempt_at = retry.map(|delay| self.site.now.moment + delay);
        }
    }
}

impl Site {
    /// Asks for a connection when it is time.
    pub(super) fn attempt_connection(&mut self) {
        let due = self.connection.attempt_at.is_some_and(|at| at <= self.now.moment);
        if due && !self.connection.online {
            self.connection.attempt_at = None;
            self.pending.push(Output::Connect);
        }
    }

    /// Goes offline in good order.
    pub(crate) fn shut_down(&mut self) {
        if self.connection.online {
            self.pending.push(Output::Disconnect);
        }
        self.connection.online = false;
        self.connection.shut_down = true;
        self.connection.attempt_at = None;
    }

    /// Connects again.
    pub(super) fn start(&mut self) {
        if !self.connection.online {
            self.connection.shut_down = false;
            self.connection.attempt_at = Some(self.now.moment);
        }
    }
}
