//! What layouts and courses have to hold.

use std::path::Path;
use std::sync::Arc;

use proptest::prelude::*;

use super::*;
use tck_base::diagnostic::{Diagnostic, Source};
use tck_pack::{Assets, Hooks};
use tck_profile::{SampleAction, SampleActions};

fn fixture(name: &str) -> Arc<Source> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join("fixtures/layouts")
        .join(name);
    Source::new(name, std::fs::read_to_string(path).expect("fixture"))
}

fn hall() -> Layout {
    let hall = Layout::from_lif(&fixture("hall.lif.json"), Some("ACME.Carrier"));
    hall.expect("a layout").fitted(&Unheard)
}

fn one_way_loop() -> Layout {
    Layout::from_lif(&fixture("one-way-loop.lif.json"), None).expect("a layout")
}

/// `a-b b-c` with further names after a blank.
fn need(text: &str) -> CourseNeed {
    let mut need = CourseNeed::default();
    for word in text.split_whitespace() {
        let names: Vec<String> = word.split('-').map(str::to_owned).collect();
        for name in &names {
            if !need.nodes.contains(name) {
                need.nodes.push(name.clone());
            }
        }
        need.edges
            .extend(names.windows(2).map(|pair| (pair[0].clone(), pair[1].clone())));
    }
    need
}

fn on(id: &str) -> Standing {
    Standing::Node(id.to_owned())
}

fn assert_satisfies(course: &Course, need: &CourseNeed, layout: &Layout, start: &str) {
    assert_eq!(course.node("a").map(|node| node.id.as_str()), Some(start));
    let mut ids: Vec<&str> = course.nodes().map(|(_, node)| node.id.as_str()).collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), course.nodes().count(), "different names are different nodes");
    assert!(need.nodes.iter().all(|name| course.node(name).is_some()));
    for (from, to) in &need.edges {
        let edge = course.edge(from, to).expect("an edge for the pair");
        assert_eq!(Some(edge), layout.edge(&edge.start, &edge.end));
        assert_eq!(edge.start, course.node(from).expect("start").id);
        assert_eq!(edge.end, course.node(to).expect("end").id);
    }
}

#[test]
fn every_node_of_the_built_in_floor_can_start_every_usual_course() {
    let layout = Layout::built_in();
    let needs = [
        "a",
        "a b",
        "a far",
        "a-b",
        "a-b-a",
        "a-b-c",
        "a-b-c-d",
        "a-b-c-d-e",
        "a-b-c-d-e-f",
        "a-b-c-d-e-f far",
        "a-b-c-a",
        "a-b-c-d-a",
        "a-b-c-d-e-a",
        "a-b-c-d-e-f-a",
        "a-b-c-d-e-d-c-b-a",
        "a-b-c b-d",
        "a-b-c b-d-e",
        "a-b a-c a-d",
        "a-b-c-a a-d-b",
        "b-a c-a",
        "a-b c-d far",
    ];
    for node in layout.nodes().filter(|node| node.map_id == BUILT_IN_MAP) {
        for text in needs {
            let need = need(text);
            let course = layout.assign(&need, &on(&node.id)).expect(text);
            assert_satisfies(&course, &need, &layout, &node.id);
            if let Some(far) = course.node(FAR) {
                assert!(course.edge(HERE, FAR).is_none(), "{} is next to {}", far.id, node.id);
            }
        }
    }
}

/// `hall` with a pick on P1 and a drop on the edge to it.
fn stations(layout: Layout) -> Layout {
    let action = |node: Option<&str>, edge: Option<&str>| SampleAction {
        node: node.map(str::to_owned),
        edge: edge.map(str::to_owned),
        ..SampleAction::plain("x")
    };
    layout.with_stations(&SampleActions(
        [
            ("pick", action(Some("P1"), None)),
            ("edge-drop", action(None, Some("H3-P1"))),
            ("lift", action(Some("U1"), None)),
            ("drop", action(Some("P9"), None)),
        ]
        .into(),
    ))
}

