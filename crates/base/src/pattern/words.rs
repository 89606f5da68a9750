//! A pattern in the words of people, as reports and terminals show it.

use super::ast::{Compare, Element};
use super::bound::{Bound, BoundKind};

impl Bound {
    /// What a message has to show: `orderId is "7" and there is a new error where errorType is "x"`.
    #[must_use]
    pub fn conditions(&self) -> String {
        let mut all = Vec::new();
        self.gather(None, &mut all);
        if all.is_empty() {
            return "anything".to_owned();
        }
        listed(&all, "and")
    }

    /// What a value has to be, as it stands behind "expected".
    #[must_use]
    pub fn describe(&self) -> String {
        self.noun(None)
    }

    /// One condition for each leaf below `path`.
    fn gather(&self, path: Option<&str>, all: &mut Vec<String>) {
        let subject = path.unwrap_or("it");
        match &self.kind {
            BoundKind::Object(members) if !members.is_empty() || path.is_none() => {
                for (name, member) in members {
                    let below = path.map_or_else(|| name.clone(), |path| format!("{path}.{name}"));
                    member.gather(Some(&below), all);
                }
            }
            BoundKind::All(parts) => parts.iter().for_each(|part| part.gather(path, all)),
            BoundKind::Elements(which, _) => {
                let (before, name) = match path.and_then(|path| path.rsplit_once('.')) {
                    Some((before, name)) => (format!("{before} has"), Some(name)),
                    None if *which == Element::Each => ("there are".to_owned(), path),
                    None => ("there is".to_owned(), path),
                };
                all.push(format!("{before} {}", self.noun(name)));
            }
            BoundKind::Count(_) | BoundKind::Includes(_) | BoundKind::Consecutive(_) => {
                all.push(format!("{subject} has {}", self.noun(None)));
            }
            BoundKind::Present => all.push(format!("{subject} is there")),
            BoundKind::Absent => all.push(format!("{subject} is left out")),
            _ => all.push(format!("{subject} is {}", self.noun(None))),
        }
    }

    /// What a value has to be; `member` is the name of the member that holds it.
    pub(super) fn noun(&self, member: Option<&str>) -> String {
        match &self.kind {
            BoundKind::Equals(value) => value.to_string(),
            BoundKind::Object(members) if members.is_empty() => "an object".to_owned(),
            BoundKind::Object(_) => format!("an object where {}", self.conditions()),
            BoundKind::List(items) if items.is_empty() => "an empty list".to_owned(),
            BoundKind::List(items) => format!("[{}]", nouns(items).join(", ")),
            BoundKind::All(parts) if parts.is_empty() => "anything".to_owned(),
            BoundKind::All(parts) => {
                let parts: Vec<String> = parts.iter().map(|part| part.noun(member)).collect();
                listed(&parts, "and")
            }
            BoundKind::Elements(which, inner) => {
                let (one, many) = of_list(member);
                let quantity = match which {
                    Element::Has => with_article(&one),
                    Element::HasNew => format!("a new {one}"),
                    Element::None => format!("no {one}"),
                    Element::One => format!("exactly one {one}"),
                    Element::AtMostOne => format!("at most one {one}"),
                    Element::Each => format!("no {many} but those"),
                };
                format!("{quantity}{}", inner.relative(*which == Element::Each))
            }
            BoundKind::Includes(items) | BoundKind::Consecutive(items) if items.is_empty() => "a list".to_owned(),
            BoundKind::Includes(items) => {
                let items: Vec<String> = items.iter().map(|item| item.element(member)).collect();
                listed(&items, "and")
            }
            BoundKind::Consecutive(items) => {
                let items: Vec<String> = items.iter().map(|item| item.element(member)).collect();
                items.join(", directly followed by ")
            }
            BoundKind::Unfit { wanted, value } => format!("{wanted}, which the test does not have: {value}"),
            BoundKind::Empty(true) => "an empty list".to_owned(),
            BoundKind::Empty(false) => "a list that is not empty".to_owned(),
            BoundKind::Count(inner) => {
                let how_many = inner.noun(None);
                let (one, many) = of_list(member);
                format!("{how_many} {}", if how_many == "1" { one } else { many })
            }
            BoundKind::In(items) => match nouns(items).as_slice() {
                [] => "one of no values".to_owned(),
                [one] => one.clone(),
                several => format!("one of {}", listed(several, "and")),
            },
            BoundKind::Not(inner) => format!("anything but {}", inner.noun(member)),
            BoundKind::Compare(which, number) => format!("{} {number}", which.in_words()),
            BoundKind::Matches(regex) => {
                let written = regex.as_str();
                let written = written
                    .strip_prefix(r"\A(?:")
                    .and_then(|rest| rest.strip_suffix(r")\z"));
                format!("a text of the form {:?}", written.unwrap_or(regex.as_str()))
            }
            BoundKind::Present => "a value".to_owned(),
            BoundKind::Absent => "nothing".to_owned(),
        }
    }

