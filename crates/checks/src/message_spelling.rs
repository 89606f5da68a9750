//! Members of a message that are known ones but for their spelling.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use serde_json::Value;

use crate::finding::broken;
use tck_check::{CheckContext, CheckFinding};
use tck_pack::{Finding, MessageSchema, Pack};
use tck_view::{ActionView, Edge, Field, InstantActionsView, Node, OrderView, StateView, Topic, VisualizationView};

/// How the members of messages are spelled.
pub(super) struct Spelling {
    /// The member names of each topic's messages.
    members: BTreeMap<String, Vec<String>>,
    /// The member names of what is inside of messages, by topic and path.
    inner: Vec<Inner>,
}

/// Objects inside of the messages of a topic, and the members they have.
struct Inner {
    topic: Topic,
    /// The names on the way to them.
    path: Vec<String>,
    members: Vec<String>,
}

impl Inner {
    /// `None` where the version has no such objects.
    fn of(topic: Topic, path: &[Field], pack: &Pack) -> Option<Self> {
        let names: Option<Vec<&str>> = path.iter().map(|field| pack.names().name(*field)).collect();
        let names: Vec<&str> = names?.into_iter().flat_map(|name| name.split('/')).collect();
        Some(Self {
            topic,
            members: pack.schema(topic.as_str())?.members(&names),
            path: names.into_iter().map(str::to_owned).collect(),
        })
    }
}

impl Spelling {
    pub(super) fn new(context: &CheckContext<'_>) -> Self {
        let names = context.topics.keys();
        let members = names.filter_map(|name| Some((name.clone(), context.pack.schema(name)?.members(&[]))));
        let inner = INNER
            .iter()
            .filter_map(|(topic, path)| Inner::of(*topic, path, context.pack));
        Self {
            members: members.collect(),
            inner: inner.collect(),
        }
    }

    /// Optional members that are known ones but for their spelling; those that are missing by it were named with that.
    pub(super) fn misspelled(&self, topic: &str, value: &Value, seq: u64, findings: &mut Vec<CheckFinding>) {
        let whole = Inside {
            value,
            places: [None; DEEPEST],
        };
        if let Some(known) = self.members.get(topic) {
            odd_members(topic, &[], vec![whole], known, seq, findings);
        }
        for Inner { path, members, .. } in self.inner.iter().filter(|inner| inner.topic.as_str() == topic) {
            let mut inside = vec![whole];
            for (level, name) in path.iter().enumerate() {
                let all = inside.iter().flat_map(|one| one.inner(level, name));
                inside = all.take(INSIDE).collect();
            }
            odd_members(topic, path, inside, members, seq, findings);
        }
    }
}

/// What is inside of messages and has members of its own.
const INNER: [(Topic, &[Field]); 16] = [
    (Topic::State, &[StateView::safety_state]),
    (Topic::State, &[StateView::battery_state]),
    (Topic::State, &[StateView::position]),
    (Topic::State, &[StateView::velocity]),
    (Topic::State, &[StateView::errors]),
    (Topic::Visualization, &[VisualizationView::position]),
    (Topic::Visualization, &[VisualizationView::velocity]),
    (Topic::Order, &[OrderView::nodes]),
    (Topic::Order, &[OrderView::nodes, Node::node_position]),
    (Topic::Order, &[OrderView::nodes, Node::actions]),
    (
        Topic::Order,
        &[OrderView::nodes, Node::actions, ActionView::action_parameters],
    ),
    (Topic::Order, &[OrderView::edges]),
    (Topic::Order, &[OrderView::edges, Edge::actions]),
    (Topic::Order, &[OrderView::edges, Edge::corridor]),
    (Topic::Order, &[OrderView::edges, Edge::trajectory]),
    (Topic::InstantActions, &[InstantActionsView::actions]),
];
/// How many of them are looked at.
const INSIDE: usize = 512;

/// How many names lead to the deepest of them, at most.
const DEEPEST: usize = 6;

/// What is inside of a message, and its place in each list on the way to it.
#[derive(Clone, Copy)]
struct Inside<'v> {
    value: &'v Value,
    places: [Option<usize>; DEEPEST],
}

impl<'v> Inside<'v> {
    /// What goes by a name inside of this: the elements of a list, or the one that stands there.
    fn inner(&self, level: usize, name: &str) -> impl Iterator<Item = Self> + use<'v> {
        let mut places = self.places;
        let found = self.value.get(name);
        let (list, one) = match found {
            Some(Value::Array(list)) => (list.as_slice(), None),
            one => (&[][..], one),
        };
        let elements = list.iter().take(INSIDE).enumerate();
        let elements = elements.map(move |(at, value)| {
            if let Some(place) = places.get_mut(level) {
                *place = Some(at);
            }
            Self { value, places }
        });
        elements.chain(one.map(|value| Self { value, places }))
    }

    /// Where it stands.
    fn place(&self, topic: &str, path: &[String]) -> String {
        let mut place = topic.to_owned();
        for (name, at) in path.iter().zip(self.places) {
            let _ = write!(place, "/{name}");
            if let Some(at) = at {
                let _ = write!(place, "/{at}");
            }
        }
        place
    }
}

/// Members of these objects that are known ones but for their spelling. Where the right one stands beside it, it is one of the
/// vendor's own.
fn odd_members(
    topic: &str,
    path: &[String],
    objects: Vec<Inside<'_>>,
    known: &[String],
    seq: u64,
    findings: &mut Vec<CheckFinding>,
) {
    // The same mistake is made everywhere; once is enough.
    let mut said = BTreeSet::new();
    for inside in objects {
        let value = inside.value;
        let odd = value.as_object().into_iter().flatten().map(|(name, _)| name);
        for name in odd.filter(|name| name.len() < 64 && !known.contains(name)).take(16) {
            let meant = known.iter().find(|known| plain(known) == plain(name));
            let Some(meant) = meant.filter(|meant| value.get(meant.as_str()).is_none()) else {
                continue;
            };
            let place = inside.place(topic, path);
            let is_said = |finding: &CheckFinding| {
                finding.seq == seq && finding.message.starts_with(&format!("{place}/{meant}: "))
            };
            if !findings.iter().any(is_said) && said.insert(name.clone()) {
                let text = format!("{place}/{name}: this member is spelled {meant:?}");
                findings.push(broken("JSON-01", seq, text));
            }
        }
    }
}

/// The member that stands there instead of one that is missing: the same but for its spelling, or nearly the same.
pub(super) fn standing_instead<'v>(finding: &Finding, schema: &MessageSchema, value: &'v Value) -> Option<&'v str> {
    let (holder, name) = finding.path.rsplit_once('/')?;
    let members = value.pointer(holder)?.as_object()?;
    let path: Vec<&str> = holder
        .split('/')
        .skip(1)
        .filter(|part| part.parse::<u32>().is_err())
        .collect();
    let known = schema.members(&path);
    let odd = || {
        let names = members.keys().map(String::as_str);
        names.filter(|other| other.len() < 64 && !known.iter().any(|known| known == other))
    };
    odd()
        .find(|other| plain(other) == plain(name))
        .or_else(|| odd().find(|other| is_slip(other, name)))
}

/// Whether one name is the other but for a slip of the hand.
fn is_slip(one: &str, other: &str) -> bool {
    strsim::osa_distance(one, other) <= (other.len() / 4).min(2)
}

/// A name without what a spelling may differ in: capitals, and all that is no letter or digit.
pub(super) fn plain(name: &str) -> String {
    name.chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|character| character.to_ascii_lowercase())
        .collect()
}
