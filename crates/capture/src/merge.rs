//! Several recordings as one stream, ordered by time.
//!
//! Each recording is taken as it stands; of all the next ones the earliest comes first. What has no time comes at once,
//! so that a recording without times is read to its end before the next one.

use super::{CaptureError, Carried, Counted, Item, Message, Recorded, Told, from_journal};
use tck_journal::event::{Event, Record, Source as RecordSource};

/// A recording with its name.
struct Source {
    name: String,
    recorded: Recorded,
    next: Option<Told>,
    /// What comes behind it.
    ahead: Option<Told>,
    /// Whether it is a journal of what a tap saw.
    tapped: bool,
    /// Whether the recorder was cut off since the last message.
    gap: bool,
}

/// Several recordings as one stream, ordered by time.
pub struct Merged {
    sources: Vec<Source>,
    /// Whether a recording ended behind a gap: what comes next, from another one, comes after the gap.
    gap: bool,
}

impl Merged {
    /// Begins to read.
    ///
    /// # Errors
    /// The first recording that cannot be read.
    pub fn new(recordings: Vec<(String, Recorded)>) -> Result<Self, CaptureError> {
        let mut sources = Vec::new();
        let mut gap = false;
        for (name, recorded) in recordings {
            let mut source = Source {
                name,
                recorded,
                next: None,
                ahead: None,
                tapped: false,
                gap: false,
            };
            source.advance()?;
            gap |= source.ended_behind_gap();
            sources.push(source);
        }
        Ok(Self { sources, gap })
    }

    /// What comes next; `None` at the end of all.
    ///
    /// # Errors
    /// What cannot be read any further.
    pub fn read(&mut self) -> Result<Option<Told>, CaptureError> {
        let first = self.sources.iter_mut().filter(|source| source.next.is_some());
        let Some(first) = first.min_by_key(|source| source.next.as_ref().and_then(Told::at)) else {
            return Ok(None);
        };
        let told = first.next.take();
        first.advance()?;
        let ended_behind_gap = first.ended_behind_gap();
        let told = match told {
            Some(Told::Message(message)) => Some(Told::Message(Message {
                after_gap: message.after_gap || std::mem::take(&mut self.gap),
                ..message
            })),
            told => told,
        };
        self.gap |= ended_behind_gap;
        Ok(told)
    }

    /// How much was read of each.
    #[must_use]
    pub fn counted(&self) -> Vec<(String, Counted)> {
        let all = self.sources.iter();
        all.map(|source| (source.name.clone(), source.recorded.counted()))
            .collect()
    }
}

impl Source {
    fn ended_behind_gap(&mut self) -> bool {
        self.next.is_none() && std::mem::take(&mut self.gap)
    }

    fn advance(&mut self) -> Result<(), CaptureError> {
        let fail = |source| CaptureError {
            name: self.name.clone(),
            source,
        };
        if let Some(ahead) = self.ahead.take() {
            self.next = Some(ahead);
            return Ok(());
        }
        self.next = loop {
            match self.recorded.read().map_err(fail)? {
                None => break None,
                Some(Item::Message(message)) => break Some(Told::Message(message)),
                Some(Item::Wire(wire)) => break Some(Told::Wire(*wire)),
                Some(Item::Record(record)) => {
                    let place = self.recorded.place();
                    self.gap |= is_cut_off(&record);
                    if let Event::RunBegun { header } = &record.event {
                        self.tapped = header.vantage == "tap";
                    }
                    let seen = from_journal::wire(
                        record.at.utc,
                        record.source,
                        record.direction,
                        &record.event,
                        place.file,
                    );
                    if let Some(wire) = seen {
                        self.ahead = from_journal::carried(&wire, place).map(Told::Message);
                        break Some(Told::Wire(wire));
                    }
                    if let Event::Message {
                        topic,
                        qos,
                        retain,
                        payload: tck_journal::Payload::Whole(payload),
                        ..
                    } = record.event
                    {
                        break Some(Told::Message(Message {
                            at: Some(record.at.utc),
                            topic,
                            payload,
                            qos: Some(qos),
                            retain: Some(retain),
                            place,
                            after_gap: std::mem::take(&mut self.gap),
                            carried: self.tapped.then_some(Carried::BESIDE_TAP),
                        }));
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
    use crate::{Lines, Mapping};

    #[test]
    fn the_earliest_message_comes_first() {
        let recording = |number: usize, text: &str| {
            let lines = Lines::new(Box::new(Cursor::new(text.to_owned())), number, Mapping::default());
            (format!("{number}"), lines.into())
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
        while let Some(Told::Message(message)) = merged.read().expect("readable") {
            order.push_str(&message.topic);
        }
        assert_eq!(order, "acdbe");
        assert_eq!(
            merged.counted()[1].1,
            Counted {
                lines: 4,
                skipped: 1,
                ..Counted::default()
            }
        );
    }
}
