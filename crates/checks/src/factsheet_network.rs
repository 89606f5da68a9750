//! `factsheet/network`: the network data of a vehicle in operation stay what they are.

use serde_json::Value;

use crate::finding::{broken, show};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{FactsheetView, VehicleConfig};
use tck_world::{Fact, Listen, Observation, Topic};

/// The network data of a vehicle in operation stay what they are.
pub(super) const NETWORK: Check = Check {
    name: "factsheet/network",
    decides: &["FACT-10"],
    doc: "vehicleConfig.network says the same in every factsheet of one connection. Without a tap a connection lasts until \
          OFFLINE or CONNECTIONBROKEN.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Factsheet),
        Listen::Published(Topic::Factsheet),
    ],
    reads: &[Fact::Restarts],
    needs: &[VehicleConfig::network],
    start: |_| Box::new(Network::default()),
};

#[derive(Default)]
struct Network {
    said: Option<Value>,
}

impl Running for Network {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.restarts().connects(record) || record.outside_influence() {
            self.said = None;
        }
        let message = record.published();
        if message.is_none_or(|message| message.topic != Topic::Factsheet) {
            return false;
        }
        let path = [FactsheetView::vehicle_config, VehicleConfig::network];
        let network = record.json().and_then(|sheet| record.names().raw(sheet, &path));
        let Some(network) = network else { return false };
        let before = self.said.replace(network.clone());
        if let Some(before) = before.as_ref().filter(|before| *before != network) {
            let text = format!("the network data were {}, and are {} now", show(before), show(network));
            findings.push(broken("FACT-10", record.seq(), text));
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
                trace.connection("CONNECTIONBROKEN");
            }
            trace.connection("ONLINE");
            trace.message("factsheet", &sheet(last));
            trace.judge("factsheet/network").summary()
        };
        assert!(judge(false, 1).is_empty());
        assert!(judge(true, 2).is_empty());
        assert_eq!(judge(false, 2), ["FACT-10"]);
    }
}
