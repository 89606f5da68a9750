//! How a deviation changes what a message says: small moves on JSON objects, so that most records are one line.

use serde_json::{Map, Value};

/// Edits of a JSON object. What is not there is left alone.
pub trait JsonEdit {
    /// Says something, instead of what was said there.
    fn set(&mut self, key: &str, value: impl Into<Value>);
    /// Says something where nothing is said.
    fn supply(&mut self, key: &str, value: impl Into<Value>);
    /// Says nothing of that any more.
    fn unset(&mut self, key: &str);
    /// Moves a member to another key.
    fn rename(&mut self, from: &str, to: &str);
    /// Changes a value that is there.
    fn change(&mut self, key: &str, change: impl FnOnce(&mut Value));
    /// Changes an object that is a member.
    fn part(&mut self, key: &str, change: impl FnOnce(&mut Self));
    /// Changes every object of a list.
    fn each(&mut self, list: &str, change: impl FnMut(&mut Self));
    /// Keeps only some entries of a list.
    fn keep(&mut self, list: &str, keep: impl FnMut(&Self) -> bool);
    /// The entries of a list; nothing to change where there is none.
    fn list(&mut self, list: &str) -> &mut [Value];
    /// Adds an entry to a list that is there.
    fn add(&mut self, list: &str, entry: Value);
    /// A text that is a member; empty where there is none.
    fn text(&self, key: &str) -> &str;
    /// Whether a member is exactly this.
    fn says(&self, key: &str, value: impl Into<Value>) -> bool;
}

impl JsonEdit for Map<String, Value> {
    fn set(&mut self, key: &str, value: impl Into<Value>) {
        self.insert(key.to_owned(), value.into());
    }

    fn supply(&mut self, key: &str, value: impl Into<Value>) {
        self.entry(key).or_insert_with(|| value.into());
    }

    fn unset(&mut self, key: &str) {
        self.remove(key);
    }

    fn rename(&mut self, from: &str, to: &str) {
        if let Some(value) = self.remove(from) {
            self.insert(to.to_owned(), value);
        }
    }

    fn change(&mut self, key: &str, change: impl FnOnce(&mut Value)) {
        if let Some(value) = self.get_mut(key) {
            change(value);
        }
    }

    fn part(&mut self, key: &str, change: impl FnOnce(&mut Self)) {
        if let Some(Value::Object(part)) = self.get_mut(key) {
            change(part);
        }
    }

    fn each(&mut self, list: &str, change: impl FnMut(&mut Self)) {
        self.list(list)
            .iter_mut()
            .filter_map(Value::as_object_mut)
            .for_each(change);
    }

    fn keep(&mut self, list: &str, mut keep: impl FnMut(&Self) -> bool) {
        if let Some(Value::Array(entries)) = self.get_mut(list) {
            entries.retain(|entry| entry.as_object().is_none_or(&mut keep));
        }
    }

    fn list(&mut self, list: &str) -> &mut [Value] {
        match self.get_mut(list) {
            Some(Value::Array(entries)) => entries,
            _ => &mut [],
        }
    }

    fn add(&mut self, list: &str, entry: Value) {
        if let Some(Value::Array(entries)) = self.get_mut(list) {
            entries.push(entry);
        }
    }

    fn text(&self, key: &str) -> &str {
        self.get(key).and_then(Value::as_str).unwrap_or_default()
    }

    fn says(&self, key: &str, value: impl Into<Value>) -> bool {
        self.get(key) == Some(&value.into())
    }
}
