//! What a broken report hides.
//!
//! A state that forgets the name of its order, or leaves out actions that are done, cannot show what most tests wait
//! for, nor can an instantActions message without its list. The device is guilty of that, once; whether it did what it
//! was told could not be observed. A monitor names the members it speaks for under `hides:`, and what was missed there
//! is inconclusive in the tests it found something in. Which monitors do so is data. Where they name the elements that got lost, the
//! others are seen.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde_json::Value;

use tck_base::pattern::Bindings;
use tck_journal::Entry;
use tck_journal::event::Event;
use tck_result::{Sent, Waited};
use tck_suite::model::{Step, Verb};
use tck_view::{MessageView, Topic};

use super::step::{Clause, ClauseOutcome, Timing};
use super::timeline::Timeline;

/// A clause of a step that has ended, not decided yet.
pub(super) struct Open {
    /// How it came out.
    pub clause: Clause,
    /// The step.
    pub path: String,
    /// Whether the step follows an action.
    pub walks: bool,
    /// The last entry of the step.
    pub ended: u64,
    /// What was waited for.
    pub waited: Option<Waited>,
    /// What was sent last.
    pub sent: Option<Sent>,
    /// The vehicle has reported a new error since the message the step is about: it says itself that it did not obey.
    pub refused: bool,
    /// What it says about time, if it is a finding about time.
    pub of_time: Option<Timing>,
    /// The order that the vehicle still had when the last one was sent to it.
    pub busy: Option<OrderUnderWay>,
    /// The actions of orders that were awaited by their ids, and no other actions.
    pub awaits: BTreeSet<String>,
}

/// The actions of orders that a step awaits by their ids; none where it may be about instant actions, too.
pub(super) fn awaited(
    step: &Step,
    bindings: &Bindings,
    entries: &[Arc<Entry>],
    timeline: &Timeline,
) -> BTreeSet<String> {
    let mut named = BTreeSet::new();
    let mut texts = BTreeSet::new();
    if matches!(*step.verb, Verb::Expect(_)) {
        step.visit_terms(&mut |term| {
            if let Ok(value) = term.bind(bindings) {
                gather(value, &mut texts);
            }
        });
    }
    for entry in entries
        .iter()
        .filter(|entry| matches!(entry.event(), Event::Sent { .. }))
    {
        let topic = timeline
            .place(entry)
            .map_or(Topic::Other, |owner| Topic::of_name(&owner.name));
        match timeline.view(entry, topic) {
            Some(MessageView::Order(order)) => {
                let ids = order.actions().filter_map(|(_, action)| action.action_id.text());
                named.extend(ids.filter(|id| texts.contains(*id)).map(str::to_owned));
            }
            Some(MessageView::InstantActions(message)) => {
                let mut all = message.all_actions();
                let is_named = all.any(|action| {
                    let words = [action.action_id.text(), action.action_type.text()];
                    words.into_iter().flatten().any(|word| texts.contains(word))
                });
                if is_named {
                    return BTreeSet::new();
                }
            }
            _ => {}
        }
    }
    named
}

/// All texts of a value.
fn gather(value: Value, texts: &mut BTreeSet<String>) {
    match value {
        Value::String(text) => {
            texts.insert(text);
        }
        Value::Array(items) => items.into_iter().for_each(|item| gather(item, texts)),
        Value::Object(members) => members.into_iter().for_each(|(_, member)| gather(member, texts)),
        _ => {}
    }
}

/// An order of which nodes were left when another one was sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct OrderUnderWay {
    /// Its orderId.
    pub order: String,
    /// The state that shows it.
    pub seq: u64,
}

impl OrderUnderWay {
    /// The order that a vehicle shows in the last state before another one is sent to it in this message.
    pub fn before(timeline: &Timeline, sent: &Entry) -> Option<Self> {
        let next = timeline.view(sent, Topic::Order)?.order()?;
        let shown = timeline.before("state", sent.seq())?;
        let state = timeline.state(shown)?;
        let (next, order) = (next.order_id.text()?, state.order_id.text()?);
        let is_other = !order.is_empty() && !next.is_empty() && order != next;
        (is_other && state.node_states.total() > 0).then(|| Self {
            order: order.to_owned(),
            seq: shown.seq(),
        })
    }
}

