//! The program of `device.command`: started, watched, and ended with all that it has started.
//!
//! What becomes of it goes into the journal when it happens, and to whoever looks on. A [`super::supervisor`] keeps hold of
//! it, so that nothing of it is left however the harness ends; without one, which only a library can be, its process group is
//! ended.

use std::fmt::Write as _;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::process::{Child, ChildStdin, ChildStdout, Command};
use tokio::sync::watch;

use super::program::Group;
use super::supervisor::{ASK, SUPERVISES, Told};
use tck_journal::event::{Ending, Event, Program, Source};
use tck_net::bench::kin::Kin;
use tck_net::link::mqtt::Reporter;
use tck_profile::Secrets;

/// How long a device may take to end in good order.
pub(super) const GOODBYE_LIMIT: Duration = Duration::from_secs(20);
/// How long it may take until nothing of it is left once it is killed.
const KILL_LIMIT: Duration = Duration::from_secs(5);
/// How often it is looked whether anything of a group is left.
const GLANCE: Duration = Duration::from_millis(20);
/// How many bytes of the end of its log are read.
const READ: u64 = 4 << 10;
/// How many lines are kept of what was read.
const LINES: usize = 5;
/// How many characters are kept of these lines.
const SHOWN: usize = 500;

/// Says something to whoever looks on, at once.
pub type Tell = Arc<dyn Fn(&str) + Send + Sync>;

/// Who is told what becomes of the program, and who keeps hold of it.
#[derive(Clone, Default)]
pub struct Surroundings {
    /// Where it is recorded.
    pub reporter: Option<Reporter>,
    /// Where its connections are told from those of others.
    pub kin: Option<Kin>,
    /// Who looks on.
    pub tell: Option<Tell>,
    /// What nobody may read.
    pub secrets: Secrets,
    /// The program that can be called as a supervisor.
    pub supervisor: Option<PathBuf>,
}

/// A device that the harness starts itself (`device.command`).
pub struct DeviceProcess {
    command: Vec<String>,
    folder: PathBuf,
    log: Option<PathBuf>,
    surroundings: Surroundings,
    /// Until when its end is nothing that happens by itself.
    asked: Arc<Mutex<Option<Instant>>>,
    running: Option<Running>,
}

impl std::fmt::Debug for DeviceProcess {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DeviceProcess")
            .field("command", &self.command)
            .finish_non_exhaustive()
    }
}

/// How far a program has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum State {
    Runs,
    /// It has ended; what it has started may go on.
    Ended,
    /// Nothing is left of it.
    Gone,
}

struct Running {
    leash: Leash,
    state: watch::Receiver<State>,
}

/// What holds a program; all of it ends when this is dropped.
enum Leash {
    /// The input of its supervisor.
    Supervisor(ChildStdin),
    /// Its process group.
    Group(Group),
}

/// From where the end of a program is heard.
enum Ear {
    Supervisor(BufReader<ChildStdout>, Child),
    Program(Child),
}

impl DeviceProcess {
    /// A device to be started with this program and these arguments in this folder. What it prints goes into `log`.
    #[must_use]
    pub fn new(command: Vec<String>, folder: PathBuf, log: Option<PathBuf>, surroundings: Surroundings) -> Self {
        Self {
            command,
            folder,
            log,
            surroundings,
            asked: Arc::default(),
            running: None,
        }
    }

    /// Starts it.
    ///
    /// # Errors
    /// What the operating system says, with the command.
    pub async fn start(&mut self) -> std::io::Result<()> {
        if self.command.is_empty() {
            return Err(std::io::Error::other("device.command is empty"));
        }
        let begins = self.log.as_deref().map_or(0, length);
        let (leash, ear, process) = match self.surroundings.supervisor.clone() {
            Some(supervisor) => self.start_supervised(&supervisor).await?,
            None => self.start_alone()?,
        };
        *held(&self.asked) = None;
        self.report(Program::Started {
            process,
            traces: self.surroundings.kin.is_some(),
        })
        .await;
        let (said, state) = watch::channel(State::Runs);
        let witness = Witness {
            log: self.log.clone().map(|log| (log, begins)),
            surroundings: self.surroundings.clone(),
            asked: Arc::clone(&self.asked),
        };
        tokio::spawn(async move { witness.see(ear, said).await });
        self.running = Some(Running { leash, state });
        Ok(())
    }

    /// The process that is started first, with what both ways of starting have in common.
    fn command(&self, program: &std::ffi::OsStr) -> std::io::Result<Command> {
        let mut command = Command::new(program);
        command.stderr(self.output()?);
        if !self.folder.as_os_str().is_empty() {
            command.current_dir(&self.folder);
        }
        // What a terminal or a pipeline sends to the harness is not meant for it.
        #[cfg(unix)]
        command.process_group(0);
        #[cfg(windows)]
        command.creation_flags(NEW_PROCESS_GROUP);
        Ok(command)
    }

    fn output(&self) -> std::io::Result<Stdio> {
        let Some(path) = &self.log else {
            return Ok(Stdio::null());
        };
        Ok(std::fs::File::options().create(true).append(true).open(path)?.into())
    }

