//! Deviations of order updates: which are refused, how they are joined, and what becomes of the horizon (section 6.6.2).

use super::orders::has_failed;

use super::prelude::*;

records! {
    fault "stitching-node-overwritten" ["ORD-UPD-07"] "Takes over the actions an update brings for the stitching node."
        => updating(|agv, order| {
            let joint = &order.nodes[0];
            let origin = Origin::Node(joint.sequence_id);
            agv.actions.retain(|action| action.origin != origin || action.status.is_terminal());
            agv.push_actions(joint.actions.clone(), origin);
            if !is_ahead(agv, joint.sequence_id) {
                agv.trigger_actions(origin);
            }
        });
    fault "joint-actions-repeated" ["ORD-UPD-07", "ASTATE-06"] "An update that repeats the actions of a stitching node already traversed makes it do them again."
        => updating(|agv, order| {
            let joint = &order.nodes[0];
            if !is_ahead(agv, joint.sequence_id) && !joint.actions.is_empty() {
                agv.repeat_actions(joint.sequence_id);
            }
        });
    fault "joint-pick-unseen" ["ORD-UPD-07"] "An update that repeats the pick of a stitching node already traversed makes it pick once more, over before the next state."
        => updating(|agv, order| {
            let joint = &order.nodes[0];
            let origin = Origin::Node(joint.sequence_id);
            let is_pick = |action: &Action| action.origin == origin && is(action, Effect::Pick) && action.status == Status::Finished;
            let repeats = !is_ahead(agv, joint.sequence_id) && !joint.actions.is_empty() && agv.actions.iter().any(is_pick);
            if let Some(load) = agv.loads.last().filter(|_| repeats).cloned() {
                agv.loads.push(load);
            }
        });
    fault "joint-position-replaced" ["ORD-UPD-07"] "It replaces the nodePosition of a stitching node still ahead by the one in the update."
        => updating(|agv, order| {
            let joint = &order.nodes[0];
            let place = agv.place(joint);
            for stop in agv.order.nodes.iter_mut().filter(|stop| stop.node.sequence_id == joint.sequence_id) {
                stop.node.position.clone_from(&joint.position);
                stop.node.sent_position.clone_from(&joint.sent_position);
                stop.place = place.clone().unwrap_or_else(|| stop.place.clone());
            }
        });
    fault "joint-listed-twice" ["ORD-FLOW-09", "STATE-12"] "An update makes it list the stitching node twice in its node states as long as it is ahead."
        => updating(|agv, order| {
            let joint = order.nodes[0].sequence_id;
            let again = agv.order.nodes.iter().find(|stop| stop.node.sequence_id == joint).cloned();
            agv.order.nodes.extend(again);
        });
    fault "running-update-gap-accepted" ["ORD-FLOW-08"] "Takes over an update that does not begin at the decision point."
        => overlooking(|agv, what| matches!(what, Objection::Joint(_)) && runs(agv));
    fault "completed-update-gap-accepted" ["ORD-FLOW-10"] "Continues a completed order from whatever node the update begins with."
        => overlooking(|agv, what| matches!(what, Objection::Joint(_)) && !runs(agv));
    fault "update-joined-by-number" ["ORD-FLOW-08"] "Joins an update by its sequenceId, whatever the node."
        => overlooking(|agv, what| matches!(what, Objection::Joint(first) if runs(agv) && first.sequence_id == agv.order.base_end.1));
    fault "joint-sequence-unchecked" ["ORD-FLOW-08"] "It joins an update to its running order by the nodeId alone, whatever the sequenceId of the first node."
        => overlooking(|agv, what| matches!(what, Objection::Joint(first) if runs(agv) && first.id == agv.order.base_end.0));
    fault "joint-node-unchecked" ["ORD-FLOW-10"] "It joins an update to its completed order by the sequenceId alone, whatever the nodeId of the first node."
        => overlooking(|agv, what| matches!(what, Objection::Joint(first) if !runs(agv) && first.sequence_id == agv.order.last_sequence));
    fault "cancelled-order-revived" ["ORD-FLOW-10", "ORD-CANCEL-02", "ORD-CANCEL-11", "ORD-CANCEL-21"] "Goes on with a cancelled order when an update of it comes late."
        => updating(|agv, _| revive(agv)).allows(|_, _, what, usual| usual || matches!(what, Permission::Overlook(Objection::Cancelled)));
    fault "update-after-cancel-called-outdated" ["ORD-CANCEL-21"] "Reports an update of a cancelled order as an outdated one."
        => refusal(|agv, _, _, e| {
            if e.error_type == agv.config.errors.after_cancel {
                e.error_type.clone_from(&agv.config.errors.outdated_update);
            }
            true
        });
    fault "cancel-ended-by-update" ["ORD-CANCEL-11", "ORD-CANCEL-02", "ORD-CANCEL-06"] "Ends a cancellation that is under way when an update comes, and drives it."
        => updating(|agv, _| revive(agv)).allows(|_, agv, what, usual| usual || matches!(what, Permission::Overlook(Objection::Cancelled)) && agv.order.cancel.is_some());
    fault "update-ids-compared-as-text" ["ORD-UPD-18", "ORD-FLOW-09", "ORD-REJ-12"] "It compares orderUpdateId as text, so that the update 10 is older than the update 9."
        => objecting(|agv, order, relation| {
            let older = relation == Relation::Update && order.update_id.to_string() < agv.order.update_id.to_string();
            older.then(|| Refusal::new(Rule::Outdated, "the order update is older than the current one"))
        });
    fault "only-first-update" ["ORD-FLOW-09", "ORD-06"] "Refuses every further update of an order that was updated before."
        => since_update().objects(|updated, _, _, relation| (*updated && relation == Relation::Update).then(|| broken("no update is taken now")));
    fault "update-refused-while-acting" ["ORD-FLOW-09"] "Refuses updates while an action of the order runs."
        => refused(|agv, _| is_acting(agv));
    fault "update-refused-while-paused" ["ORD-FLOW-09"] "Refuses updates while it is paused."
        => refused(|agv, _| agv.holds.pause);
    fault "update-refused-after-cut" ["ORD-FLOW-09"] "Refuses updates of an order that it had before its link broke."
        => keep::<bool>()
            .happens(|cut, _, event| *cut = match event {
                Event::ConnectionLost => true,
                Event::Begun => false,
                _ => *cut,
            })
            .objects(|cut, _, _, relation| (*cut && relation == Relation::Update).then(|| broken("no update is taken now")));
    fault "completed-not-continued" ["ORD-FLOW-11"] "Refuses updates of a completed order."
        => refused(|agv, _| !agv.is_busy());
    fault "failed-order-not-continued" ["ORD-FLOW-11"] "It refuses to continue a completed order by an update when one of its actions had failed."
        => refused(|agv, _| !agv.is_busy() && has_failed(agv));
    fault "stitch-only-update-refused" ["ORD-UPD-09"] "An update that holds nothing but the stitching node, to delete the horizon, is rejected."
        => refused(|_, order| order.nodes.len() == 1);
    fault "update-of-horizon-only-refused" ["ORD-UPD-08"] "It refuses an update that changes only the horizon and releases nothing new."
        => refused(|_, order| only_plans(order));
    fault "second-extension-refused" ["ORD-FLOW-09", "ORD-UPD-08"] "It rejects a second order update that arrives before it has reached the last base node of the first order message, because it compares with that old decision point."
        => keep::<(u32, bool)>()
            .happens(|(first_base, updated), agv, event| match event {
                Event::Begun => (*first_base, *updated) = (agv.order.base_end.1, false),
                Event::Updated => *updated = true,
                _ => {}
            })
            .objects(|(first_base, updated), agv, _, relation| {
                let refused = *updated && relation == Relation::Update && is_ahead(agv, *first_base);
                refused.then(|| broken("the update does not continue the order"))
            });
    fault "horizon-appended" ["ORD-UPD-08"] "Keeps the old horizon when an update brings a new one."
        => letting(|_, what| matches!(what, Permission::KeepHorizon(order) if order.nodes.iter().any(|node| !node.released)));
    fault "horizon-kept" ["ORD-UPD-09"] "Keeps the old horizon when an update has none."
        => letting(|_, what| matches!(what, Permission::KeepHorizon(order) if order.nodes.iter().all(|node| node.released)));
    fault "horizon-actions-stay" ["ORD-UPD-10"] "Lets the actions of a deleted horizon wait for ever." because "It breaks a recommendation only."
        => when(Event::HorizonDropped, |agv| strand(agv, |_| true, Origin::Node(u32::MAX)));
    fault "old-horizon-edge-actions-linger" ["ORD-UPD-10"] "It removes the node actions of a replaced horizon but leaves its edge actions WAITING, so that the next new order is refused."
        because "What becomes of the actions of a replaced horizon is not described; ORD-UPD-10 is a recommendation."
        => when(Event::HorizonDropped, |agv| strand(agv, |action| matches!(action.origin, Origin::Edge(_)), Origin::Edge(u32::MAX)));
    fault "horizon-actions-inherited" ["ORD-UPD-08"] "Performs the actions of a horizon that was replaced on the nodes that took its place."
        => forbidding(|_, what| matches!(what, Permission::ForgetWithHorizon));
    fault "horizon-edges-stay" ["ORD-UPD-08", "ORD-UPD-09", "STATE-12"] "When an update replaces the horizon, the edges of the old one stay in its edge states."
        => keep::<Vec<Edge>>()
            .adopts(|edges, agv, _| {
                *edges = agv.order.edges.iter().filter(|edge| !edge.released).cloned().collect();
                true
            })
            .happens(|edges, agv, event| if event == Event::HorizonDropped {
                agv.order.edges.extend(edges.drain(..));
            });
    fault "horizon-change-ignored" ["ORD-UPD-08"] "An update that brings only another horizon is acknowledged with its orderUpdateId, but the old horizon stays."
        => plain().adopts(|(), agv, adoption| {
            let ignored = adoption.update && only_plans(adoption.order);
            if ignored {
                agv.order.update_id = adoption.order.update_id;
            }
            !ignored
        });
    fault "new-horizon-lost-while-driving" ["ORD-UPD-08", "ORD-FLOW-09"] "It takes over only the released part of an update that comes while it drives; the new horizon is lost."
        => updating(|agv, order| if agv.motion.is_moving() {
            order.nodes.retain(|node| node.released);
            order.edges.retain(|edge| edge.released);
        });
    fault "horizon-update-driven" ["ORD-07", "ORD-UPD-08", "ORD-UPD-01"] "It takes an update that only plans a new horizon as a release, and drives into that horizon."
        => unbound()
            .adopts(|unbound, _, adoption| {
                *unbound |= adoption.update && only_plans(adoption.order);
                true
            })
            .happens(|unbound, _, event| *unbound &= event != Event::Begun);
    fault "horizon-deletion-shortens-base" ["ORD-UPD-09", "ORD-06"] "It also deletes the base still to be driven when an update deletes the horizon."
        => updating(|agv, order| if order.nodes.len() == 1 && agv.order.nodes.iter().any(|stop| !stop.node.released) { shorten_base(agv) });
    fault "update-replaces-base" ["ORD-FLOW-09"] "Forgets what was left of the base when an update arrives."
        => when(Event::HorizonDropped, |agv| while agv.order.nodes.len() > 1 {
            agv.order.nodes.pop_front();
            agv.order.edges.pop_front();
        });
    fault "update-id-kept" ["ORD-FLOW-09"] "Executes an update but keeps reporting the old orderUpdateId."
        => updating(|agv, order| order.update_id = agv.order.update_id);
    fault "stitch-only-update-id-kept" ["ORD-UPD-09", "ORD-FLOW-09"] "It deletes its horizon by an update that consists of the stitching node only, but keeps the old orderUpdateId."
        => updating(|agv, order| if order.nodes.len() == 1 { order.update_id = agv.order.update_id });
    fault "first-state-after-update-has-old-lists" ["STATE-MSG-13", "ORD-FLOW-09", "STATE-12"] "It publishes the new orderUpdateId at once with the old node and edge states and corrects them only in the next state."
        => updating(|agv, order| {
            let update_id = std::mem::replace(&mut agv.order.update_id, order.update_id);
            agv.flush();
            agv.order.update_id = update_id;
        });
    fault "update-puts-new-nodes-in-front" ["STATE-12", "ORD-FLOW-09"] "It puts the nodes of an update before those still to be driven in nodeStates."
        => keep::<Option<u32>>()
            .adopts(|joint, agv, adoption| {
                *joint = adoption.update.then_some(agv.order.base_end.1);
                true
            })
            .says(|joint, _, part, m| {
                if let (Some(joint), Part::State) = (joint, part) {
                    // A stable sort: both parts keep their sequence.
                    m.list("nodeStates").sort_by_key(|node| node["sequenceId"].as_u64() <= Some(u64::from(*joint)));
                }
                true
            });
    fault "continuation-not-driven" ["ORD-06", "ORD-FLOW-11"] "Takes over an update of a completed order and does not drive it."
        => since_continuation().allows(|continued, _, what, usual| usual && !(*continued && matches!(what, Permission::SetOut(_))));
    fault "continuation-actions-skipped" ["ORD-FLOW-11", "NODE-04"] "It drives the continuation of a completed order but never begins the node actions in it."
        => since_continuation().allows(|continued, _, what, usual| usual && !(*continued && matches!(what, Permission::Trigger(Origin::Node(_)))));
    fault "stops-at-stitch" ["ORD-06", "ORD-FLOW-09"] "An update that arrives while it drives is taken over, but it stands still for ever at the stitching node."
        => stuck().adopts(|at, agv, adoption| {
            if adoption.update && agv.is_busy() && agv.motion.is_moving() {
                *at = Some(agv.order.base_end.1);
            }
            true
        });
    fault "update-in-pause-not-driven" ["ORD-06", "ACT-14"] "It takes over an update that comes while it is paused, but after stopPause it does not drive beyond the old decision point."
        => stuck().adopts(|at, agv, adoption| {
            if adoption.update {
                *at = agv.holds.pause.then_some(agv.order.base_end.1);
            }
            true
        });
    fault "update-at-decision-point-not-driven" ["ORD-FLOW-07", "ORD-FLOW-09"] "It takes an update over in the state but does not drive on when it already stands waiting at the decision point."
        => parked()
            .adopts(|parked, agv, adoption| {
                *parked |= adoption.update && agv.waits_at_decision_point() && !agv.motion.is_moving();
                true
            })
            .happens(|parked, _, event| *parked &= event != Event::Begun);
    fault "update-drives-in-pause" ["ACT-12", "STATE-MSG-08"] "An update that arrives during a pause makes it drive although it stays paused."
        => heedless()
            .adopts(|heedless, agv, adoption| {
                *heedless |= adoption.update && agv.holds.pause;
                true
            })
            .happens(|heedless, _, event| *heedless &= !matches!(event, Event::Begun | Event::Resuming));
    fault "update-breaks-blocking" ["BLOCK-04", "BLOCK-07"] "Drives off with an update although an action that stops it still runs."
        => since_update().allows(|updated, _, what, usual| usual || *updated && matches!(what, Permission::DriveAgainst(Hindrance::Action)));
    fault "update-ends-pause" ["ACT-12"] "Goes on with an update although it is paused."
        => updating(|agv, _| agv.set_holds(|holds| holds.pause = false));
    fault "update-actions-lost" ["ASTATE-01", "ACT-01"] "Takes over an update without the actions of its nodes and edges."
        => updating(|_, order| {
            order.nodes.iter_mut().skip(1).for_each(|node| node.actions.clear());
            order.edges.iter_mut().for_each(|edge| edge.actions.clear());
        });
    fault "update-edge-actions-lost" ["ASTATE-01", "ACT-01"] "Takes over an update without the actions of its edges."
        => updating(|_, order| order.edges.iter_mut().for_each(|edge| edge.actions.clear()));
    fault "update-actions-not-performed" ["ACT-01", "NODE-04"] "Lists the actions of an update and never begins them."
        => keep::<Option<u32>>()
            .happens(|end, agv, event| if event == Event::Begun {
                *end = agv.order.nodes.back().map(|stop| stop.node.sequence_id);
            })
            .allows(|end, _, what, usual| usual && !matches!((end, what), (Some(end), Permission::Trigger(Origin::Node(id))) if id > *end));
    fault "released-actions-lost" ["ASTATE-01"] "Forgets an action of its horizon when an update releases it."
        => updating(|agv, order| {
            let planned: Vec<String> = agv.actions.iter().filter(|action| is_planned(agv, action)).map(Action::id).collect();
            let lists = order.nodes.iter_mut().map(|node| &mut node.actions);
            let lists = lists.chain(order.edges.iter_mut().map(|edge| &mut edge.actions));
            lists.for_each(|actions| actions.retain(|action| !planned.contains(&action.id)));
        });
    fault "released-actions-doubled" ["STATE-MSG-09", "ASTATE-01"] "Lists an action of its horizon a second time when an update releases it."
        => keep::<Vec<Action>>()
            .adopts(|planned, agv, adoption| {
                let again = |action: &&Action| is_planned(agv, action) && adoption.order.actions().any(|other| other.id == action.request.id);
                *planned = agv.actions.iter().filter(again).cloned().collect();
                true
            })
            .allows(|_, _, what, usual| usual && !matches!(what, Permission::ForgetWithHorizon))
            .happens(|planned, agv, event| if event == Event::Updated {
                planned.drain(..).for_each(|action| agv.actions.push(action));
            });
    fault "update-clears-action-states" ["STATE-MSG-10"] "Removes its finished actions from the states when an update comes."
        => updating(|agv, _| agv.actions.retain(|action| !action.of_order() || !action.status.is_terminal()));
    fault "update-forgets-instant-actions" ["STATE-MSG-10", "STATE-MSG-09", "IACT-STATE-01"] "An accepted update removes the ended instant actions from its action states."
        => updating(|agv, _| agv.actions.retain(|action| action.of_order() || !action.status.is_terminal()));
    fault "continuation-clears-action-states" ["STATE-MSG-10", "STATE-MSG-09"] "It empties actionStates, as for a new order, when an update continues a completed order."
        => updating(|agv, _| if !agv.is_busy() { agv.actions.retain(|action| !action.status.is_terminal()) });
    fault "update-repeats-actions" ["ASTATE-06"] "Performs the actions of its last node once more when an update comes."
        => updating(|agv, _| {
            let here = Origin::Node(agv.order.last_sequence);
            let ended = agv.actions.iter_mut().filter(|action| action.origin == here && action.status.is_terminal());
            ended.for_each(|action| action.end(Status::Waiting));
            agv.trigger_actions(here);
        });
    fault "update-ends-actions" ["ORD-FLOW-09"] "Breaks off its running actions when an update comes."
        => updating(|agv, _| {
            let active = agv.actions.iter_mut().filter(|action| action.of_order() && action.status.is_active());
            active.for_each(|action| action.end(Status::Failed));
        });
    fault "update-serves-as-trigger" ["ACT-37"] "It ends a running waitForTrigger as FINISHED when an order update comes."
        => when(Event::Updated, |agv| agv.trigger(""));
    fault "max-speed-of-update-ignored" ["ORD-MSG-20", "OPT-01"] "maxSpeed is kept to on the edges of the first order message only; on edges that came with an update it is ignored."
        => updating(|_, order| order.edges.iter_mut().for_each(|edge| edge.max_speed = None));
    fault "trajectory-of-update-ignored" ["ORD-MSG-26", "OPT-01"] "It follows the trajectories of a new order but drives straight on the edges that came by an update."
        because "ORD-MSG-26, that a trajectory is followed, is a recommendation, also for one that came with an update."
        => updating(|_, order| order.edges.iter_mut().for_each(|edge| edge.trajectory = None));
    tolerance "horizon-actions-fail" ["ORD-UPD-10", "STATE-MSG-10"] "It keeps the actions of a horizon that was deleted in its action states, as FAILED."
        => when(Event::HorizonDropped, |agv| {
            let base_end = agv.order.base_end.1;
            for action in agv.actions.iter_mut().filter(|action| is_behind(action, base_end)) {
                if !action.status.is_terminal() {
                    action.end(Status::Failed);
                }
                action.origin = Origin::Node(u32::MAX);
            }
        });
}

