//! Deviations of how orders are called off, and what comes before the end of that (section 6.6.3).

use crate::master_control::driving::has_failed;
use crate::master_control::rerouting::Reroute;

use super::prelude::*;

records! {
    fault "order-instead-of-cancel" ["ORD-CANCEL-01"] "Sends a new order without calling the old one off."
        => plain().happens(|(), site, vehicle, event| if let Event::CallingOff(then, sends) = event {
            **sends = false;
            // Without another transport the new order ends where the vehicle is.
            let last = vehicle.state.as_ref().map(|state| state.last_node_id.clone());
            let stay = last.filter(|node| !node.is_empty()).map(|to| Transport { to, ..Transport::default() });
            site.drop_order(vehicle, then.take().or(stay));
        }).allows(|(), _, _, what, usual| usual || matches!(what, Permission::Interrupt));
    fault "updated-while-cancelled" ["ORD-CANCEL-01", "ORD-CANCEL-22"] "Extends the base of an order it is calling off."
        because "That an order which is called off gets no update is read out of the text."
        => plain().allows(|(), _, vehicle, what, usual| {
            let running = vehicle.running.as_ref().filter(|running| running.confirmed);
            usual || (matches!(what, Permission::Follow) && vehicle.cancel.is_some() && running.is_some())
        }).judges(|(), _, vehicle, _, _, fate| if vehicle.cancel.is_some() { Fate::Runs } else { fate });
    fault "cancel-ends-with-route" ["ORD-CANCEL-01"] "Takes empty nodeStates for the end of cancelOrder."
        => letting(|_, vehicle, what| matches!(what, Permission::CancelEnded) && vehicle.state.as_ref().is_some_and(State::route_empty));
    fault "action-not-awaited" ["ORD-CANCEL-01"] "Sends the next order while an action of the last one still runs."
        because "That a new order waits for the end of the old actions is read out of the text."
        => judging(|_, running, state, fate| {
            let driven = state.route_empty() && running.is_whole() && running.confirmed && running.accepted;
            if fate == Fate::Runs && driven { Fate::Over } else { fate }
        });
    fault "cancel-not-awaited" ["ORD-CANCEL-01"] "Sends the new order right behind cancelOrder."
        => plain().happens(|(), site, vehicle, event| if let Event::CalledOff = event {
            site.send_instants(vehicle);
            let then = vehicle.cancel.take().and_then(|cancel| cancel.then);
            site.drop_order(vehicle, then);
        }).allows(|(), _, _, what, usual| usual || matches!(what, Permission::Interrupt));
    fault "replaced-at-work" ["ORD-CANCEL-01"] "Sends the next order without cancelOrder while the vehicle stands and an action of the old one runs."
        because "That the order is called off before it is replaced is read out of the text."
        => replaced(|vehicle, then| {
            let Some((state, running)) = vehicle.state.as_ref().zip(vehicle.running.as_ref()) else { return false };
            let works = |id: &str| state.action(id).is_some_and(|action| !action.is_terminal());
            !state.driving && then.is_some() && running.action_ids().any(works)
        });
    fault "withdrawn-order-replaced-without-cancel" ["ORD-CANCEL-01"]
        "When the transport of a vehicle is withdrawn it sends nothing, and the next transport as a new order while the vehicle drives the old one."
        => keep::<(bool, bool)>().asked(|(withdrawn, _), _, _, command, _| {
            *withdrawn = matches!(command, "cancel" | "reroute");
            true
        }).happens(|(withdrawn, hasty), site, vehicle, event| match event {
            Event::Looked => *withdrawn = false,
            Event::CallingOff(then, sends) if *withdrawn => {
                **sends = false;
                *hasty = true;
                site.drop_order(vehicle, then.take());
            }
            Event::Begun => *hasty = false,
            _ => {}
        }).allows(|(_, hasty), _, _, what, usual| usual || (*hasty && matches!(what, Permission::Interrupt)));
    fault "paused-order-replaced" ["ORD-CANCEL-01"] "When an order is called off while the vehicle is paused, it sends no cancelOrder, and the next new order at once."
        because "A paused vehicle keeps its base; that ORD-CANCEL-01 asks for cancelOrder before it is replaced is seen from its usual conduct only."
        => replaced(|vehicle, _| vehicle.is_paused());
    fault "cancel-lost-while-disconnected" ["ORD-CANCEL-01"]
        "It forgets a cancel request that comes while the vehicle is CONNECTIONBROKEN and sends a new order after ONLINE without any cancelOrder."
        => replaced(|vehicle, _| vehicle.presence == Presence::Away);
    fault "cancel-forgotten-before-acceptance" ["ORD-CANCEL-01"]
        "It strikes an order without sending cancelOrder when it is called off after it was sent and before a state has shown it."
        => calling_off(|site, vehicle, then, sends| {
            if vehicle.running.as_ref().is_some_and(|running| !running.accepted) {
                *sends = false;
                site.drop_order(vehicle, None);
                vehicle.queue.extend(then.take());
            }
        });
    fault "cancel-lost-while-away" ["ORD-CANCEL-01", "TOPIC-13"] "A cancellation asked for while the vehicle is away is never sent, and the order goes on."
        => calling_off(|_, vehicle, _, sends| *sends &= vehicle.presence != Presence::Away);
    fault "cancels-only-once" ["ORD-CANCEL-01"] "It sends cancelOrder to a vehicle only once: later requests to call an order off lead to nothing."
        => keep::<bool>().happens(|done, _, _, event| if let Event::CallingOff(_, sends) = event { **sends &= !std::mem::replace(done, true); });
    fault "cancel-of-paused-vehicle-only-internal" ["ORD-CANCEL-01", "TOPIC-13"]
        "It deletes the transport of a paused vehicle in its own list without sending cancelOrder, and dispatches the next one after stopPause."
        because "No sentence obliges a master control to call off what it may also leave without a further base."
        => keep::<bool>().happens(|dropped, site, vehicle, event| match event {
            Event::CallingOff(then, sends) if vehicle.is_paused() => {
                **sends = false;
                *dropped = true;
                site.drop_order(vehicle, None);
                vehicle.queue.extend(then.take());
            }
            Event::Begun => *dropped = false,
            _ => {}
        }).allows(|dropped, _, vehicle, what, usual| match what {
            Permission::Interrupt => usual || *dropped,
            Permission::Begin => usual && !(*dropped && vehicle.is_paused()),
            _ => usual,
        });
    fault "pause-instead-of-cancel" ["ORD-CANCEL-01"] "To call an order off it sends startPause and never cancelOrder."
        => calling_off(|site, vehicle, _, sends| {
            *sends = false;
            let pausing = vehicle.instants.iter().any(|instant| instant.kind() == "startPause");
            if !vehicle.is_paused() && !pausing { site.instant(vehicle, "startPause", &Value::Null); }
        });
    fault "no-nodes" ["ORD-02"] "Sends an order without nodes to call off an order that is not begun yet."
        => happening(|site, vehicle, event| if let Event::CallingOff(..) = event && let Some(running) = &vehicle.running {
            let body = json!({ "orderId": running.id, "orderUpdateId": running.update_id + 1, "nodes": [], "edges": [] });
            site.publish(vehicle, "order", &body);
        });
    fault "failed-cancel-taken-for-done" ["ORD-CANCEL-01"] "It sends the next order when cancelOrder has FAILED and the vehicle still drives the old one."
        => keep::<bool>().happens(|hasty, _, _, event| match event {
            Event::Ended(_, true) => *hasty = true,
            Event::Begun => *hasty = false,
            _ => {}
        }).allows(|hasty, _, _, what, usual| match what {
            Permission::OrderGone => true,
            Permission::Interrupt => usual || *hasty,
            _ => usual,
        });
    fault "cancel-held-while-paused" ["ORD-CANCEL-01"] "It holds cancelOrder back as long as the vehicle is paused."
        because "ORD-CANCEL-01 names no time by which cancelOrder has to follow the wish."
        => forbidding(|_, vehicle, what| matches!(what, Permission::Tell("cancelOrder")) && vehicle.is_paused());
    fault "new-order-without-cancel-in-pause" ["ORD-CANCEL-01", "ORD-UPD-03"]
        "It sends a new order without cancelOrder when the destination is changed while the vehicle is paused in the middle of its order."
        => keep::<bool>().happens(|hasty, _, vehicle, event| match event {
            Event::Rerouting(running, how) if vehicle.is_paused() && running.accepted && vehicle.cancel.is_none() => {
                **how = Reroute::Dropped;
                *hasty = true;
            }
            Event::Begun => *hasty = false,
            _ => {}
        }).allows(hasty);
    fault "next-order-after-failed-action" ["ORD-CANCEL-01"]
        "After an action of an order has failed it sends the next new order without cancelOrder while the old one still has nodes left."
        => keep::<bool>().judges(|hasty, _, _, running, state, fate| {
            if fate == Fate::CalledOff && has_failed(running, state) {
                *hasty = true;
                return Fate::Over;
            }
            fate
        }).happens(|hasty, _, _, event| if let Event::Begun = event { *hasty = false; }).allows(hasty);
    fault "trigger-unsupervised" ["ACT-39"] "Waits for a trigger without end."
        => forbidding(|_, _, what| matches!(what, Permission::Supervise(_)));
    fault "trigger-unsupervised-after-update" ["ACT-39"] "It does not supervise the time-out of waitForTrigger in an order that has been updated."
        => forbidding(|_, _, what| matches!(what, Permission::Supervise(running) if running.is_updated()));
    fault "trigger-forgotten-in-pause" ["ACT-39"] "Stops the time of waitForTrigger when the vehicle is paused, and never starts it again."
        => keep::<bool>().happens(|forgotten, _, vehicle, event| match event {
            Event::State(_) => {
                let waits = vehicle.running.as_ref().is_some_and(|running| waits(running, vehicle.state.as_ref()));
                *forgotten |= waits && vehicle.is_paused();
            }
            Event::Begun => *forgotten = false,
            _ => {}
        }).allows(|forgotten, _, _, what, usual| usual && !(*forgotten && matches!(what, Permission::Supervise(_))));
    fault "trigger-supervised-once" ["ACT-39"] "Supervises waitForTrigger no more once a vehicle has been given its trigger in time."
        => keep::<bool>().happens(|once, _, _, event| if let Event::Ended(order, false) = event {
            *once |= order.waits.is_some();
        }).allows(|once, _, _, what, usual| usual && !(*once && matches!(what, Permission::Supervise(_))));
    fault "trigger-timer-restarts" ["ACT-39"]
        "The time-out of waitForTrigger begins again with every state, so that it never runs out at a vehicle that reports often."
        => state_taken(|site, vehicle| {
            let waits = vehicle.running.as_mut().and_then(|running| running.waits.as_mut());
            waits.into_iter().for_each(|(_, since)| *since = site.now.moment);
        });
    fault "trigger-timeout-pauses" ["ACT-39"] "When waitForTrigger runs too long it sends startPause and does not call the order off."
        => plain().judges(|(), site, vehicle, running, _, fate| {
            if fate != Fate::TooLate { return fate; }
            running.waits.iter_mut().for_each(|(_, since)| *since = site.now.moment);
            vehicle.at(site.now.moment + site.config.trigger_timeout);
            site.instant(vehicle, "startPause", &Value::Null);
            Fate::Runs
        });
    fault "trigger-timeout-without-cancel" ["ACT-39", "ORD-CANCEL-01"] "It sends the next order when waitForTrigger has timed out, without cancelOrder."
        => keep::<bool>().judges(|hasty, _, _, _, _, fate| {
            if fate == Fate::TooLate {
                *hasty = true;
                return Fate::Over;
            }
            fate
        }).happens(|hasty, _, _, event| if let Event::Begun = event { *hasty = false; }).allows(hasty);
    fault "trigger-timeout-only-drops-transport" ["ACT-39", "ORD-CANCEL-01"]
        "It drops the transport in its own list when waitForTrigger takes too long, but does not cancel the order."
        => judging(|_, _, _, fate| if fate == Fate::TooLate { Fate::Over } else { fate });
    tolerance "resumes-before-cancel" ["ORD-CANCEL-01"] "It sends stopPause to a paused vehicle before it calls its order off."
        => happening(|site, vehicle, event| if let Event::CallingOff(..) = event && vehicle.is_paused() { site.instant(vehicle, "stopPause", &Value::Null); });
    tolerance "pauses-before-cancel" ["ORD-CANCEL-01", "IACT-02"] "It sends startPause before cancelOrder, and stopPause when the cancellation has ended."
        => keep::<bool>().happens(|resumes, site, vehicle, event| match event {
            Event::CallingOff(..) if !vehicle.is_paused() => *resumes = site.instant(vehicle, "startPause", &Value::Null).is_some(),
            Event::CancelOver if std::mem::take(resumes) => { site.instant(vehicle, "stopPause", &Value::Null); }
            _ => {}
        });
    tolerance "cancel-sent-to-idle" ["ORD-CANCEL-01"] "It passes a requested cancelOrder on to a vehicle that has nothing to do."
        => plain().asked(|(), site, vehicle, command, _| {
            let idle = vehicle.running.is_none() && vehicle.queue.is_empty() && vehicle.cancel.is_none();
            let idle = idle && vehicle.state.as_ref().is_some_and(State::route_empty);
            if command == "cancel" && idle && site.connection.online && site.commandable(vehicle) { site.instant(vehicle, "cancelOrder", &Value::Null); }
            true
        });
    tolerance "cancels-after-two-seconds" ["ORD-CANCEL-01", "TOPIC-13"] "It sends cancelOrder two seconds after the operator asked for it."
        => keep::<Option<(Moment, String)>>().asked(|due, site, vehicle, command, _| {
            let order = vehicle.running.as_ref().map(|running| running.id.clone());
            let Some(order) = order.filter(|_| command == "cancel") else { return true };
            let later = site.now.moment + Duration::from_secs(2);
            *due = Some((later, order));
            vehicle.at(later);
            false
        }).happens(|due, site, vehicle, event| if let Event::Looked = event && let Some((later, order)) = due.take() {
            if later > site.now.moment {
                vehicle.at(later);
                *due = Some((later, order));
            } else if vehicle.running.as_ref().is_some_and(|running| running.id == order) { site.call_off(vehicle); }
        });
    tolerance "cancels-on-fatal" ["IACT-02", "CONN-14"] "It cancels the order of a vehicle that reports a FATAL error."
        => keep::<bool>().happens(|done, site, vehicle, event| match event {
            Event::Looked => {
                let mut errors = vehicle.state.iter().flat_map(|state| &state.errors);
                let fatal = errors.any(|error| error.error_level == "FATAL");
                let driven = vehicle.running.as_ref().is_some_and(|running| running.accepted);
                if fatal && driven && !*done && vehicle.cancel.is_none() && site.commandable(vehicle) {
                    *done = true;
                    site.cancel(vehicle, None);
                }
            }
            Event::Begun => *done = false,
            _ => {}
        });
    tolerance "log-asked-after-failure" ["ACT-08", "ACT-31"] "After an action of an order has failed it asks for a log if the vehicle offers that."
        => keep::<bool>().judges(|asked, site, vehicle, running, state, fate| {
            if has_failed(running, state) && !*asked && vehicle.offer("logReport").is_some() {
                *asked = true;
                site.instant(vehicle, "logReport", &json!({ "reason": "an action has failed" }));
            }
            fate
        }).happens(|asked, _, _, event| if let Event::Begun = event { *asked = false; });
}

/// Forgets an order instead of calling it off, and does not wait for its end.
fn replaced(when: fn(&Vehicle, Option<&Transport>) -> bool) -> Box<dyn Deviation> {
    each((when, false))
        .happens(|(when, replaced), site, vehicle, event| match event {
            Event::CallingOff(then, sends) if when(vehicle, then.as_ref()) => {
                **sends = false;
                *replaced = true;
                site.drop_order(vehicle, then.take());
            }
            Event::Begun => *replaced = false,
            _ => {}
        })
        .allows(|(_, replaced), _, _, what, usual| usual || (*replaced && matches!(what, Permission::Interrupt)))
}

/// Whether a waitForTrigger of an order runs or is paused.
fn waits(running: &Running, state: Option<&State>) -> bool {
    running.actions().any(|action| {
        let id = action["actionId"]
            .as_str()
            .filter(|_| action["actionType"] == "waitForTrigger");
        let seen = id.and_then(|id| state?.action(id));
        seen.is_some_and(|seen| matches!(seen.action_status.as_str(), "RUNNING" | "PAUSED"))
    })
}
