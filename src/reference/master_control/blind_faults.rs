//! Faults of blind rounds that the suites need not find yet.
//!
//! Somebody who has not seen suites, checks and fault lists wrote them from the standard and the catalogue alone. What was
//! found of them before anything was changed stands in `suites/qualification/rounds.md`. A fault moves to the registry
//! above, with a name without its round, as soon as a requirement it names finds it.

macro_rules! with_blind_faults {
    ($registry:ident! $($own:tt)*) => {
        $registry! {
            blind {
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
            $($own)*
        }
    };
}
