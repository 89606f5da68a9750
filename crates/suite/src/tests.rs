//! The loader as a whole, on the suites of `fixtures/good-suites/`.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use proptest::prelude::*;

use super::model::{Extent, From, Purpose, RoutePlace, Section, Verb};
use super::*;
use tck_base::pattern::TermKind;
use tck_pack::Hooks;
use tck_view::StateView;

const CHECKS: [CheckInfo; 1] = [CheckInfo {
    name: "header/id-rises",
    decides: &["HDR-02"],
    arguments: &["topic"],
    needs: &[],
}];

static HOOKS: LazyLock<Hooks> = LazyLock::new(|| Hooks::load(&Assets::of_source_tree().unwrap()).unwrap());

/// The good suites by path, as they would lie below `suites/`.
fn good() -> BTreeMap<String, String> {
    fn gather(folder: &Path, name: &str, files: &mut BTreeMap<String, String>) {
        for entry in std::fs::read_dir(folder).expect("fixtures") {
            let entry = entry.expect("entry");
            let name = format!("{name}/{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() {
                gather(&entry.path(), &name, files);
            } else {
                files.insert(name, std::fs::read_to_string(entry.path()).expect("text"));
            }
        }
    }
    let mut files = BTreeMap::new();
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("fixtures/good-suites");
    gather(&folder, "suites", &mut files);
    files
}

struct World {
    packs: Packs,
    catalogue: Catalogue,
}

impl World {
    fn new() -> Self {
        let assets = Assets::of_source_tree().unwrap();
        Self {
            packs: Packs::load(&assets).expect("packs"),
            catalogue: Catalogue::load(&assets).expect("catalogue"),
        }
    }

    fn load(&self, files: &BTreeMap<String, String>) -> Result<Suites, Vec<Diagnostic>> {
        let vocabulary = PackVocabulary::new(&self.packs, &self.catalogue, &HOOKS);
        let files = files.iter().map(|(path, text)| (path.as_str(), text.as_str()));
        Suites::load_files(files, &vocabulary, &CHECKS)
    }
}

fn rendered(problems: &[Diagnostic]) -> String {
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

fn loaded() -> Suites {
    World::new()
        .load(&good())
        .unwrap_or_else(|problems| panic!("{}", rendered(&problems)))
}

#[test]
fn good_suites_load_without_a_word() {
    let suites = loaded();
    let ids: Vec<_> = suites.tests.iter().map(|test| test.id.as_str()).collect();
    assert_eq!(
        ids,
        [
            "connection/last-will-and-return",
            "dispatch/keeps-going",
            "map/download-enable-delete",
            "order/edge-actions",
            "order/malformed[negative-update]",
            "order/malformed[no-order-id]",
            "order/update-lower-id-refused",
        ]
    );
    assert_eq!(suites.monitors.len(), 2);
}

fn test_of<'a>(suites: &'a Suites, id: &str) -> &'a Test {
    suites.tests.iter().find(|test| test.id == id).expect("the test")
}

#[test]
fn states_are_inlined_with_their_path() {
    let suites = loaded();
    let test = test_of(&suites, "order/update-lower-id-refused");
    let paths: Vec<_> = test.given.iter().map(|step| step.path.as_str()).collect();
    assert_eq!(
        paths,
        [
            "given[0]/idle-on-course[0]/idle[0]",
            "given[0]/idle-on-course[1]/reach[0]"
        ]
    );
    let Verb::Expect(reached) = &*test.given[1].verb else {
        panic!()
    };
    assert_eq!(reached.from, From::Latest);
    let mut variables = Vec::new();
    test.given[1].visit_terms(&mut |term| variables.extend(term.variables()));
    assert_eq!(variables, ["course.a", "time.settle"]);
    assert_eq!(test.given[1].verb_span.text(), "expect: state");
    assert!(test.given[1].span.source.name.ends_with("states/reach.yaml"));
    assert_eq!(
        test.sections().map(|(section, _)| section),
        [Section::Given, Section::Steps, Section::Finally]
    );
}

