//! Times as recorders write them.

use jiff::Timestamp;

/// Reads a time: RFC 3339, the form of `mosquitto_sub` with `Z` before the offset, a time without an offset (taken for
/// UTC), or a number of seconds, milliseconds, microseconds or nanoseconds since 1970.
pub(super) fn read(written: &str) -> Option<Timestamp> {
    let text = written.trim().trim_matches('"');
    if let Ok(number) = text.parse::<f64>() {
        return of_number(text, number);
    }
    if text.len() > 64 || !text.is_ascii() {
        return None;
    }
    // `mosquitto_sub` writes local time, a `Z` that means nothing, and the offset.
    let text = ["Z+", "Z-"]
        .iter()
        .fold(text.to_owned(), |text, sign| text.replace(sign, &sign[1..]));
    let parsed = text.parse().ok().or_else(|| format!("{text}Z").parse().ok());
    parsed.or_else(|| {
        // Some write a colon, or a comma, before the milliseconds.
        let (before, fraction) = text.rsplit_once([':', ','])?;
        let is_fraction = before.matches(':').count() == 2 && fraction.bytes().all(|byte| byte.is_ascii_digit());
        is_fraction.then(|| format!("{before}.{fraction}Z").parse().ok())?
    })
}

/// The unit follows from the size: every time between 1973 and 2286 is told apart.
fn of_number(text: &str, number: f64) -> Option<Timestamp> {
    const BILLION: f64 = 1e9;
    let scale = [1.0, 1e3, 1e6, 1e9];
    let unit = scale.into_iter().find(|unit| number.abs() < 10.0 * BILLION * unit)?;
    if let Ok(whole) = text.parse::<i128>() {
        #[expect(clippy::cast_possible_truncation, reason = "one of four small powers of ten")]
        let per_unit = (1e9 / unit) as i128;
        return Timestamp::from_nanosecond(whole.checked_mul(per_unit)?).ok();
    }
    #[expect(clippy::cast_possible_truncation, reason = "bounded above")]
    let micros = (number / unit * 1e6).round() as i64;
    Timestamp::from_microsecond(micros).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_many_recorders_are_the_same() {
        let wanted: Timestamp = "2026-01-02T03:04:05.250Z".parse().expect("time");
        let millis = wanted.as_millisecond();
        for text in [
            "2026-01-02T03:04:05.250Z".to_owned(),
            "\"2026-01-02T03:04:05.250000Z+0000\"".to_owned(),
            "2026-01-02T05:04:05.250000Z+0200".to_owned(),
            "2026-01-01T22:04:05.250000-0500".to_owned(),
            "2026-01-02 03:04:05.250".to_owned(),
            "2026-01-02 03:04:05:250".to_owned(),
            "2026-01-02 03:04:05,250".to_owned(),
            millis.to_string(),
            format!("{millis}000"),
            format!("{millis}000000"),
            "1767323045.25".to_owned(),
        ] {
            assert_eq!(read(&text), Some(wanted), "{text}");
        }
    }

    #[test]
    fn anything_else_is_no_time() {
        for text in ["", "soon", "1e300", "NaN", "12:00", "2026-13-01T00:00:00Z", "üüüü"] {
            assert_eq!(read(text), None, "{text}");
        }
    }
}
