//! Certificates that the harness gives a robot: over TLS, where the robot trusts the certificate of the bench.

use serde_json::Value;

use crate::bench::{Bench, MANUFACTURER, Profile, SERIAL};
use crate::certificates;
use crate::tool::{Running, tool};

/// Verdicts of all tests of certificates, by their names, for a robot that trusts the bench.
fn verdicts(fault: &[&str]) -> Vec<(String, String)> {
    let bench = Bench::new();
    certificates::make(bench.path());
    let profile = Profile {
        device: "protocol = \"3.0.0\"\ncertificate-may-change = true\n".to_owned(),
        bench: "tls-cert = \"server.crt\"\ntls-key = \"server.key\"\ntls-ca = \"ca.crt\"\n".to_owned(),
        ..Profile::default()
    };
    let profile = profile.with(&[("download", "3 s"), ("react", "3 s"), ("slow", "2 s")]);
    std::fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    let arguments = ["run", "--profile", "device.toml", "certificates"];
    let mut run = Running::start(&mut tool(bench.path(), &arguments));
    let url = run.line("the device is expected at mqtts://");
    let port = url.rsplit(':').next().unwrap().trim();
    let broker = format!("mqtts://localhost:{port}");
    let mut robot = vec!["simulate", "agv", "--protocol", "3.0.0", "--broker", &broker];
    robot.extend(["--manufacturer", MANUFACTURER, "--serial", SERIAL, "--tls-ca", "ca.crt"]);
    robot.extend(fault);
    let _robot = Running::start(&mut tool(bench.path(), &robot));
    run.end();
    let result = bench.result();
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let tests = result["tests"].as_array().unwrap().iter();
    tests.map(|test| (text(&test["id"]), text(&test["verdict"]))).collect()
}

#[test]
fn a_robot_fetches_its_certificate_from_the_bench_and_looks_into_it() {
    for (id, verdict) in verdicts(&[]) {
        assert_eq!(verdict, "pass", "{id}");
    }
    let found = verdicts(&["--fault", "broken-certificate-activated"]);
    let failed: Vec<&str> = found
        .iter()
        .filter(|(_, verdict)| verdict == "fail")
        .map(|(id, _)| id.as_str())
        .collect();
    assert_eq!(failed, ["certificates/broken-certificate"], "{found:?}");
}
