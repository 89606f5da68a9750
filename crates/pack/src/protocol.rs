//! One protocol version, and all that are known.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use tck_view::Names;

use super::errata::Erratum;
use super::fields::{self, FieldRule};
use super::schema::FindingKind;
use super::{AssetFile, Assets, MessageSchema, Role, Version};
use tck_base::diagnostic::{Diagnostic, Source};
use tck_base::yaml;

/// Name of a topic of the protocol, the last level of the MQTT topic, such as `order`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct TopicName(Arc<str>);

impl TopicName {
    /// The name as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl From<&str> for TopicName {
    fn from(text: &str) -> Self {
        Self(text.into())
    }
}

impl fmt::Display for TopicName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// How a topic is published.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TopicRule {
    /// Its name.
    pub name: TopicName,
    /// The side that publishes it.
    pub publisher: Role,
    /// MQTT quality of service.
    pub qos: u8,
    /// Whether it is published with the retain flag.
    pub retain: bool,
    /// Whether every implementation has it.
    pub mandatory: bool,
}

/// What can be judged by a version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Judged {
    /// Messages, one by one.
    Messages,
    /// Devices of both sides, by tests and beside reference devices, as far as there is something to judge.
    Devices,
    /// Vehicles.
    Agv,
    /// Master controls.
    MasterControl,
}

/// `protocol.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Protocol {
    id: String,
    version: String,
    judges: Vec<Judged>,
    finds_every_fault: bool,
    topic_template: String,
    #[serde(default = "usual_digits")]
    timestamp_digits: usize,
    topic: Vec<TopicRule>,
    features: BTreeMap<String, bool>,
    fields: Vec<FieldRule>,
    #[serde(default)]
    members: Names,
    document: Option<Document>,
}

/// How many digits a timestamp has behind the second, unless a version says it.
fn usual_digits() -> usize {
    2
}

/// The public text of a version.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    url: String,
    /// The anchor of each section.
    headings: BTreeMap<String, String>,
}

/// One protocol version as data.
#[derive(Debug)]
pub struct Pack {
    /// Folder name below `schemas/`, major and minor.
    pub id: String,
    /// The version written into headers.
    pub version: Version,
    judges: Vec<Judged>,
    finds_every_fault: bool,
    topics: Vec<TopicRule>,
    schemas: BTreeMap<String, MessageSchema>,
    vocabulary: Value,
    words: Arc<Map<String, Value>>,
    topic_template: String,
    timestamp_digits: usize,
    features: BTreeMap<String, bool>,
    fields: Vec<FieldRule>,
    names: Arc<Names>,
    document: Option<Document>,
}

/// Why a pack could not be read.
#[derive(Debug, thiserror::Error)]
pub enum PackError {
    /// No folder below `schemas/` holds a `protocol.toml`.
    #[error("there is no protocol version under schemas/")]
    None,
    /// A file a pack needs is not there.
    #[error("{0} is missing")]
    Missing(String),
    /// `protocol.toml` cannot be read.
    #[error("{path}: {message}")]
    Protocol {
        /// The file.
        path: String,
        /// What is wrong.
        message: String,
    },
    /// `vocabulary.yaml` cannot be read.
    #[error("{path} cannot be read: {}", .problems.first().map_or_else(String::new, |first| first.title.clone()))]
    Vocabulary {
        /// The file.
        path: String,
        /// What is wrong, with places.
        problems: Vec<Diagnostic>,
    },
    /// `errata.yaml` cannot be used.
    #[error("{path}: {message}")]
    Errata {
        /// The file.
        path: String,
        /// What is wrong.
        message: String,
    },
    /// A schema does not parse or compile.
    #[error("{path} is not a schema: {message}")]
    Schema {
        /// The file.
        path: String,
        /// What is wrong.
        message: String,
    },
}

