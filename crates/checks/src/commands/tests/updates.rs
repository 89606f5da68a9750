//! Mistakes in what follows an order: updates, other orders, and where they begin.

use serde_json::{Value, json};

use super::{action, all, begun, merged, order, pick, under_way};

/// An order that is driven, and then an update, changed.
fn updated(change: impl FnOnce(&mut Value)) -> Vec<String> {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(2.0);
    let mut second = order("o1", 1, 2, 4, 5);
    change(&mut second);
    trace.commands("order", &second);
    all(&trace)
}

#[test]
fn mistakes_in_updates_are_found() {
    assert_eq!(updated(|_| {}), Vec::<String>::new());
    assert_eq!(
        updated(|order| order["orderUpdateId"] = json!(0)),
        ["ORD-REJ-18 warning", "ORD-UPD-04"]
    );
    assert_eq!(
        updated(|order| order["orderUpdateId"] = json!(4)),
        ["ORD-UPD-04 warning"]
    );
    assert_eq!(
        updated(|order| order["orderId"] = json!("o2")),
        ["ORD-CANCEL-01", "ORD-UPD-04", "ORD-UPD-14"]
    );
    assert_eq!(
        updated(|second| *second = order("o1", 1, 0, 4, 5)),
        ["ORD-UPD-03", "ORD-UPD-05"]
    );
    assert_eq!(updated(|second| *second = order("o1", 1, 3, 4, 5)), ["ORD-UPD-05"]);
    assert_eq!(
        updated(|order| order["nodes"][0]["nodePosition"]["x"] = json!(7.1)),
        ["ORD-MSG-07 inconclusive", "ORD-UPD-06"]
    );
    let restarted = |order: &mut Value| {
        for list in ["nodes", "edges"] {
            for element in order[list].as_array_mut().unwrap() {
                let sequence = element["sequenceId"].as_u64().unwrap();
                element["sequenceId"] = json!(sequence - 4);
            }
        }
    };
    assert_eq!(updated(restarted), ["ORD-UPD-05", "ORD-UPD-12"]);
    let replaced = |order: &mut Value| order["nodes"][0]["nodeId"] = json!("n9");
    assert!(updated(replaced).contains(&"ORD-CANCEL-01".to_owned()));
    let added = |order: &mut Value| order["nodes"][0]["actions"] = json!([action("pick", "late", &pick())]);
    assert_eq!(updated(added), ["ORD-UPD-06"]);
}

#[test]
fn an_order_that_is_counted_wrongly_is_one_mistake_and_no_measure_for_its_update() {
    let mut trace = begun();
    let with_action = |mut order: Value, node: usize| {
        order["nodes"][node]["actions"] = json!([action("pick", "a1", &pick())]);
        order
    };
    let mut first = with_action(order("o1", 0, 0, 1, 3), 1);
    first["nodes"][1]["sequenceId"] = json!(3);
    trace.commands("order", &first).wait(2.0);
    trace.shows(&under_way("o1", 0, 1)).wait(2.0);
    trace.commands("order", &with_action(order("o1", 1, 1, 3, 4), 0));
    let found = all(&trace);
    let counted = |finding: &String| finding.starts_with("ORD-UPD-11");
    assert!(!found.is_empty() && found.iter().all(counted), "{found:?}");
}

#[test]
fn an_update_the_vehicle_did_not_take_may_be_replaced() {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(2.0);
    trace.commands("order", &order("o1", 1, 2, 4, 5)).wait(6.0);
    trace.shows(&under_way("o1", 0, 1)).wait(2.0);
    trace.commands("order", &order("o1", 2, 2, 3, 5));
    assert_eq!(all(&trace), Vec::<String>::new());
}

#[test]
fn an_order_in_the_place_of_one_that_was_not_called_off_is_found() {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(2.0);
    trace.commands("order", &order("o2", 0, 0, 1, 2));
    assert_eq!(trace.judge("commands/base-kept").summary(), ["ORD-CANCEL-01"]);
}

