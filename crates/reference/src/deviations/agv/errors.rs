//! Deviations of what a state says about errors (section 6.10.5).

use super::prelude::*;

records! {
    fault "errors-omitted" ["STATE-MSG-01", "ERR-01", "JSON-10"] "Leaves the errors array out when there is no error."
        => state(|agv, m| if agv.errors.is_empty() { m.unset("errors") });
    fault "errors-omitted-on-request" ["ORD-REJ-03", "ORD-REJ-08", "ERR-01"] "Answers a stateRequest without its errors."
        => state(|agv, m| if agv.report.answers_request() { m.set("errors", json!([])) });
    fault "newest-error-only" ["ERR-01", "ORD-REJ-03", "ORD-REJ-08"] "Of several active errors it reports the newest one only."
        => state(|_, m| m.change("errors", |errors| *errors = errors.as_array().into_iter().flatten().next_back().cloned().into_iter().collect()));
    fault "fatal-hides-warnings" ["ERR-01", "ORD-REJ-03", "ORD-REJ-08"] "As long as a FATAL error is active the warnings are left out of errors."
        because "ERR-01, that every active error is listed, is a recommendation; the worst of them is."
        => state(|agv, m| if agv.errors.active.iter().any(|error| error.fatal) { m.keep("errors", |error| error.says("errorLevel", "FATAL")) });
    fault "error-level-unknown" ["ERR-02", "ORD-CANCEL-19"] "Reports warnings with the level ERROR."
        => error(|_, error, m| if !error.fatal { m.set("errorLevel", "ERROR") });
    fault "map-error-level-critical" ["ERR-02", "MAP-23"] "It reports failed map actions with the errorLevel CRITICAL."
        => error(|_, error, m| if !error.fatal && refers(error, "mapVersion") { m.set("errorLevel", "CRITICAL") });
    fault "failed-action-error-level-error" ["ERR-02"] "It reports the error of a failed action with errorLevel ERROR."
        => error(|_, error, m| {
            // That of a refusal does not name the type of an action, or names the message too.
            if !error.fatal && refers(error, "actionType") && !refers(error, "topic") {
                m.set("errorLevel", "ERROR");
            }
        });
    fault "own-error-level-missing" ["ERR-02"] "Errors of the vehicle itself have no errorLevel."
        => error(|_, error, m| if error.life == Life::WhileDefective { m.unset("errorLevel") });
    fault "references-as-map" ["BP-04", "ERR-05", "ORD-CANCEL-20"] "Gives the references of errors as one object."
        => error(|_, error, m| {
            let map = error.references.iter().map(|(key, value)| (key.clone(), json!(value)));
            m.set("errorReferences", Value::Object(map.collect()));
        });
    fault "references-named-key-value" ["BP-04", "ERR-05"] "The members of its error references are called key and value."
        => error(|_, _, m| m.each("errorReferences", |reference| {
            reference.rename("referenceKey", "key");
            reference.rename("referenceValue", "value");
        }));
    fault "references-in-snake-case" ["ORD-REJ-14", "ORD-CANCEL-20"] "It writes the keys of its error references in snake case, such as order_update_id."
        => error(|_, _, m| m.each("errorReferences", |reference| {
            let key = reference.text("referenceKey").to_owned();
            reference.set("referenceKey", snake_case(&key));
        }));
    fault "reference-value-numeric" ["ERR-05", "ORD-REJ-14"] "Gives numbers as reference values of errors."
        => error(|_, _, m| m.each("errorReferences", |reference| {
            if let Ok(number) = reference.text("referenceValue").parse::<u64>() {
                reference.set("referenceValue", number);
            }
        }));
}

/// Whether the error refers to something by this key.
fn refers(error: &ActiveError, key: &str) -> bool {
    error.references.iter().any(|(name, _)| name == key)
}

/// A word with an underscore and a small letter in the place of each capital one.
fn snake_case(word: &str) -> String {
    word.chars().fold(String::new(), |mut snake, letter| {
        if letter.is_ascii_uppercase() {
            snake.push('_');
        }
        snake.push(letter.to_ascii_lowercase());
        snake
    })
}
