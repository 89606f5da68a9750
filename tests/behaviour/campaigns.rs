//! `campaign`: many devices and suites, a run for each pair, and what is left of them when somebody kills it.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::bench::{Bench, QUICK};
use crate::tool::{Running, tool};

const TEST: &str = "order-rejection/lower-update-id";
const FAULT: &str = "outdated-update-taken-over";

fn write(bench: &Bench, text: &str) {
    fs::write(bench.path().join("c.toml"), text).unwrap();
}

fn start(bench: &Bench) -> Running {
    Running::start(&mut tool(bench.path(), &["campaign", "c.toml"]))
}

fn schema(name: &str) -> jsonschema::Validator {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas").join(name);
    let schema: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    jsonschema::draft202012::meta::validate(&schema).unwrap();
    jsonschema::validator_for(&schema).unwrap()
}

/// The summary of the campaign `c`, held against its schema.
fn summary(bench: &Bench) -> Value {
    let text = fs::read_to_string(bench.path().join("c/campaign.json")).unwrap();
    let value: Value = serde_json::from_str(&text).unwrap();
    let wrong: Vec<String> = schema("campaign-result.schema.json")
        .iter_errors(&value)
        .map(|error| error.to_string())
        .collect();
    assert!(wrong.is_empty(), "{wrong:?}");
    value
}

/// Entry, exit code, and how many runs it took.
fn outcomes(bench: &Bench) -> Vec<(String, Value, Value)> {
    let summary = summary(bench);
    let all = summary["entries"].as_array().unwrap().iter();
    let name = |one: &Value| format!("{}/{}", one["device"].as_str().unwrap(), one["suite"].as_str().unwrap());
    all.map(|one| (name(one), one["exit"].clone(), one["attempts"].clone()))
        .collect()
}

fn events(bench: &Bench, entry: &str, attempt: u32) -> PathBuf {
    bench.path().join(format!("c/{entry}/events-{attempt}.jsonl"))
}

/// The processes that write these events.
#[cfg(target_os = "linux")]
fn writers(events: &Path) -> Vec<String> {
    let wanted = events
        .strip_prefix(events.parent().unwrap().parent().unwrap().parent().unwrap())
        .unwrap();
    let wanted = wanted.display().to_string();
    let folder = events
        .parent()
        .unwrap()
        .parent()
        .unwrap()
        .parent()
        .unwrap()
        .parent()
        .unwrap()
        .canonicalize()
        .unwrap();
    let processes = fs::read_dir("/proc").unwrap().map(|entry| entry.unwrap().path());
    let is_writer = |process: &PathBuf| {
        let words = fs::read(process.join("cmdline")).unwrap_or_default();
        let here = fs::read_link(process.join("cwd")).is_ok_and(|cwd| cwd == folder);
        here && String::from_utf8_lossy(&words).contains(&wanted)
    };
    let writers = processes.filter(is_writer);
    writers
        .map(|process| process.file_name().unwrap().to_string_lossy().into_owned())
        .collect()
}

const THREE: &str = "[devices.reference]\narguments = [\"--reference\"]\nlisten = \"127.0.0.1:0\"\n\
    [suites.first]\ntests = [\"instant-actions/factsheet-request\"]\n\
    [suites.second]\ntests = [\"order-acceptance\", \"order-update\"]\narguments = [\"--seed\", \"1\"]\n\
    [suites.third]\ntests = [\"instant-actions/factsheet-request\"]\n";

/// Waits until a test of the second entry has ended and others have not.
fn in_the_middle(bench: &Bench, running: &mut Running) {
    let path = events(bench, "reference/second", 1);
    running.until("a test of the second entry", |_| {
        let text = fs::read_to_string(&path).unwrap_or_default();
        (text.contains("\"event\":\"test-ended\"") && !text.contains("\"run-ended\"")).then_some(())
    });
}

