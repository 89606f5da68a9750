//! Deviations of actions: their ids, types, parameters and blocking types (sections 6.8, 6.9 and 6.15).

use crate::master_control::actions::{is_predefined, is_predefined_in, mandatory};

use super::prelude::*;

records! {
    fault "blocking-type-missing" ["ORD-MSG-15"] "Leaves blockingType out of its actions."
        => action(|a| a.unset("blockingType"));
    fault "instant-without-blocking-type" ["ORD-MSG-15", "IACT-01", "JSON-10"] "Instant actions have no blockingType."
        => action_of("instantActions", |a| a.unset("blockingType"));
    fault "instant-actions-without-blocking-type" ["ORD-MSG-15", "IACT-01"] "It leaves blockingType out of the instant actions startPause and stopPause."
        => action_in(|name, a| if name == "instantActions" && matches!(a.text("actionType"), "startPause" | "stopPause") { a.unset("blockingType"); });
    fault "blocking-type-unknown" ["ORD-MSG-16", "JSON-02"] "Uses a blocking type the protocol does not have."
        => action(|a| a.change("blockingType", |blocking| *blocking = json!("EXCLUSIVE")));
    fault "blocking-type-unlisted" ["FACT-15"] "Does not look for blocking types in the factsheet."
        => making(|_, _, a, _, _| a.set("blockingType", "HARD"));
    fault "order-actions-block-nothing" ["FACT-15"] "Actions of its orders have the blockingType NONE, whatever the factsheet lists for them."
        => making(|_, _, a, _, instant| if !instant { a.set("blockingType", "NONE"); });
    tolerance "soft-actions" ["FACT-15"] "Uses the blocking type SOFT where the vehicle allows it."
        => making(|_, vehicle, a, _, instant| {
            let listed = vehicle.offer(a.text("actionType")).and_then(|offer| offer.blocking_types.as_deref()).unwrap_or_default();
            let free = !(instant && vehicle.config.has("instantActionsNeverBlock"));
            if free && (listed.is_empty() || listed.iter().any(|kind| kind == "SOFT")) { a.set("blockingType", "SOFT"); }
        });
    tolerance "instants-block-nothing" ["ORD-MSG-16", "FACT-15"] "Instant actions have blockingType NONE where the vehicle allows it."
        => making(|_, vehicle, a, _, instant| {
            let listed = vehicle.offer(a.text("actionType")).and_then(|offer| offer.blocking_types.as_ref());
            if instant && listed.is_none_or(|listed| listed.iter().any(|blocking| blocking == "NONE")) { a.set("blockingType", "NONE"); }
        });
    fault "action-id-missing" ["ORD-MSG-15", "IACT-01"] "Leaves actionId out of instant actions."
        => action_of("instantActions", |a| a.unset("actionId"));
    fault "action-ids-repeat" ["ORD-MSG-17"] "Numbers the actions from 1 again in every order."
        => naming("action", |site, _| (site.ids % 3).to_string());
    fault "action-id-in-braces" ["JSON-04"] "It writes actionIds in curly braces."
        because "JSON-04, which letters an identifier has, is a recommendation."
        => naming("action", |site, vehicle| site.fitting(vehicle, "action", format!("{{action-{}{:05}}}", site.session, site.ids), site.ids));
    fault "action-ids-restart-on-reconnect" ["ORD-MSG-17"] "After its own connection was lost and came back it gives out the same actionIds again."
        => counting("action", |event| matches!(event, Event::Connected(true)));
    fault "action-ids-restart-after-reconnect" ["ORD-MSG-17"]
        "It starts the count in its action ids anew when the vehicle comes ONLINE again, so that ids of the session return."
        => counting("action", |event| matches!(event, Event::Online(Presence::Away)));
    fault "instants-counted-apart" ["ORD-MSG-17"] "Counts actions of orders and instant actions apart, under the same kind of id."
        => fleet::<(u64, u64)>().makes(|(orders, instants), site, vehicle, a, _, instant| {
            let count = if instant { instants } else { orders };
            *count += 1;
            a.set("actionId", site.spelled(vehicle, "action", *count));
        });
    fault "pause-id-repeats" ["ORD-MSG-17"] "Every startPause has the same actionId."
        => made_of("startPause", |_, a| a.set("actionId", "pause"));
    fault "cancel-id-repeats" ["ORD-MSG-17"] "Every cancelOrder has the same actionId."
        => made_of("cancelOrder", |_, a| a.set("actionId", "cancel"));
    fault "stop-pause-with-id-of-start-pause" ["ORD-MSG-17"] "It sends stopPause with the actionId of the startPause that it ends."
        => keep::<Option<Value>>().makes(|pause, _, _, a, _, _| match a.text("actionType") {
            "startPause" => *pause = a.get("actionId").cloned(),
            "stopPause" => { if let Some(id) = pause.take() { a.set("actionId", id); } }
            _ => {}
        });
    fault "failed-action-repeated" ["ORD-MSG-17"] "Tries an action that has failed again under its old actionId."
        => made(|_, vehicle, kind, a| {
            let mut seen = vehicle.state.iter().flat_map(|state| &state.action_states);
            if let Some(failed) = seen.find(|seen| seen.action_type == kind && seen.action_status == "FAILED") { a.set("actionId", failed.action_id.clone()); }
        });
    fault "vendor-action-renamed" ["ACT-07", "FACT-15"] "Writes actions of the manufacturer with a capital letter."
        => made_by_vendor(|_, _, kind, a| a.set("actionType", capitalized(kind)));
    fault "vendor-action-lower-case" ["ACT-07", "FACT-15"] "It sends a vendor action with its type written in lower case."
        => made_by_vendor(|_, _, kind, a| a.set("actionType", kind.to_lowercase()));
    fault "vendor-action-wrapped" ["ACT-07", "FACT-15"] "It sends an action of the manufacturer as actionType customAction with its name as a parameter."
        => made_by_vendor(|_, _, kind, a| {
            a.set("actionType", "customAction");
            a.supply("actionParameters", json!([]));
            a.add("actionParameters", json!({ "key": "name", "value": kind }));
        });
    fault "vendor-parameters-dropped" ["ACT-07", "FACT-15"] "Actions of the manufacturer are sent without any parameter."
        => made_by_vendor(|_, _, _, a| a.unset("actionParameters"));
    fault "vendor-values-as-text" ["BP-05", "FACT-15"] "Parameters of actions of the manufacturer are strings, whatever their type in the factsheet."
        => made_by_vendor(|_, _, _, a| a.each("actionParameters", |parameter| {
            parameter.change("value", |value| if !value.is_string() { *value = json!(value.to_string()); });
        }));
    fault "required-key-missing" ["FACT-15"] "Sends actions of the manufacturer without their parameters."
        => making(|_, _, a, given, _| {
            if mandatory(a.text("actionType")).is_empty() {
                a.keep("actionParameters", |parameter| given.get(parameter.text("key")).is_some());
                drop_empty(a);
            }
        });
    fault "load-parameters-by-table" ["FACT-15"] "Gives drop only the parameters that the text demands, not those the factsheet does."
        => making(|_, _, a, given, _| {
            if a.says("actionType", "drop") {
                a.keep("actionParameters", |parameter| parameter.says("key", "lhd") || given.get(parameter.text("key")).is_some());
                drop_empty(a);
            }
        });
    fault "unlisted-parameters-passed" ["FACT-15"] "It sends parameters of an action that the factsheet does not list when somebody gives them."
        => making(|_, _, a, given, _| {
            for (key, value) in given.as_object().into_iter().flatten().filter(|(_, value)| !value.is_null()) {
                a.supply("actionParameters", json!([]));
                if !a.list("actionParameters").iter().any(|parameter| parameter["key"] == *key) { a.add("actionParameters", json!({ "key": key, "value": value })); }
            }
        });
    tolerance "optional-parameters-filled" ["FACT-15"] "It sends optional parameters of vendor actions too, with values of the listed types."
        => made(|site, vehicle, kind, a| {
            let listed = vehicle.offer(kind).and_then(|offer| offer.action_parameters.as_deref()).unwrap_or_default();
            for offered in listed.iter().filter(|_| !is_predefined(kind)) {
                a.supply("actionParameters", json!([]));
                if !a.list("actionParameters").iter().any(|parameter| parameter["key"] == offered.key) {
                    let value = site.supplied(vehicle, &offered.key, &offered.value_data_type);
                    a.add("actionParameters", json!({ "key": offered.key, "value": value }));
                }
            }
            drop_empty(a);
        });
    fault "supplied-values-as-text" ["BP-05", "FACT-15"]
        "It sends the values it supplies itself for parameters that are not optional as texts, whatever type the factsheet names."
        => making(|_, vehicle, a, given, _| {
            let kind = a.text("actionType").to_owned();
            a.each("actionParameters", |parameter| {
                let key = parameter.text("key").to_owned();
                let known = matches!(key.as_str(), "stationType" | "loadType" | "triggerType" | "reason" | "duration" | "lhd");
                let offer = vehicle.offer(&kind).and_then(|offer| offer.action_parameters.as_ref());
                let offered = offer.and_then(|list| list.iter().find(|offered| offered.key == key));
                if !known && given.get(&key).is_none() {
                    parameter.set("value", match offered.map_or("", |offered| offered.value_data_type.as_str()) {
                        "BOOL" => "true",
                        "NUMBER" | "FLOAT" | "INTEGER" => "1",
                        "OBJECT" => "{}",
                        "ARRAY" => "[]",
                        _ => "default",
                    });
                }
            });
        });
    fault "pick-without-load-type" ["ACT-31", "FACT-15"] "It leaves loadType out of pick when the operator did not choose one."
        => making(|_, _, a, given, _| {
            if a.says("actionType", "pick") && given.get("loadType").is_none() { a.keep("actionParameters", |parameter| !parameter.says("key", "loadType")); }
        });
    fault "cancel-with-order-id-parameter" ["FACT-15", "ACT-31"]
        "It adds the parameter orderId of version 3.0 to cancelOrder although the factsheet lists no parameter for it."
        => made_of("cancelOrder", |vehicle, a| if let Some(running) = &vehicle.running {
            a.set("actionParameters", json!([{ "key": "orderId", "value": running.id }]));
        });
    fault "lhd-by-habit" ["ACT-32"] "Calls the first load handling device LHD1, whatever the factsheet says."
        => making(|_, _, a, given, _| each_device(a, |device| if given.get("lhd").is_none() { *device = json!("LHD1"); }));
    fault "lhd-as-index" ["ACT-32"] "It names the load handling device by its index in the list (as the text 0 or 1) instead of its name in loadPositions."
        => making(|_, vehicle, a, _, _| each_device(a, |device| {
            let known = vehicle.factsheet.iter().flat_map(|sheet| &sheet.devices).position(|known| *device == json!(known));
            if let Some(index) = known { *device = json!(index.to_string()); }
        }));
    fault "lhd-missing" ["ACT-32"] "Does not say which load handling device picks."
        => parameterless("pick", "lhd");
    fault "last-node-missing" ["ACT-31"] "Sends initPosition without lastNodeId."
        => parameterless("initPosition", "lastNodeId");
    fault "load-type-missing" ["ACT-31", "FACT-15"] "Sends pick without loadType."
        => parameterless("pick", "loadType");
    fault "download-without-link" ["MAP-16", "ACT-31"] "Sends downloadMap without mapDownloadLink."
        => parameterless("downloadMap", "mapDownloadLink");
    fault "download-without-id" ["MAP-16", "ACT-31"] "Sends downloadMap without mapId."
        => parameterless("downloadMap", "mapId");
    fault "download-without-version" ["FACT-15", "MAP-16"] "Sends downloadMap without mapVersion."
        => parameterless("downloadMap", "mapVersion");
    fault "enable-map-without-version" ["ACT-31", "FACT-15"] "enableMap has no mapVersion."
        => parameterless("enableMap", "mapVersion");
    fault "delete-map-without-version" ["ACT-31", "FACT-15"] "deleteMap has no mapVersion."
        => parameterless("deleteMap", "mapVersion");
    fault "trigger-type-missing" ["ACT-31", "FACT-15"] "waitForTrigger has no triggerType."
        => parameterless("waitForTrigger", "triggerType");
    fault "null-for-unknown-load-id" ["BP-05"] "It sends the parameter loadId with the value null in a pick, when the load is not known."
        => null_parameter("pick", "loadId");
    fault "empty-optional-parameters-as-null" ["BP-05", "JSON-06"]
        "It sends each optional parameter of an action that nobody has given a value for with the value null."
        => making(|_, vehicle, a, _, _| {
            let listed = vehicle.offer(a.text("actionType")).and_then(|offer| offer.action_parameters.as_deref()).unwrap_or_default();
            for offered in listed.iter().filter(|offered| offered.is_optional == Some(true)) {
                a.supply("actionParameters", json!([]));
                if !a.list("actionParameters").iter().any(|parameter| parameter["key"] == offered.key) {
                    a.add("actionParameters", json!({ "key": offered.key, "value": null }));
                }
            }
        });
    fault "empty-map-hash-as-null" ["BP-05"] "It sends mapHash with the value null when it has no hash."
        => null_parameter("downloadMap", "mapHash");
    fault "zero-pose-members-left-out" ["ACT-31"] "It leaves those of x, y and theta out of initPosition that are zero."
        => typed("initPosition", |a| a.keep("actionParameters", |parameter| number(parameter, "value") != Some(0.0)));
    fault "parameters-by-key" ["BP-04", "BP-05", "ACT-31", "JSON-10"] "Action parameters are objects with the key as the only member instead of key and value."
        => action(|a| a.each("actionParameters", |parameter| {
            let key = parameter.text("key").to_owned();
            *parameter = Object::from_iter([(key, parameter["value"].clone())]);
        }));
    fault "parameters-as-object" ["BP-04"] "Writes the parameters of an action as one object."
        => action(|a| as_object(a));
    fault "map-parameters-as-object" ["BP-04", "ORD-MSG-15"]
        "It sends the action parameters of downloadMap as one object with the keys as members, instead of an array of key and value."
        => typed("downloadMap", |a| as_object(a));
    fault "parameters-as-pairs" ["BP-04", "BP-05"] "It writes each action parameter as an array of key and value instead of an object."
        => action(|a| a.list("actionParameters").iter_mut().for_each(|parameter| *parameter = json!([parameter["key"], parameter["value"]])));
    fault "pose-as-one-parameter" ["ACT-06", "ACT-31"] "It sends x, y and theta of initPosition as one parameter pose that holds an object."
        => typed("initPosition", |a| {
            let is_pose = |key: &str| matches!(key, "x" | "y" | "theta");
            let pose: Object = a.list("actionParameters").iter().filter_map(|parameter| {
                let key = parameter["key"].as_str().filter(|key| is_pose(key))?;
                Some((key.to_owned(), parameter["value"].clone()))
            }).collect();
            a.keep("actionParameters", |parameter| !is_pose(parameter.text("key")));
            a.add("actionParameters", json!({ "key": "pose", "value": pose }));
        });
    fault "station-type-renamed" ["ACT-06", "ACT-31"] "Gives the station type of pick and drop under a key of its own."
        => parameter_of("stationType", |p| p.set("key", "station_type"));
    fault "trigger-type-renamed" ["ACT-06", "ACT-31", "FACT-15"] "waitForTrigger carries its triggerType under the key trigger."
        => parameter_of("triggerType", |p| p.set("key", "trigger"));
    fault "device-key-spelled-out" ["ACT-32", "ACT-06"] "It names the parameter for the load handling device loadHandlingDevice instead of lhd."
        => parameter_of("lhd", |p| p.set("key", "loadHandlingDevice"));
    fault "download-link-called-url" ["MAP-16", "ACT-31", "ACT-06"] "It names the parameter mapDownloadLink of downloadMap mapUrl."
        => parameter_of("mapDownloadLink", |p| p.set("key", "mapUrl"));
    fault "device-as-number" ["ACT-32", "BP-05", "FACT-15"] "lhd is the number 0, not the name of a load handling device."
        => parameter_of("lhd", |p| p.set("value", 0));
    fault "lhd-unknown" ["ACT-32"] "Counts load handling devices instead of naming them."
        => parameter_of("lhd", |p| p.set("value", "1"));
    fault "init-position-axes-swapped" ["MAP-01", "MAP-27"] "initPosition has x and y exchanged."
        => parameter(|kind, p| if kind == "initPosition" {
            match p.text("key") {
                "x" => p.set("key", "y"),
                "y" => p.set("key", "x"),
                _ => {}
            }
        });
    fault "pose-as-text" ["ACT-31", "BP-05"] "Sends the coordinates of initPosition as strings."
        => parameter(|kind, p| if kind == "initPosition" && let Some(value) = number(p, "value") { p.set("value", value.to_string()); });
    fault "map-version-as-number" ["ACT-31", "JSON-06", "BP-05"] "It sends the mapVersion in map actions as a JSON number when the version looks like a number."
        => parameter_of("mapVersion", |p| if let Ok(number) = p.text("value").parse::<serde_json::Number>() { p.set("value", Value::Number(number)); });
    fault "pick-height-as-string" ["BP-05", "FACT-15"] "It sends number parameters of pick and drop as strings."
        => parameter(|kind, p| if matches!(kind, "pick" | "drop") && p["value"].is_number() { p.set("value", p["value"].to_string()); });
    fault "parameter-values-as-strings" ["BP-05", "FACT-15"] "It sends all values of action parameters as strings, also numbers and Booleans."
        => parameter(|_, p| if p["value"].is_number() || p["value"].is_boolean() { p.set("value", p["value"].to_string()); });
    fault "parameter-null" ["BP-05"] "Sends a parameter without value."
        => parameter(|_, p| p.set("value", Value::Null));
    fault "parameter-without-key" ["BP-05", "BP-04"] "Calls the key of a parameter its name."
        => parameter(|_, p| p.rename("key", "name"));
    tolerance "empty-parameter-lists" ["BP-04", "ORD-MSG-15"] "Actions without parameters carry an empty list of them."
        => making(|_, _, a, _, _| a.supply("actionParameters", json!([])));
    tolerance "parameters-reversed" ["BP-04"] "It lists the parameters of an action in the opposite order."
        => making(|_, _, a, _, _| a.list("actionParameters").reverse());
    tolerance "several-instant-actions-in-one-message" ["IACT-01"] "It puts stateRequest beside the instant action asked for into one message."
        => sending(|site, vehicle, out| {
            // Whoever asks while he clears the list has to clear it again, for ever.
            let asks = out.name == "instantActions" && !out.tells(&["stateRequest", "clearInstantActions"]) && site.offers(vehicle, "stateRequest", "INSTANT");
            let limit = vehicle.factsheet.as_ref().map_or(usize::MAX, |sheet| sheet.limit(&["instantActions", "instantActions.actions", "actions"]));
            if asks && out.message.list("actions").len() < limit.min(10) {
                let question = site.made_action(vehicle, "stateRequest", &Value::Null, true);
                out.message.add("actions", question);
            }
        });
    fault "scope-ignored" ["FACT-15"] "Does not look for the scope of an action in the factsheet."
        => letting(|_, _, what| matches!(what, Permission::Offer(..)));
    fault "predefined-need-no-factsheet" ["FACT-15"] "It sends predefined actions that the factsheet does not list, or not in that scope."
        => letting(|_, _, what| matches!(what, Permission::Offer(kind, scope) if is_predefined_in(kind, scope)));
}