#[test]
fn an_order_that_replaces_another_one_should_wait_for_the_cancellation() {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(2.0);
    trace.commands(
        "instantActions",
        &json!({ "actions": [action("cancelOrder", "c1", &json!([]))] }),
    );
    trace.wait(2.0).commands("order", &order("o2", 0, 0, 1, 2));
    assert_eq!(trace.judge("commands/base-kept").summary(), ["ORD-CANCEL-01 warning"]);
    // Unless the vehicle has given up by itself.
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace
        .shows(&merged(under_way("o1", 0, 2), &json!({ "operatingMode": "MANUAL" })))
        .wait(2.0);
    trace.commands("order", &order("o2", 0, 0, 1, 2));
    assert_eq!(trace.judge("commands/base-kept").summary(), Vec::<String>::new());
}

#[test]
fn an_order_from_another_place_is_found_and_a_moved_vehicle_is_given_time() {
    let elsewhere = |shown_after: Option<f64>| {
        let mut trace = begun();
        trace.wait(10.0);
        if let Some(seconds) = shown_after {
            trace.vehicle("place-on").wait(seconds);
            trace.shows(&json!({ "lastNodeId": "n5", "agvPosition": { "x": 13.0 } }));
        }
        let mut order = order("o1", 0, 1, 2, 3);
        order["orderUpdateId"] = json!(0);
        trace.commands("order", &order);
        trace.judge("commands/start").summary()
    };
    assert_eq!(elsewhere(None), ["ORD-03"]);
    assert_eq!(elsewhere(Some(0.0)), Vec::<String>::new());
    // Nobody knows where it is before it says so.
    assert_eq!(elsewhere(Some(20.0)), Vec::<String>::new());
}

#[test]
fn a_first_order_of_a_high_update_is_judged_where_nothing_was_under_way() {
    let elsewhere = |settled: bool| {
        let mut trace = begun();
        trace.with.insert("settled".to_owned(), json!(settled));
        trace.wait(10.0);
        let mut order = order("o1", 0, 1, 2, 3);
        order["orderUpdateId"] = json!(7);
        trace.commands("order", &order);
        trace.judge("commands/start").summary()
    };
    assert_eq!(elsewhere(true), ["ORD-03"]);
    assert_eq!(elsewhere(false), Vec::<String>::new());
}

#[test]
fn a_vehicle_between_nodes_goes_on_from_there() {
    let begins = |deviation: Option<f64>, from: usize| {
        let mut trace = begun();
        trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
        trace.commands(
            "instantActions",
            &json!({ "actions": [action("cancelOrder", "c1", &json!([]))] }),
        );
        let stopped = json!({ "orderId": "o1", "lastNodeId": "n1", "agvPosition": { "x": 2.6 } });
        trace.wait(1.0).shows(&stopped).wait(10.0);
        let mut next = order("o2", 0, from, from + 1, from + 2);
        let position = next["nodes"][0]["nodePosition"].as_object_mut().unwrap();
        position.remove("allowedDeviationXY");
        position.extend(deviation.map(|deviation| ("allowedDeviationXY".to_owned(), json!(deviation))));
        trace.commands("order", &next);
        trace.judge("commands/start-between-nodes").summary()
    };
    assert_eq!(begins(Some(2.0), 0), Vec::<String>::new());
    assert_eq!(begins(None, 0), ["ORD-CANCEL-17 warning"]);
    assert_eq!(begins(Some(0.1), 0), ["ORD-CANCEL-17"]);
    assert_eq!(begins(Some(0.2), 1), ["ORD-CANCEL-17"]);
}

