//! The program of `device.command`: it is watched, nothing of it is left, and nobody else passes for it.

use std::time::{Duration, Instant};

use serde_json::Value;

use crate::bench::{Bench, Profile, QUICK, bundles};
use crate::broken::{WATCHING, started_by_the_harness, step_begun};
use crate::scripted::Scripted;
use crate::tool::{Ended, Running, tool};

/// A vehicle in good order, as a line of a shell script.
fn vehicle() -> String {
    let tool = env!("CARGO_BIN_EXE_vda5050-tck");
    format!(
        "'{tool}' simulate agv --broker mqtt://{{broker-host}}:{{broker-port}} --manufacturer {{manufacturer}} --serial \
         {{serial-number}}"
    )
}

/// A profile whose device is a shell script.
fn scripted(script: &str) -> Profile {
    Profile {
        device: format!("command = [\"sh\", \"-c\", {script:?}]"),
        ..Profile::default()
    }
}

/// The records of the only run there was, or is.
fn records(bench: &Bench) -> Vec<Value> {
    let journal = bench.journal();
    journal
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .collect()
}

/// Holds that it is said everywhere that the program ended by itself so.
#[track_caller]
fn says_everywhere(bench: &Bench, ended: Ended, how: &str) {
    let ended = ended
        .says(&format!("the program of `device.command` ended by itself with {how}"))
        .prints("device.command")
        .prints("its program ended by itself")
        .code(1);
    assert!(
        !ended.stdout.contains("the harness or its environment broke"),
        "{}",
        ended.stdout
    );
    let result = bench.result();
    assert_eq!(result["verdict"], "fail");
    assert_ne!(result["program"]["ends"], 0, "{result}");
    assert!(result["limits"].to_string().contains(how), "{}", result["limits"]);
    let page = std::fs::read_to_string(bench.bundle().join("report.html")).unwrap();
    assert!(page.contains(how), "the report does not say it");
    for file in ["junit.xml", "junit-requirements.xml"] {
        let junit = std::fs::read_to_string(bench.bundle().join(file)).unwrap();
        let document = roxmltree::Document::parse(&junit).unwrap();
        let failure = document
            .descendants()
            .find(|node| node.has_tag_name("failure") && node.attribute("type") == Some("device.command"));
        assert!(failure.is_some_and(|failure| failure.attribute("message").is_some_and(|text| text.contains(how))));
    }
}

#[test]
fn a_program_that_ends_at_once_is_named_with_its_last_words_and_nobody_waits_for_it() {
    let bench = Bench::new();
    let begun = Instant::now();
    let (run, _) = bench.start(&scripted("echo boom >&2; exit 7"), &[QUICK]);
    let ended = run.end();
    assert!(
        begun.elapsed() < Duration::from_secs(15),
        "it waited for a program that has ended"
    );
    assert!(ended.stderr.contains("exit status 7: boom"), "{}", ended.stderr);
    says_everywhere(&bench, ended, "exit status 7");
    bench.is_partial();
}

#[test]
fn a_program_that_cannot_be_started_is_named() {
    let bench = Bench::new();
    let profile = Profile {
        device: "command = [\"./no-such-vehicle\"]".to_owned(),
        ..Profile::default()
    };
    std::fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    bench
        .run(&["run", "--profile", "device.toml", QUICK])
        .code(2)
        .says_one_error("cannot start the device with `./no-such-vehicle`");
}

#[test]
fn a_program_that_crashes_in_the_middle_is_red_however_often_a_hook_starts_it_again() {
    let bench = Bench::new();
    // It crashes for the first time only; what comes after that is as good as it can be.
    let crash = "if [ -e crashed ]; then wait; fi; sleep 3; touch crashed; kill -9 $!; kill -9 $$";
    let profile = Profile {
        more: "[hooks.power-cycle]\nbuiltin = \"restart-command\"".to_owned(),
        ..scripted(&format!("{} & {crash}", vehicle()))
    };
    let profile = profile.with(&[("quiet", "6 s")]);
    let (run, _) = bench.start(&profile, &[WATCHING.0, QUICK]);
    says_everywhere(&bench, run.end(), "signal 9 (SIGKILL)");
    let result = bench.result();
    let quick = result["tests"]
        .as_array()
        .unwrap()
        .iter()
        .find(|test| test["id"] == QUICK);
    assert_eq!(quick.unwrap()["verdict"], "pass", "it was not judged on: {result}");
    bench.is_whole();
}

#[test]
fn a_program_that_crashes_without_a_hook_is_no_trouble_of_the_bench() {
    let bench = Bench::new();
    let profile = scripted(&format!("{} & sleep 3; kill -9 $!; exit 3", vehicle())).with(&[("quiet", "5 s")]);
    let (run, _) = bench.start(&profile, &[WATCHING.0, QUICK]);
    says_everywhere(&bench, run.end(), "exit status 3");
    bench.is_whole();
}

