//! Who speaks on a broker: what a subscriber hears of devices, without sending anything.
//!
//! [`Heard`] takes messages in and knows no broker and no clock. What it calls a remark is not a verdict: it is what a person
//! wants to look at before a run.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;
use serde_json::Value;

use super::sheet::Sheet;
use tck_journal::json::Parsed;
use tck_judge::MessageTally;
use tck_net::bench::client::{Client, ClientEvent, ClientOptions};
use tck_net::bench::endpoint::Endpoint;
use tck_pack::{Pack, Packs};
use tck_result::MessageCoverage;
use tck_view::{Header, Member, MessageView, Topic};

/// How many devices are told apart; a broker with more is shown in parts.
const DEVICES: usize = 2_000;
/// How many remarks are kept of a device.
const REMARKS: usize = 5;

/// What was heard of one device.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Device {
    /// Manufacturer, by its topics.
    pub manufacturer: String,
    /// Serial number, by its topics.
    pub serial_number: String,
    /// What stands before manufacturer and serial number, such as `uagv/v2`.
    pub prefix: String,
    /// The version in its headers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// How many messages came on each topic.
    pub messages: BTreeMap<String, u64>,
    /// Its last connection state.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub connection: Option<String>,
    /// Its last operating mode.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode: Option<String>,
    /// Its last node, if it names one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_node: Option<String>,
    /// Where it stands, if it says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<Position>,
    /// Its factsheet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub factsheet: Option<Value>,
    /// What is odd about its messages, the first of each kind.
    pub remarks: Vec<String>,
}

/// Where a vehicle stands.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Position {
    /// In metres.
    pub x: f64,
    /// In metres.
    pub y: f64,
    /// Map.
    pub map_id: String,
}

/// Prefix, manufacturer and serial number of the topics of a device.
type Key = (String, String, String);

/// Everything that was heard.
#[derive(Debug, Default)]
pub struct Heard {
    devices: BTreeMap<Key, Device>,
    /// What the messages of each device had, by the version that it speaks.
    tallies: BTreeMap<Key, MessageTally>,
    /// How many messages were of no device.
    pub others: u64,
}

impl Heard {
    /// Takes one message in.
    pub fn take(&mut self, topic: &str, payload: &[u8], packs: &Packs) {
        let Some((prefix, manufacturer, serial, name)) = parts(topic, packs) else {
            self.others = self.others.saturating_add(1);
            return;
        };
        let key = (prefix.to_owned(), manufacturer.to_owned(), serial.to_owned());
        if self.devices.len() >= DEVICES && !self.devices.contains_key(&key) {
            self.others = self.others.saturating_add(1);
            return;
        }
        let device = self.devices.entry(key.clone()).or_insert_with(|| Device {
            manufacturer: manufacturer.to_owned(),
            serial_number: serial.to_owned(),
            prefix: prefix.to_owned(),
            ..Device::default()
        });
        *device.messages.entry(name.to_owned()).or_default() += 1;
        let parsed = Parsed::of_bytes(payload);
        let Some(message) = parsed.value() else {
            // An empty retained message is how a topic is cleared.
            if !payload.is_empty() {
                device.remark(format!("{name}: a payload is not JSON"));
            }
            return;
        };
        device.read(name, message, packs);
        let pack = device.pack(packs);
        let tally = self.tallies.entry(key).or_insert_with(|| MessageTally::new(pack));
        if tally.pack().version != pack.version {
            *tally = MessageTally::new(pack);
        }
        tally.note(name, message);
    }

    /// Which members and words of the standard the messages of a device had, without those that came: what nobody has seen.
    #[must_use]
    pub fn coverage(&self, device: &Device) -> Option<MessageCoverage> {
        let Device {
            prefix,
            manufacturer,
            serial_number,
            ..
        } = device;
        let key = (prefix.clone(), manufacturer.clone(), serial_number.clone());
        Some(self.tallies.get(&key)?.result().only_missing())
    }

    /// The devices, by manufacturer and serial number.
    #[must_use]
    pub fn devices(&self) -> Vec<&Device> {
        let mut all: Vec<&Device> = self.devices.values().collect();
        all.sort_by(|one, other| {
            (&one.manufacturer, &one.serial_number).cmp(&(&other.manufacturer, &other.serial_number))
        });
        all
    }
}

