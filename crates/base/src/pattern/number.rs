//! Equality and order of JSON values: numbers compare by value, whatever they are written like.

use std::cmp::Ordering;
use std::fmt::Write;

use serde_json::{Number, Value};

/// The order of two JSON numbers by value: `3` and `3.0` are equal, and no digit of a 64-bit integer is lost.
#[must_use]
pub fn compare_numbers(left: &Number, right: &Number) -> Option<Ordering> {
    match (integer(left), integer(right)) {
        (Some(left), Some(right)) => Some(left.cmp(&right)),
        (Some(left), None) => integer_to_float(left, right.as_f64()?),
        (None, Some(right)) => integer_to_float(right, left.as_f64()?).map(Ordering::reverse),
        (None, None) => left.as_f64()?.partial_cmp(&right.as_f64()?),
    }
}

/// A number without fraction that is not negative, whatever it is written like: `14` and `14.0` are the same (JSON-09).
/// `None` for other values, and for those beyond 53 bits that are written as a float.
#[must_use]
pub fn whole(value: &Value) -> Option<u64> {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "range and fraction are checked"
    )]
    let whole = |float: f64| (float.fract() == 0.0 && (0.0..=EXACT).contains(&float)).then_some(float as u64);
    value.as_u64().or_else(|| whole(value.as_f64()?))
}

fn integer(number: &Number) -> Option<i128> {
    number
        .as_i64()
        .map(i128::from)
        .or_else(|| number.as_u64().map(i128::from))
}

/// Every integer here has at most 64 bits, so a float beyond that range decides by its sign.
fn integer_to_float(integer: i128, float: f64) -> Option<Ordering> {
    const BEYOND: f64 = 36_893_488_147_419_103_232.0; // 2^65
    if float.is_nan() {
        return None;
    }
    if float >= BEYOND {
        return Some(Ordering::Less);
    }
    if float <= -BEYOND {
        return Some(Ordering::Greater);
    }
    #[allow(clippy::cast_possible_truncation)] // bounded just above
    let whole = float.trunc() as i128;
    Some(integer.cmp(&whole).then_with(|| {
        let fraction = float.fract();
        0.0_f64.partial_cmp(&fraction).unwrap_or(Ordering::Equal)
    }))
}

/// Whether two JSON values are the same: numbers by value, members in any order.
#[must_use]
pub fn same_value(left: &Value, right: &Value) -> bool {
    match (left, right) {
        (Value::Number(left), Value::Number(right)) => compare_numbers(left, right) == Some(Ordering::Equal),
        (Value::Array(left), Value::Array(right)) => {
            left.len() == right.len() && left.iter().zip(right).all(|(left, right)| same_value(left, right))
        }
        (Value::Object(left), Value::Object(right)) => {
            left.len() == right.len()
                && left
                    .iter()
                    .all(|(name, left)| right.get(name).is_some_and(|right| same_value(left, right)))
        }
        _ => left == right,
    }
}

/// A text that two values share exactly when [`same_value`] holds, so that many values can be compared by hash.
pub(super) fn canonical(value: &Value) -> String {
    let mut text = String::new();
    write_canonical(value, &mut text);
    text
}

fn write_canonical(value: &Value, into: &mut String) {
    match value {
        Value::Number(number) => write_number(number, into),
        Value::Array(items) => {
            into.push('[');
            for item in items {
                write_canonical(item, into);
                into.push(',');
            }
            into.push(']');
        }
        Value::Object(members) => {
            let mut names: Vec<_> = members.iter().collect();
            names.sort_unstable_by_key(|(name, _)| name.as_str());
            into.push('{');
            for (name, value) in names {
                let _ = write!(into, "{name:?}:");
                write_canonical(value, into);
                into.push(',');
            }
            into.push('}');
        }
        Value::String(text) => {
            let _ = write!(into, "{text:?}");
        }
        Value::Bool(_) | Value::Null => {
            let _ = write!(into, "{value}");
        }
    }
}

fn write_number(number: &Number, into: &mut String) {
    let _ = match (integer(number), number.as_f64()) {
        (Some(integer), _) => write!(into, "{integer}"),
        // A float that holds an integer is written like one; beyond 64 bits only floats are left to compare with.
        #[allow(clippy::cast_possible_truncation)] // bounded by the guard
        (None, Some(float)) if float.fract() == 0.0 && float.abs() < 1e30 => write!(into, "{}", float as i128),
        (None, Some(float)) => write!(into, "{float:?}"),
        (None, None) => write!(into, "{number}"),
    };
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::json;

    use super::*;

    fn order(left: &Value, right: &Value) -> Option<Ordering> {
        let (Value::Number(left), Value::Number(right)) = (left, right) else {
            panic!("numbers expected")
        };
        compare_numbers(left, right)
    }

    #[test]
    fn numbers_compare_by_value_whatever_their_notation() {
        assert!(same_value(&json!(3), &json!(3.0)));
        assert!(same_value(&json!(0), &json!(-0.0)));
        assert!(!same_value(&json!(3), &json!(3.5)));
        assert_eq!(order(&json!(-1), &json!(u64::MAX)), Some(Ordering::Less));
        assert_eq!(order(&json!(-3), &json!(-3.5)), Some(Ordering::Greater));
        assert_eq!(order(&json!(1e300), &json!(u64::MAX)), Some(Ordering::Greater));
    }

    #[test]
    fn no_digit_of_a_big_integer_is_lost() {
        assert!(!same_value(
            &json!(9_007_199_254_740_993_u64),
            &json!(9_007_199_254_740_992.0)
        ));
        assert!(!same_value(&json!(u64::MAX), &json!(u64::MAX - 1)));
        assert_eq!(
            order(&json!(u64::MAX), &json!(18_446_744_073_709_551_616.0)),
            Some(Ordering::Less)
        );
    }

    #[test]
    fn members_may_stand_in_any_order() {
        assert!(same_value(&json!({"a": 1, "b": [2.0]}), &json!({"b": [2], "a": 1.0})));
        assert!(!same_value(&json!({"a": 1}), &json!({"a": 1, "b": 2})));
        assert!(!same_value(&json!([1, 2]), &json!([2, 1])));
    }

    proptest! {
        #[test]
        fn the_canonical_text_agrees_with_equality(
            left in super::super::properties::any_json(), right in super::super::properties::any_json()
        ) {
            prop_assert_eq!(canonical(&left) == canonical(&right), same_value(&left, &right));
            prop_assert_eq!(canonical(&left), canonical(&left.clone()));
        }

        #[test]
        fn integers_and_their_floats_have_one_canonical_text(number in -1_000_000_i32..1_000_000) {
            prop_assert_eq!(canonical(&json!(number)), canonical(&json!(f64::from(number))));
        }
    }
}
