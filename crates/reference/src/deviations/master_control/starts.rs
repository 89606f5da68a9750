//! Deviations of where an order begins, and which edges its way takes (sections 6.6.1 and 6.6.3).

use std::collections::VecDeque;
use std::f64::consts::PI;

use crate::master_control::commands::{text, transport};
use crate::master_control::config::SiteNode;
use crate::master_control::driving::again;
use crate::master_control::layout::distance;
use crate::master_control::rerouting::Reroute;

use super::prelude::*;

records! {
    fault "starts-elsewhere" ["ORD-03"] "Begins new orders at the second node of the way."
        => planning_new(|_, _, way| if way.legs.len() > 1 {
            way.stops.remove(0);
            way.legs.remove(0);
        });
    fault "next-order-from-old-start" ["ORD-CANCEL-14", "ORD-03"] "Begins the order behind a cancelled one where that had begun."
        => after_order(|order, _, _| order.stops.first());
    fault "goal-taken-for-reached" ["ORD-03", "ORD-CANCEL-14", "ORD-CANCEL-17"]
        "It begins an order at the goal of the order before, even if that was called off or given up on the way."
        => after_order(|order, _, _| order.stops.last());
    fault "start-at-the-node-ahead-after-cancel" ["ORD-CANCEL-14", "ORD-CANCEL-17", "ORD-03"]
        "It begins the order after a cancellation at the next node of the old order, towards which the vehicle was driving."
        => after_order(|order, called_off, vehicle| order.stops.get(order.reached(vehicle.state.as_ref()) + 1).filter(|_| called_off));
    fault "after-cancel-starts-at-old-base-end" ["ORD-CANCEL-14", "ORD-03"]
        "It begins the order after a cancellation at the end of the cancelled base and not at the node where the vehicle stopped."
        => after_order(|order, called_off, _| order.stops.get(order.released.checked_sub(1)?).filter(|_| called_off));
    fault "line-guided-from-base-end" ["ORD-CANCEL-14", "ORD-03"]
        "A vehicle without position that was stopped on its way gets a next order that begins at the end of the base it never reached."
        => after_order(|order, _, vehicle| order.stops.get(order.released.checked_sub(1)?).filter(|_| is_line_guided(vehicle)));
    fault "line-guided-from-next-node" ["ORD-CANCEL-14", "ORD-03"]
        "It begins the order after a cancellation at the node the vehicle would have reached next, when the vehicle reports no position."
        => after_order(|order, called_off, vehicle| order.stops.get(order.reached(vehicle.state.as_ref()) + 1).filter(|_| called_off && is_line_guided(vehicle)));
    fault "node-bound-vehicle-gets-temporary-node" ["ORD-CANCEL-14", "ORD-03"]
        "It begins the order after a cancel at a temporary node also for a line-guided vehicle that localizes on nodes by tags."
        => keep::<bool>().happens(called_off).stands(|called_off, site, vehicle, pose, _| {
            let node = site.config.node(&pose.node).filter(|_| *called_off && is_line_guided(vehicle));
            if let Some(node) = node {
                pose.standing = Standing::Between;
                pose.position = Some(Position {
                    x: node.x,
                    y: node.y,
                    theta: 0.0,
                    map_id: node.map_id.clone(),
                    position_initialized: true,
                    localization_score: None,
                    deviation_range: None,
                });
            }
        });
    fault "starts-at-its-home-node" ["ORD-03"] "It begins every order where the first order of the vehicle began, wherever the vehicle is now."
        => keep::<(Option<String>, Option<String>)>().happens(|(home, planned), _, _, event| match event {
            Event::Planned(running) => *planned = running.stops.first().map(|first| first.id.clone()),
            Event::Begun => *home = home.take().or_else(|| planned.take()),
            _ => {}
        }).stands(|(home, _), site, _, pose, _| if let Some(home) = home.as_ref().filter(|home| site.config.node(home).is_some()) {
            pose.node.clone_from(home);
            pose.position = None;
        });
    fault "start-before-manual" ["ORD-03"] "After a time in manual mode the next order begins where the vehicle was when it was taken over, not where it is."
        => keep::<Option<(String, Option<Position>)>>().happens(|before_manual, _, vehicle, event| match event {
            Event::State(Some(before)) if before.takes_orders() && !takes_orders(vehicle) => {
                *before_manual = Some((before.last_node_id.clone(), before.agv_position.clone()));
            }
            Event::Begun => *before_manual = None,
            _ => {}
        }).stands(from_before);
    fault "start-from-before-init-position" ["ORD-03"] "It begins the first order after an initPosition where the vehicle was before it."
        => keep::<Option<(String, Option<Position>)>>().happens(|before, _, vehicle, event| match event {
            Event::Placing(..) => *before = before.take().or_else(|| pose_of(vehicle)),
            Event::Begun => *before = None,
            _ => {}
        }).stands(from_before);
    fault "start-planned-too-early" ["ORD-03"] "It begins an order where the vehicle was when the transport was asked for, not where it is when the order is sent."
        => keep::<VecDeque<Option<(String, Option<Position>)>>>().asked(|asked_at, _, vehicle, command, arguments| {
            if command == "dispatch" && transport(vehicle, arguments).is_some() { asked_at.push_back(pose_of(vehicle)); }
            true
        }).happens(|asked_at, _, _, event| if let Event::Begun = event {
            asked_at.pop_front();
        }).stands(|asked_at, site, vehicle, pose, transport| if let Some(at) = asked_at.front_mut() { from_before(at, site, vehicle, pose, transport); });
    fault "start-ignores-map" ["ORD-03"] "It begins an order at the node with the coordinates of the vehicle even if the vehicle reports another map."
        => standing(|site, _, pose| if let Some(position) = &mut pose.position {
            let here = (position.x, position.y);
            let away = |node: &&SiteNode| distance((node.x, node.y), here);
            let near = site.config.nodes.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
            if let Some(node) = near.filter(|node| away(node) <= 0.3) { position.map_id.clone_from(&node.map_id); }
        });
    fault "deviation-halved" ["ORD-03"] "It makes the allowedDeviationXY of the first node half as large as the distance of the vehicle from it."
        => planning_new(|site, vehicle, way| if let Some((away, node)) = off_node(site, vehicle, way) {
            way.stops[0].deviation_xy = Some(node.deviation_xy.unwrap_or(0.0).max(away / 2.0));
        });
    fault "start-node-moved-to-vehicle" ["ORD-MSG-07"]
        "It sends the place the vehicle reports as the position of the first node when the vehicle stands a little beside that node."
        => planning_new(|site, vehicle, way| {
            let off = off_node(site, vehicle, way).is_some();
            if off && let Some((_, Some(position))) = pose_of(vehicle) { (way.stops[0].x, way.stops[0].y) = (position.x, position.y); }
        });
    fault "last-node-too-narrow" ["ORD-CANCEL-17", "ORD-03"]
        "For a vehicle that stopped between nodes the next order begins at the last node without a deviation that covers the vehicle."
        because "The vehicle may be taken for standing on the node; ORD-CANCEL-17 fails only a start that cannot be reached."
        => standing(|_, _, pose| pose.standing = Standing::OnLast { covered: false });
    tolerance "stands-on-last-node" ["ORD-CANCEL-17"] "Begins at the last node with a wide deviation when a vehicle stands between nodes."
        => standing(|_, _, pose| pose.standing = Standing::OnLast { covered: true });
    tolerance "temporary-start" ["ORD-03", "ORD-CANCEL-17"] "For a vehicle a little off a node a new order begins at a temporary node at its reported position."
        => standing(|_, _, pose| pose.standing = Standing::Exactly);
    fault "next-order-ahead" ["ORD-CANCEL-17", "ORD-03"] "Begins the order behind a cancelled one at the node the vehicle has not reached."
        => planning(|site, _, way| if temporary(site, way).is_some() && !way.legs.is_empty() {
            way.stops.remove(0);
            way.legs.remove(0);
        });
    fault "temporary-node-where-cancelled" ["ORD-CANCEL-17", "ORD-03"]
        "After a cancellation between nodes it puts the temporary node where the vehicle was when the cancellation was requested, not where it has stopped."
        => keep::<(Option<Position>, bool)>().happens(|(place, called_off), _, vehicle, event| match event {
            Event::CallingOff(..) => *place = pose_of(vehicle).and_then(|(_, position)| position),
            Event::Ended(_, true) => *called_off = true,
            Event::Begun => *called_off = false,
            _ => {}
        }).plans(|(place, called_off), site, _, way, _, _| if let Some(place) = place.as_ref().filter(|_| *called_off) && let Some(first) = temporary(site, way) {
            (first.x, first.y) = (place.x, place.y);
        });
    tolerance "temporary-node-wide" ["ORD-CANCEL-17"] "It gives temporary nodes an allowedDeviationXY of a metre."
        => planning(|site, _, way| if let Some(first) = temporary(site, way) { first.deviation_xy = Some(1.0); });
    tolerance "temporary-node-with-theta" ["ORD-CANCEL-17"] "It gives temporary nodes the reported theta of the vehicle."
        => planning(|site, vehicle, way| {
            if let Some((_, Some(position))) = pose_of(vehicle) && let Some(first) = temporary(site, way) {
                first.theta = Some(position.theta.sin().atan2(position.theta.cos()));
                first.deviation_theta = Some(PI);
            }
        });
    fault "one-id-two-places" ["ORD-MSG-07"] "Gives the nodeId of a layout node to the place where a vehicle stands between nodes."
        => plain().names(|(), _, vehicle, what, id| if what == "place" {
            let last = vehicle.state.as_ref().map(|state| state.last_node_id.as_str()).filter(|last| !last.is_empty());
            last.unwrap_or(id).to_owned().clone_into(id);
        });
    fault "temporary-node-id-fixed" ["ORD-MSG-07"] "Every temporary node has the id temporary, wherever it is."
        => naming("place", |_, _| "temporary".to_owned());
    fault "temporary-id-with-coordinates" ["JSON-04"] "It names temporary nodes by their coordinates in parentheses with comma and blank."
        because "JSON-04, which letters an identifier has, is a recommendation; parentheses lead no vehicle astray."
        => plain().names(|(), _, vehicle, what, id| if what == "place" && let Some((_, Some(position))) = pose_of(vehicle) {
            *id = format!("({:.2}, {:.2})", position.x, position.y);
        });
    fault "letters-in-the-temporary-node" ["FACT-12"] "It names the temporary node after a cancellation with letters, though the vehicle takes numerical ids only."
        => plain().names(|(), site, _, what, id| if what == "place" { *id = format!("tmp-{}", site.ids); })
            .allows(|(), _, _, what, usual| usual || matches!(what, Permission::Name(id) if id.starts_with("tmp-")));
    fault "blocked-edge-used" ["ORD-12"] "Does not look at edges the vehicle may not use."
        => plain().avoids(|(), _, _, _, _, closed| closed.clear())
            .allows(|(), _, _, what, usual| usual || matches!(what, Permission::Drive(_)))
            .happens(|(), _, _, event| if let Event::Closed(_, heeded) = event { **heeded = false; });
    fault "block-checked-at-planning-only" ["ORD-12"]
        "It heeds blocked edges only when an order is planned and extends a running order over an edge blocked meanwhile."
        => plain().allows(|(), _, _, what, usual| usual || matches!(what, Permission::Drive(base) if base > 0))
            .happens(|(), _, _, event| if let Event::Closed(_, heeded) = event { **heeded = false; });
    fault "base-shortened-on-block" ["ORD-UPD-03", "ORD-CANCEL-01", "ORD-UPD-05"]
        "When an edge of the base is blocked, an order update that begins before it takes the rest of the base back, instead of cancelOrder."
        => happening(|_, vehicle, event| if let Event::Closed(index, _) = event && let Some(running) = &mut vehicle.running {
            running.released = running.released.min(*index + 1);
        });
    fault "only-last-block-kept" ["ORD-12"] "It remembers only the edge that was blocked last for a vehicle and uses those blocked before."
        => asked("block-edge", |_, vehicle, _| {
            vehicle.blocked.clear();
            true
        });
    fault "unblock-frees-both-ways" ["ORD-12"] "It opens both directions of a way when only one of them is unblocked."
        => asked("unblock-edge", |_, vehicle, arguments| {
            if let (Some(from), Some(to)) = (text(arguments, "from"), text(arguments, "to")) { vehicle.blocked.remove(&(to, from)); }
            true
        });
    tolerance "blocks-by-cancel" ["ORD-UPD-03", "ORD-CANCEL-01"] "It calls the order off and sends another when an edge of the horizon is blocked."
        => happening(|site, vehicle, event| if let Event::Closed(_, heeded) = event {
            **heeded = false;
            let then = vehicle.running.as_ref().map(|running| again(running, vehicle.state.as_ref()));
            site.cancel(vehicle, then);
        });
    fault "reroute-over-blocked-edge" ["ORD-12"] "A change of destination is planned without regard to the edges the vehicle may not use."
        => keep::<bool>().happens(|blind, _, _, event| if let Event::Rerouting(..) = event { *blind = true; }).asked(|blind, _, _, command, _| {
            *blind &= command != "dispatch";
            true
        }).avoids(|blind, _, _, _, _, closed| if *blind { closed.clear(); }).allows(|blind, _, _, what, usual| usual || (*blind && matches!(what, Permission::Drive(_))));
    fault "redirect-takes-barred-edge" ["ORD-12"]
        "It leads a vehicle across an edge barred for it when it plans anew after a cancellation; only first plans look at the bars."
        => keep::<(bool, bool)>().happens(|(called_off, _), _, _, event| match event {
            Event::Ended(_, true) => *called_off = true,
            Event::Begun => *called_off = false,
            _ => {}
        }).stands(|(called_off, blind), _, _, _, _| *blind = *called_off).avoids(|(_, blind), _, _, _, _, closed| if *blind { closed.clear(); }).allows(|(_, blind), _, _, what, usual| usual || (*blind && matches!(what, Permission::Drive(_))));
    tolerance "takes-the-long-way" ["ORD-12", "TOPIC-13"] "It takes the second best way where there is one."
        => plain().avoids(|(), site, _, from, to, closed| {
            let first = site.config.any_way(from, to, closed).and_then(|way| way.first().map(|edge| (edge.from.clone(), edge.to.clone())));
            if let Some(first) = first && closed.insert(first.clone()) && site.config.way(from, to, closed).is_none() { closed.remove(&first); }
        });
    fault "reroute-cuts-base" ["ORD-UPD-03", "ORD-UPD-05", "ORD-CANCEL-01"]
        "A change of destination while a horizon is left cuts the base behind the next node and goes on from there."
        => happening(|_, vehicle, event| if let Event::Rerouting(running, _) = event && !running.is_whole() {
            running.released = running.released.min(running.reached(vehicle.state.as_ref()) + 2);
        });
    fault "base-replaced" ["ORD-UPD-03", "ORD-CANCEL-01"] "Changes the base by an update when the destination changes."
        => happening(|_, vehicle, event| if let Event::Rerouting(running, _) = event && running.is_whole() {
            running.released = running.reached(vehicle.state.as_ref()) + 1;
        });
    tolerance "reroutes-by-cancel" ["ORD-UPD-03", "ORD-CANCEL-01"] "A change of destination is always done by cancelOrder and a new order, never by another horizon."
        => happening(|_, _, event| if let Event::Rerouting(_, how) = event { **how = Reroute::ByCancel; });
    fault "action-added-to-the-stitching-node" ["ORD-UPD-06", "ORD-UPD-03"]
        "It adds the drop to the stitching node, when the destination is changed to the node where the base ends."
        => happening(|_, _, event| if let Event::NotLed(running, way, transport, done) = event && way.stops.len() == 1 {
            let added = std::mem::take(&mut way.stops[0].actions);
            if added.is_empty() { return; }
            let base = running.released;
            running.stops.truncate(base);
            running.legs.truncate(base.saturating_sub(1));
            running.stops.last_mut().into_iter().for_each(|end| end.actions.extend(added.clone()));
            running.transport = Transport { loaded: running.transport.loaded, ..transport.clone() };
            running.changed = true;
            **done = true;
        });
}

