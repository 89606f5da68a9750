//! Every exit code, and what leads to it. 130 is in `interrupted`, more of 5 in `broken`.

use std::fs;
use std::net::TcpListener;
use std::path::Path;

use crate::bench::{Bench, Profile, QUICK, REFUSAL};
use crate::mosquitto::free_port;
use crate::tool::{Running, run, tool};

#[test]
fn a_device_that_conforms_is_0_over_tcp_and_leaves_a_whole_bundle() {
    let bench = Bench::new();
    bench.run(&["run", REFUSAL, QUICK]).code(0).prints("PASS  ");
    assert_eq!(bench.result()["verdict"], "pass");
    assert_eq!(bench.result()["partial"], false);
    bench.is_whole();
}

#[test]
fn a_device_that_is_not_the_one_of_the_profile_is_2_and_gets_no_verdict() {
    let bench = Bench::new();
    let (run, port) = bench.start(&Profile::default(), &[REFUSAL]);
    let broker = format!("mqtt://127.0.0.1:{port}");
    let arguments = [
        "simulate",
        "agv",
        "--broker",
        &broker,
        "--manufacturer",
        "ACME",
        "--serial",
        "0002",
    ];
    let _other = Running::start(&mut tool(bench.path(), &arguments));
    run.end()
        .code(2)
        .says_one_error("a device speaks as ACME/0002 on uagv/v2/ACME/0002/connection; the profile says ACME/0001");
    let result = bench.result();
    assert_eq!(
        (&result["verdict"], &result["monitors"]),
        (&serde_json::Value::Null, &serde_json::json!([]))
    );
    bench.is_whole();
}

#[test]
fn a_device_of_a_profile_that_conforms_is_0() {
    let bench = Bench::new();
    let (run, port) = bench.start(&Profile::default(), &[REFUSAL]);
    let _agv = bench.agv(port, &[]);
    run.end().code(0).prints("PASS  ACME 0001 conforms");
    bench.is_whole();
}

#[test]
fn a_broken_requirement_is_1_and_is_named() {
    let fault = ["--virtual", "--fault", "outdated-update-taken-over"];
    run(&[&["run", "order-rejection"], &fault[..]].concat())
        .code(1)
        .prints("ORD-REJ-10")
        .prints("FAIL  ");
    // And over TCP.
    let bench = Bench::new();
    bench
        .run(&["run", REFUSAL, "--fault", "validation-error-misspelled"])
        .code(1)
        .prints("ORD-REJ-02");
    let result = bench.result();
    let decided = result["requirements"].as_array().unwrap();
    let decided = decided
        .iter()
        .find(|requirement| requirement["id"] == "ORD-REJ-02")
        .unwrap();
    assert_eq!(decided["verdict"], "fail");
    bench.is_whole();
}

#[test]
fn a_wrong_command_line_is_2_and_says_what_was_meant() {
    run(&["run", "--virtaul"]).code(2).says("--virtual");
    run(&["run", "--virtual", "order-rejektion"])
        .code(2)
        .says("no test matches")
        .says("did you mean");
    run(&["run", "--virtual", "--fault", "outdated-update-taken-ovr"])
        .code(2)
        .says("did you mean `outdated-update-taken-over`?");
    run(&["run", "--virtual", "--protocol", "9.9.9"])
        .code(2)
        .says("9.9.9")
        .says("known versions");
    run(&["run", "--profile", "missing.toml"]).code(2).says("missing.toml");
    run(&["explain", "ORD-REJ-3"]).code(2).says("did you mean `ORD-REJ-");
    run(&["simulate", "agv", "--fault", "x"]).code(2).says("list faults");
}

#[test]
fn a_wrong_profile_is_2_and_shows_the_place() {
    let bench = Bench::new();
    fs::write(bench.path().join("device.toml"), "[device]\nmanufacterer = \"ACME\"\n").unwrap();
    let arguments = ["run", "--profile", "device.toml"];
    bench
        .run(&arguments)
        .code(2)
        .says("device.toml:2")
        .says("did you mean `manufacturer`?");
    fs::write(bench.path().join("device.toml"), "[device]\nmanufacturer = \"ACME\"\n").unwrap();
    bench
        .run(&arguments)
        .code(2)
        .says("device.serial-number")
        .says("--serial");
    let contract = Profile::default().text();
    fs::write(bench.path().join("device.toml"), contract).unwrap();
    bench
        .run(&["certify", "--profile", "device.toml"])
        .code(2)
        .says("[time]");
    assert!(
        !bench.path().join("reports").exists(),
        "nothing was judged, so there is no report"
    );
}

#[test]
fn a_certificate_for_a_vehicle_that_may_not_drive_is_2_and_says_why() {
    let bench = Bench::new();
    let write = |motion: &str| {
        let text = format!("[device]\nmanufacturer = \"ACME\"\nserial-number = \"0001\"\n{motion}");
        fs::write(bench.path().join("device.toml"), text).unwrap();
    };
    for motion in ["", "[motion]\nallowed = false\n"] {
        write(motion);
        bench
            .run(&["certify", "--profile", "device.toml"])
            .code(2)
            .says("the profile does not allow motion")
            .says("allowed = true")
            .says("`certificate.laboratory` is missing")
            .says("--firmware-version");
    }
    assert!(!bench.path().join("reports").exists(), "nothing was tried");
}

