//! Whether a message matches. Work is bounded by the size of the pattern times the size of the message.

use std::collections::HashMap;

use serde_json::Value;

use super::ast::{Compare, Element};
use super::bound::{Bound, BoundKind};
use super::number::{canonical, compare_numbers, same_value};

/// What every `$hasNew` of a pattern found in the baseline: canonical texts of the elements that were there
/// before, and how many of each, by the address of the pattern. An element is old when an equal one was anywhere at
/// this path; one more of its like than before is new.
pub(super) struct Baseline(HashMap<*const Bound, HashMap<String, usize>>);

impl Baseline {
    pub(super) fn new(pattern: &Bound, message: Option<&Value>) -> Self {
        let mut old = HashMap::new();
        if let Some(message) = message
            && pattern.looks_back()
        {
            collect(pattern, &[message], &mut old);
        }
        Self(old)
    }

    /// Which elements of the list a `$hasNew` looks at were not there before, by their places.
    pub(super) fn newcomers(&self, pattern: &Bound, list: &[Value]) -> Vec<bool> {
        let Some(old) = self.0.get(&std::ptr::from_ref(pattern)).filter(|old| !old.is_empty()) else {
            return vec![true; list.len()];
        };
        let mut like: HashMap<String, usize> = HashMap::new();
        let new = list.iter().map(|element| {
            let text = canonical(element);
            let before = old.get(&text).copied().unwrap_or(0);
            let here = like.entry(text).or_insert(0);
            *here += 1;
            *here > before
        });
        new.collect()
    }
}

fn collect(pattern: &Bound, before: &[&Value], old: &mut HashMap<*const Bound, HashMap<String, usize>>) {
    if before.is_empty() {
        return;
    }
    let elements = || -> Vec<&Value> { before.iter().filter_map(|value| value.as_array()).flatten().collect() };
    match &pattern.kind {
        BoundKind::Object(members) => {
            for (name, member) in members {
                let before: Vec<_> = before.iter().filter_map(|value| value.get(name)).collect();
                collect(member, &before, old);
            }
        }
        BoundKind::List(items) => {
            for (at, item) in items.iter().enumerate() {
                let before: Vec<_> = before.iter().filter_map(|value| value.get(at)).collect();
                collect(item, &before, old);
            }
        }
        BoundKind::All(parts) => parts.iter().for_each(|part| collect(part, before, old)),
        BoundKind::Not(inner) => collect(inner, before, old),
        BoundKind::Elements(which, inner) => {
            let elements = elements();
            if *which == Element::HasNew {
                let mut texts = HashMap::new();
                for element in &elements {
                    *texts.entry(canonical(element)).or_insert(0) += 1;
                }
                old.insert(std::ptr::from_ref(pattern), texts);
            }
            collect(inner, &elements, old);
        }
        _ => {}
    }
}

impl Bound {
    /// Whether `message` matches. `baseline` is the last message on the same topic before the stimulus; it only
    /// matters to `$hasNew`, and without one every element is new.
    #[must_use]
    pub fn matches(&self, message: &Value, baseline: Option<&Value>) -> bool {
        self.accepts(Some(message), &Baseline::new(self, baseline))
    }

