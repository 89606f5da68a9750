//! The folder of one entry: what it was begun with, how far its runs came, and how it ended.
//!
//! Everything is read from the folder, so that nothing has to be remembered by a process that may be killed: `entry.json` is written
//! before the first run, the stream of events of each run says where its bundle is and whether it came to its end, and
//! `settled.json` is written when that is known. While a run goes on it holds a lock on `lock`, whatever becomes of the
//! campaign that has started it.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use tck_journal::file;
use tck_report::clean::{line, short};
use tck_report::json::write_atomically;
use tck_report::manifest::{Manifest, digest};

use crate::plan::Entry;

/// Written before the first run.
const BEGUN: &str = "entry.json";
/// Written when it is known how it ended.
const SETTLED: &str = "settled.json";
/// The exit codes of a run that has judged: conforms, does not conform, undecided.
const JUDGED: [u8; 3] = [0, 1, 3];
/// What somebody has interrupted.
const INTERRUPTED: u8 = 130;
/// What broke.
const BROKEN: u8 = 5;
/// What a line begins with behind which the output of the next run stands.
const RUN: &str = "campaign: run ";
/// How much of the end of an output is looked at.
const END: u64 = 64 * 1024;

/// The folder of one entry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The folder of the campaign.
    root: PathBuf,
    /// The folder of the entry below it.
    name: String,
}

/// How far an entry has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stand {
    /// No run of it has begun to test.
    New,
    /// A run broke off, and left this bundle to go on with.
    BrokenOff(PathBuf),
    /// It has come to its end.
    Settled(Settled),
}

/// How an entry ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settled {
    /// The exit code of its last run.
    pub exit: u8,
    /// Its bundle, below the folder of the campaign.
    pub bundle: Option<String>,
    /// The root hash of the bundle.
    pub root: Option<String>,
    /// The verdict of the run; a word of `run-ended`.
    pub verdict: Option<String>,
    /// What the run says in one sentence, or why there is none.
    pub said: String,
    /// How many runs it took.
    pub attempts: u64,
}

/// Why an entry cannot be begun or gone on with.
#[derive(Debug)]
pub enum PlaceError {
    /// A file.
    Io(PathBuf, io::Error),
    /// It was begun in another way: what it was, and what it is.
    Other(String, String),
}

impl std::fmt::Display for PlaceError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Io(path, error) => write!(f, "cannot read or write {}: {error}", path.display()),
            Self::Other(before, now) => write!(f, "it was begun as `{before}`, and now is `{now}`"),
        }
    }
}

impl std::error::Error for PlaceError {}

impl Place {
    /// The folder of an entry below the folder of its campaign.
    #[must_use]
    pub fn of(root: &Path, entry: &Entry) -> Self {
        Self {
            root: root.to_owned(),
            name: entry.name(),
        }
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> PathBuf {
        self.root.join(&self.name)
    }

    /// The folder for the bundles of its runs.
    #[must_use]
    pub fn reports(&self) -> PathBuf {
        self.folder().join("reports")
    }

    /// Where the runs print to.
    #[must_use]
    pub fn output(&self) -> PathBuf {
        self.folder().join("output.txt")
    }

    /// The file that the run of that number, counted from 1, prints to, behind what those before it have printed.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn begin_output(&self, attempt: u64) -> Result<File, PlaceError> {
        let path = self.output();
        let failed = |error| PlaceError::Io(path.clone(), error);
        let mut file = File::options().append(true).create(true).open(&path).map_err(failed)?;
        writeln!(file, "{RUN}{attempt}").map_err(failed)?;
        Ok(file)
    }

