//! The picture of a course, from messages as they come.

use serde_json::{Value, json};
use tck_view::{MessageView, Names, Topic};

use super::{Bounds, CoursePicture, Driven, Finding};

fn view(topic: Topic, message: &Value) -> MessageView {
    MessageView::of_value(topic, message, &Names::default())
}

/// An order over nodes in a row, two metres apart: `n0` is at the origin.
fn order(id: &str, update: u64, nodes: std::ops::Range<u32>, released: u32) -> MessageView {
    let place = |at: u32| json!({ "x": 2.0 * f64::from(at), "y": 0.0, "mapId": "hall" });
    let nodes_of = nodes.clone().map(|at| {
        json!({ "nodeId": format!("n{at}"), "sequenceId": 2 * at, "released": at <= released, "nodePosition": place(at) })
    });
    let edges_of = nodes.clone().skip(1).map(|at| {
        json!({ "edgeId": format!("e{at}"), "sequenceId": 2 * at - 1, "released": at <= released,
                "startNodeId": format!("n{}", at - 1), "endNodeId": format!("n{at}") })
    });
    let message = json!({
        "orderId": id, "orderUpdateId": update,
        "nodes": nodes_of.collect::<Vec<_>>(), "edges": edges_of.collect::<Vec<_>>(),
    });
    view(Topic::Order, &message)
}

fn state(id: &str, update: u64, node: &str, x: f64, y: f64) -> MessageView {
    view(
        Topic::State,
        &json!({
            "orderId": id, "orderUpdateId": update, "lastNodeId": node, "driving": true,
            "agvPosition": { "x": x, "y": y, "theta": 0.5, "mapId": "hall", "positionInitialized": true },
        }),
    )
}

fn finding(number: u64, what: &str) -> Finding {
    Finding {
        number,
        what: what.to_owned(),
    }
}

/// A vehicle that leaves the way at message 6.
fn strayed() -> CoursePicture {
    let mut driven = Driven::new(Bounds::TEST).watching([6, 8].into_iter());
    driven.note(1, &order("o", 0, 0..4, 1));
    for number in 2..6_u32 {
        driven.note(
            u64::from(number),
            &state("o", 0, "n0", f64::from(number - 2) / 2.0, 0.0),
        );
    }
    driven.note(6, &state("o", 0, "n0", 1.5, 0.8));
    driven.note(7, &state("o", 0, "n0", 2.0, 1.0));
    driven.note(8, &order("o", 1, 1..4, 2));
    let findings = [
        finding(6, "PATH-01 fail: it left the way"),
        finding(8, "LATE-01 warning"),
    ];
    driven.picture(&findings).expect("it moved")
}

#[test]
fn the_vehicle_is_where_it_was_at_the_message_of_the_finding() {
    let picture = strayed();
    assert_eq!(
        (picture.order.as_str(), picture.update, picture.message),
        ("o", Some(0), Some(1))
    );
    let found = &picture.found[0];
    assert_eq!(
        (found.place, found.theta, found.beside),
        (Some((1.5, 0.8)), Some(0.5), Some(0.8))
    );
    assert_eq!((found.node.as_str(), found.driving), ("n0", Some(true)));
    assert_eq!(picture.found[1].place, Some((2.0, 1.0)));
    let released: Vec<bool> = picture.edges.iter().map(|edge| edge.released).collect();
    assert_eq!(released, [true, false, false]);
    assert_eq!(picture.trail.first(), Some(&(0.0, 0.0)));
    let again: CoursePicture =
        serde_json::from_str(&serde_json::to_string(&picture).expect("JSON")).expect("the same picture");
    assert_eq!(again, picture);
}

#[test]
fn a_vehicle_that_leaves_its_way_as_a_picture() {
    let figure = strayed()
        .figure("course1", "Where the vehicle was", |seq| seq == 6)
        .expect("a figure");
    insta::assert_snapshot!("strayed", figure);
    let (svg, table) = figure.split_once("</svg>").expect("a picture");
    for (class, count) in [
        ("base", 1),
        ("horizon", 2),
        ("trail", 1),
        ("after", 1),
        ("node", 4),
        ("start", 1),
        ("ring", 2),
    ] {
        assert_eq!(svg.matches(&format!("class=\"{class}\"")).count(), count, "{class}");
    }
    assert!(svg.contains("role=\"img\" aria-labelledby=\"course1-title course1-desc\""));
    assert!(!figure.contains("<script") && !figure.contains("href=\"http"));
    for words in [
        "n0, n1",
        "n2, n3",
        "0.80 m from the nearest edge of the base",
        "<a href=\"#m6\">#6</a>",
        "#1: o, update 0",
    ] {
        assert!(table.contains(words), "{words} in {table}");
    }
}