impl Device {
    /// The pack of its version; the latest one where it names none that is known.
    fn pack<'p>(&self, packs: &'p Packs) -> &'p Arc<Pack> {
        let own = self.version.as_deref().and_then(|version| packs.get(version));
        own.unwrap_or_else(|| packs.latest())
    }

    /// Its factsheet, if one was heard.
    #[must_use]
    pub fn sheet(&self, packs: &Packs) -> Option<Sheet> {
        let message = self.factsheet.as_ref()?;
        Some(Sheet::read(message, self.pack(packs).names()))
    }

    fn read(&mut self, name: &str, message: &Value, packs: &Packs) {
        let topic = Topic::of_name(name);
        let view = MessageView::of_value(topic, message, self.pack(packs).names());
        let header = view.header();
        for (member, own, by_topic) in [
            (Header::manufacturer, &header.manufacturer, self.manufacturer.clone()),
            (Header::serial_number, &header.serial_number, self.serial_number.clone()),
        ] {
            let member = member.usual_name();
            match own.text() {
                Some(own) if own == by_topic => {}
                Some(own) => self.remark(format!("{name}: {member} is {own:?}, and {by_topic:?} in the topic")),
                None => self.remark(format!("{name}: the header has no {member}")),
            }
        }
        if let Some(version) = header.version.text().map(str::to_owned) {
            if packs.get(&version).is_none() {
                self.remark(format!("{name}: version {version} is not known here"));
            }
            if self.version.as_ref().is_some_and(|known| *known != version) {
                self.remark(format!(
                    "{name}: version is {version}, and another one in other messages"
                ));
            }
            if topic.is_from_vehicle() {
                self.version = Some(version);
            }
        }
        let pack = self.pack(packs);
        let schema = pack.schema(name);
        if let Some(finding) = schema.and_then(|schema| schema.findings(message).into_iter().next()) {
            let place = if finding.path.is_empty() {
                "the message"
            } else {
                &finding.path
            };
            self.remark(format!("{name}: {place}: {}", finding.message));
        }
        // Only now is it known what its version calls things.
        match MessageView::of_value(topic, message, pack.names()) {
            MessageView::Connection(said) => {
                self.connection = said
                    .connection_state
                    .text()
                    .map(str::to_owned)
                    .or(self.connection.take());
            }
            MessageView::Factsheet(_) => self.factsheet = Some(message.clone()),
            MessageView::State(state) => {
                self.mode = state.operating_mode.text().map(str::to_owned).or(self.mode.take());
                let node = state.last_node_id.text().filter(|id| !id.is_empty());
                self.last_node = node.map(str::to_owned).or(self.last_node.take());
                self.stands(&state.position);
            }
            MessageView::Visualization(shown) => self.stands(&shown.position),
            _ => {}
        }
    }

    fn stands(&mut self, shown: &Member<tck_view::Position>) {
        let position = shown.there().and_then(|position| {
            Some(Position {
                x: position.x.float()?,
                y: position.y.float()?,
                map_id: position.map_id.text()?.to_owned(),
            })
        });
        self.position = position.or(self.position.take());
    }

    /// Keeps the first remarks, each once.
    fn remark(&mut self, text: String) {
        let text: String = text.chars().take(200).collect();
        if self.remarks.len() < REMARKS && !self.remarks.contains(&text) {
            self.remarks.push(text);
        }
    }
}

/// Prefix, manufacturer, serial number and name of a topic; `None` when it is of no device.
fn parts<'a>(topic: &'a str, packs: &Packs) -> Option<(&'a str, &'a str, &'a str, &'a str)> {
    let mut levels = topic.rsplitn(4, '/');
    let name = levels.next()?;
    let serial = levels.next()?;
    let manufacturer = levels.next()?;
    let prefix = levels.next().unwrap_or_default();
    let is_known = packs
        .all()
        .iter()
        .any(|pack| pack.topics().iter().any(|rule| rule.name.as_str() == name));
    (is_known && !serial.is_empty() && !manufacturer.is_empty()).then_some((prefix, manufacturer, serial, name))
}

