//! What is handed over is read by the tools that it is for: by their own readers, or by the schemas that they publish.

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;
use vda5050_tck::pack::{Packs, Role, asyncapi};
use vda5050_tck::report::attestation::{self, Attestation};
use vda5050_tck::report::junit::{self, Flavour, Inconclusive};
use vda5050_tck::report::keys::Keys;
use vda5050_tck::report::manifest::{FORMAT, Manifest, ManifestFile};
use vda5050_tck::report::no_result::{NoResult, Obstacle};
use vda5050_tck::report::sources::Sources;
use vda5050_tck::report::{allure, ctrf, cyclonedx, statement};
use vda5050_tck::result::{RunResult, TestResult};
use vda5050_tck::verdict::Verdict;

use crate::certificate::certified;
use crate::samples;

/// Where the readers are.
const READERS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/readers");

/// What a reader understands, or why it refuses; nothing where the reader is not there, which in CI is a failure.
fn read(program: &str, kind: &str, path: &Path) -> Option<Result<Value, String>> {
    let (script, module) = match program {
        "node" => ("read.mjs", None),
        _ => ("read.py", Some("import trcli, in_toto_attestation")),
    };
    let is_there = match module {
        None => Path::new(READERS).join("node_modules").is_dir(),
        Some(import) => {
            let mut asked = Command::new(program);
            asked.args(["-c", import]).stdout(Stdio::null()).stderr(Stdio::null());
            asked.status().is_ok_and(|status| status.success())
        }
    };
    if !is_there {
        assert!(
            std::env::var_os("CI").is_none(),
            "the readers are not installed, and CI must have them"
        );
        eprintln!("skipped: the readers of {READERS} are not installed");
        return None;
    }
    let output = Command::new(program)
        .arg(Path::new(READERS).join(script))
        .arg(kind)
        .arg(path)
        .stdin(Stdio::null())
        .output()
        .expect(program);
    Some(if output.status.success() {
        Ok(serde_json::from_slice(&output.stdout).expect("JSON"))
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    })
}

/// What a reader understands of a text.
fn understood(program: &str, kind: &str, text: &str) -> Option<Value> {
    let folder = tempfile::tempdir().expect("folder");
    let file = folder.path().join("handed-over");
    std::fs::write(&file, text).expect("write");
    let found = read(program, kind, &file)?;
    Some(found.unwrap_or_else(|why| panic!("{kind}: {why}\n{text}")))
}

fn runs() -> [(RunResult, Sources); 3] {
    let (hostile, _, quoted) = samples::hostile();
    [
        (samples::pass().0, samples::sources()),
        (samples::fail().0, samples::sources()),
        (hostile, quoted),
    ]
}

fn manifest() -> Manifest {
    Manifest {
        format: FORMAT.to_owned(),
        files: vec![ManifestFile {
            path: "journal.jsonl".to_owned(),
            bytes: 7,
            sha256: "ab".repeat(32),
        }],
        root: "cd".repeat(32),
    }
}

fn nothing() -> NoResult {
    NoResult {
        tool: "vda5050-tck 0.1.0".to_owned(),
        exit: 5,
        meaning: "the harness or its environment broke".to_owned(),
        profile: None,
        problems: vec![Obstacle {
            title: "the port is in use".to_owned(),
            ..Obstacle::default()
        }],
    }
}

/// How many of the tests have this status.
fn count(tests: &Value, status: &str) -> usize {
    let all = tests.as_array().expect("tests").iter();
    all.filter(|test| test["status"] == status).count()
}

fn of_verdict(result: &RunResult, wanted: Verdict) -> usize {
    let tests = result.tests.iter().map(|test| test.verdict);
    let all = tests.chain(result.monitors.iter().map(|monitor| monitor.verdict));
    all.filter(|verdict| *verdict == Some(wanted)).count()
}

