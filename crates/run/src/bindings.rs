//! The variables of one test: the course from where the vehicle stands, and fresh ids.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

use super::idle::Home;
use super::pace::{Pace, between_looks};
use super::zones;
use tck_course::{Course, Edge, Layout, Node, Standing};
use tck_engine::IdForm;
use tck_journal::Reason;
use tck_journal::event::{Event, Packet};
use tck_judge::RunJudge;
use tck_pack::Role;
use tck_suite::model::{Need, Test};

/// Margin on one and a half keep-alives for the last will, in milliseconds.
const WILL_MARGIN: u64 = 3_000;

/// Where the vehicle stands, as its last state says.
pub(super) fn standing(judge: &RunJudge, layout: &Layout, home: &Home) -> Option<Standing> {
    let (_, state) = judge.timeline().states_back().next()?;
    let node = state.last_node_id.text().filter(|id| !id.is_empty());
    // An order has to begin where the vehicle stands, which may be off its last node.
    if let Some(node) = node.filter(|id| layout.node(id).is_some() && !home.is_between_nodes(state, layout)) {
        return Some(Standing::Node(node.to_owned()));
    }
    let position = state.position.there()?;
    Some(Standing::Pose {
        map: position.map_id.text()?.to_owned(),
        x: position.x.float()?,
        y: position.y.float()?,
    })
}

/// Why a conversation about a station does not begin on it.
const COLLAPSES: &str = "the vehicle stands on a station that this is about, so the way there is none";

/// The way, edge by edge, that the vehicle has to drive before a test; `None` where the test fits as it stands, or nowhere.
pub(super) fn way_to_fit(test: &Test, layout: &Layout, judge: &RunJudge, home: &Home) -> Option<Vec<Edge>> {
    if test.course.nodes.is_empty() && test.begins.is_none() {
        return None;
    }
    let directed;
    let layout = if test.course.directed {
        directed = layout.clone().directed();
        &directed
    } else {
        layout
    };
    let standing = standing(judge, layout, home)?;
    let here = layout.standing(&standing).ok()?;
    let fits = |node: &Node, course: &Course| {
        let collapses = !test.conversation.is_empty() && course.collapses();
        !collapses && test.begins.as_ref().is_none_or(|begins| *begins == node.id)
    };
    if layout
        .assign(&test.course, &standing)
        .is_ok_and(|course| fits(here, &course))
    {
        return None;
    }
    let way = layout.way_to_fit(&test.course, &standing, fits)?;
    Some(way.into_iter().cloned().collect())
}

/// The course of a test; `Err` says why there is none.
pub(super) fn course_of(
    test: &Test,
    layout: Option<&Layout>,
    judge: &RunJudge,
    home: &Home,
) -> Result<Option<Value>, Reason> {
    if test.course.nodes.is_empty() {
        return Ok(None);
    }
    let layout = layout.ok_or(Reason::NoLayout)?;
    let standing =
        standing(judge, layout, home).ok_or_else(|| Reason::observed("the vehicle does not say where it stands"))?;
    let course = if test.device == Role::MasterControl {
        layout.outward(&test.course, &standing)
    } else if test.course.directed {
        let layout = layout.clone().directed();
        if layout.edges().next().is_none() {
            return Err(Reason::observed(
                "no edge of the layout says its direction at a junction",
            ));
        }
        layout.assign(&test.course, &standing)
    } else {
        layout.assign(&test.course, &standing)
    };
    let course = course.map_err(|error| Reason::observed(error.to_string()))?;
    if !test.conversation.is_empty() && course.collapses() {
        return Err(Reason::observed(COLLAPSES));
    }
    let mut course = course.bindings();
    if says_edges_itself(test) {
        tell_nothing(&mut course);
    }
    Pace::of(judge.ground().factsheet().as_deref()).set(&mut course);
    zones::put(
        &mut course,
        &named(test, "${course.", ".zone}"),
        judge.ground().factsheet().as_deref(),
    )?;
    zones::put_across(&mut course, &named(test, "${course.", ".across}"));
    for part in zones::PARTS {
        zones::put_part(&mut course, &named(test, "${course.", &format!(".{part}}}")), part)?;
    }
    Ok(Some(flat(course)))
}

