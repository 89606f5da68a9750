//! Plain YAML data into a tree with places, in a strict profile.
//!
//! The profile has no anchors, aliases, merge keys, tags or second documents; no duplicate keys, no tabs, and
//! nothing that different readers of YAML take for different values. So a text has one reading, and every JSON
//! text without tabs is a valid text. This is the one place that names the YAML crate. What the data means
//! (unknown keys, types of members) is left to the readers built on [`tree`].

use std::collections::HashSet;
use std::sync::Arc;

use saphyr_parser::{Event, Parser, ScalarStyle};
use serde_json::{Number, Value};

use crate::diagnostic::{Diagnostic, Source, Span};

/// The longest text that is read, in bytes.
pub const MAX_BYTES: usize = 1 << 20;
/// How deep lists and mappings may nest.
pub const MAX_DEPTH: usize = 64;
/// Diagnostics beyond this number are not collected.
const MAX_DIAGNOSTICS: usize = 50;

/// A value and the place it was read from.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// The value.
    pub kind: Kind,
    /// Where it stands, from its first to its last character.
    pub span: Span,
}

/// What a [`Node`] is.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// `null`, or nothing written.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// A number as JSON writes it.
    Number(Number),
    /// A text.
    Text {
        /// The text itself, quotes and escapes resolved.
        value: String,
        /// Whether it stood in quotes or in a block (`|`, `>`).
        quoted: bool,
    },
    /// A list.
    List(Vec<Node>),
    /// A mapping in the order written. Every key is a [`Kind::Text`], and no two are the same.
    Map(Vec<(Node, Node)>),
}

impl Node {
    /// The text, if this is one.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        match &self.kind {
            Kind::Text { value, .. } => Some(value),
            _ => None,
        }
    }

    /// The elements, if this is a list.
    #[must_use]
    pub fn list(&self) -> Option<&[Node]> {
        match &self.kind {
            Kind::List(items) => Some(items),
            _ => None,
        }
    }

    /// The entries, if this is a mapping.
    #[must_use]
    pub fn map(&self) -> Option<&[(Node, Node)]> {
        match &self.kind {
            Kind::Map(entries) => Some(entries),
            _ => None,
        }
    }

    /// The value under `key`, if this is a mapping that has it.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&Node> {
        self.map()?
            .iter()
            .find(|(name, _)| name.text() == Some(key))
            .map(|(_, value)| value)
    }

    /// What this is, in a user's words, such as "a text".
    #[must_use]
    pub fn kind_word(&self) -> &'static str {
        match self.kind {
            Kind::Null => "nothing",
            Kind::Bool(_) => "a boolean",
            Kind::Number(_) => "a number",
            Kind::Text { .. } => "a text",
            Kind::List(_) => "a list",
            Kind::Map(_) => "a mapping",
        }
    }
}

/// The data of a node without its places.
#[must_use]
pub fn value(node: &Node) -> Value {
    match &node.kind {
        Kind::Null => Value::Null,
        Kind::Bool(flag) => Value::Bool(*flag),
        Kind::Number(number) => Value::Number(number.clone()),
        Kind::Text { value, .. } => Value::String(value.clone()),
        Kind::List(items) => items.iter().map(value).collect(),
        Kind::Map(entries) => Value::Object(
            entries
                .iter()
                .filter_map(|(key, item)| Some((key.text()?.to_owned(), value(item))))
                .collect(),
        ),
    }
}

/// Reads a text. An empty one is a null.
///
/// # Errors
/// Everything that is not YAML or not in the strict profile, each with its place.
pub fn tree(source: &Arc<Source>) -> Result<Node, Vec<Diagnostic>> {
    if source.text.len() > MAX_BYTES {
        let title = format!("{} is longer than {MAX_BYTES} bytes", source.name);
        return Err(vec![Diagnostic::whole("yaml-too-long", title)]);
    }
    let mut builder = Builder::new(source);
    builder.refuse_tabs();
    builder.read();
    if builder.problems.is_empty() {
        Ok(builder.root.unwrap_or_else(|| Node {
            kind: Kind::Null,
            span: Span::new(source, 0, 0),
        }))
    } else {
        Err(builder.problems)
    }
}

