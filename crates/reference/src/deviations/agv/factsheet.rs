//! Deviations of what the factsheet says (section 6.15).

use crate::agv::config::MAX_INSTANT_ACTIONS;

use super::prelude::*;

records! {
    fault "factsheet-without-limits" ["FACT-02", "FACT-05"] "Leaves protocolLimits out of the factsheet."
        => sending(|_, out| if out.name == "factsheet" { out.message.unset("protocolLimits") });
    fault "factsheet-without-geometry" ["FACT-02"] "The factsheet has no agvGeometry."
        => sending(|_, out| if out.name == "factsheet" { out.message.unset("agvGeometry") });
    fault "factsheet-kinematics-unknown" ["FACT-03", "JSON-02"] "Gives DIFFERENTIAL as its kinematics."
        => factsheet(|_, m| m.part("typeSpecification", |t| t.set("agvKinematic", "DIFFERENTIAL")));
    fault "factsheet-without-action-flags" ["FACT-07"] "Its factsheet does not say of any action whether it can be paused or cancelled."
        => factsheet(|_, m| m.part("protocolFeatures", |features| features.each("agvActions", |action| {
            action.unset("pauseAllowed");
            action.unset("cancelAllowed");
        })));
    fault "class-unknown" ["FACT-03"] "Its factsheet gives its agvClass as AMR."
        => factsheet(|_, m| m.part("typeSpecification", |t| t.set("agvClass", "AMR")));
    fault "localization-types-as-text" ["FACT-03"] "It gives localizationTypes in the factsheet as a single string instead of an array."
        => factsheet(|_, m| m.part("typeSpecification", |t| t.set("localizationTypes", "NATURAL")));
    fault "factsheet-without-size" ["FACT-04", "JSON-10"] "Leaves width and length out of the factsheet."
        => factsheet(|_, m| m.part("physicalParameters", |p| {
            p.unset("width");
            p.unset("length");
        }));
    fault "speed-min-above-max" ["FACT-04"] "States a lowest speed above its highest." because "A contradiction within the factsheet is remarked on; no sentence forbids it."
        => factsheet(|agv, m| m.part("physicalParameters", |p| p.set("speedMin", agv.config.speed + 1.0)));
    fault "factsheet-without-timing" ["FACT-05", "JSON-10"] "Leaves the timing out of its limits."
        => factsheet(|_, m| m.part("protocolLimits", |l| l.unset("timing")));
    fault "min-state-interval-ignored" ["FACT-14"] "States a minimum interval of five seconds and does not keep it." because "FACT-14 contradicts the sending on events; its ruling leaves a warning."
        => factsheet(|_, m| timing(m, |t| t.set("minStateInterval", 5.0)));
    fault "factsheet-times-in-milliseconds" ["FACT-14", "FACT-05"] "It gives minOrderInterval and minStateInterval in milliseconds, so that its states come far more often than it promises."
        because "FACT-14 contradicts the sending on events, so that its ruling leaves a warning."
        => factsheet(|_, m| timing(m, |t| {
            // Never 0: that would promise nothing.
            let state = t.get("minStateInterval").and_then(Value::as_f64).unwrap_or_default();
            t.set("minStateInterval", state.max(0.1) * 1000.0);
            let order = t.get("minOrderInterval").and_then(Value::as_f64).unwrap_or_default();
            t.set("minOrderInterval", order * 1000.0);
        }));
    fault "states-closer-than-stated" ["FACT-14", "STATE-11"] "It states a minimum interval of half a second, and sends a state for each change, several at once on a node."
        because "FACT-14 contradicts the sending on events, so that its ruling leaves a warning."
        => factsheet(|_, m| timing(m, |t| t.set("minStateInterval", 0.5))).happens(|_, agv, event| {
            if matches!(event, Event::NodeNoted(_) | Event::NodePassed(_) | Event::EdgeEntered(_)) {
                agv.flush();
            }
        });
    fault "own-limit-exceeded" ["FACT-11"] "States room for one action in its states and sends more."
        => factsheet(|_, m| one_action_state(m));
    fault "array-limits-nested" ["FACT-05", "JSON-10"] "Its factsheet gives the array limits of orders as nested objects and not under names with a dot."
        => factsheet(|agv, m| {
            let nodes = agv.config.max_nodes;
            let nested = json!({
                "order": { "nodes": nodes, "edges": nodes.saturating_sub(1) },
                "instantActions": MAX_INSTANT_ACTIONS,
            });
            m.part("protocolLimits", |l| l.set("maxArrayLens", nested));
        });

    fault "optional-parameters-missing" ["OPT-04", "FACT-06"] "Leaves optionalParameters out of the factsheet."
        => factsheet(|_, m| m.part("protocolFeatures", |f| f.unset("optionalParameters")));
    fault "factsheet-support-yes" ["FACT-06"] "Says YES where the support of a parameter is asked for."
        => factsheet(|_, m| m.part("protocolFeatures", |f| f.each("optionalParameters", |p| p.set("support", "YES"))));
    fault "optional-parameters-as-names" ["FACT-06"] "optionalParameters of the factsheet is a plain list of names."
        => factsheet(|_, m| m.part("protocolFeatures", |f| {
            f.list("optionalParameters").iter_mut().for_each(|parameter| *parameter = parameter["parameter"].take());
        }));
    fault "factsheet-action-missing" ["FACT-07"] "Offers cancelOrder but does not list it." because "An action that is accepted but not listed is reported, not failed: the vehicle does more than it claims."
        => factsheet(|_, m| m.part("protocolFeatures", |f| f.keep("agvActions", |a| a.text("actionType") != "cancelOrder")));
    fault "state-request-unlisted" ["FACT-07"] "Offers stateRequest but does not list it." because "An action that is accepted but not listed is reported, not failed: the vehicle does more than it claims."
        => factsheet(|_, m| m.part("protocolFeatures", |f| f.keep("agvActions", |a| a.text("actionType") != "stateRequest")));
    fault "vendor-pause-listed" ["ACT-05"] "Lists its pause as StartPause and StopPause."
        => factsheet(|_, m| actions(m, |a| if matches!(a.text("actionType"), "startPause" | "stopPause") {
            text(a, "actionType", |kind| kind.replacen('s', "S", 1));
        }));
    fault "start-pause-on-nodes" ["ACT-09"] "Declares startPause as an action for nodes."
        => factsheet(|_, m| offer(m, "startPause", "NODE"));
    fault "pick-as-instant-action" ["ACT-09"] "Declares pick as an instant action."
        => factsheet(|_, m| offer(m, "pick", "INSTANT"));
    fault "positioning-as-instant-action" ["ACT-09"] "Declares finePositioning as an instant action." because "The ruling of ACT-09 leaves a warning."
        => factsheet(|_, m| offer(m, "finePositioning", "INSTANT"));
    fault "charging-on-edges" ["ACT-09"] "Declares startCharging as an action for edges."
        => factsheet(|_, m| offer(m, "startCharging", "EDGE"));
    fault "factsheet-all-scopes-for-all" ["ACT-09"] "It lists every action in the factsheet with the scopes INSTANT, NODE and EDGE."
        => factsheet(|_, m| actions(m, |a| a.set("actionScopes", json!(["INSTANT", "NODE", "EDGE"]))));
    fault "factsheet-scope-lower-case" ["FACT-07", "JSON-02"] "Spells the scopes of its actions in lower case."
        => factsheet(|_, m| actions(m, |a| a.list("actionScopes").iter_mut().for_each(lower_case)));
    fault "scopes-in-one-text" ["FACT-07", "JSON-06"] "Its factsheet gives the scopes of an action as one text with commas."
        => factsheet(|_, m| actions(m, |a| {
            let scopes: Vec<&str> = a.get("actionScopes").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str).collect();
            let scopes = scopes.join(",");
            a.set("actionScopes", scopes);
        }));
    fault "blocking-types-lower-case" ["FACT-07", "JSON-02"] "The factsheet gives the blockingTypes of the actions in lower case."
        => factsheet(|_, m| actions(m, |a| a.list("blockingTypes").iter_mut().for_each(lower_case)));
    fault "pick-parameter-renamed" ["ACT-06"] "Calls the station type of a pick station_type in its factsheet."
        => factsheet(|_, m| actions(m, |a| if a.text("actionType") == "pick" {
            a.each("actionParameters", |p| text(p, "key", |key| key.replace("stationType", "station_type")));
        }));
    fault "parameter-type-unknown" ["BP-05", "FACT-07", "JSON-02"] "Calls the type of its parameters DOUBLE."
        => factsheet(|_, m| actions(m, |a| a.each("actionParameters", |p| p.set("valueDataType", "DOUBLE"))));
    fault "factsheet-parameter-type-float" ["FACT-07", "JSON-02"] "It gives the numeric parameters in the factsheet the valueDataType FLOAT64."
        => factsheet(|_, m| actions(m, |a| a.each("actionParameters", |p| if matches!(p.text("valueDataType"), "FLOAT" | "NUMBER") {
            p.set("valueDataType", "FLOAT64");
        })));

    fault "wheel-without-type" ["FACT-08", "JSON-10"] "Leaves the type of its wheels out of the factsheet."
        => factsheet(|_, m| m.part("agvGeometry", |g| g.each("wheelDefinitions", |wheel| wheel.unset("type"))));
    fault "polygon-crossed" ["FACT-08"] "Draws its contour as a polygon that crosses itself."
        => factsheet(|_, m| m.part("agvGeometry", |g| g.each("envelopes2d", |envelope| {
            if let [_, second, third, ..] = envelope.list("polygonPoints") {
                std::mem::swap(second, third);
            }
        })));
    fault "envelope-unnamed" ["FACT-08"] "The envelope in its factsheet has no name of its set."
        => factsheet(|_, m| m.part("agvGeometry", |g| g.each("envelopes2d", |envelope| envelope.unset("set"))));
    fault "load-set-without-type" ["FACT-09", "JSON-10"] "Leaves the type of the load out of its load sets."
        => factsheet(|_, m| m.part("loadSpecification", |l| l.each("loadSets", |set| set.unset("loadType"))));
    fault "load-set-twice" ["FACT-09"] "Uses one name for two load sets."
        => factsheet(|_, m| m.part("loadSpecification", |l| l.each("loadSets", |set| set.set("setName", "DEFAULT"))));

    fault "versions-numeric" ["FACT-10", "JSON-06"] "Gives its software version as a number."
        => factsheet(|_, m| m.part("vehicleConfig", |c| c.each("versions", |version| version.set("value", 1.0))));
    fault "versions-as-map" ["FACT-10"] "Its factsheet gives its versions as one object and not as a list of keys and values."
        => factsheet(|_, m| m.part("vehicleConfig", |c| c.change("versions", |versions| {
            *versions = json!({ "softwareVersion": versions[0]["value"] });
        })));
    fault "address-changes" ["FACT-10"] "It states another localIpAddress in each factsheet although it stays in operation."
        => factsheet(|agv, m| {
            let address = format!("10.1.0.{}", 20 + agv.states_sent % 200);
            m.part("vehicleConfig", |c| c.set("network", json!({
                "dnsServers": ["10.1.0.1"],
                "ntpServers": ["10.1.0.2"],
                "localIpAddress": address,
                "netmask": "255.255.255.0",
                "defaultGateway": "10.1.0.1",
            })));
        });
}

/// Changes what each action is listed with.
fn actions(factsheet: &mut Object, change: impl FnMut(&mut Object)) {
    factsheet.part("protocolFeatures", |features| features.each("agvActions", change));
}

/// Lists an action in one more scope.
fn offer(factsheet: &mut Object, kind: &str, scope: &str) {
    actions(factsheet, |action| {
        if action.text("actionType") == kind {
            action.add("actionScopes", json!(scope));
        }
    });
}

fn timing(factsheet: &mut Object, change: impl FnOnce(&mut Object)) {
    factsheet.part("protocolLimits", |limits| limits.part("timing", change));
}

/// States room for one action in its states.
fn one_action_state(factsheet: &mut Object) {
    factsheet.part("protocolLimits", |limits| {
        limits.part("maxArrayLens", |lists| lists.set("state.actionStates", 1))
    });
}

fn lower_case(value: &mut Value) {
    if let Value::String(text) = value {
        text.make_ascii_lowercase();
    }
}
