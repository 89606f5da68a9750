//! What is worth knowing of a vehicle at present.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::Notice;
use super::alarm::{Alarm, Alarmed, Alarms, cut};
use bytes::Bytes;
use tck_audit::result::FindingResult;
use tck_audit::{Address, Found};
use tck_base::clock::{Moment, Stamp};
use tck_base::verdict::Verdict;
use tck_pack::{Packs, Role};
use tck_view::{ActionView, ErrorView, Member, MessageView, StateView, Text, Topic};
use tck_world::rest::open_actions;

/// Upper ends of the buckets of reaction times, in seconds.
pub const BUCKETS: [f64; 9] = [0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0];
/// How many commands may wait for the state that shows them.
const WAITING: usize = 32;
/// How many kinds of findings are kept.
const KINDS: usize = 256;
/// The largest message that is kept beside a finding.
const LARGEST: usize = 16 << 10;
/// The monitor that judges a silence when it is over.
pub(crate) const PERIOD: &str = "state/period";
/// Its requirement.
const SILENCE: &str = "STATE-02";
/// What finds it before.
const WATCH: &str = "watch/silence";

/// How long a vehicle takes until a state shows a command.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reactions {
    /// How many there were.
    pub count: u64,
    /// Their sum in seconds.
    pub sum: f64,
    /// How many were not above each end of [`BUCKETS`].
    pub up_to: [u64; BUCKETS.len()],
}

impl Reactions {
    fn add(&mut self, time: Duration) {
        let seconds = time.as_secs_f64();
        self.count += 1;
        self.sum += seconds;
        for (count, end) in self.up_to.iter_mut().zip(BUCKETS) {
            *count += u64::from(seconds <= end);
        }
    }
}

/// Findings of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Kind {
    /// `agv` or `master-control`.
    pub role: String,
    /// Id of the monitor.
    pub monitor: String,
    /// The requirement.
    pub requirement: String,
    /// The verdict.
    pub verdict: Verdict,
    /// How often.
    pub count: u64,
    /// When it was found first.
    pub first: String,
    /// When it was found last.
    pub last: String,
    /// What is wrong, of the last one.
    pub text: String,
    /// Topic and payload of the last one, if it is not too large.
    pub message: Option<(String, Bytes)>,
}

impl Kind {
    /// As the result of an audit has it; no message shows it.
    pub(crate) fn as_result(&self) -> FindingResult {
        FindingResult {
            monitor: self.monitor.clone(),
            requirement: self.requirement.clone(),
            verdict: self.verdict,
            count: 1,
            message: 0,
            recording: None,
            line: None,
            first: self.last.clone(),
            last: self.last.clone(),
            text: self.text.clone(),
            shown: None,
            interpretation: None,
        }
    }
}

/// A command that no state shows yet.
#[derive(Clone, Debug)]
enum Command {
    Order { id: String, update: u64 },
    Actions(Vec<String>),
}

/// What is worth knowing of a vehicle at present.
#[derive(Clone, Debug)]
pub struct VehicleStatus {
    /// Manufacturer.
    pub manufacturer: String,
    /// Serial number.
    pub serial_number: String,
    /// Protocol version it names.
    pub version: Option<String>,
    /// Connection state.
    pub connection: Option<String>,
    /// Operating mode.
    pub mode: Option<String>,
    /// Order and update of the last state.
    pub order: Option<(String, u64)>,
    /// Nodes of the base and of the horizon that are left.
    pub nodes: (usize, usize),
    /// The last node.
    pub last_node: Option<String>,
    /// Where it says that it is, in metres, vouched for or not.
    pub spot: Option<(f64, f64)>,
    /// The map it says it is on.
    pub map: Option<String>,
    /// Its heading in radians, where it knows its position.
    pub heading: Option<f64>,
    /// Whether it says that it drives.
    pub driving: bool,
    /// Actions that are not over.
    pub actions: usize,
    /// Charge of the battery in percent.
    pub charge: Option<f64>,
    /// Errors of the last state: level and type.
    pub errors: Vec<(String, String)>,
    /// The last state.
    pub state: Option<Bytes>,
    /// When it was heard last.
    pub heard: Option<Stamp>,
    /// Messages by topic name.
    pub messages: BTreeMap<String, u64>,
    /// By topic of the command: how fast it is shown.
    pub reactions: BTreeMap<&'static str, Reactions>,
    /// What was found, by kind.
    pub kinds: BTreeMap<(String, String, String, Verdict), Kind>,
    pub(crate) alarms: Alarms,
    waiting: VecDeque<(Moment, Command)>,
}

