//! `connection/says-offline`: who leaves in good order says so before.

use std::collections::BTreeMap;

use super::traffic::{Traffic, broken, device_publish, text};
use super::{Check, CheckContext, CheckFinding, Running};
use crate::journal::Entry;
use crate::journal::event::{Direction, Event, Packet};

/// How many connections are kept in mind.
const CONNECTIONS: usize = 32;

/// See the module.
pub(super) const SAYS_OFFLINE: Check = Check {
    name: "connection/says-offline",
    decides: &["CONN-07"],
    doc: "At the tap: on a connection that was announced with ONLINE, a DISCONNECT of the device comes after OFFLINE. A \
          connection that just ends, or is ended while the harness disturbs the link, is not judged.",
    arguments: &[],
    start: |_| Box::new(SaysOffline::default()),
};

#[derive(Default)]
struct SaysOffline {
    traffic: Traffic,
    /// What was said last on the connection topic, by connection: whether it was ONLINE.
    online: BTreeMap<u64, bool>,
}

impl Running for SaysOffline {
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.traffic.note(entry);
        if let Some((connection, topic, ..)) = device_publish(entry)
            && context.topic_name(topic) == Some("connection")
        {
            let said = entry.json().map(|message| text(message, "connectionState") == "ONLINE");
            if self.online.len() >= CONNECTIONS {
                self.online.pop_first();
            }
            self.online.insert(connection, said.unwrap_or_default());
            return false;
        }
        if entry.record.direction == Some(Direction::ToDevice) {
            return false;
        }
        let Event::Packet {
            connection,
            packet: Packet::Disconnect { code: 0 },
        } = entry.event()
        else {
            return false;
        };
        let Some(online) = self.online.remove(connection).filter(|_| !self.traffic.disturbed) else {
            return false;
        };
        if online {
            let text = "the vehicle disconnects in good order, and has not said OFFLINE before";
            findings.push(broken("CONN-07", entry.seq(), text));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;
    use crate::journal::event::{Direction, LinkFault, Packet};

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
    fn a_disconnect_without_offline_is_found() {
        assert_eq!(leaves(false, false, true), ["CONN-07"]);
    }
}
