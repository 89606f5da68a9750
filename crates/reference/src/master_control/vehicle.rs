//! One vehicle as the master control sees it, and what it is to do: its last state (section 6.10), whether it is
//! connected (6.14), its factsheet (6.15), the order under way and the transports that wait.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use serde_json::Value;

use tck_base::clock::Moment;

use super::config::{SiteEdge, SiteMap, SiteNode, VehicleConfig};
use super::seen::{Factsheet, State};
use super::zones::WantedSet;

/// More transports than this do not wait for one vehicle.
pub(super) const MAX_QUEUE: usize = 200;
/// More instant actions than this do not wait for one vehicle.
pub(super) const MAX_INSTANT: usize = 100;

/// State of the connection of a vehicle, by its connection topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Presence {
    #[default]
    Unknown,
    Online,
    Away,
    /// It is connected, sleeps, and heeds nothing but stopHibernation.
    Asleep,
}

/// A transport somebody asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Transport {
    /// Node where a load is picked.
    pub(crate) from: Option<String>,
    /// Node where it ends.
    pub(crate) to: String,
    pub(crate) load_type: Option<String>,
    /// An action to be performed at the destination.
    pub(crate) action: Option<String>,
    pub(crate) parameters: Value,
    /// The load is picked already.
    pub(crate) loaded: bool,
    /// Number of times it was begun.
    pub(crate) begun: u32,
    /// It is the rest of the transport before it, and falls with it.
    pub(crate) follows: bool,
}

/// A node of the way that is driven.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Stop {
    pub(crate) id: String,
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) theta: Option<f64>,
    pub(crate) map_id: String,
    pub(crate) deviation_xy: Option<f64>,
    pub(crate) deviation_theta: Option<f64>,
    pub(crate) actions: Vec<Value>,
}

impl From<&SiteNode> for Stop {
    fn from(node: &SiteNode) -> Self {
        Self {
            id: node.id.clone(),
            x: node.x,
            y: node.y,
            theta: node.theta,
            map_id: node.map_id.clone(),
            deviation_xy: node.deviation_xy,
            deviation_theta: node.deviation_theta,
            actions: Vec::new(),
        }
    }
}

/// An edge of the way that is driven.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Leg {
    pub(crate) id: String,
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) max_speed: Option<f64>,
    pub(crate) max_height: Option<f64>,
    pub(crate) min_height: Option<f64>,
    pub(crate) direction: Option<String>,
    pub(crate) corridor: Option<(f64, f64)>,
    pub(crate) actions: Vec<Value>,
}

impl From<&SiteEdge> for Leg {
    fn from(edge: &SiteEdge) -> Self {
        Self {
            id: edge.id.clone(),
            from: edge.from.clone(),
            to: edge.to.clone(),
            max_speed: edge.max_speed,
            max_height: edge.max_height,
            min_height: edge.min_height,
            direction: edge.direction.clone(),
            corridor: edge.corridor,
            actions: Vec::new(),
        }
    }
}

/// The order the vehicle drives.
#[derive(Clone, Debug, Default)]
pub(crate) struct Running {
    pub(crate) transport: Transport,
    pub(crate) id: String,
    pub(crate) update_id: u32,
    /// All nodes of the way, from the first one on; the sequenceId is twice the index.
    pub(crate) stops: Vec<Stop>,
    /// The edge behind the node of the same index.
    pub(crate) legs: Vec<Leg>,
    /// Number of nodes released.
    pub(crate) released: usize,
    /// The message sent last, without header.
    pub(crate) message: Value,
    pub(crate) sent_at: Moment,
    pub(crate) resends: u32,
    /// A state has shown the message sent last.
    pub(crate) confirmed: bool,
    /// A state has shown the order.
    pub(crate) accepted: bool,
    /// The vehicle does not take updates of this order.
    pub(crate) refused: bool,
    /// The vehicle has given it up: it was in MANUAL with it.
    pub(crate) cleared: bool,
    /// The way behind the base has changed and is not sent yet.
    pub(crate) changed: bool,
    /// actionId of the running waitForTrigger, and since when.
    pub(crate) waits: Option<(String, Moment)>,
}

impl Running {
    /// All actions of the way so far released.
    pub(crate) fn actions(&self) -> impl Iterator<Item = &Value> {
        let nodes = self.stops.iter().take(self.released).flat_map(|stop| &stop.actions);
        let legs = self.legs.iter().take(self.released.saturating_sub(1));
        nodes.chain(legs.flat_map(|leg| &leg.actions))
    }

    /// Their actionIds.
    pub(crate) fn action_ids(&self) -> impl Iterator<Item = &str> {
        self.actions().filter_map(|action| action["actionId"].as_str())
    }

