//! What was asked for and not done is said, and is no pass.

use std::fs;
use std::path::Path;

use crate::bench::{Bench, Profile, QUICK, REFUSAL, bundles};
use crate::tool::{Running, tool};

/// A test that wants a way of four nodes, and ends on another one than it began on.
const DRIVES: &str = "order-rejection/lower-update-id";

#[test]
fn a_folder_of_suites_that_holds_none_is_2_and_others_are_counted() {
    let bench = Bench::new();
    let own = bench.path().join("own");
    fs::create_dir_all(own.join("states")).unwrap();
    let run = || bench.run(&["run", "--virtual", "--suites", "own", QUICK]);
    run().code(2).says("own holds no test, monitor or stimulus");
    fs::write(own.join("README.md"), "Soon.").unwrap();
    fs::write(own.join("states/mine.yaml"), "state: mine\n").unwrap();
    run().code(2).says("own holds no test, monitor or stimulus");
    let mut by_variable = tool(bench.path(), &["run", "--virtual", QUICK]);
    Running::start(by_variable.env("VDA5050_TCK_SUITES", "own"))
        .end()
        .code(2)
        .says("no-suites");
    assert!(!bench.path().join("reports").exists());
    fs::remove_dir_all(&own).unwrap();
    own_test(bench.path());
    run().code(0).says("own suites: 1 test");
}

/// A test of a company of its own.
pub fn own_test(folder: &Path) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("suites/agv/instant-actions/factsheet-request.yaml");
    let text = fs::read_to_string(file).unwrap();
    let text = text.replace("test: instant-actions/factsheet-request", "test: acme/mine");
    fs::create_dir_all(folder.join("own/agv/acme")).unwrap();
    fs::write(folder.join("own/agv/acme/mine.yaml"), text).unwrap();
}

#[test]
fn a_repetition_that_was_not_done_leaves_the_test_undecided() {
    let bench = Bench::new();
    let profile = Profile {
        motion: true,
        one_way: true,
        ..Profile::default()
    };
    let (run, port) = bench.start(&profile, &[DRIVES, "--repeat", "3"]);
    let _agv = bench.agv(port, &[]);
    let ended = run.end();
    let result = bench.result();
    let repetitions = result["tests"][0]["repetitions"].as_array().unwrap();
    assert_eq!(repetitions.len(), 3, "{result}");
    let done = repetitions.iter().filter(|one| !one["journal"].is_null()).count();
    assert!(
        done < 3,
        "the floor is long enough for all of them: this test needs a shorter one"
    );
    ended.code(3).prints(&format!("run {done} of 3 times"));
    assert_eq!(result["tests"][0]["verdict"], "inconclusive");
    let junit = fs::read_to_string(bench.bundle().join("junit.xml")).unwrap();
    assert!(
        junit.contains(&format!("run {done} of 3 times")) && junit.contains("<error"),
        "{junit}"
    );
    bench.is_whole();
}

/// A run in virtual time that leaves its report in a folder of this name.
fn reported(bench: &Bench, name: &str, arguments: &[&str], code: i32) {
    let all = [&["run", "--virtual", "--out", "all", "--quiet"], arguments].concat();
    bench.run(&all).code(code);
    let folder = bundles(&bench.path().join("all")).remove(0);
    fs::rename(folder, bench.path().join(name)).unwrap();
}