/// A list or mapping whose end was not seen yet.
struct Open {
    kind: OpenKind,
    start: usize,
    /// One past the last byte seen inside.
    end: usize,
}

enum OpenKind {
    List(Vec<Node>),
    Map {
        entries: Vec<(Node, Node)>,
        key: Option<Node>,
        seen: HashSet<String>,
    },
}

struct Builder<'a> {
    source: &'a Arc<Source>,
    /// Byte offset of each character, empty when the text is ASCII and both are the same.
    offsets: Vec<usize>,
    open: Vec<Open>,
    root: Option<Node>,
    problems: Vec<Diagnostic>,
}

impl<'a> Builder<'a> {
    fn new(source: &'a Arc<Source>) -> Self {
        let offsets = if source.text.is_ascii() {
            Vec::new()
        } else {
            source.text.char_indices().map(|(at, _)| at).collect()
        };
        Self {
            source,
            offsets,
            open: Vec::new(),
            root: None,
            problems: Vec::new(),
        }
    }

    fn byte(&self, character: usize) -> usize {
        if self.offsets.is_empty() {
            character
        } else {
            self.offsets.get(character).copied().unwrap_or(self.source.text.len())
        }
    }

    fn problem(&mut self, code: &'static str, span: Span, title: &str, label: &str, hint: &str) {
        if self.problems.len() < MAX_DIAGNOSTICS {
            self.problems.push(Diagnostic::new(code, span, title, label).hint(hint));
        }
    }

    fn refuse_tabs(&mut self) {
        if let Some(at) = self.source.text.find('\t') {
            let span = Span::new(self.source, at, at + 1);
            let hint = "indent with spaces; inside a text in double quotes write \\t";
            self.problem("yaml-tab", span, "a tab", "a tab has no defined width", hint);
        }
    }

    fn read(&mut self) {
        let source = Arc::clone(self.source);
        let mut parser = Parser::new_from_str(&source.text);
        let mut documents = 0;
        while let Some(next) = parser.next_event() {
            let (event, place) = match next {
                Ok(read) => read,
                Err(error) => {
                    let at = self.byte(error.marker().index());
                    let span = Span::new(self.source, at, at + 1);
                    let title = format!("not valid YAML: {}", error.info());
                    self.problems
                        .push(Diagnostic::new("yaml-syntax", span, title, "reading stopped here"));
                    return;
                }
            };
            let span = Span::new(
                self.source,
                self.byte(place.start.index()),
                self.byte(place.end.index()),
            );
            match event {
                Event::DocumentStart(_) => {
                    documents += 1;
                    if documents > 1 {
                        let hint = "put it into a file of its own";
                        self.problem("yaml-documents", span, "a second document", "begins here", hint);
                        return;
                    }
                }
                Event::Alias(_) => {
                    let hint = "write the value out";
                    self.problem("yaml-alias", span.clone(), "an alias", "refers to another place", hint);
                    self.finished(Node { kind: Kind::Null, span });
                }
                Event::Scalar(text, style, anchor, tag) => {
                    self.refuse_decoration(&span, anchor, tag.is_some());
                    self.scalar(&text, style, span);
                }
                Event::SequenceStart(anchor, tag) => {
                    self.refuse_decoration(&span, anchor, tag.is_some());
                    if !self.begin(OpenKind::List(Vec::new()), &span) {
                        return;
                    }
                }
                Event::MappingStart(anchor, tag) => {
                    self.refuse_decoration(&span, anchor, tag.is_some());
                    let map = OpenKind::Map {
                        entries: Vec::new(),
                        key: None,
                        seen: HashSet::new(),
                    };
                    if !self.begin(map, &span) {
                        return;
                    }
                }
                Event::SequenceEnd | Event::MappingEnd => self.end(&span),
                Event::Nothing | Event::StreamStart | Event::StreamEnd | Event::DocumentEnd => {}
            }
        }
    }

