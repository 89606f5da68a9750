//! What is unproven when the faults are found: the faults that are about it are tried, then every fault.
//!
//! What the suites say no fault is known to fail is left out: to try everything on it would cost minutes and show what
//! is known.

use std::collections::{BTreeMap, BTreeSet};

use super::DRAWN;
use super::decider::Decider;
use super::kill::{Kill, KillContext, concerns, each, merge};
use tck_engine::EngineError;
use tck_reference::Fault;
use tck_suite::Exceptions;
use tck_suite::model::Test;

/// How many faults are tried before it is looked again what is still unproven.
const CHUNK: usize = 12;

/// What there is to prove, and on what.
pub(super) struct Rest<'r> {
    grounds: &'r KillContext<'r>,
    /// What passes on the faultless device, but for what the suites say no fault is known to fail.
    deciders: Vec<&'r Decider>,
}

impl<'r> Rest<'r> {
    pub(super) fn new(grounds: &'r KillContext<'r>, deciders: &'r BTreeSet<Decider>, exceptions: &Exceptions) -> Self {
        let excused = |decider: &Decider| exceptions.unproven.iter().any(|one| decider.is(one));
        let deciders = deciders.iter().filter(|decider| !excused(decider)).collect();
        Self { grounds, deciders }
    }

    /// Tries what is left with the faults that are about it, then with all of them.
    ///
    /// # Errors
    /// When a run cannot be carried out.
    pub(super) fn prove(&self, faults: &[Fault], kills: &mut [Kill]) -> Result<(), EngineError> {
        self.try_the_concerned(faults, kills)?;
        self.try_on_monitors(kills)?;
        self.try_drawn_on_monitors(faults, kills)?;
        self.try_all(faults, kills)?;
        self.try_alone(faults, kills)
    }

