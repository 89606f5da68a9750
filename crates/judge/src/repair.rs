//! The states of a vehicle that makes a lasting mistake, read as they are meant.
//!
//! What is left out or mended is recorded in the journal as a [`Waiver`] before it counts, so that judging the journal
//! again comes to the same. A clause about the mistake itself is decided by the states as they are.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::sync::Arc;

use serde_json::{Value, json};

use super::eval_context::EvalContext;
use super::timeline::Timeline;
use tck_base::pattern::whole;
use tck_journal::Entry;
use tck_journal::event::{Event, Payload, Reading, Waiver};
use tck_pack::RequirementId;
use tck_view::{ActionState, EdgeState, Field, Member, Names, Node, NodeState, Number, OrderView, Position, StateView};

/// The topic that is mended.
const TOPIC: &str = "state";
/// A state with more bytes is shown to a check as it is.
const LARGEST: usize = 64 << 10;
/// How many earlier states are asked what was shown last.
const LOOK_BACK: usize = 100;
/// Two places no farther apart, in metres, are one.
const SAME_PLACE: f64 = 0.01;

/// The waivers that count for one clause, and which of them were needed.
#[derive(Clone, Debug, Default)]
pub(super) struct StateRepair {
    waivers: Vec<Waiver>,
    /// Nothing is decided, so that it does not matter whether an order of one node was taken or not.
    free: bool,
    used: RefCell<BTreeSet<String>>,
}

impl StateRepair {
    /// Those that are not about what is decided.
    pub(super) fn of(waivers: &[Waiver], subject: &str, decides: &[&RequirementId]) -> Self {
        let apart = |waiver: &&Waiver| {
            !decides
                .iter()
                .any(|id| waiver.about.iter().any(|own| own == id.as_str()))
        };
        let waivers = if subject == TOPIC { waivers } else { &[] };
        Self {
            waivers: waivers.iter().filter(apart).cloned().collect(),
            free: decides.is_empty(),
            used: RefCell::default(),
        }
    }

    /// Whether a state that is not what is looked for is so when it is read as it is meant.
    pub(super) fn make_up_for(&self, entry: &Entry, scene: &EvalContext<'_>, takes: impl Fn(&Value) -> bool) -> bool {
        if self.waivers.is_empty() {
            return false;
        }
        let Some(state) = entry.json() else { return false };
        let (mut state, mut used) =
            mended(entry, scene.timeline, &self.waivers).unwrap_or_else(|| (state.clone(), Vec::new()));
        let mut fits = !used.is_empty() && takes(&state);
        if !fits && self.free && self.name_order_of_one_node(&mut state, entry, scene) {
            used.extend(self.waivers.iter().filter(|waiver| waiver.reading == Reading::Kept));
            fits = takes(&state);
        }
        if fits {
            let told = used.into_iter().map(|waiver| waiver.why.clone());
            self.used.borrow_mut().extend(told);
        }
        fits
    }

    /// A vehicle that forgets its orders as soon as they are done may have done one of one node before it said a word.
    fn name_order_of_one_node(&self, state: &mut Value, entry: &Entry, scene: &EvalContext<'_>) -> bool {
        let mut sent = scene.entries.iter().rev().filter(|sent| sent.seq() < entry.seq());
        let order = sent.find_map(|sent| match sent.event() {
            Event::Sent { topic, .. } if scene.topics.get("order") == Some(topic) => sent.json(),
            _ => None,
        });
        let names = scene.timeline.names();
        let Some(order) = order else { return false };
        let [node] = names.raw_elements(order, OrderView::nodes) else {
            return false;
        };
        let shown = entry.json().and_then(|state| order_of(state, names));
        let mut all = self.waivers.iter();
        let forgot = all.any(|waiver| is_about(waiver, StateView::order_id, names) && waiver.reading == Reading::Kept);
        let is_there = names.raw(node, &[Node::node_id]) == names.raw(state, &[StateView::last_node_id]);
        if !forgot || !is_nothing(shown) || !is_there {
            return false;
        }
        for (sent, shown) in [
            (OrderView::order_id, StateView::order_id),
            (OrderView::order_update_id, StateView::order_update_id),
        ] {
            let value = names.raw(order, &[sent]).zip(names.name(shown));
            if let (Some((value, name)), Some(members)) = (value, state.as_object_mut()) {
                members.insert(name.to_owned(), value.clone());
            }
        }
        true
    }

