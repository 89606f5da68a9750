//! What of a layout goes into the orders for one vehicle: curves, orientations and limits that it takes, and actions that it can
//! do. Everything else is named.

use std::collections::BTreeSet;

use super::demand::Demand;
use super::layout::{Edge, Layout};

/// The members of an edge that are optional in an order, by the names they have there.
const OPTIONAL: [&str; 7] = [
    "trajectory",
    "orientation",
    "orientationType",
    "rotationAllowed",
    "maxRotationSpeed",
    "maxHeight",
    "minHeight",
];

/// A file with a wrong origin has one doubt per edge; nobody reads more of them than this.
const MOST_DOUBTS: usize = 10;

/// Whether a vehicle takes something in an order, and why not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Taken {
    /// It does.
    Yes,
    /// It does not, by what is said about it.
    No(String),
    /// Nobody knows yet, or what is said contradicts itself.
    Open(String),
}

/// Where an action of an order stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// On a node.
    Node,
    /// On an edge.
    Edge,
}

impl Scope {
    /// The word of factsheets.
    #[must_use]
    pub fn literal(self) -> &'static str {
        match self {
            Self::Node => "NODE",
            Self::Edge => "EDGE",
        }
    }
}

/// What is known of a vehicle: what it takes in orders.
pub trait Takes {
    /// Whether it takes an optional member, such as `order.edges.trajectory`.
    fn member(&self, path: &str) -> Taken;
    /// Whether it can do all these actions on one node or edge.
    fn actions(&self, demands: &[Demand], scope: Scope) -> Taken;
    /// The action with its parameters in the types that the vehicle wants; LIF 1.0 knows texts only.
    fn typed(&self, demand: &Demand) -> Demand {
        demand.clone()
    }
}

/// A vehicle of which nothing is known.
#[derive(Clone, Copy, Debug)]
pub struct Unheard;

impl Takes for Unheard {
    fn member(&self, path: &str) -> Taken {
        Taken::Open(format!("the factsheet of the vehicle has to list {path}"))
    }

    fn actions(&self, _: &[Demand], _: Scope) -> Taken {
        Taken::Open("the factsheet of the vehicle has to list it".to_owned())
    }
}

impl Layout {
    /// The layout as it goes into the orders for a vehicle. What demands an action that the vehicle cannot do is left out, and
    /// what its orders do not say is named.
    #[must_use]
    pub fn fitted(&self, takes: &dyn Takes) -> Self {
        let mut fitted = self.clone();
        let mut left_out = Vec::new();
        fitted.nodes.retain(|id, node| {
            let why = refused(takes, &node.demands, Scope::Node);
            left_out.extend(why.iter().map(|why| format!("node {id} demands the action {why}")));
            why.is_none()
        });
        fitted.edges.retain(|(start, end), edge| {
            let id = &edge.id;
            if let Some(why) = refused(takes, &edge.demands, Scope::Edge) {
                left_out.push(format!("edge {id} demands the action {why}"));
                return false;
            }
            let joins = fitted.nodes.contains_key(start) && fitted.nodes.contains_key(end);
            if !joins {
                left_out.push(format!("edge {id} leads to or from a node the vehicle may not use"));
            }
            joins
        });
        for demand in fitted.nodes.values_mut().flat_map(|node| &mut node.demands) {
            *demand = takes.typed(demand);
        }
        for demand in fitted.edges.values_mut().flat_map(|edge| &mut edge.demands) {
            *demand = takes.typed(demand);
        }
        fitted.left_out.extend(left_out);
        fitted.tell(takes);
        fitted
    }

    /// The layout for vehicles that another master control commands: what its orders say is its own affair.
    #[must_use]
    pub fn commanded_by_another(&self) -> Self {
        let fitted = self.fitted(&Unheard);
        Self {
            said: Vec::new(),
            unsaid: Vec::new(),
            ..fitted
        }
    }

