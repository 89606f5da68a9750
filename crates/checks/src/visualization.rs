//! `visualization/rate`, `visualization/published`: the visualization comes, and as often as the factsheet says.

use std::collections::VecDeque;
use std::time::Duration;

use super::rhythm::Rhythm;
use crate::finding::{broken, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::MessageView;
use tck_world::{Listen, Observation, Topic};

/// `visualization/rate`.
pub(super) const RATE: Check = Check {
    name: "visualization/rate",
    decides: &["VIS-02"],
    doc: "Of every ten visualizations in a row, the interval in the middle lies within 20 percent of the \
          visualizationInterval of the vehicle's own factsheet: a vehicle may pause when it stands still. A vehicle \
          that states an interval and publishes nothing for ten of them while it is connected publishes none.",
    arguments: &[],
    listens: &[
        Listen::Fault,
        Listen::Closed,
        Listen::Disconnect,
        Listen::Connect,
        Listen::Hook,
        Listen::Answer,
        Listen::Lag,
        Listen::Delivered(Topic::Factsheet),
        Listen::Delivered(Topic::Visualization),
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Rate::default()),
};

/// `visualization/published`.
pub(super) const PUBLISHED: Check = Check {
    name: "visualization/published",
    decides: &["TOPIC-12"],
    doc: "Nobody has to publish the topic. A vehicle whose factsheet states a visualizationInterval, and which publishes \
          nothing for ten of them while it is connected, claims what it does not do: a warning.",
    arguments: &[],
    listens: &[
        Listen::Fault,
        Listen::Closed,
        Listen::Disconnect,
        Listen::Connect,
        Listen::Hook,
        Listen::Answer,
        Listen::Lag,
        Listen::Delivered(Topic::Factsheet),
        Listen::Delivered(Topic::Visualization),
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[],
    start: |_| {
        Box::new(Rate {
            presence_only: true,
            ..Rate::default()
        })
    },
};

/// How many intervals are looked at together.
const TOGETHER: usize = 9;
/// For how many intervals nothing may come at all.
const SILENT: u32 = 10;
/// How far the middle interval may be off: twenty percent, and what reading a clock costs.
const SHARE: f64 = 0.2;
const READING: f64 = 0.02;

#[derive(Default)]
struct Rate {
    /// visualizationInterval, once a factsheet came.
    stated: Option<Duration>,
    rhythm: Rhythm,
    gaps: VecDeque<Duration>,
    /// Since when the vehicle could have published.
    since: Option<Moment>,
    published: bool,
    found: bool,
    /// Only whether anything comes is asked.
    presence_only: bool,
}

impl Rate {
    /// Judges the last intervals once they are enough; whether they were.
    fn judge(&mut self, seq: u64, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(stated) = self.stated.filter(|_| self.gaps.len() >= TOGETHER) else {
            let excess = self.gaps.len().saturating_sub(TOGETHER);
            self.gaps.drain(..excess);
            return false;
        };
        let mut gaps: Vec<Duration> = self.gaps.drain(..).collect();
        gaps.sort_unstable();
        let middle = gaps.get(TOGETHER / 2).copied().unwrap_or_default().as_secs_f64();
        let stated = stated.as_secs_f64();
        if (middle - stated).abs() > stated * SHARE + READING {
            let text = format!("the visualization comes every {middle:.2} s, the factsheet says every {stated:.2} s");
            findings.push(broken("VIS-02", seq, text));
        }
        true
    }

    /// Whether nothing came for so long that nothing will come.
    fn silence(&mut self, now: Moment, seq: u64, findings: &mut Vec<CheckFinding>) {
        let Some((since, stated)) = self.since.zip(self.stated) else {
            return;
        };
        if self.published || self.found || now.since(since) < stated * SILENT {
            return;
        }
        self.found = true;
        let seconds = stated.as_secs_f64();
        let text = format!("no visualization came, although the factsheet says every {seconds:.2} s");
        findings.push(if self.presence_only {
            remark("TOPIC-12", seq, text)
        } else {
            broken("VIS-02", seq, text)
        });
    }
}

impl Running for Rate {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let now = record.at().moment;
        if self.rhythm.note(record) || record.outside_influence() {
            self.rhythm.forget();
            self.since = None;
            self.gaps.clear();
        }
        if let Some(late) = record.lag() {
            // The interval in which the harness was late is not counted.
            self.rhythm.forget();
            self.since = self.since.map(|since| since + late);
        }
        let Some(message) = record.delivered().filter(|_| !record.link.disturbed) else {
            return false;
        };
        match message.topic {
            Topic::Factsheet => {
                let sheet = record.message().and_then(MessageView::factsheet);
                let interval = sheet.and_then(|sheet| sheet.timing()?.visualization_interval.float());
                self.stated = interval
                    .filter(|seconds| (0.01..=60.0).contains(seconds))
                    .map(Duration::from_secs_f64);
                false
            }
            Topic::Visualization => {
                self.published = true;
                self.gaps.extend(self.rhythm.beat(now, self.stated));
                self.presence_only || self.judge(record.seq(), findings)
            }
            Topic::State => {
                self.since.get_or_insert(now);
                self.silence(now, record.seq(), findings);
                false
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;
    use tck_journal::event::LinkFault;

    fn trace(stated: f64) -> Trace {
        let mut trace = Trace::subscriber();
        trace.message(
            "factsheet",
            &json!({ "protocolLimits": { "timing": { "visualizationInterval": stated } } }),
        );
        trace
    }

    fn every(stated: f64, seconds: f64, times: usize) -> Vec<String> {
        let mut trace = trace(stated);
        for _ in 0..times {
            trace.wait(seconds).message("visualization", &json!({}));
        }
        trace.judge("visualization/rate").summary()
    }

    #[test]
    fn a_rate_within_twenty_percent_is_right() {
        assert!(every(1.0, 1.15, 25).is_empty());
        assert!(every(1.0, 0.85, 25).is_empty());
    }

    #[test]
    fn a_rate_further_off_is_found() {
        assert_eq!(every(1.0, 3.0, 11), ["VIS-02"]);
        assert_eq!(every(1.0, 0.3, 11), ["VIS-02"]);
    }

    #[test]
    fn a_pause_and_a_broken_link_do_not_count() {
        let mut trace = trace(1.0);
        for number in 0..20 {
            trace.wait(if number == 7 { 60.0 } else { 1.0 });
            trace.message("visualization", &json!({}));
        }
        assert!(trace.judge("visualization/rate").findings.is_empty());
    }

    #[test]
    fn messages_that_a_link_fault_held_back_come_all_at_once() {
        let mut trace = trace(1.0);
        trace
            .fault(LinkFault::Silence { direction: None })
            .wait(20.0)
            .fault(LinkFault::Restore);
        for _ in 0..20 {
            trace.wait(0.001).message("visualization", &json!({}));
        }
        for _ in 0..20 {
            trace.wait(1.0).message("visualization", &json!({}));
        }
        assert!(trace.judge("visualization/rate").findings.is_empty());
        for _ in 0..10 {
            trace.wait(3.0).message("visualization", &json!({}));
        }
        assert_eq!(trace.judge("visualization/rate").summary(), ["VIS-02"]);
    }

    #[test]
    fn an_interval_in_which_the_harness_was_late_does_not_count() {
        let mut trace = trace(1.0);
        for _ in 0..20 {
            trace.wait(1.0).message("visualization", &json!({}));
            trace.wait(1.0).late(0.9).wait(0.0).message("visualization", &json!({}));
        }
        assert!(trace.judge("visualization/rate").findings.is_empty());
    }

    #[test]
    fn a_vehicle_that_states_an_interval_and_publishes_nothing_is_found() {
        let mut trace = trace(1.0);
        for _ in 0..4 {
            trace.wait(5.0).state(&json!({}));
        }
        assert_eq!(trace.judge("visualization/rate").summary(), ["VIS-02"]);
        assert_eq!(trace.judge("visualization/published").summary(), ["TOPIC-12 warning"]);
    }

    #[test]
    fn without_a_stated_interval_nothing_is_found() {
        let mut trace = Trace::subscriber();
        for _ in 0..20 {
            trace.wait(5.0).state(&json!({})).message("visualization", &json!({}));
        }
        assert!(trace.judge("visualization/rate").findings.is_empty());
    }
}