/// A member of a message that shows nothing in a test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Hidden {
    /// The member.
    pub member: String,
    /// Who found it.
    pub monitor: String,
    /// What is broken.
    pub requirement: String,
    /// The requirements of the monitor, which are decided all the same.
    pub decides: Vec<String>,
    /// The entry that showed it first in this test.
    pub seq: u64,
    /// It is known from before this test: where the member shows nothing, it shows nothing in any message.
    pub lasting: bool,
    /// The elements of the member that got lost, by their ids; `None` where it may be any.
    pub elements: Option<BTreeSet<String>>,
}

impl Hidden {
    /// Whether this was waited for in vain where nothing is shown. A step that is about the member is decided all the
    /// same, and so is what a message shows that did come.
    fn hides(&self, open: &Open, about: &[String]) -> bool {
        let Some(nearest) = &open.clause.nearest else {
            return false;
        };
        let member = nearest.path.split(['.', '[']).next();
        let shows_nothing = matches!(nearest.found.as_str(), "\"\"" | "0" | "nothing");
        let is_unseen = match self.lasting {
            // What is known to be forgotten at times is seen whenever it is shown.
            true => shows_nothing,
            false => open.clause.witness.is_none() || open.walks,
        };
        matches!(
            open.clause.holds,
            ClauseOutcome::Violated | ClauseOutcome::Warning | ClauseOutcome::HeldLate
        ) && is_unseen
            && member == Some(self.member.as_str())
            && !self.decides.iter().any(|id| about.contains(id))
            && self.seq <= open.ended
            && self.may_be(&open.awaits)
            && !(open.refused && open.clause.holds == ClauseOutcome::Violated && open.clause.witness.is_none())
    }

    /// Whether what got lost may be what was awaited. An action of an order is listed as soon as the order is taken, so that it is missing
    /// by itself; an instant action may be over, and lost, before a state shows it.
    fn may_be(&self, awaited: &BTreeSet<String>) -> bool {
        let lost = self.elements.as_ref().filter(|_| !awaited.is_empty());
        lost.is_none_or(|lost| !lost.is_disjoint(awaited))
    }
}

/// Marks as unseen what was awaited of a new order of a vehicle that still had another one: it has to refuse the new one. That
/// it still had the other one is decided where that was to end.
pub(super) fn excuse_busy(all: &mut [Open]) {
    for open in all {
        let Some(busy) = &open.busy else { continue };
        let nearest = open.clause.nearest.as_ref();
        let keeps =
            nearest.is_some_and(|nearest| nearest.path == "orderId" && nearest.found.trim_matches('"') == busy.order);
        if open.clause.holds != ClauseOutcome::Violated || open.clause.witness.is_some() || !keeps {
            continue;
        }
        let why = format!(
            "the vehicle still had order {:?} when the new one was sent (#{}), and has to refuse it",
            busy.order, busy.seq
        );
        open.clause.message = format!("cannot be told, since {why}; {}", open.clause.message);
        open.clause.holds = ClauseOutcome::Unobservable(why);
    }
}

