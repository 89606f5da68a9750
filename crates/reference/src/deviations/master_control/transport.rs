//! Deviations of MQTT and its topics: how it connects, what it subscribes to, where and how it publishes (6.1 to 6.3).

use crate::{ConnectOptions, Publication};

use super::prelude::*;

records! {
    fault "old-mqtt" ["MQTT-01"] "Connects with MQTT 3.1."
        => connecting(|_, _, options| options.level = 3);
    tolerance "newest-mqtt" ["MQTT-01"] "Connects with MQTT 5."
        => connecting(|_, _, options| options.level = 5);
    tolerance "session-kept" ["MQTT-01"] "Asks the broker to keep its session."
        => connecting(|_, _, options| options.clean_session = false);
    tolerance "long-keep-alive" ["MQTT-01"] "It connects with a keep-alive of a minute."
        => connecting(|_, _, options| options.keep_alive = Duration::from_secs(60));
    tolerance "new-client-id-each-time" ["MQTT-10", "TOPIC-15"] "It connects with another client identifier each time."
        => connecting(|site, _, options| options.client_id = format!("{}-{}", site.config.name, site.now.utc.as_millisecond()));
    tolerance "will-of-its-own" ["TOPIC-15"] "It has a last will on a topic of its own that is none of the protocol, in plain text."
        => connecting(|site, _, options| {
            options.will = Some(Publication {
                topic: format!("{}/status", site.config.name),
                payload: bytes::Bytes::from_static(b"offline"),
                qos: 1,
                retain: true,
            });
        });
    fault "will-on-vehicle-topic" ["TOPIC-15"] "It registers a retained last will CONNECTIONBROKEN on the connection topic of its first vehicle."
        => connecting(|site, fleet, options| {
            let Some(vehicle) = fleet.first() else { return };
            let message = json!({
                "headerId": 0,
                "timestamp": site.timestamp(vehicle),
                "version": vehicle.config.version,
                "manufacturer": vehicle.config.manufacturer,
                "serialNumber": vehicle.config.serial_number,
                "connectionState": "CONNECTIONBROKEN",
            });
            options.will = vehicle.topic("connection").map(|topic| Publication {
                topic: topic.to_owned(),
                payload: message.to_string().into(),
                qos: 1,
                retain: true,
            });
        });
    fault "not-subscribed-again" ["TOPIC-14", "MQTT-10", "MODE-04", "ORD-03", "CONN-12"] "Does not subscribe again when it reconnects."
        => connecting(|site, _, options| if site.connection.returning { options.subscriptions.clear(); });
    fault "state-not-subscribed" ["TOPIC-14"] "Does not subscribe to the state."
        => connecting(|_, _, options| without(options, "state"));
    fault "connection-not-subscribed" ["TOPIC-14", "CONN-12"] "Does not subscribe to the connection topic."
        => connecting(|_, _, options| without(options, "connection"));
    fault "factsheet-not-subscribed" ["TOPIC-14"] "Does not subscribe to the factsheet."
        => connecting(|_, _, options| without(options, "factsheet"));
    tolerance "visualization-not-subscribed" ["VIS-03", "TOPIC-14"] "It does not subscribe to visualization at all."
        => connecting(|_, _, options| without(options, "visualization"));
    fault "factsheet-unsubscribed-after-reconnect" ["TOPIC-14"] "It does not subscribe to the factsheet topics again after it has lost its connection."
        => connecting(|site, _, options| if site.connection.returning { without(options, "factsheet"); });
    fault "factsheet-of-first-vehicle-only" ["TOPIC-14"] "It subscribes to the factsheet topic of the first vehicle of its fleet only."
        => connecting(|_, fleet, options| {
            let first = fleet.first().and_then(|vehicle| vehicle.topic("factsheet")).unwrap_or_default();
            options.subscriptions.retain(|(topic, _)| topic == first || !topic.ends_with("/factsheet"));
        });
    fault "connection-with-qos-0" ["TOPIC-14"] "Subscribes to the connection topic with QoS 0."
        because "The QoS is asked of whoever publishes; the ruling of TOPIC-14 is a warning."
        => connecting(|_, _, options| options.subscriptions.iter_mut().for_each(|(_, qos)| *qos = 0));
    tolerance "subscribes-with-qos-1" ["TOPIC-14"] "Subscribes with QoS 1."
        => connecting(|_, _, options| options.subscriptions.iter_mut().for_each(|(_, qos)| *qos = 1));
    tolerance "subscribes-with-wildcards" ["TOPIC-14"] "Subscribes to everything the vehicles publish with one filter for each topic."
        => connecting(|_, _, options| {
            for (topic, _) in &mut options.subscriptions { *topic = with_wildcards(topic); }
            options.subscriptions.sort();
            options.subscriptions.dedup();
        });
    tolerance "subscribes-twice" ["TOPIC-14"] "It subscribes to each topic both exactly and with wildcards, so that messages may come to it twice."
        => connecting(|_, _, options| {
            let mut wide: Vec<_> = options.subscriptions.iter().map(|(topic, qos)| (with_wildcards(topic), *qos)).collect();
            wide.sort();
            wide.dedup();
            options.subscriptions.extend(wide);
        });
    tolerance "listens-to-own-topics" ["TOPIC-14", "TOPIC-15"] "It also subscribes to order and instantActions."
        => connecting(|_, fleet, options| {
            let own = fleet.iter().flat_map(|vehicle| ["order", "instantActions"].map(|name| vehicle.topic(name)));
            options.subscriptions.extend(own.flatten().map(|topic| (topic.to_owned(), 0)));
        });
    tolerance "subscribes-to-everything" ["TOPIC-14", "TOPIC-15"] "It subscribes to all topics of the interface with one filter."
        => connecting(|_, fleet, options| {
            let topic = fleet.first().and_then(|vehicle| vehicle.topic("state")).unwrap_or_default();
            let levels: Vec<&str> = topic.split('/').collect();
            let all = match levels.len().checked_sub(3) {
                Some(kept) if kept > 0 => format!("{}/#", levels[..kept].join("/")),
                _ => "#".to_owned(),
            };
            options.subscriptions = vec![(all, 1)];
        });
    fault "order-qos-1" ["MQTT-06"] "Publishes orders with QoS 1."
        because "A higher QoS delivers the order as well; the ruling of MQTT-06 is a warning."
        => sending(|_, _, out| qos(out, 1, out.name == "order"));
    fault "instant-actions-and-responses-qos-one" ["MQTT-06"] "It publishes orders with QoS 0, but instant actions and responses with QoS 1."
        because "A higher QoS delivers the messages as well; the ruling of MQTT-06 is a warning."
        => sending(|_, _, out| qos(out, 1, matches!(out.name, "instantActions" | "responses")));
    fault "instant-actions-qos-2" ["MQTT-06"] "Publishes instant actions with QoS 2."
        because "A higher QoS delivers the actions as well; the ruling of MQTT-06 is a warning."
        => sending(|_, _, out| qos(out, 2, out.name == "instantActions"));
    fault "responses-qos-one" ["MQTT-06"] "It publishes responses with QoS 1."
        because "A higher QoS delivers the responses as well; the ruling of MQTT-06 is a warning."
        => sending(|_, _, out| qos(out, 1, out.name == "responses"));
    fault "zone-sets-qos-one" ["MQTT-06"] "It publishes sets of zones with QoS 1."
        because "A higher QoS delivers the sets as well; the ruling of MQTT-06 is a warning."
        => sending(|_, _, out| qos(out, 1, out.name == "zoneSet"));
    fault "cancel-qos-one" ["MQTT-06"] "It publishes instantActions with cancelOrder with QoS 1."
        because "The ruling of MQTT-06 makes a higher quality of service a warning: a cancelOrder with QoS 1 harms nobody."
        => sending(|_, _, out| qos(out, 1, out.tells(&["cancelOrder"])));
    fault "resend-qos-one" ["MQTT-06"] "It publishes an order that was lost again with QoS 1."
        because "The ruling of MQTT-06 makes a higher quality of service a warning: a repetition with QoS 1 harms nobody."
        => sending(|_, _, out| qos(out, 1, out.again));
    fault "updates-qos-one" ["MQTT-06"] "It publishes updates of orders with QoS 1, and new orders with QoS 0."
        because "The ruling of MQTT-06 makes a higher quality of service a warning: an update with QoS 1 harms nobody."
        => sending(|_, _, out| qos(out, 1, out.is_update()));
    fault "qos-one-after-reconnect" ["MQTT-06"] "It publishes orders and instant actions with QoS 1 once it has lost its connection to the broker."
        because "The ruling of MQTT-06 makes a higher quality of service a warning, before and after a reconnect."
        => sending(|site, _, out| qos(out, 1, site.connection.losses > 0));
    fault "orders-retained" ["MQTT-06"] "Publishes orders with RETAIN, so that a vehicle that is new to the broker drives off."
        because "No sentence forbids RETAIN on these topics; the ruling of MQTT-06 is a warning."
        => sending(|_, _, out| out.retain = out.name == "order");
    fault "instant-actions-retained" ["MQTT-06"] "Publishes instant actions with RETAIN."
        because "No sentence forbids RETAIN on these topics; the ruling of MQTT-06 is a warning."
        => sending(|_, _, out| out.retain = out.name == "instantActions");
    fault "topic-underscore" ["TOPIC-01", "TOPIC-13"] "Sends instant actions on a topic spelled with an underscore."
        => instants_on(|_, topic| topic.replace("instantActions", "instant_actions"));
    fault "instant-topic-lower-case" ["TOPIC-01", "TOPIC-13"] "It publishes instant actions on a topic that ends with instantactions in lower case."
        => instants_on(|_, topic| topic.replace("instantActions", "instantactions"));
    fault "responses-topic-in-singular" ["TOPIC-01", "REQ-03"] "It publishes responses on a topic that ends with response."
        => misdirected("responses", |_, topic| topic.replace("/responses", "/response"));
    fault "version-level-without-letter" ["TOPIC-03", "TOPIC-13"] "It publishes instantActions under a major version level without the letter v."
        => instants_on(|_, topic| topic.replacen("/v", "/", 1));
    fault "topic-levels-swapped" ["TOPIC-04", "TOPIC-02", "TOPIC-13"] "It publishes instantActions with the levels of manufacturer and serial number swapped."
        => instants_on(|_, topic| {
            let mut levels: Vec<&str> = topic.split('/').collect();
            let end = levels.len();
            if end >= 4 { levels.swap(end - 2, end - 3); }
            levels.join("/")
        });
    fault "instant-actions-as-orders" ["TOPIC-13", "IACT-01"] "Sends instant actions on the order topic."
        => instants_on(|_, topic| topic.replace("instantActions", "order"));
    fault "other-major-version" ["TOPIC-13", "TOPIC-03"] "Sends orders below another major version."
        => orders_on(|_, topic| topic.replacen("/v", "/v1", 1));
    fault "dollar-in-topic" ["TOPIC-13", "TOPIC-07"] "Sends orders on a topic with a dollar sign in it."
        => orders_on(|_, topic| topic.replacen('/', "/$", 1));
    fault "topic-without-version" ["TOPIC-13", "TOPIC-02"] "Leaves the level of the major version out of the topic of orders."
        => orders_on(|_, topic| {
            let levels = topic.split('/').enumerate().filter(|(at, _)| *at != 1);
            levels.map(|(_, level)| level).collect::<Vec<_>>().join("/")
        });
    fault "full-version-in-order-topic" ["TOPIC-03", "TOPIC-13"] "It publishes orders on a topic whose version level is the full protocol version, such as v2.1.0."
        => orders_on(|version, topic| {
            let major = format!("v{}", version.split('.').next().unwrap_or_default());
            let full = format!("v{version}");
            topic.split('/').map(|level| if level == major { &full } else { level }).collect::<Vec<_>>().join("/")
        });
    fault "updates-on-own-topic" ["TOPIC-01", "TOPIC-13"] "It publishes order updates on a topic orderUpdate instead of order."
        => sending(|_, _, out| if out.is_update() { out.topic.push_str("Update"); });
    fault "map-actions-on-map-topic" ["TOPIC-01", "TOPIC-13"] "It publishes downloadMap, enableMap and deleteMap on a topic mapActions of its own."
        => sending(|_, _, out| if out.tells(&["downloadMap", "enableMap", "deleteMap"]) { out.topic = out.topic.replace("instantActions", "mapActions"); });
    fault "pause-to-first-vehicle" ["TOPIC-13", "TOPIC-04"] "It publishes startPause and stopPause for any vehicle on the topic of the first vehicle of the fleet."
        => sending(|site, _, out| {
            let first = site.config.vehicles.first().and_then(|first| first.topics.get("instantActions"));
            if let Some(first) = first.filter(|_| out.tells(&["startPause", "stopPause"])) { out.topic.clone_from(first); }
        });
    fault "update-to-vehicle-served-last" ["TOPIC-13", "TOPIC-04"]
        "It publishes order updates on the topic of the vehicle that was given a new order last, whichever vehicle they are for."
        => fleet::<String>().sends(|served, _, _, out| {
            if out.is_new_order() {
                served.clone_from(&out.topic);
            } else if out.is_update() && !served.is_empty() { out.topic.clone_from(served); }
            true
        });
    fault "path-on-visualization" ["TOPIC-15"] "With every order it publishes a visualization message for the vehicle with the place where the order begins."
        => sending(|site, vehicle, out| {
            let position = out.message.get("nodes").and_then(|nodes| nodes.pointer("/0/nodePosition")).cloned();
            let topic = vehicle.topic("visualization").map(str::to_owned);
            if let Some(position) = position.filter(|_| out.name == "order") && let Some(topic) = topic {
                let mut message = site.header(vehicle, "visualization");
                let (x, y, map_id) = (&position["x"], &position["y"], &position["mapId"]);
                let place = json!({ "x": x, "y": y, "theta": 0.0, "mapId": map_id, "positionInitialized": true });
                message.set("agvPosition", place);
                site.push(topic, Value::Object(message).to_string().into_bytes(), 0, false);
            }
        });
    fault "announces-itself-online" ["TOPIC-15"] "Whenever it connects it publishes a retained ONLINE on the connection topics of its vehicles."
        => happening(|site, vehicle, event| {
            if let Event::Connected(_) = event && let Some(topic) = vehicle.topic("connection").map(str::to_owned) {
                let mut message = site.header(vehicle, "connection");
                message.set("connectionState", "ONLINE");
                site.push(topic, Value::Object(message).to_string().into_bytes(), 1, true);
            }
        });
    tolerance "clears-retained-order-topics" ["MQTT-02", "TOPIC-13"]
        "It publishes an empty retained message on order and instantActions when it starts, to clear leftovers."
        => happening(|site, vehicle, event| {
            if let Event::Connected(false) = event {
                for topic in ["order", "instantActions"].map(|name| vehicle.topic(name)).into_iter().flatten() { site.push(topic.to_owned(), Vec::new(), 0, true); }
            }
        });
    tolerance "heartbeat-outside-the-protocol" ["TOPIC-01", "TOPIC-15"] "It publishes a heartbeat of its own on a topic outside the tree of the protocol."
        => fleet::<Option<Moment>>().happens(|beat, site, vehicle, event| {
            if let Event::Looked = event {
                let now = site.now.moment;
                let due = *beat.get_or_insert(now);
                if due <= now {
                    *beat = Some(now + Duration::from_secs(10));
                    let text = json!({ "alive": true, "at": site.timestamp(vehicle) }).to_string();
                    site.push(format!("{}/alive", site.config.name), text.into_bytes(), 0, false);
                }
                vehicle.at(beat.unwrap_or(due));
            }
        });
}