    /// A state as it is meant, for a check that looks at whole messages.
    pub(super) fn read(&self, entry: &Entry, scene: &EvalContext<'_>) -> Option<Arc<Entry>> {
        let Event::Message { topic, payload, .. } = entry.event() else {
            return None;
        };
        if self.waivers.is_empty() || scene.topics.get(TOPIC) != Some(topic) || payload.bytes().len() > LARGEST {
            return None;
        }
        let (state, used) = mended(entry, scene.timeline, &self.waivers)?;
        let told = used.into_iter().map(|waiver| waiver.why.clone());
        self.used.borrow_mut().extend(told);
        let mut record = entry.record.clone();
        if let Event::Message { payload, .. } = &mut record.event {
            *payload = Payload::keep(state.to_string().into_bytes().into());
        }
        Some(Entry::new(record))
    }

    /// The waivers alone.
    pub(super) fn into_waivers(self) -> Vec<Waiver> {
        self.waivers
    }

    /// The mistakes that would have stood in the way.
    pub(super) fn used(&self) -> Vec<String> {
        self.used.borrow().iter().cloned().collect()
    }
}

/// Whether a waiver is about this member of a state.
fn is_about(waiver: &Waiver, member: Field, names: &Names) -> bool {
    names.name(member) == Some(&waiver.member)
}

/// Whether the state of an action is one that is not waited for any more.
pub(super) fn is_lasting(state: &Value, action: &str, waivers: &[Waiver], names: &Names) -> bool {
    let mut all = names.raw_elements(state, StateView::action_states).iter();
    let is_it = |one: &&Value| names.raw(one, &[ActionState::action_id]).and_then(Value::as_str) == Some(action);
    let Some(action) = all.find(is_it) else { return false };
    waivers.iter().any(|waiver| match &waiver.reading {
        Reading::Without { like } => is_about(waiver, StateView::action_states, names) && is_like(action, like),
        _ => false,
    })
}

/// What a status of an action means.
pub(super) fn status_meant<'w>(status: &str, waivers: &'w [Waiver]) -> Option<(&'w str, &'w Waiver)> {
    waivers.iter().find_map(|waiver| match &waiver.reading {
        Reading::Status { shown, meant } if shown == status => Some((meant.as_str(), waiver)),
        _ => None,
    })
}

/// A state as it is meant, with the waivers that changed it; `None` when none did.
pub(super) fn mended<'w>(
    entry: &Entry,
    timeline: &Timeline,
    waivers: &'w [Waiver],
) -> Option<(Value, Vec<&'w Waiver>)> {
    if waivers.is_empty() {
        return None;
    }
    let mut meant = entry.json()?.clone();
    let mut used = Vec::new();
    for waiver in waivers {
        if mend(&mut meant, entry, timeline, waiver).is_some() {
            used.push(waiver);
        }
    }
    (!used.is_empty()).then_some((meant, used))
}

