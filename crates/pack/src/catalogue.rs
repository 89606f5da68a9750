//! The catalogue of requirements: `suites/requirements/`, one file per group.
//!
//! Says what the standard demands, of whom and in which version. What decides a requirement is bound in the
//! suites, never here.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::catalogue_file;
use super::{Assets, Pack, Role};
use tck_base::diagnostic::{Diagnostic, Source};
use tck_base::verdict::Verdict;

/// Id of a requirement, such as `ORD-REJ-03`. Never renumbered, never reused.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct RequirementId(std::sync::Arc<str>);

impl RequirementId {
    /// Whether a text can be an id: a group, a hyphen and a number, such as `ORD-REJ-03`, `SYS-4711` or `SYS_REQ-7`.
    #[must_use]
    pub fn is_one(text: &str) -> bool {
        text.rsplit_once('-').is_some_and(|(group, number)| {
            let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
            group.starts_with(|c: char| c.is_ascii_alphabetic())
                && group.chars().all(is_plain)
                && !number.is_empty()
                && number.bytes().all(|digit| digit.is_ascii_digit())
        })
    }

    /// The id as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl From<&str> for RequirementId {
    fn from(text: &str) -> Self {
        Self(text.into())
    }
}

impl std::fmt::Display for RequirementId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(&self.0)
    }
}

/// How strongly the standard demands something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mood {
    /// An obligation.
    Shall,
    /// A recommendation.
    Should,
    /// A permission.
    May,
}

impl Mood {
    /// The verdict on a device that breaks a requirement of this mood.
    #[must_use]
    pub fn broken(self) -> Verdict {
        match self {
            Self::Shall => Verdict::Fail,
            Self::Should => Verdict::Warning,
            Self::May => Verdict::Pass,
        }
    }

    /// The word of the standard.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Shall => "shall",
            Self::Should => "should",
            Self::May => "may",
        }
    }
}

/// Who has to obey.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Subject {
    /// The vehicle.
    Agv,
    /// The fleet manager.
    MasterControl,
    /// Both sides of the interface.
    Both,
    /// Whoever builds the site.
    Integrator,
    /// The MQTT broker.
    Broker,
}

impl Subject {
    /// Whether a device under test in this role has to obey.
    #[must_use]
    pub fn concerns(self, role: Role) -> bool {
        match self {
            Self::Agv => role == Role::Agv,
            Self::MasterControl => role == Role::MasterControl,
            Self::Both => true,
            Self::Integrator | Self::Broker => false,
        }
    }

    /// The word used in files and outputs.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Agv => "agv",
            Self::MasterControl => "master-control",
            Self::Both => "both",
            Self::Integrator => "integrator",
            Self::Broker => "broker",
        }
    }
}

/// How a requirement can be decided.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decided {
    /// By a stimulus and its answer.
    Active,
    /// By watching traffic.
    Passive,
    /// With the help of a person or a hook.
    Operator,
    /// Not by any exchange of messages.
    NotTestable {
        /// Why not.
        reason: String,
    },
}

impl Decided {
    /// The word used in files and outputs.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Passive => "passive",
            Self::Operator => "operator",
            Self::NotTestable { .. } => "not-testable",
        }
    }
}

/// How a requirement differs from the one that the version before has under its id.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VersionChange {
    /// In other words, such as another name of a member, but with the obligation of before.
    Reworded,
    /// Another obligation about the same thing.
    Changed,
}

/// What one protocol version says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct VersionNote {
    /// Section of that version's document.
    pub section: String,
    /// How strongly it is demanded there.
    pub mood: Mood,
    /// What became of it in this version; `None` where it is as before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub change: Option<VersionChange>,
    /// What is different, in one sentence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delta: Option<String>,
}

