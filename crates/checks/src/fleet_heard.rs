//! `fleet/each-heard`: of each vehicle all topics are heard, and not some of them only.

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_pack::Role;
use tck_world::{Listen, Observation, Seen, Topic};

/// Of each vehicle all topics are heard, and not some of them only.
pub(super) const EACH_HEARD: Check = Check {
    name: "fleet/each-heard",
    decides: &["TOPIC-14"],
    doc: "A master control that has subscribed to one of the topics state, connection and factsheet of a vehicle has \
          subscribed to the others as well, `time.react` after it has subscribed to anything last. Seen by the tap; a kept \
          session, of which the broker remembers more, is not judged.",
    arguments: &[],
    listens: &[Listen::Sent(Topic::State)],
    reads: &[],
    needs: &[],
    start: |_| Box::new(EachHeard::default()),
};

#[derive(Default)]
struct EachHeard {
    told: bool,
}

/// The topics a master control has to hear.
const TOPICS: [&str; 3] = ["state", "connection", "factsheet"];

impl Running for EachHeard {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let own = record.is(Seen::Sent, Topic::State) && context.role == Role::MasterControl;
        if !own || !record.link.tap || record.link.disturbed {
            return false;
        }
        let settled = context.time.react;
        let fleet = context.world.fleet().borrow();
        let hears = |name: &&str| {
            let topic = context.topics.get(*name)?;
            fleet.hears(topic, record.at().moment, settled)
        };
        let all: Option<Vec<bool>> = TOPICS.iter().map(hears).collect();
        let Some(all) = all.filter(|all| all.contains(&true)) else {
            return false;
        };
        if let Some(at) = all.iter().position(|heard| !heard).filter(|_| !self.told) {
            self.told = true;
            let (name, vehicle) = (TOPICS[at], quote(context.identity.1));
            let text = format!("topic {name} of vehicle {vehicle} is not subscribed, though another one of it is");
            findings.push(broken("TOPIC-14", record.seq(), text));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;
    use tck_journal::event::{Direction, Filter, Packet};

    fn heard(filters: &[&str], after: f64) -> Vec<String> {
        let mut trace = Trace::master_control_at_tap();
        trace.connect(1, None, 15, 4);
        let filters = filters.iter().map(|name| Filter {
            filter: trace.topic(name),
            qos: 1,
        });
        let filters = filters.collect();
        trace.packet(1, Direction::FromDevice, Packet::Subscribe { packet_id: 1, filters });
        trace.wait(after).shows(&json!({}));
        trace.judge("fleet/each-heard").summary()
    }

    #[test]
    fn who_hears_the_state_hears_the_factsheet() {
        assert_eq!(heard(&["state", "connection"], 40.0), ["TOPIC-14"]);
        assert!(heard(&["state", "connection"], 10.0).is_empty());
        assert!(heard(&["state", "connection", "factsheet"], 40.0).is_empty());
        assert!(heard(&["visualization"], 40.0).is_empty());
    }
}
