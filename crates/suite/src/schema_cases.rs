//! `cases: { from-schema: … }`: the rows of a table, made from the schemas of the versions a test claims.
//!
//! Every row has the values `patch`, which breaks the message, `member`, what it breaks, and `optional`, the optional
//! member it lies in. A row that not all claimed versions have claims only those that have it.

use std::collections::BTreeMap;

use serde_json::Value;

use super::fields::{Fields, Problems, text_of, word_of};
use super::lint::Vocabulary;
use super::model::{Drawn, Kind as Origin};
use super::steps::version_range;
use tck_base::diagnostic::Span;
use tck_base::yaml::{self, Kind, Node};
use tck_pack::{Breakage, BreakageScope, Version, VersionRange, Way};

/// What makes a table one of these.
pub(super) const FROM_SCHEMA: &str = "from-schema";

const KEYS: &[&str] = &[FROM_SCHEMA, "of", "below", "ways", "elements", "holding", "draw"];

/// The values every row has.
const VALUES: [&str; 3] = ["patch", "member", "optional"];

/// How many cases a run takes unless said.
const USUAL_DRAW: u32 = 8;

/// The highest index of an element that can be broken, and the most cases a run can take.
const MOST: u32 = 1_000;

/// Which members are broken.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    /// What every message has.
    Header,
    /// What has to be there.
    Required,
    /// What may be left out, and what lies in it.
    Optional,
}

const PARTS: [(&str, Part); 3] = [
    ("header", Part::Header),
    ("required", Part::Required),
    ("optional", Part::Optional),
];

/// One row.
pub(super) struct Row {
    /// Its name.
    pub(super) name: String,
    /// Its values.
    pub(super) values: Vec<(Node, Node)>,
    /// The versions that have it; those of the test unless said.
    pub(super) spec: Option<VersionRange>,
    /// What it is.
    pub(super) drawn: Drawn,
}

/// What is written under `cases:`.
struct Wanted<'a> {
    topic: &'a str,
    parts: Vec<Part>,
    below: Option<&'a str>,
    ways: Vec<Way>,
    ground: BreakageScope,
    draw: usize,
}

/// The rows of a table; none if something is wrong with it.
pub(super) fn rows(
    cases: &Node,
    spec: Option<&Node>,
    vocabulary: &dyn Vocabulary,
    problems: &mut Problems,
) -> Vec<Row> {
    let before = problems.len();
    let Some(fields) = Fields::of(cases, problems) else {
        return Vec::new();
    };
    let Some(wanted) = wanted(&fields, cases, problems).filter(|_| problems.len() == before) else {
        return Vec::new();
    };
    // A range that cannot be read is told where the header is read.
    let Some(range) = spec.and_then(|node| version_range(node, &mut Problems::default())) else {
        return Vec::new();
    };
    let versions = vocabulary.versions();
    let claimed: Vec<usize> = (0..versions.len())
        .filter(|pack| range.contains(versions[*pack]))
        .collect();
    let mut found: Vec<(Breakage, Vec<usize>)> = Vec::new();
    let mut known = false;
    for pack in &claimed {
        let Some(all) = vocabulary.breakages(*pack, wanted.topic, &wanted.ground) else {
            continue;
        };
        known = true;
        let header = header(*pack, vocabulary);
        for one in all.into_iter().filter(|one| wanted.takes(one, &header)) {
            match found.iter_mut().find(|(other, _)| *other == one) {
                Some((_, packs)) => packs.push(*pack),
                None => found.push((one, vec![*pack])),
            }
        }
    }
    let at = fields.get(FROM_SCHEMA, problems).map_or(&cases.span, |node| &node.span);
    if !known && !claimed.is_empty() {
        let topics: Vec<String> = claimed
            .iter()
            .flat_map(|pack| vocabulary.topics(*pack))
            .map(|(name, _)| name)
            .collect();
        problems.unknown(
            "unknown-topic",
            at,
            "topic",
            wanted.topic,
            topics.iter().map(String::as_str),
        );
    } else if found.is_empty() && !claimed.is_empty() {
        problems.at(
            "no-cases",
            &cases.span,
            "a table without rows",
            "no member of the schema can be broken so",
        );
    }
    let mut names: BTreeMap<String, usize> = BTreeMap::new();
    found
        .into_iter()
        .map(|(one, packs)| {
            let mut name = format!("{}-{}", one.member, one.way.word());
            let times = names.entry(name.clone()).or_default();
            *times += 1;
            if let (Some(first), true) = (packs.first(), *times > 1) {
                // The same member, broken otherwise in another version.
                name = format!("{name}-{}", versions[*first]);
            }
            Row {
                name,
                spec: (packs != claimed).then(|| range_of(&packs, &versions)).flatten(),
                values: values(&one, wanted.topic, at),
                drawn: Drawn {
                    kind: Origin::Schema(wanted.topic.to_owned(), one.way),
                    draw: wanted.draw,
                },
            }
        })
        .collect()
}

