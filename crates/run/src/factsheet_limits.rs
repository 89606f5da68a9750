//! Whether the messages of a test fit into a vehicle, by the limits of its factsheet.
//!
//! FACT-12 binds a master control, and the harness plays one: what the factsheet says is too much may be refused.

use serde_json::Value;

use tck_base::pattern::{Piece, Term, TermKind};
use tck_journal::Reason;
use tck_suite::model::{Need, Patch, RoutePlace, Send, Test, Verb};
use tck_view::{ArrayLimits, FactsheetView, Field, Member, Number, StringLimits};

/// The most characters that a variable in an id may stand for.
const VARIABLE: usize = 64;

/// Why a test is nothing for a vehicle with such a factsheet. A test that is about a limit goes beyond it on purpose.
pub(super) fn exceeded(sheet: &FactsheetView, test: &Test) -> Option<Reason> {
    if test.needs.iter().any(|need| matches!(need, Need::Limit(_))) {
        return None;
    }
    let sends = test.sections().into_iter().flat_map(|(_, steps)| steps);
    let sends = sends.filter_map(|step| match &*step.verb {
        Verb::Send(send) => Some(send.as_ref()),
        _ => None,
    });
    sends.into_iter().find_map(|send| {
        let too_many = sheet.array_limits().and_then(|limits| {
            let mut all = sizes(send).into_iter();
            all.find_map(|((name, of), needed)| {
                let limit = limit(of(limits)).filter(|limit| *limit < needed)?;
                let array = name.usual_name().to_owned();
                Some(Reason::ArrayLimit { array, limit, needed })
            })
        });
        too_many.or_else(|| too_long(sheet.string_limits()?, send))
    })
}

/// A limit of a factsheet; zero stands for none.
fn limit(member: &Member<Number>) -> Option<u64> {
    member.whole().filter(|limit| *limit > 0)
}

/// What is wrong with an id that a patch spells out, for a vehicle with such limits. All other ids take the form it wants.
fn too_long(lengths: &StringLimits, send: &Send) -> Option<Reason> {
    let named = send.payload.iter().flat_map(|payload| match &payload.kind {
        TermKind::Map(members) => members.as_slice(),
        _ => &[],
    });
    let named = named.filter_map(|(name, value)| written(name, &value.kind));
    let operations = match &send.patch {
        Some(Patch::Operations(operations)) => match &operations.kind {
            TermKind::List(operations) => operations.as_slice(),
            _ => &[],
        },
        _ => &[],
    };
    let numerical = lengths.id_numerical_only.is(true);
    let longest = limit(&lengths.id_len);
    let mut ids = named.chain(operations.iter().filter_map(spelled));
    ids.find_map(|(length, digits)| {
        let needed = u64::try_from(length).unwrap_or(u64::MAX);
        match longest.filter(|longest| *longest < needed) {
            Some(limit) => Some(Reason::IdLimit { limit, needed }),
            None if numerical && !digits => Some(Reason::NumericalIds),
            None => None,
        }
    })
}

/// The length at most, and whether there are digits only, of an id that an operation writes partly letter by letter.
fn spelled(operation: &Term) -> Option<(usize, bool)> {
    let TermKind::Map(members) = &operation.kind else {
        return None;
    };
    let member = |name: &str| {
        members
            .iter()
            .find(|(member, _)| member == name)
            .map(|(_, term)| &term.kind)
    };
    let TermKind::Literal(Value::String(path)) = member("path")? else {
        return None;
    };
    written(path, member("value")?)
}

/// The length at most, and whether there are digits only, of an id under a name or at the end of a path.
fn written(name: &str, value: &TermKind) -> Option<(usize, bool)> {
    let TermKind::Text(pieces) = value else {
        return None;
    };
    if !name.ends_with("Id") {
        return None;
    }
    let length = pieces.iter().map(|piece| match piece {
        Piece::Text(text) => text.chars().count(),
        Piece::Variable(_) => VARIABLE,
    });
    let digits = pieces.iter().all(|piece| match piece {
        Piece::Text(text) => text.bytes().all(|byte| byte.is_ascii_digit()),
        Piece::Variable(_) => true,
    });
    Some((length.sum(), digits))
}

