//! Deviations of when orders are begun, which id they get, over which nodes they lead and what is done there (sections
//! 6.6.1 and 6.8).

use crate::master_control::actions::is_predefined;
use crate::master_control::commands::transport;

use super::prelude::*;

records! {
    fault "fleet-of-one" ["MQTT-11"] "Serves the first vehicle only."
        because "MQTT-11 is a recommendation."
        => plain().configures(|config| config.vehicles.truncate(1));
    fault "pause-for-all" ["TOPIC-13"] "Pauses every vehicle of the fleet, and lets all go on, when that is asked for one of them."
        => pauses_all();
    fault "orders-not-sent" ["TOPIC-13"] "Plans its orders and never sends them."
        => plain().sends(|(), _, _, out| out.name != "order");
    fault "order-id-from-goal" ["ORD-MSG-02"] "It makes the orderId from the destination, so that a later transport to the same place has the same orderId."
        => planned(|_, _, running| {
            let transport = &running.transport;
            running.id = numbered(format!("to-{}", transport.to), transport.begun);
        });
    fault "order-id-from-route" ["ORD-MSG-02"] "It forms the orderId from start and destination, so that the same transport on another day has the same orderId."
        => planned(|_, _, running| {
            let transport = &running.transport;
            let start = running.stops.first().map(|stop| stop.id.as_str());
            let from = transport.from.as_deref().or(start).unwrap_or_default();
            running.id = numbered(format!("{from}-to-{}", transport.to), transport.begun);
        });
    fault "order-id-kept-behind-a-cancellation" ["ORD-MSG-02"] "It sends the order after a cancellation under the orderId of the cancelled one, with orderUpdateId 0."
        => keep::<Option<String>>().happens(|kept, _, vehicle, event| match event {
            Event::Ended(order, true) => *kept = Some(order.id.clone()),
            Event::Planned(running) => running.id = kept.clone().unwrap_or(std::mem::take(&mut running.id)),
            Event::Begun => {
                // The state from before the order names the order called off, under the same id.
                if kept.take().is_some() && let Some(state) = &mut vehicle.state { state.order_id.clear(); }
            }
            _ => {}
        });
    fault "order-id-kept-after-cancel" ["ORD-MSG-02", "ORD-UPD-04", "ORD-UPD-05"]
        "The first order after a cancellation has the orderId of the order that was called off and the next orderUpdateId."
        => keep::<Option<(String, u32)>>().happens(|kept, _, _, event| match event {
            Event::Ended(order, true) => *kept = Some((order.id.clone(), order.update_id)),
            Event::Planned(running) => if let Some((id, update)) = kept {
                running.id.clone_from(id);
                running.update_id = *update + 1;
            },
            Event::Begun => *kept = None,
            _ => {}
        });
    tolerance "update-id-from-seven" ["ORD-UPD-04"] "Begins orders with orderUpdateId 7."
        => planned(|_, _, running| running.update_id = 7);
    fault "action-ids-kept-after-cancel" ["ORD-MSG-17"]
        "It gives the actions of the order after a cancelled one the actionIds of the actions of the same type in the cancelled one."
        => keep::<Option<Running>>().happens(|old, _, _, event| match event {
            Event::Ended(order, true) => *old = Some(order.clone()),
            Event::Planned(running) => {
                let known: Vec<&Value> = old.iter().flat_map(|old| &old.stops).flat_map(|stop| &stop.actions).collect();
                for action in running.stops.iter_mut().flat_map(|stop| &mut stop.actions) {
                    if let Some(same) = known.iter().find(|known| known["actionType"] == action["actionType"]) { action["actionId"] = same["actionId"].clone(); }
                }
            }
            Event::Begun => *old = None,
            _ => {}
        });
    fault "action-ids-counted-per-message" ["ORD-MSG-17"]
        "It numbers the actions within each order message, so that the actions of an update get the ids of those of the first message."
        => happening(|_, vehicle, event| match event {
            Event::Begins(running) => number_actions(vehicle, running, 0),
            Event::Updating(running) => number_actions(vehicle, running, running.released),
            _ => {}
        });
    tolerance "horizon-actions-get-new-ids" ["ORD-MSG-17", "ORD-UPD-06"] "It gives the actions of the horizon new action ids when they are sent again in an update."
        => updating(|site, vehicle, running| {
            let first = running.released;
            for action in unreleased(running, first) { action["actionId"] = json!(site.next_id(vehicle, "action")); }
        });
    fault "resume-on-first-node" ["ACT-08", "FACT-15"] "It puts a stopPause on the first node of an order for a vehicle that is paused."
        => planned(|site, vehicle, running| if vehicle.is_paused() {
            let action = site.action(vehicle, "stopPause", &Value::Null);
            running.stops[0].actions.push(action);
        });
    fault "state-request-at-goal" ["ACT-08", "FACT-15"] "It puts a stateRequest on the last node of each order."
        => planning(|site, vehicle, way| at_goal(site, vehicle, way, "stateRequest"));
    fault "pause-on-node" ["ACT-08", "FACT-15"] "Sends startPause as an action of a node."
        => planning(|site, vehicle, way| at_goal(site, vehicle, way, "startPause"));
    fault "pick-and-drop-share-id" ["ORD-MSG-17"] "The pick and the drop of one transport have the same actionId."
        => planning(|_, _, way| {
            let mut picked = None;
            for action in way.stops.iter_mut().flat_map(|stop| &mut stop.actions) {
                if action["actionType"] == "pick" {
                    picked = Some(action["actionId"].clone());
                } else if action["actionType"] == "drop" && let Some(id) = &picked { action["actionId"] = id.clone(); }
            }
        });
    fault "action-id-of-station" ["ORD-MSG-17"]
        "It makes the actionId of a node action from its type and the node, so that the same action at the same node has it again in a later order."
        => planning(|_, _, way| for stop in &mut way.stops {
            for action in &mut stop.actions { action["actionId"] = json!(format!("{}-{}", action["actionType"].as_str().unwrap_or_default(), stop.id)); }
        });
    fault "hard-although-not-listed" ["FACT-15"] "It sends actions at stations with blocking type HARD, though the factsheet lists other blocking types only for them."
        => planning(|_, _, way| for action in way_actions(way) { action["blockingType"] = json!("HARD"); });
    tolerance "vendor-actions-block-nothing" ["ORD-MSG-16", "FACT-15"]
        "It sends actions of the manufacturer on nodes with blockingType NONE where the vehicle allows it."
        => planning(|_, vehicle, way| for action in way.stops.iter_mut().flat_map(|stop| &mut stop.actions) {
            let kind = action["actionType"].as_str().unwrap_or_default();
            let listed = vehicle.offer(kind).and_then(|offer| offer.blocking_types.as_ref());
            if !is_predefined(kind) && listed.is_none_or(|listed| listed.iter().any(|blocking| blocking == "NONE")) { action["blockingType"] = json!("NONE"); }
        });
    fault "trigger-on-edge" ["ACT-08", "FACT-15"] "It puts waitForTrigger on the edge before the node."
        => planning(|_, _, way| to_edges(way, |kind, _| kind == "waitForTrigger"));
    tolerance "actions-on-edges" ["ACT-08", "FACT-15"] "pick, drop and other actions are put on the last edge before the station where the vehicle offers that scope."
        => planning(|site, vehicle, way| to_edges(way, |kind, taken| {
            let limit = vehicle.factsheet.as_ref().map_or(usize::MAX, |sheet| sheet.limit(&["edge.actions"]));
            site.offers(vehicle, kind, "EDGE") && taken < limit
        }));
    fault "edge-action-on-node" ["FACT-15"] "It puts an action on a node that the vehicle offers on edges only."
        => planning(|_, _, way| for (leg, stop) in way.legs.iter_mut().zip(way.stops.iter_mut().skip(1)) { stop.actions.append(&mut leg.actions); });
    tolerance "load-id-given" ["ACT-31", "FACT-15"] "It sends the optional parameter loadId with pick where the vehicle lists it."
        => planning(|site, vehicle, way| for stop in way.stops.iter_mut().filter(|_| is_roomy(vehicle)) {
            for pick in stop.actions.iter_mut().filter(|action| action["actionType"] == "pick") {
                let listed = vehicle.offer("pick").and_then(|offer| offer.action_parameters.as_deref()).unwrap_or_default();
                if listed.iter().any(|parameter| parameter.key == "loadId") && let Some(list) = pick["actionParameters"].as_array_mut() {
                    list.retain(|parameter| parameter["key"] != "loadId");
                    list.push(json!({ "key": "loadId", "value": site.next_id(vehicle, "load") }));
                }
            }
        });
    tolerance "fine-positioning-before-pick" ["ACT-08", "FACT-15"] "It puts a finePositioning before each pick on a node where the vehicle offers it."
        => planning(|site, vehicle, way| {
            let offered = vehicle.offer("finePositioning").is_some() && site.offers(vehicle, "finePositioning", "NODE");
            let limit = vehicle.factsheet.as_ref().map_or(usize::MAX, |sheet| sheet.limit(&["node.actions"]));
            for stop in way.stops.iter_mut().filter(|stop| offered && is_roomy(vehicle) && stop.actions.len() < limit) {
                if let Some(at) = stop.actions.iter().position(|action| action["actionType"] == "pick") {
                    stop.actions.insert(at, site.action(vehicle, "finePositioning", &Value::Null));
                }
            }
        });
    fault "pick-at-once" ["ACT-08", "FACT-15"] "Sends pick as an instant action."
        => planning(|site, vehicle, way| at_once(site, vehicle, &mut way.stops, "pick"));
    fault "drop-at-once-when-there" ["ACT-08", "FACT-15"] "When the vehicle stands at the goal already it sends drop as an instant action."
        => planning_new(|site, vehicle, way| {
            let there = way.legs.is_empty() && way.stops.first().is_some_and(|stop| stop.actions.len() == 1);
            if there { at_once(site, vehicle, &mut way.stops, "drop"); }
        });
    fault "node-actions-limit-ignored" ["FACT-12"] "Gives a node more actions than the vehicle takes."
        => unlimited(|what| matches!(what, Measure::Actions));
    fault "parameter-limit-ignored" ["FACT-12"] "Gives an action more parameters than the vehicle takes."
        => unlimited(|what| matches!(what, Measure::Parameters));
    tolerance "generous-deviations" ["ORD-MSG-09"] "Nodes without actions have an allowedDeviationXY of 0.8 m where the vehicle supports it and has no corridors."
        => planning_new(|_, vehicle, way| {
            // Behind a node the vehicle has to be inside of the next corridor (CORR-04).
            let has_corridors = vehicle.factsheet.as_ref().is_some_and(|sheet| sheet.support("order.edges.corridor").is_some());
            for stop in way.stops.iter_mut().filter(|stop| !has_corridors && stop.actions.is_empty()) { stop.deviation_xy.get_or_insert(0.8); }
        });
    tolerance "second-leg-as-update-of-the-completed-order" ["ORD-MSG-02", "ORD-UPD-05"]
        "It sends the way to the first station as an order without horizon and, when that is completed, the rest as an update that begins at the last node."
        => keep::<Option<usize>>().happens(|halt, _, vehicle, event| match event {
            Event::Planned(running) => *halt = first_leg(running),
            Event::Led(_) => *halt = None,
            Event::Extending(running) => {
                let Some(state) = &vehicle.state else { return };
                let pending = |id: &str| state.action(id).is_some_and(|action| !action.is_terminal());
                let there = state.order_id == running.id && state.route_empty();
                if there && running.reached(Some(state)) + 1 >= halt.unwrap_or(0) && !running.action_ids().any(pending) { *halt = None; }
            }
            _ => {}
        }).measures(|halt, _, _, what, usual| if let Measure::Free = what { usual.min(halt.unwrap_or(usize::MAX)) } else { usual })
        .shows(|halt, _, _, running, window, free| if halt.is_some() && running.released == 0 { (window.released, window.end) = (free, free); });
    fault "interval-within-order-only" ["FACT-13"] "Keeps minOrderInterval between the messages of one order only."
        => at_any_time(|_, occasion| occasion == Occasion::New);
    fault "order-interval-ignored" ["FACT-13"] "Does not keep the interval between orders."
        => at_any_time(|_, _| true);
    fault "resent-too-soon" ["FACT-13"] "Sends a lost order again without regard to minOrderInterval."
        => at_any_time(|_, occasion| occasion == Occasion::Again);
    fault "interval-ignored-on-reroute" ["FACT-13"] "It does not wait for minOrderInterval when it sends another destination or another horizon."
        => at_any_time(|_, occasion| matches!(occasion, Occasion::Update { changed: true, .. }));
    fault "interval-not-when-base-asked" ["FACT-13"] "It does not keep minOrderInterval for an update that the vehicle asks for by newBaseRequest."
        => at_any_time(|_, occasion| matches!(occasion, Occasion::Update { asked: true, .. }));
    fault "interval-not-after-cancel" ["FACT-13"] "The first order after a cancellation is sent without regard to minOrderInterval."
        => at_any_time(|called_off, occasion| called_off && occasion == Occasion::New);
    fault "order-and-updates-in-a-burst" ["FACT-13"] "It sends an order and the first two updates of it within a tenth of a second, whatever the minOrderInterval."
        => keep::<(u32, Option<Moment>)>().happens(|(updates, begun), site, vehicle, event| match event {
            Event::Begun => {
                (*updates, *begun) = (0, Some(site.now.moment));
                vehicle.at(site.now.moment);
            }
            Event::Updated(..) => {
                *updates += 1;
                vehicle.at(site.now.moment);
            }
            _ => {}
        }).judges(|burst, site, _, running, _, fate| {
            // It does not wait until the message before is seen.
            running.confirmed |= fate == Fate::Runs && bursts(burst, site) && !running.is_whole();
            fate
        }).allows(|burst, site, _, what, usual| usual || matches!(what, Permission::Grow(running, ..) if bursts(burst, site) && !running.is_whole()))
        .measures(|burst, site, _, what, usual| match what {
            Measure::Base(running, free, _) if bursts(burst, site) => usual.max(running.released + 1).min(free),
            _ => usual,
        }).lasts(|burst, site, _, what, usual| match what {
            Span::Interval(Occasion::Update { .. }) if bursts(burst, site) => Duration::ZERO,
            _ => usual,
        });
    fault "interval-in-milliseconds" ["FACT-13"] "It takes minOrderInterval for milliseconds."
        => plain().lasts(|(), _, _, what, usual| if let Span::Interval(_) = what { usual / 1000 } else { usual });
    tolerance "answers-slowly" ["ORD-UPD-02"] "Looks at a message half a second after it came."
        => plain().configures(|config| config.answers_after = Duration::from_millis(500));
    tolerance "no-horizon" ["ORD-09"] "Sends the base only."
        => plain().configures(|config| config.horizon_length = 0);
    tolerance "long-horizon" ["ORD-09"] "Sends the whole way as horizon."
        => plain().configures(|config| config.horizon_length = usize::MAX);
    tolerance "horizon-of-one-node" ["ORD-09"] "It never shows more than one node of the horizon."
        => plain().configures(|config| config.horizon_length = config.horizon_length.min(1));
    tolerance "whole-base" ["ORD-UPD-02"] "Releases the whole way at once."
        => plain().configures(|config| config.base_length = usize::MAX);
    tolerance "resends-once" ["ORD-REJ-18"] "Sends an order again, unchanged, that was not seen within a second."
        => plain().configures(|config| (config.resend_after, config.resend_limit) = (Duration::from_secs(1), 1));
    tolerance "small-steps" ["ORD-UPD-02", "ORD-UPD-04"] "Keeps a longer base and extends it at every node."
        => letting(|site, _, what| matches!(what, Permission::Grow(_, ahead, _) if ahead < site.config.base_length))
            .configures(|config| config.base_length = config.base_length.max(4));
    tolerance "whole-way-released" ["ORD-09", "ORD-UPD-02"] "It releases the whole way with the first message of an order."
        => showing(|_, running, window, free| if running.released == 0 { (window.released, window.end) = (free, free); });
    tolerance "horizon-to-the-goal" ["ORD-09", "ORD-UPD-02"] "It shows the whole rest of the way as horizon."
        => showing(|_, _, window, free| window.end = free);
    tolerance "first-order-without-horizon" ["ORD-09", "ORD-UPD-02"] "It sends the first message of an order without horizon and extends the base by updates."
        => showing(|_, running, window, _| if running.released == 0 { window.end = window.released; });
    tolerance "one-node-first" ["ORD-02", "ORD-MSG-06"] "It first sends an order with only the node where the vehicle stands and adds the way by an update."
        => showing(|_, running, window, _| if running.released == 0 { (window.released, window.end) = (1, 1); });
    tolerance "factsheet-awaited" ["OPT-03", "FACT-15"] "It begins no order before it has the factsheet of the vehicle."
        => forbidding(|_, vehicle, what| matches!(what, Permission::Begin) && vehicle.factsheet.is_none());
    tolerance "no-new-order-while-paused" ["TOPIC-13"] "It begins no new order while the vehicle is paused."
        => forbidding(|_, vehicle, what| matches!(what, Permission::Begin) && vehicle.is_paused());
    tolerance "pause-after-cancel-before-next-order" ["TOPIC-13", "ORD-CANCEL-17"] "It waits some seconds after a finished cancelOrder before it sends the next order."
        => keep::<Option<Moment>>().happens(|due, site, vehicle, event| match event {
            Event::Ended(_, true) => {
                *due = Some(site.now.moment + Duration::from_secs(3));
                vehicle.at(site.now.moment + Duration::from_secs(3));
            }
            Event::Looked => again_at(*due, site, vehicle),
            _ => {}
        }).allows(not_before);
    tolerance "dispatches-after-two-seconds" ["TOPIC-13"] "It sends an order two seconds after the operator asked for it."
        => keep::<Option<Moment>>().asked(|due, site, _vehicle, command, _| {
            if command == "dispatch" { *due = Some(site.now.moment + Duration::from_secs(2)); }
            true
        }).happens(|due, site, vehicle, event| if let Event::Looked = event { again_at(*due, site, vehicle); }).allows(not_before);
    tolerance "latest-transport-first" ["TOPIC-13", "ORD-MSG-02"] "It begins the transport asked for last before those that wait longer."
        => plain().asked(|(), site, vehicle, command, arguments| {
            let Some(latest) = transport(vehicle, arguments).filter(|_| command == "dispatch") else { return true };
            site.dispatch(vehicle, latest);
            if vehicle.queue.front().is_some_and(|next| !next.follows) && let Some(latest) = vehicle.queue.pop_back() { vehicle.queue.push_front(latest); }
            false
        });
    tolerance "pick-and-drop-apart" ["ORD-MSG-02", "TOPIC-13"] "A transport from one station to another is done in two orders, one for the pick and one for the drop."
        => plain().asked(|(), site, vehicle, command, arguments| {
            let whole = transport(vehicle, arguments).filter(|whole| command == "dispatch" && whole.action.is_none());
            let Some((whole, from)) = whole.and_then(|whole| Some((whole.clone(), whole.from?))) else { return true };
            let parameters = Value::Null;
            let pick = Transport { from: None, to: from, action: Some("pick".into()), parameters, ..whole.clone() };
            let drop = Transport { from: None, action: Some("drop".into()), follows: true, ..whole };
            site.dispatch(vehicle, pick);
            site.dispatch(vehicle, drop);
            false
        });
    tolerance "long-ways-in-two-orders" ["ORD-MSG-02", "ORD-02"] "It drives a long way in two orders one after the other."
        => plain().asked(|(), site, vehicle, command, arguments| {
            let plain = |whole: &Transport| whole.from.is_none() && whole.action.is_none() && whole.load_type.is_none();
            let idle = vehicle.running.is_none() && vehicle.queue.is_empty();
            let whole = transport(vehicle, arguments).filter(|whole| command == "dispatch" && idle && plain(whole));
            let Some((whole, halfway)) = whole.and_then(|whole| Some((whole.clone(), halfway(site, vehicle, &whole.to)?))) else { return true; };
            site.dispatch(vehicle, Transport { to: halfway, ..whole.clone() });
            site.dispatch(vehicle, Transport { follows: true, ..whole });
            false
        });
    tolerance "asks-for-states" ["ACT-08"] "Asks for a state when it has begun an order."
        => begun(|site, vehicle| { site.instant(vehicle, "stateRequest", &Value::Null); });
    tolerance "asks-for-factsheet" ["ACT-08"] "Asks for the factsheet although it has one."
        => begun(|site, vehicle| { site.instant(vehicle, "factsheetRequest", &Value::Null); });
}