#[test]
fn each_device_meets_each_suite_once_and_history_reads_what_came_of_it() {
    let bench = Bench::new();
    write(
        &bench,
        &format!(
            "[campaign]\nparallel = 2\n[devices.good]\narguments = [\"--virtual\"]\n[devices.bad]\narguments = \
             [\"--virtual\", \"--fault\", \"{FAULT}\"]\n[suites.update]\ntests = [\"{TEST}\"]\narguments = [\"--seed\", \
             \"1\"]\n[suites.quick]\ntests = [\"{QUICK}\"]\n"
        ),
    );
    let ended = bench.run(&["campaign", "c.toml"]).code(1);
    ended
        .prints("FAIL          bad/update")
        .prints("4 of 4 carried out; exit code 1");
    let expected = [
        ("good/update", 0),
        ("good/quick", 0),
        ("bad/update", 1),
        ("bad/quick", 0),
    ];
    let expected = expected.map(|(name, exit)| (name.to_owned(), json!(exit), json!(1)));
    assert_eq!(outcomes(&bench), expected);
    let junit = fs::read_to_string(bench.path().join("c/junit.xml")).unwrap();
    roxmltree::Document::parse(&junit).unwrap();
    assert_eq!(
        (junit.matches("<testcase").count(), junit.matches("<failure").count()),
        (4, 1),
        "{junit}"
    );
    assert!(
        fs::read_to_string(bench.path().join("c/summary.md"))
            .unwrap()
            .contains("| bad | update | FAIL |")
    );
    // Nothing is left to do, and the summary is the same.
    bench
        .run(&["campaign", "c.toml"])
        .code(1)
        .says("4 of 4 runs were carried out before");
    assert_eq!(outcomes(&bench), expected);
    let history = bench.run(&["history", "c", "--format", "json"]).code(0);
    let history: Value = serde_json::from_str(&history.stdout).unwrap();
    assert_eq!((&history["bundles"], &history["leftOut"]), (&json!(4), &json!([])));
    // Evidence that has changed is none.
    let bundle = summary(&bench)["entries"][0]["bundle"].as_str().unwrap().to_owned();
    fs::write(bench.path().join("c").join(bundle).join("result.json"), "{}").unwrap();
    bench.run(&["campaign", "c.toml"]).code(1);
    assert_eq!(outcomes(&bench)[0].1, json!(5));
    bench.run(&["campaign", "c.toml", "--retry"]).code(1);
    assert_eq!(outcomes(&bench)[0].1, json!(0));
}

#[test]
#[cfg(target_os = "linux")]
fn a_campaign_that_is_killed_with_its_run_goes_on_where_it_was() {
    let bench = Bench::new();
    write(&bench, THREE);
    let mut campaign = start(&bench);
    in_the_middle(&bench, &mut campaign);
    campaign.kill();
    let writers = writers(&events(&bench, "reference/second", 1));
    assert!(!writers.is_empty(), "the run of the campaign was not found");
    for writer in writers {
        let killed = std::process::Command::new("sh")
            .args(["-c", &format!("kill -KILL {writer}")])
            .status();
        assert!(killed.unwrap().success());
    }
    let before: Vec<Value> = summary(&bench)["entries"].as_array().unwrap().clone();
    assert_eq!((&before[0]["exit"], before[1].get("exit")), (&json!(0), None));
    assert_eq!(summary(&bench)["exit"], 5, "what is not carried out is never green");
    let junit = fs::read_to_string(bench.path().join("c/junit.xml")).unwrap();
    assert_eq!(junit.matches("<error").count(), 2, "{junit}");
    bench
        .run(&["campaign", "c.toml"])
        .code(0)
        .says("1 of 3 runs was carried out before")
        .says("reference/second: goes on");
    let expected = [("first", 1), ("second", 2), ("third", 1)];
    let expected = expected.map(|(name, runs)| (format!("reference/{name}"), json!(0), json!(runs)));
    assert_eq!(outcomes(&bench), expected);
    // The first entry was not run again, and of the second no test.
    let after = summary(&bench);
    assert_eq!(after["entries"][0], before[0]);
    let bundle = bench
        .path()
        .join("c")
        .join(after["entries"][1]["bundle"].as_str().unwrap());
    let result: Value = serde_json::from_slice(&fs::read(bundle.join("result.json")).unwrap()).unwrap();
    assert!(
        result["joined"][0]["kept"].as_u64().unwrap() > 0,
        "{}",
        result["joined"]
    );
    let mut ids: Vec<&str> = result["tests"]
        .as_array()
        .unwrap()
        .iter()
        .map(|test| test["id"].as_str().unwrap())
        .collect();
    let all = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert!(ids.len() == all && all > 5, "a test is there twice: {ids:?}");
    let history = bench.run(&["history", "c", "--format", "json"]).code(0);
    let history: Value = serde_json::from_str(&history.stdout).unwrap();
    assert_eq!(
        (&history["bundles"], history["leftOut"].as_array().unwrap().len()),
        (&json!(3), 1)
    );
}

