//! The points of decision: what may be done, lasts, is said, happens and goes out.
//!
//! What the vehicle does at each stands where it does it; `hooks` is who else is asked.

use serde_json::{Map, Value};

use super::action_kinds::ActionKind;
use super::actions::{Action, Origin};
use super::certificate_set::Flaw;
use super::errors::ActiveError;
use super::objections::Objection;
use super::order_message::{Edge, Node, Order};
use super::order_state::Stop;
use super::rejection::Rule;
use super::requests::{EdgeRequest, RequestStatus};
use super::zone_requests::ZoneRequest;
use super::zone_sets::ZoneSet;
use super::zones::{ReleaseLoss, Zone};
use super::{Holds, Mode};

/// A part of a message.
#[derive(Clone, Copy)]
pub(crate) enum Part<'a> {
    /// The whole state, without header.
    State,
    /// One of nodeStates.
    Node(&'a Stop),
    /// One of edgeStates.
    Edge(&'a Edge),
    /// One of actionStates.
    Action(&'a Action),
    /// One of zoneRequests.
    ZoneRequest(&'a ZoneRequest),
    /// One of edgeRequests.
    EdgeRequest(&'a EdgeRequest),
    /// One of errors.
    Error(&'a ActiveError),
    /// agvPosition, of a state and of a visualization.
    Position,
    /// velocity, of a state and of a visualization.
    Velocity,
    /// The whole visualization, without header.
    Visualization,
    /// The whole factsheet, without header.
    Factsheet,
}

/// The header that is written.
#[derive(Clone, Copy)]
pub(crate) struct Head {
    /// Topic name.
    pub(crate) name: &'static str,
    /// It is counted; that of a last will is not.
    pub(crate) counts: bool,
}

/// Something that is allowed or not.
#[derive(Clone, Copy)]
pub(crate) enum Permission<'a> {
    /// A message of a topic name goes out at all; without header.
    Say(&'static str, &'a Map<String, Value>),
    /// ONLINE is said on a new connection (CONN-05).
    SayOnline,
    /// The factsheet is published on a new connection (FACT-01).
    SayFactsheet,
    /// It takes a message of a topic name that is meant for another vehicle; the full topic.
    HearAnother(&'a str, &'a str),
    /// DISCONNECT is sent after OFFLINE (CONN-08).
    Disconnect,
    /// A map is downloaded that is on board already (MAP-23).
    DownloadAgain,
    /// It drives at all.
    Drive,
    /// It drives although something forbids that.
    DriveAgainst(Hindrance),
    /// It drives while the action is not done (BLOCK-03, BLOCK-04).
    DriveDuring(&'a Action),
    /// It drives over an edge without stopping for one of its actions (NODE-06).
    PassOver(&'a Action),
    /// It goes on to a node (ORD-07).
    Enter,
    /// It sets out for a node that it may go on to.
    SetOut(&'a Stop),
    /// It rolls as it is turned.
    RollAsTurned,
    /// It turns the long way round.
    TurnTheLongWay,
    /// A node that was reached counts as the last one (NODE-03).
    Note(&'a Stop),
    /// The actions of an edge end because the vehicle leaves it (NODE-05).
    LeaveEdge,
    /// One of them does.
    EndWithEdge(&'a Action),
    /// The actions of the order go on.
    Act,
    /// The actions of a node or an edge are triggered (NODE-04, NODE-06).
    Trigger(Origin),
    /// Those of a node or an edge wait for an action (BLOCK-05).
    Await(&'a Action, Origin),
    /// Something that is wrong with an order is overlooked.
    Overlook(Objection<'a>),
    /// A new order may begin at a node (ORD-04, ORD-05).
    BeginAt(&'a Node),
    /// An order that is known is begun once more (ORD-REJ-13).
    BeginAgain,
    /// An action that has not ended keeps the order from being complete (ORD-FLOW-02).
    Count(&'a Action),
    /// A node that is not traversed does (ORD-FLOW-03).
    CountNode(&'a Stop),
    /// An order is under way, so that no other one is taken over (ORD-FLOW-01).
    BeBusy,
    /// An action is forgotten because of a new order (ORD-FLOW-05).
    Forget(&'a Action),
    /// An update leaves the horizon as it is (ORD-UPD-08, ORD-UPD-09).
    KeepHorizon(&'a Order),
    /// An action is forgotten with the horizon (ORD-UPD-10).
    ForgetWithHorizon,
    /// A cancelOrder that names an order leaves the one there is alone (ORD-CANCEL-25).
    LeaveOrder,
    /// It drives to its next node before a cancellation ends (ORD-CANCEL-09).
    CancelAtNode,
    /// A cancellation lasts until it has driven its way.
    CancelAwaitsWay,
    /// A cancellation lasts until an action has ended (ORD-CANCEL-06).
    CancelAwaits(&'a Action),
    /// A cancellation ends (ORD-CANCEL-07).
    EndCancel,
    /// What was triggered and not begun is forgotten with a cancellation.
    ForgetQueue,
    /// An action begins with a preparation (ASTATE-03).
    Prepare,
    /// An action goes on when one of its stages has ended.
    Proceed(&'a Action),
    /// A switch or a button forbids what a message asks for (ACT-16).
    HeedSwitch,
    /// Actions are held with the vehicle (ACT-15).
    HoldActions,
    /// Actions go on when this holds the vehicle no more (ACT-18).
    ResumeActions(Holds),
    /// An action of an instantActions message is looked at (IACT-07).
    TakeInstant,
    /// An instant action is taken that fits its kind (ACT-10).
    Fit(&'a ActionKind),
    /// A parameter that the factsheet does not list for an instant action is heeded (OPT-06).
    HeedUnlisted,
    /// An instant action that cannot be performed is refused (IACT-06).
    RefuseInstant(&'a Action),
    /// An instant action begins at once (IACT-05).
    BeginInstant(&'a Action),
    /// An instant action is RUNNING for a moment.
    TakeTime(&'a Action),
    /// It finds that it is outside its corridor on an edge, and whether that is to the left (CORR-06).
    Watch(&'a Edge, bool),
    /// It asks for the corridor of an edge (CORR-11).
    Ask(&'a Edge),
    /// A new request has a number of its own (ZREQ-04).
    CountRequest,
    /// It leaves its trajectory on an edge (CORR-15).
    UseCorridor(&'a Edge),
    /// A request stays in its states (CORR-16).
    KeepRequest,
    /// A lease that has run out ends what was granted (REQ-09).
    EndLease,
    /// It asks for anything in the mode it is in (MODE-08).
    AskForAnything,
    /// It goes into a zone that has to be released (ZONE-10).
    EnterZone(&'a Zone),
    /// It asks for a zone (ZREQ-01).
    AskForZone,
    /// It drives a way that it has asked for (ZONE-16).
    DriveWay(&'a ZoneRequest),
    /// It offers another way through a zone beside the best one (ZREQ-07).
    OfferAlternative,
    /// A request for a zone stays in its states when another one for that zone is granted (ZREQ-14).
    KeepAlternative,
    /// A request for a zone stays in its states (ZREQ-10).
    KeepZoneRequest(&'a ZoneRequest),
    /// It heeds that the release of a zone is revoked or has expired (ZREQ-11, ZREQ-12, ZREQ-13).
    HeedZoneLoss(&'a ZoneRequest, RequestStatus),
    /// It says EXPIRED before it takes a request back whose lease has run out before it went in (ZREQ-12).
    ShowExpired,
    /// It stops in a zone whose release is lost (ZONE-11).
    StayWithoutRelease(ReleaseLoss),
    /// It stops where a zone does not say what follows when its release is lost (ZONE-13).
    StopUnsaid,
    /// It goes back to its trajectory by the way it came (CORR-20).
    ReturnAsItCame,
    /// It heeds that a grant is lost (CORR-19).
    HeedLoss(&'a EdgeRequest),
    /// The path over an edge is reported (STATE-14).
    ReportPath,
    /// States are sent.
    Report,
    /// An order is kept in another mode (MODE-05).
    KeepOrder(Mode),
    /// What cannot be broken off ends before another mode is told (ORD-CLEAR-09).
    EndActions,
    /// It is moved by hand (MODE-06).
    MoveByHand,
    /// A map is enabled on the vehicle (MAP-26).
    EnableByHand,
    /// A zone set is taken over that is on board already (ZSET-13).
    TakeZoneSetAgain,
    /// A zone set is taken over with a kind of zone that it does not heed (ZSET-26).
    TakeZoneUnheeded,
    /// A zone set is taken over with a RELEASE zone that does not say what follows when its release is lost (ZONE-13).
    TakeReleaseUnsaid,
    /// A zone set is in force.
    ApplyZoneSet(&'a ZoneSet),
    /// A zone that is in force is heeded.
    HeedZone(&'a Zone),
    /// The outline decides whether it is in a zone, not the kinematic centre (ZONE-03).
    GoByContour(&'a Zone),
    /// It does not go into a zone, or through it (ZONE-05, ZONE-08, ZONE-21).
    StayOut(&'a Zone),
    /// It stops in a zone where it must not be (ZONE-06).
    StopInZone,
    /// It does what a zone asks for at its entry, inside or at its exit (ZONE-18).
    ActInZone(&'a Zone, Passage),
    /// It sees that an action of a zone breaks the rule of another one (ZINT-03).
    SeeConflict,
    /// It sets out for a node that was out of reach (ZERR-02).
    TryAgain,
    /// A zone set is in use, and not deleted (ZSET-16).
    KeepZoneSet,
    /// The hash of a file is compared with the announced one (MAP-34).
    CheckHash,
    /// A sleeping vehicle heeds what does not wake it (HIB-06).
    HeedAsleep,
    /// It sends states in its sleep (HIB-07).
    SpeakAsleep,
    /// Its order is cleared before it sleeps (HIB-04).
    ClearForSleep,
    /// It does not shut down (SHUT-01).
    RefuseShutdown,
    /// A trigger ends an action that waits for one (TRIG-01).
    HeedTrigger(&'a Action),
    /// updateCertificate is refused for a service that it does not know (CERT-02).
    RefuseService,
    /// A certificate is not fetched without TLS (CERT-03).
    RefusePlainLink,
    /// A file that is named for a certificate is fetched; the parameter (CERT-01).
    FetchForCertificate(&'static str),
    /// A certificate is not used that has a flaw (CERT-02, CERT-04).
    RefuseCertificate(Flaw),
    /// It forgets its last node when it is brought away from it (MODE-14).
    ForgetNode,
    /// An order is refused while it needs help (ERR-04).
    RefuseHelpless,
    /// A FATAL error keeps the vehicle from running (ERR-04).
    StopForDefect,
}

/// Reason for which the vehicle does not drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hindrance {
    /// The mode (MODE-02).
    Mode,
    /// A pause, the emergency stop and the like (ACT-12).
    Hold,
    /// It cannot tell where it is (STATE-MSG-19).
    Lost,
    /// The order was cancelled, or is to be (ORD-CANCEL-02).
    Cancellation,
    /// An action (BLOCK-03, BLOCK-04).
    Action,
}

/// When an action of a zone is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Passage {
    /// As the vehicle goes in.
    Entry,
    /// While it is inside.
    During,
    /// As it has left.
    Exit,
}

/// Why an error is listed.
#[derive(Clone, Copy)]
pub(crate) enum Cause<'a> {
    /// An order was refused, by a rule; the message.
    Refusal(Rule, &'a Value),
    /// A cancelOrder found no order.
    NothingToCancel,
    /// An action has failed.
    Failure(Option<&'a Action>),
    /// An instantActions message or an action in it cannot be read (IACT-03).
    Unreadable(&'a str),
    /// The vehicle is outside its corridor (CORR-07).
    Outside,
    /// A zone set was not taken over.
    ZoneSet,
    /// A zone keeps it from going on.
    Zone,
    /// The vehicle cannot tell where it is (STATE-MSG-19).
    Lost,
    /// The emergency stop is pressed.
    EmergencyStop,
    /// A part of the vehicle is not in order.
    Defect,
}

/// Something that has a length in time.
#[derive(Clone, Copy)]
pub(crate) enum Span<'a> {
    /// From one state to the next (STATE-02).
    BetweenStates,
    /// From one state to the next, as the factsheet says (FACT-14).
    StatedBetweenStates,
    /// From one state to the next at least (FACT-14).
    LeastBetweenStates,
    /// From a message to when it is looked at.
    Answer,
    /// From one visualization to the next (VIS-02).
    BetweenVisualizations,
    /// From the begin of an action to its end.
    Action(&'a Action),
}

/// Something has happened, or is about to.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Event {
    /// The broker has accepted; nothing was said yet.
    Connected,
    /// The first state on a connection is due.
    Reporting,
    /// The link broke.
    ConnectionLost,
    /// OFFLINE is said next.
    Leaving,
    /// OFFLINE was said.
    Left,
    /// An edge is entered; its actions come next.
    EdgeEntered(u32),
    /// It is on an edge.
    OnEdge,
    /// A leg has ended before the node.
    LegEnded,
    /// An edge was left.
    EdgeLeft(u32),
    /// A node is traversed; it is not the last one yet.
    NodeReached(u32),
    /// It is the last one; its actions come next.
    NodeNoted(u32),
    /// They were triggered.
    NodePassed(u32),
    /// The actions of a node or an edge are triggered next.
    Triggering(Origin),
    /// The vehicle is held, and its actions with it.
    Held,
    /// It is held no more; its actions go on next.
    Resuming,
    /// A new order was taken over.
    Begun,
    /// The nodes and edges of the horizon are gone; their actions go next.
    HorizonDropped,
    /// An update was taken over.
    Updated,
    /// An order came that was received before.
    SeenAgain,
    /// A cancellation has begun.
    CancelBegun,
    /// A cancellation ends next.
    CancelEnding,
    /// A cancellation has ended.
    Cancelled,
    /// The order was given up.
    GivenUp,
    /// A download has begun.
    DownloadRunning,
    /// A file is there; the map is stored next.
    Downloaded,
    /// A zone set was taken over.
    ZoneSetStored,
    /// instantActions were read.
    InstantsRead,
    /// An instant action cannot be read.
    InstantUnreadable,
    /// An instant action begins.
    InstantBegun,
    /// It finds itself outside its corridor.
    Strayed,
    /// The mode changes next, to this one.
    ModeChanging(Mode),
    /// The order was given up because of the mode.
    GivenUpForMode(Mode),
    /// The mode has changed, from this one.
    ModeChanged(Mode),
    /// It is told where it is; it takes that over next.
    Placed,
    /// It was driven by hand.
    DrivenByHand,
    /// It is switched off and on.
    PowerCycled,
    /// The emergency stop is released next.
    Releasing,
    /// It has fallen asleep.
    FallenAsleep,
    /// It has woken up.
    Awoken,
    /// The protective field is free next.
    FieldFreed,
    /// A state was sent.
    StateSent,
    /// Time has passed.
    Woken,
    /// All consequences were drawn.
    Settled,
}

/// A message that goes out.
#[derive(Clone, Debug)]
pub(crate) struct Outgoing {
    /// Topic name.
    pub(crate) name: &'static str,
    /// Full topic.
    pub(crate) topic: String,
    /// Its content with the header.
    pub(crate) message: Map<String, Value>,
    /// QoS.
    pub(crate) qos: u8,
    /// RETAIN.
    pub(crate) retain: bool,
    /// A state that is sent because it is time.
    pub(crate) periodic: bool,
}
