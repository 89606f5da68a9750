//! Order updates: whether one continues the order, and taking it over (rows 8 and 10 of figure 8, section 6.6.2).
//!
//! What the first transmission of the stitching node said stands (the ruling of ORD-UPD-07); the actions of a horizon
//! that is replaced are forgotten with it (that of ORD-UPD-10).

use super::Agv;
use super::actions::{Action, Origin};
use super::hook_points::{Event, Permission};
use super::objections::{Objection, Relation};
use super::order_message::{Node, Order};
use super::rejection::{Detail, Refusal, Rule};

impl Agv {
    /// Rows 8 and 10: whether the update continues the order. A running order is continued at its decision point
    /// (ORD-FLOW-08), a completed one where the vehicle is (ORD-FLOW-10).
    pub(crate) fn check_update(&self, order: &Order) -> Result<(), Refusal> {
        let cancelled = self.order.cancel.is_some() || self.order.cancelled;
        if cancelled {
            let refusal = Refusal::new(Rule::BrokenUpdate, "the order was cancelled");
            self.object(Objection::Cancelled, refusal.because(Detail::Cancelled))?;
        }
        self.objected(order, Relation::Update)?;
        let first = &order.nodes[0];
        if !self.joins(first) {
            let refusal = Refusal::new(Rule::BrokenUpdate, "the update does not continue the order");
            self.object(Objection::Joint(first), refusal.naming("nodeId", &first.id))?;
        }
        self.check_ability(order, 1)
    }

    /// Whether an update that begins with this node continues the order there is.
    pub(crate) fn joins(&self, first: &Node) -> bool {
        let runs = self.is_busy() || self.order.cancelled;
        let joint = if runs {
            (&self.order.base_end.0, self.order.base_end.1)
        } else {
            (&self.order.last_node, self.order.last_sequence)
        };
        joint == (&first.id, first.sequence_id)
    }

    /// Rows 8 and 10: takes over an update. What the first transmission of the stitching node said stands (ORD-UPD-07).
    pub(crate) fn continue_with(&mut self, order: Order) {
        if !self.allows(Permission::KeepHorizon(&order), false) {
            self.drop_horizon();
        }
        self.order.update_id = order.update_id;
        self.order.content = self.kept(&order);
        self.append(order.nodes.into_iter().skip(1).collect(), order.edges);
        self.happens(Event::Updated);
    }

    /// The horizon goes, and the actions that wait there (ORD-UPD-08 to ORD-UPD-10).
    fn drop_horizon(&mut self) {
        let gone = self.order.drop_horizon();
        self.happens(Event::HorizonDropped);
        let of_horizon = |action: &&Action| match action.origin {
            Origin::Node(id) | Origin::Edge(id) => {
                gone.contains(&id) && self.allows(Permission::ForgetWithHorizon, true)
            }
            Origin::Instant | Origin::Zone(_) => false,
        };
        let forgotten: Vec<String> = self.actions.iter().filter(of_horizon).map(Action::id).collect();
        self.actions.retain(|action| !forgotten.contains(&action.request.id));
    }
}
