//! The program that the run has started: whether it has ended by itself.

use std::time::Duration;

use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_journal::event::{Event, Program};
use tck_result::{ProgramEnd, ProgramResult};

/// For how long something that ends the program excuses its end after it is over.
const AFTER_HOOK: Duration = Duration::from_secs(20);
/// How many of its ends are kept.
const KEPT: usize = 8;

/// What excuses an end.
#[derive(Debug)]
enum Asked {
    /// Something that ends it is going on.
    Now,
    /// It was over then.
    Until(Moment),
}

/// Watches the program through a run.
#[derive(Debug, Default)]
pub(super) struct Watched {
    /// When it was started last, if it was.
    started: Option<Moment>,
    asked: Option<Asked>,
    /// The message that was sent last.
    sent: Option<u64>,
    /// How it has ended by itself, as long as it was not started again.
    down: Option<String>,
    /// Whether the system tells which connections it has.
    traces: bool,
    result: ProgramResult,
}

impl Watched {
    /// Sees the next entry. `doubt` says why somebody else may have harmed the device; nothing is held against it once
    /// the run is interrupted.
    pub(super) fn observe(&mut self, entry: &Entry, doubt: Option<&str>, is_interrupted: bool) {
        let now = entry.at().moment;
        match entry.event() {
            Event::Sent { .. } => self.sent = Some(entry.seq()),
            Event::Hook { .. } if matches!(self.asked, Some(Asked::Now)) => {
                self.asked = Some(Asked::Until(now + AFTER_HOOK));
            }
            Event::Program { program } => match program {
                Program::Started { traces, .. } => {
                    self.started = Some(now);
                    self.asked = None;
                    self.down = None;
                    self.traces = *traces;
                    self.result.starts += 1;
                }
                Program::Asked { .. } => self.asked = Some(Asked::Now),
                Program::Ended { how, words } => {
                    let is_asked = match self.asked {
                        None => false,
                        Some(Asked::Now) => true,
                        Some(Asked::Until(until)) => now <= until,
                    };
                    if is_asked || is_interrupted {
                        return;
                    }
                    let end = ProgramEnd {
                        how: how.to_string(),
                        seq: entry.seq(),
                        seconds: self.started.map_or(0.0, |started| now.since(started).as_secs_f64()),
                        sent: self.sent,
                        words: words.clone(),
                        excuse: doubt.map(str::to_owned),
                    };
                    self.down = Some(end.story());
                    self.result.ends += 1;
                    self.result.excused += u64::from(doubt.is_some());
                    if self.result.shown.len() < KEPT {
                        self.result.shown.push(end);
                    }
                }
            },
            _ => {}
        }
    }

    /// Whether there is a program.
    pub(super) fn is_there(&self) -> bool {
        self.result.starts > 0
    }

    /// Whether the system tells which connections it has.
    pub(super) fn traces(&self) -> bool {
        self.traces
    }

    /// How it has ended, as long as it was not started again.
    pub(super) fn is_down(&self) -> Option<&str> {
        self.down.as_deref()
    }

    /// What has become of it; nothing without one.
    pub(super) fn result(&self) -> Option<ProgramResult> {
        self.is_there().then(|| self.result.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::clock::Stamp;
    use tck_base::verdict::Verdict;
    use tck_journal::Journal;
    use tck_journal::event::{Ending, Occurrence};

    /// What comes of these events, a second apart.
    fn seen(events: &[Event]) -> Watched {
        let mut journal = Journal::new();
        let mut watched = Watched::default();
        let mut is_interrupted = false;
        for (at, event) in events.iter().enumerate() {
            let at = Stamp {
                moment: Moment::from_micros(at as u64 * 1_000_000),
                utc: jiff::Timestamp::UNIX_EPOCH,
            };
            let entry = journal.append(Occurrence::harness(at, event.clone()));
            is_interrupted |= *event == Event::Interrupted;
            watched.observe(&entry, None, is_interrupted);
        }
        watched
    }

    fn program(program: Program) -> Event {
        Event::Program { program }
    }

    fn started() -> Event {
        program(Program::Started {
            process: 1,
            traces: true,
        })
    }

    fn ended() -> Event {
        program(Program::Ended {
            how: Ending::Signal(9),
            words: "boom".to_owned(),
        })
    }

    fn asked() -> Event {
        program(Program::Asked {
            by: "hook `shutdown`".to_owned(),
        })
    }

    fn hook() -> Event {
        Event::Hook {
            hook: "shutdown".to_owned(),
            ok: true,
            detail: String::new(),
            vehicle: None,
        }
    }

    #[test]
    fn a_program_that_ends_by_itself_is_a_failure_and_stays_one_when_it_is_started_again() {
        let watched = seen(&[started(), ended()]);
        assert!(
            watched
                .is_down()
                .is_some_and(|story| story.contains("signal 9 (SIGKILL)") && story.contains("boom"))
        );
        assert_eq!(
            watched.result().and_then(|result| result.verdict()),
            Some(Verdict::Fail)
        );
        let watched = seen(&[started(), ended(), asked(), started(), hook()]);
        assert_eq!(watched.is_down(), None);
        assert_eq!(
            watched.result().and_then(|result| result.verdict()),
            Some(Verdict::Fail)
        );
    }

    #[test]
    fn what_a_hook_or_a_person_ends_has_not_ended_by_itself() {
        let fails = |events: &[Event]| seen(events).result().and_then(|result| result.verdict()).is_some();
        assert!(!fails(&[started(), asked(), ended(), hook()]));
        assert!(!fails(&[started(), asked(), hook(), ended()]));
        assert!(!fails(&[started(), Event::Interrupted, ended()]));
        assert!(!fails(&[]));
        // What was started anew, and what ends long afterwards, answers for itself.
        assert!(fails(&[started(), asked(), ended(), started(), hook(), ended()]));
        let mut late = vec![started(), asked(), hook()];
        late.extend(std::iter::repeat_n(Event::Note { text: String::new() }, 25));
        late.push(ended());
        assert!(fails(&late));
    }
}
