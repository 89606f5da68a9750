//! What a vehicle publishes because it was told to: other members, other payloads.

use serde_json::{Map, Value, json};

use super::Persona;
use crate::agv::Agv;
use crate::{Output, Publication};

/// Topics with a header of their own count.
const TOPICS: [&str; 6] = [
    "state",
    "visualization",
    "connection",
    "factsheet",
    "order",
    "instantActions",
];

/// Lays a merge patch over a message.
pub(super) fn lay_over(patch: Option<&Value>, message: &mut Map<String, Value>) {
    let Some(patch) = patch else { return };
    let mut whole = Value::Object(std::mem::take(message));
    json_patch::merge(&mut whole, patch);
    if let Value::Object(laid) = whole {
        *message = laid;
    }
}

impl Persona {
    /// What it says about its base and its battery.
    pub(super) fn says_in_state(&self, state: &mut Map<String, Value>) {
        if self.wants_base {
            state.insert("newBaseRequest".into(), json!(true));
        }
        if let Some(charge) = self.charge
            && let Some(Value::Object(battery)) = state.get_mut("batteryState")
        {
            battery.insert("batteryCharge".into(), json!(charge));
        }
    }

    /// `publish`: an object with a header before it, anything else as it is.
    pub(super) fn publish(&mut self, agv: &mut Agv, arguments: &Value) {
        let wanted = arguments.get("topic").and_then(Value::as_str);
        let Some(name) = TOPICS.into_iter().find(|name| Some(*name) == wanted) else {
            return;
        };
        let retained = matches!(name, "connection" | "factsheet");
        self.replaced |= retained;
        let text = match (arguments.get("text"), arguments.get("payload")) {
            (Some(Value::String(text)), _) => text.clone(),
            (_, Some(Value::Object(body))) => {
                agv.publish(name, body.clone());
                return;
            }
            (_, Some(payload)) => payload.to_string(),
            _ => return,
        };
        if let Some(topic) = agv.config.topic(name).filter(|_| agv.connection.online) {
            let publication = Publication {
                topic: topic.to_owned(),
                payload: text.into(),
                qos: u8::from(name == "connection"),
                retain: retained && (name == "connection" || agv.config.has("retainedFactsheet")),
            };
            agv.pending.push(Output::Publish(publication));
        }
    }
}

/// Puts the retained messages right.
pub(super) fn republish(agv: &mut Agv) {
    agv.publish_connection("ONLINE");
    agv.publish_factsheet();
}
