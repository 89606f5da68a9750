//! What a pipeline reads is written whatever becomes of the run, and no earlier run is taken for this one.

use std::fs;
use std::net::TcpListener;
use std::path::Path;

use serde_json::Value;

use crate::asked::own_test;
use crate::bench::{Bench, Profile, QUICK, REFUSAL, bundles};
use crate::tool::{Ended, Running, tool};

/// A file of each kind.
const ALL: [&str; 5] = [
    "junit=out/junit.xml",
    "junit-requirements=out/requirements.xml",
    "markdown=out/summary.md",
    "code-quality=out/quality.json",
    "sarif=out/findings.sarif",
];

/// The arguments that ask for all of them.
fn asked() -> Vec<&'static str> {
    ALL.iter().flat_map(|one| ["--as", one]).collect()
}

/// Holds that every file says this of a run that is none, or is not complete.
#[track_caller]
fn are_red(folder: &Path, why: &str) {
    let read = |name: &str| {
        let text = fs::read_to_string(folder.join("out").join(name)).unwrap();
        assert!(text.contains(why), "{name} does not say `{why}`:\n{text}");
        text
    };
    for name in ["junit.xml", "requirements.xml"] {
        let text = read(name);
        let junit = roxmltree::Document::parse(&text).unwrap();
        let case = junit.descendants().find(|node| node.has_tag_name("testcase")).unwrap();
        assert_eq!(
            case.attribute("name"),
            Some("the run is complete and decided something")
        );
        assert!(case.children().any(|node| node.has_tag_name("error")), "{text}");
    }
    read("summary.md");
    let quality: Value = serde_json::from_str(&read("quality.json")).unwrap();
    assert_eq!(quality[0]["severity"], "blocker");
    let sarif: Value = serde_json::from_str(&read("findings.sarif")).unwrap();
    assert_eq!(sarif["runs"][0]["invocations"][0]["executionSuccessful"], false);
    assert_eq!(sarif["runs"][0]["results"][0]["level"], "error");
}

#[test]
fn what_is_asked_for_by_flag_is_written_in_every_case() {
    let bench = Bench::new();
    let run = |arguments: &[&str]| bench.run(&[&["run"], arguments, &asked()[..]].concat());
    let green = || {
        run(&["--virtual", QUICK]).code(0);
        let junit = fs::read_to_string(bench.path().join("out/junit.xml")).unwrap();
        assert!(junit.contains("name=\"root\"") && !junit.contains("<error"), "{junit}");
        let quality = fs::read_to_string(bench.path().join("out/quality.json")).unwrap();
        assert_eq!(quality.trim(), "[]");
        let sarif: Value = serde_json::from_slice(&fs::read(bench.path().join("out/findings.sarif")).unwrap()).unwrap();
        assert_eq!(sarif["runs"][0]["invocations"][0]["executionSuccessful"], true);
    };
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    fs::write(bench.path().join("wrong.toml"), "[device]\nmanufacturer = 7\n").unwrap();
    let listening = ["--reference", "--listen", &address, QUICK];
    let cases: [(&[&str], i32, &str); 7] = [
        (&["--virtual", "order-rejction/unreadable"], 2, "no test matches"),
        (&["--virtual", "--no-such-flag"], 2, "--no-such-flag"),
        (&["--profile", "wrong.toml"], 2, "manufacturer"),
        (&["--profile", "nowhere.toml"], 2, "nowhere.toml"),
        (&["--virtual", "--suites", "nowhere"], 2, "nowhere"),
        (&["--virtual", QUICK, "--shard", "2/2"], 4, "no test was selected"),
        (&listening, 5, &address),
    ];
    for (arguments, code, why) in cases {
        green();
        run(arguments).code(code);
        are_red(bench.path(), why);
        assert!(
            !bench.path().join("reports/latest").exists(),
            "{arguments:?}: latest leads to the run before"
        );
    }
    green();
    assert!(bench.path().join("reports/latest/report.html").exists());
}

#[test]
fn a_run_that_found_nothing_to_test_or_was_killed_leaves_red_files() {
    let bench = Bench::new();
    let profile = Profile::default().with(&[("connect", "1 s")]);
    fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    let profile = ["run", "--profile", "device.toml", QUICK];
    bench.run(&[&profile[..], &asked()].concat()).code(5);
    are_red(bench.path(), "no device connected within 1 s");
    let patient = Profile::default().with(&[("connect", "50 s")]);
    let (mut run, _) = bench.start(&patient, &[&[QUICK], &asked()[..]].concat());
    run.kill();
    are_red(bench.path(), "has not come to its end");
    let (run, _) = bench.start(&patient, &[&[QUICK], &asked()[..]].concat());
    run.interrupt();
    run.end().code(130);
    are_red(bench.path(), "interrupted by the user");
}

#[test]
fn a_file_that_cannot_be_written_is_5_before_anything_is_tried_and_a_plan_writes_none() {
    let bench = Bench::new();
    fs::create_dir(bench.path().join("folder")).unwrap();
    bench
        .run(&["run", "--virtual", QUICK, "--as", "junit=folder"])
        .code(5)
        .says_one_error("folder");
    assert!(!bench.path().join("reports").exists());
    bench
        .run(&["run", "--virtual", QUICK, "--plan", "--as", "junit=junit.xml"])
        .code(2)
        .says("a plan runs nothing");
    bench
        .run(&["run", "--virtual", QUICK, "--as", "junit"])
        .code(2)
        .says("junit=FILE");
    bench
        .run(&["run", "--virtual", QUICK, "--as", "jnit=x.xml"])
        .code(2)
        .says("there is no `jnit`; there are junit, ");
}

