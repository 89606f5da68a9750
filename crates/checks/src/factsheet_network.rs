//! `factsheet/network`: the network data of a vehicle in operation stay what they are.

use serde_json::Value;

use super::traffic::{Traffic, broken, maybe_restarted, outside_influence, show};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::Entry;
use tck_journal::event::{Event, Packet};

/// See the module.
pub(super) const NETWORK: Check = Check {
    name: "factsheet/network",
    decides: &["FACT-10"],
    doc: "vehicleConfig.network says the same in every factsheet of one connection. Without a tap a connection lasts from one \
          connection message to the next.",
    arguments: &[],
    start: |_| Box::new(Network::default()),
};

#[derive(Default)]
struct Network {
    traffic: Traffic,
    said: Option<Value>,
}

impl Running for Network {
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.traffic.note(entry);
        let connects = matches!(
            entry.event(),
            Event::Packet {
                packet: Packet::Connect { .. },
                ..
            }
        );
        let anew = connects || !self.traffic.tap && maybe_restarted(self.traffic, entry, context);
        if anew || outside_influence(entry) {
            self.said = None;
        }
        let message = self.traffic.published(entry, context);
        if message.is_none_or(|message| message.name != "factsheet") {
            return false;
        }
        let Some(network) = entry.json().and_then(|sheet| sheet.pointer("/vehicleConfig/network")) else {
            return false;
        };
        let before = self.said.replace(network.clone());
        if let Some(before) = before.as_ref().filter(|before| *before != network) {
            let text = format!("the network data were {}, and are {} now", show(before), show(network));
            findings.push(broken("FACT-10", entry.seq(), text));
        }
        before.is_some()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;

    #[test]
    fn an_address_that_changes_is_found_unless_the_vehicle_connects_anew() {
        let sheet =
            |last: u8| json!({ "vehicleConfig": { "network": { "localIpAddress": format!("10.0.0.{last}") } } });
        let judge = |anew: bool, last: u8| {
            let mut trace = Trace::subscriber();
            trace.message("factsheet", &sheet(1));
            if anew {
                trace.connection("ONLINE");
            }
            trace.message("factsheet", &sheet(last));
            trace.judge("factsheet/network").summary()
        };
        assert!(judge(false, 1).is_empty());
        assert!(judge(true, 2).is_empty());
        assert_eq!(judge(false, 2), ["FACT-10"]);
    }
}