    fn refuse_decoration(&mut self, span: &Span, anchor: usize, tagged: bool) {
        if anchor > 0 {
            let hint = "write the value out where it is needed";
            self.problem("yaml-anchor", span.clone(), "an anchor", "carries an anchor (&)", hint);
        }
        if tagged {
            let hint = "quote the value if a text is meant";
            self.problem("yaml-tag", span.clone(), "a tag", "carries a tag (!)", hint);
        }
    }

    fn begin(&mut self, kind: OpenKind, span: &Span) -> bool {
        if self.open.len() >= MAX_DEPTH {
            let title = format!("nested deeper than {MAX_DEPTH} levels");
            let hint = "no file of this tool needs that depth";
            self.problem("yaml-depth", span.clone(), &title, "one level too many", hint);
            return false;
        }
        self.open.push(Open {
            kind,
            start: span.start,
            end: span.end,
        });
        true
    }

    fn end(&mut self, span: &Span) {
        let Some(open) = self.open.pop() else { return };
        // The end of a block has no text of its own; the closing bracket of a flow style has.
        let end = if span.end > span.start {
            span.end.max(open.end)
        } else {
            open.end
        };
        // A closing bracket is reported together with the blanks behind it.
        let end = open.start
            + self
                .source
                .text
                .get(open.start..end)
                .map_or(0, |text| text.trim_end().len());
        let kind = match open.kind {
            OpenKind::List(items) => Kind::List(items),
            OpenKind::Map { entries, .. } => Kind::Map(entries),
        };
        self.finished(Node {
            kind,
            span: Span::new(self.source, open.start, end),
        });
    }

    /// Puts a complete node where it belongs.
    fn finished(&mut self, node: Node) {
        let Some(open) = self.open.last_mut() else {
            self.root.get_or_insert(node);
            return;
        };
        open.end = open.end.max(node.span.end);
        match &mut open.kind {
            OpenKind::List(items) => items.push(node),
            OpenKind::Map { entries, key, seen } => {
                if let Some(name) = key.take() {
                    entries.push((name, node));
                    return;
                }
                let mistake = key_mistake(&node, seen);
                let span = node.span.clone();
                *key = Some(node);
                if let Some((code, title, hint)) = mistake {
                    self.problem(code, span, &title, "not allowed here", hint);
                }
            }
        }
    }

    fn scalar(&mut self, text: &str, style: ScalarStyle, span: Span) {
        let kind = if style == ScalarStyle::Plain {
            plain(text).unwrap_or_else(|reason| {
                let title = format!("`{}` is read differently by different tools", short(text));
                let hint = format!("write \"{}\" in quotes if the text is meant{reason}", short(text));
                self.problem("yaml-ambiguous", span.clone(), &title, "needs quotes", &hint);
                Kind::Null
            })
        } else {
            Kind::Text {
                value: text.to_owned(),
                quoted: true,
            }
        };
        self.finished(Node { kind, span });
    }
}

/// What is wrong with a key: code, title, hint.
fn key_mistake(key: &Node, seen: &mut HashSet<String>) -> Option<(&'static str, String, &'static str)> {
    let Some(text) = key.text() else {
        let title = format!("{} as a key", key.kind_word());
        return Some(("yaml-key", title, "quote it: every key is a text"));
    };
    if text == "<<" {
        return Some(("yaml-merge", "a merge key".to_owned(), "write the members out"));
    }
    if seen.insert(text.to_owned()) {
        return None;
    }
    let title = format!("the key `{}` for a second time", short(text));
    Some(("yaml-duplicate-key", title, "keep one of the two"))
}

