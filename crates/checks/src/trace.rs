//! Traces for the tests of the checks: a recorded run in a few lines.

use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use serde_json::{Map, Value, json};

use tck_base::clock::{Moment, Stamp};
use tck_base::time::TimeLimits;
use tck_base::verdict::Verdict;
use tck_check::{Check, CheckContext, CheckFinding, Shared, find};
use tck_journal::event::{
    Close, Direction, Ending, Event, LinkFault, Occurrence, Packet, Program, RunHeader, Source, Will,
};
use tck_journal::{Entry, Journal, Payload};
use tck_pack::{Assets, Hooks, Pack, Packs, Role};
use tck_world::{Listen, Listens, Observer, Setting, World};

use super::REGISTRY;

/// A run under construction.
pub(super) struct Trace {
    journal: Journal,
    at: Stamp,
    next_header: u64,
    /// Arguments of the check.
    pub with: Map<String, Value>,
    /// Name of the topic under which a name is configured otherwise than usual.
    pub prefix: String,
    /// The serial number of the vehicle in its topics.
    pub serial: String,
    role: Role,
    /// The protocol version, if it is not that of the other traces.
    version: Option<&'static str>,
}

/// What came out: requirement, verdict and message of each finding, and whether anything was judged.
pub(super) struct Outcome {
    pub findings: Vec<CheckFinding>,
    pub judged: usize,
}

impl Outcome {
    /// Requirement ids with the verdict where it departs from the mood, in order: `HDR-02`, `HDR-03 warning`.
    pub fn summary(&self) -> Vec<String> {
        self.findings
            .iter()
            .map(|finding| {
                let id = finding.requirement.as_ref().map_or("-", |id| id.as_str());
                match finding.verdict {
                    None => id.to_owned(),
                    Some(verdict) => format!("{id} {verdict}"),
                }
            })
            .collect()
    }
}

fn payload(value: &Value) -> Payload {
    Payload::keep(bytes::Bytes::from(value.to_string().into_bytes()))
}

/// Lays `over` over `base`, member by member.
pub(super) fn merged(mut base: Value, over: &Value) -> Value {
    json_patch::merge(&mut base, over);
    base
}

impl Trace {
    /// A run seen by a subscriber.
    pub fn subscriber() -> Self {
        Self::new("subscriber", Role::Agv)
    }

    /// A run with a master control under test, seen by a subscriber.
    pub fn master_control() -> Self {
        Self::new("subscriber", Role::MasterControl)
    }

    /// A run with a master control under test that speaks this version, seen by a subscriber.
    pub fn master_control_of(version: &'static str) -> Self {
        let mut trace = Self::master_control();
        trace.version = Some(version);
        trace.prefix = format!("vda5050/v{}/acme/7", trace.pack().version.major);
        trace
    }

    /// A run of this version, seen by a subscriber.
    pub fn subscriber_of(version: &'static str) -> Self {
        let mut trace = Self::subscriber();
        trace.version = Some(version);
        trace.prefix = format!("vda5050/v{}/acme/7", trace.pack().version.major);
        trace
    }

    /// The protocol version of the trace.
    fn pack(&self) -> Arc<Pack> {
        match self.version {
            Some(version) => Arc::clone(PACKS.get(version).unwrap()),
            None => pack(),
        }
    }

    /// A run with a master control under test, seen at the tap.
    pub fn master_control_at_tap() -> Self {
        Self::new("tap", Role::MasterControl)
    }

    /// A run seen at the tap.
    pub fn tap() -> Self {
        Self::new("tap", Role::Agv)
    }

    fn new(vantage: &str, role: Role) -> Self {
        let utc: jiff::Timestamp = "2026-01-01T12:00:00Z".parse().unwrap();
        let mut trace = Self {
            journal: Journal::new(),
            at: Stamp {
                moment: Moment::START,
                utc,
            },
            next_header: 0,
            with: Map::new(),
            prefix: format!("uagv/v{}/acme/7", pack().version.major),
            serial: "7".to_owned(),
            role,
            version: None,
        };
        let header = RunHeader {
            vantage: vantage.to_owned(),
            role: role.word().to_owned(),
            ..RunHeader::default()
        };
        trace.add(
            Source::Harness,
            None,
            Event::RunBegun {
                header: Box::new(header),
            },
        );
        trace
    }