/// Mends one member; `None` when there is nothing to mend.
fn mend(meant: &mut Value, entry: &Entry, timeline: &Timeline, waiver: &Waiver) -> Option<()> {
    let (state, names) = (entry.json()?, timeline.names());
    let member = waiver.member.as_str();
    match &waiver.reading {
        Reading::Passed => {
            let last = timeline.state(entry)?.last_node_sequence_id.whole()?;
            let sequence = match is_about(waiver, StateView::edge_states, names) {
                true => EdgeState::sequence_id,
                false => NodeState::sequence_id,
            };
            drop_elements(meant, member, |element| {
                let at = names.raw(element, &[sequence]).and_then(whole);
                at.is_some_and(|at| at <= last)
            })
        }
        Reading::Without { like } => drop_elements(meant, member, |element| is_like(element, like)),
        Reading::As { shown, meant: value } => {
            if state.get(member) != shown.as_ref() {
                return None;
            }
            meant.as_object_mut()?.insert(member.to_owned(), value.clone());
            Some(())
        }
        Reading::Status { shown, meant: word } => {
            let actions = meant.get_mut(member)?.as_array_mut()?;
            let status = names.name(ActionState::action_status)?;
            let mut changed = None;
            for action in actions {
                if action.get(status).and_then(Value::as_str) == Some(shown) {
                    action[status] = json!(word);
                    changed = Some(());
                }
            }
            changed
        }
        Reading::Kept => {
            if !is_nothing(state.get(member)) {
                return None;
            }
            // What holds on is what the order that was named last had, and never what an older one had. An order that is
            // named has forgotten nothing but what its own states have shown.
            let earlier = || before(timeline, entry.seq()).filter_map(Entry::json);
            let named = order_of(state, names).filter(|name| !is_nothing(Some(*name)));
            let of_order = |earlier: &&Value| match named {
                Some(name) => order_of(earlier, names) == Some(name),
                None => !is_nothing(order_of(earlier, names)),
            };
            let order = order_of(earlier().find(of_order)?, names)?;
            let own = earlier()
                .skip_while(|earlier| order_of(earlier, names) != Some(order))
                .take_while(|earlier| order_of(earlier, names) == Some(order));
            let kept = own
                .filter_map(|earlier| earlier.get(member))
                .find(|one| !is_nothing(Some(*one)))?;
            meant.as_object_mut()?.insert(member.to_owned(), kept.clone());
            Some(())
        }
        Reading::Standing => {
            let earlier = before(timeline, entry.seq()).find_map(|earlier| timeline.state(earlier))?;
            if state.get(member) != Some(&json!(true)) || !stays(timeline.state(entry)?, earlier) {
                return None;
            }
            meant.as_object_mut()?.insert(member.to_owned(), json!(false));
            Some(())
        }
    }
}

fn before(timeline: &Timeline, seq: u64) -> impl Iterator<Item = &Entry> {
    let all = timeline.of(TOPIC);
    let earlier = &all[..all.partition_point(|entry| entry.seq() < seq)];
    earlier.iter().rev().take(LOOK_BACK).map(AsRef::as_ref)
}

/// The orderId of a state, whatever it is.
fn order_of<'v>(state: &'v Value, names: &Names) -> Option<&'v Value> {
    names.raw(state, &[StateView::order_id])
}

fn drop_elements(meant: &mut Value, member: &str, drops: impl Fn(&Value) -> bool) -> Option<()> {
    let elements = meant.get_mut(member)?.as_array_mut()?;
    let all = elements.len();
    elements.retain(|element| !drops(element));
    (elements.len() < all).then_some(())
}

fn is_nothing(value: Option<&Value>) -> bool {
    match value {
        None | Some(Value::Null) => true,
        Some(Value::String(text)) => text.is_empty(),
        Some(Value::Number(number)) => number.as_f64() == Some(0.0),
        Some(_) => false,
    }
}

/// Whether an element shows every member of `like`.
fn is_like(element: &Value, like: &Value) -> bool {
    let Some(members) = like.as_object() else {
        return element == like;
    };
    members.iter().all(|(name, value)| element.get(name) == Some(value))
}

