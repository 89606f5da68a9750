//! Everything that is data: packs, catalogue, suites; loaded once per process.

use std::sync::Arc;

use super::rules::Rules;
use tck_base::diagnostic::{Diagnostic, Source};
use tck_check::Check;
use tck_pack::{Assets, Catalogue, Hooks, Packs, Role};
use tck_suite::model::Test;
use tck_suite::{CheckInfo, Suites};

/// The loaded data.
#[derive(Clone)]
pub struct Library {
    /// The files.
    pub assets: Assets,
    /// What a run is judged by.
    pub rules: Rules,
}

impl Library {
    /// Reads and checks all files.
    ///
    /// # Errors
    /// Every mistake in them.
    pub fn load(assets: Assets, checks: &'static [Check]) -> Result<Self, Vec<Diagnostic>> {
        let packs = Packs::load(&assets).map_err(|error| vec![Diagnostic::whole("pack", error.to_string())])?;
        let catalogue = Catalogue::load(&assets)?;
        let hooks = Hooks::load(&assets)?;
        let suites = Suites::load(&assets, &packs, &catalogue, &check_infos(checks), &hooks)?;
        let sha256 = assets.sha256().to_owned();
        Ok(Self {
            assets,
            rules: Rules {
                checks,
                packs: Arc::new(packs),
                catalogue: Arc::new(catalogue),
                hooks: Arc::new(hooks),
                suites: Arc::new(suites),
                sha256,
            },
        })
    }

    /// The path of a file of the suites, as whoever has given it wrote it.
    #[must_use]
    pub fn file_of(&self, source: &Source) -> String {
        self.assets
            .as_given(&source.name)
            .unwrap_or_else(|| source.name.clone())
    }

    /// How many suites of somebody's own there are, such as `own suites: 3 tests, 1 monitor`; nothing without any.
    #[must_use]
    pub fn own(&self) -> Option<String> {
        let own = self.assets.own();
        if own.is_empty() {
            return None;
        }
        let tests = self.rules.suites.tests.iter();
        let tests = tests.filter(|test| own.contains(&test.source.name)).count();
        let files = |folder: &str| own.iter().filter(|path| path.starts_with(folder)).count();
        let all = [
            (tests, "test"),
            (files("suites/monitors/"), "monitor"),
            (files("suites/explore/"), "file of stimuli"),
            (files("suites/requirements/"), "file of requirements"),
            (files("suites/hooks/"), "file of hooks"),
        ];
        let all = all.into_iter().filter(|(count, _)| *count > 0);
        let all = all.map(|(count, what)| match (count, what.split_once(' ')) {
            (1, _) => format!("1 {what}"),
            (_, None) => format!("{count} {what}s"),
            (_, Some((first, rest))) => format!("{count} {first}s {rest}"),
        });
        Some(format!("own suites: {}", all.collect::<Vec<String>>().join(", ")))
    }

    /// The tests of a role for a protocol version that decide at least one requirement of it, by id.
    pub fn tests(&self, role: Role, protocol: &str) -> Vec<Arc<Test>> {
        let Some(pack) = self.rules.packs.get(protocol) else {
            return Vec::new();
        };
        let decides = |test: &Test| {
            test.requirements().iter().any(|id| {
                let requirement = self.rules.catalogue.get(id.as_str());
                requirement.is_some_and(|requirement| requirement.in_version(pack).is_some())
            })
        };
        let tests = self.rules.suites.tests.iter();
        tests
            .filter(|test| test.device == role && test.spec.contains(pack.version) && decides(test))
            .cloned()
            .collect()
    }

    /// Adds tests, given by path (`suites/agv/…`) and text, and gives them back in the order of their ids.
    ///
    /// # Errors
    /// Every mistake in them, and ids that are there already.
    pub fn add(&mut self, files: &[(String, String)]) -> Result<Vec<Arc<Test>>, Vec<Diagnostic>> {
        let rules = &self.rules;
        let tests = Suites::load_tests(
            files.iter().map(|(path, text)| (path.as_str(), text.as_str())),
            &self.assets,
            &rules.packs,
            &rules.catalogue,
            &check_infos(rules.checks),
            &rules.hooks,
        )?;
        let suites = rules.suites.with(&tests).map_err(|taken| {
            let complaint = |id: String| {
                Diagnostic::whole("duplicate-test", format!("there is a test `{id}` already"))
                    .hint("give one of the two another name; in reports it is all they are known by")
            };
            taken.into_iter().map(complaint).collect::<Vec<_>>()
        })?;
        self.rules.suites = Arc::new(suites);
        Ok(tests)
    }

    /// Checks the text of one test, state or monitor, and says what it is.
    ///
    /// # Errors
    /// Every mistake in it.
    pub fn check_suite(&self, name: &str, text: &str) -> Result<String, Vec<Diagnostic>> {
        let rules = &self.rules;
        let found = Suites::load_test_text(
            name,
            text,
            &self.assets,
            &rules.packs,
            &rules.catalogue,
            &check_infos(rules.checks),
            &rules.hooks,
        )?;
        Ok(match (found.tests.len(), found.monitors.len()) {
            (0, 0) => "a state".to_owned(),
            (0, _) => "a monitor".to_owned(),
            (1, _) => "a test".to_owned(),
            (rows, _) => format!("a table of {rows} tests"),
        })
    }
}

fn check_infos(checks: &[Check]) -> Vec<CheckInfo> {
    checks
        .iter()
        .map(|check| CheckInfo {
            name: check.name,
            decides: check.decides,
            arguments: check.arguments,
            needs: check.needs,
        })
        .collect()
}
