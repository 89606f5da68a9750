//! JUnit XML: always well-formed, and never greener than the run was.

use proptest::prelude::*;
use roxmltree::{Document, Node};
use vda5050_tck::report::junit::{self, Flavour, Inconclusive};
use vda5050_tck::result::{ProgramResult, RunResult};
use vda5050_tck::verdict::Verdict;

use crate::samples;

fn count(document: &Document<'_>, name: &str) -> usize {
    document.descendants().filter(|node| node.has_tag_name(name)).count()
}

fn case<'a>(document: &'a Document<'a>, name: &str) -> Node<'a, 'a> {
    let mut cases = document.descendants().filter(|node| node.has_tag_name("testcase"));
    cases.find(|node| node.attribute("name") == Some(name)).expect(name)
}

#[test]
fn the_failing_sample_reads_as_it_should() {
    let xml = junit::render(&samples::fail().0, Flavour::default()).expect("junit");
    insta::assert_snapshot!("junit_fail", xml.replace("><", ">\n<"));
    let document = Document::parse(&xml).expect("well-formed");
    let failure = case(&document, "order/update-lower-id-refused")
        .first_element_child()
        .expect("failure");
    assert!(failure.has_tag_name("failure"));
    assert_eq!(failure.attribute("type"), Some("ORD-REJ-12"));
    let text = failure.text().expect("text");
    assert!(
        text.find("fail: ORD-REJ-12") < text.find("warning: ORD-REJ-14"),
        "the worst comes first"
    );
    let open = case(&document, "connection/last-will")
        .first_element_child()
        .expect("error");
    assert!(open.has_tag_name("error") && open.attribute("type") == Some("inconclusive"));
    let absent = case(&document, "order/refusal-shown")
        .first_element_child()
        .expect("skipped");
    assert!(absent.has_tag_name("skipped") && absent.attribute("message") == Some("the profile has no hook trigger"));
    let monitor = case(&document, "header/id-rises").first_element_child().expect("out");
    assert!(monitor.has_tag_name("system-out") && monitor.text().expect("text").contains("HDR-01"));
}

#[test]
fn the_timestamp_is_the_start_of_the_run_and_two_renderings_are_equal() {
    let result = samples::pass().0;
    let xml = junit::render(&result, Flavour::default()).expect("junit");
    assert_eq!(
        xml.matches("timestamp=\"2026-03-02T08:15:00Z\"").count(),
        xml.matches("timestamp=").count()
    );
    assert_eq!(junit::render(&result, Flavour::default()).expect("junit"), xml);
}

#[test]
fn counts_agree_with_the_result() {
    for result in [samples::pass().0, samples::fail().0, samples::hostile().0] {
        let xml = junit::render(&result, Flavour::default()).expect("junit");
        let document = Document::parse(&xml).expect("well-formed");
        let verdicts: Vec<Option<Verdict>> = result
            .tests
            .iter()
            .map(|test| test.verdict)
            .chain(result.monitors.iter().map(|monitor| monitor.verdict))
            .collect();
        let of = |wanted: &[Option<Verdict>]| verdicts.iter().filter(|verdict| wanted.contains(verdict)).count();
        // The run itself, its program, and who was judged.
        let program = result.program.as_ref().map(ProgramResult::verdict);
        let about_the_run = 1 + usize::from(program.is_some()) + usize::from(result.mixed.is_some());
        assert_eq!(count(&document, "testcase"), verdicts.len() + about_the_run);
        let failures = of(&[Some(Verdict::Fail)]) + usize::from(program == Some(Some(Verdict::Fail)));
        assert_eq!(count(&document, "failure"), failures);
        let errors = of(&[Some(Verdict::Error), Some(Verdict::Inconclusive)])
            + usize::from(result.partial)
            + usize::from(program == Some(Some(Verdict::Inconclusive)))
            + usize::from(result.mixed.is_some());
        assert_eq!(count(&document, "error"), errors);
        assert_eq!(count(&document, "skipped"), of(&[None]));
        let total = |attribute: &str| -> usize {
            let suites = document.descendants().filter(|node| node.has_tag_name("testsuite"));
            suites
                .map(|suite| {
                    suite
                        .attribute(attribute)
                        .expect("count")
                        .parse::<usize>()
                        .expect("number")
                })
                .sum()
        };
        assert_eq!(total("tests"), verdicts.len() + about_the_run);
        assert_eq!(total("failures"), failures);
        assert_eq!(total("errors"), errors);
    }
}

