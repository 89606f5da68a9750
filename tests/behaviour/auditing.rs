//! `audit`: recordings of several tools, and what is found in them.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write as _;

use serde_json::Value;

use crate::bench::{Bench, QUICK};
use crate::tool::{Ended, Running, run, run_in, tool};

fn capture(name: &str) -> String {
    format!("{}/fixtures/captures/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn page(ended: Ended) -> String {
    let folder = format!("{}/fixtures/captures/", env!("CARGO_MANIFEST_DIR"));
    ended.stdout.replace(&folder, "")
}

fn result(ended: &Ended) -> Value {
    serde_json::from_str(&ended.stdout).unwrap()
}

#[test]
fn faultless_traffic_of_both_sides_and_two_versions_is_accused_of_nothing() {
    insta::assert_snapshot!(
        "faultless",
        page(run(&["audit", &capture("two-versions.jsonl")]).code(0))
    );
}

#[test]
fn a_vehicle_that_reports_wrongly_is_found_by_message_and_place() {
    let ended = run(&["audit", &capture("horizon-missing.jsonl"), "--only", "state/*"]).code(1);
    insta::assert_snapshot!("found", page(ended));
}

#[test]
fn what_mosquitto_sub_prints_is_judged_between_the_lines_of_a_log() {
    insta::assert_snapshot!("printed", page(run(&["audit", &capture("printed.txt")]).code(0)));
}

#[test]
fn what_a_recording_holds_is_found_in_every_form() {
    let bench = Bench::new();
    let text = fs::read_to_string(capture("one-idle-state.jsonl")).unwrap();
    let all: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let member = |message: &Value, name: &str| message[name].as_str().unwrap().to_owned();
    let timed = all.iter().map(|message| {
        let (time, topic) = (member(message, "tst"), member(message, "topic"));
        format!("{time} {topic} {}\n", message["payload"])
    });
    let rows = all.iter().map(|message| {
        let (time, topic) = (member(message, "tst"), member(message, "topic"));
        let payload = message["payload"].to_string().replace('"', "\"\"");
        format!("{time};{topic};0;\"{payload}\"\n")
    });
    let wide = text.encode_utf16().flat_map(u16::to_le_bytes);
    let forms: [(&str, Vec<u8>); 5] = [
        ("array.json", serde_json::to_vec(&all).unwrap()),
        ("pretty.json", serde_json::to_vec_pretty(&all).unwrap()),
        (
            "rows.csv",
            format!("time;topic;retain;payload\n{}", rows.collect::<String>()).into_bytes(),
        ),
        ("wide.jsonl", [vec![0xff, 0xfe], wide.collect()].concat()),
        ("timed.txt", timed.collect::<String>().into_bytes()),
    ];
    for (name, bytes) in forms {
        fs::write(bench.path().join(name), bytes).unwrap();
        let found = result(&run_in(bench.path(), &["audit", name, "--format", "json"]).code(1));
        let side = &found["vehicles"][0]["sides"][0];
        assert!(side["findings"].to_string().contains("STATE-12"), "{name}: {side}");
    }
    fs::write(bench.path().join("packed.zip"), b"PK\x03\x04 and more").unwrap();
    run_in(bench.path(), &["audit", "packed.zip"])
        .code(2)
        .says("ZIP archive");
}

#[test]
fn a_version_that_is_none_hides_nothing_and_may_be_told() {
    let bench = Bench::new();
    let state = fs::read_to_string(format!(
        "{}/fixtures/messages/2.1/good/state-idle.json",
        env!("CARGO_MANIFEST_DIR")
    ));
    let mut state: Value = serde_json::from_str(&state.unwrap()).unwrap();
    state["version"] = "1.3.2".into();
    state.as_object_mut().unwrap().remove("orderUpdateId");
    fs::write(bench.path().join("state.json"), state.to_string()).unwrap();
    let ended = run_in(bench.path(), &["validate", "state.json"]).code(2);
    assert!(
        ended.stdout.contains("HDR-04") && ended.stdout.contains("orderUpdateId"),
        "{}",
        ended.stdout
    );
    state["version"] = "9.0.0".into();
    fs::write(bench.path().join("state.json"), state.to_string()).unwrap();
    let ended = run_in(bench.path(), &["validate", "state.json"]).code(2);
    assert!(
        ended.stdout.contains("9.0.0 is not known to this program"),
        "{}",
        ended.stdout
    );
    run(&["audit", &capture("one-idle-state.jsonl"), "--protocol", "9.1"])
        .code(2)
        .says("9.1 is not known");
    let told = run(&[
        "audit",
        &capture("one-idle-state.jsonl"),
        "--protocol",
        "2.0",
        "--format",
        "json",
    ]);
    assert_eq!(result(&told)["vehicles"][0]["protocol"], "2.0.0");
}

#[test]
fn vehicles_times_and_monitors_can_be_chosen() {
    let two = capture("two-versions.jsonl");
    let only = result(&run(&["audit", &two, "--vehicle", "vda5050-tck/mock-1", "--format", "json"]).code(0));
    assert_eq!(only["vehicles"].as_array().unwrap().len(), 1);
    assert_eq!(only["vehicles"][0]["protocol"], "2.1.0");
    let none = run(&["audit", &two, "--vehicle", "nobody"]).code(4);
    assert!(none.stdout.contains("No message"), "{}", none.stdout);
    run(&["audit", &two, "--to", "2000-01-01T00:00:00Z"]).code(4);
    run(&["audit", &two, "--only", "no/such"]).code(2).says("no/such");
    run(&["audit", &two, "--topic-template", "hall/{topic}"])
        .code(2)
        .says("serialNumber");
    run(&["audit", &capture("printed.txt"), "--from", "2000-01-01T00:00:00Z"])
        .code(2)
        .says("printed.txt:4");
    run(&["audit", "missing.jsonl"]).code(2).says("missing.jsonl");
}

/// A folder with the monitor `acme/never-automatic`, which says this of recordings.
fn own_suites(bench: &Bench, recordings: &str) {
    let folder = bench.path().join("own/monitors/acme");
    fs::create_dir_all(&folder).unwrap();
    let text = format!(
        "monitor: acme/never-automatic\ntitle: Nobody drives by itself\ndevice: agv\nspec: \">=2.0, <3\"\nwhy: Ours are driven \
         by hand.\nchecks: [MODE-01]\n{recordings}topic: state\nnever: {{ operatingMode: AUTOMATIC }}\n"
    );
    fs::write(folder.join("never-automatic.yaml"), text).unwrap();
}

#[test]
fn a_monitor_of_ones_own_judges_a_recording_as_it_says() {
    let bench = Bench::new();
    let two = capture("two-versions.jsonl");
    let audit = |code: i32| {
        let arguments = ["audit", &two, "--suites", "own", "--format", "json"];
        result(&run_in(bench.path(), &arguments).code(code))
    };
    let side = |audited: &Value| audited["vehicles"][0]["sides"][0].clone();
    for recordings in ["", "recordings: unbroken\n"] {
        own_suites(&bench, recordings);
        let found = side(&audit(1))["findings"].clone();
        assert_eq!(found[0]["monitor"], "acme/never-automatic", "{found}");
        assert!(found[0]["count"].as_u64().unwrap() > 1, "{found}");
    }
    own_suites(&bench, "recordings: { never: our reason }\n");
    let undecided = side(&audit(0))["undecided"].clone();
    let undecided = undecided.as_array().unwrap().iter();
    let own: Vec<&Value> = undecided
        .filter(|one| one["monitor"] == "acme/never-automatic")
        .collect();
    assert_eq!(own.len(), 1);
    assert_eq!(own[0]["why"], "our reason");
}

#[test]
fn several_recordings_are_one_stream_and_what_two_recorders_saw_counts_once() {
    let bench = Bench::new();
    let text = fs::read_to_string(capture("two-versions.jsonl")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let part = |name: &str, wanted: &dyn Fn(usize) -> bool| {
        let all = lines.iter().enumerate().filter(|(at, _)| wanted(*at));
        let text: String = all.flat_map(|(_, line)| [*line, "\n"]).collect();
        fs::write(bench.path().join(name), text).unwrap();
    };
    part("odd.jsonl", &|at| at % 2 == 1);
    part("even.jsonl", &|at| at % 2 == 0);
    part("again.jsonl", &|at| at >= 20);
    let whole = result(&run(&["audit", &capture("two-versions.jsonl"), "--format", "json"]).code(0));
    let parts = run_in(
        bench.path(),
        &["audit", "odd.jsonl", "even.jsonl", "again.jsonl", "--format", "json"],
    );
    let parts = result(&parts.code(0));
    for vehicle in 0..2 {
        let requirements = |result: &Value| result["vehicles"][vehicle]["sides"][0]["requirements"].clone();
        assert_eq!(requirements(&whole), requirements(&parts));
        assert!(parts["vehicles"][vehicle]["twice"].as_u64().unwrap() > 10);
        assert_eq!(parts["vehicles"][vehicle]["holes"], whole["vehicles"][vehicle]["holes"]);
    }
}

#[test]
fn the_journal_of_a_run_gives_what_the_run_gave() {
    let bench = Bench::new();
    bench.run(&["run", "--virtual", "--fault", "header-id-constant", QUICK]);
    assert!(!bench.is_audited_like_its_run().is_empty());
}

/// The messages of a journal as `mosquitto_sub -F %J` would have printed them, and the side that was tested.
fn printed(journal: &str) -> (String, String) {
    let mut role = String::new();
    let mut lines = String::new();
    for line in journal.lines() {
        let record: Value = serde_json::from_str(line).unwrap();
        let event = &record["event"];
        let stored = match event["kind"].as_str() {
            Some("run-begun") => {
                event["header"]["role"].as_str().unwrap().clone_into(&mut role);
                continue;
            }
            Some("message") => event["retain"].as_bool().unwrap(),
            Some("sent") => false,
            _ => continue,
        };
        let Some(payload) = event["payload"].as_str() else {
            continue;
        };
        let line = serde_json::json!({ "tst": record["at"]["utc"], "topic": event["topic"], "qos": event["qos"],
            "retain": u8::from(stored), "payload": payload });
        lines += &format!("{line}\n");
    }
    (lines, role)
}

/// How often each monitor found what, on one side or on both. The audit of a capture tells causes apart, a run does not.
fn by_monitor(audited: &Value, role: Option<&str>) -> BTreeMap<String, u64> {
    let list = |holder: &Value, member: &str| holder[member].as_array().cloned().unwrap_or_default();
    let sides = list(audited, "vehicles")
        .into_iter()
        .flat_map(|vehicle| list(&vehicle, "sides"));
    let sides = sides.filter(|side| role.is_none_or(|role| side["role"] == role));
    let mut all = BTreeMap::new();
    for finding in sides.flat_map(|side| [list(&side, "findings"), list(&side, "information")].concat()) {
        let what = ["monitor", "requirement", "verdict"].map(|member| finding[member].to_string());
        *all.entry(what.join(" ")).or_default() += finding["count"].as_u64().unwrap();
    }
    all
}

/// What only the tap sees, or only who knows of the run, cannot be found in lines; the rest can. What the harness sends in a
/// test is wrong on purpose, and so the other side is left aside.
#[test]
fn the_messages_of_a_journal_give_as_lines_what_the_journal_gives() {
    let bench = Bench::new();
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let kept = fs::read_dir(root.join("fixtures/journals")).unwrap();
    let mut folders: Vec<_> = kept
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir())
        .collect();
    folders.push(root.join("reports/example"));
    let (mut judged, mut found) = (0, 0);
    for folder in folders {
        let path = folder.join("journal.jsonl");
        let (lines, role) = printed(&fs::read_to_string(&path).unwrap());
        fs::write(bench.path().join("lines.jsonl"), lines).unwrap();
        let path = path.display().to_string();
        let of_journal = result(&bench.run(&["audit", &path, "--format", "json"]));
        let of_lines = result(&bench.run(&["audit", "lines.jsonl", "--format", "json"]));
        let expected = by_monitor(&of_journal, None);
        assert_eq!(by_monitor(&of_lines, Some(&role)), expected, "{path}");
        judged += 1;
        found += expected.len();
    }
    assert!(judged > 10 && found > 3, "{judged} journals, {found} findings");
}

#[test]
fn what_holds_no_message_is_4_and_says_so() {
    let bench = Bench::new();
    fs::write(bench.path().join("log.txt"), "nothing\nhere a/b {}\n").unwrap();
    run_in(bench.path(), &["audit", "log.txt"])
        .code(4)
        .prints("2 of them no message");
}

#[test]
fn mcap_holds_what_the_lines_hold() {
    let seen = |name: &str| -> Vec<(Value, Value, Value)> {
        let result = result(&run(&["audit", &capture(name), "--format", "json"]).code(0));
        let vehicles = result["vehicles"].as_array().unwrap().clone();
        let facts = |vehicle: &Value| {
            (
                vehicle["topics"].clone(),
                vehicle["messages"].clone(),
                vehicle["protocol"].clone(),
            )
        };
        vehicles.iter().map(facts).collect()
    };
    let lines = seen("two-versions.jsonl");
    assert_eq!(lines.len(), 2);
    assert_eq!(seen("site.zstd.mcap"), lines);
    assert_eq!(seen("site.lz4.mcap"), lines);
}

#[test]
fn a_slice_shows_its_finding_to_whoever_gets_it() {
    let bench = Bench::new();
    let whole = capture("horizon-missing.jsonl");
    let sliced = bench.run(&["audit", &whole, "--slice", "STATE-12"]).code(1);
    let lines = sliced.stdout.lines().count();
    assert!(lines > 1 && lines < 60, "{lines} lines");
    fs::write(bench.path().join("bug.jsonl"), &sliced.stdout).unwrap();
    bench.run(&["audit", "bug.jsonl"]).code(1).prints("STATE-12");
    bench
        .run(&["audit", &whole, "--slice", "NO-SUCH"])
        .code(2)
        .says("NO-SUCH");
}

#[test]
fn the_bundle_of_an_audit_is_for_programs_build_servers_and_people() {
    let bench = Bench::new();
    let whole = capture("horizon-missing.jsonl");
    bench.run(&["audit", &whole, "--out", "audits/monday"]).code(1);
    let read = |name: &str| fs::read_to_string(bench.path().join("audits/monday").join(name)).unwrap();
    assert!(read("report.html").contains("<svg") && read("report.html").contains("STATE-12"));
    assert!(read("junit.xml").contains("type=\"STATE-12\""));
    let result: Value = serde_json::from_str(&read("result.json")).unwrap();
    assert!(result["vehicles"][0]["timeLine"]["order"].is_array());
}

#[test]
fn messages_and_findings_are_exported_as_tables() {
    let bench = Bench::new();
    let whole = capture("horizon-missing.jsonl");
    bench.run(&["audit", &whole, "--export", "tables"]).code(1);
    for (name, column) in [
        ("state", "operating_mode"),
        ("order", "zone_set_id"),
        ("findings", "requirement"),
    ] {
        let table = fs::read(bench.path().join(format!("tables/{name}.parquet"))).unwrap();
        assert!(table.starts_with(b"PAR1") && table.ends_with(b"PAR1"), "{name}");
        let names = table.windows(column.len());
        assert!(
            names.into_iter().any(|part| part == column.as_bytes()),
            "{name} has no {column}"
        );
    }
}

#[test]
fn a_recording_that_grows_is_followed() {
    let bench = Bench::new();
    let whole = fs::read_to_string(capture("horizon-missing.jsonl")).unwrap();
    let all: Vec<&str> = whole.lines().collect();
    let path = bench.path().join("site.jsonl");
    fs::write(&path, format!("{}\n", all[..5].join("\n"))).unwrap();
    let mut following = Running::start(&mut tool(bench.path(), &["audit", "site.jsonl", "--follow"]));
    let mut file = fs::OpenOptions::new().append(true).open(&path).unwrap();
    writeln!(file, "{}", all[5..].join("\n")).unwrap();
    following.until("a finding", |following| {
        following.stdout().contains("STATE-12").then_some(())
    });
    following.interrupt();
    following.end().code(1).prints("1 vehicle;");
}

#[test]
fn what_a_baseline_has_is_no_news_and_what_is_gone_is_said() {
    let bench = Bench::new();
    let (bad, good) = (capture("horizon-missing.jsonl"), capture("two-versions.jsonl"));
    bench.run(&["audit", &bad, "--out", "monday"]).code(1);
    bench
        .run(&["audit", &bad, "--baseline", "monday"])
        .code(0)
        .prints("against the baseline monday: 0 new, ");
    // The verdict stays, and the bundle is that of the recording alone.
    let told = bench
        .run(&[
            "audit",
            &bad,
            "--baseline",
            "monday",
            "--out",
            "tuesday",
            "--format",
            "json",
        ])
        .code(0);
    let told = result(&told);
    assert_eq!(
        (&told["verdict"], &told["against"]["rest"]),
        (&Value::from("fail"), &Value::from("pass"))
    );
    let again: Value = serde_json::from_slice(&fs::read(bench.path().join("tuesday/result.json")).unwrap()).unwrap();
    assert!(again.get("against").is_none() && again["verdict"] == "fail");
    // Without the finding in the baseline it is new; a result alone is a baseline, too.
    let mut before: Value =
        serde_json::from_slice(&fs::read(bench.path().join("monday/result.json")).unwrap()).unwrap();
    for vehicle in before["vehicles"].as_array_mut().unwrap() {
        for side in vehicle["sides"].as_array_mut().unwrap() {
            side["findings"] = Value::Array(Vec::new());
        }
    }
    fs::write(bench.path().join("clean.json"), before.to_string()).unwrap();
    bench
        .run(&["audit", &bad, "--baseline", "clean.json"])
        .code(1)
        .prints("NEW   fail")
        .prints("it has no manifest");
    // Others are refused, as is a bundle that was changed, and what is no audit.
    bench
        .run(&["audit", &good, "--baseline", "monday"])
        .code(2)
        .says("the baseline is about");
    fs::write(bench.path().join("monday/junit.xml"), "").unwrap();
    bench
        .run(&["audit", &bad, "--baseline", "monday"])
        .code(2)
        .says("not what its manifest says");
    bench
        .run(&["audit", &bad, "--baseline", "nowhere"])
        .code(2)
        .says("nowhere is not there");
    fs::write(bench.path().join("other.json"), "{}").unwrap();
    bench
        .run(&["audit", &bad, "--baseline", "other.json"])
        .code(2)
        .says("no result of an audit");
    bench.run(&["audit", &bad, "--baseline", "tuesday", "--follow"]).code(2);
}
