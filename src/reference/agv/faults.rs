//! The registry of defects the reference AGV can be given.
//!
//! Each is a mistake a real vehicle could make, and a small deviation at one point of decision, found by
//! searching for its [`FaultName`]. `breaks` names first the requirement the fault is about.

use crate::reference::Fault;

macro_rules! faults {
    (blind { $($late:ident $late_name:literal [$($late_id:literal),+] $late_wrong:literal;)* }
     $($variant:ident $name:literal [$($id:literal),+] $wrong:literal;)+) => {
        /// A fault of the reference AGV; see [`FAULTS`] for what each does.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the sentence stands in FAULTS")]
        pub enum FaultName { $($variant,)+ $($late),* }

        /// All faults of the reference AGV.
        pub const FAULTS: &[Fault] = &[$(Fault { name: $name, breaks: &[$($id),+], wrong: $wrong }),+];

        /// Faults of blind rounds whose holes are not all closed yet: the suites need not find them.
        pub const BLIND_FAULTS: &[Fault] =
            &[$(Fault { name: $late_name, breaks: &[$($late_id),+], wrong: $late_wrong }),*];
    };
}

with_blind_faults! { faults!
    // Transport
    PauseStuckAfterCut "pause-stuck-after-cut" ["ACT-13"] "Reports stopPause FINISHED and stays paused when the link was lost in the pause.";
    ActionEndMissedOffline "action-end-missed-offline" ["MQTT-04"] "Leaves an action RUNNING for ever that ends while the link is down.";
    StopsOnLinkLoss "stops-on-link-loss" ["MQTT-04"] "Stands still as long as the link is down.";
    HorizonDrivenOffline "horizon-driven-offline" ["MQTT-05", "ORD-07", "MQTT-04"] "Drives into the horizon while the link is down.";
    EchoesOrder "echoes-order" ["TOPIC-15"] "Publishes the accepted order back on the order topic.";

    // Header and JSON

    // Connection
    CrashesOnMalformedOrder "crashes-on-malformed-order" ["ORD-REJ-02", "ORD-REJ-17"] "Ends its connection over an order that it cannot read, and comes back.";

    OnlineLate "online-late" ["CONN-05", "CONN-11"] "Says ONLINE only 25 seconds after it reconnected.";

    // Factsheet
    ListedActionRefused "listed-action-refused" ["ACT-01", "ACT-35", "ACT-36"] "Refuses finePositioning and detectObject although its factsheet lists them.";
    StateRequestListedRefused "state-request-listed-refused" ["FACT-07", "ACT-26"] "Does not understand stateRequest although its factsheet lists it.";

    // Order
    NodeSkipped "node-skipped" ["ORD-01", "STATE-06", "NODE-03"] "Leaves plain nodes between others out of its reports.";
    FirstNodeRefused "first-node-refused" ["ORD-04"] "Refuses orders that begin where it stands.";
    OrderAfterRefusalLost "order-after-refusal-lost" ["ORD-FLOW-06"] "Loses the first order that comes after a refused one while it has nothing to do.";
    DeviationIgnored "deviation-ignored" ["ORD-05", "ORD-CANCEL-16"] "Counts itself as on the first node only when it stands exactly there.";
    StopsBeforeEndOfBase "stops-before-end-of-base" ["ORD-06"] "Stops one node before the end of the base.";
    HorizonDriven "horizon-driven" ["ORD-07", "ORD-UPD-01", "MQTT-05", "MQTT-04"] "Drives into the horizon without waiting for its release.";
    HorizonSlippedInto "horizon-slipped-into" ["ORD-07", "MQTT-04"] "Stops at the decision point and rolls on into the horizon a moment later.";
    HorizonCreptInto "horizon-crept-into" ["ORD-UPD-01", "ORD-07"] "Waits at the decision point for a moment and creeps on into the horizon.";
    HorizonDemanded "horizon-demanded" ["ORD-10"] "Refuses new orders without a horizon.";
    GraphUnchecked "graph-unchecked" ["ORD-11"] "Takes over orders whose releases and counts make no sense.";
    SingleNodeRefused "single-node-refused" ["ORD-13"] "Refuses orders with one node.";
    StitchingNodeOverwritten "stitching-node-overwritten" ["ORD-UPD-07"] "Takes over the actions an update brings for the stitching node.";
    UpdateJoinedByNumber "update-joined-by-number" ["ORD-FLOW-08"] "Joins an update by its sequenceId, whatever the node.";
    HorizonAppended "horizon-appended" ["ORD-UPD-08"] "Keeps the old horizon when an update brings a new one.";
    HorizonKept "horizon-kept" ["ORD-UPD-09"] "Keeps the old horizon when an update has none.";
    HorizonActionsStay "horizon-actions-stay" ["ORD-UPD-10"] "Lets the actions of a deleted horizon wait for ever.";
    LoopConfused "loop-confused" ["ORD-UPD-13", "NODE-03"] "Reports the sequenceId of the first visit on every visit of a node.";
    RunningUpdateGapAccepted "running-update-gap-accepted" ["ORD-FLOW-08"] "Takes over an update that does not begin at the decision point.";
    BusyIgnored "busy-ignored" ["ORD-FLOW-01", "ORD-FLOW-03"] "Takes over a new order while another one is being driven.";
    RunningActionIgnored "running-action-ignored" ["ORD-FLOW-02"] "Takes over a new order while an action of the old one runs.";
    FreeActionIgnored "free-action-ignored" ["ORD-FLOW-02"] "Takes over a new order while an action of the old one runs that does not block.";
    HorizonNotBusy "horizon-not-busy" ["ORD-FLOW-03"] "Takes over a new order while it waits at the decision point.";
    FarOrderAccepted "far-order-accepted" ["ORD-FLOW-04"] "Drives to the first node of an order however far it is.";
    OldActionStatesKept "old-action-states-kept" ["ORD-FLOW-05", "STATE-MSG-11"] "Keeps the action states of the old order.";
    NeverStarts "never-starts" ["ORD-FLOW-07", "ORD-06"] "Accepts an order and does not begin to drive.";
    UpdateReplacesBase "update-replaces-base" ["ORD-FLOW-09"] "Forgets what was left of the base when an update arrives.";
    UpdateIdKept "update-id-kept" ["ORD-FLOW-09"] "Executes an update but keeps reporting the old orderUpdateId.";
    UpdateIdsComparedAcrossOrders "update-ids-compared-across-orders" ["ORD-FLOW-06", "ORD-04", "ORD-13"] "Refuses a new order whose orderUpdateId is lower than that of the last order.";
    UpdateIdCarriedOver "update-id-carried-over" ["ORD-FLOW-06", "STATE-12"] "Reports a new order with the orderUpdateId of the last one.";
    OnlyFirstUpdate "only-first-update" ["ORD-FLOW-09", "ORD-06"] "Refuses every further update of an order that was updated before.";
    UpdateActionsLost "update-actions-lost" ["ASTATE-01", "ACT-01"] "Takes over an update without the actions of its nodes and edges.";
    UpdateEdgeActionsLost "update-edge-actions-lost" ["ASTATE-01", "ACT-01"] "Takes over an update without the actions of its edges.";
    UpdateActionsNotPerformed "update-actions-not-performed" ["ACT-01", "NODE-04"] "Lists the actions of an update and never begins them.";
    ReleasedActionsLost "released-actions-lost" ["ASTATE-01"] "Forgets an action of its horizon when an update releases it.";
    ReleasedActionsDoubled "released-actions-doubled" ["STATE-MSG-09", "ASTATE-01"] "Lists an action of its horizon a second time when an update releases it.";
    HorizonActionsInherited "horizon-actions-inherited" ["ORD-UPD-08"] "Performs the actions of a horizon that was replaced on the nodes that took its place.";
    UpdateClearsActionStates "update-clears-action-states" ["STATE-MSG-10"] "Removes its finished actions from the states when an update comes.";
    UpdateRepeatsActions "update-repeats-actions" ["ASTATE-06"] "Performs the actions of its last node once more when an update comes.";
    UpdateEndsActions "update-ends-actions" ["ORD-FLOW-09"] "Breaks off its running actions when an update comes.";
    UpdateBreaksBlocking "update-breaks-blocking" ["BLOCK-04", "BLOCK-07"] "Drives off with an update although an action that stops it still runs.";
    UpdateRefusedWhileActing "update-refused-while-acting" ["ORD-FLOW-09"] "Refuses updates while an action of the order runs.";
    UpdateRefusedWhilePaused "update-refused-while-paused" ["ORD-FLOW-09"] "Refuses updates while it is paused.";
    UpdateEndsPause "update-ends-pause" ["ACT-12"] "Goes on with an update although it is paused.";
    UpdateRefusedAfterCut "update-refused-after-cut" ["ORD-FLOW-09"] "Refuses updates of an order that it had before its link broke.";
    CompletedUpdateGapAccepted "completed-update-gap-accepted" ["ORD-FLOW-10"] "Continues a completed order from whatever node the update begins with.";
    ContinuationNotDriven "continuation-not-driven" ["ORD-06", "ORD-FLOW-11"] "Takes over an update of a completed order and does not drive it.";
    CompletedNotContinued "completed-not-continued" ["ORD-FLOW-11"] "Refuses updates of a completed order.";

    // Cancel
    CancelDrivesOn "cancel-drives-on" ["ORD-CANCEL-02"] "Drives its base to the end before it obeys cancelOrder.";
    CancelLeavesWaiting "cancel-leaves-waiting" ["ORD-CANCEL-03", "ORD-CANCEL-13"] "Leaves the waiting actions of a cancelled order WAITING.";
    CancelLetsRun "cancel-lets-run" ["ORD-CANCEL-04"] "Lets interruptible actions run to their end when the order is cancelled.";
    CancelFailsEarly "cancel-fails-early" ["ORD-CANCEL-05"] "Reports an action FAILED on cancellation and FINISHED when it ends.";
    CancelFinishedEarly "cancel-finished-early" ["ORD-CANCEL-06", "ORD-CANCEL-07"] "Reports cancelOrder FINISHED while an action still runs.";
    CancelFinishedMoving "cancel-finished-moving" ["ORD-CANCEL-07"] "Reports cancelOrder FINISHED while it still rolls out.";
    CancelForgetsActions "cancel-forgets-actions" ["ORD-CANCEL-12", "STATE-MSG-10"] "Forgets the actions of a cancelled order a moment later.";
    CancelNeverFinished "cancel-never-finished" ["ORD-CANCEL-07", "IACT-04"] "Leaves cancelOrder RUNNING for ever.";
    CancelClearsOrderId "cancel-clears-order-id" ["ORD-CANCEL-08", "STATE-MSG-02"] "Empties the orderId when the order is cancelled.";
    CancelResetsUpdateId "cancel-resets-update-id" ["ORD-CANCEL-08", "STATE-MSG-02"] "Sets the orderUpdateId back to 0 when the order is cancelled.";
    CancelKeepsNodes "cancel-keeps-nodes" ["ORD-CANCEL-09"] "Keeps all node states while it drives to the node where it stops.";
    CancelLastNodeStale "cancel-last-node-stale" ["ORD-CANCEL-10"] "Does not report the node where it stopped after a cancellation.";
    CancelClearsLastNode "cancel-clears-last-node" ["STATE-MSG-04"] "Empties the lastNodeId when the order is cancelled.";
    LastNodeAheadWhenCancelled "last-node-ahead-when-cancelled" ["STATE-MSG-04"] "Names the node ahead as its last one when it is stopped between two nodes.";
    CancelLeavesNodes "cancel-leaves-nodes" ["ORD-CANCEL-11", "STATE-13"] "Keeps the node and edge states of a cancelled order.";
    CancelDropsActions "cancel-drops-actions" ["ORD-CANCEL-12", "STATE-MSG-10"] "Removes the action states of a cancelled order.";
    DeadAfterCancel "dead-after-cancel" ["ORD-CANCEL-13"] "Refuses every new order after a cancellation.";
    CancelledOrderRevived "cancelled-order-revived" ["ORD-FLOW-10", "ORD-CANCEL-02", "ORD-CANCEL-11"] "Goes on with a cancelled order when an update of it comes late.";
    CancelWaitsForPause "cancel-waits-for-pause" ["ORD-CANCEL-07"] "Does not finish cancelOrder as long as it is paused.";
    PausedOrderSurvivesCancel "paused-order-survives-cancel" ["ORD-CANCEL-02"] "Goes on with an order that was cancelled in a pause when the pause ends.";
    PausedActionsSurviveCancel "paused-actions-survive-cancel" ["ORD-CANCEL-06", "ORD-CANCEL-07"] "Reports cancelOrder FINISHED while actions are PAUSED, and goes on with them after the pause.";
    PreparedActionsSurviveCancel "prepared-actions-survive-cancel" ["ORD-CANCEL-06", "ORD-CANCEL-07"] "Reports cancelOrder FINISHED while it prepares an action, and performs it.";
    SecondCancelTakesOver "second-cancel-takes-over" ["ORD-CANCEL-07", "IACT-04"] "Forgets a cancelOrder that is under way when a second one comes.";
    CancelEndedByUpdate "cancel-ended-by-update" ["ORD-CANCEL-11", "ORD-CANCEL-02", "ORD-CANCEL-06"] "Ends a cancellation that is under way when an update comes, and drives it.";
    CancelMissesEdgeActions "cancel-misses-edge-actions" ["ORD-CANCEL-03"] "Leaves the waiting actions of edges WAITING when the order is cancelled.";
    CancelForgetsLoad "cancel-forgets-load" ["STATE-MSG-06"] "Shows no load any more when its order is cancelled.";
    TemporaryNodeRefused "temporary-node-refused" ["ORD-CANCEL-15"] "Refuses orders that begin at a node it has never heard of.";
    TemporaryNodeNotReached "temporary-node-not-reached" ["ORD-CANCEL-15"] "Takes over an order with one node it has never heard of, and never counts it as reached.";
    RangeNotCounted "range-not-counted" ["ORD-CANCEL-16"] "Drives to the exact place of a first node in whose range it stands.";
    IdleCancelFinished "idle-cancel-finished" ["ORD-CANCEL-18"] "Reports cancelOrder FINISHED although there is no order.";

    // Rejection
    EdgeEndsUnchecked "edge-ends-unchecked" ["ORD-11"] "Takes edges that name other nodes than those around them.";
    SequenceUnchecked "sequence-unchecked" ["ORD-11"] "Takes nodes and edges with doubled or missing sequenceIds.";
    ParametersUnchecked "parameters-unchecked" ["ORD-REJ-04"] "Takes over orders whatever the parameters of their actions are.";
    ValidationErrorLingers "validation-error-lingers" ["ORD-REJ-03"] "Keeps order errors although a new order was accepted.";
    UnknownActionAccepted "unknown-action-accepted" ["ORD-REJ-04", "ORD-REJ-09"] "Accepts orders with unknown actions and fails the action.";
    UnsupportedFieldIgnored "unsupported-field-ignored" ["ORD-REJ-05", "OPT-02"] "Ignores fields of an order it has no use for.";
    OutdatedUpdateTakenOver "outdated-update-taken-over" ["ORD-REJ-10"] "Goes back to an outdated order update.";
    DuplicateReported "duplicate-reported" ["ORD-REJ-13"] "Raises an error for an order that is sent twice.";
    DuplicateHaltsDriving "duplicate-halts-driving" ["ORD-06", "ORD-REJ-13"] "Stands still for ever when the order it drives is sent again.";
    DuplicateExecuted "duplicate-executed" ["ORD-REJ-13"] "Begins an order again when it is sent twice.";
    MemoryUnchecked "memory-unchecked" ["ORD-REJ-15", "STATE-12"] "Takes over orders larger than its stated limits, cut to what fits.";
    OrientationUnchecked "orientation-unchecked" ["ORD-REJ-16"] "Accepts edges with an orientation it cannot take.";

    // Motion
    ThetaIgnored "theta-ignored" ["ORD-MSG-10", "ORD-MSG-14", "NODE-01"] "Does not turn to the orientation a node asks for.";
    MaxSpeedIgnored "max-speed-ignored" ["ORD-MSG-20", "OPT-01"] "Drives with its own speed whatever the edge permits.";
    EdgeOrientationIgnored "edge-orientation-ignored" ["ORD-MSG-22", "OPT-01"] "Drives forwards whatever orientation the edge asks for.";
    MaxRotationSpeedIgnored "max-rotation-speed-ignored" ["ORD-MSG-25"] "Turns with its own speed whatever the edge permits.";
    TraversedEarly "traversed-early" ["ORD-MSG-13", "NODE-01", "NODE-02"] "Reports a node traversed half a metre before it is there.";
    AxesMirrored "axes-mirrored" ["MAP-01"] "Reports its position with y to the right.";

    TurnsOnEdge "turns-on-edge" ["ORD-MSG-24", "ORD-MSG-12"] "Turns to the orientation of an edge when it is on it already.";
    MaxHeightIgnored "max-height-ignored" ["ORD-MSG-21", "OPT-02"] "Accepts edges too low for it.";
    TrajectoryCut "trajectory-cut" ["ORD-MSG-26"] "Drives straight to the end of an edge that has a trajectory.";
    TangentIgnored "tangent-ignored" ["ORD-MSG-23"] "Looks the same way all along a curve.";
    DirectionIgnored "direction-ignored" ["ORD-MSG-27", "STATE-MSG-04"] "Takes the same branch at a junction whatever direction it is given.";
    DirectionMistaken "direction-mistaken" ["ORD-MSG-27", "STATE-MSG-04"] "Takes the branch beside the one it is told.";
    CorridorOverrun "corridor-overrun" ["CORR-01", "CORR-03"] "Drives round an obstacle as if its corridor were twice as wide.";
    CorridorContourIgnored "corridor-contour-ignored" ["CORR-03", "CORR-01"] "Keeps only its centre inside a corridor that is meant for its contour.";
    CorridorExitDrivenOn "corridor-exit-driven-on" ["CORR-06"] "Drives on when it finds itself outside its corridor.";
    CorridorExitForgotten "corridor-exit-forgotten" ["CORR-06"] "Stops for a moment when it finds itself outside its corridor, and drives on.";
    CorridorExitSilent "corridor-exit-silent" ["CORR-07"] "Stops outside its corridor and does not say why.";
    PlannedPathMissing "planned-path-missing" ["STATE-14"] "Plans its path and does not report it.";
    PlannedPathOfBaseOnly "planned-path-of-base-only" ["STATE-14"] "Reports the path it planned for the base only.";
    PlannedPathChanges "planned-path-changes" ["STATE-15"] "Plans anew when it enters an edge.";
    PlannedPathWithoutEnds "planned-path-without-ends" ["ORD-MSG-30"] "Reports control points that are not those of its own curve.";
    KnotsTooFew "knots-too-few" ["ORD-MSG-29"] "Leaves the last knot out of the trajectory it reports.";
    TrajectoryWithoutPoints "trajectory-without-points" ["ORD-MSG-28", "JSON-10"] "Reports the trajectory it planned without control points.";
    ZoneSetUnchecked "zone-set-unchecked" ["STATE-MSG-03"] "Takes over orders with zone sets it does not have, and goes on with its own.";

    // Maps
    UnknownMapAccepted "unknown-map-accepted" ["MAP-08"] "Accepts orders on maps it does not have.";
    DisabledMapUsed "disabled-map-used" ["MAP-13"] "Drives on maps that are disabled.";
    DownloadNeverRunning "download-never-running" ["MAP-17"] "Keeps downloadMap INITIALIZING while it downloads.";
    DownloadFinishedEarly "download-finished-early" ["MAP-18", "MAP-21", "MAP-17"] "Reports downloadMap FINISHED when the first byte arrives.";
    ManualEnableUnreported "manual-enable-unreported" ["MAP-26", "STATE-10"] "Does not report a map enabled on the vehicle.";
    HashIgnored "hash-ignored" ["MAP-34"] "Does not verify the hash of a map.";

    // Actions
    ActionsIgnored "actions-ignored" ["ACT-01", "ORD-FLOW-07", "ORD-06"] "Never begins the actions of an order.";
    UndescribedStatus "undescribed-status" ["ACT-41"] "Reports instant actions INITIALIZING that have no preparation.";
    FieldDoesNotPause "field-does-not-pause" ["ACT-34"] "Goes on with its actions while its protective field is violated.";
    FieldPauseStuck "field-pause-stuck" ["ACT-34", "ASTATE-04"] "Does not go on with its actions when its protective field is free again.";
    EdgeActionOutlivesEdge "edge-action-outlives-edge" ["ACT-02", "NODE-05"] "Lets the actions of an edge run on behind its end.";
    LastEdgeActionOutlivesEdge "last-edge-action-outlives-edge" ["NODE-05", "ACT-02"] "Ends only the first of several actions of an edge when it leaves it.";
    EdgeListCut "edge-list-cut" ["ACT-01"] "Performs only the first of several actions of an edge, and fails the others.";
    StuckAfterEdgeAction "stuck-after-edge-action" ["BLOCK-07", "ORD-06"] "Does not drive on after a blocking action of an edge.";
    EdgeConditionStays "edge-condition-stays" ["ACT-03"] "Leaves its warning lights on behind the edge that asked for them.";
    ScopeUnchecked "scope-unchecked" ["ACT-10"] "Performs actions of an order that are only for instantActions.";
    PauseTwiceFails "pause-twice-fails" ["ACT-11"] "Fails a startPause while it is paused.";
    PausesCounted "pauses-counted" ["ACT-13", "ACT-11"] "Counts its pauses, and ends them only with as many stopPause.";
    StopPauseIdleFails "stop-pause-idle-fails" ["ACT-11"] "Fails a stopPause while it is not paused.";
    PauseDrivesOn "pause-drives-on" ["ACT-12", "ACT-15"] "Drives to the next node before it pauses.";
    PauseDropsOrder "pause-drops-order" ["ACT-14"] "Gives the order up when it is paused.";
    PauseNotLifted "pause-not-lifted" ["ACT-18"] "Reports the end of a pause and does not drive on.";
    OrderEndsPause "order-ends-pause" ["ACT-12"] "Drives off with a new order although it is paused.";
    ButtonPauseOverridden "button-pause-overridden" ["ACT-16"] "Pauses and goes on by message although a switch or the button at the vehicle forbids it.";
    BlockedPauseTaken "blocked-pause-taken" ["ACT-16"] "Pauses and goes on by message although it says that it cannot.";
    InitPositionTakenAnyway "init-position-taken-anyway" ["ACT-25"] "Changes its map although it fails an initPosition.";
    InitPositionUnchecked "init-position-unchecked" ["ACT-25"] "Takes over a pose on a map it does not have.";
    TriggerNotAwaited "trigger-not-awaited" ["ACT-37"] "Ends waitForTrigger by itself.";
    TriggerGivenUp "trigger-given-up" ["ACT-37"] "Waits for a trigger for a second and a half only.";
    TriggerSkipped "trigger-skipped" ["ACT-37"] "Reports waitForTrigger FINISHED without waiting.";
    TriggerSurvivesCancel "trigger-survives-cancel" ["ACT-38"] "Reports waitForTrigger FINISHED when its order is cancelled.";
    StateRequestStuck "state-request-stuck" ["ACT-26", "IACT-04"] "Leaves stateRequest RUNNING for ever.";
    InstantActionStuck "instant-action-stuck" ["IACT-04"] "Leaves instant actions RUNNING for ever.";
    InstantActionDeferred "instant-action-deferred" ["IACT-05"] "Begins instant actions other than cancelOrder only when its order is complete.";
    UnknownInstantFinished "unknown-instant-finished" ["IACT-04", "IACT-06"] "Reports an instant action it does not know as FINISHED.";
    UnknownInstantWaits "unknown-instant-waits" ["IACT-06"] "Leaves an instant action it does not know WAITING for ever.";
    MalformedInstantDeafens "malformed-instant-deafens" ["IACT-03"] "Takes no instant actions any more once one of them was malformed.";
    MalformedInstantStopsOrder "malformed-instant-stops-order" ["ORD-06"] "Gives its order up when an instant action is malformed.";
    InstantActionFadesAway "instant-action-fades-away" ["STATE-MSG-10", "STATE-MSG-11", "STATE-MSG-09"] "Removes running instant actions from its states when another one arrives.";
    OnlyFirstInstantAction "only-first-instant-action" ["IACT-07", "IACT-03"] "Performs only the first action of an instantActions message.";

    // State
    StatesByClock "states-by-clock" ["STATE-09", "STATE-03", "STATE-06", "STATE-08"] "Sends states by the clock only, whatever happens.";
    OrderWithoutState "order-without-state" ["STATE-03"] "Does not send a state when an order arrives.";
    UpdateWithoutState "update-without-state" ["STATE-03"] "Does not send a state when an order update arrives.";
    LoadWithoutState "load-without-state" ["STATE-04", "ACT-28", "ACT-01"] "Does not send a state when its load changes.";
    ErrorWithoutState "error-without-state" ["STATE-05"] "Does not send a state when an error appears.";
    NodeWithoutState "node-without-state" ["STATE-06"] "Does not send a state when it drives over a node.";
    ModeWithoutState "mode-without-state" ["STATE-07"] "Does not send a state when its operating mode changes.";
    DrivingWithoutState "driving-without-state" ["STATE-08"] "Does not send a state when it starts or stops.";
    ActionsWithoutState "actions-without-state" ["STATE-09"] "Does not send a state when an action proceeds.";
    MapsWithoutState "maps-without-state" ["STATE-10"] "Does not send a state when its maps change.";
    StateBursts "state-bursts" ["STATE-11"] "Sends every state five times.";
    LoadForgottenWithOrder "load-forgotten-with-order" ["STATE-MSG-06", "ACT-29"] "Shows no load any more when it takes over a new order.";
    FinishedInstantForgotten "finished-instant-forgotten" ["STATE-MSG-09", "STATE-MSG-10"] "Removes instant actions from its states when they are done.";
    LastInstantActionOnly "last-instant-action-only" ["STATE-MSG-10", "STATE-MSG-09"] "Removes finished instant actions from its states when another one arrives.";
    FinishedActionsRemoved "finished-actions-removed" ["STATE-MSG-10"] "Removes actions from its states when they are done.";
    RunningInstantDropped "running-instant-dropped" ["STATE-MSG-11"] "Removes running instant actions from its states when a new order is accepted.";

    // Traversal
    TraversalSplit "traversal-split" ["NODE-03"] "Removes the node state and updates the last node in two states.";
    LastNodeStale "last-node-stale" ["NODE-03", "STATE-MSG-04", "STATE-06"] "Reports the new lastNodeId with the old lastNodeSequenceId.";
    NodeActionsEarly "node-actions-early" ["NODE-04", "ASTATE-02"] "Begins the actions of a node when it sets out for it.";
    LoopActionsEarly "loop-actions-early" ["ASTATE-02", "NODE-04"] "Performs the actions of a second visit of a node on the first.";
    EdgeActionsLate "edge-actions-late" ["NODE-06", "ACT-02"] "Begins the actions of an edge at its end.";
    EdgeActionsOnNode "edge-actions-on-node" ["NODE-07"] "Begins the actions of an edge while it is held on the node before.";

    // Action life cycle and blocking
    HorizonActionsBegun "horizon-actions-begun" ["ASTATE-02"] "Begins the actions of the horizon when it stops at the decision point.";
    PauseToWaiting "pause-to-waiting" ["ASTATE-05"] "Puts running actions back to WAITING in a pause.";
    FailsAfterFinished "fails-after-finished" ["ASTATE-06", "ORD-CANCEL-12"] "Reports finished actions FAILED when their order is cancelled.";
    ListReversed "list-reversed" ["BLOCK-01"] "Performs the actions of a node from the last to the first.";
    NoneAborted "none-aborted" ["ACT-01", "BLOCK-02"] "Breaks off the actions of type NONE of a node when it drives on.";
    SoftDrives "soft-drives" ["BLOCK-03"] "Drives while a SOFT action runs.";
    HardDrives "hard-drives" ["BLOCK-04"] "Drives while a HARD action runs.";
    HardOverlaps "hard-overlaps" ["BLOCK-05"] "Performs HARD actions beside others.";
    LastActionForgotten "last-action-forgotten" ["ACT-01"] "Never begins the last of several actions of a node.";
    HardFirst "hard-first" ["BLOCK-01", "BLOCK-06"] "Performs the HARD actions of a node before all others.";
    StuckAfterBlocking "stuck-after-blocking" ["BLOCK-07", "ORD-06", "NODE-07"] "Does not drive on after a blocking action.";

    // Errors and modes
    WarningBlocks "warning-blocks" ["ERR-03", "ORD-06", "ORD-FLOW-12"] "Does not drive while it reports a warning.";
    EmergencyStopWarning "emergency-stop-warning" ["ERR-04"] "Reports the emergency stop as a WARNING.";
    OwnErrorForgotten "own-error-forgotten" ["ERR-04", "ERR-01"] "Forgets an error of its own a moment later, although its cause is still there.";
    OwnErrorClearedByOrder "own-error-cleared-by-order" ["ERR-01"] "Forgets an error of its own with the next order, although its cause is still there.";
    OwnErrorKept "own-error-kept" ["ERR-01", "ERR-04"] "Keeps its errors for a minute, also when their cause is gone.";
    FatalDrives "fatal-drives" ["ERR-04"] "Drives on with a FATAL error.";
    OwnErrorMild "own-error-mild" ["ERR-04"] "Reports defects that keep it from running as a WARNING.";
    SemiautomaticRefused "semiautomatic-refused" ["MODE-02"] "Refuses orders in SEMIAUTOMATIC.";
    SemiautomaticEndsOrder "semiautomatic-ends-order" ["MODE-02"] "Gives its order up when it is switched from AUTOMATIC to SEMIAUTOMATIC.";
    ManualTakesOrders "manual-takes-orders" ["MODE-05", "MODE-02"] "Takes orders over in MANUAL, and drives them when it is back in AUTOMATIC.";
    ManualDrivesOrders "manual-drives-orders" ["MODE-02"] "Takes orders over in MANUAL, and drives them there.";
    ManualDrivesOn "manual-drives-on" ["MODE-05", "MODE-02"] "Keeps driving its order after it was switched to MANUAL, SERVICE or TEACHIN.";
    ManualKeepsOrder "manual-keeps-order" ["MODE-05"] "Keeps its order in MANUAL and goes on with it afterwards.";
    ManualDrivesUnseen "manual-drives-unseen" ["MODE-05"] "Clears its states in MANUAL and drives its base to the end.";
    ManualKeepsActions "manual-keeps-actions" ["MODE-05", "MODE-02"] "Clears its way in MANUAL and goes on with its actions.";
    OrderTakenUpAgain "order-taken-up-again" ["MODE-05"] "Remembers the order it gave up in MANUAL, and takes it up again when it is back in AUTOMATIC.";
    ManualLocks "manual-locks" ["MODE-02"] "Refuses the first order after it was driven by hand.";
    ManualPositionStale "manual-position-stale" ["MODE-06", "STATE-MSG-05"] "Does not follow its position in MANUAL.";
    SemiautomaticFaster "semiautomatic-faster" ["MODE-03"] "Drives faster in SEMIAUTOMATIC.";
}

/// The fault of that name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Fault> {
    FAULTS.iter().chain(BLIND_FAULTS).find(|fault| fault.name == name)
}

/// A set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Faults([u128; 8]);

impl Faults {
    /// The set of the named faults; `Err` with the first unknown name.
    pub(crate) fn named(names: &[&str]) -> Result<Self, String> {
        let mut set = Self::default();
        for name in names {
            let position = FAULTS.iter().chain(BLIND_FAULTS).position(|fault| fault.name == *name);
            let index = position.ok_or_else(|| (*name).to_owned())?;
            set.0[index / 128] |= 1 << (index % 128);
        }
        Ok(set)
    }

    /// Whether the fault is on.
    pub(crate) fn has(self, fault: FaultName) -> bool {
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

    #[test]
    fn a_set_holds_exactly_the_faults_it_was_named() {
        let set = Faults::named(&["echoes-order", "pause-stuck-after-cut"]).unwrap_or_default();
        assert!(set.has(FaultName::EchoesOrder) && set.has(FaultName::PauseStuckAfterCut));
        assert!(!set.has(FaultName::OnlineLate));
        assert_eq!(Faults::named(&["no-such"]), Err("no-such".to_owned()));
    }
}
