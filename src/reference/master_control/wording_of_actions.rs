//! How it words actions and their parameters.

use serde_json::{Map, Value, json};

use super::faults::{FaultName as F, Faults};
use super::wording::remove;

pub(super) fn action(faults: Faults, name: &str, action: &mut Value) {
    let kind = action["actionType"].as_str().unwrap_or_default().to_owned();
    if let Some(blocking) = action["blockingType"].as_str().map(str::to_owned) {
        if faults.has(F::LowerCaseEnums) {
            action["blockingType"] = json!(blocking.to_ascii_lowercase());
        }
        if faults.has(F::BlockingTypeUnknown) {
            action["blockingType"] = json!("EXCLUSIVE");
        }
        if faults.has(F::BlockingTypeMissing) {
            remove(action, "blockingType");
        }
    }
    if faults.has(F::R1NumericalIdsAsNumbers)
        && let Some(number) = action["actionId"].as_str().and_then(|id| id.parse::<u64>().ok())
    {
        action["actionId"] = json!(number);
    }
    if name == "instantActions" && faults.has(F::R1InstantWithoutBlockingType) {
        remove(action, "blockingType");
    }
    if matches!(kind.as_str(), "startPause" | "stopPause")
        && name == "instantActions"
        && faults.has(F::R4InstantActionsWithoutBlockingType)
    {
        remove(action, "blockingType");
    }
    if name == "order"
        && faults.has(F::R1ActionIdKeyUpperCase)
        && let Some(id) = remove(action, "actionId")
    {
        action["actionID"] = id;
    }
    if name == "instantActions" && faults.has(F::ActionIdMissing) {
        remove(action, "actionId");
    }
    let left_out = [
        (F::LastNodeMissing, "initPosition", "lastNodeId"),
        (F::LoadTypeMissing, "pick", "loadType"),
        (F::DeviceMissing, "pick", "lhd"),
        (F::DownloadWithoutLink, "downloadMap", "mapDownloadLink"),
        (F::DownloadWithoutId, "downloadMap", "mapId"),
        (F::DownloadWithoutVersion, "downloadMap", "mapVersion"),
        (F::R1EnableMapWithoutVersion, "enableMap", "mapVersion"),
        (F::R1DeleteMapWithoutVersion, "deleteMap", "mapVersion"),
        (F::R1TriggerTypeMissing, "waitForTrigger", "triggerType"),
    ];
    if let Some(parameters) = action.get_mut("actionParameters").and_then(Value::as_array_mut) {
        for (fault, of, key) in left_out {
            if faults.has(fault) && kind == of {
                parameters.retain(|parameter| parameter["key"] != json!(key));
            }
        }
        let known = parameters.iter().any(|parameter| parameter["key"] == "loadId");
        if kind == "pick" && !known && faults.has(F::R4NullForUnknownLoadId) {
            parameters.push(json!({ "key": "loadId", "value": null }));
        }
        let hashed = parameters.iter().any(|parameter| parameter["key"] == "mapHash");
        if kind == "downloadMap" && !hashed && faults.has(F::R5EmptyMapHashAsNull) {
            parameters.push(json!({ "key": "mapHash", "value": null }));
        }
        for parameter in parameters.iter_mut() {
            self::parameter(faults, &kind, parameter);
        }
        if kind == "initPosition" && faults.has(F::R2ZeroPoseMembersLeftOut) {
            parameters.retain(|parameter| parameter["value"].as_f64() != Some(0.0));
        }
        if faults.has(F::R1ParametersByKey) {
            for parameter in parameters.iter_mut() {
                let key = parameter["key"].as_str().unwrap_or_default().to_owned();
                *parameter = Value::Object(Map::from_iter([(key, parameter["value"].clone())]));
            }
        }
        let one = kind == "downloadMap" && faults.has(F::R4MapParametersAsObject);
        if one || faults.has(F::ParametersAsObject) {
            let members = parameters.iter().filter_map(|parameter| {
                let key = parameter["key"].as_str()?;
                Some((key.to_owned(), parameter["value"].clone()))
            });
            let members: Map<String, Value> = members.collect();
            action["actionParameters"] = Value::Object(members);
        }
    }
    self::r3_action(faults, name, &kind, action);
    if faults.has(F::R2SingleParameterNotInArray)
        && let Some([only]) = action
            .get("actionParameters")
            .and_then(Value::as_array)
            .map(Vec::as_slice)
    {
        action["actionParameters"] = only.clone();
    }
}

