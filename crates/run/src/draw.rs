//! Which of the many cases that come from a schema or a matrix a run takes.
//!
//! Every way to break a message, or row of the first axis, is taken at least once where there is room for it, and the
//! members are spread evenly over the schema. Which of them it is depends on a seed: the same one takes the same cases.

use std::collections::BTreeMap;
use std::sync::Arc;

use tck_suite::model::{Kind, Test};

/// What came of it.
pub(super) struct Drawing {
    /// The tests, in their order.
    pub(super) tests: Vec<Arc<Test>>,
    /// How many cases that were drawn are among them.
    pub(super) taken: usize,
    /// Out of how many that apply.
    pub(super) of: usize,
}

/// Leaves out cases of tables that come from a schema or a matrix. `applies` says which can be run at all: those are taken first.
pub(super) fn draw(tests: &[Arc<Test>], seed: u64, applies: impl Fn(&Test) -> bool) -> Drawing {
    let mut tables: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (at, test) in tests.iter().enumerate() {
        if test.drawn.is_some() {
            tables.entry(test.table()).or_default().push(at);
        }
    }
    let mut takes: Vec<bool> = tests.iter().map(|test| test.drawn.is_none()).collect();
    let (mut taken, mut of) = (0, 0);
    for (table, all) in &tables {
        let fit: Vec<usize> = all.iter().copied().filter(|at| applies(&tests[*at])).collect();
        of += fit.len();
        if fit.is_empty() {
            // One of them says why none is run.
            takes[all[0]] = true;
            continue;
        }
        for at in of_table(tests, &fit, mixed(seed, table)) {
            takes[at] = true;
            taken += 1;
        }
    }
    let chosen = tests.iter().zip(&takes).filter(|(_, takes)| **takes);
    Drawing {
        tests: chosen.map(|(test, _)| Arc::clone(test)).collect(),
        taken,
        of,
    }
}

/// The cases of one table that are taken.
fn of_table(tests: &[Arc<Test>], fit: &[usize], seed: u64) -> Vec<usize> {
    let mut ways: BTreeMap<&Kind, Vec<usize>> = BTreeMap::new();
    let mut room = 0;
    for at in fit {
        if let Some(drawn) = &tests[*at].drawn {
            ways.entry(&drawn.kind).or_default().push(*at);
            room = drawn.draw;
        }
    }
    let room = room.min(fit.len());
    let mut shares: Vec<(usize, Vec<usize>)> = ways.into_values().map(|cases| (0, cases)).collect();
    let count = shares.len();
    let begin = turned(seed, count);
    for step in 0..room.min(count) {
        shares[(begin + step) % count].0 = 1;
    }
    // What room is left goes to the ways with the most cases for each that is taken.
    for _ in count..room {
        let left = shares.iter_mut().filter(|(share, cases)| *share < cases.len());
        if let Some((share, _)) = left.max_by_key(|(share, cases)| 1_000 * cases.len() / (share + 1)) {
            *share += 1;
        }
    }
    let mut chosen = Vec::new();
    for (nth_way, (share, cases)) in shares.into_iter().enumerate() {
        // Each way begins at another part of the schema, so that one member is not broken in all of them.
        let begin = turned(seed >> 16, cases.len()) + nth_way * cases.len() / count;
        chosen.extend((0..share).map(|nth| cases[(begin + nth * cases.len() / share) % cases.len()]));
    }
    chosen
}

/// A place below `count`.
fn turned(seed: u64, count: usize) -> usize {
    let count = u64::try_from(count).unwrap_or(u64::MAX).max(1);
    usize::try_from(seed % count).unwrap_or(0)
}

/// A number that differs between tables of one seed (FNV-1a).
fn mixed(seed: u64, table: &str) -> u64 {
    let begin = 0xcbf2_9ce4_8422_2325 ^ seed;
    let mixed = table.bytes().chain(seed.to_le_bytes()).fold(begin, |mixed, byte| {
        (mixed ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    mixed >> 16
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use tck_pack::Role;

    fn ids(tests: &[Arc<Test>]) -> Vec<&str> {
        tests.iter().map(|test| test.id.as_str()).collect()
    }

    #[test]
    fn every_way_is_taken_and_over_the_seeds_every_case() {
        let library = tck_testing::library();
        let latest = library.rules.packs.latest();
        let all = library.tests(Role::Agv, &latest.id);
        let cases: Vec<&Arc<Test>> = all.iter().filter(|test| test.drawn.is_some()).collect();
        assert!(cases.len() > 100, "{}", cases.len());
        let mut seen = BTreeSet::new();
        // Which cells of a large matrix a seed takes is chance, so there are enough seeds for the last of them.
        for seed in 0..20_000 {
            if seed >= 100 && cases.iter().all(|test| seen.contains(&test.id)) {
                break;
            }
            let drawing = draw(&all, seed, |_| true);
            if seed >= 100 {
                seen.extend(drawing.tests.iter().map(|test| test.id.clone()));
                continue;
            }
            assert_eq!(drawing.of, cases.len());
            assert!(drawing.taken < cases.len() / 3);
            assert_eq!(ids(&drawing.tests), ids(&draw(&all, seed, |_| true).tests));
            for test in &drawing.tests {
                seen.insert(test.id.clone());
                let Some(drawn) = &test.drawn else { continue };
                let of_table = |other: &&Arc<Test>| other.table() == test.table();
                let count = drawing.tests.iter().filter(of_table).count();
                let possible = all.iter().filter(of_table).count();
                assert_eq!(count, drawn.draw.min(possible), "{}", test.id);
                let ways = |tests: &[Arc<Test>]| -> BTreeSet<Kind> {
                    let of_table = tests.iter().filter(of_table);
                    of_table
                        .filter_map(|test| Some(test.drawn.as_ref()?.kind.clone()))
                        .collect()
                };
                assert_eq!(
                    ways(&drawing.tests).len(),
                    ways(&all).len().min(drawn.draw),
                    "{}",
                    test.id
                );
            }
        }
        let missed: Vec<&str> = ids(&all).into_iter().filter(|id| !seen.contains(*id)).collect();
        assert!(missed.is_empty(), "{missed:?}");
    }

    #[test]
    fn a_table_of_which_nothing_applies_is_still_named() {
        let library = tck_testing::library();
        let all = library.tests(Role::Agv, &library.rules.packs.latest().id);
        let drawing = draw(&all, 1, |_| false);
        let tables =
            |tests: &[Arc<Test>]| -> BTreeSet<String> { tests.iter().map(|test| test.table().to_owned()).collect() };
        assert_eq!(tables(&drawing.tests), tables(&all));
        assert_eq!((drawing.taken, drawing.of), (0, 0));
    }
}
