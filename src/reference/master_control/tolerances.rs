//! Liberties a good master control may take: behaviour the standard leaves open, and that must not be accused.

use std::time::Duration;

use super::config::MasterControlConfig;
use crate::reference::agv::Tolerance;

/// A name that is not in [`TOLERANCES`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reference master control has no tolerance `{0}`")]
pub struct UnknownTolerance(pub String);

macro_rules! tolerances {
    ($($variant:ident $name:literal [$($id:literal),+] $does:literal;)+) => {
        /// A tolerance of the reference master control; see [`TOLERANCES`] for what each does.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the sentence stands in TOLERANCES")]
        pub enum ToleranceName { $($variant),+ }

        /// All tolerances of the reference master control.
        pub const TOLERANCES: &[Tolerance] = &[$(Tolerance { name: $name, under: &[$($id),+], does: $does }),+];

        const ALL: &[ToleranceName] = &[$(ToleranceName::$variant),+];
    };
}

tolerances! {
    AnswersSlowly "answers-slowly" ["ORD-UPD-02"] "Looks at a message half a second after it came.";
    NoHorizon "no-horizon" ["ORD-09"] "Sends the base only.";
    LongHorizon "long-horizon" ["ORD-09"] "Sends the whole way as horizon.";
    WholeBase "whole-base" ["ORD-UPD-02"] "Releases the whole way at once.";
    SmallSteps "small-steps" ["ORD-UPD-02", "ORD-UPD-04"] "Keeps a longer base and extends it at every node.";
    ResendsOnce "resends-once" ["ORD-REJ-18"] "Sends an order again, unchanged, that was not seen within a second.";
    StandsOnLastNode "stands-on-last-node" ["ORD-CANCEL-17"] "Begins at the last node with a wide deviation when a vehicle stands between nodes.";
    DescriptionsEverywhere "descriptions-everywhere" ["OPT-03"] "Describes nodes and edges where the vehicle supports it.";
    VendorFields "vendor-fields" ["JSON-10"] "Adds members of its own to every message.";
    PrettyPrinted "pretty-printed" ["MQTT-02"] "Sends its messages in many lines, indented.";
    KeysReordered "keys-reordered" ["HDR-01"] "Sends the members of its messages in reverse order.";
    HeaderIdFromThousand "header-id-from-thousand" ["HDR-02"] "Begins to count its messages at 1000.";
    HeaderIdRestarts "header-id-restarts" ["HDR-02"] "Counts its messages from 0 again on every connection.";
    UpdateIdFromSeven "update-id-from-seven" ["ORD-UPD-04"] "Begins orders with orderUpdateId 7.";
    SubscribesWithQosOne "subscribes-with-qos-1" ["TOPIC-14"] "Subscribes with QoS 1.";
    SubscribesWithWildcards "subscribes-with-wildcards" ["TOPIC-14"] "Subscribes to everything the vehicles publish with one filter for each topic.";
    SessionKept "session-kept" ["MQTT-01"] "Asks the broker to keep its session.";
    NewestMqtt "newest-mqtt" ["MQTT-01"] "Connects with MQTT 5.";
    AsksForStates "asks-for-states" ["ACT-08"] "Asks for a state when it has begun an order.";
    AsksForFactsheet "asks-for-factsheet" ["ACT-08"] "Asks for the factsheet although it has one.";
    PositionWhereListed "position-where-listed" ["ORD-MSG-08", "OPT-03"] "Leaves nodePosition out for a vehicle whose factsheet lists what it supports, and not this.";
    OrdersToFaulted "orders-to-faulted" ["CONN-14"] "Begins what it is asked for on a vehicle with a FATAL error.";
    SoftActions "soft-actions" ["FACT-15"] "Uses the blocking type SOFT where the vehicle allows it.";
}

/// A set of tolerances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tolerances(u128);

impl Tolerances {
    /// Whether the master control takes this liberty.
    pub(super) fn has(self, tolerance: ToleranceName) -> bool {
        self.0 & (1 << (tolerance as u128)) != 0
    }
}

impl MasterControlConfig {
    /// Lets the master control take a liberty.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn tolerate(&mut self, name: &str) -> Result<(), UnknownTolerance> {
        let position = TOLERANCES.iter().position(|tolerance| tolerance.name == name);
        let tolerance = position.and_then(|at| ALL.get(at)).copied();
        let tolerance = tolerance.ok_or_else(|| UnknownTolerance(name.to_owned()))?;
        self.tolerances.0 |= 1 << (tolerance as u128);
        match tolerance {
            ToleranceName::AnswersSlowly => self.answers_after = Duration::from_millis(500),
            ToleranceName::NoHorizon => self.horizon_length = 0,
            ToleranceName::LongHorizon => self.horizon_length = usize::MAX,
            ToleranceName::WholeBase => self.base_length = usize::MAX,
            ToleranceName::SmallSteps => self.base_length = self.base_length.max(4),
            ToleranceName::ResendsOnce => {
                self.resend_after = Duration::from_secs(1);
                self.resend_limit = 1;
            }
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_kebab_case_and_unique() {
        let mut names: Vec<_> = TOLERANCES.iter().map(|tolerance| tolerance.name).collect();
        assert!(names.iter().all(|name| {
            name.chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-')
        }));
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), TOLERANCES.len());
        assert!(TOLERANCES.len() <= 64, "they are kept in 64 bits");
    }

    #[test]
    fn an_unknown_one_is_refused_by_name() {
        let mut config = MasterControlConfig::default();
        assert_eq!(config.tolerate("no-such"), Err(UnknownTolerance("no-such".to_owned())));
        assert_eq!(config.tolerate("no-horizon"), Ok(()));
        assert_eq!(config.horizon_length, 0);
    }
}
