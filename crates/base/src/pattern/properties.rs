//! What holds of every pattern and every message, and each operator by example.

use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;
use crate::diagnostic::{Source, Span};

fn span() -> Span {
    Span::new(&Source::new("test", "text"), 0, 4)
}

fn term(value: Value) -> Term {
    Term {
        kind: TermKind::Literal(value),
        span: span(),
    }
}

/// A pattern from JSON with operators, as the reader would make it.
fn pattern(value: &Value) -> Pattern {
    let kind = match value {
        Value::Object(members) if members.keys().next().is_some_and(|name| name.starts_with('$')) => {
            let mut parts: Vec<_> = members.iter().map(|(name, value)| operator(name, value)).collect();
            if parts.len() == 1 {
                parts.remove(0).kind
            } else {
                PatternKind::All(parts)
            }
        }
        Value::Object(members) => PatternKind::Object(
            members
                .iter()
                .map(|(name, value)| (name.clone(), pattern(value)))
                .collect(),
        ),
        Value::Array(items) => PatternKind::List(items.iter().map(pattern).collect()),
        scalar => PatternKind::Equals(term(scalar.clone())),
    };
    Pattern { kind, span: span() }
}

fn operator(name: &str, value: &Value) -> Pattern {
    let elements = |which| {
        PatternKind::Elements(Elements {
            which,
            pattern: Box::new(pattern(value)),
        })
    };
    let compare = |which| {
        PatternKind::Compare(Comparison {
            which,
            with: term(value.clone()),
        })
    };
    let kind = match name {
        "$has" => elements(Element::Has),
        "$hasNew" => elements(Element::HasNew),
        "$none" => elements(Element::None),
        "$one" => elements(Element::One),
        "$atMostOne" => elements(Element::AtMostOne),
        "$each" => elements(Element::Each),
        "$includes" => PatternKind::Includes(term(value.clone())),
        "$consecutive" => PatternKind::Consecutive(term(value.clone())),
        "$empty" => PatternKind::Empty(value == &json!(true)),
        "$count" => PatternKind::Count(Box::new(pattern(value))),
        "$in" => PatternKind::In(value.as_array().into_iter().flatten().cloned().map(term).collect()),
        "$not" => PatternKind::Not(Box::new(pattern(value))),
        "$lt" => compare(Compare::Lt),
        "$le" => compare(Compare::Le),
        "$gt" => compare(Compare::Gt),
        "$ge" => compare(Compare::Ge),
        "$matches" => PatternKind::Matches(whole_text(value.as_str().unwrap_or("")).unwrap()),
        "$present" if value == &json!(true) => PatternKind::Present,
        "$absent" if value == &json!(false) => PatternKind::Present,
        "$present" | "$absent" => PatternKind::Absent,
        other => panic!("{other}"),
    };
    Pattern { kind, span: span() }
}

pub(super) fn bound(value: &Value) -> Bound {
    pattern(value).bind(&Bindings::new()).unwrap()
}

#[track_caller]
#[expect(clippy::needless_pass_by_value, reason = "reads better with `json!` in place")]
fn holds(picture: Value, message: Value) {
    let bound = bound(&picture);
    assert!(
        bound.matches(&message, None),
        "{} should match {message}",
        bound.describe()
    );
    assert!(bound.examine(&message, None).misses.is_empty());
}

#[track_caller]
#[expect(clippy::needless_pass_by_value, reason = "reads better with `json!` in place")]
fn fails(picture: Value, message: Value) {
    let bound = bound(&picture);
    assert!(
        !bound.matches(&message, None),
        "{} should not match {message}",
        bound.describe()
    );
    assert!(!bound.examine(&message, None).misses.is_empty());
}

#[test]
fn objects_match_partially_lists_exactly_scalars_by_value() {
    holds(json!({"a": 3}), json!({"a": 3.0, "b": 1}));
    fails(json!({"a": 3}), json!({"a": "3"}));
    fails(json!({"a": 3}), json!({}));
    holds(json!({}), json!({"a": 1}));
    fails(json!({}), json!([]));
    holds(json!([1, {"a": 1}]), json!([1.0, {"a": 1, "b": 2}]));
    fails(json!([1]), json!([1, 2]));
    holds(json!([]), json!([]));
    fails(json!([]), json!([1]));
    holds(json!({"a": null}), json!({"a": null}));
    fails(json!({"a": null}), json!({}));
}

