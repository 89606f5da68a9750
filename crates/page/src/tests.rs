//! The page over its socket: who is let in, what is told, and what is pressed.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use bytes::Bytes;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

use super::*;
use tck_base::clock::{Moment, Stamp};
use tck_base::verdict::Verdict;
use tck_journal::event::{Direction, Event, Record, Source};
use tck_journal::file::JournalWriter;
use tck_journal::{Entry, Payload};

/// Writes down what was pressed; only question 1 is open.
#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Notes {
    fn all(&self) -> Vec<String> {
        self.0.lock().unwrap().clone()
    }
}

impl Desk for Notes {
    fn answer(&self, number: u64, choice: Choice) -> bool {
        self.0.lock().unwrap().push(format!("{number} {choice:?}"));
        number == 1
    }

    fn stop(&self) -> bool {
        self.0.lock().unwrap().push("stop".to_owned());
        true
    }
}

async fn served() -> (Page, Arc<Notes>, PageServer) {
    let (page, notes) = (Page::default(), Arc::new(Notes::default()));
    let desk: Arc<dyn Desk> = Arc::clone(&notes) as _;
    let server = PageServer::start("127.0.0.1:0", None, page.clone(), desk)
        .await
        .unwrap();
    (page, notes, server)
}

/// Host and secret of an address.
fn parts(server: &PageServer) -> (String, String) {
    let (host, secret) = server.url().strip_prefix("http://").unwrap().split_once('/').unwrap();
    (host.to_owned(), secret.trim_end_matches('/').to_owned())
}

/// Sends a request and gives everything that comes back, head and body.
async fn said(server: &PageServer, method: &str, path: &str, headers: &str, body: &str) -> (u16, String) {
    let (host, secret) = parts(server);
    let fill = |text: &str| text.replace("SECRET", &secret).replace("HOST", &host);
    let request = format!(
        "{method} {} HTTP/1.1\r\nhost: {host}\r\nconnection: close\r\n{}content-length: {}\r\n\r\n{body}",
        fill(path),
        fill(headers),
        body.len()
    );
    let mut stream = TcpStream::connect(&host).await.unwrap();
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    tokio::time::timeout(Duration::from_secs(20), stream.read_to_end(&mut answer))
        .await
        .unwrap()
        .unwrap();
    let answer = String::from_utf8_lossy(&answer).into_owned();
    (answer.split(' ').nth(1).unwrap().parse().unwrap(), answer)
}

/// A browser that listens.
struct Browser {
    stream: TcpStream,
    heard: String,
}

impl Browser {
    async fn open(server: &PageServer, name: &str) -> Self {
        let (host, secret) = parts(server);
        let mut stream = TcpStream::connect(&host).await.unwrap();
        let request = format!("GET /{secret}/events?page={name} HTTP/1.1\r\nhost: {host}\r\n\r\n");
        stream.write_all(request.as_bytes()).await.unwrap();
        Self {
            stream,
            heard: String::new(),
        }
    }

    /// The next event that says something; `None` when the stream has ended.
    async fn next(&mut self) -> Option<Value> {
        loop {
            if let Some(begin) = self.heard.find("data: {\"now\"")
                && let Some(end) = self.heard[begin..].find("\n\n")
            {
                let text = self.heard[begin + 6..begin + end].to_owned();
                self.heard.drain(..begin + end);
                return Some(serde_json::from_str(&text).unwrap());
            }
            let mut bytes = vec![0; 65_536];
            let read = tokio::time::timeout(Duration::from_secs(20), self.stream.read(&mut bytes));
            let count = read.await.unwrap().unwrap();
            if count == 0 {
                return None;
            }
            self.heard.push_str(&String::from_utf8_lossy(&bytes[..count]));
        }
    }

    /// Listens until something holds.
    async fn until(&mut self, holds: impl Fn(&Value) -> bool) -> Value {
        loop {
            let told = self.next().await.expect("it is told");
            if holds(&told) {
                return told;
            }
        }
    }
}

