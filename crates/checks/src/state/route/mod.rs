//! `state/remaining-route`, `state/last-node`: what a state says about the way, against the order it names.
//!
//! Which order had to be accepted is left to the tests: a state is held against the order whose ids it shows.

use std::collections::BTreeSet;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Element, Fact, Listen, Observation, OrdersSent, SentOrder, Topic, edges_left, nodes_left};

/// `state/remaining-route`.
pub(crate) const REMAINING_ROUTE: Check = Check {
    name: "state/remaining-route",
    decides: &["STATE-12", "STATE-MSG-13", "NODE-03", "ORD-FLOW-09"],
    doc: "nodeStates and edgeStates list, in sequence, exactly what the vehicle has still to traverse of the order \
          whose ids the state shows, horizon included, released as in the order. The first node may be listed or \
          not. None stands there twice behind an update. Not judged after a cancelOrder, a change of mode, a fatal error or a failed action.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Shown, Fact::Orders],
    needs: &[
        StateView::node_states,
        StateView::edge_states,
        StateView::order_update_id,
    ],
    start: |_| Box::new(RemainingRoute::default()),
};

/// `state/last-node`.
pub(crate) const LAST_NODE: Check = Check {
    name: "state/last-node",
    decides: &["STATE-MSG-04", "ORD-01", "ORD-07", "NODE-09"],
    doc: "lastNodeId and lastNodeSequenceId move along the order in its sequence, and never onto a node that was not \
          released, nor, where the version says so, onto one that the order does not have. Not judged in an order of which an update had no number that can be read: that it was taken is the mistake.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Shown, Fact::Orders, Fact::Malformed],
    needs: &[StateView::last_node_id, StateView::last_node_sequence_id],
    start: |_| Box::new(LastNode::default()),
};

#[derive(Default)]
struct RemainingRoute {
    /// orderUpdateIds of the present order that states have shown.
    adopted: BTreeSet<u64>,
    /// The next node was gone before it was the last node: its sequenceId, and what to say if it stays so.
    early: Option<(u64, Vec<CheckFinding>)>,
    of: Option<String>,
    /// The turn of the order whose first node was reached with the last node of the order before.
    arrived: Option<u64>,
}

/// What is right to list at some progress.
struct Remainder<'o> {
    required: Vec<&'o Element>,
    tolerated: Vec<&'o Element>,
}

impl Running for RemainingRoute {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let shown = context.world.shown();
        let Some(state) = shown.state(record) else {
            return false;
        };
        let (Some(update), Some(nodes), Some(edges)) =
            (state.order_update_id.whole(), nodes_left(state), edges_left(state))
        else {
            return false;
        };
        if self.of.as_deref() != shown.order() {
            self.of = shown.order().map(str::to_owned);
            self.adopted.clear();
        }
        if self.adopted.len() < 1024 {
            self.adopted.insert(update);
        }
        let route = Route {
            last: shown.last(),
            is_carried: shown.carried().is_some() && self.arrived != Some(shown.turn()),
            orders: context.world.orders(),
            adopted: &self.adopted,
        };
        let order = state.order_id.or_empty();
        let candidates: Vec<&SentOrder> = route.orders.candidates(order, update).collect();
        // A vehicle that adopts an order it should have refused is the business of the tests.
        if candidates.is_empty() || candidates.iter().any(|sent| !sent.sound) {
            return false;
        }
        let seq = record.seq();
        let best = candidates
            .into_iter()
            .map(|sent| (route.held_against(sent, &nodes, &edges, seq), sent))
            .min_by_key(|(found, _)| found.len());
        let Some((mut found, sent)) = best else { return false };
        let mut progress = route.progress(sent);
        // The new order may name the very node and sequenceId the last one ended with: then an equal last node
        // may be left over, or be progress already. What the lists say decides.
        let reached = route.reached(sent).filter(|_| route.is_carried && !found.is_empty());
        let arrived = reached.is_some_and(|reached| route.held_at(sent, Some(reached), &nodes, &edges, seq).is_empty());
        if arrived {
            found.clear();
            progress = reached;
        }
        if let Some((next, said)) = self.early.take() {
            if progress.is_some_and(|progress| progress >= next) {
                let text = "a node is removed in one state and becomes the last node in another";
                findings.push(remark("NODE-03", seq, text));
            } else {
                findings.extend(said);
            }
        }
        // Everything as if the next node had been reached already: perhaps the next state says so.
        let next = route
            .remainder(sent, progress, |order| &order.nodes)
            .required
            .iter()
            .map(|node| node.sequence)
            .min();
        match next.filter(|_| !found.is_empty() && progress.is_some()) {
            Some(next) if route.held_at(sent, Some(next), &nodes, &edges, seq).is_empty() => {
                self.early = Some((next, found));
            }
            _ => findings.extend(found),
        }
        if arrived {
            self.arrived = Some(shown.turn());
        }
        true
    }
}