#[test]
fn the_worst_finding_lies_on_top_and_those_at_its_place_are_named_with_it() {
    let mut picture = strayed();
    assert_eq!((picture.until, picture.trail.len()), (Some(5), 6));
    let mut same = picture.found[0].clone();
    same.number = 9;
    picture.found.push(same);
    let figure = picture.figure("c", "t", |_| false).expect("a figure");
    let numbers: Vec<&str> = figure
        .split("class=\"number\"")
        .skip(1)
        .filter_map(|rest| rest.split_once('>')?.1.split_once('<'))
        .map(|(number, _)| number)
        .collect();
    assert_eq!(numbers, ["2", "1, 3"]);
    assert!(figure.contains("m of it after arrow 1"), "{figure}");
    assert!(figure.find("class=\"after\"") < figure.find("class=\"trail\""));
    picture.until = None;
    let whole = picture.figure("c", "t", |_| false).expect("a figure");
    assert!(!whole.contains("class=\"after\"") && !whole.contains("m of it after arrow 1"));
}

#[test]
fn an_update_goes_on_with_the_base_before_it_and_replaces_the_horizon() {
    let mut driven = Driven::new(Bounds::TEST);
    driven.note(1, &order("o", 0, 0..4, 1));
    driven.note(2, &order("o", 1, 1..3, 2));
    driven.note(3, &state("o", 1, "n0", 0.0, 0.0));
    driven.note(4, &state("o", 1, "n1", 2.0, 0.0));
    let picture = driven.picture(&[finding(4, "x")]).expect("it moved");
    let nodes: Vec<(&str, bool)> = picture
        .nodes
        .iter()
        .map(|node| (node.id.as_str(), node.released))
        .collect();
    assert_eq!(nodes, [("n0", true), ("n1", true), ("n2", true)]);
    let edges: Vec<&str> = picture.edges.iter().map(|edge| edge.id.as_str()).collect();
    assert_eq!(edges, ["e1", "e2"]);
    // The order is the one that the vehicle names.
    driven.note(5, &order("refused", 0, 0..2, 1));
    assert_eq!(driven.picture(&[finding(4, "x")]).expect("it moved").order, "o");
}

#[test]
fn a_curve_is_a_curve() {
    let mut driven = Driven::new(Bounds::TEST);
    let quarter = json!({ "degree": 2, "knotVector": [0, 0, 0, 1, 1, 1], "controlPoints": [
        { "x": 0, "y": 0 }, { "x": 2, "y": 0, "weight": 0.7 }, { "x": 2, "y": 2 },
    ] });
    let broken = json!({ "degree": 0, "knotVector": [], "controlPoints": [] });
    let node = |id: &str, at: u64, x: f64, y: f64| json!({ "nodeId": id, "sequenceId": at, "released": true, "nodePosition": { "x": x, "y": y, "mapId": "hall" } });
    let edge = |id: &str, at: u64, from: &str, to: &str, curve: &Value| json!({ "edgeId": id, "sequenceId": at, "released": true, "startNodeId": from, "endNodeId": to, "trajectory": curve });
    let message = json!({
        "orderId": "o", "orderUpdateId": 0,
        "nodes": [node("a", 0, 0.0, 0.0), node("b", 2, 2.0, 2.0), node("c", 4, 4.0, 2.0)],
        "edges": [edge("e1", 1, "a", "b", &quarter), edge("e2", 3, "b", "c", &broken)],
    });
    driven.note(1, &view(Topic::Order, &message));
    driven.note(2, &state("o", 0, "a", 0.0, 0.0));
    driven.note(3, &state("o", 0, "a", 1.0, 0.2));
    let picture = driven.picture(&[finding(3, "x")]).expect("it moved");
    let line = &picture.edges[0].line;
    assert!((10..=49).contains(&line.len()), "{}", line.len());
    assert!(
        line.iter().all(|(x, y)| (x.hypot(y - 2.0) - 2.0).abs() < 0.01),
        "{line:?}"
    );
    assert!(picture.edges[1].line.is_empty(), "what is no curve is drawn as none");
    let figure = picture.figure("c", "t", |_| false).expect("a figure");
    assert!(figure.contains("1 edge whose way is not known"), "{figure}");
}

