//! Instant actions: read one by one, represented in the action states, performed at once (section 6.9).

use serde_json::Value;

use super::Agv;
use super::action_kinds::{self, Scope};
use super::actions::{Action, Origin, Status};
use super::deeds::Problem;
use super::errors::{ActiveError, Life};
use super::faults::FaultName as F;
use super::order_message::{ActionRequest, Blocking, read_parameters};
use super::read::{Defect, Fields};
use super::tolerances::ToleranceName as T;

/// At most this many actions of one message are taken.
pub(crate) const MAX_INSTANT_ACTIONS: usize = 50;

/// At most this many instant actions are remembered between two orders; the oldest that have ended give way.
const MAX_REMEMBERED: usize = 500;

impl Agv {
    /// Takes an instantActions message.
    pub(crate) fn instant_actions_received(&mut self, payload: &[u8]) {
        if self.deaf {
            return;
        }
        let too_long = payload.len() > self.config.max_message;
        let message = if too_long {
            None
        } else {
            serde_json::from_slice::<Value>(payload).ok()
        };
        let Some(message) = message else {
            self.malformed("the message is not JSON or too long");
            return;
        };
        let elements = Fields::open(&message, "")
            .ok()
            .and_then(|fields| fields.raw("actions"))
            .and_then(Value::as_array);
        let Some(elements) = elements else {
            self.malformed("the message has no array of actions");
            return;
        };
        if !elements.is_empty() && self.faults.has(F::R2RejectionClearedByInstantAction) {
            self.errors.forget_refusals();
        }
        if self.faults.has(F::LastInstantActionOnly) {
            self.actions
                .retain(|action| action.of_order() || !action.status.is_terminal());
        }
        if self.faults.has(F::InstantActionFadesAway) {
            self.actions
                .retain(|action| action.of_order() || action.status.is_terminal());
        }
        let limit = if self.faults.has(F::OnlyFirstInstantAction) {
            1
        } else {
            self.config.max_instant_actions
        };
        let mut types: Vec<&Value> = Vec::new();
        let mut elements: Vec<&Value> = elements.iter().collect();
        if self.takes(T::R3BatchReversed) {
            elements.reverse();
        }
        for element in elements.iter().copied().take(limit) {
            if let Some(action_type) = element
                .get("actionType")
                .filter(|_| self.faults.has(F::R2SameTypeInMessageDropped))
            {
                if types.contains(&action_type) {
                    continue;
                }
                types.push(action_type);
            }
            self.instant_action(element);
            let id = element.get("actionId").and_then(Value::as_str).unwrap_or_default();
            let failed = self
                .actions
                .get(id)
                .is_some_and(|action| action.status == Status::Failed);
            if failed && self.faults.has(F::R1BatchEndsAtFailure) {
                break;
            }
            let unknown = self.actions.get(id).is_some_and(|action| action.kind.is_none());
            if unknown && self.faults.has(F::R4UnknownActionEndsTheMessage) {
                break;
            }
        }
        if !elements.is_empty() && self.faults.has(F::R2AcknowledgesOnInstantActions) {
            self.acknowledge_instant_actions();
        }
    }

    fn malformed(&mut self, reason: &str) {
        self.malformed_side_effects();
        if self.takes(T::R2UnreadableInstantIgnored) && reason.starts_with("the message") {
            return;
        }
        self.errors.raise(ActiveError {
            error_type: self.config.errors.validation.clone(),
            fatal: false,
            references: vec![("topic".into(), "instantActions".into())],
            description: reason.to_owned(),
            life: Life::UntilNewOrder,
        });
    }

    /// What a faulty vehicle does beside refusing.
    fn malformed_side_effects(&mut self) {
        self.deaf |= self.faults.has(F::MalformedInstantDeafens);
        if self.faults.has(F::MalformedInstantStopsOrder) {
            self.give_up_order();
        }
    }

