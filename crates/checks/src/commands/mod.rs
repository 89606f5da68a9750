//! `commands/…`: what a master control sends, judged message by message and in the light of what its vehicles said.
//!
//! The vehicles are the harness's own. A message of the master control may have crossed a state on the way, so nobody
//! is held to what was said a moment ago; and what is known is forgotten whenever the harness plays with the link or
//! with its vehicle.

mod actions;
mod asked;
mod away;
mod axes;
mod begins;
mod cancelled;
mod capability;
mod contradicts;
mod corridors;
mod fields;
mod follow;
mod graph;
mod health;
mod identity;
mod informed;
mod limits;
mod link;
mod maps;
mod modes;
mod parameters;
mod place;
mod responses;
mod retries;
mod stitching;
#[cfg(test)]
mod tests;
mod trajectories;
mod unreachable;
mod zone_sets;
mod zones_in_force;

pub(super) use actions::{IN_FACTSHEET, LOAD_DEVICE, SCOPES};
pub(super) use asked::NOT_ASKED;
pub(super) use away::AWAY;
pub(super) use axes::AXES;
pub(super) use begins::BEGINS;
pub(super) use cancelled::BASE_KEPT;
pub(super) use capability::{OMNI_ONLY, OPTIONAL, REQUIRED};
pub(super) use contradicts::CONTRADICTS;
pub(super) use corridors::CORRIDORS;
pub(super) use fields::{ARRAYS, IDENTIFIERS, POSITION, POSITION_RANGE, TOPICS, ZONE_SET};
pub(super) use follow::{ORDER_IDS, RESENT, UPDATES};
pub(super) use graph::{EDGE_ENDS, NODES_AND_EDGES, RELEASED, SEQUENCE};
pub(super) use health::HEALTH;
pub(super) use identity::{ACTION_IDS, NODE_IDS};
pub(super) use informed::ON_INFORMATION;
pub(super) use limits::{ORDER_INTERVAL, SIZES};
pub(super) use link::{ALIVE, LISTENS};
pub(super) use maps::{DOWNLOADS, DUPLICATES, ENABLED, ON_BOARD};
pub(super) use modes::MODES;
pub(super) use parameters::{KEYS, MANDATORY, VALUES};
pub(super) use place::{CANCELLED_BETWEEN, CANCELLED_ON_NODE, FIRST_PLACE, START};
pub(super) use responses::{CORRIDORS as CORRIDOR_GRANTS, RESPONSES};
pub(super) use retries::RETRIES;
pub(super) use trajectories::{ENDS, TRAJECTORY};
pub(super) use unreachable::UNREACHABLE;
pub(super) use zone_sets::{IDS as ZONE_SET_IDS, LIMITS as ZONE_SET_LIMITS, ZONES};
pub(super) use zones_in_force::{ENABLED as ZONE_SET_ENABLED, LINE_GUIDED};

use crate::finding::{broken, remark};
use tck_check::{CheckContext, CheckFinding, Running};
use tck_view::{ActionView, Element, InstantActionsView, OrderView, Scope};
use tck_world::Observation;
use tck_world::ordered::{
    ELEMENTS, allowed, allowed_deviation, edges_in_sequence, elements, nodes_in_sequence, place_of, short,
};

/// How many findings of one kind a message is worth.
const REPORTED: usize = 4;

/// A message of the master control to the vehicle.
#[derive(Clone, Copy, Debug)]
enum Command<'e> {
    Order(&'e OrderView),
    Instant(&'e InstantActionsView),
}

impl<'e> Command<'e> {
    /// Reads a record; only what is a JSON object.
    fn read(record: &Observation<'e>) -> Option<Self> {
        let order = record.order().map(|order| Self::Order(order));
        order.or_else(|| record.instant_actions().map(|message| Self::Instant(message)))
    }

    fn order(self) -> Option<&'e OrderView> {
        match self {
            Self::Order(order) => Some(order),
            Self::Instant(_) => None,
        }
    }

    /// Every action in it, with its scope.
    fn actions(self) -> Vec<(Scope, &'e ActionView)> {
        match self {
            Self::Instant(message) => {
                let all = message.commanded().take(ELEMENTS);
                all.map(|action| (Scope::Instant, action)).collect()
            }
            Self::Order(order) => {
                let of_element = |element: Element<'e>| {
                    let scope = if element.is_edge() { Scope::Edge } else { Scope::Node };
                    element.actions().iter().map(move |action| (scope, action))
                };
                elements(order).flat_map(of_element).take(ELEMENTS).collect()
            }
        }
    }
}

/// Takes down what is wrong with one message, not more than is readable.
struct Found<'f> {
    seq: u64,
    findings: &'f mut Vec<CheckFinding>,
    before: usize,
}

impl<'f> Found<'f> {
    fn new(record: &Observation<'_>, findings: &'f mut Vec<CheckFinding>) -> Self {
        let before = findings.len();
        Self {
            seq: record.seq(),
            findings,
            before,
        }
    }

    fn push(&mut self, finding: CheckFinding) {
        let alike =
            |known: &&CheckFinding| known.requirement == finding.requirement && known.verdict == finding.verdict;
        if self.findings[self.before..].iter().filter(alike).count() < REPORTED {
            self.findings.push(finding);
        }
    }

    fn broken(&mut self, requirement: &str, message: impl Into<String>) {
        self.push(broken(requirement, self.seq, message));
    }

    fn remark(&mut self, requirement: &str, message: impl Into<String>) {
        self.push(remark(requirement, self.seq, message));
    }
}

/// A rule on a single message: whether there was something to judge.
type Rule = fn(Command<'_>, &CheckContext<'_>, &mut Found<'_>) -> bool;

/// Judges every message by itself.
struct Each {
    rule: Rule,
}

impl Each {
    fn start(rule: Rule) -> Box<dyn Running> {
        Box::new(Self { rule })
    }
}

impl Running for Each {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(command) = Command::read(record) else {
            return false;
        };
        (self.rule)(command, context, &mut Found::new(record, findings))
    }
}