    /// Decides for each edge what its orders say.
    fn tell(&mut self, takes: &dyn Takes) {
        let taken = OPTIONAL.map(|name| (name, takes.member(&format!("order.edges.{name}"))));
        let takes_type = taken
            .iter()
            .any(|(name, taken)| *name == "orientationType" && *taken == Taken::Yes);
        let beside: BTreeSet<String> = self.misses().map(|miss| miss.id).collect();
        for edge in self.edges.values_mut() {
            // Without its type an orientation would mean something else.
            let is_cut = !takes_type && edge.orientation_type.as_deref() == Some("GLOBAL");
            let told = taken.iter().filter(|(name, taken)| {
                let is_left = match *name {
                    "trajectory" => beside.contains(&edge.id),
                    "orientation" => is_cut,
                    "orientationType" => edge.orientation.is_none(),
                    _ => false,
                };
                *taken == Taken::Yes && !is_left && edge.says(name)
            });
            edge.told = told.map(|(name, _)| *name).collect();
        }
        for (name, taken) in taken {
            let all = self.edges.values().filter(|edge| edge.says(name)).count();
            let told = self.edges.values().filter(|edge| edge.told.contains(&name)).count();
            if told > 0 {
                self.said.push(format!("{name} of {} goes into orders", edges(told)));
            }
            if all > told {
                let left = edges(all - told);
                self.unsaid.push(match taken {
                    Taken::Yes if name == "trajectory" => {
                        format!("{name} of {left} goes into no order: it does not lead from node to node")
                    }
                    Taken::Yes => format!(
                        "{name} of {left} goes into no order: it means something only beside what is missing there, or what \
                         the vehicle does not take"
                    ),
                    Taken::No(why) => format!("{name} of {left} goes into no order: {why}"),
                    Taken::Open(why) => format!("whether {name} of {left} goes into orders is open: {why}"),
                });
            }
        }
        let demanding = self.nodes.values().flat_map(|node| &node.demands);
        let demanding = demanding.chain(self.edges.values().flat_map(|edge| &edge.demands));
        let mut types: Vec<&str> = demanding.map(|demand| demand.action_type.as_str()).collect();
        types.sort_unstable();
        types.dedup();
        let types = types.into_iter();
        let types = types.map(|name| format!("the required action {name} goes into orders"));
        let types: Vec<String> = types.collect();
        self.said.extend(types);
        let doubts = self.doubts().into_iter().take(MOST_DOUBTS);
        let doubts: Vec<String> = doubts.map(|doubt| format!("{}: {doubt}", self.file)).collect();
        self.unsaid.extend(doubts);
    }
}

/// The first demanded action, and why the vehicle cannot do what is demanded; `None` where it can.
fn refused(takes: &dyn Takes, demands: &[Demand], scope: Scope) -> Option<String> {
    let first = demands.first()?;
    match takes.actions(demands, scope) {
        Taken::Yes => None,
        Taken::No(why) | Taken::Open(why) => Some(format!("{}: {why}", first.action_type)),
    }
}

fn edges(count: usize) -> String {
    let s = if count == 1 { "" } else { "s" };
    format!("{count} edge{s}")
}

impl Edge {
    /// Whether the layout says something of it that is optional in an order.
    #[must_use]
    pub fn has_more_to_say(&self) -> bool {
        OPTIONAL.iter().any(|name| self.says(name))
    }

    /// Whether the layout says this of it.
    fn says(&self, name: &str) -> bool {
        match name {
            "trajectory" => self.trajectory.is_some(),
            "orientation" => self.orientation.is_some(),
            "orientationType" => self.orientation_type.is_some(),
            "rotationAllowed" => self.rotation_allowed.is_some(),
            "maxRotationSpeed" => self.max_rotation_speed.is_some(),
            "maxHeight" => self.max_height.is_some(),
            "minHeight" => self.min_height.is_some(),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::{demanded_in_order, told_in_order};
    use tck_base::diagnostic::Source;

    fn fixture(name: &str) -> Arc<Source> {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/layouts")).join(name);
        Source::new(name, std::fs::read_to_string(path).expect("fixture"))
    }

    /// A vehicle that takes these members, and can do these actions.
    struct TakesThese(&'static [&'static str], &'static [&'static str]);

    impl Takes for TakesThese {
        fn member(&self, path: &str) -> Taken {
            match self.0.iter().any(|name| path == format!("order.edges.{name}")) {
                true => Taken::Yes,
                false => Taken::No(format!("the factsheet does not list {path}")),
            }
        }

        fn actions(&self, demands: &[Demand], _: Scope) -> Taken {
            match demands
                .iter()
                .all(|demand| self.1.contains(&demand.action_type.as_str()))
            {
                true => Taken::Yes,
                false => Taken::No("it cannot do it".to_owned()),
            }
        }
    }

    fn curved(name: &str) -> Layout {
        Layout::from_lif(&fixture(name), None).expect("a layout")
    }

