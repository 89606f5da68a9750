//! Deviations of which orders are taken over, and how (section 6.6 and figure 8).

use crate::agv::motion;
use crate::agv::order_message::{Blocking, Node};
use crate::{Output, Publication};

use super::prelude::*;

records! {
    fault "crashes-on-malformed-order" ["ORD-REJ-02", "ORD-REJ-17"] "Ends its connection over an order that it cannot read, and comes back."
        => keep::<()>()
            .refuses(|(), agv, _, rule| if rule == Rule::Malformed {
                agv.pending.push(Output::Drop);
                agv.connection.dropped(agv.moment() + agv.config.reconnect_delay);
            })
            .raises(|(), _, cause, _| !matches!(cause, Cause::Refusal(Rule::Malformed, _)));
    fault "echoes-order" ["TOPIC-15"] "Publishes the accepted order back on the order topic."
        => plain().adopts(|(), agv, adoption| {
            echo(agv, adoption);
            true
        });
    fault "first-node-refused" ["ORD-04"] "Refuses orders that begin where it stands."
        => forbidding(|_, what| matches!(what, Permission::BeginAt(_)));
    fault "order-after-refusal-lost" ["ORD-FLOW-06"] "Loses the first order that comes after a refused one while it has nothing to do."
        => keep::<bool>().hears(|lost, agv, name, _| {
            if name == "order" {
                *lost = !agv.is_busy() && agv.errors.lists_refusals() && !*lost;
            }
            name != "order" || !*lost
        });
    fault "deviation-ignored" ["ORD-05", "ORD-CANCEL-16"] "Counts itself as on the first node only when it stands exactly there."
        => allowing(|agv, what, usual| match what {
            Permission::BeginAt(node) => usual && agv.is_within(node, 0.0, true),
            _ => usual,
        });
    fault "deviation-as-diameter" ["ORD-05", "ORD-CANCEL-16"] "It takes allowedDeviationXY of the first node as a diameter, and finds nodes out of reach that are within it."
        => allowing(|agv, what, usual| match what {
            Permission::BeginAt(node) => usual && agv.is_within(node, range(node) / 2.0, true),
            _ => usual,
        });
    fault "start-check-ignores-map" ["ORD-FLOW-04"] "It compares only x and y with the first node, so that an order starting on the same coordinates of another enabled map is accepted."
        because "No error name is given for it; the ruling of ORD-FLOW-04 warns of an order on another map that is taken over."
        => letting(|agv, what| matches!(what, Permission::BeginAt(node) if agv.is_within(node, range(node), false)));
    fault "theta-difference-not-wrapped" ["ORD-04", "ORD-FLOW-04"] "It takes the plain difference of two angles at the start check, so that a first node whose theta lies just beyond pi is refused as too far although it stands on it."
        => forbidding(|agv, what| matches!(what, Permission::BeginAt(node) if is_turned_by_plain_difference(agv, node)));
    fault "last-node-trusted" ["ORD-FLOW-04"] "A new order that begins with the node of lastNodeId is taken over however far away the vehicle stands by now."
        => letting(|agv, what| matches!(what, Permission::BeginAt(node) if node.id == agv.order.last_node));
    fault "temporary-node-refused" ["ORD-CANCEL-15"] "Refuses orders that begin at a node it has never heard of."
        => forbidding(|agv, what| matches!(what, Permission::BeginAt(node) if agv.config.node(&node.id).is_none() && node.id != agv.order.last_node));
    fault "temporary-node-not-reached" ["ORD-CANCEL-15"] "Takes over an order with one node it has never heard of, and never counts it as reached."
        => plain()
            .happens(|(), agv, event| if event == Event::Begun && agv.order.nodes.front().is_some_and(|stop| agv.config.node(&stop.node.id).is_none()) {
                agv.motion.reached = false;
            })
            .allows(|(), agv, what, usual| {
                let alone = |stop: &Stop| agv.order.base_end.1 == 0 && agv.config.node(&stop.node.id).is_none();
                usual && !matches!(what, Permission::SetOut(stop) if alone(stop))
            });
    fault "range-not-counted" ["ORD-CANCEL-16"] "Drives to the exact place of a first node in whose range it stands."
        => when(Event::Begun, |agv| agv.motion.reached = false);
    fault "far-order-accepted" ["ORD-FLOW-04"] "Drives to the first node of an order however far it is."
        => overlooking(|_, what| matches!(what, Objection::Far));
    fault "far-order-taken-after-cancel" ["ORD-FLOW-04"] "After a cancellation it accepts a new order wherever its first node is, and drives there."
        => overlooking(|agv, what| matches!(what, Objection::Far) && agv.order.cancelled);
    fault "horizon-demanded" ["ORD-10"] "Refuses new orders without a horizon."
        => objecting(|_, order, relation| {
            let bare = relation == Relation::New && order.nodes.iter().all(|node| node.released);
            bare.then(|| Refusal::new(Rule::Unable, "the order is too short"))
        });
    fault "single-node-refused" ["ORD-13"] "Refuses orders with one node."
        => objecting(|_, order, relation| {
            let short = relation == Relation::New && order.nodes.len() == 1;
            short.then(|| Refusal::new(Rule::Unable, "the order is too short"))
        });
    fault "empty-order-dropped" ["ORD-11", "ORD-REJ-17"] "It drops an order without any node silently."
        => plain().hears(|(), agv, name, payload| {
            let empty = name == "order" && serde_json::from_slice::<Value>(payload).is_ok_and(|order| order["nodes"].as_array().is_some_and(Vec::is_empty));
            agv.report.order_received |= empty;
            !empty
        });
    fault "busy-ignored" ["ORD-FLOW-01", "ORD-FLOW-03"] "Takes over a new order while another one is being driven."
        => forbidding(|_, what| matches!(what, Permission::BeBusy));
    fault "running-action-ignored" ["ORD-FLOW-02"] "Takes over a new order while an action of the old one runs."
        => forbidding(|_, what| matches!(what, Permission::Count(_)));
    fault "free-action-ignored" ["ORD-FLOW-02"] "Takes over a new order while an action of the old one runs that does not block."
        => forbidding(|_, what| matches!(what, Permission::Count(action) if action.request.blocking == Blocking::None));
    fault "trigger-not-counted" ["ORD-FLOW-02"] "It accepts a new order while a waitForTrigger on the last node of its order still runs."
        => forbidding(|_, what| matches!(what, Permission::Count(action) if is(action, Effect::WaitForTrigger)));
    fault "horizon-not-busy" ["ORD-FLOW-03"] "Takes over a new order while it waits at the decision point."
        => forbidding(|_, what| matches!(what, Permission::CountNode(stop) if !stop.node.released));
    fault "new-order-taken-in-pause" ["ORD-FLOW-01", "ACT-14"] "While it is paused it replaces its unfinished order by a new one."
        => overlooking(|agv, what| matches!(what, Objection::Busy) && agv.holds.pause);
    fault "failed-action-blocks-next-order" ["ORD-FLOW-06", "ORD-FLOW-02"] "It counts a FAILED action of the completed order as unfinished and refuses every following new order."
        => objecting(|agv, _, relation| {
            let failed = relation == Relation::New && !agv.order.cancelled && has_failed(agv);
            failed.then(|| busy("an action of the order before is not finished"))
        });
    fault "dead-after-cancel" ["ORD-CANCEL-13"] "Refuses every new order after a cancellation."
        => objecting(|agv, _, relation| {
            let dead = relation == Relation::New && agv.order.cancelled;
            dead.then(|| busy("the cancelled order is still there"))
        });
    fault "order-after-init-position-refused" ["ORD-04"] "It refuses the first order after an initPosition as too far away, although it stands on the first node."
        => keep::<bool>()
            .ends(|posed, _, action, outcome| {
                *posed |= is(action, Effect::InitPosition) && !action.of_order() && matches!(outcome, Outcome::Done(_));
                outcome
            })
            .refuses(|posed, _, _, _| *posed = false)
            .happens(|posed, _, event| *posed &= event != Event::Begun)
            .objects(|posed, _, order, relation| {
                let refusal = || Refusal::new(Rule::StartOutOfRange, "the first node is out of reach").naming("nodeId", &order.nodes[0].id);
                (*posed && relation == Relation::New).then(refusal)
            });
    fault "manual-locks" ["MODE-02"] "Refuses the first order after it was driven by hand."
        => locking()
            .happens(|locked, _, event| match event {
                Event::DrivenByHand => *locked = true,
                Event::PowerCycled => *locked = false,
                _ => {}
            })
            .refuses(|locked, _, _, rule| *locked &= rule != Rule::OtherOrderActive);
    fault "old-action-states-kept" ["ORD-FLOW-05", "STATE-MSG-11"] "Keeps the action states of the old order."
        => forbidding(|_, what| matches!(what, Permission::Forget(_)));
    fault "failed-actions-outlive-order" ["ORD-FLOW-05", "STATE-MSG-11"] "FAILED actions of the order before stay in actionStates when a new order is accepted."
        => forbidding(|_, what| matches!(what, Permission::Forget(action) if action.of_order() && action.status == Status::Failed));
    fault "cancel-outlives-order" ["STATE-MSG-11"] "An ended cancelOrder stays in its action states when a new order is accepted."
        => forbidding(|_, what| matches!(what, Permission::Forget(action) if is(action, Effect::CancelOrder) && !action.of_order()));
    fault "running-instant-dropped" ["STATE-MSG-11", "IACT-STATE-01", "IACT-STATE-02"] "Removes running instant actions from its states when a new order is accepted."
        => letting(|_, what| matches!(what, Permission::Forget(_)));
    fault "never-starts" ["ORD-FLOW-07", "ORD-06"] "Accepts an order and does not begin to drive."
        => forbidding(|_, what| matches!(what, Permission::SetOut(_)));
    fault "order-after-cancel-not-driven" ["ORD-CANCEL-13", "ORD-FLOW-07"] "The first order after a cancelled one is accepted but never driven."
        => parked().adopts(|parked, agv, adoption| {
            *parked = if adoption.update { *parked } else { agv.order.cancelled };
            true
        });
    fault "order-in-pause-never-starts" ["ORD-FLOW-07", "ACT-18"] "An order that was accepted while the vehicle is paused is not driven after the pause either."
        => parked().adopts(|parked, agv, adoption| {
            *parked = if adoption.update { *parked } else { agv.holds.pause || agv.holds.button };
            true
        });
    fault "paused-vehicle-starts-new-order" ["ACT-12"] "It starts to drive on a new order that it accepts while it is paused."
        => heedless().happens(|heedless, agv, event| *heedless = match event {
            Event::Begun => agv.holds.pause,
            Event::Resuming => false,
            _ => *heedless,
        });
    fault "update-ids-compared-across-orders" ["ORD-FLOW-06", "ORD-04", "ORD-13"] "Refuses a new order whose orderUpdateId is lower than that of the last order."
        => objecting(|agv, order, relation| {
            let lower = relation == Relation::New && order.update_id < agv.order.update_id;
            lower.then(|| Refusal::new(Rule::Outdated, "the order update is older than the current one"))
        });
    fault "update-id-carried-over" ["ORD-FLOW-06", "STATE-12"] "Reports a new order with the orderUpdateId of the last one."
        => keep::<Option<u32>>()
            .adopts(|last, agv, adoption| {
                if !adoption.update {
                    *last = agv.order.has_order().then_some(agv.order.update_id);
                }
                true
            })
            .happens(|last, agv, event| if event == Event::Begun && let Some(last) = *last {
                agv.order.update_id = last;
            });
    fault "first-update-id-zeroed" ["ORD-FLOW-06", "STATE-MSG-02"] "It reports orderUpdateId 0 for every new order, also if it was sent with another one."
        => when(Event::Begun, |agv| agv.order.update_id = 0);
    fault "header-id-counts-orders" ["HDR-02"] "It counts every order message that it receives in the headerId of its states, which therefore jumps."
        => plain().hears(|(), agv, name, _| {
            if name == "order" {
                agv.connection.skip_header_id("state");
            }
            true
        });
    fault "header-id-restarts-with-order" ["HDR-02"] "It lets the headerId of the state begin again with each new order."
        => when(Event::Begun, |agv| {
            agv.connection.header_ids.insert("state", 0);
        });
    fault "order-ends-pause" ["ACT-12"] "Drives off with a new order although it is paused."
        => when(Event::Begun, |agv| agv.set_holds(|holds| holds.pause = false));
    fault "own-error-cleared-by-order" ["ERR-01"] "Forgets an error of its own with the next order, although its cause is still there." because "It breaks a recommendation only."
        => when(Event::Begun, |agv| agv.errors.cleared());
    fault "own-error-gone-by-order" ["ERR-01", "ERR-04"] "A new order clears also the error of a defect that is still there."
        because "ERR-01, that errors stay while their cause lasts, is a recommendation; the cause is the vehicle's own affair."
        => when(Event::Begun, |agv| agv.errors.clear());
    fault "load-forgotten-with-order" ["STATE-MSG-06", "ACT-29"] "Shows no load any more when it takes over a new order."
        => when(Event::Begun, |agv| agv.loads.clear());
    fault "validation-error-lingers" ["ORD-REJ-03"] "Keeps order errors although a new order was accepted."
        => keep::<Vec<ActiveError>>()
            .adopts(|errors, agv, _| {
                errors.clone_from(&agv.errors.active);
                true
            })
            .happens(|errors, agv, event| if event == Event::Begun {
                agv.errors.active = std::mem::take(errors);
            });
    fault "duplicate-reported" ["ORD-REJ-13"] "Raises an error for an order that is sent twice."
        => objecting(|_, _, relation| (relation == Relation::Known).then(|| Refusal::new(Rule::Duplicate, "the order was received before")));
    fault "resend-after-completion-raises-error" ["ORD-REJ-13"] "It ignores an identical re-send while the order runs, but reports an error for it once the order is completed."
        => objecting(|agv, _, relation| {
            let done = relation == Relation::Known && !agv.is_busy() && !agv.order.cancelled;
            done.then(|| Refusal::new(Rule::Duplicate, "the order was received before"))
        });
    fault "changed-duplicate-reported" ["ORD-REJ-13"] "It raises an error when an order with the same orderId and orderUpdateId comes again with other content."
        => keep::<Option<Order>>()
            .adopts(|before, _, adoption| {
                *before = Some(adoption.order.clone());
                true
            })
            .objects(|before, _, order, relation| {
                let same = |before: &Order| before.nodes == order.nodes && before.edges == order.edges;
                let changed = relation == Relation::Known && !before.as_ref().is_some_and(same);
                changed.then(|| Refusal::new(Rule::Duplicate, "the order differs from what was received before"))
            });
    fault "duplicate-executed" ["ORD-REJ-13"] "Begins an order again when it is sent twice."
        => letting(|agv, what| matches!(what, Permission::BeginAgain) && !agv.is_busy());
    fault "duplicate-after-cancel-executed" ["ORD-REJ-13"] "It executes a cancelled order once more when the same message comes again."
        => letting(|agv, what| matches!(what, Permission::BeginAgain) && agv.order.cancelled);
    fault "duplicate-halts-driving" ["ORD-06", "ORD-REJ-13"] "Stands still for ever when the order it drives is sent again."
        => parked().happens(|parked, agv, event| *parked = match event {
            Event::SeenAgain => *parked || agv.is_busy(),
            Event::Begun => false,
            _ => *parked,
        });
    fault "duplicate-clears-errors" ["ORD-REJ-08", "ORD-REJ-03"] "An order it knows already, sent again, clears its order errors as an accepted new order would."
        => when(Event::SeenAgain, |agv| agv.errors.new_order());
    fault "duplicate-repeats-actions" ["ORD-REJ-13", "ASTATE-06"] "The running order sent again makes it repeat the finished actions of the node it was on last."
        => when(Event::SeenAgain, |agv| if agv.is_busy() { agv.repeat_actions(agv.order.last_sequence) });
    fault "duplicate-releases-horizon" ["ORD-07", "ORD-REJ-13"] "When the same order comes again while the vehicle waits at the decision point it drives on into its horizon."
        => unbound().happens(|unbound, agv, event| *unbound = match event {
            Event::SeenAgain => *unbound || agv.waits_at_decision_point(),
            Event::Begun => false,
            _ => *unbound,
        });
    fault "outdated-continues-completed" ["ORD-REJ-10"] "Once its order is complete it takes over an update that joins it even if the orderUpdateId is lower."
        => overlooking(|agv, what| matches!(what, Objection::Outdated) && !agv.is_busy());
    fault "outdated-update-taken-over" ["ORD-REJ-10"] "Goes back to an outdated order update."
        => overlooking(|agv, what| match what {
            Objection::Outdated => true,
            Objection::Joint(_) => agv.is_busy(),
            Objection::Action(asked, Lack::Id) => agv.actions.get(&asked.request.id).is_some_and(Action::of_order),
            _ => false,
        });
    tolerance "first-node-listed" ["NODE-03", "STATE-12"] "Lists the first node of an order until it sets out from it."
        => when(Event::Begun, |agv| if agv.motion.reached { linger(agv, 100) });
    tolerance "sets-out-late" ["ORD-FLOW-07", "ORD-FLOW-06"] "It stands for most of a second, with the first node listed, before it begins a new order."
        => when(Event::Begun, |agv| linger(agv, 700));
    tolerance "lib-thinks-before-driving" ["ORD-FLOW-07"] "It plans for two or three seconds after it has accepted an order before it starts to drive."
        => when(Event::Begun, |agv| linger(agv, 2_500));
    tolerance "adopts-before-driving" ["STATE-11", "STATE-03"] "The vehicle reports the adoption of an order or update in a state of its own, and its start in the next one at the same time."
        => plain().happens(|(), agv, event| if matches!(event, Event::Begun | Event::Updated) { agv.flush() });
    tolerance "nonzero-first-update-id-refused" ["ORD-FLOW-06"] "It rejects a new order whose orderUpdateId is not 0."
        => objecting(|_, order, relation| {
            let reason = "a new order begins with orderUpdateId 0";
            let other = relation == Relation::New && order.update_id != 0;
            other.then(|| Refusal::at_field(Rule::Unable, reason, "orderUpdateId"))
        });
    tolerance "duplicate-noted-in-information" ["ORD-REJ-13", "INFO-01"] "It mentions an order that came twice in an information entry, without an error."
        => keep::<bool>()
            .happens(|again, _, event| *again = match event {
                Event::SeenAgain => true,
                Event::Begun | Event::PowerCycled => false,
                _ => *again,
            })
            .says(|again, agv, part, m| {
                if *again && matches!(part, Part::State) {
                    let references = json!([{ "referenceKey": "orderId", "referenceValue": agv.order.order_id }]);
                    m.add("information", json!({ "infoType": "orderReceivedAgain", "infoLevel": "DEBUG", "infoReferences": references }));
                }
                true
            });
    tolerance "orders-spaced" ["FACT-13"] "States a minOrderInterval of a quarter of a second, and overlooks an order that comes earlier."
        => keep::<Option<Moment>>().hears(|before, agv, name, _| {
            if name != "order" {
                return true;
            }
            // Earlier than the factsheet allows, and not just by the way of a message.
            let before = before.replace(agv.moment());
            before.is_none_or(|before| agv.moment().since(before) >= Duration::from_millis(150))
        })
        .says(|_, _, part, m| {
            if matches!(part, Part::Factsheet) {
                m.part("protocolLimits", |limits| limits.part("timing", |timing| timing.set("minOrderInterval", 0.25)));
            }
            true
        });
    tolerance "own-error-names" ["ORD-FLOW-01", "MAP-08", "ORD-REJ-15"] "It has names of its own for errors that the standard does not name."
        => refusal(|_, rule, _, e| {
            let own = match rule {
                Rule::Memory => Some("insufficientMemory"),
                Rule::UnknownMap => Some("unknownMapId"),
                Rule::OtherOrderActive => Some("otherOrderActive"),
                _ => None,
            };
            e.error_type = own.map_or_else(|| e.error_type.clone(), str::to_owned);
            true
        });
    tolerance "outdated-error-brief" ["ORD-REJ-12", "STATE-05"] "It reports an outdated update in one state and takes the warning back at once."
        => refusal(|agv, rule, _, e| {
            if rule == Rule::Outdated {
                e.life = Life::Until(agv.moment() + brief(agv));
            }
            true
        });
    tolerance "outdated-update-warning-until-next-order" ["ORD-REJ-12", "ERR-01"] "It keeps orderUpdateError in its errors until it accepts a new order."
        => refusal(|_, rule, _, e| {
            if rule == Rule::Outdated {
                e.life = Life::UntilNewOrder;
            }
            true
        });
    tolerance "culprit-as-json-path" ["ORD-REJ-07", "BP-02"] "It names the wrong field of a refused order as a JSONPath under the key jsonPath."
        => refusal(|_, _, _, e| {
            for (key, value) in e.references.iter_mut().filter(|(key, _)| key == "field") {
                (*key, *value) = ("jsonPath".to_owned(), format!("$.{value}"));
            }
            true
        });
    tolerance "references-name-all-nodes" ["BP-02", "ORD-REJ-07"] "It references every nodeId of a refused order, so that a referenceKey occurs several times."
        => refusal(|_, _, message, e| {
            let nodes = message.get("nodes").and_then(Value::as_array).into_iter().flatten();
            let ids = nodes.filter_map(|node| node.get("nodeId")?.as_str()).take(20);
            e.references.extend(ids.map(|id| ("nodeId".to_owned(), id.chars().take(256).collect())));
            true
        });
    tolerance "refusal-in-two-errors" ["ORD-REJ-17", "ERR-01"] "It adds a warning orderRejected with the same references to every warning about a refused order."
        => refusal(|agv, _, _, e| {
            agv.errors.raise(ActiveError {
                error_type: "orderRejected".to_owned(),
                ..e.clone()
            });
            true
        });
}

