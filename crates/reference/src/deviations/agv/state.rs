//! Deviations of what a state says about the order, the vehicle and its load (section 6.10).

use crate::agv::Mode;

use super::prelude::*;

records! {
    fault "permanent-power-not-full" ["STATE-MSG-20"] "Reports 80 percent although it gets its power from the floor all the time."
        => state(|agv, m| if agv.config.permanently_powered {
            m.part("batteryState", |battery| battery.set("batteryCharge", 80.0));
        });
    fault "permanent-power-falls-on-the-way" ["STATE-MSG-20"] "Reports 99 percent while it drives although it gets its power from the floor all the time."
        => state(|agv, m| if agv.config.permanently_powered && agv.motion.is_moving() {
            m.part("batteryState", |battery| battery.set("batteryCharge", 99.0));
        });
    fault "field-misspelled" ["JSON-01", "STATE-MSG-01"] "Spells operatingMode with an underscore."
        => state(|_, m| m.rename("operatingMode", "operating_mode"));
    fault "empty-lists-null" ["JSON-10", "JSON-06", "STATE-MSG-01"] "Writes null for lists of nodes, edges and actions that are empty."
        => state(|_, m| for list in ["nodeStates", "edgeStates", "actionStates"] {
            if m.says(list, json!([])) {
                m.set(list, Value::Null);
            }
        });

    fault "order-id-reset-when-done" ["STATE-MSG-02", "ORD-CANCEL-08"] "Empties the orderId when the order is complete."
        => state(|agv, m| if is_done(agv) { m.set("orderId", "") });
    fault "order-id-forgotten-on-request" ["STATE-MSG-02", "STATE-13"] "Answers a stateRequest without its orderId."
        => state(|agv, m| if agv.report.answers_request() { m.set("orderId", "") });
    fault "no-order-null" ["JSON-06", "STATE-MSG-02", "STATE-MSG-01"] "Before its first order it reports null as orderId."
        => state(|agv, m| if !agv.order.has_order() { m.set("orderId", Value::Null) });
    fault "order-id-prefixed" ["ORD-FLOW-06", "STATE-MSG-02"] "Shows orderIds with its own serial number in front."
        => state(|_, m| text(m, "orderId", |id| if id.is_empty() { String::new() } else { format!("7-{id}") }));
    fault "order-id-cut-at-32" ["ORD-FLOW-06", "STATE-MSG-02"] "It keeps an orderId in a buffer of 32 characters, so that a longer one (such as a UUID) is reported cut off."
        => state(|_, m| text(m, "orderId", |id| id.chars().take(32).collect()));
    fault "update-id-reset-when-done" ["STATE-MSG-02"] "Sets the orderUpdateId back to 0 when the order is complete."
        => state(|agv, m| if is_done(agv) { m.set("orderUpdateId", 0) });
    fault "update-id-counted" ["ORD-FLOW-09", "STATE-MSG-02"] "Shows an orderUpdateId that is one too high once an update was taken over."
        => state(|agv, m| if agv.order.update_id > 0 { m.set("orderUpdateId", agv.order.update_id + 1) });
    fault "zone-set-invented" ["ORD-MSG-04", "STATE-MSG-03"] "Goes over to a zone set of its own when an order names one."
        => state(|agv, m| if agv.order.zoned && agv.config.zone_set.is_some() { m.set("zoneSetId", "factory") });

    fault "last-node-cleared-when-done" ["STATE-MSG-04"] "Empties the lastNodeId when the order is complete."
        => state(|agv, m| if is_done(agv) { m.set("lastNodeId", "") });
    fault "last-node-unknown-on-request" ["STATE-MSG-04"] "Answers a stateRequest without its last node."
        => state(|agv, m| if agv.report.answers_request() { m.set("lastNodeId", "") });
    fault "last-node-is-next-node" ["STATE-MSG-04", "NODE-03"] "On an edge the vehicle reports the node it drives to as lastNodeId and lastNodeSequenceId."
        because "lastNodeId and what is left of the route contradict each other; which of them is wrong cannot be told, so that NODE-03 is warned of."
        => state(|agv, m| if let Some(ahead) = agv.order.nodes.front().filter(|_| agv.order.entered) {
            m.set("lastNodeId", ahead.node.id.clone());
            m.set("lastNodeSequenceId", ahead.node.sequence_id);
        });
    fault "last-node-after-actions" ["NODE-03", "STATE-MSG-04"] "It removes the node state at a node with actions but sets lastNodeId and lastNodeSequenceId when the actions have ended."
        => state(|agv, m| {
            let here = Origin::Node(agv.order.last_sequence);
            let (node, sequence) = &agv.order.previous;
            if !node.is_empty() && agv.actions.iter().any(|action| action.origin == here && !action.status.is_terminal()) {
                m.set("lastNodeId", node.clone());
                m.set("lastNodeSequenceId", *sequence);
            }
        });
    fault "last-sequence-reset-when-done" ["STATE-MSG-04"] "When its order is complete it reports lastNodeSequenceId 0."
        => state(|agv, m| if is_done(agv) { m.set("lastNodeSequenceId", 0) });
    fault "last-sequence-counts-nodes" ["STATE-MSG-04", "NODE-03"] "It counts only nodes in lastNodeSequenceId: 1 at the second node of an order instead of 2."
        => state(|agv, m| m.set("lastNodeSequenceId", agv.order.last_sequence / 2));
    fault "last-sequence-minus-one" ["JSON-09", "STATE-MSG-04"] "Before its first order the vehicle reports lastNodeSequenceId -1."
        => state(|agv, m| if !agv.order.has_order() { m.set("lastNodeSequenceId", -1) });
    fault "distance-not-reset" ["STATE-MSG-18"] "Counts the distance since its last node from the beginning of its order." because "It breaks a recommendation only."
        => keep::<Option<(f64, f64)>>()
            .happens(|begun, agv, event| if event == Event::Begun {
                let pose = agv.motion.pose(agv.moment());
                *begun = Some((pose.x, pose.y));
            })
            .says(|begun, agv, part, m| {
                if let (Part::State, Some((x, y))) = (part, *begun) {
                    m.set("distanceSinceLastNode", agv.motion.pose(agv.moment()).distance(x, y));
                }
                true
            });
    fault "distance-negative" ["STATE-MSG-18"] "Reports a negative distance since the last node." because "It breaks a recommendation only."
        => state(|_, m| m.set("distanceSinceLastNode", -1.0));

    fault "driving-as-text" ["JSON-07", "JSON-10", "STATE-MSG-08"] "Sends driving as a word in quotes."
        => state(|_, m| m.change("driving", |driving| *driving = Value::String(driving.to_string())));
    fault "driving-unreported" ["STATE-MSG-08", "STATE-08"] "Never says that it drives."
        => state(|_, m| m.set("driving", false));
    fault "turns-without-driving" ["STATE-MSG-08"] "Does not say that it drives while it turns on the spot."
        => state(|agv, m| if agv.motion.is_turning() { m.set("driving", false) });
    fault "turning-not-driving" ["STATE-MSG-08"] "It reports driving as false while it turns on the spot."
        => state(|agv, m| {
            let velocity = agv.motion.velocity();
            if velocity.vx == 0.0 && velocity.omega != 0.0 {
                m.set("driving", false);
            }
        });
    fault "slow-drive-not-driving" ["STATE-MSG-08"] "It reports driving false while it drives slower than 0.75 m/s."
        => state(|agv, m| {
            let vx = agv.motion.velocity().vx;
            if vx != 0.0 && vx.abs() < 0.75 {
                m.set("driving", false);
            }
        });
    fault "driving-while-waiting" ["STATE-MSG-08"] "Says that it drives when its order is done."
        => state(|agv, m| if agv.order.nodes.is_empty() && agv.order.has_order() { m.set("driving", true) });
    fault "driving-at-decision-point" ["ORD-UPD-01", "STATE-MSG-08"] "Says that it drives while it waits at the decision point."
        => state(|agv, m| if agv.waits_at_decision_point() { m.set("driving", true) });
    fault "driving-kept" ["STATE-MSG-08", "STATE-08", "ORD-UPD-01"] "Says that it drives from its first order on, also when it stands."
        => state(|agv, m| if agv.order.has_order() { m.set("driving", true) });
    fault "driving-in-pause" ["ACT-12", "ACT-15", "STATE-MSG-08"] "Says that it drives as long as it is paused with an order."
        => state(|agv, m| if agv.holds.pause && !agv.order.nodes.is_empty() { m.set("driving", true) });
    fault "driving-while-lifting" ["STATE-MSG-08", "BLOCK-03", "BLOCK-04"] "Says that it drives while it lifts."
        => state(|agv, m| if agv.is_lifting() { m.set("driving", true) });
    fault "pause-flag-missing" ["ACT-13"] "Does not report that it is paused."
        => state(|_, m| m.unset("paused"));
    fault "button-pause-unreported" ["ACT-17"] "Does not report a pause made with the button."
        => state(|agv, m| if !agv.holds.pause { m.set("paused", agv.holds.emergency) });
    fault "pause-unreported-when-idle" ["ACT-13"] "Paused without an order, it reports the startPause FINISHED but paused as false."
        => state(|agv, m| if is_done(agv) { m.set("paused", agv.holds.button || agv.holds.emergency) });
    fault "new-base-request-always" ["STATE-16"] "Asks for a new base all the time." because "It breaks a recommendation only."
        => state(|_, m| m.set("newBaseRequest", true));
    fault "base-request-outlives-update" ["STATE-20"] "It asks for a new base for two more seconds when an update has come." because "The moment of the change inside the vehicle is not seen, so that a late state is remarked on."
        => keep::<Option<Moment>>()
            .happens(|until, agv, event| match event {
                Event::Updated => *until = Some(agv.moment() + Duration::from_secs(2)),
                Event::Begun => *until = None,
                _ => {}
            })
            .says(|until, agv, part, m| {
                if until.is_some_and(|until| agv.moment() < until) && matches!(part, Part::State) {
                    m.set("newBaseRequest", true);
                }
                true
            });
    fault "instant-actions-in-both-lists" ["IACT-STATE-03"] "It lists instant actions among the actions of its order, too."
        => state(|_, m| for action in m.list("instantActionStates").to_vec() { m.add("actionStates", action); });
    fault "order-actions-in-both-lists" ["IACT-STATE-03"] "It lists the actions of its order among the instant actions, too."
        => state(|_, m| for action in m.list("actionStates").to_vec() { m.add("instantActionStates", action); });
    fault "foreign-node-on-the-way" ["NODE-09"] "It names a tag beside its way as its last node while it drives an order."
        => state(|agv, m| if agv.order.entered && !agv.order.nodes.is_empty() {
            m.set("lastNodeId", "tag-17");
        });
    fault "new-base-request-stays" ["STATE-16"] "Asks for a new base until its next order, once it has done so." because "It breaks a recommendation only."
        => keep::<bool>()
            .happens(|asked, agv, event| match event {
                Event::Begun | Event::PowerCycled => *asked = false,
                Event::Settled => *asked |= agv.order.base_runs_low(),
                _ => {}
            })
            .says(|asked, _, part, m| {
                if *asked && matches!(part, Part::State) {
                    m.set("newBaseRequest", true);
                }
                true
            });

    fault "position-omitted-in-manual" ["MODE-06", "STATE-MSG-05"] "In MANUAL the states carry no agvPosition."
        => state(|agv, m| if agv.mode == Mode::Manual { m.unset("agvPosition") });
    fault "no-position-at-standstill" ["STATE-MSG-05"] "It leaves agvPosition out of the state while it stands still without an order."
        => state(|agv, m| if is_done(agv) && !agv.motion.is_moving() { m.unset("agvPosition") });
    fault "maps-reported-empty" ["MAP-15", "MAP-20"] "Reports no maps although it drives on one."
        => state(|_, m| m.change("maps", |maps| *maps = json!([])));
    fault "map-status-misspelled" ["MAP-12", "MAP-24"] "Says ACTIVE where ENABLED is meant."
        => state(|_, m| m.each("maps", |map| text(map, "mapStatus", |status| status.replace("ENABLED", "ACTIVE"))));
    fault "map-listed-twice" ["MAP-07"] "Lists the map it uses twice."
        => state(|_, m| if let Some(first) = m.list("maps").first().cloned() { m.add("maps", first) });

    fault "loads-always-empty" ["STATE-MSG-06", "ACT-28"] "Reports no load although it carries one."
        => state(|_, m| m.set("loads", json!([])));
    fault "loads-omitted-when-empty" ["STATE-MSG-06"] "It reports loads while it carries one, and leaves the field out when it is unloaded."
        => state(|agv, m| if agv.loads.is_empty() { m.unset("loads") });
    fault "load-weight-negative" ["STATE-MSG-07"] "Reports a negative weight of its load."
        => state(|_, m| m.each("loads", |load| load.set("weight", -1.0)));
    fault "load-position-unlisted" ["FACT-09", "STATE-MSG-07"] "It reports a load on a loadPosition that its factsheet does not list."
        => state(|_, m| m.each("loads", |load| load.set("loadPosition", "1")));
    fault "load-width-missing" ["STATE-MSG-07", "JSON-10"] "The loadDimensions of its load have no width."
        => state(|_, m| m.each("loads", |load| load.part("loadDimensions", |size| size.unset("width"))));

    fault "charge-missing" ["STATE-MSG-15", "JSON-10"] "Leaves the charge out of its battery state."
        => state(|_, m| m.part("batteryState", |b| b.unset("batteryCharge")));
    fault "charge-as-a-share" ["STATE-MSG-15"] "Gives its charge as a share of one."
        because "A charge of at most one percent is possible, so that it is no more than remarked."
        => state(|_, m| m.part("batteryState", |b| b.change("batteryCharge", |charge| *charge = json!(charge.as_f64().unwrap_or_default() / 100.0))));
    fault "charge-good-bad" ["STATE-MSG-16"] "Knows good and bad charge only, and calls them 100 and 0 percent."
        => state(|agv, m| m.part("batteryState", |b| b.set("batteryCharge", if agv.motion.is_moving() { 0.0 } else { 100.0 })));
    fault "battery-health-unknown" ["STATE-MSG-15", "JSON-09"] "It reports an unknown battery health as 255."
        => state(|_, m| m.part("batteryState", |b| b.set("batteryHealth", 255)));
    fault "boolean-as-text" ["JSON-07", "STATE-MSG-15", "ACT-19"] "Sends charging as a word in quotes."
        => state(|_, m| m.part("batteryState", |b| b.change("charging", |charging| *charging = Value::String(charging.to_string()))));
    fault "reach-minus-one" ["STATE-MSG-15", "JSON-09"] "batteryState.reach is -1 for unknown."
        => state(|_, m| m.part("batteryState", |b| b.set("reach", -1)));
    fault "reach-fractional" ["JSON-09", "STATE-MSG-15", "JSON-06"] "Estimates its reach in fractions of a metre."
        => state(|_, m| m.part("batteryState", |b| b.set("reach", 8_000.5)));

    fault "mode-missing" ["STATE-MSG-01", "STATE-01", "JSON-10"] "Leaves operatingMode out of its states."
        => state(|_, m| m.unset("operatingMode"));
    fault "mode-numeric" ["MODE-01", "JSON-10", "JSON-06"] "Gives a number as its operating mode."
        => state(|agv, m| m.set("operatingMode", agv.mode as u8));
    fault "mode-lower-case" ["JSON-02", "MODE-01"] "Spells the operating mode in lower case."
        => state(|_, m| text(m, "operatingMode", str::to_ascii_lowercase));
    fault "semiautomatic-underscore" ["MODE-01", "JSON-02"] "It reports the mode SEMIAUTOMATIC as SEMI_AUTOMATIC."
        => state(|_, m| text(m, "operatingMode", |mode| mode.replace("SEMIAUTOMATIC", "SEMI_AUTOMATIC")));
    fault "mode-off-by-one" ["MODE-01", "STATE-07"] "Takes every operating mode but AUTOMATIC for the next one on the list."
        => state(|agv, m| m.set("operatingMode", match agv.mode {
            Mode::Automatic | Mode::Startup => "AUTOMATIC",
            Mode::Semiautomatic | Mode::Intervened => "MANUAL",
            Mode::Manual => "SERVICE",
            Mode::Service => "TEACHIN",
            Mode::Teachin => "SEMIAUTOMATIC",
        }));

    fault "safety-state-missing" ["STATE-MSG-01", "STATE-01"] "Leaves safetyState out of its states."
        => state(|_, m| m.unset("safetyState"));
    fault "emergency-stop-unreported" ["STATE-MSG-17"] "Does not report an emergency stop."
        => state(|agv, m| m.part("safetyState", |s| s.set("eStop", if agv.holds.field { "AUTOACK" } else { "NONE" })));
    fault "emergency-stop-spelled" ["STATE-MSG-17", "JSON-02"] "Says Off where no emergency stop is active."
        => state(|_, m| m.part("safetyState", |s| text(s, "eStop", |stop| stop.replace("NONE", "Off"))));
    fault "emergency-stop-null" ["STATE-MSG-17", "JSON-10", "JSON-02"] "Writes null where no emergency stop is active."
        => state(|_, m| m.part("safetyState", |s| if s.says("eStop", "NONE") { s.set("eStop", Value::Null) }));
    fault "auto-ack-mixed-case" ["JSON-02", "STATE-MSG-17"] "While its field is violated it reports the e-stop as AutoAck."
        => state(|_, m| m.part("safetyState", |s| text(s, "eStop", |stop| stop.replace("AUTOACK", "AutoAck"))));
    fault "e-stop-lower-case" ["JSON-01", "STATE-MSG-17"] "It writes the member eStop of safetyState as estop."
        => state(|_, m| m.part("safetyState", |s| s.rename("eStop", "estop")));
    fault "field-violation-counted" ["JSON-07", "STATE-MSG-17"] "While its field is violated it reports fieldViolation as the number 1."
        => state(|agv, m| if agv.holds.field { m.part("safetyState", |s| s.set("fieldViolation", 1)) });
    fault "field-violation-unreported" ["STATE-MSG-17"] "It keeps fieldViolation false while something stands in its protective field."
        => state(|_, m| m.part("safetyState", |s| s.set("fieldViolation", false)));

    fault "info-level-warning" ["INFO-01", "JSON-02"] "Reports an information with the level WARNING."
        => state(|_, m| m.set("information", json!([{ "infoType": "service", "infoLevel": "WARNING" }])));
    fault "info-references-as-map" ["INFO-01", "BP-04"] "The infoReferences of an information entry are an object of keys and values instead of an array."
        => state(|agv, m| if agv.is_flashing() { m.each("information", |info| info.set("infoReferences", json!({ "device": "lights" }))) });
    fault "info-type-missing" ["INFO-01"] "The information that its warning lights are on has no infoType."
        => state(|agv, m| if agv.is_flashing() { m.set("information", json!([{ "infoDescription": "warning lights on", "infoLevel": "INFO" }])) });
}
