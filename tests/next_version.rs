//! A protocol version that nobody knows is added as data: a folder of schemas, a column of the catalogue, a test of its own.
//!
//! The version is small. It calls one member otherwise and lacks another, says one word otherwise, switches one feature of the
//! reference vehicle off, and takes one requirement back for one of its own. `DEVELOPING.md` says the same in words
//! ("Add a protocol version").
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

use std::collections::BTreeSet;
use std::path::Path;

use vda5050_tck::checks;
use vda5050_tck::diagnostic::Diagnostic;
use vda5050_tck::judge::Library;
use vda5050_tck::pack::{Assets, ChangeKind, Role};
use vda5050_tck::qualify::decided;
use vda5050_tck::result::RunResult;
use vda5050_tck::run::{Selection, VirtualRun, run_silently};
use vda5050_tck::verdict::Verdict;

/// The allocator of the program: a run is a million small trees.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// The version it is made from, and the new one.
const BEFORE: &str = "3.0";
const NEXT: &str = "3.1";

/// What the new version asks for in the place of `ORD-CANCEL-25`.
const OWN_REQUIREMENT: &str = r#"group: NEXT
chapter: What only the next version asks for
position: 900
requirements:
  - id: NEXT-01
    text: Cancel the order that there is, whatever order cancelOrder names.
    role: agv
    decided: active
    in:
      "3.1": { section: "6.1.3", mood: shall }
    stimulus: Send cancelOrder with a foreign orderId.
    observe: The action turns FINISHED, and nothing of the order is left.
    needs: [layout]
"#;

const OWN_TEST: &str = r#"test: cancel-order/whatever-it-names
title: A cancelOrder that names another order cancels the one there is
device: agv
spec: ">=3.1, <4"
moves: true
why: The next version has given the name of the order another meaning.

given:
  - use: at-decision-point

steps:
  - send: instantActions
    action: cancelOrder
    as: cancel
    with: { orderId: "${run.nowhere}" }
  - action: cancel
    checks: [NEXT-01]
    through: WAITING? -> INITIALIZING? -> RUNNING? -> FINISHED
    within: ${time.drive}
  - expect: state
    title: Nothing is left of it
    from: latest
    checks: [NEXT-01]
    within: ${time.react}
    where: { driving: false, nodeStates: { $empty: true }, edgeStates: { $empty: true } }

finally:
  - use: base-done
  - use: cancel-order
"#;

/// A test that reads a member the new version lacks.
const READS_WHAT_IS_GONE: &str = r#"test: state/current-of-the-battery
title: The current of the battery is shown
device: agv
spec: ">=3.0, <4"
why: It is the member that the next version has no more.

given:
  - use: idle

steps:
  - expect: state
    from: latest
    checks: [STATE-MSG-15]
    within: ${time.statePeriod}
    where: { batteryState: { batteryCurrent: { $present: true } } }
"#;

/// The suites and schemas of the tree, copied to be changed.
struct Tree(tempfile::TempDir);

impl Tree {
    fn copied() -> Self {
        let tree = Self(tempfile::tempdir().expect("a folder"));
        let assets = Assets::of_folder(Path::new(env!("CARGO_MANIFEST_DIR"))).expect("suites and schemas");
        for file in assets.under("") {
            tree.write(&file.path, &file.text);
        }
        tree
    }

    fn read(&self, path: &str) -> String {
        std::fs::read_to_string(self.0.path().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
    }

    fn write(&self, path: &str, text: &str) {
        let path = self.0.path().join(path);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).expect("a file");
    }

    fn remove(&self, path: &str) {
        std::fs::remove_file(self.0.path().join(path)).expect("a file");
    }

    /// Replaces a text that has to be there.
    fn edit(&self, path: &str, from: &str, to: &str) {
        let text = self.read(path);
        assert!(text.contains(from), "{path} has no `{from}`");
        self.write(path, &text.replace(from, to));
    }

    /// The folder of the version before, copied, with the changes of the new one.
    fn add_version(&self) {
        let assets = Assets::of_folder(self.0.path()).expect("the copy");
        for file in assets.under(&format!("schemas/{BEFORE}/")) {
            self.write(&file.path.replacen(BEFORE, NEXT, 1), &file.text);
        }
        let protocol = "schemas/3.1/protocol.toml";
        self.edit(protocol, "id = \"3.0\"", "id = \"3.1\"");
        self.edit(protocol, "version = \"3.0.0\"", "version = \"3.1.0\"");
        self.edit(protocol, "[members.state]\n", "[members.state]\ndriving = \"moving\"\n");
        self.edit("schemas/3.1/state.schema.json", "\"driving\"", "\"moving\"");
        self.edit(protocol, "batteryCurrent = true", "batteryCurrent = false");
        self.edit("schemas/3.1/state.schema.json", "\"batteryCurrent\"", "\"gone\"");
        self.edit(protocol, "cancelByOrderId = true", "cancelByOrderId = false");
        self.edit("schemas/3.1/vocabulary.yaml", "VALIDATION_FAILURE", "MALFORMED_MESSAGE");
    }

