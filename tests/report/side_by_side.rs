//! Runs side by side: what changed is seen, what differs in kind is said, and no string is live.

use roxmltree::{Document, ParsingOptions};
use vda5050_tck::report::side_by_side::render;
use vda5050_tck::result::RunResult;

use crate::samples;

fn page(runs: &[RunResult]) -> String {
    let names: Vec<String> = (1..=runs.len()).map(|at| format!("run-{at}")).collect();
    let page = render(runs, &names, &samples::sources()).expect("a page");
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(&page, options).expect("well-formed");
    page
}

#[test]
fn what_became_worse_comes_first_and_is_marked() {
    let page = page(&[samples::pass().0, samples::fail().0, samples::pass().0]);
    let (_, changed) = page.split_once("id=\"changed\"").expect("a section");
    let (changed, same) = changed.split_once("id=\"same\"").expect("a section");
    let worse = changed.find("<td class=\"worse\">").expect("something is worse");
    let broken = changed
        .find("<code>ORD-REJ-12</code>")
        .expect("the requirement that broke");
    assert!(broken < worse);
    assert!(
        changed.contains("<td class=\"better\">"),
        "the third run is better again"
    );
    assert!(!same.contains("<code>ORD-REJ-12</code>"));
}

#[test]
fn equal_runs_say_why_they_can_be_compared_and_others_what_differs() {
    let pass = samples::pass().0;
    let equal = page(&[pass.clone(), pass.clone()]);
    assert!(equal.contains("All were made of one device") && equal.contains("None: every requirement stands"));
    let mut other = pass.clone();
    "2.0.0".clone_into(&mut other.protocol);
    assert!(page(&[pass, other]).contains("run-2: protocol differs: 2.1.0 -&#62; 2.0.0"));
}

#[test]
fn hostile_runs_stay_text() {
    let page = page(&[samples::pass().0, samples::hostile().0]);
    assert!(!page.contains("<script"));
}