#[test]
fn quantifiers_count_matching_elements() {
    let two = json!({"e": [{"t": "x", "l": 1}, {"t": "x", "l": 2}, {"t": "y"}]});
    holds(json!({"e": {"$has": {"t": "y"}}}), two.clone());
    fails(json!({"e": {"$has": {"t": "z"}}}), two.clone());
    holds(json!({"e": {"$none": {"t": "z"}}}), two.clone());
    fails(json!({"e": {"$none": {"t": "x"}}}), two.clone());
    holds(json!({"e": {"$one": {"t": "y"}}}), two.clone());
    fails(json!({"e": {"$one": {"t": "x"}}}), two.clone());
    fails(json!({"e": {"$one": {"t": "z"}}}), two.clone());
    holds(json!({"e": {"$atMostOne": {"t": "y"}}}), two.clone());
    holds(json!({"e": {"$atMostOne": {"t": "z"}}}), two.clone());
    fails(json!({"e": {"$atMostOne": {"t": "x"}}}), two.clone());
    holds(json!({"e": {"$each": {"t": {"$in": ["x", "y"]}}}}), two.clone());
    fails(json!({"e": {"$each": {"t": "x"}}}), two.clone());
    holds(json!({"e": {"$each": {"t": "x"}}}), json!({"e": []}));
    holds(json!({"e": {"$includes": [{"t": "y"}, {"l": 2}]}}), two.clone());
    fails(json!({"e": {"$includes": [{"t": "y"}, {"l": 3}]}}), two.clone());
    holds(json!({"e": {"$includes": []}}), json!({"e": []}));
    let way = json!({"n": [{"i": "a"}, {"i": "b"}, {"i": "c"}]});
    holds(json!({"n": {"$consecutive": [{"i": "b"}, {"i": "c"}]}}), way.clone());
    fails(json!({"n": {"$consecutive": [{"i": "a"}, {"i": "c"}]}}), way.clone());
    fails(json!({"n": {"$consecutive": [{"i": "c"}, {"i": "b"}]}}), way.clone());
    fails(json!({"n": {"$consecutive": [{"i": "a"}]}}), json!({"n": []}));
    holds(json!({"e": {"$empty": false}}), two.clone());
    holds(json!({"e": {"$empty": true}}), json!({"e": []}));
    fails(json!({"e": {"$empty": true}}), two.clone());
    holds(json!({"e": {"$count": 3}}), two.clone());
    holds(json!({"e": {"$count": {"$ge": 2, "$lt": 4}}}), two.clone());
    fails(json!({"e": {"$count": {"$gt": 3}}}), two);
}

#[test]
fn scalar_operators_compare_numbers_and_texts() {
    holds(json!({"$lt": 3}), json!(2.9));
    fails(json!({"$lt": 3}), json!(3.0));
    holds(json!({"$le": 3}), json!(3.0));
    holds(json!({"$gt": 3}), json!(3.1));
    fails(json!({"$gt": 3}), json!("4"));
    holds(json!({"$ge": 3.0}), json!(3));
    holds(json!({"$ge": 0, "$le": 1}), json!(0.5));
    fails(json!({"$ge": 0, "$le": 1}), json!(1.5));
    holds(json!({"$in": ["A", 2]}), json!(2.0));
    fails(json!({"$in": ["A", 2]}), json!("B"));
    holds(json!({"$matches": "a|ab"}), json!("ab"));
    fails(json!({"$matches": "b"}), json!("ab"));
    fails(json!({"$matches": "1"}), json!(1));
    holds(json!({"$not": "A"}), json!("B"));
    fails(json!({"$not": "A"}), json!("A"));
    assert!(whole_text("a)(b").is_err());
}

