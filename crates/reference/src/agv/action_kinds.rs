//! The actions the vehicle offers: scopes, parameters, and how they behave (the tables of section 6.8).
//!
//! One table feeds the factsheet (FACT-07), the check of orders and instant actions (ACT-10, IACT-06), and the life
//! cycle (section 6.11).

use serde_json::Value;

use super::config::AgvConfig;
use super::order_message::ActionRequest;

/// Scope in which an action may be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scope {
    Instant,
    Node,
    Edge,
    Zone,
}

impl Scope {
    /// The literal of the factsheet.
    pub(crate) fn literal(self) -> &'static str {
        match self {
            Self::Instant => "INSTANT",
            Self::Node => "NODE",
            Self::Edge => "EDGE",
            Self::Zone => "ZONE",
        }
    }
}

/// Effect an action has when it ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    StartPause,
    StopPause,
    StartCharging,
    StopCharging,
    InitPosition,
    EnableMap,
    DownloadMap,
    DeleteMap,
    EnableZoneSet,
    DownloadZoneSet,
    DeleteZoneSet,
    ClearZoneActions,
    StateRequest,
    LogReport,
    Pick,
    Drop,
    DetectObject,
    FinePositioning,
    WaitForTrigger,
    Trigger,
    StartHibernation,
    StopHibernation,
    Shutdown,
    UpdateCertificate,
    CancelOrder,
    ClearInstantActions,
    Retry,
    SkipRetry,
    FactsheetRequest,
    WarningLights,
    Beep,
    Calibrate,
}

/// A parameter of an action.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parameter {
    pub(crate) key: &'static str,
    /// valueDataType of the factsheet.
    pub(crate) data_type: &'static str,
    pub(crate) optional: bool,
}

/// One action the vehicle offers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActionKind {
    pub(crate) name: &'static str,
    pub(crate) effect: Effect,
    pub(crate) scopes: &'static [Scope],
    pub(crate) parameters: &'static [Parameter],
    /// Has a preparation, reported as INITIALIZING.
    pub(crate) prepares: bool,
    /// Can be held, reported as PAUSED.
    pub(crate) pausable: bool,
    /// Takes time also as an instant action.
    pub(crate) lasting: bool,
    pub(crate) description: &'static str,
    /// resultDescription of the factsheet.
    pub(crate) result: Option<&'static str>,
}

const fn required(key: &'static str, data_type: &'static str) -> Parameter {
    Parameter {
        key,
        data_type,
        optional: false,
    }
}

const fn optional(key: &'static str, data_type: &'static str) -> Parameter {
    Parameter {
        key,
        data_type,
        optional: true,
    }
}

const INSTANT: &[Scope] = &[Scope::Instant];
const INSTANT_NODE: &[Scope] = &[Scope::Instant, Scope::Node];
const EDGE: &[Scope] = &[Scope::Edge];
const NODE_EDGE: &[Scope] = &[Scope::Node, Scope::Edge];
const NODE_EDGE_ZONE: &[Scope] = &[Scope::Node, Scope::Edge, Scope::Zone];
const NODE_ZONE: &[Scope] = &[Scope::Node, Scope::Zone];
const ALL: &[Scope] = &[Scope::Instant, Scope::Node, Scope::Edge, Scope::Zone];
const MAP: &[Parameter] = &[required("mapId", "STRING"), required("mapVersion", "STRING")];
const DURATION: &[Parameter] = &[optional("duration", "NUMBER")];

/// Highest lift in metres; a pick or drop above it cannot be performed.
pub(crate) const MAX_HEIGHT: f64 = 2.0;

const PICK: &[Parameter] = &[
    required("stationType", "STRING"),
    required("loadType", "STRING"),
    optional("lhd", "STRING"),
    optional("stationName", "STRING"),
    optional("loadId", "STRING"),
    optional("height", "FLOAT"),
    optional("depth", "FLOAT"),
    optional("side", "STRING"),
];
const DROP: &[Parameter] = &[
    optional("stationType", "STRING"),
    optional("loadType", "STRING"),
    optional("lhd", "STRING"),
    optional("stationName", "STRING"),
    optional("loadId", "STRING"),
    optional("height", "FLOAT"),
    optional("depth", "FLOAT"),
];
const POSE: &[Parameter] = &[
    required("x", "FLOAT"),
    required("y", "FLOAT"),
    required("theta", "FLOAT"),
    required("mapId", "STRING"),
    required("lastNodeId", "STRING"),
];
const DOWNLOAD: &[Parameter] = &[
    required("mapId", "STRING"),
    required("mapVersion", "STRING"),
    required("mapDownloadLink", "STRING"),
    optional("mapHash", "STRING"),
];
const ZONE_SET: &[Parameter] = &[required("zoneSetId", "STRING")];
const DOWNLOAD_ZONE_SET: &[Parameter] = &[
    required("zoneSetId", "STRING"),
    required("zoneSetDownloadLink", "STRING"),
    optional("zoneSetHash", "STRING"),
];
const NAMED: &[Parameter] = &[required("actionId", "STRING")];
const CERTIFICATE: &[Parameter] = &[
    required("service", "STRING"),
    required("keyDownloadLink", "STRING"),
    required("certificateDownloadLink", "STRING"),
    optional("certificateAuthorityDownloadLink", "STRING"),
];
const STATION: &[Parameter] = &[optional("stationType", "STRING"), optional("stationName", "STRING")];