fn message(seq: u64, text: &str) -> Arc<Entry> {
    let event = Event::Message {
        topic: "uagv/v2/ACME/1/state".to_owned(),
        qos: 0,
        retain: false,
        dup: false,
        payload: Payload::keep(Bytes::from(text.to_owned())),
    };
    let at = Stamp {
        moment: Moment::START,
        utc: jiff::Timestamp::UNIX_EPOCH,
    };
    Entry::new(Record {
        seq,
        at,
        source: Source::Link,
        direction: Some(Direction::FromDevice),
        event,
    })
}

const TOPIC: Option<(&str, Way)> = Some(("uagv/v2/ACME/1/state", Way::FromDevice));

fn prompt(text: &str) -> Prompt {
    Prompt {
        number: 1,
        step: None,
        text: text.to_owned(),
        seconds: 60,
    }
}

fn finding(requirement: &str, verdict: Verdict, message: &str) -> Finding {
    Finding {
        requirement: requirement.to_owned(),
        verdict,
        by: "a/b".to_owned(),
        message: message.to_owned(),
        record: Some(7),
        count: 1,
    }
}

fn test_facts() -> TestFacts {
    TestFacts {
        test: "a/b".to_owned(),
        title: "A title".to_owned(),
        why: "A reason".to_owned(),
        number: 1,
        of: 2,
    }
}

#[tokio::test]
async fn without_the_secret_there_is_nothing() {
    let (page, notes, server) = served().await;
    page.asked(&prompt("Press the secret button."));
    let good = r#"{"number":1,"answer":"done"}"#;
    let mut bodies = std::collections::BTreeSet::new();
    for (method, path) in [
        ("GET", "/"),
        ("GET", "/page.js"),
        ("GET", "/events"),
        ("GET", "//events"),
        ("GET", "/SECRE"),
        ("GET", "/SECRET0/"),
        ("GET", "/00000000000000000000000000000000/events"),
        ("POST", "/answer"),
        ("POST", "/00000000000000000000000000000000/stop"),
        ("GET", "/x/../SECRET/"),
    ] {
        let (status, answer) = said(&server, method, path, "x-page-secret: 0\r\n", good).await;
        assert_eq!(status, 404, "{method} {path}");
        assert!(answer.to_lowercase().contains("connection: close"));
        bodies.insert(answer.split_once("\r\n\r\n").unwrap().1.to_owned());
    }
    assert_eq!(bodies.len(), 1, "they do not differ: {bodies:?}");
    assert!(notes.all().is_empty());
    let (host, secret) = parts(&server);
    assert!(!host.contains(&secret) && secret.len() == 32);
}

#[tokio::test]
async fn the_page_is_whole_and_forbids_every_other_request() {
    let (_page, _, server) = served().await;
    for (path, kind) in [
        ("/SECRET/", "text/html"),
        ("/SECRET/page.js", "text/javascript"),
        ("/SECRET/floor.js", "text/javascript"),
        ("/SECRET/page.css", "text/css"),
    ] {
        let (status, answer) = said(&server, "GET", path, "", "").await;
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        assert_eq!(status, 200, "{path}");
        assert!(head.contains(kind) && body.len() > 500, "{head}");
        assert!(
            head.contains("default-src 'none'") && head.contains("frame-ancestors 'none'"),
            "{head}"
        );
        assert!(head.contains("no-referrer") && head.contains("nosniff") && head.contains("no-store"));
        let elsewhere = body.replace("http://www.w3.org/2000/svg", "");
        assert!(
            !elsewhere.contains("http://") && !elsewhere.contains("https://"),
            "{path} asks elsewhere"
        );
        assert!(!body.contains("innerHTML") && !body.contains("style=\""), "{path}");
    }
    let (status, answer) = said(&server, "GET", "/SECRET", "", "").await;
    assert_eq!(status, 308, "{answer}");
    assert_eq!(said(&server, "GET", "/SECRET/../../etc/passwd", "", "").await.0, 404);
    assert_eq!(said(&server, "DELETE", "/SECRET/", "", "").await.0, 405);
}

