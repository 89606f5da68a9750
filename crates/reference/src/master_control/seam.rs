//! The seam: where the behaviour of a master control can be changed from outside.
//!
//! The master control asks here at its points of decision and says here what happens (`points` has the words for both).
//! Every default is the conformant behaviour; with nothing switched on there is nobody to be asked.

use std::time::Duration;

use serde_json::Value;

use super::Site;
use super::config::MasterControlConfig;
use super::seen::State;
use super::vehicle::{Running, Vehicle};

pub(crate) use super::points::{
    Event, Fate, Field, Heard, Joining, Made, Measure, Occasion, Outgoing, Permission, Plan, Span,
};

/// One that is switched on.
pub(crate) type Hook = Box<dyn Deviation>;

/// Where a master control can be made to deviate. Every default is the conformant behaviour.
#[expect(unused_variables, reason = "the defaults leave everything as it is")]
pub(crate) trait Deviation: Send {
    /// It is switched on.
    fn configures(&mut self, config: &mut MasterControlConfig) {}

    /// The connection is to be made.
    fn joins(&mut self, site: &Site, fleet: &[Vehicle], joining: &mut Joining) {}

    /// Somebody asks for something, of the vehicle of an index; false when it is done.
    fn asked(
        &mut self,
        site: &mut Site,
        fleet: &mut [Vehicle],
        index: Option<usize>,
        command: &str,
        arguments: &Value,
    ) -> bool {
        true
    }

    /// A message came in; false to drop it.
    fn hears(&mut self, site: &mut Site, vehicle: &mut Vehicle, heard: &mut Heard<'_>) -> bool {
        true
    }

    /// Something has happened, or is about to.
    fn happens(&mut self, site: &mut Site, vehicle: &mut Vehicle, event: &mut Event<'_>) {}

    /// Whether something is allowed.
    fn allows(&self, site: &Site, vehicle: &Vehicle, what: Permission<'_>, usual: bool) -> bool {
        usual
    }

    /// How long something lasts.
    fn lasts(&self, site: &Site, vehicle: &Vehicle, what: Span, usual: Duration) -> Duration {
        usual
    }

    /// How much something is.
    fn measures(&self, site: &Site, vehicle: &Vehicle, what: Measure<'_>, usual: usize) -> usize {
        usual
    }

    /// Something is planned.
    fn plans(&mut self, site: &mut Site, vehicle: &mut Vehicle, plan: &mut Plan<'_>) {}

    /// Something is made.
    fn makes(&mut self, site: &Site, vehicle: &Vehicle, made: &mut Made<'_>) {}

    /// What has become of the running order.
    fn judges(
        &mut self,
        site: &mut Site,
        vehicle: &mut Vehicle,
        running: &mut Running,
        state: &State,
        fate: Fate,
    ) -> Fate {
        fate
    }

    /// A message goes out; false to hold it back.
    fn publishes(&mut self, site: &mut Site, vehicle: &mut Vehicle, outgoing: &mut Outgoing) -> bool {
        true
    }

    /// The text of a message.
    fn writes(&self, name: &str, message: &Value, text: &mut Vec<u8>) {}
}

/// What is switched on. A place is empty while the one that stands there is asked something.
#[derive(Default)]
pub(super) struct Seam(Vec<Option<Hook>>);

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

impl Site {
    /// Switches something on.
    pub(crate) fn switch_on(&mut self, mut deviation: Hook) {
        deviation.configures(&mut self.config);
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

    pub(crate) fn joining(&mut self, fleet: &[Vehicle], joining: &mut Joining) {
        self.each(|one, site| one.joins(site, fleet, joining));
    }

    pub(crate) fn asked(
        &mut self,
        fleet: &mut [Vehicle],
        index: Option<usize>,
        command: &str,
        arguments: &Value,
    ) -> bool {
        let mut open = true;
        self.each(|one, site| open = open && one.asked(site, fleet, index, command, arguments));
        open
    }

    pub(crate) fn hears(&mut self, vehicle: &mut Vehicle, heard: &mut Heard<'_>) -> bool {
        let mut kept = true;
        self.each(|one, site| kept = kept && one.hears(site, vehicle, heard));
        kept
    }

    pub(crate) fn happens(&mut self, vehicle: &mut Vehicle, mut event: Event<'_>) {
        self.each(|one, site| one.happens(site, vehicle, &mut event));
    }

    pub(crate) fn allows(&self, vehicle: &Vehicle, what: Permission<'_>, usual: bool) -> bool {
        let all = self.seam.all();
        all.fold(usual, |usual, one| one.allows(self, vehicle, what, usual))
    }

    pub(crate) fn lasts(&self, vehicle: &Vehicle, what: Span, usual: Duration) -> Duration {
        let all = self.seam.all();
        all.fold(usual, |usual, one| one.lasts(self, vehicle, what, usual))
    }

    pub(crate) fn measures(&self, vehicle: &Vehicle, what: Measure<'_>, usual: usize) -> usize {
        let all = self.seam.all();
        all.fold(usual, |usual, one| one.measures(self, vehicle, what, usual))
    }

    pub(crate) fn plans(&mut self, vehicle: &mut Vehicle, mut plan: Plan<'_>) {
        self.each(|one, site| one.plans(site, vehicle, &mut plan));
    }

    pub(crate) fn makes(&mut self, vehicle: &Vehicle, mut made: Made<'_>) {
        self.each(|one, site| one.makes(site, vehicle, &mut made));
    }

    pub(crate) fn judges(&mut self, vehicle: &mut Vehicle, running: &mut Running, state: &State, fate: Fate) -> Fate {
        let mut fate = fate;
        self.each(|one, site| fate = one.judges(site, vehicle, running, state, fate));
        fate
    }

    pub(crate) fn publishes(&mut self, vehicle: &mut Vehicle, outgoing: &mut Outgoing) -> bool {
        let mut kept = true;
        self.each(|one, site| kept = kept && one.publishes(site, vehicle, outgoing));
        kept
    }

    /// The text of a message.
    pub(crate) fn text(&self, name: &str, message: &Value) -> Vec<u8> {
        let mut text = message.to_string().into_bytes();
        for one in self.seam.all() {
            one.writes(name, message, &mut text);
        }
        text
    }
}
