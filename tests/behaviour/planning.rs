//! What is said before anything is sent: the plan of a run, and what `validate` says of a profile.

use serde_json::Value;

use crate::bench::{Bench, Profile, QUICK, REFUSAL};
use crate::mosquitto::Mosquitto;
use crate::simulating::retained;
use crate::tool::{run, run_in};

/// Writes the profile, and runs the program in its folder.
fn with_profile(profile: &Profile, arguments: &[&str]) -> (Bench, crate::tool::Ended) {
    let bench = Bench::new();
    std::fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    let ended = bench.run(arguments);
    (bench, ended)
}

fn plan(arguments: &[&str], profile: &Profile) -> Value {
    let all = [
        &["run", "--profile", "device.toml", "--plan", "--format", "json"],
        arguments,
    ]
    .concat();
    let (bench, ended) = with_profile(profile, &all);
    assert!(!bench.path().join("reports").exists(), "a plan leaves nothing behind");
    serde_json::from_str(&ended.code(0).stdout).unwrap()
}

fn count(plan: &Value, gate: &str) -> usize {
    let tests = plan["tests"].as_array().unwrap();
    tests.iter().filter(|test| test["gate"] == gate).count()
}

#[test]
fn the_plan_of_the_built_in_vehicle_is_what_its_run_does() {
    let planned = run(&["run", "--plan", "--format", "json", "--seed", "3", "--no-motion"]).code(0);
    let planned: Value = serde_json::from_str(&planned.stdout).unwrap();
    let bench = Bench::new();
    bench
        .run(&["run", "--virtual", "--seed", "3", "--no-motion", "--quiet"])
        .code(3);
    let result = bench.result();
    let mut ran: Vec<&str> = Vec::new();
    for test in result["tests"].as_array().unwrap() {
        if test["journal"].is_array() {
            ran.push(test["id"].as_str().unwrap());
        }
    }
    let tests = planned["tests"].as_array().unwrap().iter();
    let mut runs: Vec<&str> = tests
        .filter(|test| test["gate"] == "runs")
        .map(|test| test["id"].as_str().unwrap())
        .collect();
    ran.sort_unstable();
    runs.sort_unstable();
    assert_eq!(ran, runs);
    assert!(planned["standsStill"].as_str().unwrap().contains("--no-motion"));
}

#[test]
fn a_plan_names_what_the_profile_lacks_and_what_people_are_asked() {
    let poor = plan(&[], &Profile::default());
    assert!(count(&poor, "inconclusive") > count(&plan(&[], &driving()), "inconclusive"));
    let asking = Profile {
        motion: true,
        more: "[hooks.set-mode]\nprompt = \"Switch it to {mode}.\"\n".to_owned(),
        ..Profile::default()
    };
    let hooks = plan(&[], &asking)["hooks"].clone();
    let person = &hooks[0];
    assert_eq!(person["hook"], "set-mode");
    assert_eq!(person["how"]["person"], "Switch it to {mode}.");
    assert!(person["times"].as_u64().unwrap() > 0);
    let (_bench, text) = with_profile(&Profile::default(), &["run", "--profile", "device.toml", "--plan"]);
    text.code(0)
        .prints("To decide more:")
        .prints("[motion] allowed = true")
        .prints("nobody is asked for anything");
}

fn driving() -> Profile {
    Profile {
        motion: true,
        ..Profile::default()
    }
}

#[test]
fn validate_gives_the_numbers_of_the_plan_and_refuses_what_a_run_refuses() {
    let numbers = plan(&[], &driving());
    let (_bench, said) = with_profile(&driving(), &["validate", "device.toml"]);
    let runs = format!("{} of ", count(&numbers, "runs"));
    said.code(0)
        .prints("valid profile: ACME 0001")
        .prints("layout with 4 nodes")
        .prints(&runs);
    for (wrong, what) in [
        ("[device]\nmanufacturer = \"ACME\"\n", "serial-number"),
        (
            "[device]\nmanufacturer = \"ACME\"\nserial-number = \"1\"\nprotocol = \"9.0\"\n",
            "protocol version",
        ),
        (
            "[device]\nmanufacturer = \"ACME\"\nserial-number = \"1\"\n[layout]\nlif = \"none.json\"\n",
            "none.json",
        ),
        (
            "[device]\nmanufacturer = \"ACME\"\nserial-number = \"1\"\n[bench]\nbroker = \"mqtts://h\"\ntls-ca = \"none.crt\"\n",
            "none.crt",
        ),
    ] {
        let bench = Bench::new();
        std::fs::write(bench.path().join("wrong.toml"), wrong).unwrap();
        bench.run(&["validate", "wrong.toml"]).code(2).prints(what);
        bench.run(&["run", "--profile", "wrong.toml"]).code(2).says(what);
    }
}

#[test]
fn what_the_broker_keeps_of_a_vehicle_is_known_before_a_run() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let _vehicle = bench.agv(mosquitto.port, &[]);
    retained(mosquitto.port, "ONLINE");
    let profile = Profile {
        bench: format!("broker = \"{}\"\ntap = false", mosquitto.url()),
        ..driving()
    };
    let known = plan(&[], &profile);
    // What only a state tells is not known before a run.
    let mut open = known["tests"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|test| test["gate"] == "depends-on-device");
    assert!(open.all(|test| test["why"].as_str().unwrap().starts_with("the first state")));
    assert!(
        known["knownFrom"]
            .as_str()
            .unwrap()
            .starts_with("the factsheet that the broker keeps")
    );
    let (_bench, said) = with_profile(&profile, &["validate", "device.toml"]);
    said.code(0).prints("the factsheet that the broker keeps");
    drop(mosquitto);
    let (_bench, unknown) = with_profile(&profile, &["run", "--profile", "device.toml", "--plan"]);
    unknown
        .code(0)
        .prints("nobody has looked whether the broker keeps a factsheet");
}

#[test]
fn the_floor_is_drawn_with_what_is_not_used_and_who_wants_more_of_it() {
    let bench = Bench::new();
    std::fs::write(bench.path().join("device.toml"), driving().text()).unwrap();
    bench
        .run(&["run", "--profile", "device.toml", "--plan", "--floor", "floor.svg"])
        .code(0)
        .prints("The floor: 4 nodes and 6 edges")
        .prints("Tests that want more floor:");
    let svg = std::fs::read_to_string(bench.path().join("floor.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains(">A4<"), "{svg}");
    let hall = format!("{}/fixtures/layouts/hall.lif.json", env!("CARGO_MANIFEST_DIR"));
    run(&["validate", &hall]).code(0).prints("leads to another map");
}

#[test]
fn a_skeleton_for_a_master_control_leads_to_a_plan() {
    let bench = Bench::new();
    bench
        .run(&[
            "init",
            "--role",
            "master-control",
            "--manufacturer",
            "ACME",
            "--serial",
            "fleet-1",
        ])
        .code(0)
        .prints("device.toml is written");
    bench
        .run(&["validate", "device.toml"])
        .code(0)
        .prints("valid profile: ACME fleet-1");
}

#[test]
fn nothing_that_runs_is_4() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("device.toml"), Profile::default().text()).unwrap();
    let moving = "order-acceptance/node-by-node";
    run_in(folder.path(), &["run", "--profile", "device.toml", moving, "--plan"]).code(4);
    run_in(folder.path(), &["run", "--reference", QUICK, REFUSAL, "--plan"]).code(0);
}
