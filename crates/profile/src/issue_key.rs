//! `[keys]`: under which keys a system for test management knows requirements, tests and monitors.

/// A key, by whose it is, which its form says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum IssueKey {
    /// An issue of Jira, such as `PROJ-12`: a test of Xray, or what a test covers.
    Jira(String),
    /// A test case of `TestRail`, such as `C1234`.
    TestRail(String),
}

impl IssueKey {
    /// Reads a key; `None` when it has the form of neither.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        let number = |digits: &str| !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
        if text.strip_prefix('C').is_some_and(number) {
            return Some(Self::TestRail(text.to_owned()));
        }
        let (project, issue) = text.rsplit_once('-')?;
        let is_project = project.starts_with(|first: char| first.is_ascii_uppercase())
            && project
                .bytes()
                .all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit() || byte == b'_');
        (is_project && number(issue)).then(|| Self::Jira(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_form_of_a_key_says_whose_it_is() {
        assert_eq!(IssueKey::read("PROJ-12"), Some(IssueKey::Jira("PROJ-12".to_owned())));
        assert_eq!(IssueKey::read("A_1-7"), Some(IssueKey::Jira("A_1-7".to_owned())));
        assert_eq!(IssueKey::read("C1234"), Some(IssueKey::TestRail("C1234".to_owned())));
        for wrong in [
            "", "C", "c12", "12", "proj-12", "PROJ-", "PROJ-1a", "-12", "1A-2", "PROJ 12",
        ] {
            assert_eq!(IssueKey::read(wrong), None, "{wrong}");
        }
    }
}
