//! The registry of liberties the reference AGV can be given: what a vehicle may do otherwise than the usual one
//! without breaking anything.
//!
//! They prove the opposite of the faults: with each of them, and with all that go together, no test may fail. What
//! a liberty changes stands in `configure` (what the vehicle is like) and in `manner` (how it words its messages);
//! the few that change its behaviour are found by searching for their [`ToleranceName`].

mod configure;
pub(super) mod manner;

use super::config::AgvConfig;

/// One switchable liberty of a reference device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tolerance {
    /// Name, in kebab-case, such as `every-state-twice`.
    pub name: &'static str,
    /// The requirements that leave it this liberty.
    pub under: &'static [&'static str],
    /// What it does, in one sentence about the vehicle.
    pub does: &'static str,
}

/// A name that is not in [`TOLERANCES`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reference AGV has no tolerance `{0}`")]
pub struct UnknownTolerance(pub String);

macro_rules! tolerances {
    ($($variant:ident $name:literal [$($id:literal),+] $does:literal;)+) => {
        /// A tolerance of the reference AGV; see [`TOLERANCES`] for what each does.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the sentence stands in TOLERANCES")]
        pub enum ToleranceName { $($variant),+ }

        /// All tolerances of the reference AGV.
        pub const TOLERANCES: &[Tolerance] = &[$(Tolerance { name: $name, under: &[$($id),+], does: $does }),+];

        const ALL: &[ToleranceName] = &[$(ToleranceName::$variant),+];
    };
}

tolerances! {
    // Time
    AnswersSlowly "answers-slowly" ["STATE-03", "ORD-FLOW-06"] "Looks at a message half a second after it came.";
    AnswersVerySlowly "answers-very-slowly" ["STATE-03", "ORD-FLOW-06"] "Looks at a message four seconds after it came.";
    StatesCoalesced "states-coalesced" ["STATE-11", "FACT-14"] "Sends no state within 0.4 s of another, so that changes share a state.";
    StatesSeldom "states-seldom" ["STATE-02"] "Sends a state only every 28 s when nothing happens.";
    StatesOften "states-often" ["STATE-02"] "Sends a state ten times a second, whatever happens.";
    EveryStateTwice "every-state-twice" ["STATE-02"] "Sends every state a second time.";
    VisualizationOff "visualization-off" ["TOPIC-12"] "Publishes no visualization.";
    VisualizationOften "visualization-often" ["TOPIC-12", "VIS-02"] "Publishes the visualization twenty times a second.";
    DrivesSlowly "drives-slowly" ["ORD-06"] "Drives at a quarter of its speed.";
    ActionsLast "actions-last" ["ACT-01"] "Takes a second for every action.";
    ActionsAtOnce "actions-at-once" ["ASTATE-02"] "Performs its actions in no time, so that they are never seen running.";
    ReconnectsLate "reconnects-late" ["MQTT-10"] "Connects again eight seconds after a broken link.";
    KeepAliveTwenty "keep-alive-20" ["CONN-04"] "Asks for a keep-alive of 20 s.";

    // Order and actions
    FirstNodeListed "first-node-listed" ["NODE-03", "STATE-12"] "Lists the first node of an order until it sets out from it.";
    StopsOnNodes "stops-on-nodes" ["ORD-06", "STATE-08"] "Stops for a moment on every node.";
    PreparesEverything "prepares-everything" ["ASTATE-03"] "Prepares every action of an order, and reports it INITIALIZING.";
    ResumesInAMoment "resumes-in-a-moment" ["ASTATE-04", "ACT-18"] "Lets held actions go on half a second after the pause has ended.";
    ErrorsStay "errors-stay" ["ERR-01"] "Keeps the errors of refused instant actions for half a minute.";

    // Wording
    VendorFields "vendor-fields" ["JSON-04"] "Adds members of its own to every object it sends.";
    VendorInformation "vendor-information" ["INFO-01"] "Reports information nobody asked for.";
    VendorWarning "vendor-warning" ["ERR-01", "ERR-03"] "Reports a warning of its own all the time.";
    WarningComesAndGoes "warning-comes-and-goes" ["ERR-01", "STATE-05"] "Reports a warning of its own in every other state.";
    FloatsForIntegers "floats-for-integers" ["JSON-09"] "Writes whole numbers with a fraction of zero.";
    Exponents "exponents" ["JSON-06"] "Writes its coordinates with an exponent.";
    SinglePrecision "single-precision" ["JSON-06", "MAP-02"] "Computes where it is with 32-bit floats.";
    ManyDigits "many-digits" ["JSON-06"] "Writes its coordinates with all the digits it computes.";
    PrettyPrinted "pretty-printed" ["MQTT-02"] "Sends its messages in many lines, indented.";
    TextEscaped "text-escaped" ["JSON-03"] "Escapes letters in its texts that need it not.";
    KeysReordered "keys-reordered" ["JSON-01"] "Sends the members of its messages in reverse order.";
    OptionalOmitted "optional-omitted" ["OPT-03"] "Leaves what it need not say out of its states.";
    OptionalAdded "optional-added" ["OPT-03"] "Fills optional members of its states others leave out.";
    SecondsWhole "seconds-whole" ["HDR-03"] "Gives its timestamps in whole seconds.";
    SecondsFine "seconds-fine" ["HDR-03"] "Gives its timestamps with six digits.";
    DescriptionsEverywhere "descriptions-everywhere" ["STATE-MSG-14"] "Describes every action in its states.";

    // Connection
    HeaderIdRestarts "header-id-restarts" ["HDR-02"] "Counts its messages from 0 again on every connection.";
    OnlineTwice "online-twice" ["CONN-05"] "Says ONLINE twice when it connects.";
    FactsheetAgain "factsheet-again" ["FACT-01"] "Publishes its factsheet with every tenth state.";
    SubscribesWithQosOne "subscribes-with-qos-1" ["MQTT-07"] "Subscribes with QoS 1.";
    SessionKept "session-kept" ["MQTT-03"] "Asks the broker to keep its session.";
    NewestMqtt "newest-mqtt" ["MQTT-01"] "Connects with MQTT 5.";
}

