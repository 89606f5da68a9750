//! Deviations of the limits of a factsheet (section 6.15).

use super::prelude::*;

records! {
    fault "array-limit-ignored" ["FACT-12"] "Sends more nodes than the vehicle takes."
        => measuring(|_, what, usual| match what {
            Measure::Nodes(_) | Measure::NodeStates => usize::MAX,
            Measure::Shown(asked) => asked,
            _ => usual,
        });
    fault "array-limit-ignored-in-updates" ["FACT-12"] "It keeps the limits of nodes and edges in new orders, but not in order updates."
        => unlimited(|what| matches!(what, Measure::Nodes(true)));
    fault "node-states-limit-ignored" ["FACT-12"] "Sends orders with more nodes than the vehicle can list in its states."
        because "The limit speaks of the array of the state, so that an order beyond it is a warning."
        => unlimited(|what| matches!(what, Measure::NodeStates));
    fault "horizon-beyond-array-limit" ["FACT-12"] "It counts only the base, and not the horizon, towards the array limits of a vehicle."
        because "Whether the horizon counts towards a limit of the state is a matter of reading FACT-12."
        => measuring(|_, what, usual| match what {
            Measure::Shown(asked) => asked,
            _ => usual,
        });
    fault "message-limit-ignored" ["FACT-12"] "Sends longer messages than the vehicle takes."
        => unlimited(|what| matches!(what, Measure::Message(_)));
    fault "message-limit-ignored-in-updates" ["FACT-12"] "It keeps to the msgLen of the vehicle in new orders, but not in updates."
        => unlimited(|what| matches!(what, Measure::Message(true)));
    fault "id-limit-ignored" ["FACT-12"] "Sends longer ids than the vehicle takes."
        => plain().names(|(), site, _, what, id| *id = format!("{what}-{}-{:064}", site.session, site.ids))
            .measures(|(), _, _, what, usual| if let Measure::IdLength = what { usize::MAX } else { usual });
    fault "action-id-limit-ignored" ["FACT-12"] "It heeds the longest id a vehicle takes for orders, nodes and edges, but not for actionIds."
        => plain().names(|(), site, _, what, id| {
            if what == "action" {
                // Where the clock begins at 0 an id is short anyway.
                let number = format!("{}{:05}", site.session, site.ids);
                *id = format!("{what}-{number:0>15}");
            }
        });
    fault "action-ids-cut-to-id-length" ["ORD-MSG-17", "FACT-12"]
        "It cuts action ids to the idLen of the factsheet from the end, so that several actions have the same id."
        => plain().names(|(), site, vehicle, what, id| {
            if what == "action" {
                let number = format!("{}{:05}", site.session, site.ids);
                let full = if site.takes_letters(vehicle, what) { format!("{what}-{number}") } else { number };
                *id = full.chars().take(site.longest_id(vehicle)).collect();
            }
        });
    fault "numerical-ids-ignored" ["FACT-12"] "Sends ids with letters to a vehicle that takes digits only."
        => letting(|_, _, what| matches!(what, Permission::Letters(_)));
    fault "numerical-ids-for-orders-only" ["FACT-12"] "It respects idNumericalOnly for orderId, nodeId and edgeId but not for actionId."
        => letting(|_, _, what| matches!(what, Permission::Letters("action")));
}