#[test]
fn the_innermost_state_that_says_so_decides_what_a_step_is_for() {
    let mut files = good();
    let state = |name: &str, purpose: &str, steps: &str| {
        let text = format!("state: {name}\ntitle: A state of somebody\n{purpose}steps:\n{steps}");
        (format!("suites/states/{name}.yaml"), text)
    };
    let wait = "  - expect: state\n    within: 5 s\n";
    files.extend([
        state("mine/plain", "", wait),
        state("mine/patient", "purpose: waits\n", wait),
        state(
            "mine/over",
            "purpose: cancels\n",
            &format!("{wait}  - use: mine/plain\n  - use: mine/patient\n{wait}"),
        ),
    ]);
    let test = files
        .get_mut("suites/agv/order/update-lower-id-refused.yaml")
        .expect("a test");
    *test = test.replace("- use: cancel-order", "- use: mine/over");
    let suites = World::new().load(&files).expect("good suites");
    let test = test_of(&suites, "order/update-lower-id-refused");
    let purposes: Vec<_> = test.finally.iter().map(|step| step.purpose).collect();
    let cancels = Some(Purpose::Cancels);
    assert_eq!(purposes, [cancels, cancels, Some(Purpose::Waits), cancels]);
    assert!(test.given.iter().all(|step| step.purpose.is_none()));
}

#[test]
fn the_need_of_a_course_is_gathered_from_routes_and_variables() {
    let suites = loaded();
    let need = &test_of(&suites, "order/update-lower-id-refused").course;
    assert_eq!(need.nodes, ["a", "b", "c", "d"]);
    let pairs: Vec<_> = need.edges.iter().map(|(from, to)| format!("{from}-{to}")).collect();
    assert_eq!(pairs, ["a-b", "b-c", "c-d"]);
    let need = &test_of(&suites, "order/malformed[no-order-id]").course;
    assert_eq!((need.nodes.as_slice(), need.edges.len()), (&["a".to_owned()][..], 0));
}

#[test]
fn far_is_a_node_without_edges() {
    let mut files = good();
    let path = "suites/agv/order/edge-actions.yaml";
    let text = files[path].replace("horizon: [c]", "horizon: [c, far]");
    files.insert(path.to_owned(), text);
    let suites = World::new().load(&files).expect("suites");
    let need = &test_of(&suites, "order/edge-actions").course;
    assert_eq!(need.nodes, ["a", "b", "c", "far"]);
    assert_eq!(need.edges.len(), 2);
}

#[test]
fn every_row_of_a_table_is_a_test_with_its_values() {
    let suites = loaded();
    let test = test_of(&suites, "order/malformed[negative-update]");
    assert_eq!(test.title, "An order that is of a negative update is not taken over");
    assert_eq!(test.group, "order");
    let Verb::Send(send) = &*test.steps[0].verb else {
        panic!()
    };
    let Some(model::Patch::Merge(patch)) = &send.patch else {
        panic!()
    };
    assert_eq!(
        patch.span.text(),
        "{ orderUpdateId: -1 }",
        "the place is that of the row"
    );
    let requirements: Vec<_> = test.requirements().iter().map(ToString::to_string).collect();
    assert_eq!(requirements, ["ORD-REJ-01"]);
}

#[test]
fn requirements_are_bound_to_the_clause_that_decides_them() {
    let suites = loaded();
    let test = test_of(&suites, "order/update-lower-id-refused");
    let clauses: Vec<_> = test
        .steps
        .iter()
        .flat_map(model::Step::clauses)
        .map(|(id, path)| format!("{id} {path}"))
        .collect();
    assert_eq!(
        clauses,
        [
            "ORD-REJ-17 steps[5].checks",
            "ORD-REJ-12 steps[5].assert",
            "ORD-REJ-14 steps[5].assert",
            "ORD-REJ-10 steps[6].checks",
            "ORD-REJ-11 steps[6].until",
        ]
    );
    let Verb::Always(always) = &*test.steps[6].verb else {
        panic!()
    };
    let Extent::Until(until) = &always.extent else { panic!() };
    assert_eq!(until.topic, "state");
}

#[test]
fn routes_actions_and_faults_arrive_in_the_model() {
    let suites = loaded();
    let test = test_of(&suites, "order/edge-actions");
    let Verb::Send(send) = &*test.steps[0].verb else {
        panic!()
    };
    assert_eq!((send.qos, send.retain), (Some(1), true));
    let route = send.route.as_ref().expect("route");
    assert_eq!(route.from, Some(2));
    assert_eq!(route.actions[0].0, RoutePlace::Node("b".into()));
    assert_eq!(route.actions[0].1[0].name.as_deref(), Some("pick1"));
    assert_eq!(route.actions[1].0, RoutePlace::Edge("a".into(), "b".into()));
    assert!(test.steps[2].spec.is_some());
    let Verb::Send(raw) = &*test.steps[3].verb else {
        panic!()
    };
    assert!(matches!(&raw.raw, Some(model::Raw::Bytes(bytes)) if bytes == b"{}"));
    let Verb::Send(patched) = &*test.steps[5].verb else {
        panic!()
    };
    assert!(matches!(&patched.patch, Some(model::Patch::Operations(term)) if matches!(term.kind, TermKind::List(_))));
}

