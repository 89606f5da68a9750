//! Whether the device is gone, by what it says itself: its connection topic, and the silence after it.
//!
//! It needs no tap. Nothing is decided by it: it names what happened, so that nobody looks for the cause elsewhere.

use std::fmt;
use std::time::Duration;

use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_journal::event::{Event, LinkFault};
use tck_view::{Names, Topic};

/// By the standard no vehicle is silent for longer.
const LONGEST: Duration = Duration::from_secs(31);
/// A silence below it is none.
const SHORTEST: Duration = Duration::from_secs(5);
/// How many usual periods without a word are a silence.
const PERIODS: u32 = 3;
/// For so long, and so often, a device is listened to before it is known how long it is silent.
const LEARNED: Duration = Duration::from_secs(65);
const HEARD: u32 = 10;

/// A record, and when it came.
pub type Mark = (u64, Moment);

/// How a device shows that it is gone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sign {
    /// The tap has seen it leave without DISCONNECT.
    Closed,
    /// What its connection topic says: CONNECTIONBROKEN, or OFFLINE.
    Said(String),
    /// It has said nothing for so long, and was never silent for longer than that before.
    Silent(Duration, Duration),
}

/// A device that is gone: how that shows, since when, and what it was sent last before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gone {
    /// How it shows.
    pub sign: Sign,
    /// The record that shows it; of a silence, the last word.
    pub since: Mark,
    /// The last message it was sent before that; of a silence, the first one it has left unanswered.
    pub sent: Option<Mark>,
}

impl fmt::Display for Gone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seq, at) = self.since;
        match &self.sign {
            Sign::Closed => write!(f, "the device closed its connection without DISCONNECT (#{seq})")?,
            Sign::Said(state) => write!(f, "the device is gone since #{seq}, {state} on its connection topic")?,
            Sign::Silent(long, before) => write!(
                f,
                "the device has said nothing since #{seq}, for {} now, and was never silent for more than {} before",
                seconds(*long),
                seconds(*before)
            )?,
        }
        match (&self.sign, self.sent) {
            (_, None) => Ok(()),
            (Sign::Silent(..), Some((sent, _))) => write!(f, "; then it was sent #{sent}"),
            (_, Some((sent, when))) => write!(f, ", {} after it was sent #{sent}", seconds(at.since(when))),
        }
    }
}

fn seconds(time: Duration) -> String {
    match time.as_millis() {
        millis @ 0..1_000 => format!("{millis} ms"),
        _ => format!("{:.1} s", time.as_secs_f64()),
    }
}

/// Listens to a device through a run.
#[derive(Debug, Default)]
pub(super) struct Pulse {
    /// First and last word of it.
    first: Option<Moment>,
    last: Option<Mark>,
    words: u32,
    /// The longest silence between two words.
    silence: Duration,
    /// Something was done to the link or to the device since its last word: nothing is learned from the silence.
    disturbed: bool,
    /// What it was sent: the last message, and the first one since its last word.
    sent: Option<Mark>,
    unanswered: Option<Mark>,
    /// What its connection topic says of its end, if nothing has come since.
    said: Option<Gone>,
}

impl Pulse {
    /// Sees an entry with its subject.
    pub(super) fn observe(&mut self, entry: &Entry, subject: Option<&str>, names: &Names) {
        let mark = (entry.seq(), entry.at().moment);
        match entry.event() {
            Event::Fault { fault } if !matches!(fault, LinkFault::Restore) => self.disturbed = true,
            Event::Hook { .. } | Event::Vehicle { .. } | Event::Interrupted => self.disturbed = true,
            Event::Sent { .. } => {
                self.sent = Some(mark);
                self.unanswered.get_or_insert(mark);
            }
            // What the broker had stored is no word of the device.
            Event::Message { retain: true, .. } => {}
            Event::Message { .. } if subject == Some("connection") => match ends(entry, names) {
                Some(_) if self.disturbed => {}
                Some(state) => {
                    self.said.get_or_insert(Gone {
                        sign: Sign::Said(state),
                        since: mark,
                        sent: self.sent,
                    });
                }
                None => self.word(mark),
            },
            Event::Message { .. } if subject.is_some_and(|subject| SPEAKS.contains(&subject)) => self.word(mark),
            _ => {}
        }
    }

    fn word(&mut self, mark: Mark) {
        if let Some((_, last)) = self.last.filter(|_| !self.disturbed) {
            self.silence = self.silence.max(mark.1.since(last));
        }
        self.first.get_or_insert(mark.1);
        self.last = Some(mark);
        self.words = self.words.saturating_add(1);
        self.disturbed = false;
        self.unanswered = None;
        self.said = None;
    }

    /// After how long without a word this device is silent.
    fn patience(&self) -> Option<Duration> {
        let known = self.last?.1.since(self.first?);
        let is_learned = self.words >= HEARD && known >= LEARNED;
        let usual = self.silence * PERIODS;
        Some(if is_learned {
            usual.max(SHORTEST)
        } else {
            usual.max(LONGEST)
        })
    }

    /// When the device is silent for longer than it ever should be, if nothing comes before.
    pub(super) fn falls_silent(&self) -> Option<Moment> {
        let at = self.last?.1 + self.patience()?;
        (!self.disturbed && self.said.is_none()).then_some(at)
    }