    /// What none of these kills proves.
    fn open(&self, kills: &[Kill]) -> Vec<&'r Decider> {
        let killed: BTreeSet<&Decider> = kills.iter().flat_map(|kill| kill.deciders.keys()).collect();
        let open = self.deciders.iter().filter(|decider| !killed.contains(*decider));
        open.copied().collect()
    }

    /// The tests of which something is open.
    fn open_places(&self, kills: &[Kill]) -> BTreeSet<&'r str> {
        let open = self.open(kills).into_iter();
        open.filter_map(|one| one.place.split(' ').next()).collect()
    }

    /// The requirements of the monitors that are open.
    fn open_monitored(&self, kills: &[Kill]) -> BTreeSet<&'r str> {
        let tables = self.grounds.tables();
        let is_monitor = |decider: &Decider| !decider.place.contains(' ') && !tables.contains(&decider.place.as_str());
        let open = self.open(kills).into_iter().filter(|decider| is_monitor(decider));
        open.map(|decider| decider.requirement.as_str()).collect()
    }

    fn kill(&self, fault: &Fault, draw: Option<u64>, selected: &dyn Fn(&Test) -> bool) -> Result<Kill, EngineError> {
        self.grounds.kill(fault, draw, selected)
    }

    /// Tries the faults on the tests that decide what they break: first where that is what is open, then where something
    /// else is.
    fn try_the_concerned(&self, faults: &[Fault], kills: &mut [Kill]) -> Result<(), EngineError> {
        for own in [true, false] {
            self.try_where(faults, kills, DRAWN, own)?;
        }
        // What only some members show is tried on all that is drawn from.
        for own in [true, false] {
            self.try_where(faults, kills, None, own)?;
        }
        Ok(())
    }

    /// Tries each fault on the tests that decide what it breaks, in which that (`own`), or only something else, is open.
    /// With all that is drawn from, on the tests that draw.
    fn try_where(&self, faults: &[Fault], kills: &mut [Kill], draw: Option<u64>, own: bool) -> Result<(), EngineError> {
        for some in faults.chunks(CHUNK) {
            let mut open: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
            for decider in self.open(kills) {
                let place = decider.place.split(' ').next().unwrap_or_default();
                open.entry(place).or_default().insert(&decider.requirement);
            }
            let more = each(some, |fault| {
                self.kill(fault, draw, &|test| {
                    let open = open.get(test.table());
                    let is_meant = open.is_some_and(|open| fault.breaks.iter().any(|id| open.contains(id)) == own);
                    is_meant && (draw.is_some() || test.drawn.is_some()) && concerns(fault, test)
                })
            })?;
            merge(kills, more);
        }
        Ok(())
    }

    /// A monitor may need other tests than those that decide the same: the faults that are about its requirement, or
    /// failed it elsewhere, are tried on everything.
    fn try_on_monitors(&self, kills: &mut [Kill]) -> Result<(), EngineError> {
        let related = |kill: &Kill, open: &BTreeSet<&str>| {
            let named = kill.fault.breaks.iter().any(|id| open.contains(*id));
            named || kill.requirements().iter().any(|id| open.contains(id))
        };
        let open = self.open_monitored(kills);
        let all: Vec<Fault> = kills
            .iter()
            .filter(|kill| related(kill, &open))
            .map(|kill| kill.fault)
            .collect();
        for some in all.chunks(CHUNK) {
            let open = self.open_monitored(kills);
            let still = |fault: &&Fault| {
                let kill = kills.iter().find(|kill| kill.fault == **fault);
                kill.is_some_and(|kill| related(kill, &open))
            };
            let some: Vec<Fault> = some.iter().filter(still).copied().collect();
            let more = each(&some, |fault| self.kill(fault, DRAWN, &|_| true))?;
            merge(kills, more);
        }
        Ok(())
    }

    /// A monitor may see only in some of the drawn cases what a fault does.
    fn try_drawn_on_monitors(&self, faults: &[Fault], kills: &mut [Kill]) -> Result<(), EngineError> {
        for some in faults.chunks(CHUNK) {
            let open = self.open_monitored(kills);
            let about = |fault: &&Fault| fault.breaks.iter().any(|id| open.contains(*id));
            let some: Vec<Fault> = some.iter().filter(about).copied().collect();
            let more = each(&some, |fault| {
                self.kill(fault, None, &|test| {
                    let decides = test.requirements().into_iter().any(|id| open.contains(id.as_str()));
                    test.drawn.is_some() && decides && concerns(fault, test)
                })
            })?;
            merge(kills, more);
        }
        Ok(())
    }

    /// What is still open may be failed by a fault that is about something else: the tests that decide it are tried with
    /// every fault, those about similar requirements first, until all of it is proven.
    fn try_all(&self, faults: &[Fault], kills: &mut [Kill]) -> Result<(), EngineError> {
        let group = |id: &str| id.rsplit_once('-').map_or(id, |(group, _)| group).to_owned();
        let groups: BTreeSet<String> = self
            .open(kills)
            .into_iter()
            .map(|decider| group(&decider.requirement))
            .collect();
        let mut order = faults.to_vec();
        order.sort_by_key(|fault| !fault.breaks.iter().any(|id| groups.contains(&group(id))));
        for some in order.chunks(CHUNK) {
            let places = self.open_places(kills);
            let is_open = |test: &Test| places.contains(test.table());
            let mut tests = self.grounds.vehicles.iter().flat_map(|vehicle| &vehicle.request.tests);
            if !tests.any(|test| is_open(test)) {
                break;
            }
            // What a fault breaks was tried before.
            let more = each(some, |fault| {
                self.kill(fault, DRAWN, &|test| is_open(test) && !concerns(fault, test))
            })?;
            merge(kills, more);
        }
        Ok(())
    }

    /// A test may not have come to its end for what a fault did to the vehicle in another one: it is tried by itself.
    fn try_alone(&self, faults: &[Fault], kills: &mut [Kill]) -> Result<(), EngineError> {
        let open: Vec<Decider> = self.open(kills).into_iter().cloned().collect();
        for decider in open {
            let place = decider.place.split(' ').next().unwrap_or_default();
            let about = faults
                .iter()
                .filter(|fault| fault.breaks.contains(&decider.requirement.as_str()));
            let about: Vec<Fault> = about.copied().collect();
            let more = each(&about, |fault| self.kill(fault, DRAWN, &|test| test.table() == place))?;
            merge(kills, more);
        }
        Ok(())
    }
}