#[test]
fn a_state_used_for_some_versions_only_hands_its_range_down() {
    let mut files = good();
    let path = "suites/agv/order/update-lower-id-refused.yaml";
    let world = World::new();
    let range = format!("- use: idle-on-course\n    spec: \">={}\"", world.packs.latest().id);
    let narrowed = files[path].replace("- use: idle-on-course", &range);
    files.insert(path.to_owned(), narrowed);
    let suites = world.load(&files).expect("suites");
    let test = test_of(&suites, "order/update-lower-id-refused");
    assert!(test.given.iter().all(|step| step.spec.is_some()));
}

fn codes(files: &BTreeMap<String, String>) -> Vec<&'static str> {
    World::new()
        .load(files)
        .err()
        .unwrap_or_default()
        .iter()
        .map(|problem| problem.code)
        .collect()
}

#[test]
fn files_that_are_no_suites_and_ids_that_are_taken_are_told() {
    let mut files = good();
    files.insert("suites/notes.yaml".into(), String::new());
    files.insert("suites/agv/order/old.yml".into(), String::new());
    files.insert("suites/README.md".into(), "a note".into());
    files.insert("suites/agv/README.md".into(), "a note".into());
    files.insert("suites/requirements/X.yaml".into(), "not ours".into());
    assert_eq!(codes(&files), ["stray-file", "stray-file", "stray-file"]);
    let mut files = good();
    let text = files["suites/master-control/dispatch/keeps-going.yaml"]
        .replace("dispatch/keeps-going", "connection/last-will-and-return");
    files.insert(
        "suites/master-control/connection/last-will-and-return.yaml".into(),
        text,
    );
    assert_eq!(codes(&files), ["duplicate-test"]);
}

#[test]
fn a_test_and_a_monitor_do_not_share_a_name() {
    for name in ["connection/last-will-and-return", "order/malformed"] {
        let mut files = good();
        let text = files["suites/monitors/map/enabled-once.yaml"].replace("map/enabled-once", name);
        files.insert(format!("suites/monitors/{name}.yaml"), text);
        let problems = World::new().load(&files).err().unwrap_or_default();
        let [problem] = problems.as_slice() else {
            panic!("{}", rendered(&problems))
        };
        let text = problem.to_string();
        assert_eq!(problem.code, "monitor-named-as-test");
        assert!(text.contains(&format!("suites/monitors/{name}.yaml:1:1")), "{text}");
        assert!(text.contains(&format!("suites/agv/{name}.yaml")), "{text}");
        assert!(problem.hint.is_some());
    }
}

#[test]
fn two_monitors_do_not_share_a_name() {
    let files = good();
    let twice = files.iter().filter(|(path, _)| path.contains("map/enabled-once"));
    let files = files
        .iter()
        .chain(twice)
        .map(|(path, text)| (path.as_str(), text.as_str()));
    let world = World::new();
    let vocabulary = PackVocabulary::new(&world.packs, &world.catalogue, &HOOKS);
    let problems = Suites::load_files(files, &vocabulary, &CHECKS)
        .err()
        .unwrap_or_default();
    let codes: Vec<_> = problems.iter().map(|problem| problem.code).collect();
    assert_eq!(codes, ["duplicate-monitor"]);
}

#[test]
fn a_check_is_refused_for_a_version_without_the_members_it_needs() {
    let problems = |needs: &'static [Field], spec: &str| {
        let text = format!(
            "monitor: own/ids\ntitle: Ids\nspec: \"{spec}\"\nwhy: Because.\nchecks: [HDR-02]\ncheck: header/id-rises\n"
        );
        let world = World::new();
        let vocabulary = PackVocabulary::new(&world.packs, &world.catalogue, &HOOKS);
        let checks = [CheckInfo { needs, ..CHECKS[0] }];
        let files = [("suites/monitors/own/ids.yaml", text.as_str())];
        Suites::load_files(files.into_iter(), &vocabulary, &checks)
            .err()
            .unwrap_or_default()
    };
    let maps: &[Field] = &[StateView::order_id, StateView::maps];
    assert!(problems(maps, ">=2.1, <3").is_empty());
    let refused = problems(maps, ">=2.0, <3");
    let [refused] = refused.as_slice() else {
        panic!("{}", rendered(&refused));
    };
    assert_eq!(refused.code, "check-without-member");
    let shown = refused.to_string();
    for part in [
        "suites/monitors/own/ids.yaml:6:",
        "`state.maps`",
        "leave that version out",
    ] {
        assert!(shown.contains(part), "{part} in {shown}");
    }
    // Neither version of this program has what 3.0 brings.
    assert_eq!(problems(&[StateView::zone_sets], ">=2.1, <3").len(), 1);
}

