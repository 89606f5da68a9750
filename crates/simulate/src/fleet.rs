//! The mock AGVs that a master control is tested with: reference AGVs with identities and places of their own.

use std::collections::BTreeSet;
use std::ops::Range;
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

/// The mock AGVs of a run, which may speak different protocol versions.
#[derive(Clone, Debug, Default)]
pub struct Fleet {
    /// The vehicles; the first one is the one that tests talk about.
    pub vehicles: Vec<ReferenceAgv>,
    topics: Vec<FleetTopic>,
    /// Whether other processes have the rest of its vehicles.
    is_part: bool,
}

/// The serial number of the vehicle that comes after so many others: one of those given, or one that is made up.
#[must_use]
pub fn serial_number(serials: &[String], before: usize) -> String {
    let given = serials.get(before).cloned();
    given.unwrap_or_else(|| format!("{MADE_UP}{}", before + 1))
}

/// A topic of a vehicle of a fleet.
#[derive(Clone, Debug)]
struct FleetTopic {
    /// The number of its vehicle in the fleet, counted from 0.
    vehicle: usize,
    /// The whole topic.
    full: String,
    /// The whole topic, with `+` for the serial number.
    of_any: Option<String>,
    publisher: Role,
    is_retained: bool,
}

impl Fleet {
    /// `count` vehicles on the floor of `like`, spread over its nodes. The serial numbers are those given, and then
    /// made up.
    #[must_use]
    pub fn new(like: &ReferenceAgv, manufacturer: &str, serials: &[String], count: usize, pack: &Pack) -> Self {
        let mut fleet = Self::default();
        for number in 0..count.max(1) {
            fleet.join(like, manufacturer, &serial_number(serials, number), pack);
            // The first two stand far from each other, so that neither is in the way.
            let places = like.places();
            let place = match number {
                0 => places.first(),
                1 => places.last(),
                _ => places.get(number % places.len().max(1)),
            };
            if let (Some(vehicle), Some(place)) = (fleet.vehicles.last_mut(), place) {
                (*place).clone_into(&mut vehicle.config.start_node);
            }
        }
        fleet
    }

    /// Adds a vehicle like this one that speaks the version of this pack. Those behind the first two speak as often as big fleets
    /// do.
    pub fn join(&mut self, like: &ReferenceAgv, manufacturer: &str, serial_number: &str, pack: &Pack) {
        let number = self.vehicles.len();
        let mut vehicle = like.clone();
        if number >= USUAL_FLEET {
            vehicle.config.state_interval = Duration::from_secs(1);
            vehicle.config.visualization_interval = None;
        }
        let template = like.subject.topic_template.as_deref();
        vehicle.rename(manufacturer, serial_number, template, pack);
        let any = Participant {
            serial_number: "+".to_owned(),
            ..vehicle.subject.clone()
        };
        let mut of_any = any.topics(pack);
        for (name, full) in &vehicle.config.topics {
            let Some(rule) = pack.topic(name) else { continue };
            self.topics.push(FleetTopic {
                vehicle: number,
                full: full.clone(),
                of_any: of_any.remove(name),
                publisher: rule.publisher,
                is_retained: rule.retain,
            });
        }
        self.vehicles.push(vehicle);
    }

    /// Keeps a part of the vehicles, where other processes have the rest. The first two of a part stand and speak as the first two
    /// of the whole do, since tests talk about them.
    pub fn keep(&mut self, own: Range<usize>) {
        let whole = std::mem::take(&mut self.vehicles);
        let usual: Vec<ReferenceAgv> = whole.iter().take(USUAL_FLEET).cloned().collect();
        self.vehicles = whole.into_iter().take(own.end).skip(own.start).collect();
        for (vehicle, like) in self.vehicles.iter_mut().zip(&usual) {
            vehicle.config.start_node.clone_from(&like.config.start_node);
            vehicle.config.state_interval = like.config.state_interval;
            vehicle.config.visualization_interval = like.config.visualization_interval;
        }
        self.topics.retain(|topic| own.contains(&topic.vehicle));
        self.is_part = true;
    }

