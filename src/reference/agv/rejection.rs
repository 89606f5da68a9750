//! Why an order is not taken over, and how the vehicle reports that (section 6.6.4).

use serde_json::Value;

use super::Agv;
use super::actions::{Action, Origin, Status};
use super::errors::{ActiveError, Life};
use super::faults::FaultName as F;
use super::order_message::Order;
use super::read::Defect;
use super::tolerances::ToleranceName as T;

/// Which rule refused an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    Malformed,
    Unable,
    Memory,
    UnknownMap,
    OtherOrderActive,
    StartOutOfRange,
    Outdated,
    BrokenUpdate,
    /// Never raised by a faultless vehicle.
    Duplicate,
}

/// An order that is not taken over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Refusal {
    rule: Rule,
    reason: String,
    /// What in the message is wrong.
    culprits: Vec<(String, String)>,
}

impl Refusal {
    pub(crate) fn new(rule: Rule, reason: &str) -> Self {
        Self {
            rule,
            reason: reason.to_owned(),
            culprits: Vec::new(),
        }
    }

    pub(crate) fn is_malformed(&self) -> bool {
        self.rule == Rule::Malformed
    }

    /// Whether the vehicle has no time for the order.
    pub(crate) fn is_of_busy(&self) -> bool {
        self.rule == Rule::OtherOrderActive
    }

    pub(crate) fn naming(mut self, key: &str, value: impl Into<String>) -> Self {
        self.culprits.push((key.to_owned(), value.into()));
        self
    }

    pub(crate) fn at_field(rule: Rule, reason: &str, path: &str) -> Self {
        Self::new(rule, reason).naming("field", path)
    }
}

impl From<Defect> for Refusal {
    fn from(defect: Defect) -> Self {
        let reason = format!("{} {}", defect.path, defect.reason);
        Self::at_field(Rule::Malformed, &reason, &defect.path)
    }
}

