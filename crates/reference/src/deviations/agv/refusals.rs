//! Deviations of what is reported, and what is changed, when an order is refused or nothing is there to cancel
//! (sections 6.6.4 and 6.6.3).

use crate::agv::action_kinds;
use crate::agv::rejection::message_references;

use super::prelude::*;

records! {
    fault "rejection-silent" ["ORD-REJ-17", "ORD-REJ-02", "ORD-REJ-06", "ORD-REJ-12"] "Only logs that it refused an order."
        => refusal(|_, _, _, _| false);
    fault "start-refusal-silent" ["ORD-REJ-17"] "Raises no error when the first node of an order is out of reach."
        => refusal(|_, rule, _, _| rule != Rule::StartOutOfRange);
    fault "unknown-map-silent" ["MAP-08", "ORD-REJ-17"] "It refuses an order on a map it does not have without any error."
        => refusal(|_, rule, _, _| rule != Rule::UnknownMap);
    fault "busy-refusal-silent" ["ORD-FLOW-01", "ORD-REJ-17", "ORD-FLOW-03"] "It refuses a new order while another one is active without any error."
        => refusal(|_, rule, _, _| rule != Rule::OtherOrderActive);
    fault "outdated-update-silent" ["ORD-REJ-12", "ORD-REJ-17"] "It drops an outdated order update without an error."
        => refusal(|_, rule, _, _| rule != Rule::Outdated);
    fault "refusal-silent-in-pause" ["ORD-REJ-17"] "It refuses orders and updates without any error while it is paused."
        => refusal(|agv, _, _, _| !agv.holds.pause);
    fault "unreadable-order-dropped" ["ORD-REJ-02", "ORD-REJ-17"] "It drops an order message that is not JSON without an error."
        => refusal(|_, rule, message, _| rule != Rule::Malformed || !message.is_null());
    fault "validation-error-misspelled" ["ORD-REJ-02"] "Calls a malformed order validationOrder, as an old figure does."
        => refusal(|_, rule, _, e| said(rule == Rule::Malformed, || "validationOrder".clone_into(&mut e.error_type)));
    fault "action-defect-as-order-error" ["ORD-REJ-02"] "It reports an order that is malformed within an action as orderError instead of validationError."
        => refusal(|agv, rule, _, e| {
            let in_action = e.references.iter().any(|(key, path)| key == "field" && path.contains("actions"));
            said(rule == Rule::Malformed && in_action, || e.error_type.clone_from(&agv.config.errors.order))
        });
    fault "order-error-as-validation" ["ORD-REJ-06"] "Reports orders it cannot perform as malformed."
        => refusal(|agv, rule, _, e| said(rule == Rule::Unable, || e.error_type.clone_from(&agv.config.errors.validation)));
    fault "outdated-update-misnamed" ["ORD-REJ-12"] "Reports an outdated update as validationError."
        => refusal(|agv, rule, _, e| said(rule == Rule::Outdated, || e.error_type.clone_from(&agv.config.errors.validation)));
    fault "busy-refusal-untyped" ["ERR-02"] "The error of an order it refuses because of another one has an empty errorType."
        => refusal(|_, rule, _, e| said(rule == Rule::OtherOrderActive, || e.error_type.clear()));
    fault "validation-error-fatal" ["ORD-REJ-02"] "Reports a malformed order as FATAL."
        => refusal(|_, rule, _, e| said(rule == Rule::Malformed, || e.fatal = true));
    fault "order-error-fatal" ["ORD-REJ-06"] "Reports orders it cannot perform as FATAL."
        => refusal(|_, rule, _, e| said(rule == Rule::Unable, || e.fatal = true));
    fault "outdated-update-fatal" ["ORD-REJ-12"] "Reports an outdated update as FATAL."
        => refusal(|_, rule, _, e| said(rule == Rule::Outdated, || e.fatal = true));
    fault "validation-error-dropped-early" ["ORD-REJ-03"] "Forgets the validationError after a moment."
        => refusal(|agv, rule, _, e| said(rule == Rule::Malformed, || e.life = Life::Until(agv.moment() + MOMENT)));
    fault "order-error-dropped-early" ["ORD-REJ-08"] "Forgets the orderError after a moment."
        => refusal(|agv, rule, _, e| said(rule == Rule::Unable, || e.life = Life::Until(agv.moment() + MOMENT)));
    fault "references-of-last-order" ["ORD-REJ-14", "BP-02"] "Names the order and update it has, and not those it refuses."
        => refusal(|agv, _, _, e| {
            for (key, value) in &mut e.references {
                match key.as_str() {
                    "orderId" => value.clone_from(&agv.order.order_id),
                    "orderUpdateId" => *value = agv.order.update_id.to_string(),
                    _ => {}
                }
            }
            true
        });
    fault "outdated-update-names-current-id" ["ORD-REJ-14", "BP-01"] "It puts the orderUpdateId it has, not the rejected one, into the references of the rejection."
        => refusal(|agv, _, message, e| {
            let own = agv.order.has_order() && message.get("orderId").and_then(Value::as_str) == Some(agv.order.order_id.as_str());
            let ids = e.references.iter_mut().filter(|(key, _)| own && key == "orderUpdateId");
            ids.for_each(|(_, value)| *value = agv.order.update_id.to_string());
            true
        });
    fault "culprit-unnamed" ["ORD-REJ-07"] "Its orderError references the message alone and not the field or the action that is wrong."
        => refusal(|_, rule, message, e| said(rule == Rule::Unable, || e.references.truncate(message_references(message).len())));
    fault "stitch-rejection-without-update-id" ["ORD-REJ-14"] "It names the orderUpdateId of an outdated update in the error, but not that of an update that does not start at the decision point."
        => refusal(|_, rule, _, e| said(rule == Rule::BrokenUpdate, || e.references.retain(|(key, _)| key != "orderUpdateId")));
    fault "update-id-unreferenced" ["ORD-REJ-14"] "Does not name the orderUpdateId of a refused update."
        => refusal(|_, _, _, e| said(true, || e.references.retain(|(key, _)| key != "orderUpdateId")));
    fault "update-id-under-other-key" ["ORD-REJ-14"] "It references the orderUpdateId of a refused update under the key updateId."
        => refusal(|_, _, _, e| {
            let ids = e.references.iter_mut().filter(|(key, _)| key == "orderUpdateId");
            ids.for_each(|(key, _)| "updateId".clone_into(key));
            true
        });
    fault "order-error-unreferenced" ["ORD-REJ-07", "BP-01"] "Does not say what it cannot perform."
        => refusal(|_, rule, _, e| said(rule == Rule::Unable, || e.references.clear()));
    fault "busy-refusal-unreferenced" ["BP-01", "ERR-10"] "The error for a new order while another one is active has no errorReferences at all."
        because "BP-01, that an error names what it is about, is a recommendation; the refusal itself is right."
        => refusal(|_, rule, _, e| said(rule == Rule::OtherOrderActive, || e.references.clear()));
    fault "new-rejection-replaces-old-warning" ["ORD-REJ-08", "ORD-REJ-03", "ERR-01"] "It holds one order error only, so that the next rejection replaces an orderError or validationError that must stay."
        => refusal(|agv, _, _, _| {
            let of_order = |error: &ActiveError| error.references.iter().any(|(key, value)| key == "topic" && value == "order");
            said(true, || agv.errors.active.retain(|error| !of_order(error)))
        });
    fault "refusal-shown-once" ["ORD-REJ-21", "ORD-REJ-26", "ERR-09", "ERR-01"] "It lists the error of a refused order in one state, and no more in the next one."
        => keep::<Vec<ActiveError>>()
            .raises(|shown, _, cause, error| {
                if matches!(cause, Cause::Refusal(..)) {
                    shown.push(error.clone());
                }
                true
            })
            .happens(|shown, agv, event| if event == Event::StateSent {
                let shown = std::mem::take(shown);
                agv.errors.active.retain(|error| !shown.contains(error));
            });
    fault "refusal-level-corrected" ["ORD-REJ-12", "ORD-REJ-02", "ORD-REJ-06", "ORD-CANCEL-19"] "Reports a refusal as FATAL at first, and right a moment later."
        => corrected(|wrong| wrong.fatal = !wrong.fatal);
    fault "refusal-type-corrected" ["ORD-REJ-06", "ORD-REJ-02", "ORD-REJ-12"] "Reports a refusal as internalError at first, and right a moment later."
        => corrected(|wrong| "internalError".clone_into(&mut wrong.error_type));
    fault "refusal-references-corrected" ["ORD-REJ-14", "ORD-REJ-07", "ORD-CANCEL-20"] "Does not say what a refusal is about at first, and says it a moment later."
        => corrected(|wrong| wrong.references.clear());

    fault "idle-cancel-silent" ["ORD-CANCEL-19", "ORD-CANCEL-20"] "Raises no error when there is no order to cancel."
        => nothing_to_cancel(|_, _| false);
    fault "idle-cancel-fatal" ["ORD-CANCEL-19"] "Calls a missing order to cancel FATAL."
        => nothing_to_cancel(|_, e| said(true, || e.fatal = true));
    fault "idle-cancel-unreferenced" ["ORD-CANCEL-20"] "Does not name the actionId when there is no order to cancel."
        => nothing_to_cancel(|_, e| said(true, || e.references.clear()));
    fault "idle-cancel-names-type" ["ORD-CANCEL-20"] "The error noOrderToCancel references the actionType of the cancelOrder and not its actionId."
        => nothing_to_cancel(|_, e| said(true, || e.references = vec![("actionType".to_owned(), "cancelOrder".to_owned())]));
    fault "no-order-to-cancel-keeps-first-id" ["ORD-CANCEL-20"] "It does not raise noOrderToCancel twice: at a second useless cancelOrder the error still names the first actionId."
        => nothing_to_cancel(|agv, e| {
            if let Some(first) = agv.errors.active.iter().find(|error| error.error_type == e.error_type) {
                e.references.clone_from(&first.references);
            }
            e.life = Life::UntilNewOrder;
            true
        });

    fault "malformed-taken-over" ["ORD-REJ-01"] "Reports the orderId of a malformed order as its own."
        => refusing(|agv, message, rule| if rule == Rule::Malformed { take_id(agv, message) });
    fault "rejected-id-reported" ["STATE-MSG-02", "ORD-REJ-04"] "Reports the orderId of an order it refused."
        => refusing(|agv, message, rule| if rule != Rule::Outdated { take_id(agv, message) });
    fault "rejected-update-cuts-horizon" ["ORD-FLOW-12", "STATE-12"] "An order update that it rejects still makes it throw away the horizon of its order."
        => refusing(|agv, _, rule| if matches!(rule, Rule::BrokenUpdate | Rule::Outdated) {
            let gone = agv.order.drop_horizon();
            agv.actions.retain(|action| match action.origin {
                Origin::Node(id) | Origin::Edge(id) => !gone.contains(&id),
                Origin::Instant | Origin::Zone(_) => true,
            });
        });
    fault "rejected-update-id-adopted" ["ORD-FLOW-08", "ORD-FLOW-10"] "It adopts the orderUpdateId of an update that it rejects because it does not join the order."
        => refusing(|agv, message, rule| {
            let id = message.get("orderUpdateId").and_then(Value::as_u64).and_then(|id| u32::try_from(id).ok());
            if let Some(id) = id.filter(|_| rule == Rule::BrokenUpdate) {
                agv.order.update_id = id;
            }
        });
    fault "outdated-halts-driving" ["ORD-REJ-11", "ORD-FLOW-12"] "An outdated update makes it stand still until there is a new order, though it keeps the order it has."
        => parked()
            .refuses(|parked, _, _, rule| *parked |= rule == Rule::Outdated)
            .happens(|parked, _, event| *parked &= event != Event::Begun);
    fault "refusal-stalls-action" ["ACT-01", "ORD-FLOW-12"] "An order it refuses makes it forget to end the action that runs."
        => refusing(|agv, _, _| {
            let of_order = agv.actions.iter_mut().filter(|action| action.of_order());
            of_order.for_each(|action| action.due = None);
        });
    fault "refused-update-drops-edges" ["ORD-FLOW-12", "STATE-12"] "An order it refuses makes it throw the edges of its horizon away."
        => refusing(|agv, _, _| agv.order.edges.retain(|edge| edge.released));
    fault "malformed-stops-order" ["ORD-FLOW-12", "ORD-REJ-01"] "Gives its order up when an update breaks the schema."
        => refusing(|agv, message, rule| if rule == Rule::Malformed && message.is_object() { agv.give_up_order() });
    fault "dumb-after-malformed" ["ORD-REJ-02", "ORD-REJ-17", "STATE-02"] "It sends nothing more after a malformed order until it is switched off and on, and stays connected."
        => keep::<bool>()
            .refuses(|dumb, _, _, rule| *dumb |= rule == Rule::Malformed)
            .happens(|dumb, _, event| *dumb &= event != Event::PowerCycled)
            .allows(|dumb, _, what, usual| usual && !(*dumb && matches!(what, Permission::Say(..))));
    fault "missing-id-taken-over" ["ORD-REJ-01", "STATE-MSG-02"] "Reads a missing orderId as an empty one and reports it."
        => refusing(|agv, message, rule| {
            if rule == Rule::Malformed && message.is_object() && message.get("orderId").is_none() {
                agv.order.order_id.clear();
            }
        });
    fault "unreadable-clears-order" ["ORD-REJ-01", "ORD-FLOW-12"] "Clears its order when it cannot read a message."
        => refusing(|agv, message, rule| if rule == Rule::Malformed && !message.is_object() {
            agv.give_up_order();
            agv.order.order_id.clear();
        });
    fault "refused-actions-listed" ["ORD-REJ-09"] "Lists the actions of an order it cannot perform as FAILED."
        => refusing(|agv, message, rule| if rule == Rule::Unable && let Ok(order) = Order::read(message) {
            for request in order.actions() {
                let mut action = Action::waiting(request.clone(), None, Origin::Node(0));
                action.end(Status::Failed);
                agv.actions.push(action);
            }
        });
    fault "rejected-update-leaves-actions" ["ORD-REJ-09", "ORD-REJ-04", "ORD-FLOW-12"] "It lists the actions of an update before it checks them, so that the actions of a rejected update stay in actionStates as WAITING."
        => refusing(|agv, message, rule| {
            let order = Order::read(message).ok().filter(|order| rule == Rule::Unable && order.id == agv.order.order_id);
            for request in order.iter().flat_map(|order| order.actions().skip(order.nodes.first().map_or(0, |joint| joint.actions.len()))) {
                if agv.actions.get(&request.id).is_none() {
                    let kind = action_kinds::find(&agv.config, &request.action_type);
                    // Nothing ever triggers it.
                    agv.actions.push(Action::waiting(request.clone(), kind, Origin::Node(u32::MAX)));
                }
            }
        });
    fault "busy-refusal-fails-actions" ["ORD-FLOW-12"] "It breaks off the running actions of its order when it refuses another order because it is busy."
        => refusing(|agv, _, rule| {
            let running = agv.actions.iter_mut().filter(|action| rule == Rule::OtherOrderActive && action.of_order() && action.status.is_active());
            running.for_each(|action| action.end(Status::Failed));
        });
    fault "pause-stuck-after-refusal" ["ACT-13"] "Reports stopPause FINISHED and stays paused when it has refused an order or an update in the pause."
        => keep::<bool>()
            .refuses(|stuck, agv, _, _| *stuck |= agv.holds.pause)
            .does(|stuck, agv, action| super::pause::stays_paused(*stuck, agv, action));
    fault "rejection-lifts-pause" ["ORD-FLOW-12", "ACT-14"] "Rejecting an order ends the pause of the vehicle, and it drives on with its current order."
        => refusing(|agv, _, _| agv.set_holds(|holds| holds.pause = false));
    fault "rejection-drops-horizon" ["ORD-FLOW-12", "STATE-12", "ORD-FLOW-03"] "Forgets its horizon when it has to refuse a message."
        => refusing(|agv, _, _| {
            agv.order.drop_horizon();
        });
    fault "rejection-clears-action-states" ["STATE-MSG-10"] "Removes its finished actions from the states when it has to refuse an order."
        => refusing(|agv, _, _| agv.actions.retain(|action| !action.of_order() || !action.status.is_terminal()));
    fault "rejection-stops-order" ["ORD-FLOW-12", "ORD-REJ-11"] "Stops driving when it has to refuse a message."
        => refusing(|agv, _, _| agv.give_up_order());
    fault "outdated-update-drops-order" ["ORD-REJ-11", "ORD-FLOW-12"] "Gives the order up when an outdated update arrives."
        => refusing(|agv, _, rule| if rule == Rule::Outdated { agv.give_up_order() });
    fault "order-error-locks" ["ORD-FLOW-06", "ORD-REJ-08"] "Refuses the order that follows one it could not perform."
        => super::orders::locking()
            .refuses(|locked, _, _, rule| *locked = match rule {
                Rule::Unable => true,
                Rule::OtherOrderActive => false,
                _ => *locked,
            })
            .happens(|locked, _, event| *locked &= event != Event::PowerCycled);
    fault "refused-order-queued" ["ORD-FLOW-01", "ORD-REJ-17"] "A new order that was refused because another one is active is begun all the same as soon as that one has ended."
        => keep::<Option<Value>>()
            .refuses(|queued, _, message, rule| if rule == Rule::OtherOrderActive { *queued = Some(message.clone()) })
            .happens(|queued, agv, event| if event == Event::Settled && !agv.is_busy() && let Some(message) = queued.take() {
                agv.flush();
                if agv.order_decided(&message).is_ok() {
                    agv.settle();
                }
            });
}

