//! The messages of one device, judged by the version it speaks and by a later one.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use bytes::Bytes;
use serde_json::Value;

use super::super::result::Recording;
use super::super::{Audit, AuditError, Options};
use super::members::compared;
use super::model::{Breach, Migration, TopicChange, TopicTerms};
use super::requirements;
use tck_capture::Message;
use tck_judge::{Library, MessageTally, Rules};
use tck_pack::{Finding, FindingKind, NoPack, Pack, Role, VersionClaim};
use tck_result::MessageCoverage;
use tck_suite::model::Recordings;
use tck_view::{ErrorView, Header, MessageView, Names, StateView, Topic};

/// Format of the result.
const FORMAT: &str = "vda5050-tck.migrate/1";
/// How many topics and vehicles are told apart.
const MOST: usize = 10_000;
/// How many different places are kept in which something is wrong.
const PLACES: usize = 512;
/// How many vehicles are named where there are too many.
const NAMED: usize = 10;

/// What is compared.
#[derive(Clone, Debug)]
pub struct MigrateOptions {
    /// The later version.
    pub to: String,
    /// The version that the device speaks, whatever its messages say.
    pub protocol: Option<String>,
    /// Which side the device is.
    pub role: Role,
    /// Only this vehicle, or those that the master control commands: serial number, or manufacturer/number.
    pub vehicles: Vec<String>,
    /// How topics are built, where a site has renamed them.
    pub topic_template: Option<String>,
}

/// Why nothing can be said.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum MigrateError {
    /// There are no rules for a version.
    #[error(transparent)]
    Version(#[from] NoPack),
    /// The topics cannot be read.
    #[error(transparent)]
    Audit(#[from] AuditError),
    /// The device speaks the later version, or one behind it.
    #[error("it speaks VDA 5050 {spoken}, which is not earlier than {to}")]
    NotEarlier {
        /// What it speaks.
        spoken: String,
        /// What was asked for.
        to: String,
    },
    /// There is more than one vehicle.
    #[error("the recording has {count} vehicles, and a migration is about one: {some}")]
    Several {
        /// How many.
        count: usize,
        /// Some of them, in words.
        some: String,
    },
    /// No message says anything.
    #[error("no message of the {0} was found that names a version of the protocol")]
    Nothing(Role),
}

/// Is shown the messages of a recording, and says what the device that sends them has to change.
pub struct Migrating<'r> {
    library: &'r Library,
    role: Role,
    to: Arc<Pack>,
    /// The version that it speaks, where the messages are not asked.
    told: Option<Arc<Pack>>,
    /// The version it speaks, and what came of its members, once that is known.
    spoken: Option<(Arc<Pack>, MessageTally)>,
    /// A version that it names and that is not earlier.
    later: Option<String>,
    before: Audit<'r>,
    after: Audit<'r>,
    vehicles: BTreeSet<(String, String)>,
    /// Topics that are seen on their way from the sender: what the broker hands on is a copy.
    first_hand: BTreeSet<String>,
    messages: u64,
    left_out: u64,
    breaches: BTreeMap<(String, String, FindingKind), Breach>,
    /// In how many messages an error of a type came that the version names.
    errors: BTreeMap<String, u64>,
}

/// The monitors that judge a message by itself.
fn each_by_itself(rules: &Rules) -> Vec<String> {
    let monitors = rules.suites.monitors.iter().filter(|monitor| {
        matches!(
            monitor.recordings,
            Recordings::Message | Recordings::MessageOnTopic | Recordings::MessageAndFactsheet
        )
    });
    monitors.map(|monitor| monitor.id.clone()).collect()
}

/// Whether a version came before another one.
fn is_earlier(one: &Pack, other: &Pack) -> bool {
    (one.version.major, one.version.minor) < (other.version.major, other.version.minor)
}

impl<'r> Migrating<'r> {
    /// Begins.
    ///
    /// # Errors
    /// There are no rules for a version, the version it is said to speak is not earlier, or topics cannot be read so.
    pub fn new(library: &'r Library, options: MigrateOptions) -> Result<Self, MigrateError> {
        let rules = &library.rules;
        let to = Arc::clone(rules.packs.find(&options.to)?);
        let told = options.protocol.as_deref().map(|told| rules.packs.find(told));
        let told = told.transpose()?.cloned();
        if let Some(told) = told.as_ref().filter(|told| !is_earlier(told, &to)) {
            return Err(MigrateError::NotEarlier {
                spoken: told.version.to_string(),
                to: to.version.to_string(),
            });
        }
        let audit = |protocol: Option<String>| {
            let options = Options {
                topic_template: options.topic_template.clone(),
                vehicles: options.vehicles.clone(),
                only: each_by_itself(rules),
                protocol,
                shard: None,
                cut: None,
            };
            Audit::new(rules, options)
        };
        Ok(Self {
            library,
            role: options.role,
            before: audit(told.as_ref().map(|told| told.id.clone()))?,
            after: audit(Some(to.id.clone()))?,
            to,
            told,
            spoken: None,
            later: None,
            vehicles: BTreeSet::new(),
            first_hand: BTreeSet::new(),
            messages: 0,
            left_out: 0,
            breaches: BTreeMap::new(),
            errors: BTreeMap::new(),
        })
    }