/// The nodeIds a way leads over, from `start` on.
fn way(layout: &Layout, start: &str, from: &str, to: &str) -> Result<Vec<String>, CourseError> {
    let need = CourseNeed {
        nodes: vec![from.to_owned(), to.to_owned()],
        ways: vec![(from.to_owned(), to.to_owned())],
        ..CourseNeed::default()
    };
    let course = layout.assign(&need, &on(start))?;
    let names = course.way(from, to).expect("a way");
    let mut last = from;
    for name in names {
        assert!(course.edge(last, name).is_some(), "{last}-{name}");
        last = name;
    }
    Ok(names
        .iter()
        .map(|name| course.node(name).expect("a node").id.clone())
        .collect())
}

#[test]
fn a_way_leads_to_a_station_however_far_it_is() {
    let layout = stations(hall());
    assert_eq!(
        way(&layout, "H6", "a", "pick").expect("a way"),
        ["H5", "H4", "H3", "P1"]
    );
    assert_eq!(way(&layout, "H3", "a", "pick").expect("a way"), ["P1"]);
    assert!(
        way(&layout, "P1", "a", "pick").expect("a way").is_empty(),
        "it is there already"
    );
    assert_eq!(
        way(&layout, "P1", "a", "edgeDrop").expect("a way"),
        ["H3", "P1"],
        "the edge has to be driven"
    );
    assert_eq!(way(&layout, "H3", "pick", "a").expect("a way"), ["H3"]);
}

#[test]
fn a_station_that_cannot_be_reached_is_said_with_its_setting() {
    let layout = stations(hall());
    let error = |to: &str| way(&layout, "H1", "a", to).expect_err("no way").to_string();
    assert_eq!(
        error("drop"),
        "the place of `device.drop` cannot be used: there is no node \"P9\" in the layout; it has H1, H2, H3, H4, H5, H6, P1, U1"
    );
    assert!(error("lift").ends_with("node \"U1\" is on map \"upper-floor\", and the vehicle on \"hall\""));
    assert!(error("failingPick").ends_with("it is not set"));
    let apart = one_way_loop().with_stations(&SampleActions(
        [(
            "pick",
            SampleAction {
                node: Some("L2".into()),
                ..SampleAction::plain("pick")
            },
        )]
        .into(),
    ));
    let no_way = way(&apart, "E1", "a", "pick").expect_err("a dead end");
    assert_eq!(
        no_way,
        CourseError::NoWay {
            from: "E1".into(),
            to: "L2".into()
        }
    );
}

#[test]
fn other_names_keep_away_from_stations() {
    let layout = stations(hall());
    let need = CourseNeed {
        ways: vec![("b".into(), "pick".into())],
        ..need("a-b pick")
    };
    let course = layout.assign(&need, &on("P1")).expect("a course");
    assert_eq!(
        course.node("a"),
        course.node("pick"),
        "where it stands may be the station"
    );
    assert_eq!(course.node("b").map(|node| node.id.as_str()), Some("H3"));
}

#[test]
fn of_several_courses_the_shortest_is_taken_and_always_the_same() {
    let layout = Layout::built_in();
    let need = need("a-b-c-d");
    let course = layout.assign(&need, &on("B2")).expect("a course");
    let length: f64 = need
        .edges
        .iter()
        .map(|(from, to)| {
            let end = course.node(to).expect("end");
            course.node(from).expect("start").distance(end.x, end.y)
        })
        .sum();
    assert!((length - 6.0).abs() < 1e-9, "no diagonal: {length}");
    assert_eq!(course, layout.assign(&need, &on("B2")).expect("a course"));
}

