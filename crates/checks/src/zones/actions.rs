//! `zones/actions`: the actions of zones have ids of their own and a list of their own, and stay in it.

use std::collections::{BTreeMap, BTreeSet};

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionState, MessageView, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `zones/actions`.
pub(crate) const ZONE_ACTIONS: Check = Check {
    name: "zones/actions",
    decides: &["ZACT-STATE-03", "ZACT-STATE-04", "IACT-STATE-03"],
    doc: "An actionId of zoneActionStates stands in no other list, was sent by nobody, and does not begin again once it \
          has ended; an entry without actionType is a warning. No action stands in actionStates that nobody sent, that was not \
          there before, and that is of a type that a zone asks for which was sent. No entry that has begun goes before a clearZoneActions was sent, and none that has not \
          ended. A restart is left out.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::ToVehicle(Topic::ZoneSet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::zone_action_states],
    start: |_| Box::new(Actions::default()),
};

/// How many actions are kept in mind.
const LIMIT: usize = 4096;

/// How far an action of a zone is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Progress {
    /// Planned: it may never come to that.
    Waits,
    Begun,
    Over,
}

impl Progress {
    fn of(action: &ActionState) -> Self {
        match action.action_status.text() {
            Some("WAITING") => Self::Waits,
            _ if action.is_over() => Self::Over,
            _ => Self::Begun,
        }
    }
}

#[derive(Default)]
struct Actions {
    /// The entries of the last state, and how far they were.
    listed: Option<BTreeMap<String, Progress>>,
    /// actionIds that were sent to the vehicle.
    sent: BTreeSet<String>,
    /// A clearZoneActions was sent since the list was last seen to shrink.
    clearing: bool,
    /// Types of actions that zones ask for.
    asked: BTreeSet<String>,
    /// actionIds of actionStates, since the first state or a restart.
    of_orders: Option<BTreeSet<String>>,
    said: BTreeSet<String>,
}

impl Actions {
    fn hear(&mut self, record: &Observation<'_>) {
        let instant = record.instant_actions_to_vehicle().into_iter();
        let instant = instant.flat_map(|message| message.all_actions());
        let order = record.order_to_vehicle().into_iter();
        let order = order.flat_map(|order| order.actions()).map(|(_, action)| action);
        for action in instant.chain(order) {
            self.clearing |= action.action_type.is("clearZoneActions");
            if self.sent.len() < LIMIT {
                self.sent.insert(action.action_id.or_empty().to_owned());
            }
        }
    }
}

impl Actions {
    /// Learns which types of actions zones ask for.
    fn learn_zones(&mut self, record: &Observation<'_>) {
        let Some(MessageView::ZoneSet(message)) = record.to_vehicle(Topic::ZoneSet) else {
            return;
        };
        let zones = message
            .zone_set
            .there()
            .into_iter()
            .flat_map(|set| set.zones.iter())
            .take(LIMIT);
        let actions = zones.flat_map(|zone| {
            let inside = zone.entry_actions.iter().chain(zone.during_actions.iter());
            inside.chain(zone.exit_actions.iter())
        });
        for action in actions {
            if self.asked.len() < LIMIT {
                self.asked.insert(action.action_type.or_empty().to_owned());
            }
        }
    }

    /// Actions of zones that stand among those of orders.
    fn misplaced(&mut self, state: &StateView, seq: u64, findings: &mut Vec<CheckFinding>) {
        let listed = state.action_states.iter().take(LIMIT);
        let now: BTreeSet<String> = listed.map(|action| action.action_id.or_empty().to_owned()).collect();
        let known = self.of_orders.get_or_insert_with(|| now.clone());
        for action in state.action_states.iter().take(LIMIT) {
            let id = action.action_id.or_empty();
            let is_new = !self.sent.contains(id) && !known.contains(id) && self.sent.len() < LIMIT;
            if is_new && self.asked.contains(action.action_type.or_empty()) && self.said.insert(id.to_owned()) {
                let text = format!(
                    "action {} of type {} stands in actionStates, and no order has it",
                    quote(id),
                    quote(action.action_type.or_empty())
                );
                findings.push(broken("IACT-STATE-03", seq, text));
            }
        }
        if known.len() < LIMIT {
            known.extend(now);
        }
    }
}

impl Running for Actions {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.hear(record);
        self.learn_zones(record);
        if context.world.restarts().now(record) {
            self.listed = None;
            self.of_orders = None;
        }
        let Some(state) = record.state().filter(|state| state.zone_action_states.is_there()) else {
            return false;
        };
        let seq = record.seq();
        self.misplaced(state, seq, findings);
        let mut now = BTreeMap::new();
        for action in state.zone_action_states.iter().take(LIMIT) {
            let id = action.action_id.or_empty();
            let again = now.insert(id.to_owned(), Progress::of(action)).is_some();
            let before = self.listed.as_ref().and_then(|listed| listed.get(id));
            let begun_again = before == Some(&Progress::Over) && !action.is_over();
            let others = state.action_states.iter().chain(state.instant_action_states.iter());
            let mixed = others.into_iter().any(|other| other.action_id.is(id));
            let found = if mixed {
                let text = format!("action {} stands in zoneActionStates and in another list", quote(id));
                Some(broken("IACT-STATE-03", seq, text))
            } else if self.sent.contains(id) || again || begun_again {
                let text = format!("the actionId {} of a zone action is not its own", quote(id));
                Some(broken("ZACT-STATE-03", seq, text))
            } else if action.action_type.is_absent() {
                let text = format!("zone action {} has no actionType", quote(id));
                Some(remark("ZACT-STATE-03", seq, text))
            } else {
                None
            };
            findings.extend(found.filter(|_| self.said.len() < LIMIT && self.said.insert(id.to_owned())));
        }
        let before = self.listed.take();
        let gone = before.iter().flatten().filter(|(id, _)| !now.contains_key(*id));
        // What was only planned goes with the plan.
        let gone: Vec<(&String, &Progress)> = gone.filter(|(_, how)| **how != Progress::Waits).collect();
        for (id, how) in &gone {
            if self.clearing && **how == Progress::Over || self.said.len() >= LIMIT || !self.said.insert((*id).clone())
            {
                continue;
            }
            // It may have ended and been cleared between two states.
            let text = format!("zone action {} is gone, and no clearZoneActions was sent", quote(id));
            if !self.clearing {
                findings.push(broken("ZACT-STATE-04", seq, text));
            }
        }
        if !gone.is_empty() && now.values().all(|how| *how != Progress::Over) {
            self.clearing = false;
        }
        let judged = !now.is_empty() || !gone.is_empty();
        self.listed = Some(now);
        judged
    }
}
