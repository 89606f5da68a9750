//! Brokers of customers: with logins, access rules, certificates and `WebSocket`s. What they refuse is said in plain words.

use std::cell::Cell;
use std::path::Path;
use std::process::Command;

use crate::bench::{Bench, MANUFACTURER, Profile, QUICK, SERIAL};
use crate::certificates;
use crate::mosquitto::{Mosquitto, free_port};
use crate::scripted::topic;
use crate::tool::{Ended, Running, tool};
use crate::websockets;

/// A file of users: the harness and a vehicle.
fn users(folder: &Path) -> String {
    let file = folder.join("users");
    std::fs::write(&file, "").unwrap();
    for user in ["tck", "agv"] {
        let made = Command::new("mosquitto_passwd")
            .args(["-b", &file.display().to_string(), user, "right-password"])
            .status();
        assert!(made.unwrap().success());
    }
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
    judged_by(QUICK, bench, broker, more, password)
}

/// Runs these tests against a vehicle at the tap, in front of this broker.
fn judged_by(tests: &str, bench: &Bench, broker: &str, more: &str, password: &str) -> Running {
    let profile = Profile {
        bench: format!("broker = \"{broker}\"\n{more}"),
        ..Profile::default()
    };
    std::fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    let mut command = tool(bench.path(), &["run", "--profile", "device.toml", tests]);
    command.env("VDA5050_TCK_PASSWORD", password);
    Running::start(&mut command)
}

fn refused(broker: &str, more: &str, password: &str) -> Ended {
    judged(&Bench::new(), broker, more, password).end().code(5)
}

/// Starts a run with these settings of the bench, and a vehicle at its address.
fn with_vehicle(bench: &Bench, broker: &str, more: &str, user: Option<&str>) -> (Running, Running) {
    with_vehicle_for(QUICK, bench, broker, more, user)
}

/// Starts a run of these tests with these settings of the bench, and a vehicle at its address.
fn with_vehicle_for(tests: &str, bench: &Bench, broker: &str, more: &str, user: Option<&str>) -> (Running, Running) {
    let mut run = judged_by(tests, bench, broker, more, "right-password");
    let address = run.line("the device is expected at mqtt://");
    let broker = format!("mqtt://{address}");
    let mut arguments = vec!["simulate", "agv", "--broker", &broker];
    arguments.extend(["--manufacturer", MANUFACTURER, "--serial", SERIAL]);
    arguments.extend(user.iter().flat_map(|user| ["--username", user]));
    let mut agv = tool(bench.path(), &arguments);
    let agv = Running::start(agv.env("VDA5050_TCK_PASSWORD", "right-password"));
    (run, agv)
}

