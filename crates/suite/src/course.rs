//! What a test asks of the course, gathered from its routes and variables.

use super::grammar::is_course_name;
use super::model::{CourseNeed, Step, Test, Verb};
use tck_course::is_station;

/// The nodes in order of first use, and the pairs that need an edge. `far` is a node no edge is asked for.
pub(super) fn course_need(test: &Test) -> CourseNeed {
    let mut need = CourseNeed::default();
    for (_, steps) in test.sections() {
        for step in steps {
            of_step(step, &mut need);
        }
    }
    need
}

fn of_step(step: &Step, need: &mut CourseNeed) {
    if let Verb::Send(send) = &*step.verb
        && let Some(route) = &send.route
    {
        let way: Vec<&String> = route.base.iter().chain(&route.horizon).collect();
        for name in &way {
            node(name, need);
        }
        for pair in way.windows(2) {
            edge(pair[0], pair[1], need);
        }
    }
    step.visit_terms(&mut |term| {
        for name in term.variables() {
            let Some(name) = name.strip_prefix("course.") else {
                continue;
            };
            need.directed |= name.ends_with(".direction");
            let name = name.split(['.', '[']).next().unwrap_or(name);
            match name.split_once('-') {
                Some((from, to)) if is_course_name(from) && is_course_name(to) => {
                    node(from, need);
                    node(to, need);
                    edge(from, to, need);
                }
                _ if is_course_name(name) => node(name, need),
                _ => {}
            }
        }
    });
}

fn node(name: &str, need: &mut CourseNeed) {
    if !need.nodes.iter().any(|other| other == name) {
        need.nodes.push(name.to_owned());
    }
}

fn edge(from: &str, to: &str, need: &mut CourseNeed) {
    let pair = (from.to_owned(), to.to_owned());
    let pairs = if is_station(from) || is_station(to) {
        &mut need.ways
    } else {
        &mut need.edges
    };
    if from != "far" && to != "far" && !pairs.contains(&pair) {
        pairs.push(pair);
    }
}
