//! The first record of a journal: what the run is about.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use tck_journal::event::{MockVehicle, RunHeader, Setting, ShardRecord};
use tck_journal::{Vantage, tool};
use tck_pack::{Pack, Participant};
use tck_profile::Secrets;
use tck_result::CERTIFY;

/// Format of the journal.
pub const JOURNAL_FORMAT: &str = "vda5050-tck.journal/1";

/// Makes the header of a run.
pub struct HeaderParts<'a> {
    /// Who is judged.
    pub subject: &'a Participant,
    /// The protocol version.
    pub pack: &'a Pack,
    /// Identifier of the run.
    pub run: &'a str,
    /// Whether nothing is left to choose: the run is for a certificate.
    pub certifies: bool,
    /// From where the harness sees.
    pub vantage: Vantage,
    /// SHA-256 over suites, schemas and requirements.
    pub suites: &'a str,
    /// Whether the suites differ from the built-in ones.
    pub modified: bool,
    /// `time.*` in milliseconds.
    pub time: Map<String, Value>,
    /// `device.*` beside identity and factsheet.
    pub device: Map<String, Value>,
    /// The mock AGVs of the harness; none when an AGV is tested.
    pub vehicles: Vec<MockVehicle>,
    /// What is known of each of them: `${each.…}`.
    pub fleet: Vec<Value>,
    /// Effective settings.
    pub settings: Vec<Setting>,
    /// The command line.
    pub command: Vec<String>,
    /// SHA-256 of the files that make the device what it is, by name.
    pub files: BTreeMap<String, String>,
    /// Which part of a run it is.
    pub shard: Option<ShardRecord>,
}

impl HeaderParts<'_> {
    /// The header.
    #[must_use]
    pub fn header(self) -> RunHeader {
        let mut device = self.device;
        device.insert("manufacturer".to_owned(), json!(self.subject.manufacturer));
        device.insert("serialNumber".to_owned(), json!(self.subject.serial_number));
        let mut bindings = Map::new();
        bindings.insert("time".to_owned(), Value::Object(self.time));
        bindings.insert("device".to_owned(), Value::Object(device));
        for (name, vehicle) in ["vehicle", "second"].into_iter().zip(&self.vehicles) {
            let identity = json!({ "manufacturer": vehicle.manufacturer, "serialNumber": vehicle.serial_number });
            bindings.insert(name.to_owned(), identity);
        }
        if !self.fleet.is_empty() {
            bindings.insert("fleet".to_owned(), Value::Array(self.fleet));
        }
        RunHeader {
            format: JOURNAL_FORMAT.to_owned(),
            tool: tool(),
            run: self.run.to_owned(),
            mode: self.certifies.then(|| CERTIFY.to_owned()),
            role: self.subject.role.word().to_owned(),
            protocol: self.pack.version.to_string(),
            manufacturer: self.subject.manufacturer.clone(),
            serial_number: self.subject.serial_number.clone(),
            topics: match self.vehicles.first() {
                Some(vehicle) => vehicle.topics.clone(),
                None => self.subject.topics(self.pack),
            },
            vehicles: self.vehicles,
            vantage: match self.vantage {
                Vantage::Tap => "tap".to_owned(),
                Vantage::Subscriber => "subscriber".to_owned(),
            },
            suites: self.suites.to_owned(),
            modified: self.modified,
            bindings,
            settings: self.settings,
            files: self.files,
            shard: self.shard,
            command: self
                .command
                .iter()
                .map(|word| Secrets::default().out_of(word))
                .collect(),
        }
    }
}
