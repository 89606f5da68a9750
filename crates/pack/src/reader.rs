//! Members of a file of data with what is wrong with them: for the catalogue of requirements, the vocabulary of hooks and
//! counterparts.

use serde::de::DeserializeOwned;

use tck_base::diagnostic::{Diagnostic, did_you_mean};
use tck_base::yaml::Node;

/// Reads members, and collects every mistake under one code.
pub struct Reader<'a> {
    code: &'static str,
    problems: &'a mut Vec<Diagnostic>,
}

impl<'a> Reader<'a> {
    /// A reader that adds mistakes of this code.
    #[must_use]
    pub fn new(code: &'static str, problems: &'a mut Vec<Diagnostic>) -> Self {
        Self { code, problems }
    }

    /// A member that has to be there.
    pub fn member<'n>(&mut self, node: &'n Node, key: &str) -> Option<&'n Node> {
        let found = node.get(key);
        if found.is_none() {
            let title = format!("`{key}` is missing");
            self.problem(node, &title, "belongs here", &format!("add `{key}:`"));
        }
        found
    }

    /// A member that is a text and says something.
    pub fn text(&mut self, node: &Node, key: &str) -> Option<String> {
        let member = self.member(node, key)?;
        self.as_text(member)
    }

    /// A text that says something.
    pub fn as_text(&mut self, node: &Node) -> Option<String> {
        match node.text().map(str::trim) {
            Some(text) if !text.is_empty() => Some(text.to_owned()),
            Some(_) => {
                let title = "an empty text where a text is due";
                self.problem(node, title, "says nothing", "write a text, or take the key out");
                None
            }
            None => {
                self.wrong(node, "a text");
                None
            }
        }
    }

    /// A member that is a list.
    pub fn list<'n>(&mut self, node: &'n Node, key: &str) -> Option<&'n [Node]> {
        let member = self.member(node, key)?;
        if member.list().is_none() {
            self.wrong(member, "a list");
        }
        member.list()
    }

    /// A member that is one of these words.
    pub fn choice<T: DeserializeOwned>(&mut self, node: &Node, key: &str, words: &[&str]) -> Option<T> {
        let member = self.member(node, key)?;
        let word = self.as_text(member)?;
        if !words.contains(&word.as_str()) {
            let title = format!("`{word}` is not known for `{key}`");
            self.problem(
                member,
                &title,
                "unknown word",
                &did_you_mean(&word, words.iter().copied()),
            );
            return None;
        }
        serde_json::from_value(word.into()).ok()
    }

    /// Complains about members that are none of these.
    pub fn known(&mut self, node: &Node, keys: &[&str]) {
        for (key, _) in node.map().unwrap_or_default() {
            let name = key.text().unwrap_or_default();
            if !keys.contains(&name) {
                let title = format!("unknown key `{name}`");
                self.problem(key, &title, "not known here", &did_you_mean(name, keys.iter().copied()));
            }
        }
    }

    /// Complains about a value of another kind.
    pub fn wrong(&mut self, node: &Node, due: &str) {
        let title = format!("{} where {due} is due", node.kind_word());
        self.problem(node, &title, "of another kind", &format!("write {due}"));
    }

    /// Adds a mistake at a place.
    pub fn problem(&mut self, node: &Node, title: &str, label: &str, hint: &str) {
        self.problems
            .push(Diagnostic::new(self.code, node.span.clone(), title, label).hint(hint));
    }
}
