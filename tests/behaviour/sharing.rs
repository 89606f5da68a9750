//! Parts of a run, an audit, a qualification and an exploration, and what is joined from them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::bench::{Bench, QUICK, REFUSAL, bundles};
use crate::tool::{Ended, Running, tool};

/// A small selection of tests: single ones, and a table that is drawn from.
const SOME: [&str; 4] = [
    "order-rejection/lower*",
    "order-acceptance",
    "instant-actions/factsheet-request",
    "order-rejection/unreadable",
];

/// A file of JSON.
pub fn read(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))).unwrap()
}

fn list<'v>(value: &'v Value, member: &str) -> &'v [Value] {
    value[member].as_array().map(Vec::as_slice).unwrap_or_default()
}

fn word(value: &Value, member: &str) -> String {
    value[member].as_str().unwrap_or("none").to_owned()
}

/// A run in virtual time of some tests, with a fault that breaks some of them.
fn run(bench: &Bench, tests: &[&str], more: &[&str]) -> Ended {
    let fixed = [
        "run",
        "--virtual",
        "--seed",
        "7",
        "--quiet",
        "--fault",
        "outdated-update-taken-over",
    ];
    bench.run(&[&fixed[..], more, tests].concat())
}

/// What a result says, without what differs from run to run: times, the numbers of records, and what a monitor saw kept. That
/// depends on how a vehicle came from one test to the next.
pub fn said(result: &Value) -> [BTreeMap<String, String>; 4] {
    let tests = list(result, "tests").iter().map(|test| {
        let decisions: BTreeSet<String> = list(test, "decisions")
            .iter()
            .map(|one| {
                format!(
                    "{} {} {}",
                    word(one, "requirement"),
                    word(one, "clause"),
                    word(one, "verdict")
                )
            })
            .collect();
        (
            word(test, "id"),
            format!(
                "{} {} {decisions:?}",
                word(test, "verdict"),
                word(test, "not_applicable")
            ),
        )
    });
    let ids: BTreeSet<String> = list(result, "tests").iter().map(|test| word(test, "id")).collect();
    let requirements = list(result, "requirements").iter().filter_map(|one| {
        let all = list(one, "decided_by").iter().filter_map(Value::as_str);
        let by: BTreeSet<&str> = all.filter(|by| ids.contains(*by)).collect();
        let (verdict, why) = (word(one, "verdict"), word(one, "not_decided"));
        (verdict == "fail" || !by.is_empty()).then(|| (word(one, "id"), format!("{verdict} {why} {by:?}")))
    });
    let monitors = list(result, "monitors").iter();
    let monitors = monitors.map(|one| (word(one, "id"), word(one, "verdict")));
    let monitors = monitors.filter(|(_, verdict)| ["fail", "warning"].contains(&verdict.as_str()));
    let verdict = ("verdict".to_owned(), word(result, "verdict"));
    [
        [verdict].into(),
        tests.collect(),
        requirements.collect(),
        monitors.collect(),
    ]
}

#[test]
fn one_to_sixteen_parts_of_a_run_are_the_run() {
    let bench = Bench::new();
    run(&bench, &SOME, &["--out", "unsplit"]).code(1);
    let unsplit = read(&bundles(&bench.path().join("unsplit"))[0].join("result.json"));
    // Every number between is tried without processes, in `tests/joining.rs`.
    for of in [1, 2, 16] {
        let out = format!("parts-{of}");
        for index in 1..=of {
            let shard = format!("{index}/{of}");
            let ended = run(&bench, &SOME, &["--out", &out, "--shard", &shard]);
            let code = ended.status.code();
            assert!(matches!(code, Some(0 | 1 | 3 | 4)), "{shard}: {ended:?}");
            let first = ended.stderr.lines().next().unwrap_or_default();
            assert_eq!(
                first == format!("part {index} of {of} is done here (--shard)"),
                of > 1,
                "{first}"
            );
        }
        if of == 1 {
            let whole = read(&bundles(&bench.path().join(&out))[0].join("result.json"));
            assert!(whole.get("shard").is_none() && said(&whole) == said(&unsplit));
            continue;
        }
        let whole = format!("whole-{of}");
        bench.run(&["report", "--merge", &out, "--out", &whole]).code(1);
        let joined = read(&bench.path().join(&whole).join("result.json"));
        assert_eq!(joined["merged"].get("troubles"), None, "{of}");
        assert_eq!(said(&joined), said(&unsplit), "{of} parts");
    }
}

