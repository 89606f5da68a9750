//! What is made of a bundle for others: one package, and what the tools of others read.

use std::fs;
use std::process::Command;

use serde_json::Value;

use crate::bench::{Bench, REFUSAL, bundles};
use crate::papers::certified;

/// What Python's reader of zips finds in a package, taken out into a folder.
fn unpacked(bench: &Bench, package: &str, folder: &str) -> Vec<String> {
    let python = |arguments: &[&str]| {
        let mut command = Command::new("python3");
        command
            .args(["-m", "zipfile"])
            .args(arguments)
            .current_dir(bench.path());
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    python(&["-e", package, folder]);
    let listed = python(&["-l", package]);
    let names = listed.lines().skip(1).filter_map(|line| line.split_whitespace().next());
    names.map(str::to_owned).collect()
}

#[test]
fn a_package_holds_bundle_and_papers_and_is_verified_where_it_is_unpacked() {
    let bench = Bench::new();
    certified(&bench.path().join("run"));
    let said = bench.run(&["report", "--package", "out/run.zip", "run"]).code(0).stdout;
    // The papers of this run say who tested, and not where.
    assert!(
        said.starts_with("a laboratory would refuse:\n") && said.contains("not stated: where the test"),
        "{said}"
    );
    let root = said.lines().find_map(|line| line.strip_prefix("root    ")).unwrap();
    let names = unpacked(&bench, "out/run.zip", "there");
    let papers: Vec<&str> = names
        .iter()
        .map(String::as_str)
        .filter(|name| !name.starts_with("bundle/"))
        .collect();
    assert_eq!(
        papers,
        [
            "README.txt",
            "attestation.json",
            "certificate.html",
            "cyclonedx.json",
            "declared.json",
            "settings.json",
            "svr.json"
        ]
    );
    let read_me = fs::read_to_string(bench.path().join("there/README.txt")).unwrap();
    assert!(
        read_me.contains(root) && read_me.contains("not stated: where the test"),
        "{read_me}"
    );
    bench
        .run(&["report", "--verify", "--root", root, "there/bundle"])
        .code(0)
        .prints("intact");
    bench
        .run(&["report", "--rejudge", "there/bundle"])
        .code(0)
        .prints("byte for byte");
    // The line without the tool, as it stands there.
    let line = read_me
        .lines()
        .map(str::trim)
        .find(|line| line.contains("sha256sum | sha256sum"))
        .unwrap();
    if Command::new("jq").arg("--version").output().is_ok() {
        let there = bench.path().join("there");
        let output = Command::new("sh")
            .args(["-c", line])
            .current_dir(there)
            .output()
            .unwrap();
        let sum = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(sum.split_whitespace().next(), root.strip_prefix("sha256:"));
    }
    let again = bench
        .run(&["report", "--package", "again.zip", "run", "--format", "json"])
        .code(0)
        .stdout;
    let again: Value = serde_json::from_str(&again).unwrap();
    assert_eq!(
        (&again["root"], again["papers"].as_array().unwrap().len()),
        (&Value::from(root), 7)
    );
    let bytes = |name: &str| fs::read(bench.path().join(name)).unwrap();
    assert!(
        bytes("out/run.zip") == bytes("again.zip"),
        "the same bundle, the same bytes"
    );
}

#[test]
fn of_a_run_that_certifies_nothing_the_package_says_why_and_none_lies_in_its_bundle() {
    let bench = Bench::new();
    let fault = [
        "run",
        "--virtual",
        "order-rejection/unreadable",
        "--fault",
        "validation-error-misspelled",
    ];
    bench.run(&fault).code(1);
    let folder = bench.bundle().display().to_string();
    let said = bench.run(&["report", "--package", "run.zip", &folder]).code(0).stdout;
    for why in [
        "not made by `certify`",
        "does not conform",
        "were not decided",
        "not stated: the person",
    ] {
        assert!(said.contains(why), "{why}: {said}");
    }
    assert!(
        !unpacked(&bench, "run.zip", "there")
            .iter()
            .any(|name| name == "certificate.html")
    );
    let inside = format!("{folder}/run.zip");
    bench
        .run(&["report", "--package", &inside, &folder])
        .code(2)
        .says("lie in the bundle");
    for kind in ["junit", "allure"] {
        let inside = format!("{kind}={folder}/more");
        bench
            .run(&["report", &folder, "--as", "markdown=out.md", "--as", &inside])
            .code(2)
            .says("lie in the bundle")
            .says("name a place outside");
        let outside = fs::read_to_string(bench.path().join("out.md")).unwrap();
        assert!(outside.contains("lie in the bundle"), "{outside}");
    }
    bench
        .run(&["run", "--virtual", "order-rejection/unreadable", "--out", &folder])
        .code(2)
        .says("lie in the bundle");
    bench.run(&["report", "--verify", &folder]).code(0);
    fs::create_dir(bench.path().join("folder.zip")).unwrap();
    bench
        .run(&["report", "--package", "folder.zip", &folder])
        .code(2)
        .says("no regular file");
    let result = bench.bundle().join("result.json");
    let text = fs::read_to_string(&result).unwrap();
    fs::write(&result, text.replacen("reference-agv", "another", 1)).unwrap();
    bench
        .run(&["report", "--package", "late.zip", &folder])
        .code(2)
        .says("is not what its manifest says");
    assert!(!bench.path().join("late.zip").exists());
}

#[test]
fn keys_of_the_profile_and_of_a_file_go_into_junit_and_allure_leaves_no_earlier_run() {
    let bench = Bench::new();
    fs::create_dir(bench.path().join("results")).unwrap();
    fs::write(bench.path().join("results/other-result.json"), "{}").unwrap();
    let table = REFUSAL.split('[').next().unwrap();
    fs::write(
        bench.path().join("keys.toml"),
        format!("\"{table}\" = \"PROJ-7\"\nORD-REJ-02 = \"PROJ-1\"\n"),
    )
    .unwrap();
    let mut arguments = vec![
        "run",
        "--virtual",
        REFUSAL,
        "--quiet",
        "--as",
        "allure=results",
        "--as",
        "ctrf=out/ctrf.json",
    ];
    bench.run(&arguments).code(0);
    let count = || fs::read_dir(bench.path().join("results")).unwrap().count();
    let first = count();
    arguments[2] = "order-rejection/unreadable";
    bench.run(&arguments).code(0);
    assert_eq!(count(), first + 2, "of the earlier run nothing is left");
    let ctrf: Value = serde_json::from_str(&fs::read_to_string(bench.path().join("out/ctrf.json")).unwrap()).unwrap();
    assert_eq!(ctrf["results"]["summary"]["failed"], 0);
    assert_eq!(ctrf["reportFormat"], "CTRF");
    // A call that comes to nothing leaves one result, which is broken, and no statement.
    let nothing = [
        "run",
        "--virtual",
        "no/such",
        "--as",
        "allure=results",
        "--as",
        "svr=svr.json",
    ];
    bench.run(&nothing).code(2);
    assert_eq!(count(), 2, "one result, and the file of somebody else");
    let svr = fs::read_to_string(bench.path().join("svr.json")).unwrap();
    assert!(svr.contains("noResult") && !svr.contains("predicate"), "{svr}");
    let runs = bundles(&bench.path().join("reports"));
    let folder = runs[0].display().to_string();
    let keyed = ["report", &folder, "--as", "junit-properties", "--keys", "keys.toml"];
    let xml = bench.run(&keyed).code(0).stdout;
    assert!(xml.contains("<property name=\"test_key\" value=\"PROJ-7\"/>"), "{xml}");
    assert!(
        xml.contains("<property name=\"requirements\" value=\"PROJ-1\"/>"),
        "{xml}"
    );
    fs::write(bench.path().join("keys.toml"), "ORD-REJ-01 = \"proj-1\"\n").unwrap();
    bench.run(&keyed).code(2).says("is no key");
    let cyclonedx = bench.run(&["report", &folder, "--as", "cyclonedx"]).code(0).stdout;
    let cyclonedx: Value = serde_json::from_str(&cyclonedx).unwrap();
    assert_eq!(cyclonedx["bomFormat"], "CycloneDX");
    bench
        .run(&["report", &folder, "--as", "allure"])
        .code(2)
        .says("allure=FOLDER");
}

#[test]
fn the_interface_of_a_version_is_listed_for_either_side() {
    let bench = Bench::new();
    for (side, action) in [("agv", "receive"), ("master-control", "send")] {
        let text = bench
            .run(&["list", "asyncapi", "--protocol", "2.0.0", "--role", side])
            .code(0)
            .stdout;
        let document: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(
            document["channels"]["order"]["address"],
            "uagv/v2/{manufacturer}/{serialNumber}/order"
        );
        let operation = format!("{action}Order");
        assert_eq!(document["operations"][&operation]["action"], action);
    }
}
