//! A window of the journal as a sequence diagram (SVG).
//!
//! Three lanes: harness, broker (with the tap before it), device. [`rows`] says what a record looks like, [`thin`]
//! what is left out, this module places the rest. The picture stands alone, and inside an HTML page it takes the page's colours; its arrows
//! link to `#m<number>` where the page shows that message.

mod row;
mod rows;
mod thin;

use std::collections::{BTreeMap, BTreeSet};

use askama::Template;

use super::clean::short;
use row::{Lane, Row, What};
use tck_journal::Journal;

/// Most rows of a diagram unless the caller says otherwise.
pub const ROW_LIMIT: usize = 200;

const WIDTH: usize = 1000;
const HEAD: usize = 46;
const ARROW: usize = 40;
const BAND: usize = 30;
const BOX: usize = 36;

/// What a diagram needs besides the journal.
#[derive(Clone, Debug)]
pub struct Options<'a> {
    /// Prefix of the ids inside the picture; one per picture of a page. Letters, digits and `-`.
    pub id: &'a str,
    /// Title, for those who cannot see the picture.
    pub title: &'a str,
    /// Records the page shows: their arrows become links.
    pub linked: &'a BTreeSet<u64>,
    /// Records to point out, and the word to point them out with, such as `fail` or `nearest miss`.
    pub marked: &'a BTreeMap<u64, String>,
    /// Titles of steps by path.
    pub steps: &'a BTreeMap<String, String>,
    /// Most rows.
    pub limit: usize,
}

/// Draws the records `first..=last`.
///
/// # Errors
/// When the template cannot be written; it has no reason to.
pub fn render(journal: &Journal, window: (u64, u64), options: &Options<'_>) -> Result<String, askama::Error> {
    let found = rows::collect(journal, window, options);
    let mut top = HEAD;
    let mut placed = Vec::with_capacity(found.drawn.len());
    for row in &found.drawn {
        let height = height(row);
        placed.push(place(row, top, height, options));
        top += height;
    }
    Picture {
        id: options.id,
        title: options.title,
        description: description(&found),
        width: WIDTH,
        height: top + 34,
        foot: top + 6,
        lanes: Lane::ALL.map(|lane| LaneView {
            x: lane.x(),
            name: lane.name(),
        }),
        rows: placed,
        hidden: hidden(&found),
    }
    .render()
}

fn height(row: &Row) -> usize {
    match row.what {
        What::Arrow { .. } => ARROW,
        What::Step | What::Gap => BAND,
        What::Box(_) => BOX,
    }
}

fn description(found: &rows::Found) -> String {
    let arrows = found
        .drawn
        .iter()
        .filter(|row| matches!(row.what, What::Arrow { .. }))
        .count();
    format!(
        "Sequence diagram with three lanes, harness, broker and device, read from top to bottom: {arrows} arrows in {} rows. The same messages are listed as text below it.",
        found.drawn.len()
    )
}

fn hidden(found: &rows::Found) -> String {
    let mut parts = Vec::new();
    if found.acknowledgements > 0 {
        parts.push(format!("{} MQTT acknowledgements and pings", found.acknowledgements));
    }
    if found.probes > 0 {
        parts.push(format!("{} probes of the harness", found.probes));
    }
    if parts.is_empty() {
        return String::new();
    }
    format!("Not drawn: {}.", parts.join(" and "))
}

#[derive(Template)]
#[template(path = "report/sequence.svg")]
struct Picture<'a> {
    id: &'a str,
    title: &'a str,
    description: String,
    width: usize,
    height: usize,
    foot: usize,
    lanes: [LaneView; 3],
    rows: Vec<RowView>,
    hidden: String,
}

struct LaneView {
    x: usize,
    name: &'static str,
}

/// A row with its coordinates.
struct RowView {
    kind: &'static str,
    /// `m121` when the page shows the record.
    link: Option<u64>,
    seq: String,
    time: String,
    /// Top of the row.
    y: usize,
    /// Line of the text.
    text_y: usize,
    /// Line of the arrow, or middle of the box.
    line_y: usize,
    from: usize,
    to: usize,
    /// Tip of the arrow, as points of a triangle.
    tip: String,
    /// Where the part of the way begins that nobody saw; equal to `to` when all of it was seen.
    unseen: Option<(usize, usize)>,
    middle: usize,
    title: String,
    detail: String,
    mark: String,
    class: &'static str,
    /// Whether the step set the mark.
    flag: bool,
}

fn place(row: &Row, top: usize, height: usize, options: &Options<'_>) -> RowView {
    let (from, to, unseen, kind) = match row.what {
        What::Arrow { from, to, unseen } => {
            let unseen = unseen.map(|(a, b)| (a.x(), b.x()));
            (from.x(), to.x(), unseen, "arrow")
        }
        What::Box(lane) => (lane.x() - 105, lane.x() + 105, None, "box"),
        What::Step => (0, 0, None, "step"),
        What::Gap => (0, 0, None, "gap"),
    };
    let line_y = match row.what {
        What::Arrow { .. } => top + height - 10,
        _ => top + height / 2,
    };
    // Where the tip of the arrow begins.
    let back = if to >= from { to.saturating_sub(8) } else { to + 8 };
    let tip = format!("{to},{line_y} {back},{} {back},{}", line_y - 4, line_y + 4);
    // About 6.2 units a character at the size the text is set in.
    let room = match row.what {
        What::Step | What::Gap => 112,
        What::Arrow { .. } => from.abs_diff(to) * 10 / 62,
        What::Box(_) => 28,
    };
    let title = short(&row.title, room).into_owned();
    let left = room.saturating_sub(title.chars().count() + 3);
    let detail = match row.what {
        What::Box(_) => short(&row.detail, 32).into_owned(),
        _ if left < 6 => String::new(),
        _ => short(&row.detail, left).into_owned(),
    };
    let mark = options.marked.get(&row.seq).cloned().unwrap_or_default();
    RowView {
        kind,
        link: options.linked.contains(&row.seq).then_some(row.seq),
        seq: if row.seq == 0 {
            String::new()
        } else {
            format!("#{}", row.seq)
        },
        time: row.time.map_or(String::new(), |time| format!("{time:+.3} s")),
        y: top,
        text_y: match row.what {
            What::Arrow { .. } => line_y - 8,
            _ => line_y + 4,
        },
        line_y,
        from,
        to,
        tip,
        unseen,
        middle: usize::midpoint(from, to),
        title,
        detail,
        class: if mark.is_empty() { row.class } else { "marked" },
        mark,
        flag: row.mark,
    }
}
