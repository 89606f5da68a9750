//! Deviations of when a state is sent: events that are not told, states that come again (section 6.10, STATE-02 to STATE-11).

use crate::agv::report::{Changes, Telling};

use super::prelude::*;

records! {
    fault "states-by-clock" ["STATE-09", "STATE-03", "STATE-06", "STATE-08"] "Sends states by the clock only, whatever happens."
        => untold(|_, _, requested| !requested, Telling::Later);
    fault "order-without-state" ["STATE-03"] "Does not send a state when an order arrives."
        => untold(|_, changes, _| changes.order, Telling::Later);
    fault "load-without-state" ["STATE-04", "ACT-28", "ACT-01"] "Does not send a state when its load changes."
        => untold(|_, changes, _| changes.load, Telling::Later);
    fault "error-without-state" ["STATE-05"] "Does not send a state when an error appears."
        => untold(|_, changes, _| changes.error, Telling::Later);
    fault "mode-without-state" ["STATE-07"] "Does not send a state when its operating mode changes."
        => untold(|_, changes, _| changes.mode, Telling::Later);
    fault "maps-without-state" ["STATE-10"] "Does not send a state when its maps change."
        => untold(|_, changes, _| changes.maps, Telling::Later);
    fault "zone-sets-without-state" ["STATE-23"] "Does not send a state when its zone sets change."
        => untold(|_, changes, _| changes.zone_sets, Telling::Later);
    fault "requests-without-state" ["STATE-21"] "Does not send a state when what it has asked for is answered."
        => untold(|agv, changes, _| changes.requests && asks_already(agv), Telling::Later);
    fault "requests-told-with-other-changes" ["STATE-21", "REQ-06"] "It sends no state of its own for a new request or for what becomes of one, and shows it in the next state."
        => plain().tells(|(), _, changes, requested| {
            let alone = changes.requests && Changes { requests: false, ..changes } == Changes::default();
            match alone && !requested {
                true => Telling::Never,
                false => Telling::Now,
            }
        });
    fault "node-without-state" ["STATE-06"] "Does not send a state when it drives over a node."
        => untold(|_, changes, _| changes.node && !changes.order, Telling::Never);
    fault "driving-without-state" ["STATE-08"] "Does not send a state when it starts or stops."
        => untold(|_, changes, _| changes.driving && !changes.order, Telling::Never);
    fault "actions-without-state" ["STATE-09"] "Does not send a state when an action proceeds."
        => untold(|_, changes, _| changes.actions && !changes.node && !changes.order, Telling::Never);
    fault "update-without-state" ["STATE-03"] "Does not send a state when an order update arrives."
        => seldom(keep::<bool>())
            .happens(|updated, _, event| *updated = match event {
                Event::Updated => true,
                Event::StateSent => false,
                _ => *updated,
            })
            .tells(|updated, agv, _, _| match std::mem::take(updated) {
                true => {
                    agv.report.order_received = false;
                    Telling::Never
                }
                false => Telling::Now,
            });
    fault "no-state-on-plain-nodes" ["STATE-06", "STATE-09"] "It sends no state when it passes a node that has no actions."
        => plain().tells(|(), agv, changes, _| {
            let plain = agv.order.left.0.as_ref().is_some_and(|stop| stop.node.actions.is_empty());
            match changes.node && plain && !changes.driving && !changes.actions && !changes.order {
                true => Telling::Never,
                false => Telling::Now,
            }
        });
    fault "state-bursts" ["STATE-11"] "Sends every state five times." because "It breaks a recommendation only."
        => again(4);
    fault "reconnect-replays-buffered-states" ["FACT-14", "STATE-11"] "It sends all states that it has stored during a link loss in one burst after the reconnect."
        => keep::<Vec<(String, Object)>>().happens(|buffered, agv, event| match event {
            Event::Settled if !agv.connection.online => {
                let body = agv.state_picture();
                let changed = buffered.last().is_none_or(|(_, last)| Changes::between(last, &body).any());
                if agv.connection.was_online() && changed && buffered.len() < 50 {
                    buffered.push((format!("{:.2}", agv.now.utc), body));
                }
            }
            Event::Reporting => for (timestamp, mut body) in buffered.drain(..) {
                // What the body says goes before the header.
                body.set("timestamp", timestamp);
                agv.publish("state", body);
            },
            _ => {}
        });
    fault "reconnect-relists-traversed-nodes" ["MQTT-03", "STATE-12"] "It reloads the node states of the moment of the link loss, so that nodes traversed during the outage are listed again after the reconnect."
        => keep::<(VecDeque<Stop>, Vec<Stop>)>()
            .happens(|(before, again), agv, event| match event {
                Event::ConnectionLost => before.clone_from(&agv.order.nodes),
                Event::Reporting if agv.connection.sessions > 1 => {
                    let ahead = |stop: &&Stop| agv.order.nodes.iter().any(|other| other.node.sequence_id == stop.node.sequence_id);
                    *again = before.iter().filter(|stop| !ahead(stop)).cloned().collect();
                }
                Event::Updated => again.clear(),
                Event::Begun | Event::PowerCycled => {
                    before.clear();
                    again.clear();
                }
                _ => {}
            })
            .says(|(_, again), agv, part, m| {
                if matches!(part, Part::State) && !agv.order.cancelled {
                    let listed: Vec<Value> = again.iter().filter_map(|stop| agv.node_state(stop)).collect();
                    m.change("nodeStates", |states| if let Value::Array(states) = states {
                        states.splice(0..0, listed);
                    });
                }
                true
            });
    fault "online-late" ["CONN-05", "CONN-11"] "Says ONLINE only 25 seconds after it reconnected."
        => keep::<Option<Moment>>()
            .allows(|_, agv, what, usual| usual && !(matches!(what, Permission::SayOnline) && agv.connection.sessions > 1))
            .happens(|due, agv, event| match event {
                Event::Connected if agv.connection.sessions > 1 => *due = Some(agv.moment() + Duration::from_secs(25)),
                Event::ConnectionLost | Event::PowerCycled | Event::Left => *due = None,
                Event::Woken if due.take_if(|due| *due <= agv.moment()).is_some() => agv.publish_connection("ONLINE"),
                _ => {}
            })
            .due(|due, _| *due);
    tolerance "every-state-twice" ["STATE-02"] "Sends every state a second time."
        => again(1);
    tolerance "online-again" ["CONN-05", "CONN-10"] "The vehicle publishes ONLINE again with every tenth state."
        => when(Event::StateSent, |agv| if agv.states_sent.is_multiple_of(10) { agv.publish_connection("ONLINE") });
    tolerance "online-behind-every-state" ["CONN-05", "CONN-10"] "It publishes ONLINE once more behind every state."
        => when(Event::StateSent, |agv| agv.publish_connection("ONLINE"));
    tolerance "factsheet-again" ["FACT-01"] "Publishes its factsheet with every tenth state."
        => when(Event::StateSent, |agv| if agv.states_sent.is_multiple_of(10) { agv.publish_factsheet() });
    tolerance "first-state-late" ["CONN-05", "STATE-02"] "The first state of a connection comes more than a second after ONLINE."
        => when(Event::Reporting, |agv| agv.report.silent_until = Some(agv.moment() + Duration::from_millis(1_200)));
    tolerance "lib-battery-good-or-bad" ["STATE-MSG-15", "STATE-MSG-16"] "It reports a batteryCharge of only 80 or 20."
        => state(|_, m| m.part("batteryState", |battery| number(battery, "batteryCharge", |charge| if charge > 50.0 { 80.0 } else { 20.0 })));
    tolerance "battery-drains" ["STATE-MSG-15"] "Its battery charge falls a little with every state."
        => state(|agv, m| {
            let used = u32::try_from(agv.states_sent % 5_000).unwrap_or_default();
            m.part("batteryState", |battery| if battery.says("batteryCharge", 87.5) {
                battery.set("batteryCharge", 87.5 - f64::from(used) * 0.01);
            });
        });
}