impl VehicleStatus {
    /// Nothing is known yet.
    #[must_use]
    pub fn new(address: &Address) -> Self {
        Self {
            manufacturer: address.manufacturer.clone(),
            serial_number: address.serial_number.clone(),
            version: None,
            connection: None,
            mode: None,
            order: None,
            nodes: (0, 0),
            last_node: None,
            spot: None,
            map: None,
            heading: None,
            driving: false,
            actions: 0,
            charge: None,
            errors: Vec::new(),
            state: None,
            heard: None,
            messages: BTreeMap::new(),
            reactions: BTreeMap::new(),
            kinds: BTreeMap::new(),
            alarms: Alarms::default(),
            waiting: VecDeque::new(),
        }
    }

    /// Takes in a message of its topic of this name; `stored` ones tell of the past. Gives what somebody has to be told. The
    /// message is read as that of the version that the vehicle names.
    pub fn take(&mut self, name: &str, at: Stamp, stored: bool, payload: &Bytes, packs: &Packs) -> Vec<Alarm> {
        *self.messages.entry(name.to_owned()).or_default() += 1;
        self.heard = Some(at);
        let mut alarms = Vec::new();
        let topic = Topic::of_name(name);
        let read = |version: Option<&str>| {
            let pack = version.and_then(|version| packs.get(version));
            let names = pack.unwrap_or_else(|| packs.latest()).names();
            MessageView::of_slice(topic, payload, names).ok()
        };
        let Some(mut message) = read(self.version.as_deref()) else {
            return alarms;
        };
        let named = short(&message.header().version).filter(|_| !topic.is_to_vehicle());
        if named.is_some() && named != self.version {
            self.version = named;
            // Its members may have other names than those that it was read by.
            message = read(self.version.as_deref()).unwrap_or(message);
        }
        match &message {
            MessageView::Order(order) if !stored => {
                if let (Some(id), Some(update)) = (order.order_id.text(), order.order_update_id.whole()) {
                    let id = id.to_owned();
                    self.wait(at.moment, Command::Order { id, update });
                }
            }
            MessageView::InstantActions(actions) if !stored => {
                let id = |action: &ActionView| action.action_id.text().map(str::to_owned);
                let ids = actions.commanded().filter_map(id);
                self.wait(at.moment, Command::Actions(ids.collect()));
            }
            MessageView::Connection(said) => {
                self.connection = short(&said.connection_state);
                alarms.extend(self.alarms.connection(said, at, stored));
            }
            MessageView::State(state) => {
                self.state(state, payload);
                if !stored {
                    self.shown(state, at.moment);
                    alarms = self.alarms.state(state, at);
                }
            }
            _ => {}
        }
        alarms
    }

    /// The last state that came live: a vehicle that is only spoken to, or of which a broker has kept something, is not heard.
    #[must_use]
    pub fn last_state(&self) -> Option<Stamp> {
        self.alarms.last_state()
    }

