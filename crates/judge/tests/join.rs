//! Parts of a run are joined as a set: whatever their order, and whatever was joined before.
#![allow(clippy::expect_used, clippy::panic, reason = "a test may fail by panicking")]

use std::collections::BTreeMap;

use proptest::prelude::*;
use tck_base::verdict::Verdict;
use tck_journal::event::{Setting, ShardRecord};
use tck_judge::{Evidence, JoinError, RunPart, join};
use tck_result::{
    CommandedVehicle, Decision, DeviceIdentity, FleetResult, NotDecided, RequirementResult, RunResult, TestResult,
    TroubleKind,
};

fn test(id: &str, requirement: &str, verdict: Verdict) -> TestResult {
    let place = "file:1".to_owned();
    TestResult {
        id: id.to_owned(),
        title: id.to_owned(),
        verdict: Some(verdict),
        not_applicable: None,
        seconds: 1.0,
        reason: None,
        cause: None,
        maturity: "reviewed".to_owned(),
        maturity_note: None,
        journal: Some((1, 2)),
        decisions: vec![Decision::new(
            requirement,
            verdict,
            "steps[0]".to_owned(),
            place,
            String::new(),
        )],
        steps: Vec::new(),
        allowances: Vec::new(),
        repetitions: Vec::new(),
    }
}

/// A part with one test, which decides a requirement of its own and one that all parts decide.
fn part(index: usize, of: usize, verdict: Verdict) -> RunPart {
    let own = format!("A-{index}");
    let tests = vec![test(&format!("a/{index}"), &own, verdict)];
    let requirement = |id: &str, by: &str, verdict: Option<Verdict>| RequirementResult {
        id: id.to_owned(),
        own: None,
        verdict,
        decided_by: verdict.map(|_| by.to_owned()).into_iter().collect(),
        shards: Vec::new(),
        verdicts: Vec::new(),
        not_decided: verdict.is_none().then_some(NotDecided::NotSelected),
    };
    let by = format!("a/{index}");
    let others = (1..=of).map(|other| requirement(&format!("A-{other}"), &by, (other == index).then_some(verdict)));
    let mut requirements: Vec<RequirementResult> = others.collect();
    requirements.push(requirement("HDR-01", &by, Some(verdict)));
    RunPart {
        result: RunResult {
            format: "vda5050-tck.result/1".to_owned(),
            tool: "vda5050-tck 0".to_owned(),
            run: format!("run{index}"),
            mode: None,
            started: format!("2026-11-27T00:00:{index:02}.000Z"),
            seconds: 2.0,
            role: "agv".to_owned(),
            protocol: "2.1.0".to_owned(),
            partial: false,
            partial_reason: None,
            verdict: Some(verdict),
            program: None,
            mixed: None,
            device: DeviceIdentity {
                manufacturer: "ACME".to_owned(),
                serial_number: "1".to_owned(),
                series_name: Some("mule".to_owned()),
            },
            vantage: "tap".to_owned(),
            suites_sha256: "suites".to_owned(),
            suites_modified: false,
            journal: "journal.jsonl".to_owned(),
            joined: Vec::new(),
            shard: Some(ShardRecord {
                index,
                of,
                origin: "--shard".to_owned(),
                filled: of,
                whole: of,
                selection: "all".to_owned(),
            }),
            merged: None,
            tests,
            monitors: Vec::new(),
            requirements,
            capabilities: Vec::new(),
            fleet: None,
            exploration: None,
            message_coverage: None,
            harness_latency: None,
            on_word: Vec::new(),
            limits: vec!["Of one part.".to_owned()],
            deviations: BTreeMap::new(),
            settings: Vec::new(),
        },
        evidence: Evidence {
            bundle: format!("b{index}"),
            bytes: 1,
            sha256: format!("{index:064x}"),
            root: None,
        },
    }
}

fn joined(parts: &[RunPart]) -> RunResult {
    join(&tck_testing::library().rules, parts).expect("parts")
}

fn kinds(result: &RunResult) -> Vec<(TroubleKind, usize)> {
    let merged = result.merged.as_ref().expect("merged");
    merged
        .troubles
        .iter()
        .map(|trouble| (trouble.kind, trouble.index))
        .collect()
}

