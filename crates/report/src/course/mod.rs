//! Where a vehicle went, as a picture: the order it was told, the way it drove, and where it was when something was found.
//!
//! [`Driven`] takes in the messages to and from one vehicle, bounded, and makes a [`CoursePicture`] of them: what is drawn, as
//! data, so that a result can keep it where the messages are gone. The same figures stand in the table below the picture. The drawing
//! itself is that of layouts and plans, [`tck_course::picture`].

mod driven;
mod figure;
mod picture;
mod route;

pub use driven::{Bounds, Driven, Finding};
pub use picture::{CoursePicture, Found, Stop, Stretch};

use std::sync::Arc;

use tck_journal::{Entry, Event, Journal, Packet};
use tck_view::Topic;

/// The picture of a part of a journal, with where the vehicle was at these findings, the worst first. It shows the vehicle that the
/// first one is about. `None` where no vehicle moved.
#[must_use]
pub fn in_window(journal: &Journal, window: (u64, u64), findings: &[Finding]) -> Option<CoursePicture> {
    let entries = journal.entries().within(window);
    let of = |entry: &Entry| address(entry).map(|(of, _)| of.to_owned());
    let accused = findings.first().and_then(|finding| journal.get(finding.number));
    let accused = accused.and_then(|entry| of(&entry));
    let stated = |entry: &Arc<Entry>| address(entry).is_some_and(|(_, name)| name == "state");
    let vehicle = accused.or_else(|| entries.iter().find(stated).and_then(|entry| of(&entry)))?;
    let mut driven = Driven::new(Bounds::TEST).watching(findings.iter().map(|finding| finding.number));
    for entry in entries {
        // What the tap saw of it is the same message once more.
        if !matches!(entry.event(), Event::Message { .. } | Event::Sent { .. }) {
            continue;
        }
        let name = address(&entry).filter(|(of, _)| *of == vehicle).map(|(_, name)| name);
        let message = name.and_then(|name| entry.view(Topic::of_name(name), journal.names()));
        if let Some(message) = message {
            driven.note(entry.seq(), message);
        }
    }
    driven.picture(findings)
}

/// The topic of a message: whose it is, and the name of the topic.
fn address(entry: &Entry) -> Option<(&str, &str)> {
    let (Event::Message { topic, .. }
    | Event::Sent { topic, .. }
    | Event::Packet {
        packet: Packet::Publish { topic, .. },
        ..
    }) = entry.event()
    else {
        return None;
    };
    topic.rsplit_once('/')
}

#[cfg(test)]
mod tests;
