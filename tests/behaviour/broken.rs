//! Devices and brokers that are not there, or not any more.

use std::time::{Duration, Instant};

use crate::bench::{Bench, Profile, QUICK, REFUSAL};
use crate::mosquitto::Mosquitto;
use crate::scripted::Scripted;
use crate::tool::Running;

/// Waits until the journal of the run shows this step of this test begun.
pub fn step_begun(bench: &Bench, run: &mut Running, (test, path): (&str, &str)) {
    let test = format!("\"kind\":\"test-begun\",\"test\":\"{test}\"");
    let step = format!("\"kind\":\"step-begun\",\"path\":\"{path}\"");
    run.until(&step, |_| {
        let journal = crate::bench::bundles(&bench.path().join("reports"))
            .pop()?
            .join("journal.jsonl");
        let text = std::fs::read_to_string(journal).ok()?;
        text[text.find(&test)?..].contains(&step).then_some(())
    });
}

/// A quick test that runs after [`WATCHING`].
pub const LATER: &str = "state/requested";
/// A test that does not move the vehicle, and its step that does nothing but watch for `time.quiet`.
pub const WATCHING: (&str, &str) = ("order-rejection/validation-error-stays", "steps[2]");

#[test]
fn a_device_that_never_comes_is_5_and_leaves_a_partial_report() {
    let bench = Bench::new();
    let (run, _) = bench.start(&Profile::default().with(&[("connect", "300 ms")]), &[QUICK]);
    run.end().code(5).says_one_error("no device connected within 300 ms");
    bench.is_partial();
}

#[test]
fn a_device_that_sends_no_state_fails_and_leaves_a_partial_report() {
    let bench = Bench::new();
    let (run, port) = bench.start(&Profile::default().with(&[("state-period", "500 ms")]), &[QUICK]);
    let _device = Scripted::online(port);
    // What it has shown so far breaks the standard already, and that stands.
    run.end()
        .code(1)
        .says_one_error("sent no state within 500 ms")
        .prints("STATE-02");
    bench.is_partial();
}

#[test]
fn a_device_killed_in_the_middle_of_a_test_leaves_the_rest_undecided() {
    let bench = Bench::new();
    let (mut run, port) = bench.start(
        &Profile::default().with(&[("quiet", "2 s"), ("drive", "1 s"), ("react", "3 s"), ("slow", "1 s")]),
        &[WATCHING.0, LATER],
    );
    let mut agv = bench.agv(port, &[]);
    step_begun(&bench, &mut run, WATCHING);
    agv.kill();
    let ended = run.end().says("; waiting for it");
    assert_ne!(ended.status.code(), Some(0), "{}", ended.stdout);
    let result = bench.result();
    let rest = result["tests"]
        .as_array()
        .unwrap()
        .iter()
        .find(|test| test["id"] == LATER)
        .unwrap();
    assert_eq!(rest["verdict"], "inconclusive", "{rest}");
    assert!(
        rest["reason"].as_str().unwrap().contains("the device is gone"),
        "{rest}"
    );
    bench.is_whole();
}

/// A reference AGV that the harness starts itself.
pub fn started_by_the_harness() -> String {
    let tool = env!("CARGO_BIN_EXE_vda5050-tck");
    format!(
        "command = [{tool:?}, \"simulate\", \"agv\", \"--broker\", \"mqtt://{{broker-host}}:{{broker-port}}\", \
         \"--manufacturer\", \"{{manufacturer}}\", \"--serial\", \"{{serial-number}}\"]"
    )
}

#[test]
fn links_to_maps_name_the_host_of_the_profile_and_lead_to_its_files() {
    let bench = Bench::new();
    let map = bench.path().join("hall.map");
    std::fs::write(&map, "resolution 0.05\n").unwrap();
    let profile = Profile {
        device: started_by_the_harness(),
        bench: "maps-listen = \"0.0.0.0:0\"\nmaps-host = \"127.0.0.2\"".to_owned(),
        more: format!("[maps]\nfiles = [{map:?}]"),
        ..Profile::default()
    };
    let (run, _) = bench.start(&profile, &["maps/download"]);
    run.end().code(0);
    let journal = bench.journal();
    assert!(
        journal.contains("\"url\":\"http://127.0.0.2:"),
        "the link names another host"
    );
    let sha256 = "5d60c106967c72309233e066016751f08d3f24360498f93d62c11f571c743547";
    assert!(journal.contains(sha256), "another file was served");
    bench.is_whole();
}

