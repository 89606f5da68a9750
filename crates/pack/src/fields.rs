//! Which requirement a wrong field breaks: `fields` of `protocol.toml`.

use serde::Deserialize;

use super::schema::FindingKind;

/// One line of the table.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "(String, String, String)")]
pub(super) struct FieldRule {
    path: Vec<String>,
    about: About,
    requirement: Option<String>,
}

/// Which mistakes a line is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum About {
    Any,
    /// All but a missing field.
    Present,
    Only(FindingKind),
}

impl TryFrom<(String, String, String)> for FieldRule {
    type Error = String;

    fn try_from((path, about, requirement): (String, String, String)) -> Result<Self, String> {
        let about = match about.as_str() {
            "any" => About::Any,
            "present" => About::Present,
            "missing" => About::Only(FindingKind::Missing),
            "enumeration" => About::Only(FindingKind::Enumeration),
            "range" => About::Only(FindingKind::Range),
            other => return Err(format!("`{other}` is no kind of mistake")),
        };
        Ok(Self {
            path: path.split('/').map(str::to_owned).collect(),
            about,
            requirement: Some(requirement).filter(|requirement| !requirement.is_empty()),
        })
    }
}

impl FieldRule {
    /// The parts of its path that are names, without the topic.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        let names = self.path.iter().skip(1).map(String::as_str);
        names.filter(|part| !matches!(*part, "*" | "**"))
    }

    /// The requirement, if it names one.
    pub(super) fn requirement(&self) -> Option<&str> {
        self.requirement.as_deref()
    }

    fn fits(&self, topic: &str, path: &[&str], kind: FindingKind) -> bool {
        let is_meant = match self.about {
            About::Any => true,
            About::Present => kind != FindingKind::Missing,
            About::Only(meant) => kind == meant,
        };
        let Some((first, rest)) = self.path.split_first() else {
            return false;
        };
        is_meant && (first == "*" || first == topic) && matches(rest, path)
    }
}

/// The line that counts for a field.
pub(super) fn requirement<'r>(
    rules: &'r [FieldRule],
    topic: &str,
    path: &[&str],
    kind: FindingKind,
) -> Option<&'r str> {
    if path.is_empty() {
        return None;
    }
    let found = rules.iter().find(|rule| rule.fits(topic, path, kind));
    found.and_then(FieldRule::requirement)
}

fn matches(pattern: &[String], path: &[&str]) -> bool {
    let Some((first, rest)) = pattern.split_first() else {
        return path.is_empty();
    };
    if first == "**" {
        return (0..=path.len()).any(|skipped| matches(rest, &path[skipped..]));
    }
    path.split_first()
        .is_some_and(|(name, behind)| (first == "*" || first == name) && matches(rest, behind))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(path: &str, about: &str, requirement: &str) -> FieldRule {
        (path.to_owned(), about.to_owned(), requirement.to_owned())
            .try_into()
            .unwrap()
    }

    #[test]
    fn the_first_line_that_fits_counts() {
        let rules = [
            rule("order/edges", "missing", ""),
            rule("order/**/actions/*/**", "enumeration", "A"),
            rule("order/nodes/**", "present", "B"),
            rule("*/headerId", "any", "C"),
        ];
        let of = |topic, path: &[&str], kind| requirement(&rules, topic, path, kind);
        assert_eq!(of("order", &["edges"], FindingKind::Missing), None);
        let action = ["nodes", "0", "actions", "1", "blockingType"];
        assert_eq!(of("order", &action, FindingKind::Enumeration), Some("A"));
        assert_eq!(of("order", &action, FindingKind::Type), Some("B"));
        assert_eq!(of("order", &["nodes"], FindingKind::Type), Some("B"));
        assert_eq!(of("order", &["nodes"], FindingKind::Missing), None);
        assert_eq!(of("state", &["headerId"], FindingKind::Missing), Some("C"));
        assert_eq!(of("state", &[], FindingKind::Type), None);
    }

    #[test]
    fn a_kind_that_nobody_knows_is_refused() {
        let wrong = ("a/b".to_owned(), "wrong".to_owned(), String::new());
        assert!(FieldRule::try_from(wrong).is_err());
    }
}
