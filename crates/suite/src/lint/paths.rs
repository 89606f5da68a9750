//! Patterns held against the schema of a topic: paths, words, types and operators.

use std::rc::Rc;

use serde_json::Value;

use super::harness_topics;
use super::vocabulary::Vocabulary;
use tck_base::diagnostic::{Diagnostic, Span, did_you_mean};
use tck_base::pattern::{Pattern, PatternKind, Piece, Term, TermKind};
use tck_pack::Shape;

/// One topic in one pack.
pub(super) struct Topic<'a> {
    pub(super) vocabulary: &'a dyn Vocabulary,
    pub(super) pack: usize,
    pub(super) name: &'a str,
}

impl Topic<'_> {
    fn shape(&self, path: &[&str]) -> Option<Rc<Shape>> {
        if harness_topics::has(self.name) {
            return harness_topics::shape(self.name, path).map(Rc::new);
        }
        self.vocabulary.shape(self.pack, self.name, path)
    }

    fn members(&self, path: &[&str]) -> Vec<String> {
        if harness_topics::has(self.name) {
            return harness_topics::members(self.name, path);
        }
        self.vocabulary.members(self.pack, self.name, path)
    }

    /// A path in words.
    fn at(&self, path: &[&str]) -> String {
        if path.is_empty() {
            format!("a message of {}", self.name)
        } else {
            format!("`{}` of {}", path.join("."), self.name)
        }
    }

    fn version(&self) -> String {
        self.vocabulary
            .versions()
            .get(self.pack)
            .map(ToString::to_string)
            .unwrap_or_default()
    }

    /// What is wrong with a pattern for whole messages.
    pub(super) fn check(&self, pattern: &Pattern) -> Vec<Diagnostic> {
        let mut found = Vec::new();
        self.pattern(pattern, &mut PatternPosition::default(), &mut found);
        found
    }

    /// What is wrong with a path into a message, such as `errors[0].errorType`.
    pub(super) fn check_path(&self, text: &str, span: &Span) -> Vec<Diagnostic> {
        let mut found = Vec::new();
        let mut path = Vec::new();
        for name in text.split(['.', '[', ']']).filter(|part| !part.is_empty()) {
            if name.bytes().all(|byte| byte.is_ascii_digit()) {
                continue;
            }
            path.push(name);
            if self.shape(&path).is_none() {
                found.push(self.unknown_path(&path, span));
                break;
            }
        }
        found
    }

    fn unknown_path(&self, path: &[&str], span: &Span) -> Diagnostic {
        let (name, parent) = path.split_last().unwrap_or((&"", &[]));
        let members = self.members(parent);
        let versions = self.vocabulary.versions();
        let elsewhere = (0..versions.len())
            .filter(|pack| self.vocabulary.shape(*pack, self.name, path).is_some())
            .find_map(|pack| versions.get(pack));
        Diagnostic::new(
            "unknown-path",
            span.clone(),
            format!("{} has no member `{name}` in {}", self.at(parent), self.version()),
            "not in the schema",
        )
        .hint(match elsewhere {
            Some(version) => format!("{version} has it: narrow `spec:`, of the test or of this step"),
            None => did_you_mean(name, members.iter().map(String::as_str)),
        })
    }

    fn pattern<'p>(&self, pattern: &'p Pattern, place: &mut PatternPosition<'p>, found: &mut Vec<Diagnostic>) {
        let Some(shape) = self.shape(&place.path) else { return };
        if shape.open {
            return;
        }
        // What the elements of a list are is known by their members and words only.
        let element = place.entered && shape.array;
        let can_be = |kind: &str| element || shape.kinds.contains(&kind);
        let wrong = |found: &mut Vec<Diagnostic>, needs: &str| {
            let hint =
                (shape.array && !element).then_some("look into a list with `$has`, `$one`, `$each` and the like");
            found.push(Diagnostic {
                hint: hint.map(str::to_owned),
                ..Diagnostic::new(
                    "wrong-operator",
                    pattern.span.clone(),
                    format!("{} is {} in {}", self.at(&place.path), kinds(&shape), self.version()),
                    format!("this is for {needs}"),
                )
            });
        };
        match &pattern.kind {
            PatternKind::Equals(term) => self.term(term, &shape, place, found),
            PatternKind::In(terms) => {
                for term in terms {
                    self.term(term, &shape, place, found);
                }
            }
            PatternKind::Object(_) if !can_be("object") => wrong(found, "an object"),
            PatternKind::Object(members) => {
                for (name, member) in members {
                    place.path.push(name);
                    let entered = std::mem::replace(&mut place.entered, false);
                    if self.shape(&place.path).is_none() {
                        found.push(self.unknown_path(&place.path, &member_span(member, name)));
                    } else {
                        self.pattern(member, place, found);
                    }
                    place.entered = entered;
                    place.path.pop();
                }
            }
            PatternKind::List(_) if !can_be("array") => wrong(found, "a list"),
            PatternKind::List(items) => {
                let entered = std::mem::replace(&mut place.entered, true);
                for item in items {
                    self.pattern(item, place, found);
                }
                place.entered = entered;
            }
            PatternKind::All(parts) => {
                for part in parts {
                    self.pattern(part, place, found);
                }
            }
            PatternKind::Not(inner) => self.pattern(inner, place, found),
            PatternKind::Elements(_)
            | PatternKind::Includes(_)
            | PatternKind::Consecutive(_)
            | PatternKind::Empty(_)
            | PatternKind::Count(_)
                if !can_be("array") =>
            {
                wrong(found, "a list");
            }
            PatternKind::Elements(elements) => {
                let entered = std::mem::replace(&mut place.entered, true);
                self.pattern(&elements.pattern, place, found);
                place.entered = entered;
            }
            PatternKind::Includes(list) | PatternKind::Consecutive(list) => {
                if let Some(Value::Array(items)) = self.value(list) {
                    let entered = std::mem::replace(&mut place.entered, true);
                    for item in &items {
                        self.value_fits(item, &list.span, &shape, &owned(place), found);
                    }
                    place.entered = entered;
                }
            }
            PatternKind::Compare(_) if !can_be("number") && !can_be("integer") => wrong(found, "a number"),
            PatternKind::Matches(_) if !can_be("string") => wrong(found, "a text"),
            PatternKind::Count(_)
            | PatternKind::Empty(_)
            | PatternKind::Compare(_)
            | PatternKind::Matches(_)
            | PatternKind::Present
            | PatternKind::Absent => {}
        }
    }

    fn term(&self, term: &Term, shape: &Shape, place: &PatternPosition<'_>, found: &mut Vec<Diagnostic>) {
        if let Some(value) = self.value(term) {
            self.value_fits(&value, &term.span, shape, &owned(place), found);
        }
    }

    /// The value of a term as far as it is known before a run.
    fn value(&self, term: &Term) -> Option<Value> {
        match &term.kind {
            TermKind::Literal(value) => Some(value.clone()),
            TermKind::Variable(name) => self.vocabulary.word(self.pack, name.strip_prefix("vda.")?),
            TermKind::Text(pieces) => pieces
                .iter()
                .map(|piece| match piece {
                    Piece::Text(text) => Some(text.clone()),
                    Piece::Variable(name) => match self.vocabulary.word(self.pack, name.strip_prefix("vda.")?)? {
                        Value::String(text) => Some(text),
                        _ => None,
                    },
                })
                .collect::<Option<String>>()
                .map(Value::String),
            TermKind::List(items) => items.iter().map(|item| self.value(item)).collect(),
            // Members whose values are not known yet are left out: the others can still be judged.
            TermKind::Map(members) => Some(Value::Object(
                members
                    .iter()
                    .filter_map(|(name, term)| Some((name.clone(), self.value(term)?)))
                    .collect(),
            )),
        }
    }

    fn value_fits(
        &self,
        value: &Value,
        span: &Span,
        shape: &Shape,
        place: &(Vec<String>, bool),
        found: &mut Vec<Diagnostic>,
    ) {
        if shape.open {
            return;
        }
        let (path, entered) = place;
        let names: Vec<&str> = path.iter().map(String::as_str).collect();
        let element = *entered && shape.array;
        let kind = match value {
            Value::Null => "null",
            Value::Bool(_) => "boolean",
            Value::Number(number) if number.as_f64().is_some_and(|float| float.fract() == 0.0) => "integer",
            Value::Number(_) => "number",
            Value::String(_) => "string",
            Value::Array(_) => "array",
            Value::Object(_) => "object",
        };
        let fits = element || shape.kinds.contains(&kind) || (kind == "integer" && shape.kinds.contains(&"number"));
        if !fits {
            let hint = match value {
                Value::Number(_) | Value::Bool(_) if shape.kinds == ["string"] => {
                    Some(format!("write \"{value}\" if the text is meant"))
                }
                Value::Object(_) if shape.array => {
                    Some("look into a list with `$has`, `$one`, `$each` and the like".to_owned())
                }
                _ => None,
            };
            found.push(Diagnostic {
                hint,
                ..Diagnostic::new(
                    "wrong-literal-type",
                    span.clone(),
                    format!("{} is {} in {}", self.at(&names), kinds(shape), self.version()),
                    format!("this is {}", article(kind)),
                )
            });
            return;
        }
        match value {
            Value::String(text) => {
                if let Some(literals) = &shape.literals
                    && !literals.contains(text)
                {
                    found.push(
                        Diagnostic::new(
                            "bad-literal",
                            span.clone(),
                            format!(
                                "{} is never `{}` in {}",
                                self.at(&names),
                                super::super::fields::short(text),
                                self.version()
                            ),
                            "not one of its values",
                        )
                        .hint(did_you_mean(text, literals.iter().map(String::as_str))),
                    );
                }
            }
            Value::Array(items) => {
                for item in items {
                    self.value_fits(item, span, shape, &(path.clone(), true), found);
                }
            }
            Value::Object(members) => {
                for (name, value) in members {
                    let mut path = path.clone();
                    path.push(name.clone());
                    let names: Vec<&str> = path.iter().map(String::as_str).collect();
                    match self.shape(&names) {
                        Some(shape) => self.value_fits(value, span, &shape, &(path, false), found),
                        None => found.push(self.unknown_path(&names, span)),
                    }
                }
            }
            _ => {}
        }
    }
}