/// Whether the last state lists a request.
fn asks_already(agv: &Agv) -> bool {
    let last = agv.report.last.as_ref().map(|(_, body)| body);
    let lists = |key: &str| {
        let requests = last.and_then(|body| body.get(key)?.as_array());
        requests.is_some_and(|requests| !requests.is_empty())
    };
    lists("zoneRequests") || lists("edgeRequests")
}

type Untold = fn(&Agv, Changes, bool) -> bool;

/// Keeps some changes to itself, and sends periodic states so seldom that they do not make up for that.
fn untold(which: Untold, telling: Telling) -> Box<Hooks<(Untold, Telling)>> {
    seldom(holding((which, telling))).tells(|(which, telling), agv, changes, requested| {
        match which(agv, changes, requested) {
            true => *telling,
            false => Telling::Now,
        }
    })
}

/// The longest interval the standard allows, with some room.
fn seldom<M>(hooks: Box<Hooks<M>>) -> Box<Hooks<M>> {
    hooks.lasts(|_, _, what, usual| match what {
        Span::StatedBetweenStates => Duration::from_secs(28),
        _ => usual,
    })
}

/// Sends every state so many times more.
fn again(times: u32) -> Box<Hooks<u32>> {
    holding(times).happens(|times, agv, event| {
        let last = agv.report.last.as_ref().filter(|_| event == Event::StateSent);
        if let Some(body) = last.map(|(_, body)| body.clone()) {
            (0..*times).for_each(|_| agv.publish("state", body.clone()));
        }
    })
}