#[test]
fn a_layout_gives_its_vehicle_type_what_it_may_drive_on() {
    let layout = hall();
    let ids: Vec<&str> = layout.nodes().map(|node| node.id.as_str()).collect();
    assert_eq!(ids, ["H1", "H2", "H3", "H4", "H5", "H6", "P1", "U1"]);
    assert!(layout.node("P1").is_some_and(|node| node.station));
    assert!(layout.edge("H1", "H5").is_none(), "for loaded vehicles only");
    let edge = layout.edge("H1", "H2").expect("an edge");
    assert_eq!(edge.max_speed, Some(1.2));
    assert_eq!(edge.orientation_type.as_deref(), Some("TANGENTIAL"));
    insta::assert_snapshot!(layout.left_out().join("\n"), @r"
    node G1 is not for this vehicle type
    edge H4-G1 is not for this vehicle type
    edge H1-H5 is not for an empty vehicle
    edge H1-U1 leads to another map
    node W1 demands the action openGate: the factsheet of the vehicle has to list it
    edge H6-W1 leads to or from a node the vehicle may not use
    ");
}

#[test]
fn a_course_goes_round_stations_where_it_can() {
    let course = hall().assign(&need("a-b"), &on("H3")).expect("a course");
    assert_ne!(course.node("b").map(|node| node.id.as_str()), Some("P1"));
    let course = hall()
        .assign(&need("a-b a-c a-d"), &on("H3"))
        .expect("a course that needs the station");
    assert_eq!(course.node("d").map(|node| node.id.as_str()), Some("P1"));
}

#[test]
fn a_course_from_which_there_is_a_way_back_is_preferred() {
    let course = one_way_loop().assign(&need("a-b"), &on("L1")).expect("a course");
    assert_eq!(
        course.node("b").map(|node| node.id.as_str()),
        Some("L2"),
        "E1 is nearer, but a dead end"
    );
    let course = one_way_loop().assign(&need("a-b a-c"), &on("L1")).expect("a course");
    assert_eq!(course.node("c").map(|node| node.id.as_str()), Some("L2"));
}

#[test]
fn what_the_floor_cannot_give_is_said() {
    let layout = one_way_loop();
    let error = layout.assign(&need("a-b-a"), &on("L1")).expect_err("one-way");
    assert!(matches!(error, CourseError::Unsatisfiable { nodes: 2, .. }));
    assert_eq!(
        error.to_string(),
        "no 2 nodes of the layout from \"L1\" on are joined as the test asks (a-b, b-a)"
    );
    assert!(layout.assign(&need("a-b"), &on("E1")).is_err(), "a dead end");
    assert!(layout.assign(&need("a-a"), &on("L1")).is_err());
    let hint = layout
        .assign(&need("a"), &on("L11"))
        .expect_err("no such node")
        .to_string();
    assert!(hint.contains("did you mean"), "{hint}");
}

#[test]
fn a_far_node_that_is_not_there_is_no_course() {
    let two = hall().only(&["H1".into(), "H2".into()]).expect("nodes");
    assert!(two.assign(&need("a-b"), &on("H1")).is_ok());
    assert!(two.assign(&need("a-b far"), &on("H1")).is_err());
}

#[test]
fn a_vehicle_near_a_node_stands_on_it() {
    let layout = hall();
    let at = |map: &str, x: f64, y: f64| {
        let standing = Standing::Pose {
            map: map.to_owned(),
            x,
            y,
        };
        layout.standing(&standing).map(|node| node.id.clone())
    };
    assert_eq!(at("hall", 3.1, 0.3), Ok("H2".to_owned()));
    assert_eq!(at("upper-floor", 0.1, 0.0), Ok("U1".to_owned()));
    let error = at("hall", 4.5, 0.0).expect_err("in between").to_string();
    assert!(error.ends_with("the nearest node, \"H2\", is 1.50 m away"), "{error}");
    assert!(at("cellar", 0.0, 0.0).is_err() && at("hall", f64::NAN, 0.0).is_err());
}

#[test]
fn a_course_stays_on_the_map_where_the_vehicle_stands() {
    let course = hall().assign(&need("a b c d e f"), &on("H1")).expect("a course");
    assert!(course.nodes().all(|(_, node)| node.map_id == "hall"));
}

#[test]
fn an_allow_list_and_a_speed_cap_restrict_the_layout() {
    let layout = hall()
        .only(&["H1".into(), "H2".into(), "H3".into()])
        .expect("nodes")
        .slower_than(0.5);
    assert_eq!(layout.nodes().count(), 3);
    assert_eq!(layout.edges().count(), 4);
    assert!(layout.edges().all(|edge| edge.max_speed == Some(0.5)));
    assert!(matches!(
        hall().only(&["H9".into()]),
        Err(CourseError::UnknownNode { .. })
    ));
}

#[test]
fn bindings_give_ids_as_text_and_the_rest_below_nodes_and_edges() {
    let course = hall().assign(&need("a-b"), &on("H1")).expect("a course");
    let bindings = course.bindings();
    assert_eq!(bindings["a"], "H1");
    assert_eq!(bindings["b"], "H2");
    assert_eq!(bindings["a-b"], "H1-H2");
    assert_eq!(bindings["nodes"]["b"]["x"], 3.0);
    assert_eq!(bindings["nodes"]["a"]["mapId"], "hall");
    assert_eq!(bindings["edges"]["a-b"]["maxSpeed"], 1.2);
    assert_eq!(bindings["edges"]["a-b"]["heading"], 0.0);
    assert_eq!(bindings["edges"]["a-b"]["back"], std::f64::consts::PI);
}

#[test]
fn a_huge_floor_is_given_up_rather_than_searched_for_ever() {
    let node = |at: u32| Node {
        id: format!("n{at}"),
        map_id: "m".into(),
        x: f64::from(at),
        y: 0.0,
        theta: None,
        deviation_xy: None,
        deviation_theta: None,
        station: false,
        demands: Vec::new(),
    };
    // Two halves, each joined completely, with ways across from a to b only: a six-loop through both is not possible.
    let nodes: Vec<Node> = (0..60).map(node).collect();
    let mut edges = Vec::new();
    for from in 0..60 {
        for to in 0..60 {
            if from != to && (from < 30 || to >= 30) {
                edges.push(Edge {
                    id: format!("{from}-{to}"),
                    start: format!("n{from}"),
                    end: format!("n{to}"),
                    ..Edge::default()
                });
            }
        }
    }
    edges.retain(|edge| edge.end != "n0");
    let layout = Layout::assemble(nodes, edges, Vec::new());
    let result = layout.assign(&need("a-b-c-d-e-f-a"), &on("n0"));
    assert_eq!(result, Err(CourseError::GivenUp));
}

fn layout_of(profile: &str) -> Result<Option<Layout>, Vec<Diagnostic>> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("fixtures/profiles/good");
    let hooks = Hooks::load(&Assets::of_source_tree().expect("suites")).expect("hooks");
    let effective = tck_profile::check(&Source::new("device.toml", profile), &folder, &hooks).expect("a profile");
    Layout::of_profile(&effective.profile)
}