/// One obligation of the standard, in our words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Requirement {
    /// Its id.
    pub id: RequirementId,
    /// The id without its number: `ORD-REJ`.
    pub group: String,
    /// Title of the group: "Rejection reports".
    pub chapter: String,
    /// The obligation.
    pub text: String,
    /// Who has to obey.
    pub role: Subject,
    /// How it can be decided.
    pub decided: Decided,
    /// By pack id, what that version says. A version that is absent does not have the requirement.
    pub versions: BTreeMap<String, VersionNote>,
    /// By pack id, why that version does not have it any more.
    #[serde(skip)]
    pub gone: BTreeMap<String, String>,
    /// By pack id, the requirement in the words of that version, where they are others.
    #[serde(skip)]
    pub(super) editions: BTreeMap<String, Requirement>,
    /// How to provoke it.
    pub stimulus: String,
    /// What tells obedience from breach.
    pub observe: String,
    /// What a test of it needs, such as `layout` or `operator`.
    pub needs: Vec<String>,
    /// The ruling where the text is silent or contradicts itself.
    pub interpretation: Option<String>,
    /// Why the ruling reads it so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub because: Option<String>,
    /// What the other reading would be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub otherwise: Option<String>,
    /// The requirements that have to be kept for it to be decided: where one of them is broken, a breach of this one follows.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rests_on: Vec<RequirementId>,
    /// Where it is tracked, for a requirement of somebody's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// Whether it is somebody's own, and none of the standard.
    #[serde(skip)]
    pub is_own: bool,
}

impl Requirement {
    /// What the version of `pack` says; `None` if it does not have the requirement.
    #[must_use]
    pub fn in_version(&self, pack: &Pack) -> Option<&VersionNote> {
        self.versions.get(&pack.id)
    }

    /// The requirement in the words of the version of `pack`: the one to be shown, and whose ruling counts.
    #[must_use]
    pub fn edition(&self, pack: &Pack) -> &Self {
        self.editions.get(&pack.id).unwrap_or(self)
    }

    /// Where it can be read: where it is tracked, or the heading of the public text of that version.
    #[must_use]
    pub fn link_in(&self, pack: &Pack) -> Option<String> {
        let heading = || pack.link_to(&self.in_version(pack)?.section);
        self.link.clone().or_else(heading)
    }
}

/// All requirements.
#[derive(Clone, Debug)]
pub struct Catalogue {
    requirements: Vec<Requirement>,
    by_id: BTreeMap<RequirementId, usize>,
}

impl Catalogue {
    /// Reads `suites/requirements/`.
    ///
    /// # Errors
    /// Every mistake in the files, with its place; also when there are none.
    pub fn load(assets: &Assets) -> Result<Self, Vec<Diagnostic>> {
        let mut problems = Vec::new();
        let mut chapters = Vec::new();
        for file in assets.under("suites/requirements/") {
            let source = Source::new(file.path.as_str(), file.text.as_str());
            let mut chapter = catalogue_file::read(&source, &mut problems);
            let is_own = !assets.is_checked(&file.path) && assets.own().contains(&file.path);
            for (_, requirement) in chapter.iter_mut().flat_map(|chapter| &mut chapter.requirements) {
                requirement.is_own = is_own;
                requirement
                    .editions
                    .values_mut()
                    .for_each(|edition| edition.is_own = is_own);
            }
            chapters.extend(chapter);
        }
        chapters.sort_by_key(|chapter| chapter.position);
        let mut catalogue = Self {
            requirements: Vec::new(),
            by_id: BTreeMap::new(),
        };
        for (span, requirement) in chapters.into_iter().flat_map(|chapter| chapter.requirements) {
            let at = catalogue.requirements.len();
            if catalogue.by_id.insert(requirement.id.clone(), at).is_some() {
                let title = format!("{} for a second time", requirement.id);
                problems.push(
                    Diagnostic::new("requirement-twice", span, title, "this id is taken")
                        .hint("an id is never reused: take the next free number"),
                );
            }
            catalogue.requirements.push(requirement);
        }
        for requirement in &catalogue.requirements {
            let unknown = requirement
                .rests_on
                .iter()
                .filter(|id| catalogue.get(id.as_str()).is_none());
            problems.extend(unknown.map(|id| {
                let title = format!("{} rests on {id}, which there is not", requirement.id);
                Diagnostic::whole("unknown-requirement", title)
            }));
        }
        if catalogue.requirements.is_empty() && problems.is_empty() {
            problems.push(
                Diagnostic::whole(
                    "no-requirements",
                    "there are no requirements under suites/requirements/",
                )
                .hint("a directory that replaces the suites needs a copy of that folder"),
            );
        }
        if problems.is_empty() {
            Ok(catalogue)
        } else {
            Err(problems)
        }
    }

    /// Checks the text of one file of requirements; how many it has.
    ///
    /// # Errors
    /// Every mistake in it.
    pub fn check_text(name: &str, text: &str) -> Result<usize, Vec<Diagnostic>> {
        let mut problems = Vec::new();
        let chapter = catalogue_file::read(&Source::new(name, text), &mut problems);
        match chapter {
            Some(chapter) if problems.is_empty() => Ok(chapter.requirements.len()),
            _ => Err(problems),
        }
    }