impl Agv {
    /// Reports a refusal; nothing else changes (ORD-FLOW-12).
    pub(crate) fn refuse(&mut self, message: &Value, refusal: Refusal) {
        self.refusal_side_effects(message, refusal.rule);
        self.locked |= refusal.rule == Rule::Unable && self.faults.has(F::OrderErrorLocks);
        let silent = match refusal.rule {
            Rule::StartOutOfRange => self.faults.has(F::StartRefusalSilent),
            Rule::UnknownMap => self.faults.has(F::R1UnknownMapSilent),
            Rule::OtherOrderActive => self.faults.has(F::R1BusyRefusalSilent),
            Rule::Outdated => self.faults.has(F::R1OutdatedUpdateSilent),
            _ => false,
        };
        let silent = silent || self.holds.pause && self.faults.has(F::R3RefusalSilentInPause);
        if silent || self.faults.has(F::RejectionSilent) {
            return;
        }
        let names = &self.config.errors;
        let name = match refusal.rule {
            Rule::Malformed if self.faults.has(F::ValidationErrorMisspelled) => "validationOrder",
            Rule::Malformed
                if self.faults.has(F::R3ActionDefectAsOrderError)
                    && refusal.culprits.iter().any(|(_, path)| path.contains("actions")) =>
            {
                &names.order
            }
            Rule::Malformed => &names.validation,
            Rule::Unable if self.faults.has(F::OrderErrorAsValidation) => &names.validation,
            Rule::Unable => &names.order,
            Rule::Memory if self.takes(T::R1OwnErrorNames) => "insufficientMemory",
            Rule::UnknownMap if self.takes(T::R1OwnErrorNames) => "unknownMapId",
            Rule::OtherOrderActive if self.takes(T::R1OwnErrorNames) => "otherOrderActive",
            Rule::Memory => &names.memory,
            Rule::UnknownMap => &names.unknown_map,
            Rule::OtherOrderActive if self.faults.has(F::BusyRefusalUntyped) => "",
            Rule::OtherOrderActive => &names.other_order_active,
            Rule::StartOutOfRange => &names.start_out_of_range,
            Rule::Outdated if self.faults.has(F::OutdatedUpdateMisnamed) => &names.validation,
            Rule::Outdated | Rule::Duplicate => &names.outdated_update,
            Rule::BrokenUpdate => &names.broken_update,
        };
        let fatal = match refusal.rule {
            Rule::Malformed => self.faults.has(F::ValidationErrorFatal),
            Rule::Unable => self.faults.has(F::OrderErrorFatal),
            Rule::Outdated => self.faults.has(F::OutdatedUpdateFatal),
            _ => false,
        };
        let (early, short) = match refusal.rule {
            Rule::Malformed => (self.faults.has(F::ValidationErrorDroppedEarly), false),
            Rule::Unable => (self.faults.has(F::OrderErrorDroppedEarly), false),
            Rule::Outdated | Rule::BrokenUpdate | Rule::Duplicate => (false, true),
            _ => (false, false),
        };
        let life = match (early, short) {
            (true, _) => Life::Until(self.moment() + super::cancel::MOMENT),
            (_, true) if refusal.rule == Rule::Outdated && self.takes(T::R1OutdatedErrorBrief) => {
                Life::Until(self.moment() + self.brief())
            }
            (_, true) if refusal.rule == Rule::Outdated && self.takes(T::R4OutdatedUpdateWarningUntilNextOrder) => {
                Life::UntilNewOrder
            }
            (_, true) => Life::Until(self.moment() + self.config.error_duration),
            _ => Life::UntilNewOrder,
        };
        let mut references = message_references(message);
        if self.faults.has(F::ReferencesOfLastOrder) {
            for (key, value) in &mut references {
                match key.as_str() {
                    "orderId" => value.clone_from(&self.book.order_id),
                    "orderUpdateId" => *value = self.book.update_id.to_string(),
                    _ => {}
                }
            }
        }
        let of_update = message.get("orderId").and_then(Value::as_str) == Some(self.book.order_id.as_str());
        if of_update && self.book.has_order() && self.faults.has(F::R6OutdatedUpdateNamesCurrentId) {
            let ids = references.iter_mut().filter(|(key, _)| key == "orderUpdateId");
            ids.for_each(|(_, value)| *value = self.book.update_id.to_string());
        }
        if !(refusal.rule == Rule::Unable && self.faults.has(F::R1CulpritUnnamed)) {
            references.extend(refusal.culprits);
        }
        let unjoined = refusal.rule == Rule::BrokenUpdate && self.faults.has(F::R4StitchRejectionWithoutUpdateId);
        if unjoined || self.faults.has(F::UpdateIdUnreferenced) {
            references.retain(|(key, _)| key != "orderUpdateId");
        }
        for (key, value) in &mut references {
            if key == "orderUpdateId" && self.faults.has(F::R3UpdateIdUnderOtherKey) {
                "updateId".clone_into(key);
            }
            if key == "field" && self.takes(T::R3CulpritAsJsonPath) {
                (*key, *value) = ("jsonPath".to_owned(), format!("$.{value}"));
            }
        }
        if self.takes(T::R3ReferencesNameAllNodes) {
            let nodes = message.get("nodes").and_then(Value::as_array).into_iter().flatten();
            let ids = nodes.filter_map(|node| node.get("nodeId")?.as_str()).take(20);
            references.extend(ids.map(|id| ("nodeId".to_owned(), id.chars().take(256).collect())));
        }
        if refusal.rule == Rule::Unable && self.faults.has(F::OrderErrorUnreferenced) {
            references.clear();
        }
        if refusal.rule == Rule::OtherOrderActive && self.faults.has(F::R2BusyRefusalUnreferenced) {
            references.clear();
        }
        let error = ActiveError {
            error_type: name.to_owned(),
            fatal,
            references,
            description: refusal.reason,
            life,
        };
        if self.faults.has(F::R4NewRejectionReplacesOldWarning) {
            self.errors.forget_refused_orders();
        }
        if self.takes(T::R3RefusalInTwoErrors) {
            self.errors.raise(ActiveError {
                error_type: "orderRejected".to_owned(),
                fatal: false,
                ..error.clone()
            });
        }
        self.errors.refused(error, self.now.moment, self.faults);
    }