#[test]
fn a_partial_run_an_empty_one_and_a_test_without_decision_are_not_green() {
    let errors = |change: fn(&mut RunResult)| {
        let mut result = samples::pass().0;
        change(&mut result);
        let xml = junit::render(&result, Flavour::default()).expect("junit");
        count(&Document::parse(&xml).expect("well-formed"), "error")
    };
    assert_eq!(errors(|_| ()), 0);
    assert_eq!(errors(|result| result.partial = true), 1);
    assert_eq!(errors(|result| result.verdict = None), 1);
    // The only test, and the run, of which no selected test was decided.
    assert_eq!(errors(|result| result.tests[0].verdict = None), 2);
}

#[test]
fn an_absurd_time_or_start_does_not_stop_the_report() {
    let mut result = samples::pass().0;
    for (seconds, started) in [
        (f64::MAX, "-009999-01-01T00:00:00Z"),
        (f64::NAN, "9999-12-30T22:00:00Z"),
        (-5.0, "soon"),
    ] {
        result.tests[0].seconds = seconds;
        started.clone_into(&mut result.started);
        assert!(Document::parse(&junit::render(&result, Flavour::default()).expect("junit")).is_ok());
    }
}

#[test]
fn a_long_text_is_bounded() {
    let mut result = samples::fail().0;
    result.tests[0].reason = Some("x".repeat(5_000_000));
    result.tests[0].decisions[1].explanation = Some("y\n".repeat(5_000_000));
    assert!(junit::render(&result, Flavour::default()).expect("junit").len() < 200_000);
}

/// What the schema of Jenkins' xUnit plugin (junit-10) allows: the attributes of each element, and what may stand in it.
const ALLOWED: [(&str, &[&str], &[&str]); 9] = [
    (
        "testsuites",
        &["name", "time", "tests", "failures", "errors"],
        &["testsuite"],
    ),
    (
        "testsuite",
        &[
            "name",
            "tests",
            "failures",
            "errors",
            "group",
            "time",
            "skipped",
            "timestamp",
            "hostname",
            "id",
            "package",
        ],
        &["properties", "testcase", "system-out", "system-err"],
    ),
    ("properties", &[], &["property"]),
    ("property", &["name", "value"], &[]),
    (
        "testcase",
        &["name", "time", "classname", "group"],
        &["skipped", "error", "failure", "system-out", "system-err"],
    ),
    ("skipped", &["type", "message"], &[]),
    ("error", &["type", "message"], &[]),
    ("failure", &["type", "message"], &[]),
    ("system-out", &[], &[]),
];

