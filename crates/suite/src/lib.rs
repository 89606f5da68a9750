//! YAML into typed tests, with a source span on everything, linted against the packs.
//!
//! [`model`] is what the rest of the program sees. [`Suites::load`] makes it from the files: tables of cases and
//! states are filled in on the tree, the tree is read into the model, and `lint` looks up every path, literal,
//! requirement, variable, state and check name. Running a test is left to the engine, judging it to the judge.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod conversation;
mod course;
mod exceptions;
mod expand;
mod fields;
mod grammar;
mod lint;
mod load;
mod matrix;
mod metadata;
pub mod model;
mod read;
mod read_monitor;
mod recordings;
mod schema_cases;
mod source;
mod spelling;
mod steps;
mod stimuli;
mod terms;
#[cfg(test)]
mod tests;
mod visit;

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

pub use exceptions::{Exceptions, Unfound, Unproven};
pub use lint::{PackVocabulary, RequirementFacts, Variable, Vocabulary, harness_topics, variables};
pub use spelling::spelled;

use model::{Monitor, Test};
use tck_base::diagnostic::Diagnostic;
use tck_pack::{Assets, Catalogue, Hooks, Packs};
use tck_view::Field;

/// What the linter has to know of a named check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CheckInfo {
    /// Name, such as `order/remaining-route`.
    pub name: &'static str,
    /// Requirements it can decide.
    pub decides: &'static [&'static str],
    /// Names of arguments it takes.
    pub arguments: &'static [&'static str],
    /// Members of messages it cannot do without.
    pub needs: &'static [Field],
}

/// All tests and monitors, sorted by id.
#[derive(Clone, Debug, Default)]
pub struct Suites {
    /// The tests; every row of a table is one.
    pub tests: Vec<Arc<Test>>,
    /// The monitors.
    pub monitors: Vec<Arc<Monitor>>,
    /// What qualification cannot prove, and why.
    pub exceptions: Exceptions,
    /// The tests by requirement, once somebody has asked for them.
    deciding: OnceLock<HashMap<String, Vec<Arc<Test>>>>,
}

impl Suites {
    /// The tests with a clause that decides a requirement, by id.
    pub fn deciding(&self, requirement: &str) -> &[Arc<Test>] {
        let all = self.deciding.get_or_init(|| {
            let mut all: HashMap<String, Vec<Arc<Test>>> = HashMap::new();
            for test in &self.tests {
                for id in test.requirements() {
                    all.entry(id.to_string()).or_default().push(Arc::clone(test));
                }
            }
            all
        });
        all.get(requirement).map_or(&[], Vec::as_slice)
    }

    /// Loads every suite of `assets`. `checks` are the named checks there are, `hooks` the hooks a profile can have.
    ///
    /// # Errors
    /// Everything that is wrong with any of the files, by file and place.
    pub fn load(
        assets: &Assets,
        packs: &Packs,
        catalogue: &Catalogue,
        checks: &[CheckInfo],
        hooks: &Hooks,
    ) -> Result<Self, Vec<Diagnostic>> {
        let vocabulary = PackVocabulary::new(packs, catalogue, hooks);
        load::load(files(assets), &vocabulary, checks, &|path| assets.is_checked(path))
    }

    /// Loads tests given by path (`suites/agv/…`) and text. The states they use are those of `assets`.
    ///
    /// # Errors
    /// Everything that is wrong with them.
    pub fn load_tests<'a>(
        tests: impl Iterator<Item = (&'a str, &'a str)>,
        assets: &'a Assets,
        packs: &Packs,
        catalogue: &Catalogue,
        checks: &[CheckInfo],
        hooks: &Hooks,
    ) -> Result<Vec<Arc<Test>>, Vec<Diagnostic>> {
        let vocabulary = PackVocabulary::new(packs, catalogue, hooks);
        let states = assets.under("suites/states/");
        let states = states.map(|file| (file.path.as_str(), file.text.as_str()));
        load::load(states.chain(tests), &vocabulary, checks, &|path| {
            assets.is_checked(path)
        })
        .map(|suites| suites.tests)
    }

    /// These suites with more tests.
    ///
    /// # Errors
    /// The ids that are there already.
    pub fn with(&self, tests: &[Arc<Test>]) -> Result<Self, Vec<String>> {
        let taken = |test: &&Arc<Test>| self.tests.iter().any(|own| own.id == test.id);
        let taken: Vec<String> = tests.iter().filter(taken).map(|test| test.id.clone()).collect();
        if !taken.is_empty() {
            return Err(taken);
        }
        let mut all = [self.tests.as_slice(), tests].concat();
        all.sort_by(|left, right| left.id.cmp(&right.id));
        Ok(Self {
            tests: all,
            monitors: self.monitors.clone(),
            exceptions: self.exceptions.clone(),
            deciding: OnceLock::new(),
        })
    }

    /// Loads the text of one test, state or monitor, told apart by content, wherever it lies. The states it uses
    /// are those of `assets`.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn load_test_text(
        name: &str,
        text: &str,
        assets: &Assets,
        packs: &Packs,
        catalogue: &Catalogue,
        checks: &[CheckInfo],
        hooks: &Hooks,
    ) -> Result<Self, Vec<Diagnostic>> {
        let vocabulary = PackVocabulary::new(packs, catalogue, hooks);
        load::load_text(name, text, files(assets), &vocabulary, checks)
    }

    /// Loads files given by path (`suites/agv/…`) and text against any vocabulary.
    ///
    /// # Errors
    /// As [`Suites::load`].
    pub fn load_files<'a>(
        files: impl Iterator<Item = (&'a str, &'a str)>,
        vocabulary: &dyn Vocabulary,
        checks: &[CheckInfo],
    ) -> Result<Self, Vec<Diagnostic>> {
        load::load(files, vocabulary, checks, &|_| false)
    }
}

fn files(assets: &Assets) -> impl Iterator<Item = (&str, &str)> {
    assets
        .under("suites/")
        .map(|file| (file.path.as_str(), file.text.as_str()))
}
