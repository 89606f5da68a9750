//! `motion/velocity-axes`, `motion/turn-sign`: the reported velocity, against how the reported pose changes.
//!
//! Whether vx is positive forwards is `motion/velocity-sign`'s, which knows the edge the vehicle is on.

use std::time::Duration;
use tck_journal::event::Event;

use crate::finding::broken;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Member, MessageView, Number, Pose, Position, StateView, Velocity};
use tck_world::{Fact, Listen, Observation, Topic};

/// Messages further apart may leave out a stop or a turn between them.
const CLOSE: Duration = Duration::from_secs(2);
/// A slower vehicle, a shorter way and a smaller turn tell nothing: m/s, rad/s, m, rad.
const DRIVES: f64 = 0.15;
const TURNS: f64 = 0.1;
const WAY: f64 = 0.15;
const TURNED: f64 = 0.08;
/// As far as directions of the same may be apart, and as far as others have to be, in radians.
const ALIKE: f64 = 0.25;
const UNLIKE: f64 = 0.7;
/// How often it has to be wrong, and never right in between.
const TIMES: u32 = 2;

/// `motion/velocity-axes`.
pub(super) const VELOCITY_AXES: Check = Check {
    name: "motion/velocity-axes",
    decides: &["MAP-03"],
    doc: "From one state, or one visualization, to the next of a vehicle that drives without turning, the pose changes in \
          the direction of velocity.vx and vy, seen from the vehicle. Found when it happens twice, never the other way in \
          between, and the velocity fits along the axes of the map, or with vy mirrored. Not judged where a message in between \
          shows the vehicle turned another way.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Visualization),
    ],
    reads: &[Fact::Displaced],
    needs: &[StateView::position, StateView::velocity],
    start: |_| Box::new(Signs::new(axes, "MAP-03").of_straight_ways()),
};

/// `motion/turn-sign`.
pub(super) const TURN_SIGN: Check = Check {
    name: "motion/turn-sign",
    decides: &["MAP-01"],
    doc: "From one state, or one visualization, to the next of a vehicle that turns, theta grows when velocity.omega is \
          positive, and falls when it is negative. Found when it happens twice, never the other way in between.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Visualization),
    ],
    reads: &[Fact::Displaced],
    needs: &[StateView::position, StateView::velocity],
    start: |_| Box::new(Signs::new(turn, "MAP-01")),
};

/// What one message says.
#[derive(Clone, Debug)]
struct Seen {
    at: Moment,
    pose: Pose,
    vx: f64,
    vy: f64,
    omega: f64,
}

impl Seen {
    fn read(at: Moment, position: &Member<Position>, velocity: &Member<Velocity>) -> Option<Self> {
        let velocity = velocity.there()?;
        let sane = |member: &Member<Number>| member.float().filter(|number| number.abs() < 1e6);
        Some(Self {
            at,
            pose: position.there()?.pose()?,
            vx: sane(&velocity.vx)?,
            vy: sane(&velocity.vy).unwrap_or_default(),
            omega: sane(&velocity.omega).unwrap_or_default(),
        })
    }
}

fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let turned = angle.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

/// Whether two messages agree; `None` when they say nothing, `Err` says how they disagree.
type Judge = fn(&Seen, &Seen) -> Option<Result<(), String>>;

fn axes(then: &Seen, now: &Seen) -> Option<Result<(), String>> {
    let straight = |seen: &Seen| seen.omega.abs() < TURNS && seen.vx.hypot(seen.vy) > DRIVES;
    let (way, turned) = now.pose.apart(&then.pose);
    let heading = now.vy.atan2(now.vx);
    let steady = wrapped(heading - then.vy.atan2(then.vx)).abs() < ALIKE;
    if !straight(then) || !straight(now) || !steady || turned > TURNED || way < WAY {
        return None;
    }
    let moved = (now.pose.y - then.pose.y).atan2(now.pose.x - then.pose.x);
    let seen = wrapped(moved - now.pose.theta);
    let far = |direction: f64| wrapped(seen - direction).abs();
    if far(heading) < ALIKE {
        // Along the axes of the map it may look alike, and proves nothing either way.
        return Some(Ok(()));
    }
    let how = if wrapped(moved - heading).abs() < ALIKE {
        "which is along the axes of the map"
    } else if far(-heading) < ALIKE {
        "which is mirrored"
    } else {
        return None;
    };
    (far(heading) > UNLIKE).then(|| {
        Err(format!(
            "velocity is vx {:.2}, vy {:.2}, {how}: the vehicle, at theta {:.2}, moved by ({:.2}, {:.2}) m",
            now.vx,
            now.vy,
            now.pose.theta,
            now.pose.x - then.pose.x,
            now.pose.y - then.pose.y
        ))
    })
}

fn turn(then: &Seen, now: &Seen) -> Option<Result<(), String>> {
    let span = now.at.since(then.at).as_secs_f64();
    let turned = wrapped(now.pose.theta - then.pose.theta);
    let steady = then.omega * now.omega > 0.0 && then.omega.abs().min(now.omega.abs()) > TURNS;
    // Beyond half a turn nobody knows which way round it was.
    let clear = then.omega.abs().max(now.omega.abs()) * span < 2.0;
    if !steady || !clear || turned.abs() < TURNED {
        return None;
    }
    Some(if turned * now.omega > 0.0 {
        Ok(())
    } else {
        Err(format!(
            "omega is {:.2} rad/s while theta changes by {turned:.2} rad",
            now.omega
        ))
    })
}

