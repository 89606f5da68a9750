//! The page for the people beside the vehicle: what they press there is as good as what is pressed at the terminal, and nobody
//! else can press it.

use std::collections::BTreeSet;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned, crypto::ring};

use crate::bench::{Bench, Profile, REFUSAL};
use crate::broken::step_begun;
use crate::certificates;
use crate::following::events;
use crate::mosquitto::Mosquitto;
use crate::scripted::Scripted;
use crate::tool::{Running, tool};

/// Asks for an operating mode.
const MODE: &str = "modes/reported[teach-in]";
/// Asks for another one.
const OTHER_MODE: &str = "modes/reported[service]";

/// No test needs longer, on a machine as busy as it may be.
const LIMIT: Duration = Duration::from_secs(60);

/// What a page would do with it, if it took it for more than text.
const HOSTILE: &str = "<img src=x onerror='window.hit=1'><script>window.hit=1</script>";

fn asks(text: &str) -> Profile {
    let mut profile = Profile::impatient();
    profile.more = format!("[hooks.set-mode]\nprompt = \"{text}\"\ntimeout = \"10 min\"\n");
    profile
}

/// Where the page of a run is.
fn page_of(run: &mut Running) -> String {
    let said = run.line("the page for the people beside the vehicle is ");
    said.split(' ').next().unwrap().to_owned()
}

fn parts(url: &str) -> (&str, &str) {
    let (_, rest) = url.split_once("://").unwrap();
    let (host, secret) = rest.split_once('/').unwrap();
    (host, secret.trim_end_matches('/'))
}

/// What is pressed on the page; nothing when nobody listens any more.
fn press(url: &str, what: &str, body: &Value) -> Option<u16> {
    let (host, secret) = parts(url);
    let body = body.to_string();
    let mut stream = TcpStream::connect(host).ok()?;
    write!(
        stream,
        "POST /{secret}/{what} HTTP/1.1\r\nhost: {host}\r\nconnection: close\r\nx-page-secret: {secret}\r\n\
         content-length: {}\r\n\r\n{body}",
        body.len()
    )
    .ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).ok()?;
    answer.split(' ').nth(1)?.parse().ok()
}

/// Asks for the events of a page, and gives the first one that says something; nothing when nobody tells any more.
fn first_event(stream: &mut (impl std::io::Read + std::io::Write), url: &str) -> Option<Value> {
    let (host, secret) = parts(url);
    write!(stream, "GET /{secret}/events HTTP/1.1\r\nhost: {host}\r\n\r\n").ok()?;
    let mut heard = String::new();
    let mut part = vec![0; 65_536];
    loop {
        let count = stream.read(&mut part).ok().filter(|count| *count > 0)?;
        heard.push_str(&String::from_utf8_lossy(&part[..count]));
        if let Some((_, event)) = heard.split_once("data: ")
            && let Some((event, _)) = event.split_once("\n\n")
        {
            return Some(serde_json::from_str(event).unwrap());
        }
    }
}

/// What a page shows that is opened now.
fn shown(url: &str) -> Option<Value> {
    first_event(&mut TcpStream::connect(parts(url).0).ok()?, url)
}

