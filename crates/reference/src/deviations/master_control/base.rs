//! Deviations of how the base of a running order is extended, and what updates hold (section 6.6.2).

use super::prelude::*;

records! {
    fault "first-vehicle-extended-only" ["MQTT-11", "ORD-UPD-02"] "Extends the base of the first vehicle of the fleet only."
        because "It breaks a recommendation only, and MQTT-11 is a design goal."
        => extends(|site, vehicle, _| site.config.vehicles.first() == Some(&vehicle.config));
    fault "base-extended-late" ["ORD-UPD-02"] "Extends the base when the vehicle has halted at its end."
        because "It breaks a recommendation only."
        => allowing(|vehicle, what, usual| match what {
            Permission::Grow(_, ahead, _) => ahead == 0 && !drives(vehicle),
            _ => usual,
        });
    fault "new-base-request-ignored" ["STATE-17", "ORD-UPD-02"] "Does not look at newBaseRequest."
        because "It breaks a recommendation only."
        => heeds(|_| false);
    fault "new-base-only-at-rest" ["STATE-17"] "It ignores newBaseRequest while the vehicle is driving."
        because "STATE-17, an answer to newBaseRequest, is described and not demanded; the base comes when the vehicle stands."
        => heeds(|vehicle| !drives(vehicle));
    fault "new-base-ignored-in-semiautomatic" ["STATE-17"] "It ignores newBaseRequest of a vehicle in SEMIAUTOMATIC."
        because "STATE-17, an answer to newBaseRequest, is described and not demanded; how traffic stands in SEMIAUTOMATIC is not known."
        => heeds(|vehicle| mode(vehicle) != "SEMIAUTOMATIC");
    fault "new-base-answered-once" ["STATE-17"] "It answers the first newBaseRequest of a vehicle and ignores every later one."
        because "STATE-17, an answer to newBaseRequest, is described and not demanded; traffic may forbid the second one."
        => keep::<bool>().happens(|answered, _, _, event| if let Event::Updated(_, asked) = event { *answered |= *asked; }).allows(|answered, _, _, what, usual| usual && !(*answered && matches!(what, Permission::Heed)));
    fault "new-base-request-heard-once" ["STATE-17", "ORD-UPD-02"] "It answers only the first newBaseRequest of an order and waits for the decision point afterwards."
        => keep::<bool>().happens(|answered, _, _, event| match event {
            Event::Updated(_, asked) => *answered |= *asked,
            Event::Begun => *answered = false,
            _ => {}
        }).allows(|answered, _, vehicle, what, usual| match what {
            Permission::Heed => usual && !*answered,
            Permission::Grow(_, ahead, _) if *answered => ahead == 0 && !drives(vehicle),
            _ => usual,
        });
    fault "new-base-answered-by-horizon" ["STATE-17"] "It answers newBaseRequest by an update that releases nothing new."
        because "STATE-17, an answer to newBaseRequest, is described and not demanded; an update without base may say that traffic does not permit one."
        => keep::<bool>().happens(|answered, _, vehicle, event| match event {
            Event::Extending(running) if asks(vehicle) && !*answered && !running.is_whole() => {
                *answered = true;
                running.changed = true;
            }
            Event::Begun => *answered = false,
            _ => {}
        }).allows(|_, _, _, what, usual| match what {
            Permission::Grow(_, _, asked) => usual && !asked,
            _ => usual,
        });
    fault "edge-ahead-released-when-asked" ["ORD-08"] "In an update that the vehicle asks for by newBaseRequest it also releases the first edge of the horizon."
        => keep::<bool>().happens(|asked, _, vehicle, event| if let Event::Extending(_) = event { *asked = asks(vehicle); }).words(|asked, _, _, worded, m| worded.edges(m, |index, _, edge| if *asked && worded.is_update() && index + 1 == worded.window.released {
            edge.set("released", true);
        }));
    fault "base-sent-again" ["ORD-UPD-03", "ORD-UPD-05"] "Sends the whole order with every update."
        => showing(|_, _, window, _| window.first = 0);
    fault "base-sent-again-after-pause" ["ORD-UPD-05", "ORD-UPD-03"]
        "After the vehicle was paused it begins the updates of the order with the first node of the order."
        => keep::<bool>().happens(paused_with_it).shows(|paused, _, _, _, window, _| if *paused { window.first = 0; });
    fault "no-base-after-pause" ["STATE-17", "ORD-UPD-02"] "It sends no further base for the order after the vehicle was paused and has been resumed."
        because "ORD-UPD-02 asks for a base early enough where traffic permits, and is a recommendation."
        => keep::<bool>().happens(paused_with_it).allows(|paused, _, _, what, usual| usual && !(*paused && matches!(what, Permission::Extend(_))));
    fault "resume-repeats-base" ["ORD-UPD-05", "ORD-UPD-03"] "It sends the order once more from its first node, with the next orderUpdateId, when a pause ends."
        => keep::<bool>().happens(|resumed, _, vehicle, event| match event {
            Event::State(Some(before)) if before.is_paused() && !vehicle.is_paused() => {
                if let Some(running) = vehicle.running.as_mut().filter(|running| running.accepted) {
                    running.changed = true;
                    *resumed = true;
                }
            }
            Event::Begun | Event::Updated(..) => *resumed = false,
            _ => {}
        }).shows(|resumed, _, _, _, window, _| if *resumed { window.first = 0; });
    fault "update-from-vehicle" ["ORD-UPD-05", "ORD-UPD-03"] "Order updates begin with the node the vehicle has reached last and repeat the base from there."
        => showing(|vehicle, running, window, _| if running.released > 0 { window.first = running.reached(vehicle.state.as_ref()).min(running.released - 1); });
    fault "update-begins-one-node-early" ["ORD-UPD-05", "ORD-UPD-03"] "It begins an update with the last but one node of the base sent before."
        => showing(|_, running, window, _| if running.released > 0 { window.first = running.released.saturating_sub(2); });
    fault "loop-stitched-at-first-pass" ["ORD-UPD-05", "ORD-UPD-03"] "Looks the stitching node up by its nodeId, and begins where the way passed it first."
        => showing(|_, running, window, _| {
            let node = running.stops.get(window.first).map(|stop| &stop.id);
            let first = running.stops.iter().position(|stop| Some(&stop.id) == node);
            window.first = first.unwrap_or(window.first);
        });
    fault "second-update-repeats" ["ORD-UPD-04"] "Gives every update the number of the first one."
        => update_id(|running| running.update_id - u32::from(running.update_id > 1));
    fault "update-id-stops-at-ten" ["ORD-UPD-04"] "Compares orderUpdateIds as texts, so that 10 comes behind 9 for ever."
        => update_id(|running| running.update_id - u32::from(running.update_id == 11));
    fault "update-id-kept-on-reroute" ["ORD-UPD-04"] "The order update of a change of destination has the orderUpdateId of the message before."
        => update_id(|running| running.update_id - u32::from(running.changed));
    fault "update-id-kept-after-resend" ["ORD-UPD-04"] "It does not raise the orderUpdateId of an update that follows a message which it had to send again."
        => update_id(|running| running.update_id - u32::from(running.resends > 0));
    fault "update-id-raised-only-with-base" ["ORD-UPD-04"] "It leaves the orderUpdateId as it is when only the horizon changes."
        => keep::<bool>().shows(|grows, _, _, running, window, _| *grows = window.released > running.released)
            .happens(|grows, _, _, event| if let Event::Updating(running) = event && running.changed && !*grows { running.update_id -= 1; });
    fault "counts-updates-from-the-reported-state" ["ORD-UPD-04"]
        "It takes as next orderUpdateId the reported one plus one, so that two updates in quick succession carry the same id with different content."
        => plain().happens(|(), _, vehicle, event| if let Event::Updating(running) = event {
            let state = vehicle.state.as_ref().filter(|state| state.order_id == running.id);
            running.update_id = state.map_or(0, |state| state.order_update_id).saturating_add(1);
        }).judges(|(), _, _, running, _, fate| {
            // It does not wait until the update before is seen.
            running.confirmed |= running.changed && !running.refused && fate == Fate::Runs;
            fate
        });
    fault "refused-update-extended" ["ORD-UPD-05"] "Goes on from the end of an update that was refused."
        because "No sentence forbids to extend an order behind a refused update."
        => judging(|_, running, _, fate| if fate == Fate::CalledOff && running.refused {
            (running.refused, running.confirmed) = (false, true);
            Fate::Runs
        } else { fate });
    fault "e-stop-withdraws-base" ["ORD-UPD-03", "ORD-UPD-05", "ORD-CANCEL-01"]
        "It takes the rest of the base back by an update that begins where the vehicle is when the vehicle reports an emergency stop during an order."
        => withdraws(|state| !matches!(state.safety_state.e_stop.as_str(), "NONE" | ""));
    fault "takes-the-base-back-in-pause" ["ORD-UPD-03"]
        "It sends an update that takes released nodes ahead of the vehicle back into the horizon, while the vehicle is paused."
        => withdraws(State::is_paused);
    fault "warning-holds-base" ["ORD-UPD-02", "STATE-17"] "It does not extend the base as long as the vehicle reports a warning."
        because "STATE-17 depends on the traffic; a master control may be cautious with a vehicle that warns."
        => extends(|_, vehicle, _| {
            let mut errors = vehicle.state.iter().flat_map(|state| &state.errors);
            !errors.any(|error| error.error_level == "WARNING")
        });
    tolerance "no-update-while-paused" ["STATE-17", "ORD-UPD-02"] "It sends no further base as long as the vehicle is paused."
        => extends(|_, vehicle, _| !vehicle.is_paused());
    fault "base-planned-every-half-minute" ["ORD-UPD-02", "STATE-17"] "It extends the base no sooner than half a minute after its last order message."
        because "ORD-UPD-02 recommends a base early enough; a planner that is slow makes the vehicle halt, and breaks nothing."
        => plain().allows(|(), site, vehicle, what, usual| {
            let due = vehicle.last_order_at.map(|last| last + Duration::from_secs(30));
            usual && !(matches!(what, Permission::Extend(_)) && due.is_some_and(|due| due > site.now.moment))
        }).happens(|(), site, vehicle, event| if let Event::Looked = event && vehicle.running.is_some() {
            let due = vehicle.last_order_at.map(|last| last + Duration::from_secs(30));
            due.filter(|due| *due > site.now.moment).into_iter().for_each(|due| vehicle.at(due));
        });
    fault "goal-released-on-arrival" ["ORD-UPD-02"] "It releases the last node of a transport only when the vehicle has halted at the end of the base before it."
        because "ORD-UPD-02 recommends a base early enough; a goal that is guarded makes the vehicle halt, and breaks nothing."
        => measuring(|vehicle, what, usual| match what {
            Measure::Base(running, _, asked) => {
                let ahead = running.released.saturating_sub(running.reached(vehicle.state.as_ref()) + 1);
                let halts = !drives(vehicle) && ahead == 0;
                let early = usual == running.stops.len() && usual > running.released && !halts && !asked;
                usual - usize::from(early)
            }
            _ => usual,
        });
    fault "sequence-continues-over-orders" ["ORD-UPD-11"] "A second order continues the sequenceIds of the order before instead of beginning at 0."
        => renumbered(false);
    fault "sequence-continues-after-cancel" ["ORD-UPD-11"] "It continues the sequenceIds of a cancelled order in the new order that follows it."
        => renumbered(true);
    fault "sequence-gap-after-reroute" ["ORD-UPD-11", "ORD-UPD-12"]
        "After a change of destination the sequenceIds of the horizon given up are skipped, so that there is a gap."
        => renumbered_with_gaps();
    fault "queued-update-after-cancel" ["ORD-CANCEL-01", "IACT-02"] "It sends an update that waited for minOrderInterval after the cancelOrder that came in between."
        => keep::<(Option<Value>, Option<Value>)>().happens(|(waiting, late), site, vehicle, event| match event {
            Event::Waits(running, target, free) => {
                let released = (*target).max(running.released);
                let end = (*free).min(released.saturating_add(site.config.horizon_length));
                let window = Window { first: running.released.saturating_sub(1), released, end };
                let mut next = running.clone();
                next.update_id += 1;
                *waiting = site.order_message(vehicle, &next, window).map(|(message, _)| message);
            }
            Event::CalledOff => *late = waiting.take(),
            Event::Begun | Event::Updated(..) => *waiting = None,
            Event::Looked if late.is_some() && site.commandable(vehicle) => {
                // What was called off is sent before what had to wait.
                if vehicle.instants.iter().any(|instant| instant.sent_at.is_none()) {
                    vehicle.at(site.now.moment);
                } else if let Some(due) = site.next_order_at(vehicle, Occasion::Again) {
                    vehicle.at(due);
                } else if let Some(message) = late.take() {
                    vehicle.last_order_at = Some(site.now.moment);
                    site.publish(vehicle, "order", &message);
                }
            }
            _ => {}
        });
    tolerance "base-grows-eagerly" ["ORD-UPD-02"] "It extends the base by a node as soon as the message before was accepted, long before the vehicle needs it."
        => letting(|_, _, what| matches!(what, Permission::Grow(running, ..) if !running.is_whole())).measures(|_, _, _, what, usual| match what {
            Measure::Base(running, free, _) => usual.max(running.released + 1).min(free),
            _ => usual,
        });
    tolerance "updates-without-horizon" ["ORD-UPD-03", "ORD-09"] "Order updates hold the new base only and delete the horizon."
        => showing(|_, running, window, _| if running.released > 0 && window.released > running.released { window.end = window.released; });
    tolerance "horizon-swapped-or-deleted" ["ORD-UPD-03", "ORD-UPD-04"]
        "Each update deletes the horizon or shows another way to the goal there, and the next one goes on by the way of the order."
        => plain().words(|(), site, vehicle, worded, m| {
            let window = worded.window;
            if !worded.is_update() || window.end <= window.released { return; }
            if worded.running.update_id % 2 == 1 {
                for list in ["nodes", "edges"] { m.keep(list, |element| element.says("released", true)); }
                return;
            }
            let Some(other) = other_horizon(site, vehicle, worded) else { return };
            let end = window.end.min(other.stops.len());
            if let Some((mut message, _)) = site.order_message(vehicle, &other, Window { end, ..window }) {
                for list in ["nodes", "edges"] { m.set(list, message[list].take()); }
            }
        });
    tolerance "horizon-sent-again" ["ORD-UPD-03", "ORD-UPD-05"] "Once in an order it sends an order update that extends nothing and gives the same horizon again."
        => keep::<bool>().happens(|sent, _, _, event| match event {
            Event::Extending(running) if !*sent && !running.is_whole() => {
                *sent = true;
                running.changed = true;
            }
            Event::Begun => *sent = false,
            _ => {}
        });
    tolerance "horizon-deleted-first" ["ORD-UPD-03", "ORD-UPD-04"]
        "It deletes the horizon by one update and sends the new one by a second, when the destination is changed."
        => keep::<bool>().happens(|due, _, _, event| match event {
            Event::Led(_) => *due = true,
            Event::Updated(running, _) => running.changed |= std::mem::take(due),
            Event::Begun => *due = false,
            _ => {}
        }).allows(without_horizon).shows(ends_with_base);
    tolerance "horizon-deleted-on-pause" ["ORD-UPD-03", "ORD-UPD-02"]
        "It deletes the horizon by an update when the operator pauses a vehicle and sends it again after the resume."
        => keep::<bool>().happens(|short, _, vehicle, event| match event {
            Event::Extending(running) => {
                let now = vehicle.is_paused() && !running.is_whole();
                running.changed |= now != std::mem::replace(short, now);
            }
            Event::Begun => *short = false,
            _ => {}
        }).allows(without_horizon).shows(ends_with_base);
    tolerance "horizon-withdrawn-and-given-again" ["ORD-UPD-12", "ORD-UPD-03"]
        "It takes the horizon back by an update with the stitching node only and gives it again by the next update."
        => keep::<(bool, bool)>().happens(|(due, done), _, vehicle, event| match event {
            Event::Extending(running) => {
                let ahead = running.released.saturating_sub(running.reached(vehicle.state.as_ref()) + 1);
                // With more seconds between two orders it would come back too late.
                let quick = vehicle.factsheet.as_ref().is_none_or(|sheet| sheet.order_interval <= 1.0);
                let mut nodes = running.message["nodes"].as_array().into_iter().flatten();
                let shown = nodes.any(|node| node["released"] == false);
                if quick && shown && !*done && !running.changed && ahead > 1 && !asks(vehicle) { (*due, *done, running.changed) = (true, true, true); }
            }
            Event::Updated(running, _) => running.changed |= std::mem::take(due),
            Event::Begun => (*due, *done) = (false, false),
            _ => {}
        }).allows(|(due, _), site, vehicle, what, usual| without_horizon(due, site, vehicle, what, usual))
        .shows(|(due, _), site, vehicle, running, window, free| ends_with_base(due, site, vehicle, running, window, free));
}

