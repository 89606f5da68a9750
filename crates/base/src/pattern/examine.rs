//! Why a message does not match: the nearest miss, leaf by leaf, and the place that decided.

use serde_json::Value;

use super::ast::Element;
use super::bound::{Bound, BoundKind};
use super::matches::{Baseline, first_not_included};
use crate::diagnostic::Span;

/// Longest text of `expected` and `found`, in characters.
const TEXT_LIMIT: usize = 200;
/// Most misses that are kept.
const MISS_LIMIT: usize = 20;

/// A message compared with a pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct Examination {
    /// Whether it matches, as [`Bound::matches`] says.
    pub matched: bool,
    /// Leaves of the pattern that agree, and all leaves. Of two messages the one with more agreeing leaves is nearer.
    pub score: (usize, usize),
    /// What does not agree, in the closest element of every array; at most 20.
    pub misses: Vec<Miss>,
    /// Path of the array element that decided, if one did: the one found, or the one that must not be there.
    pub witness: Option<String>,
}

/// One leaf that does not agree.
#[derive(Clone, Debug, PartialEq)]
pub struct Miss {
    /// Place in the message, such as `errors[0].errorLevel`; empty for the message itself.
    pub path: String,
    /// Place in the pattern.
    pub span: Span,
    /// What the pattern asks for, at most 200 characters.
    pub expected: String,
    /// What the message has there, at most 200 characters.
    pub found: String,
}

/// The way from the message to the value at hand; only written out when something has to be reported.
#[derive(Clone, Copy)]
enum Trail<'a> {
    Root,
    Member(&'a Trail<'a>, &'a str),
    Element(&'a Trail<'a>, usize),
}

impl<'a> Trail<'a> {
    /// The member that holds the value.
    fn member(&self) -> Option<&'a str> {
        match self {
            Self::Root => None,
            Self::Member(_, name) => Some(name),
            Self::Element(parent, _) => parent.member(),
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Root => String::new(),
            Self::Member(parent, name) => match parent.text() {
                parent if parent.is_empty() => (*name).to_owned(),
                parent => format!("{parent}.{name}"),
            },
            Self::Element(parent, at) => format!("{}[{at}]", parent.text()),
        }
    }
}

impl Bound {
    /// Compares a message with the pattern and says what is missing. See [`Bound::matches`] for `baseline`.
    #[must_use]
    pub fn examine(&self, message: &Value, baseline: Option<&Value>) -> Examination {
        let baseline = Baseline::new(self, baseline);
        let mut examination = self.compare(Some(message), &baseline, &Trail::Root);
        examination.misses.truncate(MISS_LIMIT);
        examination
    }

    /// Leaves: what can agree or disagree on its own.
    fn leaves(&self) -> usize {
        match &self.kind {
            BoundKind::Object(members) => members.iter().map(|(_, member)| member.leaves()).sum::<usize>().max(1),
            BoundKind::List(parts) | BoundKind::All(parts) => parts.iter().map(Self::leaves).sum::<usize>().max(1),
            BoundKind::Elements(Element::Has | Element::One | Element::Each, inner) => inner.leaves(),
            // One more, for being new.
            BoundKind::Elements(Element::HasNew, inner) => inner.leaves() + 1,
            BoundKind::Includes(items) | BoundKind::Consecutive(items) => items.len().max(1),
            _ => 1,
        }
    }

    fn hit(&self) -> Examination {
        let leaves = self.leaves();
        Examination {
            matched: true,
            score: (leaves, leaves),
            misses: Vec::new(),
            witness: None,
        }
    }

    fn miss(&self, trail: &Trail<'_>, expected: &str, found: &str) -> Examination {
        Examination {
            matched: false,
            score: (0, self.leaves()),
            misses: vec![Miss {
                path: trail.text(),
                span: self.span.clone(),
                expected: bounded(expected),
                found: bounded(found),
            }],
            witness: None,
        }
    }