#[test]
fn failures_stand_in_the_files_that_were_asked_for() {
    let bench = Bench::new();
    let fault = ["run", "--virtual", REFUSAL, "--fault", "validation-error-fatal"];
    bench.run(&[&fault[..], &asked()].concat()).code(1);
    let read = |name: &str| fs::read_to_string(bench.path().join("out").join(name)).unwrap();
    for name in [
        "junit.xml",
        "requirements.xml",
        "summary.md",
        "quality.json",
        "findings.sarif",
    ] {
        assert!(read(name).contains("ORD-REJ-02"), "{name}");
    }
    let printed = bench.run(&["report", "--as", "junit", "reports/latest"]).code(0).stdout;
    assert_eq!(read("junit.xml"), printed);
    bench
        .run(&[
            "report",
            "reports/latest",
            "--as",
            "junit=again.xml",
            "--as",
            "sarif=again.sarif",
        ])
        .code(0);
    assert_eq!(fs::read_to_string(bench.path().join("again.xml")).unwrap(), printed);
    // The file of an earlier call does not outlive one that comes to nothing.
    bench.run(&["report", "nowhere", "--as", "junit=again.xml"]).code(2);
    assert!(
        fs::read_to_string(bench.path().join("again.xml"))
            .unwrap()
            .contains("<error")
    );
}

#[test]
fn a_start_that_failed_leaves_no_bundle_and_the_failures_before_it_are_still_known() {
    let bench = Bench::new();
    let fault = ["run", "--virtual", "--fault", "validation-error-fatal"];
    bench.run(&[&fault[..], &[REFUSAL, QUICK]].concat()).code(1);
    let before = bundles(&bench.path().join("reports"));
    let profile = Profile {
        device: "command = [\"no-such-program\"]".to_owned(),
        ..Profile::default()
    };
    fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    bench
        .run(&["run", "--profile", "device.toml", QUICK])
        .code(2)
        .says_one_error("no-such-program");
    assert_eq!(bundles(&bench.path().join("reports")), before);
    bench.run(&["report", "--as", "junit", "reports/latest"]).code(2);
    bench
        .run(&[&fault[..], &["--last-failed"]].concat())
        .code(1)
        .prints(REFUSAL);
}

#[test]
fn latest_leads_to_neither_of_two_runs_at_once() {
    let bench = Bench::new();
    let patient = Profile::default().with(&[("connect", "50 s")]);
    let (first, _) = bench.start(&patient, &[QUICK]);
    assert!(bench.path().join("reports/latest").exists());
    bench
        .run(&["run", "--virtual", QUICK])
        .code(0)
        .says("`latest` leads to neither of them");
    assert!(!bench.path().join("reports/latest").is_symlink());
    first.interrupt();
    first.end().code(130);
    assert!(!bench.path().join("reports/latest").is_symlink());
    bench.run(&["run", "--virtual", QUICK]).code(0);
    assert!(bench.path().join("reports/latest/report.html").exists());
}

#[test]
fn papers_and_renderings_know_own_suites() {
    let bench = Bench::new();
    own_test(bench.path());
    bench.run(&["run", "--virtual", "--suites", "own", "acme/*"]).code(0);
    let report =
        |arguments: &[&str]| bench.run(&[&["report", "reports/latest", "--suites", "own"], arguments].concat());
    report(&["--as", "junit"]).code(0).prints("acme/mine");
    report(&["--as", "sarif"]).code(0);
    report(&["--attestation"]).code(0).prints("in-toto");
    bench
        .run(&["report", "reports/latest", "--as", "junit"])
        .code(2)
        .says("acme/mine");
}

#[test]
fn what_goes_wrong_before_a_run_is_an_annotation_with_file_and_line() {
    let bench = Bench::new();
    let on_github = |arguments: &[&str]| -> Ended {
        let mut command = tool(bench.path(), arguments);
        let summary = bench.path().join("summary.md");
        Running::start(
            command
                .env("GITHUB_ACTIONS", "true")
                .env("GITHUB_STEP_SUMMARY", summary),
        )
        .end()
    };
    fs::write(bench.path().join("device.toml"), "[device]\nmanufacterer = \"ACME\"\n").unwrap();
    on_github(&["run", "--profile", "device.toml"])
        .code(2)
        .says("::error file=device.toml,line=2,title=vda5050-tck::");
    let profile = Profile {
        device: "command = [\"no-such-program\"]".to_owned(),
        ..Profile::default()
    };
    let text = profile.text();
    let line = text.lines().position(|line| line.starts_with("command")).unwrap() + 1;
    fs::write(bench.path().join("device.toml"), text).unwrap();
    on_github(&["run", "--profile", "device.toml", QUICK])
        .code(2)
        .says(&format!("::error file=device.toml,line={line},title=vda5050-tck::"));
    on_github(&["run", "--nonsense"])
        .code(2)
        .says("::error title=vda5050-tck::");
    let page = fs::read_to_string(bench.path().join("summary.md")).unwrap();
    assert!(
        page.matches("## NO RESULT").count() == 3 && page.contains("no-such-program"),
        "{page}"
    );
}
