//! What is made of a finished run for others: a certificate, a statement to be signed, and what pipelines read.

use std::fs;
use std::path::Path;
use std::time::Duration;

use serde_json::Value;
use vda5050_tck::pack::Role;
use vda5050_tck::profile::Setting;
use vda5050_tck::report::junit::Inconclusive;
use vda5050_tck::run::{Bundle, Selection, VirtualRun, run_silently, sources, write_all};

use crate::bench::Bench;
use crate::tool::{Running, tool};

/// A bundle as `certify` leaves it, of a few tests.
pub fn certified(folder: &Path) {
    certified_within(folder, None);
}

/// A bundle as `certify --budget` leaves it.
pub fn certified_within(folder: &Path, budget: Option<Duration>) {
    fs::create_dir(folder).unwrap();
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let pack = library.rules.packs.latest().clone();
    let mut request = VirtualRun::of(&library, &pack);
    let tests = library.tests(Role::Agv, &pack.id).into_iter();
    request.tests = Selection::all(tests.filter(|test| test.id.starts_with("order-update/")).collect());
    request.certifies = true;
    request.budget = budget;
    request.settings = [
        ("laboratory", "Test house"),
        ("tester", "A. Person"),
        ("firmware-version", "4.2.1"),
    ]
    .map(|(name, value)| Setting::shown(format!("certificate.{name}"), value, "device.toml"))
    .to_vec();
    let finished = run_silently(&library, &pack, request).unwrap();
    let bundle = Bundle::open(folder);
    let mut writer = bundle.journal().unwrap();
    for entry in finished.recorder.journal().entries() {
        writer.write(&entry.record).unwrap();
    }
    let quoted = sources(&library, &pack);
    let journal = finished.recorder.journal();
    write_all(&bundle, &finished.result, &quoted, journal, Inconclusive::Error).unwrap();
}

#[test]
fn a_certificate_is_printed_verified_and_judged_again_elsewhere() {
    let bench = Bench::new();
    certified(&bench.path().join("run"));
    let page = bench.run(&["report", "--certificate", "run"]).code(0).stdout;
    assert!(page.contains("Certificate of conformance") && page.contains("Test house") && page.contains("4.2.1"));
    let (_, rest) = page.split_once("--root ").unwrap();
    let root = rest.split_whitespace().next().unwrap();
    bench
        .run(&["report", "--verify", "--root", root, "run"])
        .code(0)
        .prints("intact");
    bench
        .run(&["report", "--rejudge", "run"])
        .code(0)
        .prints("byte for byte");
    let other = format!("sha256:{}", "0".repeat(64));
    bench
        .run(&["report", "--verify", "--root", &other, "run"])
        .code(1)
        .prints("not the bundle that was meant");
    bench.run(&["report", "--verify", "--root", "sha256:12", "run"]).code(2);
    let statement = bench.run(&["report", "--attestation", "run"]).code(0).stdout;
    let statement: Value = serde_json::from_str(&statement).unwrap();
    assert_eq!(statement["subject"][0]["annotations"]["root"], root);
    assert_eq!(statement["predicate"]["result"], "PASSED");
}

#[test]
fn no_paper_is_made_of_a_bundle_that_was_changed_or_of_a_run_that_was_no_certification() {
    let bench = Bench::new();
    certified(&bench.path().join("run"));
    let result = bench.path().join("run/result.json");
    let text = fs::read_to_string(&result).unwrap();
    fs::write(&result, text.replacen("Test house", "Other house", 1)).unwrap();
    for paper in [&["--certificate"][..], &["--attestation"], &["--as", "sarif"]] {
        let arguments = [&["report"], paper, &["run"]].concat();
        bench.run(&arguments).code(2).says("is not what its manifest says");
    }
    bench.run(&["run", "--virtual", "order-rejection/unreadable"]).code(0);
    let folder = bench.bundle().display().to_string();
    bench
        .run(&["report", "--certificate", &folder])
        .code(2)
        .says("was not made by `certify`");
}

#[test]
fn a_failed_run_is_printed_for_every_pipeline() {
    let bench = Bench::new();
    let summary = bench.path().join("summary.md");
    let arguments = [
        "run",
        "--virtual",
        "order-rejection/unreadable",
        "--fault",
        "validation-error-misspelled",
    ];
    let mut command = tool(bench.path(), &arguments);
    command
        .env("GITHUB_ACTIONS", "true")
        .env("GITHUB_STEP_SUMMARY", &summary);
    Running::start(&mut command)
        .end()
        .code(1)
        .says("::error title=ORD-REJ-02::");
    let page = fs::read_to_string(&summary).unwrap();
    assert!(
        page.starts_with("## FAIL") && page.contains("**ORD-REJ-02** fail"),
        "{page}"
    );
    let folder = bench.bundle().display().to_string();
    let printed = |what: &str| bench.run(&["report", "--as", what, &folder]).code(0).stdout;
    assert!(printed("markdown").starts_with("## FAIL"));
    let junit = printed("junit");
    assert!(junit.contains("<property name=\"root\" value=\"sha256:") && junit.contains("type=\"ORD-REJ-02\""));
    assert!(printed("junit-requirements").contains("<testcase name=\"ORD-REJ-02 "));
    let quality: Value = serde_json::from_str(&printed("code-quality")).unwrap();
    assert_eq!(quality[0]["check_name"], "ORD-REJ-02");
    assert_eq!(quality[0]["severity"], "major");
    let sarif: Value = serde_json::from_str(&printed("sarif")).unwrap();
    let found = &sarif["runs"][0]["results"][0];
    let help = sarif["runs"][0]["tool"]["driver"]["rules"][0]["helpUri"]
        .as_str()
        .unwrap();
    assert!(help.starts_with("https://github.com/VDA5050/VDA5050/blob/"), "{help}");
    assert_eq!(
        (&found["ruleId"], &found["level"]),
        (&Value::from("ORD-REJ-02"), &Value::from("error"))
    );
    assert!(
        found["locations"][0]["physicalLocation"]["region"]["startLine"]
            .as_u64()
            .unwrap()
            > 1
    );
}

#[test]
fn programs_get_json_from_every_way_to_look_at_a_run_and_from_errors() {
    let bench = Bench::new();
    bench.run(&["run", "--virtual", "order-rejection/unreadable"]).code(0);
    let folder = bench.bundle().display().to_string();
    let read = |arguments: &[&str]| -> Value {
        let arguments = [&["report"], arguments, &["--format", "json"]].concat();
        serde_json::from_str(&bench.run(&arguments).code(0).stdout).unwrap()
    };
    assert_eq!(read(&["--verify", &folder])["intact"], true);
    assert_eq!(read(&["--rejudge", &folder])["same"], true);
    assert_eq!(
        read(&["--compare", &folder, &folder])["steps"][0]["changed"]["requirements"],
        serde_json::json!([])
    );
    let refused = bench.run(&["report", "nowhere", "--format", "json"]).code(2);
    let error: Value = serde_json::from_str(refused.stderr.trim()).unwrap();
    assert_eq!(
        (&error["error"]["kind"], &error["error"]["exit"]),
        (&Value::from("usage"), &Value::from(2))
    );
}