    async fn start_supervised(&self, supervisor: &Path) -> std::io::Result<(Leash, Ear, u32)> {
        let mut command = self.command(supervisor.as_os_str())?;
        command
            .arg(SUPERVISES)
            .args(&self.command)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        let mut child = command.spawn()?;
        let process = child.id().unwrap_or_default();
        self.is_kin(process);
        let gone = || std::io::Error::other("the process that starts the device has no pipes");
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let (input, output) = input.zip(output).ok_or_else(gone)?;
        let mut output = BufReader::new(output);
        let mut line = String::new();
        output.read_line(&mut line).await?;
        match Told::of(line.trim_end()) {
            Some(Told::Started) => Ok((Leash::Supervisor(input), Ear::Supervisor(output, child), process)),
            Some(Told::Failed(why)) => Err(std::io::Error::new(std::io::ErrorKind::NotFound, why)),
            _ => Err(std::io::Error::other("the process that starts the device has ended")),
        }
    }

    fn start_alone(&self) -> std::io::Result<(Leash, Ear, u32)> {
        let Some((program, arguments)) = self.command.split_first() else {
            return Err(std::io::Error::other("device.command is empty"));
        };
        let mut command = self.command(program.as_ref())?;
        command.args(arguments).stdin(Stdio::null()).stdout(self.output()?);
        let child = command.kill_on_drop(true).spawn().map_err(|error| {
            let why = format!("cannot start the device with `{program}`: {error}");
            std::io::Error::new(std::io::ErrorKind::NotFound, why)
        })?;
        let process = child.id().unwrap_or_default();
        self.is_kin(process);
        Ok((Leash::Group(Group::of(&child)), Ear::Program(child), process))
    }

    /// Before it can have connected: what it connects is its own.
    fn is_kin(&self, process: u32) {
        if let Some(kin) = &self.surroundings.kin {
            kin.started(process);
        }
    }

    /// Ends it, if it still runs, and starts it again.
    ///
    /// # Errors
    /// What the operating system says.
    pub async fn restart(&mut self) -> std::io::Result<()> {
        self.stop("the harness").await;
        self.start().await
    }

    /// Asks it to end in good order, and kills it when it does not. Says whether it ended by itself.
    pub async fn end(&mut self) -> bool {
        if !self.is_running() {
            self.stop("the harness").await;
            return true;
        }
        self.is_asked("the harness", GOODBYE_LIMIT).await;
        let Some(running) = &mut self.running else { return true };
        let ended = running.ask().await && running.comes_to(State::Gone, GOODBYE_LIMIT).await;
        self.stop("the harness").await;
        ended
    }

    /// Something is about to end it, or to ask it to end, and may take so long.
    pub async fn is_asked(&mut self, by: &str, within: Duration) {
        *held(&self.asked) = Some(Instant::now() + within + GOODBYE_LIMIT);
        let by = by.to_owned();
        self.report(Program::Asked { by }).await;
    }

    /// What was about to end it is over.
    pub fn was_asked(&mut self) {
        // A program that it has started anew answers for itself.
        if let Some(until) = held(&self.asked).as_mut() {
            *until = Instant::now() + GOODBYE_LIMIT;
        }
    }

    /// Whether it was started and has not ended.
    pub fn is_running(&self) -> bool {
        self.running
            .as_ref()
            .is_some_and(|running| *running.state.borrow() == State::Runs)
    }

    /// Kills it, and waits until nothing of it is left.
    pub async fn stop(&mut self, by: &str) {
        if self.is_running() {
            self.is_asked(by, KILL_LIMIT).await;
        }
        if let Some(Running { leash, mut state }) = self.running.take() {
            drop(leash);
            let gone = state.wait_for(|state| *state == State::Gone);
            let _ = tokio::time::timeout(KILL_LIMIT, gone).await;
        }
    }

    async fn report(&self, program: Program) {
        report(&self.surroundings, program).await;
    }
}

async fn report(surroundings: &Surroundings, program: Program) {
    if let Some(reporter) = &surroundings.reporter {
        reporter.report(Source::Harness, None, Event::Program { program }).await;
    }
}

impl Running {
    /// Asks the program to end. `false` where nobody can be asked.
    async fn ask(&mut self) -> bool {
        if cfg!(not(unix)) {
            return false;
        }
        match &mut self.leash {
            Leash::Supervisor(input) => input.write_all(&[ASK]).await.is_ok() && input.flush().await.is_ok(),
            Leash::Group(group) => group.ask_to_end(),
        }
    }

    async fn comes_to(&mut self, wanted: State, within: Duration) -> bool {
        let coming = self.state.wait_for(|state| *state >= wanted);
        tokio::time::timeout(within, coming).await.is_ok()
    }
}

/// Waits for the end of a program, and tells of it.
struct Witness {
    /// Where it prints, and how long that was before.
    log: Option<(PathBuf, u64)>,
    surroundings: Surroundings,
    asked: Arc<Mutex<Option<Instant>>>,
}

