//! The registry of defects the reference master control can be given.
//!
//! Each is a mistake a real fleet manager could make, and a small deviation at one point of decision, found by
//! searching for its [`FaultName`]. `breaks` names first the requirement the fault is about.

use crate::reference::Fault;

macro_rules! faults {
    ($($variant:ident $name:literal [$($id:literal),+] $wrong:literal;)+) => {
        /// A fault of the reference master control; see [`FAULTS`] for what each does.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the sentence stands in FAULTS")]
        pub enum FaultName { $($variant),+ }

        /// All faults of the reference master control.
        pub const FAULTS: &[Fault] = &[$(Fault { name: $name, breaks: &[$($id),+], wrong: $wrong }),+];
    };
}

faults! {
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
    TopicUnderscore "topic-underscore" ["TOPIC-01", "TOPIC-13"] "Sends instant actions on a topic spelled with an underscore.";
    TopicWithoutVersion "topic-without-version" ["TOPIC-13", "TOPIC-02"] "Leaves the level of the major version out of the topic of orders.";
    OtherMajorVersion "other-major-version" ["TOPIC-13", "TOPIC-03"] "Sends orders below another major version.";
    OtherSerialNumber "other-serial-number" ["HDR-05", "TOPIC-04"] "Names another serial number in the header than in the topic.";
    SerialNumberWithSpace "serial-number-with-space" ["TOPIC-05", "HDR-05"] "Writes the serial number with a space in the header.";
    ManufacturerWithSlash "manufacturer-with-slash" ["TOPIC-06", "HDR-05"] "Writes the manufacturer with a slash in the header.";
    DollarInTopic "dollar-in-topic" ["TOPIC-13", "TOPIC-07"] "Sends orders on a topic with a dollar sign in it.";
    InstantActionsAsOrders "instant-actions-as-orders" ["TOPIC-13", "IACT-01"] "Sends instant actions on the order topic.";
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

R1CancelDoubleEncoded "r1-cancel-double-encoded" ["MQTT-02", "IACT-01"] "The message with cancelOrder is a JSON string that holds the JSON text, not a JSON object.";
R1CancelQosOne "r1-cancel-qos-one" ["MQTT-06"] "It publishes instantActions with cancelOrder with QoS 1.";
R1ResendQosOne "r1-resend-qos-one" ["MQTT-06"] "It publishes an order that was lost again with QoS 1.";
R1ReconnectForgetsOrder "r1-reconnect-forgets-order" ["MQTT-10", "ORD-UPD-02", "STATE-17"] "After its own connection was lost and came back it has forgotten the running orders and never extends their base again.";
R1ReconnectsOnlyOnce "r1-reconnects-only-once" ["MQTT-10"] "It connects again after the first lost connection, but not after the second one.";
R1LostInstantNotResent "r1-lost-instant-not-resent" ["MQTT-10"] "It never repeats an instant action that no state shows.";
R1VehicleReturnStopsUpdates "r1-vehicle-return-stops-updates" ["MQTT-10", "ORD-UPD-02", "STATE-17"] "Once the connection of a vehicle was away during an order and is back, it does not extend the base of that order any more.";
R1UpdatesOnOwnTopic "r1-updates-on-own-topic" ["TOPIC-01", "TOPIC-13"] "It publishes order updates on a topic orderUpdate instead of order.";
R1TopicLevelsSwapped "r1-topic-levels-swapped" ["TOPIC-04", "TOPIC-02", "TOPIC-13"] "It publishes instantActions with the levels of manufacturer and serial number swapped.";
R1VersionLevelWithoutLetter "r1-version-level-without-letter" ["TOPIC-03", "TOPIC-13"] "It publishes instantActions under a major version level without the letter v.";
R1PauseToFirstVehicle "r1-pause-to-first-vehicle" ["TOPIC-13", "TOPIC-04"] "It publishes startPause and stopPause for any vehicle on the topic of the first vehicle of the fleet.";
R1FactsheetPublishedAgain "r1-factsheet-published-again" ["TOPIC-15"] "It publishes the first factsheet of a vehicle again on the factsheet topic, retained.";
R1PathOnVisualization "r1-path-on-visualization" ["TOPIC-15"] "With every order it publishes a visualization message for the vehicle with the place where the order begins.";
R1HeaderIdMissingInCancel "r1-header-id-missing-in-cancel" ["HDR-01", "JSON-10", "IACT-01"] "Messages with cancelOrder have no headerId.";
R1ManufacturerMissingInUpdates "r1-manufacturer-missing-in-updates" ["HDR-01", "HDR-05", "JSON-10", "ORD-MSG-01"] "Order updates have no manufacturer in the header.";
R1HeaderIdKeptOnResend "r1-header-id-kept-on-resend" ["HDR-02"] "An order that is sent again keeps the headerId of its first transmission.";
R1HeaderIdCountsFleet "r1-header-id-counts-fleet" ["HDR-02"] "It counts headerId per topic name over all vehicles, so that a vehicle sees jumps as soon as another one is commanded.";
R1HeaderIdFromClock "r1-header-id-from-clock" ["HDR-02", "JSON-09", "JSON-10"] "headerId is the time in milliseconds, which neither counts by one nor fits 32 bits.";
R1TimestampZeroOffset "r1-timestamp-zero-offset" ["HDR-03"] "Timestamps end in +00:00 instead of Z.";
R1VersionWithLetter "r1-version-with-letter" ["HDR-04"] "The version in the header of orders begins with the letter v.";
R1HeaderOfFirstVehicle "r1-header-of-first-vehicle" ["HDR-05", "TOPIC-04"] "The header of messages to any vehicle names the first vehicle of the fleet.";
R1Utf16InstantActions "r1-utf16-instant-actions" ["JSON-03", "MQTT-02"] "It encodes instantActions in UTF-16.";
R1EdgeIdWithArrow "r1-edge-id-with-arrow" ["JSON-04"] "Edge ids contain an arrow with a greater-than sign.";
R1OneActionNotInArray "r1-one-action-not-in-array" ["JSON-06", "ORD-MSG-05", "JSON-10"] "Where a node has one action only, actions is that object and not an array.";
R1ReleasedAsNumber "r1-released-as-number" ["JSON-07", "ORD-MSG-18", "JSON-10"] "released of edges is 1 or 0.";
R1NullTheta "r1-null-theta" ["JSON-10", "JSON-06", "OPT-03"] "Nodes without an orientation carry theta with the value null.";
R1OrientationUnasked "r1-orientation-unasked" ["OPT-03"] "All edges carry orientation and orientationType, whether the vehicle supports them or not.";
R1SpeedUnaskedInUpdates "r1-speed-unasked-in-updates" ["OPT-03"] "Order updates carry maxSpeed on every edge, also for a vehicle that does not support it.";
R1RequiredNotInHorizon "r1-required-not-in-horizon" ["OPT-05"] "Optional fields that the vehicle requires are left out on nodes and edges of the horizon when the layout has no value.";
R1RequiredOnlyInFirstMessage "r1-required-only-in-first-message" ["OPT-05"] "Optional fields that the vehicle requires are given in new orders, but left out on what order updates add.";
R1SelfEdge "r1-self-edge" ["ORD-02", "ORD-MSG-06"] "An order of one node has an edge from that node to itself.";
R1StartBeforeManual "r1-start-before-manual" ["ORD-03"] "After a time in manual mode the next order begins where the vehicle was when it was taken over, not where it is.";
R1EdgesReleasedAfterReroute "r1-edges-released-after-reroute" ["ORD-08", "ORD-09"] "After a change of destination all edges of the order updates are released, also those of the horizon.";
R1StationsAlwaysReleased "r1-stations-always-released" ["ORD-09"] "A node with actions is released even if it lies in the horizon.";
R1BlockForgottenOnReconnect "r1-block-forgotten-on-reconnect" ["ORD-12"] "After its own connection was lost and came back it has forgotten which edges a vehicle may not use.";
R1RerouteOverBlockedEdge "r1-reroute-over-blocked-edge" ["ORD-12"] "A change of destination is planned without regard to the edges the vehicle may not use.";
R1GoalReleasedOnArrival "r1-goal-released-on-arrival" ["ORD-UPD-02"] "It releases the last node of a transport only when the vehicle has halted at the end of the base before it.";
R1RerouteCutsBase "r1-reroute-cuts-base" ["ORD-UPD-03", "ORD-UPD-05", "ORD-CANCEL-01"] "A change of destination while a horizon is left cuts the base behind the next node and goes on from there.";
R1BaseShortenedOnBlock "r1-base-shortened-on-block" ["ORD-UPD-03", "ORD-CANCEL-01", "ORD-UPD-05"] "When an edge of the base is blocked, an order update that begins before it takes the rest of the base back, instead of cancelOrder.";
R1UpdateFromVehicle "r1-update-from-vehicle" ["ORD-UPD-05", "ORD-UPD-03"] "Order updates begin with the node the vehicle has reached last and repeat the base from there.";
R1UpdateIdKeptOnReroute "r1-update-id-kept-on-reroute" ["ORD-UPD-04"] "The order update of a change of destination has the orderUpdateId of the message before.";
R1UpdateIdsRestartOnReconnect "r1-update-ids-restart-on-reconnect" ["ORD-UPD-04"] "After its own connection was lost and came back it counts the orderUpdateId of a running order from 1 again.";
R1ResendWithNewActionIds "r1-resend-with-new-action-ids" ["ORD-UPD-04", "ORD-REJ-18"] "An order that is sent again with the same orderUpdateId has new actionIds.";
R1ResendAsUpdate "r1-resend-as-update" ["ORD-REJ-18", "ORD-UPD-05", "ORD-UPD-03"] "An order that is sent again has a raised orderUpdateId.";
R1StitchingActionsRenamed "r1-stitching-actions-renamed" ["ORD-UPD-06"] "The actions of the stitching node have other actionIds in an order update than before.";
R1StitchingDeviationWidened "r1-stitching-deviation-widened" ["ORD-UPD-06", "OPT-03"] "The stitching node has an allowedDeviationXY of 1 m in order updates, whatever it had before.";
R1SequenceContinuesOverOrders "r1-sequence-continues-over-orders" ["ORD-UPD-11"] "A second order continues the sequenceIds of the order before instead of beginning at 0.";
R1SequenceGapAfterReroute "r1-sequence-gap-after-reroute" ["ORD-UPD-11", "ORD-UPD-12"] "After a change of destination the sequenceIds of the horizon given up are skipped, so that there is a gap.";
R1PauseInsteadOfCancel "r1-pause-instead-of-cancel" ["ORD-CANCEL-01"] "To call an order off it sends startPause and never cancelOrder.";
R1PausedOrderReplaced "r1-paused-order-replaced" ["ORD-CANCEL-01"] "When an order is called off while the vehicle is paused, it sends no cancelOrder, and the next new order at once.";
R1CancelLostWhileAway "r1-cancel-lost-while-away" ["ORD-CANCEL-01", "TOPIC-13"] "A cancellation asked for while the vehicle is away is never sent, and the order goes on.";
R1NextOrderAfterFailedAction "r1-next-order-after-failed-action" ["ORD-CANCEL-01"] "After an action of an order has failed it sends the next new order without cancelOrder while the old one still has nodes left.";
R1LineGuidedFromBaseEnd "r1-line-guided-from-base-end" ["ORD-CANCEL-14", "ORD-03"] "A vehicle without position that was stopped on its way gets a next order that begins at the end of the base it never reached.";
R1LastNodeTooNarrow "r1-last-node-too-narrow" ["ORD-CANCEL-17", "ORD-03"] "For a vehicle that stopped between nodes the next order begins at the last node without a deviation that covers the vehicle.";
R1OrderIdKeptAfterCancel "r1-order-id-kept-after-cancel" ["ORD-MSG-02", "ORD-UPD-04", "ORD-UPD-05"] "The first order after a cancellation has the orderId of the order that was called off and the next orderUpdateId.";
R1ZoneSetNullInUpdates "r1-zone-set-null-in-updates" ["ORD-MSG-03", "JSON-06", "JSON-10"] "Order updates carry zoneSetId with the value null.";
R1ZeroCoordinatesOmitted "r1-zero-coordinates-omitted" ["ORD-MSG-05", "JSON-10"] "x and y of a node position are left out when they are zero.";
R1HorizonWithoutActions "r1-horizon-without-actions" ["ORD-MSG-06", "ORD-MSG-05", "ORD-MSG-18", "JSON-10"] "Nodes and edges of the horizon have no actions array.";
R1TemporaryNodeIdFixed "r1-temporary-node-id-fixed" ["ORD-MSG-07"] "Every temporary node has the id temporary, wherever it is.";
R1HorizonWithoutPosition "r1-horizon-without-position" ["ORD-MSG-08", "OPT-05"] "Nodes of the horizon have no nodePosition.";
R1DeviationThetaFullCircle "r1-deviation-theta-full-circle" ["ORD-MSG-09"] "Where the orientation does not matter, allowedDeviationTheta is two pi.";
R1ThetaUpToTwoPi "r1-theta-up-to-two-pi" ["ORD-MSG-09", "MAP-02"] "Node orientations are given between 0 and two pi, such as 4.71.";
R1PauseIdRepeats "r1-pause-id-repeats" ["ORD-MSG-17"] "Every startPause has the same actionId.";
R1ActionIdsRestartOnReconnect "r1-action-ids-restart-on-reconnect" ["ORD-MSG-17"] "After its own connection was lost and came back it gives out the same actionIds again.";
R1PickAndDropShareId "r1-pick-and-drop-share-id" ["ORD-MSG-17"] "The pick and the drop of one transport have the same actionId.";
R1EdgeActionsSingular "r1-edge-actions-singular" ["ORD-MSG-18", "ORD-MSG-06", "JSON-01", "JSON-10"] "The array of actions of an edge is named action.";
R1ReverseEdgesMisdirected "r1-reverse-edges-misdirected" ["ORD-MSG-19"] "An edge that leads to a node with a lesser id has startNodeId and endNodeId exchanged.";
R1ControlPointsAsPairs "r1-control-points-as-pairs" ["ORD-MSG-28", "JSON-10"] "Control points of a trajectory are pairs of numbers instead of objects with x and y.";
R1CubicOfTwoPoints "r1-cubic-of-two-points" ["ORD-MSG-29"] "Trajectories have degree 3 with two control points and four knots.";
R1CurveOfWayThere "r1-curve-of-way-there" ["ORD-MSG-30"] "The trajectory of an edge that leads to a node with a lesser id runs from the end node to the start node.";
R1CorridorWidthsAsText "r1-corridor-widths-as-text" ["CORR-09", "JSON-06", "JSON-10"] "leftWidth and rightWidth of a corridor are strings.";
R1CorridorAloneInUpdates "r1-corridor-alone-in-updates" ["CORR-02"] "Edges with a corridor have no trajectory in order updates.";
R1CorridorZeroAtGoal "r1-corridor-zero-at-goal" ["CORR-05"] "The last edge before the goal has a corridor of zero width on both sides instead of none.";
R1InitPositionInDegrees "r1-init-position-in-degrees" ["MAP-02"] "theta of initPosition is in degrees.";
R1InitPositionOnOldMap "r1-init-position-on-old-map" ["MAP-27"] "initPosition names the map the vehicle reports already, not the new one that was asked for.";
R1MapNotCheckedInUpdates "r1-map-not-checked-in-updates" ["MAP-09"] "An order update releases nodes on a map that is not enabled any more; only new orders are checked.";
R1EnableMapTakenForDone "r1-enable-map-taken-for-done" ["MAP-09"] "Once enableMap was reported FINISHED it sends orders on that map although the state shows it as disabled.";
R1AbsentMapUsed "r1-absent-map-used" ["MAP-09"] "It sends an order on a map the vehicle does not have at all.";
R1EnableBeforeDownload "r1-enable-before-download" ["MAP-10"] "It sends enableMap for a map it rolls out before downloadMap.";
R1DownloadLinkRelative "r1-download-link-relative" ["MAP-16"] "mapDownloadLink is a path without protocol and host.";
R1RepeatedDownloadWithoutLink "r1-repeated-download-without-link" ["MAP-16", "ACT-31", "FACT-15"] "The downloadMap that is repeated after a duplicate was deleted has no mapDownloadLink.";
R1DuplicateOtherVersionDeleted "r1-duplicate-other-version-deleted" ["MAP-28"] "After a download was rejected as a duplicate it deletes another version of that map and then repeats the download.";
R1DownloadBeforeDelete "r1-download-before-delete" ["MAP-28"] "After a download was rejected as a duplicate it repeats the download first and deletes the map after it.";
R1VendorParametersDropped "r1-vendor-parameters-dropped" ["ACT-07", "FACT-15"] "Actions of the manufacturer are sent without any parameter.";
R1TriggerOnEdge "r1-trigger-on-edge" ["ACT-08", "FACT-15"] "It puts waitForTrigger on the edge before the node.";
R1DropAtOnceWhenThere "r1-drop-at-once-when-there" ["ACT-08", "FACT-15"] "When the vehicle stands at the goal already it sends drop as an instant action.";
R1EnableMapWithoutVersion "r1-enable-map-without-version" ["ACT-31", "FACT-15"] "enableMap has no mapVersion.";
R1DeleteMapWithoutVersion "r1-delete-map-without-version" ["ACT-31", "FACT-15"] "deleteMap has no mapVersion.";
R1TriggerTypeMissing "r1-trigger-type-missing" ["ACT-31", "FACT-15"] "waitForTrigger has no triggerType.";
R1TriggerTimerRestarts "r1-trigger-timer-restarts" ["ACT-39"] "The time-out of waitForTrigger begins again with every state, so that it never runs out at a vehicle that reports often.";
R1TriggerTimeoutPauses "r1-trigger-timeout-pauses" ["ACT-39"] "When waitForTrigger runs too long it sends startPause and does not call the order off.";
R1ChargingDuringOrder "r1-charging-during-order" ["IACT-02"] "It sends startCharging and stopCharging as instant actions while the vehicle drives an order.";
R1PositionWhilePaused "r1-position-while-paused" ["IACT-02"] "It sends initPosition during an order when the vehicle is paused.";
R1OneInstantNotInArray "r1-one-instant-not-in-array" ["IACT-01", "JSON-06", "JSON-10"] "When there is one instant action only, actions is that object and not an array.";
R1NewBaseAnsweredOnce "r1-new-base-answered-once" ["STATE-17"] "It answers the first newBaseRequest of a vehicle and ignores every later one.";
R1NewBaseOnlyAtRest "r1-new-base-only-at-rest" ["STATE-17"] "It ignores newBaseRequest while the vehicle is driving.";
R1InformationHoldsBase "r1-information-holds-base" ["INFO-02", "ORD-UPD-02", "STATE-17"] "It does not extend the base while the state carries information.";
R1InformationHoldsDispatch "r1-information-holds-dispatch" ["INFO-02"] "It begins no new order while the state carries information.";
R1DeviationRangeAtStart "r1-deviation-range-at-start" ["INFO-03"] "It adds the reported deviationRange to the allowedDeviationXY of the first node of an order.";
R1LowScoreRelocated "r1-low-score-relocated" ["INFO-03"] "It sends initPosition to an idle vehicle whose localizationScore is low.";
R1UpdatesInManual "r1-updates-in-manual" ["MODE-04"] "It goes on extending the base of a running order while the vehicle is in MANUAL.";
R1TeachinIsAutomatic "r1-teachin-is-automatic" ["MODE-04"] "It commands a vehicle in TEACHIN as if it were in AUTOMATIC.";
R1CancelInManual "r1-cancel-in-manual" ["MODE-04"] "It sends cancelOrder, and what else waits, to a vehicle in a manual mode.";
R1ResendInService "r1-resend-in-service" ["MODE-04"] "It sends an order that was lost again although the vehicle is in SERVICE by now.";
R1VisualizationHoldsDispatch "r1-visualization-holds-dispatch" ["VIS-03"] "It begins no new order while the visualization shows a velocity, whatever the state says.";
R1BrokenNotHeeded "r1-broken-not-heeded" ["CONN-12"] "It takes no notice of CONNECTIONBROKEN and commands the vehicle on; only OFFLINE counts.";
R1WillWithLowHeaderIdIgnored "r1-will-with-low-header-id-ignored" ["CONN-13", "CONN-12"] "It ignores a CONNECTIONBROKEN whose headerId is not above that of the connection message before.";
R1BrokenMeansCancel "r1-broken-means-cancel" ["CONN-14"] "It takes CONNECTIONBROKEN for a failure of the vehicle and calls the running order off when it is back.";
R1OnlineClearsErrors "r1-online-clears-errors" ["CONN-14"] "With ONLINE it takes the errors of the last state for gone and sends orders in spite of a FATAL error.";
R1ArrayLimitIgnoredInUpdates "r1-array-limit-ignored-in-updates" ["FACT-12"] "It keeps the limits of nodes and edges in new orders, but not in order updates.";
R1InstantLimitIgnored "r1-instant-limit-ignored" ["FACT-12"] "It puts all instant actions that wait into one message, whatever the limit of the vehicle.";
R1IntervalNotAfterCancel "r1-interval-not-after-cancel" ["FACT-13"] "The first order after a cancellation is sent without regard to minOrderInterval.";
R1IntervalForgottenOnReconnect "r1-interval-forgotten-on-reconnect" ["FACT-13"] "After its own connection was lost and came back the next order message is sent without regard to minOrderInterval.";
R1IntervalInMilliseconds "r1-interval-in-milliseconds" ["FACT-13"] "It takes minOrderInterval for milliseconds.";
R1UnlistedParametersPassed "r1-unlisted-parameters-passed" ["FACT-15"] "It sends parameters of an action that the factsheet does not list when somebody gives them.";
R1PredefinedNeedNoFactsheet "r1-predefined-need-no-factsheet" ["FACT-15"] "It sends predefined actions that the factsheet does not list, or not in that scope.";
R1FirstFactsheetForever "r1-first-factsheet-forever" ["FACT-15", "FACT-12", "FACT-13", "OPT-03", "OPT-05"] "It goes by the first factsheet it got from a vehicle and ignores every later one.";
R1ParametersByKey "r1-parameters-by-key" ["BP-04", "BP-05", "ACT-31", "JSON-10"] "Action parameters are objects with the key as the only member instead of key and value.";
R1VendorValuesAsText "r1-vendor-values-as-text" ["BP-05", "FACT-15"] "Parameters of actions of the manufacturer are strings, whatever their type in the factsheet.";
R1NumericalIdsAsNumbers "r1-numerical-ids-as-numbers" ["ORD-MSG-15", "ORD-MSG-01", "IACT-01", "JSON-06", "JSON-10"] "For a vehicle that takes numerical ids only, actionId and orderId are JSON numbers.";
R1StitchingNumberedAgain "r1-stitching-numbered-again" ["ORD-UPD-12", "ORD-UPD-05", "ORD-UPD-06"] "The first order update gives the stitching node the next sequenceId instead of its own and counts on from there.";
R1HorizonSpeedInfinite "r1-horizon-speed-infinite" ["JSON-08", "JSON-09", "MQTT-02"] "maxSpeed on edges of the horizon is 1e999, which no float64 holds.";
R1InstantWithoutBlockingType "r1-instant-without-blocking-type" ["ORD-MSG-15", "IACT-01", "JSON-10"] "Instant actions have no blockingType.";
R1ActionIdKeyUpperCase "r1-action-id-key-upper-case" ["JSON-01", "ORD-MSG-15", "JSON-10"] "Actions in orders carry their id under actionID.";
R1TriggerTypeRenamed "r1-trigger-type-renamed" ["ACT-06", "ACT-31", "FACT-15"] "waitForTrigger carries its triggerType under the key trigger.";
R1DeviceAsNumber "r1-device-as-number" ["ACT-32", "BP-05", "FACT-15"] "lhd is the number 0, not the name of a load handling device.";
R1InitPositionAxesSwapped "r1-init-position-axes-swapped" ["MAP-01", "MAP-27"] "initPosition has x and y exchanged.";
}

/// The fault of that name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Fault> {
    FAULTS.iter().find(|fault| fault.name == name)
}

/// A set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Faults([u128; 8]);

impl Faults {
    /// The set of the named faults; `Err` with the first unknown name.
    pub(super) fn named(names: &[&str]) -> Result<Self, String> {
        let mut set = Self::default();
        for name in names {
            let position = FAULTS.iter().position(|fault| fault.name == *name);
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
        assert!(FAULTS.len() <= 1024, "they are kept in 1024 bits");
    }
}