    pub fn add(&mut self, source: Source, direction: Option<Direction>, event: Event) -> &mut Self {
        self.journal.append(Occurrence {
            at: self.at,
            source,
            direction,
            event,
        });
        self
    }

    pub fn topic(&self, name: &str) -> String {
        format!("{}/{name}", self.prefix)
    }

    /// The vehicle an entry belongs to, by its place in the fleet, and the name of its topic.
    fn place(&self, entry: &Entry) -> Option<(usize, String)> {
        let (Event::Packet {
            packet: Packet::Publish { topic, .. },
            ..
        }
        | Event::Message { topic, .. }
        | Event::Sent { topic, .. }) = entry.event()
        else {
            return None;
        };
        let mut levels = topic.rsplit('/');
        let name = levels.next()?.to_owned();
        Some((usize::from(levels.next()? != self.serial), name))
    }

    /// Lets time pass.
    pub fn wait(&mut self, seconds: f64) -> &mut Self {
        self.at = self.at.after(Duration::from_secs_f64(seconds));
        self
    }

    /// A full header with the next headerId.
    pub fn header(&mut self) -> Value {
        self.next_header += 1;
        json!({
            "headerId": self.next_header,
            "timestamp": self.at.utc.strftime("%Y-%m-%dT%H:%M:%S.%2fZ").to_string(),
            "version": format!("{}.{}.0", self.pack().version.major, self.pack().version.minor),
            "manufacturer": "acme",
            "serialNumber": "7",
        })
    }

    /// A complete state of an idle vehicle, changed by `over`, is delivered.
    pub fn state(&mut self, over: &Value) -> &mut Self {
        let state = merged(self.header(), &idle());
        let state = merged(state, over);
        self.message("state", &state)
    }

    /// A message is delivered live.
    pub fn message(&mut self, name: &str, value: &Value) -> &mut Self {
        self.bytes(name, value.to_string().as_bytes())
    }

    /// Bytes are delivered live.
    pub fn bytes(&mut self, name: &str, bytes: &[u8]) -> &mut Self {
        let event = Event::Message {
            topic: self.topic(name),
            qos: u8::from(name == "connection"),
            retain: false,
            dup: false,
            payload: Payload::keep(bytes::Bytes::copy_from_slice(bytes)),
        };
        self.add(Source::Link, Some(Direction::FromDevice), event)
    }

    /// A connection message with a full header.
    pub fn connection(&mut self, state: &str) -> &mut Self {
        let message = merged(self.header(), &json!({ "connectionState": state }));
        self.message("connection", &message)
    }

    /// The harness sends a message.
    pub fn sent(&mut self, name: &str, value: &Value) -> &mut Self {
        let event = Event::Sent {
            topic: self.topic(name),
            qos: 0,
            retain: false,
            payload: payload(value),
        };
        self.add(Source::Harness, Some(Direction::ToDevice), event)
    }

    /// The mock vehicle publishes a state, changed by `over`.
    pub fn shows(&mut self, over: &Value) -> &mut Self {
        let state = merged(self.header(), &idle());
        let state = merged(state, over);
        self.sent("state", &state)
    }

    /// The master control sends an order or instant actions, with a full header.
    pub fn commands(&mut self, name: &str, message: &Value) -> &mut Self {
        let message = merged(self.header(), message);
        self.message(name, &message)
    }

    /// The master control sends something to another vehicle.
    pub fn other_is_commanded(&mut self, name: &str, message: &Value) -> &mut Self {
        let own = std::mem::replace(&mut self.prefix, "vda5050/v3/acme/8".to_owned());
        self.commands(name, message);
        self.prefix = own;
        self
    }

