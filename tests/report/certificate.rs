//! The certificate: complete, safe, and only for a run that can certify something. The attestation beside it.

use roxmltree::{Document, ParsingOptions};
use serde_json::Value;
use vda5050_tck::report::attestation::Attestation;
use vda5050_tck::report::certificate::{CertificateError, render};
use vda5050_tck::report::html;
use vda5050_tck::result::{CERTIFY, OnWord, RunResult, WordKind};
use vda5050_tck::verdict::Verdict;

use crate::samples;

pub const ROOT: &str = "ae4b3280e56e2faf83f414a6e3dabe9d5fbe18976544c05fed121accb85b53fc";

pub fn certified(mut result: RunResult) -> RunResult {
    result.mode = Some(CERTIFY.to_owned());
    result.partial = false;
    result.suites_modified = false;
    for (name, value) in [
        ("certificate.laboratory", "Test house"),
        ("certificate.tester", "A. Person"),
        ("certificate.place", "Hall 3"),
        ("certificate.hardware-version", "C"),
        ("certificate.firmware-version", "4.2.1"),
    ] {
        result.settings.push(samples::setting(name, value, "device.toml"));
    }
    result
}

#[test]
fn a_certificate_says_who_tested_what_with_which_outcome() {
    let result = certified(samples::pass().0);
    let page = render(&result, &samples::sources(), ROOT).expect("a certificate");
    let (_, body) = page.split_once("</head>").expect("a body");
    insta::assert_snapshot!("certificate_pass", body);
    for wanted in [
        "Certificate of conformance",
        "Test house",
        "A. Person",
        "Hall 3",
        "4.2.1",
        ROOT,
    ] {
        assert!(body.contains(wanted), "{wanted}");
    }
}

#[test]
fn what_rests_on_a_persons_word_is_marked_on_paper_and_page() {
    let (result, journal) = samples::pass();
    let mut result = certified(result);
    let test = result.tests[0].id.clone();
    result.on_word = vec![OnWord {
        test: test.clone(),
        kind: WordKind::Answer,
        what: "Press the <button>.".to_owned(),
    }];
    let paper = render(&result, &samples::sources(), ROOT).expect("a certificate");
    let page = html::render(&result, &samples::sources(), Some(&journal)).expect("a page");
    for shown in [&paper, &page] {
        assert!(shown.contains("1 test rests on a person"), "the limits name it");
        assert!(shown.contains("Press the &#60;button&#62;."), "{shown}");
    }
    assert!(paper.contains("On a person's word") && page.contains("on a person's word:"));
    result.on_word.clear();
    let paper = render(&result, &samples::sources(), ROOT).expect("a certificate");
    assert!(!paper.contains("person's word"));
}

#[test]
fn a_device_that_breaks_something_gets_a_report_that_says_so() {
    let page = render(&certified(samples::fail().0), &samples::sources(), ROOT).expect("a report");
    assert!(page.contains("Test report: the device does not conform"));
    assert!(!page.contains("Certificate of conformance"));
    assert!(page.contains("ORD-REJ-12"), "the finding is named");
}

#[test]
fn whatever_a_device_calls_itself_the_page_stays_well_formed() {
    let (hostile, _, sources) = samples::hostile();
    let page = render(&certified(hostile), &sources, "}</style><script>").expect("a certificate");
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(&page, options).expect("well-formed");
    assert!(!document.descendants().any(|node| node.has_tag_name("script")));
}

#[test]
fn a_run_that_was_another_one_or_ended_early_or_used_other_suites_certifies_nothing() {
    let sources = samples::sources();
    let refused = |change: fn(&mut RunResult)| {
        let mut result = certified(samples::pass().0);
        change(&mut result);
        render(&result, &sources, ROOT).expect_err("no certificate")
    };
    assert!(matches!(
        refused(|result| result.mode = None),
        CertificateError::OtherRun
    ));
    assert!(matches!(
        refused(|result| result.partial = true),
        CertificateError::Partial
    ));
    assert!(matches!(
        refused(|result| result.suites_modified = true),
        CertificateError::Suites
    ));
    assert!(matches!(
        refused(|result| result.verdict = None),
        CertificateError::Nothing
    ));
}

#[test]
fn the_attestation_names_every_test_once_and_is_no_greener_than_the_run() {
    let of = |result: &RunResult| -> Value {
        let text = Attestation::of(result, b"{}", ROOT).to_json().expect("JSON");
        serde_json::from_str(&text).expect("JSON")
    };
    let fail = certified(samples::fail().0);
    let statement = of(&fail);
    assert_eq!(statement["_type"], "https://in-toto.io/Statement/v1");
    assert_eq!(
        statement["predicateType"],
        "https://in-toto.io/attestation/test-result/v0.1"
    );
    assert_eq!(
        statement["subject"][0]["digest"]["sha256"],
        "44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a"
    );
    let predicate = &statement["predicate"];
    assert_eq!(predicate["result"], "FAILED");
    let named = ["passedTests", "warnedTests", "failedTests"].map(|list| predicate[list].as_array().expect(list).len());
    let decided = fail
        .tests
        .iter()
        .filter(|test| test.not_applicable.is_none() || test.verdict.is_some())
        .count()
        + fail.monitors.iter().filter(|monitor| monitor.verdict.is_some()).count();
    assert_eq!(named.iter().sum::<usize>(), decided);
    let mut pass = certified(samples::pass().0);
    assert_eq!(of(&pass)["predicate"]["result"], "PASSED");
    pass.partial = true;
    assert_eq!(of(&pass)["predicate"]["result"], "WARNED");
    pass.verdict = Some(Verdict::Inconclusive);
    pass.partial = false;
    assert_eq!(of(&pass)["predicate"]["result"], "WARNED");
}
