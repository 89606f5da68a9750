//! `errors/predefined` and `errors/predefined-stay`: errors that the vocabulary of the version names have the level, the references
//! and the length that it gives them.
//!
//! Whether the situation of an error was there is left to the tests.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ErrorView, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// How many errors of a state are looked at.
const ERRORS: usize = 64;
/// How many instant actions of a state are looked at.
const ACTIONS: usize = 256;
/// A list of so many errors may be full, and older ones give way.
const MANY: usize = 12;

/// `errors/predefined`.
pub(super) const PREDEFINED: Check = Check {
    name: "errors/predefined",
    decides: &["ERR-08", "ERR-10"],
    doc: "An error of a type that the vocabulary names has the level that it gives it; one without a reference that it names is a \
          warning. The references of a message that could not be read are not asked for.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::errors],
    start: |_| Box::new(Predefined::default()),
};

/// `errors/predefined-stay`.
pub(super) const STAY: Check = Check {
    name: "errors/predefined-stay",
    decides: &[
        "ERR-09",
        "ORD-REJ-21",
        "ORD-REJ-22",
        "ORD-REJ-24",
        "ORD-REJ-26",
        "IACT-10",
    ],
    doc: "An error that the vocabulary lets stand until a new order, a new instant action or a mode is listed in every state until \
          then: until another orderId or orderUpdateId is shown, the list of instant actions is another one, or the mode takes orders. Not judged over a restart or a change at the vehicle, nor \
          beside a dozen of errors, of which the oldest may give way.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::errors, StateView::order_id],
    start: |_| Box::new(Stay::default()),
};

/// What the vocabulary says of an error.
fn rule<'v>(context: &CheckContext<'v>, error: &ErrorView) -> Option<&'v Value> {
    context
        .pack
        .vocabulary()
        .get("predefinedError")?
        .get(error.error_type.text()?)
}

#[derive(Default)]
struct Predefined {
    /// What was complained about: one complaint per type and kind is enough.
    told: BTreeSet<(String, &'static str)>,
}

impl Running for Predefined {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(state) = record.state() else { return false };
        let mut judged = false;
        for error in state.errors.iter().take(ERRORS) {
            let Some(rule) = rule(context, error) else { continue };
            judged = true;
            let name = error.error_type.or_empty();
            let level = rule.get("level").and_then(Value::as_str).unwrap_or_default();
            if !error.error_level.is(level) && self.told.insert((name.to_owned(), "level")) {
                let text = format!(
                    "the level of {} is {}, not {level}",
                    quote(name),
                    quote(error.error_level.or_empty())
                );
                findings.push(broken("ERR-08", record.seq(), text));
            }
            let wanted = rule.get("references").and_then(Value::as_array);
            let mut wanted = wanted.into_iter().flatten().filter_map(Value::as_str);
            let lacks = wanted.find(|key| error.reference(key).is_none());
            // What could not be read has no ids.
            let unread = matches!(
                name,
                "VALIDATION_FAILURE" | "INSUFFICIENT_MEMORY" | "INVALID_ORDER_ACTION"
            );
            if let Some(key) = lacks.filter(|_| !unread)
                && self.told.insert((name.to_owned(), "reference"))
            {
                let text = format!("{} has no reference {key}", quote(name));
                findings.push(remark("ERR-10", record.seq(), text));
            }
        }
        judged
    }
}

/// An error that has to stay.
struct Standing {
    kind: String,
    references: Vec<(String, String)>,
    until: String,
    since: u64,
}

#[derive(Default)]
struct Stay {
    standing: Vec<Standing>,
    /// The order of the last state.
    order: Option<(String, Option<u64>)>,
    /// The instant actions of the last state.
    instant_actions: Vec<String>,
}

fn references(error: &ErrorView) -> Vec<(String, String)> {
    let all = error.error_references.iter().take(ERRORS);
    all.map(|reference| {
        (
            reference.key.or_empty().to_owned(),
            reference.value.or_empty().to_owned(),
        )
    })
    .collect()
}

/// The requirement that says how long an error of this type stands.
fn about(kind: &str) -> &'static str {
    match kind {
        "OUTDATED_ORDER_UPDATE" | "SAME_ORDER_UPDATE_ID" | "OTHER_ORDER_ACTIVE" => "ORD-REJ-21",
        "MOBILE_ROBOT_NOT_AVAILABLE" => "ORD-REJ-24",
        "START_NODE_OUT_OF_RANGE" => "ORD-REJ-26",
        "NO_ROUTE_TO_TARGET" => "ORD-REJ-22",
        "INVALID_INSTANT_ACTION" => "IACT-10",
        _ => "ERR-09",
    }
}

impl Stay {
    /// Forgets what may end by now.
    fn forget(&mut self, until: &[&str]) {
        self.standing.retain(|error| !until.contains(&error.until.as_str()));
    }
}

impl Running for Stay {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.restarts().now(record) || record.link.disturbed || record.outside_influence() {
            self.standing.clear();
            self.order = None;
        }
        let Some(state) = record.state() else { return false };
        if !state.errors.is_there() {
            return false;
        }
        let order = (state.order_id.or_empty().to_owned(), state.order_update_id.whole());
        if self.order.as_ref().is_some_and(|before| *before != order) {
            self.forget(&["new-order"]);
        }
        let first = self.order.replace(order).is_none();
        let ids = state.instant_action_states.iter().take(ACTIONS);
        let ids: Vec<String> = ids.map(|action| action.action_id.or_empty().to_owned()).collect();
        if ids != self.instant_actions {
            self.forget(&["new-instant-action"]);
            self.instant_actions = ids;
        }
        if matches!(
            state.operating_mode.text(),
            Some("AUTOMATIC" | "SEMIAUTOMATIC" | "INTERVENED")
        ) {
            self.forget(&["mode"]);
        }
        let judged = !self.standing.is_empty();
        let listed: Vec<(&str, Vec<(String, String)>)> = state
            .errors
            .iter()
            .take(ERRORS)
            .map(|error| (error.error_type.or_empty(), references(error)))
            .collect();
        let full = listed.len() >= MANY || self.standing.len() >= MANY;
        let gone = |error: &Standing| {
            !listed
                .iter()
                .any(|(kind, all)| *kind == error.kind && *all == error.references)
        };
        for error in self.standing.iter().filter(|error| !full && gone(error)) {
            let text = format!(
                "{} of #{} is gone, and nothing has come that ends it",
                quote(&error.kind),
                error.since
            );
            findings.push(broken(about(&error.kind), record.seq(), text));
        }
        let before = std::mem::take(&mut self.standing);
        for (error, (kind, all)) in state.errors.iter().zip(listed) {
            let until = rule(context, error).and_then(|rule| rule.get("until")?.as_str());
            let Some(until) = until.filter(|until| matches!(*until, "new-order" | "new-instant-action" | "mode"))
            else {
                continue;
            };
            let known = before
                .iter()
                .find(|known| known.kind == kind && known.references == all);
            let since = known.map_or(record.seq(), |known| known.since);
            // The first state of a run tells nothing about what an error answers.
            if !first && self.standing.len() < ERRORS {
                let (kind, until) = (kind.to_owned(), until.to_owned());
                self.standing.push(Standing {
                    kind,
                    references: all,
                    until,
                    since,
                });
            }
        }
        judged
    }
}