#[test]
fn without_a_map_that_the_device_can_read_or_reach_nobody_is_accused_of_a_download() {
    let reasons = [
        ("", "", "the profile names no map file"),
        (
            "maps-listen = \"0.0.0.0:0\"",
            "[maps]\nfiles = [\"device.toml\"]",
            "no device can fetch a map from 0.0.0.0",
        ),
    ];
    for (settings, more, reason) in reasons {
        let bench = Bench::new();
        let profile = Profile {
            device: started_by_the_harness(),
            bench: settings.to_owned(),
            more: more.to_owned(),
            ..Profile::default()
        };
        let (run, _) = bench.start(&profile, &["maps/download"]);
        run.end().code(3);
        let test = &bench.result()["tests"][0];
        assert_eq!(test["verdict"], "inconclusive", "{test}");
        assert!(test["reason"].as_str().unwrap().contains(reason), "{test}");
    }
}

#[test]
fn a_device_that_is_started_again_by_the_harness_is_judged_on() {
    let profile = Profile {
        device: started_by_the_harness(),
        more: "[hooks.power-cycle]\nbuiltin = \"restart-command\"".to_owned(),
        ..Profile::default()
    };
    let bench = Bench::new();
    let (run, _) = bench.start(&profile, &["connection/online-after-start", QUICK]);
    run.end().code(0);
    bench.is_whole();
}

#[test]
fn a_device_that_the_harness_ends_in_good_order_signs_off_and_comes_back() {
    let profile = Profile {
        device: started_by_the_harness(),
        more: "[hooks.shutdown]\nbuiltin = \"stop-command\"\n[hooks.start]\nbuiltin = \"start-command\"".to_owned(),
        ..Profile::default()
    };
    let bench = Bench::new();
    let (run, _) = bench.start(&profile, &["connection/graceful-goodbye", QUICK]);
    run.end().code(0);
    let tests = bench.result()["tests"].clone();
    let goodbye = tests
        .as_array()
        .unwrap()
        .iter()
        .find(|test| test["id"] == "connection/graceful-goodbye");
    assert_eq!(goodbye.unwrap()["verdict"], "pass", "{tests}");
    bench.is_whole();
}

#[test]
fn a_broker_killed_in_the_middle_of_a_test_is_5_and_the_journal_is_kept() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let profile = Profile {
        bench: format!("broker = \"{}\"", mosquitto.url()),
        ..Profile::default().with(&[("quiet", "30 s")])
    };
    let (mut run, port) = bench.start(&profile, &[WATCHING.0, LATER]);
    let _agv = bench.agv(port, &[]);
    step_begun(&bench, &mut run, WATCHING);
    mosquitto.kill();
    let killed = Instant::now();
    run.end()
        .code(5)
        .says_one_error("broker")
        .says("the partial report is in");
    assert!(
        killed.elapsed() < Duration::from_secs(15),
        "it waited for a broker that is gone"
    );
    bench.is_partial();
}

#[test]
fn without_a_tap_a_device_at_an_external_broker_is_judged_as_far_as_it_can_be_seen() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let profile = Profile {
        bench: format!("broker = \"{}\"\ntap = false", mosquitto.url()),
        ..Profile::default()
    };
    let (run, port) = bench.start(&profile, &[REFUSAL]);
    assert_eq!(port, mosquitto.port);
    let _agv = bench.agv(port, &[]);
    run.end().code(0);
    assert_eq!(bench.result()["vantage"], "subscriber");
    bench.is_whole();
}

#[test]
#[cfg(unix)]
fn a_report_that_cannot_be_written_does_not_take_back_what_was_found() {
    let bench = Bench::new();
    let (mut run, port) = bench.start(&Profile::default().with(&[("quiet", "2 s")]), &[WATCHING.0]);
    let _agv = bench.agv(port, &["factsheet-without-header"]);
    step_begun(&bench, &mut run, WATCHING);
    // Where the report should be is a folder: to the program the same as a disk that is full.
    std::fs::create_dir(bench.bundle().join("report.html")).unwrap();
    let ended = run.end().code(1).says_one_error("cannot write").prints("FAIL");
    assert!(ended.stderr.contains("report.html"), "{}", ended.stderr);
    assert!(!bench.bundle().join(".report.html.draft").exists(), "a draft is left");
}
