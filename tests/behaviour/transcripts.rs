//! The transcripts in `docs/transcripts` are replayed: every command of them is run in one folder, ends as it says, and
//! prints the lines below it, in this order. `…` stands for anything.
//!
//! A fence of `console` holds commands behind `$ `; one that ends in ` &` goes on until the end. Any other fence with
//! `file=NAME` is written to that file. `# exit N` is the exit code that is expected, and `# needs PROGRAM` leaves a command
//! out where there is no such program. The ports 1883 and 8883 become ports that are free.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::bench::Bench;
use crate::mosquitto::free_port;
use crate::papers::certified;
use crate::tool::{Running, tool};

enum Part {
    File(String, String),
    Command(Line),
}

struct Line {
    command: String,
    background: bool,
    exit: i32,
    needs: Option<String>,
    expected: Vec<String>,
}

fn line(text: &str) -> Line {
    let (command, notes) = text.split_once("  # ").unwrap_or((text, ""));
    let command = command.trim();
    let (command, background) = match command.strip_suffix(" &") {
        Some(command) => (command, true),
        None => (command, false),
    };
    Line {
        command: command.to_owned(),
        background,
        exit: notes.strip_prefix("exit ").map_or(0, |code| code.parse().unwrap()),
        needs: notes.strip_prefix("needs ").map(str::to_owned),
        expected: Vec::new(),
    }
}

fn parts(page: &str) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    let mut lines = page.lines();
    while let Some(fence) = lines.next() {
        let Some(about) = fence.strip_prefix("```") else {
            continue;
        };
        let block: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").collect();
        if let Some((_, name)) = about.split_once("file=") {
            parts.push(Part::File(name.to_owned(), block.join("\n") + "\n"));
        } else if about == "console" {
            for text in block {
                match (text.strip_prefix("$ "), parts.last_mut()) {
                    (Some(command), _) => parts.push(Part::Command(line(command))),
                    (None, Some(Part::Command(before))) => before.expected.push(text.to_owned()),
                    (None, _) => panic!("an answer without a command: {text}"),
                }
            }
        }
    }
    // A file stands in the text where it is explained, and is there from the beginning.
    parts.sort_by_key(|part| matches!(part, Part::Command(_)));
    parts
}

/// Whether a line is like a pattern, in which `…` stands for anything.
fn is_like(pattern: &str, line: &str) -> bool {
    let pieces: Vec<&str> = pattern.trim().split('…').collect();
    let [first, middle @ .., last] = &pieces[..] else {
        return pattern.trim() == line.trim();
    };
    let Some(mut rest) = line.trim().strip_prefix(first) else {
        return false;
    };
    for piece in middle {
        let Some(at) = rest.find(piece) else { return false };
        rest = &rest[at + piece.len()..];
    }
    rest.ends_with(last)
}

/// The first expected line that does not come in its place.
fn missing<'a>(expected: &'a [String], said: &str) -> Option<&'a str> {
    let mut lines = said.lines();
    let comes = |pattern: &&String| pattern.trim() == "…" || lines.any(|line| is_like(pattern, line));
    let found = expected.iter().take_while(comes).count();
    expected.get(found).map(String::as_str)
}

fn is_there(program: &str) -> bool {
    let mut which = Command::new("sh");
    which.args(["-c", &format!("command -v {program}")]);
    which.output().is_ok_and(|output| output.status.success())
}