/// A limit of an array: what factsheets call it, and where it stands.
type Limit = (Field, fn(&ArrayLimits) -> &Member<Number>);

/// How long the arrays of a message are, by the limits that factsheets have for them.
fn sizes(send: &Send) -> Vec<(Limit, u64)> {
    const INSTANTS: Limit = (ArrayLimits::instant_actions, |all| &all.instant_actions);
    const NODES: Limit = (ArrayLimits::order_nodes, |all| &all.order_nodes);
    const EDGES: Limit = (ArrayLimits::order_edges, |all| &all.order_edges);
    const NODE_STATES: Limit = (ArrayLimits::node_states, |all| &all.node_states);
    const EDGE_STATES: Limit = (ArrayLimits::edge_states, |all| &all.edge_states);
    const OF_NODE: Limit = (ArrayLimits::node_actions, |all| &all.node_actions);
    const OF_EDGE: Limit = (ArrayLimits::edge_actions, |all| &all.edge_actions);
    const PARAMETERS: Limit = (ArrayLimits::action_parameters, |all| &all.action_parameters);
    let count = |length: usize| u64::try_from(length).unwrap_or(u64::MAX);
    let mut all = vec![(INSTANTS, count(send.actions.len()))];
    let mut parameters = send.actions.iter().map(|action| action.with.len()).max().unwrap_or(0);
    if let Some(route) = &send.route {
        let nodes = route.base.len() + route.horizon.len();
        all.push((NODES, count(nodes)));
        all.push((EDGES, count(nodes.saturating_sub(1))));
        // What the vehicle is to list of it.
        all.push((NODE_STATES, count(nodes)));
        all.push((EDGE_STATES, count(nodes.saturating_sub(1))));
        for (place, actions) in &route.actions {
            let name = match place {
                RoutePlace::Node(_) => OF_NODE,
                RoutePlace::Edge(..) => OF_EDGE,
            };
            all.push((name, count(actions.len())));
            parameters = actions
                .iter()
                .map(|action| action.with.len())
                .fold(parameters, usize::max);
        }
    }
    all.push((PARAMETERS, count(parameters)));
    all
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use tck_pack::Role;

    /// Why this test is nothing for a vehicle with these limits.
    fn why(limits: &Value, id: &str) -> Option<Reason> {
        let library = tck_testing::library();
        let tests = library.tests(Role::Agv, &library.rules.packs.latest().id);
        let test = tests.iter().find(|test| test.id.as_str() == id).expect(id);
        let sheet = json!({ "protocolLimits": limits });
        exceeded(&crate::Sheet::read(&sheet, library.rules.packs.latest().names()), test)
    }

    #[test]
    fn a_test_with_more_than_the_factsheet_allows_is_left_out() {
        let id = "order-acceptance/long-action-id";
        for fits in [
            json!({}),
            json!({ "maxArrayLens": { "order.nodes": 0, "node.actions": 1 } }),
            json!({ "maxStringLens": { "idLen": 0 } }),
            json!({ "maxStringLens": { "idLen": 200.0, "idNumericalOnly": false } }),
        ] {
            assert_eq!(why(&fits, id), None, "{fits}");
        }
        for exceeded in [
            json!({ "maxStringLens": { "idLen": 40 } }),
            json!({ "maxStringLens": { "idLen": 40.0 } }),
            json!({ "maxStringLens": { "idNumericalOnly": true } }),
        ] {
            assert!(why(&exceeded, id).is_some(), "{exceeded}");
        }
        let nodes = |limit: Value| json!({ "maxArrayLens": { "order.nodes": limit } });
        let id = "order-acceptance/node-by-node";
        assert_eq!(why(&nodes(json!(100)), id), None);
        for limit in [json!(1), json!(1.0)] {
            let Some(Reason::ArrayLimit { array, limit: 1, .. }) = why(&nodes(limit), id) else {
                panic!("too many");
            };
            assert_eq!(array, "order.nodes");
        }
    }
}
