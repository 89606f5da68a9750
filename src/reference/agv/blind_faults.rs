//! Faults of blind rounds that the suites need not find yet.
//!
//! Somebody who has not seen suites, checks and fault lists wrote them from the standard and the catalogue alone. What was
//! found of them before anything was changed stands in `suites/qualification/rounds.md`. A fault moves to the registry
//! above, with a name without its round, as soon as a requirement it names finds it.

macro_rules! with_blind_faults {
    ($registry:ident! $($own:tt)*) => {
        $registry! {
            blind {
                R1WillForgottenOnReconnect "r1-will-forgotten-on-reconnect" ["CONN-01", "CONN-02"] "It registers a last will at its first connection only, and connects again without one.";
                R1InstantActionsNotSubscribedAgain "r1-instant-actions-not-subscribed-again" ["TOPIC-10", "MQTT-10"] "After a reconnect it subscribes to the topic order only, and instant actions do not reach it any more.";
                R1WarningsGoneByReconnect "r1-warnings-gone-by-reconnect" ["ERR-01", "ORD-REJ-03", "ORD-REJ-08"] "It forgets all active errors when it reconnects, though no new order was accepted and nothing was put right.";
                R1HorizonLostWithLink "r1-horizon-lost-with-link" ["MQTT-03", "MQTT-05", "STATE-12"] "When the link breaks it keeps the base of its order and throws the horizon away.";
                R1EndedActionsLostWithLink "r1-ended-actions-lost-with-link" ["STATE-MSG-10", "MQTT-03", "STATE-MSG-09"] "After a broken link its states do not list the actions that had ended before.";
                R1OfflineSkippedMidOrder "r1-offline-skipped-mid-order" ["CONN-07"] "It is switched off without a message OFFLINE when an order is active.";
                R1OfflineQosZero "r1-offline-qos-zero" ["MQTT-08"] "It publishes ONLINE with QoS 1 but OFFLINE with QoS 0.";
                R1OfflineNotRetained "r1-offline-not-retained" ["CONN-06"] "It publishes OFFLINE without the retain flag, so that the broker keeps ONLINE.";
                R1OnlineNotRetainedAgain "r1-online-not-retained-again" ["CONN-06", "CONN-11"] "The ONLINE after a reconnect has no retain flag, so that CONNECTIONBROKEN stays at the broker.";
                R1VisualizationQosOne "r1-visualization-qos-one" ["MQTT-07"] "It publishes the visualization with QoS 1.";
                R1FactsheetAnswerNotRetained "r1-factsheet-answer-not-retained" ["FACT-01"] "It answers a factsheetRequest with a factsheet without the retain flag.";
                R1AnswerRepeatsHeaderId "r1-answer-repeats-header-id" ["HDR-02", "ACT-26"] "The state that answers a stateRequest has the headerId of the state before it.";
                R1FactsheetVersionPrefixed "r1-factsheet-version-prefixed" ["HDR-04"] "The version in the header of its factsheet begins with the letter V.";
                R1VisualizationNamesComputer "r1-visualization-names-computer" ["HDR-05", "TOPIC-04", "VIS-01"] "The serialNumber in its visualization is the host name of its computer.";
                R1FactsheetDated "r1-factsheet-dated" ["HDR-03", "JSON-10"] "The timestamp of its factsheet is a date without a time.";
                R1ReachUnlimited "r1-reach-unlimited" ["JSON-08", "MQTT-02", "STATE-MSG-15"] "While it charges it reports its reach as the overflowing number 1e999.";
                R1FactsheetNotMidOrder "r1-factsheet-not-mid-order" ["ACT-40"] "It reports a factsheetRequest FINISHED during an order but publishes no factsheet then.";
                R1ActionsHeldOffline "r1-actions-held-offline" ["MQTT-04"] "As long as the link is broken it drives on but begins no action of its order.";
                R1NoOrderNull "r1-no-order-null" ["JSON-06", "STATE-MSG-02", "STATE-MSG-01"] "Before its first order it reports null as orderId.";
                R1AutoAckMixedCase "r1-auto-ack-mixed-case" ["JSON-02", "STATE-MSG-17"] "While its field is violated it reports the e-stop as AutoAck.";
                R1FieldViolationCounted "r1-field-violation-counted" ["JSON-07", "STATE-MSG-17"] "While its field is violated it reports fieldViolation as the number 1.";
                R1BatteryHealthUnknown "r1-battery-health-unknown" ["STATE-MSG-15", "JSON-09"] "It reports an unknown battery health as 255.";
                R1HorizonDrivenAfterPause "r1-horizon-driven-after-pause" ["ORD-UPD-01", "ORD-07"] "A stopPause while it waits at the decision point makes it drive on into the horizon.";
                R1HorizonUpdateDriven "r1-horizon-update-driven" ["ORD-07", "ORD-UPD-08", "ORD-UPD-01"] "It takes an update that only plans a new horizon as a release, and drives into that horizon.";
                R1StopsAtStitch "r1-stops-at-stitch" ["ORD-06", "ORD-FLOW-09"] "An update that arrives while it drives is taken over, but it stands still for ever at the stitching node.";
                R1MaxSpeedOfEdgeBefore "r1-max-speed-of-edge-before" ["ORD-MSG-20", "OPT-01"] "It keeps to the maxSpeed of the edge before the one it drives on.";
                R1MaxSpeedForgottenInPause "r1-max-speed-forgotten-in-pause" ["ORD-MSG-20"] "After a pause on an edge it drives the rest of that edge at its own speed, whatever maxSpeed says.";
                R1GlobalAsTangential "r1-global-as-tangential" ["ORD-MSG-22"] "It reads the orientation of an edge against the path also when orientationType is GLOBAL.";
                R1ThetaAtEndOnly "r1-theta-at-end-only" ["ORD-MSG-10", "NODE-01"] "It assumes the theta of the last node of the base only, and passes nodes before that as it comes.";
                R1FirstNodeActionsSkipped "r1-first-node-actions-skipped" ["NODE-04", "ACT-01"] "It never begins the actions of the first node of an order with several nodes, as it stands there already.";
                R1ContinuationActionsSkipped "r1-continuation-actions-skipped" ["ORD-FLOW-11", "NODE-04"] "It drives the continuation of a completed order but never begins the node actions in it.";
                R1DuplicateClearsErrors "r1-duplicate-clears-errors" ["ORD-REJ-08", "ORD-REJ-03"] "An order it knows already, sent again, clears its order errors as an accepted new order would.";
                R1DuplicateRepeatsActions "r1-duplicate-repeats-actions" ["ORD-REJ-13", "ASTATE-06"] "The running order sent again makes it repeat the finished actions of the node it was on last.";
                R1OutdatedContinuesCompleted "r1-outdated-continues-completed" ["ORD-REJ-10"] "Once its order is complete it takes over an update that joins it even if the orderUpdateId is lower.";
                R1NewOrderTakenInPause "r1-new-order-taken-in-pause" ["ORD-FLOW-01", "ACT-14"] "While it is paused it replaces its unfinished order by a new one.";
                R1FarOrderTakenAfterCancel "r1-far-order-taken-after-cancel" ["ORD-FLOW-04"] "After a cancellation it accepts a new order wherever its first node is, and drives there.";
                R1JointSequenceUnchecked "r1-joint-sequence-unchecked" ["ORD-FLOW-08"] "It joins an update to its running order by the nodeId alone, whatever the sequenceId of the first node.";
                R1JointNodeUnchecked "r1-joint-node-unchecked" ["ORD-FLOW-10"] "It joins an update to its completed order by the sequenceId alone, whatever the nodeId of the first node.";
                R1DeviationAsDiameter "r1-deviation-as-diameter" ["ORD-05", "ORD-CANCEL-16"] "It takes allowedDeviationXY of the first node as a diameter, and finds nodes out of reach that are within it.";
                R1FirstUpdateIdZeroed "r1-first-update-id-zeroed" ["ORD-FLOW-06", "STATE-MSG-02"] "It reports orderUpdateId 0 for every new order, also if it was sent with another one.";
                R1UpdateDrivesInPause "r1-update-drives-in-pause" ["ACT-12", "STATE-MSG-08"] "An update that arrives during a pause makes it drive although it stays paused.";
                R1UpdateForgetsEndedActions "r1-update-forgets-ended-actions" ["STATE-MSG-10", "STATE-MSG-09"] "An accepted update removes the ended actions of the order from its action states.";
                R1UpdateForgetsInstantActions "r1-update-forgets-instant-actions" ["STATE-MSG-10", "STATE-MSG-09"] "An accepted update removes the ended instant actions from its action states.";
                R1HorizonEdgesStay "r1-horizon-edges-stay" ["ORD-UPD-08", "ORD-UPD-09", "STATE-12"] "When an update replaces the horizon, the edges of the old one stay in its edge states.";
                R1JointActionsRepeated "r1-joint-actions-repeated" ["ORD-UPD-07", "ASTATE-06"] "An update that repeats the actions of a stitching node already traversed makes it do them again.";
                R1JointPositionReplaced "r1-joint-position-replaced" ["ORD-UPD-07"] "It replaces the nodePosition of a stitching node still ahead by the one in the update.";
                R1JointListedTwice "r1-joint-listed-twice" ["ORD-FLOW-09", "STATE-12"] "An update makes it list the stitching node twice in its node states as long as it is ahead.";
                R1CancelWaitsForPause "r1-cancel-waits-for-pause" ["ORD-CANCEL-07", "IACT-05"] "A cancelOrder during a pause stays RUNNING until the pause is lifted.";
                R1TriggerHoldsCancel "r1-trigger-holds-cancel" ["ACT-38", "ORD-CANCEL-07"] "A waitForTrigger goes on waiting when its order is cancelled, and the cancelOrder with it.";
                R1CancelFinishesHorizonActions "r1-cancel-finishes-horizon-actions" ["ORD-CANCEL-03", "ASTATE-05"] "When an order is cancelled, the waiting actions of its horizon are reported FINISHED.";
                R1CancelledActionFinished "r1-cancelled-action-finished" ["ORD-CANCEL-04"] "It reports running actions that it breaks off for a cancellation as FINISHED.";
                R1SecondCancelFinished "r1-second-cancel-finished" ["ORD-CANCEL-18"] "A cancelOrder after the order was cancelled already is reported FINISHED.";
                R1IdleCancelNamesType "r1-idle-cancel-names-type" ["ORD-CANCEL-20"] "The error noOrderToCancel references the actionType of the cancelOrder and not its actionId.";
                R1CancelKeepsCurrentEdge "r1-cancel-keeps-current-edge" ["ORD-CANCEL-11", "STATE-13"] "Cancelled between two nodes, it keeps the edge it stands on in its edge states.";
                R1CancelResetsUpdateId "r1-cancel-resets-update-id" ["ORD-CANCEL-08", "STATE-MSG-02"] "A cancellation sets its orderUpdateId back to 0.";
                R1CancelHidesNextNode "r1-cancel-hides-next-node" ["ORD-CANCEL-09"] "While it drives to the next node to end a cancelled order it lists no node at all.";
                R1CancelShowsPaused "r1-cancel-shows-paused" ["ORD-CANCEL-05", "ASTATE-04"] "An action that cannot be interrupted is reported PAUSED while the cancellation waits for it.";
                R1PauseUnreportedWhenIdle "r1-pause-unreported-when-idle" ["ACT-13"] "Paused without an order, it reports the startPause FINISHED but paused as false.";
                R1UnreadableOrderDropped "r1-unreadable-order-dropped" ["ORD-REJ-02", "ORD-REJ-17"] "It drops an order message that is not JSON without an error.";
                R1SplitBaseTaken "r1-split-base-taken" ["ORD-11"] "It takes an order whose base goes on behind an unreleased node.";
                R1NumbersReadFromText "r1-numbers-read-from-text" ["ORD-REJ-01", "ORD-REJ-02"] "It takes an order in which orderUpdateId or a sequenceId is a number in quotes.";
                R1BlockingTypeAssumed "r1-blocking-type-assumed" ["ORD-REJ-01", "ORD-REJ-02"] "It takes an order with an action without blockingType, and assumes NONE.";
                R1UnknownMapSilent "r1-unknown-map-silent" ["MAP-08", "ORD-REJ-17"] "It refuses an order on a map it does not have without any error.";
                R1BusyRefusalSilent "r1-busy-refusal-silent" ["ORD-FLOW-01", "ORD-REJ-17", "ORD-FLOW-03"] "It refuses a new order while another one is active without any error.";
                R1OutdatedUpdateSilent "r1-outdated-update-silent" ["ORD-REJ-12", "ORD-REJ-17"] "It drops an outdated order update without an error.";
                R1CulpritUnnamed "r1-culprit-unnamed" ["ORD-REJ-07"] "Its orderError references the message alone and not the field or the action that is wrong.";
                R1RejectedUpdateCutsHorizon "r1-rejected-update-cuts-horizon" ["ORD-FLOW-12", "STATE-12"] "An order update that it rejects still makes it throw away the horizon of its order.";
                R1RejectedUpdateIdAdopted "r1-rejected-update-id-adopted" ["ORD-FLOW-08", "ORD-FLOW-10"] "It adopts the orderUpdateId of an update that it rejects because it does not join the order.";
                R1OutdatedHaltsDriving "r1-outdated-halts-driving" ["ORD-REJ-11", "ORD-FLOW-12"] "An outdated update makes it stand still until there is a new order, though it keeps the order it has.";
                R1SurplusActionsDropped "r1-surplus-actions-dropped" ["ORD-REJ-15", "ASTATE-01"] "Of a node with more actions than it can store it takes as many as fit, and forgets the others.";
                R1MissingParameterTaken "r1-missing-parameter-taken" ["ORD-REJ-04", "ORD-REJ-09"] "It takes over an order with an action that lacks a required parameter.";
                R1PausedActionsFail "r1-paused-actions-fail" ["ACT-18", "ACT-34"] "Actions that were held by a pause or a violated field become FAILED when they could go on.";
                R1PauseCutsHorizon "r1-pause-cuts-horizon" ["ACT-14", "STATE-12"] "A startPause makes it throw away the horizon of its order.";
                R1StopPauseTwiceFails "r1-stop-pause-twice-fails" ["ACT-11"] "It reports a stopPause FAILED when it is not paused.";
                R1InitPositionEnablesAll "r1-init-position-enables-all" ["MAP-14"] "An initPosition enables all versions of the map it names.";
                R1DeleteTakesAllVersions "r1-delete-takes-all-versions" ["MAP-31", "MAP-29"] "A deleteMap removes all disabled versions of the mapId and not only the one it names.";
                R1OtherVersionRefused "r1-other-version-refused" ["MAP-18", "MAP-07"] "It refuses to download a new version of a map as a duplicate because it has another version.";
                R1DeleteTakesNewest "r1-delete-takes-newest" ["MAP-31", "MAP-33"] "A deleteMap for a version it does not have removes the newest disabled version of that map.";
                R1EnableInTwoStates "r1-enable-in-two-states" ["MAP-24"] "On enableMap it first disables all versions of the map, reports that, and enables the wanted one in the next state.";
                R1InitPositionThetaLost "r1-init-position-theta-lost" ["ACT-23"] "An initPosition sets its orientation to 0, whatever theta says.";
                R1MapOfOrderDeleted "r1-map-of-order-deleted" ["MAP-32"] "It deletes an enabled map that the rest of its order needs, as it stands on another one.";
                R1StateRequestUnansweredInPause "r1-state-request-unanswered-in-pause" ["ACT-26", "IACT-05"] "While it is paused a stateRequest brings no state before the next periodic one.";
                R1NodeStopChargingUnreported "r1-node-stop-charging-unreported" ["ACT-19"] "A stopCharging on a node is FINISHED while charging stays true.";
                R1TriggerTimesOut "r1-trigger-times-out" ["ACT-37"] "A waitForTrigger is FINISHED after five seconds also without the trigger.";
                R1DownloadFailureHangs "r1-download-failure-hangs" ["MAP-19", "IACT-04"] "A downloadMap that did not succeed keeps its status for ever.";
                R1FailedDownloadPurges "r1-failed-download-purges" ["MAP-22", "MAP-31", "MAP-19"] "A download that fails removes the disabled versions of that map which it had before.";
                R1InstantScopeUnchecked "r1-instant-scope-unchecked" ["ACT-10"] "It performs an action as an instant action that is for nodes only, such as pick.";
                R1SemiautomaticInstantRefused "r1-semiautomatic-instant-refused" ["MODE-02"] "In SEMIAUTOMATIC it takes orders but reports every instant action FAILED.";
                R1BatchEndsAtFailure "r1-batch-ends-at-failure" ["IACT-07", "IACT-03"] "It drops the rest of an instantActions message behind an action that has failed.";
                R1UnknownInstantWaits "r1-unknown-instant-waits" ["IACT-06", "IACT-04"] "An instant action that it does not know stays WAITING for ever.";
                R1InstantActionsWaitForPause "r1-instant-actions-wait-for-pause" ["IACT-05"] "While it is paused it holds back instant actions until the pause is lifted.";
                R1VelocityInMapAxes "r1-velocity-in-map-axes" ["MAP-03"] "It reports its velocity along the axes of the map and not along its own.";
                R1OmegaClockwise "r1-omega-clockwise" ["MAP-01", "MAP-03"] "It reports omega as positive when it turns clockwise.";
                R1ThetaNeverNegative "r1-theta-never-negative" ["MAP-02", "STATE-MSG-05"] "It reports its orientation between 0 and two pi.";
                R1LocalizationScorePercent "r1-localization-score-percent" ["STATE-MSG-05"] "It reports its localizationScore in percent.";
                R1PickReportedLate "r1-pick-reported-late" ["ACT-28", "STATE-04", "STATE-MSG-06"] "It reports a load it has picked two seconds after the pick is FINISHED.";
                R1LoadsOmittedWhenEmpty "r1-loads-omitted-when-empty" ["STATE-MSG-06"] "It reports loads while it carries one, and leaves the field out when it is unloaded.";
                R1LoadPositionUnlisted "r1-load-position-unlisted" ["FACT-09", "STATE-MSG-07"] "It reports a load on a loadPosition that its factsheet does not list.";
                R1LoadWidthMissing "r1-load-width-missing" ["STATE-MSG-07", "JSON-10"] "The loadDimensions of its load have no width.";
                R1EStopLatched "r1-e-stop-latched" ["STATE-MSG-17"] "After the emergency stop is released it reports the e-stop as active until the next order.";
                R1LastNodeAfterActions "r1-last-node-after-actions" ["NODE-03", "STATE-MSG-04"] "It removes the node state at a node with actions but sets lastNodeId and lastNodeSequenceId when the actions have ended.";
                R1LastSequenceResetWhenDone "r1-last-sequence-reset-when-done" ["STATE-MSG-04"] "When its order is complete it reports lastNodeSequenceId 0.";
                R1RouteOmittedWhenIdle "r1-route-omitted-when-idle" ["STATE-13", "STATE-MSG-01"] "It leaves nodeStates and edgeStates out when nothing is to be traversed.";
                R1HorizonCutToOne "r1-horizon-cut-to-one" ["STATE-12", "ORD-FLOW-06"] "Of the horizon it lists only the first node in its node states.";
                R1LoopNodesMerged "r1-loop-nodes-merged" ["ORD-UPD-13", "STATE-12"] "A node that it has to visit several times appears in its node states only once.";
                R1EnteredEdgeUnlisted "r1-entered-edge-unlisted" ["STATE-12", "NODE-05"] "It removes the state of an edge as soon as it enters that edge.";
                R1FarEdgesUnreleased "r1-far-edges-unreleased" ["STATE-MSG-13"] "Of its released edges it reports only the next one as released.";
                R1TurningNotDriving "r1-turning-not-driving" ["STATE-MSG-08"] "It reports driving as false while it turns on the spot.";
                R1FailedInstantUnlisted "r1-failed-instant-unlisted" ["IACT-03", "STATE-MSG-09"] "It does not list instant actions that have failed.";
                R1InfoTypeMissing "r1-info-type-missing" ["INFO-01"] "The information that its warning lights are on has no infoType.";
                R1SemiautomaticUnderscore "r1-semiautomatic-underscore" ["MODE-01", "JSON-02"] "It reports the mode SEMIAUTOMATIC as SEMI_AUTOMATIC.";
                R1ManualFinishesActions "r1-manual-finishes-actions" ["MODE-05"] "The actions that run when it is switched to MANUAL are reported FINISHED.";
                R1ManualKeepsHorizon "r1-manual-keeps-horizon" ["MODE-05", "STATE-13"] "Switched to MANUAL it clears the base of its order and keeps the horizon.";
                R1EmergencyStopUntyped "r1-emergency-stop-untyped" ["ERR-02"] "The error of its emergency stop has an empty errorType.";
                R1OwnErrorGoneByOrder "r1-own-error-gone-by-order" ["ERR-01", "ERR-04"] "A new order clears also the error of a defect that is still there.";
                R1CancelOutlivesOrder "r1-cancel-outlives-order" ["STATE-MSG-11"] "An ended cancelOrder stays in its action states when a new order is accepted.";
                R1NewestErrorOnly "r1-newest-error-only" ["ERR-01", "ORD-REJ-03", "ORD-REJ-08"] "Of several active errors it reports the newest one only.";
                R1ReferencesNamedKeyValue "r1-references-named-key-value" ["BP-04", "ERR-05"] "The members of its error references are called key and value.";
                R1NoneJoinsHard "r1-none-joins-hard" ["BLOCK-05", "BLOCK-06"] "A NONE action that follows a HARD one in the list begins together with it.";
                R1PreparesWhileDriving "r1-prepares-while-driving" ["BLOCK-03", "BLOCK-04"] "It drives on while a SOFT or HARD action is INITIALIZING, and stops only when that action runs.";
                R1SilentWhenIdle "r1-silent-when-idle" ["STATE-02"] "Without an order it sends no state for 45 seconds.";
                R1SilentInManual "r1-silent-in-manual" ["MODE-06", "STATE-02"] "After the state that reports MANUAL it sends none until it leaves that mode.";
                R1VisualizationWithoutMap "r1-visualization-without-map" ["VIS-01"] "The agvPosition in its visualization has no mapId.";
                R1VisualizationOnlyMoving "r1-visualization-only-moving" ["VIS-02"] "It publishes its visualization only while it moves, though the factsheet states an interval.";
                R1ClassUnknown "r1-class-unknown" ["FACT-03"] "Its factsheet gives its agvClass as AMR.";
                R1ActionStatesLimitExceeded "r1-action-states-limit-exceeded" ["FACT-11"] "Its factsheet allows one action state, and its states hold more.";
                R1ArrayLimitsNested "r1-array-limits-nested" ["FACT-05", "JSON-10"] "Its factsheet gives the array limits of orders as nested objects and not under names with a dot.";
                R1ScopesInOneText "r1-scopes-in-one-text" ["FACT-07", "JSON-06"] "Its factsheet gives the scopes of an action as one text with commas.";
                R1PickListedInstant "r1-pick-listed-instant" ["ACT-09", "FACT-07"] "Its factsheet offers pick also as an instant action.";
                R1EnvelopeUnnamed "r1-envelope-unnamed" ["FACT-08"] "The envelope in its factsheet has no name of its set.";
                R1VersionsAsMap "r1-versions-as-map" ["FACT-10"] "Its factsheet gives its versions as one object and not as a list of keys and values.";
                R1CorridorLeftUnwatched "r1-corridor-left-unwatched" ["CORR-06", "CORR-07"] "It watches only the right boundary of its corridor.";
            }
            $($own)*
        }
    };
}
