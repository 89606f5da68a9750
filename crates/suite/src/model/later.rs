//! Times that a test hands over in a message: `${now.in-2s}`.

use std::time::Duration;

/// How long after a message is made the time is that a variable stands for, such as `now.in-2s` or `now.in-500ms`;
/// `None` for every other variable.
#[must_use]
pub fn later(variable: &str) -> Option<Duration> {
    const LONGEST: u64 = 24 * 3600 * 1000;
    let rest = variable.strip_prefix("now.in-")?;
    let (digits, each) = match rest.strip_suffix("ms") {
        Some(digits) => (digits, 1),
        None => (rest.strip_suffix('s')?, 1000),
    };
    let is_number = !digits.is_empty() && digits.len() <= 8 && digits.bytes().all(|digit| digit.is_ascii_digit());
    let millis = digits.parse::<u64>().ok().filter(|_| is_number)? * each;
    (millis <= LONGEST).then(|| Duration::from_millis(millis))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_to_come_is_a_whole_number_of_seconds_or_milliseconds() {
        assert_eq!(later("now.in-2s"), Some(Duration::from_secs(2)));
        assert_eq!(later("now.in-500ms"), Some(Duration::from_millis(500)));
        for other in [
            "now",
            "now.in-s",
            "now.in-1.5s",
            "now.in--1s",
            "now.in-2",
            "time.react",
            "now.in-99999999s",
        ] {
            assert_eq!(later(other), None, "{other}");
        }
    }
}
