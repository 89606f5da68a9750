//! Where the vehicle is on its way, state by state: pose, velocity, and the edge it says it is on.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use tck_base::clock::Moment;

use crate::lane::{Demands, Lane, OrderedNode, sane};
use crate::observation::Observation;
use crate::orders::{Element, OrdersSent, edges_left, nodes_left};
use crate::shown::ShownOrder;
use tck_view::{Element as Ordered, OrderView, Pose, StateView};

/// How many order messages are kept, and how many elements of each.
const MESSAGES: usize = 64;
const ELEMENTS: usize = 1024;

/// Slower than this is at rest, in metres and radians per second.
pub const AT_REST: f64 = 0.02;

/// velocity in vehicle coordinates; each member is optional.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Metres per second, forwards.
    pub vx: Option<f64>,
    /// Metres per second, to the left.
    pub vy: Option<f64>,
    /// Radians per second.
    pub omega: Option<f64>,
}

impl Velocity {
    fn read(state: &StateView) -> Self {
        state.velocity.there().map_or_else(Self::default, |velocity| Self {
            vx: sane(&velocity.vx),
            vy: sane(&velocity.vy),
            omega: sane(&velocity.omega),
        })
    }

    /// Metres per second, whatever the direction.
    #[must_use]
    pub fn speed(&self) -> Option<f64> {
        self.vx.map(|vx| vx.hypot(self.vy.unwrap_or_default()))
    }
}

/// What one state shows.
#[derive(Clone, Debug)]
pub struct View {
    /// The record.
    pub seq: u64,
    /// When it came.
    pub moment: Moment,
    /// `timestamp` of the header, if it can be read.
    stamped: Option<jiff::Timestamp>,
    /// orderId.
    pub order: String,
    /// The last node.
    pub node: OrderedNode,
    /// Whether this is the first state that shows this last node of this order.
    pub fresh: bool,
    /// The released edge behind the last node, while the state lists it with its end node.
    pub lane: Option<Lane>,
    /// The edge behind the last node, released or only planned.
    pub ahead: Option<Lane>,
    /// Where the vehicle is.
    pub pose: Option<Pose>,
    /// How fast it is.
    pub velocity: Velocity,
    /// Whether it says that it drives.
    pub driving: Option<bool>,
    /// Whether no released node is left.
    pub base_done: bool,
}

impl View {
    /// Whether the vehicle stands, by its own account.
    #[must_use]
    pub fn stands(&self) -> bool {
        let still = |speed: Option<f64>| speed.is_none_or(|speed| speed.abs() <= AT_REST);
        self.driving == Some(false) && still(self.velocity.speed()) && still(self.velocity.omega)
    }

    /// Whether an earlier view shows the same last node of the same order.
    #[must_use]
    pub fn same_lane(&self, earlier: &Self) -> bool {
        (&self.order, self.node.sequence) == (&earlier.order, earlier.node.sequence) && self.lane == earlier.lane
    }

    /// The longest time that can lie between what two states show: late delivery makes the time between the
    /// arrivals shorter than it was, a coarse clock that between the timestamps.
    #[must_use]
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
    stops: Vec<OrderedNode>,
    edges: Vec<Demands>,
    /// sequenceIds of what is only planned.
    planned: Vec<u64>,
}

impl Plan {
    fn read(message: &OrderView) -> Option<Self> {
        let (nodes, edges) = (message.nodes.iter().take(ELEMENTS), message.edges.iter().take(ELEMENTS));
        let all = nodes.clone().map(Ordered::Node).chain(edges.clone().map(Ordered::Edge));
        Some(Self {
            order: message.order_id.or_empty().to_owned(),
            update: message.order_update_id.whole()?,
            stops: nodes.filter_map(OrderedNode::read).collect(),
            edges: edges.filter_map(Demands::read).collect(),
            planned: all
                .filter(|element| element.released().is(false))
                .filter_map(|element| element.sequence_id().whole())
                .collect(),
        })
    }

    /// Whether what it says about an element still holds under an update: that replaces what was only planned.
    fn holds(&self, sequence: u64, update: u64) -> bool {
        self.update == update || !self.planned.contains(&sequence)
    }
}