    /// The elements a `$hasNew` looks at that were not there before, whatever they show.
    #[must_use]
    pub fn newcomers<'a>(&self, message: &'a Value, baseline: Option<&Value>) -> Vec<&'a Value> {
        let mut found = Vec::new();
        self.gather_new(&[message], &Baseline::new(self, baseline), &mut found);
        found
    }

    /// Of what kind the elements are that a `$hasNew` asks for: the members that name a type, with what they must be.
    #[must_use]
    pub fn kinds_of_new(&self) -> Vec<(&str, &Self)> {
        let mut found = Vec::new();
        self.gather_kinds(false, &mut found);
        found
    }

    fn gather_kinds<'a>(&'a self, inside: bool, found: &mut Vec<(&'a str, &'a Self)>) {
        match &self.kind {
            BoundKind::Object(members) => {
                for (name, member) in members {
                    if inside && name.ends_with("Type") {
                        found.push((name, member));
                    } else if !inside {
                        member.gather_kinds(false, found);
                    }
                }
            }
            BoundKind::All(parts) => parts.iter().for_each(|part| part.gather_kinds(inside, found)),
            BoundKind::Elements(Element::HasNew, inner) => inner.gather_kinds(true, found),
            _ => {}
        }
    }

    fn gather_new<'a>(&self, values: &[&'a Value], baseline: &Baseline, found: &mut Vec<&'a Value>) {
        match &self.kind {
            BoundKind::Object(members) => {
                for (name, member) in members {
                    let inside: Vec<_> = values.iter().filter_map(|value| value.get(name)).collect();
                    member.gather_new(&inside, baseline, found);
                }
            }
            BoundKind::All(parts) => parts.iter().for_each(|part| part.gather_new(values, baseline, found)),
            BoundKind::Not(inner) => inner.gather_new(values, baseline, found),
            BoundKind::Elements(Element::HasNew, _) => {
                for list in values.iter().filter_map(|value| value.as_array()) {
                    let new = baseline.newcomers(self, list);
                    found.extend(list.iter().zip(new).filter_map(|(element, new)| new.then_some(element)));
                }
            }
            _ => {}
        }
    }

    /// The members of the message below which a `$hasNew` stands: two messages in which they are the same are the same
    /// baseline. `None` when the pattern is not one of members.
    #[must_use]
    pub fn members_that_look_back(&self) -> Option<Vec<&str>> {
        let BoundKind::Object(members) = &self.kind else {
            return None;
        };
        let looking = members.iter().filter(|(_, member)| member.looks_back());
        Some(looking.map(|(name, _)| name.as_str()).collect())
    }

    /// Whether a `$hasNew` stands anywhere in the pattern, so that the baseline matters.
    #[must_use]
    pub fn looks_back(&self) -> bool {
        match &self.kind {
            BoundKind::Elements(which, inner) => *which == Element::HasNew || inner.looks_back(),
            BoundKind::Object(members) => members.iter().any(|(_, member)| member.looks_back()),
            BoundKind::List(parts) | BoundKind::All(parts) => parts.iter().any(Self::looks_back),
            BoundKind::Not(inner) => inner.looks_back(),
            _ => false,
        }
    }

    pub(super) fn accepts(&self, value: Option<&Value>, baseline: &Baseline) -> bool {
        match &self.kind {
            BoundKind::Equals(expected) => value.is_some_and(|found| same_value(expected, found)),
            BoundKind::Object(members) => value.and_then(Value::as_object).is_some_and(|found| {
                members
                    .iter()
                    .all(|(name, member)| member.accepts(found.get(name), baseline))
            }),
            BoundKind::List(items) => value.and_then(Value::as_array).is_some_and(|found| {
                items.len() == found.len()
                    && items
                        .iter()
                        .zip(found)
                        .all(|(item, found)| item.accepts(Some(found), baseline))
            }),
            BoundKind::All(parts) => parts.iter().all(|part| part.accepts(value, baseline)),
            BoundKind::Elements(which, inner) => match value {
                None => *which == Element::None,
                Some(Value::Array(found)) => self.elements_accept(*which, inner, found, baseline),
                Some(_) => false,
            },
            BoundKind::Includes(items) => value
                .and_then(Value::as_array)
                .is_some_and(|found| first_not_included(items, found, baseline).is_none()),
            BoundKind::Consecutive(items) => value.and_then(Value::as_array).is_some_and(|found| {
                let fits = |run: &[Value]| {
                    items
                        .iter()
                        .zip(run)
                        .all(|(item, one)| item.accepts(Some(one), baseline))
                };
                items.is_empty() || found.windows(items.len()).any(fits)
            }),
            BoundKind::Unfit { .. } => false,
            BoundKind::Empty(empty) => value
                .and_then(Value::as_array)
                .is_some_and(|found| found.is_empty() == *empty),
            BoundKind::Count(inner) => value
                .and_then(Value::as_array)
                .is_some_and(|found| inner.accepts(Some(&Value::from(found.len())), baseline)),
            BoundKind::In(items) => value.is_some() && items.iter().any(|item| item.accepts(value, baseline)),
            BoundKind::Not(inner) => !inner.accepts(value, baseline),
            BoundKind::Compare(which, limit) => match value {
                Some(Value::Number(found)) => compare_numbers(found, limit).is_some_and(|order| which.holds(order)),
                _ => false,
            },
            BoundKind::Matches(regex) => value.and_then(Value::as_str).is_some_and(|text| regex.is_match(text)),
            BoundKind::Present => value.is_some(),
            BoundKind::Absent => value.is_none(),
        }
    }

    fn elements_accept(&self, which: Element, inner: &Self, found: &[Value], baseline: &Baseline) -> bool {
        if which == Element::HasNew {
            let matching: Vec<bool> = found
                .iter()
                .map(|element| inner.accepts(Some(element), baseline))
                .collect();
            // What is new is costly to tell, and most messages have nothing that matches.
            return matching.contains(&true)
                && std::iter::zip(matching, baseline.newcomers(self, found)).any(|(matches, new)| matches && new);
        }
        let mut matching = found.iter().filter(|element| inner.accepts(Some(element), baseline));
        match which {
            Element::Has => matching.next().is_some(),
            Element::HasNew => false,
            Element::None => matching.next().is_none(),
            Element::One => matching.next().is_some() && matching.next().is_none(),
            Element::AtMostOne => matching.nth(1).is_none(),
            Element::Each => matching.count() == found.len(),
        }
    }
}

/// The first item that no element matches. Each search begins behind the last hit, because lists that include
/// one another mostly do so in order.
pub(super) fn first_not_included(items: &[Bound], found: &[Value], baseline: &Baseline) -> Option<usize> {
    let mut next = 0;
    items.iter().position(|item| {
        let (before, after) = found.split_at(next);
        let hit = after
            .iter()
            .chain(before)
            .position(|element| item.accepts(Some(element), baseline));
        if let Some(at) = hit {
            next = (next + at + 1) % found.len();
        }
        hit.is_none()
    })
}

impl Compare {
    pub(super) fn holds(self, order: std::cmp::Ordering) -> bool {
        match self {
            Self::Lt => order.is_lt(),
            Self::Le => order.is_le(),
            Self::Gt => order.is_gt(),
            Self::Ge => order.is_ge(),
        }
    }
}
