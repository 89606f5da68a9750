//! The link to the broker: last will, ONLINE and OFFLINE, reconnecting, headers and publishing (section 6.14).

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Map, Value, json};

use crate::clock::{Moment, Stamp};
use crate::reference::{ConnectOptions, Output, Publication};

use super::Agv;
use super::faults::FaultName as F;
use super::tolerances::{ToleranceName as T, manner};

/// The state of the link, and what is counted over all connections.
#[derive(Clone, Debug)]
pub(super) struct Connection {
    pub(super) online: bool,
    /// When to ask for a connection next.
    attempt_at: Option<Moment>,
    /// Switched off: a lost connection is not restored.
    shut_down: bool,
    /// It was online before.
    returning: bool,
    /// How often it was online.
    sessions: u32,
    /// The next headerId by topic name (HDR-02).
    pub(super) header_ids: BTreeMap<&'static str, u32>,
    /// The factsheet that is published now was asked for.
    pub(super) factsheet_asked: bool,
    /// It has answered a factsheetRequest (`r2-factsheet-only-once` only).
    pub(super) factsheet_given: bool,
    /// When to say ONLINE (`online-late` only).
    pub(super) online_at: Option<Moment>,
    /// The time of the first message (`timestamp-stands-still` only).
    first: Option<jiff::Timestamp>,
}

impl Connection {
    /// Not connected yet, and eager to be.
    pub(super) fn new() -> Self {
        Self {
            online: false,
            attempt_at: Some(Moment::START),
            shut_down: false,
            returning: false,
            sessions: 0,
            header_ids: BTreeMap::new(),
            factsheet_asked: false,
            factsheet_given: false,
            online_at: None,
            first: None,
        }
    }

    /// When the next attempt is due.
    pub(super) fn next_attempt(&self) -> Option<Moment> {
        self.attempt_at.filter(|_| !self.online)
    }

    /// The link is gone, and to be restored at a time.
    pub(super) fn dropped(&mut self, attempt_at: Moment) {
        self.online = false;
        self.online_at = None;
        self.shut_down = false;
        self.attempt_at = Some(attempt_at);
    }

    /// The link is gone, and not to be restored.
    pub(super) fn stays_away(&mut self) {
        self.online = false;
        self.online_at = None;
        self.shut_down = true;
        self.attempt_at = None;
    }

    /// Nobody remembers the headerIds: it was switched off.
    pub(super) fn count_anew(&mut self) {
        self.header_ids.clear();
    }

    /// `r3-header-id-counts-orders`: counts a message that is not sent.
    pub(super) fn skip_header_id(&mut self) {
        if let Some(next) = self.header_ids.get_mut("state") {
            *next = next.wrapping_add(1);
        }
    }

    /// Whether it was online before.
    pub(super) fn was_online(&self) -> bool {
        self.returning
    }

    /// Somebody wants the vehicle connected.
    pub(super) fn wanted_at(&mut self, moment: Moment) {
        if !self.online {
            self.dropped(moment);
        }
    }
}

impl Agv {
    /// Whether it takes a liberty.
    pub(super) fn takes(&self, tolerance: T) -> bool {
        self.config.tolerances.has(tolerance)
    }