fn without(options: &mut ConnectOptions, name: &str) {
    options
        .subscriptions
        .retain(|(topic, _)| topic.rsplit('/').next() != Some(name));
}

/// The filter for a topic of every vehicle: manufacturer and serial number are left open.
fn with_wildcards(topic: &str) -> String {
    let mut levels: Vec<&str> = topic.split('/').collect();
    let end = levels.len();
    if end >= 4 {
        levels[end - 2] = "+";
        levels[end - 3] = "+";
    }
    levels.join("/")
}

fn qos(outgoing: &mut Outgoing, qos: u8, when: bool) {
    if when {
        outgoing.qos = qos;
    }
}

type Topic = fn(&str, &str) -> String;

/// Publishes messages of a topic on another one, by the protocol version and the right topic.
fn misdirected(name: &'static str, topic: Topic) -> Box<dyn Deviation> {
    holding((name, topic)).sends(|(name, topic), _, vehicle, out| {
        if out.name == *name {
            out.topic = topic(&vehicle.config.version, &out.topic);
        }
        true
    })
}

fn instants_on(topic: Topic) -> Box<dyn Deviation> {
    misdirected("instantActions", topic)
}

fn orders_on(topic: Topic) -> Box<dyn Deviation> {
    misdirected("order", topic)
}
