//! Where the vehicle is on its way, state by state: pose, velocity, and the edge it says it is on.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use serde_json::Value;

use super::lane::{Demands, Lane, Stop};
use super::pose::{Pose, finite};
use crate::orders::{number, read_elements};
use crate::state::route::Shown;
use crate::traffic::{Traffic, elements, text, to_vehicle};
use tck_base::clock::Moment;
use tck_check::CheckContext;
use tck_journal::Entry;

/// How many order messages are kept, and how many elements of each.
const MESSAGES: usize = 64;
const ELEMENTS: usize = 1024;

/// Slower than this is at rest, in metres and radians per second.
pub(super) const AT_REST: f64 = 0.02;

/// velocity in vehicle coordinates; each member is optional.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Velocity {
    pub vx: Option<f64>,
    pub vy: Option<f64>,
    pub omega: Option<f64>,
}

impl Velocity {
    fn read(state: &Value) -> Self {
        let member = |name| state.get("velocity").and_then(|velocity| finite(velocity, name));
        Self {
            vx: member("vx"),
            vy: member("vy"),
            omega: member("omega"),
        }
    }

    /// Metres per second, whatever the direction.
    pub fn speed(&self) -> Option<f64> {
        self.vx.map(|vx| vx.hypot(self.vy.unwrap_or_default()))
    }
}

/// What one state shows.
#[derive(Clone, Debug)]
pub(super) struct View {
    pub seq: u64,
    pub moment: Moment,
    /// `timestamp` of the header, if it can be read.
    stamped: Option<jiff::Timestamp>,
    pub order: String,
    /// The last node.
    pub node: Stop,
    /// Whether this is the first state that shows this last node of this order.
    pub fresh: bool,
    /// The released edge behind the last node, while the state lists it with its end node.
    pub lane: Option<Lane>,
    /// The same, released or only planned.
    pub ahead: Option<Lane>,
    pub pose: Option<Pose>,
    pub velocity: Velocity,
    pub driving: Option<bool>,
    /// Whether no released node is left.
    pub base_done: bool,
}

impl View {
    /// Whether the vehicle stands, by its own account.
    pub fn stands(&self) -> bool {
        let still = |speed: Option<f64>| speed.is_none_or(|speed| speed.abs() <= AT_REST);
        self.driving == Some(false) && still(self.velocity.speed()) && still(self.velocity.omega)
    }

    /// Whether an earlier view shows the same last node of the same order.
    pub fn same_lane(&self, earlier: &Self) -> bool {
        (&self.order, self.node.sequence) == (&earlier.order, earlier.node.sequence) && self.lane == earlier.lane
    }

    /// The longest time that can lie between what two states show: late delivery makes the time between the
    /// arrivals shorter than it was, a coarse clock that between the timestamps.
    pub fn time_since(&self, earlier: &Self) -> Duration {
        let arrived = self.moment.since(earlier.moment);
        let stamped = self.stamped.zip(earlier.stamped).and_then(|(now, then)| {
            let span = now.duration_since(then);
            Duration::try_from(span).ok()
        });
        stamped.map_or(arrived, |stamped| stamped.max(arrived))
    }
}

#[derive(Clone, Debug, PartialEq)]
struct Plan {
    order: String,
    update: u64,
    stops: Vec<Stop>,
    edges: Vec<Demands>,
    /// sequenceIds of what is only planned.
    planned: Vec<u64>,
}

impl Plan {
    fn read(message: &Value) -> Option<Self> {
        Some(Self {
            order: text(message, "orderId").chars().take(512).collect(),
            update: number(message, "orderUpdateId")?,
            stops: elements(message, "nodes")
                .take(ELEMENTS)
                .filter_map(Stop::read)
                .collect(),
            edges: elements(message, "edges")
                .take(ELEMENTS)
                .filter_map(Demands::read)
                .collect(),
            planned: elements(message, "nodes")
                .take(ELEMENTS)
                .chain(elements(message, "edges").take(ELEMENTS))
                .filter(|element| element.get("released").and_then(Value::as_bool) == Some(false))
                .filter_map(|element| number(element, "sequenceId"))
                .collect(),
        })
    }

    /// Whether what it says about an element still holds under an update: that replaces what was only planned.
    fn holds(&self, sequence: u64, update: u64) -> bool {
        self.update == update || !self.planned.contains(&sequence)
    }
}

/// What a state shows, if the vehicle can be held to its order. All checks that look at the same entries look over the
/// same shoulder, so that each state is read once for all of them.
pub(super) fn step(entry: &Entry, context: &CheckContext<'_>) -> Option<Arc<Step>> {
    context.shared.of::<Walked>().borrow_mut().step(entry, context)
}

/// The way as far as it was followed, and what the newest entry showed.
#[derive(Default)]
pub(crate) struct Walked {
    walk: Walk,
    newest: Option<u64>,
    step: Option<Arc<Step>>,
}

