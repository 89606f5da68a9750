//! JUnit XML keeps to the schema of Jenkins' xUnit plugin, which is the strictest of its readers. The schema is the plugin's
//! own, under the licence that stands in it.

use std::process::{Command, Stdio};

use proptest::prelude::*;
use vda5050_tck::report::junit::{self, Flavour, Inconclusive};
use vda5050_tck::result::{Repetition, RunResult, TestResult};
use vda5050_tck::verdict::Verdict;

use crate::samples;

/// What xmllint has against a file; nothing without xmllint, which in CI is a failure.
fn objections(xml: &str) -> Option<String> {
    let folder = tempfile::tempdir().expect("folder");
    let file = folder.path().join("junit.xml");
    std::fs::write(&file, xml).expect("write");
    let schema = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/report/schemas/junit-10.xsd");
    let mut command = Command::new("xmllint");
    let run = command
        .args(["--noout", "--nonet", "--schema", schema])
        .arg(&file)
        .stdin(Stdio::null())
        .output();
    let Ok(output) = run else {
        assert!(
            std::env::var_os("CI").is_none(),
            "xmllint is not installed, and CI must have it"
        );
        eprintln!("skipped: xmllint is not installed");
        return None;
    };
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    Some(if output.status.success() { String::new() } else { said })
}

/// A failing run with a flaky test.
fn flaky() -> RunResult {
    let mut result = samples::fail().0;
    let verdicts = [Verdict::Pass, Verdict::Fail];
    let repetitions = verdicts.into_iter().zip(1..).map(|(verdict, number)| Repetition {
        number,
        verdict: Some(verdict),
        seconds: 1.0,
        reason: None,
        journal: Some((1, 2)),
    });
    let failed = result.tests.iter_mut().find(|test| test.verdict == Some(Verdict::Fail));
    failed.expect("a test that failed").repetitions = repetitions.collect();
    result
}

#[test]
fn every_run_keeps_to_the_schema_of_the_xunit_plugin() {
    let flaky = flaky();
    let mut long = samples::pass().0;
    long.tests[0].seconds = 1.997;
    long.tests[1].seconds = 1e9;
    for (name, result) in [
        ("times", &long),
        ("pass", &samples::pass().0),
        ("fail", &samples::fail().0),
        ("hostile", &samples::hostile().0),
        ("flaky", &flaky),
    ] {
        for inconclusive in [Inconclusive::Error, Inconclusive::Skip] {
            let flavour = Flavour {
                inconclusive,
                root: Some("0123"),
            };
            let by_test = junit::render(result, flavour).expect("junit");
            let by_requirement = junit::by_requirement(result, &samples::sources(), flavour).expect("junit");
            for xml in [by_test, by_requirement] {
                let Some(said) = objections(&xml) else { return };
                assert_eq!(said, "", "{name}");
            }
        }
    }
    let wrong = objections("<testsuites><testsuite name='a'/></testsuites>").expect("xmllint");
    assert!(wrong.contains("The attribute 'tests' is required"), "{wrong}");
}

/// What the schema says of a time (`SUREFIRE_TIME`), with at least one digit.
fn is_time(text: &str) -> bool {
    let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    digits(whole) && digits(decimals) && decimals.len() <= 3 && !whole.is_empty()
}

proptest! {
    #[test]
    fn every_time_in_every_suite_keeps_to_the_schema(
        seconds in prop::collection::vec(
            prop_oneof![0.0..5.0_f64, (0_u32..200_000).prop_map(|millis| f64::from(millis) / 1000.0), any::<f64>()], 1..40),
        groups in 1_usize..6,
    ) {
        let mut result = samples::pass().0;
        let like = result.tests[0].clone();
        result.tests = seconds.iter().enumerate().map(|(at, seconds)| TestResult {
            id: format!("group-{}/test-{at} time=\"1.23456\"", at % groups),
            seconds: *seconds,
            reason: Some("]]> <testcase time=\"1.23456\"".to_owned()),
            verdict: Some(Verdict::Fail),
            ..like.clone()
        }).collect();
        let xml = junit::render(&result, Flavour::default()).expect("junit");
        let document = roxmltree::Document::parse(&xml).expect("well-formed");
        let timed = document.descendants().filter_map(|node| Some((node, node.attribute("time")?)));
        let (mut all, mut sum) = (0, 0.0);
        for (node, time) in timed {
            prop_assert!(is_time(time), "{} in {:?}", time, node.tag_name());
            all += 1;
            if node.has_tag_name("testcase") {
                sum += time.parse::<f64>().expect("number");
            }
        }
        prop_assert!(all > seconds.len());
        let suites = document.descendants().filter(|node| node.has_tag_name("testsuite"));
        let suites: f64 = suites.map(|suite| suite.attribute("time").expect("time").parse::<f64>().expect("number")).sum();
        prop_assert!((suites - sum).abs() <= 0.001 + sum * 1e-9, "{} {}", suites, sum);
        // Names and texts are not touched.
        let names = document.descendants().filter_map(|node| node.attribute("name"));
        prop_assert!(names.filter(|name| name.contains("time=\"1.23456\"")).count() == seconds.len());
    }
}

#[test]
fn a_flaky_test_says_so_everywhere() {
    let result = flaky();
    let said = "run 2 times: 1 pass, 1 fail (flaky)";
    let junit = junit::render(&result, Flavour::default()).expect("junit");
    assert!(junit.contains(&format!("message=\"{said}: ")), "{junit}");
    let sources = samples::sources();
    let page = vda5050_tck::report::html::render(&result, &sources, None).expect("page");
    assert!(page.contains(said) && page.contains("1 test is flaky") && page.contains(">flaky</span>"));
    let bundle = vda5050_tck::report::overview::Bundle::default();
    let color = vda5050_tck::report::text::Color::Never;
    let text = vda5050_tck::report::overview::overview(&result, &sources, None, bundle, color);
    assert!(text.contains("\nFlaky:\n") && text.contains(said), "{text}");
}
