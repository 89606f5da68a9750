//! The parts of an audit put together: as if one process had judged all vehicles.
//!
//! What parts say is a set: their order, and which of them were joined before, changes nothing. What keeps them from being the
//! whole is named, and leaves the whole undecided.

use std::collections::BTreeMap;

use super::result::{AuditResult, VehicleResult};
use super::stretched::lost;
use tck_base::verdict::{Accumulated, Verdict};
use tck_journal::event::ShardRecord;
use tck_result::{MergedBundle, MergedParts, Part, gathered};

/// A part of an audit.
#[derive(Clone, Debug, PartialEq)]
pub struct AuditPart {
    /// What it found.
    pub result: AuditResult,
    /// Where its bundle is.
    pub bundle: String,
    /// SHA-256 of its result, in hexadecimal.
    pub sha256: String,
}

impl Part for AuditPart {
    fn shard(&self) -> Option<&ShardRecord> {
        self.result.shard.as_ref()
    }

    fn evidence(&self) -> &str {
        &self.sha256
    }

    fn name(&self) -> String {
        format!("the audit in {}", self.bundle)
    }

    fn facts(&self) -> BTreeMap<String, String> {
        let AuditResult { tool, recordings, .. } = &self.result;
        let recordings = recordings.iter().map(|one| {
            // What came from standard input has no hash, and is known by its size alone.
            let hash = one.sha256.clone().unwrap_or_else(|| "no hash".to_owned());
            format!("{hash} {} {}", one.lines, one.skipped)
        });
        let recordings: Vec<String> = recordings.collect();
        let all = [("tool", tool.clone()), ("recording", recordings.join(", "))];
        all.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

/// Joins parts of an audit. One that is given twice counts once. `None` when there is no part among them.
#[must_use]
pub fn join(parts: &[AuditPart]) -> Option<AuditResult> {
    let parts = gathered(parts)?;
    let own = &parts.own;
    let first = &own.first()?.result;
    let mut vehicles: Vec<VehicleResult> = Vec::new();
    for vehicle in own.iter().flat_map(|part| &part.result.vehicles) {
        if !vehicles.contains(vehicle) {
            vehicles.push(vehicle.clone());
        }
    }
    // As an audit orders them: those of recordings by their topics, then those of runs.
    vehicles.sort_by(|one, other| {
        let order = |vehicle: &VehicleResult| !vehicle.topics.contains("{topic}");
        (order(one), one.in_order()).cmp(&(order(other), other.in_order()))
    });
    let judged = |result: &AuditResult| result.messages.saturating_sub(result.elsewhere + result.others);
    let judged: u64 = own.iter().map(|part| judged(&part.result)).sum();
    let merged = MergedParts {
        of: parts.of,
        parts: parts
            .all
            .iter()
            .map(|(part, counts)| merged_part(part, *counts))
            .collect(),
        troubles: parts.troubles,
    };
    let mut result = AuditResult {
        others: first.messages.saturating_sub(first.elsewhere + judged),
        beyond: own.iter().map(|part| part.result.beyond).sum(),
        shard: None,
        vehicles,
        ..first.clone()
    };
    result.conclude();
    let open = (!merged.troubles.is_empty()).then_some(Verdict::Inconclusive);
    result.verdict = result.verdict.into_iter().chain(open).collect::<Accumulated>().get();
    result.merged = Some(merged);
    Some(result)
}

fn merged_part(part: &AuditPart, counts: bool) -> MergedBundle {
    MergedBundle {
        index: part.index(),
        counts,
        verdict: part.result.verdict,
        size: part.result.vehicles.len(),
        bundle: part.bundle.clone(),
        sha256: part.sha256.clone(),
    }
}

/// What makes it less than the whole: the case of it, how it counts, and a sentence.
pub(super) fn restricted(result: &AuditResult) -> Vec<(&'static str, Verdict, String)> {
    let is_part = result.shard.as_ref().map(|shard| {
        let text = shard.limit(super::page::VEHICLES);
        ("it is one part of several", Verdict::Pass, text)
    });
    let cut = result
        .cuts()
        .map(|cuts| ("its time was cut", Verdict::Pass, lost(cuts)));
    let troubles = result.merged.iter().flat_map(|merged| &merged.troubles);
    let troubles = troubles.map(|trouble| ("every part is there", Verdict::Inconclusive, format!("{trouble}.")));
    is_part.into_iter().chain(cut).chain(troubles).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::traffic;
    use super::super::{Audit, Options};
    use super::*;
    use proptest::prelude::*;
    use std::sync::LazyLock;
    use tck_base::shard::{ChosenShard, Shard};
    use tck_capture::Message;
    use tck_pack::Role;
    use tck_result::TroubleKind;

    /// Traffic of eleven vehicles, one of which makes a mistake, and on a topic of none.
    fn site() -> Vec<Message> {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let of = |faults: &[&str]| traffic(library, pack, Role::Agv, "order-acceptance/base-and-horizon", faults);
        let (good, bad) = (of(&[]), of(&["horizon-not-reported"]));
        let mut all = Vec::new();
        for number in 0..11 {
            let own = if number == 4 { &bad } else { &good };
            all.extend(own.iter().map(|message| {
                let (before, name) = message.topic.rsplit_once('/').expect("a topic");
                let (before, serial) = before.rsplit_once('/').expect("a vehicle");
                let text = String::from_utf8_lossy(&message.payload);
                let text = text.replace(&format!("\"{serial}\""), &format!("\"agv-{number}\""));
                Message {
                    topic: format!("{before}/agv-{number}/{name}"),
                    payload: text.into_bytes().into(),
                    ..message.clone()
                }
            }));
        }
        let stray = Message {
            topic: "site/weather".to_owned(),
            ..good[0].clone()
        };
        all.push(stray);
        all
    }

    fn audited(messages: &[Message], shard: Option<Shard>) -> AuditResult {
        let options = Options {
            shard,
            ..Options::default()
        };
        let mut audit = Audit::new(&tck_testing::library().rules, options).expect("options");
        for message in messages {
            audit.observe(message.clone());
        }
        let mut result = audit.finish(Vec::new());
        result.vehicles.sort_by(|one, other| one.topics.cmp(&other.topics));
        result.shard = shard.map(|shard| {
            let origin = "--shard".to_owned();
            ShardRecord::of(&ChosenShard { shard, origin }, shard.of, &["suites"])
        });
        result
    }

    fn part(result: AuditResult, number: usize) -> AuditPart {
        AuditPart {
            result,
            bundle: format!("b{number}"),
            sha256: format!("{number:064x}"),
        }
    }

    fn parts(messages: &[Message], of: usize) -> Vec<AuditPart> {
        let all = (1..=of).map(|index| part(audited(messages, Some(Shard { index, of })), index));
        all.collect()
    }

    #[test]
    fn one_to_sixteen_parts_of_an_audit_are_the_audit() {
        let messages = site();
        let whole = audited(&messages, None);
        assert_eq!((whole.vehicles.len(), whole.verdict), (11, Some(Verdict::Fail)));
        for of in 1..=16 {
            let all = parts(&messages, of);
            let mut joined = join(&all).expect("parts");
            let merged = joined.merged.take().expect("merged");
            assert!(merged.troubles.is_empty(), "{of}: {:?}", merged.troubles);
            assert_eq!(joined, whole, "{of} parts");
        }
    }

    #[test]
    fn what_is_missing_or_of_something_else_is_named_and_leaves_the_whole_undecided() {
        let messages = site();
        let all = parts(&messages, 3);
        let without =
            |index: usize| -> Vec<AuditPart> { all.iter().filter(|part| part.index() != index).cloned().collect() };
        let bad = all
            .iter()
            .find(|part| part.result.verdict == Some(Verdict::Fail))
            .expect("one")
            .index();
        let joined = join(&without(bad)).expect("parts");
        assert_eq!(joined.verdict, Some(Verdict::Inconclusive));
        assert!(joined.others > 0);
        let kinds = |joined: &AuditResult| -> Vec<TroubleKind> {
            let merged = joined.merged.as_ref().expect("merged");
            merged.troubles.iter().map(|trouble| trouble.kind).collect()
        };
        assert_eq!(kinds(&joined), [TroubleKind::Missing]);
        let mut other = without(bad);
        let mut foreign = all[bad - 1].clone();
        foreign.result.tool = "vda5050-tck 9".to_owned();
        other.push(foreign);
        let joined = join(&other).expect("parts");
        assert_eq!(
            (kinds(&joined), joined.verdict),
            (
                vec![TroubleKind::Missing, TroubleKind::Foreign],
                Some(Verdict::Inconclusive)
            )
        );
        let mut twice = all.clone();
        twice.push(part(all[0].result.clone(), 99));
        assert_eq!(kinds(&join(&twice).expect("parts")), [TroubleKind::Duplicate]);
        assert_eq!(join(&[part(audited(&messages, None), 1)]), None);
    }

    /// The time of one vehicle, cut wherever it may be.
    fn cut(messages: &[Message], shard: Option<Shard>) -> AuditResult {
        let options = Options {
            shard,
            cut: Some(std::time::Duration::from_secs(2)),
            ..Options::default()
        };
        let mut audit = Audit::new(&tck_testing::library().rules, options).expect("options");
        for message in messages {
            audit.observe(message.clone());
        }
        let mut result = audit.finish(Vec::new());
        result.shard = shard.map(|shard| {
            let origin = "--shard".to_owned();
            ShardRecord::of(&ChosenShard { shard, origin }, shard.of, &["suites"])
        });
        result
    }

    #[test]
    fn one_to_sixteen_parts_of_the_time_of_one_vehicle_are_that_time() {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let (none, one): (&[&str], &[&str]) = (&[], &["horizon-not-reported"]);
        for (faults, fails, most) in [(none, false, 3), (one, true, 16)] {
            let messages = traffic(library, pack, Role::Agv, "order-acceptance/", faults);
            let whole = cut(&messages, None);
            let numbers: Vec<u64> = whole
                .vehicles
                .iter()
                .filter_map(|vehicle| vehicle.stretch.as_ref())
                .map(|stretch| stretch.number)
                .collect();
            assert!(
                numbers.len() > 4 && numbers == (1..=numbers.len() as u64).collect::<Vec<u64>>(),
                "{numbers:?}"
            );
            assert_eq!((whole.count_vehicles(), whole.cuts()), (1, Some(numbers.len() - 1)));
            // Nobody is accused by a cut, and what is wrong is found all the same.
            assert_eq!(whole.verdict, audited(&messages, None).verdict);
            assert_eq!(whole.verdict == Some(Verdict::Fail), fails);
            for of in 1..=most {
                let all: Vec<AuditPart> = (1..=of)
                    .map(|index| part(cut(&messages, Some(Shard { index, of })), index))
                    .collect();
                let mut joined = join(&all).expect("parts");
                let merged = joined.merged.take().expect("merged");
                assert!(merged.troubles.is_empty(), "{of}: {:?}", merged.troubles);
                assert_eq!(joined, whole, "{of} parts");
            }
        }
    }

    #[test]
    fn what_is_lost_by_a_cut_is_said() {
        let library = tck_testing::library();
        let messages = traffic(
            library,
            library.rules.packs.latest(),
            Role::Agv,
            "order-acceptance/",
            &[],
        );
        let said = |result: &AuditResult| {
            let all = restricted(result).into_iter().map(|(_, _, sentence)| sentence);
            all.filter(|sentence| sentence.starts_with("Time was cut")).count()
        };
        assert_eq!(said(&cut(&messages, None)), 1);
        assert_eq!(said(&audited(&messages, None)), 0);
        let stretch = &cut(&messages, None).vehicles[1];
        assert!(stretch.called().contains("(stretch 2, from "), "{}", stretch.called());
        assert!(stretch.retained > 0, "what a broker has stored goes along");
    }

    static THIRDS: LazyLock<Vec<AuditPart>> = LazyLock::new(|| parts(&site(), 3));

    proptest! {
        #[test]
        fn joining_is_commutative_associative_and_idempotent(picked in prop::collection::vec((0_usize..3, 0_usize..2), 1..7), turn in 0_usize..7, cut in 0_usize..7) {
            let all: Vec<AuditPart> = picked.iter().map(|(at, odd)| {
                let mut one = THIRDS[*at].clone();
                if *odd == 1 {
                    one.result.tool = "vda5050-tck 9".to_owned();
                    one.sha256 = format!("{:064x}", 1_000 + at);
                }
                one
            }).collect();
            let whole = join(&all);
            let mut turned = all.clone();
            turned.rotate_left(turn % all.len());
            prop_assert_eq!(&join(&turned), &whole);
            let (one, other) = all.split_at(cut.min(all.len()));
            let grouped: Vec<AuditPart> = other.iter().chain(one).chain(one).cloned().collect();
            prop_assert_eq!(&join(&grouped), &whole);
        }
    }
}
