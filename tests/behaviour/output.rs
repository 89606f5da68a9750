//! Data on standard output, progress on standard error, and nothing for a terminal that is none.

use std::io::Read as _;
use std::process::Stdio;

use serde_json::Value;

use crate::bench::{Bench, QUICK, REFUSAL};
use crate::tool::{run, tool};

#[test]
fn the_format_for_programs_is_one_document_and_nothing_else() {
    let bench = Bench::new();
    let ended = bench
        .run(&["run", "--virtual", QUICK, REFUSAL, "--format", "json", "-vv"])
        .code(0);
    let printed: Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(printed, bench.result());
    assert!(
        ended.stderr.contains("device.role = "),
        "the settings are no data:\n{}",
        ended.stderr
    );
}

#[test]
fn a_verdict_is_data_and_progress_is_not() {
    let ended = run(&["run", "--virtual", QUICK, REFUSAL]).code(0);
    for id in [QUICK, REFUSAL] {
        let lines: Vec<&str> = ended.stdout.lines().filter(|line| line.contains(id)).collect();
        assert!(lines.len() == 1 && lines[0].starts_with("pass "), "{}", ended.stdout);
    }
    assert!(ended.stdout.contains("root    sha256:"));
    assert!(
        !ended.stdout.contains("2 tests") && ended.stderr.contains("2 tests"),
        "{}",
        ended.stderr
    );
}

#[test]
fn nothing_is_coloured_where_nobody_looks() {
    for arguments in [
        &["run", "--virtual", REFUSAL, "--fault", "validation-error-fatal"][..],
        &["run", "--nonsense"],
        &["list", "hooks"],
    ] {
        let ended = run(arguments);
        assert!(
            !ended.stdout.contains('\u{1b}') && !ended.stderr.contains('\u{1b}'),
            "{arguments:?}: {ended:?}"
        );
    }
}

#[test]
fn no_color_wins_over_a_wish_for_colour() {
    let bench = Bench::new();
    let arguments = ["run", "--virtual", REFUSAL, "--fault", "validation-error-fatal"];
    let with = |name: &str, value: &str| {
        let mut command = tool(bench.path(), &arguments);
        command.env("CLICOLOR_FORCE", "1").env(name, value);
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        output.stdout.contains(&0x1b)
    };
    assert!(
        with("UNUSED", "1"),
        "colour that was asked for did not come, so this test shows nothing"
    );
    assert!(!with("NO_COLOR", "1"));
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    for arguments in [
        &["list", "requirements"][..],
        &["run", "--virtual", "order-rejection/unreadable"],
        &["--help"],
        &["explain", "ORD-REJ-03"],
    ] {
        let bench = Bench::new();
        let mut child = tool(bench.path(), arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // `head -1`: one byte, and then nobody reads any more.
        let mut stdout = child.stdout.take().unwrap();
        let _ = stdout.read(&mut [0]);
        drop(stdout);
        let output = child.wait_with_output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(
            !stderr.contains("panicked") && !stderr.contains("error"),
            "{arguments:?}: {stderr}"
        );
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {stderr}");
    }
}

#[test]
fn nobody_who_reads_at_all_is_no_failure_either() {
    let bench = Bench::new();
    let mut child = tool(bench.path(), &["run", "--virtual", "order-rejection/unreadable"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
    bench.is_whole();
}
