//! The parts of a run or a qualification, joined, are what it is undivided.
#![allow(clippy::expect_used, clippy::panic, reason = "a test may fail by panicking")]

use std::collections::{BTreeMap, BTreeSet};

use vda5050_tck::journal::event::ShardRecord;
use vda5050_tck::judge::{Evidence, Library, RunPart, join};
use vda5050_tck::pack::{Pack, Role};
use vda5050_tck::qualify::saved::{self, QualificationPart, QualificationResult, QualifiedSide};
use vda5050_tck::qualify::{Depth, prove, qualify};
use vda5050_tck::reference::Fault;
use vda5050_tck::run::{RequestBuilder, SelectionError, VirtualRun, run_silently};
use vda5050_tck::shard::{ChosenShard, Piece, Shard, divided};
use vda5050_tck::simulate::BuiltIn;
use vda5050_tck::{RunResult, Verdict};

/// Single tests, tables, and tables that are drawn from.
const SOME: [&str; 5] = [
    "order-rejection/lower*",
    "order-acceptance",
    "instant-actions/factsheet-request",
    "order-rejection/unreadable",
    "order-rejection/schema-values",
];

fn library() -> Library {
    vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]))
}

fn chosen(index: usize, of: usize) -> ChosenShard {
    ChosenShard {
        shard: Shard { index, of },
        origin: "--shard".to_owned(),
    }
}

/// A run of some tests, or of a part of them; `None` where the part has nothing to do.
fn run(library: &Library, pack: &Pack, role: Role, faults: &[&str], part: Option<ChosenShard>) -> Option<RunResult> {
    let mut asked = RequestBuilder::new().seed(7);
    let patterns: &[&str] = match role {
        Role::Agv => &SOME,
        Role::MasterControl => &["*"],
    };
    for pattern in patterns {
        asked = asked.select(*pattern);
    }
    if let Some(part) = part {
        asked = asked.shard(part);
    }
    let asked = match asked.build(role, library, pack) {
        Ok(asked) => asked,
        Err(SelectionError::Nothing(_)) => return None,
        Err(error) => panic!("{error}"),
    };
    let request = VirtualRun {
        tests: asked.tests,
        draw: asked.draw,
        run: asked.run,
        limits: asked.limits,
        shard: asked.shard,
        faults: faults.iter().map(|fault| (*fault).to_owned()).collect(),
        ..VirtualRun::of_role(role, library, pack)
    };
    Some(run_silently(library, pack, request).expect("a run").result)
}

/// What a result says, without what differs from run to run: times, the numbers of records, and what a monitor saw kept. That
/// depends on how a vehicle came from one test to the next.
fn said(result: &RunResult) -> String {
    let tests: BTreeMap<&str, String> = result
        .tests
        .iter()
        .map(|test| {
            let decisions: BTreeSet<String> = test
                .decisions
                .iter()
                .map(|one| format!("{} {} {}", one.requirement, one.clause, one.verdict()))
                .collect();
            (
                test.id.as_str(),
                format!("{:?} {:?} {decisions:?}", test.verdict, test.not_applicable),
            )
        })
        .collect();
    let requirements = result.requirements.iter().filter_map(|one| {
        let all = one.decided_by.iter().map(String::as_str);
        let by: BTreeSet<&str> = all.filter(|by| tests.contains_key(by)).collect();
        let is_said = one.verdict == Some(Verdict::Fail) || !by.is_empty();
        is_said.then(|| format!("{} {:?} {:?} {by:?}", one.id, one.verdict, one.not_decided))
    });
    let requirements: Vec<String> = requirements.collect();
    let monitors = result.monitors.iter();
    let monitors = monitors.filter(|one| matches!(one.verdict, Some(Verdict::Fail | Verdict::Warning)));
    let monitors: Vec<String> = monitors.map(|one| format!("{} {:?}", one.id, one.verdict)).collect();
    format!("{:?}\n{tests:#?}\n{requirements:#?}\n{monitors:#?}", result.verdict)
}

/// Holds that the parts of a run, joined, are the run.
fn parts_are_the_whole(library: &Library, pack: &Pack, role: Role, faults: &[&str], numbers: &[usize]) {
    let whole = run(library, pack, role, faults, None).expect("tests");
    for of in numbers.iter().copied() {
        let parts = (1..=of).filter_map(|index| {
            let result = run(library, pack, role, faults, Some(chosen(index, of)))?;
            Some(RunPart {
                result,
                evidence: Evidence {
                    bundle: format!("b{index}"),
                    bytes: 1,
                    sha256: format!("{index:064x}"),
                    root: None,
                },
            })
        });
        let parts: Vec<RunPart> = parts.collect();
        let tests: usize = parts.iter().map(|part| part.result.tests.len()).sum();
        assert_eq!(tests, whole.tests.len(), "{of} parts have other tests than the whole");
        let joined = join(&library.rules, &parts).expect("parts");
        let merged = joined.merged.as_ref().expect("merged");
        assert!(merged.troubles.is_empty(), "{:?}", merged.troubles);
        for (one, other) in said(&joined).lines().zip(said(&whole).lines()) {
            assert_eq!(one, other, "{of} parts");
        }
        assert_eq!(said(&joined), said(&whole), "{of} parts");
    }
}

