//! Patterns as a version writes the messages they are pictures of.
//!
//! A suite calls members by their usual names, those of 2.x, and by what later versions have beside them. What a version calls them,
//! where they stand, and which words it writes for those of 2.x is known to its pack ([`Names`]).

use std::borrow::Cow;

use serde_json::Value;

use tck_base::pattern::{Elements, Pattern, PatternKind, Term, TermKind};
use tck_view::{Names, Object, Spelling, Topic};

/// A picture of messages of a topic, written with the names of a version. What stands on no topic of the protocol stays as it is.
#[must_use]
pub fn spelled<'p>(pattern: &'p Pattern, names: &Names, topic: &str) -> Cow<'p, Pattern> {
    // That of a second vehicle is the topic with a mark behind it.
    let topic = Topic::of_name(topic.split('@').next().unwrap_or(topic));
    let speller = Speller { names };
    let place = Place {
        object: Some(topic.object()),
        spelling: None,
    };
    if topic == Topic::Other || !names.differs() || speller.is_the_same(pattern, place) {
        return Cow::Borrowed(pattern);
    }
    Cow::Owned(speller.pattern(pattern, place))
}

/// A place in a message.
#[derive(Clone, Copy)]
struct Place<'n> {
    /// The kind of object that stands there, or that the elements of the list are.
    object: Option<Object>,
    /// The member that it is.
    spelling: Option<Spelling<'n>>,
}

struct Speller<'n> {
    names: &'n Names,
}

/// Whether a value is written with the usual words.
fn is_term_the_same(term: &Term, place: Place<'_>) -> bool {
    match &term.kind {
        TermKind::Literal(Value::String(text)) => place.spelling.is_none_or(|own| own.word(text) == text),
        TermKind::List(items) => items.iter().all(|item| is_term_the_same(item, place)),
        TermKind::Map(_) => false,
        _ => true,
    }
}