    #[test]
    fn what_the_vehicle_takes_of_a_layout_goes_into_orders_and_everything_else_is_named() {
        let takes = TakesThese(&["trajectory", "orientation", "rotationAllowed"], &["beep"]);
        let layout = curved("curved.lif.json").fitted(&takes);
        let edge = layout.edge("A1", "A2").expect("an edge").value();
        let told = told_in_order(&edge);
        let names: Vec<&str> = told.keys().map(String::as_str).collect();
        assert_eq!(names, ["maxSpeed", "trajectory", "orientation", "rotationAllowed"]);
        let node = layout.node("A3").expect("a node").value();
        let actions = demanded_in_order(&node, || "id".to_owned());
        assert_eq!(actions[0]["actionType"], "beep");
        assert_eq!(actions[0]["actionId"], "id");
        assert!(
            layout.edge("A3", "A4").is_none(),
            "it demands what the vehicle cannot do"
        );
        let all = [layout.left_out(), layout.said(), layout.unsaid()].concat();
        insta::assert_snapshot!(all.join("\n"), @r"
        edge A3-A4 demands the action warningLights: it cannot do it
        trajectory of 2 edges goes into orders
        orientation of 5 edges goes into orders
        rotationAllowed of 5 edges goes into orders
        the required action beep goes into orders
        reentryAllowed of 1 edge is not read
        rotationAtEndNodeAllowed of 1 edge goes into no order, for orders have no word for it
        the optional action beep of 1 edge goes into no order, for it depends on more than the layout says
        orientationType of 5 edges goes into no order: the factsheet does not list order.edges.orientationType
        maxRotationSpeed of 5 edges goes into no order: the factsheet does not list order.edges.maxRotationSpeed
        maxHeight of 5 edges goes into no order: the factsheet does not list order.edges.maxHeight
        minHeight of 1 edge goes into no order: the factsheet does not list order.edges.minHeight
        ");
        let nothing = curved("curved.lif.json").fitted(&Unheard);
        assert!(nothing.node("A3").is_none());
        assert_eq!(
            told_in_order(&nothing.edge("A1", "A2").expect("an edge").value()).len(),
            1
        );
    }

    #[test]
    fn a_curve_that_misses_its_nodes_goes_into_no_order_and_is_named_with_its_file() {
        let takes = TakesThese(&["trajectory"], &[]);
        let text = fixture("curved.lif.json")
            .text
            .replacen("\"x\": 0.0, \"y\": 2.0}]", "\"x\": 9.0, \"y\": 2.0}]", 1);
        let layout = Layout::from_lif(&Source::new("hall.lif.json", text), None).expect("a layout");
        let layout = layout.fitted(&takes);
        assert_eq!(layout.edge("A1", "A2").expect("an edge").told, Vec::<&str>::new());
        assert_eq!(layout.edge("A2", "A1").expect("an edge").told, ["trajectory"]);
        let named = layout.unsaid().iter();
        let named: Vec<&String> = named
            .filter(|what| what.starts_with("hall.lif.json: the curve of edge `A1-A2` "))
            .collect();
        assert!(
            named.len() == 1 && named[0].contains("ends 9.0 m from node `A2`"),
            "{named:?}"
        );
    }

    #[test]
    fn an_orientation_without_its_type_goes_into_no_order_where_it_would_mean_something_else() {
        let text = fixture("curved.lif.json").text.replace("TANGENTIAL", "GLOBAL");
        let layout = Layout::from_lif(&Source::new("hall.lif.json", text), None).expect("a layout");
        let told = |takes: &'static [&'static str]| {
            let fitted = layout.fitted(&TakesThese(takes, &[]));
            fitted.edge("A1", "A2").expect("an edge").told.clone()
        };
        assert_eq!(told(&["orientation"]), Vec::<&str>::new());
        assert_eq!(
            told(&["orientation", "orientationType"]),
            ["orientation", "orientationType"]
        );
    }

    #[test]
    fn a_draft_of_lif_2_says_the_same_in_other_words_and_what_is_not_read_is_named() {
        let (one, two) = (curved("curved.lif.json"), curved("curved-2.lif.json"));
        assert!(one.nodes().eq(two.nodes()));
        assert!(one.edges().eq(two.edges()));
        insta::assert_snapshot!(two.unsaid().join("\n"), @r"
        allowedDeviationXY of 1 node is not read
        corridor of 1 edge is not read
        every orientation but the first of 1 edge goes into no order, for an order has one
        rotationAtEndNodeAllowed of 1 edge goes into no order, for orders have no word for it
        the conditional action beep of 1 edge goes into no order, for it depends on more than the layout says
        ");
        let types = Layout::vehicle_types(&fixture("curved-2.lif.json"));
        assert_eq!(types.expect("types"), ["vda5050-tck.Reference AGV"]);
        let older = fixture("curved.lif.json").text.replace(
            "\"vehicleTypeId\": \"vda5050-tck.Reference AGV\"",
            "\"vehicleTypeIds\": [\"A\", \"B\"]",
        );
        let older = Source::new("older.lif.json", older.replace("1.0.0", "2.0.0"));
        assert!(
            Layout::from_lif(&older, Some("B"))
                .expect("a layout")
                .nodes()
                .eq(one.nodes())
        );
    }
}