impl Wanted<'_> {
    fn takes(&self, one: &Breakage, header: &[String]) -> bool {
        let first = one.member.split('.').next().unwrap_or_default();
        let part = match one.optional {
            _ if header.iter().any(|name| name == first) => Part::Header,
            Some(_) => Part::Optional,
            None => Part::Required,
        };
        let inside = |below: &str| one.member.strip_prefix(below).is_some_and(|rest| rest.starts_with('.'));
        self.parts.contains(&part) && self.below.is_none_or(inside) && self.ways.contains(&one.way)
    }
}

fn wanted<'a>(fields: &Fields<'a>, cases: &Node, problems: &mut Problems) -> Option<Wanted<'a>> {
    fields.only(&[KEYS], problems);
    let mut parts = Vec::new();
    for node in fields.list("of", problems) {
        if let Some(text) = text_of(node, problems) {
            parts.extend(word_of(
                text,
                &node.span,
                "part of a message",
                "unknown-word",
                &PARTS,
                problems,
            ));
        }
    }
    if !fields.has("of") {
        parts.push(Part::Required);
    }
    let mut ways = Vec::new();
    for node in fields.list("ways", problems) {
        if let Some(text) = text_of(node, problems) {
            ways.extend(word_of(
                text,
                &node.span,
                "way to break a member",
                "unknown-word",
                &Way::ALL,
                problems,
            ));
        }
    }
    if !fields.has("ways") {
        ways.extend(Way::ALL.map(|(_, way)| way));
    }
    let mut ground = BreakageScope::default();
    if let Some(node) = fields.get("elements", problems)
        && let Some(elements) = Fields::of(node, problems)
    {
        for (key, _) in elements.entries() {
            let name = key.text().unwrap_or_default();
            let index = elements.whole_number(name, MOST, problems).unwrap_or(0);
            ground.elements.insert(name.to_owned(), index as usize);
        }
    }
    if let Some(node) = fields.get("holding", problems)
        && let Some(holding) = Fields::of(node, problems)
    {
        for (key, value) in holding.entries() {
            if value.map().is_none() {
                problems.wrong_type(value, "a mapping");
            }
            ground
                .holding
                .insert(key.text().unwrap_or_default().to_owned(), yaml::value(value));
        }
    }
    let draw = fields.whole_number("draw", MOST, problems);
    Some(Wanted {
        topic: fields.need_text(FROM_SCHEMA, &cases.span, problems)?,
        parts,
        below: fields.text("below", problems),
        ways,
        ground,
        draw: draw.unwrap_or(USUAL_DRAW).max(1) as usize,
    })
}

/// The members that every message of a version has.
fn header(pack: usize, vocabulary: &dyn Vocabulary) -> Vec<String> {
    let mut topics = vocabulary.topics(pack).into_iter();
    let Some((first, _)) = topics.next() else {
        return Vec::new();
    };
    let mut common = vocabulary.members(pack, &first, &[]);
    for (topic, _) in topics {
        let members = vocabulary.members(pack, &topic, &[]);
        common.retain(|name| members.contains(name));
    }
    common
}

/// The versions from the first to the last of these.
fn range_of(packs: &[usize], versions: &[Version]) -> Option<VersionRange> {
    let (first, last) = (packs.first()?, packs.last()?);
    format!(">={}, <={}", versions[*first], versions[*last]).parse().ok()
}

fn values(one: &Breakage, topic: &str, at: &Span) -> Vec<(Node, Node)> {
    let optional = one.optional.as_deref().unwrap_or(&one.member);
    let given = [
        one.patch.clone(),
        Value::String(format!("{topic}.{}", one.member)),
        Value::String(format!("{topic}.{optional}")),
    ];
    let names = VALUES.map(|name| node(&Value::String(name.to_owned()), at));
    names
        .into_iter()
        .zip(given.iter().map(|value| node(value, at)))
        .collect()
}

/// A value as if it stood at a place of the file.
fn node(value: &Value, at: &Span) -> Node {
    let kind = match value {
        Value::Null => Kind::Null,
        Value::Bool(flag) => Kind::Bool(*flag),
        Value::Number(number) => Kind::Number(number.clone()),
        Value::String(text) => Kind::Text {
            value: text.clone(),
            quoted: true,
        },
        Value::Array(items) => Kind::List(items.iter().map(|item| node(item, at)).collect()),
        Value::Object(members) => Kind::Map(
            members
                .iter()
                .map(|(key, value)| (node(&Value::String(key.clone()), at), node(value, at)))
                .collect(),
        ),
    };
    Node { kind, span: at.clone() }
}