fn passes(bench: &Bench, broker: &str, more: &str) -> String {
    let user = more.contains("username").then_some("tck");
    let (run, _agv) = with_vehicle(bench, broker, more, user);
    run.end().code(0).stdout
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
    assert!(!limits.contains("The broker"), "{limits}");
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
fn a_broker_that_asks_for_certificates_is_reached_by_every_command() {
    let asking = |folder: &Path| {
        let more = format!("cafile {}/ca.crt\nrequire_certificate true\n", folder.display());
        secured(folder) + &more
    };
    let Some(broker) = Mosquitto::start_with(asking) else {
        return;
    };
    let bench = Bench::new();
    let url = format!("mqtts://localhost:{}", broker.port);
    let file = |name: &str| broker.folder().join(name).display().to_string();
    let (authority, certificate, key) = (file("ca.crt"), file("server.crt"), file("server.key"));
    let at = ["--broker", &url, "--tls-ca", &authority];
    let shown = ["--client-cert", &certificate, "--client-key", &key];
    let listen = ["discover", "--seconds", "2"];
    bench.run(&[&listen[..], &at].concat()).code(5);
    let simulate = ["simulate", "agv", "--client-id", "the-only-one"];
    let mut agv = Running::start(&mut tool(bench.path(), &[&simulate[..], &at, &shown].concat()));
    agv.line("1 simulated AGV(s) on ");
    bench.run(&[&listen[..], &at, &shown].concat()).code(0).prints("ONLINE");
    let init = ["init", "--seconds", "2", "--client-id", "tck-here"];
    bench.run(&[&init[..], &at, &shown].concat()).code(0);
    let watched = ["watch", "--plain", "--for", "1s"];
    let watched = bench.run(&[&watched[..], &at, &shown].concat());
    assert!(watched.stderr.contains("watching; Ctrl-C ends it"), "{watched:?}");
    // Whoever comes under the same client id throws it out.
    let other = [&simulate[..], &at, &shown, &["--serial", "other"]].concat();
    let mut other = Running::start(&mut tool(bench.path(), &other));
    other.line("1 simulated AGV(s) on ");
    // The profile that `init` has written gets in as well.
    let judged = bench.run(&["run", "--profile", "device.toml", QUICK]);
    assert!(!matches!(judged.status.code(), Some(2 | 5)), "{judged:?}");
}

#[test]
fn two_simulated_master_controls_live_at_one_broker() {
    let logging = |folder: &Path| {
        let log = folder.join("log").display().to_string();
        format!("user root\nallow_anonymous true\nlog_type all\nlog_dest file {log}\n")
    };
    let Some(broker) = Mosquitto::start_with(logging) else {
        return;
    };
    let bench = Bench::new();
    let url = broker.url();
    let simulate = ["simulate", "master-control", "--broker", &url, "--hooks", "127.0.0.1:0"];
    let both = [(); 2].map(|()| {
        let mut one = Running::start(&mut tool(bench.path(), &simulate));
        one.line("hooks are served at ");
        one
    });
    for one in both {
        one.interrupt();
        one.end().code(0);
    }
    let log = std::fs::read_to_string(broker.folder().join("log")).unwrap();
    assert!(log.contains("reference-master-control"), "{log}");
    assert!(!log.contains("already connected"), "{log}");
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
fn the_websockets_of_mosquitto_are_reached_with_path_password_and_certificate() {
    let ports = Cell::new((0, 0));
    let Some(broker) = Mosquitto::start_with(|folder| {
        ports.set((free_port(), free_port()));
        let (plain, secured) = ports.get();
        certificates::make(folder);
        for name in ["ca.crt", "server.crt", "server.key"] {
            open_up(&folder.join(name));
        }
        let users = users(folder);
        let folder = folder.display();
        format!(
            "{users}listener {plain} 127.0.0.1\nprotocol websockets\n\
             listener {secured} 127.0.0.1\nprotocol websockets\ncertfile {folder}/server.crt\nkeyfile {folder}/server.key\n"
        )
    }) else {
        return;
    };
    let (plain, secured) = ports.get();
    let login = "username = \"tck\"\n";
    let authority = format!("tls-ca = \"{}\"\n", broker.folder().join("ca.crt").display());
    let plain = format!("ws://127.0.0.1:{plain}/fleet/mqtt?token=not-for-readers");
    let secured = format!("wss://localhost:{secured}/fleet/mqtt");
    let bench = Bench::new();
    passes(&bench, &plain, login);
    for file in [
        "journal.jsonl",
        "result.json",
        "report.html",
        "junit.xml",
        "manifest.json",
    ] {
        let text = std::fs::read_to_string(bench.bundle().join(file)).unwrap();
        for secret in ["not-for-readers", "right-password"] {
            assert!(!text.contains(secret), "{file} holds {secret}");
        }
    }
    passes(&Bench::new(), &secured, &format!("{login}{authority}"));
    refused(&plain, "", "").says("it lets nobody in without a login");
    let wrong = refused(&plain, login, "wrong-password").says("it refuses the login of `tck`");
    for secret in ["not-for-readers", "wrong-password"] {
        assert!(!wrong.stderr.contains(secret), "{}", wrong.stderr);
    }
    refused(&secured, login, "right-password").says("its certificate is not trusted");
    refused(&secured.replace("wss", "ws"), login, "right-password").says("the broker at ws://localhost");
    // A vehicle of ours gets in the same way.
    let mut agv = tool(
        bench.path(),
        &["simulate", "agv", "--broker", &secured, "--username", "tck", "--tls-ca"],
    );
    agv.arg(broker.folder().join("ca.crt"))
        .env("VDA5050_TCK_PASSWORD", "right-password");
    let mut agv = Running::start(&mut agv);
    agv.line("1 simulated AGV(s) on ");
    agv.interrupt();
    agv.end().code(0);
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
    let (run, _agv) = with_vehicle(&bench, &broker.url(), "", None);
    let ended = run.end().code(5).says("reaches the device, which subscribes to it");
    assert!(
        ended.stderr.contains(&format!("topic readwrite {device}/#")),
        "{}",
        ended.stderr
    );
    bench.is_partial();
    // The same is seen without a tap: what the harness publishes does not come back.
    let bench = Bench::new();
    let (run, _agv) = with_vehicle(&bench, &broker.url(), "tap = false\n", None);
    run.end()
        .code(5)
        .says("does not allow that the harness publishes on")
        .says(&format!("topic readwrite {device}/#"));
    bench.is_partial();
}

#[test]
fn a_vehicle_whose_messages_the_broker_keeps_to_itself_is_not_accused() {
    // Whoever logs in under another name may do nothing.
    let lines = format!("topic readwrite {}\ntopic readwrite vda5050-tck/#\n", topic("#"));
    let Some(broker) = Mosquitto::start_with(|folder| rules(folder, &lines)) else {
        return;
    };
    let bench = Bench::new();
    let (run, _agv) = with_vehicle(&bench, &broker.url(), "", Some("fleet"));
    run.end()
        .code(5)
        .says("of user `fleet` publishes on")
        .says("reaches the harness")
        .says("user fleet")
        .says(&format!("topic readwrite {}", topic("#")));
    assert_ne!(bench.result()["verdict"], "fail");
    bench.is_partial();
}

#[test]
fn a_vehicle_whose_states_do_not_come_where_nobody_sees_why_is_not_accused() {
    let lines = format!(
        "topic readwrite {}\ntopic readwrite vda5050-tck/#\n",
        topic("connection")
    );
    let Some(broker) = Mosquitto::start_with(|folder| rules(folder, &lines)) else {
        return;
    };
    let bench = Bench::new();
    let (run, _agv) = with_vehicle(&bench, &broker.url(), "tap = false\n", None);
    run.end().code(5).says("sent no state within");
    assert_eq!(bench.result()["verdict"], "inconclusive");
}

#[test]
fn a_vehicle_that_may_not_read_its_orders_is_not_accused_where_nobody_sees_it() {
    let own = topic("#");
    let lines =
        format!("user tck\ntopic readwrite {own}\ntopic readwrite vda5050-tck/#\nuser agv\ntopic write {own}\n");
    let Some(broker) = Mosquitto::start_with(|folder| {
        let file = folder.join("rules");
        std::fs::write(&file, &lines).unwrap();
        open_up(&file);
        format!("{}acl_file {}\n", users(folder), file.display())
    }) else {
        return;
    };
    let bench = Bench::new();
    let more = "tap = false\nusername = \"tck\"\n";
    let (run, _agv) = with_vehicle(&bench, &broker.url(), more, Some("agv"));
    run.end()
        .code(3)
        .prints("without a tap nobody can tell whether the broker lets the device read");
    bench.is_whole();
}

#[test]
fn a_vehicle_that_dies_is_named_where_no_tap_sees_it_go() {
    let Some(broker) = Mosquitto::start_with(|_| "allow_anonymous true\n".to_owned()) else {
        return;
    };
    let bench = Bench::new();
    // Enough tests that the vehicle is gone before they are over.
    let (mut run, mut agv) = with_vehicle_for("order-rejection/*", &bench, &broker.url(), "tap = false\n", None);
    run.line("estimated time");
    agv.kill();
    run.line("the device is gone since #");
    run.end().says("CONNECTIONBROKEN on its connection topic");
}