impl Witness {
    async fn see(&self, ear: Ear, said: watch::Sender<State>) {
        match ear {
            Ear::Supervisor(mut output, mut child) => {
                let mut how = None;
                let mut line = String::new();
                while output.read_line(&mut line).await.is_ok_and(|length| length > 0) {
                    if let Some(Told::Ended(ending)) = Told::of(line.trim_end()) {
                        how = Some(ending);
                        self.ended(ending).await;
                        said.send_replace(State::Ended);
                    }
                    line.clear();
                }
                let _ = child.wait().await;
                if how.is_none() {
                    // Somebody has killed the supervisor.
                    self.ended(Ending::Unknown).await;
                }
            }
            Ear::Program(mut child) => {
                let group = Group::of(&child);
                let how = child.wait().await.map_or(Ending::Unknown, Ending::of);
                self.ended(how).await;
                said.send_replace(State::Ended);
                while group.is_there() {
                    tokio::time::sleep(GLANCE).await;
                }
                group.forget();
            }
        }
        said.send_replace(State::Gone);
    }

    async fn ended(&self, how: Ending) {
        let is_asked = held(&self.asked).is_some_and(|until| Instant::now() <= until);
        let words = self.last_words();
        let mut text = format!("the program of `device.command` ended by itself with {how}");
        if !words.is_empty() {
            let _ = write!(text, ": {words}");
        }
        report(&self.surroundings, Program::Ended { how, words }).await;
        if let Some(tell) = self.surroundings.tell.as_ref().filter(|_| !is_asked) {
            tell(&text);
        }
    }

    /// The last lines that it has printed since it was started.
    fn last_words(&self) -> String {
        let text = self.log.as_ref().and_then(|(log, begins)| end_of(log, *begins).ok());
        let text = text.unwrap_or_default();
        let lines: Vec<&str> = text
            .lines()
            .map(str::trim_end)
            .filter(|line| !line.is_empty())
            .collect();
        let last = lines[lines.len().saturating_sub(LINES)..].join("\n");
        let last = self.surroundings.secrets.out_of(&last);
        let long = last.chars().count();
        last.chars().skip(long.saturating_sub(SHOWN)).collect()
    }
}

/// The end of a file, of what has come since it was so long.
fn end_of(file: &Path, begins: u64) -> std::io::Result<String> {
    let mut file = std::fs::File::open(file)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(begins.max(length.saturating_sub(READ)).min(length)))?;
    let mut end = Vec::new();
    file.take(READ).read_to_end(&mut end)?;
    Ok(String::from_utf8_lossy(&end).into_owned())
}

fn length(file: &Path) -> u64 {
    std::fs::metadata(file).map_or(0, |about| about.len())
}

fn held<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Windows: Ctrl-C of the console is not for it.
#[cfg(windows)]
const NEW_PROCESS_GROUP: u32 = 0x0000_0200;

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;

    fn script(text: &str) -> Vec<String> {
        ["sh", "-c", text].map(str::to_owned).to_vec()
    }

    async fn appears(file: &Path) {
        while !file.exists() {
            tokio::time::sleep(GLANCE).await;
        }
    }

    #[tokio::test]
    async fn what_a_program_has_started_ends_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let text = "sh -c 'touch inner; sleep 1; touch late' & touch outer; wait";
        let mut device = DeviceProcess::new(script(text), folder.path().to_owned(), None, Surroundings::default());
        device.start().await.unwrap();
        appears(&folder.path().join("inner")).await;
        appears(&folder.path().join("outer")).await;
        assert!(device.is_running());
        device.stop("the test").await;
        assert!(!device.is_running());
        tokio::time::sleep(Duration::from_millis(1_300)).await;
        assert!(!folder.path().join("late").exists(), "it went on");
    }

    #[tokio::test]
    async fn a_program_that_ends_by_itself_is_told_of_with_its_last_words_and_one_that_is_asked_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let told: Arc<Mutex<Vec<String>>> = Arc::default();
        let heard = Arc::clone(&told);
        let surroundings = Surroundings {
            tell: Some(Arc::new(move |text| held(&heard).push(text.to_owned()))),
            ..Surroundings::default()
        };
        let log = folder.path().join("device.log");
        std::fs::write(&log, "of an earlier start\n").unwrap();
        let text = "echo first; echo boom >&2; exit 7";
        let mut device = DeviceProcess::new(
            script(text),
            folder.path().to_owned(),
            Some(log.clone()),
            surroundings.clone(),
        );
        device.start().await.unwrap();
        while held(&told).is_empty() {
            tokio::time::sleep(GLANCE).await;
        }
        assert_eq!(
            held(&told).join("\n"),
            "the program of `device.command` ended by itself with exit status 7: first\nboom"
        );
        let mut device = DeviceProcess::new(script("sleep 300"), folder.path().to_owned(), Some(log), surroundings);
        device.start().await.unwrap();
        assert!(device.end().await);
        assert_eq!(held(&told).len(), 1);
    }
}