/// The value of a scalar without quotes, or what else could have been meant by an ambiguous one.
fn plain(text: &str) -> Result<Kind, &'static str> {
    Ok(match text {
        "" | "null" => Kind::Null,
        "true" => Kind::Bool(true),
        "false" => Kind::Bool(false),
        "~" | "Null" | "NULL" => return Err(", or null"),
        _ if ["true", "yes", "on"].iter().any(|word| text.eq_ignore_ascii_case(word)) => return Err(", or true"),
        _ if ["false", "no", "off"]
            .iter()
            .any(|word| text.eq_ignore_ascii_case(word)) =>
        {
            return Err(", or false");
        }
        _ => match serde_json::from_str::<Number>(text) {
            Ok(number) => Kind::Number(number),
            Err(_) if resembles_number(text) => return Err(", or the number as JSON writes it"),
            Err(_) => Kind::Text {
                value: text.to_owned(),
                quoted: false,
            },
        },
    })
}

/// Whether some YAML reader takes `text`, which is no JSON number, for a number: `0001`, `+1`, `.5`, `1_000`, `0x1f`, `.inf`.
fn resembles_number(text: &str) -> bool {
    let bare = text.strip_prefix(['+', '-']).unwrap_or(text);
    if [".inf", ".nan"].iter().any(|word| bare.eq_ignore_ascii_case(word)) {
        return true;
    }
    if !bare.starts_with(|first: char| first.is_ascii_digit() || first == '.') {
        return false;
    }
    let digits: String = bare.chars().filter(|c| *c != '_').collect();
    [("0x", 16), ("0o", 8), ("0b", 2)].iter().any(|(prefix, radix)| {
        digits
            .strip_prefix(prefix)
            .is_some_and(|rest| !rest.is_empty() && rest.chars().all(|c| c.is_digit(*radix)))
    }) || digits.parse::<f64>().is_ok()
}

