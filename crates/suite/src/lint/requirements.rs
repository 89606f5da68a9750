//! What clauses decide: requirements that there are, that oblige the side under test, and that can be broken.

use std::collections::BTreeSet;

use super::Linter;
use crate::model::{Assertion, Binding, Extent, Selection, Step, Verb};
use tck_base::diagnostic::{Diagnostic, Span, did_you_mean};
use tck_pack::RequirementId;

impl Linter<'_> {
    /// Checks the requirements of a clause; the packs that have one of them, or `None` without any.
    pub(super) fn requirements(&mut self, bindings: &[Binding], packs: &[usize]) -> Option<Vec<usize>> {
        let mut having = BTreeSet::new();
        for binding in bindings {
            having.extend(self.requirement(&binding.requirement, &binding.span, packs));
        }
        (!bindings.is_empty()).then(|| having.into_iter().collect())
    }

    /// Refuses a clause on what is a permission in one of these versions.
    pub(super) fn not_permitted(&mut self, id: &RequirementId, at: &Span, packs: &[usize]) {
        let permitting = self.vocabulary.requirement(id.as_str()).map(|facts| facts.permitting);
        let versions = self.vocabulary.versions();
        let permits = permitting.into_iter().flatten().find(|pack| packs.contains(pack));
        if let Some(version) = permits.and_then(|pack| versions.get(pack)) {
            let title = format!("`{id}` is a permission in {version}, and a permission cannot be broken");
            self.problems.add(
                Diagnostic::new("permission-judged", at.clone(), title, "this would always pass").hint(
                    "write `prefers:` or `prefer:` where the catalogue asks for a warning, or take this out of that version by `spec:`",
                ),
            );
        }
    }

    /// The packs out of `packs` that have the requirement.
    pub(super) fn requirement(&mut self, id: &RequirementId, at: &Span, packs: &[usize]) -> Vec<usize> {
        let Some(facts) = self.vocabulary.requirement(id.as_str()) else {
            let ids = self.vocabulary.requirements();
            let near = did_you_mean(
                id.as_str(),
                ids.iter().map(String::as_str).filter(|other| close(other, id)),
            );
            self.problems.add(
                Diagnostic::new(
                    "unknown-requirement",
                    at.clone(),
                    format!("unknown requirement `{id}`"),
                    "not in the catalogue",
                )
                .hint(near),
            );
            return Vec::new();
        };
        if let Some(role) = self.role
            && !facts.roles.contains(&role)
        {
            self.problems.at(
                "other-role",
                at,
                format!("`{id}` does not oblige the {role}"),
                format!("the {role} is under test here"),
            );
        }
        let having: Vec<usize> = packs
            .iter()
            .copied()
            .filter(|pack| facts.packs.contains(pack))
            .collect();
        if having.is_empty() {
            self.problems.at(
                "requirement-not-in-version",
                at,
                format!("no version claimed here has `{id}`"),
                "would never be decided",
            );
        }
        having
    }

    /// Nothing breaks a permission: a picture that is bound to one would pass whatever comes. A named check says by itself
    /// what it remarks on.
    pub(super) fn can_be_broken(&mut self, step: &Step, packs: &[usize]) {
        let named = |selection: &Selection| selection.check.is_some();
        let mut bound: Vec<&Binding> = Vec::new();
        let mut asserted: &[Assertion] = &[];
        match &*step.verb {
            Verb::Expect(expect) => {
                asserted = &expect.assert;
                bound.extend(expect.checks.iter().filter(|_| !named(&expect.selection)));
            }
            Verb::Never(never) => bound.extend(never.checks.iter().filter(|_| !named(&never.selection))),
            Verb::Always(always) => {
                bound.extend(always.checks.iter().filter(|_| !named(&always.selection)));
                if let Extent::Until(until) = &always.extent {
                    bound.extend(until.checks.iter().filter(|_| !named(&until.selection)));
                }
            }
            Verb::Action(action) => bound.extend(&action.checks),
            Verb::Retained(retained) => {
                asserted = &retained.assert;
                bound.extend(retained.checks.iter().filter(|_| !named(&retained.selection)));
            }
            Verb::Send(_) | Verb::Link(_) | Verb::Serve(_) | Verb::Operator(_) | Verb::Vehicle(_) => {}
        }
        for Binding { requirement, span } in bound.into_iter().filter(|_| !step.prefers) {
            self.not_permitted(requirement, span, packs);
        }
        for assertion in asserted.iter().filter(|one| !named(&one.selection)) {
            self.not_permitted(&assertion.requirement, &assertion.span, packs);
        }
    }
}

/// Whether an id of the catalogue is of the same group, so that the hint stays short.
fn close(other: &str, id: &RequirementId) -> bool {
    let group = |id: &str| id.rsplit_once('-').map(|(group, _)| group.to_owned());
    group(other) == group(id.as_str()) || strsim::levenshtein(other, id.as_str()) <= 2
}