#[test]
fn what_was_joined_is_verified_judged_again_and_shown_as_one_run() {
    let bench = Bench::new();
    for shard in ["1/2", "2/2"] {
        run(&bench, &SOME, &["--out", "parts", "--shard", shard]);
    }
    let merged = bench.run(&["report", "--merge", "parts", "--out", "whole"]).code(1);
    assert!(merged.stdout.contains("Joined from 2 parts."), "{}", merged.stdout);
    let whole = bench.path().join("whole");
    let junit = fs::read_to_string(whole.join("junit.xml")).unwrap();
    assert!(
        junit.contains("name=\"parts\" value=\"2 of 2\"") && !junit.contains("<error"),
        "{junit}"
    );
    let page = fs::read_to_string(whole.join("report.html")).unwrap();
    assert!(page.contains("id=\"parts\"") && page.contains("in parts 1, 2"));
    let verified = bench.run(&["report", "--verify", "whole"]).code(0);
    assert!(verified.stdout.matches("as it was").count() == 2, "{}", verified.stdout);
    bench
        .run(&["report", "--rejudge", "whole"])
        .code(0)
        .prints("byte for byte");
    bench
        .run(&["report", "--as", "junit", "whole"])
        .code(0)
        .prints("<testsuite");
    bench.run(&["report", "whole"]).code(1);
    bench.run(&["report", "--verify", "whole"]).code(0);
    // What was joined before is joined again, alone or with its own parts, to the same.
    let again = bench
        .run(&["report", "--merge", "whole", "parts", "--out", "again"])
        .code(1);
    assert!(again.stderr.is_empty(), "{}", again.stderr);
    assert_eq!(
        fs::read(whole.join("result.json")).unwrap(),
        fs::read(bench.path().join("again/result.json")).unwrap()
    );
    // Nothing is written over.
    bench
        .run(&["report", "--merge", "parts", "--out", "whole"])
        .code(2)
        .says("there already");
    let part = bundles(&bench.path().join("parts"))[0].clone();
    let journals = ["journal.jsonl", "journal.jsonl.gz"].map(|name| part.join(name));
    let journal = journals.iter().find(|path| path.is_file()).unwrap().clone();
    fs::rename(&journal, part.join("elsewhere")).unwrap();
    bench.run(&["report", "--rejudge", "whole"]).code(3).prints("is not at");
    fs::write(&journal, "{}\n").unwrap();
    bench
        .run(&["report", "--rejudge", "whole"])
        .code(1)
        .prints("was changed");
    bench
        .run(&["report", "--verify", "whole"])
        .code(1)
        .prints("changed since it was judged");
    bench
        .run(&["report", "--merge", "parts", "--out", "third"])
        .code(2)
        .says("not what its manifest says");
}

#[test]
fn what_is_missing_or_of_something_else_is_named_and_is_never_a_pass() {
    let bench = Bench::new();
    let part = |shard: &str, out: &str, seed: &str, tests: &[&str]| {
        let fixed = [
            "run",
            "--virtual",
            "--quiet",
            "--seed",
            seed,
            "--out",
            out,
            "--shard",
            shard,
        ];
        bench.run(&[&fixed[..], tests].concat()).code(0)
    };
    let two = [QUICK, REFUSAL];
    part("1/2", "one", "7", &two);
    part("2/2", "two", "7", &two);
    part("2/2", "twice", "8", &two);
    part("2/2", "foreign", "7", &[QUICK, "order-acceptance"]);
    let merge = |parts: &[&str], out: &str| bench.run(&[&["report", "--merge"], parts, &["--out", out]].concat());
    merge(&["one", "two"], "whole").code(0);
    // Of two that do not belong together, both are named.
    merge(&["one", "foreign"], "pair").code(3);
    let pair = read(&bench.path().join("pair/result.json"));
    let limits = pair["limits"].as_array().unwrap().iter().filter_map(Value::as_str);
    let mut limits = limits;
    let foreign = limits.find(|text| text.contains("is no part of this")).unwrap();
    assert!(foreign.contains("/one/") && foreign.contains("/foreign/"), "{foreign}");
    for (parts, out, why) in [
        (&["one"][..], "a", "part 2 of 2 is missing"),
        (&["one", "two", "twice"], "b", "part 2 of 2 is there 2 times"),
        (&["one", "two", "foreign"], "c", "is no part of this: its selection"),
    ] {
        let ended = merge(parts, out).code(3);
        assert!(ended.stdout.contains(why), "{}", ended.stdout);
        let junit = fs::read_to_string(bench.path().join(out).join("junit.xml")).unwrap();
        assert!(junit.contains("<error") && junit.contains(why), "{junit}");
        let page = fs::read_to_string(bench.path().join(out).join("report.html")).unwrap();
        assert!(page.contains("What was joined is not the whole") && page.contains(why));
        let limits = read(&bench.path().join(out).join("result.json"))["limits"].to_string();
        assert!(limits.contains(&why[1..]), "{limits}");
    }
    // A run that was killed has no manifest, and its journal breaks off.
    let killed = bench.path().join("killed");
    fs::create_dir(&killed).unwrap();
    let journal = fs::read_to_string(bundles(&bench.path().join("two"))[0].join("journal.jsonl")).unwrap();
    let lines: Vec<&str> = journal.lines().collect();
    fs::write(killed.join("journal.jsonl"), lines[..lines.len() - 3].join("\n") + "\n").unwrap();
    merge(&["one", "killed"], "d")
        .code(3)
        .prints("part 2 of 2 ended before its plan did");
    bench
        .run(&["run", "--virtual", "--quiet", "--out", "all", QUICK])
        .code(0);
    merge(&["all"], "e").code(2).says("made without --shard");
    merge(&["nowhere"], "f").code(2);
}

