//! The bundle of a qualification, and its parts joined.

use std::path::Path;

use super::exit::Exit;
use super::problem::Problem;
use super::result_bundle;
use tck_base::verdict::Verdict;
use tck_judge::Library;
use tck_qualify::prove;
use tck_qualify::saved::{QualificationResult, QualifiedSide, RESULT_FORMAT};
use tck_reference::Fault;
use tck_report::junit::Plain;
use tck_simulate::BuiltIn;

/// Whether a bundle is that of a qualification.
pub(super) fn is_qualification(folder: &Path) -> bool {
    read(folder).is_ok_and(|result| result.format == RESULT_FORMAT)
}

/// Reads the result of a bundle.
pub(super) fn read(folder: &Path) -> Result<QualificationResult, Problem> {
    result_bundle::read(folder)
}

/// Writes a bundle, and gives its root hash.
pub(super) fn write(result: &QualificationResult, folder: &Path) -> Result<String, Problem> {
    result_bundle::write(result, &cases(result), Vec::new(), folder)
}

/// A case for each fault, and for everything that is wrong.
fn cases(result: &QualificationResult) -> Vec<Plain> {
    let mut all = Vec::new();
    for side in &result.sides {
        let suite = format!("{}, VDA 5050 {}", side.role, side.protocol);
        let case = |name: &str, verdict: Verdict, text: String| Plain {
            suite: suite.clone(),
            name: name.to_owned(),
            verdict,
            elsewhere: None,
            text,
        };
        all.extend(side.kills.iter().map(|kill| {
            let by: Vec<String> = kill.deciders.iter().map(|one| one.decider.to_string()).collect();
            case(&format!("fault {}", kill.fault), Verdict::Pass, by.join("\n"))
        }));
        all.extend(
            side.complaints
                .iter()
                .map(|complaint| case(complaint, Verdict::Fail, complaint.clone())),
        );
    }
    let troubles = result.merged.iter().flat_map(|merged| &merged.troubles);
    all.extend(troubles.map(|trouble| Plain {
        suite: "qualification".to_owned(),
        name: "every part is there".to_owned(),
        verdict: Verdict::Inconclusive,
        elsewhere: None,
        text: trouble.to_string(),
    }));
    all
}

/// Tries what all parts together leave unproven, as a qualification does at its end that is not divided. Of parts that are not
/// the whole nobody knows what they leave.
pub(super) fn finish(result: &mut QualificationResult, library: &Library) -> Result<(), Problem> {
    let is_complete = result.merged.as_ref().is_some_and(|merged| merged.troubles.is_empty());
    if !is_complete || !result.faults.is_empty() {
        return Ok(());
    }
    let whole = result.is_whole();
    for side in &mut result.sides {
        let pack = super::pack(library, Some(&side.protocol))?;
        let role = side.role();
        let all = library.tests(role, &pack.id);
        let tests = tck_run::select(&all, &result.tests)?;
        let tried: Vec<Fault> = BuiltIn::faults(role)
            .iter()
            .filter(|fault| side.kills.iter().any(|kill| kill.fault == fault.name))
            .copied()
            .collect();
        let mut outcome = side.outcome(library, &pack);
        prove(library, &pack, &tests, &tried, &mut outcome).map_err(|error| Problem::Environment(error.to_string()))?;
        *side = QualifiedSide::of(&outcome, &pack, true, whole);
    }
    result.conclude();
    Ok(())
}

/// Says what came out of parts that were joined.
pub(super) fn show(result: &QualificationResult) -> Result<Exit, Problem> {
    let mut text = String::new();
    for side in &result.sides {
        let found = side.kills.iter().filter(|kill| kill.found).count();
        text += &format!(
            "{}, VDA 5050 {}: {} faults, {found} found\n",
            side.role,
            side.protocol,
            side.kills.len()
        );
        text.extend(side.complaints.iter().map(|complaint| format!("wrong: {complaint}\n")));
    }
    let troubles = result.merged.iter().flat_map(|merged| &merged.troubles);
    text.extend(troubles.map(|trouble| format!("not the whole: {trouble}\n")));
    super::print(&text)?;
    Ok(Exit::of(result.verdict))
}
