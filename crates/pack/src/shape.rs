//! What a schema says about a path of member names, read from its raw form.
//!
//! Understands what our schemas use: `$ref` inside the file, `allOf`, `properties`, `items`.

use serde_json::Value;

/// References and parts followed from one place; more is a loop.
const MAX_PARTS: usize = 32;

const KINDS: [&str; 7] = ["array", "boolean", "integer", "null", "number", "object", "string"];

/// What a schema says about one place in a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// JSON type names allowed; all of them where the schema names none.
    pub kinds: Vec<&'static str>,
    /// The words allowed, where only these are; of a list, those its elements may be.
    pub literals: Option<Vec<String>>,
    /// Whether the object around it needs this member.
    pub required: bool,
    /// Whether any member may stand below, because the schema says nothing about what is inside.
    pub open: bool,
    /// Whether it is a list whose elements the rest of a path would enter.
    pub array: bool,
}

pub(super) fn shape(root: &Value, path: &[&str]) -> Option<Shape> {
    let mut here = parts(root, root);
    let mut required = false;
    for name in path {
        let inside = elements(root, here);
        let next: Vec<&Value> = inside
            .iter()
            .filter_map(|part| part.get("properties")?.get(name))
            .flat_map(|child| parts(root, child))
            .collect();
        if next.is_empty() {
            // Below an open value everything is allowed, and nothing is known about it.
            return is_open(&inside).then(|| Shape {
                kinds: KINDS.to_vec(),
                literals: None,
                required: false,
                open: true,
                array: false,
            });
        }
        required = inside
            .iter()
            .filter_map(|part| part.get("required")?.as_array())
            .flatten()
            .any(|member| member.as_str() == Some(name));
        here = next;
    }
    Some(Shape {
        kinds: kinds(&here),
        required,
        open: is_open(&here),
        array: here.iter().any(|part| part.get("items").is_some()),
        literals: literals(&elements(root, here)),
    })
}

pub(super) fn members(root: &Value, path: &[&str]) -> Vec<String> {
    let mut here = elements(root, parts(root, root));
    for name in path {
        let next: Vec<&Value> = here
            .iter()
            .filter_map(|part| part.get("properties")?.get(name))
            .flat_map(|child| parts(root, child))
            .collect();
        here = elements(root, next);
    }
    here.iter()
        .filter_map(|part| part.get("properties")?.as_object())
        .flat_map(|properties| properties.keys().cloned())
        .collect()
}

/// A schema together with everything it refers to: all of these hold at the same place.
pub(super) fn parts<'a>(root: &'a Value, schema: &'a Value) -> Vec<&'a Value> {
    let mut found: Vec<&Value> = vec![schema];
    let mut at = 0;
    while let Some(part) = found.get(at).copied() {
        at += 1;
        let referred = part
            .get("$ref")
            .and_then(Value::as_str)
            .and_then(|reference| root.pointer(reference.strip_prefix('#')?));
        let all = part.get("allOf").and_then(Value::as_array).into_iter().flatten();
        // Behind the part that refers to them, so that members keep the order of the file.
        found.splice(at..at, referred.into_iter().chain(all));
        if found.len() > MAX_PARTS {
            found.truncate(MAX_PARTS);
            break;
        }
    }
    found
}

/// Enters the elements of lists, and of lists in lists.
fn elements<'a>(root: &'a Value, mut here: Vec<&'a Value>) -> Vec<&'a Value> {
    for _ in 0..MAX_PARTS {
        let items: Vec<&Value> = here
            .iter()
            .filter_map(|part| part.get("items"))
            .flat_map(|items| parts(root, items))
            .collect();
        if items.is_empty() {
            break;
        }
        here = items;
    }
    here
}

/// The JSON types all of these allow.
pub(super) fn kinds(here: &[&Value]) -> Vec<&'static str> {
    let named: Vec<&str> = here
        .iter()
        .filter_map(|part| part.get("type"))
        .flat_map(|kind| match kind {
            Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
            one => one.as_str().into_iter().collect::<Vec<_>>(),
        })
        .collect();
    KINDS
        .into_iter()
        .filter(|kind| named.is_empty() || named.contains(kind))
        .collect()
}

pub(super) fn literals(here: &[&Value]) -> Option<Vec<String>> {
    let words = here.iter().find_map(|part| part.get("enum")?.as_array())?;
    Some(words.iter().filter_map(Value::as_str).map(str::to_owned).collect())
}

fn is_open(here: &[&Value]) -> bool {
    let says_more = |part: &&Value| {
        ["properties", "items", "enum"]
            .iter()
            .any(|word| part.get(word).is_some())
    };
    kinds(here).contains(&"object") && !here.iter().any(says_more)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn root() -> Value {
        json!({
            "type": "object",
            "required": ["errors"],
            "properties": {
                "errors": { "type": "array", "items": { "$ref": "#/$defs/error" } },
                "free": { "title": "anything" },
                "data": { "type": "object" },
                "loop": { "$ref": "#/$defs/loop" },
                "both": { "allOf": [{ "$ref": "#/$defs/error" }, { "properties": { "more": { "type": "number" } } }] },
                "grid": { "type": "array", "items": { "type": "array", "items": { "$ref": "#/$defs/error" } } }
            },
            "$defs": {
                "error": {
                    "type": "object",
                    "required": ["level"],
                    "properties": {
                        "level": { "enum": ["A", "B"] },
                        "hint": { "type": ["string", "null"] },
                        "words": { "type": "array", "items": { "enum": ["C"] } }
                    }
                },
                "loop": { "$ref": "#/$defs/loop" }
            }
        })
    }

    #[test]
    fn a_path_enters_lists_and_follows_references() {
        let root = root();
        let level = shape(&root, &["errors", "level"]).expect("path");
        assert_eq!(level.literals, Some(vec!["A".to_owned(), "B".to_owned()]));
        assert!(level.required && !level.open && !level.array);
        let errors = shape(&root, &["errors"]).expect("path");
        assert!(errors.array && errors.required && errors.kinds == ["array"]);
        assert_eq!(
            shape(&root, &["errors", "hint"]).expect("path").kinds,
            ["null", "string"]
        );
        let words = shape(&root, &["errors", "words"]).expect("path");
        assert!(words.array && words.literals == Some(vec!["C".to_owned()]));
        assert!(shape(&root, &["grid", "level"]).is_some());
        assert!(shape(&root, &["both", "level"]).is_some() && shape(&root, &["both", "more"]).is_some());
    }

    #[test]
    fn an_unknown_path_has_no_shape() {
        assert_eq!(shape(&root(), &["errors", "levle"]), None);
        assert_eq!(shape(&root(), &["errors", "level", "deeper"]), None);
        assert_eq!(shape(&root(), &["nothing"]), None);
    }

    #[test]
    fn below_an_open_value_everything_is_allowed() {
        for path in [&["free"][..], &["data"], &["free", "x", "y"], &["data", "x"]] {
            assert!(shape(&root(), path).expect("path").open, "{path:?}");
        }
        assert!(!shape(&root(), &[]).expect("root").open);
    }

    #[test]
    fn members_are_listed_in_the_order_of_the_schema() {
        assert_eq!(members(&root(), &["errors"]), ["level", "hint", "words"]);
        assert_eq!(members(&root(), &["both"]), ["level", "hint", "words", "more"]);
        assert!(members(&root(), &["nothing"]).is_empty());
        assert_eq!(members(&root(), &[])[0], "errors");
    }

    #[test]
    fn a_loop_of_references_ends() {
        assert!(shape(&root(), &["loop", "x"]).is_some_and(|shape| shape.open));
    }
}