#[test]
fn one_to_sixteen_parts_of_a_run_are_the_run() {
    let library = library();
    let pack = library.rules.packs.latest();
    let all: Vec<usize> = (2..=16).collect();
    parts_are_the_whole(&library, pack, Role::Agv, &[], &all);
    parts_are_the_whole(&library, pack, Role::Agv, &["outdated-update-taken-over"], &[2, 3, 16]);
    parts_are_the_whole(&library, pack, Role::MasterControl, &[], &[3]);
}

#[test]
fn one_to_sixteen_parts_of_a_qualification_are_the_qualification() {
    let library = library();
    let pack = library.rules.packs.latest();
    let all = library.tests(Role::Agv, &pack.id);
    let tests: Vec<_> = all
        .into_iter()
        .filter(|test| test.id.starts_with("order-rejection/lower"))
        .collect();
    assert!(!tests.is_empty());
    let about = ["ORD-REJ-10", "ORD-REJ-12", "STATE-12"];
    let is_meant = |fault: &&Fault| about.contains(&fault.breaks[0]);
    let faults: Vec<Fault> = BuiltIn::faults(Role::Agv)
        .iter()
        .filter(is_meant)
        .take(7)
        .copied()
        .collect();
    assert!(faults.len() > 3, "{faults:?}");
    let of = |faults: &[Fault], depth: Depth, shard: Option<ShardRecord>| {
        let outcome = qualify(&library, pack, &tests, faults, depth).expect("a qualification");
        let mut result = QualificationResult {
            format: saved::RESULT_FORMAT.to_owned(),
            tool: vda5050_tck::journal::tool(),
            suites_sha256: library.rules.sha256.clone(),
            tests: vec!["order-rejection/lower*".to_owned()],
            faults: Vec::new(),
            verdict: None,
            shard,
            merged: None,
            sides: vec![QualifiedSide::of(&outcome, pack, true, false)],
        };
        result.conclude();
        result
    };
    let pieces = faults.iter().map(|fault| Piece {
        name: fault.name.to_owned(),
        millis: 1,
    });
    let pieces: Vec<Piece> = pieces.collect();
    let names: Vec<&str> = faults.iter().map(|fault| fault.name).collect();
    for depth in [Depth::Everything, Depth::Clauses] {
        let whole = of(&faults, depth, None);
        for count in 1..=16 {
            let places = divided(&pieces, count);
            let filled = count.min(faults.len());
            let parts = (1..=filled).map(|index| {
                let own = faults.iter().zip(&places).filter(|(_, place)| **place == index);
                let own: Vec<Fault> = own.map(|(fault, _)| *fault).collect();
                let record = ShardRecord::of(&chosen(index, count), filled, &names);
                // What is left unproven is tried when the parts are joined.
                let own_depth = if depth == Depth::Clauses { Depth::Faults } else { depth };
                QualificationPart {
                    result: of(&own, own_depth, Some(record)),
                    bundle: format!("b{index}"),
                    sha256: format!("{index:064x}"),
                }
            });
            let parts: Vec<QualificationPart> = parts.collect();
            let mut joined = saved::join(&parts).expect("parts");
            let turned: Vec<QualificationPart> = parts.iter().rev().chain(&parts).cloned().collect();
            assert_eq!(
                saved::join(&turned).as_ref(),
                Some(&joined),
                "order and repetition change nothing"
            );
            let merged = joined.merged.take().expect("merged");
            assert!(merged.troubles.is_empty(), "{:?}", merged.troubles);
            if depth == Depth::Clauses {
                let mut outcome = joined.sides[0].outcome(&library, pack);
                prove(&library, pack, &tests, &faults, &mut outcome).expect("proven");
                joined.sides = vec![QualifiedSide::of(&outcome, pack, true, false)];
                joined.conclude();
            }
            assert_eq!(joined, whole, "{count} parts");
            if parts.len() > 1 {
                let missing = saved::join(&parts[1..]).expect("parts");
                assert_eq!(missing.verdict, Some(Verdict::Inconclusive));
            }
        }
    }
}
