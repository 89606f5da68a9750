//! A word that an address holds, so that only whoever was told it is served.

/// A word of the system's random source that nobody can guess.
#[derive(Clone)]
pub struct Secret(String);

impl Secret {
    /// Draws a new one: 122 random bits.
    #[must_use]
    pub fn draw() -> Self {
        Self(uuid::Uuid::new_v4().simple().to_string())
    }

    /// The word itself, for the address that somebody is told.
    #[must_use]
    pub fn word(&self) -> &str {
        &self.0
    }

    /// Whether somebody has said it; how long that takes does not tell where the words differ.
    #[must_use]
    pub fn is(&self, said: &str) -> bool {
        let pairs = self.0.bytes().zip(said.bytes());
        let differing = pairs.fold(0, |all, (one, other)| std::hint::black_box(all | (one ^ other)));
        self.0.len() == said.len() && differing == 0
    }
}

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_whole_word_is_it() {
        let secret = Secret::draw();
        let word = secret.word().to_owned();
        assert!(secret.is(&word) && word.len() == 32);
        assert!(!secret.is("") && !secret.is(&word[1..]) && !secret.is(&format!("{word}0")));
        assert!(!secret.is(Secret::draw().word()));
        assert!(!format!("{secret:?}").contains(&word));
    }
}
