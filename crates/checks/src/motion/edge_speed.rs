//! `motion/edge-speed`: maxSpeed of an edge, by the velocity that is reported and by the way that was made.

use super::{SHARE, found, softly};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Edge, StateView};
use tck_world::{AT_REST, Fact, Listen, Observation, Topic, View};

/// `motion/edge-speed`.
pub(crate) const EDGE_SPEED: Check = Check {
    name: "motion/edge-speed",
    decides: &["ORD-MSG-20", "OPT-01"],
    doc: "On an edge with maxSpeed, neither the reported velocity nor the way between two reported positions says \
          that the vehicle was faster, with a margin of a tenth, 0.05 m/s, and half a second of late reports. The \
          first state after a node may still show the velocity of the edge before.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Edge::max_speed, StateView::position],
    start: |_| Box::new(EdgeSpeed::default()),
};

/// What sensors see wrong, in metres per second.
const NOISE: f64 = 0.05;
/// How late what a state shows may be, in seconds.
const LATE: f64 = 0.5;
/// How far a position may be wrong, in metres.
const SLACK: f64 = 0.2;

#[derive(Default)]
struct EdgeSpeed {
    /// The first state on the present edge.
    entered: Option<View>,
    /// A velocity was reported on it that keeps the limit: what positions say against that is a warning, for a
    /// position may jump when the vehicle finds out where it is.
    kept: bool,
    /// The edge that was complained about.
    accused: Option<(String, u64)>,
}

/// How far the vehicle may have come on the edge it was on at `then`, and how far it did come.
fn advance(then: &View, now: &View, limit: f64) -> Option<(f64, f64)> {
    let lane = then.lane.as_ref()?;
    let from = lane.along(then.pose.as_ref()?)?.made_on_edge();
    let to = lane.along(now.pose.as_ref()?)?.made_on_edge();
    let seconds = now.time_since(then).as_secs_f64();
    Some((limit * SHARE * (seconds + LATE) + SLACK, to - from))
}

impl Running for EdgeSpeed {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(step) = context.world.way().step(record) else {
            return false;
        };
        let now = &step.now;
        // The state that reports the end node still belongs to the edge, as far as positions go.
        let limit_of = |view: &View| view.lane.as_ref().and_then(|lane| lane.demands.max_speed);
        let mut judged = false;
        let mut excess = None;
        if let Some(limit) = limit_of(now).filter(|_| !now.fresh)
            && let Some(speed) = now.velocity.speed()
        {
            judged = true;
            if speed > limit * SHARE + NOISE {
                let text = format!("the vehicle drives at {speed:.2} m/s where the edge permits {limit:.2} m/s");
                excess = Some(found(now.seq, text));
            } else if speed > AT_REST {
                self.kept = true;
            }
        }
        let earlier = [self.entered.as_ref(), step.before.as_ref()];
        for then in earlier.into_iter().flatten() {
            let on_it = now.same_lane(then) || now.node.sequence == then.node.sequence + 2;
            let Some(limit) = limit_of(then).filter(|_| on_it && now.order == then.order) else {
                continue;
            };
            if let Some((possible, made)) = advance(then, now, limit) {
                judged = true;
                if made > possible && excess.is_none() {
                    let seconds = now.time_since(then).as_secs_f64();
                    let text = format!(
                        "the vehicle made {made:.2} m in {seconds:.2} s on an edge that permits {limit:.2} m/s"
                    );
                    excess = Some(if self.kept {
                        softly(now.seq, text)
                    } else {
                        found(now.seq, text)
                    });
                }
            }
        }
        let edge = step
            .before
            .as_ref()
            .filter(|_| now.fresh)
            .map_or(now.node.sequence, |then| then.node.sequence);
        if let Some(excess) = excess {
            let accused = Some((now.order.clone(), edge));
            if self.accused != accused {
                findings.push(excess);
                self.accused = accused;
            }
        }
        if self.entered.as_ref().is_none_or(|entered| !now.same_lane(entered)) {
            self.entered = Some(step.now.clone());
            self.kept = false;
        }
        judged
    }
}