const fn kind(
    name: &'static str,
    effect: Effect,
    scopes: &'static [Scope],
    parameters: &'static [Parameter],
    description: &'static str,
) -> ActionKind {
    ActionKind {
        name,
        effect,
        scopes,
        parameters,
        prepares: false,
        pausable: false,
        lasting: false,
        description,
        result: None,
    }
}

impl ActionKind {
    const fn preparing(mut self) -> Self {
        self.prepares = true;
        self
    }

    const fn pausing(mut self) -> Self {
        self.pausable = true;
        self
    }

    const fn taking_time(mut self) -> Self {
        self.lasting = true;
        self
    }

    /// Whether a parameter of it is a list.
    fn takes_a_list(&self) -> bool {
        self.parameters.iter().any(|parameter| parameter.data_type == "ARRAY")
    }

    const fn resulting(mut self, result: &'static str) -> Self {
        self.result = Some(result);
        self
    }
}

/// All actions, in the order of the factsheet.
const KINDS: [ActionKind; 29] = [
    kind(
        "startPause",
        Effect::StartPause,
        INSTANT,
        &[],
        "Stops driving and holds actions",
    ),
    kind("stopPause", Effect::StopPause, INSTANT, &[], "Goes on after a pause"),
    kind(
        "startCharging",
        Effect::StartCharging,
        INSTANT_NODE,
        &[],
        "Connects to the charger",
    )
    .taking_time(),
    kind(
        "stopCharging",
        Effect::StopCharging,
        INSTANT_NODE,
        &[],
        "Disconnects from the charger",
    )
    .taking_time(),
    kind(
        "initPosition",
        Effect::InitPosition,
        INSTANT_NODE,
        POSE,
        "Takes over a pose",
    ),
    kind(
        "enableMap",
        Effect::EnableMap,
        INSTANT_NODE,
        MAP,
        "Enables a map on board",
    ),
    kind(
        "downloadMap",
        Effect::DownloadMap,
        INSTANT,
        DOWNLOAD,
        "Fetches a map; mapHash is SHA-256 in hexadecimal",
    ),
    kind("deleteMap", Effect::DeleteMap, INSTANT, MAP, "Removes a map"),
    kind("stateRequest", Effect::StateRequest, INSTANT, &[], "Sends a state"),
    kind(
        "logReport",
        Effect::LogReport,
        INSTANT,
        &[required("reason", "STRING")],
        "Stores a log",
    )
    .taking_time()
    .resulting("Name of the log"),
    kind("pick", Effect::Pick, NODE_EDGE, PICK, "Takes a load")
        .preparing()
        .pausing(),
    kind("drop", Effect::Drop, NODE_EDGE, DROP, "Puts the load down")
        .preparing()
        .pausing(),
    kind(
        "detectObject",
        Effect::DetectObject,
        NODE_EDGE_ZONE,
        &[optional("objectType", "STRING")],
        "Looks for an object",
    )
    .resulting("What was detected"),
    kind(
        "finePositioning",
        Effect::FinePositioning,
        NODE_EDGE_ZONE,
        STATION,
        "Aligns to a station",
    )
    .pausing(),
    kind(
        "waitForTrigger",
        Effect::WaitForTrigger,
        NODE_ZONE,
        &[required("triggerType", "STRING")],
        "Waits for the button on the vehicle",
    ),
    kind(
        "waitForTrigger",
        Effect::WaitForTrigger,
        NODE_ZONE,
        &[required("triggerType", "ARRAY")],
        "Waits for the button on the vehicle, or for the fleet control",
    ),
    kind(
        "trigger",
        Effect::Trigger,
        INSTANT,
        &[],
        "Ends what waits for the fleet control",
    ),
    kind(
        "startHibernation",
        Effect::StartHibernation,
        INSTANT,
        &[optional("wakeUpTime", "STRING")],
        "Clears the order and sleeps; wakeUpTime is a timestamp",
    ),
    kind(
        "stopHibernation",
        Effect::StopHibernation,
        INSTANT,
        &[],
        "Wakes the vehicle up",
    ),
    kind("shutdown", Effect::Shutdown, INSTANT, &[], "Switches the vehicle off"),
    kind(
        "updateCertificate",
        Effect::UpdateCertificate,
        INSTANT,
        CERTIFICATE,
        "Fetches a certificate with its key and uses it from then on",
    ),
    kind("cancelOrder", Effect::CancelOrder, INSTANT, &[], "Gives the order up"),
    kind(
        "clearInstantActions",
        Effect::ClearInstantActions,
        INSTANT_NODE,
        &[],
        "Removes instant actions that have ended from their list",
    ),
    kind(
        "retry",
        Effect::Retry,
        INSTANT,
        NAMED,
        "Tries an action again that has failed",
    ),
    kind(
        "skipRetry",
        Effect::SkipRetry,
        INSTANT,
        NAMED,
        "Lets an action fail that could be tried again",
    ),
    kind(
        "factsheetRequest",
        Effect::FactsheetRequest,
        INSTANT,
        &[],
        "Sends the factsheet",
    ),
    kind(
        "warningLights",
        Effect::WarningLights,
        EDGE,
        &[],
        "Flashes as long as the vehicle is on the edge",
    ),
    kind(
        "beep",
        Effect::Beep,
        ALL,
        DURATION,
        "Sounds the horn, for `duration` seconds",
    )
    .pausing()
    .taking_time(),
    kind(
        "calibrate",
        Effect::Calibrate,
        ALL,
        DURATION,
        "Calibrates sensors; cannot be interrupted",
    )
    .taking_time(),
];

