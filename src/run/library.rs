//! Everything that is data: packs, catalogue, suites; loaded once per process.

use std::path::Path;
use std::sync::Arc;

use crate::checks;
use crate::diagnostic::Diagnostic;
use crate::judge::Rules;
use crate::pack::{Assets, Catalogue, Packs, Role};
use crate::profile::HOOKS;
use crate::suite::model::Test;
use crate::suite::{CheckInfo, HookFacts, Suites};

/// The loaded data.
pub struct Library {
    /// The files.
    pub assets: Assets,
    /// What a run is judged by.
    pub rules: Rules,
}

/// A folder of suites, laid out like `suites/`.
#[derive(Clone, Copy, Debug)]
pub enum Own<'a> {
    /// Its files stand beside the built-in ones.
    Added(&'a Path),
    /// Its files take the place of the built-in ones.
    Alone(&'a Path),
}

impl Library {
    /// Loads the embedded files, and those of a folder.
    ///
    /// # Errors
    /// Every mistake in them.
    pub fn load(own: Option<Own<'_>>) -> Result<Self, Vec<Diagnostic>> {
        let unreadable = |folder: &Path, error: std::io::Error| {
            let title = format!("the suites in {} cannot be read: {error}", folder.display());
            if error.kind() == std::io::ErrorKind::NotFound && folder.is_dir() {
                let hint = "is everything checked out? `vda5050-tck init --suites DIR` writes a folder that is laid out right";
                return vec![Diagnostic::whole("no-suites", error.to_string()).hint(hint)];
            }
            let hint = match error.kind() {
                std::io::ErrorKind::AlreadyExists => {
                    "give the file another name, or use the folder alone, without the built-in suites, by --replace-suites"
                }
                _ => "give a folder that is laid out like `suites/` (`vda5050-tck init --suites DIR` writes one)",
            };
            vec![Diagnostic::whole("unreadable", title).hint(hint)]
        };
        let assets = match own {
            None => Assets::embedded(),
            Some(Own::Added(folder)) => Assets::with_added(folder).map_err(|error| unreadable(folder, error))?,
            Some(Own::Alone(folder)) => Assets::with_suites(folder).map_err(|error| unreadable(folder, error))?,
        };
        let packs = Packs::load(&assets).map_err(|error| vec![Diagnostic::whole("pack", error.to_string())])?;
        let catalogue = Catalogue::load(&assets)?;
        let suites = Suites::load(&assets, &packs, &catalogue, &check_infos(), &hook_facts())?;
        let sha256 = assets.sha256().to_owned();
        Ok(Self {
            assets,
            rules: Rules {
                packs: Arc::new(packs),
                catalogue: Arc::new(catalogue),
                suites: Arc::new(suites),
                sha256,
            },
        })
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
            &check_infos(),
            &hook_facts(),
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
            &check_infos(),
            &hook_facts(),
        )?;
        Ok(match (found.tests.len(), found.monitors.len()) {
            (0, 0) => "a state".to_owned(),
            (0, _) => "a monitor".to_owned(),
            (1, _) => "a test".to_owned(),
            (rows, _) => format!("a table of {rows} tests"),
        })
    }
}

fn check_infos() -> Vec<CheckInfo> {
    let all = checks::registry().iter();
    all.map(|check| CheckInfo {
        name: check.name,
        decides: check.decides,
        arguments: check.arguments,
    })
    .collect()
}

fn hook_facts() -> Vec<HookFacts> {
    HOOKS
        .iter()
        .map(|hook| HookFacts {
            name: hook.name,
            role: hook.role,
            parameters: hook.parameters,
        })
        .collect()
}