fn drives(vehicle: &Vehicle) -> bool {
    vehicle.state.as_ref().is_some_and(|state| state.driving)
}

/// Whether the vehicle asks for a new base.
fn asks(vehicle: &Vehicle) -> bool {
    vehicle
        .state
        .as_ref()
        .is_some_and(|state| state.new_base_request == Some(true))
}

/// Extends the base only then.
fn extends(when: fn(&Site, &Vehicle, &Running) -> bool) -> Box<dyn Deviation> {
    holding(when).allows(|when, site, vehicle, what, usual| {
        usual && !matches!(what, Permission::Extend(running) if !when(site, vehicle, running))
    })
}

/// Heeds newBaseRequest only then.
fn heeds(when: fn(&Vehicle) -> bool) -> Box<dyn Deviation> {
    holding(when).allows(|when, _, vehicle, what, usual| usual && (!matches!(what, Permission::Heed) || when(vehicle)))
}

/// Gives updates another number.
fn update_id(number: fn(&Running) -> u32) -> Box<dyn Deviation> {
    holding(number).happens(|number, _, _, event| {
        if let Event::Updating(running) = event {
            running.update_id = number(running);
        }
    })
}

/// Takes the base back once in an order, while the state shows something.
fn withdraws(when: fn(&State) -> bool) -> Box<dyn Deviation> {
    each((when, false))
        .happens(|(when, withdrawn), _, vehicle, event| match event {
            Event::Extending(running) if vehicle.state.as_ref().is_some_and(&*when) => {
                let reached = running.reached(vehicle.state.as_ref());
                if running.released > reached + 1 && !std::mem::replace(withdrawn, true) {
                    running.released = reached + 1;
                    running.changed = true;
                }
            }
            Event::Begun => *withdrawn = false,
            _ => {}
        })
        .allows(|(when, _), _, vehicle, what, usual| {
            usual && !(matches!(what, Permission::Grow(..)) && vehicle.state.as_ref().is_some_and(when))
        })
}