#[test]
fn the_xunit_plugin_of_jenkins_takes_every_report() {
    let flavours = [Inconclusive::Error, Inconclusive::Skip].map(|inconclusive| Flavour {
        inconclusive,
        root: Some("ab"),
    });
    for result in [samples::pass().0, samples::fail().0, samples::hostile().0] {
        for flavour in flavours {
            let both = [
                junit::render(&result, flavour).expect("junit"),
                junit::by_requirement(&result, &samples::sources(), flavour).expect("junit"),
            ];
            for xml in both {
                let document = Document::parse(&xml).expect("well-formed");
                for node in document.descendants().filter(Node::is_element) {
                    let name = node.tag_name().name();
                    let (_, attributes, children) = ALLOWED.iter().find(|(known, ..)| *known == name).expect(name);
                    for attribute in node.attributes() {
                        assert!(attributes.contains(&attribute.name()), "{name} {}", attribute.name());
                    }
                    for child in node.children().filter(Node::is_element) {
                        assert!(
                            children.contains(&child.tag_name().name()),
                            "{} in {name}",
                            child.tag_name().name()
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn the_run_is_known_by_its_properties() {
    let flavour = Flavour {
        root: Some("ab12"),
        ..Flavour::default()
    };
    let xml = junit::render(&samples::fail().0, flavour).expect("junit");
    let document = Document::parse(&xml).expect("well-formed");
    let value = |name: &str| {
        let mut all = document.descendants().filter(|node| node.has_tag_name("property"));
        all.find(|node| node.attribute("name") == Some(name))
            .and_then(|node| node.attribute("value"))
            .map(str::to_owned)
    };
    assert_eq!(value("protocol").as_deref(), Some("2.1.0"));
    assert_eq!(value("root").as_deref(), Some("sha256:ab12"));
    assert_eq!(value("verdict").as_deref(), Some("fail"));
    assert!(value("run").is_some() && value("serialNumber").is_some());
}

#[test]
fn a_case_for_each_requirement_fails_where_the_requirement_is_broken() {
    let result = samples::fail().0;
    let xml = junit::by_requirement(&result, &samples::sources(), Flavour::default()).expect("junit");
    let document = Document::parse(&xml).expect("well-formed");
    assert_eq!(count(&document, "testcase"), result.requirements.len() + 1);
    let broken = result
        .requirements
        .iter()
        .filter(|one| one.verdict == Some(Verdict::Fail))
        .count();
    assert_eq!(count(&document, "failure"), broken);
    let mut cases = document.descendants().filter(|node| node.has_tag_name("testcase"));
    let case = cases.find(|node| {
        node.attribute("name")
            .is_some_and(|name| name.starts_with("ORD-REJ-12 "))
    });
    assert!(
        case.expect("a case")
            .children()
            .any(|node| node.has_tag_name("failure"))
    );
}

#[test]
fn what_is_skipped_for_being_undecided_makes_no_run_green_that_decided_nothing() {
    let skip = Flavour {
        inconclusive: Inconclusive::Skip,
        root: None,
    };
    let mut result = samples::fail().0;
    let xml = junit::render(&result, skip).expect("junit");
    let document = Document::parse(&xml).expect("well-formed");
    let open = case(&document, "connection/last-will")
        .first_element_child()
        .expect("skipped");
    assert!(open.has_tag_name("skipped") && open.attribute("type") == Some("inconclusive"));
    for requirement in &mut result.requirements {
        requirement.verdict = None;
    }
    result.verdict = Some(Verdict::Inconclusive);
    let xml = junit::render(&result, skip).expect("junit");
    let document = Document::parse(&xml).expect("well-formed");
    let run = case(&document, "the run is complete and decided something");
    assert!(run.children().any(|node| node.has_tag_name("error")));
}

proptest! {
    #[test]
    fn any_string_anywhere_gives_well_formed_xml(
        strings in prop::collection::vec(prop_oneof![any::<String>(), "[\\x00-\\x20<>&'\"\\]\\]>\\x7f-\\xa0]{0,12}", Just("]]>]]>".to_owned()), Just(samples::HOSTILE.to_owned())], 12)
    ) {
        let mut result = samples::fail().0;
        let mut next = strings.iter().cycle().cloned();
        let mut take = || next.next().unwrap_or_default();
        result.role = take();
        result.protocol = take();
        result.started = take();
        result.device.manufacturer = take();
        result.device.serial_number = take();
        for test in &mut result.tests {
            test.id = take();
            test.reason = Some(take());
            test.not_applicable = test.not_applicable.as_ref().map(|_| take());
            for decision in &mut test.decisions {
                decision.requirement = take();
                decision.message = take();
                decision.clause = take();
                decision.place = take();
                decision.explanation = Some(take());
                if let Some(nearest) = &mut decision.nearest {
                    nearest.path = take();
                    nearest.found = take();
                    nearest.expected = take();
                }
            }
        }
        for monitor in &mut result.monitors {
            monitor.id = take();
            monitor.title = take();
            for finding in &mut monitor.findings {
                finding.requirement = take();
                finding.message = take();
            }
        }
        let xml = junit::render(&result, Flavour::default()).expect("junit");
        let document = Document::parse(&xml);
        prop_assert!(document.is_ok(), "{:?}\n{xml}", document.err());
        prop_assert!(!xml.chars().any(|c| c.is_control() && c != '\n' && c != '\t'));
        prop_assert_eq!(count(&document.expect("parsed"), "testcase"), 5);
    }
}
