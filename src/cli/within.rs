//! Outputs that would lie in a bundle: with a file more it would not be what its manifest says any more.
//!
//! Every output that a command line names is looked at before anything is written. What becomes a bundle itself may lie where
//! one of its kind lies, and is written over.

use std::path::{Path, PathBuf};

use super::args::{Cli, Command, HistoryTo, OutputArgs, RenderedTo, Simulated};
use super::problem::Problem;
use super::qualified;
use tck_audit::saved;
use tck_base::diagnostic::Diagnostic;
use tck_journal::file;
use tck_report::manifest::{self, Manifest};

/// An output: the argument that names it, and its file or folder.
type Output<'a> = (&'static str, &'a Path);

/// Refuses a command line that asks for something to be written into a bundle.
pub(super) fn refuse(cli: &Cli) -> Result<(), Problem> {
    let bundles = Bundles::of(&cli.command);
    let log = cli.log_file.as_deref().map(|file| ("--log-file", file));
    let all = named(&cli.command).into_iter().chain(log);
    let wrong: Vec<Diagnostic> = all
        .filter_map(|output| Some(refused(output, &bundles.around(output.1)?)))
        .collect();
    if wrong.is_empty() { Ok(()) } else { Err(wrong.into()) }
}

/// Refuses a folder that is named elsewhere than on the command line, and would lie in a bundle.
pub(super) fn refuse_folder(by: &'static str, folder: &Path) -> Result<(), Problem> {
    match Bundles::default().around(folder) {
        Some(bundle) => Err(refused((by, folder), &bundle).into()),
        None => Ok(()),
    }
}

fn refused((by, path): Output<'_>, bundle: &Path) -> Diagnostic {
    let title = format!(
        "`{by}`: {} would lie in the bundle {}, which would not be what its manifest says any more",
        path.display(),
        bundle.display()
    );
    Diagnostic::whole("usage", title).hint("name a place outside of the bundle; nothing was written into it")
}

/// Which folders are bundles, for one command.
#[derive(Clone, Debug, Default)]
pub(super) struct Bundles {
    /// The folder that is read, though it may have no manifest yet.
    read: Option<PathBuf>,
    /// The folder that the command itself makes a bundle of.
    made: Option<PathBuf>,
}

impl Bundles {
    /// Those of a command.
    pub(super) fn of(command: &Command) -> Self {
        let real = |folder: Option<&Path>| folder.and_then(|folder| folder.canonicalize().ok());
        match command {
            Command::Report(report) => Self {
                read: real(report.directory.as_deref())
                    .filter(|folder| folder.join("result.json").is_file() || file::find(folder).is_file()),
                made: real(report.out.as_deref()),
            },
            Command::Audit(audit) => Self {
                made: real(audit.out.as_deref()).filter(|folder| !is_bundle(folder) || saved::is_audit(folder)),
                ..Self::default()
            },
            Command::Qualify(qualify) => Self {
                made: real(qualify.out.as_deref())
                    .filter(|folder| !is_bundle(folder) || qualified::is_qualification(folder)),
                ..Self::default()
            },
            _ => Self::default(),
        }
    }

    /// The bundle that a file or folder would lie in, or be.
    pub(super) fn around(&self, path: &Path) -> Option<PathBuf> {
        let absolute = std::path::absolute(path).ok()?;
        // Some files are written where a link leads, others where it lies.
        let leads = place(&absolute, LINKS);
        let lies = absolute.parent().and_then(|folder| place(folder, LINKS));
        let mut folders = leads.iter().chain(&lies).flat_map(|path| path.ancestors());
        let is_one = |folder: &Path| {
            let is_made = self.made.as_deref() == Some(folder);
            !is_made && (self.read.as_deref() == Some(folder) || is_bundle(folder))
        };
        folders.find(|folder| is_one(folder)).map(Path::to_owned)
    }
}

/// So many links that lead to nothing yet are followed, one after the other, as the operating system does.
const LINKS: usize = 40;

