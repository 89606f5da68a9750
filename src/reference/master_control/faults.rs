//! The registry of defects the reference master control can be given.
//!
//! Each is a mistake a real fleet manager could make, and a small deviation at one point of decision, found by
//! searching for its [`FaultName`]. `breaks` names first the requirement the fault is about.

use crate::reference::Fault;

macro_rules! faults {
    (blind { $($late:ident $late_name:literal [$($late_id:literal),+] $late_wrong:literal;)* }
     $($variant:ident $name:literal [$($id:literal),+] $wrong:literal;)+) => {
        /// A fault of the reference master control; see [`FAULTS`] for what each does.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the sentence stands in FAULTS")]
        pub enum FaultName { $($variant,)+ $($late),* }

        /// All faults of the reference master control.
        pub const FAULTS: &[Fault] = &[$(Fault { name: $name, breaks: &[$($id),+], wrong: $wrong }),+];

        /// Faults of blind rounds whose holes are not all closed yet: the suites need not find them.
        pub const BLIND_FAULTS: &[Fault] =
            &[$(Fault { name: $late_name, breaks: &[$($late_id),+], wrong: $late_wrong }),*];
    };
}

with_blind_faults! { faults!
    // Transport and topics
    OldMqtt "old-mqtt" ["MQTT-01"] "Connects with MQTT 3.1.";
    NulAfterJson "nul-after-json" ["MQTT-02", "JSON-10"] "Sends the terminating zero byte of its string with every message.";
    OrderQosOne "order-qos-1" ["MQTT-06"] "Publishes orders with QoS 1.";
    OrdersRetained "orders-retained" ["MQTT-06"] "Publishes orders with RETAIN, so that a vehicle that is new to the broker drives off.";
    InstantActionsRetained "instant-actions-retained" ["MQTT-06"] "Publishes instant actions with RETAIN.";
    InstantActionsQosTwo "instant-actions-qos-2" ["MQTT-06"] "Publishes instant actions with QoS 2.";
    NeverReconnects "never-reconnects" ["MQTT-10"] "Does not connect again after a broken link.";
    NotSubscribedAgain "not-subscribed-again" ["TOPIC-14", "MQTT-10", "MODE-04", "ORD-03", "CONN-12"] "Does not subscribe again when it reconnects.";
    LostOrderNotResent "lost-order-not-resent" ["MQTT-10", "ORD-REJ-18"] "Waits forever for a vehicle that never got its order.";
    FleetOfOne "fleet-of-one" ["MQTT-11"] "Serves the first vehicle only.";
    FirstVehicleExtended "first-vehicle-extended-only" ["MQTT-11", "ORD-UPD-02"] "Extends the base of the first vehicle of the fleet only.";
    TopicUnderscore "topic-underscore" ["TOPIC-01", "TOPIC-13"] "Sends instant actions on a topic spelled with an underscore.";
    TopicWithoutVersion "topic-without-version" ["TOPIC-13", "TOPIC-02"] "Leaves the level of the major version out of the topic of orders.";
    OtherMajorVersion "other-major-version" ["TOPIC-13", "TOPIC-03"] "Sends orders below another major version.";
    OtherSerialNumber "other-serial-number" ["HDR-05", "TOPIC-04"] "Names another serial number in the header than in the topic.";
    SerialNumberWithSpace "serial-number-with-space" ["TOPIC-05", "HDR-05"] "Writes the serial number with a space in the header.";
    ManufacturerWithSlash "manufacturer-with-slash" ["TOPIC-06", "HDR-05"] "Writes the manufacturer with a slash in the header.";
    DollarInTopic "dollar-in-topic" ["TOPIC-13", "TOPIC-07"] "Sends orders on a topic with a dollar sign in it.";
    InstantActionsAsOrders "instant-actions-as-orders" ["TOPIC-13", "IACT-01"] "Sends instant actions on the order topic.";
    PauseForAll "pause-for-all" ["TOPIC-13"] "Pauses every vehicle of the fleet, and lets all go on, when that is asked for one of them.";
    EmptyLastNodeShunned "empty-last-node-shunned" ["TOPIC-13"] "Serves a vehicle no more that once knew no last node.";
    ForeignActionShunned "foreign-action-shunned" ["TOPIC-13"] "Serves a vehicle no more that has listed an action nobody sent.";
    NamelessActionShunned "nameless-action-shunned" ["TOPIC-13"] "Serves a vehicle no more that has listed an action without its type.";
    PauseShunned "pause-shunned" ["TOPIC-13"] "Serves a vehicle no more that was paused for more than one state.";
    NonAsciiShunned "non-ascii-shunned" ["TOPIC-13"] "Serves a vehicle no more that has sent a letter beyond ASCII.";
    ExponentShunned "exponent-shunned" ["TOPIC-13"] "Serves a vehicle no more that has written a number with an exponent.";
    GapShunned "gap-shunned" ["TOPIC-13"] "Serves a vehicle no more that has left a headerId out.";
    EmptyPayloadShunned "empty-payload-shunned" ["TOPIC-13"] "Serves a vehicle no more after a message of no bytes.";
    MinimalFactsheetShunned "minimal-factsheet-shunned" ["TOPIC-13"] "Serves a vehicle no more whose factsheet has left optional members out.";
    WrongTypeShunned "wrong-type-shunned" ["TOPIC-13"] "Serves a vehicle no more that has written a number as text.";
    ZeroIsALimit "zero-is-a-limit" ["TOPIC-13"] "Takes a limit of 0 in a factsheet for one.";
    OrdersNotSent "orders-not-sent" ["TOPIC-13"] "Plans its orders and never sends them.";
    StateNotSubscribed "state-not-subscribed" ["TOPIC-14"] "Does not subscribe to the state.";
    ConnectionNotSubscribed "connection-not-subscribed" ["TOPIC-14", "CONN-12"] "Does not subscribe to the connection topic.";
    ConnectionQosZero "connection-with-qos-0" ["TOPIC-14"] "Subscribes to the connection topic with QoS 0.";
    DiesOfNull "dies-of-null" ["TOPIC-14"] "Ends when a member of a state is null.";
    DiesOfEmptyLastNode "dies-of-empty-last-node" ["TOPIC-14"] "Ends when a vehicle knows no last node.";
    FactsheetNotSubscribed "factsheet-not-subscribed" ["TOPIC-14"] "Does not subscribe to the factsheet.";
    PublishesConnection "publishes-connection" ["TOPIC-15"] "Sets the connection of a vehicle it has lost to OFFLINE by itself.";

    // Header and JSON
    VersionMissing "version-missing" ["HDR-01", "HDR-04"] "Leaves the version out of its orders.";
    TimestampMissing "timestamp-missing" ["HDR-01", "HDR-03"] "Leaves the timestamp out of its instant actions.";
    HeaderNested "header-nested" ["HDR-01"] "Puts the header into an object of its own.";
    HeaderIdConstant "header-id-constant" ["HDR-02"] "Never raises the headerId.";
    HeaderIdShared "header-id-shared" ["HDR-02"] "Counts the headerId over all topics together.";
    HeaderIdNegative "header-id-negative" ["JSON-09", "HDR-02"] "Counts the headerId as a signed number, from below zero.";
    TimestampLocal "timestamp-local" ["HDR-03"] "Gives timestamps in local time with an offset.";
    TimestampWithoutZone "timestamp-without-zone" ["HDR-03"] "Leaves the Z out of its timestamps.";
    TimestampUnix "timestamp-unix" ["HDR-03", "JSON-06"] "Gives timestamps as seconds since 1970.";
    VersionShort "version-short" ["HDR-04"] "Gives the version without its last part.";
    OwnNameInHeader "own-name-in-header" ["HDR-05"] "Names itself in the header instead of the vehicle.";
    SnakeCaseKeys "snake-case-keys" ["JSON-01"] "Writes sequence_id instead of sequenceId.";
    LowerCaseEnums "lower-case-enums" ["JSON-02", "ORD-MSG-16"] "Writes blocking types in small letters.";
    NotUtf8 "not-utf8" ["JSON-03", "MQTT-02"] "Writes descriptions in Latin-1.";
    OrderIdWithSpace "order-id-with-space" ["JSON-04"] "Writes orderIds with a space.";
    NumbersAsText "numbers-as-text" ["JSON-06", "ORD-MSG-05"] "Writes coordinates as strings.";
    BooleansAsWords "booleans-as-words" ["JSON-07", "ORD-MSG-05"] "Writes released as a word.";
    NanCoordinate "nan-coordinate" ["JSON-08", "MQTT-02"] "Writes NaN where it does not know an orientation.";
    SequenceIdFraction "sequence-id-fraction" ["JSON-09", "ORD-UPD-11", "ORD-MSG-18"] "Numbers edges half-way between their nodes.";
    NullForNothing "null-for-nothing" ["JSON-10", "JSON-06"] "Writes null where an edge has no actions.";

    // The order message
    UpdateIdMissing "order-update-id-missing" ["ORD-MSG-01"] "Leaves orderUpdateId out of its first message.";
    OrderIdReused "order-id-reused" ["ORD-MSG-02"] "Gives the same orderId to all orders of a vehicle.";
    ZoneSetEmpty "zone-set-empty" ["ORD-MSG-03", "OPT-03"] "Sends an empty zoneSetId.";
    ReleasedMissing "released-missing" ["ORD-MSG-05", "JSON-10"] "Leaves released out of the nodes of the horizon.";
    MapIdMissing "map-id-missing" ["ORD-MSG-05", "JSON-10"] "Leaves mapId out of nodePosition.";
    EmptyArraysOmitted "empty-arrays-omitted" ["ORD-MSG-06", "JSON-10"] "Leaves out arrays that have no element.";
    OneIdTwoPlaces "one-id-two-places" ["ORD-MSG-07"] "Gives the nodeId of a layout node to the place where a vehicle stands between nodes.";
    PositionMissing "node-position-missing" ["OPT-05", "ORD-MSG-08"] "Leaves nodePosition out.";
    ThetaInDegrees "theta-in-degrees" ["ORD-MSG-09", "MAP-02"] "Gives orientations in degrees.";
    DeviationNegative "deviation-negative" ["ORD-MSG-09", "JSON-09"] "Uses -1 as allowedDeviationXY where none is wanted.";
    MirroredMap "mirrored-map" ["MAP-01", "ORD-MSG-30"] "Lets the y axis point the other way, as on a screen.";
    Millimetres "millimetres" ["MAP-02", "MAP-01", "ORD-MSG-30"] "Gives coordinates in millimetres.";
    BlockingTypeMissing "blocking-type-missing" ["ORD-MSG-15"] "Leaves blockingType out of its actions.";
    ActionIdMissing "action-id-missing" ["ORD-MSG-15", "IACT-01"] "Leaves actionId out of instant actions.";
    BlockingTypeUnknown "blocking-type-unknown" ["ORD-MSG-16", "JSON-02"] "Uses a blocking type the protocol does not have.";
    ActionIdsRepeat "action-ids-repeat" ["ORD-MSG-17"] "Numbers the actions from 1 again in every order.";
    EdgeWithoutEnds "edge-without-ends" ["ORD-MSG-18"] "Leaves startNodeId and endNodeId out of edges.";
    EdgeIdMissing "edge-id-missing" ["ORD-MSG-18"] "Leaves edgeId out.";
    EdgeEndsSwapped "edge-ends-swapped" ["ORD-MSG-19"] "Swaps the start node and end node of edges.";
    EdgeEndsOfOrder "edge-ends-of-order" ["ORD-MSG-19"] "Names the first and last node of the order in every edge.";
    EdgeMissing "edge-missing" ["ORD-02", "ORD-MSG-19"] "Forgets the last edge.";
    NoNodes "no-nodes" ["ORD-02"] "Sends an order without nodes to call off an order that is not begun yet.";
    StartsElsewhere "starts-elsewhere" ["ORD-03"] "Begins new orders at the second node of the way.";
    EdgeReleasedAlone "edge-released-alone" ["ORD-08"] "Releases the edge that leads into the horizon.";
    ReleasedBehindHorizon "released-behind-horizon" ["ORD-09", "ORD-08"] "Releases the last node of the horizon.";
    BlockedEdgeUsed "blocked-edge-used" ["ORD-12"] "Does not look at edges the vehicle may not use.";
    BlockForgottenOnReturn "block-forgotten-on-return" ["ORD-12"] "Forgets which edges a vehicle may not use when that vehicle comes back.";
    TrajectoryUnasked "unsupported-trajectory" ["OPT-03"] "Sends a trajectory to every vehicle.";
    RequiredOmitted "required-parameter-omitted" ["OPT-05"] "Does not send what a vehicle marks as required.";
    DescriptionsUnasked "unsupported-description" ["OPT-03"] "Sends descriptions to vehicles that do not support them.";

    // Curves
    KnotsMissing "knots-missing" ["ORD-MSG-28"] "Sends trajectories without knotVector.";
    KnotsShort "knots-short" ["ORD-MSG-29"] "Sends one knot too few.";
    KnotsBeyondOne "knots-beyond-one" ["ORD-MSG-29"] "Counts the knots in whole numbers.";
    CurveBesideNodes "curve-beside-nodes" ["ORD-MSG-30"] "Sends trajectories that lie three metres beside their nodes.";
    CorridorWithoutTrajectory "corridor-without-trajectory" ["CORR-02"] "Sends a corridor to vehicles without a trajectory.";
    CorridorApart "corridor-apart" ["CORR-04", "ORD-MSG-30"] "Lets every corridor begin beside the end of the one before.";
    CorridorZero "corridor-zero" ["CORR-05"] "Sends a corridor of no width where none is wanted.";
    CorridorNegative "corridor-negative" ["CORR-09"] "Sends corridors with a negative width to the right.";
    CorridorOneSided "corridor-one-sided" ["CORR-09"] "Leaves the left width out of corridors.";
    CorridorPointUnknown "corridor-point-unknown" ["CORR-09", "JSON-02"] "Names the reference point of corridors with an underscore.";

    // Updates
    BaseExtendedLate "base-extended-late" ["ORD-UPD-02"] "Extends the base when the vehicle has halted at its end.";
    NewBaseRequestIgnored "new-base-request-ignored" ["STATE-17", "ORD-UPD-02"] "Does not look at newBaseRequest.";
    BaseSentAgain "base-sent-again" ["ORD-UPD-03", "ORD-UPD-05"] "Sends the whole order with every update.";
    BaseReplaced "base-replaced" ["ORD-UPD-03", "ORD-CANCEL-01"] "Changes the base by an update when the destination changes.";
    OrderIdPerUpdate "order-id-per-update" ["ORD-UPD-04"] "Gives every update an orderId of its own.";
    UpdateIdKept "update-id-kept" ["ORD-UPD-04"] "Does not raise orderUpdateId.";
    SecondUpdateRepeats "second-update-repeats" ["ORD-UPD-04"] "Gives every update the number of the first one.";
    UpdateIdsRestartOnReturn "update-ids-restart-on-return" ["ORD-UPD-04"] "Counts orderUpdateId from 1 again when the vehicle comes back with its order.";
    UpdateIdFalls "update-id-falls" ["ORD-UPD-04"] "Counts orderUpdateId down.";
    StitchingMissing "stitching-missing" ["ORD-UPD-05"] "Begins updates with the first new node.";
    RefusedUpdateExtended "refused-update-extended" ["ORD-UPD-05"] "Goes on from the end of an update that was refused.";
    StitchingMoved "stitching-moved" ["ORD-UPD-06"] "Rounds the position of the stitching node to decimetres, and shifts it.";
    StitchingActionAdded "stitching-action-added" ["ORD-UPD-06"] "Adds an action to the stitching node.";
    SequenceFromOne "sequence-from-one" ["ORD-UPD-11"] "Numbers nodes and edges from 1.";
    SequencePerKind "sequence-per-kind" ["ORD-UPD-11"] "Numbers nodes and edges separately.";
    SequenceRestarts "sequence-restarts" ["ORD-UPD-12", "ORD-UPD-05"] "Numbers nodes and edges from 0 again in every update.";
    ResentChanged "resent-changed" ["ORD-REJ-18", "ORD-UPD-04"] "Plans anew before it sends an order again under the same orderUpdateId.";
    RefusedOrderRepeated "refused-order-repeated" ["ORD-REJ-18"] "Sends an order that was refused again and again, each time a little different.";

    // Cancelling
    OrderInsteadOfCancel "order-instead-of-cancel" ["ORD-CANCEL-01"] "Sends a new order without calling the old one off.";
    UpdatedWhileCancelled "updated-while-cancelled" ["ORD-CANCEL-01"] "Extends the base of an order it is calling off.";
    CancelEndsWithRoute "cancel-ends-with-route" ["ORD-CANCEL-01"] "Takes empty nodeStates for the end of cancelOrder.";
    ActionNotAwaited "action-not-awaited" ["ORD-CANCEL-01"] "Sends the next order while an action of the last one still runs.";
    CancelNotAwaited "cancel-not-awaited" ["ORD-CANCEL-01"] "Sends the new order right behind cancelOrder.";
    CancelForgottenOnReturn "cancel-forgotten-on-return" ["ORD-CANCEL-01"] "Forgets that it has called an order off when the vehicle comes back, and goes on with it.";
    ReplacedAtWork "replaced-at-work" ["ORD-CANCEL-01"] "Sends the next order without cancelOrder while the vehicle stands and an action of the old one runs.";
    NextOrderFromOldStart "next-order-from-old-start" ["ORD-CANCEL-14", "ORD-03"] "Begins the order behind a cancelled one where that had begun.";
    NextOrderAhead "next-order-ahead" ["ORD-CANCEL-17", "ORD-03"] "Begins the order behind a cancelled one at the node the vehicle has not reached.";

    // Actions
    FailedActionRepeated "failed-action-repeated" ["ORD-MSG-17"] "Tries an action that has failed again under its old actionId.";
    StationTypeRenamed "station-type-renamed" ["ACT-06", "ACT-31"] "Gives the station type of pick and drop under a key of its own.";
    VendorActionRenamed "vendor-action-renamed" ["ACT-07", "FACT-15"] "Writes actions of the manufacturer with a capital letter.";
    PickAtOnce "pick-at-once" ["ACT-08", "FACT-15"] "Sends pick as an instant action.";
    CancelOnNode "pause-on-node" ["ACT-08", "FACT-15"] "Sends startPause as an action of a node.";
    LastNodeMissing "last-node-missing" ["ACT-31"] "Sends initPosition without lastNodeId.";
    LoadTypeMissing "load-type-missing" ["ACT-31", "FACT-15"] "Sends pick without loadType.";
    PoseAsText "pose-as-text" ["ACT-31", "BP-05"] "Sends the coordinates of initPosition as strings.";
    DeviceMissing "lhd-missing" ["ACT-32"] "Does not say which load handling device picks.";
    DeviceByHabit "lhd-by-habit" ["ACT-32"] "Calls the first load handling device LHD1, whatever the factsheet says.";
    DeviceUnknown "lhd-unknown" ["ACT-32"] "Counts load handling devices instead of naming them.";
    TriggerUnsupervised "trigger-unsupervised" ["ACT-39"] "Waits for a trigger without end.";
    ParametersAsObject "parameters-as-object" ["BP-04"] "Writes the parameters of an action as one object.";
    ParameterNull "parameter-null" ["BP-05"] "Sends a parameter without value.";
    ParameterWithoutKey "parameter-without-key" ["BP-05", "BP-04"] "Calls the key of a parameter its name.";
    ActionsRenamed "actions-renamed" ["IACT-01"] "Calls the array of instant actions instantActions.";
    PositionDuringOrder "position-during-order" ["IACT-02"] "Sets the position of a vehicle that drives an order.";
    ScopeIgnored "scope-ignored" ["FACT-15"] "Does not look for the scope of an action in the factsheet.";
    RequiredKeyMissing "required-key-missing" ["FACT-15"] "Sends actions of the manufacturer without their parameters.";
    BlockingTypeUnlisted "blocking-type-unlisted" ["FACT-15"] "Does not look for blocking types in the factsheet.";

    // Limits
    ArrayLimitIgnored "array-limit-ignored" ["FACT-12"] "Sends more nodes than the vehicle takes.";
    NodeActionsIgnored "node-actions-limit-ignored" ["FACT-12"] "Gives a node more actions than the vehicle takes.";
    ParametersIgnored "parameter-limit-ignored" ["FACT-12"] "Gives an action more parameters than the vehicle takes.";
    InstantActionsIgnored "instant-actions-limit-ignored" ["FACT-12"] "Sends more instant actions at once than the vehicle takes.";
    NodeStatesIgnored "node-states-limit-ignored" ["FACT-12"] "Sends orders with more nodes than the vehicle can list in its states.";
    MessageLimitIgnored "message-limit-ignored" ["FACT-12"] "Sends longer messages than the vehicle takes.";
    IdLimitIgnored "id-limit-ignored" ["FACT-12"] "Sends longer ids than the vehicle takes.";
    NumericalIdsIgnored "numerical-ids-ignored" ["FACT-12"] "Sends ids with letters to a vehicle that takes digits only.";
    OrderRepeatedForEver "order-repeated-for-ever" ["FACT-13"] "Sends an order to a vehicle that wants time between orders hundreds of times in every second, for ever.";
    OrderIntervalIgnored "order-interval-ignored" ["FACT-13"] "Does not keep the interval between orders.";
    ResentTooSoon "resent-too-soon" ["FACT-13"] "Sends a lost order again without regard to minOrderInterval.";

    // Maps
    MapNotEnabled "map-not-enabled" ["MAP-09"] "Sends orders on maps that are not enabled.";
    MapEnabledBlindly "map-enabled-blindly" ["MAP-09"] "Takes a map for enabled once it has sent enableMap.";
    MapNotPreloaded "map-not-preloaded" ["MAP-10"] "Rolls a map out when an order needs it.";
    DownloadWithoutLink "download-without-link" ["MAP-16", "ACT-31"] "Sends downloadMap without mapDownloadLink.";
    DownloadWithoutId "download-without-id" ["MAP-16", "ACT-31"] "Sends downloadMap without mapId.";
    DownloadWithoutVersion "download-without-version" ["FACT-15", "MAP-16"] "Sends downloadMap without mapVersion.";
    NoPositionOnNewMap "no-position-on-new-map" ["MAP-27"] "Does not set the position of a vehicle on a new map.";
    DownloadRepeated "download-repeated" ["MAP-28"] "Repeats a download that was refused as a duplicate without deleting the map.";

    // Modes and what must not matter
    OrdersInManual "orders-in-manual" ["MODE-04"] "Sends orders to vehicles in MANUAL, SERVICE and TEACHIN.";
    ActionsInService "actions-in-service" ["MODE-04"] "Sends instant actions to vehicles in SERVICE and TEACHIN.";
    UpdatesInService "updates-in-service" ["MODE-04"] "Extends the order of a vehicle that keeps it in SERVICE or TEACHIN.";
    ClearedOrderUpdated "cleared-order-updated" ["ORD-MSG-02"] "Goes on with the order a vehicle has given up in MANUAL.";
    OrdersToOffline "orders-to-offline" ["CONN-12"] "Sends orders to vehicles that are offline.";
    OldWillIgnored "old-will-ignored" ["CONN-13", "CONN-12"] "Ignores a connection message with an old timestamp.";
    OnlineIsHealthy "online-is-healthy" ["CONN-14"] "Takes a vehicle that comes ONLINE for healthy, whatever its errors.";
    BrokenIsDead "broken-is-dead" ["CONN-14", "ORD-CANCEL-01"] "Throws the order of a vehicle away when its connection breaks.";
    InformationObeyed "information-obeyed" ["INFO-02"] "Pauses vehicles that report an information.";
    LocalizationObeyed "localization-obeyed" ["INFO-03"] "Gives no work to vehicles with a low localizationScore.";
    VisualizationObeyed "visualization-obeyed" ["VIS-03"] "Takes the position of a vehicle from the visualization.";

    // What others have written down as mistakes to be expected
    IntervalWithinOrderOnly "interval-within-order-only" ["FACT-13"] "Keeps minOrderInterval between the messages of one order only.";
    QueuedUpdateInService "queued-update-in-service" ["MODE-04"] "Looks at the mode when it plans an update, not when minOrderInterval lets it out.";
    InstantsCountedApart "instants-counted-apart" ["ORD-MSG-17"] "Counts actions of orders and instant actions apart, under the same kind of id.";
    HeaderIdCountsActions "header-id-counts-actions" ["HDR-02"] "Raises headerId by the number of instant actions in a message.";
    LostUpdateNotResent "lost-update-not-resent" ["MQTT-10"] "Takes every update for accepted once it is sent.";
    TriggerForgottenInPause "trigger-forgotten-in-pause" ["ACT-39"] "Stops the time of waitForTrigger when the vehicle is paused, and never starts it again.";
    TriggerSupervisedOnce "trigger-supervised-once" ["ACT-39"] "Supervises waitForTrigger no more once a vehicle has been given its trigger in time.";
    EnabledForFleet "enabled-for-fleet" ["MAP-09"] "Takes a map for enabled on every vehicle once one of them has enabled it.";
    LoadParametersByTable "load-parameters-by-table" ["FACT-15"] "Gives drop only the parameters that the text demands, not those the factsheet does.";
    EmptyListMeansAll "empty-list-means-all" ["OPT-03"] "Takes an empty list of optionalParameters for support of everything.";
    LoopNumberedByNode "loop-numbered-by-node" ["ORD-UPD-11"] "Gives a node that the way passes twice the sequenceId of the first time.";
    LoopStitchedAtFirstPass "loop-stitched-at-first-pass" ["ORD-UPD-05", "ORD-UPD-03"] "Looks the stitching node up by its nodeId, and begins where the way passed it first.";
    UpdateIdStopsAtTen "update-id-stops-at-ten" ["ORD-UPD-04"] "Compares orderUpdateIds as texts, so that 10 comes behind 9 for ever.";
    ChargingInEveryMode "charging-in-every-mode" ["MODE-04"] "Sends a vehicle whose battery is low to charge, whatever its mode.";
    VersionOfTheVehicle "version-of-the-vehicle" ["HDR-04"] "Copies the version of the last state into its own header.";
    MissingPausedIsPaused "missing-paused-is-paused" ["ORD-UPD-02", "STATE-17"] "Takes a vehicle that does not say whether it is paused for paused.";
    ZeroRequiredOmitted "zero-required-omitted" ["OPT-05"] "Leaves out what a vehicle requires where its value is zero.";
}

/// The fault of that name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Fault> {
    FAULTS.iter().chain(BLIND_FAULTS).find(|fault| fault.name == name)
}

/// A set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Faults([u128; 8]);

impl Faults {
    /// The set of the named faults; `Err` with the first unknown name.
    pub(super) fn named(names: &[&str]) -> Result<Self, String> {
        let mut set = Self::default();
        for name in names {
            let position = FAULTS.iter().chain(BLIND_FAULTS).position(|fault| fault.name == *name);
            let index = position.ok_or_else(|| (*name).to_owned())?;
            set.0[index / 128] |= 1 << (index % 128);
        }
        Ok(set)
    }

    /// Whether the fault is on.
    pub(super) fn has(self, fault: FaultName) -> bool {
        let index = fault as usize;
        self.0[index / 128] & (1 << (index % 128)) != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_name_is_kebab_case_and_unique() {
        let mut names: Vec<_> = FAULTS.iter().map(|fault| fault.name).collect();
        assert!(names.iter().all(|name| {
            name.chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-')
        }));
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), FAULTS.len());
        assert!(FAULTS.len() + BLIND_FAULTS.len() <= 1024, "they are kept in 1024 bits");
    }
}
