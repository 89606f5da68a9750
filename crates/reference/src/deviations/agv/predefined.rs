//! Deviations of the errors that the standard names: their level, their references, and how long they stand (section 6.6.5.4 of 3.0).

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
