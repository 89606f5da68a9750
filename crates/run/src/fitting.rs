//! The layout as it goes into orders, by what is known of the vehicle: its factsheet, and what the profile adds to it.

use serde_json::Value;

use super::capabilities::Capabilities;
use super::session::Setup;
use tck_course::{Demand, Scope, Taken, Takes};
use tck_journal::Reason;
use tck_journal::event::Gate;
use tck_view::OfferedAction;

impl Setup {
    /// Fits the layout to the vehicle, as far as it is known; what its orders do not say restricts the statement.
    pub(super) fn fit_layout(&mut self) {
        if let Some(layout) = &mut self.layout {
            *layout = layout.fitted(&self.capabilities);
            self.limits
                .extend(layout.unsaid().iter().map(|what| format!("Of the layout, {what}.")));
        }
    }
}

impl Takes for Capabilities {
    fn member(&self, path: &str) -> Taken {
        taken(self.optional(path))
    }

    fn typed(&self, demand: &Demand) -> Demand {
        let mut typed = demand.clone();
        let Some(offered) = self.offered(demand) else {
            return typed;
        };
        for (key, value) in &mut typed.parameters {
            let Value::String(text) = &*value else { continue };
            let parameter = offered.action_parameters.iter().find(|one| one.key.is(key));
            let is_text = parameter.is_none_or(|one| one.value_data_type.text().is_none_or(|kind| kind == "STRING"));
            if let (false, Ok(other)) = (is_text, serde_json::from_str(text)) {
                *value = other;
            }
        }
        typed
    }

    fn actions(&self, demands: &[Demand], scope: Scope) -> Taken {
        let mut all = demands.iter().map(|demand| self.demanded(demand, scope));
        if let Some(other) = all.find(|taken| *taken != Taken::Yes) {
            return other;
        }
        let limits = self.factsheet.as_ref().and_then(|sheet| sheet.array_limits());
        let limit = limits.and_then(|limits| match scope {
            Scope::Node => limits.node_actions.whole(),
            Scope::Edge => limits.edge_actions.whole(),
        });
        let count = u64::try_from(demands.len()).unwrap_or(u64::MAX);
        match limit.filter(|limit| (1..=count).contains(limit)) {
            Some(limit) => Taken::No(format!(
                "the factsheet allows {limit} actions in one place, and none is left for a test"
            )),
            None => Taken::Yes,
        }
    }
}

impl Capabilities {
    /// How the factsheet describes an action of a layout.
    fn offered(&self, demand: &Demand) -> Option<&OfferedAction> {
        let mut offered = self.factsheet.as_ref()?.offered_actions();
        offered.find(|offered| offered.action_type.is(&demand.action_type))
    }

    /// Whether the vehicle can do one action of a layout as it stands there.
    fn demanded(&self, demand: &Demand, scope: Scope) -> Taken {
        let can = taken(self.action(&demand.action_type, Some(scope.literal())));
        if can != Taken::Yes {
            return can;
        }
        let Some(offered) = self.offered(demand) else {
            return Taken::Yes;
        };
        let mut blocking = offered.blocking_types.texts().peekable();
        if blocking.peek().is_some() && !blocking.any(|listed| listed == demand.blocking) {
            let why = Reason::BlockingTypeNotListed {
                action: demand.action_type.clone(),
                blocking: demand.blocking.clone(),
            };
            return Taken::No(why.to_string());
        }
        let given = |key: &str| demand.parameters.iter().any(|(name, _)| name == key);
        let mut needed = offered.action_parameters.iter().filter(|one| !one.is_optional.is(true));
        match needed.find_map(|one| one.key.text().filter(|key| !given(key))) {
            Some(key) => Taken::No(format!(
                "the factsheet demands the parameter {key}, which the layout does not give"
            )),
            None => Taken::Yes,
        }
    }
}

