//! What each record of a journal window looks like as a row of the diagram. Leaving rows out is left to
//! [`super::thin`].

use std::sync::Arc;

use super::Options;
use super::row::{Lane, Row, What};
use super::thin::{flagged, repeats, shorten, twins};
use crate::clean::{line, short};
use crate::headline::{self, headline};
use tck_journal::event::{Close, LinkFault, Program, StepEnd};
use tck_journal::{Direction, Entry, Event, Journal, Packet};
use tck_view::{MessageView, Names, StateView};

/// The rows of a window, and what was not drawn.
pub struct Found {
    pub drawn: Vec<Row>,
    pub acknowledgements: usize,
    pub probes: usize,
}

pub fn collect(journal: &Journal, window: (u64, u64), options: &Options<'_>) -> Found {
    let entries = journal.entries().within(window);
    let start = entries.first().map(|entry| entry.at().moment);
    let tap = journal.has_tap();
    let twins = twins(journal, window);
    let mut found = Found {
        drawn: Vec::new(),
        acknowledgements: 0,
        probes: 0,
    };
    let names = journal.names();
    let mut before: Option<Arc<StateView>> = None;
    for entry in entries {
        match entry.event() {
            Event::ProbeSent { .. } | Event::ProbeReceived { .. } => found.probes += 1,
            Event::Packet {
                packet: Packet::Ack { .. } | Packet::Pingreq | Packet::Pingresp | Packet::Suback { .. },
                ..
            } => found.acknowledgements += 1,
            _ => {}
        }
        if twins.hidden.contains(&entry.seq()) || flagged(&mut found.drawn, &entry) {
            continue;
        }
        let around = (before.as_deref(), names);
        let Some(mut row) = row(&entry, twins.seen.contains(&entry.seq()), tap, around, options) else {
            continue;
        };
        row.time = start.map(|start| (entry.at().moment - start).as_secs_f64());
        if let Some(MessageView::State(state)) = headline::view(&entry, names) {
            before = Some(Arc::clone(state));
        }
        if !repeats(&mut found.drawn, &row, options) {
            found.drawn.push(row);
        }
    }
    for row in &mut found.drawn {
        if row.count > 1 {
            row.detail = format!("{} × {}, unchanged up to #{}", row.detail, row.count, row.last);
        }
    }
    shorten(&mut found.drawn, options);
    found
}

fn plain(entry: &Entry, what: What, title: impl Into<String>, detail: impl Into<String>) -> Row {
    Row {
        seq: entry.seq(),
        time: None,
        what,
        title: title.into(),
        detail: detail.into(),
        class: "",
        mark: false,
        count: 1,
        last: entry.seq(),
        headline: String::new(),
        topic: None,
        stimulus: false,
    }
}

fn arrow(from: Lane, to: Lane) -> What {
    What::Arrow { from, to, unseen: None }
}

