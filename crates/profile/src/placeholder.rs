//! Placeholders in the texts of a profile, and the values that fill them.

use std::collections::BTreeMap;

/// The placeholders of a text with their byte ranges: `{name}`, but not `${name}`.
#[must_use]
pub fn placeholders(text: &str) -> Vec<(std::ops::Range<usize>, &str)> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(open) = text[at..].find('{').map(|offset| at + offset) {
        at = open + 1;
        let name_length = text[at..]
            .find(|c: char| !c.is_ascii_alphanumeric() && c != '-')
            .unwrap_or(text.len() - at);
        let close = at + name_length;
        if name_length > 0 && text[close..].starts_with('}') && !text[..open].ends_with('$') {
            found.push((open..close + 1, &text[at..close]));
            at = close + 1;
        }
    }
    found
}

/// Fills placeholders. One without a value becomes nothing: the test did not hand that parameter over, and
/// that the name exists was checked when the profile was read.
pub fn fill(text: &str, values: &BTreeMap<String, String>, write: impl Fn(&str) -> String) -> String {
    let mut filled = String::with_capacity(text.len());
    let mut done = 0;
    for (range, name) in placeholders(text) {
        filled.push_str(&text[done..range.start]);
        filled.push_str(&values.get(name).map(|value| write(value)).unwrap_or_default());
        done = range.end;
    }
    filled.push_str(&text[done..]);
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn braces_of_json_and_shell_are_no_placeholders() {
        let names: Vec<_> = placeholders(r#"{"a": {}} ${HOME} {x} {y z} {"#)
            .into_iter()
            .map(|(_, name)| name)
            .collect();
        assert_eq!(names, ["x"]);
    }
}