#[test]
fn ctrf_is_read_by_its_validator_and_is_never_greener_than_the_run() {
    for (result, quoted) in runs() {
        let text = ctrf::render(&result, &quoted, Inconclusive::Error);
        assert_eq!(text, ctrf::render(&result, &quoted, Inconclusive::Error));
        let Some(read) = understood("node", "ctrf", &text) else {
            return;
        };
        let red = [Verdict::Fail, Verdict::Inconclusive, Verdict::Error];
        let red: usize = red.into_iter().map(|verdict| of_verdict(&result, verdict)).sum();
        let failed = count(&read["tests"], "failed");
        assert!(failed >= red && (!result.partial || failed > red), "{failed} of {red}");
        assert_eq!(read["summary"]["failed"], failed);
        assert_eq!(read["summary"]["tests"], read["tests"].as_array().expect("tests").len());
    }
    let fail = samples::fail().0;
    let skipped = ctrf::render(&fail, &samples::sources(), Inconclusive::Skip);
    let skipped: Value = serde_json::from_str(&skipped).expect("JSON");
    let tests = &skipped["results"]["tests"];
    assert_eq!(
        count(tests, "failed"),
        of_verdict(&fail, Verdict::Fail) + of_verdict(&fail, Verdict::Error)
    );
    let read = understood("node", "ctrf", &ctrf::no_result(&nothing())).expect("the reader was there");
    assert_eq!(read["summary"]["failed"], 1);
    assert_eq!(read["summary"]["tests"], 1);
    let folder = tempfile::tempdir().expect("folder");
    let wrong = folder.path().join("wrong");
    std::fs::write(&wrong, text_without_summary()).expect("write");
    assert!(read_fails("ctrf", &wrong));
}

fn text_without_summary() -> String {
    ctrf::no_result(&nothing()).replace("\"summary\"", "\"sum\"")
}

fn read_fails(kind: &str, path: &Path) -> bool {
    read("node", kind, path).is_some_and(|found| found.is_err())
}

#[test]
fn results_of_allure_are_read_by_its_reader() {
    for (result, quoted) in runs() {
        let files = allure::render(&result, &quoted, Inconclusive::Error);
        let folder = tempfile::tempdir().expect("folder");
        for (name, text) in &files {
            std::fs::write(folder.path().join(name), text).expect("write");
        }
        let Some(read) = read("node", "allure", folder.path()) else {
            return;
        };
        let read = read.expect("read");
        assert_eq!(
            read.as_array().expect("results").len(),
            files.len(),
            "a file for each case"
        );
        let failed = of_verdict(&result, Verdict::Fail);
        assert!(count(&read, "failed") >= failed && count(&read, "unknown") == 0);
        let open = of_verdict(&result, Verdict::Inconclusive) + of_verdict(&result, Verdict::Error);
        assert!(count(&read, "broken") >= open);
        if failed > 0 && !result.partial {
            let one = read
                .as_array()
                .expect("results")
                .iter()
                .find(|one| one["status"] == "failed");
            let one = one.expect("a failed one");
            assert!(one["message"].as_str().is_some_and(|message| !message.is_empty()));
            assert!(!one["steps"].as_array().expect("steps").is_empty());
        }
    }
}

#[test]
fn attestations_of_cyclonedx_keep_to_its_schema_and_every_reference_leads_somewhere() {
    for (result, quoted) in runs().into_iter().take(2) {
        let text = cyclonedx::render(&result, &quoted, &manifest());
        assert_eq!(text, cyclonedx::render(&result, &quoted, &manifest()));
        let Some(read) = understood("node", "cyclonedx", &text) else {
            return;
        };
        let map = read["attestations"][0]["map"].as_array().expect("map");
        assert_eq!(map.len(), result.requirements.len(), "an entry for each requirement");
        for (entry, requirement) in map.iter().zip(&result.requirements) {
            let (claims, counter) = (entry["claims"].is_array(), entry["counterClaims"].is_array());
            let expected = match requirement.verdict {
                Some(Verdict::Pass | Verdict::Warning) => (true, false),
                Some(Verdict::Fail) => (false, true),
                _ => (false, false),
            };
            assert_eq!((claims, counter), expected, "{}", requirement.id);
            let score = entry["conformance"]["score"].as_f64();
            assert_eq!(
                score == Some(1.0),
                requirement.verdict == Some(Verdict::Pass) && !statement::is_selection(&result),
                "{}",
                requirement.id
            );
        }
    }
    let (result, quoted) = &runs()[2];
    let text = cyclonedx::render(result, quoted, &manifest());
    assert!(
        serde_json::from_str::<Value>(&text).is_ok() && !text.contains("\\u001b"),
        "{text}"
    );
}

