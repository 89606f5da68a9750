//! Runs the program: in a folder of its own, without settings of the surroundings, and never for ever.

use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// No run of these tests needs longer, on a machine as busy as it may be.
const LIMIT: Duration = Duration::from_secs(60);

/// The program with these arguments, in `folder`.
pub fn tool(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vda5050-tck"));
    for (name, _) in std::env::vars().filter(|(name, _)| {
        let ours = ["VDA5050_TCK_", "GITHUB_", "CI_NODE_", "SLURM_ARRAY_", "JOB_COMPLETION_"];
        ours.iter().any(|own| name.starts_with(own)) || ["CI", "NO_COLOR"].contains(&name.as_str())
    }) {
        command.env_remove(name);
    }
    command
        .args(arguments)
        .current_dir(folder)
        // No settings of the user, and no reports anywhere else.
        .env("XDG_CONFIG_HOME", folder.join("no-settings"))
        .stdin(Stdio::null());
    command
}

/// Runs the program with these arguments in `folder` to its end.
pub fn run_in(folder: &Path, arguments: &[&str]) -> Ended {
    Running::start(&mut tool(folder, arguments)).end()
}

/// Runs the program with these arguments to its end, in a folder that is gone afterwards.
pub fn run(arguments: &[&str]) -> Ended {
    run_in(tempfile::tempdir().unwrap().path(), arguments)
}

/// How a process ended, and what it said.
#[derive(Debug)]
pub struct Ended {
    pub status: ExitStatus,
    pub stdout: String,
    pub stderr: String,
}

impl Ended {
    /// Holds that it ended with this exit code.
    #[track_caller]
    pub fn code(self, expected: i32) -> Self {
        let Self { status, stdout, stderr } = &self;
        assert_eq!(
            status.code(),
            Some(expected),
            "{status}\n--- stdout\n{stdout}\n--- stderr\n{stderr}"
        );
        self
    }

    /// Holds that standard error says this.
    #[track_caller]
    pub fn says(self, text: &str) -> Self {
        assert!(
            self.stderr.contains(text),
            "standard error does not say `{text}`:\n{}",
            self.stderr
        );
        self
    }

    /// Holds that standard output has this.
    #[track_caller]
    pub fn prints(self, text: &str) -> Self {
        assert!(
            self.stdout.contains(text),
            "standard output does not have `{text}`:\n{}",
            self.stdout
        );
        self
    }

    /// Holds that exactly one line of standard error is an error.
    #[track_caller]
    pub fn says_one_error(self, text: &str) -> Self {
        let errors: Vec<&str> = self.stderr.lines().filter(|line| line.starts_with("error")).collect();
        assert!(
            errors.len() == 1 && errors[0].contains(text),
            "not one error with `{text}`:\n{}",
            self.stderr
        );
        self
    }
}

/// A process that runs. It is killed when the test is over.
pub struct Running {
    child: Child,
    stdout: Arc<Mutex<Vec<u8>>>,
    stderr: Arc<Mutex<Vec<u8>>>,
    readers: Vec<JoinHandle<()>>,
    begun: Instant,
}

impl Running {
    /// Starts it, and reads what it says.
    pub fn start(command: &mut Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (stdout, stderr) = (Arc::default(), Arc::default());
        let readers = vec![
            read(child.stdout.take().unwrap(), &stdout),
            read(child.stderr.take().unwrap(), &stderr),
        ];
        Self {
            child,
            stdout,
            stderr,
            readers,
            begun: Instant::now(),
        }
    }

    /// What standard error has said so far.
    pub fn stderr(&self) -> String {
        text(&self.stderr)
    }

    /// What standard output has said so far.
    pub fn stdout(&self) -> String {
        text(&self.stdout)
    }

    /// Waits until `seen` gives something.
    #[track_caller]
    pub fn until<T>(&mut self, what: &str, mut seen: impl FnMut(&Self) -> Option<T>) -> T {
        loop {
            if let Some(found) = seen(self) {
                return found;
            }
            let ended = self.child.try_wait().unwrap();
            let late = self.begun.elapsed() > LIMIT;
            if late || ended.is_some() {
                let _ = self.child.kill();
                panic!("{what} did not come ({ended:?}):\n{}\n{}", self.stdout(), self.stderr());
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits for a line of standard error that begins like this; gives the rest of it.
    #[track_caller]
    pub fn line(&mut self, beginning: &str) -> String {
        let rest = |text: &str| {
            text.lines()
                .find_map(|line| line.strip_prefix(beginning).map(str::to_owned))
        };
        self.until(beginning, |running| {
            let said = running.stderr();
            // Only whole lines.
            rest(&said[..=said.rfind('\n')?])
        })
    }

    /// Ctrl-C.
    pub fn interrupt(&self) {
        self.signal("INT");
    }

    /// A signal by its short name.
    pub fn signal(&self, name: &str) {
        let id = self.child.id();
        let sent = Command::new("sh")
            .args(["-c", &format!("kill -{name} {id}")])
            .status()
            .unwrap();
        assert!(sent.success());
    }

    /// The number of the process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Ends it without a warning, as when the power is cut.
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Waits for its end, and kills it when it does not come.
    fn wait_within(&mut self, limit: Duration) -> ExitStatus {
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            if self.begun.elapsed() > limit {
                let _ = self.child.kill();
                panic!("it hangs:\n{}\n{}", self.stdout(), self.stderr());
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits for its end.
    #[track_caller]
    pub fn end(self) -> Ended {
        self.end_within(LIMIT)
    }

    /// Waits for the end of what takes longer.
    pub fn end_within(mut self, limit: Duration) -> Ended {
        let status = self.wait_within(limit);
        for reader in self.readers.drain(..) {
            reader.join().unwrap();
        }
        let (stdout, stderr) = (self.stdout(), self.stderr());
        assert!(!stderr.contains("panicked"), "it panicked:\n{stderr}");
        Ended { status, stdout, stderr }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn read(mut pipe: impl Read + Send + 'static, into: &Arc<Mutex<Vec<u8>>>) -> JoinHandle<()> {
    let into = Arc::clone(into);
    std::thread::spawn(move || {
        let mut part = [0; 4096];
        while let Ok(length @ 1..) = pipe.read(&mut part) {
            into.lock().unwrap().extend_from_slice(&part[..length]);
        }
    })
}

fn text(bytes: &Mutex<Vec<u8>>) -> String {
    String::from_utf8_lossy(&bytes.lock().unwrap()).into_owned()
}
