//! What is wrong with the entries of a campaign, found before the first of their runs begins.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Parser as _;

use super::super::args::{Cli, Command, Run, SuiteArgs};
use super::super::problem::Problem;
use super::super::{certify, run};
use super::crew::{LISTEN, NOT_INHERITED};
use tck_base::diagnostic::Diagnostic;
use tck_campaign::{Entry, Place};
use tck_judge::Library;
use tck_profile::Surroundings;

/// Folder of suites, and whether it takes the place of the built-in ones.
type Suites = (Option<PathBuf>, bool);

/// Every mistake in what these entries test: their profiles, tests, suites, and what those name. What depends on the device or
/// its surroundings is found by the run.
pub(super) fn mistakes<'e>(entries: impl Iterator<Item = &'e Entry>, root: &Path) -> Vec<Diagnostic> {
    let mut libraries = BTreeMap::new();
    let mut all: Vec<Diagnostic> = Vec::new();
    for entry in entries {
        if let Err(Problem::Usage(found)) = check(entry, root, &mut libraries) {
            for one in found.into_iter().map(|one| placed(one, entry)) {
                // A profile that is wrong is so for each suite.
                if !all.contains(&one) {
                    all.push(one);
                }
            }
        }
    }
    all
}

/// A mistake in a file stands at its place there, another one at that of the suite in the campaign.
fn placed(found: Diagnostic, entry: &Entry) -> Diagnostic {
    if let Some(span) = &found.span
        && Path::new(span.source.name.as_str()).is_file()
    {
        return found;
    }
    let at = found.span.as_ref().map(|span| format!(" ({})", span.text()));
    let title = format!("{}: {}{}", entry.name(), found.title, at.unwrap_or_default());
    let placed = Diagnostic::new("campaign", entry.span.clone(), title, "of this suite");
    match found.hint {
        Some(hint) => placed.hint(hint),
        None => placed.hint(format!("the call is `vda5050-tck {}`", entry.words().join(" "))),
    }
}

fn check(entry: &Entry, root: &Path, libraries: &mut BTreeMap<Suites, Library>) -> Result<(), Problem> {
    let mut surroundings = Surroundings::of_process();
    for name in NOT_INHERITED {
        surroundings.environment.remove(name);
    }
    if let Some(listen) = &entry.listen {
        surroundings.environment.insert(LISTEN.to_owned(), listen.clone());
    }
    let words = std::iter::once("vda5050-tck".to_owned()).chain(entry.words());
    let call: Run = match Cli::try_parse_from(words).map(|cli| cli.command) {
        Ok(Command::Run(mut call)) => {
            call.device.profile.clone_from(&entry.profile);
            call.output.out = Place::of(root, entry).reports();
            call
        }
        Ok(Command::Certify(mut call)) => {
            call.profile.clone_from(&entry.profile);
            certify::as_run(&call, &surroundings)?
        }
        // It was held against the command line before.
        Ok(_) | Err(_) => return Ok(()),
    };
    let library = library(&call.suites, libraries)?;
    run::check(&call, library, &surroundings)
}

/// The suites of a call, which are read once.
fn library(suites: &SuiteArgs, known: &mut BTreeMap<Suites, Library>) -> Result<Library, Problem> {
    let name = (suites.suites.clone(), suites.replace_suites);
    if let Some(library) = known.get(&name) {
        return Ok(library.clone());
    }
    let library = crate::assets::library(suites.own())?;
    known.insert(name, library.clone());
    Ok(library)
}