#[test]
fn statements_are_read_by_the_bindings_of_in_toto() {
    let bytes = serde_json::to_vec(&manifest()).expect("manifest");
    let root = manifest().root;
    for (result, _) in runs().into_iter().take(2) {
        let simple = attestation::simple(&result, &bytes, &root);
        let Some(read) = understood("python3", "in-toto", &simple) else {
            return;
        };
        let predicate = &read["predicate"];
        assert!(
            predicate["verifier"]["id"]
                .as_str()
                .is_some_and(|id| id.contains("://") && id.ends_with("@0.1.0"))
        );
        let time: jiff::Timestamp = predicate["timeCreated"]
            .as_str()
            .expect("time")
            .parse()
            .expect("a time");
        assert!(time >= "2026-03-02T08:15:00Z".parse().expect("time"));
        let properties = predicate["properties"].as_array().expect("properties");
        let passed = result
            .requirements
            .iter()
            .filter(|one| one.verdict == Some(Verdict::Pass))
            .count();
        let says_nothing = result.partial || statement::is_selection(&result);
        assert_eq!(properties.len(), if says_nothing { 0 } else { passed });
        assert!(
            !properties
                .iter()
                .any(|one| one.as_str().is_some_and(|one| one.ends_with("_CONFORMS")))
        );
        let whole = Attestation::of(&result, &bytes, &root).to_json().expect("JSON");
        understood("python3", "in-toto", &whole).expect("the reader was there");
    }
    let simple: Value =
        serde_json::from_str(&attestation::simple(&certified(samples::pass().0), &bytes, &root)).expect("JSON");
    assert_eq!(simple["predicate"]["properties"][0], "VDA5050_2.1.0_AGV_CONFORMS");
}

/// Keys of both systems, for what stands in the failing sample.
const KEYS: &str = "\"order/update-lower-id-refused\" = \"C101\"\n\"connection/last-will\" = \"PROJ-7\"\n\
    \"header/id-rises\" = \"C102\"\nORD-REJ-12 = \"PROJ-12\"\nORD-REJ-14 = \"C103\"\n\"no/such\" = \"C1\"\n";