    /// A column of the new version in the whole catalogue: what the version before says.
    fn add_column(&self) {
        let assets = Assets::of_folder(self.0.path()).expect("the copy");
        for file in assets.under("suites/requirements/") {
            self.write(&file.path, &with_column(&file.text));
        }
    }

    /// The requirement that the new version takes back, and the one that takes its place.
    fn add_requirement(&self) {
        let path = "suites/requirements/ORD-CANCEL.yaml";
        let text = self.read(path);
        let at = text.find("  - id: ORD-CANCEL-25\n").expect("the requirement");
        let (head, rest) = text.split_at(at);
        let (own, tail) = rest.split_at(rest[1..].find("  - id: ").map_or(rest.len(), |at| at + 1));
        let lines = own.lines().filter(|line| !line.starts_with("      \"3.1\":"));
        let own = lines.flat_map(|line| [line, "\n"]).collect::<String>();
        let own = own.replacen(
            "    stimulus:",
            "    gone:\n      \"3.1\": The name is a note for people.\n    stimulus:",
            1,
        );
        self.write(path, &format!("{head}{own}{tail}"));
        self.write("suites/requirements/NEXT.yaml", OWN_REQUIREMENT);
        self.write("suites/agv/cancel-order/whatever-it-names.yaml", OWN_TEST);
    }

    /// The test of what is taken back ends before the new version.
    fn narrow(&self) {
        let path = "suites/agv/cancel-order/another-by-name.yaml";
        self.edit(path, "spec: \">=3.0, <4\"", "spec: \">=3.0, <3.1\"");
    }

    /// As the program reads a folder, with every rule of the lint.
    fn load(&self) -> Result<Library, Vec<Diagnostic>> {
        Library::load(Assets::of_folder(self.0.path()).expect("the copy"), checks::REGISTRY)
    }

    fn loaded(&self) -> Library {
        self.load().unwrap_or_else(|all| {
            for diagnostic in &all {
                println!("{}", diagnostic.render(false));
            }
            panic!("{} diagnostics", all.len())
        })
    }
}

/// A text of the catalogue in which every entry of the version before stands for the new one as well, without what had changed
/// in the version before.
fn with_column(text: &str) -> String {
    let key = format!("      \"{BEFORE}\":");
    let mut written = String::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if !line.starts_with(&key) {
            written.push_str(&format!("{line}\n"));
            continue;
        }
        let mut entry = vec![line];
        while let Some(below) = lines.next_if(|line| line.starts_with("       ") || line.is_empty()) {
            entry.push(below);
        }
        for line in unchanged(&entry) {
            written.push_str(&format!(
                "{}\n",
                line.replacen(BEFORE, NEXT, usize::from(line.starts_with(&key)))
            ));
        }
        for line in entry {
            written.push_str(&format!("{line}\n"));
        }
    }
    written
}

/// The lines of an entry but those that say what had changed.
fn unchanged<'t>(entry: &[&'t str]) -> Vec<&'t str> {
    let mut left_out = false;
    let keeps = |line: &&&str| {
        let is_key = line.len() - line.trim_start().len() <= 8;
        let says_change = line.trim_start().starts_with("change:") || line.trim_start().starts_with("delta:");
        left_out = if is_key { says_change } else { left_out };
        !left_out
    };
    entry.iter().filter(keeps).copied().collect()
}

/// What a run of these tests by the new version finds.
fn run(library: &Library, tests: &[&str], faults: &[&str]) -> RunResult {
    let pack = library.rules.packs.get(NEXT).expect("the new version").clone();
    let mut request = VirtualRun::of(library, &pack);
    let chosen = library.tests(Role::Agv, &pack.id).into_iter();
    let chosen: Vec<_> = chosen
        .filter(|test| tests.contains(&test.id.split('[').next().unwrap_or_default()))
        .collect();
    let ids: BTreeSet<&str> = chosen.iter().filter_map(|test| test.id.split('[').next()).collect();
    assert_eq!(
        ids,
        tests.iter().copied().collect(),
        "all of them are tests of the new version"
    );
    request.tests = Selection::some(chosen);
    request.faults = faults.iter().map(|&fault| fault.to_owned()).collect();
    run_silently(library, &pack, request).expect("a run").result
}

/// The worst that is decided about a requirement.
fn worst(result: &RunResult, requirement: &str) -> Option<Verdict> {
    let all = decided(result).into_iter();
    all.filter(|(decider, _)| decider.requirement == requirement)
        .map(|(_, verdict)| verdict)
        .max()
}

