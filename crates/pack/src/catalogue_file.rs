//! One file of the catalogue: from a tree with places to typed requirements.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::reader::Reader;
use super::{Decided, Requirement, RequirementId, VersionNote};
use tck_base::diagnostic::{Diagnostic, Source, Span};
use tck_base::yaml::{self, Node};

/// The requirements of one group, in the order written.
pub(super) struct Chapter {
    /// Place of the chapter in lists and reports.
    pub position: u64,
    /// Each with the place of its id.
    pub requirements: Vec<(Span, Requirement)>,
}

/// Reads a file; mistakes are added to `problems`.
pub(super) fn read(source: &Arc<Source>, problems: &mut Vec<Diagnostic>) -> Option<Chapter> {
    let root = match yaml::tree(source) {
        Ok(root) => root,
        Err(mistakes) => {
            problems.extend(mistakes);
            return None;
        }
    };
    let mut reader = Reader::new("catalogue", problems);
    reader.known(&root, &["group", "chapter", "position", "requirements"]);
    let group = reader.text(&root, "group")?;
    let chapter = reader.text(&root, "chapter")?;
    let position = reader.member(&root, "position")?;
    let Some(position) = yaml::value(position).as_u64() else {
        reader.wrong(position, "a whole number");
        return None;
    };
    let items = reader.list(&root, "requirements")?;
    let requirements = items
        .iter()
        .filter_map(|item| reader.requirement(item, &group, &chapter))
        .collect();
    Some(Chapter { position, requirements })
}

const KEYS: [&str; 15] = [
    "id",
    "text",
    "role",
    "decided",
    "reason",
    "in",
    "gone",
    "stimulus",
    "observe",
    "needs",
    "interpretation",
    "because",
    "otherwise",
    "rests-on",
    "link",
];

/// What can be said of one version.
const NOTE_KEYS: [&str; 13] = [
    "section",
    "mood",
    "change",
    "delta",
    "text",
    "decided",
    "reason",
    "stimulus",
    "observe",
    "needs",
    "interpretation",
    "because",
    "otherwise",
];

/// Where a version takes a ruling back.
const NO_RULING: &str = "none";