    /// The error that the last run has printed last, in one line with its place.
    fn complaint(&self) -> Option<String> {
        let mut file = File::open(self.output()).ok()?;
        let length = file.metadata().ok()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(END))).ok()?;
        let mut bytes = Vec::new();
        file.take(END).read_to_end(&mut bytes).ok()?;
        let text = String::from_utf8_lossy(&bytes);
        let lines: Vec<&str> = text.lines().collect();
        let begun = lines.iter().rposition(|line| line.starts_with(RUN));
        let lines = &lines[begun.unwrap_or(0)..];
        let (at, said) = lines
            .iter()
            .enumerate()
            .rev()
            .find_map(|(at, line)| Some((at, error_of(line)?)))?;
        let place = lines
            .get(at + 1)
            .and_then(|next| next.trim_start().strip_prefix("--> "));
        let place = place.map_or_else(String::new, |place| format!(" ({})", short(&line(place), 200)));
        Some(format!("{}{place}", short(&line(said), 300)))
    }

    /// The stream of events of the run of that number, counted from 1.
    #[must_use]
    pub fn events(&self, attempt: u64) -> PathBuf {
        self.folder().join(format!("events-{attempt}.jsonl"))
    }

    /// The lock that a run holds: whoever starts it takes the lock, and hands it on as standard input.
    ///
    /// # Errors
    /// When the file cannot be made.
    pub fn lock(&self) -> Result<File, PlaceError> {
        let path = self.folder().join("lock");
        let failed = |error| PlaceError::Io(path.clone(), error);
        std::fs::create_dir_all(self.folder()).map_err(failed)?;
        File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(failed)
    }

    /// Notes with what an entry is begun, or holds that it goes on with the same: command line, and the content of its profile.
    ///
    /// # Errors
    /// [`PlaceError::Other`] when it was begun with something else.
    pub fn begin(&self, entry: &Entry) -> Result<(), PlaceError> {
        let profile = entry
            .profile
            .as_ref()
            .and_then(|profile| digest(profile).ok())
            .map(|(_, hash)| hash);
        let listen = entry.listen.as_ref();
        let now = json!({ "words": entry.words(), "listen": listen, "profile": profile });
        let Some(begun) = read(&self.folder().join(BEGUN)) else {
            return self.write(BEGUN, &now);
        };
        if begun == now {
            return Ok(());
        }
        let shown = |value: &Value| {
            let words = value["words"].as_array().into_iter().flatten();
            let words: Vec<&str> = words.filter_map(Value::as_str).collect();
            let profile = value["profile"].as_str().and_then(|hash| hash.get(..12));
            let profile = profile.map_or_else(String::new, |hash| format!(" with the profile {hash}"));
            format!("{}{profile}", words.join(" "))
        };
        Err(PlaceError::Other(shown(&begun), shown(&now)))
    }

    /// How far it has come, read while no run of it goes on.
    #[must_use]
    pub fn stand(&self) -> Stand {
        if let Some(settled) = self.settled() {
            return Stand::Settled(settled);
        }
        let attempt = self.attempts();
        let told = Told::read(&self.events(attempt));
        if let Some(exit) = told.exit.filter(|_| !told.is_open()) {
            return Stand::Settled(self.judged(exit, attempt, &told));
        }
        // The newest run that has a bundle to go on with; one that was refused has none.
        let bundles = (1..=attempt).rev().map(|attempt| Told::read(&self.events(attempt)));
        let left = bundles
            .filter_map(|told| told.bundle)
            .find(|bundle| file::find(bundle).is_file());
        left.map_or(Stand::New, Stand::BrokenOff)
    }

    /// How many runs it has had.
    #[must_use]
    pub fn attempts(&self) -> u64 {
        let mut attempts = 0;
        while self.events(attempts + 1).exists() {
            attempts += 1;
        }
        attempts
    }

    /// What a run of it has come to, by the exit code of its process, which has none when a signal ended it; nothing when it was
    /// interrupted, or ended so while the campaign was being stopped, and can be gone on with.
    #[must_use]
    pub fn ended(&self, exit: Option<u8>, is_stopped: bool) -> Option<Settled> {
        let attempt = self.attempts();
        let told = Told::read(&self.events(attempt));
        match exit {
            Some(INTERRUPTED) => None,
            Some(exit) => Some(self.judged(exit, attempt, &told)),
            None if is_stopped => None,
            None => Some(self.judged(BROKEN, attempt, &told)),
        }
    }

    /// What a run has come to. A verdict without its whole evidence is none.
    fn judged(&self, exit: u8, attempts: u64, told: &Told) -> Settled {
        let mut settled = Settled {
            exit,
            bundle: told.bundle.as_ref().map(|bundle| self.below(bundle)),
            root: told.root.clone(),
            verdict: told.verdict.clone(),
            said: told.statement.clone().unwrap_or_default(),
            attempts,
        };
        if JUDGED.contains(&exit)
            && let Some(why) = lack(told, exit)
        {
            settled.exit = BROKEN;
            settled.said = why;
        }
        if !JUDGED.contains(&settled.exit)
            && let Some(why) = self.complaint()
            && !settled.said.contains(&why)
        {
            let before = if settled.said.is_empty() { "" } else { "; " };
            settled.said.push_str(&format!("{before}{why}"));
        }
        settled
    }

    fn below(&self, bundle: &Path) -> String {
        let below = bundle.strip_prefix(&self.root).unwrap_or(bundle);
        let parts: Vec<String> = below.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        parts.join("/")
    }

    /// Notes how it ended.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn settle(&self, settled: &Settled) -> Result<(), PlaceError> {
        let value = json!({ "exit": settled.exit, "bundle": settled.bundle, "root": settled.root,
            "verdict": settled.verdict, "said": settled.said, "attempts": settled.attempts });
        self.write(SETTLED, &value)
    }

    /// How it ended, as far as that was noted and its evidence is still there.
    fn settled(&self) -> Option<Settled> {
        let value = read(&self.folder().join(SETTLED))?;
        let text = |name: &str| value[name].as_str().map(str::to_owned);
        let mut settled = Settled {
            exit: value["exit"].as_u64().and_then(|exit| u8::try_from(exit).ok())?,
            bundle: text("bundle"),
            root: text("root"),
            verdict: text("verdict"),
            said: text("said").unwrap_or_default(),
            attempts: value["attempts"].as_u64().unwrap_or_default(),
        };
        if JUDGED.contains(&settled.exit) {
            let bundle = settled.bundle.as_ref().map(|bundle| self.root.join(bundle));
            let found = bundle.and_then(|bundle| Manifest::verify(&bundle).ok());
            if !found.is_some_and(|found| found.holds() && Some(&found.root) == settled.root.as_ref()) {
                settled.exit = BROKEN;
                "its bundle has gone, or is not what it was when the run ended".clone_into(&mut settled.said);
            }
        }
        Some(settled)
    }

    /// Forgets how it ended, so that it is run again from the beginning. Its bundles stay.
    ///
    /// # Errors
    /// When a file cannot be moved away.
    pub fn again(&self) -> Result<(), PlaceError> {
        let folder = self.folder();
        let failed = |error| PlaceError::Io(folder.clone(), error);
        for attempt in 1..=self.attempts() {
            let mut number = 1;
            let before = |number: u64| folder.join(format!("before-{number}-{attempt}.jsonl"));
            while before(number).exists() {
                number += 1;
            }
            std::fs::rename(self.events(attempt), before(number)).map_err(failed)?;
        }
        match std::fs::remove_file(folder.join(SETTLED)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(failed(error)),
            _ => Ok(()),
        }
    }

    fn write(&self, name: &str, value: &Value) -> Result<(), PlaceError> {
        let path = self.folder().join(name);
        let failed = |error| PlaceError::Io(path.clone(), error);
        std::fs::create_dir_all(self.folder()).map_err(failed)?;
        write_atomically(&path, format!("{value:#}\n").as_bytes()).map_err(failed)
    }
}

