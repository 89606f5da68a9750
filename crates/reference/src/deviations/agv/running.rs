//! Deviations of when actions begin and end, what may run beside what, and what an action does (section 6.10.2 and 6.12).

use crate::agv::Mode;
use crate::agv::order_message::Blocking;

use super::prelude::*;

/// So many metres before a node its actions may begin too early.
const AHEAD: f64 = 2.0;

records! {
    fault "single-beside-others" ["BLOCK-08", "BLOCK-10"] "It runs SINGLE actions in parallel with the others of their list."
        => plain().queues(|(), agv, _, phases| {
            let single = |id: &String| agv.actions.get(id).is_some_and(|action| action.request.blocking == Blocking::Single);
            if phases.iter().flatten().any(single) {
                *phases = [phases.drain(..).flatten().collect()].into();
            }
        });
    fault "others-beside-single" ["BLOCK-08"] "It begins what stands behind a SINGLE action in its list while that still runs."
        => forbidding(|_, what| matches!(what, Permission::Await(action, origin) if action.request.blocking == Blocking::Single && action.origin == origin));
    fault "single-first" ["BLOCK-10"] "It begins the SINGLE action of a list before those that stand before it."
        => plain().queues(|(), agv, _, phases| {
            let single = |ids: &Vec<String>| ids.iter().filter_map(|id| agv.actions.get(id)).any(|action| action.request.blocking == Blocking::Single);
            if let Some(at) = phases.iter().position(single)
                && let Some(phase) = phases.remove(at)
            {
                phases.push_front(phase);
            }
        });
    fault "actions-held-offline" ["MQTT-04"] "As long as the link is broken it drives on but begins no action of its order."
        => forbidding(|agv, what| matches!(what, Permission::Act) && !agv.connection.online);
    fault "semiautomatic-actions-held" ["MODE-02"] "It does not begin the actions of its order in SEMIAUTOMATIC."
        => forbidding(|agv, what| matches!(what, Permission::Act) && agv.mode == Mode::Semiautomatic);
    fault "actions-ignored" ["ACT-01", "ORD-FLOW-07", "ORD-06"] "Never begins the actions of an order."
        => forbidding(|_, what| matches!(what, Permission::Act));
    fault "action-end-missed-offline" ["MQTT-04"] "Leaves an action RUNNING for ever that ends while the link is down."
        => forbidding(|agv, what| matches!(what, Permission::Proceed(action) if action.of_order() && !agv.connection.online));
    fault "stuck-after-blocking" ["BLOCK-07", "ORD-06", "NODE-07"] "Does not drive on after a blocking action."
        => forbidding(|agv, what| matches!(what, Permission::Drive) && has_stopped_for(agv, Some(Origin::Node(agv.order.last_sequence))));
    fault "stuck-after-edge-action" ["BLOCK-07", "ORD-06"] "Does not drive on after a blocking action of an edge."
        => forbidding(|agv, what| {
            let here = agv.order.edge_ahead().map(|edge| Origin::Edge(edge.sequence_id));
            matches!(what, Permission::Drive) && has_stopped_for(agv, here)
        });
    fault "node-actions-skipped-offline" ["MQTT-04", "NODE-04"] "It never triggers the actions of nodes that it traverses while the link to the broker is down; they stay WAITING."
        => forbidding(|agv, what| matches!(what, Permission::Trigger(Origin::Node(_))) && !agv.connection.online);
    fault "first-node-actions-skipped" ["NODE-04", "ACT-01"] "It never begins the actions of the first node of an order with several nodes, as it stands there already."
        => forbidding(|agv, what| matches!(what, Permission::Trigger(Origin::Node(0))) && !agv.order.nodes.is_empty());
    fault "one-node-order-actions-not-started" ["ORD-13", "NODE-04"] "It never starts the actions of a one-node order, because nothing is traversed, and keeps them WAITING."
        => forbidding(|agv, what| matches!(what, Permission::Trigger(Origin::Node(0))) && agv.order.nodes.is_empty());
    fault "loop-second-visit-without-actions" ["ORD-UPD-13", "NODE-04"] "It triggers the actions of a node only at its first visit; those of a second visit in the same order stay WAITING."
        => keep::<(Vec<String>, bool)>()
            .happens(|(visited, again), agv, event| match event {
                Event::Begun => visited.clear(),
                Event::NodeNoted(_) => {
                    let reached = agv.order.left.0.as_ref().map_or_else(String::new, |stop| stop.node.id.clone());
                    *again = visited.contains(&reached);
                    visited.push(reached);
                }
                _ => {}
            })
            .allows(|(_, again), _, what, usual| usual && !(*again && matches!(what, Permission::Trigger(Origin::Node(_)))));
    fault "single-node-actions-fail" ["ORD-13", "NODE-04"] "It reports the actions of an order with a single node FAILED without having tried them."
        => reaching(|agv, sequence_id| if sequence_id == 0 && agv.order.nodes.is_empty() { fail_at(agv, sequence_id) });
    fault "passing-actions-fail" ["NODE-04", "ACT-01"] "It reports actions with blockingType NONE FAILED, without having tried them, on nodes where nothing makes it stop."
        => reaching(|agv, sequence_id| {
            let here = Origin::Node(sequence_id);
            let free = |action: &Action| action.request.blocking == Blocking::None;
            let all_free = agv.actions.iter().filter(|action| action.origin == here).all(free);
            if sequence_id > 0 && goes_on(agv) && all_free {
                fail_at(agv, sequence_id);
            }
        });
    fault "loop-actions-early" ["ASTATE-02", "NODE-04"] "Performs the actions of a second visit of a node on the first."
        => passing(|agv, _| {
            let reached = agv.order.left.0.as_ref().map(|stop| stop.node.id.clone());
            let again = agv.order.nodes.iter().filter(|ahead| Some(&ahead.node.id) == reached.as_ref());
            let again: Vec<u32> = again.map(|ahead| ahead.node.sequence_id).collect();
            for id in again {
                agv.trigger_actions(Origin::Node(id));
            }
        });
    fault "horizon-actions-begun" ["ASTATE-02"] "Begins the actions of the horizon when it stops at the decision point."
        => passing(|agv, _| if let Some(planned) = agv.order.nodes.front().filter(|stop| !stop.node.released) {
            agv.trigger_actions(Origin::Node(planned.node.sequence_id));
        });
    fault "edge-actions-on-node" ["NODE-07"] "Begins the actions of an edge while it is held on the node before."
        => passing(|agv, _| trigger_next_edge(agv));
    fault "edge-action-starts-before-leaving" ["NODE-07"] "It starts the edge action on arrival at the start node although a HARD node action still holds it there."
        => passing(|agv, _| {
            let here = Origin::Node(agv.order.last_sequence);
            let waits = |action: &Action| action.origin == here && action.status == Status::Waiting;
            let hard = agv.actions.iter().any(|action| waits(action) && action.request.blocking == Blocking::Hard);
            if hard && agv.order.edge_ahead().is_some_and(|edge| edge.released) {
                trigger_next_edge(agv);
            }
        })
        .allows(|_, _, what, usual| {
            let of_node = |origin: Origin| matches!(origin, Origin::Node(_));
            usual && !matches!(what, Permission::Await(action, origin) if of_node(action.origin) != of_node(origin))
        });
    fault "node-actions-early" ["NODE-04", "ASTATE-02"] "Begins the actions of a node when it sets out for it."
        => when(Event::OnEdge, |agv| if let Some(stop) = agv.order.nodes.front() {
            agv.trigger_actions(Origin::Node(stop.node.sequence_id));
        });
    fault "node-actions-two-metres-ahead" ["NODE-04", "ASTATE-02"] "It begins the actions of a node two metres before it is there."
        => plain()
            .plans(|(), agv, leg| {
                let waits = agv.actions.waiting_at(Origin::Node(leg.stop.node.sequence_id));
                if waits && leg.is_whole() && leg.distance > AHEAD + 0.01 {
                    (leg.way, leg.to_node) = (leg.distance - AHEAD, false);
                }
            })
            .happens(|(), agv, event| if matches!(event, Event::OnEdge | Event::LegEnded) && agv.order.cancel.is_none() {
                let pose = agv.motion.pose(agv.moment());
                let near = |stop: &&Stop| stop.node.released && pose.distance(stop.place.x, stop.place.y) <= AHEAD + 0.01;
                let ahead = agv.order.nodes.front().filter(near).map(|stop| stop.node.sequence_id);
                if let Some(sequence_id) = ahead {
                    agv.trigger_actions(Origin::Node(sequence_id));
                }
            });
    fault "none-aborted" ["ACT-01", "BLOCK-02"] "Breaks off the actions of type NONE of a node when it drives on."
        => plain().happens(|(), agv, event| if matches!(event, Event::EdgeEntered(_)) {
            let here = Origin::Node(agv.order.last_sequence);
            let free = |action: &&mut Action| action.origin == here && action.request.blocking == Blocking::None && action.status.is_active();
            agv.actions.iter_mut().filter(free).for_each(|action| action.end(Status::Failed));
        });
    fault "first-edge-actions-fail" ["NODE-06", "ACT-01"] "The actions of the first edge of an order are FAILED without having begun."
        => when(Event::EdgeEntered(1), |agv| {
            let of_edge = agv.actions.iter_mut().filter(|action| action.origin == Origin::Edge(1));
            of_edge.for_each(|action| action.end(Status::Failed));
        });
    fault "edge-actions-late" ["NODE-06", "ACT-02"] "Begins the actions of an edge at its end."
        => plain()
            .allows(|(), agv, what, usual| {
                let is_ahead = |id: u32| agv.order.edge_ahead().is_some_and(|edge| edge.sequence_id == id);
                match what {
                    Permission::PassOver(_) => true,
                    Permission::LeaveEdge => false,
                    Permission::Trigger(Origin::Edge(id)) => usual && !is_ahead(id),
                    _ => usual,
                }
            })
            .happens(|(), agv, event| if let Event::EdgeLeft(id) = event {
                agv.trigger_actions(Origin::Edge(id));
            });
    fault "edge-action-outlives-edge" ["ACT-02", "NODE-05"] "Lets the actions of an edge run on behind its end."
        => forbidding(|_, what| matches!(what, Permission::LeaveEdge)).lasts(on_edges_for_ever);
    fault "last-edge-action-outlives-edge" ["NODE-05", "ACT-02"] "Ends only the first of several actions of an edge when it leaves it."
        => forbidding(|agv, what| match what {
            Permission::EndWithEdge(action) => {
                let first = agv.actions.iter().find(|other| other.origin == action.origin);
                first.is_none_or(|first| first.request.id != action.request.id)
            }
            _ => false,
        })
        .lasts(on_edges_for_ever);
    fault "edge-action-ends-with-the-order-only" ["NODE-05", "ACT-02"] "It lets an edge action run on over the end node until the vehicle stops."
        => forbidding(|agv, what| matches!(what, Permission::LeaveEdge) && goes_on(agv)).happens(|_, agv, event| {
            if matches!(event, Event::NodeReached(_)) && !goes_on(agv) {
                let ahead = agv.order.edge_ahead().map_or(u32::MAX, |edge| edge.sequence_id);
                let left = |action: &&Action| matches!(action.origin, Origin::Edge(id) if id < ahead);
                let left: Vec<Origin> = agv.actions.iter().filter(left).map(|action| action.origin).collect();
                for origin in left {
                    if let Origin::Edge(id) = origin {
                        agv.end_edge_actions(id);
                    }
                }
            }
        });
    fault "edge-actions-forgotten-with-edge" ["STATE-MSG-10", "STATE-MSG-09"] "The states of edge actions are removed when the vehicle leaves the edge."
        => plain().happens(|(), agv, event| if let Event::EdgeLeft(id) = event {
            agv.actions.retain(|action| action.origin != Origin::Edge(id));
        });
    fault "edge-list-cut" ["ACT-01"] "Performs only the first of several actions of an edge, and fails the others."
        => plain().happens(|(), agv, event| if let Event::Triggering(origin @ Origin::Edge(_)) = event {
            let of_edge = agv.actions.iter_mut().filter(|action| action.origin == origin);
            of_edge.skip(1).for_each(|action| action.end(Status::Failed));
        });
    fault "edge-condition-stays" ["ACT-03"] "Leaves its warning lights on behind the edge that asked for them."
        => state(|agv, m| {
            let lit = |action: &Action| is(action, Effect::WarningLights) && (action.status.is_active() || action.status.is_terminal());
            if agv.actions.iter().any(lit) {
                m.set("information", json!([{ "infoType": "warningLights", "infoLevel": "INFO" }]));
            }
        });
    fault "list-reversed" ["BLOCK-01"] "Performs the actions of a node from the last to the first."
        => queueing(|agv, ids| {
            ids.reverse();
            in_turn(agv, ids)
        });
    fault "last-action-forgotten" ["ACT-01"] "Never begins the last of several actions of a node."
        => queueing(|agv, ids| {
            if ids.len() > 1 {
                ids.pop();
            }
            in_turn(agv, ids)
        });
    fault "hard-first" ["BLOCK-01", "BLOCK-06"] "Performs the HARD actions of a node before all others."
        => queueing(|agv, ids| {
            ids.sort_by_key(|id| !is_hard(agv, id));
            in_turn(agv, ids)
        });
    fault "hard-overlaps" ["BLOCK-05"] "Performs HARD actions beside others."
        => queueing(|_, ids| vec![std::mem::take(ids)]);
    fault "none-joins-hard" ["BLOCK-05", "BLOCK-06"] "A NONE action that follows a HARD one in the list begins together with it."
        => queueing(|agv, ids| {
            let free = |id: &String| agv.actions.get(id).is_some_and(|action| action.request.blocking == Blocking::None);
            let mut phases: Vec<Vec<String>> = Vec::new();
            for phase in in_turn(agv, ids) {
                let hard = phases.last().is_some_and(|before| before.iter().any(|id| is_hard(agv, id)));
                let joining = phase.iter().take_while(|id| hard && free(id)).count();
                let (joining, others) = phase.split_at(joining);
                if let Some(before) = phases.last_mut() {
                    before.extend_from_slice(joining);
                }
                phases.push(others.to_vec());
            }
            phases
        });
    fault "hard-starts-beside-none" ["BLOCK-05", "BLOCK-06"] "It starts a HARD action while a NONE action before it is still running."
        => forbidding(|_, what| matches!(what, Permission::Await(action, _) if action.request.blocking == Blocking::None));
    fault "hard-begins-after-the-first-of-its-group" ["BLOCK-10", "BLOCK-05"] "It begins a HARD action as soon as the first of those that run in parallel before it has ended."
        => forbidding(|agv, what| match what {
            Permission::Await(action, origin) => agv.actions.lists.iter().filter(|list| list.origin == origin).any(|list| {
                let ended = |id: &String| agv.actions.get(id).is_some_and(|other| other.status.is_terminal());
                list.running.contains(&action.request.id) && list.running.iter().any(ended)
            }),
            _ => false,
        });
    fault "hard-ignores-earlier-node" ["BLOCK-05"] "A HARD action begins although a NONE action of an earlier node or edge is still running."
        because "The node of the other action is left behind; that BLOCK-05 reaches so far is a matter of reading."
        => forbidding(|_, what| matches!(what, Permission::Await(action, origin) if action.origin != origin));
    fault "prepares-while-driving" ["BLOCK-03", "BLOCK-04"] "It drives on while a SOFT or HARD action is INITIALIZING, and stops only when that action runs."
        => letting(|_, what| matches!(what, Permission::DriveDuring(action) if action.status == Status::Initializing));
    fault "edge-actions-do-not-block" ["BLOCK-04", "BLOCK-03"] "It goes on driving during SOFT and HARD actions of an edge."
        => letting(|_, what| match what {
            Permission::DriveDuring(action) => matches!(action.origin, Origin::Edge(_)),
            what => matches!(what, Permission::PassOver(_)),
        });
    fault "soft-edge-action-drives" ["BLOCK-03"] "It does not stop for SOFT actions of an edge."
        => letting(|_, what| match what {
            Permission::DriveDuring(action) => is_soft(action) && matches!(action.origin, Origin::Edge(_)),
            Permission::PassOver(action) => is_soft(action),
            _ => false,
        });
    fault "only-last-action-blocks" ["BLOCK-03", "BLOCK-04"] "It drives on as soon as the last action of the list has ended, although an earlier SOFT action of the same node still runs."
        => letting(|agv, what| match what {
            Permission::DriveDuring(action) => {
                let ended = last_of(agv, action.origin).is_some_and(|last| last.status.is_terminal());
                matches!(action.origin, Origin::Node(_)) && ended
            }
            _ => false,
        });
    fault "node-with-none-only-stops-following-soft" ["BLOCK-03"] "It drives on during a SOFT action when a NONE action follows it in the list."
        => letting(|agv, what| match what {
            Permission::DriveDuring(action) => is_soft(action) && last_of(agv, action.origin).is_some_and(|last| last.request.blocking == Blocking::None),
            _ => false,
        });
    fault "soft-drives" ["BLOCK-03"] "Drives while a SOFT action runs."
        => letting(|_, what| matches!(what, Permission::DriveDuring(action) if is_soft(action)));
    fault "hard-drives" ["BLOCK-04"] "Drives while a HARD action runs."
        => letting(|_, what| matches!(what, Permission::DriveDuring(action) if action.request.blocking == Blocking::Hard));
    fault "single-holds" ["BLOCK-09"] "It stands while a SINGLE action runs." because "To drive on is a permission; a vehicle that stands is remarked on."
        => forbidding(|_, what| matches!(what, Permission::DriveDuring(action) if action.request.blocking == Blocking::Single));
    fault "edge-passes-single" ["BLOCK-11"] "An action of an edge begins beside a SINGLE action of the node before it." because "A figure shows an overlap, so that it is remarked on."
        => forbidding(|_, what| matches!(what, Permission::Await(action, origin) if action.request.blocking == Blocking::Single && action.origin != origin));
    fault "trigger-not-awaited" ["ACT-37"] "Ends waitForTrigger by itself."
        => triggered(|| MOMENT);
    fault "trigger-given-up" ["ACT-37"] "Waits for a trigger for a second and a half only."
        => triggered(|| Duration::from_millis(1_500));
    fault "trigger-times-out" ["ACT-37"] "A waitForTrigger is FINISHED after five seconds also without the trigger."
        => triggered(|| Duration::from_secs(5));
    fault "trigger-skipped" ["ACT-37"] "Reports waitForTrigger FINISHED without waiting."
        => triggered(|| Duration::from_millis(1));
    fault "finished-actions-removed" ["STATE-MSG-10"] "Removes actions from its states when they are done."
        => forgetting(|_| true);
    fault "finished-instant-forgotten" ["STATE-MSG-09", "STATE-MSG-10", "IACT-STATE-01", "ACT-26"] "Removes instant actions from its states when they are done."
        => forgetting(|action| !action.of_order());
    fault "action-errors-never-clear" ["ERR-01"] "It never removes the error of a failed action, also not after the next orders were accepted and completed."
        => failure(|_, _, e| {
            e.life = Life::Always;
            true
        });
    fault "result-description-only-in-first-state" ["STATE-MSG-12", "STATE-MSG-10"] "It gives the resultDescription of a finished action in one state only and leaves it out afterwards."
        because "STATE-MSG-12 asks for a description where it applies; how long it stays is not said."
        => keep::<Vec<String>>()
            .sends(|told, _, outgoing| {
                if outgoing.name == "state" {
                    let mut now = Vec::new();
                    outgoing.message.each("actionStates", |action| if action.contains_key("resultDescription") {
                        now.push(action.text("actionId").to_owned());
                        if told.contains(&now[now.len() - 1]) {
                            action.unset("resultDescription");
                        }
                    });
                    *told = now;
                }
                true
            });
    tolerance "actions-last" ["ACT-01"] "Takes a second for every action."
        => plain().lasts(|_, _, what, usual| match what {
            Span::Action(action) if action.number("duration").is_none() => usual.max(Duration::from_secs(1)),
            _ => usual,
        });
    tolerance "prepares-everything" ["ASTATE-03"] "Prepares every action of an order, and reports it INITIALIZING."
        => letting(|_, what| matches!(what, Permission::Prepare));
    tolerance "never-prepares" ["ASTATE-03", "ACT-41"] "It reports no action as INITIALIZING when it needs no preparation."
        => forbidding(|_, what| matches!(what, Permission::Prepare));
    tolerance "drives-on-late" ["BLOCK-07"] "It stands for half a second after a blocking action has ended before it drives on."
        => plain().ends(|(), agv, action, outcome| {
            let stops = action.of_order() && action.request.blocking != Blocking::None && !agv.order.nodes.is_empty();
            if stops && matches!(outcome, Outcome::Done(_)) {
                linger(agv, 500);
            }
            outcome
        });
    tolerance "node-actions-in-next-state" ["NODE-04"] "It reports the traversal of a node with actions while they are still WAITING, stands there for a moment, and begins them right after that state."
        => reaching(|agv, sequence_id| if agv.actions.waiting_at(Origin::Node(sequence_id)) {
            // It stands on the node, and says so.
            linger(agv, 100);
            agv.flush();
        });
    tolerance "cut-edge-actions-fail" ["NODE-05"] "It reports an edge action as FAILED that it ends because it leaves the edge."
        => forbidding(|_, what| matches!(what, Permission::EndWithEdge(action) if action.status.is_active())).happens(|_, agv, event| if let Event::EdgeLeft(id) = event {
            let cut = agv.actions.iter_mut().filter(|action| action.origin == Origin::Edge(id) && action.status.is_active());
            cut.for_each(|action| action.end(Status::Failed));
        });
    tolerance "failures-described" ["STATE-MSG-12"] "Failed actions have a resultDescription that says why, beside the error."
        => failure(|agv, action, e| {
            if let Some(action) = agv.actions.get_mut(&action.request.id) {
                action.result = Some(e.description.clone());
            }
            true
        });
    tolerance "action-errors-until-new-order" ["IACT-06", "ACT-30", "ERR-01"] "It shows the error about a failed action until a new order is accepted."
        => failure(|_, _, e| {
            e.life = Life::UntilNewOrder;
            true
        });
    tolerance "action-errors-brief" ["IACT-06", "ACT-30", "MAP-19"] "It shows the error about a failed action for one or two states only."
        => failure(|agv, _, e| {
            e.life = Life::Until(agv.moment() + brief(agv));
            true
        });
    tolerance "log-name-in-information" ["ACT-27", "INFO-01"] "The name of the last log is in the information of the states instead of a resultDescription, which the factsheet does not announce either."
        => keep::<Option<(String, String)>>()
            .ends(|log, _, action, outcome| match outcome {
                Outcome::Done(Some(name)) if is(action, Effect::LogReport) => {
                    *log = Some((action.id(), name));
                    Outcome::Done(None)
                }
                other => other,
            })
            .says(|log, _, part, m| {
                if let (Part::State, Some((id, name))) = (part, log) {
                    let references = json!([{ "referenceKey": "actionId", "referenceValue": id }]);
                    m.add("information", json!({ "infoType": "logReport", "infoLevel": "INFO", "infoDescription": name, "infoReferences": references }));
                }
                if matches!(part, Part::Factsheet) {
                    m.part("protocolFeatures", |features| features.each("agvActions", |kind| if kind.says("actionType", "logReport") {
                        kind.unset("resultDescription");
                    }));
                }
                true
            });
}

