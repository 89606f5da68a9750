//! `report` for the bundle of an audit: verified, compared with another one, and rendered for pipelines.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::args::{Format, Rendering, Report};
use super::exit::Exit;
use super::outputs::{Content, Outputs};
use super::problem::Problem;
use tck_audit::result::AuditResult;
use tck_audit::saved::{self, Lies};
use tck_audit::{bundle, page};
use tck_base::diagnostic::Diagnostic;
use tck_judge::Library;
use tck_report::clean::line;
use tck_report::compare::{Comparison, Outcome};
use tck_report::manifest::Manifest;
use tck_run::sources;

fn read(folder: &Path) -> Result<AuditResult, Problem> {
    saved::read(folder).map_err(|error| Diagnostic::whole("result", error.to_string()).into())
}

/// What `report` does with the bundle of an audit.
pub fn report(folder: &Path, arguments: &Report, outputs: &Outputs<'_>) -> Result<Exit, Problem> {
    if !arguments.renderings.is_empty() {
        let library = crate::assets::library(arguments.suites.own())?;
        return rendered(folder, &library, arguments, outputs);
    }
    let papers = arguments.certificate || arguments.attestation || arguments.package.is_some();
    if arguments.rejudge || arguments.message.is_some() || papers {
        let title = format!("{} is the bundle of an audit, which has no journal", folder.display());
        let hint = "an audit takes --verify, --compare and --as; `audit RECORDING` judges its recordings again";
        return Err(Diagnostic::whole("usage", title).hint(hint).into());
    }
    let result = read(folder)?;
    let text = match arguments.format {
        Format::Text => page::page(&result),
        Format::Json => {
            let text =
                serde_json::to_string_pretty(&result).map_err(|error| Problem::Environment(error.to_string()))?;
            format!("{text}\n")
        }
    };
    super::print(&text)?;
    Ok(Exit::of(result.verdict))
}

/// What holds of the recordings of a bundle that is verified: a line for each, and whether none has changed.
pub fn recordings(folder: &Path) -> Result<(Vec<(String, Lies)>, bool), Problem> {
    let result = read(folder)?;
    let all: Vec<(String, Lies)> = saved::recordings(&result)
        .into_iter()
        .map(|(name, lies)| (name.to_owned(), lies))
        .collect();
    let holds = all.iter().all(|(_, lies)| *lies != Lies::Changed);
    Ok((all, holds))
}

/// How a recording lies there, for people.
pub fn told((name, lies): &(String, Lies)) -> String {
    let how = match lies {
        Lies::Same => "as it was",
        Lies::Changed => "changed since it was judged",
        Lies::Elsewhere => "not there, so not compared with its hash",
        Lies::Unknown => "without a hash: it came from standard input",
    };
    format!("recording {}: {how}\n", line(name))
}

fn rendered(folder: &Path, library: &Library, arguments: &Report, outputs: &Outputs<'_>) -> Result<Exit, Problem> {
    let refused = arguments
        .renderings
        .iter()
        .find(|wanted| !is_for_audits(wanted.rendering));
    if refused.is_some() || arguments.keys.is_some() {
        let title = "an audit has no tests, and is written as junit, markdown, code-quality or sarif only";
        return Err(Diagnostic::whole("usage", title).into());
    }
    let found = Manifest::verify(folder).map_err(|error| Diagnostic::whole("manifest", error.to_string()))?;
    if !found.holds() {
        let title = format!(
            "{} is not what its manifest says, and no paper is made of it\n{}",
            folder.display(),
            found.text().trim_end()
        );
        return Err(Diagnostic::whole("manifest", title).into());
    }
    let result = read(folder)?;
    let pack = super::pack(library, None)?;
    let quoted = sources(library, &pack);
    let text = |rendering: Rendering| match rendering {
        Rendering::Markdown => Ok(bundle::markdown(&result)),
        Rendering::CodeQuality => Ok(bundle::code_quality(&result)),
        Rendering::Sarif => Ok(bundle::sarif(&result, &quoted)),
        _ => bundle::junit(&result).map_err(|error| error.to_string()),
    };
    outputs
        .write_each(|rendering| text(rendering).map(Content::Text))
        .map_err(Problem::Environment)?;
    for wanted in arguments.renderings.iter().filter(|wanted| wanted.file.is_none()) {
        super::print(&text(wanted.rendering).map_err(Problem::Environment)?)?;
    }
    Ok(Exit::Conforms)
}

fn is_for_audits(rendering: Rendering) -> bool {
    match rendering {
        Rendering::Junit
        | Rendering::JunitRequirements
        | Rendering::Markdown
        | Rendering::CodeQuality
        | Rendering::Sarif => true,
        Rendering::JunitProperties | Rendering::Ctrf | Rendering::Allure | Rendering::Cyclonedx | Rendering::Svr => {
            false
        }
    }
}

/// Compares audits, each with the one before it.
pub fn compare(folders: &[PathBuf], format: Format) -> Result<Exit, Problem> {
    if let Some(other) = folders.iter().find(|folder| !saved::is_audit(folder)) {
        let title = format!("{} is no audit, and the others are", other.display());
        return Err(Diagnostic::whole("usage", title).into());
    }
    let audits: Vec<AuditResult> = folders.iter().map(|folder| read(folder)).collect::<Result<_, _>>()?;
    if let Some(why) = audits
        .windows(2)
        .find_map(|pair| saved::parts_differ(&pair[0], &pair[1]))
    {
        let title = format!("these audits cannot be compared: {why}");
        let hint = "join the parts first (report --merge), or compare a part with the same part of another audit";
        return Err(Diagnostic::whole("compare", title).hint(hint).into());
    }
    let names: Vec<String> = folders.iter().map(|folder| folder.display().to_string()).collect();
    let steps: Vec<Comparison> = audits
        .windows(2)
        .map(|pair| saved::compare(&pair[0], &pair[1]))
        .collect();
    if format == Format::Json {
        let steps = steps.iter().zip(names.windows(2));
        let steps = steps.map(|(step, names)| json!({ "before": names[0], "after": names[1], "changed": step }));
        let steps: Vec<Value> = steps.collect();
        super::print(&format!(
            "{:#}\n",
            json!({ "format": "vda5050-tck.comparison/1", "steps": steps })
        ))?;
    } else {
        for (step, names) in steps.iter().zip(names.windows(2)) {
            if steps.len() > 1 {
                super::print(&format!("{} -> {}\n", names[0], names[1]))?;
            }
            super::print(&step.text())?;
        }
    }
    Ok(match saved::outcome(&audits) {
        Outcome::Holds => Exit::Conforms,
        Outcome::Worse => Exit::DoesNotConform,
        Outcome::Undecided => {
            super::tell(
                "nothing became worse, but a failure was not seen again, or nothing was judged: nobody can say that it is mended",
            );
            Exit::Undecided
        }
    })
}
