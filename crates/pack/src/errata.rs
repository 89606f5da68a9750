//! Where the text of a version and the schemas published with it contradict each other: `errata.yaml` of a pack.
//!
//! A device may keep to any of the readings. What the schema of the pack finds counts for nothing where another reading has what
//! stands there, and the reading can be named.

use std::sync::Arc;

use serde::Deserialize;
use serde_json::Value;

use super::validator::Validator;

/// How many places of one message are looked at for one erratum.
const PLACES: usize = 512;

/// One contradiction, as the file has it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Erratum {
    #[serde(rename = "erratum")]
    name: String,
    at: Vec<Place>,
    member: Option<String>,
    readings: Readings,
}

/// Topic and path, `*` being one member or place in a list.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "String")]
struct Place {
    topic: String,
    path: Vec<String>,
}

impl TryFrom<String> for Place {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let mut parts = text.split('/').map(str::to_owned);
        let topic = parts.next().filter(|topic| !topic.is_empty());
        let topic = topic.ok_or_else(|| format!("`{text}` names no topic"))?;
        let path: Vec<String> = parts.collect();
        if path.is_empty() || path.iter().any(String::is_empty) {
            return Err(format!("`{text}` names no place in a message"));
        }
        Ok(Self { topic, path })
    }
}

/// Readings of one place: the usual one and others.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "Vec<RawReading>")]
struct Readings(Arc<[Reading]>);

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawReading {
    reading: String,
    keeps: String,
    is: Value,
}

#[derive(Debug)]
struct Reading {
    /// Where it can be read.
    source: String,
    /// What a device of this reading does.
    keeps: String,
    is: Validator,
}

impl TryFrom<Vec<RawReading>> for Readings {
    type Error = String;

    fn try_from(all: Vec<RawReading>) -> Result<Self, String> {
        if all.len() < 2 {
            return Err("one reading alone is no contradiction".to_owned());
        }
        let read = |raw: RawReading| {
            Ok(Reading {
                is: Validator::of(&raw.is)?,
                source: raw.reading,
                keeps: raw.keeps,
            })
        };
        Ok(Self(all.into_iter().map(read).collect::<Result<_, String>>()?))
    }
}

/// A contradiction about the messages of one topic.
#[derive(Clone, Debug)]
pub(super) struct Disputed {
    erratum: String,
    at: Vec<Vec<String>>,
    member: Option<String>,
    readings: Readings,
}

/// A reading that a message keeps to where the published text and schemas contradict each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeptReading {
    /// What the contradiction is called in the data of the version.
    pub erratum: String,
    /// Where it shows first, as a JSON pointer.
    pub pointer: String,
    /// Where the reading stands.
    pub source: String,
    /// What a device of this reading does, in a few words.
    pub keeps: String,
}

impl Erratum {
    /// What it says about the messages of a topic.
    pub(super) fn of_topic(&self, topic: &str) -> Option<Disputed> {
        let at: Vec<_> = self.at.iter().filter(|place| place.topic == topic).collect();
        (!at.is_empty()).then(|| Disputed {
            erratum: self.name.clone(),
            at: at.into_iter().map(|place| place.path.clone()).collect(),
            member: self.member.clone(),
            readings: self.readings.clone(),
        })
    }
}

impl Disputed {
    /// Whether what is wrong at a place of a message is about this, and another reading has what stands there.
    pub(super) fn excuses(&self, place: &str, is_missing: bool, message: &Value) -> bool {
        let holder = match &self.member {
            None => Some(place),
            Some(member) => place
                .strip_suffix(member.as_str())
                .and_then(|holder| holder.strip_suffix('/'))
                .filter(|_| is_missing),
        };
        let Some(holder) = holder.filter(|holder| self.at.iter().any(|path| fits(path, holder))) else {
            return false;
        };
        let mut others = self.readings.0.iter().skip(1);
        let stands_there = message.pointer(holder);
        stands_there.is_some_and(|value| others.any(|reading| reading.is.is_valid(value)))
    }

    /// The reading a message keeps to, where it can be told and is not the usual one.
    pub(super) fn kept(&self, message: &Value) -> Option<KeptReading> {
        let mut places = Vec::new();
        for path in &self.at {
            collect(message, path, String::new(), &mut places);
        }
        places.into_iter().find_map(|(pointer, value)| {
            let all = self.readings.0.iter().enumerate();
            let mut fitting = all.filter(|(_, reading)| reading.is.is_valid(value));
            let (at, reading) = fitting.next()?;
            (at > 0 && fitting.next().is_none()).then(|| KeptReading {
                erratum: self.erratum.clone(),
                pointer,
                source: reading.source.clone(),
                keeps: reading.keeps.clone(),
            })
        })
    }
}

