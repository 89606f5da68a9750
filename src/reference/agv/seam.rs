//! The seam: where the behaviour of a vehicle can be changed from outside.
//!
//! The vehicle asks here at its points of decision and says here what happens (`points` has the words for both). Every
//! default is the conformant behaviour; with nothing switched on there is nobody to be asked.

use std::time::Duration;

use serde_json::{Map, Value};

use super::Agv;
use crate::reference::ConnectOptions;

pub(crate) use super::points::{Event, Head, Outgoing, Part, Permission, Span};

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

    pub(crate) fn happens(&mut self, event: Event) {
        self.each(|one, agv| one.happens(agv, event));
    }
}
