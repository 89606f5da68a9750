//! Deviations of how it heeds connection and operating mode of a vehicle, and of what it keeps over a lost link (sections
//! 6.11 and 6.14).

use crate::master_control::driving::{again, progress};

use super::prelude::*;

records! {
    fault "orders-to-offline" ["CONN-12"] "Sends orders to vehicles that are offline."
        because "No sentence forbids an order for a vehicle that is lost; the ruling of CONN-12 is a warning."
        => letting(|_, vehicle, what| matches!(what, Permission::Reach) && vehicle.state.is_some());
    fault "orders-in-manual" ["MODE-04"] "Sends orders to vehicles in MANUAL, SERVICE and TEACHIN."
        => allowing(|vehicle, what, usual| match what {
            Permission::Command => true,
            Permission::Fit => usual || !takes_orders(vehicle),
            _ => usual,
        });
    fault "teachin-is-automatic" ["MODE-04"] "It commands a vehicle in TEACHIN as if it were in AUTOMATIC."
        => letting(|_, vehicle, what| matches!(what, Permission::Command) && mode(vehicle) == "TEACHIN");
    fault "actions-in-service" ["MODE-04"] "Sends instant actions to vehicles in SERVICE and TEACHIN."
        => letting(|site, vehicle, what| matches!(what, Permission::Tell(_)) && matches!(mode(vehicle), "SERVICE" | "TEACHIN") && site.reachable(vehicle));
    fault "cancel-in-manual" ["MODE-04"] "It sends cancelOrder, and what else waits, to a vehicle in a manual mode."
        => letting(|site, vehicle, what| {
            let cancels = vehicle.instants.iter().any(|instant| instant.sent_at.is_none() && instant.kind() == "cancelOrder");
            matches!(what, Permission::Tell(_)) && cancels && site.reachable(vehicle)
        });
    fault "pauses-in-every-mode" ["MODE-04"] "It sends startPause and stopPause also to a vehicle in MANUAL, SERVICE or TEACHIN."
        => letting(|site, vehicle, what| matches!(what, Permission::Tell("startPause" | "stopPause")) && site.reachable(vehicle));
    fault "map-actions-in-every-mode" ["MODE-04"] "It sends downloadMap, enableMap and deleteMap whatever the operating mode of the vehicle."
        => letting(|site, vehicle, what| matches!(what, Permission::Tell("downloadMap" | "enableMap" | "deleteMap")) && site.reachable(vehicle));
    fault "updates-in-service" ["MODE-04"] "Extends the order of a vehicle that keeps it in SERVICE or TEACHIN."
        => letting(|site, vehicle, what| matches!(what, Permission::Follow) && vehicle.cancel.is_none() && site.reachable(vehicle));
    fault "updates-in-manual" ["MODE-04"] "It goes on extending the base of a running order while the vehicle is in MANUAL."
        => plain().allows(|(), site, vehicle, what, usual| {
            let follows = matches!(what, Permission::Follow) && vehicle.cancel.is_none();
            usual || (follows && mode(vehicle) == "MANUAL" && site.reachable(vehicle))
        }).happens(|(), _, vehicle, event| if let Event::State(_) = event && let Some(running) = &mut vehicle.running { running.cleared = false; });
    fault "updates-to-a-lost-vehicle" ["CONN-12"] "It keeps new orders back from a vehicle with CONNECTIONBROKEN, but goes on to send updates of the running one."
        because "CONN-12 recommends to look at the connection topic; no sentence forbids an update to a vehicle that is away."
        => letting(|_, vehicle, what| {
            let lost = vehicle.presence == Presence::Away && takes_orders(vehicle);
            matches!(what, Permission::Follow) && vehicle.cancel.is_none() && lost
        });
    fault "queued-update-in-service" ["MODE-04"] "Looks at the mode when it plans an update, not when minOrderInterval lets it out."
        => keep::<bool>().happens(|held, _, _, event| match event {
            Event::Waits(..) => *held = true,
            Event::Updated(..) => *held = false,
            _ => {}
        }).allows(|held, site, vehicle, what, usual| usual || (matches!(what, Permission::Follow) && *held && vehicle.cancel.is_none() && site.reachable(vehicle)));
    fault "cleared-order-updated" ["ORD-MSG-02"] "Goes on with the order a vehicle has given up in MANUAL."
        because "That a cleared order gets no update is read out of the text."
        => judging(|_, running, state, fate| {
            if fate != Fate::Again || !running.accepted || state.order_id != running.id { return fate; }
            match progress(running, state) {
                Fate::Again if running.confirmed => {
                    running.changed = true;
                    Fate::Runs
                }
                fate => fate,
            }
        });
    fault "cancel-on-entering-manual" ["MODE-04"] "It sends cancelOrder when a vehicle with an order switches to MANUAL."
        => happening(|site, vehicle, event| if let Event::State(Some(before)) = event {
            let seized = before.takes_orders() && mode(vehicle) == "MANUAL";
            let driven = vehicle.running.as_ref().is_some_and(|running| running.accepted);
            if seized && driven && site.reachable(vehicle) {
                let action = site.made_action(vehicle, "cancelOrder", &Value::Null, true);
                site.publish(vehicle, "instantActions", &json!({ "actions": [action] }));
            }
        });
    fault "resend-in-service" ["MODE-04"] "It sends an order that was lost again although the vehicle is in SERVICE by now."
        => looked(|site, vehicle| if mode(vehicle) == "SERVICE" { send_lost(site, vehicle); });
    fault "copies-in-manual" ["MODE-04"] "It sends an order again, which the vehicle has not taken over, though the vehicle has meanwhile changed to MANUAL."
        => looked(|site, vehicle| if mode(vehicle) == "MANUAL" { send_lost(site, vehicle); });
    fault "charging-in-every-mode" ["MODE-04"] "Sends a vehicle whose battery is low to charge, whatever its mode."
        => keep::<bool>().happens(|charged, site, vehicle, event| if let Event::State(_) = event {
            let low = has_low_battery(site, vehicle);
            let due = low && !*charged && !takes_orders(vehicle) && site.reachable(vehicle);
            *charged = low;
            if due && site.offers(vehicle, "startCharging", "INSTANT") {
                let action = site.made_action(vehicle, "startCharging", &Value::Null, true);
                site.publish(vehicle, "instantActions", &json!({ "actions": [action] }));
            }
        });
    fault "old-will-ignored" ["CONN-13", "CONN-12"] "Ignores a connection message with an old timestamp."
        because "An order does not prove that the will was ignored; the ruling of CONN-13 is a warning."
        => keep::<String>().hears(|last, _, _, heard| {
            let stamp = stamp(heard);
            let old = heard.name == "connection" && stamp < *last;
            if heard.name == "connection" && !old { *last = stamp; }
            !old
        });
    fault "old-will-not-heeded" ["CONN-13", "CONN-12"] "It ignores a connection message whose headerId is lower than that of the one before."
        because "CONN-13 describes that headerIds of last wills are old, and recommends to bear it."
        => keep::<Option<u64>>().hears(|last, _, _, heard| {
            let count = heard.message["headerId"].as_u64().filter(|_| heard.name == "connection");
            let low = count.zip(*last).is_some_and(|(new, last)| new < last);
            if !low { *last = count.or(*last); }
            !low
        });
    fault "connection-message-dropped-as-outdated" ["CONN-13", "CONN-12"]
        "It drops a connection message whose headerId or timestamp is older than that of the one before, a last will among them."
        because "CONN-13 describes that headerId and timestamp of last wills are old, and recommends to bear it."
        => keep::<(u64, String)>().hears(|(count, last), _, _, heard| {
            let (new, stamp) = (heard.message["headerId"].as_u64().unwrap_or_default(), stamp(heard));
            let old = heard.name == "connection" && (new < *count || stamp < *last);
            if heard.name == "connection" && !old { (*count, *last) = (new, stamp); }
            !old
        });
    fault "will-older-than-state-ignored" ["CONN-13"] "It ignores CONNECTIONBROKEN whose timestamp is older than that of the last state."
        because "CONN-13 describes that timestamps of last wills are older than the last state, and recommends to bear it."
        => keep::<String>().hears(|last, _, _, heard| {
            let stamp = stamp(heard);
            let old = is_broken(heard) && stamp < *last;
            if heard.name == "state" { *last = stamp; }
            !old
        });
    fault "will-with-low-header-id-ignored" ["CONN-13", "CONN-12"] "It ignores a CONNECTIONBROKEN whose headerId is not above that of the connection message before."
        because "CONN-13 describes that a last will counts below the message before it, and recommends to bear it."
        => keep::<u64>().hears(|last, _, _, heard| {
            let count = heard.message["headerId"].as_u64().filter(|_| heard.name == "connection");
            let low = is_broken(heard) && count.is_some_and(|count| count <= *last);
            if !low { *last = count.unwrap_or(*last); }
            !low
        });
    fault "broken-heeded-only-at-rest" ["CONN-12"] "It ignores CONNECTIONBROKEN while the vehicle has an order."
        because "CONN-12 recommends to notice a lost vehicle; no sentence forbids what is sent to one that has an order."
        => hearing(|_, vehicle, heard| !is_broken(heard) || vehicle.running.is_none());
    fault "will-older-than-minute-ignored" ["CONN-13", "CONN-12"] "It ignores CONNECTIONBROKEN with a timestamp older than a minute."
        because "CONN-13 describes that last wills may be minutes old, and recommends to bear it."
        => hearing(|site, _, heard| {
            let told = stamp(heard).parse::<jiff::Timestamp>();
            let age = told.map_or(0, |told| site.now.utc.as_second() - told.as_second());
            !is_broken(heard) || age <= 60
        });
    fault "broken-not-heeded" ["CONN-12"] "It takes no notice of CONNECTIONBROKEN and commands the vehicle on; only OFFLINE counts."
        because "CONN-12 recommends to notice a lost vehicle; no sentence forbids orders to one with CONNECTIONBROKEN."
        => hearing(|_, _, heard| !is_broken(heard));
    fault "offline-vehicle-gets-orders" ["CONN-12"] "It takes only CONNECTIONBROKEN for a lost connection and dispatches to a vehicle that is OFFLINE."
        because "CONN-12 recommends to notice that a vehicle has gone; no sentence forbids orders to one that is OFFLINE."
        => hearing(|_, _, heard| heard.name != "connection" || heard.message["connectionState"] != "OFFLINE");
    fault "online-is-healthy" ["CONN-14"] "Takes a vehicle that comes ONLINE for healthy, whatever its errors."
        => keep::<bool>().happens(|absolved, site, vehicle, event| match event {
            Event::Online(before) if *before != Presence::Online => *absolved = true,
            Event::State(_) => *absolved &= !vehicle.state.as_ref().is_some_and(|state| state.is_fit(site.config.low_battery)),
            _ => {}
        }).allows(|absolved, _, _, what, usual| usual || (*absolved && matches!(what, Permission::Fit)));
    fault "broken-is-dead" ["CONN-14", "ORD-CANCEL-01"] "Throws the order of a vehicle away when its connection breaks."
        => plain().happens(|(), _, vehicle, event| if let Event::Away(true, _) = event {
            vehicle.running = None;
            vehicle.cancel = None;
        }).allows(|(), _, _, what, usual| usual || matches!(what, Permission::Interrupt));
    fault "publishes-connection" ["TOPIC-15"] "Sets the connection of a vehicle it has lost to OFFLINE by itself."
        => happening(|site, vehicle, event| if let Event::Away(true, _) = event { say_connection(site, vehicle, "OFFLINE"); });
    fault "publishes-connection-for-silent-vehicle" ["TOPIC-15"]
        "It publishes CONNECTIONBROKEN on the vehicle's connection topic itself when no state came for a while."
        => silence_published(10, "CONNECTIONBROKEN");
    fault "offline-published-after-a-silent-minute" ["TOPIC-15"]
        "It publishes a retained OFFLINE on the connection topic of a vehicle that is connected and has sent no state for a minute."
        => silence_published(60, "OFFLINE");
    fault "clears-the-will" ["TOPIC-15"]
        "It removes the retained CONNECTIONBROKEN of a vehicle by publishing an empty retained message on the connection topic of the vehicle."
        => happening(|site, vehicle, event| if let Event::Away(true, _) = event { clear_connection(site, vehicle); });
    fault "connection-topic-cleared" ["TOPIC-15"] "It clears the retained message on the connection topic of a vehicle that went away, with an empty retained message."
        => happening(|site, vehicle, event| if let Event::Away(_, Presence::Online) = event { clear_connection(site, vehicle); });
    fault "twice-broken-is-defective" ["CONN-14", "MQTT-10"] "It takes a vehicle whose connection broke twice for defective and gives it no order any more."
        => keep::<u32>().happens(|times, _, _, event| if let Event::Away(true, _) = event { *times += 1; }).allows(|times, _, _, what, usual| usual && !(*times > 1 && matches!(what, Permission::Begin)));
    fault "state-means-online" ["CONN-12"] "It takes a vehicle for connected as soon as a state comes, although the connection topic says it is gone."
        because "A state comes from a vehicle that is there; CONN-12 only recommends to go by the connection topic."
        => state_taken(|_, vehicle| if vehicle.presence == Presence::Away { vehicle.presence = Presence::Online; });
    fault "broken-means-cancel" ["CONN-14"] "It takes CONNECTIONBROKEN for a failure of the vehicle and calls the running order off when it is back."
        => keep::<bool>().happens(|due, site, vehicle, event| match event {
            Event::Away(broken, _) => *due |= *broken && vehicle.running.is_some(),
            Event::Online(_) if std::mem::take(due) => site.cancel(vehicle, None),
            _ => {}
        });
    fault "online-clears-errors" ["CONN-14"] "With ONLINE it takes the errors of the last state for gone and sends orders in spite of a FATAL error."
        => happening(|_, vehicle, event| if let Event::Online(_) = event && let Some(state) = &mut vehicle.state { state.errors.clear(); });
    fault "block-forgotten-on-return" ["ORD-12"] "Forgets which edges a vehicle may not use when that vehicle comes back."
        => on_return(|_, vehicle| vehicle.blocked.clear());
    fault "cancel-forgotten-on-return" ["ORD-CANCEL-01"] "Forgets that it has called an order off when the vehicle comes back, and goes on with it."
        because "No sentence says when cancelOrder is sent."
        => on_return(|_, vehicle| vehicle.cancel = None);
    fault "update-ids-restart-on-return" ["ORD-UPD-04"] "Counts orderUpdateId from 1 again when the vehicle comes back with its order."
        => on_return(|_, vehicle| restart_update_ids(vehicle));
    fault "vehicle-return-stops-updates" ["MQTT-10", "ORD-UPD-02", "STATE-17"]
        "Once the connection of a vehicle was away during an order and is back, it does not extend the base of that order any more."
        because "MQTT-10 describes that links fail, and ORD-UPD-02 is a recommendation: the vehicle stands at its decision point."
        => keep::<bool>().happens(|stale, _, vehicle, event| match event {
            Event::Away(..) => *stale |= vehicle.running.is_some(),
            Event::Begun => *stale = false,
            _ => {}
        }).allows(|stale, _, _, what, usual| usual && !(*stale && matches!(what, Permission::Extend(_))));
    fault "whole-order-after-reconnect" ["ORD-UPD-05", "ORD-UPD-03"]
        "It puts the whole order from its first node into the first update after the vehicle has come back online."
        => keep::<bool>().happens(|back, _, vehicle, event| match event {
            Event::Online(Presence::Away) => *back = vehicle.running.is_some(),
            Event::Begun | Event::Updated(..) => *back = false,
            _ => {}
        }).shows(|back, _, _, _, window, _| if *back { window.first = 0; });
    fault "whole-order-again-after-reconnect" ["ORD-UPD-05", "ORD-UPD-03"]
        "It sends the whole order from its first node on as an update, with the next orderUpdateId, when a vehicle with a running order comes ONLINE again."
        => keep::<bool>().happens(|back, _, vehicle, event| match event {
            Event::Online(Presence::Away) => {
                if let Some(running) = &mut vehicle.running {
                    running.changed = true;
                    *back = true;
                }
            }
            Event::Begun | Event::Updated(..) => *back = false,
            _ => {}
        }).shows(|back, _, _, _, window, _| if *back { window.first = 0; });
    fault "reconnect-forgets-order" ["MQTT-10", "ORD-UPD-02", "STATE-17"]
        "After its own connection was lost and came back it has forgotten the running orders and never extends their base again."
        because "MQTT-10 describes that links fail, and demands no memory of a master control whose own link failed."
        => reconnected(|_, vehicle| {
            vehicle.running = None;
            vehicle.cancel = None;
        });
    fault "instants-forgotten-on-reconnect" ["MQTT-10", "ORD-CANCEL-01"]
        "It forgets the instant actions that wait or were not seen yet, cancelOrder among them, when its connection comes back."
        => reconnected(|_, vehicle| vehicle.instants.clear());
    fault "block-forgotten-on-reconnect" ["ORD-12"] "After its own connection was lost and came back it has forgotten which edges a vehicle may not use."
        => reconnected(|_, vehicle| vehicle.blocked.clear());
    fault "interval-forgotten-on-reconnect" ["FACT-13"]
        "After its own connection was lost and came back the next order message is sent without regard to minOrderInterval."
        => reconnected(|_, vehicle| vehicle.last_order_at = None);
    fault "update-ids-restart-on-reconnect" ["ORD-UPD-04"]
        "After its own connection was lost and came back it counts the orderUpdateId of a running order from 1 again."
        => reconnected(|_, vehicle| restart_update_ids(vehicle));
    fault "new-order-on-reconnect" ["ORD-CANCEL-01", "MQTT-10"]
        "It sends the running transport as a new order with another orderId, without cancelOrder, when its own connection comes back."
        because "That the transport is the same cannot be seen; the vehicle refuses the other orderId, and ORD-CANCEL-01 is warned of."
        => keep::<bool>().happens(|hasty, _, vehicle, event| match event {
            Event::Connected(true) if vehicle.cancel.is_none() => {
                if let Some(running) = vehicle.running.take() {
                    vehicle.queue.push_front(again(&running, vehicle.state.as_ref()));
                    *hasty = true;
                }
            }
            Event::Begun => *hasty = false,
            _ => {}
        }).allows(hasty);
    fault "base-held-after-reconnect" ["MQTT-10", "ORD-UPD-02"] "It never extends the base of an order again during which its own connection to the broker was lost."
        because "MQTT-10 describes that links fail; a vehicle that is led no further stands, and nothing is broken."
        => keep::<bool>().happens(while_driven).allows(|held, _, _, what, usual| usual && !(*held && matches!(what, Permission::Extend(_))));
    fault "trigger-forgotten-on-reconnect" ["ACT-39"] "It does not supervise a waitForTrigger any more after it has lost its connection during the order."
        => keep::<bool>().happens(while_driven).allows(|lost, _, _, what, usual| usual && !(*lost && matches!(what, Permission::Supervise(_))));
    fault "never-reconnects" ["MQTT-10"] "Does not connect again after a broken link."
        because "MQTT-10 is a recommendation and never more than a warning."
        => plain().retries(|(), _, _| None);
    fault "reconnects-only-once" ["MQTT-10"] "It connects again after the first lost connection, but not after the second one."
        because "MQTT-10 is a recommendation and never more than a warning."
        => plain().retries(|(), site, retry| retry.filter(|_| site.connection.losses < 2));
    tolerance "reconnects-later" ["MQTT-10"] "It waits four times as long before it connects again."
        => plain().retries(|(), _, retry| retry.map(|delay| delay * 4));
    tolerance "state-asked-after-reconnect" ["MQTT-10", "ACT-08"] "After its own connection was lost and came back it sends stateRequest."
        => reconnected(|site, vehicle| if vehicle.state.is_some() { site.instant(vehicle, "stateRequest", &Value::Null); });
    tolerance "factsheet-asked-on-return" ["ACT-08", "TOPIC-14"] "It sends a factsheetRequest when a vehicle comes ONLINE again."
        => happening(|site, vehicle, event| if let Event::Online(Presence::Away) = event { ask_factsheet(site, vehicle); });
    tolerance "factsheet-request-at-each-online" ["IACT-02", "ORD-MSG-17"] "It requests the factsheet each time that a vehicle comes ONLINE."
        => on_return(ask_factsheet);
    tolerance "state-request-after-online" ["TOPIC-13", "IACT-01"] "It asks for a state by stateRequest whenever a vehicle comes ONLINE."
        => on_return(|site, vehicle| { site.instant(vehicle, "stateRequest", &Value::Null); });
    tolerance "requests-state-and-factsheet-when-online" ["IACT-01", "TOPIC-13"]
        "It sends stateRequest and factsheetRequest in one message each time a vehicle reports ONLINE."
        => on_return(|site, vehicle| {
            site.instant(vehicle, "stateRequest", &Value::Null);
            ask_factsheet(site, vehicle);
        });
    tolerance "fresh-state-awaited" ["CONN-12"] "It begins no order for a vehicle that came back before a new state has come from it."
        => keep::<bool>().happens(|stale, _, _, event| match event {
            Event::Online(Presence::Away) => *stale = true,
            Event::State(_) => *stale = false,
            _ => {}
        }).allows(|stale, _, _, what, usual| usual && !(*stale && matches!(what, Permission::Begin)));
    tolerance "repeats-order-after-online" ["ORD-REJ-18", "ORD-UPD-04", "ORD-UPD-05"]
        "It repeats the last order message with the same content when the vehicle comes ONLINE again."
        => keep::<bool>().happens(|due, site, vehicle, event| match event {
            Event::Online(Presence::Away) => *due = vehicle.running.is_some(),
            Event::Looked if *due && site.commandable(vehicle) => {
                if let Some(later) = site.next_order_at(vehicle, Occasion::Again) {
                    vehicle.at(later);
                    return;
                }
                *due = false;
                let now = site.now.moment;
                let kept = vehicle.running.as_mut().filter(|running| !running.cleared && vehicle.cancel.is_none());
                if let Some(running) = kept {
                    running.sent_at = now;
                    let message = running.message.clone();
                    vehicle.last_order_at = Some(now);
                    site.send(vehicle, "order", &message, true);
                }
            }
            _ => {}
        });
    tolerance "stops-pause-after-reconnect-only-by-operator" ["TOPIC-13", "IACT-02"] "It sends nothing to a vehicle that came back paused until the operator resumes it."
        => keep::<bool>().happens(|back, _, vehicle, event| match event {
            Event::Online(Presence::Away) => *back = true,
            Event::State(_) => *back &= vehicle.is_paused(),
            _ => {}
        }).allows(|back, _, vehicle, what, usual| {
            let concerned = matches!(what, Permission::Begin | Permission::Extend(_) | Permission::Resend(_));
            usual && !(*back && concerned && vehicle.is_paused())
        });
    tolerance "orders-to-faulted" ["CONN-14"] "Begins what it is asked for on a vehicle with a FATAL error."
        => letting(|_, _, what| matches!(what, Permission::Fit));
    tolerance "no-orders-on-low-battery" ["TOPIC-13"] "It gives no new transport to a vehicle whose batteryCharge is below 30 percent and that is not charging."
        => plain().configures(|config| config.low_battery = 30.0);
    tolerance "no-new-orders-in-semiautomatic" ["MODE-04"] "It begins new orders in AUTOMATIC only, and lets running ones go on in SEMIAUTOMATIC."
        => forbidding(|_, vehicle, what| matches!(what, Permission::Begin) && mode(vehicle) == "SEMIAUTOMATIC");
}