pub(super) fn r3_action(faults: Faults, name: &str, kind: &str, action: &mut Value) {
    if let Some(parameters) = action.get_mut("actionParameters").and_then(Value::as_array_mut) {
        if kind == "initPosition" && faults.has(F::R3PoseAsOneParameter) {
            let mut pose = Map::new();
            parameters.retain(|parameter| {
                let key = parameter["key"].as_str().unwrap_or_default();
                let part = matches!(key, "x" | "y" | "theta");
                if part {
                    pose.insert(key.to_owned(), parameter["value"].clone());
                }
                !part
            });
            parameters.push(json!({ "key": "pose", "value": pose }));
        }
        if kind == "downloadMap" && faults.has(F::R3DownloadLinkCalledUrl) {
            for parameter in parameters.iter_mut() {
                if parameter["key"] == "mapDownloadLink" {
                    parameter["key"] = json!("mapUrl");
                }
            }
        }
        if faults.has(F::R3ParametersAsPairs) {
            for parameter in parameters.iter_mut() {
                *parameter = json!([parameter["key"], parameter["value"]]);
            }
        }
    }
    if name == "order"
        && faults.has(F::R3BlockingTypeAsOrdinal)
        && let Some(blocking) = action["blockingType"].as_str()
    {
        let ordinal = ["NONE", "SOFT", "HARD"].iter().position(|known| *known == blocking);
        action["blockingType"] = json!(ordinal);
    }
    if name == "order"
        && faults.has(F::R3NodeActionTypeCalledName)
        && let Some(kind) = remove(action, "actionType")
    {
        action["actionName"] = kind;
    }
    if name == "instantActions"
        && faults.has(F::R3InstantActionsPascalCase)
        && let Some(members) = action.as_object_mut()
    {
        let capital = |key: &str| {
            let (first, rest) = key.split_at(key.len().min(1));
            format!("{}{rest}", first.to_ascii_uppercase())
        };
        *members = members
            .iter()
            .map(|(key, value)| (capital(key), value.clone()))
            .collect();
    }
}

pub(super) fn parameter(faults: Faults, kind: &str, parameter: &mut Value) {
    let key = parameter["key"].as_str().unwrap_or_default().to_owned();
    if faults.has(F::StationTypeRenamed) && key == "stationType" {
        parameter["key"] = json!("station_type");
    }
    if faults.has(F::R1TriggerTypeRenamed) && kind == "waitForTrigger" && key == "triggerType" {
        parameter["key"] = json!("trigger");
    }
    if faults.has(F::R2DeviceKeySpelledOut) && key == "lhd" {
        parameter["key"] = json!("loadHandlingDevice");
    }
    if faults.has(F::R1DeviceAsNumber) && key == "lhd" {
        parameter["value"] = json!(0);
    }
    if faults.has(F::R1InitPositionAxesSwapped) && kind == "initPosition" {
        match key.as_str() {
            "x" => parameter["key"] = json!("y"),
            "y" => parameter["key"] = json!("x"),
            _ => {}
        }
    }
    if faults.has(F::PoseAsText)
        && kind == "initPosition"
        && let Some(number) = parameter["value"].as_f64()
    {
        parameter["value"] = json!(number.to_string());
    }
    if key == "mapVersion"
        && faults.has(F::R4MapVersionAsNumber)
        && let Some(number) = parameter["value"]
            .as_str()
            .and_then(|text| text.parse::<serde_json::Number>().ok())
    {
        parameter["value"] = json!(number);
    }
    if matches!(kind, "pick" | "drop") && parameter["value"].is_number() && faults.has(F::R5PickHeightAsString) {
        parameter["value"] = json!(parameter["value"].to_string());
    }
    let plain = parameter["value"].is_number() || parameter["value"].is_boolean();
    if plain && faults.has(F::R6ParameterValuesAsStrings) {
        parameter["value"] = json!(parameter["value"].to_string());
    }
    if faults.has(F::DeviceUnknown) && key == "lhd" {
        parameter["value"] = json!("1");
    }
    if faults.has(F::ParameterNull) {
        parameter["value"] = Value::Null;
    }
    if faults.has(F::ParameterWithoutKey)
        && let Some(key) = remove(parameter, "key")
    {
        parameter["name"] = key;
    }
}