/// Remembers that the vehicle was paused with its order.
fn paused_with_it(paused: &mut bool, _: &mut Site, vehicle: &mut Vehicle, event: &mut Event<'_>) {
    match event {
        Event::Looked => {
            *paused |= vehicle.is_paused() && vehicle.running.as_ref().is_some_and(|running| running.accepted)
        }
        Event::Begun => *paused = false,
        _ => {}
    }
}

/// The order as if its horizon led to the goal by another way.
fn other_horizon(site: &Site, vehicle: &Vehicle, worded: &Worded<'_>) -> Option<Running> {
    let released = worded.window.released;
    let mut other = worded.running.clone();
    let (here, next) = (
        other.stops.get(released - 1)?.id.clone(),
        other.stops.get(released)?.id.clone(),
    );
    let goal = other.stops.last()?.id.clone();
    let mut closed = vehicle.blocked.clone();
    closed.insert((here.clone(), next));
    let way = site.config.way(&here, &goal, &closed)?;
    other.stops.truncate(released);
    other.legs.truncate(released - 1);
    for edge in way {
        other.legs.push(Leg::from(edge));
        other.stops.push(Stop::from(site.config.node(&edge.to)?));
    }
    Some(other)
}

fn without_horizon(due: &bool, _: &Site, _: &Vehicle, what: Permission<'_>, usual: bool) -> bool {
    usual && !(*due && matches!(what, Permission::Grow(..)))
}

