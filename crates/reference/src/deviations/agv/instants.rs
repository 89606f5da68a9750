//! Deviations of instant actions: which are read, refused, begun, and when (section 6.9).

use crate::agv::action_kinds::Scope;
use crate::agv::order_message::Blocking;
use crate::agv::{Mode, action_kinds};
use crate::{Output, Publication};

use super::prelude::*;

records! {
    fault "state-request-listed-refused" ["FACT-07", "ACT-26"] "Does not understand stateRequest although its factsheet lists it."
        => forbidding(|_, what| matches!(what, Permission::Fit(kind) if kind.effect == Effect::StateRequest));
    fault "log-report-listed-refused" ["FACT-07", "ACT-01"] "logReport is listed in the factsheet and FAILED as unknown when it is sent."
        => forbidding(|_, what| matches!(what, Permission::Fit(kind) if kind.effect == Effect::LogReport));
    fault "instant-scope-unchecked" ["ACT-10"] "It performs an action as an instant action that is for nodes only, such as pick."
        => letting(|_, what| matches!(what, Permission::Fit(_)));
    fault "semiautomatic-instant-refused" ["MODE-02"] "In SEMIAUTOMATIC it takes orders but reports every instant action FAILED."
        => forbidding(|agv, what| matches!(what, Permission::Fit(_)) && agv.mode == Mode::Semiautomatic);
    fault "warning-blocks-instant-actions" ["ERR-03", "IACT-05"] "It answers every instant action with FAILED as long as a warning is in its errors."
        => forbidding(|agv, what| matches!(what, Permission::Fit(_)) && !agv.errors.is_empty());
    fault "init-position-without-node-taken" ["ACT-25", "ACT-24"] "initPosition without lastNodeId is FINISHED and clears lastNodeId."
        because "The ruling of ACT-25 fails an unknown map and a missing parameter only; that nobody can know the node is warned of."
        => forbidding(|_, what| matches!(what, Permission::RefuseInstant(action) if is(action, Effect::InitPosition) && action.request.parameter("lastNodeId").is_none()));
    fault "bad-parameter-instant-finished" ["IACT-06", "ACT-25"] "An instant action with a missing or wrong parameter is FINISHED although nothing was done."
        => unrefused(|agv, action| {
            let fit = action.kind.filter(|kind| kind.scopes.contains(&Scope::Instant));
            fit.is_some_and(|kind| action_kinds::refusal(kind, &action.request, &agv.config, false).is_some())
        });
    fault "unlisted-instant-parameter-ignored" ["OPT-06"] "Does an instant action with a parameter that its factsheet does not list as if that were not there."
        because "The ruling of OPT-06 is a warning."
        => forbidding(|_, what| matches!(what, Permission::HeedUnlisted));
    fault "unknown-instant-finished" ["IACT-04", "IACT-06"] "Reports an instant action it does not know as FINISHED."
        => unrefused(|_, action| is_unfit(action));
    fault "unknown-instant-waits" ["IACT-06", "IACT-04"] "Leaves an instant action it does not know WAITING for ever."
        => waiting(|_, action| is_unfit(action));
    fault "malformed-instant-deafens" ["IACT-03"] "Takes no instant actions any more once one of them was malformed."
        => keep::<bool>()
            .happens(|deaf, _, event| *deaf = match event {
                Event::InstantUnreadable => true,
                Event::PowerCycled => false,
                _ => *deaf,
            })
            .raises(|deaf, _, cause, _| {
                *deaf |= matches!(cause, Cause::Unreadable(_));
                true
            })
            .hears(|deaf, _, name, _| name != "instantActions" || !*deaf);
    fault "instant-list-of-version-1-1" ["IACT-03", "ORD-CANCEL-07", "ACT-26", "TOPIC-11"] "It looks for instant actions under the name that version 1.1 had for their list, and reports that it misses it."
        => plain().hears(|(), agv, name, payload| {
            let message = serde_json::from_slice::<Value>(payload).unwrap_or_default();
            let lacks = name == "instantActions" && message.get("instantActions").is_none();
            if lacks {
                agv.errors.raise(ActiveError {
                    error_type: agv.config.errors.validation.clone(),
                    fatal: false,
                    references: vec![("topic".into(), "instantActions".into())],
                    description: "must have required property 'instantActions'".to_owned(),
                    life: Life::UntilNewOrder,
                });
            }
            !lacks
        });
    fault "malformed-instant-stops-order" ["ORD-06"] "Gives its order up when an instant action is malformed."
        => when(Event::InstantUnreadable, |agv| agv.give_up_order()).raises(|_, agv, cause, _| {
            if matches!(cause, Cause::Unreadable(_)) {
                agv.give_up_order();
            }
            true
        });
    fault "instant-action-fades-away" ["STATE-MSG-10", "STATE-MSG-11", "STATE-MSG-09"] "Removes running instant actions from its states when another one arrives."
        => batch(|agv, _| agv.actions.retain(|action| action.of_order() || action.status.is_terminal()));
    fault "last-instant-action-only" ["STATE-MSG-10", "STATE-MSG-09"] "Removes finished instant actions from its states when another one arrives."
        => batch(|agv, _| agv.actions.retain(|action| action.of_order() || !action.status.is_terminal()));
    fault "only-first-instant-action" ["IACT-07", "IACT-03"] "Performs only the first action of an instantActions message."
        => batch(|_, actions| actions.truncate(1));
    fault "same-type-in-message-dropped" ["IACT-07", "IACT-03"] "Of several actions of one type in an instantActions message only the first is taken."
        => batch(|_, actions| {
            let mut types: Vec<&Value> = Vec::new();
            actions.retain(|action| {
                let kind = action.get("actionType");
                let again = kind.is_some_and(|kind| types.contains(&kind));
                types.extend(kind);
                !again
            });
        });
    fault "batch-ends-at-failure" ["IACT-07", "IACT-03"] "It drops the rest of an instantActions message behind an action that has failed."
        => ending_batch(|_| true);
    fault "unknown-action-ends-the-message" ["IACT-07", "IACT-03"] "It stops reading an instantActions message at an action that it does not know, so that the following ones get no state."
        => ending_batch(|action| action.kind.is_none());
    fault "rejection-cleared-by-instant-action" ["ORD-REJ-03", "ORD-REJ-08"] "Any instantActions message clears the warnings of rejected orders."
        => batch(|agv, actions| if !actions.is_empty() { agv.errors.forget_refusals() });
    fault "acknowledges-on-instant-actions" ["TOPIC-15"] "The vehicle answers every instantActions message with an empty message of its own on the same topic."
        => batch(|agv, actions| if !actions.is_empty() { acknowledge(agv) });
    fault "instant-actions-among-those-of-orders" ["IACT-STATE-03", "STATE-MSG-09"] "It lists instant actions among the actions of its order, and leaves their own list empty."
        => state(|_, m| if let Some(Value::Array(instant)) = m.get_mut("instantActionStates") {
            let instant = std::mem::take(instant);
            if let Some(Value::Array(all)) = m.get_mut("actionStates") {
                all.extend(instant);
            }
        });
    fault "instant-actions-gone-with-new-order" ["IACT-STATE-02", "IACT-STATE-01"] "A new order empties the list of instant actions that have ended."
        => when(Event::Begun, |agv| agv.actions.retain(|action| action.of_order() || !action.status.is_terminal()));
    fault "clearing-keeps-failed-instants" ["IACT-STATE-04"] "clearInstantActions removes what is FINISHED and leaves what is FAILED."
        => instead(Effect::ClearInstantActions, |agv, _| {
            agv.actions.retain(|action| action.of_order() || action.status != Status::Finished);
            Some(Outcome::Done(None))
        });
    fault "clearing-takes-all-instants" ["IACT-STATE-05"] "clearInstantActions removes instant actions that are still running, too."
        => instead(Effect::ClearInstantActions, |agv, own| {
            let own = own.id();
            agv.actions.retain(|action| action.of_order() || action.request.id == own);
            Some(Outcome::Done(None))
        });
    fault "retry-is-a-word" ["RETRY-03"] "retry is FINISHED, and the action that it names goes on waiting."
        => instead(Effect::Retry, |_, _| Some(Outcome::Done(None)));
    fault "skip-retry-is-a-word" ["RETRY-04"] "skipRetry is FINISHED, and the action that it names goes on waiting."
        => instead(Effect::SkipRetry, |_, _| Some(Outcome::Done(None)));
    fault "retry-of-anything-finished" ["RETRY-05"] "retry of an action that waits for none is FINISHED." because "It breaks a recommendation only."
        => after(Effect::Retry, |_, _, _| Outcome::Done(None));
    fault "retriable-does-not-count" ["RETRY-07"] "It takes a new order while an action of the one before waits for a retry."
        => forbidding(|_, what| matches!(what, Permission::Count(action) if action.status == Status::Retriable));
    fault "instant-action-deferred" ["IACT-05"] "Begins instant actions other than cancelOrder only when its order is complete."
        => deferring(|agv, action| agv.is_busy() && !is(action, Effect::CancelOrder));
    fault "instant-actions-wait-for-pause" ["IACT-05"] "While it is paused it holds back instant actions until the pause is lifted."
        => deferring(|agv, action| agv.holds.pause && !is_urgent(action));
    fault "instant-waits-for-running-action" ["IACT-05"] "As long as an action of the order is under way instant actions wait, except pause and cancelOrder."
        => deferring(|agv, action| is_acting(agv) && !is_urgent(action));
    fault "instant-waits-for-download" ["IACT-05"] "It leaves instant actions WAITING until a map download under way has ended."
        => deferring(|agv, action| !agv.downloads.is_idle() && !is_urgent(action));
    fault "instant-action-waits-for-hard-action" ["IACT-05", "IACT-04"] "It holds instant actions back until a running HARD node action has ended."
        => deferring(|agv, _| {
            let hard = |action: &Action| matches!(action.origin, Origin::Node(_)) && action.request.blocking == Blocking::Hard;
            agv.actions.iter().any(|action| hard(action) && action.status.is_active())
        });
    fault "instant-actions-read-on-nodes" ["IACT-05", "STATE-09"] "It reads instant actions that come while it drives only when it is on its next node, and does not list them before."
        => keep::<Vec<Vec<u8>>>()
            .hears(|unread, agv, name, payload| {
                let waits = name == "instantActions" && agv.order.entered && agv.motion.is_moving();
                if waits {
                    unread.push(payload.to_vec());
                }
                !waits
            })
            .happens(|unread, agv, event| {
                let off_the_edge = event == Event::Settled && !agv.order.entered;
                if (matches!(event, Event::NodePassed(_)) || off_the_edge) && !unread.is_empty() {
                    for payload in std::mem::take(unread) {
                        agv.instant_actions_received(&payload);
                    }
                    if off_the_edge {
                        agv.settle();
                    }
                }
            });
    fault "undescribed-status" ["ACT-41"] "Reports instant actions INITIALIZING that have no preparation." because "It breaks a recommendation only."
        => plain().happens(|(), agv, event| if event == Event::InstantBegun {
            let begun = agv.actions.iter_mut().filter(|action| !action.of_order() && action.status == Status::Waiting);
            if let Some(action) = begun.last() {
                action.status = Status::Initializing;
                agv.flush();
            }
        });
    fault "drops-message-right-after-another" ["IACT-03", "IACT-05"] "It has one receive buffer, so that an instantActions message that comes within 100 ms after an order is lost."
        => keep::<Option<Moment>>().hears(|before, agv, name, _| {
            if name == "order" {
                *before = Some(agv.moment());
                return true;
            }
            before.is_none_or(|before| agv.moment().since(before) >= Duration::from_millis(100))
        });
    fault "instant-action-stuck" ["IACT-04"] "Leaves instant actions RUNNING for ever."
        => plain()
            .lasts(|_, _, what, usual| match what {
                Span::Action(action) if !action.of_order() => Duration::MAX,
                _ => usual,
            })
            .ends(|(), agv, action, outcome| match outcome {
                Outcome::Done(result) if !action.of_order() => stays_running(agv, action, result),
                other => other,
            });
    fault "state-request-stuck" ["ACT-26", "IACT-04"] "Leaves stateRequest RUNNING for ever."
        => after(Effect::StateRequest, |agv, action, outcome| match outcome {
            Outcome::Done(result) if !action.of_order() => stays_running(agv, action, result),
            other => other,
        });
    tolerance "batch-reversed" ["IACT-07"] "It performs the actions of one instantActions message from the last to the first."
        => batch(|_, actions| actions.reverse());
    tolerance "unreadable-instant-ignored" ["IACT-03"] "The vehicle ignores an instantActions message that is not JSON or has no array of actions, without an error."
        => raising(|_, cause, _| !matches!(cause, Cause::Unreadable(reason) if reason.starts_with("the message")));
    tolerance "refused-instant-without-error" ["IACT-06"] "It reports an instant action that it cannot perform FAILED without an error."
        => keep::<bool>()
            .allows(|_, _, what, usual| usual && !matches!(what, Permission::BeginInstant(action) if is_unfit(action)))
            .raises(|_, agv, cause, _| match cause {
                Cause::Failure(Some(action)) => action.of_order() || !was_refused(agv, action),
                _ => true,
            });
    tolerance "init-position-takes-time" ["ACT-23", "ACT-41"] "initPosition is RUNNING for a moment before the pose is taken over."
        => letting(|_, what| matches!(what, Permission::TakeTime(action) if is(action, Effect::InitPosition)));
    tolerance "map-actions-take-time" ["MAP-24", "MAP-29", "ACT-41"] "enableMap and deleteMap are RUNNING for a moment before the maps change."
        => letting(|_, what| matches!(what, Permission::TakeTime(action) if is(action, Effect::EnableMap) || is(action, Effect::DeleteMap)));
    tolerance "clears-itself-too" ["IACT-STATE-04"] "It shows clearInstantActions FINISHED, and removes it a moment later with all others that have ended."
        => keep::<Option<Moment>>()
            .does(|due, agv, action| is(action, Effect::ClearInstantActions).then(|| {
                *due = Some(agv.moment() + brief(agv));
                Outcome::Done(None)
            }))
            .happens(|due, agv, event| if event == Event::Woken && due.take_if(|due| *due <= agv.moment()).is_some() {
                agv.actions.retain(|action| action.origin != Origin::Instant || !action.status.is_terminal());
            })
            .due(|due, _| *due);
}

