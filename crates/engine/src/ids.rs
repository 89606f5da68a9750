//! What the ids of the harness look like.
//!
//! They are readable, so that a person finds the test in a capture, unless the factsheet of the vehicle wants them short
//! or of digits: FACT-12 binds the harness, too, while it plays the master control.

use std::fmt::Write as _;

use sha2::{Digest as _, Sha256};

use tck_view::StringLimits;

/// A vehicle that takes ids of this length takes the readable ones.
const READABLE: u64 = 64;
/// Digits of an id: six for the run, four for the test, two for the name.
const DIGITS: usize = 12;

/// An actionId in the form of a UUID, the same for the same run and number.
pub(super) fn uuid_of_action(run: &str, number: u64) -> String {
    let digest = Sha256::digest(format!("{run}/{number}"));
    let digits = digest.iter().take(16).fold(String::new(), |mut digits, byte| {
        // Writing to a text does not fail.
        let _ = write!(digits, "{byte:02x}");
        digits
    });
    let part = |from: usize, to: usize| digits.get(from..to).unwrap_or_default();
    // The digits that say which kind of UUID it is stand at their places.
    format!(
        "{}-{}-4{}-8{}-{}",
        part(0, 8),
        part(8, 12),
        part(13, 16),
        part(17, 20),
        part(20, 32)
    )
}

/// How ids are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IdForm {
    /// Run, number and name.
    #[default]
    Readable,
    /// Digits, and how many at most.
    Digits(usize),
}

impl IdForm {
    /// What the limits of a factsheet ask for.
    #[must_use]
    pub fn of(lengths: Option<&StringLimits>) -> Self {
        let longest = lengths.and_then(|lengths| lengths.id_len.whole());
        let longest = longest.filter(|longest| *longest > 0);
        let numerical = lengths.is_some_and(|lengths| lengths.id_numerical_only.is(true));
        match longest.filter(|longest| *longest < READABLE) {
            Some(longest) => Self::Digits(usize::try_from(longest).unwrap_or(DIGITS).min(DIGITS)),
            None if numerical => Self::Digits(DIGITS),
            None => Self::Readable,
        }
    }

    /// The id behind `${run.NAME}` in the test of this number; `place` tells the names of a test apart.
    #[must_use]
    pub fn of_name(self, run: &str, number: usize, name: &str, place: usize) -> String {
        match self {
            Self::Readable => format!("{run}-{number}-{name}"),
            Self::Digits(length) => last(
                &format!("{:06}{:04}{:02}", digits(run), number % 10_000, place % 100),
                length,
            ),
        }
    }

    /// The actionId of this number.
    #[must_use]
    pub fn of_action(self, run: &str, number: u64) -> String {
        match self {
            Self::Readable => format!("{run}-action-{number}"),
            Self::Digits(length) => last(&format!("{:06}{:06}", digits(run), number % 1_000_000), length),
        }
    }
}

/// Six digits that stand for a run; the first one is no zero.
fn digits(run: &str) -> u32 {
    let sum = run.bytes().fold(2_166_136_261_u32, |sum, byte| {
        (sum ^ u32::from(byte)).wrapping_mul(16_777_619)
    });
    100_000 + sum % 900_000
}

/// What tells ids apart stands at their ends.
fn last(id: &str, length: usize) -> String {
    id.get(id.len().saturating_sub(length)..).unwrap_or(id).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};
    use tck_view::{MessageView, Names, Topic};

    fn of(lengths: &Value) -> IdForm {
        let sheet = json!({ "protocolLimits": { "maxStringLens": lengths } });
        let view = MessageView::of_value(Topic::Factsheet, &sheet, &Names::default());
        IdForm::of(view.factsheet().unwrap().string_limits())
    }

    #[test]
    fn ids_are_readable_unless_the_factsheet_wants_them_otherwise() {
        assert_eq!(IdForm::of(None), IdForm::Readable);
        for lengths in [json!({}), json!({ "idLen": 0 }), json!({ "idLen": 64 })] {
            assert_eq!(of(&lengths), IdForm::Readable);
        }
        assert_eq!(IdForm::Readable.of_name("seed3", 7, "order", 0), "seed3-7-order");
        assert_eq!(IdForm::Readable.of_action("seed3", 9), "seed3-action-9");
    }

    #[test]
    fn ids_in_the_form_of_a_uuid_are_the_same_again_and_differ() {
        let first = uuid_of_action("seed3", 9);
        let lengths: Vec<usize> = first.split('-').map(str::len).collect();
        assert_eq!(lengths, [8, 4, 4, 4, 12]);
        assert!(
            first.bytes().all(|byte| byte == b'-' || byte.is_ascii_hexdigit()),
            "{first}"
        );
        assert_eq!(&first[14..15], "4");
        assert_eq!(first, uuid_of_action("seed3", 9));
        assert_ne!(first, uuid_of_action("seed3", 10));
        assert_ne!(first, uuid_of_action("seed4", 9));
    }

    #[test]
    fn short_ids_and_ids_of_digits_differ_from_each_other() {
        let forms = [
            json!({ "idLen": 36 }),
            json!({ "idNumericalOnly": true }),
            json!({ "idLen": 8, "idNumericalOnly": true }),
            json!({ "idLen": 8.0 }),
        ];
        for (lengths, length) in forms.iter().zip([12, 12, 8, 8]) {
            let form = of(lengths);
            let ids = [
                form.of_name("seed3", 7, "order", 0),
                form.of_name("seed3", 7, "next", 1),
                form.of_name("seed3", 8, "order", 0),
                form.of_action("seed3", 9),
            ];
            for (place, id) in ids.iter().enumerate() {
                assert_eq!(id.len(), length, "{id}");
                assert!(id.bytes().all(|byte| byte.is_ascii_digit()), "{id}");
                assert!(!ids[..place].contains(id), "{id}");
            }
        }
    }
}
