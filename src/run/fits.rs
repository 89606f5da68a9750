//! Whether the messages of a test fit into a vehicle, by the limits of its factsheet.
//!
//! FACT-12 binds a master control, and the harness plays one: what the factsheet says is too much may be refused.

use serde_json::Value;

use crate::suite::model::{Need, RoutePlace, Send, Test, Verb};

/// Why a test is nothing for a vehicle with such a factsheet. A test that is about a limit goes beyond it on purpose.
pub(super) fn outgrown(sheet: &Value, test: &Test) -> Option<String> {
    if test.needs.iter().any(|need| matches!(need, Need::Limit(_))) {
        return None;
    }
    let limits = sheet.pointer("/protocolLimits/maxArrayLens")?;
    let sends = test.sections().into_iter().flat_map(|(_, steps)| steps);
    let sends = sends.filter_map(|step| match &step.verb {
        Verb::Send(send) => Some(send),
        _ => None,
    });
    let sizes = sends.flat_map(|send| sizes(send)).filter(|(_, size)| *size > 0);
    for (name, size) in sizes {
        let limit = limits.get(name).and_then(Value::as_u64).filter(|limit| *limit > 0);
        if let Some(limit) = limit.filter(|limit| *limit < size) {
            return Some(format!(
                "the factsheet says that {name} has {limit} elements at most, and {size} are needed"
            ));
        }
    }
    None
}

/// How long the arrays of a message are, by the names that factsheets have for them.
fn sizes(send: &Send) -> Vec<(&'static str, u64)> {
    let count = |length: usize| u64::try_from(length).unwrap_or(u64::MAX);
    let mut all = vec![("instantActions", count(send.actions.len()))];
    let mut parameters = send.actions.iter().map(|action| action.with.len()).max().unwrap_or(0);
    if let Some(route) = &send.route {
        let nodes = route.base.len() + route.horizon.len();
        all.push(("order.nodes", count(nodes)));
        all.push(("order.edges", count(nodes.saturating_sub(1))));
        for (place, actions) in &route.actions {
            let name = match place {
                RoutePlace::Node(_) => "node.actions",
                RoutePlace::Edge(..) => "edge.actions",
            };
            all.push((name, count(actions.len())));
            parameters = actions
                .iter()
                .map(|action| action.with.len())
                .fold(parameters, usize::max);
        }
    }
    all.push(("actions.actionsParameters", count(parameters)));
    all
}