#[test]
fn a_missing_member_matches_only_absent_not_and_none() {
    for picture in [
        json!({"$absent": true}),
        json!({"$present": false}),
        json!({"$not": "A"}),
        json!({"$not": {"$has": {}}}),
        json!({"$none": {}}),
    ] {
        holds(json!({"m": picture}), json!({}));
    }
    for picture in [
        json!({"$absent": false}),
        json!({"$present": true}),
        json!({"$not": {"$absent": true}}),
        json!({"$has": {}}),
        json!({"$hasNew": {}}),
        json!({"$one": {}}),
        json!({"$atMostOne": {}}),
        json!({"$each": {}}),
        json!({"$includes": []}),
        json!({"$empty": true}),
        json!({"$empty": false}),
        json!({"$count": 0}),
        json!({"$in": [null]}),
        json!({"$lt": 1}),
        json!({"$matches": ".*"}),
        json!(null),
        json!({}),
        json!({"inner": {"$absent": true}}),
    ] {
        fails(json!({"m": picture}), json!({}));
    }
    holds(json!({"m": {"$present": true}}), json!({"m": null}));
    fails(json!({"m": {"$absent": true}}), json!({"m": null}));
}

#[test]
fn has_new_wants_an_element_that_was_not_there_before_the_stimulus() {
    let new = bound(&json!({"errors": {"$hasNew": {"errorType": "x"}}}));
    let old = json!({"errors": [{"errorType": "x", "n": 1}, {"errorType": "y"}]});
    assert!(!new.matches(&old, Some(&old)));
    assert!(new.matches(&old, None));
    assert!(new.matches(&old, Some(&json!({}))));
    let reordered = json!({"errors": [{"errorType": "y"}, {"n": 1.0, "errorType": "x"}]});
    assert!(!new.matches(&reordered, Some(&old)));
    let another = json!({"errors": [{"errorType": "x", "n": 1}, {"errorType": "x", "n": 2}]});
    assert!(new.matches(&another, Some(&old)));
    assert_eq!(new.examine(&another, Some(&old)).witness.as_deref(), Some("errors[1]"));
    let stale = new.examine(&old, Some(&old));
    assert_eq!(stale.score, (1, 2));
    assert!(stale.misses[0].found.starts_with("already there before: "));
}

#[test]
fn a_variable_that_holds_an_object_matches_partially() {
    let source = span();
    let variable = Pattern {
        kind: PatternKind::Equals(Term {
            kind: TermKind::Variable("vda.error".into()),
            span: source.clone(),
        }),
        span: source,
    };
    let bindings = Bindings::from(json!({"vda": {"error": {"errorType": "x"}}}));
    let bound = variable.bind(&bindings).unwrap();
    assert!(bound.matches(&json!({"errorType": "x", "errorLevel": "FATAL"}), None));
    assert!(variable.bind(&Bindings::new()).is_err());
}

#[test]
fn the_nearest_miss_descends_into_the_closest_element() {
    let picture = bound(&json!({
        "orderId": "o",
        "errors": {"$has": {"errorType": "orderUpdateError", "errorLevel": "WARNING"}},
    }));
    let message = json!({"orderId": "o", "errors": [
        {"errorType": "other", "errorLevel": "FATAL"},
        {"errorType": "orderUpdateError", "errorLevel": "FATAL"},
    ]});
    let examination = picture.examine(&message, None);
    assert!(!examination.matched);
    assert_eq!(examination.score, (2, 3));
    assert_eq!(examination.misses.len(), 1);
    assert_eq!(examination.misses[0].path, "errors[1].errorLevel");
    assert_eq!(examination.misses[0].expected, "\"WARNING\"");
    assert_eq!(examination.misses[0].found, "\"FATAL\"");
}

#[test]
fn the_witness_is_the_element_that_decided() {
    let message = json!({"e": [{"t": 1}, {"t": 2}, {"t": 2}]});
    let witness = |picture: Value| bound(&picture).examine(&message, None).witness;
    assert_eq!(witness(json!({"e": {"$has": {"t": 2}}})).as_deref(), Some("e[1]"));
    assert_eq!(witness(json!({"e": {"$none": {"t": 1}}})).as_deref(), Some("e[0]"));
    assert_eq!(witness(json!({"e": {"$each": {"t": 1}}})).as_deref(), Some("e[1]"));
    assert_eq!(witness(json!({"e": {"$atMostOne": {"t": 2}}})).as_deref(), Some("e[2]"));
}

#[test]
fn what_is_shown_of_a_message_is_bounded() {
    let huge = json!({"m": "ä".repeat(1_000_000), "l": vec![0; 100_000]});
    let examination = bound(&json!({"m": "x", "l": {"$has": 1}})).examine(&huge, None);
    for miss in examination.misses {
        assert!(miss.found.chars().count() <= 200, "{}", miss.found.len());
    }
}

