//! The monitors on duty, for every vehicle of a run.
//!
//! When an AGV is tested there is one vehicle. A master control has one topic tree for each vehicle it commands: every
//! mock AGV gets monitors of its own, and what they find is put together. What belongs to no vehicle, such as the
//! CONNECT packet, is shown to the monitors of the first one only.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use super::hidden::Hidden;
use super::monitor::{FIRST, Knowledge, MonitorJudge};
use super::run_contexts::Ground;
use super::timeline::Timeline;
use tck_base::clock::Moment;
use tck_base::pattern::Bindings;
use tck_base::verdict::{Accumulated, Verdict};
use tck_check::Shared;
use tck_journal::Entry;
use tck_journal::event::{Event, Packet};
use tck_result::{MonitorFinding, MonitorResult};
use tck_suite::model::Monitor;
use tck_world::{FleetSeen, Listens, Observer, World};

/// Something a monitor found.
#[derive(Clone, Debug, PartialEq)]
pub struct Observed {
    /// Id of the monitor.
    pub monitor: String,
    /// What it found.
    pub finding: MonitorFinding,
}

/// All monitors.
pub(super) struct MonitorSet {
    first: MonitorGroup,
    /// Those of further vehicles, with what is known of them.
    others: Vec<(Ground, MonitorGroup)>,
    /// What came to all of them.
    fleet: Rc<RefCell<FleetSeen>>,
}

/// The monitors of one vehicle.
struct MonitorGroup {
    monitors: Vec<MonitorJudge>,
    /// What each of them has to be shown: to read these is all that most records cost.
    listens: Vec<Listens>,
    /// Whether something was found since it was taken last.
    has_found: bool,
    observer: Observer,
    known: Knowledge,
}

impl MonitorGroup {
    fn begin(monitors: &[&Arc<Monitor>], ground: &Ground, tap: bool, fleet: &Rc<RefCell<FleetSeen>>) -> Self {
        let bindings = Bindings::above(vec![ground.pack.words(), Arc::clone(&ground.bindings)]);
        let mut known = Knowledge {
            world: World::of_fleet(fleet),
            shared: Shared::default(),
        };
        let all = monitors.iter();
        let monitors: Vec<MonitorJudge> = all
            .filter_map(|monitor| MonitorJudge::start(monitor, ground, &bindings, tap, &mut known))
            .collect();
        Self {
            listens: monitors.iter().map(MonitorJudge::listens).collect(),
            has_found: false,
            monitors,
            observer: Observer::new(&ground.topics, &ground.pack, ground.role),
            known,
        }
    }

    fn observe(&mut self, entry: &Entry, subject: Option<&str>, ground: &Ground) {
        let record = self.observer.see(entry);
        self.known.world.learn(&record, &ground.setting());
        if matches!(entry.event(), Event::TestBegun { .. }) {
            self.monitors.iter_mut().for_each(MonitorJudge::test_begins);
        }
        let kind = record.kind();
        for (monitor, listens) in self.monitors.iter_mut().zip(&self.listens) {
            if listens.hears(kind) {
                self.has_found |= monitor.observe(&record, subject, ground, &self.known);
            }
        }
    }

    fn finish(&mut self, end: Moment, ground: &Ground) {
        let end = self.observer.end(end);
        self.has_found = true;
        for monitor in &mut self.monitors {
            monitor.finish(&end, ground, &self.known);
        }
    }
}

/// A monitor and what it found on all vehicles.
pub(super) struct MonitorReport {
    pub monitor: Arc<Monitor>,
    pub result: MonitorResult,
    /// The requirements of which something was judged.
    judged: Vec<String>,
    /// Why nothing can be judged, though it should be.
    open: Option<String>,
}

impl MonitorReport {
    /// What it says about each requirement it is bound to, or found something about.
    pub fn decisions(&self) -> Vec<(String, Verdict)> {
        let found = self.result.findings.iter();
        let mut all: Vec<(String, Verdict)> = found.map(|f| (f.requirement.clone(), f.verdict)).collect();
        all.extend(self.judged.iter().map(|id| (id.clone(), Verdict::Pass)));
        if self.open.is_some() {
            let bound = self.monitor.checks.iter();
            all.extend(bound.map(|binding| (binding.requirement.as_str().to_owned(), Verdict::Inconclusive)));
        }
        all
    }

    /// Puts together what it found in a run and in the one after it.
    pub fn go_on(&mut self, later: Self) {
        for finding in &later.result.findings {
            let own = self.result.findings.iter_mut();
            let mut same = own.filter(|own| own.requirement == finding.requirement && own.verdict == finding.verdict);
            if let Some(known) = same.next() {
                let room = FIRST.saturating_sub(known.first.len());
                known.first.extend(finding.first.iter().take(room));
            }
        }
        self.absorb(later.result, later.judged);
    }

    fn absorb(&mut self, other: MonitorResult, judged: Vec<String>) {
        for id in judged {
            if !self.judged.contains(&id) {
                self.judged.push(id);
            }
        }
        self.result.judged += other.judged;
        for finding in other.findings {
            let known = self
                .result
                .findings
                .iter_mut()
                .find(|known| known.requirement == finding.requirement && known.verdict == finding.verdict);
            match known {
                Some(known) => known.count += finding.count,
                None => self.result.findings.push(finding),
            }
        }
        let verdicts: Accumulated = [self.result.verdict, other.verdict].into_iter().flatten().collect();
        self.result.verdict = verdicts.get();
    }
}

