//! The order in which tests run: what needs nothing of a vehicle comes first, and what may strand or block it last; behind
//! all of that come the rows of a table of which a few were run already.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use tck_pack::{HookRisk, Hooks};
use tck_profile::SampleKind;
use tck_suite::model::{Test, Verb};

/// What a test may do to a vehicle at worst; more is later.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Risk {
    /// It is only looked at.
    Nothing,
    /// It is driven, and stopped.
    Driven,
    /// It handles loads, or charges.
    Loaded,
    /// Its connection is disturbed.
    Connection,
    /// Something is done to it by hand.
    ByHand,
    /// Its maps, its zones or its place on them change.
    Maps,
    /// Its mode, its pause or its safety is changed.
    Modes,
    /// A fault is brought about.
    Faults,
    /// It is switched off, sent to sleep, or may not find back to the broker.
    Power,
    /// Its certificate is replaced, so that it may not be let in any more.
    Certificate,
}

/// So many rows of a table come in their place; the others are look-alikes, and come behind.
const IN_PLACE: usize = 6;

/// So many rows of a table fail before the rest of it goes behind everything else.
const FAILURES: usize = 3;

/// The tests by what they may do to the vehicle; where that is the same, as they stood. Where somebody waits, variety comes
/// first: of a table only the first rows come in their place.
pub(super) fn by_risk(tests: &mut [Arc<Test>], hooks: &Hooks, somebody_waits: bool) {
    // Conversations come as they were drawn: else no budget would ever come to some of them.
    if tests.iter().all(|test| !test.conversation.is_empty()) {
        return;
    }
    let mut rows: BTreeMap<String, usize> = BTreeMap::new();
    let mut behind: BTreeMap<String, bool> = BTreeMap::new();
    for test in tests.iter().filter(|_| somebody_waits) {
        let row = rows.entry(table(test).to_owned()).or_default();
        behind.insert(test.id.clone(), *row >= IN_PLACE);
        *row += 1;
    }
    // Once for each test: the texts of its steps are searched.
    tests.sort_by_cached_key(|test| (behind.get(&test.id).copied(), risk(test, hooks)));
}

/// What a test is a row of, if it is one.
fn table(test: &Test) -> &str {
    test.id.split_once('[').map_or(test.id.as_str(), |(table, _)| table)
}

/// Counts the failures of each table.
#[derive(Debug, Default)]
pub(super) struct FailingTables(BTreeMap<String, usize>);

impl FailingTables {
    /// A row has failed: when too many did, those of its table that wait go behind everything else. `true` when some went.
    pub(super) fn failed(&mut self, test: &Test, tests: &[Arc<Test>], queue: &mut VecDeque<(usize, bool)>) -> bool {
        let failures = self.0.entry(table(test).to_owned()).or_default();
        *failures += 1;
        if *failures != FAILURES {
            return false;
        }
        let is_alike = |(at, _): &(usize, bool)| tests.get(*at).is_some_and(|other| table(other) == table(test));
        let (alike, rest): (Vec<_>, Vec<_>) = queue.drain(..).partition(is_alike);
        let any = !alike.is_empty() && !rest.is_empty();
        queue.extend(rest.into_iter().chain(alike));
        any
    }
}

fn risk(test: &Test, hooks: &Hooks) -> Risk {
    let mut worst = if test.moves { Risk::Driven } else { Risk::Nothing };
    if test
        .course
        .stations()
        .any(|station| SampleKind::of_variable(station).is_some())
    {
        worst = worst.max(Risk::Loaded);
    }
    for step in test.sections().into_iter().flat_map(|(_, steps)| steps) {
        let own = match &*step.verb {
            Verb::Link(_) => Risk::Connection,
            Verb::Operator(operator) => {
                let hook = hooks.find(&operator.hook, test.device);
                hook.map_or(Risk::ByHand, |hook| hook.risk.into())
            }
            Verb::Serve(serve) if serve.certificate.is_some() => Risk::Certificate,
            Verb::Serve(_) => Risk::Maps,
            Verb::Send(send) if send.topic == "zoneSet" => Risk::Maps,
            Verb::Send(_) => of_text(step.span.text()),
            _ => Risk::Nothing,
        };
        worst = worst.max(own);
    }
    worst
}

impl From<HookRisk> for Risk {
    fn from(risk: HookRisk) -> Self {
        match risk {
            HookRisk::ByHand => Self::ByHand,
            HookRisk::Maps => Self::Maps,
            HookRisk::Modes => Self::Modes,
            HookRisk::Faults => Self::Faults,
            HookRisk::Power => Self::Power,
        }
    }
}

/// What a message may do by the actions in it.
fn of_text(text: &str) -> Risk {
    const BY_ACTION: [(&str, Risk); 12] = [
        ("shutdown", Risk::Power),
        ("startHibernation", Risk::Power),
        ("updateCertificate", Risk::Power),
        ("startPause", Risk::Modes),
        ("initPosition", Risk::Maps),
        ("initializePosition", Risk::Maps),
        ("downloadMap", Risk::Maps),
        ("enableMap", Risk::Maps),
        ("deleteMap", Risk::Maps),
        ("downloadZoneSet", Risk::Maps),
        ("enableZoneSet", Risk::Maps),
        ("deleteZoneSet", Risk::Maps),
    ];
    let mut all = BY_ACTION.iter().filter(|(action, _)| text.contains(action));
    all.next().map_or(Risk::Nothing, |(_, risk)| *risk)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_pack::Role;

    fn all() -> Vec<Arc<Test>> {
        let library = tck_testing::library();
        library.tests(Role::Agv, &library.rules.packs.latest().id)
    }

    #[test]
    fn variety_comes_before_look_alikes_where_somebody_waits() {
        let mut tests = all();
        by_risk(&mut tests, &tck_testing::library().rules.hooks, true);
        let alike: Vec<usize> = tests
            .iter()
            .enumerate()
            .filter(|(_, test)| table(test) == "blocking/three-at-rest")
            .map(|(at, _)| at)
            .collect();
        assert!(alike.len() > IN_PLACE, "{}", alike.len());
        let mut rows: BTreeMap<&str, usize> = BTreeMap::new();
        for test in &tests {
            *rows.entry(table(test)).or_default() += 1;
        }
        let in_place: usize = rows.values().map(|count| IN_PLACE.min(*count)).sum();
        assert!(
            alike[IN_PLACE - 1] < in_place && alike[IN_PLACE] >= in_place,
            "{alike:?}"
        );
        let mut virtually = all();
        by_risk(&mut virtually, &tck_testing::library().rules.hooks, false);
        assert!(virtually.is_sorted_by_key(|test| risk(test, &tck_testing::library().rules.hooks)));
    }

    #[test]
    fn what_fails_three_times_goes_behind_everything_else() {
        let tests = all();
        let is_alike = |at: usize| table(&tests[at]) == "blocking/three-at-rest";
        let mut queue: VecDeque<(usize, bool)> = (0..tests.len()).map(|at| (at, false)).collect();
        let row = tests
            .iter()
            .find(|test| table(test) == "blocking/three-at-rest")
            .unwrap();
        let mut failing = FailingTables::default();
        assert!(!failing.failed(row, &tests, &mut queue) && !failing.failed(row, &tests, &mut queue));
        assert!(queue.iter().is_sorted());
        assert!(failing.failed(row, &tests, &mut queue));
        let first = queue.iter().position(|(at, _)| is_alike(*at)).unwrap();
        assert!(queue.iter().skip(first).all(|(at, _)| is_alike(*at)));
        assert_eq!(queue.len(), tests.len());
    }
}
