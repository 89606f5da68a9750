//! Action states and the life cycle of actions: triggering, blocking types, pause, end.
//!
//! Knows *when* an action starts and ends, not *what* it does (see `deeds`).

use std::collections::VecDeque;
use std::time::Duration;

use serde_json::Value;

use crate::clock::Moment;

use super::action_kinds::ActionKind;
use super::faults::{FaultName as F, Faults};
use super::order_message::{ActionRequest, Blocking};

/// actionStatus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    Waiting,
    Initializing,
    Running,
    Paused,
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
            Self::Finished => "FINISHED",
            Self::Failed => "FAILED",
        }
    }

    /// FINISHED or FAILED.
    pub(crate) fn is_terminal(self) -> bool {
        matches!(self, Self::Finished | Self::Failed)
    }

    /// INITIALIZING, RUNNING or PAUSED.
    pub(crate) fn is_active(self) -> bool {
        matches!(self, Self::Initializing | Self::Running | Self::Paused)
    }
}

/// What asked for an action: an element of the order, by its sequenceId, or master control directly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    Node(u32),
    Edge(u32),
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
    /// What was left, and what it was, when it was held.
    pub(crate) held: Option<(Status, Option<Duration>)>,
    /// The end of the present stage was reported early (`cancel-fails-early`).
    pub(crate) masked: Option<Status>,
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
            held: None,
            masked: None,
        }
    }

    /// Whether the action belongs to the order.
    pub(crate) fn of_order(&self) -> bool {
        self.origin != Origin::Instant
    }

    fn occupies(&self) -> bool {
        self.of_order() && self.status.is_active()
    }

    /// Ends the action.
    pub(crate) fn end(&mut self, status: Status) {
        self.status = status;
        self.due = None;
        self.held = None;
    }

    /// Holds the action, if it runs and can be held.
    fn hold(&mut self, now: Moment, faults: Faults) {
        let pausable = self.kind.is_some_and(|kind| kind.pausable);
        if pausable && matches!(self.status, Status::Running | Status::Initializing) {
            self.held = Some((self.status, self.due.map(|due| due.since(now))));
            self.due = None;
            self.status = if faults.has(F::PauseToWaiting) {
                Status::Waiting
            } else {
                Status::Paused
            };
        }
    }

    fn resume(&mut self, now: Moment, faults: Faults) {
        if faults.has(F::R1PausedActionsFail) && self.held.is_some() {
            self.end(Status::Failed);
        }
        if self.of_order() && self.held.is_some() && faults.has(F::R6ResumedActionWaitsAgain) {
            self.end(Status::Waiting);
        }
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
struct List {
    origin: Origin,
    phases: VecDeque<Vec<String>>,
    running: Vec<String>,
}

/// All actions, in the order they became known.
#[derive(Clone, Debug, Default)]
pub(crate) struct Actions {
    all: Vec<Action>,
    lists: Vec<List>,
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

    /// Forgets what was triggered and not begun.
    pub(crate) fn drop_lists(&mut self) {
        self.lists.clear();
    }

    /// Triggers what waits at a place once more (`r6-resumed-action-waits-again` only).
    pub(crate) fn trigger_again(&mut self, origin: Origin, faults: Faults) {
        self.lists.retain(|list| list.origin != origin);
        self.trigger(origin, faults);
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

    /// A node was traversed, or an edge entered: its actions are triggered.
    pub(crate) fn trigger(&mut self, origin: Origin, faults: Faults) {
        if faults.has(F::EdgeListCut) && matches!(origin, Origin::Edge(_)) {
            let of_edge = self.all.iter_mut().filter(|action| action.origin == origin);
            of_edge.skip(1).for_each(|action| action.end(Status::Failed));
        }
        let mut phases: VecDeque<Vec<String>> = VecDeque::new();
        let mut parallel = Vec::new();
        let waiting = |action: &&Action| action.origin == origin && action.status == Status::Waiting;
        let mut triggered: Vec<&Action> = self.all.iter().filter(waiting).collect();
        if faults.has(F::ListReversed) {
            triggered.reverse();
        }
        if faults.has(F::LastActionForgotten) && triggered.len() > 1 {
            triggered.pop();
        }
        if faults.has(F::HardFirst) {
            triggered.sort_by_key(|action| action.request.blocking != Blocking::Hard);
        }
        for action in triggered {
            if action.request.blocking == Blocking::None
                && parallel.is_empty()
                && faults.has(F::R1NoneJoinsHard)
                && let Some(phase) = phases.back_mut()
            {
                phase.push(action.request.id.clone());
                continue;
            }
            let alone = action.request.blocking == Blocking::Hard && !faults.has(F::HardOverlaps);
            if alone {
                phases.extend((!parallel.is_empty()).then(|| std::mem::take(&mut parallel)));
                phases.push_back(vec![action.request.id.clone()]);
            } else {
                parallel.push(action.request.id.clone());
            }
        }
        phases.extend((!parallel.is_empty()).then_some(parallel));
        if !phases.is_empty() {
            self.lists.push(List {
                origin,
                phases,
                running: Vec::new(),
            });
        }
    }

    /// Ids of actions that can begin now, if any.
    pub(crate) fn startable(&mut self, faults: Faults) -> Vec<String> {
        let unawaited =
            |action: &Action| action.request.blocking == Blocking::None && faults.has(F::R3HardStartsBesideNone);
        for index in 0..self.lists.len() {
            let list = &self.lists[index];
            let open = list.running.iter().any(|id| {
                self.get(id)
                    .is_some_and(|action| !action.status.is_terminal() && !unawaited(action))
            });
            let Some(next) = list.phases.front().filter(|_| !open) else {
                continue;
            };
            let hard = next.iter().any(|id| self.blocking(id) == Some(Blocking::Hard));
            let occupied = self.all.iter().any(|action| {
                let elsewhere = action.origin != list.origin && faults.has(F::R2HardIgnoresEarlierNode);
                let of_node = |origin: Origin| matches!(origin, Origin::Node(_));
                let apart = of_node(action.origin) != of_node(list.origin);
                let elsewhere = elsewhere || apart && faults.has(F::R6EdgeActionStartsBeforeLeaving);
                action.occupies()
                    && !elsewhere
                    && !unawaited(action)
                    && (hard && next.len() == 1 || action.request.blocking == Blocking::Hard)
            });
            if occupied {
                continue;
            }
            let list = &mut self.lists[index];
            if let Some(phase) = list.phases.pop_front() {
                list.running.clone_from(&phase);
                return phase;
            }
        }
        self.lists.retain(|list| !list.phases.is_empty());
        Vec::new()
    }

    /// `r4-node-with-none-only-stops-following-soft`: the last action of a list is taken for all of them.
    fn ends_with_none(&self, origin: Origin) -> bool {
        let last = self.all.iter().rev().find(|action| action.origin == origin);
        last.is_some_and(|action| action.request.blocking == Blocking::None)
    }

    /// `r6-only-last-action-blocks`: when the last action of a node has ended, all of them are taken for ended.
    fn last_has_ended(&self, origin: Origin) -> bool {
        let last = self.all.iter().rev().find(|action| action.origin == origin);
        matches!(origin, Origin::Node(_)) && last.is_some_and(|action| action.status.is_terminal())
    }

    fn blocking(&self, id: &str) -> Option<Blocking> {
        self.get(id).map(|action| action.request.blocking)
    }

    /// Whether the actions forbid driving (BLOCK-03, BLOCK-04, BLOCK-07).
    pub(crate) fn block_driving(&self, faults: Faults) -> bool {
        let stops = |action: &Action| match action.request.blocking {
            _ if action.status == Status::Initializing && faults.has(F::R1PreparesWhileDriving) => false,
            Blocking::None => false,
            _ if matches!(action.origin, Origin::Edge(_)) && faults.has(F::R6EdgeActionsDoNotBlock) => false,
            _ if faults.has(F::R6OnlyLastActionBlocks) && self.last_has_ended(action.origin) => false,
            Blocking::Soft if matches!(action.origin, Origin::Edge(_)) && faults.has(F::R3SoftEdgeActionDrives) => {
                false
            }
            Blocking::Soft
                if faults.has(F::R4NodeWithNoneOnlyStopsFollowingSoft) && self.ends_with_none(action.origin) =>
            {
                false
            }
            Blocking::Soft => !faults.has(F::SoftDrives),
            Blocking::Hard => !faults.has(F::HardDrives),
        };
        let pending = self.lists.iter().flat_map(|list| list.phases.iter().flatten());
        let ahead = pending.filter_map(|id| self.get(id)).any(stops);
        ahead || self.all.iter().any(|action| action.occupies() && stops(action))
    }

    /// Whether an action waits there.
    pub(crate) fn waiting_at(&self, origin: Origin) -> bool {
        let mut actions = self.all.iter().filter(|action| action.origin == origin);
        actions.any(|action| action.status == Status::Waiting)
    }

    /// Whether an edge has actions that stop the vehicle.
    pub(crate) fn edge_stops(&self, sequence_id: u32, faults: Faults) -> bool {
        let mut actions = self
            .all
            .iter()
            .filter(|action| action.origin == Origin::Edge(sequence_id));
        if faults.has(F::R6EdgeActionsDoNotBlock) {
            return false;
        }
        let heeded = |blocking: Blocking| blocking == Blocking::Hard || !faults.has(F::R3SoftEdgeActionDrives);
        actions.any(|action| {
            let blocking = action.request.blocking;
            blocking != Blocking::None && heeded(blocking) && action.status == Status::Waiting
        })
    }

    /// The vehicle leaves the edge: its actions end (NODE-05).
    pub(crate) fn leave_edge(&mut self, sequence_id: u32, faults: Faults, cut: Status) {
        let origin = Origin::Edge(sequence_id);
        self.lists.retain(|list| list.origin != origin);
        let ended = if faults.has(F::LastEdgeActionOutlivesEdge) {
            1
        } else {
            usize::MAX
        };
        let of_edge = self.all.iter_mut().filter(|action| action.origin == origin);
        for action in of_edge.take(ended) {
            match action.status {
                Status::Waiting => action.end(Status::Failed),
                status if status.is_active() => action.end(cut),
                _ => {}
            }
        }
    }

    /// `none-aborted`: what does not keep the vehicle on its node is broken off when it leaves.
    pub(crate) fn leave_node(&mut self, sequence_id: u32) {
        let of_node = |action: &&mut Action| action.origin == Origin::Node(sequence_id);
        for action in self.all.iter_mut().filter(of_node) {
            if action.request.blocking == Blocking::None && action.status.is_active() {
                action.end(Status::Failed);
            }
        }
    }

    /// Holds what can be held.
    pub(crate) fn hold(&mut self, now: Moment, faults: Faults) {
        self.all.iter_mut().for_each(|action| action.hold(now, faults));
    }

    /// Lets held actions go on.
    pub(crate) fn resume(&mut self, now: Moment, faults: Faults) {
        self.all.iter_mut().for_each(|action| action.resume(now, faults));
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
