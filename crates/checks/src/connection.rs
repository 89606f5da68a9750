//! `connection/online-after-connect`, `connection/values`: what the device says about its connection, and when.
//!
//! The form of the messages is left to `message/schema`, will and RETAIN to `mqtt`.

use std::collections::VecDeque;
use std::time::Duration;

use crate::finding::{broken, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::{Event, Packet};
use tck_view::ConnectionView;
use tck_world::{End, Listen, Observation, Topic};

const CONNECTIONS: usize = 32;

/// `connection/online-after-connect`.
pub(super) const ONLINE_AFTER_CONNECT: Check = Check {
    name: "connection/online-after-connect",
    decides: &["CONN-05", "CONN-11"],
    doc: "A connection on which states are published is announced with ONLINE, within time.react of the first state; \
          later than the first state is a warning. ONLINE may be sent before the broker has accepted the connection. \
          While states arrive, CONNECTIONBROKEN or OFFLINE does not stay the last word for longer than time.react: of \
          a state and an ONLINE sent before it, either may arrive first, so the time counts from the first state.",
    arguments: &[],
    listens: &[Listen::Everything],
    reads: &[],
    needs: &[ConnectionView::connection_state],
    start: |_| Box::new(OnlineAfterConnect::default()),
};

/// `connection/values`.
pub(super) const VALUES: Check = Check {
    name: "connection/values",
    decides: &["CONN-10"],
    doc: "The device does not publish CONNECTIONBROKEN itself: that is the broker's to say, as its last will.",
    arguments: &[],
    listens: &[Listen::Published(Topic::Connection)],
    reads: &[],
    needs: &[ConnectionView::connection_state],
    start: |_| Box::new(Values),
};

#[derive(Default)]
struct OnlineAfterConnect {
    open: VecDeque<Session>,
    /// Connections accepted so far, for telling the first from a return.
    online_before: bool,
    stale: Option<Stale>,
}

/// One connection at the tap. A client may publish as soon as it has asked for it.
struct Session {
    connection: u64,
    accepted: bool,
    online: bool,
    first_state: Option<(Moment, u64)>,
    late: bool,
}

/// The last connection message says that the device is gone.
struct Stale {
    /// The first state that came all the same.
    since: Option<Moment>,
    said: &'static str,
    reported: bool,
}

impl OnlineAfterConnect {
    fn limit(context: &CheckContext<'_>) -> Duration {
        context.time.react
    }

    /// The session of a connection, begun if it is new.
    fn session(&mut self, connection: u64) -> &mut Session {
        let known = self.open.iter().position(|session| session.connection == connection);
        let at = known.unwrap_or_else(|| {
            if self.open.len() == CONNECTIONS {
                self.open.pop_front();
            }
            self.open.push_back(Session {
                connection,
                accepted: false,
                online: false,
                first_state: None,
                late: false,
            });
            self.open.len() - 1
        });
        &mut self.open[at]
    }

    fn packets(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        match record.event() {
            Event::Packet {
                connection,
                packet: Packet::Connect { .. },
            } => {
                self.session(*connection);
                return false;
            }
            Event::Packet {
                connection,
                packet: Packet::Connack { code: 0, .. },
            } => {
                self.session(*connection).accepted = true;
                return false;
            }
            Event::Closed { connection, .. }
            | Event::Packet {
                connection,
                packet: Packet::Disconnect { .. },
            } => self.open.retain(|session| session.connection != *connection),
            _ => {}
        }
        let (Some(message), Some(publish)) = (record.published(), record.device_publish()) else {
            return false;
        };
        // A device may keep one client for its connection topic and another one for its states.
        let announced = self.open.iter().any(|session| session.online);
        let Some(session) = self
            .open
            .iter_mut()
            .find(|session| session.connection == publish.connection)
        else {
            return false;
        };
        match message.topic {
            Topic::Connection if record.connection_message().is_some_and(|message| message.is_online()) => {
                if session.first_state.is_some() && !session.online && !session.late {
                    let words = "ONLINE is published after the first state of the connection";
                    findings.push(remark("CONN-05", record.seq(), words));
                }
                session.online = true;
                self.online_before = true;
                true
            }
            Topic::State if !session.online && !announced => {
                session.first_state.get_or_insert((record.at().moment, record.seq()));
                false
            }
            _ => false,
        }
    }

    /// Connections whose time to say ONLINE is up.
    fn overdue(&mut self, now: &End, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        if now.link.disturbed || self.open.iter().any(|session| session.online) {
            return;
        }
        for session in &mut self.open {
            let Some((since, seq)) = session.first_state else {
                continue;
            };
            if session.accepted && !session.late && now.moment.since(since) > Self::limit(context) {
                session.late = true;
                let id = if self.online_before { "CONN-11" } else { "CONN-05" };
                findings.push(broken(
                    id,
                    seq,
                    "states are published on this connection, but never ONLINE",
                ));
            }
        }
    }

    fn delivered(&mut self, record: &Observation<'_>, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        if record.link.disturbed || matches!(record.event(), Event::Fault { .. }) {
            // What the harness did to the link is not the device's fault; its time counts from the repair.
            if let Some(stale) = &mut self.stale {
                stale.since = None;
            }
        }
        let Some(message) = record.delivered() else {
            return;
        };
        match message.topic {
            Topic::Connection => {
                let Some(message) = record.connection_message() else {
                    return;
                };
                let said = if message.is_offline() {
                    Some("OFFLINE")
                } else {
                    message.is_broken().then_some("CONNECTIONBROKEN")
                };
                self.stale = said.map(|said| Stale {
                    since: None,
                    said,
                    reported: false,
                });
            }
            Topic::State if !record.link.disturbed => {
                let limit = Self::limit(context);
                let Some(stale) = self.stale.as_mut().filter(|stale| !stale.reported) else {
                    return;
                };
                let now = record.at().moment;
                if now.since(*stale.since.get_or_insert(now)) > limit {
                    stale.reported = true;
                    let words = format!("states arrive, but the last word on connection is still {}", stale.said);
                    findings.push(broken("CONN-11", record.seq(), words));
                }
            }
            _ => {}
        }
    }
}

