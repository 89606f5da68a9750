//! The seam: where the behaviour of a vehicle can be changed from outside.
//!
//! The vehicle asks here at its points of decision and says here what happens (`points` has the words for both). Every
//! default is the conformant behaviour; with nothing switched on there is nobody to be asked.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::time::Duration;

use serde_json::{Map, Value};

use super::actions::{Action, Origin, Status};
use super::book::Stop;
use super::deeds::Outcome;
use super::errors::ActiveError;
use super::order_message::{Corridor, Edge, Order};
use super::rejection::{Refusal, Rule};
use super::report::{Changes, Telling};
use super::{Agv, AgvConfig};
use crate::ConnectOptions;
use tck_base::clock::Moment;
use tck_base::nurbs::Path;

pub(crate) use super::objections::{Adoption, Lack, Objection, Relation};
pub(crate) use super::points::{Cause, Event, Head, Hindrance, Outgoing, Part, Permission, Span};
pub(crate) use super::way::{Course, Leg};

/// One that is switched on.
pub(crate) type Hook = Box<dyn Deviation>;

/// Where a vehicle can be made to deviate. Every default is the conformant behaviour.
#[expect(unused_variables, reason = "the defaults leave everything as it is")]
pub(crate) trait Deviation: Send {
    /// The vehicle is made.
    fn configures(&self, config: &mut AgvConfig) {}

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
    fn lasts(&self, agv: &Agv, what: Span<'_>, usual: Duration) -> Duration {
        usual
    }

    /// Somebody does something to the vehicle; false when nothing is left to be done.
    fn asked(&mut self, agv: &mut Agv, command: &str, arguments: &Value) -> bool {
        true
    }

    /// A message of a topic name came in; false to overlook it.
    fn hears(&mut self, agv: &mut Agv, name: &str, payload: &[u8]) -> bool {
        true
    }

    /// The actions of an instantActions message are read.
    fn reads_instants(&mut self, agv: &mut Agv, actions: &mut Vec<&Value>) {}

    /// Whether something that changed is told in a state.
    fn tells(&mut self, agv: &mut Agv, changes: Changes, requested: bool) -> Telling {
        Telling::Now
    }

    /// The way over an edge with a trajectory; `None` for a straight one.
    fn bends(&self, agv: &Agv, edge: &Edge, path: Path) -> Option<Path> {
        Some(path)
    }

    /// The corridor of an edge, as the vehicle understands it.
    fn keeps_to(&self, agv: &Agv, corridor: &mut Corridor) {}

    /// An order is read; it may be taken for something else.
    fn reads(&self, agv: &Agv, message: &mut Value) {}

    /// Whether it has another objection against an order.
    fn objects(&self, agv: &Agv, order: &Order, relation: Relation) -> Option<Refusal> {
        None
    }

    /// An order is taken over, and may be changed; false when nothing is left to be done.
    fn adopts(&mut self, agv: &mut Agv, adoption: &mut Adoption<'_>) -> bool {
        true
    }

    /// Which way it drives to a node.
    fn steers(&self, agv: &Agv, course: &mut Course<'_>) {}

    /// A leg is planned.
    fn plans(&self, agv: &Agv, leg: &mut Leg<'_>) {}

    /// The orientation it takes on a node before that counts as traversed.
    fn faces(&self, agv: &Agv, stop: &Stop, wanted: Option<f64>) -> Option<f64> {
        wanted
    }

    /// The actions of a node or an edge are queued, cut where nothing may run in parallel.
    fn queues(&self, agv: &Agv, origin: Origin, phases: &mut VecDeque<Vec<String>>) {}

    /// How an action ends because its order is cancelled; `None` if it does not.
    fn breaks(&self, agv: &Agv, action: &Action, usual: Option<Status>) -> Option<Status> {
        usual
    }

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

    pub(crate) fn asked(&mut self, command: &str, arguments: &Value) -> bool {
        let mut open = true;
        self.each(|one, agv| open = open && one.asked(agv, command, arguments));
        open
    }

    pub(crate) fn hears(&mut self, name: &str, payload: &[u8]) -> bool {
        let mut kept = true;
        self.each(|one, agv| kept = kept && one.hears(agv, name, payload));
        kept
    }

    pub(crate) fn reads_instants(&mut self, actions: &mut Vec<&Value>) {
        self.each(|one, agv| one.reads_instants(agv, actions));
    }

    pub(crate) fn tells(&mut self, changes: Changes, requested: bool) -> Telling {
        let mut telling = Telling::Now;
        self.each(|one, agv| telling = telling.max(one.tells(agv, changes, requested)));
        telling
    }

    pub(crate) fn bends(&self, edge: &Edge, path: Path) -> Option<Path> {
        let mut all = self.seam.all();
        all.try_fold(path, |path, one| one.bends(self, edge, path))
    }

    pub(crate) fn keeps_to(&self, corridor: &mut Corridor) {
        self.seam.all().for_each(|one| one.keeps_to(self, corridor));
    }

    /// Refuses an order because of something, unless that is overlooked.
    pub(crate) fn object(&self, what: Objection<'_>, refusal: Refusal) -> Result<(), Refusal> {
        match self.allows(Permission::Overlook(what), false) {
            true => Ok(()),
            false => Err(refusal),
        }
    }

    pub(crate) fn objects(&self, order: &Order, relation: Relation) -> Result<(), Refusal> {
        let mut all = self.seam.all();
        all.find_map(|one| one.objects(self, order, relation))
            .map_or(Ok(()), Err)
    }

    pub(crate) fn adopts(&mut self, mut adoption: Adoption<'_>) -> bool {
        let mut open = true;
        self.each(|one, agv| open = open && one.adopts(agv, &mut adoption));
        open
    }

    pub(crate) fn steers(&self, course: &mut Course<'_>) {
        self.seam.all().for_each(|one| one.steers(self, course));
    }

    pub(crate) fn plans(&self, leg: &mut Leg<'_>) {
        self.seam.all().for_each(|one| one.plans(self, leg));
    }

    pub(crate) fn faces(&self, stop: &Stop, wanted: Option<f64>) -> Option<f64> {
        let all = self.seam.all();
        all.fold(wanted, |wanted, one| one.faces(self, stop, wanted))
    }

    pub(crate) fn queues(&self, origin: Origin, phases: &mut VecDeque<Vec<String>>) {
        self.seam.all().for_each(|one| one.queues(self, origin, phases));
    }

    pub(crate) fn breaks(&self, action: &Action, usual: Option<Status>) -> Option<Status> {
        let all = self.seam.all();
        all.fold(usual, |usual, one| one.breaks(self, action, usual))
    }

    pub(crate) fn lasts(&self, what: Span<'_>, usual: Duration) -> Duration {
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

    /// Lists an error, if it is to be listed.
    pub(crate) fn raise(&mut self, cause: Cause<'_>, mut error: ActiveError) {
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
