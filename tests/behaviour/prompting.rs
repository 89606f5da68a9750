//! A person at a real terminal: questions can be seen and answered, and the terminal is as it was afterwards.
#![cfg(unix)]

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::bench::{Bench, Profile};

/// Asks for an emergency stop and its release.
const STOP: &str = "state/emergency-stop";
/// Asks for an operating mode.
const MODE: &str = "modes/reported[teach-in]";

/// No test needs longer, on a machine as busy as it may be.
const LIMIT: Duration = Duration::from_secs(60);

/// A terminal of its own, on a tmux server of its own.
struct Terminal<'a> {
    folder: &'a Path,
}

impl<'a> Terminal<'a> {
    /// Opens one with a shell. Without tmux on this machine: nothing, which in CI is a failure.
    fn open(folder: &'a Path) -> Option<Self> {
        let this = Self { folder };
        let shell = "exec env PS1='ready> ' sh -i";
        let opened = this
            .command()
            .args(["-f", "/dev/null", "new-session", "-d", "-x", "120", "-y", "50", shell])
            .current_dir(folder)
            .env_remove("NO_COLOR")
            .status();
        if opened.is_err() {
            assert!(
                std::env::var_os("CI").is_none(),
                "tmux is not installed, and CI must have it"
            );
            eprintln!("skipped: tmux is not installed");
            return None;
        }
        assert!(opened.unwrap().success(), "tmux does not start");
        this.shows("ready>");
        Some(this)
    }

    fn command(&self) -> Command {
        let mut command = Command::new("tmux");
        command.arg("-S").arg(self.folder.join("tmux"));
        command
    }

    /// What stands on the screen.
    fn screen(&self) -> String {
        let captured = self.command().args(["capture-pane", "-p"]).output().unwrap();
        String::from_utf8_lossy(&captured.stdout).into_owned()
    }

