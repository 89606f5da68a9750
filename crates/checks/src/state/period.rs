//! `state/period`, `state/own-limits`: how often states come, and how big they are.
//!
//! What they say is left to the other checks of the state.

use std::time::Duration;

use serde_json::{Map, Value};

use crate::finding::{broken, remark};
use crate::rhythm::Rhythm;
use crate::topic::looks_like;
use tck_base::clock::Moment;
use tck_base::pattern::whole;
use tck_base::verdict::Verdict;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::{Event, Packet};
use tck_view::{ConnectionView, FactsheetView, MessageView, ProtocolLimits};
use tck_world::{End, Listen, Observation, Topic};

/// What the transport may add to an interval of the device.
const MARGIN: Duration = Duration::from_secs(1);

/// `state/period`.
pub(crate) const PERIOD: Check = Check {
    name: "state/period",
    decides: &["STATE-02"],
    doc: "While the device is connected, a state follows the last one within time.statePeriod (30 s and a margin). An \
          interval longer than the defaultStateInterval of its own factsheet is a warning. Time during which the \
          harness disturbs the link or the device is not connected does not count, and neither does what a broker does not \
          deliver: a state counts when the tap sees it, and without a tap a device of which no state ever came is not judged.",
    arguments: &[],
    listens: &[
        Listen::Closed,
        Listen::Fault,
        Listen::Disconnect,
        Listen::Connect,
        Listen::Connack,
        Listen::Lag,
        Listen::Hook,
        Listen::Answer,
        Listen::Elsewhere,
        Listen::ToVehicle(Topic::Order),
        Listen::ToVehicle(Topic::InstantActions),
        Listen::Published(Topic::State),
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Connection),
        Listen::Delivered(Topic::Factsheet),
    ],
    reads: &[],
    needs: &[ConnectionView::connection_state],
    start: |_| Box::new(Period::default()),
};

