//! What lies on a floor, as SVG: one hand draws layouts, plans and the courses in reports.
//!
//! Everything is given in metres, y upwards. A place that is no number, or so far from the others that a picture would be of nothing
//! else, is left out and counted, see [`Picture::settle`]. Texts are escaped here; the colours are those of the page around the
//! picture, where it has any.

use std::f64::consts::TAU;
use std::fmt::Write as _;

/// Further from the middle of all places nothing is drawn, in metres: no floor is as large.
const FARTHEST: f64 = 10_000.0;
/// Beyond this a coordinate is no place on earth, in metres.
const ON_EARTH: f64 = 1e9;
/// A floor with more nodes has no names beside them: they would cover each other.
const NAMED: usize = 80;

/// How its kinds of lines look. Each is told from the others by its width and its dashes, too.
const STYLE: &str = "\
.course { font: 13px/1.2 ui-sans-serif, system-ui, \"Segoe UI\", \"DejaVu Sans\", sans-serif; }
.course polyline { fill: none; stroke-linejoin: round; }
.course text { fill: var(--ink, #1b1f24); paint-order: stroke; stroke: var(--paper, #fff); stroke-width: 4px; stroke-linejoin: round; }
.course .map { font-weight: 600; }
.course .edge { stroke: var(--muted, #57606a); stroke-width: 1.5; }
.course .tip { fill: var(--muted, #57606a); }
.course .base { stroke: var(--accent, #1f5f99); stroke-width: 9; stroke-opacity: .45; stroke-linecap: round; }
.course .horizon { stroke: var(--accent, #1f5f99); stroke-width: 9; stroke-opacity: .45; stroke-dasharray: 14 10; }
.course .trail { stroke: var(--ink, #1b1f24); stroke-width: 3.2; stroke-dasharray: .1 6; stroke-linecap: round; }
.course .after { stroke: var(--ink, #1b1f24); stroke-width: 2.4; stroke-opacity: .4; stroke-dasharray: .1 9; stroke-linecap: round; }
.course .node { fill: var(--ink, #1b1f24); }
.course .start { fill: var(--paper, #fff); stroke: var(--ink, #1b1f24); stroke-width: 2.5; }
.course .vehicle { fill: var(--fail, #b3261e); stroke: var(--paper, #fff); stroke-width: 1.5; }
.course .ring { fill: none; stroke: var(--fail, #b3261e); stroke-width: 2; }
.course .number { fill: var(--fail, #b3261e); font-weight: 700; }
";

/// What a line of a picture stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineKind {
    /// A way of the floor, with the direction in which it may be driven.
    Edge,
    /// A released edge of an order.
    Base,
    /// An edge of an order that is not released.
    Horizon,
    /// Where a vehicle was.
    Trail,
    /// Where it was after what the picture is about.
    After,
}

impl LineKind {
    const fn class(self) -> &'static str {
        match self {
            Self::Edge => "edge",
            Self::Base => "base",
            Self::Horizon => "horizon",
            Self::Trail => "trail",
            Self::After => "after",
        }
    }
}

/// A line of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// What it stands for.
    pub kind: LineKind,
    /// The places it leads through.
    pub points: Vec<(f64, f64)>,
    /// What it is called.
    pub name: String,
}

/// A node of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Dot {
    /// To the right.
    pub x: f64,
    /// Upwards.
    pub y: f64,
    /// What it is called.
    pub name: String,
    /// Whether it is a station.
    pub station: bool,
}

/// A vehicle in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    /// To the right.
    pub x: f64,
    /// Upwards.
    pub y: f64,
    /// Its heading in radians, where it is known.
    pub theta: Option<f64>,
    /// What stands beside it.
    pub name: String,
}

/// What lies on one map. What comes later lies above.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Ways, orders and trails.
    pub lines: Vec<Line>,
    /// Nodes.
    pub nodes: Vec<Dot>,
    /// Where a trail begins.
    pub start: Option<(f64, f64)>,
    /// Vehicles.
    pub vehicles: Vec<Stand>,
}

/// How large a picture may be, without its border, in units of the SVG.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Its width.
    pub width: f64,
    /// Its greatest height.
    pub height: f64,
    /// Its border on each side.
    pub border: f64,
}

impl Room {
    /// For a page.
    pub const PAGE: Self = Self {
        width: 680.0,
        height: 400.0,
        border: 50.0,
    };
    /// For a picture of its own.
    pub const SHEET: Self = Self {
        width: 900.0,
        height: 900.0,
        border: 60.0,
    };
}

/// Where places of the floor lie in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    left: f64,
    top: f64,
    scale: f64,
    room: Room,
    down: f64,
    /// Its height, borders included.
    pub height: f64,
}

impl Frame {
    /// The frame that holds all these places, so far down in the picture. A floor that is only a point or a line has a width, too.
    fn of(points: impl Iterator<Item = (f64, f64)>, room: Room, down: f64) -> Self {
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut bottom, mut top) = (f64::INFINITY, f64::NEG_INFINITY);
        for (x, y) in points {
            (left, right) = (left.min(x), right.max(x));
            (bottom, top) = (bottom.min(y), top.max(y));
        }
        if left > right {
            (left, right, bottom, top) = (0.0, 0.0, 0.0, 0.0);
        }
        let (width, height) = ((right - left).max(1.0), (top - bottom).max(0.0));
        let scale = (room.width / width).min(room.height / height.max(f64::MIN_POSITIVE));
        let beside = (room.width - (right - left) * scale) / 2.0;
        Self {
            left: left - beside / scale,
            top,
            scale,
            room,
            down,
            height: height * scale + 2.0 * room.border,
        }
    }

    /// Where a place lies.
    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let across = self.room.border + (x - self.left) * self.scale;
        let down = self.down + self.room.border + (self.top - y) * self.scale;
        (across, down)
    }

    /// The width of the picture, borders included.
    fn width(&self) -> f64 {
        self.room.width + 2.0 * self.room.border
    }
}

impl Picture {
    /// Leaves out what cannot be drawn beside the rest, and says how many places that were.
    pub fn settle(&mut self) -> usize {
        let near = |value: f64| value.abs() < ON_EARTH;
        let is_place = |(x, y): (f64, f64)| near(x) && near(y);
        let median = |mut all: Vec<f64>| {
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied().unwrap_or_default()
        };
        let (xs, ys): (Vec<f64>, Vec<f64>) = self.points().filter(|point| is_place(*point)).unzip();
        let (middle_x, middle_y) = (median(xs), median(ys));
        let is_drawn = |(x, y): (f64, f64)| {
            is_place((x, y)) && (x - middle_x).abs() <= FARTHEST && (y - middle_y).abs() <= FARTHEST
        };
        let before = self.points().count();
        for line in &mut self.lines {
            if matches!(line.kind, LineKind::Trail | LineKind::After) {
                line.points.retain(|point| is_drawn(*point));
            } else if !line.points.iter().all(|point| is_drawn(*point)) {
                line.points.clear();
            }
        }
        self.lines.retain(|line| line.points.len() > 1);
        self.nodes.retain(|node| is_drawn((node.x, node.y)));
        self.start = self.start.filter(|start| is_drawn(*start));
        self.vehicles.retain(|vehicle| is_drawn((vehicle.x, vehicle.y)));
        before - self.points().count()
    }

    /// Every place that something is drawn at.
    fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        let lines = self.lines.iter().flat_map(|line| line.points.iter().copied());
        let nodes = self.nodes.iter().map(|node| (node.x, node.y));
        let vehicles = self.vehicles.iter().map(|vehicle| (vehicle.x, vehicle.y));
        lines.chain(nodes).chain(self.start).chain(vehicles)
    }

    /// Where its places lie, so far down in a picture.
    pub(super) fn frame(&self, room: Room, down: f64) -> Frame {
        Frame::of(self.points(), room, down)
    }

    /// It as SVG, for a page. `id` begins the ids in it: letters, digits and `-`. It is settled before.
    #[must_use]
    pub fn svg(&self, id: &str, title: &str, description: &str) -> String {
        let frame = self.frame(Room::PAGE, 0.0);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"course\" viewBox=\"0 0 {:.0} {:.0}\" role=\"img\" \
             aria-labelledby=\"{id}-title {id}-desc\">\n<title id=\"{id}-title\">{}</title>\n<desc id=\"{id}-desc\">{}</desc>\n\
             {}{}</svg>",
            frame.width(),
            frame.height,
            escaped(title),
            escaped(description),
            head(id),
            self.body(&frame, id)
        )
    }

    /// What is drawn in a frame.
    pub(super) fn body(&self, frame: &Frame, id: &str) -> String {
        let mut body = String::new();
        for line in &self.lines {
            let points = line.points.iter().map(|point| {
                let (x, y) = frame.at(*point);
                format!("{x:.1},{y:.1}")
            });
            let points: Vec<String> = points.collect();
            let tip = match line.kind {
                LineKind::Edge => format!(" marker-end=\"url(#{id}-tip)\""),
                _ => String::new(),
            };
            let _ = writeln!(
                body,
                "<polyline class=\"{}\" points=\"{}\"{tip}><title>{}</title></polyline>",
                line.kind.class(),
                points.join(" "),
                escaped(&line.name)
            );
        }
        for node in &self.nodes {
            let (x, y) = frame.at((node.x, node.y));
            let _ = if node.station {
                write!(
                    body,
                    "<rect class=\"node\" x=\"{:.1}\" y=\"{:.1}\" width=\"12\" height=\"12\"/>",
                    x - 6.0,
                    y - 6.0
                )
            } else {
                write!(body, "<circle class=\"node\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\"/>")
            };
            if self.nodes.len() <= NAMED {
                body.push_str(&beside(frame, (x, y), -9.0, "", &node.name));
            }
            body.push('\n');
        }
        if let Some((x, y)) = self.start.map(|start| frame.at(start)) {
            let _ = writeln!(body, "<circle class=\"start\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\"/>");
        }
        for vehicle in &self.vehicles {
            let (x, y) = frame.at((vehicle.x, vehicle.y));
            let shape = match vehicle.theta.filter(|theta| theta.is_finite()) {
                Some(theta) => format!(
                    "<path class=\"vehicle\" d=\"M13 0 -8 -8 -4 0 -8 8Z\" transform=\"translate({x:.1} {y:.1}) rotate({:.1})\"/>",
                    (-theta).rem_euclid(TAU).to_degrees()
                ),
                None => format!("<circle class=\"vehicle\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"7\"/>"),
            };
            let _ = writeln!(
                body,
                "{shape}<circle class=\"ring\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"17\"/>{}",
                beside(frame, (x, y), 26.0, "number", &vehicle.name)
            );
        }
        body
    }
}

/// A text beside a place; on its left near the right end of the picture.
fn beside(frame: &Frame, (x, y): (f64, f64), down: f64, class: &str, text: &str) -> String {
    let (across, anchor) = if x > frame.width() * 0.8 {
        (x - 9.0, " text-anchor=\"end\"")
    } else {
        (x + 9.0, "")
    };
    let class = match class {
        "" => String::new(),
        class => format!(" class=\"{class}\""),
    };
    format!(
        "<text{class} x=\"{across:.1}\" y=\"{:.1}\"{anchor}>{}</text>",
        y + down,
        escaped(text)
    )
}

/// What every picture begins with: its style, and the tip of its arrows.
pub(super) fn head(id: &str) -> String {
    format!(
        "<style>\n{STYLE}</style>\n<defs><marker id=\"{id}-tip\" viewBox=\"0 0 10 10\" refX=\"14\" refY=\"5\" markerWidth=\"11\" \
         markerHeight=\"11\" markerUnits=\"userSpaceOnUse\" orient=\"auto\"><path class=\"tip\" d=\"M0 0 10 5 0 10z\"/></marker></defs>\n"
    )
}

/// A text as XML has it. Characters that steer a reader instead of being read are blanks.
pub(super) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c if c.is_control() || steers(c) => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

/// Whether a character changes the direction or the joining of what follows, has no width, or is none.
fn steers(c: char) -> bool {
    matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff0}'..='\u{ffff}')
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn line(kind: LineKind, points: &[(f64, f64)]) -> Line {
        Line {
            kind,
            points: points.to_vec(),
            name: "way".to_owned(),
        }
    }

    fn dot(x: f64, y: f64) -> Dot {
        Dot {
            x,
            y,
            name: "n".to_owned(),
            station: false,
        }
    }

    #[test]
    fn what_is_above_on_the_floor_is_above_in_the_picture_and_keeps_its_shape() {
        let picture = Picture {
            nodes: vec![dot(0.0, 0.0), dot(10.0, 5.0)],
            ..Picture::default()
        };
        let frame = picture.frame(Room::PAGE, 0.0);
        assert_eq!(frame.at((0.0, 5.0)), (50.0, 50.0));
        assert_eq!(frame.at((10.0, 0.0)), (730.0, 390.0));
        assert!((frame.height - 440.0).abs() < 1e-9);
    }

    #[test]
    fn a_high_floor_is_no_higher_than_the_room_and_stands_in_its_middle() {
        let picture = Picture {
            nodes: vec![dot(2.0, 0.0), dot(4.0, 100.0)],
            ..Picture::default()
        };
        let frame = picture.frame(Room::PAGE, 0.0);
        assert!((frame.height - 500.0).abs() < 1e-9);
        assert!((frame.at((3.0, 50.0)).0 - 390.0).abs() < 1e-9);
    }

    #[test]
    fn what_is_no_place_or_far_from_all_others_is_left_out_and_counted() {
        let mut picture = Picture {
            lines: vec![
                line(LineKind::Base, &[(0.0, 0.0), (5.0, 0.0)]),
                line(LineKind::Horizon, &[(5.0, 0.0), (f64::NAN, 0.0)]),
                line(
                    LineKind::Trail,
                    &[(0.0, 0.0), (1e308, 0.0), (1.0, 0.0), (50_000.0, 0.0), (2.0, 0.0)],
                ),
            ],
            nodes: vec![dot(0.0, 0.0), dot(f64::INFINITY, 0.0), dot(5.0, 0.0)],
            start: Some((0.0, 0.0)),
            vehicles: vec![Stand {
                x: -2e8,
                y: 0.0,
                theta: None,
                name: "1".to_owned(),
            }],
        };
        assert_eq!(picture.settle(), 6);
        let kinds: Vec<LineKind> = picture.lines.iter().map(|line| line.kind).collect();
        assert_eq!(kinds, [LineKind::Base, LineKind::Trail]);
        assert_eq!(picture.lines[1].points, [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]);
        assert_eq!((picture.nodes.len(), picture.vehicles.len()), (2, 0));
    }

    proptest! {
        #[test]
        fn whatever_is_drawn_is_xml_of_finite_numbers(
            points in prop::collection::vec((prop::num::f64::ANY, prop::num::f64::ANY), 0..20),
            theta in prop::num::f64::ANY,
            name in any::<String>(),
        ) {
            let mut picture = Picture {
                lines: vec![Line { kind: LineKind::Trail, points: points.clone(), name: name.clone() }],
                nodes: points.iter().map(|(x, y)| Dot { x: *x, y: *y, name: name.clone(), station: true }).collect(),
                start: points.first().copied(),
                vehicles: points.iter().map(|(x, y)| Stand { x: *x, y: *y, theta: Some(theta), name: name.clone() }).collect(),
            };
            picture.settle();
            let svg = picture.svg("c1", &name, &name);
            prop_assert!(!svg.contains("NaN") || name.contains("NaN"));
            prop_assert!(!svg.contains("inf") || name.contains("inf"));
            prop_assert!(roxmltree::Document::parse(&svg).is_ok(), "{}", svg);
        }
    }
}
