//! Prints of JSON values: equal values have equal prints.

use serde_json::Value;

/// Members that change when a message is sent again.
const OF_SENDING: [&str; 2] = ["headerId", "timestamp"];

/// A print of a JSON value that does not depend on the order of members, or on how a number is written.
#[must_use]
pub fn of(value: &Value) -> u64 {
    match value {
        Value::Null => mix(1, 0),
        Value::Bool(flag) => mix(2, u64::from(*flag)),
        Value::Number(number) => mix(3, number.as_f64().map_or(1, f64::to_bits)),
        Value::String(text) => of_text(4, text),
        Value::Array(list) => list.iter().fold(5, |print, value| mix(print, of(value))),
        Value::Object(members) => {
            let members = members.iter().map(|(name, value)| of_member(name, value));
            mix(6, members.fold(0, u64::wrapping_add))
        }
    }
}

/// A print of a message that is the same when it is sent again: what differs then is left out.
#[must_use]
pub fn of_content(message: &Value) -> u64 {
    let members = message.as_object().into_iter().flatten();
    members
        .filter(|(name, _)| !OF_SENDING.contains(&name.as_str()))
        .map(|(name, value)| of_member(name, value))
        .fold(0, u64::wrapping_add)
}

/// A print of an object without some of its members.
#[must_use]
pub fn without(value: &Value, left_out: &[&str]) -> u64 {
    let Some(members) = value.as_object() else {
        return of(value);
    };
    let members = members.iter().filter(|(name, _)| !left_out.contains(&name.as_str()));
    mix(
        6,
        members
            .map(|(name, value)| of_member(name, value))
            .fold(0, u64::wrapping_add),
    )
}

fn of_member(name: &str, value: &Value) -> u64 {
    mix(of_text(7, name), of(value))
}

fn of_text(seed: u64, text: &str) -> u64 {
    let (words, rest) = text.as_bytes().as_chunks::<8>();
    let print = words
        .iter()
        .fold(seed, |print, word| mix(print, u64::from_le_bytes(*word)));
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    mix(mix(print, u64::from_le_bytes(last)), text.len() as u64)
}

/// Takes one more word into a print: a multiplication of 64 bits, whose halves are folded.
fn mix(print: u64, word: u64) -> u64 {
    let product = u128::from(print ^ 0x9e37_79b9_7f4a_7c15) * u128::from(word ^ 0xd6e8_feb8_6659_fd93);
    #[expect(clippy::cast_possible_truncation, reason = "both halves are taken")]
    let (low, high) = (product as u64, (product >> 64) as u64);
    (low ^ high).rotate_left(23).wrapping_add(print)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_equal_has_one_print_and_what_is_not_has_another() {
        let one = json!({ "a": 1, "b": [true, null, "text"], "c": { "x": 1.5, "y": -2 } });
        let same = json!({ "c": { "y": -2.0, "x": 1.5 }, "b": [true, null, "text"], "a": 1.0 });
        assert_eq!(of(&one), of(&same));
        let others = [
            json!({ "a": 2, "b": [true, null, "text"], "c": { "x": 1.5, "y": -2 } }),
            json!({ "a": 1, "b": [null, true, "text"], "c": { "x": 1.5, "y": -2 } }),
            json!({ "a": 1, "b": [true, null, "text"], "c": { "x": -2, "y": 1.5 } }),
            json!({ "a": 1, "b": [true, null, "text", ""], "c": { "x": 1.5, "y": -2 } }),
            json!({ "a": 1, "b": [true, null, "texts"], "c": { "x": 1.5, "y": -2 } }),
            json!({ "a": "1", "b": [true, null, "text"], "c": { "x": 1.5, "y": -2 } }),
        ];
        for other in others {
            assert_ne!(of(&one), of(&other), "{other}");
        }
        assert_ne!(of(&json!("")), of(&json!([])));
        assert_ne!(of(&json!([])), of(&json!({})));
        assert_ne!(of(&json!(0)), of(&json!(false)));
        assert_ne!(of(&json!([[1], 2])), of(&json!([1, [2]])));
    }

    #[test]
    fn a_message_that_is_sent_again_has_the_print_it_had() {
        let first = json!({ "headerId": 1, "timestamp": "a", "orderId": "o" });
        let again = json!({ "headerId": 2, "timestamp": "b", "orderId": "o" });
        assert_eq!(of_content(&first), of_content(&again));
        assert_ne!(of_content(&first), of_content(&json!({ "orderId": "p" })));
        assert_eq!(
            without(&first, &["headerId", "timestamp"]),
            of(&json!({ "orderId": "o" }))
        );
    }
}
