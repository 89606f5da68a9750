//! Parts of something that was divided: which of those that are given belong together, and what keeps them from being the whole.
//!
//! What is given is a set: neither its order nor how often something is given changes anything.

use std::collections::BTreeMap;

use super::merged::{MergeTrouble, TroubleKind};
use tck_journal::event::ShardRecord;

/// The longest value that is shown of what differs.
const SHOWN: usize = 80;

/// A part of something.
pub trait Part {
    /// Which part it is; `None` of what is no part.
    fn shard(&self) -> Option<&ShardRecord>;

    /// The hash of what it rests on, which tells it from any other part.
    fn evidence(&self) -> &str;

    /// What it is called, with the folder in which it is, such as `the run 1f2e3d4c in parts/2`.
    fn name(&self) -> String;

    /// What all parts have in common, by what it is called.
    fn facts(&self) -> BTreeMap<String, String>;

    /// Why it does not belong to these, though it has all of this in common with them.
    fn stranger(&self, alike: &[&Self]) -> Option<String> {
        let _ = alike;
        None
    }

    /// Why it did not come to its end.
    fn unfinished(&self) -> Option<String> {
        None
    }

    /// Which part it is, counted from 1; 0 of what is no part.
    fn index(&self) -> usize {
        self.shard().map_or(0, |shard| shard.index)
    }
}

/// Parts that were given, and what they are together.
#[derive(Debug)]
pub struct Gathered<'p, P> {
    /// Each that was given once, by its number, and whether it belongs to the whole.
    pub all: Vec<(&'p P, bool)>,
    /// Those that belong to the whole.
    pub own: Vec<&'p P>,
    /// Into how many parts the whole was divided.
    pub of: usize,
    /// What keeps them from being the whole.
    pub troubles: Vec<MergeTrouble>,
}

/// The most common of some values; of equally common ones the least.
pub fn most_common<T: Ord>(values: impl Iterator<Item = T>) -> Option<T> {
    let mut counts: BTreeMap<T, usize> = BTreeMap::new();
    for value in values {
        *counts.entry(value).or_default() += 1;
    }
    // Of equal counts the last is taken, and they come with the least value last.
    let most = counts.into_iter().rev().max_by_key(|(_, count)| *count);
    most.map(|(value, _)| value)
}

/// What a part has in common with the others of one whole.
fn family<P: Part>(part: &P) -> BTreeMap<String, String> {
    let mut all = part.facts();
    if let Some(shard) = part.shard() {
        all.insert("number of parts".to_owned(), shard.of.to_string());
        all.insert(
            "number of parts with something to do".to_owned(),
            shard.filled.to_string(),
        );
        all.insert("selection".to_owned(), shard.selection.clone());
    }
    all
}

/// Puts parts together. Those belong together that most have everything in common with. `None` when there is no part.
pub fn gathered<P: Part>(parts: &[P]) -> Option<Gathered<'_, P>> {
    let mut given: Vec<&P> = parts.iter().collect();
    given.sort_by(|one, other| (one.index(), one.evidence()).cmp(&(other.index(), other.evidence())));
    given.dedup_by(|one, other| (one.index(), one.evidence()) == (other.index(), other.evidence()));
    let common = most_common(
        given
            .iter()
            .filter(|part| part.shard().is_some())
            .map(|part| family(*part)),
    )?;
    let alike: Vec<&P> = given
        .iter()
        .copied()
        .filter(|part| difference(*part, &common, "").is_none())
        .collect();
    let shard = alike.first()?.shard()?;
    let (of, filled) = (shard.of, shard.filled);
    let mut troubles = Vec::new();
    let mut say = |kind: TroubleKind, index: usize, text: String| troubles.push(MergeTrouble { kind, index, text });
    let mut all = Vec::new();
    for part in given {
        let beyond =
            || (part.index() > filled).then(|| format!("there is nothing to do for part {} of {of}", part.index()));
        let why = difference(part, &common, &others(&alike))
            .or_else(|| part.stranger(&alike))
            .or_else(beyond);
        if let Some(why) = &why {
            say(
                TroubleKind::Foreign,
                part.index(),
                format!("{} is no part of this: {why}", part.name()),
            );
        }
        all.push((part, why.is_none()));
    }
    let own: Vec<&P> = all
        .iter()
        .filter(|(_, counts)| *counts)
        .map(|(part, _)| *part)
        .collect();
    for index in 1..=filled {
        let of_number: Vec<&&P> = own.iter().filter(|part| part.index() == index).collect();
        let name = format!("part {index} of {of}");
        if of_number.is_empty() {
            say(TroubleKind::Missing, index, format!("{name} is missing"));
        }
        if of_number.len() > 1 {
            let names: Vec<String> = of_number.iter().map(|part| part.name()).collect();
            let text = format!(
                "{name} is there {} times ({}): leave out what does not count",
                of_number.len(),
                names.join(", ")
            );
            say(TroubleKind::Duplicate, index, text);
        }
        for why in of_number.iter().filter_map(|part| part.unfinished()) {
            say(
                TroubleKind::Partial,
                index,
                format!("{name} ended before its plan did: {why}"),
            );
        }
    }
    troubles.sort();
    troubles.dedup();
    Some(Gathered { all, own, of, troubles })
}

/// What these are called, as the other side of a comparison: one by its name.
pub fn others<P: Part>(parts: &[&P]) -> String {
    match parts {
        [one] => one.name(),
        _ => "the others".to_owned(),
    }
}

/// What a part does not have in common with the others, and what those are called.
fn difference<P: Part>(part: &P, common: &BTreeMap<String, String>, others: &str) -> Option<String> {
    if part.shard().is_none() {
        return Some("it was made without --shard".to_owned());
    }
    let own = family(part);
    let mut names: Vec<&String> = common.keys().chain(own.keys()).collect();
    // What it is about comes before the settings.
    names.sort_by_key(|name| name.starts_with("setting "));
    let name = names.into_iter().find(|name| common.get(*name) != own.get(*name))?;
    let shown = |value: Option<&String>| match value {
        Some(value) => format!("`{}`", value.chars().take(SHOWN).collect::<String>()),
        None => "not set".to_owned(),
    };
    Some(format!(
        "its {name} is {}, and that of {others} {}",
        shown(own.get(name)),
        shown(common.get(name))
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A part that was made of a selection.
    struct Made {
        shard: ShardRecord,
        folder: &'static str,
    }

    impl Part for Made {
        fn shard(&self) -> Option<&ShardRecord> {
            Some(&self.shard)
        }

        fn evidence(&self) -> &str {
            self.folder
        }

        fn name(&self) -> String {
            format!("the run in {}", self.folder)
        }

        fn facts(&self) -> BTreeMap<String, String> {
            BTreeMap::new()
        }
    }

    fn made(index: usize, selection: &str, folder: &'static str) -> Made {
        let shard = ShardRecord {
            index,
            of: 2,
            origin: "--shard".to_owned(),
            filled: 2,
            whole: 2,
            selection: selection.to_owned(),
        };
        Made { shard, folder }
    }

    #[test]
    fn of_two_parts_the_foreign_one_is_named_with_what_differs_from_the_other() {
        let parts = [made(1, "a", "parts/1"), made(2, "b", "parts/2")];
        let gathered = gathered(&parts).expect("parts");
        let foreign = gathered.troubles.iter().find(|one| one.kind == TroubleKind::Foreign);
        assert_eq!(
            foreign.expect("a foreign part").text,
            "the run in parts/2 is no part of this: its selection is `b`, and that of the run in parts/1 `a`"
        );
    }
}
