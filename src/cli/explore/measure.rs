//! How many faults of a built-in device an exploration finds by itself, beyond what it says of the device without a fault.

use std::fmt::Write as _;
use std::sync::Arc;

use serde_json::json;

use crate::cli::args::{Explore, Format};
use crate::cli::exit::Exit;
use crate::cli::problem::Problem;
use tck_explore::{Chain, ConversationFile, Coverage, Exploration, Finding, findings};
use tck_judge::Library;
use tck_pack::{Pack, Role};
use tck_qualify::on_all_cores;
use tck_reference::Fault;
use tck_run::{Selection, VirtualRun, run_silently};
use tck_simulate::{BuiltIn, ReferenceAgv, ReferenceMasterControl};
use tck_suite::model::Test;

/// Conversations that one device is told, and the tests they are.
type Round<'a> = (&'a [(Chain, ConversationFile)], Vec<Arc<Test>>);

/// What became of one fault.
struct Measured {
    fault: &'static Fault,
    /// Any requirement was found broken.
    found: bool,
    /// One of those the fault is about.
    named: bool,
}

/// How many conversations are carried out before it is looked whether the fault is found.
const AT_ONCE: usize = 17;

/// Explores the built-in device with every fault, or every so manyth, and says which of them are found.
pub(super) fn every_fault(
    mut library: Library,
    pack: &Arc<Pack>,
    exploration: &Exploration,
    every: usize,
    arguments: &Explore,
) -> Result<Exit, Problem> {
    let device: BuiltIn = match exploration.grammar.role() {
        Role::Agv => ReferenceAgv::of(arguments.vehicle.0, pack).into(),
        Role::MasterControl => ReferenceMasterControl::new(pack).into(),
    };
    let drawn = exploration.drawn(&exploration.grammar, &mut Coverage::default());
    let mut rounds = Vec::new();
    for part in drawn.chunks(AT_ONCE) {
        let places = part
            .iter()
            .map(|(_, file)| (file.place(exploration.grammar.side()), file.text.clone()));
        let mut tests = library.add(&places.collect::<Vec<_>>())?;
        tests.sort_by_key(|test| part.iter().position(|(_, file)| file.id == test.id));
        rounds.push((part, tests));
    }
    let meant = |fault: &&Fault| arguments.fault.is_empty() || arguments.fault.iter().any(|name| name == fault.name);
    let faults = BuiltIn::faults(device.role()).iter().filter(meant);
    let faults: Vec<&'static Fault> = faults.step_by(every).collect();
    let good = told(&device, &library, pack, &rounds, None, |_| false)?;
    let all = on_all_cores(&faults, |&fault| one(&device, &library, pack, &rounds, fault, &good));
    let mut all: Vec<Measured> = all.into_iter().collect::<Result<_, _>>()?;
    all.sort_by_key(|one| one.fault.name);
    let stimuli: usize = drawn.iter().map(|(chain, _)| chain.stimuli().len()).sum();
    super::super::print(&shown(&all, &good, stimuli, exploration.seed, arguments.output.format))?;
    Ok(Exit::Conforms)
}

/// Carries out the conversations until one of them shows a requirement that the fault is about.
fn one(
    device: &BuiltIn,
    library: &Library,
    pack: &Pack,
    rounds: &[Round<'_>],
    fault: &'static Fault,
    good: &[Finding],
) -> Result<Measured, Problem> {
    let by_fault = |one: &Finding| !good.iter().any(|other| other.is_of(one));
    let about = |one: &Finding| by_fault(one) && fault.breaks.contains(&one.requirement.as_str());
    let found = told(device, library, pack, rounds, Some(fault), |found| {
        found.iter().any(about)
    })?;
    Ok(Measured {
        fault,
        found: found.iter().any(by_fault),
        named: found.iter().any(about),
    })
}

/// Carries out the conversations, as long as what is found is not enough.
fn told(
    device: &BuiltIn,
    library: &Library,
    pack: &Pack,
    rounds: &[Round<'_>],
    fault: Option<&'static Fault>,
    is_enough: impl Fn(&[Finding]) -> bool,
) -> Result<Vec<Finding>, Problem> {
    let mut all = Vec::new();
    for (drawn, tests) in rounds {
        let mut run = VirtualRun::of_role(device.role(), library, pack);
        run.device = device.clone();
        run.faults = fault.iter().map(|fault| fault.name.to_owned()).collect();
        run.tests = Selection::some(tests.clone());
        run.draw = None;
        let finished = run_silently(library, pack, run).map_err(|error| Problem::Environment(error.to_string()))?;
        all.extend(findings(&finished.result, drawn));
        if is_enough(&all) {
            break;
        }
    }
    Ok(all)
}

fn shown(all: &[Measured], good: &[Finding], stimuli: usize, seed: u64, format: Format) -> String {
    let found = all.iter().filter(|one| one.found).count();
    let named = all.iter().filter(|one| one.named).count();
    if format == Format::Json {
        let faults = all
            .iter()
            .map(|one| json!({ "fault": one.fault.name, "found": one.found, "named": one.named }));
        let value = json!({
            "format": "vda5050-tck.exploration-measured/1",
            "seed": seed,
            "stimuli": stimuli,
            "faults": all.len(),
            "found": found,
            "named": named,
            "accusations": good.iter().map(|one| json!({ "requirement": one.requirement, "message": one.message })).collect::<Vec<_>>(),
            "each": faults.collect::<Vec<_>>(),
        });
        return format!("{value}\n");
    }
    let mut text = String::new();
    for one in good {
        let stimuli = one.chain.stimuli().join(", ");
        let _ = writeln!(
            text,
            "found without a fault: {}  {}\n  {stimuli}",
            one.requirement, one.message
        );
    }
    for one in all.iter().filter(|one| !one.found) {
        let _ = writeln!(text, "not found: {}  {}", one.fault.name, one.fault.wrong);
    }
    let share = |part: usize| 100 * part / all.len().max(1);
    let _ = writeln!(
        text,
        "{stimuli} stimuli, seed {seed}: {found} of {} faults found ({} %), {named} by a requirement they break ({} %)",
        all.len(),
        share(found),
        share(named),
    );
    text
}
