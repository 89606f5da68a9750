//! Deviations of what a vehicle does in zones (sections 6.4.1, 6.4.4 and 6.4.5).

use crate::agv::hook_points::Passage;
use crate::agv::motion::Pose;
use crate::agv::order_message::ActionRequest;
use crate::agv::zones::{Limitation, Zone, ZoneKind};
use tck_base::polygon::Point;

use super::prelude::*;

/// Whether a zone of this kind in an enabled set overlaps another zone.
fn overlaps(agv: &Agv, zone: &Zone, is_one: impl Fn(&ZoneKind) -> bool) -> bool {
    let sets = agv.zone_sets.all.iter().filter(|set| set.enabled);
    let mut zones = sets.flat_map(|set| &set.zones);
    // Zones that lie side by side have a border in common, and no middle.
    let shares = |other: &Zone| other.area.contains(middle(zone)) || zone.area.contains(middle(other));
    zones.any(|other| is_one(&other.kind) && shares(other))
}

/// The middle of the corners of a zone.
fn middle(zone: &Zone) -> Point {
    let corners = zone.area.corners();
    let (x, y) = corners
        .iter()
        .fold((0.0, 0.0), |sum, corner| (sum.0 + corner.x, sum.1 + corner.y));
    let count = corners.len().max(1) as f64;
    Point::new(x / count, y / count)
}

/// Whether an error is about something else than being where the vehicle must not be.
fn is_other(agv: &Agv, error: &ActiveError) -> bool {
    error.error_type != agv.config.errors.blocked_zone
}

