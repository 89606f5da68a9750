//! Corridors that are sent with edges.

use serde_json::Value;

use super::{Command, Found, in_sequence, place_of};
use crate::finding::{quote, show};
use tck_base::nurbs::{Curve, Path};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_world::members::{elements, text};
use tck_world::{Fact, Listen, Observation, Topic};

/// `commands/corridors`.
pub(crate) const CORRIDORS: Check = Check {
    name: "commands/corridors",
    decides: &["CORR-02", "CORR-04", "CORR-05", "CORR-09"],
    doc: "A corridor has a left and a right width of at least 0, not both 0, and a reference point the protocol knows. It \
          comes with a trajectory, unless the vehicle is bound to lines or reports trajectories of its own. Where two \
          corridors meet, the end of the first way lies inside the second corridor; a node that allows a wider \
          deviation than the second corridor, or than both sides of it together, is a warning, and so is one at the first node; so are two corridors \
          of which one lies to the left only and the other to the right only.",
    arguments: &[],
    listens: &[Listen::Sent(Topic::State), Listen::Delivered(Topic::Order)],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(Corridors::default()),
};

/// What rounding may add, in metres.
const ROUNDING: f64 = 0.05;

#[derive(Default)]
struct Corridors {
    /// Whether the vehicle ever reported a trajectory of its own.
    plans: bool,
}

fn corridor(edge: &Value) -> Option<&Value> {
    edge.get("corridor").filter(|corridor| !corridor.is_null())
}

fn width(corridor: &Value, name: &str) -> Option<f64> {
    corridor.get(name).and_then(Value::as_f64)
}

/// Both widths, if they make sense: left, right.
fn widths(edge: &Value) -> Option<(f64, f64)> {
    let corridor = corridor(edge)?;
    let (left, right) = (width(corridor, "leftWidth")?, width(corridor, "rightWidth")?);
    (left >= 0.0 && right >= 0.0).then_some((left, right))
}

fn path(edge: &Value, from: &Value, to: &Value) -> Option<Path> {
    if let Some(trajectory) = edge.get("trajectory").filter(|trajectory| !trajectory.is_null()) {
        return Curve::read(trajectory).0.map(|curve| curve.path());
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
        if let Some(state) = record.said(Topic::State) {
            self.plans |= elements(state, "edgeStates").any(|edge| edge.get("trajectory").is_some());
        }
        let order = Command::read(record).and_then(Command::order);
        let Some(order) = order else { return false };
        let edges = in_sequence(order, "edges");
        if !edges.iter().any(|edge| corridor(edge).is_some()) {
            return false;
        }
        let mut found = Found::new(record, findings);
        let sheets = context.world.factsheets().valid(record, context);
        let bound = self.plans || sheets.is_empty() || sheets.iter().any(|sheet| sheet.line_guided);
        for edge in &edges {
            let Some(corridor) = corridor(edge) else { continue };
            by_itself(corridor, edge, context, &mut found);
            if !bound && edge.get("trajectory").is_none_or(Value::is_null) {
                let text = format!("edge {} has a corridor and no trajectory", quote(text(edge, "edgeId")));
                found.broken("CORR-02", text);
            }
        }
        let nodes = in_sequence(order, "nodes");
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

fn by_itself(corridor: &Value, edge: &Value, context: &CheckContext<'_>, found: &mut Found<'_>) {
    let id = quote(text(edge, "edgeId"));
    let mut zero = true;
    for name in ["leftWidth", "rightWidth"] {
        let value = width(corridor, name);
        zero &= value == Some(0.0);
        if value.is_none_or(|value| value < 0.0) {
            let shown = corridor.get(name).map_or_else(|| "missing".to_owned(), show);
            found.broken("CORR-09", format!("{name} of the corridor of edge {id} is {shown}"));
        }
    }
    if zero {
        found.broken("CORR-05", format!("the corridor of edge {id} has no width"));
    }
    let names = ["corridorRefPoint", "corridorReferencePoint"];
    if let Some(point) = names.iter().find_map(|name| corridor.get(*name)) {
        let known = context
            .pack
            .vocabulary()
            .get("corridorReference")
            .and_then(Value::as_object);
        if known.is_some_and(|known| !known.values().any(|known| known == point)) {
            found.broken("CORR-09", format!("corridorRefPoint of edge {id} is {}", show(point)));
        }
    }
}

/// The first node, behind no other corridor: where the vehicle may be on it, it is inside the corridor that begins there.
fn beginning(edge: &Value, node: &Value, found: &mut Found<'_>) {
    let allowed = node.pointer("/nodePosition/allowedDeviationXY").and_then(Value::as_f64);
    let (Some((left, right)), Some(allowed)) = (widths(edge), allowed) else {
        return;
    };
    if left + right > 0.0 && allowed > left.max(right) + ROUNDING {
        let id = quote(text(node, "nodeId"));
        let text = format!("node {id} allows {allowed} m, the corridor that begins there is narrower to both sides");
        found.remark("CORR-04", text);
    }
}

fn meeting(pair: &[&Value], around: &[&Value], found: &mut Found<'_>) {
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
    let id = quote(text(node, "nodeId"));
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
    let allowed = node.pointer("/nodePosition/allowedDeviationXY").and_then(Value::as_f64);
    let reach = before_left.max(before_right);
    let wide = |allowed: f64| allowed.min(reach) > left.max(right) + ROUNDING || allowed > left + right + ROUNDING;
    if let Some(allowed) = allowed.filter(|allowed| wide(*allowed)) {
        let text = format!("node {id} allows {allowed} m, the next corridor is narrower to both sides");
        found.remark("CORR-04", text);
    }
}
