//! What a vehicle did over the time of a recording: its connection, its mode and its orders, as far as messages say it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// How many spans of one kind are kept; what follows is one span.
const SPANS: usize = 200;
/// How long a text may be that is shown.
const TEXT: usize = 64;

/// A stretch of time in which something was the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Span {
    /// From the first message that says it.
    pub from: jiff::Timestamp,
    /// To the last one.
    pub to: jiff::Timestamp,
    /// What.
    pub what: String,
}

/// See the module; by `connection`, `mode` and `order`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TimeLine(pub BTreeMap<String, Vec<Span>>);

impl TimeLine {
    /// Takes in a message of its topic of this name.
    pub(super) fn note(&mut self, name: &str, message: &Value, at: jiff::Timestamp) {
        let text = |member: &str| message.get(member).and_then(Value::as_str);
        match name {
            "connection" => self.say("connection", text("connectionState"), at),
            "state" => {
                self.say("mode", text("operatingMode"), at);
                self.say("order", text("orderId").filter(|id| !id.is_empty()), at);
            }
            _ => {}
        }
    }

    fn say(&mut self, track: &'static str, what: Option<&str>, at: jiff::Timestamp) {
        let Some(what) = what else { return };
        let spans = self.0.entry(track.to_owned()).or_default();
        let full = spans.len() >= SPANS;
        if let Some(last) = spans.last_mut() {
            // A connection stays as it is until something else is said of it.
            if track == "connection" || last.what == what {
                last.to = last.to.max(at);
            }
            if last.what == what || full {
                last.to = last.to.max(at);
                if last.what != what {
                    "…".clone_into(&mut last.what);
                }
                return;
            }
        }
        spans.push(Span {
            from: at,
            to: at,
            what: what.chars().take(TEXT).collect(),
        });
    }

    /// Nothing is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn at(second: i64) -> jiff::Timestamp {
        jiff::Timestamp::from_second(1_767_225_600 + second).expect("time")
    }

    #[test]
    fn what_stays_the_same_is_one_span() {
        let mut line = TimeLine::default();
        line.note("connection", &json!({ "connectionState": "ONLINE" }), at(0));
        for (second, order) in [(1, "a"), (2, "a"), (3, "b"), (4, "")] {
            line.note(
                "state",
                &json!({ "operatingMode": "AUTOMATIC", "orderId": order }),
                at(second),
            );
        }
        line.note("connection", &json!({ "connectionState": "OFFLINE" }), at(5));
        let spans = |track: &str| -> Vec<(i64, i64, String)> {
            let since = |time: jiff::Timestamp| time.as_second() - 1_767_225_600;
            let all = line.0[track].iter();
            all.map(|span| (since(span.from), since(span.to), span.what.clone()))
                .collect()
        };
        assert_eq!(
            spans("connection"),
            [(0, 5, "ONLINE".to_owned()), (5, 5, "OFFLINE".to_owned())]
        );
        assert_eq!(spans("mode"), [(1, 4, "AUTOMATIC".to_owned())]);
        assert_eq!(spans("order"), [(1, 2, "a".to_owned()), (3, 3, "b".to_owned())]);
    }

    #[test]
    fn a_vehicle_of_many_orders_keeps_a_bounded_line() {
        let mut line = TimeLine::default();
        for second in 0..1_000 {
            line.note("state", &json!({ "orderId": format!("order {second}") }), at(second));
        }
        let orders = &line.0["order"];
        assert_eq!((orders.len(), orders[SPANS - 1].to), (SPANS, at(999)));
    }
}
