//! Actions that are sent: where they may stand, and what the factsheet of the vehicle says about them.

use serde_json::Value;

use super::{Command, ELEMENTS, Each, Found, parameter};
use crate::finding::{quote, show};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_world::members::{elements, text};
use tck_world::{Fact, Factsheet, Listen, Observation, Offered, Topic};

/// `commands/scopes`.
pub(crate) const SCOPES: Check = Check {
    name: "commands/scopes",
    decides: &["ACT-08"],
    doc: "Predefined actions stand only where their table allows it: as instant action, on a node or on an edge. An \
          instant finePositioning is a warning.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[],
    start: |_| Each::start(scopes),
};

/// `commands/actions-of-factsheet`.
pub(crate) const IN_FACTSHEET: Check = Check {
    name: "commands/actions-of-factsheet",
    decides: &["FACT-15"],
    doc: "Every action is one the factsheet of the vehicle lists, with a scope and a blocking type it lists, with every \
          parameter it does not call optional, and with none it does not list. A predefined parameter it does not \
          list is a warning. A factsheet that lists no action at all, and requests the protocol itself answers, are \
          not judged.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(InFactsheet),
};

/// `commands/load-device`.
pub(crate) const LOAD_DEVICE: Check = Check {
    name: "commands/load-device",
    decides: &["ACT-32"],
    doc: "A pick for a vehicle whose factsheet has several loadPositions names one of them as lhd.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(LoadDevice),
};

/// Where a predefined action may stand.
fn predefined<'c>(kind: &str, context: &'c CheckContext<'_>) -> Option<&'c Value> {
    context.pack.vocabulary().get("action")?.get(kind)
}

fn scopes(command: Command<'_>, context: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let mut judged = false;
    for (scope, action) in command.actions() {
        let kind = text(action, "actionType");
        let Some(known) = predefined(kind, context) else {
            continue;
        };
        judged = true;
        if elements(known, "scopes").any(|allowed| allowed.as_str() == Some(scope)) {
            continue;
        }
        let message = format!("{kind} is sent with scope {scope}");
        if kind == "finePositioning" && scope == "INSTANT" {
            found.remark("ACT-08", message);
        } else {
            found.broken("ACT-08", message);
        }
    }
    judged
}

struct InFactsheet;

impl Running for InFactsheet {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(command) = Command::read(record) else {
            return false;
        };
        let sheets = context.world.factsheets().valid(record, context);
        if sheets.is_empty() || sheets.iter().any(|sheet| sheet.actions.is_none()) {
            return false;
        }
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for (scope, action) in command.actions() {
            // Without a type there is nothing to look up.
            if text(action, "actionType").is_empty() {
                continue;
            }
            let mut wrong = Vec::new();
            for sheet in &sheets {
                wrong.push(deviation(sheet, scope, action, context));
            }
            judged = true;
            // Wrong is what no factsheet that counts allows; a firm reason goes before a soft one.
            if let Some(least) = wrong.into_iter().min_by_key(|wrong| match wrong {
                None => 0,
                Some((false, _)) => 1,
                Some((true, _)) => 2,
            }) {
                match least {
                    None => {}
                    Some((true, message)) => found.broken("FACT-15", message),
                    Some((false, message)) => found.remark("FACT-15", message),
                }
            }
        }
        judged
    }
}

/// What the protocol itself demands of every vehicle, listed or not.
const ALWAYS: [&str; 3] = ["cancelOrder", "stateRequest", "factsheetRequest"];

/// How an action deviates from a factsheet: whether that is certainly wrong, and in words.
fn deviation(sheet: &Factsheet, scope: &str, action: &Value, context: &CheckContext<'_>) -> Option<(bool, String)> {
    let kind = text(action, "actionType");
    let name = quote(kind);
    let Some(offered) = sheet.actions.as_ref()?.get(kind) else {
        return (!ALWAYS.contains(&kind)).then(|| (true, format!("action {name} is not listed in the factsheet")));
    };
    if !offered.scopes.is_empty() && !offered.scopes.iter().any(|listed| listed == scope) {
        return Some((true, format!("action {name} is not listed with scope {scope}")));
    }
    let blocking = text(action, "blockingType");
    let listed = offered.blocking.as_ref();
    if listed.is_some_and(|listed| !blocking.is_empty() && !listed.iter().any(|one| one == blocking)) {
        return Some((
            true,
            format!("action {name} is not listed with blockingType {}", quote(blocking)),
        ));
    }
    of_parameters(offered, action, context)
}

fn of_parameters(offered: &Offered, action: &Value, context: &CheckContext<'_>) -> Option<(bool, String)> {
    let kind = text(action, "actionType");
    let listed = offered.parameters.as_ref()?;
    let missing = listed
        .iter()
        .find(|(key, optional)| !**optional && parameter(action, key).is_none());
    if let Some((key, _)) = missing {
        return Some((true, format!("action {} lacks parameter {}", quote(kind), quote(key))));
    }
    let sent = elements(action, "actionParameters").take(ELEMENTS);
    let further = sent
        .map(|parameter| text(parameter, "key"))
        .find(|key| !listed.contains_key(*key))?;
    let known = predefined(kind, context).and_then(|known| known.get("parameters")?.get(further));
    let message = format!(
        "action {} comes with parameter {}, which is not listed",
        quote(kind),
        quote(further)
    );
    Some((known.is_none() && !further.is_empty(), message))
}

struct LoadDevice;

impl Running for LoadDevice {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(command) = Command::read(record) else {
            return false;
        };
        let sheets = context.world.factsheets().valid(record, context);
        if sheets.is_empty() || sheets.iter().any(|sheet| sheet.load_positions.len() < 2) {
            return false;
        }
        let mut found = Found::new(record, findings);
        let mut judged = false;
        let picks = command.actions().into_iter().map(|(_, action)| action);
        for pick in picks.filter(|action| text(action, "actionType") == "pick") {
            judged = true;
            match parameter(pick, "lhd") {
                None => found.broken("ACT-32", "a pick for a vehicle with several load positions has no lhd"),
                Some(lhd) => {
                    let names = |sheet: &Factsheet| {
                        sheet
                            .load_positions
                            .iter()
                            .any(|one| Some(one.as_str()) == lhd.as_str())
                    };
                    if !sheets.iter().any(|sheet| names(sheet)) {
                        let text = format!("lhd {} of a pick is none of the load positions", show(lhd));
                        found.broken("ACT-32", text);
                    }
                }
            }
        }
        judged
    }
}
