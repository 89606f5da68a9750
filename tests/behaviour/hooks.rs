//! Hooks that reach real systems: over HTTPS, with tokens that nobody reads afterwards.

use std::path::PathBuf;

use crate::bench::{Bench, Profile};
use crate::broken::started_by_the_harness;
use crate::certificates;
use crate::https::Server;
use crate::tool::{Running, tool};

/// Asks for an emergency stop and its release.
const STOP: &str = "state/emergency-stop";

/// Everything a run has written, by file.
fn written(bench: &Bench) -> Vec<(PathBuf, String)> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(bench.bundle())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .collect();
    files.push(bench.path().join("run.log"));
    files
        .into_iter()
        .map(|path| {
            let bytes = std::fs::read(&path).unwrap();
            (path, String::from_utf8_lossy(&bytes).into_owned())
        })
        .collect()
}

#[test]
fn a_request_with_a_token_is_made_over_https_and_no_secret_is_left_anywhere() {
    const SECRETS: [&str; 4] = ["token-of-env", "token-of-file", "token-of-url", "password-of-url"];
    let bench = Bench::new();
    certificates::make(bench.path());
    let fleet = Server::start(bench.path());
    std::fs::write(bench.path().join("key"), "token-of-file\n").unwrap();
    let mut profile = Profile::impatient();
    profile.bench = "tls-ca = \"ca.crt\"\n".to_owned();
    let stop = fleet
        .url("204?key=token-of-url")
        .replace("https://", "https://me:password-of-url@");
    profile.more = format!(
        "[hooks.emergency-stop]\nhttp = {{ url = \"{stop}\", headers = {{ Authorization = \"Bearer ${{env:FLEET_TOKEN}}\", X-Key = \
         \"${{file:key}}\", X-Vehicle = \"{{serial-number}}\" }} }}\n\
         [hooks.release-emergency-stop]\nrun = [\"sh\", \"-c\", \"echo token-of-env; echo $FLEET_TOKEN token-of-file >&2; exit 1\"]\n\
         [hooks.after-start]\nrun = [\"touch\", \"was-given-its-position\"]\n"
    );
    std::fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    let mut command = tool(
        bench.path(),
        &["run", "--profile", "device.toml", "-vv", "--log-file", "run.log", STOP],
    );
    command.env("FLEET_TOKEN", "token-of-env");
    let mut run = Running::start(&mut command);
    let address = run.line("the device is expected at mqtt://");
    let port = address.rsplit(':').next().unwrap().parse().unwrap();
    let _agv = bench.agv(port, &[]);
    let ended = run.end();
    let asked = fleet.asked.lock().unwrap().join("\n");
    for header in [
        "authorization: Bearer token-of-env",
        "x-key: token-of-file",
        "x-vehicle: 0001",
    ] {
        assert!(
            asked.lines().any(|line| line.eq_ignore_ascii_case(header)),
            "no `{header}` in {asked}\n{}\n{}",
            ended.status,
            ended.stderr
        );
    }
    let journal = std::fs::read_to_string(bench.bundle().join("journal.jsonl")).unwrap();
    assert!(journal.contains("/204?…: 204"), "the request is not in the journal");
    let place = |text: &str| journal.find(text).unwrap_or_else(|| panic!("no {text}"));
    assert!(place("\"hook\":\"after-start\"") < place("\"kind\":\"test-begun\""));
    assert!(bench.path().join("was-given-its-position").exists());
    let mut all = written(&bench);
    all.push(("stdout".into(), ended.stdout));
    all.push(("stderr".into(), ended.stderr));
    for (file, text) in &all {
        for secret in SECRETS {
            assert!(!text.contains(secret), "{secret} stands in {}", file.display());
        }
    }
    let log = std::fs::read_to_string(bench.path().join("run.log")).unwrap();
    assert!(
        log.contains("emergency-stop"),
        "the log does not tell of the hook:\n{log}"
    );
}

#[test]
fn conflict_and_not_to_be_processed_are_understood_and_refused() {
    for code in ["409", "422"] {
        let bench = Bench::new();
        certificates::make(bench.path());
        let fleet = Server::start(bench.path());
        let mut profile = Profile::impatient();
        profile.bench = "tls-ca = \"ca.crt\"\n".to_owned();
        let url = fleet.url(code);
        profile.more = format!(
            "[hooks.emergency-stop]\nhttp = {{ url = \"{url}\" }}\n[hooks.release-emergency-stop]\nhttp = {{ url = \"{url}\" }}\n"
        );
        let (run, port) = bench.start(&profile, &[STOP]);
        let _agv = bench.agv(port, &[]);
        run.end().code(3);
        let test = bench.result()["tests"][0].clone();
        assert_eq!(test["verdict"], "inconclusive", "{test}");
        let reason = test["reason"].as_str().unwrap();
        assert!(
            reason.contains("the device refuses what hook `emergency-stop` asks for"),
            "{reason}"
        );
    }
}