#[test]
fn a_mistake_in_a_state_is_told_once_however_often_it_is_used() {
    let mut files = good();
    let path = "suites/states/idle.yaml";
    let text = files[path].replace("nodeStates", "nodeStatez");
    files.insert(path.to_owned(), text);
    assert_eq!(codes(&files), ["unknown-path"]);
    files.insert(path.to_owned(), "state: [".into());
    assert_eq!(codes(&files), ["yaml-syntax"]);
}

#[test]
fn all_mistakes_are_told_at_once_by_file_and_place() {
    let mut files = good();
    let path = "suites/agv/order/update-lower-id-refused.yaml";
    let text = files[path]
        .replace("reviewed: \"2026-11-22, ", "reviewed: \"soon, ")
        .replace("ORD-REJ-17", "ORD-REJ-99")
        .replace("errorLevel: WARNING", "errorLevel: WARN");
    files.insert(path.to_owned(), text);
    assert_eq!(codes(&files), ["review-undated", "unknown-requirement", "bad-literal"]);
}

#[test]
fn one_text_is_loaded_wherever_it_lies() {
    let files = good();
    let world = World::new();
    let vocabulary = PackVocabulary::new(&world.packs, &world.catalogue, &HOOKS);
    let load = |text: &str| {
        let others = files.iter().map(|(path, text)| (path.as_str(), text.as_str()));
        load::load_text("my.yaml", text, others, &vocabulary, &CHECKS)
    };
    assert_eq!(
        load(&files["suites/agv/order/malformed.yaml"])
            .expect("test")
            .tests
            .len(),
        2
    );
    assert_eq!(
        load(&files["suites/monitors/header/id-rises.yaml"])
            .expect("monitor")
            .monitors
            .len(),
        1
    );
    assert!(load(&files["suites/states/idle.yaml"]).is_ok());
    let broken = files["suites/states/idle.yaml"].replace("nodeStates", "nodeStatez");
    assert_eq!(
        load(&broken).expect_err("a state is linted, too")[0].code,
        "unknown-path"
    );
    assert_eq!(load("a: 1").expect_err("nothing")[0].code, "unknown-key");
}

/// Two hundred suites take well under 100 ms when built for release; this only catches a slip in complexity.
#[test]
fn two_hundred_suites_load_quickly() {
    let mut files = good();
    let text = files["suites/agv/order/update-lower-id-refused.yaml"].clone();
    for number in 0..200 {
        let name = format!("order/copy-{number}");
        let copy = text.replace("order/update-lower-id-refused", &name);
        files.insert(format!("suites/agv/{name}.yaml"), copy);
    }
    let world = World::new();
    let begun = std::time::Instant::now();
    let suites = world.load(&files).expect("suites");
    let took = begun.elapsed();
    assert_eq!(suites.tests.len(), 207);
    println!("207 suites in {took:?}");
    assert!(took.as_secs() < 5, "{took:?}");
}

fn mutated(text: &str, edits: &[(u8, usize, usize, usize)]) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for (kind, from, length, to) in edits {
        if bytes.is_empty() {
            break;
        }
        let from = from % bytes.len();
        let end = (from + length % 40).min(bytes.len());
        let to = to % bytes.len();
        let piece = bytes[from..end].to_vec();
        match kind % 3 {
            0 => drop(bytes.drain(from..end)),
            1 => drop(bytes.splice(to..to, piece)),
            _ => {
                let end = (to + piece.len()).min(bytes.len());
                drop(bytes.splice(to..end, piece));
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn no_mutation_of_a_suite_makes_the_loader_panic(
        which in any::<prop::sample::Index>(),
        edits in prop::collection::vec((any::<u8>(), any::<usize>(), any::<usize>(), any::<usize>()), 1..6)
    ) {
        thread_local!(static SET: (World, BTreeMap<String, String>) = (World::new(), good()));
        SET.with(|(world, good)| {
            let mut files = good.clone();
            let path = files.keys().nth(which.index(files.len())).cloned().expect("a path");
            let text = mutated(&files[&path], &edits);
            files.insert(path, text);
            if let Err(problems) = world.load(&files) {
                assert!(!problems.is_empty());
                rendered(&problems);
            }
        });
    }
}
