//! What nobody may read, and the one place that keeps it out of journals, reports and logs.

use std::sync::Arc;

/// What stands in the place of a secret.
const HIDDEN: &str = "…";
/// A shorter text is no secret worth the name, and would be found everywhere.
const SHORTEST: usize = 4;

/// A password. It has no `Debug` or `Display` that shows it.
#[derive(Clone, PartialEq, Eq)]
pub struct Password(String);

impl Password {
    /// The password, for the CONNECT packet and nothing else.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// This text as a password.
    #[must_use]
    pub fn new(text: &str) -> Self {
        Self(text.to_owned())
    }
}

impl std::fmt::Debug for Password {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Password(…)")
    }
}

/// All that a run knows and does not tell.
#[derive(Clone, Default)]
pub struct Secrets(Arc<Vec<String>>);

impl std::fmt::Debug for Secrets {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Secrets({})", self.0.len())
    }
}

impl FromIterator<Password> for Secrets {
    fn from_iter<T: IntoIterator<Item = Password>>(all: T) -> Self {
        let mut all: Vec<String> = all
            .into_iter()
            .map(|secret| secret.reveal().to_owned())
            .filter(|secret| secret.len() >= SHORTEST)
            .collect();
        // A secret may be part of another one.
        all.sort_by_key(|secret| std::cmp::Reverse(secret.len()));
        Self(Arc::new(all))
    }
}

impl Secrets {
    /// The text without secrets, and without what belongs to no reader in the addresses in it: user, password and query.
    #[must_use]
    pub fn out_of(&self, text: &str) -> String {
        let mut text = text.to_owned();
        for secret in self.0.iter() {
            if text.contains(secret.as_str()) {
                text = text.replace(secret.as_str(), HIDDEN);
            }
        }
        text.split_inclusive(char::is_whitespace).map(address).collect()
    }
}

/// A word; as an address without user, password, query and fragment.
fn address(word: &str) -> String {
    let Some((scheme, rest)) = word.split_once("://") else {
        return word.to_owned();
    };
    let host_ends = rest.find(['/', '?', '#']).unwrap_or(rest.len());
    let (host, path) = rest.split_at(host_ends);
    let (user, host) = match host.rsplit_once('@') {
        Some((_, host)) => ("…@", host),
        None => ("", host),
    };
    // Several addresses may stand in one word.
    let rest = format!("{host}{path}");
    let query_begins = rest.find(['?', '#']).unwrap_or(rest.len());
    if rest[..query_begins].contains("://") {
        return format!("{scheme}://{user}{}", address(&rest));
    }
    let path = match path.find(['?', '#']) {
        Some(query) => format!("{}?{HIDDEN}{}", &path[..query], trailing(path)),
        None => path.to_owned(),
    };
    format!("{scheme}://{user}{host}{path}")
}

/// What stands behind an address and belongs to the sentence: punctuation, and the space before the next word.
fn trailing(path: &str) -> &str {
    let belongs = |letter: char| letter.is_whitespace() || ":,;)]}>`'\"".contains(letter);
    &path[path.trim_end_matches(belongs).len()..]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn secrets(all: &[&str]) -> Secrets {
        all.iter().map(|text| Password((*text).to_owned())).collect()
    }

    #[test]
    fn no_kind_of_secret_is_left_in_a_text() {
        let secrets = secrets(&["hunter2", "hunter2-and-more", "abc"]);
        for (text, shown) in [
            ("Bearer hunter2-and-more", "Bearer …"),
            ("hunter2hunter2", "……"),
            ("too short: abc", "too short: abc"),
            (
                "wss://me:secret@host:8084/mqtt?token=SECRET",
                "wss://…@host:8084/mqtt?…",
            ),
            ("POST https://host/a?token=SECRET: 204", "POST https://host/a?…: 204"),
            ("--broker=wss://host/mqtt?x=SECRET", "--broker=wss://host/mqtt?…"),
            ("http://host/a#SECRET", "http://host/a?…"),
            ("mqtt://a:SECRET@h1,mqtt://b:SECRET@h2", "mqtt://…@h1,mqtt://…@h2"),
            ("ws://h1/x|wss://b:SECRET@h2/y?z=SECRET", "ws://h1/x|wss://…@h2/y?…"),
            ("https://host?key=SECRET", "https://host?…"),
            ("\"ws://host/mqtt?x=SECRET\",\nnext", "\"ws://host/mqtt?…\",\nnext"),
            ("mqtt://host:1883 and no address", "mqtt://host:1883 and no address"),
        ] {
            assert_eq!(secrets.out_of(text), shown, "{text}");
        }
        assert!(!format!("{secrets:?}").contains("hunter2"));
    }
}