#[test]
fn a_profile_names_its_layout_its_nodes_and_its_speed() {
    let hall = "[layout]\nlif = \"../../layouts/hall.lif.json\"\nvehicle-type = \"ACME.Carrier\"\n";
    let layout = layout_of(&format!(
        "{hall}allow-list = [\"H1\", \"H2\"]\n[motion]\nmax-speed = 0.4\n"
    ));
    let layout = layout.expect("readable").expect("a layout");
    assert_eq!(layout.nodes().count(), 2);
    assert_eq!(layout.edge("H1", "H2").and_then(|edge| edge.max_speed), Some(0.4));

    assert_eq!(layout_of("").expect("nothing to read"), None);
    let wrong = layout_of(&format!("{hall}allow-list = [\"H11\"]\n")).expect_err("no such node");
    assert!(wrong[0].title.ends_with("did you mean `H1`?"), "{}", wrong[0].title);
    let wrong = layout_of("[layout]\nlif = \"nowhere.json\"\n").expect_err("no such file");
    assert_eq!(wrong[0].code, "unreadable");
}

#[test]
fn the_short_list_of_a_profile_is_a_layout() {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("fixtures/profiles/good/program.toml");
    let layout = layout_of(&std::fs::read_to_string(file).expect("fixture"))
        .expect("good")
        .expect("a layout");
    assert_eq!(layout.nodes().count(), 3);
    let need = need("a-b-c-b-a");
    let course = layout.assign(&need, &on("n1")).expect("a course");
    assert_satisfies(&course, &need, &layout, "n1");
    assert_eq!(course.bindings()["nodes"]["b"]["allowedDeviationXY"], 0.3);
}

