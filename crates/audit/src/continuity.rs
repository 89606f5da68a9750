//! Where messages are missing.
//!
//! A gap in the count of a topic is a hole, and so is what only a message explains that the recording does not hold: an
//! order in a state that was never seen on its way, or an action nobody sent.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::time::Duration;

use super::is_command;
use tck_base::clock::Moment;
use tck_view::{ActionView, ErrorView, MessageView, Print, StateView};

/// How many orders and actions are kept in mind.
const SENT: usize = 8192;

/// How far recorders change the order of messages of different topics.
const CROSSING: Duration = Duration::from_millis(100);

/// By how much a count may fall because a message is late. A vehicle that was started anew begins with its first numbers.
const LATE: u64 = 8;

/// What a message is for those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// It follows the last one of its topic.
    Follows,
    /// There was none before that it could follow.
    Begins,
    /// Something is missing.
    Hole(Hole),
}

/// Where something is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Hole {
    /// Since when.
    pub since: Moment,
    /// What.
    pub missing: Missing,
}

/// What is not known behind a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Missing {
    /// What the vehicle showed meanwhile. It was the same vehicle all the time.
    States,
    /// What was sent to it.
    Commands,
    /// Where it was between its states.
    Visualization,
    /// Whether the factsheet still holds.
    Factsheet,
    /// Nothing, but who knew what of the other one's messages.
    Knowledge,
    /// Whatever may have been, a restart included.
    Anything,
}

impl Missing {
    /// What a gap in the count of a topic hides.
    fn of_topic(name: &str) -> Self {
        match name {
            "state" => Self::States,
            "visualization" => Self::Visualization,
            "factsheet" => Self::Factsheet,
            name if is_command(name) => Self::Commands,
            _ => Self::Anything,
        }
    }

    /// Whether orders and actions that were seen before say nothing about what comes.
    const fn is_of_conversation(self) -> bool {
        matches!(self, Self::States | Self::Commands | Self::Anything)
    }
}

/// Texts that are known, by their print, bounded.
#[derive(Debug, Default)]
struct Sent {
    known: BTreeSet<u64>,
    order: VecDeque<u64>,
}

impl Sent {
    fn add(&mut self, what: impl Hash) {
        let print = print(what);
        if self.known.insert(print) {
            self.order.push_back(print);
        }
        if self.order.len() > SENT
            && let Some(oldest) = self.order.pop_front()
        {
            self.known.remove(&oldest);
        }
    }

    fn has(&self, print: u64) -> bool {
        self.known.contains(&print)
    }
}

fn print(what: impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    what.hash(&mut hasher);
    hasher.finish()
}

/// A recording begins with this one state: what was sent shortly before it may still be under way.
#[derive(Debug)]
struct Early {
    since: Moment,
    errors: BTreeSet<Print>,
    /// Prints of the orders that were sent since.
    orders: BTreeSet<u64>,
}

/// Where messages are missing.
#[derive(Debug, Default)]
pub(super) struct Continuity {
    last: BTreeMap<String, (Option<u64>, Moment)>,
    sent: Sent,
    /// Orders and actions of the last state.
    shown: Option<BTreeSet<u64>>,
    /// Since when commands come one after the other, and what a state shows that knows the last of them.
    command: Option<(Moment, Moment, BTreeSet<u64>)>,
    /// Until the state behind the first one shows that nothing was under way.
    early: Option<Early>,
    /// The last state names an order.
    has_order: bool,
    /// When a state named no order any more, since the last message on `connection`: the sign of a start that was not seen,
    /// where messages are missing.
    reset: Option<Moment>,
    /// How many holes there are.
    pub holes: u64,
}

