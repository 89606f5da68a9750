//! Which monitors a recording can be judged by, and how.
//!
//! A monitor that is listed nowhere is not used, and a test says so.

/// How a monitor is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// Whatever else is missing: it judges each message by itself.
    EachMessage,
    /// Only where nothing is missing: it holds messages against earlier ones.
    Unbroken,
    /// As the one before, and only where the recording says when messages came.
    UnbrokenInTime,
    /// Only on packets between a client and its broker.
    Packets,
    /// Not at all; a recording of a subscriber cannot show it.
    Never(&'static str),
}

const EACH_MESSAGE: &[&str] = &[
    "commands/arrays",
    "commands/edge-ends",
    "commands/identifiers",
    "commands/instant-actions-listed",
    "commands/mandatory-parameters",
    "commands/nodes-and-edges",
    "commands/parameter-form",
    "commands/parameter-keys",
    "commands/position-range",
    "commands/released",
    "commands/scopes",
    "commands/sequence",
    "commands/trajectory",
    "errors/emergency-stop-is-fatal",
    "errors/reference-format",
    "errors/typed",
    "factsheet/consistency",
    "factsheet/declared-scopes",
    "factsheet/limits",
    "factsheet/parameter-format",
    "factsheet/predefined-actions",
    "header/id-rises",
    "header/identity",
    "header/timestamp",
    "header/version",
    "message/encoding",
    "message/schema",
    "message/schema-of-commands",
    "state/idle-empty",
    "state/identifiers",
    "state/maps",
    "state/position-range",
    "state/trajectory",
    "topic/structure",
];

const UNBROKEN: &[&str] = &[
    "action/blocking",
    "action/linked-state",
    "cancel/course",
    "commands/action-ids",
    "commands/actions-of-factsheet",
    "commands/axes",
    "commands/base-kept",
    "commands/contradicts",
    "commands/corridors",
    "commands/limits",
    "commands/load-device",
    "commands/map-download",
    "commands/map-duplicate",
    "commands/map-enabled",
    "commands/map-on-board",
    "commands/modes",
    "commands/node-ids",
    "commands/node-position",
    "commands/optional-fields",
    "commands/order-ids",
    "commands/required-fields",
    "commands/resent",
    "commands/start",
    "commands/start-between-nodes",
    "commands/start-on-node",
    "commands/topics",
    "commands/trajectory-ends",
    "commands/updates",
    "commands/zone-set",
    "errors/blame",
    "errors/persist-until-new-order",
    "factsheet/network",
    "instant/answered-together",
    "instant/scope",
    "state/action-ids",
    "state/action-states-kept",
    "state/action-transitions",
    "state/action-triggers",
    "state/battery-levels",
    "state/described-results",
    "state/described-statuses",
    "state/joint-position",
    "state/last-node",
    "state/last-node-place",
    "state/loads",
    "state/map-changes",
    "state/node-positions",
    "state/order-kept",
    "state/order-known",
    "state/order-not-replaced",
    "state/paused-actions",
    "state/planned-path",
    "state/remaining-route",
    "state/trajectory-ends",
    "state/update-id-rises",
    "visualization/position",
];

const UNBROKEN_IN_TIME: &[&str] = &[
    "commands/order-interval",
    "instant/answered",
    "instant/begins",
    "instant/not-queued",
    "instant/requests",
    "motion/axes",
    "motion/corridor",
    "motion/corridor-point",
    "motion/curve-orientation",
    "motion/edge-orientation",
    "motion/edge-rotation-speed",
    "motion/edge-speed",
    "motion/mode-speed",
    "motion/next-corridor",
    "motion/node-theta",
    "motion/node-tolerance",
    "motion/rotation-place",
    "motion/trajectory",
    "motion/turn-sign",
    "motion/velocity-axes",
    "motion/velocity-sign",
    "state/bursts",
    "state/driving",
    "state/own-limits",
    "state/pause-stands",
    "state/period",
    "state/position-moves",
    "visualization/rate",
];

/// Why what needs packets is not judged.
pub(super) const PACKETS: &str = "only the packets between device and broker show it";
const FLEET: &str = "it needs to be known what was asked of the master control, and which vehicles it has";
const ABSENT: &str = "that something never came is not shown by a recording, which may lack it";
const AWAY: &str = "the message that ends the absence may be missing";

const OF_PACKETS: &[&str] = &[
    "connection/says-offline",
    "connection/values",
    "mqtt/connect",
    "mqtt/quality",
    "mqtt/quality-of-commands",
    "mqtt/version-of-commands",
];

const WHOLE: &str = "only all packets of a vehicle from the beginning show it";
const NEVER: &[(&str, &str)] = &[
    ("commands/alive", WHOLE),
    ("commands/listens", WHOLE),
    ("commands/while-away", AWAY),
    ("connection/online-after-connect", WHOLE),
    ("connection/stays", WHOLE),
    ("fleet/commanded", FLEET),
    ("fleet/each-heard", WHOLE),
    ("fleet/own-orders", FLEET),
    ("topic/heard", WHOLE),
    ("topic/names", ABSENT),
    ("topic/own-side", WHOLE),
    ("visualization/published", ABSENT),
];

/// How a monitor is used; `None` when it is listed nowhere.
pub(super) fn of(monitor: &str) -> Option<Use> {
    if EACH_MESSAGE.contains(&monitor) {
        return Some(Use::EachMessage);
    }
    if UNBROKEN.contains(&monitor) {
        return Some(Use::Unbroken);
    }
    if UNBROKEN_IN_TIME.contains(&monitor) {
        return Some(Use::UnbrokenInTime);
    }
    if OF_PACKETS.contains(&monitor) {
        return Some(Use::Packets);
    }
    let never = NEVER.iter().find(|(name, _)| *name == monitor);
    never.map(|(_, why)| Use::Never(why))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_monitor_has_its_use_and_no_other_is_listed() {
        let library = tck_testing::library();
        let monitors = &library.rules.suites.monitors;
        for monitor in monitors {
            let lists = [EACH_MESSAGE, UNBROKEN, UNBROKEN_IN_TIME, OF_PACKETS];
            let listed = lists.iter().filter(|list| list.contains(&monitor.id.as_str())).count();
            let never = NEVER.iter().filter(|(name, _)| *name == monitor.id).count();
            assert_eq!(
                listed + never,
                1,
                "{} is to be in one list of src/audit/scope.rs",
                monitor.id
            );
        }
        let lists = [EACH_MESSAGE, UNBROKEN, UNBROKEN_IN_TIME, OF_PACKETS];
        let all = lists.iter().map(|list| list.len()).chain([NEVER.len()]);
        assert_eq!(all.sum::<usize>(), monitors.len());
    }
}