/// The actions about zones, behind the others.
const ZONE_KINDS: [ActionKind; 4] = [
    kind(
        "enableZoneSet",
        Effect::EnableZoneSet,
        INSTANT_NODE,
        ZONE_SET,
        "Enables a zone set on board",
    ),
    kind(
        "downloadZoneSet",
        Effect::DownloadZoneSet,
        INSTANT,
        DOWNLOAD_ZONE_SET,
        "Fetches a zone set as JSON; zoneSetHash is SHA-256 in hexadecimal",
    ),
    kind(
        "deleteZoneSet",
        Effect::DeleteZoneSet,
        INSTANT,
        ZONE_SET,
        "Removes a zone set",
    ),
    kind(
        "clearZoneActions",
        Effect::ClearZoneActions,
        INSTANT_NODE,
        &[],
        "Removes actions of zones that have ended from their list",
    ),
];

/// The actions this vehicle offers.
pub(crate) fn offered(config: &AgvConfig) -> impl Iterator<Item = &'static ActionKind> {
    let all = KINDS.iter().chain(&ZONE_KINDS);
    all.filter(|kind| is_offered(config, kind))
}

fn is_offered(config: &AgvConfig, kind: &ActionKind) -> bool {
    let in_version = match kind.effect {
        Effect::EnableMap | Effect::DownloadMap | Effect::DeleteMap => config.has("mapActions"),
        Effect::EnableZoneSet | Effect::DownloadZoneSet | Effect::DeleteZoneSet => config.heeds_zones(),
        Effect::ClearZoneActions => config.heeds("ACTION"),
        Effect::FactsheetRequest => config.has("factsheetRequest"),
        Effect::ClearInstantActions => config.has("instantActionStates"),
        Effect::Retry | Effect::SkipRetry => config.has("retry"),
        Effect::Trigger => config.has("triggers"),
        Effect::WaitForTrigger => config.has("triggers") == kind.takes_a_list(),
        Effect::StartHibernation | Effect::StopHibernation | Effect::Shutdown => config.has("hibernation"),
        Effect::UpdateCertificate => cfg!(feature = "tls") && config.has("certificates"),
        _ => true,
    };
    in_version && !config.without_actions.contains(kind.name)
}

/// The offered action of that name.
pub(crate) fn find(config: &AgvConfig, name: &str) -> Option<&'static ActionKind> {
    offered(config).find(|kind| kind.name == name)
}

/// Why an action cannot be performed as asked; a path or key and a reason.
pub(crate) fn refusal(
    kind: &ActionKind,
    request: &ActionRequest,
    config: &AgvConfig,
    strict: bool,
) -> Option<(String, &'static str)> {
    for parameter in kind.parameters {
        match request.parameter(parameter.key) {
            None if parameter.optional => {}
            None => return Some((parameter.key.to_owned(), "required parameter is missing")),
            Some(value) if !fits(parameter.data_type, value) => {
                return Some((parameter.key.to_owned(), "parameter has the wrong type"));
            }
            Some(_) => {}
        }
    }
    if strict {
        // No factsheet lists this one.
        let named = kind.effect == Effect::CancelOrder;
        let known =
            |key: &str| kind.parameters.iter().any(|parameter| parameter.key == key) || named && key == "orderId";
        if let Some((key, _)) = request.parameters.iter().find(|(key, _)| !known(key)) {
            return Some((key.clone(), "parameter is unknown"));
        }
    }
    let negative = |key: &str| {
        request
            .parameter(key)
            .and_then(Value::as_f64)
            .is_some_and(|value| value < 0.0)
    };
    if negative("duration") || negative("height") {
        return Some(("duration".to_owned(), "parameter is negative"));
    }
    if matches!(kind.effect, Effect::Pick | Effect::Drop) {
        if request
            .parameter("height")
            .and_then(Value::as_f64)
            .is_some_and(|height| height > MAX_HEIGHT)
        {
            return Some(("height".to_owned(), "is higher than the vehicle can lift"));
        }
        if request
            .parameter("lhd")
            .is_some_and(|lhd| !config.load_positions.iter().any(|name| lhd == name))
        {
            return Some(("lhd".to_owned(), "is no load handling device of the vehicle"));
        }
    }
    None
}

fn fits(data_type: &str, value: &Value) -> bool {
    match data_type {
        "STRING" => value.is_string(),
        "ARRAY" => value.is_array(),
        _ => value.is_number(),
    }
}
