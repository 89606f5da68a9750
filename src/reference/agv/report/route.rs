//! The way ahead in a state: nodes and edges that are still to be traversed.

use serde_json::{Value, json};

use crate::reference::agv::Agv;
use crate::reference::agv::book::Stop;
use crate::reference::agv::faults::FaultName as F;
use crate::reference::agv::order_message::Edge;
use crate::reference::agv::tolerances::ToleranceName as T;

impl Agv {
    /// `manual-drives-unseen`: drives a way it does not show.
    pub(super) fn hides_route(&self) -> bool {
        !self.mode.takes_orders() && self.faults.has(F::ManualDrivesUnseen)
    }

    pub(super) fn node_states(&self, complete: bool) -> Value {
        let ends_on_next = self.book.cancel.as_ref().is_some_and(|cancel| cancel.to_node);
        if self.hides_route() || (ends_on_next && self.faults.has(F::R1CancelHidesNextNode)) {
            return json!([]);
        }
        let left = self.book.left.0.as_ref().filter(|_| {
            (!complete && self.faults.has(F::TraversedNodesListed))
                || (complete && self.book.has_order() && self.keeps_last_node())
        });
        let shown = self
            .book
            .nodes
            .iter()
            .filter(|stop| stop.node.released || !self.faults.has(F::HorizonNotReported))
            .filter(|stop| !self.sixth.is_hidden(stop.node.sequence_id));
        let mut planned = 0;
        let mut listed: Vec<&str> = Vec::new();
        let shown = shown.filter(|stop| {
            planned += u32::from(!stop.node.released);
            let again = listed.contains(&stop.node.id.as_str());
            listed.push(&stop.node.id);
            !((planned > 1 && self.faults.has(F::R1HorizonCutToOne))
                || (again && self.faults.has(F::R1LoopNodesMerged)))
        });
        let most = match () {
            () if self.faults.has(F::R2RouteListsCapped) => 3,
            () if self.faults.has(F::R4NodeStatesShowTenAtMost) => 10,
            () => usize::MAX,
        };
        let relisted = self.fourth.relisted.iter().filter(|_| !self.book.cancelled);
        let mut listed: Vec<&Stop> = relisted.chain(left).chain(shown).take(most).collect();
        if let Some((_, joint)) = self
            .fourth
            .joints
            .filter(|_| self.faults.has(F::R4UpdatePutsNewNodesInFront))
        {
            // A stable sort: both parts keep their sequence.
            listed.sort_by_key(|stop| stop.node.sequence_id <= joint);
        }
        listed.into_iter().map(|stop| self.node_state(stop)).collect()
    }

    pub(super) fn keeps_last_node(&self) -> bool {
        self.faults.has(F::FinishedOrderListed) || self.faults.has(F::LastRouteListed)
    }

    /// The node traversed last, as if it were still ahead (`route-repeated-on-request`).
    pub(super) fn last_node_state(&self) -> Value {
        let left = self.book.left.0.iter();
        left.map(|stop| self.node_state(stop)).collect()
    }

    pub(super) fn node_state(&self, stop: &Stop) -> Value {
        let node = &stop.node;
        let mut picture = json!({
            "nodeId": node.id,
            "sequenceId": node.sequence_id,
            "released": node.released && !self.stays_planned(node.sequence_id) || self.faults.has(F::HorizonReportedReleased),
        });
        let copied = !node.released && self.faults.has(F::HorizonPositionsCopied);
        let node = self
            .book
            .nodes
            .front()
            .filter(|_| copied)
            .map_or(node, |first| &first.node);
        if let Some(position) = node.sent_position.as_ref().filter(|_| !self.config.line_guided()) {
            picture["nodePosition"] = position.clone();
        } else if self.takes(T::R2NodePositionsFromLayout) && !self.config.line_guided() {
            picture["nodePosition"] = json!({ "x": stop.place.x, "y": stop.place.y, "mapId": stop.place.map_id });
        }
        if self.faults.has(F::R3SequenceIdsAsText) {
            picture["sequenceId"] = json!(node.sequence_id.to_string());
        }
        if self.faults.has(F::NodeStatesWithoutSequence)
            && let Some(fields) = picture.as_object_mut()
        {
            fields.remove("sequenceId");
        }
        picture
    }

    /// `r2-released-not-updated`: what was in the horizon once.
    pub(super) fn stays_planned(&self, sequence_id: u32) -> bool {
        self.faults.has(F::R2ReleasedNotUpdated) && self.book.planned.contains(&sequence_id)
    }

    pub(super) fn edge_states(&self, complete: bool) -> Value {
        if self.hides_route() {
            return json!([]);
        }
        let kept = self.faults.has(F::LastEdgeListed) || self.faults.has(F::LastRouteListed);
        let stays = (self.faults.has(F::EdgeStatesStay) && !complete) || (kept && complete && self.book.has_order());
        let left = self.book.left.1.as_ref().filter(|_| stays);
        let shown = self
            .book
            .edges
            .iter()
            .filter(|edge| edge.released || !self.faults.has(F::HorizonNotReported));
        let entered = self
            .book
            .edge_ahead()
            .filter(|_| self.book.entered)
            .map(|edge| edge.sequence_id);
        let hidden = entered.filter(|_| self.faults.has(F::R1EnteredEdgeUnlisted));
        let shown = shown.filter(|edge| Some(edge.sequence_id) != hidden);
        let next = self.book.edges.front().map(|edge| edge.sequence_id);
        let picture = |edge: &Edge| {
            let far = Some(edge.sequence_id) != next && self.faults.has(F::R1FarEdgesUnreleased);
            let stale =
                self.book.planned.contains(&edge.sequence_id) && self.faults.has(F::R4ReleasedFlagStaleAfterUpdate);
            let released = edge.released && !far && !stale && !self.stays_planned(edge.sequence_id)
                || self.faults.has(F::HorizonReportedReleased);
            let id = if self.faults.has(F::R2EdgeIdMisspelled) {
                "edgeID"
            } else {
                "edgeId"
            };
            let mut picture = json!({
                id: edge.id,
                "sequenceId": edge.sequence_id,
                "released": if self.faults.has(F::R2ReleasedNumeric) { json!(u8::from(released)) } else { json!(released) },
            });
            let unplanned = Some(edge.sequence_id) != next && self.faults.has(F::R2PlannedPathOfNextEdgeOnly);
            if let Some(path) = self.planned_path(edge).filter(|_| !unplanned) {
                picture["trajectory"] = path;
            }
            picture
        };
        let most = if self.faults.has(F::R2RouteListsCapped) {
            3
        } else {
            usize::MAX
        };
        let mut pictures: Vec<Value> = left.into_iter().chain(shown).take(most).map(picture).collect();
        if self.faults.has(F::R3EdgeStatesReversed) {
            pictures.reverse();
        }
        Value::Array(pictures)
    }
}
