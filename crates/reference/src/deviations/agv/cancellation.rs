//! Deviations of how an order is cancelled (section 6.6.3 and figure 9).

use crate::agv::order_state::OrderState;

use super::prelude::*;

records! {
    fault "cancels-whatever-order" ["ORD-CANCEL-25", "ORD-CANCEL-18"] "Cancels the order that it has, whatever order cancelOrder names."
        => forbidding(|_, what| matches!(what, Permission::LeaveOrder));
    fault "another-cancel-halts" ["ORD-CANCEL-25"] "Keeps its order when cancelOrder names another one, and drives no more until it gets a new one."
        => parked()
            .does(|parked, agv, action| {
                let named = action.text("orderId");
                *parked |= is(action, Effect::CancelOrder) && !named.is_empty() && named != agv.order.order_id;
                None
            })
            .happens(|parked, _, event| *parked &= event != Event::Begun);
    fault "named-order-not-cancelled" ["ORD-CANCEL-24"] "Takes a cancelOrder that names an order for one without an order."
        => letting(|_, what| matches!(what, Permission::LeaveOrder));
    fault "cancel-drives-on" ["ORD-CANCEL-02"] "Drives its base to the end before it obeys cancelOrder."
        => allowing(|agv, what, usual| match what {
            Permission::DriveAgainst(Hindrance::Cancellation) => agv.order.cancel.is_some(),
            Permission::CancelAwaitsWay => usual || agv.order.nodes.iter().any(|stop| stop.node.released),
            _ => usual,
        });
    fault "cancel-after-update-drives-on" ["ORD-CANCEL-02"] "It drives on to the end of its base after cancelOrder when the order has been updated before."
        => since_update().allows(|updated, agv, what, usual| match what {
            Permission::DriveAgainst(Hindrance::Cancellation) => *updated && agv.order.cancel.is_some(),
            Permission::CancelAwaitsWay if *updated && !agv.holds.any() => usual || agv.order.nodes.iter().any(|stop| stop.node.released),
            _ => usual,
        });
    fault "cancel-finished-moving" ["ORD-CANCEL-07"] "Reports cancelOrder FINISHED while it still rolls out."
        => allowing(|agv, what, usual| match what {
            Permission::DriveAgainst(Hindrance::Cancellation) => true,
            Permission::CancelAwaitsWay => agv.order.cancel.as_ref().is_some_and(|cancel| cancel.to_node) && !agv.order.nodes.is_empty(),
            _ => usual,
        });
    fault "cancel-in-node-action-drives-to-next-node" ["ORD-CANCEL-02"] "It still drives to the next node when cancelOrder comes while it stands on a node with a running action."
        => letting(|agv, what| {
            let stands = !agv.order.entered && !agv.motion.is_moving();
            matches!(what, Permission::CancelAtNode) && is_acting(agv) && goes_on(agv) && stands
        });
    fault "cancel-keeps-nodes" ["ORD-CANCEL-09"] "Keeps all node states while it drives to the node where it stops."
        => keep::<Option<(VecDeque<Stop>, VecDeque<Edge>)>>()
            .does(|route, agv, action| {
                if is(action, Effect::CancelOrder) {
                    *route = Some((agv.order.nodes.clone(), agv.order.edges.clone()));
                }
                None
            })
            .happens(|route, agv, event| if event == Event::CancelBegun && let Some(route) = route.take() {
                (agv.order.nodes, agv.order.edges) = route;
            })
            .allows(|_, agv, what, usual| match what {
                Permission::CancelAwaitsWay => {
                    let to_node = agv.order.cancel.as_ref().is_some_and(|cancel| cancel.to_node);
                    to_node && agv.order.entered && !agv.order.nodes.is_empty() || agv.motion.is_moving()
                }
                _ => usual,
            });
    fault "cancel-last-node-stale" ["ORD-CANCEL-10"] "Does not report the node where it stopped after a cancellation."
        => forbidding(|agv, what| matches!(what, Permission::Note(_)) && agv.order.cancel.is_some());
    fault "last-node-ahead-when-cancelled" ["STATE-MSG-04"] "Names the node ahead as its last one when it is stopped between two nodes."
        => when(Event::CancelEnding, |agv| if let Some(ahead) = agv.order.nodes.front().filter(|_| agv.order.entered) {
            (agv.order.last_node, agv.order.last_sequence) = (ahead.node.id.clone(), ahead.node.sequence_id);
        });
    fault "cancel-leaves-waiting" ["ORD-CANCEL-03", "ORD-CANCEL-13"] "Leaves the waiting actions of a cancelled order WAITING."
        => breaking(|_, action, usual| usual.filter(|_| action.status != Status::Waiting)).allows(|_, _, what, usual| usual && !matches!(what, Permission::CancelAwaits(_)));
    fault "cancel-leaves-horizon-waiting" ["ORD-CANCEL-03"] "It leaves the actions of the horizon WAITING when its order is cancelled."
        => breaking(|agv, action, usual| usual.filter(|_| action.status != Status::Waiting || !is_planned(agv, action))).allows(|_, agv, what, usual| match what {
            Permission::CancelAwaits(action) => usual && action.status != Status::Waiting,
            Permission::Count(action) => usual && !(agv.order.cancelled && action.status == Status::Waiting),
            _ => usual,
        });
    fault "cancel-lets-run" ["ORD-CANCEL-04"] "Lets interruptible actions run to their end when the order is cancelled." because "It breaks a recommendation only."
        => breaking(|_, action, usual| usual.filter(|_| action.status == Status::Waiting || is(action, Effect::WaitForTrigger)));
    fault "trigger-holds-cancel" ["ACT-38", "ORD-CANCEL-07"] "A waitForTrigger goes on waiting when its order is cancelled, and the cancelOrder with it."
        => breaking(|_, action, usual| usual.filter(|_| action.status == Status::Waiting || !is(action, Effect::WaitForTrigger)));
    fault "trigger-survives-cancel" ["ACT-38"] "Reports waitForTrigger FINISHED when its order is cancelled."
        => breaking(|_, action, usual| match action.status {
            status if status.is_active() && is(action, Effect::WaitForTrigger) => usual.map(|_| Status::Finished),
            _ => usual,
        });
    fault "cancelled-action-finished" ["ORD-CANCEL-04"] "It reports running actions that it breaks off for a cancellation as FINISHED."
        because "ORD-CANCEL-04 recommends FAILED; an action that is called off at its end may be FINISHED."
        => breaking(|_, action, usual| match action.status {
            status if status.is_active() && !is(action, Effect::WaitForTrigger) => usual.map(|_| Status::Finished),
            _ => usual,
        });
    fault "cancel-finishes-horizon-actions" ["ORD-CANCEL-03", "ASTATE-05"] "When an order is cancelled, the waiting actions of its horizon are reported FINISHED."
        => breaking(|agv, action, usual| match action.status {
            Status::Waiting if is_planned(agv, action) => Some(Status::Finished),
            _ => usual,
        });
    fault "fails-after-finished" ["ASTATE-06", "ORD-CANCEL-12"] "Reports finished actions FAILED when their order is cancelled."
        => breaking(|_, action, usual| match action.status {
            Status::Finished => Some(Status::Failed),
            _ => usual,
        });
    fault "cancel-misses-edge-actions" ["ORD-CANCEL-03"] "Leaves the waiting actions of edges WAITING when the order is cancelled."
        => surviving(|action| action.status == Status::Waiting && of_edge(action));
    fault "cancel-leaves-edge-action-running" ["ORD-CANCEL-07", "ORD-CANCEL-06", "ORD-CANCEL-04"] "It ends the node actions on cancelOrder but leaves the action of the current edge RUNNING."
        => surviving(|action| action.status.is_active() && of_edge(action));
    fault "prepared-actions-survive-cancel" ["ORD-CANCEL-06", "ORD-CANCEL-07"] "Reports cancelOrder FINISHED while it prepares an action, and performs it."
        => surviving(|action| action.status == Status::Initializing);
    fault "paused-actions-survive-cancel" ["ORD-CANCEL-06", "ORD-CANCEL-07"] "Reports cancelOrder FINISHED while actions are PAUSED, and goes on with them after the pause."
        => surviving(|action| action.status == Status::Paused);
    fault "queued-actions-survive-cancel" ["ORD-CANCEL-03"] "Actions of the node where the vehicle stands that wait behind another one are performed after cancelOrder."
        => breaking(|agv, action, usual| {
            let queued = action.status == Status::Waiting && action.origin == Origin::Node(agv.order.last_sequence);
            usual.filter(|_| !queued)
        })
        .allows(|_, _, what, usual| usual && !matches!(what, Permission::ForgetQueue));
    fault "cancel-drops-waiting" ["ORD-CANCEL-12", "ORD-CANCEL-03", "STATE-MSG-10"] "cancelOrder removes the actions that have not begun from actionStates instead of reporting them FAILED."
        => keep::<Vec<String>>()
            .does(|waiting, agv, action| {
                if is(action, Effect::CancelOrder) {
                    let unbegun = agv.actions.iter().filter(|action| action.of_order() && action.status == Status::Waiting);
                    *waiting = unbegun.map(Action::id).collect();
                }
                None
            })
            .happens(|waiting, agv, event| if event == Event::CancelBegun {
                agv.actions.retain(|action| !waiting.contains(&action.request.id));
            });
    fault "cancel-fails-early" ["ORD-CANCEL-05"] "Reports an action FAILED on cancellation and FINISHED when it ends." because "It breaks a recommendation only."
        => action(|agv, action, m| {
            if agv.order.cancel.is_some() && action.of_order() && action.status.is_active() {
                m.set("actionStatus", "FAILED");
            }
            true
        });
    fault "cancel-finished-early" ["ORD-CANCEL-06", "ORD-CANCEL-07"] "Reports cancelOrder FINISHED while an action still runs."
        => plain()
            .happens(|(), agv, event| if event == Event::CancelBegun { agv.flush() })
            .allows(|(), _, what, usual| usual && !matches!(what, Permission::CancelAwaits(_)));
    fault "uncancellable-action-failed-at-once" ["ORD-CANCEL-05", "ORD-CANCEL-06"] "It reports an action that cannot be broken off FAILED, and cancelOrder FINISHED, as soon as its order is cancelled, and works on until the action has ended."
        => keep::<Vec<String>>()
            .happens(|going, agv, event| match event {
                Event::CancelBegun => {
                    let active = agv.actions.iter().filter(|action| action.of_order() && action.status.is_active());
                    *going = active.map(Action::id).collect();
                }
                Event::PowerCycled => going.clear(),
                _ => {}
            })
            .allows(|going, _, what, usual| match what {
                Permission::CancelAwaits(action) | Permission::Count(action) => usual && !going.contains(&action.request.id),
                Permission::Forget(action) => usual && !(going.contains(&action.request.id) && action.status.is_active()),
                _ => usual,
            })
            .says(|going, agv, part, m| match part {
                Part::Action(action) if going.contains(&action.request.id) => {
                    m.set("actionStatus", "FAILED");
                    agv.order.cancelled || agv.order.cancel.is_some()
                }
                _ => true,
            });
    fault "cancel-not-running" ["ORD-CANCEL-06", "ASTATE-05", "ORD-CANCEL-29"] "It reports cancelOrder WAITING instead of RUNNING as long as an action is still running."
        => when(Event::CancelBegun, |agv| if let Some(cancel) = &agv.order.cancel && let Some(action) = agv.actions.get_mut(&cancel.action_id) {
            action.status = Status::Waiting;
        })
        .allows(|_, agv, what, usual| {
            let under_way = agv.order.cancel.as_ref().map(|cancel| &cancel.action_id);
            usual && !matches!(what, Permission::BeginInstant(action) if Some(&action.request.id) == under_way)
        });
    fault "cancel-waits-for-pause" ["ORD-CANCEL-07"] "Does not finish cancelOrder as long as it is paused."
        => forbidding(|agv, what| matches!(what, Permission::EndCancel) && agv.holds.pause);
    fault "cancel-never-finished" ["ORD-CANCEL-07", "IACT-04"] "Leaves cancelOrder RUNNING for ever."
        => when(Event::Cancelled, |agv| {
            let ended = agv.actions.iter_mut().filter(|action| is(action, Effect::CancelOrder) && action.status == Status::Finished);
            ended.for_each(|action| action.status = Status::Running);
        });
    fault "route-dropped-after-cancel-finished" ["ORD-CANCEL-11"] "It reports cancelOrder FINISHED in a state that still lists nodes and edges, and empties the lists in the next one."
        => when(Event::CancelEnding, |agv| {
            if let Some(cancel) = &agv.order.cancel && let Some(action) = agv.actions.get_mut(&cancel.action_id) {
                action.end(Status::Finished);
            }
            agv.flush();
        });
    fault "cancel-keeps-current-edge" ["ORD-CANCEL-11", "STATE-13"] "Cancelled between two nodes, it keeps the edge it stands on in its edge states."
        => keep::<Option<Edge>>().happens(|edge, agv, event| match event {
            Event::CancelEnding => *edge = agv.order.edges.front().filter(|_| agv.order.entered).cloned(),
            Event::Cancelled => agv.order.edges.extend(edge.take()),
            _ => {}
        });
    fault "cancel-leaves-nodes" ["ORD-CANCEL-11", "STATE-13"] "Keeps the node and edge states of a cancelled order."
        => leaving_route();
    fault "cancelled-order-stands" ["ORD-CANCEL-11", "STATE-13"] "Keeps the node and edge states of a cancelled order, and refuses new orders because of them until it is asked to cancel once more."
        => leaving_route().objects(|_, agv, _, relation| {
            let stands = relation == Relation::New && agv.order.cancelled && !agv.order.nodes.is_empty();
            stands.then(|| Refusal::new(Rule::OtherOrderActive, "another order is active"))
        });
    fault "cancel-clears-order-id" ["ORD-CANCEL-08", "STATE-MSG-02"] "Empties the orderId when the order is cancelled."
        => when(Event::Cancelled, |agv| agv.order.order_id.clear());
    fault "cancel-resets-update-id" ["ORD-CANCEL-08", "STATE-MSG-02"] "Sets the orderUpdateId back to 0 when the order is cancelled."
        => when(Event::Cancelled, |agv| agv.order.update_id = 0);
    fault "cancel-clears-last-node" ["STATE-MSG-04"] "Empties the lastNodeId when the order is cancelled."
        => when(Event::Cancelled, |agv| agv.order.last_node.clear());
    fault "cancel-clears-order-warnings" ["ORD-REJ-03", "ORD-REJ-08"] "It empties errors when cancelOrder is finished, so that a validationError or orderError ends before a new order is accepted."
        => when(Event::Cancelled, |agv| agv.errors.new_order());
    fault "cancel-forgets-load" ["STATE-MSG-06"] "Shows no load any more when its order is cancelled."
        => when(Event::Cancelled, |agv| agv.loads.clear());
    fault "cancel-drops-actions" ["ORD-CANCEL-12", "STATE-MSG-10"] "Removes the action states of a cancelled order."
        => when(Event::Cancelled, |agv| agv.actions.retain(|action| !action.of_order()));
    fault "cancel-forgets-actions" ["ORD-CANCEL-12", "STATE-MSG-10"] "Forgets the actions of a cancelled order a moment later."
        => keep::<Option<Moment>>()
            .happens(|due, agv, event| match event {
                Event::Cancelled => *due = Some(agv.moment() + MOMENT),
                Event::Woken if due.take_if(|due| *due <= agv.moment()).is_some() => agv.actions.retain(|action| !action.of_order()),
                _ => {}
            })
            .due(|due, _| *due);
    fault "paused-order-survives-cancel" ["ORD-CANCEL-02"] "Goes on with an order that was cancelled in a pause when the pause ends."
        => keep::<Option<OrderState>>()
            .does(|order, agv, action| {
                if is(action, Effect::CancelOrder) && agv.holds.pause && has_order(agv) {
                    *order = Some(agv.order.clone());
                }
                None
            })
            .ends(|order, agv, action, outcome| {
                if is(action, Effect::StopPause) && matches!(outcome, Outcome::Done(_)) && let Some(order) = order.take() {
                    agv.order = order;
                }
                outcome
            });
    fault "second-cancel-takes-over" ["ORD-CANCEL-07", "IACT-04"] "Forgets a cancelOrder that is under way when a second one comes."
        => instead(Effect::CancelOrder, |agv, action| {
            agv.order.cancel.as_mut()?.action_id.clone_from(&action.request.id);
            agv.actions.get_mut(&action.request.id)?.status = Status::Running;
            Some(Outcome::Open)
        });
    fault "cancel-at-decision-point-refused" ["ORD-CANCEL-07", "ORD-CANCEL-11"] "cancelOrder at the decision point is FAILED with noOrderToCancel because the base is done, and the horizon stays."
        => instead(Effect::CancelOrder, |agv, action| {
            let waits = agv.waits_at_decision_point() && !agv.motion.is_moving() && !is_acting(agv);
            waits.then(|| refuse(agv, action))
        });
    fault "cancel-of-acting-order-refused" ["ORD-CANCEL-07", "ORD-CANCEL-03"] "cancelOrder is FAILED with noOrderToCancel when all nodes are traversed, although an action of the order is still running."
        => instead(Effect::CancelOrder, |agv, action| agv.order.nodes.is_empty().then(|| refuse(agv, action)));
    fault "completed-order-cancel-finished" ["ORD-CANCEL-18", "ORD-CANCEL-19"] "cancelOrder after a completed order is reported FINISHED and without an error."
        => instead(Effect::CancelOrder, |agv, _| {
            let complete = agv.order.has_order() && !has_order(agv) && !agv.order.cancelled;
            complete.then_some(Outcome::Done(None))
        });
    fault "idle-cancel-finished" ["ORD-CANCEL-18"] "Reports cancelOrder FINISHED although there is no order."
        => nothing_to_cancel(|agv, e| finished(agv, e));
    fault "second-cancel-finished" ["ORD-CANCEL-18"] "A cancelOrder after the order was cancelled already is reported FINISHED."
        => nothing_to_cancel(|agv, e| !agv.order.cancelled || finished(agv, e));
    tolerance "second-cancel-ends-with-the-first" ["ORD-CANCEL-18", "ASTATE-05"] "It answers a second cancelOrder that comes while the first is RUNNING with RUNNING and lets both finish together."
        => keep::<Vec<String>>()
            .does(|others, agv, action| {
                let under_way = is(action, Effect::CancelOrder) && agv.order.cancel.is_some();
                under_way.then(|| {
                    if let Some(other) = agv.actions.get_mut(&action.request.id) {
                        other.status = Status::Running;
                    }
                    others.push(action.id());
                    Outcome::Open
                })
            })
            .happens(|others, agv, event| if matches!(event, Event::Cancelled | Event::GivenUp) {
                for id in others.drain(..) {
                    if let Some(action) = agv.actions.get_mut(&id) {
                        action.end(Status::Finished);
                    }
                }
            });
    tolerance "cancel-takes-time" ["ORD-CANCEL-07", "ACT-41"] "A cancelOrder is RUNNING for some tenths of a second also if it has nothing to wait for."
        => keep::<Option<Moment>>()
            .happens(|until, agv, event| match event {
                Event::CancelBegun => *until = Some(agv.moment() + Duration::from_millis(400)),
                Event::Woken => *until = until.filter(|until| *until > agv.moment()),
                _ => {}
            })
            .allows(|until, _, what, usual| usual && !(matches!(what, Permission::EndCancel) && until.is_some()))
            .due(|until, _| *until);
    tolerance "cancel-in-steps" ["ORD-CANCEL-06", "STATE-11"] "It reports cancelOrder RUNNING with all actions ended in a state of its own before it reports FINISHED."
        => when(Event::CancelBegun, Agv::flush);
    tolerance "idle-cancel-error-brief" ["ORD-CANCEL-19", "STATE-05"] "It reports noOrderToCancel in one state and takes it back at once."
        => nothing_to_cancel(|agv, e| {
            e.life = Life::Until(agv.moment() + brief(agv));
            true
        });
    tolerance "no-order-warning-until-next-order" ["ORD-CANCEL-19", "ERR-01", "ERR-03"] "It keeps noOrderToCancel in its errors until it accepts a new order."
        => nothing_to_cancel(|_, e| {
            e.life = Life::UntilNewOrder;
            true
        });
}

