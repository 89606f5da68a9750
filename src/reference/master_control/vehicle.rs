//! One vehicle as the master control sees it, and what it is to do.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use serde_json::Value;

use crate::clock::Moment;

use super::config::VehicleConfig;
use super::seen::{Factsheet, Position, State};

/// More transports than this do not wait for one vehicle.
pub(super) const MAX_QUEUE: usize = 200;
/// More instant actions than this do not wait for one vehicle.
pub(super) const MAX_INSTANT: usize = 100;

/// What the connection topic says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Presence {
    #[default]
    Unknown,
    Online,
    Away,
}

/// A transport somebody asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Transport {
    /// Where a load is picked.
    pub(super) from: Option<String>,
    /// Where it ends.
    pub(super) to: String,
    pub(super) load_type: Option<String>,
    /// An action to be performed at the destination.
    pub(super) action: Option<String>,
    pub(super) parameters: Value,
    /// The load is picked already.
    pub(super) loaded: bool,
    /// How often it was begun.
    pub(super) begun: u32,
    /// The second half of a transport in two orders (`r1-pick-and-drop-apart`).
    pub(super) r1_follows: bool,
    /// Where the vehicle was when it was asked for (`r2-start-planned-too-early`).
    pub(super) r2_asked_at: Option<(String, Option<Position>)>,
    /// It is not begun before (`r4-dispatches-after-two-seconds`).
    pub(super) r4_due: Option<Moment>,
}

/// A node of the way that is driven.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Stop {
    pub(super) id: String,
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) theta: Option<f64>,
    pub(super) map_id: String,
    pub(super) deviation_xy: Option<f64>,
    pub(super) deviation_theta: Option<f64>,
    pub(super) actions: Vec<Value>,
}

/// An edge of the way that is driven.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Leg {
    pub(super) id: String,
    pub(super) from: String,
    pub(super) to: String,
    pub(super) max_speed: Option<f64>,
    pub(super) max_height: Option<f64>,
    pub(super) min_height: Option<f64>,
    pub(super) direction: Option<String>,
    pub(super) corridor: Option<(f64, f64)>,
    pub(super) actions: Vec<Value>,
}

/// The order the vehicle drives.
#[derive(Clone, Debug, Default)]
pub(super) struct Running {
    pub(super) transport: Transport,
    pub(super) id: String,
    pub(super) update_id: u32,
    /// All nodes of the way, from the first one on; the sequenceId is twice the index.
    pub(super) stops: Vec<Stop>,
    /// The edge behind the node of the same index.
    pub(super) legs: Vec<Leg>,
    /// Number of nodes released.
    pub(super) released: usize,
    /// The message sent last, without header.
    pub(super) message: Value,
    pub(super) sent_at: Moment,
    pub(super) resends: u32,
    /// A state has shown the message sent last.
    pub(super) confirmed: bool,
    /// A state has shown the order.
    pub(super) accepted: bool,
    /// The vehicle does not take updates of this order.
    pub(super) refused: bool,
    /// The vehicle has given it up: it was in MANUAL with it.
    pub(super) cleared: bool,
    /// The way behind the base has changed and is not sent yet.
    pub(super) changed: bool,
    /// actionId of the running waitForTrigger, and since when.
    pub(super) waits: Option<(String, Moment)>,
    /// Where the sequenceIds begin (`r1-sequence-continues-over-orders`).
    pub(super) r1_offset: usize,
    /// From which node on sequenceIds are skipped, and how many (`r1-sequence-gap-after-reroute`).
    pub(super) r1_gap: Option<(usize, usize)>,
    /// The way was changed while it was driven.
    pub(super) r1_rerouted: bool,
    /// The horizon was sent again.
    pub(super) r1_again: bool,
    /// The log was asked for.
    pub(super) r1_logged: bool,
    /// Its base was withdrawn.
    pub(super) r2_withdrawn: bool,
    /// Its triggers are not supervised any more.
    pub(super) r2_unsupervised: bool,
    /// Its base is not extended any more (`r3-base-held-after-reconnect`).
    pub(super) r3_held: bool,
    /// The vehicle asks for a new base.
    pub(super) r3_asked: bool,
    /// A request for a new base was answered without one.
    pub(super) r3_answered: bool,
    /// The vehicle was paused with it.
    pub(super) r3_paused: bool,
    /// Its horizon is to be deleted before the new one is sent (`r4-horizon-deleted-first`).
    pub(super) r4_drops_horizon: bool,
    /// Number of nodes the vehicle has to complete before more are sent
    /// (`r4-second-leg-as-update-of-the-completed-order`).
    pub(super) r4_halt: Option<usize>,
    /// A request for a new base was answered (`r5-new-base-request-heard-once`).
    pub(super) r5_asked: bool,
    /// Its horizon is deleted as long as the vehicle is paused (`r5-horizon-deleted-on-pause`).
    pub(super) r5_short: bool,
    /// Index of the last node a state has shown as reached (`r6-lost-state-stops-progress`).
    pub(super) r6_reached: usize,
    /// A node was passed that no state has shown (`r6-lost-state-stops-progress`).
    pub(super) r6_skipped: bool,
    /// The update that waits for minOrderInterval (`r6-queued-update-after-cancel`).
    pub(super) r6_waiting: Option<Value>,
    /// Its horizon was withdrawn once (`r6-horizon-withdrawn-and-given-again`).
    pub(super) r6_withdrawn: bool,
    /// It was called off because of a FATAL error (`r6-cancels-on-fatal`).
    pub(super) r6_fatal: bool,
}

