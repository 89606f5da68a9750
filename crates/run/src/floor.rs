//! The floor of a plan: how it looks, what of its source is not used, and which tests want more of it, and why.
//!
//! A test is held against every place where the vehicle may come to stand, because nobody knows beforehand where that will be.

use serde::Serialize;

use tck_course::{CourseError, CourseNeed, Layout, Standing};
use tck_pack::Role;
use tck_suite::model::Test;

/// So many places are tried at most.
const PLACES: usize = 40;

/// Floor of a plan, with what is wanted of it and not there.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Floor {
    /// How many nodes there are.
    pub nodes: usize,
    /// How many edges there are.
    pub edges: usize,
    /// Each map as text.
    pub text: String,
    /// Each map as SVG.
    #[serde(skip)]
    pub svg: String,
    /// What the source has and is not used, one sentence each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
    /// What the source says of nodes and edges and orders say, one sentence each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub said: Vec<String>,
    /// What the source says of nodes and edges and no order says, one sentence each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unsaid: Vec<String>,
    /// What wants more floor, the most tests first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wanting: Vec<Wanting>,
}

/// Tests that ask the same of the floor, and do not get it everywhere.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Wanting {
    /// Their ids.
    pub tests: Vec<String>,
    /// How many of the places that were tried allow them.
    pub from: usize,
    /// How many places were tried.
    pub of: usize,
    /// Why not from another one.
    pub why: String,
}

impl Floor {
    /// The floor of these tests.
    #[must_use]
    pub fn of<'t>(layout: &Layout, tests: impl Iterator<Item = &'t Test>) -> Self {
        let mut needs: Vec<(Role, &CourseNeed, Vec<String>)> = Vec::new();
        for test in tests.filter(|test| !test.course.nodes.is_empty()) {
            let same =
                |(role, need, _): &&mut (Role, &CourseNeed, Vec<String>)| *role == test.device && **need == test.course;
            match needs.iter_mut().find(same) {
                Some((.., ids)) => ids.push(test.id.clone()),
                None => needs.push((test.device, &test.course, vec![test.id.clone()])),
            }
        }
        let directed = layout.clone().directed();
        let mut wanting: Vec<Wanting> = Vec::new();
        for (role, need, tests) in needs {
            let on = if need.directed { &directed } else { layout };
            // A station that the profile does not name is missing there, and not on the floor.
            if need.stations().any(|name| !on.has_station(name)) {
                continue;
            }
            let Some((from, of, why)) = held(on, role, need) else {
                continue;
            };
            match wanting.iter_mut().find(|one| one.why == why && one.from == from) {
                Some(one) => one.tests.extend(tests),
                None => wanting.push(Wanting { tests, from, of, why }),
            }
        }
        wanting.sort_by_key(|one| std::cmp::Reverse(one.tests.len()));
        Self {
            nodes: layout.nodes().count(),
            edges: layout.edges().count(),
            text: layout.as_text(),
            svg: layout.as_svg(),
            left_out: layout.left_out().to_vec(),
            said: layout.said().to_vec(),
            unsaid: layout.unsaid().to_vec(),
            wanting,
        }
    }
}

/// From how many places of how many a need is fulfilled, and why not from the first other one; `None` when it is everywhere.
fn held(layout: &Layout, role: Role, need: &CourseNeed) -> Option<(usize, usize, String)> {
    let places = layout.nodes().filter(|node| !node.station).take(PLACES);
    let (mut from, mut of, mut first) = (0, 0, None);
    for node in places {
        let standing = Standing::Node(node.id.clone());
        let course = match role {
            Role::MasterControl => layout.outward(need, &standing),
            Role::Agv => layout.assign(need, &standing),
        };
        of += 1;
        match course {
            // Whether a floor that is too big has it, nobody can say; a place that the profile does not name is no matter of it.
            Ok(_) | Err(CourseError::GivenUp | CourseError::Station { .. }) => from += 1,
            Err(error) => _ = first.get_or_insert_with(|| error.to_string()),
        }
    }
    first.map(|why| (from, of, why))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::diagnostic::Source;

    /// Nodes in a row, with edges both ways, or one way only.
    fn row(count: usize, both: bool) -> Layout {
        let mut text = "[layout]\nnodes = [\n".to_owned();
        for at in 1..=count {
            text += &format!("{{ id = \"N{at}\", x = {at}.0, y = 0.0, map = \"hall\" }},\n");
        }
        text += "]\nedges = [\n";
        for at in 1..count {
            text += &format!("{{ id = \"f{at}\", from = \"N{at}\", to = \"N{}\" }},\n", at + 1);
            if both {
                text += &format!("{{ id = \"b{at}\", from = \"N{}\", to = \"N{at}\" }},\n", at + 1);
            }
        }
        text += "]\n[device]\nmanufacturer = \"ACME\"\nserial-number = \"1\"\n";
        let effective = tck_profile::check(
            &Source::new("device.toml", text),
            std::path::Path::new(""),
            &tck_testing::library().rules.hooks,
        )
        .expect("a profile");
        Layout::of_profile(&effective.profile).expect("a layout").expect("some")
    }

    fn floor(layout: &Layout, role: Role) -> Floor {
        let library = tck_testing::library();
        let tests = library.tests(role, &library.rules.packs.latest().id);
        Floor::of(layout, tests.iter().map(AsRef::as_ref))
    }

    #[test]
    fn a_row_of_nodes_lets_some_tests_run_from_its_ends_only() {
        let floor = floor(&row(5, true), Role::Agv);
        assert_eq!((floor.nodes, floor.edges), (5, 8));
        let ends = floor
            .wanting
            .iter()
            .find(|one| one.why.contains("no 4 nodes") && one.from > 0);
        let ends = ends.expect("a way of four nodes");
        assert!(ends.from < ends.of && !ends.tests.is_empty(), "{ends:?}");
        assert!(floor.text.contains("N1.") && floor.svg.contains("N5"));
    }

    #[test]
    fn what_lacks_the_way_back_is_told_from_what_is_too_near() {
        let wanting = floor(&row(7, false), Role::MasterControl).wanting;
        assert!(
            wanting.iter().any(|one| one.why.contains("a way leads back")),
            "{wanting:?}"
        );
        let built_in = floor(&Layout::built_in(), Role::MasterControl).wanting;
        assert!(built_in.iter().all(|one| one.from > 0), "{built_in:#?}");
    }
}
