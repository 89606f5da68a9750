//! The package for a customer or a laboratory: one zip with the bundle, the papers about it, and how to verify it.
//!
//! The same bundle gives the same bytes: files stand in the order of their names, and have no time. What a laboratory would refuse
//! is said first, in the package, too.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde_json::json;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::attestation::{self, Attestation};
use super::certificate::{self, CertificateError, OWED};
use super::clean::line;
use super::cyclonedx;
use super::manifest::{self, Manifest};
use super::sources::Sources;
use super::statement::{self, Gap};
use tck_base::verdict::Verdict;
use tck_result::RunResult;

/// The folder of the bundle in the package.
const BUNDLE: &str = "bundle";
/// From this length on a file needs the long form of zip.
const LONG: u64 = 0x7fff_ffff;

/// Why no package can be made.
#[derive(Debug, thiserror::Error)]
pub enum PackageError {
    /// A file cannot be read or written.
    #[error("cannot read or write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The package would lie in the bundle, which would not be what its manifest says any more.
    #[error("the package would lie in the bundle that it packs; name a file elsewhere")]
    Inside,
    /// Something else than a file is there, such as a pipe or a link, and is not replaced.
    #[error("{} is there and is no regular file; name another one", .0.display())]
    NoFile(PathBuf),
    /// A paper cannot be written.
    #[error("cannot write the papers: {0}")]
    Paper(String),
    /// The zip cannot be written.
    #[error("cannot write the package: {0}")]
    Zip(#[from] zip::result::ZipError),
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> PackageError {
    let path = path.to_owned();
    move |source| PackageError::Io { path, source }
}

/// A bundle that was found to be what its manifest says, and what is written about it.
#[derive(Clone, Copy, Debug)]
pub struct Package<'a> {
    /// The folder of the bundle.
    pub folder: &'a Path,
    /// Its result.
    pub result: &'a RunResult,
    /// What the papers quote.
    pub sources: &'a Sources,
    /// Its manifest.
    pub manifest: &'a Manifest,
}

/// What a laboratory would refuse, one sentence each; nothing when the run can be certified.
#[must_use]
pub fn refused(result: &RunResult) -> Vec<String> {
    let mut all: Vec<String> = certificate::refusals(result).iter().map(ToString::to_string).collect();
    match result.verdict {
        Some(Verdict::Fail) => all.push("the device does not conform: the paper is a test report".to_owned()),
        Some(Verdict::Inconclusive | Verdict::Error) => {
            all.push("conformance is not shown: the paper is a test report".to_owned());
        }
        Some(Verdict::Pass | Verdict::Warning) | None => {}
    }
    if let Some(why) = &result.mixed {
        all.push(line(why).into_owned());
    }
    let open = result.requirements.iter().filter(|one| match one.verdict {
        Some(verdict) => matches!(verdict, Verdict::Inconclusive | Verdict::Error),
        None => statement::gap(one) == Some(Gap::NotDecided),
    });
    match open.count() {
        0 => {}
        1 => all.push("1 requirement applies, can be tested, and was not decided".to_owned()),
        count => all.push(format!(
            "{count} requirements apply, can be tested, and were not decided"
        )),
    }
    if result.vantage == "subscriber" {
        all.push("the packets of the device were not seen, only what the broker delivered".to_owned());
    }
    if result.merged.is_some() {
        all.push(
            "the journals of the parts that were joined are not in the package: hand their bundles over, too"
                .to_owned(),
        );
    }
    let owed = OWED.iter().filter(|(setting, _)| result.setting(setting).is_none());
    all.extend(owed.map(|(_, what)| format!("not stated: {what}")));
    all
}

/// What whoever hands the package over should look at first, one sentence each.
#[must_use]
pub fn notices(result: &RunResult) -> Vec<&'static str> {
    let command = result.setting("device.command").is_some();
    let notice = "the command that starts the device stands in the bundle (result, report, journal) and in settings.json as it was \
                  given: see that it holds no secret";
    command.then_some(notice).into_iter().collect()
}

