//! The seam: where the behaviour of a vehicle can be changed from outside.
//!
//! The vehicle asks here at its points of decision and says here what happens (`points` has the words for both). Every
//! default is the conformant behaviour; with nothing switched on there is nobody to be asked.

use std::borrow::Cow;
use std::time::Duration;

use serde_json::{Map, Value};

use super::Agv;
use super::actions::Action;
use super::deeds::Outcome;
use super::errors::ActiveError;
use super::rejection::Rule;
use crate::clock::Moment;
use crate::reference::ConnectOptions;

pub(crate) use super::points::{Cause, Event, Head, Outgoing, Part, Permission, Span};

/// One that is switched on.
pub(crate) type Hook = Box<dyn Deviation>;

/// Where a vehicle can be made to deviate. Every default is the conformant behaviour.
#[expect(unused_variables, reason = "the defaults leave everything as it is")]
pub(crate) trait Deviation: Send {
    /// The connection is to be made.
    fn joins(&mut self, agv: &Agv, options: &mut ConnectOptions) {}

    /// A part of a message is worded; false to leave it out of its list. A state is due when what is said changes.
    fn says(&self, agv: &Agv, part: Part<'_>, words: &mut Map<String, Value>) -> bool {
        true
    }

    /// A header is written.
    fn heads(&mut self, agv: &mut Agv, head: Head, header: &mut Map<String, Value>) {}

    /// A message goes out; false to hold it back.
    fn publishes(&mut self, agv: &mut Agv, outgoing: &mut Outgoing) -> bool {
        true
    }

    /// The text of a message.
    fn writes(&self, agv: &Agv, outgoing: &Outgoing, text: &mut Vec<u8>) {}

    /// Whether something is allowed.
    fn allows(&self, agv: &Agv, what: Permission<'_>, usual: bool) -> bool {
        usual
    }

    /// How long something lasts.
    fn lasts(&self, agv: &Agv, what: Span, usual: Duration) -> Duration {
        usual
    }

    /// An order is read; it may be taken for something else.
    fn reads(&self, agv: &Agv, message: &mut Value) {}

    /// An order is refused, and nothing was said about it yet.
    fn refuses(&mut self, agv: &mut Agv, message: &Value, rule: Rule) {}

    /// An error is to be listed; false to keep it to itself.
    fn raises(&mut self, agv: &mut Agv, cause: Cause<'_>, error: &mut ActiveError) -> bool {
        true
    }

    /// An action is to show its effect: what comes of it where it is done otherwise.
    fn does(&mut self, agv: &mut Agv, action: &Action) -> Option<Outcome> {
        None
    }

    /// What comes of an action that was done as usual.
    fn ends(&mut self, agv: &mut Agv, action: &Action, outcome: Outcome) -> Outcome {
        outcome
    }

    /// When it wants to be told that time has passed.
    fn due(&self) -> Option<Moment> {
        None
    }

    /// Something has happened, or is about to.
    fn happens(&mut self, agv: &mut Agv, event: Event) {}
}

/// What is switched on. A place is empty while the one that stands there is asked something.
#[derive(Default)]
pub(crate) struct Seam(Vec<Option<Hook>>);

impl std::fmt::Debug for Seam {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "Seam({})", self.0.len())
    }
}

impl Seam {
    fn all(&self) -> impl Iterator<Item = &dyn Deviation> {
        self.0.iter().flatten().map(Box::as_ref)
    }
}

impl Agv {
    /// Switches something on.
    pub(crate) fn switch_on(&mut self, deviation: Hook) {
        self.seam.0.push(Some(deviation));
    }

    fn each(&mut self, mut call: impl FnMut(&mut dyn Deviation, &mut Self)) {
        for index in 0..self.seam.0.len() {
            let Some(mut one) = self.seam.0.get_mut(index).and_then(Option::take) else {
                continue;
            };
            call(one.as_mut(), self);
            if let Some(place) = self.seam.0.get_mut(index) {
                *place = Some(one);
            }
        }
    }

    pub(crate) fn joining(&mut self, options: &mut ConnectOptions) {
        self.each(|one, agv| one.joins(agv, options));
    }

    /// Whether the part is listed; what it says may have changed.
    pub(crate) fn says(&self, part: Part<'_>, words: &mut Map<String, Value>) -> bool {
        let mut all = self.seam.all();
        all.all(|one| one.says(self, part, words))
    }

    /// The same for an object; `None` if it is not listed.
    pub(crate) fn said(&self, part: Part<'_>, mut words: Value) -> Option<Value> {
        let listed = words.as_object_mut().is_none_or(|words| self.says(part, words));
        listed.then_some(words)
    }

    pub(crate) fn heads(&mut self, head: Head, header: &mut Map<String, Value>) {
        self.each(|one, agv| one.heads(agv, head, header));
    }

    pub(crate) fn publishes(&mut self, outgoing: &mut Outgoing) -> bool {
        let mut kept = true;
        self.each(|one, agv| kept = kept && one.publishes(agv, outgoing));
        kept
    }

    pub(crate) fn writes(&self, outgoing: &Outgoing, text: &mut Vec<u8>) {
        self.seam.all().for_each(|one| one.writes(self, outgoing, text));
    }

    pub(crate) fn allows(&self, what: Permission<'_>, usual: bool) -> bool {
        let all = self.seam.all();
        all.fold(usual, |usual, one| one.allows(self, what, usual))
    }

    pub(crate) fn lasts(&self, what: Span, usual: Duration) -> Duration {
        let all = self.seam.all();
        all.fold(usual, |usual, one| one.lasts(self, what, usual))
    }

    /// An order as it is read.
    pub(crate) fn read<'a>(&self, message: &'a Value) -> Cow<'a, Value> {
        if self.seam.0.is_empty() {
            return Cow::Borrowed(message);
        }
        let mut read = message.clone();
        self.seam.all().for_each(|one| one.reads(self, &mut read));
        Cow::Owned(read)
    }

    pub(crate) fn refusing(&mut self, message: &Value, rule: Rule) {
        self.each(|one, agv| one.refuses(agv, message, rule));
    }

    fn raise(&mut self, cause: Cause<'_>, mut error: ActiveError) {
        let mut said = true;
        self.each(|one, agv| said = said && one.raises(agv, cause, &mut error));
        if said {
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

    pub(crate) fn does(&mut self, action: &Action) -> Option<Outcome> {
        let mut outcome = None;
        self.each(|one, agv| {
            if outcome.is_none() {
                outcome = one.does(agv, action);
            }
        });
        outcome
    }

    pub(crate) fn turned_out(&mut self, action: &Action, outcome: Outcome) -> Outcome {
        let mut outcome = Some(outcome);
        self.each(|one, agv| outcome = outcome.take().map(|outcome| one.ends(agv, action, outcome)));
        outcome.unwrap_or(Outcome::Open)
    }

    pub(crate) fn due(&self) -> Option<Moment> {
        self.seam.all().filter_map(Deviation::due).min()
    }

    pub(crate) fn happens(&mut self, event: Event) {
        self.each(|one, agv| one.happens(agv, event));
    }
}