fn wrong(from: &str, to: &str) -> String {
    let source = fixture("hall.lif.json");
    assert!(source.text.contains(from), "{from}");
    let source = Source::new("hall.lif.json", source.text.replacen(from, to, 1));
    let wrong = Layout::from_lif(&source, Some("ACME.Carrier")).expect_err("refused");
    let shown: Vec<String> = wrong.iter().map(Diagnostic::to_string).collect();
    shown.join("\n")
}

#[test]
fn a_layout_that_looks_wrong_is_refused_at_its_node_or_edge() {
    let mistakes = [
        ("degrees", "\"theta\": 1.5708", "\"theta\": 90.0"),
        ("millimetres", "\"x\": 3, \"y\": 0", "\"x\": 30000, \"y\": 0"),
        (
            "no-map",
            "\"mapId\": \"hall\", \"nodePosition\": {\"x\": 6, \"y\": 0}",
            "\"nodePosition\": {\"x\": 6, \"y\": 0}",
        ),
        ("two-nodes", "\"nodeId\": \"H2\"", "\"nodeId\": \"H1\""),
        ("edge-to-nowhere", "\"endNodeId\": \"H2\"", "\"endNodeId\": \"H22\""),
        ("no-speed", "\"maxSpeed\": 0.3", "\"maxSpeed\": 0"),
        ("kilometres-per-hour", "\"maxSpeed\": 1.2", "\"maxSpeed\": 120"),
        (
            "orientation",
            "\"vehicleOrientation\": 0.0",
            "\"vehicleOrientation\": 180.0",
        ),
        ("missing-member", "\"nodeId\": \"H3\", ", ""),
        ("not-json", "\"layouts\": [", "\"layouts\": [,"),
    ];
    for (name, from, to) in mistakes {
        insta::assert_snapshot!(format!("lif-{name}"), wrong(from, to));
    }
}

#[test]
fn the_vehicle_type_has_to_be_clear() {
    let source = fixture("hall.lif.json");
    let hint = |wanted: Option<&str>| {
        let wrong = Layout::from_lif(&source, wanted).expect_err("unclear");
        wrong[0].hint.clone().unwrap_or_default()
    };
    assert_eq!(hint(None), "name one with `vehicle-type`: ACME.Carrier, ACME.Tugger");
    assert_eq!(hint(Some("ACME.Carier")), "did you mean `ACME.Carrier`?");
}

/// A random floor of up to twelve nodes, and a random need of up to five names.
fn floor_and_need() -> impl Strategy<Value = (Layout, CourseNeed)> {
    let edges = prop::collection::vec((0..12_usize, 0..12_usize), 0..60);
    let pairs = prop::collection::vec((0..5_usize, 0..5_usize), 0..6);
    let places = prop::collection::vec((-20.0..20.0_f64, -20.0..20.0_f64), 12);
    (places, edges, pairs, any::<bool>()).prop_map(|(places, edges, pairs, far)| {
        let nodes = places.iter().enumerate().map(|(at, (x, y))| Node {
            id: format!("n{at}"),
            map_id: "m".into(),
            x: *x,
            y: *y,
            theta: None,
            deviation_xy: None,
            deviation_theta: None,
            station: at == 7,
            demands: Vec::new(),
        });
        let edges = edges.iter().filter(|(from, to)| from != to).map(|(from, to)| Edge {
            id: format!("{from}-{to}"),
            start: format!("n{from}"),
            end: format!("n{to}"),
            ..Edge::default()
        });
        let names = ["a", "b", "c", "d", "e"];
        let mut need = CourseNeed::default();
        for (from, to) in pairs.into_iter().filter(|(from, to)| from != to) {
            need.nodes.extend([names[from].to_owned(), names[to].to_owned()]);
            need.edges.push((names[from].to_owned(), names[to].to_owned()));
        }
        if far {
            need.nodes.push(FAR.to_owned());
        }
        (Layout::assemble(nodes.collect(), edges.collect(), Vec::new()), need)
    })
}

