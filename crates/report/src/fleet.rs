//! The fleet a master control was tested with: one line in words, and its reaction times as a picture (SVG).

use askama::Template;

use super::statement;
use tck_result::{FleetResult, ReactionTimes, RunResult};

/// Width of the picture, of one bar, and the height bars have at most.
const WIDTH: usize = 760;
const TALLEST: usize = 160;
const LEFT: usize = 44;

/// In one line: how many vehicles were commanded, and how fast.
#[must_use]
pub fn line(fleet: &FleetResult) -> String {
    let mut text = format!(
        "{} of {} commanded",
        fleet.commanded,
        statement::many(fleet.vehicles, "vehicle")
    );
    if let Some(reaction) = &fleet.reaction {
        text += &format!(
            "; from state to order: median {}, nine of ten within {}, longest {}",
            millis(reaction.median),
            millis(reaction.most),
            millis(reaction.longest)
        );
    }
    text
}

/// How long an answer took, of every step that awaited a message and took one, in microseconds.
#[must_use]
pub fn answers(result: &RunResult) -> Option<ReactionTimes> {
    let steps = result.tests.iter().flat_map(|test| &test.steps);
    let awaited = steps.filter(|step| step.took.is_some() && step.verb.starts_with("expect"));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to what fits"
    )]
    let micros: Vec<u32> = awaited
        .map(|step| (step.seconds * 1e6).clamp(0.0, f64::from(u32::MAX)) as u32)
        .collect();
    ReactionTimes::of(&micros)
}

/// `12 ms`, `1.5 s`.
#[must_use]
pub fn millis(time: f64) -> String {
    if time < 10.0 {
        format!("{time:.1} ms")
    } else if time < 1_000.0 {
        format!("{time:.0} ms")
    } else {
        format!("{:.1} s", time / 1_000.0)
    }
}

#[derive(Template)]
#[template(path = "report/reactions.svg", escape = "html")]
struct Plot {
    width: usize,
    height: usize,
    foot: usize,
    left: usize,
    title: String,
    counted: &'static str,
    span: &'static str,
    description: String,
    bars: Vec<Bar>,
}

struct Bar {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    count: usize,
    /// Up to which time, in words.
    label: String,
}

/// What a picture of times is about.
#[derive(Clone, Copy, Debug)]
pub struct Subject {
    /// What is counted.
    pub counted: &'static str,
    /// From what to what the time goes.
    pub span: &'static str,
}

/// The orders of a master control.
pub const ORDERS: Subject = Subject {
    counted: "orders",
    span: "a state of a vehicle to the next order for it",
};

/// The answers of a vehicle.
pub const ANSWERS: Subject = Subject {
    counted: "answers",
    span: "the beginning of a step to the message that the step awaits",
};

/// The distribution as a picture; columns from the first to the last that is not empty.
///
/// # Errors
/// When the template cannot be written; it has no reason to.
pub fn plot(reaction: &ReactionTimes, subject: Subject) -> Result<String, askama::Error> {
    let filled = |count: &usize| *count > 0;
    let first = reaction.buckets.iter().position(filled).unwrap_or(0);
    let last = reaction.buckets.iter().rposition(filled).unwrap_or(0);
    let shown = reaction.buckets.get(first..=last).unwrap_or_default();
    let highest = shown.iter().copied().max().unwrap_or(1).max(1);
    let step = (WIDTH - LEFT) / shown.len().max(4);
    let foot = 30 + TALLEST;
    let bars = shown.iter().enumerate().map(|(at, count)| {
        let height = count * TALLEST / highest;
        let bound = ReactionTimes::BOUNDS.get(first + at);
        Bar {
            x: LEFT + at * step,
            y: foot - height.max(2),
            width: step.saturating_sub(8),
            // The smallest number is still to be seen.
            height: height.max(2),
            count: *count,
            label: bound.map_or_else(|| "longer".to_owned(), |bound| format!("≤ {}", whole(*bound))),
        }
    });
    Plot {
        width: WIDTH,
        height: foot + 48,
        foot,
        left: LEFT,
        title: format!("Reaction times: from {}", subject.span),
        counted: subject.counted,
        span: subject.span,
        description: format!(
            "{} {}: half of them within {}, 99 % within {}, the longest {}.",
            reaction.count,
            subject.counted,
            millis(reaction.median),
            millis(reaction.nearly_all),
            millis(reaction.longest)
        ),
        bars: bars.collect(),
    }
    .render()
}

fn whole(bound: f64) -> String {
    if bound < 1_000.0 {
        format!("{bound:.0} ms")
    } else {
        format!("{:.0} s", bound / 1_000.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times() -> ReactionTimes {
        let micros: Vec<u32> = (1..=1_000).map(|number| number * number * 12).collect();
        ReactionTimes::of(&micros).unwrap()
    }

    #[test]
    fn a_distribution_says_what_most_vehicles_wait() {
        let times = times();
        assert_eq!((times.count, times.buckets.iter().sum::<usize>()), (1_000, 1_000));
        assert!((times.median - 3_000.0).abs() < 0.001 && (times.longest - 12_000.0).abs() < 0.001);
        let fleet = FleetResult {
            vehicles: 1_000,
            commanded: 999,
            reaction: Some(times),
            each: Vec::new(),
        };
        insta::assert_snapshot!(line(&fleet), @"999 of 1000 vehicles commanded; from state to order: median 3.0 s, nine of ten within 9.7 s, longest 12.0 s");
    }

    #[test]
    fn nothing_measured_is_nothing_shown() {
        assert!(ReactionTimes::of(&[]).is_none());
        let fleet = FleetResult {
            vehicles: 2,
            commanded: 0,
            reaction: None,
            each: Vec::new(),
        };
        assert_eq!(line(&fleet), "0 of 2 vehicles commanded");
    }

    #[test]
    fn the_picture_has_a_bar_for_every_bucket_in_between() {
        let picture = plot(&times(), ORDERS).unwrap();
        let filled = times().buckets.iter().filter(|count| **count > 0).count();
        assert_eq!(picture.matches("<rect").count(), filled);
        // The style sheet of the page has a class `bar` with a height of its own.
        assert!(!picture.contains("class=\"bar\""));
        roxmltree::Document::parse(&picture).unwrap();
    }
}