/// Pauses every vehicle of the fleet, or lets all go on.
fn pauses_all() -> Box<dyn Deviation> {
    plain().commanded(|(), site, fleet, command, arguments| {
        let concerned = matches!(command, "pause" | "resume");
        for vehicle in fleet.iter_mut().filter(|_| concerned) {
            site.vehicle_command(vehicle, command, arguments);
        }
        !concerned
    })
}

/// Sends order messages without regard to minOrderInterval, knowing whether the last order was called off.
fn at_any_time(when: fn(bool, Occasion) -> bool) -> Box<dyn Deviation> {
    each((when, false))
        .happens(|(_, called_off), _, _, event| match event {
            Event::Ended(_, true) => *called_off = true,
            Event::Begun => *called_off = false,
            _ => {}
        })
        .lasts(|(when, called_off), _, _, what, usual| match what {
            Span::Interval(occasion) if when(*called_off, occasion) => Duration::ZERO,
            _ => usual,
        })
}

/// Whether it still sends updates right behind an order, knowing how many there were and when that began.
fn bursts((updates, begun): &(u32, Option<Moment>), site: &Site) -> bool {
    *updates < 2 && begun.is_some_and(|begun| begun + Duration::from_millis(100) > site.now.moment)
}

fn numbered(id: String, begun: u32) -> String {
    if begun > 0 { format!("{id}-{begun}") } else { id }
}

