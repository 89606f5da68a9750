//! What became of the requirements from one version to a later one.

use serde::Serialize;

use super::catalogue::{Catalogue, Requirement, VersionChange, VersionNote};
use super::protocol::{Pack, Packs};

/// What became of a requirement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ChangeKind {
    /// The later version does not have it.
    Gone,
    /// It asks for something else, or as strongly as it did not before.
    Changed,
    /// It asks for the same in other words, such as by another name of a member.
    Reworded,
    /// The earlier version does not have it.
    New,
    /// It is as before.
    Same,
}

impl ChangeKind {
    /// All of them, in the order in which a reader wants to know them.
    pub const ALL: [Self; 5] = [Self::Gone, Self::Changed, Self::Reworded, Self::New, Self::Same];

    /// In one word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Gone => "gone",
            Self::Changed => "changed",
            Self::Reworded => "reworded",
            Self::New => "new",
            Self::Same => "same",
        }
    }
}

/// One requirement in two versions.
#[derive(Clone, Debug)]
pub struct RequirementChange<'c> {
    /// What became of it.
    pub kind: ChangeKind,
    /// The requirement in the words of the earlier version, and what that says.
    pub before: Option<(&'c Requirement, &'c VersionNote)>,
    /// The requirement in the words of the later version, and what that says.
    pub after: Option<(&'c Requirement, &'c VersionNote)>,
    /// What is different, or why it is gone.
    pub why: Option<&'c str>,
}

impl<'c> RequirementChange<'c> {
    /// The requirement in the words of the later version that has it.
    #[must_use]
    pub fn requirement(&self) -> Option<&'c Requirement> {
        self.after.or(self.before).map(|(requirement, _)| requirement)
    }
}

impl Catalogue {
    /// What became of each requirement that one of two versions has, in the order of the catalogue.
    #[must_use]
    pub fn changes(&self, packs: &Packs, from: &Pack, to: &Pack) -> Vec<RequirementChange<'_>> {
        let order = |pack: &Pack| (pack.version.major, pack.version.minor);
        let later = packs.all().iter().map(AsRef::as_ref);
        let later: Vec<&Pack> = later
            .filter(|pack: &&Pack| order(from) < order(pack) && order(pack) <= order(to))
            .collect();
        self.all()
            .filter_map(|one| of_requirement(one, from, to, &later))
            .collect()
    }
}

/// What became of one requirement; `None` where neither version has it.
fn of_requirement<'c>(
    requirement: &'c Requirement,
    from: &Pack,
    to: &Pack,
    later: &[&Pack],
) -> Option<RequirementChange<'c>> {
    let said = |pack: &Pack| Some((requirement.edition(pack), requirement.in_version(pack)?));
    let (before, after) = (said(from), said(to));
    let notes = || later.iter().rev().filter_map(|pack| requirement.in_version(pack));
    let with = |change: VersionChange| notes().find(|note| note.change == Some(change));
    let (kind, why) = match (before, after) {
        (None, None) => return None,
        (Some(_), None) => {
            let mut reasons = later.iter().filter_map(|pack| requirement.gone.get(&pack.id));
            (ChangeKind::Gone, reasons.next().map(String::as_str))
        }
        (None, Some(_)) => (ChangeKind::New, None),
        (Some((_, before)), Some((_, after))) => match (with(VersionChange::Changed), with(VersionChange::Reworded)) {
            (Some(note), _) => (ChangeKind::Changed, note.delta.as_deref()),
            (None, note) if before.mood != after.mood => {
                (ChangeKind::Changed, note.and_then(|note| note.delta.as_deref()))
            }
            (None, Some(note)) => (ChangeKind::Reworded, note.delta.as_deref()),
            (None, None) => (ChangeKind::Same, None),
        },
    };
    Some(RequirementChange {
        kind,
        before,
        after,
        why,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Assets;

    fn count(from: &str, to: &str) -> Vec<usize> {
        let assets = Assets::of_source_tree().unwrap();
        let packs = Packs::load(&assets).unwrap();
        let catalogue = Catalogue::load(&assets).unwrap();
        let of = |version| packs.get(version).unwrap();
        let all = catalogue.changes(&packs, of(from), of(to));
        let kinds = ChangeKind::ALL.iter();
        kinds
            .map(|kind| all.iter().filter(|one| one.kind == *kind).count())
            .collect()
    }

    #[test]
    fn each_requirement_is_gone_changed_reworded_new_or_as_before() {
        assert_eq!(count("2.1", "3.0"), [15, 88, 54, 273, 193]);
        let [gone, changed, reworded, new, same] = count("2.0", "2.1")[..] else {
            panic!("five kinds");
        };
        assert_eq!((gone, reworded, new), (0, 0, 51));
        assert!(changed > 0 && changed + same == 299, "{changed} {same}");
        let two_steps = count("2.0", "3.0");
        assert_eq!(two_steps[0] + two_steps[1] + two_steps[2] + two_steps[4], 299);
        assert_eq!(count("2.1", "2.1"), [0, 0, 0, 0, 350]);
    }

    #[test]
    fn what_is_gone_or_different_says_why_and_both_sentences_are_there() {
        let assets = Assets::of_source_tree().unwrap();
        let packs = Packs::load(&assets).unwrap();
        let catalogue = Catalogue::load(&assets).unwrap();
        let of = |version| packs.get(version).unwrap();
        for change in catalogue.changes(&packs, of("2.1"), of("3.0")) {
            let id = &change.requirement().expect("one of the two has it").id;
            let differs = matches!(
                change.kind,
                ChangeKind::Gone | ChangeKind::Changed | ChangeKind::Reworded
            );
            assert_eq!(change.why.is_some(), differs, "{id}");
            if change.kind == ChangeKind::Same {
                let (before, after) = (change.before.unwrap(), change.after.unwrap());
                assert_eq!(before.0.text, after.0.text, "{id}");
            }
        }
        let changes = catalogue.changes(&packs, of("2.1"), of("3.0"));
        let topics = changes
            .iter()
            .find(|one| one.requirement().unwrap().id.as_str() == "TOPIC-01")
            .unwrap();
        assert!(topics.after.unwrap().0.text.contains("zoneSet") && !topics.before.unwrap().0.text.contains("zoneSet"));
    }
}
