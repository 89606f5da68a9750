//! Deviations of operating modes, and of what people do to the vehicle (section 6.10.6, MODE-01 to MODE-06).

use crate::agv::Mode;
use crate::agv::order_state::OrderState;

use super::prelude::*;

records! {
    fault "mode-told-at-once" ["ORD-CLEAR-05", "ORD-CLEAR-09"] "It breaks off everything at once when the mode changes, also what cannot be broken off."
        => forbidding(|_, what| matches!(what, Permission::EndActions));
    fault "place-kept-in-service" ["MODE-15"] "It goes on showing its last node in SERVICE and TEACH_IN."
        => keep::<String>().happens(|kept, agv, event| match event {
            Event::ModeChanging(_) => kept.clone_from(&agv.order.last_node),
            Event::ModeChanged(_) if agv.order.last_node.is_empty() => agv.order.last_node.clone_from(kept),
            _ => {}
        });
    fault "order-in-startup-stored" ["ORD-REJ-23", "MODE-18"] "It says nothing about an order that comes in STARTUP, and begins it as soon as it is ready."
        => keep::<Option<Vec<u8>>>()
            .hears(|stored, agv, name, payload| {
                let early = name == "order" && agv.mode == Mode::Startup;
                if early {
                    *stored = Some(payload.to_vec());
                }
                !early
            })
            .happens(|stored, agv, event| if matches!(event, Event::ModeChanged(_)) && agv.mode.takes_orders() && let Some(payload) = stored.take() {
                agv.order_received(&payload);
            });
    fault "route-cleared-before-the-mode" ["ORD-CLEAR-10"] "It empties nodeStates and edgeStates when somebody switches it to MANUAL, and says MANUAL only when the last action of its order has ended."
        => when(Event::Settled, |agv| if agv.awaited_mode.is_some() {
            agv.order.drop_route();
        });
    fault "intervention-ends-order" ["MODE-07"] "It gives its order up when somebody steps in."
        => when(Event::ModeChanging(Mode::Intervened), Agv::give_up_order);
    fault "intervention-refuses-orders" ["MODE-10"] "It takes no orders and no updates while somebody steps in."
        => objecting(|agv, _, relation| {
            let refused = relation != Relation::Known && agv.mode == Mode::Intervened;
            refused.then(|| Refusal::new(Rule::OtherOrderActive, "somebody has stepped in"))
        });
    fault "intervention-drives-on" ["MODE-10"] "It drives on while somebody steps in."
        => drives(Hindrance::Mode, |agv| agv.mode == Mode::Intervened);
    fault "semiautomatic-refused" ["MODE-02"] "Refuses orders in SEMIAUTOMATIC."
        => objecting(|agv, _, relation| {
            let refused = relation != Relation::Known && agv.mode == Mode::Semiautomatic;
            refused.then(|| Refusal::new(Rule::OtherOrderActive, "the vehicle is not in an automatic mode"))
        });
    fault "semiautomatic-ends-order" ["MODE-02"] "Gives its order up when it is switched from AUTOMATIC to SEMIAUTOMATIC."
        => when(Event::ModeChanging(Mode::Semiautomatic), Agv::give_up_order);
    fault "manual-takes-orders" ["MODE-05", "MODE-02"] "Takes orders over in MANUAL, and drives them when it is back in AUTOMATIC."
        => letting(|agv, what| match what {
            Permission::KeepOrder(_) => !agv.mode.takes_orders(),
            what => matches!(what, Permission::Overlook(Objection::Mode)),
        });
    fault "manual-drives-orders" ["MODE-02"] "Takes orders over in MANUAL, and drives them there."
        => letting(|_, what| matches!(what, Permission::Overlook(Objection::Mode) | Permission::DriveAgainst(Hindrance::Mode)));
    fault "manual-drives-on" ["MODE-05", "MODE-02", "ORD-CLEAR-01"] "Keeps driving its order after it was switched to MANUAL, SERVICE or TEACHIN."
        => letting(|_, what| matches!(what, Permission::KeepOrder(_) | Permission::DriveAgainst(Hindrance::Mode)));
    fault "manual-keeps-order" ["MODE-05", "ORD-CLEAR-01"] "Keeps its order in MANUAL and goes on with it afterwards."
        => letting(|_, what| matches!(what, Permission::KeepOrder(_)));
    fault "manual-drives-unseen" ["MODE-05", "ORD-CLEAR-03"] "Clears its states in MANUAL and drives its base to the end."
        => letting(|agv, what| match what {
            Permission::KeepOrder(_) => agv.mode.takes_orders(),
            what => matches!(what, Permission::DriveAgainst(Hindrance::Mode)),
        })
        .says(|_, agv, part, m| {
            if matches!(part, Part::State) && !agv.mode.takes_orders() {
                m.set("nodeStates", json!([]));
                m.set("edgeStates", json!([]));
            }
            true
        });
    fault "manual-keeps-actions" ["MODE-05", "MODE-02", "ORD-CLEAR-03"] "Clears its way in MANUAL and goes on with its actions."
        => letting(|_, what| matches!(what, Permission::KeepOrder(_))).happens(|_, agv, event| if loses_order(agv, event) {
            agv.motion.halt(agv.moment());
            agv.order.drop_route();
            agv.order.cancelled = true;
        });
    fault "order-taken-up-again" ["MODE-05", "ORD-CLEAR-01"] "Remembers the order it gave up in MANUAL, and takes it up again when it is back in AUTOMATIC."
        => keep::<Option<OrderState>>().happens(|order, agv, event| {
            if loses_order(agv, event) {
                *order = Some(agv.order.clone());
            }
            if matches!(event, Event::ModeChanged(_))
                && let Some(order) = order.take_if(|_| agv.mode.takes_orders())
            {
                agv.order = order;
            }
        });
    fault "manual-position-stale" ["MODE-06", "STATE-MSG-05"] "Does not follow its position in MANUAL."
        => forbidding(|_, what| matches!(what, Permission::MoveByHand));
    fault "manual-drops-action-states" ["MODE-05", "STATE-MSG-10", "ORD-CLEAR-03"] "It removes the action states of its order when it is switched to MANUAL instead of reporting them FAILED."
        => when(Event::GivenUpForMode(Mode::Manual), |agv| agv.actions.retain(|action| !action.of_order()));
    fault "offline-in-manual" ["CONN-08", "CONN-10"] "When it leaves the automatic modes the vehicle publishes OFFLINE but stays connected and goes on sending states."
        => plain().happens(|(), agv, event| if let Event::ModeChanging(mode) = event
            && mode.takes_orders() != agv.mode.takes_orders()
        {
            agv.publish_connection(if mode.takes_orders() { "ONLINE" } else { "OFFLINE" });
        });
    fault "manual-keeps-waiting-order" ["MODE-05"] "Switching to MANUAL does not clear an order whose base is done and that waits at the decision point."
        => letting(|agv, what| {
            let waits = agv.waits_at_decision_point() && !agv.motion.is_moving() && !is_acting(agv);
            matches!(what, Permission::KeepOrder(Mode::Manual)) && waits
        });
    fault "mode-switch-parks" ["MODE-02"] "When the mode switches between AUTOMATIC and SEMIAUTOMATIC during an order the order stays but the vehicle stands for good."
        => parked().happens(|parked, agv, event| *parked = match event {
            Event::Begun => false,
            Event::ModeChanging(mode) => *parked || mode != agv.mode && mode.takes_orders() && agv.mode.takes_orders() && agv.is_occupied(),
            _ => *parked,
        });
    fault "manual-finishes-actions" ["MODE-05", "ORD-CLEAR-03"] "The actions that run when it is switched to MANUAL are reported FINISHED."
        => plain().happens(|(), agv, event| if loses_order(agv, event) {
            let active = agv.actions.iter_mut().filter(|action| action.of_order() && action.status.is_active());
            active.for_each(|action| action.end(Status::Finished));
        });
    fault "manual-keeps-horizon" ["MODE-05", "STATE-13", "ORD-CLEAR-01"] "Switched to MANUAL it clears the base of its order and keeps the horizon."
        => keep::<Option<OrderState>>().happens(|before, agv, event| {
            if loses_order(agv, event) {
                *before = Some(agv.order.clone());
            }
            if matches!(event, Event::GivenUpForMode(_))
                && let Some(before) = before.take()
            {
                agv.order.nodes.extend(before.nodes.into_iter().filter(|stop| !stop.node.released));
                agv.order.edges.extend(before.edges.into_iter().filter(|edge| !edge.released));
            }
        });
    fault "manual-leaves-actions-waiting" ["MODE-05", "ORD-CLEAR-03"] "It clears nodes and edges when it enters MANUAL but leaves the actions of the order WAITING."
        => keep::<Vec<String>>()
            .happens(|waiting, agv, event| {
                if loses_order(agv, event) {
                    let unbegun = agv.actions.iter().filter(|action| action.of_order() && action.status == Status::Waiting);
                    *waiting = unbegun.map(Action::id).collect();
                }
                if let Event::GivenUpForMode(mode) = event
                    && (mode == Mode::Manual || agv.mode == Mode::Manual)
                {
                    let again = agv.actions.iter_mut().filter(|action| waiting.contains(&action.request.id));
                    again.for_each(|action| action.status = Status::Waiting);
                }
            })
            .allows(|_, agv, what, usual| usual && !matches!(what, Permission::Count(action) if agv.order.cancelled && action.status == Status::Waiting));
    fault "silent-in-manual" ["MODE-06", "STATE-02"] "After the state that reports MANUAL it sends none until it leaves that mode."
        => forbidding(|agv, what| {
            let last = agv.report.last.as_ref().and_then(|(_, last)| last.get("operatingMode"));
            let told = last.is_some_and(|told| told == "MANUAL");
            matches!(what, Permission::Report) && agv.mode == Mode::Manual && told
        });
    fault "emergency-stop-warning" ["ERR-04"] "Reports the emergency stop as a WARNING."
        => raising(|_, cause, e| {
            e.fatal &= !matches!(cause, Cause::EmergencyStop);
            true
        });
    fault "emergency-stop-untyped" ["ERR-02"] "The error of its emergency stop has an empty errorType."
        => raising(|_, cause, e| {
            if matches!(cause, Cause::EmergencyStop) {
                e.error_type.clear();
            }
            true
        });
    fault "own-error-forgotten" ["ERR-04", "ERR-01"] "Forgets an error of its own a moment later, although its cause is still there."
        => raising(|agv, cause, e| {
            if matches!(cause, Cause::Defect) {
                e.life = Life::Until(agv.moment() + MOMENT);
            }
            true
        });
    fault "own-error-kept" ["ERR-01", "ERR-04"] "Keeps its errors for a minute, also when their cause is gone."
        => raising(|agv, cause, e| {
            if matches!(cause, Cause::Defect | Cause::EmergencyStop) {
                e.life = Life::Until(agv.moment() + Duration::from_secs(60));
            }
            true
        });
    fault "own-error-mild" ["ERR-04"] "Reports defects that keep it from running as a WARNING."
        => raising(|_, cause, e| {
            e.fatal &= !matches!(cause, Cause::Defect);
            true
        });
    fault "deaf-to-the-cleared-order" ["ORD-CLEAR-12"] "It says nothing to an update of an order that a mode has cleared." because "Whether it accepts or refuses the update is left to it; that it says nothing is remarked on."
        => keep::<bool>()
            .happens(|cleared, _, event| match event {
                Event::GivenUpForMode(_) => *cleared = true,
                Event::Begun => *cleared = false,
                _ => {}
            })
            .hears(|cleared, agv, name, payload| {
                let message: Value = serde_json::from_slice(payload).unwrap_or_default();
                !(*cleared && name == "order" && message["orderId"] == agv.order.order_id.as_str())
            });
    fault "fatal-drives" ["ERR-04"] "Drives on with a FATAL error."
        => forbidding(|_, what| matches!(what, Permission::StopForDefect));
    fault "rejection-gone-when-order-done" ["ORD-REJ-03", "ORD-REJ-08"] "It removes the warnings about refused orders when the order under way is complete, before a new order is accepted."
        => keep::<bool>().happens(|busy, agv, event| if event == Event::Settled {
            let before = std::mem::replace(busy, agv.is_busy());
            if before && !*busy && !agv.order.cancelled {
                agv.errors.forget_refusals();
            }
        });
    tolerance "update-of-a-cleared-order-taken" ["ORD-CLEAR-12"] "It takes over an update of an order that was cleared because of its mode, and drives it."
        => keep::<bool>()
            .happens(|cleared, _, event| match event {
                Event::GivenUpForMode(_) => *cleared = true,
                Event::Begun | Event::Updated | Event::CancelBegun | Event::PowerCycled => *cleared = false,
                _ => {}
            })
            .allows(|cleared, agv, what, usual| usual || *cleared && match what {
                Permission::Overlook(Objection::Cancelled) => true,
                Permission::Overlook(Objection::Joint(first)) => agv.is_within(first, 0.0, true),
                _ => false,
            })
            .adopts(|cleared, agv, adoption| {
                agv.order.cancelled &= !(*cleared && adoption.update);
                true
            });
    tolerance "order-id-survives-power-cycle" ["STATE-MSG-02"] "After it was switched off and on it still reports the orderId and orderUpdateId of its last order."
        => keep::<(String, u32)>().happens(|(id, update_id), agv, event| match event {
            Event::PowerCycled => {
                (agv.order.order_id, agv.order.update_id) = (id.clone(), *update_id);
                agv.order.cancelled = agv.order.has_order();
            }
            Event::Begun | Event::Updated => {
                id.clone_from(&agv.order.order_id);
                *update_id = agv.order.update_id;
            }
            _ => {}
        });
}

/// Whether an order is about to be given up because of the mode.
fn loses_order(agv: &Agv, event: Event) -> bool {
    let Event::ModeChanging(mode) = event else { return false };
    let by_hand = !mode.takes_orders() || !agv.mode.takes_orders();
    by_hand && mode != agv.mode && agv.is_occupied()
}
