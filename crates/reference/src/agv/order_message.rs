//! The order message as the vehicle understands it, read from JSON (section 6.6.6; flow step 1: format and types).
//!
//! An order whose nodes, edges and release flags do not fit together is as malformed as one that cannot be read (the
//! ruling of ORD-11).

use serde_json::Value;

use super::read::{Defect, Fields};
use tck_base::nurbs::{Curve, Flaw, Path};

/// Slack for angles written with few digits, such as 3.1416.
const ANGLE: f64 = std::f64::consts::PI + 0.01;

/// Coordinates beyond this are no place on earth, in metres.
const FARTHEST: f64 = 1e8;

/// blockingType: what may go on beside an action (section 6.12).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Blocking {
    /// Driving and other actions.
    None,
    /// Driving, no other actions.
    Single,
    /// Other actions, no driving.
    Soft,
    /// Nothing.
    Hard,
}

impl Blocking {
    /// Whether the vehicle may drive meanwhile.
    pub(crate) fn lets_drive(self) -> bool {
        matches!(self, Self::None | Self::Single)
    }

    /// Whether other actions may run beside it.
    pub(crate) fn shares(self) -> bool {
        matches!(self, Self::None | Self::Soft)
    }
}

/// The words for them.
pub(crate) const BLOCKING: [&str; 4] = ["NONE", "SOFT", "HARD", "SINGLE"];

/// An action that was asked for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ActionRequest {
    pub(crate) path: String,
    pub(crate) action_type: String,
    pub(crate) id: String,
    pub(crate) blocking: Blocking,
    /// Whether it may be tried again when it has failed.
    pub(crate) retriable: bool,
    pub(crate) parameters: Vec<(String, Value)>,
}

impl ActionRequest {
    /// The value of a parameter.
    pub(crate) fn parameter(&self, key: &str) -> Option<&Value> {
        self.parameters
            .iter()
            .find(|(name, _)| name == key)
            .map(|(_, value)| value)
    }

    /// Reads an action of an order, where every required field must be right.
    pub(crate) fn read(fields: &Fields<'_>) -> Result<Self, Defect> {
        let blocking = match fields.literal("blockingType", &BLOCKING)? {
            0 => Blocking::None,
            1 => Blocking::Soft,
            2 => Blocking::Hard,
            _ => Blocking::Single,
        };
        fields.optional("actionDescription", Fields::prose)?;
        Ok(Self {
            path: fields.at("actionType"),
            action_type: fields.id("actionType")?,
            id: fields.id("actionId")?,
            blocking,
            retriable: fields.optional("retriable", Fields::boolean)? == Some(true),
            parameters: read_parameters(fields)?,
        })
    }
}

/// Reads the optional list of key and value objects.
pub(crate) fn read_parameters(fields: &Fields<'_>) -> Result<Vec<(String, Value)>, Defect> {
    if !fields.has("actionParameters") {
        return Ok(Vec::new());
    }
    let mut parameters = Vec::new();
    for parameter in fields.objects("actionParameters")? {
        let value = match parameter.raw("value") {
            Some(value) if !value.is_null() => value.clone(),
            _ => {
                return Err(Defect {
                    path: parameter.at("value"),
                    reason: "is missing",
                });
            }
        };
        parameters.push((parameter.id("key")?, value));
    }
    Ok(parameters)
}

/// nodePosition.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Position {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) theta: Option<f64>,
    pub(crate) allowed_deviation: Option<f64>,
    pub(crate) allowed_deviation_theta: Option<f64>,
    pub(crate) map_id: String,
}

impl Position {
    fn read(value: &Value, path: &str) -> Result<Self, Defect> {
        let fields = Fields::open(value, path)?;
        fields.optional("mapDescription", Fields::prose)?;
        Ok(Self {
            x: fields.number_in("x", -FARTHEST, FARTHEST)?,
            y: fields.number_in("y", -FARTHEST, FARTHEST)?,
            theta: fields.optional("theta", |fields, key| fields.number_in(key, -ANGLE, ANGLE))?,
            allowed_deviation: fields
                .optional("allowedDeviationXY", |fields, key| fields.number_in(key, 0.0, f64::MAX))?,
            allowed_deviation_theta: fields
                .optional("allowedDeviationTheta", |fields, key| fields.number_in(key, 0.0, ANGLE))?,
            map_id: fields.id("mapId")?,
        })
    }
}

/// A node of an order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) path: String,
    pub(crate) id: String,
    pub(crate) sequence_id: u32,
    pub(crate) released: bool,
    pub(crate) position: Option<Position>,
    /// nodePosition as it was sent, to be repeated in the state.
    pub(crate) sent_position: Option<Value>,
    pub(crate) actions: Vec<ActionRequest>,
}

/// releaseLossBehavior of a corridor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Loss {
    /// Stands where it is.
    Stop,
    /// Goes back to its trajectory by the way it came.
    Return,
}

