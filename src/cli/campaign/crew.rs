//! The runs of a campaign: which begins when, and what becomes of its process.
//!
//! A run is given a lock as its standard input, and holds it for as long as it lives. A campaign that was killed finds by it
//! that a run goes on, waits for its end, and takes what it has left.

use std::fs::{File, TryLockError};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use tokio::sync::watch;

use super::super::ending;
use super::super::problem::Problem;
use tck_campaign::{Entry, Place, PlaceError, Settled, Stand};
use tck_report::statement::{many, verb};

/// How often it is looked whether a run has ended.
const LOOK: Duration = Duration::from_millis(50);
/// Variables that are flags of a call, and would change what the file says.
pub(super) const NOT_INHERITED: [&str; 3] = ["VDA5050_TCK_PROFILE", "VDA5050_TCK_OUT", "VDA5050_TCK_FORMAT"];
/// The setting that says where a device connects.
pub(super) const LISTEN: &str = "VDA5050_TCK_BENCH_LISTEN";
/// The exit codes of a call that was refused, or that had nothing to go on with.
const REFUSED: [u8; 2] = [2, 4];

/// One entry on its way.
pub(super) struct Job {
    pub(super) entry: Entry,
    place: Place,
    state: State,
    /// Whether it is not gone on with what broke off, because that was refused.
    anew: bool,
}

enum State {
    /// It waits for its turn.
    Waits,
    /// A run of it goes on that an earlier call has started.
    GoesOn,
    /// Its run goes on; whether it goes on with another one.
    Runs(Child, bool),
    /// It broke off when the campaign was interrupted.
    Interrupted,
    /// It has ended.
    Done(Settled),
}

impl Job {
    pub(super) fn new(entry: Entry, place: Place) -> Self {
        Self {
            entry,
            place,
            state: State::Waits,
            anew: false,
        }
    }

    pub(super) fn settled(&self) -> Option<&Settled> {
        match &self.state {
            State::Done(settled) => Some(settled),
            _ => None,
        }
    }

    fn is_busy(&self) -> bool {
        matches!(self.state, State::Runs(..) | State::GoesOn)
    }
}

/// All entries, and how many of them may run.
pub(super) struct Crew {
    jobs: Vec<Job>,
    parallel: usize,
    runtime: tokio::runtime::Runtime,
}

impl Crew {
    pub(super) fn new(jobs: Vec<Job>, parallel: usize) -> Result<Self, Problem> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build();
        Ok(Self {
            jobs,
            parallel,
            runtime: runtime.map_err(|error| Problem::Environment(error.to_string()))?,
        })
    }

    pub(super) fn jobs(&self) -> &[Job] {
        &self.jobs
    }

    /// Carries out what is left, and calls `ended` after each entry. Whether somebody has interrupted it.
    pub(super) fn work(&mut self, ended: impl Fn(&[Job]) -> Result<(), Problem>) -> Result<bool, Problem> {
        let interrupt = self.runtime.block_on(async { ending::interrupts() })?;
        self.look_back()?;
        let mut told = false;
        loop {
            let stop = *interrupt.borrow();
            if stop && !told {
                told = true;
                self.interrupt();
            }
            let mut changed = false;
            for at in 0..self.jobs.len() {
                changed |= self.look(at, stop)?;
            }
            if changed {
                ended(&self.jobs)?;
            }
            let is_left = |job: &Job| matches!(job.state, State::Waits) && !stop;
            if !self.jobs.iter().any(|job| job.is_busy() || is_left(job)) {
                return Ok(stop);
            }
            if !stop {
                self.begin_more(&interrupt)?;
            }
            std::thread::sleep(LOOK);
        }
    }

    /// What an earlier call has left: entries that have ended, and runs that go on without it.
    fn look_back(&mut self) -> Result<(), Problem> {
        for job in &mut self.jobs {
            let lock = job.place.lock().map_err(environment)?;
            if matches!(lock.try_lock(), Err(TryLockError::WouldBlock)) {
                super::super::tell(&format!("{}: its run goes on from an earlier call", job.entry.name()));
                job.state = State::GoesOn;
            } else if let Stand::Settled(settled) = job.place.stand() {
                job.place.settle(&settled).map_err(environment)?;
                job.state = State::Done(settled);
            }
        }
        let done = self.jobs.iter().filter(|job| job.settled().is_some()).count();
        if done > 0 {
            super::super::tell(&format!(
                "{done} of {} {} carried out before",
                many(self.jobs.len(), "run"),
                verb(done, "was", "were")
            ));
        }
        Ok(())
    }

    /// Looks after an entry whose run goes on. Whether it has ended.
    fn look(&mut self, at: usize, stop: bool) -> Result<bool, Problem> {
        let job = &mut self.jobs[at];
        let settled = match &mut job.state {
            State::Runs(child, resumes) => {
                let Some(status) = child
                    .try_wait()
                    .map_err(|error| Problem::Environment(error.to_string()))?
                else {
                    return Ok(false);
                };
                let code = status.code().and_then(|code| u8::try_from(code).ok());
                if *resumes && code.is_some_and(|code| REFUSED.contains(&code)) {
                    super::super::tell(&format!(
                        "{}: the run that broke off cannot be gone on with, and begins anew ({})",
                        job.entry.name(),
                        job.place.output().display()
                    ));
                    job.anew = true;
                    job.state = State::Waits;
                    return Ok(false);
                }
                job.place.ended(code, stop)
            }
            State::GoesOn => {
                let lock = job.place.lock().map_err(environment)?;
                if matches!(lock.try_lock(), Err(TryLockError::WouldBlock)) {
                    if stop {
                        // It is nobody's child here: the next call finds it again.
                        job.state = State::Interrupted;
                    }
                    return Ok(false);
                }
                match job.place.stand() {
                    Stand::Settled(settled) => Some(settled),
                    _ if stop => None,
                    _ => {
                        job.state = State::Waits;
                        return Ok(false);
                    }
                }
            }
            State::Waits | State::Interrupted | State::Done(_) => return Ok(false),
        };
        match settled {
            Some(settled) => {
                job.place.settle(&settled).map_err(environment)?;
                let meaning = super::exit_of(settled.exit).meaning();
                super::super::tell(&format!("{}: {meaning}", job.entry.name()));
                job.state = State::Done(settled);
            }
            // Somebody has ended this run alone, with Ctrl-C of its own: it is gone on with as long as nobody ends the rest.
            None if !stop => job.state = State::Waits,
            None => job.state = State::Interrupted,
        }
        Ok(true)
    }

    /// Begins runs, as many as may run. A device is tested by one of them at a time.
    fn begin_more(&mut self, interrupt: &watch::Receiver<bool>) -> Result<(), Problem> {
        for at in 0..self.jobs.len() {
            let busy: Vec<&str> = self
                .jobs
                .iter()
                .filter(|job| job.is_busy())
                .map(|job| job.entry.device.as_str())
                .collect();
            let job = &self.jobs[at];
            let may = matches!(job.state, State::Waits) && !busy.contains(&job.entry.device.as_str());
            if busy.len() >= self.parallel || *interrupt.borrow() {
                return Ok(());
            }
            if may {
                self.jobs[at].begin()?;
            }
        }
        Ok(())
    }

    /// Asks every run to end in good order.
    fn interrupt(&mut self) {
        for job in &mut self.jobs {
            if let State::Runs(child, _) = &mut job.state {
                end(child);
            }
        }
    }
}