type AfterOrder = for<'a> fn(&'a Running, bool, &Vehicle) -> Option<&'a Stop>;

/// Begins orders at a node of the order before, knowing whether that was called off.
fn after_order(at: AfterOrder) -> Box<dyn Deviation> {
    each((at, None::<(Running, bool)>))
        .happens(|(_, last), _, _, event| match event {
            Event::Ended(order, called_off) => *last = Some(((*order).clone(), *called_off)),
            Event::Begun => last.iter_mut().for_each(|(_, called_off)| *called_off = false),
            _ => {}
        })
        .stands(|(at, last), site, vehicle, pose, _| {
            let stop = last
                .as_ref()
                .and_then(|(order, called_off)| at(order, *called_off, vehicle));
            if let Some(node) = stop.and_then(|stop| site.config.node(&stop.id)) {
                pose.node.clone_from(&node.id);
                pose.position = None;
            }
        })
}

fn is_line_guided(vehicle: &Vehicle) -> bool {
    vehicle.state.as_ref().is_some_and(|state| state.agv_position.is_none())
}

fn called_off(called_off: &mut bool, _: &mut Site, _: &mut Vehicle, event: &mut Event<'_>) {
    match event {
        Event::Ended(_, true) => *called_off = true,
        Event::Begun => *called_off = false,
        _ => {}
    }
}

/// Where the last state shows a vehicle.
fn pose_of(vehicle: &Vehicle) -> Option<(String, Option<Position>)> {
    let state = vehicle.state.as_ref()?;
    Some((state.last_node_id.clone(), state.agv_position.clone()))
}

fn from_before(
    before: &mut Option<(String, Option<Position>)>,
    _: &mut Site,
    _: &mut Vehicle,
    pose: &mut Pose,
    _: &Transport,
) {
    if let Some((node, position)) = before {
        pose.node.clone_from(node);
        pose.position.clone_from(position);
    }
}

/// How far the vehicle is off the node of the layout where its way begins, if it does not stand on it exactly.
fn off_node<'a>(site: &'a Site, vehicle: &Vehicle, way: &Way) -> Option<(f64, &'a SiteNode)> {
    let node = site.config.node(&way.stops.first()?.id)?;
    let (_, position) = pose_of(vehicle)?;
    let position = position?;
    let away = distance((node.x, node.y), (position.x, position.y));
    (away > 0.05).then_some((away, node))
}
