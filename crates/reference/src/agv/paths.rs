//! The paths that a freely navigating vehicle shares where the version has them: as far as its base reaches, and the next
//! metres with the times at which it will be there (section 6.8 of 3.0).
//!
//! What was sent with an edge is no path of its own, so that it shares none then (the ruling of PATH-09).

use std::time::Duration;

use serde_json::{Map, Value, json};

use tck_base::nurbs::Path;
use tck_view::StateView;

use super::Agv;
use super::hook_points::Permission;
use super::order_message::Edge;
use super::order_state::Stop;

/// So many nodes ahead the next metres reach.
const NEXT: usize = 3;

/// Of the points of a bow, one in so many is shared.
const SPARSE: usize = 4;

/// A point of the way ahead.
pub(crate) type Point = (f64, f64);

impl Agv {
    /// Whether the version has paths, so that edges show what was sent and nothing else (STATE-MSG-21).
    pub(crate) fn has_paths(&self) -> bool {
        !self.config.names.lacks(StateView::planned_path)
    }

    /// Puts the paths into a state or a visualization (PATH-01, PATH-10).
    pub(crate) fn share_paths(&self, message: &mut Map<String, Value>) {
        if !self.has_paths() || !self.allows(Permission::ReportPath, self.config.plans) {
            return;
        }
        let Some((ids, points)) = self.way_planned() else {
            return;
        };
        message.insert("plannedPath".into(), planned(&ids, &points));
        message.insert("intermediatePath".into(), self.intermediate(&points));
    }

    /// The base from where the vehicle is, and the nodes on it; `None` where it has none, or was sent one.
    fn way_planned(&self) -> Option<(Vec<&str>, Vec<Point>)> {
        let base: Vec<_> = self.order.nodes.iter().take_while(|stop| stop.node.released).collect();
        let sent = |edge: &Edge| edge.released && edge.trajectory.is_some();
        if base.is_empty() || self.order.edges.iter().any(sent) {
            return None;
        }
        let pose = self.motion.pose(self.moment());
        let mut points = vec![(pose.x, pose.y)];
        let granted = self.order.edge_ahead().zip(base.first());
        let granted = granted.and_then(|(edge, stop)| self.bow_ahead(edge, stop));
        points.extend(granted.iter().flat_map(Path::points));
        for (at, stop) in base.iter().enumerate() {
            if at > 0 || granted.is_none() {
                points.extend(self.round_zones(points[points.len() - 1], stop));
            }
            points.push((stop.place.x, stop.place.y));
        }
        Some((base.iter().map(|stop| stop.node.id.as_str()).collect(), points))
    }

    /// Points of the way to a node where it leads round zones.
    fn round_zones(&self, from: Point, stop: &Stop) -> Vec<Point> {
        let before = stop.node.sequence_id.checked_sub(1);
        let edge = self.order.edges.iter().find(|edge| Some(edge.sequence_id) == before);
        let Some(edge) = edge else { return Vec::new() };
        let ahead = self
            .order
            .edge_ahead()
            .is_some_and(|ahead| ahead.sequence_id == edge.sequence_id);
        let chosen = ahead && self.order.entered;
        let way = match chosen {
            true => self.curve_ahead(edge, stop),
            false => Some(self.way_from(from, edge, stop)),
        };
        let points: Vec<Point> = way.iter().flat_map(Path::points).collect();
        let inner = points.get(1..points.len().saturating_sub(1)).unwrap_or_default();
        inner.iter().step_by(SPARSE).copied().collect()
    }

    /// The next metres, and when it will be where (PATH-06, PATH-07).
    fn intermediate(&self, points: &[Point]) -> Value {
        let speed = self.config.speed / self.config.slowness.max(1.0);
        let mut eta = self.now.utc;
        let mut waypoints = Vec::new();
        let mut before = points[0];
        for (at, point) in points.iter().take(NEXT + 1).enumerate() {
            let (dx, dy) = (point.0 - before.0, point.1 - before.1);
            let lasts = Duration::from_secs_f64((dx.hypot(dy) / speed.max(0.01)).min(86_400.0));
            eta = eta.checked_add(lasts).unwrap_or(eta);
            let mut waypoint = json!({
                "x": point.0,
                "y": point.1,
                "eta": format!("{:.*}", self.config.timestamp_digits, eta),
            });
            if at > 0 {
                waypoint["theta"] = json!(dy.atan2(dx));
            }
            waypoints.push(waypoint);
            before = *point;
        }
        json!({ "polyline": waypoints })
    }

    /// What an edge state shows of a trajectory where the version has paths: the one that was sent, while it is driven.
    pub(crate) fn sent_path(&self, edge: &Edge) -> Option<Value> {
        let driven = self.order.entered
            && self
                .order
                .edge_ahead()
                .is_some_and(|ahead| ahead.sequence_id == edge.sequence_id);
        let sent = edge
            .trajectory
            .as_ref()
            .filter(|_| driven && self.config.trajectories)?;
        Some(sent.sent.clone())
    }
}

/// A line through the points, as a NURBS (PATH-03, ZREQ-07).
pub(crate) fn line(points: &[Point]) -> Value {
    let last = u32::try_from(points.len().saturating_sub(1)).unwrap_or(1).max(1);
    let inner = (0..=last).map(|at| f64::from(at) / f64::from(last));
    let knots: Vec<f64> = std::iter::once(0.0).chain(inner).chain([1.0]).collect();
    let points: Vec<Value> = points
        .iter()
        .map(|(x, y)| json!({ "x": x, "y": y, "weight": 1.0 }))
        .collect();
    json!({ "degree": 1, "knotVector": knots, "controlPoints": points })
}

/// The way to these nodes.
fn planned(ids: &[&str], points: &[Point]) -> Value {
    json!({ "trajectory": line(points), "traversedNodes": ids })
}
