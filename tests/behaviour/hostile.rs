//! Devices that are wrong on purpose. Each run ends in an orderly verdict, or with one clear error.

use std::time::{Duration, Instant};

use serde_json::json;

use crate::bench::{Bench, Profile, QUICK};
use crate::scripted::Scripted;
use crate::tool::Ended;

/// A run against a device that comes online, sends a state, and then does this while it is judged.
fn run_against(act: impl FnOnce(&mut Scripted)) -> (Bench, Ended) {
    run_of(&Profile::impatient(), act)
}

fn run_of(profile: &Profile, act: impl FnOnce(&mut Scripted)) -> (Bench, Ended) {
    let bench = Bench::new();
    let (run, port) = bench.start(profile, &[QUICK]);
    let mut device = Scripted::online(port);
    device.say_state();
    act(&mut device);
    let ended = run.end();
    drop(device);
    (bench, ended)
}

/// Whether a monitor or a test has broken this requirement.
fn broken(bench: &Bench, requirement: &str) -> bool {
    let result = bench.result();
    let all = result["requirements"].as_array().unwrap();
    all.iter()
        .any(|one| one["id"] == requirement && one["verdict"] == "fail")
}

#[test]
fn a_device_that_answers_nothing_fails_what_it_was_asked() {
    let (bench, ended) = run_against(|_| {});
    ended.code(1).prints("ACT-40");
    bench.is_whole();
}

#[test]
fn five_thousand_messages_a_second_end_in_a_verdict() {
    let (bench, ended) = run_against(|device| {
        let begun = Instant::now();
        for batch in 1..=300_u32 {
            (0..50).for_each(|_| device.say_state());
            let due = Duration::from_millis(10) * batch;
            std::thread::sleep(due.saturating_sub(begun.elapsed()));
        }
    });
    ended.code(1).prints("floods the harness");
    let journal = bench.journal();
    let states = journal
        .matches("\"kind\":\"message\",\"topic\":\"uagv/v2/ACME/0001/state\"")
        .count();
    assert!(states > 1000, "only {states} states were seen");
}

#[test]
fn a_payload_of_20_mb_is_kept_by_its_hash() {
    let (bench, ended) = run_against(|device| device.publish("state", &vec![b'x'; 20 << 20], false));
    ended.code(1);
    let journal = std::fs::metadata(bench.bundle().join("journal.jsonl")).unwrap();
    assert!(journal.len() < 1 << 20, "{} bytes of journal", journal.len());
    bench.is_whole();
}

#[test]
fn a_state_that_is_no_text_is_named() {
    let (bench, ended) = run_against(|device| device.publish("state", b"{\"orderId\": \"\xff\xfe\"}", false));
    ended.code(1).prints("UTF-8");
    bench.is_whole();
}

#[test]
fn deep_nesting_and_strange_numbers_harm_nobody() {
    let (bench, ended) = run_against(|device| {
        device.publish("state", "[".repeat(200_000).as_bytes(), false);
        device.publish(
            "state",
            format!("{{\"headerId\": {}}}", "9".repeat(4000)).as_bytes(),
            false,
        );
        device.publish(
            "state",
            b"{\"headerId\": 1e999, \"headerId\": -0.0, \"nodeStates\": 5, \"errors\": {}}",
            false,
        );
        device.publish("state", b"", false);
        device.publish("connection", b"null", true);
    });
    ended.code(1);
    bench.is_whole();
}

#[test]
fn half_a_packet_and_then_silence_is_waited_for_only_so_long() {
    // PUBLISH that announces 100 bytes and brings ten.
    let (bench, ended) = run_against(|device| device.raw(b"\x30\x64\x00\x05state123"));
    ended.code(1);
    bench.is_whole();
}

#[test]
fn half_a_connect_is_no_device() {
    let bench = Bench::new();
    let (run, port) = bench.start(&Profile::default().with(&[("connect", "500 ms")]), &[QUICK]);
    let mut socket = std::net::TcpStream::connect(("127.0.0.1", port)).unwrap();
    std::io::Write::write_all(&mut socket, b"\x10\x40\x00\x04MQ").unwrap();
    run.end().code(5).says_one_error("no device connected");
    bench.is_partial();
}

#[test]
fn bytes_that_are_no_mqtt_are_no_device() {
    let bench = Bench::new();
    let (run, port) = bench.start(&Profile::default().with(&[("connect", "500 ms")]), &[QUICK]);
    let mut socket = std::net::TcpStream::connect(("127.0.0.1", port)).unwrap();
    let _ = std::io::Write::write_all(&mut socket, b"GET / HTTP/1.1\r\nHost: \x00\xff\r\n\r\n");
    run.end().code(5).says_one_error("no device connected");
    bench.is_partial();
}

#[test]
fn garbage_on_a_good_connection_is_held_against_the_device() {
    let (bench, ended) = run_against(|device| device.raw(&[0xff; 64]));
    assert!(matches!(ended.status.code(), Some(1 | 3)), "{ended:?}");
    let journal = bench.journal();
    assert!(
        journal.contains("\"kind\":\"undecodable\"") || journal.contains("malformed"),
        "the bytes are not in the journal"
    );
    bench.is_whole();
}

#[test]
fn hostile_strings_reach_no_page_and_no_terminal() {
    const SCRIPT: &str = "<script>alert('x')</script>]]>\u{1b}[2J\u{0}\u{8}\u{202e}&\"'";
    let (bench, ended) = run_against(|device| {
        let sheet = device.message(&json!({
            "typeSpecification": { "seriesName": SCRIPT, "agvKinematic": SCRIPT },
            "protocolFeatures": {
                "agvActions": [{ "actionType": SCRIPT, "actionScopes": [SCRIPT] }],
                "optionalParameters": [{ "parameter": SCRIPT, "support": SCRIPT }],
            },
        }));
        device.publish("factsheet", sheet.to_string().as_bytes(), true);
        let mut state = device.state();
        state["orderId"] = SCRIPT.into();
        state["operatingMode"] = SCRIPT.into();
        state[SCRIPT] = SCRIPT.into();
        state["errors"] = json!([{ "errorType": SCRIPT, "errorLevel": SCRIPT }]);
        device.publish("state", state.to_string().as_bytes(), false);
    });
    let ended = ended.code(1);
    let page = std::fs::read_to_string(bench.bundle().join("report.html")).unwrap();
    assert!(page.contains("alert("), "the page does not show what the device said");
    assert!(!page.contains("<script>alert"), "the page has a script of the device");
    let control = |text: &str| {
        text.chars()
            .find(|c| (c.is_control() && *c != '\n') || *c == '\u{202e}')
    };
    assert_eq!(control(&page), None, "a control character in the page");
    assert_eq!(
        control(&ended.stdout),
        None,
        "a control character on the terminal:\n{}",
        ended.stdout
    );
    assert_eq!(control(&ended.stderr), None);
    bench.is_whole();
    assert!(broken(&bench, "FACT-07") || broken(&bench, "STATE-01") || ended.stdout.contains("operatingMode"));
}
