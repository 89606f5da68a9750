//! The values of variables, and filling them into terms.

use std::sync::Arc;

use serde_json::{Map, Value};

use super::ast::{Piece, Term, TermKind};
use crate::diagnostic::Span;

/// The values of all variables of a test, by dotted name: `time.react`, `course.a`, `before[0].mapId`.
///
/// A member may itself have dots in its name, so that `course.a` can be a text and `course.a.x` a number:
/// the longest member name that fits wins.
///
/// What all tests of a run share lies below a test's own values, and is not copied for each of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bindings {
    own: Map<String, Value>,
    below: Vec<Arc<Map<String, Value>>>,
}

impl Bindings {
    /// No variables at all.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The value of `name`: member names joined by dots; array indices as `[0]` or `.0`.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Value> {
        find_in(&self.own, name).or_else(|| self.below.iter().find_map(|values| find_in(values, name)))
    }

    /// Nothing yet, above values that are shared; of those the first that knows a name counts.
    #[must_use]
    pub fn above(below: Vec<Arc<Map<String, Value>>>) -> Self {
        Self { own: Map::new(), below }
    }

    /// An object that is about to be changed here has to be whole.
    fn bring_up(&mut self, name: &str) {
        let shared = self.below.iter().find_map(|values| values.get(name));
        if let Some(shared @ Value::Object(_)) = shared.filter(|_| !self.own.contains_key(name)) {
            self.own.insert(name.to_owned(), shared.clone());
        }
    }

    /// Gives `name` a value. Objects are made on the way; where the way is blocked by a value that is no
    /// object, the rest of the name becomes one dotted member beside it.
    pub fn set(&mut self, name: &str, value: Value) {
        if let Some((first, _)) = name.split_once('.') {
            self.bring_up(first);
        }
        set_in(&mut self.own, name, value);
    }

    /// Lays another set over this one, name by name of the top level, objects member by member.
    pub fn extend(&mut self, other: &Map<String, Value>) {
        for name in other
            .iter()
            .filter(|(_, value)| value.is_object())
            .map(|(name, _)| name)
        {
            self.bring_up(name);
        }
        lay_over(&mut self.own, other);
    }

    /// All values as a JSON object.
    #[must_use]
    pub fn to_map(&self) -> Map<String, Value> {
        let mut all = Map::new();
        for values in self.below.iter().rev() {
            all.extend(values.iter().map(|(name, value)| (name.clone(), value.clone())));
        }
        all.extend(self.own.clone());
        all
    }
}

impl From<Map<String, Value>> for Bindings {
    fn from(values: Map<String, Value>) -> Self {
        Self {
            own: values,
            below: Vec::new(),
        }
    }
}

impl From<Value> for Bindings {
    /// Anything but an object holds no variables.
    fn from(value: Value) -> Self {
        match value {
            Value::Object(values) => Self::from(values),
            _ => Self::default(),
        }
    }
}

fn find_in<'a>(members: &'a Map<String, Value>, name: &str) -> Option<&'a Value> {
    if let Some(value) = members.get(name) {
        return Some(value);
    }
    name.rmatch_indices(['.', '[']).find_map(|(at, separator)| {
        let value = members.get(&name[..at])?;
        let rest = if separator == "[" { &name[at..] } else { &name[at + 1..] };
        (!rest.is_empty()).then(|| find_below(value, rest))?
    })
}

fn find_below<'a>(value: &'a Value, rest: &str) -> Option<&'a Value> {
    if rest.is_empty() {
        return Some(value);
    }
    match value {
        Value::Object(members) => find_in(members, rest),
        Value::Array(items) => {
            let (digits, rest) = match rest.strip_prefix('[') {
                Some(bracketed) => bracketed.split_once(']')?,
                None => rest.split_at(rest.find(['.', '[']).unwrap_or(rest.len())),
            };
            let item = items.get(digits.parse::<usize>().ok()?)?;
            find_below(item, rest.strip_prefix('.').unwrap_or(rest))
        }
        _ => None,
    }
}

fn set_in(members: &mut Map<String, Value>, name: &str, value: Value) {
    if let Some((first, rest)) = name.split_once('.')
        && !members.contains_key(name)
        && members.get(first).is_none_or(Value::is_object)
    {
        let inner = members.entry(first).or_insert_with(|| Value::Object(Map::new()));
        if let Value::Object(inner) = inner {
            set_in(inner, rest, value);
        }
        return;
    }
    members.insert(name.to_owned(), value);
}

fn lay_over(below: &mut Map<String, Value>, above: &Map<String, Value>) {
    for (name, value) in above {
        match (below.get_mut(name), value) {
            (Some(Value::Object(below)), Value::Object(above)) => lay_over(below, above),
            _ => {
                below.insert(name.clone(), value.clone());
            }
        }
    }
}

/// A variable has no value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`${{{name}}}` has no value")]
pub struct Unbound {
    /// The variable.
    pub name: String,
    /// Where it is used.
    pub span: Span,
}

