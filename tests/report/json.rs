//! `result.json`: the same bytes there and back, described by its schema, refused with reasons.

use proptest::prelude::*;
use serde_json::Value;
use vda5050_tck::report::compare;
use vda5050_tck::report::json::{self, ResultError};
use vda5050_tck::result::RunResult;
use vda5050_tck::verdict::Verdict;

use crate::samples;

fn samples() -> Vec<RunResult> {
    vec![samples::pass().0, samples::fail().0, samples::hostile().0]
}

fn schema() -> Value {
    serde_json::from_str(include_str!("../../schemas/result.schema.json")).expect("schema")
}

#[test]
fn a_result_reads_back_as_it_was_and_writes_the_same_bytes() {
    for result in samples() {
        let text = json::to_string(&result).expect("json");
        assert!(text.ends_with("}\n"));
        let back = json::from_str(&text, "result.json").expect("read");
        assert_eq!(back, result);
        assert_eq!(json::to_string(&back).expect("json"), text);
    }
}

#[test]
fn the_schema_describes_every_sample() {
    let validator = jsonschema::draft202012::new(&schema()).expect("schema compiles");
    for result in samples() {
        let value = serde_json::to_value(&result).expect("value");
        let errors: Vec<String> = validator
            .iter_errors(&value)
            .map(|error| format!("{}: {error}", error.instance_path()))
            .collect();
        assert!(errors.is_empty(), "{errors:#?}");
    }
}

/// Every object of the schema is closed and says which members must be there, so that it cannot agree with
/// everything.
#[test]
fn the_schema_refuses_a_member_too_many_and_a_member_too_few_everywhere() {
    let validator = jsonschema::draft202012::new(&schema()).expect("schema compiles");
    let good = serde_json::to_value(samples::fail().0).expect("value");
    let pointers = [
        "",
        "/device",
        "/tests/0",
        "/tests/0/decisions/1",
        "/tests/0/decisions/1/nearest",
        "/tests/0/decisions/1/waited",
        "/tests/0/steps/0",
        "/monitors/0",
        "/monitors/0/findings/0",
        "/requirements/0",
        "/capabilities/0",
        "/settings/0",
    ];
    for pointer in pointers {
        let object = good.pointer(pointer).and_then(Value::as_object).expect(pointer);
        let mut more = good.clone();
        more.pointer_mut(pointer)
            .and_then(Value::as_object_mut)
            .expect(pointer)
            .insert("zzz".into(), Value::Null);
        assert!(
            !validator.is_valid(&more),
            "an unknown member of {pointer:?} was accepted"
        );
        let first = object.keys().next().expect("member").clone();
        let mut less = good.clone();
        less.pointer_mut(pointer)
            .and_then(Value::as_object_mut)
            .expect(pointer)
            .remove(&first);
        assert!(!validator.is_valid(&less), "{pointer:?} without {first} was accepted");
    }
    let mut wrong = good.clone();
    wrong["verdict"] = "great".into();
    assert!(!validator.is_valid(&wrong));
}

#[test]
fn what_is_not_a_result_is_refused_with_the_reason() {
    let text = json::to_string(&samples::pass().0).expect("json");
    let error = |text: &str| json::from_str(text, "r.json").expect_err("refused");
    assert!(matches!(error("not json"), ResultError::NotJson { .. }));
    assert!(matches!(error("{}"), ResultError::NotAResult { .. }));
    assert!(matches!(error("[1]"), ResultError::NotAResult { .. }));
    let other = text.replace("vda5050-tck.result/1", "vda5050-tck.result/9");
    assert!(matches!(&error(&other), ResultError::OtherFormat { found, .. } if found == "vda5050-tck.result/9"));
    let damaged = text.replace("\"partial\": false", "\"partial\": 3");
    let message = error(&damaged).to_string();
    assert!(
        message.starts_with("r.json is a damaged result: ") && message.contains("line 9"),
        "{message}"
    );
    assert!(matches!(
        json::read("/nonexistent/r.json".as_ref()),
        Err(ResultError::Io { what: "read", .. })
    ));
}

#[test]
fn a_result_is_written_whole_or_not_at_all() {
    let dir = tempfile::tempdir().expect("directory");
    let path = dir.path().join("result.json");
    json::write(&path, &samples::pass().0).expect("write");
    json::write(&path, &samples::fail().0).expect("write again");
    assert_eq!(json::read(&path).expect("read"), samples::fail().0);
    assert_eq!(
        std::fs::read_dir(dir.path()).expect("list").count(),
        1,
        "no neighbour is left behind"
    );
    // A folder in the way: the rename fails, and the neighbour goes.
    let blocked = dir.path().join("blocked");
    std::fs::create_dir_all(blocked.join("x")).expect("folder");
    assert!(json::write(&blocked, &samples::pass().0).is_err());
    assert_eq!(std::fs::read_dir(dir.path()).expect("list").count(), 2);
}

#[test]
fn a_comparison_says_what_got_worse_and_what_got_better() {
    let (before, after) = (samples::pass().0, samples::fail().0);
    insta::assert_snapshot!("compare", compare::compare(&before, &after).text());
    let back = compare::compare(&after, &before);
    assert!(
        back.requirements
            .iter()
            .all(|change| change.trend != compare::Trend::Worse)
    );
    assert!(compare::compare(&after, &after).is_empty());
    assert_eq!(compare::compare(&after, &after).text(), "no verdict changed\n");
}

#[test]
fn a_fail_that_was_not_there_before_is_worse() {
    let before = samples::pass().0;
    let mut after = before.clone();
    after.requirements[2].verdict = Some(Verdict::Fail);
    let changes = compare::compare(&before, &after).requirements;
    assert_eq!(changes.len(), 1);
    assert_eq!(changes[0].trend, compare::Trend::Worse);
}

proptest! {
    #[test]
    fn no_text_makes_reading_panic(text in "\\PC{0,80}") {
        let _ = json::from_str(&text, "x");
    }
}