/// Whether any assignment exists, by trying them all.
fn possible(layout: &Layout, need: &CourseNeed, start: &str) -> bool {
    fn extend(layout: &Layout, need: &CourseNeed, names: &[&String], given: &mut Vec<(String, String)>) -> bool {
        let id =
            |name: &str, given: &[(String, String)]| given.iter().find(|(n, _)| n == name).map(|(_, id)| id.clone());
        let Some((name, rest)) = names.split_first() else {
            return need.edges.iter().all(|(from, to)| {
                let (Some(from), Some(to)) = (id(from, given), id(to, given)) else {
                    return false;
                };
                layout.edge(&from, &to).is_some()
            });
        };
        let candidates: Vec<String> = layout.nodes().map(|node| node.id.clone()).collect();
        candidates.into_iter().any(|candidate| {
            if given.iter().any(|(_, id)| *id == candidate) {
                return false;
            }
            given.push(((*name).clone(), candidate));
            let found = extend(layout, need, rest, given);
            given.pop();
            found
        })
    }
    let mut names: Vec<&String> = need.nodes.iter().filter(|name| *name != "a" && *name != FAR).collect();
    names.sort();
    names.dedup();
    extend(layout, need, &names, &mut vec![("a".to_owned(), start.to_owned())])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_course_is_found_exactly_where_there_is_one((layout, need) in floor_and_need(), start in 0..12_usize) {
        let start = format!("n{start}");
        match layout.assign(&need, &on(&start)) {
            Ok(course) => assert_satisfies(&course, &need, &layout, &start),
            Err(error) => {
                let unsatisfiable = matches!(error, CourseError::Unsatisfiable { .. });
                prop_assert!(unsatisfiable, "{}", error);
                prop_assert!(!possible(&layout, &need, &start));
            }
        }
    }
}

#[test]
fn a_vehicle_in_the_middle_of_a_line_is_led_to_where_four_nodes_are_ahead() {
    let nodes: Vec<String> = (1..=5)
        .map(|at| format!("{{ id = \"n{at}\", x = {at}.0, y = 0.0, map = \"hall\" }}"))
        .collect();
    let edges: Vec<String> = (1..5)
        .flat_map(|at| [(at, at + 1), (at + 1, at)])
        .map(|(from, to)| format!("{{ id = \"e{from}{to}\", from = \"n{from}\", to = \"n{to}\" }}"))
        .collect();
    let profile = format!(
        "[device]\nrole = \"agv\"\nmanufacturer = \"acme\"\nserial-number = \"1\"\n[layout]\nnodes = [{}]\nedges = [{}]\n",
        nodes.join(", "),
        edges.join(", ")
    );
    let layout = layout_of(&profile).expect("a profile").expect("a layout");
    let four = need("a-b b-c c-d");
    assert!(layout.assign(&four, &on("n3")).is_err());
    let way = layout.way_to_fit(&four, &on("n3"), |_, _| true).expect("a way");
    let ids: Vec<&str> = way.iter().map(|edge| edge.id.as_str()).collect();
    assert_eq!(ids, ["e32"]);
    let begins = layout
        .way_to_fit(&four, &on("n3"), |node, _| node.id == "n5")
        .expect("a way");
    assert_eq!(begins.last().map(|edge| edge.end.as_str()), Some("n5"));
    assert_eq!(
        layout.way_to_fit(&need("a-b b-c c-d d-e e-f"), &on("n3"), |_, _| true),
        None
    );
}