    /// As the journal of a run in this version names them.
    #[must_use]
    pub fn mock_vehicles(&self, pack: &Pack) -> Vec<MockVehicle> {
        let version = pack.version.to_string();
        let all = self.vehicles.iter();
        all.map(|vehicle| MockVehicle {
            manufacturer: vehicle.subject.manufacturer.clone(),
            serial_number: vehicle.subject.serial_number.clone(),
            protocol: Some(vehicle.config.version.clone()).filter(|own| *own != version),
            topics: vehicle.config.topics.clone(),
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
    pub fn commanded(&self) -> Vec<String> {
        self.topics_where(|topic| topic.publisher == Role::MasterControl)
    }

    /// The topics these vehicles publish.
    #[must_use]
    pub fn published(&self) -> Vec<String> {
        self.topics_where(|topic| topic.publisher == Role::Agv)
    }

    /// The topics on which these vehicles leave retained messages.
    #[must_use]
    pub fn retained(&self) -> Vec<String> {
        self.topics_where(|topic| topic.is_retained)
    }

    fn topics_where(&self, wanted: impl Fn(&FleetTopic) -> bool) -> Vec<String> {
        let all = self.topics.iter().filter(|topic| wanted(topic));
        all.map(|topic| topic.full.clone()).collect()
    }

    /// Where vehicles of the harness may have left retained messages: these, and those of a run that had more of them and never
    /// came to its end. A part of a fleet leaves those of the other parts alone.
    #[must_use]
    pub fn leavings(&self) -> Leavings {
        if self.is_part {
            return Leavings {
                own: self.published(),
                filters: self.topics_where(|topic| topic.publisher == Role::Agv && topic.is_retained),
                any_made_up: false,
            };
        }
        let published = self.topics.iter().filter(|topic| topic.publisher == Role::Agv);
        let made_up: BTreeSet<String> = published.filter_map(|topic| topic.of_any.clone()).collect();
        Leavings {
            own: self.published(),
            filters: made_up.into_iter().collect(),
            any_made_up: true,
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
    /// What is subscribed to: these topics with `+` for the serial number, unless they are a part of a fleet.
    filters: Vec<String>,
    /// Whether vehicles whose name is made up are the harness's own, whatever their number.
    any_made_up: bool,
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
        let made_up = || self.any_made_up && self.filters.iter().any(|filter| is_made_up(filter) == Some(true));
        self.own.iter().any(|own| own == topic) || made_up()
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
        let leavings = fleet.leavings();
        let of = |serial: &str, name: &str| pack.fill_topic(pack.topic_template(), "ACME", serial, name);
        for serial in ["A-1", "mock-2", "mock-17"] {
            assert!(leavings.is_own(&of(serial, "connection")), "{serial}");
        }
        for serial in ["A-2", "mock-", "mock-x", "mock-2/mock-3", "x-mock-2"] {
            assert!(!leavings.is_own(&of(serial, "connection")), "{serial}");
        }
        assert!(leavings.filters().contains(&of("+", "factsheet")));
        let retained = fleet.retained();
        assert!(retained.contains(&of("A-1", "connection")) && retained.contains(&of("mock-2", "factsheet")));
        assert!(!retained.contains(&of("A-1", "state")), "{retained:?}");
    }

    #[test]
    fn a_part_of_a_fleet_begins_as_the_fleet_does_and_touches_no_other_part() {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let whole = Fleet::new(&ReferenceAgv::new(pack), "ACME", &["A-1".to_owned()], 7, pack);
        let mut part = whole.clone();
        part.keep(3..6);
        let named: Vec<&str> = part
            .vehicles
            .iter()
            .map(|one| one.subject.serial_number.as_str())
            .collect();
        assert_eq!(named, ["mock-4", "mock-5", "mock-6"]);
        for (own, like) in part.vehicles.iter().zip(&whole.vehicles).take(2) {
            assert_eq!(own.config.start_node, like.config.start_node);
            assert_eq!(own.config.state_interval, like.config.state_interval);
        }
        assert_eq!(part.vehicles[2].config.state_interval, Duration::from_secs(1));
        let of = |serial: &str, name: &str| pack.fill_topic(pack.topic_template(), "ACME", serial, name);
        let leavings = part.leavings();
        assert!(leavings.is_own(&of("mock-4", "connection")));
        for serial in ["A-1", "mock-3", "mock-7", "mock-17"] {
            assert!(!leavings.is_own(&of(serial, "connection")), "{serial}");
        }
        assert!(leavings.filters().contains(&of("mock-6", "factsheet")));
        assert!(!leavings.filters().iter().any(|filter| filter.contains('+')));
        assert_eq!(part.commanded().len() * 7, whole.commanded().len() * 3);
    }
}