fn replay(page: &str, folder: &Path) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("docs/transcripts")
        .join(page);
    let text = fs::read_to_string(path).unwrap();
    let ports = [("8883", free_port()), ("1883", free_port())];
    let text = ports
        .iter()
        .fold(text, |text, (known, port)| text.replace(known, &port.to_string()));
    let own = PathBuf::from(env!("CARGO_BIN_EXE_vda5050-tck"));
    let search = format!(
        "{}:{}:/usr/sbin:/usr/local/sbin",
        own.parent().unwrap().display(),
        std::env::var("PATH").unwrap()
    );
    let start = |command: &str| {
        // Nothing of the surroundings is known to it, as to the program itself.
        let mut shell = tool(folder, &[]);
        let environment: Vec<_> = shell
            .get_envs()
            .map(|(name, value)| (name.to_owned(), value.map(ToOwned::to_owned)))
            .collect();
        shell = Command::new("bash");
        for (name, value) in environment {
            match value {
                Some(value) => shell.env(name, value),
                None => shell.env_remove(name),
            };
        }
        shell
            .args(["-c", command])
            .current_dir(folder)
            .env("PATH", &search)
            .env("VDA5050_TCK_PASSWORD", "tck-secret")
            .stdin(std::process::Stdio::null());
        Running::start(&mut shell)
    };
    let mut others = Vec::new();
    let mut count = 0;
    for part in parts(&text) {
        let line = match part {
            Part::File(name, content) => {
                fs::write(folder.join(name), content).unwrap();
                continue;
            }
            Part::Command(line) => line,
        };
        if line.needs.as_deref().is_some_and(|program| !is_there(program)) {
            eprintln!("left out: {}", line.command);
            continue;
        }
        count += 1;
        if line.background {
            let mut running = start(&format!("exec env {}", line.command));
            running.until(&line.command, |running| {
                let said = running.stdout() + &running.stderr();
                missing(&line.expected, &said).is_none().then_some(())
            });
            others.push(running);
            continue;
        }
        let ended = start(&line.command).end_within(std::time::Duration::from_secs(240));
        let said = format!("{}{}", ended.stdout, ended.stderr);
        assert_eq!(ended.status.code(), Some(line.exit), "{page}: {}\n{said}", line.command);
        if let Some(pattern) = missing(&line.expected, &said) {
            panic!("{page}: {}\ndoes not say\n{pattern}\nbut\n{said}", line.command);
        }
    }
    assert!(count > 2, "{page}: only {count} commands");
}

#[test]
fn from_a_clone_to_a_verdict() {
    replay("first-verdict.md", Bench::new().path());
}

#[test]
fn a_failing_run_is_understood_and_reproduced() {
    replay("failing-run.md", Bench::new().path());
}

#[test]
fn the_picture_of_the_course_shows_where_the_vehicle_went_wrong() {
    replay("course.md", Bench::new().path());
}

/// What is pressed on the tablet is tried where the page is tested.
#[test]
fn a_run_that_is_led_from_a_tablet_is_prepared() {
    replay("tablet.md", Bench::new().path());
}

#[test]
fn a_pipeline_gates_on_known_failures() {
    replay("pipeline.md", Bench::new().path());
}

#[test]
fn a_certificate_is_verified_and_judged_again_elsewhere() {
    let bench = Bench::new();
    // The run itself takes an hour with default time limits; this one is of a few tests, in virtual time.
    certified(&bench.path().join("run"));
    replay("certificate.md", bench.path());
}

#[test]
#[cfg(unix)]
fn a_foreign_vehicle_behind_a_broker_with_tls_password_and_rules() {
    let device = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/devices/vda-5050-lib-agv");
    let all = ["mosquitto", "mosquitto_passwd", "openssl", "node"]
        .into_iter()
        .filter(|name| !is_there(&format!("{name} || command -v /usr/sbin/{name}")));
    let missing: Vec<&str> = all.collect();
    if !missing.is_empty() || !device.join("node_modules/vda-5050-lib").exists() {
        assert!(
            std::env::var_os("CI").is_none(),
            "CI must have {missing:?} and the npm package"
        );
        eprintln!("skipped: {missing:?} or the npm package is not installed");
        return;
    }
    let bench = Bench::new();
    std::os::unix::fs::symlink(device, bench.path().join("agv")).unwrap();
    replay("foreign-vehicle.md", bench.path());
}

#[test]
fn patterns_of_a_transcript_match_what_they_should() {
    for (pattern, line, like) in [
        ("a", "a", true),
        ("a", "ab", false),
        ("a…", "ab", true),
        ("…b", "ab", true),
        ("a…c…", "abcd", true),
        ("a…d…e", "abcde", true),
        ("a…x", "abc", false),
        ("…", "", true),
    ] {
        assert_eq!(is_like(pattern, line), like, "{pattern} {line}");
    }
    assert_eq!(missing(&["a".to_owned(), "c…".to_owned()], "a\nb\ncd\n"), None);
    assert_eq!(missing(&["c".to_owned(), "a".to_owned()], "a\nb\nc\n"), Some("a"));
}
