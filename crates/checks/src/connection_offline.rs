//! `connection/says-offline`: who leaves in good order says so before.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::finding::broken;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::{Direction, Event, Packet};
use tck_view::ConnectionView;
use tck_world::{Listen, Observation, Topic};

/// How many connections are kept in mind.
const CONNECTIONS: usize = 32;

/// How long a vehicle that has said OFFLINE may still send states, for what was queued has to go out.
const LAST_WORDS: Duration = Duration::from_secs(5);

/// Who leaves in good order says so before.
pub(super) const SAYS_OFFLINE: Check = Check {
    name: "connection/says-offline",
    decides: &["CONN-07", "CONN-08"],
    doc: "At the tap: on a connection that was announced with ONLINE, a DISCONNECT of the device comes after OFFLINE. A \
          connection that just ends, or is ended while the harness disturbs the link, is not judged. Who has said OFFLINE \
          does not go on: found when states and then ONLINE follow on the same connection, or states for more than \
          five seconds.",
    arguments: &[],
    listens: &[
        Listen::Disconnect,
        Listen::Published(Topic::State),
        Listen::Published(Topic::Connection),
    ],
    reads: &[],
    needs: &[ConnectionView::connection_state],
    start: |_| Box::new(SaysOffline::default()),
};

#[derive(Default)]
struct SaysOffline {
    /// What was said last on the connection topic, by connection: whether it was ONLINE.
    online: BTreeMap<u64, bool>,
    /// The connections on which OFFLINE was said last.
    gone: BTreeMap<u64, Gone>,
}

/// A vehicle that has said OFFLINE on a connection.
struct Gone {
    since: Moment,
    /// It has sent a state since.
    goes_on: bool,
    told: bool,
}

impl SaysOffline {
    /// Whether the vehicle goes on with a connection on which it has said OFFLINE.
    fn goes_on(&mut self, connection: u64, record: &Observation<'_>) -> bool {
        let now = record.at().moment;
        let is_state = record.topic() == Some(Topic::State);
        let said = record.connection_message();
        let says_online = said.is_some_and(|message| message.is_online());
        let mut found = false;
        if let Some(gone) = self.gone.get_mut(&connection) {
            gone.goes_on |= is_state;
            let long = is_state && now.since(gone.since) > LAST_WORDS;
            found = (long || says_online && gone.goes_on) && !gone.told;
            gone.told |= found;
        }
        if said.is_some_and(|message| message.is_offline()) {
            if self.gone.len() >= CONNECTIONS {
                self.gone.pop_first();
            }
            self.gone.entry(connection).or_insert(Gone {
                since: now,
                goes_on: false,
                told: false,
            });
        } else if says_online {
            self.gone.remove(&connection);
        }
        found && !record.link.disturbed
    }
}

impl Running for SaysOffline {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let publish = record.device_publish();
        if let Some(publish) = &publish
            && self.goes_on(publish.connection, record)
        {
            let text = "the vehicle has said OFFLINE, and goes on sending states on the same connection";
            findings.push(broken("CONN-08", record.seq(), text));
        }
        if let Some(publish) = publish.filter(|_| record.topic() == Some(Topic::Connection)) {
            let said = record.connection_message();
            if self.online.len() >= CONNECTIONS {
                self.online.pop_first();
            }
            let says_online = said.is_some_and(|message| message.is_online());
            self.online.insert(publish.connection, says_online);
            return said.is_some_and(|message| message.is_offline());
        }
        if record.entry.record.direction == Some(Direction::ToDevice) {
            return false;
        }
        let Event::Packet {
            connection,
            packet: Packet::Disconnect { code: 0 },
        } = record.event()
        else {
            return false;
        };
        let Some(online) = self.online.remove(connection).filter(|_| !record.link.disturbed) else {
            return false;
        };
        if online {
            let text = "the vehicle disconnects in good order, and has not said OFFLINE before";
            findings.push(broken("CONN-07", record.seq(), text));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;
    use tck_journal::event::{Direction, LinkFault, Packet};

    fn leaves(offline: bool, fault: bool, in_order: bool) -> Vec<String> {
        let mut trace = Trace::tap();
        trace.connected(1);
        let online = json!({ "connectionState": "ONLINE" });
        trace.publish(1, "connection", 1, true, &online);
        if fault {
            trace.fault(LinkFault::Silence { direction: None });
        }
        if offline {
            trace.publish(1, "connection", 1, true, &json!({ "connectionState": "OFFLINE" }));
        }
        if in_order {
            trace.packet(1, Direction::FromDevice, Packet::Disconnect { code: 0 });
        }
        trace.closed(1);
        trace.judge("connection/says-offline").summary()
    }

    #[test]
    fn who_says_offline_or_just_breaks_off_is_right() {
        assert!(leaves(true, false, true).is_empty());
        assert!(leaves(false, false, false).is_empty());
        assert!(leaves(false, true, true).is_empty());
    }

    #[test]
    fn who_says_offline_and_goes_on_is_found_once() {
        let goes_on = |seconds: f64, back: bool| {
            let mut trace = Trace::tap();
            trace.connected(1);
            let says = |what: &str| json!({ "connectionState": what });
            trace.publish(1, "connection", 1, true, &says("ONLINE"));
            trace.publish(1, "connection", 1, true, &says("OFFLINE"));
            trace.wait(seconds).publish(1, "state", 0, false, &json!({}));
            if back {
                trace.publish(1, "connection", 1, true, &says("ONLINE"));
            }
            trace.publish(1, "state", 0, false, &json!({}));
            trace.judge("connection/says-offline").summary()
        };
        assert!(goes_on(1.0, false).is_empty());
        assert_eq!(goes_on(6.0, false), ["CONN-08"]);
        assert_eq!(goes_on(1.0, true), ["CONN-08"]);
    }

    #[test]
    fn a_disconnect_without_offline_is_found() {
        assert_eq!(leaves(false, false, true), ["CONN-07"]);
    }
}
