//! A small process between the harness and the program of `device.command`, which is this program called in another way.
//!
//! It starts the program in a process group of its own, says how it ended, and ends all that descends from it when the
//! harness wants that, or is gone itself, however it went: its standard input is a pipe whose other end only the harness has.
//! A signal that a terminal or a pipeline sends to the harness reaches neither it nor the program.

use std::ffi::{OsStr, OsString};
use std::process::ExitCode;

use tck_journal::event::Ending;

/// The first argument of a supervisor; the program and its arguments come behind it.
pub const SUPERVISES: &str = "--supervise-device";

/// What the harness writes to have the program asked to end. The end of its input has all of it ended.
pub(super) const ASK: u8 = b't';

/// What a supervisor tells, a line each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Told {
    /// The program runs.
    Started,
    /// It cannot be started.
    Failed(String),
    /// It has ended.
    Ended(Ending),
}

impl Told {
    fn line(&self) -> String {
        match self {
            Self::Started => "started".to_owned(),
            Self::Failed(why) => format!("failed {}", why.replace('\n', " ")),
            Self::Ended(Ending::Status(status)) => format!("ended status {status}"),
            Self::Ended(Ending::Signal(signal)) => format!("ended signal {signal}"),
            Self::Ended(Ending::Unknown) => "ended unknown".to_owned(),
        }
    }

    /// Reads a line.
    pub(super) fn of(line: &str) -> Option<Self> {
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        Some(match word {
            "started" => Self::Started,
            "failed" => Self::Failed(rest.to_owned()),
            "ended" => {
                let number = |text: &str| text.parse().ok();
                Self::Ended(match rest.split_once(' ') {
                    Some(("status", status)) => Ending::Status(number(status)?),
                    Some(("signal", signal)) => Ending::Signal(number(signal)?),
                    _ => Ending::Unknown,
                })
            }
            _ => return None,
        })
    }

    /// Tells the harness. One that is gone needs no telling.
    fn say(&self) {
        use std::io::Write as _;
        let mut output = std::io::stdout();
        let _ = writeln!(output, "{}", self.line()).and_then(|()| output.flush());
    }
}

/// Does the work of a supervisor, if that is what these arguments of the program ask for.
#[must_use]
pub fn called(mut arguments: impl Iterator<Item = OsString>) -> Option<ExitCode> {
    let _program = arguments.next();
    let first = arguments.next()?;
    let rest: Vec<OsString> = arguments.collect();
    if first == SUPERVISES {
        let (program, arguments) = rest.split_first()?;
        return Some(system::supervise(program, arguments));
    }
    #[cfg(target_os = "linux")]
    if first == system::HOLDS
        && let [parent, program, arguments @ ..] = &rest[..]
    {
        return Some(system::hold(parent, program, arguments));
    }
    None
}

fn cannot_start(program: &OsStr, error: &std::io::Error) -> String {
    format!("cannot start the device with `{}`: {error}", program.display())
}

/// Where the program prints: where the supervisor prints its errors. Its own output is for the harness.
#[cfg(unix)]
fn log() -> std::io::Result<std::process::Stdio> {
    use std::os::fd::AsFd as _;
    Ok(std::io::stderr().as_fd().try_clone_to_owned()?.into())
}

#[cfg(windows)]
fn log() -> std::io::Result<std::process::Stdio> {
    use std::os::windows::io::AsHandle as _;
    Ok(std::io::stderr().as_handle().try_clone_to_owned()?.into())
}

#[cfg(unix)]
mod system {
    use std::ffi::{OsStr, OsString};
    use std::io::{self, Read as _};
    use std::os::unix::process::CommandExt as _;
    use std::process::{Child, Command, ExitCode, Stdio};
    use std::time::Duration;

    use rustix::process::{Pid, Signal, WaitOptions, kill_process, kill_process_group, test_kill_process_group, wait};

    use super::{ASK, Told, cannot_start, log};
    use tck_journal::event::Ending;

    /// How often it is looked whether anything is left.
    const GLANCE: Duration = Duration::from_millis(20);