#[test]
fn what_a_hook_ends_has_not_ended_by_itself() {
    let profile = Profile {
        device: started_by_the_harness(),
        more: "[hooks.shutdown]\nbuiltin = \"stop-command\"\n[hooks.start]\nbuiltin = \"start-command\"".to_owned(),
        ..Profile::default()
    };
    let bench = Bench::new();
    let (run, _) = bench.start(&profile, &["connection/graceful-goodbye"]);
    let ended = run.end().code(0);
    assert!(!ended.stderr.contains("by itself"), "{}", ended.stderr);
    let program = bench.result()["program"].clone();
    assert_eq!(
        (&program["starts"], &program["ends"]),
        (&Value::from(2), &Value::from(0))
    );
    bench.is_whole();
}

/// What is left of processes that were told of this port.
#[cfg(target_os = "linux")]
fn left(port: u16) -> Vec<String> {
    let told = format!("mqtt://127.0.0.1:{port}");
    let own = std::process::id().to_string();
    let all = std::fs::read_dir("/proc").unwrap().flatten();
    let lines = all.filter(|entry| entry.file_name().to_str() != Some(&own));
    let lines = lines.filter_map(|entry| std::fs::read(entry.path().join("cmdline")).ok());
    let lines = lines.map(|line| String::from_utf8_lossy(&line).replace('\0', " "));
    lines.filter(|line| line.contains(&told)).collect()
}

