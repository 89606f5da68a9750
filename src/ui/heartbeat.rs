//! A sign of life where there is no terminal: in a log of a pipeline, a line every 30 s says what is awaited.

use std::io::Write as _;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use super::output::escaped;

/// After so long without a line there is one.
const EVERY: Duration = Duration::from_secs(30);
/// How often it is looked whether it is time.
const GLANCE: Duration = Duration::from_millis(500);

/// Beats until it is dropped.
#[derive(Debug)]
pub struct Heartbeat(Arc<Mutex<Awaited>>);

#[derive(Debug)]
struct Awaited {
    /// The running test, and what it waits for since when.
    test: Option<String>,
    what: String,
    since: Instant,
    /// When the last line was written.
    told: Instant,
    left: Option<String>,
}

impl Awaited {
    fn new(now: Instant) -> Self {
        Self {
            test: None,
            what: "the next step".to_owned(),
            since: now,
            told: now,
            left: None,
        }
    }

    /// The line, when it is time for one.
    fn due(&mut self, now: Instant) -> Option<String> {
        let test = self.test.as_ref()?;
        if now.saturating_duration_since(self.told) < EVERY {
            return None;
        }
        self.told = now;
        let waited = now.saturating_duration_since(self.since).as_secs();
        let left = self
            .left
            .as_ref()
            .map_or_else(String::new, |left| format!("; {left} left"));
        let (test, what) = (escaped(test), escaped(&self.what));
        Some(format!("{test} runs, waiting for {what}, {waited} s{left}"))
    }
}

impl Heartbeat {
    /// Writes its lines to standard error.
    #[must_use]
    pub fn start() -> Self {
        let this = Self(Arc::new(Mutex::new(Awaited::new(Instant::now()))));
        let awaited = Arc::downgrade(&this.0);
        std::thread::spawn(move || beat(&awaited));
        this
    }

    fn change(&self, change: impl FnOnce(&mut Awaited)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// A test begins.
    pub fn begins(&self, test: &str) {
        self.change(|awaited| {
            awaited.test = Some(test.to_owned());
            awaited.since = Instant::now();
        });
    }

    /// The test waits for this from now on.
    pub fn awaits(&self, what: &str) {
        self.change(|awaited| {
            what.clone_into(&mut awaited.what);
            awaited.since = Instant::now();
        });
    }

    /// What follows a test is bringing the device back.
    pub fn ended(&self) {
        self.awaits("the device, after its end");
        self.told();
    }

    /// A line was written.
    pub fn told(&self) {
        self.change(|awaited| awaited.told = Instant::now());
    }

    /// How much of the run is left.
    pub fn left(&self, left: String) {
        self.change(|awaited| awaited.left = Some(left));
    }
}

fn beat(awaited: &Weak<Mutex<Awaited>>) {
    loop {
        std::thread::sleep(GLANCE);
        let Some(awaited) = awaited.upgrade() else { return };
        let line = awaited
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .due(Instant::now());
        if let Some(line) = line {
            // That nobody reads it is no failure.
            let _ = writeln!(std::io::stderr(), "{line}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_minute_without_a_line_gives_one_with_what_is_awaited() {
        let begun = Instant::now();
        let after = |seconds: u64| begun + Duration::from_secs(seconds);
        let mut awaited = Awaited::new(begun);
        assert_eq!(awaited.due(after(40)), None, "no test runs");
        awaited.test = Some("order/one".to_owned());
        awaited.what = "It is accepted\u{1b}[2J".to_owned();
        awaited.left = Some("about 12 min".to_owned());
        assert_eq!(awaited.due(after(29)), None);
        let line = awaited.due(after(31)).unwrap();
        assert_eq!(
            line,
            "order/one runs, waiting for It is accepted\\u{1b}[2J, 31 s; about 12 min left"
        );
        assert_eq!(awaited.due(after(60)), None);
        assert!(awaited.due(after(61)).unwrap().contains("61 s"));
    }
}