records! {
    fault "blocked-zone-entered" ["ZONE-05", "ZONE-02", "ZINT-01"] "Drives into BLOCKED zones."
        => forbidding(|_, what| match what {
            Permission::StayOut(zone) => zone.kind == ZoneKind::Blocked,
            Permission::StopInZone => true,
            _ => false,
        });
    fault "blocked-zones-unseen" ["ZONE-05", "ZONE-06", "ZONE-02", "ZINT-01"] "Takes no notice of BLOCKED zones."
        => forbidding(|_, what| matches!(what, Permission::HeedZone(zone) if zone.kind == ZoneKind::Blocked));
    fault "blocked-zone-by-centre" ["ZONE-03", "ZONE-05"] "Counts as outside a BLOCKED zone until its kinematic centre is inside."
        => forbidding(|_, what| matches!(what, Permission::GoByContour(zone) if zone.kind == ZoneKind::Blocked));
    fault "blocked-zone-left-driving" ["ZONE-06"] "Drives on in a BLOCKED zone that is enabled where it is."
        => forbidding(|_, what| matches!(what, Permission::StopInZone));
    fault "blocked-zone-silent" ["ZONE-06"] "Stops in a BLOCKED zone, and reports no error."
        => raising(|agv, _, error| is_other(agv, error));
    fault "blocked-zone-warning" ["ZONE-06"] "Reports a WARNING when it is inside a BLOCKED zone."
        => error(|agv, error, words| if !is_other(agv, error) {
            words.set("errorLevel", "WARNING");
        });
    fault "blocked-zone-unnamed" ["ZONE-06"] "Does not say in which BLOCKED zone it is."
        => raising(|agv, _, error| {
            if !is_other(agv, error) {
                error.references.clear();
            }
            true
        });
    fault "blocked-zone-error-brief" ["ZONE-06"] "Takes the error of a BLOCKED zone back while it is still inside."
        => raising(|agv, _, error| {
            if !is_other(agv, error) {
                error.life = Life::Until(agv.moment() + brief(agv));
            }
            true
        });
    fault "blocked-zone-error-stays" ["ZONE-06"] "Never takes the error of a BLOCKED zone back."
        => raising(|agv, _, error| {
            if !is_other(agv, error) {
                error.life = Life::Always;
            }
            true
        });
    fault "disabled-zone-set-enforced" ["ZSET-12"] "Heeds the zones of sets that are not enabled."
        => letting(|_, what| matches!(what, Permission::ApplyZoneSet(_)));
    fault "zone-set-applies-to-new-orders" ["ZSET-12", "ZONE-06", "ZERR-01"] "Heeds a zone set only from the next order on after it was enabled."
        => keep::<Vec<String>>()
            .allows(|known, _, what, usual| match what {
                Permission::ApplyZoneSet(set) => usual && known.contains(&set.id),
                _ => usual,
            })
            .happens(|known, agv, event| if event == Event::Begun {
                *known = agv.zone_sets.all.iter().filter(|set| set.enabled).map(|set| set.id.clone()).collect();
            });

    fault "zone-speed-ignored" ["ZONE-17", "ZINT-04", "ZINT-08"] "Takes no notice of SPEED_LIMIT zones."
        => forbidding(|_, what| matches!(what, Permission::HeedZone(zone) if matches!(zone.kind, ZoneKind::SpeedLimit(_))));
    fault "zone-speed-by-centre" ["ZINT-08", "ZONE-03", "ZONE-17"] "Keeps the speed of a SPEED_LIMIT zone only while its kinematic centre is inside."
        => forbidding(|_, what| matches!(what, Permission::GoByContour(zone) if matches!(zone.kind, ZoneKind::SpeedLimit(_))));
    fault "highest-zone-speed-taken" ["ZINT-04", "ZONE-17"] "Of overlapping SPEED_LIMIT zones it keeps the highest speed."
        => forbidding(|agv, what| match what {
            Permission::HeedZone(zone) => match zone.kind {
                ZoneKind::SpeedLimit(speed) => agv.zone_sets.all.iter().filter(|set| set.enabled).any(|set| set.zones.iter().any(|other| {
                    matches!(other.kind, ZoneKind::SpeedLimit(higher) if higher > speed) && other.area.touches(&zone.area)
                })),
                _ => false,
            },
            _ => false,
        });

    fault "last-zone-speed-taken" ["ZINT-04", "ZONE-17"] "Of overlapping SPEED_LIMIT zones it keeps the speed of the one that comes last in the zone set."
        => forbidding(|agv, what| match what {
            Permission::HeedZone(zone) if matches!(zone.kind, ZoneKind::SpeedLimit(_)) => {
                let inside = |other: &Zone| agv.heeding.inside.iter().any(|(_, there)| there == other);
                agv.zone_sets.all.iter().filter(|set| set.enabled).any(|set| {
                    let behind = set.zones.iter().skip_while(|other| *other != zone).skip(1);
                    behind.into_iter().any(|other| matches!(other.kind, ZoneKind::SpeedLimit(_)) && inside(other))
                })
            }
            _ => false,
        });
    fault "released-node-opens-blocked-zone" ["ZONE-02", "ZONE-05", "ZINT-01"] "Takes no notice of a BLOCKED zone in which a released node of its order lies."
        => forbidding(|agv, what| match what {
            Permission::HeedZone(zone) if zone.kind == ZoneKind::Blocked => {
                let ahead = agv.order.nodes.iter().filter(|stop| stop.node.released);
                let mut stops = ahead.chain(&agv.order.left.0);
                stops.any(|stop| zone.area.contains(Point::new(stop.place.x, stop.place.y)))
            }
            _ => false,
        });

    fault "zone-actions-left-out" ["ZONE-18", "ZACT-STATE-02", "ZINT-05"] "Does nothing of what ACTION zones ask for."
        => forbidding(|_, what| matches!(what, Permission::ActInZone(..)));
    fault "zone-exit-actions-left-out" ["ZONE-18"] "Does not do what an ACTION zone asks for at its exit."
        => forbidding(|_, what| matches!(what, Permission::ActInZone(_, Passage::Exit)));
    fault "zone-entry-actions-left-out" ["ZONE-18"] "Does not do what an ACTION zone asks for at its entry."
        => forbidding(|_, what| matches!(what, Permission::ActInZone(_, Passage::Entry)));
    fault "zone-actions-inside-left-out" ["ZONE-18"] "Does not do what an ACTION zone asks for while it is inside."
        => forbidding(|_, what| matches!(what, Permission::ActInZone(_, Passage::During)));
    fault "zone-exit-actions-on-entry" ["ZONE-18"] "Does everything that an ACTION zone asks for when it goes in, also what is meant for its exit." because "The observation of ZONE-18 makes a wrong moment a warning."
        => when(Event::ZoneSetStored, |agv| {
            for zone in agv.zone_sets.all.last_mut().into_iter().flat_map(|set| &mut set.zones) {
                if let ZoneKind::Action { entry, during, exit } = &mut zone.kind {
                    entry.append(during);
                    entry.append(exit);
                }
            }
        });
    fault "only-one-action-zone-heeded" ["ZINT-05"] "Of overlapping ACTION zones it does what one of them asks for."
        => forbidding(|agv, what| match what {
            Permission::ActInZone(zone, _) => agv.heeding.inside.iter().any(|(_, other)| {
                matches!(other.kind, ZoneKind::Action { .. }) && other.id < zone.id && other.area.touches(&zone.area)
            }),
            _ => false,
        });
    fault "zone-actions-among-those-of-the-order" ["IACT-STATE-03", "ZACT-STATE-02"] "Lists actions of zones in actionStates as well."
        => state(|_, words| {
            let of_zones = words.get("zoneActionStates").and_then(Value::as_array).cloned().unwrap_or_default();
            words.change("actionStates", |all| if let Value::Array(all) = all {
                all.extend(of_zones);
            });
        });
    fault "zone-actions-in-the-list-of-the-order" ["IACT-STATE-03", "ZACT-STATE-02"] "Lists actions of zones in actionStates, and leaves their own list empty."
        => state(|_, words| {
            let of_zones = words.get("zoneActionStates").and_then(Value::as_array).cloned().unwrap_or_default();
            if !of_zones.is_empty() {
                words.set("zoneActionStates", json!([]));
            }
            words.change("actionStates", |all| if let Value::Array(all) = all {
                all.extend(of_zones);
            });
        });
    fault "zone-action-ids-repeated" ["ZACT-STATE-03"] "Gives an action of a zone the same actionId each time."
        => action(|_, action, words| {
            if action.of_zone() {
                words.set("actionId", format!("zone-{}", action.request.action_type));
            }
            true
        });
    fault "zone-action-without-type" ["ZACT-STATE-03"] "Does not say of which type an action of a zone is." because "The ruling of ZACT-STATE-03 is a warning."
        => action(|_, action, words| {
            if action.of_zone() {
                words.remove("actionType");
            }
            true
        });
    fault "zone-actions-not-listed" ["ZACT-STATE-01", "ZACT-STATE-02"] "Has no list of the actions of zones."
        => state(|_, words| {
            words.remove("zoneActionStates");
        });
    fault "empty-zone-requests-left-out" ["STATE-MSG-22"] "It leaves zoneRequests out where it asks for no zone."
        => state(|_, words| if words.list("zoneRequests").is_empty() {
            words.remove("zoneRequests");
        });
    fault "zone-actions-forgotten-with-the-order" ["ZACT-STATE-04"] "Forgets the actions of zones that have ended when it takes over a new order."
        => when(Event::Begun, |agv| agv.actions.retain(|action| !action.of_zone() || !action.status.is_terminal()));
    fault "zone-actions-forgotten-when-done" ["ZACT-STATE-04", "ZACT-STATE-02"] "Does not list an action of a zone any more once it has ended."
        => action(|_, action, _| !action.of_zone() || !action.status.is_terminal());
    fault "clear-zone-actions-without-effect" ["ZACT-STATE-05"] "Reports clearZoneActions FINISHED and removes nothing."
        => instead(Effect::ClearZoneActions, |_, _| Some(Outcome::Done(None)));
    fault "clear-zone-actions-takes-running" ["ZACT-STATE-05"] "Removes actions of zones that have not ended as well." because "Such an action may have ended meanwhile."
        => succeeded(Effect::ClearZoneActions, |agv, _| agv.actions.retain(|action| !action.of_zone()));
    fault "clear-instant-actions-takes-those-of-zones" ["ZACT-STATE-04"] "On clearInstantActions it removes actions of zones, too."
        => succeeded(Effect::ClearInstantActions, |agv, _| agv.actions.retain(|action| !action.of_zone()));
    fault "zone-action-occupies" ["ORD-17"] "Counts as busy while an action of a zone runs."
        => letting(|agv, what| {
            let open = |action: &Action| action.of_zone() && !action.status.is_terminal();
            matches!(what, Permission::BeBusy) && agv.actions.iter().any(open)
        });

    fault "directed-zones-ignored" ["ZONE-21"] "Takes no notice of DIRECTED zones."
        => forbidding(|_, what| matches!(what, Permission::HeedZone(zone) if matches!(zone.kind, ZoneKind::Directed(..))));
    fault "bidirected-zones-ignored" ["ZONE-23"] "Takes no notice of BIDIRECTED zones."
        => forbidding(|_, what| matches!(what, Permission::HeedZone(zone) if matches!(zone.kind, ZoneKind::Bidirected(..))));
    fault "directed-zones-by-contour" ["ZONE-04"] "Counts as inside a DIRECTED or BIDIRECTED zone as soon as a part of its outline is."
        => letting(|_, what| matches!(what, Permission::GoByContour(zone) if matches!(zone.kind, ZoneKind::Directed(..) | ZoneKind::Bidirected(..))));
    fault "soft-directions-ignored" ["ZONE-22"] "A freely navigating vehicle takes no notice of directions that are SOFT." because "A recommendation, and what other way there is the vehicle judges itself."
        => forbidding(|_, what| matches!(what, Permission::HeedZone(zone) if matches!(zone.kind, ZoneKind::Directed(_, Limitation::Soft) | ZoneKind::Bidirected(_, Limitation::Soft))));
    fault "priority-zones-ignored" ["ZONE-19"] "A freely navigating vehicle takes no notice of PRIORITY zones." because "The ruling of ZONE-19 leaves the weights to the vehicle."
        => forbidding(|_, what| matches!(what, Permission::HeedZone(zone) if matches!(zone.kind, ZoneKind::Priority(_))));
    fault "penalty-zones-ignored" ["ZONE-20", "ZONE-19"] "A freely navigating vehicle takes no notice of PENALTY zones." because "The rulings of ZONE-19 and ZONE-20 are warnings."
        => forbidding(|_, what| matches!(what, Permission::HeedZone(zone) if matches!(zone.kind, ZoneKind::Penalty(_))));
    fault "priority-and-penalty-mixed-up" ["ZONE-19"] "A freely navigating vehicle goes round PRIORITY zones and prefers ways through PENALTY zones that are less than closed." because "The ruling of ZONE-19 leaves the weights to the vehicle."
        => when(Event::ZoneSetStored, |agv| {
            for zone in agv.zone_sets.all.last_mut().into_iter().flat_map(|set| &mut set.zones) {
                zone.kind = match zone.kind {
                    ZoneKind::Priority(factor) => ZoneKind::Penalty(factor.min(0.9)),
                    ZoneKind::Penalty(factor) if factor < 1.0 => ZoneKind::Priority(factor),
                    _ => continue,
                };
            }
        });
    fault "penalty-of-one-closes" ["ZONE-20"] "Does not drive into a PENALTY zone with the factor 1 although no other way leads to its node." because "The ruling of ZONE-20 is a warning."
        => letting(|_, what| matches!(what, Permission::StayOut(zone) if matches!(zone.kind, ZoneKind::Penalty(factor) if factor >= 1.0)));
    fault "highest-priority-counts" ["ZINT-06"] "Of overlapping PRIORITY zones the one with the highest factor counts." because "The ruling of ZINT-06 makes it a matter of the planner."
        => forbidding(|agv, what| match what {
            Permission::HeedZone(zone) => match zone.kind {
                ZoneKind::Priority(factor) => overlaps(agv, zone, |other| matches!(other, ZoneKind::Priority(higher) if *higher > factor)),
                _ => false,
            },
            _ => false,
        });
    fault "lowest-penalty-counts" ["ZINT-06"] "Of overlapping PENALTY zones the one with the lowest factor counts." because "The ruling of ZINT-06 makes it a matter of the planner."
        => forbidding(|agv, what| match what {
            Permission::HeedZone(zone) => match zone.kind {
                ZoneKind::Penalty(factor) => overlaps(agv, zone, |other| matches!(other, ZoneKind::Penalty(lower) if *lower < factor)),
                _ => false,
            },
            _ => false,
        });
    fault "priority-before-penalty" ["ZINT-06"] "Where a PRIORITY zone and a PENALTY zone overlap, the PRIORITY zone counts." because "The ruling of ZINT-06 makes it a matter of the planner."
        => forbidding(|agv, what| match what {
            Permission::HeedZone(zone) => matches!(zone.kind, ZoneKind::Penalty(_)) && overlaps(agv, zone, |other| matches!(other, ZoneKind::Priority(_))),
            _ => false,
        });
    fault "release-zone-before-speed" ["ZINT-09", "ZONE-17"] "Takes no notice of a SPEED_LIMIT zone where a RELEASE zone overlaps it."
        => forbidding(|agv, what| match what {
            Permission::HeedZone(zone) => matches!(zone.kind, ZoneKind::SpeedLimit(_)) && overlaps(agv, zone, |other| matches!(other, ZoneKind::Release(_))),
            _ => false,
        });
    fault "speed-before-release-zone" ["ZINT-09", "ZONE-10"] "Takes no notice of a RELEASE zone where a SPEED_LIMIT zone overlaps it."
        => forbidding(|agv, what| match what {
            Permission::HeedZone(zone) => matches!(zone.kind, ZoneKind::Release(_)) && overlaps(agv, zone, |other| matches!(other, ZoneKind::SpeedLimit(_))),
            _ => false,
        });
    fault "release-zone-before-actions" ["ZINT-09", "ZONE-18"] "Does nothing of what an ACTION zone asks for where a RELEASE zone overlaps it."
        => forbidding(|agv, what| match what {
            Permission::ActInZone(zone, _) => overlaps(agv, zone, |other| matches!(other, ZoneKind::Release(_))),
            _ => false,
        });
    fault "line-guided-zones-entered-freely" ["ZONE-08"] "Drives into LINE_GUIDED zones on edges without a trajectory."
        => forbidding(|_, what| matches!(what, Permission::StayOut(zone) if zone.kind == ZoneKind::LineGuided));
    fault "direction-before-trajectory" ["ZINT-07"] "Does not drive a trajectory that leads against the direction of a zone."
        => allowing(|_, what, usual| match what {
            Permission::StayOut(zone) => usual || matches!(zone.kind, ZoneKind::Directed(..) | ZoneKind::Bidirected(..)),
            _ => usual,
        });
    fault "line-guided-zones-cut" ["ZONE-07"] "Does not follow trajectories in LINE_GUIDED zones."
        => plain().bends(|_, agv, _, path| {
            let zones = agv.zone_sets.all.iter().filter(|set| set.enabled).flat_map(|set| &set.zones);
            let guided = zones.into_iter().any(|zone| zone.kind == ZoneKind::LineGuided);
            (!guided).then_some(path)
        });
    fault "zone-action-conflict-unseen" ["ZINT-03"] "Does what a zone asks for although that breaks the rule of a LINE_GUIDED zone."
        => forbidding(|_, what| matches!(what, Permission::SeeConflict));
    fault "zone-action-conflict-silent" ["ZINT-03"] "Stops for actions of zones that conflict, and reports no error."
        => raising(|agv, _, error| error.error_type != agv.config.errors.zone_action_conflict);

    fault "zone-action-conflict-unnamed" ["ZINT-03"] "Does not say which zone asks for what conflicts."
        => raising(|agv, _, error| {
            if error.error_type == agv.config.errors.zone_action_conflict {
                error.references.clear();
            }
            true
        });

    fault "unreachable-node-silent" ["ZERR-01"] "Stands before a zone that keeps it from its node, and says nothing."
        => raising(|agv, _, error| error.error_type != agv.config.errors.node_unreachable);
    fault "unreachable-node-unnamed" ["ZERR-01"] "Does not say which node is out of reach."
        => raising(|agv, _, error| {
            if error.error_type == agv.config.errors.node_unreachable {
                error.references.clear();
            }
            true
        });
    fault "unreachable-node-warning" ["ZERR-01"] "Reports a WARNING when a node is out of reach."
        => error(|agv, error, words| if error.error_type == agv.config.errors.node_unreachable {
            words.set("errorLevel", "WARNING");
        });
    fault "unreachable-node-error-brief" ["ZERR-01"] "Takes the error of a node out of reach back after a moment."
        => plain().happens(|_, agv, event| if event == Event::StateSent {
            let name = agv.config.errors.node_unreachable.clone();
            agv.errors.active.retain(|error| error.error_type != name);
        });
    fault "unreachable-node-error-stays" ["ZERR-01"] "Keeps the error of a node out of reach for a while when a new order is accepted."
        => keep::<Option<ActiveError>>().happens(|before, agv, event| match event {
            Event::StateSent => {
                let name = &agv.config.errors.node_unreachable;
                let lasting = |error: &&ActiveError| error.error_type == *name && error.life == Life::UntilNewOrder;
                *before = agv.errors.active.iter().find(lasting).cloned();
            }
            Event::Begun => if let Some(error) = before.take() {
                let life = Life::Until(agv.moment() + Duration::from_secs(2));
                agv.errors.raise(ActiveError { life, ..error });
            },
            _ => {}
        });
    fault "unreachable-node-tried-again" ["ZERR-02"] "Drives on to a node that was out of reach as soon as the way is free." because "A zone set that opens the way may count as an instruction."
        => letting(|_, what| matches!(what, Permission::TryAgain));
    fault "no-order-after-unreachable-node" ["ERR-07"] "Refuses every order once a node was out of reach, even when the order before was cancelled."
        => objecting(|agv, _, relation| {
            let name = &agv.config.errors.node_unreachable;
            let listed = agv.errors.active.iter().any(|error| error.error_type == *name);
            (listed && relation == Relation::New).then(|| Refusal::new(Rule::OtherOrderActive, "a node was out of reach"))
        });

    tolerance "zone-actions-planned-ahead" ["ZACT-STATE-06"] "It lists what the ACTION zone asks for that comes next on its way as WAITING before it is there."
        => state(|agv, words| {
            let planned = planned_actions(agv);
            words.change("zoneActionStates", |all| if let Value::Array(all) = all {
                all.extend(planned);
            });
        });
}