/// Keeps the nodes and edges of a cancelled order until it is asked to cancel once more.
fn leaving_route() -> Box<Hooks<Option<OrderState>>> {
    keep::<Option<OrderState>>()
        .happens(|before, agv, event| match event {
            Event::CancelEnding => *before = Some(agv.order.clone()),
            Event::Cancelled => {
                if let Some(before) = before.take() {
                    (agv.order.nodes, agv.order.edges, agv.order.entered) =
                        (before.nodes, before.edges, before.entered);
                    if before.cancel.is_some_and(|cancel| cancel.to_node) {
                        // All that was left was this node.
                        agv.order.nodes.extend(agv.order.left.0.clone());
                    }
                }
            }
            _ => {}
        })
        .raises(|_, agv, cause, _| {
            if matches!(cause, Cause::NothingToCancel) {
                agv.order.drop_route();
            }
            true
        })
}

fn of_edge(action: &Action) -> bool {
    matches!(action.origin, Origin::Edge(_))
}

/// Whether anything is left of the order.
fn has_order(agv: &Agv) -> bool {
    !agv.order.nodes.is_empty() || agv.actions.order_unfinished()
}

/// Whether an action belongs to the horizon.
fn is_planned(agv: &Agv, action: &Action) -> bool {
    match action.origin {
        Origin::Node(id) | Origin::Edge(id) => id > agv.order.base_end.1,
        Origin::Instant | Origin::Zone(_) => false,
    }
}

/// Says that there is nothing to cancel.
fn refuse(agv: &mut Agv, action: &Action) -> Outcome {
    agv.nothing_to_cancel(&action.request.id);
    Outcome::Open
}

/// Says FINISHED of a cancelOrder that found no order.
fn finished(agv: &mut Agv, error: &ActiveError) -> bool {
    let id = error.references.first().map(|(_, id)| id.clone());
    if let Some(action) = id.and_then(|id| agv.actions.get_mut(&id)) {
        action.end(Status::Finished);
    }
    true
}

/// Misses some actions when the order is cancelled.
fn surviving(which: fn(&Action) -> bool) -> Box<dyn Deviation> {
    holding(which)
        .breaks(|which, _, action, usual| usual.filter(|_| !which(action)))
        .allows(|which, _, what, usual| usual && !matches!(what, Permission::CancelAwaits(action) if which(action)))
}