impl Pack {
    fn load(assets: &Assets, file: &AssetFile) -> Result<Self, PackError> {
        let wrong = |message: String| PackError::Protocol {
            path: file.path.clone(),
            message,
        };
        let folder = file.path.trim_end_matches("/protocol.toml");
        let protocol: Protocol = toml::from_str(&file.text).map_err(|error| wrong(error.to_string()))?;
        let version: Version = protocol.version.parse().map_err(wrong)?;
        if folder != format!("schemas/{}", protocol.id) || protocol.id != format!("{}.{}", version.major, version.minor)
        {
            return Err(wrong("folder, id and version do not agree".to_owned()));
        }
        let errata = read_errata(assets, &format!("{folder}/errata.yaml"))?;
        let mut schemas = BTreeMap::new();
        for topic in &protocol.topic {
            let path = format!("{folder}/{}.schema.json", topic.name);
            let disputed = errata.iter().filter_map(|one| one.of_topic(topic.name.as_str()));
            let schema = read_schema(assets, &path)?.with_errata(disputed.collect());
            schemas.insert(topic.name.to_string(), schema);
        }
        let vocabulary = read_vocabulary(assets, &format!("{folder}/vocabulary.yaml"))?;
        let words = Map::from_iter([("vda".to_owned(), vocabulary.clone())]);
        Ok(Self {
            vocabulary,
            words: Arc::new(words),
            id: protocol.id,
            version,
            judges: protocol.judges,
            finds_every_fault: protocol.finds_every_fault,
            topics: protocol.topic,
            schemas,
            topic_template: protocol.topic_template,
            timestamp_digits: protocol.timestamp_digits,
            features: protocol.features,
            fields: protocol.fields,
            names: Arc::new(protocol.members),
            document: protocol.document,
        })
    }

    /// Whether there are tests and reference devices of both sides of this version, so that devices can be judged by it, and not only
    /// messages.
    #[must_use]
    pub fn judges_devices(&self) -> bool {
        self.judges.contains(&Judged::Devices)
    }

    /// Whether devices of this side can be judged by it.
    #[must_use]
    pub fn judges(&self, role: Role) -> bool {
        let own = match role {
            Role::Agv => Judged::Agv,
            Role::MasterControl => Judged::MasterControl,
        };
        self.judges_devices() || self.judges.contains(&own)
    }

    /// Whether every fault of the reference devices that breaks an obligation of this version has to be found in it. Otherwise
    /// no more is proven than that each clause is failed by one.
    #[must_use]
    pub fn finds_every_fault(&self) -> bool {
        self.finds_every_fault
    }

    /// The topics of the protocol.
    pub fn topics(&self) -> &[TopicRule] {
        &self.topics
    }

    /// The topic called `name`.
    #[must_use]
    pub fn topic(&self, name: &str) -> Option<&TopicRule> {
        self.topics.iter().find(|topic| topic.name.as_str() == name)
    }

    /// The schema of the messages of a topic.
    #[must_use]
    pub fn schema(&self, topic: &str) -> Option<&MessageSchema> {
        self.schemas.get(topic)
    }

    /// `vocabulary.yaml`: the words of this version by meaning, such as `/error/outdatedUpdate`.
    #[must_use]
    pub fn vocabulary(&self) -> &Value {
        &self.vocabulary
    }

    /// The vocabulary as the variable `vda` of every test and monitor.
    #[must_use]
    pub fn words(&self) -> Arc<Map<String, Value>> {
        Arc::clone(&self.words)
    }

    /// One word of the vocabulary: `error.outdatedUpdate`. `None` if there is no such entry or it is not a text
    /// (an error the version does not name is a partial error object, see [`Pack::vocabulary`]).
    #[must_use]
    pub fn word(&self, path: &str) -> Option<&str> {
        path.split('.')
            .try_fold(&self.vocabulary, |here, name| here.get(name))?
            .as_str()
    }

    /// How a topic is named unless a profile says otherwise, with the placeholders `{majorVersion}`,
    /// `{manufacturer}`, `{serialNumber}` and `{topic}`.
    pub fn topic_template(&self) -> &str {
        &self.topic_template
    }

    /// How many digits a timestamp has behind the second.
    #[must_use]
    pub fn timestamp_digits(&self) -> usize {
        self.timestamp_digits
    }

    /// Fills the placeholders of a topic template. What is filled in is not searched for placeholders again, and
    /// an unknown placeholder stays as it is.
    #[must_use]
    pub fn fill_topic(&self, template: &str, manufacturer: &str, serial_number: &str, topic: &str) -> String {
        let major = self.version.major.to_string();
        let values = [
            ("{majorVersion}", major.as_str()),
            ("{manufacturer}", manufacturer),
            ("{serialNumber}", serial_number),
            ("{topic}", topic),
        ];
        let mut filled = String::new();
        let mut rest = template;
        while let Some(at) = rest.find('{') {
            let (before, from) = rest.split_at(at);
            filled.push_str(before);
            let known = values
                .iter()
                .find_map(|(name, value)| Some((value, from.strip_prefix(name)?)));
            rest = if let Some((value, behind)) = known {
                filled.push_str(value);
                behind
            } else {
                filled.push('{');
                &from[1..]
            };
        }
        filled.push_str(rest);
        filled
    }

    /// Which requirement a field of a message breaks that has such a mistake, beside those about types and values in general;
    /// `None` where none does, or a check of its own judges the field.
    #[must_use]
    pub fn requirement_of(&self, topic: &str, path: &[&str], kind: FindingKind) -> Option<&str> {
        fields::requirement(&self.fields, topic, path, kind)
    }