fn taken(gate: Gate) -> Taken {
    match gate {
        Gate::Runs => Taken::Yes,
        Gate::NotApplicable(why) => Taken::No(why.to_string()),
        Gate::Unobservable(why) => Taken::Open(why.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;
    use tck_view::Names;

    use super::*;
    use crate::Sheet;

    fn capabilities(features: &Value, limits: &Value) -> Capabilities {
        let sheet = json!({ "protocolFeatures": features, "protocolLimits": { "maxArrayLens": limits } });
        let mut capabilities = crate::capabilities::unknown();
        capabilities.factsheet = Some(Sheet::read(&sheet, &Names::default()));
        capabilities
    }

    fn beep(parameters: &[&str]) -> Demand {
        Demand {
            action_type: "beep".to_owned(),
            blocking: "SOFT".to_owned(),
            parameters: parameters.iter().map(|key| ((*key).to_owned(), json!(1))).collect(),
        }
    }

    #[test]
    fn an_action_is_taken_that_the_factsheet_lists_with_its_scope_its_blocking_and_its_parameters() {
        let listed = |scope: &str, blocking: &[&str]| {
            json!({ "agvActions": [{ "actionType": "beep", "actionScopes": [scope], "blockingTypes": blocking,
                "actionParameters": [{ "key": "duration" }, { "key": "tone", "isOptional": true }] }] })
        };
        let on_node = |features: &Value, limits: &Value, parameters: &[&str]| {
            capabilities(features, limits).actions(&[beep(parameters)], Scope::Node)
        };
        let good = listed("NODE", &["SOFT", "HARD"]);
        assert_eq!(on_node(&good, &json!({}), &["duration"]), Taken::Yes);
        assert_eq!(
            on_node(&listed("NODE", &[]), &json!({}), &["duration", "more"]),
            Taken::Yes
        );
        assert_eq!(on_node(&good, &json!({ "node.actions": 2 }), &["duration"]), Taken::Yes);
        for (features, limits, parameters) in [
            (listed("EDGE", &["SOFT"]), json!({}), ["duration"]),
            (listed("NODE", &["HARD"]), json!({}), ["duration"]),
            (good.clone(), json!({}), ["tone"]),
            (good.clone(), json!({ "node.actions": 1 }), ["duration"]),
            (json!({ "agvActions": [] }), json!({}), ["duration"]),
        ] {
            let taken = on_node(&features, &limits, &parameters);
            assert!(matches!(taken, Taken::No(_)), "{taken:?} {features} {limits}");
        }
        let silent = crate::capabilities::unknown();
        assert!(matches!(
            silent.actions(&[beep(&["duration"])], Scope::Node),
            Taken::Open(_)
        ));
    }

    #[test]
    fn a_parameter_that_lif_can_only_write_as_a_text_gets_the_type_of_the_factsheet() {
        let parameter = |kind: &str| {
            json!({ "agvActions": [{ "actionType": "beep", "actionScopes": ["NODE"],
                "actionParameters": [{ "key": "duration", "valueDataType": kind }] }] })
        };
        let typed = |kind: &str, text: &str| {
            let mut demand = beep(&[]);
            demand.parameters = vec![("duration".to_owned(), json!(text)), ("other".to_owned(), json!("2"))];
            capabilities(&parameter(kind), &json!({})).typed(&demand).parameters
        };
        assert_eq!(typed("FLOAT", "0.5")[0].1, json!(0.5));
        assert_eq!(typed("FLOAT", "0.5")[1].1, json!("2"), "the factsheet does not know it");
        assert_eq!(typed("BOOL", "true")[0].1, json!(true));
        assert_eq!(typed("STRING", "0.5")[0].1, json!("0.5"));
        assert_eq!(typed("FLOAT", "long")[0].1, json!("long"));
    }

    #[test]
    fn a_member_is_taken_that_the_factsheet_lists() {
        let features =
            json!({ "optionalParameters": [{ "parameter": "order.edges.trajectory", "support": "SUPPORTED" }] });
        let capabilities = capabilities(&features, &json!({}));
        assert_eq!(capabilities.member("order.edges.trajectory"), Taken::Yes);
        assert!(matches!(capabilities.member("order.edges.maxHeight"), Taken::No(_)));
        assert!(matches!(
            crate::capabilities::unknown().member("order.edges.maxHeight"),
            Taken::Open(_)
        ));
    }
}
