//! Deviations of the link: how it is made, lost and left, and what the connection topic says (sections 6.3 and 6.14).

use crate::ConnectOptions;

use super::prelude::*;

records! {
    fault "old-mqtt" ["MQTT-01"] "Connects with MQTT 3.1."
        => joining(|_, options| options.level = 3);
    fault "keep-alive-off" ["CONN-04"] "Connects with the keep-alive off." because "It breaks a recommendation only."
        => joining(|_, options| options.keep_alive = Duration::ZERO);
    fault "keep-alive-long" ["CONN-04"] "Connects with a keep-alive of ten minutes." because "It breaks a recommendation only."
        => joining(|_, options| options.keep_alive = Duration::from_secs(600));
    fault "instant-actions-not-subscribed" ["TOPIC-10"] "Does not subscribe to instantActions."
        => joining(|agv, options| unsubscribe(agv, options, "instantActions"));
    fault "instant-actions-not-subscribed-again" ["TOPIC-10", "MQTT-10"] "After a reconnect it subscribes to the topic order only, and instant actions do not reach it any more."
        => joining(|agv, options| if agv.connection.was_online() { unsubscribe(agv, options, "instantActions") });
    fault "reconnect-without-orders" ["MQTT-10", "TOPIC-10"] "It subscribes again to instantActions after a reconnect but no longer to order."
        => joining(|agv, options| if agv.connection.was_online() { unsubscribe(agv, options, "order") });
    fault "not-subscribed-again" ["TOPIC-10", "MQTT-10"] "Does not subscribe again when it reconnects."
        => joining(|agv, options| if agv.connection.was_online() { options.subscriptions.clear() });
    fault "zone-topics-not-subscribed-again" ["TOPIC-16", "REQ-06", "ZSET-01", "MQTT-10"] "After a reconnect it subscribes to orders and instant actions only, and neither zone sets nor responses reach it any more."
        => joining(|agv, options| if agv.connection.was_online() {
            unsubscribe(agv, options, "zoneSet");
            unsubscribe(agv, options, "responses");
        });
    fault "no-will" ["CONN-01", "CONN-02", "CONN-03"] "Connects without a last will."
        => joining(|_, options| options.will = None);
    fault "will-forgotten-on-reconnect" ["CONN-01", "CONN-02"] "It registers a last will at its first connection only, and connects again without one."
        => joining(|agv, options| if agv.connection.was_online() { options.will = None });
    fault "will-on-state-topic" ["CONN-01"] "Registers its last will on the state topic."
        => joining(|agv, options| if let (Some(will), Some(topic)) = (&mut options.will, agv.config.topic("state")) { topic.clone_into(&mut will.topic) });
    fault "will-qos-0" ["CONN-03"] "Registers its last will with QoS 0."
        => joining(|_, options| if let Some(will) = &mut options.will { will.qos = 0 });
    fault "will-not-retained" ["CONN-03", "CONN-06"] "Registers its last will without the retain flag."
        => joining(|_, options| if let Some(will) = &mut options.will { will.retain = false });
    fault "will-offline" ["CONN-02"] "Says OFFLINE in its last will."
        => will(|m| m.set("connectionState", "OFFLINE"));
    fault "connection-state-underscore" ["CONN-02", "CONN-10", "JSON-02"] "Spells CONNECTIONBROKEN with an underscore, and without one where it has one."
        => will(|m| {
            let has_one = m.says("connectionState", "CONNECTION_BROKEN");
            m.set("connectionState", if has_one { "CONNECTIONBROKEN" } else { "CONNECTION_BROKEN" });
        });
    fault "will-without-header" ["CONN-02", "HDR-01"] "Leaves the header out of its last will."
        => will(|m| m.retain(|key, _| key == "connectionState"));
    fault "will-header-id-missing" ["CONN-02", "HDR-01"] "It registers a last will without headerId."
        => will(|m| m.unset("headerId"));

    fault "connection-state-connected" ["CONN-10", "CONN-05", "JSON-02"] "Says CONNECTED instead of ONLINE."
        => sending(|_, out| if is_online(out) { out.message.set("connectionState", "CONNECTED") });
    fault "no-online" ["CONN-05", "CONN-11", "TOPIC-11"] "Never says that it is ONLINE."
        => unsaid(|_, name, body| name == "connection" && body.says("connectionState", "ONLINE"));
    fault "no-online-after-reconnect" ["CONN-11"] "Says ONLINE only the first time it connects."
        => unsaid(|agv, name, body| name == "connection" && body.says("connectionState", "ONLINE") && agv.connection.sessions > 1);
    fault "online-not-said-mid-order" ["CONN-11", "CONN-05"] "After a reconnect in the middle of an order the vehicle does not publish ONLINE, so that CONNECTIONBROKEN stays."
        => unsaid(|agv, name, body| name == "connection" && body.says("connectionState", "ONLINE") && agv.connection.sessions > 1 && agv.is_busy());
    fault "no-offline" ["CONN-07"] "Disconnects without saying OFFLINE."
        => unsaid(|_, name, body| name == "connection" && body.says("connectionState", "OFFLINE"));
    fault "offline-skipped-mid-order" ["CONN-07"] "It is switched off without a message OFFLINE when an order is active."
        => unsaid(|agv, name, body| name == "connection" && body.says("connectionState", "OFFLINE") && agv.is_busy());
    fault "offline-repeats-header-id" ["HDR-02"] "It sends OFFLINE with the headerId of the ONLINE before it."
        => when(Event::Leaving, |agv| agv.connection.repeat_header_id("connection"));
    fault "offline-then-broken" ["CONN-10", "CONN-08"] "Says CONNECTIONBROKEN itself after OFFLINE."
        => when(Event::Left, |agv| agv.publish_connection("CONNECTIONBROKEN"));
    fault "will-of-first-vehicle" ["CONN-01", "CONN-02"] "Topic and header of its last will are those of another vehicle, the first one of the fleet."
        => joining(|agv, options| if let Some(will) = &mut options.will {
            let own = format!("/{}/", agv.config.serial_number);
            will.topic = will.topic.replace(&own, "/AGV-001/");
            if let Ok(Value::Object(mut words)) = serde_json::from_slice(&will.payload) {
                words.set("serialNumber", "AGV-001");
                will.payload = Value::Object(words).to_string().into();
            }
        });
    fault "no-disconnect" ["CONN-08"] "Closes the socket after OFFLINE without a DISCONNECT."
        => plain().allows(|(), _, what, usual| usual && !matches!(what, Permission::Disconnect));
    fault "connection-qos-0" ["MQTT-08"] "Publishes the connection topic with QoS 0."
        => sending(|_, out| if out.name == "connection" { out.qos = 0 });
    fault "connection-not-retained" ["CONN-06"] "Publishes ONLINE and OFFLINE without the retain flag."
        => sending(|_, out| if out.name == "connection" { out.retain = false });
    fault "offline-qos-zero" ["MQTT-08"] "It publishes ONLINE with QoS 1 but OFFLINE with QoS 0."
        => sending(|_, out| if is_offline(out) { out.qos = 0 });
    fault "offline-not-retained" ["CONN-06"] "It publishes OFFLINE without the retain flag, so that the broker keeps ONLINE."
        => sending(|_, out| if is_offline(out) { out.retain = false });
    fault "online-not-retained-again" ["CONN-06", "CONN-11"] "The ONLINE after a reconnect has no retain flag, so that CONNECTIONBROKEN stays at the broker."
        => sending(|agv, out| if out.name == "connection" && !is_offline(out) && agv.connection.sessions > 1 { out.retain = false });
    fault "reconnect-announced" ["CONN-10", "CONN-11"] "It publishes the connectionState RECONNECTING before ONLINE after a broken connection."
        => when(Event::Connected, |agv| if agv.connection.sessions > 1 { agv.publish_connection("RECONNECTING") });

    fault "header-id-reset-by-reconnect" ["HDR-02"] "Counts from 0 again after a link that was only broken." because "The text leaves open where the count begins; the ruling of HDR-02 makes a new count after a mere reconnect a warning."
        => when(Event::Connected, |agv| agv.connection.header_ids.clear());
    fault "warnings-gone-by-reconnect" ["ERR-01", "ORD-REJ-03", "ORD-REJ-08"] "It forgets all active errors when it reconnects, though no new order was accepted and nothing was put right."
        => when(Event::Connected, |agv| if agv.connection.sessions > 1 { agv.errors.clear() });
    fault "node-actions-repeated-after-reconnect" ["ASTATE-06", "MQTT-03"] "After a reconnect in the middle of an order the vehicle sets the finished actions of the node it stands at or left last back to WAITING and performs them again."
        => when(Event::Connected, |agv| if agv.connection.sessions > 1 && agv.is_busy() { agv.repeat_actions(agv.order.last_sequence) });
    fault "reconnect-loses-downloaded-maps" ["MAP-31", "MAP-15"] "It reports only its factory maps after a reconnect; downloaded maps are gone without deleteMap."
        => when(Event::Connected, |agv| if agv.connection.sessions > 1 {
            let factory = agv.config.maps.iter().map(|map| (&map.map_id, &map.map_version)).collect::<Vec<_>>();
            agv.maps.all.retain(|map| factory.contains(&(&map.map_id, &map.map_version)));
        });
    fault "never-reconnects" ["MQTT-10"] "Does not connect again after a broken link."
        because "MQTT-10 is a recommendation and never more than a warning."
        => when(Event::ConnectionLost, |agv| agv.connection.shut_down = true);
    fault "order-forgotten-on-link-loss" ["MQTT-03", "STATE-MSG-02"] "Throws its order away when the link breaks."
        => when(Event::ConnectionLost, |agv| {
            agv.give_up_order();
            agv.order.order_id.clear();
        });
    fault "update-forgotten-on-link-loss" ["MQTT-03", "STATE-12", "STATE-MSG-13"] "Goes back to the first orderUpdateId of its order when the link breaks."
        => when(Event::ConnectionLost, |agv| agv.order.update_id = 0);
    fault "actions-forgotten-on-link-loss" ["MQTT-03", "STATE-MSG-10"] "Forgets the actions of its order when the link breaks."
        => when(Event::ConnectionLost, |agv| agv.actions.retain(|action| !action.of_order()));
    fault "ended-actions-lost-with-link" ["STATE-MSG-10", "MQTT-03", "STATE-MSG-09"] "After a broken link its states do not list the actions that had ended before."
        => when(Event::ConnectionLost, |agv| agv.actions.retain(|action| !action.status.is_terminal()));
    fault "running-actions-fail-with-link" ["MQTT-04", "MQTT-03"] "It breaks off the running actions of its order and reports them FAILED when the link to the broker is lost."
        => when(Event::ConnectionLost, |agv| {
            let of_order = agv.actions.iter_mut().filter(|action| action.of_order());
            of_order.filter(|action| action.status.is_active()).for_each(|action| action.end(Status::Failed));
        });
    fault "horizon-lost-with-link" ["MQTT-03", "MQTT-05", "STATE-12"] "When the link breaks it keeps the base of its order and throws the horizon away."
        => when(Event::ConnectionLost, |agv| {
            let gone = agv.order.drop_horizon();
            agv.actions.retain(|action| match action.origin {
                Origin::Node(id) | Origin::Edge(id) => !gone.contains(&id),
                Origin::Instant | Origin::Zone(_) => true,
            });
        });
    fault "load-forgotten-with-link" ["STATE-MSG-06"] "After the link broke the vehicle reports no loads although it still carries one."
        => when(Event::ConnectionLost, |agv| agv.loads.clear());
    fault "cancelled-id-lost-with-link" ["ORD-CANCEL-08", "STATE-MSG-02"] "After a cancellation the orderId becomes empty as soon as the link breaks once."
        => when(Event::ConnectionLost, |agv| if agv.order.cancelled { agv.order.order_id.clear() });
    fault "pause-lost-on-link-loss" ["ACT-12", "ACT-13"] "Ends its pause when the link breaks."
        => when(Event::ConnectionLost, |agv| agv.set_holds(|holds| holds.pause = false));
}

/// Does not subscribe to a topic.
fn unsubscribe(agv: &Agv, options: &mut ConnectOptions, name: &str) {
    let topic = agv.config.topic(name);
    options
        .subscriptions
        .retain(|(filter, _)| Some(filter.as_str()) != topic);
}

fn is_online(out: &Outgoing) -> bool {
    out.name == "connection" && out.message.says("connectionState", "ONLINE")
}

fn is_offline(out: &Outgoing) -> bool {
    out.name == "connection" && out.message.says("connectionState", "OFFLINE")
}