#[test]
fn a_vehicle_that_stands_has_no_picture() {
    let mut driven = Driven::new(Bounds::TEST);
    driven.note(1, &order("o", 0, 0..4, 1));
    for number in 2..50_u32 {
        let trembling = f64::from(number % 2) * 0.06;
        let standing = json!({ "orderId": "o", "orderUpdateId": 0, "lastNodeId": "n0", "driving": false,
            "agvPosition": { "x": trembling, "y": 0.0, "theta": 0.0, "mapId": "hall", "positionInitialized": true } });
        driven.note(u64::from(number), &view(Topic::State, &standing));
    }
    assert_eq!(driven.picture(&[finding(9, "x")]), None);
}

#[test]
fn a_vehicle_without_a_position_is_drawn_at_its_last_nodes() {
    let mut driven = Driven::new(Bounds::TEST);
    driven.note(1, &order("o", 0, 0..4, 3));
    for (number, node) in [(2, "n0"), (3, "n1"), (4, "n2")] {
        let said = json!({ "orderId": "o", "orderUpdateId": 0, "lastNodeId": node, "driving": true });
        driven.note(number, &view(Topic::State, &said));
    }
    let picture = driven.picture(&[finding(3, "x")]).expect("it moved");
    assert_eq!(
        (picture.by_nodes, picture.trail.as_slice()),
        (true, [(0.0, 0.0), (2.0, 0.0), (4.0, 0.0)].as_slice())
    );
    let figure = picture.figure("c", "t", |_| false).expect("a figure");
    assert!(figure.contains("does not say where it is"));
}

#[test]
fn what_a_device_sends_is_bounded_and_only_text() {
    let evil = "<script>alert(1)</script>\"'&\u{202e}\u{0}".repeat(5);
    let mut driven = Driven::new(Bounds::TEST);
    let nodes = (0..4_000).map(|at| {
        json!({ "nodeId": format!("{at}{evil}"), "sequenceId": 2 * at, "released": true,
                "nodePosition": { "x": 1e8 * f64::from(at), "y": -1e300, "mapId": evil } })
    });
    let edges = (0..4_000).map(|at| {
        json!({ "edgeId": evil, "sequenceId": 2 * at + 1, "released": at % 2 == 0,
                "startNodeId": format!("{at}{evil}"), "endNodeId": 7, "trajectory": { "degree": "2" } })
    });
    let message = json!({ "orderId": evil, "orderUpdateId": -3, "nodes": nodes.collect::<Vec<_>>(),
                          "edges": edges.collect::<Vec<_>>() });
    let order = view(Topic::Order, &message);
    for number in 0..100 {
        driven.note(number, &order);
    }
    for number in 100..5_000_u32 {
        let far = f64::from(number);
        let said = json!({ "orderId": evil, "lastNodeId": evil, "driving": "yes",
            "agvPosition": { "x": far, "y": if number % 2 == 0 { 9e8 } else { far }, "theta": 1e300, "mapId": format!("{evil}{}", number % 20) } });
        driven.note(u64::from(number), &view(Topic::State, &said));
    }
    let findings: Vec<Finding> = (0..500).map(|at| finding(at * 10, &evil)).collect();
    let picture = driven.picture(&findings).expect("it moved");
    assert_eq!((picture.found.len(), picture.further), (9, 491));
    let figure = picture.figure("c", &evil, |_| true).expect("a figure");
    assert!(figure.len() < 200_000, "{}", figure.len());
    assert!(!figure.contains("<script") && !figure.contains(['\u{202e}', '\u{0}']));
    assert!(!figure.contains("NaN") && !figure.contains("inf,") && !figure.contains("inf\""));
    let (svg, _) = figure.split_once("</figure>").expect("a picture");
    let svg = &svg[svg.find("<svg").expect("a picture")..];
    roxmltree::Document::parse(svg).expect("XML");
}
