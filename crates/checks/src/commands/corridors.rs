//! Corridors that are sent with edges.

use std::borrow::Cow;

use serde_json::Value;

use super::{Command, Found, allowed, edges_in_sequence, nodes_in_sequence, place_of};
use crate::finding::{missing_or, quote, show};
use tck_base::nurbs::Path;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Corridor, Deviation, Edge, Member, Node, OrderView};
use tck_world::ordered::curve;
use tck_world::{Fact, Listen, Observation, Topic};

/// `commands/corridors`.
pub(crate) const CORRIDORS: Check = Check {
    name: "commands/corridors",
    decides: &["CORR-02", "CORR-04", "CORR-05", "CORR-09"],
    doc: "A corridor has a left and a right width of at least 0, not both 0, and a reference point the protocol knows, under \
          the name that the version has for it. It \
          comes with a trajectory, unless the vehicle is bound to lines or reports trajectories of its own. Where two \
          corridors meet, the end of the first way lies inside the second corridor; a node that allows a wider \
          deviation than the second corridor, or than both sides of it together, is a warning, and so is one at the first node; so are two corridors \
          of which one lies to the left only and the other to the right only.",
    arguments: &[],
    listens: &[Listen::Sent(Topic::State), Listen::Delivered(Topic::Order)],
    reads: &[Fact::Factsheets],
    needs: &[Edge::corridor],
    start: |_| Box::new(Corridors::default()),
};

/// What rounding may add, in metres.
const ROUNDING: f64 = 0.05;

#[derive(Default)]
struct Corridors {
    /// Whether the vehicle ever reported a trajectory of its own.
    plans: bool,
}

/// The corridor of an edge; one without members where something else stands in its place.
fn corridor(edge: &Edge) -> Option<Cow<'_, Corridor>> {
    match &edge.corridor {
        Member::There(corridor) => Some(Cow::Borrowed(corridor)),
        Member::Other(_) => Some(Cow::Owned(Corridor::default())),
        Member::Absent | Member::Null => None,
    }
}

/// Both widths, if they make sense: left, right.
fn widths(edge: &Edge) -> Option<(f64, f64)> {
    let corridor = corridor(edge)?;
    let (left, right) = (corridor.left_width.float()?, corridor.right_width.float()?);
    (left >= 0.0 && right >= 0.0).then_some((left, right))
}

fn path(edge: &Edge, from: &Node, to: &Node) -> Option<Path> {
    if let Some((curve, _)) = curve(&edge.trajectory) {
        return curve.map(|curve| curve.path());
    }
    let ((ax, ay, _), (bx, by, _)) = (place_of(from)?, place_of(to)?);
    Some(Path::through([(ax, ay), (bx, by)]))
}

impl Running for Corridors {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if let Some(state) = record.said_state() {
            self.plans |= state.edge_states.iter().any(|edge| !edge.trajectory.is_absent());
        }
        let order = Command::read(record).and_then(Command::order);
        let Some(order) = order else { return false };
        let edges = edges_in_sequence(order);
        if !edges.iter().any(|edge| corridor(edge).is_some()) {
            return false;
        }
        let mut found = Found::new(record, findings);
        point_under_its_old_name(record, &mut found);
        let sheets = context.world.factsheets().valid(record, context);
        let bound = self.plans || sheets.is_empty() || sheets.iter().any(|sheet| sheet.line_guided);
        for edge in &edges {
            let Some(corridor) = corridor(edge) else { continue };
            by_itself(&corridor, edge, context, &mut found);
            if !bound && !edge.trajectory.presence().is_something() {
                let text = format!(
                    "edge {} has a corridor and no trajectory",
                    quote(edge.edge_id.or_empty())
                );
                found.broken("CORR-02", text);
            }
        }
        let nodes = nodes_in_sequence(order);
        if nodes.len() == edges.len() + 1 {
            if let (Some(edge), Some(node)) = (edges.first(), nodes.first()) {
                beginning(edge, node, &mut found);
            }
            for (pair, around) in edges.windows(2).zip(nodes.windows(3)) {
                meeting(pair, around, &mut found);
            }
        }
        true
    }
}