fn echo(agv: &mut Agv, adoption: &Adoption<'_>) {
    if let Some(topic) = agv.config.topic("order").filter(|_| agv.connection.online) {
        agv.pending.push(Output::Publish(Publication {
            topic: topic.to_owned(),
            payload: adoption.message.to_string().into(),
            qos: 0,
            retain: false,
        }));
    }
}

/// How far from a node the order allows it to be.
fn range(node: &Node) -> f64 {
    let position = node.position.as_ref();
    position.and_then(|position| position.allowed_deviation).unwrap_or(0.0)
}

/// Whether theta is out of reach for somebody who forgets that angles repeat themselves.
fn is_turned_by_plain_difference(agv: &Agv, node: &Node) -> bool {
    let Some(position) = &node.position else { return false };
    let Some(wanted) = position.theta else { return false };
    let allowed = position.allowed_deviation_theta.unwrap_or(0.0);
    let allowed = allowed.max(agv.config.reach_theta);
    let plain = wanted - agv.motion.pose(agv.moment()).theta;
    plain.abs() > allowed && motion::wrapped(plain).abs() <= allowed
}

/// Whether an action of the order has failed.
pub(super) fn has_failed(agv: &Agv) -> bool {
    let mut of_order = agv.actions.iter().filter(|action| action.of_order());
    of_order.any(|action| action.status == Status::Failed)
}

/// It cannot take another order.
fn busy(reason: &str) -> Refusal {
    Refusal::new(Rule::OtherOrderActive, reason)
}

/// Refuses the next order, once it is locked.
pub(super) fn locking() -> Box<Hooks<bool>> {
    keep::<bool>().objects(|locked, _, _, _| locked.then(|| busy("another order is active")))
}