    /// How to connect: the will says CONNECTIONBROKEN (CONN-01 to CONN-04).
    pub(super) fn options(&mut self, now: Stamp) -> ConnectOptions {
        self.now = now.at(now.moment.max(self.now.moment));
        let will_topic = if self.faults.has(F::WillOnStateTopic) {
            "state"
        } else {
            "connection"
        };
        let will = self
            .config
            .topic(will_topic)
            .map(str::to_owned)
            .filter(|_| !self.faults.has(F::NoWill))
            .filter(|_| !(self.connection.returning && self.faults.has(F::R1WillForgottenOnReconnect)));
        let state = match () {
            () if self.faults.has(F::WillOffline) => "OFFLINE",
            () if self.faults.has(F::ConnectionStateUnderscore) => "CONNECTION_BROKEN",
            () => "CONNECTIONBROKEN",
        };
        let will = will.map(|topic| {
            // The will does not count: it has the headerId of the message that would be next.
            let mut message = self.header("connection", false);
            if self.faults.has(F::WillWithoutHeader) {
                message.clear();
            }
            if self.faults.has(F::R3WillHeaderIdMissing) {
                message.remove("headerId");
            }
            if self.persona.stale_will {
                let utc = self.now.utc;
                let long_ago = utc.checked_sub(jiff::SignedDuration::from_hours(24)).unwrap_or(utc);
                message.insert("headerId".into(), json!(0));
                message.insert("timestamp".into(), json!(format!("{long_ago:.2}")));
            }
            message.insert("connectionState".into(), json!(state));
            Publication {
                topic,
                payload: Value::Object(message).to_string().into_bytes(),
                qos: u8::from(!self.faults.has(F::WillQosZero)),
                retain: !self.faults.has(F::WillNotRetained),
            }
        });
        let keep_alive = match () {
            () if self.faults.has(F::KeepAliveOff) => Duration::ZERO,
            () if self.faults.has(F::KeepAliveLong) => Duration::from_secs(600),
            () => self.config.keep_alive,
        };
        let wanted: &[&str] = if self.connection.returning && self.faults.has(F::NotSubscribedAgain) {
            &[]
        } else if self.connection.returning && self.faults.has(F::R4ReconnectWithoutOrders) {
            &["instantActions"]
        } else if self.faults.has(F::InstantActionsNotSubscribed)
            || (self.connection.returning && self.faults.has(F::R1InstantActionsNotSubscribedAgain))
        {
            &["order"]
        } else {
            &["order", "instantActions"]
        };
        let mut topics: Vec<String> = wanted
            .iter()
            .filter_map(|name| self.config.topic(name))
            .map(str::to_owned)
            .collect();
        if self.takes(T::R2SubscribesWithWildcard) && wanted.len() == 2 {
            // Its own messages come back to it; it has no use for them.
            for topic in &mut topics {
                if let Some((above, _)) = topic.rsplit_once('/') {
                    *topic = format!("{above}/+");
                }
            }
            topics.dedup();
        }
        let qos = u8::from(self.takes(T::SubscribesWithQosOne));
        let subscriptions = topics.into_iter().map(|topic| (topic, qos));
        ConnectOptions {
            level: match () {
                () if self.faults.has(F::OldMqtt) => 3,
                () if self.takes(T::NewestMqtt) => 5,
                () => 4,
            },
            client_id: match self.takes(T::R2ClientIdChanges) {
                true => format!("{}-{}", self.config.serial_number, self.connection.sessions),
                false => format!("{}.{}", self.config.manufacturer, self.config.serial_number),
            },
            keep_alive,
            clean_session: !self.takes(T::SessionKept),
            will,
            subscriptions: subscriptions.collect(),
        }
    }

