//! Rules about the use of named checks.

use super::Linter;
use crate::CheckInfo;
use crate::model::CheckUse;
use tck_base::diagnostic::Diagnostic;
use tck_pack::RequirementId;

impl Linter<'_> {
    pub(super) fn check_use(&mut self, check: &CheckUse, requirements: &[&RequirementId], packs: &[usize]) {
        let known = self.known;
        let Some(info) = known.iter().find(|info| info.name == check.name) else {
            let names: Vec<&str> = known.iter().map(|info| info.name).collect();
            self.problems
                .unknown("unknown-check", &check.span, "check", &check.name, names);
            return;
        };
        for id in requirements {
            if !info.decides.contains(&id.as_str()) {
                self.problems.add(
                    Diagnostic::new(
                        "check-decides-other",
                        check.span.clone(),
                        format!("the check `{}` does not decide `{id}`", info.name),
                        "about something else",
                    )
                    .hint(format!("it decides {}", info.decides.join(", "))),
                );
            }
        }
        for (argument, term) in &check.with {
            if !info.arguments.contains(&argument.as_str()) {
                let names = info.arguments.iter().copied();
                self.problems
                    .unknown("unknown-argument", &term.span, "argument", argument, names);
            }
        }
        self.needs(info, check, requirements, packs);
    }

    /// A check finds nothing where messages do not have what it looks at, and would pass whatever a device does.
    fn needs(&mut self, info: &CheckInfo, check: &CheckUse, requirements: &[&RequirementId], packs: &[usize]) {
        let vocabulary = self.vocabulary;
        let facts: Vec<_> = requirements
            .iter()
            .filter_map(|id| vocabulary.requirement(id.as_str()))
            .collect();
        let decides = |pack: usize| facts.is_empty() || facts.iter().any(|facts| facts.packs.contains(&pack));
        let versions = vocabulary.versions();
        for pack in packs.iter().copied().filter(|pack| decides(*pack)) {
            let member = info.needs.iter().find(|member| vocabulary.lacks(pack, **member));
            let (Some(member), Some(version)) = (member, versions.get(pack)) else {
                continue;
            };
            self.problems.add(
                Diagnostic::new(
                    "check-without-member",
                    check.span.clone(),
                    format!("the check `{}` has nothing to look at in {version}", info.name),
                    format!("it needs `{member}`, which messages of {version} do not have"),
                )
                .hint("let `spec` leave that version out"),
            );
            return;
        }
    }
}
