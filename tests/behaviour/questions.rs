//! Questions to a person who is not at the terminal: they are events, and can be answered over HTTP on this machine.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::bench::{Bench, Profile};
use crate::following::events;

/// Asks for an operating mode.
const MODE: &str = "modes/reported[teach-in]";

/// No test needs longer, on a machine as busy as it may be.
const LIMIT: Duration = Duration::from_secs(60);

fn profile(timeout: &str) -> Profile {
    let mut profile = Profile::impatient();
    profile.more = format!("[hooks.set-mode]\nprompt = \"Turn the key to {{mode}}.\"\ntimeout = \"{timeout}\"\n");
    profile
}

/// What is served there; nothing when nobody serves any more.
fn request(url: &str, method: &str, what: &str, body: &str) -> Option<(u16, Value)> {
    let (host, token) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
    let mut stream = TcpStream::connect(host).ok()?;
    let length = body.len();
    write!(
        stream,
        "{method} /{token}/{what} HTTP/1.1\r\nhost: {host}\r\nconnection: close\r\ncontent-length: {length}\r\n\r\n{body}"
    )
    .ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).ok()?;
    let status = answer.split(' ').nth(1)?.parse().ok()?;
    let (_, body) = answer.split_once("\r\n\r\n")?;
    Some((status, serde_json::from_str(body).ok()?))
}

#[test]
fn a_question_is_an_event_and_is_answered_from_elsewhere() {
    let bench = Bench::new();
    let arguments = [MODE, "--questions", "--events", "events.jsonl"];
    let (mut run, port) = bench.start(&profile("10 min"), &arguments);
    let url = run.line("questions are answered at ");
    let url = url.split(' ').next().unwrap().to_owned();
    let _agv = bench.agv(port, &[]);
    let begun = Instant::now();
    let mut answered = 0;
    while let Some((status, told)) = request(&url, "GET", "question", "") {
        assert_eq!(status, 200);
        assert!(begun.elapsed() < LIMIT, "it is asked for ever");
        let question = &told["question"];
        if question.is_null() {
            std::thread::sleep(Duration::from_millis(30));
            continue;
        }
        assert_eq!(question["test"], MODE);
        assert!(
            question["text"].as_str().unwrap().starts_with("Turn the key to "),
            "{question}"
        );
        assert!(question["secondsLeft"].as_u64().unwrap() > 500);
        let said = json!({ "number": question["number"], "answer": "skip" }).to_string();
        if let Some((status, _)) = request(&url, "POST", "answer", &said) {
            // It may have been answered in the moment before, and not taken down yet.
            assert!(matches!(status, 200 | 409), "{status}");
            answered += usize::from(status == 200);
        }
    }
    run.end().code(3);
    assert!(answered > 0);
    let result = bench.result();
    let why = result["tests"][0]["reason"].as_str().unwrap();
    assert!(why.contains("the operator skipped the test"), "{why}");
    let journal = bench.journal();
    let asked = journal.matches("\"kind\":\"question\"").count();
    assert_eq!(asked, answered, "{journal}");
    assert!(journal.contains("\"text\":\"Turn the key to AUTOMATIC.\",\"seconds\":600"));
    let seen = events(&fs::read_to_string(bench.path().join("events.jsonl")).unwrap());
    let of = |kind: &str| {
        seen.iter()
            .filter(|event| event["event"] == kind)
            .cloned()
            .collect::<Vec<Value>>()
    };
    assert_eq!((of("question").len(), of("answered").len()), (answered, answered));
    assert_eq!(of("question")[0]["text"], "Turn the key to AUTOMATIC.");
    assert_eq!(of("answered")[0]["answer"], "skip");
    bench.is_whole();
}

#[test]
fn what_nobody_answers_is_asked_again_at_the_end_and_then_undecided() {
    let bench = Bench::new();
    let other = "modes/reported[service]";
    let (run, port) = bench.start(&profile("1 s"), &[MODE, other, "--questions"]);
    let _agv = bench.agv(port, &[]);
    run.end()
        .code(3)
        .says("nobody answered in modes/reported[teach-in] before; it is asked again");
    let journal = bench.journal();
    let begun: Vec<&str> = journal
        .lines()
        .filter(|line| line.contains("\"kind\":\"test-begun\""))
        .map(|line| if line.contains("teach-in") { MODE } else { other })
        .collect();
    assert_eq!(begun.len(), 4, "{begun:?}");
    assert_eq!(begun[..2], begun[2..], "each is asked again when all were asked once");
    let result = bench.result();
    for test in result["tests"].as_array().unwrap() {
        assert_eq!(test["verdict"], "inconclusive");
        assert!(
            test["reason"].as_str().unwrap().contains("nobody answered within 1 s"),
            "{test}"
        );
    }
    bench.is_whole();
}

#[test]
fn nobody_answers_from_another_machine() {
    let bench = Bench::new();
    bench
        .run(&["run", "--virtual", MODE, "--questions=0.0.0.0:0"])
        .code(2)
        .says("can be reached from other machines");
    bench
        .run(&["run", "--virtual", MODE, "--questions=nowhere"])
        .code(2)
        .says("is no address");
}