    /// Whether its connection topic says ONLINE, and no state comes.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.alarms.is_silent()
    }

    /// The finding that it has fallen silent: a warning, because it may have been cut off and its broker has not noticed yet.
    /// The next state shows it, and the monitor judges it then. None when no state ever came, since a broker may keep them to
    /// itself.
    pub(crate) fn silence(&mut self, at: jiff::Timestamp, silent: Duration) -> Option<Found> {
        self.alarms.last_state()?;
        let before = self.silences().map_or(0, |kind| kind.count);
        let found = Found {
            manufacturer: self.manufacturer.clone(),
            serial_number: self.serial_number.clone(),
            role: Role::Agv.word().to_owned(),
            monitor: WATCH.to_owned(),
            requirement: SILENCE.to_owned(),
            verdict: Verdict::Warning,
            count: before + 1,
            before,
            message: 0,
            at: format!("{at:.3}"),
            text: format!(
                "no state for {:.1} s so far, and its connection topic says ONLINE",
                silent.as_secs_f64()
            ),
            interpretation: None,
        };
        self.note(&Notice {
            found: found.clone(),
            message: None,
        });
        Some(found)
    }

    /// Keeps a finding.
    pub fn note(&mut self, notice: &Notice) {
        let found = &notice.found;
        if !matches!(found.verdict, Verdict::Fail | Verdict::Warning) {
            return;
        }
        let key = (
            found.role.clone(),
            found.monitor.clone(),
            found.requirement.clone(),
            found.verdict,
        );
        if found.monitor == PERIOD && found.verdict == Verdict::Fail {
            // What was a silence without an end is this one.
            self.kinds.retain(|_, kind| kind.monitor != WATCH);
        }
        if !self.kinds.contains_key(&key) && self.kinds.len() >= KINDS {
            return;
        }
        let kind = self.kinds.entry(key).or_insert_with(|| Kind {
            role: found.role.clone(),
            monitor: found.monitor.clone(),
            requirement: found.requirement.clone(),
            verdict: found.verdict,
            count: 0,
            first: found.at.clone(),
            last: String::new(),
            text: String::new(),
            message: None,
        });
        kind.count += found.count - found.before;
        kind.last.clone_from(&found.at);
        kind.text.clone_from(&found.text);
        let is_small = |(_, payload): &&(String, Bytes)| payload.len() <= LARGEST;
        // A copy, so that the rest of what came with it is not kept as well.
        let copied = |(topic, payload): &(String, Bytes)| (topic.clone(), Bytes::copy_from_slice(payload));
        kind.message = notice.message.as_ref().filter(is_small).map(copied);
    }

    /// The silences that no state has ended.
    pub(crate) fn silences(&self) -> Option<&Kind> {
        self.kinds.values().find(|kind| kind.monitor == WATCH)
    }

    /// An alarm of this vehicle.
    pub(crate) fn alarmed(&self, at: jiff::Timestamp, alarm: Alarm) -> Alarmed {
        Alarmed {
            manufacturer: self.manufacturer.clone(),
            serial_number: self.serial_number.clone(),
            at,
            alarm,
        }
    }

    /// How many kinds of this verdict were found.
    #[must_use]
    pub fn found(&self, verdict: Verdict) -> usize {
        self.kinds.values().filter(|kind| kind.verdict == verdict).count()
    }

    fn wait(&mut self, since: Moment, command: Command) {
        if self.waiting.len() == WAITING {
            self.waiting.pop_front();
        }
        self.waiting.push_back((since, command));
    }

    /// What a state shows is answered.
    fn shown(&mut self, state: &StateView, now: Moment) {
        if self.waiting.is_empty() {
            return;
        }
        let update = state.order_update_id.whole();
        let actions = state.all_action_states();
        let ids: Vec<&str> = actions.filter_map(|action| action.action_id.text()).collect();
        for (since, command) in std::mem::take(&mut self.waiting) {
            let topic = match &command {
                Command::Order { id, update: wanted } => {
                    let is_shown = state.order_id.is(id) && update.is_some_and(|update| update >= *wanted);
                    is_shown.then_some("order")
                }
                Command::Actions(wanted) => wanted
                    .iter()
                    .all(|wanted| ids.contains(&wanted.as_str()))
                    .then_some("instantActions"),
            };
            match topic {
                Some(topic) => self.reactions.entry(topic).or_default().add(now.since(since)),
                None => self.waiting.push_back((since, command)),
            }
        }
    }

    fn state(&mut self, state: &StateView, payload: &Bytes) {
        self.state = (payload.len() <= LARGEST).then(|| payload.clone());
        self.mode = short(&state.operating_mode).or(self.mode.take());
        let order = state.order_id.text().filter(|id| !id.is_empty());
        let update = state.order_update_id.whole();
        self.order = order.map(|order| (cut(order), update.unwrap_or_default()));
        let base = state.node_states.iter().filter(|node| !node.released.is(false)).count();
        self.nodes = (base, state.node_states.iter().len() - base);
        self.last_node = short(&state.last_node_id).filter(|id| !id.is_empty());
        let spot = state.spot();
        self.spot = spot.as_ref().map(|spot| (spot.x, spot.y));
        self.map = spot.map(|spot| cut(spot.map_id.as_str())).filter(|map| !map.is_empty());
        self.heading = state.pose().map(|pose| pose.theta);
        self.driving = state.driving.is(true);
        self.actions = open_actions(state).count();
        let battery = state.battery_state.there();
        self.charge = battery.and_then(|battery| battery.battery_charge.float());
        let named = |error: &ErrorView| (cut(error.error_level.or_empty()), cut(error.error_type.or_empty()));
        self.errors = state.errors.iter().take(16).map(named).collect();
    }
}

fn short(member: &Member<Text>) -> Option<String> {
    member.text().map(cut)
}