#[test]
fn a_part_is_not_compared_with_the_whole_and_has_no_certificate() {
    let bench = Bench::new();
    bench
        .run(&["run", "--virtual", "--quiet", "--out", "all", QUICK, REFUSAL])
        .code(0);
    for (shard, out) in [("1/2", "one"), ("2/2", "two"), ("1/2", "again")] {
        bench
            .run(&[
                "run",
                "--virtual",
                "--quiet",
                "--out",
                out,
                "--shard",
                shard,
                QUICK,
                REFUSAL,
            ])
            .code(0);
    }
    let compare = |one: &str, other: &str| {
        let (one, other) = (format!("{one}/latest"), format!("{other}/latest"));
        bench.run(&["report", "--compare", &one, &other])
    };
    compare("one", "all")
        .code(2)
        .says("one is part 1 of 2, and the other all of a run");
    compare("one", "two").code(2).says("cannot be compared");
    compare("one", "again").code(0);
    let result = read(&bench.path().join("one/latest/result.json"));
    assert_eq!(
        (
            &result["shard"]["index"],
            &result["shard"]["of"],
            &result["shard"]["origin"]
        ),
        (&1.into(), &2.into(), &"--shard".into())
    );
    let junit = fs::read_to_string(bench.path().join("one/latest/junit.xml")).unwrap();
    assert!(junit.contains("name=\"shard\" value=\"1/2\""), "{junit}");
    let page = fs::read_to_string(bench.path().join("one/latest/report.html")).unwrap();
    assert!(page.contains("Part 1 of 2 of a run.") && page.contains("1 of 2 (--shard)"));
    bench.run(&["report", "--certificate", "one/latest"]).code(2);
}

#[test]
fn a_scheduler_says_which_part_and_the_first_line_says_so() {
    let bench = Bench::new();
    let with = |variables: &[(&str, &str)], more: &[&str]| {
        let arguments = [&["run", "--virtual", "--quiet", QUICK, REFUSAL], more].concat();
        let mut command = tool(bench.path(), &arguments);
        command.envs(variables.iter().copied());
        Running::start(&mut command).end()
    };
    let of_gitlab = [("CI_NODE_INDEX", "2"), ("CI_NODE_TOTAL", "2")];
    let ended = with(&of_gitlab, &["--out", "part"]).code(0);
    let first = ended.stderr.lines().next().unwrap_or_default().to_owned();
    let expected =
        "part 2 of 2 is done here (GitLab, parallel: CI_NODE_INDEX=2, CI_NODE_TOTAL=2); `--shard 1/1` does all of it";
    assert_eq!(first, expected);
    let result = read(&bench.path().join("part/latest/result.json"));
    assert!(result["shard"]["origin"].as_str().unwrap().starts_with("GitLab") && list(&result, "tests").len() == 1);
    let limits = result["limits"].to_string();
    assert!(
        limits.contains("Only part 2 of 2 of the tests was run (GitLab"),
        "{limits}"
    );
    let all = with(&of_gitlab, &["--shard", "1/1", "--out", "all"]).code(0);
    assert!(!all.stderr.contains("is done here"), "{}", all.stderr);
    let result = read(&bench.path().join("all/latest/result.json"));
    assert!(result.get("shard").is_none() && list(&result, "tests").len() == 2);
    with(&[("JOB_COMPLETION_INDEX", "0")], &[])
        .code(2)
        .says("VDA5050_TCK_SHARDS does not say of how many");
    with(
        &[("JOB_COMPLETION_INDEX", "0"), ("VDA5050_TCK_SHARDS", "2")],
        &["--out", "indexed"],
    )
    .code(0)
    .says("part 1 of 2 is done here (Kubernetes, Indexed Job");
}