/// What is there of the place where a path leads, even if it does so over a link to something that is not there yet.
fn place(path: &Path, links: usize) -> Option<PathBuf> {
    for one in path.ancestors() {
        if let Ok(there) = one.canonicalize() {
            return Some(there);
        }
        let (Ok(target), Some(folder)) = (one.read_link(), one.parent()) else {
            continue;
        };
        let rest = path.strip_prefix(one).ok()?;
        let mut on = folder.join(target);
        // Nothing joined would still end the path in a separator, behind which no link is read.
        if !rest.as_os_str().is_empty() {
            on.push(rest);
        }
        return place(&on, links.checked_sub(1)?);
    }
    None
}

fn is_bundle(folder: &Path) -> bool {
    folder.join(manifest::NAME).is_file() && Manifest::read(folder).is_ok()
}

/// Every output that a command names.
fn named(command: &Command) -> Vec<Output<'_>> {
    match command {
        Command::Run(run) if run.selection.plan => one("--floor", run.selection.floor.as_deref()),
        Command::Run(run) => [of_a_run(&run.output), rendered(&run.pipeline.renderings)].concat(),
        Command::Certify(certify) => [of_a_run(&certify.output), rendered(&certify.pipeline.renderings)].concat(),
        Command::Explore(explore) => of_a_run(&explore.output),
        Command::Report(report) => [
            rendered(&report.renderings),
            one("--package", report.package.as_deref()),
            one("--out", report.out.as_deref()),
        ]
        .concat(),
        Command::Audit(audit) => [
            one("--out", audit.out.as_deref()),
            one("--export", audit.export.as_deref()),
        ]
        .concat(),
        Command::Watch(watch) => one("--record", watch.record.as_deref()),
        Command::Campaign(campaign) => one("--out", campaign.out.as_deref()),
        Command::History(history) => drawn(&history.renderings),
        Command::Migrate(migrate) => drawn(&migrate.renderings),
        Command::Qualify(qualify) => one("--out", qualify.out.as_deref()),
        Command::Init(init) => match &init.suites {
            Some(folder) => vec![("--suites", folder.as_path())],
            None => vec![("--file", init.file.as_path())],
        },
        Command::Man(man) => one("--dir", man.dir.as_deref()),
        Command::Simulate(simulate) => match &simulate.what {
            Simulated::Site(site) => one("--key", site.key.as_deref()),
            Simulated::Agv(_) | Simulated::MasterControl(_) => Vec::new(),
        },
        Command::List(_)
        | Command::Explain(_)
        | Command::Validate(_)
        | Command::Discover(_)
        | Command::Completions(_) => Vec::new(),
    }
}

fn one<'a>(by: &'static str, path: Option<&'a Path>) -> Vec<Output<'a>> {
    path.map(|path| (by, path)).into_iter().collect()
}

fn of_a_run(output: &OutputArgs) -> Vec<Output<'_>> {
    let events = output.events.as_deref().filter(|file| file.as_os_str() != "-");
    [one("--out", Some(output.out.as_path())), one("--events", events)].concat()
}

fn rendered(all: &[RenderedTo]) -> Vec<Output<'_>> {
    let files = all.iter().filter_map(|wanted| wanted.file.as_deref());
    files.map(|file| ("--as", file)).collect()
}