    /// The requirement with this id.
    #[must_use]
    pub fn get(&self, id: &str) -> Option<&Requirement> {
        self.requirements.get(*self.by_id.get(&RequirementId::from(id))?)
    }

    /// The requirement with this id, in the words of the version of `pack`.
    #[must_use]
    pub fn edition(&self, id: &str, pack: &Pack) -> Option<&Requirement> {
        Some(self.get(id)?.edition(pack))
    }

    /// All of them in the order of the catalogue: by chapter, then by number.
    pub fn all(&self) -> impl Iterator<Item = &Requirement> {
        self.requirements.iter()
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.requirements.len()
    }

    /// Whether there are none; a loaded catalogue never is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.requirements.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Packs;
    use std::collections::BTreeSet;

    fn catalogue() -> Catalogue {
        let loaded = Catalogue::load(&Assets::of_source_tree().unwrap());
        loaded.unwrap_or_else(|problems| panic!("{}", problems.iter().map(ToString::to_string).collect::<String>()))
    }

    #[test]
    fn all_requirements_are_there_once() {
        let catalogue = catalogue();
        assert_eq!(catalogue.len(), 623);
        let ids: BTreeSet<_> = catalogue.all().map(|requirement| &requirement.id).collect();
        assert_eq!(ids.len(), 623);
        let count = |subject| {
            catalogue
                .all()
                .filter(|requirement| requirement.role == subject)
                .count()
        };
        assert_eq!(count(Subject::Agv), 468);
        assert_eq!(count(Subject::MasterControl), 108);
        assert_eq!(count(Subject::Both), 36);
        assert_eq!(count(Subject::Integrator), 10);
        assert_eq!(count(Subject::Broker), 1);
    }

    #[test]
    fn every_requirement_leads_to_its_heading_in_the_public_text() {
        let packs = Packs::load(&Assets::of_source_tree().unwrap()).expect("packs");
        for requirement in catalogue().all() {
            for pack in packs.all().iter().filter(|pack| requirement.in_version(pack).is_some()) {
                let link = requirement.link_in(pack);
                let link = link.unwrap_or_else(|| panic!("{} has no heading in {}", requirement.id, pack.id));
                assert!(
                    link.starts_with("https://") && link.contains(&format!("{}/", pack.version)),
                    "{link}"
                );
            }
        }
        let malformed = catalogue()
            .get("ORD-REJ-01")
            .unwrap()
            .link_in(packs.get("2.1").unwrap());
        assert!(
            malformed
                .unwrap()
                .ends_with("VDA5050_EN.md#6641-vehicle-gets-a-malformed-new-order")
        );
    }

    #[test]
    fn nothing_rests_on_what_rests_on_it() {
        let catalogue = catalogue();
        let mut resting = 0;
        for requirement in catalogue.all() {
            resting += usize::from(!requirement.rests_on.is_empty());
            let (mut open, mut seen) = (vec![requirement], BTreeSet::new());
            while let Some(next) = open.pop() {
                for id in &next.rests_on {
                    let below = catalogue.get(id.as_str()).unwrap();
                    assert_ne!(below.id, requirement.id, "by {}", next.id);
                    if seen.insert(below.id.clone()) {
                        open.push(below);
                    }
                }
            }
        }
        assert!(resting > 30, "{resting}");
    }

    #[test]
    fn a_reason_belongs_to_a_ruling() {
        let text = "group: A\nchapter: x\nposition: 1\nrequirements:\n  - id: A-1\n    text: x\n    role: agv\n    \
                    decided: active\n    in: { \"2.1\": { section: \"4\", mood: shall } }\n    stimulus: x\n    \
                    observe: x\n    needs: []\n    because: y\n";
        let problems = Catalogue::check_text("a.yaml", text).unwrap_err();
        assert_eq!(problems[0].title, "`because` without an interpretation");
    }

    #[test]
    fn the_moods_of_each_version_are_counted() {
        let (catalogue, packs) = (
            catalogue(),
            Packs::load(&Assets::of_source_tree().unwrap()).expect("packs"),
        );
        let count = |pack: &Pack, mood| {
            let notes = catalogue.all().filter_map(|requirement| requirement.in_version(pack));
            notes.filter(|note| note.mood == mood).count()
        };
        let counts = |pack: &Pack| [Mood::Shall, Mood::Should, Mood::May].map(|mood| count(pack, mood));
        assert_eq!(counts(packs.latest()), [309, 35, 6]);
        assert_eq!(counts(packs.all().last().expect("a pack")), [539, 45, 24]);
    }

