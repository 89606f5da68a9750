//! A question to the person at the terminal, who has it to himself meanwhile: nothing else is drawn, and only keys that
//! are pressed after the question count.

use std::fmt::Write as _;
use std::io::{self, IsTerminal as _, Write};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use crossterm::event::{Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use indicatif::ProgressBar;
use tokio::sync::watch;

use super::keyboard::typed;
use super::output::escaped;
use tck_run::{Answer, Board, Person, Place, Question, Reply, Wanted};

/// How long the keyboard is read before it is looked whether the answer is still wanted.
const GLANCE: Duration = Duration::from_millis(50);

/// The place where a person is asked, and what is asked about. Copies are the same place.
#[derive(Clone, Debug)]
pub struct Prompter {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    /// Ends the run.
    stop: watch::Sender<bool>,
    /// Where somebody has ended it, other than by a signal.
    stopped_at: Arc<OnceLock<Place>>,
    /// What is drawn otherwise, and what the run is about now.
    about: Mutex<About>,
    /// The open question, for answers from elsewhere.
    board: Board,
    /// Who else hears of questions.
    follower: Mutex<Option<Follower>>,
    /// Whoever holds it has the terminal to himself.
    terminal: Mutex<()>,
}

/// Takes a question that is asked.
type OnAsked = Box<dyn Fn(&Question) + Send>;
/// Takes the number of a question, and what came of it.
type OnAnswered = Box<dyn Fn(u64, &Reply) + Send>;

/// Hears of questions and of their answers.
pub struct Follower {
    /// A question is asked.
    pub asked: OnAsked,
    /// The question of this number is answered so.
    pub answered: OnAnswered,
}

impl std::fmt::Debug for Follower {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Follower")
    }
}

#[derive(Clone, Debug)]
struct About {
    bar: ProgressBar,
    test: Option<String>,
    step: Option<String>,
}

impl Prompter {
    /// A place where nothing is drawn otherwise. `stop` is told when the person wants the run to end.
    #[must_use]
    pub fn new(stop: watch::Sender<bool>) -> Self {
        let about = About {
            bar: ProgressBar::hidden(),
            test: None,
            step: None,
        };
        Self {
            shared: Arc::new(Shared {
                stop,
                stopped_at: Arc::default(),
                about: Mutex::new(about),
                board: Board::default(),
                follower: Mutex::new(None),
                terminal: Mutex::new(()),
            }),
        }
    }

    /// Where the open question stands, and an answer to it can be left.
    #[must_use]
    pub fn board(&self) -> Board {
        self.shared.board.clone()
    }

    /// Ends the run in good order, as Ctrl-C does once.
    pub fn stop(&self, place: Place) {
        // Whoever was first has ended it.
        let _ = self.shared.stopped_at.set(place);
        self.shared.stop.send_replace(true);
    }

    /// Where somebody has ended the run, once somebody has, other than by a signal.
    #[must_use]
    pub fn stopped_at(&self) -> Arc<OnceLock<Place>> {
        Arc::clone(&self.shared.stopped_at)
    }

    /// Who hears of questions from now on.
    pub fn is_followed_by(&self, follower: Follower) {
        *held(&self.shared.follower) = Some(follower);
    }

    /// Whether somebody sits at the terminal.
    #[must_use]
    pub fn is_attended() -> bool {
        io::stdin().is_terminal() && io::stderr().is_terminal()
    }

    /// What is hidden while a person is asked.
    pub fn draws(&self, bar: &ProgressBar) {
        held(&self.shared.about).bar = bar.clone();
    }

    /// Which test runs.
    pub fn runs(&self, test: &str) {
        let mut about = held(&self.shared.about);
        about.test = Some(test.to_owned());
        about.step = None;
    }

    /// Which step the test has come to.
    pub fn performs(&self, step: Option<&str>) {
        held(&self.shared.about).step = step.map(str::to_owned);
    }

    /// Says something at once, whatever is drawn or asked.
    pub fn say(&self, text: &str) {
        let bar = held(&self.shared.about).bar.clone();
        let mut terminal = io::stderr();
        // While a person is asked, the terminal does nothing of itself at the end of a line.
        let is_asked = self.shared.terminal.try_lock().is_err();
        let lines = text.lines().map(escaped);
        if is_asked {
            for line in lines {
                let _ = write!(terminal, "\r\n{line}\r\n");
            }
        } else {
            bar.suspend(|| {
                for line in lines {
                    let _ = writeln!(terminal, "{line}");
                }
            });
        }
    }