    /// The first argument of a process that is about to become the program.
    #[cfg(target_os = "linux")]
    pub(super) const HOLDS: &str = "--hold-device";

    pub(super) fn supervise(program: &OsStr, arguments: &[OsString]) -> ExitCode {
        // Whatever leaves the program's group, as daemons do, comes to this process when its parent ends.
        #[cfg(target_os = "linux")]
        let _ = rustix::process::set_child_subreaper(Some(rustix::process::getpid()));
        stay();
        let child = match start(program, arguments) {
            Ok(child) => child,
            Err(error) => {
                Told::Failed(cannot_start(program, &error)).say();
                return ExitCode::FAILURE;
            }
        };
        let Some(leader) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) else {
            return ExitCode::FAILURE;
        };
        Told::Started.say();
        std::thread::spawn(move || obey(leader));
        loop {
            match wait(WaitOptions::empty()) {
                Ok(Some((process, status))) if process == leader => {
                    let how = match (status.exit_status(), status.terminating_signal()) {
                        (Some(status), _) => Ending::Status(status),
                        (None, Some(signal)) => Ending::Signal(signal),
                        (None, None) => Ending::Unknown,
                    };
                    Told::Ended(how).say();
                }
                Ok(_) | Err(rustix::io::Errno::INTR) => {}
                // Nothing is left that this process could be told of.
                Err(_) => break,
            }
        }
        while test_kill_process_group(leader).is_ok() {
            std::thread::sleep(GLANCE);
        }
        ExitCode::SUCCESS
    }

    /// It ends with the harness, and by no signal that is meant for it.
    fn stay() {
        use tokio::signal::unix::{SignalKind, signal};
        std::thread::spawn(|| {
            let Ok(runtime) = tokio::runtime::Builder::new_current_thread().enable_all().build() else {
                return;
            };
            runtime.block_on(async {
                let kinds = [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::hangup()];
                let heard: Vec<_> = kinds.into_iter().filter_map(|kind| signal(kind).ok()).collect();
                std::future::pending::<()>().await;
                drop(heard);
            });
        });
    }

    /// Does what the harness wants until it wants no more, or is gone; then ends all that is left.
    fn obey(leader: Pid) {
        let mut byte = [0];
        let mut input = io::stdin();
        loop {
            match input.read(&mut byte) {
                Ok(1..) if byte[0] == ASK => signal_all(leader, Signal::TERM),
                Ok(1..) => {}
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Ok(0) | Err(_) => break,
            }
        }
        loop {
            signal_all(leader, Signal::KILL);
            std::thread::sleep(GLANCE);
        }
    }

    /// Sends a signal to the group of the program, and to what has left it and has come here.
    fn signal_all(leader: Pid, signal: Signal) {
        let _ = kill_process_group(leader, signal);
        for child in children() {
            if child != leader {
                let _ = kill_process(child, signal);
            }
        }
    }

    /// The children of this process.
    #[cfg(target_os = "linux")]
    fn children() -> Vec<Pid> {
        let own = std::process::id().to_string();
        let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
        let numbers = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok());
        let mine = numbers.filter(|number| {
            let stat = std::fs::read(format!("/proc/{number}/stat")).unwrap_or_default();
            let stat = String::from_utf8_lossy(&stat);
            let rest = stat.rsplit_once(')').map_or("", |(_, rest)| rest);
            rest.split_ascii_whitespace().nth(1) == Some(own.as_str())
        });
        mine.filter_map(Pid::from_raw).collect()
    }

    /// The children of this process: not known here beside the program itself.
    #[cfg(not(target_os = "linux"))]
    fn children() -> Vec<Pid> {
        Vec::new()
    }

    /// Starts the program in a group of its own. On Linux it ends with this process even if that is killed.
    #[cfg(target_os = "linux")]
    fn start(program: &OsStr, arguments: &[OsString]) -> io::Result<Child> {
        use std::os::fd::OwnedFd;
        use std::os::unix::net::UnixStream;

        let (mut ours, theirs) = UnixStream::pair()?;
        let mut command = Command::new(std::env::current_exe()?);
        command
            .arg(HOLDS)
            .arg(std::process::id().to_string())
            .arg(program)
            .args(arguments)
            .stdin(OwnedFd::from(theirs))
            .stdout(log()?)
            .stderr(log()?)
            .process_group(0);
        let mut child = command.spawn()?;
        // The other end of the pair has to be the child's alone: it is closed when the child has become the program.
        drop(command);
        let mut why = String::new();
        ours.read_to_string(&mut why)?;
        if why.is_empty() {
            return Ok(child);
        }
        let _ = child.wait();
        Err(io::Error::other(why))
    }

    #[cfg(not(target_os = "linux"))]
    fn start(program: &OsStr, arguments: &[OsString]) -> io::Result<Child> {
        Command::new(program)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(log()?)
            .stderr(log()?)
            .process_group(0)
            .spawn()
    }

    /// Becomes the program, once the system has been told to end it when its parent ends. Why it cannot is written to
    /// standard input, whose other end the parent has.
    #[cfg(target_os = "linux")]
    pub(super) fn hold(parent: &OsStr, program: &OsStr, arguments: &[OsString]) -> ExitCode {
        use std::io::Write as _;
        use std::os::fd::AsFd as _;
        use std::os::unix::net::UnixStream;

        let _ = rustix::process::set_parent_process_death_signal(Some(Signal::KILL));
        let present = rustix::process::getppid().map(|parent| parent.as_raw_nonzero().to_string());
        // It has ended before the system knew what to do then.
        if present.as_deref().map(OsStr::new) != Some(parent) {
            return ExitCode::FAILURE;
        }
        let input = io::stdin().as_fd().try_clone_to_owned();
        let error = Command::new(program).args(arguments).stdin(Stdio::null()).exec();
        if let Ok(input) = input {
            let _ = UnixStream::from(input).write_all(error.to_string().as_bytes());
        }
        ExitCode::FAILURE
    }
}