/// What a page shows once something holds.
fn shown_when(url: &str, holds: impl Fn(&Value) -> bool) -> Value {
    let begun = Instant::now();
    loop {
        let Some(told) = shown(url) else {
            panic!("the page is not served any more")
        };
        if holds(&told) {
            return told;
        }
        assert!(begun.elapsed() < LIMIT, "it does not come: {told:#}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_prompt_is_answered_on_the_page_and_the_journal_says_where() {
    let bench = Bench::new();
    let arguments = [MODE, "--page", "--events", "events.jsonl"];
    let (mut run, port) = bench.start(&asks("Turn the key to {mode}."), &arguments);
    let url = page_of(&mut run);
    assert!(url.starts_with("http://127.0.0.1:"), "{url}");
    let _agv = bench.agv(port, &[]);
    let begun = Instant::now();
    let mut answered = 0;
    while let Some(told) = shown(&url) {
        assert!(begun.elapsed() < LIMIT, "it is asked for ever");
        if told["head"]["phase"] == "ended" {
            break;
        }
        let question = &told["question"];
        if question.is_null() {
            std::thread::sleep(Duration::from_millis(30));
            continue;
        }
        assert_eq!((&question["test"], &told["test"]["test"]), (&json!(MODE), &json!(MODE)));
        assert!(question["text"].as_str().unwrap().starts_with("Turn the key to "));
        let left = question["until"].as_i64().unwrap() - told["now"].as_i64().unwrap();
        assert!((500_000..=600_000).contains(&left), "{left}");
        match press(
            &url,
            "answer",
            &json!({ "number": question["number"], "answer": "skip" }),
        ) {
            Some(200) => answered += 1,
            // It was answered in the moment before.
            Some(409) | None => {}
            Some(other) => panic!("{other}"),
        }
    }
    run.end().code(3);
    assert!(answered > 0);
    let why = bench.result()["tests"][0]["reason"].as_str().unwrap().to_owned();
    assert!(why.contains("the operator skipped the test, on the page"), "{why}");
    let seen = events(&fs::read_to_string(bench.path().join("events.jsonl")).unwrap());
    let replies: Vec<&Value> = seen.iter().filter(|event| event["event"] == "answered").collect();
    assert!(
        !replies.is_empty() && replies.iter().all(|reply| reply["from"] == "page"),
        "{replies:?}"
    );
    bench.is_whole();
}

#[test]
fn the_vehicle_is_stopped_on_the_page_as_by_ctrl_c() {
    const WAITING: &str = "order-acceptance/horizon-not-entered";
    let bench = Bench::new();
    let mut profile = Profile::default().with(&[("quiet", "40 s")]);
    profile.motion = true;
    profile.bench = "page = \"127.0.0.1:0\"\n".to_owned();
    let (mut run, port) = bench.start(&profile, &[WAITING]);
    let url = page_of(&mut run);
    let _agv = bench.agv(port, &[]);
    step_begun(&bench, &mut run, (WAITING, "steps[1]"));
    let (_, secret) = parts(&url);
    let wrong = url.replace(secret, &"0".repeat(32));
    assert_eq!(press(&wrong, "stop", &json!({})), Some(404));
    let told = shown_when(&url, |told| told["vehicle"]["order"].is_string());
    assert_eq!(told["floor"]["nodes"].as_array().unwrap().len(), 4);
    assert_eq!(told["head"]["connection"], "ONLINE");
    let ways: BTreeSet<&str> = told["messages"]
        .as_array()
        .unwrap()
        .iter()
        .map(|message| message["way"].as_str().unwrap())
        .collect();
    assert_eq!(ways, BTreeSet::from(["from-device", "to-device"]));
    assert_eq!(press(&url, "stop", &json!({})), Some(200));
    let ended = run.end().code(130);
    assert!(ended.stderr.contains("stopped on the page"), "{}", ended.stderr);
    let journal = bench.journal();
    assert!(journal.contains("cancelOrder"), "the vehicle was left with its order");
    assert!(journal.contains("interrupted by the user") && journal.contains("the run was ended on the page"));
    bench.is_partial();
}

#[test]
fn with_the_certificate_of_the_bench_the_page_is_encrypted() {
    let bench = Bench::new();
    certificates::make(bench.path());
    let mut profile = asks("Turn it.");
    profile.bench = "tls-cert = \"server.crt\"\ntls-key = \"server.key\"\n".to_owned();
    fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    let arguments = ["run", "--profile", "device.toml", REFUSAL, "--page"];
    let mut run = Running::start(&mut tool(bench.path(), &arguments));
    let url = page_of(&mut run);
    let (host, _) = parts(&url);
    assert!(url.starts_with("https://127.0.0.1:"), "{url}");
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(bench.path().join("ca.crt")).unwrap() {
        roots.add(certificate.unwrap()).unwrap();
    }
    let config = ClientConfig::builder_with_provider(ring::default_provider().into())
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    // A client that shakes no hands keeps nobody waiting.
    let _silent = TcpStream::connect(host).unwrap();
    let name = ServerName::try_from("127.0.0.1").unwrap();
    let connection = ClientConnection::new(Arc::new(config), name).unwrap();
    let mut stream = StreamOwned::new(connection, TcpStream::connect(host).unwrap());
    let told = first_event(&mut stream, &url).unwrap();
    assert_eq!(told["reset"], true);
    run.interrupt();
    run.end().code(130);
}

#[test]
fn beyond_this_machine_is_said_and_shown_as_a_code() {
    let bench = Bench::new();
    let ended = bench.run(&["run", "--reference", REFUSAL, "--page=0.0.0.0:0"]).code(0);
    let said = &ended.stderr;
    assert!(said.contains("it is not encrypted") && said.contains('█'), "{said}");
    assert!(
        said.contains("the page for the people beside the vehicle is http://"),
        "{said}"
    );
    let ended = bench.run(&["run", "--reference", REFUSAL, "--page"]).code(0);
    assert!(!ended.stderr.contains('█'), "{}", ended.stderr);
    bench
        .run(&["run", "--virtual", REFUSAL, "--page"])
        .code(2)
        .says("a run in virtual time is over before");
    bench
        .run(&["run", "--reference", REFUSAL, "--page=nowhere"])
        .code(2)
        .says("the port is missing");
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("--page={}", taken.local_addr().unwrap());
    bench
        .run(&["run", "--reference", REFUSAL, &address])
        .code(5)
        .says("another program is using this port already");
}

/// What two people saw who led a run in browsers; `None` without a browser.
fn led(url: &str, picture: &Path) -> Option<Value> {
    let missing = |what: &str| {
        assert!(std::env::var_os("CI").is_none(), "{what} is missing");
        eprintln!("skipped: {what} is missing");
        None
    };
    if Command::new("chromium-headless-shell")
        .arg("--version")
        .output()
        .is_err()
    {
        return missing("chromium-headless-shell");
    }
    let mut drive = Command::new("node");
    drive
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/page"))
        .args(["beside.mjs", url])
        .arg(picture)
        .stdin(Stdio::null());
    let Ok(output) = drive.output() else {
        return missing("node");
    };
    let complaint = String::from_utf8_lossy(&output.stderr);
    if complaint.contains("ERR_MODULE_NOT_FOUND") {
        return missing("playwright-core, which `npm ci` in fixtures/page installs,");
    }
    let told = String::from_utf8_lossy(&output.stdout);
    Some(serde_json::from_str(&told).unwrap_or_else(|error| panic!("{error}\n{told}\n{complaint}")))
}

#[test]
fn two_people_lead_a_run_in_browsers_whatever_the_network_and_the_device_do() {
    let bench = Bench::new();
    let arguments = [MODE, OTHER_MODE, "--page"];
    let (mut run, port) = bench.start(&asks(&format!("{HOSTILE} Turn the key.")), &arguments);
    let url = page_of(&mut run);
    let mut device = Scripted::online(port);
    let mut state = device.state();
    state["operatingMode"] = "AUTOMATIC".into();
    state["orderId"] = format!("{HOSTILE}\u{202e}").into();
    state["errors"] = json!([{ "errorType": HOSTILE, "errorLevel": "WARNING" }]);
    device.publish("state", state.to_string().as_bytes(), false);
    let Some(saw) = led(&url, &bench.path().join("tablet.png")) else {
        run.interrupt();
        return;
    };
    run.end();
    drop(device);
    assert_eq!((&saw["errors"], &saw["axe"]), (&json!([]), &json!([])), "{saw:#}");
    assert_eq!(saw["requests"], json!([]), "the page asks elsewhere");
    assert_eq!(saw["wrong"][0], 404);
    assert!(!saw["wrong"][1].as_str().unwrap().contains("ACME"));
    assert_eq!(saw["text"], format!("{HOSTILE} Turn the key."));
    assert_eq!((&saw["children"], &saw["hit"]), (&json!(0), &json!([null, null])));
    assert!(saw["left"].as_str().unwrap().ends_with(" left"), "{saw:#}");
    assert!(saw["title"].as_str().unwrap().starts_with("▶ Do this"));
    assert_eq!(saw["device"], "ACME 0001");
    assert_eq!(saw["connection"], "ONLINE");
    let size = |at: usize| saw["button"][at].as_f64().unwrap();
    assert!(size(0) > 150.0 && size(1) > 60.0 && saw["isInView"] == true, "{saw:#}");
    assert_eq!((&saw["wasLost"], &saw["cameBack"]), (&json!(true), &json!(true)));
    assert_eq!(saw["lateSaw"], json!([true, format!("{HOSTILE} Turn the key.")]));
    let outcome = saw["outcome"].as_array().unwrap();
    assert!(outcome[0] == outcome[1] && outcome[0] != "", "{saw:#}");
    assert_eq!(saw["afterwards"], json!([false, false]), "{saw:#}");
    assert!(saw["lines"].as_u64().unwrap() >= 5);
    assert!(bench.path().join("tablet.png").exists());
    assert!(bench.journal().contains("the operator skipped the test, on the page"));
}

#[test]
fn a_watch_shows_its_vehicles_and_can_do_nothing_to_them() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let broker = mosquitto.url();
    let mut vehicle = Running::start(&mut tool(
        bench.path(),
        &[
            "simulate",
            "agv",
            "--broker",
            &broker,
            "--state-interval",
            "0.2",
            "--manufacturer",
            "ACME",
            "--serial",
            "0001",
            "--fault",
            "timestamp-local",
        ],
    ));
    vehicle.line("1 simulated AGV(s) on ");
    let mut watch = Running::start(&mut tool(bench.path(), &["watch", "--broker", &broker, "--page"]));
    let url = page_of(&mut watch);
    let told = shown_when(&url, |told| {
        told["findings"] != json!([]) && told["fleet"]["vehicles"][0]["finding"].is_array()
    });
    let vehicle = &told["fleet"]["vehicles"][0];
    assert_eq!(
        (&vehicle["name"], &vehicle["connection"]),
        (&json!("ACME/0001"), &json!("ONLINE"))
    );
    assert!(vehicle["x"].is_number() && vehicle["map"].is_string(), "{vehicle}");
    let record = told["findings"][0]["record"].as_u64().unwrap();
    assert!(
        told["messages"]
            .as_array()
            .unwrap()
            .iter()
            .any(|message| message["record"] == record)
    );
    assert_eq!(press(&url, "stop", &json!({})), Some(409));
    watch.interrupt();
    watch.end().code(1);
}