/// edge.corridor: how far the vehicle may leave its trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Corridor {
    /// Metres to the left.
    pub(crate) left: f64,
    /// Metres to the right.
    pub(crate) right: f64,
    /// The whole contour has to stay inside, not the kinematic centre alone.
    pub(crate) contour: bool,
    /// It has to be asked for.
    pub(crate) release_required: bool,
    /// What follows when its release is lost on the way.
    pub(crate) loss: Loss,
}

impl Corridor {
    fn read(value: &Value, path: &str) -> Result<Self, Defect> {
        let fields = Fields::open(value, path)?;
        let point = fields.optional("corridorRefPoint", |fields, key| {
            fields.literal(key, &["KINEMATICCENTER", "CONTOUR"])
        })?;
        Ok(Self {
            left: fields.number_in("leftWidth", 0.0, FARTHEST)?,
            right: fields.number_in("rightWidth", 0.0, FARTHEST)?,
            contour: point == Some(1),
            release_required: fields.optional("releaseRequired", Fields::boolean)? == Some(true),
            loss: match fields.optional("releaseLossBehavior", |fields, key| {
                fields.literal(key, &["STOP", "RETURN"])
            })? {
                Some(1) => Loss::Return,
                _ => Loss::Stop,
            },
        })
    }
}

/// edge.trajectory: what was sent, and the path it means.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Trajectory {
    pub(crate) sent: Value,
    /// Whether it has no knotVector, for which there is a usual one in some versions.
    pub(crate) lacks_knots: bool,
    pub(crate) path: Path,
}

impl Trajectory {
    fn read(value: &Value, path: &str) -> Result<Self, Defect> {
        let (curve, flaws) = Curve::read(value);
        let wrong = !flaws.iter().all(Flaw::has_default);
        match curve.filter(|_| !wrong) {
            Some(curve) => Ok(Self {
                sent: value.clone(),
                lacks_knots: flaws.contains(&Flaw::KnotsMissing),
                path: curve.path(),
            }),
            None => Err(Defect::no_curve(path)),
        }
    }
}

/// An edge of an order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Edge {
    pub(crate) path: String,
    pub(crate) id: String,
    pub(crate) sequence_id: u32,
    pub(crate) released: bool,
    pub(crate) start: String,
    pub(crate) end: String,
    pub(crate) max_speed: Option<f64>,
    pub(crate) max_height: Option<f64>,
    pub(crate) max_rotation_speed: Option<f64>,
    pub(crate) orientation: Option<f64>,
    /// orientationType GLOBAL.
    pub(crate) global: bool,
    /// rotationAllowed, or that reachOrientationBeforeEntering does not ask for the turn before the edge.
    pub(crate) rotation_allowed: Option<bool>,
    pub(crate) trajectory: Option<Trajectory>,
    pub(crate) corridor: Option<Corridor>,
    pub(crate) direction: Option<String>,
    pub(crate) actions: Vec<ActionRequest>,
}

/// An order message of right format.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Order {
    pub(crate) id: String,
    pub(crate) update_id: u32,
    pub(crate) nodes: Vec<Node>,
    pub(crate) edges: Vec<Edge>,
    /// zoneSetId.
    pub(crate) zone_set: Option<String>,
    /// Paths of optional fields that not every vehicle has a use for (OPT-02).
    pub(crate) unsupported: Vec<String>,
    /// Defects of these fields, for a vehicle that has a use for them.
    pub(crate) defects: Vec<Defect>,
}

/// Optional fields of an edge that not every vehicle can use.
const SPECIAL_EDGE_FIELDS: [&str; 4] = ["trajectory", "corridor", "direction", "minHeight"];