impl Continuity {
    /// Takes in a message that came live.
    pub fn note(&mut self, name: &str, message: Option<&MessageView>, now: Moment) -> Step {
        let id = message.and_then(|message| message.header().header_id.whole());
        if name == "connection" {
            // The count may begin anew on every topic of the vehicle.
            let last_state = self.last.get("state").map_or(now, |(_, at)| *at);
            self.last.retain(|topic, _| is_command(topic) || topic == name);
            self.shown = None;
            let before = self.last.insert(name.to_owned(), (id, now)).and_then(|(id, _)| id);
            // A number that was left out may be the farewell, or the start, by which an order was forgotten.
            let is_skipped = before.zip(id).is_some_and(|(before, id)| id > next(before));
            let reset = self.reset.take().filter(|_| is_skipped);
            // What was under way at the first state may be so still.
            let early = self.early.take_if(|_| is_skipped).map(|early| early.since);
            self.holes += u64::from(is_skipped);
            self.has_order = false;
            return match (reset, early) {
                // Silence before it may be explained by what was lost.
                (None, None) if is_skipped => Step::Hole(Hole {
                    since: last_state,
                    missing: Missing::States,
                }),
                (None, None) => Step::Begins,
                (None, Some(since)) => Step::Hole(Hole {
                    since,
                    missing: Missing::Commands,
                }),
                (Some(reset), early) => Step::Hole(Hole {
                    since: early.map_or(reset, |early| early.min(reset)),
                    missing: Missing::Anything,
                }),
            };
        }
        if let Some(state) = message.and_then(MessageView::state) {
            let has_order = !state.order_id.or_empty().is_empty();
            if self.has_order && !has_order {
                self.reset.get_or_insert(now);
            }
            self.has_order = has_order;
        }
        let before = self.last.insert(name.to_owned(), (id, now));
        let starts_are_seen = self.last.contains_key("connection");
        let counted = match before {
            None => Step::Begins,
            Some((Some(before), _)) if id == Some(next(before)) => Step::Follows,
            // A count that stands still hides nothing, unless its first number may be that of another start.
            Some((Some(before), _)) if id == Some(before) && (before > 1 || starts_are_seen) => Step::Follows,
            Some((last, since)) => {
                let is_late = |last: u64, id: u64| id > last || (id > 1 && last - id <= LATE);
                let goes_on = last.zip(id).is_some_and(|(last, id)| is_late(last, id));
                let missing = if goes_on || is_command(name) {
                    Missing::of_topic(name)
                } else {
                    Missing::Anything
                };
                Step::Hole(Hole { since, missing })
            }
        };
        let step = match (counted, message) {
            (Step::Hole(hole), _) => Step::Hole(hole),
            (_, Some(MessageView::State(state))) if !self.explained(state) => Step::Hole(Hole {
                since: before.map_or(now, |(_, since)| since),
                missing: Missing::Commands,
            }),
            (step, _) => step,
        };
        if let Step::Hole(_) = step {
            self.holes += 1;
        }
        let early = self.early.as_ref().map(|early| early.since);
        let step = match (step, early) {
            (Step::Hole(hole), Some(early)) if hole.missing.is_of_conversation() => Step::Hole(Hole {
                since: hole.since.min(early),
                missing: if hole.missing == Missing::Commands {
                    Missing::Commands
                } else {
                    Missing::Anything
                },
            }),
            (step, Some(early)) if message.is_some_and(|message| self.was_under_way(message)) => {
                let missing = match step {
                    Step::Hole(_) => Missing::Anything,
                    _ => Missing::Commands,
                };
                Step::Hole(Hole { since: early, missing })
            }
            (step, _) => step,
        };
        if let Step::Hole(hole) = step
            && hole.missing.is_of_conversation()
        {
            self.forget();
        }
        self.learn(message);
        if let Some(message @ (MessageView::Order(_) | MessageView::InstantActions(_))) = message {
            let since = match &self.command {
                Some((since, last, _)) if now.since(*last) <= CROSSING => *since,
                _ => now,
            };
            self.command = Some((since, now, marks(message)));
        }
        step
    }

    /// Since when it is not known what the master control had seen: a state came so soon after a command which it does not
    /// know that it may have been sent before.
    pub fn crossed(&self, message: Option<&MessageView>, now: Moment) -> Option<Moment> {
        let (since, last, marks) = self.command.as_ref()?;
        let state = message
            .and_then(MessageView::state)
            .filter(|_| now.since(*last) <= CROSSING)?;
        let mut known = shown(state).into_iter().chain(blamed(state));
        (!known.any(|print| marks.contains(&print))).then_some(*since)
    }

    /// Whether a message follows the last one of its topic by its count.
    pub fn goes_on(&self, name: &str, message: &MessageView) -> bool {
        let id = message.header().header_id.whole();
        let before = self.last.get(name).and_then(|(before, _)| *before);
        name != "connection" && before.is_some() && id == before.map(next)
    }

