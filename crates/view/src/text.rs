//! Texts of a message.

use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

use crate::CHARACTERS;

/// A text of a message, cut to [`CHARACTERS`] characters. A clone shares the characters.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Text {
    characters: Arc<str>,
    cut: bool,
}

impl Text {
    /// A text, cut where it is too long.
    #[must_use]
    pub fn new(text: &str) -> Self {
        // As many bytes as characters at most, so most texts are not counted.
        let end = if text.len() <= CHARACTERS {
            None
        } else {
            text.char_indices().nth(CHARACTERS).map(|(at, _)| at)
        };
        Self {
            characters: end.map_or(text, |end| &text[..end]).into(),
            cut: end.is_some(),
        }
    }

    /// The characters.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.characters
    }

    /// Whether the text of the message goes on behind what is kept.
    #[must_use]
    pub const fn is_cut(&self) -> bool {
        self.cut
    }
}

impl Deref for Text {
    type Target = str;

    fn deref(&self) -> &str {
        &self.characters
    }
}

impl AsRef<str> for Text {
    fn as_ref(&self) -> &str {
        &self.characters
    }
}

impl From<&str> for Text {
    fn from(text: &str) -> Self {
        Self::new(text)
    }
}

impl PartialEq<str> for Text {
    fn eq(&self, other: &str) -> bool {
        *self.characters == *other
    }
}

impl PartialEq<&str> for Text {
    fn eq(&self, other: &&str) -> bool {
        *self.characters == **other
    }
}

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.characters)
    }
}