#[test]
fn a_run_that_decides_less_never_compares_as_green() {
    let bench = Bench::new();
    let compare = |before: &str, after: &str| bench.run(&["report", "--compare", before, after]);
    reported(&bench, "two", &[QUICK, REFUSAL], 0);
    reported(&bench, "one", &[QUICK], 0);
    compare("two", "two").code(0).prints("no verdict changed");
    compare("two", "one")
        .code(1)
        .prints("  lost    pass -> absent")
        .prints("order-rejection/unreadable[…]");
    compare("one", "two").code(0).prints("  other   absent -> pass");
    // What could not be tried is lost, and a failure that could not be tried is not mended.
    reported(&bench, "good", &[DRIVES, QUICK], 0);
    reported(
        &bench,
        "bad",
        &[DRIVES, QUICK, "--fault", "outdated-update-taken-over"],
        1,
    );
    reported(&bench, "still", &[DRIVES, QUICK, "--no-motion"], 3);
    compare("good", "bad").code(1).prints("  worse   pass -> fail");
    compare("good", "still")
        .code(1)
        .prints("  lost    pass -> inconclusive");
    compare("bad", "still").prints("  unclear fail -> inconclusive");
    compare("still", "still").code(3).says("partial or undecided");
    compare("bad", "good").code(0).prints("  better  fail -> pass");
    // What was mended in between does not count, and what was not mended does.
    bench.run(&["report", "--compare", "good", "bad", "good"]).code(0);
    bench.run(&["report", "--compare", "good", "bad", "bad"]).code(1);
    let json = bench
        .run(&["report", "--compare", "good", "bad", "--format", "json"])
        .code(1)
        .stdout;
    assert!(json.contains(r#""trend": "worse""#), "{json}");
    // Part of a run.
    let journal = fs::read_to_string(bench.path().join("two/journal.jsonl")).unwrap();
    let end = journal.trim_end().rfind('\n').unwrap() + 1;
    fs::create_dir(bench.path().join("cut")).unwrap();
    fs::write(bench.path().join("cut/journal.jsonl"), &journal[..end]).unwrap();
    bench.run(&["report", "cut"]).code(3);
    compare("two", "cut").code(3).prints("the second run is partial");
    compare("cut", "two").code(3).prints("the first run is partial");
}

#[test]
fn which_cases_were_drawn_makes_no_run_better_or_worse() {
    let bench = Bench::new();
    for seed in ["1", "2"] {
        reported(
            &bench,
            seed,
            &[
                "order-rejection/malformed",
                "order-rejection/unreadable",
                "--seed",
                seed,
            ],
            0,
        );
    }
    let ended = bench.run(&["report", "--compare", "1", "2"]).code(0);
    assert!(!ended.stdout.contains("absent"), "{}", ended.stdout);
}

#[test]
fn junit_is_red_when_no_selected_test_was_decided_however_the_undecided_are_shown() {
    let bench = Bench::new();
    let skip = ["--inconclusive", "skip"];
    let run = [&["run", "--virtual", "--no-motion", DRIVES], &skip[..]].concat();
    bench.run(&run).code(3);
    let bundle = bench.bundle();
    for name in ["junit.xml", "junit-requirements.xml"] {
        let junit = fs::read_to_string(bundle.join(name)).unwrap();
        let red = junit.contains("the selected test was not decided") && junit.contains("errors=\"1\"");
        assert!(red, "{name}: {junit}");
    }
}

#[test]
fn part_of_the_tests_says_which_part() {
    let bench = Bench::new();
    bench
        .run(&["run", "--virtual", QUICK, REFUSAL, "--shard", "1/2"])
        .code(0);
    let limits = bench.result()["limits"].to_string();
    assert!(limits.contains("Only part 1 of 2 of the tests was run"), "{limits}");
}

#[test]
fn the_built_in_device_is_named_in_the_first_line_and_has_to_be_asked_for_where_another_one_may_be_meant() {
    let bench = Bench::new();
    let first_line = |stderr: &str| stderr.lines().next().unwrap_or_default().to_owned();
    let named = "testing the built-in reference AGV, and no device of yours";
    let run = bench.run(&["run", "--virtual", QUICK, "--quiet"]).code(0);
    assert!(first_line(&run.stderr).starts_with(named), "{}", run.stderr);
    let master_control = ["run", "--virtual", "--role", "master-control", "--no-such-test"];
    bench
        .run(&master_control[..4])
        .code(0)
        .says("built-in reference master control");
    let in_pipeline = |value: &str, arguments: &[&str]| {
        let mut command = tool(bench.path(), &[&["run", QUICK], arguments].concat());
        Running::start(command.env("CI", value)).end()
    };
    in_pipeline("true", &[]).code(2).says("`CI` is set").says("--reference");
    in_pipeline("1", &["--plan"]).code(2).says("--reference");
    in_pipeline("false", &["--plan"]).code(0).says(named);
    in_pipeline("true", &["--reference"]).code(0).says(named);
    in_pipeline("true", &["--virtual"]).code(0);
    let profile = Profile::default().text();
    fs::write(bench.path().join("device.toml"), profile).unwrap();
    bench.run(&["run", QUICK]).code(2).says("a device.toml is beside it");
    bench.run(&["run", QUICK, "--reference", "--plan"]).code(0);
    bench
        .run(&["run", QUICK, "--reference", "--serial", "7", "--manufacturer", "ACME"])
        .code(2)
        .says("another device is tested here");
    bench.run(&["run", QUICK, "--profile", "device.toml", "--plan"]).code(0);
}

/// Leaves of the only run there was what it had before its last test, as when the power was cut then.
fn cut_off(bench: &Bench) {
    let journal = bench.journal();
    let last = journal.match_indices("\"kind\":\"test-begun\"").last().unwrap().0;
    let end = journal[..last].rfind('\n').unwrap() + 1;
    fs::create_dir(bench.path().join("before")).unwrap();
    fs::write(bench.path().join("before/journal.jsonl"), &journal[..end]).unwrap();
    fs::remove_dir_all(bench.path().join("reports")).unwrap();
}

#[test]
fn a_run_that_is_gone_on_with_is_about_the_same_profile_firmware_program_and_files() {
    let bench = Bench::new();
    let tool = env!("CARGO_BIN_EXE_vda5050-tck");
    let vehicle = format!("exec '{tool}' simulate agv --broker mqtt://$1 --manufacturer $2 --serial $3\n");
    fs::write(bench.path().join("vehicle.sh"), &vehicle).unwrap();
    let with = |more: &str, firmware: &str| Profile {
        device: format!(
            "command = [\"sh\", \"vehicle.sh\", \"{{broker-host}}:{{broker-port}}\", \"{{manufacturer}}\", \
             \"{{serial-number}}\"]\n{more}"
        ),
        more: format!("[certificate]\nfirmware-version = \"{firmware}\"\n"),
        ..Profile::default()
    };
    let profile = with("", "4.2");
    let (run, _) = bench.start(&profile, &[QUICK, REFUSAL, "--no-motion"]);
    run.end();
    cut_off(&bench);
    let resume = |profile: &Profile, more: &[&str]| {
        fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
        let arguments = ["run", "--profile", "device.toml", "--no-motion", "--resume", "before"];
        bench.run(&[&arguments[..], more].concat())
    };
    resume(&with("", "4.3"), &[])
        .code(2)
        .says("the setting certificate.firmware-version was `4.2`, and is `4.3` now");
    resume(&with("node-bound = true", "4.2"), &[])
        .code(2)
        .says("device.node-bound");
    resume(&profile.with(&[("quiet", "300 ms")]), &[])
        .code(2)
        .says("the setting time.quiet was");
    let hook = "[hooks.power-cycle]\nrun = [\"true\"]\n";
    let mut other = with("", "4.2");
    other.more += hook;
    resume(&other, &[]).code(2).says("hooks.power-cycle");
    let mut commented = with("", "4.2");
    commented.more += "# another floor\n";
    resume(&commented, &[])
        .code(2)
        .says("the profile device.toml is not the file that it was");
    fs::write(bench.path().join("vehicle.sh"), format!("# newer\n{vehicle}")).unwrap();
    resume(&with("", "4.2"), &[])
        .code(2)
        .says("the program vehicle.sh is not the file that it was");
    assert!(
        bundles(&bench.path().join("reports")).is_empty(),
        "a refusal leaves a bundle"
    );
}

#[test]
fn a_run_is_not_gone_on_with_against_a_built_in_device_with_other_faults() {
    let bench = Bench::new();
    bench.run(&["run", "--virtual", QUICK, REFUSAL]).code(0);
    cut_off(&bench);
    let resume = ["run", "--virtual", "--resume", "before"];
    bench
        .run(&[&resume[..], &["--fault", "validation-error-fatal"]].concat())
        .code(2)
        .says("the setting built-in.fault was not set, and is `validation-error-fatal` now");
    bench.run(&resume).code(0).prints("Joined from 2 runs");
}

#[test]
fn a_run_is_not_gone_on_with_when_the_factsheet_is_another_one() {
    let bench = Bench::new();
    let profile = Profile::default();
    let (run, port) = bench.start(&profile, &[QUICK, REFUSAL]);
    let agv = bench.agv(port, &[]);
    run.end().code(0);
    drop(agv);
    cut_off(&bench);
    let (run, port) = bench.start(&profile, &["--resume", "before"]);
    let _other = bench.agv_with(port, &["--vehicle", "free"]);
    run.end()
        .code(2)
        .says("the run cannot be resumed: `")
        .says("of the factsheet was");
    let result = bench.result();
    assert_eq!(result["partial"], true);
    assert_ne!(result["verdict"], "pass");
}
