//! What of a journal window is worth a row of the diagram.
//!
//! The tap and the standing subscription both see a message; that is one arrow from end to end. States that
//! say nothing new are counted, not drawn again. When there are too many rows, those next to the marked
//! records stay.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use serde_json::Value;

use super::Options;
use crate::journal::event::{Close, LinkFault, StepEnd};
use crate::journal::{Direction, Entry, Event, Journal, Packet};
use crate::report::clean::{line, short};
use crate::report::headline::{self, headline};

/// How many records apart the two sightings of one message may be.
const TWIN_DISTANCE: usize = 12;

/// A vertical line of the diagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lane {
    Harness,
    Broker,
    Device,
}

impl Lane {
    pub const ALL: [Self; 3] = [Self::Harness, Self::Broker, Self::Device];

    pub fn x(self) -> usize {
        match self {
            Self::Harness => 240,
            Self::Broker => 560,
            Self::Device => 880,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Harness => "harness",
            Self::Broker => "broker, tap",
            Self::Device => "device",
        }
    }
}

/// One row before it is placed.
#[derive(Clone, Debug)]
pub struct Row {
    /// Number of the record; 0 where there is none.
    pub seq: u64,
    /// Seconds since the window began.
    pub time: Option<f64>,
    pub what: What,
    pub title: String,
    pub detail: String,
    pub class: &'static str,
    /// Whether the step set the mark.
    pub mark: bool,
    count: u32,
    last: u64,
    headline: String,
    topic: Option<String>,
    stimulus: bool,
}

/// The shape of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// From one lane to another; `unseen` is the part of the way nobody watched.
    Arrow {
        from: Lane,
        to: Lane,
        unseen: Option<(Lane, Lane)>,
    },
    /// Something that happened on a lane.
    Box(Lane),
    /// A step began.
    Step,
    /// Rows were left out.
    Gap,
}

/// The rows of a window, and what was not drawn.
pub struct Rows {
    pub rows: Vec<Row>,
    pub acknowledgements: usize,
    pub probes: usize,
}

pub fn collect(journal: &Journal, (first, last): (u64, u64), options: &Options<'_>) -> Rows {
    let entries = journal.entries();
    let from = entries.partition_point(|entry| entry.seq() < first);
    let to = entries.partition_point(|entry| entry.seq() <= last);
    let entries = &entries[from..to.max(from)];
    let start = entries.first().map(|entry| entry.at().moment);
    let tap = journal
        .entries()
        .iter()
        .any(|entry| matches!(entry.event(), Event::Packet { .. } | Event::Opened { .. }));
    let twins = twins(entries);
    let mut found = Rows {
        rows: Vec::new(),
        acknowledgements: 0,
        probes: 0,
    };
    let mut before: HashMap<String, &Value> = HashMap::new();
    for (at, entry) in entries.iter().enumerate() {
        match entry.event() {
            Event::ProbeSent { .. } | Event::ProbeReceived { .. } => found.probes += 1,
            Event::Packet {
                packet: Packet::Ack { .. } | Packet::Pingreq | Packet::Pingresp | Packet::Suback { .. },
                ..
            } => found.acknowledgements += 1,
            _ => {}
        }
        if twins.hidden.contains(&at) || flagged(&mut found.rows, entry) {
            continue;
        }
        let topic = headline::topic(entry);
        let previous = topic.as_ref().and_then(|topic| before.get(topic)).copied();
        let Some(mut row) = row(entry, twins.seen.contains(&at), tap, previous, options) else {
            continue;
        };
        row.time = start.map(|start| (entry.at().moment - start).as_secs_f64());
        if let (Some(topic), Some(json)) = (topic, entry.json()) {
            before.insert(topic, json);
        }
        if !repeats(&mut found.rows, &row, options) {
            found.rows.push(row);
        }
    }
    for row in &mut found.rows {
        if row.count > 1 {
            row.detail = format!("{} × {}, unchanged up to #{}", row.detail, row.count, row.last);
        }
    }
    shorten(&mut found.rows, options);
    found
}

/// Which records are second sightings of a message, and which first sightings have one.
struct Twins {
    hidden: BTreeSet<usize>,
    seen: BTreeSet<usize>,
}

fn twins(entries: &[std::sync::Arc<Entry>]) -> Twins {
    let mut twins = Twins {
        hidden: BTreeSet::new(),
        seen: BTreeSet::new(),
    };
    let tap = |entry: &Entry, way: Direction| {
        matches!(
            entry.event(),
            Event::Packet {
                packet: Packet::Publish { .. },
                ..
            }
        ) && entry.record.direction == Some(way)
    };
    let same = |a: &Entry, b: &Entry| full_topic(a) == full_topic(b) && a.payload() == b.payload();
    for (at, entry) in entries.iter().enumerate() {
        let twin = match entry.event() {
            Event::Message { .. } => (at.saturating_sub(TWIN_DISTANCE)..at)
                .rev()
                .find(|other| tap(&entries[*other], Direction::FromDevice) && same(entry, &entries[*other])),
            Event::Sent { .. } => (at + 1..entries.len().min(at + TWIN_DISTANCE + 1))
                .find(|other| tap(&entries[*other], Direction::ToDevice) && same(entry, &entries[*other])),
            _ => None,
        };
        if let Some(twin) = twin.filter(|twin| !twins.hidden.contains(twin)) {
            twins.hidden.insert(twin);
            twins.seen.insert(at);
        }
    }
    twins
}