    /// The harness does something to its mock vehicle.
    pub fn vehicle(&mut self, what: &str) -> &mut Self {
        let event = Event::Vehicle {
            vehicle: 0,
            what: what.to_owned(),
            with: json!({}),
        };
        self.add(Source::Harness, None, event)
    }

    /// The harness sends an instant action.
    pub fn instant(&mut self, action: &str, id: &str, parameters: &Value) -> &mut Self {
        self.sent(
            "instantActions",
            &json!({ "actions": [{ "actionType": action, "actionId": id, "blockingType": "HARD", "actionParameters": parameters }] }),
        )
    }

    /// The device opens connection `number` and is accepted.
    pub fn connect(&mut self, number: u64, will: Option<Will>, keep_alive: u16, level: u8) -> &mut Self {
        self.asks(number, will, keep_alive, level).accepted(number)
    }

    /// The device opens connection `number`, and has not been answered yet.
    pub fn asks(&mut self, number: u64, will: Option<Will>, keep_alive: u16, level: u8) -> &mut Self {
        let event = Event::Opened {
            connection: number,
            peer: "peer".into(),
        };
        self.add(Source::Tap, None, event);
        let connect = Packet::Connect {
            level,
            client_id: "agv".into(),
            keep_alive,
            clean_session: true,
            username: None,
            has_password: false,
            will,
        };
        self.packet(number, Direction::FromDevice, connect)
    }

    /// The broker accepts connection `number`.
    pub fn accepted(&mut self, number: u64) -> &mut Self {
        let accepted = Packet::Connack {
            code: 0,
            session_present: false,
        };
        self.packet(number, Direction::ToDevice, accepted)
    }

    /// A will as it should be.
    pub fn will(&mut self) -> Will {
        let message = merged(self.header(), &json!({ "connectionState": "CONNECTIONBROKEN" }));
        self.next_header = 0;
        Will {
            topic: self.topic("connection"),
            payload: payload(&message),
            qos: 1,
            retain: true,
        }
    }

    /// The usual connection of a good device.
    pub fn connected(&mut self, number: u64) -> &mut Self {
        let will = self.will();
        self.connect(number, Some(will), 15, 4)
    }

    pub fn packet(&mut self, connection: u64, direction: Direction, packet: Packet) -> &mut Self {
        self.add(Source::Tap, Some(direction), Event::Packet { connection, packet })
    }

    /// The device publishes something, as seen at the tap.
    pub fn publish(&mut self, connection: u64, name: &str, qos: u8, retain: bool, value: &Value) -> &mut Self {
        let packet = Packet::Publish {
            topic: self.topic(name),
            qos,
            retain,
            dup: false,
            packet_id: (qos > 0).then_some(1),
            payload: payload(value),
        };
        self.packet(connection, Direction::FromDevice, packet)
    }

    /// The connection ends.
    pub fn closed(&mut self, connection: u64) -> &mut Self {
        let event = Event::Closed {
            connection,
            how: Close::DeviceFin,
        };
        self.add(Source::Tap, None, event)
    }

    pub fn fault(&mut self, fault: LinkFault) -> &mut Self {
        self.add(Source::Harness, None, Event::Fault { fault })
    }

    /// The harness notices that it was late.
    pub fn late(&mut self, seconds: f64) -> &mut Self {
        let micros = u64::try_from(std::time::Duration::from_secs_f64(seconds).as_micros()).expect("a short time");
        let of = "timer".to_owned();
        self.add(Source::Harness, None, Event::Lag { micros, of })
    }

    /// The program that the run has started ends.
    pub fn program_ends(&mut self) -> &mut Self {
        let program = Program::Ended {
            how: Ending::Signal(9),
            words: String::new(),
        };
        self.add(Source::Harness, None, Event::Program { program })
    }

    pub fn hook(&mut self) -> &mut Self {
        let event = Event::Hook {
            hook: "power-cycle".into(),
            ok: true,
            detail: String::new(),
            vehicle: None,
        };
        self.add(Source::Operator, None, event)
    }

