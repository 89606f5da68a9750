//! The way over an edge where it is no straight line: trajectories (section 6.6.6), corridors and what stands in them
//! (6.6.5), the path a self-planning vehicle reports (6.10.1), and the branches of a line on the floor.
//!
//! Outside its corridor the vehicle stops and reports a FATAL error of a name of its own (the ruling of CORR-07); a
//! path is reported where that was agreed (that of STATE-14).

use serde_json::{Value, json};

use super::Agv;
use super::errors::{ActiveError, Life};
use super::hook_points::{Cause, Event, Permission};
use super::order_message::{Corridor, Edge, Node};
use super::order_state::{Place, Stop};
use super::rejection::{Refusal, Rule};
use tck_base::nurbs::Path;

/// Half the width of the vehicle, in metres.
pub(crate) const HALF_WIDTH: f64 = 0.4;

/// Half the length of the vehicle, in metres.
pub(crate) const HALF_LENGTH: f64 = 0.6;

/// Nearer to its path than this, the vehicle is on it, in metres.
pub(crate) const ON_PATH: f64 = 0.02;

/// How far the ends of a trajectory may lie from the nodes of its edge, in metres, unless the nodes allow more.
const ENDS: f64 = 0.5;

/// The share of a corridor the vehicle uses to drive round something.
const SHARE: f64 = 0.9;

/// A smaller detour is of no use, in metres.
const DETOUR: f64 = 0.2;

/// How far outside its corridor the vehicle finds itself outside, in metres.
const OUTSIDE: f64 = 0.05;

/// How far `push-out` moves the vehicle, in metres.
const PUSHED: f64 = 1.5;

/// Points of a path round something.
const POINTS: u32 = 48;

impl Agv {
    /// The path over the rest of an edge with a trajectory, or on which it goes another way, from where the vehicle is; `None` on a
    /// straight edge.
    pub(crate) fn curve_ahead(&self, edge: &Edge, stop: &Stop) -> Option<Path> {
        let whole = match &edge.trajectory {
            Some(trajectory) => trajectory.path.clone(),
            None => match self.bow_ahead(edge, stop) {
                Some(granted) => return Some(granted),
                None => self.way_round(edge, stop)?,
            },
        };
        let pose = self.motion.pose(self.moment());
        // What was granted on the way is driven round from here on.
        let nearest = whole.beside(pose.x, pose.y);
        let on_it = nearest.filter(|nearest| self.order.entered && nearest.distance <= ON_PATH);
        let path = match (self.detour(edge), self.requests.way(edge.sequence_id)) {
            (Some(_), Some(way)) => way.clone(),
            (Some(lateral), None) => {
                let rest = on_it.filter(|_| self.has_to_ask(edge)).map(|on| whole.rest(on.made));
                beside(rest.as_ref().unwrap_or(&whole), lateral)
            }
            (None, _) => whole,
        };
        let path = self.bends(edge, path)?;
        let beside = path.beside(pose.x, pose.y)?;
        let rest = if self.order.entered {
            path.rest(beside.made)
        } else {
            path
        };
        let off = rest
            .at(0.0)
            .is_none_or(|begin| pose.distance(begin.x, begin.y) > ON_PATH);
        let begin = off.then_some((pose.x, pose.y));
        let way = begin
            .into_iter()
            .chain(rest.points())
            .chain([(stop.place.x, stop.place.y)]);
        Some(Path::through(way))
    }

    /// The corridor as the vehicle understands it.
    pub(crate) fn corridor(&self, edge: &Edge) -> Option<Corridor> {
        let mut corridor = edge.corridor?;
        self.keeps_to(&mut corridor);
        Some(corridor)
    }

    /// How far to the left (or, negative, to the right) the vehicle drives round what stands on the edge.
    fn detour(&self, edge: &Edge) -> Option<f64> {
        let drives_round = self.obstacles.contains(&edge.id) && self.may_leave(edge);
        self.room_beside(edge).filter(|_| drives_round)
    }