/// Whether it is not for instantActions.
fn is_unfit(action: &Action) -> bool {
    !action.kind.is_some_and(|kind| kind.scopes.contains(&Scope::Instant))
}

/// Whether the action was refused before it did anything.
fn was_refused(agv: &Agv, action: &Action) -> bool {
    let fit = action.kind.filter(|_| !is_unfit(action));
    fit.is_none_or(|kind| action_kinds::refusal(kind, &action.request, &agv.config, false).is_some())
}

/// What the vehicle obeys at any time.
fn is_urgent(action: &Action) -> bool {
    let urgent = [Effect::StartPause, Effect::StopPause, Effect::CancelOrder];
    urgent.into_iter().any(|effect| is(action, effect))
}

type Told = fn(&Agv, &Action) -> bool;

/// Holds some instant actions back while something is so.
fn deferring(which: Told) -> Box<Hooks<Told>> {
    holding(which).allows(|which, agv, what, usual| {
        usual && !matches!(what, Permission::BeginInstant(action) if which(agv, action))
    })
}

/// Leaves some instant actions WAITING for ever that it cannot perform.
fn waiting(which: Told) -> Box<Hooks<Told>> {
    holding(which).allows(|which, agv, what, usual| match what {
        Permission::BeginInstant(action) | Permission::RefuseInstant(action) => usual && !which(agv, action),
        _ => usual,
    })
}