/// Lists some actions no more once they have done what they do.
fn forgetting(which: fn(&Action) -> bool) -> Box<dyn Deviation> {
    holding((which, Vec::new()))
        .ends(|(which, gone), _, action, outcome| {
            if which(action) && matches!(outcome, Outcome::Done(_)) {
                gone.push(action.id());
            }
            outcome
        })
        .says(|(_, gone), _, part, _| !matches!(part, Part::Action(action) if gone.contains(&action.request.id)))
}

/// Whether an action that stops the vehicle has ended there.
fn has_stopped_for(agv: &Agv, here: Option<Origin>) -> bool {
    let mut actions = agv.actions.iter().filter(|action| Some(action.origin) == here);
    actions.any(|action| action.request.blocking != Blocking::None && action.status.is_terminal())
}

/// What was not begun on a node has failed.
fn fail_at(agv: &mut Agv, sequence_id: u32) {
    let here = Origin::Node(sequence_id);
    let open = |action: &&mut Action| action.origin == here && !action.status.is_terminal();
    if agv.order.cancel.is_none() {
        agv.actions
            .iter_mut()
            .filter(open)
            .for_each(|action| action.end(Status::Failed));
    }
}

type Passing = fn(&mut Agv, u32);

/// Does something before the actions of a node are triggered; its sequenceId.
fn reaching(then: Passing) -> Box<Hooks<Passing>> {
    holding(then).happens(|then, agv, event| {
        if let Event::NodeNoted(id) = event {
            then(agv, id);
        }
    })
}

