//! Payloads as people read them: JSON set on lines without touching a token, anything else as it is.
//!
//! Numbers, escapes, the order of members and members that occur twice stay exactly as the device wrote
//! them; only blanks between tokens change.

use serde_json::Value;

use crate::clean;

/// Most lines of one payload.
const LINE_LIMIT: usize = 600;
/// Longest line in characters.
const WIDTH_LIMIT: usize = 1_000;
/// Bytes shown of a payload that is not text.
const DUMP_LIMIT: usize = 512;

/// One line of a payload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// The text, with its indent.
    pub text: String,
    /// Whether it is the place a verdict speaks of.
    pub marked: bool,
}

impl Line {
    fn plain(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            marked: false,
        }
    }
}

/// The lines of a JSON text that is known to parse; those at `places` (`errors[0].errorType` or
/// `/errors/0/errorType`) are marked, or the nearest places above them that exist.
pub fn json(text: &str, places: &[&str]) -> Vec<Line> {
    let root: Value = match places {
        [] => Value::Null,
        _ => serde_json::from_str(text).unwrap_or_default(),
    };
    let targets = places.iter().filter_map(|place| existing(&root, place)).collect();
    let mut writer = Writer {
        targets,
        ..Writer::default()
    };
    let mut rest = text.trim();
    while let Some(first) = rest.chars().next() {
        let length = token(rest, first);
        if !first.is_ascii_whitespace() {
            writer.take(&rest[..length], first);
        }
        rest = &rest[length..];
        if writer.lines.len() >= LINE_LIMIT {
            writer.flush();
            writer.lines.push(Line::plain(format!("… {} more bytes", rest.len())));
            return bound(writer.lines);
        }
    }
    writer.flush();
    bound(writer.lines)
}

/// The lines of bytes that are not JSON: as text, or as a dump.
pub fn other(bytes: &[u8]) -> Vec<Line> {
    let lines = match std::str::from_utf8(bytes) {
        Ok(text) => text.lines().take(LINE_LIMIT).map(Line::plain).collect(),
        Err(_) => dump(bytes),
    };
    bound(lines)
}

fn bound(mut lines: Vec<Line>) -> Vec<Line> {
    for line in &mut lines {
        let shown = clean::bounded(clean::line(&line.text), WIDTH_LIMIT).into_owned();
        line.text = shown;
    }
    lines
}

fn dump(bytes: &[u8]) -> Vec<Line> {
    let mut lines: Vec<Line> = bytes[..bytes.len().min(DUMP_LIMIT)]
        .chunks(16)
        .enumerate()
        .map(|(row, chunk)| {
            let hex: Vec<String> = chunk.iter().map(|byte| format!("{byte:02x}")).collect();
            let text: String = chunk
                .iter()
                .map(|byte| {
                    if byte.is_ascii_graphic() {
                        char::from(*byte)
                    } else {
                        '·'
                    }
                })
                .collect();
            Line::plain(format!("{:04x}  {:<47}  {text}", row * 16, hex.join(" ")))
        })
        .collect();
    if bytes.len() > DUMP_LIMIT {
        lines.push(Line::plain(format!("… {} more bytes", bytes.len() - DUMP_LIMIT)));
    }
    lines
}

/// Length of the token that begins a text: a string, a mark, blanks, or a number or word.
fn token(text: &str, first: char) -> usize {
    match first {
        '"' => {
            let mut escaped = false;
            for (at, character) in text.char_indices().skip(1) {
                match character {
                    _ if escaped => escaped = false,
                    '\\' => escaped = true,
                    '"' => return at + 1,
                    _ => {}
                }
            }
            text.len()
        }
        '{' | '}' | '[' | ']' | ',' | ':' => 1,
        blank if blank.is_ascii_whitespace() => blank.len_utf8(),
        _ => text
            .find(|c: char| matches!(c, '{' | '}' | '[' | ']' | ',' | ':' | '"') || c.is_ascii_whitespace())
            .unwrap_or(text.len())
            .max(first.len_utf8()),
    }
}

fn parts(place: &str) -> impl Iterator<Item = &str> {
    place.split(['.', '[', ']', '/']).filter(|part| !part.is_empty())
}

/// The longest beginning of `place` that exists.
fn existing(root: &Value, place: &str) -> Option<Vec<String>> {
    let mut value = root;
    let mut path = Vec::new();
    for part in parts(place) {
        let next = match value {
            Value::Array(items) => part.parse::<usize>().ok().and_then(|at| items.get(at)),
            other => other.get(part),
        };
        let Some(next) = next else { break };
        value = next;
        path.push(part.to_owned());
    }
    (!path.is_empty()).then_some(path)
}

/// Where the writer is inside one object or list.
struct Level {
    list: bool,
    place: String,
    index: usize,
    empty: bool,
}

#[derive(Default)]
struct Writer {
    targets: Vec<Vec<String>>,
    levels: Vec<Level>,
    lines: Vec<Line>,
    current: String,
    marked: bool,
    /// Whether the next string is the name of a member.
    name: bool,
}

