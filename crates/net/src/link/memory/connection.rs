//! What the bus knows about one connection of a peer.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use super::packets::{Down, Up};
use tck_base::clock::Moment;
use tck_wire::Reader;

/// What waits in the tap, with the moment it may go on.
pub(super) type Lane<T> = VecDeque<(Moment, T)>;

/// One connection of a peer.
pub(super) struct Connection {
    pub(super) peer: usize,
    pub(super) tapped: bool,
    pub(super) subscriptions: Vec<(String, u8)>,
    pub(super) keep_alive: Duration,
    /// Whether the tap let it in.
    pub(super) admitted: bool,
    /// Whether the broker has its CONNECT.
    pub(super) known: bool,
    /// Whether the device was told that it is connected.
    pub(super) established: bool,
    pub(super) device_open: bool,
    pub(super) broker_open: bool,
    pub(super) end_reported: bool,
    /// When the broker last heard something.
    pub(super) heard: Moment,
    pub(super) unanswered_ping: bool,
    pub(super) up: Lane<Up>,
    pub(super) down: Lane<Down>,
    /// Nothing may overtake what was sent before.
    pub(super) last_at_tap: Moment,
    pub(super) last_at_device: Moment,
    pub(super) device_ids: u16,
    pub(super) broker_ids: u16,
    /// Packet identifiers of QoS 2 messages in hand, at the broker and at the device.
    pub(super) broker_has: BTreeSet<u16>,
    pub(super) device_has: BTreeSet<u16>,
    pub(super) reader: Reader,
}

pub(super) fn take_due<T>(lane: &mut Lane<T>, now: Moment) -> Option<T> {
    let due = lane.front().is_some_and(|(due, _)| *due <= now);
    if due {
        lane.pop_front().map(|(_, item)| item)
    } else {
        None
    }
}

/// Packet identifiers run from 1.
pub(super) fn next_id(last: &mut u16) -> u16 {
    *last = last.checked_add(1).unwrap_or(1);
    *last
}