    /// How far to the left (or, negative, to the right) there is room beside an edge.
    pub(crate) fn room_beside(&self, edge: &Edge) -> Option<f64> {
        let corridor = self.corridor(edge)?;
        let taken = if corridor.contour { HALF_WIDTH } else { 0.0 };
        let (left, right) = (corridor.left - taken, corridor.right - taken);
        let room = left.max(right) * SHARE;
        (room >= DETOUR).then_some(if left >= right { room } else { -room })
    }

    /// Whether something stands on the edge that the vehicle may not drive round.
    pub(crate) fn is_blocked(&self, edge: &Edge) -> bool {
        let rounds = match edge.trajectory {
            Some(_) => self.detour(edge).is_some(),
            None => self.granted_bow(edge).is_some(),
        };
        self.obstacles.contains(&edge.id) && !rounds
    }

    /// Stops and reports when it is outside its corridor (CORR-06, CORR-07); whether it has found that just now.
    pub(crate) fn watch_corridor(&mut self) -> bool {
        if self.holds.outside || self.strayed || !self.order.entered {
            return false;
        }
        let Some(edge) = self.order.edge_ahead() else {
            return false;
        };
        let Some((corridor, trajectory)) = self.corridor(edge).zip(edge.trajectory.as_ref()) else {
            return false;
        };
        let pose = self.motion.pose(self.moment());
        let Some(beside) = trajectory.path.beside(pose.x, pose.y) else {
            return false;
        };
        if !self.allows(Permission::Watch(edge, beside.left), true) {
            return false;
        }
        let width = if beside.left { corridor.left } else { corridor.right };
        let taken = if corridor.contour { HALF_WIDTH } else { 0.0 };
        if beside.distance + taken <= width + OUTSIDE {
            return false;
        }
        let name = self.config.errors.outside_of_corridor.clone();
        // Where the version says of its level, that counts.
        let has_level = self.config.error_rules.contains_key(&name);
        let references = has_level.then(|| ("edgeId".to_owned(), edge.id.clone()));
        self.strayed = true;
        let error = ActiveError {
            error_type: name,
            fatal: !has_level,
            references: references.into_iter().collect(),
            description: "the vehicle is outside the corridor of its edge".into(),
            life: Life::WhileOutside,
        };
        self.raise(Cause::Outside, error);
        self.set_holds(|holds| holds.outside = true);
        self.happens(Event::Strayed);
        true
    }

    /// Somebody pushed it to the left of the way it has before it.
    pub(crate) fn push_out(&mut self, by: Option<f64>) {
        let by = by.unwrap_or(PUSHED);
        let moment = self.moment();
        let mut pose = self.motion.pose(moment);
        let ahead = self.order.nodes.front().map(|stop| &stop.place);
        let ahead = ahead.filter(|place| pose.distance(place.x, place.y) > ON_PATH);
        let heading = ahead.map_or(pose.theta, |place| (place.y - pose.y).atan2(place.x - pose.x));
        pose.x -= by * heading.sin();
        pose.y += by * heading.cos();
        self.motion.place(pose);
    }

    /// It was put where it belongs.
    pub(crate) fn is_back(&mut self) {
        self.strayed = false;
        self.errors.back_inside();
        self.set_holds(|holds| holds.outside = false);
    }

