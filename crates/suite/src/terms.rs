//! Values with variables, and patterns, out of the tree.

use serde_json::{Number, Value};

use super::fields::{Problems, text_of};
use tck_base::diagnostic::{Diagnostic, Span};
use tck_base::pattern::{
    Compare, Comparison, Element, Elements, Pattern, PatternKind, Piece, Term, TermKind, whole_text,
};
use tck_base::yaml::{Kind, Node};

/// Every operator of a pattern.
pub(super) const OPERATORS: [&str; 19] = [
    "$has",
    "$hasNew",
    "$none",
    "$one",
    "$atMostOne",
    "$each",
    "$includes",
    "$consecutive",
    "$empty",
    "$count",
    "$in",
    "$not",
    "$lt",
    "$le",
    "$gt",
    "$ge",
    "$matches",
    "$present",
    "$absent",
];

/// The value of a node, with variables found in its texts.
pub(super) fn term(node: &Node, problems: &mut Problems) -> Term {
    let kind = match &node.kind {
        Kind::Null => TermKind::Literal(Value::Null),
        Kind::Bool(flag) => TermKind::Literal(Value::Bool(*flag)),
        Kind::Number(number) => TermKind::Literal(Value::Number(number.clone())),
        Kind::Text { value, .. } => text_term(value, &node.span, problems),
        Kind::List(items) => TermKind::List(items.iter().map(|item| term(item, problems)).collect()),
        Kind::Map(entries) => TermKind::Map(
            entries
                .iter()
                .filter_map(|(key, value)| Some((literal_key(key, problems)?, term(value, problems))))
                .collect(),
        ),
    };
    Term {
        kind,
        span: node.span.clone(),
    }
}

/// Named terms: the members of a mapping.
pub(super) fn named_terms(node: &Node, problems: &mut Problems) -> Vec<(String, Term)> {
    if let TermKind::Map(members) = term(node, problems).kind {
        return members;
    }
    problems.wrong_type(node, "a mapping");
    Vec::new()
}

fn literal_key(key: &Node, problems: &mut Problems) -> Option<String> {
    let text = key.text()?;
    if text.contains("${") {
        problems.add(
            Diagnostic::new(
                "variable-in-key",
                key.span.clone(),
                "a variable in a key",
                "not allowed here",
            )
            .hint("only `${case.…}` and `${with.…}` may stand in a key: they are filled in when the file is read"),
        );
        return None;
    }
    Some(text.to_owned())
}

fn text_term(text: &str, span: &Span, problems: &mut Problems) -> TermKind {
    match pieces(text) {
        Ok(mut pieces) => match pieces.len() {
            0 => TermKind::Literal(Value::String(String::new())),
            1 => match pieces.remove(0) {
                Piece::Text(text) => TermKind::Literal(Value::String(text)),
                Piece::Variable(name) => TermKind::Variable(name),
            },
            _ => TermKind::Text(pieces),
        },
        Err(reason) => {
            problems.at("bad-variable", span, reason, "in this text");
            TermKind::Literal(Value::String(text.to_owned()))
        }
    }
}

/// Cuts a text at its variables.
pub(super) fn pieces(text: &str) -> Result<Vec<Piece>, String> {
    let mut pieces = Vec::new();
    let mut rest = text;
    while let Some(at) = rest.find("${") {
        if at > 0 {
            pieces.push(Piece::Text(rest[..at].to_owned()));
        }
        let Some((name, behind)) = rest[at + 2..].split_once('}') else {
            return Err("a variable without its closing `}`".to_owned());
        };
        let fits = |c: char| c.is_ascii_alphanumeric() || "_-.[]".contains(c);
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) || !name.chars().all(fits) {
            return Err(format!("`${{{}}}` is no variable", super::fields::short(name)));
        }
        pieces.push(Piece::Variable(name.to_owned()));
        rest = behind;
    }
    if !rest.is_empty() {
        pieces.push(Piece::Text(rest.to_owned()));
    }
    Ok(pieces)
}

/// The pattern a node describes.
pub(super) fn pattern(node: &Node, problems: &mut Problems) -> Option<Pattern> {
    let kind = match &node.kind {
        Kind::Map(entries) => return mapping(entries, node, problems),
        Kind::List(items) => {
            let all: Vec<_> = items.iter().map(|item| pattern(item, problems)).collect();
            PatternKind::List(all.into_iter().collect::<Option<_>>()?)
        }
        _ => PatternKind::Equals(term(node, problems)),
    };
    Some(Pattern {
        kind,
        span: node.span.clone(),
    })
}

