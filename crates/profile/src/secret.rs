//! What nobody may read: where it comes from, and the one place that keeps it out of journals, reports and logs.

use std::path::{Path, PathBuf};

use super::key::PASSWORD_VARIABLE;
use super::surroundings::Surroundings;
use tck_base::secrets::Password;

/// Where a password is found; the password itself is never part of a profile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PasswordSource {
    /// In [`PASSWORD_VARIABLE`], if that is set.
    Usual,
    /// In this environment variable, which has to be set.
    Environment(String),
    /// In this file, which holds nothing else.
    File(PathBuf),
}

/// Why a password could not be had.
#[derive(Debug, thiserror::Error)]
pub enum PasswordError {
    /// `password-env` names a variable that is not set.
    #[error("the environment variable {0} that should hold the password is not set")]
    NotSet(String),
    /// `password-file` cannot be read.
    #[error("the password file {file} cannot be read: {reason}")]
    Unreadable {
        /// The file.
        file: String,
        /// What the system said.
        reason: std::io::Error,
    },
}

impl PasswordSource {
    /// The password, if there is one.
    ///
    /// # Errors
    /// When the profile says where it is and it is not there.
    pub fn password(&self, surroundings: &Surroundings) -> Result<Option<Password>, PasswordError> {
        let variable = |name: &str| surroundings.environment.get(name).map(|text| Password::new(text));
        match self {
            Self::Usual => Ok(variable(PASSWORD_VARIABLE)),
            Self::Environment(name) => match variable(name) {
                Some(password) => Ok(Some(password)),
                None => Err(PasswordError::NotSet(name.clone())),
            },
            Self::File(file) => match std::fs::read_to_string(file) {
                Ok(text) => Ok(Some(Password::new(text.trim_end_matches(['\r', '\n'])))),
                Err(reason) => Err(PasswordError::Unreadable {
                    file: file.display().to_string(),
                    reason,
                }),
            },
        }
    }
}

/// A text that may hold secrets: parts as they are, and parts from somewhere else.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SecretText(Vec<Part>);

#[derive(Clone, Debug, PartialEq, Eq)]
enum Part {
    Text(String),
    From(PasswordSource),
    Known(Password),
}

impl SecretText {
    /// Reads `${env:NAME}` and `${file:PATH}` in a text; a path is relative to `folder`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(super) fn read(text: &str, folder: &Path) -> Result<Self, String> {
        let mut parts = Vec::new();
        let mut rest = text;
        while let Some((before, behind)) = rest.split_once("${") {
            let (inside, after) = behind.split_once('}').ok_or_else(|| "`${` without `}`".to_owned())?;
            if !before.is_empty() {
                parts.push(Part::Text(before.to_owned()));
            }
            parts.push(Part::From(match inside.split_once(':') {
                Some(("env", name)) if !name.is_empty() => PasswordSource::Environment(name.to_owned()),
                Some(("file", path)) if !path.is_empty() => PasswordSource::File(folder.join(path)),
                _ => return Err(format!("`${{{inside}}}` is neither ${{env:NAME}} nor ${{file:PATH}}")),
            }));
            rest = after;
        }
        if !rest.is_empty() {
            parts.push(Part::Text(rest.to_owned()));
        }
        Ok(Self(parts))
    }

    /// With every part that comes from somewhere else.
    ///
    /// # Errors
    /// When one is not there.
    pub fn resolved(&self, surroundings: &Surroundings) -> Result<Self, PasswordError> {
        let parts = self.0.iter().map(|part| match part {
            Part::From(source) => Ok(match source.password(surroundings)? {
                Some(secret) => Part::Known(secret),
                None => Part::Text(String::new()),
            }),
            other => Ok(other.clone()),
        });
        Ok(Self(parts.collect::<Result<_, PasswordError>>()?))
    }

    /// The secrets in it, once resolved.
    pub fn secrets(&self) -> impl Iterator<Item = Password> + '_ {
        self.0.iter().filter_map(|part| match part {
            Part::Known(secret) => Some(secret.clone()),
            _ => None,
        })
    }

    /// The parts that are no secrets.
    pub(super) fn texts(&self) -> impl Iterator<Item = &str> {
        self.0.iter().filter_map(|part| match part {
            Part::Text(text) => Some(text.as_str()),
            _ => None,
        })
    }

    /// Writes its texts otherwise; secrets stay as they are.
    #[must_use]
    pub(super) fn with_texts(&self, write: impl Fn(&str) -> String) -> Self {
        let parts = self.0.iter().map(|part| match part {
            Part::Text(text) => Part::Text(write(text)),
            other => other.clone(),
        });
        Self(parts.collect())
    }

    /// The whole text with its secrets, for the request and nothing else.
    #[must_use]
    pub fn reveal(&self) -> String {
        let parts = self.0.iter().map(|part| match part {
            Part::Text(text) => text.as_str(),
            Part::Known(secret) => secret.reveal(),
            Part::From(_) => "",
        });
        parts.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_takes_its_secrets_from_environment_and_file() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("key"), "from-a-file\n").unwrap();
        let text = SecretText::read("Bearer ${env:TOKEN}/${file:key} {vehicle}", folder.path()).unwrap();
        let mut surroundings = Surroundings::default();
        assert!(matches!(text.resolved(&surroundings), Err(PasswordError::NotSet(name)) if name == "TOKEN"));
        surroundings
            .environment
            .insert("TOKEN".to_owned(), "{vehicle}".to_owned());
        let text = text.resolved(&surroundings).unwrap();
        // What a secret holds is no placeholder.
        let filled = text.with_texts(|text| text.replace("{vehicle}", "mock-1"));
        assert_eq!(filled.reveal(), "Bearer {vehicle}/from-a-file mock-1");
        assert_eq!(text.secrets().count(), 2);
        assert!(!format!("{text:?}").contains("from-a-file"));
    }

    #[test]
    fn what_is_no_reference_is_refused() {
        for wrong in ["${TOKEN}", "${env:}", "${env:X", "${password:x}"] {
            assert!(SecretText::read(wrong, Path::new("")).is_err(), "{wrong}");
        }
    }
}