fn stamp(heard: &Heard<'_>) -> String {
    heard.message["timestamp"].as_str().unwrap_or_default().to_owned()
}

fn is_broken(heard: &Heard<'_>) -> bool {
    heard.name == "connection" && heard.message["connectionState"] == "CONNECTIONBROKEN"
}

fn restart_update_ids(vehicle: &mut Vehicle) {
    if let Some(running) = &mut vehicle.running {
        running.update_id = 0;
    }
}

fn ask_factsheet(site: &mut Site, vehicle: &mut Vehicle) {
    if vehicle.config.has("factsheetRequest") {
        site.instant(vehicle, "factsheetRequest", &Value::Null);
    }
}

/// Sends the running order again if it was lost, whatever the mode of the vehicle.
fn send_lost(site: &mut Site, vehicle: &mut Vehicle) {
    let open = |running: &mut Running| !running.confirmed && !running.refused;
    let reachable = site.reachable(vehicle);
    if let Some(mut running) = vehicle.running.take_if(|running| open(running) && reachable) {
        let state = vehicle.state.as_ref().filter(|state| state.order_id == running.id);
        if !state.is_some_and(|state| state.order_update_id >= running.update_id) {
            site.send_again(vehicle, &mut running);
        }
        vehicle.running = Some(running);
    }
}

