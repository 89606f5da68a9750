//! `suites/qualification/`: the clauses and monitors that no fault of the reference device can fail, the faults that nothing
//! finds, and the liberties of other versions that a version does not give. Each has its reason.
//!
//! Qualification holds the lists both ways: what is unproven stands in them, and what stands in them is unproven.

use std::sync::Arc;

use super::fields::{Fields, Problems};
use super::lint::Vocabulary;
use super::read::start;
use super::source::parse;
use super::steps::version_range;
use tck_base::diagnostic::Source;
use tck_pack::{Role, Version, VersionRange};

/// A clause or monitor that no fault can fail.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unproven {
    /// The side under test.
    pub role: Role,
    /// The versions in which nothing can; all unless said.
    pub spec: Option<VersionRange>,
    /// Requirement id.
    pub requirement: String,
    /// Test id and clause, or monitor id, as the kill matrix names it.
    pub place: String,
    /// Why no fault can fail it.
    pub why: String,
}

/// A fault that no requirement it names is reported for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unfound {
    /// The side whose reference device has it.
    pub role: Role,
    /// The versions in which nothing finds it; all unless said.
    pub spec: Option<VersionRange>,
    /// Name of the fault.
    pub fault: String,
    /// Why nothing finds it.
    pub why: String,
}

/// A liberty of other versions that a version forbids.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Forbidden {
    /// The side whose reference device has it.
    pub role: Role,
    /// The versions that forbid it; all unless said.
    pub spec: Option<VersionRange>,
    /// Name of the tolerance.
    pub tolerance: String,
    /// Which requirement forbids it.
    pub why: String,
}

/// All exceptions of the suites.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exceptions {
    /// What no fault can fail.
    pub unproven: Vec<Unproven>,
    /// What nothing finds.
    pub unfound: Vec<Unfound>,
    /// What a version forbids.
    pub forbidden: Vec<Forbidden>,
}

impl Exceptions {
    /// Those of a side that hold in a version.
    #[must_use]
    pub fn of(&self, role: Role, version: Version) -> Self {
        let holds = |of: Role, spec: &Option<VersionRange>| {
            of == role && spec.as_ref().is_none_or(|spec| spec.contains(version))
        };
        let unproven = self.unproven.iter().filter(|one| holds(one.role, &one.spec));
        let unfound = self.unfound.iter().filter(|one| holds(one.role, &one.spec));
        let forbidden = self.forbidden.iter().filter(|one| holds(one.role, &one.spec));
        Self {
            unproven: unproven.cloned().collect(),
            unfound: unfound.cloned().collect(),
            forbidden: forbidden.cloned().collect(),
        }
    }

    /// Whether a fault is one that nothing finds.
    #[must_use]
    pub fn is_unfound(&self, fault: &str) -> bool {
        self.unfound.iter().any(|one| one.fault == fault)
    }

    /// Whether a tolerance is one that is forbidden.
    #[must_use]
    pub fn is_forbidden(&self, tolerance: &str) -> bool {
        self.forbidden.iter().any(|one| one.tolerance == tolerance)
    }
}

/// Reads one file.
pub(super) fn read(
    source: &Arc<Source>,
    role: Role,
    vocabulary: &dyn Vocabulary,
    problems: &mut Problems,
) -> Exceptions {
    let Some(root) = parse(source, problems) else {
        return Exceptions::default();
    };
    let Some(fields) = Fields::of(&root, problems) else {
        return Exceptions::default();
    };
    fields.only(&[&["unproven", "unfound", "forbidden"]], problems);
    fields.need("unproven", &start(&root), problems);
    Exceptions {
        unproven: unproven(&fields, role, vocabulary, problems),
        unfound: reasoned(&fields, ["unfound", "fault"], problems, |fault, spec, why| Unfound {
            role,
            spec,
            fault,
            why,
        }),
        forbidden: reasoned(&fields, ["forbidden", "tolerance"], problems, |tolerance, spec, why| {
            Forbidden {
                role,
                spec,
                tolerance,
                why,
            }
        }),
    }
}

/// A list of names, each with the versions it stands for and a reason.
fn reasoned<T>(
    fields: &Fields<'_>,
    [list, member]: [&'static str; 2],
    problems: &mut Problems,
    make: impl Fn(String, Option<VersionRange>, String) -> T,
) -> Vec<T> {
    let mut all = Vec::new();
    for node in fields.list(list, problems) {
        let Some(fields) = Fields::of(node, problems) else {
            continue;
        };
        fields.only(&[&[member, "spec", "why"]], problems);
        let name = fields.need_text(member, &node.span, problems);
        let why = fields.need_text("why", &node.span, problems);
        let (Some(name), Some(why)) = (name, why) else {
            continue;
        };
        let spec = fields.get("spec", problems);
        let spec = spec.and_then(|node| version_range(node, problems));
        all.push(make(name.to_owned(), spec, why.to_owned()));
    }
    all
}

fn unproven(fields: &Fields<'_>, role: Role, vocabulary: &dyn Vocabulary, problems: &mut Problems) -> Vec<Unproven> {
    let mut all = Vec::new();
    for node in fields.list("unproven", problems) {
        let Some(fields) = Fields::of(node, problems) else {
            continue;
        };
        fields.only(&[&["requirement", "place", "spec", "why"]], problems);
        let requirement = fields.need_text("requirement", &node.span, problems);
        let place = fields.need_text("place", &node.span, problems);
        let why = fields.need_text("why", &node.span, problems);
        let (Some(requirement), Some(place), Some(why)) = (requirement, place, why) else {
            continue;
        };
        if vocabulary.requirement(requirement).is_none() {
            let ids = vocabulary.requirements();
            let at = fields
                .get("requirement", problems)
                .map_or(&node.span, |node| &node.span);
            problems.unknown(
                "unknown-requirement",
                at,
                "requirement",
                requirement,
                ids.iter().map(String::as_str),
            );
        }
        let spec = fields.get("spec", problems);
        all.push(Unproven {
            role,
            spec: spec.and_then(|node| version_range(node, problems)),
            requirement: requirement.to_owned(),
            place: place.to_owned(),
            why: why.to_owned(),
        });
    }
    all
}
