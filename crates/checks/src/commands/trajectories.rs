//! Trajectories that are sent with edges.

use super::{Command, Each, Found, allowed_deviation, edges_in_sequence, nodes_in_sequence, place_of};
use crate::finding::quote;
use crate::trajectory::counts;
use tck_base::nurbs::{Curve, Flaw};
use tck_check::{Check, CheckContext};
use tck_view::{Edge, Node};
use tck_world::ordered::curve;
use tck_world::{Listen, Topic};

/// `commands/trajectory`.
pub(crate) const TRAJECTORY: Check = Check {
    name: "commands/trajectory",
    decides: &["ORD-MSG-28", "ORD-MSG-29", "ORD-MSG-31"],
    doc: "Every trajectory of an order has a whole degree of at least 1, control points with x and y and with weights \
          not below 0, more of them than the degree, and as many knots within 0 to 1 as control points, degree and one \
          together. A missing degree and knots out of order are warnings.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    needs: &[Edge::trajectory],
    start: |_| Each::start(shape),
};

/// `commands/trajectory-ends`.
pub(crate) const ENDS: Check = Check {
    name: "commands/trajectory-ends",
    decides: &["ORD-MSG-30"],
    doc: "The first and the last control point of a trajectory in an order are where the nodes of its edge are, within \
          their allowedDeviationXY and half a metre.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    needs: &[Edge::trajectory, Node::node_position],
    start: |_| Each::start(ends),
};

/// How far the end of a curve may be from its node, in metres.
const END: f64 = 0.5;

fn shape(command: Command<'_>, context: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(order) = command.order() else { return false };
    let mut judged = false;
    for edge in edges_in_sequence(order) {
        let Some((_, flaws)) = curve(&edge.trajectory) else {
            continue;
        };
        judged = true;
        for flaw in flaws.into_iter().filter(|flaw| counts(flaw, context)) {
            let text = format!("the trajectory of edge {}: {flaw}", quote(edge.edge_id.or_empty()));
            match flaw {
                Flaw::Member(_) | Flaw::KnotsMissing => found.broken("ORD-MSG-28", text),
                Flaw::DegreeMissing => found.remark("ORD-MSG-28", text),
                Flaw::PointCount { .. } => found.broken("ORD-MSG-31", text),
                Flaw::KnotCount { .. } | Flaw::KnotRange { .. } => found.broken("ORD-MSG-29", text),
                Flaw::KnotOrder(_) => found.remark("ORD-MSG-29", text),
            }
        }
    }
    judged
}

fn ends(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(order) = command.order() else { return false };
    let (nodes, edges) = (nodes_in_sequence(order), edges_in_sequence(order));
    if nodes.len() != edges.len() + 1 {
        return false;
    }
    let mut judged = false;
    for (edge, around) in edges.iter().zip(nodes.windows(2)) {
        let shape = curve(&edge.trajectory).and_then(|(curve, _)| curve);
        let Some((start, end)) = shape.as_ref().and_then(Curve::ends) else {
            continue;
        };
        for (node, point, verb) in [(around[0], start, "begins"), (around[1], end, "ends")] {
            let Some((x, y, _)) = place_of(node) else { continue };
            judged = true;
            let allowed = allowed_deviation(node).unwrap_or_default();
            let distance = (x - point.0).hypot(y - point.1);
            if distance > END + allowed.max(0.0) {
                let id = quote(edge.edge_id.or_empty());
                let at = order
                    .edges
                    .iter()
                    .position(|known| std::ptr::eq(known, *edge))
                    .unwrap_or_default();
                let text =
                    format!("order/edges/{at}/trajectory: the curve of edge {id} {verb} {distance:.2} m from its node");
                found.broken("ORD-MSG-30", text);
            }
        }
    }
    judged
}
