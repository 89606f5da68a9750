//! Tolerances that are a matter of what the vehicle is like: how fast it is, what fits into it, how it connects (section 6.14
//! and 6.15).

use super::prelude::*;

records! {
    // Whoever is slow to answer is slow in all, else an order would be done before its cancellation is read.
    tolerance "answers-slowly" ["STATE-03", "ORD-FLOW-06"] "Looks at a message half a second after it came."
        => plain().configures(|config| {
            config.answers_after = Duration::from_millis(500);
            slower(config, 6.0);
        });
    tolerance "answers-very-slowly" ["STATE-03", "ORD-FLOW-06"] "Looks at a message four seconds after it came."
        => plain().configures(|config| {
            config.answers_after = Duration::from_secs(4);
            slower(config, 40.0);
        });
    tolerance "states-coalesced" ["STATE-11", "FACT-14"] "Sends no state within 0.4 s of another, so that changes share a state."
        => plain().configures(|config| {
            config.min_state_interval = Duration::from_millis(400);
            slower(config, 6.0);
        });
    tolerance "states-seldom" ["STATE-02"] "Sends a state only every 28 s when nothing happens."
        => plain().configures(|config| config.state_interval = Duration::from_secs(28));
    tolerance "states-often" ["STATE-02"] "Sends a state ten times a second, whatever happens."
        => plain().configures(|config| config.state_interval = Duration::from_millis(100));
    tolerance "state-every-second" ["STATE-02", "STATE-11"] "It sends a state every second even when nothing happens."
        => plain().configures(|config| config.state_interval = config.state_interval.min(Duration::from_secs(1)));
    tolerance "visualization-off" ["TOPIC-12"] "Publishes no visualization."
        => plain().configures(|config| config.visualization_interval = None);
    tolerance "visualization-often" ["TOPIC-12", "VIS-02"] "Publishes the visualization twenty times a second."
        => plain().configures(|config| config.visualization_interval = Some(Duration::from_millis(50)));
    tolerance "drives-slowly" ["ORD-06"] "Drives at a quarter of its speed."
        => plain().configures(|config| slower(config, 4.0));
    tolerance "actions-at-once" ["ASTATE-02"] "Performs its actions in no time, so that they are never seen running."
        => plain().configures(|config| {
            // What happens at a station takes the time it takes.
            for action in ["pick", "drop", "finePositioning", "detectObject"] {
                config.action_durations.insert(action.to_owned(), config.action_duration);
            }
            config.action_duration = Duration::ZERO;
        });
    tolerance "reconnects-at-once" ["MQTT-10"] "It connects again after 50 milliseconds when the connection is broken."
        => plain().configures(|config| config.reconnect_delay = Duration::from_millis(50));
    tolerance "reconnects-late" ["MQTT-10"] "Connects again eight seconds after a broken link."
        => plain().configures(|config| config.reconnect_delay = Duration::from_secs(8));
    tolerance "keep-alive-ten" ["CONN-04"] "The keep-alive is 10 s."
        => plain().configures(|config| config.keep_alive = Duration::from_secs(10));
    tolerance "keep-alive-20" ["CONN-04"] "Asks for a keep-alive of 20 s."
        => plain().configures(|config| config.keep_alive = Duration::from_secs(20));
    tolerance "little-fits" ["FACT-12"] "Takes ids of 14 characters, two actions at a place and in a message, and says so in its factsheet."
        => plain().configures(|config| {
            config.max_id = 14;
            config.max_actions = 2;
            config.max_instant_actions = 2;
        });
    tolerance "errors-stay" ["ERR-01"] "Keeps the errors of refused instant actions for half a minute."
        => plain().configures(|config| config.error_duration = Duration::from_secs(30));
    tolerance "limits-of-zero-in-factsheet" ["FACT-05", "FACT-11"] "It states 0 for all array and string limits in the factsheet because it has none."
        => unlimited();
    tolerance "newest-mqtt" ["MQTT-01"] "Connects with MQTT 5."
        => joining(|_, options| options.level = 5);
    tolerance "session-kept" ["MQTT-03"] "Asks the broker to keep its session."
        => joining(|_, options| options.clean_session = false);
    tolerance "subscribes-with-qos-1" ["MQTT-07"] "Subscribes with QoS 1."
        => joining(|_, options| options.subscriptions.iter_mut().for_each(|(_, qos)| *qos = 1));
    tolerance "client-id-changes" ["MQTT-01", "CONN-11"] "The vehicle takes another MQTT client identifier at every connection."
        => joining(|agv, options| options.client_id = format!("{}-{}", agv.config.serial_number, agv.connection.sessions));
    // Its own messages come back to it; it has no use for them.
    tolerance "subscribes-with-wildcard" ["TOPIC-10"] "The vehicle subscribes with one topic filter that ends in a wildcard."
        => joining(|_, options| {
            for (topic, _) in &mut options.subscriptions {
                if let Some((above, _)) = topic.rsplit_once('/') {
                    *topic = format!("{above}/+");
                }
            }
            options.subscriptions.dedup();
        });
    tolerance "header-id-restarts" ["HDR-02"] "Counts its messages from 0 again on every connection."
        => when(Event::Connected, |agv| agv.connection.header_ids.clear());
    tolerance "online-twice" ["CONN-05"] "Says ONLINE twice when it connects."
        => when(Event::Connected, |agv| agv.publish_connection("ONLINE"));
    tolerance "factsheet-on-request-only" ["FACT-01", "ACT-40"] "It publishes its factsheet when it is asked for, and not when it connects."
        => forbidding(|_, what| matches!(what, Permission::SayFactsheet));
    tolerance "factsheet-before-online" ["CONN-05", "TOPIC-11"] "On connecting the vehicle publishes its factsheet before it says ONLINE."
        => forbidding(|_, what| matches!(what, Permission::SayFactsheet)).happens(|_, agv, event| if event == Event::Connected { agv.publish_factsheet() });
    tolerance "factsheet-after-state" ["TOPIC-11", "FACT-01"] "On connecting the vehicle publishes its factsheet after the first state."
        => forbidding(|_, what| matches!(what, Permission::SayFactsheet)).happens(|_, agv, event| if event == Event::Reporting {
            agv.flush();
            agv.publish_factsheet();
        });
    tolerance "last-state-before-offline" ["CONN-07", "STATE-02"] "It sends a last state right before OFFLINE."
        => when(Event::Leaving, |agv| {
            agv.report.requested = true;
            agv.flush();
        });
    tolerance "network-told" ["FACT-10"] "It states its network data in the factsheet."
        => factsheet(|_, m| m.part("vehicleConfig", |config| config.set("network", json!({
            "dnsServers": ["10.1.0.1"],
            "ntpServers": ["10.1.0.2"],
            "localIpAddress": "10.1.0.20",
            "netmask": "255.255.255.0",
            "defaultGateway": "10.1.0.1",
        }))));
    tolerance "factsheet-lists-reversed" ["FACT-06", "FACT-07"] "Its factsheet lists its actions and optional parameters in reverse."
        => factsheet(|_, m| m.part("protocolFeatures", |features| {
            features.list("optionalParameters").reverse();
            features.list("agvActions").reverse();
        }));
    tolerance "optional-flag-omitted" ["FACT-07"] "It leaves isOptional out of the factsheet for parameters that are not optional."
        => factsheet(|_, m| m.part("protocolFeatures", |features| features.each("agvActions", |action| {
            action.each("actionParameters", |parameter| if parameter.says("isOptional", false) {
                parameter.unset("isOptional");
            });
        })));
}

