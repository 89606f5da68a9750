//! Every way to break one member of a message, read from its schema: cases for tests of what is refused.
//!
//! A breakage is a JSON Patch for a message that is right, so that nothing else is wrong with it. It has one operation
//! more than RFC 6902: `as-text` puts the value that stands there in quotes.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::shape::{kinds, parts};

/// A word no enumeration of a schema has.
const NO_WORD: &str = "TCKNOSUCHWORD";

/// How deep a message is entered.
const MAX_DEPTH: usize = 12;

/// How a member is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Way {
    /// It is left out.
    Missing,
    /// It is `null`.
    Null,
    /// It has another JSON type.
    Type,
    /// It is a number or a Boolean in quotes.
    Text,
    /// It is none of the words allowed.
    Word,
    /// It is a fraction where whole numbers are due.
    Fraction,
    /// It is below its minimum.
    Below,
    /// It is above its maximum.
    Above,
    /// It has nothing in it where something is due.
    Empty,
}

impl Way {
    /// Every way, by the word suites have for it.
    pub const ALL: [(&'static str, Self); 9] = [
        ("missing", Self::Missing),
        ("null", Self::Null),
        ("type", Self::Type),
        ("text", Self::Text),
        ("word", Self::Word),
        ("fraction", Self::Fraction),
        ("below", Self::Below),
        ("above", Self::Above),
        ("empty", Self::Empty),
    ];

    /// The word suites have for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        let found = Self::ALL.iter().find(|(_, way)| *way == self);
        found.map_or("", |(word, _)| *word)
    }
}

/// One member, broken in one way.
#[derive(Clone, Debug, PartialEq)]
pub struct Breakage {
    /// The member, lists entered without an index: `nodes.released`.
    pub member: String,
    /// How.
    pub way: Way,
    /// The innermost optional member on the way to it, itself included; `None` when all of them are required.
    pub optional: Option<String>,
    /// A list of operations of JSON Patch.
    pub patch: Value,
}

/// Which parts of a message are there to be broken.
#[derive(Clone, Debug, Default)]
pub struct BreakageScope {
    /// Which element of a list is entered; a list that is not named is taken as a whole.
    pub elements: BTreeMap<String, usize>,
    /// Optional objects that are put in to be broken; one that is not named is taken as a whole.
    pub holding: BTreeMap<String, Value>,
}

/// Every breakage, in the order of the schema.
pub(super) fn breakages(root: &Value, ground: &BreakageScope) -> Vec<Breakage> {
    let mut walk = Walk {
        root,
        ground,
        found: Vec::new(),
    };
    let top = WalkPosition::default();
    walk.object(&parts(root, root), &top, 0);
    walk.found
}

/// Where a walk is.
#[derive(Clone, Default)]
struct WalkPosition {
    member: String,
    pointer: String,
    optional: Option<String>,
    /// What has to be put in first.
    first: Vec<Value>,
}

struct Walk<'a> {
    root: &'a Value,
    ground: &'a BreakageScope,
    found: Vec<Breakage>,
}

