//! One leg after the other: how far it leads, how fast, and which way the vehicle looks (section 6.6.6, ORD-MSG-20 to
//! ORD-MSG-25).

use std::f64::consts::{FRAC_PI_2, PI};

use super::hook_points::Permission;
use super::motion::Facing;
use super::order_message::Edge;
use super::order_state::Stop;
use super::progress::ALIGNED;
use super::{Agv, Mode, motion};
use tck_base::nurbs::Path;

/// How far onto an edge the vehicle rolls out before an action that stops it begins, in metres.
const BRAKING: f64 = 0.3;

/// Course of the vehicle to a node.
pub(crate) struct Course<'a> {
    /// The edge, if it needs one.
    pub(crate) edge: Option<&'a Edge>,
    /// The way is no straight line.
    pub(crate) curved: bool,
    /// Straight to the node, in radians.
    pub(crate) straight: f64,
    /// Direction in which the way begins, in radians.
    pub(crate) heading: f64,
    /// It drives backwards.
    pub(crate) backwards: bool,
}

/// One leg of the way, as it is planned.
pub(crate) struct Leg<'a> {
    /// The node it leads to.
    pub(crate) stop: &'a Stop,
    /// Metres to that node.
    pub(crate) distance: f64,
    /// Metres of it that are driven.
    pub(crate) way: f64,
    /// The node counts as reached then.
    pub(crate) to_node: bool,
    /// Speed the edge permits.
    pub(crate) permitted: Option<f64>,
    /// Speed of the vehicle.
    pub(crate) own: f64,
    /// It drives backwards.
    pub(crate) backwards: bool,
    /// Orientation on a curve.
    pub(crate) facing: Facing,
}

impl Leg<'_> {
    /// Whether it is planned to lead to the node itself.
    pub(crate) fn is_whole(&self) -> bool {
        self.to_node && self.way >= self.distance
    }

    /// Ends it so many metres before the node, and counts the node as reached.
    pub(crate) fn end_before(&mut self, metres: f64) {
        self.way = (self.distance - metres).max(self.distance / 2.0);
    }
}

/// Whether the orientation an edge asks for means that it is driven backwards; the edge leads this way.
pub(crate) fn is_backwards(edge: &Edge, heading: f64) -> bool {
    let relative = match edge.orientation {
        Some(orientation) if edge.global => orientation - heading,
        Some(orientation) => orientation,
        None => return false,
    };
    motion::wrapped(relative).abs() > FRAC_PI_2
}

impl Agv {
    /// Rolls towards a node; the actions of an edge that stop the vehicle do so a little way from its begin. Whether it does, or has
    /// just found that it may not.
    pub(crate) fn roll(
        &mut self,
        edge: Option<&Edge>,
        stop: &Stop,
        (distance, backwards): (f64, bool),
        curve: Option<Path>,
    ) -> bool {
        let mut leg = self.leg(edge, stop, distance, backwards);
        let moment = self.moment();
        let pose = self.motion.pose(moment);
        let mut speed = leg.permitted.map_or(leg.own, |permitted| permitted.min(leg.own));
        if self.config.heeds_zones() {
            let way = curve.clone();
            let way = way.unwrap_or_else(|| Path::through([(pose.x, pose.y), (stop.place.x, stop.place.y)]));
            let (wanted, free) = self.releases_ahead(&way.first(leg.way), leg.facing, &pose.map_id);
            let is_new = self.awaits_zones(wanted);
            if let Some(free) = free.filter(|free| *free < leg.way) {
                if free <= ALIGNED {
                    return is_new;
                }
                (leg.way, leg.to_node) = (free, false);
            }
            let Some((free, limit)) = self.way_in_zones(edge, &way.first(leg.way), leg.facing, &pose.map_id) else {
                return self.give_up_node(stop);
            };
            if free < leg.way {
                (leg.way, leg.to_node) = (free, false);
            }
            speed = speed.min(limit);
        }
        if let Some(curve) = curve {
            let part = curve.first(leg.way);
            self.motion.follow(moment, part, speed, leg.facing, leg.to_node);
            return true;
        }
        let (x, y) = (stop.place.x, stop.place.y);
        let part = leg.way / distance;
        let to = if part < 1.0 {
            (pose.x + (x - pose.x) * part, pose.y + (y - pose.y) * part)
        } else {
            (x, y)
        };
        self.motion.roll(moment, to, speed, backwards, leg.to_node);
        true
    }

    fn leg<'a>(&self, edge: Option<&Edge>, stop: &'a Stop, distance: f64, backwards: bool) -> Leg<'a> {
        let stops = edge.is_some_and(|edge| self.stops_on_edge(edge.sequence_id));
        let (way, to_node) = match stops {
            true => (BRAKING.min(distance / 4.0), false),
            false => (distance, true),
        };
        let own = match self.mode {
            Mode::Semiautomatic => self.config.speed / 2.0,
            _ => self.config.speed,
        };
        let mut leg = Leg {
            stop,
            distance,
            way,
            to_node,
            permitted: edge.and_then(|edge| edge.max_speed),
            own,
            backwards,
            facing: Facing::Along(if backwards { PI } else { 0.0 }),
        };
        self.plans(&mut leg);
        leg
    }

    /// Begins to turn. Which way round is the vehicle's own affair.
    pub(crate) fn turn_to(&mut self, theta: f64, edge: Option<&Edge>) {
        let permitted = edge.and_then(|edge| edge.max_rotation_speed);
        let own = self.config.rotation_speed;
        let (moment, speed) = (self.moment(), permitted.map_or(own, |permitted| permitted.min(own)));
        let far = motion::wrapped(theta - self.motion.pose(moment).theta).abs() > 0.5;
        if far && self.allows(Permission::TurnTheLongWay, false) {
            self.motion.turn_round(moment, theta, speed);
        } else {
            self.motion.turn(moment, theta, speed);
        }
    }
}