fn drop_empty(action: &mut Object) {
    if action.says("actionParameters", json!([])) {
        action.unset("actionParameters");
    }
}

fn each_device(action: &mut Object, mut change: impl FnMut(&mut Value)) {
    action.each("actionParameters", |parameter| {
        if parameter.says("key", "lhd") {
            parameter.change("value", &mut change);
        }
    });
}

/// The parameters of an action as one object.
fn as_object(action: &mut Object) {
    let list = action.list("actionParameters").iter();
    let members: Object = list
        .filter_map(|one| Some((one["key"].as_str()?.to_owned(), one["value"].clone())))
        .collect();
    action.change("actionParameters", |parameters| *parameters = Value::Object(members));
}

/// Leaves a parameter out of actions of a type.
fn parameterless(kind: &'static str, key: &'static str) -> Box<dyn Deviation> {
    holding((kind, key)).sends(|(kind, key), _, _, out| {
        each_action(&mut out.message, |action| {
            if action.text("actionType") == *kind {
                action.keep("actionParameters", |parameter| parameter.text("key") != *key);
            }
        });
        true
    })
}

/// Sends a parameter nobody has a value for as null.
fn null_parameter(kind: &'static str, key: &'static str) -> Box<dyn Deviation> {
    holding((kind, key)).sends(|(kind, key), _, _, out| {
        each_action(&mut out.message, |action| {
            let known = action
                .list("actionParameters")
                .iter()
                .any(|parameter| parameter["key"] == *key);
            if action.says("actionType", *kind) && !known {
                action.add("actionParameters", json!({ "key": *key, "value": null }));
            }
        });
        true
    })
}