impl Running {
    /// All actions of the way so far released.
    pub(super) fn actions(&self) -> impl Iterator<Item = &Value> {
        let nodes = self.stops.iter().take(self.released).flat_map(|stop| &stop.actions);
        let legs = self.legs.iter().take(self.released.saturating_sub(1));
        nodes.chain(legs.flat_map(|leg| &leg.actions))
    }

    /// Index of the node the vehicle has reached.
    pub(super) fn reached(&self, state: Option<&State>) -> usize {
        let sequence = state.filter(|state| state.order_id == self.id);
        // A vehicle that has just taken the order over may still name the last node of the one before.
        let sequence = sequence.map_or(self.r1_offset, |state| {
            usize::try_from(state.last_node_sequence_id.min(state.before_next_node())).unwrap_or(usize::MAX)
        });
        let place = sequence.saturating_sub(self.r1_offset);
        let place = match self.r1_gap {
            Some((base, skipped)) if place >= (2 * base + skipped) => place - skipped,
            _ => place,
        };
        (place / 2).min(self.stops.len().saturating_sub(1))
    }

    /// The sequenceId of the node (even) or edge (odd) at a place of the way.
    pub(super) fn r1_number(&self, place: usize) -> usize {
        let skipped = match self.r1_gap {
            Some((base, skipped)) if place + 1 >= 2 * base => skipped,
            _ => 0,
        };
        self.r1_offset + place + skipped
    }

    /// What is done at a node.
    pub(super) fn busiest(stops: &[Stop]) -> usize {
        stops.iter().map(|stop| stop.actions.len()).max().unwrap_or_default()
    }

    /// Whether every node of the way is released.
    pub(super) fn is_whole(&self) -> bool {
        self.released >= self.stops.len()
    }
}

/// A cancellation under way.
#[derive(Clone, Debug)]
pub(super) struct Cancel {
    pub(super) action_id: String,
    /// What is to be done instead.
    pub(super) then: Option<Transport>,
}

/// An instant action: waiting to be sent, or sent and watched.
#[derive(Clone, Debug)]
pub(super) struct Instant {
    pub(super) action: Value,
    pub(super) sent_at: Option<Moment>,
    pub(super) resends: u32,
}

impl Instant {
    pub(super) fn id(&self) -> &str {
        self.action.get("actionId").and_then(Value::as_str).unwrap_or_default()
    }

    pub(super) fn kind(&self) -> &str {
        self.action
            .get("actionType")
            .and_then(Value::as_str)
            .unwrap_or_default()
    }
}

/// How far the roll-out of a map is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    Download,
    Delete,
    DownloadAgain,
}

/// The roll-out of a map.
#[derive(Clone, Debug)]
pub(super) struct MapJob {
    pub(super) map: super::config::SiteMap,
    pub(super) stage: Stage,
    pub(super) action_id: String,
}