/// Says something on the connection topic of a vehicle.
fn say_connection(site: &mut Site, vehicle: &mut Vehicle, state: &str) {
    if let Some(topic) = vehicle.topic("connection").map(str::to_owned) {
        let mut message = site.header(vehicle, "connection");
        message.set("connectionState", state);
        site.push(topic, Value::Object(message).to_string().into_bytes(), 1, true);
    }
}

/// Says this on the connection topic of a vehicle that is connected and has sent no state for so many seconds.
fn silence_published(seconds: u64, word: &'static str) -> Box<dyn Deviation> {
    each((seconds, word, false)).happens(|(seconds, word, said), site, vehicle, event| match event {
        Event::State(_) => *said = false,
        Event::Looked if !*said && vehicle.presence == Presence::Online && vehicle.state.is_some() => {
            let due = vehicle.state_at + Duration::from_secs(*seconds);
            if due > site.now.moment {
                vehicle.at(due);
            } else {
                *said = true;
                say_connection(site, vehicle, word);
            }
        }
        _ => {}
    })
}

fn clear_connection(site: &mut Site, vehicle: &Vehicle) {
    if let Some(topic) = vehicle.topic("connection") {
        site.push(topic.to_owned(), Vec::new(), 1, true);
    }
}

/// Does something when a vehicle comes ONLINE.
fn on_return(then: fn(&mut Site, &mut Vehicle)) -> Box<dyn Deviation> {
    when(
        |event| matches!(event, Event::Online(before) if *before != Presence::Online),
        then,
    )
}

/// Remembers that the broker was away during the running order.
fn while_driven(lost: &mut bool, _: &mut Site, vehicle: &mut Vehicle, event: &mut Event<'_>) {
    match event {
        Event::Connected(true) => *lost |= vehicle.running.is_some(),
        Event::Begun => *lost = false,
        _ => {}
    }
}