#[test]
#[cfg(target_os = "linux")]
fn a_run_that_outlives_its_campaign_is_waited_for_and_not_repeated() {
    let bench = Bench::new();
    write(&bench, THREE);
    let mut campaign = start(&bench);
    in_the_middle(&bench, &mut campaign);
    campaign.kill();
    assert!(!writers(&events(&bench, "reference/second", 1)).is_empty());
    bench
        .run(&["campaign", "c.toml"])
        .code(0)
        .says("reference/second: its run goes on from an earlier call");
    let expected = ["first", "second", "third"].map(|name| (format!("reference/{name}"), json!(0), json!(1)));
    assert_eq!(outcomes(&bench), expected);
}

#[test]
fn an_interrupted_campaign_ends_its_runs_in_good_order_and_goes_on_later() {
    let bench = Bench::new();
    write(&bench, THREE);
    let mut campaign = start(&bench);
    in_the_middle(&bench, &mut campaign);
    let beside = bench.run(&["campaign", "c.toml"]);
    beside.code(5).says("another campaign is going on");
    campaign.signal("TERM");
    campaign.end().code(130).says("goes on where it was");
    let told = fs::read_to_string(events(&bench, "reference/second", 1)).unwrap();
    assert!(told.contains("\"run-ended\""), "the run was not ended in good order");
    bench
        .run(&["campaign", "c.toml"])
        .code(0)
        .says("reference/second: goes on");
    assert_eq!(outcomes(&bench)[1].2, json!(2));
}

#[test]
fn what_is_wrong_with_a_campaign_has_a_place_and_is_2() {
    let bench = Bench::new();
    let good = "[devices.a]\narguments = [\"--virtual\"]\n[suites.b]\n";
    let call = |text: &str, says: &[&str]| {
        write(&bench, text);
        let ended = bench.run(&["campaign", "c.toml"]).code(2);
        for text in says {
            assert!(ended.stderr.contains(text), "{text}\n{}", ended.stderr);
        }
        assert!(!bench.path().join("c").exists(), "nothing is begun");
    };
    call(
        "[devices.a]\nprofle = \"x\"\n[suites.b]\n",
        &["c.toml:2", "did you mean `profile`?"],
    );
    call(
        &format!("{good}arguments = [\"--sed\", \"1\"]\n"),
        &["c.toml:3", "a/b cannot be called", "--sed"],
    );
    call(
        &format!("{good}command = \"certify\"\ntests = [\"x\"]\n"),
        &["c.toml:3", "a/b cannot be called"],
    );
    call(
        "[campaign]\nparallel = 2\n[devices.a]\n[devices.b]\n[suites.c]\n",
        &["c.toml:3", "no address of its own"],
    );
    call(
        &format!("{good}tests = [\"{QUICK}\"]\n[suites.c]\ntests = [\"no/such\"]\n"),
        &["c.toml:5", "a/c: no test matches `no/such`", "list tests"],
    );
    fs::write(bench.path().join("wrong.toml"), "[device]\nmanufacturer = 7\n").unwrap();
    call(
        "[devices.a]\nprofile = \"wrong.toml\"\n[suites.b]\n[suites.c]\n",
        &["wrong.toml:2", "manufacturer"],
    );
    bench.run(&["campaign", "nowhere.toml"]).code(2).says("nowhere.toml");
    // An entry does not become another one between two calls.
    write(&bench, &format!("{good}tests = [\"{QUICK}\"]\n"));
    bench.run(&["campaign", "c.toml"]).code(0);
    write(&bench, &format!("{good}tests = [\"{TEST}\"]\n"));
    bench
        .run(&["campaign", "c.toml"])
        .code(2)
        .says("a/b: it was begun as `run --virtual")
        .says("another folder (--out)");
    bench.run(&["campaign", "c.toml", "--out", "other"]).code(0);
}

#[test]
fn the_schema_of_a_campaign_takes_what_the_program_takes() {
    let schema = schema("campaign.schema.json");
    let value = |text: &str| -> Value { serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap() };
    for good in [
        THREE,
        "[campaign]\nparallel = 3\nout = \"x\"\n[devices.a]\nprofile = \"p.toml\"\n[suites.b]\ncommand = \"certify\"\ndevices = [\"a\"]\n",
    ] {
        assert!(schema.is_valid(&value(good)), "{good}");
    }
    for bad in [
        "[devices.a]\nprofle = \"x\"\n[suites.b]\n",
        "[campaign]\nparallel = 0\n[devices.a]\n[suites.b]\n",
        "[devices.a]\n[suites.b]\ncommand = \"explore\"\n",
        "[devices.a]\n",
        "[devices.a]\n[suites.\"../b\"]\n",
    ] {
        assert!(!schema.is_valid(&value(bad)), "{bad}");
    }
}