/// Whether two states show the vehicle at one place.
fn stays(one: &StateView, other: &StateView) -> bool {
    let positions = one.position.there().zip(other.position.there());
    positions.is_some_and(|(one, other)| {
        let same = |of: fn(&Position) -> &Member<Number>| match (of(one).float(), of(other).float()) {
            (Some(one), Some(other)) => (one - other).abs() < SAME_PLACE,
            _ => false,
        };
        same(|at| &at.x) && same(|at| &at.y) && same(|at| &at.theta)
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use tck_base::clock::{Moment, Stamp};
    use tck_journal::Journal;
    use tck_journal::event::{Occurrence, Source};
    use tck_pack::{Assets, Packs};

    fn waiver(member: &str, reading: Reading) -> Waiver {
        Waiver {
            member: member.to_owned(),
            reading,
            about: vec!["STATE-13".to_owned()],
            why: "it keeps its last node".to_owned(),
        }
    }

    fn after(states: &[Value]) -> (Timeline, Arc<Entry>) {
        let mut journal = Journal::new();
        let packs = Packs::load(&Assets::of_source_tree().unwrap()).unwrap();
        let topics = BTreeMap::from([(TOPIC.to_owned(), TOPIC.to_owned())]);
        let mut timeline = Timeline::new(&topics, packs.latest());
        let mut last = None;
        for state in states {
            let entry = journal.append(Occurrence {
                at: Stamp {
                    moment: Moment::START,
                    utc: jiff::Timestamp::UNIX_EPOCH,
                },
                source: Source::Link,
                direction: None,
                event: Event::Message {
                    topic: TOPIC.to_owned(),
                    qos: 0,
                    retain: false,
                    dup: false,
                    payload: Payload::keep(state.to_string().into_bytes().into()),
                },
            });
            timeline.add(&entry);
            last = Some(entry);
        }
        (timeline, last.unwrap())
    }

    fn read(states: &[Value], reading: Reading, member: &str) -> Option<Value> {
        let (timeline, last) = after(states);
        let waivers = [waiver(member, reading)];
        let (state, _) = mended(&last, &timeline, &waivers)?;
        state.get(member).cloned()
    }

    #[test]
    fn only_what_lies_behind_the_vehicle_is_left_out() {
        let state = json!({ "lastNodeSequenceId": 2, "nodeStates": [{ "sequenceId": 2 }, { "sequenceId": 4 }] });
        let left = json!([{ "sequenceId": 4 }]);
        assert_eq!(read(&[state], Reading::Passed, "nodeStates"), Some(left));
        let ahead = json!({ "lastNodeSequenceId": 0, "nodeStates": [{ "sequenceId": 4 }] });
        assert_eq!(read(&[ahead], Reading::Passed, "nodeStates"), None);
    }

    #[test]
    fn what_was_shown_last_holds_until_something_else_is_shown() {
        let states = [json!({ "orderId": "one" }), json!({ "orderId": "" })];
        assert_eq!(read(&states, Reading::Kept, "orderId"), Some(json!("one")));
        assert_eq!(read(&states[..1], Reading::Kept, "orderId"), None);
    }

    #[test]
    fn a_word_that_is_wrong_at_rest_is_read_as_the_right_one_and_any_other_is_not() {
        let reading = Reading::As {
            shown: Some(json!("automatic")),
            meant: json!("AUTOMATIC"),
        };
        let automatic = json!({ "operatingMode": "automatic" });
        let found = read(&[automatic], reading.clone(), "operatingMode");
        assert_eq!(found, Some(json!("AUTOMATIC")));
        assert_eq!(
            read(&[json!({ "operatingMode": "manual" })], reading, "operatingMode"),
            None
        );
    }

    #[test]
    fn driving_is_read_as_standing_only_where_the_vehicle_stays() {
        let at = |x: f64| json!({ "driving": true, "agvPosition": { "x": x, "y": 0.0, "theta": 0.0 } });
        assert_eq!(
            read(&[at(1.0), at(1.0)], Reading::Standing, "driving"),
            Some(json!(false))
        );
        assert_eq!(read(&[at(1.0), at(1.5)], Reading::Standing, "driving"), None);
    }

    #[test]
    fn what_is_about_the_mistake_is_decided_by_the_states_as_they_are() {
        let state = json!({ "lastNodeSequenceId": 2, "nodeStates": [{ "sequenceId": 2 }] });
        let (timeline, last) = after(&[state]);
        let waivers = [waiver("nodeStates", Reading::Passed)];
        let is_empty = |state: &Value| state.get("nodeStates") == Some(&json!([]));
        let makes_up = |id: &str| {
            let id = RequirementId::from(id);
            let mends = StateRepair::of(&waivers, TOPIC, &[&id]);
            let read = mended(&last, &timeline, &mends.waivers);
            read.is_some_and(|(state, _)| is_empty(&state))
        };
        assert!(!makes_up("STATE-13"));
        assert!(makes_up("ORD-06"));
    }
}
