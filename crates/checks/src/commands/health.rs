//! `commands/health`: what the connection topic must not be taken for.
//!
//! An order that is sent to a vehicle with an error proves nothing about the connection topic: the same master control
//! may send it without any event there. One that was kept back, and comes when nothing but the connection has changed,
//! does.

use std::collections::BTreeSet;

use super::{Command, ELEMENTS, short};
use crate::finding::quote;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::Event;
use tck_pack::HookEffect;
use tck_view::{ConnectionView, OrderView, StateView};
use tck_world::{Listen, Observation, Topic};

/// What the connection topic must not be taken for.
pub(crate) const HEALTH: Check = Check {
    name: "commands/health",
    decides: &["CONN-14"],
    doc: "An order that was kept back because the states of the vehicle show a FATAL error, or another order, does not \
          come because the vehicle is ONLINE again, with the same states as before.",
    arguments: &[],
    listens: &[
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Sent(Topic::Connection),
        Listen::Delivered(Topic::Order),
    ],
    reads: &[],
    needs: &[StateView::errors, ConnectionView::connection_state, OrderView::order_id],
    start: |_| Box::new(Health::default()),
};

/// How many orders are remembered.
const KEPT: usize = 1024;

#[derive(Default)]
struct Health {
    orders: BTreeSet<String>,
    /// Why no order can be begun, by the states: the error, or the order the vehicle has.
    reason: Option<String>,
    /// Since when a transport is kept back for it.
    waits: Option<Moment>,
    /// Whether the vehicle has come online since.
    online: bool,
}

/// Why the vehicle cannot begin an order.
fn reason(state: &StateView) -> Option<String> {
    let mut errors = state.errors.iter().take(ELEMENTS);
    if let Some(error) = errors.find(|error| error.error_level.is("FATAL")) {
        return Some(format!("the FATAL error {}", quote(error.error_type.or_empty())));
    }
    let mut base = state.node_states.iter().take(ELEMENTS);
    let driven = base.any(|node| node.released.is(true));
    driven.then(|| format!("order {}", quote(state.order_id.or_empty())))
}

impl Running for Health {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let now = record.at().moment;
        if let Event::Hook { hook, ok: true, .. } = record.event()
            && context
                .hook(hook)
                .is_some_and(|hook| hook.has(HookEffect::OrdersTransport))
            && self.reason.is_some()
        {
            self.waits.get_or_insert(now);
        }
        if let Some(state) = record.said_state() {
            let reason = reason(state);
            if reason != self.reason {
                (self.waits, self.online) = (None, false);
                self.reason = reason;
            }
        }
        if let Some(connection) = record.said_connection()
            && Some(connection.connection_state.or_empty()) == context.pack.word("connection.online")
            && self.waits.is_some_and(|since| now.since(since) >= context.time.notice)
        {
            self.online = true;
        }
        let order = Command::read(record).and_then(Command::order);
        let Some(id) = order.and_then(|order| short(&order.order_id)) else {
            return false;
        };
        let fresh = !self.orders.contains(&id);
        if self.orders.len() < KEPT {
            self.orders.insert(id.clone());
        }
        if !fresh {
            return false;
        }
        let kept_back = self.waits.take().is_some() && std::mem::take(&mut self.online);
        if let Some(reason) = self.reason.as_ref().filter(|_| kept_back) {
            let text = format!(
                "order {} was kept back for {reason}, and comes because the vehicle is ONLINE again",
                quote(&id)
            );
            super::Found::new(record, findings).broken("CONN-14", text);
        }
        true
    }
}