    fn instant_action(&mut self, element: &Value) {
        let Ok(fields) = Fields::open(element, "actions[]") else {
            self.malformed("an action is not an object");
            return;
        };
        let Ok(id) = fields.id("actionId") else {
            self.malformed("an action has no actionId");
            return;
        };
        if self.actions.get(&id).is_some() {
            // Delivered twice; it is done once.
            return;
        }
        let (request, defect) = read_leniently(&fields, id.clone());
        let kind = action_kinds::find(&self.config, &request.action_type);
        let anywhere = self.faults.has(F::R1InstantScopeUnchecked);
        let fit = kind.filter(|kind| kind.scopes.contains(&Scope::Instant) || anywhere);
        let by_hand = self.mode == super::Mode::Semiautomatic && self.faults.has(F::R1SemiautomaticInstantRefused);
        let fit = fit.filter(|_| !by_hand);
        let fit = fit
            .filter(|kind| kind.deed != action_kinds::Deed::LogReport || !self.faults.has(F::R2LogReportListedRefused));
        let not_understood = |kind: &&action_kinds::ActionKind| {
            kind.deed == action_kinds::Deed::StateRequest && self.faults.has(F::StateRequestListedRefused)
        };
        let fit = fit.filter(|kind| !not_understood(kind));
        let refusal = match (&defect, fit) {
            (Some(defect), _) => Some(format!("{} {}", defect.path, defect.reason)),
            (None, None) => Some("the vehicle does not offer the action as an instant action".to_owned()),
            (None, Some(kind)) => {
                let nodeless = kind.deed == action_kinds::Deed::InitPosition
                    && request.parameter("lastNodeId").is_none()
                    && self.faults.has(F::R2InitPositionWithoutNodeTaken);
                let found = action_kinds::refusal(kind, &request, &self.config, false);
                let found = found.filter(|(key, _)| !(nodeless && key == "lastNodeId"));
                found.map(|(key, reason)| format!("{key}: {reason}"))
            }
        };
        if defect.is_some() {
            self.malformed_side_effects();
        }
        let warned = !self.errors.is_empty() && self.faults.has(F::R4WarningBlocksInstantActions);
        let refusal = refusal.or_else(|| warned.then(|| "there are warnings".to_owned()));
        self.make_room();
        let action = Action::waiting(request, kind, Origin::Instant);
        self.actions.push(action.clone());
        match refusal {
            Some(_) if fit.is_none() && self.faults.has(F::UnknownInstantWaits) => {}
            Some(_) if fit.is_none() && self.faults.has(F::UnknownInstantFinished) => self.finish(&id, None),
            Some(_) if kind.is_none() && self.faults.has(F::R1UnknownInstantWaits) => {}
            Some(_) if fit.is_some() && defect.is_none() && self.faults.has(F::R2BadParameterInstantFinished) => {
                self.finish(&id, None);
            }
            None if !self.downloads.is_idle()
                && self.faults.has(F::R3InstantWaitsForDownload)
                && !matches!(
                    action.request.action_type.as_str(),
                    "startPause" | "stopPause" | "cancelOrder"
                ) => {}
            None if self.is_acting()
                && self.faults.has(F::R2InstantWaitsForRunningAction)
                && !matches!(
                    action.request.action_type.as_str(),
                    "startPause" | "stopPause" | "cancelOrder"
                ) => {}
            None if self.acts_alone() && self.faults.has(F::R6InstantActionWaitsForHardAction) => {}
            None if self.holds.pause
                && self.faults.has(F::R1InstantActionsWaitForPause)
                && !matches!(
                    action.request.action_type.as_str(),
                    "startPause" | "stopPause" | "cancelOrder"
                ) => {}
            Some(reason) => {
                self.take_map_anyway(&action);
                let problem = Problem::unable(&action, &reason);
                if self.takes(T::R1RefusedInstantWithoutError) {
                    self.end_failed(&id, &problem);
                } else {
                    self.fail(&id, &problem);
                }
            }
            None if self.faults.has(F::InstantActionDeferred) && action.request.action_type != "cancelOrder" => {}
            None => self.begin_instant(&id),
        }
    }

