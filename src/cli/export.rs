//! `report --certificate`, `--attestation`, `--package` and `--as`: papers about a bundle that has not been changed.

use std::path::Path;

use serde_json::json;

use super::args::{Format, Report};
use super::exit::Exit;
use super::outputs::{Content, Outputs, Shown};
use super::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_journal::Event;
use tck_journal::file::{self, Recording};
use tck_judge::Library;
use tck_report::attestation::Attestation;
use tck_report::certificate::{self, CertificateError};
use tck_report::keys::Keys;
use tck_report::package::{self, Package, PackageError};
use tck_report::{json as result_file, manifest};
use tck_result::RunResult;
use tck_run::sources;

/// Prints the certificate of a run as HTML.
pub fn certificate(folder: &Path) -> Result<Exit, Problem> {
    let library = crate::assets::library(None)?;
    let (result, root) = intact(folder, &library)?;
    let pack = super::pack(&library, Some(&result.protocol))?;
    let quoted = sources(&library, &pack);
    let page = certificate::render(&result, &quoted, &root).map_err(|error| match error {
        CertificateError::Template(_) => Problem::Environment(error.to_string()),
        why => {
            let title = format!("there is no certificate for {}: {why}", folder.display());
            let hint = "`vda5050-tck certify` makes a run for a certificate; its report is the one of any run";
            Diagnostic::whole("certificate", title).hint(hint).into()
        }
    })?;
    super::print(&page)
}

/// Prints the profile of a run, without what may be secret.
pub fn profile(folder: &Path) -> Result<Exit, Problem> {
    let recorded = file::read(&file::find(folder)).ok().and_then(|recording| {
        let first = recording.journal.entries().first()?;
        match first.event() {
            Event::RunBegun { header } => Some(header.settings.clone()),
            _ => None,
        }
    });
    let settings = match recorded {
        Some(settings) => settings,
        // Parts that were joined have a journal each, and their settings in common.
        None => {
            result_file::read(&folder.join("result.json"))
                .map_err(|error| Problem::from(Diagnostic::whole("result", error.to_string())))?
                .settings
        }
    };
    let Some(text) = tck_profile::written(&settings) else {
        let title = format!(
            "there is no profile in {}: nothing was set but defaults, or an earlier version of this program made the run",
            folder.display()
        );
        let hint = "`vda5050-tck init` writes a profile from what a device shows";
        return Err(Diagnostic::whole("profile", title).hint(hint).into());
    };
    super::print(&text)
}

/// Prints an in-toto statement about the bundle of a run.
pub fn attestation(folder: &Path, library: &Library) -> Result<Exit, Problem> {
    let (result, root) = intact(folder, library)?;
    let path = folder.join(manifest::NAME);
    let bytes = std::fs::read(&path)
        .map_err(|error| Problem::Environment(format!("cannot read {}: {error}", path.display())))?;
    let text = Attestation::of(&result, &bytes, &root).to_json();
    super::print(&text.map_err(|error| Problem::Environment(error.to_string()))?)
}

/// Prints a run for a pipeline, or writes it into files.
pub fn rendered(folder: &Path, library: &Library, arguments: &Report, outputs: &Outputs<'_>) -> Result<Exit, Problem> {
    let (result, root) = intact(folder, library)?;
    let pack = super::pack(library, Some(&result.protocol))?;
    let shown = Shown {
        result: &result,
        sources: &sources(library, &pack),
        inconclusive: arguments.inconclusive,
        root: Some(&root),
        folder,
        keys: match &arguments.keys {
            Some(file) => keys(file)?,
            None => Keys::default(),
        },
    };
    outputs.write(&shown).map_err(Problem::Environment)?;
    for wanted in arguments.renderings.iter().filter(|wanted| wanted.file.is_none()) {
        if let Content::Text(text) = shown.content(wanted.rendering).map_err(Problem::Environment)? {
            super::print(&text)?;
        }
    }
    Ok(Exit::Conforms)
}

/// The keys of test management that stand in a file.
fn keys(file: &Path) -> Result<Keys, Problem> {
    let wrong = |why: String| Problem::from(Diagnostic::whole("keys", format!("{}: {why}", file.display())));
    let text = std::fs::read_to_string(file).map_err(|error| wrong(error.to_string()))?;
    Keys::of_file(&text).map_err(|error| wrong(error.to_string()))
}

/// Writes the package for a customer or a laboratory, and says first what a laboratory would refuse.
pub fn package(folder: &Path, library: &Library, file: &Path, format: Format) -> Result<Exit, Problem> {
    let (result, root) = intact(folder, library)?;
    let pack = super::pack(library, Some(&result.protocol))?;
    let manifest = manifest::Manifest::read(folder)
        .map_err(|error| Problem::from(Diagnostic::whole("manifest", error.to_string())))?;
    let package = Package {
        folder,
        result: &result,
        sources: &sources(library, &pack),
        manifest: &manifest,
    };
    let refused = package::refused(&result);
    let notices = package::notices(&result);
    if format == Format::Text {
        let mut text = match refused.as_slice() {
            [] => "a laboratory would refuse nothing that can be seen here\n".to_owned(),
            some => format!("a laboratory would refuse:\n  - {}\n", some.join("\n  - ")),
        };
        text.extend(notices.iter().map(|notice| format!("{notice}\n")));
        super::print(&text)?;
    }
    let papers = package.write(file).map_err(|error| match error {
        PackageError::Inside | PackageError::NoFile(_) => Problem::from(Diagnostic::whole("usage", error.to_string())),
        error => Problem::Environment(error.to_string()),
    })?;
    let shown = file.display().to_string();
    super::print(&match format {
        Format::Text => format!(
            "{shown}: the bundle, and {}\nroot    sha256:{root}\n",
            papers.join(", ")
        ),
        Format::Json => format!(
            "{}\n",
            json!({ "package": shown, "root": format!("sha256:{root}"), "refused": refused, "notices": notices,
                "papers": papers })
        ),
    })
}

/// The result of a bundle and its root hash, when every file is what the manifest says and the journal gives this result.
fn intact(folder: &Path, library: &Library) -> Result<(RunResult, String), Problem> {
    let found = manifest::Manifest::verify(folder)
        .map_err(|error| Problem::from(Diagnostic::whole("manifest", error.to_string())))?;
    if !found.holds() {
        let title = format!(
            "{} is not what its manifest says, and no paper is made of it\n{}",
            folder.display(),
            found.text().trim_end()
        );
        return Err(Diagnostic::whole("manifest", title).into());
    }
    if super::merge::is_merged(folder) {
        return Ok((super::merge::as_saved(folder, library)?, found.root));
    }
    let journal_path = file::find(folder);
    let Recording { journal, .. } =
        file::read(&journal_path).map_err(|error| Problem::from(Diagnostic::whole("journal", error.to_string())))?;
    let result = super::rejudged::judged(library, &journal, (folder, &journal_path))?;
    let path = folder.join("result.json");
    let saved =
        result_file::read(&path).map_err(|error| Problem::from(Diagnostic::whole("result", error.to_string())))?;
    if saved != result {
        let title = format!("the journal does not give the result that is in {}", path.display());
        let hint = "`report --rejudge` shows what differs; another version of the tool may judge otherwise";
        return Err(Diagnostic::whole("result", title).hint(hint).into());
    }
    Ok((result, found.root))
}