    fn compare(&self, value: Option<&Value>, baseline: &Baseline, trail: &Trail<'_>) -> Examination {
        match (&self.kind, value) {
            (BoundKind::Object(members), Some(Value::Object(found))) if !members.is_empty() => joined(
                members
                    .iter()
                    .map(|(name, member)| member.compare(found.get(name), baseline, &Trail::Member(trail, name))),
            ),
            (BoundKind::List(items), Some(Value::Array(found))) if !items.is_empty() && items.len() == found.len() => {
                joined(
                    items
                        .iter()
                        .zip(found)
                        .enumerate()
                        .map(|(at, (item, found))| item.compare(Some(found), baseline, &Trail::Element(trail, at))),
                )
            }
            (BoundKind::All(parts), _) if !parts.is_empty() => {
                joined(parts.iter().map(|part| part.compare(value, baseline, trail)))
            }
            (BoundKind::Elements(which, inner), Some(Value::Array(found))) => {
                self.compare_elements(*which, inner, found, baseline, trail)
            }
            (BoundKind::Includes(items), Some(Value::Array(found))) => {
                self.compare_included(items, found, baseline, trail)
            }
            (BoundKind::Count(_), Some(Value::Array(found))) if !self.accepts(value, baseline) => {
                self.miss(trail, &self.noun(None), &format!("{} elements", found.len()))
            }
            _ if self.accepts(value, baseline) => self.hit(),
            _ => self.miss(trail, &self.noun(trail.member()), &shown(value)),
        }
    }

    fn compare_elements(
        &self,
        which: Element,
        inner: &Self,
        found: &[Value],
        baseline: &Baseline,
        trail: &Trail<'_>,
    ) -> Examination {
        let path = |at: usize| Trail::Element(trail, at).text();
        let matching: Vec<usize> = (0..found.len())
            .filter(|at| inner.accepts(found.get(*at), baseline))
            .collect();
        let decided_by = |at: Option<&usize>| Examination {
            witness: at.map(|at| path(*at)),
            ..self.hit()
        };
        match which {
            Element::Has if !matching.is_empty() => decided_by(matching.first()),
            Element::HasNew => {
                let new = baseline.newcomers(self, found);
                match matching.iter().find(|at| new[**at]) {
                    Some(at) => decided_by(Some(at)),
                    // What is new and is not as expected says more than what is as expected and old.
                    None if new.contains(&true) => self.nearest_new(inner, found, &new, baseline, trail),
                    None => match matching.first() {
                        Some(at) => {
                            let mut miss = self.miss(
                                &Trail::Element(trail, *at),
                                &self.noun(trail.member()),
                                &format!("already there before: {}", shown(found.get(*at))),
                            );
                            miss.score.0 = inner.leaves();
                            miss
                        }
                        None => self.nearest(inner, found, baseline, trail),
                    },
                }
            }
            Element::One if matching.len() == 1 => decided_by(matching.first()),
            Element::Has => self.nearest(inner, found, baseline, trail),
            Element::One if matching.is_empty() => self.nearest(inner, found, baseline, trail),
            Element::None if matching.is_empty() => self.hit(),
            Element::AtMostOne if matching.len() <= 1 => decided_by(matching.first()),
            Element::None => {
                let at = matching[0];
                let expected = self.noun(trail.member());
                Examination {
                    witness: Some(path(at)),
                    ..self.miss(&Trail::Element(trail, at), &expected, &shown(found.get(at)))
                }
            }
            Element::One | Element::AtMostOne => {
                let expected = self.noun(trail.member());
                let second = matching[1];
                Examination {
                    witness: Some(path(second)),
                    ..self.miss(
                        trail,
                        &expected,
                        &format!("{} of them, such as {}", matching.len(), shown(found.get(second))),
                    )
                }
            }
            Element::Each => match (0..found.len()).find(|at| matching.binary_search(at).is_err()) {
                None => self.hit(),
                Some(at) => {
                    let odd = inner.compare(found.get(at), baseline, &Trail::Element(trail, at));
                    Examination {
                        witness: Some(path(at)),
                        ..odd
                    }
                }
            },
        }
    }

    /// The closest of the elements, none of which matches.
    fn nearest(&self, inner: &Self, found: &[Value], baseline: &Baseline, trail: &Trail<'_>) -> Examination {
        let best = found
            .iter()
            .enumerate()
            .map(|(at, element)| (at, inner.agreeing(element, baseline)))
            // The first of equals, so that reports are stable.
            .max_by(|left, right| left.1.cmp(&right.1).then(right.0.cmp(&left.0)));
        match best {
            None => self.miss(trail, &self.noun(trail.member()), "an empty list"),
            // Nothing agrees with anything: the whole list says more than one odd element of many.
            Some((_, 0)) if found.len() > 1 => self.miss(
                trail,
                &self.noun(trail.member()),
                &shown(Some(&Value::Array(found.iter().take(8).cloned().collect()))),
            ),
            Some((at, _)) => {
                let closest = inner.compare(found.get(at), baseline, &Trail::Element(trail, at));
                Examination {
                    score: (closest.score.0, self.leaves()),
                    ..closest
                }
            }
        }
    }