fn is_ahead(agv: &Agv, sequence_id: u32) -> bool {
    agv.order.nodes.iter().any(|stop| stop.node.sequence_id == sequence_id)
}

/// Whether an update has to begin at the decision point.
fn runs(agv: &Agv) -> bool {
    agv.is_busy() || agv.order.cancelled
}

/// Whether everything behind the stitching node is horizon.
fn only_plans(order: &Order) -> bool {
    order.nodes.len() > 1 && order.nodes.iter().skip(1).all(|node| !node.released)
}

fn broken(reason: &str) -> Refusal {
    Refusal::new(Rule::BrokenUpdate, reason)
}

type Refused = fn(&Agv, &Order) -> bool;

/// Refuses updates that should be taken over.
fn refused(which: Refused) -> Box<dyn Deviation> {
    holding(which).objects(|which, agv, order, relation| {
        let refused = relation == Relation::Update && which(agv, order);
        refused.then(|| broken("no update is taken now"))
    })
}

/// Knows whether the order was complete before and is continued.
fn since_continuation() -> Box<Hooks<bool>> {
    keep::<bool>().adopts(|continued, agv, adoption| {
        *continued = adoption.update && (*continued || !agv.is_busy());
        true
    })
}

/// Stands still for ever at a node.
fn stuck() -> Box<Hooks<Option<u32>>> {
    keep::<Option<u32>>()
        .happens(|at, _, event| {
            if event == Event::Begun {
                *at = None;
            }
        })
        .allows(|at, agv, what, usual| {
            usual && !(matches!(what, Permission::SetOut(_)) && *at == Some(agv.order.last_sequence))
        })
}

