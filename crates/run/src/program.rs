//! Runs a program of a hook: what it prints is kept within bounds, and when it is given up, nothing that it started goes on.

use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt as _};
use tokio::process::{Child, Command};

use tck_engine::HookOutcome;

/// How much of what a program prints is kept; the rest is read and forgotten.
const KEPT: usize = 8 << 10;
/// How many characters of it are shown.
const SHOWN: usize = 500;
/// How long is waited for the rest of the output once the program has ended: what it left running may hold the pipe open.
const LAST_WORDS: Duration = Duration::from_millis(200);

/// The beginning of an output.
type Kept = std::cell::RefCell<Vec<u8>>;

/// Runs a program with these arguments in this folder until its end.
pub(super) async fn program(arguments: &[String], folder: &Path) -> HookOutcome {
    let Some((program, arguments)) = arguments.split_first() else {
        return HookOutcome::Failed("the command is empty".to_owned());
    };
    let mut command = Command::new(program);
    command
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .kill_on_drop(true);
    #[cfg(unix)]
    command.process_group(0);
    if !folder.as_os_str().is_empty() {
        command.current_dir(folder);
    }
    let mut child = match command.spawn() {
        Ok(child) => child,
        Err(error) => return HookOutcome::Failed(format!("cannot start `{program}`: {error}")),
    };
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    let mut group = Group::of(&child);
    let (said, complained) = (Kept::default(), Kept::default());
    let mut output = std::pin::pin!(async { tokio::join!(keep(stdout, &said), keep(stderr, &complained)) });
    let mut all_read = false;
    let status = loop {
        tokio::select! {
            status = child.wait() => break status,
            _ = &mut output, if !all_read => all_read = true,
        }
    };
    // What it has started on purpose goes on.
    group.release();
    if !all_read {
        let _ = tokio::time::timeout(LAST_WORDS, output).await;
    }
    match status {
        Ok(status) if status.success() => HookOutcome::Done(shown(&said.borrow())),
        Ok(status) => HookOutcome::Failed(format!(
            "`{program}` ended with {status}: {}",
            shown(&complained.borrow())
        )),
        Err(error) => HookOutcome::Failed(format!("`{program}`: {error}")),
    }
}

/// Reads to the end, and keeps the beginning.
async fn keep(from: Option<impl AsyncRead + Unpin>, kept: &Kept) {
    let Some(mut from) = from else { return };
    let mut part = vec![0; 16 << 10];
    while let Ok(length @ 1..) = from.read(&mut part).await {
        let mut kept = kept.borrow_mut();
        let room = KEPT - kept.len();
        kept.extend_from_slice(&part[..length.min(room)]);
    }
}

/// The first lines of what a program printed.
fn shown(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).trim().chars().take(SHOWN).collect()
}

/// The process group of a program: killed when the program is given up.
pub(super) struct Group {
    #[cfg(unix)]
    leader: Option<rustix::process::Pid>,
}

impl Group {
    pub(super) fn of(child: &Child) -> Self {
        #[cfg(not(unix))]
        let _ = child;
        Self {
            #[cfg(unix)]
            leader: pid(child),
        }
    }

    fn release(&mut self) {
        #[cfg(unix)]
        {
            self.leader = None;
        }
    }

    /// Lets it go on.
    pub(super) fn forget(mut self) {
        self.release();
    }

    /// Whether anybody is in it.
    pub(super) fn is_there(&self) -> bool {
        #[cfg(unix)]
        {
            self.leader
                .is_some_and(|leader| rustix::process::test_kill_process_group(leader).is_ok())
        }
        #[cfg(not(unix))]
        false
    }

    /// Asks all of it to end in good order.
    pub(super) fn ask_to_end(&self) -> bool {
        #[cfg(unix)]
        {
            let term = rustix::process::Signal::TERM;
            self.leader
                .is_some_and(|leader| rustix::process::kill_process_group(leader, term).is_ok())
        }
        #[cfg(not(unix))]
        false
    }
}

#[cfg(unix)]
impl Drop for Group {
    fn drop(&mut self) {
        if let Some(leader) = self.leader {
            let _ = rustix::process::kill_process_group(leader, rustix::process::Signal::KILL);
        }
    }
}

#[cfg(unix)]
fn pid(child: &Child) -> Option<rustix::process::Pid> {
    rustix::process::Pid::from_raw(i32::try_from(child.id()?).ok()?)
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;

    fn words(all: &[&str]) -> Vec<String> {
        all.iter().map(|word| (*word).to_owned()).collect()
    }

    #[tokio::test]
    async fn of_endless_output_only_the_beginning_is_kept() {
        let kept = Kept::default();
        keep(Some(tokio::io::repeat(b'y').take(100 << 20)), &kept).await;
        assert_eq!(kept.borrow().len(), KEPT);
    }

    #[tokio::test]
    async fn what_a_given_up_program_has_started_ends_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let script = "sh -c 'sleep 1; touch late' & sleep 300";
        let command = words(&["sh", "-c", script]);
        let given_up = tokio::time::timeout(Duration::from_millis(300), program(&command, folder.path())).await;
        assert!(given_up.is_err());
        tokio::time::sleep(Duration::from_millis(1_500)).await;
        assert!(!folder.path().join("late").exists(), "it went on");
    }

    #[tokio::test]
    async fn a_program_may_leave_something_running() {
        let folder = tempfile::tempdir().unwrap();
        let command = words(&["sh", "-c", "(sleep 1; touch late) & echo started"]);
        let begun = std::time::Instant::now();
        let outcome = program(&command, folder.path()).await;
        assert_eq!(outcome, HookOutcome::Done("started".to_owned()));
        assert!(
            begun.elapsed() < Duration::from_millis(900),
            "it waited for what was left"
        );
        tokio::time::sleep(Duration::from_millis(1_500)).await;
        assert!(folder.path().join("late").exists());
    }
}
