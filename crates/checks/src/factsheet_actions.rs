//! `factsheet/predefined-actions`: a factsheet calls what the text defines by the names of the text.
//!
//! What an action of a manufacturer really does is known to the manufacturer only. A name that is a predefined one but
//! for its spelling says it all the same; a name that is merely like one is worth a second look.

use serde_json::Value;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{OfferedAction, ProtocolFeatures};
use tck_world::{Listen, Observation, Topic};

/// How many elements of a list are looked at.
const ELEMENTS: usize = 512;

/// A factsheet calls what the text defines by the names of the text.
pub(super) const PREDEFINED: Check = Check {
    name: "factsheet/predefined-actions",
    decides: &["ACT-05", "ACT-06"],
    doc: "No action and no parameter in the factsheet is a predefined one in another spelling. One that contains the \
          words of a predefined one is a warning.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Factsheet)],
    reads: &[],
    needs: &[ProtocolFeatures::actions, OfferedAction::action_parameters],
    start: |_| Box::new(Predefined),
};

struct Predefined;

impl Running for Predefined {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let factsheet = record
            .factsheet()
            .filter(|factsheet| !factsheet.protocol_features.is_absent());
        let predefined = context.pack.vocabulary().get("action").and_then(Value::as_object);
        let (Some(factsheet), Some(predefined)) = (factsheet, predefined) else {
            return false;
        };
        let listed: Vec<&OfferedAction> = factsheet.offered_actions().take(ELEMENTS).collect();
        let names: Vec<&str> = listed.iter().map(|action| action.action_type.or_empty()).collect();
        let known: Vec<&str> = predefined.keys().map(String::as_str).collect();
        let mut add = |requirement, whose: &str, odd: &Odd<'_>| {
            let name = quote(odd.name);
            findings.push(match odd.how {
                How::Respelled => broken(
                    requirement,
                    record.seq(),
                    format!("{name}{whose} is {} in another spelling", odd.like),
                ),
                How::Alike => remark(
                    requirement,
                    record.seq(),
                    format!("{name}{whose} looks like {}", odd.like),
                ),
            });
        };
        look(&names, &known).for_each(|odd| add("ACT-05", "", &odd));
        for action in listed {
            let kind = action.action_type.or_empty();
            let parameters = predefined
                .get(kind)
                .and_then(|known| known.get("parameters")?.as_object());
            let offered = action.action_parameters.iter().take(ELEMENTS);
            let keys: Vec<&str> = offered.map(|parameter| parameter.key.or_empty()).collect();
            // Further parameters are allowed beside those of the text.
            let known: Vec<&str> = parameters
                .into_iter()
                .flat_map(|parameters| parameters.keys().map(String::as_str))
                .filter(|known| !keys.contains(known))
                .collect();
            let further: Vec<&str> = keys
                .iter()
                .copied()
                .filter(|key| parameters.is_some_and(|parameters| !parameters.contains_key(*key)))
                .collect();
            look(&further, &known).for_each(|odd| add("ACT-06", &format!(" of {kind}"), &odd));
        }
        true
    }
}

/// How a name is like a predefined one.
pub(super) enum How {
    /// It is the same but for case and separators, and stands in its place.
    Respelled,
    /// It has all of its words.
    Alike,
}

/// A name that is not predefined, and what it is like.
pub(super) struct Odd<'a> {
    pub name: &'a str,
    pub like: &'a str,
    pub how: How,
}

/// Every name that is like a known one and none itself.
pub(super) fn look<'a>(names: &'a [&'a str], known: &'a [&'a str]) -> impl Iterator<Item = Odd<'a>> {
    let others = names.iter().copied().filter(|name| !known.contains(name));
    others.filter_map(|name| {
        let respelled = known.iter().copied().find(|like| plain(like) == plain(name));
        let alike = || known.iter().copied().find(|like| has_words(name, like));
        let how = if respelled.is_some_and(|like| !names.contains(&like)) {
            How::Respelled
        } else {
            How::Alike
        };
        let like = respelled.or_else(alike)?;
        Some(Odd { name, like, how })
    })
}

fn plain(name: &str) -> String {
    name.chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|c| c.to_ascii_lowercase())
        .collect()
}

/// Whether a name has the beginnings of all words of another; `start` and `stop` count only together with a word.
fn has_words(name: &str, like: &str) -> bool {
    let own = words(name);
    let wanted = words(like);
    let counts = |word: &&String| !matches!(word.as_str(), "start" | "stop");
    let has = |word: &String| {
        let stem: String = word.chars().take(4).collect();
        own.iter().any(|own| own.starts_with(&stem))
    };
    wanted.iter().filter(counts).all(has)
}

/// `liftHeightMm` and `lift_height_mm` are `lift`, `height`, `mm`.
fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut open = false;
    for c in name.chars() {
        if !c.is_ascii_alphanumeric() {
            open = false;
            continue;
        }
        if !open || c.is_ascii_uppercase() {
            words.push(String::new());
            open = true;
        }
        if let Some(word) = words.last_mut() {
            word.push(c.to_ascii_lowercase());
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

    fn judged(actions: &Value) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.message("factsheet", &json!({ "protocolFeatures": { "agvActions": actions } }));
        trace.judge("factsheet/predefined-actions").summary()
    }

    fn named(names: &[&str]) -> Vec<String> {
        judged(&names.iter().map(|name| json!({ "actionType": name })).collect())
    }

    fn pick(keys: &[&str]) -> Vec<String> {
        let parameters: Vec<Value> = keys.iter().map(|key| json!({ "key": key })).collect();
        judged(&json!([{ "actionType": "pick", "actionParameters": parameters }]))
    }

    #[test]
    fn predefined_names_and_names_of_their_own_are_right() {
        assert!(
            named(&[
                "startPause",
                "stopPause",
                "pick",
                "drop",
                "beep",
                "warningLights",
                "openGate"
            ])
            .is_empty()
        );
        assert!(pick(&["stationType", "loadType", "height", "maxHeight", "speedFactor"]).is_empty());
    }

    #[test]
    fn another_spelling_in_the_place_of_a_predefined_name_is_found() {
        assert_eq!(named(&["StartPause"]), ["ACT-05"]);
        assert_eq!(named(&["init_position"]), ["ACT-05"]);
        assert_eq!(pick(&["station_type", "loadType"]), ["ACT-06"]);
    }

    #[test]
    fn a_name_that_is_only_like_a_predefined_one_is_a_warning() {
        assert_eq!(named(&["startPause", "pauseVehicle"]), ["ACT-05 warning"]);
        assert_eq!(named(&["startPause", "STARTPAUSE"]), ["ACT-05 warning"]);
        assert_eq!(named(&["chargeBattery"]), ["ACT-05 warning"]);
        assert_eq!(pick(&["liftHeightMm"]), ["ACT-06 warning"]);
    }
}
