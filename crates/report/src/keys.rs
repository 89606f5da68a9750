//! Under which keys a system for test management knows requirements, tests and monitors: `[keys]` of a profile, or a file.
//!
//! A test that is drawn as cases is known under the name of its table, too.

use std::collections::BTreeMap;

use super::clean;
pub use tck_profile::IssueKey as Key;
use tck_result::RunResult;

/// How the settings of a run are called that are keys.
const SETTING: &str = "keys.";

/// Keys by the id of a requirement, test or monitor.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Keys(BTreeMap<String, Key>);

/// Why keys cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KeyError {
    /// The file is not TOML, or something else than texts stands in it.
    #[error("this is not TOML of lines such as `ORD-REJ-12 = \"PROJ-12\"`: {0}")]
    Form(String),
    /// A key has the form of none that is known.
    #[error("`{key}` of `{id}` is no key: an issue of Jira (Xray) is like PROJ-12, a test case of TestRail like C1234")]
    Key {
        /// What it is the key of.
        id: String,
        /// As it stands there.
        key: String,
    },
}

impl Keys {
    /// Those that the profile of a run has.
    ///
    /// # Errors
    /// When one has the form of none that is known.
    pub fn of_run(result: &RunResult) -> Result<Self, KeyError> {
        let all = result.settings.iter().filter_map(|setting| {
            let id = setting.name.strip_prefix(SETTING)?;
            Some((id.to_owned(), setting.value.clone()))
        });
        Self::of(all)
    }

    /// Those of a file: TOML with a line for each, below `[keys]` or without it.
    ///
    /// # Errors
    /// When it is something else, or a key has the form of none that is known.
    pub fn of_file(text: &str) -> Result<Self, KeyError> {
        let form = |error: &dyn std::fmt::Display| KeyError::Form(error.to_string());
        let mut table: toml::Table = text.parse().map_err(|error: toml::de::Error| form(&error.message()))?;
        if let Some(toml::Value::Table(keys)) = table.remove("keys") {
            if !table.is_empty() {
                return Err(form(&"something stands beside `[keys]`"));
            }
            table = keys;
        }
        let all = table.into_iter().map(|(id, key)| match key {
            toml::Value::String(key) => Ok((id, key)),
            other => Err(form(&format_args!("`{id}` is a {}", other.type_str()))),
        });
        Self::of(all.collect::<Result<Vec<_>, _>>()?)
    }

    fn of(all: impl IntoIterator<Item = (String, String)>) -> Result<Self, KeyError> {
        let all = all.into_iter().map(|(id, text)| match Key::read(&text) {
            Some(key) => Ok((id, key)),
            None => Err(KeyError::Key {
                id: clean::line(&id).into_owned(),
                key: clean::line(&text).into_owned(),
            }),
        });
        Ok(Self(all.collect::<Result<_, _>>()?))
    }

    /// Those of another source, before which its own give way.
    #[must_use]
    pub fn under(mut self, upper: Self) -> Self {
        self.0.extend(upper.0);
        self
    }

    /// The key of a requirement, test or monitor. A case of a table has that of the table, unless it has one itself.
    #[must_use]
    pub fn get(&self, id: &str) -> Option<&Key> {
        let table = id.split_once('[').map(|(table, _)| table);
        self.0.get(id).or_else(|| self.0.get(table?))
    }

    /// Whether a requirement is known as a test of its own, and not as something that tests cover.
    #[must_use]
    pub fn is_test(&self, requirement: &str) -> bool {
        matches!(self.get(requirement), Some(Key::TestRail(_)))
    }

    /// The ids that nothing in a run has, so that their keys go nowhere.
    #[must_use]
    pub fn unmet(&self, result: &RunResult) -> Vec<&str> {
        let tests = result.tests.iter().map(|test| test.id.as_str());
        let tests = tests.flat_map(|id| [id, id.split('[').next().unwrap_or(id)]);
        let monitors = result.monitors.iter().map(|monitor| monitor.id.as_str());
        let requirements = result.requirements.iter().map(|requirement| requirement.id.as_str());
        let met: Vec<&str> = tests.chain(monitors).chain(requirements).collect();
        let all = self.0.keys().map(String::as_str);
        all.filter(|id| !met.contains(id)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_a_table_of_texts_and_a_case_has_the_key_of_its_table() {
        let text = "ORD-REJ-12 = \"PROJ-12\"\n\"group/name\" = \"C7\"\n\"group/name[one]\" = \"C8\"\n";
        let keys = Keys::of_file(text).expect("keys");
        assert_eq!(Keys::of_file(&format!("[keys]\n{text}")), Ok(keys.clone()));
        assert_eq!(keys.get("group/name[one]"), Some(&Key::TestRail("C8".to_owned())));
        assert_eq!(keys.get("group/name[two]"), Some(&Key::TestRail("C7".to_owned())));
        assert!(keys.get("group/other").is_none() && !keys.is_test("ORD-REJ-12"));
        let upper = Keys::of_file("ORD-REJ-12 = \"C9\"").expect("keys");
        assert!(keys.under(upper).is_test("ORD-REJ-12"));
        for wrong in ["A = 1", "A = \"b\"", "A =", "[keys]\nA = \"C1\"\n[other]\n"] {
            assert!(Keys::of_file(wrong).is_err(), "{wrong}");
        }
    }
}
