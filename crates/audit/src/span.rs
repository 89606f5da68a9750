//! What a monitor that holds messages against earlier ones has to see without a gap: the more it hears, the more holes in a
//! recording touch it.

use super::continuity::Missing;
use tck_check::{Check, find};
use tck_judge::Rules;
use tck_pack::Role;
use tck_suite::model::{Monitor, Recordings, Rule};
use tck_view::{Object, Topic};
use tck_world::{Fact, Listen, Listens};

/// What has to be seen without a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Span {
    /// Nothing but the factsheet that counts: each command is held against it.
    Factsheet,
    /// The states of the vehicle, one after the other, whatever was sent to it.
    States,
    /// The commands, one after the other, whatever the vehicle showed.
    Commands,
    /// Commands and states.
    Conversation,
    /// Commands and states, and where the vehicle is between them.
    Way,
}

impl Span {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Factsheet,
        Self::States,
        Self::Commands,
        Self::Conversation,
        Self::Way,
    ];

    /// The span of a monitor on this side; `None` for one that needs none, or that no recording can be judged by.
    pub fn of(monitor: &Monitor, role: Role, timed: bool, rules: &Rules) -> Option<Self> {
        match monitor.recordings {
            Recordings::MessageAndFactsheet => return Some(Self::Factsheet),
            Recordings::Unbroken => {}
            Recordings::UnbrokenInTime if timed => {}
            _ => return None,
        }
        let check = match &monitor.rule {
            Rule::Check(used) => find(rules.checks, &used.name)?,
            Rule::Always { .. } | Rule::Never { .. } => return Some(Self::Conversation),
        };
        let hears = |topic: Topic| hears(check, topic);
        let states = [Topic::State, Topic::Connection].into_iter().any(hears);
        let commands = [Topic::Order, Topic::InstantActions].into_iter().any(hears);
        Some(if hears(Topic::Visualization) {
            Self::Way
        } else if !states && !commands {
            Self::Factsheet
        } else if role == Role::Agv && states && !commands {
            Self::States
        } else if role == Role::MasterControl && commands && !states {
            Self::Commands
        } else {
            Self::Conversation
        })
    }

    /// Whether what is missing touches it.
    pub const fn is_touched(self, missing: Missing) -> bool {
        match missing {
            Missing::Anything | Missing::Factsheet => true,
            Missing::States => matches!(self, Self::States | Self::Conversation | Self::Way),
            Missing::Commands => matches!(self, Self::Commands | Self::Conversation | Self::Way),
            Missing::Knowledge => matches!(self, Self::Conversation | Self::Way),
            Missing::Visualization => matches!(self, Self::Way),
        }
    }

    /// Whether its monitors are shown messages of this topic.
    pub fn hears(self, topic: &str) -> bool {
        let is_command = super::is_command(topic);
        match self {
            Self::Factsheet | Self::Commands => is_command || topic == "factsheet",
            Self::States => !is_command && topic != "visualization",
            Self::Conversation => topic != "visualization",
            Self::Way => true,
        }
    }

    /// Whether what is found may still be explained by the next message: one that was missing shows itself late.
    pub const fn waits(self) -> bool {
        matches!(self, Self::States | Self::Conversation | Self::Way)
    }

    /// Whether it may begin only where no order and no action is under way.
    pub const fn begins_at_rest(self) -> bool {
        !matches!(self, Self::Factsheet)
    }
}

/// Whether a check is influenced by messages on this topic, by itself or by a fact that it reads.
fn hears(check: &Check, topic: Topic) -> bool {
    let all = Listens::to(check.listens);
    let ways = [Listen::Delivered(topic), Listen::Sent(topic)];
    let directly = ways.into_iter().any(|way| all.overlaps(Listens::to(&[way])));
    directly || check.reads.iter().any(|fact| is_learned_from(*fact, topic))
}

/// Whether a fact is learned from messages on this topic.
fn is_learned_from(fact: Fact, topic: Topic) -> bool {
    match fact {
        Fact::Factsheets => topic == Topic::Factsheet,
        Fact::Restarts => matches!(topic, Topic::State | Topic::Connection),
        Fact::Instant => topic == Topic::InstantActions,
        // What is derived of them is derived of much.
        _ => topic != Topic::Visualization,
    }
}

/// The objects that stand in factsheets alone and that checks cannot do without.
const OF_FACTSHEET: [Object; 5] = [
    Object::FactsheetView,
    Object::ProtocolLimits,
    Object::Timing,
    Object::ProtocolFeatures,
    Object::LoadSpecification,
];

/// Whether a monitor can judge nothing without a factsheet of the vehicle.
pub(super) fn needs_factsheet(monitor: &Monitor, rules: &Rules) -> bool {
    let Rule::Check(used) = &monitor.rule else { return false };
    let Some(check) = find(rules.checks, &used.name) else {
        return false;
    };
    monitor.recordings == Recordings::MessageAndFactsheet
        || check.needs.iter().any(|field| OF_FACTSHEET.contains(&field.object()))
}