    /// Nothing was seen for a while: no message that comes follows another one.
    pub fn interrupted(&mut self) {
        self.holes += 1;
        self.last.clear();
        self.command = None;
        self.forget();
    }

    /// Judging begins at the first state of a recording, that was not seen to follow another one.
    pub fn begins_early(&mut self, state: &StateView, now: Moment) {
        self.early = Some(Early {
            since: now,
            errors: state.errors.iter().map(|error| error.print).collect(),
            orders: BTreeSet::new(),
        });
    }

    /// Since when the vehicle may have been started anew without a message that says so: it forgot its order, and messages are
    /// missing.
    pub fn restarted_unseen(&self) -> Option<Moment> {
        self.reset.filter(|_| self.holes > 0)
    }

    /// Whether what was sent before the first state may still be under way.
    pub fn is_early(&self) -> bool {
        self.early.is_some()
    }

    /// Whether a message shows that something was under way when the recording began: an update of an order that was not
    /// seen, or an error about something that was not seen. The first state that shows nothing of the kind ends the doubt.
    fn was_under_way(&mut self, message: &MessageView) -> bool {
        let Some(early) = &mut self.early else { return false };
        match message {
            MessageView::Order(order) => {
                early.orders.extend(order.order_id.text().map(print));
                order.order_update_id.whole() != Some(0)
            }
            MessageView::State(state) => {
                let is_known = |error: &&ErrorView| early.errors.contains(&error.print);
                let is_about_sent = |error: &ErrorView| {
                    let mut about = references(error);
                    about.any(|print| early.orders.contains(&print) || self.sent.has(print))
                };
                let mut new = state.errors.iter().filter(|error| !is_known(error));
                let doubtful = new.any(|error| !is_about_sent(error));
                self.early = None;
                doubtful
            }
            _ => false,
        }
    }

    /// What was sent before does not count any more.
    pub fn forget(&mut self) {
        self.sent = Sent::default();
        self.shown = None;
        self.early = None;
    }

    /// Keeps in mind what was sent, and what is shown.
    pub fn learn(&mut self, message: Option<&MessageView>) {
        match message {
            Some(MessageView::Order(order)) => {
                if let (Some(id), Some(update)) = (order.order_id.text(), order.order_update_id.whole()) {
                    self.sent.add((id, update));
                }
                self.actions(order.actions().map(|(_, action)| action));
            }
            Some(MessageView::InstantActions(message)) => self.actions(message.all_actions()),
            Some(MessageView::State(state)) => self.shown = Some(shown(state)),
            _ => {}
        }
    }

    /// Whether all that a state shows beyond the one before was sent.
    fn explained(&self, state: &StateView) -> bool {
        let Some(before) = &self.shown else { return true };
        shown(state).difference(before).all(|print| self.sent.has(*print))
    }

    fn actions<'m>(&mut self, actions: impl Iterator<Item = &'m ActionView>) {
        for id in actions.filter_map(|action| action.action_id.text()) {
            self.sent.add(id);
        }
    }
}

/// The number after this one; the count begins anew behind the largest.
fn next(id: u64) -> u64 {
    if id == u64::from(u32::MAX) { 0 } else { id + 1 }
}

/// Prints by which a state shows that it knows a command: its order, its actions, or an error about one of them.
fn marks(message: &MessageView) -> BTreeSet<u64> {
    let mut all = BTreeSet::new();
    if let Some(order) = message.order() {
        let id = order.order_id.text();
        all.extend(id.zip(order.order_update_id.whole()).map(print));
        all.extend(id.map(print));
    }
    let actions = message
        .instant_actions()
        .into_iter()
        .flat_map(|message| message.all_actions());
    all.extend(actions.filter_map(|action| action.action_id.text().map(print)));
    all
}

/// Prints of what the errors of a state refer to.
fn blamed(state: &StateView) -> impl Iterator<Item = u64> {
    state.errors.iter().flat_map(references)
}

/// Prints of what an error refers to.
fn references(error: &ErrorView) -> impl Iterator<Item = u64> {
    let all = error.error_references.iter();
    all.filter_map(|reference| reference.value.text().map(print))
}