/// What a line says, if it is the first one of an error.
fn error_of(text: &str) -> Option<&str> {
    let rest = text.strip_prefix("error")?;
    match rest.strip_prefix('[') {
        Some(rest) => Some(rest.split_once("]: ")?.1),
        None => rest.strip_prefix(": "),
    }
}

fn read(path: &Path) -> Option<Value> {
    serde_json::from_slice(&std::fs::read(path).ok()?).ok()
}

/// What the events of a run tell of it.
#[derive(Debug, Default)]
struct Told {
    bundle: Option<PathBuf>,
    exit: Option<u8>,
    root: Option<String>,
    verdict: Option<String>,
    statement: Option<String>,
}

impl Told {
    fn read(path: &Path) -> Self {
        let mut told = Self::default();
        let text = std::fs::read(path).unwrap_or_default();
        for line in text.split(|byte| *byte == b'\n') {
            let Ok(event) = serde_json::from_slice::<Value>(line) else {
                continue;
            };
            let text = |name: &str| event[name].as_str().map(str::to_owned);
            match event["event"].as_str() {
                Some("run-begun") => told.bundle = text("bundle").map(PathBuf::from),
                Some("run-ended") => {
                    told.exit = event["exit"].as_u64().and_then(|exit| u8::try_from(exit).ok());
                    let root = text("root");
                    told.root = root.map(|root| root.strip_prefix("sha256:").unwrap_or(&root).to_owned());
                    told.verdict = text("verdict");
                    told.statement = text("statement");
                }
                _ => {}
            }
        }
        told
    }

    /// Whether it can be gone on with: it did not come to its end, or somebody has interrupted it.
    fn is_open(&self) -> bool {
        self.exit.is_none_or(|exit| exit == INTERRUPTED)
    }
}

