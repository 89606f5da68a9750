//! Coordinates of orders against those of a vehicle that stands where it was put.

use super::{Command, Found, in_sequence, place_of};
use crate::finding::quote;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_world::members::text;
use tck_world::{Fact, Listen, Observation, Outside, Topic};

/// `commands/axes`.
pub(crate) const AXES: Check = Check {
    name: "commands/axes",
    decides: &["MAP-01", "MAP-02"],
    doc: "The node a vehicle stands on has the position in orders that the vehicle reports, and not a mirror image of it \
          or a thousandfold one. A position that is like neither is not judged.",
    arguments: &[],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::Order),
    ],
    reads: &[Fact::Mock],
    start: |_| Box::new(Axes::default()),
};

/// Two places this near to each other are one, in metres.
const NEAR: f64 = 0.5;

#[derive(Default)]
struct Axes {
    /// Whether the vehicle has followed an order since it was put somewhere: then its position is that of the order.
    driven: bool,
}

impl Running for Axes {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.mock().now(record) != Outside::No {
            self.driven = false;
        }
        self.driven |= context.world.mock().last().is_some_and(|seen| seen.driving);
        let order = Command::read(record).and_then(Command::order);
        let (Some(order), Some(seen)) = (order, context.world.mock().last()) else {
            return false;
        };
        let Some((x, y, on)) = &seen.pose else { return false };
        if self.driven || context.world.mock().unsettled(record, context) {
            return false;
        }
        let nodes = in_sequence(order, "nodes");
        let here = nodes.iter().find(|node| text(node, "nodeId") == seen.last_node);
        let Some((node_x, node_y, map)) = here.and_then(|node| place_of(node)) else {
            return false;
        };
        if map != on {
            return false;
        }
        let apart = |image: (f64, f64)| (image.0 - node_x).hypot(image.1 - node_y);
        if apart((*x, *y)) < NEAR {
            // A place on an axis looks the same in that mirror.
            return x.abs() > NEAR && y.abs() > NEAR;
        }
        let shown = quote(&seen.last_node);
        let mut found = Found::new(record, findings);
        let images = [
            ((*x, -y), "y mirrored"),
            ((-x, *y), "x mirrored"),
            ((-x, -y), "both axes turned round"),
            ((*y, *x), "x and y swapped"),
        ];
        if let Some((_, how)) = images.into_iter().find(|(image, _)| apart(*image) < NEAR) {
            let text = format!(
                "node {shown} is at ({node_x:.2}, {node_y:.2}), where the vehicle reports ({x:.2}, {y:.2}): {how}"
            );
            found.broken("MAP-01", text);
            return true;
        }
        let milli = (node_x / 1000.0 - x).hypot(node_y / 1000.0 - y) < NEAR;
        if milli {
            let text =
                format!("node {shown} is at ({node_x:.0}, {node_y:.0}), a thousand times what the vehicle reports");
            found.broken("MAP-02", text);
        }
        milli
    }
}
