//! What a person may do on the page.

/// An answer to a prompt, the same three as at a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// It is done.
    Done,
    /// The test is to be left out.
    Skip,
    /// The run is to end.
    End,
}

impl Choice {
    /// The answer that this word stands for.
    #[must_use]
    pub fn of_word(word: &str) -> Option<Self> {
        match word {
            "done" => Some(Self::Done),
            "skip" => Some(Self::Skip),
            "end" => Some(Self::End),
            _ => None,
        }
    }
}

/// Takes what a person has pressed on the page.
pub trait Desk: Send + Sync {
    /// Answers the prompt of this number; `false` when it is not open, or answered already.
    fn answer(&self, number: u64, choice: Choice) -> bool;

    /// Stops the vehicle: the run calls off what it has sent, and ends. `false` where nothing was sent that could be called off.
    fn stop(&self) -> bool;
}

/// A desk where nobody sits: nothing is asked, and nothing can be stopped.
#[derive(Clone, Copy, Debug)]
pub struct Nobody;

impl Desk for Nobody {
    fn answer(&self, _: u64, _: Choice) -> bool {
        false
    }

    fn stop(&self) -> bool {
        false
    }
}
