//! The members of a JSON object with their values as they are written.
//!
//! A recording that holds payloads as objects must not be parsed and written anew: what is wrong with the bytes of a
//! payload would be mended.

/// Names and values of an object, as written; `None` when it is no object that is closed at the end of the text.
pub(super) fn members(text: &str) -> Option<Vec<(String, &str)>> {
    let bytes = text.as_bytes();
    let mut at = skip_blank(bytes, 0);
    if bytes.get(at) != Some(&b'{') {
        return None;
    }
    at = skip_blank(bytes, at + 1);
    let mut all = Vec::new();
    if bytes.get(at) == Some(&b'}') {
        return (skip_blank(bytes, at + 1) == bytes.len()).then_some(all);
    }
    loop {
        let end = skip_text(bytes, at)?;
        let name: String = serde_json::from_str(text.get(at..end)?).ok()?;
        at = skip_blank(bytes, end);
        if bytes.get(at) != Some(&b':') {
            return None;
        }
        at = skip_blank(bytes, at + 1);
        let end = skip_value(bytes, at)?;
        all.push((name, text.get(at..end)?.trim_end()));
        at = skip_blank(bytes, end);
        match bytes.get(at)? {
            b',' => at = skip_blank(bytes, at + 1),
            b'}' => return (skip_blank(bytes, at + 1) == bytes.len()).then_some(all),
            _ => return None,
        }
    }
}

/// The elements of an array as written; `None` when it is no array that is closed at the end of the text.
pub(super) fn elements(text: &str) -> Option<Vec<&str>> {
    let bytes = text.as_bytes();
    let mut at = skip_blank(bytes, 0);
    if bytes.get(at) != Some(&b'[') {
        return None;
    }
    at = skip_blank(bytes, at + 1);
    let mut all = Vec::new();
    if bytes.get(at) == Some(&b']') {
        return (skip_blank(bytes, at + 1) == bytes.len()).then_some(all);
    }
    loop {
        let end = skip_value(bytes, at)?;
        all.push(text.get(at..end)?.trim_end());
        at = skip_blank(bytes, end);
        match bytes.get(at)? {
            b',' => at = skip_blank(bytes, at + 1),
            b']' => return (skip_blank(bytes, at + 1) == bytes.len()).then_some(all),
            _ => return None,
        }
    }
}

/// How deep a JSON text is nested, byte after byte.
#[derive(Debug, Default)]
pub(super) struct Depth {
    open: usize,
    text: bool,
    escaped: bool,
}

impl Depth {
    /// Takes in the next byte; says whether the outermost bracket is closed by it.
    pub fn closes(&mut self, byte: u8) -> bool {
        if self.text {
            self.text = self.escaped || byte != b'"';
            self.escaped = byte == b'\\' && !self.escaped;
            return false;
        }
        match byte {
            b'"' => self.text = true,
            b'{' | b'[' => self.open += 1,
            b'}' | b']' => {
                self.open = self.open.saturating_sub(1);
                return self.open == 0;
            }
            _ => {}
        }
        false
    }

    /// Whether a text in quotes is open.
    pub fn in_text(&self) -> bool {
        self.text
    }
}

fn skip_blank(bytes: &[u8], at: usize) -> usize {
    let blank = bytes.get(at..).unwrap_or_default().iter();
    at + blank.take_while(|byte| byte.is_ascii_whitespace()).count()
}

/// The end of a text in quotes that begins here.
fn skip_text(bytes: &[u8], at: usize) -> Option<usize> {
    if bytes.get(at) != Some(&b'"') {
        return None;
    }
    let mut at = at + 1;
    loop {
        match bytes.get(at)? {
            b'"' => return Some(at + 1),
            b'\\' => at += 2,
            _ => at += 1,
        }
    }
}

/// The end of the value that begins here: of nested ones by their brackets, of others at the next comma or bracket.
fn skip_value(bytes: &[u8], from: usize) -> Option<usize> {
    let mut at = from;
    let mut depth = 0_usize;
    loop {
        match bytes.get(at)? {
            b'"' => {
                at = skip_text(bytes, at)?;
                if depth == 0 {
                    return Some(at);
                }
                continue;
            }
            b'{' | b'[' => depth += 1,
            b'}' | b']' | b',' if depth == 0 => return (at > from).then_some(at),
            b'}' | b']' => {
                depth -= 1;
                if depth == 0 {
                    return Some(at + 1);
                }
            }
            _ => {}
        }
        at += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn values_are_given_as_they_are_written() {
        let text = r#" { "topic" : "a\"/b", "payload": {"x": 1.50, "x": [NaN, "}"]} ,"q":0, "s":"" } "#;
        let found = members(text).expect("an object");
        let expected = [
            ("topic", r#""a\"/b""#),
            ("payload", r#"{"x": 1.50, "x": [NaN, "}"]}"#),
            ("q", "0"),
            ("s", r#""""#),
        ];
        assert_eq!(found.len(), expected.len());
        for ((name, value), (wanted, written)) in found.iter().zip(expected) {
            assert_eq!((name.as_str(), *value), (wanted, written));
        }
        assert_eq!(members("{}"), Some(Vec::new()));
    }

    #[test]
    fn what_is_no_object_has_no_members() {
        for text in [
            "",
            "[]",
            "{",
            "{\"a\"",
            "{\"a\":}",
            "{\"a\":1",
            "{\"a\":1} x",
            "{a:1}",
            "{\"a\":\"\\",
        ] {
            assert_eq!(members(text), None, "{text}");
        }
    }

    #[test]
    fn elements_are_given_as_they_are_written() {
        assert_eq!(
            elements(r#" [ {"a": "]"} , [1, 2],3 ] "#),
            Some(vec![r#"{"a": "]"}"#, "[1, 2]", "3"])
        );
        assert_eq!(elements("[]"), Some(Vec::new()));
        for text in ["", "{}", "[1", "[1,]x", "[1] 2"] {
            assert_eq!(elements(text), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "[\\[\\]{}\",:\\\\ a1ü]{0,60}") {
            let _ = (members(&text), elements(&text));
        }

        #[test]
        fn agrees_with_a_parser(value in prop::collection::btree_map("[a-zü\"\\\\]{0,4}", prop::collection::vec("[{}\"\\\\,a]{0,4}", 0..3), 0..4)) {
            let text = serde_json::to_string(&value).expect("written");
            let found = members(&text).expect("an object");
            for (name, written) in found {
                let list: Vec<String> = serde_json::from_str(written).expect("a value");
                prop_assert_eq!(&value[&name], &list);
            }
        }
    }
}
