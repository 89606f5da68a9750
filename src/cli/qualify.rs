//! `qualify`: prove the harness on its own reference device.

use serde_json::json;

use super::args::{Format, Qualify};
use super::device::check_faults;
use super::exit::Exit;
use super::problem::Problem;
use crate::pack::Role;
use crate::reference::agv::FAULTS;
use crate::run::{Library, Qualification, qualify_tests};

/// `qualify`.
pub fn qualify(arguments: &Qualify) -> Result<Exit, Problem> {
    let library = Library::load(arguments.suites.suites.as_deref())?;
    check_faults(&arguments.fault)?;
    let packs = match arguments.protocol.as_deref() {
        Some(wanted) => vec![super::pack(&library, Some(wanted))?],
        None => library.rules.packs.all().to_vec(),
    };
    let whole = arguments.tests.is_empty() && arguments.fault.is_empty();
    let faults: Vec<_> = FAULTS
        .iter()
        .filter(|fault| arguments.fault.is_empty() || arguments.fault.iter().any(|name| name == fault.name))
        .copied()
        .collect();
    let mut exit = Exit::Conforms;
    for pack in packs {
        let all = library.tests(Role::Agv, &pack.id);
        let tests = super::select::select(&all, &arguments.tests)?;
        let outcome = qualify_tests(&library, &pack, &tests, &faults, &|_| {});
        let outcome = outcome.map_err(|error| Problem::Environment(error.to_string()))?;
        // Faults of what a version does not have cannot show there.
        let newest = pack.id == library.rules.packs.latest().id;
        let proven = outcome.blemishes.is_empty()
            && (!whole || !newest || (outcome.unproven().is_empty() && outcome.missed().is_empty()));
        if !proven {
            exit = Exit::DoesNotConform;
        }
        let text = match arguments.format {
            Format::Text => format!("VDA 5050 {}\n\n{}\n", pack.version, page(&outcome)),
            Format::Json => format!("{}\n", data(&pack.version.to_string(), &outcome)),
        };
        super::print(&text)?;
    }
    Ok(exit)
}

fn page(outcome: &Qualification) -> String {
    use std::fmt::Write as _;
    let mut text = outcome.matrix();
    for (decider, verdict) in &outcome.blemishes {
        let _ = writeln!(
            text,
            "not a pass without a fault: {} {} ({verdict})",
            decider.requirement, decider.place
        );
    }
    for kill in outcome.missed() {
        let _ = writeln!(
            text,
            "not found by a requirement it names: fault {} ({})",
            kill.fault.name,
            kill.fault.breaks.join(", ")
        );
    }
    text
}

fn data(version: &str, outcome: &Qualification) -> serde_json::Value {
    let kills = outcome.kills.iter().map(|kill| {
        let deciders = kill.deciders.iter().map(|decider| json!({ "requirement": decider.requirement, "by": decider.place }));
        json!({ "fault": kill.fault.name, "breaks": kill.fault.breaks, "named": kill.named(), "killed": deciders.collect::<Vec<_>>() })
    });
    let unproven = outcome.unproven();
    let unproven = unproven
        .iter()
        .map(|decider| json!({ "requirement": decider.requirement, "by": decider.place }));
    json!({ "protocol": version, "deciders": outcome.deciders.len(), "faults": kills.collect::<Vec<_>>(), "unproven": unproven.collect::<Vec<_>>() })
}
