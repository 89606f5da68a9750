//! Errors and information.

use crate::{List, Text};

view! {
    /// An error.
    ErrorView as "error" {
        /// What is wrong.
        error_type: Text = "errorType",
        /// How bad it is.
        error_level: Text = "errorLevel",
        /// What it is about.
        error_references: List<Reference> = "errorReferences",
        /// For people.
        error_description: Text = "errorDescription" apart,
        /// What to do about it.
        error_hint: Text = "errorHint" apart,
        /// Descriptions in other languages.
        error_description_translations: List<Translation> = later "errorDescriptionTranslations" apart,
        /// Hints in other languages.
        error_hint_translations: List<Translation> = later "errorHintTranslations" apart,
    }
}

view! {
    /// A message for people or for a log.
    Information as "information" {
        /// What it is.
        info_type: Text = "infoType",
        /// `INFO` or `DEBUG`.
        info_level: Text = "infoLevel",
        /// What it is about.
        info_references: List<Reference> = "infoReferences",
        /// For people.
        info_description: Text = "infoDescription" apart,
    }
}

view! {
    /// What an error or an information is about.
    Reference as "reference" {
        /// The kind of thing: `orderId`, `actionId`, a topic.
        key: Text = "referenceKey",
        /// Which one.
        value: Text = "referenceValue",
    }
}

view! {
    /// A text in another language.
    Translation as "translation" {
        /// Code of the language.
        key: Text = "translationKey",
        /// The text.
        value: Text = "translationValue",
    }
}

impl ErrorView {
    /// The value of the first reference with this key.
    #[must_use]
    pub fn reference(&self, key: &str) -> Option<&str> {
        let found = self.error_references.iter().find(|reference| reference.key.is(key))?;
        found.value.text()
    }

    /// Whether a reference with this key has this value.
    #[must_use]
    pub fn refers_to(&self, key: &str, value: &str) -> bool {
        let fits = |reference: &Reference| reference.key.is(key) && reference.value.is(value);
        self.error_references.iter().any(fits)
    }
}
