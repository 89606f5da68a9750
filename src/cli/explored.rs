//! The bundle of a part of an exploration, and its parts joined.

use std::fmt::Write as _;
use std::path::Path;

use super::args::Format;
use super::exit::Exit;
use super::problem::Problem;
use super::result_bundle;
use tck_base::verdict::Verdict;
use tck_explore::saved::{ExploredResult, FoundResult, RESULT_FORMAT};
use tck_report::junit::Plain;

/// Whether a bundle is that of a part of an exploration, or of parts that were joined.
pub(super) fn is_exploration(folder: &Path) -> bool {
    read(folder).is_ok_and(|result| result.format == RESULT_FORMAT)
}

/// Reads the result of a bundle.
pub(super) fn read(folder: &Path) -> Result<ExploredResult, Problem> {
    result_bundle::read(folder)
}

/// Writes a bundle, and gives its root hash. What was joined has the shortest conversations as tests.
pub(super) fn write(result: &ExploredResult, folder: &Path) -> Result<String, Problem> {
    let shortest = if result.merged.is_some() {
        let all = result.findings.iter().chain(&result.remarks);
        all.map(|one| (file_of(one), one.test.clone())).collect()
    } else {
        Vec::new()
    };
    result_bundle::write(result, &cases(result), shortest, folder)
}

/// Where a joined bundle has the conversation of a finding. A result may have been written by anybody.
fn file_of(found: &FoundResult) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_lowercase()
        } else {
            '-'
        }
    };
    let name: String = found.requirement.chars().take(60).map(plain).collect();
    format!("tests/{name}.yaml")
}

/// A case for the conversations, and one for each requirement that is broken and for everything that is missing.
fn cases(result: &ExploredResult) -> Vec<Plain> {
    let suite = format!(
        "exploration of a device ({}), VDA 5050 {}",
        result.role, result.protocol
    );
    let case = |name: &str, verdict: Verdict, text: String| Plain {
        suite: suite.clone(),
        name: name.to_owned(),
        verdict,
        elsewhere: None,
        text,
    };
    let held = match result.conversations > result.undecided {
        true => Verdict::Pass,
        false => Verdict::Inconclusive,
    };
    let mut all = vec![case("conversations were held", held, counted(result))];
    for one in &result.findings {
        all.push(case(
            &one.requirement,
            one.verdict,
            format!("{}\n{}", one.message, one.by.join(", ")),
        ));
    }
    let troubles = result.merged.iter().flat_map(|merged| &merged.troubles);
    all.extend(troubles.map(|trouble| case("every part is there", Verdict::Inconclusive, trouble.to_string())));
    all
}

fn counted(result: &ExploredResult) -> String {
    let mut text = format!(
        "{} of {} conversations of {} stimuli, seed {}",
        result.conversations, result.planned, result.stimuli, result.seed
    );
    if let Some(merged) = &result.merged {
        let _ = write!(text, ", in {} parts", merged.of);
    }
    if result.undecided > 0 {
        let why = result.why.as_deref().unwrap_or("no reason was given");
        let _ = write!(
            text,
            "; {} of them could not be carried to their end: {why}",
            result.undecided
        );
    }
    text
}

/// Says what came out of parts that were joined.
pub(super) fn show(result: &ExploredResult, format: Format) -> Result<Exit, Problem> {
    if format == Format::Json {
        let text = serde_json::to_string_pretty(result).map_err(|error| Problem::Environment(error.to_string()))?;
        super::print(&format!("{text}\n"))?;
        return Ok(Exit::of(result.verdict));
    }
    let mut text = String::new();
    let findings = result.findings.iter().map(|one| {
        let word = match one.verdict {
            Verdict::Fail => "FAIL",
            _ => "WARNING",
        };
        (word, one)
    });
    for (word, one) in findings.chain(result.remarks.iter().map(|one| ("REMARK", one))) {
        let parts: Vec<String> = one.parts.iter().map(ToString::to_string).collect();
        let _ = writeln!(text, "{word} {}  {}", one.requirement, one.message);
        let _ = writeln!(
            text,
            "  by       {}; conversations: {}; parts: {}",
            one.by.join(", "),
            one.conversations,
            parts.join(", ")
        );
        let _ = writeln!(text, "  shortest {} ({})", one.shortest.join(", "), file_of(one));
    }
    let _ = writeln!(text, "{}", counted(result));
    let troubles = result.merged.iter().flat_map(|merged| &merged.troubles);
    for trouble in troubles {
        let _ = writeln!(text, "not the whole: {trouble}");
    }
    let _ = match result.findings.len() {
        0 => writeln!(text, "no finding"),
        count => writeln!(text, "findings: {count}"),
    };
    super::print(&text)?;
    Ok(Exit::of(result.verdict))
}
