//! Filling `${case.x}` and `${with.x}` into the tree, before anything is read from it.

use std::borrow::Cow;

use super::fields::Problems;
use tck_base::diagnostic::{Diagnostic, Source, did_you_mean};
use tck_base::yaml::{self, Kind, Node};

/// Values to fill in, under `case` or `with`.
pub(super) struct Fill<'a> {
    /// `case` or `with`.
    root: &'static str,
    /// How a variable of this root begins.
    opening: String,
    /// The mapping of names to values.
    values: &'a [(Node, Node)],
    /// Which of them were used.
    pub(super) used: Vec<bool>,
}

impl<'a> Fill<'a> {
    /// Nothing used yet.
    pub(super) fn new(root: &'static str, values: &'a [(Node, Node)]) -> Self {
        Self {
            root,
            opening: format!("${{{root}."),
            values,
            used: vec![false; values.len()],
        }
    }

    /// As [`Fill::apply`], sparing the copy where the text has no variable of this root.
    pub(super) fn apply_to<'n>(&mut self, node: &'n Node, problems: &mut Problems) -> Cow<'n, Node> {
        if self.is_in(&node.span.source) {
            Cow::Owned(self.apply(node, problems))
        } else {
            Cow::Borrowed(node)
        }
    }

    /// Whether a file has variables of this root.
    pub(super) fn is_in(&self, source: &Source) -> bool {
        source.text.contains(&self.opening)
    }

    /// A copy of `node` with every variable of this root replaced. A text that is one such variable becomes the
    /// whole value, with the place of the value; elsewhere the place of the use is kept.
    pub(super) fn apply(&mut self, node: &Node, problems: &mut Problems) -> Node {
        let kind = match &node.kind {
            Kind::Text { value, quoted } => match self.text(value, node, problems) {
                Filled::Untouched => return node.clone(),
                Filled::Whole(value) => return value,
                Filled::Text(value) => Kind::Text { value, quoted: *quoted },
            },
            Kind::List(items) => Kind::List(items.iter().flat_map(|item| self.item(item, problems)).collect()),
            Kind::Map(entries) => self.map(entries, problems),
            other => other.clone(),
        };
        Node {
            kind,
            span: node.span.clone(),
        }
    }

    /// An element of a list. A variable that stands for a list is its elements.
    fn item(&mut self, item: &Node, problems: &mut Problems) -> Vec<Node> {
        let filled = self.apply(item, problems);
        match (&item.kind, filled.kind) {
            (Kind::Text { .. }, Kind::List(items)) => items,
            (_, kind) => vec![Node {
                kind,
                span: filled.span,
            }],
        }
    }

    fn map(&mut self, entries: &[(Node, Node)], problems: &mut Problems) -> Kind {
        let mut filled: Vec<(Node, Node)> = Vec::with_capacity(entries.len());
        for (key, value) in entries {
            let mut name = self.apply(key, problems);
            if name.text().is_none() {
                problems.wrong_type(&name, "a text, to stand as a key,");
                name = key.clone();
            }
            if filled.iter().any(|(other, _)| other.text() == name.text()) {
                problems.at(
                    "duplicate-key",
                    &key.span,
                    format!("the key `{}` for a second time", name.text().unwrap_or_default()),
                    "once its variables are filled in",
                );
            }
            name.span = key.span.clone();
            filled.push((name, self.apply(value, problems)));
        }
        Kind::Map(filled)
    }

    fn text(&mut self, text: &str, at: &Node, problems: &mut Problems) -> Filled {
        if !text.contains(&self.opening) {
            return Filled::Untouched;
        }
        let mut filled = String::new();
        let mut rest = text;
        while let Some(start) = rest.find(&self.opening) {
            let name_from = start + self.opening.len();
            let Some(length) = rest[name_from..].find('}') else {
                break;
            };
            let name = &rest[name_from..name_from + length];
            let behind = &rest[name_from + length + 1..];
            let Some(value) = self.find(name, at, problems) else {
                return Filled::Untouched;
            };
            if start == 0 && behind.is_empty() && filled.is_empty() {
                return Filled::Whole(value.clone());
            }
            filled.push_str(&rest[..start]);
            match yaml::value(value) {
                serde_json::Value::String(text) => filled.push_str(&text),
                other => filled.push_str(&other.to_string()),
            }
            rest = behind;
        }
        filled.push_str(rest);
        Filled::Text(filled)
    }

    fn find(&mut self, name: &str, at: &Node, problems: &mut Problems) -> Option<&'a Node> {
        let (first, rest) = name.split_once('.').unwrap_or((name, ""));
        let place = self.values.iter().position(|(key, _)| key.text() == Some(first));
        let value = place.and_then(|place| {
            self.used[place] = true;
            rest.split('.')
                .filter(|part| !part.is_empty())
                .try_fold(&self.values[place].1, |value, part| value.get(part))
        });
        if value.is_none() {
            let names: Vec<&str> = self.values.iter().filter_map(|(key, _)| key.text()).collect();
            problems.add(
                Diagnostic::new(
                    "unknown-variable",
                    at.span.clone(),
                    format!("unknown variable `${{{}.{name}}}`", self.root),
                    "no value of this name",
                )
                .hint(match (names.is_empty(), self.root) {
                    (false, _) => did_you_mean(first, names),
                    (true, "case") => "this test has no `cases:`".to_owned(),
                    (true, _) => "the `use:` of this state does not say it under `with:`".to_owned(),
                }),
            );
        }
        value
    }
}

enum Filled {
    Untouched,
    Whole(Node),
    Text(String),
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use tck_base::diagnostic::Source;

    fn tree(text: &str) -> Node {
        yaml::tree(&Source::new("test", text)).expect("yaml")
    }

    #[test]
    fn a_variable_alone_takes_the_whole_value_and_within_text_its_text() {
        let row = tree("{list: [1, {a: b}], n: 5, id: X-1, name: y}");
        let test = tree(
            "{a: \"${case.list}\", b: \"n=${case.n}/${case.name}\", \"${case.id}\": \"${run.x}\", c: \"${case.list.a}\"}",
        );
        let mut problems = Problems::default();
        let mut fill = Fill::new("case", row.map().expect("map"));
        let filled = fill.apply(&test, &mut problems);
        assert_eq!(
            yaml::value(&filled),
            json!({"a": [1, {"a": "b"}], "b": "n=5/y", "X-1": "${run.x}", "c": "${case.list.a}"})
        );
        assert_eq!(filled.get("a").expect("a").span.text(), "[1, {a: b}]");
        assert_eq!(fill.used, [true, true, true, true]);
        assert_eq!(problems.into_sorted()[0].code, "unknown-variable");
    }

    #[test]
    fn keys_that_become_the_same_are_refused() {
        let row = tree("{a: x}");
        let mut problems = Problems::default();
        Fill::new("case", row.map().expect("map")).apply(&tree("{\"${case.a}\": 1, x: 2}"), &mut problems);
        assert_eq!(problems.into_sorted()[0].code, "duplicate-key");
    }
}
