//! What the messages of a vehicle, and those to it, never had: kept without what came, since there may be many vehicles.

use std::collections::BTreeSet;

use super::AuditContext;
use super::result::SideResult;
use tck_base::pattern::Bindings;
use tck_judge::{MessageTally, never_shown};
use tck_pack::Role;
use tck_result::MessageCoverage;
use tck_suite::model::{Monitor, Recordings};

/// What never came, and which requirements that recordings can decide are undecided for it.
pub(super) fn covered(tally: &MessageTally, sides: &[SideResult], scene: AuditContext<'_>) -> MessageCoverage {
    let mut coverage = tally.result().only_missing();
    let bindings = Bindings::above(vec![tally.pack().words()]);
    for role in [Role::Agv, Role::MasterControl] {
        let Some(side) = sides.iter().find(|side| side.role == role.word()) else {
            continue;
        };
        let decided: BTreeSet<&str> = side.requirements.iter().map(|known| known.id.as_str()).collect();
        let is_open = |monitor: &Monitor, id: &str| {
            let is_silent = matches!(monitor.recordings, Recordings::Never(_) | Recordings::Packets);
            !is_silent && scene.options.wants_monitor(monitor) && !decided.contains(id)
        };
        for one in never_shown(scene.rules, role, tally, &bindings, &is_open) {
            if !coverage.undecided.contains(&one) {
                coverage.undecided.push(one);
            }
        }
    }
    coverage
}