impl Walked {
    fn step(&mut self, entry: &Entry, context: &CheckContext<'_>) -> Option<Arc<Step>> {
        if self.newest != Some(entry.seq()) {
            self.newest = Some(entry.seq());
            self.step = self.walk.step(entry, context).map(Arc::new);
        }
        self.step.clone()
    }
}

#[derive(Default)]
struct Walk {
    shown: Shown,
    traffic: Traffic,
    plans: VecDeque<Plan>,
    before: Option<View>,
}

/// A state, and the one before it if both belong to one order and nothing came in between.
pub(super) struct Step {
    pub now: View,
    pub before: Option<View>,
}

impl Walk {
    /// Learns from an entry; gives back what a state shows, if the vehicle can be held to its order.
    fn step(&mut self, entry: &Entry, context: &CheckContext<'_>) -> Option<Step> {
        self.traffic.note(entry);
        if let Some(plan) = to_vehicle("order", entry, context).and_then(Plan::read)
            && self.plans.back() != Some(&plan)
        {
            if self.plans.len() == MESSAGES {
                self.plans.pop_front();
            }
            self.plans.push_back(plan);
        }
        let state = self.shown.state(entry, context);
        let is_state = crate::traffic::state(self.traffic, entry, context).is_some();
        // Messages that the harness holds up tell nothing about time.
        if self.traffic.disturbed || !is_state {
            if is_state || self.traffic.disturbed {
                self.before = None;
            }
            return None;
        }
        let view = state.and_then(|state| self.view(entry, state));
        let Some(mut now) = view else {
            self.before = None;
            return None;
        };
        let before = self.before.take().filter(|before| before.order == now.order);
        now.fresh = before
            .as_ref()
            .is_none_or(|before| before.node.sequence != now.node.sequence);
        self.before = Some(now.clone());
        Some(Step { now, before })
    }

    fn view(&self, entry: &Entry, state: &Value) -> Option<View> {
        let order = text(state, "orderId");
        let update = number(state, "orderUpdateId")?;
        let mut sent = self.shown.orders.candidates(order, update).peekable();
        sent.peek()?;
        if !sent.all(|sent| sent.sound) {
            return None;
        }
        let (id, sequence) = self.shown.last.as_ref()?;
        let node = self.stop(order, update, *sequence)?;
        // Before the first node is reached, the last node is one of the order before.
        let first = self
            .shown
            .orders
            .candidates(order, update)
            .any(|sent| sent.first() == *sequence);
        if node.id != *id || (self.shown.carried.is_some() && !first) {
            return None;
        }
        let nodes = read_elements(state, "nodeStates", "nodeId")?;
        let edges = read_elements(state, "edgeStates", "edgeId")?;
        let on = |list: &[crate::orders::Element], sequence: u64| {
            let found = list.iter().find(|element| element.sequence == sequence);
            found.map(|element| element.released)
        };
        let behind = on(&edges, sequence.wrapping_sub(1)) == Some(true);
        let listed = on(&nodes, sequence + 2)
            .zip(on(&edges, sequence + 1))
            .filter(|_| !behind);
        let ahead = listed.and_then(|_| self.lane(order, update, node));
        let lane = ahead.clone().filter(|_| listed == Some((true, true)));
        let is_ahead = |element: &crate::orders::Element| element.released && element.sequence > *sequence;
        Some(View {
            seq: entry.seq(),
            moment: entry.at().moment,
            stamped: text(state, "timestamp").parse().ok(),
            order: order.chars().take(512).collect(),
            node: node.clone(),
            fresh: true,
            lane,
            ahead,
            pose: Pose::read(state),
            velocity: Velocity::read(state),
            driving: state.get("driving").and_then(Value::as_bool),
            base_done: !nodes.iter().any(is_ahead),
        })
    }

    fn lane(&self, order: &str, update: u64, from: &Stop) -> Option<Lane> {
        let ahead = from.sequence + 1;
        let demands = self.agreed(order, update, |plan| {
            let edge = plan.edges.iter().find(|edge| edge.sequence == ahead);
            edge.filter(|_| plan.holds(ahead, update))
        })?;
        let to = self.stop(order, update, from.sequence + 2)?;
        Some(Lane {
            demands: demands.clone(),
            from: from.clone(),
            to: to.clone(),
        })
    }

    fn stop(&self, order: &str, update: u64, sequence: u64) -> Option<&Stop> {
        self.agreed(order, update, |plan| {
            let stop = plan.stops.iter().find(|stop| stop.sequence == sequence);
            stop.filter(|_| plan.holds(sequence, update))
        })
    }

    /// What all messages of an order up to an update say alike; `None` when they say different things, for it is
    /// not known which of them the vehicle took over.
    fn agreed<'p, T: PartialEq>(
        &'p self,
        order: &str,
        update: u64,
        of: impl Fn(&'p Plan) -> Option<&'p T>,
    ) -> Option<&'p T> {
        let plans = self
            .plans
            .iter()
            .filter(|plan| plan.order == order && plan.update <= update);
        let mut said = plans.filter_map(of);
        let first = said.next()?;
        said.all(|other| other == first).then_some(first)
    }
}