#[test]
fn parts_of_an_audit_and_of_a_qualification_are_joined() {
    let bench = Bench::new();
    let capture = format!("{}/fixtures/captures/two-versions.jsonl", env!("CARGO_MANIFEST_DIR"));
    bench.run(&["audit", &capture, "--out", "audits/unsplit"]).code(0);
    for shard in ["1/2", "2/2"] {
        let out = format!("audits/parts/{}", &shard[..1]);
        let ended = bench.run(&["audit", &capture, "--out", &out, "--shard", shard]);
        assert!(matches!(ended.status.code(), Some(0 | 4)), "{ended:?}");
        assert!(
            ended
                .stdout
                .contains(&format!("Only part {} of 2 of the vehicles was judged", &shard[..1])),
            "{}",
            ended.stdout
        );
    }
    bench
        .run(&["report", "--merge", "audits/parts", "--out", "audits/whole"])
        .code(0);
    let mut joined = read(&bench.path().join("audits/whole/result.json"));
    joined.as_object_mut().unwrap().remove("merged");
    assert_eq!(joined, read(&bench.path().join("audits/unsplit/result.json")));
    bench.run(&["report", "--verify", "audits/whole"]).code(0);
    bench
        .run(&["report", "--compare", "audits/unsplit", "audits/whole"])
        .code(0);
    bench
        .run(&["report", "--compare", "audits/unsplit", "audits/parts/1"])
        .code(2)
        .says("cannot be compared");
    bench
        .run(&["report", "--merge", "audits/parts/1", "--out", "audits/open"])
        .code(3)
        .prints("not the whole: part 2 of 2 is missing");

    let fixed = [
        "qualify",
        "--role",
        "agv",
        "--protocol",
        "2.1.0",
        "order-rejection/lower-update-id",
    ];
    let faults = [
        "--fault",
        "outdated-update-taken-over",
        "--fault",
        "horizon-not-reported",
    ];
    let qualify = |more: &[&str]| bench.run(&[&fixed[..], &faults[..], more].concat());
    qualify(&["--out", "proof/unsplit"]).code(0);
    qualify(&["--out", "proof/parts/1", "--shard", "1/2"]).code(0);
    qualify(&["--out", "proof/parts/2", "--shard", "2/2"]).code(0);
    qualify(&["--shard", "3/3"])
        .code(4)
        .says("there is no fault for part 3 of 3");
    bench
        .run(&["report", "--merge", "proof/parts", "--out", "proof/whole"])
        .code(0);
    let mut joined = read(&bench.path().join("proof/whole/result.json"));
    joined.as_object_mut().unwrap().remove("merged");
    assert_eq!(joined, read(&bench.path().join("proof/unsplit/result.json")));
    bench
        .run(&["report", "--merge", "proof/parts/2", "--out", "proof/open"])
        .code(3)
        .prints("part 1 of 2 is missing");
    bench
        .run(&["report", "--merge", "proof/parts", "audits/parts", "--out", "mixed"])
        .code(2)
        .says("not of one kind");
}

#[test]
fn an_exploration_is_divided_and_joined_and_a_part_that_is_missing_is_named() {
    let bench = Bench::new();
    let part = |shard: &str, code: i32| {
        let fixed = [
            "explore",
            "--virtual",
            "--seed",
            "7",
            "--conversations",
            "4",
            "--focus",
            "outdated",
        ];
        let more = [
            "--shrink-budget",
            "4",
            "--fault",
            "outdated-update-taken-over",
            "--out",
            "parts",
            "--shard",
            shard,
        ];
        bench.run(&[&fixed[..], &more[..]].concat()).code(code)
    };
    part("1/2", 1).says("part 1 of 2 is done here");
    bench
        .run(&["report", "--merge", "parts", "--out", "half"])
        .code(1)
        .prints("not the whole: part 2 of 2 is missing");
    part("2/2", 1);
    part("5/5", 4);
    bench
        .run(&["report", "--merge", "parts", "--out", "whole"])
        .code(1)
        .prints("FAIL ORD-REJ-10");
    let whole = read(&bench.path().join("whole/result.json"));
    let parts = ["exploration-7-1-of-2", "exploration-7-2-of-2"];
    let parts = parts.map(|name| read(&bench.path().join("parts").join(name).join("result.json")));
    let sum = |member: &str| parts.iter().filter_map(|part| part[member].as_u64()).sum::<u64>();
    assert_eq!((whole["planned"].as_u64(), sum("planned")), (Some(4), 4));
    for member in ["conversations", "stimuli", "undecided"] {
        assert_eq!(whole[member].as_u64(), Some(sum(member)), "{member}");
    }
    assert!(list(&whole["merged"], "troubles").is_empty(), "{}", whole["merged"]);
    let found = list(&whole, "findings");
    assert!(
        found.iter().any(|one| word(one, "requirement") == "ORD-REJ-10"),
        "{whole}"
    );
    let test = bench.path().join("whole/tests/ord-rej-10.yaml");
    assert!(fs::read_to_string(test).unwrap().starts_with("test: explore/"));
    bench
        .run(&["report", "--merge", "half", "parts", "--out", "again"])
        .code(1);
    let again = read(&bench.path().join("again/result.json"));
    assert_eq!(again["findings"], whole["findings"]);
    bench.run(&["report", "--verify", "whole"]).code(0);
}
