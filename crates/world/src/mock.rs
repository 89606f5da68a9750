//! What a mock vehicle showed of itself of late, and what the harness did to it.

use std::collections::VecDeque;

use tck_base::clock::Moment;
use tck_journal::event::Event;
use tck_pack::HookInfo;
use tck_profile::{VehicleEffect, find_vehicle_word};
use tck_view::{Field, OrderView, StateView};

use crate::observation::Observation;
use crate::ordered::{ELEMENTS, short};
use crate::setting::Setting;
use crate::shown::is_taken_out;

/// How many states are kept.
const STATES: usize = 64;

/// One state of the vehicle.
#[derive(Clone, Debug, Default)]
pub struct ShownState {
    /// When it was sent.
    pub at: Moment,
    /// orderId.
    pub order: String,
    /// orderUpdateId.
    pub update: u64,
    /// lastNodeId.
    pub last_node: String,
    /// Position and map, where the vehicle knows them.
    pub pose: Option<(f64, f64, String)>,
    /// Whether it says that it drives.
    pub driving: bool,
    /// Released elements that are left.
    pub base: usize,
    /// Elements that are left and not released.
    pub horizon: usize,
    /// operatingMode.
    pub mode: String,
    /// Whether it shows something that may end an order without a word; of a failed action its states tell the rest.
    pub taken_out: bool,
    /// Action ids with their status.
    pub actions: Vec<(String, String)>,
    /// orderUpdateIds of its order that an error names.
    pub refused: Vec<u64>,
}

impl ShownState {
    fn read(state: &StateView, at: Moment) -> Self {
        let nodes = state.node_states.iter().take(ELEMENTS).map(|node| &node.released);
        let edges = state.edge_states.iter().take(ELEMENTS).map(|edge| &edge.released);
        let left = |wanted: bool| {
            nodes
                .clone()
                .chain(edges.clone())
                .filter(|released| released.is(wanted))
                .count()
        };
        let position = state.position.there().filter(|position| position.initialized.is(true));
        let pose = position.and_then(|position| {
            let map = short(&position.map_id).unwrap_or_default();
            Some((position.x.float()?, position.y.float()?, map))
        });
        let actions: Vec<_> = state
            .action_states
            .iter()
            .chain(state.instant_action_states.iter())
            .take(ELEMENTS)
            .map(|action| {
                let id = short(&action.action_id).unwrap_or_default();
                (id, short(&action.action_status).unwrap_or_default())
            })
            .collect();
        Self {
            at,
            order: short(&state.order_id).unwrap_or_default(),
            update: state.order_update_id.whole().unwrap_or_default(),
            last_node: short(&state.last_node_id).unwrap_or_default(),
            pose,
            driving: state.driving.is(true),
            base: left(true),
            horizon: left(false),
            mode: state.operating_mode.or_empty().chars().take(64).collect(),
            taken_out: is_taken_out(state),
            actions,
            refused: refused(state),
        }
    }

    /// Whether nothing is left of an order.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.base + self.horizon == 0 && !self.driving
    }
}

/// The orderUpdateIds of the order of this state that errors name.
fn refused(state: &StateView) -> Vec<u64> {
    let order = state.order_id.or_empty();
    let errors = state.errors.iter().take(ELEMENTS);
    let named = errors.filter_map(|error| {
        let value = |field: Field| {
            let mut all = error.error_references.iter().take(ELEMENTS);
            let found = all.find(|reference| reference.key.is(field.usual_name()))?;
            Some(found.value.or_empty())
        };
        let own = value(OrderView::order_id).is_none_or(|id| id == order);
        value(OrderView::order_update_id).filter(|_| own)?.parse().ok()
    });
    named.collect()
}

/// What happened to the vehicle from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outside {
    /// Nothing.
    No,
    /// It deviates from now on.
    Deviates,
    /// It was moved, restarted or relieved of its order.
    Moved,
    /// The harness plays with the link, or the master control was started anew.
    Lost,
}

/// A mock vehicle of the harness: what it showed of late, and what the harness did to it.
#[derive(Debug, Default)]
pub struct MockVehicle {
    number: Option<usize>,
    states: VecDeque<ShownState>,
    /// When something happened to it from outside, and with which record.
    outside: Option<(Moment, u64, Outside)>,
}

impl MockVehicle {
    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>, setting: &Setting<'_>) {
        let outside = self.outside(record, setting);
        if outside != Outside::No {
            self.outside = Some((record.at().moment, record.seq(), outside));
        }
        if matches!(outside, Outside::Moved | Outside::Lost) {
            self.states.clear();
        }
        if let Some(state) = record.said_state() {
            if self.states.len() == STATES {
                self.states.pop_front();
            }
            self.states.push_back(ShownState::read(state, record.at().moment));
        }
    }
}

impl MockVehicle {
    fn outside(&mut self, record: &Observation<'_>, setting: &Setting<'_>) -> Outside {
        match record.event() {
            Event::RunBegun { header } => {
                let mut all = header.vehicles.iter();
                self.number =
                    all.position(|one| (one.manufacturer.as_str(), one.serial_number.as_str()) == setting.identity);
                Outside::No
            }
            Event::Vehicle { vehicle, what, .. } if self.number.is_none_or(|number| number == *vehicle) => {
                match find_vehicle_word(what) {
                    Some(word) if word.has(VehicleEffect::Moves) => Outside::Moved,
                    Some(word) if word.has(VehicleEffect::Deviates) => Outside::Deviates,
                    _ => Outside::No,
                }
            }
            Event::Fault { .. } => Outside::Lost,
            Event::Hook { hook, .. } if setting.hook(hook).is_some_and(HookInfo::may_restart) => Outside::Lost,
            _ => Outside::No,
        }
    }

    /// What happens to it from outside with this record.
    #[must_use]
    pub fn now(&self, record: &Observation<'_>) -> Outside {
        match self.outside {
            Some((_, seq, outside)) if seq == record.seq() => outside,
            _ => Outside::No,
        }
    }

    /// Whether it is moved, restarted or lost from sight with this record.
    #[must_use]
    pub fn is_lost(&self, record: &Observation<'_>) -> bool {
        matches!(self.now(record), Outside::Moved | Outside::Lost)
    }

    /// The last state, if nothing has happened to it since.
    #[must_use]
    pub fn last(&self) -> Option<&ShownState> {
        self.states.back()
    }

    /// The states since something happened to it, oldest first; bounded.
    pub fn states(&self) -> impl Iterator<Item = &ShownState> {
        self.states.iter()
    }

    /// Whether something happened from outside that the master control may not have seen yet: a moment ago, or so that
    /// only states of this moment show what it has come to.
    #[must_use]
    pub fn unsettled(&self, record: &Observation<'_>, setting: &Setting<'_>) -> bool {
        let (now, notice) = (record.at().moment, setting.time.notice);
        let first = self.states.front();
        self.outside.is_some_and(|(at, ..)| {
            now.since(at) < notice || first.is_none_or(|first| first.at >= at && now.since(first.at) < notice)
        })
    }

    /// The states a master control may go by, newest first: those that may still be under way, and the one before.
    pub fn recent<'a>(
        &'a self,
        record: &Observation<'_>,
        setting: &Setting<'_>,
    ) -> impl Iterator<Item = &'a ShownState> + use<'a> {
        let (now, notice) = (record.at().moment, setting.time.notice);
        let fresh = self
            .states
            .iter()
            .rev()
            .take_while(|seen| now.since(seen.at) < notice)
            .count();
        self.states.iter().rev().take(fresh + 1)
    }
}
