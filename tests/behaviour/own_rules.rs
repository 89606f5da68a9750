//! Requirements of somebody's own: decided by named checks with own limits, told apart from the standard, and shown where they are.

use std::fs;

use crate::bench::Bench;

/// A requirement, and a monitor that decides it by a check of the standard's own.
fn own_rule(bench: &Bench, period: &str) {
    let own = bench.path().join("own");
    for folder in ["requirements", "monitors/acme"] {
        fs::create_dir_all(own.join(folder)).unwrap();
    }
    let requirement = "group: ACME\nchapter: Works standard\nposition: 900\nrequirements:\n  - id: ACME-7\n    text: Send a state often.\n    \
                       role: agv\n    decided: passive\n    in: { \"2.1\": { section: \"5\", mood: shall } }\n    stimulus: None.\n    \
                       observe: The time between states.\n    needs: []\n    link: https://tracker.example/browse/ACME-7\n";
    fs::write(own.join("requirements/ACME.yaml"), requirement).unwrap();
    let monitor = format!(
        "monitor: acme/states-often\ntitle: States come often\ndevice: agv\nspec: \">=2.0, <3\"\nwhy: The works say so.\n\
         checks: [ACME-7]\ncheck: state/period\ninstead-of: STATE-02\nwith: {{ statePeriod: {period} }}\n"
    );
    fs::write(own.join("monitors/acme/states-often.yaml"), monitor).unwrap();
}

/// A test that lasts longer than a period of the reference AGV.
const LASTS: &str = "state/every-half-minute";

#[test]
fn a_broken_rule_of_the_works_fails_the_run_and_breaks_no_standard() {
    let bench = Bench::new();
    let run = || {
        bench.run(&[
            "run",
            "--virtual",
            "--suites",
            "own",
            "--as",
            "sarif=out.sarif",
            "--as",
            "junit-requirements=out.xml",
            LASTS,
        ])
    };
    own_rule(&bench, "500 ms");
    run()
        .code(1)
        .prints("broke no binding requirement of VDA 5050 2.1.0 as an AGV")
        .prints("Works standard: 1 of 1 applicable requirement decided, 1 broken.");
    let result = bench.result();
    let own = result["requirements"].as_array().unwrap().iter();
    let own: Vec<_> = own.filter(|one| !one["own"].is_null()).collect();
    assert_eq!((own.len(), &own[0]["verdict"]), (1, &"fail".into()), "{own:?}");
    let sarif = fs::read_to_string(bench.path().join("out.sarif")).unwrap();
    assert!(
        sarif.contains("\"uri\": \"own/monitors/acme/states-often.yaml\""),
        "{sarif}"
    );
    let junit = fs::read_to_string(bench.path().join("out.xml")).unwrap();
    assert!(junit.contains("https://tracker.example/browse/ACME-7"), "{junit}");
    bench
        .run(&["explain", "acme/states-often", "--suites", "own"])
        .code(0)
        .prints("file           own/monitors/acme/states-often.yaml");

    own_rule(&bench, "5 s");
    run()
        .code(0)
        .prints("Works standard: 1 of 1 applicable requirement decided, none broken.");

    own_rule(&bench, "fast");
    run()
        .code(2)
        .says("`statePeriod` is a time")
        .says("own/monitors/acme/states-often.yaml:9:");
}
