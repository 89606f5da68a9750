//! Where something stands in the text of a message.

use std::collections::BTreeSet;
use std::ops::Range;

use serde_json::Value;

/// How deep a message may be; what is deeper is not searched.
const DEPTH: usize = 128;
/// How many words of a text are taken for the name of a member.
const WORDS: usize = 200;

/// The bytes of the value at a JSON pointer. Of a member that is missing, the bytes of the innermost value that is there.
/// `None` when the text is not JSON up to there.
#[must_use]
pub fn of(text: &[u8], pointer: &str) -> Option<Range<usize>> {
    let mut wanted = pointer;
    loop {
        let mut found = None;
        walk(text, &mut |path, _, value| {
            if path == wanted {
                // Of members of the same name the last one counts.
                found = Some(value);
            }
        });
        if found.is_some() {
            return found;
        }
        (wanted, _) = wanted.rsplit_once('/')?;
    }
}

/// The names of members that stand there twice: pointer of the member, and the bytes of the later name.
#[must_use]
pub fn repeated(text: &[u8]) -> Vec<(String, Range<usize>)> {
    let mut seen = BTreeSet::new();
    let mut all = Vec::new();
    walk(text, &mut |path, name, _| {
        if let Some(name) = name
            && !seen.insert(path.to_owned())
        {
            all.push((path.to_owned(), name));
        }
    });
    all
}

/// The bytes of a member of the outermost object.
#[must_use]
pub fn member(text: &[u8], name: &str) -> Option<Range<usize>> {
    let mut found = None;
    walk(text, &mut |path, at, value| {
        if at.is_some() && path.strip_prefix('/') == Some(name) {
            found = Some(value);
        }
    });
    found
}

/// Line and column of a byte, both counted from 1; columns are characters.
#[must_use]
pub fn line_and_column(text: &[u8], at: usize) -> (usize, usize) {
    let before = &text[..at.min(text.len())];
    let line = before.split(|byte| *byte == b'\n').count();
    let begin = before.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    (line, String::from_utf8_lossy(&before[begin..]).chars().count() + 1)
}

/// The members of a message that a sentence about the message names, as JSON pointers: `state/driving`,
/// `nodeStates[2].released`, or just `timestamp`. Only the most precise ones.
#[must_use]
pub fn named(sentence: &str, topic: &str, message: &Value) -> Vec<String> {
    let is_part = |c: char| c.is_alphanumeric() || matches!(c, '/' | '.' | '[' | ']' | '_');
    let mut all: Vec<String> = Vec::new();
    for word in sentence.split(|c: char| !is_part(c)).take(WORDS) {
        let word = word.trim_matches(['.', '/']);
        let parts: Vec<&str> = word
            .split(['/', '.', '[', ']'])
            .filter(|part| !part.is_empty())
            .collect();
        let parts = match parts.split_first() {
            Some((first, rest)) if *first == topic && !rest.is_empty() => rest,
            Some(_) => &parts[..],
            None => continue,
        };
        let pointer = format!("/{}", parts.join("/"));
        let holder = pointer.rsplit_once('/').map_or("", |(holder, _)| holder);
        let is_there = message.pointer(&pointer).is_some();
        // A member that is missing is marked where it should be.
        let may_be_missing = parts.len() > 1 && message.pointer(holder).is_some_and(Value::is_object);
        if (is_there || may_be_missing) && !all.contains(&pointer) {
            all.push(pointer);
        }
    }
    let depth = |pointer: &String| pointer.matches('/').count();
    let deepest = all.iter().map(depth).max().unwrap_or_default();
    all.retain(|pointer| deepest < 2 || depth(pointer) > 1);
    all
}

/// What is called for a value: with its pointer, the bytes of its name if it is a member, and its own bytes.
type Visit<'v> = dyn FnMut(&str, Option<Range<usize>>, Range<usize>) + 'v;

/// Calls `visit` for every value, the outer one after what is in it: its pointer, the bytes of its name if it is a member,
/// and its own bytes. Ends at what is not JSON.
fn walk(text: &[u8], visit: &mut Visit<'_>) {
    let mut walker = Walker {
        text,
        path: String::new(),
        visit,
    };
    walker.value(0, None, 0);
}

struct Walker<'t, 'v> {
    text: &'t [u8],
    path: String,
    visit: &'v mut Visit<'v>,
}

impl Walker<'_, '_> {
    fn blank(&self, mut at: usize) -> usize {
        while self.text.get(at).is_some_and(u8::is_ascii_whitespace) {
            at += 1;
        }
        at
    }

    /// Reads the value from there on; gives where it ends.
    fn value(&mut self, at: usize, name: Option<Range<usize>>, depth: usize) -> Option<usize> {
        let begin = self.blank(at);
        let end = match self.text.get(begin)? {
            _ if depth > DEPTH => return None,
            b'{' => self.inside(begin + 1, b'}', depth)?,
            b'[' => self.inside(begin + 1, b']', depth)?,
            b'"' => self.string(begin)?,
            _ => {
                let rest = &self.text[begin..];
                let is_over = |byte: &u8| matches!(byte, b',' | b'}' | b']') || byte.is_ascii_whitespace();
                let length = rest.iter().position(is_over).unwrap_or(rest.len());
                if length == 0 {
                    return None;
                }
                begin + length
            }
        };
        (self.visit)(&self.path, name, begin..end);
        Some(end)
    }