/// Its poses on the way that is left, straight from node to node.
fn poses_ahead(agv: &Agv) -> Vec<Pose> {
    let mut here = agv.motion.pose(agv.moment());
    let mut poses = Vec::new();
    for stop in agv.order.nodes.iter().filter(|stop| stop.node.released) {
        let (x, y) = (stop.place.x - here.x, stop.place.y - here.y);
        let length = x.hypot(y);
        let theta = if length > 1e-6 { y.atan2(x) } else { here.theta };
        let mut made = 0.0;
        while made < length && poses.len() < 1_000 {
            let share = made / length;
            poses.push(Pose {
                x: here.x + x * share,
                y: here.y + y * share,
                theta,
                map_id: here.map_id.clone(),
            });
            made += 0.1;
        }
        here = Pose {
            x: stop.place.x,
            y: stop.place.y,
            theta,
            map_id: stop.place.map_id.clone(),
        };
        poses.push(here.clone());
    }
    poses
}

/// The states of the actions that it will do next because of a zone, where that is certain: none where zones of other kinds
/// or several ACTION zones are in the way.
fn planned_actions(agv: &Agv) -> Vec<Value> {
    let is_on_its_way =
        !agv.order.cancelled && agv.order.cancel.is_none() && !agv.order.unreachable && agv.mode.takes_orders();
    if !is_on_its_way || !agv.config.heeds("ACTION") {
        return Vec::new();
    }
    let acts = |zone: &&Zone| matches!(zone.kind, ZoneKind::Action { .. });
    let here: Vec<&Zone> = agv.heeding.inside.iter().map(|(_, zone)| zone).filter(acts).collect();
    let mut comes: Option<Vec<&ActionRequest>> = None;
    for pose in poses_ahead(agv) {
        let there: Vec<&Zone> = agv.zones_at(&pose).into_iter().map(|(_, zone)| zone).collect();
        comes = match (here.as_slice(), there.as_slice()) {
            ([zone], []) => exit_actions(zone),
            ([], [zone]) => entry_actions(zone),
            ([], []) => continue,
            ([zone], [other]) if zone == other => continue,
            _ => None,
        };
        break;
    }
    let states = comes
        .unwrap_or_default()
        .into_iter()
        .zip(agv.heeding.actions.wrapping_add(1)..);
    let states = states.map(|(action, number)| {
        json!({ "actionId": format!("zone-action-{number}"), "actionType": action.action_type, "actionStatus": "WAITING" })
    });
    states.collect()
}

/// What an ACTION zone asks for at its exit.
fn exit_actions(zone: &Zone) -> Option<Vec<&ActionRequest>> {
    match &zone.kind {
        ZoneKind::Action { exit, .. } => Some(exit.iter().collect()),
        _ => None,
    }
}

/// What an ACTION zone asks for from its entry on.
fn entry_actions(zone: &Zone) -> Option<Vec<&ActionRequest>> {
    match &zone.kind {
        ZoneKind::Action { entry, during, exit } => Some(entry.iter().chain(during).chain(exit).collect()),
        _ => None,
    }
}