/// Whether a test is about what an order says of an edge, beside its speed: it says that itself, and nothing of a layout comes in
/// between.
fn says_edges_itself(test: &Test) -> bool {
    test.needs.iter().any(|need| match need {
        Need::Optional(path) | Need::NoOptional(path) | Need::NotRequired(path) => {
            path.starts_with("order.edges.") && path != "order.edges.maxSpeed"
        }
        _ => false,
    })
}

/// Takes from every edge what a vehicle would take beside what orders always say.
fn tell_nothing(course: &mut Value) {
    let edges = course.get_mut("edges").and_then(Value::as_object_mut);
    for edge in edges.into_iter().flat_map(Map::values_mut) {
        if let Value::Object(edge) = edge {
            edge.remove("told");
        }
    }
}

/// The variables only this test has.
pub(super) fn own_bindings(
    test: &Test,
    course: Option<Value>,
    judge: &RunJudge,
    run: &str,
    number: usize,
) -> Map<String, Value> {
    let mut own = Map::new();
    let mut time = Map::new();
    time.extend(
        course
            .as_ref()
            .and_then(between_looks)
            .map(|millis| ("look".to_owned(), millis.into())),
    );
    own.extend(course.map(|course| ("course".to_owned(), course)));
    let factsheet = judge.ground().factsheet();
    let form = IdForm::of(factsheet.as_ref().and_then(|sheet| sheet.string_limits()));
    let ids = fresh_names(test).into_iter().enumerate().map(|(place, name)| {
        let id = form.of_name(run, number, &name, place);
        (name, Value::from(id))
    });
    own.insert("run".to_owned(), Value::Object(ids.collect()));
    time.extend(will(judge).map(|millis| ("will".to_owned(), millis.into())));
    if !time.is_empty() {
        own.insert("time".to_owned(), time.into());
    }
    own
}

/// One and a half keep-alives of the device's own CONNECT, and a margin.
fn will(judge: &RunJudge) -> Option<u64> {
    let entry = judge.timeline().of("mqtt/connect").last()?;
    match entry.event() {
        // Of a will that was never registered nothing is to be expected.
        Event::Packet {
            packet: Packet::Connect { will: None, .. },
            ..
        } => Some(WILL_MARGIN),
        Event::Packet {
            packet: Packet::Connect { keep_alive, .. },
            ..
        } if *keep_alive > 0 => Some(u64::from(*keep_alive) * 1_500 + WILL_MARGIN),
        _ => None,
    }
}

/// Every NAME between these two in the files of a test.
fn named(test: &Test, before: &str, behind: &str) -> BTreeSet<String> {
    let steps = test.sections().into_iter().flat_map(|(_, steps)| steps);
    let mut texts: Vec<&str> = steps.map(|step| step.span.source.text.as_str()).collect();
    texts.push(&test.source.text);
    texts.dedup();
    let rests = texts.into_iter().flat_map(|text| text.split(before).skip(1));
    let name = |rest: &str| {
        let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '-')?;
        rest.get(end..)?.starts_with(behind).then(|| rest[..end].to_owned())
    };
    rests.filter_map(name).collect()
}

/// Every NAME of `${run.NAME}` in the files of a test.
fn fresh_names(test: &Test) -> BTreeSet<String> {
    let mut names = BTreeSet::from(["order".to_owned()]);
    let steps = test.sections().into_iter().flat_map(|(_, steps)| steps);
    let mut texts: Vec<&str> = steps.map(|step| step.span.source.text.as_str()).collect();
    texts.push(&test.source.text);
    texts.dedup();
    for text in texts {
        for rest in text.split("${run.").skip(1) {
            let name: String = rest
                .chars()
                .take_while(|c| c.is_ascii_alphanumeric() || *c == '_')
                .collect();
            if !name.is_empty() {
                names.insert(name);
            }
        }
    }
    names
}

/// `course.a.x` beside `course.nodes.a.x`, and `course.a-b.heading` beside `course.edges.a-b.heading`: suites name
/// a node or an edge and its members in one breath.
fn flat(mut course: Value) -> Value {
    let mut short = Map::new();
    let groups = ["nodes", "edges"]
        .into_iter()
        .filter_map(|group| course.get(group)?.as_object());
    for (name, node) in groups.flatten() {
        for (member, value) in node.as_object().into_iter().flatten() {
            short.insert(format!("{name}.{member}"), value.clone());
        }
    }
    if let Value::Object(members) = &mut course {
        members.extend(short);
    }
    course
}