fn mapping(entries: &[(Node, Node)], node: &Node, problems: &mut Problems) -> Option<Pattern> {
    let is_operator = |key: &Node| {
        key.text()
            .is_some_and(|text| text.starts_with('$') && !text.starts_with("${"))
    };
    let operators = entries.iter().filter(|(key, _)| is_operator(key)).count();
    let with_kind = |kind| Pattern {
        kind,
        span: node.span.clone(),
    };
    if operators == 0 {
        let members: Vec<_> = entries
            .iter()
            .map(|(key, value)| {
                let name = literal_key(key, problems);
                let pattern = pattern(value, problems);
                Some((name?, pattern?))
            })
            .collect();
        return Some(with_kind(PatternKind::Object(
            members.into_iter().collect::<Option<_>>()?,
        )));
    }
    if let Some((plain, _)) = entries.iter().find(|(key, _)| !is_operator(key)) {
        problems.add(
            Diagnostic::new(
                "mixed-operators",
                plain.span.clone(),
                "a member beside an operator",
                "every key here begins with `$`, or none does",
            )
            .hint("put the members into a mapping of their own"),
        );
        return None;
    }
    let mut parts: Vec<_> = entries
        .iter()
        .map(|(key, value)| operator(key, value, problems))
        .collect();
    if parts.len() == 1 {
        return parts.remove(0);
    }
    Some(with_kind(PatternKind::All(parts.into_iter().collect::<Option<_>>()?)))
}

fn operator(key: &Node, value: &Node, problems: &mut Problems) -> Option<Pattern> {
    let name = key.text()?;
    let elements = |which, problems: &mut Problems| {
        Some(PatternKind::Elements(Elements {
            which,
            pattern: Box::new(pattern(value, problems)?),
        }))
    };
    let kind = match name {
        "$has" => elements(Element::Has, problems)?,
        "$hasNew" => elements(Element::HasNew, problems)?,
        "$none" => elements(Element::None, problems)?,
        "$one" => elements(Element::One, problems)?,
        "$atMostOne" => elements(Element::AtMostOne, problems)?,
        "$each" => elements(Element::Each, problems)?,
        "$includes" | "$consecutive" => {
            let list = term(value, problems);
            if !matches!(list.kind, TermKind::List(_) | TermKind::Variable(_)) {
                return bad_operand(name, value, "a list, or a variable that holds one", problems);
            }
            match name {
                "$includes" => PatternKind::Includes(list),
                _ => PatternKind::Consecutive(list),
            }
        }
        "$empty" => PatternKind::Empty(truth(name, value, problems)?),
        "$count" => PatternKind::Count(Box::new(pattern(value, problems)?)),
        "$in" => match value.list() {
            Some(items) if !items.is_empty() => {
                PatternKind::In(items.iter().map(|item| term(item, problems)).collect())
            }
            _ => return bad_operand(name, value, "a list of at least one value", problems),
        },
        "$not" => PatternKind::Not(Box::new(pattern(value, problems)?)),
        "$lt" => compare(Compare::Lt, name, value, problems)?,
        "$le" => compare(Compare::Le, name, value, problems)?,
        "$gt" => compare(Compare::Gt, name, value, problems)?,
        "$ge" => compare(Compare::Ge, name, value, problems)?,
        "$matches" => {
            let text = text_of(value, problems)?;
            match whole_text(text) {
                Ok(regex) => PatternKind::Matches(regex),
                Err(error) => {
                    let reason = error.to_string();
                    let reason = reason.lines().last().unwrap_or_default().trim().to_owned();
                    problems.at("bad-regex", &value.span, "not a regular expression", reason);
                    return None;
                }
            }
        }
        "$present" | "$absent" => {
            let present = truth(name, value, problems)? == (name == "$present");
            if present {
                PatternKind::Present
            } else {
                PatternKind::Absent
            }
        }
        _ => {
            problems.unknown("unknown-operator", &key.span, "operator", name, OPERATORS);
            return None;
        }
    };
    // From the operator to its operand: that is what a miss points at.
    let span = if key.span.source == value.span.source && key.span.start <= value.span.start {
        Span::new(&key.span.source, key.span.start, value.span.end)
    } else {
        key.span.clone()
    };
    Some(Pattern { kind, span })
}

fn bad_operand<T>(name: &str, value: &Node, wanted: &str, problems: &mut Problems) -> Option<T> {
    problems.at(
        "bad-operand",
        &value.span,
        format!("`{name}` takes {wanted}"),
        format!("this is {}", value.kind_word()),
    );
    None
}

