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
    (blind { $($late:ident $late_name:literal [$($late_id:literal),+] $late_does:literal;)* }
     $($variant:ident $name:literal [$($id:literal),+] $does:literal;)+) => {
        /// A tolerance of the reference AGV; see [`TOLERANCES`] for what each does.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the sentence stands in TOLERANCES")]
        pub enum ToleranceName { $($variant,)+ $($late),* }

        /// All tolerances of the reference AGV.
        pub const TOLERANCES: &[Tolerance] = &[$(Tolerance { name: $name, under: &[$($id),+], does: $does }),+];

        /// Liberties of blind rounds that are not all read rightly yet.
        pub const BLIND_TOLERANCES: &[Tolerance] =
            &[$(Tolerance { name: $late_name, under: &[$($late_id),+], does: $late_does }),*];

        const ALL: &[ToleranceName] = &[$(ToleranceName::$variant,)+ $(ToleranceName::$late),*];
    };
}

tolerances! {
    // Of blind rounds: the suites may still accuse or miss something with them.
    blind {
R6LibDownloadQueued "r6-lib-download-queued" ["MAP-17"] "It shows downloadMap INITIALIZING for some seconds before the download starts.";
R6LibThinksBeforeDriving "r6-lib-thinks-before-driving" ["ORD-FLOW-07"] "It plans for two or three seconds after it has accepted an order before it starts to drive.";
R6LibBatteryGoodOrBad "r6-lib-battery-good-or-bad" ["STATE-MSG-15", "STATE-MSG-16"] "It reports a batteryCharge of only 80 or 20.";
R6LibEarlyTraversal "r6-lib-early-traversal" ["NODE-01"] "It reports a node traversed as soon as it enters the deviation range of the node.";
R4NoOrderWarningUntilNextOrder "r4-no-order-warning-until-next-order" ["ORD-CANCEL-19", "ERR-01", "ERR-03"] "It keeps noOrderToCancel in its errors until it accepts a new order.";
R4OutdatedUpdateWarningUntilNextOrder "r4-outdated-update-warning-until-next-order" ["ORD-REJ-12", "ERR-01"] "It keeps orderUpdateError in its errors until it accepts a new order.";
R4SecondCancelEndsWithTheFirst "r4-second-cancel-ends-with-the-first" ["ORD-CANCEL-18", "ASTATE-05"] "It answers a second cancelOrder that comes while the first is RUNNING with RUNNING and lets both finish together.";
R4NonzeroFirstUpdateIdRefused "r4-nonzero-first-update-id-refused" ["ORD-FLOW-06"] "It rejects a new order whose orderUpdateId is not 0.";
R4EnabledUnusedMapNotDeleted "r4-enabled-unused-map-not-deleted" ["MAP-29", "MAP-32"] "It refuses to delete a map that is enabled though neither its position nor its order needs it.";
R4BrakesLongOnPause "r4-brakes-long-on-pause" ["ACT-12", "ACT-13"] "It needs two seconds to come to a stop after startPause and reports it RUNNING meanwhile.";
R4OptionalStateFieldsLeftOut "r4-optional-state-fields-left-out" ["STATE-MSG-01", "STATE-MSG-06"] "It leaves out the optional fields velocity, loads, information and newBaseRequest in all states.";
R4InformationInEveryState "r4-information-in-every-state" ["STATE-11", "INFO-01"] "It puts an information entry with changing values into every state.";
R4LimitsOfZeroInFactsheet "r4-limits-of-zero-in-factsheet" ["FACT-05", "FACT-11"] "It states 0 for all array and string limits in the factsheet because it has none.";
R4StateEverySecond "r4-state-every-second" ["STATE-02", "STATE-11"] "It sends a state every second even when nothing happens.";
R3StatesRetained "r3-states-retained" ["MQTT-07", "STATE-01"] "It publishes its states with the retain flag.";
R3HeaderIdWraps "r3-header-id-wraps" ["HDR-02"] "It starts its headerIds a little below 4294967295 and goes on with 0 behind it.";
R3RefusalInTwoErrors "r3-refusal-in-two-errors" ["ORD-REJ-17", "ERR-01"] "It adds a warning orderRejected with the same references to every warning about a refused order.";
R3PositionRounded "r3-position-rounded" ["STATE-MSG-05", "MAP-02"] "It rounds its position to whole centimetres and its orientation to milliradians.";
R3VelocityTrembles "r3-velocity-trembles" ["STATE-MSG-08", "STATE-MSG-05"] "It reports velocities of about a millimetre per second at standstill.";
R3MapsDescribed "r3-maps-described" ["MAP-12"] "It gives every entry of maps a mapDescription.";
R3NewBaseOnlyWhenWanted "r3-new-base-only-when-wanted" ["STATE-16"] "It sends newBaseRequest only when it is true.";
R3ReferencesNameAllNodes "r3-references-name-all-nodes" ["BP-02", "ORD-REJ-07"] "It references every nodeId of a refused order, so that a referenceKey occurs several times.";
R3ResultsEmpty "r3-results-empty" ["STATE-MSG-12"] "It gives every action state without a result an empty resultDescription.";
R3OptionalFlagOmitted "r3-optional-flag-omitted" ["FACT-07"] "It leaves isOptional out of the factsheet for parameters that are not optional.";
R3DrivesOnLate "r3-drives-on-late" ["BLOCK-07"] "It stands for half a second after a blocking action has ended before it drives on.";
R3ReconnectsAtOnce "r3-reconnects-at-once" ["MQTT-10"] "It connects again after 50 milliseconds when the connection is broken.";
R3LoadsIdentified "r3-loads-identified" ["STATE-MSG-07"] "It reads the loadId of a picked load itself where the order does not name one.";
R3NetworkTold "r3-network-told" ["FACT-10"] "It states its network data in the factsheet.";
R3ClockAhead "r3-clock-ahead" ["HDR-03"] "Its clock is one and a half seconds ahead.";
R3DuplicateNotedInInformation "r3-duplicate-noted-in-information" ["ORD-REJ-13", "INFO-01"] "It mentions an order that came twice in an information entry, without an error.";
R3KeepsBelowMaxSpeed "r3-keeps-below-max-speed" ["ORD-MSG-20"] "It drives at four fifths of the maxSpeed of an edge.";
R3CancelInSteps "r3-cancel-in-steps" ["ORD-CANCEL-06", "STATE-11"] "It reports cancelOrder RUNNING with all actions ended in a state of its own before it reports FINISHED.";
R3NodeActionsInNextState "r3-node-actions-in-next-state" ["NODE-04"] "It reports the traversal of a node with actions while they are still WAITING, stands there for a moment, and begins them right after that state.";
R3ActionErrorsBrief "r3-action-errors-brief" ["IACT-06", "ACT-30", "MAP-19"] "It shows the error about a failed action for one or two states only.";
R3ActionErrorsUntilNewOrder "r3-action-errors-until-new-order" ["IACT-06", "ACT-30", "ERR-01"] "It shows the error about a failed action until a new order is accepted.";
R3BatchReversed "r3-batch-reversed" ["IACT-07"] "It performs the actions of one instantActions message from the last to the first.";
R3CulpritAsJsonPath "r3-culprit-as-json-path" ["ORD-REJ-07", "BP-02"] "It names the wrong field of a refused order as a JSONPath under the key jsonPath.";
R2UnreadableInstantIgnored "r2-unreadable-instant-ignored" ["IACT-03"] "The vehicle ignores an instantActions message that is not JSON or has no array of actions, without an error.";
R2ErrorsInOwnLanguage "r2-errors-in-own-language" ["JSON-03", "ERR-02"] "The errorDescription of every error is in another language, with letters and signs beyond ASCII.";
R2ErrorHintsGiven "r2-error-hints-given" ["ERR-02"] "Every error has an errorHint.";
R2VendorReferences "r2-vendor-references" ["BP-02", "ERR-05"] "Every error begins its errorReferences with a key of the vendor.";
R2InformationComesAndGoes "r2-information-comes-and-goes" ["INFO-01"] "An information entry of level DEBUG is in every other state.";
R2LoadsMinimal "r2-loads-minimal" ["STATE-MSG-07"] "The loads name only loadId and loadType; the only load position, the dimensions and the weight are left out.";
R2PositionMinimal "r2-position-minimal" ["STATE-MSG-05"] "agvPosition holds only what it must hold, no localizationScore.";
R2VisualizationWithoutVelocity "r2-visualization-without-velocity" ["VIS-01"] "The visualization tells the position but no velocity.";
R2KeepAliveTen "r2-keep-alive-ten" ["CONN-04"] "The keep-alive is 10 s.";
R2OnlineAgain "r2-online-again" ["CONN-05", "CONN-10"] "The vehicle publishes ONLINE again with every tenth state.";
R2FirstStateLate "r2-first-state-late" ["CONN-05", "STATE-02"] "The first state of a connection comes more than a second after ONLINE.";
R2FactsheetBeforeOnline "r2-factsheet-before-online" ["CONN-05", "TOPIC-11"] "On connecting the vehicle publishes its factsheet before it says ONLINE.";
R2FactsheetAfterState "r2-factsheet-after-state" ["TOPIC-11", "FACT-01"] "On connecting the vehicle publishes its factsheet after the first state.";
R2SubscribesWithWildcard "r2-subscribes-with-wildcard" ["TOPIC-10"] "The vehicle subscribes with one topic filter that ends in a wildcard.";
R2ClientIdChanges "r2-client-id-changes" ["MQTT-01", "CONN-11"] "The vehicle takes another MQTT client identifier at every connection.";
R2TurnsTheLongWay "r2-turns-the-long-way" ["ORD-MSG-10", "ORD-MSG-24"] "The vehicle turns to an orientation the long way round.";
R2OwnOrientationAtEnd "r2-own-orientation-at-end" ["ORD-MSG-10"] "On the last node of its base, where the order asks for no theta, the vehicle turns to an orientation of its own before it reports the node.";
R2BacksUp "r2-backs-up" ["MAP-03", "ORD-MSG-22"] "Where an edge asks for no orientation the vehicle drives backwards to a node that lies behind it instead of turning.";
R2AdoptsBeforeDriving "r2-adopts-before-driving" ["STATE-11", "STATE-03"] "The vehicle reports the adoption of an order or update in a state of its own, and its start in the next one at the same time.";
R2PauseTakesTime "r2-pause-takes-time" ["ACT-12", "ACT-15", "ACT-41"] "startPause and stopPause are RUNNING for a moment, in which the vehicle goes on as before, and then FINISHED.";
R2InitPositionTakesTime "r2-init-position-takes-time" ["ACT-23", "ACT-41"] "initPosition is RUNNING for a moment before the pose is taken over.";
R2MapActionsTakeTime "r2-map-actions-take-time" ["MAP-24", "MAP-29", "ACT-41"] "enableMap and deleteMap are RUNNING for a moment before the maps change.";
R2FailuresDescribed "r2-failures-described" ["STATE-MSG-12"] "Failed actions have a resultDescription that says why, beside the error.";
R2LogNameInInformation "r2-log-name-in-information" ["ACT-27", "INFO-01"] "The name of the last log is in the information of the states instead of a resultDescription, which the factsheet does not announce either.";
R2NodePositionsFromLayout "r2-node-positions-from-layout" ["STATE-MSG-13"] "The nodeStates give a nodePosition also where the order had none, from the layout of the vehicle.";
        R1IdleCancelErrorBrief "r1-idle-cancel-error-brief" ["ORD-CANCEL-19", "STATE-05"] "It reports noOrderToCancel in one state and takes it back at once.";
        R1OutdatedErrorBrief "r1-outdated-error-brief" ["ORD-REJ-12", "STATE-05"] "It reports an outdated update in one state and takes the warning back at once.";
        R1OwnErrorNames "r1-own-error-names" ["ORD-FLOW-01", "MAP-08", "ORD-REJ-15"] "It has names of its own for errors that the standard does not name.";
        R1CancelTakesTime "r1-cancel-takes-time" ["ORD-CANCEL-07", "ACT-41"] "A cancelOrder is RUNNING for some tenths of a second also if it has nothing to wait for.";
        R1HorizonActionsFail "r1-horizon-actions-fail" ["ORD-UPD-10", "STATE-MSG-10"] "It keeps the actions of a horizon that was deleted in its action states, as FAILED.";
        R1AlteredJointRejected "r1-altered-joint-rejected" ["ORD-UPD-07"] "It rejects an update whose stitching node has an action that it did not have before.";
        R1SetsOutLate "r1-sets-out-late" ["ORD-FLOW-07", "ORD-FLOW-06"] "It stands for most of a second, with the first node listed, before it begins a new order.";
        R1CutEdgeActionsFail "r1-cut-edge-actions-fail" ["NODE-05"] "It reports an edge action as FAILED that it ends because it leaves the edge.";
        R1StopsShortOfNode "r1-stops-short-of-node" ["ORD-MSG-13", "NODE-01"] "It counts a node that allows a deviation as traversed eight centimetres before it, and stands there.";
        R1SemiautomaticAtFullSpeed "r1-semiautomatic-at-full-speed" ["MODE-03"] "It drives as fast in SEMIAUTOMATIC as in AUTOMATIC.";
        R1NeverPrepares "r1-never-prepares" ["ASTATE-03", "ACT-41"] "It reports no action as INITIALIZING when it needs no preparation.";
        R1MapDelistedNext "r1-map-delisted-next" ["MAP-29"] "It removes the entry of a deleted map in the state after the one that reports the deleteMap FINISHED.";
        R1MapListedNext "r1-map-listed-next" ["MAP-20", "MAP-21"] "It lists a downloaded map in the state after the one that reports the downloadMap FINISHED.";
        R1DownloadRunsAtOnce "r1-download-runs-at-once" ["MAP-17"] "It reports a downloadMap RUNNING as soon as it asks for the file, without INITIALIZING.";
        R1ActionsRunOnInPause "r1-actions-run-on-in-pause" ["ACT-15", "ACT-18"] "Running actions go on while it is paused by startPause.";
        R1InitPositionResetsSequence "r1-init-position-resets-sequence" ["ACT-24", "STATE-MSG-04"] "An initPosition sets its lastNodeSequenceId to 0.";
        R1OrderIdSurvivesPowerCycle "r1-order-id-survives-power-cycle" ["STATE-MSG-02"] "After it was switched off and on it still reports the orderId and orderUpdateId of its last order.";
        R1HeaderIdStartsHigh "r1-header-id-starts-high" ["HDR-02"] "Its headerIds begin at 70000 on every topic.";
        R1FactsheetOnRequestOnly "r1-factsheet-on-request-only" ["FACT-01", "ACT-40"] "It publishes its factsheet when it is asked for, and not when it connects.";
        R1LastStateBeforeOffline "r1-last-state-before-offline" ["CONN-07", "STATE-02"] "It sends a last state right before OFFLINE.";
        R1RefusedInstantWithoutError "r1-refused-instant-without-error" ["IACT-06"] "It reports an instant action that it cannot perform FAILED without an error.";
        R1PathsReported "r1-paths-reported" ["STATE-14", "STATE-MSG-13"] "It reports the trajectory it drives on in its edge states although it does not plan its path itself.";
        R1FactsheetListsReversed "r1-factsheet-lists-reversed" ["FACT-06", "FACT-07"] "Its factsheet lists its actions and optional parameters in reverse.";
        R1PositionTrembles "r1-position-trembles" ["STATE-MSG-05", "STATE-MSG-08"] "The position it reports varies by some millimetres, also when it stands.";
        R1ThetaMinusPi "r1-theta-minus-pi" ["MAP-02", "STATE-MSG-05"] "It reports an orientation of half a turn as minus pi.";
        R1BatteryDrains "r1-battery-drains" ["STATE-MSG-15"] "Its battery charge falls a little with every state.";
        R1ActionStatesReversed "r1-action-states-reversed" ["STATE-MSG-09"] "It lists its action states with the newest first.";
        R1ErrorsNewestFirst "r1-errors-newest-first" ["ERR-01"] "It lists its errors with the newest first.";
        R1ReferencesReversed "r1-references-reversed" ["ERR-05", "BP-02"] "It lists what is wrong before the message in its error references.";
        R1MapsReversed "r1-maps-reversed" ["MAP-12"] "It lists its maps with the newest first.";
        R1ErrorsUndescribed "r1-errors-undescribed" ["ERR-02"] "Its errors have no errorDescription.";
        R1EmptyReferencesOmitted "r1-empty-references-omitted" ["ERR-05", "ERR-02"] "Errors without references have no errorReferences.";
        R1ActionTypeOmitted "r1-action-type-omitted" ["STATE-MSG-14"] "Its action states have no actionType.";
        R1ResultsEverywhere "r1-results-everywhere" ["STATE-MSG-12"] "Every finished action has a resultDescription.";
        R1NodePositionOmitted "r1-node-position-omitted" ["STATE-MSG-13"] "It does not repeat the nodePosition of the order in its node states.";
        R1RouteDescribed "r1-route-described" ["STATE-MSG-13"] "Its node and edge states have descriptions.";
        R1BatteryMinimal "r1-battery-minimal" ["STATE-MSG-15"] "Its batteryState consists of batteryCharge and charging.";
        R1InformationOmitted "r1-information-omitted" ["INFO-01", "STATE-MSG-01"] "It sends no information at all.";
        R1NewBaseNeverRequested "r1-new-base-never-requested" ["STATE-16"] "It does not send newBaseRequest.";
        R1LoadsUndetermined "r1-loads-undetermined" ["STATE-MSG-06"] "It cannot determine its load and never sends loads.";
    }

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

    LittleFits "little-fits" ["FACT-12"] "Takes ids of 14 characters, two actions at a place and in a message, and says so in its factsheet.";
    OrdersSpaced "orders-spaced" ["FACT-13"] "States a minOrderInterval of a quarter of a second, and overlooks an order that comes earlier.";
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
    AnglesRounded "angles-rounded" ["JSON-06", "MAP-02"] "Writes its angles with four digits behind the point.";
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
    TOLERANCES
        .iter()
        .chain(BLIND_TOLERANCES)
        .find(|tolerance| tolerance.name == name)
}

/// A set of tolerances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tolerances([u128; 2]);

impl Tolerances {
    /// Whether the vehicle takes this liberty.
    pub(super) fn has(self, tolerance: ToleranceName) -> bool {
        let index = tolerance as usize;
        self.0[index / 128] & (1 << (index % 128)) != 0
    }
}

impl AgvConfig {
    /// Lets the vehicle take a liberty.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn tolerate(&mut self, name: &str) -> Result<(), UnknownTolerance> {
        let mut all = TOLERANCES.iter().chain(BLIND_TOLERANCES);
        let position = all.position(|tolerance| tolerance.name == name);
        let tolerance = position.and_then(|at| ALL.get(at)).copied();
        let tolerance = tolerance.ok_or_else(|| UnknownTolerance(name.to_owned()))?;
        let index = tolerance as usize;
        self.tolerances.0[index / 128] |= 1 << (index % 128);
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
        assert!(ALL.len() <= 256, "they are kept in 256 bits");
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
