//! The times of a run as other formats write them. No clock is read: all comes from the result.

use std::time::Duration;

use jiff::Timestamp;
use tck_result::RunResult;

/// Longer than any run.
const LONGEST: f64 = 1e9;

/// When a run began; the epoch when that cannot be read.
#[must_use]
pub fn started(result: &RunResult) -> Timestamp {
    result.started.parse().unwrap_or(Timestamp::UNIX_EPOCH)
}

/// When a run was over.
#[must_use]
pub fn finished(result: &RunResult) -> Timestamp {
    let length = Duration::from_millis(millis(result.seconds));
    started(result).checked_add(length).unwrap_or(Timestamp::UNIX_EPOCH)
}

/// A time in UTC, with milliseconds.
#[must_use]
pub fn rfc3339(time: Timestamp) -> String {
    format!("{time:.3}")
}

/// Seconds as whole milliseconds.
#[must_use]
pub fn millis(seconds: f64) -> u64 {
    let seconds = if seconds.is_finite() {
        seconds.clamp(0.0, LONGEST)
    } else {
        0.0
    };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped above")]
    let millis = (seconds * 1000.0).round() as u64;
    millis
}

/// When a run began, in milliseconds since the epoch.
#[must_use]
pub fn millis_of_start(result: &RunResult) -> u64 {
    u64::try_from(started(result).as_millisecond()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_become_whole_milliseconds_whatever_they_are() {
        assert_eq!(millis(1.9996), 2000);
        for (seconds, expected) in [(-1.0, 0), (f64::NAN, 0), (f64::INFINITY, 0), (1e12, 1_000_000_000_000)] {
            assert_eq!(millis(seconds), expected, "{seconds}");
        }
        assert_eq!(rfc3339(Timestamp::UNIX_EPOCH), "1970-01-01T00:00:00.000Z");
    }
}