/// The way as far as it was followed.
#[derive(Debug, Default)]
pub struct Way {
    plans: VecDeque<Plan>,
    before: Option<View>,
    /// What the last record showed that showed anything.
    step: Option<(u64, Arc<Step>)>,
}

/// A state, and the one before it if both belong to one order and nothing came in between.
#[derive(Debug)]
pub struct Step {
    /// What it shows.
    pub now: View,
    /// What the one before showed.
    pub before: Option<View>,
}

impl Way {
    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>, shown: &ShownOrder, orders: &OrdersSent) {
        if let Some(plan) = record.order_to_vehicle().and_then(|order| Plan::read(order))
            && self.plans.back() != Some(&plan)
        {
            if self.plans.len() == MESSAGES {
                self.plans.pop_front();
            }
            self.plans.push_back(plan);
        }
        let state = shown.state(record);
        let is_state = record.state().is_some();
        // Messages that the harness holds up tell nothing about time.
        if record.link.disturbed || !is_state {
            if is_state || record.link.disturbed {
                self.before = None;
            }
            return;
        }
        let Some(mut now) = state.and_then(|state| self.view(record, state, shown, orders)) else {
            self.before = None;
            return;
        };
        let before = self.before.take().filter(|before| before.order == now.order);
        now.fresh = before
            .as_ref()
            .is_none_or(|before| before.node.sequence != now.node.sequence);
        self.before = Some(now.clone());
        self.step = Some((record.seq(), Arc::new(Step { now, before })));
    }
}

impl Way {
    /// What this record shows, if it is a state of a vehicle that can be held to its order.
    #[must_use]
    pub fn step(&self, record: &Observation<'_>) -> Option<Arc<Step>> {
        let (_, step) = self.step.as_ref().filter(|(seq, _)| *seq == record.seq())?;
        Some(Arc::clone(step))
    }

    fn view(
        &self,
        record: &Observation<'_>,
        state: &StateView,
        shown: &ShownOrder,
        orders: &OrdersSent,
    ) -> Option<View> {
        let order = state.order_id.or_empty();
        let update = state.order_update_id.whole()?;
        let mut sent = orders.candidates(order, update).peekable();
        sent.peek()?;
        if !sent.all(|sent| sent.sound) {
            return None;
        }
        let (id, sequence) = shown.last()?;
        let node = self.stop(order, update, *sequence)?;
        // Before the first node is reached, the last node is one of the order before.
        let first = orders.candidates(order, update).any(|sent| sent.first() == *sequence);
        if node.id != *id || (shown.carried().is_some() && !first) {
            return None;
        }
        let nodes = nodes_left(state)?;
        let edges = edges_left(state)?;
        let on = |list: &[Element], sequence: u64| {
            let found = list.iter().find(|element| element.sequence == sequence);
            found.map(|element| element.released)
        };
        let behind = on(&edges, sequence.wrapping_sub(1)) == Some(true);
        let listed = on(&nodes, sequence + 2)
            .zip(on(&edges, sequence + 1))
            .filter(|_| !behind);
        let ahead = listed.and_then(|_| self.lane(order, update, node));
        let lane = ahead.clone().filter(|_| listed == Some((true, true)));
        let is_ahead = |element: &Element| element.released && element.sequence > *sequence;
        Some(View {
            seq: record.seq(),
            moment: record.at().moment,
            stamped: state.header.timestamp.or_empty().parse().ok(),
            order: order.to_owned(),
            node: node.clone(),
            fresh: true,
            lane,
            ahead,
            // An angle far beyond pi is in other units.
            pose: state.pose().filter(|pose| pose.theta.abs() < 3.2),
            velocity: Velocity::read(state),
            driving: state.driving.flag(),
            base_done: !nodes.iter().any(is_ahead),
        })
    }

    fn lane(&self, order: &str, update: u64, from: &OrderedNode) -> Option<Lane> {
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

    fn stop(&self, order: &str, update: u64, sequence: u64) -> Option<&OrderedNode> {
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