fn row(
    entry: &Entry,
    twin: bool,
    tap: bool,
    (before, names): (Option<&StateView>, &Names),
    options: &Options<'_>,
) -> Option<Row> {
    use Lane::{Broker, Device, Harness};
    let text = |text: &str| line(text).into_owned();
    let message = |what| {
        let words = headline(entry, before, names);
        let mut row = plain(entry, what, headline::kind(entry), words.clone());
        row.headline = words;
        row.topic = headline::topic(entry);
        row
    };
    let row = match entry.event() {
        Event::Message { .. } => message(match (twin, tap) {
            (true, _) => arrow(Device, Harness),
            // The broker spoke for the device: its last will, or something stored.
            (false, true) => arrow(Broker, Harness),
            (false, false) => What::Arrow {
                from: Device,
                to: Harness,
                unseen: Some((Device, Broker)),
            },
        }),
        Event::Sent { .. } => {
            let mut row = message(match (twin, tap) {
                (true, _) => arrow(Harness, Device),
                (false, true) => arrow(Harness, Broker),
                (false, false) => What::Arrow {
                    from: Harness,
                    to: Device,
                    unseen: Some((Broker, Device)),
                },
            });
            row.class = "sent";
            row.stimulus = true;
            row
        }
        Event::Retained { .. } => {
            let mut row = message(arrow(Broker, Harness));
            row.title = format!("{}, to a fresh subscriber", row.title);
            row.topic = None;
            row
        }
        Event::Packet { packet, .. } => return packet_row(entry, packet, &message),
        Event::Undecodable { reason, .. } => {
            let mut row = plain(entry, arrow(Device, Broker), "undecodable bytes", text(reason));
            row.class = "trouble";
            row
        }
        Event::Opened { peer, .. } => plain(entry, arrow(Device, Broker), "opens a connection", text(peer)),
        Event::Closed { how, .. } => match how {
            Close::DeviceFin => plain(entry, arrow(Device, Broker), "closes the connection", ""),
            Close::DeviceReset => plain(entry, arrow(Device, Broker), "resets the connection", ""),
            Close::Broker => plain(entry, arrow(Broker, Device), "closes the connection", ""),
            Close::Harness => plain(entry, arrow(Broker, Device), "cuts the connection", "by the harness"),
        },
        Event::Fault { fault } => {
            let (title, detail) = link_fault(fault);
            let mut row = plain(entry, What::Box(Broker), title, detail);
            row.class = "fault";
            row.stimulus = true;
            row
        }
        Event::StepBegun { path } => {
            let title = options.steps.get(path).map_or(String::new(), |title| text(title));
            plain(entry, What::Step, text(path), title)
        }
        Event::StepEnded { path, end } => {
            let (title, detail) = match end {
                StepEnd::Decided => return None,
                StepEnd::Deadline => ("time is up".to_owned(), text(path)),
                StepEnd::Interrupted => ("interrupted".to_owned(), text(path)),
                StepEnd::Broken(why) => ("the harness broke".to_owned(), text(why)),
                StepEnd::Skipped(why) => ("the test is skipped".to_owned(), text(why)),
                StepEnd::Refused(why) | StepEnd::Declined(why) => ("the device does not do it".to_owned(), text(why)),
            };
            let mut row = plain(entry, What::Box(Harness), title, detail);
            row.class = "trouble";
            row
        }
        Event::Mark { .. } => plain(entry, What::Box(Harness), "mark", "deadlines count from here"),
        Event::Served { name, behaviour, .. } => plain(
            entry,
            What::Box(Harness),
            format!("offers {}", text(name)),
            text(behaviour),
        ),
        Event::Fetched {
            request, status, phase, ..
        } => {
            let status = status.map_or(String::new(), |status| format!("{status} "));
            plain(
                entry,
                arrow(Device, Harness),
                text(request),
                format!("HTTP {status}{}", text(phase)),
            )
        }
        Event::Hook { hook, ok, detail, .. } => {
            let done = if *ok { "done" } else { "failed" };
            plain(
                entry,
                What::Box(Harness),
                format!("hook {} {done}", text(hook)),
                text(detail),
            )
        }
        Event::Vehicle { vehicle, what, with } => {
            let which = if *vehicle == 0 { "" } else { " 2" };
            plain(
                entry,
                What::Box(Harness),
                format!("vehicle{which}: {}", text(what)),
                text(&with.to_string()),
            )
        }
        Event::Question { text: asked, .. } => plain(entry, What::Box(Harness), "the operator is asked", text(asked)),
        Event::Answer { answer, .. } => plain(entry, What::Box(Harness), "the operator answers", text(answer)),
        Event::Note { text: note } => plain(entry, What::Box(Harness), "note", text(note)),
        Event::Waived { waiver } => plain(entry, What::Box(Harness), "from here on", text(&waiver.why)),
        Event::Trouble { text: trouble } => {
            let mut row = plain(entry, What::Box(Harness), "trouble", text(trouble));
            row.class = "trouble";
            row
        }
        Event::Program { program } => {
            let (title, detail) = match program {
                Program::Started { process, .. } => ("the program is started".to_owned(), format!("process {process}")),
                Program::Asked { by } => ("the program is asked to end".to_owned(), format!("by {}", text(by))),
                Program::Ended { how, words } => (format!("the program has ended: {how}"), text(words)),
            };
            let mut row = plain(entry, What::Box(Device), title, detail);
            if matches!(program, Program::Ended { .. }) {
                row.class = "trouble";
            }
            row
        }
        Event::Interrupted => {
            let mut row = plain(entry, What::Box(Harness), "the run is interrupted", "");
            row.class = "trouble";
            row
        }
        Event::Traced { origin, .. } if origin.is_foreign() => {
            let mut row = plain(entry, What::Box(Broker), "not of the program that was started", "");
            row.class = "trouble";
            row
        }
        Event::RunBegun { .. }
        | Event::Traced { .. }
        | Event::Planned { .. }
        | Event::RunEnded { .. }
        | Event::TestBegun { .. }
        | Event::TestEnded { .. }
        | Event::Bound { .. }
        | Event::RetainedEnd { .. }
        | Event::Lag { .. }
        | Event::ProbeSent { .. }
        | Event::ProbeReceived { .. } => return None,
    };
    Some(row)
}

