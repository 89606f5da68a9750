//! What an id stands for: one nodeId for one place, one actionId for one action.

use std::collections::BTreeMap;

use super::graph::is_counted;
use super::{Command, ELEMENTS, Found, elements, nodes_in_sequence, place_of, short};
use crate::finding::{quote, unclear};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::Event;
use tck_pack::HookInfo;
use tck_view::{ActionView, Element, Node, Print};
use tck_world::{Fact, Listen, Observation, Topic};

/// `commands/node-ids`.
pub(crate) const NODE_IDS: Check = Check {
    name: "commands/node-ids",
    decides: &["ORD-MSG-07"],
    doc: "A nodeId always comes with the same map and position. A position that has moved by less than half a metre may \
          have been corrected by somebody, which is inconclusive, unless it has moved to where the vehicle stands.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[Fact::Mock],
    needs: &[Node::node_id, Node::node_position],
    start: |_| Box::new(NodeIds::default()),
};

/// `commands/action-ids`.
pub(crate) const ACTION_IDS: Check = Check {
    name: "commands/action-ids",
    decides: &["ORD-MSG-17"],
    doc: "An actionId stands for one action, in orders and instant actions together. It may come again where the same \
          action stands in the same place: in a stitching node, or in a message that is sent again. An instant action is sent \
          again as long as no state has shown its end for longer than time.notice; after that its id stands for a second \
          action. Ids are forgotten when the master control is started anew.",
    arguments: &[],
    listens: &[
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::Vehicle,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Mock],
    needs: &[ActionView::action_id],
    start: |_| Box::new(ActionIds::default()),
};

/// How many ids are remembered.
const IDS: usize = 8192;
/// A smaller difference is rounding, in metres.
const SAME: f64 = 0.001;
/// A smaller difference may be a correction, in metres.
const CORRECTED: f64 = 0.5;

#[derive(Default)]
struct NodeIds {
    /// Place of each node.
    known: BTreeMap<String, (f64, f64, String)>,
}

impl Running for NodeIds {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let order = Command::read(record).and_then(Command::order);
        let Some(order) = order else { return false };
        let stands: Vec<(f64, f64)> = context
            .world
            .mock()
            .recent(record, context)
            .filter_map(|seen| seen.pose.as_ref().map(|(x, y, _)| (*x, *y)))
            .collect();
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for node in nodes_in_sequence(order) {
            let (Some(id), Some((x, y, map))) = (short(&node.node_id), place_of(node)) else {
                continue;
            };
            let Some((was_x, was_y, was_map)) = self.known.get_mut(&id) else {
                if self.known.len() < IDS {
                    self.known.insert(id, (x, y, map.chars().take(256).collect()));
                }
                continue;
            };
            judged = true;
            let apart = (x - *was_x).hypot(y - *was_y);
            let other_map = was_map.as_str() != map.chars().take(256).collect::<String>();
            let shown = quote(&id);
            if other_map {
                let text = format!("node {shown} is on map {} and was on {}", quote(map), quote(was_map));
                found.broken("ORD-MSG-07", text);
            } else if apart > CORRECTED {
                found.broken("ORD-MSG-07", format!("node {shown} is {apart:.2} m from where it was"));
            } else if apart > SAME && stands.iter().any(|(at_x, at_y)| (x - at_x).hypot(y - at_y) < SAME) {
                let text = format!("node {shown} is {apart:.3} m from where it was, right where the vehicle stands");
                found.broken("ORD-MSG-07", text);
            } else if apart > SAME {
                let text = format!("node {shown} is {apart:.3} m from where it was, as after a correction");
                found.push(unclear("ORD-MSG-07", record.seq(), text));
            }
            // One change is worth one finding.
            (*was_x, *was_y) = (x, y);
            *was_map = map.chars().take(256).collect();
        }
        judged
    }
}

#[derive(Default)]
struct ActionIds {
    /// Where each action stands, and what it is.
    known: BTreeMap<String, (String, Option<Print>)>,
    /// When a state first showed the end of an action.
    ended: BTreeMap<String, Moment>,
}

impl ActionIds {
    /// Learns from a state which of the actions that were sent have ended.
    fn learn(&mut self, record: &Observation<'_>) {
        let Some(state) = record.said_state() else { return };
        for action in state
            .all_action_states()
            .take(ELEMENTS)
            .filter(|action| action.is_over())
        {
            if let Some(id) = short(&action.action_id).filter(|id| self.known.contains_key(id)) {
                self.ended.entry(id).or_insert(record.at().moment);
            }
        }
    }

    fn forget(&mut self) {
        self.known.clear();
        self.ended.clear();
    }
}

/// Every action of a message with a name for the place where it stands.
fn placed<'c>(command: Command<'c>) -> Vec<(String, &'c ActionView)> {
    let order = match command {
        Command::Instant(_) => {
            let actions = command.actions().into_iter();
            return actions
                .map(|(_, action)| ("an instant action".to_owned(), action))
                .collect();
        }
        Command::Order(order) => order,
    };
    let name = short(&order.order_id).unwrap_or_default();
    let of_element = |element: Element<'c>| {
        let sequence = element.sequence_id().whole().unwrap_or_default();
        let place = format!("order {}, sequenceId {sequence}", quote(&name));
        element.actions().iter().map(move |action| (place.clone(), action))
    };
    elements(order).flat_map(of_element).take(ELEMENTS).collect()
}

impl Running for ActionIds {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        match record.event() {
            Event::Hook { hook, .. } if context.hook(hook).is_some_and(HookInfo::restarts) => self.forget(),
            Event::Answer { .. } => self.forget(),
            _ => {}
        }
        // What its states showed may not have been heard.
        if context.world.mock().is_lost(record) {
            self.ended.clear();
        }
        self.learn(record);
        let Some(command) = Command::read(record) else {
            return false;
        };
        let (now, notice) = (record.at().moment, context.time.notice);
        let mut found = Found::new(record, findings);
        let mut judged = false;
        let counted = command.order().is_none_or(is_counted);
        let mut here: BTreeMap<&str, ()> = BTreeMap::new();
        for (place, action) in placed(command) {
            let Some(id) = short(&action.action_id).filter(|id| !id.is_empty()) else {
                continue;
            };
            judged = true;
            let twice = here.insert(action.action_id.or_empty(), ()).is_some();
            // A stitching node that was changed is the business of another requirement.
            let print = matches!(command, Command::Instant(_)).then_some(action.print);
            if twice {
                found.broken(
                    "ORD-MSG-17",
                    format!("actionId {} comes twice in one message", quote(&id)),
                );
                continue;
            }
            if !counted {
                continue;
            }
            if let Some((known_place, known_print)) = self.known.get(&id) {
                if *known_place != place {
                    let text = format!("actionId {} stands in {place} and stood in {known_place}", quote(&id));
                    found.broken("ORD-MSG-17", text);
                } else if *known_print != print {
                    let text = format!("actionId {} stands for another instant action than before", quote(&id));
                    found.broken("ORD-MSG-17", text);
                } else if print.is_some() && self.ended.get(&id).is_some_and(|ended| now.since(*ended) > notice) {
                    let text = format!(
                        "actionId {} comes again, and the action it stands for has ended",
                        quote(&id)
                    );
                    found.broken("ORD-MSG-17", text);
                }
            } else if self.known.len() == IDS
                && let Some((oldest, _)) = self.known.pop_first()
            {
                self.ended.remove(&oldest);
            }
            self.ended.remove(&id);
            self.known.insert(id, (place, print));
        }
        judged
    }
}