impl Package<'_> {
    /// Writes the package, and gives the names of what stands in it beside the bundle.
    ///
    /// # Errors
    /// See [`PackageError`]; what was at that place is still there then.
    pub fn write(&self, file: &Path) -> Result<Vec<String>, PackageError> {
        let beside = file.parent().filter(|folder| !folder.as_os_str().is_empty());
        let beside = beside.unwrap_or_else(|| Path::new("."));
        let there = beside.ancestors().find(|folder| folder.is_dir());
        let there = there.unwrap_or_else(|| Path::new("."));
        let place = there.canonicalize().map_err(failed(there))?;
        let bundle = self.folder.canonicalize().map_err(failed(self.folder))?;
        if place.starts_with(&bundle) {
            return Err(PackageError::Inside);
        }
        if std::fs::symlink_metadata(file).is_ok_and(|facts| !facts.is_file()) {
            return Err(PackageError::NoFile(file.to_owned()));
        }
        std::fs::create_dir_all(beside).map_err(failed(beside))?;
        let papers = self.papers()?;
        let mut unfinished = file.as_os_str().to_owned();
        unfinished.push(".part");
        let unfinished = PathBuf::from(unfinished);
        let written = self.fill(&unfinished, &papers);
        let moved = written.and_then(|()| std::fs::rename(&unfinished, file).map_err(failed(file)));
        if let Err(error) = moved {
            // What is half done helps nobody; the first error is the one to be told.
            let _ = std::fs::remove_file(&unfinished);
            return Err(error);
        }
        Ok(papers.into_iter().map(|(name, _)| name.to_owned()).collect())
    }

    fn fill(&self, path: &Path, papers: &[(&'static str, String)]) -> Result<(), PackageError> {
        let mut zip = ZipWriter::new(File::create(path).map_err(failed(path))?);
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(DateTime::default())
            .unix_permissions(0o644);
        for (name, text) in papers {
            zip.start_file(*name, options)?;
            zip.write_all(text.as_bytes()).map_err(failed(path))?;
        }
        let files = self.manifest.files.iter().map(|file| (file.path.as_str(), file.bytes));
        let mut files: Vec<(&str, u64)> = files.chain([(manifest::NAME, 0)]).collect();
        files.sort_unstable();
        for (name, bytes) in files {
            let from = self.folder.join(name);
            let mut content = File::open(&from).map_err(failed(&from))?;
            zip.start_file(format!("{BUNDLE}/{name}"), options.large_file(bytes > LONG))?;
            io::copy(&mut content, &mut zip).map_err(failed(&from))?;
        }
        zip.finish()?;
        Ok(())
    }

    /// The papers about the bundle, by the order of their names.
    fn papers(&self) -> Result<Vec<(&'static str, String)>, PackageError> {
        let Self {
            folder,
            result,
            sources,
            manifest,
        } = *self;
        let paper = |error: &dyn std::fmt::Display| PackageError::Paper(error.to_string());
        let path = folder.join(manifest::NAME);
        let bytes = std::fs::read(&path).map_err(failed(&path))?;
        let certificate = match certificate::render(result, sources, &manifest.root) {
            Ok(page) => Some(page),
            Err(error @ CertificateError::Template(_)) => return Err(paper(&error)),
            Err(_) => None,
        };
        let statement = Attestation::of(result, &bytes, &manifest.root);
        let mut all = vec![("README.txt", self.read_me(certificate.is_some()))];
        all.push(("attestation.json", statement.to_json().map_err(|error| paper(&error))?));
        all.extend(certificate.map(|page| ("certificate.html", page)));
        all.push(("cyclonedx.json", cyclonedx::render(result, sources, manifest)));
        all.push(("declared.json", self.declared()));
        all.push(("settings.json", self.settings()));
        all.push(("svr.json", attestation::simple(result, &bytes, &manifest.root)));
        Ok(all)
    }

    fn read_me(&self, has_certificate: bool) -> String {
        let root = &self.manifest.root;
        let mut text = format!(
            "{}\n{}\n\nTool   {}\nRun    {}, {}\nRoot   sha256:{root}\n",
            statement::device(self.result),
            statement::statement(self.result),
            line(&self.result.tool),
            line(&self.result.run),
            line(&self.result.started),
        );
        text.push_str("\nWhat a laboratory would refuse\n");
        let refused = refused(self.result);
        if refused.is_empty() {
            text.push_str("  nothing that can be seen here\n");
        }
        for why in refused {
            let _ = writeln!(text, "  - {why}");
        }
        let notices = notices(self.result);
        if !notices.is_empty() {
            text.push_str("\nWhat to look at before it is handed on\n");
        }
        for notice in notices {
            let _ = writeln!(text, "  - {notice}");
        }
        text.push_str("\nWhat is in it\n");
        let rows = [
            (
                "certificate.html",
                "the certificate, or the test report of a device that does not conform; any browser prints it",
            ),
            (
                "bundle/report.html",
                "the report, with all findings and the messages they rest on",
            ),
            (
                "bundle/",
                "the evidence: result, journal, JUnit, and the manifest with the hash of each file",
            ),
            (
                "declared.json",
                "what the device and its maker declare: capabilities with their sources, deviations, known failures",
            ),
            (
                "settings.json",
                "the profile as it took effect, each setting with its origin; no password of a broker",
            ),
            (
                "attestation.json",
                "in-toto statement of the type test result, to be signed",
            ),
            (
                "svr.json",
                "in-toto statement of the type simple verification result, to be signed",
            ),
            (
                "cyclonedx.json",
                "CycloneDX attestations: a claim for each requirement that was decided",
            ),
        ];
        for (name, what) in rows
            .iter()
            .filter(|(name, _)| has_certificate || *name != "certificate.html")
        {
            let _ = writeln!(text, "  {name:<19} {what}");
        }
        let _ = write!(
            text,
            "\nHow to verify it\n  vda5050-tck report --verify --root sha256:{root} bundle\n  vda5050-tck report --rejudge bundle\n\
             The first says whether the files are those that the root hash is about, the second derives all verdicts from the\n\
             recorded messages again. Without the tool: the root hash is the SHA-256 of what sha256sum prints for the files of\n\
             bundle/manifest.json in the order of their names:\n\
             \x20 cd bundle && jq -r '.files[].path' manifest.json | tr '\\n' '\\0' | xargs -0 sha256sum | sha256sum\n\
             Compare it with the one that was told to you on another way than this file.\n"
        );
        text
    }

    fn declared(&self) -> String {
        let result = self.result;
        let capabilities = result
            .capabilities
            .iter()
            .map(|one| json!({ "name": line(&one.name), "value": line(&one.value), "source": line(&one.source) }));
        let known = result.settings.iter().filter_map(|setting| {
            let id = setting.name.strip_prefix("known.")?;
            Some(json!({ "id": line(id), "reason": line(&setting.value) }))
        });
        let deviations = result
            .deviations
            .iter()
            .map(|(requirement, reason)| json!({ "requirement": line(requirement), "reason": line(reason) }));
        let declared = json!({
            "capabilities": capabilities.collect::<Vec<_>>(),
            "deviations": deviations.collect::<Vec<_>>(),
            "knownFailures": known.collect::<Vec<_>>(),
        });
        format!("{declared:#}\n")
    }

    fn settings(&self) -> String {
        let all = self
            .result
            .settings
            .iter()
            .map(|one| json!({ "name": line(&one.name), "value": line(&one.value), "origin": line(&one.origin) }));
        format!("{:#}\n", serde_json::Value::Array(all.collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_journal::event::Setting;

    #[test]
    fn the_command_of_the_device_is_named_in_the_package_where_there_is_one() {
        let mut result = crate::findings::tests::run(&[], &[]);
        let sources = Sources::default();
        let manifest = Manifest {
            format: manifest::FORMAT.to_owned(),
            files: Vec::new(),
            root: "0".repeat(64),
        };
        let read_me = |result: &RunResult| {
            let package = Package {
                folder: Path::new("run"),
                result,
                sources: &sources,
                manifest: &manifest,
            };
            package.read_me(false)
        };
        let without = read_me(&result);
        assert!(!without.contains("the command that starts"), "{without}");
        result.settings = vec![Setting::shown("device.command", "./agv --token x", "device.toml")];
        let with = read_me(&result);
        assert!(
            with.contains("the command that starts the device") && with.contains("no secret"),
            "{with}"
        );
        assert!(!with.contains("--token"), "{with}");
    }
}
