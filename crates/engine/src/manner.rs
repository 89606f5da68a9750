//! How the harness words its messages as a master control where the standard leaves that open: as a known product does.
//!
//! What a message asks for stays the same, and the standard permits each manner. So a vehicle that is misled by one is
//! at fault, and not the harness.

use serde_json::Value;

/// A way to word orders and instant actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Manner {
    /// JSON in many lines, indented.
    PrettyPrinted,
    /// Instant actions have the blocking type NONE where a vehicle does not want another one.
    InstantsBlockNothing,
    /// An instant action without parameters has no list of them.
    EmptyParametersLeftOut,
    /// actionIds look like UUIDs where a vehicle takes such long ones.
    UuidActionIds,
}

impl Manner {
    /// Every manner there is.
    pub const ALL: [Self; 4] = [
        Self::PrettyPrinted,
        Self::InstantsBlockNothing,
        Self::EmptyParametersLeftOut,
        Self::UuidActionIds,
    ];

    /// The word used in files and outputs.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::PrettyPrinted => "pretty-printed",
            Self::InstantsBlockNothing => "instants-block-nothing",
            Self::EmptyParametersLeftOut => "empty-parameters-left-out",
            Self::UuidActionIds => "uuid-action-ids",
        }
    }
}

/// The manners of a run; none is the harness as it is.
#[derive(Clone, Debug, Default)]
pub struct Manners(Vec<Manner>);

impl Manners {
    /// Manners that are taken together.
    #[must_use]
    pub fn new(all: impl IntoIterator<Item = Manner>) -> Self {
        Self(all.into_iter().collect())
    }

    /// Whether this is one of them.
    #[must_use]
    pub fn has(&self, manner: Manner) -> bool {
        self.0.contains(&manner)
    }

    /// How instant actions block.
    #[must_use]
    pub fn blocking(&self) -> &'static str {
        if self.has(Manner::InstantsBlockNothing) {
            "NONE"
        } else {
            "HARD"
        }
    }

    /// The text of a message for a vehicle that takes messages of so many bytes; of any length where none is known.
    #[must_use]
    pub fn text(&self, message: &Value, longest: Option<u64>) -> Vec<u8> {
        let fits = |text: &String| longest.is_none_or(|longest| text.len() as u64 <= longest);
        let pretty = self.has(Manner::PrettyPrinted).then(|| format!("{message:#}"));
        let text = pretty.filter(fits).unwrap_or_else(|| message.to_string());
        text.into_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_message_says_the_same_in_every_manner() {
        let message = json!({ "headerId": 1, "nodes": [{ "x": 1.0, "y": -2.5e-7 }], "empty": [] });
        let plain = Manners::default().text(&message, None);
        let manners = Manners::new([Manner::PrettyPrinted]);
        let pretty = manners.text(&message, Some(200));
        assert_eq!(manners.text(&message, Some(80)), plain, "it has to fit");
        assert!(pretty.len() > plain.len() && pretty.contains(&b'\n') && !plain.contains(&b'\n'));
        for text in [plain, pretty] {
            assert_eq!(serde_json::from_slice::<Value>(&text).ok(), Some(message.clone()));
        }
    }

    #[test]
    fn every_manner_has_a_word_of_its_own() {
        for (at, manner) in Manner::ALL.iter().enumerate() {
            assert!(Manner::ALL[..at].iter().all(|other| other.word() != manner.word()));
        }
        assert_eq!(Manners::default().blocking(), "HARD");
        assert_eq!(Manners::new([Manner::InstantsBlockNothing]).blocking(), "NONE");
    }
}