#[test]
fn ten_thousand_hostile_elements_are_judged_in_no_time() {
    let many: Vec<_> = (0..10_000)
        .map(|n| json!({"errorType": "x", "n": n, "deep": {"l": [n, n]}}))
        .collect();
    let message = json!({"errors": many});
    for picture in [
        json!({"errors": {"$hasNew": {"errorType": "x"}}}),
        json!({"errors": {"$includes": many}}),
        json!({"errors": {"$has": {"deep": {"l": {"$has": -1}}, "errorType": "x"}}}),
    ] {
        let bound = bound(&picture);
        let matched = bound.matches(&message, Some(&message));
        assert_eq!(bound.examine(&message, Some(&message)).matched, matched);
    }
}

pub(super) fn any_json() -> impl Strategy<Value = Value> {
    let scalar = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        (-3_i32..3).prop_map(Value::from),
        (-3_i32..3).prop_map(|n| Value::from(f64::from(n))),
        any::<f64>().prop_map(Value::from),
        "[ab]{0,2}".prop_map(Value::from),
        ".{0,3}".prop_map(Value::from),
    ];
    scalar.prop_recursive(4, 40, 5, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
            prop::collection::btree_map("[abc]", inner, 0..4)
                .prop_map(|members| Value::Object(members.into_iter().collect())),
        ]
    })
}

fn any_pattern() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        any_json(),
        (-2_i32..4).prop_map(|n| json!({"$lt": n})),
        (-2_i32..4).prop_map(|n| json!({"$ge": n, "$le": n + 1})),
        Just(json!({"$matches": "a*"})),
        any::<bool>().prop_map(|b| json!({"$present": b})),
        any::<bool>().prop_map(|b| json!({"$absent": b})),
        any::<bool>().prop_map(|b| json!({"$empty": b})),
        (0..3).prop_map(|n| json!({"$count": n})),
        prop::collection::vec(any_json(), 0..3).prop_map(|items| json!({"$in": items})),
        prop::collection::vec(any_json(), 0..3).prop_map(|items| json!({"$includes": items})),
        prop::collection::vec(any_json(), 0..3).prop_map(|items| json!({"$consecutive": items})),
        any_json().prop_map(|value| json!({"$includes": value})),
    ];
    leaf.prop_recursive(4, 30, 4, |inner| {
        prop_oneof![
            (
                prop::sample::select(vec!["$has", "$hasNew", "$none", "$one", "$atMostOne", "$each", "$not"]),
                inner.clone()
            )
                .prop_map(|(name, value)| json!({name: value})),
            prop::collection::vec(inner.clone(), 0..3).prop_map(Value::from),
            prop::collection::btree_map("[abc]", inner, 0..4)
                .prop_map(|members| Value::Object(members.into_iter().collect())),
        ]
    })
}

proptest! {
    #[test]
    fn a_message_matches_the_pattern_made_from_it(message in any_json()) {
        let picture = Bound::picture(&message, &span());
        prop_assert!(picture.matches(&message, None));
        prop_assert_eq!(picture.examine(&message, None).misses, vec![]);
    }

    #[test]
    fn not_is_negation(picture in any_pattern(), message in any_json(), before in prop::option::of(any_json())) {
        let plain = bound(&picture);
        let negated = bound(&json!({"$not": picture}));
        prop_assert_ne!(
            plain.matches(&message, before.as_ref()),
            negated.matches(&message, before.as_ref())
        );
    }

    #[test]
    fn an_examination_agrees_with_the_match(
        picture in any_pattern(), message in any_json(), before in prop::option::of(any_json())
    ) {
        let bound = bound(&picture);
        let examination = bound.examine(&message, before.as_ref());
        prop_assert_eq!(examination.matched, bound.matches(&message, before.as_ref()));
        prop_assert_eq!(examination.matched, examination.misses.is_empty());
        prop_assert_eq!(examination.matched, examination.score.0 == examination.score.1);
        prop_assert!(examination.score.0 <= examination.score.1);
        prop_assert!(!bound.describe().is_empty() && !bound.conditions().is_empty());
    }

    #[test]
    fn nothing_is_new_when_the_message_is_the_same(message in any_json(), picture in any_pattern()) {
        let bound = bound(&json!({"$hasNew": picture}));
        prop_assert!(!bound.matches(&message, Some(&message)));
    }
}