impl Writer {
    fn flush(&mut self) {
        if !self.current.is_empty() {
            let text = std::mem::take(&mut self.current);
            self.lines.push(Line {
                text,
                marked: std::mem::take(&mut self.marked),
            });
        }
    }

    fn indent(&mut self) {
        if self.current.is_empty() {
            self.current = "  ".repeat(self.levels.len());
        }
    }

    /// A member or an element begins: on a line of its own.
    fn begin(&mut self) {
        if self.levels.last().is_some_and(|level| level.empty) {
            self.flush();
        }
        if let Some(level) = self.levels.last_mut() {
            level.empty = false;
        }
        self.indent();
    }

    /// A value begins: note the element of a list, and whether this is the place to mark.
    fn value_begins(&mut self) {
        if let Some(level) = self.levels.last_mut().filter(|level| level.list) {
            level.place = level.index.to_string();
            self.begin();
        }
        for target in &self.targets {
            let here = self.levels.iter().map(|level| level.place.as_str());
            self.marked |= here.eq(target.iter().map(String::as_str));
        }
    }

    fn open(&mut self, list: bool) {
        self.value_begins();
        self.current.push(if list { '[' } else { '{' });
        self.levels.push(Level {
            list,
            place: String::new(),
            index: 0,
            empty: true,
        });
        self.name = !list;
    }

    fn close(&mut self, mark: char) {
        if self.levels.pop().is_some_and(|level| !level.empty) {
            self.flush();
            self.indent();
        }
        self.current.push(mark);
        self.name = false;
    }

    fn comma(&mut self) {
        self.current.push(',');
        self.flush();
        if let Some(level) = self.levels.last_mut() {
            level.index += 1;
            self.name = !level.list;
        }
    }

    fn take(&mut self, token: &str, first: char) {
        match first {
            '{' => self.open(false),
            '[' => self.open(true),
            '}' | ']' => self.close(first),
            ',' => self.comma(),
            ':' => {
                self.current.push_str(": ");
                self.name = false;
            }
            _ if self.name => {
                self.begin();
                if let Some(level) = self.levels.last_mut() {
                    level.place = serde_json::from_str(token).unwrap_or_default();
                }
                self.current.push_str(token);
            }
            _ => {
                self.value_begins();
                self.current.push_str(token);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text(lines: &[Line]) -> String {
        lines
            .iter()
            .map(|line| line.text.clone())
            .collect::<Vec<_>>()
            .join("\n")
    }

    #[test]
    fn tokens_stay_as_the_device_wrote_them() {
        let raw = r#"{"a":1.0e3,"a":"\u0041","b":[],"c":{},"d":[1,{"e":null}],"f":[[2]]}"#;
        let expected = "{\n  \"a\": 1.0e3,\n  \"a\": \"\\u0041\",\n  \"b\": [],\n  \"c\": {},\n  \"d\": [\n    1,\n    {\n      \"e\": null\n    }\n  ],\n  \"f\": [\n    [\n      2\n    ]\n  ]\n}";
        assert_eq!(text(&json(raw, &[])), expected);
    }

    #[test]
    fn the_place_a_verdict_speaks_of_is_marked() {
        let raw = r#"{"errors":[{"errorType":"a"},{"errorType":"b","errorLevel":"FATAL"}]}"#;
        let marked = |place| {
            let lines = json(raw, &[place]);
            lines
                .into_iter()
                .filter(|line| line.marked)
                .map(|line| line.text.trim().to_owned())
                .collect::<Vec<_>>()
        };
        assert_eq!(marked("errors[1].errorLevel"), [r#""errorLevel": "FATAL""#]);
        assert_eq!(marked("/errors/0/errorType"), [r#""errorType": "a""#]);
        assert_eq!(marked("errors[0].errorReferences[0]"), ["{"]);
        assert_eq!(marked("errors"), [r#""errors": ["#]);
        assert!(marked("nothing").is_empty());
    }

    #[test]
    fn bytes_that_are_not_text_are_dumped() {
        let lines = other(&[0xff, b'{', 0]);
        assert_eq!(
            lines[0].text.split_whitespace().collect::<Vec<_>>(),
            ["0000", "ff", "7b", "00", "·{·"]
        );
        assert!(text(&other(&[0xff; 600])).ends_with("… 88 more bytes"));
    }

    fn any_json() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            "[ -~]{0,12}".prop_map(Value::from),
        ];
        leaf.prop_recursive(4, 40, 5, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
                prop::collection::vec(("[a-z\"\\\\]{0,5}", inner), 0..5)
                    .prop_map(|members| Value::Object(members.into_iter().collect())),
            ]
        })
    }

    proptest! {
        #[test]
        fn laid_out_json_is_what_serde_lays_out(value in any_json()) {
            let raw = value.to_string();
            let expected = serde_json::to_string_pretty(&value).unwrap();
            prop_assume!(expected.lines().count() < LINE_LIMIT);
            prop_assert_eq!(text(&json(&raw, &[])), expected);
        }

        #[test]
        fn no_text_makes_it_panic(raw in any::<String>()) {
            json(&raw, &["a[0].b", "/"]);
            other(raw.as_bytes());
        }
    }
}