impl<'a> Walk<'a> {
    fn object(&mut self, here: &[&'a Value], place: &WalkPosition, depth: usize) {
        if depth > MAX_DEPTH {
            return;
        }
        let needs: Vec<&str> = here
            .iter()
            .filter_map(|part| part.get("required")?.as_array())
            .flatten()
            .filter_map(Value::as_str)
            .collect();
        let members = here
            .iter()
            .filter_map(|part| part.get("properties")?.as_object())
            .flatten();
        for (name, schema) in members {
            let required = needs.contains(&name.as_str());
            let mut inner = place.clone();
            if !inner.member.is_empty() {
                inner.member.push('.');
            }
            inner.member.push_str(name);
            inner.pointer.push('/');
            inner.pointer.push_str(&name.replace('~', "~0").replace('/', "~1"));
            if !required {
                inner.optional = Some(inner.member.clone());
            }
            let child = parts(self.root, schema);
            self.leaf(&child, &inner, required);
            self.enter(&child, inner, required, depth);
        }
    }

    /// Goes on inside a member, where there is something to break.
    fn enter(&mut self, child: &[&'a Value], mut place: WalkPosition, required: bool, depth: usize) {
        if !required {
            let Some(value) = self.ground.holding.get(&place.member) else {
                return;
            };
            place
                .first
                .push(json!({ "op": "add", "path": place.pointer, "value": value }));
        }
        let items: Vec<&Value> = child
            .iter()
            .filter_map(|part| part.get("items"))
            .flat_map(|items| parts(self.root, items))
            .collect();
        if items.is_empty() {
            self.object(child, &place, depth + 1);
        } else if let Some(index) = self.ground.elements.get(&place.member) {
            place.pointer = format!("{}/{index}", place.pointer);
            self.object(&items, &place, depth + 1);
        }
    }

    fn leaf(&mut self, schema: &[&Value], place: &WalkPosition, required: bool) {
        let kinds = kinds(schema);
        let number = |word: &str| schema.iter().find_map(|part| part.get(word)?.as_f64());
        let some = |word: &str| number(word).is_some_and(|least| least > 0.0);
        let path = place.pointer.as_str();
        let put = |value: Value| json!({ "op": "add", "path": path, "value": value });
        let quoted = |usual: &str| {
            if required {
                json!({ "op": "as-text", "path": path })
            } else {
                put(json!(usual))
            }
        };
        if required {
            self.add(place, Way::Missing, json!({ "op": "remove", "path": path }));
            if !kinds.contains(&"null") {
                self.add(place, Way::Null, put(Value::Null));
            }
        }
        let &[kind] = kinds.as_slice() else { return };
        let other = match kind {
            "string" => json!(7),
            "array" => json!({}),
            "object" => json!("none"),
            "boolean" => json!(1),
            _ => json!([]),
        };
        self.add(place, Way::Type, put(other));
        match kind {
            "boolean" => self.add(place, Way::Text, quoted("true")),
            "integer" | "number" => self.add(place, Way::Text, quoted("1")),
            "string" if schema.iter().any(|part| part.get("enum").is_some()) => {
                self.add(place, Way::Word, put(json!(NO_WORD)));
            }
            "string" if some("minLength") => self.add(place, Way::Empty, put(json!(""))),
            "array" if some("minItems") => self.add(place, Way::Empty, put(json!([]))),
            _ => {}
        }
        if kind == "integer" {
            self.add(place, Way::Fraction, put(json!(1.5)));
        }
        if let Some(least) = number("minimum") {
            self.add(place, Way::Below, put(plain(least - 1.0)));
        }
        if let Some(most) = number("maximum") {
            self.add(place, Way::Above, put(plain(most + 1.0)));
        }
    }

    fn add(&mut self, place: &WalkPosition, way: Way, operation: Value) {
        let mut patch = place.first.clone();
        patch.push(operation);
        self.found.push(Breakage {
            member: place.member.clone(),
            way,
            optional: place.optional.clone(),
            patch: Value::Array(patch),
        });
    }
}

/// A whole number is written as one.
fn plain(number: f64) -> Value {
    if number.fract() == 0.0 && number.abs() < 9e15 {
        #[expect(clippy::cast_possible_truncation, reason = "whole and small, as checked above")]
        let whole = number as i64;
        return json!(whole);
    }
    json!(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schema() -> Value {
        json!({
            "type": "object",
            "required": ["id", "list"],
            "properties": {
                "id": { "$ref": "#/$defs/whole" },
                "note": { "type": "string" },
                "list": { "type": "array", "items": {
                    "type": "object", "required": ["word", "is"], "properties": {
                        "word": { "type": "string", "enum": ["ONE"] },
                        "is": { "type": "boolean" }
                    }
                } },
                "box": { "type": "object", "required": ["x"], "properties": { "x": { "type": "number" } } }
            },
            "$defs": { "whole": { "type": "integer", "minimum": 0, "maximum": 9 } }
        })
    }

    fn named(ground: &BreakageScope) -> Vec<String> {
        let all = breakages(&schema(), ground);
        all.iter()
            .map(|one| format!("{}-{}", one.member, one.way.word()))
            .collect()
    }

    #[test]
    fn each_member_is_broken_in_each_way_its_schema_knows() {
        let ground = BreakageScope {
            elements: BTreeMap::from([("list".to_owned(), 1)]),
            holding: BTreeMap::from([("box".to_owned(), json!({ "x": 2.5 }))]),
        };
        let names = named(&ground);
        for name in [
            "id-missing",
            "id-null",
            "id-type",
            "id-text",
            "id-fraction",
            "id-below",
            "id-above",
            "note-type",
            "list-missing",
            "list-type",
            "list.word-word",
            "list.is-text",
            "box-type",
            "box.x-missing",
            "box.x-text",
        ] {
            assert!(names.iter().any(|other| other == name), "{name}: {names:?}");
        }
        assert!(!names.iter().any(|name| name == "note-missing" || name == "note-null"));
    }

    #[test]
    fn only_what_is_there_is_entered() {
        let names = named(&BreakageScope::default());
        assert!(!names.iter().any(|name| name.contains('.')), "{names:?}");
    }

    #[test]
    fn an_optional_object_is_put_in_before_it_is_broken() {
        let ground = BreakageScope {
            holding: BTreeMap::from([("box".to_owned(), json!({ "x": 2.5 }))]),
            ..BreakageScope::default()
        };
        let all = breakages(&schema(), &ground);
        let quoted = all
            .iter()
            .find(|one| one.member == "box.x" && one.way == Way::Text)
            .expect("box.x");
        assert_eq!(quoted.optional.as_deref(), Some("box"));
        assert_eq!(
            quoted.patch,
            json!([
                { "op": "add", "path": "/box", "value": { "x": 2.5 } },
                { "op": "as-text", "path": "/box/x" },
            ])
        );
    }
}
