//! What a vehicle publishes because it was told to: other members, other payloads, or nothing.

use serde_json::{Map, Value};

use crate::reference::Publication;
use crate::reference::agv::Agv;

/// Topics with a header of their own count.
const TOPICS: [&str; 6] = [
    "state",
    "visualization",
    "connection",
    "factsheet",
    "order",
    "instantActions",
];

/// A message with a merge patch laid over.
pub(super) fn laid_over(patch: Option<&Value>, body: Map<String, Value>) -> Map<String, Value> {
    let Some(patch) = patch else { return body };
    let mut message = Value::Object(body);
    json_patch::merge(&mut message, patch);
    match message {
        Value::Object(body) => body,
        _ => Map::new(),
    }
}

impl Agv {
    /// Whether a state does not reach anybody. One that is lost on the way has been counted.
    pub(in crate::reference::agv) fn swallows_state(&mut self) -> bool {
        if self.persona.silent {
            return true;
        }
        if self.persona.lost_states == 0 {
            return false;
        }
        self.persona.lost_states -= 1;
        self.header("state", true);
        true
    }

    /// The state as it is to be shown.
    pub(in crate::reference::agv) fn shown_state(&self, body: Map<String, Value>) -> Map<String, Value> {
        laid_over(self.persona.state.as_ref(), body)
    }

    /// The visualization as it is to be shown.
    pub(in crate::reference::agv) fn shown_visualization(&self, body: Map<String, Value>) -> Map<String, Value> {
        laid_over(self.persona.visualization.as_ref(), body)
    }

    /// `publish`: an object with a header before it, anything else as it is.
    pub(super) fn publish_as_told(&mut self, arguments: &Value) {
        let wanted = arguments.get("topic").and_then(Value::as_str);
        let Some(name) = TOPICS.into_iter().find(|name| Some(*name) == wanted) else {
            return;
        };
        let retained = matches!(name, "connection" | "factsheet");
        self.persona.replaced |= retained;
        let text = match (arguments.get("text"), arguments.get("payload")) {
            (Some(Value::String(text)), _) => text.clone(),
            (_, Some(Value::Object(body))) => {
                self.publish(name, body.clone());
                return;
            }
            (_, Some(payload)) => payload.to_string(),
            _ => return,
        };
        if let Some(topic) = self.config.topic(name).filter(|_| self.connection.online) {
            let publication = Publication {
                topic: topic.to_owned(),
                payload: text.into_bytes(),
                qos: u8::from(name == "connection"),
                retain: retained && (name == "connection" || self.config.has("retainedFactsheet")),
            };
            self.pending.push(crate::reference::Output::Publish(publication));
        }
    }

    /// Puts the retained messages right.
    pub(super) fn republish(&mut self) {
        self.publish_connection("ONLINE");
        self.publish_factsheet();
    }
}
