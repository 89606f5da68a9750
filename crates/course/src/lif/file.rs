//! The words of a layout file: those of LIF 1.0, and those of the drafts of LIF 2 where they say the same.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use crate::demand::Demand;

/// Members with a name that nothing here knows.
type Unknown = BTreeMap<String, Value>;

/// Members that say nothing about driving, beside those whose names end like names for people.
const NOT_FOR_DRIVING: [&str; 2] = ["layoutVersion", "layoutLevelId"];

#[derive(Deserialize)]
pub(super) struct File {
    layouts: Option<Vec<FileLayout>>,
    origins: Option<Vec<Origin>>,
}

/// Layouts that share the origin of their coordinates (LIF 2).
#[derive(Deserialize)]
struct Origin {
    layouts: Vec<FileLayout>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct FileLayout {
    pub layout_id: String,
    pub nodes: Vec<FileNode>,
    pub edges: Vec<FileEdge>,
    #[serde(default)]
    pub stations: Vec<Station>,
    #[serde(flatten)]
    pub unknown: Unknown,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct FileNode {
    pub node_id: String,
    pub map_id: Option<String>,
    pub node_position: Position,
    #[serde(alias = "mobileRobotTypeNodeProperties")]
    pub vehicle_type_node_properties: Vec<NodeProperties>,
    #[serde(flatten)]
    pub unknown: Unknown,
}

#[derive(Deserialize)]
pub(super) struct Position {
    pub x: f64,
    pub y: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct NodeProperties {
    #[serde(alias = "mobileRobotTypeId")]
    vehicle_type_id: Option<String>,
    #[serde(alias = "mobileRobotTypeIds")]
    vehicle_type_ids: Option<Vec<String>>,
    mobile_robot_types: Option<Vec<RobotType>>,
    pub theta: Option<f64>,
    pub load_restriction: Option<LoadRestriction>,
    #[serde(default)]
    actions: Vec<Action>,
    #[serde(default)]
    required_actions: Vec<Action>,
    #[serde(default)]
    feasible_actions: Vec<Action>,
    #[serde(flatten)]
    pub unknown: Unknown,
}

/// A type of vehicle as the later drafts of LIF 2 name it.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct RobotType {
    manufacturer: String,
    #[serde(alias = "series")]
    series_name: String,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Action {
    #[serde(rename = "actionType")]
    name: String,
    requirement_type: Option<String>,
    /// What a draft of LIF 2 has in the place of `requirementType`.
    required: Option<bool>,
    blocking_type: Option<String>,
    #[serde(default, rename = "actionParameters")]
    parameters: Vec<Parameter>,
}

#[derive(Deserialize)]
struct Parameter {
    key: String,
    value: Value,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct FileEdge {
    pub edge_id: String,
    pub start_node_id: String,
    pub end_node_id: String,
    #[serde(alias = "mobileRobotTypeEdgeProperties")]
    pub vehicle_type_edge_properties: Vec<EdgeProperties>,
    #[serde(flatten)]
    pub unknown: Unknown,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct EdgeProperties {
    #[serde(alias = "mobileRobotTypeId")]
    vehicle_type_id: Option<String>,
    #[serde(alias = "mobileRobotTypeIds")]
    vehicle_type_ids: Option<Vec<String>>,
    mobile_robot_types: Option<Vec<RobotType>>,
    vehicle_orientation: Option<f64>,
    #[serde(alias = "mobileRobotOrientations")]
    vehicle_orientations: Option<Vec<f64>>,
    pub orientation_type: Option<String>,
    rotation_allowed: Option<bool>,
    reach_orientation_before_entering: Option<bool>,
    pub rotation_at_start_node_allowed: Option<String>,
    pub rotation_at_end_node_allowed: Option<String>,
    #[serde(alias = "maximumSpeed")]
    pub max_speed: Option<f64>,
    #[serde(alias = "maximumRotationSpeed")]
    pub max_rotation_speed: Option<f64>,
    #[serde(alias = "minimumLoadHandlingDeviceHeight")]
    pub min_height: Option<f64>,
    #[serde(alias = "maximumMobileRobotHeight")]
    pub max_height: Option<f64>,
    pub load_restriction: Option<LoadRestriction>,
    #[serde(default)]
    actions: Vec<Action>,
    #[serde(default)]
    required_actions: Vec<Action>,
    #[serde(default)]
    feasible_actions: Vec<Action>,
    trajectory: Option<Value>,
    pub physical_line_guided_property: Option<Line>,
    #[serde(flatten)]
    pub unknown: Unknown,
}

#[derive(Deserialize)]
pub(super) struct LoadRestriction {
    pub unloaded: bool,
}

/// What a line-guided vehicle is told (LIF 2).
#[derive(Deserialize)]
pub(super) struct Line {
    pub direction: Option<String>,
    #[serde(flatten)]
    pub unknown: Unknown,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Station {
    pub interaction_node_ids: Vec<String>,
}

/// Whether a master control has to send an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Requirement {
    /// With every order.
    Required,
    /// As the parties have agreed.
    Conditional,
    /// As it likes.
    Optional,
}

impl Requirement {
    /// In words.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Required => "required",
            Self::Conditional => "conditional",
            Self::Optional => "optional",
        }
    }
}

impl File {
    /// Whether it is a file of layouts at all.
    pub(super) fn has_layouts(&self) -> bool {
        self.layouts.is_some() || self.origins.is_some()
    }

    /// All layouts of the file, whatever origin they have.
    pub(super) fn layouts(&self) -> impl Iterator<Item = &FileLayout> {
        let of_origins = self.origins.iter().flatten().flat_map(|origin| &origin.layouts);
        self.layouts.iter().flatten().chain(of_origins)
    }
}

impl NodeProperties {
    /// The types of vehicle that these properties are for.
    pub(super) fn types(&self) -> Vec<String> {
        types(
            self.vehicle_type_id.as_ref(),
            self.vehicle_type_ids.as_ref(),
            self.mobile_robot_types.as_ref(),
        )
    }

    /// The actions of the node.
    pub(super) fn actions(&self) -> Vec<(Requirement, Demand)> {
        actions(&self.actions, &self.required_actions, &self.feasible_actions)
    }
}

impl EdgeProperties {
    /// The types of vehicle that these properties are for.
    pub(super) fn types(&self) -> Vec<String> {
        types(
            self.vehicle_type_id.as_ref(),
            self.vehicle_type_ids.as_ref(),
            self.mobile_robot_types.as_ref(),
        )
    }

    /// The actions of the edge.
    pub(super) fn actions(&self) -> Vec<(Requirement, Demand)> {
        actions(&self.actions, &self.required_actions, &self.feasible_actions)
    }

    /// The orientations a vehicle may have on the edge.
    pub(super) fn orientations(&self) -> Vec<f64> {
        let several = self.vehicle_orientations.iter().flatten().copied();
        self.vehicle_orientation.into_iter().chain(several).collect()
    }

    /// Whether the vehicle may turn on the edge; LIF 2 says the opposite of it.
    pub(super) fn rotation_allowed(&self) -> Option<bool> {
        let before = self.reach_orientation_before_entering.map(|before| !before);
        self.rotation_allowed.or(before)
    }

    /// The curve, with the degree that LIF leaves out where it is 1.
    pub(super) fn trajectory(&self) -> Option<Value> {
        let mut trajectory = self.trajectory.clone()?;
        if let Value::Object(members) = &mut trajectory {
            members.entry("degree").or_insert_with(|| 1.into());
        }
        Some(trajectory)
    }
}

/// The names of types, in the words of LIF 1.0 and of two drafts of LIF 2.
fn types(one: Option<&String>, several: Option<&Vec<String>>, robots: Option<&Vec<RobotType>>) -> Vec<String> {
    let robots = robots.into_iter().flatten();
    let robots = robots.map(|robot| format!("{}.{}", robot.manufacturer, robot.series_name));
    let named = one.into_iter().chain(several.into_iter().flatten()).cloned();
    named.chain(robots).collect()
}

fn actions(mixed: &[Action], required: &[Action], feasible: &[Action]) -> Vec<(Requirement, Demand)> {
    let mixed = mixed.iter().map(|action| {
        let requirement = match (action.requirement_type.as_deref(), action.required) {
            (Some("REQUIRED"), _) | (None, Some(true)) => Requirement::Required,
            (Some("CONDITIONAL"), _) => Requirement::Conditional,
            _ => Requirement::Optional,
        };
        (requirement, action)
    });
    let required = required.iter().map(|action| (Requirement::Required, action));
    let feasible = feasible.iter().map(|action| (Requirement::Conditional, action));
    let all = mixed.chain(required).chain(feasible);
    all.map(|(requirement, action)| (requirement, action.demand()))
        .collect()
}

impl Action {
    fn demand(&self) -> Demand {
        let parameters = self.parameters.iter();
        Demand {
            action_type: self.name.clone(),
            blocking: match self.blocking_type.as_deref() {
                // The draft of LIF 2 itself says so for VDA 5050 up to 2.1.
                None | Some("SINGLE") => "HARD".to_owned(),
                Some(blocking) => blocking.to_owned(),
            },
            parameters: parameters.map(|one| (one.key.clone(), one.value.clone())).collect(),
        }
    }
}

/// The names that are not known and may be about driving.
pub(super) fn about_driving(unknown: &Unknown) -> impl Iterator<Item = &str> {
    let for_people = |name: &&str| {
        ["Name", "Description", "Descriptor"]
            .iter()
            .any(|end| name.ends_with(end))
    };
    let names = unknown.keys().map(String::as_str);
    names.filter(move |name| !for_people(name) && !NOT_FOR_DRIVING.contains(name))
}
