//! Where the vehicle is: a pose, and at most one leg (a turn or a straight line) under way (agvPosition and velocity of
//! section 6.10.6).
//!
//! Legs have constant speed; acceleration is ignored. Knows nothing of orders.

use std::f64::consts::{FRAC_PI_2, PI};
use std::time::Duration;

use tck_base::clock::Moment;
use tck_base::nurbs::Path;

/// A position and orientation on a map.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pose {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) theta: f64,
    pub(crate) map_id: String,
}

impl Pose {
    /// Distance to a point in metres.
    pub(crate) fn distance(&self, x: f64, y: f64) -> f64 {
        (self.x - x).hypot(self.y - y)
    }
}

/// An angle brought into the range from -π to π.
pub(crate) fn wrapped(angle: f64) -> f64 {
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
    Follow {
        path: Path,
        facing: Facing,
        to_node: bool,
    },
}

/// Orientation of a vehicle while it follows a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Facing {
    /// How much beside the direction of the path, in radians.
    Along(f64),
    /// Always there, in radians.
    Fixed(f64),
}

impl Facing {
    /// The orientation where the path has this direction.
    pub(crate) fn at(self, heading: f64) -> f64 {
        wrapped(match self {
            Self::Along(turned) => heading + turned,
            Self::Fixed(theta) => theta,
        })
    }
}

#[derive(Clone, Debug)]
struct Underway {
    leg: Leg,
    begun: Moment,
    lasts: Duration,
}

/// Velocity in vehicle coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Velocity {
    pub(crate) vx: f64,
    pub(crate) omega: f64,
}

/// The moving vehicle.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    pose: Pose,
    underway: Option<Underway>,
    /// The node it is heading for is reached, though perhaps not yet traversed.
    pub(crate) reached: bool,
}

/// Time for a way at a speed: never endless, and in whole microseconds, as moments are.
fn lasting(way: f64, speed: f64) -> Duration {
    let micros = (way / speed.max(0.001)).clamp(0.0, 1e6) * 1e6;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped above")]
    Duration::from_micros(micros.ceil() as u64)
}

impl Motion {
    /// A vehicle that stands.
    pub(crate) fn at(pose: Pose) -> Self {
        Self {
            pose,
            underway: None,
            reached: false,
        }
    }

    /// Whether it drives or turns.
    pub(crate) fn is_moving(&self) -> bool {
        self.underway.is_some()
    }

    /// Whether it turns on the spot.
    pub(crate) fn is_turning(&self) -> bool {
        let leg = self.underway.as_ref().map(|underway| &underway.leg);
        matches!(leg, Some(Leg::Turn { .. }))
    }

    /// When the present leg ends.
    pub(crate) fn end(&self) -> Option<Moment> {
        self.underway.as_ref().map(|underway| underway.begun + underway.lasts)
    }

    /// The pose at a time.
    pub(crate) fn pose(&self, now: Moment) -> Pose {
        let mut pose = self.pose.clone();
        let Some(underway) = &self.underway else { return pose };
        let total = underway.lasts.as_secs_f64();
        let part = if total > 0.0 {
            (now.since(underway.begun).as_secs_f64() / total).min(1.0)
        } else {
            1.0
        };
        match &underway.leg {
            Leg::Turn { by } => pose.theta = wrapped(pose.theta + by * part),
            Leg::Roll { to, .. } if part >= 1.0 => (pose.x, pose.y) = *to,
            Leg::Roll { to, .. } => {
                pose.x += (to.0 - pose.x) * part;
                pose.y += (to.1 - pose.y) * part;
            }
            Leg::Follow { path, facing, .. } => {
                if let Some(spot) = path.at(path.length() * part) {
                    (pose.x, pose.y, pose.theta) = (spot.x, spot.y, facing.at(spot.heading));
                }
            }
        }
        pose
    }