impl Reader<'_> {
    fn requirement(&mut self, node: &Node, group: &str, chapter: &str) -> Option<(Span, Requirement)> {
        self.known(node, &KEYS);
        let place = self.member(node, "id")?;
        let id = self.text(node, "id")?;
        let is_of_group = id.strip_prefix(group).is_some_and(|rest| rest.starts_with('-'));
        if !is_of_group || !RequirementId::is_one(&id) {
            let title = format!("`{id}` is no id of the group {group}");
            let hint = format!("write {group}-1 or {group}-4711");
            self.problem(place, &title, "not the group, a hyphen and a number", &hint);
        }
        let needs = self
            .list(node, "needs")?
            .iter()
            .filter_map(|need| self.as_text(need))
            .collect();
        self.reasons(node);
        let mut requirement = Requirement {
            id: RequirementId::from(id.as_str()),
            group: group.to_owned(),
            chapter: chapter.to_owned(),
            text: self.text(node, "text")?,
            role: self.choice(node, "role", &["agv", "master-control", "both", "integrator", "broker"])?,
            decided: self.decided(node)?,
            versions: self.versions(node)?,
            gone: self.gone(node),
            editions: BTreeMap::new(),
            stimulus: self.text(node, "stimulus")?,
            observe: self.text(node, "observe")?,
            needs,
            interpretation: node.get("interpretation").and_then(|text| self.as_text(text)),
            because: node.get("because").and_then(|text| self.as_text(text)),
            otherwise: node.get("otherwise").and_then(|text| self.as_text(text)),
            rests_on: self.rests_on(node),
            link: node.get("link").and_then(|link| self.link(link)),
            is_own: false,
        };
        for (version, said) in node.get("in").and_then(Node::map).unwrap_or_default() {
            if let (Some(version), Some(edition)) = (version.text(), self.edition(said, &requirement)) {
                requirement.editions.insert(version.to_owned(), edition);
            }
        }
        Some((place.span.clone(), requirement))
    }

    /// The ids of what has to be kept for it to be decided.
    fn rests_on(&mut self, node: &Node) -> Vec<RequirementId> {
        let Some(all) = node.get("rests-on").and_then(|_| self.list(node, "rests-on")) else {
            return Vec::new();
        };
        let ids = all.iter().filter_map(|id| self.as_text(id));
        ids.map(|id| RequirementId::from(id.as_str())).collect()
    }

    /// A reason belongs to a ruling.
    fn reasons(&mut self, node: &Node) {
        for reason in ["because", "otherwise"] {
            if let Some(said) = node.get(reason).filter(|_| node.get("interpretation").is_none()) {
                let title = format!("`{reason}` without an interpretation");
                let hint = "write `interpretation`, or take this out";
                self.problem(said, &title, "there is no ruling", hint);
            }
        }
    }

    /// The requirement in the words of one version; `None` where they are the common ones.
    fn edition(&mut self, said: &Node, common: &Requirement) -> Option<Requirement> {
        let mut own = |key: &str| said.get(key).and_then(|text| self.as_text(text));
        let (text, stimulus, observe) = (own("text"), own("stimulus"), own("observe"));
        let (ruling, because, otherwise) = (own("interpretation"), own("because"), own("otherwise"));
        self.reasons(said);
        let decided = said.get("decided").and_then(|_| self.decided(said));
        let needs = said.get("needs").and_then(|_| self.list(said, "needs"));
        let needs = needs.map(|all| all.iter().filter_map(|need| self.as_text(need)).collect());
        let mut edition = common.clone();
        if let Some(ruling) = ruling {
            edition.interpretation = Some(ruling).filter(|ruling| ruling != NO_RULING);
            edition.because = because;
            edition.otherwise = otherwise;
        }
        edition.text = text.unwrap_or(edition.text);
        edition.stimulus = stimulus.unwrap_or(edition.stimulus);
        edition.observe = observe.unwrap_or(edition.observe);
        edition.decided = decided.unwrap_or(edition.decided);
        edition.needs = needs.unwrap_or(edition.needs);
        edition.editions.clear();
        let is_other = Requirement {
            editions: common.editions.clone(),
            ..edition.clone()
        } != *common;
        is_other.then_some(edition)
    }

    /// Why later versions do not have it any more.
    fn gone(&mut self, node: &Node) -> BTreeMap<String, String> {
        let Some(place) = node.get("gone") else {
            return BTreeMap::new();
        };
        let Some(entries) = place.map() else {
            self.wrong(place, "a mapping from version to a reason");
            return BTreeMap::new();
        };
        let mut gone = BTreeMap::new();
        for (version, reason) in entries {
            let Some(name) = version.text() else { continue };
            if node.get("in").is_some_and(|versions| versions.get(name).is_some()) {
                let title = format!("version {name} has it, and it is gone there");
                self.problem(version, &title, "both", "take one of the two out");
            }
            gone.extend(self.as_text(reason).map(|reason| (name.to_owned(), reason)));
        }
        gone
    }

    fn decided(&mut self, node: &Node) -> Option<Decided> {
        let words = ["active", "passive", "operator", "not-testable"];
        let word: String = self.choice(node, "decided", &words)?;
        if word == "not-testable" {
            let reason = self.text(node, "reason")?;
            return Some(Decided::NotTestable { reason });
        }
        if let Some(reason) = node.get("reason") {
            let hint = "only what is not testable needs a reason";
            self.problem(reason, "a reason without need", "not expected here", hint);
        }
        Some(match word.as_str() {
            "active" => Decided::Active,
            "passive" => Decided::Passive,
            _ => Decided::Operator,
        })
    }

    fn versions(&mut self, node: &Node) -> Option<BTreeMap<String, VersionNote>> {
        let place = self.member(node, "in")?;
        let Some(entries) = place.map() else {
            self.wrong(place, "a mapping from version to section and mood");
            return None;
        };
        let mut versions = BTreeMap::new();
        for (version, said) in entries {
            self.known(said, &NOTE_KEYS);
            let change = said.get("change");
            let said = VersionNote {
                section: self.text(said, "section")?,
                mood: self.choice(said, "mood", &["shall", "should", "may"])?,
                change: change.and_then(|_| self.choice(said, "change", &["reworded", "changed"])),
                delta: said.get("delta").and_then(|delta| self.as_text(delta)),
            };
            versions.insert(version.text()?.to_owned(), said);
        }
        if versions.is_empty() {
            self.problem(
                place,
                "in no version",
                "empty",
                "name the versions that have the requirement",
            );
        }
        Some(versions)
    }

    fn link(&mut self, node: &Node) -> Option<String> {
        let link = self.as_text(node)?;
        if link.starts_with("https://") || link.starts_with("http://") {
            return Some(link);
        }
        let title = format!("`{link}` is no link");
        self.problem(node, &title, "leads nowhere", "write https://…");
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::VersionChange;

    const GOOD: &str = r#"group: A-B
chapter: Title
position: 3
requirements:
  - id: A-B-01
    text: Do it.
    role: both
    decided: not-testable
    reason: Nobody sees it.
    in: { "9.9": { section: "1", mood: may } }
    stimulus: none needed
    observe: nothing
    needs: [layout]
    interpretation: Free.
"#;

    fn titles(text: &str) -> Vec<String> {
        let mut problems = Vec::new();
        read(&Source::new("x.yaml", text), &mut problems);
        problems.into_iter().map(|problem| problem.title).collect()
    }

    #[test]
    fn a_good_file_is_read_whole() {
        let mut problems = Vec::new();
        let chapter = read(&Source::new("x.yaml", GOOD), &mut problems).expect("chapter");
        assert!(problems.is_empty(), "{problems:?}");
        assert_eq!(chapter.position, 3);
        let (span, requirement) = &chapter.requirements[0];
        assert_eq!(span.text(), "A-B-01");
        assert_eq!(requirement.needs, ["layout"]);
        assert_eq!(requirement.versions["9.9"].section, "1");
        assert_eq!(requirement.interpretation.as_deref(), Some("Free."));
        assert_eq!(requirement.decided.word(), "not-testable");
    }

    #[test]
    fn ids_are_as_trackers_write_them() {
        for (group, id) in [
            ("SYS", "SYS-4711"),
            ("AGV2-REQ", "AGV2-REQ-01"),
            ("SYS_REQ", "SYS_REQ-7"),
            ("agv", "agv-1"),
        ] {
            let text = GOOD.replace("A-B-01", id).replace("A-B", group);
            assert_eq!(titles(&text), Vec::<String>::new(), "{id}");
        }
        let linked = GOOD.to_owned() + "    link: https://tracker.example/A-B-01\n";
        let mut problems = Vec::new();
        let chapter = read(&Source::new("x.yaml", linked), &mut problems).expect("chapter");
        let (_, requirement) = &chapter.requirements[0];
        assert_eq!(requirement.link.as_deref(), Some("https://tracker.example/A-B-01"));
    }

    /// A requirement that a later version has in other words.
    fn reworded() -> String {
        let later = "in:\n      \"9.9\": { section: \"1\", mood: may }\n      \"10.0\":\n        section: \"2\"\n        \
                     mood: shall\n        change: changed\n        delta: It is stronger.\n        text: Do it at once.\n        \
                     interpretation: none\n    gone: { \"11.0\": Nobody did it. }";
        GOOD.replace("in: { \"9.9\": { section: \"1\", mood: may } }", later)
    }

    #[test]
    fn a_version_can_have_it_in_other_words() {
        let mut problems = Vec::new();
        let chapter = read(&Source::new("x.yaml", reworded()), &mut problems).expect("chapter");
        assert!(problems.is_empty(), "{problems:?}");
        let (_, requirement) = &chapter.requirements[0];
        assert_eq!(requirement.text, "Do it.");
        assert_eq!(requirement.editions.keys().collect::<Vec<_>>(), ["10.0"]);
        let later = &requirement.editions["10.0"];
        assert_eq!(
            (later.text.as_str(), later.interpretation.as_deref()),
            ("Do it at once.", None)
        );
        assert_eq!(later.observe, requirement.observe);
        assert_eq!(requirement.versions["10.0"].change, Some(VersionChange::Changed));
        assert_eq!(requirement.versions["10.0"].delta.as_deref(), Some("It is stronger."));
        assert_eq!(requirement.gone["11.0"], "Nobody did it.");
    }

    #[test]
    fn mistakes_about_versions_are_named() {
        for (good, bad, expected) in [
            ("change: changed", "change: new", "`new` is not known for `change`"),
            ("delta:", "deltas:", "unknown key `deltas`"),
            ("\"11.0\"", "\"10.0\"", "version 10.0 has it, and it is gone there"),
            (
                "gone: { \"11.0\": Nobody did it. }",
                "gone: never",
                "a text where a mapping from version to a reason is due",
            ),
            (
                "interpretation: none",
                "because: Of it.",
                "`because` without an interpretation",
            ),
        ] {
            let text = reworded().replacen(good, bad, 1);
            assert_ne!(text, reworded());
            assert_eq!(titles(&text).first().map(String::as_str), Some(expected), "{bad}");
        }
    }

    #[test]
    fn every_mistake_is_named() {
        for (good, bad, expected) in [
            ("role: both", "role: agx", "`agx` is not known for `role`"),
            ("    reason: Nobody sees it.\n", "", "`reason` is missing"),
            ("decided: not-testable", "decided: active", "a reason without need"),
            ("text: Do it.", "text: 5", "a number where a text is due"),
            ("id: A-B-01", "id: A-C-01", "`A-C-01` is no id of the group A-B"),
            ("id: A-B-01", "id: A-B-1a", "`A-B-1a` is no id of the group A-B"),
            ("id: A-B-01", "id: A-B-", "`A-B-` is no id of the group A-B"),
            ("id: A-B-01", "id: A-B2-1", "`A-B2-1` is no id of the group A-B"),
            ("observe:", "observes:", "unknown key `observes`"),
            ("mood: may", "mood: must", "`must` is not known for `mood`"),
            ("needs: [layout]", "needs: layout", "a text where a list is due"),
            (
                "in: { \"9.9\": { section: \"1\", mood: may } }",
                "in: {}",
                "in no version",
            ),
            (
                "interpretation: Free.",
                "interpretation: \"\"",
                "an empty text where a text is due",
            ),
            ("interpretation: Free.", "link: tracker", "`tracker` is no link"),
            ("position: 3", "position: first", "a text where a whole number is due"),
        ] {
            let text = GOOD.replace(good, bad);
            assert_ne!(text, GOOD);
            assert_eq!(titles(&text).first().map(String::as_str), Some(expected), "{bad}");
        }
    }
}