fn packet_row(entry: &Entry, packet: &Packet, message: &impl Fn(What) -> Row) -> Option<Row> {
    let way = match entry.record.direction {
        Some(Direction::ToDevice) => arrow(Lane::Broker, Lane::Device),
        _ => arrow(Lane::Device, Lane::Broker),
    };
    let detail = match packet {
        Packet::Publish { .. } => return Some(message(way)),
        Packet::Connect {
            client_id,
            keep_alive,
            clean_session,
            will,
            ..
        } => {
            let will = will.as_ref().map_or("no last will", |_| "with a last will");
            let session = if *clean_session { "" } else { ", session kept" };
            let client = short(&line(client_id), 24).into_owned();
            format!("{client}, {will}, keep-alive {keep_alive} s{session}")
        }
        Packet::Connack { code: 0, .. } => "accepted".to_owned(),
        Packet::Connack { code, .. } => format!("refused with code {code}"),
        Packet::Subscribe { filters, .. } => match filters.as_slice() {
            [one] => line(&one.filter).into_owned(),
            more => format!("{} filters", more.len()),
        },
        Packet::Unsubscribe { filters, .. } => format!("{} filters", filters.len()),
        Packet::Disconnect { code: 0 } | Packet::Auth => String::new(),
        Packet::Disconnect { code } => format!("reason {code}"),
        Packet::Ack { .. } | Packet::Suback { .. } | Packet::Pingreq | Packet::Pingresp => return None,
    };
    let mut row = plain(entry, way, headline::packet_name(packet), detail);
    row.class = "packet";
    Some(row)
}

fn link_fault(fault: &LinkFault) -> (&'static str, String) {
    let way = |direction: &Option<Direction>| match direction {
        None => "both ways",
        Some(Direction::FromDevice) => "from the device",
        Some(Direction::ToDevice) => "to the device",
    };
    let some = |topic: &Option<String>, count: &u32, direction: &Option<Direction>| {
        let topic = topic.as_deref().map_or("any topic".into(), line);
        format!("next {count} on {topic}, {}", way(direction))
    };
    match fault {
        LinkFault::Cut { reset: true } => ("link cut", "by reset".to_owned()),
        LinkFault::Cut { reset: false } => ("link cut", "in order (FIN)".to_owned()),
        LinkFault::Silence { direction } => ("link silent", way(direction).to_owned()),
        LinkFault::Delay { millis, direction } => ("link slow", format!("{millis} ms {}", way(direction))),
        LinkFault::Drop {
            topic,
            count,
            direction,
        } => ("link drops", some(topic, count, direction)),
        LinkFault::Duplicate {
            topic,
            count,
            direction,
        } => ("link doubles", some(topic, count, direction)),
        LinkFault::Refuse => ("link refuses", "new connections".to_owned()),
        LinkFault::Restore => ("link restored", String::new()),
    }
}
