//! What is different of one member in a version, and how it is written.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::{Value, json};

use super::object::Object;

/// What is different of a member, where it is more than its name.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Details {
    /// Its name, which stands in the table of names.
    #[serde(rename = "name")]
    _name: Option<String>,
    /// The member that its elements stand in, where the version has none of its own for them.
    pub(super) among: Option<String>,
    /// What is written for words of 2.x.
    #[serde(default)]
    words: BTreeMap<String, String>,
    /// Whether a radius is written as an ellipse.
    #[serde(default)]
    ellipse: bool,
}

impl Details {
    /// Whether it says where something stands, and no more.
    pub(super) fn is_place(&self) -> bool {
        self.among.is_some() && self.words.is_empty() && !self.ellipse
    }
}

/// How a version writes a member that is told by its usual name.
#[derive(Clone, Copy, Debug)]
pub struct Spelling<'n> {
    /// Its name, with a slash where it stands inside another one; `None` where messages of the version do not have it.
    pub name: Option<&'n str>,
    /// The kind of object that it holds, or that its elements are.
    pub holds: Option<Object>,
    details: Option<&'n Details>,
}

impl<'n> Spelling<'n> {
    pub(super) const fn new(name: Option<&'n str>, holds: Option<Object>, details: Option<&'n Details>) -> Self {
        Self { name, holds, details }
    }

    /// What stands in the member where the usual word is this one.
    #[must_use]
    pub fn word<'w>(&self, usual: &'w str) -> &'w str
    where
        'n: 'w,
    {
        let own = self.details.and_then(|details| details.words.get(usual));
        own.map_or(usual, String::as_str)
    }

    /// The usual word for what stands in the member.
    fn usual_word<'w>(&self, own: &'w str) -> &'w str
    where
        'n: 'w,
    {
        let mut words = self.details.into_iter().flat_map(|details| &details.words);
        words
            .find(|(_, word)| *word == own)
            .map_or(own, |(usual, _)| usual.as_str())
    }

    /// What stands in the member, where nothing is said of an object in it.
    pub(super) fn write(&self, value: &mut Value) {
        let is_ellipse = self.details.is_some_and(|details| details.ellipse);
        if let (Value::Number(radius), true) = (&*value, is_ellipse) {
            *value = json!({ "a": radius, "b": radius, "theta": 0.0 });
        }
        each_text(value, |text| self.word(text).to_owned());
    }
}

impl Spelling<'_> {
    /// What stands in the member, told as 2.x does: of an ellipse the radius of the circle inside it, and nothing where it is none.
    pub(super) fn read(&self, value: &mut Value) {
        if self.details.is_some_and(|details| details.ellipse) {
            *value = inner_radius(value).map_or(Value::Null, Value::from);
        }
        each_text(value, |text| self.usual_word(text).to_owned());
    }
}

/// The radius of the largest circle inside an ellipse.
fn inner_radius(ellipse: &Value) -> Option<f64> {
    let half = |axis: &str| ellipse.get(axis)?.as_f64().filter(|half| *half >= 0.0);
    let (a, b) = (half("a")?, half("b")?);
    ellipse.get("theta")?.is_number().then(|| a.min(b))
}

/// Changes a text, or each text of a list.
fn each_text(value: &mut Value, change: impl Fn(&str) -> String + Copy) {
    match value {
        Value::String(text) => *text = change(text),
        Value::Array(elements) => {
            for element in elements {
                if let Value::String(text) = element {
                    *text = change(text);
                }
            }
        }
        _ => {}
    }
}