/// At most 40 characters of a text, for a message.
fn short(text: &str) -> String {
    if text.chars().count() <= 40 {
        return text.to_owned();
    }
    let start: String = text.chars().take(40).collect();
    format!("{start}…")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    fn read(text: &str) -> Result<Node, Vec<Diagnostic>> {
        tree(&Source::new("test.yaml", text))
    }

    fn data(text: &str) -> Value {
        value(&read(text).expect("valid"))
    }

    fn code(text: &str) -> &'static str {
        read(text).expect_err(text)[0].code
    }

    #[test]
    fn plain_data_keeps_its_types_and_its_order() {
        assert_eq!(
            data("b: 1\na: [x, 2.50, true, null, \"1\", '']\nc:\nd: |\n  line\n  two\ne: {f: -3e2}\n"),
            json!({"b": 1, "a": ["x", 2.5, true, null, "1", ""], "c": null, "d": "line\ntwo\n", "e": {"f": -300.0}})
        );
        assert_eq!(data(""), Value::Null);
        assert_eq!(data("# only a comment\n"), Value::Null);
    }

    #[test]
    fn json_is_valid_yaml() {
        let message = json!({"errors": [{"errorType": "x", "errorReferences": []}], "y": {"n": [1, -2.5e-3, false, "a\"\\\u{1F600}"]}});
        assert_eq!(data(&message.to_string()), message);
        assert_eq!(data(&serde_json::to_string_pretty(&message).expect("json")), message);
    }

    #[test]
    fn texts_that_are_no_numbers_stay_texts() {
        for text in [
            "1.2.3",
            "2024-01-02",
            "12:30",
            "0e3b77",
            "a",
            "x_1",
            "1.2.3.4",
            "5 s",
            "y",
            "n",
            "a-b",
            "0xyz",
            "infinity",
            "1 -> 2",
        ] {
            let node = read(&format!("k: {text}")).unwrap_or_else(|_| panic!("{text}"));
            assert_eq!(value(&node), json!({ "k": text }));
        }
    }

    #[test]
    fn what_tools_read_differently_must_be_quoted() {
        for text in [
            "0001", "1_000", "+1", ".5", "1.", "0x1F", "0o17", "-.inf", ".NaN", "NO", "yes", "On", "off", "True",
            "FALSE", "~", "Null", "1e999", "-01",
        ] {
            assert_eq!(code(&format!("k: {text}")), "yaml-ambiguous", "{text}");
            assert_eq!(data(&format!("k: \"{text}\"")), json!({ "k": text }));
        }
        assert_eq!(code("no: 1"), "yaml-ambiguous");
    }

    #[test]
    fn everything_outside_the_profile_is_refused() {
        assert_eq!(code("a: &x 1\nb: 2"), "yaml-anchor");
        assert_eq!(code("a: &x [1]"), "yaml-anchor");
        assert_eq!(code("a: &x {b: 1}"), "yaml-anchor");
        assert!(
            read("a: &x 1\nb: *x")
                .expect_err("alias")
                .iter()
                .any(|d| d.code == "yaml-alias")
        );
        assert_eq!(code("a: !!str 1"), "yaml-tag");
        assert_eq!(code("a: !custom {}"), "yaml-tag");
        assert_eq!(code("<<: {a: 1}"), "yaml-merge");
        assert_eq!(code("a: 1\n---\nb: 2"), "yaml-documents");
        assert_eq!(code("a: 1\na: 2"), "yaml-duplicate-key");
        assert_eq!(code("a: {b: 1, \"b\": 2}"), "yaml-duplicate-key");
        assert_eq!(code("1: 2"), "yaml-key");
        assert_eq!(code("? [a]\n: 2"), "yaml-key");
        assert_eq!(code("a:\n\t- b"), "yaml-tab");
        assert_eq!(code("a: [1"), "yaml-syntax");
        assert_eq!(code(&"[".repeat(65)), "yaml-depth");
        assert!(read(&format!("{}{}", "[".repeat(64), "]".repeat(64))).is_ok());
        assert_eq!(code(&"#".repeat(MAX_BYTES + 1)), "yaml-too-long");
    }

    #[test]
    fn several_mistakes_are_told_at_once() {
        let problems = read("a: yes\nb: 01\na: 3").expect_err("three");
        let lines: Vec<_> = problems.iter().filter_map(|d| Some(d.span.as_ref()?.line())).collect();
        assert_eq!(lines, [1, 2, 3]);
    }

    #[test]
    fn spans_cover_what_was_written_also_behind_wide_characters() {
        for newline in ["\n", "\r\n"] {
            let text = [
                "título: \"🤖é\"",
                "list:",
                "  - { a: 1, b: [x] }",
                "  - two",
                "last: end",
                "",
            ]
            .join(newline);
            let root = read(&text).expect("valid");
            let place = |node: &Node| node.span.text().to_owned();
            assert_eq!(place(root.get("título").expect("key")), "\"🤖é\"");
            let list = root.get("list").expect("key");
            assert_eq!(place(&list.list().expect("list")[0]), "{ a: 1, b: [x] }");
            assert_eq!(list.span.line(), 3);
            let inner = read("a: { b: { c: 1 } }").expect("valid");
            assert_eq!(place(inner.get("a").and_then(|a| a.get("b")).expect("b")), "{ c: 1 }");
            assert!(place(list).ends_with("two"), "{:?}", place(list));
            assert_eq!(place(&root.map().expect("map")[2].0), "last");
            assert!(place(&root).ends_with("end"));
        }
    }

    #[test]
    fn quotes_are_known() {
        let root = read("a: \"${x}\"\nb: ${x}\n").expect("valid");
        assert!(matches!(
            root.get("a").expect("a").kind,
            Kind::Text { quoted: true, .. }
        ));
        assert!(matches!(
            root.get("b").expect("b").kind,
            Kind::Text { quoted: false, .. }
        ));
    }

    proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "[ -~\\n\\t\\ré🤖]{0,200}") {
            let _ = read(&text);
        }

        #[test]
        fn yaml_shaped_text_does_not_make_it_panic(text in "([a-c:\\-\\[\\]{},\"'|>&*!?#%\\n ]){0,80}") {
            if let Err(problems) = read(&text) {
                for problem in problems {
                    let _ = problem.render(false);
                }
            }
        }
    }
}