#[test]
fn junit_with_keys_is_read_by_the_command_line_of_testrail_and_has_what_xray_looks_for() {
    let (result, quoted) = (samples::fail().0, samples::sources());
    let keys = Keys::of_file(KEYS).expect("keys");
    assert_eq!(keys.unmet(&result), ["no/such"]);
    let xml = junit::with_keys(&result, &quoted, &keys, Flavour::default()).expect("junit");
    let document = roxmltree::Document::parse(&xml).expect("well-formed");
    let property = |case: &str, name: &str| {
        let cases = document.descendants().filter(|node| node.has_tag_name("testcase"));
        let mut cases = cases.filter(|node| node.attribute("name").is_some_and(|name| name.starts_with(case)));
        let properties = cases.next().expect(case).descendants();
        let mut properties = properties.filter(|node| node.attribute("name") == Some(name));
        properties
            .next()
            .and_then(|node| node.attribute("value").map(str::to_owned))
    };
    let of = |case: &str, name: &str| property(case, name).unwrap_or_default();
    assert_eq!(of("connection/last-will", "test_key"), "PROJ-7");
    assert_eq!(property("connection/last-will", "test_id"), None);
    assert_eq!(of("order/update-lower-id-refused", "requirements"), "PROJ-12");
    assert_eq!(property("order/update-lower-id-refused", "test_key"), None);
    assert!(of("order/update-lower-id-refused", "vda5050.requirements").contains("ORD-REJ-14"));
    assert!(of("header/id-rises", "testrail_result_comment").starts_with("warning: "));
    // What JUnit itself says is the same.
    let plain = junit::render(&result, Flavour::default()).expect("junit");
    let plain = roxmltree::Document::parse(&plain).expect("well-formed");
    let failures = |document: &roxmltree::Document<'_>| {
        let all = document.descendants().filter(|node| node.has_tag_name("failure"));
        all.count()
    };
    assert_eq!(failures(&plain), failures(&document));
    let Some(read) = understood("python3", "testrail", &xml) else {
        return;
    };
    let status = |case: u64| {
        let all = read.as_array().expect("cases").iter();
        let all: Vec<&Value> = all
            .filter(|one| one["case"] == case)
            .map(|one| &one["status"])
            .collect();
        all.into_iter().filter_map(Value::as_u64).collect::<Vec<u64>>()
    };
    // 1 is passed and 5 failed.
    assert_eq!((status(101), status(102), status(103)), (vec![5], vec![1], vec![1]));
}

#[test]
fn of_several_cases_with_one_test_of_testrail_the_worst_is_handed_over() {
    let mut result = samples::fail().0;
    let failed = result
        .tests
        .iter()
        .find(|test| test.verdict == Some(Verdict::Fail))
        .expect("failed")
        .clone();
    let passed = samples::pass().0.tests[0].clone();
    let table = [("one", &passed), ("two", &failed), ("three", &passed)];
    result.tests = table
        .map(|(name, like)| TestResult {
            id: format!("group/table[{name}]"),
            ..like.clone()
        })
        .into();
    let keys = Keys::of_file("\"group/table\" = \"C7\"").expect("keys");
    let xml = junit::with_keys(&result, &samples::sources(), &keys, Flavour::default()).expect("junit");
    assert_eq!(xml.matches("\"test_id\"").count(), 1);
    let before = xml.split("\"test_id\"").next().expect("text");
    assert!(
        before
            .rsplit("<testcase")
            .next()
            .expect("case")
            .contains("group/table[two]"),
        "{xml}"
    );
    // Xray joins several results of one test itself.
    let keys = Keys::of_file("\"group/table\" = \"PROJ-7\"").expect("keys");
    let xml = junit::with_keys(&result, &samples::sources(), &keys, Flavour::default()).expect("junit");
    assert_eq!(xml.matches("\"test_key\"").count(), 3);
}

#[test]
fn every_protocol_version_is_an_asyncapi_document_of_both_sides() {
    let packs = Packs::load(&vda5050_tck::embedded()).expect("packs");
    assert!(packs.all().len() > 2);
    for pack in packs.all() {
        for side in [Role::Agv, Role::MasterControl] {
            let document = asyncapi(pack, side);
            let Some(read) = understood("node", "asyncapi", &document.to_string()) else {
                return;
            };
            let channels = read["channels"].as_object().expect("channels");
            assert_eq!(channels.len(), pack.topics().len());
            let operations = read["operations"].as_object().expect("operations");
            for topic in pack.topics() {
                let name = format!("#/channels/{}", topic.name);
                let operation = operations
                    .values()
                    .find(|one| one["channel"]["$ref"] == name)
                    .expect("operation");
                let mqtt = &operation["bindings"]["mqtt"];
                let publishes = topic.publisher == side;
                assert_eq!(operation["action"], if publishes { "send" } else { "receive" });
                assert_eq!(mqtt["qos"], topic.qos);
                assert_eq!(mqtt["retain"].as_bool(), publishes.then_some(topic.retain));
                let address = channels[topic.name.as_str()]["address"].as_str().expect("address");
                assert!(address.contains("/{manufacturer}/{serialNumber}/"), "{address}");
            }
        }
    }
}