#[test]
fn the_end_of_a_refused_update_is_no_stitching_node() {
    let next = |refused: bool| {
        let mut trace = begun();
        trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
        trace.shows(&under_way("o1", 0, 2)).wait(2.0);
        trace.commands("order", &order("o1", 1, 2, 3, 5)).wait(0.2);
        let mut state = under_way("o1", 0, 2);
        if refused {
            let reference = |key: &str, value: &str| json!({ "referenceKey": key, "referenceValue": value });
            state["errors"] = json!([{
                "errorType": "orderError", "errorLevel": "WARNING",
                "errorReferences": [reference("orderId", "o1"), reference("orderUpdateId", "1")],
            }]);
        }
        trace.shows(&state).wait(2.0);
        trace.commands("order", &order("o1", 2, 3, 4, 5));
        trace.judge("commands/updates").summary()
    };
    assert_eq!(next(true), ["ORD-UPD-05 warning"]);
    assert_eq!(next(false), Vec::<String>::new());
}

#[test]
fn an_order_that_is_called_off_is_not_extended_unless_that_has_failed() {
    let extended = |status: &str, later: f64| {
        let mut trace = begun();
        trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
        trace.shows(&under_way("o1", 0, 2)).wait(2.0);
        trace.commands(
            "instantActions",
            &json!({ "actions": [action("cancelOrder", "c1", &json!([]))] }),
        );
        let cancel =
            json!({ "actionStates": [{ "actionId": "c1", "actionType": "cancelOrder", "actionStatus": status }] });
        trace
            .wait(later)
            .shows(&merged(under_way("o1", 0, 2), &cancel))
            .commands("order", &order("o1", 1, 2, 4, 5));
        trace.judge("commands/base-kept").summary()
    };
    assert_eq!(extended("RUNNING", 1.0), ["ORD-CANCEL-01 warning"]);
    assert_eq!(extended("FAILED", 1.0), Vec::<String>::new());
    // It was decided before.
    assert_eq!(extended("RUNNING", 0.01), Vec::<String>::new());
}

#[test]
fn an_order_is_not_over_while_one_of_its_actions_runs() {
    let next = |status: &str| {
        let mut trace = begun();
        let mut first = order("o1", 0, 0, 2, 2);
        first["nodes"][2]["actions"] = json!([action("pick", "a1", &pick())]);
        trace.commands("order", &first).wait(2.0);
        let done = json!({
            "orderId": "o1", "lastNodeId": "n3", "lastNodeSequenceId": 4,
            "actionStates": [
                { "actionId": "a1", "actionType": "pick", "actionStatus": status },
                { "actionId": "somebody-elses", "actionType": "beep", "actionStatus": "RUNNING" },
            ],
        });
        trace.shows(&done).wait(2.0);
        trace.commands("order", &order("o2", 0, 2, 3, 4));
        trace.judge("commands/base-kept").summary()
    };
    assert_eq!(next("RUNNING"), ["ORD-CANCEL-01 warning"]);
    assert_eq!(next("FINISHED"), Vec::<String>::new());
}

#[test]
fn a_vehicle_that_is_back_with_its_order_gets_the_rest_of_it_and_not_the_whole() {
    let updated = |update: &Value, shown: &Value| {
        let mut trace = begun();
        trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
        trace.shows(&under_way("o1", 0, 1)).wait(2.0);
        trace.vehicle("break-off").wait(2.0);
        trace.vehicle("start").wait(0.5);
        trace.shows(shown).wait(2.0);
        trace.commands("order", update);
        trace.judge("commands/updates").summary()
    };
    let same = under_way("o1", 0, 1);
    assert_eq!(updated(&order("o1", 1, 2, 4, 4), &same), Vec::<String>::new());
    assert_eq!(updated(&order("o1", 1, 0, 4, 4), &same), ["ORD-UPD-05", "ORD-UPD-03"]);
    let lost = json!({ "orderId": "o1", "nodeStates": [], "edgeStates": [] });
    assert_eq!(
        updated(&order("o1", 1, 0, 4, 4), &lost),
        Vec::<String>::new(),
        "it has given its order up"
    );
}