#[test]
fn every_requirement_names_the_parts_that_decided_it_and_no_part_lowers_what_another_found() {
    let parts = [
        part(1, 3, Verdict::Pass),
        part(2, 3, Verdict::Fail),
        part(3, 3, Verdict::Pass),
    ];
    let whole = joined(&parts);
    assert_eq!(
        (whole.verdict, whole.partial, whole.tests.len()),
        (Some(Verdict::Fail), false, 3)
    );
    assert!(kinds(&whole).is_empty() && whole.shard.is_none());
    let of = |id: &str| whole.requirements.iter().find(|one| one.id == id).expect("known");
    assert_eq!(
        (of("A-2").verdict, of("A-2").shards.clone()),
        (Some(Verdict::Fail), vec![2])
    );
    assert_eq!(
        (of("HDR-01").verdict, of("HDR-01").shards.clone()),
        (Some(Verdict::Fail), vec![1, 2, 3])
    );
    assert_eq!(of("HDR-01").decided_by, ["a/1", "a/2", "a/3"]);
    assert_eq!(whole.limits, ["Of one part."]);
}

#[test]
fn what_is_missing_not_finished_there_twice_or_of_something_else_is_named_and_leaves_the_whole_undecided() {
    let pass = |index| part(index, 3, Verdict::Pass);
    let missing = joined(&[pass(1), pass(3)]);
    assert_eq!(
        (kinds(&missing), missing.verdict),
        (vec![(TroubleKind::Missing, 2)], Some(Verdict::Inconclusive))
    );
    assert!(
        missing
            .partial_reason
            .as_deref()
            .is_some_and(|why| why.contains("part 2 of 3 is missing"))
    );
    let open = missing.requirements.iter().find(|one| one.id == "A-2").expect("known");
    assert!(matches!(open.not_decided, Some(NotDecided::Other(_))), "{open:?}");

    let mut broken_off = pass(2);
    broken_off.result.partial = true;
    broken_off.result.partial_reason = Some("the device is gone".to_owned());
    let partial = joined(&[pass(1), broken_off, pass(3)]);
    assert_eq!(
        (kinds(&partial), partial.verdict),
        (vec![(TroubleKind::Partial, 2)], Some(Verdict::Inconclusive))
    );

    let mut again = pass(2);
    again.evidence.sha256 = format!("{:064x}", 77);
    let twice = joined(&[pass(1), pass(2), again, pass(3)]);
    assert_eq!(
        (kinds(&twice), twice.verdict),
        (vec![(TroubleKind::Duplicate, 2)], Some(Verdict::Inconclusive))
    );
    // The same part given twice is one.
    assert_eq!(
        joined(&[pass(1), pass(2), pass(2), pass(3)]),
        joined(&[pass(1), pass(2), pass(3)])
    );

    let foreign: [fn(&mut RunResult); 8] = [
        |one| one.suites_sha256 = "other".to_owned(),
        |one| one.tool = "vda5050-tck 9".to_owned(),
        |one| one.protocol = "2.0.0".to_owned(),
        |one| one.device.manufacturer = "Globex".to_owned(),
        |one| {
            one.device.serial_number = "2".to_owned();
            one.device.series_name = None;
        },
        |one| {
            one.settings.push(Setting::shown("time.react", "9", "flag"));
        },
        |one| one.shard = None,
        |one| {
            if let Some(shard) = &mut one.shard {
                shard.selection = "some".to_owned();
            }
        },
    ];
    for change in foreign {
        let mut other = part(2, 3, Verdict::Fail);
        change(&mut other.result);
        let whole = joined(&[pass(1), other, pass(3)]);
        let found: Vec<TroubleKind> = kinds(&whole).into_iter().map(|(kind, _)| kind).collect();
        assert_eq!(found, [TroubleKind::Missing, TroubleKind::Foreign], "{whole:#?}");
        assert_eq!(
            whole.verdict,
            Some(Verdict::Inconclusive),
            "what is no part says nothing"
        );
    }
}

#[test]
fn devices_of_one_kind_may_share_a_run_and_are_named() {
    let mut second = part(2, 2, Verdict::Pass);
    second.result.device.serial_number = "2".to_owned();
    let listen = Setting::shown("bench.listen", "0.0.0.0:1883", "flag");
    second.result.settings.push(listen);
    let whole = joined(&[part(1, 2, Verdict::Pass), second.clone()]);
    assert_eq!((kinds(&whole), whole.verdict), (Vec::new(), Some(Verdict::Pass)));
    assert!(
        whole
            .limits
            .iter()
            .any(|limit| limit.contains("2 devices of one kind: 1, 2")),
        "{:?}",
        whole.limits
    );
    // A certificate is about one piece.
    let mut parts = [part(1, 2, Verdict::Pass), second];
    for part in &mut parts {
        part.result.mode = Some("certify".to_owned());
    }
    assert_eq!(joined(&parts).verdict, Some(Verdict::Inconclusive));
}