    /// The velocity now.
    pub(crate) fn velocity(&self) -> Velocity {
        let Some(underway) = &self.underway else {
            return Velocity::default();
        };
        let seconds = underway.lasts.as_secs_f64().max(1e-6);
        match &underway.leg {
            Leg::Turn { by } => Velocity {
                vx: 0.0,
                omega: by / seconds,
            },
            Leg::Roll { to, backwards, .. } => {
                let speed = self.pose.distance(to.0, to.1) / seconds;
                Velocity {
                    vx: if *backwards { -speed } else { speed },
                    omega: 0.0,
                }
            }
            Leg::Follow { path, facing, .. } => {
                let speed = path.length() / seconds;
                let backwards = matches!(facing, Facing::Along(turned) if turned.abs() > FRAC_PI_2);
                Velocity {
                    vx: if backwards { -speed } else { speed },
                    omega: 0.0,
                }
            }
        }
    }

    /// Puts the vehicle somewhere.
    pub(crate) fn place(&mut self, pose: Pose) {
        *self = Self::at(pose);
    }

    /// It is on another map now.
    pub(crate) fn set_map(&mut self, map_id: String) {
        self.pose.map_id = map_id;
    }

    /// Stops at once, where it is.
    pub(crate) fn halt(&mut self, now: Moment) {
        self.pose = self.pose(now);
        self.underway = None;
    }

    /// Begins to turn to an orientation, the short way.
    pub(crate) fn turn(&mut self, now: Moment, theta: f64, speed: f64) {
        let by = wrapped(theta - self.pose.theta);
        self.underway = Some(Underway {
            leg: Leg::Turn { by },
            begun: now,
            lasts: lasting(by.abs(), speed),
        });
    }

    /// Begins to turn to an orientation, the long way.
    pub(crate) fn turn_round(&mut self, now: Moment, theta: f64, speed: f64) {
        let short = wrapped(theta - self.pose.theta);
        let by = short - 2.0 * PI * short.signum();
        self.underway = Some(Underway {
            leg: Leg::Turn { by },
            begun: now,
            lasts: lasting(by.abs(), speed),
        });
    }

    /// Begins to drive straight to a point.
    pub(crate) fn roll(&mut self, now: Moment, to: (f64, f64), speed: f64, backwards: bool, to_node: bool) {
        let lasts = lasting(self.pose.distance(to.0, to.1), speed);
        self.underway = Some(Underway {
            leg: Leg::Roll { to, backwards, to_node },
            begun: now,
            lasts,
        });
    }

    /// Begins to follow a path.
    pub(crate) fn follow(&mut self, now: Moment, path: Path, speed: f64, facing: Facing, to_node: bool) {
        let lasts = lasting(path.length(), speed);
        self.underway = Some(Underway {
            leg: Leg::Follow { path, facing, to_node },
            begun: now,
            lasts,
        });
    }

    /// Ends the present leg if its time has come; whether the vehicle rolled on it.
    pub(crate) fn finish(&mut self, now: Moment) -> Option<bool> {
        self.end().filter(|end| *end <= now)?;
        let (rolled, to_node) = match self.underway {
            Some(Underway {
                leg: Leg::Roll { to_node, .. } | Leg::Follow { to_node, .. },
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
    fn a_path_is_followed_looking_along_it_or_always_the_same_way() {
        let path = Path::through([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)]);
        for (facing, theta) in [
            (Facing::Along(0.0), PI / 2.0),
            (Facing::Along(PI), -PI / 2.0),
            (Facing::Fixed(0.3), 0.3),
        ] {
            let mut motion = standing();
            motion.follow(Moment::START, path.clone(), 2.0, facing, true);
            let pose = motion.pose(after(1500));
            assert!(pose.distance(2.0, 1.0) < 1e-9 && (pose.theta - theta).abs() < 1e-9);
            assert_eq!(motion.velocity().vx < 0.0, facing == Facing::Along(PI));
            assert_eq!(motion.finish(after(2000)), Some(true));
            assert!(motion.reached && motion.pose(after(3000)).distance(2.0, 2.0) < 1e-9);
        }
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