#[test]
fn a_server_that_nobody_vouches_for_and_a_token_that_is_not_there_are_named() {
    let bench = Bench::new();
    certificates::make(bench.path());
    let fleet = Server::start(bench.path());
    let hooks = |headers: &str| {
        let url = fleet.url("204");
        format!(
            "[hooks.emergency-stop]\nhttp = {{ url = \"{url}\"{headers} }}\n[hooks.release-emergency-stop]\nrun = \"true\"\n"
        )
    };
    let mut profile = Profile::impatient();
    profile.more = hooks("");
    let (run, port) = bench.start(&profile, &[STOP]);
    let agv = bench.agv(port, &[]);
    let ended = run.end().code(5);
    assert!(ended.stdout.contains("UnknownIssuer"), "{}", ended.stdout);
    assert!(fleet.asked.lock().unwrap().is_empty());
    drop(agv);
    profile.more = hooks(", headers = { Authorization = \"${env:NO_SUCH_TOKEN}\" }");
    std::fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    bench
        .run(&["run", "--profile", "device.toml", STOP])
        .code(2)
        .says("NO_SUCH_TOKEN");
}

/// A suite, requirements and a hook of one's own.
fn own() -> String {
    format!("{}/fixtures/own", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn a_hook_of_own_suites_is_done_at_the_vehicle_and_judged_by_its_test() {
    const TEST: &str = "sys/key-switch";
    let (bench, own) = (Bench::new(), own());
    let device = started_by_the_harness();
    let profile = Profile {
        device: device.replacen(']', ", \"--hooks\", \"127.0.0.1:{free-port}\"]", 1),
        more: "[hooks.turn-key]\nhttp = { url = \"http://127.0.0.1:{free-port}/hooks/set-mode\", body = '{ \"mode\": \"{to}\" }' }\n"
            .to_owned(),
        ..Profile::default()
    };
    let (run, _) = bench.start(&profile, &["--suites", &own, TEST]);
    run.end().code(0);
    let test = bench.result()["tests"][0].clone();
    assert_eq!(
        (&test["id"], &test["verdict"]),
        (&TEST.into(), &"pass".into()),
        "{test}"
    );
    assert_eq!(bench.journal().matches("\"hook\":\"turn-key\"").count(), 2);
    bench
        .run(&["report", "reports/latest", "--rejudge", "--suites", &own])
        .code(0);
    // The folder is what makes it known.
    bench
        .run(&["run", "--profile", "device.toml", "state/idle"])
        .code(2)
        .says("there is no hook `turn-key`")
        .says("one of suites of your own is known with `--suites`");
    // Whose key switch does nothing is found out.
    let profile = Profile {
        more: "[hooks.turn-key]\nrun = [\"true\"]\n".to_owned(),
        device,
        ..Profile::default()
    };
    let (run, _) = bench.start(&profile, &["--suites", &own, TEST]);
    run.end().code(1);
}

#[test]
fn a_hook_of_own_suites_is_explained_and_listed() {
    let (bench, own) = (Bench::new(), own());
    let explained = bench.run(&["explain", "turn-key", "--suites", &own]).code(0);
    for line in [
        "hook turn-key (role agv)",
        "[hooks.turn-key]",
        "run = [\"./turn-key\", \"{to}\"]",
        "    POST /hooks/turn-key HTTP/1.1",
        "    {\"to\": \"AUTOMATIC\"}",
        "used by     1 test",
    ] {
        assert!(
            explained.stdout.lines().any(|known| known == line),
            "{line}\n{}",
            explained.stdout
        );
    }
    for listing in ["hooks", "language"] {
        bench
            .run(&["list", listing, "--suites", &own])
            .code(0)
            .prints("turn-key");
    }
    bench
        .run(&["validate", "--suites", &own, &format!("{own}/hooks/sys.yaml")])
        .code(0)
        .prints("a file of 1 hook");
    bench.run(&["explain", "turn-key"]).code(2);
}

#[test]
fn mistakes_in_own_hooks_are_named_with_their_place() {
    let bench = Bench::new();
    std::fs::create_dir_all(bench.path().join("own/hooks")).unwrap();
    std::fs::create_dir_all(bench.path().join("own/agv/sys")).unwrap();
    let test = std::fs::read_to_string(format!("{}/agv/sys/keeps-the-number.yaml", own())).unwrap();
    let test = test.replace("SYS-12", "ORD-MSG-01");
    std::fs::write(bench.path().join("own/agv/sys/keeps-the-number.yaml"), test).unwrap();
    let good = std::fs::read_to_string(format!("{}/hooks/sys.yaml", own())).unwrap();
    for (wrong, line, says) in [
        (
            "    effects: [turns-round]\n",
            14,
            "`turns-round` is not known for `effects`",
        ),
        (
            "    undoes: pull-key\n",
            14,
            "there is no hook `pull-key` for a device of role `agv`",
        ),
        (
            "  - hook: set-mode\n    does: Switch.\n",
            14,
            "the hook `set-mode` for a second time",
        ),
    ] {
        std::fs::write(bench.path().join("own/hooks/sys.yaml"), format!("{good}{wrong}")).unwrap();
        bench
            .run(&["run", "--virtual", "--suites", "own", "sys/*"])
            .code(2)
            .says(says)
            .says(&format!("own/hooks/sys.yaml:{line}:"))
            .says("help: ");
    }
}
