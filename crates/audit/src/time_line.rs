//! What a vehicle did over the time of a recording: its connection, its mode and its orders, as far as messages say it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tck_view::MessageView;

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

/// What a vehicle did over the time of a recording, by `connection`, `mode` and `order`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TimeLine(pub BTreeMap<String, Vec<Span>>);

impl TimeLine {
    /// Takes in a message.
    pub(super) fn note(&mut self, message: &MessageView, at: jiff::Timestamp) {
        match message {
            MessageView::Connection(said) => self.say("connection", said.connection_state.text(), at),
            MessageView::State(state) => {
                self.say("mode", state.operating_mode.text(), at);
                self.say("order", state.order_id.text().filter(|id| !id.is_empty()), at);
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
    use serde_json::{Value, json};
    use tck_view::{Names, Topic};

    use super::*;

    fn read(topic: Topic, message: &Value) -> MessageView {
        MessageView::of_value(topic, message, &Names::default())
    }

    fn at(second: i64) -> jiff::Timestamp {
        jiff::Timestamp::from_second(1_767_225_600 + second).expect("time")
    }

    #[test]
    fn what_stays_the_same_is_one_span() {
        let mut line = TimeLine::default();
        let said = |state: &str| read(Topic::Connection, &json!({ "connectionState": state }));
        line.note(&said("ONLINE"), at(0));
        for (second, order) in [(1, "a"), (2, "a"), (3, "b"), (4, "")] {
            let state = json!({ "operatingMode": "AUTOMATIC", "orderId": order });
            line.note(&read(Topic::State, &state), at(second));
        }
        line.note(&said("OFFLINE"), at(5));
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
            let state = json!({ "orderId": format!("order {second}") });
            line.note(&read(Topic::State, &state), at(second));
        }
        let orders = &line.0["order"];
        assert_eq!((orders.len(), orders[SPANS - 1].to), (SPANS, at(999)));
    }
}
