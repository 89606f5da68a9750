//! The part of a run that one of several processes does: tests divided evenly by how long they take.
//!
//! All parts have to come to the same division without speaking to each other, so it rests on nothing but the selected tests:
//! what a device says of itself, and the floor it drives on, may differ from bench to bench.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::Value;

use super::estimate::Estimate;
use super::selection::Selection;
use tck_base::shard::{ChosenShard, Piece, divided};
use tck_base::time::TimeLimits;
use tck_journal::event::ShardRecord;
use tck_suite::model::Test;

/// What every test takes beside its steps: the device is looked at, and brought back to rest.
const AROUND: Duration = Duration::from_millis(500);

/// Keeps one part of the tests. What is drawn from a table depends on all of its cases, so that a table stays whole where there is
/// a draw.
pub(super) fn share(tests: &mut Selection, chosen: &ChosenShard, draw: Option<u64>) -> ShardRecord {
    let is_drawn = draw.is_some();
    let time = Value::Object(TimeLimits::default().bindings());
    let estimate = Estimate::of(Some(&time), None, None, Duration::from_secs(1));
    let mut sums: BTreeMap<&str, (Duration, u32, u32)> = BTreeMap::new();
    for test in tests.iter() {
        let (sum, cases, most) = sums.entry(piece(test, is_drawn)).or_default();
        *sum += AROUND + estimate.of_tests(std::iter::once(&**test));
        *cases += 1;
        *most = match &test.drawn {
            Some(drawn) if is_drawn => u32::try_from(drawn.draw).unwrap_or(u32::MAX),
            _ => 1,
        };
    }
    let pieces = sums.into_iter().map(|(name, (sum, cases, most))| {
        let mean = sum / cases.max(1);
        Piece {
            name: name.to_owned(),
            millis: u64::try_from((mean * most.min(cases)).as_millis()).unwrap_or(u64::MAX),
        }
    });
    let pieces: Vec<Piece> = pieces.collect();
    let parts = divided(&pieces, chosen.shard.of);
    let own: BTreeMap<&str, usize> = pieces.iter().map(|piece| piece.name.as_str()).zip(parts).collect();
    // Parts that were divided or drawn otherwise are no parts of one whole.
    let drawn = draw.map_or_else(String::new, |draw| draw.to_string());
    let names = tests.iter().map(|test| {
        let part = own.get(piece(test, is_drawn)).copied().unwrap_or_default();
        format!("{} {part} {drawn}", test.id)
    });
    let names: Vec<String> = names.collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let record = ShardRecord::of(chosen, chosen.shard.of.min(pieces.len()), &names);
    tests.retain(|test| own.get(piece(test, is_drawn)) == Some(&chosen.shard.index));
    record
}

/// The part of the vehicles of a master control that one process plays. Each part runs all tests, about vehicles of its own.
pub(super) fn share_vehicles(tests: &Selection, chosen: &ChosenShard, vehicles: &[String]) -> ShardRecord {
    let tests = tests.iter().map(|test| test.id.as_str());
    let names: Vec<&str> = tests.chain(vehicles.iter().map(String::as_str)).collect();
    let record = ShardRecord::of(chosen, chosen.shard.of.min(vehicles.len()), &names);
    ShardRecord {
        whole: vehicles.len(),
        ..record
    }
}

/// The name of what is not divided any further.
fn piece(test: &Test, is_drawn: bool) -> &str {
    if is_drawn { test.table() } else { &test.id }
}