#[tokio::test]
async fn only_the_page_itself_answers_and_stops() {
    let (_page, notes, server) = served().await;
    let good = r#"{"number":1,"answer":"done"}"#;
    let own = "x-page-secret: SECRET\r\n";
    let long = format!("{}{good}", " ".repeat(2_000));
    let deep = "[".repeat(1_000);
    let evil = format!("{own}origin: http://evil.example\r\n");
    let across = format!("{own}sec-fetch-site: cross-site\r\n");
    let null = format!("{own}origin: null\r\n");
    for (path, headers, body, status) in [
        ("/SECRET/answer", "", good, 403),
        ("/SECRET/stop", "", "{}", 403),
        (
            "/SECRET/answer",
            "x-page-secret: 00000000000000000000000000000000\r\n",
            good,
            403,
        ),
        ("/SECRET/answer", &evil, good, 403),
        ("/SECRET/answer", &across, good, 403),
        ("/SECRET/stop", &null, "{}", 403),
        ("/SECRET/answer", own, "", 400),
        ("/SECRET/answer", own, r#"{"number":1,"answer":"reboot"}"#, 400),
        ("/SECRET/answer", own, r#"{"number":-1,"answer":"done"}"#, 400),
        ("/SECRET/answer", own, &deep, 400),
        ("/SECRET/answer", own, &long, 413),
    ] {
        let (got, answer) = said(&server, "POST", path, headers, body).await;
        assert_eq!(got, status, "{path} {headers} {body}: {answer}");
    }
    assert!(notes.all().is_empty(), "{:?}", notes.all());
    let same = format!("{own}origin: http://HOST\r\nsec-fetch-site: same-origin\r\n");
    assert_eq!(said(&server, "POST", "/SECRET/answer", &same, good).await.0, 200);
    let other = r#"{"number":2,"answer":"skip"}"#;
    assert_eq!(said(&server, "POST", "/SECRET/answer", own, other).await.0, 409);
    assert_eq!(said(&server, "POST", "/SECRET/stop", own, "{}").await.0, 200);
    assert_eq!(notes.all(), ["1 Done", "2 Skip", "stop"]);
}

#[tokio::test]
async fn where_nobody_sits_nothing_is_answered_or_stopped() {
    let page = Page::default();
    let server = PageServer::start("127.0.0.1:0", None, page.clone(), Arc::new(Nobody))
        .await
        .unwrap();
    let own = "x-page-secret: SECRET\r\n";
    let good = r#"{"number":1,"answer":"done"}"#;
    assert_eq!(said(&server, "POST", "/SECRET/answer", own, good).await.0, 409);
    assert_eq!(said(&server, "POST", "/SECRET/stop", own, "{}").await.0, 409);
    let vehicle = |number: usize| FleetVehicle {
        name: format!("ACME/{number}"),
        x: Some(1.0),
        y: Some(2.0),
        finding: Some((Verdict::Fail, "late\u{202e}".to_owned())),
        ..FleetVehicle::default()
    };
    page.fleet((0..3_000).map(vehicle).collect());
    let told = Browser::open(&server, "1").await.next().await.unwrap();
    let fleet = &told["fleet"];
    assert_eq!(
        (&fleet["heard"], fleet["vehicles"].as_array().unwrap().len()),
        (&json!(3_000), 200)
    );
    assert_eq!(fleet["vehicles"][0]["finding"], json!(["fail", "late\\u{202e}"]));
    assert_eq!(told["head"]["phase"], "begins");
}

#[tokio::test]
async fn a_page_that_is_opened_late_or_twice_is_told_everything() {
    let (page, _, server) = served().await;
    let mut early = Browser::open(&server, "early").await;
    let first = early.next().await.unwrap();
    assert_eq!(
        (&first["reset"], &first["head"]["phase"]),
        (&json!(true), &json!("begins"))
    );
    page.planned(vec![
        Planned {
            test: "a/b".to_owned(),
            left_out: None,
        },
        Planned {
            test: "c/d".to_owned(),
            left_out: Some("it does not drive".to_owned()),
        },
    ]);
    page.test_begun(&test_facts());
    page.awaits(Duration::from_secs(5));
    page.step(&StepFacts {
        path: "steps[0]".to_owned(),
        title: Some("It answers".to_owned()),
        does: "expect: state".to_owned(),
    });
    page.awaits(Duration::from_secs(30));
    page.asked(&prompt("Press it."));
    page.saw(&message(7, "{\"a\":1}"), TOPIC);
    page.found(vec![
        finding("STATE-01", Verdict::Warning, "slow"),
        finding("STATE-02", Verdict::Fail, "wrong"),
    ]);
    let told = early.until(|told| told.get("findings").is_some()).await;
    assert_eq!(told["reset"], false);
    page.asks([("STATE-02".to_owned(), "Say it.".to_owned())].into());
    let mut late = Browser::open(&server, "late").await;
    let all = late.next().await.unwrap();
    assert_eq!((&all["reset"], &all["head"]["phase"]), (&json!(true), &json!("runs")));
    assert_eq!(
        (&all["test"]["why"], &all["test"]["number"]),
        (&json!("A reason"), &json!(1))
    );
    let until = all["test"]["step"]["until"].as_i64().unwrap() - all["now"].as_i64().unwrap();
    assert!((20_000..=30_000).contains(&until), "{until}");
    assert_eq!(
        (&all["question"]["text"], &all["question"]["title"]),
        (&json!("Press it."), &json!("A title"))
    );
    assert_eq!(all["findings"][0]["requirement"], "STATE-02", "the worst comes first");
    assert_eq!(all["findings"][0]["asks"], "Say it.");
    assert!(all["findings"][1].get("asks").is_none(), "nobody has said what it asks");
    assert_eq!(
        all["tests"],
        json!([{ "test": "a/b", "state": "runs" }, { "test": "c/d", "state": "left-out", "why": "it does not drive" }])
    );
    assert_eq!(all["messages"][0]["text"], "{\"a\":1}");
    assert!(all["lines"].as_array().unwrap().len() >= 5);
    page.answered(1, "done, on the page");
    let (one, other) = (
        early.until(|told| told.get("question").is_some()).await,
        late.until(|told| told.get("question").is_some()).await,
    );
    assert!(one["question"].is_null() && other["question"].is_null());
    page.begins_anew();
    let told = late.until(|told| told["reset"] == true).await;
    assert_eq!(told["messages"], json!([]), "they were of the run before");
    assert_eq!(told["findings"][0]["requirement"], "STATE-02");
    assert!(
        told["findings"][0].get("record").is_none(),
        "its record is there no more"
    );
    page.saw(&message(1, "{}"), TOPIC);
    assert_eq!(
        late.until(|told| told["messages"] != json!([])).await["messages"][0]["record"],
        1
    );
    drop(early);
    let again = Browser::open(&server, "early").await.next().await.unwrap();
    assert_eq!(again["reset"], true, "who comes again is told everything");
}

#[tokio::test]
async fn the_end_is_heard_before_nothing_is_served_any_more() {
    let (page, _, server) = served().await;
    let (mut one, mut other) = (Browser::open(&server, "1").await, Browser::open(&server, "2").await);
    one.next().await.unwrap();
    other.next().await.unwrap();
    page.ended(Outcome {
        verdict: "pass".to_owned(),
        statement: "It conforms.".to_owned(),
        report: "reports/x".to_owned(),
    });
    page.breaks_off();
    let finished = tokio::spawn(server.finish());
    for browser in [&mut one, &mut other] {
        let told = browser.next().await.unwrap();
        assert_eq!(
            (&told["head"]["phase"], &told["head"]["outcome"]["verdict"]),
            (&json!("ended"), &json!("pass"))
        );
        assert!(browser.next().await.is_none(), "the stream ends");
    }
    tokio::time::timeout(Duration::from_secs(1), finished)
        .await
        .unwrap()
        .unwrap();
}

#[tokio::test]
async fn only_so_many_pages_are_told_and_one_that_comes_again_takes_its_place() {
    let (_page, _, server) = served().await;
    let mut open = Vec::new();
    for number in 0..visitors::VISITORS {
        let mut browser = Browser::open(&server, &format!("p{number}")).await;
        browser.next().await.unwrap();
        open.push(browser);
    }
    assert_eq!(said(&server, "GET", "/SECRET/events?page=more", "", "").await.0, 503);
    let mut again = Browser::open(&server, "p3").await;
    assert_eq!(again.next().await.unwrap()["reset"], true);
    assert!(open[3].next().await.is_none(), "its older connection ends");
    assert_eq!(
        said(&server, "GET", "/SECRET/", "", "").await.0,
        200,
        "the page itself is served"
    );
}

#[tokio::test]
async fn what_a_device_says_is_bounded_and_harmless() {
    let (page, _, server) = served().await;
    let evil = "</script><script>alert(1)</script>\u{202e}\u{0}\u{1b}[2J";
    for seq in 1..=100 {
        let text = match seq % 3 {
            0 => format!("{{\"orderId\":\"{}\"}}", "x".repeat(100_000)),
            1 => evil.to_owned(),
            _ => "\u{fffd}not json".repeat(50_000),
        };
        page.saw(&message(seq, &text), TOPIC);
        page.note(&evil.repeat(1_000));
        page.connection(&evil.repeat(1_000));
        page.found(vec![finding(&format!("X-{seq}"), Verdict::Fail, &evil.repeat(1_000))]);
    }
    page.vehicle(VehicleOnFloor {
        x: Some(f64::NAN),
        order: Some(evil.repeat(1_000)),
        nodes: vec![
            RoutePart {
                id: evil.repeat(1_000),
                released: true
            };
            4_096
        ],
        ..VehicleOnFloor::default()
    });
    let mut browser = Browser::open(&server, "1").await;
    let told = browser.next().await.unwrap();
    assert_eq!(told["messages"].as_array().unwrap().len(), 20);
    let whole = told.to_string();
    assert!(whole.len() < 2_000_000, "{}", whole.len());
    assert!(!whole.contains('\u{202e}') && !whole.contains("\\u0000") && !whole.contains("\\u001b"));
    let (status, answer) = said(&server, "GET", "/SECRET/record/99", "", "").await;
    assert!(
        status == 200 && answer.len() < 300_000 && answer.contains("application/json"),
        "{status}"
    );
    let (_, answer) = said(&server, "GET", "/SECRET/record/1", "", "").await;
    assert!(
        answer.contains("\\\\u{202e}") && !answer.contains('\u{202e}'),
        "{answer}"
    );
    for none in ["0", "101", "-1", "99999999999999999999", "x", "1/2", ""] {
        assert_eq!(
            said(&server, "GET", &format!("/SECRET/record/{none}"), "", "").await.0,
            404,
            "{none}"
        );
    }
}

fn at(x: f64, map: &str) -> VehicleOnFloor {
    VehicleOnFloor {
        x: Some(x),
        y: Some(0.0),
        map: Some(map.to_owned()),
        ..VehicleOnFloor::default()
    }
}

/// The vehicle says in this record that it is there.
fn drives(page: &Page, record: u64, x: f64) {
    page.saw(&message(record, "{}"), TOPIC);
    page.vehicle(at(x, "hall"));
}

#[tokio::test]
async fn a_finding_is_marked_where_the_vehicle_was_and_the_way_begins_anew_with_each_test() {
    let (page, _, server) = served().await;
    let mut browser = Browser::open(&server, "1").await;
    page.test_begun(&test_facts());
    for record in 1..=5 {
        drives(&page, record, record as f64);
    }
    let of = |record: u64, verdict: Verdict, id: &str| Finding {
        record: Some(record),
        ..finding(id, verdict, "wrong")
    };
    page.found(vec![
        of(3, Verdict::Fail, "A-1"),
        of(4, Verdict::Warning, "A-2"),
        of(4, Verdict::Inconclusive, "A-3"),
        of(0, Verdict::Fail, "A-4"),
    ]);
    let told = browser
        .until(|told| told.get("findings").is_some_and(|all| all != &json!([])))
        .await;
    let spots = |told: &Value| {
        let all = told["findings"].as_array().unwrap().clone();
        let mut spots: Vec<(String, Value)> = all
            .iter()
            .map(|one| (one["requirement"].as_str().unwrap().to_owned(), one["spot"].clone()))
            .collect();
        spots.sort_by(|one, other| one.0.cmp(&other.0));
        spots.into_iter().map(|(_, spot)| spot).collect::<Vec<Value>>()
    };
    let spot = |x: f64| json!({ "x": x, "y": 0.0, "map": "hall" });
    assert_eq!(spots(&told), [spot(3.0), spot(4.0), Value::Null, Value::Null]);
    let mut late = Browser::open(&server, "2").await;
    let told = late.next().await.unwrap();
    assert_eq!(
        told["vehicle"]["trail"].as_array().unwrap().len(),
        5,
        "{}",
        told["vehicle"]
    );
    page.test_begun(&test_facts());
    let told = late.until(|told| told.get("vehicle").is_some()).await;
    assert_eq!(
        told["vehicle"]["trail"],
        json!([[5.0, 0.0]]),
        "it begins where the vehicle is"
    );
    for record in 6..=10_000 {
        drives(&page, record, record as f64);
    }
    page.findings(vec![of(3, Verdict::Fail, "A-1"), of(20, Verdict::Fail, "A-5")]);
    let told = Browser::open(&server, "3").await.next().await.unwrap();
    assert_eq!(
        spots(&told),
        [spot(3.0), Value::Null],
        "a mark stays; of what is told too late, nobody remembers where it was"
    );
}

#[tokio::test]
async fn a_prompt_says_which_of_those_in_the_plan_it_is() {
    let (page, _, server) = served().await;
    page.prompts([("a/b".to_owned(), 2), ("c/d".to_owned(), 7), ("e/f".to_owned(), 1)].into());
    let planned = |test: &str, left_out: Option<&str>| Planned {
        test: test.to_owned(),
        left_out: left_out.map(str::to_owned),
    };
    page.planned(vec![
        planned("a/b", None),
        planned("c/d", Some("it does not drive")),
        planned("e/f", None),
        planned("g/h", None),
    ]);
    for (number, of) in [(1, json!(3)), (3, json!(3)), (4, Value::Null)] {
        page.asked(&Prompt {
            number,
            ..prompt("Press it.")
        });
        let told = Browser::open(&server, "1").await.next().await.unwrap();
        assert_eq!(told["question"]["of"], of, "question {number}");
    }
}

#[tokio::test]
async fn older_records_are_read_back_from_the_journal() {
    let (page, _, server) = served().await;
    let mut writer = JournalWriter::temporary().unwrap();
    page.reads_back(writer.shelf());
    for seq in 1..=1_500 {
        let entry = message(seq, &format!("{{\"n\":{seq}}}"));
        writer.write(&entry.record).unwrap();
        page.saw(&entry, TOPIC);
    }
    for seq in [1, 400, 1_500] {
        let (status, answer) = said(&server, "GET", &format!("/SECRET/record/{seq}"), "", "").await;
        assert!(
            status == 200 && answer.contains(&format!("\\\"n\\\": {seq}")),
            "{answer}"
        );
    }
    assert_eq!(said(&server, "GET", "/SECRET/record/1501", "", "").await.0, 404);
}