impl<'n> Speller<'n> {
    /// The place of a member.
    fn below(&self, name: &str, place: Place<'n>) -> Place<'n> {
        let spelling = place.object.and_then(|object| self.names.spelling(object, name));
        Place {
            object: spelling.and_then(|spelling| spelling.holds),
            spelling,
        }
    }

    /// Whether a picture is written with the usual names and words.
    fn is_the_same(&self, pattern: &Pattern, place: Place<'n>) -> bool {
        let all = |parts: &[Pattern]| parts.iter().all(|part| self.is_the_same(part, place));
        match &pattern.kind {
            PatternKind::Object(members) => members.iter().all(|(name, member)| {
                let below = self.below(name, place);
                below.spelling.is_none_or(|own| own.name.is_none_or(|own| own == name))
                    && self.is_the_same(member, below)
            }),
            PatternKind::List(parts) | PatternKind::All(parts) => all(parts),
            PatternKind::Elements(elements) => self.is_the_same(&elements.pattern, place),
            PatternKind::Not(inner) => self.is_the_same(inner, place),
            PatternKind::Equals(term) | PatternKind::Includes(term) | PatternKind::Consecutive(term) => {
                is_term_the_same(term, place)
            }
            PatternKind::In(terms) => terms.iter().all(|term| is_term_the_same(term, place)),
            _ => true,
        }
    }

    fn pattern(&self, pattern: &Pattern, place: Place<'n>) -> Pattern {
        let each = |parts: &[Pattern]| parts.iter().map(|part| self.pattern(part, place)).collect();
        let kind = match &pattern.kind {
            PatternKind::Object(members) => {
                let members = members.iter().map(|(name, member)| self.member(name, member, place));
                PatternKind::Object(members.collect())
            }
            PatternKind::List(parts) => PatternKind::List(each(parts)),
            PatternKind::All(parts) => PatternKind::All(each(parts)),
            PatternKind::Elements(elements) => PatternKind::Elements(Elements {
                which: elements.which,
                pattern: Box::new(self.pattern(&elements.pattern, place)),
            }),
            PatternKind::Not(inner) => PatternKind::Not(Box::new(self.pattern(inner, place))),
            PatternKind::Equals(term) => PatternKind::Equals(self.term(term, place)),
            PatternKind::Includes(term) => PatternKind::Includes(self.term(term, place)),
            PatternKind::Consecutive(term) => PatternKind::Consecutive(self.term(term, place)),
            PatternKind::In(terms) => PatternKind::In(terms.iter().map(|term| self.term(term, place)).collect()),
            other => other.clone(),
        };
        Pattern {
            kind,
            span: pattern.span.clone(),
        }
    }

    fn member(&self, name: &str, member: &Pattern, place: Place<'n>) -> (String, Pattern) {
        let below = self.below(name, place);
        let inner = self.pattern(member, below);
        let own = below.spelling.and_then(|spelling| spelling.name).unwrap_or(name);
        match own.split_once('/') {
            Some((outer, rest)) => {
                let span = inner.span.clone();
                let kind = PatternKind::Object(vec![(rest.to_owned(), inner)]);
                (outer.to_owned(), Pattern { kind, span })
            }
            None => (own.to_owned(), inner),
        }
    }

    fn term(&self, term: &Term, place: Place<'n>) -> Term {
        let kind = match &term.kind {
            TermKind::Literal(Value::String(text)) => {
                let word = place.spelling.map_or(text.as_str(), |spelling| spelling.word(text));
                TermKind::Literal(Value::String(word.to_owned()))
            }
            TermKind::List(items) => TermKind::List(items.iter().map(|item| self.term(item, place)).collect()),
            TermKind::Map(members) => TermKind::Map(
                members
                    .iter()
                    .map(|(name, value)| self.entry(name, value, place))
                    .collect(),
            ),
            other => other.clone(),
        };
        Term {
            kind,
            span: term.span.clone(),
        }
    }

    fn entry(&self, name: &str, value: &Term, place: Place<'n>) -> (String, Term) {
        let below = self.below(name, place);
        let own = below.spelling.and_then(|spelling| spelling.name).unwrap_or(name);
        (own.to_owned(), self.term(value, below))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::Problems;
    use crate::terms::pattern;
    use serde_json::json;
    use tck_base::diagnostic::Source;
    use tck_base::pattern::{Bindings, Bound};
    use tck_pack::{Assets, Packs};

    fn bound(text: &str, version: &str) -> Bound {
        let packs = Packs::load(&Assets::of_source_tree().expect("assets")).expect("packs");
        let tree = tck_base::yaml::tree(&Source::new("test", text)).expect("yaml");
        let read = pattern(&tree, &mut Problems::default()).expect("pattern");
        let names = packs.get(version).expect("pack").names();
        spelled(&read, names, "state").bind(&Bindings::new()).expect("bound")
    }

    #[test]
    fn a_picture_is_one_of_the_messages_of_the_version() {
        let text = "{ agvPosition: { positionInitialized: true }, instantActionStates: { $has: { actionType: initPosition } } }";
        let states = |position: &str, initialized: &str, list: &str, action: &str| json!({ position: { initialized: true }, list: [{ "actionType": action }] });
        let older = states("agvPosition", "positionInitialized", "actionStates", "initPosition");
        let newer = states(
            "mobileRobotPosition",
            "localized",
            "instantActionStates",
            "initializePosition",
        );
        for (version, fits, other) in [
            ("2.0", &older, &newer),
            ("2.1", &older, &newer),
            ("3.0", &newer, &older),
        ] {
            let bound = bound(text, version);
            assert!(bound.matches(fits, None), "{version}");
            assert!(!bound.matches(other, None), "{version}");
        }
    }

    #[test]
    fn a_picture_that_is_the_same_in_a_version_is_not_copied() {
        let tree = tck_base::yaml::tree(&Source::new("test", "{ agvPosition: { x: 1 } }")).expect("yaml");
        let read = pattern(&tree, &mut Problems::default()).expect("pattern");
        let packs = Packs::load(&Assets::of_source_tree().expect("assets")).expect("packs");
        let is_copied = |version: &str, topic: &str| {
            let names = packs.get(version).expect("pack").names();
            matches!(spelled(&read, names, topic), Cow::Owned(_))
        };
        assert!(!is_copied("2.1", "state") && is_copied("3.0", "state"));
        assert!(!is_copied("3.0", "mqtt/publish"));
    }
}
