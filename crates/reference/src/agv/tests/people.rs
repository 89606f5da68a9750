use super::*;

#[test]
fn manual_mode_clears_the_order_at_once() {
    let mut bench = Bench::new();
    let beep = action("beep", "a", "NONE", json!({}));
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/nodes/1/actions/-", beep));
    bench.wait(0.5);
    bench.command("set-mode", json!({ "mode": "MANUAL" }));
    let state = bench.state();
    assert_eq!(
        (&state["operatingMode"], &state["nodeStates"]),
        (&json!("MANUAL"), &json!([]))
    );
    assert_eq!((bench.status("a"), &state["driving"]), ("FAILED".into(), &json!(false)));
    bench.command("move-to", json!({ "x": 3.0, "y": 3.0 }));
    assert_eq!(bench.state()["agvPosition"]["y"], 3.0);
    bench.command("set-mode", json!({ "mode": "AUTOMATIC" }));
    bench.wait(10.0);
    assert_eq!(bench.state()["driving"], false);
}

#[test]
fn the_emergency_stop_stops_and_the_order_goes_on_after_it() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(0.5);
    bench.command("emergency-stop", json!({}));
    let state = bench.state();
    assert_eq!(
        (&state["safetyState"]["eStop"], &state["driving"]),
        (&json!("MANUAL"), &json!(false))
    );
    assert_eq!(state["errors"][0]["errorLevel"], "FATAL");
    bench.wait(20.0);
    bench.command("release-emergency-stop", json!({}));
    let state = bench.state();
    assert_eq!(
        (&state["safetyState"]["eStop"], &state["driving"], &state["errors"]),
        (&json!("NONE"), &json!(true), &json!([]))
    );
    bench.wait(5.0);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn the_pause_button_is_stronger_than_stop_pause() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.command("press-pause", json!({}));
    assert_eq!(
        (&bench.state()["paused"], &bench.state()["driving"]),
        (&json!(true), &json!(false))
    );
    bench.instant("stopPause", "s", json!({}));
    assert_eq!(
        (bench.status("s"), bench.state()["paused"].clone()),
        ("FAILED".into(), json!(true))
    );
    bench.command("release-pause", json!({}));
    assert_eq!(
        (&bench.state()["paused"], &bench.state()["driving"]),
        (&json!(false), &json!(true))
    );
}

#[test]
fn a_violated_field_holds_actions_and_lets_them_go_on() {
    let mut bench = Bench::new();
    let beep = action("beep", "a", "NONE", json!({}));
    bench.order(with(order("o1", 0, 0, "n1"), "/nodes/0/actions/-", beep));
    bench.command("enter-field", json!({}));
    assert_eq!(
        (
            bench.status("a"),
            bench.state()["safetyState"]["fieldViolation"].clone()
        ),
        ("PAUSED".into(), json!(true))
    );
    bench.command("leave-field", json!({}));
    bench.wait(1.0);
    assert_eq!(bench.status("a"), "FINISHED");
}

#[test]
fn the_vehicle_can_be_put_on_another_node() {
    let mut bench = Bench::new();
    bench.command("place-on", json!({ "nodeId": "n4" }));
    let state = bench.state();
    assert_eq!(
        (&state["lastNodeId"], &state["agvPosition"]["y"]),
        (&json!("n4"), &json!(3.0))
    );
    bench.order(order("o1", 0, 0, "n4 n5"));
    assert_eq!(bench.state()["orderId"], "o1");
}

#[test]
fn a_load_put_on_by_hand_is_reported() {
    let mut bench = Bench::new();
    let before = bench.states().len();
    bench.command("place-load", json!({ "loadId": "L", "loadType": "EPAL" }));
    assert_eq!(
        (bench.states().len(), bench.state()["loads"][0]["loadId"].clone()),
        (before + 1, json!("L"))
    );
    bench.command("remove-load", json!({}));
    assert_eq!(bench.state()["loads"], json!([]));
}