    /// The members and requirements that the table of fields names.
    pub fn fields(&self) -> impl Iterator<Item = (Vec<&str>, Option<&str>)> {
        self.fields
            .iter()
            .map(|rule| (rule.names().collect(), rule.requirement()))
    }

    /// Where a section of the public text of this version begins, as a link; `None` for what is no section of it.
    #[must_use]
    pub fn link_to(&self, section: &str) -> Option<String> {
        let document = self.document.as_ref()?;
        let anchor = document.headings.get(section)?;
        Some(format!("{}#{anchor}", document.url))
    }

    /// What the version calls the members of messages (`[members]` of `protocol.toml`): what views are read by.
    #[must_use]
    pub fn names(&self) -> &Arc<Names> {
        &self.names
    }

    /// Whether the version has a feature (`[features]` of `protocol.toml`): what reference devices switch on.
    #[must_use]
    pub fn has(&self, feature: &str) -> bool {
        self.features.get(feature).copied().unwrap_or(false)
    }

    /// All features with their settings, by name.
    pub fn features(&self) -> impl Iterator<Item = (&str, bool)> {
        self.features.iter().map(|(name, on)| (name.as_str(), *on))
    }
}

fn read_schema(assets: &Assets, path: &str) -> Result<MessageSchema, PackError> {
    let file = assets.get(path).ok_or_else(|| PackError::Missing(path.to_owned()))?;
    serde_json::from_str(&file.text)
        .map_err(|error| error.to_string())
        .and_then(MessageSchema::compile)
        .map_err(|message| PackError::Schema {
            path: path.to_owned(),
            message,
        })
}

/// What is disputed in a version; nothing where it has no such file.
fn read_errata(assets: &Assets, path: &str) -> Result<Vec<Erratum>, PackError> {
    let Some(file) = assets.get(path) else {
        return Ok(Vec::new());
    };
    let wrong = |message: String| PackError::Errata {
        path: path.to_owned(),
        message,
    };
    let first = |problems: Vec<Diagnostic>| problems.first().map_or_else(String::new, |first| first.title.clone());
    let tree = yaml::tree(&Source::new(path, file.text.as_str())).map_err(|problems| wrong(first(problems)))?;
    serde_json::from_value(yaml::value(&tree)).map_err(|error| wrong(error.to_string()))
}

fn read_vocabulary(assets: &Assets, path: &str) -> Result<Value, PackError> {
    let file = assets.get(path).ok_or_else(|| PackError::Missing(path.to_owned()))?;
    yaml::tree(&Source::new(path, file.text.as_str()))
        .map(|node| yaml::value(&node))
        .map_err(|problems| PackError::Vocabulary {
            path: path.to_owned(),
            problems,
        })
}

/// All protocol versions known.
#[derive(Clone, Debug)]
pub struct Packs {
    /// By version, oldest first; never empty.
    all: Vec<Arc<Pack>>,
    latest: Arc<Pack>,
}

impl Packs {
    /// Reads every folder of `schemas/` that has a `protocol.toml`.
    ///
    /// # Errors
    /// There is none, or one is broken.
    pub fn load(assets: &Assets) -> Result<Self, PackError> {
        let mut all = assets
            .under("schemas/")
            .filter(|file| file.path.ends_with("/protocol.toml"))
            .map(|file| Pack::load(assets, file).map(Arc::new))
            .collect::<Result<Vec<_>, _>>()?;
        all.sort_by_key(|pack| (pack.version.major, pack.version.minor));
        let whole = all.iter().rev().find(|pack| pack.judges_devices());
        let latest = whole.or(all.last()).cloned().ok_or(PackError::None)?;
        Ok(Self { all, latest })
    }

    /// All of them, oldest first.
    pub fn all(&self) -> &[Arc<Pack>] {
        &self.all
    }

    /// Those that devices of one side can be judged by, oldest first.
    pub fn of_role(&self, role: Role) -> impl Iterator<Item = &Arc<Pack>> {
        self.all.iter().filter(move |pack| pack.judges(role))
    }

    /// Those that devices of both sides can be judged by, oldest first.
    pub fn of_devices(&self) -> impl Iterator<Item = &Arc<Pack>> {
        self.all.iter().filter(|pack| pack.judges_devices())
    }

    /// The newest that devices of both sides can be judged by.
    pub fn latest(&self) -> &Arc<Pack> {
        &self.latest
    }

    /// The pack of a version, whatever its patch level.
    #[must_use]
    pub fn get(&self, version: &str) -> Option<&Arc<Pack>> {
        let version: Version = version.parse().ok()?;
        self.all
            .iter()
            .find(|pack| (pack.version.major, pack.version.minor) == (version.major, version.minor))
    }