impl Order {
    /// Reads an order; `Err` if its format or a type is wrong (ORD-REJ-01).
    pub(crate) fn read(message: &Value) -> Result<Self, Defect> {
        let fields = Fields::open(message, "")?;
        read_header(&fields)?;
        let mut unsupported = Vec::new();
        let mut defects = Vec::new();
        let zone_set = fields.optional("zoneSetId", Fields::text)?.map(str::to_owned);
        let nodes = fields
            .objects("nodes")?
            .iter()
            .map(read_node)
            .collect::<Result<Vec<_>, _>>()?;
        let edges = fields
            .objects("edges")?
            .iter()
            .map(|edge| read_edge(edge, &mut unsupported, &mut defects))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            id: fields.id("orderId")?,
            update_id: fields.uint32("orderUpdateId")?,
            nodes,
            edges,
            zone_set,
            unsupported,
            defects,
        })
    }

    /// The rules between the elements: counts, numbering, neighbours and releases (ORD-11).
    pub(crate) fn graph_defect(&self) -> Option<Defect> {
        let defect = |path: String, reason| Some(Defect { path, reason });
        let Some(first) = self.nodes.first() else {
            return defect("nodes".into(), "is empty");
        };
        if self.edges.len() + 1 != self.nodes.len() {
            return defect("edges".into(), "are not one less than the nodes");
        }
        if !first.released {
            return defect(format!("{}.released", first.path), "is false on the first node");
        }
        for (index, edge) in self.edges.iter().enumerate() {
            let (from, to) = (&self.nodes[index], &self.nodes[index + 1]);
            if Some(edge.sequence_id) != from.sequence_id.checked_add(1) {
                return defect(format!("{}.sequenceId", edge.path), "does not follow its start node");
            }
            if Some(to.sequence_id) != edge.sequence_id.checked_add(1) {
                return defect(format!("{}.sequenceId", to.path), "does not follow the edge before");
            }
            if edge.start != from.id {
                return defect(format!("{}.startNodeId", edge.path), "is not the node before");
            }
            if edge.end != to.id {
                return defect(format!("{}.endNodeId", edge.path), "is not the node behind");
            }
            if edge.released != to.released {
                return defect(format!("{}.released", edge.path), "differs from its end node");
            }
            if to.released && !from.released {
                return defect(format!("{}.released", to.path), "is true behind the horizon's begin");
            }
        }
        None
    }

    /// What it says, without header and ids.
    pub(crate) fn content(&self) -> (Vec<Node>, Vec<Edge>) {
        (self.nodes.clone(), self.edges.clone())
    }

    /// All actions of nodes and edges.
    pub(crate) fn actions(&self) -> impl Iterator<Item = &ActionRequest> {
        let nodes = self.nodes.iter().flat_map(|node| &node.actions);
        nodes.chain(self.edges.iter().flat_map(|edge| &edge.actions))
    }
}

/// The header must be there and typed; whom it names is not judged (a fleet may bridge names).
fn read_header(fields: &Fields<'_>) -> Result<(), Defect> {
    fields.uint32("headerId")?;
    for key in ["timestamp", "version", "manufacturer", "serialNumber"] {
        fields.text(key)?;
    }
    Ok(())
}

fn read_actions(fields: &Fields<'_>) -> Result<Vec<ActionRequest>, Defect> {
    fields.objects("actions")?.iter().map(ActionRequest::read).collect()
}

fn read_node(fields: &Fields<'_>) -> Result<Node, Defect> {
    fields.optional("nodeDescription", Fields::prose)?;
    let sent_position = fields.raw("nodePosition").cloned();
    let position = fields
        .raw("nodePosition")
        .map(|value| Position::read(value, &fields.at("nodePosition")))
        .transpose()?;
    Ok(Node {
        path: fields.at("").trim_end_matches('.').to_owned(),
        id: fields.id("nodeId")?,
        sequence_id: fields.uint32("sequenceId")?,
        released: fields.boolean("released")?,
        position,
        sent_position,
        actions: read_actions(fields)?,
    })
}

fn read_edge(fields: &Fields<'_>, unsupported: &mut Vec<String>, defects: &mut Vec<Defect>) -> Result<Edge, Defect> {
    fields.optional("edgeDescription", Fields::prose)?;
    fields.optional("length", |fields, key| fields.number_in(key, 0.0, f64::MAX))?;
    for key in SPECIAL_EDGE_FIELDS {
        if fields.has(key) {
            unsupported.push(fields.at(key));
        }
    }
    let global = fields
        .optional("orientationType", |fields, key| {
            fields.literal(key, &["TANGENTIAL", "GLOBAL"])
        })?
        .is_some_and(|index| index == 1);
    let before = fields.optional("reachOrientationBeforeEntering", Fields::boolean)?;
    let limit = |fields: &Fields<'_>, key: &str| fields.number_in(key, 0.0, f64::MAX);
    Ok(Edge {
        path: fields.at("").trim_end_matches('.').to_owned(),
        id: fields.id("edgeId")?,
        sequence_id: fields.uint32("sequenceId")?,
        released: fields.boolean("released")?,
        start: fields.id("startNodeId")?,
        end: fields.id("endNodeId")?,
        max_speed: fields.optional("maxSpeed", limit)?,
        max_height: fields.optional("maxHeight", limit)?,
        max_rotation_speed: fields.optional("maxRotationSpeed", limit)?,
        orientation: fields.optional("orientation", Fields::number)?,
        global,
        rotation_allowed: fields
            .optional("rotationAllowed", Fields::boolean)?
            .or(before.map(|before| !before)),
        trajectory: part(fields, "trajectory", Trajectory::read, defects),
        corridor: part(fields, "corridor", Corridor::read, defects),
        direction: fields.optional("direction", Fields::text)?.map(str::to_owned),
        actions: read_actions(fields)?,
    })
}

/// An optional object of an edge.
fn part<T>(
    fields: &Fields<'_>,
    key: &str,
    read: fn(&Value, &str) -> Result<T, Defect>,
    defects: &mut Vec<Defect>,
) -> Option<T> {
    let value = fields.raw(key)?;
    read(value, &fields.at(key)).map_err(|defect| defects.push(defect)).ok()
}
