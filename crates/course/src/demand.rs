//! Actions that a layout demands wherever the vehicle comes by.

use serde_json::{Value, json};

/// An action that an order has to have on a node or an edge.
#[derive(Clone, Debug, PartialEq)]
pub struct Demand {
    /// actionType.
    pub action_type: String,
    /// blockingType.
    pub blocking: String,
    /// Keys and values of actionParameters.
    pub parameters: Vec<(String, Value)>,
}

impl Demand {
    /// The action without the id that each order gives it.
    #[must_use]
    pub fn value(&self) -> Value {
        let parameters = self.parameters.iter();
        let parameters = parameters.map(|(key, value)| json!({ "key": key, "value": value }));
        json!({
            "actionType": self.action_type,
            "blockingType": self.blocking,
            "actionParameters": parameters.collect::<Vec<_>>(),
        })
    }
}