    /// Shows it the next message.
    pub fn take(&mut self, message: Message) {
        let Some(address) = self.before.address(&message.topic) else {
            return;
        };
        if self.is_copy(&message) || !self.is_own(&address.name) {
            return;
        }
        if self.vehicles.len() < MOST {
            self.vehicles.insert((address.manufacturer, address.serial_number));
        }
        let Ok(value) = serde_json::from_slice::<Value>(&message.payload) else {
            self.left_out += 1;
            return;
        };
        let Some(from) = self.version(&value) else {
            self.left_out += 1;
            return;
        };
        self.messages += 1;
        self.count_errors(&address.name, &value, &from);
        let after = self.spelled(&address.name, value, &from);
        if let Some(schema) = self.to.schema(&address.name) {
            // Of a list several elements of one message may be wrong alike.
            let mut wrong: BTreeMap<(String, FindingKind), Finding> = BTreeMap::new();
            for finding in schema.findings(&after) {
                wrong.entry((folded(&finding.path), finding.kind)).or_insert(finding);
            }
            for ((member, _), finding) in wrong {
                self.note(&address.name, member, finding, &message);
            }
            let topic = self.after.topics.with_major(&message.topic, self.to.version.major);
            self.after.observe(Message {
                topic,
                payload: Bytes::from(after.to_string()),
                carried: None,
                ..message.clone()
            });
        }
        self.before.observe(Message {
            carried: None,
            ..message
        });
    }

    /// Whether the device sends messages of this topic.
    fn is_own(&self, name: &str) -> bool {
        let mut rules = self
            .library
            .rules
            .packs
            .all()
            .iter()
            .filter_map(|pack| pack.topic(name));
        rules.next().is_some_and(|rule| rule.publisher == self.role)
    }

    /// Whether a broker hands on what is seen at its sender, too.
    fn is_copy(&mut self, message: &Message) -> bool {
        let Some(carried) = message.carried else { return false };
        if carried.sent {
            if self.first_hand.len() < MOST {
                self.first_hand.insert(message.topic.clone());
            }
            return false;
        }
        self.first_hand.contains(&message.topic)
    }

    /// The version that a message is of; `None` where it is left out.
    fn version(&mut self, message: &Value) -> Option<Arc<Pack>> {
        let packs = &self.library.rules.packs;
        let view = MessageView::of_value(Topic::Other, message, &Names::default());
        let named = match packs.said(view.header().version.or_empty()) {
            VersionClaim::Known(pack) => Some(pack),
            VersionClaim::Unknown(_) | VersionClaim::NoVersion => None,
        };
        match (&self.spoken, self.told.as_ref().or(named)) {
            (Some((spoken, _)), Some(pack)) if spoken.id != pack.id => None,
            (Some((spoken, _)), _) => Some(Arc::clone(spoken)),
            (None, Some(pack)) if is_earlier(pack, &self.to) => {
                let pack = Arc::clone(pack);
                self.spoken = Some((Arc::clone(&pack), MessageTally::new(&pack)));
                Some(pack)
            }
            (None, Some(pack)) => {
                self.later = Some(pack.version.to_string());
                None
            }
            (None, None) => None,
        }
    }

    /// Counts members, words and types of errors.
    fn count_errors(&mut self, name: &str, message: &Value, from: &Pack) {
        if let Some((_, tally)) = &mut self.spoken {
            tally.note(name, message);
        }
        if Topic::of_name(name) != Topic::State {
            return;
        }
        let known = from.vocabulary().get("error").and_then(Value::as_object);
        let errors = from.names().raw_elements(message, StateView::errors).iter();
        let types = errors.filter_map(|error| from.names().raw(error, &[ErrorView::error_type])?.as_str());
        let is_named = |word: &&str| known.is_some_and(|known| known.values().any(|named| named == *word));
        let types: BTreeSet<&str> = types.filter(is_named).collect();
        for word in types {
            *self.errors.entry(word.to_owned()).or_default() += 1;
        }
    }

