//! `state/battery-levels`: a vehicle that only knows good and bad says so with 80 and 20 percent.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::finding::broken;
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
