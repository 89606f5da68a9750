//! Messages on the wire: the vehicle thinks by the usual names of members, which its protocol version may call otherwise.

use serde_json::{Map, Value, json};

use tck_view::{Edge, Topic};

use super::Agv;

impl Agv {
    /// A message that goes out, as the version writes it.
    pub(crate) fn spell(&self, topic: &str, message: &mut Map<String, Value>) {
        let object = Topic::of_name(topic).object();
        self.config.names.spell_members(object, message);
    }

    /// A message that came in, by the usual names. Where a version does not say between which nodes an edge lies, it lies between
    /// its neighbours in the order.
    pub(crate) fn understood(&self, topic: &str, mut message: Value) -> Value {
        self.config.names.unspell(Topic::of_name(topic).object(), &mut message);
        if topic == "order" && self.config.names.lacks(Edge::start_node_id) {
            name_ends(&mut message);
        }
        if topic == "order" && !self.config.has("corridorRelease") {
            forget_releases(&mut message);
        }
        message
    }

    /// The path of a member of an order, as the version writes it.
    pub(crate) fn spelled_path(&self, path: &str) -> String {
        self.config.names.spelled_path(Topic::Order.object(), path)
    }
}

/// Leaves aside what a version does not know of corridors.
fn forget_releases(order: &mut Value) {
    let edges = order.get_mut("edges").and_then(Value::as_array_mut);
    for edge in edges.into_iter().flatten() {
        if let Some(Value::Object(corridor)) = edge.get_mut("corridor") {
            corridor.remove("releaseRequired");
            corridor.remove("releaseLossBehavior");
        }
    }
}

/// Tells each edge the nodes at its ends.
fn name_ends(order: &mut Value) {
    let nodes = order.get("nodes").and_then(Value::as_array);
    let ids: Vec<Value> = nodes.into_iter().flatten().map(|node| node["nodeId"].clone()).collect();
    let edges = order.get_mut("edges").and_then(Value::as_array_mut);
    for (at, edge) in edges.into_iter().flatten().enumerate() {
        if let Value::Object(edge) = edge {
            for (end, node) in [("startNodeId", ids.get(at)), ("endNodeId", ids.get(at + 1))] {
                // An edge without a node at its end is found by its place in the order.
                edge.insert(end.to_owned(), node.cloned().unwrap_or_else(|| json!("none")));
            }
        }
    }
}
