//! The malformed orders of the harness, which no vehicle should take over.
//!
//! A vehicle that does so breaks the refusal alone: what its states show from then on is what we told it.

use std::collections::VecDeque;

use serde_json::Value;

use crate::members::{kept, number, text};
use crate::observation::Observation;
use crate::orders::OrdersSent;
use crate::setting::Setting;
use crate::topic::Topic;

/// How many orders of either kind are kept.
const MESSAGES: usize = 64;

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

    fn note_order(&mut self, record: &Observation<'_>, setting: &Setting<'_>, orders: &OrdersSent) {
        let Some(message) = record.json() else {
            self.order = Some((record.seq(), true));
            return;
        };
        let schema = setting.pack.schema("order");
        let obeys = schema.is_none_or(|schema| schema.findings(message).is_empty());
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
                let name = kept(message, "orderId");
                if name.is_empty() {
                    self.nameless = [true; 2];
                }
                self.broken_ones.push_back((name, number(message, "orderUpdateId")));
                let excess = self.broken_ones.len().saturating_sub(MESSAGES);
                self.broken_ones.drain(..excess);
            }
        }
    }

    /// Whether a state shows a malformed order; `which` of the two counts is asked.
    fn shows(&mut self, state: &Value, which: usize) -> bool {
        if self.broken_ones.is_empty() {
            return false;
        }
        let (order, update) = (text(state, "orderId"), number(state, "orderUpdateId"));
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
        if let Some(state) = record.state() {
            let is_named =
                state.get("orderId").is_some_and(Value::is_string) && number(state, "orderUpdateId").is_some();
            let in_command = matches!(text(state, "operatingMode"), "AUTOMATIC" | "SEMIAUTOMATIC");
            let shown = self.shows(state, 0);
            let in_command = is_named && in_command && self.shows(state, 1);
            self.state = Some((record.seq(), [shown, in_command]));
        }
    }
}