/// Says the error, changed if that is meant.
fn said(meant: bool, change: impl FnOnce()) -> bool {
    if meant {
        change();
    }
    true
}

fn take_id(agv: &mut Agv, message: &Value) {
    if let Some(id) = message.get("orderId").and_then(Value::as_str) {
        id.clone_into(&mut agv.order.order_id);
    }
}

/// How long a wrong report stands.
const CORRECTION: Duration = Duration::from_millis(800);

/// When a wrong report is put right, what was said, and what is said then.
type Later = Option<(Moment, ActiveError, ActiveError)>;

/// Reports a refusal wrongly at first.
fn corrected(change: fn(&mut ActiveError)) -> Box<dyn Deviation> {
    holding((change, Later::None))
        .raises(|(change, later), agv, cause, error| {
            if !matches!(cause, Cause::Failure(_)) {
                let right = error.clone();
                change(error);
                error.life = Life::UntilNewOrder;
                *later = Some((agv.moment() + CORRECTION, error.clone(), right));
            }
            true
        })
        .happens(|(_, later), agv, event| {
            let now = agv.moment();
            if event == Event::Woken
                && let Some((_, wrong, right)) = later.take_if(|(due, ..)| *due <= now)
                && let Some(at) = agv.errors.active.iter().position(|error| *error == wrong)
            {
                agv.errors.active.remove(at);
                agv.errors.raise(right);
            }
        })
        .due(|(_, later), _| later.as_ref().map(|(due, ..)| *due))
}