    /// Runs a check over everything recorded.
    pub fn judge(&self, name: &str) -> Outcome {
        let pack = self.pack();
        let names = pack.topics().iter().map(|topic| topic.name.to_string());
        let topics: BTreeMap<String, String> = names.map(|name| (name.clone(), self.topic(&name))).collect();
        let Value::Object(bindings) =
            json!({ "time": { "react": 31_000, "statePeriod": 31_000, "slow": 5_000, "notice": 1_000, "settle": 0 } })
        else {
            unreachable!()
        };
        let time = TimeLimits::of_bindings(&bindings);
        let setting = Setting {
            pack: &pack,
            topics: &topics,
            role: self.role,
            identity: ("acme", &self.serial),
            bindings: &bindings,
            time: &time,
            hooks: &HOOKS,
        };
        let check = find(REGISTRY, name).expect("known check");
        let outcome = self.outcome(check, check.listens, setting);
        let shown_all = self.outcome(check, &[Listen::Everything], setting);
        assert_eq!(
            outcome.findings, shown_all.findings,
            "{name} misses what it does not listen to"
        );
        assert_eq!(
            outcome.judged, shown_all.judged,
            "{name} misses what it does not listen to"
        );
        for finding in &outcome.findings {
            if let Some(id) = &finding.requirement {
                assert!(check.decides.contains(&id.as_str()), "{name} does not declare {id}");
                assert_ne!(finding.verdict, Some(Verdict::Pass));
            }
        }
        outcome
    }

    /// What comes out where a check is shown what is listened to.
    fn outcome(&self, check: &Check, listens: &[Listen], setting: Setting<'_>) -> Outcome {
        let fleet = Rc::default();
        let (mut world, shared) = (World::of_fleet(&fleet), Shared::default());
        world.reads(check.reads);
        let mut observer = Observer::new(setting.topics, setting.pack, setting.role);
        let listens = Listens::to(listens);
        let mut running = (check.start)(&self.context(setting, &world, &shared));
        let mut findings = Vec::new();
        let mut judged = 0;
        for entry in self.journal.entries() {
            let entry = &entry;
            match self.place(entry) {
                Some((vehicle, name)) => fleet.borrow_mut().note(entry, vehicle, &name, setting.pack.names()),
                None => fleet.borrow_mut().link(entry),
            }
            let record = observer.see(entry);
            world.learn(&record, &setting);
            if listens.hears(record.kind()) {
                judged += usize::from(running.observe(&record, &self.context(setting, &world, &shared), &mut findings));
            }
        }
        let end = observer.end(self.at.moment);
        running.finish(&end, &self.context(setting, &world, &shared), &mut findings);
        Outcome { findings, judged }
    }

    fn context<'c>(&'c self, setting: Setting<'c>, world: &'c World, shared: &'c Shared) -> CheckContext<'c> {
        CheckContext {
            setting,
            with: &self.with,
            world,
            shared,
        }
    }
}

static HOOKS: LazyLock<Hooks> = LazyLock::new(|| Hooks::load(&Assets::of_source_tree().unwrap()).unwrap());

static PACKS: LazyLock<Packs> = LazyLock::new(|| Packs::load(&Assets::of_source_tree().unwrap()).unwrap());

/// The protocol version that most checks are tested with.
pub(super) fn pack() -> Arc<Pack> {
    Arc::clone(PACKS.latest())
}

/// A state without header of a vehicle that stands idle on node n1.
pub(super) fn idle() -> Value {
    json!({
        "orderId": "", "orderUpdateId": 0, "lastNodeId": "n1", "lastNodeSequenceId": 0,
        "nodeStates": [], "edgeStates": [], "driving": false, "actionStates": [],
        "agvPosition": { "positionInitialized": true, "x": 1.0, "y": 2.0, "theta": 0.5, "mapId": "hall" },
        "batteryState": { "batteryCharge": 80.0, "charging": false },
        "operatingMode": "AUTOMATIC", "errors": [],
        "safetyState": { "eStop": "NONE", "fieldViolation": false },
    })
}