#[test]
fn the_vehicles_of_all_parts_stand_in_the_whole_once_each() {
    let with = |index: usize, vehicles: &[(&str, usize)]| {
        let mut part = part(index, 2, Verdict::Pass);
        let each = vehicles.iter().map(|(name, orders)| CommandedVehicle {
            serial_number: (*name).to_owned(),
            orders: *orders,
            median: (*orders > 0).then_some(3.0),
            longest: (*orders > 0).then_some(10.0 * f64::from(u8::try_from(*orders).unwrap_or(u8::MAX))),
        });
        part.result.fleet = Some(FleetResult {
            vehicles: vehicles.len(),
            commanded: vehicles.iter().filter(|(_, orders)| *orders > 0).count(),
            reaction: None,
            each: each.collect(),
        });
        part
    };
    let whole = joined(&[with(2, &[("c", 1), ("a", 2)]), with(1, &[("a", 1), ("b", 0)])]);
    let fleet = whole.fleet.expect("a fleet");
    assert_eq!((fleet.vehicles, fleet.commanded, fleet.reaction), (3, 2, None));
    let each: Vec<(&str, usize, Option<f64>, Option<f64>)> = fleet
        .each
        .iter()
        .map(|one| (one.serial_number.as_str(), one.orders, one.median, one.longest))
        .collect();
    let expected = [
        ("a", 3, None, Some(20.0)),
        ("b", 0, None, None),
        ("c", 1, Some(3.0), Some(10.0)),
    ];
    assert_eq!(each, expected);
    assert_eq!(joined(&[part(1, 1, Verdict::Pass)]).fleet, None);
}

#[test]
fn what_is_no_part_cannot_be_joined() {
    let mut whole = part(1, 1, Verdict::Pass);
    whole.result.shard = None;
    assert_eq!(join(&tck_testing::library().rules, &[whole]), Err(JoinError::NoPart));
}

fn any_part() -> impl Strategy<Value = RunPart> {
    let facts = (
        1_usize..5,
        prop::sample::select(Verdict::ALL.to_vec()),
        0_u8..6,
        0_u64..3,
    );
    facts.prop_map(|(index, verdict, odd, run)| {
        let mut one = part(index, 4, verdict);
        one.evidence.sha256 = format!(
            "{:064x}",
            u64::try_from(index).unwrap_or(0) * 100 + run * 10 + u64::from(odd)
        );
        one.result.run = format!("{run}");
        match odd {
            0 => "2.0.0".clone_into(&mut one.result.protocol),
            1 => one.result.partial = true,
            2 => "2".clone_into(&mut one.result.device.serial_number),
            _ => {}
        }
        // What has one key has one content.
        one.result.verdict = Some(verdict);
        one.evidence.sha256.push_str(verdict.word());
        one
    })
}

proptest! {
    #[test]
    fn joining_is_commutative_associative_and_idempotent(parts in prop::collection::vec(any_part(), 1..9), cut in 0_usize..9, turn in 0_usize..9) {
        let whole = joined(&parts);
        let mut turned = parts.clone();
        turned.rotate_left(turn % parts.len());
        prop_assert_eq!(&joined(&turned), &whole);
        turned.reverse();
        prop_assert_eq!(&joined(&turned), &whole);
        // What was joined before is joined as its parts, however they were grouped.
        let (one, other) = parts.split_at(cut.min(parts.len()));
        let grouped: Vec<RunPart> = other.iter().chain(one).chain(one).cloned().collect();
        prop_assert_eq!(&joined(&grouped), &whole);
    }

    #[test]
    fn the_whole_is_never_better_than_a_part_that_counts(parts in prop::collection::vec(any_part(), 1..9)) {
        let whole = joined(&parts);
        let merged = whole.merged.clone().expect("merged");
        for part in merged.parts.iter().filter(|part| part.counts) {
            prop_assert!(whole.verdict >= part.verdict);
        }
        let is_there = |index: usize| merged.parts.iter().any(|part| part.counts && part.index == index);
        let all = (1..=merged.of).all(is_there);
        prop_assert!(all || whole.verdict >= Some(Verdict::Inconclusive));
        prop_assert!(merged.troubles.is_empty() || whole.verdict >= Some(Verdict::Inconclusive));
    }
}