    /// The broker accepted: ONLINE, then the factsheet, then a state (CONN-05, CONN-11).
    pub(super) fn connected(&mut self) {
        let first = !self.connection.returning;
        if self.takes(T::HeaderIdRestarts) || self.faults.has(F::HeaderIdResetByReconnect) {
            self.connection.header_ids.clear();
        }
        self.connection.online = true;
        self.connection.returning = true;
        self.connection.sessions = self.connection.sessions.saturating_add(1);
        if !first && self.faults.has(F::R1WarningsGoneByReconnect) {
            self.errors.clear();
        }
        self.connection.attempt_at = None;
        self.connection.shut_down = false;
        if !first && self.is_busy() && self.faults.has(F::R2NodeActionsRepeatedAfterReconnect) {
            self.repeat_actions(self.book.last_sequence);
        }
        let on_request = self.takes(T::R1FactsheetOnRequestOnly);
        if !on_request && self.takes(T::R2FactsheetBeforeOnline) {
            self.publish_factsheet();
        }
        if !first && self.faults.has(F::R3ReconnectAnnounced) {
            self.publish_connection("RECONNECTING");
        }
        if !first && self.faults.has(F::R3DeletedMapBackAfterReconnect) {
            for (id, version) in std::mem::take(&mut self.third.deleted_maps) {
                self.maps.store(&id, &version, super::Faults::default());
            }
        }
        if !first && self.faults.has(F::R6ReconnectLosesDownloadedMaps) {
            self.maps.keep_only(&self.config.maps);
        }
        let unsaid = !first && self.is_busy() && self.faults.has(F::R2OnlineNotSaidMidOrder);
        if unsaid {
            // It says nothing on this connection.
        } else if !first && self.faults.has(F::OnlineLate) {
            self.connection.online_at = Some(self.moment() + Duration::from_secs(25));
        } else if !self.faults.has(F::NoOnline) && (first || !self.faults.has(F::NoOnlineAfterReconnect)) {
            let online = if self.faults.has(F::ConnectionStateConnected) {
                "CONNECTED"
            } else {
                "ONLINE"
            };
            for _ in 0..if self.takes(T::OnlineTwice) { 2 } else { 1 } {
                self.publish_connection(online);
            }
        }
        let before = self.takes(T::R2FactsheetBeforeOnline);
        let after = !before && self.takes(T::R2FactsheetAfterState);
        if !on_request && !before && !after {
            self.publish_factsheet();
        }
        self.replay_buffer();
        self.relist_nodes(first);
        self.start_reporting(first);
        if !on_request && after {
            self.flush();
            self.publish_factsheet();
        }
    }

    /// The link broke. The order goes on (MQTT-03, MQTT-04).
    pub(super) fn connection_lost(&mut self) {
        if self.faults.has(F::OrderForgottenOnLinkLoss) {
            self.give_up_order();
            self.book.order_id.clear();
        }
        self.pause_outlives |= self.holds.pause && self.faults.has(F::PauseStuckAfterCut);
        if self.faults.has(F::R1HorizonLostWithLink) {
            let gone = self.book.drop_horizon();
            self.actions.retain(|action| match action.origin {
                super::actions::Origin::Node(id) | super::actions::Origin::Edge(id) => !gone.contains(&id),
                super::actions::Origin::Instant => true,
            });
        }
        if self.faults.has(F::R2LoadForgottenWithLink) {
            self.loads.clear();
        }
        if self.book.cancelled && self.faults.has(F::R2CancelledIdLostWithLink) {
            self.book.order_id.clear();
        }
        if self.faults.has(F::R1EndedActionsLostWithLink) {
            self.actions.retain(|action| !action.status.is_terminal());
        }
        self.book.cut = true;
        self.fourth.before_cut = self.book.nodes.clone();
        if self.faults.has(F::R3RunningActionsFailWithLink) {
            let of_order = self.actions.iter_mut().filter(|action| action.of_order());
            of_order
                .filter(|action| action.status.is_active())
                .for_each(|action| action.end(super::actions::Status::Failed));
        }
        if self.faults.has(F::UpdateForgottenOnLinkLoss) {
            self.book.update_id = 0;
        }
        if self.faults.has(F::ActionsForgottenOnLinkLoss) {
            self.actions.retain(|action| !action.of_order());
        }
        if self.faults.has(F::PauseLostOnLinkLoss) {
            self.set_holds(|holds| holds.pause = false);
        }
        self.connection.online = false;
        self.connection.online_at = None;
        let ended = self.connection.shut_down || self.faults.has(F::NeverReconnects);
        if !ended && self.connection.attempt_at.is_none() {
            self.connection.attempt_at = Some(self.moment() + self.config.reconnect_delay);
        }
    }