/// Tests of 2.x or of the version before that say nothing of the new one.
const SHARED: [&str; 7] = [
    "order-acceptance/node-by-node",
    "order-update/base-extended",
    "order-rejection/malformed",
    "order-rejection/lower-update-id",
    "cancel-order/at-decision-point",
    "cancel-order/update-afterwards",
    "instant-actions/pause-at-rest",
];

#[test]
fn a_version_that_nobody_knows_is_added_as_data() {
    let tree = Tree::copied();
    tree.add_version();
    tree.add_column();
    tree.add_requirement();

    tree.narrow();

    // A test that reads a member the new version lacks is refused.
    let reads = "suites/agv/state/current-of-the-battery.yaml";
    tree.write(reads, READS_WHAT_IS_GONE);
    let refused = tree.load().map(|_| ()).expect_err("a member is gone");
    assert!(refused.iter().any(|one| one.code == "unknown-path"), "{refused:#?}");
    assert!(
        refused.iter().all(|one| one.render(false).contains(reads)),
        "{refused:#?}"
    );
    tree.remove(reads);

    let library = tree.loaded();
    let (packs, catalogue) = (&library.rules.packs, &library.rules.catalogue);
    let (before, next) = (packs.get(BEFORE).expect("before"), packs.get(NEXT).expect("next"));
    let changes = catalogue.changes(packs, before, next);
    let of_kind = |kind: ChangeKind| {
        let all = changes.iter().filter(move |change| change.kind == kind);
        all.filter_map(|change| Some(change.requirement()?.id.to_string()))
            .collect::<Vec<_>>()
    };
    assert_eq!(of_kind(ChangeKind::Gone), ["ORD-CANCEL-25"]);
    assert_eq!(of_kind(ChangeKind::New), ["NEXT-01"]);
    assert_eq!(of_kind(ChangeKind::Same).len() + 2, changes.len());

    // The shared tests hold the vehicle to the new version, and its own requirement is decided.
    let all: Vec<&str> = SHARED.into_iter().chain(["cancel-order/whatever-it-names"]).collect();
    let result = run(&library, &all, &[]);
    for (decider, verdict) in decided(&result) {
        assert!(verdict <= Verdict::Warning, "{} {decider}", verdict.word());
    }
    for requirement in [
        "ORD-06",
        "ORD-FLOW-09",
        "ORD-REJ-02",
        "ORD-REJ-10",
        "ORD-CANCEL-07",
        "HDR-03",
        "NEXT-01",
    ] {
        assert_eq!(worst(&result, requirement), Some(Verdict::Pass), "{requirement}");
    }
    // It speaks the new version indeed: its states are judged by the schema that calls the member otherwise.
    assert_eq!(worst(&result, "STATE-MSG-01"), Some(Verdict::Pass));

    // Faults are found in it, by what is shared and by its own.
    let own = run(&library, &["cancel-order/whatever-it-names"], &["cancel-leaves-nodes"]);
    assert_eq!(worst(&own, "NEXT-01"), Some(Verdict::Fail));
    let shared = run(
        &library,
        &["order-rejection/lower-update-id"],
        &["outdated-update-taken-over"],
    );
    assert_eq!(worst(&shared, "ORD-REJ-10"), Some(Verdict::Fail));
}

#[test]
fn a_vehicle_that_behaves_as_the_version_before_fails_what_is_new() {
    let tree = Tree::copied();
    tree.add_version();
    tree.add_column();
    tree.add_requirement();
    let another = "suites/agv/cancel-order/another-by-name.yaml";
    tree.edit(another, "spec: \">=3.0, <4\"", "spec: \">=3.0, <3.1\"");
    tree.edit(
        "schemas/3.1/protocol.toml",
        "cancelByOrderId = false",
        "cancelByOrderId = true",
    );
    let result = run(&tree.loaded(), &["cancel-order/whatever-it-names"], &[]);
    assert_eq!(worst(&result, "NEXT-01"), Some(Verdict::Fail));
}

/// Its range is wide, and some of what it decides is still asked for: only a run tells.
#[test]
fn a_test_of_what_is_taken_back_shows_when_it_is_run_with_the_reference_vehicle() {
    let tree = Tree::copied();
    tree.add_version();
    tree.add_column();
    tree.add_requirement();
    let result = run(&tree.loaded(), &["cancel-order/another-by-name"], &[]);
    assert_eq!(worst(&result, "ORD-CANCEL-18"), Some(Verdict::Fail));
    assert_eq!(
        worst(&result, "ORD-CANCEL-25"),
        None,
        "the new version does not have it"
    );
}
