//! How long the harness took itself, in words.

use tck_journal::{OwnLatency, Spread};

use super::fleet;

/// One kind of time, as a row of a table.
pub struct Row {
    /// From what to what it goes.
    pub what: &'static str,
    /// How often it was measured.
    pub count: u64,
    /// Half of the times are no longer.
    pub median: String,
    /// Ninety-nine of a hundred are no longer.
    pub p99: String,
    /// The longest.
    pub worst: String,
}

/// What was measured, each as a row.
#[must_use]
pub fn rows(latency: OwnLatency) -> Vec<Row> {
    let all = [("handed on", latency.passed_on), ("judged", latency.judged)];
    let row = |(what, spread): (&'static str, Option<Spread>)| {
        let spread = spread?;
        Some(Row {
            what,
            count: spread.count,
            median: time(spread.median_micros),
            p99: time(spread.p99_micros),
            worst: time(spread.worst_micros),
        })
    };
    all.into_iter().filter_map(row).collect()
}

/// In one line: how long most messages took, and the worst one.
#[must_use]
pub fn line(latency: OwnLatency) -> String {
    let told = |word: &str, spread: Spread| {
        format!(
            "{word} in {} (p99 {}, worst {})",
            time(spread.median_micros),
            time(spread.p99_micros),
            time(spread.worst_micros)
        )
    };
    let passed_on = latency.passed_on.map(|spread| told("passed on", spread));
    let judged = latency.judged.map(|spread| told("judged", spread));
    let all: Vec<String> = passed_on.into_iter().chain(judged).collect();
    format!("messages {}", all.join(", "))
}

/// `31 µs`, `1.2 ms`, `1.5 s`.
fn time(micros: u64) -> String {
    if micros < 1_000 {
        format!("{micros} µs")
    } else {
        fleet::millis(micros as f64 / 1_000.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_is_one_line_and_a_row_each() {
        let spread = |median_micros, p99_micros, worst_micros| Spread {
            count: 7,
            median_micros,
            p99_micros,
            worst_micros,
        };
        let tapped =
            OwnLatency::of(Some(spread(31, 80, 1_240)), Some(spread(120, 9_000, 1_500_000))).expect("measured");
        insta::assert_snapshot!(line(tapped), @"messages passed on in 31 µs (p99 80 µs, worst 1.2 ms), judged in 120 µs (p99 9.0 ms, worst 1.5 s)");
        assert_eq!(rows(tapped).len(), 2);
        let subscribed = OwnLatency::of(None, Some(spread(120, 900, 1_000))).expect("measured");
        insta::assert_snapshot!(line(subscribed), @"messages judged in 120 µs (p99 900 µs, worst 1.0 ms)");
        assert_eq!(rows(subscribed)[0].count, 7);
    }
}
