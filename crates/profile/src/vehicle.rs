//! The words of `vehicle:`: what a test may ask of the mock vehicles a master control is tested with.
//!
//! [`VEHICLE_WORDS`] is the one set of names; the reference AGV knows exactly these.

use VehicleEffect::{ComesOrGoes, Deviates, Moves};

/// A word a test may say to a mock vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VehicleWord {
    /// Name, as in `vehicle: NAME`.
    pub name: &'static str,
    /// Names of the parameters a test may hand over.
    pub parameters: &'static [&'static str],
    /// What the vehicle does from then on.
    pub doc: &'static str,
    /// What follows for those who judge how it is commanded.
    pub effects: &'static [VehicleEffect],
}

/// What follows from a word for those who judge what a master control makes of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VehicleEffect {
    /// It is moved, restarted or relieved of its order: the master control has to find its bearings again.
    Moves,
    /// Its states or its answers are less than the truth.
    Deviates,
    /// It leaves or comes back.
    ComesOrGoes,
}

impl VehicleWord {
    /// Whether this follows from it.
    #[must_use]
    pub fn has(&self, effect: VehicleEffect) -> bool {
        self.effects.contains(&effect)
    }
}

const fn word(name: &'static str, parameters: &'static [&'static str], doc: &'static str) -> VehicleWord {
    VehicleWord {
        name,
        parameters,
        doc,
        effects: &[],
    }
}

const fn that(effects: &'static [VehicleEffect], word: VehicleWord) -> VehicleWord {
    VehicleWord { effects, ..word }
}

/// Every word there is: first what people do at a vehicle, then how it may deviate.
pub const VEHICLE_WORDS: &[VehicleWord] = &[
    that(
        &[Moves],
        word(
            "reset",
            &["nodeId"],
            "It is as new from the factory and stands on the node, or where it started; a vehicle that is connected stays connected.",
        ),
    ),
    that(
        &[Moves],
        word("power-cycle", &[], "It is switched off hard and on again."),
    ),
    that(
        &[Moves, ComesOrGoes],
        word("shutdown", &[], "It ends its connection in good order and stays away."),
    ),
    that(
        &[Moves, ComesOrGoes],
        word("start", &[], "It connects after a shutdown or a break-off."),
    ),
    that(
        &[Moves, ComesOrGoes],
        word(
            "break-off",
            &[],
            "Its connection is lost without a farewell, the broker publishes its last will, and it stays away until `start`; it drives on meanwhile.",
        ),
    ),
    that(
        &[Deviates],
        word(
            "stale-will",
            &[],
            "From its next connection on its last will is old: headerId 0 and a timestamp from long ago.",
        ),
    ),
    that(&[Moves], word("set-mode", &["mode"], "Its operating mode is switched.")),
    that(
        &[Moves],
        word(
            "place-on",
            &["nodeId"],
            "It is put on a node and knows where it is; an order is given up.",
        ),
    ),
    that(
        &[Moves],
        word(
            "move-to",
            &["nodeId", "x", "y", "theta"],
            "It is brought to a place by hand, which takes a mode for people.",
        ),
    ),
    that(&[Moves], word("push-out", &[], "It is moved off the way it was given.")),
    word(
        "shift-position",
        &["by"],
        "It takes itself to stand beside the way it was given, by that many metres.",
    ),
    that(
        &[Moves],
        word("drive-manually", &[], "It is driven by hand for a short way."),
    ),
    that(&[Moves], word("lose-position", &[], "It no longer knows where it is.")),
    that(&[Moves], word("find-position", &[], "It knows where it is again.")),
    word("halt", &[], "It stops where it is, as in traffic."),
    word(
        "stop-before",
        &["nodeId"],
        "It will stop on the edge that leads to the node, before it reaches it.",
    ),
    word("go-on", &[], "It drives on after `halt` or `stop-before`."),
    word("place-obstacle", &["edgeId"], "An obstacle is put on an edge."),
    word("remove-obstacle", &["edgeId"], "The obstacle is taken away."),
    word("emergency-stop", &[], "An emergency stop is pressed."),
    word(
        "release-emergency-stop",
        &[],
        "The emergency stop is released and acknowledged.",
    ),
    word("enter-field", &[], "Somebody enters the protective field."),
    word("leave-field", &[], "The protective field is left."),
    word("press-pause", &[], "The pause button is pressed."),
    word("release-pause", &[], "The pause is ended at the vehicle."),
    word("block-pause", &[], "startPause and stopPause fail."),
    word(
        "unblock-pause",
        &[],
        "A pause and its end by a message are possible again.",
    ),
    word("block-hibernation", &[], "startHibernation and stopHibernation fail."),
    word(
        "unblock-hibernation",
        &[],
        "A hibernation and its end by a message are possible again.",
    ),
    word("lock-charger", &[], "stopCharging fails."),
    word(
        "unlock-charger",
        &[],
        "An end of charging by a message is possible again.",
    ),
    word(
        "provoke-error",
        &["errorLevel", "errorType"],
        "It reports an error of its own; with FATAL it does not drive.",
    ),
    word("clear-error", &[], "Its own errors are gone."),
    word("place-load", &["loadId", "loadType"], "A load is put on it."),
    word("remove-load", &[], "Its loads are taken off."),
    word("trigger", &["actionId"], "The trigger it waits for is given."),
    that(
        &[Moves],
        word(
            "use-lift",
            &["mapId"],
            "The lift with the vehicle in it is brought to another floor.",
        ),
    ),
    word(
        "enable-map",
        &["mapId", "mapVersion"],
        "A map version it has is enabled at the vehicle.",
    ),
    word(
        "set-battery",
        &["charge", "charging"],
        "Its battery has this charge in percent, and charges or does not.",
    ),
    word(
        "request-new-base",
        &["on"],
        "Its states ask for a longer base, or no longer do.",
    ),
    that(
        &[Deviates],
        word("answer-after", &["seconds"], "It takes messages only after that time."),
    ),
    that(
        &[Deviates],
        word(
            "state-interval",
            &["seconds"],
            "It leaves at least that time between two states.",
        ),
    ),
    that(
        &[Deviates],
        word(
            "lose-states",
            &["count"],
            "Its next states are lost on the way, as many as said.",
        ),
    ),
    that(
        &[Deviates],
        word("stay-silent", &[], "It publishes no state, though it is connected."),
    ),
    that(
        &[Deviates],
        word(
            "ignore-orders",
            &["count"],
            "It ignores the next orders silently; all of them unless said.",
        ),
    ),
    that(
        &[Deviates],
        word(
            "reject-orders",
            &["errorType", "count", "references"],
            "It rejects new orders with this error; all of them unless said.",
        ),
    ),
    that(
        &[Deviates],
        word(
            "reject-updates",
            &["errorType", "count", "references"],
            "It rejects updates of its order with this error; all of them unless said.",
        ),
    ),
    word(
        "hold-cancel",
        &["seconds"],
        "cancelOrder stays RUNNING that long, or until `well-behaved`.",
    ),
    word(
        "fail-actions",
        &["actionType", "errorType", "retriable"],
        "Actions end in FAILED, all or those of the type, with an error; in RETRIABLE where that was asked for and `retriable` is said.",
    ),
    word(
        "refuse-map",
        &["errorType"],
        "It refuses every downloadMap with this error.",
    ),
    that(
        &[Moves],
        word(
            "fall-asleep",
            &[],
            "It gives up what it has to do and sleeps, as after startHibernation.",
        ),
    ),
    that(&[Moves], word("wake-up", &[], "It wakes up by itself.")),
    word(
        "ask-for-zone",
        &["zoneId", "zoneSetId", "requestType", "requestId", "way", "over"],
        "Its states ask for access to a zone, or with REPLANNING for a way through it, of so many metres or none; it goes by the answers and does nothing with what it gets.",
    ),
    word(
        "ask-for-corridor",
        &["edgeId", "sequenceId", "requestId"],
        "Its states ask for the corridor of an edge; it goes by the answers and does nothing with what it gets.",
    ),
    word(
        "withdraw-requests",
        &["requestId"],
        "Its states no longer ask for what they were told to ask for: one request, or all.",
    ),
    word(
        "hold-requests",
        &["status"],
        "No answer changes what its states ask for any more; with a status they show that.",
    ),
    word(
        "declare",
        &["factsheet"],
        "Its factsheet is published with this merge patch laid over, and it goes by the limits there; an empty one restores it.",
    ),
    that(
        &[Deviates],
        word(
            "show",
            &["state"],
            "Its states are published with this merge patch laid over; an empty one ends it.",
        ),
    ),
    word(
        "show-visualization",
        &["visualization"],
        "Its visualization messages are published with this merge patch laid over; an empty one ends it.",
    ),
    that(
        &[Deviates],
        word(
            "publish",
            &["topic", "payload", "text"],
            "It publishes a payload once on its own topic: an object is completed with a header, a text goes out as it is.",
        ),
    ),
    that(
        &[Deviates],
        word(
            "speak-version",
            &["version"],
            "The header of all its messages names this version.",
        ),
    ),
    that(
        &[Moves],
        word("well-behaved", &[], "All deviations end; its order and its place stay."),
    ),
];

/// The word of that name.
#[must_use]
pub fn find(name: &str) -> Option<&'static VehicleWord> {
    VEHICLE_WORDS.iter().find(|word| word.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_unique_and_documented() {
        for (at, word) in VEHICLE_WORDS.iter().enumerate() {
            assert!(VEHICLE_WORDS[at + 1..].iter().all(|other| other.name != word.name));
            assert!(word.doc.ends_with('.'), "{}", word.name);
            assert_eq!(find(word.name), Some(word));
        }
    }
}
