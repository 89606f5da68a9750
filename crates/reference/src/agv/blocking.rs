//! What may run beside what: actions beside each other, and beside driving (blockingType, section 6.12 and figure 17).
//!
//! Instant actions do not stand in a list, and block none that do (the ruling of BLOCK-05); NONE actions that are open
//! are not awaited before driving on (that of BLOCK-07).

use super::Agv;
use super::actions::{Action, List, Origin, Status};
use super::hook_points::{Event, Permission};

impl Agv {
    /// A node was traversed, or an edge entered: its actions are triggered (NODE-04, NODE-06).
    pub(crate) fn trigger_actions(&mut self, origin: Origin) {
        if !self.allows(Permission::Trigger(origin), true) {
            return;
        }
        self.happens(Event::Triggering(origin));
        let mut phases = self.actions.phases(origin);
        self.queues(origin, &mut phases);
        self.actions.queue(origin, phases);
    }

    /// Ids of actions whose turn it is, if there are any.
    pub(crate) fn next_actions(&mut self) -> Vec<String> {
        let index = self.actions.lists.iter().position(|list| self.has_its_turn(list));
        self.actions.begin(index)
    }

    /// Whether the next part of a list may begin: what it began before has ended, and a HARD action is alone (BLOCK-05).
    fn has_its_turn(&self, list: &List) -> bool {
        let Some(next) = list.phases.front() else {
            return false;
        };
        let awaits = |action: &Action| self.allows(Permission::Await(action, list.origin), true);
        let mut running = list.running.iter().filter_map(|id| self.actions.get(id));
        if running.any(|action| !action.status.is_terminal() && awaits(action)) {
            return false;
        }
        let hard = |action: &Action| !action.request.blocking.shares();
        let alone = next.len() == 1 && next.iter().filter_map(|id| self.actions.get(id)).any(hard);
        let mut others = self.actions.iter().filter(|action| action.occupies());
        !others.any(|action| (alone || hard(action)) && awaits(action))
    }

    /// Whether actions that are under way, or come before the vehicle drives on, forbid driving (BLOCK-03, BLOCK-04,
    /// BLOCK-07).
    pub(crate) fn actions_forbid_driving(&self) -> bool {
        let stops = |action: &Action| {
            let free = action.request.blocking.lets_drive();
            !self.allows(Permission::DriveDuring(action), free)
        };
        let lists = self.actions.lists.iter();
        let queued = lists.flat_map(|list| list.phases.iter().flatten());
        let ahead = queued.filter_map(|id| self.actions.get(id)).any(stops);
        ahead || self.actions.iter().any(|action| action.occupies() && stops(action))
    }

    /// Whether an edge has actions that stop the vehicle.
    pub(crate) fn stops_on_edge(&self, sequence_id: u32) -> bool {
        let of_edge = |action: &&Action| action.origin == Origin::Edge(sequence_id);
        self.actions.iter().filter(of_edge).any(|action| {
            let free = action.request.blocking.lets_drive();
            action.status == Status::Waiting && !self.allows(Permission::PassOver(action), free)
        })
    }

    /// The vehicle leaves an edge: its actions end (NODE-05).
    pub(crate) fn end_edge_actions(&mut self, sequence_id: u32) {
        let origin = Origin::Edge(sequence_id);
        self.actions.drop_list(origin);
        let ending = |action: &&Action| action.origin == origin && self.allows(Permission::EndWithEdge(action), true);
        let ending: Vec<String> = self.actions.iter().filter(ending).map(Action::id).collect();
        for action in self
            .actions
            .iter_mut()
            .filter(|action| ending.contains(&action.request.id))
        {
            match action.status {
                Status::Waiting => action.end(Status::Failed),
                status if status.is_active() => action.end(Status::Finished),
                _ => {}
            }
        }
    }
}