    /// Asks for a connection when it is time.
    pub(super) fn attempt_connection(&mut self) {
        if self.connection.online_at.is_some_and(|at| at <= self.moment()) {
            self.connection.online_at = None;
            self.publish_connection("ONLINE");
        }
        if self.connection.next_attempt().is_some_and(|at| at <= self.moment()) {
            self.connection.attempt_at = None;
            self.pending.push(Output::Connect);
        }
    }

    /// Goes offline in good order (CONN-07, CONN-08).
    pub(super) fn shut_down(&mut self) {
        if self.connection.online {
            if self.takes(T::R1LastStateBeforeOffline) {
                self.report.requested = true;
                self.flush();
            }
            let mid_order = self.is_busy() && self.faults.has(F::R1OfflineSkippedMidOrder);
            if self.faults.has(F::R6OfflineRepeatsHeaderId) {
                self.connection.repeat_header_id();
            }
            if !self.faults.has(F::NoOffline) && !mid_order {
                self.publish_connection("OFFLINE");
            }
            if self.faults.has(F::OfflineThenBroken) {
                self.publish_connection("CONNECTIONBROKEN");
            }
            let silent = self.faults.has(F::NoDisconnect);
            self.pending
                .push(if silent { Output::Drop } else { Output::Disconnect });
        }
        self.connection.stays_away();
    }

    pub(super) fn publish_connection(&mut self, state: &str) {
        let mut body = Map::new();
        body.insert("connectionState".into(), json!(state));
        self.publish("connection", body, &[]);
    }

    /// `echoes-order`: tells master control what it said.
    pub(super) fn echo_order(&mut self, message: &Value) {
        if let Some(topic) = self.config.topic("order").filter(|_| self.connection.online) {
            let publication = Publication {
                topic: topic.to_owned(),
                payload: message.to_string().into_bytes(),
                qos: 0,
                retain: false,
            };
            self.pending.push(Output::Publish(publication));
        }
    }

    /// `r2-acknowledges-on-instant-actions`: answers master control on its own topic.
    pub(super) fn acknowledge_instant_actions(&mut self) {
        let mut message = self.header("connection", false);
        message.insert("actions".into(), json!([]));
        if let Some(topic) = self.config.topic("instantActions").filter(|_| self.connection.online) {
            let publication = Publication {
                topic: topic.to_owned(),
                payload: Value::Object(message).to_string().into_bytes(),
                qos: 0,
                retain: false,
            };
            self.pending.push(Output::Publish(publication));
        }
    }

