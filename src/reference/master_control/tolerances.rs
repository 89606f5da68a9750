//! Liberties a good master control may take: behaviour the standard leaves open, and that must not be accused.

use std::time::Duration;

use super::config::MasterControlConfig;
use crate::reference::agv::Tolerance;

/// A name that is not in [`TOLERANCES`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reference master control has no tolerance `{0}`")]
pub struct UnknownTolerance(pub String);

macro_rules! tolerances {
    (blind { $($late:ident $late_name:literal [$($late_id:literal),+] $late_does:literal;)* }
     $($variant:ident $name:literal [$($id:literal),+] $does:literal;)+) => {
        /// A tolerance of the reference master control; see [`TOLERANCES`] for what each does.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the sentence stands in TOLERANCES")]
        pub enum ToleranceName { $($variant,)+ $($late),* }

        /// All tolerances of the reference master control.
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
R6FactsheetRequestAtEachOnline "r6-factsheet-request-at-each-online" ["IACT-02", "ORD-MSG-17"] "It requests the factsheet each time that a vehicle comes ONLINE.";
R6SeveralInstantActionsInOneMessage "r6-several-instant-actions-in-one-message" ["IACT-01"] "It puts stateRequest beside the instant action asked for into one message.";
R6HorizonWithdrawnAndGivenAgain "r6-horizon-withdrawn-and-given-again" ["ORD-UPD-12", "ORD-UPD-03"] "It takes the horizon back by an update with the stitching node only and gives it again by the next update.";
R6NoUpdateWhilePaused "r6-no-update-while-paused" ["STATE-17", "ORD-UPD-02"] "It sends no further base as long as the vehicle is paused.";
R6OneNodeFirst "r6-one-node-first" ["ORD-02", "ORD-MSG-06"] "It first sends an order with only the node where the vehicle stands and adds the way by an update.";
R6CorridorWithOneSideZero "r6-corridor-with-one-side-zero" ["CORR-05", "CORR-09"] "It sends a corridor with width only to the left where there is no room to the right.";
R6ClearsRetainedOrderTopics "r6-clears-retained-order-topics" ["MQTT-02", "TOPIC-13"] "It publishes an empty retained message on order and instantActions when it starts, to clear leftovers.";
R6CancelsOnFatal "r6-cancels-on-fatal" ["IACT-02", "CONN-14"] "It cancels the order of a vehicle that reports a FATAL error.";
R5HorizonActionsGetNewIds "r5-horizon-actions-get-new-ids" ["ORD-MSG-17", "ORD-UPD-06"] "It gives the actions of the horizon new action ids when they are sent again in an update.";
R5RepeatsOrderAfterOnline "r5-repeats-order-after-online" ["ORD-REJ-18", "ORD-UPD-04", "ORD-UPD-05"] "It repeats the last order message with the same content when the vehicle comes ONLINE again.";
R5StateRequestAfterOnline "r5-state-request-after-online" ["TOPIC-13", "IACT-01"] "It asks for a state by stateRequest whenever a vehicle comes ONLINE.";
R5PauseTogetherWithStateRequest "r5-pause-together-with-state-request" ["IACT-01", "ACT-08"] "It sends startPause and stateRequest in one instantActions message.";
R5PauseAfterCancelBeforeNextOrder "r5-pause-after-cancel-before-next-order" ["TOPIC-13", "ORD-CANCEL-17"] "It waits some seconds after a finished cancelOrder before it sends the next order.";
R5WholeNumbersWithoutPoint "r5-whole-numbers-without-point" ["JSON-06", "JSON-09"] "It writes whole coordinates and speeds without a decimal point.";
R5NoOrdersOnLowBattery "r5-no-orders-on-low-battery" ["TOPIC-13"] "It gives no new transport to a vehicle whose batteryCharge is below 30 percent and that is not charging.";
R5HorizonDeletedOnPause "r5-horizon-deleted-on-pause" ["ORD-UPD-03", "ORD-UPD-02"] "It deletes the horizon by an update when the operator pauses a vehicle and sends it again after the resume.";
R5CancelRepeatedWithNewId "r5-cancel-repeated-with-new-id" ["ORD-MSG-17", "IACT-02"] "It repeats a cancelOrder that did not appear in the state within some seconds, with a new actionId.";
R5StopsPauseAfterReconnectOnlyByOperator "r5-stops-pause-after-reconnect-only-by-operator" ["TOPIC-13", "IACT-02"] "It sends nothing to a vehicle that came back paused until the operator resumes it.";
R4NumbersWithExponent "r4-numbers-with-exponent" ["JSON-06", "JSON-09"] "It writes coordinates with an exponent, such as 1.05e1.";
R4NoThetaOnNodes "r4-no-theta-on-nodes" ["ORD-MSG-09", "MAP-02"] "It sends no theta and leaves the orientation to the vehicle.";
R4RequestsStateAndFactsheetWhenOnline "r4-requests-state-and-factsheet-when-online" ["IACT-01", "TOPIC-13"] "It sends stateRequest and factsheetRequest in one message each time a vehicle reports ONLINE.";
R4DispatchesAfterTwoSeconds "r4-dispatches-after-two-seconds" ["TOPIC-13"] "It sends an order two seconds after the operator asked for it.";
R4CancelsAfterTwoSeconds "r4-cancels-after-two-seconds" ["ORD-CANCEL-01", "TOPIC-13"] "It sends cancelOrder two seconds after the operator asked for it.";
R4HorizonDeletedFirst "r4-horizon-deleted-first" ["ORD-UPD-03", "ORD-UPD-04"] "It deletes the horizon by one update and sends the new one by a second, when the destination is changed.";
R4PauseSentTwice "r4-pause-sent-twice" ["ORD-MSG-17", "IACT-01"] "It sends startPause a second time, with its own actionId, while the first is not reported finished.";
R4SecondLegAsUpdateOfTheCompletedOrder "r4-second-leg-as-update-of-the-completed-order" ["ORD-MSG-02", "ORD-UPD-05"] "It sends the way to the first station as an order without horizon and, when that is completed, the rest as an update that begins at the last node.";
R4HeartbeatOutsideTheProtocol "r4-heartbeat-outside-the-protocol" ["TOPIC-01", "TOPIC-15"] "It publishes a heartbeat of its own on a topic outside the tree of the protocol.";
R3VisualizationNotSubscribed "r3-visualization-not-subscribed" ["VIS-03", "TOPIC-14"] "It does not subscribe to visualization at all.";
R3SubscribesTwice "r3-subscribes-twice" ["TOPIC-14"] "It subscribes to each topic both exactly and with wildcards, so that messages may come to it twice.";
R3WholeSecondTimestamps "r3-whole-second-timestamps" ["HDR-03"] "Its clock has a resolution of a second: the two digits of the fraction are always zero.";
R3ResumesBeforeCancel "r3-resumes-before-cancel" ["ORD-CANCEL-01"] "It sends stopPause to a paused vehicle before it calls its order off.";
R3CancelSentToIdle "r3-cancel-sent-to-idle" ["ORD-CANCEL-01"] "It passes a requested cancelOrder on to a vehicle that has nothing to do.";
R3LongWaysInTwoOrders "r3-long-ways-in-two-orders" ["ORD-MSG-02", "ORD-02"] "It drives a long way in two orders one after the other.";
R3OnBoardMapDeletedFirst "r3-on-board-map-deleted-first" ["MAP-28"] "It deletes a disabled map that is on board already before it has it downloaded again, without waiting for a rejection.";
R3DuplicateLeftAlone "r3-duplicate-left-alone" ["MAP-28"] "It gives a download up that was rejected as a duplicate.";
R3HorizonOfOneNode "r3-horizon-of-one-node" ["ORD-09"] "It never shows more than one node of the horizon.";
R3EnablesMapBeforeEachOrder "r3-enables-map-before-each-order" ["MAP-09"] "It sends enableMap for the map of the first node before every order, even if it is enabled.";
R3NoNewOrdersInSemiautomatic "r3-no-new-orders-in-semiautomatic" ["MODE-04"] "It begins new orders in AUTOMATIC only, and lets running ones go on in SEMIAUTOMATIC.";
R3TemporaryNodeWide "r3-temporary-node-wide" ["ORD-CANCEL-17"] "It gives temporary nodes an allowedDeviationXY of a metre.";
R3TemporaryNodeWithTheta "r3-temporary-node-with-theta" ["ORD-CANCEL-17"] "It gives temporary nodes the reported theta of the vehicle.";
R3LoadIdGiven "r3-load-id-given" ["ACT-31", "FACT-15"] "It sends the optional parameter loadId with pick where the vehicle lists it.";
R3FinePositioningBeforePick "r3-fine-positioning-before-pick" ["ACT-08", "FACT-15"] "It puts a finePositioning before each pick on a node where the vehicle offers it.";
R3VendorActionsBlockNothing "r3-vendor-actions-block-nothing" ["ORD-MSG-16", "FACT-15"] "It sends actions of the manufacturer on nodes with blockingType NONE where the vehicle allows it.";
R3HorizonActionsOpen "r3-horizon-actions-open" ["ORD-UPD-03", "ORD-MSG-06"] "It sends the actions of nodes and edges only when they are released; in the horizon the lists are empty.";
R3HorizonSlower "r3-horizon-slower" ["ORD-UPD-03"] "It sends a lower maxSpeed for edges in the horizon than when they are released.";
R3SlowLastEdge "r3-slow-last-edge" ["OPT-03"] "It limits the speed on the last edge of a way more than it does on the same edge elsewhere.";
R3EdgeIdsNamedOtherwise "r3-edge-ids-named-otherwise" ["ORD-MSG-18", "JSON-04"] "It names edges way, start node and end node with colons instead of by the ids of the layout.";
R3SupportedSpeedLeftOut "r3-supported-speed-left-out" ["OPT-03", "OPT-05"] "It sends maxSpeed only to vehicles that REQUIRE it.";
R3RotationAndLengthStated "r3-rotation-and-length-stated" ["OPT-03"] "It sends rotationAllowed and length of every edge where the vehicle supports them.";
R3CorridorAsymmetric "r3-corridor-asymmetric" ["CORR-09", "CORR-04"] "Its corridors are wider on the left than on the right.";
R3PolylineStraights "r3-polyline-straights" ["ORD-MSG-29", "ORD-MSG-28"] "It gives straight trajectories a third control point halfway, with degree 1.";
R3EqualWeightsOfTwo "r3-equal-weights-of-two" ["ORD-MSG-28"] "It gives all control points of a trajectory the weight 2.";
R2PlainNumberIds "r2-plain-number-ids" ["ORD-MSG-02", "ORD-MSG-17", "JSON-04"] "It makes orderIds and actionIds of digits only.";
R2FactsheetAwaited "r2-factsheet-awaited" ["OPT-03", "FACT-15"] "It begins no order before it has the factsheet of the vehicle.";
R2WholeWayReleased "r2-whole-way-released" ["ORD-09", "ORD-UPD-02"] "It releases the whole way with the first message of an order.";
R2PausesBeforeCancel "r2-pauses-before-cancel" ["ORD-CANCEL-01", "IACT-02"] "It sends startPause before cancelOrder, and stopPause when the cancellation has ended.";
R2FreshStateAwaited "r2-fresh-state-awaited" ["CONN-12"] "It begins no order for a vehicle that came back before a new state has come from it.";
R2NoNewOrderWhilePaused "r2-no-new-order-while-paused" ["TOPIC-13"] "It begins no new order while the vehicle is paused.";
R2LatestTransportFirst "r2-latest-transport-first" ["TOPIC-13", "ORD-MSG-02"] "It begins the transport asked for last before those that wait longer.";
R2MapHashLeftOut "r2-map-hash-left-out" ["MAP-16", "ACT-31"] "It leaves the optional mapHash out of downloadMap.";
R2EveryDirectionAllowed "r2-every-direction-allowed" ["ORD-MSG-09", "OPT-03"] "It sends an allowedDeviationTheta of pi for nodes where any direction will do, if the vehicle supports it.";
R2ZeroDeviations "r2-zero-deviations" ["ORD-MSG-09", "OPT-03"] "It sends an allowedDeviationXY of 0 for nodes behind the first that have none in the layout, if the vehicle supports it.";
R2HorizonToTheGoal "r2-horizon-to-the-goal" ["ORD-09", "ORD-UPD-02"] "It shows the whole rest of the way as horizon.";
R2FirstOrderWithoutHorizon "r2-first-order-without-horizon" ["ORD-09", "ORD-UPD-02"] "It sends the first message of an order without horizon and extends the base by updates.";
R2ResendsLate "r2-resends-late" ["ORD-REJ-18"] "It waits three times as long before it sends again what was lost.";
R2LongKeepAlive "r2-long-keep-alive" ["MQTT-01"] "It connects with a keep-alive of a minute.";
R2WillOfItsOwn "r2-will-of-its-own" ["TOPIC-15"] "It has a last will on a topic of its own that is none of the protocol, in plain text.";
R2SubscribesToEverything "r2-subscribes-to-everything" ["TOPIC-14", "TOPIC-15"] "It subscribes to all topics of the interface with one filter.";
R2ParametersReversed "r2-parameters-reversed" ["BP-04"] "It lists the parameters of an action in the opposite order.";
R2MembersReversedInside "r2-members-reversed-inside" ["HDR-01"] "It writes the members of all objects in the opposite order, the header last.";
R2OptionalParametersFilled "r2-optional-parameters-filled" ["FACT-15"] "It sends optional parameters of vendor actions too, with values of the listed types.";
R2FactsheetAskedOnReturn "r2-factsheet-asked-on-return" ["ACT-08", "TOPIC-14"] "It sends a factsheetRequest when a vehicle comes ONLINE again.";
R2EnablesAfterDownload "r2-enables-after-download" ["MAP-09", "MAP-10"] "It enables a map of which no version is enabled as soon as its download has ended, while no order runs.";
R2BlocksByCancel "r2-blocks-by-cancel" ["ORD-UPD-03", "ORD-CANCEL-01"] "It calls the order off and sends another when an edge of the horizon is blocked.";
R2SlowerWhenLoaded "r2-slower-when-loaded" ["ORD-UPD-03", "OPT-03"] "It sends half the maxSpeed for edges while the vehicle carries a load.";
R2ReconnectsLater "r2-reconnects-later" ["MQTT-10"] "It waits four times as long before it connects again.";
        R1UuidIds "r1-uuid-ids" ["ORD-MSG-17", "JSON-04"] "Ids of orders, actions and temporary elements look like UUIDs where the vehicle allows their length.";
        R1IdsWithPunctuation "r1-ids-with-punctuation" ["JSON-04"] "Ids contain colon, underscore, dot and hyphen.";
        R1InstantActionsOneByOne "r1-instant-actions-one-by-one" ["IACT-01"] "Every instant action is sent in a message of its own.";
        R1ReroutesByCancel "r1-reroutes-by-cancel" ["ORD-UPD-03", "ORD-CANCEL-01"] "A change of destination is always done by cancelOrder and a new order, never by another horizon.";
        R1TemporaryStart "r1-temporary-start" ["ORD-03", "ORD-CANCEL-17"] "For a vehicle a little off a node a new order begins at a temporary node at its reported position.";
        R1WeightsLeftOut "r1-weights-left-out" ["ORD-MSG-28"] "Control points have no weight.";
        R1CubicStraights "r1-cubic-straights" ["ORD-MSG-28", "ORD-MSG-29", "ORD-MSG-30"] "Straight trajectories are given as cubic curves with four control points on the line.";
        R1CorridorByContour "r1-corridor-by-contour" ["CORR-09"] "Corridors refer to the contour of the vehicle.";
        R1CorridorWithoutRefPoint "r1-corridor-without-ref-point" ["CORR-09"] "Corridors have no corridorRefPoint.";
        R1ThetaAtTheBound "r1-theta-at-the-bound" ["ORD-MSG-09", "MAP-02"] "Node orientations, where the vehicle supports them, are exactly minus pi.";
        R1ActionsOnEdges "r1-actions-on-edges" ["ACT-08", "FACT-15"] "pick, drop and other actions are put on the last edge before the station where the vehicle offers that scope.";
        R1StateAskedAfterReconnect "r1-state-asked-after-reconnect" ["MQTT-10", "ACT-08"] "After its own connection was lost and came back it sends stateRequest.";
        R1LogAskedAfterFailure "r1-log-asked-after-failure" ["ACT-08", "ACT-31"] "After an action of an order has failed it asks for a log if the vehicle offers that.";
        R1BaseGrowsEagerly "r1-base-grows-eagerly" ["ORD-UPD-02"] "It extends the base by a node as soon as the message before was accepted, long before the vehicle needs it.";
        R1UpdatesWithoutHorizon "r1-updates-without-horizon" ["ORD-UPD-03", "ORD-09"] "Order updates hold the new base only and delete the horizon.";
        R1HorizonSentAgain "r1-horizon-sent-again" ["ORD-UPD-03", "ORD-UPD-05"] "Once in an order it sends an order update that extends nothing and gives the same horizon again.";
        R1NewClientIdEachTime "r1-new-client-id-each-time" ["MQTT-10", "TOPIC-15"] "It connects with another client identifier each time.";
        R1ListensToOwnTopics "r1-listens-to-own-topics" ["TOPIC-14", "TOPIC-15"] "It also subscribes to order and instantActions.";
        R1InstantsBlockNothing "r1-instants-block-nothing" ["ORD-MSG-16", "FACT-15"] "Instant actions have blockingType NONE where the vehicle allows it.";
        R1EmptyParameterLists "r1-empty-parameter-lists" ["BP-04", "ORD-MSG-15"] "Actions without parameters carry an empty list of them.";
        R1HeaderIdHigh "r1-header-id-high" ["HDR-02", "JSON-09"] "It counts headerId from 4000000000.";
        R1GenerousDeviations "r1-generous-deviations" ["ORD-MSG-09"] "Nodes without actions have an allowedDeviationXY of 0.8 m where the vehicle supports it.";
        R1PickAndDropApart "r1-pick-and-drop-apart" ["ORD-MSG-02", "TOPIC-13"] "A transport from one station to another is done in two orders, one for the pick and one for the drop.";
        R1TakesTheLongWay "r1-takes-the-long-way" ["ORD-12", "TOPIC-13"] "It takes the second best way where there is one.";
        R1PreloadsMaps "r1-preloads-maps" ["MAP-10", "MAP-16"] "It sends downloadMap unasked for each map of the site that the vehicle does not have.";
        R1TextEscaped "r1-text-escaped" ["JSON-03", "MQTT-02"] "Hyphens in JSON texts are written as escaped code points.";
        R1BlankLinesAround "r1-blank-lines-around" ["MQTT-02"] "There is white space before and behind the JSON object.";
        R1StateAskedWhenQuiet "r1-state-asked-when-quiet" ["ACT-08"] "It sends stateRequest when no state has come for six seconds.";
    }

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
pub struct Tolerances([u128; 2]);

impl Tolerances {
    /// Whether the master control takes this liberty.
    pub(super) fn has(self, tolerance: ToleranceName) -> bool {
        let index = tolerance as usize;
        self.0[index / 128] & (1 << (index % 128)) != 0
    }
}

impl MasterControlConfig {
    /// Lets the master control take a liberty.
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
        match tolerance {
            ToleranceName::AnswersSlowly => self.answers_after = Duration::from_millis(500),
            ToleranceName::NoHorizon => self.horizon_length = 0,
            ToleranceName::LongHorizon => self.horizon_length = usize::MAX,
            ToleranceName::WholeBase => self.base_length = usize::MAX,
            ToleranceName::SmallSteps => self.base_length = self.base_length.max(4),
            ToleranceName::R5NoOrdersOnLowBattery => self.low_battery = 30.0,
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
        assert!(
            TOLERANCES.len() + BLIND_TOLERANCES.len() <= 128,
            "they are kept in 128 bits"
        );
    }

    #[test]
    fn an_unknown_one_is_refused_by_name() {
        let mut config = MasterControlConfig::default();
        assert_eq!(config.tolerate("no-such"), Err(UnknownTolerance("no-such".to_owned())));
        assert_eq!(config.tolerate("no-horizon"), Ok(()));
        assert_eq!(config.horizon_length, 0);
    }
}