/// The tolerance of that name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Tolerance> {
    TOLERANCES.iter().find(|tolerance| tolerance.name == name)
}

/// A set of tolerances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tolerances(u128);

impl Tolerances {
    /// Whether the vehicle takes this liberty.
    pub(super) fn has(self, tolerance: ToleranceName) -> bool {
        self.0 & (1 << (tolerance as u128)) != 0
    }
}

impl AgvConfig {
    /// Lets the vehicle take a liberty.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn tolerate(&mut self, name: &str) -> Result<(), UnknownTolerance> {
        let position = TOLERANCES.iter().position(|tolerance| tolerance.name == name);
        let tolerance = position.and_then(|at| ALL.get(at)).copied();
        let tolerance = tolerance.ok_or_else(|| UnknownTolerance(name.to_owned()))?;
        self.tolerances.0 |= 1 << (tolerance as u128);
        configure::configure(self, tolerance);
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
        assert!(TOLERANCES.len() <= 128, "they are kept in 128 bits");
    }

    #[test]
    fn a_slow_vehicle_is_slow_at_its_stations_whichever_liberty_came_first() {
        let taken = |names: [&str; 2]| {
            let mut config = AgvConfig::default();
            assert!(names.into_iter().all(|name| config.tolerate(name).is_ok()));
            config.action_durations["pick"]
        };
        let names = ["actions-at-once", "states-coalesced"];
        assert_eq!(taken(names), taken([names[1], names[0]]));
    }

    #[test]
    fn an_unknown_one_is_refused_by_name() {
        let mut config = AgvConfig::default();
        assert_eq!(config.tolerate("no-such"), Err(UnknownTolerance("no-such".to_owned())));
        assert_eq!(config, AgvConfig::default());
        assert_eq!(config.tolerate("newest-mqtt"), Ok(()));
        assert!(config.tolerances.has(ToleranceName::NewestMqtt) && !config.tolerances.has(ToleranceName::SessionKept));
    }
}
