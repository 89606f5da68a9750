//! Deviations of the errors that the standard names: their level, their references, and how long they stand (section 6.6.5.4 of 3.0).

use crate::agv::action_kinds;

use super::prelude::*;

records! {
    fault "refusal-for-the-service" ["ERR-08"] "It reports a new order that comes while it is busy as URGENT."
        => error(|agv, error, m| if error.error_type == agv.config.errors.other_order_active { m.set("errorLevel", "URGENT") });
    fault "start-without-its-order" ["ERR-10"] "It names nothing when an order begins too far away." because "By the ruling of ERR-10 missing references are a warning."
        => error(|agv, error, m| if error.error_type == agv.config.errors.start_out_of_range { m.set("errorReferences", json!([])) });
    fault "unknown-map-by-another-name" ["ORD-REJ-25"] "It has a name of its own for an order on a map that it does not have." because "Another name is a warning by the ruling of ORD-REJ-25."
        => error(|agv, error, m| if error.error_type == agv.config.errors.unknown_map { m.set("errorType", "mapIsNotHere") });
    fault "unsupported-parameter-as-warning" ["OPT-02", "ERR-08"] "It reports a parameter that it has no use for as WARNING."
        => error(|agv, error, m| if error.error_type == agv.config.errors.unsupported { m.set("errorLevel", "WARNING") });
    fault "takes-orders-with-a-fatal-error" ["ERR-04"] "It takes an order over while a FATAL error keeps it from driving."
        => forbidding(|_, what| matches!(what, Permission::RefuseHelpless));
    fault "urgent-refuses-orders" ["ERR-06"] "It takes no order over while it reports an URGENT error." because "That work does not go on is remarked on."
        => letting(|agv, what| matches!(what, Permission::RefuseHelpless) && agv.errors.defect_level == "URGENT" && !agv.errors.is_empty());
    fault "critical-error-clears-order" ["ORD-CLEAR-11", "ORD-FLOW-12"] "It gives its order up as soon as it reports an error of level CRITICAL."
        => keep::<bool>()
            .raises(|critical, agv, _, error| {
                let rule = agv.config.error_rules.get(&error.error_type);
                *critical |= rule.is_some_and(|rule| rule.level == "CRITICAL");
                true
            })
            .happens(|critical, agv, event| if event == Event::Settled && std::mem::take(critical) {
                agv.give_up_order();
            });
    fault "fatal-error-clears-order" ["ORD-CLEAR-11"] "It gives its order up as soon as something keeps it from running."
        => keep::<bool>()
            .raises(|fatal, _, _, error| {
                *fatal |= error.fatal;
                true
            })
            .happens(|fatal, agv, event| if event == Event::Settled && std::mem::take(fatal) {
                agv.give_up_order();
            });
    fault "waiting-order-times-out" ["ORD-CLEAR-11"] "It gives an order up that has waited for its release for ten seconds."
        => keep::<Option<Moment>>()
            .happens(|since, agv, event| if matches!(event, Event::Settled | Event::Woken) {
                let waits = agv.waits_at_decision_point() && agv.order.cancel.is_none();
                *since = waits.then(|| since.unwrap_or(agv.moment()));
                if since.is_some_and(|since| agv.moment().since(since) >= Duration::from_secs(10)) {
                    *since = None;
                    agv.give_up_order();
                }
            })
            .due(|since, _| since.map(|since| since + Duration::from_secs(10)));
    fault "unsupported-refusal-fades" ["ORD-REJ-19", "ERR-09"] "The error of a parameter that it does not support is gone after a second."
        => fading(|agv, error| error.error_type == agv.config.errors.unsupported);
    fault "outside-corridor-named-otherwise" ["CORR-07"] "The error of a robot outside its corridor has a type of its own." because "Any error says that something is wrong, so that its name is remarked on."
        => error(|agv, error, m| if error.error_type == agv.config.errors.outside_of_corridor { m.set("errorType", "offTrack") });
    fault "refused-instant-fades" ["IACT-10", "ERR-09"] "The error of an instant action that it cannot perform is gone after a second."
        => fading(|agv, error| error.error_type == agv.config.errors.instant_action);
    fault "busy-refusal-fades" ["ORD-REJ-21", "ERR-09"] "The error of an order that came while it was busy is gone after a second."
        => fading(|agv, error| error.error_type == agv.config.errors.other_order_active);
    fault "mode-refusal-fades" ["ORD-REJ-24", "ERR-09"] "The error of an order that its mode forbids is gone after a second."
        => fading(|agv, error| error.error_type == agv.config.errors.not_available);
    fault "start-refusal-fades" ["ORD-REJ-26", "ERR-09"] "The error of an order that begins too far away is gone after a second."
        => fading(|agv, error| error.error_type == agv.config.errors.start_out_of_range);
    fault "nothing-to-cancel-fades" ["ERR-09"] "The error of a cancelOrder without an order is gone after a second, although no order was accepted."
        => fading(|agv, error| error.error_type == agv.config.errors.no_order_to_cancel);
    tolerance "every-reason-reported" ["ORD-FLOW-14"] "Of an order that it refuses for several reasons it reports all of them at once."
        => refusing(|agv, message, rule| if names_errors(agv) {
            report_other_reasons(agv, message, rule);
        });
    tolerance "warnings-end-with-an-update" ["ORD-REJ-21", "ERR-09"] "It takes the warnings about refused updates back when it takes over a right one."
        => when(Event::Updated, |agv| {
            let names = &agv.config.errors;
            let about_updates = [&names.outdated_update, &names.same_update];
            agv.errors.active.retain(|error| !about_updates.contains(&&error.error_type));
        });
    tolerance "words-of-its-own" ["ERR-08", "FACT-03"] "It has a kinematics and a warning of its own where the lists of the standard are open."
        => plain().says(|(), agv, part, m| {
            match part {
                Part::Factsheet if names_errors(agv) => m.part("typeSpecification", |t| t.set("agvKinematic", "SPHERICAL_DRIVE")),
                Part::State if names_errors(agv) => m.add("errors", json!({
                    "errorType": "WHEEL_WORN",
                    "errorLevel": "WARNING",
                    "errorDescription": "the tread of a wheel is worn",
                    "errorReferences": [],
                })),
                _ => {}
            }
            true
        });
}