impl Term {
    /// The value of this term. Within text, numbers and truth values are written as JSON writes them.
    pub fn bind(&self, bindings: &Bindings) -> Result<Value, Unbound> {
        let look_up = |name: &str| {
            bindings.get(name).ok_or_else(|| Unbound {
                name: name.to_owned(),
                span: self.span.clone(),
            })
        };
        Ok(match &self.kind {
            TermKind::Literal(value) => value.clone(),
            TermKind::Variable(name) => look_up(name)?.clone(),
            TermKind::Text(pieces) => {
                let mut text = String::new();
                for piece in pieces {
                    match piece {
                        Piece::Text(verbatim) => text.push_str(verbatim),
                        Piece::Variable(name) => match look_up(name)? {
                            Value::String(value) => text.push_str(value),
                            other => text.push_str(&other.to_string()),
                        },
                    }
                }
                Value::String(text)
            }
            TermKind::List(items) => {
                Value::Array(items.iter().map(|item| item.bind(bindings)).collect::<Result<_, _>>()?)
            }
            TermKind::Map(members) => Value::Object(
                members
                    .iter()
                    .map(|(name, term)| Ok((name.clone(), term.bind(bindings)?)))
                    .collect::<Result<_, Unbound>>()?,
            ),
        })
    }

    /// Every variable in this term, in order.
    #[must_use]
    pub fn variables(&self) -> Vec<&str> {
        let mut names = Vec::new();
        self.visit_variables(&mut |name, _| names.push(name));
        names
    }

    /// Calls `visit` with every variable and the place it is used at.
    pub fn visit_variables<'a>(&'a self, visit: &mut dyn FnMut(&'a str, &'a Span)) {
        match &self.kind {
            TermKind::Literal(_) => {}
            TermKind::Variable(name) => visit(name, &self.span),
            TermKind::Text(pieces) => {
                for piece in pieces {
                    if let Piece::Variable(name) = piece {
                        visit(name, &self.span);
                    }
                }
            }
            TermKind::List(items) => items.iter().for_each(|item| item.visit_variables(visit)),
            TermKind::Map(members) => members.iter().for_each(|(_, term)| term.visit_variables(visit)),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::diagnostic::Source;

    fn term(kind: TermKind) -> Term {
        let source = Source::new("test", "text");
        Term {
            kind,
            span: Span::new(&source, 0, 4),
        }
    }

    #[test]
    fn names_lead_through_objects_arrays_and_dotted_members() {
        let bindings = Bindings::from(json!({
            "time": {"react": 31000},
            "course": {"a": "n1", "a.x": 1.5, "a-b": "e1"},
            "before": [{"mapId": "m"}, [7]],
            "serve": {"v1": {"url": "http://x"}},
        }));
        let get = |name| bindings.get(name).cloned();
        assert_eq!(get("time.react"), Some(json!(31000)));
        assert_eq!(get("course.a"), Some(json!("n1")));
        assert_eq!(get("course.a.x"), Some(json!(1.5)));
        assert_eq!(get("course.a-b"), Some(json!("e1")));
        assert_eq!(get("before[0].mapId"), Some(json!("m")));
        assert_eq!(get("before.1[0]"), Some(json!(7)));
        assert_eq!(get("before[1][0]"), Some(json!(7)));
        assert_eq!(get("serve.v1.url"), Some(json!("http://x")));
        for missing in [
            "",
            ".",
            "[",
            "time.",
            "time.slow",
            "before[9]",
            "before[",
            "before[x]",
            "course.a.y",
            "a..b",
        ] {
            assert_eq!(get(missing), None, "{missing}");
        }
    }

    #[test]
    fn a_value_can_be_set_beside_the_text_that_bears_its_prefix() {
        let mut bindings = Bindings::new();
        bindings.set("course.a", json!("n1"));
        bindings.set("course.a.x", json!(2));
        bindings.set("cancel.id", json!("u"));
        bindings.set("cancel.id", json!("v"));
        assert_eq!(bindings.get("course.a"), Some(&json!("n1")));
        assert_eq!(bindings.get("course.a.x"), Some(&json!(2)));
        assert_eq!(bindings.get("cancel.id"), Some(&json!("v")));
    }

    #[test]
    fn a_variable_alone_keeps_its_type_and_within_text_becomes_text() {
        let bindings = Bindings::from(json!({"n": 3, "o": {"a": true}}));
        let alone = term(TermKind::Variable("o".into()));
        assert_eq!(alone.bind(&bindings), Ok(json!({"a": true})));
        let text = term(TermKind::Text(vec![
            Piece::Text("n=".into()),
            Piece::Variable("n".into()),
        ]));
        assert_eq!(text.bind(&bindings), Ok(json!("n=3")));
        let map = term(TermKind::Map(vec![("x".into(), term(TermKind::List(vec![text])))]));
        assert_eq!(map.bind(&bindings), Ok(json!({"x": ["n=3"]})));
        assert_eq!(map.variables(), ["n"]);
    }

    #[test]
    fn a_missing_variable_is_named_with_its_place() {
        let unbound = term(TermKind::Variable("nobody".into()))
            .bind(&Bindings::new())
            .unwrap_err();
        assert_eq!(unbound.name, "nobody");
        assert_eq!(unbound.span.text(), "text");
        assert_eq!(unbound.to_string(), "`${nobody}` has no value");
    }
}