/// The actions of the nodes from this one on, and of the edges that lead to them.
fn unreleased(running: &mut Running, first: usize) -> impl Iterator<Item = &mut Value> {
    let on_nodes = running.stops.iter_mut().skip(first).flat_map(|stop| &mut stop.actions);
    let edges = running.legs.iter_mut().skip(first.saturating_sub(1));
    on_nodes.chain(edges.flat_map(|leg| &mut leg.actions))
}

/// Numbers what is new in a message, from the node `first` on, from 1.
fn number_actions(vehicle: &Vehicle, running: &mut Running, first: usize) {
    let sheet = vehicle.factsheet.as_ref();
    let numerical = sheet.is_some_and(|sheet| sheet.ids_numerical);
    let longest = sheet.and_then(|sheet| sheet.id_length).unwrap_or(usize::MAX);
    let order = running.id.clone();
    for (number, action) in (1..).zip(unreleased(running, first)) {
        let full = if numerical {
            format!("{order}{number:03}")
        } else {
            format!("{order}-action-{number}")
        };
        action["actionId"] = json!(if full.len() <= longest {
            full
        } else {
            i32::to_string(&number)
        });
    }
}

fn at_goal(site: &mut Site, vehicle: &Vehicle, way: &mut Way, kind: &str) {
    let action = site.action(vehicle, kind, &Value::Null);
    way.stops
        .last_mut()
        .into_iter()
        .for_each(|goal| goal.actions.push(action.clone()));
}

