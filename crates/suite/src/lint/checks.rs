//! Rules about the use of named checks.

use serde_json::Value;

use super::Linter;
use crate::CheckInfo;
use crate::model::{Binding, CheckUse, Monitor};
use tck_base::diagnostic::Diagnostic;
use tck_base::pattern::{Term, TermKind};
use tck_base::time::{self, TimeLimits};
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
                    .hint(format!(
                        "it decides {}; a monitor of a requirement of your own names one of them with `instead-of`",
                        info.decides.join(", ")
                    )),
                );
            }
        }
        for (argument, term) in &check.with {
            if TimeLimits::names().contains(&argument.as_str()) {
                self.own_limit(argument, term);
            } else if !info.arguments.contains(&argument.as_str()) {
                let names = info.arguments.iter().copied().chain(TimeLimits::names());
                self.problems
                    .unknown("unknown-argument", &term.span, "argument", argument, names);
            }
        }
        self.needs(info, check, requirements, packs);
    }

    /// A limit of one's own for a check.
    fn own_limit(&mut self, name: &str, term: &Term) {
        let is_time = match &term.kind {
            TermKind::Literal(Value::String(text)) => time::parse(text).is_ok(),
            TermKind::Literal(_) => false,
            _ => true,
        };
        if !is_time {
            let title = format!("`{name}` is a time");
            let diagnostic = Diagnostic::new("bad-value", term.span.clone(), title, "none");
            self.problems.add(diagnostic.hint("such as `5 s` or `800 ms`"));
        }
    }

    /// One requirement of somebody's own takes the place of one of the standard.
    pub(super) fn instead_of(&mut self, instead_of: &Binding, monitor: &Monitor, check: &CheckUse) {
        let decided = self.known.iter().find(|info| info.name == check.name);
        let decided = decided.map_or(&[][..], |info| info.decides);
        let has_own = |binding: &Binding| !decided.contains(&binding.requirement.as_str());
        let is_one = monitor.checks.len() == 1 && monitor.checks.iter().all(has_own);
        if !is_one {
            let title = "a monitor with `instead-of` decides one requirement of your own";
            let diagnostic = Diagnostic::new("instead-of", instead_of.span.clone(), title, "in the place of this one");
            let hint = format!(
                "name yours alone under `checks`; without `instead-of` the check decides {}",
                decided.join(", ")
            );
            self.problems.add(diagnostic.hint(hint));
        }
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