#[cfg(windows)]
mod system {
    use std::ffi::{OsStr, OsString};
    use std::io::Read as _;
    use std::process::{Command, ExitCode, Stdio};

    use super::{Told, cannot_start, log};
    use tck_journal::event::Ending;

    pub(super) fn supervise(program: &OsStr, arguments: &[OsString]) -> ExitCode {
        let (output, errors) = match (log(), log()) {
            (Ok(output), Ok(errors)) => (output, errors),
            _ => (Stdio::null(), Stdio::null()),
        };
        let mut command = Command::new(program);
        command
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(output)
            .stderr(errors);
        let mut child = match command.spawn() {
            Ok(child) => child,
            Err(error) => {
                Told::Failed(cannot_start(program, &error)).say();
                return ExitCode::FAILURE;
            }
        };
        Told::Started.say();
        let tree = child.id().to_string();
        std::thread::spawn(move || {
            // Nothing but an end asks a program here to end in good order.
            let mut rest = Vec::new();
            let _ = std::io::stdin().read_to_end(&mut rest);
            let mut end = Command::new("taskkill");
            end.args(["/T", "/F", "/PID", &tree])
                .stdout(Stdio::null())
                .stderr(Stdio::null());
            let _ = end.status();
        });
        let how = child.wait().map_or(Ending::Unknown, Ending::of);
        Told::Ended(how).say();
        ExitCode::SUCCESS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_reads_back_as_it_was() {
        let all = [
            Told::Started,
            Told::Failed("cannot start the device with `x`: no such file".to_owned()),
            Told::Ended(Ending::Status(7)),
            Told::Ended(Ending::Signal(9)),
            Told::Ended(Ending::Unknown),
        ];
        for told in all {
            assert_eq!(Told::of(&told.line()), Some(told));
        }
        assert_eq!(Told::of("something else"), None);
    }

    #[test]
    fn usual_arguments_ask_for_no_supervisor() {
        let words = |all: &[&str]| all.iter().map(OsString::from).collect::<Vec<_>>().into_iter();
        assert!(called(words(&["vda5050-tck"])).is_none());
        assert!(called(words(&["vda5050-tck", "run", SUPERVISES])).is_none());
    }
}