/// Says FINISHED of some instant actions that it cannot perform.
fn unrefused(which: Told) -> Box<Hooks<Told>> {
    holding(which)
        .allows(|which, agv, what, usual| {
            usual && !matches!(what, Permission::RefuseInstant(action) if which(agv, action))
        })
        .does(|which, agv, action| (!action.of_order() && which(agv, action)).then_some(Outcome::Done(None)))
}

type Ending = fn(&Action) -> bool;

/// Takes nothing of a message behind some action that has failed.
fn ending_batch(at: Ending) -> Box<dyn Deviation> {
    holding((at, false))
        .reads_instants(|(_, ended), _, _| *ended = false)
        .raises(|(at, ended), _, cause, _| {
            *ended |= match cause {
                Cause::Failure(Some(action)) => !action.of_order() && at(action),
                Cause::NothingToCancel => true,
                _ => false,
            };
            true
        })
        .allows(|(_, ended), _, what, usual| usual && !(*ended && matches!(what, Permission::TakeInstant)))
}

type Batch = fn(&mut Agv, &mut Vec<&Value>);

/// Does something with the actions of a message before it reads them.
fn batch(change: Batch) -> Box<dyn Deviation> {
    holding(change).reads_instants(|change, agv, actions| change(agv, actions))
}

/// Answers master control on its own topic.
fn acknowledge(agv: &mut Agv) {
    let mut message = agv.header("connection", false);
    message.set("actions", json!([]));
    if let Some(topic) = agv.config.topic("instantActions").filter(|_| agv.connection.online) {
        agv.pending.push(Output::Publish(Publication {
            topic: topic.to_owned(),
            payload: Value::Object(message).to_string().into(),
            qos: 0,
            retain: false,
        }));
    }
}

/// Shows the effect of an action, and keeps it RUNNING.
fn stays_running(agv: &mut Agv, action: &Action, result: Option<String>) -> Outcome {
    if let Some(action) = agv.actions.get_mut(&action.request.id) {
        action.status = Status::Running;
        action.due = None;
        action.result = result;
    }
    Outcome::Open
}
