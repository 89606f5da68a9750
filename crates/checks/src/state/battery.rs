//! `state/battery-levels`, `state/charge-in-percent`: what a vehicle says of its charge, over a run.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::finding::{broken, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{BatteryState, StateView};
use tck_world::{End, Listen, Observation, Topic};

/// A vehicle that only knows good and bad says so with 80 and 20 percent.
pub(crate) const LEVELS: Check = Check {
    name: "state/battery-levels",
    decides: &["STATE-MSG-16"],
    doc: "When a run shows exactly two charges, each more than once and at least 30 points apart, the vehicle knows \
          good and bad only, and they have to be 80 and 20. Everything else tells nothing about it.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::battery_state, BatteryState::battery_charge],
    start: |_| Box::new(Levels::default()),
};

/// The charge is in percent, and no share of one.
pub(crate) const PERCENT: Check = Check {
    name: "state/charge-in-percent",
    decides: &["STATE-MSG-15"],
    doc: "A vehicle that drives has more than one percent of charge: a remark when ten states of a vehicle that drives show a \
          charge above 0 and up to 1, and no state of it shows more. A vehicle that stands may be as good as empty.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::battery_state, BatteryState::battery_charge],
    start: |_| Box::new(Percent::default()),
};

/// So many states of a vehicle that drives show what its charge is counted in.
const DRIVING: usize = 10;

#[derive(Default)]
struct Percent {
    /// States of a vehicle that drives with a charge of one percent at most.
    low: usize,
    /// Nothing more is to be learned: it was more once, or it was told.
    known: bool,
}

impl Running for Percent {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(state) = record.state().filter(|_| !self.known) else {
            return false;
        };
        let charge = state
            .battery_state
            .there()
            .and_then(|battery| battery.battery_charge.float());
        let Some(charge) = charge else { return false };
        if charge > 1.0 {
            self.known = true;
            return false;
        }
        self.low += usize::from(charge > 0.0 && state.driving.is(true));
        if self.low >= DRIVING {
            self.known = true;
            let text = format!(
                "the vehicle drives with a charge of {charge} percent, and none of its states shows more than 1: a share of one \
                 belongs into percent"
            );
            findings.push(remark("STATE-MSG-15", record.seq(), text));
        }
        false
    }
}

/// A battery that is measured does not jump this far, in percent.
const JUMP: f64 = 30.0;
/// How often the charge has to jump between the two.
const JUMPS: usize = 3;

#[derive(Default)]
struct Levels {
    /// The charges seen, in hundredths of a percent, each with the entry that showed it first.
    seen: BTreeMap<i64, u64>,
    last: Option<i64>,
    jumps: usize,
    found: bool,
}

#[expect(clippy::cast_possible_truncation, reason = "the range is checked")]
fn hundredths(charge: f64) -> Option<i64> {
    (-1e6..=1e6).contains(&charge).then(|| (charge * 100.0).round() as i64)
}

impl Running for Levels {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, _findings: &mut Vec<CheckFinding>) -> bool {
        let charge = record
            .state()
            .and_then(|state| state.battery_state.there()?.battery_charge.float())
            .and_then(hundredths);
        let Some(charge) = charge.filter(|_| self.seen.len() <= 2) else {
            return false;
        };
        self.seen.entry(charge).or_insert(record.seq());
        self.jumps += usize::from(self.last.replace(charge).is_some_and(|last| last != charge));
        // What two charges mean is only known at the end.
        false
    }

    fn finish(&mut self, _: &End, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        let [(low, _), (high, seq)] = self
            .seen
            .iter()
            .map(|(charge, seq)| (*charge, *seq))
            .collect::<Vec<_>>()[..]
        else {
            return;
        };
        let (low, high) = (Value::from(low / 100), Value::from(high / 100));
        let apart = high.as_f64().zip(low.as_f64()).map_or(0.0, |(high, low)| high - low);
        if apart >= JUMP && self.jumps >= JUMPS && (low != 20 || high != 80) && !self.found {
            self.found = true;
            let text = format!("the charge is {low} or {high} percent and nothing else; good and bad are 80 and 20");
            findings.push(broken("STATE-MSG-16", seq, text));
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;

    fn driven(charges: &[f64], driving: bool) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for charge in charges {
            trace.state(&json!({ "driving": driving, "batteryState": { "batteryCharge": charge } }));
        }
        trace.judge("state/charge-in-percent").summary()
    }

    #[test]
    fn a_share_of_one_is_no_percentage() {
        assert_eq!(driven(&[0.8; 30], true), ["STATE-MSG-15 warning"]);
        // As good as empty it stands, and nobody can tell.
        assert!(driven(&[0.8; 30], false).is_empty());
        assert!(driven(&[0.8; 9], true).is_empty());
        let falling = [1.4, 1.2, 1.0, 0.8, 0.6, 0.6, 0.6, 0.5, 0.5, 0.5, 0.4, 0.4, 0.4];
        assert!(driven(&falling, true).is_empty());
        assert!(driven(&[0.0; 30], true).is_empty());
    }

    fn judge(charges: &[f64]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for charge in charges {
            trace.state(&json!({ "batteryState": { "batteryCharge": charge } }));
        }
        trace.judge("state/battery-levels").summary()
    }

    #[test]
    fn eighty_and_twenty_and_measured_charges_are_right() {
        assert!(judge(&[80.0, 20.0, 80.0, 20.0]).is_empty());
        assert!(judge(&[90.0, 89.0, 90.0, 89.0]).is_empty());
        assert!(judge(&[100.0, 0.0, 100.0, 55.0, 0.0, 100.0]).is_empty());
        assert!(judge(&[30.0, 95.0]).is_empty());
    }

    #[test]
    fn two_other_levels_are_found() {
        assert_eq!(judge(&[100.0, 0.0, 100.0, 0.0]), ["STATE-MSG-16"]);
    }
}