/// Does something after the actions of a node were triggered.
fn passing(then: Passing) -> Box<Hooks<Passing>> {
    holding(then).happens(|then, agv, event| {
        if let Event::NodePassed(id) = event
            && agv.order.cancel.is_none()
        {
            then(agv, id);
        }
    })
}

fn trigger_next_edge(agv: &mut Agv) {
    if let Some(id) = agv.order.edge_ahead().map(|edge| edge.sequence_id) {
        agv.trigger_actions(Origin::Edge(id));
    }
}

/// Actions of edges last longer than any edge.
fn on_edges_for_ever<M>(_: &M, _: &Agv, what: Span<'_>, usual: Duration) -> Duration {
    match what {
        Span::Action(action) if matches!(action.origin, Origin::Edge(_)) => usual.max(Duration::from_secs(60)),
        _ => usual,
    }
}

/// Ends waitForTrigger by itself after a time.
fn triggered(after: fn() -> Duration) -> Box<dyn Deviation> {
    holding(after).lasts(|after, _, what, usual| match what {
        Span::Action(action) if is(action, Effect::WaitForTrigger) => after(),
        _ => usual,
    })
}

type Queueing = fn(&Agv, &mut Vec<String>) -> Vec<Vec<String>>;

/// Begins what waits at a place in another sequence: ids in the sequence of the order, and what may begin together.
fn queueing(change: Queueing) -> Box<Hooks<Queueing>> {
    holding(change).queues(|change, agv, _, phases| {
        let mut ids: Vec<String> = phases.drain(..).flatten().collect();
        *phases = change(agv, &mut ids)
            .into_iter()
            .filter(|phase| !phase.is_empty())
            .collect();
    })
}

/// The usual sequence: a HARD action alone.
fn in_turn(agv: &Agv, ids: &[String]) -> Vec<Vec<String>> {
    let together = |before: &String, after: &String| !is_hard(agv, before) && !is_hard(agv, after);
    ids.chunk_by(together).map(<[String]>::to_vec).collect()
}

fn is_hard(agv: &Agv, id: &str) -> bool {
    agv.actions
        .get(id)
        .is_some_and(|action| action.request.blocking == Blocking::Hard)
}

fn is_soft(action: &Action) -> bool {
    action.request.blocking == Blocking::Soft
}

/// The last action of a node or an edge.
fn last_of(agv: &Agv, origin: Origin) -> Option<&Action> {
    agv.actions.iter().filter(|action| action.origin == origin).last()
}