    /// Waits until the screen shows this.
    #[track_caller]
    fn shows(&self, text: &str) -> String {
        let begun = Instant::now();
        loop {
            let screen = self.screen();
            if screen.contains(text) {
                return screen;
            }
            assert!(begun.elapsed() < LIMIT, "the screen never shows `{text}`:\n{screen}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Presses keys, by the names of tmux.
    fn press(&self, keys: &[&str]) {
        assert!(self.command().arg("send-keys").args(keys).status().unwrap().success());
    }

    /// Types a line.
    fn types(&self, line: &str) {
        assert!(
            self.command()
                .args(["send-keys", "-l", line])
                .status()
                .unwrap()
                .success()
        );
        self.press(&["Enter"]);
    }

    /// Starts a run; gives the port where the device is expected.
    fn runs(&self, tests: &[&str]) -> u16 {
        let program = env!("CARGO_BIN_EXE_vda5050-tck");
        let tests: Vec<String> = tests.iter().map(|test| format!("'{test}'")).collect();
        self.types("clear");
        self.types(&format!(
            "stty -g > before; XDG_CONFIG_HOME=none {program} run --profile device.toml {}; echo ended with $?; stty -g > after",
            tests.join(" ")
        ));
        let screen = self.shows("the device is expected at mqtt://127.0.0.1:");
        let (_, rest) = screen
            .split_once("the device is expected at mqtt://127.0.0.1:")
            .unwrap();
        rest.lines().next().unwrap().trim().parse().unwrap()
    }

    /// The code with which the run has ended, if it has.
    fn code(&self) -> Option<i32> {
        // The command that was typed stands there, too.
        let screen = self.screen();
        let mut ends = screen.lines().filter_map(|line| line.strip_prefix("ended with "));
        ends.find_map(|code| code.trim().parse().ok())
    }

    /// The run has ended like this, and has left the terminal as it was.
    #[track_caller]
    fn ended(&self, code: i32) {
        self.shows(&format!("ended with {code}"));
        self.types("echo still $((40 + 2)) here");
        self.shows("still 42 here");
        let read = |name| std::fs::read_to_string(self.folder.join(name)).unwrap();
        assert_eq!(read("before"), read("after"), "the terminal is not as it was");
    }
}

impl Drop for Terminal<'_> {
    fn drop(&mut self) {
        let _ = self.command().arg("kill-server").status();
    }
}

fn profile(timeout: &str) -> Profile {
    let mut profile = Profile::impatient();
    profile.more = format!(
        "[hooks.emergency-stop]\nprompt = \"Press the red button of {{serial-number}}.\"\ntimeout = \"{timeout}\"\n\
         [hooks.release-emergency-stop]\nprompt = \"Pull the red button.\"\ntimeout = \"{timeout}\"\n\
         [hooks.set-mode]\nprompt = \"Turn the key to {{mode}}.\"\ntimeout = \"{timeout}\"\n"
    );
    profile
}

fn bench(timeout: &str) -> Bench {
    let bench = Bench::new();
    std::fs::write(bench.path().join("device.toml"), profile(timeout).text()).unwrap();
    bench
}

fn journal(bench: &Bench) -> String {
    std::fs::read_to_string(bench.bundle().join("journal.jsonl")).unwrap()
}

#[test]
fn a_question_can_be_seen_and_only_its_keys_answer_it() {
    let bench = bench("10 min");
    let Some(terminal) = Terminal::open(bench.path()) else {
        return;
    };
    let port = terminal.runs(&[STOP]);
    let _agv = bench.agv(port, &[]);
    let screen = terminal.shows("Press the red button of 0001.");
    assert!(screen.contains(&format!("question 1, test {STOP}")), "{screen}");
    let screen = terminal.shows("d done   s skip this test   q end the run");
    assert!(
        !screen.contains("waiting for"),
        "something is drawn over the question:\n{screen}"
    );
    // Blind keys mean nothing.
    terminal.press(&["Enter", "y", "Escape", "Space"]);
    std::thread::sleep(Duration::from_millis(500));
    assert!(
        !journal(&bench).contains("the operator answered"),
        "a blind key was an answer"
    );
    terminal.press(&["d"]);
    // The stop was not pressed, and so it is not reported; what undoes it is asked for all the same or not at all.
    let begun = Instant::now();
    let code = loop {
        if let Some(code) = terminal.code() {
            break code;
        }
        assert!(begun.elapsed() < LIMIT, "{}", terminal.screen());
        std::thread::sleep(Duration::from_millis(50));
    };
    assert!(journal(&bench).contains("the operator answered: done"));
    assert!(matches!(code, 1 | 3), "{code}");
    terminal.ended(code);
}

#[test]
fn a_test_can_be_skipped_and_the_run_goes_on() {
    let bench = bench("10 min");
    let Some(terminal) = Terminal::open(bench.path()) else {
        return;
    };
    let port = terminal.runs(&[STOP, MODE]);
    let _agv = bench.agv(port, &[]);
    let mut asked = 0;
    let begun = Instant::now();
    while terminal.code().is_none() {
        assert!(begun.elapsed() < LIMIT, "{}", terminal.screen());
        if terminal.screen().contains(&format!("question {}", asked + 1)) {
            terminal.shows("q end the run");
            terminal.press(&["s"]);
            asked += 1;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    terminal.ended(3);
    assert!(asked >= 2, "{}", terminal.screen());
    let result = bench.result();
    for test in result["tests"].as_array().unwrap() {
        assert_eq!(test["verdict"], "inconclusive", "{test}");
        assert!(
            test["reason"]
                .as_str()
                .unwrap()
                .contains("the operator skipped the test"),
            "{test}"
        );
    }
}

#[test]
fn q_and_ctrl_c_end_the_run() {
    for key in ["q", "C-c"] {
        let bench = bench("10 min");
        let Some(terminal) = Terminal::open(bench.path()) else {
            return;
        };
        let port = terminal.runs(&[STOP, MODE]);
        let _agv = bench.agv(port, &[]);
        // The line with the keys: other lines of the screen may have any of its words.
        terminal.shows("q end the run");
        terminal.press(&[key]);
        terminal.ended(130);
        bench.is_partial();
        assert!(!terminal.screen().contains("question 2"), "{key}: it went on asking");
    }
}

#[test]
fn after_its_time_a_question_reads_nothing_and_leaves_the_terminal_as_it_was() {
    let bench = bench("2 s");
    let Some(terminal) = Terminal::open(bench.path()) else {
        return;
    };
    let port = terminal.runs(&[STOP]);
    let _agv = bench.agv(port, &[]);
    terminal.shows("nobody answered in time");
    terminal.shows("ended with");
    assert!(journal(&bench).contains("nobody answered within 2 s"));
    terminal.ended(3);
}

#[test]
fn without_a_terminal_it_is_said_that_nobody_can_be_asked() {
    let bench = Bench::new();
    let (run, port) = bench.start(&profile("10 min"), &[STOP]);
    let _agv = bench.agv(port, &[]);
    run.end()
        .code(3)
        .prints("answer at a terminal, or over HTTP (--questions)");
    let result = bench.result().to_string();
    assert!(result.contains("is a prompt, and nobody can be asked"), "{result}");
}

#[test]
fn a_terminal_that_goes_away_ends_the_run() {
    let bench = bench("10 min");
    let Some(terminal) = Terminal::open(bench.path()) else {
        return;
    };
    let port = terminal.runs(&[STOP]);
    let _agv = bench.agv(port, &[]);
    terminal.shows("q end the run");
    drop(terminal);
    let begun = Instant::now();
    let manifest = bench.bundle().join("manifest.json");
    let is_listening = || std::net::TcpStream::connect(("127.0.0.1", port)).is_ok();
    while !manifest.exists() || is_listening() {
        assert!(begun.elapsed() < LIMIT, "the run goes on without its terminal");
        std::thread::sleep(Duration::from_millis(50));
    }
    bench.is_partial();
}