impl Job {
    /// Begins its next run.
    fn begin(&mut self) -> Result<(), Problem> {
        let lock = self.place.lock().map_err(environment)?;
        if matches!(lock.try_lock(), Err(TryLockError::WouldBlock)) {
            self.state = State::GoesOn;
            return Ok(());
        }
        let left = match self.place.stand() {
            Stand::BrokenOff(bundle) if !self.anew => Some(bundle),
            _ => None,
        };
        let attempt = self.place.attempts() + 1;
        let events = self.place.events(attempt);
        let failed = |path: &Path| {
            let path = path.display().to_string();
            move |error: std::io::Error| Problem::Environment(format!("cannot write {path}: {error}"))
        };
        File::create(&events).map_err(failed(&events))?;
        let output = self.place.output();
        let printed = self.place.begin_output(attempt).map_err(environment)?;
        let program = std::env::current_exe().map_err(|error| Problem::Environment(error.to_string()))?;
        let mut command = Command::new(program);
        match &left {
            Some(bundle) => command.args(self.entry.device_words()).arg("--resume").arg(bundle),
            None => command.args(self.entry.words()),
        };
        command
            .arg("--out")
            .arg(self.place.reports())
            .arg("--events")
            .arg(&events);
        for name in NOT_INHERITED {
            command.env_remove(name);
        }
        if let Some(listen) = &self.entry.listen {
            command.env(LISTEN, listen);
        }
        let also = printed.try_clone().map_err(failed(&output))?;
        command
            .stdin(Stdio::from(lock))
            .stdout(Stdio::from(printed))
            .stderr(Stdio::from(also));
        alone(&mut command);
        let how = if left.is_some() { "goes on" } else { "begins" };
        super::super::tell(&format!("{}: {how}", self.entry.name()));
        let child = command
            .spawn()
            .map_err(|error| Problem::Environment(format!("cannot start a run: {error}")))?;
        self.state = State::Runs(child, left.is_some());
        Ok(())
    }
}

fn environment(error: PlaceError) -> Problem {
    Problem::Environment(error.to_string())
}

/// Lets a run have a process group of its own: Ctrl-C reaches the campaign, which hands it on once.
fn alone(command: &mut Command) {
    #[cfg(unix)]
    {
        use std::os::unix::process::CommandExt as _;
        command.process_group(0);
    }
    #[cfg(not(unix))]
    let _ = command;
}

/// Asks a run to end in good order.
fn end(child: &mut Child) {
    #[cfg(unix)]
    if let Some(id) = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw) {
        let _ = rustix::process::kill_process(id, rustix::process::Signal::INT);
    }
    #[cfg(not(unix))]
    let _ = child.kill();
}
