//! `suites/qualification/`: the clauses and monitors that no fault of the reference device can fail, and why.
//!
//! Qualification holds the list both ways: what is unproven stands in it, and what stands in it is unproven.

use std::sync::Arc;

use super::fields::{Fields, Problems};
use super::lint::Vocabulary;
use super::read::start;
use super::source::parse;
use super::steps::version_range;
use crate::diagnostic::Source;
use crate::pack::{Role, VersionRange};

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

/// Reads one file.
pub(super) fn read(
    source: &Arc<Source>,
    role: Role,
    vocabulary: &dyn Vocabulary,
    problems: &mut Problems,
) -> Vec<Unproven> {
    let Some(root) = parse(source, problems) else {
        return Vec::new();
    };
    let Some(fields) = Fields::of(&root, problems) else {
        return Vec::new();
    };
    fields.only(&[&["unproven"]], problems);
    fields.need("unproven", &start(&root), problems);
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