#[test]
fn a_certificate_names_each_thing_that_profile_and_bench_lack() {
    let bench = Bench::new();
    let text = "[device]\nmanufacturer = \"ACME\"\nserial-number = \"0001\"\n[motion]\nallowed = true\n\
                [certificate]\nlaboratory = \"L\"\nplace = \"P\"\nhardware-version = \"A\"\nfirmware-version = \"1\"\n";
    fs::write(bench.path().join("device.toml"), text).unwrap();
    let certify = ["certify", "--profile", "device.toml", "--tester", "T"];
    bench
        .run(&certify)
        .code(2)
        .says("[hooks.power-cycle]: tell how it is done")
        .says("device.pick = …: name it in the profile")
        .says("the profile has no layout");
    let mut modified = tool(bench.path(), &certify);
    Running::start(modified.env("VDA5050_TCK_SUITES", "own"))
        .end()
        .code(2)
        .says("VDA5050_TCK_SUITES names others");
    assert!(!bench.path().join("reports").exists(), "nothing was tried");
}

#[test]
fn a_wrong_suite_is_2_and_shows_the_place() {
    let bench = Bench::new();
    let own = bench.path().join("own");
    copy(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("suites/requirements"),
        &own.join("requirements"),
    );
    let folder = own.join("agv/own");
    fs::create_dir_all(&folder).unwrap();
    let text = "test: own/typo\ntitle: A typo\ndevice: agv\nspec: \">=2.0, <3\"\nwhy: It happens.\nsteps:\n  \
                - expect: stat\n    checks: [STATE-01]\n    within: 5 s\n";
    fs::write(folder.join("typo.yaml"), text).unwrap();
    bench
        .run(&["run", "--virtual", "--suites", "own"])
        .code(2)
        .says("typo.yaml:7")
        .says("did you mean `state`?");
    bench
        .run(&["list", "tests", "--suites", "own"])
        .code(2)
        .says("typo.yaml:7");
    bench
        .run(&["run", "--virtual", "--suites", "nowhere"])
        .code(2)
        .says("nowhere");
    fs::remove_dir_all(own.join("requirements")).unwrap();
    bench
        .run(&["list", "tests", "--suites", "own", "--replace-suites"])
        .code(2)
        .says("needs a copy of that folder");
    fs::remove_file(folder.join("typo.yaml")).unwrap();
    bench
        .run(&["init", "--suites", "built-in"])
        .code(0)
        .prints("built-in/requirements");
    let written = bench.path().join("built-in");
    let test = fs::read_to_string(written.join("agv/order-rejection/unreadable.yaml")).unwrap();
    assert!(written.join("schemas/suite.schema.json").is_file() && written.join("default.toml").is_file());
    bench
        .run(&["init", "--suites", "built-in"])
        .code(2)
        .says("is there already");
    fs::write(
        folder.join("mine.yaml"),
        test.replace("test: order-rejection/unreadable", "test: own/mine"),
    )
    .unwrap();
    bench
        .run(&["run", "--virtual", "--suites", "own", "own/mine", "--quiet"])
        .code(0)
        .prints("With suites that are not the delivered ones: ");
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

#[test]
fn what_cannot_be_decided_is_3() {
    // Nobody is there to switch it off and on.
    let bench = Bench::new();
    let (run, port) = bench.start(&Profile::default(), &["connection/online-after-start", QUICK]);
    let _agv = bench.agv(port, &[]);
    run.end().code(3).prints("power-cycle").prints(QUICK);
    bench.is_whole();
}

#[test]
fn nothing_selected_and_nothing_applicable_are_4() {
    let bench = Bench::new();
    bench
        .run(&["run", "--virtual", QUICK, "--shard", "2/2"])
        .code(4)
        .says_one_error("no test was selected");
    assert!(!bench.path().join("reports").exists());
    let arguments = ["run", "cancel-order/while-driving", "--no-motion"];
    bench.run(&arguments).code(3).prints("--no-motion");
    assert_eq!(bench.result()["verdict"], "inconclusive");
    bench.is_whole();
}

#[test]
fn a_port_in_use_is_5() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    run(&["run", QUICK, "--listen", &address])
        .code(5)
        .says_one_error(&address);
}

#[test]
fn a_broker_nobody_reaches_is_5() {
    let url = format!("mqtt://127.0.0.1:{}", free_port());
    run(&["run", QUICK, "--broker", &url]).code(5).says_one_error(&url);
    run(&["simulate", "agv", "--broker", &url]).code(5).says_one_error(&url);
}

#[test]
fn a_folder_that_cannot_be_written_is_5() {
    let bench = Bench::new();
    fs::write(bench.path().join("reports"), "a file").unwrap();
    bench
        .run(&["run", "--virtual", QUICK])
        .code(5)
        .says_one_error("reports");
}
