//! Topics below a vehicle whose last level is nearly one of the protocol: nobody listens to them.
//!
//! A name that differs in case or punctuation alone is wrong. One with another letter may be the vendor's own, unless what
//! belongs on the topic of the right name comes there, and nothing on that.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::Options;
use super::result::{AuditResult, FindingResult, SideResult};
use super::topics::Beside;
use tck_base::verdict::Verdict;
use tck_capture::Message;
use tck_judge::Rules;
use tck_pack::{Pack, Packs, Role};
use tck_view::{MessageView, Topic};

/// The monitor that judges the names of topics where all traffic is seen.
const MONITOR: &str = "topic/names";
const REQUIREMENT: &str = "TOPIC-01";
/// How many of them are remembered.
const MOST: usize = 1024;

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Misnamed(BTreeMap<String, Seen>);

#[derive(Debug)]
struct Seen {
    beside: Beside,
    /// Whether the name alone is wrong.
    certain: bool,
    finding: FindingResult,
}

impl Misnamed {
    /// Notes a message on a topic of no known name.
    pub fn note(&mut self, packs: &Packs, number: u64, beside: Beside, message: &Message) {
        let at = message.at.map(|at| format!("{at:.3}")).unwrap_or_default();
        if let Some(known) = self.0.get_mut(&message.topic) {
            known.finding.count += 1;
            known.finding.last = at;
            return;
        }
        let certain = beside.differs_in_spelling;
        if self.0.len() >= MOST || !(certain || belongs(packs, &beside.meant, &message.payload)) {
            return;
        }
        let finding = FindingResult {
            monitor: MONITOR.to_owned(),
            requirement: REQUIREMENT.to_owned(),
            verdict: Verdict::Fail,
            count: 1,
            message: number,
            recording: Some(message.place.file),
            line: Some(message.place.line),
            first: at.clone(),
            last: at,
            text: format!(
                "the last level of {:?} is no topic name; meant is {:?}",
                message.topic.chars().take(200).collect::<String>(),
                beside.meant
            ),
            shown: None,
            interpretation: None,
        };
        let seen = Seen {
            beside,
            certain,
            finding,
        };
        self.0.insert(message.topic.clone(), seen);
    }

    /// Adds what was found to the vehicles it is about.
    pub fn tell(self, result: &mut AuditResult, rules: &Rules, options: &Options) {
        let mut monitors = rules.suites.monitors.iter();
        if !monitors.any(|monitor| monitor.id == MONITOR && options.wants_monitor(monitor)) {
            return;
        }
        for seen in self.0.into_values() {
            let Seen {
                beside,
                certain,
                finding,
            } = seen;
            let mut vehicles = result.vehicles.iter_mut().rev();
            let Some(vehicle) = vehicles.find(|vehicle| vehicle.topics == beside.topics) else {
                continue;
            };
            if !certain && vehicle.messages.get(&beside.meant).is_some_and(|count| *count > 0) {
                continue;
            }
            let publisher = rules.packs.all().iter().find_map(|pack| pack.topic(&beside.meant));
            let role = publisher.map_or(Role::Agv, |rule| rule.publisher);
            if !vehicle.sides.iter().any(|side| side.role == role.word()) {
                let side = SideResult::new(role, 0, 1, Vec::new(), [].into(), Vec::new());
                vehicle.sides.push(side);
            }
            let side = vehicle.sides.iter_mut().find(|side| side.role == role.word());
            if let Some(side) = side {
                side.undecided.retain(|known| known.monitor != finding.monitor);
                side.messages += finding.count;
                side.add_apart(finding);
            }
        }
    }
}

/// Whether this is what comes on the topic of that name in one of the versions.
fn belongs(packs: &Packs, name: &str, payload: &[u8]) -> bool {
    let read = |pack: &Arc<Pack>| MessageView::of_slice(Topic::of_name(name), payload, pack.names()).ok();
    packs.all().iter().filter_map(read).any(|message| match message {
        MessageView::Order(order) => order.order_id.is_there() && order.nodes.is_there(),
        MessageView::InstantActions(message) => message.header.header_id.is_there() && message.actions.is_there(),
        MessageView::State(state) => state.operating_mode.is_there() && state.action_states.is_there(),
        MessageView::Connection(connection) => connection.connection_state.is_there(),
        MessageView::Factsheet(factsheet) => factsheet.type_specification.is_there(),
        MessageView::Visualization(message) => {
            message.header.header_id.is_there() && (message.position.is_there() || message.velocity.is_there())
        }
        MessageView::Responses(_) | MessageView::ZoneSet(_) | MessageView::Other(_) => false,
    })
}