/// Whether the version names errors, in lists that are open.
fn names_errors(agv: &Agv) -> bool {
    !agv.config.error_rules.is_empty()
}

/// Reports what else is wrong with a new order that was refused by a rule.
fn report_other_reasons(agv: &mut Agv, message: &Value, rule: Rule) {
    let about_new = [
        Rule::UnknownMap,
        Rule::Unable,
        Rule::StartOutOfRange,
        Rule::OtherOrderActive,
    ];
    let order = Order::read(message).ok().filter(|order| order.id != agv.order.order_id);
    let Some(order) = order.filter(|_| about_new.contains(&rule)) else {
        return;
    };
    let mut reasons = Vec::new();
    if agv.is_busy() {
        reasons.push((
            Rule::OtherOrderActive,
            Refusal::new(Rule::OtherOrderActive, "another order is active"),
        ));
    }
    let maps = order
        .nodes
        .iter()
        .filter_map(|node| node.position.as_ref().map(|position| &position.map_id));
    if let Some(map) = maps.into_iter().find(|map| !agv.maps.on_board(map)) {
        let refusal = Refusal::new(Rule::UnknownMap, "the map is not on board").naming("mapId", map);
        reasons.push((Rule::UnknownMap, refusal));
    }
    if let Some(action) = order
        .actions()
        .find(|action| action_kinds::find(&agv.config, &action.action_type).is_none())
    {
        let refusal = Refusal::at_field(Rule::Unable, "the vehicle does not know the action", &action.path);
        let refusal = refusal
            .naming("actionId", &action.id)
            .naming("actionType", &action.action_type);
        reasons.push((Rule::Unable, refusal));
    }
    if let Some(first) = order.nodes.first() {
        let allowed = first.position.as_ref().and_then(|position| position.allowed_deviation);
        if !agv.is_within(first, allowed.unwrap_or(0.0), true) {
            let refusal = Refusal::new(Rule::StartOutOfRange, "the first node is out of reach");
            reasons.push((Rule::StartOutOfRange, refusal.naming("nodeId", &first.id)));
        }
    }
    for (_, refusal) in reasons.into_iter().filter(|(other, _)| *other != rule) {
        agv.refuse(message, refusal);
    }
}

type Fading = fn(&Agv, &ActiveError) -> bool;

/// Lists some errors for a second only.
fn fading(which: Fading) -> Box<Hooks<Fading>> {
    holding(which).raises(|which, agv, _, error| {
        if which(agv, error) {
            error.life = Life::Until(agv.moment() + Duration::from_secs(1));
        }
        true
    })
}