    /// A message with the names, places and words of the later version, which it names in its header.
    fn spelled(&self, name: &str, mut message: Value, from: &Pack) -> Value {
        let object = Topic::of_name(name).object();
        from.names().unspell(object, &mut message);
        self.to.names().spell(object, &mut message);
        let version = Header::version.usual_name();
        if let Some(said) = message.get_mut(version).filter(|said| said.is_string()) {
            *said = self.to.version.to_string().into();
        }
        message
    }

    /// Notes what the schema of the later version finds wrong in a message.
    fn note(&mut self, topic: &str, member: String, finding: Finding, message: &Message) {
        let key = (topic.to_owned(), member.clone(), finding.kind);
        if let Some(known) = self.breaches.get_mut(&key) {
            known.messages += 1;
            return;
        }
        if self.breaches.len() >= PLACES {
            return;
        }
        let levels: Vec<&str> = finding.path.split('/').skip(1).collect();
        let requirement = self.to.requirement_of(topic, &levels, finding.kind);
        let breach = Breach {
            topic: topic.to_owned(),
            member,
            kind: finding.kind,
            requirement: requirement.map(str::to_owned),
            text: finding.message,
            messages: 1,
            recording: message.place.file,
            line: message.place.line,
        };
        self.breaches.insert(key, breach);
    }

    /// What the device has to change; the recording is at its end.
    ///
    /// # Errors
    /// Nothing was seen of it, it speaks the later version, or there are several.
    pub fn finish(self, recordings: Vec<Recording>) -> Result<Migration, MigrateError> {
        let (role, to) = (self.role, self.to);
        let named = |(manufacturer, number): &(String, String)| format!("{manufacturer}/{number}");
        if role == Role::Agv && self.vehicles.len() > 1 {
            let some: Vec<String> = self.vehicles.iter().take(NAMED).map(named).collect();
            return Err(MigrateError::Several {
                count: self.vehicles.len(),
                some: some.join(", "),
            });
        }
        let Some((from, tally)) = self.spoken else {
            return Err(match self.later {
                Some(spoken) => MigrateError::NotEarlier {
                    spoken,
                    to: to.version.to_string(),
                },
                None => MigrateError::Nothing(role),
            });
        };
        let device = match (role, self.vehicles.first()) {
            (Role::Agv, Some(vehicle)) => named(vehicle),
            _ => "the master control".to_owned(),
        };
        let (now, then) = (self.before.finish(Vec::new()), self.after.finish(Vec::new()));
        let seen: MessageCoverage = tally.result();
        let compared = compared(&from, &to, role, &seen, &self.errors);
        let mut breaches: Vec<Breach> = self.breaches.into_values().collect();
        breaches.sort_by_key(|breach| std::cmp::Reverse(breach.messages));
        Ok(Migration {
            format: FORMAT,
            tool: tck_journal::tool(),
            role,
            device,
            from: from.version.to_string(),
            to: to.version.to_string(),
            recordings,
            messages: self.messages,
            left_out: self.left_out,
            topics: topics(&from, &to, role),
            members: compared.members,
            words: compared.words,
            breaches,
            requirements: requirements::rows(self.library, (&from, &to), role, (&now, &then)),
        })
    }
}

/// A JSON pointer without the slash at its beginning, in which `*` is any element of a list.
fn folded(pointer: &str) -> String {
    let is_place = |level: &str| !level.is_empty() && level.bytes().all(|byte| byte.is_ascii_digit());
    let levels = pointer.split('/').skip(1);
    let levels: Vec<&str> = levels.map(|level| if is_place(level) { "*" } else { level }).collect();
    levels.join("/")
}

/// The topics of a side that are new, gone, or published otherwise.
fn topics(from: &Pack, to: &Pack, role: Role) -> Vec<TopicChange> {
    let terms = |pack: &Pack, name: &str| {
        let rule = pack.topic(name).filter(|rule| rule.publisher == role)?;
        Some(TopicTerms {
            qos: rule.qos,
            retain: rule.retain,
            mandatory: rule.mandatory,
        })
    };
    let all = from.topics().iter().chain(to.topics());
    let names: BTreeSet<&str> = all.map(|rule| rule.name.as_str()).collect();
    let changes = names.into_iter().map(|name| TopicChange {
        topic: name.to_owned(),
        before: terms(from, name),
        after: terms(to, name),
    });
    changes.filter(|change| change.before != change.after).collect()
}
