//! Several recordings as one stream, ordered by time.
//!
//! Each recording is taken as it stands; of all the next ones the earliest comes first. What has no time comes at once,
//! so that a recording without times is read to its end before the next one.

use super::{CaptureError, Counted, Item, Lines, Message};
use crate::journal::event::{Event, Record, Source as RecordSource};

/// A recording with its name.
struct Source {
    name: String,
    lines: Lines,
    next: Option<Message>,
    /// Whether the recorder was cut off since the last message.
    gap: bool,
}

/// See the module.
pub struct Merged {
    sources: Vec<Source>,
}

impl Merged {
    /// Begins to read.
    ///
    /// # Errors
    /// The first recording that cannot be read.
    pub fn new(recordings: Vec<(String, Lines)>) -> Result<Self, CaptureError> {
        let mut sources = Vec::new();
        for (name, lines) in recordings {
            let mut source = Source {
                name,
                lines,
                next: None,
                gap: false,
            };
            source.advance()?;
            sources.push(source);
        }
        Ok(Self { sources })
    }

    /// The next message; `None` at the end of all.
    ///
    /// # Errors
    /// What cannot be read any further.
    pub fn read(&mut self) -> Result<Option<Message>, CaptureError> {
        let first = self.sources.iter_mut().filter(|source| source.next.is_some());
        let Some(first) = first.min_by_key(|source| source.next.as_ref().and_then(|message| message.at)) else {
            return Ok(None);
        };
        let message = first.next.take();
        first.advance()?;
        Ok(message)
    }

    /// How much was read of each.
    #[must_use]
    pub fn counted(&self) -> Vec<(String, Counted)> {
        let all = self.sources.iter();
        all.map(|source| (source.name.clone(), source.lines.counted()))
            .collect()
    }
}

impl Source {
    fn advance(&mut self) -> Result<(), CaptureError> {
        let fail = |source| CaptureError {
            name: self.name.clone(),
            source,
        };
        self.next = loop {
            match self.lines.read().map_err(fail)? {
                None => break None,
                Some(Item::Message(message)) => break Some(message),
                Some(Item::Record(record)) => {
                    let place = self.lines.place();
                    self.gap |= is_cut_off(&record);
                    if let Event::Message {
                        topic,
                        qos,
                        retain,
                        payload: crate::journal::Payload::Whole(payload),
                        ..
                    } = record.event
                    {
                        break Some(Message {
                            at: Some(record.at.utc),
                            topic,
                            payload,
                            qos: Some(qos),
                            retain: Some(retain),
                            place,
                            after_gap: std::mem::take(&mut self.gap),
                        });
                    }
                }
            }
        };
        Ok(())
    }
}

/// Whether the recorder itself lost its connection here.
fn is_cut_off(record: &Record) -> bool {
    record.source == RecordSource::Link && matches!(record.event, Event::Closed { .. })
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::capture::Mapping;

    #[test]
    fn the_earliest_message_comes_first() {
        let recording = |number: usize, text: &str| {
            let lines = Lines::new(Box::new(Cursor::new(text.to_owned())), number, Mapping::default());
            (format!("{number}"), lines)
        };
        let line = |at: u32, topic: &str| {
            format!(
                "{{\"time\":{},\"topic\":\"{topic}\",\"payload\":\"\"}}\n",
                1_700_000_000 + at
            )
        };
        let one = line(1, "a") + &line(4, "b");
        let two = line(2, "c") + "noise\n" + &line(3, "d") + &line(9, "e");
        let mut merged = Merged::new(vec![recording(0, &one), recording(1, &two)]).expect("readable");
        let mut order = String::new();
        while let Some(message) = merged.read().expect("readable") {
            order.push_str(&message.topic);
        }
        assert_eq!(order, "acdbe");
        assert_eq!(merged.counted()[1].1, Counted { lines: 4, skipped: 1 });
    }
}