    /// Whether an action of the order is under way.
    fn is_acting(&self) -> bool {
        self.actions
            .iter()
            .any(|action| action.of_order() && action.status.is_active())
    }

    /// Whether a HARD action of a node is under way.
    fn acts_alone(&self) -> bool {
        self.actions.iter().any(|action| {
            let of_node = matches!(action.origin, Origin::Node(_));
            of_node && action.request.blocking == Blocking::Hard && action.status.is_active()
        })
    }

    fn make_room(&mut self) {
        let remembered = self.actions.iter().filter(|action| !action.of_order()).count();
        if remembered < MAX_REMEMBERED {
            return;
        }
        let ended = self
            .actions
            .iter()
            .find(|action| !action.of_order() && action.status.is_terminal());
        if let Some(oldest) = ended.map(|action| action.request.id.clone()) {
            self.actions.retain(|action| action.request.id != oldest);
        }
    }

    fn begin_instant(&mut self, id: &str) {
        if self.faults.has(F::UndescribedStatus)
            && let Some(action) = self.actions.get_mut(id)
        {
            action.status = Status::Initializing;
            self.flush();
        }
        let lasting = self
            .actions
            .get(id)
            .and_then(|action| action.kind)
            .is_some_and(|kind| kind.lasting || self.takes_time(kind.deed));
        if lasting {
            self.brake_if_slow(id);
            self.run_action(id);
        } else {
            self.complete(id);
        }
    }

    /// Whether it says RUNNING before an action that others do at once is done.
    fn takes_time(&self, deed: action_kinds::Deed) -> bool {
        use action_kinds::Deed;
        match deed {
            Deed::StartPause if self.motion.is_moving() && self.takes(T::R4BrakesLongOnPause) => true,
            Deed::StartPause | Deed::StopPause => self.takes(T::R2PauseTakesTime),
            Deed::InitPosition => self.takes(T::R2InitPositionTakesTime),
            Deed::EnableMap | Deed::DeleteMap => self.takes(T::R2MapActionsTakeTime),
            _ => false,
        }
    }

    /// `instant-action-deferred`: begins what had to wait for the end of the order.
    pub(crate) fn begin_deferred(&mut self) -> bool {
        let after_pause = self.faults.has(F::R1InstantActionsWaitForPause) && !self.holds.pause;
        let after_order = self.faults.has(F::InstantActionDeferred) && !self.is_busy();
        let after_action = self.faults.has(F::R2InstantWaitsForRunningAction) && !self.is_acting();
        let after_download = self.faults.has(F::R3InstantWaitsForDownload) && self.downloads.is_idle();
        let after_hard = self.faults.has(F::R6InstantActionWaitsForHardAction) && !self.acts_alone();
        if !after_pause && !after_order && !after_action && !after_download && !after_hard {
            return false;
        }
        let waits = |action: &&Action| !action.of_order() && action.status == Status::Waiting;
        let next = self.actions.iter().find(waits).map(|action| action.request.id.clone());
        if let Some(id) = &next {
            self.begin_instant(id);
        }
        next.is_some()
    }
}

/// Reads an instant action whose id is known; what cannot be read is left empty, with the first defect.
fn read_leniently(fields: &Fields<'_>, id: String) -> (ActionRequest, Option<Defect>) {
    let mut request = ActionRequest {
        path: fields.at("actionType"),
        action_type: String::new(),
        id,
        blocking: Blocking::None,
        parameters: Vec::new(),
    };
    let defect = fields
        .id("actionType")
        .map(|action_type| request.action_type = action_type)
        .and_then(|()| {
            fields.optional("blockingType", |fields, key| {
                fields.literal(key, &["NONE", "SOFT", "HARD"])
            })
        })
        .and_then(|_| read_parameters(fields))
        .map(|parameters| request.parameters = parameters);
    (request, defect.err())
}