fn drawn(all: &[HistoryTo]) -> Vec<Output<'_>> {
    let files = all.iter().filter_map(|wanted| wanted.file.as_deref());
    files.map(|file| ("--as", file)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    /// A folder with the bundle `run`, and beside it what is none.
    fn folder() -> tempfile::TempDir {
        let root = tempfile::tempdir().expect("a folder");
        for name in ["run", "page"] {
            std::fs::create_dir(root.path().join(name)).expect("a folder");
        }
        std::fs::write(root.path().join("run/result.json"), "{}").expect("written");
        Manifest::write(&root.path().join("run")).expect("a manifest");
        std::fs::write(root.path().join("page/manifest.json"), "{\"name\":\"a page\"}").expect("written");
        root
    }

    #[test]
    fn no_output_of_any_command_may_lie_in_a_bundle() {
        let root = folder();
        let place = |name: &str| root.path().join(name).display().to_string();
        let refuses = |text: &str, name: &str| {
            let words = text.replace('@', &place(name));
            let words = std::iter::once("vda5050-tck").chain(words.split(' '));
            refuse(&Cli::try_parse_from(words).expect("a command line")).is_err()
        };
        for text in [
            "run --virtual --as junit=@/x.xml",
            "run --virtual --as allure=@/results",
            "run --virtual --out @",
            "run --virtual --events @/x.jsonl",
            "run --virtual --plan --floor @/x.svg",
            "certify --profile device.toml --as junit=@/new/x.xml",
            "explore --virtual --out @",
            "report somewhere --as ctrf=@/x.json",
            "report somewhere --package @/x.zip",
            "report --merge parts --out @/joined",
            "audit x.jsonl --out @",
            "audit x.jsonl --out @/audit",
            "audit x.jsonl --export @/tables",
            "watch --broker mqtt://127.0.0.1:1 --record @/x.jsonl",
            "campaign x.toml --out @/results",
            "history somewhere --as html=@/x.html",
            "migrate x.jsonl --to 3.0 --as html=@/x.html",
            "qualify --out @/proof",
            "init --file @/device.toml",
            "init --suites @/suites",
            "man --dir @/man",
            "simulate site --key @/key",
            "list tests --log-file @/x.log",
        ] {
            assert!(refuses(text, "run"), "{text}");
            assert!(!refuses(text, "page"), "{text}: a manifest of something else");
            assert!(!refuses(text, "new"), "{text}: a folder that is not there yet");
        }
        assert!(!refuses("run --virtual --events -", "run"));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_into_a_bundle_is_no_way_around_though_it_leads_to_nothing_yet() {
        use std::os::unix::fs::symlink;
        let root = folder();
        let at = |name: &str| root.path().join(name);
        std::fs::create_dir(at("links")).expect("a folder");
        for (link, to) in [
            ("links/file", at("run/new.xml")),
            ("links/relative", PathBuf::from("../run/new.xml")),
            ("links/folder", at("run/new")),
            ("links/second", PathBuf::from("relative")),
            ("links/round", PathBuf::from("round")),
            ("links/harmless", at("page/new.xml")),
        ] {
            symlink(to, at(link)).expect("a link");
        }
        let around = |name: &str| Bundles::default().around(&at(name));
        let bundle = at("run").canonicalize().ok();
        for link in [
            "links/file",
            "links/relative",
            "links/folder",
            "links/folder/deep/x.xml",
            "links/second",
        ] {
            assert_eq!(around(link), bundle, "{link}");
        }
        for link in ["links/round", "links/harmless", "links/new"] {
            assert_eq!(around(link), None, "{link}");
        }
    }

    #[test]
    fn a_bundle_of_its_own_kind_is_written_over_and_a_run_without_a_manifest_is_a_bundle_for_its_report() {
        let root = folder();
        let place = |name: &str| root.path().join(name).display().to_string();
        let audit = Cli::try_parse_from(["vda5050-tck", "audit", "x.jsonl", "--out", &place("run")]);
        let audit = audit.expect("a command line");
        assert!(refuse(&audit).is_err());
        let format = format!("{{\"format\":\"{}\"}}", tck_audit::result::RESULT_FORMAT);
        std::fs::write(root.path().join("run/result.json"), format).expect("written");
        assert!(refuse(&audit).is_ok());
        std::fs::create_dir(root.path().join("killed")).expect("a folder");
        std::fs::write(root.path().join("killed/journal.jsonl"), "").expect("written");
        let wanted = format!("junit={}", place("killed/x.xml"));
        let report = Cli::try_parse_from(["vda5050-tck", "report", &place("killed"), "--as", &wanted]);
        assert!(refuse(&report.expect("a command line")).is_err());
    }
}
