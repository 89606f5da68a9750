//! `fleet/commanded`: whether every vehicle of a fleet gets its order.

use crate::finding::remark;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::Event;
use tck_world::{End, Listen, Observation, Topic};

/// `fleet/commanded`.
pub(super) const COMMANDED: Check = Check {
    name: "fleet/commanded",
    decides: &["MQTT-11"],
    doc: "When a transport was ordered for every vehicle of the fleet, one after the other, each of them gets an order \
          within `time.react`. A vehicle that gets none is a warning: how many vehicles one product controls is its \
          own matter, and the count is there to be read.",
    arguments: &[],
    listens: &[Listen::Everything],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Commanded::default()),
};

#[derive(Default)]
struct Commanded {
    /// Until when an order has to come, and the entry that asked for it.
    asked: Option<(Moment, u64)>,
    /// Whether an order has come since the hook was begun: a hook is recorded when it has answered, and a master
    /// control may be faster than that.
    came: bool,
}

impl Commanded {
    fn overdue(&mut self, now: Moment, findings: &mut Vec<CheckFinding>, vehicle: &str) -> bool {
        let Some((until, seq)) = self.asked.filter(|(until, _)| *until < now) else {
            return false;
        };
        self.asked = None;
        let text = format!("vehicle {vehicle} had no order at {:.1} s", until.seconds());
        findings.push(remark("MQTT-11", seq, text));
        true
    }
}

impl Running for Commanded {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let now = record.at().moment;
        let mut judged = self.overdue(now, findings, context.identity.1);
        if matches!(record.event(), Event::Mark { .. } | Event::Bound { .. }) {
            self.came = false;
        }
        if let Event::Hook {
            ok: true,
            vehicle: Some(vehicle),
            ..
        } = record.event()
            && vehicle == context.identity.1
        {
            if self.came {
                judged = true;
            } else {
                self.asked = Some((now + context.time.react, record.seq()));
            }
        }
        let ordered = record.is_delivered(Topic::Order);
        if ordered {
            self.came = true;
            judged |= self.asked.take().is_some();
        }
        judged
    }

    fn finish(&mut self, end: &End, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        self.overdue(end.moment, findings, context.identity.1);
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;
    use tck_journal::event::{Event, Source};

    fn begun(trace: &mut Trace) {
        let value = json!({ "serialNumber": "0001" });
        let name = "each".to_owned();
        trace.add(Source::Harness, None, Event::Bound { name, value });
    }

    fn asked(trace: &mut Trace, serial: &str) {
        let hook = Event::Hook {
            hook: "dispatch".to_owned(),
            ok: true,
            detail: String::new(),
            vehicle: Some(serial.to_owned()),
        };
        trace.add(Source::Operator, None, hook);
    }

    fn serial(trace: &mut Trace) -> String {
        trace.header()["serialNumber"].as_str().unwrap_or_default().to_owned()
    }

    #[test]
    fn an_order_may_come_before_the_hook_has_answered() {
        let mut trace = Trace::master_control();
        let serial = serial(&mut trace);
        begun(&mut trace);
        trace.commands("order", &json!({ "orderId": "o1" }));
        asked(&mut trace, &serial);
        trace.wait(60.0).state(&json!({}));
        assert!(trace.judge("fleet/commanded").summary().is_empty());
    }

    #[test]
    fn an_order_of_an_earlier_transport_does_not_count() {
        let mut trace = Trace::master_control();
        let serial = serial(&mut trace);
        trace.commands("order", &json!({ "orderId": "o1" }));
        begun(&mut trace);
        asked(&mut trace, &serial);
        trace.wait(60.0).state(&json!({}));
        let found = trace.judge("fleet/commanded").summary();
        assert!(found.iter().any(|line| line.contains("MQTT-11")), "{found:?}");
    }
}