    /// The pack by which the devices of one side are judged that speak a version.
    ///
    /// # Errors
    /// There is no such version, or devices of this side cannot be judged by it.
    pub fn for_devices(&self, version: &str, role: Role) -> Result<&Arc<Pack>, NoPack> {
        let pack = self.find(version)?;
        let (version, others) = (pack.version, || listed(self.of_role(role)));
        if pack.judges(role) {
            Ok(pack)
        } else if [Role::Agv, Role::MasterControl].iter().any(|other| pack.judges(*other)) {
            Err(NoPack::OtherSideOnly {
                version,
                role,
                others: others(),
            })
        } else {
            Err(NoPack::MessagesOnly {
                version,
                others: others(),
            })
        }
    }

    /// The pack of a version, whatever its patch level.
    ///
    /// # Errors
    /// There is no such version.
    pub fn find(&self, version: &str) -> Result<&Arc<Pack>, NoPack> {
        self.get(version).ok_or_else(|| NoPack::Unknown {
            version: version.to_owned(),
            known: listed(self.all.iter()),
        })
    }

    /// What a text that stands where a version is due is worth.
    #[must_use]
    pub fn said(&self, text: &str) -> VersionClaim<'_> {
        if let Some(pack) = self.get(text) {
            return VersionClaim::Known(pack);
        }
        match text.parse::<Version>() {
            Ok(version) if self.may_exist(version) => VersionClaim::Unknown(version),
            _ => VersionClaim::NoVersion,
        }
    }

    /// Whether such a version of the protocol exists, or may come to exist.
    fn may_exist(&self, version: Version) -> bool {
        let newest = self.all.last().map_or(self.latest.version, |newest| newest.version);
        let is_later = (version.major, version.minor) > (newest.major, newest.minor);
        is_later || EARLIER.contains(&(version.major, version.minor))
    }

    /// The pack by which somebody is judged who names no version: that of the text without what makes it none, of the major
    /// version in the topics, or the newest.
    #[must_use]
    pub fn nearest(&self, text: &str, major: Option<u64>) -> &Arc<Pack> {
        let number = text.trim().trim_start_matches(['v', 'V']);
        let of_major = || self.all.iter().rev().find(|pack| Some(pack.version.major) == major);
        self.get(number).or_else(of_major).unwrap_or(&self.latest)
    }
}

/// Versions that were published before those that there are rules for.
const EARLIER: [(u64, u64); 2] = [(1, 0), (1, 1)];

/// What a text is worth that stands where a version is due.
#[derive(Clone, Debug)]
pub enum VersionClaim<'p> {
    /// A version that there are rules for.
    Known(&'p Arc<Pack>),
    /// A version that there are no rules for.
    Unknown(Version),
    /// No version that was ever published.
    NoVersion,
}

/// Why there is no pack for what is asked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoPack {
    /// There are no rules for it.
    #[error("there is no protocol version {version}")]
    Unknown {
        /// What was asked for.
        version: String,
        /// Those that there are, in words.
        known: String,
    },
    /// There are no tests and no reference devices of it.
    #[error(
        "of protocol version {version} only messages can be judged: there are no tests and no reference devices of it yet"
    )]
    MessagesOnly {
        /// The version.
        version: Version,
        /// Those that devices can be judged by, in words.
        others: String,
    },
    /// There are tests and reference devices of the other side only.
    #[error(
        "of protocol version {version} no {role} can be judged: there are no tests and no reference devices for it yet"
    )]
    OtherSideOnly {
        /// The version.
        version: Version,
        /// The side that cannot be judged.
        role: Role,
        /// Those that such devices can be judged by, in words.
        others: String,
    },
}

impl NoPack {
    /// A word for programs.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Unknown { .. } => "unknown-version",
            Self::MessagesOnly { .. } => "messages-only",
            Self::OtherSideOnly { .. } => "other-side-only",
        }
    }

    /// What can be done instead.
    #[must_use]
    pub fn hint(&self) -> String {
        match self {
            Self::Unknown { known, .. } => format!("known versions: {known}"),
            Self::MessagesOnly { others, .. } | Self::OtherSideOnly { others, .. } => {
                format!("`validate`, `audit` and `watch` judge its messages; devices are judged by {others}")
            }
        }
    }
}

/// Versions in one line.
fn listed<'p>(packs: impl Iterator<Item = &'p Arc<Pack>>) -> String {
    packs
        .map(|pack| pack.version.to_string())
        .collect::<Vec<_>>()
        .join(", ")
}