impl Running for OnlineAfterConnect {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if let Some(late) = record.lag() {
            // What the harness had no time for is not held against the device.
            let sessions = self.open.iter_mut().filter_map(|session| session.first_state.as_mut());
            let stale = self.stale.iter_mut().filter_map(|stale| stale.since.as_mut());
            for since in sessions.map(|(since, _)| since).chain(stale) {
                *since = *since + late;
            }
        }
        if record.outside_influence() || matches!(record.event(), Event::Fault { .. }) {
            for session in &mut self.open {
                session.first_state = None;
            }
        }
        let judged = self.packets(record, context, findings);
        self.overdue(&record.now(), context, findings);
        self.delivered(record, context, findings);
        judged || record.is_delivered(Topic::Connection)
    }

    fn finish(&mut self, end: &End, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        self.overdue(end, context, findings);
    }
}

struct Values;

impl Running for Values {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let published = record.published();
        if !record.link.tap || published.is_none_or(|message| message.topic != Topic::Connection) {
            return false;
        }
        if record.connection_message().is_some_and(|message| message.is_broken()) {
            findings.push(remark(
                "CONN-10",
                record.seq(),
                "the device itself publishes that its connection is broken",
            ));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;
    use tck_journal::event::LinkFault;

    const CHECK: &str = "connection/online-after-connect";

    fn online() -> serde_json::Value {
        json!({ "connectionState": "ONLINE" })
    }

    #[test]
    fn online_before_the_first_state_of_every_connection_is_right() {
        let mut trace = Trace::tap();
        for connection in [1, 2] {
            trace
                .connected(connection)
                .publish(connection, "connection", 1, true, &online())
                .publish(connection, "state", 0, false, &json!({}))
                .wait(60.0)
                .closed(connection);
        }
        let outcome = trace.judge(CHECK);
        assert!(outcome.findings.is_empty());
        assert_eq!(outcome.judged, 2);
    }

    #[test]
    fn online_after_the_first_state_is_a_remark() {
        let mut trace = Trace::tap();
        trace
            .connected(1)
            .publish(1, "state", 0, false, &json!({}))
            .publish(1, "connection", 1, true, &online());
        assert_eq!(trace.judge(CHECK).summary(), ["CONN-05 warning"]);
    }

    #[test]
    fn a_connection_without_online_is_found_when_its_time_is_up() {
        let mut trace = Trace::tap();
        trace.connected(1).publish(1, "state", 0, false, &json!({})).wait(10.0);
        assert!(trace.judge(CHECK).findings.is_empty());
        trace.wait(30.0);
        assert_eq!(trace.judge(CHECK).summary(), ["CONN-05"]);
    }

    #[test]
    fn what_the_harness_was_late_by_does_not_count() {
        let mut trace = Trace::tap();
        trace.connected(1).publish(1, "state", 0, false, &json!({})).wait(20.0);
        trace.late(10.0).wait(20.0);
        assert!(trace.judge(CHECK).findings.is_empty());
        trace.wait(5.0);
        assert_eq!(trace.judge(CHECK).summary(), ["CONN-05"]);
    }

    #[test]
    fn a_return_without_online_is_found() {
        let mut trace = Trace::tap();
        trace.connected(1).publish(1, "connection", 1, true, &online());
        trace
            .closed(1)
            .connected(2)
            .publish(2, "state", 0, false, &json!({}))
            .wait(40.0);
        assert_eq!(trace.judge(CHECK).summary(), ["CONN-11"]);
    }

    #[test]
    fn separate_clients_for_connection_and_state_are_right() {
        let mut trace = Trace::tap();
        trace.connected(1).publish(1, "connection", 1, true, &online());
        trace.connected(2).publish(2, "state", 0, false, &json!({})).wait(40.0);
        assert!(trace.judge(CHECK).findings.is_empty());
    }

    #[test]
    fn a_broken_connection_as_last_word_over_arriving_states_is_found_once() {
        let mut trace = Trace::subscriber();
        trace.connection("CONNECTIONBROKEN").wait(5.0).state(&json!({}));
        assert!(trace.judge(CHECK).findings.is_empty());
        trace.wait(27.0).state(&json!({})).wait(27.0).state(&json!({}));
        assert_eq!(trace.judge(CHECK).summary(), ["CONN-11"]);
    }

    #[test]
    fn online_may_be_sent_before_the_broker_has_accepted() {
        let mut trace = Trace::tap();
        let will = trace.will();
        trace
            .asks(1, Some(will), 15, 4)
            .publish(1, "connection", 1, true, &online())
            .accepted(1)
            .publish(1, "state", 0, false, &json!({}))
            .wait(60.0)
            .publish(1, "state", 0, false, &json!({}));
        let outcome = trace.judge(CHECK);
        assert!(outcome.findings.is_empty());
        assert_eq!(outcome.judged, 1);
    }

    #[test]
    fn a_state_that_overtakes_the_online_sent_before_it_proves_nothing() {
        let mut trace = Trace::subscriber();
        trace.connection("CONNECTIONBROKEN").wait(90.0).state(&json!({}));
        trace.connection("ONLINE").wait(60.0).state(&json!({}));
        assert!(trace.judge(CHECK).findings.is_empty());
    }

    #[test]
    fn time_during_which_the_harness_silences_the_link_does_not_count() {
        let mut trace = Trace::subscriber();
        trace.fault(LinkFault::Silence { direction: None });
        trace.wait(20.0).connection("CONNECTIONBROKEN").wait(60.0);
        trace.fault(LinkFault::Restore).wait(2.0).state(&json!({}));
        trace.connection("ONLINE").wait(60.0).state(&json!({}));
        assert!(trace.judge(CHECK).findings.is_empty());
    }

    #[test]
    fn the_device_saying_broken_itself_is_a_remark_and_the_will_is_not() {
        let mut trace = Trace::tap();
        trace.connected(1).connection("CONNECTIONBROKEN");
        assert!(trace.judge("connection/values").findings.is_empty());
        trace.publish(
            1,
            "connection",
            1,
            true,
            &json!({ "connectionState": "CONNECTIONBROKEN" }),
        );
        assert_eq!(trace.judge("connection/values").summary(), ["CONN-10 warning"]);
    }
}
