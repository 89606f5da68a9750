//! The recording of a fleet that never was: as many messages as wanted, the same for the same seed, and with faults at
//! places that are known.
//!
//! Every vehicle drives the tours of a recording of the reference devices again and again: it comes online, is sent its
//! orders, and goes offline. [`faults`] says what can be wrong with a message, and [`impaired`] what a recorder makes of them.

mod faults;
mod impaired;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use jiff::Timestamp;
use serde_json::{Value, json};

pub use faults::{Injected, KINDS, Kind};
pub use impaired::{Impairment, Recorded};

/// A recording of two faultless vehicles of two protocol versions, and of the master control that commands them.
const TOUR: &str = include_str!("../../../../fixtures/captures/two-versions.jsonl");
/// How long a vehicle takes for a tour and its rest, in microseconds.
const PERIOD: i64 = 8_000_000;
/// How long after the first message of a tour the vehicle goes offline.
const OFFLINE: i64 = 5_500_000;
/// When the recording begins, in microseconds since 1970.
const BEGIN: i64 = 1_767_225_600_000_000;

/// What is wanted.
#[derive(Clone, Copy, Debug)]
pub struct Site {
    /// Decides everything that is left to chance.
    pub seed: u64,
    /// How many vehicles there are.
    pub vehicles: usize,
    /// How many messages.
    pub messages: u64,
    /// How many of them are to be faulty.
    pub faults: u64,
}

/// One message of the recording.
#[derive(Clone, Debug)]
pub struct SiteMessage {
    /// When.
    pub at: Timestamp,
    /// Full topic.
    pub topic: String,
    /// QoS.
    pub qos: u8,
    /// The bytes.
    pub payload: Vec<u8>,
    /// What is wrong with it.
    pub injected: Option<Injected>,
}

impl SiteMessage {
    /// The message as `mosquitto_sub -F %j` prints it. What is no text is written in base64.
    #[must_use]
    pub fn line(&self) -> String {
        use base64::Engine as _;
        let payload = std::str::from_utf8(&self.payload).map_or_else(
            |_| base64::engine::general_purpose::STANDARD.encode(&self.payload),
            str::to_owned,
        );
        let at = format!("{:.6}", self.at);
        json!({ "tst": at, "topic": self.topic, "qos": self.qos, "retain": 0, "payload": payload }).to_string()
    }
}

/// One message of a tour.
struct Step {
    after: i64,
    name: String,
    qos: u8,
    message: Value,
}

/// The tour of one of the recorded vehicles.
struct Tour {
    /// What the identifiers of its orders begin with.
    mark: String,
    steps: Vec<Step>,
    /// How many messages of each topic.
    counts: BTreeMap<String, u64>,
}

/// A vehicle on its way.
struct Vehicle {
    number: usize,
    tour: usize,
    begun: i64,
    /// Which tour it is, and which step comes next.
    round: u64,
    step: usize,
}

/// Numbers that are the same for the same seed.
struct Dice(u64);

impl Dice {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit.max(1)
    }
}

/// The messages of a site, in the order of their times.
pub struct Messages {
    site: Site,
    tours: Vec<Tour>,
    vehicles: Vec<Vehicle>,
    next: BinaryHeap<Reverse<(i64, usize)>>,
    dice: Dice,
    told: u64,
    injected: u64,
    /// The kind that comes next, so that each has its turn.
    turn: usize,
}

impl Site {
    /// Begins.
    #[must_use]
    pub fn messages(self) -> Messages {
        let tours = tours();
        let mut dice = Dice(self.seed);
        let mut vehicles = Vec::new();
        let mut next = BinaryHeap::new();
        for number in 0..self.vehicles {
            let begun = BEGIN + i64::try_from(dice.below(PERIOD.unsigned_abs())).unwrap_or_default();
            next.push(Reverse((begun, number)));
            vehicles.push(Vehicle {
                number,
                tour: number % tours.len().max(1),
                begun,
                round: 0,
                step: 0,
            });
        }
        Messages {
            site: self,
            tours,
            vehicles,
            next,
            dice,
            told: 0,
            injected: 0,
            turn: 0,
        }
    }
}

impl Iterator for Messages {
    type Item = SiteMessage;

    fn next(&mut self) -> Option<SiteMessage> {
        if self.told >= self.site.messages {
            return None;
        }
        let Reverse((at, number)) = self.next.pop()?;
        let vehicle = self.vehicles.get_mut(number)?;
        let tour = self.tours.get(vehicle.tour)?;
        let step = tour.steps.get(vehicle.step)?;
        let mut told = tour.told(step, vehicle, at);
        vehicle.step += 1;
        if vehicle.step == tour.steps.len() {
            vehicle.step = 0;
            vehicle.round += 1;
        }
        let after = tour.steps.get(vehicle.step).map_or(0, |step| step.after);
        let round = i64::try_from(vehicle.round).unwrap_or_default();
        self.next
            .push(Reverse((vehicle.begun + round * PERIOD + after, number)));
        self.told += 1;
        // As many as are due, spread over the whole recording.
        let due = u128::from(self.told) * u128::from(self.site.faults) / u128::from(self.site.messages.max(1));
        if u128::from(self.injected) < due && self.dice.below(3) == 0 {
            self.inject(&mut told);
        }
        Some(told)
    }
}

