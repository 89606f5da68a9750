//! What is left out of a diagram, so that what matters can be seen.
//!
//! The tap and the standing subscription both see a message; that is one arrow from end to end. States that
//! say nothing new are counted, not drawn again. When there are too many rows, those next to the marked
//! records stay.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use super::Options;
use super::row::{Row, What};
use crate::clean::line;
use crate::statement::many;
use tck_journal::{Direction, Entry, Event, Journal, Packet};

/// How many records apart the two sightings of one message may be.
const TWIN_DISTANCE: usize = 12;

/// Which records are second sightings of a message, and which first sightings have one.
pub struct Twins {
    pub hidden: BTreeSet<u64>,
    pub seen: BTreeSet<u64>,
}

/// The twins among records, by their numbers.
pub fn twins(journal: &Journal, window: (u64, u64)) -> Twins {
    let mut twins = Twins {
        hidden: BTreeSet::new(),
        seen: BTreeSet::new(),
    };
    if !journal.has_tap() {
        return twins;
    }
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
    let mut ahead = journal.entries().within(window).iter();
    // The record that is looked at, and those around it.
    let mut next: VecDeque<Arc<Entry>> = ahead.by_ref().take(TWIN_DISTANCE + 1).collect();
    let mut before: VecDeque<Arc<Entry>> = VecDeque::new();
    while let Some(entry) = next.pop_front() {
        let twin = match entry.event() {
            Event::Message { .. } => {
                let mut before = before.iter().rev();
                before.find(|other| tap(other, Direction::FromDevice) && same(&entry, other))
            }
            Event::Sent { .. } => {
                let mut next = next.iter();
                next.find(|other| tap(other, Direction::ToDevice) && same(&entry, other))
            }
            _ => None,
        };
        let twin = twin.map(|twin| twin.seq());
        if let Some(twin) = twin.filter(|twin| !twins.hidden.contains(twin)) {
            twins.hidden.insert(twin);
            twins.seen.insert(entry.seq());
        }
        if before.len() == TWIN_DISTANCE {
            before.pop_front();
        }
        before.push_back(entry);
        next.extend(ahead.next());
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

/// Counts a message that says nothing new onto the row that said it; nothing but other messages of the
/// device may have come in between.
pub fn repeats(rows: &mut [Row], row: &Row, options: &Options<'_>) -> bool {
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
pub fn flagged(rows: &mut [Row], entry: &Entry) -> bool {
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
pub fn shorten(rows: &mut Vec<Row>, options: &Options<'_>) {
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
        let title = format!("{} left out; the journal has them", many(*left_out, "row"));
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