    /// What it was sent since its last word, and when its silence about that is longer than it ever should be.
    pub(super) fn unanswered(&self) -> Option<(Mark, Moment)> {
        Some((self.unanswered?, self.falls_silent()?))
    }

    /// How the device is gone at this moment, if it is.
    pub(super) fn gone(&self, now: Moment) -> Option<Gone> {
        if self.said.is_some() {
            return self.said.clone();
        }
        let since = self.last?;
        let silent = self.falls_silent()? <= now;
        silent.then(|| Gone {
            sign: Sign::Silent(now.since(since.1), self.silence),
            since,
            sent: self.unanswered,
        })
    }
}

/// The topics by which it is known that a device is there.
const SPEAKS: [&str; 3] = ["state", "visualization", "factsheet"];

/// What a connection message says, if it is that nobody is there.
pub(super) fn ends(entry: &Entry, names: &Names) -> Option<String> {
    let message = entry.view(Topic::Connection, names)?.connection()?;
    let said = message.connection_state.text()?;
    message.is_gone().then(|| said.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::clock::Stamp;
    use tck_journal::Journal;
    use tck_journal::event::{Direction, Occurrence, Payload, Source};

    fn at(millis: u64) -> Moment {
        Moment::from_micros(millis * 1_000)
    }

    struct Talk {
        journal: Journal,
        pulse: Pulse,
    }

    impl Talk {
        /// A device that has said something every second for so many seconds.
        fn of(seconds: u64) -> Self {
            let mut talk = Self {
                journal: Journal::new(),
                pulse: Pulse::default(),
            };
            for second in 0..seconds {
                talk.says(second * 1_000, "state", "{}");
            }
            talk
        }

        fn happens(&mut self, millis: u64, event: Event, subject: Option<&str>) -> u64 {
            let entry = self.journal.append(Occurrence {
                at: Stamp {
                    moment: at(millis),
                    utc: jiff::Timestamp::UNIX_EPOCH,
                },
                source: Source::Link,
                direction: Some(Direction::FromDevice),
                event,
            });
            self.pulse.observe(&entry, subject, &Names::default());
            entry.seq()
        }

        fn says(&mut self, millis: u64, subject: &str, text: &'static str) -> u64 {
            let payload = Payload::keep(bytes::Bytes::from_static(text.as_bytes()));
            let topic = subject.to_owned();
            let message = Event::Message {
                topic,
                qos: 0,
                retain: false,
                dup: false,
                payload,
            };
            self.happens(millis, message, Some(subject))
        }

        fn sent(&mut self, millis: u64) -> u64 {
            let payload = Payload::keep(bytes::Bytes::from_static(b"{}"));
            let event = Event::Sent {
                topic: "order".to_owned(),
                qos: 0,
                retain: false,
                payload,
            };
            self.happens(millis, event, None)
        }

        fn gone(&self, millis: u64) -> Option<String> {
            self.pulse.gone(at(millis)).map(|gone| gone.to_string())
        }
    }

    const BROKEN: &str = r#"{"connectionState":"CONNECTIONBROKEN"}"#;

    #[test]
    fn a_broken_connection_on_the_topic_is_named_at_once_with_what_was_sent_before() {
        let mut talk = Talk::of(3);
        let sent = talk.sent(2_100);
        let broken = talk.says(2_111, "connection", BROKEN);
        let gone = talk.gone(2_111).unwrap();
        assert_eq!(
            gone,
            format!(
                "the device is gone since #{broken}, CONNECTIONBROKEN on its connection topic, 11 ms after it was sent #{sent}"
            )
        );
        talk.says(4_000, "state", "{}");
        assert_eq!(talk.gone(4_000), None, "it speaks, so it is there");
    }

    #[test]
    fn several_usual_periods_without_a_word_are_named() {
        let mut talk = Talk::of(90);
        let sent = talk.sent(89_500);
        assert_eq!(talk.gone(93_900), None);
        let gone = talk.gone(94_000).unwrap();
        assert!(
            gone.contains("for 5.0 s now, and was never silent for more than 1.0 s before"),
            "{gone}"
        );
        assert!(gone.ends_with(&format!("then it was sent #{sent}")), "{gone}");
    }

    #[test]
    fn a_device_that_is_not_known_yet_may_be_silent_for_as_long_as_the_standard_says() {
        let talk = Talk::of(5);
        assert_eq!(talk.gone(30_000), None);
        assert!(talk.gone(36_000).is_some());
    }

    #[test]
    fn a_device_whose_states_come_every_half_minute_is_no_silent_one() {
        let mut talk = Talk::of(2);
        for minute in 1..10 {
            talk.says(minute * 30_000, "state", "{}");
            talk.says(minute * 30_000 + 100, "state", "{}");
        }
        assert_eq!(talk.gone(9 * 30_000 + 60_000), None);
    }

    #[test]
    fn what_the_harness_does_to_link_and_device_is_no_sign() {
        let mut talk = Talk::of(90);
        talk.happens(
            90_000,
            Event::Fault {
                fault: LinkFault::Cut { reset: false },
            },
            None,
        );
        talk.says(90_100, "connection", BROKEN);
        assert_eq!(talk.gone(200_000), None);
        talk.says(200_000, "state", "{}");
        assert!(talk.gone(205_000).is_some(), "nothing was learned from that silence");
    }
}