impl Messages {
    fn inject(&mut self, told: &mut SiteMessage) {
        let name = told.topic.rsplit('/').next().unwrap_or_default();
        let order = (self.turn..KINDS.len()).chain(0..self.turn);
        let mut fitting = order.filter(|at| KINDS[*at].topic == name);
        let Some((at, payload)) = fitting.find_map(|at| Some((at, KINDS[at].spoil(&told.payload)?))) else {
            return;
        };
        told.payload = payload;
        told.injected = Some(Injected {
            message: self.told,
            topic: told.topic.clone(),
            kind: KINDS[at].name,
            requirement: KINDS[at].breaks,
        });
        self.injected += 1;
        if at == self.turn || KINDS[self.turn].topic == name {
            self.turn = (at + 1) % KINDS.len();
        }
    }
}

impl Tour {
    /// A step as this vehicle takes it.
    fn told(&self, step: &Step, vehicle: &Vehicle, at: i64) -> SiteMessage {
        let mut message = step.message.clone();
        let serial = format!("fleet-{:04}", vehicle.number);
        let at = Timestamp::from_microsecond(at).unwrap_or_default();
        if let Value::Object(members) = &mut message {
            let before = members.get("headerId").and_then(Value::as_u64).unwrap_or_default();
            let each = self.counts.get(&step.name).copied().unwrap_or_default();
            members.insert("headerId".to_owned(), (before + vehicle.round * each).into());
            members.insert("timestamp".to_owned(), format!("{at:.2}").into());
            members.insert("serialNumber".to_owned(), serial.clone().into());
        }
        let mark = format!("{:04x}{:04x}", vehicle.number & 0xffff, vehicle.round & 0xffff);
        let version = message.get("version").and_then(Value::as_str).unwrap_or_default();
        let major = version.split('.').next().unwrap_or_default().to_owned();
        SiteMessage {
            at,
            topic: format!("site/v{major}/vda5050-tck/{serial}/{}", step.name),
            qos: step.qos,
            payload: message.to_string().replace(&self.mark, &mark).into_bytes(),
            injected: None,
        }
    }
}

/// The tours of the recording.
fn tours() -> Vec<Tour> {
    let mut all: BTreeMap<String, Tour> = BTreeMap::new();
    let mut begun: BTreeMap<String, i64> = BTreeMap::new();
    for line in TOUR.lines() {
        let Ok(Value::Object(mut line)) = serde_json::from_str(line) else {
            continue;
        };
        let text = |line: &serde_json::Map<String, Value>, member: &str| {
            line.get(member).and_then(Value::as_str).unwrap_or_default().to_owned()
        };
        let topic = text(&line, "topic");
        let mut levels = topic.rsplit('/');
        let (Some(name), Some(serial)) = (levels.next(), levels.next()) else {
            continue;
        };
        let time = text(&line, "tst").replace("Z+", "+");
        let Ok(at) = time.parse::<Timestamp>() else { continue };
        let Some(message) = line.remove("payload") else {
            continue;
        };
        let first = *begun.entry(serial.to_owned()).or_insert(at.as_microsecond());
        let tour = all.entry(serial.to_owned()).or_insert_with(|| Tour {
            mark: String::new(),
            steps: Vec::new(),
            counts: BTreeMap::new(),
        });
        if let Some(id) = message
            .get("orderId")
            .and_then(Value::as_str)
            .filter(|id| tour.mark.is_empty() && !id.is_empty())
        {
            id.split('-').next().unwrap_or_default().clone_into(&mut tour.mark);
        }
        *tour.counts.entry(name.to_owned()).or_default() += 1;
        tour.steps.push(Step {
            after: at.as_microsecond() - first,
            name: name.to_owned(),
            qos: line
                .get("qos")
                .and_then(Value::as_u64)
                .and_then(|qos| u8::try_from(qos).ok())
                .unwrap_or_default(),
            message,
        });
    }
    for tour in all.values_mut() {
        let Some(online) = tour.steps.iter().find(|step| step.name == "connection") else {
            continue;
        };
        let mut message = online.message.clone();
        message["headerId"] = 1.into();
        message["connectionState"] = "OFFLINE".into();
        let qos = online.qos;
        tour.counts.insert("connection".to_owned(), 2);
        tour.steps.push(Step {
            after: OFFLINE,
            name: "connection".to_owned(),
            qos,
            message,
        });
    }
    all.into_values().collect()
}