/// The reference point by the name it had in an earlier version, where the version has another one for it and that is not there.
fn point_under_its_old_name(record: &Observation<'_>, found: &mut Found<'_>) {
    let names = record.names();
    let old = Corridor::reference_point.usual_name();
    let Some(name) = names.name(Corridor::reference_point).filter(|name| *name != old) else {
        return;
    };
    let edges = record.json().map(|order| names.raw_elements(order, OrderView::edges));
    for edge in edges.into_iter().flatten() {
        let corridor = names.raw(edge, &[Edge::corridor]);
        if corridor.is_some_and(|corridor| corridor.get(old).is_some() && corridor.get(name).is_none()) {
            let id = names.raw(edge, &[Edge::edge_id]).and_then(Value::as_str);
            let id = quote(id.unwrap_or_default());
            let text = format!("the corridor of edge {id} has {old}, which is called {name} in this version");
            found.broken("CORR-09", text);
        }
    }
}

fn by_itself(corridor: &Corridor, edge: &Edge, context: &CheckContext<'_>, found: &mut Found<'_>) {
    let id = quote(edge.edge_id.or_empty());
    let mut zero = true;
    for (name, width) in [
        ("leftWidth", &corridor.left_width),
        ("rightWidth", &corridor.right_width),
    ] {
        let value = width.float();
        zero &= value == Some(0.0);
        if value.is_none_or(|value| value < 0.0) {
            let shown = missing_or(width);
            found.broken("CORR-09", format!("{name} of the corridor of edge {id} is {shown}"));
        }
    }
    if zero {
        found.broken("CORR-05", format!("the corridor of edge {id} has no width"));
    }
    let point = &corridor.reference_point;
    if !point.is_absent() {
        let known = context
            .pack
            .vocabulary()
            .get("corridorReference")
            .and_then(Value::as_object);
        if known.is_some_and(|known| {
            !known
                .values()
                .any(|known| known.as_str().is_some_and(|known| point.is(known)))
        }) {
            found.broken("CORR-09", format!("corridorRefPoint of edge {id} is {}", show(point)));
        }
    }
}

/// The first node, behind no other corridor: where the vehicle may be on it, it is inside the corridor that begins there.
fn beginning(edge: &Edge, node: &Node, found: &mut Found<'_>) {
    let allowed = allowed(node).and_then(Deviation::nearest);
    let (Some((left, right)), Some(allowed)) = (widths(edge), allowed) else {
        return;
    };
    if left + right > 0.0 && allowed > left.max(right) + ROUNDING {
        let id = quote(node.node_id.or_empty());
        let text = format!("node {id} allows {allowed} m, the corridor that begins there is narrower to both sides");
        found.remark("CORR-04", text);
    }
}

fn meeting(pair: &[&Edge], around: &[&Node], found: &mut Found<'_>) {
    let ([first, second], [from, node, to]) = (pair, around) else {
        return;
    };
    let (Some((before_left, before_right)), Some((left, right))) = (widths(first), widths(second)) else {
        return;
    };
    let (Some(path_before), Some(path)) = (path(first, from, node), path(second, node, to)) else {
        return;
    };
    let Some(end) = path_before.at(path_before.length()) else {
        return;
    };
    let Some(beside) = path.beside(end.x, end.y) else {
        return;
    };
    let room = if beside.left { left } else { right };
    let id = quote(node.node_id.or_empty());
    if beside.distance > room + ROUNDING {
        let text = format!(
            "at node {id} the way ends {:.2} m beside the next corridor",
            beside.distance - room
        );
        found.broken("CORR-04", text);
        return;
    }
    // Beside each other, with nothing but the line in common.
    let apart = (before_left > ROUNDING && before_right <= 0.0 && left <= 0.0 && right > ROUNDING)
        || (before_right > ROUNDING && before_left <= 0.0 && right <= 0.0 && left > ROUNDING);
    if apart {
        let text = format!("at node {id} one corridor lies to the left only, and the other to the right only");
        found.remark("CORR-04", text);
        return;
    }
    let allowed = allowed(node).and_then(Deviation::nearest);
    let reach = before_left.max(before_right);
    let wide = |allowed: f64| allowed.min(reach) > left.max(right) + ROUNDING || allowed > left + right + ROUNDING;
    if let Some(allowed) = allowed.filter(|allowed| wide(*allowed)) {
        let text = format!("node {id} allows {allowed} m, the next corridor is narrower to both sides");
        found.remark("CORR-04", text);
    }
}