fn full_topic(entry: &Entry) -> Option<&str> {
    match entry.event() {
        Event::Message { topic, .. }
        | Event::Sent { topic, .. }
        | Event::Packet {
            packet: Packet::Publish { topic, .. },
            ..
        } => Some(topic),
        _ => None,
    }
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

fn row(entry: &Entry, twin: bool, tap: bool, before: Option<&Value>, options: &Options<'_>) -> Option<Row> {
    use Lane::{Broker, Device, Harness};
    let text = |text: &str| line(text).into_owned();
    let message = |what| {
        let words = headline(entry, before);
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
        Event::Hook { hook, ok, detail } => {
            let done = if *ok { "done" } else { "failed" };
            plain(
                entry,
                What::Box(Harness),
                format!("hook {} {done}", text(hook)),
                text(detail),
            )
        }
        Event::Answer { answer, .. } => plain(entry, What::Box(Harness), "the operator answers", text(answer)),
        Event::Note { text: note } => plain(entry, What::Box(Harness), "note", text(note)),
        Event::Trouble { text: trouble } => {
            let mut row = plain(entry, What::Box(Harness), "trouble", text(trouble));
            row.class = "trouble";
            row
        }
        Event::RunBegun { .. }
        | Event::Planned { .. }
        | Event::RunEnded { .. }
        | Event::TestBegun { .. }
        | Event::TestEnded { .. }
        | Event::Bound { .. }
        | Event::RetainedEnd { .. }
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
        Packet::Disconnect { code: 0 } => String::new(),
        Packet::Disconnect { code } => format!("reason {code}"),
        Packet::Auth => String::new(),
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

/// Counts a message that says nothing new onto the row that said it; nothing but other messages of the
/// device may have come in between.
fn repeats(rows: &mut [Row], row: &Row, options: &Options<'_>) -> bool {
    let pointed_out = |seq: u64| options.linked.contains(&seq) || options.marked.contains_key(&seq);
    if row.topic.is_none() || row.stimulus || pointed_out(row.seq) {
        return false;
    }
    let earlier = rows
        .iter_mut()
        .rev()
        .take_while(|earlier| earlier.topic.is_some() && !earlier.stimulus)
        .find(|earlier| earlier.topic == row.topic);
    let Some(earlier) = earlier else { return false };
    if earlier.headline != row.headline || earlier.what != row.what || pointed_out(earlier.seq) {
        return false;
    }
    earlier.count += 1;
    earlier.last = row.seq;
    true
}

/// A mark is shown on the band of its step, where that is drawn.
fn flagged(rows: &mut [Row], entry: &Entry) -> bool {
    let Event::Mark { path } = entry.event() else {
        return false;
    };
    let path = line(path);
    let step = rows.iter_mut().rev().find(|row| row.what == What::Step);
    step.filter(|row| row.title == path)
        .map(|row| row.mark = true)
        .is_some()
}

/// Keeps at most the given number of rows: those nearest to what is marked, or both ends when nothing is.
fn shorten(rows: &mut Vec<Row>, options: &Options<'_>) {
    let limit = options.limit.max(2);
    if rows.len() <= limit {
        return;
    }
    let mut anchors: Vec<usize> = (0..rows.len())
        .filter(|at| options.marked.contains_key(&rows[*at].seq))
        .collect();
    if anchors.is_empty() {
        anchors = vec![0, rows.len() - 1];
    }
    let mut by_distance: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for at in 0..rows.len() {
        let distance = anchors.iter().map(|anchor| anchor.abs_diff(at)).min().unwrap_or(0);
        by_distance.entry(distance).or_default().push(at);
    }
    let kept: BTreeSet<usize> = by_distance.into_values().flatten().take(limit).collect();
    let mut shortened = Vec::with_capacity(limit + 8);
    let mut left_out = 0;
    for (at, row) in rows.drain(..).enumerate() {
        if kept.contains(&at) {
            push_gap(&mut shortened, &mut left_out);
            shortened.push(row);
        } else {
            left_out += 1;
        }
    }
    push_gap(&mut shortened, &mut left_out);
    *rows = shortened;
}

fn push_gap(rows: &mut Vec<Row>, left_out: &mut usize) {
    if *left_out > 0 {
        let title = format!(
            "{} left out; the journal has them",
            crate::report::statement::many(*left_out, "row")
        );
        rows.push(Row {
            seq: 0,
            time: None,
            what: What::Gap,
            title,
            detail: String::new(),
            class: "",
            mark: false,
            count: 1,
            last: 0,
            headline: String::new(),
            topic: None,
            stimulus: false,
        });
    }
    *left_out = 0;
}
