//! What a journal would begin with that holds the traffic of one side: monitors judge by it.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use tck_journal::event::{MockVehicle, RunHeader};
use tck_pack::{Pack, Role};
use tck_profile::TimeLimits;

/// The header for a side of a vehicle with these topics, by name.
pub(super) fn header(
    role: Role,
    pack: &Pack,
    manufacturer: &str,
    serial_number: &str,
    topics: BTreeMap<String, String>,
) -> RunHeader {
    let identity = json!({ "manufacturer": manufacturer, "serialNumber": serial_number });
    let mut bindings = Map::new();
    bindings.insert("time".to_owned(), Value::Object(TimeLimits::default().bindings()));
    bindings.insert("device".to_owned(), identity.clone());
    let mut vehicles = Vec::new();
    if role == Role::MasterControl {
        bindings.insert("vehicle".to_owned(), identity);
        vehicles.push(MockVehicle {
            manufacturer: manufacturer.to_owned(),
            serial_number: serial_number.to_owned(),
            protocol: None,
            topics: topics.clone(),
        });
    }
    RunHeader {
        format: "vda5050-tck.journal/1".to_owned(),
        role: role.word().to_owned(),
        protocol: pack.version.to_string(),
        manufacturer: manufacturer.to_owned(),
        serial_number: serial_number.to_owned(),
        topics,
        vehicles,
        vantage: "subscriber".to_owned(),
        bindings,
        ..RunHeader::default()
    }
}