/// What is missing of the evidence of a run that has judged.
fn lack(told: &Told, exit: u8) -> Option<String> {
    let Some(bundle) = &told.bundle else {
        return Some(format!(
            "the run ended with exit code {exit}, and there is no bundle of it"
        ));
    };
    if told.exit != Some(exit) {
        return Some(format!(
            "the run ended with exit code {exit}, and its events do not say so"
        ));
    }
    match Manifest::verify(bundle) {
        Ok(found) if !found.holds() => Some("its bundle is not what its manifest says".to_owned()),
        Ok(found) if told.root.as_deref() != Some(found.root.as_str()) => {
            Some("its bundle is another one than its events say".to_owned())
        }
        Ok(_) => None,
        Err(error) => Some(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::diagnostic::Source;

    use crate::plan::Plan;

    fn entry(words: &str) -> Entry {
        let text = format!("[devices.a]\narguments = [\"--virtual\"]\n[suites.b]\ntests = [\"{words}\"]\n");
        let plan = Plan::read(&Source::new("c", text), Path::new("")).expect("a plan");
        plan.entries[0].clone()
    }

    /// A bundle as a run leaves it, and its root hash.
    fn bundle(place: &Place) -> (PathBuf, String) {
        let bundle = place.reports().join("x/1");
        std::fs::create_dir_all(&bundle).expect("folder");
        std::fs::write(bundle.join("journal.jsonl"), "").expect("journal");
        let root = Manifest::write(&bundle).expect("manifest").root;
        (bundle, root)
    }

    fn begun(bundle: &Path) -> String {
        format!("{}\n", json!({ "event": "run-begun", "bundle": bundle }))
    }

    #[test]
    fn how_far_an_entry_is_can_be_read_from_its_folder_alone() {
        let root = tempfile::tempdir().expect("folder");
        let place = Place::of(root.path(), &entry("t"));
        assert_eq!((place.stand(), place.attempts()), (Stand::New, 0));
        place.begin(&entry("t")).expect("begun");
        place.begin(&entry("t")).expect("the same");
        let other = place.begin(&entry("u"));
        assert!(matches!(other, Err(PlaceError::Other(..))), "{other:?}");
        // Killed before it had a bundle.
        std::fs::write(place.events(1), "").expect("events");
        assert_eq!((place.stand(), place.attempts()), (Stand::New, 1));
        let (folder, hash) = bundle(&place);
        std::fs::write(place.events(1), begun(&folder)).expect("events");
        assert_eq!(place.stand(), Stand::BrokenOff(folder.clone()));
        // The run that should have gone on with it was refused.
        std::fs::write(place.events(2), "").expect("events");
        assert_eq!(place.stand(), Stand::BrokenOff(folder.clone()));
        let ended = json!({ "event": "run-ended", "exit": 1, "root": format!("sha256:{hash}"), "verdict": "fail" });
        std::fs::write(place.events(2), format!("{}{ended}\n", begun(&folder))).expect("events");
        let Stand::Settled(settled) = place.stand() else {
            panic!("not settled")
        };
        assert_eq!(
            (settled.exit, settled.attempts, settled.verdict.as_deref()),
            (1, 2, Some("fail"))
        );
        assert_eq!(settled.bundle.as_deref(), Some("a/b/reports/x/1"));
        place.settle(&settled).expect("settled");
        assert_eq!(place.stand(), Stand::Settled(settled));
        std::fs::write(folder.join("journal.jsonl"), "other").expect("journal");
        let Stand::Settled(settled) = place.stand() else {
            panic!("not settled")
        };
        assert_eq!(settled.exit, BROKEN, "evidence that has changed is none");
        place.again().expect("again");
        assert_eq!((place.stand(), place.attempts()), (Stand::New, 0));
    }

    #[test]
    fn a_run_that_ended_with_an_error_says_why_and_not_why_the_one_before_it_did() {
        let root = tempfile::tempdir().expect("folder");
        let place = Place::of(root.path(), &entry("t"));
        place.begin(&entry("t")).expect("begun");
        std::fs::write(place.events(1), "").expect("events");
        let said = |code: u8| place.ended(Some(code), false).map(|settled| settled.said);
        let print = |attempt: u64, text: &str| {
            let mut output = place.begin_output(attempt).expect("output");
            output.write_all(text.as_bytes()).expect("output");
        };
        print(1, "testing\nerror[key]: no such key\n --> device.toml:3:1\n  |\n");
        assert_eq!(said(2).as_deref(), Some("no such key (device.toml:3:1)"));
        print(2, "error: the port is taken\n");
        assert_eq!(said(5).as_deref(), Some("the port is taken"));
        print(3, "erroneous\nerror: \u{1b}[31mred\n");
        assert_eq!(said(5).map(|said| said.contains('\u{1b}')), Some(false));
        print(4, "nothing that is an error\n");
        assert_eq!(said(5).as_deref(), Some(""));
        assert!(said(0).expect("settled").starts_with("the run ended with exit code 0"));
    }

    #[test]
    fn a_verdict_without_evidence_is_none_and_an_interruption_is_no_end() {
        let root = tempfile::tempdir().expect("folder");
        let place = Place::of(root.path(), &entry("t"));
        place.begin(&entry("t")).expect("begun");
        std::fs::write(place.events(1), "").expect("events");
        let exit = |code: u8| place.ended(Some(code), false).map(|settled| settled.exit);
        assert_eq!(
            (exit(0), exit(1), exit(2), exit(4)),
            (Some(BROKEN), Some(BROKEN), Some(2), Some(4))
        );
        assert_eq!(exit(INTERRUPTED), None);
        assert_eq!(place.ended(None, true), None);
        assert_eq!(place.ended(None, false).map(|settled| settled.exit), Some(BROKEN));
    }
}
