//! Brokers of customers: with logins, access rules, certificates and `WebSocket`s. What they refuse is said in plain words.

use std::path::Path;
use std::process::Command;

use crate::bench::{Bench, Profile, QUICK};
use crate::certificates;
use crate::mosquitto::Mosquitto;
use crate::scripted::topic;
use crate::tool::{Ended, Running, tool};
use crate::websockets;

/// A file of users, of whom there is one.
fn users(folder: &Path) -> String {
    let file = folder.join("users");
    let made = Command::new("mosquitto_passwd")
        .args(["-b", "-c", &file.display().to_string(), "tck", "right-password"])
        .status();
    assert!(made.unwrap().success());
    open_up(&file);
    format!("allow_anonymous false\npassword_file {}\n", file.display())
}

/// mosquitto may give its rights away before it reads its files.
fn open_up(file: &Path) {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = file.parent().unwrap();
        std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o755)).unwrap();
        std::fs::set_permissions(file, std::fs::Permissions::from_mode(0o644)).unwrap();
    }
    #[cfg(not(unix))]
    let _ = file;
}

fn rules(folder: &Path, lines: &str) -> String {
    let file = folder.join("rules");
    std::fs::write(&file, lines).unwrap();
    open_up(&file);
    format!("allow_anonymous true\nacl_file {}\n", file.display())
}

fn secured(folder: &Path) -> String {
    certificates::make(folder);
    for name in ["ca.crt", "server.crt", "server.key"] {
        open_up(&folder.join(name));
    }
    let folder = folder.display();
    format!("allow_anonymous true\ncertfile {folder}/server.crt\nkeyfile {folder}/server.key\n")
}

/// Runs a test against a vehicle at the tap, in front of this broker.
fn judged(bench: &Bench, broker: &str, more: &str, password: &str) -> Running {
    let profile = Profile {
        bench: format!("broker = \"{broker}\"\n{more}"),
        ..Profile::default()
    };
    std::fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    let mut command = tool(bench.path(), &["run", "--profile", "device.toml", QUICK]);
    command.env("VDA5050_TCK_PASSWORD", password);
    Running::start(&mut command)
}

fn refused(broker: &str, more: &str, password: &str) -> Ended {
    judged(&Bench::new(), broker, more, password).end().code(5)
}

fn passes(bench: &Bench, broker: &str, more: &str) -> String {
    let mut run = judged(bench, broker, more, "right-password");
    let address = run.line("the device is expected at mqtt://");
    let port: u16 = address.rsplit(':').next().unwrap().parse().unwrap();
    let mut agv = tool(
        bench.path(),
        &[
            "simulate",
            "agv",
            "--broker",
            &format!("mqtt://127.0.0.1:{port}"),
            "--manufacturer",
            crate::bench::MANUFACTURER,
            "--serial",
            crate::bench::SERIAL,
            "--username",
            "tck",
        ],
    );
    let _agv = Running::start(agv.env("VDA5050_TCK_PASSWORD", "right-password"));
    let ended = run.end().code(0);
    ended.stdout
}

#[test]
fn a_login_is_asked_for_and_a_wrong_one_named() {
    let Some(broker) = Mosquitto::start_with(users) else {
        return;
    };
    refused(&broker.url(), "", "")
        .says("it lets nobody in without a login")
        .says("`username`");
    let wrong = refused(&broker.url(), "username = \"tck\"", "wrong-password").says("it refuses the login of `tck`");
    assert!(!wrong.stderr.contains("wrong-password"));
    passes(&Bench::new(), &broker.url(), "username = \"tck\"");
    // A simulated device says it as well, and does not wait for ever.
    for what in ["agv", "master-control"] {
        let bench = Bench::new();
        Running::start(&mut tool(bench.path(), &["simulate", what, "--broker", &broker.url()]))
            .end()
            .code(5)
            .says_one_error("it lets nobody in without a login");
    }
}

#[test]
fn access_rules_that_forbid_the_harness_its_own_topics_are_a_limit_of_the_report() {
    let device = format!("topic readwrite {}\n", topic("#"));
    let Some(broker) = Mosquitto::start_with(|folder| rules(folder, &device)) else {
        return;
    };
    let bench = Bench::new();
    passes(&bench, &broker.url(), "");
    let result = bench.result();
    let limits = result["limits"].to_string();
    for said in [
        "does not allow messages of client tck-watcher-",
        "vda5050-tck/self-test/",
        "topic readwrite vda5050-tck/#",
        &format!("topic readwrite {}", topic("#")),
    ] {
        assert!(limits.contains(said), "no `{said}` in {limits}");
    }
    bench.is_whole();
}