struct Signs {
    judge: Judge,
    requirement: &'static str,
    /// The last state and the last visualization: they may overtake each other.
    state: Option<Seen>,
    visualization: Option<Seen>,
    /// It drove round a corner where a message of either kind shows it turned another way.
    straight: bool,
    against: u32,
}

impl Signs {
    fn new(judge: Judge, requirement: &'static str) -> Self {
        Self {
            judge,
            requirement,
            state: None,
            visualization: None,
            straight: false,
            against: 0,
        }
    }

    fn of_straight_ways(mut self) -> Self {
        self.straight = true;
        self
    }

    /// Forgets where it was before it was turned like this.
    fn forget_before_corner(&mut self, pose: &Pose) {
        for before in [&mut self.state, &mut self.visualization] {
            if before.as_ref().is_some_and(|seen| seen.pose.apart(pose).1 > TURNED) {
                *before = None;
            }
        }
    }
}

impl Running for Signs {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.displaced().now(record)
            || record.link.disturbed
            || matches!(record.event(), Event::Fault { .. })
        {
            self.state = None;
            self.visualization = None;
        }
        let shown = match record.message() {
            Some(MessageView::State(state)) => Some((&state.position, &state.velocity)),
            Some(MessageView::Visualization(message)) => Some((&message.position, &message.velocity)),
            _ => None,
        };
        if self.straight
            && let Some(pose) = shown.and_then(|(position, _)| position.there()?.pose())
            && record.delivered().is_some()
        {
            self.forget_before_corner(&pose);
        }
        let before = match record.delivered().map(|message| message.topic) {
            Some(Topic::State) => &mut self.state,
            Some(Topic::Visualization) => &mut self.visualization,
            _ => return false,
        };
        let now = shown.and_then(|(position, velocity)| Seen::read(record.at().moment, position, velocity));
        let then = std::mem::replace(before, now.clone());
        let (Some(then), Some(now)) = (then, now) else {
            return false;
        };
        if now.at.since(then.at) > CLOSE || now.pose.map_id != then.pose.map_id {
            return false;
        }
        match (self.judge)(&then, &now) {
            None => false,
            Some(Ok(())) => {
                self.against = 0;
                true
            }
            Some(Err(text)) => {
                self.against += 1;
                if self.against >= TIMES {
                    self.against = 0;
                    findings.push(broken(self.requirement, record.seq(), text));
                    return true;
                }
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

    fn at(x: f64, y: f64, theta: f64, velocity: (f64, f64, f64)) -> Value {
        json!({ "driving": true,
            "agvPosition": { "positionInitialized": true, "x": x, "y": y, "theta": theta, "mapId": "hall" },
            "velocity": { "vx": velocity.0, "vy": velocity.1, "omega": velocity.2 } })
    }

    fn judge(check: &str, states: &[Value]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for state in states {
            trace.state(state).wait(1.0);
        }
        trace.judge(check).summary()
    }

    /// A vehicle that points along y and drives that way.
    fn north(velocity: (f64, f64, f64)) -> Vec<String> {
        let states: Vec<Value> = (0..4).map(|at_| at(1.0, f64::from(at_), 1.57, velocity)).collect();
        judge("motion/velocity-axes", &states)
    }

    #[test]
    fn velocity_along_the_vehicle_is_right_and_along_the_map_is_found() {
        assert!(north((1.0, 0.0, 0.0)).is_empty());
        assert_eq!(north((0.0, 1.0, 0.0)), ["MAP-03"]);
        // It drives backwards, or slips: another matter.
        assert!(north((-1.0, 0.0, 0.0)).is_empty());
        assert!(north((0.7, -0.7, 0.0)).is_empty());
    }

    /// Only the visualizations have a velocity; the states show the corner between two of them.
    #[test]
    fn a_vehicle_that_drove_round_a_corner_and_back_is_not_accused() {
        let seen = |corner: f64| {
            let mut trace = Trace::subscriber();
            for step in 0..4 {
                let x = 2.0 * f64::from(step);
                trace
                    .message("visualization", &at(x, 0.0, 1.57, (2.0, 0.0, 0.0)))
                    .wait(0.5);
                let mut state = at(x + 1.0, 0.0, corner, (2.0, 0.0, 0.0));
                state.as_object_mut().unwrap().remove("velocity");
                trace.message("state", &state).wait(0.5);
            }
            trace.judge("motion/velocity-axes").summary()
        };
        assert_eq!(seen(0.0), Vec::<String>::new());
        assert_eq!(seen(1.57), ["MAP-03"]);
    }

    #[test]
    fn a_sideways_velocity_that_is_mirrored_is_found() {
        let states: Vec<Value> = (0..4)
            .map(|at_| at(1.0, f64::from(at_), 0.0, (0.0, -1.0, 0.0)))
            .collect();
        assert_eq!(judge("motion/velocity-axes", &states), ["MAP-03"]);
    }

    #[test]
    fn a_turn_to_the_left_is_positive() {
        let turns = |omega: f64| {
            let states: Vec<Value> = (0..4)
                .map(|at_| at(1.0, 1.0, 0.4 * f64::from(at_), (0.0, 0.0, omega)))
                .collect();
            judge("motion/turn-sign", &states)
        };
        assert!(turns(0.4).is_empty());
        assert_eq!(turns(-0.4), ["MAP-01"]);
        // So fast that it may have come round the other way.
        assert!(turns(-3.0).is_empty());
    }
}