    #[test]
    fn a_version_that_has_a_requirement_in_other_words_shows_them() {
        let (catalogue, packs) = (
            catalogue(),
            Packs::load(&Assets::of_source_tree().unwrap()).expect("packs"),
        );
        let (latest, last) = (packs.latest(), packs.all().last().expect("a pack"));
        let topics = |pack: &Pack| catalogue.edition("TOPIC-01", pack).expect("a requirement").text.clone();
        assert!(topics(last).contains("zoneSet") && !topics(latest).contains("zoneSet"));
        let malformed = catalogue.get("ORD-REJ-02").expect("a requirement");
        assert!(malformed.edition(last).text.contains("VALIDATION_FAILURE"));
        assert!(malformed.edition(latest).text.contains("validationError"));
        assert_eq!(malformed.edition(last).id, malformed.id);
    }

    #[test]
    fn every_version_named_is_a_pack_and_the_oldest_lacks_what_came_later() {
        let (catalogue, packs) = (
            catalogue(),
            Packs::load(&Assets::of_source_tree().unwrap()).expect("packs"),
        );
        for requirement in catalogue.all() {
            for version in requirement.versions.keys() {
                assert!(packs.all().iter().any(|pack| &pack.id == version), "{}", requirement.id);
            }
        }
        let oldest = &packs.all()[0];
        let later = catalogue.get("MAP-24").expect("enableMap");
        assert!(later.in_version(oldest).is_none() && later.in_version(packs.latest()).is_some());
        assert_eq!(
            catalogue
                .all()
                .filter(|requirement| requirement.in_version(oldest).is_some())
                .count(),
            299
        );
        let retained = catalogue.get("CONN-06").expect("retain");
        assert_eq!(retained.in_version(oldest).expect("older").mood, Mood::Should);
        assert_eq!(retained.in_version(packs.latest()).expect("newer").mood, Mood::Shall);
    }

    #[test]
    fn every_not_testable_requirement_says_why() {
        let reasons: Vec<_> = catalogue()
            .all()
            .filter_map(|requirement| match &requirement.decided {
                Decided::NotTestable { reason } => Some(reason.clone()),
                _ => None,
            })
            .collect();
        assert_eq!(reasons.len(), 19);
        assert!(reasons.iter().all(|reason| reason.len() > 20));
    }

    #[test]
    fn the_order_is_by_chapter_and_number() {
        let catalogue = catalogue();
        let ids: Vec<_> = catalogue.all().map(|requirement| requirement.id.as_str()).collect();
        assert_eq!(ids[..2], ["MQTT-01", "MQTT-02"]);
        assert!(ids[622].starts_with("BP-"));
        // Those of the standard have two digits; those of somebody's own have what their tracker gives them.
        let digits = |id: &str| id.rsplit('-').next().map(str::len);
        assert!(ids.iter().all(|id| RequirementId::is_one(id) && digits(id) == Some(2)));
        let requirement = catalogue.get("ORD-REJ-03").expect("requirement");
        assert_eq!(
            (requirement.group.as_str(), requirement.chapter.as_str()),
            ("ORD-REJ", "Rejection reports")
        );
        assert!(catalogue.get("ORD-REJ-99").is_none());
    }

    #[test]
    fn a_mood_says_what_a_breach_costs_and_a_subject_whom_it_concerns() {
        assert_eq!(Mood::Shall.broken(), Verdict::Fail);
        assert_eq!(Mood::Should.broken(), Verdict::Warning);
        assert_eq!(Mood::May.broken(), Verdict::Pass);
        assert!(Subject::Both.concerns(Role::Agv) && Subject::Both.concerns(Role::MasterControl));
        assert!(Subject::Agv.concerns(Role::Agv) && !Subject::Agv.concerns(Role::MasterControl));
        assert!(!Subject::Broker.concerns(Role::Agv) && !Subject::Integrator.concerns(Role::MasterControl));
    }

    #[test]
    fn a_directory_without_requirements_is_an_error() {
        let dir = tempfile::tempdir().expect("directory");
        let assets = Assets::of_source_tree()
            .unwrap()
            .with_suites(dir.path())
            .expect("assets");
        assert_eq!(Catalogue::load(&assets).expect_err("empty")[0].code, "no-requirements");
    }
}