/// A place in a message.
#[derive(Default)]
struct PatternPosition<'p> {
    path: Vec<&'p str>,
    /// Whether an operator has gone into the elements of the list at the path.
    entered: bool,
}

fn owned(place: &PatternPosition<'_>) -> (Vec<String>, bool) {
    (
        place.path.iter().map(|name| (*name).to_owned()).collect(),
        place.entered,
    )
}

fn kinds(shape: &Shape) -> String {
    shape
        .kinds
        .iter()
        .map(|kind| article(kind))
        .collect::<Vec<_>>()
        .join(" or ")
}

fn article(kind: &str) -> &str {
    match kind {
        "array" => "a list",
        "boolean" => "true or false",
        "integer" => "a whole number",
        "null" => "null",
        "number" => "a number",
        "object" => "an object",
        "string" => "a text",
        other => other,
    }
}

/// The name of a member as written before its value, or the value where the name cannot be found.
fn member_span(member: &Pattern, name: &str) -> Span {
    let source = &member.span.source;
    let before = &source.text[..member.span.start];
    // The name is the nearest one before its value; a value filled in from a table stands elsewhere.
    match before.rfind(name) {
        Some(at)
            if before[at + name.len()..]
                .chars()
                .all(|c| c.is_whitespace() || "\"':{[".contains(c)) =>
        {
            Span::new(source, at, at + name.len())
        }
        _ => member.span.clone(),
    }
}
