//! The hook points of a vehicle: what a deviation can do otherwise, and who asks it.
//!
//! The vehicle asks here at its points of decision and says here what happens (`hook_points` has the words for both). With
//! nothing switched on there is nobody to be asked.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::time::Duration;

use serde_json::{Map, Value};

use super::action_effect::Outcome;
use super::actions::{Action, Origin, Status};
use super::config::ErrorEnd;
use super::errors::{ActiveError, Life};
use super::order_message::{Corridor, Edge, Order};
use super::order_state::Stop;
use super::rejection::{Refusal, Rule};
use super::report::{Changes, Telling};
use super::requests::Answer;
use super::{Agv, AgvConfig};
use crate::ConnectOptions;
use crate::hooks::Memory;
use tck_base::clock::Moment;
use tck_base::nurbs::Path;

pub(crate) use super::hook_points::{Cause, Event, Head, Hindrance, Outgoing, Part, Permission, Span};
pub(crate) use super::objections::{Adoption, Lack, Objection, Relation};
pub(crate) use super::way::{Course, Leg};

/// A JSON object of a message.
pub(crate) type Object = Map<String, Value>;

hooks! {
    Agv configured by AgvConfig;

    /// The connection is to be made.
    mut connects(options: &mut ConnectOptions) = each;
    /// A part of a message is worded; false to leave it out of its list. A state is due when what is said changes.
    ref says(part: Part<'_>, words: &mut Object) -> bool = all;
    /// A header is written.
    mut heads(head: Head, header: &mut Object) = each;
    /// A message goes out; false to hold it back.
    mut sends(outgoing: &mut Outgoing) -> bool = all;
    /// The text of a message.
    ref writes(outgoing: &Outgoing, text: &mut Vec<u8>) = each;
    /// Whether something is allowed.
    ref allows(what: Permission<'_>, usual: bool) -> bool = fold(usual);
    /// How long something lasts.
    ref lasts(what: Span<'_>, usual: Duration) -> Duration = fold(usual);
    /// Somebody does something to the vehicle; false when nothing is left to be done.
    mut asked(command: &str, arguments: &Value) -> bool = all;
    /// A message of a topic name came in; false to overlook it.
    mut hears(name: &str, payload: &[u8]) -> bool = all;
    /// The actions of an instantActions message are read.
    mut reads_instants(actions: &mut Vec<&Value>) = each;
    /// Whether something that changed is told in a state.
    mut tells(changes: Changes, requested: bool) -> Telling = own(Telling::Now);
    /// The way over an edge with a trajectory; `None` for a straight one.
    ref bends(edge: &Edge, path: Path) -> Option<Path> = own(Some(path));
    /// The corridor of an edge, as the vehicle understands it.
    ref keeps_to(corridor: &mut Corridor) = each;
    /// An answer to a request came in; it may be taken for another one.
    mut hears_answer(answer: &mut Answer) = each;
    /// An order is read; it may be taken for something else.
    ref reads(message: &mut Value) = each;
    /// Another objection against an order.
    ref objects(order: &Order, relation: Relation) -> Option<Refusal> = first;
    /// An order is taken over, and may be changed; false when nothing is left to be done.
    mut adopts(adoption: &mut Adoption<'_>) -> bool = all;
    /// Which way it drives to a node.
    ref steers(course: &mut Course<'_>) = each;
    /// A leg is planned.
    ref plans(leg: &mut Leg<'_>) = each;
    /// The orientation it takes on a node before that counts as traversed.
    ref faces(stop: &Stop, wanted: Option<f64>) -> Option<f64> = fold(wanted);
    /// The actions of a node or an edge are queued, cut where nothing may run in parallel.
    ref queues(origin: Origin, phases: &mut VecDeque<Vec<String>>) = each;
    /// How an action ends because its order is cancelled; `None` if it does not.
    ref breaks(action: &Action, usual: Option<Status>) -> Option<Status> = fold(usual);
    /// An order is refused, and nothing was said about it yet.
    mut refuses(message: &Value, rule: Rule) = each;
    /// An error is to be listed; false to keep it to itself.
    mut raises(cause: Cause<'_>, error: &mut ActiveError) -> bool = all;
    /// An action is to show its effect: what comes of it where it is done otherwise.
    mut does(action: &Action) -> Option<Outcome> = first;
    /// What comes of an action that was done as usual.
    mut ends(action: &Action, outcome: Outcome) -> Outcome = fold(outcome);
    /// When it wants to be told that time has passed.
    ref due() -> Option<Moment> = own(None);
    /// Something has happened, or is about to.
    mut happens(event: Event) = each;
    /// Whether it may do anything otherwise before somebody tells it to.
    ref stirs() -> bool = own(true);
}

impl Agv {
    /// Switches a deviation on.
    pub(crate) fn switch_on(&mut self, deviation: Hook) {
        self.hooks.push(deviation);
    }

    /// A part of a message as it is worded; `None` if it is not listed.
    pub(crate) fn said(&self, part: Part<'_>, mut words: Value) -> Option<Value> {
        let listed = words.as_object_mut().is_none_or(|words| self.says(part, words));
        listed.then_some(words)
    }

    /// When a state tells that something changed.
    pub(crate) fn tells(&mut self, changes: Changes, requested: bool) -> Telling {
        let mut telling = Telling::Now;
        for index in 0..self.hooks.len() {
            if let Some(mut hook) = self.hooks.take(index) {
                telling = telling.max(hook.tells(self, changes, requested));
                self.hooks.put_back(index, hook);
            }
        }
        telling
    }

    /// The way over an edge with a trajectory, if it is not straight.
    pub(crate) fn bends(&self, edge: &Edge, path: Path) -> Option<Path> {
        let mut hooks = self.hooks.iter();
        hooks.try_fold(path, |path, hook| hook.bends(self, edge, path))
    }

    /// Refuses an order because of something, unless that is overlooked.
    pub(crate) fn object(&self, what: Objection<'_>, refusal: Refusal) -> Result<(), Refusal> {
        match self.allows(Permission::Overlook(what), false) {
            true => Ok(()),
            false => Err(refusal),
        }
    }

    /// Refuses an order because of an objection that nobody else has.
    pub(crate) fn objected(&self, order: &Order, relation: Relation) -> Result<(), Refusal> {
        self.objects(order, relation).map_or(Ok(()), Err)
    }

    /// An order as it is read.
    pub(crate) fn read<'a>(&self, message: &'a Value) -> Cow<'a, Value> {
        if self.hooks.len() == 0 {
            return Cow::Borrowed(message);
        }
        let mut read = message.clone();
        self.reads(&mut read);
        Cow::Owned(read)
    }

    /// Lists an error, if it is to be listed.
    pub(crate) fn raise(&mut self, cause: Cause<'_>, mut error: ActiveError) {
        let rule = self.config.error_rules.get(&error.error_type);
        error.life = match rule.map_or(ErrorEnd::Cause, |rule| rule.until) {
            ErrorEnd::NewOrder => Life::UntilNewOrder,
            ErrorEnd::InstantAction => Life::UntilInstantAction,
            ErrorEnd::MapAction => Life::UntilMapAction,
            ErrorEnd::Mode => Life::UntilAvailable,
            ErrorEnd::Cause => error.life,
        };
        if self.raises(cause, &mut error) {
            self.errors.raise(error);
        }
    }

    /// Lists the error of an order that is refused.
    pub(crate) fn raise_refusal(&mut self, rule: Rule, message: &Value, error: ActiveError) {
        self.raise(Cause::Refusal(rule, message), error);
    }

    /// Lists the error of a cancelOrder that finds no order.
    pub(crate) fn raise_nothing_to_cancel(&mut self, error: ActiveError) {
        self.raise(Cause::NothingToCancel, error);
    }

    /// Lists the error of an action that has failed.
    pub(crate) fn raise_failure(&mut self, action: Option<&Action>, error: ActiveError) {
        self.raise(Cause::Failure(action), error);
    }

    /// Whether everything stays as usual until something comes in.
    pub(crate) fn is_left_alone(&self) -> bool {
        !self.hooks.iter().any(|hook| hook.stirs(self))
    }

    /// When a deviation wants to be told that time has passed.
    pub(crate) fn due(&self) -> Option<Moment> {
        self.hooks.iter().filter_map(|hook| hook.due(self)).min()
    }
}
