//! The person beside the device, who can be asked to do something to it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// What a person has answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// It is done.
    Done,
    /// The test is to be left out.
    Skip,
    /// The run is to end.
    End,
    /// Nobody answered in time.
    Silence,
    /// The answer is not wanted any more.
    GivenUp,
    /// Nobody could be asked; the text says why.
    Unasked(String),
}

impl Answer {
    /// The word for it in streams of events.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Skip => "skip",
            Self::End => "end",
            Self::Silence => "silence",
            Self::GivenUp => "given-up",
            Self::Unasked(_) => "unasked",
        }
    }
}

/// Where a person has answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// At the keyboard of the terminal.
    Terminal,
    /// Over HTTP, as a program does.
    Http,
    /// On the page for the people beside the vehicle.
    Page,
}

impl Place {
    /// The word for it in streams of events.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Terminal => "terminal",
            Self::Http => "http",
            Self::Page => "page",
        }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Terminal => "at the terminal",
            Self::Http => "over HTTP",
            Self::Page => "on the page",
        })
    }
}

/// What came of a question, and where the answer was given if a person gave one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reply {
    /// What came of it.
    pub answer: Answer,
    /// Where a person has answered.
    pub from: Option<Place>,
}

impl Reply {
    /// The answer of a person.
    #[must_use]
    pub fn from(answer: Answer, place: Place) -> Self {
        Self {
            answer,
            from: Some(place),
        }
    }

    /// What came of it without an answer.
    #[must_use]
    pub fn without(answer: Answer) -> Self {
        Self { answer, from: None }
    }
}

/// Whether an answer is still wanted.
#[derive(Clone, Debug, Default)]
pub struct Wanted(Arc<AtomicBool>);

impl Wanted {
    /// Whether nobody waits for the answer any more.
    #[must_use]
    pub fn is_given_up(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Gives a question up when it is dropped.
#[derive(Debug)]
struct Waiting(Wanted);

impl Drop for Waiting {
    fn drop(&mut self) {
        self.0.0.store(true, Ordering::Relaxed);
    }
}

/// Somebody who can be asked.
pub trait Person: Send + Sync + std::fmt::Debug {
    /// Asks for something to be done, and waits for the answer for this long at most. Ends soon after the answer is not
    /// wanted any more.
    fn ask(&self, what: &str, within: Duration, wanted: &Wanted) -> Reply;
}

/// Asks a person, and gives the question up when nobody waits for the answer any more.
pub(super) async fn ask(person: &Arc<dyn Person>, what: String, within: Duration) -> Reply {
    let waiting = Waiting(Wanted::default());
    let (person, wanted) = (Arc::clone(person), waiting.0.clone());
    let asked = tokio::task::spawn_blocking(move || person.ask(&what, within, &wanted));
    asked
        .await
        .unwrap_or_else(|error| Reply::without(Answer::Unasked(error.to_string())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug)]
    struct Slow(Arc<AtomicBool>);

    impl Person for Slow {
        fn ask(&self, _: &str, _: Duration, wanted: &Wanted) -> Reply {
            while !wanted.is_given_up() {
                std::thread::sleep(Duration::from_millis(5));
            }
            self.0.store(true, Ordering::Relaxed);
            Reply::without(Answer::GivenUp)
        }
    }

    #[tokio::test]
    async fn a_question_ends_when_nobody_waits_for_its_answer() {
        let ended = Arc::new(AtomicBool::new(false));
        let person: Arc<dyn Person> = Arc::new(Slow(Arc::clone(&ended)));
        let question = ask(&person, "Press the button.".to_owned(), Duration::from_secs(600));
        assert!(tokio::time::timeout(Duration::from_millis(20), question).await.is_err());
        while !ended.load(Ordering::Relaxed) {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }
}