/// Slows it down to this share of its usual pace. Of several reasons the slowest counts: a vehicle a hundred times slower than
/// usual is no good vehicle.
fn slower(config: &mut AgvConfig, times: f64) {
    let more = times / config.slowness;
    if more > 1.0 {
        config.slowness = times;
        config.speed /= more;
        config.rotation_speed /= more;
        config.action_duration = config.action_duration.mul_f64(more);
        // Whichever tolerance was taken first.
        for duration in config.action_durations.values_mut() {
            *duration = duration.mul_f64(more);
        }
    }
}

/// Takes whatever comes, and says 0 for every limit.
fn unlimited() -> Box<dyn Deviation> {
    factsheet(|agv, sheet| {
        // What else it takes in little would not be true then.
        if !agv.config.switched_on.contains(&"little-fits") {
            sheet.part("protocolLimits", |limits| {
                for list in ["maxStringLens", "maxArrayLens"] {
                    limits.part(list, |list| {
                        let limits = list.values_mut().filter(|limit| limit.is_number());
                        limits.for_each(|limit| *limit = json!(0));
                    });
                }
            });
        }
    })
    .configures(|config| {
        config.max_nodes = config.max_nodes.max(10_000);
        config.max_instant_actions = config.max_instant_actions.max(1_000);
        config.max_actions = config.max_actions.max(1_000);
    })
}
