//! What brokers do differently where a run goes on nevertheless, and what cannot be said therefore.

use std::fmt;

/// What a broker does otherwise than most, found by its self-test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Difference {
    /// What is published with QoS 2 arrives with this one.
    LowersQos2(u8),
    /// Whoever publishes with QoS 2 is thrown out.
    RefusesQos2,
    /// A topic with a dot arrives as another topic.
    ChangesDots,
    /// Whoever publishes on a topic with a dot is thrown out.
    RefusesDots,
    /// A subscription with a wildcard gets nothing that is retained.
    KeepsFromWildcards,
    /// A subscriber at this other node of its cluster gets nothing that is retained.
    KeepsFromNode(String),
}

impl Difference {
    /// Whether it makes this topic unusable.
    #[must_use]
    pub fn spoils(&self, topic: &str) -> bool {
        matches!(self, Self::ChangesDots | Self::RefusesDots) && topic.contains('.')
    }

    /// What it restricts, in one sentence about the broker at this address.
    #[must_use]
    pub fn limit(&self, broker: &str) -> String {
        format!("The broker at {broker} {self}")
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LowersQos2(qos) => write!(
                f,
                "passes on with QoS {qos} what is published with QoS 2: only a tap can tell what a device publishes with QoS 2."
            ),
            Self::RefusesQos2 => f.write_str(
                "ends the connection of whoever publishes with QoS 2: a device that does so is seen as one that breaks off.",
            ),
            Self::ChangesDots => {
                f.write_str("changes topics with a `.` in them: a device with a `.` in its names is not reached.")
            }
            Self::RefusesDots => f.write_str(
                "ends the connection of whoever publishes on a topic with a `.` in it: a device with a `.` in its names is \
                 not reached.",
            ),
            Self::KeepsFromWildcards => f.write_str(
                "gives a subscription with a wildcard nothing that is retained: who subscribes so does not learn who is \
                 there, and what an earlier run has left there may not be found.",
            ),
            Self::KeepsFromNode(node) => write!(
                f,
                "keeps what is retained from subscribers at {node}: who subscribes there does not learn who is there."
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_topics_with_a_dot_are_spoilt() {
        assert!(Difference::ChangesDots.spoils("uagv/v2/ACME/a.1/state"));
        assert!(!Difference::RefusesDots.spoils("uagv/v2/ACME/a-1/state"));
        assert!(!Difference::RefusesQos2.spoils("uagv/v2/ACME/a.1/state"));
        let limit = Difference::LowersQos2(1).limit("mqtt://host:1883");
        assert!(
            limit.starts_with("The broker at mqtt://host:1883 passes on with QoS 1 "),
            "{limit}"
        );
    }
}
