//! `validate`, `list` and `explain`.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::bench::{Bench, QUICK};
use crate::tool::run;

fn fixture(name: &str) -> String {
    format!("{}/fixtures/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn every_kind_of_good_file_is_told_by_its_content() {
    let bench = Bench::new();
    bench.run(&["run", "--virtual", QUICK]).code(0);
    let result = bench.bundle().join("result.json").display().to_string();
    let suite = format!("{}/suites/agv/instant-actions/unknown.yaml", env!("CARGO_MANIFEST_DIR"));
    for (file, what) in [
        (fixture("messages/2.1/good/state-idle.json"), "a valid state message"),
        (fixture("messages/2.0/good/order-full.json"), "a valid order message"),
        (
            fixture("messages/2.1/good/connection-will.json"),
            "a valid connection message",
        ),
        (fixture("profiles/good/minimal.toml"), "valid profile: ACME 0001"),
        (fixture("layouts/hall.lif.json"), "a layout with"),
        (suite, "test"),
        (result, "a result of 1 test"),
    ] {
        let ended = run(&["validate", &file]).code(0).prints(what);
        // What deserves a warning stands before it, what is left out of a layout below it.
        assert!(
            ended.stdout.lines().any(|line| line.starts_with(&file)),
            "{}",
            ended.stdout
        );
    }
}

#[test]
fn every_kind_of_bad_file_is_2_and_its_fault_is_named() {
    let bench = Bench::new();
    let state = fs::read_to_string(fixture("messages/2.1/good/state-idle.json")).unwrap();
    let write = |name: &str, text: &[u8]| {
        fs::write(bench.path().join(name), text).unwrap();
        name.to_owned()
    };
    for (file, what) in [
        (
            write("mode.json", state.replace("AUTOMATIC", "AUTOMATISCH").as_bytes()),
            "operatingMode",
        ),
        (write("cut.json", &state.as_bytes()[..100]), "cut.json"),
        (
            write("version.json", state.replace("2.1.0", "9.9.9").as_bytes()),
            "9.9.9 is not known to this program (2.0.0, 2.1.0, 3.0.0)",
        ),
        (write("other.json", b"{\"hello\": 1}"), "--topic"),
        (write("binary", b"\xff\xfe\x00"), "UTF-8"),
        (write("empty.json", b""), "empty.json"),
        (
            write("layout.json", b"{\"metaInformation\": {}, \"layouts\": 3}"),
            "layout",
        ),
        (
            write("result.json", b"{\"format\": \"vda5050-tck.result/1\"}"),
            "result",
        ),
        (fixture("profiles/bad/unknown-key.toml"), "unknown-key.toml:"),
        (fixture("bad-suites/unknown-topic.yaml"), "unknown-topic.yaml:"),
        ("nowhere.json".to_owned(), "nowhere.json"),
    ] {
        let ended = bench.run(&["validate", &file]).code(2);
        let said = format!("{}{}", ended.stdout, ended.stderr);
        assert!(said.contains(what), "{file}: `{what}` is not in\n{said}");
    }
}

#[test]
fn of_several_files_every_one_is_checked() {
    let good = fixture("messages/2.1/good/state-idle.json");
    let bad = fixture("profiles/bad/unknown-key.toml");
    let ended = run(&["validate", &bad, &good, "--format", "json"]).code(2);
    let lines: Vec<Value> = ended
        .stdout
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let ok: Vec<_> = lines
        .iter()
        .map(|line| (line["file"].as_str().unwrap(), line["ok"].as_bool().unwrap()))
        .collect();
    assert!(
        ok.contains(&(bad.as_str(), false)) && ok.contains(&(good.as_str(), true)),
        "{ok:?}"
    );
}

#[test]
fn what_there_is_can_be_listed() {
    for (what, some) in [
        ("tests", "order-rejection/lower-update-id"),
        ("requirements", "ORD-REJ-03"),
        ("coverage", "not testable"),
        ("monitors", "state/remaining-route"),
        ("faults", "outdated-update-taken-over"),
        ("hooks", "power-cycle"),
    ] {
        let text = run(&["list", what]).code(0).prints(some);
        assert_eq!(text.stderr, "");
        let data = run(&["list", what, "--format", "json"]).code(0);
        assert!(data.stdout.lines().count() >= 1);
        for line in data.stdout.lines() {
            assert!(serde_json::from_str::<Value>(line).unwrap().is_object(), "{line}");
        }
    }
    run(&["list", "test"]).code(2);
}

#[test]
fn a_list_is_of_one_version_and_one_side() {
    let of = |arguments: &[&str]| run(&[&["list", "requirements"], arguments].concat()).code(0).stdout;
    let (all, old) = (of(&[]), of(&["--protocol", "2.0"]));
    assert!(all.contains("MAP-11") && !old.contains("MAP-11"), "maps came with 2.1");
    let agv = of(&["--role", "agv"]);
    assert!(agv.lines().count() < all.lines().count());
}

#[test]
fn hooks_are_listed_with_what_to_do() {
    insta::assert_snapshot!(run(&["list", "hooks"]).code(0).stdout);
}

#[test]
fn the_language_of_suites_is_listed_as_far_as_the_program_knows_it() {
    let schema = fs::read_to_string(format!("{}/schemas/suite.schema.json", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let schema: Value = serde_json::from_str(&schema).unwrap();
    let lines = run(&["list", "language", "--format", "json"]).code(0).stdout;
    let all: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let has = |part: &str, of: &str, name: &str| {
        let mut all = all.iter();
        all.any(|one| one["part"] == part && one["of"] == of && one["name"] == name)
    };
    let mut keys = 0;
    for (name, definition) in schema["$defs"].as_object().unwrap() {
        let verb = name.strip_prefix("step-");
        let (part, of) = match (verb, name.as_str()) {
            (Some(verb), _) => ("Steps", verb),
            (None, "test" | "state" | "monitor") => ("Files", name.as_str()),
            (None, "pattern") => ("Patterns", ""),
            _ => ("Parts", name.as_str()),
        };
        for key in definition["properties"]
            .as_object()
            .into_iter()
            .flat_map(serde_json::Map::keys)
        {
            assert!(has(part, of, key), "{part}, {of}: {key} is missing");
            keys += 1;
        }
    }
    assert!(keys > 120, "{keys} keys");
    for one in &all {
        // A member of the harness's own topics is described by its kind.
        let is_told = one["doc"].as_str().is_some_and(|doc| !doc.is_empty()) || one["part"] == "Topics";
        assert!(
            is_told || one["form"].as_str().is_some_and(|form| !form.is_empty()),
            "{one}"
        );
    }
    for (part, name) in [
        ("Variables", "time.react"),
        ("Variables", "vda.error.outdatedUpdate"),
        ("Topics", "mqtt/connect: keepAlive"),
        ("Named checks", "state/remaining-route"),
        ("Hooks", "power-cycle"),
        ("Commands for mock vehicles", "reset"),
    ] {
        assert!(
            all.iter().any(|one| one["part"] == part && one["name"] == name),
            "{part}: {name}"
        );
    }
    let page = run(&["list", "language", "--page"]).code(0).stdout;
    // A link leads to a heading of the page.
    let headings: Vec<String> = page
        .lines()
        .filter(|line| line.starts_with('#'))
        .map(|line| line.trim_start_matches('#').trim().to_lowercase().replace(' ', "-"))
        .collect();
    for link in page.split("](#").skip(1).filter_map(|rest| rest.split(')').next()) {
        assert!(headings.iter().any(|heading| heading == link), "#{link} leads nowhere");
    }
    // Every row of a table has as many cells as its head.
    let cells = |line: &str| line.replace("\\|", "").matches('|').count();
    let mut head = 0;
    for line in page.lines() {
        match line.starts_with('|') {
            true if head == 0 => head = cells(line),
            true => assert_eq!(cells(line), head, "{line}"),
            false => head = 0,
        }
    }
}

#[test]
fn a_requirement_is_explained_with_what_decides_it() {
    insta::assert_snapshot!(run(&["explain", "ORD-REJ-03"]).code(0).stdout);
}

#[test]
fn a_ruling_is_explained_with_its_reason_the_other_reading_and_the_place_in_the_text() {
    run(&["explain", "ORD-REJ-01"])
        .code(0)
        .prints("https://github.com/VDA5050/VDA5050/blob/2.1.0/VDA5050_EN.md#6641-vehicle-gets-a-malformed-new-order")
        .prints("because ")
        .prints("or else ");
    let told = run(&["explain", "ORD-REJ-01", "--format", "json"]).code(0).stdout;
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert!(told["versions"]["2.1"]["link"].as_str().unwrap().contains("#6641-"));
    assert!(told["because"].is_string() && told["otherwise"].is_string());
}

#[test]
fn everything_that_has_a_name_is_explained() {
    for (name, what) in [
        ("order-rejection/lower-update-id", "decides"),
        ("order-rejection/unreadable", "cases          3"),
        ("order-rejection/unreadable[empty]", "order-rejection/unreadable"),
        ("state/remaining-route", "STATE-12"),
        ("outdated-update-taken-over", "ORD-REJ-10"),
        ("power-cycle", "hook power-cycle"),
        ("device.node-bound", "nodes only"),
    ] {
        run(&["explain", name]).code(0).prints(what);
    }
    run(&["explain", "power-cylce"])
        .code(2)
        .says("did you mean `power-cycle`?");
    let ended = run(&["explain", "\u{1b}[2Jxyzzyxyzzy"]).code(2);
    assert!(!ended.stderr.contains('\u{1b}'));
}

#[test]
fn help_is_no_mistake() {
    let ended = run(&["--help"]).code(0).prints("Exit codes:");
    assert_eq!(ended.stderr, "");
    run(&["--version"]).code(0).prints("vda5050-tck ");
    run(&[]).code(2);
    assert!(Path::new(env!("CARGO_BIN_EXE_vda5050-tck")).exists());
}