/// `state/own-limits`.
pub(crate) const OWN_LIMITS: Check = Check {
    name: "state/own-limits",
    decides: &["FACT-11", "FACT-14"],
    doc: "States keep the maxima that the device's own factsheet states for the arrays of a state, and its \
          minStateInterval. Zero or absent is no limit.",
    arguments: &[],
    listens: &[
        Listen::Fault,
        Listen::Closed,
        Listen::Disconnect,
        Listen::Connect,
        Listen::Delivered(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[FactsheetView::protocol_limits],
    start: |_| Box::new(OwnLimits::default()),
};

#[derive(Default)]
struct Period {
    /// Last state, or the moment from which one was due: time and entry.
    since: Option<(Moment, u64)>,
    remarked: Option<u64>,
    /// When the tap saw a state that was not delivered yet.
    sent: Option<Moment>,
    /// The first message that was sent to the vehicle since.
    asked: Option<u64>,
    /// Whether a state was ever delivered.
    seen: bool,
    /// How long the harness was held up since then.
    lag: Duration,
    /// `defaultStateInterval`, once a factsheet came.
    own: Option<Duration>,
}

impl Period {
    fn judge(&mut self, now: &End, seq: u64, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some((since, _)) = self.since else { return false };
        // Whatever becomes of a state that the device has sent, it has sent one.
        let gap = self.sent.unwrap_or(now.moment).since(since);
        let limit = context.time.state_period;
        let seconds = gap.as_secs_f64();
        let net = gap.saturating_sub(self.lag);
        let excuse = if net <= limit {
            Some("the harness itself was held up")
        } else if !self.seen && !now.link.tap {
            Some("none ever came, and without a tap nobody can tell whether the broker keeps them to itself")
        } else {
            None
        };
        if let Some(excuse) = excuse.filter(|_| gap > limit) {
            let mut finding = remark("STATE-02", seq, format!("no state for {seconds:.1} s, but {excuse}"));
            finding.verdict = Some(Verdict::Inconclusive);
            findings.push(finding);
        } else if gap > limit {
            let asked = self
                .asked
                .map(|seq| format!("; the first message that it was sent meanwhile is #{seq}"));
            let text = format!("no state for {seconds:.1} s{}", asked.unwrap_or_default());
            findings.push(broken("STATE-02", seq, text));
        } else if let Some(own) = self.own.filter(|own| net > *own + MARGIN) {
            let text = format!(
                "no state for {seconds:.1} s, although the factsheet says every {:.1} s",
                own.as_secs_f64()
            );
            findings.push(remark("STATE-02", seq, text));
        }
        true
    }
}

impl Running for Period {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let now = (record.at().moment, record.seq());
        match record.event() {
            Event::Closed { .. }
            | Event::Fault { .. }
            | Event::Packet {
                packet: Packet::Disconnect { .. } | Packet::Connect { .. },
                ..
            } => (self.since, self.sent) = (None, None),
            Event::Packet {
                packet: Packet::Connack { code: 0, .. },
                ..
            } if !record.link.disturbed => self.since = Some(now),
            Event::Lag { micros, .. } => self.lag += Duration::from_micros(*micros),
            _ if record.outside_influence() => self.since = None,
            _ => {}
        }
        if record.is_to_vehicle(Topic::Order) || record.is_to_vehicle(Topic::InstantActions) {
            self.asked.get_or_insert(record.seq());
        }
        if record.device_publish().is_some() {
            match record.topic() {
                Some(Topic::State) => _ = self.sent.get_or_insert(now.0),
                // States do come. That they come elsewhere is one mistake, which `topic/names` names.
                None if looks_like(record) == Some(Topic::State) => self.since = None,
                _ => {}
            }
        }
        let Some(message) = record.delivered() else {
            return false;
        };
        match message.topic {
            Topic::State => {
                self.seen = true;
                let judged = !record.link.disturbed && self.judge(&record.now(), now.1, context, findings);
                self.since = (!record.link.disturbed).then_some(now);
                self.sent = None;
                self.asked = None;
                self.lag = Duration::ZERO;
                judged
            }
            Topic::Connection => {
                let online = record.connection_message().is_some_and(|message| message.is_online());
                if !online {
                    self.since = None;
                } else if self.since.is_none() && !record.link.disturbed {
                    self.since = Some(now);
                }
                false
            }
            Topic::Factsheet => {
                let sheet = record.message().and_then(MessageView::factsheet);
                let interval = sheet.and_then(|sheet| sheet.timing()?.default_state_interval.float());
                self.own = interval
                    .filter(|seconds| (0.1..=30.0).contains(seconds))
                    .map(Duration::from_secs_f64);
                false
            }
            _ => false,
        }
    }

    fn finish(&mut self, end: &End, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        let Some((_, seq)) = self.since else { return };
        if self.remarked != Some(seq) && !end.link.disturbed {
            self.judge(end, seq, context, findings);
            self.remarked = Some(seq);
        }
    }
}

#[derive(Default)]
struct OwnLimits {
    arrays: Map<String, Value>,
    interval: Option<Duration>,
    rhythm: Rhythm,
}

impl Running for OwnLimits {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.rhythm.note(record);
        let Some(message) = record.delivered() else {
            return false;
        };
        let Some(value) = record.json() else { return false };
        match message.topic {
            Topic::Factsheet => {
                // The factsheet gives the names of what is counted.
                let path = [FactsheetView::protocol_limits, ProtocolLimits::max_array_lens];
                let limits = record.names().raw(value, &path).and_then(Value::as_object);
                self.arrays = limits
                    .into_iter()
                    .flatten()
                    .filter(|(name, _)| name.starts_with("state.") && name.len() < 128)
                    .take(64)
                    .map(|(name, limit)| (name.clone(), limit.clone()))
                    .collect();
                let sheet = record.message().and_then(MessageView::factsheet);
                let interval = sheet.and_then(|sheet| sheet.timing()?.min_state_interval.float());
                // What no Duration can hold says nothing; what cannot be meant, such as milliseconds, is still judged.
                self.interval = interval
                    .filter(|seconds| (0.0..=1e6).contains(seconds))
                    .map(Duration::from_secs_f64);
                false
            }
            Topic::State => {
                for (name, limit) in &self.arrays {
                    let limit = whole(limit).filter(|limit| *limit > 0);
                    let length = name
                        .split('.')
                        .skip(1)
                        .try_fold(value, |value, member| value.get(member))
                        .and_then(Value::as_array)
                        .map(|items| items.len() as u64);
                    if let (Some(limit), Some(length)) = (limit, length)
                        && length > limit
                    {
                        let text = format!("{name} has {length} elements, the factsheet allows {limit}");
                        findings.push(broken("FACT-11", record.seq(), text));
                    }
                }
                let gap = self.rhythm.beat(record.at().moment, self.interval);
                if let (Some(least), Some(gap)) = (self.interval, gap)
                    && !record.link.disturbed
                    // Arrival times jitter; half the interval cannot be jitter alone.
                    && gap * 2 < least
                {
                    let text = format!(
                        "two states {:.3} s apart, the factsheet says at least {:.3} s",
                        gap.as_secs_f64(),
                        least.as_secs_f64()
                    );
                    findings.push(remark("FACT-14", record.seq(), text));
                }
                !self.arrays.is_empty() || self.interval.is_some()
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;
    use tck_journal::event::LinkFault;

    const CHECK: &str = "state/period";

    #[test]
    fn a_state_every_half_minute_is_right() {
        let mut trace = Trace::subscriber();
        trace.state(&json!({})).wait(30.2).state(&json!({})).wait(30.0);
        let outcome = trace.judge(CHECK);
        assert!(outcome.findings.is_empty() && outcome.judged == 1);
    }

    #[test]
    fn gaps_are_found_in_between_and_at_the_end() {
        let mut trace = Trace::subscriber();
        trace.state(&json!({})).wait(32.0).state(&json!({})).wait(40.0);
        assert_eq!(trace.judge(CHECK).summary(), ["STATE-02", "STATE-02"]);
    }

    #[test]
    fn a_device_that_connects_and_never_sends_a_state_is_found() {
        let mut trace = Trace::tap();
        trace.connected(1).wait(40.0);
        assert_eq!(trace.judge(CHECK).summary(), ["STATE-02"]);
    }

    #[test]
    fn what_a_broker_does_not_deliver_is_not_held_against_the_device() {
        let mut kept = Trace::tap();
        kept.connected(1);
        for _ in 0..4 {
            kept.wait(20.0).publish(1, "state", 0, false, &json!({}));
        }
        assert!(kept.judge(CHECK).findings.is_empty());
        // One that comes late is late.
        let mut late = Trace::tap();
        late.connected(1).wait(40.0).publish(1, "state", 0, false, &json!({}));
        assert_eq!(late.wait(20.0).judge(CHECK).summary(), ["STATE-02"]);
        // Without a tap nobody knows.
        let mut unseen = Trace::subscriber();
        unseen.connection("ONLINE").wait(40.0);
        assert_eq!(unseen.judge(CHECK).summary(), ["STATE-02 inconclusive"]);
        unseen.state(&json!({})).wait(40.0);
        assert_eq!(unseen.judge(CHECK).summary(), ["STATE-02", "STATE-02"]);
    }

    #[test]
    fn time_without_connection_or_with_a_disturbed_link_does_not_count() {
        let mut trace = Trace::tap();
        trace.connected(1).state(&json!({})).closed(1).wait(90.0);
        trace.connected(2).wait(20.0).state(&json!({})).wait(1.0);
        trace.fault(LinkFault::Cut { reset: true }).wait(90.0);
        trace.fault(LinkFault::Restore).wait(90.0);
        assert!(trace.judge(CHECK).findings.is_empty());

        let mut trace = Trace::subscriber();
        trace
            .state(&json!({}))
            .wait(5.0)
            .connection("OFFLINE")
            .wait(90.0)
            .hook();
        assert!(trace.judge(CHECK).findings.is_empty());
    }

    #[test]
    fn missing_its_own_interval_is_a_remark() {
        let mut trace = Trace::subscriber();
        let timing = json!({ "protocolLimits": { "timing": { "defaultStateInterval": 2.0 } } });
        trace
            .message("factsheet", &timing)
            .state(&json!({}))
            .wait(3.5)
            .state(&json!({}));
        assert_eq!(trace.judge(CHECK).summary(), ["STATE-02 warning"]);
    }

    #[test]
    fn its_own_limits_are_held_against_a_device() {
        let mut trace = Trace::subscriber();
        let limits = json!({ "protocolLimits": {
            "maxArrayLens": { "state.errors": 1, "state.information": 0, "order.nodes": 1 },
            "timing": { "minStateInterval": 0.5 },
        } });
        trace.message("factsheet", &limits);
        trace
            .state(&json!({ "errors": [1], "information": [1, 2] }))
            .wait(0.4)
            .state(&json!({}));
        assert!(trace.judge("state/own-limits").findings.is_empty());
        trace.wait(0.1).state(&json!({ "errors": [1, 2] }));
        assert_eq!(
            trace.judge("state/own-limits").summary(),
            ["FACT-11", "FACT-14 warning"]
        );
    }

    #[test]
    fn states_that_a_link_fault_held_back_do_not_follow_too_fast() {
        let mut trace = Trace::subscriber();
        trace.message(
            "factsheet",
            &json!({ "protocolLimits": { "timing": { "minStateInterval": 0.5 } } }),
        );
        trace
            .fault(LinkFault::Silence { direction: None })
            .wait(20.0)
            .fault(LinkFault::Restore);
        for _ in 0..20 {
            trace.wait(0.001).state(&json!({}));
        }
        assert!(trace.judge("state/own-limits").findings.is_empty());
        trace.wait(0.5).state(&json!({})).wait(0.1).state(&json!({}));
        assert_eq!(trace.judge("state/own-limits").summary(), ["FACT-14 warning"]);
    }
}
