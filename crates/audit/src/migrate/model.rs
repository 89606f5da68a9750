//! What a device has to change to speak a later version, as data.

use std::fmt;

use serde::Serialize;

use super::super::result::Recording;
use tck_base::verdict::Verdict;
use tck_pack::{ChangeKind, FindingKind, Role};

/// What a device has to change to speak a later version.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Migration {
    /// Format of this, for programs.
    pub format: &'static str,
    /// Name and version of the tool.
    pub tool: String,
    /// Which side it is.
    pub role: Role,
    /// Who it is, in words.
    pub device: String,
    /// The version it speaks.
    pub from: String,
    /// The later version.
    pub to: String,
    /// The recordings.
    pub recordings: Vec<Recording>,
    /// Its messages that were judged by both versions.
    pub messages: u64,
    /// Its messages that name another version, or came before any version was named.
    pub left_out: u64,
    /// Topics that are new, gone, or published otherwise.
    pub topics: Vec<TopicChange>,
    /// Members that have another name, place or type, or are gone; those that came most often first.
    pub members: Vec<MemberChange>,
    /// Words that are written otherwise, or are gone; those that came most often first.
    pub words: Vec<WordChange>,
    /// What the schemas of the later version find wrong once members and words have their new names.
    pub breaches: Vec<Breach>,
    /// What became of each requirement of the side; of those that are as before only what the messages break.
    pub requirements: Vec<RequirementRow>,
}

/// How the later version treats a topic of the device.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct TopicChange {
    /// Its name.
    pub topic: String,
    /// How it is published now; absent where the version does not have it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub before: Option<TopicTerms>,
    /// How it is published in the later version; absent where that does not have it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after: Option<TopicTerms>,
}

/// How a topic is published.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct TopicTerms {
    /// MQTT quality of service.
    pub qos: u8,
    /// Whether it is published with the retain flag.
    pub retain: bool,
    /// Whether every implementation has it.
    pub mandatory: bool,
}

impl fmt::Display for TopicTerms {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let retain = if self.retain { "retained" } else { "not retained" };
        let mandatory = if self.mandatory { "mandatory" } else { "optional" };
        write!(f, "QoS {}, {retain}, {mandatory}", self.qos)
    }
}

/// What becomes of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MemberChangeKind {
    /// The later version calls it otherwise, or has it in another place.
    Renamed,
    /// Elements of it stand in a list of their own.
    Apart,
    /// It is of another type.
    Retyped,
    /// The later version does not have it.
    Gone,
}

impl MemberChangeKind {
    /// In one word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Renamed => "renamed",
            Self::Apart => "apart",
            Self::Retyped => "retyped",
            Self::Gone => "gone",
        }
    }
}

/// What becomes of a member of messages.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct MemberChange {
    /// Topic name of the messages.
    pub topic: String,
    /// What becomes of it.
    pub kind: MemberChangeKind,
    /// Where it stands, with slashes; `*` is any element of a list.
    pub before: String,
    /// Where it stands in the later version.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after: Option<String>,
    /// Its types now and in the later version, where that is what changes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub types: Option<[String; 2]>,
    /// In how many messages of the device it came.
    pub messages: u64,
}

/// What becomes of a word.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct WordChange {
    /// Topic and member, or what the word is about.
    pub member: String,
    /// The word now.
    pub before: String,
    /// The word of the later version; absent where that does not have it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after: Option<String>,
    /// In how many messages of the device it came.
    pub messages: u64,
}

/// What the schema of the later version finds wrong with messages whose members and words have their new names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Breach {
    /// Topic name of the messages.
    pub topic: String,
    /// Where, with slashes; `*` is any element of a list.
    pub member: String,
    /// What is wrong there.
    pub kind: FindingKind,
    /// One line about the first one.
    pub text: String,
    /// In how many messages.
    pub messages: u64,
    /// Number of the recording of the first one, counted from 0.
    pub recording: usize,
    /// Its line.
    pub line: u64,
    /// The requirement that it breaks, beside those on types and values in general.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requirement: Option<String>,
}

/// What one version says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Said {
    /// The obligation, in our words.
    pub text: String,
    /// `shall`, `should` or `may`.
    pub mood: &'static str,
    /// Section of the document.
    pub section: String,
    /// Where it can be read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
}

/// What became of a requirement, and how the messages of the device stand to it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct RequirementRow {
    /// Its id.
    pub id: String,
    /// What became of it.
    pub change: ChangeKind,
    /// Whether the later version asks for it more strongly, by its mood alone.
    pub stricter: bool,
    /// What the version says that the device speaks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub before: Option<Said>,
    /// What the later version says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after: Option<Said>,
    /// What is different, or why it is gone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// How its messages stand to it today; absent where they decide nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub now: Option<Verdict>,
    /// How they stand to it in the later version, once members and words have their new names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub then: Option<Verdict>,
    /// In how many messages that is broken.
    pub count: u64,
    /// What is wrong in the first of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<String>,
    /// The tests that decide it in the later version.
    pub tests: Vec<String>,
    /// The monitors that decide it in the later version.
    pub monitors: Vec<String>,
}

impl RequirementRow {
    /// Whether the messages break it in the later version.
    #[must_use]
    pub fn is_broken(&self) -> bool {
        matches!(self.then, Some(Verdict::Fail | Verdict::Warning))
    }
}

impl Migration {
    /// The rows of one kind, those that are broken first, then those that are stricter.
    pub fn of(&self, change: ChangeKind) -> impl Iterator<Item = &RequirementRow> {
        self.requirements.iter().filter(move |row| row.change == change)
    }

    /// How many requirements the messages break in the later version.
    #[must_use]
    pub fn broken(&self) -> usize {
        self.requirements.iter().filter(|row| row.is_broken()).count()
    }

    /// How many messages stand behind it, in one sentence.
    #[must_use]
    pub fn extent(&self) -> String {
        let left = match self.left_out {
            0 => String::new(),
            left => format!("; {left} more name another version, or came before one was named, and were left out"),
        };
        format!("{} messages of {}{left}", self.messages, self.device)
    }
}