#[test]
#[cfg(target_os = "linux")]
fn nothing_of_a_program_is_left_whatever_stands_around_it() {
    // A shell that ends after it, one that leaves it behind, and one that leaves its group as well.
    let scripts = [
        format!("{}; true", vehicle()),
        format!("{} & sleep 300", vehicle()),
        format!("setsid sh -c \"{} & sleep 300\" & sleep 300", vehicle()),
    ];
    for script in scripts {
        let bench = Bench::new();
        let (run, port) = bench.start(&scripted(&script), &[QUICK]);
        run.end().code(0);
        assert_eq!(left(port), Vec::<String>::new(), "after {script}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn nothing_of_a_program_is_left_when_the_harness_is_killed() {
    let bench = Bench::new();
    let script = format!("setsid sh -c \"{} & sleep 300\" & sleep 300", vehicle());
    let (mut run, port) = bench.start(&scripted(&script), &[WATCHING.0]);
    step_begun(&bench, &mut run, WATCHING);
    assert_ne!(left(port), Vec::<String>::new());
    run.kill();
    let killed = Instant::now();
    while !left(port).is_empty() {
        assert!(killed.elapsed() < Duration::from_secs(5), "{:?}", left(port));
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Nobody else passes for the device, and it is said who tried.
#[track_caller]
#[cfg(target_os = "linux")]
fn is_undecided(bench: &Bench, ended: &Ended) {
    let code = ended.status.code();
    assert!(
        matches!(code, Some(3 | 5)),
        "{code:?}\n{}\n{}",
        ended.stdout,
        ended.stderr
    );
    let result = bench.result();
    assert_eq!(result["verdict"], "inconclusive", "{result}");
    let limits = result["limits"].to_string();
    assert!(
        limits.contains("which is not what `device.command` has started but process"),
        "{limits}"
    );
    assert!(result["mixed"].is_string(), "{result}");
    let junit = std::fs::read_to_string(bench.bundle().join("junit.xml")).unwrap();
    assert!(junit.contains("nobody else was taken for the device"), "{junit}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_vehicle_that_was_left_over_does_not_pass_for_one_that_does_not_connect() {
    let bench = Bench::new();
    let profile = scripted("sleep 300").with(&[("connect", "4 s")]);
    let (run, port) = bench.start(&profile, &[QUICK]);
    let _yesterday = bench.agv(port, &[]);
    let ended = run.end().says("no device connected within 4 s");
    is_undecided(&bench, &ended);
    bench.is_partial();
}

#[test]
#[cfg(target_os = "linux")]
fn a_vehicle_that_was_left_over_does_not_pass_for_one_that_has_ended() {
    let bench = Bench::new();
    let (run, port) = bench.start(&scripted("sleep 2; echo new firmware does not start; exit 7"), &[QUICK]);
    let _yesterday = bench.agv(port, &[]);
    says_everywhere(&bench, run.end(), "exit status 7");
    let passed = bench.result()["tests"].to_string().contains("\"pass\"");
    assert!(!passed, "somebody else has passed");
    bench.is_partial();
}

#[test]
#[cfg(target_os = "linux")]
fn a_vehicle_beside_the_one_that_was_started_leaves_the_run_undecided() {
    let bench = Bench::new();
    let profile = Profile {
        device: started_by_the_harness(),
        ..Profile::default().with(&[("quiet", "3 s")])
    };
    let (mut run, port) = bench.start(&profile, &[WATCHING.0, QUICK]);
    step_begun(&bench, &mut run, WATCHING);
    // Another client id, but the topics of the vehicle and its last will.
    let mut other = Scripted::online(port);
    for _ in 0..5 {
        other.say_state();
    }
    let ended = run.end();
    is_undecided(&bench, &ended);
    bench.is_whole();
}

#[test]
#[cfg(target_os = "linux")]
fn a_vehicle_that_takes_the_client_id_of_the_one_that_was_started_leaves_the_run_undecided() {
    let bench = Bench::new();
    let profile = Profile {
        device: started_by_the_harness(),
        ..Profile::default().with(&[("quiet", "6 s")])
    };
    let (mut run, port) = bench.start(&profile, &[WATCHING.0, QUICK]);
    step_begun(&bench, &mut run, WATCHING);
    let _yesterday = bench.agv(port, &[]);
    let ended = run.end();
    is_undecided(&bench, &ended);
    bench.is_whole();
}

/// Leaves the vehicle with an order until its postamble.
const WAITING: &str = "order-acceptance/horizon-not-entered";

#[test]
#[cfg(unix)]
fn what_ends_the_harness_by_the_terminal_does_not_reach_the_program() {
    use std::os::unix::process::CommandExt as _;

    let bench = Bench::new();
    let mut profile = Profile::default().with(&[("quiet", "40 s")]);
    profile.motion = true;
    profile.device = started_by_the_harness();
    std::fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    let mut command = tool(bench.path(), &["run", "--profile", "device.toml", WAITING]);
    let mut run = Running::start(command.process_group(0));
    step_begun(&bench, &mut run, (WAITING, "steps[1]"));
    // As Ctrl-C at a terminal does, and `timeout`: to the whole process group.
    let group = rustix::process::Pid::from_raw(i32::try_from(run.id()).unwrap()).unwrap();
    rustix::process::kill_process_group(group, rustix::process::Signal::INT).unwrap();
    run.end().code(130).says("ending in good order, up to 60 s");
    let all = records(&bench);
    let place = |wanted: &dyn Fn(&Value) -> bool| all.iter().position(|record| wanted(&record["event"]));
    let interrupted = place(&|event| event["kind"] == "interrupted").expect("the interruption is no event");
    let cancelled = all[interrupted..]
        .iter()
        .any(|record| record.to_string().contains("cancelOrder"));
    assert!(cancelled, "the order was not called off after it");
    assert_eq!(
        place(&|event| event["kind"] == "closed"),
        None,
        "the device was reached"
    );
    assert_eq!(place(&|event| event["program"]["what"] == "ended"), None);
    assert_eq!(bench.result()["program"]["ends"], 0);
    bench.is_partial();
}

#[test]
fn nothing_that_happens_after_an_interruption_is_held_against_the_device() {
    let bench = Bench::new();
    let (mut run, port) = bench.start(&Profile::default().with(&[("quiet", "40 s")]), &[WATCHING.0]);
    let mut agv = bench.agv(port, &[]);
    step_begun(&bench, &mut run, WATCHING);
    run.interrupt();
    run.line("ending in good order");
    // It was started from the same terminal, which ends it as well.
    agv.kill();
    run.end().code(130);
    let result = bench.result();
    assert_eq!(result["verdict"], "inconclusive", "{result}");
    let accused = |verdict: &str| result.to_string().contains(&format!("\"verdict\":\"{verdict}\""));
    assert!(!accused("fail") && !accused("warning"), "{result}");
    assert!(
        !result["tests"].to_string().contains("closed its connection"),
        "{result}"
    );
    bench.is_partial();
}

#[test]
fn whoever_does_not_wait_for_the_end_still_gets_a_report() {
    let bench = Bench::new();
    let profile = Profile {
        motion: true,
        ..Profile::default().with(&[("quiet", "40 s"), ("react", "40 s"), ("drive", "40 s")])
    };
    let (mut run, port) = bench.start(&profile, &[WAITING]);
    let agv = bench.agv(port, &[]);
    step_begun(&bench, &mut run, (WAITING, "steps[1]"));
    // It answers nothing any more, so that the end in good order takes its time.
    agv.signal("STOP");
    run.interrupt();
    run.line("ending in good order");
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(bundles(&bench.path().join("reports")).len(), 1);
    let again = Instant::now();
    run.interrupt();
    run.end().code(130).says("quitting: the report is written");
    assert!(again.elapsed() < Duration::from_secs(15), "it waited all the same");
    agv.signal("CONT");
    bench.is_partial();
    let reason = bench.result()["partial_reason"].to_string();
    assert!(reason.contains("may go on with it"), "{reason}");
}
