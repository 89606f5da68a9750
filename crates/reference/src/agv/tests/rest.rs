//! A vehicle at rest words its messages once.

use proptest::prelude::*;

use super::*;
use crate::agv::hooks::Hooks;
use crate::hooks::Memory;

fn talkative() -> AgvConfig {
    AgvConfig {
        state_interval: Duration::from_secs(2),
        visualization_interval: Some(Duration::from_millis(1_500)),
        answers_after: Duration::from_millis(40),
        ..config()
    }
}

/// A vehicle that may do something otherwise at any time, and never does: it words everything anew.
fn restless(config: AgvConfig) -> Bench {
    let mut bench = Bench::off(config, &[]);
    bench.agv.switch_on(Hooks::new(Memory::One(())));
    bench.give(Input::Connected);
    bench
}

/// Something that happens to a vehicle.
fn happens(bench: &mut Bench, what: usize, number: usize) {
    let id = format!("o{number}");
    let routes = ["n1 n2 | n3", "n1 n2 n3", "n2 n3 n4", "n3 n4 | n5", "n1"];
    match what {
        0 => bench.order(order(&id, 0, 0, routes[number % routes.len()])),
        1 => bench.order(order(&format!("o{}", number.saturating_sub(1)), 1, 2, "n2 n3")),
        2 => bench.instant("startPause", &id, json!({})),
        3 => bench.instant("stopPause", &id, json!({})),
        4 => bench.instant("stateRequest", &id, json!({})),
        5 => bench.instant("cancelOrder", &id, json!({})),
        6 => {
            bench.give(Input::ConnectionLost);
            bench.wait(0.3);
            bench.give(Input::Connected);
        }
        7 => bench.command("emergency-stop", json!({})),
        8 => bench.command("release-emergency-stop", json!({})),
        9 => bench.command("place-on", json!({ "nodeId": "n4" })),
        10 => bench.command("move-to", json!({ "x": 0.01, "y": 0.0 })),
        11 => {
            let mode = ["MANUAL", "AUTOMATIC"][number % 2];
            bench.command("set-mode", json!({ "mode": mode }));
        }
        12 => bench.send_raw("order", "{"),
        13 => bench.command("place-load", json!({ "loadId": id, "loadType": "EPAL" })),
        14 => bench.command("set-battery", json!({ "charge": 12.5 })),
        15 => bench.command("well-behaved", json!({})),
        _ => {}
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn what_a_vehicle_at_rest_says_is_what_it_would_word_anew(
        events in proptest::collection::vec((0_usize..18, 0_u32..120), 1..24),
    ) {
        let mut quick = Bench::with(talkative(), &[]);
        let mut slow = restless(talkative());
        for (number, (what, tenths)) in events.into_iter().enumerate() {
            for bench in [&mut quick, &mut slow] {
                happens(bench, what, number);
                bench.wait(f64::from(tenths) / 10.0);
            }
        }
        prop_assert!(!slow.agv.rest.lasts);
        prop_assert_eq!(quick.outputs, slow.outputs);
    }
}

#[test]
fn it_rests_while_it_stands_and_wakes_with_what_comes_in() {
    let mut bench = Bench::with(talkative(), &[]);
    bench.wait(5.0);
    assert!(bench.agv.rest.lasts);
    let before = bench.states().len();
    bench.wait(20.0);
    assert!(bench.agv.rest.lasts);
    assert_eq!(bench.states().len() - before, 10);
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(0.5);
    assert!(!bench.agv.rest.lasts, "it drives");
    assert_eq!(bench.state()["driving"], true);
    bench.wait(30.0);
    assert!(bench.agv.rest.lasts);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn a_driver_that_was_away_gets_every_state_of_the_time_between() {
    let mut quick = Bench::with(talkative(), &[]);
    let mut slow = restless(talkative());
    for bench in [&mut quick, &mut slow] {
        bench.wait(3.0);
        bench.now = bench.now.at(bench.now.moment + Duration::from_secs(61));
        bench.give(Input::Time);
    }
    assert_eq!(quick.outputs, slow.outputs);
}

#[test]
fn a_fault_that_may_take_hold_keeps_it_from_resting() {
    let name = deviations::FAULTS[0].name;
    let mut bench = Bench::with(talkative(), &[name]);
    bench.wait(10.0);
    assert!(!bench.agv.rest.lasts, "{name}");
}
