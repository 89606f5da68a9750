//! The malformed orders of the harness, which no vehicle should take over.
//!
//! A vehicle that does so breaks the refusal alone: what its states show from then on is what we told it, and what they keep of
//! it under a later order is so, too. Instant actions that break the schema are given back in the same way.

use std::collections::VecDeque;

use serde_json::Value;

use crate::observation::Observation;
use crate::orders::OrdersSent;
use crate::setting::Setting;
use tck_pack::Finding;
use tck_view::{ActionView, StateView, Topic};

/// How many orders of either kind are kept.
const MESSAGES: usize = 64;
/// How many actions and values of malformed messages are kept.
const PARTS: usize = 512;

/// Which orders were malformed, and whether a state shows one of them.
#[derive(Debug, Default)]
pub struct MalformedOrders {
    /// orderId, empty where it cannot be read, and orderUpdateId, where it can be.
    broken_ones: VecDeque<(String, Option<u64>)>,
    /// orderId and orderUpdateId of the other orders.
    good: VecDeque<(String, u64)>,
    /// No good order has been shown since one that does not even have a name: in any state, and in those of a vehicle that
    /// master control is in command of.
    nameless: [bool; 2],
    /// actionIds of malformed messages.
    actions: VecDeque<String>,
    /// Values that broke the schema in them.
    values: VecDeque<Value>,
    /// The last order, and whether it is malformed.
    order: Option<(u64, bool)>,
    /// The last state, and whether it shows a malformed order: as any state, and as one in which master control is in command.
    state: Option<(u64, [bool; 2])>,
}

impl MalformedOrders {
    /// Whether this record is an order on its way to the vehicle that no vehicle should take over.
    #[must_use]
    pub fn is_malformed(&self, record: &Observation<'_>) -> bool {
        self.order == Some((record.seq(), true))
    }

    /// Whether this record is a state that shows a malformed order, taken over as if it were none.
    #[must_use]
    pub fn is_shown(&self, record: &Observation<'_>) -> bool {
        self.state.is_some_and(|(seq, shown)| seq == record.seq() && shown[0])
    }

    /// Whether it does so by what was shown while master control was in command.
    #[must_use]
    pub fn is_shown_in_command(&self, record: &Observation<'_>) -> bool {
        self.state.is_some_and(|(seq, shown)| seq == record.seq() && shown[1])
    }

    /// Whether what a state says at this place is what a malformed message said: a value that breaks the schema, or what belongs
    /// to an action of such a message.
    #[must_use]
    pub fn is_echo(&self, state: &Value, path: &str) -> bool {
        let said = state.pointer(path).filter(|said| !said.is_null());
        if said.is_some_and(|said| self.values.contains(said)) {
            return true;
        }
        let mut levels = path.split('/').skip(1);
        let element = levels.next().zip(levels.next());
        let element = element.and_then(|(list, at)| state.get(list)?.get(at.parse::<usize>().ok()?));
        let action = element.and_then(|element| element.get(ActionView::action_id.usual_name())?.as_str());
        action.is_some_and(|action| self.actions.iter().any(|known| known == action))
    }

    /// Whether an order of this name was sent whose number cannot be read, so that nobody can say what it released.
    #[must_use]
    pub fn has_unnumbered(&self, order: &str) -> bool {
        let mut all = self.broken_ones.iter();
        all.any(|(id, number)| id == order && number.is_none())
    }

    /// Keeps in mind what a malformed message says.
    fn note_parts<'m>(
        &mut self,
        document: &Value,
        findings: &[Finding],
        actions: impl Iterator<Item = &'m ActionView>,
    ) {
        let ids = actions.filter_map(|action| action.action_id.text());
        self.actions.extend(ids.take(PARTS).map(str::to_owned));
        self.actions.drain(..self.actions.len().saturating_sub(PARTS));
        let broken = findings.iter().filter_map(|finding| document.pointer(&finding.path));
        let small = |value: &&Value| matches!(value, Value::String(_) | Value::Number(_) | Value::Bool(_));
        self.values.extend(broken.filter(small).take(PARTS).cloned());
        self.values.drain(..self.values.len().saturating_sub(PARTS));
    }

    fn note_instant(&mut self, record: &Observation<'_>, setting: &Setting<'_>) {
        let (Some(document), Some(message)) = (record.json(), record.instant_actions_to_vehicle()) else {
            return;
        };
        let schema = setting.pack.schema(Topic::InstantActions.as_str());
        let findings = schema.map(|schema| schema.findings(document)).unwrap_or_default();
        if !findings.is_empty() {
            self.note_parts(document, &findings, message.all_actions());
        }
    }

    fn note_order(&mut self, record: &Observation<'_>, setting: &Setting<'_>, orders: &OrdersSent) {
        let (Some(document), Some(message)) = (record.json(), record.order_to_vehicle()) else {
            self.order = Some((record.seq(), true));
            return;
        };
        let schema = setting.pack.schema(Topic::Order.as_str());
        let broken = schema.map(|schema| schema.findings(document)).unwrap_or_default();
        let obeys = broken.is_empty();
        let good = orders
            .now(record)
            .filter(|sent| obeys && sent.sound && !sent.order.is_empty());
        self.order = Some((record.seq(), good.is_none()));
        match good {
            Some(sent) => {
                self.good.push_back((sent.order.clone(), sent.update));
                let excess = self.good.len().saturating_sub(MESSAGES);
                self.good.drain(..excess);
            }
            None => {
                self.note_parts(document, &broken, message.actions().map(|(_, action)| action));
                let name = message.order_id.or_empty().to_owned();
                if name.is_empty() {
                    self.nameless = [true; 2];
                }
                // What a vehicle makes of a number of more than 32 bits is its own affair.
                let update = message.order_update_id.whole();
                let update = update.filter(|number| u32::try_from(*number).is_ok());
                self.broken_ones.push_back((name, update));
                let excess = self.broken_ones.len().saturating_sub(MESSAGES);
                self.broken_ones.drain(..excess);
            }
        }
    }

    /// Whether a state shows a malformed order; `which` of the two counts is asked.
    fn shows(&mut self, state: &StateView, which: usize) -> bool {
        if self.broken_ones.is_empty() {
            return false;
        }
        let (order, update) = (state.order_id.or_empty(), state.order_update_id.whole());
        let is_it = |(id, number): &(String, u64)| id == order && Some(*number) == update;
        if !order.is_empty() && self.good.iter().any(is_it) {
            // The one that came last is what the vehicle holds, unless it goes by no name at all.
            self.nameless[which] &= !self.good.back().is_some_and(is_it);
            return false;
        }
        let same = |(id, number): &(String, Option<u64>)| id == order && (number.is_none() || *number == update);
        self.nameless[which] && order.is_empty() || self.broken_ones.iter().any(same)
    }
}

impl MalformedOrders {
    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>, setting: &Setting<'_>, orders: &OrdersSent) {
        if record.is_to_vehicle(Topic::Order) {
            self.note_order(record, setting, orders);
        }
        if record.is_to_vehicle(Topic::InstantActions) {
            self.note_instant(record, setting);
        }
        if let Some(state) = record.state() {
            let is_named = state.order_id.is_there() && state.order_update_id.whole().is_some();
            let in_command = matches!(state.operating_mode.or_empty(), "AUTOMATIC" | "SEMIAUTOMATIC");
            let shown = self.shows(state, 0);
            let in_command = is_named && in_command && self.shows(state, 1);
            self.state = Some((record.seq(), [shown, in_command]));
        }
    }
}
