//! Zones as the vehicle understands them: read from a message, and where they lie (section 6.4.1).
//!
//! What becomes of a set of them stands in `zone_sets`, what the vehicle does about them on its way in `heeding`, and how it
//! asks for them in `zone_requests`. Corners are taken either way round.

use serde_json::Value;

use super::order_message::{ActionRequest, BLOCKING, Blocking, read_parameters};
use super::read::{Defect, Fields};
use tck_base::polygon::Polygon;

/// Kinds of zones this vehicle has a duty for by itself.
pub const ZONE_TYPES: [&str; 9] = [
    "BLOCKED",
    "RELEASE",
    "LINE_GUIDED",
    "SPEED_LIMIT",
    "ACTION",
    "PRIORITY",
    "PENALTY",
    "DIRECTED",
    "BIDIRECTED",
];

/// What a vehicle does when it loses what it was granted for the zone it is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ReleaseLoss {
    Stop,
    Continue,
    Evacuate,
    /// It stops, and asks for a way anew; no RELEASE zone says so.
    Anew,
}

impl ReleaseLoss {
    /// Whether it stops until something is granted again.
    pub(crate) fn stops(self) -> bool {
        matches!(self, Self::Stop | Self::Anew)
    }
}

/// How strictly a direction of travel holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Limitation {
    Soft,
    Restricted,
    Strict,
}

/// What a zone is for, and what it asks of the vehicle.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ZoneKind {
    Blocked,
    LineGuided,
    /// And what follows when the release is lost, where it says so.
    Release(Option<ReleaseLoss>),
    CoordinatedReplanning,
    /// In metres a second.
    SpeedLimit(f64),
    Action {
        entry: Vec<ActionRequest>,
        during: Vec<ActionRequest>,
        exit: Vec<ActionRequest>,
    },
    /// From 0 to 1.
    Priority(f64),
    /// From 0 to 1.
    Penalty(f64),
    /// In radians.
    Directed(f64, Limitation),
    /// In radians.
    Bidirected(f64, Limitation),
}

impl ZoneKind {
    /// The word for it.
    pub(crate) fn literal(&self) -> &'static str {
        match self {
            Self::Blocked => "BLOCKED",
            Self::LineGuided => "LINE_GUIDED",
            Self::Release(_) => "RELEASE",
            Self::CoordinatedReplanning => "COORDINATED_REPLANNING",
            Self::SpeedLimit(_) => "SPEED_LIMIT",
            Self::Action { .. } => "ACTION",
            Self::Priority(_) => "PRIORITY",
            Self::Penalty(_) => "PENALTY",
            Self::Directed(..) => "DIRECTED",
            Self::Bidirected(..) => "BIDIRECTED",
        }
    }

    /// Whether the outline of the vehicle decides that it is inside, and not its kinematic centre.
    pub(crate) fn is_of_contour(&self) -> bool {
        !matches!(
            self,
            Self::Priority(_) | Self::Penalty(_) | Self::Directed(..) | Self::Bidirected(..)
        )
    }
}

/// A zone of a set on board.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Zone {
    pub(crate) id: String,
    pub(crate) area: Polygon,
    pub(crate) kind: ZoneKind,
}

const TYPES: [&str; 10] = [
    "BLOCKED",
    "LINE_GUIDED",
    "RELEASE",
    "COORDINATED_REPLANNING",
    "SPEED_LIMIT",
    "ACTION",
    "PRIORITY",
    "PENALTY",
    "DIRECTED",
    "BIDIRECTED",
];

impl Zone {
    /// Reads one of the zones of a set.
    pub(crate) fn read(fields: &Fields<'_>) -> Result<Self, Defect> {
        let id = fields.id("zoneId")?;
        let kind = read_kind(fields)?;
        let vertices = fields.raw("vertices").unwrap_or(&Value::Null);
        let area = Polygon::read(vertices).map_err(|_| Defect {
            path: fields.at("vertices"),
            reason: "are no polygon",
        })?;
        Ok(Self { id, area, kind })
    }
}

fn read_kind(fields: &Fields<'_>) -> Result<ZoneKind, Defect> {
    let factor = |key: &str| fields.number_in(key, 0.0, 1.0);
    let limitation = |key: &str, strict: bool| {
        let all = ["SOFT", "RESTRICTED", "STRICT"];
        let known = if strict { &all[..] } else { &all[..2] };
        fields.literal(key, known).map(|index| match index {
            0 => Limitation::Soft,
            1 => Limitation::Restricted,
            _ => Limitation::Strict,
        })
    };
    Ok(match fields.literal("zoneType", &TYPES)? {
        0 => ZoneKind::Blocked,
        1 => ZoneKind::LineGuided,
        2 => {
            let loss = fields.optional("releaseLossBehavior", |fields, key| {
                fields.literal(key, &["STOP", "CONTINUE", "EVACUATE"])
            })?;
            ZoneKind::Release(loss.map(|index| match index {
                1 => ReleaseLoss::Continue,
                2 => ReleaseLoss::Evacuate,
                _ => ReleaseLoss::Stop,
            }))
        }
        3 => ZoneKind::CoordinatedReplanning,
        4 => ZoneKind::SpeedLimit(fields.number_in("maximumSpeed", 0.0, f64::MAX)?),
        5 => ZoneKind::Action {
            entry: read_actions(fields, "entryActions")?,
            during: read_actions(fields, "duringActions")?,
            exit: read_actions(fields, "exitActions")?,
        },
        6 => ZoneKind::Priority(factor("priorityFactor")?),
        7 => ZoneKind::Penalty(factor("penaltyFactor")?),
        8 => ZoneKind::Directed(fields.number("direction")?, limitation("directedLimitation", true)?),
        _ => ZoneKind::Bidirected(fields.number("direction")?, limitation("bidirectedLimitation", false)?),
    })
}

/// Reads actions of a zone, which have no actionId.
fn read_actions(fields: &Fields<'_>, key: &str) -> Result<Vec<ActionRequest>, Defect> {
    let actions = fields.objects(key)?;
    actions.iter().map(read_action).collect()
}

fn read_action(fields: &Fields<'_>) -> Result<ActionRequest, Defect> {
    Ok(ActionRequest {
        path: fields.at("actionType"),
        action_type: fields.id("actionType")?,
        id: String::new(),
        blocking: match fields.literal("blockingType", &BLOCKING)? {
            0 => Blocking::None,
            1 => Blocking::Soft,
            2 => Blocking::Hard,
            _ => Blocking::Single,
        },
        retriable: fields.optional("retriable", Fields::boolean)? == Some(true),
        parameters: read_parameters(fields)?,
    })
}