/// Marks as unseen what rests on members that show nothing; says so in one line if there is any.
pub(super) fn hide(all: &mut [Open], hidden: &[Hidden]) -> Option<String> {
    if hidden.is_empty() {
        return None;
    }
    let mut told = None;
    let ids: Vec<(String, &'static str, String)> = all
        .iter()
        .map(|open| {
            let requirement = open.clause.requirement.as_str().to_owned();
            (open.path.clone(), open.clause.word, requirement)
        })
        .collect();
    for open in all {
        let same = ids
            .iter()
            .filter(|(path, word, _)| *path == open.path && *word == open.clause.word);
        let about: Vec<String> = same.map(|(_, _, id)| id.clone()).collect();
        let Some(hidden) = hidden.iter().find(|hidden| hidden.hides(open, &about)) else {
            continue;
        };
        let why = format!(
            "the messages do not show `{}` as they must (#{}: {} is broken, found by {})",
            hidden.member, hidden.seq, hidden.requirement, hidden.monitor
        );
        open.clause.holds = ClauseOutcome::Unobservable(why.clone());
        open.clause.message = format!("cannot be told, since {why}; {}", open.clause.message);
        told.get_or_insert(why);
    }
    told
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::diagnostic::{Source, Span};
    use tck_pack::RequirementId;
    use tck_result::NearestMiss;

    fn clause(requirement: &str, path: &str) -> Open {
        let nearest = NearestMiss {
            seq: 20,
            path: path.to_owned(),
            found: String::new(),
            expected: String::new(),
        };
        Open {
            clause: Clause {
                requirement: RequirementId::from(requirement),
                word: "checks",
                span: Span::new(&Source::new("test", ""), 0, 0),
                label: String::new(),
                holds: ClauseOutcome::Violated,
                witness: None,
                message: "nothing came".to_owned(),
                expected: None,
                nearest: Some(nearest),
            },
            path: "steps[1]".to_owned(),
            walks: false,
            ended: 30,
            waited: None,
            sent: None,
            of_time: None,
            refused: false,
            busy: None,
            awaits: BTreeSet::new(),
        }
    }

    fn is_hidden(open: Open, found: u64) -> bool {
        first_is_hidden(&mut [open], found)
    }

    fn first_is_hidden(all: &mut [Open], found: u64) -> bool {
        let hidden = [Hidden {
            member: "orderId".to_owned(),
            monitor: "state/order-kept".to_owned(),
            requirement: "STATE-MSG-02".to_owned(),
            decides: vec!["STATE-MSG-02".to_owned()],
            seq: found,
            lasting: false,
            elements: None,
        }];
        hide(all, &hidden);
        matches!(all[0].clause.holds, ClauseOutcome::Unobservable(_))
    }

    #[test]
    fn what_was_missed_where_nothing_is_shown_is_unseen() {
        assert!(is_hidden(clause("ORD-06", "orderId"), 15));
        assert!(is_hidden(clause("ORD-06", "orderId[0].x"), 15));
    }

    #[test]
    fn anything_else_stays_as_it_was() {
        assert!(!is_hidden(clause("ORD-06", "lastNodeId"), 15));
        assert!(!is_hidden(clause("STATE-MSG-02", "orderId"), 15));
        assert!(!is_hidden(clause("ORD-06", "orderId"), 31));
        let mut came = clause("ORD-06", "orderId");
        came.clause.witness = Some(20);
        assert!(!is_hidden(came, 15));
    }

    #[test]
    fn the_loss_of_one_action_hides_no_other_one_of_an_order() {
        let unseen = |lost: Option<&[&str]>, awaited: &[&str]| {
            let of = |all: &[&str]| all.iter().map(|id| (*id).to_owned()).collect::<BTreeSet<_>>();
            let hidden = [Hidden {
                member: "actionStates".to_owned(),
                monitor: "state/action-states-kept".to_owned(),
                requirement: "STATE-MSG-10".to_owned(),
                decides: vec!["STATE-MSG-10".to_owned()],
                seq: 15,
                lasting: false,
                elements: lost.map(of),
            }];
            let mut open = clause("ASTATE-01", "actionStates");
            open.awaits = of(awaited);
            let mut all = [open];
            hide(&mut all, &hidden);
            matches!(all[0].clause.holds, ClauseOutcome::Unobservable(_))
        };
        assert!(!unseen(Some(&["cancel"]), &["later"]));
        assert!(unseen(Some(&["cancel", "later"]), &["later"]));
        assert!(unseen(Some(&["first"]), &["first", "later"]));
        // It is not known what got lost, or what is awaited.
        assert!(unseen(None, &["later"]));
        assert!(unseen(Some(&["cancel"]), &[]));
    }

    #[test]
    fn a_new_order_of_a_vehicle_that_still_has_one_shows_nothing() {
        let unseen = |busy: bool, path: &str, found: &str| {
            let mut open = clause("ORD-CANCEL-13", path);
            if let Some(nearest) = &mut open.clause.nearest {
                nearest.found = found.to_owned();
            }
            open.busy = busy.then(|| OrderUnderWay {
                order: "before".to_owned(),
                seq: 12,
            });
            let mut all = [open];
            excuse_busy(&mut all);
            matches!(all[0].clause.holds, ClauseOutcome::Unobservable(_))
        };
        assert!(unseen(true, "orderId", "\"before\""));
        assert!(!unseen(false, "orderId", "\"before\""));
        assert!(
            !unseen(true, "orderId", "\"after\""),
            "it took the new one over all the same"
        );
        assert!(
            !unseen(true, "errors", "[]"),
            "what is awaited of the refusal is judged"
        );
    }

    #[test]
    fn what_the_vehicle_says_it_refused_is_seen() {
        let mut refused = clause("ORD-06", "orderId");
        refused.refused = true;
        assert!(!is_hidden(refused, 15));
    }

    #[test]
    fn a_step_about_the_member_itself_is_decided() {
        let mut step = [clause("MQTT-10", "orderId"), clause("STATE-MSG-02", "orderId")];
        assert!(!first_is_hidden(&mut step, 15));
    }
}