fn ends_with_base(due: &mut bool, _: &mut Site, _: &mut Vehicle, running: &Running, window: &mut Window, _: usize) {
    if *due && running.released > 0 {
        window.end = window.released;
    }
}

/// What is remembered of the numbers of nodes and edges.
#[derive(Clone, Default)]
struct Numbers {
    /// Of the first node of the running order.
    offset: usize,
    /// Of the first node of the next.
    next: usize,
    /// From which place on numbers are skipped, and how many.
    gap: Option<(usize, usize)>,
    /// Nodes of the way, as the messages showed it last.
    shown: usize,
}

/// Numbers nodes and edges on over orders (all of them, or those called off).
fn renumbered(called_off_only: bool) -> Box<dyn Deviation> {
    numbering(called_off_only, false)
}

/// Leaves a gap in the numbers behind a base that was led on.
fn renumbered_with_gaps() -> Box<dyn Deviation> {
    numbering(true, true)
}

fn numbering(called_off_only: bool, gaps: bool) -> Box<dyn Deviation> {
    each((called_off_only, gaps, Numbers::default()))
        .happens(|(called_off_only, gaps, numbers), _, vehicle, event| match event {
            Event::Planned(running) => {
                numbers.offset = if *gaps { 0 } else { numbers.next };
                numbers.gap = None;
                numbers.shown = running.stops.len();
            }
            Event::Begun if !*called_off_only => {
                numbers.next += 2 * vehicle.running.as_ref().map_or(0, |running| running.stops.len());
            }
            Event::Begun => numbers.next = 0,
            Event::Ended(order, true) if *called_off_only => numbers.next = numbers.offset + 2 * order.stops.len(),
            Event::Led(running) => {
                let skipped = 2 * numbers.shown.saturating_sub(running.released);
                if *gaps && numbers.gap.is_none() {
                    numbers.gap = Some((2 * running.released, skipped));
                }
                numbers.shown = running.stops.len();
            }
            _ => {}
        })
        .words(|(.., numbers), _, _, _, message| {
            each_element(message, |element| {
                element.change("sequenceId", |id| {
                    let place = id.as_u64().and_then(|id| usize::try_from(id).ok()).unwrap_or_default();
                    let gap = numbers.gap.filter(|(from, _)| place + 1 >= *from);
                    *id = json!(numbers.offset + place + gap.map_or(0, |(_, skipped)| skipped));
                });
            });
        })
        // It reads its own numbers back.
        .hears(|(.., numbers), _, vehicle, heard| {
            let running = vehicle.running.as_ref();
            let own = running.is_some_and(|running| heard.message["orderId"] == running.id);
            if own
                && heard.name == "state"
                && let Some(state) = heard.message.as_object_mut()
            {
                let back = |id: &mut Value| {
                    let place = id.as_u64().and_then(|id| usize::try_from(id).ok()).unwrap_or_default();
                    let place = place.saturating_sub(numbers.offset);
                    let gap = numbers.gap.filter(|(from, skipped)| place >= from + skipped);
                    *id = json!(place - gap.map_or(0, |(_, skipped)| skipped));
                };
                state.change("lastNodeSequenceId", back);
                for list in ["nodeStates", "edgeStates"] {
                    state.each(list, |element| element.change("sequenceId", back));
                }
            }
            true
        })
}
