//! Action states and the life cycle of actions: triggering, blocking types, pause, end (section 6.11 and figure 16).
//!
//! Knows *when* an action starts and ends, not *what* it does (see `action_effect`), nor what may run beside what (see
//! `blocking`). With the vehicle its actions are paused, which the two tables of section 6.8 say differently (the
//! ruling of ACT-15).

use std::collections::VecDeque;
use std::time::Duration;

use serde_json::Value;

use tck_base::clock::Moment;

use super::action_kinds::ActionKind;
use super::order_message::ActionRequest;

/// actionStatus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    Waiting,
    Initializing,
    Running,
    Paused,
    /// It has failed, and waits for what is decided of that.
    Retriable,
    Finished,
    Failed,
}

impl Status {
    /// The literal of the state.
    pub(crate) fn literal(self) -> &'static str {
        match self {
            Self::Waiting => "WAITING",
            Self::Initializing => "INITIALIZING",
            Self::Running => "RUNNING",
            Self::Paused => "PAUSED",
            Self::Retriable => "RETRIABLE",
            Self::Finished => "FINISHED",
            Self::Failed => "FAILED",
        }
    }

    /// FINISHED or FAILED.
    pub(crate) fn is_terminal(self) -> bool {
        matches!(self, Self::Finished | Self::Failed)
    }

    /// INITIALIZING, RUNNING, PAUSED or RETRIABLE.
    pub(crate) fn is_active(self) -> bool {
        matches!(
            self,
            Self::Initializing | Self::Running | Self::Paused | Self::Retriable
        )
    }
}

/// Origin of an action: an element of the order, by its sequenceId, or master control directly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    Node(u32),
    Edge(u32),
    /// A zone it went through; which passage that was.
    Zone(u32),
    Instant,
}

/// One action and its state.
#[derive(Clone, Debug)]
pub(crate) struct Action {
    pub(crate) request: ActionRequest,
    /// `None` for an action the vehicle does not know.
    pub(crate) kind: Option<&'static ActionKind>,
    pub(crate) origin: Origin,
    pub(crate) status: Status,
    pub(crate) result: Option<String>,
    /// When the present stage ends; `None` if something else ends it.
    pub(crate) due: Option<Moment>,
    /// The parameter that names the file which is being fetched for a certificate.
    pub(crate) awaits: Option<&'static str>,
    /// What was fetched for it, by parameter.
    pub(crate) files: Vec<(&'static str, bytes::Bytes)>,
    /// Status and remaining time when it was held.
    pub(crate) held: Option<(Status, Option<Duration>)>,
}

impl Action {
    /// An action that waits for its trigger.
    pub(crate) fn waiting(request: ActionRequest, kind: Option<&'static ActionKind>, origin: Origin) -> Self {
        Self {
            request,
            kind,
            origin,
            status: Status::Waiting,
            result: None,
            due: None,
            awaits: None,
            files: Vec::new(),
            held: None,
        }
    }

    /// Whether the action belongs to the order.
    pub(crate) fn of_order(&self) -> bool {
        matches!(self.origin, Origin::Node(_) | Origin::Edge(_))
    }

    /// Whether the action belongs to a zone.
    pub(crate) fn of_zone(&self) -> bool {
        matches!(self.origin, Origin::Zone(_))
    }

    /// Whether it is under way, and belongs to the order or to a zone.
    pub(crate) fn occupies(&self) -> bool {
        self.origin != Origin::Instant && self.status.is_active()
    }

    /// Its actionId.
    pub(crate) fn id(&self) -> String {
        self.request.id.clone()
    }

    /// Whether it may run beside others.
    fn shares(&self) -> bool {
        self.request.blocking.shares()
    }

    /// Ends the action.
    pub(crate) fn end(&mut self, status: Status) {
        self.status = status;
        self.due = None;
        self.held = None;
    }

    /// Holds the action, if it runs and can be held.
    fn hold(&mut self, now: Moment) {
        let pausable = self.kind.is_some_and(|kind| kind.pausable);
        if pausable && matches!(self.status, Status::Running | Status::Initializing) {
            self.held = Some((self.status, self.due.map(|due| due.since(now))));
            self.due = None;
            self.status = Status::Paused;
        }
    }

    fn resume(&mut self, now: Moment) {
        if let Some((status, left)) = self.held.take() {
            self.status = status;
            self.due = left.map(|left| now + left);
        }
    }

    /// A parameter that is a string.
    pub(crate) fn text(&self, key: &str) -> &str {
        self.request.parameter(key).and_then(Value::as_str).unwrap_or_default()
    }