    fn inside(&mut self, mut at: usize, close: u8, depth: usize) -> Option<usize> {
        let outer = self.path.len();
        at = self.blank(at);
        if *self.text.get(at)? == close {
            return Some(at + 1);
        }
        for number in 0_usize.. {
            at = self.blank(at);
            let mut name = None;
            let part = if close == b'}' {
                let end = self.string(at)?;
                let text: String = serde_json::from_slice(&self.text[at..end]).ok()?;
                name = Some(at..end);
                at = self.blank(end);
                if *self.text.get(at)? != b':' {
                    return None;
                }
                at += 1;
                text.replace('~', "~0").replace('/', "~1")
            } else {
                number.to_string()
            };
            self.path.push('/');
            self.path.push_str(&part);
            let end = self.value(at, name, depth + 1);
            self.path.truncate(outer);
            at = self.blank(end?);
            match self.text.get(at)? {
                b',' => at += 1,
                byte if *byte == close => return Some(at + 1),
                _ => return None,
            }
        }
        None
    }

    fn string(&self, begin: usize) -> Option<usize> {
        if *self.text.get(begin)? != b'"' {
            return None;
        }
        let mut at = begin + 1;
        loop {
            match self.text.get(at)? {
                b'"' => return Some(at + 1),
                b'\\' => at += 2,
                _ => at += 1,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::json;

    use super::*;

    const TEXT: &str = "{\n  \"a\": {\"b/c\": [1, {\"d\": \"x\\\"}\"}, true]},\n  \"e\": NaN\n}";

    fn at(pointer: &str) -> Option<&str> {
        of(TEXT.as_bytes(), pointer).map(|range| &TEXT[range])
    }

    #[test]
    fn a_value_is_found_by_its_pointer() {
        assert_eq!(at("/a/b~1c/0"), Some("1"));
        assert_eq!(at("/a/b~1c/1/d"), Some("\"x\\\"}\""));
        assert_eq!(at("/a/b~1c/2"), Some("true"));
        assert_eq!(at("/a/b~1c/1/missing"), Some("{\"d\": \"x\\\"}\"}"));
        assert_eq!(at("/e"), Some("NaN"));
        assert_eq!(at("").map(str::len), Some(TEXT.len()));
        assert_eq!(of(b"{\"a\":", "/b"), None);
    }

    #[test]
    fn lines_and_columns_are_counted_as_people_do() {
        let place =
            |pointer: &str| of(TEXT.as_bytes(), pointer).map(|range| line_and_column(TEXT.as_bytes(), range.start));
        assert_eq!(place(""), Some((1, 1)));
        assert_eq!(place("/a/b~1c/0"), Some((2, 17)));
        assert_eq!(place("/e"), Some((3, 8)));
        assert_eq!(line_and_column("ü\nüx".as_bytes(), 5), (2, 2));
    }

    #[test]
    fn members_of_the_same_name_are_found() {
        let text = br#"{"a":{"b":1,"b":2},"c":[{"b":1},{"b":1}],"a":3}"#;
        let found: Vec<String> = repeated(text).into_iter().map(|(pointer, _)| pointer).collect();
        assert_eq!(found, ["/a/b", "/a"]);
        assert_eq!(of(text, "/a").map(|range| &text[range]), Some(&b"3"[..]));
    }

    #[test]
    fn a_member_of_the_outermost_object_is_found_and_none_deeper() {
        let text = br#"{"a": {"b": 1}, "c": "x"}"#;
        assert_eq!(member(text, "c").map(|range| &text[range]), Some(&b"\"x\""[..]));
        assert_eq!(member(text, "b"), None);
        assert_eq!(member(b"[1]", "0"), None);
    }

    #[test]
    fn a_sentence_names_members() {
        let message = json!({ "timestamp": "", "driving": 1, "nodeStates": [{ "released": 1 }] });
        let named = |sentence: &str| named(sentence, "state", &message);
        assert_eq!(named("state/driving: 1 is not of type boolean"), ["/driving"]);
        assert_eq!(named("timestamp \"x\" on state is no time"), ["/timestamp"]);
        assert_eq!(
            named("nodeStates[0].released is wrong, see timestamp."),
            ["/nodeStates/0/released"]
        );
        assert_eq!(
            named("state/nodeStates/0/nodeId: `nodeId` is missing"),
            ["/nodeStates/0/nodeId"]
        );
        assert!(named("nothing at all").is_empty());
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), pointer in "(/[a-z0-9]{0,2}){0,3}") {
            let range = of(&bytes, &pointer);
            prop_assert!(range.is_none_or(|range| range.end <= bytes.len()));
            let _ = repeated(&bytes);
        }

        #[test]
        fn what_is_found_is_the_value(name in "[a-z/~\"ü]{0,4}", number in any::<i32>(), pretty in any::<bool>()) {
            let value = json!({ "first": [0, { &name: number }], "last": [] });
            let text = if pretty { format!("{value:#}") } else { value.to_string() };
            let pointer = format!("/first/1/{}", name.replace('~', "~0").replace('/', "~1"));
            let found = of(text.as_bytes(), &pointer).map(|range| text[range].to_owned());
            prop_assert_eq!(found, Some(number.to_string()));
        }
    }
}