/// Listens on a broker for so long, or until it is interrupted. Nothing is published.
///
/// # Errors
/// Why the broker does not let us listen.
pub async fn listen(
    endpoint: Endpoint,
    filters: &[String],
    time: Duration,
    packs: &Packs,
    mut interrupt: tokio::sync::watch::Receiver<bool>,
) -> Result<Heard, String> {
    let made_up = || format!("tck-discover-{}", &uuid::Uuid::new_v4().simple().to_string()[..8]);
    let options = ClientOptions {
        client_id: endpoint.client_id.clone().unwrap_or_else(made_up),
        endpoint,
        keep_alive: Duration::from_secs(30),
        clean_session: true,
        will: None,
        subscriptions: filters.iter().map(|filter| (filter.clone(), 0)).collect(),
    };
    let (_client, mut events) = Client::open(&options);
    let mut heard = Heard::default();
    let over = tokio::time::sleep(time);
    tokio::pin!(over);
    loop {
        tokio::select! {
            () = &mut over => return Ok(heard),
            _ = interrupt.changed() => return Ok(heard),
            event = events.recv() => match event {
                Some(ClientEvent::Connected) => {}
                Some(ClientEvent::Message { topic, payload, .. }) => heard.take(&topic, &payload, packs),
                Some(ClientEvent::Lost(why)) => return Err(why),
                None => return Err("the connection ended".to_owned()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn heard(messages: &[(&str, Value)]) -> Heard {
        let library = tck_testing::library();
        let mut heard = Heard::default();
        for (topic, message) in messages {
            heard.take(topic, message.to_string().as_bytes(), &library.rules.packs);
        }
        heard
    }

    #[test]
    fn devices_are_told_by_their_topics_and_everything_else_is_counted() {
        let header = json!({ "manufacturer": "ACME", "serialNumber": "0002", "version": "9.9" });
        let heard = heard(&[
            ("site/v2/ACME/0002/state", header.clone()),
            (
                "site/v2/ACME/0002/connection",
                json!({ "manufacturer": "ACME", "serialNumber": "2" }),
            ),
            ("site/v2/ACME/0001/state", header),
            ("site/temperature", json!(21)),
        ]);
        let devices = heard.devices();
        let names: Vec<&str> = devices.iter().map(|device| device.serial_number.as_str()).collect();
        assert_eq!((names, heard.others), (vec!["0001", "0002"], 1));
        assert_eq!(devices[1].prefix, "site/v2");
        let remarks = devices[1].remarks.join("\n");
        assert!(remarks.contains("version 9.9 is not known here"), "{remarks}");
        assert!(
            remarks.contains("serialNumber is \"2\", and \"0002\" in the topic"),
            "{remarks}"
        );
    }

    #[test]
    fn what_a_device_never_showed_is_known_for_its_version() {
        let heard = heard(&[(
            "a/v2/M/S/state",
            json!({ "version": "2.0.0", "operatingMode": "AUTOMATIC", "driving": true }),
        )]);
        let coverage = heard.coverage(heard.devices()[0]).expect("a coverage");
        let state = coverage.topic("state").expect("a topic");
        assert_eq!((state.messages, state.shown), (1, 3));
        let never: Vec<&str> = state.never().iter().map(|one| one.member.as_str()).collect();
        assert!(
            never.contains(&"/batteryState") && !never.contains(&"/driving"),
            "{never:?}"
        );
        // What only a later version has is not missed.
        assert!(!never.contains(&"/maps"), "{never:?}");
        assert!(state.unseen_words().any(|word| word == ("/operatingMode", "MANUAL")));
    }

    #[test]
    fn the_last_place_and_mode_are_kept() {
        let state = json!({ "operatingMode": "AUTOMATIC", "lastNodeId": "n7",
            "agvPosition": { "x": 1.5, "y": 2.0, "mapId": "hall" } });
        let heard = heard(&[
            ("a/v2/M/S/state", state),
            ("a/v2/M/S/state", json!({ "lastNodeId": "" })),
        ]);
        let device = heard.devices()[0];
        assert_eq!(device.last_node.as_deref(), Some("n7"));
        assert_eq!(device.mode.as_deref(), Some("AUTOMATIC"));
        assert_eq!(
            device.position.as_ref().map(|position| (position.x, position.y)),
            Some((1.5, 2.0))
        );
    }
}
