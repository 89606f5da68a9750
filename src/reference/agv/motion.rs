//! Where the vehicle is: a pose, and at most one leg (a turn or a straight line) under way.
//!
//! Legs have constant speed; acceleration is ignored. Knows nothing of orders.

use std::f64::consts::PI;
use std::time::Duration;

use crate::clock::Moment;

/// A position and orientation on a map.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pose {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) theta: f64,
    pub(super) map_id: String,
}

impl Pose {
    /// Distance to a point in metres.
    pub(super) fn distance(&self, x: f64, y: f64) -> f64 {
        (self.x - x).hypot(self.y - y)
    }
}

/// An angle brought into -π … π.
pub(super) fn wrapped(angle: f64) -> f64 {
    let turned = angle.rem_euclid(2.0 * PI);
    if turned > PI { turned - 2.0 * PI } else { turned }
}

#[derive(Clone, Debug)]
enum Leg {
    Turn {
        by: f64,
    },
    Roll {
        to: (f64, f64),
        backwards: bool,
        to_node: bool,
    },
}

#[derive(Clone, Debug)]
struct Underway {
    leg: Leg,
    begun: Moment,
    lasts: Duration,
}

/// Velocity in vehicle coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Velocity {
    pub(super) vx: f64,
    pub(super) omega: f64,
}

/// The moving vehicle.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    pose: Pose,
    underway: Option<Underway>,
    /// The node it is heading for is reached, though perhaps not yet traversed.
    pub(super) reached: bool,
}

/// Time for a way at a speed: never endless, and in whole microseconds, as moments are.
fn lasting(way: f64, speed: f64) -> Duration {
    let micros = (way / speed.max(0.001)).clamp(0.0, 1e6) * 1e6;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped above")]
    Duration::from_micros(micros.ceil() as u64)
}

impl Motion {
    /// A vehicle that stands.
    pub(super) fn at(pose: Pose) -> Self {
        Self {
            pose,
            underway: None,
            reached: false,
        }
    }

    /// Whether it drives or turns.
    pub(super) fn is_moving(&self) -> bool {
        self.underway.is_some()
    }

    /// When the present leg ends.
    pub(super) fn end(&self) -> Option<Moment> {
        self.underway.as_ref().map(|underway| underway.begun + underway.lasts)
    }

    /// The pose at a time.
    pub(super) fn pose(&self, now: Moment) -> Pose {
        let mut pose = self.pose.clone();
        let Some(underway) = &self.underway else { return pose };
        let total = underway.lasts.as_secs_f64();
        let part = if total > 0.0 {
            (now.since(underway.begun).as_secs_f64() / total).min(1.0)
        } else {
            1.0
        };
        match underway.leg {
            Leg::Turn { by } => pose.theta = wrapped(pose.theta + by * part),
            Leg::Roll { to, .. } if part >= 1.0 => (pose.x, pose.y) = to,
            Leg::Roll { to, .. } => {
                pose.x += (to.0 - pose.x) * part;
                pose.y += (to.1 - pose.y) * part;
            }
        }
        pose
    }

    /// The velocity now.
    pub(super) fn velocity(&self) -> Velocity {
        let Some(underway) = &self.underway else {
            return Velocity::default();
        };
        let seconds = underway.lasts.as_secs_f64().max(1e-6);
        match underway.leg {
            Leg::Turn { by } => Velocity {
                vx: 0.0,
                omega: by / seconds,
            },
            Leg::Roll { to, backwards, .. } => {
                let speed = self.pose.distance(to.0, to.1) / seconds;
                Velocity {
                    vx: if backwards { -speed } else { speed },
                    omega: 0.0,
                }
            }
        }
    }

    /// Puts the vehicle somewhere.
    pub(super) fn place(&mut self, pose: Pose) {
        *self = Self::at(pose);
    }

    /// It is on another map now.
    pub(super) fn set_map(&mut self, map_id: String) {
        self.pose.map_id = map_id;
    }

    /// Stops at once, where it is.
    pub(super) fn halt(&mut self, now: Moment) {
        self.pose = self.pose(now);
        self.underway = None;
    }

    /// Begins to turn to an orientation, the short way.
    pub(super) fn turn(&mut self, now: Moment, theta: f64, speed: f64) {
        let by = wrapped(theta - self.pose.theta);
        self.underway = Some(Underway {
            leg: Leg::Turn { by },
            begun: now,
            lasts: lasting(by.abs(), speed),
        });
    }

    /// Begins to drive straight to a point.
    pub(super) fn roll(&mut self, now: Moment, to: (f64, f64), speed: f64, backwards: bool, to_node: bool) {
        let lasts = lasting(self.pose.distance(to.0, to.1), speed);
        self.underway = Some(Underway {
            leg: Leg::Roll { to, backwards, to_node },
            begun: now,
            lasts,
        });
    }

    /// Ends the present leg if its time has come; whether the vehicle rolled on it.
    pub(super) fn finish(&mut self, now: Moment) -> Option<bool> {
        self.end().filter(|end| *end <= now)?;
        let (rolled, to_node) = match self.underway {
            Some(Underway {
                leg: Leg::Roll { to_node, .. },
                ..
            }) => (true, to_node),
            _ => (false, false),
        };
        self.halt(now);
        self.reached |= to_node;
        Some(rolled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standing() -> Motion {
        Motion::at(Pose {
            x: 0.0,
            y: 0.0,
            theta: 0.0,
            map_id: "m".into(),
        })
    }

    fn after(millis: u64) -> Moment {
        Moment::START + Duration::from_millis(millis)
    }

    #[test]
    fn a_roll_is_interpolated_and_ends_exactly_at_its_goal() {
        let mut motion = standing();
        motion.roll(Moment::START, (3.0, 4.0), 2.0, false, true);
        assert_eq!(motion.end(), Some(after(2500)));
        let half = motion.pose(after(1250));
        assert!(half.distance(1.5, 2.0) < 1e-9);
        assert_eq!(motion.finish(after(2499)), None);
        assert_eq!(motion.finish(after(2500)), Some(true));
        assert!(motion.reached && !motion.is_moving());
        assert!(motion.pose(after(9000)).distance(3.0, 4.0) < 1e-12);
    }

    #[test]
    fn a_turn_takes_the_short_way() {
        let mut motion = standing();
        motion.turn(Moment::START, -3.0 * PI / 4.0, PI);
        assert!(motion.velocity().omega < 0.0);
        assert_eq!(motion.finish(after(750)), Some(false));
        assert!((motion.pose(after(750)).theta + 3.0 * PI / 4.0).abs() < 1e-9);
    }

    #[test]
    fn a_halt_keeps_the_place_where_it_came() {
        let mut motion = standing();
        motion.roll(Moment::START, (2.0, 0.0), 2.0, true, true);
        assert!((motion.velocity().vx + 2.0).abs() < 1e-6);
        motion.halt(after(250));
        assert!(motion.pose(after(800)).distance(0.5, 0.0) < 1e-9);
        assert!(!motion.reached);
    }

    #[test]
    fn angles_are_wrapped_into_half_turns() {
        for (angle, wanted) in [
            (0.0, 0.0),
            (PI, PI),
            (-PI, PI),
            (3.0 * PI, PI),
            (-0.5 * PI, -0.5 * PI),
            (1.5 * PI, -0.5 * PI),
        ] {
            assert!((wrapped(angle) - wanted).abs() < 1e-9, "{angle}");
        }
    }
}