    /// Publishes a message: the header, then the body. Nothing is published, or counted, while offline.
    ///
    /// `mangle` are replacements in the text of the message, for defects that no JSON writer produces.
    pub(super) fn publish(&mut self, name: &'static str, body: Map<String, Value>, mangle: &[(&str, &[u8])]) {
        let Some(topic) = self
            .config
            .topic(name)
            .map(str::to_owned)
            .filter(|_| self.connection.online)
        else {
            return;
        };
        let mut message = self.header(name, true);
        let headless = (name == "visualization" && self.faults.has(F::VisualizationWithoutHeader))
            || (name == "factsheet" && self.faults.has(F::FactsheetWithoutHeader));
        if headless {
            message.clear();
        }
        if name == "connection" && self.faults.has(F::HeaderNested) {
            message = Map::from_iter([("header".to_owned(), Value::Object(message))]);
        }
        message.extend(body);
        let states = self.connection.header_ids.get("state").copied().unwrap_or(0);
        let message = manner::reworded(self.config.tolerances, name, message, states % 2 == 0);
        let mut payload = manner::written(self.config.tolerances, message);
        for (text, bytes) in mangle {
            payload = replaced(&payload, text.as_bytes(), bytes);
        }
        let offline = message_says(&payload, b"\"OFFLINE\"");
        let again = !offline && self.connection.sessions > 1;
        let (qos, retain) = match name {
            "connection" if offline && self.faults.has(F::R1OfflineQosZero) => (0, true),
            "connection" if offline && self.faults.has(F::R1OfflineNotRetained) => (1, false),
            "connection" if again && self.faults.has(F::R1OnlineNotRetainedAgain) => (1, false),
            "visualization" if self.faults.has(F::R1VisualizationQosOne) => (1, false),
            "factsheet" if self.connection.factsheet_asked && self.faults.has(F::R1FactsheetAnswerNotRetained) => {
                (0, false)
            }
            "connection" => (
                u8::from(!self.faults.has(F::ConnectionQosZero)),
                !self.faults.has(F::ConnectionNotRetained),
            ),
            "factsheet" => (
                if self.faults.has(F::FactsheetQosTwo) { 2 } else { 0 },
                self.config.has("retainedFactsheet") && !self.faults.has(F::FactsheetNotRetained),
            ),
            "state" if !self.errors.is_empty() && self.faults.has(F::R2WarnedStateQosOne) => (1, false),
            "state" if self.takes(T::R3StatesRetained) => (0, true),
            "state" => (u8::from(self.faults.has(F::StateQosOne)), false),
            _ => (0, false),
        };
        let topic = if name == "visualization" && self.faults.has(F::OtherMajorVersion) {
            topic.replacen("/v", "/v1", 1)
        } else {
            topic
        };
        let topic = if name == "state" && self.faults.has(F::StatesTopic) {
            format!("{topic}s")
        } else {
            topic
        };
        let topic = match topic
            .strip_suffix("factsheet")
            .filter(|_| self.faults.has(F::MisspelledTopic))
        {
            Some(prefix) => format!("{prefix}fact_sheet"),
            None => topic,
        };
        let topic = match topic
            .strip_suffix("visualization")
            .filter(|_| self.faults.has(F::R3VisualizationSpelledBritish))
        {
            Some(prefix) => format!("{prefix}visualisation"),
            None => topic,
        };
        self.pending.push(Output::Publish(Publication {
            topic,
            payload,
            qos,
            retain,
        }));
    }