    /// A parameter that is a number.
    pub(crate) fn number(&self, key: &str) -> Option<f64> {
        self.request.parameter(key).and_then(Value::as_f64)
    }
}

/// The actions of one node or edge that was triggered, cut where nothing may run in parallel (figure 17).
#[derive(Clone, Debug)]
pub(crate) struct List {
    pub(crate) origin: Origin,
    pub(crate) phases: VecDeque<Vec<String>>,
    pub(crate) running: Vec<String>,
}

/// All actions, in the order they became known.
#[derive(Clone, Debug, Default)]
pub(crate) struct Actions {
    all: Vec<Action>,
    pub(crate) lists: Vec<List>,
}

impl Actions {
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Action> {
        self.all.iter()
    }

    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Action> {
        self.all.iter_mut()
    }

    pub(crate) fn get(&self, id: &str) -> Option<&Action> {
        self.all.iter().find(|action| action.request.id == id)
    }

    pub(crate) fn get_mut(&mut self, id: &str) -> Option<&mut Action> {
        self.all.iter_mut().find(|action| action.request.id == id)
    }

    pub(crate) fn push(&mut self, action: Action) {
        self.all.push(action);
    }

    pub(crate) fn retain(&mut self, keep: impl FnMut(&Action) -> bool) {
        self.all.retain(keep);
        let all = &self.all;
        let known = |id: &String| all.iter().any(|action| action.request.id == *id);
        for list in &mut self.lists {
            list.running.retain(known);
            list.phases.iter_mut().for_each(|phase| phase.retain(known));
        }
    }

    /// Forgets what of the order was triggered and not begun.
    pub(crate) fn drop_lists(&mut self) {
        self.lists.retain(|list| matches!(list.origin, Origin::Zone(_)));
    }

    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        self.all.clear();
        self.lists.clear();
    }

    /// Whether an action of the order has not ended.
    pub(crate) fn order_unfinished(&self) -> bool {
        self.all
            .iter()
            .any(|action| action.of_order() && !action.status.is_terminal())
    }

    /// Actions that wait at a place, cut into parts that may run in parallel; a HARD action runs alone (BLOCK-05).
    pub(crate) fn phases(&self, origin: Origin) -> VecDeque<Vec<String>> {
        let waiting = |action: &&Action| action.origin == origin && action.status == Status::Waiting;
        let waiting: Vec<&Action> = self.all.iter().filter(waiting).collect();
        let together = |before: &&Action, after: &&Action| [before, after].iter().all(|action| action.shares());
        let phases = waiting.chunk_by(together);
        let id = |action: &&Action| action.request.id.clone();
        phases.map(|phase| phase.iter().map(id).collect()).collect()
    }

    /// A place was triggered: what waits there has its turn one part after the other.
    pub(crate) fn queue(&mut self, origin: Origin, phases: VecDeque<Vec<String>>) {
        if !phases.is_empty() {
            let running = Vec::new();
            self.lists.push(List {
                origin,
                phases,
                running,
            });
        }
    }

    /// The next part of a list begins, or none.
    pub(crate) fn begin(&mut self, list: Option<usize>) -> Vec<String> {
        let list = list.and_then(|index| self.lists.get_mut(index));
        if let Some(list) = list
            && let Some(phase) = list.phases.pop_front()
        {
            list.running.clone_from(&phase);
            return phase;
        }
        self.lists.retain(|list| !list.phases.is_empty());
        Vec::new()
    }

    /// Forgets what was triggered at a place and not begun.
    pub(crate) fn drop_list(&mut self, origin: Origin) {
        self.lists.retain(|list| list.origin != origin);
    }

    /// Whether an action waits there.
    pub(crate) fn waiting_at(&self, origin: Origin) -> bool {
        let mut actions = self.all.iter().filter(|action| action.origin == origin);
        actions.any(|action| action.status == Status::Waiting)
    }

    /// Holds what can be held.
    pub(crate) fn hold(&mut self, now: Moment) {
        self.all.iter_mut().for_each(|action| action.hold(now));
    }

    /// Lets held actions go on.
    pub(crate) fn resume(&mut self, now: Moment) {
        self.all.iter_mut().for_each(|action| action.resume(now));
    }

    /// When the next stage of an action ends.
    pub(crate) fn next_end(&self) -> Option<Moment> {
        self.all.iter().filter_map(|action| action.due).min()
    }

    /// The id of an action whose stage has ended.
    pub(crate) fn due(&self, now: Moment) -> Option<String> {
        let ended = self.all.iter().find(|action| action.due.is_some_and(|due| due <= now));
        ended.map(|action| action.request.id.clone())
    }
}