/// A vehicle.
#[derive(Clone, Debug, Default)]
pub(super) struct Vehicle {
    pub(super) config: VehicleConfig,
    pub(super) presence: Presence,
    /// Timestamp of the connection message seen last (`old-will-ignored` only).
    pub(super) heard: String,
    pub(super) state: Option<State>,
    pub(super) state_at: Moment,
    pub(super) factsheet: Option<Factsheet>,
    /// Since when a factsheet is missed, and whether it was asked for.
    pub(super) missed: Option<(Moment, bool)>,
    pub(super) queue: VecDeque<Transport>,
    pub(super) running: Option<Running>,
    pub(super) cancel: Option<Cancel>,
    pub(super) instants: VecDeque<Instant>,
    pub(super) jobs: Vec<MapJob>,
    /// Maps that were asked to be enabled for an order, with the actionId.
    pub(super) enabling: BTreeMap<String, String>,
    /// Maps that were rolled out because an order needs them.
    pub(super) fetched: BTreeSet<String>,
    /// Edges it may not use, by start and end.
    pub(super) blocked: BTreeSet<(String, String)>,
    pub(super) header_ids: BTreeMap<&'static str, u32>,
    pub(super) last_order_at: Option<Moment>,
    /// When it wants to be looked at next.
    pub(super) wake: Option<Moment>,
    /// It is given no work any more, for something it has said (`…-shunned`).
    pub(super) shunned: bool,
    /// It was ONLINE again since its last errors (`online-is-healthy`).
    pub(super) absolved: bool,
    /// What a faulty master control makes of its messages.
    pub(super) manner: super::odd::Manner,
    /// The node and place where the visualization shows it (`visualization-obeyed`).
    pub(super) shown_at: Option<(String, Position)>,
    /// The order given up last: its message (`refused-order-repeated`, `next-order-starts-elsewhere`).
    pub(super) last_order: Option<Running>,
    /// What is sent again and again, and when the next time (`order-repeated-for-ever`).
    pub(super) repeated: Option<(Value, Moment)>,
    /// The connection of the vehicle was away during the running order.
    pub(super) r1_stale: bool,
    /// A request for a new base was answered.
    pub(super) r1_answered: bool,
    /// Its factsheet was published again.
    pub(super) r1_shown: bool,
    /// Where it was when it was taken over by hand.
    pub(super) r1_before_manual: Option<(String, Option<Position>)>,
    /// The next way may lead over blocked edges.
    pub(super) r1_blind: bool,
    /// The next order does not wait for the end of the old one.
    pub(super) r1_hasty: bool,
    /// The next free sequenceId over all orders.
    pub(super) r1_sequence: usize,
    /// The id and the last update of the order called off last.
    pub(super) r1_kept: Option<(String, u32)>,
    /// The last order was called off.
    pub(super) r1_cancelled: bool,
    /// The visualization shows it moving.
    pub(super) r1_moving: bool,
    /// The highest headerId of its connection messages.
    pub(super) r1_header: u64,
    /// An order is to be called off once it is back.
    pub(super) r1_cancel_due: bool,
    /// Maps it said to have enabled.
    pub(super) r1_enabled: BTreeSet<String>,
    /// It was told where it is.
    pub(super) r1_relocated: bool,
    /// The state after which it was asked for another.
    pub(super) r1_asked: Option<Moment>,
    /// Where the visualization shows it.
    pub(super) r2_seen_at: Option<Position>,
    /// Timestamp of its last state.
    pub(super) r2_state_time: String,
    /// How often its connection broke.
    pub(super) r2_broken: u32,
    /// It has given no state since it is back.
    pub(super) r2_stale: bool,
    /// Its last state gave information.
    pub(super) r2_informed: bool,
    /// Its last state was without a position.
    pub(super) r2_lost: bool,
    /// It is to be resumed once the cancellation has ended.
    pub(super) r2_resume: bool,
    /// How often an order was called off.
    pub(super) r3_cancels: u32,
    /// Where it was when its order was called off.
    pub(super) r3_cancelled_at: Option<Position>,
    /// Where it was before it was told where it is.
    pub(super) r3_before_init: Option<(String, Option<Position>)>,
    /// It was sent to charge.
    pub(super) r3_charged: bool,
    /// The visualization shows it elsewhere than its state.
    pub(super) r3_aside: bool,
    /// headerId of its last state (`r4-drops-states-with-low-header-id`).
    pub(super) r4_state_header: Option<u64>,
    /// It came back during the running order (`r4-whole-order-after-reconnect`).
    pub(super) r4_returned: bool,
    /// When an order is to be called off, and which (`r4-cancels-after-two-seconds`).
    pub(super) r4_cancel_at: Option<(Moment, String)>,
    /// Where its newest visualization shows it (`r4-start-from-visualization`).
    pub(super) r4_shown_at: Option<Position>,
    /// headerId of its last connection message (`r4-old-will-ignored`).
    pub(super) r4_connection_header: Option<u64>,
    /// It came back during the running order (`r5-whole-order-again-after-reconnect`).
    pub(super) r5_whole: bool,
    /// Its order was struck while it was paused (`r5-cancel-of-paused-vehicle-only-internal`).
    pub(super) r5_dropped: bool,
    /// The actionId of its last startPause (`r5-stop-pause-with-id-of-start-pause`).
    pub(super) r5_pause_id: Option<String>,
    /// Its maps were checked once (`r5-map-check-only-at-first-order`).
    pub(super) r5_maps_checked: bool,
    /// It was said to be gone since its last state (`r5-publishes-connection-for-silent-vehicle`).
    pub(super) r5_declared: bool,
    /// Its order is to be repeated (`r5-repeats-order-after-online`).
    pub(super) r5_repeat: bool,
    /// No order is begun before, after one was called off (`r5-pause-after-cancel-before-next-order`).
    pub(super) r5_rest: Option<Moment>,
    /// What a forgetful master control keeps of it.
    pub(super) slips: super::slips::Slips,
    /// It has not driven since it came back (`r5-stops-pause-after-reconnect-only-by-operator`).
    pub(super) r5_back: bool,
    /// An update that is still to be sent although its order was called off (`r6-queued-update-after-cancel`).
    pub(super) r6_late: Option<Value>,
    /// Maps that were enabled when its connection went away (`r6-map-remembered-over-reconnect`).
    pub(super) r6_enabled: BTreeSet<String>,
}

impl Vehicle {
    /// Asks to be looked at again then.
    pub(super) fn at(&mut self, moment: Moment) {
        self.wake = Some(self.wake.map_or(moment, |wake| wake.min(moment)));
    }

    /// The full topic of a topic name.
    pub(super) fn topic(&self, name: &str) -> Option<&str> {
        self.config.topics.get(name).map(String::as_str)
    }
}