fn way_actions(way: &mut Way) -> impl Iterator<Item = &mut Value> {
    let on_nodes = way.stops.iter_mut().flat_map(|stop| &mut stop.actions);
    on_nodes.chain(way.legs.iter_mut().flat_map(|leg| &mut leg.actions))
}

/// Puts actions of nodes on the edges that lead to them, by type and the number of actions there are.
fn to_edges(way: &mut Way, moves: impl Fn(&str, usize) -> bool) {
    for (leg, stop) in way.legs.iter_mut().zip(way.stops.iter_mut().skip(1)) {
        for action in std::mem::take(&mut stop.actions) {
            let moved = moves(action["actionType"].as_str().unwrap_or_default(), leg.actions.len());
            if moved { &mut leg.actions } else { &mut stop.actions }.push(action);
        }
    }
}

/// Sends the actions of a type at once, as instant actions.
fn at_once(site: &mut Site, vehicle: &mut Vehicle, stops: &mut [Stop], kind: &str) {
    for stop in stops {
        for action in stop.actions.extract_if(.., |action| action["actionType"] == kind) {
            site.queue(vehicle, action);
        }
    }
}

/// Whether a node may have an action more, and an action a parameter more.
fn is_roomy(vehicle: &Vehicle) -> bool {
    let sheet = vehicle.factsheet.as_ref();
    sheet.is_some_and(|sheet| {
        sheet.limit(&["actions.actionsParameters"]) == usize::MAX && sheet.limit(&["node.actions"]) >= 2
    })
}

/// Number of nodes up to the pick, where the way goes on behind it.
fn first_leg(running: &Running) -> Option<usize> {
    let picks = |stop: &Stop| stop.actions.iter().any(|action| action["actionType"] == "pick");
    let nodes = running.stops.iter().position(picks)? + 1;
    (running.transport.from.is_some() && nodes > 1 && nodes < running.stops.len()).then_some(nodes)
}

/// The node where the first of two orders ends.
fn halfway(site: &Site, vehicle: &Vehicle, to: &str) -> Option<String> {
    let last = &vehicle.state.as_ref()?.last_node_id;
    let way = site.config.way(last, to, &vehicle.blocked)?;
    let middle = way.get((way.len() / 2).saturating_sub(1)).filter(|_| way.len() > 2)?;
    Some(middle.to.clone())
}

fn again_at(due: Option<Moment>, site: &Site, vehicle: &mut Vehicle) {
    if let Some(due) = due.filter(|due| *due > site.now.moment) {
        vehicle.at(due);
    }
}

fn not_before(due: &Option<Moment>, site: &Site, _: &Vehicle, what: Permission<'_>, usual: bool) -> bool {
    usual && !(matches!(what, Permission::Begin) && due.is_some_and(|due| due > site.now.moment))
}