    /// Waits until nobody is being asked, so that the terminal is as it was.
    pub fn at_rest(&self) {
        drop(held(&self.shared.terminal));
    }

    fn heading(number: u64, about: &About, what: &str) -> String {
        let test = about
            .test
            .as_deref()
            .map_or_else(String::new, |test| format!(", test {}", escaped(test)));
        format!("\r\n-- question {number}{test} --\r\n{}", wanted_of(about, what))
    }
}

/// What a person is to do, and for which step.
fn wanted_of(about: &About, what: &str) -> String {
    let mut text = String::new();
    if let Some(step) = &about.step {
        let _ = write!(text, "   {}\r\n", escaped(step));
    }
    let bold = console::Style::new().for_stderr().bold();
    for line in what.lines() {
        let _ = write!(text, "   {}\r\n", bold.apply_to(escaped(line)));
    }
    text
}

impl Person for Prompter {
    fn ask(&self, what: &str, within: Duration, wanted: &Wanted) -> Reply {
        let _alone = held(&self.shared.terminal);
        let about = held(&self.shared.about).clone();
        about.bar.suspend(|| {
            let mut terminal = io::stderr();
            if *self.shared.stop.borrow() {
                let wanted = wanted_of(&about, what);
                let _ = write!(
                    terminal,
                    "\r\n-- the run ends, and does not wait for this --\r\n{wanted}"
                );
                return Reply::without(Answer::GivenUp);
            }
            let place = (about.test.clone(), about.step.clone());
            let number = self.shared.board.put_up(place, what, within);
            if let (Some(follower), Some(question)) = (&*held(&self.shared.follower), self.shared.board.question()) {
                (follower.asked)(&question);
            }
            let heading = Self::heading(number, &about, what);
            let asked = Asked {
                within,
                wanted,
                stop: &self.shared.stop,
                board: &self.shared.board,
            };
            let reply = if Self::is_attended() {
                Raw::on().and_then(|_raw| asked.put(&heading, &mut terminal))
            } else {
                asked.wait(&heading, &mut terminal)
            };
            self.shared.board.take_down();
            let reply = reply.unwrap_or_else(|error| Reply::without(Answer::Unasked(error.to_string())));
            if let Some(follower) = &*held(&self.shared.follower) {
                (follower.answered)(number, &reply);
            }
            if reply.answer == Answer::End {
                self.stop(reply.from.unwrap_or(Place::Terminal));
            }
            reply
        })
    }
}

fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The terminal gives every key at once, and shows none.
struct Raw;

impl Raw {
    fn on() -> io::Result<Self> {
        enable_raw_mode()?;
        Ok(Self)
    }
}

impl Drop for Raw {
    fn drop(&mut self) {
        let _ = disable_raw_mode();
    }
}

/// Puts the terminal back as it was before a question; for a program that ends at once.
pub fn put_terminal_back() {
    let _ = disable_raw_mode();
}

/// A question, and what may end the wait for its answer.
struct Asked<'a> {
    within: Duration,
    wanted: &'a Wanted,
    stop: &'a watch::Sender<bool>,
    board: &'a Board,
}

impl Asked<'_> {
    /// The answer, as far as it does not come from the keyboard; `None` as long as there is none.
    fn otherwise(&self, left: Duration) -> Option<Reply> {
        if let Some(given) = self.board.given() {
            return Some(given);
        }
        if left.is_zero() {
            return Some(Reply::without(Answer::Silence));
        }
        let is_over = self.wanted.is_given_up() || *self.stop.borrow();
        is_over.then(|| Reply::without(Answer::GivenUp))
    }

    /// Asks at the terminal.
    fn put(&self, heading: &str, terminal: &mut impl Write) -> io::Result<Reply> {
        // What was typed before the question is no answer to it.
        while typed(Duration::ZERO)?.is_some() {}
        write!(terminal, "\x07{heading}")?;
        let until = Instant::now() + self.within;
        let mut shown = None;
        let reply = loop {
            let left = until.saturating_duration_since(Instant::now());
            if shown != Some(left.as_secs()) {
                shown = Some(left.as_secs());
                write!(terminal, "\r\x1b[2K{}", keys(left))?;
                terminal.flush()?;
            }
            if let Some(reply) = self.otherwise(left) {
                break reply;
            }
            if let Some(Event::Key(key)) = typed(GLANCE.min(left))?
                && let Some(answer) = meaning(key)
            {
                break Reply::from(answer, Place::Terminal);
            }
        };
        write!(terminal, "\r\x1b[2K   {}\r\n", said(&reply.answer))?;
        terminal.flush()?;
        Ok(reply)
    }

    /// Says what is asked, and waits for an answer from elsewhere.
    fn wait(&self, heading: &str, terminal: &mut impl Write) -> io::Result<Reply> {
        write!(terminal, "{}", heading.replace('\r', ""))?;
        let until = Instant::now() + self.within;
        let reply = loop {
            let left = until.saturating_duration_since(Instant::now());
            if let Some(reply) = self.otherwise(left) {
                break reply;
            }
            std::thread::sleep(GLANCE.min(left));
        };
        writeln!(terminal, "   {}", said(&reply.answer))?;
        Ok(reply)
    }
}

