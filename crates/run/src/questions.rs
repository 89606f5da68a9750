//! The question that is open: who shows it reads it here, and an answer from elsewhere than the terminal is left here.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::person::{Answer, Place, Reply};

/// A question to the person beside the device, as it stands now.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Question {
    /// Which question of the run, counted from 1.
    pub number: u64,
    /// The test that asks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub test: Option<String>,
    /// The title of its step.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<String>,
    /// What the person is to do.
    pub text: String,
    /// How many seconds are left for the answer.
    pub seconds_left: u64,
}

/// Where the open question stands. Copies are the same place.
#[derive(Clone, Debug, Default)]
pub struct Board(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    asked: u64,
    open: Option<Open>,
    given: Option<Reply>,
}

#[derive(Debug)]
struct Open {
    question: Question,
    until: Instant,
}

impl Board {
    /// Puts a question up; gives its number.
    pub fn put_up(&self, (test, step): (Option<String>, Option<String>), text: &str, within: Duration) -> u64 {
        let mut state = self.state();
        state.asked += 1;
        let number = state.asked;
        let question = Question {
            number,
            test,
            step,
            text: text.to_owned(),
            seconds_left: within.as_secs(),
        };
        state.open = Some(Open {
            question,
            until: Instant::now() + within,
        });
        state.given = None;
        number
    }

    /// Takes the question down.
    pub fn take_down(&self) {
        let mut state = self.state();
        state.open = None;
        state.given = None;
    }

    /// The open question.
    #[must_use]
    pub fn question(&self) -> Option<Question> {
        let state = self.state();
        let open = state.open.as_ref()?;
        Some(Question {
            seconds_left: open.until.saturating_duration_since(Instant::now()).as_secs(),
            ..open.question.clone()
        })
    }

    /// Leaves an answer to the question of this number; `false` when it is not open, or answered already.
    pub fn answer(&self, number: u64, answer: Answer, place: Place) -> bool {
        let mut state = self.state();
        let is_open = state.open.as_ref().is_some_and(|open| open.question.number == number);
        if !is_open || state.given.is_some() {
            return false;
        }
        state.given = Some(Reply::from(answer, place));
        true
    }

    /// The answer that was left, if there is one.
    #[must_use]
    pub fn given(&self) -> Option<Reply> {
        self.state().given.clone()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_open_question_is_answered_and_only_once() {
        let board = Board::default();
        assert_eq!(board.question(), None);
        assert!(!board.answer(1, Answer::Done, Place::Http));
        let about = (Some("state/emergency-stop".to_owned()), None);
        let number = board.put_up(about, "Press it.", Duration::from_secs(60));
        assert_eq!(number, 1);
        let open = board.question().unwrap();
        assert!(open.text == "Press it." && (59..=60).contains(&open.seconds_left));
        assert!(!board.answer(2, Answer::Done, Place::Http));
        assert!(board.answer(1, Answer::Skip, Place::Page));
        assert!(!board.answer(1, Answer::Done, Place::Http));
        assert_eq!(board.given(), Some(Reply::from(Answer::Skip, Place::Page)));
        board.take_down();
        assert!(board.question().is_none() && board.given().is_none());
        assert_eq!(board.put_up((None, None), "Pull it.", Duration::from_secs(1)), 2);
        assert!(
            !board.answer(1, Answer::Done, Place::Terminal),
            "an answer to the question before is none to this one"
        );
    }
}