/// Prints of the order and of the actions that a state shows.
fn shown(state: &StateView) -> BTreeSet<u64> {
    let id = state.order_id.text().filter(|id| !id.is_empty());
    let order = id.zip(state.order_update_id.whole()).map(print);
    let actions = state
        .all_action_states()
        .filter_map(|action| action.action_id.text().map(print));
    order.into_iter().chain(actions).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};
    use tck_view::{Names, Topic};

    use super::*;

    fn read(name: &str, message: &Value) -> MessageView {
        MessageView::of_value(Topic::of_name(name), message, &Names::default())
    }

    fn steps(messages: &[(&str, Value)]) -> Vec<Step> {
        let mut continuity = Continuity::default();
        let all = messages.iter().enumerate();
        all.map(|(at, (name, value))| continuity.note(name, Some(&read(name, value)), Moment::from_micros(at as u64)))
            .collect()
    }

    #[test]
    fn a_gap_and_a_fall_are_holes_and_a_repeat_is_none() {
        let found = steps(&[1, 2, 4, 5, 5, 3].map(|id| ("state", json!({ "headerId": id }))));
        let hole = |at, missing| {
            Step::Hole(Hole {
                since: Moment::from_micros(at),
                missing,
            })
        };
        let late = |at| hole(at, Missing::States);
        assert_eq!(
            found,
            [
                Step::Begins,
                Step::Follows,
                late(1),
                Step::Follows,
                Step::Follows,
                late(4)
            ]
        );
        // A vehicle that was started anew unseen may be another one.
        let anew = steps(&[
            ("state", json!({ "headerId": 40 })),
            ("state", json!({ "headerId": 1 })),
        ]);
        assert_eq!(anew[1], hole(0, Missing::Anything));
        // Where it was between its states does not matter to what was sent.
        let beside = steps(&[
            ("visualization", json!({ "headerId": 1 })),
            ("visualization", json!({ "headerId": 9 })),
        ]);
        assert_eq!(beside[1], hole(0, Missing::Visualization));
        let wraps = [u64::from(u32::MAX), 0].map(|id| ("state", json!({ "headerId": id })));
        assert_eq!(steps(&wraps)[1], Step::Follows);
    }

    #[test]
    fn what_nobody_sent_is_a_hole_once() {
        let state = |id: u64, order: &str| ("state", json!({ "headerId": id, "orderId": order, "orderUpdateId": 0 }));
        let order = ("order", json!({ "headerId": 1, "orderId": "b", "orderUpdateId": 0 }));
        let found = steps(&[state(1, "a"), order, state(2, "b"), state(3, "c"), state(4, "c")]);
        assert_eq!(found[2], Step::Follows);
        let hole = Hole {
            since: Moment::from_micros(2),
            missing: Missing::Commands,
        };
        assert_eq!(found[3], Step::Hole(hole));
        assert_eq!(found[4], Step::Follows);
    }

    #[test]
    fn a_state_that_does_not_know_the_command_before_it_may_have_crossed_it() {
        let order = json!({ "headerId": 1, "orderId": "b", "orderUpdateId": 0 });
        let at = |milliseconds: u64| Moment::from_micros(milliseconds * 1000);
        let crossed = |state: Value, milliseconds| {
            let mut continuity = Continuity::default();
            continuity.note("order", Some(&read("order", &order)), at(10));
            continuity.crossed(Some(&read("state", &state)), at(milliseconds))
        };
        let other = json!({ "orderId": "a", "orderUpdateId": 3 });
        assert_eq!(crossed(other.clone(), 60), Some(at(10)));
        assert_eq!(crossed(other.clone(), 200), None);
        assert_eq!(crossed(order.clone(), 60), None);
        let references = json!([{ "referenceKey": "orderId", "referenceValue": "b" }]);
        let refused = json!({ "orderId": "a", "orderUpdateId": 3, "errors": [{ "errorReferences": references }] });
        assert_eq!(crossed(refused, 60), None);
    }

    #[test]
    fn a_connection_lets_the_count_begin_anew() {
        let found = steps(&[
            ("state", json!({ "headerId": 9 })),
            ("connection", json!({ "headerId": 4 })),
            ("state", json!({ "headerId": 0 })),
            ("state", json!({ "headerId": 1 })),
        ]);
        assert_eq!(found, [Step::Begins, Step::Begins, Step::Begins, Step::Follows]);
    }
}
