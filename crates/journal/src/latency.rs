//! How long the harness itself takes with what comes to it.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Times of which the longest is less than twice the shortest are told apart in so many steps.
const STEPS: usize = 16;
/// The two to the power of this in microseconds, 19 hours, is not told from more.
const LONGEST: u32 = 36;
/// How many different times are told apart.
const PLACES: usize = (LONGEST as usize - 3) * STEPS;

/// How long the harness took itself with the messages that came to it in a run; what the device took is not in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct OwnLatency {
    /// From when the tap has read a message until it has handed it on to the other side. Absent where no message has passed a
    /// tap; what a link fault holds back is not in it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub passed_on: Option<Spread>,
    /// From when the tap or the harness's own connection has read a message until it was recorded and judged. Absent where no
    /// message came.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub judged: Option<Spread>,
}

impl OwnLatency {
    /// `None` where nothing was measured.
    #[must_use]
    pub fn of(passed_on: Option<Spread>, judged: Option<Spread>) -> Option<Self> {
        (passed_on.is_some() || judged.is_some()).then_some(Self { passed_on, judged })
    }

    /// What holds for this run and for another one together.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        let both = |one: Option<Spread>, other| one.into_iter().chain(other).reduce(Spread::and);
        Self {
            passed_on: both(self.passed_on, other.passed_on),
            judged: both(self.judged, other.judged),
        }
    }
}

/// How times are spread, in microseconds. Median and 99 of 100 are rounded up by a sixteenth at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Spread {
    /// How many were measured.
    pub count: u64,
    /// Half of them are no longer.
    pub median_micros: u64,
    /// Ninety-nine of a hundred are no longer.
    pub p99_micros: u64,
    /// The longest.
    pub worst_micros: u64,
}

impl Spread {
    /// What holds for these times and for others together: half of all of them are no longer than the longer median, and so on.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            count: self.count.saturating_add(other.count),
            median_micros: self.median_micros.max(other.median_micros),
            p99_micros: self.p99_micros.max(other.p99_micros),
            worst_micros: self.worst_micros.max(other.worst_micros),
        }
    }

    /// The longest time.
    #[must_use]
    pub fn worst(self) -> Duration {
        Duration::from_micros(self.worst_micros)
    }
}

/// Counts times in a table that does not grow, however many there are.
#[derive(Clone, Debug)]
pub struct Histogram {
    counts: Vec<u64>,
    count: u64,
    worst: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            counts: vec![0; PLACES],
            count: 0,
            worst: 0,
        }
    }
}

impl Histogram {
    /// Counts a time so often.
    pub fn note(&mut self, time: Duration, times: u64) {
        let micros = u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
        if times > 0
            && let Some(place) = self.counts.get_mut(place(micros))
        {
            *place += times;
            self.count += times;
            self.worst = self.worst.max(micros);
        }
    }

    /// How what was counted is spread; `None` of nothing.
    #[must_use]
    pub fn spread(&self) -> Option<Spread> {
        (self.count > 0).then(|| Spread {
            count: self.count,
            median_micros: self.within(50),
            p99_micros: self.within(99),
            worst_micros: self.worst,
        })
    }

    /// A time in microseconds than which so many of a hundred are no longer.
    fn within(&self, of_hundred: u64) -> u64 {
        let wanted = self.count.saturating_mul(of_hundred).div_ceil(100);
        let mut seen: u64 = 0;
        let reached = self.counts.iter().position(|count| {
            seen += count;
            seen >= wanted
        });
        reached.map_or(self.worst, |place| longest_at(place).min(self.worst))
    }
}

/// Where a time is counted. Up to two [`STEPS`] each microsecond has a place; then the last bits are left out, one more with each
/// power of two.
fn place(micros: u64) -> usize {
    let micros = micros.min((1 << LONGEST) - 1);
    let left_out = micros.max(1).ilog2().saturating_sub(STEPS.ilog2());
    let kept = usize::try_from(micros >> left_out).unwrap_or(0);
    left_out as usize * STEPS + kept
}

/// The longest time that is counted there.
fn longest_at(place: usize) -> u64 {
    let left_out = (place / STEPS).saturating_sub(1);
    let kept = (place - left_out * STEPS) as u64;
    ((kept + 1) << left_out) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(all: impl IntoIterator<Item = u64>) -> Spread {
        let mut histogram = Histogram::default();
        for micros in all {
            histogram.note(Duration::from_micros(micros), 1);
        }
        histogram.spread().expect("times")
    }

    #[test]
    fn every_time_has_a_place_that_is_a_sixteenth_too_long_at_most() {
        for shift in 0..40 {
            for micros in [1_u64 << shift, (1 << shift) + 1, (3 << shift) / 2, (2 << shift) - 1] {
                let shown = longest_at(place(micros));
                if micros < 1 << LONGEST {
                    assert!(shown >= micros && shown - micros <= micros / 16, "{micros}: {shown}");
                }
                assert!(place(micros) < PLACES, "{micros}");
            }
        }
        assert_eq!(place(u64::MAX), PLACES - 1);
        for place_of in 0..PLACES {
            assert_eq!(place(longest_at(place_of)), place_of);
        }
    }

    #[test]
    fn one_slow_message_of_a_hundred_is_the_worst_and_moves_nothing_else() {
        let all = spread((0..99).map(|_| 20).chain([7_000]));
        assert_eq!(
            all,
            Spread {
                count: 100,
                median_micros: 20,
                p99_micros: 20,
                worst_micros: 7_000
            }
        );
        let two = spread((0..98).map(|_| 20).chain([5_000, 7_000]));
        assert!((5_000..=5_312).contains(&two.p99_micros), "{two:?}");
    }

    #[test]
    fn nothing_is_shown_of_nothing_and_no_time_is_longer_than_the_longest() {
        assert_eq!(Histogram::default().spread(), None);
        let mut none = Histogram::default();
        none.note(Duration::from_secs(1), 0);
        assert_eq!(none.spread(), None);
        let one = spread([1_000]);
        assert_eq!(
            (one.median_micros, one.p99_micros, one.worst_micros),
            (1_000, 1_000, 1_000)
        );
    }

    #[test]
    fn together_nothing_is_shorter_than_it_was() {
        let (fast, slow) = (spread([10; 50]), spread([10, 900]));
        let both = fast.and(slow);
        assert_eq!(both, slow.and(fast));
        assert_eq!((both.count, both.worst_micros), (52, 900));
        let tap = OwnLatency::of(Some(fast), None).expect("measured");
        let all = tap.and(OwnLatency::of(Some(slow), Some(slow)).expect("measured"));
        assert_eq!((all.passed_on, all.judged), (Some(both), Some(slow)));
        assert_eq!(OwnLatency::of(None, None), None);
    }
}