    /// The header of the next message on a topic (HDR-01 to HDR-05).
    pub(super) fn header(&mut self, name: &'static str, counts: bool) -> Map<String, Value> {
        let counter = if self.faults.has(F::HeaderIdShared) {
            "all"
        } else {
            name
        };
        let start = match () {
            () if self.takes(T::R3HeaderIdWraps) => u32::MAX - 12,
            () if self.takes(T::R1HeaderIdStartsHigh) => 70_000,
            () => 0,
        };
        let next = self.connection.header_ids.entry(counter).or_insert(start);
        let repeated = name == "state"
            && counts
            && *next > 0
            && self.report.answers_request()
            && self.faults.has(F::R1AnswerRepeatsHeaderId);
        if repeated {
            *next -= 1;
        }
        let id = *next;
        let constant = name == "state" && self.faults.has(F::HeaderIdConstant)
            || name == "factsheet" && self.faults.has(F::R6StaticFactsheetHeader);
        if counts && !constant {
            *next = next.wrapping_add(1);
        }
        let zeroed = name == "visualization" && self.faults.has(F::R2VisualizationHeaderIdZero);
        let header_id = if zeroed {
            json!(0)
        } else if self.faults.has(F::HeaderIdAsText) {
            json!(id.to_string())
        } else {
            json!(id)
        };
        let timestamp = self.timestamp();
        let version = match self
            .config
            .version
            .rsplit_once('.')
            .filter(|_| self.faults.has(F::VersionShort))
        {
            Some((short, _)) => short,
            None => self.persona.version.as_ref().unwrap_or(&self.config.version),
        };
        let version = if name == "factsheet" && self.faults.has(F::R1FactsheetVersionPrefixed) {
            format!("V{version}")
        } else {
            version.to_owned()
        };
        let serial = &self.config.serial_number;
        let serial_number = match () {
            () if name == "visualization" && self.faults.has(F::R1VisualizationNamesComputer) => "localhost".to_owned(),
            () if name == "connection" && self.faults.has(F::R2ConnectionSerialUpperCase) => {
                let upper = serial.to_ascii_uppercase();
                if upper == *serial {
                    serial.to_ascii_lowercase()
                } else {
                    upper
                }
            }
            () if self.faults.has(F::OtherSerialNumber) => format!("{serial}0"),
            () if self.faults.has(F::SerialNumberWithSpace) => format!("No. {serial}"),
            () => serial.clone(),
        };
        let mut header = Map::new();
        header.insert("headerId".into(), header_id);
        let timestamp = match timestamp {
            Value::String(text) if name == "factsheet" && self.faults.has(F::R1FactsheetDated) => {
                json!(text.split('T').next().unwrap_or_default())
            }
            Value::String(text) if name == "connection" && self.faults.has(F::R2ConnectionTimestampSpaced) => {
                json!(text.replacen('T', " ", 1))
            }
            Value::String(text) if name == "state" && self.faults.has(F::R3StateTimestampDecimalComma) => {
                json!(text.replacen('.', ",", 1))
            }
            timestamp => timestamp,
        };
        header.insert("timestamp".into(), timestamp);
        header.insert("version".into(), json!(version));
        if !(name == "state" && self.faults.has(F::HeaderWithoutManufacturer)) {
            let own = &self.config.manufacturer;
            let manufacturer = match () {
                () if name == "state" && self.faults.has(F::ManufacturerEmpty) => String::new(),
                () if name == "factsheet" && self.faults.has(F::R3FactsheetNamesCompany) => format!("{own} GmbH"),
                () if self.faults.has(F::ManufacturerWithSlash) => format!("{own}/agv"),
                () => own.clone(),
            };
            header.insert("manufacturer".into(), json!(manufacturer));
        }
        header.insert("serialNumber".into(), json!(serial_number));
        header
    }

    fn timestamp(&mut self) -> Value {
        let utc = match () {
            () if self.faults.has(F::TimestampStandsStill) => *self.connection.first.get_or_insert(self.now.utc),
            () if self.faults.has(F::TimestampLocalAsUtc) => {
                let hour = jiff::SignedDuration::from_hours(1);
                self.now.utc.checked_add(hour).unwrap_or(self.now.utc)
            }
            () if self.takes(T::R3ClockAhead) => {
                let ahead = jiff::SignedDuration::from_millis(1_500);
                self.now.utc.checked_add(ahead).unwrap_or(self.now.utc)
            }
            () => self.now.utc,
        };
        let text = match () {
            () if self.takes(T::SecondsWhole) => format!("{utc:.0}"),
            () if self.takes(T::SecondsFine) => format!("{utc:.6}"),
            () => format!("{utc:.2}"),
        };
        let text = self.without_zeros(text);
        match () {
            () if self.faults.has(F::TimestampLocal) => {
                let local = utc.checked_add(jiff::SignedDuration::from_hours(1)).unwrap_or(utc);
                json!(format!("{local:.2}").replace('Z', "+01:00"))
            }
            () if self.faults.has(F::TimestampWithoutZone) => json!(text.trim_end_matches('Z')),
            () if self.faults.has(F::TimestampUnix) => json!(utc.as_second()),
            () => json!(text),
        }
    }
}

/// Whether a text stands somewhere in a message.
fn message_says(payload: &[u8], text: &[u8]) -> bool {
    payload.windows(text.len().max(1)).any(|window| window == text)
}

/// `bytes` with the first occurrence of `from` replaced.
fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let Some(at) = bytes.windows(from.len().max(1)).position(|window| window == from) else {
        return bytes.to_vec();
    };
    [&bytes[..at], to, &bytes[at + from.len()..]].concat()
}