impl MonitorSet {
    /// Puts the monitors on duty. `ground` is that of the first vehicle.
    pub fn begin(monitors: &[&Arc<Monitor>], ground: &Ground, others: Vec<Ground>, tap: bool) -> Self {
        let fleet = Rc::default();
        let others = others.into_iter().map(|ground| {
            let own = MonitorGroup::begin(monitors, &ground, tap, &fleet);
            (ground, own)
        });
        Self {
            first: MonitorGroup::begin(monitors, ground, tap, &fleet),
            others: others.collect(),
            fleet,
        }
    }

    /// Keeps apart what says different things, for those who take what was found after each entry.
    pub fn apart(mut self) -> Self {
        let others = self.others.iter_mut().map(|(_, watch)| watch);
        for monitor in std::iter::once(&mut self.first)
            .chain(others)
            .flat_map(|watch| &mut watch.monitors)
        {
            monitor.keep_apart();
        }
        self
    }

    /// Shows the next entry to those it concerns.
    pub fn observe(&mut self, entry: &Entry, subject: Option<&str>, timeline: &Timeline, ground: &Ground) {
        let place = timeline.place(entry);
        match place {
            Some(place) if !self.others.is_empty() => {
                let own = place.vehicle.checked_sub(1).and_then(|at| self.others.get(at));
                let names = own.map_or(ground, |(ground, _)| ground).pack.names();
                self.fleet.borrow_mut().note(entry, place.vehicle, &place.name, names);
            }
            Some(_) => {}
            None => self.fleet.borrow_mut().link(entry),
        }
        if place.is_none_or(|place| place.vehicle == 0) {
            // What the harness's own vehicles say is context, and not the subject of any monitor.
            let subject = subject.filter(|_| !matches!(entry.event(), Event::Sent { .. }));
            self.first.observe(entry, subject, ground);
        }
        if self.others.is_empty() {
            return;
        }
        match place {
            Some(place) => {
                let own = place.vehicle.checked_sub(1).and_then(|at| self.others.get_mut(at));
                let Some((ground, watch)) = own else { return };
                let subject = matches!(entry.event(), Event::Message { .. }).then_some(place.name.as_str());
                watch.observe(entry, subject, ground);
            }
            None if is_of_connection(entry) => {}
            None => {
                for (ground, watch) in &mut self.others {
                    watch.observe(entry, None, ground);
                }
            }
        }
    }

    /// The run has ended.
    pub fn finish(&mut self, end: Moment, ground: &Ground) {
        self.first.finish(end, ground);
        for (ground, watch) in &mut self.others {
            watch.finish(end, ground);
        }
    }

    /// What shows nothing in the running test.
    pub fn hidden(&self) -> Vec<Hidden> {
        let others = self.others.iter().flat_map(|(_, watch)| &watch.monitors);
        let all = self.first.monitors.iter().chain(others);
        all.flat_map(MonitorJudge::hidden).collect()
    }

    /// The members that show nothing any more for what monitors have found in this run, with the requirement.
    pub fn accused(&self) -> Vec<(String, String)> {
        self.first.monitors.iter().flat_map(MonitorJudge::accused).collect()
    }

    /// Takes what was found since it was taken last, so that it is kept nowhere else.
    pub fn take(&mut self) -> Vec<Observed> {
        let others = self.others.iter_mut().map(|(_, watch)| watch);
        let all = std::iter::once(&mut self.first).chain(others);
        let all = all.filter_map(|watch| std::mem::take(&mut watch.has_found).then_some(&mut watch.monitors));
        let found = all.flatten().flat_map(|monitor| {
            let id = monitor.monitor().id.clone();
            let taken = monitor.take().into_iter();
            taken.map(move |finding| Observed {
                monitor: id.clone(),
                finding,
            })
        });
        found.collect()
    }

    /// The requirements of which something was judged, with the monitor.
    pub fn decided(&self) -> Vec<(String, String)> {
        let others = self.others.iter().flat_map(|(_, watch)| &watch.monitors);
        let all = self.first.monitors.iter().chain(others);
        let judged = all.flat_map(|monitor| {
            let id = &monitor.monitor().id;
            monitor
                .judged()
                .into_iter()
                .map(move |requirement| (requirement, id.clone()))
        });
        judged.collect()
    }

    /// How many entries each monitor has judged, by its id.
    pub fn judged(&self) -> BTreeMap<String, u64> {
        let others = self.others.iter().flat_map(|(_, watch)| &watch.monitors);
        let mut all = BTreeMap::new();
        for monitor in self.first.monitors.iter().chain(others) {
            *all.entry(monitor.monitor().id.clone()).or_default() += monitor.count();
        }
        all
    }

    /// What was found, monitor by monitor.
    pub fn results(&self) -> Vec<MonitorReport> {
        let mut all: Vec<MonitorReport> = self.first.monitors.iter().map(of).collect();
        for monitor in self.others.iter().flat_map(|(_, watch)| &watch.monitors) {
            let known = all.iter_mut().find(|known| known.result.id == monitor.monitor().id);
            match known {
                Some(known) => known.absorb(monitor.result(), monitor.judged()),
                // A vehicle of another version may have monitors that the first one has not.
                None => all.push(of(monitor)),
            }
        }
        all
    }
}

fn of(monitor: &MonitorJudge) -> MonitorReport {
    MonitorReport {
        monitor: Arc::clone(monitor.monitor()),
        result: monitor.result(),
        judged: monitor.judged(),
        open: monitor.open().map(str::to_owned),
    }
}

/// Whether an entry is about a connection as a whole. That a connection is opened anew is of use to all.
fn is_of_connection(entry: &Entry) -> bool {
    match entry.event() {
        Event::Packet {
            packet: Packet::Connect { .. },
            ..
        } => false,
        Event::Opened { .. } | Event::Packet { .. } | Event::Undecodable { .. } | Event::Closed { .. } => true,
        _ => false,
    }
}
