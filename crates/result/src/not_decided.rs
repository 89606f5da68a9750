//! Why nothing decided a requirement.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Why nothing decided a requirement. In `result.json` it is one text: a word, and behind a colon what more is known.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", from = "String")]
pub enum NotDecided {
    /// The device is said to lack what it is about, with the reason of a test; empty when none is given.
    NotApplicable(String),
    /// No test can decide it, with the reason of the catalogue; empty when none is given.
    NotTestable(String),
    /// There is no test of it.
    NoTest,
    /// Monitors would have decided it, and nothing came for them.
    NothingCame,
    /// Its tests were not selected.
    NotSelected,
    /// Anything else that a result says.
    Other(String),
}

const NOT_APPLICABLE: &str = "not applicable";
const NOT_TESTABLE: &str = "not testable";
const NO_TEST: &str = "no test";
const NOTHING_CAME: &str = "nothing came that could have been judged";
const NOT_SELECTED: &str = "not selected";

impl fmt::Display for NotDecided {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (word, more) = match self {
            Self::NotApplicable(why) => (NOT_APPLICABLE, why.as_str()),
            Self::NotTestable(why) => (NOT_TESTABLE, why.as_str()),
            Self::NoTest => (NO_TEST, ""),
            Self::NothingCame => (NOTHING_CAME, ""),
            Self::NotSelected => (NOT_SELECTED, ""),
            Self::Other(text) => (text.as_str(), ""),
        };
        match more {
            "" => f.write_str(word),
            more => write!(f, "{word}: {more}"),
        }
    }
}

impl From<NotDecided> for String {
    fn from(why: NotDecided) -> Self {
        why.to_string()
    }
}

impl From<String> for NotDecided {
    fn from(text: String) -> Self {
        let (word, more) = text.split_once(": ").unwrap_or((&text, ""));
        match (word, more) {
            (NOT_APPLICABLE, why) => Self::NotApplicable(why.to_owned()),
            (NOT_TESTABLE, why) => Self::NotTestable(why.to_owned()),
            (NO_TEST, "") => Self::NoTest,
            (NOTHING_CAME, "") => Self::NothingCame,
            (NOT_SELECTED, "") => Self::NotSelected,
            _ => Self::Other(text),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let why = || "the factsheet does not list: action x".to_owned();
        for (one, text) in [
            (
                NotDecided::NotApplicable(why()),
                "not applicable: the factsheet does not list: action x",
            ),
            (NotDecided::NotApplicable(String::new()), "not applicable"),
            (NotDecided::NotTestable("a secret".to_owned()), "not testable: a secret"),
            (NotDecided::NoTest, "no test"),
            (NotDecided::NothingCame, "nothing came that could have been judged"),
            (NotDecided::NotSelected, "not selected"),
            (NotDecided::Other("no test: of old".to_owned()), "no test: of old"),
        ] {
            assert_eq!(one.to_string(), text);
            assert_eq!(NotDecided::from(text.to_owned()), one);
        }
    }
}