#[test]
fn other_names_of_the_harness_keep_access_rules() {
    let lines = format!("topic readwrite {}\ntopic readwrite site/harness/#\n", topic("#"));
    let Some(broker) = Mosquitto::start_with(|folder| rules(folder, &lines)) else {
        return;
    };
    let bench = Bench::new();
    passes(
        &bench,
        &broker.url(),
        "own-topics = \"site/harness\"\nclient-id = \"harness\"\n",
    );
    let limits = bench.result()["limits"].to_string();
    assert!(!limits.contains("does not allow"), "{limits}");
}

#[test]
fn mistakes_with_certificates_are_named_with_what_helps() {
    let Some(broker) = Mosquitto::start_with(secured) else {
        return;
    };
    let url = |scheme: &str, host: &str| format!("{scheme}://{host}:{}", broker.port);
    let authority = format!("tls-ca = \"{}\"\n", broker.folder().join("ca.crt").display());
    refused(&url("mqtts", "127.0.0.1"), "", "")
        .says("its certificate is not trusted")
        .says("`tls-ca`");
    refused(&url("mqtt", "127.0.0.1"), "", "").says("mqtts://");
    passes(&Bench::new(), &url("mqtts", "localhost"), &authority);
    let Some(plain) = Mosquitto::start() else { return };
    let plain = format!("mqtts://127.0.0.1:{}", plain.port);
    refused(&plain, &authority, "").says("without TLS it is mqtt://");
}

#[test]
fn a_simulated_vehicle_trusts_the_authority_it_is_given() {
    let Some(broker) = Mosquitto::start_with(secured) else {
        return;
    };
    let bench = Bench::new();
    let url = format!("mqtts://localhost:{}", broker.port);
    let authority = broker.folder().join("ca.crt").display().to_string();
    let mut agv = Running::start(&mut tool(
        bench.path(),
        &["simulate", "agv", "--broker", &url, "--tls-ca", &authority],
    ));
    agv.line("1 simulated AGV(s) on ");
    agv.interrupt();
    agv.end().code(0);
    Running::start(&mut tool(bench.path(), &["simulate", "agv", "--broker", &url]))
        .end()
        .code(5)
        .says_one_error("its certificate is not trusted");
}

#[test]
fn websockets_are_brokers_like_others() {
    let Some(broker) = Mosquitto::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    certificates::make(folder.path());
    let plain = websockets::before(broker.port, None);
    let bench = Bench::new();
    passes(
        &bench,
        &format!("ws://127.0.0.1:{plain}/mqtt?token=not-for-readers"),
        "",
    );
    let bundle = bench.bundle();
    for file in ["journal.jsonl", "result.json", "report.html"] {
        let text = std::fs::read_to_string(bundle.join(file)).unwrap();
        assert!(!text.contains("not-for-readers"), "{file} holds the token");
    }
    let secured = websockets::before(broker.port, Some(folder.path()));
    let authority = format!("tls-ca = \"{}\"\n", folder.path().join("ca.crt").display());
    passes(&Bench::new(), &format!("wss://localhost:{secured}"), &authority);
    refused(&format!("ws://127.0.0.1:{}", broker.port), "", "").says("without WebSocket it is mqtt://");
}

#[test]
fn a_vehicle_that_gets_no_order_because_of_access_rules_is_not_accused() {
    let device = topic("#");
    let device = device.trim_end_matches("/#");
    // Nobody may command the vehicle.
    let lines: Vec<String> = ["state", "connection", "factsheet", "visualization"]
        .iter()
        .map(|name| format!("topic readwrite {device}/{name}\n"))
        .collect();
    let lines = format!("{}topic readwrite vda5050-tck/#\n", lines.concat());
    let Some(broker) = Mosquitto::start_with(|folder| rules(folder, &lines)) else {
        return;
    };
    let bench = Bench::new();
    let mut run = judged(&bench, &broker.url(), "", "");
    let address = run.line("the device is expected at mqtt://");
    let port = address.rsplit(':').next().unwrap().parse().unwrap();
    let _agv = bench.agv(port, &[]);
    let ended = run.end().code(5).says("reaches the device, which subscribes to it");
    assert!(
        ended.stderr.contains(&format!("topic readwrite {device}/#")),
        "{}",
        ended.stderr
    );
    bench.is_partial();
}