    /// Checks the trajectory or the direction of an edge for this vehicle.
    pub(crate) fn check_way(&self, edge: &Edge, ends: Option<(&Node, &Node)>) -> Result<(), Refusal> {
        let unable = |field: &str, reason: &str| {
            let path = format!("{}.{field}", edge.path);
            Err(Refusal::at_field(Rule::Unable, reason, &path).naming("edgeId", &edge.id))
        };
        if let Some(direction) = edge.direction.as_ref().filter(|_| self.config.line_guided())
            && self.branch(&edge.start, direction).is_none()
        {
            return unable("direction", "there is no such branch");
        }
        let Some(trajectory) = edge.trajectory.as_ref().filter(|_| self.config.trajectories) else {
            return Ok(());
        };
        let near = |node: &Node, spot: Option<tck_base::nurbs::Spot>| {
            let allowed = node.position.as_ref().and_then(|position| position.allowed_deviation);
            self.place(node).zip(spot).is_some_and(|(place, spot)| {
                (place.x - spot.x).hypot(place.y - spot.y) <= allowed.unwrap_or_default().max(ENDS)
            })
        };
        let path = &trajectory.path;
        let joins = ends.is_none_or(|(from, to)| near(from, path.at(0.0)) && near(to, path.at(path.length())));
        if !joins {
            return unable("trajectory", "it does not lead from node to node");
        }
        if edge.orientation.is_some() && edge.global {
            return unable("orientation", "the vehicle looks along its trajectory");
        }
        Ok(())
    }

    /// Where a branch of the line leads.
    fn branch(&self, start: &str, direction: &str) -> Option<&str> {
        let branches = self.config.branches.as_ref()?;
        let mut told = branches
            .iter()
            .filter(|(from, other, _)| from == start && other == direction);
        told.next().map(|(.., end)| end.as_str())
    }

    /// Place the vehicle gets to over an edge: a line-guided one to where the branch leads.
    pub(crate) fn arrives_at(&self, edge: Option<&Edge>, node: &Node) -> Option<Place> {
        let branch = edge.and_then(|edge| self.branch(&edge.start, edge.direction.as_deref()?));
        match branch.and_then(|end| self.config.node(end)) {
            Some(end) => Some(Place {
                x: end.x,
                y: end.y,
                map_id: end.map_id.clone(),
            }),
            None => self.place(node),
        }
    }

    /// The node whose mark a line-guided vehicle stands on.
    pub(crate) fn mark_below(&self) -> Option<String> {
        let pose = self.motion.pose(self.moment());
        let mut nodes = self.config.nodes.iter().filter(|_| self.config.line_guided());
        let on = nodes.find(|node| pose.distance(node.x, node.y) <= self.config.reach);
        on.map(|node| node.id.clone())
    }

    /// The path a self-planning vehicle reports for an edge (STATE-14).
    pub(crate) fn planned_path(&self, edge: &Edge) -> Option<Value> {
        if self.has_paths() {
            return self.sent_path(edge);
        }
        if !self.allows(Permission::ReportPath, self.config.plans) {
            return None;
        }
        if let Some(trajectory) = &edge.trajectory {
            return Some(trajectory.sent.clone());
        }
        let stop = |sequence_id: u32| {
            let nodes = self.order.left.0.iter().chain(&self.order.nodes);
            let mut found = nodes.filter(|stop| stop.node.sequence_id == sequence_id);
            found.next().map(|stop| (stop.place.x, stop.place.y))
        };
        let known = |id: &str| self.config.node(id).map(|node| (node.x, node.y));
        let from = stop(edge.sequence_id.checked_sub(1)?).or_else(|| known(&edge.start))?;
        let to = stop(edge.sequence_id + 1)?;
        let points = [from, to];
        let points: Vec<Value> = points
            .iter()
            .map(|(x, y)| json!({ "x": x, "y": y, "weight": 1.0 }))
            .collect();
        Some(json!({ "degree": 1, "knotVector": [0.0, 0.0, 1.0, 1.0], "controlPoints": points }))
    }
}

/// A path that leaves another one by up to so much to the left, and comes back to it.
pub(crate) fn beside(path: &Path, lateral: f64) -> Path {
    let points = (0..=POINTS).filter_map(|step| {
        let part = f64::from(step) / f64::from(POINTS);
        let spot = path.at(path.length() * part)?;
        let off = lateral * (std::f64::consts::PI * part).sin().powi(2);
        Some((spot.x - off * spot.heading.sin(), spot.y + off * spot.heading.cos()))
    });
    Path::through(points)
}
