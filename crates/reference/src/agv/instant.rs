//! Instant actions: read one by one, represented in the action states, performed at once (section 6.9).
//!
//! They stand beside the actions of the order (the ruling of IACT-03), and those of one message are taken in its
//! sequence, whatever their blocking types (that of IACT-07).

use serde_json::Value;

use super::Agv;
use super::action_effect::Problem;
use super::action_kinds::{self, ActionKind, Effect, Scope};
use super::actions::{Action, Origin, Status};
use super::errors::{ActiveError, Life};
use super::hook_points::{Cause, Event, Permission};
use super::order_message::{ActionRequest, Blocking, read_parameters};
use super::read::{Defect, Fields};

/// At most this many instant actions are remembered between two orders; the oldest that have ended give way.
const MAX_REMEMBERED: usize = 500;

impl Agv {
    /// Takes an instantActions message.
    pub(crate) fn instant_actions_received(&mut self, payload: &[u8]) {
        let too_long = payload.len() > self.config.max_message;
        let message = if too_long {
            None
        } else {
            let message = serde_json::from_slice::<Value>(payload).ok();
            message.map(|message| self.understood("instantActions", message))
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
        let mut elements: Vec<&Value> = elements.iter().collect();
        self.reads_instants(&mut elements);
        let limit = self.config.max_instant_actions;
        for element in elements.into_iter().take(limit) {
            if self.allows(Permission::TakeInstant, true) {
                self.instant_action(element);
            }
        }
        self.happens(Event::InstantsRead);
    }

    fn malformed(&mut self, reason: &str) {
        let error = ActiveError {
            error_type: self.config.errors.validation.clone(),
            fatal: false,
            references: vec![("topic".into(), "instantActions".into())],
            description: reason.to_owned(),
            life: Life::UntilNewOrder,
        };
        self.raise(Cause::Unreadable(reason), error);
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
        let instant = |kind: &&ActionKind| kind.scopes.contains(&Scope::Instant);
        let fit = kind.filter(|kind| self.allows(Permission::Fit(kind), instant(kind)));
        let refusal = match (&defect, fit) {
            (Some(defect), _) => Some(format!("{} {}", defect.path, defect.reason)),
            (None, None) => Some("the vehicle does not offer the action as an instant action".to_owned()),
            (None, Some(kind)) => {
                let strict = self.allows(Permission::HeedUnlisted, self.config.has("unlistedRefused"));
                let found = action_kinds::refusal(kind, &request, &self.config, strict);
                found.map(|(key, reason)| format!("{key}: {reason}"))
            }
        };
        if defect.is_some() {
            self.happens(Event::InstantUnreadable);
        }
        self.make_room();
        let action = Action::waiting(request, kind, Origin::Instant);
        self.actions.push(action.clone());
        match refusal {
            Some(reason) if self.allows(Permission::RefuseInstant(&action), true) => {
                self.fail(&id, &Problem::unable(&action, &reason));
            }
            None => {
                let about_maps = |kind: &ActionKind| {
                    matches!(kind.effect, Effect::EnableMap | Effect::DownloadMap | Effect::DeleteMap)
                };
                self.errors.instant_action(kind.is_some_and(about_maps));
                if self.allows(Permission::BeginInstant(&action), true) {
                    self.begin_instant(&id);
                }
            }
            _ => {}
        }
    }

    fn make_room(&mut self) {
        let remembered = self
            .actions
            .iter()
            .filter(|action| action.origin == Origin::Instant)
            .count();
        if remembered < MAX_REMEMBERED {
            return;
        }
        let ended = self
            .actions
            .iter()
            .find(|action| action.origin == Origin::Instant && action.status.is_terminal());
        if let Some(oldest) = ended.map(|action| action.request.id.clone()) {
            self.actions.retain(|action| action.request.id != oldest);
        }
    }

    fn begin_instant(&mut self, id: &str) {
        let lasting = self.actions.get(id).is_some_and(|action| {
            let usual = action.kind.is_some_and(|kind| kind.lasting);
            self.allows(Permission::TakeTime(action), usual)
        });
        self.happens(Event::InstantBegun);
        if lasting {
            self.run_action(id);
        } else {
            self.complete(id);
        }
    }

    /// Begins an instant action that had to wait, if there is one.
    pub(crate) fn begin_waiting_instants(&mut self) -> bool {
        let waits = |action: &&Action| {
            action.origin == Origin::Instant && action.status == Status::Waiting && action.held.is_none()
        };
        let begins = |action: &&Action| waits(action) && self.allows(Permission::BeginInstant(action), true);
        let next = self.actions.iter().find(begins).map(Action::id);
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
        retriable: false,
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