/// Whether a pointer leads to a place of this path.
fn fits(path: &[String], pointer: &str) -> bool {
    let parts = pointer.split('/').skip(1);
    parts.clone().count() == path.len() && path.iter().zip(parts).all(|(name, part)| name == "*" || name == part)
}

/// What stands at the end of a path, each with its pointer.
fn collect<'v>(value: &'v Value, path: &[String], pointer: String, found: &mut Vec<(String, &'v Value)>) {
    if found.len() >= PLACES {
        return;
    }
    let Some((name, rest)) = path.split_first() else {
        found.push((pointer, value));
        return;
    };
    match value {
        Value::Array(items) if name == "*" => {
            for (at, item) in items.iter().enumerate().take(PLACES) {
                collect(item, rest, format!("{pointer}/{at}"), found);
            }
        }
        Value::Object(members) => {
            if let Some(inside) = members.get(name) {
                collect(inside, rest, format!("{pointer}/{name}"), found);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn disputed(erratum: Value) -> Result<Disputed, String> {
        let read: Result<Erratum, _> = serde_json::from_value(erratum);
        read.map_err(|error| error.to_string())
            .map(|one| one.of_topic("sheet").expect("its topic"))
    }

    fn name() -> Disputed {
        disputed(json!({
            "erratum": "name", "at": ["sheet/kind"], "member": "kinematics", "readings": [
                { "reading": "text", "keeps": "kinematics", "is": { "required": ["kinematics"] } },
                { "reading": "schema", "keeps": "kinematic", "is": { "required": ["kinematic"] } }
            ]
        }))
        .expect("an erratum")
    }

    #[test]
    fn another_name_is_no_finding_and_is_named() {
        let message = json!({ "kind": { "kinematic": "X" } });
        let one = name();
        assert!(one.excuses("/kind/kinematics", true, &message));
        assert!(!one.excuses("/kind/class", true, &message));
        assert!(!one.excuses("/kinematics", true, &message));
        assert!(!one.excuses("/kind/kinematics", false, &message));
        let kept = one.kept(&message).expect("a reading");
        assert_eq!((kept.pointer.as_str(), kept.source.as_str()), ("/kind", "schema"));
    }

    #[test]
    fn the_usual_reading_and_what_cannot_be_told_are_not_named() {
        let one = name();
        for message in [
            json!({ "kind": { "kinematics": "X" } }),
            json!({ "kind": { "kinematics": "X", "kinematic": "X" } }),
            json!({ "kind": {} }),
            json!({}),
            json!(7),
        ] {
            assert_eq!(one.kept(&message), None, "{message}");
        }
        assert!(!one.excuses("/kind/kinematics", true, &json!({ "kind": {} })));
    }

    #[test]
    fn a_value_is_read_in_every_place_of_a_list() {
        let one = disputed(json!({
            "erratum": "flag", "at": ["sheet/list/*/flag"], "readings": [
                { "reading": "text", "keeps": "is a flag", "is": { "type": "boolean" } },
                { "reading": "schema", "keeps": "is a text", "is": { "enum": ["true", "false"] } }
            ]
        }))
        .expect("an erratum");
        let message = json!({ "list": [{ "flag": true }, { "flag": "false" }, { "flag": "no" }, 7] });
        assert_eq!(one.kept(&message).expect("a reading").pointer, "/list/1/flag");
        assert!(one.excuses("/list/1/flag", false, &message));
        assert!(!one.excuses("/list/2/flag", false, &message));
        assert!(!one.excuses("/list/1", false, &message));
    }

    #[test]
    fn what_cannot_be_meant_is_refused() {
        let reading = json!({ "reading": "a", "keeps": "b", "is": {} });
        let of = |at: &str, readings: Value| {
            disputed(json!({ "erratum": "x", "at": [at], "readings": readings })).expect_err("refused")
        };
        assert!(of("sheet/a", json!([reading])).contains("no contradiction"));
        assert!(of("sheet", json!([reading, reading])).contains("names no place"));
        assert!(of("/a", json!([reading, reading])).contains("names no topic"));
        let broken = json!({ "reading": "a", "keeps": "b", "is": { "type": 7 } });
        assert!(!of("sheet/a", json!([reading, broken])).is_empty());
    }
}
