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

#[test]
fn a_failure_shows_what_was_sent_in_plain_words() {
    let bench = Bench::new();
    let wrong = "order-rejection/malformed[update-id-of-wrong-type]";
    let ended = bench
        .run(&["run", "--virtual", wrong, "--fault", "rejection-silent"])
        .code(1)
        .prints("orderUpdateId \"first\" (a text)")
        .prints("a new error");
    // The clause of the suite is quoted as it is written.
    let is_quoted = |line: &&str| {
        line.trim_start()
            .trim_start_matches(|c: char| c.is_ascii_digit())
            .starts_with(" |")
    };
    for line in ended.stdout.lines().filter(|line| !is_quoted(line)) {
        assert!(!line.contains('$') && !line.contains("{}"), "{line}");
    }
    let result = bench.result();
    let decisions = result["tests"][0]["decisions"].as_array().unwrap();
    let broken: Vec<&Value> = decisions.iter().filter(|one| one["verdict"] == "fail").collect();
    assert!(!broken.is_empty());
    for decision in broken {
        let sent = &decision["sent"];
        assert_eq!(sent["topic"], "order");
        assert_eq!(sent["members"][0]["path"], "orderUpdateId");
        assert_eq!(sent["members"][0]["value"], "\"first\" (a text)");
        let seq = sent["seq"].as_u64().unwrap();
        let line = bench
            .journal()
            .lines()
            .nth(usize::try_from(seq).unwrap() - 1)
            .unwrap()
            .to_owned();
        assert!(line.contains("\"kind\":\"sent\"") && line.contains("first"), "{line}");
    }
    let page = std::fs::read_to_string(bench.bundle().join("report.html")).unwrap();
    assert!(page.contains("Sent before") && page.contains("<code>orderUpdateId</code>"));
    bench.is_whole();
}

#[test]
fn a_member_that_is_left_out_and_bytes_that_are_no_message_are_shown_too() {
    let bench = Bench::new();
    let silent = ["--fault", "rejection-silent"];
    let missing = "order-rejection/malformed[node-id-missing]";
    bench
        .run(&[&["run", "--virtual", missing], &silent[..]].concat())
        .code(1)
        .prints("nodes[0].nodeId left out");
    bench
        .run(&[&["run", "--virtual", crate::bench::REFUSAL], &silent[..]].concat())
        .code(1)
        .prints("order: the bytes \"");
}