fn keys(left: Duration) -> String {
    let left = left.as_secs();
    format!(
        "   d done   s skip this test   q end the run   {}:{:02} left ",
        left / 60,
        left % 60
    )
}

/// What a key means; nothing is meant by any other, such as a blind Enter.
fn meaning(key: KeyEvent) -> Option<Answer> {
    if key.kind == KeyEventKind::Release {
        return None;
    }
    let controlled = key.modifiers.contains(KeyModifiers::CONTROL);
    match key.code {
        KeyCode::Char('c') if controlled => Some(Answer::End),
        _ if controlled || key.modifiers.contains(KeyModifiers::ALT) => None,
        KeyCode::Char('d' | 'D') => Some(Answer::Done),
        KeyCode::Char('s' | 'S') => Some(Answer::Skip),
        KeyCode::Char('q' | 'Q') => Some(Answer::End),
        _ => None,
    }
}

fn said(answer: &Answer) -> &'static str {
    match answer {
        Answer::Done => "done",
        Answer::Skip => "this is skipped, and what needs it is undecided",
        Answer::End => "the run ends",
        Answer::Silence => "nobody answered in time; what needs it is undecided",
        Answer::GivenUp | Answer::Unasked(_) => "the question is withdrawn",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(code: KeyCode, modifiers: KeyModifiers) -> Option<Answer> {
        meaning(KeyEvent::new(code, modifiers))
    }

    #[test]
    fn only_three_keys_and_ctrl_c_mean_something() {
        let plain = |code| key(code, KeyModifiers::NONE);
        assert_eq!(plain(KeyCode::Char('d')), Some(Answer::Done));
        assert_eq!(plain(KeyCode::Char('s')), Some(Answer::Skip));
        assert_eq!(plain(KeyCode::Char('q')), Some(Answer::End));
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::CONTROL), Some(Answer::End));
        for nothing in [
            KeyCode::Enter,
            KeyCode::Esc,
            KeyCode::Char('y'),
            KeyCode::Char(' '),
            KeyCode::Char('c'),
        ] {
            assert_eq!(plain(nothing), None, "{nothing:?}");
        }
        assert_eq!(key(KeyCode::Char('d'), KeyModifiers::CONTROL), None);
        assert_eq!(key(KeyCode::Char('q'), KeyModifiers::ALT), None);
    }

    #[test]
    fn a_question_says_which_test_and_what_to_do_and_how_long() {
        let desk = Prompter::new(watch::channel(false).0);
        desk.runs("state/emergency-stop");
        desk.performs(Some("The operator stops it"));
        let about = held(&desk.shared.about).clone();
        let heading = Prompter::heading(1, &about, "Press an emergency stop.\u{1b}[2J");
        assert_eq!(
            console::strip_ansi_codes(&heading),
            "\r\n-- question 1, test state/emergency-stop --\r\n   The operator stops it\r\n   Press an emergency \
             stop.\\u{1b}[2J\r\n"
        );
        assert!(Prompter::heading(2, &about, "Release it.").contains("question 2"));
        assert!(keys(Duration::from_secs(598)).ends_with("9:58 left "));
    }

    #[test]
    fn once_the_run_ends_nobody_is_kept_waiting() {
        let (stop, _keep) = watch::channel(true);
        let asked = Prompter::new(stop).ask(
            "Release the emergency stop.",
            Duration::from_secs(600),
            &Wanted::default(),
        );
        assert_eq!(asked, Reply::without(Answer::GivenUp));
    }
}