    /// The nearest element among those that were not there before.
    fn nearest_new(
        &self,
        inner: &Self,
        found: &[Value],
        new: &[bool],
        baseline: &Baseline,
        trail: &Trail<'_>,
    ) -> Examination {
        let best = (0..found.len())
            .filter(|at| new[*at])
            .map(|at| (at, inner.agreeing(&found[at], baseline)))
            .max_by(|left, right| left.1.cmp(&right.1).then(right.0.cmp(&left.0)));
        let Some((at, _)) = best else {
            return self.nearest(inner, found, baseline, trail);
        };
        let closest = inner.compare(found.get(at), baseline, &Trail::Element(trail, at));
        Examination {
            score: (closest.score.0, self.leaves()),
            ..closest
        }
    }

    /// How many leaves agree, without gathering misses.
    fn agreeing(&self, value: &Value, baseline: &Baseline) -> usize {
        match (&self.kind, value) {
            (BoundKind::Object(members), Value::Object(found)) if !members.is_empty() => members
                .iter()
                .map(|(name, member)| match found.get(name) {
                    Some(found) => member.agreeing(found, baseline),
                    None if member.accepts(None, baseline) => member.leaves(),
                    None => 0,
                })
                .sum(),
            (BoundKind::All(parts), _) if !parts.is_empty() => {
                parts.iter().map(|part| part.agreeing(value, baseline)).sum()
            }
            (BoundKind::Elements(Element::Has | Element::One | Element::HasNew, inner), Value::Array(found))
                if !self.accepts(Some(value), baseline) =>
            {
                found
                    .iter()
                    .map(|element| inner.agreeing(element, baseline))
                    .max()
                    .unwrap_or(0)
            }
            _ if self.accepts(Some(value), baseline) => self.leaves(),
            _ => 0,
        }
    }

    fn compare_included(&self, items: &[Self], found: &[Value], baseline: &Baseline, trail: &Trail<'_>) -> Examination {
        let Some(first) = first_not_included(items, found, baseline) else {
            return self.hit();
        };
        let missing = &items[first];
        let mut examination = self.miss(
            trail,
            &missing.element(trail.member()),
            &shown(Some(&Value::Array(found.iter().take(8).cloned().collect()))),
        );
        examination.score.0 = first;
        examination
    }
}

fn joined(parts: impl Iterator<Item = Examination>) -> Examination {
    let mut whole = Examination {
        matched: true,
        score: (0, 0),
        misses: Vec::new(),
        witness: None,
    };
    for part in parts {
        // The witness that matters is that of the part that failed; without a failure, the first.
        if (whole.matched && !part.matched && part.witness.is_some()) || whole.witness.is_none() {
            whole.witness = part.witness;
        }
        whole.matched &= part.matched;
        whole.score.0 += part.score.0;
        whole.score.1 += part.score.1;
        let room = MISS_LIMIT.saturating_sub(whole.misses.len());
        whole.misses.extend(part.misses.into_iter().take(room));
    }
    whole
}

/// Takes no more than is shown: a hostile value may be megabytes long.
struct Limited(String);

impl std::io::Write for Limited {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.0.len() > TEXT_LIMIT * 4 {
            return Err(std::io::ErrorKind::WriteZero.into());
        }
        self.0
            .push_str(&String::from_utf8_lossy(&bytes[..bytes.len().min(TEXT_LIMIT * 8)]));
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn shown(value: Option<&Value>) -> String {
    let Some(value) = value else {
        return "nothing".to_owned();
    };
    let mut limited = Limited(String::new());
    let _ = serde_json::to_writer(&mut limited, value);
    limited.0
}

fn bounded(text: &str) -> String {
    if text.chars().nth(TEXT_LIMIT).is_none() {
        return text.to_owned();
    }
    text.chars().take(TEXT_LIMIT - 1).chain(['…']).collect()
}