    /// What a faulty vehicle changes when it refuses an order.
    fn refusal_side_effects(&mut self, message: &Value, rule: Rule) {
        let taken = rule == Rule::Malformed && self.faults.has(F::MalformedTakenOver)
            || rule != Rule::Outdated && self.faults.has(F::RejectedIdReported);
        if let Some(id) = message.get("orderId").and_then(Value::as_str).filter(|_| taken) {
            id.clone_into(&mut self.book.order_id);
        }
        let of_update = matches!(rule, Rule::BrokenUpdate | Rule::Outdated);
        if of_update && self.faults.has(F::R1RejectedUpdateCutsHorizon) {
            let gone = self.book.drop_horizon();
            self.actions.retain(|action| match action.origin {
                Origin::Node(id) | Origin::Edge(id) => !gone.contains(&id),
                Origin::Instant => true,
            });
        }
        let update_id = message.get("orderUpdateId").and_then(Value::as_u64);
        if rule == Rule::BrokenUpdate
            && self.faults.has(F::R1RejectedUpdateIdAdopted)
            && let Some(id) = update_id.and_then(|id| u32::try_from(id).ok())
        {
            self.book.update_id = id;
        }
        self.book.stunned |= rule == Rule::Outdated && self.faults.has(F::R1OutdatedHaltsDriving);
        if self.faults.has(F::RefusalStallsAction) {
            self.actions
                .iter_mut()
                .filter(|action| action.of_order())
                .for_each(|action| action.due = None);
        }
        if self.faults.has(F::RefusedUpdateDropsEdges) {
            self.book.edges.retain(|edge| edge.released);
        }
        if rule == Rule::Malformed {
            if message.is_object() && self.faults.has(F::MalformedStopsOrder) {
                self.give_up_order();
            }
            let without_id = message.is_object() && message.get("orderId").is_none();
            if without_id && self.faults.has(F::MissingIdTakenOver) {
                self.book.order_id.clear();
            }
            if !message.is_object() && self.faults.has(F::UnreadableClearsOrder) {
                self.give_up_order();
                self.book.order_id.clear();
            }
        }
        if rule == Rule::Unable
            && self.faults.has(F::RefusedActionsListed)
            && let Ok(order) = Order::read(message)
        {
            for request in order.actions() {
                let mut action = Action::waiting(request.clone(), None, Origin::Instant);
                action.end(Status::Failed);
                self.actions.push(action);
            }
        }
        if rule == Rule::Unable && self.faults.has(F::R6RejectedUpdateLeavesActions) {
            self.list_actions_of_refused_update(message);
        }
        if rule == Rule::OtherOrderActive && self.faults.has(F::R3BusyRefusalFailsActions) {
            let of_order = self.actions.iter_mut().filter(|action| action.of_order());
            of_order
                .filter(|action| action.status.is_active())
                .for_each(|action| action.end(Status::Failed));
        }
        self.pause_outlives |= self.holds.pause && self.faults.has(F::PauseStuckAfterRefusal);
        if self.faults.has(F::R2RejectionLiftsPause) {
            self.set_holds(|holds| holds.pause = false);
        }
        if self.faults.has(F::RejectionDropsHorizon) {
            self.book.drop_horizon();
        }
        if self.faults.has(F::RejectionClearsActionStates) {
            self.actions
                .retain(|action| !action.of_order() || !action.status.is_terminal());
        }
        if self.faults.has(F::RejectionStopsOrder)
            || (rule == Rule::Outdated && self.faults.has(F::OutdatedUpdateDropsOrder))
        {
            self.give_up_order();
        }
    }
}

/// References that identify the message, as far as it can be read (BP-02).
pub(crate) fn message_references(message: &Value) -> Vec<(String, String)> {
    let mut references = vec![("topic".to_owned(), "order".to_owned())];
    for key in ["headerId", "orderId", "orderUpdateId"] {
        match message.get(key) {
            Some(Value::String(text)) => references.push((key.to_owned(), text.chars().take(256).collect())),
            Some(Value::Number(number)) => references.push((key.to_owned(), number.to_string())),
            _ => {}
        }
    }
    references
}