fn truth(name: &str, value: &Node, problems: &mut Problems) -> Option<bool> {
    match value.kind {
        Kind::Bool(flag) => Some(flag),
        _ => bad_operand(name, value, "`true` or `false`", problems),
    }
}

fn compare(which: Compare, name: &str, value: &Node, problems: &mut Problems) -> Option<PatternKind> {
    let with = term(value, problems);
    match with.kind {
        TermKind::Literal(Value::Number(_)) | TermKind::Variable(_) => {
            Some(PatternKind::Compare(Comparison { which, with }))
        }
        _ => bad_operand(name, value, "a number, or a variable that holds one", problems),
    }
}

/// A duration in milliseconds: `800 ms`, `5 s`, `1.5 s`, `2 min`.
pub(super) fn milliseconds(text: &str) -> Option<f64> {
    let text = text.trim();
    let at = text.find(|c: char| !c.is_ascii_digit() && c != '.')?;
    let amount: f64 = text[..at].parse::<Number>().ok()?.as_f64()?;
    let unit = match text[at..].trim_start() {
        "ms" => 1.0,
        "s" => 1_000.0,
        "min" => 60_000.0,
        _ => return None,
    };
    Some(amount * unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::diagnostic::Source;

    fn read(text: &str) -> Result<Pattern, Vec<&'static str>> {
        let tree = tck_base::yaml::tree(&Source::new("test", text)).expect("yaml");
        let mut problems = Problems::default();
        pattern(&tree, &mut problems).ok_or_else(|| problems.into_sorted().iter().map(|found| found.code).collect())
    }

    #[test]
    fn texts_are_cut_at_their_variables() {
        let text = |text: &str| Piece::Text(text.into());
        let variable = |name: &str| Piece::Variable(name.into());
        assert_eq!(pieces("a${b.c}d"), Ok(vec![text("a"), variable("b.c"), text("d")]));
        assert_eq!(pieces("${x[0].y}"), Ok(vec![variable("x[0].y")]));
        assert_eq!(pieces("$5"), Ok(vec![text("$5")]));
        assert_eq!(pieces(""), Ok(vec![]));
        assert!(pieces("${x").is_err());
        assert!(pieces("${}").is_err());
        assert!(pieces("${a b}").is_err());
    }

    #[test]
    fn durations_have_a_unit() {
        assert_eq!(milliseconds("800 ms"), Some(800.0));
        assert_eq!(milliseconds("1.5s"), Some(1500.0));
        assert_eq!(milliseconds("2 min"), Some(120_000.0));
        for bad in ["5", "s", "", "5 h", "-5 s", "1.2.3 s", "5 s s"] {
            assert_eq!(milliseconds(bad), None, "{bad}");
        }
    }

    #[test]
    fn operators_are_told_from_members() {
        assert!(matches!(read("{a: 1}").expect("object").kind, PatternKind::Object(_)));
        assert!(matches!(read("{}").expect("object").kind, PatternKind::Object(_)));
        assert!(matches!(
            read("{$ge: 0, $le: 1}").expect("both").kind,
            PatternKind::All(_)
        ));
        assert!(matches!(
            read("{$present: false}").expect("absent").kind,
            PatternKind::Absent
        ));
        assert!(matches!(
            read("{$absent: false}").expect("present").kind,
            PatternKind::Present
        ));
        assert!(matches!(
            read("\"${x}\"").expect("variable").kind,
            PatternKind::Equals(_)
        ));
    }

    #[test]
    fn mistakes_in_patterns_have_codes() {
        for (text, code) in [
            ("{$hsa: {}}", "unknown-operator"),
            ("{$has: {}, a: 1}", "mixed-operators"),
            ("{$matches: \"(\"}", "bad-regex"),
            ("{$empty: 1}", "bad-operand"),
            ("{$in: x}", "bad-operand"),
            ("{$in: []}", "bad-operand"),
            ("{$lt: x}", "bad-operand"),
            ("{$includes: {}}", "bad-operand"),
            ("{\"${x}\": 1}", "variable-in-key"),
        ] {
            assert_eq!(read(text).expect_err(text), [code], "{text}");
        }
    }

    #[test]
    fn the_place_of_an_operator_reaches_from_its_name_to_its_operand() {
        let read = read("errors: { $has: { a: 1 } }").expect("pattern");
        let PatternKind::Object(members) = read.kind else {
            panic!()
        };
        assert_eq!(members[0].1.span.text(), "$has: { a: 1 }");
    }
}
