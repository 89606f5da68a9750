//! Faults that end in a warning, and why.
//!
//! They prove clauses like the others. But the text, or a ruling of the catalogue, makes what they break less than an
//! obligation: no master control is failed for it.

/// Name of a fault, and why it is no more than a lapse.
pub const LAPSES: &[(&str, &str)] = &[
    (
        "order-qos-1",
        "A higher QoS delivers the order as well; the ruling of MQTT-06 is a warning.",
    ),
    (
        "instant-actions-qos-2",
        "A higher QoS delivers the actions as well; the ruling of MQTT-06 is a warning.",
    ),
    (
        "instant-actions-retained",
        "No sentence forbids RETAIN on these topics; the ruling of MQTT-06 is a warning.",
    ),
    (
        "orders-retained",
        "No sentence forbids RETAIN on these topics; the ruling of MQTT-06 is a warning.",
    ),
    (
        "connection-with-qos-0",
        "The QoS is asked of whoever publishes; the ruling of TOPIC-14 is a warning.",
    ),
    (
        "never-reconnects",
        "MQTT-10 is a recommendation and never more than a warning.",
    ),
    (
        "lost-order-not-resent",
        "To send an order again is allowed, not demanded.",
    ),
    (
        "first-vehicle-extended-only",
        "It breaks a recommendation only, and MQTT-11 is a design goal.",
    ),
    ("order-id-with-space", "The characters of ids are a recommendation."),
    (
        "unsupported-description",
        "Descriptions are harmless; the ruling of OPT-03 is a warning.",
    ),
    ("base-extended-late", "It breaks a recommendation only."),
    ("new-base-request-ignored", "It breaks a recommendation only."),
    (
        "lost-update-not-resent",
        "To send an update again is allowed, not demanded.",
    ),
    ("missing-paused-is-paused", "It breaks a recommendation only."),
    ("map-not-preloaded", "It breaks a recommendation only."),
    (
        "orders-to-offline",
        "No sentence forbids an order for a vehicle that is lost; the ruling of CONN-12 is a warning.",
    ),
    (
        "old-will-ignored",
        "An order does not prove that the will was ignored; the ruling of CONN-13 is a warning.",
    ),
];

/// Why this fault is a lapse; `None` for one that fails.
#[must_use]
pub fn lapse(fault: &str) -> Option<&'static str> {
    LAPSES.iter().find(|(name, _)| *name == fault).map(|(_, why)| *why)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lapse_is_a_fault() {
        for (name, _) in LAPSES {
            assert!(super::super::find(name).is_some(), "{name}");
        }
    }
}