    /// Index of the node the vehicle has reached.
    pub(crate) fn reached(&self, state: Option<&State>) -> usize {
        let sequence = state.filter(|state| state.order_id == self.id);
        // A vehicle that has just taken the order over may still name the last node of the one before.
        let sequence = sequence.map_or(0, |state| state.last_node_sequence_id.min(state.before_next_node()));
        let place = usize::try_from(sequence).unwrap_or(usize::MAX);
        (place / 2).min(self.stops.len().saturating_sub(1))
    }

    /// Whether every node of the way is released.
    pub(crate) fn is_whole(&self) -> bool {
        self.released >= self.stops.len()
    }

    /// Whether the message sent last is an update.
    pub(crate) fn is_updated(&self) -> bool {
        let first = self.message.pointer("/nodes/0/sequenceId").and_then(Value::as_u64);
        first.is_some_and(|first| first > 0)
    }
}

/// A cancellation under way.
#[derive(Clone, Debug)]
pub(crate) struct Cancel {
    pub(crate) action_id: String,
    /// Transport that is done instead.
    pub(crate) then: Option<Transport>,
}

/// An instant action: waiting to be sent, or sent and watched.
#[derive(Clone, Debug)]
pub(crate) struct Instant {
    pub(crate) action: Value,
    pub(crate) sent_at: Option<Moment>,
    pub(crate) resends: u32,
}

impl Instant {
    pub(crate) fn id(&self) -> &str {
        self.action.get("actionId").and_then(Value::as_str).unwrap_or_default()
    }

    pub(crate) fn kind(&self) -> &str {
        let kind = self.action.get("actionType").and_then(Value::as_str);
        kind.unwrap_or_default()
    }
}

/// Stage of the roll-out of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Download,
    Delete,
    DownloadAgain,
}

/// The roll-out of a map.
#[derive(Clone, Debug)]
pub(crate) struct MapJob {
    pub(crate) map: SiteMap,
    pub(crate) stage: Stage,
    pub(crate) action_id: String,
}

/// A vehicle.
#[derive(Clone, Debug, Default)]
pub(crate) struct Vehicle {
    pub(crate) config: VehicleConfig,
    pub(crate) presence: Presence,
    pub(crate) state: Option<State>,
    pub(crate) state_at: Moment,
    pub(crate) factsheet: Option<Factsheet>,
    /// Since when a factsheet is missed, and whether it was asked for.
    pub(crate) missed: Option<(Moment, bool)>,
    pub(crate) queue: VecDeque<Transport>,
    pub(crate) running: Option<Running>,
    pub(crate) cancel: Option<Cancel>,
    pub(crate) instants: VecDeque<Instant>,
    pub(crate) jobs: Vec<MapJob>,
    /// Maps that were asked to be enabled for an order, with the actionId.
    pub(crate) enabling: BTreeMap<String, String>,
    /// Maps that were rolled out because an order needs them.
    pub(crate) fetched: BTreeSet<String>,
    /// Sets of zones it shall have, one for each map.
    pub(crate) zone_sets: Vec<WantedSet>,
    /// Ids of sets it had, which are to be deleted.
    pub(crate) old_zone_sets: Vec<String>,
    /// Edges it may not use, by start and end.
    pub(crate) blocked: BTreeSet<(String, String)>,
    pub(crate) header_ids: BTreeMap<&'static str, u32>,
    pub(crate) last_order_at: Option<Moment>,
    /// When it wants to be looked at next.
    pub(crate) wake: Option<Moment>,
}

impl From<VehicleConfig> for Vehicle {
    fn from(config: VehicleConfig) -> Self {
        Self {
            config,
            ..Self::default()
        }
    }
}

impl Vehicle {
    /// Asks to be looked at again then.
    pub(crate) fn at(&mut self, moment: Moment) {
        self.wake = Some(self.wake.map_or(moment, |wake| wake.min(moment)));
    }

    /// The full topic of a topic name.
    pub(crate) fn topic(&self, name: &str) -> Option<&str> {
        self.config.topics.get(name).map(String::as_str)
    }

    /// Whether its last state was paused.
    pub(crate) fn is_paused(&self) -> bool {
        self.state.as_ref().is_some_and(State::is_paused)
    }

    /// Nothing could be seen for a while, so what is awaited has its whole time again.
    pub(crate) fn give_time(&mut self, now: Moment) {
        if let Some(running) = &mut self.running {
            running.sent_at = now;
        }
        for instant in &mut self.instants {
            if let Some(sent_at) = &mut instant.sent_at {
                *sent_at = now;
            }
        }
    }
}