/// Goes on with an order that was cancelled.
fn revive(agv: &mut Agv) {
    agv.order.cancelled = false;
    if let Some(cancel) = agv.order.cancel.take()
        && let Some(action) = agv.actions.get_mut(&cancel.action_id)
    {
        action.end(Status::Finished);
    }
}

/// Whether an action belongs to a node or an edge behind this sequenceId.
fn is_behind(action: &Action, sequence_id: u32) -> bool {
    match action.origin {
        Origin::Node(own) | Origin::Edge(own) => own > sequence_id,
        Origin::Instant | Origin::Zone(_) => false,
    }
}

fn is_planned(agv: &Agv, action: &Action) -> bool {
    is_behind(action, agv.order.base_end.1)
}

/// Puts actions of the horizon where nothing ever triggers them.
fn strand(agv: &mut Agv, which: fn(&Action) -> bool, place: Origin) {
    let base_end = agv.order.base_end.1;
    let planned = agv
        .actions
        .iter_mut()
        .filter(|action| is_behind(action, base_end) && which(action));
    planned.for_each(|action| action.origin = place);
}

/// Forgets the base behind the next node.
fn shorten_base(agv: &mut Agv) {
    let Some(next) = agv.order.nodes.front().filter(|stop| stop.node.released) else {
        return;
    };
    let (end, old) = ((next.node.id.clone(), next.node.sequence_id), agv.order.base_end.1);
    let gone = |sequence_id: u32| sequence_id > end.1 && sequence_id <= old;
    agv.order.nodes.retain(|stop| !gone(stop.node.sequence_id));
    agv.order.edges.retain(|edge| !gone(edge.sequence_id));
    agv.actions.retain(|action| match action.origin {
        Origin::Node(sequence_id) | Origin::Edge(sequence_id) => !gone(sequence_id),
        Origin::Instant | Origin::Zone(_) => true,
    });
    agv.order.base_end = end;
}