/// What a state is held against.
struct Route<'w> {
    /// The last node, and its sequenceId.
    last: Option<&'w (String, u64)>,
    /// Whether that is still of the order before.
    is_carried: bool,
    orders: &'w OrdersSent,
    adopted: &'w BTreeSet<u64>,
}

impl Route<'_> {
    fn held_against(&self, sent: &SentOrder, nodes: &[Element], edges: &[Element], seq: u64) -> Vec<CheckFinding> {
        self.held_at(sent, self.progress(sent), nodes, edges, seq)
    }

    fn held_at(
        &self,
        sent: &SentOrder,
        progress: Option<u64>,
        nodes: &[Element],
        edges: &[Element],
        seq: u64,
    ) -> Vec<CheckFinding> {
        let mut found = Vec::new();
        let remainder = self.remainder(sent, progress, |order| &order.nodes);
        compare("nodeStates", "node", &remainder, nodes, (progress, seq), &mut found);
        self.twice(sent, nodes, seq, &mut found);
        let remainder = self.remainder(sent, progress, |order| &order.edges);
        compare("edgeStates", "edge", &remainder, edges, (progress, seq), &mut found);
        found
    }

    /// What more is broken where an update made the vehicle list a visit twice.
    fn twice(&self, sent: &SentOrder, listed: &[Element], seq: u64, found: &mut Vec<CheckFinding>) {
        if found.is_empty() {
            return;
        }
        let twice = listed
            .iter()
            .enumerate()
            .find(|(at, element)| listed[..*at].iter().any(|other| other.sequence == element.sequence));
        if let Some((_, element)) =
            twice.filter(|_| self.adopted.len() > 1 && self.adopted.last() == Some(&sent.update))
        {
            let text = format!("after an update, nodeStates lists node {} twice", quote(&element.id));
            found.insert(0, broken("ORD-FLOW-09", seq, text));
        }
    }

    /// The sequenceId the vehicle has reached in the order; `None` while it has not begun.
    fn progress(&self, sent: &SentOrder) -> Option<u64> {
        let (node, sequence) = self.last?;
        let is_last = |element: &&Element| element.id == *node && element.sequence == *sequence;
        if self.is_carried {
            return sent.nodes.first().filter(is_last).map(|first| first.sequence);
        }
        self.reached(sent)
    }

    /// The sequenceId of the last node in the order, wherever it comes from.
    fn reached(&self, sent: &SentOrder) -> Option<u64> {
        let (node, sequence) = self.last?;
        let is_last = |element: &&Element| element.id == *node && element.sequence == *sequence;
        let mut known = self.orders.of(&sent.order).filter(|other| other.update <= sent.update);
        known
            .find_map(|other| other.nodes.iter().find(is_last))
            .map(|element| element.sequence)
    }

    fn remainder<'o>(
        &'o self,
        sent: &'o SentOrder,
        progress: Option<u64>,
        list: impl Fn(&'o SentOrder) -> &'o Vec<Element>,
    ) -> Remainder<'o> {
        let first = sent.first();
        let mut all = Remainder {
            required: Vec::new(),
            tolerated: Vec::new(),
        };
        for earlier in self.orders.of(&sent.order) {
            if earlier.update >= sent.update {
                continue;
            }
            let alone = self.orders.candidates(&sent.order, earlier.update).count() == 1;
            let certain = alone && earlier.sound && self.adopted.contains(&earlier.update);
            for element in list(earlier)
                .iter()
                .filter(|element| element.released && element.sequence < first)
            {
                let ahead = progress.is_some_and(|progress| element.sequence > progress);
                if certain && ahead && !all.required.contains(&element) {
                    all.required.push(element);
                } else if progress.is_none() || ahead {
                    all.tolerated.push(element);
                }
            }
        }
        for element in list(sent) {
            match progress {
                Some(progress) if element.sequence > progress => all.required.push(element),
                // The first node is reached already; whether it is listed is open.
                _ if element.sequence == first => all.tolerated.push(element),
                // The edge just left may go one state later.
                Some(progress) if element.sequence + 1 == progress => all.tolerated.push(element),
                Some(_) => {}
                None => all.required.push(element),
            }
        }
        all
    }
}