    /// One element of the list that `member` holds.
    pub(super) fn element(&self, member: Option<&str>) -> String {
        match &self.kind {
            BoundKind::Object(_) => format!("{}{}", with_article(&of_list(member).0), self.relative(false)),
            _ => self.noun(None),
        }
    }

    /// What follows the word for an element.
    fn relative(&self, several: bool) -> String {
        match &self.kind {
            BoundKind::Object(members) if members.is_empty() => String::new(),
            BoundKind::Object(_) => format!(" where {}", self.conditions()),
            _ if several => format!(" that are {}", self.noun(None)),
            _ => format!(" that is {}", self.noun(None)),
        }
    }
}

impl Compare {
    fn in_words(self) -> &'static str {
        match self {
            Self::Lt => "less than",
            Self::Le => "at most",
            Self::Gt => "more than",
            Self::Ge => "at least",
        }
    }
}

fn nouns(all: &[Bound]) -> Vec<String> {
    all.iter().map(Bound::describe).collect()
}

/// `a`, `a and b`, `a, b and c`.
fn listed(all: &[String], word: &str) -> String {
    match all {
        [] => String::new(),
        [one] => one.clone(),
        [before @ .., last] => format!("{} {word} {last}", before.join(", ")),
    }
}

/// What one and several elements of the list in this member are called: `node state` and `node states`.
fn of_list(member: Option<&str>) -> (String, String) {
    let Some(name) = member else {
        return ("element".to_owned(), "elements".to_owned());
    };
    let mut many = String::new();
    for character in name.chars() {
        if character.is_ascii_uppercase() && !many.is_empty() {
            many.push(' ');
        }
        many.push(character.to_ascii_lowercase());
    }
    let one = many
        .strip_suffix('s')
        .filter(|one| !one.ends_with('s') && !one.is_empty());
    match one {
        Some(one) => (one.to_owned(), many),
        None => (format!("entry of {many}"), format!("entries of {many}")),
    }
}

fn with_article(noun: &str) -> String {
    let article = if noun.starts_with(['a', 'e', 'i', 'o', 'u']) {
        "an"
    } else {
        "a"
    };
    format!("{article} {noun}")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::properties::bound;

    #[test]
    fn no_word_of_the_language_of_suites_is_shown() {
        let wanted = |picture| bound(&picture).conditions();
        assert_eq!(
            wanted(json!({ "orderId": "7", "errors": { "$hasNew": { "errorType": "x", "errorLevel": "WARNING" } } })),
            r#"orderId is "7" and there is a new error where errorType is "x" and errorLevel is "WARNING""#
        );
        assert_eq!(
            wanted(
                json!({ "nodeStates": { "$empty": true }, "batteryState": { "charging": true, "reach": { "$absent": true } } })
            ),
            "nodeStates is an empty list, batteryState.charging is true and batteryState.reach is left out"
        );
        assert_eq!(
            wanted(json!({ "actionStates": { "$count": { "$ge": 2, "$le": 4 } }, "x": { "$in": [1, 2, 3] } })),
            "actionStates has at least 2 and at most 4 elements and x is one of 1, 2 and 3"
        );
        assert_eq!(
            wanted(json!({ "loads": { "$each": { "loadId": { "$not": "a" } } }, "maps": { "$none": {} } })),
            r#"there are no loads but those where loadId is anything but "a" and there is no map"#
        );
        assert_eq!(wanted(json!({})), "anything");
    }

    #[test]
    fn what_is_missing_in_a_list_has_the_name_of_its_elements() {
        let miss = |picture, message| {
            let examination = bound(&picture).examine(&message, None);
            let miss = examination.misses.into_iter().next();
            miss.map(|miss| (miss.path, miss.found, miss.expected))
                .unwrap_or_default()
        };
        let of = |path: &str, found: &str, expected: &str| (path.to_owned(), found.to_owned(), expected.to_owned());
        assert_eq!(
            miss(json!({ "errors": { "$hasNew": {} } }), json!({ "errors": [] })),
            of("errors", "an empty list", "a new error")
        );
        assert_eq!(
            miss(
                json!({ "actionStates": { "$has": { "actionId": "a" } } }),
                json!({ "actionStates": [] })
            ),
            of(
                "actionStates",
                "an empty list",
                r#"an action state where actionId is "a""#
            )
        );
        assert_eq!(
            miss(
                json!({ "information": { "$none": {} } }),
                json!({ "information": [{}] })
            ),
            of("information[0]", "{}", "no entry of information")
        );
    }
}
