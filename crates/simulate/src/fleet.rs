//! The mock AGVs that a master control is tested with: reference AGVs with identities and places of their own.

use std::collections::BTreeSet;
use std::time::Duration;

use serde_json::{Value, json};

use super::reference_agv::ReferenceAgv;
use tck_journal::event::MockVehicle;
use tck_pack::Participant;
use tck_pack::{Pack, Role};

/// How many mock AGVs there are unless more are asked for: the one that tests talk about, and one beside it.
pub const USUAL_FLEET: usize = 2;

/// How the serial number of a mock AGV begins that nobody has named; its number follows.
const MADE_UP: &str = "mock-";

/// The mock AGVs of a run.
#[derive(Clone, Debug)]
pub struct Fleet {
    /// The vehicles; the first one is the one that tests talk about.
    pub vehicles: Vec<ReferenceAgv>,
}

impl Fleet {
    /// `count` vehicles on the floor of `like`, spread over its nodes. The serial numbers are those given, and then
    /// made up.
    #[must_use]
    pub fn new(like: &ReferenceAgv, manufacturer: &str, serials: &[String], count: usize, pack: &Pack) -> Self {
        let template = like.subject.topic_template.clone();
        let places: Vec<&str> = like.places();
        let vehicles = (0..count.max(1)).map(|number| {
            let mut vehicle = like.clone();
            if number >= USUAL_FLEET {
                // The tests talk about the first two; those beside them speak as often as big fleets do.
                vehicle.config.state_interval = Duration::from_secs(1);
                vehicle.config.visualization_interval = None;
            }
            let serial = serials
                .get(number)
                .cloned()
                .unwrap_or_else(|| format!("{MADE_UP}{}", number + 1));
            vehicle.rename(manufacturer, &serial, template.as_deref(), pack);
            // The first two stand far from each other, so that neither is in the way.
            let place = match number {
                0 => places.first(),
                1 => places.last(),
                _ => places.get(number % places.len().max(1)),
            };
            if let Some(place) = place {
                (*place).clone_into(&mut vehicle.config.start_node);
            }
            vehicle
        });
        Self {
            vehicles: vehicles.collect(),
        }
    }

    /// Vehicles of these manufacturers and serial numbers on the floor of `like`.
    #[must_use]
    pub fn named(like: &ReferenceAgv, names: &[(String, String)], pack: &Pack) -> Self {
        let template = like.subject.topic_template.as_deref();
        let vehicles = names.iter().map(|(manufacturer, serial)| {
            let mut vehicle = like.clone();
            vehicle.rename(manufacturer, serial, template, pack);
            vehicle
        });
        Self {
            vehicles: vehicles.collect(),
        }
    }

    /// As the journal names them.
    #[must_use]
    pub fn mock_vehicles(&self, pack: &Pack) -> Vec<MockVehicle> {
        let all = self.vehicles.iter();
        all.map(|vehicle| MockVehicle {
            manufacturer: vehicle.subject.manufacturer.clone(),
            serial_number: vehicle.subject.serial_number.clone(),
            topics: vehicle.subject.topics(pack),
        })
        .collect()
    }

    /// What a test may say about each of them: its name, and a node next to where it starts.
    #[must_use]
    pub fn bindings(&self) -> Vec<Value> {
        let all = self.vehicles.iter();
        all.map(|vehicle| {
            let here = &vehicle.config.start_node;
            let beyond = vehicle.layout.edges().filter(|edge| edge.start == *here);
            let is_place = |id: &str| vehicle.layout.node(id).is_some_and(|node| !node.station);
            let next = beyond.map(|edge| edge.end.as_str()).find(|id| is_place(id));
            json!({
                "manufacturer": vehicle.subject.manufacturer,
                "serialNumber": vehicle.subject.serial_number,
                "next": next.unwrap_or(here),
            })
        })
        .collect()
    }

    /// The topics a master control publishes for these vehicles.
    #[must_use]
    pub fn commanded(&self, pack: &Pack) -> Vec<String> {
        let all = self.vehicles.iter().map(|vehicle| Participant {
            role: Role::MasterControl,
            ..vehicle.subject.clone()
        });
        all.flat_map(|subject| subject.published(pack)).collect()
    }

    /// The topics these vehicles publish.
    #[must_use]
    pub fn published(&self, pack: &Pack) -> Vec<String> {
        let all = self.vehicles.iter();
        all.flat_map(|vehicle| vehicle.subject.published(pack)).collect()
    }

    /// The topics on which these vehicles leave retained messages.
    #[must_use]
    pub fn retained(&self, pack: &Pack) -> Vec<String> {
        let kept = pack.topics().iter().filter(|rule| rule.retain);
        let kept: Vec<&str> = kept.map(|rule| rule.name.as_str()).collect();
        let all = self.vehicles.iter().flat_map(|vehicle| {
            let mut topics = vehicle.subject.topics(pack);
            kept.iter().filter_map(move |name| topics.remove(*name))
        });
        all.collect()
    }

    /// Where vehicles of the harness may have left retained messages: these, and those of a run that had more of them and never
    /// came to its end.
    #[must_use]
    pub fn leavings(&self, pack: &Pack) -> Leavings {
        let any = self.vehicles.iter().map(|vehicle| Participant {
            serial_number: "+".to_owned(),
            ..vehicle.subject.clone()
        });
        let made_up: BTreeSet<String> = any.flat_map(|any| any.published(pack)).collect();
        Leavings {
            own: self.published(pack),
            filters: made_up.into_iter().collect(),
        }
    }

    /// How to put a vehicle back where it is at the start of a test.
    #[must_use]
    pub fn reset(node: Option<&str>) -> Value {
        node.map_or_else(|| json!({}), |node| json!({ "nodeId": node }))
    }
}

/// Topics on which vehicles of the harness leave something behind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leavings {
    own: Vec<String>,
    /// These topics as filters, with `+` for the serial number.
    filters: Vec<String>,
}

impl Leavings {
    /// What to subscribe to, to see all of it.
    #[must_use]
    pub fn filters(&self) -> Vec<String> {
        self.filters.clone()
    }

    /// Whether a vehicle of the harness has left what is retained there: one of these, or one whose name is made up.
    #[must_use]
    pub fn is_own(&self, topic: &str) -> bool {
        let is_made_up = |filter: &String| {
            let (before, after) = filter.split_once('+')?;
            let serial = topic.strip_prefix(before)?.strip_suffix(after)?;
            let number = serial.strip_prefix(MADE_UP)?;
            Some(!number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
        };
        self.own.iter().any(|own| own == topic) || self.filters.iter().any(|filter| is_made_up(filter) == Some(true))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_vehicles_of_the_harness_leave_something_behind() {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let fleet = Fleet::new(&ReferenceAgv::new(pack), "ACME", &["A-1".to_owned()], 2, pack);
        let leavings = fleet.leavings(pack);
        let of = |serial: &str, name: &str| pack.fill_topic(pack.topic_template(), "ACME", serial, name);
        for serial in ["A-1", "mock-2", "mock-17"] {
            assert!(leavings.is_own(&of(serial, "connection")), "{serial}");
        }
        for serial in ["A-2", "mock-", "mock-x", "mock-2/mock-3", "x-mock-2"] {
            assert!(!leavings.is_own(&of(serial, "connection")), "{serial}");
        }
        assert!(leavings.filters().contains(&of("+", "factsheet")));
        let retained = fleet.retained(pack);
        assert!(retained.contains(&of("A-1", "connection")) && retained.contains(&of("mock-2", "factsheet")));
        assert!(!retained.contains(&of("A-1", "state")), "{retained:?}");
    }
}