fn compare(
    name: &str,
    kind: &str,
    right: &Remainder<'_>,
    listed: &[Element],
    (progress, seq): (Option<u64>, u64),
    found: &mut Vec<CheckFinding>,
) {
    if !listed.windows(2).all(|pair| pair[0].sequence < pair[1].sequence) {
        found.push(broken(
            "STATE-12",
            seq,
            format!("{name} is not in the sequence of the order"),
        ));
    }
    let same = |a: &Element, b: &Element| a.id == b.id && a.sequence == b.sequence;
    for element in listed {
        let label = format!("{kind} {} with sequenceId {}", quote(&element.id), element.sequence);
        let mut known = right.required.iter().chain(&right.tolerated);
        match known.find(|other| same(other, element)) {
            Some(other) if other.released != element.released => {
                let text = format!(
                    "{label} is listed with released {}, unlike in the order",
                    element.released
                );
                found.push(broken("STATE-MSG-13", seq, text));
            }
            Some(_) => {}
            None if kind == "node" && progress == Some(element.sequence) => {
                let text = format!("{label} is the last node already and still listed");
                found.push(remark("NODE-03", seq, text));
            }
            None => {
                let text = format!("{name} lists {label}, which is not left to traverse");
                found.push(broken("STATE-12", seq, text));
            }
        }
    }
    for element in &right.required {
        if !listed.iter().any(|other| same(other, element)) {
            let text = format!(
                "{name} lacks {kind} {} with sequenceId {}, which is still to be traversed",
                quote(&element.id),
                element.sequence
            );
            found.push(broken("STATE-12", seq, text));
        }
    }
    // One state tells one story; the first lines of it are enough.
    found.truncate(4);
}

#[derive(Default)]
struct LastNode {
    before: Option<(String, String, u64)>,
    /// Sequence ids the state before still had to reach.
    ahead: Vec<u64>,
}

impl Running for LastNode {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let seq = record.seq();
        let shown = context.world.shown();
        let Some(state) = shown.state(record) else {
            if record.state().is_some() {
                self.before = None;
            }
            return false;
        };
        let (Some(order), Some((node, sequence))) = (shown.order().map(str::to_owned), shown.last().cloned()) else {
            return false;
        };
        // Where a mode may take the last node away, nobody says what the number beside it is then.
        if node.is_empty() && sequence != 0 && !context.pack.has("modesClear") {
            let text = format!("lastNodeSequenceId is {sequence} although there is no last node");
            findings.push(broken("STATE-MSG-04", seq, text));
        }
        let before = self.before.replace((order.clone(), node.clone(), sequence));
        let ahead = nodes_left(state);
        let ahead = ahead.iter().flatten().map(|element| element.sequence).collect();
        let ahead_before = std::mem::replace(&mut self.ahead, ahead);
        let Some((_, node_before, sequence_before)) = before.filter(|before| before.0 == order) else {
            return false;
        };
        if (&node_before, sequence_before) == (&node, sequence) || state.order_id.or_empty().is_empty() {
            return true;
        }
        let sent: Vec<&SentOrder> = context.world.orders().of(&order).collect();
        if sent.is_empty() || sent.iter().any(|sent| !sent.sound || sent.places) {
            return false;
        }
        if context.world.malformed().has_unnumbered(&order) {
            return false;
        }
        let nodes = || sent.iter().flat_map(|sent| &sent.nodes);
        let place = format!("node {} with sequenceId {sequence}", quote(&node));
        let visits: Vec<&Element> = nodes()
            .filter(|element| element.id == node && element.sequence == sequence)
            .collect();
        if visits.is_empty() {
            let text = format!("the last node is {place}, which is not part of the order");
            let known = nodes().any(|element| element.id == node);
            findings.push(match known {
                true => broken("STATE-MSG-04", seq, text),
                false if context.pack.has("lastNodeOfOrder") => broken("NODE-09", seq, text),
                // A vehicle may know nodes on its way that the order leaves out.
                false => remark("STATE-MSG-04", seq, text),
            });
            return true;
        }
        if visits.iter().all(|element| !element.released) {
            findings.push(broken(
                "ORD-07",
                seq,
                format!("the vehicle reached {place}, which was not released"),
            ));
        }
        let was_in_order = nodes().any(|element| element.id == node_before && element.sequence == sequence_before);
        if was_in_order && shown.carried().is_none() && sequence < sequence_before {
            // The node before the order began may carry a higher number of an older order, which may even be the number
            // of the same node in this order; but then this order still has to reach it.
            let begun = nodes().any(|element| element.sequence == sequence_before && element.released)
                && !ahead_before.contains(&sequence_before);
            if begun {
                let text = format!("the last node goes back from sequenceId {sequence_before} to {sequence}");
                findings.push(broken("ORD-01", seq, text));
            }
        }
        true
    }
}

#[cfg(test)]
mod tests;
