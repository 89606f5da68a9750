//! `zones/line-guided`: in a zone of type `LINE_GUIDED` the vehicle keeps to the trajectory of its edge.

use std::collections::BTreeSet;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Edge, StateView};
use tck_world::ordered::curve;
use tck_world::{Fact, Listen, Observation, Topic};

use super::drives_by_order;
use tck_base::nurbs::Path;

/// `zones/line-guided`.
pub(crate) const LINE_GUIDED: Check = Check {
    name: "zones/line-guided",
    decides: &["ZONE-07", "ZINT-02"],
    doc: "A vehicle whose kinematic centre is inside a LINE_GUIDED zone is on the trajectory of one of the edges of its \
          order, within 0.3 m; up to twice that is a warning. Edges with a corridor, and orders \
          without any trajectory, for which a vehicle may have its own, are not judged. Where a PRIORITY, PENALTY, DIRECTED or \
          COORDINATED_REPLANNING zone lies there as well, it is about ZINT-02, too.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::ZoneSet),
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Factsheet),
        Listen::Stored(Topic::Factsheet),
        Listen::Hook,
        Listen::Answer,
        Listen::Connect,
    ],
    reads: &[Fact::Zones],
    needs: &[StateView::zone_sets, StateView::position, Edge::trajectory],
    start: |_| Box::new(Lines::default()),
};

/// How far from its trajectory a vehicle may be, in metres.
const BESIDE: f64 = 0.3;
/// The types of zones that it overrules.
const OVERRULED: [&str; 4] = ["PRIORITY", "PENALTY", "DIRECTED", "COORDINATED_REPLANNING"];
/// How many edges of an order are kept in mind.
const EDGES: usize = 128;

#[derive(Default)]
struct Lines {
    order: String,
    paths: Vec<Path>,
    /// An edge has a corridor, within which the trajectory may be left.
    loosened: bool,
    said: BTreeSet<String>,
}

impl Running for Lines {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if let Some(order) = record.order_to_vehicle() {
            let id = order.order_id.or_empty();
            if self.order != id {
                id.clone_into(&mut self.order);
                self.paths.clear();
                self.loosened = false;
            }
            let edges = order.edges.iter().take(EDGES);
            for edge in edges {
                let path = curve(&edge.trajectory)
                    .and_then(|(curve, _)| curve)
                    .map(|curve| curve.path());
                self.paths.extend(path.filter(|_| self.paths.len() < EDGES));
                self.loosened |= edge.corridor.presence().is_something();
            }
        }
        let Some(state) = record.state() else { return false };
        let zones = context.world.zones();
        let Some(now) = zones.places().1 else { return false };
        let of_order = state.order_id.is(&self.order) && drives_by_order(state);
        if !of_order || self.paths.is_empty() || self.loosened || !state.driving.is(true) {
            return false;
        }
        let mut judged = false;
        for zone in zones
            .in_force(now.pose.map_id.as_str())
            .filter(|zone| zone.is("LINE_GUIDED"))
        {
            if zones.centre(zone, now).is_none_or(|depth| depth <= 0.0) {
                continue;
            }
            judged = true;
            let beside = self.paths.iter().filter_map(|path| path.beside(now.pose.x, now.pose.y));
            let beside = beside.map(|beside| beside.distance).fold(f64::INFINITY, f64::min) - now.off;
            if beside <= BESIDE || !self.said.insert(zone.name().to_owned()) {
                continue;
            }
            let message = format!(
                "in the LINE_GUIDED zone {} the vehicle is {beside:.2} m beside its trajectory",
                quote(zone.name())
            );
            let mut here = zones.in_force(now.pose.map_id.as_str());
            let overrules =
                here.any(|other| OVERRULED.iter().any(|kind| other.is(kind)) && other.area.touches(&zone.area));
            for id in ["ZONE-07"].into_iter().chain(overrules.then_some("ZINT-02")) {
                findings.push(match beside > 2.0 * BESIDE {
                    true => broken(id, record.seq(), message.clone()),
                    false => remark(id, record.seq(), message.clone()),
                });
            }
        }
        judged
    }
}
